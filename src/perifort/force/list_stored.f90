!> The fast loops of `pd_force_list_fast` that read a weight of its own for every bond, once in a
!> pass. They wait for memory more than they compute, so that they are compiled with flags of their
!> own (`stream_flags_of` of pf), which ask for weights far ahead; other loops lose by these.
module pd_force_list_stored
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_lanes, only: lanes
  use pd_force_list_loop, only: bit, for_energy, for_force, for_theta, least, no_correction, &
    & one_spacing, own_spacing, pass_loop, stored_fraction, task_type, g0, g1, g2, g3, g4, g5, &
    & g6, g7, h0_narrow, h1_narrow, h2_narrow, h3_narrow, h4_narrow, h5_narrow, h6_narrow, &
    & h7_narrow, h0_wide, h1_wide, h2_wide, h3_wide, h4_wide, h5_wide, h6_wide, h7_wide, h8_wide, &
    & h9_wide, h10_wide, h11_wide, v0_wide, v1_wide, v2_wide, v3_wide, v4_wide, v5_wide, v6_wide, &
    & v7_wide, v8_wide, v9_wide, v10_wide, v11_wide
  implicit none (type, external)
  private
  public :: choose_stored

contains

  !> The loop of a `pass` in `dim` dimensions. `state`: there is a dilatation, `projected` or not.
  subroutine choose_stored(dim, pass, state, projected, loop)
    integer, intent(in) :: dim        !! number of dimensions; 1 takes the loops of 2
    integer, intent(in) :: pass       !! `for_theta`, else the forces
    logical, intent(in) :: state      !! the force has a dilatation; counts for forces only
    logical, intent(in) :: projected  !! with Lambda as printed, else Lambda = 1
    procedure(pass_loop), pointer, intent(out) :: loop  !! the loop

    if (pass == for_theta .and. projected) then
      loop => stored_projected_theta_2
      if (dim == 3) loop => stored_projected_theta_3
    else if (pass == for_theta) then
      loop => stored_theta_2
      if (dim == 3) loop => stored_theta_3
    else if (.not. state) then
      loop => stored_bond_force_2
      if (dim == 3) loop => stored_bond_force_3
    else if (projected) then
      loop => stored_projected_force_2
      if (dim == 3) loop => stored_projected_force_3
    else
      loop => stored_force_2
      if (dim == 3) loop => stored_force_3
    end if
  end subroutine choose_stored

  subroutine stored_projected_theta_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_theta
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine stored_projected_theta_2

  subroutine stored_theta_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_theta
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine stored_theta_2

  subroutine stored_bond_force_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .true., shaped = .false., state = .false., projected = .true.
    include 'bond_pass.inc'
  end subroutine stored_bond_force_2

  subroutine stored_projected_force_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine stored_projected_force_2

  subroutine stored_force_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine stored_force_2

  subroutine stored_projected_theta_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_theta
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine stored_projected_theta_3

  subroutine stored_theta_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_theta
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine stored_theta_3

  subroutine stored_bond_force_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .true., shaped = .false., state = .false., projected = .true.
    include 'bond_pass.inc'
  end subroutine stored_bond_force_3

  subroutine stored_projected_force_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine stored_projected_force_3

  subroutine stored_force_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .true., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine stored_force_3

end module pd_force_list_stored
