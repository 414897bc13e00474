!> The elastic-plastic linear peridynamic solid in 3D, `model = 'lps_plastic'`: that of Mitchell
!> ("A nonlocal, ordinary, state-based plasticity model for peridynamics", SAND2011-3166), with
!> linear isotropic hardening (doc/theory.md, 15).
!>
!> The extension e = s |xi| of a bond is elastic but for its plastic part e_p. With v = Lambda |xi|,
!> the product <a, b> = sum omega a b vc V_j over the intact bonds of a point, m = <|xi|, |xi|> of
!> its whole family and alpha = 15 mu/m, the energy is that of `lps` with e - e_p in its deviatoric
!> part:
!>
!>     W = kappa theta^2/2 + (alpha/2) (<x, x> - <v, x>^2/m),  theta = (3/m) <v, e>,  x = e - e_p
!>
!> The part d of x that is orthogonal to v yields: its equivalent stress
!>
!>     sigma_eq = 15 mu sqrt(<d, d>/(5 m))
!>
!> which is von Mises' for a full family in a continuum, stays at or below
!> yield stress + hardening ebar. Flow is along d, so that it changes no volume. The return to the
!> yield surface is radial and exact:
!>
!>     d ebar = (sigma_eq - yield stress - hardening ebar)/(3 mu + hardening)
!>
!> A whole family has <v, v> = m, and its deviatoric force alpha omega d is t_d of Mitchell. The
!> rest of x, along v, carries force where bonds are broken: there the law is still `lps` before it
!> yields, and an isotropic expansion never yields.
!>
!> Extensions and dilatation are those of small strains. A law for large ones has others
!> (`pd_law_lps_plastic_large`); `measure` is all by which it differs.
module pd_law_lps_plastic
  use pd_base_kinds, only: wp
  use pd_law_law, only: law_bonds_type, parameter_type
  use pd_law_lps, only: lps_law, lps_law_type, weighted_volume
  implicit none (type, external)
  private
  public :: lps_plastic_law_type, lps_plastic_law, plastic_state_type

  integer, parameter :: plastic = 1   !! history of a bond: e_p [m]
  integer, parameter :: reached = 2   !! and e at the last commit [m]
  integer, parameter :: strain = 1    !! history of a point: equivalent plastic strain ebar [-]
  integer, parameter :: volume_m = 2  !! constant of a point: m [m5]

  type, extends(lps_law_type) :: lps_plastic_law_type
    integer :: volume_constant = volume_m  !! which constant of a point is m
  contains
    procedure :: begin
    procedure :: forces
    procedure :: energy
    procedure :: commit
    procedure :: refusal
    procedure :: measure
  end type lps_plastic_law_type

  !> The state of a point at its stretches. Arrays hold its bonds; all are 0 where one is broken.
  type :: plastic_state_type
    real(wp), allocatable :: weight(:)    !! omega vc V_j [m3]
    real(wp), allocatable :: omega(:)     !! omega [-]
    real(wp), allocatable :: along(:)     !! v [m]
    real(wp), allocatable :: extension(:) !! e [m]
    real(wp), allocatable :: slope(:)     !! de/d|y| [-]
    real(wp), allocatable :: widening(:)  !! dtheta/d|y|, over (3/m) omega v vc V_j [-]
    real(wp), allocatable :: deviator(:)  !! d before flow [m]
    real(wp) :: m = 0.0_wp                !! of the whole family [m5]
    real(wp) :: intact = 0.0_wp           !! <v, v> [m5]
    real(wp) :: theta = 0.0_wp            !! dilatation [-]
    real(wp) :: part = 0.0_wp             !! x = d + part v [-]
    real(wp) :: left = 1.0_wp             !! d after flow, over d before it [-]
    real(wp) :: equivalent = 0.0_wp       !! sigma_eq before flow [Pa]
    real(wp) :: flow = 0.0_wp             !! d ebar [-]
  end type plastic_state_type

contains

  !> `model = 'lps_plastic'`.
  function lps_plastic_law() result(law)
    type(lps_plastic_law_type) :: law

    law%lps_law_type = lps_law()
    law%name = 'lps_plastic'
    ! on a lattice of 3 spacings to the horizon its yield stress is 1.003 of the given one, with
    ! 'constant' 0.934
    law%influence = 'linear'
    law%weighted = .false.
    law%plastic = .true.
    law%bond_history = 2
    law%point_history = 1
    law%point_constants = 2
    law%parameters = [parameter_type('yield_stress', 'Pa', &
      & 'yield stress in uniaxial tension'), &
      & parameter_type('hardening', 'Pa', 'growth of the yield stress over the equivalent '// &
      & 'plastic strain', default=0.0_wp, zero=.true.)]
  end function lps_plastic_law

  !> The scale of a point, and m.
  pure subroutine begin(self, bonds)
    class(lps_plastic_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(inout) :: bonds     !! of the point, whole; gets its constants

    call self%lps_law_type%begin(bonds)
    bonds%constants(volume_m) = weighted_volume(self, bonds)
  end subroutine begin

  !> 3 kappa theta omega v/m + alpha omega (d + part (1 - <v, v>/m) v), d after flow, each as its
  !> measure goes with |y|.
  pure subroutine forces(self, bonds, pull)
    class(lps_plastic_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(in) :: bonds        !! of the point, with its history
    real(wp), intent(out) :: pull(:)                 !! (n) [N/m6]
    type(plastic_state_type) :: now

    call find_state(self, bonds, now)
    associate (n => bonds%n)
      pull(:n) = now%omega*((3*self%material%bulk_modulus*now%theta/now%m)*now%widening*now%along &
        & + alpha(self, now)*(now%left*now%deviator + now%part*free(now)*now%along)*now%slope)
    end associate
  end subroutine forces

  !> kappa theta^2/2 + (alpha/2) (<d, d> + part^2 (1 - <v, v>/m) <v, v>), d after flow.
  pure real(wp) function energy(self, bonds)
    class(lps_plastic_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(in) :: bonds        !! of the point, with its history
    type(plastic_state_type) :: now

    call find_state(self, bonds, now)
    energy = self%material%bulk_modulus*now%theta**2/2 + alpha(self, now)/2*(now%left**2 &
      & *sum(now%weight*now%deviator**2) + now%part**2*free(now)*now%intact)
  end function energy

  !> Let the plastic flow stay. The force on e - e_p does work on what flows; it is taken as the
  !> mean of the forces before and after, as in the work of loads by the trapezoidal rule, so that
  !> work, energy and dissipation agree to rounding. As flow is orthogonal to v, that is
  !> (alpha/2) <d of the last commit + d after flow, flow>.
  pure subroutine commit(self, bonds, dissipated)
    class(lps_plastic_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(inout) :: bonds     !! of the point; its history is set
    real(wp), intent(out) :: dissipated              !! since the history before [J/m3]
    type(plastic_state_type) :: now
    real(wp) :: flow(bonds%n)

    call find_state(self, bonds, now)
    flow = (1 - now%left)*now%deviator
    associate (n => bonds%n)
      dissipated = alpha(self, now)/2*sum(now%weight*flow*(now%left*now%deviator &
        & + bonds%history(reached, :n) - bonds%history(plastic, :n)))
      bonds%history(plastic, :n) = bonds%history(plastic, :n) + flow
      where (bonds%volume(:n) > 0.0_wp) bonds%history(reached, :n) = now%extension
    end associate
    bonds%of_point(strain) = bonds%of_point(strain) + now%flow
  end subroutine commit

  !> The law holds in 3D.
  pure function refusal(self) result(reason)
    class(lps_plastic_law_type), intent(in) :: self  !! after `set_up`
    character(:), allocatable :: reason

    reason = ''
    if (self%dim /= 3) reason = 'it yields by the stress deviator, which has a part out of the '// &
      & 'plane or across the bar that bonds within it do not see: use dimension = 3'
  end function refusal

  !> The state from the committed history: elastic, then the return to the yield surface.
  pure subroutine find_state(self, bonds, now)
    class(lps_plastic_law_type), intent(in) :: self
    type(law_bonds_type), intent(in) :: bonds
    type(plastic_state_type), intent(out) :: now
    real(wp) :: limit
    integer :: i

    now%m = bonds%constants(volume_m)
    allocate (now%weight(bonds%n), now%omega(bonds%n), now%along(bonds%n), &
      & now%extension(bonds%n), now%deviator(bonds%n), now%slope(bonds%n), &
      & now%widening(bonds%n), source=0.0_wp)
    do i = 1, bonds%n
      if (bonds%volume(i) <= 0.0_wp) cycle
      now%omega(i) = self%omega(bonds%length(i)/self%delta)
      now%weight(i) = now%omega(i)*bonds%volume(i)
      now%along(i) = bonds%projection(i)*bonds%length(i)
    end do
    call self%measure(bonds, now)
    do i = 1, bonds%n
      if (bonds%volume(i) > 0.0_wp) now%deviator(i) = now%extension(i) - bonds%history(plastic, i)
    end do
    now%intact = sum(now%weight*now%along**2)
    if (now%intact > 0.0_wp) now%part = sum(now%weight*now%along*now%deviator)/now%intact
    now%deviator = now%deviator - now%part*now%along
    associate (mu => self%material%shear_modulus, hardening => self%parameter('hardening'))
      now%equivalent = 15*mu*sqrt(sum(now%weight*now%deviator**2)/now%m/5)
      limit = self%parameter('yield_stress') + hardening*bonds%of_point(strain)
      if (now%equivalent <= limit) return
      now%flow = (now%equivalent - limit)/(3*mu + hardening)
      now%left = (limit + hardening*now%flow)/now%equivalent
    end associate
  end subroutine find_state

  !> Extensions and dilatation from the stretches, and how they go with the bonds' lengths: of small
  !> strains e = s |xi| and theta = (3/m) <v, e>.
  pure subroutine measure(self, bonds, now)
    class(lps_plastic_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(in) :: bonds        !! of the point
    type(plastic_state_type), intent(inout) :: now   !! with m, weights and v
    integer :: i

    associate (unused => self)
    end associate
    do i = 1, bonds%n
      if (bonds%volume(i) > 0.0_wp) now%extension(i) = bonds%stretch(i)*bonds%length(i)
    end do
    now%slope = 1.0_wp
    now%widening = 1.0_wp
    now%theta = 3/now%m*sum(now%weight*now%along*now%extension)
  end subroutine measure

  !> The stiffness of the deviatoric force [N/m7].
  pure real(wp) function alpha(self, now)
    class(lps_plastic_law_type), intent(in) :: self
    type(plastic_state_type), intent(in) :: now
    alpha = 15*self%material%shear_modulus/now%m
  end function alpha

  !> 1 - <v, v>/m: 0 but for rounding in a whole family.
  pure real(wp) function free(now)
    type(plastic_state_type), intent(in) :: now
    free = 1 - now%intact/now%m
  end function free

end module pd_law_lps_plastic
