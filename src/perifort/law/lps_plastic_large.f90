!> The elastic-plastic solid for large strains in 3D, `model = 'lps_plastic_large'`: `lps_plastic`
!> with other measures of extension and dilatation (doc/theory.md, 15). With lambda = |y|/|xi| of a
!> bond, less its thermal strain, and z = lambda^(-3/2),
!>
!>     e     = (2/3) |xi| (1 - z)
!>     theta = -ln(1 + (1/m) <v, v (z^2 - 1)>)
!>
!> The mean of |F n|^-3 over all directions n is 1/det F for any F. So theta is the logarithm of the
!> change of volume of a uniform deformation: a change of shape has none, however large it is, while
!> the theta of small strains grows with its square. It is also what the density of directions
!> changes by from the undeformed to the deformed body, so that rates of e, whose square has the
!> factor lambda^-3, have the same norm in any state that has kept its volume: the body yields at
!> the same stress. Both measures are those of `lps_plastic` where strains are small. The energy is
!> the same function of them, and the forces are its gradient: they grow without limit as a bond
!> shrinks.
!>
!> Yield stress and hardening are those of the Kirchhoff stress, true stress times the change of
!> volume, over the logarithmic plastic strain.
module pd_law_lps_plastic_large
  use pd_base_kinds, only: wp
  use pd_law_law, only: law_bonds_type
  use pd_law_lps_plastic, only: lps_plastic_law, lps_plastic_law_type, plastic_state_type
  implicit none (type, external)
  private
  public :: lps_plastic_large_law_type, lps_plastic_large_law

  type, extends(lps_plastic_law_type) :: lps_plastic_large_law_type
  contains
    procedure :: measure
    procedure :: dilatation
    procedure :: stiffness
  end type lps_plastic_large_law_type

  !> Logarithmic strain up to which a bar on the default lattice was found to flow at the given
  !> stress to some 5 %, in tension and compression (doc/theory.md, 15); at 0.5 it is 13 % off.
  real(wp), parameter :: measured_to = 0.4_wp
  !> Length over the undeformed one down to which the bound of the stiffness holds.
  real(wp), parameter :: pressed = 0.8_wp
  !> Shorter bonds have the forces of this length over the undeformed one, which are finite.
  real(wp), parameter :: shortest = 0.02_wp

contains

  !> `model = 'lps_plastic_large'`.
  function lps_plastic_large_law() result(law)
    type(lps_plastic_large_law_type) :: law

    law%lps_plastic_law_type = lps_plastic_law()
    law%name = 'lps_plastic_large'
    law%large_strains = .true.
    law%accurate_to = measured_to
  end function lps_plastic_large_law

  !> Extensions and dilatation of large strains.
  pure subroutine measure(self, bonds, now)
    class(lps_plastic_large_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(in) :: bonds              !! of the point
    type(plastic_state_type), intent(inout) :: now         !! with m, weights and v
    real(wp) :: lambda, change
    integer :: i

    associate (unused => self)
    end associate
    change = 0.0_wp
    do i = 1, bonds%n
      if (.not. bonds%volume(i) > 0.0_wp) cycle
      lambda = max(1 + bonds%stretch(i), shortest)
      now%extension(i) = 2*bonds%length(i)/3*less_than_one(lambda)
      now%slope(i) = 1/(lambda**2*sqrt(lambda))
      now%widening(i) = 1/lambda**4
      change = change + now%weight(i)*now%along(i)*bonds%length(i)*cubic(lambda)
    end do
    change = change/now%m
    now%theta = -log(1 + change)
    now%widening = now%widening/(1 + change)
  end subroutine measure

  !> The change of volume over the volume, exp(theta) - 1 [-].
  pure real(wp) function dilatation(self, bonds) result(theta)
    class(lps_plastic_large_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(in) :: bonds              !! of the point
    real(wp) :: change
    integer :: i

    theta = 0.0_wp
    if (bonds%n == 0) return  ! a slot without a point has no m
    change = 0.0_wp
    do i = 1, bonds%n
      if (.not. bonds%volume(i) > 0.0_wp) cycle
      change = change + self%omega(bonds%length(i)/self%delta)*bonds%volume(i) &
        & *bonds%projection(i)*bonds%length(i)**2*cubic(max(1 + bonds%stretch(i), shortest))
    end do
    change = change/bonds%constants(self%volume_constant)
    theta = -change/(1 + change)
  end function dilatation

  !> The bound of `lps`, raised for pressed bonds: of a body that is flattened at its volume the
  !> stiffness of the shortest bonds grows as lambda^-6.3, which the part lambda^-4 of the change of
  !> volume makes. No bound holds for bonds of any length: where many are shorter than `pressed`,
  !> steps are to be shorter, too.
  pure subroutine stiffness(self, bonds, bound)
    class(lps_plastic_large_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(in) :: bonds              !! of the point, whole
    real(wp), intent(out) :: bound(:)                      !! (n) [N/m7]

    call self%lps_plastic_law_type%stiffness(bonds, bound)
    bound(:bonds%n) = bound(:bonds%n)*pressed**(-6.5_wp)
  end subroutine stiffness

  !> lambda^-3 - 1, with all digits near 1.
  pure real(wp) function cubic(lambda)
    real(wp), intent(in) :: lambda
    cubic = (1 - lambda)*(1 + lambda + lambda**2)/lambda**3
  end function cubic

  !> 1 - lambda^(-3/2), with all digits near 1.
  pure real(wp) function less_than_one(lambda)
    real(wp), intent(in) :: lambda
    less_than_one = -cubic(lambda)/(1 + 1/(lambda*sqrt(lambda)))
  end function less_than_one

end module pd_law_lps_plastic_large
