!> Signals are noted. (A second interrupt would end the test program, as it should.)
module test_base_interrupt
  use, intrinsic :: iso_c_binding, only: c_int
  use pd_base_interrupt, only: interrupted, watch_for_interrupt
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_base_interrupt

  interface
    !> POSIX: send a signal to this program.
    function posix_raise(number) bind(c, name='raise') result(status)
      import :: c_int
      implicit none (type, external)
      integer(c_int), value :: number
      integer(c_int) :: status
    end function posix_raise
  end interface

contains

  subroutine collect_base_interrupt(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('the first signal is noted', test_signals), &
      & new_unittest('repeated signals are harmless', test_repeated)]
  end subroutine collect_base_interrupt

  !> Interrupt, termination and warning, each after watching anew.
  subroutine test_signals(error)
    type(error_type), allocatable, intent(out) :: error
    integer(c_int), parameter :: signals(3) = [2_c_int, 15_c_int, 10_c_int]
    integer :: i

    do i = 1, size(signals)
      call watch_for_interrupt()
      call check(error, .not. interrupted(), 'nothing has happened yet')
      if (allocated(error)) return
      call check(error, posix_raise(signals(i)) == 0_c_int, 'the signal was sent')
      if (allocated(error)) return
      call check(error, interrupted(), 'the signal is noted')
      if (allocated(error)) return
    end do
    call watch_for_interrupt()
  end subroutine test_signals

  !> A queue's signals, sent again while the run ends, leave it alone.
  subroutine test_repeated(error)
    type(error_type), allocatable, intent(out) :: error
    integer(c_int), parameter :: signals(4) = [15_c_int, 15_c_int, 10_c_int, 10_c_int]
    integer :: i

    call watch_for_interrupt()
    do i = 1, size(signals)
      call check(error, posix_raise(signals(i)) == 0_c_int, 'the signal was sent')
      if (allocated(error)) return
    end do
    call check(error, interrupted(), 'the signals are noted')
    call watch_for_interrupt()
  end subroutine test_repeated

end module test_base_interrupt
