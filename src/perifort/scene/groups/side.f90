!> The group `&side`: facets of a surface, by a name.
module pd_scene_groups_side
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: name_length, text_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  public :: side_group

  !> `&side`
  type, extends(group_type) :: side_group
    character(name_length) :: name = ''
    character(text_length) :: where = ''     !! an expression of x, y, z: chosen if not 0
    real(wp) :: normal(3) = unset            !! direction of the outward normal, of any length
    real(wp) :: angle = 30.0_wp              !! that it may differ from it [degrees]
  contains
    procedure :: visit
  end type side_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(side_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys     !! the visitor: reads, describes, writes

    call keys%key('name', group%name, 'name used elsewhere, as BODY:NAME', required=.true., &
      & word=.true.)
    call keys%key('where', group%where, "expression of x, y, z, a facet's centre, that is not "// &
      & '0 for its facets; with a normal both must hold')
    call keys%key('normal', group%normal, '-', "direction of the facets' outward normal", &
      & default='any')
    call keys%key('angle', group%angle, 'degrees', 'normal: how far a facet may be turned from '// &
      & 'it', above=0.0_wp, hidden=.not. any(group%normal > unset))
  end subroutine visit

end module pd_scene_groups_side
