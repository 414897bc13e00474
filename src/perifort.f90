!> The library's public face: build a scene in memory or read it from a file, check it, see what a
!> run would do, and run it.
!>
!>     use perifort, only: error_type, read_scene, run_options_type, run_scene, scene_type
!>     type(scene_type) :: scene
!>     type(run_options_type) :: options
!>     type(error_type), allocatable :: error
!>
!>     call read_scene('bar.nml', scene, error)
!>     if (.not. allocated(error)) call run_scene(scene, options, error)
!>     if (allocated(error)) print '(a)', error%message
!>
!> doc/library.md explains it, doc/examples has programs. Whatever is not named here is internal and
!> may change.
module perifort
  use pd_base_error, only: error_type, fail, status_input, status_interrupted, status_no_answer, &
    & status_usage
  use pd_base_kinds, only: wp
  use pd_base_version, only: program_version
  use pd_driver, only: run_scene
  use pd_motion_observer, only: instant_type, observer_type
  use pd_motion_account, only: energies_type
  use pd_motion_system, only: system_type
  use pd_motion_view, only: damage_of, displacements_of, find_energies, force_densities_of, &
    & number_of_points, point_near, positions_of, velocities_of, volumes_of
  use pd_force_term, only: force_term_type, term_view_type, has_tangent, no_stiffness, no_tangent
  use pd_force_terms, only: term_list_type
  use pd_law_law, only: bond_law_type, law_bonds_type, parameter_type
  use pd_law_laws, only: all_laws, law_table_type
  use pd_law_weighted, only: weighted_law_type
  use pd_output_fields_field, only: moment_type, output_field_type
  use pd_output_fields_table, only: all_fields, field_table_type
  use pd_output_report_begin, only: run_options_type
  use pd_output_results_answer, only: answer_type, values_type
  use pd_output_results_types, only: column_type, field_type, label_length
  use pd_preview, only: check_scene, preview_scene
  use pd_scene_content_read, only: read_scene, read_scene_text
  use pd_scene_content_groups, only: list_groups
  use pd_scene_content_types, only: body_group, boundary_group, crack_group, define_group, &
    & group_table, header_type, horizon_group, initial_group, is_set, load_group, material_group, &
    & name_length, no_fail_group, output_group, path_length, probe_group, region_group, &
    & relaxation_group, scene_type, shape_group, study_group, time_group, &
    & tip_group, unset
  use pd_scene_content_write, only: scene_text
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  ! errors and numbers
  public :: error_type, fail, status_input, status_usage, status_no_answer, status_interrupted
  public :: wp, program_version
  ! a scene: read it, fill it, complete and check it, write it
  public :: read_scene, read_scene_text, check_scene, scene_text
  public :: scene_type, header_type, define_group, body_group, shape_group, region_group, &
    & material_group, horizon_group, crack_group, no_fail_group, initial_group, boundary_group, &
    & load_group, time_group, relaxation_group, output_group, probe_group, tip_group, study_group
  public :: unset, is_set, name_length, path_length
  ! own groups
  public :: group_table, group_type, keys_type, list_groups
  ! a run
  public :: preview_scene, run_scene, run_options_type
  ! its results in memory
  public :: answer_type, column_type, field_type, values_type, label_length
  ! own observers, and what they can ask
  public :: observer_type, instant_type, system_type, energies_type
  public :: number_of_points, point_near, positions_of, volumes_of, displacements_of, &
    & velocities_of, force_densities_of, damage_of, find_energies
  ! own fields of the output
  public :: field_table_type, all_fields, output_field_type, moment_type
  ! own bond laws
  public :: bond_law_type, law_bonds_type, law_table_type, parameter_type, all_laws, &
    & weighted_law_type
  ! own terms of the force
  public :: force_term_type, term_list_type, term_view_type, has_tangent, no_stiffness, no_tangent

end module perifort
