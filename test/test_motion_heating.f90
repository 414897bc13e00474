!> Temperature changes that vary in time, and warnings about courses.
module test_motion_heating
  use pd_base_kinds, only: wp
  use pd_base_error, only: fault_type => error_type
  use pd_set_up_memory, only: predicted_memory
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: scene_type
  use comparisons, only: max_abs
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: prepare_run, box_scene, diary_type, expect, expect_true, ready, ready_alone, &
    & youngs_modulus
  implicit none (type, external)
  private
  public :: collect_motion_heating

  real(wp), parameter :: spacing = 1.0e-2_wp
  real(wp), parameter :: alpha = 1.2e-5_wp   !! thermal expansion of every test's material [1/K]

contains

  subroutine collect_motion_heating(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a held bar is heated over the load steps', test_load_steps), &
      & new_unittest('a table of temperatures in statics', test_table), &
      & new_unittest('heating does work on a body: the energies balance', test_balance), &
      & new_unittest('a constant course changes nothing', test_constant), &
      & new_unittest('warnings about courses', test_warnings), &
      & new_unittest('the predicted memory', test_memory)]
  end subroutine collect_motion_heating

  !> A bar of 12 points, held by layers at both ends, without surface correction.
  subroutine held_bar(scene)
    type(scene_type), intent(out) :: scene

    call box_scene([12], spacing, 0.0_wp, scene)
    scene%materials(1)%thermal_expansion = alpha
    deallocate (scene%initial, scene%boundaries)
    allocate (scene%initial(1), scene%boundaries(2))
    scene%initial(1)%temperature_change = 100.0_wp
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(2)%side = 'x_max'
    scene%boundaries%displacement(1) = 0.0_wp
    scene%time%method = 'relaxation'
  end subroutine held_bar

  !> The force across a section of the held bar at full heat [N]: nothing moves, so every bond
  !> of length i spacings has the stretch -alpha dT, and i of them cross a section. With a horizon
  !> of 3.015 spacings their linear volume corrections are 1, 1 and 0.515.
  pure real(wp) function exact_reaction(scene) result(force)
    type(scene_type), intent(in) :: scene
    real(wp), parameter :: ratio = 3.015_wp
    force = 2*youngs_modulus*scene%header%area/ratio**2*(1 + 2 + 3*(ratio + 0.5_wp - 3)) &
      & *alpha*scene%initial(1)%temperature_change
  end function exact_reaction

  !> The reaction grows in proportion to the load factor, and the work of heating is the energy. The
  !> answer is linear in the temperature; the tolerance is that of the relaxation.
  subroutine test_load_steps(error)
    type(error_type), allocatable, intent(out) :: error
    character(18), parameter :: solvers(2) = [character(18) :: 'conjugate_gradient', &
      & 'dynamic_relaxation']
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    integer :: s, i

    do s = 1, size(solvers)
      call held_bar(scene)
      scene%relaxation%solver = solvers(s)
      scene%relaxation%load_steps = 4
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      diary = diary_type(every=0)
      call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      if (allocated(error)) return
      call expect(error, set_up%system%motions(1)%reaction(1), exact_reaction(scene), &
        & 1.0e-6_wp*exact_reaction(scene), 'reaction, '//solvers(s))
      call expect_true(error, diary%settled == 4, 'load steps')
      do i = 1, diary%n
        associate (factor => diary%time(i))
          ! 1/2 sigma^2/E of the crossing bonds, so the square of the factor
          call expect(error, diary%strain(i), factor**2*diary%strain(diary%n), &
            & 1.0e-6_wp*diary%strain(diary%n), 'strain energy, '//solvers(s))
          call expect(error, diary%work(i), diary%strain(i), 1.0e-6_wp*diary%strain(diary%n), &
            & 'work of heating, '//solvers(s))
        end associate
      end do
      call expect_true(error, diary%n == 5 .and. diary%strain(diary%n) > 0.0_wp, 'rows')
    end do
  end subroutine test_load_steps

  !> Up to twice the temperature and back to half of it.
  subroutine test_table(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault

    call held_bar(scene)
    scene%initial(1)%times = [0.0_wp, 0.5_wp, 1.0_wp]
    scene%initial(1)%values = [0.0_wp, 2.0_wp, 0.5_wp]
    scene%relaxation%load_steps = 2
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    diary = diary_type(every=0)
    call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    call expect(error, set_up%system%motions(1)%reaction(1), exact_reaction(scene)/2, &
      & 1.0e-6_wp*exact_reaction(scene), 'reaction')
    call expect(error, diary%strain(2), 16*diary%strain(3), 1.0e-5_wp*diary%strain(2), &
      & 'energy at the highest temperature')
    call expect(error, diary%work(3), diary%strain(3), 1.0e-6_wp*diary%strain(2), &
      & 'work of heating and cooling')
  end subroutine test_table

  !> Free bodies that a ramp heats: kinetic and strain energy are the work of heating. The imbalance
  !> falls with the square of the step, lattices and lists.
  subroutine test_balance(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: points(3) = [9, 6, 5], steps(2) = [60, 120]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: off(:)
    real(wp) :: worst(2), time
    integer :: dim, i

    do dim = 1, 3
      call box_scene(points(:dim), spacing, 0.3_wp, scene)
      scene%materials(1)%thermal_expansion = alpha
      scene%horizon%surface_correction = 'energy'
      scene%horizon%dilatation = 'unprojected'
      if (dim == 2) scene%horizon%family = 'list'
      deallocate (scene%initial)
      allocate (scene%initial(1))
      scene%initial(1)%temperature_change = 100.0_wp
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      time = 20*set_up%plan%limit
      scene%initial(1)%ramp_time = time/2
      do i = 1, 2
        call ready_alone(scene, set_up, error)
        if (allocated(error)) return
        diary = diary_type()
        call run_explicit(set_up%system, 'velocity_verlet', time/steps(i), steps(i), diary, fault)
        if (allocated(fault)) call test_failed(error, fault%message)
        if (allocated(error)) return
        off = diary%kinetic + diary%strain - diary%work
        worst(i) = max_abs(off)/maxval(diary%strain)
        call expect_true(error, all(abs(off) <= 1.0e-2_wp*maxval(diary%strain)), 'imbalance')
      end do
      call expect_true(error, diary%work(diary%n) > 0.1_wp*maxval(diary%strain), 'nothing works')
      call expect(error, log(worst(1)/worst(2))/log(2.0_wp), 2.0_wp, 0.25_wp, &
        & 'order of the imbalance')
    end do
  end subroutine test_balance

  !> A table that is 1 all the time computes as no table does.
  subroutine test_constant(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up

    call box_scene([6, 5], spacing, 0.3_wp, scene)
    scene%materials(1)%thermal_expansion = alpha
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%temperature_change = 100.0_wp
    scene%initial(1)%times = [0.0_wp, 1.0_wp]
    scene%initial(1)%values = [1.0_wp, 1.0_wp]
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expect_true(error, .not. allocated(set_up%system%heating%curves), 'a course that is none')
    call expect_true(error, all(abs(set_up%system%model%expansion(set_up%system%body%slot) &
      & - alpha*100) <= 1.0e-18_wp), 'thermal strain')
  end subroutine test_constant

  !> Each warning with a scene that has it and one that must not.
  subroutine test_warnings(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: bar = '&scene dimension = 1 /&body lower = 0 upper = 1 points = 20 /'
    character(*), parameter :: cold = bar//'&material youngs_modulus = 1e9 density = 1000 /'
    character(*), parameter :: still = cold//"&time method = 'relaxation' /"// &
      & "&boundary side = 'x_min' displacement_x = 0 /"
    character(*), parameter :: hot = '&initial temperature_change = 10 /'

    call expect_warning(still//"&boundary side = 'x_max' velocity_x = 1e-3 /", &
      & 'displaces its points by 500 um', .true.)
    call expect_warning(still//"&boundary side = 'x_max' velocity_x = 0 /", 'displaces', .false.)
    call expect_warning(still//'&initial velocity_x = 1 /', 'have no effect', .true.)
    call expect_warning(still//'&initial displacement_x = 1e-3 /', 'have no effect', .false.)
    call expect_warning(cold//hot//'&time steps = 1 /', 'does not expand', .true.)
    call expect_warning(bar//'&material youngs_modulus = 1e9 density = 1 thermal_expansion = 0 /' &
      & //hot//'&time steps = 1 /', 'does not expand', .false.)
    call expect_warning(cold//"&load side = 'x_max' pressure = 1 ramp_time = 1 /"// &
      & '&time duration = 1e-3 /', 'before the course of &load number 1', .true.)
    call expect_warning(cold//"&load side = 'x_max' pressure = 1 ramp_time = 1e-3 /"// &
      & '&time duration = 1e-3 /', 'before the course', .false.)

  contains

    subroutine expect_warning(text, words, there)
      character(*), intent(in) :: text, words
      logical, intent(in) :: there
      type(scene_type) :: scene
      type(set_up_type) :: set_up
      type(fault_type), allocatable :: fault

      if (allocated(error)) return
      call read_scene_text(text, 'warned.nml', scene, fault)
      if (.not. allocated(fault)) call prepare_run(scene, set_up, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      call expect_true(error, index(set_up%warnings%text(), words) > 0 .eqv. there, &
        & merge('no warning of ', 'a warning of  ', there)//words//': '//set_up%warnings%text())
    end subroutine expect_warning

  end subroutine test_warnings

  !> Largest resident sets of runs of 2e5 points less the program's own, measured with two threads:
  !> regression, within a factor of 1.5. That no scene is refused which needs a third of it follows.
  subroutine test_memory(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: points(3) = [200000, 450, 60]
    real(wp), parameter :: lattice(3) = [165.0_wp, 281.0_wp, 502.0_wp]  ! bytes a point
    real(wp), parameter :: list(3) = [362.0_wp, 490.0_wp, 785.0_wp]
    real(wp), parameter :: exact(3) = [441.0_wp, 892.0_wp, 3055.0_wp]
    real(wp), parameter :: two_laws(3) = [362.0_wp, 1193.0_wp, 4456.0_wp]
    real(wp), parameter :: two_in_list(3) = [393.0_wp, 1267.0_wp, 4617.0_wp]
    real(wp), parameter :: softening(3) = [490.0_wp, 1572.0_wp, 5598.0_wp]
    real(wp), parameter :: program = 18.5e6_wp
    type(scene_type) :: scene
    integer :: dim

    do dim = 1, 3
      call box_scene(spread(points(dim), 1, dim), spacing, 0.2_wp, scene)
      call expect_memory(lattice(dim), 'lattice')
      scene%horizon%family = 'list'
      call expect_memory(list(dim), 'list')
      scene%horizon%volume_correction = 'exact'
      call expect_memory(exact(dim), 'exact volumes')
      scene%horizon%volume_correction = 'linear'
      scene%materials = [scene%materials(1), scene%materials(1)]
      scene%materials(2)%model = 'lps'
      call expect_memory(two_in_list(dim), 'two laws, list')
      scene%horizon%family = 'lattice'
      call expect_memory(two_laws(dim), 'two laws, lattice')
      scene%materials%model = [character(64) :: 'lps', 'softening']
      scene%materials%critical_stretch = 0.05_wp
      call expect_memory(softening(dim), 'two laws, one of which has a history')
    end do

  contains

    subroutine expect_memory(per_point, what)
      real(wp), intent(in) :: per_point
      character(*), intent(in) :: what
      real(wp) :: measured

      measured = program + per_point*real(points(dim), wp)**dim
      call expect(error, log(predicted_memory(scene)/measured), 0.0_wp, log(1.5_wp), what)
    end subroutine expect_memory

  end subroutine test_memory

end module test_motion_heating
