!> The watch over energies: silent where energy is paid for, and not where it comes from nowhere.
module test_motion_watch
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use, intrinsic :: iso_fortran_env, only: compiler_options
  use pd_base_kinds, only: wp
  use pd_motion_watch, only: watch_type
  use testdrive, only: check, error_type, new_unittest, skip_test, unittest_type
  implicit none (type, external)
  private
  public :: collect_motion_watch

contains

  subroutine collect_motion_watch(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('energy that is exchanged is no fault', test_exchange), &
      & new_unittest('energy that is supplied is no fault', test_supplied), &
      & new_unittest('a load that begins to push is no fault', test_begin), &
      & new_unittest('energy from nowhere is found', test_nowhere), &
      & new_unittest('no number is no energy', test_no_number), &
      & new_unittest('states are kept rarely and only good ones', test_kept)]
  end subroutine collect_motion_watch

  !> 1 J that swings between motion and strain, with errors that a coarse step makes.
  subroutine test_exchange(error)
    type(error_type), allocatable, intent(out) :: error
    type(watch_type) :: watch
    integer :: n

    do n = 0, 100
      call watch%supplied(0.0_wp)
      call watch%look(n, 1.3_wp*cos(0.3_wp*n)**2, sin(0.3_wp*n)**2, 0.0_wp, 0.0_wp)
      call watch%look_at_kinetic(2.0_wp)
    end do
    call check(error, watch%sound)
  end subroutine test_exchange

  !> A body at rest that is driven: a million times the energy, all of it work, later drawn off.
  subroutine test_supplied(error)
    type(error_type), allocatable, intent(out) :: error
    type(watch_type) :: watch
    integer :: n

    call watch%look(0, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    do n = 1, 1000
      call watch%supplied(1.0_wp*n**2)
      call watch%look_at_kinetic(0.7_wp*n**2)
      call watch%look(n, 0.7_wp*n**2, 0.2_wp*n**2, 0.1_wp*n**2, 1.0_wp*n**2)
    end do
    call watch%supplied(0.0_wp)
    call watch%look(1001, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp)
    call watch%supplied(0.0_wp)
    call check(error, watch%sound)
  end subroutine test_supplied

  !> Velocities at the instant of a first push come before any work has been done.
  subroutine test_begin(error)
    type(error_type), allocatable, intent(out) :: error
    type(watch_type) :: watch

    call watch%look(0, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    call watch%look_at_kinetic(0.0_wp)
    call watch%supplied(0.0_wp)
    call watch%look(1, 0.125_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    call watch%supplied(1.0_wp)
    call watch%look_at_kinetic(0.5_wp)
    call check(error, watch%sound)
  end subroutine test_begin

  !> Kinetic energy is found at once, all energies a step later, at a little more than a hundred
  !> times what there can be.
  subroutine test_nowhere(error)
    type(error_type), allocatable, intent(out) :: error
    type(watch_type) :: watch
    real(wp) :: energy, supply

    call watch%look(0, 2.0_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    call watch%supplied(1.0_wp)
    call watch%look_at_kinetic(299.0_wp)
    call check(error, watch%sound)
    if (allocated(error)) return
    call watch%look_at_kinetic(301.0_wp)
    call check(error, .not. watch%sound)
    if (allocated(error)) return
    call watch%found(energy, supply)
    call check(error, abs(energy - 301.0_wp) <= 0.0_wp .and. abs(supply - 3.0_wp) <= 0.0_wp)
    if (allocated(error)) return

    watch = watch_type()
    call watch%look(0, 2.0_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    call watch%look(7, 100.0_wp, 100.0_wp, 1.0_wp, 0.0_wp)
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
    call watch%look(0, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    call watch%look(1, none, 0.0_wp, 0.0_wp, 0.0_wp)
    call watch%supplied(0.0_wp)
    call check(error, .not. watch%sound)
  end subroutine test_no_number

  !> Looks are due at 0, 50, 100, 200, 400, 800, 1200 .. unless somebody has looked; a state whose
  !> energies are off by more than a tenth is not kept.
  subroutine test_kept(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: expected(8) = [0, 50, 100, 200, 400, 800, 1200, 1600]
    type(watch_type) :: watch
    integer :: n, found
    logical :: kept

    found = 0
    do n = 0, 1700
      if (watch%look_is_due(n)) call watch%look(n, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp)
      if (.not. watch%keeps(n)) cycle
      found = found + 1
      call check(error, n, expected(min(8, found)))
      if (allocated(error)) return
    end do
    call check(error, found, 8)
    if (allocated(error)) return
    call watch%look(2500, 1.2_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    kept = watch%keeps(2500)
    call check(error, .not. kept)
    if (allocated(error)) return
    call watch%look(2600, 1.05_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    kept = watch%keeps(2600)
    call check(error, kept)
  end subroutine test_kept

end module test_motion_watch
