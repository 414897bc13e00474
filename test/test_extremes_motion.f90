!> Motion at its ends: torn, crushed, turned, strained by 1e-150 and by 1.
module test_extremes_motion
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: pi
  use pd_base_error, only: fault_type => error_type
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_motion_system, only: evaluate, system_type
  use pd_scene_content_types, only: scene_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: box_scene, density_of_steel, diary_type, expect, expect_true, noise, &
    & ready_alone, rotation_matrix, text_of, youngs_modulus
  implicit none (type, external)
  private
  public :: collect_extremes_motion

  real(wp), parameter :: dx = 1.0e-2_wp     !! spacing of all bodies here [m]
  character(9), parameter :: families(*) = [character(9) :: 'lattice', 'list']

contains

  subroutine collect_extremes_motion(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a point that lost all its bonds keeps its velocity', test_lone_point), &
      & new_unittest('long: halves of a broken plate separate for a million steps', test_torn), &
      & new_unittest('a bond compressed through zero length returns its energy', test_crushed), &
      & new_unittest('a body rotated 10,000 times has no force', test_turned), &
      & new_unittest('long: a dumbbell returns to its place after 10,000 turns', test_dumbbell), &
      & new_unittest('vibrations of 1e-150 and 0.5 are one, scaled', test_strains), &
      & new_unittest('static equilibrium at strains from 1e-14 to 1', test_rest)]
  end subroutine collect_extremes_motion

  !> Run and fail the test where the run does.
  subroutine go(set_up, dt, steps, diary, error)
    type(set_up_type), intent(inout) :: set_up
    real(wp), intent(in) :: dt
    integer, intent(in) :: steps
    type(diary_type), intent(inout) :: diary
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    call run_explicit(set_up%system, 'forward_backward', dt, steps, diary, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine go

  !> The middle point of a plate is put ten spacings aside and thrown: all its bonds break at once,
  !> its force is 0 and its flight straight, exactly; the others lost bonds that did not pull.
  subroutine test_lone_point(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: nus(*) = [0.2_wp, 1.0_wp/3], dt = 2.0_wp**(-22), v(2) = [4.0_wp, -2.0_wp]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    integer :: f, m, k

    do f = 1, size(families)
      do m = 1, size(nus)
        call box_scene([7, 7], dx, nus(m), scene)
        scene%horizon%family = families(f)
        scene%horizon%surface_correction = 'energy'
        scene%materials(1)%critical_stretch = 0.01_wp
        call ready_alone(scene, set_up, error)
        if (allocated(error)) return
        associate (system => set_up%system)
          k = system%body%slot(25)
          system%state%u(k, :) = [10*dx, 0.0_wp]
          system%state%v(k, :) = v
          diary = diary_type()
          call go(set_up, dt, 100, diary, error)
          if (allocated(error)) return
          ! 28 members within 3.015 spacings
          call expect(error, real(system%broken, wp), 28.0_wp, 0.0_wp, 'broken bonds')
          call expect(error, system%state%damage(k), 1.0_wp, 1.0e-15_wp, 'damage')
          call expect(error, norm2(system%state%force(k, :)), 0.0_wp, 0.0_wp, 'force')
          ! u rounds at every step: 100 times half of 1e-16 of 0.1
          call expect(error, norm2(system%state%u(k, :) - [10*dx, 0.0_wp] - 100*dt*v), 0.0_wp, &
            & 1.0e-15_wp, 'place')
          system%state%u(k, :) = 0.0_wp
          call expect_close(error, system%state%u, 0.0_wp, 0.0_wp, 'the others move')
        end associate
      end do
    end do
  end subroutine test_lone_point

  !> A plate of 6 x 2 points whose halves are thrown apart at 10 m/s, and each point at up to 2 m/s
  !> on top, tears between them (18 bonds join them), and the halves swing and fly for a million
  !> steps, some 30 m. The momentum of each half stays to rounding. So does the energy: leapfrog has
  !> no drift, only a ripple, of which means over 100 rows are compared, as a share of the energy of
  !> swinging. The places, 3000 spacings away, round strains to 1e-12, at random.
  subroutine test_torn(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: steps = 1000000
    real(wp), parameter :: apart = 10.0_wp
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: early, late, p(2, 2), mass, flight
    real(wp), allocatable :: total(:)
    integer :: f, i, side, n, seed

    do f = 1, size(families)
      call box_scene([6, 2], dx, 1.0_wp/3, scene)
      scene%horizon%family = families(f)
      scene%materials(1)%critical_stretch = 2.0e-3_wp
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      associate (body => set_up%system%body, v => set_up%system%state%v)
        seed = 12
        do i = 1, 12
          v(body%slot(i), :) = 2*[noise(seed), noise(seed)] &
            & + [sign(apart, body%x(body%slot(i), 1) - 3*dx), 0.0_wp]
        end do
        diary = diary_type()
        diary%every = 1000
        call go(set_up, 0.5_wp*set_up%plan%limit, 1000, diary, error)
        mass = density_of_steel*body%volume(body%slot(1))*6
        flight = 0.0_wp
        do side = 1, 2
          p(:, side) = half_momentum(set_up%system, side)
          flight = flight + sum(p(:, side)**2)/(2*mass)
        end do
        diary = diary_type()
        diary%every = steps/1000
        call go(set_up, 0.5_wp*set_up%plan%limit, steps, diary, error)
        if (allocated(error)) return
        do side = 1, 2
          call expect(error, norm2(half_momentum(set_up%system, side) - p(:, side)), 0.0_wp, &
            & 1.0e-10_wp*mass*apart, 'momentum of a half')
        end do
        call expect_true(error, set_up%system%broken == 18 .and. minval(body_gap(set_up%system)) &
          & > 20.0_wp, 'the plate is not torn in two')
      end associate
      total = diary%kinetic + diary%strain - flight
      n = size(total)
      early = sum(total(2:101))/100
      late = sum(total(n - 99:n))/100
      call expect_true(error, early > 0.01_wp*flight, 'the halves don''t swing')
      call expect(error, late/early, 1.0_wp, 0.01_wp, 'energy of swinging')
      call expect(error, maxval(diary%dissipated) - minval(diary%dissipated), 0.0_wp, 0.0_wp, &
        & 'breaking goes on')
    end do
  end subroutine test_torn

  !> Momentum of the left (1) or right (2) half of the torn plate.
  function half_momentum(system, side) result(p)
    type(system_type), intent(in) :: system
    integer, intent(in) :: side
    real(wp) :: p(2)
    integer :: i, k

    p = 0.0_wp
    do i = 1, 12
      k = system%body%slot(i)
      if ((system%body%x(k, 1) > 3*dx) .neqv. side == 2) cycle
      p = p + density_of_steel*system%body%volume(k)*system%state%v(k, :)
    end do
  end function half_momentum

  !> Distance of the halves along x.
  function body_gap(system) result(gap)
    type(system_type), intent(in) :: system
    real(wp) :: gap(2)
    integer :: row, k(2)

    do row = 1, 2
      k = system%body%slot(6*row - [5, 0])
      gap(row) = system%state%u(k(2), 1) - system%state%u(k(1), 1)
    end do
  end function body_gap

  !> Two points thrown at each other pass through each other (there is no contact) and part again;
  !> the bond, pulled the other way from |y| = 0 on, takes their energy and gives it back. At
  !> |y| = 0 the force jumps: the energy closes to first order in the step. At exactly 0 it has no
  !> direction and is 0.
  subroutine test_crushed(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: omega, total, wrong(2), dt
    integer :: f, k(2), trial

    do f = 1, size(families)
      do trial = 1, 2
        call pair(trim(families(f)), set_up, k, omega, error)
        if (allocated(error)) return
        ! the bond's energy at |y| = 0 is that of a speed omega dx/2 of each
        set_up%system%state%v(k, 1) = [1.0_wp, -1.0_wp]*omega*dx
        diary = diary_type()
        dt = 0.02_wp/omega/trial
        call go(set_up, dt, 150*trial, diary, error)
        if (allocated(error)) return
        total = diary%kinetic(1)
        wrong(trial) = max_abs(diary%kinetic + diary%strain - total)/total
        call expect(error, sum(set_up%system%state%v(k, 1)), 0.0_wp, 1.0e-12_wp*omega*dx, &
          & 'momentum')
        call expect_true(error, set_up%system%state%u(k(1), 1) - set_up%system%state%u(k(2), 1) &
          & > dx, 'they did not pass')
      end do
      call expect(error, wrong(1), 0.0_wp, 0.03_wp, 'energy')
      call expect_true(error, wrong(2) < 0.8_wp*wrong(1), 'the energy does not converge')
      ! exactly on each other: powers of 2
      call pair(trim(families(f)), set_up, k, omega, error)
      if (allocated(error)) return
      associate (u => set_up%system%state%u, x => set_up%system%body%x)
        u(k(1), 1) = x(k(2), 1) - x(k(1), 1)
        call evaluate(set_up%system, 0.0_wp, breaking=.false.)
        call expect(error, x(k(1), 1) + u(k(1), 1), x(k(2), 1), 0.0_wp, 'one place')
        call expect_close(error, set_up%system%state%force(k, 1), 0.0_wp, 0.0_wp, &
          & 'force at zero length')
      end associate
    end do
  end subroutine test_crushed

  !> Two free points of a bar: omega^2 = 2 (4 b delta) v_c V/(rho dx), delta = 1.3 dx, v_c = 0.8.
  subroutine pair(family, set_up, k, omega, error)
    character(*), intent(in) :: family
    type(set_up_type), intent(out) :: set_up
    integer, intent(out) :: k(2)
    real(wp), intent(out) :: omega
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene

    omega = 0.0_wp
    k = 0
    call box_scene([2], dx, 0.0_wp, scene)
    scene%horizon%ratio = 1.3_wp
    scene%horizon%family = family
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    k = set_up%system%body%slot(1:2)
    omega = sqrt(4*youngs_modulus*0.8_wp/density_of_steel)/(1.3_wp*dx)
  end subroutine pair

  !> Turned by 10,000 turns and some: each bond's stretch is 0 to 8 eps |eta|/|xi| and the rounding
  !> of u, some 50 spacings here (conventions of theory, 2), so that forces stay below 1e-12 of
  !> those of a strain of 1.
  subroutine test_turned(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp) :: R(3, 3), axis(3)
    integer :: f, k

    axis = [2.0_wp, -1.0_wp, 2.0_wp]/3
    R = rotation_matrix(axis, 1.0e4_wp*2*pi + 2.2_wp)
    do k = 1, 3
      R(k, k) = R(k, k) - 1
    end do
    do f = 1, size(families)
      call box_scene([6, 5, 5], dx, 0.3_wp, scene)
      scene%horizon%family = families(f)
      scene%horizon%surface_correction = 'energy'
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      associate (system => set_up%system)
        do k = 1, system%body%n_slots
          if (system%body%point(k) > 0) system%state%u(k, :) = matmul(R, system%body%x(k, :))
        end do
        call evaluate(system, 0.0_wp, breaking=.false.)
        call expect_close(error, system%state%force, 0.0_wp, 1.0e-12_wp*youngs_modulus/dx, &
          & 'force of a turned body')
      end associate
    end do
  end subroutine test_turned

  !> Two points that turn about each other on a circle of leapfrog: x_{n+1} = R(phi) x_n, if
  !> 2 (1 - cos phi) y/2 = dt^2 f(y)/rho, so y - dx = y (1 - cos phi)/beta with
  !> beta = dt^2 (force per elongation)/rho, and v_n = (sin phi/dt) times x_n turned by 90 degrees.
  !> With phi = 2 pi/100 a million steps are 10,000 turns. Rounding moves the phase by eps at random
  !> and the period by eps for good: 1e6 eps 2 pi/100 and some; the bound is 1e-7 of the length.
  subroutine test_dumbbell(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: steps = 1000000
    real(wp), parameter :: ratio = 1.3_wp, phi = 2*pi/100
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: beta, y, dt, b, r(2), q
    integer :: f, k(2), c

    do f = 1, size(families)
      call box_scene([2, 1], dx, 1.0_wp/3, scene)
      scene%horizon%ratio = ratio
      scene%horizon%family = families(f)
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      k = set_up%system%body%slot(1:2)
      ! plane stress: b = 6 mu/(pi h delta^4), f = 4 b delta s v_c V
      b = 6*youngs_modulus/(2*(1 + 1.0_wp/3))/(pi*2.0e-3_wp*(ratio*dx)**4)
      q = 4*b*ratio*dx*0.8_wp*dx**2*2.0e-3_wp/dx
      beta = 0.4_wp
      dt = sqrt(beta*density_of_steel/q)
      y = dx/(1 - (1 - cos(phi))/beta)
      r = [y/2, 0.0_wp]
      associate (u => set_up%system%state%u, v => set_up%system%state%v)
        do c = 1, 2
          u(k(1), c) = -(r(c) - merge(dx/2, 0.0_wp, c == 1))
          u(k(2), c) = r(c) - merge(dx/2, 0.0_wp, c == 1)
        end do
        v(k(1), :) = [0.0_wp, -sin(phi)/dt*r(1)]
        v(k(2), :) = [0.0_wp, sin(phi)/dt*r(1)]
        diary = diary_type()
        diary%every = steps/20
        diary%slot = k(2)
        call go(set_up, dt, steps, diary, error)
        if (allocated(error)) return
        do c = 1, size(diary%time)
          call expect(error, norm2(diary%u(:, c) - diary%u(:, 1)), 0.0_wp, 1.0e-7_wp*dx, &
            & 'place after '//text_of(diary%time(c)/dt/100)//' turns')
        end do
        call expect(error, norm2(u(k(1), :) + u(k(2), :)), 0.0_wp, 1.0e-9_wp*dx, 'centre')
      end associate
    end do
  end subroutine test_dumbbell

  !> In a bar stretches are linear in the displacements as long as no bond turns over: released from
  !> a uniform strain e it moves as u = e U(t), to the rounding of u/dx in each of 300 steps.
  subroutine test_strains(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: strains(*) = [1.0e-6_wp, 1.0e-150_wp, 1.0e-14_wp, 1.0e-3_wp, 0.3_wp, &
      & -0.3_wp]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: u(20, size(strains))
    integer :: f, i, k

    do f = 1, size(families)
      do i = 1, size(strains)
        call box_scene([20], dx, 0.0_wp, scene)
        scene%horizon%family = families(f)
        scene%horizon%surface_correction = 'energy'
        call ready_alone(scene, set_up, error)
        if (allocated(error)) return
        do k = 1, 20
          set_up%system%state%u(set_up%system%body%slot(k), 1) = strains(i)*(k - 10.5_wp)*dx
        end do
        diary = diary_type()
        diary%every = 1000
        call go(set_up, 0.5_wp*set_up%plan%limit, 300, diary, error)
        if (allocated(error)) return
        u(:, i) = set_up%system%state%u(set_up%system%body%slot, 1)/strains(i)
        call expect(error, max_abs(u(:, i) - u(:, 1))/max_abs(u(:, 1)), 0.0_wp, &
          & 1.0e-11_wp, 'motion from a strain of '//text_of(strains(i)))
      end do
    end do
  end subroutine test_strains

  !> A bar pulled by P = E e on both ends: its middle is strained by e, whatever e is; the load of
  !> a strain of 1 needs steps. (What the ends disturb has died out after 28 points.)
  subroutine test_rest(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: strains(*) = [1.0e-14_wp, -1.0e-14_wp, 1.0e-3_wp, 1.0_wp, -0.5_wp]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: strain
    integer :: f, i

    do f = 1, size(families)
      do i = 1, size(strains)
        call box_scene([60], dx, 0.0_wp, scene)
        scene%horizon%family = families(f)
        scene%horizon%surface_correction = 'energy'
        scene%time%method = 'relaxation'
        scene%relaxation%tolerance = 1.0e-12_wp
        scene%relaxation%load_steps = 4
        deallocate (scene%loads)
        allocate (scene%loads(2))
        scene%loads(1)%side = 'x_min'
        scene%loads(2)%side = 'x_max'
        scene%loads%pressure = -youngs_modulus*strains(i)
        call ready_alone(scene, set_up, error)
        if (allocated(error)) return
        diary = diary_type()
        diary%every = 0
        call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
        if (allocated(fault)) then
          call test_failed(error, fault%message)
          return
        end if
        associate (u => set_up%system%state%u(:, 1), slot => set_up%system%body%slot)
          strain = (u(slot(33)) - u(slot(28)))/(5*dx)
        end associate
        call expect(error, strain/strains(i), 1.0_wp, 1.0e-6_wp, 'strain '//text_of(strains(i)))
      end do
    end do
  end subroutine test_rest

end module test_extremes_motion
