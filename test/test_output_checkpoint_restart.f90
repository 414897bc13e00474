!> Runs that are stopped and go on: their results are those of a run in one piece, bit for bit.
!>
!> With a limit of time that is over at once, a run stops after every step. So these runs are cut
!> wherever they can be.
module test_output_checkpoint_restart
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_error, only: fault_type => error_type, status_input, status_interrupted, &
    & status_no_answer
  use pd_base_kinds, only: wp, i1, i8
  use pd_driver, only: run_scene
  use pd_output_report_begin, only: run_options_type
  use pd_output_results_blocks, only: read_block
  use pd_output_results_datasets, only: get_shape, read_rows
  use pd_output_results_files, only: file_bytes, file_exists, make_directory, remove_file
  use pd_output_results_hdf5, only: close_file, get_attribute, hdf5_file, object_exists, open_file
  use pd_scene_content_types, only: scene_type, tip_group, unset
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  use bodies, only: box_scene, expect_true, youngs_modulus
  implicit none (type, external)
  private
  public :: collect_output_checkpoint_restart

  character(*), parameter :: here = 'build/test_output_checkpoint_restart'
  real(wp), parameter :: spacing = 1.0e-3_wp
  character(*), parameter :: fields(3) = [character(12) :: 'displacement', 'velocity', 'damage']

contains

  subroutine collect_output_checkpoint_restart(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a running crack, cut after every step', test_crack), &
      & new_unittest('a tip and fragments, cut after every step', test_measures), &
      & new_unittest('every integrator, cut after every step', test_integrators), &
      & new_unittest('on two threads', test_two_threads), &
      & new_unittest('a block in 3D', test_block), &
      & new_unittest('long: a law with a history', test_plastic), &
      & new_unittest('a list, bonds that break late', test_list), &
      & new_unittest('temperatures that vary in time', test_heated), &
      & new_unittest('conditions that are expressions of t', test_expressions), &
      & new_unittest('pins in motion and in equilibrium', test_pins), &
      & new_unittest('contact with friction', test_contact), &
      & new_unittest('rigid bodies that spin and are moved', test_rigid), &
      & new_unittest('long: a relaxation with a growing crack', test_relaxation), &
      & new_unittest('long: growth by events is the same in pieces', test_events), &
      & new_unittest('relaxations with a change of method', test_ways_to_rest), &
      & new_unittest('no row of a load step that has not converged', test_no_row), &
      & new_unittest('more iterations are given to a relaxation', test_more_iterations), &
      & new_unittest('results beyond the checkpoint are removed', test_beyond), &
      & new_unittest('a finished run is prolonged', test_longer), &
      & new_unittest('a changed scene is refused', test_changed), &
      & new_unittest('from a damaged checkpoint to the older one', test_damaged), &
      & new_unittest('without a checkpoint from the beginning', test_none), &
      & new_unittest('into another folder with other fields', test_elsewhere), &
      & new_unittest('checkpoints by time, and never', test_minutes), &
      & new_unittest('a run continues after a failed checkpoint', test_failing)]
  end subroutine collect_output_checkpoint_restart

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

  !> Run a scene in pieces of one step; `pieces` counts them.
  subroutine run_in_pieces(scene, folder, threads, pieces, error)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: folder
    integer, intent(in) :: threads
    integer, intent(out) :: pieces
    type(error_type), allocatable, intent(inout) :: error
    integer, parameter :: most = 2000
    type(fault_type), allocatable :: fault

    do pieces = 1, most
      call run(scene, folder, fault, restart=pieces > 1, minutes=1.0e-12_wp, threads=threads)
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

  !> What goes from row to row, and the table beside the results.
  subroutine test_measures(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces

    call plate(scene)
    scene%output%fragments = .true.
    scene%output%history_every = 1
    scene%time%steps = 60
    scene%tips = [tip_group(name='a', from=[0.0_wp, 6*spacing, unset], direction=[1.0_wp, 0.1_wp, &
      & unset])]
    call run(scene, 'whole', fault, threads=2)
    call accept(error, fault)
    call expect_broken(error, 'whole')
    if (allocated(error)) return
    call run_in_pieces(scene, 'pieces', 1, pieces, error)
    call expect_same_results(error, 'whole', 'pieces', 10)
    call expect_same_file(error, here//'/whole/fragments.csv', here//'/pieces/fragments.csv')
    ! rows that are written only because the run stops leave no trace
    scene%output%history_every = 4
    call run(scene, 'whole', fault)
    call accept(error, fault)
    if (allocated(error)) return
    call run_in_pieces(scene, 'pieces', 1, pieces, error)
    call expect_same_results(error, 'whole', 'pieces', 10)
    ! a tip cannot join later
    call run(scene, 'pieces', fault, minutes=1.0e-12_wp)
    scene%tips(1)%threshold = 0.4_wp
    call run(scene, 'pieces', fault, restart=.true.)
    call expect_true(error, allocated(fault), 'another tip goes on')
    if (allocated(error)) return
    call expect_true(error, index(fault%message, '&tip threshold') > 0, fault%message)
  end subroutine test_measures

  subroutine test_crack(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces

    call plate(scene)
    call run(scene, 'whole', fault, threads=2)
    call accept(error, fault)
    call expect_broken(error, 'whole')
    if (allocated(error)) return
    call run_in_pieces(scene, 'pieces', 1, pieces, error)
    if (allocated(error)) return
    call check(error, pieces, scene%time%steps + 1, 'pieces')
    call expect_same_results(error, 'whole', 'pieces', 6)
  end subroutine test_crack

  !> The whole on two threads, pieces on one: the steps of all rules have loops of their own.
  subroutine test_integrators(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: names(4) = [character(16) :: 'velocity_verlet', 'adams_bashforth', &
      & 'adams_moulton', 'runge_kutta']
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: i, pieces

    call plate(scene)
    scene%time%steps = 12
    scene%materials(1)%critical_stretch = 0.003_wp
    do i = 1, size(names)
      if (allocated(error)) return
      scene%time%integrator = names(i)
      call run(scene, 'whole', fault, threads=2)
      call accept(error, fault)
      call expect_broken(error, 'whole')
      if (allocated(error)) return
      call run_in_pieces(scene, 'pieces', 1, pieces, error)
      call expect_same_results(error, 'whole', 'pieces', 3)
    end do
  end subroutine test_integrators

  !> Pieces on two threads, the whole on one; a few steps, since threads that wait for a core make
  !> the start of every piece slow.
  subroutine test_two_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces

    call plate(scene)
    scene%time%steps = 8
    scene%materials(1)%critical_stretch = 0.002_wp
    call run(scene, 'whole', fault)
    call accept(error, fault)
    if (allocated(error)) return
    call run_in_pieces(scene, 'pieces', 2, pieces, error)
    call expect_same_results(error, 'whole', 'pieces', 3)
  end subroutine test_two_threads

  !> A block torn apart, on two threads in one piece and on one in pieces.
  subroutine test_block(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene, block
    type(fault_type), allocatable :: fault
    integer :: pieces

    call plate(scene)
    block = scene
    block%header%dimension = 3
    block%bodies(1)%lower = 0.0_wp
    block%bodies(1)%upper = [6.0_wp, 7.0_wp, 5.0_wp]*spacing
    block%bodies(1)%points = [6, 7, 5]
    deallocate (block%cracks)
    allocate (block%cracks(0))
    block%probes(1)%point = 0.0_wp
    block%materials(1)%critical_stretch = 0.002_wp
    block%time%steps = 9
    call run(block, 'whole', fault, threads=2)
    call accept(error, fault)
    call expect_broken(error, 'whole')
    if (allocated(error)) return
    call run_in_pieces(block, 'pieces', 1, pieces, error)
    call expect_same_results(error, 'whole', 'pieces', 3)
  end subroutine test_block

  !> An elastic-plastic block: explicit, where bonds break after they have flowed; in load steps.
  subroutine test_plastic(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: block
    type(fault_type), allocatable :: fault
    integer :: pieces, way

    do way = 1, 2
      if (allocated(error)) return
      if (way == 1) call plate(block)
      if (way == 2) call slow_plate(block)
      block%header%dimension = 3
      block%bodies(1)%lower = 0.0_wp
      block%bodies(1)%upper = [6.0_wp, 7.0_wp, 4.0_wp]*spacing
      block%bodies(1)%points = [6, 7, 4]
      deallocate (block%cracks)
      allocate (block%cracks(0))
      block%probes(1)%point = 0.0_wp
      associate (material => block%materials(1))
        material%model = 'lps_plastic'
        material%influence = 'linear'
        allocate (material%parameters(2))
        material%parameters%name = ['yield_stress', 'hardening   ']
        material%parameters%value = [1.0e-4_wp, 1.0e-2_wp]*youngs_modulus
        material%critical_stretch = merge(0.002_wp, unset, way == 1)
      end associate
      block%time%steps = 9
      block%relaxation%load_steps = 2
      if (way == 2) block%boundaries(:2)%displacement(2) = &
        & block%boundaries(:2)%displacement(2)/20
      call run(block, 'whole', fault, threads=2)
      call accept(error, fault)
      if (way == 1) call expect_broken(error, 'whole')
      if (allocated(error)) return
      call run_in_pieces(block, 'pieces', 1, pieces, error)
      call expect_same_results(error, 'whole', 'pieces', 3)
    end do
  end subroutine test_plastic

  subroutine test_list(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces

    call plate(scene)
    scene%horizon%family = 'list'
    scene%materials(1)%model = 'bond_based'
    scene%materials(1)%poissons_ratio = 1.0_wp/3.0_wp
    scene%time%breaking = 'after_forces'
    scene%time%steps = 12
    scene%materials(1)%critical_stretch = 0.003_wp
    call run(scene, 'whole', fault)
    call accept(error, fault)
    call expect_broken(error, 'whole')
    if (allocated(error)) return
    call run_in_pieces(scene, 'pieces', 1, pieces, error)
    call expect_same_results(error, 'whole', 'pieces', 3)
  end subroutine test_list

  !> Heat that comes in during the steps, explicit and over load steps.
  subroutine test_heated(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces, i

    do i = 1, 2
      if (allocated(error)) return
      if (i == 1) then
        call plate(scene)
        scene%time%steps = 12
      else
        call slow_plate(scene)
        scene%relaxation%load_steps = 2
      end if
      deallocate (scene%initial)
      allocate (scene%initial(1))
      scene%initial(1)%temperature_change = 100.0_wp
      scene%initial(1)%times = [0.0_wp, merge(1.0e-6_wp, 1.0_wp, i == 1)]
      scene%initial(1)%values = [0.2_wp, 1.0_wp]
      scene%materials(1)%thermal_expansion = 1.0e-5_wp
      call run(scene, 'whole', fault)
      call accept(error, fault)
      if (allocated(error)) return
      call run_in_pieces(scene, 'pieces', 1, pieces, error)
      call expect_same_results(error, 'whole', 'pieces', 3)
    end do
  end subroutine test_heated

  !> Imposed motion, loads and temperatures that are expressions of t, with paths that are summed.
  subroutine test_expressions(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: names(3) = [character(16) :: 'velocity_verlet', 'runge_kutta', '']
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces, i

    do i = 1, 3
      if (allocated(error)) return
      if (i < 3) then
        call plate(scene)
        scene%time%steps = 9
        scene%time%integrator = names(i)
        scene%boundaries(1)%velocity_text(2) = '-40*exp(1e5*t)*(1 + x)'
        scene%boundaries(2)%displacement_text(2) = '40*t*cos(x) + 1e6*t^2'
        scene%loads(1)%body_force_text(1) = '1e8*cos(1e6*t + 1000*y)'
      else
        call slow_plate(scene)
        scene%relaxation%load_steps = 3
        scene%boundaries(1)%velocity_text(2) = '-1e-5*t^2'
        scene%boundaries(2)%displacement_text(2) = '1e-5*t^3'
        scene%loads(1)%body_force_text(1) = '1e6*sin(t + x)'
      end if
      scene%boundaries(1)%velocity(2) = unset
      scene%boundaries(1)%displacement(2) = unset
      scene%boundaries(2)%velocity(2) = unset
      scene%boundaries(2)%displacement(2) = unset
      scene%loads(1)%body_force(1) = unset
      if (allocated(scene%boundaries(1)%times)) deallocate (scene%boundaries(1)%times, &
        & scene%boundaries(1)%values)
      if (allocated(scene%boundaries(2)%times)) deallocate (scene%boundaries(2)%times, &
        & scene%boundaries(2)%values)
      deallocate (scene%initial)
      allocate (scene%initial(1))
      scene%initial(1)%temperature_text = merge('100*sin(1e6*t + 9*x)', '20*t^2 + 10*x       ', &
        & i < 3)
      scene%materials(1)%thermal_expansion = 1.0e-5_wp
      call run(scene, 'whole', fault, threads=2)
      call accept(error, fault)
      if (allocated(error)) return
      call run_in_pieces(scene, 'pieces', 1, pieces, error)
      call expect_true(error, pieces > 2, 'it is not cut')
      call expect_same_results(error, 'whole', 'pieces', merge(3, 4, i < 3))
    end do
  end subroutine test_expressions

  !> Two blocks that graze each other, cut after every step.
  subroutine test_contact(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces

    call plate(scene)
    deallocate (scene%bodies, scene%cracks, scene%boundaries, scene%contacts, scene%initial)
    allocate (scene%bodies(2), scene%cracks(0), scene%boundaries(0), scene%contacts(1), &
      & scene%initial(1))
    scene%bodies%name = ['low ', 'high']
    scene%bodies(1)%lower(:2) = 0.0_wp
    scene%bodies(1)%upper(:2) = [12, 6]*spacing
    scene%bodies(2)%lower(:2) = [3, 6]*spacing
    scene%bodies(2)%upper(:2) = [9, 12]*spacing
    scene%bodies(1)%points(:2) = [12, 6]
    scene%bodies(2)%points(:2) = [6, 6]
    allocate (scene%contacts(1)%between(2))
    scene%contacts(1)%between(:) = ['low ', 'high']
    scene%contacts(1)%friction = 0.3_wp
    scene%contacts(1)%stiffness = 4.0_wp
    scene%initial(1)%velocity_text(1) = '50*(y > 0.006)'
    scene%initial(1)%velocity_text(2) = '-400*(y > 0.006)'
    call run(scene, 'whole', fault, threads=2)
    call accept(error, fault)
    if (allocated(error)) return
    call run_in_pieces(scene, 'pieces', 1, pieces, error)
    call expect_true(error, pieces > 10, 'it is not cut')
    call expect_same_results(error, 'whole', 'pieces', 6)
  end subroutine test_contact

  !> A free disc and a wall that is moved hit a plate from two sides, cut after every step.
  subroutine test_rigid(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces, i

    call plate(scene)
    deallocate (scene%cracks, scene%boundaries, scene%contacts, scene%initial, scene%rigids)
    allocate (scene%cracks(0), scene%boundaries(0), scene%contacts(2), scene%initial(0), &
      & scene%rigids(2))
    scene%rigids%name = [character(4) :: 'disc', 'wall']
    scene%rigids%shape = [character(10) :: 'sphere', 'half_space']
    scene%rigids(1)%centre(:2) = [5.0_wp, 15.3_wp]*spacing
    scene%rigids(1)%radius = 3*spacing
    scene%rigids(1)%density = 3000.0_wp
    scene%rigids(1)%velocity(:2) = [200.0_wp, -500.0_wp]
    scene%rigids(1)%spin(3) = 1.0e5_wp
    scene%rigids(2)%centre(:2) = 0.0_wp
    scene%rigids(2)%normal(:2) = [0.0_wp, 1.0_wp]
    scene%rigids(2)%displacement_text(2) = '20*t + 1e7*t^2'
    do i = 1, 2
      allocate (scene%contacts(i)%between(2))
      scene%contacts(i)%between(:) = [character(4) :: 'box', scene%rigids(i)%name]
      scene%contacts(i)%friction = 0.3_wp
    end do
    scene%contacts(2)%restitution = 0.7_wp
    call run(scene, 'whole', fault, threads=2)
    call accept(error, fault)
    if (allocated(error)) return
    call run_in_pieces(scene, 'pieces', 1, pieces, error)
    call expect_true(error, pieces > 10, 'it is not cut')
    call expect_same_results(error, 'whole', 'pieces', 6)
  end subroutine test_rigid

  !> A plate that breaks beside a pin, and one that is bent about pins, cut after every iteration.
  subroutine test_pins(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: solvers(2) = [character(18) :: 'conjugate_gradient', &
      & 'dynamic_relaxation']
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces, i

    do i = 0, 2
      if (allocated(error)) return
      if (i == 0) then
        call plate(scene)
      else
        call slow_plate(scene)
        scene%relaxation%solver = solvers(max(1, i))
      end if
      scene%boundaries(1)%motion = 'pin'
      if (i > 0) then
        scene%boundaries(1)%displacement(1) = 0.0_wp
        scene%boundaries(2)%motion = 'pin'
        scene%materials(1)%critical_stretch = unset
      end if
      call run(scene, 'whole', fault, threads=2)
      call accept(error, fault)
      if (allocated(error)) return
      call run_in_pieces(scene, 'pieces', 1, pieces, error)
      call expect_true(error, pieces > 10, 'it is not cut')
      call expect_same_results(error, 'whole', 'pieces', merge(6, 2, i == 0))
    end do
  end subroutine test_pins

  !> Two load steps, in the second of which bonds break and it relaxes again; cut after every
  !> iteration and every load step, with a load beside the imposed displacements.
  subroutine test_relaxation(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: solvers(2) = [character(18) :: 'conjugate_gradient', &
      & 'dynamic_relaxation']
    type(scene_type) :: scene
    integer :: i

    call slow_plate(scene)
    do i = 1, size(solvers)
      if (allocated(error)) return
      scene%relaxation%solver = solvers(i)
      call expect_same_growth(scene, error)
    end do
  end subroutine test_relaxation

  !> Bonds break in equilibrium, in one piece as in pieces that are cut after every iteration.
  subroutine expect_same_growth(scene, error)
    type(scene_type), intent(in) :: scene
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault
    integer :: pieces

    call run(scene, 'whole', fault, threads=2)
    call accept(error, fault)
    call expect_broken(error, 'whole')
    if (allocated(error)) return
    call run_in_pieces(scene, 'pieces', 1, pieces, error)
    call expect_true(error, pieces > 10, 'it is cut at load steps alone')
    call expect_same_results(error, 'whole', 'pieces', 2)
    call expect_same_file(error, here//'/whole/iterations.csv', here//'/pieces/iterations.csv')
  end subroutine expect_same_growth

  !> Growth by events, with the load controlled and down where it snaps back; cut after every
  !> iteration and every equilibrium.
  subroutine test_events(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: controls(2) = [character(11) :: 'load', 'dissipation']
    type(scene_type) :: scene
    integer :: i

    call slow_plate(scene)
    scene%relaxation%load_steps = 2
    scene%relaxation%growth = 'events'
    scene%relaxation%tolerance = 1.0e-2_wp
    scene%relaxation%most_events = 3
    do i = 1, size(controls)
      if (allocated(error)) return
      scene%relaxation%control = controls(i)
      call expect_same_growth(scene, error)
    end do
  end subroutine test_events

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

  !> A slender plate that bends by so much that the conjugate gradient leaves it to dynamic
  !> relaxation; and one that nothing supports. Both cut after every iteration.
  subroutine test_ways_to_rest(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces, way

    do way = 1, 2
      if (allocated(error)) return
      call slow_plate(scene)
      deallocate (scene%cracks, scene%boundaries, scene%regions, scene%loads)
      allocate (scene%cracks(0), scene%boundaries(2 - way), scene%regions(0), scene%loads(way))
      scene%bodies(1)%upper(:2) = [12, 2]*spacing
      scene%bodies(1)%points(:2) = [12, 2]
      scene%sections(1)%point(2) = spacing
      scene%materials(1)%critical_stretch = unset
      scene%relaxation%load_steps = way
      scene%loads(1)%side = 'x_max'
      if (way == 1) then
        scene%boundaries(1)%side = 'x_min'
        scene%boundaries(1)%displacement(:2) = 0.0_wp
        scene%loads(1)%force(2) = 0.125_wp*youngs_modulus*spacing*scene%header%thickness
        scene%relaxation%tolerance = 2.0e-2_wp
      else
        scene%relaxation%tolerance = 1.0e-4_wp
        scene%loads(2)%side = 'x_min'
        scene%loads%pressure = -1.0e-3_wp*youngs_modulus
      end if
      call run(scene, 'whole', fault, threads=2)
      call accept(error, fault)
      if (allocated(error)) return
      call run_in_pieces(scene, 'pieces', 1, pieces, error)
      call expect_true(error, pieces > 10, 'it is cut at load steps alone')
      call expect_same_results(error, 'whole', 'pieces', way + 1)
      if (way == 1) call expect_same_file(error, here//'/whole/warnings.txt', &
        & here//'/pieces/warnings.txt')
    end do
  end subroutine test_ways_to_rest

  !> A relaxation that stops amid its load step has its state as an output, but no row of it: the
  !> file has the names and the start.
  subroutine test_no_row(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer(i1), allocatable :: bytes(:)
    integer(i1), parameter :: end_of_line = 10_i1
    integer :: piece

    call slow_plate(scene)
    do piece = 1, 3
      call run(scene, 'no_row', fault, restart=piece > 1, minutes=1.0e-12_wp)
      call expect_true(error, allocated(fault), 'one iteration was enough')
      if (allocated(error)) return
      call check(error, fault%status, status_interrupted)
      if (allocated(error)) return
      call expect_true(error, piece == 1 .or. index(fault%message, 'of load step 1, which is '// &
        & 'not in equilibrium yet') > 0, fault%message)
      call read_bytes(here//'/no_row/history.csv', bytes)
      call check(error, count(bytes == end_of_line), 2, 'lines of the history')
      if (allocated(error)) return
      call expect_true(error, file_exists(here//'/no_row/plate_000001.vtu') .eqv. piece > 1, &
        & 'the state at the stop is an output')
      if (allocated(error)) return
    end do
  end subroutine test_no_row

  !> Checkpoints are written by time amid a load step, too: a relaxation whose iterations are used
  !> up goes on from there when it is given more, to the end of one that had them from the start.
  subroutine test_more_iterations(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call slow_plate(scene)
    scene%relaxation%tolerance = 1.0e-6_wp
    call run(scene, 'whole', fault)
    call accept(error, fault)
    if (allocated(error)) return
    scene%output%checkpoint_minutes = 1.0e-12_wp
    scene%relaxation%maximum_iterations = 6
    call run(scene, 'more', fault)
    call expect_true(error, allocated(fault), 'six iterations were enough')
    if (allocated(error)) return
    call check(error, fault%status, status_no_answer)
    scene%output%checkpoint_minutes = 0.0_wp
    scene%relaxation%maximum_iterations = 100000
    call run(scene, 'more', fault, restart=.true.)
    call accept(error, fault)
    call expect_same_results(error, 'whole', 'more', 2)
  end subroutine test_more_iterations

  !> The older checkpoint of a run that came to its end: everything after it is computed again, in
  !> files that are longer, and trimmed.
  subroutine test_beyond(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call plate(scene)
    call run(scene, 'whole', fault)
    call accept(error, fault)
    scene%output%checkpoint_every = 11
    call run(scene, 'beyond', fault)
    call accept(error, fault)
    if (allocated(error)) return
    call run(scene, 'beyond', fault, restart=.true., &
      & checkpoint=here//'/beyond/plate.checkpoint.old')
    call accept(error, fault)
    call expect_same_results(error, 'whole', 'beyond', 6)
  end subroutine test_beyond

  !> 20 steps, then 30: the state after 20, which was an output as the last one, is none any more.
  subroutine test_longer(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call plate(scene)
    call run(scene, 'whole', fault)
    call accept(error, fault)
    scene%time%steps = 20
    scene%output%checkpoint_every = 100
    call run(scene, 'longer', fault)
    call accept(error, fault)
    call run(scene, 'longer', fault, restart=.true.)
    call accept(error, fault)
    call expect_true(error, file_exists(here//'/longer/plate_000003.vtu') .and. &
      & .not. file_exists(here//'/longer/plate_000004.vtu'), 'a complete run is left alone')
    scene%time%steps = 30
    call run(scene, 'longer', fault, restart=.true.)
    call accept(error, fault)
    call expect_same_results(error, 'whole', 'longer', 6)
    scene%time%steps = 25
    call run(scene, 'longer', fault, restart=.true.)
    call expect_true(error, allocated(fault), 'a run was made shorter')
  end subroutine test_longer

  subroutine test_changed(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene, other
    type(fault_type), allocatable :: fault

    call plate(scene)
    call run(scene, 'changed', fault, minutes=1.0e-12_wp)
    other = scene
    other%materials(1)%density = 7000.0_wp
    other%boundaries = scene%boundaries(:2)
    other%output%every = 3
    call run(other, 'changed', fault, restart=.true.)
    call expect_true(error, allocated(fault), 'a changed scene goes on')
    if (allocated(error)) return
    call check(error, fault%status, status_input)
    call expect_true(error, index(fault%message, '&material density: 7850.0 -> 7000.0') > 0 .and. &
      & index(fault%message, '&boundary number 3: gone') > 0 .and. &
      & index(fault%message, 'every: ') == 0, fault%message)
    other = scene
    other%output%every = 3
    other%header%title = 'another title'
    call run(other, 'changed', fault, restart=.true.)
    call accept(error, fault)
    if (allocated(error)) return
    call run(other, 'whole', fault)
    call expect_same_results(error, 'whole', 'changed', 11)
  end subroutine test_changed

  !> A byte is changed in the newest: it is refused and the older one is offered, which leads to the
  !> same end, and is whole as long as the next one isn't.
  subroutine test_damaged(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: newest = here//'/damaged/plate.checkpoint'
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer(i1), allocatable :: bytes(:)
    integer :: unit

    call plate(scene)
    call run(scene, 'whole', fault)
    call run(scene, 'damaged', fault, minutes=1.0e-12_wp)
    call run(scene, 'damaged', fault, restart=.true., minutes=1.0e-12_wp)
    call read_bytes(newest, bytes)
    call check(error, size(bytes) > 1000, 'no checkpoint')
    if (allocated(error)) return
    bytes(size(bytes)/2) = not(bytes(size(bytes)/2))
    open (newunit=unit, file=newest, access='stream', form='unformatted', action='write')
    write (unit) bytes
    close (unit)
    call run(scene, 'damaged', fault, restart=.true.)
    call expect_true(error, allocated(fault), 'a damaged checkpoint is taken')
    if (allocated(error)) return
    call expect_true(error, index(fault%message, 'checksum') > 0 .and. &
      & index(fault%message, '--restart '//newest//'.old') > 0, fault%message)
    call run(scene, 'damaged', fault, restart=.true., minutes=1.0e-12_wp, checkpoint=newest//'.old')
    call expect_true(error, allocated(fault), 'the older one is refused')
    if (allocated(error)) return
    call check(error, fault%status, status_interrupted)
    call read_bytes(newest//'.old', bytes)
    call run(scene, 'damaged', fault, restart=.true., checkpoint=newest//'.old', &
      & minutes=1.0e-12_wp)
    call expect_true(error, fault%status == status_interrupted, 'the older one was overwritten')
    call run(scene, 'damaged', fault, restart=.true.)
    call accept(error, fault)
    call expect_same_results(error, 'whole', 'damaged', 6)
  end subroutine test_damaged

  !> An empty folder; results of a run that was stopped without a checkpoint; complete ones; those
  !> of another scene.
  subroutine test_none(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: newest = here//'/none/plate.checkpoint'
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call plate(scene)
    call run(scene, 'whole', fault)
    call remove_file(here//'/none/plate.vtkhdf')
    call remove_file(here//'/none/plate.pvd')
    call remove_file(here//'/none/history.csv')
    call run(scene, 'none', fault, restart=.true., minutes=1.0e-12_wp)
    call expect_true(error, file_exists(newest), 'no checkpoint')
    call remove_file(newest)
    call run(scene, 'none', fault, restart=.true.)
    call accept(error, fault)
    call expect_same_results(error, 'whole', 'none', 6)
    call expect_true(error, .not. file_exists(newest), 'a short run leaves a checkpoint')
    call run(scene, 'none', fault, restart=.true.)
    call accept(error, fault)
    scene%materials(1)%density = 7000.0_wp
    call run(scene, 'none', fault, restart=.true.)
    call expect_true(error, allocated(fault), 'results of another scene are taken for its own')
    call expect_same_results(error, 'whole', 'none', 6)
    call run(scene, 'none', fault, restart=.true., checkpoint=here//'/none/such')
    call expect_true(error, allocated(fault), 'a checkpoint that is not there')
  end subroutine test_none

  !> Other fields do not fit into the files that are there, but another folder takes them, with the
  !> whole history.
  subroutine test_elsewhere(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: path = here//'/elsewhere/plate.vtkhdf'
    character(1000) :: line
    real(wp) :: step
    integer :: unit
    type(scene_type) :: scene, other
    type(fault_type), allocatable :: fault
    type(hdf5_file) :: file

    call plate(scene)
    call run(scene, 'whole', fault)
    scene%output%checkpoint_every = 10
    call run(scene, 'from', fault)
    other = scene
    other%output%fields = [character(64) :: 'dilatation']
    call run(other, 'from', fault, restart=.true., checkpoint=here//'/from/plate.checkpoint.old')
    call expect_true(error, allocated(fault), 'other fields in the same file')
    ! the rows before have other columns: the history begins at the checkpoint
    scene%probes(1)%fields = [character(64) :: 'velocity']
    call remove_file(here//'/less/plate.vtkhdf')
    call remove_file(here//'/less/plate.pvd')
    call remove_file(here//'/less/history.csv')
    call run(scene, 'less', fault, restart=.true., checkpoint=here//'/from/plate.checkpoint.old')
    call accept(error, fault)
    if (allocated(error)) return
    open (newunit=unit, file=here//'/less/history.csv', action='read')
    read (unit, '(a)') line
    read (unit, *) step
    close (unit)
    call expect_true(error, index(line, 'velocity') > 0 .and. step > 10.0_wp, &
      & 'other columns: '//line)
    call remove_file(path)
    call remove_file(here//'/elsewhere/plate.pvd')
    call remove_file(here//'/elsewhere/history.csv')
    call run(other, 'elsewhere', fault, restart=.true., &
      & checkpoint=here//'/from/plate.checkpoint.old')
    call accept(error, fault)
    call expect_same_file(error, here//'/whole/history.csv', here//'/elsewhere/history.csv')
    call open_file(path, .false., file, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call expect_true(error, object_exists(file, '/VTKHDF/PointData/dilatation') .and. &
      & object_exists(file, '/points/volume'), 'what is in the file')
    call close_file(file, fault)
  end subroutine test_elsewhere

  !> Minutes that are over at once give checkpoints, the last of which is that of the end; without
  !> minutes there are none, but for an interruption.
  subroutine test_minutes(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: newest = here//'/minutes/plate.checkpoint'
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call plate(scene)
    scene%time%steps = 5
    scene%output%checkpoint_minutes = 1.0e-12_wp
    call run(scene, 'minutes', fault)
    call accept(error, fault)
    call expect_true(error, file_exists(newest) .and. file_exists(newest//'.old'), 'by time')
    scene%output%checkpoint_minutes = 0.0_wp
    call run(scene, 'minutes', fault)
    call accept(error, fault)
    call expect_true(error, .not. file_exists(newest) .and. .not. file_exists(newest//'.old'), &
      & 'never, and those of the run before are gone')
    call run(scene, 'minutes', fault, minutes=1.0e-12_wp)
    call expect_true(error, file_exists(newest), 'when the run is stopped')
  end subroutine test_minutes

  !> A folder stands where the checkpoint is to be written.
  subroutine test_failing(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call plate(scene)
    call run(scene, 'whole', fault)
    call make_directory(here//'/failing/plate.checkpoint.part/x', fault)
    scene%output%checkpoint_every = 20
    call run(scene, 'failing', fault)
    call accept(error, fault)
    call expect_same_results(error, 'whole', 'failing', 6)
  end subroutine test_failing

end module test_output_checkpoint_restart
