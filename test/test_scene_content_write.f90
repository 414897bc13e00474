!> Scenes as text: what is written reads back to the same scene.
module test_scene_content_write
  use pd_base_kinds, only: wp
  use pd_scene_content_types, only: scene_type
  use pd_scene_content_write, only: commented_text, scene_text
  use test_scene_expect, only: expect_scene, good_head, line
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_content_write

  character(*), parameter :: full = &
    & "&scene title = 'it''s / full' dimension = 3 plane = 'strain' thickness = 0.1 area = 3 /"// &
    & line//"&body name = 'a' material = 'm' lower = 0 0 0 upper = 1 1 1 points = 7 7 7 /"//line// &
    & "&body name = 'b' material = 'n' lower = 2 0 0 upper = 3 1 1 points = 7 7 7 /"//line// &
    & "&remove shape = 'sphere' radius = 0.1 centre = 0.1 0.2 0.3 /"//line// &
    & "&region name = 'r' shape = 'box' lower(2) = 0.3 upper(1) = 0.1 upper(3) = 0.7 /"//line// &
    & "&region name = 's' shape = 'cylinder' radius = 1 axis = 'y' lower(2) = -1 /"//line// &
    & "&material name = 'm' model = 'bond_based' youngs_modulus = 123.456789e9 density = 1e3 "// &
    & 'poissons_ratio = 0.4 ignore_poissons_ratio = .true. critical_stretch = 0.1 /'//line// &
    & "&material name = 'n' youngs_modulus = 3 density = 0.1 poissons_ratio = -0.3 "// &
    & 'critical_energy_release_rate = 7 break_in_compression = T thermal_expansion = 1e-5 /'// &
    & line//"&horizon length = 0.7 volume_correction = 'exact' surface_correction = 'none' "// &
    & "dilatation = 'unprojected' /"//line// &
    & '&crack corner = 0 0 0 edge_1 = 1 0 0 edge_2 = 0 1 0 /'//line// &
    & '&crack centre = 0.1 0.1 0.1 normal = 1 1 0 radius = 0.2 /'//line// &
    & "&no_fail region = 'r' /&no_fail shape = 'box' upper(3) = 0.1 /"//line// &
    & "&initial region = 's' displacement_y = 0.1 velocity_z = -0.7 temperature_change = 3 "// &
    & 'velocity_gradient(1,3) = 0.1 displacement_gradient = 1 2 3 4 5 6 7 8 9 /'//line// &
    & "&boundary name = 'w' body = 'a' side = 'x_min' displacement_x = 0 velocity_y = 1 "// &
    & 'ramp_time = 0.3 /'//line// &
    & "&load body = 'b' side = 'x_max' pressure = -1e6 force_y = 3 times = 0 0.1 values = 0 1 /"// &
    & line//"&load region = 'r' body_force_z = -9.81 /"//line// &
    & "&time method = 'explicit' integrator = 'runge_kutta' step = 1.94598e-7 duration = 0.1 /"// &
    & line//"&relaxation density_matrix = 'constant' tolerance = 1e-9 maximum_iterations = 7 "// &
    & 'load_steps = 3 /'//line//"&output interval = 0.01 history_every = 3 fields = 'damage', "// &
    & "'energy_density' precision = 'single' format = 'both' /"//line// &
    & "&probe name = 'p' point = 0.1 0.2 0.3 fields = 'velocity' /"

contains

  subroutine collect_scene_content_write(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a short scene comes back', test_short), &
      & new_unittest('a scene with every group comes back', test_full), &
      & new_unittest('the commented form reads the same', test_commented), &
      & new_unittest('every value is written', test_values)]
  end subroutine collect_scene_content_write

  !> Two scenes are the same where their texts are, since every key is in the text with all bits.
  subroutine test_short(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: first, second

    call expect_scene(error, good_head//'&time steps = 7 /', first)
    call expect_scene(error, scene_text(first), second)
    if (allocated(error)) return
    call check(error, scene_text(second), scene_text(first))
  end subroutine test_short

  subroutine test_full(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: first, second

    call expect_scene(error, full, first)
    if (allocated(error)) return
    call expect_scene(error, scene_text(first), second)
    if (allocated(error)) return
    call check(error, scene_text(second), scene_text(first))
    if (allocated(error)) return
    call check(error, all(abs(second%initial(1)%displacement_gradient - &
      & first%initial(1)%displacement_gradient) <= 0.0_wp) .and. &
      & all(abs(second%regions(1)%upper - first%regions(1)%upper) <= 0.0_wp) .and. &
      & abs(second%materials(1)%youngs_modulus - 123.456789e9_wp) <= 0.0_wp)
  end subroutine test_full

  subroutine test_commented(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: first, second

    call expect_scene(error, full, first)
    if (allocated(error)) return
    call expect_scene(error, commented_text(first)//'&relaxation density_matrix = '// &
      & "'constant' tolerance = 1e-9 maximum_iterations = 7 load_steps = 3 /", second)
    if (allocated(error)) return
    call check(error, scene_text(second), scene_text(first))
  end subroutine test_commented

  subroutine test_values(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    character(:), allocatable :: text
    character(40), parameter :: parts(10) = [character(40) :: "title = 'it''s / full'", &
      & 'lower(2) = 0.3', 'upper(3) = 0.7', 'poissons_ratio = 0.25', 'pressure = -1e6', &
      & 'times = 0.0, 0.1', 'safety = 5.0', 'velocity_y = 1.0', 'length = 0.7', &
      & "fields = 'damage', 'energy_density'"]
    integer :: i

    call expect_scene(error, full, scene)
    if (allocated(error)) return
    text = scene_text(scene)
    do i = 1, size(parts)
      call check(error, index(text, trim(parts(i))) > 0, trim(parts(i))//' is not in:'//line//text)
      if (allocated(error)) return
    end do
  end subroutine test_values

end module test_scene_content_write
