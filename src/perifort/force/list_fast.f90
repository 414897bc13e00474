!> The fast loops over the packs of one cluster of a list, for small strain, and that for energies:
!> one text, and code of its own for each choice, because what is chosen must be constants where the
!> loops are compiled. In 1D they work with a second component that is zero. Loops that read weights
!> of their own for each bond are those of `pd_force_list_stored`.
module pd_force_list_fast
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_lanes, only: lanes
  use pd_force_list_loop, only: all_tables, bit, for_energy, for_force, for_theta, least, &
    & no_correction, one_spacing, own_spacing, pass_loop, stored_fraction, task_type, &
    & weights_alone, g0, g1, g2, g3, g4, g5, g6, g7, h0_narrow, h1_narrow, h2_narrow, h3_narrow, &
    & h4_narrow, h5_narrow, h6_narrow, h7_narrow, h0_wide, h1_wide, h2_wide, h3_wide, h4_wide, &
    & h5_wide, h6_wide, h7_wide, h8_wide, h9_wide, h10_wide, h11_wide, v0_wide, v1_wide, v2_wide, &
    & v3_wide, v4_wide, v5_wide, v6_wide, v7_wide, v8_wide, v9_wide, v10_wide, v11_wide
  use pd_force_list_stored, only: choose_stored
  implicit none (type, external)
  private
  public :: choose_loop

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

    if (tables == weights_alone .and. pass /= for_energy) then
      call choose_stored(dim, pass, state, projected, loop)
      return
    end if
    select case (pass)
    case (for_theta)
      if (projected) then
        call choose_one(dim, tables, plain_projected_theta_2, plain_projected_theta_3, &
          & shaped_projected_theta_2, shaped_projected_theta_3, loop)
      else
        call choose_one(dim, tables, plain_theta_2, plain_theta_3, shaped_theta_2, &
          & shaped_theta_3, loop)
      end if
    case (for_force)
      if (.not. state) then
        call choose_one(dim, tables, plain_bond_force_2, plain_bond_force_3, &
          & shaped_bond_force_2, shaped_bond_force_3, loop)
      else if (projected) then
        call choose_one(dim, tables, plain_projected_force_2, plain_projected_force_3, &
          & shaped_projected_force_2, shaped_projected_force_3, loop)
      else
        call choose_one(dim, tables, plain_force_2, plain_force_3, shaped_force_2, &
          & shaped_force_3, loop)
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

  subroutine choose_one(dim, tables, plain_2, plain_3, shaped_2, shaped_3, loop)
    integer, intent(in) :: dim, tables
    procedure(pass_loop) :: plain_2, plain_3, shaped_2, shaped_3
    procedure(pass_loop), pointer, intent(out) :: loop

    if (tables == all_tables) then
      loop => shaped_2
      if (dim == 3) loop => shaped_3
    else
      loop => plain_2
      if (dim == 3) loop => plain_3
    end if
  end subroutine choose_one

  subroutine plain_projected_theta_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_theta
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine plain_projected_theta_2

  subroutine plain_theta_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_theta
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine plain_theta_2

  subroutine plain_bond_force_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .false., shaped = .false., state = .false., projected = .true.
    include 'bond_pass.inc'
  end subroutine plain_bond_force_2

  subroutine plain_projected_force_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine plain_projected_force_2

  subroutine plain_force_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine plain_force_2

  subroutine shaped_projected_theta_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_theta
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine shaped_projected_theta_2

  subroutine shaped_theta_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_theta
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine shaped_theta_2

  subroutine shaped_bond_force_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .true., shaped = .true., state = .false., projected = .true.
    include 'bond_pass.inc'
  end subroutine shaped_bond_force_2

  subroutine shaped_projected_force_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine shaped_projected_force_2

  subroutine shaped_force_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_force
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine shaped_force_2

  subroutine projected_energy_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_energy
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine projected_energy_2

  subroutine energy_2(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 2, pass = for_energy
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine energy_2

  subroutine plain_projected_theta_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_theta
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine plain_projected_theta_3

  subroutine plain_theta_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_theta
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine plain_theta_3

  subroutine plain_bond_force_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .false., shaped = .false., state = .false., projected = .true.
    include 'bond_pass.inc'
  end subroutine plain_bond_force_3

  subroutine plain_projected_force_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine plain_projected_force_3

  subroutine plain_force_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine plain_force_3

  subroutine shaped_projected_theta_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_theta
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine shaped_projected_theta_3

  subroutine shaped_theta_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_theta
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine shaped_theta_3

  subroutine shaped_bond_force_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .true., shaped = .true., state = .false., projected = .true.
    include 'bond_pass.inc'
  end subroutine shaped_bond_force_3

  subroutine shaped_projected_force_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine shaped_projected_force_3

  subroutine shaped_force_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_force
    logical, parameter :: stored = .true., shaped = .true., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine shaped_force_3

  subroutine projected_energy_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_energy
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .true.
    include 'bond_pass.inc'
  end subroutine projected_energy_3

  subroutine energy_3(n, member, first, intact, place, moved, given, fraction, &
    & geometry, weight_D, weight_S, own, task, sums, missed)
    integer, parameter :: dim = 3, pass = for_energy
    logical, parameter :: stored = .false., shaped = .false., state = .true., projected = .false.
    include 'bond_pass.inc'
  end subroutine energy_3

end module pd_force_list_fast
