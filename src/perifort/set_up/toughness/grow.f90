!> How tough a lattice is: the energy release rate G at which a crack grows through it, over the Gc
!> from which bonds have their critical stretch (doc/theory.md, 8).
!>
!> Points around a crack's tip are held, beyond a radius, at the displacements of the classical
!> material at a stress intensity K in mode I; within, they are in equilibrium. The answer is linear
!> in K: the bond that is stretched most, by s at K, reaches s_c at G = (s_c/s)^2 K^2/E'. It breaks,
!> its mirror image together with it, and the next one is found, until the crack has grown through
!> some periods of the lattice. The tip of K's field moves with the crack: through the plane of the
!> crack go so many bonds by length, and as many as have broken tell how far the tip has come.
module pd_set_up_toughness_grow
  use pd_base_kinds, only: wp
  use pd_base_long_work, only: long_work_type
  use pd_base_text, only: to_text
  use pd_family_volume, only: volume_rule_type
  use pd_law_material, only: new_material
  use pd_law_weighted, only: weighted_law_type
  use pd_set_up_toughness_disc, only: bonds_across, classical_field, crosses, cut, disc_type, &
    & image_of, make_disc, most_stretched, relax
  implicit none (type, external)
  private
  public :: grow_crack, toughness_type, subject_type, radius_of

  real(wp), parameter :: usual_radius = 28.0_wp   !! of the disc [spacings]
  real(wp), parameter :: least_horizons = 5.0_wp  !! of the radius, where the horizon is longer
  !> Part of the horizon by which the crack grows before anything counts: a straight cut is not the
  !> tip that a growing crack has.
  real(wp), parameter :: lead = 0.7_wp
  real(wp), parameter :: counted = 2.0_wp         !! growth that counts then, about [spacings]
  real(wp), parameter :: tolerance = 3.0e-5_wp    !! residual over the forces at the rim
  !> Bonds that may break, over those that a straight crack needs.
  integer, parameter :: most_breaks = 3

  !> What the toughness depends on, beside the law with its Poisson's ratio.
  type :: subject_type
    integer :: dim = 2                      !! 2 or 3
    logical :: plane_strain = .false.       !! 2D: else plane stress
    type(volume_rule_type) :: rule          !! volume correction; horizon in spacings
    logical :: corrected = .true.           !! whole families carry the classical energy
  end type subject_type

  !> What was found.
  type :: toughness_type
    logical :: known = .false.     !! the crack has grown as it should
    real(wp) :: largest = 1.0_wp   !! largest G/Gc within the periods, at the formula's s_c
    real(wp) :: mean = 1.0_wp      !! mean of G/Gc over the bonds that broke in them
    integer :: solves = 0          !! equilibria
    integer :: iterations = 0      !! of conjugate gradients, in all
    real(wp), allocatable :: rates(:)  !! G/Gc of each bond that broke in the periods, in order
  end type toughness_type

contains

  !> Radius of the disc for a horizon [spacings].
  pure real(wp) function radius_of(delta) result(radius)
    real(wp), intent(in) :: delta  !! horizon [spacings]
    radius = max(usual_radius, least_horizons*delta)
  end function radius_of

  !> The toughness of a lattice for a law.
  subroutine grow_crack(law, subject, diagonal, toughness, radius, work)
    class(weighted_law_type), intent(in) :: law     !! with its Poisson's ratio and influence
    type(subject_type), intent(in) :: subject       !! the lattice
    logical, intent(in) :: diagonal                 !! the crack grows along diagonals of cells
    type(toughness_type), intent(out) :: toughness  !! relative to the Gc of the law's formula
    real(wp), intent(in), optional :: radius        !! of the disc; `radius_of` it [spacings]
    type(long_work_type), intent(inout), optional :: work
      !! says how far the crack is; absent: nothing does
    class(weighted_law_type), allocatable :: one
    type(disc_type) :: disc
    real(wp), allocatable :: u(:, :, :), field(:, :, :), next(:, :, :)
    real(wp) :: size_of, period, tip, s, s_c, modulus
    logical :: flat, counts
    integer :: bond(3), broken, wanted, begun, most

    allocate (one, source=law)
    flat = subject%plane_strain .or. subject%dim == 3
    call one%set_up(new_material(1.0_wp, law%material%poissons_ratio, 1.0_wp, subject%dim, &
      & subject%plane_strain, 1.0_wp, 1.0_wp, subject%rule%delta, law%bond_based), subject%dim, &
      & subject%plane_strain, subject%rule%delta, 1.0_wp)
    s_c = one%critical_stretch(1.0_wp)
    modulus = 1.0_wp
    if (flat) modulus = 1/(1 - one%material%poissons_ratio**2)
    size_of = radius_of(subject%rule%delta)
    if (present(radius)) size_of = radius
    call make_disc(one, subject%dim, subject%rule, subject%corrected, diagonal, size_of, disc)
    call cut(disc)
    allocate (u(disc%cells, disc%cells, 2))
    allocate (field, next, mold=u)
    period = merge(sqrt(2.0_wp), 1.0_wp, diagonal)
    begun = nint(bonds_across(disc)*period*nint(lead*subject%rule%delta/period))
    wanted = begun + nint(bonds_across(disc)*period*nint(counted/period))
    most = most_breaks*wanted
    allocate (toughness%rates(0))
    tip = 0.0_wp
    broken = 0
    call place_field(tip, field)
    u = field
    do while (broken < wanted .and. toughness%solves < most)
      call relax(disc, tolerance, u, toughness%iterations)
      toughness%solves = toughness%solves + 1
      if (present(work)) then
        if (work%is_due()) call work%tell('crack of '//to_text(broken)//' of '//to_text(wanted) &
          & //' bonds')
      end if
      call most_stretched(disc, u, s, bond)
      if (.not. s > 0.0_wp) exit
      counts = broken >= begun
      call break_bond(bond)
      call break_bond(image_of(disc, bond))
      tip = broken/bonds_across(disc)
      call place_field(tip, next)
      u = u + (next - field)
      field = next
    end do
    toughness%known = broken >= wanted
    if (size(toughness%rates) == 0) return
    toughness%largest = maxval(toughness%rates)
    toughness%mean = sum(toughness%rates)/size(toughness%rates)

  contains

    !> The field of K = 1 around a tip.
    subroutine place_field(tip, u)
      real(wp), intent(in) :: tip
      real(wp), intent(out) :: u(:, :, :)
      call classical_field(disc, one%material%shear_modulus, one%material%poissons_ratio, flat, &
        & tip, u)
    end subroutine place_field

    !> Break a bond, if it is not broken yet, and count it.
    subroutine break_bond(bond)
      integer, intent(in) :: bond(3)  !! kind 0: none

      if (bond(3) == 0) return
      associate (intact => disc%intact(bond(1), bond(2), bond(3)), kind => disc%kinds(bond(3)))
        if (.not. intact > 0.0_wp) return
        intact = 0.0_wp
        if (counts) toughness%rates = [toughness%rates, spread((s_c/s)**2/modulus, 1, kind%number)]
        if (crosses(disc, bond)) broken = broken + kind%number
      end associate
    end subroutine break_bond
  end subroutine grow_crack

end module pd_set_up_toughness_grow
