!> The field `fragment`.
module pd_output_fields_fragment
  use pd_base_kinds, only: wp
  use pd_body_body, only: gather
  use pd_motion_static_pieces, only: find_pieces, pieces_type
  use pd_output_fields_field, only: moment_type, output_field_type
  use pd_output_results_types, only: nodes_nearest
  implicit none (type, external)
  private
  public :: fragment_field

contains

  !> Its description.
  type(output_field_type) function fragment_field() result(field)
    field%name = 'fragment'
    field%meaning = 'number of the part that chains of intact bonds join, by its first point'
    field%at_nodes = nodes_nearest
    field%fill => fill
  end function fragment_field

  !> Parts are numbered from 1 in the order of their first points.
  subroutine fill(now, values)
    type(moment_type), intent(in) :: now
    real(wp), intent(out) :: values(:, :)
    type(pieces_type) :: pieces

    values = 0.0_wp
    call find_pieces(now%system%body, now%system%family, pieces)
    call gather(now%system%body, real(pieces%of, wp), values(:, 1))
  end subroutine fill

end module pd_output_fields_fragment
