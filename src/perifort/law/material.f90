!> Material parameters of the peridynamic force from the classical ones (doc/theory.md, 1).
module pd_law_material
  use pd_base_kinds, only: wp
  use pd_base_elasticity, only: bond_based_ratio
  use pd_base_numbers, only: pi
  implicit none (type, external)
  private
  public :: material_type, new_material, critical_stretch_from_energy, &
    & energy_from_critical_stretch, several_stiffnesses, never

  real(wp), parameter :: never = huge(1.0_wp)  !! critical stretch of a material that cannot fail

  !> One material in one dimension and with one horizon.
  type :: material_type
    real(wp) :: youngs_modulus = 0.0_wp      !! E [Pa]
    real(wp) :: poissons_ratio = 0.0_wp      !! nu [-]
    real(wp) :: density = 0.0_wp             !! rho [kg/m3]
    real(wp) :: shear_modulus = 0.0_wp       !! mu [Pa]
    real(wp) :: bulk_modulus = 0.0_wp        !! kappa of the dimension [Pa]
    real(wp) :: a = 0.0_wp                   !! energy of dilatation, W = a theta^2 + ... [Pa]
    real(wp) :: b = 0.0_wp                   !! energy of the stretches [Pa/m4 (3D)]
    real(wp) :: d = 0.0_wp                   !! normalises the dilatation [1/m4 (3D)]
    real(wp) :: q = 0.0_wp                   !! 2 b delta
    real(wp) :: p = 0.0_wp                   !! 2 a d delta: p_k = p theta_k
    real(wp) :: t = 0.0_wp                   !! d delta: theta_k = t sum(...)
    real(wp) :: uniaxial_energy = 0.0_wp     !! W/zeta^2 at uniaxial strain zeta (theory.md, 4) [Pa]
    real(wp) :: critical_stretch = never     !! s_c [-]
    logical :: from_toughness = .false.      !! s_c follows from Gc, and so from the horizon
    !> Energy release rates at which a crack grows through the lattice, over the Gc of the formula
    !> for s_c: the largest within a period of the lattice, by which s_c has been chosen, the mean,
    !> and the largest of a crack along diagonals [-]. 0: s_c is given, or the formula's.
    real(wp) :: toughness = 0.0_wp
    real(wp) :: mean_toughness = 0.0_wp
    real(wp) :: diagonal_toughness = 0.0_wp
    logical :: break_in_compression = .false.
    real(wp) :: scatter = 0.0_wp             !! Weibull modulus of the bonds' s_c, 0: none [-]
    integer :: seed = 1                      !! of the random numbers of that
    real(wp) :: expansion = 0.0_wp           !! alpha, (1+nu) alpha in plane strain [1/K]
  end type material_type

contains

  !> Parameters for `dim` dimensions (2D: `plane_strain` or stress, thickness h; 1D: area A) and
  !> horizon `delta` [m] (doc/theory.md, 1). With `bond_based` and in 1D the special Poisson's ratio
  !> is taken, so that a = 0.
  pure function new_material(youngs_modulus, poissons_ratio, density, dim, plane_strain, &
    & thickness, area, delta, bond_based) result(m)
    real(wp), intent(in) :: youngs_modulus  !! E [Pa]
    real(wp), intent(in) :: poissons_ratio  !! nu, not used in 1D or with `bond_based` [-]
    real(wp), intent(in) :: density         !! rho [kg/m3]
    integer, intent(in) :: dim              !! of the scene: 1, 2 or 3
    logical, intent(in) :: plane_strain  !! 2D: plane strain, else plane stress; not used otherwise
    real(wp), intent(in) :: thickness       !! 2D: h; not used otherwise [m]
    real(wp), intent(in) :: area            !! 1D: cross section A; not used otherwise [m2]
    real(wp), intent(in) :: delta           !! horizon [m]
    logical, intent(in) :: bond_based       !! take the Poisson's ratio at which a = 0
    type(material_type) :: m
    real(wp) :: nu

    nu = poissons_ratio
    if (bond_based .or. dim == 1) nu = bond_based_ratio(dim, plane_strain)
    m%youngs_modulus = youngs_modulus
    m%poissons_ratio = nu
    m%density = density
    associate (E => youngs_modulus, h => thickness)
      m%shear_modulus = E/(2*(1 + nu))
      select case (dim)
      case (3)
        m%bulk_modulus = E/(3*(1 - 2*nu))
        m%a = (m%bulk_modulus - 5*m%shear_modulus/3)/2
        m%b = 15*m%shear_modulus/(2*pi*delta**5)
        m%d = 9/(4*pi*delta**4)
        m%uniaxial_energy = (m%bulk_modulus + 4*m%shear_modulus/3)/2
      case (2)
        if (plane_strain) then
          m%bulk_modulus = E/(2*(1 + nu)*(1 - 2*nu))
        else
          m%bulk_modulus = E/(2*(1 - nu))
        end if
        m%a = (m%bulk_modulus - 2*m%shear_modulus)/2
        m%b = 6*m%shear_modulus/(pi*h*delta**4)
        m%d = 2/(pi*h*delta**3)
        m%uniaxial_energy = (m%bulk_modulus + m%shear_modulus)/2
      case default
        m%bulk_modulus = E
        m%b = E/(2*area*delta**3)
        m%d = 1/(2*delta**2*area)
        m%uniaxial_energy = E/2
      end select
    end associate
    ! nu = 1/4 or 1/3 leaves rounding in a: it must be zero, so that the dilatation drops out
    if (abs(m%a) <= 1.0e-12_wp*m%bulk_modulus) m%a = 0.0_wp
    m%q = 2*m%b*delta
    m%t = m%d*delta
    m%p = 2*m%a*m%d*delta
  end function new_material

  !> Whether materials differ in a modulus, by more than rounding.
  pure logical function several_stiffnesses(materials) result(several)
    type(material_type), intent(in) :: materials(:)  !! one at least
    real(wp), parameter :: same = 1.0e-12_wp  !! part of a modulus that may differ
    associate (one => materials(1))
      several = any(abs(materials%shear_modulus - one%shear_modulus) > same*one%shear_modulus &
        & .or. abs(materials%bulk_modulus - one%bulk_modulus) > same*one%bulk_modulus)
    end associate
  end function several_stiffnesses

  !> Critical stretch from the critical energy release rate Gc [J/m2] (doc/theory.md, 8).
  pure real(wp) function critical_stretch_from_energy(m, Gc, dim, delta) result(s_c)
    type(material_type), intent(in) :: m  !! gives mu and kappa, in 1D E
    real(wp), intent(in) :: Gc            !! critical energy release rate [J/m2]
    integer, intent(in) :: dim            !! of the scene: 1, 2 or 3
    real(wp), intent(in) :: delta         !! horizon [m]

    associate (mu => m%shear_modulus, kappa => m%bulk_modulus)
      select case (dim)
      case (3)
        s_c = sqrt(Gc/((3*mu + 0.75_wp**4*(kappa - 5*mu/3))*delta))
      case (2)
        s_c = sqrt(Gc/((6*mu/pi + 16*(kappa - 2*mu)/(9*pi**2))*delta))
      case default
        s_c = sqrt(3*Gc/(m%youngs_modulus*delta))
      end select
    end associate
  end function critical_stretch_from_energy

  !> The critical energy release rate Gc [J/m2] of a material's critical stretch: the inverse of
  !> `critical_stretch_from_energy`, where s_c grows with the root of Gc.
  pure real(wp) function energy_from_critical_stretch(m, dim, delta) result(Gc)
    type(material_type), intent(in) :: m  !! gives the moduli and s_c
    integer, intent(in) :: dim            !! of the scene: 1, 2 or 3
    real(wp), intent(in) :: delta  !! horizon [m]
    Gc = (m%critical_stretch/critical_stretch_from_energy(m, 1.0_wp, dim, delta))**2
  end function energy_from_critical_stretch

end module pd_law_material
