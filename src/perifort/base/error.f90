!> One error type for the whole program. Procedures that can fail take
!> `type(error_type), allocatable, intent(out) :: error` as their last argument, set it and return;
!> callers return at once if it is allocated. Only the main program stops, and `internal_fault`.
module pd_base_error
  implicit none (type, external)
  private
  public :: error_type, fail, internal_fault, status_input, status_usage, status_no_answer, &
    & status_interrupted

  integer, parameter :: status_input = 1        !! the input or the environment is at fault
  integer, parameter :: status_usage = 2        !! wrong command line
  integer, parameter :: status_no_answer = 3    !! unstable or not converged; the history is kept
  integer, parameter :: status_interrupted = 4  !! interrupted by the user, state kept

  type :: error_type
    character(:), allocatable :: message  !! what was wrong, what was expected, what is allowed
    integer :: status = status_input      !! the program's exit status
    character(:), allocatable :: group    !! the group of a scene that is to blame, if it is known
    integer :: number = 0                 !! which one of that name
    logical :: everywhere = .false.       !! all ranks have it
    logical :: elsewhere = .false.        !! another rank has found it and knows more
  end type error_type

contains

  !> Allocate `error` with a message and an exit status (default: `status_input`). `group` and
  !> `number` name the group of a scene with the error; its place in the file is added later.
  pure subroutine fail(error, message, status, group, number)
    type(error_type), allocatable, intent(out) :: error  !! allocated on return, with what follows
    character(*), intent(in) :: message  !! what was wrong, what was expected, what is allowed
    integer, intent(in), optional :: status      !! exit status of the program, one of `status_*`;
                                                 !! absent: `status_input`
    character(*), intent(in), optional :: group  !! name of the scene's group that is to blame;
                                                 !! absent: not known
    integer, intent(in), optional :: number      !! which one of the groups of that name, from 1;
                                                 !! absent: 0, not known

    allocate (error)
    error%message = message
    if (present(status)) error%status = status
    if (present(group)) error%group = group
    if (present(number)) error%number = number
  end subroutine fail

  !> Stop where the program contradicts itself, as in a choice between things of which one is not
  !> known: no input can cause it, and the result would be wrong without notice.
  pure subroutine internal_fault(what)
    character(*), intent(in) :: what  !! what was asked for and is not there
    error stop 'perifort: internal fault: '//what
  end subroutine internal_fault

end module pd_base_error
