!> Values that nobody should write, for every key of every group as the program declares them: each
!> is refused at its place. New keys are covered without a word here.
module test_scene_hostile
  use pd_base_error, only: scene_error => error_type
  use pd_scene_format_file, only: line_type, read_text_file, split_lines
  use pd_scene_content_groups, only: list_groups
  use pd_scene_format_keys, only: keys_type
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: group_table, scene_type
  use test_scene_expect, only: expect_fault, expect_parts, line
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_hostile

  integer, parameter :: wide = 24
  character(wide), parameter :: no_number(12) = [character(wide) :: 'NaN', '-nan', 'Infinity', &
    & '-inf', '1e31', '1e-31', '1e400', '1e99999999999', '1.0.0', 'abc', "'1'", '.true.']
  character(wide), parameter :: no_count(8) = [character(wide) :: '1.5', '2147483648', &
    & '9223372036854775808', '1e12', 'NaN', 'abc', "'1'", '.true.']
  character(wide), parameter :: no_text(4) = [character(wide) :: '1', 'bare', "''", '.true.']
  character(wide), parameter :: no_logical(4) = [character(wide) :: '1', 'yes', "'.true.'", 'NaN']
  character(wide), parameter :: no_value(4) = [character(wide) :: '', ',', '''open', '0*1']

contains

  subroutine collect_scene_hostile(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('values of a wrong kind are refused at every key', test_wrong_kind), &
      & new_unittest('texts that are too long are refused at every key', test_too_long), &
      & new_unittest('too many values are refused at every key', test_too_many), &
      & new_unittest('control characters are refused', test_control), &
      & new_unittest('lines end in three ways', test_line_ends), &
      & new_unittest('a file without size is not opened', test_no_size), &
      & new_unittest('more points than there is room for', test_too_many_points)]
  end subroutine collect_scene_hostile

  !> `&group` with one key must be refused at line 2 with the key's name in the message.
  subroutine refuse(error, group, key, value)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: group, key, value
    type(scene_type) :: scene
    type(scene_error), allocatable :: found
    character(:), allocatable :: text

    if (allocated(error)) return
    text = '&'//group//line//' '//key//' = '//value//line//'/'//line
    call read_scene_text(text, 'a/b.nml', scene, found)
    if (.not. allocated(found)) then
      call test_failed(error, 'accepted: '//text)
    else if (index(found%message, 'a/b.nml:2') == 0 .or. index(found%message, key) == 0) then
      call test_failed(error, 'no place or key: '//text//found%message)
    end if
  end subroutine refuse

  subroutine test_wrong_kind(error)
    type(error_type), allocatable, intent(out) :: error
    type(group_table) :: table
    type(keys_type) :: keys
    integer :: g, k, tried

    tried = 0
    call list_groups(table)
    do g = 1, table%count
      call table%describe(trim(table%entries(g)%name), keys)
      do k = 1, keys%count
        associate (info => keys%known(k))
          call refuse_all(info%name, no_value)
          if (info%kind == 'real list') then
            ! tables may have numbers that are 0 but for rounding
            call refuse_all(info%name, pack(no_number, no_number /= '1e-31'))
          else if (info%kind == 'real or expression') then
            call refuse_all(info%name, pack(no_number, no_number /= "'1'"))
          else if (index(info%kind, 'real') == 1) then
            call refuse_all(info%name, no_number)
          else if (index(info%kind, 'integer') == 1) then
            call refuse_all(info%name, no_count)
          else if (index(info%kind, 'text') == 1) then
            call refuse_all(info%name, no_text)
          else if (info%kind /= 'list') then  ! of which any value is right
            call check(error, info%kind, 'logical')
            call refuse_all(info%name, no_logical)
          end if
        end associate
        if (allocated(error)) return
      end do
    end do
    ! a sweep over nothing would pass as well
    call check(error, tried > 80, 'too few keys were tried')

  contains

    subroutine refuse_all(key, values)
      character(*), intent(in) :: key, values(:)
      integer :: i

      tried = tried + 1
      do i = 1, size(values)
        call refuse(error, trim(table%entries(g)%name), key, trim(values(i)))
      end do
    end subroutine refuse_all
  end subroutine test_wrong_kind

  subroutine test_too_long(error)
    type(error_type), allocatable, intent(out) :: error
    type(group_table) :: table
    type(keys_type) :: keys
    integer :: g, k

    call list_groups(table)
    do g = 1, table%count
      call table%describe(trim(table%entries(g)%name), keys)
      do k = 1, keys%count
        if (index(keys%known(k)%kind, 'text') == 1) call refuse(error, &
          & trim(table%entries(g)%name), &
          & keys%known(k)%name, "'"//repeat('x', 2000)//"'")
        if (index(keys%known(k)%kind, 'text') /= 1) call refuse(error, &
          & trim(table%entries(g)%name), &
          & keys%known(k)%name, repeat('9', 2000))
      end do
    end do
  end subroutine test_too_long

  !> Millions by a repeat count, too, which must not take the time and memory that they ask for.
  subroutine test_too_many(error)
    type(error_type), allocatable, intent(out) :: error
    type(group_table) :: table
    type(keys_type) :: keys
    integer :: g, k

    call list_groups(table)
    do g = 1, table%count
      call table%describe(trim(table%entries(g)%name), keys)
      do k = 1, keys%count
        if (index(keys%known(k)%kind, 'text') == 1) cycle
        call refuse(error, trim(table%entries(g)%name), keys%known(k)%name, '2147483647*1')
      end do
    end do
  end subroutine test_too_many

  subroutine test_control(error)
    type(error_type), allocatable, intent(out) :: error
    call expect_fault(error, "&scene dimension = 2"//line//"title = 'a"//achar(27)//"[2J' /", &
      & 'a control character, byte 27|a/b.nml:2')
    call expect_fault(error, achar(0)//'&scene /', 'a control character, byte 0|a/b.nml:1')
    call expect_fault(error, '&scene /'//line//'! '//achar(127), 'byte 127|a/b.nml:2')
  end subroutine test_control

  subroutine test_line_ends(error)
    type(error_type), allocatable, intent(out) :: error
    character, parameter :: feed = achar(10), back = achar(13)
    type(line_type), allocatable :: lines(:)

    call split_lines('a'//back//'b'//back//feed//'c'//feed//feed//'d'//back, lines)
    call check(error, size(lines), 5)
    if (allocated(error)) return
    call check(error, lines(1)%text//'|'//lines(2)%text//'|'//lines(3)%text//'|'//lines(4)%text// &
      & '|'//lines(5)%text, 'a|b|c||d')
  end subroutine test_line_ends

  !> A pipe has no size, and to open it would be to wait; a device neither.
  subroutine test_no_size(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_error), allocatable :: found
    character(:), allocatable :: text

    call read_text_file('/dev/zero', text, found)
    call expect_parts(error, found, "'/dev/zero' is empty, or no plain file")
  end subroutine test_no_size

  subroutine test_too_many_points(error)
    type(error_type), allocatable, intent(out) :: error
    call expect_fault(error, '&scene dimension = 3 /&time steps = 1 /'// &
      & '&material youngs_modulus = 1 density = 1 '// &
      & 'poissons_ratio = 0 /'//line//'&body lower = 0 0 0 upper = 1 1 1'//line// &
      & 'points = 10000 10000 10000 /', 'too many points: 1e12|a/b.nml:3|400 TB of memory')
  end subroutine test_too_many_points

end module test_scene_hostile
