!> Meshes of Gmsh: MSH 4.1 and 2.2, text and binary, with physical groups and their names. The
!> format is described in the reference manual of Gmsh, chapter "MSH file format".
module pd_body_mesh_gmsh
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: printable, to_text
  use pd_body_mesh_cursor, only: cursor_type
  use pd_body_mesh_elements, only: kind_hexahedron, kind_line, kind_point, kind_pyramid, &
    & kind_quadrilateral, kind_tetrahedron, kind_triangle, kind_wedge, n_shapes, shape_of, &
    & shape_type
  use pd_body_mesh_mesh, only: all_shapes, mesh_type, set_of_elements
  implicit none (type, external)
  private
  public :: read_gmsh

  !> The shape of each of Gmsh's types of elements: kind and nodes; 0: none here.
  integer, parameter :: n_types = 19
  integer, parameter :: type_kinds(n_types) = [kind_line, kind_triangle, kind_quadrilateral, &
    & kind_tetrahedron, kind_hexahedron, kind_wedge, kind_pyramid, kind_line, kind_triangle, &
    & kind_quadrilateral, kind_tetrahedron, kind_hexahedron, kind_wedge, kind_pyramid, kind_point, &
    & kind_quadrilateral, kind_hexahedron, kind_wedge, kind_pyramid]
  integer, parameter :: type_nodes(n_types) = [2, 3, 4, 4, 8, 6, 5, 3, 6, 9, 10, 27, 18, 14, 1, 8, &
    & 20, 15, 13]
  character(13), parameter :: type_names(n_types) = [character(13) :: 'line', 'triangle', &
    & 'quadrilateral', 'tetrahedron', 'hexahedron', 'wedge', 'pyramid', 'line', 'triangle', &
    & 'quadrilateral', 'tetrahedron', 'hexahedron', 'wedge', 'pyramid', 'point', 'quadrilateral', &
    & 'hexahedron', 'wedge', 'pyramid']

  !> A physical group: its set in the mesh.
  type :: group_type
    integer :: dim = 0
    integer :: tag = 0
    integer :: set = 0
  end type group_type

  !> The physical groups of an entity.
  type :: entity_type
    integer :: dim = 0
    integer :: tag = 0
    integer, allocatable :: groups(:)
  end type entity_type

  !> What is read so far beside the mesh.
  type :: state_type
    integer :: version = 0                       !! 2 or 4
    type(group_type), allocatable :: groups(:)
    type(entity_type), allocatable :: entities(:)
    type(shape_type) :: shapes(n_shapes)
    logical :: nodes = .false., elements = .false.  !! sections that have been read
  end type state_type

contains

  !> Read a mesh from the text of its file. An error, with its line or byte, if the format is none
  !> of those, if the file is cut off, if an element has an unknown type or a node that is not
  !> there, or if a node or element stands twice.
  subroutine read_gmsh(cursor, mesh, error)
    type(cursor_type), intent(inout) :: cursor  !! at the begin of the file
    type(mesh_type), intent(inout) :: mesh      !! empty, with the name of the file
    type(error_type), allocatable, intent(out) :: error
    type(state_type) :: state
    character(:), allocatable :: line
    integer(i8) :: first, last
    logical :: binary

    allocate (state%groups(0), state%entities(0))
    state%shapes = all_shapes()
    binary = .false.
    do
      cursor%binary = .false.
      call cursor%next_word(first, last)
      if (last < first) exit
      if (last - first > 80) last = first + 80
      line = cursor%text(first:last)
      if (state%version == 0 .and. line /= '$MeshFormat') then
        call cursor%fault('expected $MeshFormat, the begin of a file of Gmsh', error)
        return
      end if
      select case (line)
      case ('$MeshFormat')
        call read_format(cursor, state, binary, error)
      case ('$PhysicalNames')
        call read_names(cursor, mesh, state, error)
      case ('$Entities')
        call begin_data(cursor, binary, state%version)
        call read_entities(cursor, mesh, state, error)
      case ('$Nodes')
        call begin_data(cursor, binary, state%version)
        call read_nodes(cursor, mesh, state, error)
      case ('$Elements')
        call begin_data(cursor, binary, state%version)
        call read_elements(cursor, mesh, state, error)
      case ('$PartitionedEntities')
        call cursor%fault('a mesh in partitions', error, 'write it as one mesh')
      case default
        ! comments, periodic nodes, data: not needed for a body
        if (line(1:1) /= '$') then
          call cursor%fault("expected a section, as $Nodes, but found '"//printable(line)//"'", &
            & error)
          return
        end if
        mesh%skipped = mesh%skipped + 1
        call skip_section(cursor, line, error)
        if (allocated(error)) return
        cycle
      end select
      if (allocated(error)) return
      cursor%binary = .false.
      call end_section(cursor, line, error)
      if (allocated(error)) return
    end do
    if (.not. state%nodes .or. .not. state%elements) then
      call cursor%fault('the file ends before '//trim(merge('$Elements', '$Nodes   ', &
        & state%nodes)), error, 'it may have been cut off')
    end if
  end subroutine read_gmsh

  !> Version and kind of the file.
  subroutine read_format(cursor, state, binary, error)
    type(cursor_type), intent(inout) :: cursor
    type(state_type), intent(inout) :: state
    logical, intent(out) :: binary
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: first, last
    integer :: kind, size_of_reals, one
    character(:), allocatable :: line
    logical :: found

    binary = .false.
    call cursor%next_word(first, last)
    select case (cursor%text(first:min(last, first + 7)))
    case ('4.1')
      state%version = 4
    case ('2.2', '2', '2.0', '2.1')
      state%version = 2
    case default  ! an error with the place
      call cursor%fault("version '"//printable(cursor%text(first:min(last, first + 20)))// &
        & "' of the format of Gmsh", error, &
        & 'versions 2.2 and 4.1 are read: write it anew, or convert it by ./pf convert FILE')
    end select
    if (allocated(error)) return
    call cursor%short('the kind of the file, 0 or 1', kind, error)
    if (allocated(error)) return
    call cursor%short('the size of reals', size_of_reals, error)
    if (allocated(error)) return
    if (kind < 0 .or. kind > 1 .or. size_of_reals /= 8) then
      call cursor%fault('file type '//to_text(kind)//' and data size '// &
        & to_text(size_of_reals), error, 'expected 0 (text) or 1 (binary), and 8 bytes')
      return
    end if
    binary = kind == 1
    if (.not. binary) return
    call cursor%next_line(line, found)
    cursor%binary = .true.
    call cursor%short('the mark of the order of bytes', one, error)
    if (allocated(error)) return
    if (one == 16777216) then
      cursor%swapped = .true.
    else if (one /= 1) then
      call cursor%fault('the mark of the order of bytes is '//to_text(one)//', not 1', error)
    end if
  end subroutine read_format

  !> Binary data begin behind the line that names the section; in version 2 behind a count.
  subroutine begin_data(cursor, binary, version)
    type(cursor_type), intent(inout) :: cursor
    logical, intent(in) :: binary
    integer, intent(in) :: version
    character(:), allocatable :: line
    logical :: found

    if (binary .and. version == 4) call cursor%next_line(line, found)
    cursor%binary = binary
  end subroutine begin_data

  !> The end of a section.
  subroutine end_section(cursor, name, error)
    type(cursor_type), intent(inout) :: cursor
    character(*), intent(in) :: name
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: first, last

    call cursor%next_word(first, last)
    if (last < first) then
      call cursor%fault('the file ends before $End'//name(2:), error, 'it may have been cut off')
    else if (cursor%text(first:last) /= '$End'//name(2:)) then
      call cursor%fault('expected $End'//name(2:)//", but found '"// &
        & printable(cursor%text(first:min(last, first + 40)))//"'", error, &
        & 'the section holds more than its counts say')
    end if
  end subroutine end_section

  !> Pass over a section, binary or not.
  subroutine skip_section(cursor, name, error)
    type(cursor_type), intent(inout) :: cursor
    character(*), intent(in) :: name
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: at, i

    at = index(cursor%text(cursor%at:), '$End'//name(2:), kind=i8)
    if (at == 0_i8) then
      call cursor%fault('the file ends before $End'//printable(name(2:)), error, &
        & 'it may have been cut off')
      return
    end if
    do i = cursor%at, cursor%at + at - 1
      if (cursor%text(i:i) == achar(10)) cursor%line = cursor%line + 1
    end do
    cursor%at = cursor%at + at + len('$End') + len(name) - 2
  end subroutine skip_section

  !> The names of physical groups; always text.
  subroutine read_names(cursor, mesh, state, error)
    type(cursor_type), intent(inout) :: cursor
    type(mesh_type), intent(inout) :: mesh
    type(state_type), intent(inout) :: state
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: n, i
    integer :: dim, tag, set, first, last
    character(:), allocatable :: line
    logical :: found

    call cursor%count_of('physical names', 6, n, error)
    if (allocated(error)) return
    do i = 1_i8, n
      call cursor%short('the dimension of a physical group', dim, error)
      if (allocated(error)) return
      call cursor%short('the number of a physical group', tag, error)
      if (allocated(error)) return
      call cursor%next_line(line, found)
      first = index(line, '"')
      last = index(line, '"', back=.true.)
      if (last <= first + 1) then
        call cursor%fault('expected the name of a physical group in quotes', error)
        return
      end if
      call mesh%add_set(line(first + 1:last - 1), set_of_elements, set, .false.)
      state%groups = [state%groups, group_type(dim, tag, set)]
    end do
  end subroutine read_names

  !> The set of a physical group; one without a name is named by its number.
  integer function set_of_group(mesh, state, dim, tag) result(set)
    type(mesh_type), intent(inout) :: mesh
    type(state_type), intent(inout) :: state
    integer, intent(in) :: dim, tag
    integer :: i

    do i = 1, size(state%groups)
      if (state%groups(i)%dim /= dim .or. state%groups(i)%tag /= tag) cycle
      set = state%groups(i)%set
      return
    end do
    call mesh%add_set(to_text(tag), set_of_elements, set, .false.)
    state%groups = [state%groups, group_type(dim, tag, set)]
  end function set_of_group

  !> Which physical groups the entities are in (version 4).
  subroutine read_entities(cursor, mesh, state, error)
    type(cursor_type), intent(inout) :: cursor
    type(mesh_type), intent(inout) :: mesh
    type(state_type), intent(inout) :: state
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: counts(0:3), i, k, n
    integer :: dim, tag, c, group
    real(wp) :: box
    type(entity_type) :: entity

    if (state%version /= 4) then
      call cursor%fault('a section $Entities in a file of version 2', error)
      return
    end if
    do dim = 0, 3
      call cursor%count_of('entities', 10, counts(dim), error)
      if (allocated(error)) return
    end do
    do dim = 0, 3
      do i = 1_i8, counts(dim)
        call cursor%short('the number of an entity', tag, error)
        if (allocated(error)) return
        do c = 1, merge(3, 6, dim == 0)
          call cursor%number('a bound of an entity', box, error)
          if (allocated(error)) return
        end do
        call cursor%count_of('physical groups of an entity', merge(4, 2, cursor%binary), n, error)
        if (allocated(error)) return
        entity%dim = dim
        entity%tag = tag
        entity%groups = [integer ::]
        do k = 1_i8, n
          call cursor%short('a physical group', group, error)
          if (allocated(error)) return
          ! a minus sign tells the orientation
          entity%groups = [entity%groups, set_of_group(mesh, state, dim, abs(group))]
        end do
        if (n > 0_i8) state%entities = [state%entities, entity]
        if (dim == 0) cycle
        call cursor%count_of('bounding entities', merge(4, 2, cursor%binary), n, error)
        if (allocated(error)) return
        do k = 1_i8, n
          call cursor%short('a bounding entity', group, error)
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine read_entities

  !> Nodes, in blocks of entities (version 4) or one after another.
  subroutine read_nodes(cursor, mesh, state, error)
    type(cursor_type), intent(inout) :: cursor
    type(mesh_type), intent(inout) :: mesh
    type(state_type), intent(inout) :: state
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: blocks, n, i, b, total, in_block, ignored
    integer(i8), allocatable :: tags(:)
    integer :: dim, parametric, tag, c
    real(wp) :: parameter

    state%nodes = .true.
    if (state%version == 2) then
      call count_in_2(cursor, 'nodes', merge(28, 8, cursor%binary), n, error)
      if (allocated(error)) return
      do i = 1_i8, n
        call cursor%short('the number of a node', tag, error)
        if (.not. allocated(error)) call place_node(int(tag, i8))
        if (allocated(error)) return
      end do
      return
    end if
    call cursor%count_of('blocks of nodes', 4, blocks, error)
    if (.not. allocated(error)) call cursor%count_of('nodes', 8, total, error)
    if (.not. allocated(error)) call cursor%long('the least node', ignored, error)
    if (.not. allocated(error)) call cursor%long('the largest node', ignored, error)
    if (allocated(error)) return
    do b = 1_i8, blocks
      call cursor%short('the dimension of an entity', dim, error)
      if (.not. allocated(error)) call cursor%short('the number of an entity', tag, error)
      if (.not. allocated(error)) call cursor%short('whether nodes have parameters', parametric, &
        & error)
      if (.not. allocated(error)) call cursor%count_of('nodes', merge(32, 8, cursor%binary), &
        & in_block, error)
      if (allocated(error)) return
      if (dim < 0 .or. dim > 3 .or. parametric < 0 .or. parametric > 1) then
        call cursor%fault('a block of nodes of dimension '//to_text(dim)//' and kind '// &
          & to_text(parametric), error)
        return
      end if
      allocate (tags(in_block))
      do i = 1_i8, in_block
        call cursor%long('the number of a node', tags(i), error)
        if (allocated(error)) return
      end do
      do i = 1_i8, in_block
        call place_node(tags(i))
        if (allocated(error)) return
        do c = 1, merge(dim, 0, parametric == 1)
          call cursor%number('a parameter of a node', parameter, error)
          if (allocated(error)) return
        end do
      end do
      deallocate (tags)
    end do
    if (mesh%n_nodes /= total) call cursor%fault('the blocks hold '//to_text(mesh%n_nodes)// &
      & ' nodes, but their number should be '//to_text(total), error)

  contains

    !> The position of a node.
    subroutine place_node(tag)
      integer(i8), intent(in) :: tag
      real(wp) :: x(3)
      logical :: is_new
      integer :: c

      do c = 1, 3
        call cursor%number('a coordinate of a node', x(c), error)
        if (allocated(error)) return
      end do
      call mesh%add_node(tag, x, is_new)
      if (.not. is_new) call cursor%fault('node '//to_text(tag)//' stands twice', error)
    end subroutine place_node

  end subroutine read_nodes

  !> A count of version 2: a word, even in a binary file.
  subroutine count_in_2(cursor, what, least, n, error)
    type(cursor_type), intent(inout) :: cursor
    character(*), intent(in) :: what
    integer, intent(in) :: least
    integer(i8), intent(out) :: n
    type(error_type), allocatable, intent(out) :: error
    logical :: binary, found
    character(:), allocatable :: rest

    binary = cursor%binary
    cursor%binary = .false.
    call cursor%count_of(what, least, n, error)
    if (binary .and. .not. allocated(error)) call cursor%next_line(rest, found)
    cursor%binary = binary
  end subroutine count_in_2

  !> Elements, in blocks of entities (version 4) or one after another.
  subroutine read_elements(cursor, mesh, state, error)
    type(cursor_type), intent(inout) :: cursor
    type(mesh_type), intent(inout) :: mesh
    type(state_type), intent(inout) :: state
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: blocks, n, b, i, total, in_block, ignored, element
    integer :: dim, tag, kind, tags, at, set

    if (.not. state%nodes) then
      call cursor%fault('elements before the nodes', error)
      return
    end if
    state%elements = .true.
    if (state%version == 2) then
      mesh%repeats = .true.
      call count_in_2(cursor, 'elements', merge(12, 6, cursor%binary), n, error)
      if (allocated(error)) return
      if (cursor%binary) then
        call read_binary_2(n)
        return
      end if
      do i = 1_i8, n
        call cursor%long('the number of an element', element, error)
        if (.not. allocated(error)) call cursor%short('the type of an element', kind, error)
        if (.not. allocated(error)) call cursor%short('the number of tags', tags, error)
        if (.not. allocated(error)) call read_tagged(element)
        if (allocated(error)) return
      end do
      return
    end if
    call cursor%count_of('blocks of elements', 4, blocks, error)
    if (.not. allocated(error)) call cursor%count_of('elements', 4, total, error)
    if (.not. allocated(error)) call cursor%long('the least element', ignored, error)
    if (.not. allocated(error)) call cursor%long('the largest element', ignored, error)
    if (allocated(error)) return
    do b = 1_i8, blocks
      call cursor%short('the dimension of an entity', dim, error)
      if (.not. allocated(error)) call cursor%short('the number of an entity', tag, error)
      if (.not. allocated(error)) call cursor%short('the type of elements', kind, error)
      if (.not. allocated(error)) call cursor%count_of('elements', merge(16, 4, cursor%binary), &
        & in_block, error)
      if (allocated(error)) return
      do at = 1, size(state%entities)
        if (state%entities(at)%dim == dim .and. state%entities(at)%tag == tag) exit
      end do
      do i = 1_i8, in_block
        call cursor%long('the number of an element', element, error)
        if (.not. allocated(error)) call read_element(element)
        if (allocated(error)) return
        if (at > size(state%entities)) cycle
        do set = 1, size(state%entities(at)%groups)
          call mesh%add_member(state%entities(at)%groups(set), mesh%n_elements)
        end do
      end do
    end do
    if (mesh%n_elements /= total) call cursor%fault('the blocks hold '// &
      & to_text(mesh%n_elements)//' elements, but their number should be '//to_text(total), error)

  contains

    !> The binary elements of version 2: runs of one type and number of tags.
    subroutine read_binary_2(n)
      integer(i8), intent(in) :: n
      integer(i8) :: done, k
      integer :: number, run

      done = 0_i8
      do while (done < n)
        call cursor%short('the type of elements', kind, error)
        if (.not. allocated(error)) call cursor%short('the number of elements of a type', run, &
          & error)
        if (.not. allocated(error)) call cursor%short('the number of tags', tags, error)
        if (allocated(error)) return
        if (run < 1 .or. run > n - done) then
          call cursor%fault('a run of '//to_text(run)//' elements where '//to_text(n - done)// &
            & ' are left', error)
          return
        end if
        do k = 1_i8, run
          call cursor%short('the number of an element', number, error)
          if (.not. allocated(error)) call read_tagged(int(number, i8))
          if (allocated(error)) return
        end do
        done = done + run
      end do
    end subroutine read_binary_2

    !> An element of version 2 behind its number: tags, of which the first is the physical group,
    !> and nodes.
    subroutine read_tagged(element)
      integer(i8), intent(in) :: element
      integer :: group, other, t

      group = 0
      if (tags < 0 .or. tags > 1000) then
        call cursor%fault('element '//to_text(element)//' has '//to_text(tags)//' tags', error)
        return
      end if
      do t = 1, tags
        call cursor%short('a tag of an element', other, error)
        if (allocated(error)) return
        if (t == 1) group = abs(other)
      end do
      call read_element(element)
      if (allocated(error) .or. group == 0) return
      call mesh%add_member(set_of_group(mesh, state, state%shapes(mesh%shape(mesh%n_elements)) &
        & %dim, group), mesh%n_elements)
    end subroutine read_tagged

    !> The nodes of an element of type `kind`.
    subroutine read_element(element)
      integer(i8), intent(in) :: element
      integer :: nodes(27), k, shape, short_node
      integer(i8) :: node
      logical :: is_new

      shape = 0
      if (kind >= 1 .and. kind <= n_types) shape = shape_of(type_kinds(kind), type_nodes(kind))
      if (shape == 0) then
        call cursor%fault('element '//to_text(element)//' has '//type_text(kind), error, &
          & 'known: lines of 2, 3 nodes, triangles 3, 6, quadrilaterals 4, 8, 9, '// &
          & 'tetrahedra 4, 10, hexahedra 8, 20, 27, wedges 6, 15, pyramids 5')
        return
      end if
      do k = 1, type_nodes(kind)
        if (state%version == 2) then
          call cursor%short('a node of an element', short_node, error)
          node = int(short_node, i8)
        else
          call cursor%long('a node of an element', node, error)
        end if
        if (allocated(error)) return
        nodes(k) = mesh%node_of(node)
        if (nodes(k) == 0) then
          call cursor%fault('element '//to_text(element)//' has node '//to_text(node)// &
            & ', which is not there', error)
          return
        end if
      end do
      call mesh%add_element(element, shape, nodes(:type_nodes(kind)), is_new)
      if (.not. is_new) call cursor%fault('element '//to_text(element)//' stands twice', error)
    end subroutine read_element

  end subroutine read_elements

  !> How a message names a type of elements.
  pure function type_text(kind) result(text)
    integer, intent(in) :: kind
    character(:), allocatable :: text

    if (kind >= 1 .and. kind <= n_types) then
      text = 'the unsupported type '//to_text(kind)//': '//trim(type_names(kind))//' of '// &
        & to_text(type_nodes(kind))//' nodes'
    else
      text = 'the unknown type '//to_text(kind)
    end if
  end function type_text

end module pd_body_mesh_gmsh
