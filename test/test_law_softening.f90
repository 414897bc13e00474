!> The law `softening`: the curve of a bond against the energy of a linear one, its unloading, and
!> the balance of work, stored and dissipated energy along any path.
module test_law_softening
  use pd_base_kinds, only: wp
  use pd_law_law, only: allocate_law_bonds, law_bonds_type
  use pd_law_laws, only: all_laws, law_table_type
  use pd_law_material, only: never, new_material
  use pd_law_softening, only: softening_law, softening_law_type
  use pd_law_weighted, only: bond_based_law, weighted_law_type
  use testdrive, only: error_type, new_unittest, unittest_type
  use bodies, only: expect_true, youngs_modulus
  use comparisons, only: expect_close
  implicit none (type, external)
  private
  public :: collect_law_softening

  real(wp), parameter :: delta = 2.7_wp, h = 0.3_wp, A = 0.2_wp  !! no powers of each other
  real(wp), parameter :: s_c = 0.02_wp  !! critical stretch of the linear bond
  integer, parameter :: n = 9           !! bonds of the point

contains

  subroutine collect_law_softening(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('the area under the curve is the energy of a linear bond at its critical '// &
      & 'stretch', test_area), &
      & new_unittest('the curve is the bilinear one', test_curve), &
      & new_unittest('bonds unload to the origin, and reload to the curve', test_unloading), &
      & new_unittest('closed cracks have the stiffness of the start', test_compression), &
      & new_unittest('work is what is stored and dissipated along any path', test_balance), &
      & new_unittest('a bond that breaks between commits loses no energy', test_release), &
      & new_unittest('damage is 1 less the secant stiffness over the first one', test_damage), &
      & new_unittest('both ends of a bond have the same bits', test_symmetry), &
      & new_unittest('forces and energies leave the history as it is', test_trial), &
      & new_unittest('laws that cannot be had say why', test_refusal)]
  end subroutine collect_law_softening

  !> A linear law and one that softens of the same energy, with the peak at `part` of s_c.
  subroutine two_laws(dim, influence, part, linear, law)
    integer, intent(in) :: dim
    character(*), intent(in) :: influence
    real(wp), intent(in) :: part
    type(weighted_law_type), intent(out) :: linear
    type(softening_law_type), intent(out) :: law
    real(wp) :: Gc

    linear = bond_based_law()
    linear%influence = influence
    law = softening_law()
    law%influence = influence
    law%parameters(1)%value = part*s_c
    call linear%set_up(new_material(youngs_modulus, 0.25_wp, 1.0_wp, dim, .false., h, A, delta, &
      & .true.), dim, .false., delta, merge(h, A, dim == 2))
    call law%set_up(linear%material, dim, .false., delta, merge(h, A, dim == 2))
    ! Gc of the linear law grows with the square of its critical stretch
    Gc = (s_c/linear%critical_stretch(1.0_wp))**2
    law%material%critical_stretch = law%critical_stretch(Gc)
  end subroutine two_laws

  !> Bonds of different lengths, volumes and surface factors, not stretched.
  subroutine some_bonds(bonds)
    type(law_bonds_type), intent(out) :: bonds
    integer :: i

    call allocate_law_bonds(n, 1, 0, 0, bonds)
    bonds%n = n
    do i = 1, n
      bonds%length(i) = delta*i/real(n + 1, wp)
      bonds%volume(i) = 0.5_wp + 0.1_wp*modulo(7*i, 5)
      bonds%Gb(i) = 0.9_wp + 0.05_wp*modulo(3*i, 4)
    end do
    bonds%stretch = 0.0_wp
  end subroutine some_bonds

  !> Work of the point's own parts per volume while each bond goes straight from one stretch to
  !> another, its history as it is. The pull is linear between 0, kappa, s_0 and s_u, so that the
  !> trapezoidal rule between these is exact.
  real(wp) function work_between(law, bonds, from, to) result(work)
    type(softening_law_type), intent(in) :: law
    type(law_bonds_type), intent(in) :: bonds
    real(wp), intent(in) :: from(n), to(n)
    type(law_bonds_type) :: present
    real(wp) :: pull(n, 0:5), at(n, 0:5), swap
    integer :: i, c, other

    do i = 1, n
      at(i, :) = [from(i), 0.0_wp, bonds%history(1, i), law%parameters(1)%value, &
        & law%material%critical_stretch, to(i)]
      at(i, :) = min(max(at(i, :), min(from(i), to(i))), max(from(i), to(i)))
      do c = 1, 5
        do other = c, 1, -1
          if (at(i, other - 1) <= at(i, other)) exit
          swap = at(i, other)
          at(i, other) = at(i, other - 1)
          at(i, other - 1) = swap
        end do
      end do
      if (to(i) < from(i)) at(i, :) = at(i, 5:0:-1)
    end do
    present = bonds
    do c = 0, 5
      present%stretch(:n) = at(:, c)
      call law%forces(present, pull(:, c))
    end do
    work = 0.0_wp
    do c = 1, 5
      work = work + sum(bonds%length(:n)*bonds%volume(:n)*(pull(:, c) + pull(:, c - 1))/2 &
        & *(at(:, c) - at(:, c - 1)))
    end do
  end function work_between

  !> Areas of the pulls from 0 to s_u, in all dimensions and with all influence functions, against
  !> the energy of the law `bond_based` at its critical stretch.
  subroutine test_area(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: influences(*) = [character(8) :: 'inverse', 'constant', 'linear', &
      & 'gaussian']
    real(wp), parameter :: parts(*) = [0.1_wp, 0.5_wp, 0.99_wp]
    type(weighted_law_type) :: linear
    type(softening_law_type) :: law
    type(law_bonds_type) :: bonds
    real(wp) :: expected
    integer :: dim, i, p

    do dim = 1, 3
      do i = 1, size(influences)
        do p = 1, size(parts)
          call two_laws(dim, trim(influences(i)), parts(p), linear, law)
          call expect_close(error, law%material%critical_stretch, s_c/parts(p), 1.0e-13_wp, 's_u')
          call some_bonds(bonds)
          bonds%stretch(:n) = s_c
          expected = linear%energy(bonds)
          bonds%stretch(:n) = 0.0_wp
          call expect_close(error, work_between(law, bonds, spread(0.0_wp, 1, n), &
            & spread(law%material%critical_stretch, 1, n)), expected, 1.0e-12_wp*expected, &
            & 'area with influence '//trim(influences(i)))
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_area

  !> Pulls on first loading against those of the linear law up to the peak, and against the line
  !> from the peak to s_u.
  subroutine test_curve(error)
    type(error_type), allocatable, intent(out) :: error
    type(weighted_law_type) :: linear
    type(softening_law_type) :: law
    type(law_bonds_type) :: bonds
    real(wp) :: pull(n), peak(n), expected(n)
    integer :: step

    call two_laws(3, 'constant', 0.4_wp, linear, law)
    call some_bonds(bonds)
    associate (s_0 => 0.4_wp*s_c, s_u => s_c/0.4_wp)
      bonds%stretch = s_0
      call linear%forces(bonds, peak)
      do step = 1, 30
        bonds%stretch = step*0.1_wp*s_c
        call law%forces(bonds, pull)
        call linear%forces(bonds, expected)
        if (bonds%stretch(1) > s_0) expected = peak*max((s_u - bonds%stretch(:n))/(s_u - s_0), &
          & 0.0_wp)
        call expect_close(error, pull/peak, expected/peak, 1.0e-13_wp, 'pull over its peak')
      end do
    end associate
    bonds%stretch = 0.7_wp*s_c
    bonds%volume(3) = 0.0_wp
    call law%forces(bonds, pull)
    call expect_close(error, pull(3), 0.0_wp, 0.0_wp, 'pull of a broken bond')
  end subroutine test_curve

  !> After a stretch on the falling branch, pulls are proportional to the stretch up to that one,
  !> and on the curve of first loading beyond.
  subroutine test_unloading(error)
    type(error_type), allocatable, intent(out) :: error
    type(weighted_law_type) :: linear
    type(softening_law_type) :: law
    type(law_bonds_type) :: bonds, fresh
    real(wp) :: pull(n), top(n), dissipated
    integer :: step

    call two_laws(2, 'inverse', 0.5_wp, linear, law)
    call some_bonds(bonds)
    fresh = bonds
    bonds%stretch = 1.3_wp*s_c
    call law%forces(bonds, top)
    call law%commit(bonds, dissipated)
    call expect_true(error, dissipated > 0.0_wp, 'nothing was dissipated')
    call expect_close(error, bonds%history(1, :), 1.3_wp*s_c, 0.0_wp, 'greatest stretch')
    do step = 0, 13
      bonds%stretch = step*0.1_wp*s_c
      call law%forces(bonds, pull)
      call expect_close(error, pull/top, step/13.0_wp, 1.0e-13_wp, 'unloading')
      call law%commit(bonds, dissipated)
      call expect_close(error, dissipated, 0.0_wp, 0.0_wp, 'dissipated while unloaded')
    end do
    do step = 14, 22
      bonds%stretch = step*0.1_wp*s_c
      fresh%stretch = bonds%stretch
      call law%forces(bonds, pull)
      call law%forces(fresh, top)
      call expect_close(error, pull, top, 0.0_wp, 'reloading beyond')
    end do
  end subroutine test_unloading

  !> Compression has the pulls and the energy of the linear law at any damage.
  subroutine test_compression(error)
    type(error_type), allocatable, intent(out) :: error
    type(weighted_law_type) :: linear
    type(softening_law_type) :: law
    type(law_bonds_type) :: bonds
    real(wp) :: pull(n), expected(n), dissipated

    call two_laws(3, 'gaussian', 0.5_wp, linear, law)
    call some_bonds(bonds)
    bonds%stretch = 1.9_wp*s_c
    call law%commit(bonds, dissipated)
    bonds%stretch = -0.7_wp*s_c
    call law%forces(bonds, pull)
    call linear%forces(bonds, expected)
    call expect_close(error, pull/expected, 1.0_wp, 1.0e-14_wp, 'pull')
    call expect_close(error, law%energy(bonds)/linear%energy(bonds), 1.0_wp, 1.0e-14_wp, 'energy')
    call law%commit(bonds, dissipated)
    call expect_close(error, dissipated, 0.0_wp, 0.0_wp, 'dissipated')
    call expect_close(error, bonds%history(1, :), 1.9_wp*s_c, 0.0_wp, 'greatest stretch')
  end subroutine test_compression

  !> Random paths of all bonds, to compression and beyond s_u. The work is exact, so that the
  !> balance closes to rounding, before a commit and after it.
  subroutine test_balance(error)
    type(error_type), allocatable, intent(out) :: error
    type(weighted_law_type) :: linear
    type(softening_law_type) :: law
    type(law_bonds_type) :: bonds
    real(wp) :: from(n), to(n), work, lost, dissipated, scale
    integer :: step, size_of_seed, i

    call random_seed(size=size_of_seed)
    call random_seed(put=[(4711 + 37*i, i=1, size_of_seed)])
    call two_laws(3, 'constant', 0.6_wp, linear, law)
    call some_bonds(bonds)
    bonds%stretch = s_c
    scale = linear%energy(bonds)
    from = 0.0_wp
    work = 0.0_wp
    lost = 0.0_wp
    do step = 1, 200
      call random_number(to)
      to = s_c*(3*to - 1)*min(1.0_wp, step/100.0_wp)
      work = work + work_between(law, bonds, from, to)
      bonds%stretch(:n) = to
      call expect_close(error, (lost + law%energy(bonds) - work)/scale, 0.0_wp, 1.0e-12_wp, &
        & 'balance before the commit')
      call law%commit(bonds, dissipated)
      call expect_true(error, dissipated >= 0.0_wp, 'energy was gained')
      lost = lost + dissipated
      call expect_close(error, (lost + law%energy(bonds) - work)/scale, 0.0_wp, 1.0e-12_wp, &
        & 'balance after the commit')
      if (allocated(error)) return
      from = to
    end do
    call expect_close(error, lost/scale, 1.0_wp, 1.0e-12_wp, 'dissipated by bonds beyond s_u')
  end subroutine test_balance

  !> Of bonds that are stretched from half of their way beyond s_u and break there, the dissipated
  !> energy and that which is released have the sum of the whole.
  subroutine test_release(error)
    type(error_type), allocatable, intent(out) :: error
    type(weighted_law_type) :: linear
    type(softening_law_type) :: law
    type(law_bonds_type) :: bonds
    real(wp) :: scale, first, second, released

    call two_laws(2, 'constant', 0.6_wp, linear, law)
    call some_bonds(bonds)
    bonds%stretch = s_c
    scale = linear%energy(bonds)
    call law%commit(bonds, first)
    bonds%stretch = 1.01_wp*s_c/0.6_wp
    released = law%energy(bonds)
    bonds%volume = 0.0_wp
    released = released - law%energy(bonds)
    call law%commit(bonds, second)
    call expect_true(error, first > 0.1_wp*scale .and. released > 0.1_wp*scale, 'both have a part')
    call expect_close(error, (first + released)/scale, 1.0_wp, 1.0e-13_wp, 'whole energy')
    call expect_close(error, second, 0.0_wp, 0.0_wp, 'dissipated by broken bonds')
  end subroutine test_release

  !> Damage against pulls after unloading, which the linear law gives at the start.
  subroutine test_damage(error)
    type(error_type), allocatable, intent(out) :: error
    type(weighted_law_type) :: linear
    type(softening_law_type) :: law
    type(law_bonds_type) :: bonds
    real(wp) :: pull(n), start(n), damage(n), dissipated
    integer :: i

    call two_laws(1, 'linear', 0.5_wp, linear, law)
    call some_bonds(bonds)
    call law%bond_damage(bonds, damage)
    call expect_close(error, damage, 0.0_wp, 0.0_wp, 'damage of the start')
    do i = 1, n
      bonds%stretch(i) = s_c*0.3_wp*(i - 1)
    end do
    call law%commit(bonds, dissipated)
    bonds%stretch = 0.1_wp*s_c
    call law%forces(bonds, pull)
    call linear%forces(bonds, start)
    call law%bond_damage(bonds, damage)
    call expect_close(error, damage, 1 - pull/start, 1.0e-13_wp, 'damage')
    call expect_close(error, damage(:2), 0.0_wp, 0.0_wp, 'damage before the peak')
    call expect_close(error, damage(8:), 1.0_wp, 0.0_wp, 'damage beyond s_u')
    call expect_true(error, all(damage(3:7) > 0.0_wp .and. damage(3:7) < 1.0_wp), &
      & 'damage between')
  end subroutine test_damage

  !> A bond as its two ends see it, among other bonds and at other places in the arrays.
  subroutine test_symmetry(error)
    type(error_type), allocatable, intent(out) :: error
    type(weighted_law_type) :: linear
    type(softening_law_type) :: law
    type(law_bonds_type) :: one, other
    real(wp) :: pull(n), pull_of_other(n), dissipated
    integer :: step

    call two_laws(2, 'gaussian', 0.5_wp, linear, law)
    call some_bonds(one)
    call some_bonds(other)
    other%length(2) = one%length(7)
    other%Gb(2) = one%Gb(7)
    do step = 1, 60
      one%stretch = s_c*sin(real(step, wp))*step/25.0_wp
      other%stretch = s_c*cos(real(step, wp))*step/25.0_wp
      other%stretch(2) = one%stretch(7)
      call law%forces(one, pull)
      call law%forces(other, pull_of_other)
      call expect_close(error, pull_of_other(2), pull(7), 0.0_wp, 'pull')
      call law%commit(one, dissipated)
      call law%commit(other, dissipated)
      call expect_close(error, other%history(1, 2), one%history(1, 7), 0.0_wp, 'greatest stretch')
    end do
    call expect_true(error, one%history(1, 7) > 0.5_wp*s_c, 'the bond never softened')
  end subroutine test_symmetry

  !> Solvers try states that they leave again: those must leave nothing behind.
  subroutine test_trial(error)
    type(error_type), allocatable, intent(out) :: error
    type(weighted_law_type) :: linear
    type(softening_law_type) :: law
    type(law_bonds_type) :: bonds
    real(wp) :: before(n), pull(n), energy, dissipated

    call two_laws(3, 'inverse', 0.5_wp, linear, law)
    call some_bonds(bonds)
    bonds%stretch = 0.8_wp*s_c
    call law%commit(bonds, dissipated)
    call law%forces(bonds, before)
    bonds%stretch = 1.7_wp*s_c
    call law%forces(bonds, pull)
    energy = law%energy(bonds)
    call expect_true(error, energy > 0.0_wp, 'no energy')
    call expect_close(error, bonds%history(1, :), 0.8_wp*s_c, 0.0_wp, 'history')
    bonds%stretch = 0.8_wp*s_c
    call law%forces(bonds, pull)
    call expect_close(error, pull, before, 0.0_wp, 'pull after the trial')
  end subroutine test_trial

  !> Reasons, and the law in the table.
  subroutine test_refusal(error)
    type(error_type), allocatable, intent(out) :: error
    type(weighted_law_type) :: linear
    type(softening_law_type) :: law
    type(law_table_type) :: table

    table = all_laws()
    call expect_true(error, table%number_of('softening') > 0, 'the law is not in the table')
    call two_laws(3, 'inverse', 0.5_wp, linear, law)
    call expect_true(error, law%refusal() == '', 'refused: '//law%refusal())
    law%material%break_in_compression = .true.
    call expect_true(error, index(law%refusal(), 'break_in_compression') > 0, 'compression')
    law%material%break_in_compression = .false.
    law%material%critical_stretch = never
    call expect_true(error, index(law%refusal(), 'needs critical_energy_release_rate') > 0, &
      & 'no energy')
    call two_laws(3, 'inverse', 1.5_wp, linear, law)
    call expect_true(error, index(law%refusal(), 'below s_c = 0.02,') > 0, 'peak above s_c: '// &
      & law%refusal())
  end subroutine test_refusal

end module test_law_softening
