!> Forces and energies do not depend on where a body lies and how it is turned: not in double, not
!> in mixed precision. The projected dilatation does, which a run with it tells.
module test_force_frame
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, sp
  use pd_base_numbers, only: pi
  use pd_set_up_prepare, only: set_up_type
  use pd_family_family, only: bonds_type, allocate_bonds
  use pd_family_lattice, only: lattice_family_type
  use pd_force_forces, only: energy_pass
  use pd_force_reference, only: reference_force
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_output_report_rotation, only: turned_part, rotation_angle
  use pd_scene_content_types, only: scene_type
  use comparisons, only: max_abs
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: box_scene, diary_type, expect, expect_true, ready_alone, rotation_matrix, &
    & shake, text_of
  use force_subjects, only: subject_type, kinds, tolerance, spacing, build, fast_force, name_of, &
    & some_gradient
  implicit none (type, external)
  private
  public :: collect_force_frame

  real(wp), parameter :: axis(3) = [2.0_wp, -3.0_wp, 6.0_wp]/7.0_wp

contains

  subroutine collect_force_frame(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a rotated body has rotated forces and the same energy', test_turned), &
      & new_unittest('the projected dilatation vanishes at a right angle', test_projected), &
      & new_unittest('mixed precision keeps its digits for any position of a body', test_moved), &
      & new_unittest('a spinning, vibrating body keeps its energy', test_spinning), &
      & new_unittest('rotations are found at any strain', test_angle), &
      & new_unittest('rotated bodies are distinguished from strained and broken ones', test_part)]
  end subroutine collect_force_frame

  !> The axis of rotations in so many dimensions.
  pure function axis_of(dim) result(a)
    integer, intent(in) :: dim
    real(wp) :: a(3)
    a = [0.0_wp, 0.0_wp, 1.0_wp]
    if (dim == 3) a = axis
  end function axis_of

  !> Displacements `u` (n_slots, dim), and then a rotation of everything about the origin.
  pure subroutine turn(subject, R, u, turned)
    type(subject_type), intent(in) :: subject
    real(wp), intent(in) :: R(3, 3)
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(out) :: turned(:, :)
    integer :: k, dim

    dim = size(u, 2)
    turned = 0.0_wp
    do k = 1, size(u, 1)
      if (subject%body%point(k) == 0) cycle
      turned(k, :) = matmul(R(:dim, :dim), subject%body%x(k, :) + u(k, :)) - subject%body%x(k, :)
    end do
  end subroutine turn

  !> Lambda = 1: strains from tiny ones, in all ranges of the formulas, under any rotation. Stretch
  !> comes from differences of displacements as large as the body: a force may be off by eps of that
  !> of a unit stretch, summed over the family, some hundred times eps as in the test of rigid
  !> motions; single precision rounds eta, so there eps is that of eta/|xi|. Energies, in double for
  !> all, are off by twice the strain times that of the stretch.
  subroutine test_turned(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: degrees(*) = [10.0_wp, 90.0_wp, 137.0_wp, 180.0_wp]
    real(wp), parameter :: strains(*) = [1.0e-5_wp, 2.0e-3_wp, 0.02_wp, 0.3_wp]
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), turned(:, :), force(:, :), f_turned(:, :), p(:), w(:), &
      & w_turned(:)
    real(wp) :: R(3, 3), unit_force, unit_energy
    integer :: kind, dim, i, a, k, way

    do kind = 1, size(kinds)
      do dim = 2, 3
        do way = 1, 2
          subject = subject_type(kind=kinds(kind), dim=dim, projected=.false., &
            & poissons_ratio=0.4_wp, surface=way == 2, two_materials=way == 2, hole=way == 2, &
            & crack=way == 2)
          call build(subject)
          if (allocated(u)) deallocate (u, turned, w, w_turned)
          associate (n => subject%body%n_slots)
            allocate (u(n, dim), turned(n, dim), w(n), w_turned(n), source=0.0_wp)
          end associate
          call shake(subject%body, identity(), 0.0_wp, 1, u)
          call fast_force(subject, u, force, p)
          unit_force = max_abs(force)
          call energy_pass(subject%family, subject%model, subject%workspace, u, w)
          unit_energy = maxval(w)
          do i = 1, size(strains)
            call shake(subject%body, some_gradient(strains(i)), 0.3_wp*strains(i)*spacing, 71, u)
            call fast_force(subject, u, force, p)
            call energy_pass(subject%family, subject%model, subject%workspace, u, w)
            do a = 1, size(degrees)
              R = rotation_matrix(axis_of(dim), degrees(a)*pi/180)
              call turn(subject, R, u, turned)
              call fast_force(subject, turned, f_turned, p)
              do k = 1, size(force, 1)
                f_turned(k, :) = matmul(f_turned(k, :), R(:dim, :dim)) - force(k, :)
              end do
              call expect_true(error, all(abs(f_turned) <= tolerance(kinds(kind), &
                & 300*epsilon(1.0_wp), 30*real(epsilon(1.0_sp), wp))*unit_force), 'force, ' &
                & //name_of(subject, i)//', degrees '//text_of(degrees(a)))
              call energy_pass(subject%family, subject%model, subject%workspace, turned, w_turned)
              call expect_true(error, all(abs(w_turned - w) <= 300*epsilon(1.0_wp)*strains(i) &
                & *unit_energy), 'energy, '//name_of(subject, i)//', degrees ' &
                & //text_of(degrees(a)))
            end do
          end do
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_turned

  pure function identity() result(one)
    real(wp) :: one(3, 3)
    one = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [3, 3])
  end function identity

  !> As printed, theta has the factor Lambda, the cosine of the angle by which bonds have turned:
  !> what is left of it at 90 degrees is of the order of the strain, and at 60 degrees half.
  subroutine test_projected(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), turned(:, :), force(:, :), p(:), p_turned(:)
    real(wp), parameter :: strain = 1.0e-3_wp
    integer :: kind

    do kind = 1, size(kinds)
      subject = subject_type(kind=kinds(kind), dim=2, poissons_ratio=0.4_wp)
      call build(subject)
      if (allocated(u)) deallocate (u, turned)
      allocate (u(subject%body%n_slots, 2), turned(subject%body%n_slots, 2))
      call shake(subject%body, strain*identity(), 0.0_wp, 1, u)
      call fast_force(subject, u, force, p)
      call turn(subject, rotation_matrix(axis_of(2), pi/2), u, turned)
      call fast_force(subject, turned, force, p_turned)
      call expect_true(error, all(abs(p_turned) <= 2*strain*max_abs(p)), 'at 90 degrees, ' &
        & //trim(kinds(kind)))
      call turn(subject, rotation_matrix(axis_of(2), pi/3), u, turned)
      call fast_force(subject, turned, force, p_turned)
      call expect_true(error, all(abs(p_turned - p/2) <= 2*strain*max_abs(p)), &
        & 'at 60 degrees, '//trim(kinds(kind)))
    end do
  end subroutine test_projected

  !> Bodies that are strained by 1e-5 and moved by up to ten lengths of the body, against the theory
  !> point by point in double precision. A bond is off by some roundings of 6e-8 of its stretch,
  !> and by 2^-46 (|u_k| + |u_j|)/|xi|: at 110 spacings 3e-12, 3e-7 of the strain. Net forces are
  !> sums of up to 120 bonds, of either sign.
  subroutine test_moved(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: lengths(*) = [0.0_wp, 1.0_wp, -1.0_wp, 10.0_wp]
    real(wp), parameter :: direction(3) = [1.0_wp, -0.61_wp, 0.37_wp]
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), force(:, :), p(:), f_ref(:, :)
    real(wp) :: allowed
    integer :: dim, way, i, k

    do dim = 1, 3
      do way = 1, 3
        subject = subject_type(kind='mixed', dim=dim, surface=.true., bond_based=way == 1, &
          & projected=way == 2, poissons_ratio=0.3_wp)
        call build(subject)
        select type (family => subject%family)
        type is (lattice_family_type)
          call expect_true(error, family%mixed .eqv. dim > 1, 'precision, '//name_of(subject, way))
        end select
        if (allocated(u)) deallocate (u, f_ref)
        allocate (u(subject%body%n_slots, dim), f_ref(subject%body%n_slots, dim), source=0.0_wp)
        do i = 1, size(lengths)
          call shake(subject%body, some_gradient(1.0e-5_wp), 1.0e-6_wp*spacing, 81, u)
          do k = 1, size(u, 1)
            if (subject%body%point(k) > 0) u(k, :) = u(k, :) &
              & + lengths(i)*11*spacing*direction(:dim)
          end do
          call fast_force(subject, u, force, p)
          call reference_force(subject%family, subject%model, u, f_ref)
          allowed = 5.0e-7_wp*(1 + abs(lengths(i))/10)
          ! in double, eps |u|/|xi| of the strain, and roundings
          if (dim == 1) allowed = 1.0e-12_wp + 4*epsilon(1.0_wp)*11*abs(lengths(i))/1.0e-5_wp
          call expect_true(error, all(abs(force - f_ref) <= allowed*max_abs(f_ref)), 'force, ' &
            & //name_of(subject, way)//', lengths away '//text_of(lengths(i))//', off by ' &
            & //text_of(max_abs(force - f_ref)/max_abs(f_ref)))
        end do
        if (allocated(error)) return
      end do
    end do
  end subroutine test_moved

  !> A body with a large dilatational stiffness that vibrates and turns three times as a whole. With
  !> Lambda = 1 the force is the gradient of the energy, which then swings with the step and does
  !> not drift: the means of the first and the last quarter differ by what a beat of some vibrations
  !> leaves of the swing. The projected dilatation takes and gives energy at every turn.
  subroutine test_spinning(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: dilatations(2) = [character(11) :: 'unprojected', 'projected']
    real(wp), parameter :: turns = 3.0_wp
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: drift(2), spin
    integer :: i, dim, steps

    do dim = 2, 3
      do i = 1, 2
        call box_scene([6, 5, 4], 1.0e-3_wp, 0.45_wp, scene)
        if (dim == 2) call box_scene([9, 7], 1.0e-3_wp, 0.45_wp, scene)
        scene%header%plane = 'strain'
        scene%horizon%dilatation = dilatations(i)
        deallocate (scene%initial)
        allocate (scene%initial(1))
        ! at the rim some 2 % of the speed of sound
        spin = 2.0e4_wp
        scene%initial(1)%displacement_gradient(1, 1) = 6.0e-3_wp
        scene%initial(1)%displacement_gradient(2, 2) = 3.0e-3_wp
        scene%initial(1)%velocity_gradient(1, 2) = -spin
        scene%initial(1)%velocity_gradient(2, 1) = spin
        call ready_alone(scene, set_up, error)
        if (allocated(error)) return
        steps = ceiling(turns*2*pi/spin/(0.5_wp*set_up%plan%limit))
        diary = diary_type(every=max(1, steps/200))
        call run_explicit(set_up%system, 'velocity_verlet', 0.5_wp*set_up%plan%limit, steps, &
          & diary, fault)
        if (allocated(fault)) then
          call test_failed(error, fault%message)
          return
        end if
        associate (energy => diary%kinetic + diary%strain, q => diary%n/4)
          drift(i) = abs(sum(energy(diary%n - q + 1:)) - sum(energy(:q)))/(q*diary%strain(1))
        end associate
      end do
      call expect(error, drift(1), 0.0_wp, 3.0e-3_wp, 'unprojected: energy gained over that of '// &
        & 'the strain')
      call expect_true(error, drift(2) > 10*drift(1), 'projected: energy gained over that of '// &
        & 'the strain: '//text_of(drift(2))//', unprojected '//text_of(drift(1)))
    end do
  end subroutine test_spinning

  !> F = R U with a symmetric U: the angle of R, whatever the strain and the family: full, all bonds
  !> in a plane, along a line. Newton's method ends within 1e-9.
  subroutine test_angle(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: degrees(*) = [0.0_wp, 0.5_wp, 9.9_wp, 10.1_wp, 90.0_wp, 175.0_wp]
    real(wp), parameter :: strains(*) = [0.0_wp, 1.0e-3_wp, 0.3_wp]
    real(wp) :: U(3, 3), R(3, 3), K(3, 3)
    integer :: i, s, rank

    do i = 1, size(degrees)
      do s = 1, size(strains)
        do rank = 1, 3
          U = identity() + strains(s)*reshape([1.0_wp, 0.4_wp, 0.0_wp, 0.4_wp, -0.5_wp, 0.0_wp, &
            & 0.0_wp, 0.0_wp, 0.8_wp], [3, 3])
          K = 0.0_wp
          K(1, 1) = 3.0_wp
          if (rank > 1) K(2, 2) = 2.0_wp
          if (rank > 1) K(1, 2) = 0.3_wp
          if (rank > 1) K(2, 1) = 0.3_wp
          if (rank > 2) K(3, 3) = 0.7_wp
          R = rotation_matrix([0.0_wp, 0.0_wp, 1.0_wp], degrees(i)*pi/180)
          if (rank > 1) R = rotation_matrix(axis, degrees(i)*pi/180)
          ! a line turns as its direction does, so it is only stretched here
          if (rank == 1) U(2, 1) = 0.0_wp
          ! acos has half the digits near 0
          call expect(error, rotation_angle(K, matmul(R, matmul(U, K)))*180/pi, degrees(i), &
            & merge(1.0e-4_wp, 1.0e-6_wp, degrees(i) < 1), 'angle [degrees], rank '// &
            & text_of(real(rank, wp))//', strain '//text_of(strains(s)))
        end do
      end do
    end do
  end subroutine test_angle

  !> Beyond the limit all points count, short of it none; strain alone is no rotation, and points
  !> that have lost their bonds may turn as they like.
  subroutine test_part(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: limit = pi/18
    type(subject_type) :: subject
    type(bonds_type) :: bonds
    real(wp), allocatable :: u(:, :), turned(:, :)
    real(wp) :: share, largest
    integer :: kind, dim, i, k, m

    do kind = 1, size(kinds)
      do dim = 2, 3
        subject = subject_type(kind=kinds(kind), dim=dim, breaking=.true., hole=.true.)
        call build(subject)
        if (allocated(u)) deallocate (u, turned)
        allocate (u(subject%body%n_slots, dim), turned(subject%body%n_slots, dim))
        ! symmetric: a strain of 20 % and more
        call shake(subject%body, 0.2_wp*reshape([1.0_wp, 0.5_wp, 0.3_wp, 0.5_wp, -1.0_wp, 0.2_wp, &
          & 0.3_wp, 0.2_wp, 0.5_wp], [3, 3]), 0.0_wp, 1, u)
        call turned_part(subject%body, subject%family, u, limit, share, largest)
        call expect(error, share, 0.0_wp, 0.0_wp, 'strained, '//name_of(subject, 0))
        call turn(subject, rotation_matrix(axis_of(dim), 9.9_wp*pi/180), u, turned)
        call turned_part(subject%body, subject%family, turned, limit, share, largest)
        call expect(error, share, 0.0_wp, 0.0_wp, 'by 9.9 degrees, '//name_of(subject, 0))
        call turn(subject, rotation_matrix(axis_of(dim), 10.1_wp*pi/180), u, turned)
        call turned_part(subject%body, subject%family, turned, limit, share, largest)
        call expect(error, share, 1.0_wp, 0.0_wp, 'by 10.1 degrees, '//name_of(subject, 0))
        call expect(error, largest*180/pi, 10.1_wp, 1.0e-6_wp, 'the angle, '//name_of(subject, 0))
        ! a crack's points: every third point loses all its bonds and flies off
        call allocate_bonds(subject%family, bonds)
        u = 0.0_wp
        do i = 1, subject%body%n_points, 3
          k = subject%body%slot(i)
          call subject%family%bonds_of(k, bonds)
          do m = 1, bonds%n
            call subject%family%break_bond(k, m)
            call break_other_end(subject, int(bonds%j(m)), k)
          end do
          u(k, :) = [(10*spacing*sin(real(7*i + m, wp)), m=1, dim)]
        end do
        call turned_part(subject%body, subject%family, u, limit, share, largest)
        call expect(error, share, 0.0_wp, 0.0_wp, 'loose points, '//name_of(subject, 0))
        if (allocated(error)) return
      end do
    end do
  end subroutine test_part

  !> Break the bond of slot `k` to slot `j`.
  subroutine break_other_end(subject, k, j)
    type(subject_type), intent(inout) :: subject
    integer, intent(in) :: k, j
    type(bonds_type) :: bonds
    integer :: m

    call allocate_bonds(subject%family, bonds)
    call subject%family%bonds_of(k, bonds)
    do m = 1, bonds%n
      if (bonds%j(m) == j) call subject%family%break_bond(k, m)
    end do
  end subroutine break_other_end

end module test_force_frame
