!> Reading scenes: values arrive where they belong, and bad input gets a message with its place.
module test_scene_content_read
  use pd_base_kinds, only: wp
  use pd_base_error, only: scene_error => error_type
  use pd_scene_content_read, only: read_scene
  use pd_scene_content_types, only: scene_type, is_set
  use test_scene_expect, only: expect_fault, expect_parts, expect_scene, good_head, line
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_content_read

contains

  subroutine collect_scene_content_read(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('values of every kind', test_values), &
      & new_unittest('subscripts and repeat counts', test_subscripts), &
      & new_unittest('defaults', test_defaults), &
      & new_unittest('groups given several times', test_repeated), &
      & new_unittest('a scene from a file', test_file), &
      & new_unittest('the message of an unknown key', test_unknown_key), &
      & new_unittest('unknown groups', test_unknown_group), &
      & new_unittest('groups given twice', test_twice), &
      & new_unittest('duplicate keys', test_duplicate), &
      & new_unittest('values of the wrong type', test_types), &
      & new_unittest('values out of range', test_ranges), &
      & new_unittest('too many values', test_too_many), &
      & new_unittest('bad subscripts', test_bad_subscripts), &
      & new_unittest('texts', test_texts), &
      & new_unittest('values that are not allowed', test_choices), &
      & new_unittest('missing keys', test_missing), &
      & new_unittest('an unknown key comes before a missing one', test_order)]
  end subroutine collect_scene_content_read

  subroutine test_values(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call expect_scene(error, good_head//"&TIME Method = 'EXPLICIT' STEPS=10, step = 1.5d-8 /"// &
      & "&no_fail shape = ""sphere"" centre = 0.1 0.2 radius = 3 /"//line//"&output fields = "// &
      & "'damage',"//line//" 'Dilatation' every = 5 /", scene)
    if (allocated(error)) return
    call check(error, scene%time%steps, 10)
    if (allocated(error)) return
    call check(error, scene%time%step, 1.5e-8_wp, thr=0.0_wp)
    if (allocated(error)) return
    call check(error, trim(scene%time%method), 'explicit')
    if (allocated(error)) return
    call check(error, scene%no_fail(1)%radius, 3.0_wp)
    if (allocated(error)) return
    call check(error, scene%no_fail(1)%centre(2), 0.2_wp)
    if (allocated(error)) return
    call check(error, trim(scene%no_fail(1)%shape), 'sphere')
    if (allocated(error)) return
    call check(error, size(scene%output%fields), 2)
    if (allocated(error)) return
    call check(error, trim(scene%output%fields(2)), 'dilatation')
    if (allocated(error)) return
    call check(error, all(scene%bodies(1)%points == [100, 50, 0]))
    if (allocated(error)) return
    call check(error, is_set(scene%bodies(1)%upper(2)) .and. .not. is_set(scene%bodies(1)%upper(3)))
  end subroutine test_values

  subroutine test_subscripts(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call expect_scene(error, '&scene dimension = 3 /'//line//'&material youngs_modulus = 1 '// &
      & 'density = 1 poissons_ratio = 0.2 /'//line//'&body lower(1:2) = 2*0.5 lower(3) = 0 '// &
      & 'upper = 3*1.5 points(2) = 2 points(1) = 2 points(3:) = 3 /'//line// &
      & '&initial displacement_gradient(1,2) = 0.5 displacement_gradient(:,3) = 1, 2, 3'//line// &
      & 'velocity_gradient = 1 2 3 4 5 6 7 8 9 /'//line// &
      & "&load side = 'x_min' force_y = 4 times(1) = 0 times(2:3) = 1, 2 values = 3*2 /"//line// &
      & '&time steps = 1 /', scene)
    if (allocated(error)) return
    associate (initial => scene%initial(1), load => scene%loads(1))
      call check(error, all(scene%bodies(1)%points == [2, 2, 3]))
      if (allocated(error)) return
      call check(error, initial%displacement_gradient(1, 2), 0.5_wp)
      if (allocated(error)) return
      call check(error, initial%displacement_gradient(2, 1), 0.0_wp)
      if (allocated(error)) return
      call check(error, initial%displacement_gradient(2, 3), 2.0_wp)
      if (allocated(error)) return
      call check(error, initial%velocity_gradient(2, 1), 2.0_wp)
      if (allocated(error)) return
      call check(error, load%force(2), 4.0_wp)
      if (allocated(error)) return
      call check(error, size(load%times) == 3 .and. size(load%values) == 3)
      if (allocated(error)) return
      call check(error, load%times(3), 2.0_wp)
      if (allocated(error)) return
      call check(error, load%values(3), 2.0_wp)
    end associate
  end subroutine test_subscripts

  subroutine test_defaults(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call expect_scene(error, "&scene dimension = 2 /&material name = 'm' model = 'bond_based' "// &
      & 'youngs_modulus = 1 density = 2 /&body lower = 0 0 upper = 1 1 points = 5 5 /'// &
      & "&time steps = 3 /&probe name = 'p' point = 0 0 /&relaxation density_matrix = "// &
      & "'chapter' /", scene)
    if (allocated(error)) return
    call check(error, trim(scene%header%plane)//' '//trim(scene%bodies(1)%material), 'stress m')
    if (allocated(error)) return
    call check(error, scene%materials(1)%poissons_ratio, 1.0_wp/3.0_wp)
    if (allocated(error)) return
    call check(error, scene%horizon%ratio, 3.015_wp)
    if (allocated(error)) return
    call check(error, scene%relaxation%safety, 5.0_wp)
    if (allocated(error)) return
    call check(error, size(scene%cracks) + size(scene%loads) + size(scene%regions), 0)
    if (allocated(error)) return
    call check(error, all(scene%output%fields == [character(12) :: 'displacement', 'velocity', &
      & 'damage']))
    if (allocated(error)) return
    call check(error, all(scene%probes(1)%fields == ['displacement']))
    if (allocated(error)) return
    call check(error, is_set(scene%materials(1)%critical_stretch), .false.)
  end subroutine test_defaults

  subroutine test_repeated(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call expect_scene(error, good_head//'&crack from = 0 0 to = 1 0 /&time steps = 1 /'// &
      & '&crack from = 0 0 to = 1 2 /', scene)
    if (allocated(error)) return
    call check(error, size(scene%cracks), 2)
    if (allocated(error)) return
    call check(error, scene%cracks(2)%to(2), 2.0_wp)
  end subroutine test_repeated

  subroutine test_file(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: found
    integer :: unit
    character(*), parameter :: path = 'test_scene_content_read.nml'

    call read_scene('there/is/no.nml', scene, found)
    call expect_parts(error, found, "cannot find the file 'there/is/no.nml'")
    if (allocated(error)) return
    open (newunit=unit, file=path, action='write', access='stream', form='unformatted', &
      & status='replace')
    write (unit) good_head//'&time steps = 5 /'
    close (unit)
    call read_scene(path, scene, found)
    open (newunit=unit, file=path)
    close (unit, status='delete')
    call check(error,.not. allocated(found), 'a file without a last line end was refused')
    if (allocated(error)) return
    call check(error, scene%time%steps, 5)
    if (allocated(error)) return
    call check(error, scene%file//scene%text, path//good_head//'&time steps = 5 /')
  end subroutine test_file

  subroutine test_unknown_key(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, good_head//'&time'//line//'  stps = 100'//line//'/', &
      & "unknown key 'stps' in group &time"//line//' --> a/b.nml:5'//line//'  5 |   stps = 100'// &
      & line//"    |   ^^^^ did you mean 'steps'?  known: method, integrator, step")
    call expect_fault(error, '&scene colour = 1 /', "unknown key 'colour' in group &scene|known")
    call expect_fault(error, '&boundary displacement = 1 /', "did you mean 'displacement_x'?")
  end subroutine test_unknown_key

  subroutine test_unknown_group(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, good_head//'&tine steps = 1 /', &
      & "unknown group &tine|a/b.nml:4|^^^^^ did you mean '&time'?|known: scene, define")
    call expect_fault(error, '&physics /', 'unknown group &physics|a/b.nml:1|known: scene, define')
  end subroutine test_unknown_group

  subroutine test_twice(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, good_head//'&time steps = 1 /'//line//'&time steps = 2 /', &
      & 'group &time is given twice|a/b.nml:5')
  end subroutine test_twice

  subroutine test_duplicate(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, '&time steps = 1'//line//' steps = 2 /', &
      & "duplicate key 'steps' in group &time|a/b.nml:2|already given on line 1")
    call expect_fault(error, '&body lower(1) = 1 lower = 0 0 /', "duplicate key 'lower'")
    call expect_fault(error, '&boundary times = 0 1'//line//' times(2) = 3 /', &
      & "duplicate key 'times'|a/b.nml:2|on line 1")
  end subroutine test_duplicate

  subroutine test_types(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, '&time step = abc /', &
      & "bad value 'abc' for key 'step' in group &time|a/b.nml:1|^^^ expected a number [s]")
    call expect_fault(error, '&time steps = 1.5 /', "bad value '1.5'|expected a whole number")
    call expect_fault(error, '&time steps = ''10'' /', "bad value '10'|without quotes")
    call expect_fault(error, '&time step = ''10'' /', "bad value '10'|without quotes")
    call expect_fault(error, '&time step = NaN /', "bad value 'NaN'|finite number")
    call expect_fault(error, '&time step = -Infinity /', "'-Infinity'|finite number")
    call expect_fault(error, '&time step = 1e400 /', "'1e400'|expected a size")
    call expect_fault(error, '&time method = explicit /', "bad value 'explicit'|in quotes")
    call expect_fault(error, '&material break_in_compression = 1 /', "bad value '1'|.true.")
    call expect_fault(error, '&body lower = 0'//line//' 1 oops'//line//'/', &
      & "bad value 'oops' for key 'lower'|a/b.nml:2|    |    ^^^^ expected a number")
    call expect_fault(error, '&body lower = (1,2) /', "bad value '(1'")
  end subroutine test_types

  subroutine test_ranges(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, '&material density = -1 /', &
      & "'density' is out of range in group &material|a/b.nml:1|expected > 0 [kg/m3]")
    call expect_fault(error, '&scene dimension = 4 /', "'dimension'|expected >= 1 and <= 3")
    call expect_fault(error, '&time steps = 0 /', "'steps'|expected >= 1")
    call expect_fault(error, '&body points = 5 0 /', "'points'|expected >= 1")
    call expect_fault(error, '&horizon ratio = 0.5 /', "'ratio'|expected >= 1")
    call expect_fault(error, '&relaxation tolerance = 1 /', "'tolerance'|expected > 0 and < 1")
  end subroutine test_ranges

  subroutine test_too_many(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, '&time steps = 1 2 /', "too many values for 'steps'|room for 1 value")
    call expect_fault(error, '&material youngs_modulus = 200 GPa /', &
      & "too many values for 'youngs_modulus'|^^^|SI units")
    call expect_fault(error, '&body lower = 4*0 /', "too many values for 'lower'|for 3 values")
    call expect_fault(error, '&body lower(2) = 0 1 /', "too many values for 'lower'|for 1 value")
    call expect_fault(error, '&boundary times = 2000000000*0 /', "too many values for 'times'")
    call expect_fault(error, '&time step = 1,5 /', "too many values for 'step'")
  end subroutine test_too_many

  subroutine test_bad_subscripts(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, '&body lower(4) = 0 /', "bad subscript of 'lower'|from 1 to 3|:1")
    call expect_fault(error, '&body lower(0) = 0 /', "bad subscript of 'lower'|from 1 to 3")
    call expect_fault(error, '&body lower(3:1) = 0 /', "bad subscript of 'lower'|from 1 to 3")
    call expect_fault(error, '&body lower(a) = 0 /', "bad subscript of 'lower'|whole numbers")
    call expect_fault(error, '&body lower() = 0 /', "bad subscript of 'lower'|whole numbers")
    call expect_fault(error, '&body lower(1:3:2) = 0 /', "bad subscript of 'lower'|whole numbers")
    call expect_fault(error, '&time steps(1) = 1 /', "bad subscript of 'steps'|single value")
    call expect_fault(error, '&initial velocity_gradient(1) = 1 /', 'expected 2 subscripts')
    call expect_fault(error, '&body lower(1,1) = 1 /', "bad subscript of 'lower'")
    call expect_fault(error, '&initial velocity_gradient(4,1) = 1 /', 'bad subscript|from 1 to 3')
    call expect_fault(error, '&boundary times(2) = 1 /', "'times(1)' is not given")
  end subroutine test_bad_subscripts

  subroutine test_texts(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, "&body name = '"//repeat('n', 65)//"' /", &
      & "the text for key 'name' is too long|65 characters, at most 64")
    call expect_fault(error, "&scene title = '"//repeat('n', 1025)//"' /", 'too long|at most 1024')
    call expect_fault(error, "&body name = 'a/b' /", "bad value 'a/b'|letters, digits")
    call expect_fault(error, "&probe name = 'a b' /", "bad value 'a b'|letters, digits")
  end subroutine test_texts

  subroutine test_choices(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, "&material influence = 'gausian' /", &
      & "unknown value 'gausian' of key 'influence'|did you mean 'gaussian'?|"// &
      & 'allowed: inverse, constant, linear, gaussian|a/b.nml:1')
    call expect_fault(error, "&output fields = 'damage', 'Damage' /", "'damage' is given twice")
    call expect_fault(error, good_head//"&time steps = 1 /"//line//"&boundary side = 'left' "// &
      & "displacement_x = 0 /", "unknown value 'left'|x_min, x_max")
  end subroutine test_choices

  subroutine test_missing(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, '&scene /', "group &scene lacks the key 'dimension'|a/b.nml:1")
    call expect_fault(error, '&material density = 1 /', "lacks the key 'youngs_modulus'|[Pa]")
    call expect_fault(error, "&region shape = 'box' /", "&region lacks the key 'name'")
    call expect_fault(error, '&scene dimension = 2 / &material youngs_modulus = 1e9 '// &
      & "poissons_ratio = 0.3 density = 1 / &time steps = 1 / &body lower = 0, 0 upper = 1, 1 "// &
      & "points = 2, 2 / &remove radius = 1 /", "&remove lacks the key 'shape'")
    call expect_fault(error, "&probe name = 'p' /", "&probe lacks the key 'point'")
  end subroutine test_missing

  subroutine test_order(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, '&scene dimensoin = 2 /', "unknown key|did you mean 'dimension'?")
  end subroutine test_order

end module test_scene_content_read
