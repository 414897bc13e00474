!> The chapter's laws, `state_based` and `bond_based`, with any influence function, and what other
!> weighted laws extend (doc/theory.md, 2 and 15):
!>
!>     theta_k = t_k sum gd Gd s Lambda vc V_j
!>     pull    = q_k gb Gb s + 2 a t_k theta_k gd Gd Lambda/|xi|
!>
!> with gb and gd of the bond's length, and q_k and t_k those of the material times the scale of the
!> point.
module pd_law_weighted
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: pi
  use pd_law_influence, only: gauss, quadrature
  use pd_law_law, only: bond_law_type, law_bonds_type
  use pd_law_material, only: critical_stretch_from_energy
  implicit none (type, external)
  private
  public :: weighted_law_type, state_based_law, bond_based_law

  type, extends(bond_law_type) :: weighted_law_type
    logical :: scaled = .false.   !! points have scales; then `point_constants` is 1
  contains
    procedure :: find_constants
    procedure :: bond_factors
    procedure :: has_factors
    procedure :: forces
    procedure :: energy
    procedure :: stiffness
    procedure :: dilatation
    procedure :: critical_stretch
  end type weighted_law_type

contains

  !> `model = 'state_based'`.
  function state_based_law() result(law)
    type(weighted_law_type) :: law
    law%name = 'state_based'
    law%weighted = .true.
  end function state_based_law

  !> `model = 'bond_based'`.
  function bond_based_law() result(law)
    type(weighted_law_type) :: law
    law%name = 'bond_based'
    law%weighted = .true.
    law%bond_based = .true.
  end function bond_based_law

  !> q, t, p, b and d from the moduli: the energies of a full family under shear and under isotropic
  !> expansion are the classical ones. With factors of 1 they are those of the chapter, which the
  !> material has already.
  subroutine find_constants(self)
    class(weighted_law_type), intent(inout) :: self  !! with its moduli, dimension and horizon
    real(wp) :: stretches, dilatation

    if (.not. self%has_factors()) return
    call integrate(self, self%dim, stretches, dilatation)
    associate (m => self%material, delta => self%delta)
      select case (self%dim)
      case (3)
        m%q = 15*m%shear_modulus/(4*pi*delta**4*stretches)
        m%t = 3/(4*pi*delta**3*dilatation)
      case (2)
        m%q = 4*m%shear_modulus/(pi*self%depth*delta**3*stretches)
        m%t = 1/(pi*self%depth*delta**2*dilatation)
      case default
        m%q = m%youngs_modulus/(2*self%depth*delta**2*stretches)
        m%t = 1/(2*self%depth*delta*dilatation)
      end select
      m%b = m%q/(2*delta)
      m%d = m%t/delta
      m%p = 2*m%a*m%t
    end associate
  end subroutine find_constants

  !> Integrals over r = |xi|/delta from 0 to 1 of gb r^power and gd r^(power - 1).
  subroutine integrate(self, power, stretches, dilatation)
    class(weighted_law_type), intent(in) :: self
    integer, intent(in) :: power
    real(wp), intent(out) :: stretches, dilatation
    real(wp) :: node(quadrature), share(quadrature), gb, gd
    integer :: i

    call gauss(node, share)
    stretches = 0.0_wp
    dilatation = 0.0_wp
    do i = 1, quadrature
      call self%bond_factors(node(i), gb, gd)
      stretches = stretches + share(i)*gb*node(i)**power
      dilatation = dilatation + share(i)*gd*node(i)**(power - 1)
    end do
  end subroutine integrate

  !> Factors of a bond by which it differs from one of the chapter's: omega |xi|/delta for both.
  pure subroutine bond_factors(self, ratio, gb, gd)
    class(weighted_law_type), intent(in) :: self  !! the law
    real(wp), intent(in) :: ratio                 !! |xi|/delta [-]
    real(wp), intent(out) :: gb                   !! of its stretch's force [-]
    real(wp), intent(out) :: gd                   !! of its part of the dilatation [-]

    gb = self%omega(ratio)*ratio
    gd = gb
  end subroutine bond_factors

  !> Whether some factor differs from 1.
  pure logical function has_factors(self)
    class(weighted_law_type), intent(in) :: self  !! the law
    has_factors = self%influence /= 'inverse'
  end function has_factors

  !> q_k, t_k and p_k/theta_k of a point.
  pure subroutine scaled_constants(self, bonds, q, t, p)
    class(weighted_law_type), intent(in) :: self
    type(law_bonds_type), intent(in) :: bonds
    real(wp), intent(out) :: q, t, p
    real(wp) :: scale

    scale = 1.0_wp
    if (self%scaled) scale = bonds%constants(1)
    q = scale*self%material%q
    t = scale*self%material%t
    p = scale*self%material%p
  end subroutine scaled_constants

  !> Both factors of every bond, with the surface factors.
  pure subroutine all_factors(self, bonds, gb, gd)
    class(weighted_law_type), intent(in) :: self
    type(law_bonds_type), intent(in) :: bonds
    real(wp), intent(out) :: gb(:), gd(:)
    integer :: i

    gb = bonds%Gb(:bonds%n)
    gd = bonds%Gd(:bonds%n)
    if (.not. self%has_factors()) return
    do i = 1, bonds%n
      call self%bond_factors(bonds%length(i)/self%delta, gb(i), gd(i))
    end do
    gb = gb*bonds%Gb(:bonds%n)
    gd = gd*bonds%Gd(:bonds%n)
  end subroutine all_factors

  !> The point's own part of each bond's pair force density.
  pure subroutine forces(self, bonds, pull)
    class(weighted_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(in) :: bonds     !! of the point
    real(wp), intent(out) :: pull(:)              !! (n) [N/m6]
    real(wp) :: gb(bonds%n), gd(bonds%n), q, t, p, theta
    integer :: i

    call all_factors(self, bonds, gb, gd)
    call scaled_constants(self, bonds, q, t, p)
    do i = 1, bonds%n
      pull(i) = q*gb(i)*bonds%stretch(i)
    end do
    if (abs(p) > 0.0_wp) then
      theta = 0.0_wp
      do i = 1, bonds%n
        gd(i) = gd(i)*bonds%projection(i)
        theta = theta + gd(i)*bonds%stretch(i)*bonds%volume(i)
      end do
      theta = p*t*theta
      do i = 1, bonds%n
        pull(i) = pull(i) + theta*gd(i)/bonds%length(i)
      end do
    end if
    do i = 1, bonds%n
      pull(i) = merge(pull(i), 0.0_wp, bonds%volume(i) > 0.0_wp)
    end do
  end subroutine forces

  !> a theta^2 + (q/2) sum gb Gb s^2 |xi| vc V_j.
  pure real(wp) function energy(self, bonds)
    class(weighted_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(in) :: bonds     !! of the point
    real(wp) :: gb(bonds%n), gd(bonds%n), q, t, p
    integer :: i

    call all_factors(self, bonds, gb, gd)
    call scaled_constants(self, bonds, q, t, p)
    energy = 0.0_wp
    do i = 1, bonds%n
      energy = energy + gb(i)*bonds%stretch(i)**2*bonds%length(i)*bonds%volume(i)
    end do
    energy = q/2*energy
    if (abs(p) > 0.0_wp) energy = energy + self%material%a*self%dilatation(bonds)**2
  end function energy

  !> q gb Gb/|xi| + 2 max(a, 0) t^2 gd Gd/|xi| sum gd Gd vc V_l/|xi|.
  pure subroutine stiffness(self, bonds, bound)
    class(weighted_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(in) :: bonds     !! of the point, whole
    real(wp), intent(out) :: bound(:)             !! (n) [N/m7]
    real(wp) :: gb(bonds%n), gd(bonds%n), q, t, p

    call all_factors(self, bonds, gb, gd)
    call scaled_constants(self, bonds, q, t, p)
    gb = abs(gb)/bonds%length(:bonds%n)
    gd = abs(gd)/bonds%length(:bonds%n)
    bound(:bonds%n) = q*gb + max(p, 0.0_wp)*t*gd*sum(gd*bonds%volume(:bonds%n))
  end subroutine stiffness

  !> theta [-].
  pure real(wp) function dilatation(self, bonds) result(theta)
    class(weighted_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(in) :: bonds     !! of the point
    real(wp) :: gb(bonds%n), gd(bonds%n), q, t, p
    integer :: i

    call all_factors(self, bonds, gb, gd)
    call scaled_constants(self, bonds, q, t, p)
    theta = 0.0_wp
    do i = 1, bonds%n
      theta = theta + gd(i)*bonds%stretch(i)*bonds%projection(i)*bonds%volume(i)
    end do
    theta = t*theta
  end function dilatation

  !> The chapter's formula for its own influence function; with another one, the stretch at which
  !> the bonds through a plane, stretched alike and no others, hold Gc (doc/theory.md, 8 and 15).
  pure real(wp) function critical_stretch(self, Gc) result(s_c)
    class(weighted_law_type), intent(in) :: self  !! after `set_up`
    real(wp), intent(in) :: Gc                    !! critical energy release rate [J/m2]

    if (self%has_factors()) then
      s_c = sqrt(Gc/crossing_energy(self))
    else
      s_c = critical_stretch_from_energy(self%material, Gc, self%dim, self%delta)
    end if
  end function critical_stretch

  !> 2 int_0^delta W(z) dz over the distance z from the plane, over the square of the stretch of all
  !> bonds through it [J/m2]: of the stretches
  !> 3D pi q int gb r^4, 2D 2 h q int gb r^3, 1D A q int gb r^2, and 2 a int theta(z)^2.
  pure real(wp) function crossing_energy(self) result(energy)
    class(weighted_law_type), intent(in) :: self
    real(wp) :: node(quadrature), share(quadrature), theta, z, r, gb, gd, square
    integer :: i, j

    call gauss(node, share)
    energy = 0.0_wp
    square = 0.0_wp
    associate (m => self%material, delta => self%delta, h => self%depth)
      do i = 1, quadrature
        call self%bond_factors(node(i), gb, gd)
        select case (self%dim)
        case (3); energy = energy + pi*m%q*share(i)*gb*node(i)**4*delta**5
        case (2); energy = energy + 2*h*m%q*share(i)*gb*node(i)**3*delta**4
        case default; energy = energy + h*m%q*share(i)*gb*node(i)**2*delta**3
        end select
        z = node(i)
        theta = 0.0_wp
        do j = 1, quadrature
          r = z + (1 - z)*node(j)
          call self%bond_factors(r, gb, gd)
          select case (self%dim)
          case (3); theta = theta + (1 - z)*share(j)*gd*2*pi*r**2*(1 - z/r)*delta**3
          case (2); theta = theta + (1 - z)*share(j)*gd*2*h*r*acos(z/r)*delta**2
          case default; theta = theta + (1 - z)*share(j)*gd*h*delta
          end select
        end do
        square = square + share(i)*(m%t*theta)**2*delta
      end do
      energy = energy + 2*m%a*square
    end associate
  end function crossing_energy

end module pd_law_weighted
