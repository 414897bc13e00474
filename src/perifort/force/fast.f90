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
  use pd_force_general, only: crushed
  use pd_force_polynomial, only: narrow, wide, single, h0, h1, h2, h3, h4, h5, h6, h7, &
    & w0, w1, w2, w3, w4, w5, w6, w7, w8, w9, w10, w11, k0, k1, k2, k3, k4, k5
  implicit none (type, external)
  private
  public :: fast_dilatation, fast_force, fast_energy
  public :: mixed_dilatation_2, mixed_dilatation_3, mixed_force_2, mixed_force_3

  !> Deformed length over the undeformed one below which a bond has no direction.
  real(wp), parameter :: least = sqrt(crushed)

contains

  !> Add theta, the sums of Gd s Lambda vc V, of the `n` first offsets' bonds of the block at slot
  !> `first` (1D: set it) in double precision. `missed`: some bonds are strained beyond `limit`; in
  !> 3D and 2D those were left out, and `left` has their weights, in 1D what was set is wrong.
  !> Extents are explicit, here and below, since a call for few bonds would spend its time on
  !> describing arrays.
  subroutine fast_dilatation(dim, range, n, m, weight, shift, geometry, first, u, limit, theta, &
    & left, missed)
    integer, intent(in) :: dim, range, n
    integer, intent(in) :: m  !! number of slots
    real(wp), intent(in) :: weight(lanes, n), geometry(4, n), u(m, dim)
    integer(i8), intent(in) :: shift(n), first
    real(wp), intent(in) :: limit
    real(wp), intent(inout) :: theta(m), left(lanes, n)
    logical, intent(out) :: missed

    select case (10*range + dim)
    case (10*narrow + 3)
      call fast_dilatation_3(n, weight, shift, geometry, first, m, u, u, limit, theta, left, missed)
    case (10*narrow + 2)
      call fast_dilatation_2(n, weight, shift, geometry, first, m, u, u, limit, theta, left, missed)
    case (10*narrow + 1)
      call fast_dilatation_1(n, weight, shift, geometry, first, m, u, u, limit, theta, left, missed)
    case (10*wide + 3)
      call wide_dilatation_3(n, weight, shift, geometry, first, m, u, u, limit, theta, left, missed)
    case (10*wide + 2)
      call wide_dilatation_2(n, weight, shift, geometry, first, m, u, u, limit, theta, left, missed)
    case default
      call wide_dilatation_1(n, weight, shift, geometry, first, m, u, u, limit, theta, left, missed)
    end select
  end subroutine fast_dilatation

  !> The same for forces. With a `dilatation` the pass before has looked at the strain, `missed` is
  !> false and `left` untouched.
  subroutine fast_force(dim, range, dilatation, n, m, weight, stretch, shift, geometry, first, u, &
    & p, limit, force, left, missed)
    integer, intent(in) :: dim, range, n, m
    logical, intent(in) :: dilatation
    real(wp), intent(in) :: weight(lanes, merge(n, 0, dilatation)), stretch(lanes, n)
    real(wp), intent(in) :: geometry(4, n), u(m, dim), p(merge(m, 0, dilatation))
    integer(i8), intent(in) :: shift(n), first
    real(wp), intent(in) :: limit
    real(wp), intent(inout) :: force(m, dim), left(lanes, n)
    logical, intent(out) :: missed

    select case (10*range + dim)
    case (10*narrow + 3)
      call fast_force_3(dilatation, n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (10*narrow + 2)
      call fast_force_2(dilatation, n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (10*narrow + 1)
      call fast_force_1(dilatation, n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (10*wide + 3)
      call wide_force_3(dilatation, n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (10*wide + 2)
      call wide_force_2(dilatation, n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case default
      call wide_force_1(dilatation, n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    end select
  end subroutine fast_force

  !> Sums of the bonds of the block at slot `first`, for its energy: (q_k + q_j) Gb s^2 |xi| vc V
  !> and, with a `dilatation`, Gd s Lambda vc V. For any strain, without temperature, projected.
  subroutine fast_energy(dim, dilatation, n, m, weight, stretch, shift, geometry, first, u, &
    & stretches, theta)
    integer, intent(in) :: dim, n, m
    logical, intent(in) :: dilatation
    real(wp), intent(in) :: weight(lanes, merge(n, 0, dilatation)), stretch(lanes, n)
    real(wp), intent(in) :: geometry(4, n), u(m, dim)
    integer(i8), intent(in) :: shift(n), first
    real(wp), intent(out) :: stretches(lanes), theta(lanes)

    select case (dim)
    case (3)
      call fast_energy_3(dilatation, n, weight, stretch, shift, geometry, first, m, u, &
        & stretches, theta)
    case (2)
      call fast_energy_2(dilatation, n, weight, stretch, shift, geometry, first, m, u, &
        & stretches, theta)
    case default
      call fast_energy_1(dilatation, n, weight, stretch, shift, geometry, first, m, u, &
        & stretches, theta)
    end select
  end subroutine fast_energy

  subroutine fast_dilatation_1(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, range = narrow, sums_kind = wp
    logical, parameter :: both = .false.
    include 'fast_dilatation.inc'
  end subroutine fast_dilatation_1

  subroutine fast_dilatation_2(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, range = narrow, sums_kind = wp
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine fast_dilatation_2

  subroutine fast_dilatation_3(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, range = narrow, sums_kind = wp
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine fast_dilatation_3

  subroutine fast_force_1(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, range = narrow, sums_kind = wp
    logical, parameter :: both = .false.
    include 'fast_force.inc'
  end subroutine fast_force_1

  subroutine fast_force_2(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, range = narrow, sums_kind = wp
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine fast_force_2

  subroutine fast_force_3(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, range = narrow, sums_kind = wp
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine fast_force_3

  subroutine wide_dilatation_1(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, range = wide, sums_kind = wp
    logical, parameter :: both = .false.
    include 'fast_dilatation.inc'
  end subroutine wide_dilatation_1

  subroutine wide_dilatation_2(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, range = wide, sums_kind = wp
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine wide_dilatation_2

  subroutine wide_dilatation_3(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, range = wide, sums_kind = wp
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine wide_dilatation_3

  subroutine wide_force_1(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, range = wide, sums_kind = wp
    logical, parameter :: both = .false.
    include 'fast_force.inc'
  end subroutine wide_force_1

  subroutine wide_force_2(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, range = wide, sums_kind = wp
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine wide_force_2

  subroutine wide_force_3(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, range = wide, sums_kind = wp
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine wide_force_3

  subroutine fast_energy_1(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & stretches, theta)
    integer, parameter :: dim = 1
    include 'fast_energy.inc'
  end subroutine fast_energy_1

  subroutine fast_energy_2(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & stretches, theta)
    integer, parameter :: dim = 2
    include 'fast_energy.inc'
  end subroutine fast_energy_2

  subroutine fast_energy_3(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & stretches, theta)
    integer, parameter :: dim = 3
    include 'fast_energy.inc'
  end subroutine fast_energy_3

  subroutine mixed_dilatation_2(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 2, width = 2*lanes, bond = sp, range = single, sums_kind = wp
    logical, parameter :: both = .false.
    include 'fast_dilatation.inc'
  end subroutine mixed_dilatation_2

  subroutine mixed_dilatation_3(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 3, width = 2*lanes, bond = sp, range = single, sums_kind = sp
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine mixed_dilatation_3

  subroutine mixed_force_2(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 2, width = 2*lanes, bond = sp, range = single, sums_kind = wp
    logical, parameter :: both = .false.
    include 'fast_force.inc'
  end subroutine mixed_force_2

  subroutine mixed_force_3(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 3, width = 2*lanes, bond = sp, range = single, sums_kind = sp
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine mixed_force_3

end module pd_force_fast
