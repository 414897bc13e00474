!> The group `&j_integral`: energy release rate and stress intensity factors of a crack tip.
module pd_scene_groups_j_integral
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: name_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type, change_of_the_files
  implicit none (type, external)
  private
  public :: j_integral_group

  !> `&j_integral`
  type, extends(group_type) :: j_integral_group
    character(name_length) :: name = ''
    real(wp) :: lower(3) = unset                 !! [m]
    real(wp) :: upper(3) = unset                 !! [m]
    real(wp) :: direction(3) = unset             !! in which the crack grows, of any length
    real(wp) :: tip(3) = unset                   !! [m]
  contains
    procedure :: visit
    procedure, nopass :: change_of
  end type j_integral_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(j_integral_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys           !! the visitor: reads, describes, writes

    call keys%key('name', group%name, 'start of its column names', required=.true., word=.true.)
    call keys%key('lower', group%lower, 'm', 'box around the tip, in whose outer half the '// &
      & 'integral is taken: its lower corner', required=.true.)
    call keys%key('upper', group%upper, 'm', 'its upper corner', required=.true.)
    call keys%key('direction', group%direction, '-', 'in which the crack grows, of any length', &
      & required=.true.)
    call keys%key('tip', group%tip, 'm', 'the tip, or another position on the line of the '// &
      & 'crack, in the inner half of the box', default='centre of the box')
  end subroutine visit

  !> The integral is a column of the history.
  pure integer function change_of(key) result(change)
    character(*), intent(in) :: key  !! its name, '' for the group as a whole

    associate (unused_key => key)
    end associate
    change = change_of_the_files
  end function change_of

end module pd_scene_groups_j_integral
