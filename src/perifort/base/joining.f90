!> Numbers that belong together in groups (disjoint sets): each points to a lower one of its group,
!> the lowest to itself.
module pd_base_joining
  use pd_base_kinds, only: i4
  implicit none (type, external)
  private
  public :: each_alone, unite, settle_groups

contains

  !> The numbers 1 to n, each a group of its own.
  pure function each_alone(n) result(parent)
    integer, intent(in) :: n    !! how many
    integer(i4) :: parent(n)
    integer :: i
    parent = [(int(i, i4), i=1, n)]
  end function each_alone

  !> Two numbers belong together from now on, with all that belong to either.
  pure subroutine unite(parent, one, other)
    integer(i4), intent(inout) :: parent(:)  !! (n) a lower number of the same group, or itself
    integer(i4), intent(in) :: one, other    !! 1 to n
    integer(i4) :: first, second

    call find_lowest(parent, one, first)
    call find_lowest(parent, other, second)
    if (first /= second) parent(max(first, second)) = min(first, second)
  end subroutine unite

  !> Let every number point to the lowest one of its group.
  pure subroutine settle_groups(parent)
    integer(i4), intent(inout) :: parent(:)  !! (n)
    integer :: i
    ! lower ones point to their lowest already
    do i = 1, size(parent)
      parent(i) = parent(parent(i))
    end do
  end subroutine settle_groups

  !> The lowest number of a group; ways are halved meanwhile.
  pure subroutine find_lowest(parent, number, lowest)
    integer(i4), intent(inout) :: parent(:)
    integer(i4), intent(in) :: number
    integer(i4), intent(out) :: lowest

    lowest = number
    do while (parent(lowest) /= lowest)
      parent(lowest) = parent(parent(lowest))
      lowest = parent(lowest)
    end do
  end subroutine find_lowest

end module pd_base_joining
