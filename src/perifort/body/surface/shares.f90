!> Areas of facets shared among the points of a lattice near them, so that a load on a surface acts
!> on points.
!>
!> Facets are cut at the cells of the lattice. The weights of a piece sum up to 1 and have their
!> centre at the piece's, as those of meshes (`pd_body_mesh_shares`): the force and the moment of a
!> load are those on the facets.
module pd_body_surface_shares
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i4
  use pd_base_text, only: to_text
  use pd_base_vectors, only: cross
  use pd_body_mesh_shares, only: fit
  use pd_body_surface_cut, only: cut_facet, pieces_type
  use pd_body_surface_near, only: bins_type, new_bins, points_within
  use pd_body_surface_surface, only: corners_of, surface_fault, surface_type
  implicit none (type, external)
  private
  public :: share_facets

  real(wp), parameter :: reaches(4) = [2.0_wp, 2.5_wp, 3.0_wp, 4.0_wp]  !! [spacings]
  real(wp), parameter :: good = 3.0_wp     !! sum of |weights| that needs no wider reach
  real(wp), parameter :: worst = 20.0_wp   !! beyond it there is no sound extrapolation
  integer, parameter :: most_points = 512  !! within the widest reach: 268 of a lattice

contains

  !> Area vectors and areas of points that stand for some facets. Where the body is but one point
  !> thick, no weights reproduce linear functions: the nearest points then share a piece's area
  !> alone. An error, with its place, if a facet has no point near it.
  subroutine share_facets(surface, chosen, x, origin, spacing, vector, area, error)
    type(surface_type), intent(in) :: surface            !! finished
    logical, intent(in) :: chosen(:)                     !! (facets)
    real(wp), intent(in) :: x(:, :)                      !! (points, 3), one or more [m]
    real(wp), intent(in) :: origin(3)                    !! lower corner of a cell [m]
    real(wp), intent(in) :: spacing                      !! edge of the cells [m]
    real(wp), allocatable, intent(out) :: vector(:, :)   !! (points, 3) along the normals [m2]
    real(wp), allocatable, intent(out) :: area(:)        !! (points) [m2]
    type(error_type), allocatable, intent(out) :: error
    type(bins_type) :: bins
    type(pieces_type) :: pieces
    real(wp), allocatable :: weights(:)
    integer(i4) :: points(most_points)
    real(wp) :: piece(3), centre(3), size_of_piece
    integer :: f, p, n, c

    allocate (vector(size(x, 1), 3), area(size(x, 1)), source=0.0_wp)
    call new_bins(x, spacing, bins)
    do f = 1, surface%n_facets
      if (.not. chosen(f)) cycle
      call cut_facet(corners_of(surface, f), origin, spacing, pieces)
      do p = 1, pieces%n
        call measure(pieces%x(:, :pieces%corners(p), p), piece, centre)
        size_of_piece = norm2(piece)
        if (.not. size_of_piece > 0.0_wp) cycle
        call weights_at(bins, x, centre, spacing, points, n, weights)
        if (n == 0) then
          call surface_fault(surface, 'no point of the body is within '// &
            & to_text(maxval(reaches))//' spacings of this facet', error, &
            & 'was the body removed there, or is it thinner than a cell?', f)
          return
        end if
        do c = 1, 3
          vector(points(:n), c) = vector(points(:n), c) + weights(:n)*piece(c)
        end do
        area(points(:n)) = area(points(:n)) + weights(:n)*size_of_piece
      end do
    end do
  end subroutine share_facets

  !> Area vector and centre of a planar piece.
  pure subroutine measure(x, vector, centre)
    real(wp), intent(in) :: x(:, :)        !! (3, corners)
    real(wp), intent(out) :: vector(3), centre(3)
    real(wp) :: one(3), total
    integer :: i

    vector = 0.0_wp
    centre = 0.0_wp
    total = 0.0_wp
    do i = 2, size(x, 2) - 1
      one = cross(x(:, i) - x(:, 1), x(:, i + 1) - x(:, 1))/2
      vector = vector + one
      total = total + norm2(one)
      centre = centre + norm2(one)*(x(:, 1) + x(:, i) + x(:, i + 1))/3
    end do
    if (total > 0.0_wp) centre = centre/total
  end subroutine measure

  !> Weights of the points near a place.
  subroutine weights_at(bins, x, place, spacing, points, n, weights)
    type(bins_type), intent(in) :: bins
    real(wp), intent(in) :: x(:, :), place(3), spacing
    integer(i4), intent(inout) :: points(:)
    integer, intent(out) :: n                        !! 0: no point is near
    real(wp), allocatable, intent(out) :: weights(:)
    real(wp), allocatable :: tried(:)
    integer(i4) :: some(most_points)
    real(wp) :: least, nearest
    integer :: r, m
    logical :: found

    least = worst
    n = 0
    do r = 1, size(reaches)
      call points_within(bins, x, place, reaches(r)*spacing, some, m)
      if (m < 4) cycle
      call fit(x(some(:m), :), place, tried, found)
      if (.not. found) cycle
      if (sum(abs(tried)) >= least) cycle
      least = sum(abs(tried))
      n = m
      points(:n) = some(:m)
      call move_alloc(tried, weights)
      if (least <= good) return
    end do
    if (n > 0) return
    ! a sheet of points, or a few
    call points_within(bins, x, place, maxval(reaches)*spacing, some, m)
    if (m == 0) return
    nearest = minval(norm2(x(some(:m), :) - spread(place, 1, m), dim=2))
    call points_within(bins, x, place, nearest + spacing/2, points, n)
    weights = 1/(sum((x(points(:n), :) - spread(place, 1, n))**2, dim=2) + 0.05_wp*spacing**2)
    weights = weights/sum(weights)
  end subroutine weights_at

end module pd_body_surface_shares
