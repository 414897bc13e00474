!> What every force loop must do, whatever the family it works on: agree with the theory written
!> point by point, keep momentum, ignore rigid motions, be the gradient of the energy, and give the
!> same bits on any number of threads.
module test_force_contract
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use, intrinsic :: iso_fortran_env, only: real128
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_kinds, only: wp, sp, i1, i4, i8
  use pd_base_lanes, only: lanes
  use pd_base_numbers, only: pi
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_family_lattice, only: lattice_family_type
  use pd_family_list, only: find_turns, list_family_type
  use pd_family_volume, only: volume_none
  use pd_force_breaking, only: break_bonds, damage_of, strained_slots
  use pd_force_forces, only: energy_pass, internal_force, up_to_marks
  use pd_force_list, only: list_dilatation, list_force
  use pd_force_model, only: force_options_type, model_type, options_of, p_of
  use pd_force_polynomial, only: fast_limit, fast_ranges, narrow, wide, single
  use pd_force_reference, only: reference_dilatation, reference_energy, reference_force
  use pd_force_workspace, only: all_blocks, early_blocks, late_blocks
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, unittest_type
  use bodies, only: expect, expect_true, rotation_matrix, shake, text_of
  use force_subjects, only: subject_type, kinds, tolerance, spacing, build, build_pair, &
    & subject_number, name_of, fast_force, some_gradient
  implicit none (type, external)
  private
  public :: collect_force_contract

contains

  subroutine collect_force_contract(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('fast loops agree with the theory point by point', test_reference), &
      & new_unittest('long: fast loops agree with the theory at more strains', test_more_strains), &
      & new_unittest('long: rotated bodies agree with the theory', test_turned), &
      & new_unittest('a heated body has forces without its thermal strain', test_unheated), &
      & new_unittest('net force and moment vanish', test_balance), &
      & new_unittest('long: rigid motions give no force', test_rigid), &
      & new_unittest('the force is the gradient of the energy', test_gradient), &
      & new_unittest('bonds do not depend on the order of their ends', test_mirror), &
      & new_unittest('stretch keeps its digits from 1e-16 to 10', test_stretch), &
      & new_unittest('crushed bonds give finite forces', test_crushed), &
      & new_unittest('breaking is the same from both ends', test_breaking), &
      & new_unittest('the same bits on 1, 2 and 4 threads', test_threads), &
      & new_unittest('keys that collide change nothing', test_collisions), &
      & new_unittest('clusters of lists share tables', test_shared), &
      & new_unittest('lists need nothing of copies early', test_early), &
      & new_unittest('the fast formulas keep their range for any critical stretch', test_critical)]
  end subroutine collect_force_contract

  !> Strains at which the fast loops take their narrow formulas, and at which they take the general
  !> ones for most bonds and the others for some.
  subroutine test_reference(error)
    type(error_type), allocatable, intent(out) :: error
    call compare_with_reference([1.0e-4_wp, 0.5_wp], error)
  end subroutine test_reference

  !> From tiny strains to those where the wide formulas serve most bonds.
  subroutine test_more_strains(error)
    type(error_type), allocatable, intent(out) :: error
    call compare_with_reference([1.0e-9_wp, 2.0e-3_wp, 0.03_wp], error)
  end subroutine test_more_strains

  !> Force, dilatation and energy by both ways, at several strains, since loops may
  !> take other formulas for small ones. Each is a sum of some 100 terms, with different order and
  !> forms of the same formula: a few hundred rounding errors of its largest term; temperatures add
  !> theirs. Bonds in single precision have 6e-8 in place of 1e-16, some tens of which make 1e-6.
  subroutine compare_with_reference(strains, error)
    real(wp), intent(in) :: strains(:)  !! of the bodies; neighbours are shaken by half of it
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), force(:, :), p(:), f_ref(:, :), theta(:), w(:), w_ref(:)
    real(wp) :: largest
    integer :: kind, number, i, k
    logical :: there

    do kind = 1, size(kinds)
      number = 0
      do
        number = number + 1
        call subject_number(kinds(kind), number, subject, there)
        if (.not. there) exit
        associate (n => subject%body%n_slots)
          if (allocated(u)) deallocate (u, f_ref, theta, w, w_ref)
          allocate (u(n, subject%dim), f_ref(n, subject%dim), theta(n), w(n), w_ref(n), &
            & source=0.0_wp)
        end associate
        do i = 1, size(strains)
          call shake(subject%body, some_gradient(strains(i)), 0.5_wp*strains(i)*spacing, &
            & 3 + number, u)
          call fast_force(subject, u, force, p)
          call reference_force(subject%family, subject%model, u, f_ref)
          largest = max_abs(f_ref)
          call expect_true(error, largest > 0.0_wp, 'no force: '//name_of(subject, number))
          call expect_close(error, force, f_ref, &
            & tolerance(kinds(kind), 1.0e-12_wp, 1.0e-6_wp)*largest, 'force, '//name_of(subject, &
            & number))
          if (subject%model%dilatation) then
            call reference_dilatation(subject%family, subject%model, u, theta)
            theta = theta*[(p_of(subject%model, k), k=1, size(theta))]
            call expect_close(error, p, theta, &
              & tolerance(kinds(kind), 1.0e-12_wp, 1.0e-6_wp)*max_abs(theta), 'dilatation, &
              & '//name_of(subject, number))
          end if
          call energy_pass(subject%family, subject%model, subject%workspace, u, w)
          call reference_energy(subject%family, subject%model, u, w_ref)
          call expect_close(error, w, w_ref, &
            & tolerance(kinds(kind), 1.0e-12_wp, 1.0e-7_wp)*max_abs(w_ref), 'energy, &
            & '//name_of(subject, number))
        end do
        if (allocated(error)) return
      end do
      call expect_true(error, number > 50, 'too few subjects')
    end do
  end subroutine compare_with_reference

  !> Forces of a heated body that leave out its thermal strain, as tangents want them, after forces
  !> that had it: those of the theory for the same body without temperatures. Tolerance as above.
  subroutine test_unheated(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: strain = 1.0e-4_wp
    type(subject_type) :: subject
    type(model_type) :: cold
    type(force_options_type) :: options
    real(wp), allocatable :: u(:, :), force(:, :), p(:), f_ref(:, :)
    integer(i1), allocatable :: strained(:)
    integer :: kind, number, heated
    logical :: there

    do kind = 1, size(kinds)
      number = 0
      heated = 0
      do
        number = number + 1
        call subject_number(kinds(kind), number, subject, there)
        if (.not. there) exit
        if (.not. subject%thermal) cycle
        heated = heated + 1
        associate (n => subject%body%n_slots)
          if (allocated(u)) deallocate (u, f_ref, strained)
          allocate (u(n, subject%dim), f_ref(n, subject%dim), source=0.0_wp)
          allocate (strained(n), source=0_i1)
        end associate
        call shake(subject%body, some_gradient(strain), 0.5_wp*strain*spacing, 5 + number, u)
        call fast_force(subject, u, force, p)
        cold = subject%model
        cold%thermal = .false.
        call reference_force(subject%family, cold, u, f_ref)
        options = options_of(subject%model)
        options%thermal = .false.
        call internal_force(subject%body, subject%family, subject%model, options, &
          & subject%workspace, u, p, force, strained)
        call expect_close(error, force, f_ref, tolerance(kinds(kind), 1.0e-12_wp, 1.0e-6_wp) &
          & *max_abs(f_ref), 'force, '//name_of(subject, number))
        if (allocated(error)) return
      end do
      call expect_true(error, heated > 3, 'too few heated subjects')
    end do
  end subroutine test_unheated

  !> Bodies that are strained by 0.3 % and 3 % and turned by any angle, where eta is as long as the
  !> bond. Both ways lose what forming e loses, some roundings of |eta|/|xi| out of a strain of
  !> 3e-3 (doc/theory.md, 2): 1e-12 of the largest force, and several hundred terms of a sum.
  subroutine test_turned(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: degrees(*) = [1.0_wp, 77.0_wp, 180.0_wp]
    real(wp), parameter :: strains(*) = [3.0e-3_wp, 0.03_wp]
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), force(:, :), p(:), f_ref(:, :), theta(:)
    real(wp) :: R(3, 3), axis(3)
    integer :: kind, number, a, i, k
    logical :: there

    do kind = 1, size(kinds)
      if (kinds(kind) == 'mixed') cycle
      number = 0
      do
        number = number + 1
        call subject_number(kinds(kind), number, subject, there)
        if (.not. there) exit
        if (subject%dim == 1) cycle
        associate (n => subject%body%n_slots)
          if (allocated(u)) deallocate (u, f_ref, theta)
          allocate (u(n, subject%dim), f_ref(n, subject%dim), theta(n), source=0.0_wp)
        end associate
        do a = 1, size(degrees)
          axis = [0.0_wp, 0.0_wp, 1.0_wp]
          if (subject%dim == 3) axis = [2.0_wp, -3.0_wp, 6.0_wp]/7.0_wp
          R = rotation_matrix(axis, degrees(a)*pi/180)
          do i = 1, size(strains)
            call shake(subject%body, some_gradient(strains(i)), 0.2_wp*strains(i)*spacing, &
              & 5 + number, u)
            do k = 1, subject%body%n_slots
              if (subject%body%point(k) == 0) cycle
              u(k, :) = matmul(R(:subject%dim, :subject%dim), subject%body%x(k, :) + u(k, :)) &
                & - subject%body%x(k, :)
            end do
            call fast_force(subject, u, force, p)
            call reference_force(subject%family, subject%model, u, f_ref)
            call expect_true(error, all(abs(force - f_ref) <= 1.0e-11_wp*max_abs(f_ref)), &
              & 'force of a turned body, '//name_of(subject, number)//', degrees ' &
              & //text_of(degrees(a)))
            if (subject%model%dilatation) then
              call reference_dilatation(subject%family, subject%model, u, theta)
              theta = theta*[(p_of(subject%model, k), k=1, size(theta))]
              call expect_true(error, all(abs(p - theta) <= 1.0e-11_wp*max_abs(theta)), &
                & 'dilatation of a turned body, '//name_of(subject, number))
            end if
          end do
        end do
        if (allocated(error)) return
      end do
    end do
  end subroutine test_turned

  !> sum V f = 0 and sum y x V f = 0: action and reaction are equal along the deformed bond. The sum
  !> of |V f| over all points has an error of one rounding per term; 1e-13 of it leaves some
  !> hundred. In single precision roundings are 6e-8 and average out over the points.
  subroutine test_balance(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), force(:, :), p(:)
    real(wp) :: net(3), moment(3), applied, y(3), f(3), arm
    integer :: kind, number, k
    logical :: there

    do kind = 1, size(kinds)
      number = 0
      do
        number = number + 1
        call subject_number(kinds(kind), number, subject, there)
        if (.not. there) exit
        if (allocated(u)) deallocate (u)
        allocate (u(subject%body%n_slots, subject%dim))
        call shake(subject%body, some_gradient(0.1_wp), 0.1_wp*spacing, 11 + number, u)
        call fast_force(subject, u, force, p)
        net = 0.0_wp
        moment = 0.0_wp
        applied = 0.0_wp
        do k = 1, subject%body%n_slots
          y = 0.0_wp
          f = 0.0_wp
          y(:subject%dim) = subject%body%x(k, :) + u(k, :)
          f(:subject%dim) = force(k, :)*subject%body%volume(k)
          net = net + f
          moment = moment + [y(2)*f(3) - y(3)*f(2), y(3)*f(1) - y(1)*f(3), y(1)*f(2) - y(2)*f(1)]
          applied = applied + sum(abs(f))
        end do
        arm = 20*spacing
        call expect_close(error, net, 0.0_wp, tolerance(kinds(kind), 1.0e-13_wp, &
          & 1.0e-7_wp)*applied, &
          & 'net force, '//name_of(subject, number))
        call expect_close(error, moment, 0.0_wp, &
          & tolerance(kinds(kind), 1.0e-13_wp, 1.0e-7_wp)*applied*arm, &
          & 'net moment, '//name_of(subject, number))
        if (allocated(error)) return
      end do
    end do
  end subroutine test_balance

  !> A translation by many body lengths and rotations by any angle. Stretch comes from differences
  !> of displacements, each rounded to eps |u|: the force may reach eps |u|/|xi| of that of a unit
  !> stretch, summed over the family. Forces at unit stretch come from a uniform expansion.
  subroutine test_rigid(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: degrees(*) = [1.0e-6_wp, 1.0_wp, 30.0_wp, 77.0_wp, 90.0_wp, 180.0_wp, &
      & 271.0_wp]
    real(wp), parameter :: far(3) = [1.0_wp, -0.5_wp, 0.25_wp]
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), force(:, :), p(:)
    real(wp) :: R(3, 3), axis(3), unit_force
    integer :: kind, number, a, k
    logical :: there

    do kind = 1, size(kinds)
      number = 0
      do
        number = number + 1
        call subject_number(kinds(kind), number, subject, there)
        if (.not. there) exit
        if (subject%thermal) cycle
        if (allocated(u)) deallocate (u)
        allocate (u(subject%body%n_slots, subject%dim), source=0.0_wp)
        do k = 1, subject%body%n_slots
          u(k, :) = subject%body%x(k, :)*merge(1.0_wp, 0.0_wp, subject%body%point(k) > 0)
        end do
        call fast_force(subject, u, force, p)
        unit_force = max_abs(force)
        u = 0.0_wp
        do k = 1, subject%body%n_slots
          if (subject%body%point(k) > 0) u(k, :) = far(:subject%dim)
        end do
        call fast_force(subject, u, force, p)
        call expect_close(error, force, 0.0_wp, 0.0_wp, 'translation, '//name_of(subject, &
          & number))
        do a = 1, size(degrees)
          if (subject%dim == 1) exit
          axis = [0.0_wp, 0.0_wp, 1.0_wp]
          if (subject%dim == 3) axis = [2.0_wp, -3.0_wp, 6.0_wp]/7.0_wp
          R = rotation_matrix(axis, degrees(a)*pi/180)
          do k = 1, subject%body%n_slots
            if (subject%body%point(k) == 0) cycle
            u(k, :) = matmul(R(:subject%dim, :subject%dim), subject%body%x(k, &
              & :)) - subject%body%x(k, :)
          end do
          call fast_force(subject, u, force, p)
          call expect_close(error, force, 0.0_wp, tolerance(kinds(kind), &
            & 300*epsilon(1.0_wp), 10*real(epsilon(1.0_sp), wp))*unit_force, &
            & 'rotation, '//name_of(subject, number)//', degrees '//text_of(degrees(a)))
        end do
        if (allocated(error)) return
      end do
    end do
  end subroutine test_rigid

  !> -dE/du = V f with Lambda = 1 (unprojected). Central differences of step h have an error of h^2
  !> times the third derivative and eps/h times the energy: 1e-7 of the largest force at
  !> h = 1e-5 spacings. Surface factors and several materials included, breaking not. Strains of up
  !> to some 8 % with temperatures, which take the general formulas, and without, where the two
  !> ranges of the fast ones and the general ones serve some bonds each; and of up to 1 %, for the
  !> narrow range. In single precision a force is off by 1e-7 of that of a bond, some 1e-6 of the
  !> largest.
  subroutine test_gradient(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), force(:, :), p(:)
    real(wp) :: h, slope, largest
    integer :: kind, dim, k, c, i
    integer, parameter :: chosen(*) = [1, 3, 4, 8, 12, 15]
    logical, parameter :: heated(*) = [.true., .false., .false.]
    real(wp), parameter :: strains(*) = [0.05_wp, 0.05_wp, 0.006_wp]
    integer :: way

    do kind = 1, size(kinds)
      do dim = 1, 3
        do way = 1, size(heated)
          subject = subject_type(kind=kinds(kind), dim=dim, projected=.false., surface=.true., &
            & thermal=heated(way), two_materials=.true., crack=.true., hole=.true., &
            & poissons_ratio=0.4_wp)
          call build(subject)
          if (allocated(u)) deallocate (u)
          allocate (u(subject%body%n_slots, dim))
          call shake(subject%body, some_gradient(strains(way)), strains(way)*spacing, 21, u)
          call fast_force(subject, u, force, p)
          largest = max_abs(force)*maxval(subject%body%volume)
          h = 1.0e-5_wp*spacing
          do i = 1, size(chosen)
            k = subject%body%slot(chosen(i))
            do c = 1, dim
              u(k, c) = u(k, c) + h
              slope = total_energy(subject, u)
              u(k, c) = u(k, c) - 2*h
              slope = (slope - total_energy(subject, u))/(2*h)
              u(k, c) = u(k, c) + h
              call expect(error, subject%body%volume(k)*force(k, c), -slope, &
                & tolerance(kinds(kind), 1.0e-7_wp, 1.0e-6_wp)*largest, 'gradient, ' &
                & //name_of(subject, chosen(i)))
            end do
          end do
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_gradient

  !> Strain energy of the whole body [J].
  real(wp) function total_energy(subject, u) result(energy)
    type(subject_type), intent(inout) :: subject
    real(wp), intent(in) :: u(:, :)
    real(wp), allocatable :: density(:)

    allocate (density(size(u, 1)), source=0.0_wp)
    call energy_pass(subject%family, subject%model, subject%workspace, u, density)
    energy = sum(density*subject%body%volume)
  end function total_energy

  !> A body and its mirror image have mirrored forces: no direction is preferred. To rounding, since
  !> sums run the other way round.
  subroutine test_mirror(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), image(:, :), force(:, :), mirrored(:, :), p(:)
    real(wp) :: middle(3)
    integer :: kind, dim, i, k, c, j
    integer, allocatable :: partner(:)

    do kind = 1, size(kinds)
      do dim = 1, 3
        subject = subject_type(kind=kinds(kind), dim=dim, surface=.true.)
        call build(subject)
        associate (body => subject%body)
          if (allocated(u)) deallocate (u, image, partner)
          allocate (u(body%n_slots, dim), image(body%n_slots, dim), partner(body%n_slots))
          middle = 0.0_wp
          do c = 1, dim
            middle(c) = sum(body%x(body%slot, c))/body%n_points
          end do
          partner = 0
          do i = 1, body%n_points
            do j = 1, body%n_points
              if (norm2(body%x(body%slot(i), :) + body%x(body%slot(j), :) - 2*middle(:dim)) &
                & < 0.1_wp*spacing) partner(body%slot(i)) = body%slot(j)
            end do
          end do
          call shake(body, some_gradient(0.05_wp), 0.05_wp*spacing, 31, u)
          image = 0.0_wp
          do i = 1, body%n_points
            k = body%slot(i)
            image(partner(k), :) = -u(k, :)
          end do
          call fast_force(subject, u, force, p)
          call fast_force(subject, image, mirrored, p)
          do i = 1, body%n_points
            k = body%slot(i)
            call expect_close(error, mirrored(partner(k), :) + force(k, :), 0.0_wp, &
              & tolerance(kinds(kind), 1.0e-12_wp, 1.0e-6_wp)*max_abs(force), 'mirror image, &
              & '//name_of(subject, i))
          end do
        end associate
        if (allocated(error)) return
      end do
    end do
  end subroutine test_mirror

  !> Two points in a plane: the force of their one bond is 2 q s v_c V, so it shows the stretch. The
  !> truth is the definition in quadruple precision from the same displacements. Allowed is what the
  !> theory page (2) says: 8 eps (|s| + |eta|/|xi|), and eps (|u_k| + |u_j|)/|xi| from forming eta.
  subroutine test_stretch(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: angles(*) = [0.0_wp, 0.4_wp, 1.5707963267948966_wp, 2.5_wp, 3.1_wp]
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), force(:, :), p(:)
    real(real128) :: xi(2), eta(2), length, exact
    real(wp) :: found, allowed, weight, scale
    integer :: kind, exponent, a, k, j
    logical :: drifting

    do kind = 1, size(kinds)
      subject = subject_type(kind=kinds(kind), dim=2, bond_based=.true., rule=volume_none)
      call build_pair(subject)
      k = subject%body%slot(1)
      j = subject%body%slot(2)
      allocate (u(subject%body%n_slots, 2))
      weight = 2*subject%model%materials(1)%q*subject%body%volume(j)
      xi = real(subject%body%x(j, :), real128) - real(subject%body%x(k, :), real128)
      length = norm2(xi)
      do exponent = -16, 1
        do a = 1, size(angles)
          drifting = mod(exponent + a, 2) == 0
          u = 0.0_wp
          scale = 10.0_wp**exponent*real(length, wp)
          if (drifting) u(k, :) = 0.3_wp*scale*[0.2_wp, -0.9_wp]
          u(j, :) = u(k, :) + scale*[cos(angles(a) + 0.7_wp), sin(angles(a) + 0.7_wp)]
          call fast_force(subject, u, force, p)
          eta = real(u(j, :), real128) - real(u(k, :), real128)
          exact = (norm2(xi + eta) - length)/length
          ! the force points along the deformed bond
          found = dot_product(force(k, :), real((xi + eta)/norm2(xi + eta), wp))/weight
          allowed = 8*tolerance(kinds(kind), epsilon(1.0_wp), real(epsilon(1.0_sp), wp)) &
            & *(abs(real(exact, wp)) + real(norm2(eta)/length, wp)) &
            & + tolerance(kinds(kind), epsilon(1.0_wp), 2.0_wp**(-46))*(norm2(u(k, &
            & :)) + norm2(u(j, :)))/real(length, wp)
          call expect(error, found, real(exact, wp), allowed, 'stretch, '//trim(kinds(kind)) &
            & //', size 1e'// &
            & text_of(real(exponent, wp))//', angle '//text_of(angles(a)))
        end do
      end do
      deallocate (u)
    end do
  end subroutine test_stretch

  !> All points at one place, and some exactly on top of others: no NaN, no infinity, in fast loops
  !> and reference, in force and energy. The checked build also traps what would make one.
  subroutine test_crushed(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), force(:, :), p(:), f_ref(:, :), w(:)
    integer :: kind, dim, k, way

    do kind = 1, size(kinds)
      do dim = 1, 3
        subject = subject_type(kind=kinds(kind), dim=dim, surface=.true.)
        call build(subject)
        associate (n => subject%body%n_slots)
          if (allocated(u)) deallocate (u, f_ref, w)
          allocate (u(n, dim), f_ref(n, dim), w(n), source=0.0_wp)
        end associate
        do way = 1, 2
          u = 0.0_wp
          do k = 1, subject%body%n_slots
            if (subject%body%point(k) == 0) cycle
            if (way == 1) u(k, :) = -subject%body%x(k, :)
            ! pairs of neighbours meet in the middle between them
            if (way == 2) u(k, 1) = merge(0.5_wp, -0.5_wp, &
              & mod(nint(subject%body%x(k, 1)/spacing + 0.5_wp), 2) == 1)*spacing
          end do
          call fast_force(subject, u, force, p)
          call reference_force(subject%family, subject%model, u, f_ref)
          call energy_pass(subject%family, subject%model, subject%workspace, u, w)
          call expect_true(error, all(abs(force) < 1.0e30_wp) .and. all(abs(p) < 1.0e30_wp), &
            & 'force of crushed bonds, '//name_of(subject, way))
          call expect_true(error, all(abs(f_ref) < 1.0e30_wp), 'reference of crushed bonds, ' &
            & //name_of(subject, way))
          call expect_true(error, all(abs(w) < 1.0e30_wp) .and. sum(w) > 0.0_wp, &
            & 'energy of crushed bonds, '//name_of(subject, way))
          if (way == 1) call expect_close(error, force, 0.0_wp, 0.0_wp, &
            & 'bonds without direction pull nowhere, '//name_of(subject, way))
        end do
        if (allocated(error)) return
      end do
    end do
  end subroutine test_crushed

  !> Strained slots are found by the passes, and every broken bond is broken from both its ends:
  !> damage weighted by family volumes balances, and the energy that is gone is what was dissipated.
  subroutine test_breaking(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), damage(:), again(:)
    integer(i1), allocatable :: strained(:)
    integer(i4), allocatable :: slots(:)
    integer(i8) :: broken
    real(wp) :: before, dissipated
    integer :: kind, dim

    do kind = 1, size(kinds)
      do dim = 1, 3
        subject = subject_type(kind=kinds(kind), dim=dim, breaking=.true., two_materials=.true.)
        call build(subject)
        associate (n => subject%body%n_slots)
          if (allocated(u)) deallocate (u, damage, again, strained)
          allocate (u(n, dim), damage(n), again(n), source=0.0_wp)
          allocate (strained(n), source=0_i1)
        end associate
        call shake(subject%body, some_gradient(0.0_wp), 0.012_wp*spacing, 41, u)
        before = total_energy(subject, u)
        call mark(subject, u, strained)
        call strained_slots(strained, slots)
        call break_bonds(subject%body, subject%family, subject%model, u, slots, damage, broken, &
          & dissipated, laws=subject%workspace%generic)
        call expect_true(error, broken > 0_i8, 'no bond broke, '//name_of(subject, 0))
        call expect_true(error, broken < subject%family%n_bonds/2, 'every bond broke')
        call expect(error, dissipated, before - total_energy(subject, u), &
          & tolerance(kinds(kind), 1.0e-12_wp, 1.0e-7_wp)*before, &
          & 'dissipated energy, '//name_of(subject, 0))
        call expect(error, real(broken, wp), real(broken_by_definition(subject, u), wp), 0.0_wp, &
          & 'broken bonds, '//name_of(subject, 0))
        call damage_of(subject%body, subject%family, again)
        call expect_close(error, damage, again, 0.0_wp, 'damage, ' &
          & //name_of(subject, 0))
        ! a second look at the same state finds nothing more
        call mark(subject, u, strained)
        call strained_slots(strained, slots)
        call break_bonds(subject%body, subject%family, subject%model, u, slots, damage, broken, &
          & dissipated, laws=subject%workspace%generic)
        call expect(error, real(broken, wp), 0.0_wp, 0.0_wp, 'broken a second time')
        if (allocated(error)) return
      end do
    end do
  end subroutine test_breaking

  !> The strained slots, as the first pass over the bonds marks them.
  subroutine mark(subject, u, strained)
    type(subject_type), intent(inout) :: subject
    real(wp), intent(in) :: u(:, :)
    integer(i1), intent(inout) :: strained(:)
    real(wp), allocatable :: force(:, :), p(:)

    allocate (force(size(u, 1), size(u, 2)), p(size(u, 1)), source=0.0_wp)
    call internal_force(subject%body, subject%family, subject%model, options_of(subject%model), &
      & subject%workspace, u, p, force, strained, up_to_marks)
  end subroutine mark

  !> Pairs within the horizon whose stretch |y|/|xi| - 1 is beyond the smaller of the ends' limits,
  !> counted over all pairs of points.
  integer function broken_by_definition(subject, u) result(number)
    type(subject_type), intent(in) :: subject
    real(wp), intent(in) :: u(:, :)
    real(wp) :: xi(subject%dim), length, stretch, limit
    integer :: i, j, k, l

    number = 0
    do i = 1, subject%body%n_points
      do j = i + 1, subject%body%n_points
        k = subject%body%slot(i)
        l = subject%body%slot(j)
        xi = subject%body%x(l, :) - subject%body%x(k, :)
        length = norm2(xi)
        if (length > 3.015_wp*spacing) cycle
        stretch = norm2(xi + u(l, :) - u(k, :))/length - 1
        limit = 0.01_wp*min(subject%body%material(k), subject%body%material(l))
        if (abs(stretch) > limit) number = number + 1
      end do
    end do
  end function broken_by_definition

  !> Passes over lists in two calls, of which the first has no values of copies, give the bits of
  !> one call.
  subroutine test_early(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: points(3, 3) = reshape([400, 1, 1, 50, 30, 1, 24, 13, 10], [3, 3])
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :)
    logical :: breaking
    integer :: dim, kind

    do dim = 1, 3
      do kind = 1, 3
        breaking = kind == 2
        subject = subject_type(kind='list', dim=dim, dilatant=dim == 1, cloud=kind < 3, &
          & breaking=breaking, two_materials=.true., points=points(:, dim))
        call build(subject)
        call expect_true(error, subject%model%dilatation, 'there is a pass for the dilatation')
        if (allocated(error)) return
        if (allocated(u)) deallocate (u)
        allocate (u(subject%body%n_slots, dim), source=0.0_wp)
        call shake(subject%body, some_gradient(0.0_wp), 0.012_wp*spacing, 43, u)
        call compare_early(error, subject, u)
        if (allocated(error)) return
      end do
    end do
  end subroutine test_early

  !> The same for one list, in which a part of the points are copies.
  subroutine compare_early(error, subject, u)
    type(error_type), allocatable, intent(inout) :: error
    type(subject_type), intent(inout) :: subject
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), allocatable :: p(:), force(:, :), p_whole(:), force_whole(:, :), known(:, :)
    integer(i1), allocatable :: strained(:), whole(:)
    logical, allocatable :: copy(:)
    logical :: needs
    type(bonds_type) :: bonds
    integer(i4), allocatable :: copies(:)
    type(force_options_type) :: options
    real(wp) :: border, nan
    integer :: n, i, k

    n = subject%body%n_slots
    border = 0.7_wp*maxval(subject%body%x(:, 1))
    allocate (copy(n))
    do k = 1, n
      copy(k) = subject%body%point(k) > 0 .and. subject%body%x(k, 1) > border
    end do
    copies = pack([(int(k, i4), k=1, n)], copy)
    allocate (p_whole(n), source=0.0_wp)
    allocate (force_whole(n, subject%dim), source=0.0_wp)
    allocate (whole(merge(n, 0, subject%breaking)), source=0_i1)
    p = p_whole
    force = force_whole
    strained = whole
    options = options_of(subject%model)
    nan = ieee_value(1.0_wp, ieee_quiet_nan)
    select type (family => subject%family)
    type is (list_family_type)
      call list_dilatation(family, subject%model, options, &
        & subject%workspace%list, u, p_whole, whole, all_blocks)
      call list_force(family, subject%model, options, &
        & subject%workspace%list, u, p_whole, force_whole, whole)

      call find_turns(family, copies)
      call expect_true(error, family%n_early > 0 .and. family%n_early < size(family%turn), &
        & 'some clusters are early, some late')
      call allocate_bonds(family, bonds)
      do i = 1, size(family%turn)
        needs = .false.
        do k = lanes*(family%turn(i) - 1) + 1, lanes*family%turn(i)
          call family%bonds_of(k, bonds)
          needs = needs .or. copy(k) .or. any(copy(bonds%j(:bonds%n)))
        end do
        call expect_true(error, needs .eqv. i > family%n_early, 'late are those that need copies')
      end do

      known = u
      known(copies, :) = nan
      call list_dilatation(family, subject%model, options, &
        & subject%workspace%list, known, p, strained, early_blocks)
      known = u
      call list_dilatation(family, subject%model, options, &
        & subject%workspace%list, known, p, strained, late_blocks)
      call expect_close(error, p, p_whole, 0.0_wp, 'dilatation in two calls')
      p(copies) = nan
      call list_force(family, subject%model, options, &
        & subject%workspace%list, known, p, force, strained, early_blocks)
      p(copies) = p_whole(copies)
      call list_force(family, subject%model, options, &
        & subject%workspace%list, known, p, force, strained, late_blocks)
      call expect_close(error, force, force_whole, 0.0_wp, 'forces in two calls')
      call expect_true(error, all(strained == whole), 'marks in two calls')
      call expect_true(error, max_abs(force_whole) > 0.0_wp, 'there are forces')
    class default
      call expect_true(error, .false., 'a list')
    end select
  end subroutine compare_early

  !> Every term on, bits compared.
  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), force(:, :), first(:, :), p(:), p_first(:)
    integer, parameter :: threads(*) = [1, 2, 4]
    integer :: kind, number, dim, t, before

    before = omp_get_max_threads()
    do kind = 1, size(kinds)
      do number = 1, 6
        dim = (number + 1)/2
        subject = subject_type(kind=kinds(kind), dim=dim, surface=.true., two_materials=.true., &
          & projected=mod(number, 2) == 1, hole=.true., &
          & thermal=kinds(kind) /= 'mixed' .and. mod(number, 2) == 1)
        call build(subject)
        ! a mixed family has double loops for what has no others: 1D, and thermal strain
        select type (family => subject%family)
        type is (lattice_family_type)
          call expect_true(error, family%mixed .eqv. (kinds(kind) == 'mixed' .and. dim > 1), &
            & 'precision, '//name_of(subject, 0))
        end select
        if (allocated(u)) deallocate (u)
        allocate (u(subject%body%n_slots, dim))
        call shake(subject%body, some_gradient(0.05_wp), 0.05_wp*spacing, 51, u)
        do t = 1, size(threads)
          call omp_set_num_threads(threads(t))
          call fast_force(subject, u, force, p)
          if (t == 1) then
            first = force
            p_first = p
          end if
          ! differences of equal bits are exactly zero
          call expect_close(error, force, first, 0.0_wp, 'force, ' &
            & //name_of(subject, threads(t)))
          call expect_close(error, p, p_first, 0.0_wp, 'dilatation, ' &
            & //name_of(subject, threads(t)))
        end do
      end do
    end do
    call omp_set_num_threads(before)
  end subroutine test_threads

  !> With one key for all surroundings, or two, forces and dilatations have the bits that they have
  !> with keys of their own, and so have the surface factors, which are computed once for each kind
  !> of surroundings.
  subroutine test_collisions(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject, colliding
    real(wp), allocatable :: u(:, :), force(:, :), other(:, :), p(:), p_other(:)
    integer(i8), parameter :: bits(*) = [0_i8, 1_i8]
    integer :: kind, dim, i

    do kind = 1, size(kinds)
      ! keys are those of lattices; a composite has the same
      if (any(kinds(kind) == [character(9) :: 'list', 'tables', 'composite'])) cycle
      do dim = 1, 3
        subject = subject_type(kind=kinds(kind), dim=dim, surface=.true., two_materials=.true., &
          & hole=.true., crack=.true., dilatant=dim == 1)
        call build(subject)
        if (allocated(u)) deallocate (u)
        allocate (u(subject%body%n_slots, dim))
        call shake(subject%body, some_gradient(0.02_wp), 0.02_wp*spacing, 61, u)
        call fast_force(subject, u, force, p)
        do i = 1, size(bits)
          colliding = subject_type(kind=kinds(kind), dim=dim, surface=.true., &
            & two_materials=.true., hole=.true., crack=.true., dilatant=dim == 1, &
            & key_bits=bits(i))
          call build(colliding)
          call expect_true(error, tables_of(colliding) < tables_of(subject), 'no key collided, ' &
            & //name_of(subject, i))
          call expect_true(error, all(abs(colliding%model%S - subject%model%S) <= 0.0_wp), &
            & 'surface factors, '//name_of(subject, i))
          call fast_force(colliding, u, other, p_other)
          call expect_true(error, all(abs(other - force) <= 0.0_wp), 'force, ' &
            & //name_of(subject, i))
          call expect_true(error, all(abs(p_other - p) <= 0.0_wp), 'dilatation, ' &
            & //name_of(subject, i))
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_collisions

  !> Clusters of lists share tables where points lie alike, also where their bonds are cut. Forces
  !> are those of a list without shared tables, and those with one key for all clusters, or two.
  subroutine test_shared(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: points(3, 3) = reshape([400, 1, 1, 150, 20, 1, 90, 6, 6], [3, 3])
    integer(i8), parameter :: bits(*) = [not(0_i8), 0_i8, 1_i8]
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), force(:, :), other(:, :), p(:), p_other(:)
    integer(i8) :: weights, packs
    integer :: dim, variant, i, c

    do dim = 1, 3
      do variant = 1, 3
        call make(dim, variant, not(0_i8), huge(0), subject)
        if (allocated(u)) deallocate (u)
        allocate (u(subject%body%n_slots, dim))
        call shake(subject%body, some_gradient(0.004_wp), 0.004_wp*spacing, 71, u)
        call fast_force(subject, u, force, p)
        do i = 1, size(bits)
          call make(dim, variant, bits(i), 8, subject)
          call fast_force(subject, u, other, p_other)
          select type (family => subject%family)
          type is (list_family_type)
            associate (kept => subject%workspace%list)
              weights = size(kept%weight_S, 2, kind=i8)
              packs = size(family%bits, kind=i8)
              if (i == 1) call expect_true(error, 2*weights < packs, 'few weights are shared, ' &
                & //name_of(subject, 0))
              if (i == 1) call expect_true(error, count(kept%shape > 0_i8) &
                & > size(kept%shape)/2, 'few shapes are shared')
              ! bars have no crack
              if (i == 1 .and. dim > 1) call expect_true(error, any(kept%shape > 0_i8 .and. [(any( &
                & family%intact(family%start(c):family%start(c + 1) - 1) &
                & /= family%bits(family%start(c):family%start(c + 1) - 1)), &
                & c = 1, size(kept%shape))]), 'no cluster with a shape has broken bonds')
            end associate
          end select
          call expect_close(error, other, force, 1.0e-13_wp*max_abs(force), 'force, ' &
            & //name_of(subject, i))
          call expect_close(error, p_other, p, 1.0e-13_wp*max_abs(p), 'dilatation, ' &
            & //name_of(subject, i))
          if (allocated(error)) return
        end do
      end do
    end do

  contains

    subroutine make(dim, variant, key_bits, least_shared, subject)
      integer, intent(in) :: dim, variant, least_shared
      integer(i8), intent(in) :: key_bits
      type(subject_type), intent(out) :: subject

      subject = subject_type(kind='list', dim=dim, bond_based=variant == 3, &
        & projected=variant == 1, surface=.true., two_materials=variant == 2, hole=.true., &
        & crack=.true., key_bits=key_bits, least_shared=least_shared, points=points(:, dim))
      call build(subject)
    end subroutine make
  end subroutine test_shared

  !> Tables of weights that a lattice has.
  integer function tables_of(subject) result(tables)
    type(subject_type), intent(in) :: subject

    tables = 0
    if (allocated(subject%workspace%lattice%table)) tables = size(subject%workspace%lattice%table)
  end function tables_of

  !> Up to s_c, no bond that could break is served by the fast formulas: e is at most
  !> (1 + s_c)^2 - 1 in tension and 1 - (1 - s_c)^2 in compression. From some s_c on the formulas'
  !> own range is the limit, whatever s_c, and never less.
  subroutine test_critical(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: critical(*) = [1.0e-4_wp, 0.01_wp, 0.06_wp, 0.5_wp, 1.0_wp, 1.5_wp, &
      & 1.995_wp, 2.0_wp, 2.5_wp, 1.0e6_wp]
    integer, parameter :: ranges(*) = [narrow, wide, single]
    type(model_type) :: model
    integer :: i, r

    model%breaking = .true.
    do i = 1, size(critical)
      do r = 1, size(ranges)
        model%least_critical = critical(i)
        associate (limit => fast_limit(model, options_of(model), ranges(r)))
          call expect_true(error, limit >= 0.0_wp .and. limit <= fast_ranges(ranges(r)), &
            & 'limit of e at a critical stretch of '//text_of(critical(i)))
          if (critical(i) < 1.0_wp) call expect_true(error, limit <= 1 - (1 - critical(i))**2, &
            & 'bonds that could break, at '//text_of(critical(i)))
          ! single precision stays away from the limit by what it may miss
          if (critical(i) > 0.06_wp) call expect(error, limit, fast_ranges(ranges(r)), &
            & merge(1.0e-5_wp, 0.0_wp, ranges(r) == single), &
            & 'limit of e at a critical stretch of '//text_of(critical(i)))
        end associate
      end do
    end do
  end subroutine test_critical

end module test_force_contract
