!> Arguments -> one command -> exit status.
program main
  use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
  use pd_base_error, only: error_type
  use pd_base_text, only: printable
  use pd_command_line, only: command_line_type, read_command_line
  use pd_commands, only: execute
  implicit none (type, external)

  type(command_line_type) :: line
  type(error_type), allocatable :: error
  integer :: status

  call read_command_line(line, error)
  if (.not. allocated(error)) call execute(line, error)

  status = 0
  if (allocated(error)) then
    flush (output_unit)
    write (error_unit, '(2a)') 'error: ', printable(error%message)
    status = error%status
  end if
  ! Quiet: the notes on floating-point flags that gfortran adds to `stop` say nothing to a user.
  stop status, quiet=.true.
end program main
