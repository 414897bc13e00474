!> The field `energy_density`.
module pd_output_fields_energy_density
  use pd_base_kinds, only: wp
  use pd_body_body, only: gather
  use pd_family_family, only: bonds_type, allocate_bonds
  use pd_force_forces, only: energy_pass
  use pd_force_generic_points, only: generic_point_energy
  use pd_force_reference, only: point_energy
  use pd_output_fields_exact, only: exact_type
  use pd_output_fields_field, only: moment_type, output_field_type
  implicit none (type, external)
  private
  public :: energy_density_field

contains

  !> Its description.
  type(output_field_type) function energy_density_field() result(field)
    field%name = 'energy_density'
    field%unit = 'J/m3'
    field%meaning = 'strain energy'
    field%fill => fill
    field%at_slot => at_slot
    field%exact => exact
  end function energy_density_field

  subroutine fill(now, values)
    type(moment_type), intent(in) :: now
    real(wp), intent(out) :: values(:, :)
    real(wp), allocatable :: of_slots(:)

    associate (system => now%system)
      allocate (of_slots(system%body%n_slots))
      call energy_pass(system%family, system%model, system%workspace, system%state%u, of_slots)
      call gather(system%body, of_slots, values(:, 1))
    end associate
  end subroutine fill

  subroutine at_slot(now, k, values)
    type(moment_type), intent(in) :: now
    integer, intent(in) :: k
    real(wp), intent(out) :: values(:)
    type(bonds_type) :: bonds

    associate (system => now%system)
      call allocate_bonds(system%family, bonds)
      call system%family%bonds_of(k, bonds)
      if (system%model%generic) then
        values = generic_point_energy(system%family, system%model, system%workspace%generic, &
          & system%state%u, k)
      else
        values = point_energy(system%model, system%state%u, k, bonds)
      end if
    end associate
  end subroutine at_slot

  pure subroutine exact(state, values, known)
    type(exact_type), intent(in) :: state
    real(wp), intent(out) :: values(:)
    logical, intent(out) :: known
    values = state%energy_density
    known = state%knows_strain
  end subroutine exact

end module pd_output_fields_energy_density
