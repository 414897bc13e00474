!> The watch over energies: silent where energy is paid for, and not where it comes from nowhere.
module test_motion_energy_watch
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use, intrinsic :: iso_fortran_env, only: compiler_options
  use pd_base_kinds, only: wp
  use pd_base_error, only: fault_type => error_type, status_no_answer
  use pd_base_text, only: to_text
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_observer, only: observer_type, instant_type
  use pd_motion_watch_rescue, only: good_state_type, keep_good, show_good
  use pd_motion_account, only: energies_type, energies_of
  use pd_motion_system, only: system_type, inverse_density
  use pd_motion_energy_watch, only: watch_type
  use pd_scene_content_types, only: scene_type
  use testdrive, only: check, error_type, new_unittest, skip_test, unittest_type
  use bodies, only: box_scene, expect_true, ready_alone
  implicit none (type, external)
  private
  public :: collect_motion_energy_watch

  integer, parameter :: spoilt_step = 7
  character(*), parameter :: integrators(5) = [character(16) :: 'forward_backward', &
    & 'velocity_verlet', 'adams_bashforth', 'adams_moulton', 'runge_kutta']

  !> Watches the watch: it keeps the kinetic energy of every instant, and may give one velocity
  !> another value at a step.
  type, extends(observer_type) :: watcher_type
    logical :: spoils = .false.
    real(wp) :: value = 0.0_wp               !! [m/s]
    real(wp), allocatable :: kinetic(:)      !! of the integrator's velocities, from step 0 [J]
    real(wp) :: start = 0.0_wp               !! all energy at the start [J]
    integer :: rescued = -1                  !! step of the last good state
    real(wp) :: rescued_energy = 0.0_wp      !! of it [J]
  contains
    procedure :: observe
  end type watcher_type

contains

  subroutine collect_motion_energy_watch(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('exchanged energy is not an error', test_exchange), &
      & new_unittest('supplied energy is not an error', test_supplied), &
      & new_unittest('a load that starts to push is not an error', test_begin), &
      & new_unittest('unsupplied energy is detected', test_nowhere), &
      & new_unittest('NaN is not an energy', test_no_number), &
      & new_unittest('snapshots are rare and only of good states', test_kept), &
      & new_unittest('without rows kinetic energy decides', test_kept_alone), &
      & new_unittest('a non-finite velocity is detected in its step', test_at_once), &
      & new_unittest('growth is detected within ten steps', test_growth), &
      & new_unittest('a snapshot is checked before it is written', test_shown)]
  end subroutine collect_motion_energy_watch

  subroutine observe(observer, system, instant, error)
    class(watcher_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error
    type(energies_type) :: energies
    real(wp) :: kinetic
    integer :: k

    if (allocated(error)) return
    if (instant%rescued .or. instant%step == 0) then
      call energies_of(system, system%state%v, energies)
      if (instant%rescued) observer%rescued = instant%step
      if (instant%rescued) observer%rescued_energy = energies%kinetic + energies%strain
      if (instant%step == 0) observer%start = energies%kinetic + energies%strain
      if (instant%rescued) return
    end if
    kinetic = 0.0_wp
    do k = 1, system%body%n_slots
      if (system%body%point(k) > 0) kinetic = kinetic + sum(system%state%v(k, :)**2) &
        & *system%body%volume(k)/inverse_density(system%model, k)/2
    end do
    if (.not. allocated(observer%kinetic)) allocate (observer%kinetic(0))
    observer%kinetic = [observer%kinetic, kinetic]
    if (observer%spoils .and. instant%step == spoilt_step) &
      & system%state%v(system%body%slot(8), 2) = observer%value
  end subroutine observe

  !> A plate that swings after a start at 0.01 m/s.
  subroutine swinging(set_up, error)
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene

    call box_scene([6, 5], 1.0e-3_wp, 0.25_wp, scene)
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%velocity_gradient(1, 1) = 10.0_wp
    call ready_alone(scene, set_up, error)
  end subroutine swinging

  !> 1 J that swings between motion and strain, with errors that a coarse step makes.
  subroutine test_exchange(error)
    type(error_type), allocatable, intent(out) :: error
    type(watch_type) :: watch
    integer :: n

    do n = 0, 100
      call watch%supplied(0.0_wp)
      call watch%check(n, 1.3_wp*cos(0.3_wp*n)**2, sin(0.3_wp*n)**2, 0.0_wp, 0.0_wp)
      call watch%check_kinetic(2.0_wp)
    end do
    call check(error, watch%sound)
  end subroutine test_exchange

  !> A body at rest that is driven: a million times the energy, all of it work, later drawn off.
  subroutine test_supplied(error)
    type(error_type), allocatable, intent(out) :: error
    type(watch_type) :: watch
    integer :: n

    call watch%check(0, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    do n = 1, 1000
      call watch%supplied(1.0_wp*n**2)
      call watch%check_kinetic(0.7_wp*n**2)
      call watch%check(n, 0.7_wp*n**2, 0.2_wp*n**2, 0.1_wp*n**2, 1.0_wp*n**2)
    end do
    call watch%supplied(0.0_wp)
    call watch%check(1001, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp)
    call watch%supplied(0.0_wp)
    call check(error, watch%sound)
  end subroutine test_supplied

  !> Velocities at the instant of a first push come before any work has been done.
  subroutine test_begin(error)
    type(error_type), allocatable, intent(out) :: error
    type(watch_type) :: watch

    call watch%check(0, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    call watch%check_kinetic(0.0_wp)
    call watch%supplied(0.0_wp)
    call watch%check(1, 0.125_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    call watch%supplied(1.0_wp)
    call watch%check_kinetic(0.5_wp)
    call check(error, watch%sound)
  end subroutine test_begin

  !> Kinetic energy is found at once, all energies a step later, at a little more than a hundred
  !> times what there can be.
  subroutine test_nowhere(error)
    type(error_type), allocatable, intent(out) :: error
    type(watch_type) :: watch
    real(wp) :: energy, supply

    call watch%check(0, 2.0_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    call watch%supplied(1.0_wp)
    call watch%check_kinetic(299.0_wp)
    call check(error, watch%sound)
    if (allocated(error)) return
    call watch%check_kinetic(301.0_wp)
    call check(error, .not. watch%sound)
    if (allocated(error)) return
    call watch%found(energy, supply)
    call check(error, abs(energy - 301.0_wp) <= 0.0_wp .and. abs(supply - 3.0_wp) <= 0.0_wp)
    if (allocated(error)) return

    watch = watch_type()
    call watch%check(0, 2.0_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    call watch%check(7, 100.0_wp, 100.0_wp, 1.0_wp, 0.0_wp)
    call watch%supplied(0.0_wp)
    call check(error, .not. watch%sound)
  end subroutine test_nowhere

  subroutine test_no_number(error)
    type(error_type), allocatable, intent(out) :: error
    type(watch_type) :: watch
    real(wp) :: none

    ! a build that stops at invalid numbers stops at this one
    if (index(compiler_options(), 'ffpe-trap') > 0) then
      call skip_test(error, 'the build stops at invalid numbers')
      return
    end if
    none = ieee_value(none, ieee_quiet_nan)
    call watch%check(0, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    call watch%check(1, none, 0.0_wp, 0.0_wp, 0.0_wp)
    call watch%supplied(0.0_wp)
    call check(error, .not. watch%sound)
  end subroutine test_no_number

  !> Looks are due after 2000 steps without one. States are kept at 0, 50, 100, 200, 400, 800, .. if
  !> somebody has looked then; one whose energies are off by more than a tenth is not.
  subroutine test_kept(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: expected(8) = [0, 50, 100, 200, 400, 800, 1200, 1600]
    type(watch_type) :: watch
    integer :: n, found
    logical :: kept

    found = 0
    do n = 0, 1700, 25
      call watch%check(n, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp)
      if (.not. watch%keeps(n)) cycle
      found = found + 1
      call check(error, n, expected(min(8, found)))
      if (allocated(error)) return
    end do
    call check(error, found, 8)
    if (allocated(error)) return
    call check(error, watch%check_is_due(3700) .and. .not. watch%check_is_due(3699))
    if (allocated(error)) return
    call watch%check(2500, 1.2_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    kept = watch%keeps(2500)
    call check(error, .not. kept)
    if (allocated(error)) return
    call watch%check(2600, 1.05_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    kept = watch%keeps(2600)
    call check(error, kept)
  end subroutine test_kept

  !> No rows: all energies are looked at twice in 3000 steps, the kinetic energy before a state is
  !> kept, where it must agree. A bound below what is too much makes it no more frequent; one above
  !> does, each tenth step.
  subroutine test_kept_alone(error)
    type(error_type), allocatable, intent(out) :: error
    type(watch_type) :: watch
    real(wp) :: kinetic
    integer :: n, kept, looks, kinetic_looks

    kept = 0
    looks = 0
    kinetic_looks = 0
    do n = 0, 2999
      call watch%supplied(0.0_wp)
      if (watch%check_is_due(n)) then
        looks = looks + 1
        call watch%check(n, 0.5_wp, 0.5_wp, 0.0_wp, 0.0_wp)
      end if
      ! too much of it at 400 and 410
      kinetic = merge(1.2_wp, 0.5_wp, n >= 400 .and. n < 420)
      if (watch%kinetic_is_due(n, 50.0_wp)) then
        kinetic_looks = kinetic_looks + 1
        call watch%check_kinetic(kinetic)
      end if
      if (watch%keeps(n)) kept = kept + 1
    end do
    call check(error, looks, 2)
    if (allocated(error)) return
    ! 0, 50, 100, 200, 420, 820, 1220, 1620, 2400, 2800; at 2000 all are looked at
    call check(error, kept, 10)
    if (allocated(error)) return
    call check(error, kinetic_looks, 11)
    if (allocated(error)) return
    call check(error, watch%kinetic_is_due(3000, 101.0_wp) .and. &
      & .not. watch%kinetic_is_due(3001, 101.0_wp))
  end subroutine test_kept_alone

  !> One velocity becomes no number, or carries its point two horizons in a step:
  !> with every integrator the run ends in that step.
  subroutine test_at_once(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(watcher_type) :: watcher
    type(fault_type), allocatable :: fault
    real(wp) :: dt
    integer :: i, way

    do i = 1, size(integrators)
      do way = 1, 2
        if (way == 2 .and. index(compiler_options(), 'ffpe-trap') > 0) cycle
        call swinging(set_up, error)
        if (allocated(error)) return
        dt = set_up%plan%limit/10
        watcher = watcher_type(spoils=.true.)
        watcher%value = 2*set_up%system%family%rule%delta/dt
        if (way == 2) watcher%value = ieee_value(dt, ieee_quiet_nan)
        call run_explicit(set_up%system, trim(integrators(i)), dt, 100, watcher, fault)
        call expect_true(error, allocated(fault), 'not found: '//integrators(i))
        if (allocated(error)) return
        call expect_true(error, fault%status == status_no_answer .and. &
          & index(fault%message, 'unstable at step '//to_text(spoilt_step + 1)//',') > 0, &
          & trim(integrators(i))//': '//fault%message)
      end do
    end do
  end subroutine test_at_once

  !> Steps above the limit, nobody looks: found within ten steps after the kinetic energy is beyond
  !> a hundred times what there was, and what is shown at the end has no more than a tenth too much.
  subroutine test_growth(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(watcher_type) :: watcher
    type(fault_type), allocatable :: fault
    integer :: tenths, first, found

    found = 0
    do tenths = 12, 24, 2
      call swinging(set_up, error)
      if (allocated(error)) return
      watcher = watcher_type()
      call run_explicit(set_up%system, 'forward_backward', tenths*set_up%plan%limit/10, 3000, &
        & watcher, fault)
      if (.not. allocated(fault)) cycle
      found = found + 1
      call expect_true(error, fault%status == status_no_answer, fault%message)
      first = findloc(watcher%kinetic > 100*watcher%start, .true., dim=1)
      if (first == 0) first = size(watcher%kinetic)
      call expect_true(error, size(watcher%kinetic) - first <= 10, 'found late')
      call expect_true(error, watcher%rescued >= 0 .and. &
        & watcher%rescued_energy <= 1.1_wp*watcher%start, 'the last good state is none')
      if (allocated(error)) return
    end do
    call expect_true(error, found >= 3, 'no step was unstable')
  end subroutine test_growth

  !> A state that was kept for its kinetic energy is not shown if all energies are too much.
  subroutine test_shown(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(watcher_type) :: watcher
    type(good_state_type) :: good
    type(instant_type) :: instant
    type(fault_type), allocatable :: fault
    type(energies_type) :: energies
    integer :: i

    call swinging(set_up, error)
    if (allocated(error)) return
    set_up%system%state%u(:, 1) = 1.0e-3_wp*set_up%system%body%x(:, 1)
    call energies_of(set_up%system, set_up%system%state%v, energies)
    do i = 0, 1
      watcher%rescued = -1
      instant%step = 3
      call keep_good(good, set_up%system, instant, &
        & energies%kinetic + (0.9_wp + 0.2_wp*i)*energies%strain)
      if (allocated(fault)) deallocate (fault)
      allocate (fault)
      fault%message = 'a fault'
      call show_good(good, set_up%system, watcher, fault)
      call check(error, watcher%rescued, merge(3, -1, i == 1))
      if (allocated(error)) return
    end do
  end subroutine test_shown

end module test_motion_energy_watch
