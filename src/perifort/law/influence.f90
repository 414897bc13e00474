!> Influence functions omega(|xi|/delta): how much a bond counts by its length (doc/theory.md, 15).
module pd_law_influence
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: influence_at, influence_names, gauss, quadrature

  !> The influence functions that `&material influence` may name.
  character(8), parameter :: influence_names(4) = [character(8) :: 'inverse', 'constant', &
    & 'linear', 'gaussian']
  integer, parameter :: quadrature = 16  !! points of Gauss's rule

contains

  !> omega of the function called `name`: delta/|xi|, 1, 1 - |xi|/delta or exp(-(|xi|/delta)^2);
  !> linear is 0 beyond the horizon, where volume corrections may count a bond.
  pure real(wp) function influence_at(name, ratio) result(omega)
    character(*), intent(in) :: name  !! one of `influence_names`
    real(wp), intent(in) :: ratio     !! |xi|/delta, above 0 [-]

    select case (name)
    case ('inverse'); omega = 1/ratio
    case ('constant'); omega = 1.0_wp
    case ('linear'); omega = max(0.0_wp, 1 - ratio)
    case ('gaussian'); omega = exp(-ratio**2)
    case default
      call internal_fault('unknown influence function')
    end select
  end function influence_at

  !> Gauss's rule on 0 to 1, exact for polynomials of degree 31.
  pure subroutine gauss(node, share)
    real(wp), intent(out) :: node(quadrature)   !! places, ascending [-]
    real(wp), intent(out) :: share(quadrature)  !! weights, whose sum is 1 [-]
    real(wp), parameter :: x(*) = [0.095012509837637441_wp, 0.28160355077925892_wp, &
      & 0.45801677765722737_wp, 0.61787624440264377_wp, 0.755404408355003_wp, &
      & 0.86563120238783176_wp, 0.9445750230732326_wp, 0.98940093499164994_wp]
    real(wp), parameter :: w(*) = [0.18945061045506864_wp, 0.18260341504492364_wp, &
      & 0.16915651939500265_wp, 0.14959598881657671_wp, 0.12462897125553407_wp, &
      & 0.095158511682492605_wp, 0.062253523938647456_wp, 0.027152459411754176_wp]
    integer, parameter :: half = size(x)

    node(:half) = (1 - x(half:1:-1))/2
    node(half + 1:) = (1 + x)/2
    share(:half) = w(half:1:-1)/2
    share(half + 1:) = w/2
  end subroutine gauss

end module pd_law_influence
