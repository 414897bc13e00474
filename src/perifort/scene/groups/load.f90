!> The group `&load`: forces.
module pd_scene_groups_load
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: name_length, text_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_course, only: settle_side, visit_course
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  public :: load_group

  !> `&load`
  type, extends(group_type) :: load_group
    character(name_length) :: body = ''
    character(name_length) :: side = ''
    character(name_length) :: region = ''
    real(wp) :: pressure = unset                 !! [Pa], positive pushes
    real(wp) :: force(3) = unset                 !! total over the points: force_x, _y, _z [N]
    real(wp) :: body_force(3) = unset            !! density: body_force_x, _y, _z [N/m3]
    character(text_length) :: pressure_text = ''       !! instead: expressions of x, y, z, t
    character(text_length) :: force_text(3) = ''       !! of t only
    character(text_length) :: body_force_text(3) = ''
    real(wp) :: stiffness(3) = unset             !! of springs, total over the points [N/m]
    real(wp) :: ramp_time = unset                !! [s]
    real(wp), allocatable :: times(:)            !! [s]
    real(wp), allocatable :: values(:)           !! factors at `times` [-]
  contains
    procedure :: visit
  end type load_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(load_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys     !! the visitor: reads, describes, writes

    call keys%key('body', group%body, 'side: name of the body', default='the only body')
    call keys%key('side', group%side, 'x_min, x_max .. z_max: the outermost points at this '// &
      & 'side; BODY:NAME: these facets of a mesh or surface')
    call settle_side(group%side)
    call keys%key('region', group%region, 'name of a region, instead of side')
    call keys%key('pressure', group%pressure, 'Pa', 'side: pressure, positive pushes', &
      & text=group%pressure_text)
    call keys%triple('force', group%force, 'N', 'total force over the points', '0', &
      & group%force_text)
    call keys%triple('body_force', group%body_force, 'N/m3', 'force density', '0', &
      & group%body_force_text)
    call keys%key('stiffness', group%stiffness, 'N/m', 'total stiffness of springs that pull '// &
      & 'the points back, along each direction', default='none')
    call visit_course(keys, group%ramp_time, group%times, group%values)
  end subroutine visit

end module pd_scene_groups_load
