!> Fragments: two blocks that a crack parts, flying and spinning, against closed forms.
module test_output_measures_fragments
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_body_body, only: body_type
  use pd_motion_system, only: system_type
  use pd_output_fields_field, only: moment_type
  use pd_output_fields_table, only: all_fields
  use pd_output_measures_fragments, only: fragment_type, fragments_of, spin_of
  use pd_output_measures_measure, only: measure_list_type, row_source_type
  use pd_output_measures_table, only: measures_of
  use pd_scene_content_complete, only: complete_scene
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: prepare, set_up_type
  use comparisons, only: expect_close
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  use bodies, only: box_scene, density_of_steel, expect_true, rotation_matrix
  use test_scene_expect, only: expect_parts
  implicit none (type, external)
  private
  public :: collect_output_measures_fragments

  real(wp), parameter :: spacing = 1.0e-3_wp
  real(wp), parameter :: exact = 1.0e-12_wp    !! some roundings, relative

contains

  subroutine collect_output_measures_fragments(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('two blocks that fly and spin in the plane', test_plane), &
      & new_unittest('two blocks that fly and spin in 3D', test_block), &
      & new_unittest('points in a line and single points', test_thin), &
      & new_unittest('a body that cannot break is refused', test_refused)]
  end subroutine collect_output_measures_fragments

  !> A body that a crack at 4 spacings from its left side parts.
  subroutine parted(points, scene, set_up, error)
    integer, intent(in) :: points(:)
    type(scene_type), intent(out) :: scene
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    call box_scene(points, spacing, 0.25_wp, scene)
    scene%output%fragments = .true.
    deallocate (scene%cracks)
    allocate (scene%cracks(1))
    if (size(points) == 2) then
      scene%cracks(1)%from(:2) = [4.0_wp, -1.0_wp]*spacing
      scene%cracks(1)%to(:2) = [4.0_wp, 50.0_wp]*spacing
    else
      scene%cracks(1)%corner = [4.0_wp, -1.0_wp, -1.0_wp]*spacing
      scene%cracks(1)%edge_1 = [0.0_wp, 50.0_wp, 0.0_wp]*spacing
      scene%cracks(1)%edge_2 = [0.0_wp, 0.0_wp, 50.0_wp]*spacing
    end if
    call complete_scene(scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    if (allocated(fault) .and. .not. allocated(error)) call test_failed(error, fault%message)
  end subroutine parted

  !> Move the points of `left` (x below 4 spacings) or those of the rest as a rigid body: turned
  !> about their middle, shifted, with a velocity and an angular velocity.
  subroutine fly(body, system, v, left, middle, turn, shift, velocity, spin)
    type(body_type), intent(in) :: body
    type(system_type), intent(inout) :: system
    real(wp), intent(inout) :: v(:, :)
    logical, intent(in) :: left
    real(wp), intent(in) :: middle(3), turn(3, 3), shift(3), velocity(3), spin(3)
    real(wp) :: r(3)
    integer :: k, dim

    dim = body%dim
    do k = 1, body%n_slots
      if (body%point(k) == 0 .or. (left .neqv. body%x(k, 1) < 4*spacing)) cycle
      r = 0.0_wp
      r(:dim) = body%x(k, :) - middle(:dim)
      r = matmul(turn, r)
      system%state%u(k, :) = middle(:dim) + shift(:dim) + r(:dim) - body%x(k, :)
      r = velocity + [spin(2)*r(3) - spin(3)*r(2), spin(3)*r(1) - spin(1)*r(3), &
        & spin(1)*r(2) - spin(2)*r(1)]
      v(k, :) = r(:dim)
    end do
  end subroutine fly

  !> 4 x 6 and 7 x 6 points.
  subroutine test_plane(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type), target :: set_up
    type(measure_list_type) :: measures
    type(row_source_type) :: now
    type(fragment_type), allocatable :: fragments(:)
    type(fault_type), allocatable :: fault
    real(wp), allocatable, target :: v(:, :)
    real(wp), allocatable :: row(:)
    real(wp) :: mass

    call parted([11, 6], scene, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      allocate (v(system%body%n_slots, 2), source=0.0_wp)
      call fly(system%body, system, v, .true., [2.0_wp, 3.0_wp, 0.0_wp]*spacing, &
        & rotation_matrix([0.0_wp, 0.0_wp, 1.0_wp], 0.7_wp), [-3.0_wp, 0.5_wp, 0.0_wp]*spacing, &
        & [-20.0_wp, 4.0_wp, 0.0_wp], [0.0_wp, 0.0_wp, 5.0e3_wp])
      call fly(system%body, system, v, .false., [7.5_wp, 3.0_wp, 0.0_wp]*spacing, &
        & rotation_matrix([0.0_wp, 0.0_wp, 1.0_wp], -2.0_wp), [2.0_wp, 0.1_wp, 0.0_wp]*spacing, &
        & [10.0_wp, -1.0_wp, 0.0_wp], [0.0_wp, 0.0_wp, -3.0e3_wp])
      now%system => set_up%system
      now%v => v
      call fragments_of(now%moment_type, fragments)
      call check(error, size(fragments), 2)
      if (allocated(error)) return
      mass = density_of_steel*scene%header%thickness*spacing**2
      call expect_one(error, fragments(1), 24, 24*mass, [-1.0_wp, 3.5_wp, 0.0_wp]*spacing, &
        & [-20.0_wp, 4.0_wp, 0.0_wp], [0.0_wp, 0.0_wp, 5.0e3_wp], &
        & (2*norm2([1.5_wp, 2.5_wp]) + 1)*spacing)
      call expect_one(error, fragments(2), 42, 42*mass, [9.5_wp, 3.1_wp, 0.0_wp]*spacing, &
        & [10.0_wp, -1.0_wp, 0.0_wp], [0.0_wp, 0.0_wp, -3.0e3_wp], &
        & (2*norm2([3.0_wp, 2.5_wp]) + 1)*spacing)
      call measures_of(scene, all_fields(), measures)
      call measures%begin(scene, system, fault)
      call expect_true(error, .not. allocated(fault), 'refused')
      call measures%row(now, row)
      call expect_close(error, row, [2.0_wp, 42*mass], exact*mass, 'row of the history')
    end associate
  end subroutine test_plane

  !> 4 x 3 x 5 and 3 x 3 x 5 points, about axes that lie askew to them.
  subroutine test_block(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type), target :: set_up
    type(moment_type) :: now
    type(fragment_type), allocatable :: fragments(:)
    real(wp), allocatable, target :: v(:, :)
    real(wp), parameter :: axis(3) = [2.0_wp, -1.0_wp, 2.0_wp]/3
    real(wp) :: mass

    call parted([7, 3, 5], scene, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      allocate (v(system%body%n_slots, 3), source=0.0_wp)
      call fly(system%body, system, v, .true., [2.0_wp, 1.5_wp, 2.5_wp]*spacing, &
        & rotation_matrix(axis, 1.1_wp), [-4.0_wp, 0.0_wp, 1.0_wp]*spacing, &
        & [-20.0_wp, 4.0_wp, 7.0_wp], [5.0e3_wp, -2.0e3_wp, 1.0e3_wp])
      call fly(system%body, system, v, .false., [5.5_wp, 1.5_wp, 2.5_wp]*spacing, &
        & rotation_matrix(axis, -0.4_wp), [1.0_wp, 2.0_wp, 3.0_wp]*spacing, &
        & [1.0_wp, 2.0_wp, 3.0_wp], [-1.0e3_wp, 4.0e3_wp, 2.5e3_wp])
      now%system => set_up%system
      now%v => v
      call fragments_of(now, fragments)
      call check(error, size(fragments), 2)
      if (allocated(error)) return
      mass = density_of_steel*spacing**3
      call expect_one(error, fragments(1), 60, 60*mass, [-2.0_wp, 1.5_wp, 3.5_wp]*spacing, &
        & [-20.0_wp, 4.0_wp, 7.0_wp], [5.0e3_wp, -2.0e3_wp, 1.0e3_wp], &
        & (2*norm2([1.5_wp, 1.0_wp, 2.0_wp]) + 1)*spacing)
      call expect_one(error, fragments(2), 45, 45*mass, [6.5_wp, 3.5_wp, 5.5_wp]*spacing, &
        & [1.0_wp, 2.0_wp, 3.0_wp], [-1.0e3_wp, 4.0e3_wp, 2.5e3_wp], &
        & (2*norm2([1.0_wp, 1.0_wp, 2.0_wp]) + 1)*spacing)
    end associate
  end subroutine test_block

  !> One fragment against what it should be.
  subroutine expect_one(error, fragment, points, mass, centre, velocity, spin, size)
    type(error_type), allocatable, intent(inout) :: error
    type(fragment_type), intent(in) :: fragment
    integer, intent(in) :: points
    real(wp), intent(in) :: mass, centre(3), velocity(3), spin(3), size

    if (.not. allocated(error)) call check(error, fragment%points, points)
    call expect_close(error, fragment%mass, mass, exact*mass, 'mass')
    call expect_close(error, fragment%centre, centre, exact*spacing, 'centre')
    call expect_close(error, fragment%velocity, velocity, exact*norm2(velocity), 'velocity')
    call expect_close(error, fragment%spin, spin, 10*exact*norm2(spin), 'spin')
    call expect_close(error, fragment%size, size, exact*size, 'size')
  end subroutine expect_one

  !> Two mass points of 3 kg, 2 m apart along an axis askew: about that axis they have no inertia,
  !> about all others 6 kg m2. A single point has none at all.
  subroutine test_thin(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: axis(3) = [2.0_wp, -1.0_wp, 2.0_wp]/3
    real(wp), parameter :: spin(3) = [1.0_wp, 4.0_wp, 1.0_wp]  ! normal to the axis
    real(wp) :: inertia(3, 3)
    integer :: c

    do c = 1, 3
      inertia(:, c) = -6*axis*axis(c)
      inertia(c, c) = inertia(c, c) + 6
    end do
    call expect_close(error, spin_of(matmul(inertia, spin), inertia), spin, 1.0e-14_wp, 'a line')
    inertia = 0.0_wp
    call expect_close(error, spin_of([0.0_wp, 0.0_wp, 0.0_wp], inertia), 0.0_wp, 0.0_wp, 'a point')
  end subroutine test_thin

  !> Without critical stretch and crack.
  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(measure_list_type) :: measures
    type(fault_type), allocatable :: fault

    call box_scene([6, 6], spacing, 0.25_wp, scene)
    scene%output%fragments = .true.
    call complete_scene(scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    call measures_of(scene, all_fields(), measures)
    call measures%begin(scene, set_up%system, fault)
    call expect_parts(error, fault, 'no bond can break')
  end subroutine test_refused

end module test_output_measures_fragments
