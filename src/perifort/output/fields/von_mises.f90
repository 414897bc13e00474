!> The field `von_mises`.
module pd_output_fields_von_mises
  use pd_base_kinds, only: wp
  use pd_motion_system, only: system_type
  use pd_output_fields_field, only: moment_type, output_field_type
  use pd_output_fields_gradient, only: at_slot_from_gradient, fill_from_gradient, &
    & lack_of_stress, stress_of
  implicit none (type, external)
  private
  public :: von_mises_field

contains

  !> Its description.
  type(output_field_type) function von_mises_field() result(field)
    field%name = 'von_mises'
    field%unit = 'Pa'
    field%meaning = 'equivalent stress of von Mises, of `stress`'
    field%fill => fill
    field%at_slot => at_slot
    field%lack => lack_of_stress
  end function von_mises_field

  subroutine fill(now, values)
    type(moment_type), intent(in) :: now
    real(wp), intent(out) :: values(:, :)
    call fill_from_gradient(now, of_gradient, values)
  end subroutine fill

  subroutine at_slot(now, k, values)
    type(moment_type), intent(in) :: now
    integer, intent(in) :: k
    real(wp), intent(out) :: values(:)
    call at_slot_from_gradient(now, k, of_gradient, values)
  end subroutine at_slot

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
