!> The group `&body`: material points.
module pd_scene_groups_body
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: name_length, path_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  public :: body_group

  !> `&body`
  type, extends(group_type) :: body_group
    character(name_length) :: name = ''
    character(name_length) :: material = ''      !! '' = the only material
    real(wp) :: lower(3) = unset                 !! corner of the lattice's box [m]
    real(wp) :: upper(3) = unset                 !! opposite corner [m]
    integer :: points(3) = 0                     !! points along each direction
    character(path_length) :: file = ''          !! cloud: columns x y z volume
  contains
    procedure :: visit
  end type body_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(body_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys     !! the visitor: reads, describes, writes

    call keys%key('name', group%name, 'name of the body', word=.true.)
    call keys%key('material', group%material, 'name of its material', default='the only material')
    call keys%key('lower', group%lower, 'm', 'lattice: lower corner of the box that the cells fill')
    call keys%key('upper', group%upper, 'm', 'lattice: upper corner')
    call keys%key('points', group%points, '', 'lattice: points along each direction, at the '// &
      & 'centres of cubic cells', at_least=1)
    call keys%key('file', group%file, 'cloud instead of a lattice: a text file with the '// &
      & "columns x y z volume, '#' starts a comment")
  end subroutine visit

end module pd_scene_groups_body
