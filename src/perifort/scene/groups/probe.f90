!> The group `&probe`: values of one point in the history.
module pd_scene_groups_probe
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: name_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type, change_of_the_files
  implicit none (type, external)
  private
  public :: probe_group, default_probe_fields

  !> The fields probed if none are named.
  character(14), parameter :: default_probe_fields(1) = [character(14) :: 'displacement']

  !> `&probe`
  type, extends(group_type) :: probe_group
    character(name_length) :: name = ''
    real(wp) :: point(3) = unset                 !! [m]
    logical :: interpolate = .false.             !! the value at the position itself
    character(name_length), allocatable :: fields(:)
  contains
    procedure :: visit
    procedure, nopass :: change_of
  end type probe_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(probe_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys      !! the visitor: reads, describes, writes

    call keys%key('name', group%name, 'start of its column names', required=.true., word=.true.)
    call keys%key('point', group%point, 'm', 'position; the nearest point is taken', &
      & required=.true.)
    call keys%key('interpolate', group%interpolate, 'take the value at the position itself, '// &
      & 'interpolated between the points around')
    call keys%list('fields', group%fields, 'fields to note', keys%field_names(), &
      & default="'displacement'")
  end subroutine visit

  !> Probes are columns of the history.
  pure integer function change_of(key) result(change)
    character(*), intent(in) :: key  !! its name, '' for the group as a whole

    associate (unused_key => key)
    end associate
    change = change_of_the_files
  end function change_of

end module pd_scene_groups_probe
