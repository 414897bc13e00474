!> Points near facets: found in bins of a given width.
module pd_body_surface_near
  use pd_base_kinds, only: wp, i4
  use pd_body_mesh_near, only: distance
  use pd_body_surface_surface, only: corners_of, surface_type
  implicit none (type, external)
  private
  public :: bins_type, new_bins, points_within, points_near_facets

  integer, parameter :: most_bins = 1000  !! along each axis

  !> Points in cubes; those of a cube form a chain.
  type :: bins_type
    real(wp) :: low(3) = 0.0_wp               !! [m]
    real(wp) :: width = 1.0_wp                !! [m]
    integer :: n(3) = 1
    integer(i4), allocatable :: head(:, :, :) !! first point of each cube, 0 if there is none
    integer(i4), allocatable :: next(:)       !! (points) 0 at the end
  end type bins_type

contains

  !> Sort points into cubes of at least a given width.
  subroutine new_bins(x, width, bins)
    real(wp), intent(in) :: x(:, :)          !! (points, 3), one or more [m]
    real(wp), intent(in) :: width            !! larger than 0 [m]
    type(bins_type), intent(out) :: bins     !! ready for `points_within`
    integer :: p, at(3)

    bins%low = minval(x, dim=1)
    bins%width = max(width, maxval(maxval(x, dim=1) - bins%low)/most_bins)
    bins%n = 1 + floor((maxval(x, dim=1) - bins%low)/bins%width)
    allocate (bins%head(bins%n(1), bins%n(2), bins%n(3)), bins%next(size(x, 1)), source=0_i4)
    do p = size(x, 1), 1, -1
      at = bin_at(bins, x(p, :))
      bins%next(p) = bins%head(at(1), at(2), at(3))
      bins%head(at(1), at(2), at(3)) = int(p, i4)
    end do
  end subroutine new_bins

  !> The cube of a place, the nearest one for places outside.
  pure function bin_at(bins, place) result(at)
    type(bins_type), intent(in) :: bins
    real(wp), intent(in) :: place(3)
    integer :: at(3)
    at = 1 + floor(max(0.0_wp, min(real(bins%n - 1, wp), (place - bins%low)/bins%width)))
  end function bin_at

  !> The points within a distance of a place, cube by cube; no more than there is room for.
  pure subroutine points_within(bins, x, place, reach, points, n)
    type(bins_type), intent(in) :: bins      !! of the points
    real(wp), intent(in) :: x(:, :)          !! (points, 3) [m]
    real(wp), intent(in) :: place(3)         !! [m]
    real(wp), intent(in) :: reach            !! the distance [m]
    integer(i4), intent(inout) :: points(:)  !! the first `n` are set
    integer, intent(out) :: n                !! found
    integer :: low(3), high(3), i, j, k
    integer(i4) :: p

    n = 0
    low = bin_at(bins, place - reach)
    high = bin_at(bins, place + reach)
    do k = low(3), high(3)
      do j = low(2), high(2)
        do i = low(1), high(1)
          p = bins%head(i, j, k)
          do while (p > 0_i4)
            if (sum((x(p, :) - place)**2) <= reach**2 .and. n < size(points)) then
              n = n + 1
              points(n) = p
            end if
            p = bins%next(p)
          end do
        end do
      end do
    end do
  end subroutine points_within

  !> Whether each point is within a distance of some chosen facets.
  subroutine points_near_facets(surface, chosen, x, reach, near, own)
    type(surface_type), intent(in) :: surface     !! finished
    logical, intent(in) :: chosen(:)              !! (facets)
    real(wp), intent(in) :: x(:, :)               !! (points, 3), one or more [m]
    real(wp), intent(in) :: reach                 !! the distance, larger than 0 [m]
    logical, allocatable, intent(out) :: near(:)  !! (points)
    real(wp), intent(in), optional :: own(:)
      !! (points) the distance for each point, at most `reach`; absent: `reach` for all [m]
    type(bins_type) :: bins
    real(wp) :: corners(3, 3), within
    integer :: f, i, j, k, low(3), high(3)
    integer(i4) :: p

    allocate (near(size(x, 1)), source=.false.)
    call new_bins(x, reach, bins)
    do f = 1, surface%n_facets
      if (.not. chosen(f)) cycle
      corners = corners_of(surface, f)
      low = bin_at(bins, minval(corners, dim=2) - reach)
      high = bin_at(bins, maxval(corners, dim=2) + reach)
      do k = low(3), high(3)
        do j = low(2), high(2)
          do i = low(1), high(1)
            p = bins%head(i, j, k)
            do while (p > 0_i4)
              within = reach
              if (present(own)) within = own(p)
              if (.not. near(p)) near(p) = distance(x(p, :), corners) <= within*(1 + 1.0e-9_wp)
              p = bins%next(p)
            end do
          end do
        end do
      end do
    end do
  end subroutine points_near_facets

end module pd_body_surface_near
