!> Scanning: places of groups, keys and values, and everything that is no scene.
module test_scene_format_source
  use pd_base_error, only: scene_error => error_type
  use pd_scene_format_source, only: scan_source, source_fault, source_type
  use test_scene_expect, only: expect_fault, expect_parts, good_head, line
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_format_source

contains

  subroutine collect_scene_format_source(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('groups, keys and values have places', test_places), &
      & new_unittest('comments and quotes are masked', test_masked), &
      & new_unittest('tabs, line ends and a byte order mark', test_bytes), &
      & new_unittest('a very long line', test_long_line), &
      & new_unittest('text outside of groups', test_outside), &
      & new_unittest('a group that is not closed', test_not_closed), &
      & new_unittest('values that are empty', test_empty), &
      & new_unittest('quotes that are not closed', test_quotes), &
      & new_unittest('equals signs out of place', test_equals), &
      & new_unittest('carets are under the error', test_carets)]
  end subroutine collect_scene_format_source

  subroutine scan(error, text, source)
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in) :: text
    type(source_type), intent(out) :: source
    type(scene_error), allocatable :: found

    call scan_source(text, 'a.nml', source, found)
    call check(error,.not. allocated(found), 'the scan failed')
  end subroutine scan

  subroutine test_places(error)
    type(error_type), allocatable, intent(out) :: error
    type(source_type) :: source

    call scan(error, '&One a = 1 b(2) = 2*3,'//line//'4 /'//line//'  &two C ( 1 : 2 ) = 7 /', &
      & source)
    if (allocated(error)) return
    call check(error, source%section_count, 2)
    if (allocated(error)) return
    call check(error, source%sections(1)%name//' '//source%sections(2)%name, 'one two')
    if (allocated(error)) return
    call check(error, source%sections(2)%line == 3 .and. source%sections(2)%column == 3)
    if (allocated(error)) return
    call check(error, source%entry_count, 3)
    if (allocated(error)) return
    associate (b => source%entries(2), c => source%entries(3))
      call check(error, b%key//' '//b%subscript//' '//c%key//c%subscript, 'b 2 c 1 : 2 ')
      if (allocated(error)) return
      call check(error, b%line == 1 .and. b%column == 12 .and. b%width == 1)
      if (allocated(error)) return
      call check(error, b%last - b%first + 1, 2)
      if (allocated(error)) return
      call check(error, source%tokens(b%first)%repeat, 2)
      if (allocated(error)) return
      call check(error, source%tokens(b%last)%text, '4')
      if (allocated(error)) return
      call check(error, source%tokens(b%last)%line, 2)
    end associate
  end subroutine test_places

  subroutine test_masked(error)
    type(error_type), allocatable, intent(out) :: error
    type(source_type) :: source

    call scan(error, '! &no a = 1'//line//"&a x = 'it''s / & = !', y = ""q'"" ! / z = 3"//line// &
      & '!/'//line//'/ ! done', source)
    if (allocated(error)) return
    call check(error, source%entry_count, 2)
    if (allocated(error)) return
    call check(error, source%tokens(1)%text, "it's / & = !")
    if (allocated(error)) return
    call check(error, source%tokens(2)%text, "q'")
  end subroutine test_masked

  subroutine test_bytes(error)
    type(error_type), allocatable, intent(out) :: error
    type(source_type) :: source
    character(*), parameter :: tab = achar(9), mark = char(239)//char(187)//char(191)

    call scan(error, mark//'&a'//achar(13)//line//tab//'x'//tab//'='//tab//'1'//achar(13)//line// &
      & '/', source)
    if (allocated(error)) return
    call check(error, source%tokens(1)%text, '1')
    if (allocated(error)) return
    call check(error, source%entries(1)%column, 2)
  end subroutine test_bytes

  subroutine test_long_line(error)
    type(error_type), allocatable, intent(out) :: error

    ! Long enough to be cut in the message; the fault must still be seen.
    call expect_fault(error, good_head//'&time '//repeat(' ', 5000)//'stps = 1'// &
      & repeat(' ', 3000)//'/', '^^^^ did you mean|stps = 1')
  end subroutine test_long_line

  subroutine test_outside(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, 'hello', 'text outside of any group|a/b.nml:1|^^^^^')
    call expect_fault(error, '&scene dimension = 2 /'//line//'  plane = ''stress'' /', &
      & 'text outside of any group|a/b.nml:2|closed &scene')
    call expect_fault(error, '&body file = cloud/points.txt /', 'outside|a/b.nml:1|needs quotes')
    call expect_fault(error, '& scene /', "'&' without the name|a/b.nml:1")
    call expect_fault(error, '! nothing', 'no groups|a/b.nml|scene, define, body')
    call expect_fault(error, '', 'no groups')
  end subroutine test_outside

  subroutine test_not_closed(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, '&scene dimension = 2', 'group &scene is not closed|a/b.nml:1|end of')
    call expect_fault(error, '&scene dimension = 2 ! /'//line//line//'&body /', &
      & "group &scene is not closed|a/b.nml:1|'&body' on line 3")
  end subroutine test_not_closed

  subroutine test_empty(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, '&time steps = /', "key 'steps' in group &time has no value|b.nml:1")
    call expect_fault(error, '&time steps ='//line//' step = 1 /', "'steps'|has no value|:1")
    call expect_fault(error, '&time steps = &'//line//'/', "'steps'|has no value|:1")
    call expect_fault(error, '&body lower = 0,, 1 /', 'empty value|b.nml:1')
    call expect_fault(error, '&body lower = , 1 /', 'empty value|b.nml:1')
    call expect_fault(error, '&body lower = 3* /', 'empty value|repeat count')
    call expect_fault(error, '&body lower = 0*1 /', 'bad repeat count')
    call expect_fault(error, '&body lower = 99999999999*1 /', 'bad repeat count')
    call expect_fault(error, '&scene title = '''' /', "empty text for key 'title'|b.nml:1")
  end subroutine test_empty

  subroutine test_quotes(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, '&scene'//line//" title = 'abc /"//line//'/', &
      & 'unclosed quote|a/b.nml:2|^^^^^^')
    call expect_fault(error, '&scene title = "it''s /', 'unclosed quote|closing "')
  end subroutine test_quotes

  subroutine test_equals(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, '&time = 3 /', "'=' without a key")
    call expect_fault(error, '&time steps == 3 /', "'=' without a key")
    call expect_fault(error, '&time steps 3 /', 'a value without a key in group &time|key = value')
  end subroutine test_equals

  subroutine test_carets(error)
    type(error_type), allocatable, intent(out) :: error
    type(source_type) :: source
    type(scene_error), allocatable :: found

    call scan(error, '&a'//line//achar(9)//'name = '''//char(195)//char(164)//''' x = 1'// &
      & line//'/', source)
    if (allocated(error)) return
    ! A tab stays a tab, and the two bytes of an umlaut take one column.
    call source_fault(source, 2, 14, 1, 'oops', 'why', found)
    call expect_parts(error, found, 'oops'//line//' --> a.nml:2'//line//'  2 | '//achar(9)// &
      & 'name = '''//char(195)//char(164)//''' x = 1'//line//'    | '//achar(9)// &
      & '           ^ why')
  end subroutine test_carets

end module test_scene_format_source
