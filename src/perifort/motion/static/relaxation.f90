!> Static equilibrium over the load steps. Bonds beyond their limit break by events
!> (`grow_by_events`), or, by the rule of load steps, all at once when a load step has converged;
!> then it relaxes again until none does.
module pd_motion_static_relaxation
  use pd_base_kinds, only: wp, i8
  use pd_base_error, only: error_type, status_input, status_no_answer
  use pd_motion_memory, only: memory_type, not_begun
  use pd_motion_observer, only: observer_type, instant_type, add_note
  use pd_motion_static_equilibrium, only: find_equilibrium, check_terms, turn_where_free, settle
  use pd_motion_static_events, only: grow_by_events
  use pd_motion_static_residual, only: relaxation_type
  use pd_motion_static_rigid, only: rigid_type, find_free_motions, check_balance
  use pd_motion_watch_rescue, only: good_state_type, keep_good, show_good
  use pd_motion_static_start, only: loose_text
  use pd_motion_account, only: account
  use pd_motion_pins, only: has_pins
  use pd_motion_static_pins, only: check_pins
  use pd_motion_system, only: system_type, bring_temperature, evaluate, break_now, &
    & explain_condition, renew_conditions
  implicit none (type, external)
  private
  public :: relaxation_type, run_relaxation, fill_memory

contains

  !> Bring `system` to equilibrium under the conditions at each load step's time i/load_steps; if
  !> its memory says that it has begun, it continues from there. An error is set if there is no
  !> equilibrium, if it is not found, or if the observer sets one.
  subroutine run_relaxation(system, relaxation, observer, error)
    type(system_type), intent(inout) :: system
      !! ready, or as a checkpoint left it; settled at the last load step on return
    type(relaxation_type), intent(in) :: relaxation  !! solver, load steps, tolerance and mass
    class(observer_type), intent(inout) :: observer
      !! called once for each iteration and settled load step
    type(error_type), allocatable, intent(out) :: error
    type(instant_type) :: instant
    type(rigid_type) :: rigid
    type(good_state_type) :: good
    integer(i8) :: number
    integer :: i, first, parts
    logical :: amid

    if (relaxation%events) then
      call grow_by_events(system, relaxation, observer, error)
      return
    end if
    system%static = .true.
    instant%dt = 1.0_wp
    call check_terms(system, error)
    if (allocated(error)) return
    call find_free_motions(system, rigid)
    call check_pins(system, rigid, merge(status_input, status_no_answer, &
      & system%memory%step == not_begun), error)
    if (allocated(error)) return
    do i = max(1, system%memory%load_step), relaxation%load_steps
      call renew_conditions(system, real(i, wp)/relaxation%load_steps)
      if (allocated(system%fault)) call explain_condition(system, status_input, error)
      if (allocated(error)) return
      call check_balance(system, rigid, real(i, wp)/relaxation%load_steps, merge(status_input, &
        & status_no_answer, system%memory%step == not_begun), error)
      if (allocated(error)) return
    end do
    if (system%memory%step == not_begun) instant%note = loose_text(system, rigid, 1)
    if (system%memory%step == not_begun) then
      system%memory = memory_type()
      call evaluate(system, 0.0_wp, breaking=.false.)
      call settle(system, instant, observer, error)
      if (allocated(error)) return
    end if
    instant%step = system%memory%step
    if (.not. allocated(system%memory%trend)) allocate (system%memory%trend(0, system%body%dim))
    amid = system%memory%iteration > 0 .or. allocated(system%memory%newton)
    first = system%memory%load_step
    if (.not. amid) then
      call keep_good(good, system, instant)
      first = first + 1
    end if
    do i = first, relaxation%load_steps
      if (relaxation%conjugate_gradient .and. relaxation%load_steps > 1 .and. .not. amid) &
        & system%memory%start = system%state%u
      if (.not. amid) system%memory%began = instant%step
      amid = .false.
      instant%load_step = i
      instant%time = real(i, wp)/relaxation%load_steps
      system%time = instant%time
      call bring_temperature(system, instant%time)
      do
        call find_equilibrium(system, relaxation, rigid, instant, observer, error)
        if (allocated(error)) then
          if (error%status == status_no_answer) call show_good(good, system, observer, error)
          return
        end if
        ! the forces that did the work are those before the bonds break
        call account(system, instant%time)
        call break_now(system, number)
        if (number == 0) exit
        parts = rigid%pieces%number
        call find_free_motions(system, rigid)
        call add_note(instant, loose_text(system, rigid, parts))
        call check_pins(system, rigid, status_no_answer, error)
        if (.not. allocated(error)) &
          & call check_balance(system, rigid, instant%time, status_no_answer, error)
        if (allocated(error)) then
          call show_good(good, system, observer, error)
          return
        end if
      end do
      call turn_where_free(system, relaxation, rigid, instant)
      if (allocated(system%memory%start)) then
        system%memory%trend = system%state%u - system%memory%start
        deallocate (system%memory%start)
      end if
      instant%last = i == relaxation%load_steps
      call settle(system, instant, observer, error)
      if (allocated(error)) return
      call keep_good(good, system, instant)
    end do
    system%memory%step = not_begun  ! another run begins anew
  end subroutine run_relaxation

  !> Fill a system's memory with all that a relaxation may ever carry, whose size is then known.
  subroutine fill_memory(system, relaxation)
    type(system_type), intent(inout) :: system
      !! with a memory of the largest size, without contents, on return
    type(relaxation_type), intent(in) :: relaxation  !! solver and number of load steps

    system%memory = memory_type()
    if (.not. relaxation%conjugate_gradient) then
      allocate (system%memory%rate, system%memory%base, mold=system%state%u)
      return
    end if
    allocate (system%memory%newton)
    associate (memory => system%memory, krylov => system%memory%newton%krylov)
      allocate (krylov%residual, krylov%direction, krylov%origin, krylov%tangent%forces, &
        & memory%newton%best, mold=system%state%u)
      allocate (krylov%of_pins(6, merge(size(system%motions), 0, has_pins(system))))
      if (relaxation%load_steps > 1) allocate (memory%trend, memory%start, mold=system%state%u)
    end associate
  end subroutine fill_memory

end module pd_motion_static_relaxation
