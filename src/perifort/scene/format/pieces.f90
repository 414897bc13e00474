!> Text tables in pieces of some rows, for whoever must not have all of a file in memory at once.
module pd_scene_format_pieces
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: i8
  use pd_scene_format_file, only: byte_order_mark, open_text_file
  use pd_scene_format_table, only: content_begins, read_table_text, table_type
  implicit none (type, external)
  private
  public :: piece_type, find_pieces, read_piece

  !> Lines of a file that follow each other.
  type :: piece_type
    integer(i8) :: at = 1_i8      !! its first byte in the file, from 1
    integer(i8) :: bytes = 0_i8
    integer(i8) :: lines = 0_i8   !! of the file before it
    integer :: rows = 0           !! lines with values or names in it
  end type piece_type

contains

  !> Go through a file once and note where its pieces are. An error if it cannot be opened or read,
  !> or if it is empty. A file without rows is one piece.
  subroutine find_pieces(path, most, pieces, error)
    character(*), intent(in) :: path  !! of the file
    integer, intent(in) :: most       !! rows of a piece
    type(piece_type), allocatable, intent(out) :: pieces(:)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: length = 1048576
    character(*), parameter :: line_feed = achar(10), carriage_return = achar(13)
    character(:), allocatable :: block
    type(piece_type) :: piece
    integer(i8) :: bytes, at, lines
    integer :: unit, status, i, n, first
    logical :: has_content, in_comment, in_line, after_return
    character(512) :: reason
    character :: byte

    call open_text_file(path, unit, bytes, error)
    if (allocated(error)) return
    reason = ''
    allocate (pieces(0))
    allocate (character(length) :: block)
    lines = 0_i8
    has_content = .false.
    in_comment = .false.
    in_line = .false.
    after_return = .false.
    do at = 0_i8, bytes - 1, length
      n = int(min(int(length, i8), bytes - at))
      read (unit, iostat=status, iomsg=reason) block(:n)
      if (status /= 0) then
        call fail(error, "cannot read the file '"//path//"': "//trim(reason))
        exit
      end if
      first = 1
      if (at == 0_i8 .and. n >= len(byte_order_mark)) then
        if (block(:len(byte_order_mark)) == byte_order_mark) first = len(byte_order_mark) + 1
      end if
      do i = first, n
        byte = block(i:i)
        if (byte == line_feed .and. after_return) then
          ! the second half of one line end
          after_return = .false.
          cycle
        end if
        if (piece%rows == most .and. .not. in_line) call close_piece(at + i)
        after_return = byte == carriage_return
        if (after_return .or. byte == line_feed) then
          call end_line()
        else
          in_line = .true.
          if (.not. (has_content .or. in_comment)) call content_begins(byte, has_content, &
            & in_comment)
        end if
      end do
    end do
    close (unit)
    if (allocated(error)) return
    if (in_line) call end_line()
    if (piece%rows > 0 .or. size(pieces) == 0) then
      call close_piece(bytes + 1)
    else
      associate (last => pieces(size(pieces)))
        last%bytes = bytes + 1 - last%at
      end associate
    end if

  contains

    !> The line ends.
    subroutine end_line()
      lines = lines + 1
      if (has_content) piece%rows = piece%rows + 1
      has_content = .false.
      in_comment = .false.
      in_line = .false.
    end subroutine end_line

    !> The piece ends before a byte.
    subroutine close_piece(next)
      integer(i8), intent(in) :: next
      piece%bytes = next - piece%at
      pieces = [pieces, piece]
      piece = piece_type(at=next, lines=lines)
    end subroutine close_piece
  end subroutine find_pieces

  !> The rows of a piece, with the errors of `read_table` and their places in the file.
  subroutine read_piece(path, piece, table, error, columns, allowed)
    character(*), intent(in) :: path                  !! of the file
    type(piece_type), intent(in) :: piece             !! from `find_pieces`
    type(table_type), intent(out) :: table            !! its rows alone
    type(error_type), allocatable, intent(out) :: error
    integer, intent(in), optional :: columns          !! as in `read_table`
    character(*), intent(in), optional :: allowed(:)  !! as in `read_table`: the piece begins with
                                                      !! a header
    character(:), allocatable :: text
    integer(i8) :: bytes
    integer :: unit, status
    character(512) :: reason

    call open_text_file(path, unit, bytes, error)
    if (allocated(error)) return
    reason = ''
    allocate (character(piece%bytes) :: text)
    read (unit, pos=piece%at, iostat=status, iomsg=reason) text
    close (unit)
    if (status /= 0) then
      call fail(error, "cannot read the file '"//path//"': "//trim(reason))
      return
    end if
    if (present(allowed)) then
      call read_table_text(text, path, table, error, columns, allowed, before=piece%lines)
    else
      call read_table_text(text, path, table, error, columns, before=piece%lines)
    end if
  end subroutine read_piece

end module pd_scene_format_pieces
