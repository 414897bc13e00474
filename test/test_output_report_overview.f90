!> What `check` tells beyond a run's summary: the overview, and the run time as predicted.
module test_output_report_overview
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_set_up_prepare, only: set_up_type
  use pd_output_report_schedule, only: schedule_of
  use pd_output_fields_table, only: all_fields
  use pd_output_report_estimate, only: estimate
  use pd_output_report_overview, only: overview
  use pd_scene_content_types, only: scene_type
  use testdrive, only: error_type, new_unittest, unittest_type
  use bodies, only: prepare_run, box_scene, expect_true, ready
  implicit none (type, external)
  private
  public :: collect_output_report_overview

  real(wp), parameter :: spacing = 1.0e-2_wp

contains

  subroutine collect_output_report_overview(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('points, lengths and waves are printed', test_overview), &
      & new_unittest('the run time is predicted', test_estimate), &
      & new_unittest('a run that fails at once is reported', test_failing)]
  end subroutine collect_output_report_overview

  !> Fail unless a text has a line with this label and content.
  subroutine expect_line(error, text, label, content)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text, label, content
    character(16) :: column

    column = label
    call expect_true(error, index(text, '  '//column//content) > 0, column//content//' in '//text)
  end subroutine expect_line

  !> A plate of 8 x 6 points of steel (E = 200 GPa, nu = 1/3, 7850 kg/m3), the horizon three
  !> spacings of 1 cm: a plate wave runs at sqrt(E/(rho 8/9)) = 5354 m/s, a shear wave at
  !> sqrt(3 E/(8 rho)) = 3091 m/s, a surface wave at 0.9194 of that; Gc = 9 E s_c^2 delta/(4 pi) =
  !> 4297 J/m2.
  subroutine test_overview(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    character(:), allocatable :: text

    call box_scene([8, 6], spacing, 1.0_wp/3.0_wp, scene)
    scene%horizon%ratio = 3.0_wp
    scene%materials(1)%critical_stretch = 1.0e-3_wp
    deallocate (scene%regions, scene%boundaries, scene%loads, scene%no_fail, scene%cracks)
    allocate (scene%regions(1), scene%boundaries(1), scene%loads(1), scene%no_fail(1), &
      & scene%cracks(1))
    scene%regions(1)%name = 'left'
    scene%regions(1)%shape = 'box'
    scene%regions(1)%upper(1) = 2*spacing
    scene%boundaries(1)%name = 'grip'
    scene%boundaries(1)%region = 'left'
    scene%boundaries(1)%displacement(1) = 0.0_wp
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%pressure = 1.0e6_wp
    scene%no_fail(1)%shape = 'box'
    scene%no_fail(1)%lower(1) = 7*spacing
    scene%cracks(1)%from(:2) = [3.0_wp, 3.0_wp]*spacing
    scene%cracks(1)%to(:2) = [5.0_wp, 3.0_wp]*spacing
    call ready(scene, set_up, error)
    if (allocated(error)) return
    text = overview(scene, set_up%system, .true.)
    call expect_line(error, text, 'P wave', '5.354 km/s, plane stress')
    call expect_line(error, text, 'S wave', '3.091 km/s')
    call expect_line(error, text, 'Rayleigh wave', '2.842 km/s')
    call expect_line(error, text, 'crit. stretch', '0.001')
    call expect_line(error, text, 'Gc', '4.297 kJ/m2')
    call expect_line(error, text, 'body 1', '60 mm in its thinnest direction: 2 horizons')
    call expect_line(error, text, 'crack 1', '20 mm long: 0.667 horizons')
    call expect_line(error, text, 'region 1', 'left: 12 points')
    call expect_line(error, text, 'boundary 1', "grip: 12 points, region 'left'")
    call expect_line(error, text, 'load 1', '6 points, side x_max')
    call expect_line(error, text, 'no-fail zone 1', '6 points')
    call expect_true(error, index(overview(scene, set_up%system, .false.), 'wave') == 0, &
      & 'waves without a density')
  end subroutine test_overview

  subroutine test_estimate(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    character(:), allocatable :: text

    call box_scene([8, 6], spacing, 0.3_wp, scene)
    scene%time%steps = 1000
    scene%output%every = 100
    scene%output%history_every = 7
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call estimate(scene, all_fields(), set_up%system, set_up%plan, schedule_of(scene, set_up%plan, &
      & set_up%system%family%n_bonds), 0.0_wp, text)
    call expect_true(error, index(text, 'with history and output (predicted)') > 0 .and. &
      & index(text, '(measured); 1000 steps') > 0 .and. &
      & index(text, 'one after every 7 steps') > 0 .and. &
      & index(text, '; 11 outputs') > 0, text)
    scene%time%method = 'relaxation'
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%displacement_gradient(1, 1) = 1.0e-3_wp
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call estimate(scene, all_fields(), set_up%system, set_up%plan, schedule_of(scene, set_up%plan, &
      & set_up%system%family%n_bonds), 0.0_wp, text)
    call expect_true(error, index(text, 'depends on the number of iterations') > 0 .and. &
      & index(text, 'one after every load step') > 0, text)
  end subroutine test_estimate

  !> A step ten times the stable one.
  subroutine test_failing(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text

    call box_scene([8, 6], spacing, 0.3_wp, scene)
    call prepare_run(scene, set_up, fault)
    call expect_true(error, .not. allocated(fault), 'the scene is refused')
    if (allocated(error)) return
    scene%time%step = 10*set_up%plan%limit
    scene%time%steps = 1000
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%velocity_gradient(1, 1) = 1.0_wp
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call estimate(scene, all_fields(), set_up%system, set_up%plan, schedule_of(scene, set_up%plan, &
      & set_up%system%family%n_bonds), 0.0_wp, text)
    call expect_true(error, index(text, 'not predicted, because the run fails: unstable') > 0, text)
  end subroutine test_failing

end module test_output_report_overview
