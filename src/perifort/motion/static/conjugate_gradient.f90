!> Static equilibrium by Newton's method with a conjugate gradient inside (doc/theory.md, 7). The
!> residual is the force as the model has it; the linear equations take a symmetric stiffness: at
!> first that of the undeformed body with the bonds it has now, which the fast formulas give, and
!> where that fails, the tangent at the present displacements. Where no equilibrium is found
!> so, dynamic relaxation continues.
module pd_motion_static_conjugate_gradient
  use pd_base_kinds, only: wp, i1
  use pd_body_body, only: share_halo
  use pd_base_error, only: error_type, fail, status_no_answer
  use pd_base_text, only: to_text
  use pd_motion_static_balance, only: balance_type, begin_balance, weigh, weigh_energies, &
    & weigh_slow, &
    & balanced_but_for_error, allowed_error, error_is_known, relative_residual, fail_unconverged, &
    & check_drowned, rounding_note
  use pd_motion_conditions, only: impose
  use pd_motion_static_krylov, only: make_room, make_coarse_part, linearise, take_residual, &
    & first_direction, next_direction, take_direction, apply_stiffness, go_along, volume_inner, &
    & note_length, smallest_curvature
  use pd_motion_newton, only: newton_type, krylov_type, sums_type
  use pd_motion_observer, only: observer_type, instant_type, add_note
  use pd_motion_pins, only: fit_pins, held_but_for_pins, snap_pins
  use pd_motion_static_residual, only: relaxation_type, squared_force
  use pd_motion_static_rigid, only: rigid_type, remove_free_motions
  use pd_motion_static_start, only: move_along
  use pd_motion_system, only: system_type, renew_forces
  implicit none (type, external)
  private
  public :: relax_by_conjugate_gradient

  !> Square of a force [N2] whose energies would be infinities.
  real(wp), parameter :: largest_reference = 1.0e200_wp
  !> The forces are evaluated anew whenever the residual of the linear equations has fallen by this
  !> factor; a solve ends when what is not linear makes more than `not_linear` of what is left.
  real(wp), parameter :: between_checks = 0.1_wp, not_linear = 0.3_wp
  !> ... and by this one after the tolerance has been reached, while something is still not known to
  !> be in equilibrium.
  real(wp), parameter :: between_last_checks = 0.3_wp
  !> Solves that gain nothing any more end at a residual below this and in balance, if the tolerance
  !> asks for more than the rounding of the forces lets them have.
  real(wp), parameter :: stalled = 1.0e-5_wp
  !> So many iterations suffice to estimate how soft the stiffness is.
  integer, parameter :: enough_iterations = 10
  !> A solve that leaves more than this of the residual makes the undeformed stiffness give way to
  !> the tangent.
  real(wp), parameter :: good_solve = 0.3_wp
  !> With the tangent, a solve has to take at least a part of the residual, if need be by a shorter
  !> step.
  real(wp), parameter :: useful_solve = 0.9_wp
  integer, parameter :: most_halvings = 6
  !> Where points turn about stiff neighbours, the residual may grow on the way: so many solves may
  !> leave a residual up to so many times larger before they have to be taken back.
  integer, parameter :: most_ahead = 3
  real(wp), parameter :: farthest = 1.0e5_wp
  !> So many shortened steps that leave more than this of the residual are enough.
  integer, parameter :: most_slow = 3
  real(wp), parameter :: slow_solve = 0.5_wp
  !> A solve that makes the residual this many times larger meets points without stiffness.
  real(wp), parameter :: diverged = 1.0e6_wp

  !> How a solve ended.
  integer, parameter :: under_way = 0       !! it hasn't
  integer, parameter :: at_equilibrium = 1  !! converged
  integer, parameter :: end_of_linear = 2   !! as far as the linear equations are valid
  integer, parameter :: no_stiffness = 3    !! a direction meets none, or a negative one
  integer, parameter :: used_up = 4         !! no iterations left

contains

  !> Bring `system`, in equilibrium under earlier conditions, to equilibrium at `instant%time`;
  !> bonds don't break. If its memory says that it is on the way there, it continues from there.
  !> `trend` is the change of displacement in the load step before, or of size 0. If `gave_way`, no
  !> equilibrium was found, and the displacements are the best on the way. An error is set if the
  !> iterations are used up, if rounding hides the equilibrium, or if the observer sets one.
  subroutine relax_by_conjugate_gradient(system, relaxation, rigid, trend, instant, observer, &
    & gave_way, error)
    type(system_type), intent(inout) :: system
      !! in equilibrium on return; its memory has the progress until then
    type(relaxation_type), intent(in) :: relaxation  !! tolerance, iterations and the preconditioner
    type(rigid_type), intent(in) :: rigid            !! its pieces and their free motions
    real(wp), intent(in) :: trend(:, :)              !! (n_slots, dim), or of 0 rows [m]
    type(instant_type), intent(inout) :: instant
      !! time and load step; gets step, iterations and notes
    class(observer_type), intent(inout) :: observer  !! called once for each iteration
    logical, intent(out) :: gave_way                 !! dynamic relaxation has to continue
    type(error_type), allocatable, intent(out) :: error
    type(newton_type), allocatable :: newton
    type(balance_type) :: balance
    real(wp), allocatable :: change(:, :)
    integer :: ended
    logical :: amid

    gave_way = .false.
    instant%settled = .false.
    call begin_balance(system, rigid, instant%time, balance)
    amid = allocated(system%memory%newton)
    if (amid) then
      call move_alloc(system%memory%newton, newton)
      call make_room(system, relaxation%mass, newton%krylov)
      call make_coarse_part(system, newton%krylov)
      if (newton%coarse .neqv. allocated(newton%krylov%slow)) then
        ! on another number of ranks: directions of another preconditioner are of no use
        call evaluate_residual(system, instant%time, newton%krylov, newton%sums)
        amid = .false.
      end if
    else
      allocate (newton)
      call make_room(system, relaxation%mass, newton%krylov)
      call make_coarse_part(system, newton%krylov)
      call check_loads(balance, error)
      if (allocated(error)) return
      change = trend
      call move_along(system, rigid, instant%time, change)
      call fit_pins(system)
      call begin(system, instant%time, change, .false., newton)
      newton%least = newton%sums%residual
    end if
    newton%coarse = allocated(newton%krylov%slow)
    if (.not. allocated(change)) change = trend(:0, :)
    do
      if (.not. amid) call begin_solve(system, rigid, newton)
      amid = .false.
      call solve(system, relaxation, rigid, balance, newton, instant, observer, ended, error)
      if (allocated(error)) return
      if (ended == at_equilibrium) then
        call add_note(instant, rounding_note(relaxation, balance))
        exit
      end if
      if (ended == used_up) then
        call fail_unconverged(system, relaxation, rigid, balance, instant%load_step, instant%time, &
          & newton%change, error)
        return
      end if
      if (has_stalled(system, relaxation, rigid, instant%time, newton, balance)) then
        instant%residual = relative_residual(balance)
        call add_note(instant, rounding_note(relaxation, balance))
        exit
      end if
      call judge(system, instant%time, change, ended, newton, gave_way)
      if (gave_way) return
    end do
    if (newton%iterations >= enough_iterations .and. newton%softness > 0.0_wp) &
      & system%memory%softness = newton%softness
    call check_drowned(system, relaxation, rigid, balance, error)
  end subroutine relax_by_conjugate_gradient

  !> An error if loads or thermal forces are beyond what can be squared.
  subroutine check_loads(balance, error)
    type(balance_type), intent(in) :: balance
    type(error_type), allocatable, intent(out) :: error

    if (.not. balance%acting < largest_reference) call fail(error, 'no static equilibrium: the '// &
      & 'loads or thermal forces of '//to_text(sqrt(balance%acting), 3)// &
        & ' N (root sum of squares '// &
      & 'over the points) are so large that energies overflow', status_no_answer)
  end subroutine check_loads

  !> Whether solves gain nothing any more, in a state that is in balance to what can be reached.
  logical function has_stalled(system, relaxation, rigid, t, newton, balance)
    type(system_type), intent(inout) :: system
    type(relaxation_type), intent(in) :: relaxation
    type(rigid_type), intent(in) :: rigid
    real(wp), intent(in) :: t
    type(newton_type), intent(in) :: newton
    type(balance_type), intent(inout) :: balance
    type(relaxation_type) :: loosened

    has_stalled = .false.
    if (newton%sums%residual < useful_solve**2*newton%least .or. newton%softness <= 0.0_wp) return
    if (newton%ahead < most_ahead .and. .not. newton%strict) return
    loosened%tolerance = max(stalled, relaxation%tolerance)
    loosened%mass = relaxation%mass
    call weigh(system, loosened, rigid, t, balance)
    if (.not. balanced_but_for_error(loosened, rigid, balance)) return
    call weigh_energies(system, rigid, balance)
    call weigh_slow(system, rigid, newton%krylov, balance)
    has_stalled = error_is_known(balance, newton%softness, allowed_error(loosened, balance))
  end function has_stalled

  !> The start of a relaxation: what is imposed now comes in as the linear equations have it, so
  !> that no row of bonds is torn, and the trend of the last load step as far as it helps.
  subroutine begin(system, t, trend, deformed, newton)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: t
    real(wp), intent(in) :: trend(:, :)
    logical, intent(in) :: deformed
    type(newton_type), intent(inout) :: newton
    real(wp), allocatable :: imposed(:, :), rate(:, :)
    real(wp) :: curvature

    associate (krylov => newton%krylov, sums => newton%sums)
      call linearise(system, deformed, krylov)
      call evaluate_residual(system, t, krylov, sums)
      allocate (imposed, source=system%state%u)
      allocate (rate, source=system%state%v)
      call impose(system%motions, t, imposed, rate)
      call take_direction(system, imposed - system%state%u, krylov)
      if (krylov%scale > 0.0_wp) then
        call apply_stiffness(system, krylov)
        call go_along(system, 1/krylov%scale, krylov, sums)
        ! to the last digit
        where (system%held == 1_i1) system%state%u = imposed
      end if
      if (size(trend) == 0) return
      call take_direction(system, merge(trend, 0.0_wp, krylov%inverse > 0.0_wp), krylov)
      if (.not. krylov%scale > 0.0_wp) return
      call apply_stiffness(system, krylov)
      curvature = volume_inner(system, krylov%direction, krylov%product)
      if (curvature > 0.0_wp) call go_along(system, &
        & volume_inner(system, krylov%residual, krylov%direction)/curvature, krylov, sums)
    end associate
  end subroutine begin

  !> After a solve without equilibrium: whether the residual has fallen, may grow for a while, or
  !> the solve has to be taken back or shortened, and where the next one is linearised. `gave_way`:
  !> nothing helps.
  subroutine judge(system, t, trend, ended, newton, gave_way)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: t
    real(wp), intent(in) :: trend(:, :)
    integer, intent(in) :: ended
    type(newton_type), intent(inout) :: newton
    logical, intent(out) :: gave_way
    logical :: deformed

    gave_way = .false.
    deformed = .true.
    associate (krylov => newton%krylov, residual => newton%sums%residual)
      if (newton%krylov%ritz%softness > 0.0_wp .and. ended /= no_stiffness) &
        & newton%softness = max(newton%softness, krylov%ritz%softness)
      ! what isn't finite fails these comparisons, too
      if (residual < useful_solve**2*newton%least) then
        deformed = krylov%deformed .or. ended == no_stiffness .or. &
          & residual > good_solve**2*newton%before
        newton%ahead = 0
        newton%strict = .false.
      else if (.not. (newton%strict .or. (krylov%deformed .and. ended == no_stiffness)) .and. &
        & newton%ahead < most_ahead .and. residual <= farthest**2*newton%least) then
        if (newton%ahead == 0) newton%best = krylov%origin
        newton%ahead = newton%ahead + 1
        call linearise(system, deformed, krylov)
        return
      else if (newton%ahead > 0 .or. .not. krylov%deformed) then
        newton%strict = .true.
        system%state%u = krylov%origin
        if (newton%ahead > 0) system%state%u = newton%best
        newton%ahead = 0
        if (newton%fresh) then
          if (allocated(newton%best)) deallocate (newton%best)
          call begin(system, t, trend, deformed, newton)
          return
        end if
        call evaluate_residual(system, t, krylov, newton%sums)
      else
        call shorten(system, t, krylov, newton%sums, gave_way)
        if (residual > slow_solve**2*newton%least) newton%slow = newton%slow + 1
        gave_way = gave_way .or. newton%slow == most_slow
        if (gave_way) return
        newton%strict = .false.
      end if
      call linearise(system, deformed, krylov)
      newton%least = residual
      newton%fresh = .false.
    end associate
    if (allocated(newton%best)) deallocate (newton%best)
  end subroutine judge

  !> Begin a solve at the present displacements, whose true forces are known.
  subroutine begin_solve(system, rigid, newton)
    type(system_type), intent(in) :: system
    type(rigid_type), intent(in) :: rigid
    type(newton_type), intent(inout) :: newton

    newton%before = newton%sums%residual
    newton%linear = newton%sums
    newton%asked = .false.
    call free_of_rigid_motion(system, rigid, newton%krylov)
    call first_direction(system, newton%krylov)
    newton%hopeless = diverged**2*newton%linear%residual
    newton%next_check = between_checks**2*newton%linear%residual
  end subroutine begin_solve

  !> Conjugate gradient on the linear equations, which moves the system along and evaluates the
  !> true forces now and then. At its end the forces, the residual and the sums are true. All that
  !> one iteration leaves to the next is in `newton`, so that it can be interrupted between any two.
  subroutine solve(system, relaxation, rigid, balance, newton, instant, observer, ended, error)
    type(system_type), intent(inout) :: system
    type(relaxation_type), intent(in) :: relaxation
    type(rigid_type), intent(in) :: rigid
    type(balance_type), intent(inout) :: balance
    type(newton_type), allocatable, intent(inout) :: newton
    type(instant_type), intent(inout) :: instant
    class(observer_type), intent(inout) :: observer
    integer, intent(out) :: ended
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: limit

    do
      limit = relaxation%tolerance**2*max(balance%acting, newton%linear%support)
      if (newton%linear%residual <= newton%next_check .or. &
        & (newton%linear%residual <= limit .and. .not. newton%asked)) then
        newton%asked = newton%linear%residual <= limit
        call compare(system, relaxation, rigid, balance, instant, newton, ended)
        if (ended /= under_way) return
      end if
      ended = used_up
      if (newton%iterations == relaxation%maximum_iterations) exit
      call iterate(system, newton, ended)
      if (ended /= under_way) exit
      instant%step = instant%step + 1
      instant%iteration = instant%step - system%memory%began
      instant%residual = relative(newton%linear%residual, &
        & max(balance%acting, newton%linear%support))
      instant%change = newton%change
      call show(system, newton, instant, observer, error)
      if (allocated(error)) return
    end do
    call evaluate_residual(system, instant%time, newton%krylov, newton%sums)
    instant%residual = relative(newton%sums%residual, max(balance%acting, newton%sums%support))
    if (ended == used_up) call weigh(system, relaxation, rigid, instant%time, balance)
  end subroutine solve

  !> Compare what the linear equations leave with the true forces, and these with what acts.
  subroutine compare(system, relaxation, rigid, balance, instant, newton, ended)
    type(system_type), intent(inout) :: system
    type(relaxation_type), intent(in) :: relaxation
    type(rigid_type), intent(in) :: rigid
    type(balance_type), intent(inout) :: balance
    type(instant_type), intent(inout) :: instant
    type(newton_type), intent(inout) :: newton
    integer, intent(out) :: ended
    real(wp), allocatable :: predicted(:, :), of_pins(:, :)

    associate (krylov => newton%krylov, sums => newton%sums, linear => newton%linear)
      predicted = krylov%residual
      of_pins = krylov%of_pins
      call evaluate_residual(system, instant%time, krylov, sums)
      call weigh(system, relaxation, rigid, instant%time, balance)
      instant%residual = relative_residual(balance)
      ended = at_equilibrium
      if (linear%change <= relaxation%tolerance**2*linear%displacement) then
        if (in_equilibrium(system, relaxation, rigid, newton, balance)) return
      end if
      ended = end_of_linear
      if (squared_force(system, predicted - krylov%residual) > not_linear**2*linear%residual) return
      ended = under_way
      ! the directions are conjugate with the linear residual
      krylov%residual = predicted
      krylov%of_pins = of_pins
      newton%next_check = linear%residual &
        & *merge(between_last_checks, between_checks, newton%asked)**2
    end associate
  end subroutine compare

  !> Whether the state that was weighed is in equilibrium, and its displacements are known to be
  !> near enough to it.
  logical function in_equilibrium(system, relaxation, rigid, newton, balance)
    type(system_type), intent(inout) :: system
    type(relaxation_type), intent(in) :: relaxation
    type(rigid_type), intent(in) :: rigid
    type(newton_type), intent(inout) :: newton
    type(balance_type), intent(inout) :: balance
    real(wp) :: softness

    in_equilibrium = balanced_but_for_error(relaxation, rigid, balance)
    if (.not. in_equilibrium) return
    newton%softness = max(newton%softness, newton%krylov%ritz%softness)
    softness = newton%softness
    if (newton%iterations < enough_iterations) softness = max(softness, system%memory%softness)
    call weigh_energies(system, rigid, balance)
    call weigh_slow(system, rigid, newton%krylov, balance)
    in_equilibrium = error_is_known(balance, softness, allowed_error(relaxation, balance))
  end function in_equilibrium

  !> One iteration on the linear equations, up to the direction of the next one.
  subroutine iterate(system, newton, ended)
    type(system_type), intent(inout) :: system
    type(newton_type), intent(inout) :: newton
    integer, intent(out) :: ended
    real(wp) :: curvature

    ended = no_stiffness
    associate (krylov => newton%krylov, linear => newton%linear)
      call apply_stiffness(system, krylov)
      curvature = volume_inner(system, krylov%direction, krylov%product)
      if (.not. curvature > smallest_curvature*krylov%norm) return
      call note_length(curvature, krylov)
      call go_along(system, krylov%rho/curvature, krylov, linear)
      ! loose points: the equations have no solution
      if (.not. linear%residual <= newton%hopeless) return
      ended = under_way
      newton%iterations = newton%iterations + 1
      newton%change = relative(linear%change, linear%displacement)
      call next_direction(system, linear%rho, krylov)
    end associate
  end subroutine iterate

  !> Call the observer after an iteration. All that the next one needs is in the system's memory
  !> then, where a checkpoint finds it.
  subroutine show(system, newton, instant, observer, error)
    type(system_type), intent(inout) :: system
    type(newton_type), allocatable, intent(inout) :: newton
    type(instant_type), intent(inout) :: instant
    class(observer_type), intent(inout) :: observer
    type(error_type), allocatable, intent(out) :: error

    call move_alloc(newton, system%memory%newton)
    system%memory%step = instant%step
    system%memory%load_step = instant%load_step
    call observer%observe(system, instant, error)
    if (allocated(instant%note)) deallocate (instant%note)
    if (.not. allocated(error)) call move_alloc(system%memory%newton, newton)
  end subroutine show

  !> The true forces at the present displacements, with pins rigid, the residual that the loads at
  !> `t` leave, and its sums.
  subroutine evaluate_residual(system, t, krylov, sums)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: t
    type(krylov_type), intent(inout) :: krylov
    type(sums_type), intent(out) :: sums

    call snap_pins(system, t)
    call renew_forces(system, t)
    call take_residual(system, t, krylov, sums)
  end subroutine evaluate_residual

  !> After a solve with the tangent that has not taken much of the residual: a shorter step.
  subroutine shorten(system, t, krylov, sums, failed)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: t
    type(krylov_type), intent(inout) :: krylov
    type(sums_type), intent(inout) :: sums
    logical, intent(out) :: failed
    real(wp), allocatable :: step(:, :)
    real(wp) :: whole, base, part
    integer :: halving

    whole = sums%residual
    step = merge(system%state%u - krylov%origin, 0.0_wp, held_but_for_pins(system) == 0_i1)
    system%state%u = system%state%u - step
    call evaluate_residual(system, t, krylov, sums)
    base = sums%residual
    failed = .false.
    part = 1.0_wp
    do halving = 0, most_halvings
      if (halving == 0 .and. .not. whole < useful_solve**2*base) then
        part = part/2
        cycle
      end if
      system%state%u = system%state%u + part*step
      call evaluate_residual(system, t, krylov, sums)
      if (sums%residual < (1 - (1 - useful_solve)*part)**2*base) return
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

    if (all(rigid%piece%number == 0) .or. krylov%deformed) return
    call remove_free_motions(system, rigid, krylov%residual)
    where (.not. krylov%inverse > 0.0_wp) krylov%residual = 0.0_wp
  end subroutine free_of_rigid_motion

  !> The root of a sum of squares over another, 0 for 0.
  pure real(wp) function relative(squared, reference)
    real(wp), intent(in) :: squared, reference
    relative = 0.0_wp
    if (squared > 0.0_wp) relative = sqrt(squared/max(reference, tiny(1.0_wp)))
  end function relative

end module pd_motion_static_conjugate_gradient
