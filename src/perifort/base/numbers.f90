!> Orders and medians of a few numbers, and a constant.
module pd_base_numbers
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: pi, ascending, median

  real(wp), parameter :: pi = acos(-1.0_wp)

contains

  !> The numbers of `values` in ascending order of value.
  pure function ascending(values) result(order)
    real(wp), intent(in) :: values(:)  !! (n), without NaN
    integer :: order(size(values))
    integer :: i, j, this

    order = [(i, i=1, size(values))]
    do i = 2, size(values)
      this = order(i)
      do j = i - 1, 1, -1
        if (values(order(j)) <= values(this)) exit
        order(j + 1) = order(j)
      end do
      order(j + 1) = this
    end do
  end function ascending

  !> The middle value, of an even number the lower of the two.
  pure real(wp) function median(values)
    real(wp), intent(in) :: values(:)  !! (n), at least one, without NaN
    integer :: order(size(values))
    order = ascending(values)
    median = values(order((size(values) + 1)/2))
  end function median

end module pd_base_numbers
