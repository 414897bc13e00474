!> The group `&rigid`: a rigid body of a given shape, without points.
module pd_scene_groups_rigid
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: name_length, path_length, text_length, unset
  use pd_scene_format_keys, only: keys_type, mode_write
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  public :: rigid_group, rigid_shapes, rigid_rotations

  !> Kinds of shapes.
  character(10), parameter :: rigid_shapes(5) = [character(10) :: 'sphere', 'cylinder', 'box', &
    & 'half_space', 'surface']
  !> Kinds of rotation.
  character(7), parameter :: rigid_rotations(3) = [character(7) :: 'free', 'held', 'imposed']

  !> `&rigid`
  type, extends(group_type) :: rigid_group
    character(name_length) :: name = ''
    character(name_length) :: shape = ''         !! one of `rigid_shapes`
    character(path_length) :: surface = ''       !! closed facets: .stl
    real(wp) :: scale = 1.0_wp                   !! metres of one unit of the surface
    real(wp) :: centre(3) = unset                !! half-space: a point of its surface [m]
    real(wp) :: radius = unset                   !! sphere, cylinder [m]
    real(wp) :: length = unset                   !! cylinder [m]
    real(wp) :: edges(3) = unset                 !! box [m]
    real(wp) :: axis(3) = unset                  !! cylinder; box, surface: about which it is turned
    real(wp) :: angle = 0.0_wp                   !! box, surface: by which it is turned [degrees]
    real(wp) :: normal(3) = unset                !! half-space: out of it [-]
    real(wp) :: mass = unset                     !! [kg]
    real(wp) :: density = unset                  !! instead of mass [kg/m3]
    real(wp) :: inertia(3) = unset               !! about its own axes [kg m2]
    real(wp) :: velocity(3) = unset              !! at the start [m/s]
    real(wp) :: displacement(3) = unset          !! imposed, unset = free [m]
    character(text_length) :: displacement_text(3) = ''  !! instead: expressions of t
    character(name_length) :: rotation = ''      !! one of `rigid_rotations`
    real(wp) :: spin(3) = unset                  !! at the start, or imposed [rad/s]
    character(text_length) :: spin_text(3) = ''  !! instead, imposed: expressions of t
  contains
    procedure :: visit
  end type rigid_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(rigid_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys      !! the visitor: reads, describes, writes

    call keys%key('name', group%name, 'name by which a &contact calls it; its columns of the '// &
      & 'history begin with it', required=.true., word=.true.)
    call keys%key('shape', group%shape, 'kind of shape; in 2D a sphere is a circle', &
      & required=.true., allowed=rigid_shapes)
    call keys%key('surface', group%surface, 'surface: closed facets, a STL file, as text or binary')
    call keys%key('scale', group%scale, 'm', 'surface: length of its unit, 1e-3 for '// &
      & 'millimetres', above=0.0_wp, hidden=keys%mode == mode_write .and. group%surface == '')
    call keys%key('centre', group%centre, 'm', 'centre; half_space: a point of its surface; '// &
      & 'surface: where its centre of mass is put', default='surface: as in its file')
    call keys%key('radius', group%radius, 'm', 'sphere, cylinder: radius', above=0.0_wp)
    call keys%key('length', group%length, 'm', 'cylinder: length', above=0.0_wp)
    call keys%key('edges', group%edges, 'm', 'box: lengths of its edges', default='none')
    call keys%key('axis', group%axis, '', 'cylinder: direction of its axis; box in 3D, '// &
      & 'surface: the axis of its angle', default='0.0, 0.0, 1.0')
    call keys%key('angle', group%angle, 'degrees', 'box, surface: by which it is turned about '// &
      & 'the axis')
    call keys%key('normal', group%normal, '', 'half_space: normal of its surface, out of it', &
      & default='none')
    call keys%key('mass', group%mass, 'kg', 'mass of the body', above=0.0_wp)
    call keys%key('density', group%density, 'kg/m3', 'instead of mass: density', above=0.0_wp)
    call keys%key('inertia', group%inertia, 'kg m2', 'moments of inertia about the axes of the '// &
      & 'shape, the last along that of a cylinder, of a surface about x, y, z of its file; in '// &
      & '2D three values, of which the last counts', &
      & default='those of the shape')
    call keys%triple('velocity', group%velocity, 'm/s', 'velocity of the centre at the start', '0')
    call keys%triple('displacement', group%displacement, 'm', 'imposed displacement of the '// &
      & 'centre (0 holds it, an expression of t moves it)', 'free; half_space: 0', &
      & group%displacement_text)
    call keys%key('rotation', group%rotation, 'whether it rotates by the moments on it, not at '// &
      & 'all, or with the angular velocity spin', allowed=rigid_rotations, &
      & default="'free'; half_space: 'held'")
    call keys%triple('spin', group%spin, 'rad/s', 'angular velocity at the start, or imposed '// &
      & '(then also an expression of t)', '0', group%spin_text)
  end subroutine visit

end module pd_scene_groups_rigid
