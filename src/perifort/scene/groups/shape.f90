!> Shapes: the groups `&remove` and `&keep`, and the keys that `&region` and `&no_fail` add.
module pd_scene_groups_shape
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: is_set, name_length, path_length, text_length, unset
  use pd_scene_format_keys, only: keys_type, mode_write
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  public :: shape_group, region_group, no_fail_group, is_of_file, shape_names, axes

  !> Kinds of shapes.
  character(10), parameter :: shape_names(5) = [character(10) :: 'box', 'sphere', 'cylinder', &
    & 'cone', 'half_space']
  character(1), parameter :: axes(3) = ['x', 'y', 'z']

  !> `&remove`, `&keep`
  type, extends(group_type) :: shape_group
    character(name_length) :: shape = ''         !! one of `shape_names`
    real(wp) :: lower(3) = unset                 !! box, cylinder's ends: unset = unbounded [m]
    real(wp) :: upper(3) = unset                 !! [m]
    real(wp) :: centre(3) = 0.0_wp               !! sphere, cylinder, cone, half-space [m]
    real(wp) :: radius = unset                   !! sphere, cylinder [m]
    character(name_length) :: axis = 'z'         !! cylinder: 'x', 'y', 'z'
    real(wp) :: direction(3) = unset             !! cylinder instead of axis, cone, half-space
    real(wp) :: height = unset                   !! cylinder, cone: from the centre on [m]
    real(wp) :: angle = unset                    !! cone: from side to side [degrees]
    character(name_length) :: region = ''        !! a region's points, too
    character(text_length) :: where = ''         !! an expression of x, y, z: inside if not 0
    character(path_length) :: surface = ''       !! instead of a shape: closed facets, .stl
    character(path_length) :: mesh = ''          !! instead of a shape: elements, .msh or .inp
    real(wp) :: scale = 1.0_wp                   !! metres of one unit of the surface or mesh
  contains
    procedure :: visit => visit_cut
  end type shape_group

  !> `&region`
  type, extends(shape_group) :: region_group
    character(name_length) :: name = ''
  contains
    procedure :: visit => visit_region
  end type region_group

  !> `&no_fail`
  type, extends(shape_group) :: no_fail_group
  contains
    procedure :: visit => visit_no_fail
  end type no_fail_group

contains

  !> Whether a file says what is inside: a surface or a mesh.
  elemental logical function is_of_file(group)
    class(shape_group), intent(in) :: group  !! that may have a shape instead
    is_of_file = group%surface /= '' .or. group%mesh /= ''
  end function is_of_file

  !> The keys of `&remove` and `&keep`.
  subroutine visit_cut(group, keys)
    class(shape_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys      !! the visitor: reads, describes, writes

    call keys%key('region', group%region, 'name of a region, instead of a shape or with it')
    call keys%key('where', group%where, 'expression of x, y, z that is not 0 inside; what is '// &
      & 'given of region, where and shape must hold together')
    call visit_shape(group, keys)
  end subroutine visit_cut

  !> The keys of `&region`.
  subroutine visit_region(group, keys)
    class(region_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys       !! the visitor: reads, describes, writes

    call keys%key('name', group%name, 'name used elsewhere', required=.true., word=.true.)
    call keys%key('where', group%where, 'expression of x, y, z that is not 0 inside; with a '// &
      & 'shape both must hold')
    call visit_shape(group, keys)
  end subroutine visit_region

  !> The keys of `&no_fail`.
  subroutine visit_no_fail(group, keys)
    class(no_fail_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys        !! the visitor: reads, describes, writes

    call keys%key('region', group%region, 'name of a region, instead of a shape')
    call visit_shape(group, keys)
  end subroutine visit_no_fail

  !> The keys of a shape.
  subroutine visit_shape(group, keys)
    class(shape_group), intent(inout) :: group
    type(keys_type), intent(inout) :: keys
    logical :: plain

    ! Written: only keys that the kind of shape has. Reading starts before the kind is known.
    plain = keys%mode == mode_write .and. (group%shape == '' .or. group%shape == 'box')
    call keys%key('shape', group%shape, 'kind of shape; in 2D a sphere is a circle, a cone a '// &
      & 'wedge, a half-space a half-plane', allowed=shape_names)
    call keys%key('lower', group%lower, 'm', 'box: lower corner; cylinder: its lower end along '// &
      & 'the axis', default='unbounded')
    call keys%key('upper', group%upper, 'm', 'box: upper corner; cylinder: its upper end along '// &
      & 'the axis', default='unbounded')
    call keys%key('centre', group%centre, 'm', 'sphere: centre; cylinder: a point of the axis, '// &
      & 'where it begins with a height; cone: tip; half_space: a point of its plane', hidden=plain)
    call keys%key('radius', group%radius, 'm', 'sphere, cylinder: radius', above=0.0_wp)
    call keys%key('axis', group%axis, 'cylinder: direction of the axis', allowed=axes, &
      & hidden=keys%mode == mode_write .and. (group%shape /= 'cylinder' .or. &
      & any(is_set(group%direction))))
    call keys%key('direction', group%direction, '-', 'cylinder, instead of axis: a vector '// &
      & 'along it; cone: from the tip along its axis; half_space: the normal that points into it')
    call keys%key('height', group%height, 'm', 'cylinder, cone: length from the centre on', &
      & above=0.0_wp, default='unbounded')
    call keys%key('angle', group%angle, 'degrees', 'cone: opening angle, from side to side', &
      & above=0.0_wp, below=180.0_wp)
    call keys%key('surface', group%surface, 'closed facets instead of a shape (3D): a STL file')
    call keys%key('mesh', group%mesh, 'elements of the dimension of the scene instead of a '// &
      & 'shape: a file of Gmsh (.msh) or of Abaqus and CalculiX (.inp)')
    call keys%key('scale', group%scale, 'm', 'surface, mesh: length of its unit, 1e-3 for '// &
      & 'millimetres', above=0.0_wp, hidden=keys%mode == mode_write .and. &
      & .not. is_of_file(group))
  end subroutine visit_shape

end module pd_scene_groups_shape
