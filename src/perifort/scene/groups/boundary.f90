!> The group `&boundary`: imposed motion.
module pd_scene_groups_boundary
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: name_length, text_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_course, only: settle_side, visit_course
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  public :: boundary_group, adds_layer

  !> `&boundary`
  type, extends(group_type) :: boundary_group
    character(name_length) :: name = ''
    character(name_length) :: body = ''          !! '' = all bodies together
    character(name_length) :: side = ''          !! 'x_min' .. 'z_max': adds a layer;
                                                 !! 'body:name': facets of a mesh
    character(name_length) :: region = ''        !! existing points instead
    character(name_length) :: motion = 'imposed' !! or 'pin': the points move as one rigid body
    real(wp) :: displacement(3) = unset          !! imposed, unset = free [m]
    real(wp) :: velocity(3) = unset              !! imposed, unset = free [m/s]
    character(text_length) :: displacement_text(3) = ''  !! instead: expressions of x, y, z, t
    character(text_length) :: velocity_text(3) = ''
    logical :: absorbing = .false.               !! the layer takes in waves
    real(wp) :: ramp_time = unset                !! [s]
    real(wp), allocatable :: times(:)            !! [s]
    real(wp), allocatable :: values(:)           !! factors at `times` [-]
  contains
    procedure :: visit
  end type boundary_group

contains

  !> Whether a boundary adds a layer of points.
  elemental logical function adds_layer(boundary)
    type(boundary_group), intent(in) :: boundary  !! the group
    adds_layer = boundary%side /= '' .and. index(boundary%side, ':') == 0
  end function adds_layer

  !> The keys of the group.
  subroutine visit(group, keys)
    class(boundary_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys         !! the visitor: reads, describes, writes

    call keys%key('name', group%name, 'with a name, the history has its reaction force', &
      & word=.true.)
    call keys%key('body', group%body, 'side: name of the body', default='all bodies together')
    call keys%key('side', group%side, 'x_min, x_max .. z_max: adds a layer as wide as the '// &
      & 'horizon outside this side; BODY:NAME moves the points of a mesh or surface within the '// &
      & 'horizon of these facets')
    call settle_side(group%side)
    call keys%key('region', group%region, 'name of a region, instead of side')
    call keys%key('motion', group%motion, 'what the components are given for: each point, or '// &
      & 'the centre of a rigid body of all points that is free to rotate', &
      & allowed=[character(7) :: 'imposed', 'pin'])
    call keys%triple('displacement', group%displacement, 'm', 'imposed displacement', 'free', &
      & group%displacement_text)
    call keys%triple('velocity', group%velocity, 'm/s', 'imposed velocity', 'free', &
      & group%velocity_text)
    call keys%key('absorbing', group%absorbing, 'side: the layer is free and takes in waves '// &
      & 'that meet the side')
    call visit_course(keys, group%ramp_time, group%times, group%values)
  end subroutine visit

end module pd_scene_groups_boundary
