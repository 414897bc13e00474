!> Elastic-plastic bodies that move, against the classical theory: a bar in tension and back, a
!> twisted bar, a bar that is hit.
!>
!> Bonds have the influence function 1 - |xi|/delta, with which a lattice of three spacings to the
!> horizon has the moduli and the yield stress to 1 %. Skins are stiffer, as in any linear
!> peridynamic solid without a correction: forces and moments of a bar of 8 points by 8 are larger
!> by 7 to 17 %, which the elastic bar shows, too. So stress is taken on the axis.
module test_motion_plastic
  use pd_base_kinds, only: i8, wp
  use pd_base_error, only: fault_type => error_type
  use pd_force_generic_points, only: generic_point_dilatation, generic_point_energy
  use pd_set_up_move, only: move
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_observer, only: instant_type, observer_type
  use pd_motion_account, only: account, energies_of, energies_type
  use pd_motion_system, only: evaluate, system_type
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: scene_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: at_point, box_scene, diary_type, expect, expect_true, prepare_run, ready, &
    & shake, youngs_modulus
  implicit none (type, external)
  private
  public :: collect_motion_plastic

  real(wp), parameter :: spacing = 1.0e-3_wp
  integer, parameter :: width = 8                      !! of a bar, in points
  real(wp), parameter :: side = width*spacing
  real(wp), parameter :: nu = 0.3_wp
  real(wp), parameter :: mu = youngs_modulus/(2*(1 + nu)), kappa = youngs_modulus/(3*(1 - 2*nu))
  real(wp), parameter :: yield_stress = 250.0e6_wp
  character(*), parameter :: line = new_line('a')

  !> What is seen of a bar along x at each load step.
  type, extends(observer_type) :: watch_type
    integer :: n = 0
    real(wp), allocatable :: strain(:)      !! on the axis, over 5 spacings [-]
    real(wp), allocatable :: equivalent(:)  !! stress on the axis, from energy and dilatation [Pa]
    real(wp), allocatable :: mean(:)        !! 3 kappa theta there [Pa]
    real(wp), allocatable :: twist(:)       !! about x [1/m]
    real(wp), allocatable :: force(:)       !! of the boundaries at the right end [N]
    real(wp), allocatable :: moment(:)      !! about x [N m]
    real(wp), allocatable :: off(:)         !! strain and dissipated energy less work [J]
    real(wp), allocatable :: work(:)        !! [J]
    real(wp), allocatable :: plastic(:)     !! energy [J]
  contains
    procedure :: observe
  end type watch_type

contains

  subroutine collect_motion_plastic(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('long: a bar yields, hardens, unloads and yields back', test_bar), &
      & new_unittest('long: a bar is twisted until all of it yields', test_torsion), &
      & new_unittest('a bar that is hit keeps its energy', test_hit), &
      & new_unittest('long: the balance closes at second order while a bar yields and breaks', &
      & test_torn), &
      & new_unittest('forces balance after flow, and wait for the commit', test_balance), &
      & new_unittest('scenes that cannot have it', test_refused)]
  end subroutine collect_motion_plastic

  !> A bar along x about the origin of its section.
  subroutine bar(length, hardening, scene)
    integer, intent(in) :: length  !! in points
    real(wp), intent(in) :: hardening
    type(scene_type), intent(out) :: scene

    call box_scene([length, width, width], spacing, nu, scene)
    scene%bodies(1)%lower(2:) = -side/2
    scene%bodies(1)%upper(2:) = side/2
    scene%materials(1)%model = 'lps_plastic'
    scene%materials(1)%influence = 'linear'
    allocate (scene%materials(1)%parameters(2))
    scene%materials(1)%parameters%name = ['yield_stress', 'hardening   ']
    scene%materials(1)%parameters%value = [yield_stress, hardening]
    scene%horizon%dilatation = 'unprojected'
    scene%time%method = 'relaxation'
    deallocate (scene%regions, scene%boundaries)
  end subroutine bar

  !> Three columns at an end of a bar, all of them or at one place of the section.
  subroutine clamp(scene, n, right, place)
    type(scene_type), intent(inout) :: scene
    integer, intent(in) :: n               !! number of the region and boundary
    logical, intent(in) :: right
    real(wp), intent(in), optional :: place(2)  !! y, z [m]

    associate (region => scene%regions(n), boundary => scene%boundaries(n))
      write (region%name, '(a, i0)') 'clamp', n
      region%shape = 'box'
      region%lower = [merge(scene%bodies(1)%upper(1) - 3*spacing, 0.0_wp, right), -side, -side]
      region%upper = [merge(scene%bodies(1)%upper(1), 3*spacing, right), side, side]
      if (present(place)) then
        region%lower(2:) = place - 0.4_wp*spacing
        region%upper(2:) = place + 0.4_wp*spacing
      end if
      boundary%region = region%name
      boundary%name = region%name
    end associate
  end subroutine clamp

  subroutine observe(observer, system, instant, error)
    class(watch_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error
    type(energies_type) :: energies
    real(wp) :: middle, theta, W, force, moment, x(3), f(3)
    integer :: a, b, m, i, k

    if (allocated(error) .or. .not. instant%settled .or. instant%load_step == 0) return
    if (observer%n == 0) then
      allocate (observer%strain(0), observer%equivalent(0), observer%mean(0), observer%twist(0), &
        & observer%force(0), observer%moment(0), observer%off(0), observer%work(0), &
        & observer%plastic(0))
    end if
    observer%n = observer%n + 1
    middle = (maxval(system%body%x(:, 1), system%body%point > 0) &
      & + minval(system%body%x(:, 1), system%body%point > 0))/2
    associate (u => system%state%u, laws => system%workspace%generic)
      a = at_point(system%body, [middle - 2.5_wp*spacing, 0.5_wp*spacing, 0.5_wp*spacing])
      b = at_point(system%body, [middle + 2.5_wp*spacing, 0.5_wp*spacing, 0.5_wp*spacing])
      observer%strain = [observer%strain, (u(b, 1) - u(a, 1))/(5*spacing)]
      a = at_point(system%body, [middle - 2.5_wp*spacing, 1.5_wp*spacing, 0.5_wp*spacing])
      b = at_point(system%body, [middle + 2.5_wp*spacing, 1.5_wp*spacing, 0.5_wp*spacing])
      observer%twist = [observer%twist, (u(b, 3) - u(a, 3))/(5*1.5_wp*spacing**2)]
      k = at_point(system%body, [middle + 0.5_wp*spacing, 0.5_wp*spacing, 0.5_wp*spacing])
      theta = generic_point_dilatation(system%family, system%model, laws, u, k)
      W = generic_point_energy(system%family, system%model, laws, u, k)
      observer%mean = [observer%mean, 3*kappa*theta]
      ! W = kappa theta^2/2 + sigma_eq^2/(6 mu)
      observer%equivalent = [observer%equivalent, sqrt(6*mu*max(0.0_wp, W - kappa*theta**2/2))]
    end associate
    force = 0.0_wp
    moment = 0.0_wp
    do m = 1, size(system%motions)
      x = 0.0_wp
      associate (slots => system%motions(m)%slots)
        do i = 1, size(slots)
          x = x + system%body%x(slots(i), :)/size(slots)
        end do
      end associate
      if (x(1) < middle) cycle
      f = system%motions(m)%reaction
      force = force + f(1)
      moment = moment + x(2)*f(3) - x(3)*f(2)
    end do
    observer%force = [observer%force, force]
    observer%moment = [observer%moment, moment]
    call energies_of(system, system%state%v, energies)
    observer%off = [observer%off, energies%strain + system%dissipated - system%external_work]
    observer%work = [observer%work, system%external_work]
    observer%plastic = [observer%plastic, system%plastic_energy]
  end subroutine observe

  !> Find the equilibria of a scene.
  subroutine relax(scene, set_up, watch, error)
    type(scene_type), intent(in) :: scene
    type(set_up_type), intent(inout) :: set_up
    type(watch_type), intent(out) :: watch
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    call ready(scene, set_up, error)
    if (allocated(error)) return
    call move(set_up%system, set_up%plan, watch, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine relax

  !> Tension to three times the strain of yield and more than as much back. On the axis the stress
  !> follows the classical law in one dimension with isotropic hardening, at the strain that is
  !> measured there: to 2 % of the yield stress, and to 5 % in what it hardens by. It is a tension:
  !> 3 kappa theta, the sum of the normal stresses, is the stress along x, to the lateral stresses
  !> of a few per cent that the skins exert. Unloading has the stiffness of loading to 1 %. The
  !> balance of energies has the error of the trapezoidal rule for the work over a load step, in
  !> which lengths change by 1e-3 of themselves.
  subroutine test_bar(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: hardening = youngs_modulus/10
    real(wp), parameter :: course(*) = [0.2_wp, 0.4_wp, 0.7_wp, 1.0_wp, 0.9_wp, 0.4_wp, 0.0_wp, &
      & -0.2_wp]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(watch_type) :: watch
    real(wp) :: stress, equivalent, over, first, step
    integer :: i

    call bar(28, hardening, scene)
    allocate (scene%regions(2), scene%boundaries(2))
    call clamp(scene, 1, .false.)
    call clamp(scene, 2, .true.)
    scene%boundaries(1)%displacement(1) = 0.0_wp
    scene%boundaries(2)%displacement(1) = 3.5_wp*yield_stress/youngs_modulus*22*spacing
    scene%boundaries(2)%times = [0.0_wp, (real(i, wp)/size(course), i=1, size(course))]
    scene%boundaries(2)%values = [0.0_wp, course]
    scene%relaxation%load_steps = size(course)
    call relax(scene, set_up, watch, error)
    if (allocated(error)) return
    call expect_true(error, watch%n == size(course), 'load steps')
    stress = 0.0_wp
    equivalent = 0.0_wp
    first = 0.0_wp
    do i = 1, watch%n
      step = watch%strain(i)
      if (i > 1) step = step - watch%strain(i - 1)
      stress = stress + youngs_modulus*step
      over = abs(stress) - yield_stress - hardening*equivalent
      if (over > 0.0_wp) then
        equivalent = equivalent + over/(youngs_modulus + hardening)
        stress = sign(yield_stress + hardening*equivalent, stress)
      end if
      if (i == 2) first = watch%equivalent(i)
      call expect(error, watch%equivalent(i), abs(stress), 0.02_wp*yield_stress, 'stress')
      call expect(error, watch%mean(i), stress, 0.1_wp*max(yield_stress, abs(stress)), &
        & 'sum of normal stresses')
      call expect(error, watch%off(i), 0.0_wp, 3.0e-4_wp*maxval(watch%work), 'balance')
    end do
    call expect(error, watch%equivalent(size(course)) - yield_stress, hardening*equivalent, &
      & 0.05_wp*hardening*equivalent, 'hardening')
    call expect_true(error, equivalent > 3.0e-3_wp .and. stress < 0.0_wp, 'the path hardly flows')
    call expect_true(error, first > yield_stress, 'it yields late')
    ! step 5 unloads
    call expect(error, (watch%force(5) - watch%force(4))/(watch%strain(5) - watch%strain(4)), &
      & watch%force(1)/watch%strain(1), 0.01_wp*watch%force(1)/watch%strain(1), 'unloading')
    call expect_close(error, watch%plastic(5:5), watch%plastic(4:4), 1.0e-6_wp*watch%work(4), &
      & 'plastic energy of unloading')
    call expect_true(error, watch%plastic(8) > 1.2_wp*watch%plastic(6), &
      & 'it does not yield backwards')
  end subroutine test_bar

  !> The ends of a square bar are turned against each other, free to warp. The moment is
  !> 0.1406 mu a^4 times the twist before it yields (Timoshenko and Goodier, Theory of Elasticity)
  !> and tau a^3/3, tau = yield stress/sqrt 3, when all of it does (Nadai's sand heap: twice the
  !> volume under a roof of slope tau). The skins make both larger: by 7 and by 12 %; 15 % is asked
  !> for. Beyond that the moment does not grow, and it falls as steeply as it rose.
  subroutine test_torsion(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: course(*) = [0.2_wp, 0.5_wp, 0.8_wp, 1.0_wp, 0.8_wp]
    real(wp), parameter :: angle = 0.016_wp, full = yield_stress/sqrt(3.0_wp)*side**3/3
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(watch_type) :: watch
    real(wp) :: y, z, slope
    integer :: i, j, e, m, n

    call bar(18, 0.0_wp, scene)
    allocate (scene%regions(2*width**2), scene%boundaries(2*width**2))
    n = 0
    do e = 1, 2
      do j = 1, width
        do i = 1, width
          n = n + 1
          y = (i - 0.5_wp)*spacing - side/2
          z = (j - 0.5_wp)*spacing - side/2
          call clamp(scene, n, e == 2, [y, z])
          associate (boundary => scene%boundaries(n))
            boundary%displacement(2:) = merge(0.5_wp, -0.5_wp, e == 2)*angle*[-z, y]
            boundary%times = [0.0_wp, (real(m, wp)/size(course), m=1, size(course))]
            boundary%values = [0.0_wp, course]
          end associate
          if (e == 1 .and. i == width/2 .and. j == width/2) &
            & scene%boundaries(n)%displacement(1) = 0.0_wp
        end do
      end do
    end do
    scene%relaxation%load_steps = size(course)
    call relax(scene, set_up, watch, error)
    if (allocated(error)) return
    call expect_true(error, watch%n == size(course), 'load steps')
    associate (T => watch%moment, twist => watch%twist)
      slope = T(1)/twist(1)
      call expect(error, slope, 0.1406_wp*mu*side**4, 0.15_wp*0.1406_wp*mu*side**4, 'elastic')
      call expect(error, T(4), full, 0.15_wp*full, 'plastic')
      call expect_true(error, T(4) >= T(3) .and. T(4) <= 1.02_wp*T(3), 'it goes on to grow')
      call expect(error, (T(5) - T(4))/(twist(5) - twist(4)), slope, 0.01_wp*slope, 'unloading')
    end associate
    call expect_close(error, watch%off, 0.0_wp, 1.0e-4_wp*watch%work(4), 'balance')
  end subroutine test_torsion

  !> The halves of a bar run into each other, their ends at 40 m/s, six times what makes a bar yield
  !> (yield stress over density and speed of sound): the kinetic energy goes into strain and flow,
  !> and the sum stays, to 3e-4 of the energy.
  subroutine test_hit(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    integer :: k

    call bar(16, youngs_modulus/50, scene)
    allocate (scene%regions(0), scene%boundaries(0))
    scene%time%method = 'explicit'
    scene%time%integrator = 'velocity_verlet'
    scene%time%safety = 0.25_wp
    scene%time%steps = 200
    call ready(scene, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      do k = 1, system%body%n_slots
        if (system%body%point(k) == 0) cycle
        system%state%v(k, 1) = 40*(1 - system%body%x(k, 1)/(8*spacing))
      end do
      call move(system, set_up%plan, diary, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      if (allocated(error)) return
      call expect_close(error, diary%kinetic + diary%strain + diary%dissipated, diary%kinetic(1), &
        & 3.0e-4_wp*diary%kinetic(1), 'energy')
      call expect(error, system%plastic_energy, system%dissipated, 0.0_wp, 'plastic energy')
      call expect_true(error, system%plastic_energy > 0.2_wp*diary%kinetic(1), 'it hardly flows')
      call expect_true(error, all(diary%dissipated(2:) >= diary%dissipated(:diary%n - 1)), &
        & 'flow gives energy back')
    end associate
  end subroutine test_hit

  !> The halves of a bar run apart, its ends at 40 m/s, until it has yielded and bonds break. What
  !> is missing in the balance falls with the square of the step, whether bonds break before or
  !> after the forces: 0.1 % of what is dissipated is allowed with steps of 80 ns, and a quarter of
  !> that with each half of the step. With what bonds hold at one instant, not the product of two,
  !> 0.4 to 1.7 % were missing, and as much with a quarter of the step.
  subroutine test_torn(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: breaking(*) = [character(13) :: 'before_forces', 'after_forces']
    character(*), parameter :: model(*) = [character(17) :: 'lps_plastic', 'lps_plastic_large']
    real(wp), parameter :: duration = 4.8e-6_wp, allowed = 1.0e-3_wp
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: gap
    integer :: i, k, n, b, law

    do law = 1, size(model)
      do b = 1, size(breaking)
        do i = 0, 2
          call bar(10, youngs_modulus/50, scene)
          allocate (scene%regions(0), scene%boundaries(0))
          scene%materials(1)%model = model(law)
          scene%materials(1)%critical_stretch = 0.01_wp
          scene%time%method = 'explicit'
          scene%time%integrator = 'velocity_verlet'
          scene%time%breaking = breaking(b)
          scene%time%steps = 60*2**i
          scene%time%step = duration/scene%time%steps
          call ready(scene, set_up, error)
          if (allocated(error)) return
          diary = diary_type(every=scene%time%steps)
          associate (system => set_up%system)
            do k = 1, system%body%n_slots
              if (system%body%point(k) == 0) cycle
              system%state%v(k, 1) = 40*(system%body%x(k, 1)/(5*spacing) - 1)
            end do
            call move(system, set_up%plan, diary, fault)
            if (allocated(fault)) call test_failed(error, fault%message)
            if (allocated(error)) return
            n = diary%n
            gap = (diary%kinetic(n) + diary%strain(n) + diary%dissipated(n) - diary%kinetic(1)) &
              & /diary%dissipated(n)
            call expect_close(error, gap, 0.0_wp, allowed/4**i, 'balance with '// &
              & trim(model(law))//', bonds that break '//trim(breaking(b)))
            call expect_true(error, system%broken > 500_i8, 'hardly a bond breaks')
            call expect_true(error, system%plastic_energy > 0.1_wp*diary%dissipated(n), &
              & 'it hardly flows')
          end associate
        end do
      end do
    end do
  end subroutine test_torn

  !> A body in any state, after flow and a commit and after more of it: the sums of the forces and
  !> of their moments are 0, since both ends of a bond pull alike. Forces at a state do not depend
  !> on what was tried before, until a step is accepted.
  subroutine test_balance(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: force(:, :), u(:, :)
    real(wp) :: gradient(3, 3), net(3), moment(3), sizes, y(3), f(3)
    integer :: i, k

    call bar(6, youngs_modulus/50, scene)
    allocate (scene%regions(0), scene%boundaries(0))
    call ready(scene, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      gradient = 0.0_wp
      do i = 1, 3
        gradient(1, 2) = 0.01_wp*i
        call shake(system%body, gradient, 1.0e-2_wp*spacing, 20 + i, system%state%u)
        call evaluate(system, 0.0_wp, breaking=.false.)
        force = system%state%force
        u = system%state%u
        system%state%u = -5*u
        call evaluate(system, 0.0_wp, breaking=.false.)
        system%state%u = u
        call evaluate(system, 0.0_wp, breaking=.false.)
        call expect_close(error, system%state%force, force, 0.0_wp, 'forces after a trial')
        net = 0.0_wp
        moment = 0.0_wp
        sizes = 0.0_wp
        do k = 1, system%body%n_slots
          if (system%body%point(k) == 0) cycle
          y = system%body%x(k, :) + system%state%u(k, :)
          f = system%state%force(k, :)*system%body%volume(k)
          net = net + f
          moment = moment + [y(2)*f(3) - y(3)*f(2), y(3)*f(1) - y(1)*f(3), y(1)*f(2) - y(2)*f(1)]
          sizes = sizes + sum(abs(f))
        end do
        call expect_close(error, net, 0.0_wp, 1.0e-13_wp*sizes, 'net force')
        call expect_close(error, moment, 0.0_wp, 1.0e-13_wp*sizes*side, 'net moment')
        system%static = .true.
        call account(system, real(i, wp))
        call evaluate(system, 0.0_wp, breaking=.false.)
        call expect_close(error, system%state%force, force, 1.0e-11_wp*max_abs(force), &
          & 'forces after the commit')
      end do
      call expect_true(error, system%plastic_energy > 0.0_wp, 'nothing flows')
    end associate
  end subroutine test_balance

  !> What a scene says that cannot have the law.
  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error

    call refuse(error, 2, "model = 'lps_plastic' yield_stress = 1.0e6", 'dimension = 3')
    call refuse(error, 3, "model = 'lps_plastic'", "lacks the key 'yield_stress'")
    call refuse(error, 3, "model = 'lps' yield_stress = 1.0e6", "no key of model = 'lps'")
    call refuse(error, 3, "model = 'lps_plastic' yield_stress = 0.0", 'yield_stress')
    call refuse(error, 3, "model = 'lps_plastic' yield_stress = 1.0 hardening = -1.0", 'hardening')
  end subroutine test_refused

  !> Fail unless a scene with this material is refused for this reason.
  subroutine refuse(error, dim, material, reason)
    type(error_type), allocatable, intent(inout) :: error
    integer, intent(in) :: dim
    character(*), intent(in) :: material, reason
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    character(1) :: number

    if (allocated(error)) return
    number = merge('2', '3', dim == 2)
    call read_scene_text('&scene dimension = '//number//' /'//line//'&body lower = '//number// &
      & '*0 upper = '//number//'*4 points = '//number//'*4 /'//line//'&material '//material// &
      & " youngs_modulus = 1.0e9 poissons_ratio = 0.3 density = 1.0 /"//line// &
      & "&horizon surface_correction = 'none' /"//line//'&time steps = 1 /'//line, &
      & 'scene.nml', scene, fault)
    if (.not. allocated(fault)) call prepare_run(scene, set_up, fault)
    if (.not. allocated(fault)) then
      call test_failed(error, 'accepted: '//material)
    else if (index(fault%message, reason) == 0) then
      call test_failed(error, fault%message)
    end if
  end subroutine refuse

end module test_motion_plastic
