!> Requests to end: the user's interrupt (Ctrl-C), and what a queue sends before it takes a machine
!> away (SIGTERM, or SIGUSR1 as a warning). They are noted, so that a run can end in order. A second
!> interrupt ends the program at once; queues may repeat theirs.
module pd_base_interrupt
  use, intrinsic :: iso_c_binding, only: c_funloc, c_funptr, c_int, c_null_funptr
  implicit none (type, external)
  private
  public :: watch_for_interrupt, interrupted, let_writes_fail, handlers_type, signal_handlers, &
    & put_back_handlers

  integer(c_int), parameter :: sigint = 2_c_int, sigterm = 15_c_int  ! POSIX
  integer(c_int), parameter :: sigusr1 = 10_c_int                    ! Linux
  integer(c_int), parameter :: sigxfsz = 25_c_int                    ! Linux on common processors
  integer(c_int), parameter :: signals(4) = [sigint, sigterm, sigusr1, sigxfsz]
  logical, volatile :: noted = .false.

  !> What a program does at the signals that a run takes for itself.
  type :: handlers_type
    private
    type(c_funptr) :: of(size(signals)) = c_null_funptr
  end type handlers_type

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

  !> What happens at the signals now, to be put back after a run: the run may be called by a program
  !> that has handlers of its own.
  function signal_handlers() result(handlers)
    type(handlers_type) :: handlers
    type(c_funptr) :: ours
    integer :: i

    ! there is no other way to ask than to set one
    do i = 1, size(signals)
      handlers%of(i) = posix_signal(signals(i), c_null_funptr)
      ours = posix_signal(signals(i), handlers%of(i))
    end do
  end function signal_handlers

  !> Restore the signal handlers of the calling program. A request to end that was noted stays noted
  !> until the next `watch_for_interrupt`.
  subroutine put_back_handlers(handlers)
    type(handlers_type), intent(in) :: handlers
    type(c_funptr) :: ours
    integer :: i

    do i = 1, size(signals)
      ours = posix_signal(signals(i), handlers%of(i))
    end do
  end subroutine put_back_handlers

  !> A file beyond the size that the system allows the user (`ulimit -f`) ends the program by a
  !> signal unless that is ignored; then the write fails, and can be reported like a full disk.
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
