!> The field `velocity`.
module pd_output_fields_velocity
  use pd_base_kinds, only: wp
  use pd_body_body, only: gather
  use pd_output_fields_exact, only: exact_type
  use pd_output_fields_field, only: moment_type, output_field_type, rank_vector
  use pd_output_results_types, only: nodes_linear
  implicit none (type, external)
  private
  public :: velocity_field

contains

  !> Its description.
  type(output_field_type) function velocity_field() result(field)
    field%name = 'velocity'
    field%unit = 'm/s'
    field%meaning = 'velocity at the time of the output'
    field%rank = rank_vector
    field%at_nodes = nodes_linear
    field%fill => fill
    field%at_slot => at_slot
    field%exact => exact
  end function velocity_field

  subroutine fill(now, values)
    type(moment_type), intent(in) :: now
    real(wp), intent(out) :: values(:, :)
    integer :: c

    do c = 1, size(values, 2)
      call gather(now%system%body, now%v(:, c), values(:, c))
    end do
  end subroutine fill

  subroutine at_slot(now, k, values)
    type(moment_type), intent(in) :: now
    integer, intent(in) :: k
    real(wp), intent(out) :: values(:)
    values = now%v(k, :)
  end subroutine at_slot

  pure subroutine exact(state, values, known)
    type(exact_type), intent(in) :: state
    real(wp), intent(out) :: values(:)
    logical, intent(out) :: known
    values = state%velocity(:size(values))
    known = state%knows_velocity
  end subroutine exact

end module pd_output_fields_velocity
