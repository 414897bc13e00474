!> The field `deformation_gradient`.
module pd_output_fields_deformation_gradient
  use pd_base_kinds, only: wp
  use pd_motion_system, only: system_type
  use pd_output_fields_exact, only: exact_type
  use pd_output_fields_field, only: output_field_type, rank_tensor
  implicit none (type, external)
  private
  public :: deformation_gradient_field

contains

  !> Its description.
  type(output_field_type) function deformation_gradient_field() result(field)
    field%name = 'deformation_gradient'
    field%meaning = 'gradient F of the deformed position, from the intact bonds'
    field%rank = rank_tensor
    field%of_gradient => of_gradient
    field%exact => exact
  end function deformation_gradient_field

  subroutine of_gradient(system, k, gradient, values)
    type(system_type), intent(in) :: system
    integer, intent(in) :: k
    real(wp), intent(in) :: gradient(3, 3)
    real(wp), intent(out) :: values(:)

    associate (unused => k)
    end associate
    call components_of_gradient(gradient, system%body%dim, values)
  end subroutine of_gradient

  !> F = 1 + the gradient of the displacements, row by row.
  pure subroutine components_of_gradient(gradient, dim, values)
    real(wp), intent(in) :: gradient(3, 3)
    integer, intent(in) :: dim
    real(wp), intent(out) :: values(:)
    integer :: row, column

    do row = 1, dim
      do column = 1, dim
        values((row - 1)*dim + column) = gradient(row, column) + merge(1, 0, row == column)
      end do
    end do
  end subroutine components_of_gradient

  pure subroutine exact(state, values, known)
    type(exact_type), intent(in) :: state
    real(wp), intent(out) :: values(:)
    logical, intent(out) :: known

    known = state%knows_stress
    call components_of_gradient(state%gradient, state%dim, values)
  end subroutine exact

end module pd_output_fields_deformation_gradient
