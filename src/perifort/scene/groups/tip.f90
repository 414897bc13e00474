!> The group `&tip`: the tip of a crack in the history.
module pd_scene_groups_tip
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: name_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  public :: tip_group

  !> `&tip`. A change is another problem to a restart: the way of the tip begins with the run.
  type, extends(group_type) :: tip_group
    character(name_length) :: name = ''
    real(wp) :: from(3) = unset                  !! [m]
    real(wp) :: direction(3) = unset             !! of any length
    real(wp) :: threshold = 0.35_wp              !! of the damage
    character(name_length) :: across = ''        !! 'x', 'y', 'z': 3D, along the front
  contains
    procedure :: visit
  end type tip_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(tip_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys    !! the visitor: reads, describes, writes

    call keys%key('name', group%name, 'start of its column names', required=.true., word=.true.)
    call keys%key('from', group%from, 'm', 'a position on the crack, or where it will begin', &
      & required=.true.)
    call keys%key('direction', group%direction, '-', &
      & 'of growth, of any length: the tip is the farthest point along it', required=.true.)
    call keys%key('threshold', group%threshold, '-', 'damage above which a point is cracked', &
      & above=0.0_wp, below=1.0_wp)
    call keys%key('across', group%across, '3D: the axis along which the front extends', &
      & allowed=[character(1) :: 'x', 'y', 'z'], &
      & default='the one along which the points extend least, not the nearest to direction', &
      & hidden=group%across == '')
  end subroutine visit

end module pd_scene_groups_tip
