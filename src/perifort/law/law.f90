!> What a bond does. A law says how a bond's stretch becomes a force, how much energy that stores,
!> and what is left of it for good. It knows nothing of points, families and loops: it is given the
!> bonds of one point at a time, as arrays.
!>
!> A law extends `bond_law_type` in a file of its own and is a line of the table in `pd_law_laws`,
!> or is added to that table by a program. It is weighted or general:
!>
!> - The force of a **weighted** law is that of the chapter with other weights (doc/theory.md, 2 and
!>   15): every bond has a factor of its length, every point a scale. It runs on the fast loops. It
!>   extends `weighted_law_type` (`pd_law_weighted`), which has all procedures that a law needs.
!> - A **general** law has any force and a history. It runs on the generic pass.
!>
!> Every law has the procedures of the generic pass: where materials of a body differ in their laws,
!> the generic pass serves all of them.
module pd_law_law
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp
  use pd_law_influence, only: gauss, influence_at, quadrature
  use pd_law_material, only: material_type
  implicit none (type, external)
  private
  public :: bond_law_type, law_bonds_type, law_name_length, parameter_type, required
  public :: allocate_law_bonds

  integer, parameter :: law_name_length = 64       !! longest name of a law or parameter
  real(wp), parameter :: required = -huge(1.0_wp)  !! default of a parameter that has none

  !> A key of `&material` that belongs to a law. Its value must be positive.
  type :: parameter_type
    character(law_name_length) :: name = ''   !! the key
    character(16) :: unit = '-'               !! in which it is given
    character(120) :: meaning = ''            !! for the reference
    real(wp) :: default = required            !! `required`: it must be given
    logical :: zero = .false.                 !! it may be 0
    real(wp) :: value = required              !! as given, or the default
  end type parameter_type

  !> The bonds of one point as a law sees them. Of the arrays the first `n` entries count.
  type :: law_bonds_type
    integer :: n = 0                             !! bonds, broken ones included
    real(wp), allocatable :: length(:)           !! |xi| [m]
    real(wp), allocatable :: volume(:)           !! vc V_j [m3], 0 where a bond is broken
    real(wp), allocatable :: stretch(:)          !! mechanical stretch s [-]
    real(wp), allocatable :: projection(:)       !! Lambda, 1 with the unprojected dilatation [-]
    real(wp), allocatable :: Gd(:)               !! surface factor of the dilatation [-]
    real(wp), allocatable :: Gb(:)               !! surface factor of the stretches [-]
    real(wp), allocatable :: history(:, :)       !! (bond_history, bond) of each bond
    real(wp), allocatable :: of_point(:)         !! (point_history) of the point
    real(wp), allocatable :: constants(:)        !! (point_constants) of the point, by `begin`
  end type law_bonds_type

  type, abstract :: bond_law_type
    character(law_name_length) :: name = ''      !! value of the key `model`
    character(law_name_length) :: influence = 'inverse'  !! influence function, by its name
    type(parameter_type), allocatable :: parameters(:)   !! keys of its own
    logical :: weighted = .false.                !! it runs on the fast loops
    logical :: bond_based = .false.              !! it holds for one Poisson's ratio
    logical :: corrected = .true.                !! it takes surface factors, if there are any
    logical :: plastic = .false.                 !! what it dissipates is plastic energy
    logical :: large_strains = .false.           !! it holds for bonds strained by any amount
    real(wp) :: accurate_to = huge(1.0_wp)
      !! largest logarithmic strain of a bond for which a law for large strains is accurate [-]
    logical :: softens = .false.                 !! `bond_damage` is not 0 for some intact bonds
    integer :: bond_history = 0                  !! reals of history of a bond
    integer :: point_history = 0                 !! reals of history of a point
    integer :: point_constants = 0               !! reals that `begin` sets
    type(material_type) :: material              !! moduli and, after `set_up`, the law's constants
    integer :: dim = 0                           !! of the body
    logical :: plane_strain = .false.            !! 2D: else plane stress
    real(wp) :: delta = 0.0_wp                   !! horizon [m]
    real(wp) :: depth = 1.0_wp                   !! thickness in 2D [m], area in 1D [m2]
  contains
    procedure, non_overridable :: set_up
    procedure(forces_interface), deferred :: forces
    procedure(energy_interface), deferred :: energy
    procedure(stiffness_interface), deferred :: stiffness
    procedure :: find_constants => no_constants
    procedure :: omega
    procedure :: begin => begin_nothing
    procedure :: commit => commit_nothing
    procedure :: dilatation => no_dilatation
    procedure :: bond_damage => no_damage
    procedure :: critical_stretch => no_critical_stretch
    procedure :: refusal => no_refusal
    procedure, non_overridable :: parameter
    procedure, non_overridable :: moment
  end type bond_law_type

  abstract interface
    !> The point's own part of each bond's pair force density; the other end gives the rest.
    !> Positive values pull. It must depend on what it is given alone, and leave broken bonds at 0.
    pure subroutine forces_interface(self, bonds, pull)
      import :: bond_law_type, law_bonds_type, wp
      implicit none (type, external)
      class(bond_law_type), intent(in) :: self   !! the law
      type(law_bonds_type), intent(in) :: bonds  !! of the point, with its history
      real(wp), intent(out) :: pull(:)           !! (n) [N/m6]
    end subroutine forces_interface

    !> The strain energy density that the point stores.
    pure real(wp) function energy_interface(self, bonds)
      import :: bond_law_type, law_bonds_type, wp
      implicit none (type, external)
      class(bond_law_type), intent(in) :: self   !! the law
      type(law_bonds_type), intent(in) :: bonds  !! of the point, with its history
    end function energy_interface

    !> A bound of the stiffness of the point's own part of each bond, in any state: with c the
    !> largest |d pull/d|y|| by the bond's own length, and a theta its part of a dilatation
    !> theta = sum_l w_l e_l vc V_l of extensions e, that is c + |a| sum_l |w_l| vc V_l.
    pure subroutine stiffness_interface(self, bonds, bound)
      import :: bond_law_type, law_bonds_type, wp
      implicit none (type, external)
      class(bond_law_type), intent(in) :: self   !! the law
      type(law_bonds_type), intent(in) :: bonds  !! of the point at the start, whole
      real(wp), intent(out) :: bound(:)          !! (n) [N/m7]
    end subroutine stiffness_interface
  end interface

contains

  !> Give the law its moduli, dimension and horizon, and let it find its constants.
  subroutine set_up(self, material, dim, plane_strain, delta, depth)
    class(bond_law_type), intent(inout) :: self  !! with its influence and parameters
    type(material_type), intent(in) :: material  !! with its moduli
    integer, intent(in) :: dim                   !! of the body: 1, 2 or 3
    logical, intent(in) :: plane_strain          !! plane strain, else plane stress; used in 2D only
    real(wp), intent(in) :: delta                !! horizon [m]
    real(wp), intent(in) :: depth                !! thickness in 2D [m], area in 1D [m2]

    self%material = material
    self%dim = dim
    self%plane_strain = plane_strain
    self%delta = delta
    self%depth = depth
    call self%find_constants()
  end subroutine set_up

  !> Set what follows from moduli, dimension and horizon, in `material` and in the law. By default
  !> nothing does: `material` has the moduli and the constants of the chapter's laws.
  subroutine no_constants(self)
    class(bond_law_type), intent(inout) :: self  !! with its moduli, dimension and horizon
    associate (unused => self)
    end associate
  end subroutine no_constants

  !> The influence function omega of a bond. A law with a function of its own overrides it.
  pure real(wp) function omega(self, ratio)
    class(bond_law_type), intent(in) :: self  !! the law
    real(wp), intent(in) :: ratio             !! |xi|/delta, above 0 [-]
    omega = influence_at(self%influence, ratio)
  end function omega

  !> Set `bonds%constants` of a point from its whole family before any crack. By default there are
  !> none.
  pure subroutine begin_nothing(self, bonds)
    class(bond_law_type), intent(in) :: self      !! the law
    type(law_bonds_type), intent(inout) :: bonds  !! of the point; no stretch is set

    if (self%point_constants > 0) call internal_fault('a law does not set its constants')
    associate (unused => bonds)
    end associate
  end subroutine begin_nothing

  !> Bring the history of a point and its bonds to the present state, after an accepted step. By
  !> default there is no history.
  pure subroutine commit_nothing(self, bonds, dissipated)
    class(bond_law_type), intent(in) :: self      !! the law
    type(law_bonds_type), intent(inout) :: bonds  !! of the point; its history is set
    real(wp), intent(out) :: dissipated           !! since the history before [J/m3]

    dissipated = 0.0_wp
    if (self%bond_history + self%point_history > 0) &
      & call internal_fault('a law does not commit its history')
    associate (unused => bonds)
    end associate
  end subroutine commit_nothing

  !> The dilatation of a point [-]. A law that has one overrides this.
  pure real(wp) function no_dilatation(self, bonds) result(theta)
    class(bond_law_type), intent(in) :: self   !! the law
    type(law_bonds_type), intent(in) :: bonds  !! of the point

    associate (unused => bonds, unused_too => self)
    end associate
    theta = 0.0_wp
  end function no_dilatation

  !> How much of each intact bond is lost: 1 less its secant stiffness over that at the start.
  pure subroutine no_damage(self, bonds, damage)
    class(bond_law_type), intent(in) :: self   !! the law
    type(law_bonds_type), intent(in) :: bonds  !! of the point, with its history
    real(wp), intent(out) :: damage(:)         !! (n) 0 to 1 [-]

    if (self%softens) call internal_fault('a law that softens does not say its damage')
    associate (unused => bonds)
    end associate
    damage = 0.0_wp
  end subroutine no_damage

  !> The critical stretch for a critical energy release rate [-]. A law without one returns -1: the
  !> key is then refused.
  pure real(wp) function no_critical_stretch(self, Gc) result(s_c)
    class(bond_law_type), intent(in) :: self  !! after `set_up`
    real(wp), intent(in) :: Gc                !! critical energy release rate [J/m2]

    associate (unused => Gc, unused_too => self)
    end associate
    s_c = -1.0_wp
  end function no_critical_stretch

  !> Why the law cannot be had as it is set up, such as in a dimension; '' if it can.
  pure function no_refusal(self) result(reason)
    class(bond_law_type), intent(in) :: self  !! after `set_up`
    character(:), allocatable :: reason

    associate (unused => self)
    end associate
    reason = ''
  end function no_refusal

  !> The value of one of the law's parameters.
  pure real(wp) function parameter(self, name) result(value)
    class(bond_law_type), intent(in) :: self  !! the law
    character(*), intent(in) :: name          !! of the key
    integer :: i

    value = required
    if (allocated(self%parameters)) then
      do i = 1, size(self%parameters)
        if (self%parameters(i)%name /= name) cycle
        value = self%parameters(i)%value
        return
      end do
    end if
    call internal_fault('a law asks for a parameter that it does not have: '//name)
  end function parameter

  !> The integral of omega(r) r^power over r = |xi|/delta from 0 to 1.
  pure real(wp) function moment(self, power)
    class(bond_law_type), intent(in) :: self  !! the law
    integer, intent(in) :: power              !! at least 1, or 0 for a function that is finite at 0
    real(wp) :: node(quadrature), share(quadrature)
    integer :: i

    call gauss(node, share)
    moment = 0.0_wp
    do i = 1, quadrature
      moment = moment + share(i)*self%omega(node(i))*node(i)**power
    end do
  end function moment

  !> Room for the bonds of any one point.
  pure subroutine allocate_law_bonds(n, bond_history, point_history, point_constants, bonds)
    integer, intent(in) :: n                !! most bonds of a point
    integer, intent(in) :: bond_history     !! most reals of history of a bond
    integer, intent(in) :: point_history    !! most reals of history of a point
    integer, intent(in) :: point_constants  !! most constants of a point
    type(law_bonds_type), intent(out) :: bonds  !! without a bond

    allocate (bonds%length(n), bonds%volume(n), bonds%stretch(n), bonds%projection(n), &
      & bonds%Gd(n), bonds%Gb(n), source=1.0_wp)
    allocate (bonds%history(bond_history, n), bonds%of_point(point_history), &
      & bonds%constants(point_constants), source=0.0_wp)
  end subroutine allocate_law_bonds

end module pd_law_law
