!> Bonds that soften, `model = 'softening'`: bond-based, the pull of a bond in tension grows to its
!> peak at the stretch s_0 (`peak_stretch`) and falls linearly to zero at s_u, where the bond breaks
!> (doc/theory.md, 8). With kappa the greatest stretch that the bond has had
!>
!>     pull = q gb Gb (1 - D) s,  1 - D = s_0 (s_u - kappa)/(kappa (s_u - s_0)) for kappa > s_0
!>
!> in tension: it unloads to the origin with its secant stiffness. In compression it has its whole
!> stiffness at any damage, as a closed crack does. The area under the curve, s_0 s_u/2, is that of
!> a linear bond that breaks at the critical stretch s_c of Gc, s_c^2/2: s_u = s_c^2/s_0. That is
!> the critical stretch of this law, and of its material.
module pd_law_softening
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text
  use pd_law_law, only: law_bonds_type, parameter_type
  use pd_law_material, only: never
  use pd_law_weighted, only: weighted_law_type
  implicit none (type, external)
  private
  public :: softening_law_type, softening_law

  type, extends(weighted_law_type) :: softening_law_type
  contains
    procedure :: forces
    procedure :: energy
    procedure :: commit
    procedure :: bond_damage
    procedure :: critical_stretch
    procedure :: refusal
  end type softening_law_type

contains

  !> `model = 'softening'`. It has a force of its own, so that it is no weighted law.
  function softening_law() result(law)
    type(softening_law_type) :: law
    law%name = 'softening'
    law%bond_based = .true.
    law%softens = .true.
    law%bond_history = 1  ! kappa
    law%parameters = [parameter_type('peak_stretch', '-', &
      & 'softening: stretch at which bonds begin to soften')]
  end function softening_law

  !> q gb Gb of every bond.
  pure subroutine factors(self, bonds, qg)
    class(softening_law_type), intent(in) :: self
    type(law_bonds_type), intent(in) :: bonds
    real(wp), intent(out) :: qg(:)
    real(wp) :: gb, gd
    integer :: i

    qg = self%material%q*bonds%Gb(:bonds%n)
    if (.not. self%has_factors()) return
    do i = 1, bonds%n
      call self%bond_factors(bonds%length(i)/self%delta, gb, gd)
      qg(i) = gb*qg(i)
    end do
  end subroutine factors

  !> 1 - D: the part of the stiffness in tension that is left.
  pure real(wp) function left(kappa, s_0, s_u)
    real(wp), intent(in) :: kappa, s_0, s_u

    if (kappa <= s_0) then
      left = 1.0_wp
    else if (kappa < s_u) then
      left = s_0*(s_u - kappa)/(kappa*(s_u - s_0))
    else
      left = 0.0_wp
    end if
  end function left

  !> What a bond has dissipated when its greatest stretch is kappa, over q gb Gb |xi|/2: the work
  !> s_0^2 + (s_0 + p)(kappa - s_0) of the pull, p = (1 - D) kappa at last, less the stored p kappa.
  pure real(wp) function lost(kappa, s_0, s_u)
    real(wp), intent(in) :: kappa, s_0, s_u
    lost = s_0*s_u/(s_u - s_0)*(min(max(kappa, s_0), s_u) - s_0)
  end function lost

  !> The point's own part of each bond's pair force density.
  pure subroutine forces(self, bonds, pull)
    class(softening_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(in) :: bonds      !! of the point, with its history
    real(wp), intent(out) :: pull(:)               !! (n) [N/m6]
    real(wp) :: qg(bonds%n), s_0, s_u
    integer :: i

    s_0 = self%parameter('peak_stretch')
    s_u = self%material%critical_stretch
    call factors(self, bonds, qg)
    do i = 1, bonds%n
      pull(i) = 0.0_wp
      if (bonds%volume(i) <= 0.0_wp) cycle
      associate (s => bonds%stretch(i))
        pull(i) = qg(i)*s
        if (s > 0.0_wp) pull(i) = pull(i)*left(max(bonds%history(1, i), s), s_0, s_u)
      end associate
    end do
  end subroutine forces

  !> The stored energy (1 - D) s^2 in tension and s^2 in compression, and what the bond dissipates
  !> where it is stretched further than its history, each with (q/2) gb Gb |xi| vc V_j. So its
  !> change is the work of the pulls, and after `commit` it is the stored energy alone. A bond that
  !> breaks between two commits releases what it would have dissipated.
  pure real(wp) function energy(self, bonds)
    class(softening_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(in) :: bonds      !! of the point, with its history
    real(wp) :: qg(bonds%n), s_0, s_u, sum_of_bond
    integer :: i

    s_0 = self%parameter('peak_stretch')
    s_u = self%material%critical_stretch
    call factors(self, bonds, qg)
    energy = 0.0_wp
    do i = 1, bonds%n
      associate (s => bonds%stretch(i), kappa => bonds%history(1, i))
        sum_of_bond = s**2
        if (s > 0.0_wp) sum_of_bond = left(max(kappa, s), s_0, s_u)*s**2
        if (s > kappa) sum_of_bond = sum_of_bond + lost(s, s_0, s_u) - lost(kappa, s_0, s_u)
        energy = energy + qg(i)*bonds%length(i)*bonds%volume(i)*sum_of_bond
      end associate
    end do
    energy = energy/2
  end function energy

  !> Bring the greatest stretches of intact bonds up to date. The energy of the others was counted
  !> when they broke.
  pure subroutine commit(self, bonds, dissipated)
    class(softening_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(inout) :: bonds   !! of the point; its history is set
    real(wp), intent(out) :: dissipated            !! since the history before [J/m3]
    real(wp) :: qg(bonds%n), s_0, s_u
    integer :: i

    s_0 = self%parameter('peak_stretch')
    s_u = self%material%critical_stretch
    call factors(self, bonds, qg)
    dissipated = 0.0_wp
    do i = 1, bonds%n
      if (bonds%volume(i) <= 0.0_wp) cycle
      associate (s => bonds%stretch(i), kappa => bonds%history(1, i))
        if (s <= kappa) cycle
        dissipated = dissipated + qg(i)*bonds%length(i)*bonds%volume(i) &
          & *(lost(s, s_0, s_u) - lost(kappa, s_0, s_u))
        kappa = s
      end associate
    end do
    dissipated = dissipated/2
  end subroutine commit

  !> D: 1 less the stiffness that is left in tension.
  pure subroutine bond_damage(self, bonds, damage)
    class(softening_law_type), intent(in) :: self  !! the law
    type(law_bonds_type), intent(in) :: bonds      !! of the point, with its history
    real(wp), intent(out) :: damage(:)             !! (n) 0 to 1 [-]
    real(wp) :: s_0
    integer :: i

    s_0 = self%parameter('peak_stretch')
    do i = 1, bonds%n
      damage(i) = 1 - left(bonds%history(1, i), s_0, self%material%critical_stretch)
    end do
  end subroutine bond_damage

  !> s_u = s_c^2/s_0, the stretch at which a bond is lost.
  pure real(wp) function critical_stretch(self, Gc) result(s_u)
    class(softening_law_type), intent(in) :: self  !! after `set_up`
    real(wp), intent(in) :: Gc                     !! critical energy release rate [J/m2]
    s_u = self%weighted_law_type%critical_stretch(Gc)**2/self%parameter('peak_stretch')
  end function critical_stretch

  !> Why the law cannot be had: no stretch s_u, one that is not above s_0, or bonds that break in
  !> compression.
  pure function refusal(self) result(reason)
    class(softening_law_type), intent(in) :: self  !! after `set_up`, with the critical stretch
    character(:), allocatable :: reason
    real(wp) :: s_0, s_u

    s_0 = self%parameter('peak_stretch')
    s_u = self%material%critical_stretch
    reason = ''
    if (s_u >= never) then
      reason = 'softening needs critical_energy_release_rate, or critical_stretch for the '// &
        & 'stretch at which a bond is lost'
    else if (s_u <= s_0) then
      reason = 'bonds are lost at the stretch s_c^2/peak_stretch = '//to_text(s_u, 4)// &
        & ', which must be above peak_stretch = '//to_text(s_0, 4)//': peak_stretch must be '// &
        & 'below s_c = '//to_text(sqrt(s_0*s_u), 4)//', the critical stretch of linear bonds '// &
        & 'with the same energy'
    else if (self%material%break_in_compression) then
      reason = 'bonds soften in tension alone: take break_in_compression = .false.'
    end if
  end function refusal

end module pd_law_softening
