!> Values between points: what linear and quadratic fields say, at surfaces and beside cracks too;
!> and what runs make of them: probes and lines.
module test_output_fields_between
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i8
  use pd_driver, only: run_scene
  use pd_motion_system, only: system_type
  use pd_output_fields_between, only: find_spots, spots_type, values_at_spots
  use pd_output_fields_field, only: moment_type
  use pd_output_fields_table, only: all_fields, field_table_type
  use pd_output_measures_probe, only: nearest_slot
  use pd_output_report_begin, only: run_options_type
  use pd_output_results_answer, only: answer_type
  use pd_output_results_blocks, only: read_block
  use pd_output_results_datasets, only: read_rows
  use pd_output_results_files, only: make_directory
  use pd_output_results_hdf5, only: close_file, get_attribute, hdf5_file, open_file
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: set_up_type
  use bodies, only: box_scene, expect_true, ready_alone
  use comparisons, only: expect_close
  use test_scene_expect, only: expect_fault, expect_parts, good_head, line
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_output_fields_between

  character(*), parameter :: here = 'build/test_between'
  real(wp), parameter :: h = 1.0e-2_wp
  real(wp), parameter :: gradient(3, 3) = reshape([0.03_wp, -0.02_wp, 0.01_wp, 0.05_wp, -0.01_wp, &
    & 0.02_wp, -0.015_wp, 0.04_wp, 0.025_wp], [3, 3])

contains

  subroutine collect_output_fields_between(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a linear field is exact, at surfaces and corners too', test_linear), &
      & new_unittest('a quadratic field is exact', test_quadratic), &
      & new_unittest('nothing is taken from behind a crack', test_crack), &
      & new_unittest('outside of the bodies the nearest point counts', test_outside), &
      & new_unittest('a run with an interpolated probe', test_probe), &
      & new_unittest('a run with lines: both files say the same', test_lines), &
      & new_unittest('lines of a series of .vtu files', test_series), &
      & new_unittest('lines that cannot be had', test_wrong)]
  end subroutine collect_output_fields_between

  !> A box in `dim` dimensions.
  subroutine box(dim, set_up, error)
    integer, intent(in) :: dim
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene
    integer, parameter :: points(3) = [9, 8, 7]

    call box_scene(points(:dim), h, 0.25_wp, scene)
    call ready_alone(scene, set_up, error)
  end subroutine box

  !> The displacement at a position.
  subroutine displacement_at(system, position, values)
    type(system_type), target, intent(in) :: system
    real(wp), intent(in) :: position(:)
    real(wp), allocatable, intent(out) :: values(:)
    type(field_table_type) :: table
    type(spots_type) :: spots
    type(moment_type) :: now
    real(wp), allocatable :: all(:, :)
    real(wp) :: place(3)

    table = all_fields()
    now%system => system
    now%v => system%state%v
    place = 0.0_wp
    place(:size(position)) = position
    call find_spots(system, [int(nearest_slot(system%body, place))], [.true.], &
      & reshape(position, [1, size(position)]), spots)
    allocate (all(size(position), 1))
    call values_at_spots(table%field('displacement'), now, spots, all)
    values = all(:, 1)
  end subroutine displacement_at

  !> Positions of the box in units of the spacing: inside, on faces, edges and corners.
  subroutine test_linear(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type), target :: set_up
    real(wp), parameter :: positions(3, 6) = reshape([4.3_wp, 4.6_wp, 3.2_wp, 0.0_wp, 3.9_wp, &
      & 3.1_wp, 9.0_wp, 8.0_wp, 7.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 4.0_wp, 8.0_wp, 0.0_wp, 2.5_wp, &
      & 2.5_wp, 2.5_wp], [3, 6])
    real(wp), allocatable :: values(:)
    integer :: dim, i, k

    do dim = 1, 3
      call box(dim, set_up, error)
      if (allocated(error)) return
      associate (system => set_up%system)
        do k = 1, system%body%n_slots
          if (system%body%point(k) > 0) system%state%u(k, :) = 0.2_wp &
            & + matmul(gradient(:dim, :dim), system%body%x(k, :))
        end do
      end associate
      do i = 1, size(positions, 2)
        call displacement_at(set_up%system, positions(:dim, i)*h, values)
        ! normal equations beyond the outermost points lose some digits
        call expect_close(error, values, 0.2_wp + matmul(gradient(:dim, :dim), &
          & positions(:dim, i)*h), 1.0e-10_wp, 'displacement')
      end do
    end do
  end subroutine test_linear

  subroutine test_quadratic(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type), target :: set_up
    real(wp), allocatable :: values(:)
    real(wp) :: x(2)
    integer :: i, k

    call box(2, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      do k = 1, system%body%n_slots
        if (system%body%point(k) > 0) system%state%u(k, :) = curved(system%body%x(k, :))
      end do
    end associate
    do i = 0, 30
      x = [0.3_wp*i, 8 - 0.2_wp*i]*h
      call displacement_at(set_up%system, x, values)
      call expect_close(error, values, curved(x), 1.0e-11_wp, 'displacement')
    end do

  contains

    pure function curved(x) result(u)
      real(wp), intent(in) :: x(:)
      real(wp) :: u(2)
      u = [1 + x(1) - 30*x(1)*x(2) + 20*x(2)**2, x(2) + 50*x(1)**2]
    end function curved
  end subroutine test_quadratic

  !> Two halves, one of which has moved away: beside the crack each has its own displacement.
  subroutine test_crack(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type), target :: set_up
    real(wp), allocatable :: values(:)
    integer :: i, k

    call box_scene([12, 10], h, 0.25_wp, scene)
    deallocate (scene%cracks)
    allocate (scene%cracks(1))
    scene%cracks(1)%from(:2) = [-1.0_wp, 5.0_wp]*h
    scene%cracks(1)%to(:2) = [20.0_wp, 5.0_wp]*h
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      do k = 1, system%body%n_slots
        if (system%body%point(k) == 0) cycle
        system%state%u(k, :) = system%body%x(k, 1)*0.01_wp
        if (system%body%x(k, 2) > 5*h) system%state%u(k, :) = system%state%u(k, :) + 1
      end do
    end associate
    do i = 0, 12
      call displacement_at(set_up%system, [real(i, wp), 4.9_wp]*h, values)
      call expect_close(error, values, i*h*0.01_wp, 1.0e-12_wp, 'below')
      call displacement_at(set_up%system, [real(i, wp), 5.1_wp]*h, values)
      call expect_close(error, values, 1 + i*h*0.01_wp, 1.0e-12_wp, 'above')
    end do
  end subroutine test_crack

  subroutine test_outside(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type), target :: set_up
    real(wp), allocatable :: values(:)
    integer :: k

    call box(2, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      do k = 1, system%body%n_slots
        if (system%body%point(k) > 0) system%state%u(k, :) = system%body%x(k, :)
      end do
    end associate
    call displacement_at(set_up%system, [-1.0_wp, 4.5_wp]*h, values)
    call expect_close(error, values, [0.5_wp, 4.5_wp]*h, 1.0e-14_wp, 'the nearest point')
  end subroutine test_outside

  !> A bar of 20 cells that is pulled: with a surface correction that makes it uniform from two
  !> horizons on, displacements grow linearly in its middle.
  function bar(more) result(text)
    character(*), intent(in) :: more
    character(:), allocatable :: text
    text = '&scene dimension = 1 area = 1e-4 /'//line// &
      & "&material youngs_modulus = 2e11 density = 8e3 /"//line// &
      & "&body name = 'bar' lower = 0 upper = 0.6 points = 60 /"//line// &
      & "&boundary side = 'x_min' displacement_x = 0 /"//line// &
      & "&load side = 'x_max' pressure = -2e8 /"//line// &
      & "&time method = 'relaxation' /"//line//'&relaxation tolerance = 1e-11 load_steps = 3 /'// &
      & line//more
  end function bar

  !> Run a scene into a folder, and read its answer.
  subroutine run(error, text, folder, answer)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text, folder
    type(answer_type), intent(out) :: answer
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(fault_type), allocatable :: fault
    integer :: before

    if (allocated(error)) return
    call make_directory(here, fault)
    call read_scene_text(text, here//'/a.nml', scene, fault)
    options%output_directory = here//'/'//folder
    options%overwrite = .true.
    options%quiet = .true.
    options%threads = 1
    before = omp_get_max_threads()
    if (.not. allocated(fault)) call run_scene(scene, options, fault, answer=answer)
    call omp_set_num_threads(before)
    if (allocated(fault)) call test_failed(error, 'refused: '//fault%message)
  end subroutine run

  !> In the middle du/dx = 1e-3; halfway between two points the displacement is their mean.
  subroutine test_probe(error)
    type(error_type), allocatable, intent(out) :: error
    type(answer_type) :: answer

    call run(error, bar("&output fields = 'displacement' /"//line// &
      & "&probe name = 'left' point = 0.295 /"//line//"&probe name = 'right' point = 0.305 /"// &
      & line//"&probe name = 'between' point = 0.3 interpolate = .true. "// &
      & "fields = 'displacement', 'strain' /"//line// &
      & "&probe name = 'same' point = 0.305 interpolate = .true. /"//line// &
      & "&probe name = 'off' point = 0.3025 interpolate = .true. /"//line), 'probe', answer)
    if (allocated(error)) return
    associate (u => answer%history)
      call expect_true(error, all(u(2:, answer%column_number('between_strain_xx')) > 0.0_wp), &
        & 'the bar is pulled')
      call expect_close(error, u(:, answer%column_number('between_displacement_x')), &
        & (u(:, answer%column_number('left_displacement_x')) &
        & + u(:, answer%column_number('right_displacement_x')))/2, 1.0e-11_wp, 'between')
      call expect_close(error, u(:, answer%column_number('same_displacement_x')), &
        & u(:, answer%column_number('right_displacement_x')), 0.0_wp, 'at a point')
      call expect_close(error, u(:, answer%column_number('off_displacement_x')), &
        & 0.25_wp*u(:, answer%column_number('left_displacement_x')) &
        & + 0.75_wp*u(:, answer%column_number('right_displacement_x')), 1.0e-11_wp, 'off')
    end associate
  end subroutine test_probe

  !> A plate with a hole that is pulled, with a line through the hole.
  function plate(form) result(text)
    character(*), intent(in) :: form
    character(:), allocatable :: text
    text = '&scene dimension = 2 thickness = 0.01 /'//line// &
      & "&material youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.3 /"//line// &
      & "&body name = 'plate' lower = 0, 0 upper = 0.2, 0.1 points = 20, 10 /"//line// &
      & "&remove shape = 'cylinder' centre = 0.1, 0.05 radius = 0.03 /"//line// &
      & "&boundary side = 'x_min' displacement_x = 0 displacement_y = 0 /"//line// &
      & "&load side = 'x_max' pressure = -2e8 /"//line// &
      & "&time method = 'relaxation' /"//line//'&relaxation load_steps = 3 /'//line// &
      & "&output every = 1 fields = 'displacement' format = '"//form//"' /"//line// &
      & "&line name = 'axis' from = 0, 0.05 to = 0.2, 0.05 points = 41 "// &
      & "fields = 'displacement', 'von_mises', 'stress' /"//line// &
      & "&line name = 'edge' from = 0.02, 0 to = 0.02, 0.1 points = 3 /"//line
  end function plate

  !> A table of a line; what is wrong with it fails the test.
  subroutine read_line(error, path, table)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: path
    real(wp), allocatable, intent(out) :: table(:, :)   !! (column, row)
    integer :: unit, status, columns, rows, i
    character(2000) :: text

    allocate (table(0, 0))
    if (allocated(error)) return
    open (newunit=unit, file=path, action='read', iostat=status)
    if (status /= 0) then
      call test_failed(error, 'there is no '//path)
      return
    end if
    read (unit, '(a)') text
    columns = count([(text(i:i) == ',', i=1, len_trim(text))]) + 1
    rows = 0
    do
      read (unit, '(a)', iostat=status) text
      if (status /= 0) exit
      rows = rows + 1
    end do
    rewind (unit)
    deallocate (table)
    allocate (table(columns, rows))
    read (unit, '(a)') text
    read (unit, *) table
    close (unit)
  end subroutine read_line

  subroutine test_lines(error)
    type(error_type), allocatable, intent(out) :: error
    type(answer_type) :: answer
    type(hdf5_file) :: file
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: table(:, :), positions(:, :), u(:, :), mises(:, :), stress(:, :)
    real(wp), allocatable :: times(:)
    integer(i8) :: outputs
    integer :: o, p, row

    call run(error, plate('vtkhdf'), 'lines', answer)
    call read_line(error, here//'/lines/axis.csv', table)
    if (allocated(error)) return
    call open_file(here//'/lines/a.vtkhdf', .false., file, fault)
    call get_attribute(file, '/VTKHDF/Steps', 'NSteps', outputs, fault)
    allocate (positions(2, 41), u(2, 41), mises(1, 41), stress(4, 41), times(outputs))
    call read_rows(file, '/lines/axis/position', 0_i8, positions, fault)
    if (.not. allocated(fault)) call read_rows(file, '/VTKHDF/Steps/Values', 0_i8, times, fault)
    call expect_true(error, all(shape(table) == [12, 41*int(outputs)]) .and. outputs == 4_i8, &
      & 'rows and columns of the table')
    if (allocated(error)) return
    do o = 0, int(outputs) - 1
      if (.not. allocated(fault)) call read_block(file, '/lines/axis/displacement', int(o, i8), u, &
        & fault)
      if (.not. allocated(fault)) call read_block(file, '/lines/axis/von_mises', int(o, i8), &
        & mises, fault)
      if (.not. allocated(fault)) call read_block(file, '/lines/axis/stress', int(o, i8), stress, &
        & fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      do p = 1, 41
        row = 41*o + p
        call expect_close(error, table(:5, row), [real(o, wp), times(o + 1), positions(:, p), &
          & 0.005_wp*(p - 1)], 1.0e-12_wp, 'places')
        call expect_true(error, ieee_is_nan(u(1, p)) .or. &
          & abs(positions(1, p) - 0.1_wp) > 0.019_wp, 'a value in the hole')
        if (ieee_is_nan(u(1, p))) then
          call expect_true(error, all(ieee_is_nan(table(6:, row))) .and. &
            & abs(positions(1, p) - 0.1_wp) < 0.03_wp, 'no value in the body')
        else
          call expect_close(error, table(6:, row), [u(:, p), mises(:, p), stress(:, p)], &
            & 1.0e-6_wp, 'table and file')
        end if
      end do
    end do
    call close_file(file, fault)
    ! the end is pulled; on the line of symmetry there is no deflection
    call expect_true(error, u(1, 41) > 1.0e-4_wp .and. abs(u(2, 41)) < 1.0e-9_wp, 'the end')
    call read_line(error, here//'/lines/edge.csv', table)
    call expect_true(error, all(shape(table) == [7, 12]), 'the other line')
  end subroutine test_lines

  subroutine test_series(error)
    type(error_type), allocatable, intent(out) :: error
    type(answer_type) :: answer
    real(wp), allocatable :: table(:, :)

    call run(error, plate('vtu'), 'series', answer)
    call read_line(error, here//'/series/edge.csv', table)
    call expect_true(error, all(shape(table) == [7, 12]), 'the table beside a series')
  end subroutine test_series

  subroutine test_wrong(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: steps = '&time steps = 5 /'//line
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(fault_type), allocatable :: fault

    call expect_fault(error, good_head//steps// &
      & "&line name = 'history' from = 0, 0 to = 1, 0 /", "'history' is no name for a line")
    call expect_fault(error, good_head//steps// &
      & "&line name = 'a' from = 1, 0 to = 1, 0 /", "'to' is at 'from'")
    call expect_fault(error, good_head//steps// &
      & "&line name = 'a' from = 1, 0 to = 1, 1 points = 1 /", "'points'")
    call expect_fault(error, good_head//steps// &
      & "&line name = 'a' from = 1, 0 to = 0, 0 /"//line// &
      & "&line name = 'a' from = 1, 0 to = 0.5, 0 /", 'is used by another &line')
    if (allocated(error)) return
    call read_scene_text(good_head//steps// &
      & "&line name = 'a' from = 0, 0 to = 1, 0 fields = 'stres' /", 'a.nml', scene, fault)
    options%files = .false.
    options%quiet = .true.
    if (.not. allocated(fault)) call run_scene(scene, options, fault)
    call expect_parts(error, fault, "'stres'|&line|did you mean 'stress'")
  end subroutine test_wrong

end module test_output_fields_between
