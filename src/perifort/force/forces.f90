!> One call for the whole body, whatever its family: the class is looked at once per pass.
module pd_force_forces
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i1
  use pd_family_family, only: family_type
  use pd_family_list, only: list_family_type
  use pd_family_lattice, only: lattice_family_type
  use pd_force_lattice, only: lattice_dilatation, lattice_force, lattice_energy
  use pd_force_list, only: list_dilatation, list_force, list_energy
  use pd_force_model, only: model_type
  implicit none (type, external)
  private
  public :: dilatation_pass, force_pass, energy_pass

contains

  !> p_k = 2 a d delta theta_k of all slots from displacements `u` (n_slots, dim) [m]. Where bonds
  !> can break, `strained` becomes 1 for slots with a bond (nearly) beyond its limit, else 0.
  subroutine dilatation_pass(family, model, u, p, strained)
    class(family_type), intent(inout) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: p(:)
    integer(i1), intent(inout), contiguous :: strained(:)

    select type (family)
    type is (list_family_type)
      call list_dilatation(family, model, u, p, strained)
    type is (lattice_family_type)
      call lattice_dilatation(family, model, u, p, strained)
    class default
      call internal_fault('the dilatation of a family that has no loops')
    end select
  end subroutine dilatation_pass

  !> Internal force density of all slots (n_slots, dim) [N/m3]; `strained` as above.
  subroutine force_pass(family, model, u, p, force, strained)
    class(family_type), intent(inout) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(inout), contiguous :: force(:, :)
    integer(i1), intent(inout), contiguous :: strained(:)

    select type (family)
    type is (list_family_type)
      call list_force(family, model, u, p, force, strained)
    type is (lattice_family_type)
      call lattice_force(family, model, u, p, force, strained)
    class default
      call internal_fault('the forces of a family that has no loops')
    end select
  end subroutine force_pass

  !> Strain energy density of all slots [J/m3].
  subroutine energy_pass(family, model, u, energy)
    class(family_type), intent(inout) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: energy(:)

    select type (family)
    type is (list_family_type)
      call list_energy(family, model, u, energy)
    type is (lattice_family_type)
      call lattice_energy(family, model, u, energy)
    class default
      call internal_fault('the energy of a family that has no loops')
    end select
  end subroutine energy_pass

end module pd_force_forces
