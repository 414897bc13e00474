!> Small systems of linear equations, solved directly.
module elimination
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: eliminate

contains

  !> Solve K x = b by elimination with the largest pivots of each column.
  pure subroutine eliminate(K, x, singular)
    real(wp), intent(inout) :: K(:, :)  !! (n, n), destroyed
    real(wp), intent(inout) :: x(:)     !! (n) b, then the solution
    logical, intent(out) :: singular    !! there is none; `x` means nothing
    integer :: n, m, i

    n = size(x)
    singular = .false.
    do m = 1, n
      i = m - 1 + maxloc(abs(K(m:, m)), dim=1)
      K([i, m], :) = K([m, i], :)
      x([i, m]) = x([m, i])
      singular = .not. abs(K(m, m)) > 0.0_wp
      if (singular) return
      do i = m + 1, n
        x(i) = x(i) - K(i, m)/K(m, m)*x(m)
        K(i, m + 1:) = K(i, m + 1:) - K(i, m)/K(m, m)*K(m, m + 1:)
      end do
    end do
    do m = n, 1, -1
      x(m) = (x(m) - dot_product(K(m, m + 1:), x(m + 1:)))/K(m, m)
    end do
  end subroutine eliminate

end module elimination
