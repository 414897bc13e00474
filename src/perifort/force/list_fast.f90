!> The fast loops over the bonds of one cluster of a list, for small strain (`pd_force_polynomial`):
!> one text, and code of its own for each choice, because what is chosen must be constants where the
!> loops are compiled. In 1D they work with a second component that is zero.
module pd_force_list_fast
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_family_offsets, only: lanes
  use pd_force_polynomial, only: h0, h1, h2, h3, h4, h5, h6, h7
  implicit none (type, external)
  private
  public :: list_dilatation_2, list_dilatation_3, tabled_dilatation_2, tabled_dilatation_3
  public :: list_state_2, list_state_3, tabled_state_2, tabled_state_3
  public :: list_bond_2, list_bond_3, tabled_bond_2, tabled_bond_3

  !> The bits of the lanes; the last is the sign, which all bits of a wider kind repeat.
  integer(i8), parameter :: bit(lanes) = [1_i8, 2_i8, 4_i8, 8_i8, 16_i8, 32_i8, 64_i8, 128_i8]

contains

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
