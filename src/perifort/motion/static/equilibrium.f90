!> One static equilibrium, by either solver, and what is done with it: what all rules of growth
!> share.
module pd_motion_static_equilibrium
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type, fail, status_input
  use pd_base_text, only: to_text
  use pd_motion_static_balance, only: balance_type, begin_balance, weigh, balanced_but_for_error, &
    & relative_residual
  use pd_motion_static_conjugate_gradient, only: relax_by_conjugate_gradient
  use pd_motion_static_dynamic, only: relax
  use pd_motion_observer, only: observer_type, instant_type, add_note
  use pd_motion_static_residual, only: relaxation_type
  use pd_motion_static_rigid, only: rigid_type, turn_back
  use pd_motion_account, only: account
  use pd_motion_system, only: system_type, evaluate
  implicit none (type, external)
  private
  public :: find_equilibrium, check_terms, turn_where_free, settle

contains

  !> Bring `system` to equilibrium at the time of `instant`, without breaking bonds: by conjugate
  !> gradients, or by dynamic relaxation where the scene asks for it or they find no equilibrium. If
  !> its memory says that it is on the way there, it continues from there. An error is set if there
  !> is no equilibrium, if it is not found, or if the observer sets one.
  subroutine find_equilibrium(system, relaxation, rigid, instant, observer, error)
    type(system_type), intent(inout) :: system
      !! at its temperature then; in equilibrium on return
    type(relaxation_type), intent(in) :: relaxation  !! solver and tolerance
    type(rigid_type), intent(in) :: rigid            !! its pieces and their free motions
    type(instant_type), intent(inout) :: instant
      !! time and load step; gets step, iterations and notes
    class(observer_type), intent(inout) :: observer  !! called once for each iteration
    type(error_type), allocatable, intent(out) :: error
    logical :: dynamic, unfinished

    dynamic = system%memory%iteration > 0 .or. .not. (relaxation%conjugate_gradient .or. &
      & allocated(system%memory%newton))
    if (.not. dynamic) then
      call relax_by_conjugate_gradient(system, relaxation, rigid, system%memory%trend, &
        & instant, observer, dynamic, error)
      instant%gave_way = dynamic
    end if
    instant%dynamic = dynamic
    if (dynamic .and. .not. allocated(error)) then
      call relax(system, relaxation, rigid, instant, observer, unfinished, error)
      if (unfinished .and. .not. relaxation%conjugate_gradient) &
        & call finish_by_conjugate_gradient(system, relaxation, rigid, instant, observer, error)
    end if
    instant%gave_way = .false.
    instant%dynamic = .false.
    if (allocated(error)) return
    if (allocated(system%memory%rate)) deallocate (system%memory%rate)
    if (allocated(system%memory%base)) deallocate (system%memory%base)
    system%memory%trend = system%memory%trend(:0, :)
  end subroutine find_equilibrium

  !> Continue by conjugate gradients where dynamic relaxation has not converged, and say so; where
  !> they end without an answer, dynamic relaxation begins anew from there, once. Its first error
  !> stays if that finds no equilibrium either.
  subroutine finish_by_conjugate_gradient(system, relaxation, rigid, instant, observer, error)
    type(system_type), intent(inout) :: system       !! where dynamic relaxation ended
    type(relaxation_type), intent(in) :: relaxation
    type(rigid_type), intent(in) :: rigid
    type(instant_type), intent(inout) :: instant
    class(observer_type), intent(inout) :: observer
    type(error_type), allocatable, intent(inout) :: error  !! why dynamic relaxation ended
    type(error_type), allocatable :: first
    real(wp) :: no_trend(0, system%body%dim)
    logical :: gave_way, unfinished

    call move_alloc(error, first)
    system%memory%iteration = 0
    if (allocated(system%memory%rate)) deallocate (system%memory%rate)
    if (allocated(system%memory%base)) deallocate (system%memory%base)
    call add_note(instant, 'dynamic relaxation has found no equilibrium in '// &
      & to_text(instant%iteration)//' iterations; the conjugate gradient solver goes on from there')
    instant%dynamic = .false.
    call relax_by_conjugate_gradient(system, relaxation, rigid, no_trend, instant, observer, &
      & gave_way, error)
    if (gave_way .and. .not. allocated(error)) then
      instant%dynamic = .true.
      call relax(system, relaxation, rigid, instant, observer, unfinished, error)
      if (unfinished) call move_alloc(first, error)
    end if
  end subroutine finish_by_conjugate_gradient

  !> An error if the force of some term depends on displacements for which it has no tangent.
  subroutine check_terms(system, error)
    type(system_type), intent(in) :: system  !! with its terms
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: name

    name = system%terms%without_tangent()
    if (name /= '') call fail(error, 'no static equilibrium can be computed: the force term '// &
      & name//' has no tangent, which a solver needs. Give it one, or integrate in time with '// &
      & 'damping until the body rests', status_input)
  end subroutine check_terms

  !> Take back what pieces that are free have moved as a whole, unless that takes them out of
  !> balance: loads that keep their direction hold a piece as it is turned, and the projected
  !> dilatation isn't the same in a frame that is turned. Then only translations are taken back.
  !> Forces and residual are those of the state that is left.
  subroutine turn_where_free(system, relaxation, rigid, instant)
    type(system_type), intent(inout) :: system       !! in equilibrium; with its forces on return
    type(relaxation_type), intent(in) :: relaxation  !! its tolerance
    type(rigid_type), intent(in) :: rigid            !! its pieces and their free motions
    type(instant_type), intent(inout) :: instant     !! its time; gets the residual that is left
    type(balance_type) :: balance
    real(wp), allocatable :: found(:, :)
    real(wp) :: before

    if (any(rigid%piece%number > 0)) then
      call begin_balance(system, rigid, instant%time, balance)
      call weigh(system, relaxation, rigid, instant%time, balance)
      before = relative_residual(balance)
      allocate (found, source=system%state%u)
      call turn_back(system, rigid, .true., system%state%u)
      call evaluate(system, instant%time, breaking=.false.)
      call weigh(system, relaxation, rigid, instant%time, balance)
      instant%residual = relative_residual(balance)
      if (instant%residual <= before .or. balanced_but_for_error(relaxation, rigid, balance)) return
      system%state%u = found
      call turn_back(system, rigid, .false., system%state%u)
      instant%residual = before
    end if
    call evaluate(system, instant%time, breaking=.false.)
  end subroutine turn_where_free

  !> An equilibrium that counts, whose forces are known: let the observer see it.
  subroutine settle(system, instant, observer, error)
    type(system_type), intent(inout) :: system       !! gets its work and reactions
    type(instant_type), intent(inout) :: instant     !! which one it is; loses its note
    class(observer_type), intent(inout) :: observer  !! is called once
    type(error_type), allocatable, intent(out) :: error

    system%state%v = 0.0_wp
    call account(system, instant%time)
    instant%settled = .true.
    system%memory%step = instant%step
    system%memory%load_step = instant%load_step
    system%memory%iteration = 0
    call observer%observe(system, instant, error)
    if (allocated(instant%note)) deallocate (instant%note)
  end subroutine settle

end module pd_motion_static_equilibrium
