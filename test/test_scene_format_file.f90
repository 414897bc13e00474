!> Files: whole texts, lines, and where names lead.
module test_scene_format_file
  use pd_base_error, only: scene_error => error_type
  use pd_scene_format_file, only: line_type, read_text_file, resolve_path, split_lines
  use test_scene_expect, only: expect_parts, line
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_format_file

contains

  subroutine collect_scene_format_file(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('lines', test_lines), &
      & new_unittest('a file is read completely', test_whole), &
      & new_unittest('a folder is not a file', test_folder), &
      & new_unittest('the path of a name', test_resolve)]
  end subroutine collect_scene_format_file

  subroutine test_lines(error)
    type(error_type), allocatable, intent(out) :: error
    type(line_type), allocatable :: lines(:)

    call split_lines('', lines)
    call check(error, size(lines), 0)
    if (allocated(error)) return
    call split_lines('a'//line//line//'bc'//achar(13)//line//'d', lines)
    call check(error, size(lines), 4)
    if (allocated(error)) return
    call check(error, lines(1)%text//'|'//lines(2)%text//'|'//lines(3)%text//'|'//lines(4)%text, &
      & 'a||bc|d')
    if (allocated(error)) return
    call split_lines('a'//line, lines)
    call check(error, size(lines), 1)
  end subroutine test_lines

  subroutine test_whole(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_error), allocatable :: found
    character(:), allocatable :: text
    character(*), parameter :: path = 'test_scene_format_file.txt'
    integer :: unit

    open (newunit=unit, file=path, access='stream', form='unformatted', status='replace')
    write (unit) 'a'//achar(13)//line//' b'
    close (unit)
    call read_text_file(path, text, found)
    call check(error, text, 'a'//achar(13)//line//' b')
    open (newunit=unit, file=path, status='replace')
    close (unit)
    if (allocated(error)) return
    call read_text_file(path, text, found)
    call expect_parts(error, found, path//"' is empty")
    open (newunit=unit, file=path)
    close (unit, status='delete')
  end subroutine test_whole

  subroutine test_folder(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_error), allocatable :: found
    character(:), allocatable :: text

    call read_text_file('/', text, found)
    call expect_parts(error, found, "the file '/'")
  end subroutine test_folder

  subroutine test_resolve(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: path = 'test_scene_file_2.txt'
    integer :: unit

    call check(error, resolve_path('/x/y', 'a/b.nml'), '/x/y')
    if (allocated(error)) return
    call check(error, resolve_path('c.txt', 'b.nml'), 'c.txt')
    if (allocated(error)) return
    call check(error, resolve_path('c.txt', 'a/b.nml'), 'a/c.txt')
    if (allocated(error)) return
    open (newunit=unit, file=path, status='replace')
    call check(error, resolve_path(path, 'a/b.nml'), path)
    close (unit, status='delete')
  end subroutine test_resolve

end module test_scene_format_file
