!> Tensors of three dimensions as matrices: determinant, cofactors, principal values.
module pd_base_tensors
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: determinant, cofactors, principal_values, equivalent_stress

contains

  !> The determinant.
  pure real(wp) function determinant(a)
    real(wp), intent(in) :: a(3, 3)  !! any matrix
    real(wp) :: c(3, 3)
    c = cofactors(a)
    determinant = dot_product(a(:, 1), c(:, 1))
  end function determinant

  !> The matrix of cofactors: det(a) times the inverse transposed.
  pure function cofactors(a) result(c)
    real(wp), intent(in) :: a(3, 3)  !! any matrix
    real(wp) :: c(3, 3)
    integer :: i, j, i1, i2, j1, j2

    do j = 1, 3
      j1 = mod(j, 3) + 1
      j2 = mod(j + 1, 3) + 1
      do i = 1, 3
        i1 = mod(i, 3) + 1
        i2 = mod(i + 1, 3) + 1
        c(i, j) = a(i1, j1)*a(i2, j2) - a(i1, j2)*a(i2, j1)
      end do
    end do
  end function cofactors

  !> The equivalent stress of von Mises: that under uniaxial stress with the same deviator's norm.
  pure real(wp) function equivalent_stress(s)
    real(wp), intent(in) :: s(3, 3)  !! symmetric [Pa]

    equivalent_stress = sqrt(((s(1, 1) - s(2, 2))**2 + (s(2, 2) - s(3, 3))**2 &
      & + (s(3, 3) - s(1, 1))**2)/2 + 3*(s(1, 2)**2 + s(2, 3)**2 + s(1, 3)**2))
  end function equivalent_stress

  !> Eigenvalues of a symmetric matrix, the largest first, by Jacobi's rotations: their error is
  !> some epsilon of the largest element, however close they are to each other.
  pure function principal_values(a) result(values)
    real(wp), intent(in) :: a(3, 3)  !! symmetric
    real(wp) :: values(3)
    real(wp) :: b(3, 3), least, half, t, c, s, column(3)
    integer :: sweep, p, q

    b = a
    values = sum(abs(a))
    if (.not. all(ieee_is_finite(a))) return  ! no numbers: neither are the eigenvalues
    least = epsilon(1.0_wp)/8*values(1)
    ! each sweep squares the elements off the diagonal, relative to the others
    do sweep = 1, 20
      if (max(abs(b(1, 2)), abs(b(2, 3)), abs(b(1, 3))) <= least) exit
      do p = 1, 2
        do q = p + 1, 3
          if (abs(b(p, q)) <= least) cycle
          half = (b(q, q) - b(p, p))/(2*b(p, q))
          t = sign(1.0_wp, half)/(abs(half) + hypot(half, 1.0_wp))
          c = 1/hypot(t, 1.0_wp)
          s = t*c
          column = b(:, p)
          b(:, p) = c*column - s*b(:, q)
          b(:, q) = s*column + c*b(:, q)
          column = b(p, :)
          b(p, :) = c*column - s*b(q, :)
          b(q, :) = s*column + c*b(q, :)
        end do
      end do
    end do
    values = [b(1, 1), b(2, 2), b(3, 3)]
    if (values(1) < values(2)) values(:2) = values([2, 1])
    if (values(2) < values(3)) values(2:) = values([3, 2])
    if (values(1) < values(2)) values(:2) = values([2, 1])
  end function principal_values

end module pd_base_tensors
