!> The order of points: their numbers, fixed blocks of these, the slots in which they are, and the
!> ranks that own them.
!>
!> A rank is a process that owns a range of point numbers. There is one, which owns all points, as
!> long as `ranks` points to nothing.
module pd_base_order
  use pd_base_kinds, only: wp, i4, i8
  implicit none (type, external)
  private
  public :: order_type, ranks_type, block_points, block_of, place_of, owns
  public :: number_points, slots_of_block, take_block, put_block, ascending_order

  integer, parameter :: block_points = 256  !! points of a block, and blocks of a group
  !> Runs of points in consecutive slots are used if they have so many points in the mean.
  integer, parameter :: worth_runs = 8

  !> What ranks say to each other. Every rank makes the same calls in the same order.
  type, abstract :: ranks_type
  contains
    procedure(all_values), deferred :: add_all       !! each value summed over the ranks
    procedure(all_values), deferred :: take_largest  !! the largest of each value
    procedure(halo_values), deferred :: share         !! values of other ranks' points
  end type ranks_type

  abstract interface
    !> Replace `values` by their sum or maximum over all ranks.
    subroutine all_values(self, values)
      import :: ranks_type, wp
      implicit none (type, external)
      class(ranks_type), intent(inout) :: self
      real(wp), intent(inout) :: values(:)  !! as many on every rank
    end subroutine all_values

    !> Copy the values of points that others own from there.
    subroutine halo_values(self, values)
      import :: ranks_type, wp
      implicit none (type, external)
      class(ranks_type), intent(inout) :: self
      real(wp), intent(inout) :: values(:, :)  !! (n_slots, components)
    end subroutine halo_values
  end interface

  !> Which points a process owns and where they are. Numbers of points are those of all ranks; a
  !> point's number here is less by `before`.
  type :: order_type
    integer(i8) :: first = 1_i8      !! owned points
    integer(i8) :: last = 0_i8
    integer(i8) :: n_global = 0_i8   !! points of all ranks
    integer(i8) :: before = 0_i8     !! number of an owned point minus its number here
    integer(i8) :: first_block = 1_i8  !! block of the first owned point
    integer :: blocks = 0            !! blocks with owned points
    logical :: in_runs = .true.      !! the runs below are there, else the slots
    integer(i4), allocatable :: begin(:)       !! first run of each block (blocks + 1)
    integer(i4), allocatable :: run_slot(:)    !! slot of a run's first point
    integer(i4), allocatable :: run_at(:)      !! its place in the block, from 1
    integer(i4), allocatable :: run_length(:)  !! points in consecutive slots
    integer(i4), allocatable :: slot(:)        !! of each owned point
    integer(i8), allocatable :: cut(:)         !! block of the first point of each rank but the
                                               !! first, ascending
    class(ranks_type), pointer :: ranks => null()  !! null: this process owns all points
  end type order_type

contains

  !> Note where the points are.
  pure subroutine number_points(slot, order, first, last, before, n_global)
    integer(i4), intent(in) :: slot(:)                 !! of the points here
    type(order_type), intent(inout) :: order           !! `ranks` and `cut` stay as they are
    integer, intent(in), optional :: first, last       !! owned points, by their numbers here; all
    integer(i8), intent(in), optional :: before        !! added to these it is that of all ranks; 0
    integer(i8), intent(in), optional :: n_global      !! points of all ranks
    integer :: one, two, i, n, pass
    integer(i8) :: block

    one = 1
    two = size(slot)
    if (present(first)) one = first
    if (present(last)) two = last
    order%before = 0_i8
    if (present(before)) order%before = before
    order%first = one + order%before
    order%last = two + order%before
    order%n_global = size(slot, kind=i8)
    if (present(n_global)) order%n_global = n_global
    if (.not. allocated(order%cut)) allocate (order%cut(0))
    order%first_block = block_of(order%first)
    order%blocks = 0
    if (two >= one) order%blocks = int(block_of(order%last) - order%first_block + 1_i8)
    if (allocated(order%begin)) deallocate (order%begin, order%run_slot, order%run_at, &
      & order%run_length)
    if (allocated(order%slot)) deallocate (order%slot)
    allocate (order%begin(order%blocks + 1), source=1_i4)
    do pass = 1, 2
      n = 0
      do i = one, two
        block = block_of(i + order%before) - order%first_block + 1_i8
        if (i > one) then
          if (slot(i) == slot(i - 1) + 1_i4 .and. place_of(i + order%before) > 1) then
            if (pass == 2) order%run_length(n) = order%run_length(n) + 1_i4
            cycle
          end if
        end if
        n = n + 1
        order%begin(block + 1) = int(n + 1, i4)
        if (pass == 1) cycle
        order%run_slot(n) = slot(i)
        order%run_at(n) = int(place_of(i + order%before), i4)
        order%run_length(n) = 1_i4
      end do
      if (pass == 1) order%in_runs = int(n, i8)*worth_runs <= max(two - one + 1, 2*worth_runs)
      if (.not. order%in_runs) exit
      if (pass == 1) allocate (order%run_slot(n), order%run_at(n), order%run_length(n))
    end do
    if (order%in_runs) return
    order%slot = slot(one:two)
    allocate (order%run_slot(0), order%run_at(0), order%run_length(0))
  end subroutine number_points

  !> The block of a point.
  elemental integer(i8) function block_of(point)
    integer(i8), intent(in) :: point  !! its number, among those of all ranks
    block_of = (point - 1_i8)/block_points + 1_i8
  end function block_of

  !> The place of a point in its block, from 1.
  elemental integer function place_of(point)
    integer(i8), intent(in) :: point  !! its number, among those of all ranks
    place_of = int(mod(point - 1_i8, int(block_points, i8))) + 1
  end function place_of

  !> Whether the point with this number here (0: none) is one that the process owns.
  elemental logical function owns(order, point)
    type(order_type), intent(in) :: order  !! the points that are owned
    integer(i4), intent(in) :: point  !! its number here, or 0
    owns = point + order%before >= order%first .and. point + order%before <= order%last &
      & .and. point > 0_i4
  end function owns

  !> The slots of the owned points of a block: those of the places `at`, `at` + 1, ...
  pure subroutine slots_of_block(order, block, at, n, slots)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    integer, intent(in) :: block                !! 1 to `order%blocks`
    integer, intent(out) :: at                  !! place of the first one in the block
    integer, intent(out) :: n                   !! how many
    integer, intent(out) :: slots(block_points)  !! the first `n` are set
    integer(i8) :: first, last
    integer :: r, i, m

    first = max(order%first, (order%first_block + block - 2)*block_points + 1)
    last = min(order%last, (order%first_block + block - 1)*block_points)
    at = place_of(first)
    n = int(last - first + 1_i8)
    if (.not. order%in_runs) then
      slots(:n) = order%slot(first - order%first + 1:last - order%first + 1)
      return
    end if
    m = 0
    do r = order%begin(block), order%begin(block + 1) - 1
      do i = 1, order%run_length(r)
        slots(m + i) = order%run_slot(r) + i - 1
      end do
      m = m + order%run_length(r)
    end do
  end subroutine slots_of_block

  !> The values of a block's owned points at their places in the block; 0 elsewhere.
  pure subroutine take_block(order, block, values, taken)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    integer, intent(in) :: block                      !! 1 to `order%blocks`
    real(wp), intent(in), contiguous :: values(:)     !! (n_slots)
    real(wp), intent(out) :: taken(block_points)  !! by place in the block
    integer(i8) :: first, last
    integer :: r, i, at, from

    first = (order%first_block + block - 2)*block_points
    last = min(order%last - first, int(block_points, i8))
    if (first < order%first - 1_i8 .or. last < block_points) taken = 0.0_wp
    if (order%in_runs) then
      do r = order%begin(block), order%begin(block + 1) - 1
        at = order%run_at(r)
        from = order%run_slot(r)
        taken(at:at + order%run_length(r) - 1) = values(from:from + order%run_length(r) - 1)
      end do
      return
    end if
    do i = int(max(1_i8, order%first - first)), int(last)
      taken(i) = values(order%slot(first + i - order%first + 1))
    end do
  end subroutine take_block

  !> The other way round.
  pure subroutine put_block(order, block, taken, values)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    integer, intent(in) :: block                        !! 1 to `order%blocks`
    real(wp), intent(in) :: taken(block_points)  !! by place in the block
    real(wp), intent(inout), contiguous :: values(:)    !! (n_slots); others stay
    integer(i8) :: first, last
    integer :: r, i, at, from

    if (order%in_runs) then
      do r = order%begin(block), order%begin(block + 1) - 1
        at = order%run_at(r)
        from = order%run_slot(r)
        values(from:from + order%run_length(r) - 1) = taken(at:at + order%run_length(r) - 1)
      end do
      return
    end if
    first = (order%first_block + block - 2)*block_points
    last = min(order%last - first, int(block_points, i8))
    do i = int(max(1_i8, order%first - first)), int(last)
      values(order%slot(first + i - order%first + 1)) = taken(i)
    end do
  end subroutine put_block

  !> The places of `values` in ascending order of value; equal ones stay as they stand.
  pure function ascending_order(values) result(order)
    integer(i4), intent(in) :: values(:)  !! (n) in any order
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
  end function ascending_order

end module pd_base_order
