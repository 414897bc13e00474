!> Triangles of rigid bodies in the files of an output: what they enclose, where they are, and which
!> files there are.
module test_output_report_rigid_surfaces
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_base_vectors, only: cross
  use pd_force_obstacle, only: find_gap
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_rigid_bodies, only: move_rigid_bodies
  use pd_output_report_rigid_surfaces, only: rigid_surfaces_type
  use pd_output_results_files, only: file_exists
  use pd_output_results_results, only: column_type, field_type, results_type
  use pd_output_results_surfaces, only: triangles_type
  use pd_output_results_types, only: kept_type
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: set_up_type
  use bodies, only: diary_type, expect, expect_true, ready_alone
  use comparisons, only: expect_close, max_abs
  use meshes, only: write_file
  use surfaces, only: binary_stl, box_facets
  use test_scene_expect, only: line
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_output_report_rigid_surfaces

  real(wp), parameter :: pi = acos(-1.0_wp)
  character(*), parameter :: here = 'build/test_rigid_surfaces'

contains

  subroutine collect_output_report_rigid_surfaces(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('bodies in 3D', test_space), &
      & new_unittest('bodies in 2D', test_plane), &
      & new_unittest('files of outputs, of a run that goes on, and of one without', test_files)]
  end subroutine collect_output_report_rigid_surfaces

  !> A scene after some steps, and its triangles.
  subroutine ran(text, set_up, drawn, error)
    character(*), intent(in) :: text
    type(set_up_type), intent(out) :: set_up
    type(rigid_surfaces_type), intent(out) :: drawn
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    type(diary_type) :: diary

    call read_scene_text(text, 'build/tool.nml', scene, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    call drawn%begin(set_up%system, [-4.0e-3_wp, -4.0e-3_wp, -4.0e-3_wp], [4.0e-3_wp, 4.0e-3_wp, &
      & 0.0_wp])
    call run_explicit(set_up%system, 'forward_backward', set_up%plan%step, set_up%plan%steps, &
      & diary, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine ran

  !> The volume within the triangles of a body, and the sum of their areas along normals.
  pure subroutine enclosed(drawn, places, number, volume, area)
    type(rigid_surfaces_type), intent(in) :: drawn
    real(wp), intent(in) :: places(:, :)
    integer, intent(in) :: number
    real(wp), intent(out) :: volume, area(3)
    real(wp) :: a(3), b(3), c(3)
    integer :: f

    volume = 0.0_wp
    area = 0.0_wp
    do f = 1, size(drawn%triangles%body)
      if (drawn%triangles%body(f) /= number) cycle
      a = places(drawn%triangles%corner(1, f), :)
      b = places(drawn%triangles%corner(2, f), :)
      c = places(drawn%triangles%corner(3, f), :)
      volume = volume + dot_product(a, cross(b, c))/6
      area = area + cross(b - a, c - a)/2
    end do
  end subroutine enclosed

  !> After steps in which they move and turn, vertices lie on the surfaces that points meet, the
  !> triangles are closed and enclose the volume, and vertices have the velocity of the material.
  subroutine test_space(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: moves = ' mass = 1e-3 velocity_x = 50 spin_y = 2e4 spin_x = -7e3 /'
    type(set_up_type) :: set_up
    type(rigid_surfaces_type) :: drawn
    real(wp), allocatable :: places(:, :), velocity(:, :), later(:, :), ignored(:, :)
    real(wp) :: volume, area(3), known(4), gap, normal(3), spread_of_patch(3)
    integer :: r, v

    call write_file('tool.stl', binary_stl(box_facets([-3.0_wp, -0.5_wp, -0.5_wp], [3.0_wp, &
      & 0.5_wp, 1.5_wp])))
    call ran('&scene dimension = 3 /'//line//'&material youngs_modulus = 1e9 density = 1e3 '// &
      & 'poissons_ratio = 0.25 /'//line//"&body name = 'block' lower = -4e-3, -4e-3, -4e-3 "// &
      & 'upper = 4e-3, 4e-3, 0 points = 8, 8, 4 /'//line// &
      & "&rigid name = 'a' shape = 'sphere' centre = 0.1, 0, 0 radius = 2e-3"//moves//line// &
      & "&rigid name = 'b' shape = 'cylinder' centre = 0, 0.1, 0 radius = 2e-3 length = 5e-3 "// &
      & 'axis = 1, 2, 3'//moves//line// &
      & "&rigid name = 'c' shape = 'box' centre = 0, 0.2, 0 edges = 2e-3, 3e-3, 4e-3 angle = 20"// &
      & moves//line//"&rigid name = 'd' shape = 'surface' surface = 'tool.stl' scale = 1e-3 "// &
      & 'centre = 0, 0.3, 0'//moves//line// &
      & "&rigid name = 'e' shape = 'half_space' centre = 0, 0, -0.02 normal = 0, 0.6, 0.8 "// &
      & "displacement_z = '100*t' /"//line//"&contact between = 'block', 'a' /"//line// &
      & '&time duration = 1e-5 step = 1e-7 /', set_up, drawn, error)
    if (allocated(error)) return
    call drawn%place(set_up%system, places, velocity)
    known = [4*pi/3*8.0e-9_wp, pi*20.0e-9_wp, 24.0e-9_wp, 12.0e-9_wp]
    do r = 1, 4
      call enclosed(drawn, places, r, volume, area)
      call expect_close(error, area, 0.0_wp, 1.0e-17_wp, 'closed')
      ! round ones by 64 chords around, and a ball by 32 from pole to pole
      call expect(error, volume, known(r), merge(6.0e-3_wp, 1.0e-11_wp, r <= 2)*known(r), 'volume')
    end do
    call expect_true(error, maxval(drawn%triangles%body) == 5, 'bodies')
    do v = 1, drawn%triangles%n_vertices
      r = drawn%of(v)
      call find_gap(set_up%system%obstacles(r), places(v, :), gap, normal)
      call expect(error, gap, 0.0_wp, 1.0e-15_wp, 'on the surface')
      if (allocated(error)) return
    end do
    spread_of_patch = maxval(places(size(drawn%of) - 3:, :), dim=1) &
      & - minval(places(size(drawn%of) - 3:, :), dim=1)
    call expect_true(error, maxval(spread_of_patch) > 0.012_wp, 'the patch is too small')
    ! nothing touches: so they go on
    call move_rigid_bodies(set_up%system, set_up%system%time, 1.0e-10_wp)
    call drawn%place(set_up%system, later, ignored)
    call expect_close(error, (later - places)/1.0e-10_wp, velocity, 1.0e-4_wp, 'velocity')
    call expect_true(error, max_abs(velocity(:, 3)) > 30.0_wp, 'nothing turns')
  end subroutine test_space

  !> A circle, a rectangle and a patch of a half-plane, as areas.
  subroutine test_plane(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(rigid_surfaces_type) :: drawn
    real(wp), allocatable :: places(:, :), velocity(:, :)
    real(wp) :: volume, area(3), gap, normal(3)
    integer :: v

    call ran('&scene dimension = 2 /'//line//'&material youngs_modulus = 1e9 density = 1e3 '// &
      & 'poissons_ratio = 0.25 /'//line//"&body name = 'block' lower = -4e-3, -4e-3 "// &
      & 'upper = 4e-3, 0 points = 8, 4 /'//line//"&rigid name = 'a' shape = 'sphere' "// &
      & 'centre = 0.1, 0 radius = 2e-3 mass = 1 velocity_x = 50 /'//line// &
      & "&rigid name = 'b' shape = 'box' centre = 0, 0.1 edges = 2e-3, 3e-3 angle = 20 mass = 1 /" &
      & //line//"&rigid name = 'c' shape = 'half_space' centre = 0, -0.02 normal = 0.6, 0.8 /"// &
      & line//"&contact between = 'block', 'a' /"//line//'&time duration = 1e-6 step = 1e-7 /', &
      & set_up, drawn, error)
    if (allocated(error)) return
    call drawn%place(set_up%system, places, velocity)
    call enclosed(drawn, places, 1, volume, area)
    call expect_close(error, area, [0.0_wp, 0.0_wp, pi*4.0e-6_wp], 2.0e-3_wp*pi*4.0e-6_wp, 'disc')
    call enclosed(drawn, places, 2, volume, area)
    call expect_close(error, area, [0.0_wp, 0.0_wp, 6.0e-6_wp], 1.0e-17_wp, 'rectangle')
    do v = 1, drawn%triangles%n_vertices
      call find_gap(set_up%system%obstacles(drawn%of(v)), places(v, :2), gap, normal)
      call expect_true(error, gap <= 1.0e-15_wp, 'outside')
    end do
    call expect_close(error, [places(:, 3), velocity(:, 3)], 0.0_wp, 1.0e-300_wp, 'in the plane')
  end subroutine test_plane

  !> Outputs have files; a run that goes on removes those that its checkpoint does not count, and a
  !> run without rigid bodies all of them.
  subroutine test_files(error)
    type(error_type), allocatable, intent(out) :: error
    type(rigid_surfaces_type) :: drawn
    type(results_type) :: results
    type(kept_type) :: kept
    type(fault_type), allocatable :: fault
    type(set_up_type) :: set_up
    integer :: k

    call ran('&scene dimension = 2 /'//line//'&material youngs_modulus = 1e9 density = 1e3 '// &
      & 'poissons_ratio = 0.25 /'//line//"&body name = 'block' lower = -4e-3, -4e-3 "// &
      & 'upper = 4e-3, 0 points = 8, 4 /'//line//"&rigid name = 'a' shape = 'sphere' "// &
      & 'centre = 0.1, 0 radius = 2e-3 mass = 1 velocity_x = 50 /'//line// &
      & "&contact between = 'block', 'a' /"//line//'&time steps = 1 /', set_up, drawn, error)
    if (allocated(error)) return
    call written(.true., [1.0_wp, 2.0_wp, 3.0_wp])
    call expect_true(error, all([(there(k), k=0, 2)]) .and. .not. there(3), 'three outputs')
    call expect_true(error, file_exists(here//'/s_rigid.pvd'), 'their list')
    kept%times = [1.0_wp, 2.0_wp]
    allocate (kept%rows(1, 0))
    kept%scene_text = '&scene /'
    call written(.true., [real(wp) ::])
    call expect_true(error, there(1) .and. .not. there(2), 'two outputs stay')
    call written(.true., [4.0_wp])
    call expect_true(error, there(2), 'one more')
    deallocate (kept%times)
    call written(.false., [1.0_wp])
    call expect_true(error, .not. (there(0) .or. there(1) .or. there(2)), 'files of an earlier run')
    call expect_true(error, .not. file_exists(here//'/s_rigid.pvd'), 'its list')

  contains

    !> Whether output `k`, from 0, has a file.
    logical function there(k)
      integer, intent(in) :: k
      there = file_exists(here//'/s_rigid_00000'//achar(iachar('0') + k)//'.vtp')
    end function there

    !> Write outputs, after those of `kept` if these are given.
    subroutine written(with, times)
      logical, intent(in) :: with
      real(wp), intent(in) :: times(:)
      type(triangles_type) :: triangles
      real(wp), allocatable :: places(:, :), velocity(:, :)
      real(wp) :: positions(2, 3)
      integer :: i

      positions = 0.0_wp
      allocate (triangles%corner(3, 0), triangles%body(0))
      if (with) triangles = drawn%triangles
      if (allocated(kept%times)) then
        call results%create(here, 's', positions, [field_type('damage', 1, '1')], 3, &
          & [column_type('time', 's')], 1, 'double', 'vtu', '&scene /', '', '', .true., fault, &
          & kept, triangles=triangles)
      else
        call results%create(here, 's', positions, [field_type('damage', 1, '1')], 3, &
          & [column_type('time', 's')], 1, 'double', 'vtu', '&scene /', '', '', .true., fault, &
          & triangles=triangles)
      end if
      call drawn%place(set_up%system, places, velocity)
      do i = 1, size(times)
        if (.not. allocated(fault)) call results%begin_output(times(i), fault)
        if (.not. allocated(fault)) call results%put_field('damage', positions(:, 1), fault)
        if (with .and. .not. allocated(fault)) call results%put_surfaces(places, velocity, fault)
        if (.not. allocated(fault)) call results%end_output(fault)
      end do
      if (allocated(fault)) call test_failed(error, fault%message)
      call results%close(fault, stopped=.true.)
      if (allocated(fault) .and. .not. allocated(error)) call test_failed(error, fault%message)
    end subroutine written
  end subroutine test_files

end module test_output_report_rigid_surfaces
