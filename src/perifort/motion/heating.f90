!> Temperature changes that vary in time: the thermal strain of every slot is its full value times
!> the factor of its course.
!>
!> The model holds the thermal strain of the present instant, so the force loops know nothing of
!> courses.
module pd_motion_heating
  use pd_base_kinds, only: wp, i2
  use pd_base_archive, only: archive_type
  use pd_motion_curve, only: curve_type
  implicit none (type, external)
  private
  public :: heating_type, new_heating, heat, apply_factors, keep_heating, largest_expansion

  !> Courses of the temperature. Nothing is allocated where the temperature is constant in time.
  type :: heating_type
    type(curve_type), allocatable :: curves(:)   !! factors over time
    integer(i2), allocatable :: course(:)        !! number of the curve of each slot, 0: not heated
    real(wp), allocatable :: full(:)             !! alpha dT of each slot at factor 1 [-]
    real(wp), allocatable :: factors(:)          !! of each course, as the model has them [-]
    real(wp), allocatable :: last_factors(:)     !! account of work: factors of the last instant
    real(wp), allocatable :: last_rates(:)       !! dE/dfactor of each course then [J]
  end type heating_type

contains

  !> Heating of a body whose model has been made with the full temperature changes.
  pure subroutine new_heating(expansion, course, curves, heating)
    real(wp), intent(in) :: expansion(:)           !! alpha dT of each slot at factor 1 [-]
    integer(i2), intent(in) :: course(:)           !! number of the curve of each slot, or 0
    type(curve_type), intent(in) :: curves(:)      !! factors over time
    type(heating_type), intent(out) :: heating     !! empty if no factor varies and all are 1
    integer :: i
    logical :: varies

    varies = .false.
    do i = 1, size(curves)
      varies = varies .or. (any(course == i) .and. any(abs(curves(i)%values - 1) > 0.0_wp))
    end do
    if (.not. varies) return
    allocate (heating%curves, source=curves)
    allocate (heating%course, source=course)
    allocate (heating%full, source=expansion)
    allocate (heating%factors(size(curves)), source=1.0_wp)
    allocate (heating%last_factors(size(curves)), heating%last_rates(size(curves)), source=0.0_wp)
  end subroutine new_heating

  !> Bring the thermal strains to time `t`.
  pure subroutine heat(heating, t, expansion)
    type(heating_type), intent(inout) :: heating  !! gets the factors of this time
    real(wp), intent(in) :: t                    !! [s]; in relaxation 0 to 1 over the load steps
    real(wp), intent(inout) :: expansion(:)      !! alpha dT of each slot [-]
    real(wp) :: factors(size(heating%curves))
    integer :: i

    do i = 1, size(factors)
      factors(i) = heating%curves(i)%value(t)
    end do
    if (all(abs(factors - heating%factors) <= 0.0_wp)) return
    heating%factors = factors
    call apply_factors(heating, factors, expansion)
  end subroutine heat

  !> Thermal strains under given factors of the courses.
  pure subroutine apply_factors(heating, factors, expansion)
    type(heating_type), intent(in) :: heating    !! with its full thermal strains
    real(wp), intent(in) :: factors(:)           !! of each course [-]
    real(wp), intent(inout) :: expansion(:)      !! alpha dT of each slot [-]
    integer :: k

    do k = 1, size(expansion)
      if (heating%course(k) > 0_i2) expansion(k) = factors(heating%course(k))*heating%full(k)
    end do
  end subroutine apply_factors

  !> Largest size of a thermal strain at any time [-]; `expansion` holds those of the present.
  pure real(wp) function largest_expansion(heating, expansion) result(largest)
    type(heating_type), intent(in) :: heating    !! empty if the temperature is constant
    real(wp), intent(in) :: expansion(:)         !! alpha dT of each slot now [-]
    real(wp) :: most
    integer :: i

    largest = maxval(abs(expansion))
    if (.not. allocated(heating%curves)) return
    most = 0.0_wp
    do i = 1, size(heating%curves)
      most = max(most, maxval(abs(heating%curves(i)%values)))
    end do
    largest = max(largest, most*maxval(abs(heating%full)))
  end function largest_expansion

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
