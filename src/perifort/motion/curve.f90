!> How an imposed value or a load varies in time: constant, a ramp, or linear between given times.
module pd_motion_curve
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: curve_type, constant_curve, ramp, table_curve

  !> A factor over time, linear between `times`, constant outside.
  type :: curve_type
    real(wp), allocatable :: times(:)   !! [s], increasing
    real(wp), allocatable :: values(:)  !! [-]
  contains
    procedure :: value
    procedure :: slope
    procedure :: integral
  end type curve_type

contains

  !> The factor 1 at all times.
  pure type(curve_type) function constant_curve() result(curve)
    curve = table_curve([0.0_wp], [1.0_wp])
  end function constant_curve

  !> From 0 at t = 0 to 1 at `ramp_time` [s], then 1.
  pure type(curve_type) function ramp(ramp_time) result(curve)
    real(wp), intent(in) :: ramp_time
      !! time at which the factor reaches 1; constant 1 if it is not above 0 [s]
    if (ramp_time > 0.0_wp) then
      curve = table_curve([0.0_wp, ramp_time], [0.0_wp, 1.0_wp])
    else
      curve = constant_curve()
    end if
  end function ramp

  !> Linear between (times, values).
  pure type(curve_type) function table_curve(times, values) result(curve)
    real(wp), intent(in) :: times(:)   !! (n) increasing [s]
    real(wp), intent(in) :: values(:)  !! (n) factors at these times [-]
    allocate (curve%times, source=times)
    allocate (curve%values, source=values)
  end function table_curve

  !> The factor at time `t` [s].
  pure real(wp) function value(curve, t)
    class(curve_type), intent(in) :: curve  !! constant outside of its times
    real(wp), intent(in) :: t               !! time [s]
    integer :: i, n

    n = size(curve%times)
    if (t <= curve%times(1)) then
      value = curve%values(1)
    else if (t >= curve%times(n)) then
      value = curve%values(n)
    else
      i = interval(curve, t)
      value = curve%values(i) + slope(curve, t)*(t - curve%times(i))
    end if
  end function value

  !> Its derivative at `t` [1/s]; at a kink that of the interval which begins there.
  pure real(wp) function slope(curve, t)
    class(curve_type), intent(in) :: curve  !! constant outside of its times
    real(wp), intent(in) :: t               !! time [s]
    integer :: i

    slope = 0.0_wp
    if (t < curve%times(1) .or. t >= curve%times(size(curve%times))) return
    i = interval(curve, t)
    slope = (curve%values(i + 1) - curve%values(i))/(curve%times(i + 1) - curve%times(i))
  end function slope

  !> Its exact integral from 0 to `t` [s].
  pure real(wp) function integral(curve, t)
    class(curve_type), intent(in) :: curve  !! constant outside of its times
    real(wp), intent(in) :: t               !! time [s]
    integral = from_first(curve, t) - from_first(curve, 0.0_wp)
  end function integral

  !> Integral from the first time of the curve to `t`.
  pure real(wp) function from_first(curve, t) result(area)
    type(curve_type), intent(in) :: curve
    real(wp), intent(in) :: t
    integer :: i, n

    n = size(curve%times)
    area = 0.0_wp
    if (t <= curve%times(1)) then
      area = curve%values(1)*(t - curve%times(1))
      return
    end if
    do i = 1, n - 1
      if (t <= curve%times(i)) return
      associate (until => min(t, curve%times(i + 1)))
        area = area + (until - curve%times(i))*(curve%values(i) + value(curve, until))/2
      end associate
    end do
    if (t > curve%times(n)) area = area + curve%values(n)*(t - curve%times(n))
  end function from_first

  !> The interval that holds `t`, which lies between the first and the last time.
  pure integer function interval(curve, t) result(i)
    type(curve_type), intent(in) :: curve
    real(wp), intent(in) :: t
    do i = 1, size(curve%times) - 2
      if (t < curve%times(i + 1)) exit
    end do
  end function interval

end module pd_motion_curve
