!> What `perifort limits` measures and prints, on bodies whose answers are known.
module test_study_limits_limits
  use pd_base_kinds, only: wp
  use pd_base_error, only: fault_type => error_type
  use pd_output_report_begin, only: run_options_type
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_explicit_spectrum, only: spectrum_type, largest_frequency
  use pd_motion_system, only: system_type
  use pd_scene_content_types, only: scene_type
  use pd_study_limits_drift, only: slope_of
  use pd_study_limits_limits, only: growth_of, limits_type, measure_limits, run_limits
  use pd_study_limits_rounding, only: digits_of
  use pd_study_limits_vibration, only: energy_watch_type, free_body, random_shape
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: box_scene, density_of_steel, expect, expect_true, ready, text_of, youngs_modulus
  implicit none (type, external)
  private
  public :: collect_study_limits_limits

  real(wp), parameter :: spacing = 1.0e-2_wp
  character(7), parameter :: families(2) = [character(7) :: 'lattice', 'list']

contains

  subroutine collect_study_limits_limits(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('both forms of 7.25 and the true limit of a chain', test_chain), &
      & new_unittest('a disturbance grows above the limit as predicted', test_growth), &
      & new_unittest('the step of a run follows the limit asked for', test_plan), &
      & new_unittest('a moved or scaled body has the same vibration', test_free_body), &
      & new_unittest('the observed energy is constant to rounding', test_energy), &
      & new_unittest('slope and digits', test_numbers), &
      & new_unittest('the whole command ends with its three numbers', test_command), &
      & new_unittest('a body that cannot vibrate is refused', test_held)]
  end subroutine collect_study_limits_limits

  !> Points that see their nearest neighbours only, spring = 2 q V/(rho dx) with q = E/(A delta^2):
  !> 7.25 gives 2/sqrt(4 spring) for an inner point, 2/sqrt(2 spring) at the ends, and without
  !> surface correction the printed form the same; the true limit is 2/sqrt(2 spring (1 - cos(pi
  !> (n-1)/n))).
  subroutine test_chain(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(limits_type) :: limits
    real(wp) :: spring
    integer, parameter :: n = 12

    call chain(n, scene)
    call ready(scene, set_up, error)
    if (allocated(error)) return
    spring = 2*youngs_modulus/(1.01_wp*spacing)**2/density_of_steel
    call measure_limits(set_up%system, limits)
    call expect(error, limits%equation*sqrt(spring), 1.0_wp, 1.0e-12_wp, '7.25')
    call expect(error, limits%most*sqrt(spring), sqrt(2.0_wp), 1.0e-12_wp, '7.25 at the ends')
    call expect(error, limits%printed*sqrt(spring), 1.0_wp, 1.0e-12_wp, '7.25 as printed')
    call expect_true(error, set_up%system%body%point(limits%slot) == 2, 'first inner point')
    call expect(error, limits%spectral*sqrt(spring), 2/sqrt(2*(1 - cos(acos(-1.0_wp)*(n - 1)/n))), &
      & 1.1e-3_wp, 'true limit')
    call expect(error, limits%lasting, 0.0_wp, 0.0_wp, 'nothing breaks')
  end subroutine test_chain

  !> A chain with springs between nearest neighbours.
  subroutine chain(n, scene)
    integer, intent(in) :: n
    type(scene_type), intent(out) :: scene
    call box_scene([n], spacing, 0.3_wp, scene)
    scene%horizon%ratio = 1.01_wp
    scene%horizon%volume_correction = 'none'
  end subroutine chain

  !> Above the limit the fastest mode of 7.8 and 7.9 grows by exp(x) a step, cosh(x) = 2 f^2 - 1 at
  !> f times the limit: from a random start to 1e6 takes ln(1e6)/x steps and a few to emerge from
  !> the other modes. Below, a mode swings to at most 1/sqrt(1 - f^2) of its start.
  subroutine test_growth(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(spectrum_type) :: found
    real(wp) :: growth, fewest
    integer :: steps, f

    do f = 1, 2
      call box_scene([12, 11], spacing, 0.42_wp, scene)
      scene%horizon%family = families(f)
      call ready(scene, set_up, error)
      if (allocated(error)) return
      call largest_frequency(set_up%system, 1.0e-4_wp, found)
      associate (limit => 2/sqrt(found%squared))
        call growth_of(set_up%system, 0.99_wp*limit, 1.0e9_wp, growth, steps)
        call expect_true(error, growth < 10.0_wp .and. steps == 1000, 'below: '//text_of(growth))
        call growth_of(set_up%system, 1.01_wp*limit, 1.0e9_wp, growth, steps)
        fewest = log(1.0e6_wp)/acosh(2*1.01_wp**2 - 1)
        call expect_true(error, growth >= 1.0e6_wp, 'above: '//text_of(growth))
        call expect_true(error, steps > fewest .and. steps < 2*fewest, 'steps to grow: '// &
          & text_of(real(steps, wp))//' beside '//text_of(fewest))
      end associate
    end do
  end subroutine test_growth

  !> `limit = 'spectral'` is the measured limit, for each integrator; where bonds can break, the
  !> bound that lasts, which lies between it and 7.25; and an explicit `step` stays what it is.
  subroutine test_plan(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(limits_type) :: limits

    call box_scene([16, 12], spacing, 0.42_wp, scene)
    scene%horizon%surface_correction = 'energy'
    scene%time%limit = 'spectral'
    scene%time%integrator = 'runge_kutta'
    scene%time%safety = 0.9_wp
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call measure_limits(set_up%system, limits)
    ! both are on the safe side of the same number, the plan by at most 0.5 %
    call expect(error, set_up%plan%step/(0.9_wp*2.83_wp/2*limits%spectral), 0.9975_wp, 0.0035_wp, &
      & 'step')
    call expect(error, set_up%plan%equation/(2.83_wp/2*limits%equation), 1.0_wp, 1.0e-12_wp, '7.25')
    call expect_true(error, set_up%plan%spectral .and. set_up%plan%evaluations > 0, 'measured')

    scene%materials%critical_stretch = 0.01_wp
    scene%time%integrator = 'forward_backward'
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expect_true(error, set_up%plan%limit < 0.99_wp*limits%spectral .and. &
      & set_up%plan%limit > 1.01_wp*limits%equation, 'with breaking bonds in between: '// &
      & text_of(set_up%plan%limit/limits%equation)//' of 7.25')
    scene%time%step = 1.0e-7_wp
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expect(error, set_up%plan%step, 1.0e-7_wp, 0.0_wp, 'step asked for')
  end subroutine test_plan

  !> Frequencies go with one over the size, whatever it is and whatever the law: the chapter's, one
  !> with factors of a bond's length, one with scales of the points. A shift changes nothing, in
  !> lists but for the rounding of the places, 1e6 sizes x 20 spacings x 1e-16 = 2e-9 of a spacing.
  !> The crack and what is held come along.
  subroutine test_free_body(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(system_type) :: twin
    type(spectrum_type) :: here, there
    type(fault_type), allocatable :: fault
    real(wp), parameter :: factors(3) = [1.0_wp, 1.0e-9_wp, 1.0e3_wp]
    real(wp) :: shift
    character(11), parameter :: models(3) = [character(11) :: 'state_based', 'state_based', 'lps']
    character(8), parameter :: influences(3) = [character(8) :: '', 'gaussian', '']
    integer :: f, i, m

    do f = 1, 6
      m = (f + 1)/2
      call box_scene([16, 12], spacing, 0.42_wp, scene)
      scene%materials(1)%model = models(m)
      scene%materials(1)%influence = influences(m)
      scene%horizon%surface_correction = 'energy'
      scene%horizon%family = families(mod(f, 2) + 1)
      deallocate (scene%cracks)
      allocate (scene%cracks(1))
      scene%cracks(1)%from(:2) = [-1.0_wp, 0.06_wp]
      scene%cracks(1)%to(:2) = [0.08_wp, 0.06_wp]
      call ready(scene, set_up, error)
      if (allocated(error)) return
      set_up%system%held(set_up%system%body%slot(:16), 2) = 1
      call largest_frequency(set_up%system, 1.0e-4_wp, here)
      do i = 1, 4
        shift = merge(1.6e5_wp, 0.0_wp, i == 4)
        call free_body(set_up%system, shift, factors(mod(i - 1, 3) + 1), twin, fault)
        if (allocated(fault)) then
          call test_failed(error, fault%message)
          return
        end if
        call largest_frequency(twin, 1.0e-4_wp, there)
        call expect(error, there%squared*factors(mod(i - 1, 3) + 1)**2/here%squared, 1.0_wp, &
          & merge(1.0e-7_wp, 1.0e-11_wp, i == 4), families(mod(f, 2) + 1)//', '// &
          & trim(models(m))//', '//text_of(real(i, wp)))
      end do
    end do
  end subroutine test_free_body

  !> The energy watched with velocities at half steps is that which 7.8 and 7.9 keep: to rounding in
  !> a linear run, at 0.95 of the limit, where the plain energy swings by more than a tenth.
  subroutine test_energy(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(limits_type) :: limits
    type(energy_watch_type) :: watch
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: shape(:, :)
    real(wp) :: swing(2)
    integer :: i

    call box_scene([10, 9], spacing, 0.42_wp, scene)
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call measure_limits(set_up%system, limits)
    call random_shape(set_up%system, shape)
    do i = 1, 2
      set_up%system%state%u = 1.0e-15_wp*shape
      set_up%system%state%v = 0.0_wp
      watch = energy_watch_type(every=1, half_steps=i == 1)
      call run_explicit(set_up%system, 'forward_backward', 0.95_wp*limits%spectral, 200, watch, &
        & fault)
      swing(i) = (maxval(watch%energy) - minval(watch%energy))/maxval(watch%energy)
    end do
    call expect(error, swing(1), 0.0_wp, 1.0e-11_wp, 'kept energy')
    call expect_true(error, swing(2) > 0.1_wp, 'plain energy: '//text_of(swing(2)))
  end subroutine test_energy

  subroutine test_numbers(error)
    type(error_type), allocatable, intent(out) :: error

    call expect(error, slope_of([1.0_wp, 2.0_wp, 4.0_wp], [5.0_wp, 3.0_wp, -1.0_wp]), -2.0_wp, &
      & 1.0e-14_wp, 'slope of a line')
    call expect(error, slope_of([0.0_wp, 1.0_wp, 2.0_wp], [0.0_wp, 3.0_wp, 0.0_wp]), 0.0_wp, &
      & 1.0e-14_wp, 'slope of a peak')
    call expect(error, digits_of(1.0e-9_wp), 9.0_wp, 1.0e-12_wp, 'digits')
    call expect(error, digits_of(0.0_wp), 16.0_wp, 0.0_wp, 'all digits')
    call expect(error, digits_of(3.0_wp), 0.0_wp, 0.0_wp, 'no digits')
  end subroutine test_numbers

  !> For explicit and for relaxing scenes, the last lines are the three numbers, each readable; all
  !> parts stand above.
  subroutine test_command(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    type(run_options_type) :: options
    character(120) :: line, lines(200)
    real(wp) :: equation, spectral, ratio
    integer :: unit, status, n, i
    character(10), parameter :: methods(2) = [character(10) :: 'explicit', 'relaxation']

    options%threads = 1
    do i = 1, 3
      call box_scene([20], spacing, 0.3_wp, scene)
      scene%time%method = methods(mod(i - 1, 2) + 1)
      if (i == 3) scene%materials(1)%model = 'lps'
      open (newunit=unit, status='scratch', action='readwrite')
      call run_limits(scene, options, 0.05_wp, fault, unit)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        close (unit)
        return
      end if
      rewind (unit)
      n = 0
      do
        read (unit, '(a)', iostat=status) line
        if (status /= 0) exit
        n = n + 1
        lines(n) = line
      end do
      close (unit)
      call expect_true(error, index(lines(n - 2), 'step_equation_7_25 = ') == 1 .and. &
        & index(lines(n - 1), 'step_spectral = ') == 1 .and. index(lines(n), 'ratio = ') == 1, &
        & 'the last lines')
      if (allocated(error)) return
      read (lines(n - 2) (21:), *) equation
      read (lines(n - 1) (16:), *) spectral
      read (lines(n) (8:), *) ratio
      call expect(error, spectral/equation/ratio, 1.0_wp, 1.0e-4_wp, 'ratio')
      call expect_true(error, ratio > 1.0_wp, 'above 7.25')
      call expect_true(error, any(index(lines(:n), 'in kilometres') > 0) .and. &
        & any(index(lines(:n), 'runge_kutta') > 0) .and. any(index(lines(:n), 'at 1.005 of') > 0) &
        & .and. (any(index(lines(:n), 'static') > 0) .eqv. i == 2), 'all parts')
      call expect_true(error, any(index(lines(:n), "is for the chapter's laws") > 0) .eqv. i == 3, &
        & 'the printed form')
    end do
  end subroutine test_command

  !> A scene all of whose points are held has no largest step.
  subroutine test_held(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    type(run_options_type) :: options
    integer :: unit

    call box_scene([20], spacing, 0.3_wp, scene)
    deallocate (scene%regions, scene%boundaries)
    allocate (scene%regions(1), scene%boundaries(1))
    scene%regions(1)%name = 'all'
    scene%regions(1)%shape = 'box'
    scene%boundaries(1)%name = 'held'
    scene%boundaries(1)%region = 'all'
    scene%boundaries(1)%displacement(1) = 0.0_wp
    options%threads = 1
    open (newunit=unit, status='scratch', action='readwrite')
    call run_limits(scene, options, 0.05_wp, fault, unit)
    close (unit)
    call expect_true(error, allocated(fault), 'refused')
    if (allocated(fault)) call expect_true(error, index(fault%message, 'constrained') > 0, &
      & fault%message)
  end subroutine test_held

end module test_study_limits_limits
