!> The field `stress`.
module pd_output_fields_stress
  use pd_base_kinds, only: wp
  use pd_motion_system, only: system_type
  use pd_output_fields_exact, only: exact_type
  use pd_output_fields_field, only: output_field_type, rank_stress
  use pd_output_fields_gradient, only: components_of, lack_of_stress, stress_of
  implicit none (type, external)
  private
  public :: stress_field

contains

  !> Its description.
  type(output_field_type) function stress_field() result(field)
    field%name = 'stress'
    field%unit = 'Pa'
    field%meaning = 'Cauchy stress that the moduli give to the mechanical strain'
    field%rank = rank_stress
    field%of_gradient => of_gradient
    field%exact => exact
    field%lack => lack_of_stress
  end function stress_field

  subroutine of_gradient(system, k, gradient, values)
    type(system_type), intent(in) :: system
    integer, intent(in) :: k
    real(wp), intent(in) :: gradient(3, 3)
    real(wp), intent(out) :: values(:)
    call components_of(stress_of(system%model, k, gradient), system%body%dim, .true., values)
  end subroutine of_gradient

  pure subroutine exact(state, values, known)
    type(exact_type), intent(in) :: state
    real(wp), intent(out) :: values(:)
    logical, intent(out) :: known

    known = state%knows_stress
    call components_of(state%stress, state%dim, .true., values)
  end subroutine exact

end module pd_output_fields_stress
