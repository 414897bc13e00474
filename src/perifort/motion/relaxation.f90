!> Rest of each load step; then bonds beyond their limit break and it relaxes again until none does.
!> The way there is the conjugate gradient, or adaptive dynamic relaxation (7.26-7.36): fictitious
!> mass and damping.
module pd_motion_relaxation
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_error, only: error_type, fail, status_no_answer
  use pd_base_numbers, only: block_length
  use pd_base_text, only: to_text
  use pd_motion_conjugate_gradient, only: relax_by_conjugate_gradient
  use pd_motion_observer, only: observer_type, instant_type
  use pd_motion_residual, only: relaxation_type, squared_force, fail_unconverged
  use pd_motion_rigid, only: rigid_type, find_free_motions, check_balance, remove_free_motions
  use pd_motion_system, only: system_type, evaluate, break_now, account, add_loads, faulty_slot, &
    & place
  implicit none (type, external)
  private
  public :: relaxation_type, run_relaxation

  real(wp), parameter :: largest_damping = 1.9_wp  !! c dt must stay below 2

  !> Sums over the free components, one pass for all.
  type :: sums_type
    real(wp) :: stiffness = 0.0_wp      !! U.K.U
    real(wp) :: displacement = 0.0_wp   !! U.U
    real(wp) :: change = 0.0_wp         !! dU.dU
    real(wp) :: residual = 0.0_wp       !! (V F).(V F)
    real(wp) :: reference = 0.0_wp      !! the same of what acts on the body: loads and supports
  end type sums_type

contains

  !> Bring `system` to rest under the conditions at each load step's time i/load_steps.
  subroutine run_relaxation(system, relaxation, observer, error)
    type(system_type), intent(inout) :: system
    type(relaxation_type), intent(in) :: relaxation
    class(observer_type), intent(inout) :: observer
    type(error_type), allocatable, intent(out) :: error
    type(instant_type) :: instant
    type(rigid_type) :: rigid
    real(wp), allocatable :: before(:, :), trend(:, :)
    integer(i8) :: number
    integer :: i
    logical :: dynamic

    instant%dt = 1.0_wp
    call find_free_motions(system, rigid)
    do i = 1, relaxation%load_steps
      call check_balance(system, rigid, real(i, wp)/relaxation%load_steps, error)
      if (allocated(error)) return
    end do
    call evaluate(system, 0.0_wp, breaking=.false.)
    system%state%v = 0.0_wp
    call account(system, 0.0_wp, at_rest=.true.)
    instant%settled = .true.
    call observer%observe(system, instant, error)
    if (allocated(error)) return
    allocate (trend(0, system%body%dim))
    do i = 1, relaxation%load_steps
      if (relaxation%conjugate_gradient .and. relaxation%load_steps > 1) before = system%state%u
      instant%load_step = i
      instant%time = real(i, wp)/relaxation%load_steps
      do
        dynamic = .not. relaxation%conjugate_gradient
        if (relaxation%conjugate_gradient) then
          call relax_by_conjugate_gradient(system, relaxation, rigid, trend, instant, observer, &
            & dynamic, error)
          if (allocated(error)) return
          instant%gave_way = dynamic
        end if
        if (dynamic) call relax(system, relaxation, instant, observer, error)
        instant%gave_way = .false.
        if (allocated(error)) return
        trend = trend(:0, :)
        ! the forces that did the work are those before the bonds break
        call account(system, instant%time, at_rest=.true.)
        call break_now(system, number)
        if (number == 0) exit
      end do
      call remove_free_motions(system, rigid, system%state%u)
      call evaluate(system, instant%time, breaking=.false.)
      if (allocated(before)) trend = system%state%u - before
      system%state%v = 0.0_wp
      call account(system, instant%time, at_rest=.true.)
      instant%settled = .true.
      instant%last = i == relaxation%load_steps
      call observer%observe(system, instant, error)
      if (allocated(error)) return
    end do
  end subroutine run_relaxation

  !> Iterate to rest at `instant%time`.
  subroutine relax(system, relaxation, instant, observer, error)
    type(system_type), intent(inout) :: system
    type(relaxation_type), intent(in) :: relaxation
    type(instant_type), intent(inout) :: instant
    class(observer_type), intent(inout) :: observer
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: rate(:, :), a(:, :), a_before(:, :)
    type(sums_type) :: sums
    real(wp) :: damping, reference
    integer :: iteration, fault, m

    allocate (rate, a, a_before, mold=system%state%u)
    rate = 0.0_wp
    reference = 0.0_wp
    instant%settled = .false.
    call evaluate(system, instant%time, breaking=.false.)
    call fictitious_acceleration(system, relaxation, instant%time, a, reference)
    rate = a/2                                                     ! 7.30
    do iteration = 1, relaxation%maximum_iterations
      call move(system, rate)                                      ! 7.29b
      a_before = a
      call evaluate(system, instant%time, breaking=.false.)
      call fictitious_acceleration(system, relaxation, instant%time, a, reference)
      call add_up(system, relaxation, rate, a, a_before, sums)
      instant%step = instant%step + 1
      reference = max(reference, sums%reference)
      instant%residual = 0.0_wp
      if (sums%residual > 0.0_wp) instant%residual = sqrt(sums%residual/reference)
      fault = faulty_slot(system, rate, 1.0_wp)
      if (fault > 0) then
        call fail(error, 'the relaxation diverges at iteration '//to_text(instant%step)// &
          & ': point '//to_text(int(system%body%point(fault)))//' at ('//place(system, fault)// &
          & ') moves more than a horizon in one iteration. Likely cause: loads that '// &
          & 'the body cannot bear, or a density matrix too small for it (density_matrix = '// &
          & '''frame_invariant'' is stable, with others raise safety)', status_no_answer)
        return
      end if
      ! imposing sets the speed of imposed motion, which isn't one here
      do m = 1, size(system%motions)
        system%state%v(system%motions(m)%slots, :) = 0.0_wp
      end do
      call observer%observe(system, instant, error)
      if (allocated(error)) return
      if (instant%residual <= relaxation%tolerance .and. &
        & sums%change <= relaxation%tolerance**2*sums%displacement) return
      damping = 0.0_wp                                             ! 7.35, 7.36
      if (sums%stiffness > 0.0_wp .and. sums%displacement > 0.0_wp) &
        & damping = min(largest_damping, 2*sqrt(sums%stiffness/sums%displacement))
      call accelerate(rate, a, damping)                            ! 7.29a
    end do
    call fail_unconverged(relaxation, instant%load_step, instant%residual, &
      & sqrt(sums%change/max(tiny(1.0_wp), sums%displacement)), error)
  end subroutine relax

  !> a = F/lambda of the free components, 0 elsewhere. `reference`, if it is 0, becomes the square
  !> of the loads, or without loads of the first residual: a body released from a strained state.
  subroutine fictitious_acceleration(system, relaxation, t, a, reference)
    type(system_type), intent(in) :: system
    type(relaxation_type), intent(in) :: relaxation
    real(wp), intent(in) :: t
    real(wp), intent(out) :: a(:, :)
    real(wp), intent(inout) :: reference
    integer :: k, c

    if (reference <= 0.0_wp) then
      a = 0.0_wp
      call add_loads(system, t, 1.0_wp, .false., a)
      reference = squared_force(system, a)
    end if
    a = system%state%force
    call add_loads(system, t, 1.0_wp, .false., a)
    if (reference <= 0.0_wp) reference = squared_force(system, a)
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
  end subroutine fictitious_acceleration

  !> u = u + rate (a step of 1).
  subroutine move(system, rate)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: rate(:, :)
    integer :: k, c

    do c = 1, size(rate, 2)
      !$omp parallel do simd schedule(static) default(none) shared(system, rate, c) private(k)
      do k = 1, size(rate, 1)
        system%state%u(k, c) = system%state%u(k, c) + rate(k, c)
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

  !> The sums that damping and convergence need, in blocks of fixed length.
  subroutine add_up(system, relaxation, rate, a, a_before, sums)
    type(system_type), intent(in) :: system
    type(relaxation_type), intent(in) :: relaxation
    real(wp), intent(in) :: rate(:, :), a(:, :), a_before(:, :)
    type(sums_type), intent(out) :: sums
    type(sums_type), allocatable :: part(:)
    integer :: blocks, block, k, c
    real(wp) :: u2

    blocks = (size(rate, 1) + block_length - 1)/block_length
    allocate (part(blocks))
    !$omp parallel do schedule(static) default(none) private(block, k, c, u2) &
    !$omp shared(blocks, part, system, relaxation, rate, a, a_before)
    do block = 1, blocks
      do c = 1, size(rate, 2)
        do k = (block - 1)*block_length + 1, min(block*block_length, size(rate, 1))
          if (system%held(k, c) == 1_i1) then
            part(block)%reference = part(block)%reference &
              & + (system%state%force(k, c)*system%body%volume(k))**2
            cycle
          end if
          part(block)%residual = part(block)%residual &
            & + (a(k, c)*relaxation%mass(k, c)*system%body%volume(k))**2
          part(block)%change = part(block)%change + rate(k, c)**2
          u2 = system%state%u(k, c)**2
          part(block)%displacement = part(block)%displacement + u2
          if (abs(rate(k, c)) > 0.0_wp) part(block)%stiffness = part(block)%stiffness &
            & - u2*(a(k, c) - a_before(k, c))/rate(k, c)
        end do
      end do
    end do
    do block = 1, blocks
      sums%stiffness = sums%stiffness + part(block)%stiffness
      sums%displacement = sums%displacement + part(block)%displacement
      sums%change = sums%change + part(block)%change
      sums%residual = sums%residual + part(block)%residual
      sums%reference = sums%reference + part(block)%reference
    end do
  end subroutine add_up

end module pd_motion_relaxation
