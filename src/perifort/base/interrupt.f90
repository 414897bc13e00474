!> Requests to end: the user's interrupt (Ctrl-C), and what a queue sends before it takes a machine
!> away (SIGTERM, or SIGUSR1 as a warning). They are noted, so that a run can end in order. A second
!> interrupt ends the program at once; queues may repeat theirs.
module pd_base_interrupt
  use, intrinsic :: iso_c_binding, only: c_funloc, c_funptr, c_int, c_null_funptr
  implicit none (type, external)
  private
  public :: watch_for_interrupt, interrupted, let_writes_fail

  integer(c_int), parameter :: sigint = 2_c_int, sigterm = 15_c_int  ! POSIX
  integer(c_int), parameter :: sigusr1 = 10_c_int                    ! Linux
  integer(c_int), parameter :: sigxfsz = 25_c_int                    ! Linux on common processors
  logical, volatile :: noted = .false.

  interface
    !> POSIX: call `handler` at a signal; a null pointer is the default action.
    function posix_signal(number, handler) bind(c, name='signal') result(before)
      import :: c_funptr, c_int
      implicit none (type, external)
      integer(c_int), value :: number
      type(c_funptr), value :: handler
      type(c_funptr) :: before
    end function posix_signal
  end interface

contains

  !> From now on requests to end are noted.
  subroutine watch_for_interrupt()
    type(c_funptr) :: before
    noted = .false.
    before = posix_signal(sigint, c_funloc(note))
    before = posix_signal(sigterm, c_funloc(note))
    before = posix_signal(sigusr1, c_funloc(note))
  end subroutine watch_for_interrupt

  !> A file beyond the size that the system allows the user (`ulimit -f`) ends the program by a
  !> signal unless that is ignored; then the write fails, and can be told like a full disk.
  subroutine let_writes_fail()
    type(c_funptr) :: before
    before = posix_signal(sigxfsz, c_funloc(ignore))
  end subroutine let_writes_fail

  !> Do nothing.
  subroutine ignore(number) bind(c)
    integer(c_int), value :: number
    if (number == 0) return
  end subroutine ignore

  !> Whether a request has been noted.
  logical function interrupted()
    interrupted = noted
  end function interrupted

  !> Note the signal; of interrupts the next one has its usual effect.
  subroutine note(number) bind(c)
    integer(c_int), value :: number
    type(c_funptr) :: before
    noted = .true.
    if (number == sigint) before = posix_signal(number, c_null_funptr)
  end subroutine note

end module pd_base_interrupt
