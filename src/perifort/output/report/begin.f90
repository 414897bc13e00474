!> The beginning of a run's output: the files, the history, the progress line and the checkpoints
!> that its scene asks for.
module pd_output_report_begin
  use pd_base_clock, only: output_is_terminal
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_reduce, only: largest_of_ranks
  use pd_base_version, only: program_version
  use pd_body_refine, only: level_of
  use pd_scene_content_types, only: has_refinement, scene_type
  use pd_scene_content_write, only: scene_text
  use pd_body_body, only: body_type, gather
  use pd_body_regions, only: region_mask
  use pd_set_up_plan, only: plan_type
  use pd_force_generic_points, only: has_plasticity
  use pd_motion_system, only: system_type
  use pd_output_checkpoint_checkpoint, only: checkpoint_path, new_about, &
    & stem_of_part
  use pd_output_fields_table, only: all_fields, field_table_type
  use pd_output_measures_line, only: profiles_of
  use pd_output_results_cells, only: cells_of, cells_type
  use pd_output_report_columns, only: history_columns, history_table
  use pd_output_report_recorder, only: recorder_type
  use pd_output_report_schedule, only: planned_outputs, planned_rows, schedule_of
  use pd_output_checkpoint_restart, only: restart_type
  use pd_output_results_types, only: kept_type
  implicit none (type, external)
  private
  public :: run_options_type, open_recorder, keep_checkpoints, output_directory, stem_of, &
    & command_of, text_of, fields_of

  !> How to run, from the command line or from a program that uses the library.
  type :: run_options_type
    logical :: files = .true.                      !! .false.: nothing is written to the disk
    character(:), allocatable :: output_directory  !! '' = out/<stem of the scene file>
    character(:), allocatable :: command           !! as typed, kept in the results
    integer :: threads = 0                         !! 0 = as many as OpenMP offers
    logical :: overwrite = .false.                 !! replace results that are there
    logical :: restart = .false.                   !! continue from a checkpoint, if there is one
    character(:), allocatable :: checkpoint        !! its path; '' = the newest of the run
    real(wp) :: max_minutes = 0.0_wp               !! of wall time, then stop in order; 0 = no limit
    character(:), allocatable :: restart_command   !! continues the run, for messages
    logical :: quiet = .false.                     !! print nothing
    integer :: ranks = 0                           !! `preview_scene` shows how so many would share
                                                   !! the points; 0: none
    logical :: reproducible = .false.              !! forces do not depend on the number of ranks
    type(field_table_type), allocatable :: fields  !! that scenes may name; none = `all_fields`
  end type run_options_type

contains

  !> Files, history and progress of a run, whose measures the recorder has. With `in_memory` the
  !> last output stays in memory, too.
  subroutine open_recorder(scene, options, system, plan, directory, stem, restart, recorder, &
    & in_memory, error)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    type(system_type), intent(in) :: system
    type(plan_type), intent(in) :: plan
    character(*), intent(in) :: directory, stem
    type(restart_type), intent(in) :: restart
    type(recorder_type), intent(inout) :: recorder
    logical, intent(in) :: in_memory
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: positions(:, :), volume(:), values(:)
    type(cells_type), allocatable :: cells
    type(kept_type), allocatable :: kept
    type(field_table_type) :: table
    type(error_type), allocatable :: ignored
    character(:), allocatable :: command
    real(wp) :: low(3), high(3)
    integer :: f, c

    if (restart%found) kept = restart%about%kept
    associate (body => system%body, schedule => recorder%schedule)
      schedule = schedule_of(scene, plan, system%family%n_bonds)
      recorder%fragments = scene%output%fragments
      recorder%columns = history_table(plan%relaxes, has_plasticity(system%model))
      table = fields_of(options)
      allocate (recorder%fields(size(scene%output%fields)))
      do f = 1, size(recorder%fields)
        recorder%fields(f) = table%field(trim(scene%output%fields(f)))
      end do
      call profiles_of(scene, table, body, recorder%profiles)
      call recorder%deal%begin(body)
      allocate (positions(recorder%deal%rows%n, 3), source=0.0_wp)
      do c = 1, body%dim
        call collect(recorder, body, body%x(:, c), values)
        positions(:, c) = values
      end do
      if (scene%output%cells .and. directory /= '') then
        allocate (cells, volume(body%n_points))
        call gather(body, body%volume, volume)
        call cells_of(body%parts, positions, volume, cells)
      end if
      do c = 1, 3
        low(c) = -largest_of_ranks(body%order, -minval(positions(:, c)))
        high(c) = largest_of_ranks(body%order, maxval(positions(:, c)))
      end do
      call recorder%surfaces%begin(system, low, high)
      command = text_of(options%command)
      call recorder%results%create(directory, stem, positions, &
        & [(recorder%fields(f)%in_file(body%dim), f=1, size(recorder%fields))], &
        & planned_outputs(schedule, plan%step), &
        & history_columns(system, recorder%measures, plan%relaxes), planned_rows(schedule), &
        & trim(scene%output%precision), trim(scene%output%format), scene_text(scene), command, &
        & program_version, options%overwrite .or. options%restart, error, kept, &
        & [(recorder%profiles(f)%line, f=1, size(recorder%profiles))], cells, &
        & recorder%surfaces%triangles, recorder%deal%rows)
      if (allocated(error)) return
      if (in_memory) call recorder%results%keep_outputs(positions)
      if (.not. recorder%results%resumes()) call put_points(scene, body, recorder, error)
      if (.not. allocated(error)) call recorder%results%settle(error)
      if (allocated(error)) then
        call recorder%results%close(ignored)
        return
      end if
      call recorder%progress%start(int(plan%steps, i8), output_is_terminal(), options%quiet, &
        & first_step=int(merge(system%memory%load_step, restart%about%step, plan%relaxes), &
        & i8), load=plan%relaxes)
    end associate
  end subroutine open_recorder

  !> The folder of the results: the one asked for, or out/ and the scene file's name; '' if nothing
  !> is to be written.
  pure function output_directory(scene, options) result(directory)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    character(:), allocatable :: directory

    directory = ''
    if (.not. options%files) return
    directory = 'out/'//stem_of(scene)
    if (.not. allocated(options%output_directory)) return
    if (options%output_directory /= '') directory = options%output_directory
  end function output_directory

  !> Let the recorder write checkpoints and stop in time; after a restart it has the data that it
  !> had then.
  subroutine keep_checkpoints(scene, options, plan, start, points, directory, restart, recorder)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    type(plan_type), intent(in) :: plan
    integer(i8), intent(in) :: start  !! checksum of the system before its first step
    integer(i8), intent(in) :: points !! the same of all ranks
    character(*), intent(in) :: directory
    type(restart_type), intent(in) :: restart
    type(recorder_type), intent(inout) :: recorder
    character(:), allocatable :: path

    recorder%about = new_about(scene_text(scene), start, plan%steps, plan%step, restart%ranks, &
      & points)
    recorder%command = ''
    if (directory /= '') recorder%command = command_of(options)
    recorder%quiet = options%quiet
    recorder%most_seconds = 60*options%max_minutes
    path = ''
    if (directory /= '') path = checkpoint_path(directory, stem_of_part(stem_of(scene), &
      & restart%rank, restart%ranks))
    call recorder%checkpoint%start(directory, stem_of(scene), path, &
      & scene%output%checkpoint_every, scene%output%checkpoint_minutes, resumed=restart%found, &
      & keep_newest=restart%newest, removes=restart%rank == 0)
    if (.not. restart%found) return
    recorder%first_step = restart%about%step
    recorder%steps_done = restart%about%step
    recorder%time = restart%about%time
    recorder%rows = size(restart%about%kept%rows, 2)
    recorder%outputs = size(restart%about%kept%times)
    recorder%balance%supply = restart%about%supply
    recorder%balance%energies%kinetic = restart%about%kinetic
    recorder%balance%energies%strain = restart%about%strain
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

  !> The command that continues a run.
  pure function command_of(options) result(text)
    type(run_options_type), intent(in) :: options
    character(:), allocatable :: text
    text = 'the same with --restart'
    if (allocated(options%restart_command)) text = options%restart_command
  end function command_of

  !> The table of fields that scenes may name.
  type(field_table_type) function fields_of(options) result(table)
    type(run_options_type), intent(in) :: options

    if (allocated(options%fields)) then
      table = options%fields
    else
      table = all_fields()
    end if
  end function fields_of

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
    real(wp), allocatable :: values(:)
    integer :: r, k

    call collect(recorder, body, body%volume, values)
    call recorder%results%put_points('volume', values, error)
    if (allocated(error)) return
    call collect(recorder, body, real(body%body, wp), values)
    call recorder%results%put_points('body', nint(values, i4), error)
    if (allocated(error)) return
    call collect(recorder, body, real(body%material, wp), values)
    call recorder%results%put_points('material', nint(values, i4), error)
    if (allocated(error)) return
    call collect(recorder, body, real(body%layer, wp), values)
    call recorder%results%put_points('layer', nint(values, i4), error)
    if (allocated(error)) return
    if (has_refinement(scene)) then
      call collect(recorder, body, [(real(level_of(body, k), wp), k=1, body%n_slots)], values)
      call recorder%results%put_points('level', nint(values, i4), error)
    end if
    do r = 1, size(scene%regions)
      if (allocated(error)) return
      call collect(recorder, body, merge(1.0_wp, 0.0_wp, region_mask(scene, body, &
        & trim(scene%regions(r)%name))), values)
      call recorder%results%put_points('region_'//trim(scene%regions(r)%name), &
        & nint(values, i1), error)
    end do
  end subroutine put_points

  !> Values of slots as those of the rows that this rank writes.
  subroutine collect(recorder, body, of_slots, values)
    type(recorder_type), intent(in) :: recorder
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: of_slots(:)              !! (n_slots)
    real(wp), allocatable, intent(out) :: values(:)  !! (rows)
    real(wp), allocatable :: own(:)

    allocate (own(body%order%n_owned))
    call gather(body, of_slots, own)
    call recorder%deal%values_of_rows(body, own, values)
  end subroutine collect

end module pd_output_report_begin
