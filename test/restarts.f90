!> What tests of restarts have in common: scenes, runs in pieces of one step, and comparisons of
!> whole folders of results, bit for bit.
module restarts
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_error, only: fault_type => error_type, status_interrupted
  use pd_base_kinds, only: wp, i1, i8
  use pd_driver, only: run_scene
  use pd_output_report_begin, only: run_options_type
  use pd_output_results_blocks, only: read_block
  use pd_output_results_datasets, only: get_shape, read_rows
  use pd_output_results_files, only: file_bytes, file_exists
  use pd_output_results_hdf5, only: close_file, get_attribute, hdf5_file, open_file
  use pd_scene_content_types, only: scene_type, unset
  use testdrive, only: check, error_type, test_failed
  use bodies, only: box_scene, expect_true, youngs_modulus
  implicit none (type, external)
  private
  public :: plate, slow_plate, run, run_in_pieces, accept, read_bytes
  public :: expect_same_file, expect_same_results, expect_broken
  public :: here, spacing

  !> The folder of all runs. Suites may run at the same time: the names of a suite's runs begin with
  !> a folder of its own.
  character(*), parameter :: here = 'build/test_restarts'
  real(wp), parameter :: spacing = 1.0e-3_wp
  character(*), parameter :: fields(3) = [character(12) :: 'displacement', 'velocity', 'damage']

contains

  !> A notched plate whose halves fly apart: 30 steps in which the crack grows. A load acts on all
  !> points, those whose motion is imposed, too.
  subroutine plate(scene)
    type(scene_type), intent(out) :: scene

    call box_scene([12, 12], spacing, 0.3_wp, scene)
    scene%file = 'plate.nml'
    deallocate (scene%cracks, scene%boundaries, scene%probes, scene%regions, scene%loads, &
      & scene%output%fields)
    allocate (scene%cracks(1), scene%boundaries(3), scene%probes(1), scene%regions(2), &
      & scene%loads(1))
    scene%regions(1)%name = 'all'
    scene%regions%shape = 'box'
    scene%regions(1)%lower(1) = -1.0_wp
    scene%regions(2)%name = 'corner'
    scene%regions(2)%upper(:2) = 2*spacing
    scene%loads(1)%region = 'all'
    scene%loads(1)%body_force(:2) = 1.0e8_wp
    scene%boundaries(3)%name = 'pin'
    scene%boundaries(3)%region = 'corner'
    scene%boundaries(3)%displacement(1) = 0.0_wp
    scene%cracks(1)%from(:2) = [-1.0_wp, 6.0_wp]*spacing
    scene%cracks(1)%to(:2) = [4.0_wp, 6.0_wp]*spacing
    scene%materials(1)%critical_stretch = 0.01_wp
    scene%horizon%surface_correction = 'energy'
    scene%boundaries(1)%name = 'bottom'
    scene%boundaries(1)%side = 'y_min'
    scene%boundaries(1)%velocity(2) = -40.0_wp
    scene%boundaries(2)%name = 'top'
    scene%boundaries(2)%side = 'y_max'
    scene%boundaries(2)%velocity(2) = 40.0_wp
    scene%probes(1)%name = 'corner'
    scene%probes(1)%point(:2) = 0.0_wp
    scene%probes(1)%fields = [character(64) :: 'velocity', 'dilatation']
    scene%probes(1)%interpolate = .true.
    deallocate (scene%sections, scene%lines)
    allocate (scene%sections(1), scene%lines(1))
    scene%sections(1)%name = 'cut'
    scene%sections(1)%point = [6.0_wp, 6.0_wp, 0.0_wp]*spacing
    scene%sections(1)%normal = [0.2_wp, 1.0_wp, 0.0_wp]
    scene%lines(1)%name = 'across'
    scene%lines(1)%from = [3.0_wp, 0.0_wp, 0.0_wp]*spacing
    scene%lines(1)%to = [3.0_wp, 12.0_wp, 0.0_wp]*spacing
    scene%lines(1)%points = 7
    scene%lines(1)%fields = [character(64) :: 'displacement', 'damage']
    scene%time%steps = 30
    scene%output%every = 7
    scene%output%history_every = 4
    scene%output%fields = [character(64) :: fields]
    scene%output%format = 'both'
  end subroutine plate

  !> A small plate with a notch, drawn apart in load steps.
  subroutine slow_plate(scene)
    type(scene_type), intent(out) :: scene
    integer :: i

    call plate(scene)
    scene%bodies(1)%upper(:2) = 6*spacing
    scene%bodies(1)%points(:2) = 6
    scene%cracks(1)%from(2) = 3*spacing
    scene%cracks(1)%to(:2) = [2.0_wp, 3.0_wp]*spacing
    scene%time%method = 'relaxation'
    scene%relaxation%load_steps = 1
    scene%relaxation%growth = 'load_steps'
    scene%relaxation%tolerance = 0.1_wp
    scene%output%every = 1
    scene%output%history_every = 5
    do i = 1, 2
      scene%boundaries(i)%displacement(2) = merge(-1, 1, i == 1)*0.08_wp*spacing
      scene%boundaries(i)%velocity = unset
    end do
  end subroutine slow_plate

  !> Run a scene into a folder of its own.
  subroutine run(scene, folder, fault, restart, minutes, threads, checkpoint)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: folder
    type(fault_type), allocatable, intent(out) :: fault
    logical, intent(in), optional :: restart
    real(wp), intent(in), optional :: minutes
    integer, intent(in), optional :: threads
    character(*), intent(in), optional :: checkpoint
    type(run_options_type) :: options
    integer :: before

    options%output_directory = here//'/'//folder
    options%quiet = .true.
    options%threads = 1
    if (present(restart)) options%restart = restart
    options%overwrite = .not. options%restart
    if (present(minutes)) options%max_minutes = minutes
    if (present(threads)) options%threads = threads
    if (present(checkpoint)) options%checkpoint = checkpoint
    options%restart_command = 'perifort run plate.nml --restart'
    before = omp_get_max_threads()
    call run_scene(scene, options, fault)
    call omp_set_num_threads(before)
  end subroutine run

  !> Run a scene in pieces; `pieces` counts them. The first ones are of one step or iteration each,
  !> later ones of some milliseconds, so that they end anywhere: long runs would take long.
  subroutine run_in_pieces(scene, folder, threads, pieces, error)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: folder
    integer, intent(in) :: threads
    integer, intent(out) :: pieces
    type(error_type), allocatable, intent(inout) :: error
    integer, parameter :: most = 2000, short = 120
    real(wp), parameter :: none = 1.0e-12_wp, some = 1.0e-3_wp  ! [min]
    type(fault_type), allocatable :: fault

    do pieces = 1, most
      call run(scene, folder, fault, restart=pieces > 1, minutes=merge(none, some, &
        & pieces <= short), threads=threads)
      if (.not. allocated(fault)) return
      if (fault%status == status_interrupted) cycle
      call test_failed(error, fault%message)
      return
    end do
    call test_failed(error, 'the run does not come to its end')
  end subroutine run_in_pieces

  subroutine accept(error, fault)
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable, intent(in) :: fault
    if (allocated(error) .or. .not. allocated(fault)) return
    call test_failed(error, 'refused: '//fault%message)
  end subroutine accept

  !> The contents of a file.
  subroutine read_bytes(path, bytes)
    character(*), intent(in) :: path
    integer(i1), allocatable, intent(out) :: bytes(:)
    integer :: unit
    allocate (bytes(max(0_i8, file_bytes(path))))
    if (size(bytes) == 0) return
    open (newunit=unit, file=path, access='stream', form='unformatted', action='read')
    read (unit) bytes
    close (unit)
  end subroutine read_bytes

  !> Fail unless two files have the same bytes.
  subroutine expect_same_file(error, first, second)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: first, second
    integer(i1), allocatable :: a(:), b(:)

    if (allocated(error)) return
    call read_bytes(first, a)
    call read_bytes(second, b)
    call check(error, size(a) > 0 .and. size(b) == size(a), 'sizes of '//first//' and '//second)
    if (allocated(error)) return
    call check(error, all(a == b), first//' and '//second//' differ')
  end subroutine expect_same_file

  !> Fail unless two folders hold the same results: all fields of all outputs, in both formats, and
  !> the history.
  subroutine expect_same_results(error, first, second, outputs)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: first, second
    integer, intent(in) :: outputs
    character(4) :: number
    integer :: i

    call expect_same_file(error, here//'/'//first//'/history.csv', here//'/'//second// &
      & '/history.csv')
    call expect_same_file(error, here//'/'//first//'/across.csv', here//'/'//second//'/across.csv')
    call expect_same_file(error, here//'/'//first//'/plate.pvd', here//'/'//second//'/plate.pvd')
    call expect_same_file(error, here//'/'//first//'/plate.xdmf', here//'/'//second//'/plate.xdmf')
    do i = 0, outputs - 1
      write (number, '(i4.4)') i
      call expect_same_file(error, here//'/'//first//'/plate_00'//number//'.vtu', &
        & here//'/'//second//'/plate_00'//number//'.vtu')
    end do
    write (number, '(i4.4)') outputs
    call expect_true(error, .not. file_exists(here//'/'//second//'/plate_00'//number//'.vtu'), &
      & 'there is an output too many')
    call expect_true(error, .not. file_exists(here//'/'//second//'/plate.unfinished'), &
      & 'the results are marked as unfinished')
    call expect_same_hdf5(error, first, second, outputs)
  end subroutine expect_same_results

  !> The same of the HDF5 files, whose values are compared as bits.
  subroutine expect_same_hdf5(error, first, second, outputs)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: first, second
    integer, intent(in) :: outputs
    real(wp), allocatable :: a(:), b(:)
    integer :: i

    do i = 1, size(fields)
      if (allocated(error)) return
      call values_of(first, trim(fields(i)), outputs, a, error)
      call values_of(second, trim(fields(i)), outputs, b, error)
      if (allocated(error)) return
      call expect_true(error, size(a) == size(b) .and. size(a) > 0, 'sizes of '//fields(i))
      if (allocated(error)) return
      call expect_true(error, all(transfer(a, 0_i8, size(a)) == transfer(b, 0_i8, size(b))), &
        & trim(fields(i))//' differs')
    end do
    call profiles_of(first, outputs, a, error)
    call profiles_of(second, outputs, b, error)
    if (allocated(error)) return
    call expect_true(error, all(transfer(a, 0_i8, size(a)) == transfer(b, 0_i8, size(b))), &
      & 'the profiles of a line differ')
  end subroutine expect_same_hdf5

  !> The displacements along the line in all outputs.
  subroutine profiles_of(folder, outputs, values, error)
    character(*), intent(in) :: folder
    integer, intent(in) :: outputs
    real(wp), allocatable, intent(out) :: values(:)
    type(error_type), allocatable, intent(inout) :: error
    type(hdf5_file) :: file
    type(fault_type), allocatable :: fault, late
    real(wp), allocatable :: block(:, :)
    integer(i8) :: rows
    integer :: o, dim

    allocate (values(0))
    if (allocated(error)) return
    call open_file(here//'/'//folder//'/plate.vtkhdf', .false., file, fault)
    if (.not. allocated(fault)) call get_shape(file, '/lines/across/position', dim, rows, fault)
    allocate (block(dim, 7))
    do o = 0, outputs - 1
      if (.not. allocated(fault)) call read_block(file, '/lines/across/displacement', int(o, i8), &
        & block, fault)
      values = [values, block]
    end do
    call close_file(file, late)
    call accept(error, fault)
  end subroutine profiles_of

  !> Times, rows and a field of all outputs in one line of numbers.
  subroutine values_of(folder, field, outputs, values, error)
    character(*), intent(in) :: folder, field
    integer, intent(in) :: outputs
    real(wp), allocatable, intent(out) :: values(:)
    type(error_type), allocatable, intent(inout) :: error
    type(hdf5_file) :: file
    type(fault_type), allocatable :: fault, late
    real(wp), allocatable :: times(:), energy(:), table(:, :), line(:)
    integer(i8) :: steps, rows
    integer(i8), allocatable :: points(:)

    allocate (values(0))
    call open_file(here//'/'//folder//'/plate.vtkhdf', .false., file, fault)
    if (.not. allocated(fault)) call get_attribute(file, '/VTKHDF/Steps', 'NSteps', steps, fault)
    if (.not. allocated(fault)) call get_attribute(file, '/history', 'rows', rows, fault)
    if (.not. allocated(fault)) then
      call check(error, int(steps), outputs, 'outputs of '//folder)
      allocate (times(steps), energy(rows), points(1))
      call read_rows(file, '/VTKHDF/NumberOfPoints', 0_i8, points, fault)
    end if
    if (.not. allocated(fault)) call read_rows(file, '/VTKHDF/Steps/Values', 0_i8, times, fault)
    if (.not. allocated(fault)) call read_rows(file, '/history/strain_energy', 0_i8, energy, fault)
    if (.not. allocated(fault)) then
      if (field == 'damage') then
        allocate (line(steps*points(1)))
        call read_rows(file, '/VTKHDF/PointData/'//field, 0_i8, line, fault)
      else
        allocate (table(3, steps*points(1)))
        call read_rows(file, '/VTKHDF/PointData/'//field, 0_i8, table, fault)
        line = [table]
      end if
    end if
    if (.not. allocated(fault)) values = [times, energy, line]
    call close_file(file, late)
    call accept(error, fault)
  end subroutine values_of

  !> The number of broken bonds at the end must not be 0: else nothing was tested.
  subroutine expect_broken(error, folder)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: folder
    real(wp), allocatable :: values(:)
    type(hdf5_file) :: file
    type(fault_type), allocatable :: fault
    integer(i8) :: rows

    if (allocated(error)) return
    call open_file(here//'/'//folder//'/plate.vtkhdf', .false., file, fault)
    if (.not. allocated(fault)) call get_attribute(file, '/history', 'rows', rows, fault)
    if (.not. allocated(fault)) then
      allocate (values(rows))
      call read_rows(file, '/history/broken_bonds', 0_i8, values, fault)
      call expect_true(error, values(rows) > values(1), 'no bond breaks on the way')
    end if
    call accept(error, fault)
    call close_file(file, fault)
  end subroutine expect_broken

end module restarts
