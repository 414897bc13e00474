!> The field `force_density`.
module pd_output_fields_force_density
  use pd_base_kinds, only: wp
  use pd_body_body, only: gather
  use pd_output_fields_exact, only: exact_type
  use pd_output_fields_field, only: moment_type, output_field_type, rank_vector
  implicit none (type, external)
  private
  public :: force_density_field

contains

  !> Its description.
  type(output_field_type) function force_density_field() result(field)
    field%name = 'force_density'
    field%unit = 'N/m3'
    field%meaning = 'internal forces, without loads'
    field%rank = rank_vector
    field%fill => fill
    field%at_slot => at_slot
    field%exact => exact
  end function force_density_field

  subroutine fill(now, values)
    type(moment_type), intent(in) :: now
    real(wp), intent(out) :: values(:, :)
    integer :: c

    do c = 1, size(values, 2)
      call gather(now%system%body, now%system%state%force(:, c), values(:, c))
    end do
  end subroutine fill

  subroutine at_slot(now, k, values)
    type(moment_type), intent(in) :: now
    integer, intent(in) :: k
    real(wp), intent(out) :: values(:)
    values = now%system%state%force(k, :)
  end subroutine at_slot

  pure subroutine exact(state, values, known)
    type(exact_type), intent(in) :: state
    real(wp), intent(out) :: values(:)
    logical, intent(out) :: known
    values = 0.0_wp
    known = state%in_equilibrium
  end subroutine exact

end module pd_output_fields_force_density
