!> Tables whose rows begin with a number that ascends: the convergence of a relaxation,
!> `iterations.csv`, with a line for each iteration that is due; the profiles along a line. They are
!> not part of a checkpoint: a restarted run keeps the lines up to where it continues, and adds to
!> them. An error is set if the file cannot be read or written.
module pd_output_results_iterations
  use pd_base_error, only: error_type
  use pd_base_kinds, only: i8
  use pd_base_text, only: newline
  use pd_output_results_files, only: file_exists
  use pd_output_results_sink, only: sink_type
  use pd_scene_format_file, only: read_text_file
  implicit none (type, external)
  private
  public :: iterations_type

  character(*), &
    & parameter :: head = 'step,load_step,time,iteration,solver,residual,change,broken_bonds'

  type :: iterations_type
    private
    type(sink_type) :: sink
    integer(i8) :: written_at = 0   !! clock count of the last flush
    logical :: begun = .false.
  contains
    procedure :: begin
    procedure :: has_begun
    procedure :: add
    procedure :: flush => flush_iterations
    procedure :: sync
    procedure :: close => close_iterations
  end type iterations_type

contains

  !> Make the file `path`, with the lines of an older one whose step (the first number) is at most
  !> `last`, if it is to `go_on`.
  subroutine begin(self, path, go_on, last, error, names)
    class(iterations_type), intent(inout) :: self  !! open on return, behind the lines that stay
    character(*), intent(in) :: path               !! of the file
    logical, intent(in) :: go_on                   !! keep lines of an older file
    integer, intent(in) :: last  !! step of the last line that stays; not used without `go_on`
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in), optional :: names
      !! of the columns, parted by commas; without, those of iterations
    character(:), allocatable :: text, titles
    integer :: first, length, step, status

    self%begun = .true.
    titles = head
    if (present(names)) titles = names
    text = ''
    if (go_on .and. file_exists(path)) call read_text_file(path, text, error)
    if (allocated(error)) return
    call self%sink%open(path//'.part', error)
    if (.not. allocated(error)) call self%sink%line(titles, error)
    first = index(text, newline) + 1
    do while (.not. allocated(error))
      ! a line that was cut off has no end
      length = index(text(first:), newline)
      if (length == 0) exit
      read (text(first:first + length - 1), *, iostat=status) step
      if (status /= 0 .or. step > last) exit
      call self%sink%put(text(first:first + length - 1), error)
      first = first + length
    end do
    if (.not. allocated(error)) call self%sink%flush(error)
    if (.not. allocated(error)) call self%sink%rename(path, error)
  end subroutine begin

  !> Whether the file has been made.
  pure logical function has_begun(self)
    class(iterations_type), intent(in) :: self  !! the file of iterations
    has_begun = self%begun
  end function has_begun

  !> Add a line, which reaches the file within about a second.
  subroutine add(self, line, error)
    class(iterations_type), intent(inout) :: self  !! begun
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
  subroutine flush_iterations(self, error)
    class(iterations_type), intent(inout) :: self  !! begun
    type(error_type), allocatable, intent(out) :: error
    call self%sink%flush(error)
  end subroutine flush_iterations

  !> Wait until all lines are on the disk.
  subroutine sync(self, error)
    class(iterations_type), intent(inout) :: self  !! begun or not
    type(error_type), allocatable, intent(out) :: error
    if (self%sink%is_open()) call self%sink%sync(error)
  end subroutine sync

  !> Complete the file.
  subroutine close_iterations(self, error)
    class(iterations_type), intent(inout) :: self  !! begun or not; not open on return
    type(error_type), allocatable, intent(out) :: error
    if (self%sink%is_open()) call self%sink%close(error)
  end subroutine close_iterations

end module pd_output_results_iterations
