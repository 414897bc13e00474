!> Meshes as read from a file: nodes, elements of any shape, and named sets of elements, of nodes
!> and of faces.
module pd_body_mesh_mesh
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_lookup, only: lookup_type, mix
  use pd_base_text, only: lower_case, newline, to_text
  use pd_body_mesh_elements, only: shape_numbered, shape_type, n_shapes
  use pd_scene_format_values, only: largest_real
  implicit none (type, external)
  private
  public :: mesh_type, set_type, set_of_elements, set_of_nodes, set_of_faces, set_kinds, &
    & check_mesh, all_shapes, sorted, fault_of_file, element_text, nodes_key

  integer, parameter :: set_of_elements = 1, set_of_nodes = 2, set_of_faces = 3
  character(8), parameter :: set_kinds(3) = [character(8) :: 'elements', 'nodes', 'faces']

  !> A named set of elements, of nodes, or of faces (an element and the number of its face; 0: all
  !> of its faces that no other element shares).
  type :: set_type
    character(:), allocatable :: name
    integer :: of = 0                          !! one of `set_of_*`
    integer :: dim = -1                        !! of its elements, where the file says it
    integer :: n = 0
    integer(i4), allocatable :: member(:)      !! (n) numbers of elements or nodes, from 1
    integer(i4), allocatable :: face(:)        !! (n) of sets of faces
  end type set_type

  type :: mesh_type
    character(:), allocatable :: file          !! where it was read from, for messages
    integer :: n_nodes = 0
    integer :: n_elements = 0
    integer :: n_sets = 0
    real(wp), allocatable :: x(:, :)           !! (3, n_nodes or more) positions [m]
    integer(i8), allocatable :: node_tag(:)    !! (n_nodes or more) numbers in the file
    integer(i8), allocatable :: element_tag(:) !! (n_elements or more)
    integer(i4), allocatable :: shape(:)       !! (n_elements or more) numbers of their shapes
    integer(i8), allocatable :: first(:)       !! (n_elements + 1 or more) where their nodes are
    integer(i4), allocatable :: node(:)        !! nodes of one element after another
    type(set_type), allocatable :: sets(:)     !! (n_sets or more)
    logical :: repeats = .false.               !! an element stands once for each of its groups
    integer :: skipped = 0                     !! blocks of the file that mean nothing here
    character(:), allocatable :: first_skipped !! the first of them that a scene says itself
    type(lookup_type) :: nodes                 !! numbers of nodes by their tags
    type(lookup_type) :: elements              !! numbers of elements by their tags
  contains
    procedure :: add_node
    procedure :: add_element
    procedure :: node_of
    procedure :: element_of
    procedure :: add_set
    procedure :: add_member
    procedure :: nodes_of
  end type mesh_type

contains

  !> Add a node.
  subroutine add_node(mesh, tag, x, is_new)
    class(mesh_type), intent(inout) :: mesh  !! has one node more, if the tag is new
    integer(i8), intent(in) :: tag           !! its number in the file
    real(wp), intent(in) :: x(3)             !! position [m]
    logical, intent(out) :: is_new           !! whether no node had this tag
    real(wp), allocatable :: longer(:, :)
    integer(i8), allocatable :: tags(:)
    integer :: number

    call mesh%nodes%number_of(tag, number, is_new)
    if (.not. is_new) return
    if (.not. allocated(mesh%x)) allocate (mesh%x(3, 1024), mesh%node_tag(1024))
    if (number > size(mesh%node_tag)) then
      allocate (longer(3, 2*number), tags(2*number))
      longer(:, :mesh%n_nodes) = mesh%x(:, :mesh%n_nodes)
      tags(:mesh%n_nodes) = mesh%node_tag(:mesh%n_nodes)
      call move_alloc(longer, mesh%x)
      call move_alloc(tags, mesh%node_tag)
    end if
    mesh%n_nodes = number
    mesh%x(:, number) = x
    mesh%node_tag(number) = tag
  end subroutine add_node

  !> Add an element.
  subroutine add_element(mesh, tag, shape, nodes, is_new)
    class(mesh_type), intent(inout) :: mesh  !! has one element more, if the tag is new
    integer(i8), intent(in) :: tag           !! its number in the file
    integer, intent(in) :: shape             !! number of its shape
    integer, intent(in) :: nodes(:)          !! (nodes) numbers of its nodes in the mesh
    logical, intent(out) :: is_new           !! whether no element had this tag
    integer :: number

    call mesh%elements%number_of(tag, number, is_new)
    if (.not. is_new) return
    if (.not. allocated(mesh%shape)) then
      allocate (mesh%shape(1024), mesh%element_tag(1024), mesh%first(1025), mesh%node(4096))
      mesh%first(1) = 1_i8
    end if
    if (number > size(mesh%shape)) then
      mesh%shape = [mesh%shape, mesh%shape]
      mesh%element_tag = [mesh%element_tag, mesh%element_tag]
      mesh%first = [mesh%first, mesh%first]
    end if
    mesh%n_elements = number
    mesh%shape(number) = int(shape, i4)
    mesh%element_tag(number) = tag
    associate (first => mesh%first(number))
      do while (first + size(nodes) > size(mesh%node, kind=i8))
        mesh%node = [mesh%node, mesh%node]
      end do
      mesh%node(first:first + size(nodes) - 1) = int(nodes, i4)
      mesh%first(number + 1) = first + size(nodes)
    end associate
  end subroutine add_element

  !> The number of the node with a tag, 0 if there is none.
  pure integer function node_of(mesh, tag) result(number)
    class(mesh_type), intent(in) :: mesh     !! the mesh
    integer(i8), intent(in) :: tag           !! number in the file
    number = mesh%nodes%look(tag)
  end function node_of

  !> The number of the element with a tag, 0 if there is none.
  pure integer function element_of(mesh, tag) result(number)
    class(mesh_type), intent(in) :: mesh     !! the mesh
    integer(i8), intent(in) :: tag           !! number in the file
    number = mesh%elements%look(tag)
  end function element_of

  !> The number of the set with a name, which is made if there is none. Upper and lower case are one
  !> if `any_case`.
  subroutine add_set(mesh, name, of, number, any_case)
    class(mesh_type), intent(inout) :: mesh  !! may have one set more
    character(*), intent(in) :: name         !! of the set
    integer, intent(in) :: of                !! one of `set_of_*`
    integer, intent(out) :: number           !! of the set
    logical, intent(in) :: any_case          !! whether upper and lower case are one
    type(set_type), allocatable :: longer(:)

    if (.not. allocated(mesh%sets)) allocate (mesh%sets(16))
    do number = 1, mesh%n_sets
      associate (set => mesh%sets(number))
        if (set%of /= of) cycle
        if (set%name == name) return
        if (any_case .and. lower_case(set%name) == lower_case(name)) return
      end associate
    end do
    if (number > size(mesh%sets)) then
      allocate (longer(2*number))
      longer(:mesh%n_sets) = mesh%sets(:mesh%n_sets)
      call move_alloc(longer, mesh%sets)
    end if
    mesh%n_sets = number
    mesh%sets(number)%name = name
    mesh%sets(number)%of = of
    allocate (mesh%sets(number)%member(16), mesh%sets(number)%face(16))
  end subroutine add_set

  !> Add a member to a set.
  subroutine add_member(mesh, number, member, face)
    class(mesh_type), intent(inout) :: mesh   !! whose set has one member more
    integer, intent(in) :: number             !! of the set
    integer, intent(in) :: member             !! number of the element or node
    integer, intent(in), optional :: face     !! number of the element's face; absent: 0

    associate (set => mesh%sets(number))
      if (set%n == size(set%member)) then
        set%member = [set%member, set%member]
        set%face = [set%face, set%face]
      end if
      set%n = set%n + 1
      set%member(set%n) = int(member, i4)
      set%face(set%n) = 0_i4
      if (present(face)) set%face(set%n) = int(face, i4)
    end associate
  end subroutine add_member

  !> The nodes of an element.
  pure function nodes_of(mesh, element) result(nodes)
    class(mesh_type), intent(in) :: mesh  !! the mesh
    integer, intent(in) :: element        !! its number, from 1
    integer(i4), allocatable :: nodes(:)
    nodes = mesh%node(mesh%first(element):mesh%first(element + 1) - 1)
  end function nodes_of

  !> All shapes by their numbers.
  pure function all_shapes() result(shapes)
    type(shape_type) :: shapes(n_shapes)
    integer :: i

    do i = 1, n_shapes
      shapes(i) = shape_numbered(i)
    end do
  end function all_shapes

  !> An error that names the file.
  pure subroutine fault_of_file(mesh, message, error, note)
    type(mesh_type), intent(in) :: mesh            !! its file is the place
    character(*), intent(in) :: message            !! what is wrong
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in), optional :: note     !! what to do; none if absent
    character(:), allocatable :: text

    text = message//newline//' --> '//mesh%file
    if (present(note)) text = text//newline//'  = '//note
    call fail(error, text)
  end subroutine fault_of_file

  !> How a message names an element.
  function element_text(mesh, element) result(text)
    type(mesh_type), intent(in) :: mesh  !! the mesh
    integer, intent(in) :: element       !! its number, from 1
    character(:), allocatable :: text
    type(shape_type) :: shape

    shape = shape_numbered(int(mesh%shape(element)))
    text = 'element '//to_text(mesh%element_tag(element))//' ('//trim(shape%name)//' of '// &
      & to_text(shape%nodes)//trim(merge(' node ', ' nodes', shape%nodes == 1))//')'
  end function element_text

  !> An error if a mesh has no elements of the scene's dimension, or some of a higher one, if
  !> an element stands twice, or if nodes differ in a direction that the dimension does not have.
  !> Elements that a file repeats for each of their groups become one.
  subroutine check_mesh(mesh, dim, error)
    type(mesh_type), intent(inout) :: mesh  !! as read; repeated elements lose their shape
    integer, intent(in) :: dim              !! of the scene
    type(error_type), allocatable, intent(out) :: error
    type(shape_type) :: shapes(n_shapes)
    integer :: counts(0:3), e, c, at
    real(wp) :: span(3), tolerance
    logical, allocatable :: used(:)

    shapes = all_shapes()
    counts = 0
    do e = 1, mesh%n_elements
      c = shapes(mesh%shape(e))%dim
      counts(c) = counts(c) + 1
      if (c > dim) then
        call fault_of_file(mesh, element_text(mesh, e)//' in a scene of dimension '// &
          & to_text(dim), error, 'the mesh has elements of dimension '//to_text(c)// &
          & ': set &scene dimension, or write a mesh without them')
        return
      end if
    end do
    if (counts(dim) == 0) then
      call fault_of_file(mesh, 'the mesh has no elements of dimension '//to_text(dim)// &
        & ', which make a body of a scene of that dimension', error, &
        & 'it has '//to_text(mesh%n_nodes)//' nodes and '//to_text(mesh%n_elements)// &
        & ' elements of lower dimensions')
      return
    end if
    call merge_repeats(mesh, dim, shapes, error)
    if (allocated(error)) return
    allocate (used(mesh%n_nodes), source=.false.)
    do e = 1, mesh%n_elements
      if (mesh%shape(e) == 0) cycle
      if (shapes(mesh%shape(e))%dim == dim) used(mesh%nodes_of(e)) = .true.
    end do
    do at = 1, mesh%n_nodes
      if (.not. used(at)) cycle
      if (all(abs(mesh%x(:, at)) <= largest_real)) cycle
      call fault_of_file(mesh, 'node '//to_text(mesh%node_tag(at))//' has no finite position', &
        & error)
      return
    end do
    do c = 1, 3
      span(c) = maxval(mesh%x(c, :mesh%n_nodes), mask=used) &
        & - minval(mesh%x(c, :mesh%n_nodes), mask=used)
    end do
    tolerance = 1.0e-6_wp*maxval(span(:dim))
    do c = dim + 1, 3
      if (span(c) <= tolerance) cycle
      call fault_of_file(mesh, 'a scene of dimension '//to_text(dim)//' has no direction '// &
        & 'xyz'(c:c)//', but the nodes of the mesh differ in it by '//to_text(span(c)), error)
      return
    end do
  end subroutine check_mesh

  !> Elements with the same nodes are an error, or one element if the file repeats them for each of
  !> their groups; sets then have the first one.
  subroutine merge_repeats(mesh, dim, shapes, error)
    type(mesh_type), intent(inout) :: mesh
    integer, intent(in) :: dim
    type(shape_type), intent(in) :: shapes(:)
    type(error_type), allocatable, intent(out) :: error
    type(lookup_type) :: table
    integer(i4), allocatable :: first(:), stands(:)
    integer :: e, number, s, i
    logical :: is_new, merged

    allocate (first(mesh%n_elements))
    stands = [(int(e, i4), e=1, mesh%n_elements)]
    merged = .false.
    do e = 1, mesh%n_elements
      if (shapes(mesh%shape(e))%dim /= dim) cycle
      call table%number_of(nodes_key(mesh%nodes_of(e)), number, is_new)
      if (.not. is_new) then
        ! two sets of nodes may have one key, if hardly ever
        is_new = .not. same_nodes(mesh, e, int(first(number)))
        if (is_new) call table%own_number(number)
      end if
      if (is_new) then
        first(number) = int(e, i4)
      else if (mesh%repeats) then
        stands(e) = first(number)
        merged = .true.
      else
        call fault_of_file(mesh, element_text(mesh, e)//' has the same nodes as element '// &
          & to_text(mesh%element_tag(first(number))), error, 'an element stands once')
        return
      end if
    end do
    if (.not. merged) return
    do s = 1, mesh%n_sets
      if (mesh%sets(s)%of == set_of_nodes) cycle
      do i = 1, mesh%sets(s)%n
        mesh%sets(s)%member(i) = stands(mesh%sets(s)%member(i))
      end do
    end do
    do e = 1, mesh%n_elements
      if (stands(e) /= e) mesh%shape(e) = 0_i4
    end do
  end subroutine merge_repeats

  !> Whether two elements have the same nodes, in any order.
  pure logical function same_nodes(mesh, a, b)
    type(mesh_type), intent(in) :: mesh
    integer, intent(in) :: a, b

    same_nodes = .false.
    if (mesh%shape(a) /= mesh%shape(b)) return
    same_nodes = all(sorted(mesh%nodes_of(a)) == sorted(mesh%nodes_of(b)))
  end function same_nodes

  !> A key of some nodes, whatever their order.
  pure integer(i8) function nodes_key(nodes) result(key)
    integer(i4), intent(in) :: nodes(:)  !! (any number) nodes
    integer(i4) :: ordered(size(nodes))
    integer :: i

    ordered = sorted(nodes)
    key = 0_i8
    do i = 1, size(ordered)
      key = mix(key, int(ordered(i), i8))
    end do
  end function nodes_key

  !> A few numbers in ascending order.
  pure function sorted(numbers)
    integer(i4), intent(in) :: numbers(:)  !! (a few)
    integer(i4) :: sorted(size(numbers))
    integer(i4) :: one
    integer :: i, j

    sorted = numbers
    do i = 2, size(sorted)
      one = sorted(i)
      j = i - 1
      do while (j > 0)
        if (sorted(j) <= one) exit
        sorted(j + 1) = sorted(j)
        j = j - 1
      end do
      sorted(j + 1) = one
    end do
  end function sorted

end module pd_body_mesh_mesh
