!> The line about an instant of a run: its step or load step, and the progress of a relaxation.
module pd_output_report_lines
  use pd_base_clock, only: duration_text
  use pd_base_interrupt, only: interrupted
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text
  use pd_motion_observer, only: instant_type
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: place_of, reason_to_stop, relaxation_note, iteration_line

contains

  !> Where a run is, for a message: step and time, or iteration and load step.
  pure function place_of(instant, relaxation) result(text)
    type(instant_type), intent(in) :: instant
    logical, intent(in) :: relaxation
    character(:), allocatable :: text

    if (.not. relaxation) then
      text = 'step '//to_text(instant%step)//', t = '//to_text(instant%time)//' s'
    else if (instant%settled .and. instant%between) then
      text = 'the equilibrium at load factor '//to_text(instant%time)//' after '// &
        & to_text(instant%events)//' events'
    else if (instant%settled) then
      text = 'the end of load step '//to_text(instant%load_step)
    else
      text = 'iteration '//to_text(instant%iteration)//' of load step '// &
        & to_text(instant%load_step)//', which is not in equilibrium yet'
    end if
  end function place_of

  !> Why a run that is to stop does so.
  function reason_to_stop(most_seconds, wish) result(reason)
    real(wp), intent(in) :: most_seconds  !! that it has been given [s]
    character(:), allocatable, intent(in) :: wish  !! an observer's words why it wants it to stop
    character(:), allocatable :: reason
    reason = 'interrupted'
    if (interrupted()) return
    if (allocated(wish)) then
      reason = wish
    else
      reason = 'stopped after '//duration_text(most_seconds)//', as asked for,'
    end if
  end function reason_to_stop

  !> What the progress line adds in relaxation.
  pure function relaxation_note(instant, tolerance) result(note)
    type(instant_type), intent(in) :: instant
    real(wp), intent(in) :: tolerance
    character(:), allocatable :: note
    character(96) :: text
    write (text, '("load step ",i0,": iteration ",i0,", residual",es8.1," (tolerance",es8.1,")")') &
      & instant%load_step, instant%iteration, instant%residual, tolerance
    note = trim(text)
  end function relaxation_note

  !> A line of `iterations.csv`.
  pure function iteration_line(system, instant) result(line)
    type(system_type), intent(in) :: system
    type(instant_type), intent(in) :: instant
    character(:), allocatable :: line
    character(160) :: text
    character(18) :: solver

    solver = 'conjugate_gradient'
    if (instant%dynamic) solver = 'dynamic_relaxation'
    write (text, '(i0,",",i0,",",es13.6e3,",",i0,",",a,",",es13.6e3,",",es13.6e3,",",i0)') &
      & instant%step, instant%load_step, instant%time, instant%iteration, trim(solver), &
      & instant%residual, instant%change, system%broken
    line = trim(text)
  end function iteration_line

end module pd_output_report_lines
