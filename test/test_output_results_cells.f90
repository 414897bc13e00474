!> The cells of results: every shape of elements, and values of nodes and cells from those of
!> points.
!> VTK's own view of them is checked by app/python/tests/test_cells.py.
module test_output_results_cells
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type
  use pd_body_generate, only: generate_body
  use pd_body_mesh_elements, only: n_shapes, shape_numbered, shape_type
  use pd_driver, only: run_scene
  use pd_output_report_begin, only: run_options_type
  use pd_output_results_cells, only: at_nodes, cells_of, cells_type, of_cells, vtk_nodes, &
    & vtk_type, &
    & xdmf_type
  use pd_output_results_datasets, only: get_shape, read_rows
  use pd_output_results_hdf5, only: close_file, hdf5_file, open_file
  use pd_output_results_types, only: nodes_linear, nodes_mean, nodes_nearest
  use pd_scene_content_types, only: scene_type
  use bodies, only: expect_true
  use comparisons, only: expect_close
  use meshes, only: block_sample, gmsh_text, number_text, sample_type
  use test_scene_expect, only: expect_fault, expect_scene, line
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_output_results_cells

  character(*), parameter :: here = 'build/test_output_results_cells'
  character(*), parameter :: rest = '&material youngs_modulus = 1e9 poissons_ratio = 0.25 '// &
    & 'density = 1000 /'//line//'&time steps = 2 /'//line

contains

  subroutine collect_output_results_cells(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('each node of an element once', test_orders), &
      & new_unittest('linear fields on every shape of elements', test_linear), &
      & new_unittest('a file of a run', test_file), &
      & new_unittest('what has no cells', test_refused)]
  end subroutine collect_output_results_cells

  !> VTK has each node once, the corners first; kinds differ.
  subroutine test_orders(error)
    type(error_type), allocatable, intent(out) :: error
    type(shape_type) :: shape
    integer, allocatable :: nodes(:)
    integer :: s, n, kinds(2, n_shapes)

    do s = 1, n_shapes
      shape = shape_numbered(s)
      nodes = vtk_nodes(shape)
      call expect_true(error, size(nodes) == shape%nodes .and. all([(any(nodes == n), n=1, &
        & shape%nodes)]), 'nodes of a '//shape%name)
      call expect_true(error, all(nodes(:shape%corners) == [(n, n=1, shape%corners)]), &
        & 'corners of a '//shape%name)
      kinds(:, s) = [int(vtk_type(shape)), int(xdmf_type(shape))]
      call expect_true(error, all(kinds(1, :s - 1) /= kinds(1, s)) .and. &
        & all(kinds(2, :s - 1) /= kinds(2, s)), 'the kind of a '//shape%name)
    end do
  end subroutine test_orders

  !> A scene with a block of elements of a shape.
  subroutine block_scene(error, number, keys, scene)
    type(error_type), allocatable, intent(inout) :: error
    integer, intent(in) :: number
    character(*), intent(in) :: keys
    type(scene_type), intent(out) :: scene
    type(sample_type) :: sample
    type(shape_type) :: shape
    integer :: unit

    shape = shape_numbered(number)
    call block_sample(number, [4, 3, 3], [4.0_wp, 3.0_wp, 3.3_wp], sample)
    open (newunit=unit, file='build/cells.msh', access='stream', form='unformatted', &
      & status='replace')
    write (unit) gmsh_text(sample, 4, .true., .false.)
    close (unit)
    call expect_scene(error, '&scene dimension = '//number_text(shape%dim)//' /'//line// &
      & "&body mesh = 'build/cells.msh' /"//line//rest//'&output cells = .true. '//keys//' '// &
      & '/'//line, &
      & scene)
  end subroutine block_scene

  !> Nodes have the values of a linear field, means of it are those of the centres, and numbers stay
  !> whole.
  subroutine test_linear(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(body_type) :: body
    type(cells_type) :: cells
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: x(:, :), values(:), expected(:)
    real(wp), parameter :: slope(3) = [0.3_wp, -0.7_wp, 1.1_wp]
    real(wp) :: delta
    integer :: s, d, k

    do s = 2, n_shapes
      call block_scene(error, s, '', scene)
      if (allocated(error)) return
      call generate_body(scene, body, delta, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      d = body%dim
      allocate (x(body%n_points, 3), source=0.0_wp)
      x(:, :d) = body%x
      call cells_of(body%parts, x, body%volume, cells)
      values = 2.5_wp + matmul(x, slope)
      expected = 2.5_wp + matmul(cells%nodes, slope)
      call expect_true(error, cells%n_cells() == body%n_points .and. cells%n_nodes() > &
        & body%dim*3_i8, 'cells of shape '//to_text(s))
      call expect_close(error, at_nodes(cells, nodes_linear, values), expected, 1.0e-12_wp, &
        & 'a linear field at nodes, shape '//to_text(s))
      call expect_close(error, of_cells(cells, nodes_mean, values), values, 0.0_wp, &
        & 'values of cells, shape '//to_text(s))
      ! means of a constant, and of nothing outside of the points' values
      call expect_close(error, at_nodes(cells, nodes_mean, 0*values + 7), 7.0_wp, 1.0e-13_wp, &
        & 'a constant')
      expected = at_nodes(cells, nodes_nearest, [(real(k, wp), k=1, body%n_points)])
      call expect_close(error, expected, anint(expected), 0.0_wp, 'numbers at nodes')
      do k = 1, size(cells%types)
        associate (own => cells%connectivity(cells%offsets(k) + 1:cells%offsets(k + 1)))
          call expect_true(error, minval(own) >= body%n_points .and. maxval(own) < body%n_points &
            & + cells%n_nodes(), 'nodes of a cell')
        end associate
      end do
      deallocate (x)
    end do
  end subroutine test_linear

  !> The file of a run counts what it holds, and its displacements at nodes are linear.
  subroutine test_file(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(fault_type), allocatable :: fault
    type(hdf5_file) :: file
    real(wp), allocatable :: x(:, :), u(:, :)
    integer(i8) :: rows, points, cells
    integer :: components, precision

    do precision = 1, 2
      call block_scene(error, 13, "fields = 'displacement', 'stress' every = 1 precision = '"// &
        & trim(merge('double', 'single', precision == 1))//"'", scene)
      if (allocated(error)) return
      deallocate (scene%initial)
      allocate (scene%initial(1))
      scene%initial(1)%displacement_gradient(1, 2) = 1.0e-3_wp
      scene%file = 'cells.nml'
      options%output_directory = here
      options%overwrite = .true.
      options%quiet = .true.
      call run_scene(scene, options, fault)
      if (.not. allocated(fault)) call open_file(here//'/cells.vtkhdf', .false., file, fault)
      if (.not. allocated(fault)) call get_shape(file, '/points/volume', components, points, fault)
      if (.not. allocated(fault)) call get_shape(file, '/VTKHDF/Points', components, rows, fault)
      if (.not. allocated(fault)) call get_shape(file, '/VTKHDF/Types', components, cells, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      call expect_true(error, cells == points .and. rows - points == 9*7*7, 'counts in a file')
      allocate (x(3, rows), u(3, rows))
      call read_rows(file, '/VTKHDF/Points', 0_i8, x, fault)
      call read_rows(file, '/VTKHDF/PointData/displacement', 0_i8, u, fault)
      call expect_close(error, u(1, :), 1.0e-3_wp*x(2, :), merge(1.0e-15_wp, 1.0e-9_wp, &
        & precision == 1), 'displacement of points and nodes')
      call get_shape(file, '/VTKHDF/CellData/stress', components, rows, fault)
      call expect_true(error, components == 6 .and. rows == 3*cells, 'stress of cells')
      call close_file(file, fault)
      deallocate (x, u)
    end do
  end subroutine test_file

  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call expect_fault(error, '&scene dimension = 1 /'//line//rest//'&body lower = 0 upper = 1 '// &
      & 'points = 9 /'//line//'&output cells = .true. /'//line, "'cells' without a mesh|a/b.nml:5")
    call block_scene(error, 6, '', scene)
    call expect_fault(error, '&scene dimension = 2 /'//line//rest//"&body mesh = "// &
      & "'build/cells.msh' /" &
      & //line//"&output cells = .true. format = 'vtu' /"//line, "'vtu' has no cells|a/b.nml:5")
  end subroutine test_refused

end module test_output_results_cells
