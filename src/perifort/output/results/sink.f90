!> Text files written piece by piece, with a check that all data were written.
!>
!> The C library's streams are used because they report whether buffered text reached the file; a
!> Fortran runtime library may lose that news. An error names the file and, where it can be found,
!> the system's reason.
module pd_output_results_sink
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_int, c_loc, c_null_char, &
    & c_null_ptr, c_ptr, c_size_t
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: i8
  use pd_base_text, only: newline
  use pd_output_results_files, only: cut_file, rename_file, sync_path
  implicit none (type, external)
  private
  public :: sink_type

  !> An open text file.
  type :: sink_type
    private
    type(c_ptr) :: stream = c_null_ptr
    character(:), allocatable :: path
    integer(i8) :: bytes = 0  !! written so far
    integer(i8) :: safe = 0   !! certain to be in the file
    logical :: broken = .false.
  contains
    procedure :: open => open_sink
    procedure :: put
    procedure :: line
    procedure :: put_bytes
    procedure :: flush => flush_sink
    procedure :: sync => sync_sink
    procedure :: rename => rename_sink
    procedure :: close => close_sink
    procedure :: is_open
  end type sink_type

  ! allow(C071)
  interface  ! C's texts have no other form
    type(c_ptr) function c_fopen(path, mode) bind(c, name='fopen')
      import :: c_char, c_ptr
      implicit none (type, external)
      character(kind=c_char), intent(in) :: path(*), mode(*)
    end function c_fopen

    integer(c_size_t) function c_fwrite(place, size, count, stream) bind(c, name='fwrite')
      import :: c_ptr, c_size_t
      implicit none (type, external)
      type(c_ptr), value :: place
      integer(c_size_t), value :: size, count
      type(c_ptr), value :: stream
    end function c_fwrite

    integer(c_int) function c_fflush(stream) bind(c, name='fflush')
      import :: c_int, c_ptr
      implicit none (type, external)
      type(c_ptr), value :: stream
    end function c_fflush

    integer(c_int) function c_fclose(stream) bind(c, name='fclose')
      import :: c_int, c_ptr
      implicit none (type, external)
      type(c_ptr), value :: stream
    end function c_fclose
  end interface

contains

  !> Make the file, or empty one that is there.
  subroutine open_sink(self, path, error)
    class(sink_type), intent(out) :: self  !! open on return
    character(*), intent(in) :: path       !! of the file; one that is there is emptied
    type(error_type), allocatable, intent(out) :: error

    self%path = path
    self%stream = c_fopen(path//c_null_char, 'wb'//c_null_char)
    if (.not. c_associated(self%stream)) &
      & call fail(error, 'cannot make '//path//': '//reason_at(path, ''))
  end subroutine open_sink

  !> Write a piece of text.
  subroutine put(self, text, error)
    class(sink_type), intent(inout) :: self   !! open
    character(*), target, intent(in) :: text  !! of any length; nothing is added to it
    type(error_type), allocatable, intent(out) :: error

    if (len(text) > 0) call self%put_bytes(c_loc(text), len(text, kind=i8), error)
  end subroutine put

  !> Write `bytes` bytes from `place`.
  subroutine put_bytes(self, place, bytes, error)
    class(sink_type), intent(inout) :: self  !! open
    type(c_ptr), intent(in) :: place         !! address of the first byte
    integer(i8), intent(in) :: bytes         !! how many
    type(error_type), allocatable, intent(out) :: error
    integer(c_size_t) :: count

    count = c_fwrite(place, 1_c_size_t, int(bytes, c_size_t), self%stream)
    self%bytes = self%bytes + bytes
    if (count == int(bytes, c_size_t)) return
    self%broken = .true.
    call fail(error, 'cannot write '//self%path//': '//reason_at(self%path, '.probe'))
  end subroutine put_bytes

  !> Write a line.
  subroutine line(self, text, error)
    class(sink_type), intent(inout) :: self  !! open
    character(*), intent(in) :: text         !! without its newline
    type(error_type), allocatable, intent(out) :: error
    call self%put(text//newline, error)
  end subroutine line

  !> Hand all to the system.
  subroutine flush_sink(self, error)
    class(sink_type), intent(inout) :: self  !! open; all that was written counts as safe on return
    type(error_type), allocatable, intent(out) :: error

    if (c_fflush(self%stream) == 0 .and. .not. self%broken) then
      self%safe = self%bytes
    else
      self%broken = .true.
      call fail(error, 'cannot write '//self%path//': '//reason_at(self%path, '.probe'))
    end if
  end subroutine flush_sink

  !> Hand all to the system and wait until it is on the disk.
  subroutine sync_sink(self, error)
    class(sink_type), intent(inout) :: self  !! open
    type(error_type), allocatable, intent(out) :: error

    call self%flush(error)
    if (.not. allocated(error)) call sync_path(self%path, error)
  end subroutine sync_sink

  !> Give the open file another name, in place of an older file.
  subroutine rename_sink(self, path, error)
    class(sink_type), intent(inout) :: self  !! open; continues under the new name
    character(*), intent(in) :: path         !! the new name, in the same file system
    type(error_type), allocatable, intent(out) :: error

    call rename_file(self%path, path, error)
    if (.not. allocated(error)) self%path = path
  end subroutine rename_sink

  !> Complete the file; after a failure it ends with the last piece that was flushed.
  subroutine close_sink(self, error)
    class(sink_type), intent(inout) :: self  !! open or not; not open on return
    type(error_type), allocatable, intent(out) :: error
    integer(c_int) :: status

    if (.not. self%is_open()) return
    call self%flush(error)
    status = c_fclose(self%stream)
    self%stream = c_null_ptr
    if (status /= 0 .and. .not. allocated(error)) call fail(error, 'cannot complete '//self%path)
    if (allocated(error)) call cut_file(self%path, self%safe)
  end subroutine close_sink

  !> Whether the file is open.
  logical function is_open(self)
    class(sink_type), intent(in) :: self  !! the text file
    is_open = c_associated(self%stream)
  end function is_open

  !> Why nothing can be written at `path`: C keeps its reason in errno, which has no portable
  !> name, but writing a file beside it fails for the same reason.
  function reason_at(path, suffix) result(reason)
    character(*), intent(in) :: path, suffix
    character(:), allocatable :: reason
    character(:), allocatable :: block
    character(512) :: message
    integer :: unit, status, closed

    message = ''
    open (newunit=unit, file=path//suffix, access='stream', form='unformatted', action='write', &
      & iostat=status, iomsg=message)
    if (status == 0 .and. suffix /= '') then
      allocate (character(524288) :: block)  ! more than the runtime library would keep back
      block(:) = ' '
      write (unit, iostat=status, iomsg=message) block
      close (unit, status='delete', iostat=closed)
      if (status == 0) status = closed
    else if (status == 0) then
      close (unit, iostat=status)
    end if
    reason = 'the system gives no reason (is the disk full?)'
    if (status == 0) return
    reason = trim(message)
    status = index(reason, ': ', back=.true.)
    if (status > 0) reason = reason(status + 2:)
  end function reason_at

end module pd_output_results_sink
