!> Tables that grow line by line beside the results: `iterations.csv`, the convergence of a
!> relaxation, `fragments.csv`, and the profiles along lines. They are not part of a checkpoint: a
!> restarted run keeps the lines up to where it continues, and adds to them. An error is set if the
!> file cannot be read or written.
module pd_output_results_lines
  use pd_base_error, only: error_type
  use pd_base_kinds, only: i8
  use pd_base_text, only: newline
  use pd_output_results_files, only: file_exists
  use pd_output_results_sink, only: sink_type
  use pd_scene_format_file, only: read_text_file
  implicit none (type, external)
  private
  public :: lines_type

  type :: lines_type
    private
    type(sink_type) :: sink
    integer(i8) :: written_at = 0   !! clock count of the last flush
    logical :: begun = .false.
  contains
    procedure :: begin
    procedure :: has_begun
    procedure :: add
    procedure :: hand_over
    procedure :: sync
    procedure :: close => close_lines
  end type lines_type

contains

  !> Make the file `path`, with the lines of an older one whose first number (a step or an output)
  !> is at most `last`, if it is to `go_on`.
  subroutine begin(self, path, head, go_on, last, error)
    class(lines_type), intent(inout) :: self  !! open on return, behind the lines that stay
    character(*), intent(in) :: path               !! of the file
    character(*), intent(in) :: head               !! names of the columns, parted by commas
    logical, intent(in) :: go_on                   !! keep lines of an older file
    integer, intent(in) :: last  !! number of the last line that stays; not used without `go_on`
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: text
    integer :: first, length, number, status

    self%begun = .true.
    text = ''
    if (go_on .and. file_exists(path)) call read_text_file(path, text, error)
    if (allocated(error)) return
    call self%sink%open(path//'.part', error)
    if (.not. allocated(error)) call self%sink%line(head, error)
    first = index(text, newline) + 1
    do while (.not. allocated(error))
      ! a line that was cut off has no end
      length = index(text(first:), newline)
      if (length == 0) exit
      read (text(first:first + length - 1), *, iostat=status) number
      if (status /= 0 .or. number > last) exit
      call self%sink%put(text(first:first + length - 1), error)
      first = first + length
    end do
    if (.not. allocated(error)) call self%sink%flush(error)
    if (.not. allocated(error)) call self%sink%rename(path, error)
  end subroutine begin

  !> Whether the file has been made.
  pure logical function has_begun(self)
    class(lines_type), intent(in) :: self  !! the table
    has_begun = self%begun
  end function has_begun

  !> Add a line, which reaches the file within about a second.
  subroutine add(self, line, error)
    class(lines_type), intent(inout) :: self  !! begun
    character(*), intent(in) :: line  !! values in the order of the file's head, parted by commas
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: now, rate

    call self%sink%line(line, error)
    if (allocated(error)) return
    call system_clock(now, rate)
    if (now - self%written_at < rate) return
    self%written_at = now
    call self%sink%flush(error)
  end subroutine add

  !> Hand all lines to the system.
  subroutine hand_over(self, error)
    class(lines_type), intent(inout) :: self  !! begun
    type(error_type), allocatable, intent(out) :: error
    call self%sink%flush(error)
  end subroutine hand_over

  !> Wait until all lines are on the disk.
  subroutine sync(self, error)
    class(lines_type), intent(inout) :: self  !! begun or not
    type(error_type), allocatable, intent(out) :: error
    if (self%sink%is_open()) call self%sink%sync(error)
  end subroutine sync

  !> Complete the file.
  subroutine close_lines(self, error)
    class(lines_type), intent(inout) :: self  !! begun or not; not open on return
    type(error_type), allocatable, intent(out) :: error
    if (self%sink%is_open()) call self%sink%close(error)
  end subroutine close_lines

end module pd_output_results_lines
