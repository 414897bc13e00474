!> The kinds of measures: what a scene's history has besides the columns of every run.
module pd_output_measures_table
  use pd_output_fields_table, only: field_table_type
  use pd_output_measures_boundary, only: add_boundaries
  use pd_output_measures_contact, only: add_contacts
  use pd_output_measures_fragments, only: add_fragments
  use pd_output_measures_j_integral, only: add_j_integrals
  use pd_output_measures_measure, only: measure_list_type
  use pd_output_measures_probe, only: add_probes
  use pd_output_measures_rigid, only: add_rigids
  use pd_output_measures_section, only: add_sections
  use pd_output_measures_tip, only: add_tips
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: measures_of

contains

  !> The measures of a scene, in the order of their columns. A kind joins with a line here.
  subroutine measures_of(scene, table, measures)
    type(scene_type), intent(in) :: scene                !! a checked scene, whose fields are known
    type(field_table_type), intent(in) :: table          !! of fields
    type(measure_list_type), intent(out) :: measures     !! not begun yet

    allocate (measures%items(0))
    call add_contacts(scene, measures)
    call add_rigids(scene, measures)
    call add_fragments(scene, measures)
    call add_boundaries(scene, measures)
    call add_probes(scene, table, measures)
    call add_tips(scene, measures)
    call add_sections(scene, measures)
    call add_j_integrals(scene, measures)
  end subroutine measures_of

end module pd_output_measures_table
