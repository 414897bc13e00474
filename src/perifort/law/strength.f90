!> Scatter of strength: a factor for the critical stretch of each bond, Weibull distributed, from
!> the numbers of its two points. It is the same from both ends, for any order of points and number
!> of threads (doc/theory.md, 8).
module pd_law_strength
  use pd_base_kinds, only: wp, i8
  use pd_base_lookup, only: mix
  implicit none (type, external)
  private
  public :: strength_factor

contains

  !> The factor of the bond between two points: with a random number r in (0, 1) of the bond,
  !> (-ln r)^(1/m)/Gamma(1 + 1/m), whose mean is 1.
  pure real(wp) function strength_factor(modulus, seed, one, other) result(factor)
    real(wp), intent(in) :: modulus     !! Weibull modulus m, above 0 [-]
    integer, intent(in) :: seed         !! of the random numbers
    integer(i8), intent(in) :: one      !! number of one point among all, from 1
    integer(i8), intent(in) :: other    !! number of the other
    integer(i8) :: key
    integer :: i

    key = mix(mix(int(seed, i8), min(one, other)), max(one, other))
    ! more rounds, until every bit depends on every bit
    do i = 1, 3
      key = mix(key, ieor(key, ishft(key, -31)))
    end do
    factor = (-log(unit_number(key)))**(1/modulus)/gamma(1 + 1/modulus)
  end function strength_factor

  !> A number in (0, 1) from the upper 52 bits of a key.
  pure real(wp) function unit_number(key)
    integer(i8), intent(in) :: key
    unit_number = scale(real(ishft(key, -12), wp) + 0.5_wp, -52)
  end function unit_number

end module pd_law_strength
