!> The cells of a results file that shows meshes: elements on their nodes, in VTK's kinds and order
!> of nodes, and a vertex for each point that belongs to no mesh.
!>
!> Values at the nodes and of the cells are sums of those of the points.
module pd_output_results_cells
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_body_mesh_elements, only: edge_between, kind_hexahedron, kind_line, kind_point, &
    & kind_pyramid, kind_quadrilateral, kind_tetrahedron, kind_triangle, kind_wedge, n_shapes, &
    & shape_numbered, shape_type
  use pd_body_mesh_nodal, only: append_sums, nodes_with_points, sums_of_elements, sums_of_nodes, &
    & sums_type, summed
  use pd_body_mesh_part, only: part_type
  use pd_output_results_types, only: nodes_linear, nodes_mean, nodes_nearest
  implicit none (type, external)
  private
  public :: cells_type, cells_of, at_nodes, of_cells, vtk_type, vtk_nodes, xdmf_type

  !> Nodes count behind the points: the first has the number of points, from 0.
  type :: cells_type
    real(wp), allocatable :: nodes(:, :)            !! (nodes, 3) [m]
    integer(i1), allocatable :: types(:)            !! (cells) VTK's numbers
    integer(i8), allocatable :: offsets(:)          !! (cells + 1) where the nodes of each begin
    integer(i8), allocatable :: connectivity(:)     !! points and nodes of the cells, from 0
    integer(i8), allocatable :: topology(:)         !! the same as XDMF wants it
    type(sums_type) :: node_means, node_fits        !! values of the nodes
    type(sums_type) :: means                        !! values of the cells
    integer(i4), allocatable :: nearest_of_node(:)  !! (nodes) a point
    integer(i4), allocatable :: nearest_of_cell(:)  !! (cells) a point
  contains
    procedure :: n_nodes
    procedure :: n_cells
  end type cells_type

  !> VTK's edges of its quadratic cells, by corners from 1 in the order of their middle nodes.
  integer, parameter :: tetrahedron_edges(2, 6) = reshape([1, 2, 2, 3, 3, 1, 1, 4, 2, 4, 3, 4], &
    & [2, 6])
  integer, parameter :: hexahedron_edges(2, 12) = reshape([1, 2, 2, 3, 3, 4, 4, 1, 5, 6, 6, 7, 7, &
    & 8, 8, 5, 1, 5, 2, 6, 3, 7, 4, 8], [2, 12])
  integer, parameter :: wedge_edges(2, 9) = reshape([1, 2, 2, 3, 3, 1, 4, 5, 5, 6, 6, 4, 1, 4, 2, &
    & 5, 3, 6], [2, 9])
  !> Nodes 21 to 27 of a hexahedron, in VTK's order: faces at -x, x, -y, y, -z, z; the centre.
  integer, parameter :: face_centres(7) = [23, 24, 22, 25, 21, 26, 27]

contains

  !> Number of nodes; 0 without cells.
  pure integer(i8) function n_nodes(self)
    class(cells_type), intent(in) :: self  !! of a file, or none
    n_nodes = 0
    if (allocated(self%nodes)) n_nodes = size(self%nodes, 1, kind=i8)
  end function n_nodes

  !> Number of cells; 0 if the file has none but its points.
  pure integer(i8) function n_cells(self)
    class(cells_type), intent(in) :: self  !! of a file, or none
    n_cells = 0
    if (allocated(self%types)) n_cells = size(self%types, kind=i8)
  end function n_cells

  !> The cells of a body: the elements of its meshes, part after part, then vertices.
  subroutine cells_of(parts, x, volume, cells)
    type(part_type), intent(in) :: parts(:)   !! (any number) bodies that are meshes
    real(wp), intent(in) :: x(:, :)           !! (points, 3) positions in point order [m]
    real(wp), intent(in) :: volume(:)         !! (points) in point order [m3]
    type(cells_type), intent(out) :: cells    !! all that the file needs
    type(sums_type) :: single
    integer(i8), allocatable :: vertices(:, :)
    logical, allocatable :: of_mesh(:)
    integer :: p, n

    allocate (cells%nodes(0, 3), cells%types(0), cells%connectivity(0), cells%topology(0))
    allocate (cells%offsets(1), source=0_i8)
    allocate (cells%nearest_of_node(0), cells%nearest_of_cell(0))
    allocate (of_mesh(size(volume)), source=.false.)
    do p = 1, size(parts)
      associate (first => parts(p)%first, last => parts(p)%first + parts(p)%n_points - 1)
        of_mesh(first:last) = .true.
        call add_part(cells, parts(p), x(first:last, :parts(p)%dim), volume(first:last), &
          & size(volume, kind=i8))
      end associate
    end do
    single%point = pack([(int(p, i4), p=1, size(volume))], .not. of_mesh)
    n = size(single%point)
    single%first = [(int(p, i8), p=1, n + 1)]
    allocate (single%weight(n), source=1.0_wp)
    call append_sums(cells%means, single, 0)
    cells%nearest_of_cell = [cells%nearest_of_cell, single%point]
    allocate (vertices(3, n), source=1_i8)  ! a kind, a count, a point
    vertices(3, :) = single%point - 1
    cells%topology = [cells%topology, reshape(vertices, [3*n])]
    cells%connectivity = [cells%connectivity, vertices(3, :)]
    cells%types = [cells%types, spread(vtk_type(shape_numbered(1)), 1, n)]
    cells%offsets = [cells%offsets, cells%offsets(size(cells%offsets)) + [(int(p, i8), p=1, n)]]
  end subroutine cells_of

  !> Add the elements of a part.
  subroutine add_part(cells, part, x, volume, points)
    type(cells_type), intent(inout) :: cells
    type(part_type), intent(in) :: part
    real(wp), intent(in) :: x(:, :)        !! (points of the part, dim)
    real(wp), intent(in) :: volume(:)      !! (points of the part)
    integer(i8), intent(in) :: points      !! of all bodies
    type(shape_type) :: shapes(n_shapes)
    type(sums_type) :: mean, linear, inside
    integer(i4), allocatable :: nodes(:), elements(:), corners(:)
    integer(i8), allocatable :: number(:), own(:), connectivity(:), offsets(:), topology(:)
    integer(i1), allocatable :: types(:)
    integer(i8) :: last, end_of_topology
    integer :: e, i, s

    do s = 1, n_shapes
      shapes(s) = shape_numbered(s)
    end do
    nodes = nodes_with_points(part)
    elements = pack([(int(e, i4), e=1, part%mesh%n_elements)], part%points(2, :) > 0_i4)
    allocate (number(part%mesh%n_nodes), source=-1_i8)
    number(nodes) = points + cells%n_nodes() + [(int(i, i8) - 1, i=1, size(nodes))]
    allocate (types(size(elements)), offsets(size(elements)))
    allocate (connectivity(27*size(elements, kind=i8)), topology(28*size(elements, kind=i8)))
    last = 0
    end_of_topology = 0
    do e = 1, size(elements)
      associate (shape => shapes(part%mesh%shape(elements(e))))
        corners = part%mesh%nodes_of(int(elements(e)))
        types(e) = vtk_type(shape)
        own = number(corners(vtk_nodes(shape)))
        connectivity(last + 1:last + shape%nodes) = own
        last = last + shape%nodes
        offsets(e) = last
        ! XDMF has a count of nodes for lines and vertices alone
        topology(end_of_topology + 1) = xdmf_type(shape)
        end_of_topology = end_of_topology + 1
        if (shape%nodes <= 2) then
          topology(end_of_topology + 1) = shape%nodes
          end_of_topology = end_of_topology + 1
        end if
        topology(end_of_topology + 1:end_of_topology + shape%nodes) = own
        end_of_topology = end_of_topology + shape%nodes
      end associate
    end do
    call sums_of_nodes(part, nodes, x, volume, mean, linear)
    call sums_of_elements(part, elements, volume, inside)
    call append_sums(cells%node_means, mean, part%first - 1)
    call append_sums(cells%node_fits, linear, part%first - 1)
    call append_sums(cells%means, inside, part%first - 1)
    cells%nearest_of_node = [cells%nearest_of_node, nearest_points(part, nodes, x, mean)]
    cells%nearest_of_cell = [cells%nearest_of_cell, int(part%points(1, elements), i4) &
      & + int(part%first - 1, i4)]
    cells%offsets = [cells%offsets, cells%offsets(size(cells%offsets)) + offsets]
    cells%types = [cells%types, types]
    cells%connectivity = [cells%connectivity, connectivity(:last)]
    cells%topology = [cells%topology, topology(:end_of_topology)]
    call add_nodes(cells, part, nodes)
  end subroutine add_part

  !> Add the positions of nodes; directions that the scene does not have are 0, as of its points.
  subroutine add_nodes(cells, part, nodes)
    type(cells_type), intent(inout) :: cells
    type(part_type), intent(in) :: part
    integer(i4), intent(in) :: nodes(:)
    real(wp), allocatable :: longer(:, :)
    integer :: n

    n = size(cells%nodes, 1)
    allocate (longer(n + size(nodes), 3), source=0.0_wp)
    longer(:n, :) = cells%nodes
    longer(n + 1:, :part%dim) = transpose(part%mesh%x(:part%dim, nodes))
    call move_alloc(longer, cells%nodes)
  end subroutine add_nodes

  !> Of the points of the elements around a node the nearest one, by its number among all.
  pure function nearest_points(part, nodes, x, around) result(found)
    type(part_type), intent(in) :: part
    integer(i4), intent(in) :: nodes(:)
    real(wp), intent(in) :: x(:, :)
    type(sums_type), intent(in) :: around
    integer(i4), allocatable :: found(:)
    integer(i8) :: t
    integer :: i
    real(wp) :: distance, least

    allocate (found(size(nodes)), source=0_i4)
    do i = 1, size(nodes)
      least = huge(1.0_wp)
      do t = around%first(i), around%first(i + 1) - 1
        distance = norm2(x(around%point(t), :) - part%mesh%x(:part%dim, nodes(i)))
        if (distance >= least) cycle
        least = distance
        found(i) = around%point(t) + int(part%first - 1, i4)
      end do
    end do
  end function nearest_points

  !> Values at the nodes.
  pure function at_nodes(cells, rule, values) result(found)
    type(cells_type), intent(in) :: cells  !! with nodes, or none
    integer, intent(in) :: rule            !! one of `nodes_*`
    real(wp), intent(in) :: values(:)      !! (points)
    real(wp), allocatable :: found(:)      !! (nodes)

    allocate (found(0))
    if (cells%n_nodes() == 0) return
    select case (rule)
    case (nodes_mean)
      found = summed(cells%node_means, values)
    case (nodes_linear)
      found = summed(cells%node_fits, values)
    case (nodes_nearest)
      found = values(cells%nearest_of_node)
    case default
      call internal_fault('a rule for values at nodes')
    end select
  end function at_nodes

  !> Values of the cells.
  pure function of_cells(cells, rule, values) result(found)
    type(cells_type), intent(in) :: cells  !! with cells
    integer, intent(in) :: rule            !! one of `nodes_*`
    real(wp), intent(in) :: values(:)      !! (points)
    real(wp), allocatable :: found(:)      !! (cells)

    select case (rule)
    case (nodes_mean, nodes_linear)
      found = summed(cells%means, values)
    case (nodes_nearest)
      found = values(cells%nearest_of_cell)
    case default
      call internal_fault('a rule for values of cells')
    end select
  end function of_cells

  !> VTK's number of the kind of cell that an element is (vtkCellType.h).
  elemental integer(i1) function vtk_type(shape) result(number)
    type(shape_type), intent(in) :: shape  !! of the element

    number = int(pick(shape, [1, 3, 5, 9, 10, 12, 13, 14], [0, 21, 22, 23, 24, 25, 26, 0], 28, &
      & 29), &
      & i1)
  end function vtk_type

  !> XDMF's number of the kind of cell in a mixed topology.
  elemental integer(i8) function xdmf_type(shape) result(number)
    type(shape_type), intent(in) :: shape  !! of the element

    number = pick(shape, [1, 2, 4, 5, 6, 9, 8, 7], [0, 34, 36, 37, 38, 48, 40, 0], 35, 50)
  end function xdmf_type

  !> A number for each shape from tables by kind: of linear ones, quadratic ones, quadrilaterals of
  !> 9
  !> and hexahedra of 27 nodes.
  pure integer function pick(shape, linear, quadratic, nine, twenty_seven) result(number)
    type(shape_type), intent(in) :: shape
    integer, intent(in) :: linear(8), quadratic(8), nine, twenty_seven

    number = linear(shape%kind)
    if (shape%quadratic) number = quadratic(shape%kind)
    if (shape%kind == kind_quadrilateral .and. shape%nodes == 9) number = nine
    if (shape%kind == kind_hexahedron .and. shape%nodes == 27) number = twenty_seven
    if (number == 0) call internal_fault('a shape of elements has no kind of cell')
  end function pick

  !> Which nodes of an element VTK has one after another. Corners have the same order.
  pure function vtk_nodes(shape) result(nodes)
    type(shape_type), intent(in) :: shape  !! of the element
    integer, allocatable :: nodes(:)       !! (nodes) numbers in the element, from 1
    integer :: i

    nodes = [(i, i=1, shape%nodes)]
    if (.not. shape%quadratic) return
    select case (shape%kind)
    case (kind_point, kind_line, kind_triangle, kind_quadrilateral)
      return
    case (kind_tetrahedron)
      call order_edges(tetrahedron_edges)
    case (kind_hexahedron)
      call order_edges(hexahedron_edges)
      if (shape%nodes == 27) nodes(21:) = face_centres
    case (kind_wedge)
      call order_edges(wedge_edges)
    case (kind_pyramid)
      call internal_fault('pyramids are linear')
    case default
      call internal_fault('nodes of a kind of elements')
    end select

  contains

    !> The middles of edges in this order.
    pure subroutine order_edges(edges)
      integer, intent(in) :: edges(:, :)
      integer :: edge

      do edge = 1, size(edges, 2)
        nodes(shape%corners + edge) = shape%corners + edge_between(shape%kind, edges(:, edge))
      end do
    end subroutine order_edges

  end function vtk_nodes

end module pd_output_results_cells
