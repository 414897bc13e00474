!> Defaults of earlier versions: each one that has changed takes its old value where a scene asks
!> for it, and what the user gives stays.
module test_scene_content_defaults
  use pd_base_error, only: scene_error => error_type
  use pd_base_kinds, only: i8, wp
  use pd_base_version, only: program_version
  use pd_motion_explicit_time_step, only: evaluations
  use pd_output_report_schedule, only: history_interval
  use pd_scene_content_check, only: check_scene
  use pd_scene_content_types, only: is_set, scene_type
  use pd_scene_content_write, only: scene_text
  use pd_scene_groups_header, only: known_defaults, own_defaults
  use pd_set_up_plan, only: plan_type
  use bodies, only: expect_true
  use test_scene_expect, only: expect_fault, expect_parts, expect_scene, line
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_content_defaults

  character(*), parameter :: solid = '&material youngs_modulus = 1e9 density = 1e3 '// &
    & 'poissons_ratio = 0.3 /'//line//'&body lower = 0, 0 upper = 1, 0.5 points = 100, 50 /'//line
  character(*), parameter :: head = '&scene dimension = 2 /'//line//solid
  character(*), parameter :: old_head = "&scene dimension = 2 defaults = '0.1' /"//line//solid
  character(*), parameter :: relaxed = "&time method = 'relaxation' /"//line

contains

  subroutine collect_scene_content_defaults(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('versions that are known', test_versions), &
      & new_unittest('the dilatation', test_dilatation), &
      & new_unittest('rows of the history', test_rows), &
      & new_unittest('lines of a relaxation', test_lines), &
      & new_unittest('temperature changes in relaxation', test_temperature), &
      & new_unittest('the critical stretch', test_critical), &
      & new_unittest('growth in relaxation', test_growth), &
      & new_unittest('the resolved scene names its version', test_resolved), &
      & new_unittest('a scene built in memory', test_memory)]
  end subroutine collect_scene_content_defaults

  subroutine test_versions(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call check(error, own_defaults, program_version(:index(program_version, '.', back=.true.) - 1))
    if (allocated(error)) return
    call expect_true(error, known_defaults(1) == '0.1' .and. any(known_defaults == own_defaults), &
      & 'the first and the last version are known')
    call expect_scene(error, head//'&time steps = 5 /', scene)
    if (allocated(error)) return
    call check(error, trim(scene%header%defaults), own_defaults)
    if (allocated(error)) return
    call expect_fault(error, "&scene dimension = 2"//line//"  defaults = '0.3' /"//line//solid// &
      & '&time steps = 5 /', "unknown value '0.3' of key 'defaults'|a/b.nml:2|allowed: 0.1, 0.2")
    call expect_fault(error, "&scene dimension = 2 defaults = 0.1 /"//line//solid// &
      & '&time steps = 5 /', "expected a text in quotes, such as '0.1'")
  end subroutine test_versions

  subroutine test_dilatation(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_dilatation(head, '', 'unprojected')
    call expect_dilatation(old_head, '', 'projected')
    call expect_dilatation(head, "&horizon dilatation = 'projected' /", 'projected')
    call expect_dilatation(old_head, "&horizon dilatation = 'unprojected' /", 'unprojected')

  contains

    subroutine expect_dilatation(text, group, word)
      character(*), intent(in) :: text, group, word
      type(scene_type) :: scene
      if (allocated(error)) return
      call expect_scene(error, text//group//'&time steps = 5 /', scene)
      if (allocated(error)) return
      call check(error, trim(scene%horizon%dilatation), word)
    end subroutine expect_dilatation
  end subroutine test_dilatation

  !> Version 0.1: max(1, steps/2000), whatever a row costs.
  subroutine test_rows(error)
    type(error_type), allocatable, intent(out) :: error
    integer(i8), parameter :: bonds = 7000000_i8
    type(scene_type) :: scene
    type(plan_type) :: plan

    plan%integrator = 'forward_backward'
    call expect_scene(error, old_head//'&time duration = 1 /', scene)
    if (allocated(error)) return
    plan%steps = 1000
    call check(error, history_interval(scene, plan, bonds), 1, 'few steps')
    if (allocated(error)) return
    plan%steps = 100000
    call check(error, history_interval(scene, plan, bonds), 50, 'many steps')
    if (allocated(error)) return
    call expect_scene(error, head//'&time duration = 1 /', scene)
    if (allocated(error)) return
    plan%steps = 1000
    ! a row costs two to three evaluations of the forces, of which 20 times as many may pass
    call check(error, history_interval(scene, plan, bonds) >= 40/evaluations(plan%integrator), &
      & 'few steps of this version')
    if (allocated(error)) return
    call expect_scene(error, old_head//'&time duration = 1 /&output history_every = 7 /', scene)
    if (allocated(error)) return
    call check(error, history_interval(scene, plan, bonds), 7, 'as asked for')
  end subroutine test_rows

  !> Version 0.1: max(1, maximum_iterations/2000).
  subroutine test_lines(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_lines(old_head, '', 50)
    call expect_lines(old_head, '&relaxation maximum_iterations = 7000 /', 3)
    call expect_lines(old_head, '&relaxation maximum_iterations = 70 /', 1)
    call expect_lines(old_head, '&output history_every = 4 /', 4)
    call expect_lines(head, '', 1)

  contains

    subroutine expect_lines(text, group, every)
      character(*), intent(in) :: text, group
      integer, intent(in) :: every
      type(scene_type) :: scene
      type(plan_type) :: plan
      if (allocated(error)) return
      call expect_scene(error, text//relaxed//group, scene)
      if (allocated(error)) return
      plan%relaxes = .true.
      call check(error, history_interval(scene, plan, 1000_i8), every, group)
    end subroutine expect_lines
  end subroutine test_lines

  !> Version 0.1: at once, in all load steps.
  subroutine test_temperature(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: hot = '&initial temperature_change = 50 '
    type(scene_type) :: scene

    call expect_scene(error, old_head//relaxed//hot//'/', scene)
    if (allocated(error)) return
    call expect_true(error, .not. is_set(scene%initial(1)%ramp_time) .and. &
      & allocated(scene%initial(1)%times), 'at once')
    if (allocated(error)) return
    call expect_true(error, all(abs(scene%initial(1)%values - 1.0_wp) <= 0.0_wp) .and. &
      & abs(scene%initial(1)%times(1)) <= 0.0_wp, 'the factor is 1 from the start')
    call expect_scene(error, old_head//relaxed//hot//'ramp_time = 0.5 /', scene)
    if (allocated(error)) return
    call expect_true(error, abs(scene%initial(1)%ramp_time - 0.5_wp) <= 0.0_wp .and. &
      & .not. allocated(scene%initial(1)%times), 'a ramp that is given')
    call expect_scene(error, old_head//'&time steps = 5 /'//hot//'/', scene)
    if (allocated(error)) return
    call expect_true(error, .not. is_set(scene%initial(1)%ramp_time) .and. &
      & .not. allocated(scene%initial(1)%times), 'explicit steps: at once in every version')
    call expect_scene(error, old_head//relaxed//'&initial displacement_x = 0.1 /', scene)
    if (allocated(error)) return
    call expect_true(error, .not. allocated(scene%initial(1)%times), 'no temperature, no course')
    call expect_scene(error, head//relaxed//hot//'/', scene)
    if (allocated(error)) return
    call expect_true(error, abs(scene%initial(1)%ramp_time - 1.0_wp) <= 0.0_wp, 'this version')
  end subroutine test_temperature

  !> From Gc: version 0.1 by the formula, this one from the lattice's toughness; a name that is
  !> given stays, and a critical stretch that is given needs none.
  subroutine test_critical(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: body = &
      & '&body lower = 0, 0 upper = 1, 0.5 points = 100, 50 /'//line//'&time steps = 5 /'//line
    character(*), parameter :: brittle = '&material youngs_modulus = 1e9 density = 1e3 '// &
      & 'poissons_ratio = 0.3 critical_energy_release_rate = 10 '

    call expect_critical("defaults = '0.1'", brittle//'/', 'chapter')
    call expect_critical('', brittle//'/', 'lattice')
    call expect_critical("defaults = '0.1'", brittle//"critical = 'lattice' /", 'lattice')
    call expect_critical('', brittle//"critical = 'chapter' /", 'chapter')
    call expect_critical('', '&material youngs_modulus = 1e9 density = 1e3 '// &
      & 'poissons_ratio = 0.3 critical_stretch = 0.01 /', '')

  contains

    subroutine expect_critical(version, material, critical)
      character(*), intent(in) :: version, material, critical
      type(scene_type) :: scene
      if (allocated(error)) return
      call expect_scene(error, '&scene dimension = 2 '//version//' /'//line//body//material, scene)
      if (allocated(error)) return
      call check(error, trim(scene%materials(1)%critical), critical, version//material)
    end subroutine expect_critical
  end subroutine test_critical

  !> Version 0.1: by load steps; this one decides when the system is known.
  subroutine test_growth(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call expect_scene(error, old_head//relaxed, scene)
    if (allocated(error)) return
    call check(error, trim(scene%relaxation%growth), 'load_steps', 'version 0.1')
    if (allocated(error)) return
    call expect_scene(error, head//relaxed, scene)
    if (allocated(error)) return
    call check(error, trim(scene%relaxation%growth), '', 'this version')
  end subroutine test_growth

  !> What is written with the results gives the same scene, whatever version reads it.
  subroutine test_resolved(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene, second
    character(*), parameter :: hot = relaxed//'&initial temperature_change = 50 /'

    call expect_scene(error, head//hot, scene)
    if (allocated(error)) return
    call check(error, index(scene_text(scene), "  defaults = '"//own_defaults//"'") > 0, &
      & 'this version')
    if (allocated(error)) return
    call expect_scene(error, old_head//hot, scene)
    if (allocated(error)) return
    call check(error, index(scene_text(scene), "  defaults = '0.1'") > 0, 'version 0.1')
    if (allocated(error)) return
    call expect_scene(error, scene_text(scene), second)
    if (allocated(error)) return
    call check(error, scene_text(second), scene_text(scene))
  end subroutine test_resolved

  subroutine test_memory(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: found

    call expect_scene(error, head//'&time steps = 5 /', scene)
    if (allocated(error)) return
    scene%horizon%dilatation = ''
    scene%header%defaults = '0.1'
    call check_scene(scene, found)
    call check(error, .not. allocated(found) .and. scene%horizon%dilatation == 'projected')
    if (allocated(error)) return
    scene%header%defaults = '7'
    call check_scene(scene, found)
    call expect_parts(error, found, "unknown version '7' of the defaults|known: 0.1, 0.2")
  end subroutine test_memory

end module test_scene_content_defaults
