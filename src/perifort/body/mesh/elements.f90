!> Shapes of elements: nodes, shape functions with their gradients, faces.
!>
!> Nodes stand in the order of Gmsh: corners, middles of edges, centres of faces, centre. Lines,
!> quadrilaterals and hexahedra are [-1, 1]^dim in reference coordinates; triangles and tetrahedra
!> have their corners at 0 and at 1 along each axis; wedges are a triangle times [-1, 1]; pyramids
!> have the base [-1, 1]^2 at 0 and their tip at (0, 0, 1).
module pd_body_mesh_elements
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: shape_type, shape_of, shape_numbered, shape_functions, face_nodes, face_shape, &
    & edge_between
  public :: n_shapes, most_nodes, kind_point, kind_line, kind_triangle, kind_quadrilateral, &
    & kind_tetrahedron, kind_hexahedron, kind_wedge, kind_pyramid

  integer, parameter :: kind_point = 1, kind_line = 2, kind_triangle = 3, kind_quadrilateral = 4, &
    & kind_tetrahedron = 5, kind_hexahedron = 6, kind_wedge = 7, kind_pyramid = 8
  integer, parameter :: n_shapes = 16       !! shapes that meshes may have
  integer, parameter :: most_nodes = 27     !! of an element
  integer, parameter :: most_edges = 12, most_faces = 6

  !> What is the same for all elements of a shape.
  type :: shape_type
    integer :: number = 0        !! 1 to `n_shapes`
    integer :: kind = 0          !! one of `kind_*`
    integer :: dim = 0
    integer :: nodes = 0
    integer :: corners = 0
    integer :: faces = 0         !! of one dimension less
    logical :: quadratic = .false.
    character(13) :: name = ''   !! of its kind
    real(wp) :: reference(3, most_nodes) = 0.0_wp  !! coordinates of its nodes [-]
  end type shape_type

  integer, parameter :: kinds(n_shapes) = [kind_point, kind_line, kind_line, kind_triangle, &
    & kind_triangle, kind_quadrilateral, kind_quadrilateral, kind_quadrilateral, kind_tetrahedron, &
    & kind_tetrahedron, kind_hexahedron, kind_hexahedron, kind_hexahedron, kind_wedge, kind_wedge, &
    & kind_pyramid]
  integer, parameter :: node_counts(n_shapes) = [1, 2, 3, 3, 6, 4, 8, 9, 4, 10, 8, 20, 27, 6, 15, 5]
  integer, parameter :: dims(8) = [0, 1, 2, 2, 3, 3, 3, 3]
  integer, parameter :: corner_counts(8) = [1, 2, 3, 4, 4, 8, 6, 5]
  integer, parameter :: edge_counts(8) = [0, 1, 3, 4, 6, 12, 9, 8]
  integer, parameter :: face_counts(8) = [0, 2, 3, 4, 4, 6, 5, 5]
  character(13), parameter :: names(8) = [character(13) :: 'point', 'line', 'triangle', &
    & 'quadrilateral', 'tetrahedron', 'hexahedron', 'wedge', 'pyramid']

  real(wp), parameter :: square(2, 4) = reshape([-1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp, &
    & 1.0_wp, -1.0_wp, 1.0_wp], [2, 4])
  !> The corners of each edge, in the order of Gmsh; triangles and squares go around.
  integer, parameter :: around(2, 4) = reshape([1, 2, 2, 3, 3, 4, 4, 1], [2, 4])
  integer, parameter :: tetrahedron_edges(2, 6) = reshape([1, 2, 2, 3, 3, 1, 4, 1, 3, 4, 2, 4], &
    & [2, 6])
  integer, parameter :: hexahedron_edges(2, 12) = reshape([1, 2, 1, 4, 1, 5, 2, 3, 2, 6, 3, 4, 3, &
    & 7, 4, 8, 5, 6, 5, 8, 6, 7, 7, 8], [2, 12])
  integer, parameter :: wedge_edges(2, 9) = reshape([1, 2, 1, 3, 1, 4, 2, 3, 2, 5, 3, 6, 4, 5, 4, &
    & 6, 5, 6], [2, 9])
  integer, parameter :: pyramid_edges(2, 8) = reshape([1, 2, 1, 4, 1, 5, 2, 3, 2, 5, 3, 4, 3, 5, &
    & 4, 5], [2, 8])
  !> The corners of each face in the order of Abaqus, around its outward normal; 0: a triangle.
  integer, parameter :: tetrahedron_faces(4, 4) = reshape([1, 3, 2, 0, 1, 2, 4, 0, 2, 3, 4, 0, 3, &
    & 1, 4, 0], [4, 4])
  integer, parameter :: hexahedron_faces(4, 6) = reshape([1, 4, 3, 2, 5, 6, 7, 8, 1, 2, 6, 5, 2, &
    & 3, 7, 6, 3, 4, 8, 7, 4, 1, 5, 8], [4, 6])
  integer, parameter :: wedge_faces(4, 5) = reshape([1, 3, 2, 0, 4, 5, 6, 0, 1, 2, 5, 4, 2, 3, 6, &
    & 5, 3, 1, 4, 6], [4, 5])
  integer, parameter :: pyramid_faces(4, 5) = reshape([1, 4, 3, 2, 1, 2, 5, 0, 2, 3, 5, 0, 3, 4, &
    & 5, 0, 4, 1, 5, 0], [4, 5])
  !> The node at the centre of each face of a hexahedron of 27 nodes.
  integer, parameter :: face_centres(6) = [21, 26, 22, 24, 25, 23]

contains

  !> The number of the shape of a kind with so many nodes; 0 if there is none.
  pure integer function shape_of(kind, nodes) result(number)
    integer, intent(in) :: kind   !! one of `kind_*`
    integer, intent(in) :: nodes  !! number of its nodes

    do number = n_shapes, 1, -1
      if (kinds(number) == kind .and. node_counts(number) == nodes) return
    end do
  end function shape_of

  !> The shape of a number.
  pure type(shape_type) function shape_numbered(number) result(shape)
    integer, intent(in) :: number  !! 1 to `n_shapes`; another one is a fault of the program
    integer :: corner, edge, ends(2), face, four(4)

    if (number < 1 .or. number > n_shapes) call internal_fault('a shape of elements')
    shape%number = number
    shape%kind = kinds(number)
    shape%dim = dims(shape%kind)
    shape%nodes = node_counts(number)
    shape%corners = corner_counts(shape%kind)
    shape%faces = face_counts(shape%kind)
    shape%quadratic = shape%nodes > shape%corners
    shape%name = names(shape%kind)
    do corner = 1, shape%corners
      shape%reference(:, corner) = corner_place(shape%kind, corner)
    end do
    if (.not. shape%quadratic) return
    do edge = 1, edge_counts(shape%kind)
      ends = edge_corners(shape%kind, edge)
      shape%reference(:, shape%corners + edge) = (shape%reference(:, ends(1)) &
        & + shape%reference(:, ends(2)))/2
    end do
    if (shape%nodes < 27) return  ! the centre of a quadrilateral is at 0
    do face = 1, 6
      four = hexahedron_faces(:, face)
      shape%reference(:, face_centres(face)) = sum(shape%reference(:, four), dim=2)/4
    end do
  end function shape_numbered

  !> Where a corner is in reference coordinates.
  pure function corner_place(kind, corner) result(place)
    integer, intent(in) :: kind, corner
    real(wp) :: place(3)
    integer :: at

    place = 0.0_wp
    select case (kind)
    case (kind_point)
      continue
    case (kind_line)
      place(1) = 2.0_wp*corner - 3
    case (kind_triangle, kind_tetrahedron)
      if (corner > 1) place(corner - 1) = 1.0_wp
    case (kind_quadrilateral)
      place(:2) = square(:, corner)
    case (kind_hexahedron)
      place(:2) = square(:, mod(corner - 1, 4) + 1)
      place(3) = merge(-1.0_wp, 1.0_wp, corner <= 4)
    case (kind_wedge)
      at = mod(corner - 1, 3) + 1
      if (at > 1) place(at - 1) = 1.0_wp
      place(3) = merge(-1.0_wp, 1.0_wp, corner <= 3)
    case (kind_pyramid)
      if (corner <= 4) place(:2) = square(:, corner)
      if (corner == 5) place(3) = 1.0_wp
    case default
      call internal_fault('corners of a kind of elements')
    end select
  end function corner_place

  !> The two corners of an edge.
  pure function edge_corners(kind, edge) result(corners)
    integer, intent(in) :: kind, edge
    integer :: corners(2)

    corners = 0
    select case (kind)
    case (kind_line)
      corners = [1, 2]
    case (kind_triangle)
      corners = around(:, edge)
      if (edge == 3) corners = [3, 1]
    case (kind_quadrilateral)
      corners = around(:, edge)
    case (kind_tetrahedron)
      corners = tetrahedron_edges(:, edge)
    case (kind_hexahedron)
      corners = hexahedron_edges(:, edge)
    case (kind_wedge)
      corners = wedge_edges(:, edge)
    case (kind_pyramid)
      corners = pyramid_edges(:, edge)
    case default
      call internal_fault('edges of a kind of elements')
    end select
  end function edge_corners

  !> The nodes of a face, corners first, around its outward normal, and the number of its shape.
  pure subroutine face_nodes(shape, face, nodes, of_face)
    type(shape_type), intent(in) :: shape           !! of the element
    integer, intent(in) :: face                     !! its number, 1 to `shape%faces`
    integer, allocatable, intent(out) :: nodes(:)   !! (nodes of the face) numbers in the element
    integer, intent(out) :: of_face                 !! number of the face's shape
    integer :: corners(4), n, i, ends(2)

    corners = 0
    select case (shape%kind)
    case (kind_line)
      corners(1) = face
    case (kind_triangle, kind_quadrilateral)
      corners(:2) = edge_corners(shape%kind, face)
    case (kind_tetrahedron)
      corners = tetrahedron_faces(:, face)
    case (kind_hexahedron)
      corners = hexahedron_faces(:, face)
    case (kind_wedge)
      corners = wedge_faces(:, face)
    case (kind_pyramid)
      corners = pyramid_faces(:, face)
    case default
      call internal_fault('faces of a kind of elements')
    end select
    n = count(corners > 0)
    nodes = corners(:n)
    if (shape%quadratic .and. shape%dim == 2) then
      nodes = [nodes, shape%corners + face]
    else if (shape%quadratic .and. shape%dim == 3) then
      do i = 1, n
        ends = [corners(i), corners(mod(i, n) + 1)]
        nodes = [nodes, shape%corners + edge_between(shape%kind, ends)]
      end do
      if (shape%nodes == 27) nodes = [nodes, face_centres(face)]
    end if
    of_face = face_shape(shape, face)
  end subroutine face_nodes

  !> The number of the shape of a face.
  pure integer function face_shape(shape, face) result(number)
    type(shape_type), intent(in) :: shape  !! of the element
    integer, intent(in) :: face            !! its number, 1 to `shape%faces`
    integer :: corners

    select case (shape%kind)
    case (kind_line)
      number = shape_of(kind_point, 1)
      return
    case (kind_triangle, kind_quadrilateral)
      number = shape_of(kind_line, merge(3, 2, shape%quadratic))
      return
    case (kind_tetrahedron)
      corners = 3
    case (kind_hexahedron)
      corners = 4
    case (kind_wedge)
      corners = count(wedge_faces(:, face) > 0)
    case (kind_pyramid)
      corners = count(pyramid_faces(:, face) > 0)
    case default
      corners = 0
      call internal_fault('faces of a kind of elements')
    end select
    if (corners == 3) then
      number = shape_of(kind_triangle, merge(6, 3, shape%quadratic))
    else if (shape%nodes == 27) then
      number = shape_of(kind_quadrilateral, 9)
    else
      number = shape_of(kind_quadrilateral, merge(8, 4, shape%quadratic))
    end if
  end function face_shape

  !> The number of the edge between two corners.
  pure integer function edge_between(kind, ends) result(edge)
    integer, intent(in) :: kind     !! one of `kind_*`
    integer, intent(in) :: ends(2)  !! the corners, in any order; not those of an edge: a fault of
                                    !! the program
    integer :: corners(2)

    do edge = 1, edge_counts(kind)
      corners = edge_corners(kind, edge)
      if (all(corners == ends) .or. all(corners == ends([2, 1]))) return
    end do
    call internal_fault('an edge between corners')
  end function edge_between

  !> The shape functions and their gradients in reference coordinates.
  pure subroutine shape_functions(shape, xi, values, gradients)
    type(shape_type), intent(in) :: shape              !! of the element
    real(wp), intent(in) :: xi(3)                      !! place in reference coordinates [-]
    real(wp), intent(out) :: values(:)                 !! (nodes) [-]
    real(wp), intent(out) :: gradients(:, :)           !! (3, nodes) [-]
    integer :: i

    gradients = 0.0_wp
    select case (shape%kind)
    case (kind_point)
      values = 1.0_wp
    case (kind_line, kind_quadrilateral, kind_hexahedron)
      do i = 1, shape%nodes
        if (shape%nodes == 8 .and. shape%dim == 2 .or. shape%nodes == 20) then
          call serendipity(shape%dim, shape%reference(:, i), xi, values(i), gradients(:, i))
        else
          call lagrange(shape%dim, shape%quadratic, shape%reference(:, i), xi, values(i), &
            & gradients(:, i))
        end if
      end do
    case (kind_triangle, kind_tetrahedron)
      call simplex(shape, xi, values, gradients)
    case (kind_wedge)
      call wedge(shape, xi, values, gradients)
    case (kind_pyramid)
      call pyramid(xi, values, gradients)
    case default
      call internal_fault('shape functions of a kind of elements')
    end select
  end subroutine shape_functions

  !> Products of Lagrange's polynomials of degree 1 or 2.
  pure subroutine lagrange(dim, quadratic, node, xi, value, gradient)
    integer, intent(in) :: dim
    logical, intent(in) :: quadratic
    real(wp), intent(in) :: node(3), xi(3)
    real(wp), intent(out) :: value, gradient(3)
    real(wp) :: one(3), slope(3)
    integer :: c

    one = 1.0_wp
    slope = 0.0_wp
    do c = 1, dim
      if (.not. quadratic) then
        one(c) = (1 + xi(c)*node(c))/2
        slope(c) = node(c)/2
      else if (abs(node(c)) < 0.5_wp) then
        one(c) = 1 - xi(c)**2
        slope(c) = -2*xi(c)
      else
        one(c) = xi(c)*(xi(c) + node(c))/2
        slope(c) = xi(c) + node(c)/2
      end if
    end do
    value = product(one)
    gradient = slope*[one(2)*one(3), one(1)*one(3), one(1)*one(2)]
  end subroutine lagrange

  !> Quadrilaterals of 8 and hexahedra of 20 nodes.
  pure subroutine serendipity(dim, node, xi, value, gradient)
    integer, intent(in) :: dim
    real(wp), intent(in) :: node(3), xi(3)
    real(wp), intent(out) :: value, gradient(3)
    real(wp) :: one(3), slope(3), tail
    integer :: c

    one = 1.0_wp
    slope = 0.0_wp
    do c = 1, dim
      if (abs(node(c)) < 0.5_wp) then
        one(c) = 1 - xi(c)**2
        slope(c) = -2*xi(c)
      else
        one(c) = (1 + xi(c)*node(c))/2
        slope(c) = node(c)/2
      end if
    end do
    value = product(one)
    gradient = slope*[one(2)*one(3), one(1)*one(3), one(1)*one(2)]
    if (any(abs(node(:dim)) < 0.5_wp)) return
    tail = dot_product(xi(:dim), node(:dim)) - (dim - 1)
    gradient = gradient*tail
    gradient(:dim) = gradient(:dim) + value*node(:dim)
    value = value*tail
  end subroutine serendipity

  !> Triangles and tetrahedra, by the coordinates that are 1 at one corner and 0 at the others.
  pure subroutine simplex(shape, xi, values, gradients)
    type(shape_type), intent(in) :: shape
    real(wp), intent(in) :: xi(3)
    real(wp), intent(out) :: values(:), gradients(:, :)
    real(wp) :: l(4), dl(3, 4)
    integer :: i, ends(2)

    call barycentric(shape%dim, xi, l, dl)
    gradients = 0.0_wp
    if (.not. shape%quadratic) then
      values(:shape%corners) = l(:shape%corners)
      gradients(:, :shape%corners) = dl(:, :shape%corners)
      return
    end if
    do i = 1, shape%corners
      values(i) = l(i)*(2*l(i) - 1)
      gradients(:, i) = (4*l(i) - 1)*dl(:, i)
    end do
    do i = 1, edge_counts(shape%kind)
      ends = edge_corners(shape%kind, i)
      values(shape%corners + i) = 4*l(ends(1))*l(ends(2))
      gradients(:, shape%corners + i) = 4*(l(ends(1))*dl(:, ends(2)) + l(ends(2))*dl(:, ends(1)))
    end do
  end subroutine simplex

  !> The coordinates of a triangle or tetrahedron, and their gradients.
  pure subroutine barycentric(dim, xi, l, dl)
    integer, intent(in) :: dim
    real(wp), intent(in) :: xi(3)
    real(wp), intent(out) :: l(4), dl(3, 4)
    integer :: c

    l = 0.0_wp
    dl = 0.0_wp
    l(1) = 1 - sum(xi(:dim))
    dl(:dim, 1) = -1.0_wp
    do c = 1, dim
      l(c + 1) = xi(c)
      dl(c, c + 1) = 1.0_wp
    end do
  end subroutine barycentric

  !> Wedges of 6 and 15 nodes.
  pure subroutine wedge(shape, xi, values, gradients)
    type(shape_type), intent(in) :: shape
    real(wp), intent(in) :: xi(3)
    real(wp), intent(out) :: values(:), gradients(:, :)
    real(wp) :: l(4), dl(3, 4), side, z
    integer :: i, a, b, ends(2), n

    call barycentric(2, xi, l, dl)
    z = xi(3)
    do i = 1, 6
      a = mod(i - 1, 3) + 1
      side = merge(-1.0_wp, 1.0_wp, i <= 3)
      values(i) = l(a)*(1 + side*z)/2
      gradients(:, i) = dl(:, a)*(1 + side*z)/2
      gradients(3, i) = l(a)*side/2
      if (.not. shape%quadratic) cycle
      values(i) = l(a)*((2*l(a) - 1)*(1 + side*z) - (1 - z**2))/2
      gradients(:, i) = dl(:, a)*((4*l(a) - 1)*(1 + side*z) - (1 - z**2))/2
      gradients(3, i) = l(a)*((2*l(a) - 1)*side + 2*z)/2
    end do
    if (.not. shape%quadratic) return
    do i = 1, 9
      n = 6 + i
      ends = wedge_edges(:, i)
      a = mod(ends(1) - 1, 3) + 1
      b = mod(ends(2) - 1, 3) + 1
      if (a == b) then
        values(n) = l(a)*(1 - z**2)
        gradients(:, n) = dl(:, a)*(1 - z**2)
        gradients(3, n) = -2*z*l(a)
      else
        side = merge(-1.0_wp, 1.0_wp, ends(1) <= 3)
        values(n) = 2*l(a)*l(b)*(1 + side*z)
        gradients(:, n) = 2*(l(a)*dl(:, b) + l(b)*dl(:, a))*(1 + side*z)
        gradients(3, n) = 2*l(a)*l(b)*side
      end if
    end do
  end subroutine wedge

  !> Pyramids of 5 nodes: rational functions, linear on every face. At the tip they have no gradient
  !> in the plane of the base; no rule has a point there.
  pure subroutine pyramid(xi, values, gradients)
    real(wp), intent(in) :: xi(3)
    real(wp), intent(out) :: values(:), gradients(:, :)
    real(wp) :: left, a, b
    integer :: i

    left = 1 - xi(3)
    if (left <= 0.0_wp) then
      values = [0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp]
      gradients = 0.0_wp
      return
    end if
    do i = 1, 4
      a = left + square(1, i)*xi(1)
      b = left + square(2, i)*xi(2)
      values(i) = a*b/(4*left)
      gradients(1, i) = square(1, i)*b/(4*left)
      gradients(2, i) = square(2, i)*a/(4*left)
      gradients(3, i) = -(a + b)/(4*left) + a*b/(4*left**2)
    end do
    values(5) = xi(3)
    gradients(:, 5) = [0.0_wp, 0.0_wp, 1.0_wp]
  end subroutine pyramid

end module pd_body_mesh_elements
