!> Ranks that divide the points among them, in one process: each is a thread with a body of its own
!> (the points that it owns and copies of those within the horizon), and what ranks say to each
!> other goes through memory that they share. Their runs, by the same integrators and solvers, have
!> the bits of the run in one piece.
!>
!> Forces at a point must be added in an order that does not depend on which other points a rank
!> has: lattices that sum a point's own bonds do that, in 1D and, with mixed precision, in 2D
!> (doc/architecture.md, Ranks).
module test_ranks
  use omp_lib, only: omp_get_num_threads, omp_get_thread_num
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_error, only: fault_type => error_type
  use pd_base_order, only: ascending_order, block_points, number_points, order_type, ranks_type
  use pd_base_reduce, only: add_point, first_largest, first_where, inner, largest_over, &
    & least_over, new_running, noise, noise_after, running_type, sum_listed, sum_over, &
    & total_of_running
  use pd_body_body, only: allocate_points, body_type, gather, keep_points, own_points
  use pd_family_cracks, only: cut_bonds
  use pd_family_lattice, only: lattice_family_type, new_lattice_family
  use pd_force_breaking, only: damage_of
  use pd_force_model, only: new_model
  use pd_force_weights, only: build_weights
  use pd_motion_conditions, only: motion_type
  use pd_motion_loads, only: add_loads_to, load_of, load_type, number_of_loads
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_static_relaxation, only: relaxation_type, run_relaxation
  use pd_motion_system, only: start_system, system_type
  use pd_set_up_prepare, only: set_up_type
  use pd_scene_content_types, only: crack_group, scene_type
  use bodies, only: box_scene, diary_type, expect, expect_true, ready
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, unittest_type, test_failed
  implicit none (type, external)
  private
  public :: collect_ranks

  real(wp), parameter :: spacing = 1.0e-2_wp

  type :: values_type
    real(wp), allocatable :: values(:)
    real(wp), allocatable :: field(:, :)
  end type values_type

  !> What all ranks see.
  type :: hub_type
    type(values_type), allocatable :: of_rank(:)
  end type hub_type

  type, extends(ranks_type) :: fake_type
    integer :: rank = 0
    type(hub_type), pointer :: hub => null()
    integer, allocatable :: slot(:)     !! of the halo's points here
    integer, allocatable :: owner(:)    !! which rank owns each
    integer, allocatable :: there(:)    !! its slot there
  contains
    procedure :: add_all
    procedure :: take_largest
    procedure :: share
  end type fake_type

  !> A rank's part of a system, and the numbers of its points.
  type :: part_type
    type(system_type) :: system
    integer(i4), allocatable :: global(:)
    type(relaxation_type) :: relaxation
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
  end type part_type

contains

  subroutine collect_ranks(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('sums of any arrangement of the slots', test_arrangements), &
      & new_unittest('sums of any split of the points', test_splits), &
      & new_unittest('random numbers begin anywhere', test_noise), &
      & new_unittest('places in ascending order', test_order), &
      & new_unittest('an explicit run', test_explicit), &
      & new_unittest('a growing crack', test_crack), &
      & new_unittest('dynamic relaxation', test_relaxation), &
      & new_unittest('dynamic relaxation of a bar', test_bar), &
      & new_unittest('conjugate gradients', test_gradients)]
  end subroutine collect_ranks

  ! ---------------------------------------------------------------- what ranks say to each other

  subroutine add_all(self, values)
    class(fake_type), intent(inout) :: self
    real(wp), intent(inout) :: values(:)
    integer :: r

    self%hub%of_rank(self%rank)%values = values
    !$omp barrier
    values = 0.0_wp
    do r = 1, size(self%hub%of_rank)
      values = values + self%hub%of_rank(r)%values
    end do
    !$omp barrier
  end subroutine add_all

  subroutine take_largest(self, values)
    class(fake_type), intent(inout) :: self
    real(wp), intent(inout) :: values(:)
    integer :: r

    self%hub%of_rank(self%rank)%values = values
    !$omp barrier
    do r = 1, size(self%hub%of_rank)
      values = max(values, self%hub%of_rank(r)%values)
    end do
    !$omp barrier
  end subroutine take_largest

  subroutine share(self, values)
    class(fake_type), intent(inout) :: self
    real(wp), intent(inout) :: values(:, :)
    integer :: i

    self%hub%of_rank(self%rank)%field = values
    !$omp barrier
    do i = 1, size(self%slot)
      values(self%slot(i), :) = self%hub%of_rank(self%owner(i))%field(self%there(i), :)
    end do
    !$omp barrier
  end subroutine share

  !> Where the ranks begin, as blocks.
  pure function cuts_of(last) result(cut)
    integer, intent(in) :: last(:)   !! points of the ranks
    integer(i8) :: cut(size(last) - 1)
    cut = last(:size(last) - 1)/block_points + 1_i8
  end function cuts_of

  ! ---------------------------------------------------------------- sums

  !> Values of 150,000 points, more than two groups, in slots in the order of the points, in rows
  !> with room between them, and in slots at random; a plain sum in higher precision is the judge.
  subroutine test_arrangements(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 150000
    integer, parameter :: long = selected_real_kind(30)
    type(order_type) :: order
    type(running_type) :: running
    real(wp), allocatable :: a(:), b(:), in_slots(:, :)
    integer(i4), allocatable :: slot(:), other(:), some(:)
    logical :: listed(n)
    real(wp) :: total, product, first_total, first_product, totals(6)
    real(long) :: exact
    integer :: i, way, state, room

    allocate (a(n), b(n), slot(n))
    state = 4
    do i = 1, n
      a(i) = 1 + noise(state)*10.0_wp**(8*noise(state))
      b(i) = noise(state)
    end do
    exact = 0.0_long
    do i = 1, n
      exact = exact + real(a(i), long)*real(b(i), long)
    end do
    do way = 1, 3
      select case (way)
      case (1)
        slot = [(int(i, i4), i=1, n)]
      case (2)  ! rows of 37 with gaps of 11
        do i = 1, n
          slot(i) = int(5 + i + 11*(i/37), i4)
        end do
      case default
        other = [(int(1.0e9_wp*noise(state), i4), i=1, n)]
        slot = int(ascending_order(other), i4)
      end select
      room = maxval(slot) + 9
      if (allocated(in_slots)) deallocate (in_slots)
      allocate (in_slots(room, 2), source=1.0e30_wp)
      in_slots(slot, 1) = a
      in_slots(slot, 2) = b
      order = order_type()
      call number_points(slot, order)
      total = sum_over(order, in_slots(:, 1))
      product = inner(order, in_slots(:, 1), in_slots(:, 2))
      if (way == 1) then
        first_total = total
        first_product = product
      end if
      call expect(error, total, first_total, 0.0_wp, 'the sum')
      call expect(error, product, first_product, 0.0_wp, 'the inner product')
      call new_running(order, running)
      do i = 1, n
        call add_point(order, int(i, i4), [a(i)], running)
      end do
      totals = total_of_running(order, running)
      call expect(error, totals(1), first_total, 0.0_wp, 'the sum of points one by one')
      call expect(error, sum_listed(order, [(int(i, i4), i=1, n)], a), first_total, 0.0_wp, &
        & 'the sum of listed points')
      ! some blocks have no point of the list
      listed = .false.
      do i = 3, n, 3
        listed(i) = mod(i/2000, 2) == 1
      end do
      some = pack([(int(i, i4), i=1, n)], listed)
      call new_running(order, running)
      do i = 1, size(some)
        call add_point(order, some(i), a(some(i):some(i)), running)
      end do
      totals = total_of_running(order, running)
      call expect(error, sum_listed(order, some, a(some)), totals(1), 0.0_wp, &
        & 'the sum of some points')
      call expect(error, largest_over(order, in_slots(:, 1)), maxval(a), 0.0_wp, 'the largest')
      call expect(error, least_over(order, in_slots(:, 1)), minval(a), 0.0_wp, 'the least')
      call expect_true(error, first_largest(order, in_slots(:, 2)) == maxloc(b, dim=1), &
        & 'the place of the largest')
      call expect_true(error, first_where(order, in_slots(:, 2) > 0.999_wp .and. &
        & in_slots(:, 2) < 1.0_wp) == findloc(b > 0.999_wp, .true., dim=1), 'the first place')
      if (allocated(error)) return
    end do
    ! eight lanes of 32 terms, then trees: a few dozen roundings at most
    call expect(error, first_product, real(exact, wp), &
      & 50*epsilon(1.0_wp)*sum(abs(a*b)), 'the inner product in higher precision')
  end subroutine test_arrangements

  !> Sums over points that two and five ranks share, wherever they are cut.
  subroutine test_splits(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 150000
    real(wp), allocatable :: a(:)
    integer(i4), allocatable :: slot(:)
    type(order_type) :: whole
    real(wp) :: expected
    integer :: i, state

    allocate (a(n))
    state = 77
    do i = 1, n
      a(i) = 1 + noise(state)*10.0_wp**(8*noise(state))
    end do
    slot = [(int(i, i4), i=1, n)]
    call number_points(slot, whole)
    expected = sum_over(whole, a)
    call try([75000, n])
    call try([65536, n])           ! where a group ends
    call try([256, n])
    call try([1, n])
    call try([n - 1, n])
    call try([1000, 1001, 1100, 65700, n])   ! three begin in one block
    call try([0, 70000, 70000, 131072, n])   ! two that own nothing

  contains

    subroutine try(last)
      integer, intent(in) :: last(:)
      type(hub_type), target :: hub
      type(fake_type), target :: ranks(size(last))
      real(wp) :: total(size(last)), one_by_one(size(last)), totals(6)
      real(wp), allocatable :: mine(:)
      type(order_type) :: order
      type(running_type) :: running
      logical :: enough
      integer :: r, first, p

      if (allocated(error)) return
      allocate (hub%of_rank(size(last)))
      enough = .false.
      total = 0.0_wp
      one_by_one = 0.0_wp
      !$omp parallel num_threads(size(last)) default(none) &
      !$omp shared(last, hub, ranks, total, one_by_one, a, slot, enough) &
      !$omp private(r, p, first, order, mine, running, totals)
      if (omp_get_num_threads() == size(last)) then
        r = omp_get_thread_num() + 1
        if (r == 1) enough = .true.
        ranks(r)%rank = r
        ranks(r)%hub => hub
        first = 1
        if (r > 1) first = last(r - 1) + 1
        mine = a(first:last(r))
        order = order_type()
        order%cut = cuts_of(last)
        order%ranks => ranks(r)
        call number_points(slot(:size(mine)), order, 1, size(mine), first - 1_i8, int(n, i8))
        total(r) = sum_over(order, mine)
        call new_running(order, running)
        do p = 1, size(mine)
          call add_point(order, int(p, i4), [mine(p)], running)
        end do
        totals = total_of_running(order, running)
        one_by_one(r) = totals(1)
      end if
      !$omp end parallel
      if (.not. enough) return   ! a machine that has no threads to give
      do r = 1, size(last)
        call expect(error, total(r), expected, 0.0_wp, 'the sum of a split')
        call expect(error, one_by_one(r), expected, 0.0_wp, 'a split, point by point')
      end do
    end subroutine try
  end subroutine test_splits

  subroutine test_noise(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: state, i
    real(wp) :: next

    state = 20250829
    do i = 1, 1000
      call expect_true(error, noise_after(20250829, i - 1_i8) == state, 'the state after numbers')
      next = noise(state)
      call expect_true(error, abs(next) < 1.0_wp, 'a number out of range')
    end do
  end subroutine test_noise

  subroutine test_order(error)
    type(error_type), allocatable, intent(out) :: error
    integer(i4) :: values(300)
    integer :: i, state, n
    integer, allocatable :: order(:)

    state = 11
    do n = 0, 300, 23
      values = [(int(20*noise(state), i4), i=1, 300)]
      order = ascending_order(values(:n))
      call expect_true(error, size(order) == n, 'how many')
      do i = 2, n
        call expect_true(error, values(order(i)) > values(order(i - 1)) .or. &
          & (values(order(i)) == values(order(i - 1)) .and. order(i) > order(i - 1)), 'the order')
      end do
    end do
  end subroutine test_order

  ! ---------------------------------------------------------------- runs

  !> A plate of 36 x 40 points, or of fewer rows, state-based, its layers pulled apart, a force on
  !> part of it.
  subroutine plate(scene, rows)
    type(scene_type), intent(out) :: scene
    integer, intent(in), optional :: rows
    integer :: number

    number = 40
    if (present(rows)) number = rows
    call box_scene([36, number], spacing, 0.2_wp, scene)
    scene%header%precision = 'mixed'
    scene%materials(1)%model = 'state_based'
    deallocate (scene%boundaries, scene%loads)
    allocate (scene%boundaries(2), scene%loads(1))
    scene%boundaries(1)%name = 'bottom'
    scene%boundaries(1)%side = 'y_min'
    scene%boundaries(2)%name = 'top'
    scene%boundaries(2)%side = 'y_max'
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%pressure = -1.0e5_wp
  end subroutine plate

  !> Between the rows of the plate, and in a block of the sums: what is strained beyond the fast
  !> formulas is decided for all slots of a block of the loops, which a rank must have.
  subroutine test_explicit(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call plate(scene)
    scene%boundaries(1)%velocity(2) = -1.0_wp
    scene%boundaries(2)%velocity(2) = 2.0_wp
    scene%time%steps = 60
    call compare(scene, [36*17], 'velocity_verlet', error)
    call compare(scene, [36*5, 36*21, 36*40 + 36], 'forward_backward', error)
    scene%time%integrator = 'adams_bashforth'
    call compare(scene, [36*20], 'adams_bashforth', error)
  end subroutine test_explicit

  !> The crack runs along the cut.
  subroutine test_crack(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call plate(scene)
    deallocate (scene%loads, scene%cracks)
    allocate (scene%loads(0), scene%cracks(1))
    scene%cracks(1)%from(:2) = [0.12_wp, 0.2_wp]
    scene%cracks(1)%to(:2) = [0.24_wp, 0.2_wp]
    scene%materials(1)%critical_stretch = 5.0e-3_wp
    scene%boundaries(1)%velocity(2) = -30.0_wp
    scene%boundaries(2)%velocity(2) = 30.0_wp
    scene%time%steps = 120
    call compare(scene, [36*20], 'velocity_verlet', error, breaks=.true.)
    scene%time%breaking = 'after_forces'
    call compare(scene, [36*20, 36*22], 'velocity_verlet', error, breaks=.true.)
  end subroutine test_crack

  !> Pieces are found on each rank by itself, so that the points of a rank must hang together: a
  !> layer at the lower edge would be far from the rank that owns it. With 1000 points and more one
  !> process would have a coarse part in its preconditioner, which ranks do not have.
  subroutine pulled_plate(scene)
    type(scene_type), intent(out) :: scene

    call plate(scene, rows=24)
    scene%boundaries = scene%boundaries(2:)
    scene%boundaries(1)%displacement(:2) = [0.0_wp, 1.0e-6_wp]
    scene%loads(1)%side = 'y_min'
    scene%time%method = 'relaxation'
    scene%relaxation%load_steps = 2
  end subroutine pulled_plate

  subroutine test_relaxation(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call pulled_plate(scene)
    scene%relaxation%solver = 'dynamic_relaxation'
    call compare(scene, [36*12], 'relaxation', error)
  end subroutine test_relaxation

  subroutine test_gradients(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call pulled_plate(scene)
    call compare(scene, [36*12], 'relaxation', error)
  end subroutine test_gradients

  !> In 1D a rank may end anywhere.
  subroutine test_bar(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call box_scene([600], spacing, 0.3_wp, scene)
    deallocate (scene%boundaries, scene%loads)
    allocate (scene%boundaries(1), scene%loads(1))
    scene%boundaries(1)%side = 'x_max'
    scene%boundaries(1)%displacement(1) = 0.0_wp
    scene%loads(1)%side = 'x_min'
    scene%loads(1)%pressure = -1.0e5_wp
    scene%time%method = 'relaxation'
    scene%relaxation%solver = 'dynamic_relaxation'
    scene%relaxation%tolerance = 1.0e-5_wp
    call compare(scene, [271, 409], 'relaxation', error)
  end subroutine test_bar

  !> Run a scene in one piece, and by ranks of which all but the last end at `last`.
  subroutine compare(scene, last, method, error, breaks)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: last(:)
    character(*), intent(in) :: method
    type(error_type), allocatable, intent(inout) :: error
    logical, intent(in), optional :: breaks
    type(set_up_type) :: set_up
    type(part_type), target :: parts(size(last) + 1)
    type(fake_type), target :: ranks(size(last) + 1)
    type(hub_type), target :: hub
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    logical :: enough
    integer :: n, r

    if (allocated(error)) return
    call ready(scene, set_up, error)
    if (allocated(error)) return
    n = size(parts)
    allocate (hub%of_rank(n))
    associate (whole => set_up%system)
      do r = 1, n
        call take_part(set_up, scene%cracks, [last, whole%body%n_points], r, parts(r), error)
        if (allocated(error)) return
        ranks(r)%rank = r
        ranks(r)%hub => hub
        parts(r)%diary%every = 7
      end do
      do r = 1, n
        call find_halo(parts, r, ranks(r))
        parts(r)%system%body%order%ranks => ranks(r)
      end do
      enough = .false.
      !$omp parallel num_threads(n) default(none) shared(n, parts, enough, method, set_up) &
      !$omp private(r)
      if (omp_get_num_threads() == n) then
        r = omp_get_thread_num() + 1
        if (r == 1) enough = .true.
        call run(parts(r)%system, parts(r)%relaxation, method, set_up%plan%step, &
          & set_up%plan%steps, parts(r)%diary, parts(r)%fault)
      end if
      !$omp end parallel
      if (.not. enough) return   ! a machine that has no threads to give
      diary%every = 7
      call run(whole, set_up%plan%relaxation, method, set_up%plan%step, set_up%plan%steps, &
        & diary, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      if (allocated(error)) return
      call expect_true(error, whole%external_work > 0.0_wp .and. diary%n > 1, 'nothing happened')
      if (present(breaks)) call expect_true(error, whole%broken > 20_i8, 'the crack stands')
      do r = 1, n
        if (allocated(parts(r)%fault)) then
          call test_failed(error, parts(r)%fault%message)
          return
        end if
        call same_fields(whole, parts(r), error)
        call expect_true(error, parts(r)%system%broken == whole%broken, 'broken bonds')
        call expect(error, parts(r)%system%dissipated, whole%dissipated, 0.0_wp, 'dissipated')
        call expect(error, parts(r)%system%external_work, whole%external_work, 0.0_wp, 'work')
        call expect_true(error, parts(r)%diary%n == diary%n, 'rows')
        if (allocated(error)) return
        call expect_close(error, parts(r)%diary%kinetic, diary%kinetic, 0.0_wp, &
          & 'kinetic energy')
        call expect_close(error, parts(r)%diary%strain, diary%strain, 0.0_wp, 'strain energy')
      end do
    end associate
  end subroutine compare

  subroutine run(system, relaxation, method, step, steps, diary, fault)
    type(system_type), intent(inout) :: system
    type(relaxation_type), intent(in) :: relaxation
    character(*), intent(in) :: method
    real(wp), intent(in) :: step
    integer, intent(in) :: steps
    type(diary_type), intent(inout) :: diary
    type(fault_type), allocatable, intent(out) :: fault

    if (method == 'relaxation') then
      call run_relaxation(system, relaxation, diary, fault)
    else
      call run_explicit(system, method, step, steps, diary, fault)
    end if
  end subroutine run

  !> All that a rank's points have, bit by bit.
  subroutine same_fields(whole, part, error)
    type(system_type), intent(in) :: whole
    type(part_type), intent(in) :: part
    type(error_type), allocatable, intent(inout) :: error
    real(wp), allocatable :: of_points(:, :), of_part(:, :)
    integer :: first, last, f

    first = part%global(part%system%body%first_owned)
    last = part%global(part%system%body%last_owned)
    allocate (of_points(whole%body%n_points, whole%body%dim))
    allocate (of_part(last - first + 1, whole%body%dim))
    do f = 1, 4
      of_points = 0.0_wp
      of_part = 0.0_wp
      select case (f)
      case (1)
        call gather(whole%body, whole%state%u, of_points)
        call gather(part%system%body, part%system%state%u, of_part)
      case (2)
        call gather(whole%body, whole%state%v, of_points)
        call gather(part%system%body, part%system%state%v, of_part)
      case (3)
        call gather(whole%body, whole%state%force, of_points)
        call gather(part%system%body, part%system%state%force, of_part)
      case default
        if (size(whole%state%damage) == 0) cycle
        call gather(whole%body, whole%state%damage, of_points(:, 1))
        call gather(part%system%body, part%system%state%damage, of_part(:, 1))
      end select
      call expect_true(error, max_abs(of_points) > 0.0_wp .or. f == 2, 'an empty field')
      call expect(error, max_abs(of_part - of_points(first:last, :)), 0.0_wp, 0.0_wp, &
        & 'a field of a rank')
    end do
  end subroutine same_fields

  !> The part of a system that rank `r` has: the points after those of the ranks before up to
  !> `last(r)`, and a halo. It is built as a scene's is, from these points alone.
  subroutine take_part(set_up, cracks, last, r, part, error)
    type(set_up_type), intent(in), target :: set_up
    type(crack_group), intent(in) :: cracks(:)
    integer, intent(in) :: last(:), r
    type(part_type), intent(out) :: part
    type(error_type), allocatable, intent(inout) :: error
    type(lattice_family_type), allocatable :: family
    type(fault_type), allocatable :: fault
    type(load_type), allocatable :: loads(:)
    type(body_type) :: body
    real(wp), allocatable :: mass(:, :)
    integer(i8) :: cut
    integer :: first, c, m
    logical, allocatable :: keep(:)

    first = 1
    if (r > 1) first = last(r - 1) + 1
    associate (whole => set_up%system, system => part%system)
      call in_order(whole%body, body)
      call near(body%x, first, last(r), whole%family%rule%delta + spacing, keep)
      part%global = pack([(int(c, i4), c=1, body%n_points)], keep)
      call keep_points(body, keep)
      system%body = body
      call own_points(system%body, findloc(part%global, int(first, i4), dim=1), &
        & findloc(part%global, int(last(r), i4), dim=1), &
        & first - findloc(part%global, int(first, i4), dim=1, kind=i8), &
        & int(whole%body%n_points, i8))
      system%body%order%cut = cuts_of(last)
      allocate (family)
      select type (of_whole => whole%family)
      type is (lattice_family_type)
        call new_lattice_family(system%body, of_whole%rule, allocated(of_whole%broken), &
          & of_whole%mixed, family, fault)
      class default
        call test_failed(error, 'the body has no lattice family')
      end select
      if (allocated(fault)) call test_failed(error, fault%message)
      if (allocated(error)) return
      call move_alloc(family, system%family)
      call new_model(system%body, whole%model%materials, whole%model%projected, &
        & spread(.false., 1, system%body%n_slots), spread(0.0_wp, 1, system%body%n_slots), &
        & system%model)
      select type (of_part => system%family)
      type is (lattice_family_type)
        call build_weights(of_part, system%model, system%workspace%lattice)
      class default
        call test_failed(error, 'the part has no lattice family')
      end select
      if (size(cracks) > 0) then
        call cut_bonds(cracks, system%body, system%family, cut)
        allocate (system%state%damage(system%body%n_slots), source=0.0_wp)
        call damage_of(system%body, system%family, system%state%damage)
      end if
      allocate (system%state%u(system%body%n_slots, system%body%dim), source=0.0_wp)
      allocate (system%state%v, source=system%state%u)
      allocate (system%motions(size(whole%motions)), loads(number_of_loads(whole%terms)))
      do m = 1, size(whole%motions)
        call take_motion(whole%motions(m), system%motions(m))
      end do
      do m = 1, size(loads)
        call take_load(load_of(whole%terms, m), loads(m))
      end do
      call add_loads_to(system%terms, loads)
      system%break_late = whole%break_late
      call start_system(system)
      if (.not. allocated(set_up%plan%relaxation%mass)) return
      part%relaxation = set_up%plan%relaxation
      allocate (mass(whole%body%n_points, whole%body%dim))
      call gather(whole%body, set_up%plan%relaxation%mass, mass)
      deallocate (part%relaxation%mass)
      allocate (part%relaxation%mass, source=0.0_wp*system%state%u)
      part%relaxation%mass(system%body%slot, :) = mass(part%global, :)
    end associate

  contains

    !> The slot of a slot's point here, or 0.
    integer function here(slot)
      integer(i4), intent(in) :: slot
      here = findloc(part%global, set_up%system%body%point(slot), dim=1)
      if (here > 0) here = part%system%body%slot(here)
    end function here

    subroutine take_motion(of_whole, motion)
      type(motion_type), intent(in) :: of_whole
      type(motion_type), intent(out) :: motion
      integer :: i

      motion%name = of_whole%name
      motion%kind = of_whole%kind
      motion%amplitude = of_whole%amplitude
      motion%curve = of_whole%curve
      allocate (motion%slots(0))
      do i = 1, size(of_whole%slots)
        if (here(of_whole%slots(i)) > 0) motion%slots = [motion%slots, &
          & int(here(of_whole%slots(i)), i4)]
      end do
    end subroutine take_motion

    subroutine take_load(of_whole, load)
      type(load_type), intent(in) :: of_whole
      type(load_type), intent(out) :: load
      integer, allocatable :: rows(:)
      integer :: i

      load%curve = of_whole%curve
      allocate (load%slots(0), rows(0))
      do i = 1, size(of_whole%slots)
        if (here(of_whole%slots(i)) == 0) cycle
        load%slots = [load%slots, int(here(of_whole%slots(i)), i4)]
        rows = [rows, i]
      end do
      load%density = of_whole%density(rows, :)
    end subroutine take_load
  end subroutine take_part

  !> A body's points in their order.
  subroutine in_order(body, copy)
    type(body_type), intent(in) :: body
    type(body_type), intent(out) :: copy
    integer(i4), allocatable :: number(:)

    call allocate_points(copy, body%dim, body%n_points)
    allocate (number(body%n_points))
    call gather(body, body%x, copy%x)
    call gather(body, body%volume, copy%volume)
    call gather(body, body%spacing, copy%spacing)
    call gather(body, body%body, number)
    copy%body = int(number, kind(copy%body))
    call gather(body, body%material, number)
    copy%material = int(number, kind(copy%material))
    call gather(body, body%layer, number)
    copy%layer = int(number, kind(copy%layer))
    call gather(body, body%grid, number)
    copy%grid = int(number, kind(copy%grid))
    copy%grids = body%grids
  end subroutine in_order

  !> The points from `first` to `last` and those within a distance of one of them.
  subroutine near(x, first, last, distance, keep)
    real(wp), intent(in) :: x(:, :)
    integer, intent(in) :: first, last
    real(wp), intent(in) :: distance
    logical, allocatable, intent(out) :: keep(:)
    integer :: i, j

    allocate (keep(size(x, 1)), source=.false.)
    keep(first:last) = .true.
    do i = 1, size(x, 1)
      do j = first, last
        if (keep(i)) exit
        keep(i) = sum((x(i, :) - x(j, :))**2) <= distance**2
      end do
    end do
  end subroutine near

  !> Who owns the points that rank `r` has copies of, and where they are there.
  subroutine find_halo(parts, r, ranks)
    type(part_type), intent(in) :: parts(:)
    integer, intent(in) :: r
    type(fake_type), intent(inout) :: ranks
    integer :: i, s, p

    allocate (ranks%slot(0), ranks%owner(0), ranks%there(0))
    do i = 1, size(parts(r)%global)
      if (i >= parts(r)%system%body%first_owned .and. i <= parts(r)%system%body%last_owned) cycle
      do s = 1, size(parts)
        p = findloc(parts(s)%global, parts(r)%global(i), dim=1)
        if (p < parts(s)%system%body%first_owned .or. p > parts(s)%system%body%last_owned) cycle
        ranks%slot = [ranks%slot, int(parts(r)%system%body%slot(i))]
        ranks%owner = [ranks%owner, s]
        ranks%there = [ranks%there, int(parts(s)%system%body%slot(p))]
      end do
    end do
  end subroutine find_halo

end module test_ranks
