!> Growth in statics by events (doc/theory.md, 7): from an equilibrium, the load factor at which the
!> next bond reaches its limit is found, that bond breaks with those that are as near to theirs, and
!> the next equilibrium follows at that load factor, or at the one where again a bond is at its
!> limit.
module pd_motion_static_events
  use pd_base_error, only: error_type, fail, internal_fault, status_input, status_no_answer
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: to_text
  use pd_force_springs, only: springs_type
  use pd_motion_conditions, only: free_component, moved_by_displacement, motion_type
  use pd_motion_curve, only: curve_type
  use pd_motion_heating, only: is_timed
  use pd_motion_loads, only: load_type, load_of, number_of_loads, other_terms
  use pd_motion_memory, only: memory_type, not_begun
  use pd_motion_observer, only: observer_type, instant_type, add_note
  use pd_motion_static_equilibrium, only: find_equilibrium, check_terms, turn_where_free, settle
  use pd_motion_pins, only: fit_pins
  use pd_motion_static_pins, only: check_pins
  use pd_motion_static_residual, only: relaxation_type
  use pd_motion_static_rigid, only: rigid_type, find_free_motions, check_balance
  use pd_motion_static_start, only: loose_text
  use pd_motion_system, only: system_type, bring_temperature, break_batch, evaluate, &
    & explain_condition, greatest_ratio, renew_conditions
  use pd_motion_watch_rescue, only: good_state_type, keep_good, show_good
  implicit none (type, external)
  private
  public :: grow_by_events, why_not_events

  !> Why an equilibrium is sought.
  integer, parameter :: at_start = 0     !! it is that without loads
  integer, parameter :: probe = 1        !! for the first response, at a small load factor
  integer, parameter :: load_step = 2    !! a load step ends there
  integer, parameter :: event = 3        !! the next bond should be at its limit there
  integer, parameter :: after_break = 4  !! bonds have broken at this load factor
  integer, parameter :: unloaded = 5     !! the body has come apart

  !> Load factor of the probe, over that of the first load step: there is no bond near its limit,
  !> unless that of the load step is thousands of times too large.
  real(wp), parameter :: small_part = 1.0e-3_wp
  !> A bond is at its limit if its stretch is so near to it, in tolerances of the equilibrium, but
  !> within these bounds: a stretch is not known better than the displacements.
  real(wp), parameter :: tolerances = 10.0_wp, finest = 1.0e-9_wp, coarsest = 1.0e-3_wp
  !> An equilibrium that only says where the next one is needs no smaller tolerance than this.
  real(wp), parameter :: rough = 1.0e-3_wp
  !> Bonds with the same stretch differ by rounding.
  real(wp), parameter :: same = 1.0e-12_wp
  !> The slope of the ratio over the load factor is that of the last two equilibria, if it is so
  !> near to that of the line through the origin, else the latter.
  real(wp), parameter :: flattest = 0.5_wp, steepest = 2.0_wp
  !> Equilibria that one event may take: with a nearly linear response it is one or two.
  integer, parameter :: most_tries = 25
  !> Deviation from a straight line through the origin that is rounding.
  real(wp), parameter :: straight = 1.0e-12_wp

contains

  !> Let bonds break by events while the load factor goes from 0 to 1, or until so many events have
  !> been. Every equilibrium that counts is settled: those of the load steps, those at which a bond
  !> reaches its limit, and, if the load is controlled, those after bonds have broken. If the memory
  !> of the system says that it has begun, it continues from there. Errors as of `run_relaxation`.
  subroutine grow_by_events(system, relaxation, observer, error)
    type(system_type), intent(inout) :: system
      !! ready, or as a checkpoint left it; loaded in proportion to the load factor
    type(relaxation_type), intent(in) :: relaxation  !! solver, load steps, tolerance, control
    class(observer_type), intent(inout) :: observer
      !! called once for each iteration and settled equilibrium
    type(error_type), allocatable, intent(out) :: error
    type(instant_type) :: instant
    type(rigid_type) :: rigid
    type(good_state_type) :: good
    type(relaxation_type) :: roughly
    real(wp) :: ratio
    logical :: amid, stands

    system%static = .true.
    instant%dt = 1.0_wp
    roughly = relaxation
    roughly%tolerance = max(rough, relaxation%tolerance)
    call check_terms(system, error)
    if (allocated(error)) return
    call find_free_motions(system, rigid)
    call renew_conditions(system, 1.0_wp)
    if (allocated(system%fault)) call explain_condition(system, status_input, error)
    if (allocated(error)) return
    ! pieces that broke off are looked at when they do
    if (system%memory%step == not_begun) then
      call check_pins(system, rigid, status_input, error)
      if (.not. allocated(error)) call check_balance(system, rigid, 1.0_wp, status_input, error)
      if (allocated(error)) return
      instant%note = loose_text(system, rigid, 1)
      system%memory = memory_type()
      call evaluate(system, 0.0_wp, breaking=.false.)
      call settle(system, instant, observer, error)
      if (allocated(error)) return
    end if
    associate (memory => system%memory)
      instant%step = memory%step
      instant%events = memory%events
      if (.not. allocated(memory%trend)) allocate (memory%trend(0, system%body%dim))
      call bring_temperature(system, memory%factor)
      amid = memory%iteration > 0 .or. allocated(memory%newton)
      stands = .true.
      ratio = 0.0_wp
      if (.not. amid) then
        call keep_instant(instant)
        call keep_good(good, system, instant)
        ratio = greatest_ratio(system)
      end if
      do
        if (.not. amid) then
          call go_on(system, relaxation, rigid, instant, stands, ratio, error)
          if (allocated(error)) exit
          memory%began = instant%step
        end if
        amid = .false.
        call keep_instant(instant)
        call bring_temperature(system, instant%time)
        if (memory%purpose == after_break .and. .not. relaxation%load_controlled) then
          call find_equilibrium(system, roughly, rigid, instant, observer, error)
        else
          call find_equilibrium(system, relaxation, rigid, instant, observer, error)
        end if
        if (allocated(error)) exit
        call turn_where_free(system, relaxation, rigid, instant)
        ratio = greatest_ratio(system)
        call judge(memory, relaxation, ratio, stands, instant)
        if (.not. stands) cycle
        call settle(system, instant, observer, error)
        if (allocated(error)) return
        if (instant%last) exit
        call keep_good(good, system, instant)
      end do
      if (allocated(error)) then
        if (error%status == status_no_answer) call show_good(good, system, observer, error)
        return
      end if
      memory%step = not_begun  ! another run begins anew
    end associate

  contains

    !> The time of an instant is the load factor; iterations belong to the load step to come.
    subroutine keep_instant(instant)
      type(instant_type), intent(inout) :: instant

      instant%load_step = min(system%memory%reached + 1, relaxation%load_steps)
      instant%time = system%memory%factor
      instant%events = system%memory%events
      system%time = instant%time
    end subroutine keep_instant
  end subroutine grow_by_events

  !> Choose the next equilibrium, and bring the displacements near to it. At one that counts, where
  !> bonds are at their limit, these break.
  subroutine go_on(system, relaxation, rigid, instant, stands, ratio, error)
    type(system_type), intent(inout) :: system       !! in equilibrium
    type(relaxation_type), intent(in) :: relaxation
    type(rigid_type), intent(inout) :: rigid         !! found again when bonds have broken
    type(instant_type), intent(inout) :: instant     !! gets notes
    logical, intent(in) :: stands                    !! whether the equilibrium counts
    real(wp), intent(in) :: ratio                    !! its largest stretch over the limit [-]
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: next, next_step
    integer(i8) :: number
    integer :: parts

    associate (memory => system%memory)
      if (memory%purpose == at_start) then
        memory%purpose = probe
        memory%factor = small_part/relaxation%load_steps
        return
      end if
      if (stands .and. ratio >= 1 - accuracy(relaxation)) then
        call break_batch(system, ratio*(1 - max(relaxation%batch, same)), number)
        if (number == 0_i8) call internal_fault('no bond is at its limit')
        memory%events = memory%events + 1
        memory%tries = 0
        memory%tried_factor = 0.0_wp
        memory%tried_ratio = 0.0_wp
        memory%purpose = after_break
        parts = rigid%pieces%number
        call find_free_motions(system, rigid)
        call add_note(instant, loose_text(system, rigid, parts))
        call check_pins(system, rigid, status_no_answer, error)
        if (.not. allocated(error)) &
          & call check_balance(system, rigid, memory%factor, status_no_answer, error)
        if (relaxation%load_controlled .or. .not. allocated(error)) return
        ! no load factor but 0 has an equilibrium
        deallocate (error)
        memory%purpose = unloaded
        memory%factor = 0.0_wp
        system%state%u = 0.0_wp
        call fit_pins(system)
        call add_note(instant, 'the body has come apart at event '//to_text(memory%events)// &
          & ': it bears no load any more, and the run ends there')
        return
      end if
      if (.not. stands) memory%tries = memory%tries + 1
      if (memory%tries > most_tries) then
        call fail(error, 'the load factor at which the next bond breaks is not found near '// &
          & to_text(memory%factor, 6)//': at the equilibrium there the largest stretch is '// &
          & to_text(ratio, 6)//' of its limit. The response is too far from linear for growth '// &
          & '= ''events''; use growth = ''load_steps''', status_no_answer)
        return
      end if
      next = load_factor_of_limit(memory, ratio)
      next_step = real(memory%reached + 1, wp)/relaxation%load_steps
      memory%tried_factor = memory%factor
      memory%tried_ratio = ratio
      memory%purpose = event
      if (.not. next < next_step*(1 - accuracy(relaxation))) then
        memory%purpose = load_step
        next = next_step
      end if
      system%state%u = next/memory%factor*system%state%u
      call fit_pins(system)
      memory%factor = next
    end associate
  end subroutine go_on

  !> The load factor at which the largest stretch reaches its limit, by the line through the last
  !> two equilibria with the same bonds; of the first of them, through the origin.
  pure real(wp) function load_factor_of_limit(memory, ratio) result(factor)
    type(memory_type), intent(in) :: memory
    real(wp), intent(in) :: ratio
    real(wp) :: slope, straight_slope

    factor = huge(factor)
    if (.not. ratio > 0.0_wp) return
    straight_slope = ratio/memory%factor
    slope = straight_slope
    if (abs(memory%factor - memory%tried_factor) > small_part*memory%factor) &
      & slope = (ratio - memory%tried_ratio)/(memory%factor - memory%tried_factor)
    if (slope < flattest*straight_slope .or. slope > steepest*straight_slope) slope = straight_slope
    factor = memory%factor + (1 - ratio)/slope
    if (.not. factor > 0.0_wp) factor = 1/straight_slope
  end function load_factor_of_limit

  !> Whether an equilibrium counts, which is then noted in `instant`.
  pure subroutine judge(memory, relaxation, ratio, stands, instant)
    type(memory_type), intent(inout) :: memory
    type(relaxation_type), intent(in) :: relaxation
    real(wp), intent(in) :: ratio
    logical, intent(out) :: stands
    type(instant_type), intent(inout) :: instant
    logical :: below

    below = ratio < 1 - accuracy(relaxation)
    select case (memory%purpose)
    case (load_step)
      stands = ratio <= 1 + accuracy(relaxation)
    case (event)
      stands = .not. below .and. ratio <= 1 + accuracy(relaxation)
    case (after_break)
      ! else it is a rough one
      stands = relaxation%load_controlled
    case (unloaded)
      stands = .true.
    case default
      stands = .false.
    end select
    if (.not. stands) return
    memory%tries = 0
    if (memory%purpose == load_step) memory%reached = memory%reached + 1
    instant%between = memory%purpose /= load_step
    instant%load_step = memory%reached
    instant%last = memory%purpose == unloaded .or. memory%events >= relaxation%most_events .or. &
      & (memory%reached == relaxation%load_steps .and. (below .or. .not. &
      & relaxation%load_controlled))
  end subroutine judge

  !> How near to 1 a ratio of stretch and limit counts as 1 [-].
  pure real(wp) function accuracy(relaxation)
    type(relaxation_type), intent(in) :: relaxation
    accuracy = min(coarsest, max(finest, tolerances*relaxation%tolerance))
  end function accuracy

  !> Why a system cannot grow by events, '' if it can: everything that acts has to be proportional
  !> to the load factor, and a bond must be the same at the same stretch.
  function why_not_events(system) result(reason)
    type(system_type), intent(in), target :: system  !! ready at t = 0
    character(:), allocatable :: reason
    type(load_type), pointer :: load
    integer :: i

    reason = ''
    if (system%model%generic) then
      do i = 1, size(system%model%laws)
        associate (law => system%model%laws(i)%law)
          if (law%bond_history + law%point_history > 0) reason = 'a bond law has a history'
        end associate
      end do
    end if
    do i = 1, size(system%motions)
      if (reason == '') reason = why_not_motion(system%motions(i), system%body%dim)
    end do
    do i = 1, number_of_loads(system%terms)
      load => load_of(system%terms, i)
      if (.not. (any(abs(load%density) > 0.0_wp) .or. allocated(load%parts))) cycle
      if (reason == '' .and. allocated(load%parts)) reason = 'a load is an expression of t'
      if (reason == '' .and. .not. is_proportional(load%curve)) &
        & reason = 'a load is not proportional to t'
    end do
    do i = system%terms%number() - other_terms(system%terms) + 1, system%terms%number()
      select type (term => system%terms%items(i)%term)
      type is (springs_type)
        continue
      class default
        ! others may depend on the path or on velocities
        if (reason == '') reason = 'a force term acts beside loads and springs'
      end select
    end do
    if (reason /= '' .or. .not. system%model%thermal) return
    reason = 'a temperature change acts at once'
    if (.not. allocated(system%heating%curves)) return
    reason = ''
    do i = 1, size(system%heating%curves)
      if (.not. any(system%heating%course == i)) cycle
      if (is_timed(system%heating, i) .or. .not. is_proportional(system%heating%curves(i))) &
        & reason = 'a temperature change is not proportional to t'
    end do
  end function why_not_events

  !> Why an imposed motion is in the way, '' if it isn't.
  pure function why_not_motion(motion, dim) result(reason)
    type(motion_type), intent(in) :: motion
    integer, intent(in) :: dim
    character(:), allocatable :: reason
    logical :: moves
    integer :: c

    reason = ''
    do c = 1, dim
      if (motion%kind(c) == free_component) cycle
      if (motion%by_time(c)) then
        reason = 'the motion of a boundary is an expression of t'
        return
      end if
      moves = abs(motion%amplitude(c)) > 0.0_wp
      if (allocated(motion%profile)) moves = any(abs(motion%profile(:, c)) > 0.0_wp)
      if (motion%kind(c) == moved_by_displacement) then
        if (moves .and. .not. is_proportional(motion%curve)) &
          & reason = 'the displacement of a boundary is not proportional to t'
      else
        if (moves .and. any(abs(motion%curve%values - motion%curve%values(1)) > 0.0_wp)) &
          & reason = 'the velocity of a boundary is not constant'
        if (motion%is_pin) then
          moves = any(abs(motion%start(:, c)) > 0.0_wp)
        else
          moves = any(abs(motion%start(:, c)) > 0.0_wp .and. motion%held(:, c) == 1)
        end if
        if (moves) reason = 'a boundary with an imposed velocity does not start at 0'
      end if
    end do
  end function why_not_motion

  !> Whether a course is a straight line through the origin from t = 0 to 1.
  pure logical function is_proportional(curve)
    type(curve_type), intent(in) :: curve
    real(wp) :: allowed, t
    integer :: i

    allowed = straight*max(abs(curve%value(1.0_wp)), maxval(abs(curve%values)))
    is_proportional = abs(curve%value(0.0_wp)) <= allowed
    do i = 1, size(curve%times)
      t = min(1.0_wp, max(0.0_wp, curve%times(i)))
      is_proportional = is_proportional .and. abs(curve%value(t) - t*curve%value(1.0_wp)) <= allowed
    end do
  end function is_proportional

end module pd_motion_static_events
