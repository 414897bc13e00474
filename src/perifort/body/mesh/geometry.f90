!> Volumes, centres and points of elements, areas and normals of their faces, by quadrature of the
!> map from reference coordinates (equation 7.1).
module pd_body_mesh_geometry
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i4
  use pd_base_text, only: to_text
  use pd_base_vectors, only: cross
  use pd_body_mesh_elements, only: face_nodes, most_nodes, n_shapes, shape_functions, shape_type
  use pd_body_mesh_mesh, only: all_shapes, element_text, fault_of_file, mesh_type
  use pd_body_mesh_quadrature, only: counts_of_kind, fine_rule, gauss_rule, rule_type
  implicit none (type, external)
  private
  public :: mesh_points, table_type, table_of, face_geometry

  !> The shape functions of a shape at the points of a rule.
  type :: table_type
    type(rule_type) :: rule
    real(wp), allocatable :: values(:, :)        !! (nodes, points) [-]
    real(wp), allocatable :: gradients(:, :, :)  !! (3, nodes, points) [-]
  end type table_type

  real(wp), parameter :: flat = 1.0e-12_wp  !! volume of an element over its extent^dim that is none

contains

  !> The table of a shape and a rule.
  pure subroutine table_of(shape, rule, table)
    type(shape_type), intent(in) :: shape    !! of elements
    type(rule_type), intent(in) :: rule      !! on its reference element
    type(table_type), intent(out) :: table   !! shape functions at the points of the rule
    integer :: i, n

    n = size(rule%weight)
    table%rule = rule
    allocate (table%values(shape%nodes, n), table%gradients(3, shape%nodes, n))
    do i = 1, n
      call shape_functions(shape, rule%place(:, i), table%values(:, i), table%gradients(:, :, i))
    end do
  end subroutine table_of

  !> The points of a mesh: of each element of the scene's dimension its centre, or its Gauss points.
  !> An error, with the element, if one is inverted or has no volume, or if a shape has no rule of
  !> that number. The rule of the points gives their volumes; centres are those of the curved
  !> element, its volume by a rule that is exact for it.
  subroutine mesh_points(mesh, dim, per_element, depth, x, volume, element, error)
    type(mesh_type), intent(in) :: mesh                  !! checked, positions in metres
    integer, intent(in) :: dim                           !! of the scene
    integer, intent(in) :: per_element                   !! points of an element; 1: its centre
    real(wp), intent(in) :: depth                        !! what makes an area or length a volume
    real(wp), allocatable, intent(out) :: x(:, :)        !! (points, dim) positions [m]
    real(wp), allocatable, intent(out) :: volume(:)      !! (points) [m3]
    integer(i4), allocatable, intent(out) :: element(:)  !! (points) the element of each
    type(error_type), allocatable, intent(out) :: error
    type(shape_type) :: shapes(n_shapes)
    type(table_type) :: fine(n_shapes), gauss(n_shapes)
    type(rule_type) :: rule
    logical :: ready(n_shapes)
    integer :: e, n, s
    real(wp) :: nodes(3, most_nodes), whole, centre(3), sign

    shapes = all_shapes()
    ready = .false.
    n = 0
    do e = 1, mesh%n_elements
      s = mesh%shape(e)
      if (s == 0) cycle
      if (shapes(s)%dim /= dim) cycle
      n = n + per_element
      if (ready(s)) cycle
      call fine_rule(shapes(s)%kind, shapes(s)%quadratic, rule)
      call table_of(shapes(s), rule, fine(s))
      ready(s) = .true.
      if (per_element == 1) cycle
      if (all(counts_of_kind(shapes(s)%kind) /= per_element)) then
        call fault_of_file(mesh, element_text(mesh, e)//' cannot have points_per_element = '// &
          & to_text(per_element), error, 'it may have 1 or '//listed(counts_of_kind( &
          & shapes(s)%kind)))
        return
      end if
      call gauss_rule(shapes(s)%kind, per_element, rule)
      call table_of(shapes(s), rule, gauss(s))
    end do
    allocate (x(n, dim), volume(n), element(n))
    n = 0
    do e = 1, mesh%n_elements
      s = mesh%shape(e)
      if (s == 0) cycle
      if (shapes(s)%dim /= dim) cycle
      nodes(:, :shapes(s)%nodes) = mesh%x(:, mesh%nodes_of(e))
      call measure(mesh, e, dim, fine(s), nodes(:, :shapes(s)%nodes), whole, centre, sign, error)
      if (.not. allocated(error)) call add_points()
      if (allocated(error)) return
    end do

  contains

    !> The points of one element.
    subroutine add_points()
      real(wp) :: size_of_map
      integer :: i

      if (per_element == 1) then
        n = n + 1
        x(n, :) = centre(:dim)
        volume(n) = whole*depth
        element(n) = int(e, i4)
        return
      end if
      do i = 1, per_element
        n = n + 1
        x(n, :) = matmul(nodes(:dim, :shapes(s)%nodes), gauss(s)%values(:, i))
        size_of_map = sign*determinant_at(dim, nodes(:, :shapes(s)%nodes), &
          & gauss(s)%gradients(:, :, i))
        volume(n) = gauss(s)%rule%weight(i)*size_of_map*depth
        element(n) = int(e, i4)
        if (volume(n) > 0.0_wp) cycle
        call fault_of_file(mesh, element_text(mesh, e)//' is inverted at one of its points', error)
        return
      end do
    end subroutine add_points

  end subroutine mesh_points

  !> Volume and centre of an element, and the sign of its map: plane elements and lines may run
  !> either way, all others must not.
  subroutine measure(mesh, e, dim, table, nodes, volume, centre, sign, error)
    type(mesh_type), intent(in) :: mesh
    integer, intent(in) :: e, dim
    type(table_type), intent(in) :: table
    real(wp), intent(in) :: nodes(:, :)
    real(wp), intent(out) :: volume, centre(3), sign
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: size_of_map, least, most, extent
    integer :: i

    volume = 0.0_wp
    centre = 0.0_wp
    least = huge(least)
    most = -huge(most)
    do i = 1, size(table%rule%weight)
      size_of_map = determinant_at(dim, nodes, table%gradients(:, :, i))
      least = min(least, size_of_map)
      most = max(most, size_of_map)
      volume = volume + table%rule%weight(i)*size_of_map
      centre = centre + table%rule%weight(i)*size_of_map*(matmul(nodes, table%values(:, i)) &
        & - nodes(:, 1))
    end do
    extent = maxval(maxval(nodes(:dim, :), dim=2) - minval(nodes(:dim, :), dim=2))
    sign = merge(1.0_wp, -1.0_wp, volume > 0.0_wp)
    if (abs(volume) <= flat*extent**dim) then
      call fault_of_file(mesh, element_text(mesh, e)//' has no volume', error, &
        & 'do some of its nodes coincide, or lie on one line or in one plane?')
    else if (volume < 0.0_wp .and. dim == 3) then
      call fault_of_file(mesh, element_text(mesh, e)//' is inverted: its volume is '// &
        & to_text(volume)//' m3', error, 'the order of its nodes is that of its mirror image')
    else if (merge(least, -most, sign > 0.0_wp) <= 0.0_wp) then
      call fault_of_file(mesh, element_text(mesh, e)//' is partly inverted', error, &
        & 'its map turns over inside of it: is it folded, or too strongly curved?')
    end if
    if (allocated(error)) return
    centre = nodes(:, 1) + centre/volume
    volume = abs(volume)
  end subroutine measure

  !> The determinant of the map, with its sign.
  pure real(wp) function determinant_at(dim, nodes, gradients) result(det)
    integer, intent(in) :: dim
    real(wp), intent(in) :: nodes(:, :)       !! (3, nodes)
    real(wp), intent(in) :: gradients(:, :)   !! (3, nodes)
    real(wp) :: j(3, 3)
    integer :: c

    do c = 1, dim
      j(:, c) = matmul(nodes, gradients(c, :))
    end do
    select case (dim)
    case (1)
      det = j(1, 1)
    case (2)
      det = j(1, 1)*j(2, 2) - j(2, 1)*j(1, 2)
    case default
      det = dot_product(j(:, 1), cross(j(:, 2), j(:, 3)))
    end select
  end function determinant_at

  !> Area vector along the outward normal of an element's face, the area itself, and the centre.
  pure subroutine face_geometry(mesh, shape, element, face, table, dim, depth, vector, area, centre)
    type(mesh_type), intent(in) :: mesh     !! checked, positions in metres
    type(shape_type), intent(in) :: shape   !! of the element
    integer, intent(in) :: element          !! of the scene's dimension
    integer, intent(in) :: face             !! its face
    type(table_type), intent(in) :: table   !! of the face's shape and a fine rule
    integer, intent(in) :: dim              !! of the scene
    real(wp), intent(in) :: depth           !! what makes an area or length a volume
    real(wp), intent(out) :: vector(3)      !! the integral of the outward normal [m2]
    real(wp), intent(out) :: area           !! [m2]
    real(wp), intent(out) :: centre(3)      !! [m]
    integer, allocatable :: numbers(:)
    integer(i4), allocatable :: of_element(:)
    real(wp), allocatable :: nodes(:, :)
    real(wp) :: normal(3), size_of_map, sign, inside(3)
    integer :: i, of_face

    of_element = mesh%nodes_of(element)
    call face_nodes(shape, face, numbers, of_face)
    nodes = mesh%x(:, of_element(numbers))
    vector = 0.0_wp
    centre = 0.0_wp
    area = 0.0_wp
    do i = 1, size(table%rule%weight)
      associate (gradients => table%gradients(:, :, i), weight => table%rule%weight(i))
        select case (dim)
        case (1)
          normal = [1.0_wp, 0.0_wp, 0.0_wp]
        case (2)
          normal = matmul(nodes, gradients(1, :))
          normal = [normal(2), -normal(1), 0.0_wp]
        case default
          normal = cross(matmul(nodes, gradients(1, :)), matmul(nodes, gradients(2, :)))
        end select
        size_of_map = norm2(normal)
        vector = vector + weight*normal
        area = area + weight*size_of_map
        centre = centre + weight*size_of_map*(matmul(nodes, table%values(:, i)) - nodes(:, 1))
      end associate
    end do
    centre = nodes(:, 1) + centre/area
    ! an element may run either way, and an end of a line is no surface: look from its inside
    inside = sum(mesh%x(:, of_element(:shape%corners)), dim=2)/shape%corners
    sign = 1.0_wp
    if (dim < 3 .and. dot_product(vector, centre - inside) < 0.0_wp) sign = -1.0_wp
    vector = sign*depth*vector
    area = depth*area
  end subroutine face_geometry

  !> `8 or 27`
  pure function listed(counts) result(text)
    integer, intent(in) :: counts(:)
    character(:), allocatable :: text
    integer :: i

    text = ''
    do i = 1, size(counts)
      if (i > 1) text = text//' or '
      text = text//to_text(counts(i))
    end do
  end function listed

end module pd_body_mesh_geometry
