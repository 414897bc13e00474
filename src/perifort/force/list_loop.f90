!> What the fast loops over the packs of one cluster of a list have in common (bond_pass.inc): their
!> interface, what is chosen, and the names under which they know the polynomials for small strain
!> (`pd_force_polynomial`).
module pd_force_list_loop
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_lanes, only: lanes
  use pd_force_general, only: crushed
  use pd_force_polynomial, only: g0, g1, g2, g3, g4, g5, g6, g7, &
    & h0_narrow => h0, h1_narrow => h1, h2_narrow => h2, h3_narrow => h3, h4_narrow => h4, &
    & h5_narrow => h5, h6_narrow => h6, h7_narrow => h7, &
    & h0_wide => w0, h1_wide => w1, h2_wide => w2, h3_wide => w3, h4_wide => w4, h5_wide => w5, &
    & h6_wide => w6, h7_wide => w7, h8_wide => w8, h9_wide => w9, h10_wide => w10, &
    & h11_wide => w11, &
    & v0_wide => v0, v1_wide => v1, v2_wide => v2, v3_wide => v3, v4_wide => v4, v5_wide => v5, &
    & v6_wide => v6, v7_wide => v7, v8_wide => v8, v9_wide => v9, v10_wide => v10, &
    & v11_wide => v11
  implicit none (type, external)
  private
  public :: pass_loop, task_type, for_theta, for_force, for_energy, bit
  public :: no_correction, one_spacing, own_spacing, stored_fraction, least
  public :: no_tables, weights_alone, all_tables

  ! for bond_pass.inc
  public :: g0, g1, g2, g3, g4, g5, g6, g7
  public :: h0_narrow, h1_narrow, h2_narrow, h3_narrow, h4_narrow, h5_narrow, h6_narrow, &
    & h7_narrow, h0_wide, h1_wide, h2_wide, h3_wide, h4_wide, h5_wide, h6_wide, h7_wide, h8_wide, &
    & h9_wide, h10_wide, h11_wide, v0_wide, v1_wide, v2_wide, v3_wide, v4_wide, v5_wide, v6_wide, &
    & v7_wide, v8_wide, v9_wide, v10_wide, v11_wide

  !> What a pass sums up.
  integer, parameter :: for_theta = 1, for_force = 2, for_energy = 3

  !> What is stored for the bonds of a cluster: nothing, weights, or weights, xi and 2/|xi|^2.
  integer, parameter :: no_tables = 0, weights_alone = 1, all_tables = 2

  !> Where a loop has the volume correction from: nowhere, the spacing of all points, those of both
  !> ends, a table.
  integer, parameter :: no_correction = 0, one_spacing = 1, own_spacing = 2, stored_fraction = 3

  !> Deformed length over the undeformed one below which a bond has no direction: it pulls nowhere.
  real(wp), parameter :: least = sqrt(crushed)

  !> The bits of the lanes; the last is the sign, which all bits of a wider kind repeat.
  integer(i8), parameter :: bit(lanes) = [1_i8, 2_i8, 4_i8, 8_i8, 16_i8, 32_i8, 64_i8, 128_i8]

  !> What the loops must know beside the points.
  type :: task_type
    integer :: volume = no_correction
    logical :: surface = .false.      !! points have surface factors
    logical :: wide = .false.         !! the polynomial of the wide range
    real(wp) :: edge = 0.0_wp         !! where vc vanishes; with `own_spacing` the horizon [m]
    real(wp) :: slope = 0.0_wp        !! of vc [1/m]
    real(wp) :: q = 0.0_wp            !! of plain clusters: (q_k + q_j) Gb/Gd,
    real(wp) :: factor = 1.0_wp       !! Gd, or (q_k + q_j) Gb without a dilatation
    real(wp) :: limit = 0.0_wp        !! of |e|
  end type task_type

  abstract interface
    !> Sums of one cluster's bonds, see bond_pass.inc.
    subroutine pass_loop(n, member, first, intact, place, moved, given, fraction, geometry, &
      & weight_D, weight_S, own, task, sums, missed)
      import :: wp, i1, i4, lanes, task_type
      implicit none (type, external)
      integer, intent(in) :: n                    !! packs
      integer(i4), intent(in) :: member(2, n)     !! slots of their members
      integer(i1), intent(in) :: first(n)         !! the lanes that have the first
      integer(i1), intent(in) :: intact(n)        !! the lanes with an intact bond: all that
                                                  !! have one, if xi is stored
      ! allow(C071): the loops know the members, not how many slots there are.
      real(wp), intent(in) :: place(4, *)         !! what slots have: position, volume,
      ! allow(C071): as above.
      real(wp), intent(in) :: moved(4, *)         !! displacement, p
      ! allow(C071): as above.
      real(wp), intent(in) :: given(8, *)         !! and q, half the spacing, factors D and S
      ! allow(C071): as above.
      real(wp), intent(in) :: fraction(lanes, *)  !! vc, if stored
      ! allow(C071): as above.
      real(wp), intent(in) :: geometry(lanes, *)  !! xi and 2/|xi|^2, if stored: below 0 in
                                                  !! lanes with the pack's second member, 0 in
                                                  !! empty ones
      ! allow(C071): as above.
      real(wp), intent(in) :: weight_D(lanes, *)  !! Gd vc V of each lane, if stored
      ! allow(C071): as above.
      real(wp), intent(in) :: weight_S(lanes, *)  !! (q_k + q_j) Gb vc V |xi|, if stored
      real(wp), intent(in) :: own(lanes, 16)      !! `place`, `moved` and `given` of the lanes
      type(task_type), intent(in) :: task         !! what all bonds of the cluster have in common
      real(wp), intent(inout) :: sums(lanes, 3)
        !! of each lane: theta [m3]; components of the force density [N/m3]; or energy [J/m3] and
        !! theta
      logical, intent(out) :: missed              !! some bond is strained beyond the limit
    end subroutine pass_loop
  end interface

end module pd_force_list_loop
