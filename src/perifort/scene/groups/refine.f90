!> The group `&refine`: where lattices are finer.
module pd_scene_groups_refine
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_shape, only: shape_group
  implicit none (type, external)
  private
  public :: refine_group

  !> `&refine`
  type, extends(shape_group) :: refine_group
    integer :: levels = 1              !! how often spacing and horizon are halved
  contains
    procedure :: visit => visit_refine
  end type refine_group

contains

  !> The keys of the group.
  subroutine visit_refine(group, keys)
    class(refine_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys       !! the visitor: reads, describes, writes

    call keys%key('levels', group%levels, '', 'how often spacing and horizon are halved inside', &
      & at_least=1)
    call group%shape_group%visit(keys)
  end subroutine visit_refine

end module pd_scene_groups_refine
