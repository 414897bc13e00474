!> Surfaces of rigid bodies (doc/theory.md, 17): how far a place is from one, and along which
!> normal, by the formula of the shape. A surface is where it is and moves as it does; what moves it
!> is not known here.
module pd_force_obstacle
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: pi
  use pd_base_vectors, only: cross
  use pd_body_surface_distance, only: area_around, facet_gap, facets_type
  implicit none (type, external)
  private
  public :: obstacle_type, a_sphere, a_cylinder, a_box, a_half_space, a_closed_surface
  public :: find_gap, velocity_at, shift_at, surface_of, reach_of_shape, turned_at_most, note_pose

  !> Shapes.
  integer, parameter :: a_sphere = 1, a_cylinder = 2, a_box = 3, a_half_space = 4, &
    & a_closed_surface = 5

  !> The surface of a rigid body. Vectors have three components whatever the dimension; those beyond
  !> it are 0.
  type :: obstacle_type
    integer :: shape = a_sphere
    integer :: dim = 3
    real(wp) :: half(3) = 0.0_wp        !! the radius of a sphere; of a cylinder radius, radius,
                                        !! half its length; of a box half its edges; of a closed
                                        !! surface how far it reaches, 0, 0 [m]
    real(wp) :: centre(3) = 0.0_wp      !! of the body; of a half-space a point of its surface [m]
    real(wp) :: frame(3, 3) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, &
      & 0.0_wp, 1.0_wp], [3, 3])        !! its own axes as columns: a cylinder lies along the third,
                                        !! a half-space ends along it
    real(wp) :: velocity(3) = 0.0_wp    !! of the centre, when the points have theirs [m/s]
    real(wp) :: spin(3) = 0.0_wp        !! then [rad/s]
    real(wp) :: shift(3) = 0.0_wp       !! of the centre in the last step [m]
    real(wp) :: turn(3) = 0.0_wp        !! rotation in the last step, axis times angle [rad]
    real(wp) :: per_mass = 0.0_wp       !! 1/mass, 0 where no force moves it [1/kg]
    real(wp) :: per_inertia = 0.0_wp    !! 1/least moment of inertia, 0 where none turns it
                                        !! [1/(kg m2)]
    type(facets_type), allocatable :: facets  !! of a closed surface, about its centre
  end type obstacle_type

contains

  !> Signed distance of a place from the surface, negative within the body, and the normal there,
  !> out of the body: the gradient of the distance.
  pure subroutine find_gap(obstacle, y, gap, normal)
    type(obstacle_type), intent(in) :: obstacle  !! the surface
    real(wp), intent(in) :: y(:)        !! the place, as many components as dimensions [m]
    real(wp), intent(out) :: gap        !! [m]
    real(wp), intent(out) :: normal(3)  !! unit vector
    real(wp) :: r(3), own(3)

    r = -obstacle%centre
    r(:size(y)) = r(:size(y)) + y
    own = [dot_product(r, obstacle%frame(:, 1)), dot_product(r, obstacle%frame(:, 2)), &
      & dot_product(r, obstacle%frame(:, 3))]
    select case (obstacle%shape)
    case (a_sphere)
      gap = norm2(own)
      ! in the centre any direction is as good
      normal = [1.0_wp, 0.0_wp, 0.0_wp]
      if (gap > 0.0_wp) normal = own/gap
      gap = gap - obstacle%half(1)
    case (a_cylinder)
      call beside_cylinder(obstacle%half, own, gap, normal)
    case (a_box)
      call beside_box(obstacle%half, obstacle%dim, own, gap, normal)
    case (a_closed_surface)
      call facet_gap(obstacle%facets, own, gap, normal)
    case default
      gap = own(3)
      normal = [0.0_wp, 0.0_wp, 1.0_wp]
    end select
    normal = obstacle%frame(:, 1)*normal(1) + obstacle%frame(:, 2)*normal(2) &
      & + obstacle%frame(:, 3)*normal(3)
  end subroutine find_gap

  !> A box about the origin: within it the nearest face counts, beside an edge the edge.
  pure subroutine beside_box(half, dim, r, gap, normal)
    real(wp), intent(in) :: half(3), r(3)
    integer, intent(in) :: dim
    real(wp), intent(out) :: gap, normal(3)
    real(wp) :: beyond(3)
    integer :: c

    beyond = 0.0_wp
    beyond(:dim) = max(abs(r(:dim)) - half(:dim), 0.0_wp)
    gap = norm2(beyond)
    if (gap > 0.0_wp) then
      normal = sign(beyond/gap, r)
    else
      c = maxloc(abs(r(:dim)) - half(:dim), dim=1)
      gap = abs(r(c)) - half(c)
      normal = 0.0_wp
      normal(c) = sign(1.0_wp, r(c))
    end if
  end subroutine beside_box

  !> A cylinder about the third axis: in the plane of the axis and the place it is a box.
  pure subroutine beside_cylinder(half, r, gap, normal)
    real(wp), intent(in) :: half(3), r(3)
    real(wp), intent(out) :: gap, normal(3)
    real(wp) :: radius, out(3), flat(3)

    radius = norm2(r(:2))
    out = [1.0_wp, 0.0_wp, 0.0_wp]
    if (radius > 0.0_wp) out(:2) = r(:2)/radius
    call beside_box([half(1), half(3), 0.0_wp], 2, [radius, r(3), 0.0_wp], gap, flat)
    normal = flat(1)*out
    normal(3) = flat(2)
  end subroutine beside_cylinder

  !> Where a surface is, without its facets: what `turned_at_most` needs of an earlier instant.
  subroutine note_pose(obstacle, noted)
    type(obstacle_type), intent(in) :: obstacle  !! the surface
    type(obstacle_type), intent(out) :: noted    !! its shape and where it is

    noted%shape = obstacle%shape
    noted%dim = obstacle%dim
    noted%half = obstacle%half
    noted%centre = obstacle%centre
    noted%frame = obstacle%frame
  end subroutine note_pose

  !> How far from its centre the body reaches at most; a half-space without end [m].
  pure real(wp) function reach_of_shape(obstacle) result(reach)
    type(obstacle_type), intent(in) :: obstacle  !! the surface

    select case (obstacle%shape)
    case (a_sphere)
      reach = obstacle%half(1)
    case (a_cylinder)
      reach = norm2(obstacle%half(2:))
    case (a_box, a_closed_surface)
      reach = norm2(obstacle%half)
    case default
      reach = sqrt(huge(reach))
    end select
  end function reach_of_shape

  !> By how much at most rotation of a body from one time to another changes the distance between
  !> its surface and a place that is nearer than `margin` to it then [m]. With its centre at rest a
  !> place at y from it is as far from the surface as the place Q^T y was, where Q is the rotation:
  !> these are |Q - 1| |y| apart. A sphere does not change by rotation, a cylinder and a half-space
  !> by that of their axis alone, |Q - 1| is then the way of the axis' end; of a box and of a closed
  !> surface the sum of squares of all components is a bound.
  pure real(wp) function turned_at_most(before, now, margin, farthest) result(most)
    type(obstacle_type), intent(in) :: before, now  !! the surface
    real(wp), intent(in) :: margin                  !! [m]
    real(wp), intent(in) :: farthest                !! from the centre at which there are places [m]
    real(wp) :: turned

    most = 0.0_wp
    if (now%shape == a_sphere) return
    if (now%shape == a_box .or. now%shape == a_closed_surface) then
      turned = norm2(now%frame - before%frame)
    else
      turned = norm2(now%frame(:, 3) - before%frame(:, 3))
    end if
    most = turned*min(farthest, reach_of_shape(now) + margin)
  end function turned_at_most

  !> The velocity of the body's material at a place [m/s].
  pure function velocity_at(obstacle, y) result(v)
    type(obstacle_type), intent(in) :: obstacle  !! the surface
    real(wp), intent(in) :: y(:)   !! the place, as many components as dimensions [m]
    real(wp) :: v(3), arm(3)

    arm = -obstacle%centre
    arm(:size(y)) = arm(:size(y)) + y
    v = obstacle%velocity + cross(obstacle%spin, arm)
  end function velocity_at

  !> By how much the body's material at a place has moved in the last step [m].
  pure function shift_at(obstacle, y) result(shift)
    type(obstacle_type), intent(in) :: obstacle  !! the surface
    real(wp), intent(in) :: y(:)   !! the place, as many components as dimensions [m]
    real(wp) :: shift(3), arm(3)

    arm = -obstacle%centre
    arm(:size(y)) = arm(:size(y)) + y
    shift = obstacle%shift + cross(obstacle%turn, arm)
  end function shift_at

  !> The area of the surface in 3D [m2], its length in 2D [m], its two ends in 1D [-], all with the
  !> body larger by `margin` on all sides; of a half-space huge.
  real(wp) function surface_of(obstacle, margin) result(surface)
    type(obstacle_type), intent(in) :: obstacle  !! the surface
    real(wp), intent(in) :: margin   !! [m]
    real(wp) :: h(3)

    surface = 2.0_wp
    h = obstacle%half + margin
    select case (obstacle%shape)
    case (a_sphere)
      if (obstacle%dim == 3) surface = 4*pi*h(1)**2
      if (obstacle%dim == 2) surface = 2*pi*h(1)
    case (a_cylinder)
      surface = 2*pi*h(1)**2 + 4*pi*h(1)*h(3)
    case (a_box)
      if (obstacle%dim == 3) surface = 8*(h(1)*h(2) + h(2)*h(3) + h(3)*h(1))
      if (obstacle%dim == 2) surface = 4*(h(1) + h(2))
    case (a_closed_surface)
      surface = area_around(obstacle%facets, margin)
    case (a_half_space)
      surface = sqrt(huge(surface))
    case default
      call internal_fault('a rigid body of no known shape')
    end select
  end function surface_of

end module pd_force_obstacle
