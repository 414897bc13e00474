!> A body that is a mesh: its points, which elements they belong to, its faces, and what its names
!> mean: sets of points, and facets with areas and normals.
module pd_body_mesh_part
  use pd_base_error, only: error_type, internal_fault
  use pd_base_joining, only: each_alone, unite
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_lookup, only: lookup_type, mix
  use pd_base_text, only: join, lower_case, nearest_name, to_text
  use pd_body_mesh_elements, only: face_nodes, face_shape, n_shapes, shape_type
  use pd_body_mesh_geometry, only: face_geometry, table_of, table_type
  use pd_body_mesh_mesh, only: all_shapes, element_text, fault_of_file, mesh_type, nodes_key, &
    & set_of_elements, set_of_faces, set_of_nodes, sorted
  use pd_body_mesh_moments, only: moments_type
  use pd_body_mesh_quadrature, only: fine_rule, rule_type
  implicit none (type, external)
  private
  public :: part_type, facets_type, find_faces, points_named, facets_named, outer_facets, &
    & count_pieces, count_twins

  !> A face between elements or at the surface.
  type :: face_type
    integer(i4) :: corners(4) = 0_i4  !! ascending, 0 first
    integer(i4) :: element(2) = 0_i4  !! the elements that have it; the second is 0 at the surface
    integer(i4) :: face = 0_i4        !! its number in the first element
  end type face_type

  type :: part_type
    integer :: body = 0                      !! number of the body
    integer :: dim = 0
    integer :: first = 1                     !! number of its first point among all
    integer :: n_points = 0
    real(wp) :: depth = 1.0_wp               !! what makes an area or length a volume
    type(mesh_type) :: mesh                  !! positions in metres
    integer(i4), allocatable :: element(:)   !! (n_points) the element of each point
    integer(i4), allocatable :: points(:, :) !! (2, elements) first and last point; 1, 0: none
    type(face_type), allocatable :: faces(:)
    type(lookup_type) :: face_numbers
    type(moments_type), allocatable :: moments  !! of its surface areas, if they were balanced
  end type part_type

  !> Some faces of a part.
  type :: facets_type
    integer :: n = 0
    integer(i4), allocatable :: face(:)      !! (n) number among the part's faces
    real(wp), allocatable :: area(:)         !! (n) [m2]
    real(wp), allocatable :: vector(:, :)    !! (3, n) area along the outward normal [m2]
    real(wp), allocatable :: centre(:, :)    !! (3, n) [m]
    logical, allocatable :: outer(:)         !! (n) whether no other element is behind it
  end type facets_type

contains

  !> The faces of all elements, and which points each element has. An error if a face belongs to
  !> three elements, or if the mesh has elements of one dimension less that are faces of none.
  subroutine find_faces(part, error)
    type(part_type), intent(inout) :: part  !! with its mesh and its points' elements
    type(error_type), allocatable, intent(out) :: error
    type(shape_type) :: shapes(n_shapes)
    type(face_type), allocatable :: longer(:)
    integer(i4), allocatable :: nodes(:)
    integer(i4) :: corners(4)
    integer :: e, f, p, number
    logical :: is_new

    shapes = all_shapes()
    allocate (part%points(2, part%mesh%n_elements))
    part%points(1, :) = 1_i4
    part%points(2, :) = 0_i4
    do p = part%n_points, 1, -1
      e = part%element(p)
      if (part%points(2, e) == 0_i4) part%points(2, e) = int(p, i4)
      part%points(1, e) = int(p, i4)
    end do
    allocate (part%faces(1024))
    do e = 1, part%mesh%n_elements
      if (part%points(2, e) == 0_i4) cycle
      nodes = part%mesh%nodes_of(e)
      associate (shape => shapes(part%mesh%shape(e)))
        do f = 1, shape%faces
          corners = corners_of(shape, f, nodes)
          call number_of_face(part, corners, number, is_new)
          if (number > size(part%faces)) then
            allocate (longer(2*number))
            longer(:size(part%faces)) = part%faces
            call move_alloc(longer, part%faces)
          end if
          associate (face => part%faces(number))
            if (is_new) then
              face%corners = corners
              face%element(1) = int(e, i4)
              face%face = int(f, i4)
            else if (face%element(2) == 0_i4) then
              face%element(2) = int(e, i4)
            else
              call fault_of_file(part%mesh, element_text(part%mesh, e)//' shares a face with '// &
                & 'elements '//to_text(part%mesh%element_tag(face%element(1)))//' and '// &
                & to_text(part%mesh%element_tag(face%element(2))), error, &
                & 'a face has one element on each side')
              return
            end if
          end associate
        end do
      end associate
    end do
    do e = 1, part%mesh%n_elements
      if (part%mesh%shape(e) == 0) cycle
      if (shapes(part%mesh%shape(e))%dim /= part%dim - 1) cycle
      if (face_of_element(part, shapes(part%mesh%shape(e)), e) > 0) cycle
      call fault_of_file(part%mesh, element_text(part%mesh, e)//' is a face of no element of '// &
        & 'dimension '//to_text(part%dim), error, 'a body has elements of one dimension; '// &
        & 'those of one less may only name its faces')
      return
    end do
  end subroutine find_faces

  !> The corners of a face in ascending order, behind zeros.
  pure function corners_of(shape, face, nodes) result(corners)
    type(shape_type), intent(in) :: shape
    integer, intent(in) :: face
    integer(i4), intent(in) :: nodes(:)
    integer(i4) :: corners(4)
    integer, allocatable :: numbers(:)
    integer :: n, of_face

    call face_nodes(shape, face, numbers, of_face)
    n = min(size(numbers), corner_count(shape, size(numbers)))
    corners = 0_i4
    corners(5 - n:) = sorted(nodes(numbers(:n)))
  end function corners_of

  !> Corners of a face with so many nodes.
  pure integer function corner_count(shape, nodes) result(corners)
    type(shape_type), intent(in) :: shape
    integer, intent(in) :: nodes

    corners = nodes
    if (.not. shape%quadratic) return
    select case (shape%dim)
    case (1)
      corners = 1
    case (2)
      corners = 2
    case default
      corners = merge(3, 4, nodes == 6)
    end select
  end function corner_count

  !> The number of the face with these corners; a new one gets the next.
  subroutine number_of_face(part, corners, number, is_new)
    type(part_type), intent(inout) :: part
    integer(i4), intent(in) :: corners(4)
    integer, intent(out) :: number
    logical, intent(out) :: is_new

    call part%face_numbers%number_of(nodes_key(corners), number, is_new)
    if (is_new) return
    ! two faces may have one key, if hardly ever: the later one then is of its own
    if (all(part%faces(number)%corners == corners)) return
    call part%face_numbers%own_number(number)
    is_new = .true.
  end subroutine number_of_face

  !> The number of the face that an element of one dimension less is, 0 if it is none.
  pure integer function face_of_element(part, shape, element) result(number)
    type(part_type), intent(in) :: part
    type(shape_type), intent(in) :: shape
    integer, intent(in) :: element
    integer(i4), allocatable :: nodes(:)

    nodes = part%mesh%nodes_of(element)
    number = face_with(part, nodes(:shape%corners))
  end function face_of_element

  !> The number of the face with these corners, 0 if there is none.
  pure integer function face_with(part, nodes) result(number)
    type(part_type), intent(in) :: part
    integer(i4), intent(in) :: nodes(:)
    integer(i4) :: corners(4)

    corners = 0_i4
    corners(5 - size(nodes):) = sorted(nodes)
    number = part%face_numbers%look(nodes_key(corners))
    if (number == 0) return
    if (any(part%faces(number)%corners /= corners)) number = 0
  end function face_with

  !> Which points of a part a name means: those of the elements of a set, of elements with a node in
  !> a set of nodes. An error if there is no such set, or if it has no points.
  subroutine points_named(part, name, chosen, error)
    type(part_type), intent(in) :: part            !! with its faces
    character(*), intent(in) :: name               !! of a set of the mesh
    logical, allocatable, intent(out) :: chosen(:) !! (n_points)
    type(error_type), allocatable, intent(out) :: error
    logical, allocatable :: marked(:)
    integer :: s, i, p, e
    logical :: known

    allocate (chosen(part%n_points), source=.false.)
    known = .false.
    do s = 1, part%mesh%n_sets
      if (.not. means(part, s, name)) cycle
      associate (set => part%mesh%sets(s))
        select case (set%of)
        case (set_of_elements)
          do i = 1, set%n
            e = set%member(i)
            chosen(part%points(1, e):part%points(2, e)) = .true.
          end do
        case (set_of_nodes)
          allocate (marked(part%mesh%n_nodes), source=.false.)
          marked(set%member(:set%n)) = .true.
          do p = 1, part%n_points
            chosen(p) = chosen(p) .or. any(marked(part%mesh%nodes_of(int(part%element(p)))))
          end do
          deallocate (marked)
        case default
          cycle  ! faces have no points
        end select
      end associate
      known = .true.
    end do
    if (.not. known) then
      call unknown_name(part, name, 'points', error)
    else if (.not. any(chosen)) then
      call fault_of_file(part%mesh, "the set '"//trim(name)//"' holds no points: none of its "// &
        & 'elements has the dimension '//to_text(part%dim), error)
    end if
  end subroutine points_named

  !> The facets that a name means: elements of one dimension less, faces of a surface, faces of the
  !> outside with all corners in a set of nodes. An error if there is no such set, if it has no
  !> facets, or if one of its faces belongs to no element of the body.
  subroutine facets_named(part, name, facets, error)
    type(part_type), intent(in) :: part         !! with its faces
    character(*), intent(in) :: name            !! of a set of the mesh
    type(facets_type), intent(out) :: facets    !! each face once, in the order of the faces
    type(error_type), allocatable, intent(out) :: error
    type(shape_type) :: shapes(n_shapes)
    logical, allocatable :: chosen(:), marked(:)
    integer :: s, i, f
    logical :: known

    shapes = all_shapes()
    allocate (chosen(part%face_numbers%count), source=.false.)
    known = .false.
    do s = 1, part%mesh%n_sets
      if (.not. means(part, s, name)) cycle
      known = .true.
      associate (set => part%mesh%sets(s))
        select case (set%of)
        case (set_of_elements)
          do i = 1, set%n
            associate (shape => shapes(part%mesh%shape(set%member(i))))
              if (shape%dim /= part%dim - 1) cycle
              chosen(face_of_element(part, shape, int(set%member(i)))) = .true.
            end associate
          end do
        case (set_of_faces)
          call choose_faces(part, shapes, s, chosen, error)
          if (allocated(error)) return
        case (set_of_nodes)
          allocate (marked(0:part%mesh%n_nodes), source=.false.)
          marked(0) = .true.
          marked(set%member(:set%n)) = .true.
          do f = 1, size(chosen)
            if (part%faces(f)%element(2) > 0_i4) cycle
            if (all(marked(part%faces(f)%corners))) chosen(f) = .true.
          end do
          deallocate (marked)
        case default
          call internal_fault('a kind of sets')
        end select
      end associate
    end do
    if (.not. known) then
      call unknown_name(part, name, 'facets', error)
    else if (.not. any(chosen)) then
      call fault_of_file(part%mesh, "the set '"//trim(name)//"' holds no facets of the body", &
        & error, "as a side it needs elements of dimension "//to_text(part%dim - 1)// &
        & ', a surface, or all nodes of some faces')
    else
      call gather_facets(part, shapes, chosen, facets)
    end if
  end subroutine facets_named

  !> Mark the faces of a surface.
  subroutine choose_faces(part, shapes, s, chosen, error)
    type(part_type), intent(in) :: part
    type(shape_type), intent(in) :: shapes(:)
    integer, intent(in) :: s
    logical, intent(inout) :: chosen(:)
    type(error_type), allocatable, intent(out) :: error
    integer(i4), allocatable :: nodes(:)
    integer, allocatable :: numbers(:)
    integer :: i, e, f, number, of_face

    associate (set => part%mesh%sets(s))
      do i = 1, set%n
        e = set%member(i)
        if (part%points(2, e) == 0_i4 .or. set%face(i) > shapes(part%mesh%shape(e))%faces) then
          call fault_of_file(part%mesh, "the surface '"//set%name//"' names face "// &
            & to_text(int(set%face(i)))//' of '//element_text(part%mesh, e)//', which has none', &
            & error)
          return
        end if
        nodes = part%mesh%nodes_of(e)
        do f = 1, shapes(part%mesh%shape(e))%faces
          if (set%face(i) /= 0_i4 .and. set%face(i) /= f) cycle
          call face_nodes(shapes(part%mesh%shape(e)), f, numbers, of_face)
          number = face_with(part, nodes(numbers(:corner_count(shapes(part%mesh%shape(e)), &
            & size(numbers)))))
          if (set%face(i) == 0_i4 .and. part%faces(number)%element(2) > 0_i4) cycle
          chosen(number) = .true.
        end do
      end do
    end associate
  end subroutine choose_faces

  !> All facets of the surface.
  subroutine outer_facets(part, facets)
    type(part_type), intent(in) :: part       !! with its faces
    type(facets_type), intent(out) :: facets  !! in the order of the faces
    logical, allocatable :: chosen(:)

    chosen = part%faces(:part%face_numbers%count)%element(2) == 0_i4
    call gather_facets(part, all_shapes(), chosen, facets)
  end subroutine outer_facets

  !> Areas, normals and centres of the chosen faces.
  subroutine gather_facets(part, shapes, chosen, facets)
    type(part_type), intent(in) :: part
    type(shape_type), intent(in) :: shapes(:)
    logical, intent(in) :: chosen(:)
    type(facets_type), intent(out) :: facets
    type(table_type) :: tables(n_shapes)
    type(rule_type) :: rule
    logical :: ready(n_shapes)
    integer :: i, f, s, e

    facets%n = count(chosen)
    facets%face = pack([(int(f, i4), f=1, size(chosen))], chosen)
    allocate (facets%area(facets%n), facets%vector(3, facets%n), facets%centre(3, facets%n), &
      & facets%outer(facets%n))
    ready = .false.
    do i = 1, facets%n
      associate (face => part%faces(facets%face(i)))
        e = face%element(1)
        associate (shape => shapes(part%mesh%shape(e)))
          s = face_shape(shape, int(face%face))
          if (.not. ready(s)) then
            call fine_rule(shapes(s)%kind, .true., rule)
            call table_of(shapes(s), rule, tables(s))
            ready(s) = .true.
          end if
          call face_geometry(part%mesh, shape, e, int(face%face), tables(s), part%dim, &
            & part%depth, facets%vector(:, i), facets%area(i), facets%centre(:, i))
        end associate
        facets%outer(i) = face%element(2) == 0_i4
      end associate
    end do
  end subroutine gather_facets

  !> Whether set `s` is named so: as it is written if some set is, else in any case of letters.
  pure logical function means(part, s, name)
    type(part_type), intent(in) :: part
    integer, intent(in) :: s
    character(*), intent(in) :: name
    integer :: i

    means = part%mesh%sets(s)%name == name
    if (means .or. lower_case(part%mesh%sets(s)%name) /= lower_case(name)) return
    do i = 1, part%mesh%n_sets
      if (part%mesh%sets(i)%name == name) return
    end do
    means = .true.
  end function means

  !> An error that names the sets there are.
  subroutine unknown_name(part, name, what, error)
    type(part_type), intent(in) :: part
    character(*), intent(in) :: name, what
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: longest = 64, most = 20
    character(longest) :: names(min(most, part%mesh%n_sets))
    character(:), allocatable :: note, nearest
    integer :: i

    do i = 1, size(names)
      names(i) = part%mesh%sets(i)%name
    end do
    note = 'the mesh has no named sets'
    if (size(names) > 0) then
      note = 'it has: '//join(names, ', ')
      nearest = nearest_name(trim(name), names)
      if (len(nearest) > 0) note = "did you mean '"//nearest//"'?  "//note
    end if
    call fault_of_file(part%mesh, 'the mesh has no set of '//what//" named '"//trim(name)//"'", &
      & error, note)
  end subroutine unknown_name

  !> In how many pieces a part falls that share no node.
  integer function count_pieces(part) result(pieces)
    type(part_type), intent(in) :: part  !! with its faces
    integer(i4), allocatable :: lowest(:), nodes(:)
    logical, allocatable :: used(:)
    integer :: e, i

    allocate (used(part%mesh%n_nodes), source=.false.)
    lowest = each_alone(part%mesh%n_nodes)
    do e = 1, part%mesh%n_elements
      if (part%points(2, e) == 0_i4) cycle
      nodes = part%mesh%nodes_of(e)
      used(nodes) = .true.
      do i = 2, size(nodes)
        call unite(lowest, nodes(1), nodes(i))
      end do
    end do
    pieces = count([(used(i) .and. lowest(i) == i, i=1, part%mesh%n_nodes)])
  end function count_pieces

  !> How many nodes of elements lie on another one, within 1e-6 of `spacing`.
  integer function count_twins(part, spacing) result(twins)
    type(part_type), intent(in) :: part  !! with its faces
    real(wp), intent(in) :: spacing      !! the smallest of its points [m]
    real(wp), parameter :: same = 1.0e-6_wp, coarse = 1.0e-3_wp
    type(lookup_type) :: table
    integer(i4), allocatable :: last(:), before(:)
    logical, allocatable :: used(:)
    integer(i8) :: key, cell(3)
    real(wp) :: low(3)
    integer :: n, e, number, other, corner, c
    logical :: is_new, found

    twins = 0
    allocate (used(part%mesh%n_nodes), source=.false.)
    allocate (last(part%mesh%n_nodes), before(part%mesh%n_nodes), source=0_i4)
    do e = 1, part%mesh%n_elements
      if (part%points(2, e) > 0_i4) used(part%mesh%nodes_of(e)) = .true.
    end do
    do c = 1, 3
      low(c) = minval(part%mesh%x(c, :part%mesh%n_nodes))
    end do
    ! nodes of a cell form a chain; a twin is in the cell, or in one next to it if that is near
    do n = 1, part%mesh%n_nodes
      if (.not. used(n)) cycle
      found = .false.
      do corner = 0, 7
        cell = cell_at(part%mesh%x(:, n) + same*spacing*merge(1.0_wp, -1.0_wp, &
          & btest(corner, [0, 1, 2])))
        number = table%look(mix(mix(mix(0_i8, cell(1)), cell(2)), cell(3)))
        if (number == 0) cycle
        other = last(number)
        do while (other > 0 .and. .not. found)
          if (norm2(part%mesh%x(:, other) - part%mesh%x(:, n)) <= same*spacing) found = .true.
          other = before(other)
        end do
      end do
      if (found) twins = twins + 1
      cell = cell_at(part%mesh%x(:, n))
      key = mix(mix(mix(0_i8, cell(1)), cell(2)), cell(3))
      call table%number_of(key, number, is_new)
      before(n) = last(number)
      last(number) = int(n, i4)
    end do

  contains

    !> The cell of a place.
    pure function cell_at(x) result(cell)
      real(wp), intent(in) :: x(3)
      integer(i8) :: cell(3)
      cell = floor(min(1.0e17_wp, (x - low)/(coarse*spacing)), i8)
    end function cell_at

  end function count_twins

end module pd_body_mesh_part
