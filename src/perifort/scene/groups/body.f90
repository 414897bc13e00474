!> The group `&body`: material points.
module pd_scene_groups_body
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text
  use pd_scene_format_given, only: is_set, name_length, path_length, unset
  use pd_scene_format_keys, only: keys_type, mode_write
  use pd_scene_groups_group, only: group_type
  use pd_scene_groups_shape, only: axes
  implicit none (type, external)
  private
  public :: body_group, is_lattice, is_box, is_turned, has_grid, words_of_body, &
    & has_cut_cells, body_shapes

  !> Shapes of lattices.
  character(8), parameter :: body_shapes(3) = [character(8) :: 'box', 'sphere', 'cylinder']

  !> `&body`
  type, extends(group_type) :: body_group
    character(name_length) :: name = ''
    character(name_length) :: material = ''      !! '' = the only material
    real(wp) :: lower(3) = unset                 !! corner of the lattice's box [m]
    real(wp) :: upper(3) = unset                 !! opposite corner [m]
    integer :: points(3) = 0                     !! points along each direction
    character(name_length) :: shape = ''         !! of `body_shapes`; '' = a box with `points`
    real(wp) :: spacing = unset                  !! of a shape or surface, instead of `points` [m]
    real(wp) :: centre(3) = 0.0_wp               !! sphere; cylinder: the middle of its lower end
    real(wp) :: radius = unset                   !! sphere, cylinder [m]
    character(name_length) :: axis = 'z'         !! cylinder: 'x', 'y', 'z'
    real(wp) :: height = unset                   !! cylinder [m]
    real(wp) :: axis_1(3) = unset                !! lattice: direction of its first rows
    real(wp) :: axis_2(3) = unset                !! and of the second ones, in 3D
    character(path_length) :: file = ''          !! cloud: columns x y z volume
    character(path_length) :: mesh = ''          !! mesh: .msh or .inp
    character(path_length) :: surface = ''       !! closed facets that a lattice fills: .stl
    character(name_length) :: fill = 'centre'    !! cells of it: 'centre' or 'volume'
    integer :: points_per_element = 1            !! 1: the centre; else Gauss points
    real(wp) :: scale = 1.0_wp                   !! metres of one unit of the mesh or surface
    character(name_length), allocatable :: material_set(:)   !! sets of the mesh ...
    character(name_length), allocatable :: material_name(:)  !! ... and the material of each
  contains
    procedure :: visit
  end type body_group

contains

  !> Whether a body is a lattice that fills a box: no cloud, no mesh, no surface.
  elemental logical function is_lattice(body)
    type(body_group), intent(in) :: body  !! the group
    is_lattice = body%file == '' .and. body%mesh == '' .and. body%surface == ''
  end function is_lattice

  !> Whether the rows of a lattice have directions of their own.
  elemental logical function is_turned(body)
    type(body_group), intent(in) :: body  !! the group
    is_turned = is_set(body%axis_1(1))
  end function is_turned

  !> Whether a body is a lattice that fills the box from `lower` to `upper`.
  elemental logical function is_box(body)
    type(body_group), intent(in) :: body  !! the group
    is_box = is_lattice(body) .and. (body%shape == '' .or. body%shape == 'box') .and. &
      & .not. is_turned(body)
  end function is_box

  !> Whether a body's points are whole cells of a lattice: of a box, or inside of a surface.
  elemental logical function has_grid(body)
    type(body_group), intent(in) :: body  !! the group
    has_grid = body%file == '' .and. body%mesh == '' .and. .not. has_cut_cells(body)
  end function has_grid

  !> Whether a body's points are cells that a surface cuts, each with a volume of its own.
  elemental logical function has_cut_cells(body) result(cut)
    type(body_group), intent(in) :: body  !! the group
    cut = body%surface /= '' .and. body%fill == 'volume'
  end function has_cut_cells

  !> A body in messages: its name, or its number.
  pure function words_of_body(bodies, number) result(words)
    type(body_group), intent(in) :: bodies(:)  !! the groups
    integer, intent(in) :: number              !! which one of them
    character(:), allocatable :: words

    words = 'body '//to_text(number)
    if (bodies(number)%name /= '') words = "the body '"//trim(bodies(number)%name)//"'"
  end function words_of_body

  !> The keys of the group.
  subroutine visit(group, keys)
    class(body_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys     !! the visitor: reads, describes, writes
    logical :: writes, round

    ! what follows from a shape is not written
    writes = keys%mode == mode_write
    round = group%shape == 'sphere' .or. group%shape == 'cylinder'
    call keys%key('name', group%name, 'name of the body', word=.true.)
    call keys%key('material', group%material, 'name of its material', default='the only material')
    call keys%key('lower', group%lower, 'm', 'lattice: lower corner of the box that the cells '// &
      & 'fill; surface: a corner of some cell', hidden=writes .and. round)
    call keys%key('upper', group%upper, 'm', 'lattice: upper corner', hidden=writes .and. round)
    call keys%key('points', group%points, '', 'lattice: points along each direction, at the '// &
      & 'centres of cubic cells', at_least=1, hidden=writes .and. group%shape /= '')
    call keys%key('shape', group%shape, 'lattice: shape that it fills, with a spacing instead '// &
      & 'of points; in 2D a sphere is a disc', allowed=body_shapes)
    call keys%key('spacing', group%spacing, 'm', 'shape: distance of the points, of a sphere '// &
      & 'and across a cylinder with the centre at a corner of cells; surface: edge of the '// &
      & 'lattice cells', above=0.0_wp)
    call keys%key('centre', group%centre, 'm', 'shape: centre of a sphere, or the middle of '// &
      & 'the lower end of a cylinder', hidden=writes .and. .not. round)
    call keys%key('radius', group%radius, 'm', 'sphere, cylinder: radius', above=0.0_wp)
    call keys%key('axis', group%axis, 'cylinder: direction from its lower end to the upper one', &
      & allowed=axes, hidden=writes .and. group%shape /= 'cylinder')
    call keys%key('height', group%height, 'm', 'cylinder in 3D: length along the axis', &
      & above=0.0_wp)
    call keys%key('axis_1', group%axis_1, '-', 'lattice: direction of its rows, of any length; '// &
      & 'it is turned about its lower corner, or about the centre of its shape', default='along x')
    call keys%key('axis_2', group%axis_2, '-', 'lattice in 3D: with axis_1 the plane of its '// &
      & 'second rows, which are normal to the first', default='along y')
    call keys%key('file', group%file, 'cloud instead of a lattice: a text file with the '// &
      & "columns x y z volume, '#' starts a comment")
    call keys%key('mesh', group%mesh, 'mesh instead of a lattice: a file of Gmsh (.msh, 2.2 or '// &
      & '4.1) or of Abaqus and CalculiX (.inp)')
    call keys%key('surface', group%surface, 'lattice inside of closed facets: a STL file, as '// &
      & 'text or binary')
    call keys%key('fill', group%fill, 'surface: whole cells whose centres are inside; or all '// &
      & 'cells with their volumes inside, on list families', &
      & allowed=[character(6) :: 'centre', 'volume'], hidden=writes .and. group%surface == '')
    call keys%key('points_per_element', group%points_per_element, '', 'mesh: points of an '// &
      & 'element, 1 (its centre) or a number of Gauss points that its shape has', at_least=1, &
      & hidden=writes .and. group%mesh == '')
    call keys%key('scale', group%scale, 'm', 'mesh, surface: length of its unit, 1e-3 for '// &
      & 'millimetres', above=0.0_wp, &
      & hidden=writes .and. group%mesh == '' .and. group%surface == '')
    call keys%list('material_set', group%material_set, 'mesh: names of sets that have another '// &
      & 'material than the body', [character(1) ::], as_written=.true.)
    call keys%list('material_name', group%material_name, 'mesh: the material of each '// &
      & 'material_set', [character(1) ::], as_written=.true.)
  end subroutine visit

end module pd_scene_groups_body
