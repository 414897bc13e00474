!> Global sums, extremes, first places and random starts over the points of a body.
!>
!> Terms are added over fixed blocks of point numbers, whatever slots the points have: within a
!> block of 256 points in eight lanes, point by point, then the lanes; the sums of 256 blocks that
!> follow each other the same way (a group); then group by group. So a sum has the same bits for
!> any arrangement of the slots, any number of threads and any split of the points among ranks.
!>
!> What ranks exchange (`pd_base_order`) is one `add_all` or `take_largest` for a sum or an extreme:
!> every number that is added has one rank that knows it, and is 0 in all others, so that these sums
!> are exact in any order.
module pd_base_reduce
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_lanes, only: lanes
  use pd_base_order, only: block_of, block_points, order_type, owns, place_of, slots_of_block, &
    & take_block
  implicit none (type, external)
  private
  public :: sums_type, running_type
  public :: new_sums, add_block, total_of, new_running, add_point, total_of_running
  public :: inner, sum_over, sum_listed, largest_over, least_over, first_where, first_largest
  public :: largest_of_ranks, sum_of_ranks, count_of_ranks, noise, noise_after

  integer, parameter :: most_running = 6    !! sums that one `running_type` forms
  integer, parameter :: worth_blocks = 4096 !! points of a list that is summed in blocks

  !> Some sums at once, block by block; blocks may be added by different threads.
  type :: sums_type
    private
    integer :: number = 0                          !! of sums
    real(wp), allocatable :: block(:, :)           !! (number, blocks)
    real(wp), allocatable :: cut(:, :, :)          !! terms of cut blocks (points, number, cuts)
  end type sums_type

  !> Some sums at once of a few points, which are added in ascending order.
  type :: running_type
    private
    integer(i8) :: block = 0_i8                          !! of the last point, 0: none yet
    integer(i8) :: group = 0_i8
    real(wp) :: point_lane(lanes, most_running) = 0.0_wp
    real(wp) :: block_lane(lanes, most_running) = 0.0_wp
    real(wp) :: total(most_running) = 0.0_wp
    type(sums_type), allocatable :: of_ranks             !! where there are more than one
  end type running_type

  !> Sum of a b over all points, of all components.
  interface inner
    module procedure :: inner_scalars, inner_vectors, inner_weighted
  end interface inner

  !> The largest value at a point.
  interface largest_over
    module procedure :: largest_scalar, largest_size
  end interface largest_over

contains

  ! ---------------------------------------------------------------- sums in blocks

  ! The parentheses below fix the order of sums, which the compiler may change without.

  !> The sum of a block's terms.
  pure real(wp) function sum_of_block(terms) result(total)
    real(wp), intent(in) :: terms(block_points)
    real(wp) :: lane(lanes)
    integer :: i, l

    lane = 0.0_wp
    do i = 0, block_points - lanes, lanes
      do l = 1, lanes
        lane(l) = (lane(l) + terms(i + l))
      end do
    end do
    total = sum_of_lanes(lane)
  end function sum_of_block

  pure real(wp) function sum_of_lanes(lane) result(total)
    real(wp), intent(in) :: lane(lanes)
    total = (((lane(1) + lane(5)) + (lane(3) + lane(7))) &
      & + ((lane(2) + lane(6)) + (lane(4) + lane(8))))
  end function sum_of_lanes

  !> Room for `number` sums.
  pure subroutine new_sums(order, number, sums)
    type(order_type), intent(in) :: order  !! which points are owned
    integer, intent(in) :: number  !! how many sums
    type(sums_type), intent(out) :: sums  !! nothing is added yet

    sums%number = number
    allocate (sums%block(number, order%blocks))
    if (size(order%cut) == 0) return
    allocate (sums%cut(block_points, number, size(order%cut)), source=0.0_wp)
  end subroutine new_sums

  !> Take the terms of a block, which are 0 at places without an owned point.
  pure subroutine add_block(order, block, terms, sums)
    type(order_type), intent(in) :: order  !! which points are owned
    integer, intent(in) :: block                  !! 1 to `order%blocks`, each once
    real(wp), intent(in) :: terms(:, :)           !! (block_points, number)
    type(sums_type), intent(inout) :: sums  !! with the sums of the block on return
    integer :: s, i

    do s = 1, sums%number
      sums%block(s, block) = sum_of_block(terms(:, s))
    end do
    do i = 1, size(order%cut)
      if (order%cut(i) /= order%first_block + block - 1) cycle
      sums%block(:, block) = 0.0_wp
      sums%cut(:, :, i) = terms
    end do
  end subroutine add_block

  !> The sums over all points, of all ranks.
  function total_of(order, sums) result(total)
    type(order_type), intent(in) :: order  !! which points are owned
    type(sums_type), intent(in) :: sums  !! every block has been added
    real(wp) :: total(sums%number)
    real(wp) :: group(sums%number)
    integer :: b, place

    if (associated(order%ranks)) then
      total = total_of_ranks(order, sums)
      return
    end if
    total = 0.0_wp
    b = 1
    do while (b <= order%blocks)
      place = place_of(order%first_block + b - 1_i8)
      call sum_group(order, sums, b, place, group)
      total = (total + group)
      b = b + block_points - place + 1
    end do
  end function total_of

  !> The sums of the blocks of a group, of which `first` is the first one here, at a place.
  pure subroutine sum_group(order, sums, first, at, values)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    type(sums_type), intent(in) :: sums
    integer, intent(in) :: first, at
    real(wp), intent(out) :: values(:)
    real(wp) :: terms(block_points)
    integer :: n, s

    n = min(block_points - at + 1, order%blocks - first + 1)
    do s = 1, sums%number
      terms(:at - 1) = 0.0_wp
      terms(at:at + n - 1) = sums%block(s, first:first + n - 1)
      terms(at + n:) = 0.0_wp
      values(s) = sum_of_block(terms)
    end do
  end subroutine sum_group

  !> The same where there are more ranks than one. Blocks and groups in which a rank begins are
  !> completed from the parts of all ranks.
  function total_of_ranks(order, sums) result(total)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    type(sums_type), intent(in) :: sums
    real(wp) :: total(sums%number)
    real(wp), allocatable :: group(:, :), parts(:, :, :), values(:)
    integer(i8) :: split(size(order%cut))
    integer :: s, b, c, g, n, at, groups

    split = block_of(order%cut)
    groups = int(block_of(block_of(max(1_i8, order%n_global))))
    allocate (group(groups, sums%number), source=0.0_wp)
    allocate (parts(block_points, sums%number, size(split)), source=0.0_wp)
    b = 1
    do while (b <= order%blocks)
      g = int(block_of(order%first_block + b - 1_i8))
      at = place_of(order%first_block + b - 1_i8)
      n = min(block_points - at + 1, order%blocks - b + 1)
      c = findloc(split, int(g, i8), dim=1)
      if (c == 0) then
        call sum_group(order, sums, b, at, group(g, :))
      else
        parts(at:at + n - 1, :, c) = transpose(sums%block(:, b:b + n - 1))
      end if
      b = b + n
    end do
    values = [reshape(group, [size(group)]), reshape(parts, [size(parts)])]
    if (size(split) > 0) values = [values, reshape(sums%cut, [size(sums%cut)])]
    call order%ranks%add_all(values)
    group = reshape(values(:size(group)), shape(group))
    parts = reshape(values(size(group) + 1:size(group) + size(parts)), shape(parts))
    do c = 1, size(split)
      b = size(group) + size(parts) + block_points*sums%number*(c - 1)
      do s = 1, sums%number
        ! ranks that begin in one block have left it to the first of them
        if (findloc(order%cut, order%cut(c), dim=1) == c) &
          & parts(place_of(order%cut(c)), s, findloc(split, split(c), dim=1)) &
          & = sum_of_block(values(b + 1:b + block_points))
        b = b + block_points
      end do
    end do
    do c = 1, size(split)
      if (findloc(split, split(c), dim=1) < c) cycle
      do s = 1, sums%number
        group(split(c), s) = sum_of_block(parts(:, s, c))
      end do
    end do
    total = 0.0_wp
    do g = 1, groups
      total = (total + group(g, :))
    end do
  end function total_of_ranks

  ! ---------------------------------------------------------------- sums of a few points

  !> Begin sums of points that come one after another.
  pure subroutine new_running(order, running)
    type(order_type), intent(in) :: order  !! which points are owned
    type(running_type), intent(out) :: running  !! nothing is added yet

    if (.not. associated(order%ranks)) return
    allocate (running%of_ranks)
    call new_sums(order, most_running, running%of_ranks)
    running%of_ranks%block = 0.0_wp
  end subroutine new_running

  !> Add the terms of a point; points come in ascending order, any of them may be left out. Points
  !> that the process does not own are left to those that do.
  pure subroutine add_point(order, point, terms, running)
    type(order_type), intent(in) :: order  !! which points are owned
    integer(i4), intent(in) :: point           !! its number here
    real(wp), intent(in) :: terms(:)           !! at most `most_running`
    type(running_type), intent(inout) :: running  !! with the terms of this point on return
    integer(i8) :: number
    integer :: l, n, c

    if (.not. owns(order, point)) return
    number = point + order%before
    n = size(terms)
    if (block_of(number) /= running%block) call end_block(order, block_of(number), running)
    l = int(mod(number - 1_i8, int(lanes, i8))) + 1
    running%point_lane(l, :n) = (running%point_lane(l, :n) + terms)
    if (.not. allocated(running%of_ranks)) return
    c = findloc(order%cut, running%block, dim=1)
    if (c > 0) running%of_ranks%cut(place_of(number), :n, c) &
      & = (running%of_ranks%cut(place_of(number), :n, c) + terms)
  end subroutine add_point

  !> The sum of the last block is complete; `next` is the one to come.
  pure subroutine end_block(order, next, running)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    integer(i8), intent(in) :: next
    type(running_type), intent(inout) :: running
    real(wp) :: value, terms(block_points)
    integer :: s, l

    if (running%block > 0_i8) then
      l = int(mod(running%block - 1_i8, int(lanes, i8))) + 1
      do s = 1, most_running
        value = sum_of_lanes(running%point_lane(:, s))
        running%block_lane(l, s) = (running%block_lane(l, s) + value)
        if (.not. allocated(running%of_ranks)) cycle
        if (all(order%cut /= running%block)) &
          & running%of_ranks%block(s, running%block - order%first_block + 1) = value
      end do
      running%point_lane = 0.0_wp
    end if
    if (next > 0_i8 .and. block_of(max(1_i8, next)) == running%group) then
      running%block = next
      return
    end if
    terms = 0.0_wp
    do s = 1, most_running
      ! by the loop that sums blocks elsewhere: where sum_of_lanes is compiled into this loop over
      ! sums, gfortran 12 takes the lanes one after another
      terms(:lanes) = running%block_lane(:, s)
      value = sum_of_block(terms)
      running%total(s) = (running%total(s) + value)
    end do
    running%block_lane = 0.0_wp
    running%block = next
    running%group = block_of(max(1_i8, next))
  end subroutine end_block

  !> The sums over all points that were added, on all ranks.
  function total_of_running(order, running) result(total)
    type(order_type), intent(in) :: order  !! which points are owned
    type(running_type), intent(inout) :: running  !! nothing can be added any more
    real(wp) :: total(most_running)

    call end_block(order, 0_i8, running)
    if (allocated(running%of_ranks)) then
      total = total_of(order, running%of_ranks)
    else
      total = running%total
    end if
  end function total_of_running

  !> The sum of `terms` of some points, on all ranks: the same bits as adding one after another, but
  !> threads share the blocks.
  real(wp) function sum_listed(order, points, terms) result(total)
    type(order_type), intent(in) :: order    !! which points are owned
    integer(i4), intent(in) :: points(:)     !! numbers here, ascending
    real(wp), intent(in) :: terms(:)         !! (points)
    type(running_type) :: running
    type(sums_type) :: sums
    real(wp) :: of_block(block_points, 1), totals(most_running), one(1)
    integer(i8) :: number
    integer :: begin(order%blocks + 1), b, i

    if (associated(order%ranks) .or. size(points) < worth_blocks) then
      call new_running(order, running)
      do i = 1, size(points)
        call add_point(order, points(i), terms(i:i), running)
      end do
      totals = total_of_running(order, running)
      total = totals(1)
      return
    end if
    ! the first point of each block in the list
    b = 1
    begin(1) = 1
    do i = 1, size(points)
      number = points(i) + order%before
      do while (order%first_block + b - 1 < block_of(number))
        b = b + 1
        begin(b) = i
      end do
    end do
    begin(b + 1:) = size(points) + 1
    call new_sums(order, 1, sums)
    !$omp parallel do schedule(static) default(none) shared(order, points, terms, begin, sums) &
    !$omp private(b, i, of_block)
    do b = 1, order%blocks
      of_block = 0.0_wp
      do i = begin(b), begin(b + 1) - 1
        of_block(place_of(points(i) + order%before), 1) = terms(i)
      end do
      call add_block(order, b, of_block, sums)
    end do
    one = total_of(order, sums)
    total = one(1)
  end function sum_listed

  ! ---------------------------------------------------------------- sums of arrays over slots

  !> Sum of a b.
  function inner_scalars(order, a, b) result(total)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: a(:), b(:)  !! (n_slots)
    real(wp) :: total, sums_of_all(1)
    type(sums_type) :: sums
    real(wp) :: terms(block_points, 1), other(block_points)
    integer :: i

    call new_sums(order, 1, sums)
    !$omp parallel do schedule(static) default(none) shared(order, a, b, sums) &
    !$omp private(i, terms, other)
    do i = 1, order%blocks
      call take_block(order, i, a, terms(:, 1))
      call take_block(order, i, b, other)
      terms(:, 1) = terms(:, 1)*other
      call add_block(order, i, terms, sums)
    end do
    sums_of_all = total_of(order, sums)
    total = sums_of_all(1)
  end function inner_scalars

  !> Sum of a b over all components.
  function inner_vectors(order, a, b) result(total)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: a(:, :), b(:, :)  !! (n_slots, dim)
    real(wp) :: total, sums_of_all(1)
    type(sums_type) :: sums
    real(wp) :: terms(block_points, 1), one(block_points), other(block_points)
    integer :: i, c

    call new_sums(order, 1, sums)
    !$omp parallel do schedule(static) default(none) shared(order, a, b, sums) &
    !$omp private(i, c, terms, one, other)
    do i = 1, order%blocks
      terms = 0.0_wp
      do c = 1, size(a, 2)
        call take_block(order, i, a(:, c), one)
        call take_block(order, i, b(:, c), other)
        terms(:, 1) = terms(:, 1) + one*other
      end do
      call add_block(order, i, terms, sums)
    end do
    sums_of_all = total_of(order, sums)
    total = sums_of_all(1)
  end function inner_vectors

  !> Sum of weight a b over all components.
  function inner_weighted(order, weight, a, b) result(total)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: weight(:)         !! (n_slots)
    real(wp), intent(in), contiguous :: a(:, :), b(:, :)  !! (n_slots, dim)
    real(wp) :: total, sums_of_all(1)
    type(sums_type) :: sums
    real(wp) :: terms(block_points, 1), one(block_points), other(block_points)
    integer :: i, c

    call new_sums(order, 1, sums)
    !$omp parallel do schedule(static) default(none) shared(order, weight, a, b, sums) &
    !$omp private(i, c, terms, one, other)
    do i = 1, order%blocks
      if (order%in_runs) then
        call weigh_runs(order, i, weight, a, b, terms(:, 1))
      else
        terms = 0.0_wp
        do c = 1, size(a, 2)
          call take_block(order, i, a(:, c), one)
          call take_block(order, i, b(:, c), other)
          terms(:, 1) = terms(:, 1) + one*other
        end do
        call take_block(order, i, weight, one)
        terms(:, 1) = terms(:, 1)*one
      end if
      call add_block(order, i, terms, sums)
    end do
    sums_of_all = total_of(order, sums)
    total = sums_of_all(1)
  end function inner_weighted

  !> The terms of a block whose points stand in runs: nothing is copied.
  pure subroutine weigh_runs(order, block, weight, a, b, terms)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    integer, intent(in) :: block
    real(wp), intent(in), contiguous :: weight(:), a(:, :), b(:, :)
    real(wp), intent(out) :: terms(block_points)
    integer :: r, c, i, at, from, n

    n = sum(order%run_length(order%begin(block):order%begin(block + 1) - 1))
    if (n < block_points) terms = 0.0_wp
    do r = order%begin(block), order%begin(block + 1) - 1
      at = order%run_at(r) - 1
      from = order%run_slot(r) - 1
      do i = 1, order%run_length(r)
        terms(at + i) = a(from + i, 1)*b(from + i, 1)
      end do
      do c = 2, size(a, 2)
        do i = 1, order%run_length(r)
          terms(at + i) = terms(at + i) + a(from + i, c)*b(from + i, c)
        end do
      end do
      do i = 1, order%run_length(r)
        terms(at + i) = terms(at + i)*weight(from + i)
      end do
    end do
  end subroutine weigh_runs

  !> Sum of the values of all points.
  function sum_over(order, values) result(total)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: values(:)  !! (n_slots)
    real(wp) :: total, sums_of_all(1)
    type(sums_type) :: sums
    real(wp) :: terms(block_points, 1)
    integer :: i

    call new_sums(order, 1, sums)
    !$omp parallel do schedule(static) default(none) shared(order, values, sums) private(i, terms)
    do i = 1, order%blocks
      call take_block(order, i, values, terms(:, 1))
      call add_block(order, i, terms, sums)
    end do
    sums_of_all = total_of(order, sums)
    total = sums_of_all(1)
  end function sum_over

  ! ---------------------------------------------------------------- extremes and first places

  !> The largest value of a point; -huge where there is none.
  real(wp) function largest_scalar(order, values) result(largest)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: values(:)  !! (n_slots)
    integer :: block, i, n, at, slots(block_points)

    largest = -huge(largest)
    !$omp parallel do schedule(static) default(none) shared(order, values) &
    !$omp private(block, i, n, at, slots) reduction(max:largest)
    do block = 1, order%blocks
      call slots_of_block(order, block, at, n, slots)
      do i = 1, n
        largest = max(largest, values(slots(i)))
      end do
    end do
    largest = largest_of_ranks(order, largest)
  end function largest_scalar

  !> The largest size of a component of a point; 0 where there is none.
  real(wp) function largest_size(order, values) result(largest)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: values(:, :)  !! (n_slots, dim)
    integer :: block, i, n, c, at, slots(block_points)

    largest = 0.0_wp
    !$omp parallel do schedule(static) default(none) shared(order, values) &
    !$omp private(block, i, n, c, at, slots) reduction(max:largest)
    do block = 1, order%blocks
      call slots_of_block(order, block, at, n, slots)
      do c = 1, size(values, 2)
        do i = 1, n
          largest = max(largest, abs(values(slots(i), c)))
        end do
      end do
    end do
    largest = largest_of_ranks(order, largest)
  end function largest_size

  !> The least value of a point; huge where there is none.
  real(wp) function least_over(order, values) result(least)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: values(:)  !! (n_slots)
    integer :: block, i, n, at, slots(block_points)

    least = huge(least)
    !$omp parallel do schedule(static) default(none) shared(order, values) &
    !$omp private(block, i, n, at, slots) reduction(min:least)
    do block = 1, order%blocks
      call slots_of_block(order, block, at, n, slots)
      do i = 1, n
        least = min(least, values(slots(i)))
      end do
    end do
    least = -largest_of_ranks(order, -least)
  end function least_over

  !> The number, among the points of all ranks, of the first point that is marked; 0: none is.
  integer(i8) function first_where(order, marked) result(first)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    logical, intent(in) :: marked(:)  !! (n_slots)
    integer :: block, i, n, at, slots(block_points)

    first = 0_i8
    blocks: do block = 1, order%blocks
      call slots_of_block(order, block, at, n, slots)
      do i = 1, n
        if (.not. marked(slots(i))) cycle
        first = (order%first_block + block - 2)*block_points + at + i - 1
        exit blocks
      end do
    end do blocks
    if (.not. associated(order%ranks)) return
    ! numbers of points are exact as reals
    if (first == 0_i8) first = order%n_global + 1_i8
    first = -nint(largest_of_ranks(order, -real(first, wp)), i8)
    if (first > order%n_global) first = 0_i8
  end function first_where

  !> The number, among the points of all ranks, of the first point with the largest value.
  integer(i8) function first_largest(order, values) result(first)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: values(:)  !! (n_slots)
    real(wp) :: largest
    largest = largest_over(order, values)
    first = first_where(order, values >= largest)
  end function first_largest

  !> The largest of what each rank has.
  real(wp) function largest_of_ranks(order, value) result(largest)
    type(order_type), intent(in) :: order  !! which ranks there are
    real(wp), intent(in) :: value  !! what this rank has
    real(wp) :: values(1)

    largest = value
    if (.not. associated(order%ranks)) return
    values = value
    call order%ranks%take_largest(values)
    largest = values(1)
  end function largest_of_ranks

  !> The sum of what each rank has. Its rounding depends on the ranks: it is for what only watches.
  real(wp) function sum_of_ranks(order, value) result(total)
    type(order_type), intent(in) :: order  !! which ranks there are
    real(wp), intent(in) :: value  !! what this rank has
    real(wp) :: values(1)

    total = value
    if (.not. associated(order%ranks)) return
    values = value
    call order%ranks%add_all(values)
    total = values(1)
  end function sum_of_ranks

  !> The number that all ranks have counted together, up to 2^53.
  integer(i8) function count_of_ranks(order, number) result(total)
    type(order_type), intent(in) :: order  !! which ranks there are
    integer(i8), intent(in) :: number  !! what this rank has counted
    total = number
    if (associated(order%ranks)) total = nint(sum_of_ranks(order, real(number, wp)), i8)
  end function count_of_ranks

  ! ---------------------------------------------------------------- random numbers

  !> The next number in (-1, 1) of a sequence that is the same on every machine: the multiplicative
  !> generator of Park and Miller (1988), 16807 modulo 2^31 - 1. `state` starts it, from 1 to
  !> 2147483646, and is changed.
  real(wp) function noise(state)
    integer, intent(inout) :: state  !! of the sequence, 1 to 2147483646; the next one on return
    ! Schrage's way to keep 16807*state mod 2^31-1 within 32 bits
    state = 16807*mod(state, 127773) - 2836*(state/127773)
    if (state <= 0) state = state + 2147483647
    noise = 2*real(state, wp)/2147483647.0_wp - 1
  end function noise

  !> The state of `noise` after so many numbers: a rank begins with its own points.
  pure integer function noise_after(seed, drawn) result(state)
    integer, intent(in) :: seed  !! the state at the beginning, 1 to 2147483646
    integer(i8), intent(in) :: drawn  !! how many numbers
    integer(i8), parameter :: modulus = 2147483647_i8
    integer(i8) :: factor, power, left

    factor = 1_i8
    power = 16807_i8
    left = drawn
    do while (left > 0_i8)
      if (mod(left, 2_i8) == 1_i8) factor = mod(factor*power, modulus)
      power = mod(power*power, modulus)
      left = left/2_i8
    end do
    state = int(mod(factor*seed, modulus))
  end function noise_after

end module pd_base_reduce
