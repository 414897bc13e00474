!> Values between places and between instants (doc/theory.md, 14).
!>
!> In space a polynomial of second degree is fitted to the places around by weighted least squares;
!> where one place lies at the position itself, its value is taken. In time a cubic goes through the
!> four rows around.
module pd_output_fields_interpolate
  use pd_base_kinds, only: wp, i4
  use pd_family_cells, only: cells_around, cells_type, sort_into_cells
  implicit none (type, external)
  private
  public :: stencil_type, grid_of_places, find_stencil, stencil_among, rows_around

  real(wp), parameter :: width = 2.6_wp     !! of the neighbourhood [spacings]
  real(wp), parameter :: same = 1.0e-6_wp   !! places so near are one [spacings]
  real(wp), parameter :: singular = 1.0e-9_wp

  !> A value at a position is the sum of `weight` times the values at `place`.
  type :: stencil_type
    integer, allocatable :: place(:)
    real(wp), allocatable :: weight(:)
  end type stencil_type

contains

  !> Sort places (dim, place) with a spacing [m] so that those around a position are found.
  subroutine grid_of_places(x, spacing, cells)
    real(wp), intent(in) :: x(:, :)         !! places (dim, place) [m]
    real(wp), intent(in) :: spacing         !! of the places [m]
    type(cells_type), intent(out) :: cells  !! for `find_stencil`
    call sort_into_cells(transpose(x), width*spacing, cells)
  end subroutine grid_of_places

  !> The stencil for a position. Where there are too few places for a polynomial of second degree
  !> it is of first, and at last the nearest place alone; without any place it is empty.
  subroutine find_stencil(cells, x, spacing, position, stencil)
    type(cells_type), intent(in) :: cells        !! of `grid_of_places` for these places
    real(wp), intent(in) :: x(:, :)              !! places (dim, place) [m]
    real(wp), intent(in) :: spacing              !! of the places [m]
    real(wp), intent(in) :: position(:)          !! [m]
    type(stencil_type), intent(out) :: stencil   !! places and weights, whose sum is 1; empty
                                                 !! without any place near
    integer(i4), allocatable :: around(:)

    call cells_around(cells, position, around)
    call stencil_among(x(:, around), spacing, position, stencil)
    stencil%place = int(around(stencil%place))
  end subroutine find_stencil

  !> The stencil of a position among a few places: those within 2.6 spacings are taken.
  pure subroutine stencil_among(x, spacing, position, stencil)
    real(wp), intent(in) :: x(:, :)              !! places (dim, place) [m]
    real(wp), intent(in) :: spacing              !! of the places [m]
    real(wp), intent(in) :: position(:)          !! [m]
    type(stencil_type), intent(out) :: stencil   !! as of `find_stencil`
    real(wp), allocatable :: distance(:)
    integer, allocatable :: around(:)
    integer :: i, nearest, degree
    logical :: found

    distance = [(norm2(x(:, i) - position)/spacing, i=1, size(x, 2))]
    around = pack([(i, i=1, size(x, 2))], distance <= width)
    distance = pack(distance, distance <= width)
    if (size(around) == 0) then
      allocate (stencil%place(0), stencil%weight(0))
      return
    end if
    nearest = minloc(distance, dim=1)
    stencil%place = [around(nearest)]
    stencil%weight = [1.0_wp]
    if (distance(nearest) <= same) return
    do degree = 2, 1, -1
      call fit(degree, (x(:, around) - spread(position, 2, size(around)))/spacing, distance, &
        & stencil%weight, found)
      if (.not. found) cycle
      stencil%place = around
      return
    end do
    stencil%weight = [1.0_wp]
  end subroutine stencil_among

  !> Weights that give the value at 0 of the polynomial fitted to values at `x` (dim, n), in
  !> spacings. `found` is false if the places do not determine it.
  pure subroutine fit(degree, x, distance, weight, found)
    integer, intent(in) :: degree
    real(wp), intent(in) :: x(:, :)
    real(wp), intent(in) :: distance(:)
    real(wp), allocatable, intent(inout) :: weight(:)
    logical, intent(out) :: found
    real(wp), allocatable :: basis(:, :), matrix(:, :), solution(:), bell(:)
    integer :: d, n, m, i, j

    d = size(x, 1)
    n = size(x, 2)
    m = 1 + d
    if (degree == 2) m = m + d*(d + 1)/2
    found = n >= m
    if (.not. found) return
    allocate (basis(n, m))
    basis(:, 1) = 1.0_wp
    do i = 1, d
      basis(:, 1 + i) = x(i, :)
    end do
    m = 1 + d
    if (degree == 2) then
      do i = 1, d
        do j = i, d
          m = m + 1
          basis(:, m) = x(i, :)*x(j, :)
        end do
      end do
    end if
    ! falls to 0 at the edge, so that values do not jump where places come and go
    bell = max(0.0_wp, 1 - (distance/width)**2)**2
    matrix = matmul(transpose(basis), spread(bell, 2, m)*basis)
    allocate (solution(m), source=0.0_wp)
    solution(1) = 1.0_wp
    call solve(matrix, solution, found)
    if (found) weight = bell*matmul(basis, solution)
  end subroutine fit

  !> Solve a small symmetric system by elimination with pivots from the diagonal.
  pure subroutine solve(matrix, right, found)
    real(wp), intent(inout) :: matrix(:, :), right(:)
    logical, intent(out) :: found
    real(wp) :: largest, factor, row(size(right)), value
    integer :: i, j, n, at

    n = size(right)
    largest = maxval(abs(matrix))
    found = .false.
    do i = 1, n
      at = i - 1 + maxloc(abs(matrix(i:, i)), dim=1)
      if (abs(matrix(at, i)) <= singular*largest) return
      row = matrix(i, :)
      matrix(i, :) = matrix(at, :)
      matrix(at, :) = row
      value = right(i)
      right(i) = right(at)
      right(at) = value
      do j = i + 1, n
        factor = matrix(j, i)/matrix(i, i)
        matrix(j, i:) = matrix(j, i:) - factor*matrix(i, i:)
        right(j) = right(j) - factor*right(i)
      end do
    end do
    do i = n, 1, -1
      right(i) = (right(i) - dot_product(matrix(i, i + 1:), right(i + 1:)))/matrix(i, i)
    end do
    found = .true.
  end subroutine solve

  !> The rows around a time and their weights: Lagrange's cubic through up to four, none outside of
  !> the rows' range. `times` ascend.
  pure subroutine rows_around(times, t, stencil)
    real(wp), intent(in) :: times(:)            !! (rows), ascending [s]
    real(wp), intent(in) :: t                   !! time [s]
    type(stencil_type), intent(out) :: stencil  !! rows and weights, whose sum is 1; empty outside
                                                !! of the rows
    real(wp) :: tolerance
    integer :: low, high, middle, first, n, i, j

    n = size(times)
    allocate (stencil%place(0), stencil%weight(0))
    if (n == 0) return
    tolerance = same*maxval(abs(times))/max(1, n)
    if (t < times(1) - tolerance .or. t > times(n) + tolerance) return
    low = 1
    high = n
    do while (high - low > 1)
      middle = (low + high)/2
      if (times(middle) <= t) then
        low = middle
      else
        high = middle
      end if
    end do
    first = max(1, min(low - 1, n - 3))
    stencil%place = [(i, i=first, min(n, first + 3))]
    stencil%weight = [(1.0_wp, i=1, size(stencil%place))]
    do i = 1, size(stencil%place)
      do j = 1, size(stencil%place)
        if (i == j) cycle
        associate (ti => times(stencil%place(i)), tj => times(stencil%place(j)))
          stencil%weight(i) = stencil%weight(i)*(t - tj)/(ti - tj)
        end associate
      end do
    end do
  end subroutine rows_around

end module pd_output_fields_interpolate
