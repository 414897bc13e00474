!> Explicit integration in time (7.3): the chapter's forward and backward differences, velocity
!> Verlet, Adams-Bashforth, Adams-Moulton and Runge-Kutta.
!>
!> Every integrator is the same loop: at t_n the forces are brought up to date (which imposes the
!> constraints and breaks bonds, once per step), the observer is called, `advance` goes to t_{n+1}.
module pd_motion_explicit_integrators
  use pd_base_kinds, only: wp
  use pd_base_order, only: block_points, slots_of_block
  use pd_base_reduce, only: add_block, largest_of_ranks, new_sums, sum_of_ranks, sum_over, &
    & sums_type, total_of
  use pd_base_error, only: error_type, fail, internal_fault, status_no_answer
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type
  use pd_motion_memory, only: memory_type, not_begun
  use pd_motion_observer, only: observer_type, instant_type
  use pd_motion_pins, only: gather_pins, move_pins
  use pd_motion_rigid_bodies, only: gather_rigid_bodies, move_rigid_bodies
  use pd_motion_watch_fault, only: explain_fault, faulty_slot, points_at_once, stays_within
  use pd_motion_watch_rescue, only: good_state_type, keep_good, show_good
  use pd_motion_energy_watch, only: watch_type
  use pd_motion_explicit_substeps, only: evaluate_level, level_due
  use pd_motion_account, only: energies_type, energies_of, account, velocities_now
  use pd_motion_system, only: system_type, pairing_type, evaluate, add_loads, inverse_density, &
    & explain_condition
  implicit none (type, external)
  private
  public :: run_explicit, begin_memory

  !> The state at the beginning of a step, for integrators that need it later.
  type :: start_type
    real(wp), allocatable :: u(:, :), v(:, :), a(:, :)
  end type start_type

  real(wp), parameter :: smallest_strain = 1.0e-12_wp  !! what is below is rounding

contains

  !> Move `system` through `steps` steps of `dt` [s] from t = 0, or from where it stands if its
  !> memory says that it has begun. An error is set if the motion is unstable or the observer sets
  !> one.
  subroutine run_explicit(system, integrator, dt, steps, observer, error)
    type(system_type), intent(inout) :: system
      !! ready at t = 0, or as a checkpoint left it; after the last step on return
    character(*), intent(in) :: integrator  !! value of `integrator` in &time
    real(wp), intent(in) :: dt              !! time step [s]
    integer, intent(in) :: steps            !! number of the last step
    class(observer_type), intent(inout) :: observer
      !! called once for each step, the start included, that has not been seen before
    type(error_type), allocatable, intent(out) :: error
    type(start_type) :: start
    type(instant_type) :: instant
    type(good_state_type) :: good
    real(wp) :: squares, bound
    logical :: sound
    integer :: n, seen

    system%static = .false.
    instant%dt = dt
    seen = system%memory%step
    if (seen == not_begun) call begin_memory(system, integrator)
    system%watch = watch_type()
    system%watch%rounding = maxval(system%model%materials%youngs_modulus)*smallest_strain**2 &
      & *sum_over(system%body%order, system%body%volume)
    system%watch%heaviest = heaviest_point(system)
    call allocate_start(system, integrator, start)
    bound = huge(bound)
    do n = max(0, seen), steps
      instant%step = n
      instant%time = n*dt
      instant%last = n == steps
      system%memory%step = n
      system%time = instant%time
      if (n > seen) then
        if (system%levels > 0) then
          call evaluate_level(system, instant%time, 0, pairings_of(system, n, 0, dt))
        else
          call evaluate(system, instant%time, breaking=.true., &
            & pairing=pairing_of(integrator, n, dt, system%break_late))
        end if
        if (allocated(system%fault)) then
          call explain_condition(system, status_no_answer, error)
          call show_good(good, system, observer, error)
          return
        end if
        ! forward_backward and Verlet keep v at half steps: half a kick brings it to this instant
        instant%kick = 0.0_wp
        if (n > 0 .and. at_half_steps(integrator)) instant%kick = dt/2**(system%levels + 1)
        call gather_pins(system, instant%time, instant%kick)
        call gather_rigid_bodies(system, instant%time, instant%kick)
        call account(system, instant%time)
        call system%watch%supplied(system%external_work)
        call observer%observe(system, instant, error)
        if (allocated(error)) return
      end if
      if (n == steps) exit
      call check_energies(system, instant, bound, good)
      if (system%levels > 0) then
        call leap_in_substeps(system, n, dt, squares, sound)
        if (allocated(system%fault)) then
          call explain_condition(system, status_no_answer, error)
          call show_good(good, system, observer, error)
          return
        end if
      else if (at_half_steps(integrator)) then
        ! the first velocity gets only half its kick: the scheme as printed is of first order
        call leap(system, instant%time, merge(dt/2, dt, n == 0), dt, squares, sound)
        call move_pins(system, instant%time, dt)
        call move_rigid_bodies(system, instant%time, dt)
      else
        call advance(system, integrator, instant%time, dt, start)
        sound = faulty_slot(system, system%state%v, dt, squares) == 0
      end if
      bound = system%watch%heaviest/2*squares
      if (sound .and. system%watch%sound) cycle
      call explain_fault(system, n + 1, dt, error)
      call show_good(good, system, observer, error)
      return
    end do
    system%memory%step = not_begun  ! another run begins anew
  end subroutine run_explicit

  !> Compute the energies if that is long ago, and keep a state in which they agree. `bound` is
  !> what the kinetic energy does not exceed [J].
  subroutine check_energies(system, instant, bound, good)
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    real(wp), intent(in) :: bound
    type(good_state_type), intent(inout) :: good
    type(energies_type) :: energies
    real(wp), allocatable :: v(:, :)

    if (system%watch%check_is_due(instant%step)) then
      call velocities_now(system, instant%time, instant%kick, v)
      call energies_of(system, v, energies)
      call system%watch%check(instant%step, energies%kinetic, energies%strain, &
        & system%dissipated, system%external_work)
    end if
    if (system%watch%kinetic_is_due(instant%step, bound)) &
      & call system%watch%check_kinetic(kinetic_energy(system))
    if (system%watch%keeps(instant%step)) &
      & call keep_good(good, system, instant, system%watch%most_of_good())
  end subroutine check_energies

  !> Kinetic energy of the velocities as the integrator keeps them [J].
  real(wp) function kinetic_energy(system) result(kinetic)
    type(system_type), intent(in) :: system
    type(sums_type) :: parts
    real(wp) :: terms(block_points, 1), totals(1)
    integer :: block, i, k, c, n, slots(block_points)

    call new_sums(system%body%order, 1, parts)
    !$omp parallel do schedule(static) default(none) shared(system, parts) &
    !$omp private(block, i, k, c, n, slots, terms)
    do block = 1, system%body%order%blocks
      call slots_of_block(system%body%order, block, n, slots)
      terms = 0.0_wp
      do c = 1, system%body%dim
        do i = 1, n
          k = slots(i)
          terms(i, 1) = terms(i, 1) + system%state%v(k, c)**2
        end do
      end do
      do i = 1, n
        terms(i, 1) = terms(i, 1)*system%body%volume(slots(i)) &
          & /inverse_density(system%model, slots(i))
      end do
      call add_block(block, terms, parts)
    end do
    totals = total_of(system%body%order, parts)
    kinetic = totals(1)/2
  end function kinetic_energy

  !> The greatest mass of a point [kg].
  real(wp) function heaviest_point(system) result(mass)
    type(system_type), intent(in) :: system
    integer :: k

    mass = 0.0_wp
    do k = 1, system%body%n_slots
      if (system%body%point(k) > 0) &
        & mass = max(mass, system%body%volume(k)/inverse_density(system%model, k))
    end do
    mass = largest_of_ranks(system%body%order, mass)
  end function heaviest_point

  !> Whether the integrator's velocities belong to the middle of the steps.
  pure logical function at_half_steps(integrator)
    character(*), intent(in) :: integrator
    at_half_steps = integrator == 'forward_backward' .or. integrator == 'velocity_verlet'
  end function at_half_steps

  !> With which instant that of step `n` is paired where the energy of bonds is counted that break
  !> then. An integrator's sums let such a bond pull up to t_n and for a part of a step more (or
  !> less, if negative), and the products with displacements of twice that part of a step away
  !> count the work of that force (doc/theory.md, 9).
  pure type(pairing_type) function pairing_of(integrator, n, dt, late) result(pairing)
    character(*), intent(in) :: integrator
    integer, intent(in) :: n        !! complete steps
    real(wp), intent(in) :: dt      !! [s]
    logical, intent(in) :: late     !! bonds break after the forces
    real(wp) :: part

    part = 0.0_wp
    select case (integrator)
    case ('forward_backward', 'velocity_verlet')
      ! the first kick is half a kick, which no bond that breaks at t = 0 has a part in
      if (late) then
        part = 0.5_wp
      else if (n > 0) then
        part = -0.5_wp
      end if
    case ('adams_bashforth')
      ! the first two steps are Runge-Kutta's; then 23/12, -16/12 and 5/12 of the last three
      select case (n)
      case (0); part = merge(7.0_wp, 0.0_wp, late)/12
      case (1); part = merge(-4.0_wp, 5.0_wp, late)/12
      case default; part = merge(0.5_wp, -0.5_wp, late)
      end select
    case ('adams_moulton')
      if (late) part = merge(0.5_wp, 1.0_wp/6, n > 0)
    case ('runge_kutta')
      if (late) part = 1.0_wp/6
    case default
      call internal_fault('unknown integrator')
    end select
    pairing%offset = 2*part*dt
    if (n > 0) pairing%held = -dt
    ! the energy that temperatures change is that of the bonds which are left
    pairing%heat = pairing%held
    if (.not. late) return
    pairing%held = dt
    ! the accelerations are known then: velocities are brought to the middle of the way
    pairing%kick = part*dt
    if (at_half_steps(integrator)) pairing%kick = merge(dt, dt/2, n > 0)
  end function pairing_of

  !> The pairings of bonds of each level at the `m`-th shortest substep of step `n` of `dt`: by the
  !> steps of their level, from velocities that the kick of the shortest substep brings on.
  pure function pairings_of(system, n, m, dt) result(pairings)
    type(system_type), intent(in) :: system  !! with substeps, and forward_backward
    integer, intent(in) :: n, m
    real(wp), intent(in) :: dt               !! [s]
    type(pairing_type) :: pairings(0:system%levels)
    type(pairing_type) :: shortest
    integer :: l

    shortest = pairing_of('forward_backward', n + m, dt/2**system%levels, system%break_late)
    do l = 0, system%levels
      pairings(l) = pairing_of('forward_backward', n + m, dt/2**l, system%break_late)
      pairings(l)%kick = shortest%kick
    end do
  end function pairings_of

  !> Step `n` from the instant of its forces to the last kick before the next: in it the finest
  !> level takes 2^levels substeps. `sound` and `squares` as of `leap`, for the last of them.
  subroutine leap_in_substeps(system, n, dt, squares, sound)
    type(system_type), intent(inout) :: system
      !! with levels; a value of a condition that is not finite is noted in its `fault`
    integer, intent(in) :: n
    real(wp), intent(in) :: dt
    real(wp), intent(out) :: squares
    logical, intent(out) :: sound
    real(wp) :: t, short
    integer :: m

    short = dt/2**system%levels
    do m = 0, 2**system%levels - 1
      t = n*dt + m*short
      if (m > 0) call evaluate_level(system, t, level_due(system%levels, m), &
        & pairings_of(system, n, m, dt))
      if (allocated(system%fault)) return
      call leap(system, t, merge(short/2, short, n + m == 0), short, squares, sound)
      if (.not. sound) return
    end do
  end subroutine leap_in_substeps

  !> Room for what the integrator carries from step to step.
  subroutine begin_memory(system, integrator)
    type(system_type), intent(inout) :: system
      !! with an empty memory, and room for earlier steps if the rule needs them, on return
    character(*), intent(in) :: integrator  !! value of `integrator` in &time
    integer :: n, d

    system%memory = memory_type()
    if (integrator /= 'adams_bashforth' .and. integrator /= 'adams_moulton') return
    n = size(system%state%u, 1)
    d = size(system%state%u, 2)
    allocate (system%memory%v(n, d, 2), system%memory%a(n, d, 2), source=0.0_wp)
  end subroutine begin_memory

  subroutine allocate_start(system, integrator, start)
    type(system_type), intent(in) :: system
    character(*), intent(in) :: integrator
    type(start_type), intent(out) :: start

    if (at_half_steps(integrator)) return
    allocate (start%u, start%v, start%a, mold=system%state%u)
    start%a = 0.0_wp
  end subroutine allocate_start

  !> One step from t to t + dt; the forces are those at t.
  subroutine advance(system, integrator, t, dt, start)
    type(system_type), intent(inout) :: system
    character(*), intent(in) :: integrator
    real(wp), intent(in) :: t, dt
    type(start_type), intent(inout) :: start

    call remember_instant(system, t, start)
    select case (integrator)
    case ('adams_bashforth')
      if (system%memory%filled < 2) then
        call runge_kutta(system, t, dt, start)
      else
        call adams(system, dt, start, [23.0_wp, -16.0_wp, 5.0_wp]/12.0_wp)
      end if
      call shift(start, system%memory)
    case ('adams_moulton')
      if (system%memory%filled < 1) then
        call runge_kutta(system, t, dt, start)
      else
        call adams(system, dt, start, [1.5_wp, -0.5_wp, 0.0_wp])
        call evaluate(system, t + dt, breaking=.false.)
        call correct(system, t, dt, start)
      end if
      call shift(start, system%memory)
    case ('runge_kutta')
      call runge_kutta(system, t, dt, start)
    case default
      call internal_fault('unknown integrator')
    end select
  end subroutine advance

  !> 7.8 and 7.9 in one pass: v = v + kick (f + b)/rho, u = u + dt v. `sound` is false if that is no
  !> motion any more: a velocity that isn't finite, or a point that crosses its horizon in the step.
  !> `squares` is the sum of the squares of all components of velocity, for the watch only: its
  !> rounding depends on the number of threads.
  subroutine leap(system, t, kick, dt, squares, sound)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: t, kick, dt
    real(wp), intent(out) :: squares
    logical, intent(out) :: sound
    real(wp) :: scale(points_at_once), sum_of_block, largest_sum
    integer :: block, first, last, c, k

    call still_copies(system%body, system%state%v)
    call still_copies(system%body, system%state%force)
    call add_loads(system, t, kick, .true., system%state%v)
    squares = 0.0_wp
    largest_sum = 0.0_wp
    !$omp parallel do schedule(static) default(none) shared(system, kick, dt) &
    !$omp private(block, first, last, c, k, scale, sum_of_block) reduction(+:squares) &
    !$omp reduction(max:largest_sum)
    do block = 1, (system%body%n_slots + points_at_once - 1)/points_at_once
      first = (block - 1)*points_at_once + 1
      last = min(block*points_at_once, system%body%n_slots)
      if (size(system%model%materials) == 1) then
        scale = kick/system%model%materials(1)%density
      else
        do k = first, last
          scale(k - first + 1) = kick*inverse_density(system%model, k)
        end do
      end if
      do c = 1, system%body%dim
        if (system%goes_beyond) system%state%force(first:last, c) &
          & = system%state%force(first:last, c) + system%beyond(first:last, c)
        call leap_block(last - first + 1, scale, dt, system%state%force(first:last, c), &
          & system%state%v(first:last, c), system%state%u(first:last, c), sum_of_block)
        squares = squares + sum_of_block
        largest_sum = max(largest_sum, sum_of_block)
      end do
    end do
    squares = sum_of_ranks(system%body%order, squares)
    largest_sum = largest_of_ranks(system%body%order, largest_sum)
    sound = stays_within(system, system%state%v, dt, squares, largest_sum)
  end subroutine leap

  !> One component of one block: explicit shapes, so that the loop runs in vector registers.
  !> `squares` is the sum of the squares of its velocities.
  pure subroutine leap_block(n, scale, dt, f, v, u, squares)
    integer, intent(in) :: n
    real(wp), intent(in) :: scale(n), dt, f(n)
    real(wp), intent(inout) :: v(n), u(n)
    real(wp), intent(out) :: squares
    real(wp) :: now
    integer :: k

    squares = 0.0_wp
    do k = 1, n
      now = v(k) + scale(k)*f(k)
      v(k) = now
      u(k) = u(k) + dt*now
      squares = squares + now**2
    end do
  end subroutine leap_block

  !> Accelerations at `t` from the forces, 0 for constrained components.
  subroutine accelerations(system, t, a)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: t
    real(wp), intent(inout) :: a(:, :)
    integer :: k, c

    do c = 1, size(a, 2)
      !$omp parallel do schedule(static) default(none) shared(system, a, c) private(k)
      do k = 1, size(a, 1)
        a(k, c) = inverse_density(system%model, k)*system%state%force(k, c)
      end do
    end do
    call add_loads(system, t, 1.0_wp, .true., a)
    where (system%held == 1) a = 0.0_wp
    call still_copies(system%body, a)
  end subroutine accelerations

  !> Set values of copies of other ranks' points to zero. Their displacements come from their
  !> owners, and their velocities where they are needed; a rank has a part of their forces alone,
  !> which would drive them to any speed, so that the run seemed to have diverged.
  pure subroutine still_copies(body, values)
    type(body_type), intent(in) :: body
    real(wp), intent(inout) :: values(:, :)  !! (n_slots, dim)

    if (.not. associated(body%order%ranks)) return
    values(body%slot(body%order%n_owned + 1:), :) = 0.0_wp
  end subroutine still_copies

  !> Keep displacement, velocity and acceleration at the beginning of a step.
  subroutine remember_instant(system, t, start)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: t
    type(start_type), intent(inout) :: start
    start%u = system%state%u
    start%v = system%state%v
    call accelerations(system, t, start%a)
  end subroutine remember_instant

  !> What was the present becomes the past.
  pure subroutine shift(start, memory)
    type(start_type), intent(in) :: start
    type(memory_type), intent(inout) :: memory
    memory%v(:, :, 2) = memory%v(:, :, 1)
    memory%a(:, :, 2) = memory%a(:, :, 1)
    memory%v(:, :, 1) = start%v
    memory%a(:, :, 1) = start%a
    memory%filled = memory%filled + 1
  end subroutine shift

  !> Adams-Bashforth: weights of t_n, t_{n-1}, t_{n-2}.
  pure subroutine adams(system, dt, start, weight)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: dt
    type(start_type), intent(in) :: start
    real(wp), intent(in) :: weight(3)
    associate (v => system%memory%v, a => system%memory%a)
      system%state%u = start%u + dt*(weight(1)*start%v + weight(2)*v(:, :, 1) &
        & + weight(3)*v(:, :, 2))
      system%state%v = start%v + dt*(weight(1)*start%a + weight(2)*a(:, :, 1) &
        & + weight(3)*a(:, :, 2))
    end associate
  end subroutine adams

  !> Adams-Moulton of second order, from the forces at the predicted state.
  subroutine correct(system, t, dt, start)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: t, dt
    type(start_type), intent(in) :: start
    real(wp), allocatable :: a(:, :)

    allocate (a, mold=start%a)
    call accelerations(system, t + dt, a)
    system%state%u = start%u + dt/2*(start%v + system%state%v)
    system%state%v = start%v + dt/2*(start%a + a)
  end subroutine correct

  !> The classical scheme of fourth order; constraints are imposed at each stage's time.
  subroutine runge_kutta(system, t, dt, start)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: t, dt
    type(start_type), intent(in) :: start
    real(wp), parameter :: ahead(3) = [0.5_wp, 0.5_wp, 1.0_wp]
    real(wp), parameter :: weight(4) = [1.0_wp, 2.0_wp, 2.0_wp, 1.0_wp]/6.0_wp
    real(wp), allocatable :: du(:, :), dv(:, :), a(:, :), v(:, :)
    integer :: stage

    allocate (a, source=start%a)
    allocate (v, source=start%v)
    du = weight(1)*start%v
    dv = weight(1)*start%a
    do stage = 1, 3
      system%state%u = start%u + ahead(stage)*dt*v
      system%state%v = start%v + ahead(stage)*dt*a
      call evaluate(system, t + ahead(stage)*dt, breaking=.false.)
      v = system%state%v
      call accelerations(system, t + ahead(stage)*dt, a)
      du = du + weight(stage + 1)*v
      dv = dv + weight(stage + 1)*a
    end do
    system%state%u = start%u + dt*du
    system%state%v = start%v + dt*dv
  end subroutine runge_kutta

end module pd_motion_explicit_integrators
