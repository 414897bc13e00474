!> What is known of a scene before it runs: whether it keeps the rules, and what a run would do,
!> which `perifort check` prints.
module pd_preview
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_clock, only: output_is_terminal
  use pd_base_error, only: error_type
  use pd_base_kinds, only: i8
  use pd_base_text, only: labelled_line, newline
  use pd_output_checkpoint_checkpoint, only: about_type, checkpoint_bytes, new_about
  use pd_output_fields_check, only: check_names
  use pd_output_fields_table, only: field_table_type
  use pd_output_report_before, only: foresee_output
  use pd_output_report_begin, only: fields_of, run_options_type, stem_of
  use pd_output_report_columns, only: history_columns
  use pd_output_report_estimate, only: estimate
  use pd_output_report_overview, only: overview
  use pd_output_measures_measure, only: measure_list_type
  use pd_output_report_ranks, only: table_of_ranks
  use pd_output_report_schedule, only: planned_outputs, planned_rows, schedule_of, schedule_type
  use pd_output_report_say, only: say
  use pd_output_report_summary, only: checkpoint_line, summary_before
  use pd_output_results_description, only: names_of_files
  use pd_output_results_types, only: field_type
  use pd_scene_content_complete, only: complete_scene
  use pd_scene_content_types, only: scene_type
  use pd_scene_content_write, only: scene_text
  use pd_set_up_move, only: take_all_memory
  use pd_set_up_prepare, only: prepare, set_up_type
  use pd_set_up_ranks, only: check_ranks
  implicit none (type, external)
  private
  public :: check_scene, preview_scene

contains

  !> Complete a scene in place, and hold it to every rule that needs no points: those of a scene
  !> file, and the names of fields.
  subroutine check_scene(scene, error, fields)
    type(scene_type), intent(inout) :: scene             !! built or changed in memory, or read
    type(error_type), allocatable, intent(out) :: error  !! the broken rule; the scene is as it was
    type(field_table_type), intent(in), optional :: fields  !! that it may name; none: `all_fields`
    type(scene_type) :: complete
    type(run_options_type) :: options

    if (present(fields)) options%fields = fields
    complete = scene
    call complete_scene(complete, error)
    if (.not. allocated(error)) call check_names(complete, fields_of(options), error)
    if (.not. allocated(error)) scene = complete
  end subroutine check_scene

  !> Check a scene, build points and families, and say what a run would do: size, forces, time step,
  !> warnings, predicted duration. No files are written. The caller's number of threads is as it was
  !> thereafter.
  subroutine preview_scene(scene, options, error, text)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options               !! `threads` and `quiet` count
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable, intent(out), optional :: text    !! what is printed
    type(scene_type) :: complete
    character(:), allocatable :: all
    integer :: threads

    complete = scene
    call complete_scene(complete, error)
    if (allocated(error)) return
    threads = omp_get_max_threads()
    call examine(complete, options, error, all)
    call omp_set_num_threads(threads)
    if (present(text)) text = all
  end subroutine preview_scene

  !> `preview_scene` of a complete scene with threads of its own number.
  subroutine examine(scene, options, error, text)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable, intent(out) :: text
    type(set_up_type) :: set_up
    type(measure_list_type) :: measures
    character(:), allocatable :: times

    text = ''
    call check_names(scene, fields_of(options), error)
    if (.not. allocated(error) .and. options%ranks > 1) call check_ranks(scene, error)
    if (.not. allocated(error)) call prepare(scene, set_up, error, options%threads, &
      & quiet=.not. output_is_terminal())
    if (allocated(error)) return
    call foresee_output(scene, fields_of(options), set_up, measures, error)
    if (allocated(error)) return
    associate (system => set_up%system, plan => set_up%plan)
      call tell(summary_before(scene, system, plan, measures, set_up%cut, &
        & set_up%warnings, set_up%notes, set_up%team%threads()))
      call tell_lines(overview(scene, system, .not. plan%relaxes))
      if (options%ranks > 0) call tell_lines(table_of_ranks(scene, system%body, &
        & system%family, options%ranks))
      call estimate(scene, fields_of(options), system, plan, &
        & schedule_of(scene, plan, system%family%n_bonds), set_up%timer%total(), times)
      call tell_lines(times)
      call tell_lines(labelled_line('files', trim(files(scene, fields_of(options), set_up))))
      call tell(checkpoint_line(scene, bytes_of_checkpoint(scene, set_up, measures)))
    end associate

  contains

    !> Print a part as soon as it is known, and keep it.
    subroutine tell(part)
      character(*), intent(in) :: part
      call say(part, options%quiet)
      text = text//part//newline
    end subroutine tell

    !> The same for lines that end with a newline.
    subroutine tell_lines(lines)
      character(*), intent(in) :: lines
      if (len(lines) > 0) call tell(lines(:len(lines) - 1))
    end subroutine tell_lines
  end subroutine examine

  !> Names of the files that the run will write.
  function files(scene, table, set_up) result(text)
    type(scene_type), intent(in) :: scene
    type(field_table_type), intent(in) :: table
    type(set_up_type), intent(in) :: set_up
    character(:), allocatable :: text
    type(field_type), allocatable :: fields(:)
    integer :: f

    associate (system => set_up%system, plan => set_up%plan)
      allocate (fields(size(scene%output%fields)))
      do f = 1, size(fields)
        associate (field => table%field(trim(scene%output%fields(f))))
          fields(f) = field%in_file(system%body%dim)
        end associate
      end do
      text = names_of_files(stem_of(scene), trim(scene%output%format), fields, &
        & planned_outputs(schedule_of(scene, plan, system%family%n_bonds), plan%step))
    end associate
  end function files

  !> Bytes of the last checkpoint of a run, which has all that it carries, or of a relaxation's
  !> largest.
  integer(i8) function bytes_of_checkpoint(scene, set_up, measures) result(bytes)
    type(scene_type), intent(in) :: scene
    type(set_up_type), intent(inout) :: set_up
    type(measure_list_type), intent(inout) :: measures  !! unchanged
    type(about_type) :: about
    type(schedule_type) :: schedule
    integer :: columns

    associate (system => set_up%system, plan => set_up%plan)
      schedule = schedule_of(scene, plan, system%family%n_bonds)
      about = new_about(scene_text(scene), 0_i8, plan%steps, plan%step)
      columns = size(history_columns(system, measures, plan%relaxes))
      allocate (about%kept%rows(columns, 0), about%kept%times(0))
      call take_all_memory(system, plan)
      ! rows and times are counted and not made: a long run may have more than fit into the memory
      bytes = checkpoint_bytes(about, system, measures) + 8*(int(columns, i8) &
        & *planned_rows(schedule) + planned_outputs(schedule, plan%step))
    end associate
  end function bytes_of_checkpoint

end module pd_preview
