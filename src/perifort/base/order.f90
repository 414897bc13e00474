!> The order of points: their numbers, blocks of them, the slots in which they are, and the ranks
!> that own them.
!>
!> A rank is a process that owns some of the points. It numbers them from 1, in the order of their
!> numbers among all points, and copies of other ranks' points (its halo) come after them. There is
!> one process, which owns all points, as long as `ranks` points to nothing.
module pd_base_order
  use pd_base_kinds, only: wp, i4, i8
  implicit none (type, external)
  private
  public :: order_type, ranks_type, block_points, number_of, owned_point, owns, place_in
  public :: number_points, slots_of_block, take_block, put_block, ascending_order
  public :: exchange, side_exchange

  integer, parameter :: block_points = 256  !! points of a block
  !> Runs of points in consecutive slots are used if they have so many points in the mean.
  integer, parameter :: worth_runs = 8

  !> Values of two kinds can be on their way at once.
  integer, parameter :: exchange = 1, side_exchange = 2

  !> What ranks say to each other. Every rank makes the same calls in the same order.
  type, abstract :: ranks_type
    integer(i8) :: bytes = 0_i8               !! that this rank has sent of its points' values
    integer(i8) :: messages = 0_i8            !! in so many messages
    integer(i8) :: sums = 0_i8                !! reductions over all ranks
    real(wp) :: sharing = 0.0_wp              !! time spent with the messages [s]
    real(wp) :: summing = 0.0_wp              !! with reductions and waiting for other ranks [s]
  contains
    procedure(all_values), deferred :: add_all       !! each value summed over the ranks
    procedure(all_values), deferred :: take_largest  !! the largest of each value
    procedure :: share                               !! values of other ranks' points
    procedure(values_to_send), deferred :: start_sharing     !! send them; what is computed
    procedure(values_to_take), deferred :: finish_sharing    !! between needs none of them
    procedure(all_points), deferred :: collect        !! values of all ranks, on the first one
    procedure(dealt_values), deferred :: deal         !! values from every rank to every rank
    procedure(count_before), deferred :: number_before  !! sum over the ranks before this one
  end type ranks_type

  abstract interface
    !> Replace `values` by their sum or maximum over all ranks.
    subroutine all_values(self, values)
      import :: ranks_type, wp
      implicit none (type, external)
      class(ranks_type), intent(inout) :: self
      real(wp), intent(inout) :: values(:)  !! as many on every rank
    end subroutine all_values

    !> Send the values of owned points to those that have copies of them.
    subroutine values_to_send(self, values, which)
      import :: ranks_type, wp
      implicit none (type, external)
      class(ranks_type), intent(inout) :: self
      real(wp), intent(in), contiguous :: values(:, :)  !! (n_slots, components); may change when
                                                        !! the call has returned
      integer, intent(in) :: which  !! `exchange` or `side_exchange`, which has been finished
    end subroutine values_to_send

    !> Wait for the values of copies that their owners have sent.
    subroutine values_to_take(self, values, which)
      import :: ranks_type, wp
      implicit none (type, external)
      class(ranks_type), intent(inout) :: self
      real(wp), intent(inout), contiguous :: values(:, :)  !! (n_slots, components) those of copies
                                                           !! are set
      integer, intent(in) :: which  !! that has been started
    end subroutine values_to_take

    !> The sum of what the ranks before this one have; 0 on the first.
    integer(i8) function count_before(self, number) result(before)
      import :: ranks_type, i8
      implicit none (type, external)
      class(ranks_type), intent(inout) :: self
      integer(i8), intent(in) :: number  !! of this rank
    end function count_before

    !> Every rank gives every rank some of its values.
    subroutine dealt_values(self, values, given, got, taken)
      import :: ranks_type, wp
      implicit none (type, external)
      class(ranks_type), intent(inout) :: self
      real(wp), intent(in) :: values(:)   !! those for the first rank, those for the second, ..
      integer, intent(in) :: given(:)     !! (ranks) how many each rank gets
      real(wp), allocatable, intent(out) :: got(:)  !! from the first rank, from the second, ..
      integer, intent(in), optional :: taken(:)
        !! (ranks) how many come from each, if all ranks know it; else they tell each other
    end subroutine dealt_values

    !> Values of all ranks one after another, in the order of ranks, on the first one.
    subroutine all_points(self, values, all_values)
      import :: ranks_type, wp
      implicit none (type, external)
      class(ranks_type), intent(inout) :: self
      real(wp), intent(in) :: values(:)                    !! of this rank; any number
      real(wp), allocatable, intent(out) :: all_values(:)  !! of size 0 on the other ranks
    end subroutine all_points
  end interface

  !> Which points a process owns and where they are. Blocks are of 256 owned points that follow
  !> each other.
  type :: order_type
    integer :: n_owned = 0           !! owned points, the first ones here
    integer(i8) :: n_global = 0_i8   !! points of all ranks
    integer :: blocks = 0            !! of owned points
    logical :: in_runs = .true.      !! the runs below are there, else the slots
    integer(i4), allocatable :: begin(:)       !! first run of each block (blocks + 1)
    integer(i4), allocatable :: run_slot(:)    !! slot of a run's first point
    integer(i4), allocatable :: run_at(:)      !! its place in the block, from 1
    integer(i4), allocatable :: run_length(:)  !! points in consecutive slots
    integer(i4), allocatable :: slot(:)        !! of each owned point
    integer(i8), allocatable :: number(:)      !! of each owned point among those of all ranks,
                                               !! ascending; not allocated: its number here
    logical :: reproducible = .false.              !! results must not depend on the ranks
    class(ranks_type), pointer :: ranks => null()  !! null: this process owns all points
  end type order_type

  !> The places of integers in ascending order of value; equal ones stay as they stand.
  interface ascending_order
    module procedure :: order_of_short, order_of_long
  end interface ascending_order

contains

  !> Copy the values of points that others own from there.
  subroutine share(self, values)
    class(ranks_type), intent(inout) :: self
    real(wp), intent(inout), contiguous :: values(:, :)  !! (n_slots, components)

    call self%start_sharing(values, exchange)
    call self%finish_sharing(values, exchange)
  end subroutine share

  !> Note where the owned points are, and their numbers among those of all ranks.
  pure subroutine number_points(slot, order, number, n_global)
    integer(i4), intent(in) :: slot(:)            !! (owned points)
    type(order_type), intent(inout) :: order      !! `ranks` and `reproducible` stay as they are
    integer(i8), intent(in), optional :: number(:)  !! (owned points) ascending; if absent, all
                                                    !! points are owned
    integer(i8), intent(in), optional :: n_global   !! points of all ranks
    integer :: i, n, pass, block

    order%n_owned = size(slot)
    order%n_global = size(slot, kind=i8)
    if (present(n_global)) order%n_global = n_global
    order%blocks = block_of(size(slot))
    if (size(slot) == 0) order%blocks = 0
    if (allocated(order%begin)) deallocate (order%begin, order%run_slot, order%run_at, &
      & order%run_length)
    if (allocated(order%slot)) deallocate (order%slot)
    if (present(number)) order%number = number
    allocate (order%begin(order%blocks + 1), source=1_i4)
    do pass = 1, 2
      n = 0
      do i = 1, size(slot)
        block = block_of(i)
        if (goes_on(slot, i)) then
          if (pass == 2) order%run_length(n) = order%run_length(n) + 1_i4
          cycle
        end if
        n = n + 1
        order%begin(block + 1) = int(n + 1, i4)
        if (pass == 1) cycle
        order%run_slot(n) = slot(i)
        order%run_at(n) = int(place_of(i), i4)
        order%run_length(n) = 1_i4
      end do
      ! the compiler may compute the last values of a run in another way than its first ones: where
      ! runs depend on the ranks, blocks are copied and computed as a whole
      if (pass == 1) order%in_runs = int(n, i8)*worth_runs <= max(size(slot), 2*worth_runs) &
        & .and. .not. order%reproducible
      if (.not. order%in_runs) exit
      if (pass == 1) allocate (order%run_slot(n), order%run_at(n), order%run_length(n))
    end do
    if (order%in_runs) return
    order%slot = slot
    allocate (order%run_slot(0), order%run_at(0), order%run_length(0))
  end subroutine number_points

  !> Whether a point goes on with the run of the one before it, in the same block.
  pure logical function goes_on(slot, i)
    integer(i4), intent(in) :: slot(:)
    integer, intent(in) :: i
    goes_on = .false.
    if (place_of(i) > 1) goes_on = slot(i) == slot(i - 1) + 1_i4
  end function goes_on

  !> The block of an owned point.
  elemental integer function block_of(point)
    integer, intent(in) :: point  !! its number here
    block_of = (point - 1)/block_points + 1
  end function block_of

  !> The place of an owned point in its block, from 1.
  elemental integer function place_of(point)
    integer, intent(in) :: point  !! its number here
    place_of = mod(point - 1, block_points) + 1
  end function place_of

  !> The number of an owned point among the points of all ranks.
  elemental integer(i8) function number_of(order, point)
    type(order_type), intent(in) :: order  !! the points that are owned
    integer, intent(in) :: point           !! its number here
    number_of = int(point, i8)
    if (allocated(order%number)) number_of = order%number(point)
  end function number_of

  !> The number here of an owned point; 0 where another rank owns it.
  pure integer function owned_point(order, number) result(point)
    type(order_type), intent(in) :: order  !! the points that are owned
    integer(i8), intent(in) :: number      !! its number among the points of all ranks

    if (allocated(order%number)) then
      point = place_in(order%number, number)
    else
      point = 0
      if (number <= order%n_owned) point = int(number)
    end if
  end function owned_point

  !> The place of a number among ascending ones; 0 if it is not there.
  pure integer function place_in(numbers, number) result(place)
    integer(i8), intent(in) :: numbers(:)  !! (n) ascending
    integer(i8), intent(in) :: number      !! to be found
    integer :: low, high

    low = 1
    high = size(numbers)
    do while (low <= high)
      place = low + (high - low)/2
      if (numbers(place) == number) return
      if (numbers(place) < number) low = place + 1
      if (numbers(place) > number) high = place - 1
    end do
    place = 0
  end function place_in

  !> Whether the point with this number here (0: none) is one that the process owns.
  elemental logical function owns(order, point)
    type(order_type), intent(in) :: order  !! the points that are owned
    integer(i4), intent(in) :: point  !! its number here, or 0
    owns = point > 0_i4 .and. point <= order%n_owned
  end function owns

  !> The slots of the points of a block, in their order.
  pure subroutine slots_of_block(order, block, n, slots)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    integer, intent(in) :: block                !! 1 to `order%blocks`
    integer, intent(out) :: n                   !! how many
    integer, intent(out) :: slots(block_points)  !! the first `n` are set
    integer :: r, i, first

    first = (block - 1)*block_points
    n = min(order%n_owned - first, block_points)
    if (.not. order%in_runs) then
      slots(:n) = order%slot(first + 1:first + n)
      return
    end if
    do r = order%begin(block), order%begin(block + 1) - 1
      do i = 1, order%run_length(r)
        slots(order%run_at(r) + i - 1) = order%run_slot(r) + i - 1
      end do
    end do
  end subroutine slots_of_block

  !> The values of a block's points at their places in the block; 0 behind the last one.
  pure subroutine take_block(order, block, values, taken)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    integer, intent(in) :: block                      !! 1 to `order%blocks`
    real(wp), intent(in), contiguous :: values(:)     !! (n_slots)
    real(wp), intent(out) :: taken(block_points)  !! by place in the block
    integer :: r, i, at, from, first, n

    first = (block - 1)*block_points
    n = min(order%n_owned - first, block_points)
    if (n < block_points) taken(n + 1:) = 0.0_wp
    if (order%in_runs) then
      do r = order%begin(block), order%begin(block + 1) - 1
        at = order%run_at(r)
        from = order%run_slot(r)
        taken(at:at + order%run_length(r) - 1) = values(from:from + order%run_length(r) - 1)
      end do
      return
    end if
    do i = 1, n
      taken(i) = values(order%slot(first + i))
    end do
  end subroutine take_block

  !> The other way round.
  pure subroutine put_block(order, block, taken, values)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    integer, intent(in) :: block                        !! 1 to `order%blocks`
    real(wp), intent(in) :: taken(block_points)  !! by place in the block
    real(wp), intent(inout), contiguous :: values(:)    !! (n_slots); others stay
    integer :: r, i, at, from, first

    if (order%in_runs) then
      do r = order%begin(block), order%begin(block + 1) - 1
        at = order%run_at(r)
        from = order%run_slot(r)
        values(from:from + order%run_length(r) - 1) = taken(at:at + order%run_length(r) - 1)
      end do
      return
    end if
    first = (block - 1)*block_points
    do i = 1, min(order%n_owned - first, block_points)
      values(order%slot(first + i)) = taken(i)
    end do
  end subroutine put_block

  !> The places of `values` in ascending order of value; equal ones stay as they stand.
  pure function order_of_long(values) result(order)
    integer(i8), intent(in) :: values(:)  !! (n) in any order
    integer, allocatable :: order(:)
    integer, allocatable :: other(:)
    integer :: width, i, middle, last, n

    n = size(values)
    order = [(i, i=1, n)]
    if (all(values(2:) >= values(:n - 1))) return
    allocate (other(n))
    width = 1
    do while (width < n)
      do i = 1, n, 2*width
        middle = min(i + width, n + 1)
        last = min(i + 2*width, n + 1)
        call merge_parts(order(i:middle - 1), order(middle:last - 1), other(i:last - 1))
      end do
      order = other
      width = 2*width
    end do

  contains

    !> Merge two parts that are in order.
    pure subroutine merge_parts(a, b, both)
      integer, intent(in) :: a(:), b(:)
      integer, intent(out) :: both(:)
      integer :: j, k, m

      j = 1
      k = 1
      do m = 1, size(both)
        if (k > size(b)) then
          both(m) = a(j)
          j = j + 1
        else if (j > size(a)) then
          both(m) = b(k)
          k = k + 1
        else if (values(a(j)) <= values(b(k))) then
          both(m) = a(j)
          j = j + 1
        else
          both(m) = b(k)
          k = k + 1
        end if
      end do
    end subroutine merge_parts
  end function order_of_long

  !> The same of short integers.
  pure function order_of_short(values) result(order)
    integer(i4), intent(in) :: values(:)  !! (n) in any order
    integer, allocatable :: order(:)
    order = order_of_long(int(values, i8))
  end function order_of_short

end module pd_base_order
