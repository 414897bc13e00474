!> The energy balance of whole runs, and that they give the same bits on any number of threads.
module test_motion_system
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_kinds, only: wp, i8
  use pd_base_error, only: fault_type => error_type
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_scene_content_types, only: scene_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, unittest_type, test_failed
  use bodies, only: box_scene, density_of_steel, diary_type, expect, expect_true, ready, text_of, &
    & youngs_modulus
  implicit none (type, external)
  private
  public :: collect_motion_system

  real(wp), parameter :: spacing = 1.0e-3_wp

contains

  subroutine collect_motion_system(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a free body keeps its energy', test_free), &
      & new_unittest('imposed motion and loads supply the energy', test_work), &
      & new_unittest('kinks and jumps of the imposed speed keep the balance', test_kink), &
      & new_unittest('breaking bonds dissipate their energy', test_fracture), &
      & new_unittest('a bond pulls once more if it breaks after the forces', test_break_late), &
      & new_unittest('a run has the same bits on 1, 2 and 4 threads', test_threads)]
  end subroutine collect_motion_system

  !> Two points, pulled apart beyond the limit from the start. If their bond breaks before the
  !> forces they never move; if after, the first half kick sends them towards each other, and
  !> nothing stops them.
  subroutine test_break_late(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: stretch = 0.02_wp, ratio = 3.015_wp, dt = 1.0e-8_wp
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: speed
    integer :: late

    call box_scene([2], spacing, 0.0_wp, scene)
    scene%materials(1)%critical_stretch = stretch/2
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%displacement_gradient(1, 1) = stretch
    do late = 0, 1
      if (late == 1) scene%time%breaking = 'after_forces'
      call ready(scene, set_up, error)
      if (allocated(error)) return
      diary = diary_type(slot=set_up%system%body%slot(1))
      call run_explicit(set_up%system, 'forward_backward', dt, 3, diary, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      ! c s V/rho over half a step, with c = 2 E/(A delta^2) and V = A dx
      speed = late*dt/2*2*youngs_modulus/(ratio**2*spacing)*stretch/density_of_steel
      call expect(error, diary%u(1, 4) - diary%u(1, 1), 3*dt*speed, &
        & 1.0e-9_wp*(dt*speed + spacing*1.0e-6_wp), 'way of the first point')
      call expect_true(error, set_up%system%broken == 1, 'the bond did not break, or not once')
    end do
  end subroutine test_break_late

  !> Run a scene for `time` with `steps` steps; the largest imbalance kinetic + strain +
  !> dissipated - work - (the same at the start), over the largest energy that was in play.
  subroutine imbalance(scene, time, steps, worst, set_up, error, most)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: time
    integer, intent(in) :: steps
    real(wp), intent(out) :: worst
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    real(wp), intent(out), optional :: most   !! that energy [J]
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: total(:)
    real(wp) :: scale

    worst = 0.0_wp
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call run_explicit(set_up%system, 'forward_backward', time/steps, steps, diary, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    total = diary%kinetic + diary%strain + diary%dissipated - diary%work
    scale = maxval(diary%kinetic + diary%strain + diary%dissipated)
    worst = max_abs(total - total(1))/scale
    if (present(most)) most = scale
  end subroutine imbalance

  !> Lambda = 1, undamped: leapfrog's energy is off by the square of the step, so halving the step
  !> divides the imbalance by four.
  subroutine test_free(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp) :: coarse, fine

    call box_scene([9, 8], spacing, 0.2_wp, scene)
    scene%horizon%dilatation = 'unprojected'
    scene%horizon%surface_correction = 'energy'
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%displacement_gradient(:2, :2) = 2.0e-3_wp*reshape([1.0_wp, 0.4_wp, 0.3_wp, &
      & -0.8_wp], [2, 2])
    scene%initial(1)%velocity_gradient(:2, :2) = 2.0e3_wp*reshape([0.5_wp, -0.4_wp, 0.3_wp, &
      & 0.7_wp], [2, 2])
    call ready(scene, set_up, error)
    if (allocated(error)) return
    associate (limit => set_up%plan%limit)
      call imbalance(scene, 50*limit, 100, coarse, set_up, error)
      call imbalance(scene, 50*limit, 200, fine, set_up, error)
      if (allocated(error)) return
    end associate
    ! the velocities shown at t_n are off by (omega dt/2)^2 at most; here the body moves slowly
    call expect(error, coarse, 0.0_wp, 0.01_wp, 'imbalance at half the stable step')
    call expect(error, log(coarse/fine)/log(2.0_wp), 2.0_wp, 0.1_wp, 'order of the imbalance')
  end subroutine test_free

  !> Speeds and loads without kinks in time, so that the trapezoidal rule keeps its second order.
  subroutine test_work(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp) :: coarse, fine, time

    call box_scene([9, 8], spacing, 0.2_wp, scene)
    scene%horizon%dilatation = 'unprojected'
    scene%horizon%surface_correction = 'energy'
    deallocate (scene%boundaries, scene%loads)
    allocate (scene%boundaries(2), scene%loads(2))
    call ready_bare(scene, time, error)
    if (allocated(error)) return
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%velocity(1) = -30.0_wp
    scene%boundaries(1)%ramp_time = 1.01_wp*time
    scene%boundaries(2)%side = 'y_min'
    scene%boundaries(2)%displacement(2) = 2.0e-6_wp
    scene%boundaries(2)%ramp_time = 1.01_wp*time
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%pressure = -5.0e8_wp
    scene%loads(1)%ramp_time = time/2
    scene%loads(2)%body_force(2) = 2.0e10_wp
    scene%loads(2)%ramp_time = time
    call imbalance(scene, time, 100, coarse, set_up, error)
    call imbalance(scene, time, 200, fine, set_up, error)
    if (allocated(error)) return
    call expect(error, coarse, 0.0_wp, 0.02_wp, 'imbalance at half the stable step')
    call expect(error, log(coarse/fine)/log(2.0_wp), 2.0_wp, 0.15_wp, 'order of the imbalance')
    call expect_true(error, abs(set_up%system%external_work) > 0.01_wp, 'no work was done')
  end subroutine test_work

  !> Half a hundred stable steps of a scene without conditions [s].
  subroutine ready_bare(scene, time, error)
    type(scene_type), intent(in) :: scene
    real(wp), intent(out) :: time
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: bare
    type(set_up_type) :: set_up

    bare = scene
    deallocate (bare%boundaries, bare%loads)
    allocate (bare%boundaries(0), bare%loads(0))
    call ready(bare, set_up, error)
    if (allocated(error)) return
    time = 50*set_up%plan%limit
  end subroutine ready_bare

  !> At a kink of the imposed speed the layer's inertia jumps, and at the end of a ramped
  !> displacement its speed: both leave the balance of second order.
  subroutine test_kink(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp) :: coarse, fine, time

    call box_scene([9, 8], spacing, 0.2_wp, scene)
    call ready_bare(scene, time, error)
    if (allocated(error)) return
    scene%horizon%dilatation = 'unprojected'
    deallocate (scene%boundaries, scene%loads)
    allocate (scene%boundaries(2), scene%loads(0))
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%velocity(1) = -30.0_wp
    scene%boundaries(1)%times = [0.0_wp, 0.3_wp, 0.7_wp, 1.0_wp]*time
    scene%boundaries(1)%values = [0.0_wp, 1.0_wp, -0.5_wp, 0.2_wp]
    scene%boundaries(2)%side = 'y_max'
    scene%boundaries(2)%displacement(2) = 1.0e-5_wp
    scene%boundaries(2)%ramp_time = time/2
    call imbalance(scene, time, 100, coarse, set_up, error)
    call imbalance(scene, time, 400, fine, set_up, error)
    if (allocated(error)) return
    call expect(error, coarse, 0.0_wp, 0.01_wp, 'imbalance at half the stable step')
    call expect_true(error, coarse > 10*fine, 'imbalance '//text_of(fine)// &
      & ' at a quarter of the step, '//text_of(coarse)//' before')
  end subroutine test_kink

  !> A notched plate torn apart by layers that start suddenly. A bond's end falls between two
  !> instants, so the imbalance is of first order in the step: measured 5 % at 0.8 of the stable
  !> step and half as much with every halving. It must be no more than the step's error: a quarter
  !> of the step, less than 0.4 of it; and far less than what was dissipated, which is a good part
  !> of all energy.
  subroutine test_fracture(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp) :: coarse, fine, most, time

    call box_scene([14, 14], spacing, 0.3_wp, scene)
    scene%horizon%surface_correction = 'energy'
    scene%materials(1)%critical_stretch = 0.02_wp
    deallocate (scene%cracks, scene%boundaries)
    allocate (scene%cracks(1), scene%boundaries(2))
    scene%cracks(1)%from(:2) = [4.0_wp, 7.0_wp]*spacing
    scene%cracks(1)%to(:2) = [10.0_wp, 7.0_wp]*spacing
    scene%boundaries(1)%side = 'y_min'
    scene%boundaries(1)%velocity(2) = -20.0_wp
    scene%boundaries(2)%side = 'y_max'
    scene%boundaries(2)%velocity(2) = 20.0_wp
    call ready(scene, set_up, error)
    if (allocated(error)) return
    time = 48*set_up%plan%limit
    call imbalance(scene, time, 60, coarse, set_up, error)
    call imbalance(scene, time, 240, fine, set_up, error, most)
    if (allocated(error)) return
    call expect_true(error, set_up%system%broken > 50, 'hardly a bond broke')
    call expect(error, coarse, 0.0_wp, 0.08_wp, 'imbalance at 0.8 of the stable step')
    call expect_true(error, fine < 0.4_wp*coarse, 'imbalance '//text_of(fine) &
      & //' at a quarter of the step, ' &
      & //text_of(coarse)//' before')
    call expect_true(error, set_up%system%dissipated > 10*fine*most, &
      & 'dissipation is lost in the imbalance')
  end subroutine test_fracture

  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: threads(*) = [1, 2, 4]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: u(:, :), v(:, :), damage(:), strain(:)
    integer(i8) :: broken
    integer :: t, before

    call box_scene([10, 9, 8], spacing, 0.3_wp, scene)
    scene%horizon%surface_correction = 'energy'
    scene%materials(1)%critical_stretch = 0.003_wp
    deallocate (scene%boundaries)
    allocate (scene%boundaries(1))
    scene%boundaries(1)%side = 'z_max'
    scene%boundaries(1)%velocity(3) = 40.0_wp
    before = omp_get_max_threads()
    broken = 0
    do t = 1, size(threads)
      call omp_set_num_threads(threads(t))
      call ready(scene, set_up, error)
      if (allocated(error)) exit
      call clear(diary)
      call run_explicit(set_up%system, 'forward_backward', set_up%plan%step, 40, diary, fault)
      if (t == 1) then
        u = set_up%system%state%u
        v = set_up%system%state%v
        damage = set_up%system%state%damage
        strain = diary%strain
        broken = set_up%system%broken
        call expect_true(error, broken > 0, 'nothing broke')
      end if
      ! differences of equal bits are exactly zero
      call expect_close(error, set_up%system%state%u, u, 0.0_wp, 'displacement')
      call expect_close(error, set_up%system%state%v, v, 0.0_wp, 'velocity')
      call expect_close(error, set_up%system%state%damage, damage, 0.0_wp, 'damage')
      call expect_close(error, diary%strain, strain, 0.0_wp, 'strain energy')
      call expect_true(error, set_up%system%broken == broken, 'broken bonds')
    end do
    call omp_set_num_threads(before)
  end subroutine test_threads

  subroutine clear(diary)
    type(diary_type), intent(out) :: diary
    diary%every = 1
  end subroutine clear

end module test_motion_system
