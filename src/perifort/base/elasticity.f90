!> Facts of linear elasticity that the rules for scenes and the materials both need.
module pd_base_elasticity
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: bond_based_ratio

contains

  !> The Poisson's ratio at which a = 0 and the force is bond-based (doc/theory.md, 1): 1/3 in plane
  !> stress, else 1/4 [-].
  pure real(wp) function bond_based_ratio(dim, plane_strain) result(ratio)
    integer, intent(in) :: dim           !! of the scene: 1, 2 or 3
    logical, intent(in) :: plane_strain  !! plane strain, else plane stress; used in 2D only

    ratio = 0.25_wp
    if (dim == 2 .and. .not. plane_strain) ratio = 1.0_wp/3.0_wp
  end function bond_based_ratio

end module pd_base_elasticity
