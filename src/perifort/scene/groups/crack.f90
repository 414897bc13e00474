!> The group `&crack`: a crack that is there from the start.
module pd_scene_groups_crack
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: path_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  public :: crack_group

  !> `&crack`: a segment or a chain of them (2D), a parallelogram, a disc or a surface (3D)
  type, extends(group_type) :: crack_group
    real(wp) :: from(3) = unset
    real(wp) :: to(3) = unset
    real(wp), allocatable :: points(:)           !! x, y of each point of a chain of segments
    real(wp) :: corner(3) = unset
    real(wp) :: edge_1(3) = unset
    real(wp) :: edge_2(3) = unset
    real(wp) :: centre(3) = unset
    real(wp) :: normal(3) = unset
    real(wp) :: radius = unset
    character(path_length) :: surface = ''       !! facets, .stl
    real(wp) :: scale = 1.0_wp                   !! metres of one unit of the surface
  contains
    procedure :: visit
  end type crack_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(crack_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys      !! the visitor: reads, describes, writes

    call keys%key('from', group%from, 'm', '2D segment: one end')
    call keys%key('to', group%to, 'm', '2D segment: other end')
    call keys%list('points', group%points, 'm', '2D chain of segments: x and y of each of its '// &
      & 'points, one after another')
    call keys%key('corner', group%corner, 'm', '3D parallelogram: a corner')
    call keys%key('edge_1', group%edge_1, 'm', '3D parallelogram: an edge from the corner')
    call keys%key('edge_2', group%edge_2, 'm', '3D parallelogram: the other edge')
    call keys%key('centre', group%centre, 'm', '3D disc: centre')
    call keys%key('normal', group%normal, '-', '3D disc: normal, of any length')
    call keys%key('radius', group%radius, 'm', '3D disc: radius', above=0.0_wp)
    call keys%key('surface', group%surface, '3D surface: a STL file, whose facets cut bonds')
    call keys%key('scale', group%scale, 'm', 'surface: length of its unit, 1e-3 for '// &
      & 'millimetres', above=0.0_wp, hidden=group%surface == '')
  end subroutine visit

end module pd_scene_groups_crack
