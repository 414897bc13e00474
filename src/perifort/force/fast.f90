!> The fast loops over the bonds of one block of a lattice, for small strain: one text for all
!> dimensions and both precisions, and code of its own for each, because what is chosen must be
!> constants where the loops are compiled. The polynomials are those of `pd_force_polynomial`.
!>
!> In single precision eta is the difference of the displacements' leading digits, which is exact or
!> rounded relative to itself, plus that of the digits that follow: what is lost is 1e-7 of eta, not
!> of u.
module pd_force_fast
  use pd_base_kinds, only: wp, sp, i8
  use pd_family_lattice, only: lanes
  use pd_force_polynomial, only: h0, h1, h2, h3, h4, h5, h6, h7, k0, k1, k2, k3, k4, k5
  implicit none (type, external)
  private
  public :: fast_dilatation_1, fast_dilatation_2, fast_dilatation_3
  public :: fast_force_1, fast_force_2, fast_force_3
  public :: mixed_dilatation_2, mixed_dilatation_3, mixed_force_2, mixed_force_3

contains

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
