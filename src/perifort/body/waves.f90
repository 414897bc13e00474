!> Speeds of elastic waves, from the moduli of the dimension.
module pd_body_waves
  use pd_base_kinds, only: wp
  use pd_law_material, only: material_type
  implicit none (type, external)
  private
  public :: longitudinal_speed, shear_speed, rayleigh_speed

contains

  !> Speed of longitudinal (P) waves [m/s]: sqrt((kappa + 4 mu/3)/rho) in 3D, in 2D those of plane
  !> strain or of a plate in plane stress, sqrt((kappa + mu)/rho), in 1D those of a bar,
  !> sqrt(E/rho).
  pure real(wp) function longitudinal_speed(m) result(speed)
    type(material_type), intent(in) :: m  !! gives W/zeta^2 at uniaxial strain and the density
    speed = sqrt(2*m%uniaxial_energy/m%density)
  end function longitudinal_speed

  !> Speed of shear (S) waves in 2D and 3D [m/s]: sqrt(mu/rho).
  pure real(wp) function shear_speed(m) result(speed)
    type(material_type), intent(in) :: m  !! gives mu and the density
    speed = sqrt(m%shear_modulus/m%density)
  end function shear_speed

  !> Speed of waves along a free surface [m/s], which cracks under tension do not exceed: with
  !> x = (c/c_S)^2 and k = (c_S/c_P)^2 the root of x^3 - 8 x^2 + (24 - 16 k) x - 16 (1 - k) between
  !> 0 and 1 (Rayleigh 1885), where the polynomial rises from -16 (1 - k) to 1.
  pure real(wp) function rayleigh_speed(m) result(speed)
    type(material_type), intent(in) :: m  !! gives mu, W/zeta^2 at uniaxial strain and the density;
                                          !! not for 1D
    real(wp) :: k, low, high, x
    integer :: i

    k = m%shear_modulus/(2*m%uniaxial_energy)
    low = 0.0_wp
    high = 1.0_wp
    do i = 1, digits(x)
      x = (low + high)/2
      if (((x - 8)*x + 24 - 16*k)*x - 16*(1 - k) < 0.0_wp) then
        low = x
      else
        high = x
      end if
    end do
    speed = shear_speed(m)*sqrt((low + high)/2)
  end function rayleigh_speed

end module pd_body_waves
