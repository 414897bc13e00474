!> The linear peridynamic solid, `model = 'lps'`: the ordinary state-based law in the form that most
!> programs have (doc/theory.md, 15). With m_k = sum omega |xi|^2 vc V_j over the whole family and
!> e = |y| - |xi|, in 3D
!>
!>     theta_k = (3/m_k) sum omega |xi| e vc V_j
!>     pull    = (3 kappa - 5 mu) omega |xi| theta_k/m_k + 15 mu omega e/m_k
!>
!> and in 2D with 2/m_k, 2 kappa - 4 mu and 8 mu. It is a weighted law whose points are scaled by m
!> of a full family over m_k, so that it needs no surface factors.
module pd_law_lps
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: pi
  use pd_law_law, only: law_bonds_type
  use pd_law_weighted, only: weighted_law_type
  implicit none (type, external)
  private
  public :: lps_law_type, lps_law, weighted_volume

  type, extends(weighted_law_type) :: lps_law_type
  contains
    procedure :: begin
    procedure :: bond_factors
    procedure :: has_factors
  end type lps_law_type

contains

  !> `model = 'lps'`.
  function lps_law() result(law)
    type(lps_law_type) :: law
    law%name = 'lps'
    law%influence = 'constant'
    law%weighted = .true.
    law%scaled = .true.
    law%corrected = .false.
    law%point_constants = 1
  end function lps_law

  !> Scale a point by m of a full family over its own.
  pure subroutine begin(self, bonds)
    class(lps_law_type), intent(in) :: self       !! the law
    type(law_bonds_type), intent(inout) :: bonds  !! of the point, whole; gets its scale
    real(wp) :: full

    select case (self%dim)
    case (3); full = 4*pi*self%delta**5*self%moment(4)
    case (2); full = 2*pi*self%depth*self%delta**4*self%moment(3)
    case default; full = 2*self%depth*self%delta**3*self%moment(2)
    end select
    bonds%constants(1) = full/weighted_volume(self, bonds)
  end subroutine begin

  !> m_k = sum omega |xi|^2 vc V_j [m5 in 3D]; of a point without bonds as if it were full.
  pure real(wp) function weighted_volume(self, bonds) result(m)
    class(lps_law_type), intent(in) :: self     !! the law
    type(law_bonds_type), intent(in) :: bonds   !! of the point, whole
    integer :: i

    m = 0.0_wp
    do i = 1, bonds%n
      m = m + self%omega(bonds%length(i)/self%delta)*bonds%length(i)**2*bonds%volume(i)
    end do
    if (.not. m > 0.0_wp) m = huge(1.0_wp)
  end function weighted_volume

  !> omega |xi|/delta and omega (|xi|/delta)^2.
  pure subroutine bond_factors(self, ratio, gb, gd)
    class(lps_law_type), intent(in) :: self  !! the law
    real(wp), intent(in) :: ratio            !! |xi|/delta [-]
    real(wp), intent(out) :: gb              !! of its stretch's force [-]
    real(wp), intent(out) :: gd              !! of its part of the dilatation [-]

    gb = self%omega(ratio)*ratio
    gd = gb*ratio
  end subroutine bond_factors

  !> The dilatation's factor always differs from 1.
  pure logical function has_factors(self)
    class(lps_law_type), intent(in) :: self  !! the law
    associate (unused => self)
    end associate
    has_factors = .true.
  end function has_factors

end module pd_law_lps
