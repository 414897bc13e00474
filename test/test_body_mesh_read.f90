!> Reading meshes, in all formats, and what is wrong with some.
module test_body_mesh_read
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i8
  use pd_base_reduce, only: noise
  use pd_body_mesh_elements, only: shape_numbered, shape_type
  use pd_body_mesh_geometry, only: mesh_points
  use pd_body_mesh_mesh, only: mesh_type, set_of_elements
  use pd_body_mesh_part, only: count_pieces, count_twins, facets_named, facets_type, find_faces, &
    & part_type, points_named
  use pd_body_mesh_read, only: read_mesh, read_mesh_text
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: expect_true
  use comparisons, only: expect_close
  use meshes, only: abaqus_text, block_sample, gmsh_text, number_text, sample_type
  implicit none (type, external)
  private
  public :: collect_body_mesh_read

  character(1), parameter :: lf = achar(10)

contains

  subroutine collect_body_mesh_read(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('every shape in every format', test_formats), &
      & new_unittest('groups of Gmsh, sets and surfaces of Abaqus', test_sets), &
      & new_unittest('elements that MSH 2.2 repeats for their groups', test_repeats), &
      & new_unittest('files that include others', test_include), &
      & new_unittest('lines, blanks and names of Abaqus', test_abaqus_text), &
      & new_unittest('a file that is cut off anywhere is refused', test_cut), &
      & new_unittest('faults of a file', test_faults), &
      & new_unittest('faults of a mesh', test_mesh_faults), &
      & new_unittest('counts that cannot be are refused before they are believed', test_counts), &
      & new_unittest('mutants neither crash nor hang', test_mutants), &
      & new_unittest('long: 20000 mutants', test_many_mutants)]
  end subroutine collect_body_mesh_read

  !> The same nodes, elements and shapes from all six files.
  subroutine test_formats(error)
    type(error_type), allocatable, intent(out) :: error
    type(sample_type) :: sample
    type(mesh_type) :: mesh
    type(shape_type) :: shape
    integer :: s, form, e

    do s = 2, 16
      shape = shape_numbered(s)
      call block_sample(s, [2, 1, 1], [2.0_wp, 1.0_wp, 1.0_wp], sample)
      do form = 1, 6
        call read_form(sample, form, 0.5_wp, mesh, error)
        if (allocated(error)) return
        call expect_true(error, mesh%n_nodes == sample%n_nodes, 'number of nodes, form '// &
          & number_text(form))
        call expect_true(error, mesh%n_elements == merge(count(sample%group(:sample%n_elements) &
          & == 1), sample%n_elements, form == 6), 'number of elements')
        if (allocated(error)) return
        call expect_close(error, mesh%x(:, :mesh%n_nodes), &
          & 0.5_wp*sample%x(:, :sample%n_nodes), 1.0e-15_wp, 'positions')
        do e = 1, mesh%n_elements
          shape = shape_numbered(sample%shape(e))
          call expect_true(error, mesh%shape(e) == shape%number, 'shape of an element')
          if (allocated(error)) return
          call expect_true(error, all(mesh%nodes_of(e) == sample%node(:shape%nodes, e)), &
            & 'nodes of a '//trim(shape%name)//', form '//number_text(form))
        end do
      end do
    end do
  end subroutine test_formats

  !> MSH 2.2 and 4.1, as text, binary and in the other order of bytes; 6: .inp.
  subroutine read_form(sample, form, scale, mesh, error)
    type(sample_type), intent(in) :: sample
    integer, intent(in) :: form
    real(wp), intent(in) :: scale
    type(mesh_type), intent(out) :: mesh
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text

    text = text_of_form(sample, form)
    call read_mesh_text(text, merge('a.inp', 'a.msh', form == 6), sample%dim, scale, mesh, fault)
    if (allocated(fault)) call test_failed(error, 'form '//number_text(form)//': '//fault%message)
  end subroutine read_form

  function text_of_form(sample, form) result(text)
    type(sample_type), intent(in) :: sample
    integer, intent(in) :: form
    character(:), allocatable :: text

    if (form == 6) then
      text = abaqus_text(sample)
    else
      text = gmsh_text(sample, merge(2, 4, form == 1 .or. form == 2), form /= 1 .and. form /= 3, &
        & form == 5)
    end if
  end function text_of_form

  subroutine test_sets(error)
    type(error_type), allocatable, intent(out) :: error
    type(sample_type) :: sample
    type(part_type) :: part
    type(facets_type) :: facets
    logical, allocatable :: chosen(:)
    integer :: form, s
    character(6), parameter :: names(2) = ['LEFT ', 'RIGHT']
    real(wp), parameter :: normal(3, 2) = reshape([-1, 0, 0, 1, 0, 0], [3, 2])

    do form = 1, 6
      call block_sample(11, [3, 2, 2], [3.0_wp, 2.0_wp, 2.0_wp], sample)
      call read_part(sample, form, part, error)
      if (allocated(error)) return
      call named(part, 'block', chosen, error)
      if (allocated(error)) return
      call expect_true(error, all(chosen), 'all points are in the block')
      do s = 1, 2
        call facets_of(part, trim(names(s)), facets, error)
        if (allocated(error)) return
        call expect_true(error, facets%n == 4, 'four facets at an end')
        call expect_close(error, sum(facets%vector, dim=2), 4*normal(:, s), 1.0e-14_wp, 'area')
        call expect_close(error, sum(facets%centre, dim=2)/4, [merge(0.0_wp, 3.0_wp, s == 1), &
          & 1.0_wp, 1.0_wp], 1.0e-14_wp, 'centre')
      end do
    end do
    ! the sets of .inp: every other element; the elements at an end; the facets of its nodes
    call named(part, 'odd', chosen, error)
    if (allocated(error)) return
    call expect_true(error, all(chosen .eqv. [(mod(s, 2) == 1, s=1, 12)]), 'a generated set')
    call named(part, 'Left_Nodes', chosen, error)
    if (allocated(error)) return
    call expect_true(error, all(chosen .eqv. [(mod(s, 3) == 1, s=1, 12)]), 'the first elements')
    call facets_of(part, 'Left_Nodes', facets, error)
    if (allocated(error)) return
    call expect_close(error, sum(facets%vector, dim=2), 4*normal(:, 1), 1.0e-14_wp, 'their area')
  end subroutine test_sets

  subroutine named(part, name, chosen, error)
    type(part_type), intent(in) :: part
    character(*), intent(in) :: name
    logical, allocatable, intent(out) :: chosen(:)
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    call points_named(part, name, chosen, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine named

  subroutine facets_of(part, name, facets, error)
    type(part_type), intent(in) :: part
    character(*), intent(in) :: name
    type(facets_type), intent(out) :: facets
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    call facets_named(part, name, facets, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine facets_of

  subroutine read_part(sample, form, part, error)
    type(sample_type), intent(in) :: sample
    integer, intent(in) :: form
    type(part_type), intent(out) :: part
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: x(:, :), volume(:)

    part%dim = sample%dim
    call read_form(sample, form, 1.0_wp, part%mesh, error)
    if (allocated(error)) return
    call mesh_points(part%mesh, part%dim, 1, 1.0_wp, x, volume, part%element, fault)
    part%n_points = size(volume)
    if (.not. allocated(fault)) call find_faces(part, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine read_part

  !> An element in two groups stands twice in MSH 2.2, with another number; it is one.
  subroutine test_repeats(error)
    type(error_type), allocatable, intent(out) :: error
    type(mesh_type) :: mesh
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text
    integer :: s

    text = triangles('4'//lf//'1 2 2 7 1 1 2 3'//lf//'2 2 2 8 1 1 2 3'//lf//'3 2 2 7 1 2 4 3'//lf &
      & //'4 1 2 9 1 1 2'//lf)
    call read_mesh_text(text, 'a.msh', 2, 1.0_wp, mesh, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    do s = 1, mesh%n_sets
      if (mesh%sets(s)%name /= '8') cycle
      call expect_true(error, mesh%sets(s)%n == 1 .and. mesh%sets(s)%member(1) == 1, &
        & 'the second group has the first element')
    end do
    call expect_true(error, mesh%shape(2) == 0 .and. mesh%n_sets == 3, 'the repeated one is gone')
  end subroutine test_repeats

  !> Four nodes of a square with these elements, in MSH 2.2.
  function triangles(elements, nodes) result(text)
    character(*), intent(in) :: elements
    character(*), intent(in), optional :: nodes
    character(:), allocatable :: text

    text = '$MeshFormat'//lf//'2.2 0 8'//lf//'$EndMeshFormat'//lf//'$Nodes'//lf
    if (present(nodes)) then
      text = text//nodes
    else
      text = text//'4'//lf//'1 0 0 0'//lf//'2 1 0 0'//lf//'3 0 1 0'//lf//'4 1 1 0'//lf
    end if
    text = text//'$EndNodes'//lf//'$Elements'//lf//elements//'$EndElements'//lf
  end function triangles

  subroutine test_include(error)
    type(error_type), allocatable, intent(out) :: error
    type(mesh_type) :: mesh
    type(fault_type), allocatable :: fault
    integer :: unit

    open (newunit=unit, file='build/mesh_nodes.inc')
    write (unit, '(a)') '*NODE', '1, 0., 0., 0.', '2, 1., 0., 0.', '3, 0., 1., 0.'
    close (unit)
    open (newunit=unit, file='build/mesh_main.inp')
    write (unit, '(a)') '*INCLUDE, INPUT=mesh_nodes.inc', '*ELEMENT, TYPE=CPS3', '1, 1, 2, 3'
    close (unit)
    call read_mesh('build/mesh_main.inp', 2, 1.0_wp, mesh, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    call expect_true(error, mesh%n_nodes == 3 .and. mesh%n_elements == 1, 'what both files hold')
    open (newunit=unit, file='build/mesh_main.inp')
    write (unit, '(a)') '*INCLUDE, INPUT=mesh_main.inp'
    close (unit)
    call read_mesh('build/mesh_main.inp', 2, 1.0_wp, mesh, fault)
    call refused(error, fault, 'files deep')
  end subroutine test_include

  subroutine test_abaqus_text(error)
    type(error_type), allocatable, intent(out) :: error
    type(mesh_type) :: mesh
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text

    text = '** made by hand'//lf//'*NODE ,  NSET = "Some Nodes"'//achar(13)//lf// &
      & achar(9)//'1 , 0.0D0 , .0'//lf//'2,1.,'//lf//'3,0,1e0'//lf//lf//'4, 1, 1,'//lf// &
      & '*element, type=s3r,'//lf//' elset=A'//lf//'11, 1, 2,'//lf//'3'//lf//'12,2,4,3'//lf// &
      & '*Elset, elset=b, Generate'//lf//'1, 1000000000000, 1'//lf//'*ELSET, ELSET=C'//lf// &
      & 'a, 12,'//lf//'*BOUNDARY'//lf//'1, 1, 3'//lf//'*STEP'//lf//'*END STEP'//lf
    call read_mesh_text(text, 'a.inp', 2, 1.0_wp, mesh, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    call expect_close(error, mesh%x(:2, :4), reshape([0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, &
      & 1.0_wp, 1.0_wp, 1.0_wp], [2, 4]), 0.0_wp, 'coordinates')
    call expect_true(error, mesh%n_elements == 2 .and. mesh%sets(1)%name == 'Some Nodes' .and. &
      & mesh%sets(1)%n == 4, 'the nodes of a name with a blank')
    call expect_true(error, mesh%sets(3)%n == 2, 'a generated set')
    call expect_true(error, mesh%sets(4)%of == set_of_elements .and. mesh%sets(4)%n == 3, &
      & 'a set of a set')
    call expect_true(error, mesh%skipped == 3, 'other keywords are counted')
    call expect_true(error, mesh%first_skipped == '*boundary', 'the first of them is kept')
  end subroutine test_abaqus_text

  !> Every file, cut at many places, is an error that names the file; the last line end may go.
  subroutine test_cut(error)
    type(error_type), allocatable, intent(out) :: error
    type(sample_type) :: sample
    type(mesh_type) :: mesh
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text, part
    integer :: form, cut, length

    call block_sample(9, [1, 1, 1], [1.0_wp, 1.0_wp, 1.0_wp], sample)
    do form = 1, 5
      text = text_of_form(sample, form)
      length = len(text)
      do cut = 1, 60
        part = text(:(length - 2)*cut/60)
        call read_mesh_text(part, 'a.msh', 3, 1.0_wp, mesh, fault)
        call refused(error, fault, ' --> a.msh')
        if (allocated(error)) return
      end do
    end do
    text = abaqus_text(sample)
    text = text(:index(text, '*ELSET') - 4)
    call read_mesh_text(text, 'a.inp', 3, 1.0_wp, mesh, fault)
    call refused(error, fault, 'cut off')
  end subroutine test_cut

  !> Fail unless a fault says so.
  subroutine refused(error, fault, words)
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable, intent(in) :: fault
    character(*), intent(in) :: words

    if (allocated(error)) return
    if (.not. allocated(fault)) then
      call test_failed(error, "accepted, but expected: '"//words//"'")
    else if (index(fault%message, words) == 0) then
      call test_failed(error, "expected '"//words//"' in: "//fault%message)
    end if
  end subroutine refused

  subroutine test_faults(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: nodes = '*NODE'//lf//'1,0,0'//lf//'2,1,0'//lf//'3,0,1'//lf

    call refuse_text('a.vtk', 'x', './pf convert FILE')
    call refuse_text('a.msh', 'x', 'expected $MeshFormat')
    call refuse_text('a.msh', '$MeshFormat'//lf//'4.0 0 8'//lf, "version '4.0'")
    call refuse_text('a.msh', '$MeshFormat'//lf//'4.1 0 4'//lf, 'data size 4')
    call refuse_text('a.msh', '$MeshFormat'//lf//'4.1 1 8'//lf//'abcd', 'order of bytes')
    call refuse_text('a.msh', triangles('1'//lf//'1 2 0 1 2 3 4'//lf), 'expected $EndElements')
    call refuse_text('a.msh', triangles('1'//lf//'1 2 0 1 2 9'//lf), &
      & 'has node 9, which is not there')
    call refuse_text('a.msh', triangles('1'//lf//'1 99 0 1 2 3'//lf), 'the unknown type 99')
    call refuse_text('a.msh', triangles('1'//lf//'1 13 0 1 2 3'//lf), 'wedge of 18 nodes')
    call refuse_text('a.msh', triangles('2'//lf//'1 2 0 1 2 3'//lf//'1 2 0 2 4 3'//lf), &
      & 'element 1 stands twice')
    call refuse_text('a.msh', triangles('1'//lf//'1 2 0 1 2 3'//lf, '3'//lf//'1 0 0 0'//lf// &
      & '1 1 0 0'//lf//'3 0 1 0'//lf), 'node 1 stands twice'//lf//' --> a.msh:7')
    call refuse_text('a.msh', triangles('1'//lf//'1 2 0 1 2 3'//lf, '3'//lf//'1 0 0 0'//lf// &
      & '2 nan 0 0'//lf//'3 0 1 0'//lf), "found 'nan'")
    call refuse_text('a.msh', triangles('1'//lf//'1 2 0 1 2 3'//lf, '3'//lf//'1 0 0 0'//lf// &
      & '2 1e999 0 0'//lf//'3 0 1 0'//lf), "found '1e999'")
    call refuse_text('a.inp', nodes//'*ELEMENT, TYPE=CAX3'//lf//'1,1,2,3'//lf, &
      & "the unknown type 'CAX3'")
    call refuse_text('a.inp', nodes//'*ELEMENT, TYPE=CPS3'//lf//'1,1,2,5'//lf, &
      & 'has node 5, which is not there'//lf//' --> a.inp:6')
    call refuse_text('a.inp', nodes//'*ELEMENT, TYPE=CPS3'//lf//'1,1,2,'//lf//'*STEP'//lf, &
      & 'element 1 lacks nodes: 2 of 3')
    call refuse_text('a.inp', nodes//'*ELEMENT, TYPE=CPS3'//lf//'1,1,2,3,1'//lf, 'more than 3')
    call refuse_text('a.inp', nodes//'*ELEMENT, TYPE=CPS3'//lf//'1,1,2,x'//lf, "found 'x'")
    call refuse_text('a.inp', nodes//'*ELEMENT, TYPE=CPS3'//lf//'1,1,2,3'//lf//'*ELSET, ELSET=A' &
      & //lf//'7'//lf, 'element 7 of a set is not there')
    call refuse_text('a.inp', nodes//'*ELEMENT, TYPE=CPS3'//lf//'1,1,2,3'//lf//'*ELSET, ELSET=A' &
      & //lf//'B'//lf, "no set is named 'B'")
    call refuse_text('a.inp', nodes//'*PART, NAME=A'//lf//'*PART, NAME=B'//lf, 'a second *PART')
    call refuse_text('a.inp', nodes, 'no *ELEMENT')

  contains

    subroutine refuse_text(name, content, words)
      character(*), intent(in) :: name, content, words
      type(mesh_type) :: mesh
      type(fault_type), allocatable :: fault
      character(:), allocatable :: text

      text = content
      call read_mesh_text(text, name, 2, 1.0_wp, mesh, fault)
      call refused(error, fault, words)
    end subroutine refuse_text

  end subroutine test_faults

  subroutine test_mesh_faults(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: head = '*NODE'//lf//'1,0,0,0'//lf//'2,1,0,0'//lf//'3,0,1,0'//lf// &
      & '4,0,0,1'//lf//'5,1,1,0'//lf//'6,.2,.2,0'//lf//'7,1,1,1'//lf//'8,2,2,0'//lf
    character(*), parameter :: solid = head//'*ELEMENT, TYPE=C3D4'//lf
    character(*), parameter :: plane = head//'*ELEMENT, TYPE=CPS3'//lf
    type(part_type) :: part

    call refuse_mesh(plane//'1,1,2,3'//lf, 3, 'no elements of dimension 3')
    call refuse_mesh(solid//'1,1,2,3,4'//lf, 2, 'in a scene of dimension 2')
    call refuse_mesh(solid//'1,1,3,2,4'//lf, 3, 'element 1 (tetrahedron of 4 nodes) is inverted')
    call refuse_mesh(solid//'7,1,2,3,5'//lf, 3, 'element 7 (tetrahedron of 4 nodes) has no volume')
    call refuse_mesh(plane//'1,1,2,4'//lf, 2, 'no direction z')
    call refuse_mesh(plane//'3,1,2,3'//lf//'4,2,3,1'//lf, 2, 'has the same nodes as element 3')
    call refuse_mesh(plane//'1,1,1,3'//lf, 2, 'has no volume')
    call refuse_mesh(head//'*ELEMENT, TYPE=CPS4'//lf//'1,1,2,6,3'//lf, 2, 'partly inverted')
    call refuse_mesh(head//'*ELEMENT, TYPE=CPS4'//lf//'1,1,2,3,5'//lf, 2, 'has no volume')
    call refuse_mesh(solid//'1,1,2,3,4'//lf//'*ELEMENT, TYPE=S3'//lf//'2,5,2,3'//lf, 3, &
      & 'element 2 (triangle of 3 nodes) is a face of no element')
    call refuse_mesh(plane//'1,1,2,3'//lf//'2,1,2,5'//lf//'3,1,2,8'//lf, 2, 'shares a face')
    ! two parts that touch without sharing nodes
    call refuse_mesh(head//'9,1,0,0'//lf//'10,0,1,0'//lf//'*ELEMENT, TYPE=CPS3'//lf//'1,1,2,3' &
      & //lf//'2,9,5,10'//lf, 2, '')
    call expect_true(error, count_pieces(part) == 2, 'two pieces')
    call expect_true(error, count_twins(part, 0.5_wp) == 2, 'two nodes on others')

  contains

    !> Expect a fault with these words; '' for none.
    subroutine refuse_mesh(content, dim, words)
      character(*), intent(in) :: content, words
      integer, intent(in) :: dim
      type(fault_type), allocatable :: fault
      type(part_type) :: fresh
      character(:), allocatable :: text
      real(wp), allocatable :: x(:, :), volume(:)

      part = fresh
      text = content
      part%dim = dim
      call read_mesh_text(text, 'a.inp', dim, 1.0_wp, part%mesh, fault)
      if (.not. allocated(fault)) call mesh_points(part%mesh, dim, 1, 1.0_wp, x, volume, &
        & part%element, fault)
      if (.not. allocated(fault)) then
        part%n_points = size(volume)
        call find_faces(part, fault)
      end if
      if (len(words) > 0) then
        call refused(error, fault, words)
      else if (allocated(fault)) then
        call test_failed(error, fault%message)
      end if
    end subroutine refuse_mesh

  end subroutine test_mesh_faults

  !> Two thousand million nodes in a file of a hundred bytes.
  subroutine test_counts(error)
    type(error_type), allocatable, intent(out) :: error
    type(mesh_type) :: mesh
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text

    text = triangles('1'//lf//'1 2 0 1 2 3'//lf, '2000000000'//lf//'1 0 0 0'//lf)
    call read_mesh_text(text, 'a.msh', 2, 1.0_wp, mesh, fault)
    call refused(error, fault, 'the number of nodes is 2000000000, but only')
    text = '$MeshFormat'//lf//'4.1 1 8'//lf//char(1)//char(0)//char(0)//char(0)//lf// &
      & '$EndMeshFormat'//lf//'$Nodes'//lf//repeat(char(127), 100)
    call read_mesh_text(text, 'a.msh', 2, 1.0_wp, mesh, fault)
    call refused(error, fault, 'bytes are left of the file')
    text = triangles('-1'//lf)
    call read_mesh_text(text, 'a.msh', 2, 1.0_wp, mesh, fault)
    call refused(error, fault, 'the number of elements is -1')
  end subroutine test_counts

  subroutine test_mutants(error)
    type(error_type), allocatable, intent(out) :: error
    call mutate(2000, 1, error)
  end subroutine test_mutants

  subroutine test_many_mutants(error)
    type(error_type), allocatable, intent(out) :: error
    call mutate(20000, 77, error)
  end subroutine test_many_mutants

  !> Files with some bytes changed, pieces repeated or taken out: read, with points and faces, or
  !> refused. What the last step gives must be sound.
  subroutine mutate(n, seed, error)
    integer, intent(in) :: n, seed
    type(error_type), allocatable, intent(inout) :: error
    type(sample_type) :: sample(3)
    type(fault_type), allocatable :: fault
    type(part_type) :: part, fresh
    type(facets_type) :: facets
    character(:), allocatable :: text
    logical, allocatable :: chosen(:)
    real(wp), allocatable :: x(:, :), volume(:)
    integer :: state, i, form, s, k, at, length, accepted

    state = seed
    call block_sample(7, [2, 1, 1], [1.0_wp, 1.0_wp, 1.0_wp], sample(1))
    call block_sample(9, [1, 1, 1], [1.0_wp, 1.0_wp, 1.0_wp], sample(2))
    call block_sample(15, [1, 1, 1], [1.0_wp, 1.0_wp, 1.0_wp], sample(3))
    accepted = 0
    do i = 1, n
      form = 1 + mod(i, 6)
      s = 1 + mod(i/6, 3)
      text = text_of_form(sample(s), form)
      do k = 1, 1 + int(2*(1 + noise(state)))
        at = 1 + int((len(text) - 1)*(1 + noise(state))/2)
        length = min(len(text) - at, int(20*(1 + noise(state))))
        select case (int(2.999_wp*(1 + noise(state))))
        case (0, 1)
          text(at:at) = achar(48 + int(4.999_wp*(1 + noise(state))))
        case (2)
          text(at:at) = char(int(127.5_wp*(1 + noise(state))))
        case (3)
          text = text(:at)//text(at + length:)
        case (4)
          text = text(:at + length)//text(at:)
        case default
          text = text(:at)//repeat('9', length)//text(at:)
        end select
      end do
      part = fresh
      part%dim = sample(s)%dim
      call read_mesh_text(text, merge('a.inp', 'a.msh', form == 6), part%dim, 1.0_wp, part%mesh, &
        & fault)
      if (allocated(fault)) cycle
      call mesh_points(part%mesh, part%dim, 1, 1.0_wp, x, volume, part%element, fault)
      if (allocated(fault)) cycle
      call expect_true(error, all(volume > 0.0_wp), 'a volume that is none is accepted')
      part%n_points = size(volume)
      call find_faces(part, fault)
      if (allocated(fault)) cycle
      k = count_pieces(part) + count_twins(part, minval(volume)**(1.0_wp/part%dim))
      call points_named(part, 'BLOCK', chosen, fault)
      call facets_named(part, 'LEFT', facets, fault)
      accepted = accepted + 1
    end do
    ! digits of coordinates may well change; most files remain refused
    call expect_true(error, accepted > n/50, 'hardly a mutant gets through to the end')
  end subroutine mutate

end module test_body_mesh_read
