!> The field `von_mises`.
module pd_output_fields_von_mises
  use pd_base_kinds, only: wp
  use pd_base_tensors, only: equivalent_stress
  use pd_motion_system, only: system_type
  use pd_output_fields_exact, only: exact_type
  use pd_output_fields_field, only: output_field_type
  use pd_output_fields_gradient, only: lack_of_stress, stress_of
  implicit none (type, external)
  private
  public :: von_mises_field

contains

  !> Its description.
  type(output_field_type) function von_mises_field() result(field)
    field%name = 'von_mises'
    field%unit = 'Pa'
    field%meaning = 'equivalent stress of von Mises, of `stress`'
    field%of_gradient => of_gradient
    field%exact => exact
    field%lack => lack_of_stress
  end function von_mises_field

  subroutine of_gradient(system, k, gradient, values)
    type(system_type), intent(in) :: system
    integer, intent(in) :: k
    real(wp), intent(in) :: gradient(3, 3)
    real(wp), intent(out) :: values(:)
    values = equivalent_stress(stress_of(system%model, k, gradient))
  end subroutine of_gradient

  pure subroutine exact(state, values, known)
    type(exact_type), intent(in) :: state
    real(wp), intent(out) :: values(:)
    logical, intent(out) :: known

    known = state%knows_stress
    values = equivalent_stress(state%stress)
  end subroutine exact

end module pd_output_fields_von_mises
