!> The library's public face: build a scene in memory or read it from a file, then check or run it.
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
!> Whatever is not named here is internal and may change.
module perifort
  use pd_base_error, only: error_type, status_input, status_interrupted, status_no_answer, &
    & status_usage
  use pd_base_kinds, only: wp
  use pd_base_version, only: program_version
  use pd_driver, only: check_scene, run_scene
  use pd_output_report_begin, only: run_options_type
  use pd_scene_content_read, only: read_scene, read_scene_text
  use pd_scene_content_groups, only: list_groups
  use pd_scene_content_types, only: body_group, boundary_group, crack_group, group_table, &
    & header_type, horizon_group, initial_group, is_set, load_group, material_group, &
    & no_fail_group, output_group, probe_group, region_group, relaxation_group, scene_type, &
    & shape_group, time_group, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  public :: error_type, status_input, status_interrupted, status_no_answer, status_usage
  public :: wp, program_version
  public :: check_scene, run_options_type, run_scene
  public :: read_scene, read_scene_text
  public :: body_group, boundary_group, crack_group, header_type, horizon_group, initial_group, &
    & is_set, load_group, material_group, no_fail_group, output_group, probe_group, region_group, &
    & relaxation_group, scene_type, shape_group, time_group, unset
  public :: group_table, group_type, keys_type, list_groups

end module perifort
