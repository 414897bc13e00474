!> What every bond law of the table must do, on every family and in every dimension that it has:
!> keep momentum, turn with the body, be the gradient of its energy, hold a full family under a
!> uniform strain in equilibrium with the classical energy, give the same bits on any number of
!> threads, and keep its history where only `commit_laws` changes it.
module test_law_contract
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_kinds, only: wp, i1
  use pd_base_numbers, only: pi
  use pd_base_snapshot, only: snapshot_type
  use pd_force_forces, only: energy_pass, internal_force
  use pd_force_generic_points, only: commit_laws, keep_laws
  use pd_force_model, only: options_of
  use pd_law_laws, only: all_laws, law_table_type
  use bodies, only: expect, expect_true, rotation_matrix, shake
  use comparisons, only: expect_close, max_abs
  use force_subjects, only: build, some_gradient, spacing, subject_type
  use testdrive, only: error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_law_contract

  character(9), parameter :: kinds(*) = [character(9) :: 'lattice', 'list', 'composite']

contains

  subroutine collect_law_contract(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('net force and moment vanish', test_momentum), &
      & new_unittest('forces turn with the body', test_objective), &
      & new_unittest('the force is the gradient of the energy', test_gradient), &
      & new_unittest('a uniform strain is in equilibrium and has the classical energy', &
      & test_uniform), &
      & new_unittest('lattices and lists agree', test_families), &
      & new_unittest('the same bits on 1, 2 and 3 threads', test_threads), &
      & new_unittest('only a commit changes the history', test_history), &
      & new_unittest('the history is kept and put back', test_kept)]
  end subroutine collect_law_contract

  !> A body of law number `number` of the table; `there` is false where the law cannot be had in the
  !> dimension.
  subroutine make(number, kind, dim, subject, there, hole)
    integer, intent(in) :: number, dim
    character(*), intent(in) :: kind
    type(subject_type), intent(out) :: subject
    logical, intent(out) :: there
    logical, intent(in) :: hole
    type(law_table_type) :: table

    table = all_laws()
    subject%kind = kind
    subject%dim = dim
    subject%law = table%items(number)%law%name
    subject%influence = table%items(number)%law%influence
    subject%bond_based = table%items(number)%law%bond_based
    subject%projected = .false.
    subject%poissons_ratio = 0.3_wp
    subject%hole = hole
    subject%crack = hole
    subject%two_materials = hole
    if (.not. hole) then
      subject%surface = .true.
      if (dim == 2) subject%points = [21, 21, 1]
      if (dim == 3) subject%points = 19
      if (dim == 1) subject%points = [21, 1, 1]
    end if
    call build(subject)
    there = subject%model%laws(1)%law%refusal() == ''
  end subroutine make

  !> The number of laws, so that a test that looks at none fails.
  integer function number_of_laws()
    type(law_table_type) :: table
    table = all_laws()
    number_of_laws = size(table%items)
  end function number_of_laws

  !> Forces at displacements `u`.
  subroutine force_at(subject, u, force)
    type(subject_type), intent(inout) :: subject
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), allocatable, intent(out) :: force(:, :)
    real(wp), allocatable :: p(:)
    integer(i1), allocatable :: strained(:)

    allocate (force(size(u, 1), size(u, 2)), p(size(u, 1)), source=0.0_wp)
    allocate (strained(size(u, 1)), source=0_i1)
    call internal_force(subject%body, subject%family, subject%model, options_of(subject%model), &
      & subject%workspace, u, p, force, strained)
  end subroutine force_at

  !> Strain the body far, and let its law keep that.
  subroutine load(subject, strain, u)
    type(subject_type), intent(inout) :: subject
    real(wp), intent(in) :: strain
    real(wp), allocatable, intent(out) :: u(:, :)
    real(wp), allocatable :: damage(:)
    real(wp) :: dissipated, plastic

    allocate (u(subject%body%n_slots, subject%dim), damage(subject%body%n_slots), source=0.0_wp)
    call shake(subject%body, some_gradient(strain), 0.3_wp*strain*spacing, 31, u)
    if (subject%model%generic) call commit_laws(subject%body, subject%family, subject%model, &
      & subject%workspace%generic, u, damage, dissipated, plastic)
  end subroutine load

  !> sum V f = 0, sum y x V f = 0, with a history, a hole, a crack and two materials: some hundred
  !> roundings of the sum of all |V f|.
  subroutine test_momentum(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), force(:, :)
    real(wp) :: net(3), moment(3), y(3), f(3), applied
    integer :: n, kind, dim, k
    logical :: there

    do n = 1, number_of_laws()
      do kind = 1, size(kinds)
        do dim = 1, 3
          call make(n, kinds(kind), dim, subject, there, hole=.true.)
          if (.not. there) cycle
          call load(subject, 3.0e-3_wp, u)
          u = 1.2_wp*u
          call force_at(subject, u, force)
          net = 0.0_wp
          moment = 0.0_wp
          applied = 0.0_wp
          do k = 1, subject%body%n_slots
            y = 0.0_wp
            f = 0.0_wp
            y(:dim) = subject%body%x(k, :) + u(k, :)
            f(:dim) = force(k, :)*subject%body%volume(k)
            net = net + f
            moment = moment + [y(2)*f(3) - y(3)*f(2), y(3)*f(1) - y(1)*f(3), &
              & y(1)*f(2) - y(2)*f(1)]
            applied = applied + sum(abs(f))
          end do
          call expect_true(error, applied > 0.0_wp, 'no force: '//trim(subject%law))
          call expect_close(error, net, 0.0_wp, 1.0e-13_wp*applied, 'net force, '//subject%law)
          call expect_close(error, moment, 0.0_wp, 1.0e-13_wp*applied*20*spacing, &
            & 'net moment, '//subject%law)
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_momentum

  !> A body that is turned by 77 degrees after it was strained has the turned forces. Stretches lose
  !> what forming eta loses, some eps of a strain of 3e-3: 1e-11 of the largest force.
  subroutine test_objective(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), turned(:, :), force(:, :), force_of_turned(:, :)
    real(wp) :: R(3, 3), axis(3)
    integer :: n, kind, dim, k
    logical :: there

    do n = 1, number_of_laws()
      do kind = 1, size(kinds)
        do dim = 2, 3
          call make(n, kinds(kind), dim, subject, there, hole=.true.)
          if (.not. there) cycle
          call load(subject, 3.0e-3_wp, u)
          axis = [0.0_wp, 0.0_wp, 1.0_wp]
          if (dim == 3) axis = [2.0_wp, -3.0_wp, 6.0_wp]/7.0_wp
          R = rotation_matrix(axis, 77*pi/180)
          u = 1.2_wp*u
          call force_at(subject, u, force)
          turned = u
          do k = 1, subject%body%n_slots
            if (subject%body%point(k) == 0) cycle
            turned(k, :) = matmul(R(:dim, :dim), subject%body%x(k, :) + u(k, :)) &
              & - subject%body%x(k, :)
          end do
          call force_at(subject, turned, force_of_turned)
          force = matmul(force, transpose(R(:dim, :dim)))
          call expect_close(error, force_of_turned, force, 1.0e-11_wp*max_abs(force), &
            & 'forces of a turned body, '//subject%law)
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_objective

  !> -dE/du = V f about a state from which the body is unloaded a little, where the history stands
  !> still. Central differences of 1e-6 spacings have errors of 1e-12 (h^2, relative) and of
  !> eps E/(h F), 1e-7 of the largest force.
  subroutine test_gradient(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), force(:, :)
    integer, parameter :: chosen(3) = [2, 7, 11]
    real(wp) :: h, slope, largest
    integer :: n, dim, i, c, k
    logical :: there

    h = 1.0e-6_wp*spacing
    do n = 1, number_of_laws()
      do dim = 1, 3
        call make(n, 'lattice', dim, subject, there, hole=.true.)
        if (.not. there) cycle
        call load(subject, 3.0e-3_wp, u)
        u = 0.98_wp*u
        call force_at(subject, u, force)
        largest = max_abs(force)*maxval(subject%body%volume)
        do i = 1, size(chosen)
          k = subject%body%slot(chosen(i))
          do c = 1, dim
            u(k, c) = u(k, c) + h
            slope = total_energy(subject, u)
            u(k, c) = u(k, c) - 2*h
            slope = (slope - total_energy(subject, u))/(2*h)
            u(k, c) = u(k, c) + h
            call expect(error, -slope, force(k, c)*subject%body%volume(k), 1.0e-7_wp*largest, &
              & 'gradient, '//trim(subject%law))
            if (allocated(error)) return
          end do
        end do
      end do
    end do
  end subroutine test_gradient

  real(wp) function total_energy(subject, u) result(energy)
    type(subject_type), intent(inout) :: subject
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), allocatable :: density(:)

    allocate (density(size(u, 1)))
    call energy_pass(subject%family, subject%model, subject%workspace, u, density)
    energy = sum(density*subject%body%volume)
  end function total_energy

  !> A small uniform strain, below any yield: the point in the middle, whose family and those of its
  !> members are full and have equal surface factors, has no force (1e-10 of the force of one
  !> surface), and the energy of classical elasticity. Surface factors, or m of lps, make it exact
  !> for a uniaxial strain; in other strains shear is off by the 10 % of a lattice at 3.015 spacings
  !> in space (doc/theory.md, 13), and less in the plane.
  subroutine test_uniform(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), force(:, :), density(:)
    real(wp) :: strain(3), mu, kappa, trace, shear, classical, away
    integer :: n, dim, k, c, middle
    logical :: there

    strain = [1.0e-5_wp, -0.4e-5_wp, 0.7e-5_wp]
    do n = 1, number_of_laws()
      do dim = 1, 3
        call make(n, 'lattice', dim, subject, there, hole=.false.)
        if (.not. there) cycle
        allocate (u(subject%body%n_slots, dim), source=0.0_wp)
        middle = 0
        away = huge(away)
        do k = 1, subject%body%n_slots
          if (subject%body%point(k) == 0) cycle
          u(k, :) = strain(:dim)*subject%body%x(k, :)
          associate (x => subject%body%x(k, :), half => [(maxval(subject%body%x(:, c))/2, &
            & c=1, dim)])
            if (norm2(x - half) < away) then
              away = norm2(x - half)
              middle = k
            end if
          end associate
        end do
        call force_at(subject, u, force)
        allocate (density(subject%body%n_slots))
        call energy_pass(subject%family, subject%model, subject%workspace, u, density)
        associate (m => subject%model%materials(1))
          mu = m%shear_modulus
          kappa = m%bulk_modulus
          trace = sum(strain(:dim))
          select case (dim)
          case (1); classical = m%youngs_modulus/2*strain(1)**2
          case default
            shear = sum((strain(:dim) - trace/dim)**2)
            classical = kappa/2*trace**2 + mu*shear
          end select
        end associate
        call expect(error, density(middle), classical, 0.1_wp*classical, &
          & 'energy of a full family, '//trim(subject%law))
        call expect_close(error, force(middle, :), 0.0_wp, 1.0e-10_wp*max_abs(force), &
          & 'force within, '//subject%law)
        if (allocated(error)) return
        deallocate (u, density)
      end do
    end do
  end subroutine test_uniform

  !> Forces of both families, point by point, with a history: 1e-12 of the largest.
  subroutine test_families(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: lattice, list
    real(wp), allocatable :: u(:, :), force(:, :), other(:, :)
    integer :: n, dim
    logical :: there

    do n = 1, number_of_laws()
      do dim = 1, 3
        call make(n, 'lattice', dim, lattice, there, hole=.true.)
        if (.not. there) cycle
        call make(n, 'list', dim, list, there, hole=.true.)
        call load(lattice, 3.0e-3_wp, u)
        u = 0.9_wp*u
        call force_at(lattice, u, force)
        call load(list, 3.0e-3_wp, u)
        u = 0.9_wp*u
        call force_at(list, u, other)
        call expect_close(error, other(list%body%slot, :), force(lattice%body%slot, :), &
          & 1.0e-12_wp*max_abs(force), 'list and lattice, '//lattice%law)
        if (allocated(error)) return
      end do
    end do
  end subroutine test_families

  !> Forces after two commits.
  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), first(:, :), force(:, :)
    integer :: n, dim, t, before
    logical :: there

    before = omp_get_max_threads()
    do n = 1, number_of_laws()
      do dim = 1, 3
        do t = 1, 3
          call omp_set_num_threads(t)
          call make(n, 'lattice', dim, subject, there, hole=.true.)
          if (.not. there) exit
          call load(subject, 3.0e-3_wp, u)
          call load(subject, -2.0e-3_wp, u)
          call force_at(subject, u, force)
          if (t == 1) first = force
          call expect_close(error, force, first, 0.0_wp, 'threads, '//subject%law)
        end do
      end do
    end do
    call omp_set_num_threads(before)
  end subroutine test_threads

  !> Forces and energies at other displacements in between change nothing.
  subroutine test_history(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), first(:, :), force(:, :), far(:, :), history(:, :)
    real(wp) :: energy
    integer :: n, dim
    logical :: there

    do n = 1, number_of_laws()
      do dim = 1, 3
        call make(n, 'lattice', dim, subject, there, hole=.true.)
        if (.not. there .or. .not. subject%model%generic) cycle
        call load(subject, 2.0e-3_wp, u)
        call force_at(subject, u, first)
        history = subject%workspace%generic%history
        far = 2*u
        call force_at(subject, far, force)
        energy = total_energy(subject, far)
        call expect_true(error, energy > 0.0_wp, 'energy, '//trim(subject%law))
        call expect_close(error, subject%workspace%generic%history, history, 0.0_wp, 'history, ' &
          & //subject%law)
        call force_at(subject, u, force)
        call expect_close(error, force, first, 0.0_wp, 'forces, '//subject%law)
        if (allocated(error)) return
      end do
    end do
  end subroutine test_history

  !> Through an archive and back.
  subroutine test_kept(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    type(snapshot_type) :: snapshot
    real(wp), allocatable :: u(:, :), history(:, :), of_point(:, :)
    integer :: n, kept
    logical :: there

    kept = 0
    do n = 1, number_of_laws()
      call make(n, 'lattice', 3, subject, there, hole=.true.)
      if (.not. there .or. .not. subject%model%generic) cycle
      call load(subject, 3.0e-3_wp, u)
      history = subject%workspace%generic%history
      of_point = subject%workspace%generic%of_point
      call snapshot%rewind(reading=.false.)
      call keep_laws(snapshot, subject%family, subject%workspace%generic)
      call load(subject, -5.0e-3_wp, u)
      if (size(history) > 0) kept = kept + 1
      call snapshot%rewind(reading=.true.)
      call keep_laws(snapshot, subject%family, subject%workspace%generic)
      call expect_close(error, subject%workspace%generic%history, history, 0.0_wp, 'bonds, ' &
        & //subject%law)
      call expect_close(error, subject%workspace%generic%of_point, of_point, 0.0_wp, 'points, ' &
        & //subject%law)
      if (allocated(error)) return
    end do
    call expect_true(error, kept > 0, 'no law with a history')
  end subroutine test_kept

end module test_law_contract
