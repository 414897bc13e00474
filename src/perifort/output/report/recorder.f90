!> Writes the output of a run: outputs of fields, rows of history with energies, reactions and
!> probes, and the progress line.
module pd_output_report_recorder
  use pd_base_kinds, only: wp, i8
  use pd_base_clock, only: phase_timer_type, progress_type
  use pd_base_error, only: error_type, fail, status_interrupted
  use pd_base_interrupt, only: interrupted
  use pd_base_reduce, only: any_of_ranks
  use pd_base_threads, only: team_type
  use pd_base_warnings, only: warnings_type
  use pd_base_text, only: newline, to_text
  use pd_motion_watch_fault, only: check_strain_energy
  use pd_motion_observer, only: observer_type, instant_type
  use pd_motion_account, only: energies_of, velocities_now
  use pd_motion_system, only: system_type
  use pd_output_checkpoint_checkpoint, only: about_type, checkpoint_type
  use pd_output_deal, only: deal_type
  use pd_output_fields_field, only: moment_type, output_field_type
  use pd_output_fields_write, only: write_fields
  use pd_output_measures_line, only: profile_type, write_profiles
  use pd_output_report_balance, only: balance_type
  use pd_output_measures_fragments, only: fragment_type, fragments_of
  use pd_output_measures_measure, only: measure_list_type, row_source_type
  use pd_output_report_columns, only: history_row, history_table_type
  use pd_output_report_lines, only: iteration_line, place_of, reason_to_stop, relaxation_note
  use pd_output_report_rigid_surfaces, only: rigid_surfaces_type
  use pd_output_report_run_warnings, only: contact_warning, gradient_warning, &
    & large_strain_warning, rotation_warning, strain_warning
  use pd_output_report_schedule, only: due_at, iteration_due, schedule_type
  use pd_output_results_results, only: results_type
  implicit none (type, external)
  private
  public :: recorder_type

  type, extends(observer_type) :: recorder_type
    type(results_type) :: results
    type(deal_type) :: deal                  !! of values to the ranks that write them
    type(schedule_type) :: schedule
    type(output_field_type), allocatable :: fields(:)  !! of every output
    type(measure_list_type) :: measures      !! of the history
    type(profile_type), allocatable :: profiles(:)     !! of every output
    type(rigid_surfaces_type) :: surfaces    !! of rigid bodies, in every output
    type(progress_type) :: progress
    type(phase_timer_type) :: timer
    type(team_type) :: team                  !! threads, whose number may change at any instant
    type(history_table_type) :: columns      !! of the history
    type(balance_type) :: balance            !! of energy, over the rows
    integer :: rows = 0
    integer :: outputs = 0
    integer :: output_step = -1              !! of the last output
    integer :: steps_done = 0
    integer :: first_step = 0                !! steps that were done before this start
    real(wp) :: time = 0.0_wp
    integer :: gave_way = 0                  !! load steps left to dynamic relaxation
    integer :: gave_way_at = 0               !! the last of them
    type(warnings_type) :: warnings
    logical :: turned = .false.              !! parts have rotated, which was reported
    logical :: quiet = .false.               !! warnings are kept, but not printed
    logical :: fragments = .false.           !! of every output are listed
    type(checkpoint_type) :: checkpoint
    type(about_type) :: about                !! of the run, for its checkpoints
    integer :: more_rows = 0                 !! rows and outputs at the last instant that a run
    integer :: more_outputs = 0              !! which continues would not have
    real(wp) :: most_seconds = 0.0_wp        !! wall time until the run stops by itself, if > 0 [s]
    character(:), allocatable :: command     !! continues the run; '' = not possible
    character(:), allocatable :: wish        !! why another observer asks to stop in order
    character(:), allocatable :: rescued     !! message on the saved state of a diverged run
  contains
    procedure :: observe
    procedure :: keep_state
    procedure :: warn
    procedure :: energy_balance
    procedure :: phase
  end type recorder_type

contains

  !> Process one instant: write the outputs, rows and checkpoints that are due.
  subroutine observe(observer, system, instant, error)
    class(recorder_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(error_type), allocatable, intent(out) :: error
    logical :: row, output, row_due, output_due, may_stop, stopping, keeping
    real(wp), allocatable :: v(:, :)

    if (instant%rescued) then
      call write_rescued(observer, system, instant, error)
      return
    end if
    call observer%team%look()
    associate (schedule => observer%schedule)
      observer%steps_done = instant%step
      observer%time = instant%time
      call due_at(schedule, instant, row_due, output_due)
      if (schedule%relaxation) then
        call observer%progress%update(int(instant%load_step, i8) &
          & - merge(0_i8, 1_i8, instant%settled .or. instant%load_step == 0), instant%time, &
          & system%broken, relaxation_note(instant, schedule%tolerance))
      else
        call observer%progress%update(int(instant%step, i8), instant%time, system%broken)
      end if
    end associate
    if (instant%gave_way) call note_giving_way(observer, instant)
    if (allocated(instant%note)) then
      if (instant%note /= '') call observer%warn('equilibrium', 'load step '// &
        & to_text(instant%load_step)//': '//instant%note)
    end if
    if (iteration_due(observer%schedule, instant)) then
      call observer%results%add_iteration(iteration_line(system, instant), observer%first_step, &
        & error)
      if (allocated(error)) return
    end if
    may_stop = .not. instant%last
    stopping = may_stop .and. (interrupted() .or. time_is_over(observer) &
      & .or. allocated(observer%wish))
    keeping = may_stop .and. observer%checkpoint%is_due(instant%step)
    if (may_stop .and. observer%deal%needed) &
      & call agree(system, instant%step, stopping, keeping)
    keeping = (keeping .or. stopping) .and. observer%checkpoint%in_files
    ! the history has no row of a load step that has not converged
    row = row_due .or. ((stopping .or. instant%last) .and. instant%settled)
    output = output_due .or. stopping .or. instant%last
    observer%more_rows = merge(1, 0, row .and. .not. row_due)
    observer%more_outputs = merge(1, 0, output .and. .not. output_due)
    if (.not. (row .or. output .or. keeping)) return
    call observer%timer%stop(observer%phase())
    call velocities_now(system, instant%time, instant%kick, v)
    if (row) then
      call observer%timer%start('energies and history')
      call write_row(observer, system, instant, v, error)
      call observer%timer%stop('energies and history')
      if (allocated(error)) return
    end if
    if (output .or. keeping) call observer%team%pause()
    if (output) then
      call observer%timer%start('output')
      call write_output(observer, system, instant, v, error)
      ! a restarted run does not have the output that is written because the run stops
      ! what these look for may lie at other ranks' points
      if ((output_due .or. instant%last) .and. .not. observer%deal%needed) then
        call warn_if_any(observer, 'contact', contact_warning(system, instant%time))
        if (.not. observer%warnings%has('strain')) &
          & call warn_if_any(observer, 'strain', strain_warning(system, instant%time))
        if (.not. observer%warnings%has('large strain')) &
          & call warn_if_any(observer, 'large strain', large_strain_warning(system, instant%time))
      end if
      call observer%results%put_warnings(observer%warnings%text())
      call observer%timer%stop('output')
      if (allocated(error)) return
    end if
    if (keeping) call observer%keep_state(system, finished=.false.)
    call observer%timer%start(observer%phase())
    if (stopping) then
      call fail(error, reason_to_stop(observer%most_seconds, observer%wish)//' at '// &
      & place_of(instant, observer%schedule%relaxation)// &
        & ': this state is the last output'//way_on(observer), status_interrupted)
      error%everywhere = .true.
      error%elsewhere = .not. observer%deal%rows%on_first
    end if
  end subroutine observe

  !> Whether all ranks of a run stop at this step, or write a checkpoint, because one of them is
  !> asked to or finds that it is time. They tell each other every few steps.
  subroutine agree(system, step, stopping, keeping)
    type(system_type), intent(in) :: system
    integer, intent(in) :: step
    logical, intent(inout) :: stopping, keeping   !! of this rank, and then of all
    integer, parameter :: every = 8

    if (mod(step, every) == 0) then
      stopping = any_of_ranks(system%body%order, stopping)
      keeping = any_of_ranks(system%body%order, keeping)
    else
      stopping = .false.
      keeping = .false.
    end if
  end subroutine agree

  !> Count the load steps that the conjugate gradient leaves to dynamic relaxation, and say so at
  !> the first.
  subroutine note_giving_way(recorder, instant)
    class(recorder_type), intent(inout) :: recorder
    type(instant_type), intent(in) :: instant

    if (recorder%gave_way_at == instant%load_step) return
    recorder%gave_way_at = instant%load_step
    recorder%gave_way = recorder%gave_way + 1
    call recorder%warn('conjugate gradient', 'the conjugate gradient solver finds no static '// &
      & 'equilibrium in load step '//to_text(instant%load_step)//': dynamic relaxation '// &
      & 'continues from the present state')
  end subroutine note_giving_way

  !> Name of the motion in the table of times.
  pure function phase(self) result(name)
    class(recorder_type), intent(in) :: self  !! with its schedule
    character(:), allocatable :: name
    name = trim(merge('iterations   ', 'time stepping', self%schedule%relaxation))
  end function phase

  !> Whether the run has had the time that it was given.
  logical function time_is_over(recorder)
    class(recorder_type), intent(in) :: recorder
    time_is_over = .false.
    if (recorder%most_seconds > 0.0_wp) &
      & time_is_over = recorder%timer%total() >= recorder%most_seconds
  end function time_is_over

  !> The last good state of a diverged run becomes the last output, unless there is one of its step
  !> or a later one. Rows of the history extend to the failure.
  subroutine write_rescued(recorder, system, instant, error)
    class(recorder_type), intent(inout) :: recorder
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: v(:, :)
    character(:), allocatable :: state

    state = 'the last good state, of step '//to_text(instant%step)//' (t = '// &
      & to_text(instant%time)//'),'
    if (recorder%output_step > instant%step) then
      recorder%rescued = state//' is older than the last output, of step '// &
        & to_text(recorder%output_step)
      return
    end if
    if (recorder%output_step < instant%step .and. .not. recorder%deal%needed) then
      call velocities_now(system, instant%time, instant%kick, v)
      call write_output(recorder, system, instant, v, error)
      if (allocated(error)) return
      call warn_if_any(recorder, 'contact', contact_warning(system, instant%time))
      call recorder%results%put_warnings(recorder%warnings%text())
    end if
    recorder%rescued = state//' is the last output'
  end subroutine write_rescued

  !> A line with the command that continues a stopped run, if that is possible.
  function way_on(recorder) result(text)
    class(recorder_type), intent(in) :: recorder
    character(:), allocatable :: text

    text = ''
    if (recorder%command /= '') text = newline//'  to go on: '//recorder%command
  end function way_on

  !> Write a checkpoint. If that fails, the run continues and the previous one is kept.
  subroutine keep_state(recorder, system, finished)
    class(recorder_type), intent(inout) :: recorder
    type(system_type), intent(inout) :: system
    logical, intent(in) :: finished  !! the run has come to its end
    type(error_type), allocatable :: error
    character(:), allocatable :: scene_text

    call recorder%timer%start('checkpoints')
    associate (about => recorder%about)
      scene_text = about%kept%scene_text
      about%kept = recorder%results%kept(recorder%more_rows, recorder%more_outputs)
      about%kept%scene_text = scene_text
      about%step = recorder%steps_done
      about%time = recorder%time
      about%finished = finished
      about%supply = recorder%balance%supply
      about%kinetic = recorder%balance%energies%kinetic
      about%strain = recorder%balance%energies%strain
      about%warnings = recorder%warnings
      call recorder%results%sync(error)
      call recorder%checkpoint%write(about, system, recorder%measures, error)
    end associate
    call recorder%timer%stop('checkpoints')
    if (.not. allocated(error)) return
    call recorder%warn('checkpoint', 'no checkpoint of step '//to_text(recorder%steps_done)// &
      & ' could be written: '//error%message)
  end subroutine keep_state

  !> Note a warning unless it is ''.
  subroutine warn_if_any(recorder, subject, text)
    class(recorder_type), intent(inout) :: recorder
    character(*), intent(in) :: subject, text
    if (len(text) > 0) call recorder%warn(subject, text)
  end subroutine warn_if_any

  !> Note a warning; the first of a subject is printed at once.
  subroutine warn(recorder, subject, text)
    class(recorder_type), intent(inout) :: recorder
    character(*), intent(in) :: subject, text

    call recorder%progress%finish()
    call recorder%warnings%add(subject, text, tell=.not. recorder%quiet)
  end subroutine warn

  !> One row of the history.
  subroutine write_row(recorder, system, instant, v, error)
    class(recorder_type), intent(inout) :: recorder
    type(system_type), target, intent(inout) :: system
    type(instant_type), intent(in) :: instant
    real(wp), target, contiguous, intent(in) :: v(:, :)
    type(error_type), allocatable, intent(out) :: error
    type(row_source_type) :: now
    type(measure_list_type) :: apart
    real(wp), allocatable :: row(:)
    character(:), allocatable :: warning

    associate (balance => recorder%balance)
      call energies_of(system, v, balance%energies)
      call system%watch%check(instant%step, balance%energies%kinetic, balance%energies%strain, &
        & system%dissipated, system%external_work)
      if (recorder%rows == 0) call balance%begin(system)
      now%system => system
      now%v => v
      now%instant = instant
      now%energies = balance%energies
    end associate
    recorder%rows = recorder%rows + 1
    if (recorder%more_rows == 0) then
      call history_row(recorder%columns, now, recorder%measures, row)
    else
      ! a run that continues does not have this row: what goes from row to row does not see it
      apart = recorder%measures
      call history_row(recorder%columns, now, apart, row)
    end if
    call recorder%results%add_row(row, error)
    if (.not. (recorder%turned .or. recorder%deal%needed)) then
      warning = rotation_warning(system, instant%time)
      recorder%turned = len(warning) > 0
      call warn_if_any(recorder, 'rotation', warning)
    end if
    if (.not. allocated(error)) call check_strain_energy(system, recorder%balance%energies, &
      & instant%time, error)
  end subroutine write_row

  !> Deviation of the energies of the last row from the initial plus the supplied energy; a
  !> relaxation has no balance.
  pure subroutine energy_balance(recorder, system, balance, share, of_dissipated)
    class(recorder_type), intent(in) :: recorder
    type(system_type), intent(in) :: system
    real(wp), intent(out) :: balance  !! [J]
    real(wp), intent(out) :: share    !! of the energy in play [-], -1 where there is no balance
    real(wp), intent(out) :: of_dissipated
      !! share of the dissipated energy [-], -1 where that is no noticeable part of the energy

    balance = 0.0_wp
    share = -1.0_wp
    of_dissipated = -1.0_wp
    if (.not. recorder%schedule%relaxation) call recorder%balance%gap(system, balance, share, &
      & of_dissipated)
  end subroutine energy_balance

  !> One output of all fields, in point order.
  subroutine write_output(recorder, system, instant, v, error)
    class(recorder_type), intent(inout) :: recorder
    type(system_type), target, intent(inout) :: system
    type(instant_type), intent(in) :: instant
    real(wp), target, contiguous, intent(in) :: v(:, :)
    type(error_type), allocatable, intent(out) :: error
    type(moment_type) :: now
    real(wp), allocatable :: places(:, :), velocity(:, :)
    integer :: undefined

    now%system => system
    now%v => v
    call recorder%results%begin_output(instant%time, error)
    if (allocated(error)) return
    call write_fields(recorder%results, recorder%deal, recorder%fields, now, undefined, error)
    if (.not. allocated(error)) call write_profiles(recorder%results, recorder%profiles, now, error)
    if (allocated(error)) return
    if (recorder%surfaces%triangles%n_vertices > 0) then
      call recorder%surfaces%place(system, places, velocity)
      call recorder%results%put_surfaces(places, velocity, error)
      if (allocated(error)) return
    end if
    call warn_if_any(recorder, 'gradient', gradient_warning(undefined, instant%time))
    call recorder%results%end_output(error)
    if (recorder%fragments .and. .not. allocated(error)) &
      & call list_fragments(recorder, now, error)
    recorder%outputs = recorder%outputs + 1
    recorder%output_step = instant%step
  end subroutine write_output

  !> A line for each fragment.
  subroutine list_fragments(recorder, now, error)
    class(recorder_type), intent(inout) :: recorder
    type(moment_type), intent(in) :: now
    type(error_type), allocatable, intent(out) :: error
    type(fragment_type), allocatable :: fragments(:)
    real(wp), allocatable :: values(:, :)
    integer :: i

    call fragments_of(now, fragments)
    allocate (values(12, size(fragments)))
    do i = 1, size(fragments)
      associate (f => fragments(i))
        values(:, i) = [real(f%points, wp), f%mass, f%centre, f%velocity, f%spin, f%size]
      end associate
    end do
    call recorder%results%add_fragments(values, error)
  end subroutine list_fragments

end module pd_output_report_recorder
