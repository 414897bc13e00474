!> The fast loops over the bonds of one cluster of a list, for small strain (`pd_force_polynomial`):
!> one text, and code of its own for each choice, because what is chosen must be constants where the
!> loops are compiled. In 1D they work with a second component that is zero.
module pd_force_list_fast
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_family_offsets, only: lanes
  use pd_force_polynomial, only: h0, h1, h2, h3, h4, h5, h6, h7
  implicit none (type, external)
  private
  public :: theta_loop, force_loop, choose_theta, choose_force

  !> The bits of the lanes; the last is the sign, which all bits of a wider kind repeat.
  integer(i8), parameter :: bit(lanes) = [1_i8, 2_i8, 4_i8, 8_i8, 16_i8, 32_i8, 64_i8, 128_i8]

  abstract interface
    !> theta of the lanes of one cluster, see bond_dilatation.inc.
    subroutine theta_loop(n, member, intact, at, own, weight, geometry, edge, per_spacing, limit, &
      & theta, missed)
      import :: wp, i1, i4, lanes
      implicit none (type, external)
      integer, intent(in) :: n                    !! members
      integer(i4), intent(in) :: member(n)        !! their slots
      integer(i1), intent(in) :: intact(n)        !! bits of the lanes with an intact bond
      ! allow(C071): the loops know the members, not how many slots there are.
      real(wp), intent(in) :: at(8, *)            !! what slots have, member by member
      real(wp), intent(in) :: own(lanes, 8)       !! the same of the lanes
      real(wp), intent(in) :: weight(lanes, n)    !! Gd vc V_j, if tabled
      real(wp), intent(in) :: geometry(lanes, n)  !! 1/|xi|^2, if tabled
      real(wp), intent(in) :: edge, per_spacing   !! where vc vanishes [m], its slope [1/m]
      real(wp), intent(in) :: limit               !! of |e|
      real(wp), intent(inout) :: theta(lanes)
      logical, intent(out) :: missed              !! some bond is strained beyond the limit
    end subroutine theta_loop

    !> Force density of the lanes of one cluster [N/m3], see bond_force.inc.
    subroutine force_loop(n, member, intact, at, own, stretch, weight, geometry, edge, &
      & per_spacing, q, limit, force, missed)
      import :: wp, i1, i4, lanes
      implicit none (type, external)
      integer, intent(in) :: n
      integer(i4), intent(in) :: member(n)
      integer(i1), intent(in) :: intact(n)
      ! allow(C071): as above.
      real(wp), intent(in) :: at(8, *), own(lanes, 8)
      real(wp), intent(in) :: stretch(lanes, n)   !! (q_k + q_j) Gb vc V_j/|xi|, if tabled
      real(wp), intent(in) :: weight(lanes, n), geometry(lanes, n)
      real(wp), intent(in) :: edge, per_spacing, q, limit
      real(wp), intent(inout) :: force(lanes, 3)
      logical, intent(out) :: missed
    end subroutine force_loop
  end interface

contains

  !> The loop for theta in `dim` dimensions, with or without tables.
  subroutine choose_theta(dim, tabled, loop)
    integer, intent(in) :: dim
    logical, intent(in) :: tabled
    procedure(theta_loop), pointer, intent(out) :: loop

    if (dim == 3) then
      loop => list_dilatation_3
      if (tabled) loop => tabled_dilatation_3
    else
      loop => list_dilatation_2
      if (tabled) loop => tabled_dilatation_2
    end if
  end subroutine choose_theta

  !> The loop for forces; `state`: there is a dilatation.
  subroutine choose_force(dim, tabled, state, loop)
    integer, intent(in) :: dim
    logical, intent(in) :: tabled, state
    procedure(force_loop), pointer, intent(out) :: loop

    if (dim == 3 .and. state) then
      loop => list_state_3
      if (tabled) loop => tabled_state_3
    else if (dim == 3) then
      loop => list_bond_3
      if (tabled) loop => tabled_bond_3
    else if (state) then
      loop => list_state_2
      if (tabled) loop => tabled_state_2
    else
      loop => list_bond_2
      if (tabled) loop => tabled_bond_2
    end if
  end subroutine choose_force

  subroutine list_dilatation_2(n, member, intact, at, own, weight, geometry, edge, per_spacing, &
    & limit, theta, missed)
    integer, parameter :: dim = 2
    logical, parameter :: tabled = .false.
    include 'bond_dilatation.inc'
  end subroutine list_dilatation_2

  subroutine list_dilatation_3(n, member, intact, at, own, weight, geometry, edge, per_spacing, &
    & limit, theta, missed)
    integer, parameter :: dim = 3
    logical, parameter :: tabled = .false.
    include 'bond_dilatation.inc'
  end subroutine list_dilatation_3

  subroutine tabled_dilatation_2(n, member, intact, at, own, weight, geometry, edge, per_spacing, &
    & limit, theta, missed)
    integer, parameter :: dim = 2
    logical, parameter :: tabled = .true.
    include 'bond_dilatation.inc'
  end subroutine tabled_dilatation_2

  subroutine tabled_dilatation_3(n, member, intact, at, own, weight, geometry, edge, per_spacing, &
    & limit, theta, missed)
    integer, parameter :: dim = 3
    logical, parameter :: tabled = .true.
    include 'bond_dilatation.inc'
  end subroutine tabled_dilatation_3

  subroutine list_state_2(n, member, intact, at, own, stretch, weight, geometry, edge, &
    & per_spacing, q, limit, force, missed)
    integer, parameter :: dim = 2
    logical, parameter :: tabled = .false., dilatation = .true.
    include 'bond_force.inc'
  end subroutine list_state_2

  subroutine list_state_3(n, member, intact, at, own, stretch, weight, geometry, edge, &
    & per_spacing, q, limit, force, missed)
    integer, parameter :: dim = 3
    logical, parameter :: tabled = .false., dilatation = .true.
    include 'bond_force.inc'
  end subroutine list_state_3

  subroutine list_bond_2(n, member, intact, at, own, stretch, weight, geometry, edge, &
    & per_spacing, q, limit, force, missed)
    integer, parameter :: dim = 2
    logical, parameter :: tabled = .false., dilatation = .false.
    include 'bond_force.inc'
  end subroutine list_bond_2

  subroutine list_bond_3(n, member, intact, at, own, stretch, weight, geometry, edge, &
    & per_spacing, q, limit, force, missed)
    integer, parameter :: dim = 3
    logical, parameter :: tabled = .false., dilatation = .false.
    include 'bond_force.inc'
  end subroutine list_bond_3

  subroutine tabled_state_2(n, member, intact, at, own, stretch, weight, geometry, edge, &
    & per_spacing, q, limit, force, missed)
    integer, parameter :: dim = 2
    logical, parameter :: tabled = .true., dilatation = .true.
    include 'bond_force.inc'
  end subroutine tabled_state_2

  subroutine tabled_state_3(n, member, intact, at, own, stretch, weight, geometry, edge, &
    & per_spacing, q, limit, force, missed)
    integer, parameter :: dim = 3
    logical, parameter :: tabled = .true., dilatation = .true.
    include 'bond_force.inc'
  end subroutine tabled_state_3

  subroutine tabled_bond_2(n, member, intact, at, own, stretch, weight, geometry, edge, &
    & per_spacing, q, limit, force, missed)
    integer, parameter :: dim = 2
    logical, parameter :: tabled = .true., dilatation = .false.
    include 'bond_force.inc'
  end subroutine tabled_bond_2

  subroutine tabled_bond_3(n, member, intact, at, own, stretch, weight, geometry, edge, &
    & per_spacing, q, limit, force, missed)
    integer, parameter :: dim = 3
    logical, parameter :: tabled = .true., dilatation = .false.
    include 'bond_force.inc'
  end subroutine tabled_bond_3

end module pd_force_list_fast
