!> When a run writes: outputs of fields, rows of the history, lines about iterations.
module pd_output_report_schedule
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: to_text
  use pd_motion_explicit_time_step, only: evaluations
  use pd_motion_observer, only: instant_type
  use pd_scene_content_defaults, only: rows_by_cost
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: scene_type, is_set
  use pd_set_up_plan, only: plan_type
  implicit none (type, external)
  private
  public :: schedule_type, schedule_of, check_schedule, history_interval, planned_outputs, &
    & planned_rows, due_at, iteration_due

  !> When to write.
  type :: schedule_type
    logical :: relaxation = .false.
    integer :: steps = 0                 !! explicit: steps of the run; relaxation: load steps
    integer :: every = 1                 !! outputs: steps or load steps
    real(wp) :: interval = 0.0_wp        !! outputs: time between them [s], if > 0 instead of every
    integer :: history_every = 1         !! rows: steps; relaxation: lines about iterations
    real(wp) :: tolerance = 0.0_wp       !! relaxation: of the residual [-]
  end type schedule_type

contains

  !> When a scene's run writes; `bonds` are the ordered pairs of its families.
  pure type(schedule_type) function schedule_of(scene, plan, bonds) result(schedule)
    type(scene_type), intent(in) :: scene
    type(plan_type), intent(in) :: plan
    integer(i8), intent(in) :: bonds

    schedule%relaxation = plan%relaxes
    schedule%steps = plan%steps
    schedule%every = scene%output%every
    if (is_set(scene%output%interval)) schedule%interval = scene%output%interval
    if (schedule%every == 0) schedule%every = merge(1, max(1, plan%steps/10), plan%relaxes)
    schedule%history_every = history_interval(scene, plan, bonds)
    schedule%tolerance = plan%relaxation%tolerance
  end function schedule_of

  !> An error if a run would write more outputs, or rows of its history, than can be used: the
  !> results have room for all of them from the beginning.
  subroutine check_schedule(scene, plan, bonds, error)
    type(scene_type), intent(in) :: scene
    type(plan_type), intent(in) :: plan
    integer(i8), intent(in) :: bonds     !! ordered pairs of the families
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: most_outputs = 1000000, most_rows = 10000000
    type(schedule_type) :: schedule
    real(wp) :: duration

    schedule = schedule_of(scene, plan, bonds)
    if (schedule%interval > 0.0_wp) then
      duration = schedule%steps*plan%step
      if (min(duration/schedule%interval, real(schedule%steps, wp)) > most_outputs) &
        & call scene_fault(error, scene, 'output', 1, 'interval', &
        & 'the run would write more than '//to_text(most_outputs)//' outputs', &
        & 'allowed: interval = '//to_text(duration/most_outputs, 3))
    else if (schedule%steps/schedule%every > most_outputs) then
      call scene_fault(error, scene, 'output', 1, 'every', 'the run would write '// &
        & to_text(schedule%steps/schedule%every)//' outputs', 'at most '//to_text(most_outputs)// &
        & ' are allowed: every = '//to_text(schedule%steps/most_outputs + 1))
    end if
    if (allocated(error) .or. schedule%relaxation) return
    if (schedule%steps/schedule%history_every > most_rows) call scene_fault(error, scene, &
      & 'output', 1, 'history_every', 'the history would have '// &
      & to_text(schedule%steps/schedule%history_every)//' rows', 'at most '//to_text(most_rows)// &
      & ' are allowed: history_every = '//to_text(schedule%steps/most_rows + 1))
  end subroutine check_schedule

  !> Steps between rows of the history; in relaxation, whose history has a row for each load step,
  !> iterations between lines of `iterations.csv` (`iteration_due` adds those that meet the
  !> tolerance). Without the user's word there are
  !> at most about 2000, and so few that they take a twentieth of the time of the steps at most: for
  !> the strain energy, a row takes 1.4 to 2 evaluations of the forces over all `bonds` (ordered
  !> pairs). Rows that cost next to nothing, those of small bodies, may be more. The number follows
  !> from the scene alone and not from a clock, so that every run of it has the same rows.
  pure integer function history_interval(scene, plan, bonds) result(every)
    type(scene_type), intent(in) :: scene
    type(plan_type), intent(in) :: plan
    integer(i8), intent(in) :: bonds
    real(wp), parameter :: row = 2.5_wp           ! evaluations of the forces that a row takes
    real(wp), parameter :: share = 0.05_wp        ! of the time of the steps
    real(wp), parameter :: no_cost = 5.0e6_wp     ! bonds of all rows: some 0.02 s on one thread
    real(wp) :: affordable, free

    every = scene%output%history_every
    if (every > 0) return
    if (plan%relaxes) then
      every = 1
    else
      affordable = row/(share*evaluations(plan%integrator))
      free = real(plan%steps, wp)*bonds/no_cost
      every = max(1, plan%steps/2000)
      if (rows_by_cost(scene)) every = max(every, ceiling(min(affordable, free)))
    end if
  end function history_interval

  !> Number of outputs of a run: the first state, those due, and the final state.
  pure integer function planned_outputs(schedule, dt) result(number)
    type(schedule_type), intent(in) :: schedule
    real(wp), intent(in) :: dt
    integer(i8) :: outputs

    if (schedule%interval <= 0.0_wp) then
      outputs = schedule%steps/schedule%every
    else if (dt < schedule%interval) then
      outputs = intervals(schedule, schedule%steps, dt)
    else
      outputs = schedule%steps
    end if
    number = int(min(int(schedule%steps, i8), outputs)) + 1
    if (.not. output_due(schedule, schedule%steps, dt)) number = number + 1
  end function planned_outputs

  !> Number of rows of a run.
  pure integer function planned_rows(schedule) result(number)
    type(schedule_type), intent(in) :: schedule
    number = schedule%steps + 1
    if (schedule%relaxation) return
    number = schedule%steps/schedule%history_every + 1
    if (mod(schedule%steps, schedule%history_every) /= 0) number = number + 1
  end function planned_rows

  !> What is due at an instant: a row, an output.
  pure subroutine due_at(schedule, instant, row, output)
    type(schedule_type), intent(in) :: schedule
    type(instant_type), intent(in) :: instant
    logical, intent(out) :: row, output

    if (schedule%relaxation) then
      row = instant%settled
      output = instant%settled .and. .not. instant%between .and. &
        & mod(instant%load_step, schedule%every) == 0
    else
      row = mod(instant%step, schedule%history_every) == 0
      output = output_due(schedule, instant%step, instant%dt)
    end if
  end subroutine due_at

  !> Whether step `step` is the first at or after a multiple of the interval, or a multiple of
  !> every.
  pure logical function output_due(schedule, step, dt) result(due)
    type(schedule_type), intent(in) :: schedule
    integer, intent(in) :: step
    real(wp), intent(in) :: dt

    if (schedule%interval > 0.0_wp) then
      due = step == 0
      if (.not. due) due = dt > schedule%interval &
        & .or. intervals(schedule, step, dt) > intervals(schedule, step - 1, dt)
    else
      due = mod(step, schedule%every) == 0
    end if
  end function output_due

  !> Intervals complete at a step, where slightly less than one, within the tolerance, counts as
  !> one. For steps that are not longer than the interval.
  pure integer(i8) function intervals(schedule, step, dt)
    type(schedule_type), intent(in) :: schedule
    integer, intent(in) :: step
    real(wp), intent(in) :: dt
    intervals = int(step*min(1.0_wp, dt/schedule%interval)*(1 + 1.0e-12_wp) + 1.0e-9_wp, i8)
  end function intervals

  !> Whether `iterations.csv` has a line for this iteration: those that are due, and those whose
  !> residual meets the tolerance, so that the last one of a load step is among them.
  pure logical function iteration_due(schedule, instant) result(due)
    type(schedule_type), intent(in) :: schedule
    type(instant_type), intent(in) :: instant

    due = schedule%relaxation .and. .not. instant%settled
    if (due) due = mod(instant%step, schedule%history_every) == 0 .or. &
      & instant%residual <= schedule%tolerance
  end function iteration_due

end module pd_output_report_schedule
