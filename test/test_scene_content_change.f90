!> Keys that are given other values: the scene that comes of it, and what is wrong with it.
module test_scene_content_change
  use pd_base_error, only: scene_error => error_type
  use pd_base_kinds, only: wp
  use pd_scene_content_change, only: change_key, find_target, full_name, target_type
  use pd_scene_content_read, only: read_scene_source, read_scene_text
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_write, only: scene_text
  use pd_scene_format_file, only: line_type
  use pd_scene_format_source, only: scan_source, source_type, token_type
  use pd_scene_content_types, only: is_set, scene_type
  use bodies, only: expect, expect_true
  use test_scene_expect, only: changes_of, expect_parts, line
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_content_change

  character(*), parameter :: text = '&scene dimension = 2 /'//line// &
    & "&material name = 'a' youngs_modulus = 1e9 density = 1e3 poissons_ratio = 0.3 /"//line// &
    & "&material name = 'b' youngs_modulus = 2e9 density = 2e3 poissons_ratio = 0.2 /"//line// &
    & "&body name = 'one' material = 'a' lower = 2*0.0 upper = 1, 0.5 points = 100, 50 /"// &
    & line// &
    & '&initial displacement_gradient(1,2) = 0.5 /'//line// &
    & '&time steps = 5 safety = 0.5 /'//line

contains

  subroutine collect_scene_content_change(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('every kind of value is set', test_kinds), &
      & new_unittest('an element leaves the others alone', test_elements), &
      & new_unittest('a group that is not there is made', test_new_group), &
      & new_unittest('other keys and groups stay', test_others), &
      & new_unittest('names in all their forms', test_names), &
      & new_unittest('unknown names', test_bad_names), &
      & new_unittest('a refused value has its place', test_place), &
      & new_unittest('options have the effect of a changed file', test_options), &
      & new_unittest('options that are refused', test_bad_options), &
      & new_unittest('rules find what options change', test_places_of_options)]
  end subroutine collect_scene_content_change

  !> The scene with one key changed; what is wrong is in `found`.
  subroutine changed(name, word, scene, found)
    character(*), intent(in) :: name, word
    type(scene_type), intent(out) :: scene
    type(scene_error), allocatable, intent(out) :: found
    type(source_type) :: source
    type(target_type) :: target
    type(token_type) :: place

    call scan_source(text, 'a.nml', source, found)
    if (allocated(found)) return
    place%line = 6
    place%column = 8
    place%width = 5
    place%text = name
    call find_target(source, name, place, target, found)
    if (.not. allocated(found)) call change_key(source, target, word, place, found)
    if (.not. allocated(found)) call read_scene_source(source, scene, found)
  end subroutine changed

  subroutine accept(error, found)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_error), allocatable, intent(in) :: found
    if (allocated(found) .and. .not. allocated(error)) call test_failed(error, found%message)
  end subroutine accept

  subroutine test_kinds(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: found

    call changed('time%safety', '0.25', scene, found)
    call accept(error, found)
    if (.not. allocated(error)) call expect(error, scene%time%safety, 0.25_wp, 0.0_wp, 'a real')
    call changed('time%steps', '77', scene, found)
    call accept(error, found)
    if (.not. allocated(error)) call expect_true(error, scene%time%steps == 77, 'a whole number')
    call changed('time%integrator', "'runge_kutta'", scene, found)
    call accept(error, found)
    if (.not. allocated(error)) call expect_true(error, scene%time%integrator == 'runge_kutta', &
      & 'a text')
    call changed('material(2)%break_in_compression', '.true.', scene, found)
    call accept(error, found)
    if (.not. allocated(error)) call expect_true(error, scene%materials(2)%break_in_compression &
      & .and. .not. scene%materials(1)%break_in_compression, 'a logical of the second group')
    call changed('body%points', '20, 10', scene, found)
    call accept(error, found)
    if (.not. allocated(error)) call expect_true(error, all(scene%bodies(1)%points(:2) == [20, &
      & 10]), 'a vector')
    call changed('scene%title', "'it''s'", scene, found)
    call accept(error, found)
    if (.not. allocated(error)) call expect_true(error, scene%header%title == "it's", 'a quote')
  end subroutine test_kinds

  !> Elements given together by `2*0.0` are told apart.
  subroutine test_elements(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: found

    call changed('body%lower(2)', '-0.5', scene, found)
    if (allocated(found)) then
      ! the box is no longer made of cubes with these points: the change was made
      call expect_parts(error, found, 'the spacing of the lattice differs|100, 100')
    else
      call test_failed(error, 'a box of other cells was accepted')
    end if
    call changed('body%upper(2)', '0.50', scene, found)
    call accept(error, found)
    if (allocated(error)) return
    call expect(error, scene%bodies(1)%upper(1), 1.0_wp, 0.0_wp, 'the other element')
    call expect(error, scene%bodies(1)%upper(2), 0.5_wp, 0.0_wp, 'the element')
    call expect_true(error,.not. is_set(scene%bodies(1)%upper(3)), 'no third element')
    call changed('initial%displacement_gradient(2,1)', '0.125', scene, found)
    call accept(error, found)
    if (allocated(error)) return
    associate (h => scene%initial(1)%displacement_gradient)
      call expect(error, h(2, 1), 0.125_wp, 0.0_wp, 'an element of a matrix')
      call expect(error, h(1, 2), 0.5_wp, 0.0_wp, 'the one given before')
      call expect(error, sum(abs(h)), 0.625_wp, 0.0_wp, 'and no other')
    end associate
  end subroutine test_elements

  subroutine test_new_group(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: found

    call changed('horizon%ratio', '4.0', scene, found)
    call accept(error, found)
    if (.not. allocated(error)) call expect(error, scene%horizon%ratio, 4.0_wp, 0.0_wp, 'the key')
  end subroutine test_new_group

  subroutine test_others(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: found

    call changed('material(1)%density', '5e3', scene, found)
    call accept(error, found)
    if (allocated(error)) return
    call expect(error, scene%materials(1)%density, 5.0e3_wp, 0.0_wp, 'changed')
    call expect(error, scene%materials(2)%density, 2.0e3_wp, 0.0_wp, 'same key of another group')
    call expect(error, scene%materials(1)%youngs_modulus, 1.0e9_wp, 0.0_wp, 'same group')
    call changed('material(2)%density', '5e3', scene, found)
    call accept(error, found)
    if (allocated(error)) return
    call expect(error, scene%materials(1)%density, 1.0e3_wp, 0.0_wp, 'same key of a group before')
    call expect(error, scene%materials(2)%density, 5.0e3_wp, 0.0_wp, 'changed')
    call expect(error, scene%time%safety, 0.5_wp, 0.0_wp, 'a group behind it')
    call expect_true(error, scene%time%steps == 5 .and. size(scene%initial) == 1, 'all of it')
  end subroutine test_others

  subroutine test_names(error)
    type(error_type), allocatable, intent(out) :: error
    type(source_type) :: source
    type(target_type) :: target
    type(token_type) :: place
    type(scene_error), allocatable :: found
    character(40), parameter :: names(6) = [character(40) :: 'horizon%ratio', 'Horizon . Ratio', &
      & 'ratio', '&horizon%ratio', 'material( 2 )%density', 'lower(2)']
    character(40), parameter :: full(6) = [character(40) :: 'horizon%ratio', 'horizon%ratio', &
      & 'horizon%ratio', 'horizon%ratio', 'material(2)%density', 'body%lower(2)']
    integer :: i

    call scan_source(text, 'a.nml', source, found)
    do i = 1, size(names)
      call find_target(source, trim(names(i)), place, target, found)
      call accept(error, found)
      if (allocated(error)) return
      call expect_true(error, full_name(source, target) == trim(full(i)), trim(names(i))// &
        & ' became '//full_name(source, target))
    end do
  end subroutine test_names

  subroutine test_bad_names(error)
    type(error_type), allocatable, intent(out) :: error

    call refused('horizn%ratio', "no group &horizn|did you mean 'horizon'?")
    call refused('horizon%ratoi', "no key 'ratoi'|did you mean 'ratio'?")
    call refused('name', 'key of several groups|material%name|body%name')
    call refused('nothing', "no group of the scene has a key 'nothing'")
    call refused('density', '2 groups &material|material(1)%density')
    call refused('material(3)%density', 'no group &material number 3')
    call refused('crack%radius', 'the scene has no group &crack')
    call refused('study%vary', 'no group &study can be varied')
    call refused('body%points(4)', 'not an element')
    call refused('displacement_gradient(1)', 'not an element|real(3,3)')

  contains

    subroutine refused(name, parts)
      character(*), intent(in) :: name, parts
      type(scene_type) :: scene
      type(scene_error), allocatable :: found
      if (allocated(error)) return
      call changed(name, '1', scene, found)
      call expect_parts(error, found, parts)
    end subroutine refused
  end subroutine test_bad_names

  subroutine test_place(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: found

    call changed('horizon%ratio', '0.5', scene, found)
    call expect_parts(error, found, "'ratio' is out of range|a.nml:6|       ^^^^^")
    if (allocated(error)) return
    call changed('time%integrator', "'euler'", scene, found)
    call expect_parts(error, found, "unknown value 'euler'|a.nml:6|allowed: forward_backward")
  end subroutine test_place

  !> A scene changed by options is the one that a file with these words gives.
  subroutine test_options(error)
    type(error_type), allocatable, intent(out) :: error

    call same('time%safety=0.25', 'safety = 0.5', 'safety = 0.25')
    call same('time.safety=0.25|steps=77', 'steps = 5 safety = 0.5', &
      & 'steps = 77 safety = 0.25')
    call same('material(2)%break_in_compression=.true.', 'poissons_ratio = 0.2', &
      & 'poissons_ratio = 0.2 break_in_compression = T')
    call same('body%points=20, 10', 'points = 100, 50', 'points = 20, 10')
    call same('body%points(1)=200|body%points(2)=100', &
      & 'points = 100, 50', 'points = 200, 100')
    call same('body%upper=2*0.5|points=2*10', &
      & 'upper = 1, 0.5 points = 100, 50', 'upper = 2*0.5 points = 10 10')
    call same('initial%displacement_gradient(2,1)=0.1', 'gradient(1,2) = 0.5', &
      & 'gradient(1,2) = 0.5 displacement_gradient(2,1) = 0.1')
    ! texts with quotes and without them
    call same("time%integrator='runge_kutta'", 'steps = 5', &
      & "steps = 5 integrator = 'runge_kutta'")
    call same('time%integrator=Runge_Kutta', 'steps = 5', &
      & "steps = 5 integrator = 'runge_kutta'")
    call same('scene%title=It''s a / test, isn''t it? ! = 3', 'dimension = 2', &
      & "dimension = 2 title = 'It''s a / test, isn''t it? ! = 3'")
    ! groups that are not there, and lists
    call same('output%fields=damage, velocity', '&time', &
      & "&output fields = 'damage', 'velocity' /&time")
    call same('output%fields="damage" ''velocity''', '&time', &
      & "&output fields = 'damage', 'velocity' /&time")
    call same('output%fields(1)=damage|output%every=3', '&time', &
      & "&output fields = 'damage' every = 3 /&time")
    call same('load(1)%values=0, 1|load%times=0, 2', '&time', &
      & "&load side = 'x_max' pressure = 1 times = 0, 2 values = 0, 1 /&time", &
      & "&load side = 'x_max' pressure = 1 /")

  contains

    !> `options`, given with the text and `more`, make the scene of the text with `new` in the place
    !> of `old`.
    subroutine same(options, old, new, more)
      character(*), intent(in) :: options   !! `group%key=value|...`
      character(*), intent(in) :: old, new
      character(*), intent(in), optional :: more
      type(scene_type) :: expected, scene
      type(scene_error), allocatable :: found
      type(line_type), allocatable :: list(:)
      character(:), allocatable :: base
      integer :: at

      if (allocated(error)) return
      base = text
      if (present(more)) base = text//more
      at = index(text, old)
      call expect_true(error, at > 0, old)
      if (allocated(error)) return
      call read_scene_text(text(:at - 1)//new//text(at + len(old):), 'a.nml', expected, found)
      call accept(error, found)
      call changes_of(options, list)
      call read_scene_text(base, 'a.nml', scene, found, list)
      call accept(error, found)
      if (allocated(error)) return
      call check(error, scene_text(scene), scene_text(expected))
      call expect_true(error, scene%text == base .and. size(scene%changes) == size(list), &
        & 'the text stays, and the options are kept beside it')
    end subroutine same
  end subroutine test_options

  subroutine test_bad_options(error)
    type(error_type), allocatable, intent(out) :: error

    call refused('horizn%ratio=3', "no group &horizn can be set|did you mean 'horizon'?")
    call refused('horizon%ratoi=3', "&horizon has no key 'ratoi'|did you mean 'ratio'?")
    call refused('horizon%ratio=0.5', "'ratio' is out of range|expected >= 1")
    call refused('horizon%ratio=abc', "bad value 'abc' for key 'ratio'|expected a number")
    call refused('horizon%ratio=2 3', "too many values for 'ratio'")
    call refused('horizon%ratio(1)=2', "not an element of 'ratio'|it is real")
    call refused('horizon%ratio=2 /', "bad value '2 /' for key 'ratio'")
    call refused('horizon%ratio=2 length = 3', "bad value '2 length = 3' for key 'ratio'")
    call refused('horizon%ratio=2 ! rest', "bad value '2 ! rest'")
    call refused('horizon%ratio=,', "bad value ','")
    call refused("time%integrator='euler'", "unknown value 'euler'|allowed: forward_backward")
    call refused('time%integrator=euler', "unknown value 'euler'|allowed: forward_backward")
    call refused("time%integrator='euler", "bad value ''euler'")
    call refused('body%points(1)=20, 30', "too many values for 'points(1)'|expected one")
    call refused('material%density=1', '2 groups &material|say which: material(1)%density')
    call refused('density=1', '2 groups &material')
    call refused('crack%radius=1', 'the scene has no group &crack|there is nothing to set')
    call refused('name=a', 'key of several groups|material%name|body%name')
    call refused('horizon%ratio', 'expected group%key=value')
    call refused('=3', 'expected group%key=value')
    call refused('horizon%ratio=', 'expected group%key=value')
    call refused('scene%title=a'//achar(27)//'b', 'a control character, byte 27')
    call refused('horizon%ratio=3', "'horizon%ratio' is set twice", 'ratio=4')

  contains

    !> The option is refused, with its place. Carets stand below it.
    subroutine refused(option, parts, second)
      character(*), intent(in) :: option, parts
      character(*), intent(in), optional :: second
      type(line_type), allocatable :: list(:)
      type(scene_type) :: scene
      type(scene_error), allocatable :: found

      if (allocated(error)) return
      if (present(second)) then
        call changes_of(option//'|'//second, list)
      else
        call changes_of(option, list)
      end if
      call read_scene_text(text, 'a.nml', scene, found, list)
      call expect_parts(error, found, parts//'|--> the command line|--set |^')
    end subroutine refused
  end subroutine test_bad_options

  !> What is wrong with a whole scene is shown where the option stands, and faults of its points,
  !> which scan the text again, too.
  subroutine test_places_of_options(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: found
    type(line_type), allocatable :: list(:)

    call changes_of('time%duration=3', list)
    call read_scene_text(text, 'a.nml', scene, found, list)
    call expect_parts(error, found, "'steps' and 'duration' are both given|--> the "// &
      & 'command line|--set time%duration=3|      ^^^^^^^^^^^^^')
    if (allocated(error)) return
    call changes_of('time%safety=0.1|body%upper=2, 1', list)
    call read_scene_text(text, 'a.nml', scene, found, list)
    call accept(error, found)
    if (allocated(error)) return
    call scene_fault(found, scene, 'body', 1, 'upper', 'too large', 'smaller')
    call expect_parts(error, found, 'too large|--> the command line|--set body%upper=2, 1')
    if (allocated(error)) return
    call scene_fault(found, scene, 'body', 1, 'lower', 'too low', 'higher')
    call expect_parts(error, found, 'too low|--> a.nml:4|lower = 2*0.0')
  end subroutine test_places_of_options

end module test_scene_content_change
