!> Cubic B-splines on a grid of cells over the points of a body: which splines reach a point, their
!> values and gradients there, and how those of a grid are sums of those of one half as wide.
module pd_set_up_consistent_splines
  use pd_base_kinds, only: wp, i4
  implicit none (type, external)
  private
  public :: grid_type, place_points, find_children, order_splines, forget_points, splines_at, &
    & shares

  !> A grid. A point sees four splines along each axis. Cells without points are left out, and
  !> splines that reach none. Two cells of a grid fit in one of the next along each axis, so that a
  !> spline is a sum of five of the finer ones.
  type :: grid_type
    integer :: dim = 0
    integer(i4), allocatable :: child(:, :)
      !! (5**dim, splines) of the next finer grid, of which a spline is a sum, x fastest; 0: none
    integer(i4), allocatable :: above(:)         !! (finer splines + 1) first in `parent`
    integer(i4), allocatable :: parent(:, :)
      !! (2, any) a spline that the finer one is in, and which of its children that is
    ! of the finest grid only; others are sums of its splines:
    integer(i4), allocatable :: cell(:)          !! (points) the cell with it
    integer(i4), allocatable :: start(:)         !! (cells + 1) first in `order`
    integer(i4), allocatable :: order(:)         !! points cell by cell
    integer(i4), allocatable :: spline(:, :)     !! (4**dim, cells) that reach it, x fastest
    integer(i4), allocatable :: first(:)         !! (splines + 1) first in `under`
    integer(i4), allocatable :: under(:, :)
      !! (2, any) a cell that the spline reaches, and which of the cell's splines it is
    real(wp), allocatable :: value(:, :, :)      !! (4, dim, points) of the splines [-]
    real(wp), allocatable :: slope(:, :, :)      !! (4, dim, points) [1/m]
  end type grid_type

contains

  !> The points in the cells of a grid, and its splines.
  subroutine place_points(x, low, edge, cells, grid, spline_number)
    real(wp), intent(in) :: x(:, :)            !! (dim, points) positions [m]
    real(wp), intent(in) :: low(:)             !! (dim) corner of the grid [m]
    real(wp), intent(in) :: edge(:)            !! (dim) of its cells [m]
    integer, intent(in) :: cells(:)            !! (dim) along each axis
    type(grid_type), intent(inout) :: grid     !! without children; gets the rest
    integer(i4), allocatable, intent(out) :: spline_number(:)  !! of splines by place; 0: none
    integer :: place(size(low), size(x, 2))
    integer(i4), allocatable :: number(:), next(:), corner(:, :)
    real(wp) :: s
    integer :: k, d, c, m, n, at, dim, n_cells, n_splines

    dim = size(x, 1)
    grid%dim = dim
    n = 4**dim
    allocate (grid%value(4, dim, size(x, 2)), grid%slope(4, dim, size(x, 2)))
    do k = 1, size(x, 2)
      do d = 1, dim
        s = (x(d, k) - low(d))/edge(d)
        place(d, k) = max(0, min(cells(d) - 1, int(s)))
        s = s - place(d, k)
        grid%value(:, d, k) = [(1 - s)**3, 3*s**3 - 6*s**2 + 4, -3*s**3 + 3*s**2 + 3*s + 1, &
          & s**3]/6
        grid%slope(:, d, k) = [-(1 - s)**2, 3*s**2 - 4*s, -3*s**2 + 2*s + 1, s**2]/(2*edge(d))
      end do
    end do
    ! cells with points are numbered as they are met
    allocate (number(product(cells)), source=0_i4)
    allocate (grid%cell(size(x, 2)), corner(dim, size(x, 2)))
    n_cells = 0
    do k = 1, size(x, 2)
      c = 1 + dense(place(:, k), cells)
      if (number(c) == 0) then
        n_cells = n_cells + 1
        number(c) = int(n_cells, i4)
        corner(:, n_cells) = int(place(:, k), i4)
      end if
      grid%cell(k) = number(c)
    end do
    call sort_into(grid%cell, n_cells, grid%start, grid%order)
    ! and so are splines
    allocate (grid%spline(n, n_cells))
    allocate (spline_number(product(cells + 3)), source=0_i4)
    n_splines = 0
    do c = 1, n_cells
      do m = 1, n
        at = 1 + dense(int(corner(:, c)) + offset_of(m, dim), cells + 3)
        if (spline_number(at) == 0) then
          n_splines = n_splines + 1
          spline_number(at) = int(n_splines, i4)
        end if
        grid%spline(m, c) = spline_number(at)
      end do
    end do
    call sort_into(reshape(grid%spline, [n*n_cells]), n_splines, grid%first, next)
    allocate (grid%under(2, size(next)))
    grid%under(1, :) = (next - 1)/n + 1
    grid%under(2, :) = mod(next - 1, n) + 1
  end subroutine place_points

  !> The splines of the next finer grid of which those of a grid are sums: along an axis those from
  !> twice its place less three on.
  pure subroutine find_children(cells, fine, numbers, finer, grid)
    integer, intent(in) :: cells(:)            !! (dim) of the grid along each axis
    integer, intent(in) :: fine(:)             !! (dim) and of the finer one
    integer(i4), intent(in) :: numbers(:)      !! (places) of the grid's splines; 0: none
    integer(i4), intent(in) :: finer(:)        !! (places) of the finer one's
    type(grid_type), intent(inout) :: grid     !! gets its children
    integer(i4), allocatable :: next(:)
    integer(i4) :: none
    integer :: place(size(cells)), at(size(cells)), i, m, n, d

    allocate (grid%child(5**grid%dim, maxval(numbers)), source=0_i4)
    do i = 1, size(numbers)
      if (numbers(i) == 0) cycle
      place = place_of(i - 1, cells + 3)
      do m = 1, 5**grid%dim
        at = 2*place - 3 + [(mod((m - 1)/5**(d - 1), 5), d=1, size(at))]
        if (any(at < 0) .or. any(at >= fine + 3)) cycle
        grid%child(m, numbers(i)) = finer(1 + dense(at, fine + 3))
      end do
    end do
    ! those that are none are sorted behind all others
    none = maxval(finer) + 1
    call sort_into(reshape(merge(grid%child, none, grid%child > 0_i4), [size(grid%child)]), &
      & int(none), grid%above, next)
    n = grid%above(none) - 1
    grid%above = grid%above(:none)
    allocate (grid%parent(2, n))
    grid%parent(1, :) = (next(:n) - 1)/5**grid%dim + 1
    grid%parent(2, :) = mod(next(:n) - 1, 5**grid%dim) + 1
  end subroutine find_children

  !> An order of a grid's splines in which neighbours are near each other: from one end on, by
  !> their distance from it, as Cuthill and McKee number a matrix; and the lowest of the splines
  !> that are within some cells of each. Some that lie far from each other come last.
  subroutine order_splines(grid, cells, numbers, within, spread, place, lowest)
    type(grid_type), intent(in) :: grid      !! with its points
    integer, intent(in) :: cells(:)          !! (dim) of the grid along each axis
    integer(i4), intent(in) :: numbers(:)    !! (places) of the grid's splines; 0: none
    integer, intent(in) :: within            !! cells along each axis
    integer, intent(inout) :: spread         !! splines that come last, fewer where there are not
                                             !! so many
    integer, allocatable, intent(out) :: place(:)   !! (splines) of each in the order
    integer, allocatable, intent(out) :: lowest(:)  !! (splines in their order)
    integer, allocatable :: where_is(:), order(:)
    logical, allocatable :: last(:)
    integer :: n, s, start, pass

    n = maxval(numbers)
    allocate (where_is(n), place(n), lowest(n), order(n))
    do s = 1, size(numbers)
      if (numbers(s) > 0) where_is(numbers(s)) = s - 1
    end do
    ! the last one found from anywhere is an end
    start = 1
    do pass = 1, 2
      call walk(start)
      start = order(n)
    end do
    call find_last()
    order = [pack(order, .not. last(order)), pack(order, last(order))]
    place(order) = [(s, s=1, n)]
    do s = 1, n
      lowest(place(s)) = place(s)
      call look_around(s, within)
    end do
    lowest(n - spread + 1:) = 1

  contains

    !> The splines that come last: each as far as can be from those before, none at the rim.
    subroutine find_last()
      real :: distance(n)
      integer :: under(n), i

      allocate (last(n), source=.false.)
      under = grid%first(2:) - grid%first(:n)
      spread = min(spread, n)
      distance = merge(1.0e30, 0.0, 2*under >= maxval(under))
      do i = 1, spread
        s = maxloc(distance, dim=1, mask=.not. last)
        if (.not. distance(s) > 0.0) exit
        last(s) = .true.
        associate (at => place_of(where_is(s), cells + 3))
          do s = 1, n
            distance(s) = min(distance(s), norm2(real(place_of(where_is(s), cells + 3) - at)))
          end do
        end associate
      end do
      spread = count(last)
    end subroutine find_last

    !> Number all splines, pieces that hang together one after another.
    subroutine walk(start)
      integer, intent(in) :: start
      integer :: i, found, next

      place = 0
      found = 0
      next = start
      i = 0
      do while (found < n)
        found = found + 1
        order(found) = next
        place(next) = found
        do while (i < found)
          i = i + 1
          call take_neighbours(order(i), found)
        end do
        if (found < n) next = findloc(place, 0, dim=1)
      end do
    end subroutine walk

    !> Number the neighbours of a spline that have no number yet.
    subroutine take_neighbours(s, found)
      integer, intent(in) :: s
      integer, intent(inout) :: found
      integer :: m, o

      do m = 1, 3**size(cells)
        o = spline_beside(s, m, 1)
        if (o == 0) cycle
        if (place(o) > 0) cycle
        found = found + 1
        order(found) = o
        place(o) = found
      end do
    end subroutine take_neighbours

    subroutine look_around(s, within)
      integer, intent(in) :: s, within
      integer :: m, o

      do m = 1, (2*within + 1)**size(cells)
        o = spline_beside(s, m, within)
        if (o > 0) lowest(place(s)) = min(lowest(place(s)), place(o))
      end do
    end subroutine look_around

    !> Spline `m` of those that are within some cells of spline `s`; 0: none.
    integer function spline_beside(s, m, within) result(o)
      integer, intent(in) :: s, m, within
      integer :: at(size(cells)), d

      at = place_of(where_is(s), cells + 3)
      do d = 1, size(cells)
        at(d) = at(d) - within + mod((m - 1)/(2*within + 1)**(d - 1), 2*within + 1)
      end do
      o = 0
      if (any(at < 0) .or. any(at >= cells + 3)) return
      o = int(numbers(1 + dense(at, cells + 3)))
    end function spline_beside

  end subroutine order_splines

  !> Keep of a grid what it is to the next finer one.
  pure subroutine forget_points(grid)
    type(grid_type), intent(inout) :: grid  !! with children

    deallocate (grid%cell, grid%start, grid%order, grid%spline, grid%first, grid%under, &
      & grid%value, grid%slope)
  end subroutine forget_points

  !> All splines that reach point k, x fastest, and their gradients.
  pure subroutine splines_at(grid, k, value, gradient)
    type(grid_type), intent(in) :: grid       !! with its points
    integer, intent(in) :: k                  !! point
    real(wp), intent(inout) :: value(:)       !! (4**dim or more) set [-]
    real(wp), intent(inout) :: gradient(:, :) !! (64, 3) 4**dim of dim are set [1/m]
    integer :: n, i, d, b

    associate (of => grid%value(:, :, k), slope => grid%slope(:, :, k))
      value(:4) = of(:, 1)
      gradient(:4, 1) = slope(:, 1)
      n = 4
      do d = 2, grid%dim
        ! the first last, since the others are made of what it replaces
        do i = 4, 1, -1
          associate (first => (i - 1)*n + 1, last => i*n)
            gradient(first:last, d) = value(:n)*slope(i, d)
            do b = 1, d - 1
              gradient(first:last, b) = gradient(:n, b)*of(i, d)
            end do
            value(first:last) = value(:n)*of(i, d)
          end associate
        end do
        n = 4*n
      end do
    end associate
  end subroutine splines_at

  !> What a spline has of each of its children.
  pure function shares(dim) result(share)
    integer, intent(in) :: dim  !! number of dimensions
    real(wp) :: share(5**dim)   !! in the order of `child`
    real(wp), parameter :: along(5) = [1.0_wp, 4.0_wp, 6.0_wp, 4.0_wp, 1.0_wp]/8
    integer :: m, d

    do m = 1, size(share)
      share(m) = product([(along(1 + mod((m - 1)/5**(d - 1), 5)), d=1, dim)])
    end do
  end function shares

  !> The number from 0 of a place from 0, the first index fastest.
  pure integer function dense(place, extents) result(number)
    integer, intent(in) :: place(:), extents(:)
    integer :: d

    number = 0
    do d = size(place), 1, -1
      number = number*extents(d) + place(d)
    end do
  end function dense

  !> The place of a number from 0.
  pure function place_of(number, extents) result(place)
    integer, intent(in) :: number, extents(:)
    integer :: place(size(extents))
    integer :: rest, d

    rest = number
    do d = 1, size(extents)
      place(d) = mod(rest, extents(d))
      rest = rest/extents(d)
    end do
  end function place_of

  !> Where spline `m` of a cell stands among its four along each axis, from 0.
  pure function offset_of(m, dim) result(offset)
    integer, intent(in) :: m, dim
    integer :: offset(dim)
    integer :: d

    do d = 1, dim
      offset(d) = mod((m - 1)/4**(d - 1), 4)
    end do
  end function offset_of

  !> Entries box by box, those of one box in their order.
  pure subroutine sort_into(box, n_boxes, start, order)
    integer(i4), intent(in) :: box(:)                 ! of each entry
    integer, intent(in) :: n_boxes
    integer(i4), allocatable, intent(out) :: start(:) ! (boxes + 1) first of each in `order`
    integer(i4), allocatable, intent(out) :: order(:)
    integer(i4), allocatable :: next(:)
    integer :: i

    allocate (start(n_boxes + 1), source=0_i4)
    allocate (order(size(box)))
    do i = 1, size(box)
      start(box(i) + 1) = start(box(i) + 1) + 1_i4
    end do
    start(1) = 1_i4
    do i = 1, n_boxes
      start(i + 1) = start(i) + start(i + 1)
    end do
    next = start
    do i = 1, size(box)
      order(next(box(i))) = int(i, i4)
      next(box(i)) = next(box(i)) + 1_i4
    end do
  end subroutine sort_into

end module pd_set_up_consistent_splines
