!> The beginning of a run's output: the files, the history, the progress line and the checkpoints
!> that its scene asks for.
module pd_output_report_begin
  use pd_base_clock, only: output_is_terminal
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_text, only: to_text
  use pd_base_version, only: program_version
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: scene_type, is_set
  use pd_scene_content_write, only: scene_text
  use pd_body_body, only: body_type, gather
  use pd_set_up_conditions, only: region_mask
  use pd_set_up_plan, only: plan_type
  use pd_motion_system, only: system_type
  use pd_motion_explicit_time_step, only: evaluations
  use pd_output_checkpoint_checkpoint, only: checkpoint_path, new_about
  use pd_output_report_recorder, only: recorder_type, schedule_type, field_of, check_fields, &
    & history_columns, planned_outputs, planned_rows
  use pd_output_checkpoint_restart, only: restart_type
  use pd_output_results_types, only: kept_type
  implicit none (type, external)
  private
  public :: run_options_type, open_recorder, keep_checkpoints, schedule_of, check_schedule, &
    & history_interval, output_directory, stem_of, command_of, text_of

  !> How to run, from the command line.
  type :: run_options_type
    character(:), allocatable :: output_directory  !! '' = out/<stem of the scene file>
    character(:), allocatable :: command           !! as typed, kept in the results
    integer :: threads = 0                         !! 0 = as many as OpenMP offers
    logical :: overwrite = .false.
    logical :: restart = .false.                   !! go on from a checkpoint, if there is one
    character(:), allocatable :: checkpoint        !! its path; '' = the newest of the run
    real(wp) :: max_minutes = 0.0_wp               !! of wall time, then stop in order; 0 = no limit
    character(:), allocatable :: restart_command   !! goes on with the run, for messages
    logical :: quiet = .false.
  end type run_options_type

contains

  !> Files, history and progress of a run, whose probes the recorder has.
  subroutine open_recorder(scene, options, system, plan, directory, stem, restart, recorder, error)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    type(system_type), intent(in) :: system
    type(plan_type), intent(in) :: plan
    character(*), intent(in) :: directory, stem
    type(restart_type), intent(in) :: restart
    type(recorder_type), intent(inout) :: recorder
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: positions(:, :)
    type(kept_type), allocatable :: kept
    character(:), allocatable :: command
    integer :: f, c

    if (restart%found) kept = restart%about%kept
    associate (body => system%body, schedule => recorder%schedule)
      schedule = schedule_of(scene, plan, system%family%n_bonds)
      allocate (recorder%fields(size(scene%output%fields)))
      do f = 1, size(recorder%fields)
        recorder%fields(f) = field_of(trim(scene%output%fields(f)))
      end do
      call check_fields(recorder%fields, error)
      do f = 1, size(recorder%probes)
        if (allocated(error)) return
        call check_fields(recorder%probes(f)%fields, error)
      end do
      if (allocated(error)) return
      allocate (positions(body%n_points, 3), source=0.0_wp)
      do c = 1, body%dim
        call gather(body, body%x(:, c), positions(:, c))
      end do
      command = text_of(options%command)
      call recorder%results%create(directory, stem, positions, recorder%fields, &
        & planned_outputs(schedule, plan%step), &
        & history_columns(system, recorder%probes, plan%relaxes), planned_rows(schedule), &
        & trim(scene%output%precision), trim(scene%output%format), scene_text(scene), command, &
        & program_version, options%overwrite .or. options%restart, error, kept)
      if (allocated(error)) return
      if (.not. recorder%results%goes_on()) call put_points(scene, body, recorder, error)
      if (allocated(error)) return
      call recorder%progress%start(int(plan%steps, i8), output_is_terminal(), options%quiet, &
        & first_step=int(merge(system%memory%load_step, restart%about%step, plan%relaxes), &
        & i8), load=plan%relaxes)
    end associate
  end subroutine open_recorder

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

  !> An error if a run would write more outputs, or rows of its history, than anybody can look at:
  !> the results have room for all of them from the beginning.
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
      every = max(1, plan%steps/2000, ceiling(min(affordable, free)))
    end if
  end function history_interval

  !> The folder of the results: the one asked for, or out/ and the scene file's name.
  pure function output_directory(scene, options) result(directory)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    character(:), allocatable :: directory

    directory = 'out/'//stem_of(scene)
    if (.not. allocated(options%output_directory)) return
    if (options%output_directory /= '') directory = options%output_directory
  end function output_directory

  !> Let the recorder write checkpoints and know when to stop; after a restart it knows what it knew
  !> then.
  subroutine keep_checkpoints(scene, options, plan, start, directory, stem, restart, recorder)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    type(plan_type), intent(in) :: plan
    integer(i8), intent(in) :: start  !! checksum of the system before its first step
    character(*), intent(in) :: directory, stem
    type(restart_type), intent(in) :: restart
    type(recorder_type), intent(inout) :: recorder

    recorder%about = new_about(scene_text(scene), start, plan%steps, plan%step)
    recorder%command = command_of(options)
    recorder%quiet = options%quiet
    recorder%most_seconds = 60*options%max_minutes
    call recorder%checkpoint%start(checkpoint_path(directory, stem), &
      & scene%output%checkpoint_every, scene%output%checkpoint_minutes, goes_on=restart%found, &
      & keep_newest=restart%newest)
    if (.not. restart%found) return
    recorder%first_step = restart%about%step
    recorder%steps_done = restart%about%step
    recorder%time = restart%about%time
    recorder%rows = size(restart%about%kept%rows, 2)
    recorder%outputs = size(restart%about%kept%times)
    recorder%supply = restart%about%supply
    recorder%energies%kinetic = restart%about%kinetic
    recorder%energies%strain = restart%about%strain
    recorder%warnings = restart%about%warnings
  end subroutine keep_checkpoints

  !> The scene file's name without folder and ending.
  pure function stem_of(scene) result(stem)
    type(scene_type), intent(in) :: scene
    character(:), allocatable :: stem
    integer :: dot

    stem = 'scene'
    if (.not. allocated(scene%file)) return
    if (scene%file == '') return
    stem = scene%file(index(scene%file, '/', back=.true.) + 1:)
    dot = index(stem, '.', back=.true.)
    if (dot > 1) stem = stem(:dot - 1)
    ! a folder of dots would be another one
    if (verify(stem, '.') == 0) stem = 'scene'
  end function stem_of

  !> The command that goes on with a run.
  pure function command_of(options) result(text)
    type(run_options_type), intent(in) :: options
    character(:), allocatable :: text
    text = 'the same with --restart'
    if (allocated(options%restart_command)) text = options%restart_command
  end function command_of

  !> A text that may be missing.
  pure function text_of(text) result(known)
    character(:), allocatable, intent(in) :: text
    character(:), allocatable :: known
    known = ''
    if (allocated(text)) known = text
  end function text_of

  !> What each point is: volume, body, material, layer, regions.
  subroutine put_points(scene, body, recorder, error)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    type(recorder_type), intent(inout) :: recorder
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: volume(:)
    integer(i4), allocatable :: number(:)
    logical, allocatable :: of_points(:)
    integer :: r

    allocate (volume(body%n_points), number(body%n_points), of_points(body%n_points))
    call gather(body, body%volume, volume)
    call recorder%results%put_points('volume', volume, error)
    if (allocated(error)) return
    call gather(body, body%body, number)
    call recorder%results%put_points('body', number, error)
    if (allocated(error)) return
    call gather(body, body%material, number)
    call recorder%results%put_points('material', number, error)
    if (allocated(error)) return
    call gather(body, body%layer, number)
    call recorder%results%put_points('layer', number, error)
    do r = 1, size(scene%regions)
      if (allocated(error)) return
      call gather(body, region_mask(scene, body, trim(scene%regions(r)%name)), of_points)
      call recorder%results%put_points('region_'//trim(scene%regions(r)%name), &
        & merge(1_i1, 0_i1, of_points), error)
    end do
  end subroutine put_points

end module pd_output_report_begin
