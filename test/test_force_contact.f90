!> Contact of points: against impacts of bars, closed forms of rigid blocks, and a sum over all
!> pairs.
module test_force_contact
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_force_contact, only: contact_type, new_contact
  use pd_force_contact_law, only: contact_rule_type, of_normal_force
  use pd_force_term, only: term_view_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_observer, only: instant_type, observer_type
  use pd_motion_system, only: system_type, view_of
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: set_up_type
  use comparisons, only: expect_close, max_abs
  use runs, only: run
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: diary_type, expect, expect_true, noise, ready_alone
  use test_scene_expect, only: expect_fault, expect_scene, good_head, line
  implicit none (type, external)
  private
  public :: collect_force_contact

  character(*), parameter :: soft = '&material youngs_modulus = 1e9 density = 1e3 '// &
    & 'poissons_ratio = 0.25 /'//line

  !> Looks for the nearest points of two bodies.
  type, extends(observer_type) :: nearest_type
    real(wp) :: distance = huge(1.0_wp)   !! so far [m]
  contains
    procedure :: observe => look_at_nearest
  end type nearest_type

contains

  subroutine collect_force_contact(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('two bars that meet', test_bars), &
      & new_unittest('every pair and no other', test_pairs), &
      & new_unittest('a rigid block bounces', test_bounce), &
      & new_unittest('a block on an incline', test_incline), &
      & new_unittest('broken halves carry load', test_halves), &
      & new_unittest('no pair comes too near at 500 m/s', test_fast), &
      & new_unittest('the same in moving and turned frames', test_objective), &
      & new_unittest('the same bits on any number of threads', test_threads), &
      & new_unittest('what is refused', test_refused)]
  end subroutine collect_force_contact

  !> Momentum of a body along a component [kg m/s].
  real(wp) function momentum(set_up, body, c) result(p)
    type(set_up_type), intent(in) :: set_up
    integer, intent(in) :: body, c
    integer :: k

    p = 0.0_wp
    associate (system => set_up%system)
      do k = 1, system%body%n_slots
        if (system%body%point(k) == 0 .or. system%body%body(k) /= body) cycle
        p = p + system%body%volume(k)*system%state%v(k, c) &
          & *system%model%materials(system%body%material(k))%density
      end do
    end associate
  end function momentum

  !> Two equal bars meet at +- 1 m/s. They press for 2 L/c: their strain energy grows to all that
  !> there is, until the waves are at the free ends, and falls to nothing, both linearly in time, so
  !> that it is above half of that for L/c. Then they part with their velocities exchanged. A
  !> contact 60 times as stiff as a bond gives way by a row of points in a hundred.
  subroutine test_bars(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: length = 1.0_wp, speed = 1.0e3_wp
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: duration, whole
    logical, allocatable :: pressing(:)

    call run('&scene dimension = 1 area = 1e-4 /'//line//soft// &
      & "&body name = 'a' lower = 0 upper = 1 points = 200 /"//line// &
      & "&body name = 'b' lower = 1 upper = 2 points = 200 /"//line// &
      & "&initial velocity_x = '1 - 2*(x > 1)' /"//line// &
      & "&contact between = 'a', 'b' stiffness = 30 /"//line// &
      & '&time duration = 3.2e-3 /', set_up, error, diary)
    if (allocated(error)) return
    whole = diary%kinetic(1)
    call expect(error, whole, 0.1_wp, 1.0e-12_wp, 'kinetic energy at the start')
    pressing = diary%strain > 0.5_wp*whole
    duration = 0.0_wp
    associate (n => size(diary%time))
      duration = diary%time(findloc(pressing, .true., dim=1, back=.true.)) &
        & - diary%time(findloc(pressing, .true., dim=1))
      ! contact begins and ends within steps, in which a stiffness of 30 bonds jumps
      call expect(error, diary%kinetic(n) + diary%strain(n) + diary%dissipated(n), whole, &
        & 5.0e-3_wp*whole, 'energy')
    end associate
    call expect(error, duration, length/speed, 0.03_wp*length/speed, 'duration')
    call expect(error, momentum(set_up, 1, 1), -0.1_wp, 1.0e-3_wp, 'momentum of the first')
    call expect(error, momentum(set_up, 1, 1) + momentum(set_up, 2, 1), 0.0_wp, 1.0e-13_wp, &
      & 'momentum of both')
  end subroutine test_bars

  !> Forces and energy at displacements at random, far from those of the search and near them,
  !> against a sum over all pairs.
  subroutine test_pairs(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type), target :: set_up
    type(contact_rule_type) :: rule
    type(contact_type) :: contact
    type(term_view_type) :: view
    real(wp), allocatable :: force(:, :), density(:), expected(:, :), r(:), r0(:)
    real(wp) :: stored, d, begins, stiffness
    integer :: way, k, j, c, state, touching

    call expect_scene(error, '&scene dimension = 3 /'//line//soft// &
      & "&body name = 'a' lower = 0, 0, 0 upper = 0.08, 0.08, 0.04 points = 8, 8, 4 /"//line// &
      & "&body name = 'b' lower = 0, 0, 0.04 upper = 0.08, 0.08, 0.08 points = 8, 8, 4 /"//line// &
      & '&time steps = 1 /', scene)
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    rule%side = [1, 2]
    rule%stiffness = 2.0_wp
    rule%smoothed = .false.
    associate (system => set_up%system, body => set_up%system%body)
      call new_contact(body, system%family%rule%delta, 0.0_wp, rule, of_normal_force, contact)
      call view_of(system, 0.0_wp, view)
      call contact%begin(view)
      allocate (expected(body%n_slots, 3), force(body%n_slots, 3), density(body%n_slots))
      state = 17
      do way = 1, 2
        ! farther than half a skin the search is made for the call alone
        do k = 1, body%n_slots
          if (body%point(k) == 0) cycle
          do c = 1, 3
            system%state%u(k, c) = merge(6.0e-3_wp, 8.0e-4_wp, way == 1)*noise(state)
          end do
        end do
        if (way == 2) system%state%u(:, 3) = system%state%u(:, 3) &
          & - merge(0.0_wp, 1.2e-3_wp, body%body == 1)
        if (way == 2) call contact%search(view)
        expected = 0.0_wp
        stored = 0.0_wp
        touching = 0
        do k = 1, body%n_slots
          if (body%point(k) == 0) cycle
          do j = 1, body%n_slots
            if (body%point(j) == 0 .or. body%body(j) == body%body(k)) cycle
            r0 = body%x(j, :) - body%x(k, :)
            r = r0 + system%state%u(j, :) - system%state%u(k, :)
            d = norm2(r)
            begins = min(0.9_wp*0.01_wp, norm2(r0))
            if (d >= begins) cycle
            touching = touching + 1
            ! 18 K/(pi delta^4), K = E/1.5
            stiffness = 2*18*1.0e9_wp/1.5_wp/(acos(-1.0_wp)*system%family%rule%delta**5) &
              & *body%volume(j)
            expected(k, :) = expected(k, :) - stiffness*(begins - d)*r/d
            stored = stored + stiffness*(begins - d)**2/4*body%volume(k)
          end do
        end do
        call expect_true(error, touching > 20, 'few pairs touch')
        force = 0.0_wp
        call contact%add_force(view, force)
        call expect_close(error, force, expected, 1.0e-11_wp*max_abs(expected), 'force')
        density = 0.0_wp
        call contact%add_energy(view, density)
        call expect(error, sum(density*body%volume), stored, 1.0e-11_wp*stored, 'energy')
        do c = 1, 3
          call expect(error, sum(force(:, c)*body%volume), 0.0_wp, &
            & 1.0e-12_wp*max_abs(expected)*sum(body%volume), 'momentum')
        end do
      end do
    end associate
  end subroutine test_pairs

  !> A block that is all pin, so rigid, meets a block that is held: it comes back with its speed
  !> times the restitution.
  subroutine test_bounce(error)
    type(error_type), allocatable, intent(out) :: error
    character(3), parameter :: restitutions(3) = [character(3) :: '1.0', '0.6', '0.2']
    real(wp), parameter :: known(3) = [1.0_wp, 0.6_wp, 0.2_wp]
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    integer :: i

    do i = 1, 3
      call run('&scene dimension = 2 /'//line//soft// &
        & "&body name = 'base' lower = 0, 0 upper = 0.1, 0.03 points = 10, 3 /"//line// &
        & "&body name = 'block' lower = 0.02, 0.03 upper = 0.08, 0.06 points = 6, 3 /"//line// &
        & "&region name = 'low' where = 'y < 0.03' /"//line// &
        & "&region name = 'high' where = 'y > 0.03' /"//line// &
        & "&boundary region = 'low' displacement_x = 0 displacement_y = 0 /"//line// &
        & "&boundary region = 'high' motion = 'pin' /"//line// &
        & "&initial region = 'high' velocity_y = -2 /"//line// &
        & "&contact between = 'base', 'block' restitution = "//restitutions(i)//' /'//line// &
        & '&time duration = 4e-3 /', set_up, error, diary)
      if (allocated(error)) return
      associate (pose => set_up%system%motions(2)%pose)
        call expect(error, pose%velocity(2), 2*known(i), 0.01_wp*2, 'rebound')
        call expect_close(error, pose%velocity(1), 0.0_wp, 1.0e-9_wp, 'sideways')
      end associate
      ! in the account the energies balance
      associate (n => size(diary%time))
        call expect(error, diary%kinetic(n) + diary%strain(n) + diary%dissipated(n) &
          & - diary%work(n), diary%kinetic(1), 5.0e-3_wp*diary%kinetic(1), 'energy')
      end associate
    end do
  end subroutine test_bounce

  !> A rigid block on a rigid base under a force density as on an incline of 30 degrees: with a
  !> coefficient of 0.3 it slides by g (sin a - mu cos a), with 0.7 it creeps by far less. It slides
  !> by 0.1 mm: the points push along the line between them, whose slope of 0.1 mm in 30 mm adds
  !> 0.6 % in the mean.
  subroutine test_incline(error)
    type(error_type), allocatable, intent(out) :: error
    character(3), parameter :: coefficients(2) = [character(3) :: '0.3', '0.7']
    real(wp), parameter :: gravity = 9.81_wp, time = 9.0e-3_wp
    real(wp) :: slides
    type(set_up_type) :: set_up
    integer :: i

    slides = gravity*(0.5_wp - 0.3_wp*sqrt(0.75_wp))
    do i = 1, 2
      ! it begins in balance, so near that it presses as it weighs
      call run("&scene dimension = 2 gravity = 4.905, -8.4957090 /"//line// &
        & '&material youngs_modulus = 1e8 density = 1e3 poissons_ratio = 0.25 /'//line// &
        & "&body name = 'base' lower = 0, 0 upper = 0.2, 0.03 points = 20, 3 /"//line// &
        & "&body name = 'block' lower = 0.02, 0.05 upper = 0.1, 0.07 points = 8, 2 /"//line// &
        & "&region name = 'low' where = 'y < 0.03' /"//line// &
        & "&region name = 'high' where = 'y > 0.03' /"//line// &
        & "&boundary region = 'low' displacement_x = 0 displacement_y = 0 /"//line// &
        & "&boundary region = 'high' motion = 'pin' /"//line// &
        & "&contact between = 'base', 'block' stiffness = 10 distance = 0.03 damping = 0.5 "// &
        & 'friction = '//coefficients(i)//' /'//line//'&time duration = 9e-3 /', set_up, error)
      if (allocated(error)) return
      associate (pose => set_up%system%motions(2)%pose)
        if (i == 1) then
          call expect(error, pose%place(1), slides*time**2/2, 0.02_wp*slides*time**2/2, 'slides')
        else
          ! m g sin a over the dashpots of eight pairs is 0.8 mm/s
          call expect_true(error, pose%place(1) < 1.0e-3_wp*time, 'it creeps far')
          call expect_true(error, pose%place(1) >= 0.0_wp, 'it creeps up')
        end if
      end associate
    end do
  end subroutine test_incline

  !> A plate whose halves a crack parts, pressed together: without contact each half moves freely,
  !> with `within` the lower one bears what presses the upper one.
  subroutine test_halves(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: plate = '&scene dimension = 2 /'//line//soft// &
      & "&body name = 'plate' lower = 0, 0 upper = 0.1, 0.1 points = 10, 10 /"//line// &
      & '&crack from = -1, 0.05 to = 1, 0.05 /'//line// &
      & "&region name = 'high' where = 'y > 0.05' /"//line// &
      & "&region name = 'foot' where = 'y < 0.01' /"//line// &
      & "&boundary region = 'foot' displacement_y = 0 /"//line// &
      & "&initial region = 'high' velocity_y = -1 /"//line
    character(*), parameter :: time = '&time duration = 2.2e-3 /'
    type(set_up_type) :: set_up

    call run(plate//time, set_up, error)
    if (allocated(error)) return
    call expect(error, upper_mean(set_up), -2.2e-3_wp, 1.0e-12_wp, 'free halves')
    call run(plate//"&contact within = 'plate' stiffness = 20 /"//line//time, set_up, error)
    if (allocated(error)) return
    call expect_true(error, upper_mean(set_up) > -1.8e-3_wp, 'the lower half does not bear it')
    call expect_true(error, upper_mean(set_up) < 0.0_wp, 'it is thrown up')

  contains

    real(wp) function upper_mean(set_up) result(mean)
      type(set_up_type), intent(in) :: set_up

      associate (system => set_up%system)
        mean = sum(system%state%u(:, 2), mask=system%body%x(:, 2) > 0.05_wp)/50
      end associate
    end function upper_mean
  end subroutine test_halves

  !> Impact with friction on one and two threads.
  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: text = '&scene dimension = 3 /'//line//soft// &
      & "&body name = 'a' lower = 0, 0, 0 upper = 0.12, 0.12, 0.03 points = 12, 12, 3 /"//line// &
      & "&body name = 'b' lower = 0.03, 0.03, 0.03 upper = 0.09, 0.09, 0.09 points = 6, 6, 6 /"// &
      & line//"&region name = 'b' where = 'z > 0.03' /"//line// &
      & "&initial region = 'b' velocity_x = 5 velocity_z = -8 /"//line// &
      & "&contact between = 'a', 'b' friction = 0.4 restitution = 0.9 stiffness = 5 /"//line// &
      & '&time steps = 150 /'
    type(set_up_type) :: one, two

    call run(text, one, error, threads=1)
    call run(text, two, error, threads=2)
    if (allocated(error)) return
    call expect_close(error, one%system%state%v, two%system%state%v, 0.0_wp, 'velocities')
    call expect(error, momentum(one, 1, 1) + momentum(one, 2, 1), 5*1.0e3_wp*0.06_wp**3, &
      & 1.0e-12_wp, 'momentum')
    call expect_true(error, momentum(one, 1, 1) > 0.0_wp .and. momentum(one, 1, 3) < 0.0_wp, &
      & 'they have not touched')
  end subroutine test_threads

  !> Two blocks of glass that meet at 500 m/s, row on row: with a stiffness of 10 no pair comes
  !> nearer than 0.3 spacings.
  subroutine test_fast(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(scene_type) :: scene
    type(nearest_type) :: nearest
    type(fault_type), allocatable :: fault

    call expect_scene(error, '&scene dimension = 3 /'//line//'&material youngs_modulus = 70e9 '// &
      & 'density = 2500 poissons_ratio = 0.25 /'//line// &
      & "&body name = 'a' lower = 0, 0, 0 upper = 6e-3, 6e-3, 6e-3 points = 6, 6, 6 /"//line// &
      & "&body name = 'b' lower = 0, 0, 6e-3 upper = 6e-3, 6e-3, 12e-3 points = 6, 6, 6 /"//line// &
      & "&region name = 'b' where = 'z > 6e-3' /"//line//"&initial region = 'b' "// &
      & 'velocity_z = -500 /'//line//"&contact between = 'a', 'b' stiffness = 10 /"//line// &
      & '&time duration = 6e-6 /', scene)
    if (allocated(error)) return
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    call run_explicit(set_up%system, 'forward_backward', set_up%plan%step, set_up%plan%steps, &
      & nearest, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    call expect_true(error, nearest%distance > 0.3e-3_wp, 'they come too near')
    call expect_true(error, nearest%distance < 0.85e-3_wp, 'they hardly touch')
    call expect_true(error, momentum(set_up, 1, 3) < 0.0_wp, 'nothing is passed on')
  end subroutine test_fast

  !> The least distance of points of two bodies.
  subroutine look_at_nearest(observer, system, instant, error)
    class(nearest_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error
    real(wp) :: r(3)
    integer :: k, j

    if (instant%step < 0) allocate (error)
    associate (body => system%body, u => system%state%u)
      do k = 1, body%n_slots
        if (body%point(k) == 0 .or. body%body(k) /= 1) cycle
        do j = 1, body%n_slots
          if (body%point(j) == 0 .or. body%body(j) /= 2) cycle
          r = body%x(j, :) - body%x(k, :) + u(j, :) - u(k, :)
          observer%distance = min(observer%distance, norm2(r))
        end do
      end do
    end associate
  end subroutine look_at_nearest

  !> An impact with friction and damping, the same moving with 300 m/s, and with its axes exchanged.
  subroutine test_objective(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: rest = line//"&contact between = 'a', 'b' friction = 0.4 "// &
      & 'damping = 0.1 stiffness = 5 /'//line//'&time steps = 300 /'
    character(*), parameter :: blocks = '&scene dimension = 3 /'//line//soft// &
      & "&body name = 'a' lower = 0, 0, 0 upper = 0.08, 0.08, 0.03 points = 8, 8, 3 /"//line// &
      & "&body name = 'b' lower = 0.023, 0.03, 0.03 upper = 0.063, 0.07, 0.07 points = 4, 4, 4 /" &
      & //line//"&region name = 'a' where = 'z < 0.03' /"//line// &
      & "&region name = 'b' where = 'z > 0.03' /"//line
    type(set_up_type) :: still, moving, turned
    real(wp), allocatable :: v(:, :), other(:, :)
    integer :: i

    call run(blocks//"&initial region = 'b' velocity_x = 5 velocity_z = -8 /"//rest, still, error)
    call run(blocks//"&initial region = 'a' velocity_y = 300 /"//line//"&initial region = 'b' "// &
      & 'velocity_x = 5 velocity_y = 300 velocity_z = -8 /'//rest, moving, error)
    ! x, y, z become y, z, x
    call run('&scene dimension = 3 /'//line//soft// &
      & "&body name = 'a' lower = 0, 0, 0 upper = 0.03, 0.08, 0.08 points = 3, 8, 8 /"//line// &
      & "&body name = 'b' lower = 0.03, 0.023, 0.03 upper = 0.07, 0.063, 0.07 points = 4, 4, 4 /" &
      & //line//"&region name = 'b' where = 'x > 0.03' /"//line// &
      & "&initial region = 'b' velocity_y = 5 velocity_x = -8 /"//rest, turned, error)
    if (allocated(error)) return
    v = of_points(still)
    other = of_points(moving)
    other(:, 2) = other(:, 2) - 300
    call expect_true(error, momentum(still, 1, 1) > 0.0_wp, 'they do not touch')
    call expect_close(error, other, v, 1.0e-8_wp, 'moving')
    do i = 1, 3
      call expect(error, momentum(turned, 1, 1 + mod(i, 3)), momentum(still, 1, i), 1.0e-10_wp, &
        & 'turned')
      call expect(error, momentum(turned, 2, 1 + mod(i, 3)), momentum(still, 2, i), 1.0e-10_wp, &
        & 'turned')
    end do

  contains

    !> Velocities in the order of points.
    function of_points(set_up) result(v)
      type(set_up_type), intent(in) :: set_up
      real(wp), allocatable :: v(:, :)

      v = set_up%system%state%v(set_up%system%body%slot, :)
    end function of_points
  end subroutine test_objective

  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: steps = '&time steps = 3 /'

    call expect_fault(error, good_head//"&contact stiffness = 2 /"//line//steps, 'between|within')
    call expect_fault(error, good_head//"&contact between = 'plate' /"//line//steps, &
      & "one name|'all'")
    call expect_fault(error, good_head//"&contact between = 'plate', 'ball' /"//line//steps, &
      & 'ball|plate')
    call expect_fault(error, good_head//"&contact within = 'plat' /"//line//steps, 'plat|plate')
    call expect_fault(error, good_head//"&contact within = 'plate' between = 'all' /"//line// &
      & steps, 'both given')
    call expect_fault(error, good_head//"&contact within = 'plate' restitution = 0.5 damping = "// &
      & '0.1 /'//line//steps, 'restitution|damping')
    call expect_fault(error, good_head//"&contact within = 'plate' restitution = 1.5 /"//line// &
      & steps, 'restitution')
    call expect_fault(error, good_head//"&contact within = 'plate' /"//line// &
      & "&time method = 'relaxation' /", 'relaxation')
  end subroutine test_refused

end module test_force_contact
