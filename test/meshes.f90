!> Meshes that tests share: blocks of any shape of elements, and their text in each format.
module meshes
  use pd_base_kinds, only: wp, i4, i8
  use pd_body_mesh_elements, only: face_nodes, kind_hexahedron, kind_line, kind_point, &
    & kind_pyramid, kind_quadrilateral, kind_tetrahedron, kind_triangle, kind_wedge, &
    & shape_functions, shape_numbered, shape_of, shape_type
  implicit none (type, external)
  private
  public :: sample_type, block_sample, gmsh_text, abaqus_text, number_text, write_file

  !> A mesh with its groups: 1 is the whole block, 2 and 3 its ends along x.
  type :: sample_type
    integer :: dim = 0, n_nodes = 0, n_elements = 0
    real(wp), allocatable :: x(:, :)
    integer, allocatable :: shape(:), group(:), node(:, :)
  end type sample_type

  character(5), parameter :: names(3) = ['BLOCK', 'LEFT ', 'RIGHT']

contains

  !> Write a file in build/ as it is.
  subroutine write_file(name, text)
    character(*), intent(in) :: name   !! of the file
    character(*), intent(in) :: text   !! all its bytes
    integer :: unit

    open (newunit=unit, file='build/'//name, access='stream', form='unformatted', &
      & status='replace')
    write (unit) text
    close (unit)
  end subroutine write_file

  !> A block [0, lengths] of `counts` cells, cut into elements of a shape.
  subroutine block_sample(number, counts, lengths, sample)
    integer, intent(in) :: number      !! of the shape
    integer, intent(in) :: counts(3)   !! cells; those of directions that the shape lacks are 1
    real(wp), intent(in) :: lengths(3)
    type(sample_type), intent(out) :: sample
    type(shape_type) :: shape
    integer, parameter :: kuhn(4, 6) = reshape([1, 2, 3, 7, 1, 3, 4, 7, 1, 4, 8, 7, 1, 8, 5, 7, &
      & 1, 5, 6, 7, 1, 6, 2, 7], [4, 6])
    integer, parameter :: sides(4, 6) = reshape([1, 2, 3, 4, 5, 8, 7, 6, 1, 5, 6, 2, 2, 6, 7, 3, &
      & 3, 7, 8, 4, 4, 8, 5, 1], [4, 6])
    real(wp) :: corner(3, 9), h(3)
    integer :: i, j, k, c, n, room

    shape = shape_numbered(number)
    sample%dim = shape%dim
    n = product(counts(:shape%dim))
    room = 6*n*shape%nodes
    allocate (sample%x(3, room), sample%shape(10*n + 100), sample%group(10*n + 100), &
      & sample%node(27, 10*n + 100))
    h = lengths/counts
    do k = 0, merge(counts(3), 1, shape%dim > 2) - 1
      do j = 0, merge(counts(2), 1, shape%dim > 1) - 1
        do i = 0, counts(1) - 1
          do c = 1, 8
            corner(:, c) = h*[real(wp) :: i + merge(1, 0, any(mod(c, 4) == [2, 3])), &
              & j + merge(1, 0, any(mod(c, 4) == [3, 0])), k + merge(1, 0, c > 4)]
          end do
          if (shape%dim < 3) corner(3, :) = 0.0_wp
          if (shape%dim < 2) corner(2, :) = 0.0_wp
          corner(:, 9) = sum(corner(:, :8), dim=2)/8
          select case (shape%kind)
          case (kind_line)
            call add(sample, shape, corner(:, :2), 1)
          case (kind_triangle)
            call add(sample, shape, corner(:, [1, 2, 3]), 1)
            call add(sample, shape, corner(:, [1, 3, 4]), 1)
          case (kind_quadrilateral)
            call add(sample, shape, corner(:, :4), 1)
          case (kind_tetrahedron)
            do c = 1, 6
              call add(sample, shape, corner(:, kuhn(:, c)), 1)
            end do
          case (kind_hexahedron)
            call add(sample, shape, corner(:, :8), 1)
          case (kind_wedge)
            call add(sample, shape, corner(:, [1, 2, 3, 5, 6, 7]), 1)
            call add(sample, shape, corner(:, [1, 3, 4, 5, 7, 8]), 1)
          case default
            do c = 1, 6
              call add(sample, shape, corner(:, [sides(:, c), 9]), 1)
            end do
          end select
        end do
      end do
    end do
    call add_ends(sample, shape, lengths(1))
  end subroutine block_sample

  !> An element whose corners are given; nodes between are on straight lines.
  subroutine add(sample, shape, corners, group)
    type(sample_type), intent(inout) :: sample
    type(shape_type), intent(in) :: shape
    real(wp), intent(in) :: corners(:, :)
    integer, intent(in) :: group
    type(shape_type) :: straight
    real(wp), allocatable :: values(:), gradients(:, :)
    real(wp) :: x(3)
    integer :: i, k

    straight = shape_numbered(shape_of(shape%kind, shape%corners))
    allocate (values(shape%corners), gradients(3, shape%corners))
    sample%n_elements = sample%n_elements + 1
    sample%shape(sample%n_elements) = shape%number
    sample%group(sample%n_elements) = group
    do i = 1, shape%nodes
      call shape_functions(straight, shape%reference(:, i), values, gradients)
      x = matmul(corners, values)
      do k = sample%n_nodes, 1, -1
        if (all(abs(sample%x(:, k) - x) < 1.0e-9_wp)) exit
      end do
      if (k == 0) then
        sample%n_nodes = sample%n_nodes + 1
        k = sample%n_nodes
        sample%x(:, k) = x
      end if
      sample%node(i, sample%n_elements) = k
    end do
  end subroutine add

  !> The faces at both ends along x, as elements.
  subroutine add_ends(sample, shape, length)
    type(sample_type), intent(inout) :: sample
    type(shape_type), intent(in) :: shape
    real(wp), intent(in) :: length
    integer, allocatable :: numbers(:)
    integer :: e, f, side, of_face, n
    real(wp) :: at

    n = sample%n_elements
    do side = 2, 3
      at = merge(0.0_wp, length, side == 2)
      do e = 1, n
        do f = 1, shape%faces
          call face_nodes(shape, f, numbers, of_face)
          if (any(abs(sample%x(1, sample%node(numbers, e)) - at) > 1.0e-9_wp)) cycle
          sample%n_elements = sample%n_elements + 1
          sample%shape(sample%n_elements) = of_face
          sample%group(sample%n_elements) = side
          sample%node(:size(numbers), sample%n_elements) = sample%node(numbers, e)
        end do
      end do
    end do
  end subroutine add_ends

  !> The file of Gmsh: version 2 or 4, text or binary, in this machine's order of bytes or the
  !> other.
  function gmsh_text(sample, version, binary, swapped) result(text)
    type(sample_type), intent(in) :: sample
    integer, intent(in) :: version
    logical, intent(in) :: binary, swapped
    character(:), allocatable :: text
    character(1), parameter :: lf = achar(10)
    type(shape_type) :: shape
    integer :: i, k, g, dim

    text = '$MeshFormat'//lf//trim(merge('2.2', '4.1', version == 2))//merge(' 1', ' 0', binary) &
      & //' 8'//lf
    if (binary) text = text//four(1)//lf
    text = text//'$EndMeshFormat'//lf//'$PhysicalNames'//lf//'3'//lf
    do g = 1, 3
      dim = sample%dim - merge(0, 1, g == 1)
      text = text//number_text(dim)//' '//number_text(10*g)//' "'//trim(names(g))//'"'//lf
    end do
    text = text//'$EndPhysicalNames'//lf
    if (version == 4) then
      text = text//'$Entities'//lf
      do dim = 0, 3
        text = text//wide(int(count_of_dim(dim), i8))
      end do
      if (.not. binary) text = text//lf
      do dim = 0, 3
        do g = 1, 3
          if (dim /= sample%dim - merge(0, 1, g == 1)) cycle
          text = text//word(g)
          do k = 1, merge(3, 6, dim == 0)
            text = text//real_word(0.0_wp)
          end do
          text = text//wide(1_i8)//word(10*g)
          if (dim > 0) text = text//wide(0_i8)
          if (.not. binary) text = text//lf
        end do
      end do
      if (binary) text = text//lf
      text = text//'$EndEntities'//lf
    end if
    text = text//'$Nodes'//lf
    if (version == 2) then
      text = text//number_text(sample%n_nodes)//lf
      do i = 1, sample%n_nodes
        text = text//word(i)//place(i)
      end do
    else
      text = text//wide(1_i8)//wide(int(sample%n_nodes, i8))//wide(1_i8)//wide(int( &
        & sample%n_nodes, i8))//word(sample%dim)//word(1)//word(0)//wide(int(sample%n_nodes, i8))
      do i = 1, sample%n_nodes
        text = text//wide(int(i, i8))
      end do
      do i = 1, sample%n_nodes
        text = text//place(i)
      end do
    end if
    if (binary) text = text//lf
    text = text//'$EndNodes'//lf//'$Elements'//lf
    if (version == 2) then
      text = text//number_text(sample%n_elements)//lf
      do i = 1, sample%n_elements
        shape = shape_numbered(sample%shape(i))
        if (binary) then
          text = text//word(gmsh_type(shape))//word(1)//word(2)//word(i)
        else
          text = text//word(i)//word(gmsh_type(shape))//word(2)
        end if
        text = text//word(10*sample%group(i))//word(sample%group(i))
        do k = 1, shape%nodes
          text = text//word(sample%node(k, i))
        end do
        if (.not. binary) text = text//lf
      end do
    else
      ! a block for each element
      text = text//wide(int(sample%n_elements, i8))//wide(int(sample%n_elements, i8))// &
        & wide(1_i8)//wide(int(sample%n_elements, i8))
      do i = 1, sample%n_elements
        shape = shape_numbered(sample%shape(i))
        text = text//word(shape%dim)//word(sample%group(i))//word(gmsh_type(shape))//wide(1_i8) &
          & //wide(int(i, i8))
        do k = 1, shape%nodes
          text = text//wide(int(sample%node(k, i), i8))
        end do
        if (.not. binary) text = text//lf
      end do
    end if
    if (binary) text = text//lf
    text = text//'$EndElements'//lf

  contains

    integer function count_of_dim(dim) result(n)
      integer, intent(in) :: dim
      n = 0
      if (dim == sample%dim) n = 1
      if (dim == sample%dim - 1) n = 2
    end function count_of_dim

    function place(i) result(text)
      integer, intent(in) :: i
      character(:), allocatable :: text
      text = real_word(sample%x(1, i))//real_word(sample%x(2, i))//real_word(sample%x(3, i))
      if (.not. binary) text = text//lf
    end function place

    function word(i) result(text)
      integer, intent(in) :: i
      character(:), allocatable :: text
      text = number_text(i)//' '
      if (binary) text = four(i)
    end function word

    function wide(i) result(text)
      integer(i8), intent(in) :: i
      character(:), allocatable :: text
      text = number_text(int(i))//' '
      if (binary) text = turned(transfer(i, repeat(' ', 8)))
    end function wide

    function real_word(value) result(text)
      real(wp), intent(in) :: value
      character(:), allocatable :: text
      character(32) :: buffer
      write (buffer, '(es25.17)') value
      text = trim(adjustl(buffer))//' '
      if (binary) text = turned(transfer(value, repeat(' ', 8)))
    end function real_word

    function four(i) result(text)
      integer, intent(in) :: i
      character(4) :: text
      text = turned(transfer(int(i, i4), repeat(' ', 4)))
    end function four

    function turned(bytes) result(text)
      character(*), intent(in) :: bytes
      character(len(bytes)) :: text
      integer :: i
      text = bytes
      if (.not. swapped) return
      do i = 1, len(bytes)
        text(i:i) = bytes(len(bytes) - i + 1:len(bytes) - i + 1)
      end do
    end function turned

  end function gmsh_text

  !> Gmsh's number of a shape.
  integer function gmsh_type(shape) result(number)
    type(shape_type), intent(in) :: shape
    integer, parameter :: types(16) = [15, 1, 8, 2, 9, 3, 16, 10, 4, 11, 5, 17, 12, 6, 18, 7]
    number = types(shape%number)
  end function gmsh_type

  !> The input file of Abaqus, with the ends as surfaces and sets of nodes.
  function abaqus_text(sample) result(text)
    type(sample_type), intent(in) :: sample
    character(:), allocatable :: text
    character(1), parameter :: lf = achar(10)
    character(5), parameter :: types(16) = [character(5) :: '', 'T3D2', 'B32', 'CPS3', 'CPE6', &
      & 'CPS4R', 'CPS8', 'M3D9', 'C3D4', 'C3D10', 'C3D8I', 'C3D20', 'C3D27', 'C3D6', 'C3D15', &
      & 'C3D5']
    character(32) :: buffer(3)
    type(shape_type) :: shape
    integer, allocatable :: order(:)
    integer :: i, k, g, used, f

    text = '*HEADING'//lf//'made by a test'//lf//'** a comment'//lf//'*Node, NSET=all'//lf
    do i = 1, sample%n_nodes
      write (buffer, '(es25.17)') sample%x(:, i)
      text = text//number_text(i)
      do k = 1, 3
        text = text//', '//trim(adjustl(buffer(k)))
      end do
      text = text//lf
    end do
    shape = shape_numbered(sample%shape(1))
    text = text//'*ELEMENT, TYPE='//trim(types(shape%number))//', ELSET=block'//lf
    order = abaqus_order(shape)
    used = 0
    do i = 1, sample%n_elements
      if (sample%group(i) /= 1) cycle
      used = i
      text = text//number_text(i)
      do k = 1, shape%nodes
        text = text//','
        if (k == 10) text = text//lf
        text = text//number_text(sample%node(order(k), i))
      end do
      text = text//lf
    end do
    text = text//'*ELSET, ELSET=ODD, GENERATE'//lf//'1, '//number_text(used)//', 2'//lf
    do g = 2, 3
      text = text//'*SURFACE, NAME='//trim(names(g))//', TYPE=ELEMENT'//lf
      do i = 1, used
        do f = 1, shape%faces
          if (on_face(i, f, g)) text = text//number_text(i)//', '// &
            & merge('E', 'S', shape%dim == 2)//number_text(f)//lf
        end do
      end do
      text = text//'*NSET, NSET='//trim(names(g))//'_NODES'//lf
      do i = 1, sample%n_nodes
        if (abs(sample%x(1, i) - merge(0.0_wp, maxval(sample%x(1, :sample%n_nodes)), g == 2)) &
          & < 1.0e-9_wp) text = text//number_text(i)//lf
      end do
    end do
    text = text//'*MATERIAL, NAME=STEEL'//lf//'*ELASTIC'//lf//'2e11, 0.3'//lf

  contains

    !> Whether a face is at an end.
    logical function on_face(e, f, g)
      integer, intent(in) :: e, f, g
      integer, allocatable :: numbers(:)
      integer :: of_face
      real(wp) :: at

      call face_nodes(shape, f, numbers, of_face)
      at = merge(0.0_wp, maxval(sample%x(1, :sample%n_nodes)), g == 2)
      on_face = all(abs(sample%x(1, sample%node(numbers, e)) - at) < 1.0e-9_wp)
    end function on_face

  end function abaqus_text

  !> For each node in the order of Abaqus, its number in that of Gmsh: from the places of nodes in
  !> the figures of Abaqus' manual, corner by corner.
  function abaqus_order(shape) result(order)
    type(shape_type), intent(in) :: shape
    integer, allocatable :: order(:)
    integer, parameter :: hexahedron(2, 12) = reshape([1, 2, 2, 3, 3, 4, 4, 1, 5, 6, 6, 7, 7, 8, &
      & 8, 5, 1, 5, 2, 6, 3, 7, 4, 8], [2, 12])
    integer, parameter :: wedge(2, 9) = reshape([1, 2, 2, 3, 3, 1, 4, 5, 5, 6, 6, 4, 1, 4, 2, 5, &
      & 3, 6], [2, 9])
    integer, parameter :: tetrahedron(2, 6) = reshape([1, 2, 2, 3, 3, 1, 1, 4, 2, 4, 3, 4], [2, 6])
    real(wp), parameter :: middles(3, 7) = reshape([0, 0, 0, 0, 0, -1, 0, 0, 1, 0, -1, 0, 1, 0, 0, &
      & 0, 1, 0, -1, 0, 0], [3, 7])
    integer :: i

    order = [(i, i=1, shape%nodes)]
    if (shape%kind == kind_line .and. shape%nodes == 3) order = [1, 3, 2]
    if (shape%kind == kind_tetrahedron .and. shape%nodes == 10) then
      do i = 1, 6
        order(4 + i) = between(tetrahedron(:, i))
      end do
    else if (shape%nodes == 15) then
      do i = 1, 9
        order(6 + i) = between(wedge(:, i))
      end do
    else if (shape%nodes >= 20) then
      do i = 1, 12
        order(8 + i) = between(hexahedron(:, i))
      end do
      do i = 1, 7
        if (shape%nodes == 27) order(20 + i) = at(middles(:, i))
      end do
    end if

  contains

    integer function between(ends)
      integer, intent(in) :: ends(2)
      between = at(sum(shape%reference(:, ends), dim=2)/2)
    end function between

    integer function at(x)
      real(wp), intent(in) :: x(3)
      do at = 1, shape%nodes
        if (all(abs(shape%reference(:, at) - x) < 1.0e-9_wp)) return
      end do
      at = 0
    end function at

  end function abaqus_order

  !> An integer as text.
  function number_text(i) result(text)
    integer, intent(in) :: i
    character(:), allocatable :: text
    character(16) :: buffer
    write (buffer, '(i0)') i
    text = trim(buffer)
  end function number_text

end module meshes
