!> Boundaries whose points move as one rigid body: against closed forms of levers, pendulums and
!> spinning bodies.
module test_motion_pins
  use pd_base_error, only: fault_type => error_type, status_input
  use pd_base_kinds, only: wp
  use pd_base_vectors, only: cross
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_pose, only: displacement_of, rotation_of
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: prepare, set_up_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: diary_type, expect, expect_true, ready_alone, rotation_matrix
  use test_scene_expect, only: expect_fault, expect_scene, line
  implicit none (type, external)
  private
  public :: collect_motion_pins

  !> A slender bar of steel along x about (0, 0), 41 x 5 points of 1 cm.
  character(*), parameter :: bar = '&scene dimension = 2 /'//line// &
    & '&material youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.3 /'//line// &
    & "&body name = 'bar' lower = -0.205, -0.025 upper = 0.205, 0.025 points = 41, 5 /"//line// &
    & "&region name = 'middle' shape = 'box' lower = -0.0151 upper = 0.0151 /"//line// &
    & "&region name = 'right' shape = 'box' lower = 0.1951 /"//line// &
    & "&region name = 'left' shape = 'box' upper = -0.1951 /"//line// &
    & "&region name = 'all' where = '1' /"//line

contains

  subroutine collect_motion_pins(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('long: a lever on a pin and a spring', test_lever), &
      & new_unittest('a roller moves along', test_roller), &
      & new_unittest('a pin in 3D turns about any axis', test_turned), &
      & new_unittest('a pendulum', test_pendulum), &
      & new_unittest('a spinning body without force', test_spin), &
      & new_unittest('a pin under a load accelerates as one body', test_pushed), &
      & new_unittest('energies balance', test_balance), &
      & new_unittest('what guides a pin is an expression of t', test_guided), &
      & new_unittest('what is refused', test_refused)]
  end subroutine collect_motion_pins

  !> Run the scene of a text to its end.
  subroutine run(text, set_up, error, diary)
    character(*), intent(in) :: text
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    type(diary_type), intent(inout), optional :: diary
    type(scene_type) :: scene
    type(diary_type) :: own
    type(fault_type), allocatable :: fault

    call expect_scene(error, text, scene)
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    if (present(diary)) own = diary
    if (scene%time%method == 'relaxation') then
      own%every = 0
      call run_relaxation(set_up%system, set_up%plan%relaxation, own, fault)
    else
      call run_explicit(set_up%system, trim(scene%time%integrator), set_up%plan%step, &
        & set_up%plan%steps, own, fault)
    end if
    if (allocated(fault)) call test_failed(error, fault%message)
    if (present(diary)) diary = own
  end subroutine run

  !> A bar on a pin in its middle: a force F at one end, a spring k at the other, both 0.2 m away.
  !> It turns by F/(0.2 m k), and the pin bears twice the force. What the bar bends is
  !> k l^3/(3 E I) of what the spring gives, 1.3e-4 and 1.3e-3; tolerances are twice that.
  subroutine test_lever(error)
    type(error_type), allocatable, intent(out) :: error
    character(18), parameter :: solvers(2) = [character(18) :: 'conjugate_gradient', &
      & 'dynamic_relaxation']
    character(3), parameter :: springs(2) = [character(3) :: '1e5', '1e6']
    real(wp), parameter :: springs_of(2) = [1.0e5_wp, 1.0e6_wp]
    real(wp), parameter :: force = 100.0_wp, arm = 0.2_wp
    type(set_up_type) :: set_up
    real(wp) :: rotation(3)
    integer :: i

    do i = 1, 2
      call run(bar//"&boundary name = 'p' region = 'middle' motion = 'pin' "// &
        & 'displacement_x = 0 displacement_y = 0 /'//line// &
        & "&load region = 'right' force_y = 100 /"//line// &
        & "&load region = 'left' stiffness = 0, "//springs(i)//' /'//line// &
        & "&time method = 'relaxation' /"//line//"&relaxation solver = '"//trim(solvers(i))// &
        & "' tolerance = 1e-7 /", set_up, error)
      if (allocated(error)) return
      associate (motion => set_up%system%motions(1), angle => force/(arm*springs_of(i)))
        rotation = rotation_of(motion%pose)
        call expect(error, rotation(3), angle, 2.6e-9_wp*springs_of(i)*angle, &
          & 'rotation, '//solvers(i))
        call expect_close(error, motion%reaction(:2), [0.0_wp, -2*force], 1.0e-3_wp*force, &
          & 'reaction, '//solvers(i))
        call expect_close(error, motion%moment, 0.0_wp, 1.0e-4_wp*force*arm, 'moment')
        call expect(error, set_up%system%external_work, force*arm*rotation(3)/2, &
          & 2.6e-9_wp*springs_of(i)*force*arm*angle, 'work of the load')
        call expect_rigid(error, set_up, 1)
      end associate
    end do
  end subroutine test_lever

  !> The points of a pin keep their distances to the last digit.
  subroutine expect_rigid(error, set_up, m)
    type(error_type), allocatable, intent(inout) :: error
    type(set_up_type), intent(in) :: set_up
    integer, intent(in) :: m
    real(wp) :: xi(set_up%system%body%dim), eta(set_up%system%body%dim), stretched
    integer :: i, j

    if (allocated(error)) return
    associate (motion => set_up%system%motions(m), system => set_up%system)
      stretched = 0.0_wp
      do i = 1, size(motion%slots)
        do j = 1, i - 1
          xi = system%body%x(motion%slots(j), :) - system%body%x(motion%slots(i), :)
          eta = system%state%u(motion%slots(j), :) - system%state%u(motion%slots(i), :)
          stretched = max(stretched, abs(sum(eta*(2*xi + eta)))/sum(xi**2))
        end do
      end do
      ! of displacements over distances, which rotation makes, half a unit in the last place
      call expect_true(error, stretched <= 1.0e-15_wp*(1 + 1000*norm2(rotation_of(motion%pose))), &
        & 'the pin is strained')
    end associate
  end subroutine expect_rigid

  !> A bar whose left pin is moved along x and up, on a roller at the right: it follows along x as a
  !> whole and turns about the roller, exactly, without strain.
  subroutine test_roller(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    real(wp) :: rotation(3), angle, distance

    call run(bar//"&boundary region = 'left' motion = 'pin' displacement_x = 3e-3 "// &
      & 'displacement_y = 1e-3 /'//line// &
      & "&boundary region = 'right' motion = 'pin' displacement_y = 0 /"//line// &
      & "&time method = 'relaxation' /"//line//'&relaxation tolerance = 1e-8 /', set_up, error)
    if (allocated(error)) return
    distance = 0.4_wp
    angle = -asin(1.0e-3_wp/distance)
    rotation = rotation_of(set_up%system%motions(1)%pose)
    call expect(error, rotation(3), angle, 1.0e-9_wp, 'rotation of the left pin')
    rotation = rotation_of(set_up%system%motions(2)%pose)
    call expect(error, rotation(3), angle, 1.0e-9_wp, 'rotation of the roller')
    call expect(error, set_up%system%motions(2)%pose%place(1), 3.0e-3_wp - distance &
      & *(1 - cos(angle)), 1.0e-10_wp, 'the roller moves along')
    call expect_close(error, set_up%system%motions(2)%reaction, 0.0_wp, 1.0_wp, 'reaction')
  end subroutine test_roller

  !> A block in a pin at one face and three springs' worth of couples at the other: rotation about
  !> all axes, found from the pin's points alone. Two pins hold its centre and the far end's; the
  !> axis between is free to turn, against a spring.
  subroutine test_turned(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: block = '&scene dimension = 3 /'//line// &
      & '&material youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.25 /'//line// &
      & "&body name = 'b' lower = 0, 0, 0 upper = 0.12, 0.03, 0.03 points = 12, 3, 3 /"//line// &
      & "&region name = 'near' shape = 'box' upper = 0.0201 /"//line// &
      & "&region name = 'far' shape = 'box' lower = 0.0999 /"//line// &
      & "&region name = 'top' where = '(x > 0.04)*(x < 0.08)*(z > 0.02)' /"//line// &
      & "&region name = 'base' where = '(x > 0.04)*(x < 0.08)*(z < 0.01)' /"//line
    real(wp), parameter :: stiffness = 1.0e5_wp, force = 10.0_wp
    type(set_up_type) :: set_up
    real(wp) :: rotation(3)

    ! the force acts at z = +1 cm, the spring at z = -1 cm: force h = k h^2 angle. Turned by so
    ! much, rounding leaves a residual of 2e-8
    call run(block//"&boundary region = 'near' motion = 'pin' displacement_x = 0 "// &
      & 'displacement_y = 0 displacement_z = 0 /'//line// &
      & "&boundary region = 'far' motion = 'pin' displacement_y = 0 displacement_z = 0 /"//line// &
      & "&load region = 'top' force_y = 10 /"//line// &
      & "&load region = 'base' stiffness = 0, 1e5, 0 /"//line// &
      & "&time method = 'relaxation' /"//line//'&relaxation tolerance = 1e-7 /', set_up, error)
    if (allocated(error)) return
    rotation = rotation_of(set_up%system%motions(1)%pose)
    call expect(error, rotation(1), -force/(0.01_wp*stiffness), 2.0e-3_wp*force/(0.01_wp &
      & *stiffness), 'rotation about the axis')
    rotation = rotation_of(set_up%system%motions(2)%pose)
    call expect(error, rotation(1), -force/(0.01_wp*stiffness), 2.0e-3_wp*force/(0.01_wp &
      & *stiffness), 'rotation of the far end')
    call expect_rigid(error, set_up, 1)
    call expect_close(error, set_up%system%motions(1)%moment, 0.0_wp, 1.0e-5_wp, 'moment')
  end subroutine test_turned

  !> A bar on a pin at one end falls from the horizontal. A stiff pendulum has
  !> I angle'' = -m g d cos(angle), which is integrated here in 2000 steps; I and d are those of the
  !> points. The bar is so stiff that its lowest bending takes a thousandth of the time.
  subroutine test_pendulum(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: duration = 2.0e-3_wp, gravity = 1.0e5_wp
    type(set_up_type) :: set_up
    real(wp) :: rotation(3), inertia, moment, angle, rate, step, k(2, 4)
    integer :: n

    call run(bar//"&boundary name = 'p' region = 'left' motion = 'pin' "// &
      & 'displacement_x = 0 displacement_y = 0 /'//line// &
      & "&load region = 'all' body_force_y = -8e8 /"//line// &
      & "&time duration = 2e-3 integrator = 'velocity_verlet' /", set_up, error)
    if (allocated(error)) return
    associate (body => set_up%system%body, motion => set_up%system%motions(1))
      inertia = 8000*sum(body%volume(body%slot)*((body%x(body%slot, 1) + 0.2_wp)**2 &
        & + body%x(body%slot, 2)**2))
      moment = 8000*gravity*sum(body%volume(body%slot)*(body%x(body%slot, 1) + 0.2_wp))
      angle = 0.0_wp
      rate = 0.0_wp
      step = duration/2000
      do n = 1, 2000
        k(:, 1) = [rate, -moment/inertia*cos(angle)]
        k(:, 2) = [rate + step/2*k(2, 1), -moment/inertia*cos(angle + step/2*k(1, 1))]
        k(:, 3) = [rate + step/2*k(2, 2), -moment/inertia*cos(angle + step/2*k(1, 2))]
        k(:, 4) = [rate + step*k(2, 3), -moment/inertia*cos(angle + step*k(1, 3))]
        angle = angle + step/6*(k(1, 1) + 2*k(1, 2) + 2*k(1, 3) + k(1, 4))
        rate = rate + step/6*(k(2, 1) + 2*k(2, 2) + 2*k(2, 3) + k(2, 4))
      end do
      call expect_true(error, abs(angle) > 0.5_wp, 'it has not fallen far')
      rotation = rotation_of(motion%pose)
      ! it vibrates by about g l^4 rho A/(8 E I l) about that: 1e-2 of a radian
      call expect(error, rotation(3), angle, 2.0e-2_wp*abs(angle), 'angle')
      call expect_rigid(error, set_up, 1)
      call expect_close(error, motion%moment, 0.0_wp, 1.0e-9_wp*moment, 'moment')
    end associate
  end subroutine test_pendulum

  !> A block that is all pin, spinning about no axis of its inertia: Euler's equations, integrated
  !> here in small steps. Momentum about a fixed axis is kept to rounding.
  subroutine test_spin(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: text = '&scene dimension = 3 /'//line// &
      & '&material youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.25 /'//line// &
      & "&body name = 'b' lower = 0, 0, 0 upper = 0.05, 0.03, 0.02 points = 5, 3, 2 /"//line// &
      & "&region name = 'all' where = '1' /"//line// &
      & "&boundary region = 'all' motion = 'pin' /"//line// &
      & "&initial velocity_x = '300*(z - 0.01) - 500*(y - 0.015) + 7' "// &
      & "velocity_y = '500*(x - 0.025) - 200*(z - 0.01)' "// &
      & "velocity_z = '200*(y - 0.015) - 300*(x - 0.025)' /"//line// &
      & "&time duration = 4e-3 step = 2e-6 integrator = 'velocity_verlet' /"
    real(wp), parameter :: spin(3) = [200.0_wp, 300.0_wp, 500.0_wp]
    integer, parameter :: steps = 20000
    type(set_up_type) :: set_up
    real(wp) :: inertia(3), momentum(3), w(3), k(3, 4), R(3, 3), turned(3), arm(3), step
    integer :: n, c

    call run(text, set_up, error)
    if (allocated(error)) return
    associate (pose => set_up%system%motions(1)%pose)
      do c = 1, 3
        inertia(c) = pose%spread(1, 1) + pose%spread(2, 2) + pose%spread(3, 3) - pose%spread(c, c)
      end do
      momentum = inertia*spin
      call expect_close(error, pose%momentum, momentum, 1.0e-12_wp*norm2(momentum), 'momentum')
      call expect_close(error, pose%place, [7*4.0e-3_wp, 0.0_wp, 0.0_wp], 1.0e-14_wp, 'centre')
      ! rates in the frame of the body; the rotation by small turns about the axis of the middle
      step = 4.0e-3_wp/steps
      w = spin
      R = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [3, 3])
      do n = 1, steps
        k(:, 1) = -cross(w, inertia*w)/inertia
        k(:, 2) = -cross(w + step/2*k(:, 1), inertia*(w + step/2*k(:, 1)))/inertia
        turned = w + step/2*k(:, 2)
        k(:, 3) = -cross(turned, inertia*turned)/inertia
        R = matmul(R, rotation_matrix(turned/norm2(turned), step*norm2(turned)))
        turned = w + step*k(:, 3)
        k(:, 4) = -cross(turned, inertia*turned)/inertia
        w = w + step/6*(k(:, 1) + 2*k(:, 2) + 2*k(:, 3) + k(:, 4))
      end do
      arm = pose%arms(:, 1)
      turned = displacement_of(pose, 1, [0.0_wp, 0.0_wp, 0.0_wp]) + arm
      call expect_true(error, norm2(turned - arm) > 0.1_wp*norm2(arm), 'it has not turned')
      ! both turn by 2.5 rad; the scheme is of second order: (500/s 2 us)^2 a step
      call expect_close(error, turned, matmul(R, arm), 1.0e-5_wp*norm2(arm), 'place of a corner')
    end associate
  end subroutine test_spin

  !> A plate that is all pin under a force at a corner: Newton's and Euler's laws for a body that
  !> has hardly turned.
  subroutine test_pushed(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: text = '&scene dimension = 2 /'//line// &
      & '&material youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.3 /'//line// &
      & "&body name = 'b' lower = 0, 0 upper = 0.05, 0.03 points = 5, 3 /"//line// &
      & "&region name = 'all' where = '1' /"//line// &
      & "&region name = 'corner' where = '(x > 0.04)*(y > 0.02)' /"//line// &
      & "&boundary name = 'p' region = 'all' motion = 'pin' /"//line// &
      & "&load region = 'corner' force_x = 300 /"//line// &
      & "&time duration = 2e-5 step = 5e-7 integrator = 'velocity_verlet' /"
    real(wp), parameter :: force = 300.0_wp, time = 2.0e-5_wp
    type(set_up_type) :: set_up
    real(wp) :: mass, about, rotation(3)

    call run(text, set_up, error)
    if (allocated(error)) return
    associate (body => set_up%system%body, motion => set_up%system%motions(1))
      mass = 8000*sum(body%volume(body%slot))
      about = 8000*sum(body%volume(body%slot)*((body%x(body%slot, 1) - 0.025_wp)**2 &
        & + (body%x(body%slot, 2) - 0.015_wp)**2))
      call expect(error, motion%pose%place(1), force/mass*time**2/2, &
        & 1.0e-11_wp*force/mass*time**2, 'way')
      rotation = rotation_of(motion%pose)
      call expect(error, rotation(3), -force*0.01_wp/about*time**2/2, 1.0e-5_wp*force*0.01_wp &
        & /about*time**2, 'rotation')
      call expect_close(error, motion%reaction, 0.0_wp, 1.0e-9_wp*force, 'reaction')
      call expect(error, set_up%system%external_work, (force*time)**2/(2*mass) &
        & + (force*0.01_wp*time)**2/(2*about), 0.06_wp*(force*time)**2/(2*mass), 'work')
    end associate
  end subroutine test_pushed

  !> An elastic bar on a free pin, thrown about: no work is done from outside, and the energies
  !> balance to the second order of the step.
  subroutine test_balance(error)
    type(error_type), allocatable, intent(out) :: error
    character(4), parameter :: steps(2) = [character(4) :: '4e-7', '2e-7']
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: worst(2)
    integer :: i

    do i = 1, 2
      diary = diary_type()
      call run(bar//"&boundary region = 'middle' motion = 'pin' /"//line// &
        & "&initial velocity_y = '30*cos(10*x)' velocity_x = '100*x*x' /"//line// &
        & '&time duration = 2e-4 step = '//steps(i)//" integrator = 'velocity_verlet' /", set_up, &
        & error, diary)
      if (allocated(error)) return
      associate (total => diary%kinetic + diary%strain - diary%work)
        worst(i) = max_abs(total - total(1))/total(1)
        call expect_true(error, max_abs(diary%strain) > 0.05_wp*total(1), 'it is not strained')
      end associate
    end do
    call expect_true(error, worst(1) < 1.0e-2_wp, 'balance')
    call expect_true(error, worst(2) < 0.3_wp*worst(1), 'order of the balance')
  end subroutine test_balance

  !> A pin that is shaken along y by an expression takes a loose bar along: the force it exerts is
  !> the mass times the acceleration, once the bar's vibrations are nothing beside it.
  subroutine test_guided(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    type(scene_type) :: scene

    call run(bar//"&define name = 'a' value = 400 /"//line// &
      & "&boundary name = 'p' region = 'middle' motion = 'pin' displacement_x = 'a*t^2/2' "// &
      & 'displacement_y = 0 /'//line// &
      & "&initial velocity_x = 0 /"//line// &
      & "&time duration = 5e-4 integrator = 'forward_backward' /", set_up, error)
    if (allocated(error)) return
    call expect(error, set_up%system%motions(1)%pose%place(1), 400*5.0e-4_wp**2/2, 1.0e-15_wp, &
      & 'place')
    call expect_scene(error, bar//"&boundary name = 'p' region = 'middle' motion = 'pin' "// &
      & "displacement_x = '1/t' displacement_y = 0 /"//line//'&time steps = 3 /', scene)
    if (allocated(error)) return
    call prepare(scene, set_up, fault)
    call expect_true(error, allocated(fault), 'a value that is not finite is accepted')
  end subroutine test_guided

  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: pin = "&boundary region = 'middle' motion = 'pin' ", &
      & relaxed = "&time method = 'relaxation' /"

    call expect_fault(error, bar//pin//"displacement_x = 'y*t' /"//line//'&time steps = 3 /', &
      & 'a pin moves as a whole')
    call expect_fault(error, bar//pin//"/"//line//"&time steps = 3 integrator = 'runge_kutta' /", &
      & "motion = 'pin'|runge_kutta|velocity_verlet")
    call expect_fault(error, bar//"&boundary side = 'x_min' motion = 'pin' absorbing = T /"// &
      & line//'&time steps = 3 /', 'absorbing|motion')
    call expect_fault(error, bar//"&boundary region = 'middle' motion = 'pined' /"//line// &
      & '&time steps = 3 /', "pined|imposed|pin")
    call refuse(bar//pin//'/'//line//"&boundary region = 'middle' velocity_x = 0 /"//line// &
      & '&time steps = 3 /', 'share points')
    call refuse(bar//"&region name = 'one' where = '(abs(x) < 1e-3)*(abs(y) < 1e-3)' /"//line// &
      & "&boundary region = 'one' motion = 'pin' /"//line//'&time steps = 3 /', 'a single point')
    call refuse(bar//pin//'displacement_x = 0 displacement_y = 0 /'//line//relaxed, &
      & 'free to move as a whole in 1 way')
    call refuse(bar//"&crack from = 0, -1 to = 0, 1 /"//line// &
      & pin//'displacement_x = 0 displacement_y = 0 /'//line//relaxed, 'several pieces')

  contains

    !> Neither preparing nor running may accept it.
    subroutine refuse(text, part)
      character(*), intent(in) :: text, part
      type(scene_type) :: scene
      type(set_up_type) :: set_up
      type(diary_type) :: diary
      type(fault_type), allocatable :: fault

      call expect_scene(error, text, scene)
      if (allocated(error)) return
      call prepare(scene, set_up, fault)
      if (.not. allocated(fault) .and. scene%time%method == 'relaxation') &
        & call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
      call expect_true(error, allocated(fault), 'accepted: '//part)
      if (allocated(error)) return
      call expect_true(error, index(fault%message, part) > 0, part//' is not in: '//fault%message)
      call expect_true(error, fault%status == status_input, 'status')
    end subroutine refuse
  end subroutine test_refused

end module test_motion_pins
