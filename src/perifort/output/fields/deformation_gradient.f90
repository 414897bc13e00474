!> The field `deformation_gradient`.
module pd_output_fields_deformation_gradient
  use pd_base_kinds, only: wp
  use pd_motion_system, only: system_type
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
  end function deformation_gradient_field

  subroutine of_gradient(system, k, gradient, values)
    type(system_type), intent(in) :: system
    integer, intent(in) :: k
    real(wp), intent(in) :: gradient(3, 3)
    real(wp), intent(out) :: values(:)
    integer :: row, column, dim

    associate (unused => k)
    end associate
    dim = system%body%dim
    do row = 1, dim
      do column = 1, dim
        values((row - 1)*dim + column) = gradient(row, column) + merge(1, 0, row == column)
      end do
    end do
  end subroutine of_gradient

end module pd_output_fields_deformation_gradient
