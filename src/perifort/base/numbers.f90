!> Sums that do not depend on the number of threads, orders and medians, and a few constants.
module pd_base_numbers
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: pi, inner, block_length, noise, ascending, median

  real(wp), parameter :: pi = acos(-1.0_wp)
  !> Terms in one partial sum: the blocks are fixed, so the sum's rounding is too.
  integer, parameter :: block_length = 4096

contains

  !> Sum of `a*b` in blocks of fixed length, added in order.
  function inner(a, b) result(sum_of_all)
    real(wp), intent(in), contiguous :: a(:)  !! (n), one factor of each term
    real(wp), intent(in), contiguous :: b(:)  !! (n), the other factor
    real(wp) :: sum_of_all
    real(wp), allocatable :: part(:)
    integer :: block, blocks, first, last

    blocks = (size(a) + block_length - 1)/block_length
    allocate (part(blocks))
    !$omp parallel do schedule(static) default(none) shared(blocks, part, a, b) &
    !$omp private(block, first, last)
    do block = 1, blocks
      first = (block - 1)*block_length + 1
      last = min(block*block_length, size(a))
      part(block) = dot_product(a(first:last), b(first:last))
    end do
    sum_of_all = sum(part)
  end function inner

  !> The next number in (-1, 1) of a sequence that is the same on every machine: the multiplicative
  !> generator of Park and Miller (1988), 16807 modulo 2^31 - 1. `state` starts it, from 1 to
  !> 2147483646, and is changed.
  real(wp) function noise(state)
    integer, intent(inout) :: state  !! of the sequence, 1 to 2147483646; the next one on return
    ! Schrage's way to keep 16807*state mod 2^31-1 within 32 bits
    state = 16807*mod(state, 127773) - 2836*(state/127773)
    if (state <= 0) state = state + 2147483647
    noise = 2*real(state, wp)/2147483647.0_wp - 1
  end function noise

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
