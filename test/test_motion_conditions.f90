!> Imposed motion, loads and initial states: exact values at any time.
module test_motion_conditions
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text
  use pd_base_error, only: fault_type => error_type
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_curve, only: curve_type, constant_curve, ramp, table_curve
  use pd_motion_system, only: add_loads, evaluate
  use pd_scene_content_types, only: scene_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: prepare_run, at_point, box_scene, expect, expect_true, ready
  implicit none (type, external)
  private
  public :: collect_motion_conditions

contains

  subroutine collect_motion_conditions(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('tables are linear between and constant outside', test_table), &
      & new_unittest('integrals of tables are exact', test_integral), &
      & new_unittest('imposed velocity and displacement', test_imposed), &
      & new_unittest('of several motions the last constrains a component', test_last), &
      & new_unittest('loads have the prescribed sum', test_loads), &
      & new_unittest('initial gradients and regions', test_initial), &
      & new_unittest('initial states from a file are in the order of points', test_file), &
      & new_unittest('a file of initial states in pieces', test_long_file), &
      & new_unittest('uniform heating: free expansion has no force', test_heating), &
      & new_unittest('plane strain expands by 1 + nu', test_plane_strain)]
  end subroutine collect_motion_conditions

  subroutine test_table(error)
    type(error_type), allocatable, intent(out) :: error
    type(curve_type) :: curve

    curve = table_curve([1.0_wp, 2.0_wp, 4.0_wp], [3.0_wp, 5.0_wp, 1.0_wp])
    call expect(error, curve%value(0.0_wp), 3.0_wp, 0.0_wp, 'before')
    call expect(error, curve%value(1.5_wp), 4.0_wp, 0.0_wp, 'between')
    call expect(error, curve%value(2.0_wp), 5.0_wp, 0.0_wp, 'at a time')
    call expect(error, curve%value(3.0_wp), 3.0_wp, 0.0_wp, 'between the last')
    call expect(error, curve%value(9.0_wp), 1.0_wp, 0.0_wp, 'after')
    call expect(error, curve%slope(0.5_wp), 0.0_wp, 0.0_wp, 'slope before')
    call expect(error, curve%slope(1.0_wp), 2.0_wp, 0.0_wp, 'slope at the first time')
    call expect(error, curve%slope(2.0_wp), -2.0_wp, 0.0_wp, 'slope at a kink')
    call expect(error, curve%slope(4.0_wp), 0.0_wp, 0.0_wp, 'slope after')
    curve = ramp(2.0_wp)
    call expect(error, curve%value(0.5_wp), 0.25_wp, 0.0_wp, 'on the ramp')
    call expect(error, curve%value(7.0_wp), 1.0_wp, 0.0_wp, 'past the ramp')
    curve = ramp(0.0_wp)
    call expect(error, curve%value(0.0_wp), 1.0_wp, 0.0_wp, 'no ramp')
    curve = constant_curve()
    call expect(error, curve%integral(2.5_wp), 2.5_wp, 0.0_wp, 'integral of 1')
  end subroutine test_table

  !> The integral from 0, by hand; times may begin after 0 or before it.
  subroutine test_integral(error)
    type(error_type), allocatable, intent(out) :: error
    type(curve_type) :: curve

    curve = table_curve([1.0_wp, 2.0_wp, 4.0_wp], [3.0_wp, 5.0_wp, 1.0_wp])
    call expect(error, curve%integral(0.5_wp), 1.5_wp, 1.0e-15_wp, 'before')
    call expect(error, curve%integral(1.5_wp), 3.0_wp + 1.75_wp, 1.0e-15_wp, &
      & 'in the first interval')
    call expect(error, curve%integral(4.0_wp), 3.0_wp + 4.0_wp + 6.0_wp, 1.0e-14_wp, &
      & 'the whole table')
    call expect(error, curve%integral(6.0_wp), 13.0_wp + 2.0_wp, 1.0e-14_wp, 'after')
    curve = table_curve([-1.0_wp, 1.0_wp], [0.0_wp, 2.0_wp])
    call expect(error, curve%integral(0.0_wp), 0.0_wp, 0.0_wp, 'nothing at 0')
    call expect(error, curve%integral(1.0_wp), 1.5_wp, 1.0e-15_wp, 'a table that begins before 0')
    curve = ramp(2.0_wp)
    call expect(error, curve%integral(1.0_wp), 0.25_wp, 1.0e-15_wp, 'a ramp')
    call expect(error, curve%integral(5.0_wp), 1.0_wp + 3.0_wp, 1.0e-14_wp, 'past a ramp')
  end subroutine test_integral

  !> u(0) + V times the integral, v = V times the value; imposed displacements are absolute; other
  !> components stay free.
  subroutine test_imposed(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    integer :: k

    call box_scene([6, 5], 1.0_wp, 0.3_wp, scene)
    deallocate (scene%boundaries, scene%initial)
    allocate (scene%boundaries(2), scene%initial(1))
    scene%initial(1)%displacement(:2) = [0.01_wp, 0.02_wp]
    scene%initial(1)%velocity(:2) = [7.0_wp, 8.0_wp]
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%velocity(1) = -2.0_wp
    scene%boundaries(1)%times = [0.0_wp, 1.0_wp]
    scene%boundaries(1)%values = [1.0_wp, 3.0_wp]
    scene%boundaries(2)%side = 'y_max'
    scene%boundaries(2)%displacement(2) = 0.5_wp
    scene%boundaries(2)%ramp_time = 4.0_wp
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call evaluate(set_up%system, 0.5_wp, breaking=.false.)
    associate (u => set_up%system%state%u, v => set_up%system%state%v, body => set_up%system%body)
      k = at_point(body, [-1.5_wp, 2.5_wp])
      call expect(error, u(k, 1), 0.01_wp - 2*0.75_wp, 1.0e-15_wp, &
        & 'displacement of imposed velocity')
      call expect(error, v(k, 1), -4.0_wp, 1.0e-15_wp, 'imposed velocity')
      call expect(error, u(k, 2), 0.02_wp, 0.0_wp, 'a free component')
      call expect(error, v(k, 2), 8.0_wp, 0.0_wp, 'velocity of a free component')
      k = at_point(body, [2.5_wp, 6.5_wp])
      call expect(error, u(k, 2), 0.0625_wp, 1.0e-16_wp, 'imposed displacement')
      call expect(error, v(k, 2), 0.125_wp, 1.0e-16_wp, 'velocity of imposed displacement')
      k = at_point(body, [2.5_wp, 2.5_wp])
      call expect(error, u(k, 1), 0.01_wp, 0.0_wp, 'a point of the body')
      call expect_true(error, count(set_up%system%held == 1) == 3*5 + 3*6, 'held components')
    end associate
  end subroutine test_imposed

  subroutine test_last(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up

    call box_scene([6, 5], 1.0_wp, 0.3_wp, scene)
    deallocate (scene%boundaries, scene%regions)
    allocate (scene%boundaries(2), scene%regions(2))
    scene%regions%shape = 'box'
    scene%regions(1)%name = 'left'
    scene%regions(1)%upper(1) = 2.0_wp
    scene%regions(2)%name = 'bottom'
    scene%regions(2)%upper(2) = 1.0_wp
    scene%boundaries(1)%region = 'left'
    scene%boundaries(1)%displacement(:2) = [0.1_wp, 0.2_wp]
    scene%boundaries(2)%region = 'bottom'
    scene%boundaries(2)%displacement(2) = 0.4_wp
    call ready(scene, set_up, error)
    if (allocated(error)) return
    associate (u => set_up%system%state%u, k => at_point(set_up%system%body, [0.5_wp, 0.5_wp]), &
      & j => at_point(set_up%system%body, [0.5_wp, 3.5_wp]))
      call expect(error, u(k, 1), 0.1_wp, 0.0_wp, 'only one claims x')
      call expect(error, u(k, 2), 0.4_wp, 0.0_wp, 'the last holds y')
      call expect(error, u(j, 2), 0.2_wp, 0.0_wp, 'only the first reaches here')
    end associate
    call expect_true(error, count(set_up%system%held == 1) == 2*2*5 + 4, 'held components')
  end subroutine test_last

  !> Pressure times face, whole force, body force times volume; on the outermost row alone, which a
  !> layer is not; a positive pressure pushes inwards at both ends.
  subroutine test_loads(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: b(:, :)
    real(wp) :: face

    call box_scene([6, 5, 4], 0.1_wp, 0.3_wp, scene)
    deallocate (scene%loads, scene%boundaries)
    allocate (scene%loads(3), scene%boundaries(1))
    scene%boundaries(1)%side = 'x_max'
    scene%boundaries(1)%displacement(1) = 0.0_wp
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%pressure = 1000.0_wp
    scene%loads(1)%ramp_time = 2.0_wp
    scene%loads(2)%side = 'y_min'
    scene%loads(2)%pressure = 500.0_wp
    scene%loads(2)%force(3) = -7.0_wp
    scene%loads(3)%body_force(1) = 11.0_wp
    call ready(scene, set_up, error)
    if (allocated(error)) return
    associate (body => set_up%system%body)
      allocate (b(body%n_slots, 3), source=0.0_wp)
      call add_loads(set_up%system, 1.0_wp, 1.0_wp, .false., b)
      face = 0.5_wp*0.4_wp
      call expect(error, dot_product(b(:, 1), body%volume), &
        & -1000*face/2 + 11*0.6_wp*0.5_wp*0.4_wp, &
        & 1.0e-10_wp, 'total along x')
      call expect(error, dot_product(b(:, 2), body%volume), 500*0.6_wp*0.4_wp, 1.0e-10_wp, &
        & 'total along y')
      call expect(error, dot_product(b(:, 3), body%volume), -7.0_wp, 1.0e-12_wp, 'total along z')
      call expect_true(error, all(abs(b(:, 2)) <= 0.0_wp .or. body%x(:, 2) < 0.1_wp), &
        & 'only the outermost row')
      call expect_true(error, all(body%layer == 0 .or. abs(b(:, 1)) <= 0.0_wp), &
        & 'layers bear no load')
    end associate
  end subroutine test_loads

  !> u = u0 + H x and v likewise, on a region after the whole.
  subroutine test_initial(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp) :: H(2, 2)
    integer :: k

    H = reshape([0.01_wp, 0.02_wp, -0.03_wp, 0.04_wp], [2, 2])
    call box_scene([6, 5], 1.0_wp, 0.3_wp, scene)
    deallocate (scene%initial, scene%regions)
    allocate (scene%initial(2), scene%regions(1))
    scene%regions(1)%name = 'right'
    scene%regions(1)%shape = 'box'
    scene%regions(1)%lower(1) = 3.0_wp
    scene%initial(1)%displacement_gradient(:2, :2) = H
    scene%initial(1)%displacement(2) = 0.5_wp
    scene%initial(2)%region = 'right'
    scene%initial(2)%velocity_gradient(1, 2) = 3.0_wp
    scene%initial(2)%displacement(1) = 0.125_wp
    call ready(scene, set_up, error)
    if (allocated(error)) return
    associate (u => set_up%system%state%u, v => set_up%system%state%v, body => set_up%system%body)
      do k = 1, body%n_slots
        if (body%point(k) == 0) cycle
        associate (Hx => matmul(H, body%x(k, :)), right => body%x(k, 1) > 3.0_wp)
          call expect(error, u(k, 1), merge(0.125_wp, Hx(1), right), 1.0e-15_wp, &
            & 'u_x = H x, or the region''s')
          call expect(error, u(k, 2), 0.5_wp + Hx(2), 1.0e-15_wp, 'u_y = u0 + H x')
          call expect(error, v(k, 1), merge(3*body%x(k, 2), 0.0_wp, right), 1.0e-14_wp, 'v_x')
          call expect(error, v(k, 2), 0.0_wp, 0.0_wp, 'v_y')
        end associate
      end do
    end associate
  end subroutine test_initial

  subroutine test_file(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    integer :: unit, i

    call box_scene([4, 3], 1.0_wp, 0.3_wp, scene)
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%file = 'test-initial.txt'
    open (newunit=unit, file='test-initial.txt', status='replace', action='write')
    write (unit, '(a)') 'velocity_y displacement_x'
    write (unit, '(f6.2, f8.5)') (0.5_wp*i, 1.0e-3_wp*i, i=1, 12)
    close (unit)
    call ready(scene, set_up, error)
    if (.not. allocated(error)) then
      do i = 1, 12
        associate (k => at_point(set_up%system%body, [mod(i - 1, 4) + 0.5_wp, (i - 1)/4 + 0.5_wp]))
          call expect(error, set_up%system%state%v(k, 2), 0.5_wp*i, 1.0e-15_wp, &
            & 'velocity from the file')
          call expect(error, set_up%system%state%u(k, 1), 1.0e-3_wp*i, 1.0e-15_wp, &
            & 'displacement from the file')
        end associate
      end do
    end if
    scene%bodies(1)%points(1) = 5
    scene%bodies(1)%upper(1) = 5.0_wp
    call prepare_run(scene, set_up, fault)
    call expect_true(error, allocated(fault), 'a file with too few rows was accepted')
    if (allocated(fault)) call expect_true(error, index(fault%message, '12 rows') > 0 .and. &
      & index(fault%message, '15 points') > 0, 'message: '//fault%message)
    open (newunit=unit, file='test-initial.txt')
    close (unit, status='delete')
  end subroutine test_file

  !> More rows than are read at once: 40,000, of which the last are in a second piece; then faults
  !> in the header, in the first row and in the last one.
  subroutine test_long_file(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 200
    character(*), parameter :: name = 'test-initial-long.txt'
    ! the first file has no fault
    character(20), parameter :: lines(0:3) = [character(20) :: '', 'velocity_q', '1.0 2.0', 'x']
    integer, parameter :: faulty(0:3) = [0, 1, 2, n*n + 1]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    integer :: unit, i, f

    call box_scene([n, n], 1.0_wp, 0.3_wp, scene)
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%file = name
    do f = 0, ubound(lines, 1)
      open (newunit=unit, file=name, status='replace', action='write')
      do i = 1, n*n + 1
        if (i == faulty(f)) then
          write (unit, '(a)') trim(lines(f))
        else if (i == 1) then
          write (unit, '(a)') 'velocity_y'
        else
          write (unit, '(es14.6)') 1.0e-3_wp*(i - 1)
        end if
      end do
      close (unit)
      call prepare_run(scene, set_up, fault)
      if (f == 0) then
        if (allocated(fault)) call test_failed(error, fault%message)
        if (allocated(error)) return
        associate (body => set_up%system%body, v => set_up%system%state%v)
          call expect_true(error, all(abs(v(body%slot, 2) - [(1.0e-3_wp*i, i=1, n*n)]) &
            & <= 1.0e-12_wp), 'velocities of all rows')
        end associate
      else
        call expect_true(error, allocated(fault), 'accepted: '//lines(f))
        if (allocated(error)) return
        call expect_true(error, index(fault%message, name//':'//to_text(faulty(f))//achar(10)) &
          & > 0, fault%message)
      end if
    end do
    open (newunit=unit, file=name)
    close (unit, status='delete')
  end subroutine test_long_file

  !> u = alpha dT x relaxes a free body that is uniformly hot: every bond's mechanical stretch is 0.
  !> The force that is left is rounding of that of a held hot body.
  subroutine test_heating(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: points(3) = [9, 7, 6]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp) :: held, strain
    integer :: dim

    do dim = 1, 3
      call box_scene(points(:dim), 0.1_wp, 0.2_wp, scene)
      scene%horizon%surface_correction = 'energy'
      scene%materials(1)%thermal_expansion = 1.2e-5_wp
      deallocate (scene%initial)
      allocate (scene%initial(1))
      scene%initial(1)%temperature_change = 150.0_wp
      call ready(scene, set_up, error)
      if (allocated(error)) return
      call evaluate(set_up%system, 0.0_wp, breaking=.false.)
      held = max_abs(set_up%system%state%force)
      call expect_true(error, held > 1.0e6_wp, 'a held hot body is not pressed')
      strain = 1.2e-5_wp*150
      set_up%system%state%u = strain*set_up%system%body%x
      call evaluate(set_up%system, 0.0_wp, breaking=.false.)
      ! stretch is rounded to 8 eps of itself, so the force to some 1e-14 of that of the held body
      call expect_close(error, set_up%system%state%force, 0.0_wp, 1.0e-12_wp*held, &
        & 'force after expansion')
    end do
  end subroutine test_heating

  !> In plane strain a free plate expands by (1 + nu) alpha dT in its plane.
  subroutine test_plane_strain(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp) :: held

    call box_scene([9, 8], 0.1_wp, 0.4_wp, scene)
    scene%header%plane = 'strain'
    scene%materials(1)%thermal_expansion = 1.0e-5_wp
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%temperature_change = 100.0_wp
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call evaluate(set_up%system, 0.0_wp, breaking=.false.)
    held = max_abs(set_up%system%state%force)
    set_up%system%state%u = 1.4_wp*1.0e-3_wp*set_up%system%body%x
    call evaluate(set_up%system, 0.0_wp, breaking=.false.)
    call expect_close(error, set_up%system%state%force, 0.0_wp, 1.0e-12_wp*held, &
      & 'force after expansion')
  end subroutine test_plane_strain

end module test_motion_conditions
