!> Linked cells (7.11): the points within a distance of each point, in time linear in their number.
module pd_family_cells
  use pd_base_kinds, only: wp, i2, i4
  implicit none (type, external)
  private
  public :: cells_type, sort_into_cells, neighbours_of, points_across, brute_force_neighbours, &
    & cell_of, cells_around, rows_around

  !> Points sorted by cells; cells are no smaller than the reach they were made for.
  type :: cells_type
    integer :: count(3) = 1                   !! cells along each direction
    real(wp) :: lower(3) = 0.0_wp             !! corner of the first cell [m]
    real(wp) :: size(3) = 1.0_wp              !! edges of a cell [m]
    integer(i4), allocatable :: first(:)      !! place of each cell's first point in `order`
    integer(i4), allocatable :: order(:)      !! points, cell by cell
    integer(i4), allocatable :: cell(:)       !! each point's cell
  end type cells_type

contains

  !> Sort the points `x` (n, dim) into cells at least `reach` [m] wide. Far-flung points get wider
  !> cells, so that there are never many more cells than points.
  subroutine sort_into_cells(x, reach, cells)
    real(wp), intent(in) :: x(:, :)         !! (n, dim) positions [m]
    real(wp), intent(in) :: reach           !! least width of a cell [m]
    type(cells_type), intent(out) :: cells  !! the n points, each in its cell
    real(wp) :: extent
    integer(i4), allocatable :: place(:)
    integer :: c, k, n, n_cells, at, most

    n = size(x, 1)
    ! far-flung points must not ask for more cells than points are worth: wider cells are still
    ! right
    most = max(1, int(real(4*n + 64, wp)**(1.0_wp/size(x, 2))))
    do c = 1, size(x, 2)
      cells%lower(c) = minval(x(:, c))
      extent = maxval(x(:, c)) - cells%lower(c)
      cells%count(c) = int(min(extent/reach, 1.0e9_wp))
      cells%count(c) = max(1, cells%count(c))
    end do
    if (product(real(cells%count, wp)) > 4.0_wp*n + 64) cells%count = min(cells%count, most)
    do c = 1, size(x, 2)
      extent = maxval(x(:, c)) - cells%lower(c)
      cells%size(c) = max(extent/cells%count(c)*(1 + 1.0e-12_wp), tiny(1.0_wp))
    end do
    n_cells = product(cells%count)
    allocate (cells%cell(n), cells%order(n))
    allocate (cells%first(n_cells + 1), source=0_i4)
    do k = 1, n
      at = cell_at(cells, x(k, :))
      cells%cell(k) = int(at, i4)
      cells%first(at + 1) = cells%first(at + 1) + 1_i4
    end do
    cells%first(1) = 1_i4
    do k = 2, n_cells + 1
      cells%first(k) = cells%first(k) + cells%first(k - 1)
    end do
    place = cells%first(:n_cells)
    do k = 1, n
      at = cells%cell(k)
      cells%order(place(at)) = int(k, i4)
      place(at) = place(at) + 1_i4
    end do
  end subroutine sort_into_cells

  pure integer function cell_at(cells, x) result(at)
    type(cells_type), intent(in) :: cells
    real(wp), intent(in) :: x(:)
    integer :: c, i(3)

    i = 0
    do c = 1, size(x)
      i(c) = min(cells%count(c) - 1, int((x(c) - cells%lower(c))/cells%size(c)))
    end do
    at = 1 + i(1) + cells%count(1)*(i(2) + cells%count(2)*i(3))
  end function cell_at

  !> Where a position lies among the cells, from 0 along each direction; positions outside are taken
  !> to the nearest cell.
  pure function cell_of(cells, x) result(at)
    type(cells_type), intent(in) :: cells  !! as `sort_into_cells` made them
    real(wp), intent(in) :: x(:)           !! (dim) position [m]
    integer :: at(3)
    integer :: c

    at = 0
    do c = 1, size(x)
      at(c) = int(max(0.0_wp, min(real(cells%count(c) - 1, wp), &
        & (x(c) - cells%lower(c))/cells%size(c))))
    end do
  end function cell_of

  !> The points in the cell of a position and in those around it.
  pure subroutine cells_around(cells, x, points)
    type(cells_type), intent(in) :: cells               !! as `sort_into_cells` made them
    real(wp), intent(in) :: x(:)                        !! (dim) position [m]
    integer(i4), allocatable, intent(out) :: points(:)
      !! (any number) all points within a cell's width of `x`, and some that are farther
    integer :: at(3), low(3), high(3), j, k, row

    at = cell_of(cells, x)
    low = max(0, at - 1)
    high = min(cells%count - 1, at + 1)
    allocate (points(0))
    do k = low(3), high(3)
      do j = low(2), high(2)
        row = 1 + cells%count(1)*(j + cells%count(2)*k)
        points = [points, cells%order(cells%first(row + low(1)):cells%first(row + high(1) + 1) - 1)]
      end do
    end do
  end subroutine cells_around

  !> The neighbours of one point in `found(:number)`, which grows as needed. Two points are
  !> neighbours if they are no farther apart than the sum of their `half_reach`.
  pure subroutine neighbours_of(x, half_reach, cells, k, number, found)
    real(wp), intent(in) :: x(:, :)                      !! (n, dim) positions [m]
    real(wp), intent(in) :: half_reach(:)                !! (n) half of the reach of each point [m]
    type(cells_type), intent(in) :: cells  !! of these points, at least as wide as the largest reach
    integer, intent(in) :: k  !! the point whose neighbours are found, itself not among them
    integer(i4), intent(out) :: number                   !! of neighbours
    integer(i4), allocatable, intent(inout) :: found(:)
      !! (>= number) the neighbours, cell by cell; allocated and enlarged as needed

    if (.not. allocated(found)) allocate (found(256))
    call visit(x, half_reach, cells, k, number, found)
    if (number <= size(found)) return
    deallocate (found)
    allocate (found(2*number))
    call visit(x, half_reach, cells, k, number, found)
  end subroutine neighbours_of

  !> Which points have a neighbour with another label.
  subroutine points_across(x, half_reach, cells, label, across)
    real(wp), intent(in) :: x(:, :)        !! (n, dim) positions [m]
    real(wp), intent(in) :: half_reach(:)  !! (n) half of the reach of each point [m]
    type(cells_type), intent(in) :: cells  !! of these points, at least as wide as the largest reach
    integer(i2), intent(in) :: label(:)    !! (n) of each point, such as the number of its grid
    logical, intent(out) :: across(:)      !! (n) whether a point has one
    integer(i2), allocatable :: lowest(:), highest(:)
    integer :: c, k

    ! of each cell; of one without points the lowest is above the highest
    allocate (lowest(size(cells%first) - 1), highest(size(cells%first) - 1))
    do c = 1, size(lowest)
      associate (points => cells%order(cells%first(c):cells%first(c + 1) - 1))
        lowest(c) = minval(label(points))
        highest(c) = maxval(label(points))
      end associate
    end do
    !$omp parallel do schedule(dynamic, 512) default(none) private(k) &
    !$omp shared(x, half_reach, cells, label, across, lowest, highest)
    do k = 1, size(x, 1)
      across(k) = has_other(x, half_reach, cells, label, lowest, highest, k)
    end do
  end subroutine points_across

  !> Whether point `k` has a neighbour with another label. Cells whose points have that of `k` are
  !> passed over.
  pure logical function has_other(x, half_reach, cells, label, lowest, highest, k)
    real(wp), intent(in) :: x(:, :)
    real(wp), intent(in) :: half_reach(:)
    type(cells_type), intent(in) :: cells
    integer(i2), intent(in) :: label(:), lowest(:), highest(:)
    integer, intent(in) :: k
    integer :: i(3), low(3), high(3), cx, cy, cz, at, m, j

    has_other = .true.
    i = cell_numbers(cells, int(cells%cell(k)))
    low = max(i - 1, 0)
    high = min(i + 1, cells%count - 1)
    do cz = low(3), high(3)
      do cy = low(2), high(2)
        do cx = low(1), high(1)
          at = 1 + cx + cells%count(1)*(cy + cells%count(2)*cz)
          if (lowest(at) == label(k) .and. highest(at) == label(k)) cycle
          do m = cells%first(at), cells%first(at + 1) - 1
            j = cells%order(m)
            if (label(j) == label(k)) cycle
            if (sum((x(j, :) - x(k, :))**2) <= (half_reach(k) + half_reach(j))**2) return
          end do
        end do
      end do
    end do
    has_other = .false.
  end function has_other

  !> The numbers of a cell along x, y and z, from 0.
  pure function cell_numbers(cells, cell) result(i)
    type(cells_type), intent(in) :: cells
    integer, intent(in) :: cell
    integer :: i(3)
    i = [mod(cell - 1, cells%count(1)), mod((cell - 1)/cells%count(1), cells%count(2)), &
      & (cell - 1)/(cells%count(1)*cells%count(2))]
  end function cell_numbers

  !> The cells around a cell and itself, as ranges of places in `order`: those along x stand one
  !> after another.
  pure subroutine rows_around(cells, cell, rows, number)
    type(cells_type), intent(in) :: cells      !! as `sort_into_cells` made them
    integer, intent(in) :: cell                !! from 1, as in `cell` of these
    integer, intent(out) :: rows(2, 9)         !! first and last place of each row
    integer, intent(out) :: number             !! of rows
    integer :: i(3), low(3), high(3), cy, cz, at

    i = cell_numbers(cells, cell)
    low = max(i - 1, 0)
    high = min(i + 1, cells%count - 1)
    number = 0
    do cz = low(3), high(3)
      do cy = low(2), high(2)
        at = 1 + cells%count(1)*(cy + cells%count(2)*cz)
        number = number + 1
        rows(:, number) = [integer :: cells%first(at + low(1)), cells%first(at + high(1) + 1) - 1]
      end do
    end do
  end subroutine rows_around

  !> Search the cells around point `k`: the number of its neighbours, and as many of them as
  !> `found` has room for.
  pure subroutine visit(x, half_reach, cells, k, number, found)
    real(wp), intent(in) :: x(:, :)
    real(wp), intent(in) :: half_reach(:)
    type(cells_type), intent(in) :: cells
    integer, intent(in) :: k
    integer(i4), intent(out) :: number
    integer(i4), intent(inout) :: found(:)
    real(wp) :: here(3), d2
    integer :: i(3), low(3), high(3), cx, cy, cz, at, c, m, j

    i = cell_numbers(cells, int(cells%cell(k)))
    low = max(i - 1, 0)
    high = min(i + 1, cells%count - 1)
    here = 0.0_wp
    here(:size(x, 2)) = x(k, :)
    number = 0_i4
    do cz = low(3), high(3)
      do cy = low(2), high(2)
        ! the cells along x stand one after another
        cx = 1 + cells%count(1)*(cy + cells%count(2)*cz)
        at = cx + high(1)
        do m = cells%first(cx + low(1)), cells%first(at + 1) - 1
          j = cells%order(m)
          if (j == k) cycle
          d2 = 0.0_wp
          do c = 1, size(x, 2)
            d2 = d2 + (x(j, c) - here(c))**2
          end do
          if (d2 > (half_reach(k) + half_reach(j))**2) cycle
          number = number + 1_i4
          if (number <= size(found)) found(number) = int(j, i4)
        end do
      end do
    end do
  end subroutine visit

  !> The same by comparing every pair: the check of the search above.
  pure subroutine brute_force_neighbours(x, half_reach, k, neighbour)
    real(wp), intent(in) :: x(:, :)                        !! (n, dim) positions [m]
    real(wp), intent(in) :: half_reach(:)  !! (n) half of the reach of each point [m]
    integer, intent(in) :: k                               !! the point whose neighbours are found
    integer(i4), allocatable, intent(out) :: neighbour(:)  !! (any number) its neighbours, ascending
    integer :: j

    allocate (neighbour(0))
    do j = 1, size(x, 1)
      if (j == k) cycle
      if (sum((x(j, :) - x(k, :))**2) > (half_reach(k) + half_reach(j))**2) cycle
      neighbour = [neighbour, int(j, i4)]
    end do
  end subroutine brute_force_neighbours

end module pd_family_cells
