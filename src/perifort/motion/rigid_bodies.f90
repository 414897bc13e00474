!> The rigid bodies of given shapes (`&rigid`) in explicit steps: they take up the forces of contact
!> and move with the points (doc/theory.md, 17).
module pd_motion_rigid_bodies
  use pd_base_kinds, only: wp
  use pd_force_term, only: term_view_type
  use pd_force_touch, only: loads_on
  use pd_motion_rigid_body, only: kick_body, kinetic_of, move_body, turns_freely
  use pd_motion_system, only: system_type, view_of
  implicit none (type, external)
  private
  public :: gather_rigid_bodies, move_rigid_bodies

contains

  !> Take up the forces of contact at time `t`, and half a kick of them, which brings the velocities
  !> from the middle of the last step to this instant. What moves them as given, and their weight,
  !> does external work.
  subroutine gather_rigid_bodies(system, t, kick)
    type(system_type), intent(inout), target :: system
      !! with the forces of this instant; its rigid bodies and its external work change
    real(wp), intent(in) :: t     !! [s]
    real(wp), intent(in) :: kick  !! half a step, 0 at the start [s]
    type(term_view_type) :: view
    real(wp) :: loads(6)
    integer :: r

    if (size(system%rigid_bodies) == 0) return
    call view_of(system, t, view)
    do r = 1, size(system%rigid_bodies)
      loads = loads_on(system%terms, view, r)
      system%rigid_bodies(r)%pose%force = loads(:3)
      system%rigid_bodies(r)%pose%torque = loads(4:)
      call kick_body(kick, system%rigid_bodies(r))
      call account_body(system, t, r)
    end do
  end subroutine gather_rigid_bodies

  !> The work of what moves a rigid body as given, by the trapezoidal rule, with the gain in kinetic
  !> energy; and that of the weight of what is free.
  subroutine account_body(system, t, r)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: t
    integer, intent(in) :: r     !! number of the body
    real(wp) :: loads(6), given(2), work

    associate (rigid => system%rigid_bodies(r), obstacle => system%obstacles(r))
      loads = [rigid%pose%force, rigid%pose%torque]
      given = kinetic_of(rigid, t)
      given(1) = rigid%pose%mass/2*sum(rigid%pose%velocity**2, mask=.not. rigid%free)
      if (rigid%accounted) then
        work = sum(merge(rigid%pose%mass*rigid%gravity, -(rigid%last_load(:3) + loads(:3))/2, &
          & rigid%free)*obstacle%shift) + given(1) - rigid%last_kinetic(1)
        if (rigid%turns /= turns_freely) work = work + given(2) - rigid%last_kinetic(2) &
          & - dot_product(rigid%last_load(4:) + loads(4:), obstacle%turn)/2
        system%external_work = system%external_work + work
      end if
      rigid%last_load = loads
      rigid%last_kinetic = given
      rigid%accounted = .true.
    end associate
  end subroutine account_body

  !> Move rigid bodies from `t` to `t` + `dt`: the other half of the kick, then the way.
  subroutine move_rigid_bodies(system, t, dt)
    type(system_type), intent(inout) :: system  !! its rigid bodies and their surfaces move
    real(wp), intent(in) :: t    !! [s]
    real(wp), intent(in) :: dt   !! [s]
    integer :: r

    do r = 1, size(system%rigid_bodies)
      call kick_body(dt/2, system%rigid_bodies(r))
      call move_body(t, dt, r, system%rigid_bodies(r), system%obstacles(r), system%fault)
    end do
  end subroutine move_rigid_bodies

end module pd_motion_rigid_bodies
