!> What the runs of a study say together: which are on the Pareto front, how fast the error falls.
module pd_study_trade_front
  use pd_base_kinds, only: wp
  use pd_study_trade_plan, only: plan_type
  use pd_study_trade_trial, only: outcome_type
  implicit none (type, external)
  private
  public :: mark_front, on_front, order_type, observed_orders, step_variable, is_step

  !> Observed order of convergence between two runs that differ in one variable (and in those that
  !> vary together with it).
  type :: order_type
    integer :: variable = 0
    integer :: from = 0, to = 0       !! numbers of the runs, the second with the finer value
    real(wp) :: order = 0.0_wp        !! log of the errors' ratio over log of the values' ratio
  end type order_type

contains

  !> Mark the runs that no other run beats in both error and time. The run that the others are
  !> compared with does not compete: its own error is not known.
  subroutine mark_front(outcomes)
    type(outcome_type), intent(inout) :: outcomes(:)  !! (runs); `pareto` is set in all
    real(wp), allocatable :: error(:), seconds(:)

    error = outcomes%error
    seconds = outcomes%seconds
    outcomes%pareto = on_front(error, seconds, outcomes%done .and. outcomes%judged .and. &
      & .not. outcomes%truth)
  end subroutine mark_front

  !> Whether each of the chosen runs is as good as any other in error or in time, and better in one
  !> of them than whatever equals it in the other.
  pure function on_front(error, seconds, chosen) result(front)
    real(wp), intent(in) :: error(:)    !! (runs) in any one unit
    real(wp), intent(in) :: seconds(:)  !! (runs) [s]
    logical, intent(in) :: chosen(:)    !! (runs) that are compared; others are not on the front
    logical :: front(size(error))
    integer :: i, j

    front = chosen
    do i = 1, size(error)
      if (.not. chosen(i)) cycle
      do j = 1, size(error)
        if (j == i .or. .not. chosen(j)) cycle
        if (error(j) > error(i) .or. seconds(j) > seconds(i)) cycle
        if (error(j) < error(i) .or. seconds(j) < seconds(i)) front(i) = .false.
      end do
    end do
  end function on_front

  !> The step of a variable: what grows as the error does. Points and levels of finer cells count as
  !> the spacing they make, other numbers as they are.
  pure real(wp) function step_variable(plan, variable, value) result(step)
    type(plan_type), intent(in) :: plan  !! of the study
    integer, intent(in) :: variable      !! number of the variable
    real(wp), intent(in) :: value        !! of the variable, as a number; not 0 if it is a number of
                                         !! points
    step = value
    if (plan%variables(variable)%refines) step = 1/value
    if (plan%variables(variable)%levels) step = 2**(-value)
  end function step_variable

  !> Whether the error ought to vanish with a variable: points, levels of finer cells, the time step
  !> and its safety, the tolerance.
  pure logical function is_step(plan, v)
    type(plan_type), intent(in) :: plan  !! of the study
    integer, intent(in) :: v             !! number of the variable
    associate (variable => plan%variables(v))
      is_step = variable%refines .or. variable%levels .or. variable%target%group == 'time' .and. &
        & (variable%target%key == 'step' .or. variable%target%key == 'safety') .or. &
        & variable%target%group == 'relaxation' .and. variable%target%key == 'tolerance'
      is_step = is_step .and. variable%numeric
    end associate
  end function is_step

  !> Orders between neighbouring values of each axis, everything else the same. Of variables that
  !> go in step the first one counts; if it takes a value more than once, they are no sequence but
  !> a list of runs, and runs are compared that differ in one variable alone.
  pure subroutine observed_orders(plan, outcomes, orders)
    type(plan_type), intent(in) :: plan            !! of the study
    type(outcome_type), intent(in) :: outcomes(:)  !! (runs) in the order of the plan
    type(order_type), allocatable, intent(out) :: orders(:)
      !! (pairs of runs); empty if there are none
    real(wp) :: fine, coarse, best
    logical, allocatable :: others(:)   ! variables in which compared runs agree
    integer :: v, i, j, next

    allocate (orders(0))
    do v = 1, size(plan%variables)
      if (.not. is_step(plan, v)) cycle
      if (v > 1) then
        if (any([(is_step(plan, i) .and. plan%variables(i)%axis == plan%variables(v)%axis .and. &
          & .not. repeats(i), i=1, v - 1)])) cycle
      end if
      others = plan%variables%axis /= plan%variables(v)%axis
      if (repeats(v)) others = [(i /= v, i=1, size(others))]
      do i = 1, size(outcomes)
        if (.not. usable(outcomes(i))) cycle
        coarse = step_of(i)
        next = 0
        best = 0.0_wp
        do j = 1, size(outcomes)
          if (.not. usable(outcomes(j))) cycle
          if (any(plan%trials(i)%words /= plan%trials(j)%words .and. others)) cycle
          fine = step_of(j)
          if (fine >= coarse .or. fine <= best) cycle
          best = fine
          next = j
        end do
        if (next == 0) cycle
        orders = [orders, order_type(v, i, next, log(outcomes(i)%error/outcomes(next)%error) &
          & /log(coarse/best))]
      end do
    end do

  contains

    !> Whether a variable takes a value more than once.
    pure logical function repeats(variable)
      integer, intent(in) :: variable
      integer :: k
      associate (words => plan%variables(variable)%words)
        repeats = any([(any(words(:k - 1) == words(k)), k=2, size(words))])
      end associate
    end function repeats

    pure real(wp) function step_of(run)
      integer, intent(in) :: run
      integer :: k
      step_of = 0.0_wp
      do k = 1, size(plan%variables(v)%words)
        if (plan%variables(v)%words(k) == plan%trials(run)%words(v)) &
          & step_of = step_variable(plan, v, plan%variables(v)%numbers(k))
      end do
    end function step_of

    !> Whether the run has an error to take the logarithm of.
    pure logical function usable(outcome)
      type(outcome_type), intent(in) :: outcome
      usable = outcome%done .and. outcome%judged .and. outcome%error > 0.0_wp .and. &
        & .not. outcome%truth
    end function usable
  end subroutine observed_orders

end module pd_study_trade_front
