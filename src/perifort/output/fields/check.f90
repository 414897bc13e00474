!> Whether a run can write and probe the fields that its scene names.
module pd_output_fields_check
  use pd_base_error, only: error_type
  use pd_base_text, only: join, nearest_name
  use pd_motion_system, only: system_type
  use pd_output_fields_field, only: output_field_type
  use pd_output_fields_table, only: field_table_type
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: check_names, check_available

contains

  !> Every name is in the table. For a scene that has been checked.
  subroutine check_names(scene, table, error)
    type(scene_type), intent(in) :: scene
    type(field_table_type), intent(in) :: table
    type(error_type), allocatable, intent(out) :: error
    integer :: p

    if (allocated(scene%output%fields)) &
      & call known(scene%output%fields, 'output', 1)
    if (.not. allocated(scene%probes)) return
    do p = 1, size(scene%probes)
      if (allocated(error)) return
      if (allocated(scene%probes(p)%fields)) call known(scene%probes(p)%fields, 'probe', p)
    end do
    if (.not. allocated(scene%lines)) return
    do p = 1, size(scene%lines)
      if (allocated(error)) return
      if (allocated(scene%lines(p)%fields)) call known(scene%lines(p)%fields, 'line', p)
    end do

  contains

    subroutine known(names, group, number)
      character(*), intent(in) :: names(:), group
      integer, intent(in) :: number
      character(:), allocatable :: note, nearest
      integer :: f

      do f = 1, size(names)
        if (table%number_of(names(f)) > 0) cycle
        note = 'allowed: '//join(table%names(), ', ')
        nearest = nearest_name(trim(names(f)), table%names())
        if (len(nearest) > 0) note = "did you mean '"//nearest//"'?  "//note
        call scene_fault(error, scene, group, number, 'fields', "unknown value '"// &
          & trim(names(f))//"' of key 'fields' in group &"//group, note, trim(names(f)))
        return
      end do
    end subroutine known
  end subroutine check_names

  !> The run has every field, whose names are in the table.
  subroutine check_available(scene, system, table, error)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system       !! of the scene, before its first step
    type(field_table_type), intent(in) :: table
    type(error_type), allocatable, intent(out) :: error
    integer :: p

    call available(scene%output%fields, 'output', 1)
    do p = 1, size(scene%probes)
      if (allocated(error)) return
      call available(scene%probes(p)%fields, 'probe', p)
    end do
    if (.not. allocated(scene%lines)) return
    do p = 1, size(scene%lines)
      if (allocated(error)) return
      call available(scene%lines(p)%fields, 'line', p)
    end do

  contains

    subroutine available(names, group, number)
      character(*), intent(in) :: names(:), group
      integer, intent(in) :: number
      type(output_field_type) :: field
      character(:), allocatable :: reason
      integer :: f

      do f = 1, size(names)
        field = table%field(names(f))
        reason = field%missing(system)
        if (len(reason) == 0) cycle
        call scene_fault(error, scene, group, number, 'fields', "this scene has no field '"// &
          & trim(names(f))//"'", reason, trim(names(f)))
        return
      end do
    end subroutine available
  end subroutine check_available

end module pd_output_fields_check
