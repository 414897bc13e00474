!> Meshes from input files of Abaqus and CalculiX: *NODE, *ELEMENT, *ELSET, *NSET, *SURFACE and
!> *INCLUDE. Other keywords are skipped and counted. Numbers of nodes and faces of elements follow
!> the manuals of both; names of sets are the same in upper and lower case.
module pd_body_mesh_abaqus
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: lower_case, newline, printable, to_text
  use pd_body_mesh_cursor, only: cursor_type, read_plain_real
  use pd_body_mesh_elements, only: kind_hexahedron, kind_line, kind_pyramid, kind_quadrilateral, &
    & kind_tetrahedron, kind_triangle, kind_wedge, most_nodes, n_shapes, shape_of, shape_type
  use pd_body_mesh_mesh, only: all_shapes, mesh_type, set_of_elements, set_of_faces, set_of_nodes
  use pd_scene_format_file, only: read_text_file, resolve_path
  implicit none (type, external)
  private
  public :: read_abaqus

  integer, parameter :: deepest = 10      !! files within each other
  integer, parameter :: longest_word = 256
  integer, parameter :: most_words = 2 + most_nodes

  !> What the keyword that was read last means for the lines of data behind it.
  integer, parameter :: skipping = 0, reading_nodes = 1, reading_elements = 2, reading_set = 3, &
    & reading_surface = 4, reading_instance = 5

  !> The words of a line.
  type :: words_type
    integer :: n = 0
    character(longest_word) :: word(most_words) = ''
  end type words_type

  type :: state_type
    integer :: data = skipping
    integer :: set = 0                    !! that takes what is read; 0: none
    integer :: of = 0                     !! kind of a set
    integer :: shape = 0                  !! of elements
    logical :: generate = .false.
    logical :: in_assembly = .false.
    integer :: parts = 0, instances = 0
    integer :: n = 0                      !! numbers of the element so far
    integer(i8) :: numbers(most_words) = 0_i8
    type(shape_type) :: shapes(n_shapes)
  end type state_type

contains

  !> Read a mesh from the text of its file, and from the files that it includes. An error, with its
  !> line, if a line cannot be read, if an element has an unknown type or a node that is not there,
  !> if a node or element stands twice, or if a set names what is not there.
  subroutine read_abaqus(cursor, mesh, error)
    type(cursor_type), intent(inout) :: cursor  !! at the begin of the file
    type(mesh_type), intent(inout) :: mesh      !! empty, with the name of the file
    type(error_type), allocatable, intent(out) :: error
    type(state_type) :: state

    state%shapes = all_shapes()
    call read_lines(cursor, mesh, state, 0, error)
    if (allocated(error)) return
    if (state%n > 0) then
      call cursor%fault('the file ends inside of element '//to_text(state%numbers(1)), error, &
        & 'it may have been cut off')
    else if (mesh%n_nodes == 0 .or. mesh%n_elements == 0) then
      call cursor%fault('the file has no *NODE, or no *ELEMENT', error)
    end if
  end subroutine read_abaqus

  !> All lines of a file.
  recursive subroutine read_lines(cursor, mesh, state, depth, error)
    type(cursor_type), intent(inout) :: cursor
    type(mesh_type), intent(inout) :: mesh
    type(state_type), intent(inout) :: state
    integer, intent(in) :: depth              !! files that include this one
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: line, more
    integer :: at
    logical :: found

    do
      at = cursor%line
      call cursor%next_line(line, found)
      if (.not. found) return
      call blank_tabs(line)
      if (index(line, '**') == 1 .or. len_trim(line) == 0) cycle
      if (line(1:1) == '*') then
        do while (line(len_trim(line):len_trim(line)) == ',')
          call cursor%next_line(more, found)
          if (.not. found) exit
          call blank_tabs(more)
          if (len_trim(more) == 0) exit
          line = trim(line)//more
          if (len(line) > 10000) exit
        end do
        cursor%line = cursor%line - 1  ! for messages
        call read_keyword(cursor, mesh, state, line, depth, error)
        cursor%line = cursor%line + 1
      else if (state%data /= skipping) then
        cursor%line = at
        call read_data(cursor, mesh, state, line, error)
        cursor%line = at + 1
      end if
      if (allocated(error)) return
    end do
  end subroutine read_lines

  !> Make tabs blanks.
  pure subroutine blank_tabs(line)
    character(:), allocatable, intent(inout) :: line
    integer :: i

    do i = 1, len(line)
      if (line(i:i) == achar(9)) line(i:i) = ' '
    end do
  end subroutine blank_tabs

  !> A line that begins with a star.
  recursive subroutine read_keyword(cursor, mesh, state, line, depth, error)
    type(cursor_type), intent(inout) :: cursor
    type(mesh_type), intent(inout) :: mesh
    type(state_type), intent(inout) :: state
    character(*), intent(in) :: line
    integer, intent(in) :: depth
    type(error_type), allocatable, intent(out) :: error
    type(words_type) :: words
    character(:), allocatable :: keyword, name

    if (state%n > 0) then
      call cursor%fault('element '//to_text(state%numbers(1))//' lacks nodes: '// &
        & to_text(state%n - 1)//' of '//to_text(state%shapes(state%shape)%nodes), error)
      return
    end if
    state%data = skipping
    state%set = 0
    call split(cursor, line, words, error)
    if (allocated(error)) return
    keyword = squeezed(words%word(1))
    select case (keyword)
    case ('*node')
      if (state%in_assembly) then
        mesh%skipped = mesh%skipped + 1  ! reference points
        return
      end if
      state%data = reading_nodes
      name = parameter_of(words, 'nset')
      if (len(name) > 0) call mesh%add_set(name, set_of_nodes, state%set, .true.)
    case ('*element')
      name = parameter_of(words, 'type')
      state%shape = shape_of_type(name)
      if (state%shape == 0) then
        call cursor%fault("the unknown type '"//printable(name)//"' of elements", error, &
          & 'known: solids C3D4.. C3D27, plane ones CPS and CPE, shells, membranes, bars')
        return
      end if
      state%data = reading_elements
      name = parameter_of(words, 'elset')
      if (len(name) > 0) call mesh%add_set(name, set_of_elements, state%set, .true.)
    case ('*elset', '*nset')
      state%data = reading_set
      state%of = merge(set_of_elements, set_of_nodes, keyword == '*elset')
      state%generate = any(squeezed_all(words) == 'generate')
      name = parameter_of(words, keyword(2:))
      if (len(name) == 0) then
        call cursor%fault('a set without a name', error, 'expected '//keyword(2:)//' = NAME')
      else
        call mesh%add_set(name, state%of, state%set, .true.)
      end if
    case ('*surface')
      name = parameter_of(words, 'name')
      if (len(name) == 0) then
        call cursor%fault('a surface without a name', error, 'expected name = NAME')
        return
      end if
      select case (lower_case(parameter_of(words, 'type')))
      case ('', 'element')
        state%data = reading_surface
        call mesh%add_set(name, set_of_faces, state%set, .true.)
      case ('node')
        state%data = reading_set
        state%of = set_of_nodes
        state%generate = .false.
        call mesh%add_set(name, state%of, state%set, .true.)
      case default  ! surfaces of other programs' analyses: not needed for a body
        mesh%skipped = mesh%skipped + 1
      end select
    case ('*include')
      call include_file(cursor, mesh, state, parameter_of(words, 'input'), depth, error)
    case ('*part')
      state%parts = state%parts + 1
      if (state%parts > 1) call cursor%fault('a second *PART', error, &
        & 'write the file without parts and assemblies, or a file for each part')
    case ('*instance')
      state%instances = state%instances + 1
      state%data = reading_instance
      if (state%instances > 1) call cursor%fault('a second *INSTANCE', error, &
        & 'write the file without parts and assemblies, or a file for each part')
    case ('*assembly')
      state%in_assembly = .true.
    case ('*end assembly')
      state%in_assembly = .false.
    case ('*heading', '*preprint')
      continue
    case default  ! steps, materials, loads: a scene says these itself
      if (.not. allocated(mesh%first_skipped)) mesh%first_skipped = keyword
      mesh%skipped = mesh%skipped + 1
    end select
  end subroutine read_keyword

  !> The lines of another file.
  recursive subroutine include_file(cursor, mesh, state, name, depth, error)
    type(cursor_type), intent(in) :: cursor
    type(mesh_type), intent(inout) :: mesh
    type(state_type), intent(inout) :: state
    character(*), intent(in) :: name
    integer, intent(in) :: depth
    type(error_type), allocatable, intent(out) :: error
    type(cursor_type) :: inner

    if (len(name) == 0) then
      call cursor%fault('*INCLUDE without input = FILE', error)
    else if (depth >= deepest) then
      call cursor%fault('*INCLUDE more than '//to_text(deepest)//' files deep', error, &
        & 'does a file include itself?')
    end if
    if (allocated(error)) return
    inner%file = resolve_path(name, cursor%file)
    call read_text_file(inner%file, inner%text, error)
    if (allocated(error)) then
      error%message = error%message//newline//' --> '//cursor%file//':'//to_text(cursor%line)
      return
    end if
    call read_lines(inner, mesh, state, depth + 1, error)
  end subroutine include_file

  !> A line of data behind a keyword.
  subroutine read_data(cursor, mesh, state, line, error)
    type(cursor_type), intent(in) :: cursor
    type(mesh_type), intent(inout) :: mesh
    type(state_type), intent(inout) :: state
    character(*), intent(in) :: line
    type(error_type), allocatable, intent(out) :: error
    type(words_type) :: words

    call split(cursor, line, words, error)
    if (allocated(error)) return
    select case (state%data)
    case (reading_nodes)
      call take_node(cursor, mesh, state, words, error)
    case (reading_elements)
      call take_element(cursor, mesh, state, words, error)
    case (reading_set)
      call take_members(cursor, mesh, state, words, error)
    case (reading_surface)
      call take_face(cursor, mesh, state, words, error)
    case default  ! an instance: data would move it
      call cursor%fault('an *INSTANCE that is moved', error, &
        & 'write the file without parts and assemblies')
    end select
  end subroutine read_data

  !> `number, x, y, z`; coordinates left out are 0.
  subroutine take_node(cursor, mesh, state, words, error)
    type(cursor_type), intent(in) :: cursor
    type(mesh_type), intent(inout) :: mesh
    type(state_type), intent(in) :: state
    type(words_type), intent(in) :: words
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: tag
    integer :: c
    real(wp) :: x(3)
    logical :: is_new
    character(:), allocatable :: note

    call to_number(cursor, words%word(1), 'the number of a node', tag, error)
    if (allocated(error)) return
    x = 0.0_wp
    do c = 1, 3
      if (c + 1 > words%n) exit
      if (words%word(c + 1) == '') cycle
      call read_plain_real(trim(words%word(c + 1)), x(c), note)
      if (len(note) == 0) cycle
      call cursor%fault("expected a coordinate of node "//to_text(tag)//", but found '"// &
        & printable(trim(words%word(c + 1)))//"'", error, note)
      return
    end do
    call mesh%add_node(tag, x, is_new)
    if (.not. is_new) then
      call cursor%fault('node '//to_text(tag)//' stands twice', error)
    else if (state%set > 0) then
      call mesh%add_member(state%set, mesh%n_nodes)
    end if
  end subroutine take_node

  !> `number, node, node, ...`, over as many lines as it takes.
  subroutine take_element(cursor, mesh, state, words, error)
    type(cursor_type), intent(in) :: cursor
    type(mesh_type), intent(inout) :: mesh
    type(state_type), intent(inout) :: state
    type(words_type), intent(in) :: words
    type(error_type), allocatable, intent(out) :: error
    integer :: i, nodes, numbers(most_nodes)
    logical :: is_new

    associate (shape => state%shapes(state%shape))
      do i = 1, words%n
        if (words%word(i) == '') cycle
        if (state%n > shape%nodes) then
          call cursor%fault('element '//to_text(state%numbers(1))//' has more than '// &
            & to_text(shape%nodes)//' nodes', error)
          return
        end if
        state%n = state%n + 1
        call to_number(cursor, words%word(i), 'a number of an element', state%numbers(state%n), &
          & error)
        if (allocated(error)) return
      end do
      if (state%n <= shape%nodes) return
      do nodes = 1, shape%nodes
        numbers(nodes) = mesh%node_of(state%numbers(nodes + 1))
        if (numbers(nodes) > 0) cycle
        call cursor%fault('element '//to_text(state%numbers(1))//' has node '// &
          & to_text(state%numbers(nodes + 1))//', which is not there', error)
        return
      end do
      numbers(:shape%nodes) = numbers(order_of(shape))
      call mesh%add_element(state%numbers(1), state%shape, numbers(:shape%nodes), is_new)
    end associate
    if (.not. is_new) then
      call cursor%fault('element '//to_text(state%numbers(1))//' stands twice', error)
    else if (state%set > 0) then
      call mesh%add_member(state%set, mesh%n_elements)
    end if
    state%n = 0
  end subroutine take_element

  !> For each node in the order of Gmsh, its number in the order of Abaqus.
  pure function order_of(shape) result(order)
    type(shape_type), intent(in) :: shape
    integer :: order(shape%nodes)
    integer :: i

    order = [(i, i=1, shape%nodes)]
    if (shape%kind == kind_line .and. shape%nodes == 3) then
      order = [1, 3, 2]  ! the middle stands between the ends
    else if (shape%kind == kind_tetrahedron .and. shape%nodes == 10) then
      order(9:10) = [10, 9]
    else if (shape%kind == kind_hexahedron .and. shape%nodes >= 20) then
      order(9:20) = [9, 12, 17, 10, 18, 11, 19, 20, 13, 16, 14, 15]
      if (shape%nodes == 27) order(21:27) = [22, 24, 27, 25, 26, 23, 21]
    else if (shape%kind == kind_wedge .and. shape%nodes == 15) then
      order(7:15) = [7, 9, 13, 8, 14, 15, 10, 12, 11]
    end if
  end function order_of

  !> Members of a set: numbers, names of sets, or `first, last, step`.
  subroutine take_members(cursor, mesh, state, words, error)
    type(cursor_type), intent(in) :: cursor
    type(mesh_type), intent(inout) :: mesh
    type(state_type), intent(in) :: state
    type(words_type), intent(in) :: words
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: range(3), tag
    integer :: i, k, other

    if (state%generate) then
      range(3) = 1_i8
      do i = 1, min(3, words%n)
        if (words%word(i) == '' .and. i == 3) cycle
        call to_number(cursor, words%word(i), 'first, last, step', range(i), error)
        if (allocated(error)) return
      end do
      if (words%n < 2 .or. range(3) < 1_i8 .or. range(2) < range(1)) then
        call cursor%fault('expected first, last and step of numbers', error)
        return
      end if
      ! what a range passes over need not be there; a long one may be longer than the mesh is
      if ((range(2) - range(1))/range(3) <= mesh%n_elements + mesh%n_nodes) then
        do tag = range(1), range(2), range(3)
          call add(tag, .false.)
        end do
        return
      end if
      do i = 1, merge(mesh%n_elements, mesh%n_nodes, state%of == set_of_elements)
        if (state%of == set_of_elements) tag = mesh%element_tag(i)
        if (state%of == set_of_nodes) tag = mesh%node_tag(i)
        if (tag < range(1) .or. tag > range(2)) cycle
        if (mod(tag - range(1), range(3)) == 0_i8) call mesh%add_member(state%set, i)
      end do
      return
    end if
    do i = 1, words%n
      if (words%word(i) == '') cycle
      if (verify(trim(words%word(i)), '0123456789') == 0) then
        call to_number(cursor, words%word(i), 'a number', tag, error)
        if (.not. allocated(error)) call add(tag, .true.)
        if (allocated(error)) return
        cycle
      end if
      other = set_named(mesh, words%word(i), state%of)
      if (other == 0 .or. other == state%set) then
        call cursor%fault("no set is named '"//printable(trim(words%word(i)))//"' yet", error)
        return
      end if
      do k = 1, mesh%sets(other)%n
        call mesh%add_member(state%set, int(mesh%sets(other)%member(k)))
      end do
      call check_size(cursor, mesh, state%set, error)
      if (allocated(error)) return
    end do

  contains

    !> One member.
    subroutine add(tag, must_be)
      integer(i8), intent(in) :: tag
      logical, intent(in) :: must_be
      integer :: number

      if (state%of == set_of_elements) then
        number = mesh%element_of(tag)
      else
        number = mesh%node_of(tag)
      end if
      if (number > 0) then
        call mesh%add_member(state%set, number)
      else if (must_be .and. .not. state%in_assembly) then
        call cursor%fault(trim(merge('element', 'node   ', state%of == set_of_elements))//' '// &
          & to_text(tag)//' of a set is not there', error)
      end if
    end subroutine add

  end subroutine take_members

  !> `set or element, face`; without a face all free faces.
  subroutine take_face(cursor, mesh, state, words, error)
    type(cursor_type), intent(in) :: cursor
    type(mesh_type), intent(inout) :: mesh
    type(state_type), intent(in) :: state
    type(words_type), intent(in) :: words
    type(error_type), allocatable, intent(out) :: error
    integer :: face, other, k
    integer(i8) :: tag
    character(:), allocatable :: word

    face = 0
    if (words%n > 1) then
      word = lower_case(trim(words%word(2)))
      if (len(word) == 2) then
        if (scan(word(1:1), 'se') == 1) face = index('123456', word(2:2))
      else if (len(word) == 4) then
        if (word(:3) == 'end') face = index('12', word(4:4))
      end if
      if (face == 0 .and. len(word) > 0) then
        call cursor%fault("the unknown face '"//printable(word)//"'", error, &
          & "expected S1 to S6 (E1 to E4 for edges)")
        return
      end if
    end if
    if (verify(trim(words%word(1)), '0123456789') == 0 .and. words%word(1) /= '') then
      call to_number(cursor, words%word(1), 'a number', tag, error)
      if (allocated(error)) return
      k = mesh%element_of(tag)
      if (k == 0) then
        call cursor%fault('element '//to_text(tag)//' of a surface is not there', error)
      else
        call mesh%add_member(state%set, k, face)
      end if
      return
    end if
    other = set_named(mesh, words%word(1), set_of_elements)
    if (other == 0) then
      call cursor%fault("no set of elements is named '"//printable(trim(words%word(1)))//"' yet", &
        & error)
      return
    end if
    do k = 1, mesh%sets(other)%n
      call mesh%add_member(state%set, int(mesh%sets(other)%member(k)), face)
    end do
    call check_size(cursor, mesh, state%set, error)
  end subroutine take_face

  !> Sets of sets could grow without bound: an error if one names its members again and again.
  subroutine check_size(cursor, mesh, set, error)
    type(cursor_type), intent(in) :: cursor
    type(mesh_type), intent(in) :: mesh
    integer, intent(in) :: set
    type(error_type), allocatable, intent(out) :: error

    if (mesh%sets(set)%n <= 100 + 10*(int(mesh%n_elements, i8) + mesh%n_nodes)) return
    call cursor%fault("the set '"//printable(mesh%sets(set)%name)//"' has more members than "// &
      & 'the mesh has elements, nodes and faces', error)
  end subroutine check_size

  !> The number of a set with members of a kind; 0 if there is none of this name.
  pure integer function set_named(mesh, name, of) result(number)
    type(mesh_type), intent(in) :: mesh
    character(*), intent(in) :: name
    integer, intent(in) :: of
    character(:), allocatable :: wanted

    wanted = lower_case(trim(name(index(name, '.', back=.true.) + 1:)))
    do number = mesh%n_sets, 1, -1
      if (mesh%sets(number)%of == of .and. lower_case(mesh%sets(number)%name) == wanted) return
    end do
  end function set_named

  !> The number of the shape of a type of elements, 0 if it is unknown: letters, then the number of
  !> nodes, then whatever tells the formulation.
  pure integer function shape_of_type(name) result(number)
    character(*), intent(in) :: name
    character(:), allocatable :: type, letters
    integer :: first, last, nodes, i

    number = 0
    type = lower_case(trim(name))
    if (index(type, '3d') > 0 .and. index(type, '3d') <= 4) then
      first = index(type, '3d') + 2
    else if (index(type, '2d') > 0 .and. index(type, '2d') <= 3) then
      first = index(type, '2d') + 2
    else
      first = scan(type, '0123456789')
    end if
    if (first <= 1 .or. first > len(type)) return
    letters = type(:first - 1)
    last = first - 1
    nodes = 0
    do i = first, min(first + 1, len(type))
      if (scan(type(i:i), '0123456789') == 0) exit
      nodes = 10*nodes + iachar(type(i:i)) - iachar('0')
      last = i
    end do
    if (last < first) return
    select case (letters)
    case ('c3d', 'dc3d', 'ac3d')
      select case (nodes)
      case (4, 10); number = shape_of(kind_tetrahedron, nodes)
      case (5); number = shape_of(kind_pyramid, nodes)
      case (6, 15); number = shape_of(kind_wedge, nodes)
      case default; number = shape_of(kind_hexahedron, nodes)
      end select
    case ('cps', 'cpe', 'dc2d', 'ac2d', 's', 'm3d', 'r3d', 'ds', 'sfm3d', 'stri')
      if (letters == 'stri') nodes = merge(6, 3, nodes == 65)
      select case (nodes)
      case (3, 6); number = shape_of(kind_triangle, nodes)
      case default; number = shape_of(kind_quadrilateral, nodes)
      end select
    case ('t3d', 't2d', 'dc1d', 'r2d')
      number = shape_of(kind_line, nodes)
    case ('b')
      if (nodes == 31 .or. nodes == 21) number = shape_of(kind_line, 2)
      if (nodes == 32 .or. nodes == 22) number = shape_of(kind_line, 3)
    case ('sc')
      if (nodes == 6) number = shape_of(kind_wedge, 6)
      if (nodes == 8) number = shape_of(kind_hexahedron, 8)
    case default
      number = 0  ! unknown: an error of the caller
    end select
  end function shape_of_type

  !> A number of a node or element.
  subroutine to_number(cursor, word, what, value, error)
    type(cursor_type), intent(in) :: cursor
    character(*), intent(in) :: word, what
    integer(i8), intent(out) :: value
    type(error_type), allocatable, intent(out) :: error
    integer :: i, n
    logical :: good

    value = 0_i8
    n = len_trim(word)
    good = n > 0 .and. n <= 18
    do i = 1, n
      if (.not. good) exit
      good = word(i:i) >= '0' .and. word(i:i) <= '9'
      if (good) value = 10_i8*value + (iachar(word(i:i)) - iachar('0'))
    end do
    if (.not. good) call cursor%fault('expected '//what//", but found '"// &
      & printable(trim(word(:min(n, 40))))//"'", error)
  end subroutine to_number

  !> The words of a line, which commas part.
  subroutine split(cursor, line, words, error)
    type(cursor_type), intent(in) :: cursor
    character(*), intent(in) :: line
    type(words_type), intent(out) :: words
    type(error_type), allocatable, intent(out) :: error
    integer :: first, step

    first = 1
    do
      step = index(line(first:), ',')
      if (step == 0) step = len(line) - first + 2
      if (first > 1 .and. len_trim(line(first:)) == 0) exit
      if (words%n == most_words) then
        call cursor%fault('a line with more than '//to_text(most_words)//' words', error)
        return
      end if
      words%n = words%n + 1
      words%word(words%n) = adjustl(line(first:first + step - 2))
      if (len_trim(adjustl(line(first:first + step - 2))) > longest_word) then
        call cursor%fault('a word of more than '//to_text(longest_word)//' characters', error)
        return
      end if
      first = first + step
      if (first > len(line)) exit
    end do
  end subroutine split

  !> A keyword in lower case, with one blank between its words.
  pure function squeezed(word) result(text)
    character(*), intent(in) :: word
    character(:), allocatable :: text
    integer :: i

    text = ''
    do i = 1, len_trim(word)
      if (word(i:i) == ' ' .or. word(i:i) == achar(9)) then
        if (len(text) == 0) cycle
        if (text(len(text):) == ' ') cycle
        text = text//' '
      else
        text = text//word(i:i)
      end if
    end do
    text = lower_case(text)
  end function squeezed

  !> All words in lower case.
  pure function squeezed_all(words) result(texts)
    type(words_type), intent(in) :: words
    character(longest_word) :: texts(most_words)
    integer :: i

    texts = ''
    do i = 1, words%n
      texts(i) = squeezed(words%word(i))
    end do
  end function squeezed_all

  !> The value of a parameter of a keyword, without quotes; '' if it is not there.
  pure function parameter_of(words, name) result(value)
    type(words_type), intent(in) :: words
    character(*), intent(in) :: name
    character(:), allocatable :: value
    integer :: i, equals

    value = ''
    do i = 2, words%n
      equals = index(words%word(i), '=')
      if (equals == 0) cycle
      if (squeezed(trim(words%word(i)(:equals - 1))) /= name) cycle
      value = trim(adjustl(words%word(i)(equals + 1:)))
      if (len(value) >= 2) then
        if (value(1:1) == '"' .and. value(len(value):) == '"') value = value(2:len(value) - 1)
      end if
      return
    end do
  end function parameter_of

end module pd_body_mesh_abaqus
