!> The library as other programs see it: nothing of perifort is used here but `perifort`.
module test_library
  use, intrinsic :: ieee_arithmetic, only: ieee_negative_inf, ieee_quiet_nan, ieee_value
  use comparisons, only: expect_close, max_abs
  use perifort, only: answer_type, body_group, boundary_group, check_scene, crack_group, &
    & damage_of, displacements_of, energies_type, fail, fault_type => error_type, find_energies, &
    & force_densities_of, header_type, horizon_group, initial_group, instant_type, is_set, &
    & load_group, material_group, name_length, no_fail_group, number_of_points, observer_type, &
    & output_group, region_group, &
    & point_near, positions_of, preview_scene, probe_group, program_version, read_scene_text, &
    & relaxation_group, run_options_type, run_scene, scene_text, scene_type, shape_group, &
    & status_input, status_interrupted, status_no_answer, study_group, system_type, time_group, &
    & tip_group, unset, velocities_of, volumes_of, wp
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_library

  character(*), parameter :: here = 'build/test_library'
  character(*), parameter :: newline = new_line('a')
  integer, parameter :: points(2) = [6, 5]
  real(wp), parameter :: spacing = 1.0e-2_wp, density = 7850.0_wp, thickness = 2.0e-3_wp
  real(wp), parameter :: velocity(2) = [3.0_wp, -2.0_wp], dt = 1.0e-6_wp

  !> Keeps what it sees, and may end the run.
  type, extends(observer_type) :: witness_type
    integer :: seen = 0                  !! instants
    integer :: last_step = -1
    logical :: saw_end = .false.
    integer :: stop_at = -1              !! step at which the run is to end
    integer :: status = 0                !! with which it ends then
    real(wp) :: worst = 0.0_wp           !! largest distance from where the plate should be [m]
    real(wp) :: slowest = 0.0_wp         !! largest difference from its velocity [m/s]
    real(wp) :: kinetic = 0.0_wp, strain = 0.0_wp  !! at the last instant [J]
    real(wp) :: volume = 0.0_wp          !! of all points [m3]
    real(wp) :: force = 0.0_wp           !! largest force density [N/m3]
    real(wp) :: damage = 0.0_wp          !! largest
    integer :: corner = 0                !! point nearest to the upper right corner
  contains
    procedure :: observe
  end type witness_type

contains

  subroutine collect_library(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a scene needs no list that it does not use', test_no_lists), &
      & new_unittest('every group can be filled', test_groups), &
      & new_unittest('a complete scene is not changed', test_twice), &
      & new_unittest('words may be written in any case', test_case), &
      & new_unittest('errors are reported as in files, except for the place', test_faults), &
      & new_unittest('errors of a run name their group', test_late_fault), &
      & new_unittest('a preview is a text and leaves no files', test_preview), &
      & new_unittest('an observer sees every instant', test_observer), &
      & new_unittest('an observer stops a run cleanly', test_stop), &
      & new_unittest('an observer ends a run by an error', test_fail), &
      & new_unittest('results in memory are those in files', test_files), &
      & new_unittest('results before a fault are kept', test_unstable), &
      & new_unittest('unknown names are refused with the known ones', test_names), &
      & new_unittest('a run without outputs of fields has its history', test_no_fields)]
  end subroutine collect_library

  !> A plate that flies: 12 steps of 1 us, a row every third. Only what differs from the defaults.
  subroutine flight(scene)
    type(scene_type), intent(out) :: scene

    scene%header%dimension = 2
    scene%header%thickness = thickness
    allocate (scene%bodies(1), scene%materials(1), scene%initial(1))
    scene%bodies(1)%lower(:2) = 0.0_wp
    scene%bodies(1)%upper(:2) = points*spacing
    scene%bodies(1)%points(:2) = points
    scene%materials(1)%youngs_modulus = 200.0e9_wp
    scene%materials(1)%poissons_ratio = 0.25_wp
    scene%materials(1)%density = density
    scene%initial(1)%velocity(:2) = velocity
    scene%time%step = dt
    scene%time%steps = 12
    scene%output%history_every = 3
  end subroutine flight

  !> Options of a run without a word, which writes to a folder of its own, or not at all.
  pure type(run_options_type) function quietly(folder) result(options)
    character(*), intent(in) :: folder   !! '' = no files

    options%quiet = .true.
    options%overwrite = .true.
    options%threads = 1
    options%files = folder /= ''
    options%output_directory = here//'/'//folder
  end function quietly

  !> Fail the test where something was refused.
  subroutine accept(error, fault)
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable, intent(in) :: fault

    if (allocated(error)) return
    if (allocated(fault)) call test_failed(error, 'refused: '//fault%message)
  end subroutine accept

  !> Fail the test unless it is so; a failure that stands is kept.
  subroutine expect(error, is_so, what)
    type(error_type), allocatable, intent(inout) :: error
    logical, intent(in) :: is_so
    character(*), intent(in) :: what

    if (allocated(error)) return
    if (.not. is_so) call test_failed(error, what)
  end subroutine expect

  !> Whether there is a file.
  logical function exists(path)
    character(*), intent(in) :: path
    inquire (file=path, exist=exists)
  end function exists

  !> Keep what the instant shows of a plate in flight.
  subroutine observe(observer, system, instant, error)
    class(witness_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error
    type(energies_type) :: energies
    real(wp), allocatable :: u(:, :), v(:, :), x(:, :)
    integer :: c

    observer%seen = observer%seen + 1
    observer%last_step = instant%step
    observer%saw_end = observer%saw_end .or. instant%last
    u = displacements_of(system)
    v = velocities_of(system, instant)
    do c = 1, 2
      observer%worst = max(observer%worst, max_abs(u(:, c) - velocity(c)*instant%time))
      observer%slowest = max(observer%slowest, max_abs(v(:, c) - velocity(c)))
    end do
    x = positions_of(system)
    observer%corner = point_near(system, points*spacing)
    if (norm2(x(observer%corner, :) - (points - 0.5_wp)*spacing) > 1.0e-9_wp) observer%corner = 0
    call find_energies(system, instant, energies)
    observer%kinetic = energies%kinetic
    observer%strain = energies%strain
    observer%volume = sum(volumes_of(system))
    observer%force = max_abs(force_densities_of(system))
    observer%damage = maxval(damage_of(system))
    if (size(u, 1) /= number_of_points(system)) observer%corner = -1
    if (instant%step == observer%stop_at) call fail(error, 'seen enough', observer%status)
  end subroutine observe

  !> Body, material and motion are all there is. The plate arrives, and nothing is written.
  subroutine test_no_lists(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(answer_type) :: answer
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: u(:, :), time(:)

    call flight(scene)
    call run_scene(scene, quietly(''), fault, answer=answer)
    call accept(error, fault)
    call expect(error, .not. (allocated(scene%cracks) .or. exists('out/scene') .or. &
      & exists(here//'/scene.vtkhdf')), 'the scene has changed, or files are written')
    if (allocated(error)) return
    call answer%get_field('displacement', u, fault)
    call accept(error, fault)
    call answer%get_column('time', time, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call check(error, all(shape(u) == [30, 3]), 'points and components')
    call expect_close(error, time, [0, 3, 6, 9, 12]*dt, 1.0e-18_wp, 'times of rows')
    call expect_close(error, answer%time, 12*dt, 1.0e-18_wp, 'time of the last output')
    call expect_close(error, u(:, 1), 12*dt*velocity(1), 1.0e-16_wp, 'along x')
    call expect_close(error, u(:, 2), 12*dt*velocity(2), 1.0e-16_wp, 'along y')
    call expect_close(error, u(:, 3), 0.0_wp, 0.0_wp, 'along z')
    call expect_close(error, answer%positions(30, :2), (points - 0.5_wp)*spacing, 1.0e-15_wp, &
      & 'the last point')
    call check(error, trim(answer%columns(2)%unit) == 's', 'unit of the time')
  end subroutine test_no_lists

  !> A scene of all groups, each filled through its exported type, is accepted and written as text
  !> that reads back to the same.
  subroutine test_groups(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene, again
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text
    integer :: i
    character(*), parameter :: groups(17) = [character(10) :: 'scene', 'body', 'remove', 'region', &
      & 'material', 'horizon', 'crack', 'no_fail', 'initial', 'boundary', 'load', 'time', &
      & 'relaxation', 'output', 'probe', 'tip', 'study']

    scene%header = header_type(title='all', dimension=2)
    scene%bodies = [body_group(name='plate', lower=[0.0_wp, 0.0_wp, unset], upper=[0.1_wp, 0.1_wp, &
      & unset], points=[10, 10, 0])]
    scene%materials = [material_group(youngs_modulus=200.0e9_wp, poissons_ratio=0.3_wp, &
      & density=density, critical_stretch=0.1_wp)]
    scene%removed = [shape_group(shape='sphere', centre=[0.05_wp, 0.05_wp, 0.0_wp], &
      & radius=0.01_wp)]
    scene%regions = [region_group(name='left', shape='box', upper=[0.02_wp, unset, unset])]
    scene%no_fail = [no_fail_group(region='left')]
    scene%horizon = horizon_group(ratio=2.5_wp)
    scene%cracks = [crack_group(from=[0.0_wp, 0.03_wp, unset], to=[0.03_wp, 0.03_wp, unset])]
    scene%initial = [initial_group(region='left', velocity=[1.0_wp, unset, unset])]
    scene%boundaries = [boundary_group(name='top', side='y_max', velocity=[unset, 1.0_wp, unset])]
    scene%loads = [load_group(side='y_min', pressure=1.0e5_wp)]
    scene%time = time_group(steps=3)
    scene%relaxation = relaxation_group(tolerance=1.0e-5_wp)
    scene%output = output_group(every=2)
    scene%probes = [probe_group(name='tip', point=[0.1_wp, 0.1_wp, unset])]
    scene%tips = [tip_group(name='front', from=[0.0_wp, 0.03_wp, unset], direction=[1.0_wp, &
      & 0.0_wp, unset])]
    scene%studies = [study_group(vary='horizon%ratio', measure='strain_energy', against='finest')]
    scene%studies(1)%values = [character(1024) :: '2.5', '3.0']
    call check_scene(scene, fault)
    call accept(error, fault)
    if (allocated(error)) return
    text = scene_text(scene)
    do i = 1, size(groups)
      call expect(error, index(text, '&'//trim(groups(i))//newline) > 0, 'no &'//trim(groups(i)))
    end do
    call read_scene_text(text, 'written.nml', again, fault)
    call accept(error, fault)
    call expect(error, scene_text(again) == text, 'read back to another scene')
    call expect(error, .not. is_set(scene%probes(1)%point(3)) .and. name_length == &
      & len(scene%probes(1)%name), 'what is not given stays so')
    call run_scene(scene, quietly(''), fault)
    call accept(error, fault)
  end subroutine test_groups

  !> Completed once, a scene is not changed by another time, be it from memory or from a text; where
  !> it was read, it keeps its text, so that a fault that the points show still has its line.
  subroutine test_twice(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: words = '&scene'//newline//'dimension = 2'//newline//'/'//newline// &
      & '&body'//newline//'lower = 2*0.0'//newline//'upper = 2*1.0'//newline//'points = 5, 5'// &
      & newline//'/'//newline//"&material"//newline//"model = 'bond_based'"//newline// &
      & 'youngs_modulus = 1e9'//newline//'density = 1e3'//newline//'/'//newline//'&horizon'// &
      & newline//'length = 0.7'//newline//'/'//newline//'&time'//newline//'steps = 2'//newline// &
      & '/'//newline//'&load'//newline//"region = 'nowhere'"//newline//'body_force_x = 1.0'// &
      & newline//'/'//newline//'&region'//newline//"name = 'nowhere'"//newline// &
      & "shape = 'box'"//newline//'lower = 7.0'//newline//'/'//newline
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    character(:), allocatable :: once

    call flight(scene)
    call check_scene(scene, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call expect(error, allocated(scene%cracks) .and. allocated(scene%probes) .and. &
      & allocated(scene%output%fields), 'a list is not allocated')
    once = scene_text(scene)
    call check_scene(scene, fault)
    call accept(error, fault)
    call expect(error, scene_text(scene) == once, 'completed twice')

    call read_scene_text(words, 'twice.nml', scene, fault)
    call accept(error, fault)
    if (allocated(error)) return
    once = scene_text(scene)
    call check_scene(scene, fault)
    call accept(error, fault)
    call expect(error, scene_text(scene) == once .and. scene%text == words .and. &
      & scene%file == 'twice.nml', 'a scene that was read has changed')
    call run_scene(scene, quietly(''), fault)
    call expect(error, allocated(fault), 'a load on nothing is accepted')
    if (.not. allocated(error)) call expect(error, index(fault%message, 'twice.nml:21') > 0, &
      & fault%message)
  end subroutine test_twice

  !> As in files.
  subroutine test_case(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call flight(scene)
    scene%time%integrator = 'Runge_Kutta'
    scene%horizon%surface_correction = 'NONE'
    call check_scene(scene, fault)
    call accept(error, fault)
    call expect(error, scene%time%integrator == 'runge_kutta' .and. &
      & scene%horizon%surface_correction == 'none', 'not as the program knows them')
  end subroutine test_case

  !> Words that are not known, values out of range, keys that are missing, names of nothing,
  !> contradictions: the message begins as that of a file with the same fault, and names group and
  !> key instead of a line. The faulty scene stays as it is.
  subroutine test_faults(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text

    call flight(scene)
    scene%header%plane = 'stres'
    call expect_fault('&scene number 1, key plane', "unknown value 'stres' of key 'plane'", &
      & "did you mean 'stress'?")
    call flight(scene)
    scene%materials(1)%density = -1.0_wp
    call expect_fault('&material number 1, key density', "'density' is out of range", '> 0')
    call flight(scene)
    deallocate (scene%materials)
    call expect_fault('the scene in memory', 'the scene has no group &material', 'at least one')
    call flight(scene)
    scene%materials(1)%youngs_modulus = unset
    call expect_fault('&material number 1', "lacks the key 'youngs_modulus'", 'Pa')
    call flight(scene)
    scene%time%duration = 1.0_wp
    call expect_fault('&time number 1, key duration', "'steps' and 'duration' are both given", &
      & 'give one')
    call flight(scene)
    allocate (scene%boundaries(2))
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%displacement(1) = 0.0_wp
    scene%boundaries(2)%region = 'lef'
    scene%boundaries(2)%displacement(1) = 0.0_wp
    allocate (scene%regions(1))
    scene%regions(1) = region_group(name='left', shape='box', upper=[0.1_wp, unset, unset])
    call expect_fault('&boundary number 2, key region', "no region is named 'lef'", &
      & "did you mean 'left'?")
    call flight(scene)
    scene%bodies(1)%upper(1) = 0.07_wp
    call expect_fault('&body number 1, key points', 'the spacing of the lattice differs', &
      & 'spacings')
    call flight(scene)
    scene%output%fields = [character(name_length) :: 'displacment']
    call expect_fault('&output number 1, key fields', "unknown value 'displacment'", &
      & "did you mean 'displacement'?")
    call flight(scene)
    scene%initial(1)%velocity(1) = ieee_value(1.0_wp, ieee_quiet_nan)
    call expect_fault('&initial number 1, key velocity_x', "bad value 'NaN' for key 'velocity_x'", &
      & 'expected')
    call flight(scene)
    scene%initial(1)%velocity(1) = ieee_value(1.0_wp, ieee_negative_inf)
    call expect_fault('&initial number 1, key velocity_x', "bad value '-Infinity'", 'expected')
    call flight(scene)
    scene%initial(1)%displacement_gradient(2, 1) = ieee_value(1.0_wp, ieee_quiet_nan)
    call expect_fault('&initial number 1, key displacement_gradient', "bad value 'NaN'", 'expected')
    scene = scene_type()
    call expect_fault('&scene number 1, key dimension', "'dimension' is out of range", '1')

  contains

    !> The scene is refused by the check, the preview and the run alike.
    subroutine expect_fault(place, message, note)
      character(*), intent(in) :: place, message, note
      type(scene_type) :: again
      type(fault_type), allocatable :: of_file, of_run
      character(:), allocatable :: before, ignored

      if (allocated(error)) return
      before = scene_text(scene)
      call check_scene(scene, fault)
      call expect(error, allocated(fault), 'accepted: '//message)
      if (allocated(error)) return
      call expect(error, fault%status == status_input .and. index(fault%message, message) > 0 &
        & .and. index(fault%message, note) > 0, fault%message)
      call expect(error, index(fault%message, ' --> group '//place//newline) > 0 .or. &
        & index(fault%message, ' --> '//place//newline) > 0, fault%message)
      call expect(error, scene_text(scene) == before, 'the scene has changed')
      call run_scene(scene, quietly('faults'), of_run)
      call expect(error, allocated(of_run), 'run: '//message)
      if (.not. allocated(error)) call expect(error, of_run%message == fault%message, &
        & of_run%message)
      call preview_scene(scene, quietly(''), of_run, ignored)
      call expect(error, allocated(of_run), 'previewed: '//message)
      call read_scene_text(before, 'as_file.nml', again, of_file)
      ! names of fields are not the reader's business
      if (.not. allocated(of_file)) call check_scene(again, of_file)
      call expect(error, allocated(of_file), 'read: '//message)
      if (allocated(error)) return
      text = fault%message(:index(fault%message, newline))
      call expect(error, index(of_file%message, text) == 1 .and. &
        & index(of_file%message, 'as_file.nml') > 0, of_file%message)
    end subroutine expect_fault
  end subroutine test_faults

  !> A fault that only the points show, in a scene that was built in memory.
  subroutine test_late_fault(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call flight(scene)
    scene%bodies = [scene%bodies, scene%bodies]
    call run_scene(scene, quietly('late'), fault)
    call expect(error, allocated(fault), 'two bodies in one place')
    if (allocated(error)) return
    call expect(error, index(fault%message, ' --> group &body number ') > 0, fault%message)
    call expect(error, .not. exists(here//'/late/scene.vtkhdf'), 'results of nothing')
  end subroutine test_late_fault

  subroutine test_preview(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text

    call flight(scene)
    call preview_scene(scene, quietly('preview'), fault, text)
    call accept(error, fault)
    if (allocated(error)) return
    call expect(error, index(text, 'points          30 in 2D') > 0 .and. &
      & index(text, 'time step       1 us') > 0 .and. index(text, 'run time') > 0 .and. &
      & index(text, 'checkpoints') > 0, text)
    call expect(error, .not. exists(here//'/preview/scene.vtkhdf'), 'files are left behind')
    call expect(error, len(program_version) > 0, 'no version')
  end subroutine test_preview

  !> At each of the 13 instants the plate is where it should be, as fast, and whole.
  subroutine test_observer(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: volume = product(points)*spacing**2*thickness
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    type(witness_type) :: witness

    call flight(scene)
    call run_scene(scene, quietly(''), fault, witness)
    call accept(error, fault)
    if (allocated(error)) return
    call check(error, witness%seen, 13, 'instants')
    call expect(error, witness%saw_end .and. witness%last_step == 12, 'the end')
    call expect_close(error, witness%worst, 0.0_wp, 1.0e-16_wp, 'displacements')
    call expect_close(error, witness%slowest, 0.0_wp, 1.0e-9_wp, 'velocities')
    call expect_close(error, witness%volume, volume, 1.0e-12_wp*volume, 'volume')
    call expect_close(error, witness%kinetic, density*volume/2*sum(velocity**2), &
      & 1.0e-9_wp*witness%kinetic, 'kinetic energy')
    call expect_close(error, witness%strain, 0.0_wp, 1.0e-9_wp*witness%kinetic, 'strain energy')
    ! forces of rounding: 1e-15 of E over the spacing
    call expect_close(error, witness%force, 0.0_wp, 1.0e-12_wp*200.0e9_wp/spacing, 'forces')
    call expect_close(error, witness%damage, 0.0_wp, 0.0_wp, 'damage')
    call check(error, witness%corner, 30, 'the corner is the last point')
  end subroutine test_observer

  !> Stopped at step 7, that state is the last output and row; a restart goes on from there, with
  !> the bits of a run that never stopped.
  subroutine test_stop(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    type(witness_type) :: witness
    type(run_options_type) :: options
    type(answer_type) :: stopped, whole, rest
    real(wp), allocatable :: step(:), u(:, :), v(:, :)

    call flight(scene)
    scene%initial(1)%velocity_gradient(1, 1) = 100.0_wp
    witness%stop_at = 7
    witness%status = status_interrupted
    options = quietly('stop')
    call run_scene(scene, options, fault, witness, stopped)
    call expect(error, allocated(fault), 'not stopped')
    if (allocated(error)) return
    call check(error, fault%status, status_interrupted, 'status')
    call expect(error, index(fault%message, 'seen enough at step 7') == 1, fault%message)
    call stopped%get_column('step', step, fault)
    call accept(error, fault)
    call expect_close(error, step, [0.0_wp, 3.0_wp, 6.0_wp, 7.0_wp], 0.0_wp, 'rows')
    call expect_close(error, stopped%time, 7*dt, 1.0e-18_wp, 'time of the last output')
    call expect(error, exists(here//'/stop/scene.unfinished') .and. &
      & exists(here//'/stop/scene.checkpoint'), 'no checkpoint')

    options%overwrite = .false.
    options%restart = .true.
    call run_scene(scene, options, fault, answer=rest)
    call accept(error, fault)
    call run_scene(scene, quietly(''), fault, answer=whole)
    call accept(error, fault)
    if (allocated(error)) return
    call rest%get_field('displacement', u, fault)
    call accept(error, fault)
    call whole%get_field('displacement', v, fault)
    call accept(error, fault)
    call expect_close(error, u, v, 0.0_wp, 'displacements of a run that was stopped')
    call expect_close(error, rest%history, whole%history, 0.0_wp, 'history of that run')
    call expect(error, .not. exists(here//'/stop/scene.unfinished'), 'marked as unfinished')
  end subroutine test_stop

  !> An error of another status ends the run at once, with its own words; rows before it are there.
  subroutine test_fail(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    type(witness_type) :: witness
    type(answer_type) :: answer

    call flight(scene)
    witness%stop_at = 4
    witness%status = status_no_answer
    call run_scene(scene, quietly(''), fault, witness, answer)
    call expect(error, allocated(fault), 'not ended')
    if (allocated(error)) return
    call expect(error, fault%message == 'seen enough' .and. fault%status == status_no_answer, &
      & fault%message)
    call check(error, size(answer%history, 1), 2, 'rows')
    ! before anything is computed, the words stay the same, too
    witness = witness_type(stop_at=0, status=status_input)
    call run_scene(scene, quietly(''), fault, witness)
    call expect(error, allocated(fault), 'not ended at the start')
    if (.not. allocated(error)) call expect(error, fault%message == 'seen enough', fault%message)
  end subroutine test_fail

  !> The last row of history.csv is that of the answer, and its head has the names.
  subroutine test_files(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    type(answer_type) :: answer
    character(10000) :: line, head
    real(wp), allocatable :: row(:)
    character(:), allocatable :: names
    integer :: unit, status, c, rows

    call flight(scene)
    scene%initial(1)%velocity_gradient(1, 1) = 100.0_wp
    scene%probes = [probe_group(name='tip', point=[0.0_wp, 0.0_wp, unset])]
    call run_scene(scene, quietly('files'), fault, answer=answer)
    call accept(error, fault)
    if (allocated(error)) return
    call check(error, answer%outputs, 13, 'outputs')
    open (newunit=unit, file=here//'/files/history.csv', status='old', action='read', iostat=status)
    call expect(error, status == 0, 'no history.csv')
    if (allocated(error)) return
    read (unit, '(a)') head
    rows = 0
    do
      read (unit, '(a)', iostat=status) line
      if (status /= 0) exit
      rows = rows + 1
    end do
    close (unit)
    names = ''
    do c = 1, size(answer%columns)
      if (c > 1) names = names//','
      names = names//trim(answer%columns(c)%name)
    end do
    call check(error, trim(head) == names, trim(head)//' instead of '//names)
    if (.not. allocated(error)) call check(error, rows, size(answer%history, 1), 'rows')
    if (allocated(error)) return
    allocate (row(size(answer%columns)))
    call last_row(row)
    call expect_close(error, row, answer%history(rows, :), 0.0_wp, 'the last row')

  contains

    !> The numbers of the last row of the file.
    subroutine last_row(values)
      real(wp), intent(out) :: values(:)
      integer :: r

      open (newunit=unit, file=here//'/files/history.csv', status='old', action='read')
      read (unit, '(a)') head
      do r = 1, rows
        read (unit, *) values
      end do
      close (unit)
    end subroutine last_row
  end subroutine test_files

  !> A step that is ten times too long: the history goes to the fault, and says how it came.
  subroutine test_unstable(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    type(answer_type) :: answer
    real(wp), allocatable :: energy(:)

    call flight(scene)
    scene%initial(1)%velocity_gradient(1, 1) = 10.0_wp
    scene%time%step = 2.0e-5_wp
    scene%time%steps = 2000
    scene%output%history_every = 1
    call run_scene(scene, quietly(''), fault, answer=answer)
    call expect(error, allocated(fault), 'not found')
    if (allocated(error)) return
    call check(error, fault%status, status_no_answer, 'status')
    call answer%get_column('strain_energy', energy, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call expect(error, size(energy) > 1 .and. energy(size(energy)) > energy(1), 'no history of it')
    call expect(error, answer%outputs > 0, 'no output')
  end subroutine test_unstable

  subroutine test_names(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    type(answer_type) :: answer, empty
    real(wp), allocatable :: column(:), field(:, :)

    call flight(scene)
    call run_scene(scene, quietly(''), fault, answer=answer)
    call accept(error, fault)
    call answer%get_column('kinetic', column, fault)
    call expect(error, allocated(fault), 'a column that is none')
    if (.not. allocated(error)) call expect(error, index(fault%message, 'kinetic_energy') > 0, &
      & fault%message)
    call answer%get_field('speed', field, fault)
    call expect(error, allocated(fault), 'a field that is none')
    if (.not. allocated(error)) call expect(error, index(fault%message, 'velocity') > 0, &
      & fault%message)
    call empty%get_column('time', column, fault)
    call expect(error, allocated(fault), 'a column of nothing')
    call empty%get_field('damage', field, fault)
    call expect(error, allocated(fault) .and. empty%field_number('damage') == 0, &
      & 'a field of nothing')
  end subroutine test_names

  !> A list of size 0 means no fields, and is not taken for the default ones.
  subroutine test_no_fields(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    type(answer_type) :: answer

    call flight(scene)
    allocate (scene%output%fields(0))
    call run_scene(scene, quietly(''), fault, answer=answer)
    call accept(error, fault)
    if (allocated(error)) return
    call check(error, size(answer%fields), 0, 'fields')
    if (.not. allocated(error)) call check(error, size(answer%history, 1), 5, 'rows')
  end subroutine test_no_fields

end module test_library
