!> Steps and loads that cannot be, and numbers too small to be: refused with the reason, stopped in
!> time, or flushed.
module test_extremes_steps
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use, intrinsic :: iso_fortran_env, only: compiler_options
  use pd_base_kinds, only: wp
  use pd_base_error, only: fault_type => error_type, status_input, status_no_answer
  use pd_driver, only: run_scene
  use pd_output_report_begin, only: run_options_type
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_scene_format_file, only: read_text_file
  use pd_scene_content_types, only: scene_type
  use comparisons, only: max_abs
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  use bodies, only: prepare_run, box_scene, density_of_steel, diary_type, expect, expect_true, &
    & noise, ready_alone, text_of, youngs_modulus
  implicit none (type, external)
  private
  public :: collect_extremes_steps

  character(*), parameter :: here = 'build/test_extremes'
  real(wp), parameter :: dx = 1.0e-2_wp     !! spacing of all bodies here [m]
  character(9), parameter :: families(*) = [character(9) :: 'lattice', 'list']

contains

  subroutine collect_extremes_steps(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a step of 0 is refused', test_no_step), &
      & new_unittest('steps of 1e-30 s move by v dt', test_tiny_step), &
      & new_unittest('above the limit a run stops as early as predicted', test_beyond), &
      & new_unittest('an unstable step is not mistaken for fracture', test_dust), &
      & new_unittest('excessive loads are named in the message', test_loads), &
      & new_unittest('denormal numbers are flushed on every thread', test_denormals)]
  end subroutine collect_extremes_steps

  !> Two free points of a bar: omega^2 = 2 (4 b delta) v_c V/(rho dx), delta = 1.3 dx, v_c = 0.8.
  subroutine pair(family, set_up, k, omega, error)
    character(*), intent(in) :: family
    type(set_up_type), intent(out) :: set_up
    integer, intent(out) :: k(2)
    real(wp), intent(out) :: omega
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene

    omega = 0.0_wp
    k = 0
    call box_scene([2], dx, 0.0_wp, scene)
    scene%horizon%ratio = 1.3_wp
    scene%horizon%family = family
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    set_up%system%stable_step = set_up%plan%limit
    k = set_up%system%body%slot(1:2)
    omega = sqrt(4*youngs_modulus*0.8_wp/density_of_steel)/(1.3_wp*dx)
  end subroutine pair

  !> A file with such a step is refused by its key's range; here the scene was filled in memory.
  subroutine test_no_step(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: steps(*) = [0.0_wp, -1.0e-6_wp]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    integer :: i

    do i = 1, size(steps)
      call box_scene([5, 5], dx, 0.3_wp, scene)
      scene%time%step = steps(i)
      call prepare_run(scene, set_up, fault)
      call expect_true(error, allocated(fault), 'a step of '//text_of(steps(i))//' is accepted')
      if (allocated(error)) return
      call expect_true(error, fault%status == status_input .and. &
        & index(fault%message, 'a time step of ') == 1, fault%message)
    end do
  end subroutine test_no_step

  !> 50 steps of 1e-30 s: displacements of v n dt, velocities as they were.
  subroutine test_tiny_step(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    integer :: f, i, seed

    do f = 1, size(families)
      call box_scene([5, 4, 4], dx, 0.3_wp, scene)
      scene%horizon%family = families(f)
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      seed = 3
      associate (u => set_up%system%state%u, v => set_up%system%state%v, &
        & slot => set_up%system%body%slot)
        do i = 1, size(slot)
          v(slot(i), :) = [noise(seed), noise(seed), noise(seed)]
        end do
        diary = diary_type()
        call run_explicit(set_up%system, 'forward_backward', 1.0e-30_wp, 50, diary, fault)
        if (allocated(fault)) then
          call test_failed(error, fault%message)
          return
        end if
        call expect(error, norm2(u - 50*1.0e-30_wp*v), 0.0_wp, 1.0e-14_wp*norm2(u), 'displacement')
        call expect(error, diary%time(51), 50*1.0e-30_wp, 1.0e-45_wp, 'time')
        call expect(error, diary%kinetic(51), diary%kinetic(1), 1.0e-15_wp*diary%kinetic(1), &
          & 'kinetic energy')
      end associate
    end do
  end subroutine test_tiny_step

  !> Two points at rest, A apart from where they belong, at r times leapfrog's limit: beyond it
  !> u_n = (-1)^n A cosh(n mu), cosh mu = 2 r^2 - 1. The run stops at the step in which they would
  !> move more than a horizon, give or take what the turned bond changes of the last step.
  !> What is shown until then is finite, and the message tells the ratio of the steps. At
  !> the limit itself and below nothing grows by more than n + 1.
  subroutine test_beyond(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: parts(*) = [1.0_wp, 1.01_wp, 1.1_wp, 2.0_wp, 10.0_wp, 1.0e6_wp, &
      & 1.0e30_wp, 1.0e200_wp]
    real(wp), parameter :: amplitude = 1.0e-9_wp*dx
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: omega, mu
    integer :: f, i, k(2), expected

    do f = 1, size(families)
      do i = 1, size(parts) - merge(1, 0, overflow_stops())
        call pair(trim(families(f)), set_up, k, omega, error)
        if (allocated(error)) return
        set_up%system%state%u(k, 1) = [-amplitude, amplitude]
        diary = diary_type()
        diary%slot = k(2)
        call run_explicit(set_up%system, 'forward_backward', parts(i)*2/omega, 1000, diary, fault)
        call expect_true(error, all(abs(diary%u) < 1.0e3_wp*dx) .and. &
          & all(diary%kinetic < 1.0e300_wp), 'what is shown is not finite')
        if (i == 1) then
          call expect_true(error, .not. allocated(fault), 'stopped at the limit')
          call expect_true(error, max_abs(diary%u) < 1001*amplitude, 'grows at the limit')
          if (allocated(error)) return
          cycle
        end if
        call expect_true(error, allocated(fault), 'not stopped at '//text_of(parts(i)))
        if (allocated(error)) return
        mu = 2*log(parts(i) + sqrt(parts(i) - 1)*sqrt(parts(i) + 1))
        ! A (exp(n mu) + exp((n - 1) mu))/2 > delta
        expected = ceiling(log(2*1.3_wp*dx/amplitude/(1 + exp(-mu)))/mu)
        ! the watch over the energy may find it sooner
        call expect_true(error, diary%n <= expected + 2, 'stopped late at '//text_of(parts(i)))
        ! the pair's own limit is 7.25's: sqrt(2 rho/M) omega = 2
        call expect_true(error, fault%status == status_no_answer .and. &
          & index(fault%message, 'times the stable one') > 0, fault%message)
      end do
    end do
  end subroutine test_beyond

  !> Whether this build stops at an overflow, as the checked one does. Otherwise that is an
  !> infinity, which the program looks for.
  logical function overflow_stops()
    overflow_stops = index(compiler_options(), 'ffpe-trap') > 0
  end function overflow_stops

  !> A run of a scene into a folder of its own.
  subroutine run(scene, fault)
    type(scene_type), intent(in) :: scene
    type(fault_type), allocatable, intent(out) :: fault
    type(run_options_type) :: options

    options%output_directory = here
    options%quiet = .true.
    options%overwrite = .true.
    call omp_set_num_threads(1)
    call run_scene(scene, options, fault)
  end subroutine run

  !> Where bonds can break, a step beyond the limit beats the body to dust, and no point ever
  !> crosses its horizon in a step. The energy tells it: 100 times what was put in, from nowhere.
  subroutine test_dust(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: f, trial

    do f = 1, size(families)
      do trial = 1, 2
        call box_scene([20, 16], dx, 0.3_wp, scene)
        scene%file = 'dust.nml'
        scene%horizon%family = families(f)
        scene%horizon%surface_correction = 'energy'
        scene%materials(1)%critical_stretch = 0.01_wp
        deallocate (scene%initial)
        allocate (scene%initial(1))
        scene%initial(1)%velocity_gradient(1, 1) = 1.0_wp
        ! the true limit of this plate is 1.7 times the stable step
        scene%time%safety = merge(1.85_wp, 1.6_wp, trial == 1)
        scene%time%steps = 2000
        call run(scene, fault)
        if (trial == 1) then
          call expect_true(error, allocated(fault), 'an unstable step passes for fracture')
          if (allocated(error)) return
          call expect_true(error, fault%status == status_no_answer .and. index(fault%message, &
            & ' is 1.85 times the stable one') > 0, fault%message)
        else if (allocated(fault)) then
          call test_failed(error, 'below the limit: '//fault%message)
        end if
        if (allocated(error)) return
      end do
    end do
  end subroutine test_dust

  !> Pressures no body bears: status 3, loads named as the cause and not the step, and no number in
  !> the history that is none.
  subroutine test_loads(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: pressures(*) = [1.0e20_wp, -1.0e20_wp, 1.0e30_wp, -1.0e30_wp]
    character(10), parameter :: methods(*) = [character(10) :: 'explicit', 'relaxation']
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text
    integer :: f, m, p

    do f = 1, size(families)
      do m = 1, size(methods)
        do p = 1, size(pressures) - merge(2, 0, overflow_stops())
          call box_scene([6, 5, 5], dx, 0.3_wp, scene)
          scene%file = 'load.nml'
          scene%horizon%family = families(f)
          scene%time%method = methods(m)
          scene%time%steps = 100
          scene%relaxation%maximum_iterations = 1000
          scene%output%history_every = 1
          deallocate (scene%loads)
          allocate (scene%loads(2))
          scene%loads(1)%side = 'x_min'
          scene%loads(2)%side = 'x_max'
          scene%loads%pressure = pressures(p)
          call run(scene, fault)
          call expect_true(error, allocated(fault), 'a pressure of '//text_of(pressures(p))// &
            & ' is borne')
          if (allocated(error)) return
          call check(error, fault%status, status_no_answer, 'exit status')
          call expect_true(error, index(fault%message, 'load') > 0 .and. &
            & index(fault%message, 'times the stable one') == 0, fault%message)
          call read_text_file(here//'/history.csv', text, fault)
          call expect_true(error, .not. allocated(fault), 'no history')
          if (allocated(error)) return
          call expect_true(error, index(text, 'NaN') + index(text, 'Infinity') == 0, &
            & 'the history has numbers that are none')
        end do
      end do
    end do
  end subroutine test_loads

  !> The front of a wave decays through numbers below 1e-308, with which processors are slow. The
  !> optimised build flushes them to zero, on every thread; the checked one keeps them.
  subroutine test_denormals(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), volatile :: tiny_number, quarter, product_of
    logical :: flushed(4), expected
    integer :: thread, threads

    expected = index(compiler_options(), '-ffast-math') > 0
    threads = omp_get_max_threads()
    call omp_set_num_threads(4)
    quarter = 0.25_wp
    !$omp parallel do default(none) shared(flushed, quarter) private(tiny_number, product_of) &
    !$omp schedule(static, 1)
    do thread = 1, 4
      tiny_number = tiny(1.0_wp)
      product_of = tiny_number*quarter
      flushed(thread) = .not. abs(product_of) > 0.0_wp
    end do
    call omp_set_num_threads(threads)
    call expect_true(error, all(flushed .eqv. expected), 'threads that flush: '// &
      & text_of(real(count(flushed), wp)))
  end subroutine test_denormals

end module test_extremes_steps
