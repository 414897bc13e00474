!> The fast loops over the packs of one cluster of a list, for small strain (`pd_force_polynomial`),
!> and that for energies: one text, and code of its own for each choice, because what is chosen must
!> be constants where the loops are compiled. In 1D they work with a second component that is zero.
module pd_force_list_fast
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
  public :: pass_loop, task_type, choose_loop, for_theta, for_force, for_energy
  public :: no_correction, one_spacing, own_spacing, stored_fraction, least
  public :: no_tables, weights_alone, all_tables

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
    subroutine pass_loop(n, member, first, intact, at, given, fraction, geometry, weight_D, &
      & weight_S, own, task, sums, missed)
      import :: wp, i1, i4, lanes, task_type
      implicit none (type, external)
      integer, intent(in) :: n                    !! packs
      integer(i4), intent(in) :: member(2, n)     !! slots of their members
      integer(i1), intent(in) :: first(n)         !! the lanes that have the first
      integer(i1), intent(in) :: intact(n)        !! the lanes with an intact bond
      ! allow(C071): the loops know the members, not how many slots there are.
      real(wp), intent(in) :: at(8, *)            !! what slots have: position, volume,
                                                  !! displacement, p
      ! allow(C071): as above.
      real(wp), intent(in) :: given(8, *)         !! and q, half the spacing, factors D and S
      ! allow(C071): as above.
      real(wp), intent(in) :: fraction(lanes, *)  !! vc, if stored
      ! allow(C071): as above.
      real(wp), intent(in) :: geometry(lanes, *)  !! xi and 2/|xi|^2, if stored
      ! allow(C071): as above.
      real(wp), intent(in) :: weight_D(lanes, *)  !! Gd vc V of each lane, if stored
      ! allow(C071): as above.
      real(wp), intent(in) :: weight_S(lanes, *)  !! (q_k + q_j) Gb vc V |xi|, if stored
      real(wp), intent(in) :: own(lanes, 16)      !! `at` and `given` of the lanes
      type(task_type), intent(in) :: task         !! what all bonds of the cluster have in common
      real(wp), intent(inout) :: sums(lanes, 3)
        !! of each lane: theta [m3]; components of the force density [N/m3]; or energy [J/m3] and
        !! theta
      logical, intent(out) :: missed              !! some bond is strained beyond the limit
    end subroutine pass_loop
  end interface

contains

  !> The loop of a `pass` in `dim` dimensions for clusters with `tables`. `state`: there is a
  !> dilatation, `projected` or not. Energies have one for all clusters.
  subroutine choose_loop(dim, pass, tables, state, projected, loop)
    integer, intent(in) :: dim     !! number of dimensions; 1 takes the loops of 2
    integer, intent(in) :: pass    !! `for_theta`, `for_force` or `for_energy`
    integer, intent(in) :: tables  !! `no_tables`, `weights_alone` or `all_tables`
    logical, intent(in) :: state   !! the force has a dilatation; counts for forces only
    logical, intent(in) :: projected  !! with Lambda as printed, else Lambda = 1
    procedure(pass_loop), pointer, intent(out) :: loop  !! the loop

    select case (pass)
    case (for_theta)
      if (projected) then
        call choose_one(dim, tables, plain_projected_theta_2, plain_projected_theta_3, &
          & stored_projected_theta_2, stored_projected_theta_3, shaped_projected_theta_2, &
          & shaped_projected_theta_3, loop)
      else
        call choose_one(dim, tables, plain_theta_2, plain_theta_3, stored_theta_2, &
          & stored_theta_3, shaped_theta_2, shaped_theta_3, loop)
      end if
    case (for_force)
      if (.not. state) then
        call choose_one(dim, tables, plain_bond_force_2, plain_bond_force_3, &
          & stored_bond_force_2, stored_bond_force_3, shaped_bond_force_2, shaped_bond_force_3, &
          & loop)
      else if (projected) then
        call choose_one(dim, tables, plain_projected_force_2, plain_projected_force_3, &
          & stored_projected_force_2, stored_projected_force_3, shaped_projected_force_2, &
          & shaped_projected_force_3, loop)
      else
        call choose_one(dim, tables, plain_force_2, plain_force_3, stored_force_2, &
          & stored_force_3, shaped_force_2, shaped_force_3, loop)
      end if
    case default
      ! for energies
      if (projected) then
        loop => projected_energy_2
        if (dim == 3) loop => projected_energy_3
      else
        loop => energy_2
        if (dim == 3) loop => energy_3
      end if
    end select
  end subroutine choose_loop

  subroutine choose_one(dim, tables, plain_2, plain_3, stored_2, stored_3, shaped_2, shaped_3, loop)
    integer, intent(in) :: dim, tables
    procedure(pass_loop) :: plain_2, plain_3, stored_2, stored_3, shaped_2, shaped_3
    procedure(pass_loop), pointer, intent(out) :: loop

    select case (tables)
    case (all_tables)
      loop => shaped_2
      if (dim == 3) loop => shaped_3
    case (weights_alone)
      loop => stored_2
      if (dim == 3) loop => stored_3
    case default
      ! no_tables
      loop => plain_2
      if (dim == 3) loop => plain_3
    end select
  end subroutine choose_one

  subroutine plain_projected_theta_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_theta
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine plain_projected_theta_2

  subroutine plain_theta_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_theta
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine plain_theta_2

  subroutine plain_bond_force_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .false., shaped = .false., state = .false., projected = .true.
    include 'bond_pass.inc'
  end subroutine plain_bond_force_2

  subroutine plain_projected_force_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine plain_projected_force_2

  subroutine plain_force_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine plain_force_2

  subroutine stored_projected_theta_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_theta
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine stored_projected_theta_2

  subroutine shaped_projected_theta_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_theta
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine shaped_projected_theta_2

  subroutine stored_theta_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_theta
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine stored_theta_2

  subroutine shaped_theta_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_theta
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine shaped_theta_2

  subroutine stored_bond_force_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .true., shaped = .false., state = .false., projected = .true.
    include 'bond_pass.inc'
  end subroutine stored_bond_force_2

  subroutine shaped_bond_force_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .true., shaped = .true., state = .false., projected = .true.
    include 'bond_pass.inc'
  end subroutine shaped_bond_force_2

  subroutine stored_projected_force_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine stored_projected_force_2

  subroutine shaped_projected_force_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine shaped_projected_force_2

  subroutine stored_force_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine stored_force_2

  subroutine shaped_force_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine shaped_force_2

  subroutine projected_energy_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_energy
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine projected_energy_2

  subroutine energy_2(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_energy
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine energy_2

  subroutine plain_projected_theta_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_theta
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine plain_projected_theta_3

  subroutine plain_theta_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_theta
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine plain_theta_3

  subroutine plain_bond_force_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .false., shaped = .false., state = .false., projected = .true.
    include 'bond_pass.inc'
  end subroutine plain_bond_force_3

  subroutine plain_projected_force_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine plain_projected_force_3

  subroutine plain_force_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine plain_force_3

  subroutine stored_projected_theta_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_theta
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine stored_projected_theta_3

  subroutine shaped_projected_theta_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_theta
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine shaped_projected_theta_3

  subroutine stored_theta_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_theta
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine stored_theta_3

  subroutine shaped_theta_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_theta
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine shaped_theta_3

  subroutine stored_bond_force_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .true., shaped = .false., state = .false., projected = .true.
    include 'bond_pass.inc'
  end subroutine stored_bond_force_3

  subroutine shaped_bond_force_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .true., shaped = .true., state = .false., projected = .true.
    include 'bond_pass.inc'
  end subroutine shaped_bond_force_3

  subroutine stored_projected_force_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine stored_projected_force_3

  subroutine shaped_projected_force_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine shaped_projected_force_3

  subroutine stored_force_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine stored_force_3

  subroutine shaped_force_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine shaped_force_3

  subroutine projected_energy_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_energy
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine projected_energy_3

  subroutine energy_3(n, member, first, intact, at, given, fraction, geometry, &
    & weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_energy
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine energy_3

end module pd_force_list_fast
