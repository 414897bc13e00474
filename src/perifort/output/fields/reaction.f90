!> The field `reaction`.
module pd_output_fields_reaction
  use pd_base_kinds, only: wp
  use pd_body_body, only: gather
  use pd_motion_reactions, only: point_reactions
  use pd_output_fields_field, only: moment_type, output_field_type, rank_vector
  implicit none (type, external)
  private
  public :: reaction_field

contains

  !> Its description.
  type(output_field_type) function reaction_field() result(field)
    field%name = 'reaction'
    field%unit = 'N'
    field%meaning = 'force that boundaries exert on the point, along its constrained components'
    field%rank = rank_vector
    field%fill => fill
  end function reaction_field

  subroutine fill(now, values)
    type(moment_type), intent(in) :: now
    real(wp), intent(out) :: values(:, :)
    real(wp), allocatable :: reaction(:, :)
    integer :: dim

    values = 0.0_wp
    dim = now%system%body%dim
    allocate (reaction(now%system%body%n_slots, dim))
    call point_reactions(now%system, reaction)
    call gather(now%system%body, reaction, values(:, :dim))
  end subroutine fill

end module pd_output_fields_reaction
