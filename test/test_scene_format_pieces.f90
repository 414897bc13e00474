!> Tables that are read in pieces: against the same table read whole.
module test_scene_format_pieces
  use pd_base_error, only: scene_error => error_type
  use pd_base_kinds, only: wp, i8
  use pd_scene_format_pieces, only: find_pieces, piece_type, read_piece
  use pd_scene_format_table, only: read_table, table_type
  use bodies, only: expect_true
  use meshes, only: write_file
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_format_pieces

  character(*), parameter :: name = 'test-pieces.txt', path = 'build/'//name
  character(*), parameter :: lf = achar(10), cr = achar(13), tab = achar(9)
  character(*), parameter :: mark = char(239)//char(187)//char(191)

  !> Ends of lines of all kinds, comments and blank lines anywhere, with and without an end.
  character(120), parameter :: texts(7) = [character(120) :: &
    & '1 2'//lf//'3 4'//lf//'5 6'//lf//'7 8'//lf, &
    & mark//'# two columns'//cr//lf//'1 2'//cr//lf//cr//lf//' 3'//tab//'4 # four'//cr//lf//'5,6', &
    & '1 2'//cr//'3 4'//cr//'#'//cr//cr//'5 6', &
    & lf//lf//'# none'//lf//'  '//tab//'1 2 # 3'//lf//lf//'3 4'//lf//lf//'# end'//lf//lf, &
    & '1 2'//lf//cr//'3 4'//cr//lf//lf//'5 6'//lf//'7 8'//cr, &
    & '1 2', &
    & ',1,2'//lf//'#3 4'//lf//'5 6'//lf//'# 7'//cr//'8 9 #'//lf]

contains

  subroutine collect_scene_format_pieces(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('pieces have the rows of the table, and their lines', test_rows), &
      & new_unittest('a piece that spans blocks of the file', test_blocks), &
      & new_unittest('errors in a piece have their place in the file', test_faults)]
  end subroutine collect_scene_format_pieces

  subroutine test_rows(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: i, most

    do i = 1, size(texts)
      call write_file(name, trim(texts(i)))
      do most = 1, 5
        call compare(most, error)
        if (allocated(error)) return
      end do
    end do
    call remove_file()
  end subroutine test_rows

  !> The pieces of the file one after another, against the whole of it.
  subroutine compare(most, error)
    integer, intent(in) :: most   !! rows of a piece
    type(error_type), allocatable, intent(out) :: error
    type(piece_type), allocatable :: pieces(:)
    type(table_type) :: whole, part
    type(scene_error), allocatable :: fault
    integer(i8) :: bytes
    integer :: p, n, rows

    call read_table(path, whole, fault)
    if (.not. allocated(fault)) call find_pieces(path, most, pieces, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    inquire (file=path, size=bytes)
    call expect_true(error, sum(pieces%bytes) == bytes, 'bytes of all pieces')
    call expect_true(error, sum(pieces%rows) == size(whole%values, 2), 'rows of all pieces')
    call expect_true(error, all(pieces%rows <= most .and. pieces%rows > 0), 'rows of a piece')
    if (allocated(error)) return
    n = 0
    do p = 1, size(pieces)
      call read_piece(path, pieces(p), part, fault, columns=2)
      if (allocated(fault)) call test_failed(error, fault%message)
      if (allocated(error)) return
      rows = size(part%values, 2)
      call expect_true(error, rows == pieces(p)%rows, 'rows that were noted')
      if (allocated(error)) return
      call expect_true(error, all(abs(part%values - whole%values(:, n + 1:n + rows)) <= 0.0_wp), &
        & 'values')
      call expect_true(error, all(part%lines == whole%lines(n + 1:n + rows)), 'lines')
      n = n + rows
    end do
  end subroutine compare

  !> Lines end on both sides of the megabytes in which the file is read, also in the middle of a
  !> carriage return and a line feed.
  subroutine test_blocks(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: block = 1048576
    character(:), allocatable :: text
    integer :: shift

    do shift = -2, 2
      text = '# '//repeat('x', block - 9 + shift)//cr//lf//'1 2'//cr//lf//'3 4'//cr//lf//'5 6'//lf
      call write_file(name, text)
      call compare(1, error)
      if (allocated(error)) return
      call compare(2, error)
      if (allocated(error)) return
    end do
    call remove_file()
  end subroutine test_blocks

  !> The message of the whole table, whichever piece the fault is in.
  subroutine test_faults(error)
    type(error_type), allocatable, intent(out) :: error
    character(60), parameter :: wrong(4) = [character(60) :: '1 2'//lf//'3 4'//lf//'5 x'//lf, &
      & '1 2'//lf//'# comment'//lf//'3 4 5'//lf//'6 7', '1 2'//lf//'3 4'//achar(7)//lf//'5 6', &
      & '# nothing'//lf//lf]
    type(piece_type), allocatable :: pieces(:)
    type(table_type) :: table
    type(scene_error), allocatable :: of_table, of_piece
    integer :: i, p

    do i = 1, size(wrong)
      call write_file(name, trim(wrong(i)))
      call read_table(path, table, of_table, columns=2)
      call find_pieces(path, 1, pieces, of_piece)
      if (allocated(of_piece)) call test_failed(error, of_piece%message)
      if (allocated(error)) return
      do p = 1, size(pieces)
        call read_piece(path, pieces(p), table, of_piece, columns=2)
        if (allocated(of_piece)) exit
      end do
      call expect_true(error, allocated(of_table) .and. allocated(of_piece), 'no error')
      if (allocated(error)) return
      call expect_true(error, of_table%message == of_piece%message, of_piece%message)
    end do
    call remove_file()
    call find_pieces(path, 1, pieces, of_piece)
    call expect_true(error, allocated(of_piece), 'a file that is not there')
    if (allocated(error)) return
    call read_table(path, table, of_table, columns=2)
    call expect_true(error, of_table%message == of_piece%message, of_piece%message)
  end subroutine test_faults

  subroutine remove_file()
    integer :: unit
    open (newunit=unit, file=path)
    close (unit, status='delete')
  end subroutine remove_file

end module test_scene_format_pieces
