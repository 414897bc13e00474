!> The field `dilatation`.
module pd_output_fields_dilatation
  use pd_base_kinds, only: wp
  use pd_body_body, only: gather
  use pd_family_family, only: bonds_type, allocate_bonds
  use pd_force_generic_points, only: generic_point_dilatation
  use pd_force_reference, only: point_dilatation, reference_dilatation
  use pd_motion_system, only: system_type
  use pd_output_fields_exact, only: exact_type
  use pd_output_fields_field, only: moment_type, output_field_type
  implicit none (type, external)
  private
  public :: dilatation_field

contains

  !> Its description.
  type(output_field_type) function dilatation_field() result(field)
    field%name = 'dilatation'
    field%meaning = 'relative change of volume'
    field%fill => fill
    field%at_slot => at_slot
    field%exact => exact
  end function dilatation_field

  subroutine fill(now, values)
    type(moment_type), intent(in) :: now
    real(wp), intent(out) :: values(:, :)
    real(wp), allocatable :: of_slots(:)

    associate (system => now%system)
      allocate (of_slots(system%body%n_slots))
      if (system%model%generic) then
        call dilatation_by_laws(system, of_slots)
      else
        call reference_dilatation(system%family, system%model, system%state%u, of_slots)
      end if
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
        values = generic_point_dilatation(system%family, system%model, system%workspace%generic, &
          & system%state%u, k)
      else
        values = point_dilatation(system%model, system%state%u, k, bonds)
      end if
    end associate
  end subroutine at_slot

  !> Of all slots, each by its law.
  subroutine dilatation_by_laws(system, theta)
    type(system_type), intent(in) :: system
    real(wp), intent(out) :: theta(:)
    integer :: k

    !$omp parallel do schedule(static) default(none) shared(system, theta) private(k)
    do k = 1, system%body%n_slots
      theta(k) = generic_point_dilatation(system%family, system%model, system%workspace%generic, &
        & system%state%u, k)
    end do
  end subroutine dilatation_by_laws

  pure subroutine exact(state, values, known)
    type(exact_type), intent(in) :: state
    real(wp), intent(out) :: values(:)
    logical, intent(out) :: known
    values = state%dilatation
    known = state%knows_strain
  end subroutine exact

end module pd_output_fields_dilatation
