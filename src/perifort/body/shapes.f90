!> Shapes that choose points: box, sphere, cylinder (in 2D a sphere or cylinder is a disc).
module pd_body_shapes
  use pd_base_kinds, only: wp
  use pd_scene_content_types, only: shape_group, is_set
  implicit none (type, external)
  private
  public :: inside

contains

  !> Whether each of the points `x` (n, dim) lies in the shape. Points on its surface do:
  !> `tolerance` [m] keeps that from depending on rounding. Unset limits do not bound.
  pure function inside(shape, x, tolerance) result(is_inside)
    class(shape_group), intent(in) :: shape !! box, sphere or cylinder with its measures
    real(wp), intent(in) :: x(:, :)         !! positions (n, dim) [m]
    real(wp), intent(in) :: tolerance       !! how far outside its surface a point still lies in the
                                            !! shape [m]
    logical, allocatable :: is_inside(:)
    integer :: c, k, axis
    real(wp) :: distance

    allocate (is_inside(size(x, 1)), source=.true.)
    if (shape%shape == 'box' .or. shape%shape == 'cylinder') then
      do c = 1, size(x, 2)
        if (is_set(shape%lower(c))) &
          & is_inside = is_inside .and. x(:, c) >= shape%lower(c) - tolerance
        if (is_set(shape%upper(c))) &
          & is_inside = is_inside .and. x(:, c) <= shape%upper(c) + tolerance
      end do
    end if
    if (shape%shape == 'box') return
    axis = 0
    if (shape%shape == 'cylinder') axis = index('xyz', trim(shape%axis))
    do k = 1, size(x, 1)
      distance = 0.0_wp
      do c = 1, size(x, 2)
        if (c /= axis) distance = distance + (x(k, c) - shape%centre(c))**2
      end do
      is_inside(k) = is_inside(k) .and. sqrt(distance) <= shape%radius + tolerance
    end do
  end function inside

end module pd_body_shapes
