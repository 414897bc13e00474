!> The force in one bond.
module pd_output_fields_pair_force
  use pd_base_kinds, only: wp, i8
  use pd_family_family, only: bonds_type
  use pd_force_model, only: q_of
  use pd_force_reference, only: bond_state_type, state_of_bond
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: pair_force

contains

  !> The present pair force density of a bond, which pulls both ends together along the deformed
  !> bond (doc/theory.md, 2; of the generic pass, 15): times vc V_k V_j it is the force in the bond
  !> [N].
  pure subroutine pair_force(system, k, bonds, i, magnitude, direction)
    type(system_type), intent(in) :: system  !! with forces that are up to date
    integer, intent(in) :: k                 !! slot
    type(bonds_type), intent(in) :: bonds    !! of slot `k`
    integer, intent(in) :: i                 !! number of the bond, from 1; intact
    real(wp), intent(out) :: magnitude       !! > 0 in tension [N/m6]
    real(wp), intent(out) :: direction(3)    !! unit vector from `k` to the other end, deformed
    type(bond_state_type) :: state
    integer(i8) :: b
    integer :: j

    associate (model => system%model, generic => system%workspace%generic, p => system%state%p)
      j = bonds%j(i)
      state = state_of_bond(model, system%state%u, k, bonds, i)
      if (model%generic) then
        b = generic%start(k) + i - 1
        magnitude = generic%pull(b) + generic%pull(generic%partner(b))
      else
        magnitude = (q_of(model, k) + q_of(model, j))*state%Gb*state%stretch
        if (model%dilatation) &
          & magnitude = magnitude + (p(k) + p(j))*state%Gd*state%lambda/bonds%length(i)
      end if
      direction = state%direction
    end associate
  end subroutine pair_force

end module pd_output_fields_pair_force
