!> Conditions that are expressions: against numbers, courses and closed forms.
module test_motion_expressions
  use omp_lib, only: omp_set_num_threads
  use pd_base_error, only: fault_type => error_type, status_input, status_no_answer
  use pd_base_kinds, only: wp
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_scene_content_types, only: scene_type, unset
  use pd_body_regions, only: region_mask
  use pd_set_up_prepare, only: set_up_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  use bodies, only: at_point, box_scene, density_of_steel, diary_type, expect, expect_true, &
    & prepare_run, ready, ready_alone, youngs_modulus
  use test_scene_expect, only: expect_parts
  implicit none (type, external)
  private
  public :: collect_motion_expressions

  real(wp), parameter :: spacing = 1.0e-2_wp

contains

  subroutine collect_motion_expressions(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('constant expressions have the bits of numbers', test_constants), &
      & new_unittest('what lacks t has the bits of gradients', test_gradients), &
      & new_unittest('expressions of t are ramps', test_ramps), &
      & new_unittest('imposed motion follows closed forms', test_closed_forms), &
      & new_unittest('the reaction accelerates a free layer', test_reaction), &
      & new_unittest('energies balance', test_balance), &
      & new_unittest('a bar under a body force that varies along it', test_bar), &
      & new_unittest('forces and pressures over the load factor', test_load_factor), &
      & new_unittest('heat over the load factor', test_heat), &
      & new_unittest('heating does work', test_heating_balance), &
      & new_unittest('regions by expressions', test_regions), &
      & new_unittest('values that are not finite', test_not_finite), &
      & new_unittest('the same bits on any number of threads', test_threads)]
  end subroutine collect_motion_expressions

  !> A plate of 12 x 8 points with two moved sides and loads on all points.
  subroutine plate(scene)
    type(scene_type), intent(out) :: scene

    call box_scene([12, 8], spacing, 0.3_wp, scene)
    deallocate (scene%initial, scene%boundaries, scene%loads, scene%regions)
    allocate (scene%initial(1), scene%boundaries(2), scene%loads(2), scene%regions(1))
    scene%regions(1)%name = 'all'
    scene%regions(1)%shape = 'box'
    scene%regions(1)%lower(1) = -1.0_wp
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(2)%side = 'x_max'
    scene%loads(1)%region = 'all'
    scene%loads(2)%side = 'y_max'
    scene%loads(2)%body = 'box'
    scene%time%steps = 20
  end subroutine plate

  !> Run a scene; its final displacements in point order.
  subroutine final_u(scene, u, error, integrator, work)
    type(scene_type), intent(in) :: scene
    real(wp), allocatable, intent(out) :: u(:, :)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in), optional :: integrator
    real(wp), intent(out), optional :: work
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    character(:), allocatable :: scheme

    allocate (u(0, 0))
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    diary = diary_type()
    scheme = 'velocity_verlet'
    if (present(integrator)) scheme = integrator
    if (scene%time%method == 'relaxation') then
      diary%every = 0
      call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
    else
      call run_explicit(set_up%system, scheme, set_up%plan%step, set_up%plan%steps, diary, fault)
    end if
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    u = set_up%system%state%u(set_up%system%body%slot, :)
    if (present(work)) work = set_up%system%external_work
  end subroutine final_u

  subroutine test_constants(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    real(wp), allocatable :: numbers(:, :), texts(:, :)

    call plate(scene)
    scene%initial(1)%velocity(1) = 3.0_wp
    scene%boundaries(1)%displacement(1) = 1.0e-5_wp
    scene%boundaries(2)%velocity(1) = 20.0_wp
    scene%loads(1)%body_force(2) = 1.0e7_wp
    scene%loads(2)%pressure = 1.0e6_wp
    call final_u(scene, numbers, error)
    scene%initial(1)%velocity(1) = unset
    scene%boundaries(1)%displacement(1) = unset
    scene%boundaries(2)%velocity(1) = unset
    scene%loads(1)%body_force(2) = unset
    scene%loads(2)%pressure = unset
    scene%initial(1)%velocity_text(1) = '9/3'
    scene%boundaries(1)%displacement_text(1) = '1e-5'
    scene%boundaries(2)%velocity_text(1) = '2*10'
    scene%loads(1)%body_force_text(2) = '1e7'
    scene%loads(2)%pressure_text = '1e6'
    call final_u(scene, texts, error)
    call expect_close(error, texts, numbers, 0.0_wp, 'displacements')
    call expect_true(error, max_abs(numbers) > 1.0e-5_wp, 'nothing moves')
  end subroutine test_constants

  subroutine test_gradients(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    real(wp), allocatable :: numbers(:, :), texts(:, :)

    call plate(scene)
    scene%boundaries(1)%displacement(1) = 0.0_wp
    scene%boundaries(2)%displacement(1) = 0.0_wp
    scene%loads(1)%body_force(1) = 0.0_wp
    scene%loads(2)%body_force(1) = 0.0_wp
    scene%initial(1)%velocity_gradient(2, 1) = 50.0_wp
    call final_u(scene, numbers, error)
    scene%initial(1)%velocity_gradient = 0.0_wp
    scene%initial(1)%velocity_text(2) = '50*x'
    call final_u(scene, texts, error)
    call expect_close(error, texts, numbers, 0.0_wp, 'displacements')
    call expect_true(error, max_abs(numbers) > 1.0e-6_wp, 'nothing moves')
  end subroutine test_gradients

  !> All keys with a linear course, by `ramp_time` and by expressions of t: equal to rounding.
  subroutine test_ramps(error)
    type(error_type), allocatable, intent(out) :: error
    character(16), parameter :: integrators(4) = [character(16) :: 'forward_backward', &
      & 'velocity_verlet', 'adams_moulton', 'runge_kutta']
    type(scene_type) :: scene
    real(wp), allocatable :: numbers(:, :), texts(:, :)
    real(wp) :: work(2)
    integer :: i

    do i = 1, size(integrators)
      call plate(scene)
      scene%time%steps = 20
      scene%boundaries(1)%displacement(1) = 1.0e-5_wp
      scene%boundaries(2)%velocity(1) = 20.0_wp
      scene%boundaries%ramp_time = 1.0e-3_wp
      scene%loads(1)%body_force(2) = 1.0e9_wp
      scene%loads(2)%pressure = 1.0e8_wp
      scene%loads(2)%force(1) = 1.0e5_wp
      scene%loads%ramp_time = 1.0e-3_wp
      call final_u(scene, numbers, error, trim(integrators(i)), work(1))
      call plate(scene)
      scene%time%steps = 20
      scene%boundaries(1)%displacement_text(1) = '1e-2*t'
      scene%boundaries(2)%velocity_text(1) = '2e4*t'
      scene%loads(1)%body_force_text(2) = '1e12*t'
      scene%loads(2)%pressure_text = '1e11*t'
      scene%loads(2)%force_text(1) = '1e8*t'
      call final_u(scene, texts, error, trim(integrators(i)), work(2))
      if (allocated(error)) return
      call expect_close(error, texts, numbers, 1.0e-12_wp*max_abs(numbers), 'displacements, '// &
        & integrators(i))
      call expect(error, work(2), work(1), 1.0e-12_wp*work(1), 'work, '//integrators(i))
      call expect_true(error, work(1) > 0.0_wp, 'no work')
    end do
  end subroutine test_ramps

  !> Displacements and velocities of the moved points after 40 steps.
  subroutine test_closed_forms(error)
    type(error_type), allocatable, intent(out) :: error
    character(16), parameter :: integrators(3) = [character(16) :: 'velocity_verlet', &
      & 'adams_bashforth', 'runge_kutta']
    real(wp), parameter :: w = 2.0e5_wp
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: t, x
    integer :: i, k, s

    do s = 1, size(integrators)
      call plate(scene)
      deallocate (scene%loads)
      allocate (scene%loads(0))
      scene%boundaries(1)%displacement_text(1) = '1e-6*sin(2e5*t)*(1 + y)'
      scene%boundaries(2)%velocity_text(1) = '0.2*cos(2e5*t)*(1 + y)'
      scene%time%steps = 40
      scene%time%integrator = integrators(s)
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      diary = diary_type()
      call run_explicit(set_up%system, trim(integrators(s)), set_up%plan%step, 40, diary, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      if (allocated(error)) return
      t = 40*set_up%plan%step
      do k = 1, 2
        associate (motion => set_up%system%motions(k), state => set_up%system%state)
          do i = 1, size(motion%slots)
            x = 1 + set_up%system%body%x(motion%slots(i), 2)
            call expect(error, state%v(motion%slots(i), 1), 0.2_wp*cos(w*t)*x, 1.0e-13_wp, &
              & 'velocity')
            ! the error of Gauss's rule in a step is at most V dt (w dt)^6/2016000
            call expect(error, state%u(motion%slots(i), 1), 1.0e-6_wp*sin(w*t)*x, &
              & merge(1.0e-19_wp, 0.2_wp*x*t*(w*t/40)**6/2016000, k == 1), 'displacement')
          end do
        end associate
      end do
    end do
  end subroutine test_closed_forms

  !> A body that moves as a whole, all its points imposed: the reaction is mass times acceleration.
  subroutine test_reaction(error)
    type(error_type), allocatable, intent(out) :: error
    character(40), parameter :: texts(2) = [character(40) :: '1e-6*sin(2e5*t)', '0.2*cos(2e5*t)']
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: mass, t
    integer :: i

    do i = 1, 2
      call box_scene([6], spacing, 0.0_wp, scene)
      deallocate (scene%boundaries, scene%regions)
      allocate (scene%boundaries(1), scene%regions(1))
      scene%regions(1)%name = 'all'
      scene%regions(1)%where = '1'
      scene%boundaries(1)%region = 'all'
      if (i == 1) scene%boundaries(1)%displacement_text(1) = texts(i)
      if (i == 2) scene%boundaries(1)%velocity_text(1) = texts(i)
      scene%time%steps = 10
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      diary = diary_type()
      call run_explicit(set_up%system, 'velocity_verlet', set_up%plan%step, 10, diary, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      if (allocated(error)) return
      t = 10*set_up%plan%step
      mass = 6*spacing*scene%header%area*density_of_steel
      call expect(error, set_up%system%motions(1)%reaction(1), -mass*4.0e4_wp*sin(2.0e5_wp*t), &
        & 1.0e-6_wp*mass*4.0e4_wp, 'reaction')
      call expect(error, set_up%system%external_work, mass/2*(0.2_wp**2)*(cos(2.0e5_wp*t)**2 &
        & - 1), 1.0e-9_wp*mass, 'work: the change of kinetic energy')
    end do
  end subroutine test_reaction

  !> Kinetic and strain energy are the work of all conditions; the imbalance is of second order.
  subroutine test_balance(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: steps(2) = [60, 120]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: off(:)
    real(wp) :: worst(2), time
    integer :: i

    call plate(scene)
    scene%horizon%dilatation = 'unprojected'
    scene%boundaries(1)%displacement_text(1) = '1e-6*(1 - cos(1e5*t))'
    scene%boundaries(2)%velocity_text(1) = '0.3*sin(2e5*t)*(1 + y)'
    scene%loads(1)%body_force_text(2) = '1e7*sin(1e5*t)*x'
    scene%loads(2)%pressure_text = '1e6*t*1e5*exp(-x)'
    do i = 1, 2
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      time = 30*set_up%plan%limit
      diary = diary_type()
      call run_explicit(set_up%system, 'velocity_verlet', time/steps(i), steps(i), diary, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      if (allocated(error)) return
      off = diary%kinetic + diary%strain - diary%work
      worst(i) = max_abs(off)/maxval(diary%kinetic + diary%strain)
    end do
    call expect_true(error, worst(1) < 1.0e-2_wp .and. worst(1) > 0.0_wp, 'imbalance')
    call expect(error, log(worst(1)/worst(2))/log(2.0_wp), 2.0_wp, 0.3_wp, 'order of the imbalance')
  end subroutine test_balance

  !> u' = b (L^2 - x^2)/2E for the body force b x, of which the support bears b L^2/2. Points at the
  !> ends have fewer bonds: the displacement of the free end is off by some rows in 200.
  subroutine test_bar(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 200
    real(wp), parameter :: b = 1.0e6_wp, length = n*spacing
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: exact

    call box_scene([n], spacing, 0.0_wp, scene)
    deallocate (scene%boundaries, scene%loads, scene%regions)
    allocate (scene%boundaries(1), scene%loads(1), scene%regions(1), scene%definitions(1))
    scene%regions(1)%name = 'all'
    scene%regions(1)%where = 'x > 0'
    scene%definitions(1)%name = 'b'
    scene%definitions(1)%value = b
    scene%horizon%surface_correction = 'energy'
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%displacement(1) = 0.0_wp
    scene%loads(1)%region = 'all'
    scene%loads(1)%body_force_text(1) = 'b*x'
    scene%time%method = 'relaxation'
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    diary = diary_type(every=0)
    call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    associate (system => set_up%system)
      exact = b*length**3/(3*youngs_modulus)
      call expect(error, system%state%u(at_point(system%body, [length]), 1), exact, 0.02_wp*exact, &
        & 'displacement of the free end')
      exact = b*(length/2)*(length**2 - (length/2)**2/3)/(2*youngs_modulus)
      call expect(error, system%state%u(at_point(system%body, [length/2]), 1), exact, &
        & 0.02_wp*exact, 'displacement of the middle')
      ! sum of x over midpoints is the integral
      exact = b*length**2/2*scene%header%area
      call expect(error, system%motions(1)%reaction(1), -exact, 1.0e-6_wp*exact, 'reaction')
    end associate
  end subroutine test_bar

  !> The load factor as t: proportional loads are the default ramp, and t^2 ends at the same state.
  subroutine test_load_factor(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    real(wp), allocatable :: ramp(:, :), linear(:, :), square(:, :)

    call pulled('', '')
    call final_u(scene, ramp, error)
    call pulled('1e5*t', '1e-6*t')
    call final_u(scene, linear, error)
    call pulled('1e5*t^2', '1e-6*t^3')
    call final_u(scene, square, error)
    if (allocated(error)) return
    call expect_close(error, linear, ramp, 1.0e-6_wp*max_abs(ramp), 'a linear course')
    call expect_close(error, square, ramp, 1.0e-5_wp*max_abs(ramp), 'a square course')

  contains

    subroutine pulled(pressure, displacement)
      character(*), intent(in) :: pressure, displacement

      call box_scene([12, 8], spacing, 0.3_wp, scene)
      deallocate (scene%boundaries, scene%loads)
      allocate (scene%boundaries(2), scene%loads(1))
      scene%boundaries(1)%side = 'x_min'
      scene%boundaries(1)%displacement(:2) = 0.0_wp
      scene%boundaries(2)%side = 'x_max'
      scene%loads(1)%side = 'y_max'
      scene%loads(1)%body = 'box'
      if (pressure == '') then
        scene%boundaries(2)%displacement(1) = 1.0e-6_wp
        scene%loads(1)%pressure = 1.0e5_wp
      end if
      scene%boundaries(2)%displacement_text(1) = displacement
      scene%loads(1)%pressure_text = pressure
      scene%time%method = 'relaxation'
      scene%relaxation%load_steps = 3
      scene%relaxation%tolerance = 1.0e-10_wp
    end subroutine pulled
  end subroutine test_load_factor

  !> A held bar that is heated by 100 K t is the one with the default ramp; the work is its energy.
  subroutine test_heat(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: reaction(3), work(3), strain(3)
    integer :: i

    do i = 1, 3
      call box_scene([12], spacing, 0.0_wp, scene)
      scene%materials(1)%thermal_expansion = 1.2e-5_wp
      deallocate (scene%initial, scene%boundaries)
      allocate (scene%initial(1), scene%boundaries(2))
      if (i == 1) scene%initial(1)%temperature_change = 100.0_wp
      if (i == 2) scene%initial(1)%temperature_text = '100*t'
      if (i == 3) scene%initial(1)%temperature_text = '100 + 0*x'
      scene%boundaries(1)%side = 'x_min'
      scene%boundaries(2)%side = 'x_max'
      scene%boundaries%displacement(1) = 0.0_wp
      scene%time%method = 'relaxation'
      scene%relaxation%load_steps = 4
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      diary = diary_type(every=0)
      call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      if (allocated(error)) return
      reaction(i) = set_up%system%motions(1)%reaction(1)
      work(i) = diary%work(diary%n)
      strain(i) = diary%strain(diary%n)
    end do
    call expect_close(error, reaction(2:), reaction(1), 1.0e-10_wp*abs(reaction(1)), 'reaction')
    call expect_close(error, strain(2:), strain(1), 1.0e-10_wp*strain(1), 'strain energy')
    call expect_close(error, work, strain(1), 1.0e-6_wp*strain(1), 'work')
    call expect_true(error, strain(1) > 0.0_wp, 'nothing is strained')
  end subroutine test_heat

  !> A plate that is heated from one side: energies balance to second order in the step.
  subroutine test_heating_balance(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: steps(2) = [60, 120]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: off(:)
    real(wp) :: worst(2), time
    integer :: i

    call box_scene([9, 6], spacing, 0.3_wp, scene)
    scene%materials(1)%thermal_expansion = 1.2e-5_wp
    scene%horizon%dilatation = 'unprojected'
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%temperature_text = '100*(1 - exp(-1e5*t))*(1 + 10*x)'
    do i = 1, 2
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      time = 20*set_up%plan%limit
      diary = diary_type()
      call run_explicit(set_up%system, 'velocity_verlet', time/steps(i), steps(i), diary, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      if (allocated(error)) return
      off = diary%kinetic + diary%strain - diary%work
      worst(i) = max_abs(off)/maxval(diary%strain)
    end do
    call expect_true(error, worst(1) < 1.0e-2_wp .and. worst(1) > 0.0_wp, 'imbalance')
    call expect(error, log(worst(1)/worst(2))/log(2.0_wp), 2.0_wp, 0.3_wp, 'order of the imbalance')
    call expect_true(error, diary%work(diary%n) > 0.1_wp*maxval(diary%strain), 'nothing works')
  end subroutine test_heating_balance

  subroutine test_regions(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    logical, allocatable :: by_shape(:), by_text(:), both(:)

    call box_scene([40, 30], spacing, 0.3_wp, scene)
    deallocate (scene%regions)
    allocate (scene%regions(3))
    scene%regions(1)%name = 'shape'
    scene%regions(1)%shape = 'sphere'
    scene%regions(1)%centre(:2) = [0.2_wp, 0.1_wp]
    scene%regions(1)%radius = 0.0777_wp
    scene%regions(2)%name = 'text'
    scene%regions(2)%where = '(x - 0.2)^2 + (y - 0.1)^2 < 0.0777^2'
    scene%regions(3) = scene%regions(1)
    scene%regions(3)%name = 'both'
    scene%regions(3)%where = 'x < 0.2'
    call ready(scene, set_up, error)
    if (allocated(error)) return
    by_shape = region_mask(scene, set_up%system%body, 'shape')
    by_text = region_mask(scene, set_up%system%body, 'text')
    both = region_mask(scene, set_up%system%body, 'both')
    call check(error, all(by_shape .eqv. by_text), 'a disc')
    if (allocated(error)) return
    call check(error, all(both .eqv. (by_shape .and. set_up%system%body%x(:, 1) < 0.2_wp)), 'half')
    if (allocated(error)) return
    call check(error, count(by_text) > 150 .and. count(both) > 60, 'too few points')
  end subroutine test_regions

  !> Before a run the input is at fault, during it there is no answer; both name point and time.
  subroutine test_not_finite(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    character(18), parameter :: keys(4) = [character(18) :: 'body_force_x', 'displacement_y', &
      & 'velocity_y', 'temperature_change']
    integer :: i

    do i = 1, 5
      call plate(scene)
      scene%loads(2)%pressure = 0.0_wp
      select case (i)
      case (1); scene%initial(1)%velocity_text(1) = '1/(x - 0.055)'
      case (2); scene%loads(1)%body_force_text(1) = 'log(0.05 - x)'
      case (3); scene%boundaries(2)%displacement_text(2) = 'sqrt(-t - y)'
      case (4); scene%regions(1)%where = '1/(y - 0.015)'
      case default; scene%initial(1)%temperature_text = 't/0'
      end select
      scene%materials(1)%thermal_expansion = 1.0e-5_wp
      call prepare_run(scene, set_up, fault)
      call expect_parts(error, fault, 'no finite value at point|m, t = 0 s|('//trim(merge( &
        & '0.055, 0.005', '            ', i == 1)))
      if (allocated(error)) return
      call check(error, fault%status, status_input)
      if (allocated(error)) return
    end do
    do i = 1, 4
      call plate(scene)
      scene%loads(2)%pressure = 0.0_wp
      select case (i)
      case (1); scene%loads(1)%body_force_text(1) = '1/(t < 1e-6)'
      case (2); scene%boundaries(2)%displacement_text(2) = 'sqrt(1e-6 - t)*y'
      case (3); scene%boundaries(2)%velocity_text(2) = 'log(1e-6 - t)'
      case default; scene%initial(1)%temperature_text = 'if(x > 0.05, sqrt(1e-6 - t), 1)'
      end select
      scene%materials(1)%thermal_expansion = 1.0e-5_wp
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      diary = diary_type()
      call run_explicit(set_up%system, 'velocity_verlet', set_up%plan%step, 20, diary, fault)
      call expect_parts(error, fault, trim(keys(i))//' of &|has no finite value at point|m, t = ')
      if (allocated(error)) return
      call check(error, fault%status, status_no_answer)
      if (allocated(error)) return
    end do
  end subroutine test_not_finite

  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: first(:, :)
    integer :: threads

    call box_scene([120, 100], spacing, 0.3_wp, scene)
    deallocate (scene%initial, scene%boundaries, scene%loads, scene%regions)
    allocate (scene%initial(1), scene%boundaries(1), scene%loads(1), scene%regions(1))
    scene%regions(1)%name = 'all'
    scene%regions(1)%where = 'sin(x) > -2'
    scene%initial(1)%velocity_text(1) = 'sin(10*x)*exp(-y)'
    scene%initial(1)%temperature_text = '10*sin(1e6*t)*cos(x)'
    scene%materials(1)%thermal_expansion = 1.0e-5_wp
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%velocity_text(1) = 'sin(1e5*t)*y'
    scene%loads(1)%region = 'all'
    scene%loads(1)%body_force_text(2) = '1e7*sin(1e6*t + x)*exp(-y)'
    do threads = 1, 3
      call ready(scene, set_up, error)
      call omp_set_num_threads(threads)
      if (allocated(error)) return
      diary = diary_type()
      call run_explicit(set_up%system, 'velocity_verlet', set_up%plan%step, 3, diary, fault)
      call omp_set_num_threads(1)
      if (allocated(fault)) call test_failed(error, fault%message)
      if (allocated(error)) return
      if (threads == 1) first = set_up%system%state%u
      call expect_close(error, set_up%system%state%u, first, 0.0_wp, 'displacements')
    end do
  end subroutine test_threads

end module test_motion_expressions
