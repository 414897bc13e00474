!> Rigid bodies of given shapes and their contact with points: against Hertz, rebounds, inclines,
!> Euler's equations and what is conserved.
module test_force_rigid
  use omp_lib, only: omp_set_num_threads
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_base_vectors, only: cross
  use pd_force_obstacle, only: a_box, a_cylinder, a_half_space, a_sphere, find_gap, obstacle_type
  use pd_motion_account, only: velocities_now
  use pd_motion_pose, only: rotation_of, spin_of
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: prepare, set_up_type
  use comparisons, only: expect_close, max_abs
  use runs, only: run
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: diary_type, expect, expect_true, noise, rotation_matrix
  use test_scene_expect, only: expect_fault, expect_parts, expect_scene, good_head, line
  implicit none (type, external)
  private
  public :: collect_force_rigid

  character(*), parameter :: soft = '&material youngs_modulus = 1e9 density = 1e3 '// &
    & 'poissons_ratio = 0.25 /'//line
  !> A block of 8 x 8 x 4 points of 1 mm below z = 0.
  character(*), parameter :: block = '&scene dimension = 3 /'//line//soft// &
    & "&body name = 'block' lower = -4e-3, -4e-3, -4e-3 upper = 4e-3, 4e-3, 0 "// &
    & 'points = 8, 8, 4 /'//line
  !> A ball that hits it beside its middle, spinning.
  character(*), parameter :: ball = "&rigid name = 'ball' shape = 'sphere' centre = 1e-3, "// &
    & '0.4e-3, 3.6e-3 radius = 3e-3 density = 2000 velocity_x = 4 velocity_z = -20 '// &
    & 'spin_y = 3000 /'//line//"&contact between = 'block', 'ball' friction = 0.3 /"//line
  !> A rectangle of 20 x 10 points of 1 cm above y = 0.
  character(*), parameter :: flat = '&scene dimension = 2 /'//line//soft// &
    & "&body name = 'block' lower = 0, 0 upper = 0.2, 0.1 points = 20, 10 /"//line

contains

  subroutine collect_force_rigid(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('distances and normals of every shape', test_shapes), &
      & new_unittest('long: a sphere pressed into a layer', test_hertz), &
      & new_unittest('a block bounces from a half-space', test_bounce), &
      & new_unittest('an elastic block keeps its energy', test_rebound), &
      & new_unittest('a block on an incline', test_incline), &
      & new_unittest('momentum and angular momentum', test_momentum), &
      & new_unittest('long: light bodies hit with an edge', test_light), &
      & new_unittest('a spinning box', test_spin), &
      & new_unittest('a body falls', test_fall), &
      & new_unittest('work of imposed motion', test_work), &
      & new_unittest('the same in moving and turned frames', test_objective), &
      & new_unittest('the same bits on any number of threads', test_threads), &
      & new_unittest('what is refused', test_refused)]
  end subroutine collect_force_rigid

  !> Energy at the end of a diary less what was supplied [J].
  real(wp) function balance(diary) result(energy)
    type(diary_type), intent(in) :: diary

    associate (n => diary%n)
      energy = diary%kinetic(n) + diary%strain(n) + diary%dissipated(n) - diary%work(n)
    end associate
  end function balance

  !> Momentum and angular momentum about the origin of points and rigid bodies.
  subroutine momenta(set_up, p, l)
    type(set_up_type), intent(in) :: set_up
    real(wp), intent(out) :: p(3), l(3)
    real(wp), allocatable :: v(:, :)
    real(wp) :: y(3), mv(3)
    integer :: k, r

    p = 0.0_wp
    l = 0.0_wp
    associate (system => set_up%system, body => set_up%system%body)
      call velocities_now(system, system%time, set_up%plan%step/2, v)
      do k = 1, body%n_slots
        if (body%point(k) == 0) cycle
        y = 0.0_wp
        mv = 0.0_wp
        y(:body%dim) = body%x(k, :) + system%state%u(k, :)
        mv(:body%dim) = v(k, :)*body%volume(k)*system%model%materials(body%material(k))%density
        p = p + mv
        l = l + cross(y, mv)
      end do
      do r = 1, size(system%rigid_bodies)
        associate (pose => system%rigid_bodies(r)%pose)
          p = p + pose%mass*pose%velocity
          l = l + pose%mass*cross(pose%centre + pose%place, pose%velocity) + pose%momentum
        end associate
      end do
    end associate
  end subroutine momenta

  !> The signed distance is the one function that is 0 on the surface, whose gradient has the length
  !> 1, and whose sign is that of the inside: each is tested, at places at random.
  subroutine test_shapes(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: h = 1.0e-5_wp
    type(obstacle_type) :: obstacle
    real(wp) :: y(3), normal(3), gradient(3), ignored(3), gap, ahead, behind, turned(3, 3)
    integer :: shape, state, i, c, near_edges

    turned = rotation_matrix([0.6_wp, 0.0_wp, 0.8_wp], 0.7_wp)
    state = 5
    near_edges = 0
    do shape = a_sphere, a_half_space
      obstacle%shape = shape
      obstacle%half = merge([1.0_wp, 0.7_wp, 1.6_wp], [1.1_wp, 1.1_wp, 0.8_wp], shape == a_box)
      obstacle%centre = [0.3_wp, -0.2_wp, 0.5_wp]
      obstacle%frame = turned
      do i = 1, 400
        y = obstacle%centre + 2.5_wp*[(noise(state), c=1, 3)]
        call find_gap(obstacle, y, gap, normal)
        call expect(error, norm2(normal), 1.0_wp, 1.0e-14_wp, 'length of the normal')
        call expect_true(error, is_within(y) .eqv. gap < 0.0_wp, 'sign')
        ! the foot lies between inside and outside
        call expect_true(error, is_within(y - (gap + 1.0e-9_wp)*normal), 'foot, within')
        call expect_true(error, .not. is_within(y - (gap - 1.0e-9_wp)*normal), 'foot, outside')
        do c = 1, 3
          ignored = y
          ignored(c) = y(c) + h
          call find_gap(obstacle, ignored, ahead, gradient)
          ignored(c) = y(c) - h
          call find_gap(obstacle, ignored, behind, gradient)
          ignored(c) = (ahead - behind)/(2*h)
          gradient(c) = ignored(c)
          ! where inside the nearest face changes, there is no gradient
          if (gap < 0.0_wp) cycle
          call expect(error, gradient(c), normal(c), 1.0e-8_wp, 'gradient')
        end do
        if (gap > 0.0_wp .and. count(abs(matmul(normal, turned)) > 0.1_wp) > 1) &
          & near_edges = near_edges + 1
        if (allocated(error)) return
      end do
    end do
    call expect_true(error, near_edges > 100, 'few places are beside edges')

  contains

    !> Whether a place is inside, from the definition of the shapes.
    logical function is_within(place)
      real(wp), intent(in) :: place(3)
      real(wp) :: own(3)

      own = matmul(transpose(turned), place - obstacle%centre)
      select case (shape)
      case (a_sphere); is_within = sum(own**2) < 1.1_wp**2
      case (a_cylinder); is_within = own(1)**2 + own(2)**2 < 1.1_wp**2 .and. abs(own(3)) < 0.8_wp
      case (a_box); is_within = all(abs(own) < [1.0_wp, 0.7_wp, 1.6_wp])
      case default; is_within = own(3) < 0.0_wp
      end select
    end function is_within
  end subroutine test_shapes

  !> A sphere is slowly pressed into a layer of 24 x 24 x 12 points on a rigid ground, until its
  !> contact has a radius of 3.5 spacings: the force of Hertz, with what the ground adds by
  !> Dimitriadis et al., Biophysical Journal 82 (2002) 2798, for a layer that is bonded to it.
  !> Measured 1 % off at this depth, 6 % at half of it, as points touch one after another.
  subroutine test_hertz(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: modulus = 1.0e10_wp, nu = 0.25_wp, radius = 0.024_wp, layer = 0.012_wp
    real(wp), parameter :: pi = acos(-1.0_wp)
    real(wp) :: depth, a, b, chi, factor, known
    type(set_up_type) :: set_up
    type(diary_type) :: diary

    depth = 3.5e-3_wp**2/radius
    diary%every = 20
    call run('&scene dimension = 3 /'//line//'&material youngs_modulus = 1e10 density = 1e3 '// &
      & 'poissons_ratio = 0.25 /'//line//"&body name = 'layer' lower = -12e-3, -12e-3, -12e-3 "// &
      & 'upper = 12e-3, 12e-3, 0 points = 24, 24, 12 /'//line// &
      & "&boundary side = 'z_min' displacement_x = 0 displacement_y = 0 displacement_z = 0 /"// &
      & line//"&rigid name = 'ball' shape = 'sphere' centre = 0, 0, 24e-3 radius = 24e-3 "// &
      & "rotation = 'held' displacement_x = 0 displacement_y = 0 displacement_z = "// &
      & "'-5.104166667e-4*(1e4*t)^2*(3 - 2e4*t)' /"//line// &
      & "&contact between = 'ball', 'layer' stiffness = 10 /"//line// &
      & '&time duration = 1e-4 /', set_up, error, diary)
    if (allocated(error)) return
    a = -(1.2876_wp - 1.4678_wp*nu + 1.3442_wp*nu**2)/(1 - nu)
    b = (0.6387_wp - 1.0277_wp*nu + 1.5164_wp*nu**2)/(1 - nu)
    chi = sqrt(radius*depth)/layer
    factor = 1 - 2*a/pi*chi + 4*a**2/pi**2*chi**2 - 8/pi**3*(a**3 + 4*pi**2/15*b)*chi**3 &
      & + 16*a/pi**4*(a**3 + 3*pi**2/5*b)*chi**4
    known = 4*modulus/(1 - nu**2)/3*sqrt(radius)*depth**1.5_wp*factor
    associate (pose => set_up%system%rigid_bodies(1)%pose)
      call expect(error, pose%place(3), -depth, 1.0e-6_wp*depth, 'depth')
      call expect(error, pose%force(3), known, 0.06_wp*known, 'force')
      call expect_close(error, pose%force(:2), 0.0_wp, 1.0e-9_wp*known, 'force sideways')
      call expect_close(error, pose%torque, 0.0_wp, 1.0e-9_wp*known*radius, 'moment')
    end associate
    call expect(error, balance(diary), 0.0_wp, 1.0e-3_wp*diary%work(diary%n), 'energy')
  end subroutine test_hertz

  !> A block that is stiff beside its contact meets a half-space with 2 m/s and comes back with its
  !> speed times the restitution; what its own vibration takes is a thousandth.
  subroutine test_bounce(error)
    type(error_type), allocatable, intent(out) :: error
    character(3), parameter :: restitutions(3) = [character(3) :: '1.0', '0.6', '0.2']
    real(wp), parameter :: known(3) = [1.0_wp, 0.6_wp, 0.2_wp]
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: p(3), l(3), mass
    integer :: i

    mass = 1.0e3_wp*0.06_wp*0.04_wp
    do i = 1, 3
      diary = diary_type()
      call run('&scene dimension = 2 /'//line//soft// &
        & "&body name = 'block' lower = 0, 0 upper = 0.06, 0.04 points = 6, 4 /"//line// &
        & '&initial velocity_y = -2 /'//line// &
        & "&rigid name = 'floor' shape = 'half_space' centre = 0, 0 normal = 0, 3 /"//line// &
        & "&contact between = 'floor', 'block' stiffness = 0.002 restitution = "// &
        & restitutions(i)//' /'//line//'&time duration = 9e-3 /', set_up, error, diary)
      if (allocated(error)) return
      call momenta(set_up, p, l)
      call expect(error, p(2)/mass, 2*known(i), 0.02_wp*2*known(i), 'rebound')
      call expect(error, p(1)/mass, 0.0_wp, 1.0e-9_wp, 'sideways')
      call expect(error, balance(diary), diary%kinetic(1), 2.0e-3_wp*diary%kinetic(1), 'energy')
    end do
  end subroutine test_bounce

  !> An elastic block hits a half-space as stiff as itself: without restitution its energy stays.
  subroutine test_rebound(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: p(3), l(3)

    call run(flat//'&initial velocity_y = -5 /'//line// &
      & "&rigid name = 'floor' shape = 'half_space' centre = 0, 0 normal = 0, 1 /"//line// &
      & "&contact between = 'floor', 'block' /"//line//'&time duration = 1e-3 /', set_up, error, &
      & diary)
    if (allocated(error)) return
    call momenta(set_up, p, l)
    call expect_true(error, p(2) > 0.5_wp*5*20.0_wp, 'it does not come back')
    call expect_close(error, diary%kinetic + diary%strain, diary%kinetic(1), &
      & 0.01_wp*diary%kinetic(1), 'energy')
    call expect(error, diary%dissipated(diary%n) + abs(diary%work(diary%n)), 0.0_wp, 1.0e-12_wp, &
      & 'nothing is lost, nothing does work')
  end subroutine test_rebound

  !> A block on an incline of 30 degrees: with a coefficient of 0.3 it slides by
  !> g (sin a - mu cos a), with 0.7 it creeps at the speed at which its dashpots bear it.
  subroutine test_incline(error)
    type(error_type), allocatable, intent(out) :: error
    character(3), parameter :: coefficients(2) = [character(3) :: '0.3', '0.7']
    real(wp), parameter :: gravity = 9.81_wp, time = 9.0e-3_wp, h = 0.01_wp, density = 1.0e3_wp
    real(wp), parameter :: along(2) = [sqrt(0.75_wp), -0.5_wp], out(2) = [0.5_wp, sqrt(0.75_wp)]
    character(*), parameter :: cloud = 'test-rigid-cloud.txt'
    real(wp) :: slides, moved, creeps
    type(set_up_type) :: set_up
    integer :: unit, i, j

    open (newunit=unit, file=cloud, status='replace', action='write')
    do j = 1, 2
      do i = 1, 8
        write (unit, '(4es25.16)') ((i - 0.5_wp)*along + (j - 0.5_wp)*out)*h, 0.0_wp, h**2
      end do
    end do
    close (unit)
    slides = gravity*(0.5_wp - 0.3_wp*sqrt(0.75_wp))
    do i = 1, 2
      call run("&scene dimension = 2 gravity = 0, -9.81 /"//line// &
        & '&material youngs_modulus = 1e8 density = 1e3 poissons_ratio = 0.25 /'//line// &
        & "&body name = 'block' file = '"//cloud//"' /"//line// &
        & "&rigid name = 'incline' shape = 'half_space' centre = 0, 0 "// &
        & 'normal = 0.5, 0.8660254037844386 /'//line// &
        & "&contact between = 'block', 'incline' damping = 0.5 friction = "// &
        & coefficients(i)//' /'//line//'&time duration = 9e-3 /', set_up, error)
      if (allocated(error)) exit
      associate (u => set_up%system%state%u, live => set_up%system%body%point > 0)
        moved = (along(1)*sum(u(:, 1), mask=live) + along(2)*sum(u(:, 2), mask=live))/16
      end associate
      if (i == 1) then
        call expect(error, moved, slides*time**2/2, 0.02_wp*slides*time**2/2, 'slides')
      else
        ! two rows of points press on the dashpots of one, sqrt(k rho) with k = 6 K/delta^2
        creeps = 2*density*gravity/2/sqrt(6*1.0e8_wp/1.5_wp/(3.015_wp*h)**2*density)*time
        call expect(error, moved, creeps, 0.15_wp*creeps, 'creeps')
        call expect_true(error, creeps < 0.05_wp*slides*time**2/2, 'it creeps far')
      end if
    end do
    open (newunit=unit, file=cloud)
    close (unit, status='delete')
  end subroutine test_incline

  !> A spinning ball that hits a free block with friction: together they keep momentum and angular
  !> momentum to rounding, and energy to the order of the step.
  subroutine test_momentum(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp), parameter :: pi = acos(-1.0_wp), r = 3.0e-3_wp
    real(wp) :: p(3), l(3), mass, p0(3), l0(3)

    call run(block//ball//'&time duration = 1.5e-4 /', set_up, error, diary)
    if (allocated(error)) return
    mass = 2000*4*pi/3*r**3
    p0 = mass*[4.0_wp, 0.0_wp, -20.0_wp]
    l0 = cross([1.0e-3_wp, 0.4e-3_wp, 3.6e-3_wp], p0) + [0.0_wp, 0.4_wp*mass*r**2*3000, 0.0_wp]
    call momenta(set_up, p, l)
    call expect_close(error, p, p0, 1.0e-13_wp*norm2(p0), 'momentum')
    call expect_close(error, l, l0, 1.0e-12_wp*norm2(l0), 'angular momentum')
    call expect(error, balance(diary), diary%kinetic(1), 1.0e-3_wp*diary%kinetic(1), 'energy')
    call expect_true(error, diary%dissipated(diary%n) > 1.0e-3_wp*diary%kinetic(1), 'no friction')
    associate (pose => set_up%system%rigid_bodies(1)%pose)
      call expect_true(error, pose%velocity(3) > -10.0_wp, 'it goes on')
      call expect(error, diary%kinetic(1), mass/2*(416 + 0.4_wp*r**2*3000**2), &
        & 1.0e-12_wp*diary%kinetic(1), 'kinetic energy at the start')
    end associate
  end subroutine test_momentum

  !> A box and a cylinder that are much lighter than the points that they touch hit the block with
  !> an edge: the step is small enough for them, and nothing is lost.
  subroutine test_light(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: shapes(2) = [character(80) :: &
      & "shape = 'box' edges = 3e-3, 4e-3, 2e-3 axis = 1, 2, 0.5 angle = 25", &
      & "shape = 'cylinder' radius = 1.5e-3 length = 3e-3 axis = 1, 0.2, 0.6"]
    real(wp), parameter :: masses(2) = [20*24.0e-9_wp, 20*acos(-1.0_wp)*6.75e-9_wp]
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: p(3), l(3), p0(3), turned
    integer :: i

    do i = 1, 2
      diary = diary_type()
      call run(block//"&rigid name = 'light' "//trim(shapes(i))//' centre = 0.3e-3, 0.5e-3, '// &
        & '3e-3 density = 20 velocity_z = -30 /'//line// &
        & "&contact between = 'block', 'light' /"//line// &
        & '&time duration = 1e-4 /', set_up, error, diary)
      if (allocated(error)) return
      p0 = [0.0_wp, 0.0_wp, -30*masses(i)]
      call momenta(set_up, p, l)
      call expect_close(error, p, p0, 1.0e-12_wp*norm2(p0), 'momentum')
      call expect_close(error, l, cross([0.3e-3_wp, 0.5e-3_wp, 3.0e-3_wp], p0), &
        & 1.0e-12_wp*norm2(p0)*1.0e-3_wp, 'angular momentum')
      call expect(error, balance(diary), diary%kinetic(1), 1.0e-3_wp*diary%kinetic(1), 'energy')
      associate (pose => set_up%system%rigid_bodies(1)%pose)
        turned = norm2(pose%momentum)
        call expect_true(error, pose%velocity(3) > 0.0_wp, 'it has not come back')
        call expect_true(error, turned > 0.02_wp*norm2(p0)*1.0e-3_wp, 'it does not turn')
      end associate
    end do
  end subroutine test_light

  !> A free box that spins about nearly its middle axis tumbles by Euler's equations, here solved by
  !> Runge and Kutta's rule with a tenth of the step; its angular momentum stays.
  subroutine test_spin(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: edges(3) = [1.0e-3_wp, 2.0e-3_wp, 3.0e-3_wp]
    type(set_up_type) :: set_up
    real(wp) :: inertia(3), spin(3), k(3, 4), dt, start(3), mass, turned(3, 3)
    integer :: i, steps

    call run('&scene dimension = 3 /'//line//soft// &
      & "&body name = 'far' lower = 1, 1, 1 upper = 1.03, 1.03, 1.03 points = 3, 3, 3 /"//line// &
      & "&rigid name = 'box' shape = 'box' centre = 0, 0, 0 edges = 1e-3, 2e-3, 3e-3 "// &
      & 'axis = 0, 0, 1 angle = 90 density = 1000 velocity_x = 3 spin_x = 3000 spin_y = 30 '// &
      & 'spin_z = 20 /'//line//"&contact between = 'box', 'far' /"//line// &
      & '&time steps = 2500 step = 3e-6 /', set_up, error)
    if (allocated(error)) return
    mass = 1000*product(edges)
    inertia = mass/12*[edges(2)**2 + edges(3)**2, edges(1)**2 + edges(3)**2, &
      & edges(1)**2 + edges(2)**2]
    ! own axes: x along y, y along -x
    start = [30.0_wp, -3000.0_wp, 20.0_wp]
    spin = start
    steps = 25000
    dt = 2500*3.0e-6_wp/steps
    do i = 1, steps
      k(:, 1) = rate(spin)
      k(:, 2) = rate(spin + dt/2*k(:, 1))
      k(:, 3) = rate(spin + dt/2*k(:, 2))
      k(:, 4) = rate(spin + dt*k(:, 3))
      spin = spin + dt/6*(k(:, 1) + 2*k(:, 2) + 2*k(:, 3) + k(:, 4))
    end do
    associate (pose => set_up%system%rigid_bodies(1)%pose, &
      & obstacle => set_up%system%obstacles(1))
      call expect_close(error, pose%momentum, [-inertia(2)*start(2), inertia(1)*start(1), &
        & inertia(3)*start(3)], 1.0e-12_wp*inertia(2)*3000, 'angular momentum')
      turned = obstacle%frame
      call expect_close(error, matmul(spin_of(pose), turned), spin, 1.0e-2_wp*3000, 'spin')
      call expect_true(error, abs(spin(2) - start(2)) > 300.0_wp, 'it does not tumble')
      call expect(error, dot_product(spin_of(pose), pose%momentum), sum(inertia*start**2), &
        & 1.0e-3_wp*sum(inertia*start**2), 'energy')
      call expect(error, pose%place(1), 3*2500*3.0e-6_wp, 1.0e-15_wp, 'place')
    end associate

  contains

    pure function rate(w)
      real(wp), intent(in) :: w(3)
      real(wp) :: rate(3)
      rate = -cross(w, inertia*w)/inertia
    end function rate
  end subroutine test_spin

  !> Weight acts on what is free, held components stay.
  subroutine test_fall(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: mass

    call run('&scene dimension = 2 thickness = 0.1 gravity = 3, -9.81 /'//line//soft// &
      & "&body name = 'far' lower = 1, 1 upper = 1.03, 1.03 points = 3, 3 /"//line// &
      & "&boundary region = 'all' displacement_x = 0 displacement_y = 0 /"//line// &
      & "&region name = 'all' where = '1' /"//line// &
      & "&rigid name = 'disc' shape = 'sphere' centre = 0, 0 radius = 1e-2 density = 1000 "// &
      & 'displacement_x = 0 velocity_y = 0.5 /'//line//"&contact between = 'disc', 'far' /"// &
      & line// &
      & '&time duration = 0.02 step = 1e-5 /', set_up, error, diary)
    if (allocated(error)) return
    mass = 1000*acos(-1.0_wp)*1.0e-4_wp*0.1_wp
    associate (pose => set_up%system%rigid_bodies(1)%pose)
      call expect(error, pose%mass, mass, 1.0e-14_wp*mass, 'mass')
      call expect(error, pose%place(2), 0.5_wp*0.02_wp - 9.81_wp/2*0.02_wp**2, 1.0e-13_wp, 'way')
      call expect(error, pose%velocity(2), 0.5_wp - 9.81_wp*0.02_wp, 1.0e-13_wp, 'velocity')
      call expect_close(error, [pose%place(1), pose%velocity(1)], 0.0_wp, 1.0e-300_wp, 'held')
    end associate
    call expect(error, diary%work(diary%n), -mass*9.81_wp*set_up%system%rigid_bodies(1)%pose &
      & %place(2), 1.0e-12_wp, 'work of the weight')
    call expect(error, balance(diary), diary%kinetic(1), 1.0e-12_wp, 'energy')
  end subroutine test_fall

  !> What moves a rigid body as given does the work that the others gain: a floor that is raised,
  !> and a wheel that is turned while it presses.
  subroutine test_work(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: rotation(3)

    call run(flat//"&rigid name = 'floor' shape = 'half_space' centre = 0, 0 normal = 0, 1 "// &
      & "displacement_y = '1e4*t^2' /"//line//"&contact between = 'floor', 'block' /"//line// &
      & '&time duration = 1e-3 /', set_up, error, diary)
    if (allocated(error)) return
    call expect_true(error, diary%work(diary%n) > 0.5_wp*20*10.0_wp**2, 'it is not raised')
    call expect(error, balance(diary), 0.0_wp, 2.0e-3_wp*diary%work(diary%n), 'work of the floor')
    diary = diary_type()
    call run(flat//"&boundary side = 'y_min' displacement_x = 0 displacement_y = 0 /"//line// &
      & "&rigid name = 'wheel' shape = 'sphere' centre = 0.1, 0.15 radius = 0.05 mass = 2 "// &
      & "displacement_x = 0 displacement_y = '-4*t' rotation = 'imposed' spin_z = '1e5*t' /"// &
      & line//"&contact between = 'wheel', 'block' friction = 0.2 damping = 0.3 /"//line// &
      & '&time duration = 1e-3 /', set_up, error, diary)
    if (allocated(error)) return
    call expect_true(error, diary%dissipated(diary%n) > 0.05_wp*diary%work(diary%n), 'no friction')
    ! the start, a jump to 4 m/s, is no work
    call expect(error, diary%kinetic(1), 16.0_wp, 1.0e-12_wp, 'kinetic energy')
    call expect(error, balance(diary), diary%kinetic(1), &
      & 5.0e-3_wp*diary%work(diary%n), 'work of the wheel')
    associate (pose => set_up%system%rigid_bodies(1)%pose)
      rotation = rotation_of(pose)
      call expect(error, rotation(3), 0.05_wp, 1.0e-12_wp, 'rotation')
      call expect(error, pose%place(2), -4.0e-3_wp, 1.0e-15_wp, 'way')
      call expect_true(error, pose%force(2) > 0.0_wp .and. pose%torque(3) < 0.0_wp, 'its loads')
    end associate
  end subroutine test_work

  !> The impact of the ball with everything moving at 300 m/s, and with the axes exchanged.
  subroutine test_objective(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: time = '&time duration = 6e-5 /'
    type(set_up_type) :: still, moving, turned
    integer :: k, j

    call run(block//ball//time, still, error)
    call run(block//'&initial velocity_y = 300 /'//line//"&rigid name = 'ball' "// &
      & "shape = 'sphere' centre = 1e-3, 0.4e-3, 3.6e-3 radius = 3e-3 density = 2000 "// &
      & 'velocity_x = 4 '// &
      & 'velocity_y = 300 velocity_z = -20 spin_y = 3000 /'//line// &
      & "&contact between = 'block', 'ball' friction = 0.3 /"//line//time, moving, error)
    call run('&scene dimension = 3 /'//line//soft// &
      & "&body name = 'block' lower = -4e-3, -4e-3, -4e-3 upper = 0, 4e-3, 4e-3 "// &
      & 'points = 4, 8, 8 /'//line//"&rigid name = 'ball' shape = 'sphere' centre = 3.6e-3, "// &
      & '1e-3, 0.4e-3 radius = 3e-3 density = 2000 velocity_y = 4 velocity_x = -20 '// &
      & 'spin_z = 3000 /'// &
      & line//"&contact between = 'block', 'ball' friction = 0.3 /"//line//time, turned, error)
    if (allocated(error)) return
    associate (a => still%system%rigid_bodies(1)%pose, b => moving%system%rigid_bodies(1)%pose, &
      & c => turned%system%rigid_bodies(1)%pose)
      call expect_true(error, norm2(a%force) > 1.0_wp, 'they do not touch')
      call expect_close(error, b%velocity - [0.0_wp, 300.0_wp, 0.0_wp], a%velocity, 1.0e-8_wp, &
        & 'moving')
      call expect_close(error, b%momentum, a%momentum, 1.0e-9_wp*norm2(a%momentum), 'moving, spin')
      call expect_close(error, cshift(c%velocity, 1), a%velocity, 1.0e-8_wp, 'turned')
      call expect_close(error, cshift(c%momentum, 1), a%momentum, 1.0e-9_wp*norm2(a%momentum), &
        & 'turned, spin')
    end associate
    associate (a => still%system%state%v, b => moving%system%state%v, body => still%system%body)
      j = 0
      do k = 1, body%n_slots
        if (body%point(k) == 0) cycle
        call expect_close(error, b(k, :) - [0.0_wp, 300.0_wp, 0.0_wp], a(k, :), 1.0e-8_wp, &
          & 'velocities')
        j = j + 1
      end do
      call expect_true(error, j == 256, 'points')
    end associate
  end subroutine test_objective

  !> The impact on one and on two threads.
  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: one, two

    call run(block//ball//'&time duration = 6e-5 /', one, error, threads=1)
    call run(block//ball//'&time duration = 6e-5 /', two, error, threads=2)
    if (allocated(error)) return
    call expect_close(error, one%system%state%v, two%system%state%v, 0.0_wp, 'velocities')
    associate (a => one%system%rigid_bodies(1)%pose, b => two%system%rigid_bodies(1)%pose)
      call expect_true(error, norm2(a%force) > 1.0_wp, 'they do not touch')
      call expect_close(error, [a%force, a%torque, a%velocity, a%momentum, a%place], [b%force, &
        & b%torque, b%velocity, b%momentum, b%place], 0.0_wp, 'ball')
    end associate
    call omp_set_num_threads(1)
  end subroutine test_threads

  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: steps = '&time steps = 3 /'
    character(*), parameter :: round = "&rigid name = 'ball' shape = 'sphere' centre = 0.5, 1 "// &
      & 'radius = 0.4'
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault

    call expect_fault(error, good_head//round//' /'//line//steps, 'mass|density')
    call expect_fault(error, good_head//round//' mass = 1 density = 2 /'//line//steps, 'mass|both')
    call expect_fault(error, good_head//round//' mass = 1 /'//line// &
      & "&time method = 'relaxation' /", 'rigid|relaxation')
    call expect_fault(error, good_head//round//' mass = 1 /'//line// &
      & "&time steps = 3 integrator = 'runge_kutta' /", 'runge_kutta|forward_backward')
    call expect_fault(error, good_head//round//' mass = 1 length = 2 /'//line//steps, 'length')
    call expect_fault(error, good_head//round//' mass = 1 velocity_z = 2 /'//line//steps, &
      & 'velocity_z|2')
    call expect_fault(error, good_head//round//' mass = 1 spin_x = 2 /'//line//steps, 'spin_x|2D')
    call expect_fault(error, good_head//round//" mass = 1 spin_z = 't' /"//line//steps, &
      & 'spin_z|imposed')
    call expect_fault(error, good_head//round//" mass = 1 displacement_y = 'x' /"//line//steps, &
      & 'displacement_y|x')
    call expect_fault(error, good_head//round//' mass = 1 displacement_y = 0 velocity_y = 1 /'// &
      & line//steps, 'displacement_y|velocity_y')
    call expect_fault(error, good_head//round//" mass = 1 rotation = 'held' spin_z = 1 /"//line// &
      & steps, 'spin_z|held')
    call expect_fault(error, good_head//"&rigid name = 'r' shape = 'cylinder' centre = 0, 1 "// &
      & 'radius = 1 length = 1 mass = 1 /'//line//steps, 'cylinder|2D|sphere')
    call expect_fault(error, good_head//"&rigid name = 'r' shape = 'box' centre = 0, 1 mass = 1 /" &
      & //line//steps, 'edges')
    call expect_fault(error, good_head//"&rigid name = 'r' shape = 'half_space' centre = 0, 1 /"// &
      & line//steps, 'normal')
    call expect_fault(error, good_head//"&rigid name = 'r' shape = 'half_space' centre = 0, 0 "// &
      & 'normal = 0, 1 mass = 1 /'//line//steps, 'half_space|mass')
    call expect_fault(error, good_head//"&rigid name = 'r' shape = 'stl' centre = 0, 0 mass = 1 /" &
      & //line//steps, 'stl|sphere')
    call expect_fault(error, good_head//"&rigid name = 'plate' shape = 'sphere' centre = 0, 2 "// &
      & 'radius = 0.1 mass = 1 /'//line//steps, 'plate|body')
    call expect_fault(error, good_head//round//' mass = 1 /'//line//"&probe name = 'ball' "// &
      & 'point = 0, 0 /'//line//steps, 'ball|probe')
    call expect_fault(error, good_head//round//' mass = 1 /'//line//round//' mass = 1 /'//line// &
      & steps, 'ball|differ')
    call expect_fault(error, good_head//round//' mass = 1 /'//line// &
      & "&rigid name = 'wall' shape = 'half_space' centre = 0, 0 normal = 0, 1 /"//line// &
      & "&contact between = 'plate', 'ball', 'wall' /"//line//steps, 'ball|wall|rigid')
    call expect_fault(error, good_head//round//' mass = 1 /'//line//"&contact within = 'ball' /"// &
      & line//steps, 'ball|plate')
    ! only points show that a body begins within another
    call expect_scene(error, good_head//"&rigid name = 'ball' shape = 'sphere' centre = 0.5, "// &
      & '0.8 radius = 0.4 mass = 1 /'//line//"&contact between = 'plate', 'ball' /"// &
      & line//steps, scene)
    if (allocated(error)) return
    call prepare(scene, set_up, fault)
    call expect_parts(error, fault, 'ball|within|start')
  end subroutine test_refused

end module test_force_rigid
