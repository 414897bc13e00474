!> Temperature changes that vary in time: the thermal strain of every slot is its full value times
!> the factor of its course.
!>
!> The model holds the thermal strain of the present instant, so the force loops know nothing of
!> courses.
module pd_motion_heating
  use pd_base_kinds, only: wp, i2, i4
  use pd_base_archive, only: archive_type
  use pd_base_expression, only: derivative_in_time, expression_type
  use pd_base_field, only: field_type, field_values, new_field
  use pd_base_order, only: order_type
  use pd_base_reduce, only: any_of_ranks, largest_of_ranks
  use pd_motion_conditions, only: condition_fault, note_fault
  use pd_motion_curve, only: curve_type
  implicit none (type, external)
  private
  public :: heating_type, new_heating, heat, heat_at, apply_factors, keep_heating, largest_expansion
  public :: timed_heat_type, new_timed_heat, apply_rate, is_timed, heating_fault

  real(wp), parameter :: small = 1.0e-3_wp  !! thermal strain over which energies are compared [-]

  !> A temperature change that is an expression of t; the factor of its course is the time.
  type :: timed_heat_type
    integer(i4), allocatable :: slots(:)
    type(field_type) :: value, rate              !! [K], [K/s]
    logical :: is_there = .false.
  end type timed_heat_type

  !> Courses of the temperature. Nothing is allocated where the temperature is constant in time.
  type :: heating_type
    type(curve_type), allocatable :: curves(:)   !! factors over time
    integer(i2), allocatable :: course(:)        !! number of the curve of each slot, 0: not heated
    real(wp), allocatable :: full(:)             !! alpha dT of each slot at factor 1 [-]
    type(timed_heat_type), allocatable :: timed(:)  !! of each course; full is alpha there [1/K]
    real(wp), allocatable :: factors(:)          !! of each course, as the model has them [-]
    real(wp), allocatable :: last_factors(:)     !! account of work: factors of the last instant
    real(wp), allocatable :: last_rates(:)       !! dE/dfactor of each course then [J]
  end type heating_type

contains

  !> Heating of a body whose model has been made with the full temperature changes.
  subroutine new_heating(order, expansion, course, curves, heating, timed)
    type(order_type), intent(in) :: order          !! which ranks there are: all have a heating or
                                                   !! none
    real(wp), intent(in) :: expansion(:)           !! alpha dT of each slot at factor 1 [-]
    integer(i2), intent(in) :: course(:)           !! number of the curve of each slot, or 0
    type(curve_type), intent(in) :: curves(:)      !! factors over time
    type(heating_type), intent(out) :: heating     !! empty if no factor varies and all are 1
    type(timed_heat_type), intent(in), optional :: timed(:)
      !! of each course, where it is an expression of t; its `expansion` is that of 1 K
    integer :: i
    logical :: varies

    varies = .false.
    do i = 1, size(curves)
      varies = varies .or. (any(course == i) .and. any(abs(curves(i)%values - 1) > 0.0_wp))
    end do
    varies = any_of_ranks(order, varies)
    if (present(timed)) varies = varies .or. any(timed%is_there)
    if (.not. varies) return
    if (present(timed)) allocate (heating%timed, source=timed)
    allocate (heating%curves, source=curves)
    allocate (heating%course, source=course)
    allocate (heating%full, source=expansion)
    allocate (heating%factors(size(curves)), source=1.0_wp)
    if (present(timed)) where (timed%is_there) heating%factors = -huge(1.0_wp)
    allocate (heating%last_factors(size(curves)), heating%last_rates(size(curves)), source=0.0_wp)
  end subroutine new_heating

  !> Bring the thermal strains to time `t`.
  subroutine heat(heating, t, expansion)
    type(heating_type), intent(inout) :: heating  !! gets the factors of this time
    real(wp), intent(in) :: t                    !! [s]; in relaxation 0 to 1 over the load steps
    real(wp), intent(inout) :: expansion(:)      !! alpha dT of each slot [-]
    real(wp) :: factors(size(heating%curves))

    factors = factors_at(heating, t)
    if (all(abs(factors - heating%factors) <= 0.0_wp)) return
    heating%factors = factors
    call apply_factors(heating, factors, expansion)
  end subroutine heat

  !> Thermal strains of another time; the present ones stay.
  subroutine heat_at(heating, t, expansion)
    type(heating_type), intent(in) :: heating    !! whose courses vary
    real(wp), intent(in) :: t                    !! [s]
    real(wp), intent(inout) :: expansion(:)      !! alpha dT of each slot: of any time, then of `t`
    call apply_factors(heating, factors_at(heating, t), expansion)
  end subroutine heat_at

  !> The factors of the courses at time `t` [-]; of those that are expressions the time [s].
  pure function factors_at(heating, t) result(factors)
    type(heating_type), intent(in) :: heating
    real(wp), intent(in) :: t
    real(wp) :: factors(size(heating%curves))
    integer :: i

    do i = 1, size(factors)
      factors(i) = heating%curves(i)%value(t)
      if (is_timed(heating, i)) factors(i) = t
    end do
  end function factors_at

  !> Thermal strains under given factors of the courses.
  subroutine apply_factors(heating, factors, expansion)
    type(heating_type), intent(in) :: heating    !! with its full thermal strains
    real(wp), intent(in) :: factors(:)           !! of each course [-]
    real(wp), intent(inout) :: expansion(:)      !! alpha dT of each slot [-]
    real(wp), allocatable :: values(:)
    integer :: k, i, at

    do k = 1, size(expansion)
      if (heating%course(k) > 0_i2) expansion(k) = factors(heating%course(k))*heating%full(k)
    end do
    if (.not. allocated(heating%timed)) return
    do i = 1, size(heating%timed)
      if (.not. heating%timed(i)%is_there) cycle
      associate (slots => heating%timed(i)%slots)
        allocate (values(size(slots)))
        call field_values(heating%timed(i)%value, factors(i), values, at)
        if (at > 0) values = 0.0_wp  ! heating_fault reports it
        expansion(slots) = heating%full(slots)*values
        deallocate (values)
      end associate
    end do
  end subroutine apply_factors

  !> Largest size of a thermal strain at any time [-]; `expansion` holds those of the present.
  pure real(wp) function largest_expansion(heating, expansion) result(largest)
    type(heating_type), intent(in) :: heating    !! empty if the temperature is constant
    real(wp), intent(in) :: expansion(:)         !! alpha dT of each slot now [-]
    real(wp) :: most
    integer :: i

    largest = maxval(abs(expansion))
    if (.not. allocated(heating%curves) .or. allocated(heating%timed)) return
    most = 0.0_wp
    do i = 1, size(heating%curves)
      most = max(most, maxval(abs(heating%curves(i)%values)))
    end do
    largest = max(largest, most*maxval(abs(heating%full)))
  end function largest_expansion

  !> Whether the temperature of a course is an expression of t.
  pure logical function is_timed(heating, i)
    type(heating_type), intent(in) :: heating  !! of the body
    integer, intent(in) :: i                   !! number of the course

    is_timed = .false.
    if (allocated(heating%timed)) is_timed = heating%timed(i)%is_there
  end function is_timed

  !> A temperature change that is an expression of t.
  subroutine new_timed_heat(expression, slots, x, timed)
    type(expression_type), intent(in) :: expression  !! of x, y, z, t [K]
    integer(i4), intent(in) :: slots(:)              !! that it heats
    real(wp), intent(in) :: x(:, :)                  !! their positions (slot, dim) [m]
    type(timed_heat_type), intent(out) :: timed      !! ready
    type(expression_type) :: rate

    call derivative_in_time(expression, rate)
    timed%slots = slots
    call new_field(expression, x, timed%value)
    call new_field(rate, x, timed%rate)
    timed%is_there = .true.
  end subroutine new_timed_heat

  !> Thermal strains of course `i` a time `part` times `h` from those of time `t`, along their rate:
  !> `h` is chosen so that they change by little.
  subroutine apply_rate(order, heating, i, t, part, expansion, h)
    type(order_type), intent(in) :: order      !! which ranks there are: all call it
    type(heating_type), intent(in) :: heating  !! course `i` is an expression of t
    integer, intent(in) :: i                   !! number of the course
    real(wp), intent(in) :: t                  !! time [s]
    real(wp), intent(in) :: part               !! of `h`
    real(wp), intent(inout) :: expansion(:)    !! alpha dT of each slot, those of time `t` [-]
    real(wp), intent(out) :: h                 !! [s]; 0 if the temperature does not change
    real(wp), allocatable :: values(:), rates(:)
    real(wp) :: largest
    integer :: at, at_rate

    associate (timed => heating%timed(i))
      allocate (values(size(timed%slots)), rates(size(timed%slots)))
      call field_values(timed%value, t, values, at)
      call field_values(timed%rate, t, rates, at_rate)
      h = 0.0_wp
      largest = 0.0_wp
      if (at > 0 .or. at_rate > 0) then
        largest = huge(largest)
      else if (size(rates) > 0) then
        largest = maxval(abs(heating%full(timed%slots)*rates))
      end if
      largest = largest_of_ranks(order, largest)
      if (.not. (largest > 0.0_wp .and. largest < huge(largest))) return
      h = small/largest
      expansion(timed%slots) = heating%full(timed%slots)*(values + part*h*rates)
    end associate
  end subroutine apply_rate

  !> Note the first temperature change at time `t` that is not finite.
  subroutine heating_fault(heating, t, fault)
    type(heating_type), intent(in) :: heating  !! of the body
    real(wp), intent(in) :: t                  !! time [s]
    type(condition_fault), allocatable, intent(inout) :: fault  !! the first one stays
    real(wp), allocatable :: values(:)
    integer :: i, at

    if (.not. allocated(heating%timed)) return
    do i = 1, size(heating%timed)
      if (.not. heating%timed(i)%is_there .or. allocated(fault)) cycle
      allocate (values(size(heating%timed(i)%slots)))
      call field_values(heating%timed(i)%value, t, values, at)
      if (at > 0) call note_fault('initial', i, 'temperature_change', &
        & heating%timed(i)%slots(at), t, fault)
      deallocate (values)
    end do
  end subroutine heating_fault

  !> What passes from one instant to the next.
  subroutine keep_heating(archive, heating, expansion)
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    type(heating_type), intent(inout) :: heating
      !! its factors and account are set where the archive reads
    real(wp), intent(inout) :: expansion(:)      !! alpha dT of each slot [-]

    call archive%keep('temperature factors', heating%factors)
    call archive%keep('last temperature factors', heating%last_factors)
    call archive%keep('last rates of heating', heating%last_rates)
    call apply_factors(heating, heating%factors, expansion)
  end subroutine keep_heating

end module pd_motion_heating
