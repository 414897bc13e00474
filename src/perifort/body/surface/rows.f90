!> Where lines along x cross the facets of a surface, and what is inside between the crossings.
!>
!> A line's side of an edge is found from the edge's ends in one order, whichever facet asks, and a
!> line through an edge counts as one that is moved a little, first along y, then along z. So it
!> crosses a closed surface as often inwards as outwards, through edges and corners, too.
module pd_body_surface_rows
  use pd_base_kinds, only: wp, i4, i8
  use pd_body_surface_side, only: side_of_edge
  use pd_body_surface_surface, only: surface_type
  implicit none (type, external)
  private
  public :: rows_type, new_rows, row_windings, bin_of

  integer, parameter :: most_bins = 2048           !! along y and along z
  integer(i8), parameter :: entries_per_facet = 16_i8, more_entries = 1000000_i8

  !> Bins over y and z with the facets that reach into each.
  type :: rows_type
    integer :: n(2) = 1                    !! bins along y and z
    real(wp) :: low(2) = 0.0_wp            !! [m]
    real(wp) :: width(2) = 1.0_wp          !! [m]
    integer(i4), allocatable :: first(:)   !! (bins + 1) place in `facet`
    integer(i4), allocatable :: facet(:)
  end type rows_type

contains

  !> Sort the facets of a surface into bins.
  subroutine new_rows(surface, rows)
    type(surface_type), intent(in) :: surface  !! finished
    type(rows_type), intent(out) :: rows       !! ready for `row_windings`
    integer(i4), allocatable :: next(:)
    integer(i8) :: entries
    real(wp) :: length(2)
    integer :: f, b

    rows%low = surface%low(2:)
    length = max(surface%high(2:) - surface%low(2:), tiny(1.0_wp)**0.25_wp)
    b = min(most_bins, max(1, nint(sqrt(real(surface%n_facets, wp)))))
    ! long facets reach into many bins: fewer of these then
    do
      rows%n = b
      rows%width = length*(1 + 1.0e-12_wp)/b
      entries = 0_i8
      do f = 1, surface%n_facets
        entries = entries + entries_of(surface, rows, f)
        if (entries > entries_per_facet*surface%n_facets + more_entries .and. b > 1) exit
      end do
      if (f > surface%n_facets) exit
      b = b/2
    end do
    allocate (next(b*b + 1), source=0_i4)
    do f = 1, surface%n_facets
      call enter(surface, rows, f, next)
    end do
    allocate (rows%first(b*b + 1), rows%facet(entries))
    rows%first(1) = 1_i4
    do b = 1, size(next) - 1
      rows%first(b + 1) = rows%first(b) + next(b)
    end do
    next = rows%first
    do f = 1, surface%n_facets
      call enter(surface, rows, f, next, rows%facet)
    end do
  end subroutine new_rows

  !> In how many bins a facet is.
  pure integer(i8) function entries_of(surface, rows, facet) result(entries)
    type(surface_type), intent(in) :: surface
    type(rows_type), intent(in) :: rows
    integer, intent(in) :: facet
    integer :: k, first, last, bottom, top

    entries = 0_i8
    call reach_along_z(surface, rows, facet, bottom, top)
    do k = bottom, top
      call reach_along_y(surface, rows, facet, k, first, last)
      entries = entries + max(0, last - first + 1)
    end do
  end function entries_of

  !> Count a facet in its bins, or put it into them.
  pure subroutine enter(surface, rows, facet, next, list)
    type(surface_type), intent(in) :: surface
    type(rows_type), intent(in) :: rows
    integer, intent(in) :: facet
    integer(i4), intent(inout) :: next(:)            !! count of each bin, or its next place
    integer(i4), intent(inout), optional :: list(:)
    integer :: j, k, first, last, bottom, top, bin

    call reach_along_z(surface, rows, facet, bottom, top)
    do k = bottom, top
      call reach_along_y(surface, rows, facet, k, first, last)
      do j = first, last
        bin = j + rows%n(1)*(k - 1)
        if (present(list)) list(next(bin)) = int(facet, i4)
        next(bin) = next(bin) + 1_i4
      end do
    end do
  end subroutine enter

  !> The bins along z that a facet reaches into.
  pure subroutine reach_along_z(surface, rows, facet, bottom, top)
    type(surface_type), intent(in) :: surface
    type(rows_type), intent(in) :: rows
    integer, intent(in) :: facet
    integer, intent(out) :: bottom, top
    real(wp) :: z(3)

    z = surface%x(3, surface%corner(:, facet))
    bottom = bin_of(rows, 2, minval(z) - 1.0e-6_wp*rows%width(2))
    top = bin_of(rows, 2, maxval(z) + 1.0e-6_wp*rows%width(2))
  end subroutine reach_along_z

  !> The bins along y that a facet reaches into within the k-th ones along z.
  pure subroutine reach_along_y(surface, rows, facet, k, first, last)
    type(surface_type), intent(in) :: surface
    type(rows_type), intent(in) :: rows
    integer, intent(in) :: facet, k
    integer, intent(out) :: first, last
    real(wp) :: y(3), z(3), bounds(2), low, high, at
    integer :: i, j, side

    y = surface%x(2, surface%corner(:, facet))
    z = surface%x(3, surface%corner(:, facet))
    bounds = rows%low(2) + rows%width(2)*[k - 1 - 2.0e-6_wp, k + 2.0e-6_wp]
    low = huge(low)
    high = -huge(high)
    do i = 1, 3
      j = mod(i, 3) + 1
      if (z(i) >= bounds(1) .and. z(i) <= bounds(2)) then
        low = min(low, y(i))
        high = max(high, y(i))
      end if
      do side = 1, 2
        if ((z(i) - bounds(side))*(z(j) - bounds(side)) >= 0.0_wp) cycle
        at = y(i) + (y(j) - y(i))*((bounds(side) - z(i))/(z(j) - z(i)))
        low = min(low, at)
        high = max(high, at)
      end do
    end do
    first = 1
    last = 0
    if (low > high) return
    first = bin_of(rows, 1, low - 1.0e-6_wp*rows%width(1))
    last = bin_of(rows, 1, high + 1.0e-6_wp*rows%width(1))
  end subroutine reach_along_y

  !> The bin of a place along y (1) or z (2), the first or the last one for places beyond.
  pure integer function bin_of(rows, axis, place) result(bin)
    type(rows_type), intent(in) :: rows  !! of a surface
    integer, intent(in) :: axis          !! 1: along y, 2: along z
    real(wp), intent(in) :: place        !! along it [m]
    bin = 1 + int(min(real(rows%n(axis) - 1, wp), max(0.0_wp, (place - rows%low(axis)) &
      & /rows%width(axis))))
  end function bin_of

  !> The winding numbers of a surface at places of one line along x, by the crossings before each.
  subroutine row_windings(surface, rows, y, z, x, windings, balanced)
    type(surface_type), intent(in) :: surface  !! finished
    type(rows_type), intent(in) :: rows        !! of the surface
    real(wp), intent(in) :: y, z               !! of the line [m]
    real(wp), intent(in) :: x(:)               !! (places) in ascending order [m]
    integer, intent(out) :: windings(:)        !! (places)
    logical, intent(out) :: balanced
      !! the line leaves the surface as often as it enters it, as it does if that is closed
    integer, parameter :: some = 64
    real(wp) :: near(some)
    integer :: step(some), n
    real(wp), allocatable :: all_near(:)
    integer, allocatable :: all_steps(:)

    windings = 0
    balanced = .true.
    if (y < surface%low(2) .or. y > surface%high(2) .or. z < surface%low(3) .or. &
      & z > surface%high(3)) return
    call find_crossings(surface, rows, y, z, near, step, n)
    if (n <= some) then
      call sum_up(near(:n), step(:n), x, windings, balanced)
    else
      allocate (all_near(n), all_steps(n))
      call find_crossings(surface, rows, y, z, all_near, all_steps, n)
      call sum_up(all_near, all_steps, x, windings, balanced)
    end if
  end subroutine row_windings

  !> The crossings of a line, as many as there is room for, in ascending order.
  subroutine find_crossings(surface, rows, y, z, near, step, n)
    type(surface_type), intent(in) :: surface
    type(rows_type), intent(in) :: rows
    real(wp), intent(in) :: y, z
    real(wp), intent(inout) :: near(:)     !! where they are [m]
    integer, intent(inout) :: step(:)      !! 1 inwards, -1 outwards
    integer, intent(out) :: n              !! all of them
    real(wp) :: a, b, c, at
    integer :: bin, i, k, side(3), corner(3)

    n = 0
    bin = bin_of(rows, 1, y) + rows%n(1)*(bin_of(rows, 2, z) - 1)
    do i = rows%first(bin), rows%first(bin + 1) - 1
      corner = surface%corner(:, rows%facet(i))
      call side_of_edge(surface%x, corner(1), corner(2), y, z, c, side(3))
      call side_of_edge(surface%x, corner(2), corner(3), y, z, a, side(1))
      if (side(1) /= side(3)) cycle
      call side_of_edge(surface%x, corner(3), corner(1), y, z, b, side(2))
      if (side(2) /= side(3)) cycle
      n = n + 1
      if (n > size(near)) cycle
      at = surface%x(1, corner(1))
      if (abs(a + b + c) > 0.0_wp) at = at + (b*(surface%x(1, corner(2)) - at) &
        & + c*(surface%x(1, corner(3)) - at))/(a + b + c)
      k = n
      do while (k > 1)
        if (near(k - 1) <= at) exit
        near(k) = near(k - 1)
        step(k) = step(k - 1)
        k = k - 1
      end do
      near(k) = at
      ! turning to the left in y and z the facet faces along x: the line leaves there
      step(k) = -side(1)
    end do
  end subroutine find_crossings

  !> Sum the steps before each place.
  pure subroutine sum_up(near, step, x, windings, balanced)
    real(wp), intent(in) :: near(:)
    integer, intent(in) :: step(:)
    real(wp), intent(in) :: x(:)
    integer, intent(inout) :: windings(:)
    logical, intent(out) :: balanced
    integer :: i, k, winding

    winding = 0
    k = 1
    do i = 1, size(x)
      do while (k <= size(near))
        if (near(k) > x(i)) exit
        winding = winding + step(k)
        k = k + 1
      end do
      windings(i) = winding
    end do
    balanced = sum(step) == 0
  end subroutine sum_up

end module pd_body_surface_rows
