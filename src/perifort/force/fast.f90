!> The fast loops over the bonds of one block of a lattice, for small strain, in double precision:
!> one text for all dimensions, ranges of strain and kinds of dilatation, and code of its own for
!> each, because what is chosen must be constants where the loops are compiled. The polynomials are
!> those of `pd_force_polynomial`; `pd_force_mixed` has the loops in single precision.
module pd_force_fast
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i8
  use pd_base_lanes, only: lanes
  use pd_force_general, only: crushed
  use pd_force_model, only: no_dilatation, projected, unprojected
  use pd_force_polynomial, only: narrow, wide, single, h0, h1, h2, h3, h4, h5, h6, h7, &
    & w0, w1, w2, w3, w4, w5, w6, w7, w8, w9, w10, w11, k0, k1, k2, k3, k4, k5, &
    & g0, g1, g2, g3, g4, g5, g6, g7, v0, v1, v2, v3, v4, v5, v6, v7, v8, v9, v10, v11, &
    & s0, s1, s2, s3, s4, s5
  use pd_force_singles, only: unit
  implicit none (type, external)
  private
  public :: fast_dilatation, fast_force, fast_energy

  !> Deformed length over the undeformed one below which a bond has no direction.
  real(wp), parameter :: least = sqrt(crushed)

contains

  !> Add theta, the sums of Gd s Lambda vc V, of the `n` first offsets' bonds of the block at slot
  !> `first` (1D: set it). `missed`: some bonds are strained beyond `limit`; in 3D and 2D those were
  !> left out, and `left` has their weights, in 1D what was set is wrong. Extents are explicit, here
  !> and below, since a call for few bonds would spend its time on describing arrays.
  subroutine fast_dilatation(dim, range, kind, n, m, weight, shift, geometry, first, u, limit, &
    & theta, left, missed)
    integer, intent(in) :: dim                !! number of dimensions
    integer, intent(in) :: range  !! `narrow` or `wide`
    integer, intent(in) :: kind   !! of the dilatation: `projected` or `unprojected`
    integer, intent(in) :: n                  !! offsets whose bonds are taken
    integer, intent(in) :: m      !! number of slots
    real(wp), intent(in) :: weight(lanes, n)  !! Gd vc V, 0 for bonds to be left out [m3]
    real(wp), intent(in) :: geometry(4, n)
      !! xi/|xi|^2 in rows 1 to 3 [1/m], 1/|xi|^2 in row 4 [1/m2]
    real(wp), intent(in) :: u(m, dim)         !! displacements [m]
    integer(i8), intent(in) :: shift(n)       !! from a slot to its member [slots]
    integer(i8), intent(in) :: first          !! slot of the block's first lane
    real(wp), intent(in) :: limit             !! of |e|, beyond which bonds are left out [-]
    real(wp), intent(inout) :: theta(m)       !! sums of each slot, of both ends in 3D and 2D [m3]
    real(wp), intent(inout) :: left(lanes, n)
      !! gets the weights of bonds that were left out, 0 for the others; not used in 1D [m3]
    logical, intent(out) :: missed            !! some bonds are strained beyond `limit`

    missed = .true.
    select case (choice(dim, range, kind))
    case (3 + 10*narrow + 100*projected)
      call narrow_theta_projected_3(n, weight, shift, geometry, first, m, u, u, limit, theta, &
        & left, missed)
    case (2 + 10*narrow + 100*projected)
      call narrow_theta_projected_2(n, weight, shift, geometry, first, m, u, u, limit, theta, &
        & left, missed)
    case (1 + 10*narrow + 100*projected)
      call narrow_theta_projected_1(n, weight, shift, geometry, first, m, u, u, limit, theta, &
        & left, missed)
    case (3 + 10*wide + 100*projected)
      call wide_theta_projected_3(n, weight, shift, geometry, first, m, u, u, limit, theta, left, &
        & missed)
    case (2 + 10*wide + 100*projected)
      call wide_theta_projected_2(n, weight, shift, geometry, first, m, u, u, limit, theta, left, &
        & missed)
    case (1 + 10*wide + 100*projected)
      call wide_theta_projected_1(n, weight, shift, geometry, first, m, u, u, limit, theta, left, &
        & missed)
    case (3 + 10*narrow + 100*unprojected)
      call narrow_theta_plain_3(n, weight, shift, geometry, first, m, u, u, limit, theta, left, &
        & missed)
    case (2 + 10*narrow + 100*unprojected)
      call narrow_theta_plain_2(n, weight, shift, geometry, first, m, u, u, limit, theta, left, &
        & missed)
    case (1 + 10*narrow + 100*unprojected)
      call narrow_theta_plain_1(n, weight, shift, geometry, first, m, u, u, limit, theta, left, &
        & missed)
    case (3 + 10*wide + 100*unprojected)
      call wide_theta_plain_3(n, weight, shift, geometry, first, m, u, u, limit, theta, left, &
        & missed)
    case (2 + 10*wide + 100*unprojected)
      call wide_theta_plain_2(n, weight, shift, geometry, first, m, u, u, limit, theta, left, &
        & missed)
    case (1 + 10*wide + 100*unprojected)
      call wide_theta_plain_1(n, weight, shift, geometry, first, m, u, u, limit, theta, left, &
        & missed)
    case default
      call internal_fault('a dilatation that no fast loop is there for')
    end select
  end subroutine fast_dilatation

  !> The same for forces. With a dilatation its pass has checked the strain, `missed` is false and
  !> `left` untouched.
  subroutine fast_force(dim, range, kind, n, m, weight, stretch, shift, geometry, first, u, p, &
    & limit, force, left, missed)
    integer, intent(in) :: dim           !! number of dimensions
    integer, intent(in) :: range         !! `narrow` or `wide`
    integer, intent(in) :: kind  !! of the dilatation, `no_dilatation` included
    integer, intent(in) :: n             !! offsets whose bonds are taken
    integer, intent(in) :: m             !! number of slots
    real(wp), intent(in) :: weight(lanes, merge(n, 0, kind /= no_dilatation))
      !! Gd vc V, of size 0 without a dilatation [m3]
    real(wp), intent(in) :: stretch(lanes, n)
      !! (q_k + q_j) Gb vc V |xi|, 0 for bonds to be left out [N/m2]
    real(wp), intent(in) :: geometry(4, n)
      !! xi/|xi|^2 in rows 1 to 3 [1/m], 1/|xi|^2 in row 4 [1/m2]
    real(wp), intent(in) :: u(m, dim)    !! displacements [m]
    real(wp), intent(in) :: p(merge(m, 0, kind /= no_dilatation))
      !! 2 a d delta theta, of size 0 without a dilatation [N/m5]
    integer(i8), intent(in) :: shift(n)  !! from a slot to its member [slots]
    integer(i8), intent(in) :: first     !! slot of the block's first lane
    real(wp), intent(in) :: limit
      !! of |e|, beyond which bonds are left out without a dilatation [-]
    real(wp), intent(inout) :: force(m, dim)
      !! force density, of both ends in 3D and 2D, in 1D set for the block [N/m3]
    real(wp), intent(inout) :: left(lanes, n)
      !! gets the `stretch` of bonds that were left out, 0 for the others; not used in 1D [N/m2]
    logical, intent(out) :: missed       !! some bonds are strained beyond `limit`

    missed = .true.
    select case (choice(dim, range, kind))
    case (3 + 10*narrow + 100*no_dilatation)
      call narrow_force_bonds_3(n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (2 + 10*narrow + 100*no_dilatation)
      call narrow_force_bonds_2(n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (1 + 10*narrow + 100*no_dilatation)
      call narrow_force_bonds_1(n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (3 + 10*wide + 100*no_dilatation)
      call wide_force_bonds_3(n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (2 + 10*wide + 100*no_dilatation)
      call wide_force_bonds_2(n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (1 + 10*wide + 100*no_dilatation)
      call wide_force_bonds_1(n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (3 + 10*narrow + 100*projected)
      call narrow_force_projected_3(n, weight, stretch, shift, geometry, first, m, u, u, p, &
        & limit, force, left, missed)
    case (2 + 10*narrow + 100*projected)
      call narrow_force_projected_2(n, weight, stretch, shift, geometry, first, m, u, u, p, &
        & limit, force, left, missed)
    case (1 + 10*narrow + 100*projected)
      call narrow_force_projected_1(n, weight, stretch, shift, geometry, first, m, u, u, p, &
        & limit, force, left, missed)
    case (3 + 10*wide + 100*projected)
      call wide_force_projected_3(n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (2 + 10*wide + 100*projected)
      call wide_force_projected_2(n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (1 + 10*wide + 100*projected)
      call wide_force_projected_1(n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (3 + 10*narrow + 100*unprojected)
      call narrow_force_plain_3(n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (2 + 10*narrow + 100*unprojected)
      call narrow_force_plain_2(n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (1 + 10*narrow + 100*unprojected)
      call narrow_force_plain_1(n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (3 + 10*wide + 100*unprojected)
      call wide_force_plain_3(n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (2 + 10*wide + 100*unprojected)
      call wide_force_plain_2(n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case (1 + 10*wide + 100*unprojected)
      call wide_force_plain_1(n, weight, stretch, shift, geometry, first, m, u, u, p, limit, &
        & force, left, missed)
    case default
      call internal_fault('a force that no fast loop is there for')
    end select
  end subroutine fast_force

  !> One number for what loops are compiled for.
  pure integer function choice(dim, range, kind)
    integer, intent(in) :: dim, range, kind
    choice = dim + 10*range + 100*kind
  end function choice

  !> Sums of the bonds of the block at slot `first`, for its energy: (q_k + q_j) Gb s^2 |xi| vc V
  !> and, with a dilatation of some `kind`, Gd s Lambda vc V. For any strain, without temperature.
  subroutine fast_energy(dim, kind, n, m, weight, stretch, shift, geometry, first, u, &
    & stretches, theta)
    integer, intent(in) :: dim                 !! number of dimensions
    integer, intent(in) :: kind                !! of the dilatation, `no_dilatation` included
    integer, intent(in) :: n                   !! number of offsets
    integer, intent(in) :: m                   !! number of slots
    real(wp), intent(in) :: weight(lanes, merge(n, 0, kind /= no_dilatation))
      !! Gd vc V, of size 0 without a dilatation [m3]
    real(wp), intent(in) :: stretch(lanes, n)  !! (q_k + q_j) Gb vc V |xi| [N/m2]
    real(wp), intent(in) :: geometry(4, n)
      !! xi/|xi|^2 in rows 1 to 3 [1/m], 1/|xi|^2 in row 4 [1/m2]
    real(wp), intent(in) :: u(m, dim)          !! displacements [m]
    integer(i8), intent(in) :: shift(n)        !! from a slot to its member [slots]
    integer(i8), intent(in) :: first           !! slot of the block's first lane
    real(wp), intent(out) :: stretches(lanes)
      !! sum of (q_k + q_j) Gb s^2 |xi| vc V of each lane [J/m3]
    real(wp), intent(out) :: theta(lanes)
      !! sum of Gd s Lambda vc V of each lane, 0 without a dilatation [m3]

    select case (dim)
    case (3)
      call fast_energy_3(kind, n, weight, stretch, shift, geometry, first, m, u, u, stretches, &
        & theta)
    case (2)
      call fast_energy_2(kind, n, weight, stretch, shift, geometry, first, m, u, u, stretches, &
        & theta)
    case (1)
      call fast_energy_1(kind, n, weight, stretch, shift, geometry, first, m, u, u, stretches, &
        & theta)
    case default
      call internal_fault('an energy in a dimension that no fast loop is there for')
    end select
  end subroutine fast_energy

  subroutine narrow_theta_projected_1(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, range = narrow, sums_kind = wp, &
      & kind = projected
    logical, parameter :: both = .false.
    include 'fast_dilatation.inc'
  end subroutine narrow_theta_projected_1

  subroutine narrow_theta_projected_2(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, range = narrow, sums_kind = wp, &
      & kind = projected
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine narrow_theta_projected_2

  subroutine narrow_theta_projected_3(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, range = narrow, sums_kind = wp, &
      & kind = projected
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine narrow_theta_projected_3

  subroutine wide_theta_projected_1(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, range = wide, sums_kind = wp, &
      & kind = projected
    logical, parameter :: both = .false.
    include 'fast_dilatation.inc'
  end subroutine wide_theta_projected_1

  subroutine wide_theta_projected_2(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, range = wide, sums_kind = wp, &
      & kind = projected
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine wide_theta_projected_2

  subroutine wide_theta_projected_3(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, range = wide, sums_kind = wp, &
      & kind = projected
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine wide_theta_projected_3

  subroutine narrow_theta_plain_1(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, range = narrow, sums_kind = wp, &
      & kind = unprojected
    logical, parameter :: both = .false.
    include 'fast_dilatation.inc'
  end subroutine narrow_theta_plain_1

  subroutine narrow_theta_plain_2(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, range = narrow, sums_kind = wp, &
      & kind = unprojected
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine narrow_theta_plain_2

  subroutine narrow_theta_plain_3(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, range = narrow, sums_kind = wp, &
      & kind = unprojected
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine narrow_theta_plain_3

  subroutine wide_theta_plain_1(n, weight, shift, geometry, first, n_slots, u, low, limit, theta, &
    & left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, range = wide, sums_kind = wp, &
      & kind = unprojected
    logical, parameter :: both = .false.
    include 'fast_dilatation.inc'
  end subroutine wide_theta_plain_1

  subroutine wide_theta_plain_2(n, weight, shift, geometry, first, n_slots, u, low, limit, theta, &
    & left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, range = wide, sums_kind = wp, &
      & kind = unprojected
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine wide_theta_plain_2

  subroutine wide_theta_plain_3(n, weight, shift, geometry, first, n_slots, u, low, limit, theta, &
    & left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, range = wide, sums_kind = wp, &
      & kind = unprojected
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine wide_theta_plain_3

  subroutine narrow_force_bonds_1(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, range = narrow, sums_kind = wp, &
      & kind = no_dilatation
    logical, parameter :: both = .false.
    include 'fast_force.inc'
  end subroutine narrow_force_bonds_1

  subroutine narrow_force_bonds_2(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, range = narrow, sums_kind = wp, &
      & kind = no_dilatation
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine narrow_force_bonds_2

  subroutine narrow_force_bonds_3(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, range = narrow, sums_kind = wp, &
      & kind = no_dilatation
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine narrow_force_bonds_3

  subroutine wide_force_bonds_1(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, range = wide, sums_kind = wp, &
      & kind = no_dilatation
    logical, parameter :: both = .false.
    include 'fast_force.inc'
  end subroutine wide_force_bonds_1

  subroutine wide_force_bonds_2(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, range = wide, sums_kind = wp, &
      & kind = no_dilatation
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine wide_force_bonds_2

  subroutine wide_force_bonds_3(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, range = wide, sums_kind = wp, &
      & kind = no_dilatation
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine wide_force_bonds_3

  subroutine narrow_force_projected_1(n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, range = narrow, sums_kind = wp, &
      & kind = projected
    logical, parameter :: both = .false.
    include 'fast_force.inc'
  end subroutine narrow_force_projected_1

  subroutine narrow_force_projected_2(n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, range = narrow, sums_kind = wp, &
      & kind = projected
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine narrow_force_projected_2

  subroutine narrow_force_projected_3(n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, range = narrow, sums_kind = wp, &
      & kind = projected
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine narrow_force_projected_3

  subroutine wide_force_projected_1(n, weight, stretch, shift, geometry, first, n_slots, u, low, &
    & p, limit, force, left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, range = wide, sums_kind = wp, &
      & kind = projected
    logical, parameter :: both = .false.
    include 'fast_force.inc'
  end subroutine wide_force_projected_1

  subroutine wide_force_projected_2(n, weight, stretch, shift, geometry, first, n_slots, u, low, &
    & p, limit, force, left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, range = wide, sums_kind = wp, &
      & kind = projected
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine wide_force_projected_2

  subroutine wide_force_projected_3(n, weight, stretch, shift, geometry, first, n_slots, u, low, &
    & p, limit, force, left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, range = wide, sums_kind = wp, &
      & kind = projected
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine wide_force_projected_3

  subroutine narrow_force_plain_1(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, range = narrow, sums_kind = wp, &
      & kind = unprojected
    logical, parameter :: both = .false.
    include 'fast_force.inc'
  end subroutine narrow_force_plain_1

  subroutine narrow_force_plain_2(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, range = narrow, sums_kind = wp, &
      & kind = unprojected
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine narrow_force_plain_2

  subroutine narrow_force_plain_3(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, range = narrow, sums_kind = wp, &
      & kind = unprojected
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine narrow_force_plain_3

  subroutine wide_force_plain_1(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 1, width = lanes, bond = wp, range = wide, sums_kind = wp, &
      & kind = unprojected
    logical, parameter :: both = .false.
    include 'fast_force.inc'
  end subroutine wide_force_plain_1

  subroutine wide_force_plain_2(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 2, width = lanes, bond = wp, range = wide, sums_kind = wp, &
      & kind = unprojected
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine wide_force_plain_2

  subroutine wide_force_plain_3(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 3, width = lanes, bond = wp, range = wide, sums_kind = wp, &
      & kind = unprojected
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine wide_force_plain_3

  subroutine fast_energy_1(kind, n, weight, stretch, shift, geometry, first, n_slots, u, low, &
    & stretches, theta)
    integer, parameter :: dim = 1
    include 'fast_energy.inc'
  end subroutine fast_energy_1

  subroutine fast_energy_2(kind, n, weight, stretch, shift, geometry, first, n_slots, u, low, &
    & stretches, theta)
    integer, parameter :: dim = 2
    include 'fast_energy.inc'
  end subroutine fast_energy_2

  subroutine fast_energy_3(kind, n, weight, stretch, shift, geometry, first, n_slots, u, low, &
    & stretches, theta)
    integer, parameter :: dim = 3
    include 'fast_energy.inc'
  end subroutine fast_energy_3

end module pd_force_fast
