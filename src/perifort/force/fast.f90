!> The fast loops over the bonds of one block of a lattice, for small strain: one text for all
!> dimensions and both precisions, and code of its own for each, because what is chosen must be
!> constants where the loops are compiled.
!>
!> With e = (2 xi.eta + eta.eta)/|xi|^2, the deformed length is |xi| sqrt(1 + e), the stretch
!> s = sqrt(1 + e) - 1 and |xi|/|xi+eta| = r = 1/sqrt(1 + e). The force needs s r = 1 - r, which for
!> |e| <= 0.02 is e h(e) with a polynomial h (relative error 3e-16, in single precision 6e-8): no
!> root, no division, and no cancellation. The polynomial for single precision serves |e| <= 0.1.
!>
!> In single precision eta is the difference of the displacements' leading digits, which is exact or
!> rounded relative to itself, plus that of the digits that follow: what is lost is 1e-7 of eta, not
!> of u.
module pd_force_fast
  use pd_base_kinds, only: wp, sp, i8
  use pd_family_lattice, only: lanes
  use pd_force_model, only: model_type
  implicit none (type, external)
  private
  public :: fast_limit
  public :: fast_dilatation_1, fast_dilatation_2, fast_dilatation_3
  public :: fast_force_1, fast_force_2, fast_force_3
  public :: mixed_dilatation_2, mixed_dilatation_3, mixed_force_2, mixed_force_3

  !> Limit and coefficients of h: (1 - 1/sqrt(1 + e))/e = 1/2 - 3/8 e + e^2 (Chebyshev interpolation
  !> of the rest).
  real(wp), parameter :: small_strain = 0.02_wp
  real(wp), parameter :: h0 = 0.5_wp, h1 = -0.375_wp, h2 = 0.31250000000037114_wp, &
    & h3 = -0.27343750000352559_wp, h4 = 0.24609373329889834_wp, h5 = -0.22558592163388049_wp, &
    & h6 = 0.20958398402647260_wp, h7 = -0.19648637700069084_wp
  !> The same for single precision, where fewer terms serve larger strain.
  real(wp), parameter :: small_strain_single = 0.1_wp
  real(sp), parameter :: k0 = 0.5_sp, k1 = -0.375_sp, k2 = 0.3124973582_sp, &
    & k3 = -0.273435023_sp, k4 = 0.2482048324_sp, k5 = -0.2275652827_sp

contains

  !> Bonds with |e| below this are served by the fast formulas; 0: none.
  pure real(wp) function fast_limit(model, mixed) result(limit)
    type(model_type), intent(in) :: model
    logical, intent(in) :: mixed
    ! what single precision may miss of e: some roundings of eta/|xi| and of its square, both at
    ! most 2 or so where the length hardly changes
    real(wp), parameter :: roundings = 50*epsilon(1.0_sp)

    limit = merge(small_strain_single, small_strain, mixed)
    if (model%breaking) then
      ! with the tensile limit s, |e| reaches (1 + s)^2 - 1; in compression 1 - (1 - s)^2 is less
      limit = min(limit, model%least_critical*(2 - model%least_critical)*(1 - 1.0e-9_wp))
      if (mixed) limit = max(0.0_wp, limit - roundings)
    end if
    if (model%thermal .or. (model%dilatation .and. .not. model%projected)) limit = 0.0_wp
  end function fast_limit

  subroutine fast_dilatation_1(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, sums_kind = wp
    logical, parameter :: both = .false., mixed = .false.
    include 'fast_dilatation.inc'
  end subroutine fast_dilatation_1

  subroutine fast_dilatation_2(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, sums_kind = wp
    logical, parameter :: both = .false., mixed = .false.
    include 'fast_dilatation.inc'
  end subroutine fast_dilatation_2

  subroutine fast_dilatation_3(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, sums_kind = wp
    logical, parameter :: both = .true., mixed = .false.
    include 'fast_dilatation.inc'
  end subroutine fast_dilatation_3

  subroutine fast_force_1(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, sums_kind = wp
    logical, parameter :: both = .false., mixed = .false.
    include 'fast_force.inc'
  end subroutine fast_force_1

  subroutine fast_force_2(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, sums_kind = wp
    logical, parameter :: both = .false., mixed = .false.
    include 'fast_force.inc'
  end subroutine fast_force_2

  subroutine fast_force_3(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, sums_kind = wp
    logical, parameter :: both = .true., mixed = .false.
    include 'fast_force.inc'
  end subroutine fast_force_3

  subroutine mixed_dilatation_2(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 2, width = 2*lanes, bond = sp, sums_kind = wp
    logical, parameter :: both = .false., mixed = .true.
    include 'fast_dilatation.inc'
  end subroutine mixed_dilatation_2

  subroutine mixed_dilatation_3(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 3, width = 2*lanes, bond = sp, sums_kind = sp
    logical, parameter :: both = .true., mixed = .true.
    include 'fast_dilatation.inc'
  end subroutine mixed_dilatation_3

  subroutine mixed_force_2(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 2, width = 2*lanes, bond = sp, sums_kind = wp
    logical, parameter :: both = .false., mixed = .true.
    include 'fast_force.inc'
  end subroutine mixed_force_2

  subroutine mixed_force_3(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 3, width = 2*lanes, bond = sp, sums_kind = sp
    logical, parameter :: both = .true., mixed = .true.
    include 'fast_force.inc'
  end subroutine mixed_force_3

end module pd_force_fast
