!> Messages of a run on standard output, unless it is quiet.
module pd_output_report_say
  use, intrinsic :: iso_fortran_env, only: output_unit
  use pd_base_text, only: printable
  implicit none (type, external)
  private
  public :: say

contains

  !> Print a text and end its last line.
  subroutine say(text, quiet)
    character(*), intent(in) :: text
    logical, intent(in) :: quiet
    if (.not. quiet) write (output_unit, '(a)') printable(text)
  end subroutine say

end module pd_output_report_say
