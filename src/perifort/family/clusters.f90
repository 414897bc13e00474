!> Clusters of neighbouring points, `lanes` of them, for list families: the order in which eight
!> points that follow each other lie close together, and the points that some of the eight have as
!> family members. Loops then work on eight bonds at a time, all with the same other end.
module pd_family_clusters
  use pd_base_kinds, only: wp, i1, i2, i4, i8
  use pd_base_lanes, only: lanes
  use pd_base_order, only: ascending_order
  use pd_family_cells, only: cells_type, sort_into_cells
  implicit none (type, external)
  private
  public :: rows_type, order_in_rows, collect_members, pair_members, single_members, lane_bit

  !> The bit by which a lane is marked.
  integer(i1), parameter :: lane_bit(lanes) = int([1, 2, 4, 8, 16, 32, 64, -128], i1)

  !> Points, or a group of them, in rows of cells along x. Every other row is walked backwards, so
  !> that the end of a row and the beginning of the next lie side by side.
  type :: rows_type
    integer :: count(3) = 1                !! cells along each direction
    real(wp) :: lower(3) = 0.0_wp          !! corner of the first cell [m]
    real(wp) :: size(3) = 1.0_wp           !! edges of a cell [m]
    integer(i4), allocatable :: first(:)   !! first point of each cell, in the order they are walked
  end type rows_type

contains

  !> Sort the points `x` (n, dim) into rows of cells about `edge` [m] wide, along the rows by their
  !> x. `order(i)` is the number of the point that becomes the i-th.
  subroutine order_in_rows(x, edge, before, rows, order)
    real(wp), intent(in) :: x(:, :)                    !! (n, dim) positions [m]
    real(wp), intent(in) :: edge                       !! least width of a cell [m]
    integer, intent(in) :: before                      !! points of other groups, which come first
    type(rows_type), intent(out) :: rows  !! of cells that hold the points in their new order
    integer(i4), allocatable, intent(out) :: order(:)  !! (n) a permutation of 1 to n
    type(cells_type) :: cells
    integer :: row, i, nx, at, n, length
    logical :: backwards

    call sort_into_cells(x, edge, cells)
    rows%count = cells%count
    rows%lower = cells%lower
    rows%size = cells%size
    nx = cells%count(1)
    allocate (rows%first(size(cells%first)), order(size(x, 1)))
    n = 0
    do row = 0, product(cells%count)/nx - 1
      backwards = is_backwards(row)
      do i = 0, nx - 1
        at = 1 + nx*row + merge(nx - 1 - i, i, backwards)
        rows%first(1 + nx*row + i) = int(n + 1, i4)
        length = cells%first(at + 1) - cells%first(at)
        order(n + 1:n + length) = cells%order(cells%first(at):cells%first(at + 1) - 1)
        call sort_along(x(:, 1), backwards, order(n + 1:n + length))
        n = n + length
      end do
    end do
    rows%first(size(rows%first)) = int(n + 1, i4)
    rows%first = rows%first + int(before, i4)
  end subroutine order_in_rows

  !> Whether a row, counted from 0, is walked backwards.
  pure logical function is_backwards(row)
    integer, intent(in) :: row
    is_backwards = mod(row, 2) == 1
  end function is_backwards

  !> Sort points by their x, falling if `backwards`; ties keep their order. A cell has few points.
  pure subroutine sort_along(x, backwards, points)
    real(wp), intent(in) :: x(:)
    logical, intent(in) :: backwards
    integer(i4), intent(inout) :: points(:)
    integer(i4) :: point
    integer :: i, j
    real(wp) :: direction

    direction = merge(-1.0_wp, 1.0_wp, backwards)
    do i = 2, size(points)
      point = points(i)
      do j = i - 1, 1, -1
        if (direction*x(points(j)) <= direction*x(point)) exit
        points(j + 1) = points(j)
      end do
      points(j + 1) = point
    end do
  end subroutine sort_along

  !> The members of all clusters of the points `x` (n, dim), which are in the order of `rows`: those
  !> of cluster c stand from `start(c)` to `start(c+1) - 1`, ascending, each with the bits of the
  !> lanes whose family it is in. Two points are neighbours if they are no further apart than the
  !> sum of their `half_reach` and the larger one of their `own` [m], and if their labels differ.
  subroutine collect_members(x, half_reach, own, label, rows, start, member, bits)
    real(wp), intent(in), contiguous :: x(:, :)  !! (n, dim) positions in the order of `rows` [m]
    real(wp), intent(in), contiguous :: half_reach(:)   !! (n) half of the reach of each point [m]
    real(wp), intent(in), contiguous :: own(:)
      !! (n) what reaches farther by the larger one of both ends [m]
    integer(i2), intent(in), contiguous :: label(:)     !! (n) of each point; 0: none, like no other
    type(rows_type), intent(in) :: rows(:)              !! (groups) as `order_in_rows` made them
    integer(i8), allocatable, intent(out) :: start(:)
      !! (clusters + 1) first member of each cluster
    integer(i4), allocatable, intent(out) :: member(:)  !! (members of all clusters) their points
    integer(i1), allocatable, intent(out) :: bits(:)
      !! (as `member`) the lanes whose family it is in
    integer(i4) :: no_member(0)
    integer(i1) :: no_bits(0)
    real(wp) :: most
    logical :: labelled
    integer :: c, found

    most = maxval(half_reach) + maxval(own)
    labelled = any(label /= 0_i2)
    allocate (start((size(x, 1) + lanes - 1)/lanes + 1))
    start(1) = 1_i8
    ! searching twice, first to count, needs no room but that of the result
    !$omp parallel do schedule(dynamic, 64) default(none) private(c, found, no_member, no_bits) &
    !$omp shared(x, half_reach, own, label, rows, start, most, labelled)
    do c = 1, size(start) - 1
      call visit(x, half_reach, own, label, labelled, most, rows, c, found, no_member, no_bits)
      start(c + 1) = found
    end do
    do c = 1, size(start) - 1
      start(c + 1) = start(c) + start(c + 1)
    end do
    allocate (member(start(size(start)) - 1), bits(start(size(start)) - 1))
    !$omp parallel do schedule(dynamic, 64) default(none) private(c, found) &
    !$omp shared(x, half_reach, own, label, rows, start, member, bits, most, labelled)
    do c = 1, size(start) - 1
      call visit(x, half_reach, own, label, labelled, most, rows, c, found, &
        & member(start(c):start(c + 1) - 1), bits(start(c):start(c + 1) - 1))
    end do
  end subroutine collect_members

  !> Packs of all clusters: a pack is one member, or two that share no lane, so that one pass over
  !> eight lanes serves both. From the members as `collect_members` finds them; on return those of
  !> cluster c are the packs from `start(c)` to `start(c+1) - 1`: `pair` (2, packs) has their slots
  !> (twice the same for a single one), `bits` the lanes with a bond, and `first` the lanes whose
  !> bond goes to `pair(1, :)`.
  subroutine pair_members(start, member, bits, pair, first)
    integer(i8), intent(inout) :: start(:)
      !! (clusters + 1) first member of each cluster; its first pack on return
    integer(i4), intent(in) :: member(:)  !! (members) their points, which are their slots
    integer(i1), allocatable, intent(inout) :: bits(:)
      !! (members) the lanes of each; (packs) those of both members of a pack on return
    integer(i4), allocatable, intent(out) :: pair(:, :)
      !! (2, packs) slots of the members of each pack
    integer(i1), allocatable, intent(out) :: first(:)
      !! (packs) the lanes whose bond goes to the first of the two
    integer(i8), allocatable :: begin(:)
    integer(i4), allocatable :: partner(:)
    integer(i1), allocatable :: both(:)
    integer(i8) :: e, n
    integer :: c

    allocate (partner(size(member)), begin(size(start)))
    begin(1) = 1_i8
    !$omp parallel do schedule(dynamic, 64) default(none) private(c) &
    !$omp shared(start, bits, partner, begin)
    do c = 1, size(start) - 1
      associate (here => partner(start(c):start(c + 1) - 1))
        call choose_partners(bits(start(c):start(c + 1) - 1), here)
        begin(c + 1) = count(here >= 0)
      end associate
    end do
    do c = 1, size(start) - 1
      begin(c + 1) = begin(c) + begin(c + 1)
    end do
    n = begin(size(begin)) - 1
    allocate (pair(2, n), first(n), both(n))
    !$omp parallel do schedule(dynamic, 64) default(none) private(c, e, n) &
    !$omp shared(start, member, bits, partner, begin, pair, first, both)
    do c = 1, size(start) - 1
      n = begin(c)
      do e = start(c), start(c + 1) - 1
        if (partner(e) < 0) cycle
        pair(:, n) = member(e)
        first(n) = bits(e)
        both(n) = bits(e)
        if (partner(e) > 0) then
          pair(2, n) = member(start(c) + partner(e) - 1)
          both(n) = ior(bits(e), bits(start(c) + partner(e) - 1))
        end if
        n = n + 1
      end do
    end do
    start = begin
    call move_alloc(both, bits)
  end subroutine pair_members

  !> Packs of one member each, in the order of the points' numbers: so the bonds of a lane have an
  !> order that does not depend on the other lanes. Packs are as from `pair_members`.
  subroutine single_members(number, start, member, bits, pair, first)
    integer(i8), intent(in) :: number(:)     !! (points) of each point, in the order of their slots
    integer(i8), intent(in) :: start(:)      !! (clusters + 1) first member of each cluster, and its
                                             !! first pack
    integer(i4), intent(in) :: member(:)     !! (members) their points, which are their slots
    integer(i1), intent(inout) :: bits(:)    !! (members) the lanes of each; (packs) on return
    integer(i4), allocatable, intent(out) :: pair(:, :)
      !! (2, packs) slots of the members of each pack, twice the same
    integer(i1), allocatable, intent(out) :: first(:)
      !! (packs) the lanes whose bond goes to the first of the two
    integer(i8) :: e
    integer :: c

    allocate (pair(2, size(member)))
    !$omp parallel do schedule(dynamic, 64) default(none) private(c, e) &
    !$omp shared(number, start, member, bits, pair)
    do c = 1, size(start) - 1
      associate (from => start(c), to => start(c + 1) - 1)
        associate (sorted => from - 1 + ascending_order(number(member(from:to))))
          pair(1, from:to) = member(sorted)
          bits(from:to) = bits(sorted)
        end associate
        do e = from, to
          pair(2, e) = pair(1, e)
        end do
      end associate
    end do
    first = bits
  end subroutine single_members

  !> Find for each member of a cluster another one with no lane in common: `partner` gets its place,
  !> 0 for members that stay single, and -1 for those that have become another's partner. Members
  !> with many lanes choose first, and take one that waits, again with as many lanes as fit. Those
  !> with the same lanes wait in one stack, so that at most 255 stacks are searched for a member.
  pure subroutine choose_partners(bits, partner)
    integer(i1), intent(in) :: bits(:)
    integer(i4), intent(out) :: partner(:)
    integer(i4), allocatable :: below(:)      ! of each member that waits: the next in its stack
    integer(i4) :: top(0:255)                 ! of the stack of each set of lanes, 0: empty
    integer :: sets(255)                      ! those that have or had a stack
    integer :: i, k, n, number, lanes_of

    partner = 0_i4
    allocate (below(size(bits)), source=0_i4)
    top = 0_i4
    n = 0
    do number = lanes - 1, 1, -1
      do i = 1, size(bits)
        if (popcnt(bits(i)) /= number) cycle
        lanes_of = iand(int(bits(i)), 255)
        do k = 1, n
          if (iand(sets(k), lanes_of) == 0 .and. top(sets(k)) > 0) exit
        end do
        if (k <= n) then
          partner(top(sets(k))) = int(i, i4)
          partner(i) = -1_i4
          top(sets(k)) = below(top(sets(k)))
        else
          if (.not. any(sets(:n) == lanes_of)) then
            n = n + 1
            sets(n) = lanes_of
          end if
          below(i) = top(lanes_of)
          top(lanes_of) = int(i, i4)
        end if
      end do
    end do
  end subroutine choose_partners

  !> Search the cells of all groups around cluster `c`: the number of its members, and as many of
  !> them as there is room for.
  pure subroutine visit(x, half_reach, own, label, labelled, most, rows, c, found, member, bits)
    real(wp), intent(in), contiguous :: x(:, :)
    real(wp), intent(in), contiguous :: half_reach(:)
    real(wp), intent(in), contiguous :: own(:)
    integer(i2), intent(in), contiguous :: label(:)
    logical, intent(in) :: labelled            !! some point has a label
    real(wp), intent(in) :: most               !! largest half reach and largest own one [m]
    type(rows_type), intent(in) :: rows(:)
    integer, intent(in) :: c
    integer, intent(out) :: found
    integer(i4), intent(inout) :: member(:)
    integer(i1), intent(inout) :: bits(:)
    real(wp) :: lower(3), upper(3), near
    integer :: first, last, d, g, iy, iz, low(3), high(3), row, from, to

    first = lanes*(c - 1) + 1
    last = min(first + lanes - 1, size(x, 1))
    near = maxval(half_reach(first:last)) + most
    lower = 0.0_wp
    upper = 0.0_wp
    do d = 1, size(x, 2)
      lower(d) = minval(x(first:last, d)) - near
      upper(d) = maxval(x(first:last, d)) + near
    end do
    found = 0
    do g = 1, size(rows)
      if (any(lower > rows(g)%lower + rows(g)%count*rows(g)%size .or. upper < rows(g)%lower)) cycle
      low = 0
      high = 0
      do d = 1, size(x, 2)
        low(d) = cell_along(rows(g), d, lower(d))
        high(d) = cell_along(rows(g), d, upper(d))
      end do
      do iz = low(3), high(3)
        do iy = low(2), high(2)
          row = iy + rows(g)%count(2)*iz
          from = 1 + rows(g)%count(1)*row + low(1)
          to = 1 + rows(g)%count(1)*row + high(1)
          if (is_backwards(row)) then
            from = rows(g)%count(1)*(row + 1) - high(1)
            to = rows(g)%count(1)*(row + 1) - low(1)
          end if
          call visit_row(x, half_reach, own, label, labelled, first, last, &
            & rows(g)%first(from), rows(g)%first(to + 1) - 1, found, member, bits)
        end do
      end do
    end do
  end subroutine visit

  !> Add those of the points `from` to `to` that are members of the cluster `first:last`.
  pure subroutine visit_row(x, half_reach, own, label, labelled, first, last, from, to, found, &
    & member, bits)
    real(wp), intent(in), contiguous :: x(:, :)
    real(wp), intent(in), contiguous :: half_reach(:)
    real(wp), intent(in), contiguous :: own(:)
    integer(i2), intent(in), contiguous :: label(:)
    logical, intent(in) :: labelled
    integer, intent(in) :: first, last, from, to
    integer, intent(inout) :: found
    integer(i4), intent(inout) :: member(:)
    integer(i1), intent(inout) :: bits(:)
    integer, parameter :: piece = 64
    real(wp) :: code(piece)
    integer :: i, j

    do j = from, to, piece
      call compare(x, half_reach, own, first, last, j, min(j + piece - 1, to), code)
      if (labelled) call leave_out(label, first, last, j, min(j + piece - 1, to), code)
      do i = 1, min(piece, to - j + 1)
        if (code(i) <= 0.0_wp) cycle
        found = found + 1
        if (found > size(member)) cycle
        member(found) = int(j + i - 1, i4)
        ! the sign is the last bit
        bits(found) = int(merge(code(i) - 256, code(i), code(i) > 127), i1)
      end do
    end do
  end subroutine visit_row

  !> The bits of the cluster's lanes `first:last` for each of the points `from:to`, as numbers.
  pure subroutine compare(x, half_reach, own, first, last, from, to, code)
    real(wp), intent(in), contiguous :: x(:, :)
    real(wp), intent(in), contiguous :: half_reach(:)
    real(wp), intent(in), contiguous :: own(:)
    integer, intent(in) :: first, last, from, to
    real(wp), intent(inout) :: code(:)
    real(wp) :: d2, bit
    integer :: k, j

    code(:to - from + 1) = 0.0_wp
    bit = 1.0_wp
    do k = first, last
      ! a constant number of dimensions, so that the loops over points are plain ones
      select case (size(x, 2))
      case (3)
        !$omp simd private(d2)
        do j = from, to
          d2 = (x(j, 1) - x(k, 1))**2 + (x(j, 2) - x(k, 2))**2 + (x(j, 3) - x(k, 3))**2
          code(j - from + 1) = code(j - from + 1) &
            & + merge(bit, 0.0_wp, d2 <= (max(own(k), own(j)) &
            & + (half_reach(k) + half_reach(j)))**2)
        end do
      case (2)
        !$omp simd private(d2)
        do j = from, to
          d2 = (x(j, 1) - x(k, 1))**2 + (x(j, 2) - x(k, 2))**2
          code(j - from + 1) = code(j - from + 1) &
            & + merge(bit, 0.0_wp, d2 <= (max(own(k), own(j)) &
            & + (half_reach(k) + half_reach(j)))**2)
        end do
      case default
        !$omp simd private(d2)
        do j = from, to
          d2 = (x(j, 1) - x(k, 1))**2
          code(j - from + 1) = code(j - from + 1) &
            & + merge(bit, 0.0_wp, d2 <= (max(own(k), own(j)) &
            & + (half_reach(k) + half_reach(j)))**2)
        end do
      end select
      ! a point is no member of its own family
      if (k >= from .and. k <= to) code(k - from + 1) = code(k - from + 1) - bit
      bit = 2*bit
    end do
  end subroutine compare

  !> Take from `code` the bits of the lanes `first:last` that have the label of the point.
  pure subroutine leave_out(label, first, last, from, to, code)
    integer(i2), intent(in), contiguous :: label(:)
    integer, intent(in) :: first, last, from, to
    real(wp), intent(inout) :: code(:)
    integer :: same, j, l

    do j = from, to
      if (label(j) == 0_i2) cycle
      same = 0
      do l = first, last
        if (label(l) == label(j)) same = ibset(same, l - first)
      end do
      code(j - from + 1) = real(iand(nint(code(j - from + 1)), not(same)), wp)
    end do
  end subroutine leave_out

  !> The cell of a coordinate along direction `d`, from 0; those outside are taken to the nearest.
  pure integer function cell_along(rows, d, x) result(cell)
    type(rows_type), intent(in) :: rows
    integer, intent(in) :: d
    real(wp), intent(in) :: x
    cell = int(max(0.0_wp, min(real(rows%count(d) - 1, wp), (x - rows%lower(d))/rows%size(d))))
  end function cell_along

end module pd_family_clusters
