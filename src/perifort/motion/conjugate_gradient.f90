!> Rest by Newton's method with a conjugate gradient inside (doc/theory.md, 7). The residual is the
!> force as the model has it; the linear equations take a symmetric stiffness: at first that of the
!> undeformed body with the bonds it has now, which the fast formulas give, and where that doesn't
!> serve, the tangent at the present displacements. What doesn't come to rest so is left to dynamic
!> relaxation.
module pd_motion_conjugate_gradient
  use pd_base_kinds, only: wp, i1
  use pd_base_error, only: error_type, fail, status_no_answer
  use pd_base_text, only: to_text
  use pd_force_forces, only: dilatation_pass, force_pass
  use pd_motion_conditions, only: impose
  use pd_motion_krylov, only: krylov_type, sums_type, new_krylov, linearise, take_residual, &
    & first_direction, next_direction, take_direction, apply_stiffness, go_along, volume_inner, &
    & smallest_curvature
  use pd_motion_observer, only: observer_type, instant_type
  use pd_motion_residual, only: relaxation_type, squared_force, fail_unconverged
  use pd_motion_rigid, only: rigid_type, remove_free_motions
  use pd_motion_system, only: system_type, add_loads
  implicit none (type, external)
  private
  public :: relax_by_conjugate_gradient

  !> Square of a force [N2] whose energies would be infinities.
  real(wp), parameter :: largest_reference = 1.0e200_wp
  !> The forces are evaluated anew whenever the residual of the linear equations has fallen by this
  !> factor; a solve ends when what is not linear makes more than `told_apart` of what is left.
  real(wp), parameter :: between_looks = 0.1_wp, told_apart = 0.3_wp
  !> A solve that leaves more than this of the residual makes the undeformed stiffness give way to
  !> the tangent.
  real(wp), parameter :: good_solve = 0.3_wp
  !> With the tangent, a solve has to take at least a part of the residual, if need be by a shorter
  !> step.
  real(wp), parameter :: useful_solve = 0.9_wp
  integer, parameter :: most_halvings = 6
  !> Where points turn about stiff neighbours, the way to rest goes over a hill: so many solves may
  !> leave a residual up to so many times larger before they have to be taken back.
  integer, parameter :: most_ahead = 3
  real(wp), parameter :: farthest = 1.0e5_wp
  !> So many shortened steps that leave more than this of the residual are enough.
  integer, parameter :: most_slow = 3
  real(wp), parameter :: slow_solve = 0.5_wp
  !> A solve that makes the residual this many times larger meets points without stiffness.
  real(wp), parameter :: diverged = 1.0e6_wp

  !> How a solve ended.
  integer, parameter :: at_rest = 1        !! converged
  integer, parameter :: go_on = 2          !! as far as the linear equations tell
  integer, parameter :: no_stiffness = 3   !! a direction meets none, or a negative one
  integer, parameter :: used_up = 4        !! no iterations left

  !> Where a relaxation stands.
  type :: progress_type
    integer :: iterations = 0
    real(wp) :: reference = 0.0_wp    !! square of what acts on the body, as far as it is known
    real(wp) :: change = 0.0_wp       !! of displacement in the last iteration, over displacement
    type(sums_type) :: sums           !! of the last look at the true forces
  end type progress_type

contains

  !> Bring `system`, at rest under earlier conditions, to rest at `instant%time`; bonds don't break.
  !> `trend` is the change of displacement in the load step before, or of size 0. If `gave_way`,
  !> no rest was found, and the displacements are the best on the way.
  subroutine relax_by_conjugate_gradient(system, relaxation, rigid, trend, instant, observer, &
    & gave_way, error)
    type(system_type), intent(inout) :: system
    type(relaxation_type), intent(in) :: relaxation
    type(rigid_type), intent(in) :: rigid
    real(wp), intent(in) :: trend(:, :)
    type(instant_type), intent(inout) :: instant
    class(observer_type), intent(inout) :: observer
    logical, intent(out) :: gave_way
    type(error_type), allocatable, intent(out) :: error
    type(krylov_type) :: krylov
    type(progress_type) :: progress
    real(wp), allocatable :: best(:, :), loads(:, :)
    real(wp) :: before, least
    integer :: ended, ahead, slow
    logical :: fresh, deformed, strict

    gave_way = .false.
    instant%settled = .false.
    allocate (best, source=system%state%u)
    call new_krylov(system, relaxation%mass, krylov)
    allocate (loads, source=0.0_wp*best)
    call add_loads(system, instant%time, 1.0_wp, .false., loads)
    progress%reference = squared_force(system, loads)
    if (.not. progress%reference < largest_reference) then
      call fail(error, 'no rest: the loads of up to '//to_text(maxval(abs(loads)))//' N/m3 are '// &
        & 'so large that energies overflow', status_no_answer)
      return
    end if
    deallocate (loads)
    call begin(system, instant%time, trend, .false., krylov, progress)
    fresh = .true.
    least = progress%sums%residual
    ahead = 0
    slow = 0
    strict = .false.
    do
      before = progress%sums%residual
      call solve(system, relaxation, rigid, krylov, progress, instant, observer, ended, error)
      if (allocated(error)) return
      if (ended == at_rest) return
      if (ended == used_up) then
        call fail_unconverged(relaxation, instant%load_step, instant%residual, progress%change, &
          & error)
        return
      end if
      ! what isn't finite fails these comparisons, too
      deformed = .true.
      if (progress%sums%residual < useful_solve**2*least) then
        deformed = krylov%deformed .or. ended == no_stiffness .or. &
          & progress%sums%residual > good_solve**2*before
        ahead = 0
        strict = .false.
      else if (.not. (strict .or. (krylov%deformed .and. ended == no_stiffness)) .and. &
        & ahead < most_ahead .and. progress%sums%residual <= farthest**2*least) then
        ahead = ahead + 1
      else if (ahead > 0 .or. .not. krylov%deformed) then
        strict = .true.
        ahead = 0
        system%state%u = best
        if (fresh) then
          call begin(system, instant%time, trend, .true., krylov, progress)
          cycle
        end if
        call look(system, instant%time, krylov, progress)
      else
        call shorten(system, instant%time, krylov, progress, gave_way)
        if (progress%sums%residual > slow_solve**2*least) slow = slow + 1
        gave_way = gave_way .or. slow == most_slow
        if (gave_way) return
        strict = .false.
      end if
      call linearise(system, deformed, krylov)
      if (ahead > 0) cycle
      best = system%state%u
      least = progress%sums%residual
      progress%reference = max(progress%reference, progress%sums%support)
      fresh = .false.
    end do
  end subroutine relax_by_conjugate_gradient

  !> The start of a relaxation: what is imposed now comes in as the linear equations have it, so
  !> that no row of bonds is torn, and the trend of the last load step as far as it helps.
  subroutine begin(system, t, trend, deformed, krylov, progress)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: t
    real(wp), intent(in) :: trend(:, :)
    logical, intent(in) :: deformed
    type(krylov_type), intent(inout) :: krylov
    type(progress_type), intent(inout) :: progress
    real(wp), allocatable :: imposed(:, :), rate(:, :)
    real(wp) :: curvature

    call linearise(system, deformed, krylov)
    call look(system, t, krylov, progress)
    progress%reference = max(progress%reference, progress%sums%support)
    if (progress%reference <= 0.0_wp) progress%reference = progress%sums%residual
    allocate (imposed, source=system%state%u)
    allocate (rate, source=system%state%v)
    call impose(system%motions, t, imposed, rate)
    call take_direction(system, imposed - system%state%u, krylov)
    if (krylov%scale > 0.0_wp) then
      call apply_stiffness(system, krylov)
      call go_along(system, 1/krylov%scale, krylov, progress%sums)
      ! to the last digit
      where (system%held == 1_i1) system%state%u = imposed
      progress%reference = max(progress%reference, progress%sums%support)
    end if
    if (size(trend) == 0) return
    call take_direction(system, merge(trend, 0.0_wp, krylov%inverse > 0.0_wp), krylov)
    if (.not. krylov%scale > 0.0_wp) return
    call apply_stiffness(system, krylov)
    curvature = volume_inner(system, krylov%direction, krylov%product)
    if (curvature > 0.0_wp) call go_along(system, &
      & volume_inner(system, krylov%residual, krylov%direction)/curvature, krylov, progress%sums)
  end subroutine begin

  !> Conjugate gradient on the linear equations, which moves the system along and looks at the true
  !> forces now and then. At its end the forces, the residual and the sums are true.
  subroutine solve(system, relaxation, rigid, krylov, progress, instant, observer, ended, error)
    type(system_type), intent(inout) :: system
    type(relaxation_type), intent(in) :: relaxation
    type(rigid_type), intent(in) :: rigid
    type(krylov_type), intent(inout) :: krylov
    type(progress_type), intent(inout) :: progress
    type(instant_type), intent(inout) :: instant
    class(observer_type), intent(inout) :: observer
    integer, intent(out) :: ended
    type(error_type), allocatable, intent(out) :: error
    type(sums_type) :: linear
    real(wp), allocatable :: predicted(:, :)
    real(wp) :: curvature, next_look, limit, largest, reference

    limit = relaxation%tolerance**2
    linear = progress%sums
    call free_of_rigid_motion(system, rigid, krylov)
    call first_direction(system, krylov)
    largest = diverged**2*linear%residual
    next_look = between_looks**2*linear%residual
    do
      reference = max(progress%reference, linear%support)
      if (linear%residual <= max(next_look, limit*reference)) then
        predicted = krylov%residual
        call look(system, instant%time, krylov, progress)
        reference = max(progress%reference, progress%sums%support)
        instant%residual = relative(progress%sums%residual, reference)
        ended = at_rest
        if (progress%sums%residual <= limit*reference .and. &
          & linear%change <= limit*linear%displacement) return
        ended = go_on
        if (squared_force(system, predicted - krylov%residual) > told_apart**2*linear%residual) &
          & return
        ! the directions are conjugate with the linear residual
        krylov%residual = predicted
        next_look = between_looks**2*linear%residual
      end if
      ended = used_up
      if (progress%iterations == relaxation%maximum_iterations) exit
      call apply_stiffness(system, krylov)
      curvature = volume_inner(system, krylov%direction, krylov%product)
      ended = no_stiffness
      if (.not. curvature > smallest_curvature*krylov%norm) exit
      call go_along(system, krylov%rho/curvature, krylov, linear)
      ! loose points: the equations have no solution
      if (.not. linear%residual <= largest) exit
      progress%iterations = progress%iterations + 1
      instant%step = instant%step + 1
      instant%residual = relative(linear%residual, max(progress%reference, linear%support))
      progress%change = relative(linear%change, linear%displacement)
      call observer%observe(system, instant, error)
      if (allocated(error)) return
      call next_direction(system, linear%rho, krylov)
    end do
    call look(system, instant%time, krylov, progress)
    instant%residual = relative(progress%sums%residual, &
      & max(progress%reference, progress%sums%support))
  end subroutine solve

  !> The true forces at the present displacements, and the residual that the loads at `t` leave.
  subroutine look(system, t, krylov, progress)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: t
    type(krylov_type), intent(inout) :: krylov
    type(progress_type), intent(inout) :: progress

    call renew_forces(system)
    call take_residual(system, t, krylov, progress%sums)
  end subroutine look

  !> Forces at the present displacements, nothing imposed.
  subroutine renew_forces(system)
    type(system_type), intent(inout) :: system
    associate (state => system%state, model => system%model)
      if (model%dilatation) &
        & call dilatation_pass(system%family, model, state%u, state%p, system%strained)
      call force_pass(system%family, model, state%u, state%p, state%force, system%strained)
    end associate
  end subroutine renew_forces

  !> After a solve with the tangent that has not taken much of the residual: a shorter step.
  subroutine shorten(system, t, krylov, progress, failed)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: t
    type(krylov_type), intent(inout) :: krylov
    type(progress_type), intent(inout) :: progress
    logical, intent(out) :: failed
    real(wp), allocatable :: step(:, :)
    real(wp) :: whole, base, part
    integer :: halving

    whole = progress%sums%residual
    step = merge(system%state%u - krylov%origin, 0.0_wp, system%held == 0_i1)
    system%state%u = system%state%u - step
    call look(system, t, krylov, progress)
    base = progress%sums%residual
    failed = .false.
    part = 1.0_wp
    do halving = 0, most_halvings
      if (halving == 0 .and. .not. whole < useful_solve**2*base) then
        part = part/2
        cycle
      end if
      system%state%u = system%state%u + part*step
      call look(system, t, krylov, progress)
      if (progress%sums%residual < (1 - (1 - useful_solve)*part)**2*base) return
      system%state%u = system%state%u - part*step
      part = part/2
    end do
    failed = .true.
  end subroutine shorten

  !> Take from the residual what would move the body as a whole: nothing resists that.
  subroutine free_of_rigid_motion(system, rigid, krylov)
    type(system_type), intent(in) :: system
    type(rigid_type), intent(in) :: rigid
    type(krylov_type), intent(inout) :: krylov

    if (rigid%number == 0 .or. krylov%deformed) return
    call remove_free_motions(system, rigid, krylov%residual)
    where (.not. krylov%inverse > 0.0_wp) krylov%residual = 0.0_wp
  end subroutine free_of_rigid_motion

  !> The root of a sum of squares over another, 0 for 0.
  pure real(wp) function relative(squared, reference)
    real(wp), intent(in) :: squared, reference
    relative = 0.0_wp
    if (squared > 0.0_wp) relative = sqrt(squared/reference)
  end function relative

end module pd_motion_conjugate_gradient
