!> Shapes that choose points: boxes, spheres, cylinders, cones and half-spaces (in 2D a sphere or
!> cylinder is a disc, a cone a wedge).
module pd_body_shapes
  use pd_base_kinds, only: wp
  use pd_scene_content_types, only: body_group, shape_group, is_set
  implicit none (type, external)
  private
  public :: inside, inside_body, touch

  real(wp), parameter :: touch = 1.0e-6_wp      !! what counts as on a surface [spacings]

contains

  !> Whether each of the points `x` (n, dim) lies in the shape. Points on its surface do:
  !> `tolerance` [m] keeps that from depending on rounding. Unset limits do not bound.
  pure function inside(shape, x, tolerance) result(is_inside)
    class(shape_group), intent(in) :: shape !! any kind, with its measures
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
    if (any(is_set(shape%direction)) .or. is_set(shape%height)) then
      do k = 1, size(x, 1)
        is_inside(k) = is_inside(k) .and. along(shape, axis, x(k, :), tolerance)
      end do
      return
    end if
    do k = 1, size(x, 1)
      distance = 0.0_wp
      do c = 1, size(x, 2)
        if (c /= axis) distance = distance + (x(k, c) - shape%centre(c))**2
      end do
      is_inside(k) = is_inside(k) .and. sqrt(distance) <= shape%radius + tolerance
    end do
  end function inside

  !> Whether a point lies in a shape along a direction: a half-space, a cone, or a cylinder of any
  !> direction or of a height.
  pure logical function along(shape, axis, x, tolerance)
    class(shape_group), intent(in) :: shape
    integer, intent(in) :: axis
    real(wp), intent(in) :: x(:), tolerance
    real(wp), parameter :: degree = acos(-1.0_wp)/180.0_wp
    real(wp) :: r(3), direction(3), at, across

    direction = 0.0_wp
    if (any(is_set(shape%direction))) then
      direction(:size(x)) = shape%direction(:size(x))
    else
      direction(axis) = 1.0_wp
    end if
    direction = direction/norm2(direction)
    r = 0.0_wp
    r(:size(x)) = x - shape%centre(:size(x))
    at = dot_product(r, direction)
    across = norm2(r - at*direction)
    along = .true.
    if (shape%shape == 'half_space' .or. shape%shape == 'cone' .or. is_set(shape%height)) &
      & along = at >= -tolerance
    if (is_set(shape%height)) along = along .and. at <= shape%height + tolerance
    if (shape%shape == 'cylinder') along = along .and. across <= shape%radius + tolerance
    ! the distance from the cone's surface
    if (shape%shape == 'cone') along = along .and. across*cos(degree*shape%angle/2) &
      & - at*sin(degree*shape%angle/2) <= tolerance
  end function along

  !> Which points of a lattice body lie in its shape.
  pure function inside_body(group, x, tolerance) result(is_inside)
    type(body_group), intent(in) :: group   !! checked, with a shape or none
    real(wp), intent(in) :: x(:, :)         !! (n, dim) points of its box [m]
    real(wp), intent(in) :: tolerance       !! how far outside a point still lies in it [m]
    logical, allocatable :: is_inside(:)
    type(shape_group) :: shape

    if (group%shape /= 'sphere' .and. group%shape /= 'cylinder') then
      allocate (is_inside(size(x, 1)), source=.true.)
      return
    end if
    ! the ends of a cylinder are those of its box
    shape%shape = group%shape
    shape%centre = group%centre
    shape%radius = group%radius
    shape%axis = group%axis
    is_inside = inside(shape, x, tolerance)
  end function inside_body

end module pd_body_shapes
