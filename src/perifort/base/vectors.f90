!> Vectors in space.
module pd_base_vectors
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: cross

contains

  !> The vector product.
  pure function cross(a, b) result(product)
    real(wp), intent(in) :: a(3), b(3)   !! vectors
    real(wp) :: product(3)
    product = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
  end function cross

end module pd_base_vectors
