!> Files a scene names: reading text whole, and where a relative path is looked for.
module pd_scene_file
  use pd_base_error, only: error_type, fail
  implicit none (type, external)
  private
  public :: read_text_file, resolve_path, line_type, split_lines

  !> One line of text, of any length, without its end mark.
  type :: line_type
    character(:), allocatable :: text
  end type line_type

contains

  !> The whole of a file as it stands, line ends included. An error if it cannot be opened or read.
  subroutine read_text_file(path, text, error)
    character(*), intent(in) :: path
    character(:), allocatable, intent(out) :: text
    type(error_type), allocatable, intent(out) :: error
    integer :: unit, status, length
    character(256) :: reason
    logical :: exists

    text = ''
    inquire (file=path, exist=exists)
    if (.not. exists) then
      call fail(error, "cannot find the file '"//path//"'")
      return
    end if
    reason = ''
    open (newunit=unit, file=path, status='old', action='read', access='stream', &
      & form='unformatted', iostat=status, iomsg=reason)
    if (status /= 0) then
      call fail(error, "cannot open the file '"//path//"': "//trim(reason))
      return
    end if
    inquire (unit=unit, size=length)
    if (length > 0) then
      deallocate (text)
      allocate (character(length) :: text)
      read (unit, iostat=status, iomsg=reason) text
    end if
    close (unit)
    if (status /= 0) then
      text = ''
      call fail(error, "cannot read the file '"//path//"': "//trim(reason))
    end if
  end subroutine read_text_file

  !> Where a file named in a scene is: absolute names as they are; others are looked for in the
  !> folder of `scene_file`, then in the working directory. If it is in neither, the name in the
  !> scene's folder is returned, so that a message names the place where it should be.
  function resolve_path(name, scene_file) result(path)
    character(*), intent(in) :: name
    character(*), intent(in) :: scene_file
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

  !> The lines of a text. Carriage returns at line ends and a byte order mark are dropped.
  subroutine split_lines(text, lines)
    character(*), intent(in) :: text
    type(line_type), allocatable, intent(out) :: lines(:)
    character(*), parameter :: byte_order_mark = char(239)//char(187)//char(191)
    integer :: i, count, first, last

    count = 0
    do i = 1, len(text)
      if (text(i:i) == new_line('a')) count = count + 1
    end do
    if (len(text) > 0) then
      if (text(len(text):) /= new_line('a')) count = count + 1
    end if
    allocate (lines(count))
    first = 1
    if (len(text) >= 3) then
      if (text(:3) == byte_order_mark) first = 4
    end if
    do i = 1, count
      last = index(text(first:), new_line('a'))
      if (last == 0) then
        last = len(text)
      else
        last = first + last - 2
      end if
      lines(i)%text = text(first:last)
      first = last + 2
      last = len(lines(i)%text)
      if (last == 0) cycle
      if (lines(i)%text(last:) == achar(13)) lines(i)%text = lines(i)%text(:last - 1)
    end do
  end subroutine split_lines

end module pd_scene_file
