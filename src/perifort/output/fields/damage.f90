!> The field `damage`.
module pd_output_fields_damage
  use pd_base_kinds, only: wp
  use pd_body_body, only: gather
  use pd_output_fields_exact, only: exact_type
  use pd_output_fields_field, only: moment_type, output_field_type
  implicit none (type, external)
  private
  public :: damage_field

contains

  !> Its description.
  type(output_field_type) function damage_field() result(field)
    field%name = 'damage'
    field%meaning = 'broken part of the initial bonds of a point, 0 where bonds cannot break'
    field%fill => fill
    field%at_slot => at_slot
    field%exact => exact
  end function damage_field

  subroutine fill(now, values)
    type(moment_type), intent(in) :: now
    real(wp), intent(out) :: values(:, :)

    values = 0.0_wp
    associate (damage => now%system%state%damage)
      if (size(damage) > 0) call gather(now%system%body, damage, values(:, 1))
    end associate
  end subroutine fill

  subroutine at_slot(now, k, values)
    type(moment_type), intent(in) :: now
    integer, intent(in) :: k
    real(wp), intent(out) :: values(:)

    values = 0.0_wp
    if (size(now%system%state%damage) > 0) values = now%system%state%damage(k)
  end subroutine at_slot

  pure subroutine exact(state, values, known)
    type(exact_type), intent(in) :: state
    real(wp), intent(out) :: values(:)
    logical, intent(out) :: known
    values = 0.0_wp
    known = state%in_equilibrium
  end subroutine exact

end module pd_output_fields_damage
