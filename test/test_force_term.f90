!> Terms of the force in motion, and the list that sums them: time step, energy balance and restart
!> of bodies with terms that only tests know (`force_terms`), compared with closed forms.
module test_force_term
  use omp_lib, only: omp_set_num_threads
  use pd_base_error, only: fault_type => error_type, status_no_answer
  use pd_base_kinds, only: wp
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_force_bonds, only: bond_term_type
  use pd_force_forces, only: after_marks, up_to_marks
  use pd_force_model, only: options_of
  use pd_force_reference, only: point_force
  use pd_force_tangent, only: central, tangent_type
  use pd_force_term, only: term_view_type, no_stiffness
  use pd_force_terms, only: term_list_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_keep, only: keep_system
  use pd_motion_loads, only: other_terms
  use pd_motion_system, only: ask_bonds, system_type, view_of
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: set_up_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: at_point, box_scene, density_of_steel, diary_type, expect, expect_true, shake
  use force_terms, only: spacing, integrators, no_gradient, friction_type, wind_type, &
    & keeper_type, ground, dashpot, ready_with, plate_with, push, run, bare_limit, two_boxes, &
    & link, all_terms, shaken, same_bits
  implicit none (type, external)
  private
  public :: collect_force_term

contains

  subroutine collect_force_term(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a body on springs vibrates as leapfrog''s formula says', test_frequency), &
      & new_unittest('every integrator converges to the vibration', test_orders), &
      & new_unittest('dashpots damp as the discrete equation predicts', test_damping), &
      & new_unittest('friction dissipates yield times slip', test_friction), &
      & new_unittest('the step is stable up to the limit and not beyond', test_step), &
      & new_unittest('the limit from the largest frequency includes terms', test_spectral_step), &
      & new_unittest('a link keeps momentum and energy', test_link), &
      & new_unittest('an external term is a load', test_external), &
      & new_unittest('a restart has the same bits', test_restart), &
      & new_unittest('the same bits on any number of threads', test_threads), &
      & new_unittest('a list sums its terms', test_list), &
      & new_unittest('the bonds are the first term of a system', test_bonds)]
  end subroutine collect_force_term

  !> All points move alike, u_n = A cos(n phi) with sin(phi/2) = omega dt/2, omega^2 = s/rho, and
  !> the kinetic and stored energy at t_n are (s A^2 V/2) (1 - sin(phi/2)^2 sin(n phi)^2): to
  !> rounding, which n steps add up.
  subroutine test_frequency(error)
    type(error_type), allocatable, intent(out) :: error
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp), parameter :: amplitude = 0.01_wp*spacing
    integer, parameter :: steps = 200
    real(wp) :: dt, omega, phi, volume, whole
    integer :: n, i

    do i = 1, 2
      dt = 0.5_wp*bare_limit(error)
      if (allocated(error)) return
      omega = 0.6_wp/dt
      terms = term_list_type()
      call terms%add(ground(density_of_steel*omega**2))
      call plate_with(terms, set_up, error)
      if (allocated(error)) return
      call push(set_up%system, amplitude)
      diary = diary_type()
      diary%slot = at_point(set_up%system%body, [2*spacing, spacing])
      call run(set_up%system, trim(integrators(i)), dt, steps, diary, error)
      if (allocated(error)) return
      phi = 2*asin(omega*dt/2)
      volume = sum(set_up%system%body%volume, mask=set_up%system%body%point > 0)
      whole = density_of_steel*omega**2*amplitude**2*volume/2
      call expect_true(error, diary%n == steps + 1, 'rows of the diary')
      do n = 0, steps
        call expect(error, diary%u(1, n + 1)/amplitude, cos(n*phi), 1.0e-11_wp, 'displacement')
        call expect(error, (diary%kinetic(n + 1) + diary%strain(n + 1))/whole, &
          & 1 - (sin(phi/2)*sin(n*phi))**2, 1.0e-11_wp, 'energy')
      end do
      call expect_close(error, abs(diary%work) + abs(diary%dissipated), 0.0_wp, 0.0_wp, &
        & 'springs to the ground do no work and lose nothing')
    end do
  end subroutine test_frequency

  !> A cos(omega t) is met to the order of each integrator: halving the step divides the error, the
  !> largest of all steps.
  subroutine test_orders(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: orders(*) = [2.0_wp, 2.0_wp, 3.0_wp, 2.0_wp, 4.0_wp]
    real(wp), parameter :: amplitude = 0.01_wp*spacing
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: dt, omega, off(2)
    integer :: i, r, steps

    dt = 0.2_wp*bare_limit(error)
    if (allocated(error)) return
    omega = 0.2_wp/dt
    call terms%add(ground(density_of_steel*omega**2))
    do i = 1, size(integrators)
      do r = 1, 2
        steps = 40*2**(r - 1)
        call plate_with(terms, set_up, error)
        if (allocated(error)) return
        call push(set_up%system, amplitude)
        diary = diary_type()
        diary%slot = at_point(set_up%system%body, [2*spacing, spacing])
        call run(set_up%system, trim(integrators(i)), dt/2**(r - 1), steps, diary, error)
        if (allocated(error)) return
        off(r) = max_abs(diary%u(1, :)/amplitude - cos(omega*diary%time))
      end do
      call expect(error, log(off(1)/off(2))/log(2.0_wp), orders(i), 0.2_wp, 'order of '// &
        & trim(integrators(i)))
    end do
  end subroutine test_orders

  !> With forces from the velocities of half a step before, u_n obeys
  !> u_{n+1} - (2 - r - k) u_n + (1 - r) u_{n-1} = 0, r = c dt/rho, k = (omega dt)^2, from
  !> u_1 = (1 - k/2) u_0. Energy: what is lost is what dashpots took, to k/4 of the whole, by which
  !> rho v_{n+1/2}^2/2 + s u_n u_{n+1}/2 differs at the start, what leapfrog keeps without dashpots:
  !> that loses what they take to the last digit.
  subroutine test_damping(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: amplitude = 0.01_wp*spacing, r = 0.05_wp, k = 0.04_wp
    integer, parameter :: steps = 150
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: dt, u(0:steps), volume, whole
    integer :: n

    dt = 0.4_wp*bare_limit(error)
    if (allocated(error)) return
    call terms%add(ground(density_of_steel*k/dt**2))
    call terms%add(dashpot(density_of_steel*r/dt))
    call plate_with(terms, set_up, error)
    if (allocated(error)) return
    call push(set_up%system, amplitude)
    diary%slot = at_point(set_up%system%body, [2*spacing, spacing])
    call run(set_up%system, 'forward_backward', dt, steps, diary, error)
    if (allocated(error)) return
    u(0) = 1.0_wp
    u(1) = 1 - k/2
    do n = 1, steps - 1
      u(n + 1) = (2 - r - k)*u(n) - (1 - r)*u(n - 1)
    end do
    call expect_close(error, diary%u(1, :)/amplitude, u, 1.0e-11_wp, 'damped swing')
    call expect_true(error, max_abs(u(steps - 20:)) < 0.05_wp, 'it should be damped')
    volume = sum(set_up%system%body%volume, mask=set_up%system%body%point > 0)
    whole = density_of_steel*k/dt**2*amplitude**2*volume/2
    call expect_close(error, (diary%kinetic + diary%strain + diary%dissipated)/whole, 1.0_wp, &
      & k/4*1.1_wp, 'energy balance')
    call expect(error, diary%dissipated(diary%n)/whole, 1 - k/4, 6.0e-4_wp, &
      & 'dissipated in the end')
  end subroutine test_damping

  !> A body that flies against friction until that holds it has lost yield times the way that the
  !> springs slipped: rho v^2/2 less yield^2/(2 s), a sixteenth of it here, which they store. Where
  !> they begin to slip the trapezoidal rule errs by s (v dt)^2/8 at most, 1e-4 of the whole.
  subroutine test_friction(error)
    type(error_type), allocatable, intent(out) :: error
    type(friction_type) :: friction
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: dt, volume, speed, begin, slipped
    integer :: slot

    dt = 0.2_wp*bare_limit(error)
    if (allocated(error)) return
    speed = 1.0_wp
    friction%name = 'friction'
    friction%conservative = .false.
    friction%s = density_of_steel*(0.02_wp/dt)**2
    ! it stops after some 200 steps
    friction%yield = density_of_steel*speed/(200*dt)
    call terms%add(friction)
    call plate_with(terms, set_up, error)
    if (allocated(error)) return
    where (set_up%system%body%point > 0) set_up%system%state%v(:, 1) = speed
    slot = at_point(set_up%system%body, [2*spacing, spacing])
    diary%slot = slot
    call run(set_up%system, 'forward_backward', dt, 260, diary, error)
    if (allocated(error)) return
    volume = sum(set_up%system%body%volume, mask=set_up%system%body%point > 0)
    begin = density_of_steel*speed**2*volume/2
    select type (term => set_up%system%terms%items(2)%term)
    type is (friction_type)
      slipped = term%slip(slot, 1)
    class default
      call test_failed(error, 'the term has become another one')
      return
    end select
    call expect(error, slipped/(density_of_steel*speed**2/(2*friction%yield)), 15.0_wp/16, &
      & 1.0e-3_wp, 'slip')
    call expect(error, diary%dissipated(diary%n)/begin, friction%yield*slipped*volume/begin, &
      & 2.0e-4_wp, 'dissipated')
    call expect_close(error, (diary%kinetic + diary%strain + diary%dissipated)/begin, 1.0_wp, &
      & 2.0e-4_wp, 'energy balance')
  end subroutine test_friction

  !> Springs far stiffer than the bonds, with dashpots and without: the limit is below the exact
  !> one by no more than the bonds' part, just below it the body swings, just above it it flies off.
  subroutine test_step(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: amplitude = 1.0e-6_wp*spacing
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: bare, omega, rate, exact
    integer :: i

    bare = bare_limit(error)
    if (allocated(error)) return
    omega = 2*20/bare
    do i = 0, 1
      rate = i*omega
      terms = term_list_type()
      call terms%add(ground(density_of_steel*omega**2))
      if (i == 1) call terms%add(dashpot(density_of_steel*rate))
      call plate_with(terms, set_up, error)
      if (allocated(error)) return
      ! (omega dt/2)^2 + rate dt/2 = 1
      exact = (sqrt(rate**2/4 + omega**2) - rate/2)*2/omega**2
      call expect(error, set_up%plan%limit/exact, 1.0_wp, 2.0e-3_wp, 'stable step')
      call expect_true(error, set_up%plan%limit <= exact, 'the limit is beyond the stable step')
      call push(set_up%system, amplitude)
      call run(set_up%system, 'forward_backward', 0.999_wp*set_up%plan%limit, 3000, diary, error)
      if (allocated(error)) return
      call expect_true(error, max_abs(set_up%system%state%u) <= 40*amplitude, &
        & 'just below the limit')
      call push(set_up%system, amplitude)
      diary = diary_type()
      diary%every = 100000
      call run_explicit(set_up%system, 'forward_backward', 1.01_wp*exact, 3000, diary, fault)
      call expect_true(error, allocated(fault), 'no fault just above the limit')
      if (allocated(error)) return
      call expect_true(error, fault%status == status_no_answer, fault%message)
    end do
    ! pure damping decides about the others
    do i = 1, size(integrators)
      terms = term_list_type()
      call terms%add(dashpot(density_of_steel*100/bare))
      call damped_plate(trim(integrators(i)), terms, set_up, error)
      if (allocated(error)) return
      where (set_up%system%body%point > 0) set_up%system%state%v(:, 1) = 1.0_wp
      diary = diary_type()
      call run(set_up%system, trim(integrators(i)), set_up%plan%limit, 300, diary, error)
      if (allocated(error)) return
      call expect_true(error, diary%kinetic(diary%n) <= 1.0e-3_wp*diary%kinetic(1), &
        & trim(integrators(i))//' does not damp at the stable step')
      call expect_true(error, set_up%plan%limit > 0.4_wp*bare/100, &
        & trim(integrators(i))//': the limit is far from the stable step')
    end do
  end subroutine test_step

  !> A plate for one integrator.
  subroutine damped_plate(integrator, terms, set_up, error)
    character(*), intent(in) :: integrator
    type(term_list_type), intent(in) :: terms
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene

    call box_scene([5, 4], spacing, 0.2_wp, scene)
    scene%time%integrator = integrator
    call ready_with(scene, terms, set_up, error)
  end subroutine damped_plate

  !> 4/dt^2 of the limit is the bonds' largest omega^2 plus what the terms add: s/rho.
  subroutine test_spectral_step(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(term_list_type) :: terms, none
    type(set_up_type) :: set_up
    real(wp) :: bare, s

    call box_scene([5, 4], spacing, 0.2_wp, scene)
    scene%time%limit = 'spectral'
    call ready_with(scene, none, set_up, error)
    if (allocated(error)) return
    call expect_true(error, set_up%plan%spectral, 'the limit is not from the largest frequency')
    bare = set_up%plan%limit
    s = density_of_steel*(2/bare)**2
    call terms%add(ground(s))
    call ready_with(scene, terms, set_up, error)
    if (allocated(error)) return
    call expect(error, (bare/set_up%plan%limit)**2, 2.0_wp, 1.0e-12_wp, 'omega^2')
  end subroutine test_spectral_step

  !> Two bodies out of each other's reach with a link between points at their middles: the sum of
  !> momenta stays as it was to rounding, each one's changes, and the energy stays to the
  !> integrator's error.
  subroutine test_link(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: before, after, of_one, mass
    logical, allocatable :: first(:)
    real(wp), parameter :: speed = 1.0_wp

    call two_boxes(scene)
    call terms%add(link(1.0e6_wp))
    call ready_with(scene, terms, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      first = system%body%body == 1 .and. system%body%point > 0
      where (first) system%state%v(:, 1) = speed
      mass = density_of_steel*sum(system%body%volume, mask=first)
      before = momentum(system)
      call run(system, 'forward_backward', 0.5_wp*set_up%plan%limit, 400, diary, error)
      if (allocated(error)) return
      after = momentum(system)
      of_one = density_of_steel*sum(system%body%volume*system%state%v(:, 1), mask=first)
    end associate
    call expect(error, before/(mass*speed), 1.0_wp, 1.0e-12_wp, 'momentum at the start')
    call expect(error, after/before, 1.0_wp, 1.0e-12_wp, 'momentum at the end')
    call expect_true(error, of_one < 0.9_wp*mass*speed, 'the link did not pull')
    call expect_close(error, (diary%kinetic + diary%strain)/diary%kinetic(1), 1.0_wp, 2.0e-2_wp, &
      & 'energy')
    call expect_true(error, maxval(diary%strain) > 0.05_wp*diary%kinetic(1), 'nothing is stored')
  end subroutine test_link

  !> Momentum along x [kg m/s].
  pure real(wp) function momentum(system)
    type(system_type), intent(in) :: system
    momentum = density_of_steel*sum(system%body%volume*system%state%v(:, 1), &
      & mask=system%body%point > 0)
  end function momentum

  !> The motion under an external term, and its work, are those under a &load with the same force
  !> density, held points and all; the internal forces do not contain it.
  subroutine test_external(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(term_list_type) :: terms, none
    type(wind_type) :: wind
    type(set_up_type) :: blown, loaded
    type(diary_type) :: diary, other
    integer, parameter :: steps = 100
    real(wp) :: dt, scale
    integer :: i

    call box_scene([5, 4], spacing, 0.2_wp, scene)
    deallocate (scene%boundaries)
    allocate (scene%boundaries(1))
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%velocity(:2) = [3.0_wp, 0.0_wp]
    wind%name = 'wind'
    wind%external = .true.
    wind%tangent = no_stiffness
    wind%b = [1.0e12_wp, -2.0e11_wp, 0.0_wp]
    do i = 1, size(integrators)
      terms = term_list_type()
      call ready_with(scene, none, loaded, error)
      if (allocated(error)) return
      dt = 0.3_wp*loaded%plan%limit
      wind%ramp = 50*dt
      call terms%add(wind)
      call ready_with(scene, terms, blown, error)
      deallocate (scene%loads)
      allocate (scene%loads(1))
      scene%loads(1)%body_force(:2) = wind%b(:2)
      scene%loads(1)%ramp_time = wind%ramp
      call ready_with(scene, none, loaded, error)
      deallocate (scene%loads)
      allocate (scene%loads(0))
      if (allocated(error)) return
      diary = diary_type()
      other = diary_type()
      call run(blown%system, trim(integrators(i)), dt, steps, diary, error)
      call run(loaded%system, trim(integrators(i)), dt, steps, other, error)
      if (allocated(error)) return
      scale = max_abs(loaded%system%state%u)
      ! the load leaves out the boundary layer, the wind does not: they are held
      call expect_close(error, blown%system%state%u, loaded%system%state%u, 1.0e-12_wp*scale, &
        & trim(integrators(i))//': displacements')
      call expect_close(error, blown%system%state%force, loaded%system%state%force, &
        & 1.0e-9_wp*max_abs(loaded%system%state%force), trim(integrators(i))//': internal force')
      call expect_true(error, diary%work(diary%n) > 0.0_wp, 'no work was done')
      call expect_close(error, diary%work, other%work, 1.0e-11_wp*other%work(other%n), &
        & trim(integrators(i))//': external work')
      call expect_close(error, diary%kinetic, other%kinetic, 1.0e-11_wp*other%work(other%n), &
        & trim(integrators(i))//': kinetic energy')
    end do
  end subroutine test_external

  !> A run that is kept at step 25, put into a system made anew, and goes on, has the bits of one
  !> that never stopped: displacements, forces, accounts, and the history of the term.
  subroutine test_restart(error)
    type(error_type), allocatable, intent(out) :: error
    type(term_list_type) :: terms
    type(set_up_type) :: whole, again
    type(keeper_type) :: keeper
    type(diary_type) :: diary, rest
    real(wp) :: dt
    integer :: i
    integer, parameter :: steps = 60

    dt = 0.4_wp*bare_limit(error)
    if (allocated(error)) return
    call all_terms(dt, terms)
    do i = 1, size(integrators)
      call plate_with(terms, whole, error)
      call plate_with(terms, again, error)
      if (allocated(error)) return
      call shaken(whole%system)
      call shaken(again%system)
      keeper%step = 25
      call run(again%system, trim(integrators(i)), dt, 40, keeper, error)
      call plate_with(terms, again, error)
      if (allocated(error)) return
      call keeper%snapshot%rewind(reading=.true.)
      call keep_system(keeper%snapshot, again%system)
      call expect_true(error, .not. allocated(keeper%snapshot%error), 'the state is not put back')
      call expect_true(error, again%system%memory%step == 25, 'step of the state put back')
      diary = diary_type()
      rest = diary_type()
      call run(whole%system, trim(integrators(i)), dt, steps, diary, error)
      call run(again%system, trim(integrators(i)), dt, steps, rest, error)
      if (allocated(error)) return
      call same_bits(whole%system, again%system, trim(integrators(i)), error)
      call expect_close(error, [diary%work(diary%n), diary%dissipated(diary%n), &
        & diary%strain(diary%n)], [rest%work(rest%n), rest%dissipated(rest%n), &
        & rest%strain(rest%n)], 0.0_wp, trim(integrators(i))//': accounts')
      call expect_true(error, diary%dissipated(diary%n) > 0.0_wp .and. &
        & abs(diary%work(diary%n)) > 0.0_wp, 'nothing was accounted')
    end do
  end subroutine test_restart

  !> On one thread and on three, over several blocks of sums.
  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(term_list_type) :: terms
    type(set_up_type) :: one, many
    type(diary_type) :: diary, other
    real(wp) :: dt

    dt = 0.4_wp*bare_limit(error)
    if (allocated(error)) return
    call all_terms(dt, terms)
    call box_scene([110, 50], spacing, 0.2_wp, scene)
    call ready_with(scene, terms, one, error)
    call ready_with(scene, terms, many, error)
    if (allocated(error)) return
    call shaken(one%system)
    call shaken(many%system)
    call omp_set_num_threads(1)
    call run(one%system, 'forward_backward', dt, 30, diary, error)
    call omp_set_num_threads(3)
    call run(many%system, 'forward_backward', dt, 30, other, error)
    call omp_set_num_threads(1)
    if (allocated(error)) return
    call same_bits(one%system, many%system, 'three threads', error)
    call expect_close(error, diary%work, other%work, 0.0_wp, 'work')
    call expect_close(error, diary%dissipated, other%dissipated, 0.0_wp, 'dissipated')
    call expect_close(error, diary%strain, other%strain, 0.0_wp, 'stored')
    call expect_close(error, diary%kinetic, other%kinetic, 0.0_wp, 'kinetic')
  end subroutine test_threads

  !> What a list says is the sum of what its terms say, external ones apart; a list in a list is
  !> its terms; and each line is there.
  subroutine test_list(error)
    type(error_type), allocatable, intent(out) :: error
    type(term_list_type) :: inner, terms
    type(wind_type) :: wind
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: bound(:)

    call inner%add(ground(3.0_wp))
    call inner%add(dashpot(2.0_wp))
    call terms%add(ground(4.0_wp, 1.0_wp, 0.0_wp))
    call terms%add(inner)
    wind%external = .true.
    wind%tangent = no_stiffness
    wind%b(1) = 1.0_wp
    call terms%add(wind)
    call expect_true(error, terms%number() == 4 .and. terms%inside == 3 .and. terms%outside == 1, &
      & 'numbers of terms')
    call expect_true(error, terms%describe() == 'springs to the ground that harden'// &
      & new_line('a')//'springs to the ground'//new_line('a')//'dashpots'//new_line('a')//'wind'// &
      & new_line('a'), 'the lines are: '//terms%describe())
    call expect_true(error, terms%without_tangent() == '', 'all have a tangent or need none')
    call box_scene([5, 4], spacing, 0.2_wp, scene)
    deallocate (scene%loads)
    allocate (scene%loads(1))
    scene%loads(1)%body_force(1) = 1.0_wp
    call ready_with(scene, terms, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      call expect_true(error, system%terms%number() == 6 .and. system%terms%outside == 2 &
        & .and. system%terms%bonds == 1, 'bonds and the load of the scene are terms, too')
      allocate (bound(system%body%n_slots), source=0.0_wp)
      call bounds(system, bound)
      call expect_close(error, pack(bound, system%body%point > 0), 7.0_wp, 1.0e-14_wp, 'bound')
      call expect_close(error, pack(bound, system%body%point == 0), 0.0_wp, 0.0_wp, 'dead slots')
    end associate
  end subroutine test_list

  !> A list is the sum of its bonds and of others where a view asks for the bonds, and of the others
  !> alone where it does not. Forces are compared with those of the bonds one by one plus the
  !> springs', the bound with a product, the product with the forces, which are linear in small
  !> displacements but for 1e-7 of them, and the energy with half of their work.
  subroutine test_bonds(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type), target :: set_up
    type(term_list_type) :: terms
    type(tangent_type) :: tangent
    type(term_view_type) :: view
    type(bonds_type) :: bonds
    real(wp), allocatable :: force(:, :), expected(:, :), w(:, :), kw(:, :), bound(:), energy(:)
    real(wp) :: stored
    integer :: k

    call terms%add(ground(1.0e15_wp))
    call plate_with(terms, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      select type (term => system%terms%items(1)%term)
      type is (bond_term_type)
        call expect_true(error, system%terms%bonds == 1 .and. term%sets, 'the bonds lead the list')
      class default
        call test_failed(error, 'the first term is another one')
      end select
      call expect_true(error, other_terms(system%terms) == 1 .and. system%terms%inside == 1, &
        & 'numbers of terms')
      call shake(system%body, no_gradient, 1.0e-7_wp*spacing, 3, system%state%u)
      allocate (force, expected, w, kw, mold=system%state%u)
      call view_of(system, 0.0_wp, view)
      expected = 0.0_wp
      call system%terms%add_force(view, expected)
      call expect_close(error, expected, -1.0e15_wp*system%state%u, 0.0_wp, 'springs alone')

      ! the second part of an evaluation completes the first, and needs its dilatation
      call ask_bonds(system, view, up_to_marks)
      force = 0.0_wp
      call system%terms%add_force(view, force)
      call ask_bonds(system, view, after_marks)
      call system%terms%add_force(view, force)
      call allocate_bonds(system%family, bonds)
      do k = 1, system%body%n_slots
        if (system%body%point(k) == 0) cycle
        call system%family%bonds_of(k, bonds)
        expected(k, :) = expected(k, :) + point_force(system%model, system%state%u, &
          & system%state%p, k, bonds)
      end do
      call expect_close(error, force, expected, 1.0e-10_wp*max_abs(expected), 'bonds and springs')

      w = 0.0_wp
      call shake(system%body, no_gradient, 1.0_wp, 5, w)
      tangent%difference = central
      tangent%step = 1.0e-7_wp*spacing
      tangent%options = options_of(system%model)
      call ask_bonds(system, view, tangent=tangent)
      kw = 0.0_wp
      call system%terms%add_tangent(view, w, kw)
      expected = kw
      system%state%u = tangent%step*w
      call system%terms%add_force(view, force)
      call expect_close(error, -force/tangent%step, expected, 1.0e-6_wp*max_abs(expected), &
        & 'product')

      allocate (bound(system%body%n_slots), energy(system%body%n_slots), source=0.0_wp)
      call system%terms%add_stiffness_bound(view, bound)
      call expect_true(error, all(abs(kw) <= spread(bound, 2, system%body%dim)*max_abs(w)), &
        & 'no product exceeds the bound')
      call system%terms%add_energy(view, energy)
      stored = sum(energy*system%body%volume)
      call expect(error, system%terms%energy(view), stored, 1.0e-13_wp, 'energy')
      ! of linear forces it is half of what they do on the way
      call expect(error, stored, -sum(force*system%state%u*spread(system%body%volume, 2, &
        & system%body%dim))/2, 1.0e-6_wp, 'work')
    end associate
  end subroutine test_bonds

  !> The bound of the stiffness of a system's terms.
  subroutine bounds(system, bound)
    type(system_type), intent(in), target :: system
    real(wp), intent(inout), contiguous :: bound(:)
    type(term_view_type) :: view

    view%body => system%body
    view%u => system%state%u
    call system%terms%add_stiffness_bound(view, bound)
  end subroutine bounds

end module test_force_term
