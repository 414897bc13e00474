!> The field `strain`.
module pd_output_fields_strain
  use pd_base_kinds, only: wp
  use pd_motion_system, only: system_type
  use pd_output_fields_exact, only: exact_type
  use pd_output_fields_field, only: output_field_type, rank_symmetric
  use pd_output_fields_gradient, only: components_of, strain_of
  implicit none (type, external)
  private
  public :: strain_field

contains

  !> Its description.
  type(output_field_type) function strain_field() result(field)
    field%name = 'strain'
    field%meaning = 'strain of Green and Lagrange, (F^T F - 1)/2, thermal strain included'
    field%rank = rank_symmetric
    field%of_gradient => of_gradient
    field%exact => exact
  end function strain_field

  subroutine of_gradient(system, k, gradient, values)
    type(system_type), intent(in) :: system
    integer, intent(in) :: k
    real(wp), intent(in) :: gradient(3, 3)
    real(wp), intent(out) :: values(:)

    associate (unused => k)
    end associate
    call components_of(strain_of(gradient), system%body%dim, .false., values)
  end subroutine of_gradient

  pure subroutine exact(state, values, known)
    type(exact_type), intent(in) :: state
    real(wp), intent(out) :: values(:)
    logical, intent(out) :: known

    known = state%knows_stress
    call components_of(strain_of(state%gradient), state%dim, .false., values)
  end subroutine exact

end module pd_output_fields_strain
