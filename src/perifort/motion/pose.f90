!> A rigid body, of the points of a boundary (`motion = 'pin'`) or of a given shape (`&rigid`):
!> where it is, how it is turned, and how it moves (doc/theory.md, 10 and 17).
module pd_motion_pose
  use pd_base_archive, only: archive_type
  use pd_base_eigen, only: solve_symmetric
  use pd_base_kinds, only: wp, i4
  use pd_base_reduce, only: add_point, new_running, running_type, total_of_running
  use pd_base_vectors, only: cross
  use pd_body_body, only: body_type
  implicit none (type, external)
  private
  public :: pose_type, new_pose, arm_of, displacement_of, spin_of, spin_rate_of, rotation_of
  public :: fit_pose, moments_about, drift, keep_pose
  public :: new_shape_pose, turn_on, turned_by, momentum_of, rotation_between

  !> Turns that a fit takes at most; each doubles the digits.
  integer, parameter :: most_turns = 60
  !> A turn below this changes no digit [rad].
  real(wp), parameter :: negligible = 1.0e-16_wp

  !> A rigid body. Vectors have three components whatever the dimension; those beyond it are 0.
  type :: pose_type
    integer :: dim = 3
    real(wp) :: centre(3) = 0.0_wp         !! centre of mass, undeformed [m]
    real(wp) :: mass = 0.0_wp              !! [kg]
    real(wp) :: spread(3, 3) = 0.0_wp      !! sum of m r r^T about the centre, undeformed [kg m2]
    real(wp), allocatable :: arms(:, :)    !! (3, slot) from the centre, undeformed [m]
    real(wp), allocatable :: masses(:)     !! (slot) [kg]
    real(wp) :: place(3) = 0.0_wp          !! displacement of the centre [m]
    real(wp) :: turn(4) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]  !! unit quaternion, real part first [-]
    real(wp) :: velocity(3) = 0.0_wp       !! of the centre [m/s]
    real(wp) :: momentum(3) = 0.0_wp       !! angular momentum about the centre [kg m2/s]
    real(wp) :: force(3) = 0.0_wp          !! of bonds, terms and loads on its points [N]
    real(wp) :: torque(3) = 0.0_wp         !! their moment about the centre as it has moved [N m]
  end type pose_type

contains

  !> The rigid body that `slots` make, undisplaced.
  subroutine new_pose(body, slots, masses, pose)
    type(body_type), intent(in) :: body   !! positions of the points
    integer(i4), intent(in) :: slots(:)   !! in the order of the points
    real(wp), intent(in) :: masses(:)     !! (slot) [kg]
    type(pose_type), intent(out) :: pose
    type(running_type) :: running
    real(wp) :: totals(6)
    integer :: i, c

    pose%dim = body%dim
    allocate (pose%masses, source=masses)
    allocate (pose%arms(3, size(slots)), source=0.0_wp)
    call new_running(running)
    do i = 1, size(slots)
      call add_point(body%order, body%point(slots(i)), masses(i)*[1.0_wp, body%x(slots(i), :)], &
        & running)
    end do
    totals = total_of_running(body%order, running)
    pose%mass = totals(1)
    pose%centre(:body%dim) = totals(2:1 + body%dim)/pose%mass
    do c = 1, body%dim
      pose%arms(c, :) = body%x(slots, c) - pose%centre(c)
    end do
    call new_running(running)
    do i = 1, size(slots)
      associate (r => pose%arms(:, i))
        call add_point(body%order, body%point(slots(i)), &
          & masses(i)*[r(1)**2, r(2)**2, r(3)**2, r(1)*r(2), r(2)*r(3), r(1)*r(3)], running)
      end associate
    end do
    totals = total_of_running(body%order, running)
    pose%spread = reshape([totals(1), totals(4), totals(6), totals(4), totals(2), totals(5), &
      & totals(6), totals(5), totals(3)], [3, 3])
  end subroutine new_pose

  !> The rigid body of a shape without points, undisplaced and at rest.
  pure subroutine new_shape_pose(dim, centre, mass, inertia, axes, pose)
    integer, intent(in) :: dim             !! of the scene
    real(wp), intent(in) :: centre(3)      !! of mass [m]
    real(wp), intent(in) :: mass           !! [kg]
    real(wp), intent(in) :: inertia(3)     !! principal moments; in 2D the third counts [kg m2]
    real(wp), intent(in) :: axes(3, 3)     !! their axes as columns
    type(pose_type), intent(out) :: pose
    real(wp) :: spread
    integer :: i, j

    pose%dim = dim
    pose%centre = centre
    pose%mass = mass
    if (dim == 2) then
      pose%spread(1, 1) = inertia(3)/2
      pose%spread(2, 2) = inertia(3)/2
    else if (dim == 3) then
      do i = 1, 3
        spread = sum(inertia)/2 - inertia(i)
        do j = 1, 3
          pose%spread(:, j) = pose%spread(:, j) + spread*axes(:, i)*axes(j, i)
        end do
      end do
    end if
    allocate (pose%arms(3, 0), pose%masses(0))
  end subroutine new_shape_pose

  !> What turning has added to an arm: (R - 1) r, without differences of large numbers [m].
  pure function turned_by(turn, r) result(change)
    real(wp), intent(in) :: turn(4)  !! unit quaternion
    real(wp), intent(in) :: r(3)     !! undeformed arm [m]
    real(wp) :: change(3), across(3) !! [m]

    across = cross(turn(2:), r)
    change = 2*(turn(1)*across + cross(turn(2:), across))
  end function turned_by

  !> From the centre to point `i` as it is now [m].
  pure function arm_of(pose, i) result(arm)
    type(pose_type), intent(in) :: pose
    integer, intent(in) :: i           !! which of its points
    real(wp) :: arm(3)
    arm = pose%arms(:, i) + turned_by(pose%turn, pose%arms(:, i))
  end function arm_of

  !> Displacement of point `i` if the centre is displaced by `place` [m].
  pure function displacement_of(pose, i, place) result(u)
    type(pose_type), intent(in) :: pose
    integer, intent(in) :: i           !! which of its points
    real(wp), intent(in) :: place(3)   !! [m]
    real(wp) :: u(3)
    u = place + turned_by(pose%turn, pose%arms(:, i))
  end function displacement_of

  !> The angular velocity [rad/s].
  pure function spin_of(pose) result(spin)
    type(pose_type), intent(in) :: pose
    real(wp) :: spin(3)
    spin = per_inertia(pose, pose%turn, pose%momentum)
  end function spin_of

  !> The rate of the angular velocity under the present torque (Euler's equations) [rad/s2].
  pure function spin_rate_of(pose) result(rate)
    type(pose_type), intent(in) :: pose
    real(wp) :: rate(3)
    rate = per_inertia(pose, pose%turn, pose%torque - cross(spin_of(pose), pose%momentum))
  end function spin_rate_of

  !> The rotation from the undeformed place as a vector: its axis times its angle [rad], of at most
  !> half a turn.
  pure function rotation_of(pose) result(rotation)
    type(pose_type), intent(in) :: pose
    real(wp) :: rotation(3), length

    length = norm2(pose%turn(2:))
    rotation = 2*pose%turn(2:)
    if (length > 0.0_wp) rotation = pose%turn(2:)/length*2*atan2(sign(length, pose%turn(1)), &
      & abs(pose%turn(1)))
  end function rotation_of

  !> Inertia to the power -1 times `momentum`, turned by `turn`. Directions without inertia, such as
  !> the line on which all points are, turn nothing.
  pure function per_inertia(pose, turn, momentum) result(spin)
    type(pose_type), intent(in) :: pose
    real(wp), intent(in) :: turn(4), momentum(3)
    real(wp) :: spin(3), back(3), inertia(3, 3)
    integer :: c

    spin = 0.0_wp
    if (pose%dim == 1) return
    if (pose%dim == 2) then
      associate (about_z => pose%spread(1, 1) + pose%spread(2, 2))
        if (about_z > 0.0_wp) spin(3) = momentum(3)/about_z
      end associate
      return
    end if
    inertia = -pose%spread
    do c = 1, 3
      inertia(c, c) = inertia(c, c) + pose%spread(1, 1) + pose%spread(2, 2) + pose%spread(3, 3)
    end do
    ! in the frame that turns with the body
    back = momentum + turned_by([turn(1), -turn(2:)], momentum)
    back = solve_symmetric(inertia, back)
    spin = back + turned_by(turn, back)
  end function per_inertia

  !> The angular momentum about the centre that an angular velocity makes [kg m2/s].
  pure function momentum_of(pose, spin) result(momentum)
    type(pose_type), intent(in) :: pose
    real(wp), intent(in) :: spin(3)    !! [rad/s]
    real(wp) :: momentum(3), back(3), trace

    momentum = 0.0_wp
    if (pose%dim == 1) return
    trace = pose%spread(1, 1) + pose%spread(2, 2) + pose%spread(3, 3)
    back = spin + turned_by([pose%turn(1), -pose%turn(2:)], spin)
    back = trace*back - matmul(pose%spread, back)
    momentum = back + turned_by(pose%turn, back)
  end function momentum_of

  !> The rotation that brings one turn to another, as a vector: its axis times its angle [rad], of
  !> at most half a turn.
  pure function rotation_between(from, to) result(rotation)
    real(wp), intent(in) :: from(4), to(4)  !! unit quaternions
    real(wp) :: rotation(3), part, length

    part = dot_product(from, to)
    rotation = from(1)*to(2:) - to(1)*from(2:) - cross(to(2:), from(2:))
    length = norm2(rotation)
    if (length > 0.0_wp) rotation = rotation/length*2*atan2(sign(length, part), abs(part))
  end function rotation_between

  !> Turn on by `angle` [rad] about its direction.
  pure subroutine turn_on(angle, turn)
    real(wp), intent(in) :: angle(3)    !! axis times angle [rad]
    real(wp), intent(inout) :: turn(4)  !! unit quaternion
    real(wp) :: half, by(4)

    half = norm2(angle)/2
    by(1) = cos(half)
    by(2:) = angle/2
    if (half > 0.0_wp) by(2:) = by(2:)*(sin(half)/half)
    turn = [by(1)*turn(1) - dot_product(by(2:), turn(2:)), &
      & by(1)*turn(2:) + turn(1)*by(2:) + cross(by(2:), turn(2:))]
    turn = turn/norm2(turn)
  end subroutine turn_on

  !> Force and moment about the centre as it has moved [N], [N m] that densities make on the points.
  function moments_about(body, slots, pose, density) result(totals)
    type(body_type), intent(in) :: body
    integer(i4), intent(in) :: slots(:)      !! of the pose
    type(pose_type), intent(in) :: pose
    real(wp), intent(in) :: density(:, :)    !! (dim, slot) force density [N/m3]
    real(wp) :: totals(6)                    !! force, then moment
    type(running_type) :: running
    real(wp) :: force(3)
    integer :: i

    call new_running(running)
    force = 0.0_wp
    do i = 1, size(slots)
      force(:body%dim) = density(:, i)*body%volume(slots(i))
      call add_point(body%order, body%point(slots(i)), [force, cross(arm_of(pose, i), force)], &
        & running)
    end do
    totals = total_of_running(body%order, running)
  end function moments_about

  !> Bring place and turn as near to displacements as they can be, in the least squares of mass.
  subroutine fit_pose(body, slots, u, pose)
    type(body_type), intent(in) :: body
    integer(i4), intent(in) :: slots(:)        !! of the pose
    real(wp), intent(in) :: u(:, :)            !! (n_slots, dim) displacements [m]
    type(pose_type), intent(inout) :: pose
    type(running_type) :: running
    real(wp) :: totals(6), d(3), angle(3)
    integer :: turn, i

    call new_running(running)
    do i = 1, size(slots)
      call add_point(body%order, body%point(slots(i)), pose%masses(i)*u(slots(i), :), running)
    end do
    totals = total_of_running(body%order, running)
    pose%place(:body%dim) = totals(:body%dim)/pose%mass
    if (body%dim == 1) return
    do turn = 1, most_turns
      call new_running(running)
      d = 0.0_wp
      do i = 1, size(slots)
        d(:body%dim) = u(slots(i), :)
        d = d - displacement_of(pose, i, pose%place)
        call add_point(body%order, body%point(slots(i)), &
          & pose%masses(i)*cross(arm_of(pose, i), d), running)
      end do
      totals = total_of_running(body%order, running)
      angle = per_inertia(pose, pose%turn, totals(:3))
      ! at most a radian at a time
      call turn_on(angle/max(1.0_wp, norm2(angle)), pose%turn)
      if (norm2(angle) <= negligible) exit
    end do
  end subroutine fit_pose

  !> Move on for `dt` with the present velocity and angular momentum. The angular velocity is that
  !> of the middle of the step, so that the motion is of second order where the inertia turns, too.
  pure subroutine drift(dt, pose)
    real(wp), intent(in) :: dt     !! [s]
    type(pose_type), intent(inout) :: pose
    real(wp) :: spin(3), middle(4)
    integer :: i

    pose%place = pose%place + dt*pose%velocity
    if (pose%dim == 1) return
    spin = spin_of(pose)
    if (pose%dim == 3) then
      do i = 1, 3
        middle = pose%turn
        call turn_on(dt/2*spin, middle)
        spin = per_inertia(pose, middle, pose%momentum)
      end do
    end if
    call turn_on(dt*spin, pose%turn)
  end subroutine drift

  !> Keep where the body is and how it moves, or put it back.
  subroutine keep_pose(archive, name, pose)
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    character(*), intent(in) :: name               !! what is kept
    type(pose_type), intent(inout) :: pose         !! set where the archive reads
    real(wp), allocatable :: values(:)

    values = [pose%place, pose%turn, pose%velocity, pose%momentum, pose%force, pose%torque]
    call archive%keep(name, values)
    pose%place = values(1:3)
    pose%turn = values(4:7)
    pose%velocity = values(8:10)
    pose%momentum = values(11:13)
    pose%force = values(14:16)
    pose%torque = values(17:19)
  end subroutine keep_pose

end module pd_motion_pose
