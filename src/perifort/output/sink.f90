!> Text files written piece by piece, with certainty that what was written is there.
module pd_output_sink
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: i8
  use pd_base_text, only: newline
  implicit none (type, external)
  private
  public :: sink_type

  !> A text file under way.
  type :: sink_type
    private
    integer :: unit = -1
    character(:), allocatable :: path
    integer(i8) :: bytes = 0  !! written so far
  contains
    procedure :: open => open_sink
    procedure :: put
    procedure :: line
    procedure :: flush => flush_sink
    procedure :: close => close_sink
    procedure :: is_open
  end type sink_type

contains

  !> Make the file, or empty one that is there.
  subroutine open_sink(self, path, error)
    class(sink_type), intent(out) :: self
    character(*), intent(in) :: path
    type(error_type), allocatable, intent(out) :: error
    character(512) :: message
    integer :: status

    self%path = path
    open (newunit=self%unit, file=path, access='stream', form='unformatted', action='write', &
      & status='replace', iostat=status, iomsg=message)
    if (status == 0) return
    self%unit = -1
    call fail(error, 'cannot make '//path//': '//trim(message))
  end subroutine open_sink

  !> Write a piece of text.
  subroutine put(self, text, error)
    class(sink_type), intent(inout) :: self
    character(*), intent(in) :: text
    type(error_type), allocatable, intent(out) :: error
    character(512) :: message
    integer :: status

    write (self%unit, iostat=status, iomsg=message) text
    if (status /= 0) call fail(error, 'cannot write '//self%path//': '//trim(message))
    self%bytes = self%bytes + len(text)
  end subroutine put

  !> Write a line.
  subroutine line(self, text, error)
    class(sink_type), intent(inout) :: self
    character(*), intent(in) :: text
    type(error_type), allocatable, intent(out) :: error
    call self%put(text//newline, error)
  end subroutine line

  !> Hand all to the system. That a buffer couldn't be written is seen only by the file's
  !> size: the runtime library keeps the reason to itself.
  subroutine flush_sink(self, error)
    class(sink_type), intent(inout) :: self
    type(error_type), allocatable, intent(out) :: error
    character(512) :: message
    integer(i8) :: bytes
    integer :: status

    message = ''
    flush (self%unit, iostat=status, iomsg=message)
    inquire (file=self%path, size=bytes)
    if (status == 0 .and. bytes == self%bytes) return
    if (message == '') message = 'the disk takes no more (is it full?)'
    call fail(error, 'cannot write '//self%path//': '//trim(message))
  end subroutine flush_sink

  !> Complete the file.
  subroutine close_sink(self, error)
    class(sink_type), intent(inout) :: self
    type(error_type), allocatable, intent(out) :: error
    integer :: status

    if (self%unit == -1) return
    call self%flush(error)
    close (self%unit, iostat=status)
    self%unit = -1
    if (status /= 0 .and. .not. allocated(error)) call fail(error, 'cannot complete '//self%path)
  end subroutine close_sink

  !> Whether the file is open.
  pure logical function is_open(self)
    class(sink_type), intent(in) :: self
    is_open = self%unit /= -1
  end function is_open

end module pd_output_sink
