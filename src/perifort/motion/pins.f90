!> Pins are boundaries whose points move as one rigid body: their rotation and the components of
!> their centre that nothing imposes are free (doc/theory.md, 10).
module pd_motion_pins
  use pd_base_kinds, only: wp, i1
  use pd_motion_conditions, only: free_component, guide, impose, motion_type
  use pd_motion_pose, only: drift, fit_pose, moments_about
  use pd_motion_system, only: apply_to_held, system_type
  implicit none (type, external)
  private
  public :: has_pins, held_but_for_pins, gather_pins, move_pins, fit_pins, snap_pins

contains

  !> Whether a system has pins.
  pure logical function has_pins(system)
    type(system_type), intent(in) :: system  !! with its motions
    has_pins = any(system%motions%is_pin)
  end function has_pins

  !> Which components are constrained if the points of pins count as free (n_slots, dim): pins
  !> lower the frequencies of a body, so that its limits are bounds then.
  pure function held_but_for_pins(system) result(held)
    type(system_type), intent(in) :: system  !! with its motions
    integer(i1), allocatable :: held(:, :)   !! 1 where constrained
    integer :: m

    allocate (held, source=system%held)
    do m = 1, size(system%motions)
      if (system%motions(m)%is_pin) held(system%motions(m)%slots, :) = 0_i1
    end do
  end function held_but_for_pins

  !> Take up the forces on pins at time `t`, and half a kick of them, which brings their velocities
  !> from the middle of the last step to this instant. The system's velocities of their points
  !> become those of this instant, too.
  subroutine gather_pins(system, t, kick)
    type(system_type), intent(inout) :: system  !! with the forces of this instant
    real(wp), intent(in) :: t     !! [s]
    real(wp), intent(in) :: kick  !! half a step, 0 at the start [s]
    integer :: m

    if (.not. has_pins(system)) return
    call apply_to_held(system, t)
    do m = 1, size(system%motions)
      if (system%motions(m)%is_pin) call gather(system%motions(m))
    end do
    call impose(system%motions, t, system%state%u, system%state%v)

  contains

    !> One pin.
    subroutine gather(motion)
      type(motion_type), intent(inout) :: motion
      real(wp) :: density(system%body%dim, size(motion%slots)), totals(6)
      integer :: i

      do i = 1, size(motion%slots)
        density(:, i) = system%state%force(motion%slots(i), :)
        if (allocated(system%applied)) &
          & density(:, i) = density(:, i) + system%applied(motion%slots(i), :)
      end do
      totals = moments_about(system%body, motion%slots, motion%pose, density)
      motion%pose%force = totals(:3)
      motion%pose%torque = totals(4:)
      call kick_pose(kick, motion)
    end subroutine gather
  end subroutine gather_pins

  !> Let the forces on a pin act for `kick`.
  subroutine kick_pose(kick, motion)
    real(wp), intent(in) :: kick               !! [s]
    type(motion_type), intent(inout) :: motion !! a pin with its forces

    associate (pose => motion%pose)
      pose%velocity = pose%velocity + kick/pose%mass*pose%force
      pose%momentum = pose%momentum + kick*pose%torque
    end associate
  end subroutine kick_pose

  !> Move pins from `t` to `t` + `dt`: the other half of the kick, then the way.
  subroutine move_pins(system, t, dt)
    type(system_type), intent(inout) :: system  !! its pins move; their points follow when imposed
    real(wp), intent(in) :: t    !! [s]
    real(wp), intent(in) :: dt   !! [s]
    real(wp) :: place(3), velocity(3)
    integer :: m

    do m = 1, size(system%motions)
      associate (motion => system%motions(m))
        if (.not. motion%is_pin) cycle
        call kick_pose(dt/2, motion)
        call drift(dt, motion%pose)
        ! what is imposed is known
        call guide(motion, t + dt, place, velocity)
        motion%pose%place = place
        where (motion%kind /= free_component) motion%pose%velocity = velocity
      end associate
    end do
  end subroutine move_pins

  !> Bring the poses of pins as near to the displacements as they can be; nothing is imposed.
  subroutine fit_pins(system)
    type(system_type), intent(inout) :: system  !! its pins take the place of their points
    integer :: m

    do m = 1, size(system%motions)
      if (system%motions(m)%is_pin) call fit_pose(system%body, system%motions(m)%slots, &
        & system%state%u, system%motions(m)%pose)
    end do
  end subroutine fit_pins

  !> Bring the poses of pins to the displacements, and the displacements of their points to the
  !> poses: rigid to the last digit, with what is imposed on them at time `t`.
  subroutine snap_pins(system, t)
    type(system_type), intent(inout) :: system  !! its pins and the displacements of their points
    real(wp), intent(in) :: t                   !! [s]

    integer :: m

    if (.not. has_pins(system)) return
    call fit_pins(system)
    do m = 1, size(system%motions)
      if (system%motions(m)%is_pin) call impose(system%motions(m:m), t, system%state%u)
    end do
  end subroutine snap_pins

end module pd_motion_pins
