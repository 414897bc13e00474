!> The group `&line`: profiles of fields along a line, at each output.
module pd_scene_groups_line
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: name_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type, change_of_the_files
  implicit none (type, external)
  private
  public :: line_group

  !> `&line`
  type, extends(group_type) :: line_group
    character(name_length) :: name = ''
    real(wp) :: from(3) = unset                  !! [m]
    real(wp) :: to(3) = unset                    !! [m]
    integer :: points = 101                      !! along it, both ends included
    character(name_length), allocatable :: fields(:)
  contains
    procedure :: visit
    procedure, nopass :: change_of
  end type line_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(line_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys     !! the visitor: reads, describes, writes

    call keys%key('name', group%name, 'name of its file, NAME.csv, and of its place in the '// &
      & 'HDF5 file', required=.true., word=.true.)
    call keys%key('from', group%from, 'm', 'its first position', required=.true.)
    call keys%key('to', group%to, 'm', 'its last position', required=.true.)
    call keys%key('points', group%points, '', 'number of positions, at equal distances', &
      & at_least=2)
    call keys%list('fields', group%fields, 'fields to note', keys%field_names(), &
      & default="'displacement'")
  end subroutine visit

  !> Lines are files of their own.
  pure integer function change_of(key) result(change)
    character(*), intent(in) :: key  !! its name, '' for the group as a whole

    associate (unused_key => key)
    end associate
    change = change_of_the_files
  end function change_of

end module pd_scene_groups_line
