!> Tables of numbers.
module test_scene_format_table
  use pd_base_kinds, only: wp
  use pd_base_error, only: scene_error => error_type
  use pd_scene_format_table, only: column_of, read_table, read_table_text, table_type
  use test_scene_expect, only: expect_parts, line
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_format_table

  character(10), parameter :: names(3) = [character(10) :: 'velocity_x', 'velocity_y', 'heat']

contains

  subroutine collect_scene_format_table(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('rows, comments and separators', test_rows), &
      & new_unittest('a header names the columns', test_header), &
      & new_unittest('errors have a place', test_faults), &
      & new_unittest('faults of headers', test_header_faults), &
      & new_unittest('numbers that are too small become 0', test_tiny), &
      & new_unittest('many rows', test_many), &
      & new_unittest('a table from a file', test_file)]
  end subroutine collect_scene_format_table

  subroutine test_rows(error)
    type(error_type), allocatable, intent(out) :: error
    type(table_type) :: table
    type(scene_error), allocatable :: found

    call read_table_text('# x y'//line//line//' 1  2.5'//achar(9)//'# two'//achar(13)//line// &
      & '-3e2,1d-3', 't.txt', table, found)
    call check(error,.not. allocated(found), 'refused')
    if (allocated(error)) return
    call check(error, size(table%values, 1) == 2 .and. size(table%values, 2) == 2)
    if (allocated(error)) return
    call check(error, table%values(2, 1), 2.5_wp)
    if (allocated(error)) return
    call check(error, table%values(1, 2), -300.0_wp)
    if (allocated(error)) return
    call check(error, table%values(2, 2), 1.0e-3_wp)
    if (allocated(error)) return
    call check(error, all(table%lines == [3, 4]) .and. size(table%names) == 0)
  end subroutine test_rows

  !> Computed tables hold the rounding errors of other programs, down to denormal numbers and below.
  subroutine test_tiny(error)
    type(error_type), allocatable, intent(out) :: error
    type(table_type) :: table
    type(scene_error), allocatable :: found
    character(8), parameter :: words(5) = [character(8) :: '1e-31', '-3e-45', '1d-310', '-7e-999', &
      & '1e-99999']
    integer :: i

    do i = 1, size(words)
      call read_table_text('2.0 '//trim(words(i))//line//'1.0 0', 't.txt', table, found)
      call check(error,.not. allocated(found), trim(words(i))//' is refused')
      if (allocated(error)) return
      call check(error, abs(table%values(2, 1)) <= 0.0_wp, trim(words(i))//' is not 0')
      if (allocated(error)) return
      call check(error, table%values(1, 1), 2.0_wp)
      if (allocated(error)) return
    end do
    call read_table_text('1 1e31', 't.txt', table, found)
    call check(error, allocated(found), 'a huge number passes')
  end subroutine test_tiny

  subroutine test_header(error)
    type(error_type), allocatable, intent(out) :: error
    type(table_type) :: table
    type(scene_error), allocatable :: found

    call read_table_text('HEAT velocity_x'//line//'1 2', 't.txt', table, found, allowed=names)
    call check(error,.not. allocated(found), 'refused')
    if (allocated(error)) return
    call check(error, column_of(table, 'velocity_x'), 2)
    if (allocated(error)) return
    call check(error, column_of(table, 'heat'), 1)
    if (allocated(error)) return
    call check(error, column_of(table, 'velocity_y'), 0)
    if (allocated(error)) return
    call check(error, table%values(2, 1), 2.0_wp)
  end subroutine test_header

  subroutine refuse(error, text, parts, columns)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text, parts
    integer, intent(in), optional :: columns
    type(table_type) :: table
    type(scene_error), allocatable :: found

    if (allocated(error)) return
    call read_table_text(text, 't.txt', table, found, columns)
    call expect_parts(error, found, parts)
  end subroutine refuse

  subroutine test_faults(error)
    type(error_type), allocatable, intent(out) :: error
    call refuse(error, '1 2'//line//'3 4 5', 'wrong number of columns|t.txt:2|expected 2, found 3')
    call refuse(error, '1 2 3', 'wrong number of columns|t.txt:1|expected 4, found 3', 4)
    call refuse(error, '1 2'//line//'# 3'//line//'4 x', &
      & "bad value 'x'|t.txt:3|  ^ expected a number")
    call refuse(error, '1 nan', "bad value 'nan'|finite")
    call refuse(error, '1 1e999', "bad value '1e999'|expected a size")
    call refuse(error, '1 2-', "bad value '2-'")
    call refuse(error, '1 2-5', "bad value '2-5'")
    call refuse(error, '1 1.2.3', "bad value '1.2.3'")
    call refuse(error, '1 2e', "bad value '2e'")
    call refuse(error, '1 2*3', "bad value '2*3'")
    call refuse(error, 'x y', "bad value 'x'")
    call refuse(error, '# nothing'//line, 'the table has no rows|t.txt')
    call refuse(error, '', 'the table has no rows|t.txt')
  end subroutine test_faults

  subroutine test_header_faults(error)
    type(error_type), allocatable, intent(out) :: error
    type(table_type) :: table
    type(scene_error), allocatable :: found

    call read_table_text('heat velocity_z'//line//'1 2', 't.txt', table, found, allowed=names)
    call expect_parts(error, found, "unknown column 'velocity_z'|t.txt:1|did you mean 'velocity_")
    if (allocated(error)) return
    call read_table_text('1 2'//line//'1 2', 't.txt', table, found, allowed=names)
    call expect_parts(error, found, "unknown column '1'|must name the columns|allowed: velocity_x")
    if (allocated(error)) return
    call read_table_text('heat heat', 't.txt', table, found, allowed=names)
    call expect_parts(error, found, "column 'heat' is given twice|t.txt:1")
    if (allocated(error)) return
    call read_table_text('heat'//line//'1 2', 't.txt', table, found, allowed=names)
    call expect_parts(error, found, 'wrong number of columns|t.txt:2|expected 1, found 2')
    if (allocated(error)) return
    call read_table_text('heat', 't.txt', table, found, allowed=names)
    call expect_parts(error, found, 'the table has no rows')
  end subroutine test_header_faults

  subroutine test_many(error)
    type(error_type), allocatable, intent(out) :: error
    type(table_type) :: table
    type(scene_error), allocatable :: found
    integer, parameter :: rows = 20000
    character(30), allocatable :: text(:)
    character(:), allocatable :: whole
    integer :: i

    allocate (text(rows))
    do i = 1, rows
      write (text(i), '(i0,1x,es16.8)') i, 1.0_wp/real(i, wp)
      text(i) (30:) = line
    end do
    allocate (character(30*rows) :: whole)
    whole = transfer(text, whole)
    call read_table_text(whole, 't.txt', table, found)
    call check(error,.not. allocated(found), 'refused')
    if (allocated(error)) return
    call check(error, size(table%values, 2), rows)
    if (allocated(error)) return
    call check(error, sum(table%values(1, :)), 0.5_wp*rows*(rows + 1))
    if (allocated(error)) return
    call check(error, table%values(2, rows), 1.0_wp/rows, thr=1.0e-7_wp, rel=.true.)
  end subroutine test_many

  subroutine test_file(error)
    type(error_type), allocatable, intent(out) :: error
    type(table_type) :: table
    type(scene_error), allocatable :: found
    character(*), parameter :: path = 'test_scene_format_table.txt'
    integer :: unit

    call read_table('no/such.txt', table, found)
    call expect_parts(error, found, "cannot find the file 'no/such.txt'")
    if (allocated(error)) return
    open (newunit=unit, file=path, action='write', status='replace')
    write (unit, '(a)') '0 1 2 3', '4 5 6 7'
    close (unit)
    call read_table(path, table, found, columns=4)
    open (newunit=unit, file=path)
    close (unit, status='delete')
    call check(error,.not. allocated(found), 'refused')
    if (allocated(error)) return
    call check(error, table%values(4, 2), 7.0_wp)
  end subroutine test_file

end module test_scene_format_table
