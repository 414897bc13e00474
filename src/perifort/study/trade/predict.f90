!> Predictions from the runs of a study (doc/theory.md, 14): error and time along one line, the runs
!> that differ in one step h alone.
!>
!> The error is fitted by C (h^p - r^p), where r is the step of the run that all are compared with,
!> 0 if they are compared with something exact; the time by c h^-q. A run counts half as much again
!> as the next coarser one.
module pd_study_trade_predict
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: ascending
  implicit none (type, external)
  private
  public :: law_type, fit_law, error_at, true_error_at, seconds_at, least_order

  real(wp), parameter :: least_order = 0.15_wp   !! below it the error does not decrease with h
  real(wp), parameter :: least_with_reference = 0.5_wp  !! the error falls to 0 there in any case
  real(wp), parameter :: most_order = 8.0_wp
  real(wp), parameter :: favour = 1.5_wp         !! weight of a run over that of the next coarser

  !> What the runs of a line say. Runs are kept from coarse to fine.
  type :: law_type
    integer :: n = 0
    real(wp), allocatable :: h(:), error(:), seconds(:)
    real(wp) :: reference = 0.0_wp        !! r
    real(wp) :: log_factor = 0.0_wp       !! log C, of all runs
    real(wp) :: order = 0.0_wp            !! p, of all runs
    real(wp) :: last_factor = 0.0_wp      !! log C beyond the finest run
    real(wp) :: last_order = 0.0_wp       !! p beyond the finest run
    logical :: extrapolates = .false.     !! the fit holds beyond the finest run
    real(wp) :: margin = 1.1_wp           !! on the target, for the scatter of the runs
    real(wp) :: slope = 0.0_wp            !! q
    real(wp) :: log_cost = 0.0_wp         !! log c
  end type law_type

contains

  !> Fit runs of steps `h` with their errors and times. With a single run there is no fit.
  pure subroutine fit_law(h, error, seconds, reference, law)
    real(wp), intent(in) :: h(:)        !! (runs), different steps of one variable, in any order
    real(wp), intent(in) :: error(:)    !! (runs) in the norm of the study
    real(wp), intent(in) :: seconds(:)  !! (runs) [s]
    real(wp), intent(in) :: reference   !! r, step of the run compared with; 0: something exact
    type(law_type), intent(out) :: law  !! the fit
    integer :: order(size(h))
    real(wp) :: p, misfit, log_factor

    law%n = size(h)
    order = ascending(-h)
    law%h = h(order)
    law%error = error(order)
    law%seconds = max(seconds(order), tiny(1.0_wp))
    law%reference = reference
    if (law%n < 2) return
    law%extrapolates = all(law%error > 0.0_wp) .and. all(law%h > reference)
    call line(log(law%h), log(law%seconds), law%log_cost, law%slope)
    ! never faster when finer, in spite of the scatter of the clock
    law%slope = max(0.0_wp, -law%slope)
    law%log_cost = log(law%seconds(law%n)) + law%slope*log(law%h(law%n))
    if (.not. law%extrapolates) return
    call fit_order(law, 1, law%order, law%log_factor, misfit)
    law%margin = min(2.0_wp, max(1.1_wp, exp(2*sqrt(misfit))))
    law%last_order = law%order
    law%last_factor = law%log_factor
    ! an error that has begun to level off is extrapolated by the last runs
    if (law%n > 3) then
      call fit_order(law, law%n - 2, p, log_factor, misfit)
      if (p < law%order) then
        law%last_order = p
        law%last_factor = log_factor
      end if
    end if
    law%extrapolates = law%last_order >= least_order
  end subroutine fit_law

  !> The order that fits runs `first` .. best, with its factor, and the mean square of the
  !> residuals of the errors' logarithms.
  pure subroutine fit_order(law, first, order, log_factor, misfit)
    type(law_type), intent(in) :: law
    integer, intent(in) :: first
    real(wp), intent(out) :: order, log_factor, misfit
    integer, parameter :: tries = 400
    real(wp) :: scatter(law%n - first + 1), weight(law%n - first + 1), p, factor, square
    integer :: i

    misfit = huge(misfit)
    order = 0.0_wp
    log_factor = 0.0_wp
    weight = weights(size(weight))
    do i = 1, tries
      p = most_order*i/tries
      if (law%reference > 0.0_wp .and. p < least_with_reference) cycle
      scatter = log(law%error(first:)) - log(law%h(first:)**p - law%reference**p)
      factor = sum(weight*scatter)
      square = sum(weight*(scatter - factor)**2)
      if (square >= misfit) cycle
      misfit = square
      order = p
      log_factor = factor
    end do
  end subroutine fit_order

  !> More for each finer run; their sum is 1.
  pure function weights(n) result(weight)
    integer, intent(in) :: n
    real(wp) :: weight(n)
    integer :: i
    weight = [(favour**(i - n), i=1, n)]
    weight = weight/sum(weight)
  end function weights

  !> The line y = start + slope x by weighted least squares.
  pure subroutine line(x, y, start, slope)
    real(wp), intent(in) :: x(:), y(:)
    real(wp), intent(out) :: start, slope
    real(wp) :: weight(size(x)), mean_x, mean_y

    weight = weights(size(x))
    mean_x = sum(weight*x)
    mean_y = sum(weight*y)
    slope = sum(weight*(x - mean_x)*(y - mean_y))/max(sum(weight*(x - mean_x)**2), tiny(1.0_wp))
    start = mean_y - slope*mean_x
  end subroutine line

  !> The error to be expected at a step. Between runs it is interpolated, where a run counts no
  !> better than any finer one, or the fit's if that is worse: a smaller error is taken for
  !> chance. Beyond the finest run it is the fit's, moved up to that run if the fit lies below it,
  !> but no nearer to the run that all are compared with than twice its step: there that run says
  !> more of itself. Huge where nothing is known, and at steps coarser than the coarsest run's,
  !> which may be unstable.
  pure real(wp) function error_at(law, h) result(error)
    type(law_type), intent(in) :: law  !! of `fit_law`
    real(wp), intent(in) :: h          !! step, in the unit of the fitted ones
    real(wp) :: part, above
    integer :: i

    error = huge(1.0_wp)
    if (law%n == 0) return
    do i = 1, law%n
      if (abs(h - law%h(i)) > 1.0e-9_wp*h) cycle
      error = maxval(law%error(i:))
      return
    end do
    if (h > law%h(1)) return
    if (h > law%h(law%n)) then
      do i = 1, law%n - 1
        if (h > law%h(i + 1)) exit
      end do
      if (minval(law%error(i:)) <= 0.0_wp) return
      part = log(law%h(i)/h)/log(law%h(i)/law%h(i + 1))
      error = exp((1 - part)*log(maxval(law%error(i:))) + part*log(maxval(law%error(i + 1:))))
      if (law%order >= least_order) error = max(error, exp(log_fit(law, law%log_factor, &
        & law%order, h)))
    else if (law%extrapolates .and. h > 2*law%reference*(1 - 1.0e-9_wp)) then
      above = max(0.0_wp, log(law%error(law%n)) - log_fit(law, law%last_factor, law%last_order, &
        & law%h(law%n)))
      error = exp(above + log_fit(law, law%last_factor, law%last_order, h))
    end if
  end function error_at

  !> The error at a step against the exact answer where the errors are those against a run of step
  !> r: C h^p by the fit of all runs. `known` is false where there is no such fit: fewer than two
  !> runs, an error of 0, an order below `least_order`, or r = 0.
  pure subroutine true_error_at(law, h, error, known)
    type(law_type), intent(in) :: law      !! of `fit_law`
    real(wp), intent(in) :: h              !! step, not below r
    real(wp), intent(out) :: error         !! in the norm of the errors; 0 if not known
    logical, intent(out) :: known          !! whether the fit gives one

    known = law%n >= 2 .and. law%reference > 0.0_wp .and. law%order >= least_order
    if (known) known = all(law%error > 0.0_wp)
    error = 0.0_wp
    if (known) error = exp(law%log_factor + law%order*log(h))
  end subroutine true_error_at

  !> log(C (h^p - r^p)).
  pure real(wp) function log_fit(law, log_factor, order, h)
    type(law_type), intent(in) :: law
    real(wp), intent(in) :: log_factor, order, h
    log_fit = log_factor + log(h**order - law%reference**order)
  end function log_fit

  !> The time to be expected at a step [s]: interpolated between runs, and by the fit beyond.
  pure real(wp) function seconds_at(law, h) result(seconds)
    type(law_type), intent(in) :: law  !! of `fit_law`
    real(wp), intent(in) :: h          !! step, in the unit of the fitted ones
    real(wp) :: part
    integer :: i

    seconds = exp(law%log_cost - law%slope*log(h))
    if (law%n == 1) seconds = law%seconds(1)
    do i = 1, law%n - 1
      if (h > law%h(i) .or. h < law%h(i + 1)) cycle
      part = log(law%h(i)/h)/log(law%h(i)/law%h(i + 1))
      seconds = exp((1 - part)*log(law%seconds(i)) + part*log(law%seconds(i + 1)))
    end do
  end function seconds_at

end module pd_study_trade_predict
