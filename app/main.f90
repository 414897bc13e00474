!> Arguments -> one command -> exit status.
program main
  use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
  use pd_base_error, only: error_type
  use pd_base_text, only: printable
  use pd_comm_world, only: abort_world, begin_world, end_world, reports_error, world_type
  use pd_command_line, only: command_line_type, read_command_line
  use pd_commands, only: execute
  implicit none (type, external)

  type(world_type) :: world
  type(command_line_type) :: line
  type(error_type), allocatable :: error
  integer :: status
  logical :: reports

  call begin_world(world)
  call read_command_line(line, error)
  if (.not. allocated(error)) call execute(line, error)

  status = 0
  if (allocated(error)) then
    status = error%status
    flush (output_unit)
    ! what all have found together one is known to report; else the one that does ends the others
    if (error%everywhere) then
      call world%wait_for_all()
      reports = .not. error%elsewhere
    else
      reports = reports_error(world)
    end if
    if (reports) write (error_unit, '(2a)') 'error: ', printable(error%message)
    flush (error_unit)
    if (.not. error%everywhere) call abort_world(status)
  end if
  call end_world()
  ! Quiet: the notes on floating-point flags that gfortran adds to `stop` say nothing to a user.
  stop status, quiet=.true.
end program main
