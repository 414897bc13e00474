!> From the plan of a scene to its motion: explicit steps in time (7.3) or static equilibrium (7.5).
module pd_set_up_move
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp
  use pd_motion_explicit_integrators, only: begin_steps => begin_memory, run_explicit
  use pd_motion_observer, only: observer_type
  use pd_motion_static_relaxation, only: fill_memory, run_relaxation
  use pd_motion_account, only: account
  use pd_motion_system, only: system_type
  use pd_set_up_plan, only: plan_type
  implicit none (type, external)
  private
  public :: move, take_all_memory

contains

  !> Move a system as planned, to the end or to an error; `observer` sees every instant.
  subroutine move(system, plan, observer, error)
    type(system_type), intent(inout) :: system
    type(plan_type), intent(in) :: plan
    class(observer_type), intent(inout) :: observer
    type(error_type), allocatable, intent(out) :: error

    system%stable_step = plan%limit
    if (plan%relaxes) then
      call run_relaxation(system, plan%relaxation, observer, error)
    else
      call run_explicit(system, plan%integrator, plan%step, plan%steps, observer, error)
    end if
  end subroutine move

  !> Give a system, which has not moved, all that it carries from instant to instant at most.
  subroutine take_all_memory(system, plan)
    type(system_type), intent(inout) :: system
    type(plan_type), intent(in) :: plan

    call account(system, 0.0_wp)
    if (plan%relaxes) then
      call fill_memory(system, plan%relaxation)
    else
      call begin_steps(system, plan%integrator)
    end if
  end subroutine take_all_memory

end module pd_set_up_move
