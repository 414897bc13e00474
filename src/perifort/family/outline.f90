!> Surface areas of the points of clouds, which have no faces: those of the outline that closes the
!> gaps between points and lies half a spacing outside of the outermost.
module pd_family_outline
  use pd_base_kinds, only: wp, i4
  use pd_body_body, only: body_type
  use pd_body_mesh_shares, only: fit
  use pd_body_side_areas, only: side_areas_type
  use pd_family_cells, only: cells_around, cells_type, sort_into_cells
  implicit none (type, external)
  private
  public :: cloud_side, uneven

  !> Spacings of a cloud may differ by this factor.
  real(wp), parameter :: uneven = 2.0_wp
  integer, parameter :: parts = 4             !! voxels along a spacing
  real(wp), parameter :: ball = 1.1_wp        !! around points: closes gaps between them [spacings]
  real(wp), parameter :: outside = 0.5_wp     !! the outline outside of the points [spacings]
  real(wp), parameter :: off(3) = [0.37_wp, 0.41_wp, 0.23_wp]  !! so that rows of points are cut [-]
  integer, parameter :: sharing(3) = [3, 8, 16]  !! points that share a facet, by the dimension
  real(wp), parameter :: least = 0.02_wp      !! area that counts [faces]

  !> Cubes around a cloud.
  type :: voxels_type
    integer :: n(3) = 1                     !! along each axis
    real(wp) :: lower(3) = 0.0_wp           !! [m]
    real(wp) :: edge = 1.0_wp               !! [m]
    logical, allocatable :: inside(:, :, :) !! the outline
  end type voxels_type

contains

  !> The surface of a cloud as one side without an axis, before it is balanced. `found` is false if
  !> a part of the outline has no points behind it that could share its area.
  subroutine cloud_side(body, side, found)
    type(body_type), intent(in) :: body       !! a cloud, arranged in slots
    type(side_areas_type), intent(out) :: side
    logical, intent(out) :: found
    type(voxels_type) :: voxels
    type(cells_type) :: cells
    real(wp), allocatable :: x(:, :), area(:, :), face(:)
    integer(i4), allocatable :: slots(:)
    logical, allocatable :: there(:)
    real(wp) :: h, depth, vector(3)
    integer :: i, j, k, c, s, at(3), next(3), n

    slots = body%slot(:body%n_points)
    x = body%x(slots, :)
    h = sum(body%spacing(slots))/size(slots)
    depth = body%volume(slots(1))/body%spacing(slots(1))**body%dim
    call fill_outline(x, h, voxels)
    call sort_into_cells(x, 3*h, cells)
    allocate (area(body%dim, size(slots)), source=0.0_wp)
    found = .true.
    do k = 1, voxels%n(3)
      do j = 1, voxels%n(2)
        do i = 1, voxels%n(1)
          at = [i, j, k]
          if (.not. voxels%inside(i, j, k)) cycle
          do c = 1, body%dim
            do s = -1, 1, 2
              next = at
              next(c) = at(c) + s
              if (voxels%inside(next(1), next(2), next(3))) cycle
              vector = voxels%lower + (at - 0.5_wp)*voxels%edge
              vector(c) = vector(c) + s*voxels%edge/2
              call share_facet(x, cells, vector(:body%dim), c, &
                & s*depth*voxels%edge**(body%dim - 1), area, found)
              if (.not. found) return
            end do
          end do
        end do
      end do
    end do
    face = body%volume(slots)/body%spacing(slots)
    there = [(norm2(area(:, i)) > least*face(i), i=1, size(slots))]
    n = count(there)
    side%body = [0]
    side%axis = [0]
    side%outward = [1]
    side%outermost = [.false.]
    side%start = [1_i4, int(n + 1, i4)]
    side%slot = pack(slots, there)
    side%face = pack(face, there)
    allocate (side%area(body%dim, n))
    do c = 1, body%dim
      side%area(c, :) = pack(area(c, :), there)
    end do
  end subroutine cloud_side

  !> The outline: places within balls around the points, and farther from what is outside of all
  !> balls than the ball reaches beyond the outline.
  subroutine fill_outline(x, h, voxels)
    real(wp), intent(in) :: x(:, :)
    real(wp), intent(in) :: h
    type(voxels_type), intent(out) :: voxels
    logical, allocatable :: near(:, :, :)
    real(wp) :: centre(3), place(3)
    integer :: k, c, i, j, l, reach, dim, low(3), high(3)

    dim = size(x, 2)
    voxels%edge = h/parts
    do c = 1, dim
      voxels%lower(c) = minval(x(:, c)) - (2 + off(c)/parts)*h
      voxels%n(c) = ceiling((maxval(x(:, c)) + 2*h - voxels%lower(c))/voxels%edge)
    end do
    allocate (near(voxels%n(1), voxels%n(2), voxels%n(3)), source=.false.)
    centre = 0.0_wp
    low = 1
    high = 1
    do k = 1, size(x, 1)
      centre(:dim) = x(k, :)
      low(:dim) = max(1, floor((centre(:dim) - ball*h - voxels%lower(:dim))/voxels%edge))
      high(:dim) = min(voxels%n(:dim), ceiling((centre(:dim) + ball*h - voxels%lower(:dim)) &
        & /voxels%edge) + 1)
      do l = low(3), high(3)
        do j = low(2), high(2)
          do i = low(1), high(1)
            place = voxels%lower + ([i, j, l] - 0.5_wp)*voxels%edge - centre
            if (sum(place(:dim)**2) <= (ball*h)**2) near(i, j, l) = .true.
          end do
        end do
      end do
    end do
    voxels%inside = near
    reach = int((ball - outside)*parts)
    do l = 1, voxels%n(3)
      do j = 1, voxels%n(2)
        do i = 1, voxels%n(1)
          if (near(i, j, l)) cycle
          call leave_out(voxels, [i, j, l], dim, reach)
        end do
      end do
    end do
  end subroutine fill_outline

  !> Leave out what is near a place outside of all balls.
  pure subroutine leave_out(voxels, at, dim, reach)
    type(voxels_type), intent(inout) :: voxels
    integer, intent(in) :: at(3), dim, reach
    integer :: low(3), high(3), i, j, k, d(3)

    low = at
    high = at
    low(:dim) = max(1, at(:dim) - reach)
    high(:dim) = min(voxels%n(:dim), at(:dim) + reach)
    do k = low(3), high(3)
      do j = low(2), high(2)
        do i = low(1), high(1)
          d = [i, j, k] - at
          if (sum(d**2) <= ((ball - outside)*parts)**2) voxels%inside(i, j, k) = .false.
        end do
      end do
    end do
  end subroutine leave_out

  !> Share a facet among the points next to it.
  pure subroutine share_facet(x, cells, at, axis, outward, area, found)
    real(wp), intent(in) :: x(:, :)
    type(cells_type), intent(in) :: cells
    real(wp), intent(in) :: at(:)
    integer, intent(in) :: axis
    real(wp), intent(in) :: outward           !! area with the sign of its normal [m2]
    real(wp), intent(inout) :: area(:, :)     !! (dim, points)
    logical, intent(out) :: found
    integer(i4), allocatable :: points(:)
    real(wp), allocatable :: squared(:), weights(:)
    integer :: chosen(sharing(size(x, 2))), i

    call cells_around(cells, at, points)
    found = size(points) >= size(chosen)
    if (.not. found) return
    allocate (squared(size(points)))
    do i = 1, size(points)
      squared(i) = sum((x(points(i), :) - at)**2)
    end do
    do i = 1, size(chosen)
      associate (nearest => minloc(squared, dim=1))
        chosen(i) = points(nearest)
        squared(nearest) = huge(1.0_wp)
      end associate
    end do
    call fit(x(chosen, :), at, weights, found)
    if (.not. found) return
    area(axis, chosen) = area(axis, chosen) + outward*weights
  end subroutine share_facet

end module pd_family_outline
