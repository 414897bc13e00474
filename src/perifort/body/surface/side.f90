!> The side of an edge on which a line along x is. It stands alone, so that there is one copy of the
!> code, which no optimisation makes a part of its loops: all facets get the same bits.
module pd_body_surface_side
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: side_of_edge

contains

  !> On which side of an edge a line is, seen along x: `side` is 1 to the left of a to b, else -1.
  !> `value` is twice the area of the triangle that they span. It has the same bits, but for
  !> its sign, for both facets of the edge.
  pure subroutine side_of_edge(x, a, b, y, z, value, side)
    real(wp), intent(in) :: x(:, :)     !! (3, vertices) [m]
    integer, intent(in) :: a, b         !! vertices: ends of the edge
    real(wp), intent(in) :: y, z        !! where the line is [m]
    real(wp), intent(out) :: value      !! positive to the left [m2]
    integer, intent(out) :: side        !! 1 or -1
    integer :: low, high
    real(wp) :: along_y, along_z

    low = min(a, b)
    high = max(a, b)
    along_y = x(2, high) - x(2, low)
    along_z = x(3, high) - x(3, low)
    value = along_y*(z - x(3, low)) - along_z*(y - x(2, low))
    if (value > 0.0_wp) then
      side = 1
    else if (value < 0.0_wp) then
      side = -1
    else if (along_z < 0.0_wp .or. (.not. along_z > 0.0_wp .and. along_y > 0.0_wp)) then
      side = 1
    else
      side = -1
    end if
    if (low == a) return
    value = -value
    side = -side
  end subroutine side_of_edge

end module pd_body_surface_side
