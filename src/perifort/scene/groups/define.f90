!> The group `&define`: a name for a number, to be used in expressions.
module pd_scene_groups_define
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: name_length, text_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  public :: define_group

  !> `&define`
  type, extends(group_type) :: define_group
    character(name_length) :: name = ''
    real(wp) :: value = unset                    !! in SI units
    character(text_length) :: text = ''          !! instead: an expression of earlier names
  contains
    procedure :: visit
  end type define_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(define_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys       !! the visitor: reads, describes, writes

    call keys%key('name', group%name, 'name used in expressions', required=.true., word=.true.)
    call keys%key('value', group%value, '', 'its value, in SI units; an expression may use '// &
      & 'names defined before', required=.true., text=group%text)
  end subroutine visit

end module pd_scene_groups_define
