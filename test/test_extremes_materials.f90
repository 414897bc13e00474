!> Poisson's ratios at the ends of what is allowed: right, or refused with the reason.
module test_extremes_materials
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: pi
  use pd_base_error, only: fault_type => error_type, status_no_answer
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_watch_fault, only: check_strain_energy
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_account, only: energies_of, energies_type
  use pd_motion_system, only: evaluate
  use pd_force_bound, only: stiffness_bound
  use pd_scene_content_types, only: scene_type
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: at_point, box_scene, density_of_steel, diary_type, expect, expect_true, noise, &
    & ready_alone, text_of, youngs_modulus
  implicit none (type, external)
  private
  public :: collect_extremes_materials

  real(wp), parameter :: dx = 1.0e-2_wp     !! spacing of all bodies here [m]
  real(wp), parameter :: h = 2.0e-3_wp      !! thickness of plates [m]
  real(wp), parameter :: delta = 3.015_wp*dx
  character(9), parameter :: families(*) = [character(9) :: 'lattice', 'list']

  !> From 1/2 down to -1, both sides of the special ratio of blocks and plane strain among them.
  real(wp), parameter :: ratios(*) = [0.4999999_wp, 0.4999_wp, 0.25_wp + 1.0e-9_wp, &
    & 0.25_wp - 1.0e-9_wp, 0.0_wp, -0.9_wp, -0.999_wp]

contains

  subroutine collect_extremes_materials(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('plane waves have the lattice sum at every Poisson''s ratio', test_waves), &
      & new_unittest('no wave is faster than the step allows', test_step_covers), &
      & new_unittest('7.25 as printed has no step where its sum is negative', test_printed), &
      & new_unittest('beside the special ratio forces differ by its distance', test_special), &
      & new_unittest('the step decreases with the root of 1/2 - nu', test_incompressible), &
      & new_unittest('at -0.9 a free block keeps its energy', test_auxetic), &
      & new_unittest('a body that gains energy by straining is refused', test_negative)]
  end subroutine collect_extremes_materials

  !> a, b, d of doc/theory.md, 1, in 3D and plane strain, written down again.
  pure subroutine constants(dim, nu, a, b, d)
    integer, intent(in) :: dim
    real(wp), intent(in) :: nu
    real(wp), intent(out) :: a, b, d
    real(wp) :: mu, kappa

    mu = youngs_modulus/(2*(1 + nu))
    if (dim == 3) then
      kappa = youngs_modulus/(3*(1 - 2*nu))
      a = (kappa - 5*mu/3)/2
      b = 15*mu/(2*pi*delta**5)
      d = 9/(4*pi*delta**4)
    else
      kappa = youngs_modulus/(2*(1 + nu)*(1 - 2*nu))
      a = (kappa - 2*mu)/2
      b = 6*mu/(pi*h*delta**4)
      d = 2/(pi*h*delta**3)
    end if
  end subroutine constants

  !> Minus the force density where u = A cos(k.(x - x0)) is greatest, in an infinite lattice, to
  !> first order in A: with the sums over the family
  !> g = sum w n sin(k.xi)/|xi|,   B = sum w n n (1 - cos(k.xi))/|xi|,   w = v_c V
  !> the dilatation is -d delta (g.A) sin(k.(x - x0)), and -f = 2 a (d delta)^2 g (g.A)
  !> + 4 b delta B.A.
  pure function wave_force(dim, nu, k, A_wave) result(minus_f)
    integer, intent(in) :: dim
    real(wp), intent(in) :: nu
    real(wp), intent(in) :: k(:), A_wave(:)
    real(wp) :: minus_f(dim)
    real(wp) :: g(3), BA(3), xi(3), n(3), length, w, a, b, d, volume, along
    integer :: i, j, l, high

    call constants(dim, nu, a, b, d)
    volume = merge(dx**3, dx**2*h, dim == 3)
    high = merge(3, 0, dim == 3)
    g = 0.0_wp
    BA = 0.0_wp
    do l = -high, high
      do j = -3, 3
        do i = -3, 3
          xi = dx*[i, j, l]
          length = norm2(xi)
          if (length <= 0.0_wp .or. length > delta) cycle
          n = xi/length
          w = min(1.0_wp, (delta + dx/2 - length)/dx)*volume
          along = dot_product(k, xi(:dim))
          g = g + w*n*sin(along)/length
          BA = BA + w*n*dot_product(n(:dim), A_wave)*(1 - cos(along))/length
        end do
      end do
    end do
    minus_f = 2*a*(d*delta)**2*g(:dim)*dot_product(g(:dim), A_wave) + 4*b*delta*BA(:dim)
  end function wave_force

  !> A body of 13 points along each direction: its middle point and all members of its family have
  !> full families.
  subroutine full_body(dim, nu, family, scene)
    integer, intent(in) :: dim
    real(wp), intent(in) :: nu
    character(*), intent(in) :: family
    type(scene_type), intent(out) :: scene
    integer :: i
    call box_scene([(13, i=1, dim)], dx, nu, scene)
    scene%header%plane = 'strain'
    scene%horizon%family = family
  end subroutine full_body

  !> Random wave numbers over the whole zone |k_c| <= pi/dx, and directions of motion.
  subroutine random_wave(seed, k, A_wave)
    integer, intent(inout) :: seed
    real(wp), intent(out) :: k(:), A_wave(:)
    integer :: c

    do c = 1, size(k)
      k(c) = pi/dx*noise(seed)
      A_wave(c) = noise(seed)
    end do
    A_wave = A_wave/norm2(A_wave)
  end subroutine random_wave

  !> At a crest the terms of second order cancel, and those of third are 1e-18 at amplitudes of 1e-9
  !> dx: what is left is the rounding of sums of some 100 terms, of the size of a + E.
  subroutine test_waves(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: amplitude = 1.0e-9_wp*dx
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp) :: k(3), A_wave(3), expected(3), found(3), scale, a, b, d
    integer :: dim, r, f, wave, seed, middle, s

    seed = 4711
    do dim = 2, 3
      do r = 1, size(ratios)
        do f = 1, size(families)
          call full_body(dim, ratios(r), trim(families(f)), scene)
          call ready_alone(scene, set_up, error)
          if (allocated(error)) return
          call constants(dim, ratios(r), a, b, d)
          associate (system => set_up%system)
            middle = at_point(system%body, [(6.5_wp*dx, s=1, dim)])
            do wave = 1, 4
              call random_wave(seed, k(:dim), A_wave(:dim))
              do s = 1, system%body%n_slots
                if (system%body%point(s) > 0) system%state%u(s, :) = amplitude*A_wave(:dim) &
                  & *cos(dot_product(k(:dim), system%body%x(s, :) - system%body%x(middle, :)))
              end do
              call evaluate(system, 0.0_wp, breaking=.false.)
              found(:dim) = -system%state%force(middle, :)/amplitude
              expected(:dim) = wave_force(dim, ratios(r), k(:dim), A_wave(:dim))
              scale = (abs(a) + youngs_modulus)/dx**2
              call expect(error, norm2(found(:dim) - expected(:dim)), 0.0_wp, 1.0e-12_wp*scale, &
                & 'force of a wave, '//trim(families(f))//', nu = '//text_of(ratios(r)))
            end do
          end associate
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_waves

  !> The square of every wave's frequency, A.K.A/rho, is below that of the step, 4/dt^2, and above
  !> 0, at 300 waves of each ratio. With a < 0 the bound must not be smaller for it.
  subroutine test_step_covers(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp) :: k(3), A_wave(3), squared
    integer :: dim, r, wave, seed

    seed = 815
    do dim = 2, 3
      do r = 1, size(ratios)
        call full_body(dim, ratios(r), 'lattice', scene)
        call ready_alone(scene, set_up, error)
        if (allocated(error)) return
        do wave = 1, 300
          call random_wave(seed, k(:dim), A_wave(:dim))
          squared = dot_product(A_wave(:dim), wave_force(dim, ratios(r), k(:dim), A_wave(:dim))) &
            & /density_of_steel
          call expect_true(error, squared > 0.0_wp .and. squared*set_up%plan%limit**2 < 4.0_wp, &
            & 'omega dt = '//text_of(sqrt(abs(squared))*set_up%plan%limit)//', nu = '// &
            & text_of(ratios(r)))
        end do
      end do
    end do
  end subroutine test_step_covers

  !> With the plain sign of a the sum of 7.25 is negative in a plate of nu = -0.9 in plane stress
  !> with a horizon of six spacings: there is no printed step (0); the step used is finite, and that
  !> of the part of b alone.
  subroutine test_printed(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: nu = -0.9_wp, wide = 6.015_wp*dx
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: bound(:)
    real(wp) :: b, expected, length
    integer :: f, i, j

    b = 6*youngs_modulus/(2*(1 + nu))/(pi*h*wide**4)
    expected = 0.0_wp
    do j = -6, 6
      do i = -6, 6
        length = dx*norm2(real([i, j], wp))
        if (length <= 0.0_wp .or. length > wide) cycle
        expected = expected + 4*b*wide*min(1.0_wp, (wide + dx/2 - length)/dx)*dx**2*h/length
      end do
    end do
    do f = 1, size(families)
      call box_scene([25, 25], dx, nu, scene)
      scene%horizon%ratio = wide/dx
      scene%horizon%family = families(f)
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      associate (system => set_up%system)
        allocate (bound(system%body%n_slots), source=0.0_wp)
        call stiffness_bound(system%body, system%family, system%model, &
        & system%workspace, bound)
        call expect(error, maxval(bound), expected, 1.0e-12_wp*expected, 'bound at nu = -0.9')
        call expect_true(error, all(bound(system%body%slot) > 0.0_wp), 'a bound is not positive')
        deallocate (bound)
      end associate
      call expect(error, set_up%plan%limit, sqrt(2*density_of_steel/expected), &
        & 1.0e-12_wp*set_up%plan%limit, 'step at nu = -0.9')
      call expect(error, set_up%plan%printed, 0.0_wp, 0.0_wp, 'step of 7.25 as printed')
    end do
  end subroutine test_printed

  !> The force of noise at nu = 1/4 + e, without the pass of the dilatation at e = 0: it is linear
  !> in e, so the two sides' mean is the middle to e^2 = 1e-18, that is to the rounding of the sums,
  !> and the difference is of the size of e: d ln(kappa)/d nu is 4, d ln(mu)/d nu is -0.8.
  subroutine test_special(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: e = 1.0e-9_wp
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: force(:, :, :)
    real(wp) :: size_of
    integer :: f, side, i, c, seed

    do f = 1, size(families)
      do side = -1, 1
        call box_scene([6, 5, 5], dx, 0.25_wp + side*e, scene)
        scene%horizon%family = families(f)
        scene%horizon%surface_correction = 'energy'
        call ready_alone(scene, set_up, error)
        if (allocated(error)) return
        associate (system => set_up%system)
          call expect_true(error, system%model%dilatation .eqv. side /= 0, &
            & 'the pass of the dilatation')
          seed = 99
          do i = 1, system%body%n_points
            do c = 1, 3
              system%state%u(system%body%slot(i), c) = 1.0e-4_wp*dx*noise(seed)
            end do
          end do
          call evaluate(system, 0.0_wp, breaking=.false.)
          if (.not. allocated(force)) allocate (force(system%body%n_points, 3, -1:1))
          force(:, :, side) = system%state%force(system%body%slot, :)
        end associate
      end do
      size_of = norm2(force(:, :, 0))
      call expect(error, norm2(force(:, :, 1) + force(:, :, -1) - 2*force(:, :, 0)), 0.0_wp, &
        & 1.0e-13_wp*size_of, 'mean of both sides')
      call expect_true(error, norm2(force(:, :, 1) - force(:, :, -1)) < 2*4*e*size_of .and. &
        & norm2(force(:, :, 1) - force(:, :, -1)) > 0.1_wp*e*size_of, 'difference of both sides')
      if (allocated(error)) return
    end do
  end subroutine test_special

  !> kappa grows as 1/(1/2 - nu), and its part of the bound with it: the step's square divided by
  !> 1/2 - nu comes to rest, within the part of mu, 3 (1/2 - nu). A block thrown with a random
  !> velocity keeps its energy at that step.
  subroutine test_incompressible(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: away(*) = [1.0e-4_wp, 1.0e-6_wp, 1.0e-9_wp]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp) :: quotient(size(away))
    integer :: i

    do i = 1, size(away)
      call box_scene([6, 5, 5], dx, 0.5_wp - away(i), scene)
      scene%horizon%surface_correction = 'energy'
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      quotient(i) = set_up%plan%limit**2/away(i)
      call expect_energy(set_up, 0.9_wp, 800, error)
    end do
    ! 1/2 - nu is rounded to 1e-16/1e-9
    call expect(error, quotient(1)/quotient(3), 1.0_wp, 1.0e-3_wp, 'step at nu = 0.4999')
    call expect(error, quotient(2)/quotient(3), 1.0_wp, 1.0e-5_wp, 'step at nu = 0.499999')
  end subroutine test_incompressible

  !> Throw the points of a free body at random and let it swing for `steps` steps at `part` of the
  !> stable one: its energy stays. Leapfrog keeps an energy that differs from it by a share of
  !> (omega dt)^2/4 < 1 that comes and goes, so it may lose but never gain without bound.
  subroutine expect_energy(set_up, part, steps, error)
    type(set_up_type), intent(inout) :: set_up
    real(wp), intent(in) :: part
    integer, intent(in) :: steps
    type(error_type), allocatable, intent(inout) :: error
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: total(:)
    integer :: i, c, seed

    if (allocated(error)) return
    seed = 31
    do i = 1, set_up%system%body%n_points
      do c = 1, set_up%system%body%dim
        set_up%system%state%v(set_up%system%body%slot(i), c) = 1.0e-3_wp*noise(seed)
      end do
    end do
    diary%every = 10
    call run_explicit(set_up%system, 'forward_backward', part*set_up%plan%limit, steps, diary, &
      & fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    total = diary%kinetic + diary%strain
    call expect_true(error, all(diary%strain >= 0.0_wp), 'negative strain energy')
    call expect_true(error, maxval(total) < 1.5_wp*total(1) .and. minval(total) > 0.2_wp*total(1), &
      & 'energy between '//text_of(minval(total)/total(1))//' and '// &
      & text_of(maxval(total)/total(1))//' of the start''s')
    ! over the run it goes nowhere: means of its two halves
    i = size(total)/2
    call expect(error, sum(total(i + 1:2*i))/sum(total(:i)), 1.0_wp, 0.05_wp, 'drift of the energy')
  end subroutine expect_energy

  subroutine test_auxetic(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    integer :: f

    do f = 1, size(families)
      call box_scene([8, 6, 6], dx, -0.9_wp, scene)
      scene%horizon%family = families(f)
      call ready_alone(scene, set_up, error)
      call expect_energy(set_up, 0.9_wp, 800, error)
    end do
    ! this block is stable at -0.8 with surface correction, too (not every one is)
    call box_scene([7, 6, 6], dx, -0.8_wp, scene)
    scene%horizon%surface_correction = 'energy'
    call ready_alone(scene, set_up, error)
    call expect_energy(set_up, 0.9_wp, 800, error)
  end subroutine test_auxetic

  !> At -0.9 surface correction makes the dilatation of a small block's corners so strong that the
  !> block gains energy as it grows (its stiffness has one negative eigenvalue, -0.004 of the
  !> largest, by a dense solver). No step helps; the energy says so, and what to do.
  subroutine test_negative(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(energies_type) :: energies
    type(fault_type), allocatable :: fault
    integer :: i

    call box_scene([7, 6, 6], dx, -0.9_wp, scene)
    scene%horizon%surface_correction = 'energy'
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      do i = 1, system%body%n_points
        associate (k => system%body%slot(i))
          system%state%u(k, :) = 1.0e-4_wp*system%body%x(k, :)
        end associate
      end do
      call energies_of(system, system%state%v, energies)
      call check_strain_energy(system, energies, 0.0_wp, fault)
    end associate
    call expect_true(error, energies%strain < 0.0_wp, 'the block is stable')
    call expect_true(error, allocated(fault), 'negative energy is not refused')
    if (allocated(error)) return
    call expect_true(error, fault%status == status_no_answer .and. &
      & index(fault%message, 'strain energy is negative') > 0 .and. &
      & index(fault%message, '-0.9') > 0 .and. &
      & index(fault%message, 'surface_correction = ''none''') > 0, fault%message)
    ! the energy of a body at rest is no fault
    energies = energies_type()
    call check_strain_energy(set_up%system, energies, 0.0_wp, fault)
    call expect_true(error, .not. allocated(fault), 'rest is refused')
  end subroutine test_negative

end module test_extremes_materials
