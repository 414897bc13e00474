!> Writes what a run is asked to keep: outputs of fields, rows of history with energies, reactions
!> and probes, and the progress line.
module pd_output_report_recorder
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_clock, only: duration_text, phase_timer_type, progress_type
  use pd_base_error, only: error_type, fail, status_interrupted
  use pd_base_interrupt, only: interrupted
  use pd_base_numbers, only: pi
  use pd_base_reduce, only: largest_over
  use pd_body_body, only: gather
  use pd_base_threads, only: team_type
  use pd_base_warnings, only: warnings_type
  use pd_base_text, only: counted, newline, to_text
  use pd_family_family, only: bonds_type, allocate_bonds
  use pd_force_forces, only: energy_pass
  use pd_force_reference, only: point_dilatation, point_energy, reference_dilatation
  use pd_motion_watch_fault, only: check_strain_energy
  use pd_motion_observer, only: observer_type, instant_type
  use pd_motion_system, only: system_type, energies_type, energies_of, velocities_now
  use pd_output_checkpoint_checkpoint, only: about_type, checkpoint_type
  use pd_output_report_contact, only: touching_points
  use pd_output_results_results, only: results_type
  use pd_output_report_rotation, only: turned_part
  use pd_output_report_strain, only: find_large_strains, large_strain
  use pd_output_results_types, only: column_type, field_type
  implicit none (type, external)
  private
  public :: recorder_type, schedule_type, probe_type, field_of, check_fields, history_columns, &
    & history_row, planned_outputs, planned_rows, probe_values, velocities_now

  character(*), parameter :: xyz(3) = ['x', 'y', 'z']

  !> Rotations that the projected dilatation is told for: beyond 10 degrees it is off by 1.5 % and
  !> more. So large a share of the points must have turned: a few may turn at the tip of a crack.
  real(wp), parameter :: small_rotation = pi/18
  real(wp), parameter :: least_turned = 0.02_wp

  !> When to write.
  type :: schedule_type
    logical :: relaxation = .false.
    integer :: steps = 0                 !! explicit: steps of the run; relaxation: load steps
    integer :: every = 1                 !! outputs: steps or load steps
    real(wp) :: interval = 0.0_wp        !! outputs: time between them [s], if > 0 instead of every
    integer :: history_every = 1         !! rows: steps; relaxation: lines about iterations
    real(wp) :: tolerance = 0.0_wp       !! relaxation: of the residual [-]
  end type schedule_type

  !> A point whose values stand in every row of the history.
  type :: probe_type
    character(:), allocatable :: name
    integer(i4) :: slot = 0_i4
    type(field_type), allocatable :: fields(:)
  end type probe_type

  type, extends(observer_type) :: recorder_type
    type(results_type) :: results
    type(schedule_type) :: schedule
    type(field_type), allocatable :: fields(:)
    type(probe_type), allocatable :: probes(:)
    type(progress_type) :: progress
    type(phase_timer_type) :: timer
    type(team_type) :: team                  !! threads, whose number may change at any instant
    type(energies_type) :: energies          !! of the last row
    real(wp) :: supply = 0.0_wp              !! energy at the first row, with breaking at t = 0 [J]
    integer :: rows = 0
    integer :: outputs = 0
    integer :: output_step = -1              !! of the last output
    integer :: steps_done = 0
    integer :: first_step = 0                !! steps that were done before this start
    real(wp) :: time = 0.0_wp
    integer :: gave_way = 0                  !! load steps left to dynamic relaxation
    integer :: gave_way_at = 0               !! the last of them
    type(warnings_type) :: warnings
    logical :: turned = .false.              !! parts have turned, which was told
    logical :: quiet = .false.               !! warnings are kept, but not told
    type(checkpoint_type) :: checkpoint
    type(about_type) :: about                !! of the run, for its checkpoints
    integer :: more_rows = 0                 !! rows and outputs at the last instant that a run
    integer :: more_outputs = 0              !! which goes on would not have
    real(wp) :: most_seconds = 0.0_wp        !! wall time until the run stops by itself, if > 0 [s]
    character(:), allocatable :: command     !! goes on with the run
    character(:), allocatable :: rescued     !! what was saved of a motion that has gone wrong
  contains
    procedure :: observe
    procedure :: keep_state
    procedure :: warn
    procedure :: energy_balance
  end type recorder_type

contains

  !> A field by its name in the scene.
  pure type(field_type) function field_of(name) result(field)
    character(*), intent(in) :: name
    field%name = name
    select case (name)
    case ('displacement'); field%components = 3; field%unit = 'm'
    case ('velocity'); field%components = 3; field%unit = 'm/s'
    case ('force_density'); field%components = 3; field%unit = 'N/m3'
    case ('energy_density'); field%unit = 'J/m3'
    case default  ! damage, dilatation; check_fields refuses what is none
      field%unit = '1'
    end select
  end function field_of

  !> The columns of the history, in the order in which `observe` fills them.
  function history_columns(system, probes, relaxation) result(columns)
    type(system_type), intent(in) :: system
    type(probe_type), intent(in) :: probes(:)
    logical, intent(in) :: relaxation
    type(column_type), allocatable :: columns(:)
    integer :: m, c, p, f

    columns = [column_type('step', '1'), column_type('time', 's'), &
      & column_type('kinetic_energy', 'J'), column_type('strain_energy', 'J'), &
      & column_type('dissipated_energy', 'J'), &
      & column_type('external_work', 'J'), column_type('broken_bonds', '1'), &
      & column_type('maximum_damage', '1'), column_type('step_size', 's')]
    if (relaxation) columns = [columns, column_type('residual', '1'), column_type('load_step', '1')]
    do m = 1, size(system%motions)
      if (system%motions(m)%name == '') cycle
      do c = 1, system%body%dim
        columns = [columns, column_type(system%motions(m)%name//'_reaction_'//xyz(c), 'N')]
      end do
    end do
    do p = 1, size(probes)
      do f = 1, size(probes(p)%fields)
        associate (field => probes(p)%fields(f))
          if (field%components == 1) then
            columns = [columns, column_type(probes(p)%name//'_'//trim(field%name), field%unit)]
          else
            do c = 1, system%body%dim
              columns = [columns, column_type(probes(p)%name//'_'//trim(field%name)//'_'//xyz(c), &
                & field%unit)]
            end do
          end if
        end associate
      end do
    end do
  end function history_columns

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

  !> Intervals complete at a step, where a hair short of one counts as one. For steps that are not
  !> longer than the interval.
  pure integer(i8) function intervals(schedule, step, dt)
    type(schedule_type), intent(in) :: schedule
    integer, intent(in) :: step
    real(wp), intent(in) :: dt
    intervals = int(step*min(1.0_wp, dt/schedule%interval)*(1 + 1.0e-12_wp) + 1.0e-9_wp, i8)
  end function intervals

  !> Look at one instant: write what is due.
  subroutine observe(observer, system, instant, error)
    class(recorder_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(error_type), allocatable, intent(out) :: error
    logical :: row, output, row_due, output_due_now, may_stop, stopping, keeping
    real(wp), allocatable :: v(:, :)

    if (instant%rescued) then
      call write_rescued(observer, system, instant, error)
      return
    end if
    call observer%team%look()
    associate (schedule => observer%schedule)
      observer%steps_done = instant%step
      observer%time = instant%time
      if (schedule%relaxation) then
        row_due = instant%settled
        output_due_now = instant%settled .and. mod(instant%load_step, schedule%every) == 0
        call observer%progress%update(int(instant%load_step, i8) &
          & - merge(0_i8, 1_i8, instant%settled .or. instant%load_step == 0), instant%time, &
          & system%broken, relaxation_note(instant, schedule%tolerance))
      else
        row_due = mod(instant%step, schedule%history_every) == 0
        output_due_now = output_due(schedule, instant%step, instant%dt)
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
    stopping = may_stop .and. (interrupted() .or. time_is_over(observer))
    keeping = stopping .or. (may_stop .and. observer%checkpoint%is_due(instant%step))
    row = row_due .or. stopping .or. instant%last
    output = output_due_now .or. stopping .or. instant%last
    observer%more_rows = merge(1, 0, row .and. .not. row_due)
    observer%more_outputs = merge(1, 0, output .and. .not. output_due_now)
    if (.not. (row .or. output .or. keeping)) return
    call observer%timer%stop('time stepping')
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
      ! a run that goes on does not have the output that is written because it stops
      if (output_due_now .or. instant%last) then
        call warn_of_contact(observer, system, instant)
        call warn_of_strain(observer, system, instant)
      end if
      call observer%results%put_warnings(observer%warnings%text())
      call observer%timer%stop('output')
      if (allocated(error)) return
    end if
    if (keeping) call observer%keep_state(system, finished=.false.)
    call observer%timer%start('time stepping')
    if (stopping) call fail(error, reason_to_stop(observer)//' at '// &
      & place_of(instant, observer%schedule%relaxation)// &
      & ': this state is the last output'//newline//'  to go on: '//observer%command, &
      & status_interrupted)
  end subroutine observe

  !> Count the load steps that the conjugate gradient leaves to dynamic relaxation, and say so at
  !> the first.
  subroutine note_giving_way(recorder, instant)
    class(recorder_type), intent(inout) :: recorder
    type(instant_type), intent(in) :: instant

    if (recorder%gave_way_at == instant%load_step) return
    recorder%gave_way_at = instant%load_step
    recorder%gave_way = recorder%gave_way + 1
    call recorder%warn('conjugate gradient', 'the conjugate gradient finds no static '// &
      & 'equilibrium in load step '//to_text(instant%load_step)//': dynamic relaxation goes on '// &
      & 'from where it stands')
  end subroutine note_giving_way

  !> Whether the run has had the time that it was given.
  logical function time_is_over(recorder)
    class(recorder_type), intent(in) :: recorder
    time_is_over = .false.
    if (recorder%most_seconds > 0.0_wp) &
      & time_is_over = recorder%timer%total() >= recorder%most_seconds
  end function time_is_over

  !> The last good state of a motion that has gone wrong becomes the last output, unless there is
  !> one of its step or a later one. Rows of the history go on to the fault.
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
    if (recorder%output_step < instant%step) then
      call velocities_now(system, instant%time, instant%kick, v)
      call write_output(recorder, system, instant, v, error)
      if (allocated(error)) return
      call warn_of_contact(recorder, system, instant)
      call recorder%results%put_warnings(recorder%warnings%text())
    end if
    recorder%rescued = state//' is the last output'
  end subroutine write_rescued

  !> Why the run is to stop now, '' if it isn't.
  function reason_to_stop(recorder) result(reason)
    class(recorder_type), intent(in) :: recorder
    character(:), allocatable :: reason
    reason = 'interrupted'
    if (.not. interrupted()) reason = 'stopped after '//duration_text(recorder%most_seconds)// &
      & ', as asked for,'
  end function reason_to_stop

  !> Write a checkpoint. If that fails, the run goes on with the one before it.
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
      about%supply = recorder%supply
      about%kinetic = recorder%energies%kinetic
      about%strain = recorder%energies%strain
      about%warnings = recorder%warnings
      call recorder%results%sync(error)
      if (.not. allocated(error)) call recorder%checkpoint%write(about, system, error)
    end associate
    call recorder%timer%stop('checkpoints')
    if (.not. allocated(error)) return
    call recorder%warn('checkpoint', 'no checkpoint of step '//to_text(recorder%steps_done)// &
      & ' could be written: '//error%message)
  end subroutine keep_state

  !> Note a warning; the first of a subject is told at once.
  subroutine warn(recorder, subject, text)
    class(recorder_type), intent(inout) :: recorder
    character(*), intent(in) :: subject, text

    call recorder%progress%finish()
    call recorder%warnings%add(subject, text, tell=.not. recorder%quiet)
  end subroutine warn

  !> Whether `iterations.csv` has a line for this iteration: those that are due, and those whose
  !> residual meets the tolerance, so that the last one of a load step is among them.
  pure logical function iteration_due(schedule, instant) result(due)
    type(schedule_type), intent(in) :: schedule
    type(instant_type), intent(in) :: instant

    due = schedule%relaxation .and. .not. instant%settled
    if (due) due = mod(instant%step, schedule%history_every) == 0 .or. &
      & instant%residual <= schedule%tolerance
  end function iteration_due

  !> Where a run is, for a message: step and time, or iteration and load step.
  pure function place_of(instant, relaxation) result(text)
    type(instant_type), intent(in) :: instant
    logical, intent(in) :: relaxation
    character(:), allocatable :: text

    if (.not. relaxation) then
      text = 'step '//to_text(instant%step)//', t = '//to_text(instant%time)//' s'
    else if (instant%settled) then
      text = 'the end of load step '//to_text(instant%load_step)
    else
      text = 'iteration '//to_text(instant%iteration)//' of load step '// &
        & to_text(instant%load_step)//', which is not in equilibrium yet'
    end if
  end function place_of

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

  !> One row of the history.
  subroutine write_row(recorder, system, instant, v, error)
    class(recorder_type), intent(inout) :: recorder
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    real(wp), intent(in) :: v(:, :)
    type(error_type), allocatable, intent(out) :: error

    call energies_of(system, v, recorder%energies)
    call system%watch%look(instant%step, recorder%energies%kinetic, recorder%energies%strain, &
      & system%dissipated, system%external_work)
    if (recorder%rows == 0) recorder%supply = recorder%energies%kinetic + recorder%energies%strain &
      & + system%dissipated
    recorder%rows = recorder%rows + 1
    call recorder%results%add_row(history_row(system, recorder%probes, &
      & recorder%schedule%relaxation, instant, v, recorder%energies), error)
    call warn_of_rotation(recorder, system, instant)
    if (.not. allocated(error)) call check_strain_energy(system, recorder%energies, instant%time, &
      & error)
  end subroutine write_row

  !> The values of `history_columns` at an instant; `v` are the velocities and `energies` the
  !> energies then.
  function history_row(system, probes, relaxation, instant, v, energies) result(row)
    type(system_type), intent(in) :: system
    type(probe_type), intent(in) :: probes(:)
    logical, intent(in) :: relaxation
    type(instant_type), intent(in) :: instant
    real(wp), intent(in) :: v(:, :)
    type(energies_type), intent(in) :: energies
    real(wp), allocatable :: row(:)
    integer :: m, p, f

    row = [real(instant%step, wp), instant%time, energies%kinetic, energies%strain, &
      & system%dissipated, system%external_work, real(system%broken, wp), &
      & greatest_damage(system), instant%dt]
    if (relaxation) row = [row, instant%residual, real(instant%load_step, wp)]
    do m = 1, size(system%motions)
      if (system%motions(m)%name /= '') row = [row, system%motions(m)%reaction(:system%body%dim)]
    end do
    do p = 1, size(probes)
      do f = 1, size(probes(p)%fields)
        row = [row, probe_values(system, probes(p)%fields(f), int(probes(p)%slot), v)]
      end do
    end do
  end function history_row

  !> How far the energies of the last row are from what was there and has been supplied [J], and
  !> that as a share of the energy in play; the share is -1 where there is no balance.
  pure subroutine energy_balance(recorder, system, balance, share)
    class(recorder_type), intent(in) :: recorder
    type(system_type), intent(in) :: system
    real(wp), intent(out) :: balance, share
    real(wp) :: supply, largest

    balance = 0.0_wp
    share = -1.0_wp
    if (recorder%schedule%relaxation) return
    supply = recorder%supply + system%external_work
    associate (now => recorder%energies)
      balance = now%kinetic + now%strain + system%dissipated - supply
      largest = max(abs(now%kinetic) + abs(now%strain) + system%dissipated, abs(supply))
    end associate
    if (largest > 0.0_wp) share = abs(balance)/largest
  end subroutine energy_balance

  !> Greatest local damage of all points, 0 where nothing can be damaged.
  real(wp) function greatest_damage(system)
    type(system_type), intent(in) :: system
    greatest_damage = 0.0_wp
    if (size(system%state%damage) > 0) &
      & greatest_damage = largest_over(system%body%order, system%state%damage)
  end function greatest_damage

  !> A field at one slot: the components the dimension has, or one value.
  function probe_values(system, field, k, v) result(values)
    type(system_type), intent(in) :: system
    type(field_type), intent(in) :: field
    integer, intent(in) :: k
    real(wp), intent(in) :: v(:, :)
    real(wp), allocatable :: values(:)
    type(bonds_type) :: bonds

    select case (field%name)
    case ('displacement')
      values = system%state%u(k, :)
    case ('velocity')
      values = v(k, :)
    case ('force_density')
      values = system%state%force(k, :)
    case ('damage')
      values = [0.0_wp]
      if (size(system%state%damage) > 0) values = [system%state%damage(k)]
    case ('dilatation')
      call allocate_bonds(system%family, bonds)
      call system%family%bonds_of(k, bonds)
      values = [point_dilatation(system%model, system%state%u, k, bonds)]
    case ('energy_density')
      call allocate_bonds(system%family, bonds)
      call system%family%bonds_of(k, bonds)
      values = [point_energy(system%model, system%state%u, k, bonds)]
    case default
      ! check_fields has refused it
      values = [ieee_value(1.0_wp, ieee_quiet_nan)]
    end select
  end function probe_values

  !> An internal error if scenes may name a field that nobody computes.
  pure subroutine check_fields(fields, error)
    type(field_type), intent(in) :: fields(:)
    type(error_type), allocatable, intent(out) :: error
    integer :: f

    do f = 1, size(fields)
      select case (fields(f)%name)
      case ('displacement', 'velocity', 'force_density', 'damage', 'dilatation', 'energy_density')
        cycle
      case default
        call fail(error, "internal error: the field '"//trim(fields(f)%name)// &
          & "' is known by its name, but nothing computes it")
        return
      end select
    end do
  end subroutine check_fields

  !> One output of all fields, in point order.
  subroutine write_output(recorder, system, instant, v, error)
    class(recorder_type), intent(inout) :: recorder
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    real(wp), intent(in) :: v(:, :)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: values(:)
    integer :: f

    call recorder%results%begin_output(instant%time, error)
    if (allocated(error)) return
    do f = 1, size(recorder%fields)
      select case (recorder%fields(f)%name)
      case ('displacement')
        call put_vectors(system%state%u)
      case ('velocity')
        call put_vectors(v)
      case ('force_density')
        call put_vectors(system%state%force)
      case ('damage')
        if (size(system%state%damage) > 0) then
          call put_scalars(system%state%damage)
        else
          allocate (values(system%body%n_slots), source=0.0_wp)
          call put_scalars(values)
        end if
      case ('dilatation')
        allocate (values(system%body%n_slots))
        call reference_dilatation(system%family, system%model, system%state%u, values)
        call put_scalars(values)
      case ('energy_density')
        allocate (values(system%body%n_slots))
        call energy_pass(system%family, system%model, system%state%u, values)
        call put_scalars(values)
      case default
        call check_fields(recorder%fields(f:f), error)
      end select
      if (allocated(error)) return
      if (allocated(values)) deallocate (values)
    end do
    call recorder%results%end_output(error)
    recorder%outputs = recorder%outputs + 1
    recorder%output_step = instant%step

  contains

    subroutine put_vectors(of_slots)
      real(wp), intent(in) :: of_slots(:, :)
      real(wp), allocatable :: of_points(:, :)

      allocate (of_points(system%body%n_points, 3), source=0.0_wp)
      call gather(system%body, of_slots, of_points)
      call recorder%results%put_field(f, of_points, error)
    end subroutine put_vectors

    subroutine put_scalars(of_slots)
      real(wp), intent(in) :: of_slots(:)
      real(wp), allocatable :: of_points(:)

      allocate (of_points(system%body%n_points))
      call gather(system%body, of_slots, of_points)
      call recorder%results%put_field(f, of_points, error)
    end subroutine put_scalars
  end subroutine write_output

  !> Warn of points that pass through each other, which the method doesn't hinder.
  subroutine warn_of_contact(recorder, system, instant)
    class(recorder_type), intent(inout) :: recorder
    type(system_type), intent(in) :: system
    type(instant_type), intent(in) :: instant
    integer :: first, second

    call touching_points(system%body, system%family, system%state%u, first, second)
    if (first == 0) return
    call recorder%warn('contact', 'at t = '//to_text(instant%time)//' s points '// &
      & to_text(first)//' and '//to_text(second)// &
      & ', which share no intact bond, are closer than half a spacing: '// &
      & 'there is no contact, pieces pass through each other from here on')
  end subroutine warn_of_contact

  !> Where the dilatation is projected, tell that parts of the body have turned.
  subroutine warn_of_rotation(recorder, system, instant)
    class(recorder_type), intent(inout) :: recorder
    type(system_type), intent(in) :: system
    type(instant_type), intent(in) :: instant
    real(wp) :: share, largest

    associate (model => system%model)
      if (recorder%turned .or. .not. (model%dilatation .and. model%projected)) return
    end associate
    call turned_part(system%body, system%family, system%state%u, small_rotation, share, largest)
    recorder%turned = share > least_turned
    if (.not. recorder%turned) return
    call recorder%warn('rotation', 'at t = '//to_text(instant%time)//' s '// &
      & to_text(100*share, 2)//' % of the points are turned by more than 10 degrees, up to '// &
      & to_text(largest*180/pi, 3)//': the projected dilatation shrinks by the cosine of a '// &
      & "rotation, so forces and energies are off; &horizon dilatation = 'unprojected' has no "// &
      & 'such error')
  end subroutine warn_of_rotation
  !> Warn once of strains that are too large for a law that is linear in the stretch.
  subroutine warn_of_strain(recorder, system, instant)
    class(recorder_type), intent(inout) :: recorder
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    integer :: number, point
    real(wp) :: stretch

    if (recorder%warnings%has('strain')) return
    call find_large_strains(system, number, point, stretch)
    if (number == 0) return
    call recorder%warn('strain', 'at t = '//to_text(instant%time)//' s intact bonds of '// &
      & counted(number, 'point')//' are strained by more than '//to_text(nint(100*large_strain))// &
      & ' %, the most by '//to_text(100*stretch, 3)//' % (point '//to_text(point)// &
      & '): the material is linear in the strain and not meant for that')
  end subroutine warn_of_strain

end module pd_output_report_recorder
