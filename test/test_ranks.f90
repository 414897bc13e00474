!> Ranks that divide the points among them, in one process: each is a thread with a body of its own
!> (the points that it owns and copies of those within the horizon), and what ranks say to each
!> other goes through memory that they share. Their runs, by the same integrators and solvers, have
!> the bits of the run in one piece.
module test_ranks
  use omp_lib, only: omp_get_num_threads, omp_get_thread_num
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_error, only: fault_type => error_type
  use pd_base_order, only: ascending_order, exchange, number_points, order_type, ranks_type
  use pd_base_reduce, only: add_point, bring_noise, first_largest, first_where, inner, &
    & largest_over, least_over, new_running, noise, noise_after, running_type, sum_listed, &
    & sum_over, sum_parts, total_of_running
  use pd_body_body, only: allocate_points, body_type, gather
  use pd_body_division, only: divide_space, division_type, take_part, work_of_points
  use pd_family_cracks, only: cut_bonds
  use pd_family_lattice, only: lattice_family_type, new_lattice_family
  use pd_force_breaking, only: damage_of
  use pd_force_contact, only: contact_type, new_contact
  use pd_force_dashpots, only: dashpots_type, new_dashpots
  use pd_force_springs, only: new_springs, springs_type
  use pd_force_term, only: force_term_type, term_view_type
  use pd_force_model, only: new_model
  use pd_force_weights, only: build_weights
  use pd_motion_conditions, only: motion_type
  use pd_motion_loads, only: add_loads_to, load_of, load_type, number_of_loads
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_static_relaxation, only: relaxation_type, run_relaxation
  use pd_motion_system, only: start_system, system_type, view_of
  use pd_output_deal, only: deal_type
  use pd_set_up_prepare, only: set_up_type
  use pd_set_up_ranks, only: find_lowest, reproducible_layer, work_of_body
  use pd_scene_content_types, only: crack_group, scene_type
  use bodies, only: box_scene, diary_type, expect, expect_true, ready
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, unittest_type, test_failed
  implicit none (type, external)
  private
  public :: collect_ranks, fake_type, hub_type

  real(wp), parameter :: spacing = 1.0e-2_wp

  type :: values_type
    real(wp), allocatable :: values(:)
    real(wp), allocatable :: field(:, :)
    real(wp), allocatable :: side_field(:, :)
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
    logical :: on_the_way(2) = .false.
  contains
    procedure :: add_all
    procedure :: take_largest
    procedure :: start_sharing
    procedure :: finish_sharing
    procedure :: collect
    procedure :: deal
    procedure :: number_before
  end type fake_type

  !> A rank's part of a system, and the numbers of its points.
  type :: part_type
    type(system_type) :: system
    integer, allocatable :: owner(:)      !! rank that owns each copy, from 1
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
      & new_unittest('rows of results', test_rows), &
      & new_unittest('random numbers begin anywhere', test_noise), &
      & new_unittest('places in ascending order', test_order), &
      & new_unittest('an explicit run', test_explicit), &
      & new_unittest('an explicit run in space', test_block), &
      & new_unittest('a growing crack', test_crack), &
      & new_unittest('springs and dashpots', test_terms), &
      & new_unittest('contact of two halves', test_halves), &
      & new_unittest('long: dynamic relaxation', test_relaxation), &
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

  subroutine start_sharing(self, values, which)
    class(fake_type), intent(inout) :: self
    real(wp), intent(in), contiguous :: values(:, :)
    integer, intent(in) :: which

    if (self%on_the_way(which)) error stop 'messages that nobody waits for'
    self%on_the_way(which) = .true.
    if (which == exchange) then
      self%hub%of_rank(self%rank)%field = values
    else
      self%hub%of_rank(self%rank)%side_field = values
    end if
  end subroutine start_sharing

  !> Copies are taken now, and not before, so that what has used them by mistake differs.
  subroutine finish_sharing(self, values, which)
    class(fake_type), intent(inout) :: self
    real(wp), intent(inout), contiguous :: values(:, :)
    integer, intent(in) :: which
    integer :: i

    if (.not. self%on_the_way(which)) error stop 'messages that nobody has sent'
    self%on_the_way(which) = .false.
    !$omp barrier
    do i = 1, size(self%slot)
      associate (there => self%hub%of_rank(self%owner(i)))
        if (which == exchange) then
          values(self%slot(i), :) = there%field(self%there(i), :)
        else
          values(self%slot(i), :) = there%side_field(self%there(i), :)
        end if
      end associate
    end do
    !$omp barrier
  end subroutine finish_sharing

  subroutine collect(self, values, all_values)
    class(fake_type), intent(inout) :: self
    real(wp), intent(in) :: values(:)
    real(wp), allocatable, intent(out) :: all_values(:)
    integer :: r

    self%hub%of_rank(self%rank)%values = values
    !$omp barrier
    allocate (all_values(0))
    if (self%rank == 1) then
      do r = 1, size(self%hub%of_rank)
        all_values = [all_values, self%hub%of_rank(r)%values]
      end do
    end if
    !$omp barrier
  end subroutine collect

  subroutine deal(self, values, given, got, taken)
    class(fake_type), intent(inout) :: self
    real(wp), intent(in) :: values(:)
    integer, intent(in) :: given(:)
    real(wp), allocatable, intent(out) :: got(:)
    integer, intent(in), optional :: taken(:)
    integer :: r, at

    self%hub%of_rank(self%rank)%values = values
    self%hub%of_rank(self%rank)%field = reshape(real(given, wp), [size(given), 1])
    !$omp barrier
    allocate (got(0))
    do r = 1, size(self%hub%of_rank)
      associate (all_given => nint(self%hub%of_rank(r)%field(:, 1)))
        at = sum(all_given(:self%rank - 1))
        got = [got, self%hub%of_rank(r)%values(at + 1:at + all_given(self%rank))]
        if (present(taken)) then
          if (taken(r) /= all_given(self%rank)) error stop 'other numbers than a rank expects'
        end if
      end associate
    end do
    !$omp barrier
  end subroutine deal

  integer(i8) function number_before(self, number) result(before)
    class(fake_type), intent(inout) :: self
    integer(i8), intent(in) :: number
    integer :: r

    self%hub%of_rank(self%rank)%values = [real(number, wp)]
    !$omp barrier
    before = 0_i8
    if (self%rank > 1) before = sum([(nint(self%hub%of_rank(r)%values(1), i8), &
      & r=1, self%rank - 1)])
    !$omp barrier
  end function number_before

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
      call new_running(running)
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
      call new_running(running)
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
    ! each term is cut off below 2^-60 of the largest one; the rest is one rounding, or three
    call expect(error, first_product, real(exact, wp), 2.0_wp**(-60)*n*max_abs(a*b) &
      & + 3*epsilon(1.0_wp)*abs(first_product), &
      & 'the inner product in higher precision')
  end subroutine test_arrangements

  !> Sums over points that some ranks share in any way.
  subroutine test_splits(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 150000
    real(wp), allocatable :: a(:)
    type(order_type) :: whole
    real(wp) :: expected
    integer :: i, state, owner(n)

    allocate (a(n))
    state = 77
    do i = 1, n
      a(i) = 1 + noise(state)*10.0_wp**(8*noise(state))
    end do
    call number_points([(int(i, i4), i=1, n)], whole)
    expected = sum_over(whole, a)
    owner = merge(1, 2, [(i, i=1, n)] <= n/2)
    call try(2)
    owner = merge(1, 2, [(i, i=1, n)] == 77)
    call try(2)
    owner = merge(1, 3, [(mod(i, 2), i=1, n)] == 0)   ! the second owns nothing
    call try(3)
    do i = 1, n
      owner(i) = min(5, 1 + int(2.5_wp*(1 + noise(state))))
    end do
    call try(5)
    ! terms of either sign, whose sum is small
    do i = 1, n
      a(i) = noise(state)
    end do
    do i = 1, 40
      a(1) = noise(state)
      expected = sum_over(whole, a)
      call try(5)
    end do
    ! terms of any size: what is below the last digit of the sum must not matter where it is
    do i = 1, n
      a(i) = noise(state)*10.0_wp**(40*noise(state))
    end do
    expected = sum_over(whole, a)
    call try(5)
    a = a*1.0e245_wp
    expected = sum_over(whole, a)
    call try(5)
    a = a*1.0e-300_wp*1.0e-200_wp
    expected = sum_over(whole, a)
    call try(5)

  contains

    subroutine try(ranks)
      integer, intent(in) :: ranks
      type(hub_type), target :: hub
      type(fake_type), target :: fake(ranks)
      integer, parameter :: parts = 4  ! thirds of the points and one point alone
      real(wp) :: total(ranks), one_by_one(ranks), listed(ranks), totals(6)
      real(wp) :: in_parts(2, parts, ranks), of_parts(2, parts)
      real(wp), allocatable :: mine(:)
      integer(i4), allocatable :: by_part(:)
      integer(i4) :: start(parts + 1)
      integer(i8) :: all_points(parts)
      integer(i8), allocatable :: number(:)
      integer(i4), allocatable :: slot(:)
      integer :: states(ranks)
      logical :: same(ranks)
      type(order_type) :: order
      type(running_type) :: running
      logical :: enough
      integer, allocatable :: part(:)
      integer(i4), allocatable :: points(:)
      integer :: r, p

      if (allocated(error)) return
      allocate (part(n), points(n))
      do p = 1, n
        part(p) = 1 + mod(p, 3)
        points(p) = int(p, i4)
      end do
      part(17) = parts
      do p = 1, parts
        all_points(p) = count(part == p)
        by_part = pack(points, part == p)
        mine = a(by_part)
        of_parts(:, p) = [sum_listed(whole, by_part, mine), sum_listed(whole, by_part, -2*mine)]
      end do
      allocate (hub%of_rank(ranks))
      enough = .false.
      total = 0.0_wp
      in_parts = 0.0_wp
      one_by_one = 0.0_wp
      same = .true.
      !$omp parallel num_threads(ranks) default(none) &
      !$omp shared(ranks, owner, hub, fake, total, one_by_one, listed, a, enough, states, same) &
      !$omp shared(part, all_points, in_parts) &
      !$omp private(r, p, order, mine, number, slot, running, totals, by_part, start)
      if (omp_get_num_threads() == ranks) then
        r = omp_get_thread_num() + 1
        if (r == 1) enough = .true.
        fake(r)%rank = r
        fake(r)%hub => hub
        number = pack([(int(p, i8), p=1, n)], owner == r)
        mine = a(number)
        slot = [(int(p, i4), p=1, size(mine))]
        order = order_type()
        order%ranks => fake(r)
        call number_points(slot, order, number, int(n, i8))
        total(r) = sum_over(order, mine)
        call new_running(running)
        do p = size(mine), 1, -1
          call add_point(order, int(p, i4), [mine(p)], running)
        end do
        totals = total_of_running(order, running)
        one_by_one(r) = totals(1)
        listed(r) = sum_listed(order, slot, mine)
        start = 1_i4
        by_part = [integer(i4) ::]
        do p = 1, parts
          by_part = [by_part, pack(slot, part(number) == p)]
          start(p + 1) = size(by_part, kind=i4) + 1_i4
        end do
        call sum_parts(order, start, all_points, by_part, &
          & reshape([mine(by_part), -2*mine(by_part)], [2, size(by_part)], order=[2, 1]), &
          & in_parts(:, :, r))
        do p = 1, size(mine)
          call bring_noise(order, p, 4711, 3, states(r))
          if (states(r) /= noise_after(4711, 3*(number(p) - 1))) same(r) = .false.
          states(r) = noise_after(states(r), 3_i8)
        end do
      end if
      !$omp end parallel
      if (.not. enough) return   ! a machine that has no threads to give
      do r = 1, ranks
        call expect(error, total(r), expected, 0.0_wp, 'the sum of a split')
        call expect(error, one_by_one(r), expected, 0.0_wp, 'a split, point by point')
        call expect(error, listed(r), expected, 0.0_wp, 'a split, by a list')
        call expect_close(error, in_parts(:, :, r), of_parts, 0.0_wp, 'a split, in parts')
        call expect_true(error, same(r), 'random numbers of a split')
      end do
    end subroutine try
  end subroutine test_splits

  !> Points that ranks own in any way become rows in point order, equally many on each rank, and the
  !> first rank gets them in turns, never many more than its own.
  subroutine test_rows(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: i, state

    call try(7, 2, [(mod(i, 2) + 1, i=1, 7)])
    call try(3, 3, [3, 1, 2])
    call try(1000, 3, [(merge(3, merge(1, 2, mod(i, 5) < 2), i < 17), i=1, 1000)])
    state = 5
    call try(300000, 4, [(min(4, 1 + int(2*(1 + noise(state)))), i=1, 300000)])
    call try(300000, 2, [(merge(2, 1, i <= 200000), i=1, 300000)])

  contains

    subroutine try(n, ranks, owner)
      integer, intent(in) :: n, ranks, owner(n)
      type(hub_type), target :: hub
      type(fake_type), target :: fake(ranks)
      type(body_type) :: body
      type(deal_type) :: deal
      integer :: counts(ranks), befores(ranks), turns(ranks), most(ranks)
      real(wp) :: all_rows(n), in_turns(n)
      real(wp), allocatable :: own(:), rows(:), taken(:, :)
      integer(i8) :: first
      integer :: r, p, turn
      logical :: enough

      if (allocated(error)) return
      allocate (hub%of_rank(ranks))
      enough = .false.
      all_rows = -1.0_wp
      in_turns = -1.0_wp
      !$omp parallel num_threads(ranks) default(none) &
      !$omp shared(n, ranks, owner, hub, fake, enough, counts, befores, turns, most, all_rows) &
      !$omp shared(in_turns) private(r, p, turn, body, deal, own, rows, taken, first)
      if (omp_get_num_threads() == ranks) then
        r = omp_get_thread_num() + 1
        if (r == 1) enough = .true.
        fake(r)%rank = r
        fake(r)%hub => hub
        body%number = pack([(int(p, i8), p=1, n)], owner == r)
        body%order%ranks => fake(r)
        call number_points([(int(p, i4), p=1, size(body%number))], body%order, body%number, &
          & int(n, i8))
        own = 1.0_wp/body%number
        call deal%begin(body)
        call deal%values_of_rows(body, own, rows)
        counts(r) = size(rows)
        befores(r) = int(deal%rows%before)
        all_rows(befores(r) + 1:befores(r) + counts(r)) = rows
        turns(r) = deal%rows%turns()
        most(r) = 0
        do turn = 1, turns(r)
          call deal%rows%take_turn(turn, reshape(rows, [size(rows), 1]), first, taken)
          most(r) = max(most(r), size(taken))
          if (r == 1) in_turns(first + 1:first + size(taken)) = taken(:, 1)
        end do
      end if
      !$omp end parallel
      if (.not. enough) return   ! a machine that has no threads to give
      call expect_true(error, maxval(counts) - minval(counts) <= 1, 'rows of the ranks')
      call expect_true(error, all(befores == [(sum(counts(:r - 1)), r=1, ranks)]), &
        & 'where the rows of a rank begin')
      call expect_true(error, all(abs(all_rows - [(1.0_wp/r, r=1, n)]) <= 0.0_wp), &
        & 'the rows of the ranks')
      call expect_true(error, all(abs(in_turns - [(1.0_wp/r, r=1, n)]) <= 0.0_wp), &
        & 'the rows that the first rank gets')
      call expect_true(error, all(turns == turns(1)) .and. all(most(2:) == 0), &
        & 'only the first rank gets rows')
      call expect_true(error, most(1) <= max(65536, counts(1) + 1), 'rows of a turn')
    end subroutine try
  end subroutine test_rows

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

  !> In both precisions.
  subroutine test_explicit(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call plate(scene)
    scene%boundaries(1)%velocity(2) = -1.0_wp
    scene%boundaries(2)%velocity(2) = 2.0_wp
    scene%time%steps = 60
    call compare(scene, 2, 'velocity_verlet', error, overlaps=.true.)
    scene%header%precision = 'double'
    call compare(scene, 2, 'forward_backward', error, overlaps=.true.)
    call compare(scene, 4, 'forward_backward', error)
    scene%time%integrator = 'adams_bashforth'
    call compare(scene, 3, 'adams_bashforth', error)
  end subroutine test_explicit

  !> A block in space that ranks cut along all axes, both models.
  subroutine test_block(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call box_scene([20, 12, 14], spacing, 0.25_wp, scene)
    deallocate (scene%boundaries)
    allocate (scene%boundaries(1))
    scene%boundaries(1)%side = 'z_max'
    scene%boundaries(1)%velocity = [0.5_wp, 0.0_wp, 2.0_wp]
    scene%time%steps = 20
    call compare(scene, 5, 'velocity_verlet', error)
    scene%materials(1)%model = 'bond_based'
    call compare(scene, 3, 'velocity_verlet', error)
  end subroutine test_block

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
    call compare(scene, 2, 'velocity_verlet', error, breaks=.true.)
    scene%time%breaking = 'after_forces'
    call compare(scene, 3, 'velocity_verlet', error, breaks=.true.)
  end subroutine test_crack

  !> A side on springs, and one that takes in waves; then springs in static equilibrium.
  subroutine test_terms(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call plate(scene)
    scene%header%precision = 'double'
    scene%boundaries(1)%name = ''
    scene%boundaries(1)%absorbing = .true.
    scene%boundaries(2)%velocity(2) = 2.0_wp
    scene%loads(1)%stiffness(:2) = [4.0e8_wp, 1.0e8_wp]
    scene%time%steps = 60
    call compare(scene, 3, 'forward_backward', error, dissipates=.true.)
    call pulled_plate(scene)
    scene%loads(1)%stiffness(:2) = [4.0e8_wp, 1.0e8_wp]
    call compare(scene, 2, 'relaxation', error)
  end subroutine test_terms

  !> Halves that a crack parts are pressed together and slide. Ranks are cut along the crack and
  !> across it, so that points of other ranks meet, with and without copies; then bonds break.
  subroutine test_halves(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call plate(scene)
    deallocate (scene%loads, scene%cracks, scene%contacts)
    allocate (scene%loads(0), scene%cracks(1), scene%contacts(1))
    scene%cracks(1)%from(:2) = [-0.1_wp, 0.2_wp]
    scene%cracks(1)%to(:2) = [1.0_wp, 0.2_wp]
    scene%contacts(1)%between = [character(len(scene%contacts(1)%between)) ::]
    scene%contacts(1)%within = 'box'
    scene%contacts(1)%friction = 0.4_wp
    scene%boundaries(1)%velocity(:2) = [20.0_wp, 30.0_wp]
    scene%boundaries(2)%velocity(:2) = [-20.0_wp, -30.0_wp]
    scene%time%steps = 120
    call compare(scene, 2, 'velocity_verlet', error, dissipates=.true.)
    call compare(scene, 3, 'runge_kutta', error, dissipates=.true.)
    scene%materials(1)%critical_stretch = 2.0e-3_wp
    scene%contacts(1)%damping = 0.2_wp
    call compare(scene, 4, 'velocity_verlet', error, breaks=.true., dissipates=.true.)
  end subroutine test_halves

  !> With 1000 points and more one process that may differ from ranks would have a coarse part in
  !> its preconditioner, which they do not have.
  subroutine pulled_plate(scene)
    type(scene_type), intent(out) :: scene

    call plate(scene)
    scene%boundaries(1)%displacement(:2) = 0.0_wp
    scene%boundaries(2)%displacement(:2) = [0.0_wp, 1.0e-6_wp]
    scene%time%method = 'relaxation'
    scene%relaxation%load_steps = 2
  end subroutine pulled_plate

  subroutine test_relaxation(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call pulled_plate(scene)
    scene%relaxation%solver = 'dynamic_relaxation'
    call compare(scene, 2, 'relaxation', error)
  end subroutine test_relaxation

  subroutine test_gradients(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call pulled_plate(scene)
    call compare(scene, 2, 'relaxation', error)
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
    call compare(scene, 3, 'relaxation', error)
  end subroutine test_bar

  !> Run a scene on one rank, and on some.
  subroutine compare(scene, ranks, method, error, breaks, overlaps, dissipates)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: ranks
    character(*), intent(in) :: method
    type(error_type), allocatable, intent(inout) :: error
    logical, intent(in), optional :: breaks    !! bonds must break
    logical, intent(in), optional :: overlaps  !! blocks must be computed while copies arrive
    logical, intent(in), optional :: dissipates  !! energy must be lost
    type(set_up_type) :: set_up
    type(part_type) :: one
    type(part_type), target :: parts(ranks)
    type(fake_type), target :: fake(ranks)
    type(hub_type), target :: hub
    type(work_of_points) :: work
    type(division_type) :: division
    type(body_type) :: body
    type(term_view_type) :: view
    logical :: enough
    integer :: r, blocks

    if (allocated(error)) return
    call ready(scene, set_up, error)
    if (allocated(error)) return
    allocate (hub%of_rank(ranks))
    call in_order(set_up%system%body, body)
    call find_lowest(body)
    body%order%reproducible = .true.
    blocks = reproducible_layer(scene%header%precision == 'mixed')
    call work_of_body(body, blocks, work)
    call divide_space(work, 1, division)
    call make_part(set_up, scene%cracks, body, division, 1, one, error)
    if (allocated(error)) return
    call work_of_body(body, blocks, work)
    call divide_space(work, ranks, division)
    call expect_true(error, minval(division%work) > 0.0_wp, 'a rank without points')
    do r = 1, ranks
      call make_part(set_up, scene%cracks, body, division, r, parts(r), error)
      if (allocated(error)) return
      fake(r)%rank = r
      fake(r)%hub => hub
      parts(r)%diary%every = 7
    end do
    do r = 1, ranks
      call find_halo(parts, r, fake(r))
      parts(r)%system%body%order%ranks => fake(r)
    end do
    enough = .false.
    !$omp parallel num_threads(ranks) default(none) shared(ranks, parts, enough, method, set_up) &
    !$omp private(r, view)
    if (omp_get_num_threads() == ranks) then
      r = omp_get_thread_num() + 1
      if (r == 1) enough = .true.
      ! terms begin anew where ranks can speak
      call view_of(parts(r)%system, 0.0_wp, view)
      call parts(r)%system%terms%begin(view)
      call run(parts(r)%system, parts(r)%relaxation, method, set_up%plan%step, &
        & set_up%plan%steps, parts(r)%diary, parts(r)%fault)
    end if
    !$omp end parallel
    if (.not. enough) return   ! a machine that has no threads to give
    one%diary%every = 7
    call run(one%system, one%relaxation, method, set_up%plan%step, set_up%plan%steps, &
      & one%diary, one%fault)
    if (allocated(one%fault)) call test_failed(error, one%fault%message)
    if (allocated(error)) return
    call expect_true(error, one%system%external_work > 0.0_wp .and. one%diary%n > 1, &
      & 'nothing happened')
    if (present(dissipates)) call expect_true(error, one%system%dissipated > 0.0_wp, &
      & 'nothing is dissipated')
    if (present(breaks)) call expect_true(error, one%system%broken > 20_i8, 'the crack stands')
    do r = 1, ranks
      if (present(overlaps)) call expect_overlap(parts(r)%system, error)
      if (allocated(parts(r)%fault)) then
        call test_failed(error, parts(r)%fault%message)
        return
      end if
      call same_fields(one%system, parts(r)%system, error)
      associate (here => parts(r)%system)
        call expect_true(error, here%broken == one%system%broken, 'broken bonds')
        call expect(error, here%dissipated, one%system%dissipated, 0.0_wp, 'dissipated')
        call expect(error, here%external_work, one%system%external_work, 0.0_wp, 'work')
      end associate
      call expect_true(error, parts(r)%diary%n == one%diary%n, 'rows')
      if (allocated(error)) return
      call expect_close(error, parts(r)%diary%kinetic, one%diary%kinetic, 0.0_wp, &
        & 'kinetic energy')
      call expect_close(error, parts(r)%diary%strain, one%diary%strain, 0.0_wp, 'strain energy')
    end do
  end subroutine compare

  !> Some blocks need no copies, and others do.
  subroutine expect_overlap(system, error)
    type(system_type), intent(in) :: system
    type(error_type), allocatable, intent(inout) :: error

    select type (family => system%family)
    type is (lattice_family_type)
      associate (colour => family%slabs%colour)
        call expect_true(error, colour(1) < colour(3) .and. colour(3) < colour(5), 'no overlap')
      end associate
    class default
      call test_failed(error, 'the part has no lattice family')
    end select
  end subroutine expect_overlap

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
    type(system_type), intent(in) :: whole, part
    type(error_type), allocatable, intent(inout) :: error
    real(wp), allocatable :: of_points(:, :), of_part(:, :)
    integer :: f

    allocate (of_points(whole%body%n_points, whole%body%dim))
    allocate (of_part(part%body%order%n_owned, whole%body%dim))
    do f = 1, 4
      of_points = 0.0_wp
      of_part = 0.0_wp
      select case (f)
      case (1)
        call gather(whole%body, whole%state%u, of_points)
        call gather(part%body, part%state%u, of_part)
      case (2)
        call gather(whole%body, whole%state%v, of_points)
        call gather(part%body, part%state%v, of_part)
      case (3)
        call gather(whole%body, whole%state%force, of_points)
        call gather(part%body, part%state%force, of_part)
      case default
        if (size(whole%state%damage) == 0) cycle
        call gather(whole%body, whole%state%damage, of_points(:, 1))
        call gather(part%body, part%state%damage, of_part(:, 1))
      end select
      call expect_true(error, max_abs(of_points) > 0.0_wp .or. f == 2, 'an empty field')
      call expect(error, max_abs(of_part - of_points(part%body%order%number, :)), 0.0_wp, 0.0_wp, &
        & 'a field of a rank')
    end do
  end subroutine same_fields

  !> What rank `r`, from 1, has of a system. It is built as a scene's is, from its points alone.
  subroutine make_part(set_up, cracks, whole_body, division, r, part, error)
    type(set_up_type), intent(in), target :: set_up
    type(crack_group), intent(in) :: cracks(:)
    type(body_type), intent(in) :: whole_body   !! in point order
    type(division_type), intent(in) :: division
    integer, intent(in) :: r
    type(part_type), intent(out) :: part
    type(error_type), allocatable, intent(inout) :: error
    type(lattice_family_type), allocatable :: family
    type(fault_type), allocatable :: fault
    type(load_type), allocatable :: loads(:)
    real(wp), allocatable :: mass(:, :)
    integer(i4), allocatable :: here(:)    ! slot here of each point of all, or 0
    integer(i8) :: cut
    integer :: i, m

    associate (whole => set_up%system, system => part%system)
      system%body = whole_body
      call take_part(division, r - 1, whole%family%rule%delta + spacing, system%body, part%owner)
      part%owner = part%owner + 1
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
      allocate (here(whole%body%n_points), source=0_i4)
      here(system%body%number) = system%body%slot
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
      do m = whole%terms%bonds + size(loads) + 1, whole%terms%number()
        call take_term(whole%terms%items(m)%term)
      end do
      system%break_late = whole%break_late
      call start_system(system)
      if (.not. allocated(set_up%plan%relaxation%mass)) return
      part%relaxation = set_up%plan%relaxation
      allocate (mass(whole%body%n_points, whole%body%dim))
      call gather(whole%body, set_up%plan%relaxation%mass, mass)
      deallocate (part%relaxation%mass)
      allocate (part%relaxation%mass, source=0.0_wp*system%state%u)
      do i = 1, system%body%n_points
        part%relaxation%mass(system%body%slot(i), :) = mass(system%body%number(i), :)
      end do
    end associate

  contains

    subroutine take_motion(of_whole, motion)
      type(motion_type), intent(in) :: of_whole
      type(motion_type), intent(out) :: motion
      integer(i4), allocatable :: slots(:)

      motion%name = of_whole%name
      motion%kind = of_whole%kind
      motion%amplitude = of_whole%amplitude
      motion%curve = of_whole%curve
      slots = here(set_up%system%body%point(of_whole%slots))
      motion%slots = pack(slots, slots > 0)
    end subroutine take_motion

    subroutine take_term(of_whole)
      class(force_term_type), intent(in) :: of_whole
      type(contact_type) :: contact
      integer(i4), allocatable :: slots(:)
      integer :: k

      select type (of_whole)
      type is (springs_type)
        slots = here(set_up%system%body%point(of_whole%slots))
        call part%system%terms%add(new_springs(pack(slots, slots > 0), &
          & of_whole%stiffness(:set_up%system%body%dim)))
      type is (dashpots_type)
        slots = here(set_up%system%body%point(of_whole%slots))
        call part%system%terms%add(new_dashpots(pack(slots, slots > 0), &
          & of_whole%damping(pack([(k, k=1, size(slots))], slots > 0), :)))
      type is (contact_type)
        call new_contact(part%system%body, of_whole%law%delta, of_whole%law%ratio, &
          & of_whole%law%rule, of_whole%part, contact)
        contact%conservative = of_whole%conservative
        contact%follows = of_whole%follows
        call part%system%terms%add(contact)
      class default
        call test_failed(error, 'a term that parts cannot have')
      end select
    end subroutine take_term

    subroutine take_load(of_whole, load)
      type(load_type), intent(in) :: of_whole
      type(load_type), intent(out) :: load
      integer(i4), allocatable :: slots(:)
      integer :: k

      load%curve = of_whole%curve
      slots = here(set_up%system%body%point(of_whole%slots))
      load%density = of_whole%density(pack([(k, k=1, size(slots))], slots > 0), :)
      load%slots = pack(slots, slots > 0)
    end subroutine take_load
  end subroutine make_part

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

  !> Where the points are that rank `r` has copies of.
  subroutine find_halo(parts, r, fake)
    type(part_type), intent(in) :: parts(:)
    integer, intent(in) :: r
    type(fake_type), intent(inout) :: fake
    integer :: i

    associate (body => parts(r)%system%body)
      fake%owner = parts(r)%owner
      fake%slot = int(body%slot(body%order%n_owned + 1:))
      allocate (fake%there(size(fake%slot)))
      do i = 1, size(fake%slot)
        associate (other => parts(fake%owner(i))%system%body)
          fake%there(i) = other%slot(findloc(other%order%number, &
            & body%number(body%order%n_owned + i), dim=1))
        end associate
      end do
    end associate
  end subroutine find_halo

end module test_ranks
