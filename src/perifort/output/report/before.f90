!> What is known of a run's output before its first step: its measures, whether the schedule fits the
!> run, warnings and notes.
module pd_output_report_before
  use pd_base_error, only: error_type
  use pd_output_fields_check, only: check_available, check_names
  use pd_output_fields_table, only: field_table_type
  use pd_output_measures_measure, only: measure_list_type
  use pd_output_measures_table, only: measures_of
  use pd_output_report_schedule, only: check_schedule
  use pd_output_report_warnings, only: note_before, warn_before
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: set_up_type
  implicit none (type, external)
  private
  public :: foresee_output

contains

  !> Check the schedule of the output and its fields, let the measures begin, and add warnings and
  !> notes to the set-up.
  subroutine foresee_output(scene, table, set_up, measures, error)
    type(scene_type), intent(in) :: scene
    type(field_table_type), intent(in) :: table        !! of the fields that the scene may name
    type(set_up_type), intent(inout) :: set_up         !! of the scene; gets warnings and notes
    type(measure_list_type), intent(out) :: measures   !! of the history, begun on return
    type(error_type), allocatable, intent(out) :: error

    associate (system => set_up%system, plan => set_up%plan)
      call check_schedule(scene, plan, system%family%n_bonds, error)
      if (allocated(error)) return
      call check_names(scene, table, error)
      if (.not. allocated(error)) call check_available(scene, system, table, error)
      if (allocated(error)) return
      call measures_of(scene, table, measures)
      call measures%begin(scene, system, error)
      if (allocated(error)) return
      call warn_before(scene, system, plan, measures, set_up%isolated, set_up%warnings)
      call note_before(scene, system, set_up%notes)
    end associate
  end subroutine foresee_output

end module pd_output_report_before
