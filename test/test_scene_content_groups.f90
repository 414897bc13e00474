!> A group that the program does not know, added to the table from outside: it is read, described,
!> written, changed and compared like any other.
module test_scene_content_groups
  use pd_base_error, only: scene_error => error_type
  use pd_base_kinds, only: wp
  use pd_scene_content_check, only: check_scene
  use pd_scene_content_compare, only: difference_type, scene_differences
  use pd_scene_content_groups, only: list_groups
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_reference, only: write_reference
  use pd_scene_content_types, only: group_table, name_length, scene_type
  use pd_scene_content_write, only: commented_text, scene_text
  use pd_scene_format_file, only: line_type
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: change_harmless, change_refused, group_type
  use bodies, only: expect, expect_true
  use test_scene_expect, only: changes_of, expect_fault, expect_parts, good_head, line
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_content_groups

  !> `&wind`: may be repeated.
  type, extends(group_type) :: wind_group
    character(name_length) :: name = ''
    real(wp) :: speed = 3.0_wp                !! [m/s]
    real(wp) :: direction(3) = 0.0_wp
    real(wp), allocatable :: gusts(:)         !! [m/s]
  contains
    procedure :: visit => visit_wind
    procedure, nopass :: change_of => change_of_wind
  end type wind_group

  !> `&weather`: given at most once.
  type, extends(group_type) :: weather_group
    logical :: rain = .false.
  contains
    procedure :: visit => visit_weather
  end type weather_group

  character(*), parameter :: windy = good_head//'&time steps = 5 /'//line// &
    & "&wind name = 'north' speed = 7.5 direction = 0, 1, 0 gusts = 9, 2*11 /"//line// &
    & '&weather rain = .true. /'//line//"&wind name = 'west' /"//line

contains

  subroutine collect_scene_content_groups(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('an added group is read', test_read), &
      & new_unittest('errors in an added group', test_wrong), &
      & new_unittest('without the table it is unknown', test_unknown), &
      & new_unittest('an added group is written and read back', test_write), &
      & new_unittest('its reference and its template', test_reference), &
      & new_unittest('its keys can be set', test_set), &
      & new_unittest('scenes that differ in it', test_compare), &
      & new_unittest('tables longer than there was room for', test_long), &
      & new_unittest('every group of the program is in the scene', test_own)]
  end subroutine collect_scene_content_groups

  subroutine visit_wind(group, keys)
    class(wind_group), intent(inout) :: group
    type(keys_type), intent(inout) :: keys

    call keys%key('name', group%name, 'name of the wind', required=.true., word=.true.)
    call keys%key('speed', group%speed, 'm/s', 'mean speed', above=0.0_wp)
    call keys%key('direction', group%direction, '-', 'where it comes from')
    call keys%list('gusts', group%gusts, 'm/s', 'speeds of gusts')
  end subroutine visit_wind

  pure integer function change_of_wind(key) result(change)
    character(*), intent(in) :: key
    change = merge(change_harmless, change_refused, key == 'name')
  end function change_of_wind

  subroutine visit_weather(group, keys)
    class(weather_group), intent(inout) :: group
    type(keys_type), intent(inout) :: keys
    call keys%key('rain', group%rain, 'whether it rains')
  end subroutine visit_weather

  !> The program's table and two lines more.
  subroutine wider_table(table)
    type(group_table), intent(out) :: table
    call list_groups(table)
    call table%add('wind', 'A wind that blows over the bodies.', .true., wind_group())
    call table%add('weather', 'What the weather is like.', .false., weather_group())
  end subroutine wider_table

  subroutine read_windy(text, scene, found, changes)
    character(*), intent(in) :: text
    type(scene_type), intent(out) :: scene
    type(scene_error), allocatable, intent(out) :: found
    character(*), intent(in), optional :: changes   !! `group%key=value|...`
    type(group_table) :: table
    type(line_type), allocatable :: list(:)
    call wider_table(table)
    allocate (list(0))
    if (present(changes)) call changes_of(changes, list)
    call read_scene_text(text, 'a/b.nml', scene, found, list, table)
  end subroutine read_windy

  subroutine test_read(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: found

    call read_windy(windy, scene, found)
    if (allocated(found)) then
      call test_failed(error, found%message)
      return
    end if
    call check(error, size(scene%added), 3)
    if (allocated(error)) return
    call check(error, scene%time%steps, 5, 'the other groups are read, too')
    if (allocated(error)) return
    call expect_wind(error, scene, 1, 'north', 7.5_wp, 3)
    call expect_wind(error, scene, 2, 'west', 3.0_wp, 0)
    if (allocated(error)) return
    call check(error, trim(scene%added(3)%name), 'weather')
    if (allocated(error)) return
    select type (weather => scene%added(3)%group)
    type is (weather_group)
      call check(error, weather%rain)
    class default
      call test_failed(error, 'the weather is another group')
    end select
    if (allocated(error)) return
    call read_windy(good_head//'&time steps = 5 /', scene, found)
    call check(error, .not. allocated(found) .and. size(scene%added) == 0, 'a scene without them')
  end subroutine test_read

  !> Wind number `i` of the scene has this name, this speed, and so many gusts, 9, 11, 11 [m/s].
  subroutine expect_wind(error, scene, i, name, speed, gusts)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: i, gusts
    character(*), intent(in) :: name
    real(wp), intent(in) :: speed

    if (allocated(error)) return
    select type (wind => scene%added(i)%group)
    type is (wind_group)
      call check(error, trim(wind%name), name)
      if (allocated(error)) return
      call expect(error, wind%speed, speed, 0.0_wp, 'speed')
      if (allocated(error)) return
      if (gusts == 0) then
        call expect_true(error, .not. allocated(wind%gusts), 'no gusts')
      else
        call expect(error, sum(wind%gusts), 31.0_wp, 0.0_wp, 'gusts')
        call expect_true(error, size(wind%gusts) == gusts, 'number of gusts')
      end if
    class default
      call test_failed(error, 'wind is another group')
    end select
  end subroutine expect_wind

  subroutine test_wrong(error)
    type(error_type), allocatable, intent(out) :: error

    call wrong('&wind name = ''n'''//line//'  spead = 3 /', &
      & "unknown key 'spead' in group &wind|a/b.nml:5|spead = 3 /|  ^^^^^ did you mean "// &
      & "'speed'?|known: name, speed, direction, gusts")
    call wrong('&wind speed = 3 /', "group &wind lacks the key 'name'|a/b.nml:4|name of the wind")
    call wrong("&wind name = 'n' speed = -1 /", 'out of range in group &wind|expected > 0')
    call wrong("&wind name = 'n' name = 'm' /", "duplicate key 'name' in group &wind")
    call wrong('&weather /&weather /', 'group &weather is given twice|it may be given only once')
    call wrong('&wnd /', "unknown group &wnd|did you mean '&wind'?|study, wind, weather")

  contains

    subroutine wrong(text, parts)
      character(*), intent(in) :: text, parts
      type(scene_type) :: scene
      type(scene_error), allocatable :: found
      if (allocated(error)) return
      call read_windy(good_head//'&time steps = 5 /'//text, scene, found)
      call expect_parts(error, found, parts)
    end subroutine wrong
  end subroutine test_wrong

  subroutine test_unknown(error)
    type(error_type), allocatable, intent(out) :: error
    call expect_fault(error, windy, 'unknown group &wind|a/b.nml:5|known: scene, define')
  end subroutine test_unknown

  subroutine test_write(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: first, second
    type(scene_error), allocatable :: found
    character(:), allocatable :: text

    call read_windy(windy, first, found)
    text = scene_text(first)
    call check(error, index(text, '&wind'//line//"  name = 'north'"//line//'  speed = 7.5'//line) &
      & > 0 .and. index(text, '&weather'//line//'  rain = .true.') > 0, text)
    if (allocated(error)) return
    call read_windy(text, second, found)
    if (allocated(found)) then
      call test_failed(error, found%message)
      return
    end if
    call expect_wind(error, second, 1, 'north', 7.5_wp, 3)
    call expect_wind(error, second, 2, 'west', 3.0_wp, 0)
    if (allocated(error)) return
    call check(error, scene_text(second), text)
    if (allocated(error)) return
    ! a checked scene stays as it is, and a copy has its groups
    second = first
    call check_scene(second, found)
    call check(error, scene_text(second), text)
  end subroutine test_write

  subroutine test_reference(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: found
    type(group_table) :: table
    character(:), allocatable :: text
    character(1000) :: row
    integer :: unit, status

    call wider_table(table)
    open (newunit=unit, status='scratch', action='readwrite')
    call write_reference(unit, 'wind', found, table=table)
    call check(error, .not. allocated(found), 'the group has no reference')
    rewind (unit)
    text = ''
    do
      read (unit, '(a)', iostat=status) row
      if (status /= 0) exit
      text = text//trim(row)//line
    end do
    close (unit)
    if (allocated(error)) return
    call check(error, index(text, '## &wind') == 1 .and. &
      & index(text, 'A wind that blows') > 0 .and. &
      & index(text, 'May be given several times.') > 0 .and. &
      & index(text, '| `speed`     | real      | m/s  | 3.0           | mean speed; > 0 |') > 0, &
      & text)
    if (allocated(error)) return
    call read_windy(windy, scene, found)
    text = commented_text(scene)
    call check(error, index(text, '! A wind that blows over the bodies.'//line//'&wind') > 0 .and. &
      & index(text, '  speed = 7.5 ') > 0 .and. index(text, '  ! speed = 3.0 ') > 0 .and. &
      & index(text, '! mean speed [m/s]; > 0') > 0, text)
    if (allocated(error)) return
    call read_windy(text, scene, found)
    if (allocated(found)) call test_failed(error, found%message)
  end subroutine test_reference

  subroutine test_set(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: found

    call read_windy(windy, scene, found, 'wind(2)%speed=4.5|rain=.false.')
    if (allocated(found)) then
      call test_failed(error, found%message)
      return
    end if
    call expect_wind(error, scene, 2, 'west', 4.5_wp, 0)
    if (allocated(error)) return
    call check(error, index(scene_text(scene), '  rain = .false.') > 0, 'rain')
    if (allocated(error)) return
    call read_windy(windy, scene, found, 'wind%speed=4.5')
    call expect_parts(error, found, '2 groups &wind|say which: wind(1)%speed')
    if (allocated(error)) return
    call read_windy(windy, scene, found, 'wind(1)%spead=4.5')
    call expect_parts(error, found, "&wind has no key 'spead'|did you mean 'speed'?")
  end subroutine test_set

  subroutine test_compare(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: first, second
    type(scene_error), allocatable :: found
    type(difference_type), allocatable :: differences(:)
    type(group_table) :: table

    call wider_table(table)
    call read_windy(windy, first, found)
    call read_windy(windy, second, found, 'wind(2)%speed=4.5|wind(1)%name=south')
    differences = scene_differences(scene_text(first), scene_text(second))
    call check(error, size(differences), 2)
    if (allocated(error)) return
    call check(error, differences(1)%text, "&wind name: 'north' -> 'south'")
    if (allocated(error)) return
    call check(error, differences(2)%text, '&wind number 2 speed: 3.0 -> 4.5')
    if (allocated(error)) return
    associate (wind => table%entries(table%place_of('wind'))%fresh, &
      & weather => table%entries(table%place_of('weather'))%fresh)
      call check(error, wind%change_of('name') == change_harmless .and. &
        & wind%change_of('speed') == change_refused .and. &
        & weather%change_of('rain') == change_refused, 'what a change means to a restart')
    end associate
  end subroutine test_compare

  !> Groups that are added keep their places when the table grows.
  subroutine test_long(error)
    type(error_type), allocatable, intent(out) :: error
    type(group_table) :: table, copy
    type(keys_type) :: keys
    integer :: i, known

    call list_groups(table)
    known = table%count
    do i = 1, 26
      call table%add('wind_'//achar(96 + i), 'One of many.', .true., wind_group(speed=real(i, wp)))
    end do
    copy = table
    call check(error, copy%count, known + 26)
    if (allocated(error)) return
    call check(error, copy%place_of('body'), 3)
    if (allocated(error)) return
    call check(error, copy%place_of('wind_z'), known + 26)
    if (allocated(error)) return
    call copy%describe('wind_t', keys)
    call check(error, keys%known(2)%default, '20.0')
    if (allocated(error)) return
    call copy%describe('horizon', keys)
    call check(error, keys%known(1)%name, 'ratio')
  end subroutine test_long

  !> Room is made where the scene has its groups, not among those that are added.
  subroutine test_own(error)
    type(error_type), allocatable, intent(out) :: error
    type(group_table) :: table
    type(scene_type) :: scene
    integer :: g

    call list_groups(table)
    do g = 1, table%count
      if (table%entries(g)%repeatable) call table%make_room(scene, g, g)
      call check(error, table%number_in(scene, g), merge(g, 1, table%entries(g)%repeatable), &
        & trim(table%entries(g)%name))
      if (allocated(error)) return
    end do
    call check(error, .not. allocated(scene%added), 'a group of the program is an added one')
    if (allocated(error)) return
    call check(error, size(scene%bodies) == table%place_of('body') .and. &
      & size(scene%removed) == table%place_of('remove') .and. &
      & size(scene%regions) == table%place_of('region') .and. &
      & size(scene%materials) == table%place_of('material') .and. &
      & size(scene%cracks) == table%place_of('crack') .and. &
      & size(scene%no_fail) == table%place_of('no_fail') .and. &
      & size(scene%initial) == table%place_of('initial') .and. &
      & size(scene%boundaries) == table%place_of('boundary') .and. &
      & size(scene%loads) == table%place_of('load') .and. &
      & size(scene%probes) == table%place_of('probe') .and. &
      & size(scene%tips) == table%place_of('tip') .and. &
      & size(scene%sections) == table%place_of('section') .and. &
      & size(scene%lines) == table%place_of('line') .and. &
      & size(scene%j_integrals) == table%place_of('j_integral') .and. &
      & size(scene%studies) == table%place_of('study'), 'a list belongs to another group')
  end subroutine test_own

end module test_scene_content_groups
