!> Expressions in scenes: names, places of faults, rules, writing and reading again.
module test_scene_content_expressions
  use pd_base_error, only: scene_error => error_type
  use pd_base_kinds, only: wp
  use pd_scene_content_complete, only: complete_scene
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: scene_type
  use pd_scene_content_write, only: scene_text
  use pd_scene_format_file, only: line_type
  use bodies, only: box_scene
  use test_scene_expect, only: changes_of, expect_fault, expect_parts, expect_scene, good_head, &
    & line
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_content_expressions

  character(*), parameter :: head = good_head//'&time steps = 1 /'//line
  character(*), parameter :: static = good_head//"&time method = 'relaxation' /"//line

contains

  subroutine collect_scene_content_expressions(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('numbers or expressions', test_read), &
      & new_unittest('names', test_names), &
      & new_unittest('carets and suggestions', test_carets), &
      & new_unittest('variables and courses', test_rules), &
      & new_unittest('regions', test_regions), &
      & new_unittest('written and read again', test_round_trip), &
      & new_unittest('changed on the command line', test_changes), &
      & new_unittest('filled in memory', test_memory)]
  end subroutine collect_scene_content_expressions

  subroutine test_read(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call expect_scene(error, head//"&define name = 'speed' value = 200 /"//line// &
      & "&initial velocity_x = 'speed*x/sqrt(x^2+y^2)' velocity_y = 3 /", scene)
    if (allocated(error)) return
    call check(error, trim(scene%initial(1)%velocity_text(1)), 'speed*x/sqrt(x^2+y^2)')
    if (allocated(error)) return
    call check(error, scene%initial(1)%velocity_text(2), '')
    if (allocated(error)) return
    call check(error, scene%initial(1)%velocity(2), 3.0_wp)
    ! a number that stands in quotes is one
    call expect_scene(error, head//"&load side = 'x_max' pressure = '5' /", scene)
  end subroutine test_read

  subroutine test_names(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call expect_scene(error, head//"&define name = 'A' value = 2 /"//line// &
      & "&define name = 'b_2' value = '3*a + pi' /"//line// &
      & "&load side = 'x_max' body_force_x = 'a*B_2*x' /", scene)
    call expect_fault(error, head//"&define name = 'x' value = 1 /", "'x' is a position|a/b.nml:5")
    call expect_fault(error, head//"&define name = 'E' value = 1 /", "'e' is the number")
    call expect_fault(error, head//"&define name = 'sqrt' value = 1 /", "'sqrt' is a function")
    call expect_fault(error, head//"&define name = '2a' value = 1 /", "bad name '2a'")
    call expect_fault(error, head//"&define name = 'a-b' value = 1 /", "bad name 'a-b'")
    call expect_fault(error, head//"&define name = 'a' value = 1 /"//line// &
      & "&define name = 'A' value = 2 /", "the name 'a' is used by another|a/b.nml:6")
    call expect_fault(error, head//"&define name = 'a' value = '2*b' /"//line// &
      & "&define name = 'b' value = 2 /", "unknown name 'b'|a/b.nml:5")
    call expect_fault(error, head//"&define name = 'a' value = 't' /", "'t' cannot stand")
    call expect_fault(error, head//"&define name = 'a' value = '1/0' /", 'not finite')
    call expect_fault(error, head//"&define name = 'a' /", "lacks the key 'value'")
    call expect_fault(error, head//"&define value = 1 /", "lacks the key 'name'")
  end subroutine test_names

  subroutine test_carets(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, head//"&initial velocity_x = '2*sqr(x)' /", &
      & "unknown name 'sqr'|did you mean 'sqrt'|a/b.nml:5|"// &
      & repeat(' ', 26)//'^^^ did')
    call expect_fault(error, head//"&define name = 'speed' value = 1 /"//line// &
      & "&initial velocity_x = 'sped' /", "did you mean 'speed'|a/b.nml:6|^^^^")
    call expect_fault(error, head//"&initial velocity_x = 'sqrt(x' /", &
      & "a '(' without a ')'|a/b.nml:5|"//repeat(' ', 28)//'^')
    call expect_fault(error, head//"&initial velocity_x = 'atan2(x)' /", &
      & "'atan2' has 1 argument|expected 2")
    call expect_fault(error, head//"&initial velocity_x = '  ' /", 'empty text')
    call expect_fault(error, head//"&initial velocity_x = '1 +' /", 'ends too early|velocity_x')
  end subroutine test_carets

  subroutine test_rules(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call expect_fault(error, head//"&initial velocity_x = 't' /", "'t' cannot stand|at the start")
    call expect_fault(error, head//"&initial velocity_x = 'z' /", "'z' cannot stand|dimension 2")
    call expect_fault(error, head//"&initial velocity_z = 'x' /", "'velocity_z' in a scene of")
    call expect_fault(error, head//"&load side = 'x_max' force_x = 'y' /", &
      & "'y' cannot stand|a force is a total")
    call expect_fault(error, head//"&load side = 'x_max' pressure = 't' ramp_time = 1 /", &
      & "'ramp_time' beside an expression of t|a/b.nml:5")
    call expect_fault(error, head//"&boundary side = 'x_max' velocity_x = 't' times = 0, 1 "// &
      & 'values = 1, 2 /', "'times' beside an expression of t")
    call expect_fault(error, head//"&initial temperature_change = 't' ramp_time = 1 /", &
      & "'ramp_time' beside an expression of t")
    call expect_fault(error, head//"&initial file = 'a/b.nml' velocity_x = 'x' /", &
      & "'file' beside an expression")
    call expect_fault(error, head//"&boundary side = 'x_max' velocity_x = 't' "// &
      & "displacement_x = 1 /", 'are both imposed')
    ! without t a course is as with numbers
    call expect_scene(error, head//"&load side = 'x_max' pressure = '1e6*y' ramp_time = 1 /", &
      & scene)
    call expect_scene(error, static//"&load side = 'x_max' pressure = '1e6*y' /", scene)
    if (allocated(error)) return
    call check(error, scene%loads(1)%ramp_time, 1.0_wp, 'the default ramp')
    if (allocated(error)) return
    call expect_scene(error, static//"&load side = 'x_max' pressure = '1e6*t^2' /", scene)
    if (allocated(error)) return
    call check(error, scene%loads(1)%ramp_time < 0.0_wp, 'no ramp beside an expression of t')
  end subroutine test_rules

  subroutine test_regions(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call expect_scene(error, head//"&region name = 'disc' where = 'x^2 + y^2 < 0.01' /", scene)
    call expect_scene(error, head//"&region name = 'half' shape = 'sphere' radius = 0.1 "// &
      & "where = 'x > 0' /", scene)
    call expect_fault(error, head//"&region name = 'a' where = 't > 0' /", "'t' cannot stand")
    call expect_fault(error, head//"&region name = 'a' /", "lacks the key 'shape'|or 'where'")
    call expect_fault(error, head//"&region name = 'a' where = 3 /", 'expected a text')
    call expect_fault(error, head//"&region name = 'a' where = 'x < y <' /", 'comparisons')
  end subroutine test_regions

  subroutine test_round_trip(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene, again
    type(scene_error), allocatable :: fault
    character(:), allocatable :: text

    call expect_scene(error, head//"&define name = 'a' value = '2*pi' /"//line// &
      & "&region name = 'disc' where = 'x^2 < a' /"//line// &
      & "&initial temperature_change = 'sin(a*t)' displacement_x = 'x' /"//line// &
      & "&boundary side = 'x_max' displacement_x = 'a*t' velocity_y = '-y' /"//line// &
      & "&load side = 'y_max' pressure = 'x' force_x = 't' body_force_x = ""exp(-x)"" /", scene)
    if (allocated(error)) return
    text = scene_text(scene)
    call read_scene_text(text, 'again.nml', again, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    call check(error, scene_text(again), text)
    if (allocated(error)) return
    call check(error, index(text, "displacement_x = 'a*t'") > 0 .and. &
      & index(text, "where = 'x^2 < a'") > 0 .and. index(text, "value = '2*pi'") > 0, text)
  end subroutine test_round_trip

  subroutine test_changes(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: fault
    type(line_type), allocatable :: changes(:)
    character(*), parameter :: text = head//"&define name = 'a' value = 2 /"//line// &
      & "&load side = 'x_max' pressure = 'a*y' /"

    call read_with('load%pressure=1e6*a*t')
    call check(error, trim(scene%loads(1)%pressure_text), '1e6*a*t')
    if (allocated(error)) return
    call read_with('load%pressure=-4e5')
    call check(error, scene%loads(1)%pressure_text, '')
    if (allocated(error)) return
    call check(error, scene%loads(1)%pressure, -4.0e5_wp)
    if (allocated(error)) return
    call read_with('define%value=3')
    call check(error, scene%definitions(1)%value, 3.0_wp)
    if (allocated(error)) return
    call changes_of('load%pressure=2*bb', changes)
    call read_scene_text(text, 'a/b.nml', scene, fault, changes)
    call expect_parts(error, fault, "unknown name 'bb'|^^")

  contains

    subroutine read_with(change)
      character(*), intent(in) :: change
      if (allocated(error)) return
      call changes_of(change, changes)
      call read_scene_text(text, 'a/b.nml', scene, fault, changes)
      if (allocated(fault)) call test_failed(error, fault%message)
    end subroutine read_with

  end subroutine test_changes

  subroutine test_memory(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: fault

    call box_scene([10, 5], 0.1_wp, 0.3_wp, scene)
    deallocate (scene%loads)
    allocate (scene%loads(1), scene%definitions(1))
    scene%definitions(1)%name = 'top'
    scene%definitions(1)%value = 3.0_wp
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%body_force_text(1) = '1e5*top*y'
    call complete_scene(scene, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    call check(error, trim(scene%loads(1)%body_force_text(1)), '1e5*top*y')
    if (allocated(error)) return
    scene%loads(1)%body_force_text(1) = '1e5*topp*y'
    call complete_scene(scene, fault)
    call expect_parts(error, fault, "unknown name 'topp'|did you mean 'top'|character 5|load")
  end subroutine test_memory

end module test_scene_content_expressions
