!> The fast loops over the bonds of one block of a lattice in single precision, from the same text
!> as those in double (`pd_force_fast`), for planes and space.
!>
!> eta is the difference of the displacements' leading digits, which is exact or rounded relative to
!> itself, plus that of the digits that follow: what is lost is 1e-7 of eta, not of u. A compiler
!> that may add in any order would spoil that, but it does not multiply a difference out: leading
!> digits are kept over `unit`, a power of 2, and their difference is multiplied by it.
module pd_force_mixed
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, sp, i8
  use pd_base_lanes, only: lanes
  use pd_family_lattice, only: lattice_family_type
  use pd_force_model, only: no_dilatation, projected, unprojected
  use pd_force_polynomial, only: narrow, wide, single, h0, h1, h2, h3, h4, h5, h6, h7, &
    & w0, w1, w2, w3, w4, w5, w6, w7, w8, w9, w10, w11, k0, k1, k2, k3, k4, k5, &
    & g0, g1, g2, g3, g4, g5, g6, g7, v0, v1, v2, v3, v4, v5, v6, v7, v8, v9, v10, v11, &
    & s0, s1, s2, s3, s4, s5
  use pd_force_singles, only: unit
  use pd_force_workspace, only: singles_type, weights_type
  implicit none (type, external)
  private
  public :: mixed_dilatation, mixed_force

contains

  !> theta of the `n` first offsets' bonds of the block at slot `first`: in 3D added to the sums in
  !> single precision, in 2D into `theta` (n_slots). `limit`, `left` and `missed` as in
  !> `fast_dilatation`; in 2D, what was set is wrong if some bonds were `missed`.
  subroutine mixed_dilatation(family, singles, kind, n, limit, weights, first, theta, left, missed)
    type(lattice_family_type), intent(in) :: family  !! in mixed precision
    type(singles_type), intent(inout) :: singles
      !! displacements split; the sums are added to in 3D
    integer, intent(in) :: kind  !! of the dilatation: `projected` or `unprojected`
    integer, intent(in) :: n                   !! offsets whose bonds are taken
    real(wp), intent(in) :: limit              !! of |e|, beyond which bonds are left out [-]
    type(weights_type), intent(in) :: weights  !! of the block
    integer(i8), intent(in) :: first           !! slot of the block's first lane
    real(wp), intent(inout), contiguous :: theta(:)
      !! (n_slots) in 2D set for the block, in 3D not used [m3]
    real(sp), intent(inout), contiguous :: left(:, :)
      !! (block_length, most bonds) in 3D weights of bonds that were left out, in 2D not used
    logical, intent(out) :: missed             !! some bonds are strained beyond `limit`
    integer(i8) :: last

    missed = .true.
    associate (w => weights, s => singles, slots => family%n_slots)
      select case (family%dim + 10*kind)
      case (3 + 10*projected)
        call single_theta_projected_3(n, w%single_dilatation, w%shift, w%single_geometry, first, &
          & slots, s%high, s%low, real(limit, sp), s%sums(:, 1), left, missed)
      case (2 + 10*projected)
        call single_theta_projected_2(n, w%single_dilatation, w%shift, w%single_geometry, first, &
          & slots, s%high, s%low, real(limit, sp), theta, left, missed)
      case (3 + 10*unprojected)
        call single_theta_plain_3(n, w%single_dilatation, w%shift, w%single_geometry, first, &
          & slots, s%high, s%low, real(limit, sp), s%sums(:, 1), left, missed)
      case (2 + 10*unprojected)
        call single_theta_plain_2(n, w%single_dilatation, w%shift, w%single_geometry, first, &
          & slots, s%high, s%low, real(limit, sp), theta, left, missed)
      case default
        call internal_fault('a dilatation that no loop in mixed precision is there for')
      end select
      if (family%dim == 3) return
      last = first + family%block_length - 1
      theta(first:last) = s%volume*theta(first:last)
    end associate
  end subroutine mixed_dilatation

  !> The same for forces: in 3D added to the sums, in 2D into `force` (n_slots, dim).
  subroutine mixed_force(family, singles, kind, n, limit, weights, first, force, left, missed)
    type(lattice_family_type), intent(in) :: family  !! in mixed precision
    type(singles_type), intent(inout) :: singles
      !! displacements split, p rounded; the sums are added to in 3D
    integer, intent(in) :: kind  !! of the dilatation, `no_dilatation` included
    integer, intent(in) :: n                   !! offsets whose bonds are taken
    real(wp), intent(in) :: limit
      !! of |e|, beyond which bonds are left out without a dilatation [-]
    type(weights_type), intent(in) :: weights  !! of the block
    integer(i8), intent(in) :: first           !! slot of the block's first lane
    real(wp), intent(inout), contiguous :: force(:, :)
      !! (n_slots, dim) in 2D set for the block, in 3D not used [N/m3]
    real(sp), intent(inout), contiguous :: left(:, :)
      !! (block_length, most bonds) in 3D weights of bonds that were left out, in 2D not used
    logical, intent(out) :: missed             !! some bonds are strained beyond `limit`

    missed = .true.
    associate (w => weights, s => singles, slots => family%n_slots)
      select case (family%dim + 10*kind)
      case (3 + 10*no_dilatation)
        call single_force_bonds_3(n, w%single_dilatation, w%single_stretch, w%shift, &
          & w%single_geometry, first, slots, s%high, s%low, s%p, real(limit, sp), s%sums, left, &
          & missed)
      case (2 + 10*no_dilatation)
        call single_force_bonds_2(n, w%single_dilatation, w%single_stretch, w%shift, &
          & w%single_geometry, first, slots, s%high, s%low, s%p, real(limit, sp), force, left, &
          & missed)
      case (3 + 10*projected)
        call single_force_projected_3(n, w%single_dilatation, w%single_stretch, w%shift, &
          & w%single_geometry, first, slots, s%high, s%low, s%p, real(limit, sp), s%sums, left, &
          & missed)
      case (2 + 10*projected)
        call single_force_projected_2(n, w%single_dilatation, w%single_stretch, w%shift, &
          & w%single_geometry, first, slots, s%high, s%low, s%p, real(limit, sp), force, left, &
          & missed)
      case (3 + 10*unprojected)
        call single_force_plain_3(n, w%single_dilatation, w%single_stretch, w%shift, &
          & w%single_geometry, first, slots, s%high, s%low, s%p, real(limit, sp), s%sums, left, &
          & missed)
      case (2 + 10*unprojected)
        call single_force_plain_2(n, w%single_dilatation, w%single_stretch, w%shift, &
          & w%single_geometry, first, slots, s%high, s%low, s%p, real(limit, sp), force, left, &
          & missed)
      case default
        call internal_fault('a force that no loop in mixed precision is there for')
      end select
    end associate
  end subroutine mixed_force

  subroutine single_theta_projected_2(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 2, width = 2*lanes, bond = sp, range = single, sums_kind = wp, &
      & kind = projected
    logical, parameter :: both = .false.
    include 'fast_dilatation.inc'
  end subroutine single_theta_projected_2

  subroutine single_theta_projected_3(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 3, width = 2*lanes, bond = sp, range = single, sums_kind = sp, &
      & kind = projected
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine single_theta_projected_3

  subroutine single_theta_plain_2(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 2, width = 2*lanes, bond = sp, range = single, sums_kind = wp, &
      & kind = unprojected
    logical, parameter :: both = .false.
    include 'fast_dilatation.inc'
  end subroutine single_theta_plain_2

  subroutine single_theta_plain_3(n, weight, shift, geometry, first, n_slots, u, low, limit, &
    & theta, left, missed)
    integer, parameter :: dim = 3, width = 2*lanes, bond = sp, range = single, sums_kind = sp, &
      & kind = unprojected
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine single_theta_plain_3

  subroutine single_force_bonds_2(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 2, width = 2*lanes, bond = sp, range = single, sums_kind = wp, &
      & kind = no_dilatation
    logical, parameter :: both = .false.
    include 'fast_force.inc'
  end subroutine single_force_bonds_2

  subroutine single_force_bonds_3(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 3, width = 2*lanes, bond = sp, range = single, sums_kind = sp, &
      & kind = no_dilatation
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine single_force_bonds_3

  subroutine single_force_projected_2(n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 2, width = 2*lanes, bond = sp, range = single, sums_kind = wp, &
      & kind = projected
    logical, parameter :: both = .false.
    include 'fast_force.inc'
  end subroutine single_force_projected_2

  subroutine single_force_projected_3(n, weight, stretch, shift, geometry, first, n_slots, u, &
    & low, p, limit, force, left, missed)
    integer, parameter :: dim = 3, width = 2*lanes, bond = sp, range = single, sums_kind = sp, &
      & kind = projected
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine single_force_projected_3

  subroutine single_force_plain_2(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 2, width = 2*lanes, bond = sp, range = single, sums_kind = wp, &
      & kind = unprojected
    logical, parameter :: both = .false.
    include 'fast_force.inc'
  end subroutine single_force_plain_2

  subroutine single_force_plain_3(n, weight, stretch, shift, geometry, first, n_slots, u, low, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 3, width = 2*lanes, bond = sp, range = single, sums_kind = sp, &
      & kind = unprojected
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine single_force_plain_3

end module pd_force_mixed
