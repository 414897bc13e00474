!> Surfaces of rigid bodies as triangles, for the files of an output: round ones by many flat
!> triangles, half-spaces by a patch beside the points.
module pd_output_report_rigid_surfaces
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i4
  use pd_base_numbers, only: pi
  use pd_base_vectors, only: cross
  use pd_force_obstacle, only: a_box, a_closed_surface, a_cylinder, a_half_space, a_sphere, &
    & obstacle_type
  use pd_motion_rigid_body, only: spin_now
  use pd_motion_system, only: system_type
  use pd_output_results_surfaces, only: triangles_type
  implicit none (type, external)
  private
  public :: rigid_surfaces_type

  integer, parameter :: around = 64            !! vertices of a circle
  real(wp), parameter :: patch = 0.6_wp        !! half edge of a half-space's patch, over the
                                               !! diagonal of the box around the points
  real(wp), parameter :: thick = 0.1_wp        !! thickness of a patch in 2D over its half edge

  !> The vertices of all rigid bodies, in the axes of each.
  type :: rigid_surfaces_type
    type(triangles_type) :: triangles
    real(wp), allocatable :: own(:, :)         !! (3, vertices) from the centre of the body [m]
    integer(i4), allocatable :: of(:)          !! (vertices) its number
  contains
    procedure :: begin
    procedure :: place
  end type rigid_surfaces_type

contains

  !> Make the triangles of a system's rigid bodies; in 1D there are none.
  subroutine begin(self, system, low, high)
    class(rigid_surfaces_type), intent(out) :: self  !! with all triangles
    type(system_type), intent(in) :: system          !! at the start
    real(wp), intent(in) :: low(3), high(3)          !! corners of the box around the points [m]
    integer :: r

    allocate (self%own(3, 0), self%of(0), self%triangles%corner(3, 0), self%triangles%body(0))
    if (system%body%dim == 1) return
    do r = 1, size(system%obstacles)
      associate (obstacle => system%obstacles(r))
        select case (obstacle%shape)
        case (a_sphere)
          if (obstacle%dim == 2) call add_disc(self, obstacle%half(1))
          if (obstacle%dim == 3) call add_round(self, ball_profile(obstacle%half(1)))
        case (a_cylinder)
          call add_round(self, reshape([0.0_wp, -obstacle%half(3), obstacle%half(1), &
            & -obstacle%half(3), obstacle%half(1), obstacle%half(3), 0.0_wp, obstacle%half(3)], &
            & [2, 4]))
        case (a_box)
          call add_box(self, obstacle%half, obstacle%dim)
        case (a_half_space)
          call add_patch(self, obstacle, (low + high)/2, patch*norm2(high - low))
        case (a_closed_surface)
          associate (surface => obstacle%facets%surface)
            call add(self, surface%x(:, :surface%n_vertices), &
              & int(surface%corner(:, :surface%n_facets)))
          end associate
        case default
          call internal_fault('a rigid body of no known shape')
        end select
      end associate
      call number_body(self, r)
    end do
    self%triangles%n_vertices = size(self%of)
  end subroutine begin

  !> The vertices and triangles that are new belong to a body.
  subroutine number_body(self, number)
    class(rigid_surfaces_type), intent(inout) :: self
    integer, intent(in) :: number

    self%of = [self%of, spread(int(number, i4), 1, size(self%own, 2) - size(self%of))]
    self%triangles%body = [self%triangles%body, spread(int(number, i4), 1, &
      & size(self%triangles%corner, 2) - size(self%triangles%body))]
  end subroutine number_body

  !> Add vertices and triangles, whose corners count from 1 in these vertices.
  subroutine add(self, x, corner)
    class(rigid_surfaces_type), intent(inout) :: self
    real(wp), intent(in) :: x(:, :)         !! (3, vertices)
    integer, intent(in) :: corner(:, :)     !! (3, triangles)
    integer :: before

    before = size(self%own, 2)
    self%own = reshape([self%own, x], [3, before + size(x, 2)])
    self%triangles%corner = reshape([self%triangles%corner, int(corner + before, i4)], [3, &
      & size(self%triangles%corner, 2) + size(corner, 2)])
  end subroutine add

  !> Half a circle about the third axis, from below: distance from it and height.
  pure function ball_profile(radius) result(profile)
    real(wp), intent(in) :: radius
    real(wp) :: profile(2, around/2 + 1)
    integer :: i

    do i = 0, around/2
      profile(:, i + 1) = radius*[sin(2*pi*i/around), -cos(2*pi*i/around)]
    end do
    profile(1, [1, around/2 + 1]) = 0.0_wp
  end function ball_profile

  !> A body of revolution about the third axis; its profile begins and ends on it.
  subroutine add_round(self, profile)
    class(rigid_surfaces_type), intent(inout) :: self
    real(wp), intent(in) :: profile(:, :)   !! (2, n) distance from the axis, height
    real(wp) :: x(3, around*(size(profile, 2) - 2) + 2)
    integer :: corner(3, 2*around*(size(profile, 2) - 2)), rows, i, j, n, here, next

    rows = size(profile, 2) - 2
    do i = 1, rows
      do j = 1, around
        x(:, around*(i - 1) + j) = [profile(1, i + 1)*cos(2*pi*j/around), &
          & profile(1, i + 1)*sin(2*pi*j/around), profile(2, i + 1)]
      end do
    end do
    x(:, around*rows + 1) = [0.0_wp, 0.0_wp, profile(2, 1)]
    x(:, around*rows + 2) = [0.0_wp, 0.0_wp, profile(2, rows + 2)]
    n = 0
    do j = 1, around
      next = mod(j, around) + 1
      corner(:, n + 1) = [next, j, around*rows + 1]
      do i = 1, rows - 1
        here = around*(i - 1)
        corner(:, n + 2*i) = [here + j, here + next, here + around + next]
        corner(:, n + 2*i + 1) = [here + j, here + around + next, here + around + j]
      end do
      corner(:, n + 2*rows) = [around*(rows - 1) + j, around*(rows - 1) + next, around*rows + 2]
      n = n + 2*rows
    end do
    call add(self, x, corner)
  end subroutine add_round

  !> A disc in 2D.
  subroutine add_disc(self, radius)
    class(rigid_surfaces_type), intent(inout) :: self
    real(wp), intent(in) :: radius
    real(wp) :: x(3, around + 1)
    integer :: corner(3, around), j

    x = 0.0_wp
    do j = 1, around
      x(:2, j) = radius*[cos(2*pi*j/around), sin(2*pi*j/around)]
      corner(:, j) = [j, mod(j, around) + 1, around + 1]
    end do
    call add(self, x, corner)
  end subroutine add_disc

  !> A box; a rectangle in 2D.
  subroutine add_box(self, half, dim)
    class(rigid_surfaces_type), intent(inout) :: self
    real(wp), intent(in) :: half(3)
    integer, intent(in) :: dim
    real(wp) :: x(3, 8)
    integer, parameter :: corner(3, 12) = reshape([1, 4, 2, 1, 3, 4, 5, 6, 8, 5, 8, 7, 1, 2, 6, &
      & 1, 6, 5, 3, 8, 4, 3, 7, 8, 1, 5, 7, 1, 7, 3, 2, 4, 8, 2, 8, 6], [3, 12])
    integer :: i, c

    do i = 1, 8
      do c = 1, 3
        x(c, i) = merge(half(c), -half(c), btest(i - 1, c - 1))
      end do
    end do
    if (dim == 3) call add(self, x, corner)
    ! seen from above
    if (dim == 2) call add(self, x(:, 5:), corner(:, 3:4) - 4)
  end subroutine add_box

  !> A patch of a half-space's surface, beside a place; in 2D with a thickness.
  subroutine add_patch(self, obstacle, middle, half)
    class(rigid_surfaces_type), intent(inout) :: self
    type(obstacle_type), intent(in) :: obstacle
    real(wp), intent(in) :: middle(3)   !! that it lies beside [m]
    real(wp), intent(in) :: half        !! its edge [m]
    real(wp) :: at(3), x(3, 4)

    at = matmul(middle - obstacle%centre, obstacle%frame)
    at(3) = 0.0_wp
    if (obstacle%dim == 3) then
      x = spread(at, 2, 4) + half*reshape([-1.0_wp, -1.0_wp, 0.0_wp, 1.0_wp, -1.0_wp, 0.0_wp, &
        & 1.0_wp, 1.0_wp, 0.0_wp, -1.0_wp, 1.0_wp, 0.0_wp], [3, 4])
    else
      at(2) = 0.0_wp
      x = spread(at, 2, 4) + half*reshape([-1.0_wp, 0.0_wp, -thick, 1.0_wp, 0.0_wp, -thick, &
        & 1.0_wp, 0.0_wp, 0.0_wp, -1.0_wp, 0.0_wp, 0.0_wp], [3, 4])
    end if
    call add(self, x, reshape([1, 2, 3, 1, 3, 4], [3, 2]))
  end subroutine add_patch

  !> Where the vertices are, and how fast the bodies' material there moves.
  subroutine place(self, system, places, velocity)
    class(rigid_surfaces_type), intent(in) :: self       !! with all triangles
    type(system_type), intent(in) :: system              !! at an instant
    real(wp), allocatable, intent(out) :: places(:, :)   !! (vertices, 3) [m]
    real(wp), allocatable, intent(out) :: velocity(:, :) !! (vertices, 3) [m/s]
    real(wp) :: spin(3), arm(3)
    integer :: r, v

    allocate (places(size(self%of), 3), velocity(size(self%of), 3))
    v = 0
    do r = 1, size(system%rigid_bodies)
      spin = spin_now(system%rigid_bodies(r), system%time)
      do v = v + 1, size(self%of)
        if (self%of(v) /= r) exit
        arm = matmul(system%obstacles(r)%frame, self%own(:, v))
        places(v, :) = system%obstacles(r)%centre + arm
        velocity(v, :) = system%rigid_bodies(r)%pose%velocity + cross(spin, arm)
      end do
      v = v - 1
    end do
  end subroutine place

end module pd_output_report_rigid_surfaces
