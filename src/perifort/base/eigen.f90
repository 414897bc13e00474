!> Eigenvalues of small symmetric matrices.
module pd_base_eigen
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: eigenvectors, solve_symmetric

  integer, parameter :: sweeps = 30
  !> Eigenvalues below this part of the largest one count as 0.
  real(wp), parameter :: singular = 1.0e-10_wp

contains

  !> Eigenvalues and eigenvectors of a small symmetric matrix by Jacobi's rotations.
  pure subroutine eigenvectors(matrix, values, vectors)
    real(wp), intent(in) :: matrix(:, :)     !! (n, n)
    real(wp), intent(out) :: values(:)       !! (n) in no order
    real(wp), intent(out) :: vectors(:, :)   !! (n, n) orthonormal columns, in the order of `values`
    real(wp) :: a(size(values), size(values)), rotation(size(values), size(values)), angle
    integer :: sweep, i, j, n

    n = size(values)
    a = matrix
    vectors = identity(n)
    do sweep = 1, sweeps
      do i = 1, n - 1
        do j = i + 1, n
          if (abs(a(i, j)) <= 0.0_wp) cycle
          angle = 0.5_wp*atan2(2*a(i, j), a(j, j) - a(i, i))
          rotation = identity(n)
          rotation(i, i) = cos(angle); rotation(j, j) = cos(angle)
          rotation(i, j) = sin(angle); rotation(j, i) = -sin(angle)
          a = matmul(transpose(rotation), matmul(a, rotation))
          a(i, j) = 0.0_wp; a(j, i) = 0.0_wp
          vectors = matmul(vectors, rotation)
        end do
      end do
    end do
    do i = 1, n
      values(i) = a(i, i)
    end do
  end subroutine eigenvectors

  !> The smallest solution of matrix . x = side for a symmetric matrix without negative eigenvalues,
  !> which may be singular: what it does not see is left out.
  pure function solve_symmetric(matrix, side) result(x)
    real(wp), intent(in) :: matrix(:, :)   !! (n, n)
    real(wp), intent(in) :: side(:)        !! (n)
    real(wp) :: x(size(side)), values(size(side)), vectors(size(side), size(side))
    integer :: i

    call eigenvectors(matrix, values, vectors)
    x = 0.0_wp
    do i = 1, size(side)
      if (values(i) > singular*maxval(values)) &
        & x = x + vectors(:, i)*dot_product(vectors(:, i), side)/values(i)
    end do
  end function solve_symmetric

  !> The identity matrix.
  pure function identity(n) result(matrix)
    integer, intent(in) :: n
    real(wp) :: matrix(n, n)
    integer :: i

    matrix = 0.0_wp
    do i = 1, n
      matrix(i, i) = 1.0_wp
    end do
  end function identity

end module pd_base_eigen
