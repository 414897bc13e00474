!> Static equilibrium by adaptive dynamic relaxation (7.26-7.36): fictitious mass and damping.
module pd_motion_static_dynamic
  use pd_base_kinds, only: wp, i1
  use pd_base_error, only: error_type, fail, status_no_answer
  use pd_base_order, only: block_points, slots_of_block
  use pd_base_reduce, only: add_block, new_sums, total_of, summed_type => sums_type
  use pd_base_text, only: to_text
  use pd_motion_static_balance, only: balance_type, begin_balance, weigh, weigh_energies, &
    & balanced_but_for_error, allowed_error, error_is_known, relative_residual, fail_unconverged, &
    & check_drowned, rounding_note
  use pd_motion_static_estimate, only: estimate_error
  use pd_motion_memory, only: memory_type
  use pd_motion_observer, only: observer_type, instant_type, add_note
  use pd_motion_static_residual, only: relaxation_type
  use pd_motion_newton, only: frame_type
  use pd_motion_pins, only: fit_pins, has_pins
  use pd_motion_static_pins, only: add_drive, drive_pins, frame_pins, squares_of
  use pd_motion_static_rigid, only: rigid_type
  use pd_motion_watch_fault, only: faulty_slot, greatest_stretch, place
  use pd_motion_static_start, only: move_along
  use pd_motion_system, only: system_type, evaluate, add_loads
  implicit none (type, external)
  private
  public :: relax

  real(wp), parameter :: largest_damping = 1.9_wp  !! c dt must stay below 2
  !> A state is judged when its residual is this many times the tolerance: pieces have scales of
  !> their own, each the largest of three norms.
  real(wp), parameter :: worth_judging = 1.8_wp
  !> It is judged at multiples of this number of iterations, too: of a piece on which nothing acts
  !> only rounding is left, beside what acts on others or nothing.
  integer, parameter :: judged_anyway = 200
  !> Iterations between two judgements, at least, and as a part of those that have been made.
  integer, parameter :: least_wait = 10, wait_part = 20
  !> Iterations of dynamic relaxation after which conjugate gradients continue: on slender bodies
  !> and large contrasts of stiffness its slowest mode needs millions.
  integer, parameter :: patience = 100000
  !> Iterations that an estimate of the error may take.
  integer, parameter :: most_estimating = 20000

  !> A residual that is rounding alone: in a state without displacements, as of a heated body that
  !> is held, their change has nothing to be compared with.
  real(wp), parameter :: at_rounding = 1.0e-13_wp

  !> Sums over the free components, one pass for all.
  type :: sums_type
    real(wp) :: stiffness = 0.0_wp      !! U.K.U
    real(wp) :: moved = 0.0_wp          !! U.U, U as it is in U.K.U: since the relaxation began
    real(wp) :: displacement = 0.0_wp   !! square of all displacements
    real(wp) :: change = 0.0_wp         !! dU.dU
    real(wp) :: residual = 0.0_wp       !! (V F).(V F)
    real(wp) :: support = 0.0_wp        !! the same of the support forces
  end type sums_type

contains

  !> Iterate to equilibrium at `instant%time`, or continue within that.
  subroutine relax(system, relaxation, rigid, instant, observer, unfinished, error)
    type(system_type), intent(inout) :: system
      !! in equilibrium on return; its memory has the progress until then
    type(relaxation_type), intent(in) :: relaxation  !! tolerance, iterations and mass
    type(rigid_type), intent(in) :: rigid            !! its pieces and their free motions
    type(instant_type), intent(inout) :: instant
      !! time and load step; gets step, iterations and notes
    class(observer_type), intent(inout) :: observer  !! called once for each iteration
    logical, intent(out) :: unfinished   !! the error is that no equilibrium was found, or too rough
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: a(:, :), a_before(:, :)
    real(wp) :: no_trend(0, system%body%dim)
    type(balance_type) :: balance
    type(sums_type) :: sums
    real(wp) :: damping
    integer :: iteration, fault, m
    logical :: accepted

    unfinished = .false.
    allocate (a, a_before, mold=system%state%u)
    if (.not. allocated(system%memory%rate)) allocate (system%memory%rate, mold=system%state%u)
    instant%settled = .false.
    call begin_balance(system, rigid, instant%time, balance)
    associate (memory => system%memory, rate => system%memory%rate)
      if (memory%iteration == 0) then
        memory%load_step = instant%load_step
        memory%next_judgement = 0
        call move_along(system, rigid, instant%time, no_trend)
        call fit_pins(system)
        call evaluate(system, instant%time, breaking=.false.)
        memory%base = system%state%u
        call weigh(system, relaxation, rigid, instant%time, balance)
        ! nothing acts, or nothing is left to do
        call weigh_energies(system, rigid, balance)
        instant%residual = relative_residual(balance)
        if (balanced_but_for_error(relaxation, rigid, balance) .and. error_is_known(balance, &
          & 0.0_wp, allowed_error(relaxation, balance))) then
          call check_drowned(system, relaxation, rigid, balance, error)
          unfinished = allocated(error)
          return
        end if
      end if
      call fictitious_acceleration(system, relaxation, instant%time, a)
      if (memory%iteration == 0) rate = a/2                        ! 7.30
      do iteration = max(1, memory%iteration), min(relaxation%maximum_iterations, patience)
        if (iteration > memory%iteration) then
          call move(system%state%u, rate)                          ! 7.29b
          call fit_pins(system)
          a_before = a
          call evaluate(system, instant%time, breaking=.false.)
          call fictitious_acceleration(system, relaxation, instant%time, a)
          call add_up(system, relaxation, rate, a, a_before, sums)
          call remember(system%memory, iteration, max(balance%acting, sums%support), sums)
          instant%step = instant%step + 1
          instant%iteration = instant%step - memory%began
          memory%step = instant%step
          fault = faulty_slot(system, rate, 1.0_wp)
          if (fault > 0) then
            call fail(error, 'the relaxation diverges at iteration '//to_text(instant%step)// &
              & ': point '//to_text(int(system%body%point(fault)))//' at ('// &
              & place(system, fault)//') moves more than a horizon in one iteration, its '// &
              & 'bonds are stretched by up to '//to_text(greatest_stretch(system, fault), 3)// &
              & '. Likely '// &
              & 'cause: loads that the body cannot bear, or a density matrix too small for '// &
              & 'it (density_matrix = ''frame_invariant'' is stable, with others raise safety)', &
              & status_no_answer)
            return
          end if
          ! imposing sets the speed of imposed motion, which isn't one here
          do m = 1, size(system%motions)
            system%state%v(system%motions(m)%slots, :) = 0.0_wp
          end do
          instant%residual = memory%residual
          instant%change = sqrt(memory%change/max(tiny(1.0_wp), memory%displacement))
          call observer%observe(system, instant, error)
          if (allocated(error)) return
          if (allocated(instant%note)) deallocate (instant%note)
        end if
        instant%residual = memory%residual
        if (iteration >= memory%next_judgement .and. &
          & (memory%residual <= worth_judging*relaxation%tolerance .or. &
          & mod(iteration, judged_anyway) == 0) .and. &
          & (memory%change <= relaxation%tolerance**2*memory%displacement .or. &
          & memory%residual <= at_rounding)) then
          call judge(system, relaxation, rigid, instant%time, balance, accepted)
          if (accepted) then
            instant%residual = relative_residual(balance)
            call add_note(instant, rounding_note(relaxation, balance))
            memory%iteration = 0
            call check_drowned(system, relaxation, rigid, balance, error)
            unfinished = allocated(error)
            return
          end if
        end if
        damping = 0.0_wp                                           ! 7.35, 7.36
        if (memory%stiffness > 0.0_wp .and. memory%moved > 0.0_wp) &
          & damping = min(largest_damping, 2*sqrt(memory%stiffness/memory%moved))
        call accelerate(rate, a, damping)                          ! 7.29a
      end do
    end associate
    unfinished = relaxation%maximum_iterations >= patience
    call weigh(system, relaxation, rigid, instant%time, balance)
    call fail_unconverged(system, relaxation, rigid, balance, instant%load_step, instant%time, &
      & sqrt(system%memory%change/max(tiny(1.0_wp), system%memory%displacement)), error)
  end subroutine relax

  !> Whether the state is in equilibrium, and known to be near enough to it; if it isn't, when to
  !> check again.
  subroutine judge(system, relaxation, rigid, t, balance, accepted)
    type(system_type), intent(inout) :: system
    type(relaxation_type), intent(in) :: relaxation
    type(rigid_type), intent(in) :: rigid
    real(wp), intent(in) :: t
    type(balance_type), intent(inout) :: balance
    logical, intent(out) :: accepted
    integer :: estimating

    associate (memory => system%memory)
      estimating = 0
      call weigh(system, relaxation, rigid, t, balance)
      accepted = balanced_but_for_error(relaxation, rigid, balance)
      if (accepted) then
        call weigh_energies(system, rigid, balance)
        if (.not. error_is_known(balance, 0.0_wp, allowed_error(relaxation, balance))) &
          & call estimate_error(system, relaxation, rigid, t, allowed_error(relaxation, balance), &
          & most_estimating, accepted, estimating)
      end if
      memory%next_judgement = memory%iteration &
        & + max(least_wait, memory%iteration/wait_part, 2*estimating)
    end associate
  end subroutine judge

  !> What an iteration leaves for the next one.
  pure subroutine remember(memory, iteration, reference, sums)
    type(memory_type), intent(inout) :: memory
    integer, intent(in) :: iteration
    real(wp), intent(in) :: reference    !! squared norm of what acts [N2]
    type(sums_type), intent(in) :: sums

    memory%iteration = iteration
    memory%residual = 0.0_wp
    if (sums%residual > 0.0_wp) memory%residual = sqrt(sums%residual/max(reference, tiny(1.0_wp)))
    memory%stiffness = sums%stiffness
    memory%moved = sums%moved
    memory%displacement = sums%displacement
    memory%change = sums%change
  end subroutine remember

  !> a = F/lambda of the free components and of the free motions of pins, 0 elsewhere.
  subroutine fictitious_acceleration(system, relaxation, t, a)
    type(system_type), intent(in) :: system
    type(relaxation_type), intent(in) :: relaxation
    real(wp), intent(in) :: t
    real(wp), intent(out) :: a(:, :)
    type(frame_type), allocatable :: frames(:)
    integer :: k, c

    a = system%state%force
    call add_loads(system, t, 1.0_wp, .false., a)
    do c = 1, size(a, 2)
      !$omp parallel do schedule(static) default(none) shared(system, relaxation, a, c) private(k)
      do k = 1, size(a, 1)
        if (system%held(k, c) == 1_i1 .or. relaxation%mass(k, c) <= 0.0_wp) then
          a(k, c) = 0.0_wp
        else
          a(k, c) = a(k, c)/relaxation%mass(k, c)
        end if
      end do
    end do
    if (.not. has_pins(system)) return
    call frame_pins(system, relaxation%mass, system%state%u, frames)
    call add_drive(system, frames, system%state%u, drives_of(), 1.0_wp, a)

  contains

    !> What drives the free motions of pins.
    function drives_of() result(drives)
      real(wp), allocatable :: drives(:, :), density(:, :)

      density = system%state%force
      call add_loads(system, t, 1.0_wp, .false., density)
      drives = drive_pins(system, frames, system%state%u, density)
    end function drives_of
  end subroutine fictitious_acceleration

  !> u = u + rate (a step of 1).
  subroutine move(u, rate)
    real(wp), intent(inout) :: u(:, :)
    real(wp), intent(in) :: rate(:, :)
    integer :: k, c

    do c = 1, size(rate, 2)
      !$omp parallel do simd schedule(static) default(none) shared(u, rate, c) private(k)
      do k = 1, size(rate, 1)
        u(k, c) = u(k, c) + rate(k, c)
      end do
    end do
  end subroutine move

  !> 7.29a with a step of 1.
  subroutine accelerate(rate, a, damping)
    real(wp), intent(inout) :: rate(:, :)
    real(wp), intent(in) :: a(:, :)
    real(wp), intent(in) :: damping
    integer :: k, c

    do c = 1, size(rate, 2)
      !$omp parallel do simd schedule(static) default(none) shared(rate, a, damping, c) private(k)
      do k = 1, size(rate, 1)
        rate(k, c) = ((2 - damping)*rate(k, c) + 2*a(k, c))/(2 + damping)
      end do
    end do
  end subroutine accelerate

  !> The sums that damping and convergence need, in blocks of points.
  subroutine add_up(system, relaxation, rate, a, a_before, sums)
    type(system_type), intent(in) :: system
    type(relaxation_type), intent(in) :: relaxation
    real(wp), intent(in) :: rate(:, :), a(:, :), a_before(:, :)
    type(sums_type), intent(out) :: sums
    type(summed_type) :: parts
    real(wp) :: terms(block_points, 6), u2, totals(6)
    integer :: block, i, k, c, n, m, slots(block_points)

    call new_sums(system%body%order, 6, parts)
    !$omp parallel do schedule(static) default(none) &
    !$omp private(block, i, k, c, n, slots, terms, u2) &
    !$omp shared(parts, system, relaxation, rate, a, a_before)
    do block = 1, system%body%order%blocks
      call slots_of_block(system%body%order, block, n, slots)
      terms = 0.0_wp
      do c = 1, size(rate, 2)
        do i = 1, n
          k = slots(i)
          if (system%held(k, c) == 1_i1) then
            terms(i, 1) = terms(i, 1) + (system%state%force(k, c)*system%body%volume(k))**2
            cycle
          end if
          terms(i, 2) = terms(i, 2) + (a(k, c)*relaxation%mass(k, c)*system%body%volume(k))**2
          terms(i, 3) = terms(i, 3) + rate(k, c)**2
          terms(i, 4) = terms(i, 4) + system%state%u(k, c)**2
          u2 = (system%state%u(k, c) - system%memory%base(k, c))**2
          terms(i, 5) = terms(i, 5) + u2
          if (abs(rate(k, c)) > 0.0_wp) terms(i, 6) = terms(i, 6) &
            & - u2*(a(k, c) - a_before(k, c))/rate(k, c)
        end do
      end do
      call add_block(block, terms, parts)
    end do
    totals = total_of(system%body%order, parts)
    sums%support = totals(1)
    sums%residual = totals(2)
    sums%change = totals(3)
    sums%displacement = totals(4)
    sums%moved = totals(5)
    sums%stiffness = totals(6)
    ! the residual of pins is that of their free motions
    do m = 1, size(system%motions)
      if (system%motions(m)%is_pin) sums%residual = sums%residual &
        & + squares_of(system, m, a*relaxation%mass, .true.)
    end do
  end subroutine add_up

end module pd_motion_static_dynamic
