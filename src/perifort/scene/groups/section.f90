!> The group `&section`: force and moment carried across a plane, in the history.
module pd_scene_groups_section
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: name_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type, change_of_the_files
  implicit none (type, external)
  private
  public :: section_group

  !> `&section`: a plane (3D), a line (2D) or a point (1D)
  type, extends(group_type) :: section_group
    character(name_length) :: name = ''
    real(wp) :: point(3) = unset                 !! [m]
    real(wp) :: normal(3) = unset                !! of any length; 1D: +x if it is not given
    real(wp) :: lower(3) = unset                 !! the part within a box: unset = unbounded [m]
    real(wp) :: upper(3) = unset                 !! [m]
  contains
    procedure :: visit
    procedure, nopass :: change_of
  end type section_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(section_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys        !! the visitor: reads, describes, writes

    call keys%key('name', group%name, 'start of its column names', required=.true., word=.true.)
    call keys%key('point', group%point, 'm', 'a position on it; moments are about this position', &
      & required=.true.)
    call keys%key('normal', group%normal, '-', 'direction across it, of any length: the '// &
      & 'force is that on the part behind, from the part ahead', default='1D: 1')
    call keys%key('lower', group%lower, 'm', 'bonds that cross it within a box: its lower corner', &
      & default='unbounded')
    call keys%key('upper', group%upper, 'm', 'its upper corner', default='unbounded')
  end subroutine visit

  !> Sections are columns of the history.
  pure integer function change_of(key) result(change)
    character(*), intent(in) :: key  !! its name, '' for the group as a whole

    associate (unused_key => key)
    end associate
    change = change_of_the_files
  end function change_of

end module pd_scene_groups_section
