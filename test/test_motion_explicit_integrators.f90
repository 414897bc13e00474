!> Integrators: order of convergence, limits of stability, and the exact motion of discrete systems.
module test_motion_explicit_integrators
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: pi
  use pd_base_error, only: fault_type => error_type, status_no_answer
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_explicit_time_step, only: integrator_limit
  use pd_scene_content_types, only: scene_type
  use comparisons, only: max_abs
  use testdrive, only: error_type, new_unittest, unittest_type, test_failed
  use bodies, only: at_point, box_scene, density_of_steel, diary_type, expect, expect_true, ready, &
    & text_of, youngs_modulus
  implicit none (type, external)
  private
  public :: collect_motion_explicit_integrators

  character(16), parameter :: integrators(*) = [character(16) :: 'forward_backward', &
    & 'velocity_verlet', 'adams_bashforth', 'adams_moulton', 'runge_kutta']
  real(wp), parameter :: orders(*) = [2.0_wp, 2.0_wp, 3.0_wp, 2.0_wp, 4.0_wp]

contains

  subroutine collect_motion_explicit_integrators(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('orders of convergence in time', test_orders), &
      & new_unittest('orders hold under imposed motion and loads', test_driven_orders), &
      & new_unittest('stable up to the stated limits, unstable above', test_limits), &
      & new_unittest('an oscillator moves as leapfrog''s formula says', test_oscillator), &
      & new_unittest('waves in a chain have the discrete frequency', test_dispersion), &
      & new_unittest('free flight is exact', test_flight), &
      & new_unittest('a diverged run is an error with step and point', test_unstable)]
  end subroutine collect_motion_explicit_integrators

  !> A plate that moves smoothly and not linearly: initial velocities and displacements of long
  !> waves.
  subroutine smooth_plate(driven, scene)
    logical, intent(in) :: driven
    type(scene_type), intent(out) :: scene

    call box_scene([6, 5], 1.0e-3_wp, 0.2_wp, scene)
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%displacement_gradient(:2, :2) = reshape([0.02_wp, 0.01_wp, -0.005_wp, &
      & -0.01_wp], [2, 2])
    scene%initial(1)%velocity_gradient(:2, :2) = reshape([1.0e4_wp, -2.0e4_wp, 1.0e4_wp, &
      & 2.0e4_wp], [2, 2])
    if (.not. driven) return
    deallocate (scene%boundaries, scene%loads)
    allocate (scene%boundaries(1), scene%loads(1))
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%velocity(1) = 20.0_wp
    scene%boundaries(1)%ramp_time = 1.0e-4_wp
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%pressure = 5.0e10_wp
    scene%loads(1)%ramp_time = 1.0e-4_wp
  end subroutine smooth_plate

  !> Displacements after `time` in `steps` steps.
  subroutine run(scene, integrator, time, steps, u, error)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: integrator
    real(wp), intent(in) :: time
    integer, intent(in) :: steps
    real(wp), allocatable, intent(out) :: u(:, :)
    type(error_type), allocatable, intent(inout) :: error
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault

    call ready(scene, set_up, error)
    if (allocated(error)) return
    diary%every = steps
    call run_explicit(set_up%system, integrator, time/steps, steps, diary, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    u = set_up%system%state%u
  end subroutine run

  subroutine test_orders(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    call smooth_plate(.false., scene)
    call measure_orders(scene, error)
  end subroutine test_orders

  subroutine test_driven_orders(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    call smooth_plate(.true., scene)
    call measure_orders(scene, error)
  end subroutine test_driven_orders

  !> log2 of the error's quotient when the step is halved, against Runge-Kutta with an eighth of the
  !> finer step (4000 times as exact as its own result). The next term of the error is smaller by
  !> omega dt, here some 0.1 for the motion's main frequencies: so the order is met to 0.2.
  subroutine measure_orders(scene, error)
    type(scene_type), intent(in) :: scene
    type(error_type), allocatable, intent(inout) :: error
    type(set_up_type) :: set_up
    real(wp), allocatable :: truth(:, :), coarse(:, :), fine(:, :)
    real(wp) :: time, order
    integer :: i
    integer, parameter :: steps = 160

    call ready(scene, set_up, error)
    if (allocated(error)) return
    time = 20*set_up%plan%limit
    call run(scene, 'runge_kutta', time, 16*steps, truth, error)
    if (allocated(error)) return
    do i = 1, size(integrators)
      call run(scene, trim(integrators(i)), time, steps, coarse, error)
      call run(scene, trim(integrators(i)), time, 2*steps, fine, error)
      if (allocated(error)) return
      order = log(norm2(coarse - truth)/norm2(fine - truth))/log(2.0_wp)
      call expect(error, order, orders(i), 0.2_wp, 'order of '//trim(integrators(i)))
      ! and it converges to the same thing
      call expect(error, norm2(fine - truth)/norm2(truth), 0.0_wp, 1.0e-3_wp, 'error of ' &
        & //trim(integrators(i)))
    end do
  end subroutine measure_orders

  !> Two points one spacing apart, the left one held: omega^2 = 2 q v_c V/(rho |xi|), with q = 2 b
  !> delta, b = E/(2 A delta^3): omega = sqrt(2 E v_c/(rho delta^2)) dx^(1/2)/|xi|^(1/2).
  subroutine oscillator(amplitude, set_up, omega, error)
    real(wp), intent(in) :: amplitude     !! initial displacement [m]
    type(set_up_type), intent(out) :: set_up
    real(wp), intent(out) :: omega
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene

    call box_scene([2], 1.0e-2_wp, 0.3_wp, scene)
    scene%horizon%ratio = 1.3_wp
    deallocate (scene%regions, scene%boundaries, scene%initial)
    allocate (scene%regions(2), scene%boundaries(1), scene%initial(1))
    scene%regions%shape = 'box'
    scene%regions(1)%name = 'left'
    scene%regions(1)%upper(1) = 1.0e-2_wp
    scene%regions(2)%name = 'right'
    scene%regions(2)%lower(1) = 1.0e-2_wp
    scene%boundaries(1)%region = 'left'
    scene%boundaries(1)%displacement(1) = 0.0_wp
    scene%initial(1)%region = 'right'
    scene%initial(1)%displacement(1) = amplitude
    call ready(scene, set_up, error)
    if (allocated(error)) return
    ! delta = 1.3 dx: v_c = 0.8
    omega = sqrt(2*youngs_modulus*0.8_wp/density_of_steel)/(1.3_wp*1.0e-2_wp)
  end subroutine oscillator

  !> 3000 steps from rest at 0.99 of the limit stay within 20 times the amplitude (leapfrog reaches
  !> 1/sqrt(1 - 0.99^2) = 7); at 1.02 of it they leave it far behind, or are stopped.
  subroutine test_limits(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: amplitude = 1.0e-8_wp
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: omega, largest
    integer :: i, trial, right

    do i = 1, size(integrators)
      do trial = 1, 2
        call oscillator(amplitude, set_up, omega, error)
        if (allocated(error)) return
        right = at_point(set_up%system%body, [1.5e-2_wp])
        call begin(diary, right)
        call run_explicit(set_up%system, trim(integrators(i)), merge(0.99_wp, 1.02_wp, trial == 1) &
          & *integrator_limit(trim(integrators(i)))/omega, 3000, diary, fault)
        largest = max_abs(diary%u)
        if (trial == 1) then
          call expect_true(error, .not. allocated(fault), trim(integrators(i)) &
            & //' stops below its limit')
          call expect(error, largest, 0.0_wp, 20*amplitude, trim(integrators(i)) &
            & //' below its limit')
        else
          call expect_true(error, allocated(fault) .or. largest > 1.0e3_wp*amplitude, &
            & trim(integrators(i))//' is stable above its limit: '//text_of(largest))
        end if
      end do
    end do
  end subroutine test_limits

  subroutine begin(diary, slot)
    type(diary_type), intent(out) :: diary
    integer, intent(in) :: slot
    diary%slot = slot
  end subroutine begin

  !> Leapfrog from rest gives u_n = U cos(n phi) with sin(phi/2) = omega dt/2, to rounding that
  !> grows with n; its velocity at t_n is then -U sin(n phi) sin(phi)/dt.
  subroutine test_oscillator(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: amplitude = 1.0e-5_wp
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: omega, dt, phi, mass, v
    integer :: i, n, right

    do i = 1, 2
      call oscillator(amplitude, set_up, omega, error)
      if (allocated(error)) return
      right = at_point(set_up%system%body, [1.5e-2_wp])
      call begin(diary, right)
      dt = 0.7_wp/omega
      phi = 2*asin(0.35_wp)
      call run_explicit(set_up%system, trim(integrators(i)), dt, 200, diary, fault)
      mass = density_of_steel*3.0e-4_wp*1.0e-2_wp
      do n = 0, 200
        call expect(error, diary%u(1, n + 1), amplitude*cos(n*phi), 1.0e-12_wp*amplitude, &
          & 'displacement')
        v = amplitude*sin(n*phi)*sin(phi)/dt
        call expect(error, diary%kinetic(n + 1), mass*v**2/2, &
          & 1.0e-11_wp*mass*(amplitude*omega)**2, &
          & 'kinetic energy')
        call expect(error, diary%strain(n + 1), mass*omega**2*diary%u(1, n + 1)**2/2, &
          & 1.0e-12_wp*mass*(amplitude*omega)**2, 'strain energy')
      end do
    end do
  end subroutine test_oscillator

  !> u = U cos(k x) from rest in a chain so long that its ends (three points a step) are not heard
  !> in its middle: u_n = U cos(k x) cos(n phi), sin(phi/2) = omega(k) dt/2, with the sum of
  !> doc/theory.md, 12, for omega(k). Wave numbers up to the grid's last, step at 0.9 of the stable
  !> one.
  subroutine test_dispersion(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: dx = 1.0e-2_wp, amplitude = 1.0e-6_wp
    integer, parameter :: half = 200, steps = 60
    real(wp), parameter :: parts(*) = [0.02_wp, 0.2_wp, 0.5_wp, 0.8_wp, 1.0_wp]  !! of pi/dx
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: k, delta, omega2, vc, dt, phi, middle
    integer :: i, j, n, slot

    call box_scene([2*half + 1], dx, 0.3_wp, scene)
    do i = 1, size(parts)
      call ready(scene, set_up, error)
      if (allocated(error)) return
      delta = 3.015_wp*dx
      k = parts(i)*pi/dx
      omega2 = 0.0_wp
      do j = -3, 3
        if (j == 0) cycle
        vc = merge(0.515_wp, 1.0_wp, abs(j) == 3)
        ! 8 b delta = 4 E/(A delta^2), V = A dx; each bond once from each side makes 1/2 of it
        omega2 = omega2 + 2*youngs_modulus/(density_of_steel*delta**2)*vc*(1 - cos(k*j*dx))/abs(j)
      end do
      middle = (half + 0.5_wp)*dx
      where (set_up%system%body%point > 0) set_up%system%state%u(:, 1) = &
        & amplitude*cos(k*(set_up%system%body%x(:, 1) - middle))
      slot = at_point(set_up%system%body, [middle])
      call begin(diary, slot)
      dt = 0.9_wp*set_up%plan%limit
      call run_explicit(set_up%system, 'forward_backward', dt, steps, diary, fault)
      phi = 2*asin(sqrt(omega2)*dt/2)
      do n = 0, steps
        ! positions are rounded to eps x, x/dx up to 400: 1e-13 per step of each phase
        call expect(error, diary%u(1, n + 1), amplitude*cos(n*phi), 1.0e-10_wp*amplitude, &
          & 'wave at '//text_of(parts(i))//' of the last wave number')
      end do
    end do
  end subroutine test_dispersion

  !> A body thrown as a whole: x = v t, whatever the integrator; to rounding.
  subroutine test_flight(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    integer :: i

    call box_scene([5, 4], 1.0e-2_wp, 0.2_wp, scene)
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%velocity(:2) = [3.0_wp, -4.0_wp]
    do i = 1, size(integrators)
      call ready(scene, set_up, error)
      if (allocated(error)) return
      call begin(diary, int(set_up%system%body%slot(1)))
      call run_explicit(set_up%system, trim(integrators(i)), 1.0e-6_wp, 50, diary, fault)
      call expect(error, diary%u(1, 51), 1.5e-4_wp, 1.0e-16_wp, 'x of '//trim(integrators(i)))
      call expect(error, diary%u(2, 51), -2.0e-4_wp, 1.0e-16_wp, 'y of '//trim(integrators(i)))
    end do
  end subroutine test_flight

  !> Three times the stable step: status 3, the step, the likely cause.
  subroutine test_unstable(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault

    call smooth_plate(.false., scene)
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call run_explicit(set_up%system, 'forward_backward', 3*set_up%plan%limit, 1000, diary, fault)
    call expect_true(error, allocated(fault), 'an unstable run went to its end')
    if (.not. allocated(fault)) return
    call expect_true(error, fault%status == status_no_answer, 'exit status')
    call expect_true(error, index(fault%message, 'unstable at step ') == 1 .and. &
      & index(fault%message, 't = ') > 0 .and. index(fault%message, 'point') > 0, 'message: ' &
      & //fault%message)
    call expect_true(error, diary%n > 1, 'the rows before are kept')
  end subroutine test_unstable

end module test_motion_explicit_integrators
