!> The field `von_mises`.
module pd_output_fields_von_mises
  use pd_base_kinds, only: wp
  use pd_motion_system, only: system_type
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
    field%lack => lack_of_stress
  end function von_mises_field

  subroutine of_gradient(system, k, gradient, values)
    type(system_type), intent(in) :: system
    integer, intent(in) :: k
    real(wp), intent(in) :: gradient(3, 3)
    real(wp), intent(out) :: values(:)
    real(wp) :: s(3, 3)

    s = stress_of(system%model, k, gradient)
    values = sqrt(((s(1, 1) - s(2, 2))**2 + (s(2, 2) - s(3, 3))**2 + (s(3, 3) - s(1, 1))**2)/2 &
      & + 3*(s(1, 2)**2 + s(2, 3)**2 + s(1, 3)**2))
  end subroutine of_gradient

end module pd_output_fields_von_mises
