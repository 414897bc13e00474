!> Files a scene names: reading text whole, and where a relative path is looked for.
module pd_scene_format_file
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i8
  use pd_base_system, only: available_memory
  use pd_base_text, only: with_unit
  implicit none (type, external)
  private
  public :: read_text_file, open_text_file, resolve_path, line_type, split_lines, byte_order_mark

  !> What some programs write before a text in UTF-8.
  character(*), parameter :: byte_order_mark = char(239)//char(187)//char(191)

  !> One line of text, of any length, without its end mark.
  type :: line_type
    character(:), allocatable :: text
  end type line_type

contains

  !> The whole of a file as it stands, line ends included. An error if it cannot be opened or read,
  !> if it is empty, or far larger than what memory has room for. A pipe, which has no size, counts
  !> as empty: to open it could mean to wait for ever.
  subroutine read_text_file(path, text, error)
    character(*), intent(in) :: path                !! of the file
    character(:), allocatable, intent(out) :: text  !! all of it; '' after an error
    type(error_type), allocatable, intent(out) :: error
    integer(i8), parameter :: copies = 8_i8  !! of the text, as it is cut into lines and words
    integer :: unit, status
    integer(i8) :: length
    character(512) :: reason

    text = ''
    call open_text_file(path, unit, length, error)
    if (allocated(error)) return
    if (length > available_memory()/copies) then
      call fail(error, "the file '"//path//"' is too large: its "//with_unit(real(length, wp), &
        & 'B', 3)//' are more than can be read with '// &
        & with_unit(real(available_memory(), wp), 'B', 3)//' of memory')
      close (unit)
      return
    end if
    reason = ''
    deallocate (text)
    allocate (character(length) :: text, stat=status, errmsg=reason)
    if (status == 0) read (unit, iostat=status, iomsg=reason) text
    close (unit)
    if (status /= 0) then
      text = ''
      call fail(error, "cannot read the file '"//path//"': "//trim(reason))
    end if
  end subroutine read_text_file

  !> Open a file to read its bytes. An error, and no unit, if it is not there or cannot be opened,
  !> or if it is empty, as a pipe is.
  subroutine open_text_file(path, unit, length, error)
    character(*), intent(in) :: path       !! of the file
    integer, intent(out) :: unit           !! for reading by `pos` or on, from the first byte
    integer(i8), intent(out) :: length     !! [bytes]
    type(error_type), allocatable, intent(out) :: error
    integer :: status
    character(512) :: reason
    logical :: exists

    unit = 0
    inquire (file=path, exist=exists, size=length)
    if (.not. exists) then
      call fail(error, "cannot find the file '"//path//"'")
      return
    else if (length <= 0_i8) then
      call fail(error, "the file '"//path//"' is empty, or no plain file")
      return
    end if
    reason = ''
    open (newunit=unit, file=path, status='old', action='read', access='stream', &
      & form='unformatted', iostat=status, iomsg=reason)
    if (status /= 0) call fail(error, "cannot open the file '"//path//"': "//trim(reason))
  end subroutine open_text_file

  !> Where a file named in a scene is: absolute names as they are; others are looked for in the
  !> folder of `scene_file`, then in the working directory. If it is in neither, the name in the
  !> scene's folder is returned, so that a message names the place where it should be.
  function resolve_path(name, scene_file) result(path)
    character(*), intent(in) :: name        !! as the scene gives it; blanks at its end do not count
    character(*), intent(in) :: scene_file  !! path of the scene; without a folder it is the working
                                            !! directory
    character(:), allocatable :: path
    integer :: slash
    logical :: exists

    path = trim(name)
    if (index(path, '/') == 1) return
    slash = index(scene_file, '/', back=.true.)
    if (slash == 0) return
    path = scene_file(:slash)//trim(name)
    inquire (file=path, exist=exists)
    if (exists) return
    inquire (file=trim(name), exist=exists)
    if (exists) path = trim(name)
  end function resolve_path

  !> The lines of a text, which end with a line feed, a carriage return or both. A byte order mark
  !> is dropped.
  subroutine split_lines(text, lines)
    character(*), intent(in) :: text  !! of a file, with its line ends
    type(line_type), allocatable, intent(out) :: lines(:)  !! (lines), without their ends
    character(*), parameter :: line_feed = achar(10), carriage_return = achar(13)
    integer(i8) :: i, first, begin
    integer :: pass, count

    begin = 1_i8
    if (len(text) >= len(byte_order_mark)) then
      if (text(:len(byte_order_mark)) == byte_order_mark) begin = len(byte_order_mark) + 1
    end if
    do pass = 1, 2
      count = 0
      first = begin
      do i = begin, len(text, i8)
        if (text(i:i) /= line_feed .and. text(i:i) /= carriage_return) cycle
        if (text(i:i) == line_feed .and. i > begin) then
          ! the second half of one line end
          if (text(i - 1:i - 1) == carriage_return) then
            first = i + 1
            cycle
          end if
        end if
        count = count + 1
        if (pass == 2) lines(count)%text = text(first:i - 1)
        first = i + 1
      end do
      if (first <= len(text, i8)) then
        count = count + 1
        if (pass == 2) lines(count)%text = text(first:)
      end if
      if (pass == 1) allocate (lines(count))
    end do
  end subroutine split_lines

end module pd_scene_format_file
