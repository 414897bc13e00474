!> The field `stress`.
module pd_output_fields_stress
  use pd_base_kinds, only: wp
  use pd_motion_system, only: system_type
  use pd_output_fields_field, only: moment_type, output_field_type, rank_stress
  use pd_output_fields_gradient, only: at_slot_from_gradient, components_of, &
    & fill_from_gradient, lack_of_stress, stress_of
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
    field%fill => fill
    field%at_slot => at_slot
    field%lack => lack_of_stress
  end function stress_field

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
    call components_of(stress_of(system%model, k, gradient), system%body%dim, .true., values)
  end subroutine of_gradient

end module pd_output_fields_stress
