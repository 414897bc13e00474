!> One run of a study: a scene computed in memory, measured and timed. No files are written.
module pd_study_trade_trial
  use pd_base_clock, only: progress_type, wall_time
  use pd_base_error, only: error_type, fail, internal_fault, status_interrupted
  use pd_base_interrupt, only: interrupted
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_numbers, only: median
  use pd_base_text, only: to_text
  use pd_set_up_prepare, only: prepare, set_up_type
  use pd_force_generic_points, only: has_plasticity
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_body_regions, only: region_mask
  use pd_output_fields_check, only: check_available, check_names
  use pd_output_fields_table, only: field_table_type
  use pd_output_report_columns, only: history_columns, history_row, history_table, &
    & history_table_type
  use pd_output_measures_measure, only: measure_list_type, row_source_type
  use pd_output_measures_probe, only: nearest_slot
  use pd_output_measures_table, only: measures_of
  use pd_output_report_schedule, only: history_interval
  use pd_motion_observer, only: instant_type, observer_type
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_motion_account, only: energies_of, energies_type, velocities_now
  use pd_motion_system, only: system_type
  use pd_output_report_summary, only: memory_of
  use pd_output_results_types, only: column_type
  use pd_scene_content_types, only: scene_type
  use pd_study_trade_closed_form, only: closed_form_type
  use pd_study_trade_analytic, only: complete_form
  use pd_study_trade_measure, only: measure_type, of_column, of_field, of_probe, record_type, &
    & value_of
  implicit none (type, external)
  private
  public :: outcome_type, run_trial, check_trial

  !> What a run came to.
  type :: outcome_type
    logical :: done = .false.
    character(:), allocatable :: fault         !! why it has no answer
    real(wp) :: value = 0.0_wp                 !! what was measured
    real(wp) :: error = 0.0_wp                 !! in the norm of the study
    logical :: judged = .false.                !! the error is known
    real(wp) :: true_error = 0.0_wp            !! extrapolated from errors against the finest run
    logical :: extrapolated = .false.          !! the true error is known
    logical :: truth = .false.                 !! it is what the others are compared with
    real(wp) :: seconds = 0.0_wp               !! set-up and steps, without measuring; the median
    integer :: repeats = 0
    integer(i8) :: points = 0_i8, bonds = 0_i8, bytes = 0_i8
    integer :: steps = 0                       !! iterations in relaxation
    real(wp) :: energy_drift = 0.0_wp          !! largest gap of the balance over largest energy
    real(wp) :: spacing = 0.0_wp               !! largest [m]
    real(wp) :: step = 0.0_wp                  !! of time [s]; 0 in relaxation
    logical :: pareto = .false.
  end type outcome_type

  !> Records the measured quantity and the energy balance.
  type, extends(observer_type) :: watcher_type
    type(measure_type) :: measure
    type(record_type) :: record
    type(measure_list_type) :: measures        !! of the history
    integer, allocatable :: slots(:)           !! of the places
    type(history_table_type) :: columns        !! of the history
    integer :: column = 0                      !! among them
    integer :: every = 1
    logical :: relaxation = .false.
    integer :: steps = 0
    real(wp) :: spent = 0.0_wp                 !! measuring [s]
    integer :: rows = 0
    real(wp) :: supply = 0.0_wp                !! energy at the start [J]
    real(wp) :: gap = 0.0_wp, largest = 0.0_wp !! of the balance [J]
    logical :: quick = .false.                 !! a repeat for the time alone
    type(progress_type) :: progress
  contains
    procedure :: observe
  end type watcher_type

  integer, parameter :: most_repeats = 5
  real(wp), parameter :: long_enough = 1.0_wp  !! all repeats together [s]

contains

  !> Run a scene and record the measured quantity. Runs are repeated until there are five or they
  !> have taken a second. `around`: of a probe all points so near are kept [m], 0 for the nearest
  !> alone. `form` gets what only the points tell of it. An error that ends a run without an answer
  !> is kept in `outcome`; others, and interrupts, in `error`.
  subroutine run_trial(scene, table, measure, around, terminal, form, outcome, record, error)
    type(scene_type), intent(in) :: scene       !! a checked scene
    type(field_table_type), intent(in) :: table  !! of the fields that the scene may name
    type(measure_type), intent(in) :: measure   !! what is kept
    real(wp), intent(in) :: around              !! [m]; counts for probes only
    logical, intent(in) :: terminal            !! show the progress of the steps
    type(closed_form_type), allocatable, intent(inout) :: form
      !! what is compared with, completed on return; not allocated: none
    type(outcome_type), intent(out) :: outcome  !! what the run came to
    type(record_type), intent(out) :: record    !! what was measured, as far as the run went
    type(error_type), allocatable, intent(out) :: error
    type(watcher_type) :: watcher
    type(error_type), allocatable :: fault
    real(wp) :: seconds(most_repeats)
    integer :: r

    do r = 1, most_repeats
      call run_once(scene, table, measure, merge(around, -1.0_wp, r == 1), &
        & terminal .and. r == 1, form, watcher, seconds(r), outcome, fault, error)
      if (allocated(error)) return
      if (r == 1) record = watcher%record
      if (r == 1 .and. .not. allocated(fault)) outcome%value = value_of(record)
      outcome%repeats = r
      outcome%seconds = median(seconds(:r))
      if (allocated(fault)) then
        outcome%fault = fault%message
        return
      end if
      if (sum(seconds(:r)) > long_enough) exit
    end do
    outcome%done = .true.
  end subroutine run_trial

  !> Set a scene up as `run_trial` does, without running it: an error if that is not possible, if
  !> what is measured is not there, or if the closed form does not hold for the points. The largest
  !> frequency of `limit = 'spectral'` is not measured.
  subroutine check_trial(scene, table, measure, form, error)
    type(scene_type), intent(in) :: scene        !! a checked scene
    type(field_table_type), intent(in) :: table  !! of the fields that the scene may name
    type(measure_type), intent(in) :: measure    !! what a run would keep
    type(closed_form_type), allocatable, intent(inout) :: form
      !! what is compared with, completed on return; not allocated: none
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: checked
    type(set_up_type) :: set_up
    type(watcher_type) :: watcher
    type(outcome_type) :: outcome

    checked = scene
    checked%time%limit = 'equation'
    call prepare(checked, set_up, error)
    if (.not. allocated(error)) call begin_watch(checked, table, measure, 0.0_wp, set_up, form, &
      & watcher, outcome, error)
  end subroutine check_trial

  !> What is measured in a scene that is set up, its size and its closed form, before the first
  !> step.
  subroutine begin_watch(scene, table, measure, around, set_up, form, watcher, outcome, error)
    type(scene_type), intent(in) :: scene
    type(field_table_type), intent(in) :: table
    type(measure_type), intent(in) :: measure
    real(wp), intent(in) :: around             !! as in `run_trial` [m]; below 0 for the time alone
    type(set_up_type), intent(in) :: set_up
    type(closed_form_type), allocatable, intent(inout) :: form
    type(watcher_type), intent(inout) :: watcher
    type(outcome_type), intent(inout) :: outcome
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: reason

    watcher%measure = measure
    watcher%quick = around < 0.0_wp
    watcher%relaxation = set_up%plan%relaxes
    watcher%columns = history_table(watcher%relaxation, &
      & has_plasticity(set_up%system%model))
    watcher%every = history_interval(scene, set_up%plan, set_up%system%family%n_bonds)
    call check_names(scene, table, error)
    if (allocated(error) .or. watcher%quick) return
    call check_available(scene, set_up%system, table, error)
    if (allocated(error)) return
    call measures_of(scene, table, watcher%measures)
    call watcher%measures%begin(scene, set_up%system, error)
    if (allocated(error)) return
    if (measure%kind /= of_column) then
      reason = measure%field%missing(set_up%system)
      if (len(reason) > 0) call fail(error, "this scene has no field '"// &
        & trim(measure%field%name)//"': "//reason)
      if (allocated(error)) return
    end if
    call choose_places(scene, set_up%system, around, watcher, error)
    if (allocated(error)) return
    call note_costs(set_up%system, set_up%plan%step, outcome)
    if (.not. allocated(form)) return
    call complete_form(scene, set_up%system, set_up%plan%steps*set_up%plan%step, form, reason)
    if (len(reason) > 0) call fail(error, reason)
  end subroutine begin_watch

  !> One repeat; with `around` < 0 nothing but the time is wanted.
  subroutine run_once(scene, table, measure, around, terminal, form, watcher, seconds, outcome, &
      & fault, error)
    type(scene_type), intent(in) :: scene
    type(field_table_type), intent(in) :: table
    type(measure_type), intent(in) :: measure
    real(wp), intent(in) :: around
    logical, intent(in) :: terminal
    type(closed_form_type), allocatable, intent(inout) :: form
    type(watcher_type), intent(out) :: watcher
    real(wp), intent(out) :: seconds
    type(outcome_type), intent(inout) :: outcome
    type(error_type), allocatable, intent(out) :: fault, error
    type(set_up_type) :: set_up
    real(wp) :: begin, lost

    begin = wall_time()
    seconds = 0.0_wp
    call prepare(scene, set_up, error)
    if (allocated(error)) return
    lost = wall_time()
    call begin_watch(scene, table, measure, around, set_up, form, watcher, outcome, error)
    if (allocated(error)) return
    associate (system => set_up%system, plan => set_up%plan)
      ! one more than there are, since the last step would be shown of runs of any length
      call watcher%progress%start(plan%steps + 1_i8, terminal, .not. terminal, load=plan%relaxes)
      lost = wall_time() - lost
      if (plan%relaxes) then
        call run_relaxation(system, plan%relaxation, watcher, fault)
      else
        call run_explicit(system, plan%integrator, plan%step, plan%steps, watcher, fault)
      end if
    end associate
    seconds = wall_time() - begin - lost - watcher%spent
    call watcher%progress%finish()
    if (allocated(fault)) then
      if (fault%status == status_interrupted) call move_alloc(fault, error)
    end if
    if (watcher%quick) return
    outcome%steps = watcher%steps
    outcome%energy_drift = watcher%gap/max(watcher%largest, tiny(1.0_wp))
    call cut_rows(watcher%record)
  end subroutine run_once

  !> Size and memory of a run, before its first step.
  subroutine note_costs(system, step, outcome)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: step
    type(outcome_type), intent(inout) :: outcome
    outcome%points = system%body%n_points
    outcome%bonds = system%family%n_bonds
    outcome%bytes = memory_of(system)
    outcome%spacing = maxval(system%body%spacing, mask=system%body%point > 0)
    outcome%step = step
  end subroutine note_costs

  !> Where is measured, and room for it.
  subroutine choose_places(scene, system, around, watcher, error)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: around
    type(watcher_type), intent(inout) :: watcher
    type(error_type), allocatable, intent(out) :: error
    type(column_type), allocatable :: columns(:)
    logical, allocatable :: chosen(:)
    real(wp) :: distance
    integer(i4) :: probe
    integer :: k, dim

    dim = system%body%dim
    allocate (chosen(system%body%n_slots), source=.false.)
    associate (measure => watcher%measure, body => system%body)
      select case (measure%kind)
      case (of_probe)
        probe = nearest_slot(body, scene%probes(measure%probe)%point)
        chosen(probe) = .true.
        do k = 1, merge(body%n_slots, 0, around > 0.0_wp)
          distance = norm2(body%x(k, :) - scene%probes(measure%probe)%point(:dim))
          chosen(k) = chosen(k) .or. body%point(k) > 0 .and. distance <= around
        end do
      case (of_field)
        chosen = body%point > 0 .and. body%layer == 0
        if (measure%region /= '') chosen = chosen .and. region_mask(scene, body, measure%region)
        if (.not. any(chosen)) call fail(error, "the region '"//measure%region//"' has no points")
      case (of_column)
        columns = history_columns(system, watcher%measures, watcher%relaxation)
        do k = 1, size(columns)
          if (columns(k)%name == measure%name) watcher%column = k
        end do
        if (watcher%column == 0) call fail(error, "the history has no column '"//measure%name//"'")
      case default
        call internal_fault('unknown kind of a measure')
      end select
      if (allocated(error)) return
      watcher%slots = pack([(k, k=1, body%n_slots)], chosen)
      associate (record => watcher%record)
        record%x = transpose(body%x(watcher%slots, :))
        record%weight = [1.0_wp]
        select case (measure%kind)
        case (of_field)
          record%weight = body%volume(watcher%slots)
          record%place = 0
        case (of_probe)
          record%place = findloc(watcher%slots, int(probe), dim=1)
        case (of_column)
          record%place = 1
        case default
          call internal_fault('unknown kind of a measure')
        end select
        record%spacing = maxval(body%spacing, mask=body%point > 0)
        k = 1
        if (measure%kind /= of_column) k = merge(1, measure%field%components(dim), &
          & measure%component > 0)
        allocate (record%values(k, max(1, size(watcher%slots)), 1), record%time(1), source=0.0_wp)
      end associate
    end associate
  end subroutine choose_places

  !> The progress, and on rows what is measured and the balance. An error, of an interrupted run, if
  !> the user has asked to stop.
  subroutine observe(observer, system, instant, error)
    class(watcher_type), intent(inout) :: observer  !! keeps what is measured, and the balance
    type(system_type), intent(inout) :: system      !! at this instant
    type(instant_type), intent(in) :: instant       !! step and time of the run
    type(error_type), allocatable, intent(out) :: error
    type(energies_type) :: energies
    real(wp), allocatable :: v(:, :)
    real(wp) :: begin
    logical :: row

    observer%steps = instant%step
    if (interrupted()) then
      call fail(error, 'interrupted', status_interrupted)
      return
    end if
    if (observer%relaxation) then
      row = instant%settled
      call observer%progress%update(int(instant%load_step, i8) &
        & - merge(0_i8, 1_i8, instant%settled .or. instant%load_step == 0), instant%time, &
        & system%broken)
    else
      row = instant%last .or. mod(instant%step, observer%every) == 0
      call observer%progress%update(int(instant%step, i8), instant%time, system%broken)
    end if
    if (.not. row .or. observer%quick) return
    begin = wall_time()
    call velocities_now(system, instant%time, instant%kick, v)
    call energies_of(system, v, energies)
    call balance(observer, system, energies)
    if (observer%measure%kind == of_field) then
      if (instant%last) call keep(observer, system, instant, v, energies)
    else if (.not. observer%relaxation .or. instant%load_step > 0) then
      call keep(observer, system, instant, v, energies)
    end if
    observer%spent = observer%spent + (wall_time() - begin)
  end subroutine observe

  !> The difference between the energy and the supplied energy.
  subroutine balance(watcher, system, energies)
    class(watcher_type), intent(inout) :: watcher
    type(system_type), intent(in) :: system
    type(energies_type), intent(in) :: energies
    real(wp) :: stored

    stored = energies%kinetic + energies%strain + system%dissipated
    if (watcher%rows == 0) watcher%supply = stored - system%external_work
    watcher%rows = watcher%rows + 1
    watcher%gap = max(watcher%gap, abs(stored - watcher%supply - system%external_work))
    watcher%largest = max(watcher%largest, abs(stored), abs(system%external_work))
  end subroutine balance

  !> One row of the measured quantity.
  subroutine keep(watcher, system, instant, v, energies)
    class(watcher_type), intent(inout) :: watcher
    type(system_type), target, intent(inout) :: system
    type(instant_type), intent(in) :: instant
    real(wp), target, contiguous, intent(in) :: v(:, :)
    type(energies_type), intent(in) :: energies
    type(row_source_type) :: now
    real(wp), allocatable :: row(:), values(:, :)

    associate (record => watcher%record, measure => watcher%measure)
      if (record%rows == size(record%time)) call double_rows(record)
      record%rows = record%rows + 1
      record%time(record%rows) = instant%time
      now%system => system
      now%v => v
      if (measure%kind == of_column) then
        now%instant = instant
        now%energies = energies
        call history_row(watcher%columns, now, watcher%measures, row)
        record%values(1, 1, record%rows) = row(watcher%column)
        return
      end if
      allocate (values(measure%field%components(system%body%dim), size(watcher%slots)))
      call measure%field%values_at(now%moment_type, watcher%slots, values)
      if (measure%component > 0) then
        record%values(1, :, record%rows) = values(measure%component, :)
      else
        record%values(:, :, record%rows) = values
      end if
    end associate
  end subroutine keep

  !> Room for twice as many rows.
  subroutine double_rows(record)
    type(record_type), intent(inout) :: record
    real(wp), allocatable :: values(:, :, :)
    integer :: n

    n = record%rows
    record%time = [record%time, record%time]
    allocate (values(size(record%values, 1), size(record%values, 2), 2*n))
    values(:, :, :n) = record%values
    call move_alloc(values, record%values)
  end subroutine double_rows

  !> No more room than rows.
  subroutine cut_rows(record)
    type(record_type), intent(inout) :: record
    if (.not. allocated(record%time)) return
    record%time = record%time(:record%rows)
    record%values = record%values(:, :, :record%rows)
  end subroutine cut_rows

end module pd_study_trade_trial
