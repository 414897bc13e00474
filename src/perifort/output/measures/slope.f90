!> How fast something grows that only grows: the least-squares slope over the time of its last
!> growth.
!>
!> Rows with the same value are one level, of which the number, the mean and the spread of their
!> times are kept, so that a long stand takes no room. The slope is that of a straight line through
!> all rows of the window. The window begins with the last row of the level that lies at least
!> `reach` below the present value, or, as long as there is none, with the last row before any
!> growth: a time of waiting before the growth does not count, one after it does.
module pd_output_measures_slope
  use pd_base_archive, only: archive_type
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: slope_type

  integer, parameter :: value_of = 1, rows_of = 2, mean_of = 3, spread_of = 4, last_of = 5

  !> The levels of the window, the oldest first.
  type :: slope_type
    real(wp) :: reach = 0.0_wp             !! growth that the window covers
    real(wp), allocatable :: levels(:, :)  !! (5, level): value, rows, mean time, sum of squared
                                           !! deviations from it, last time
  contains
    procedure :: add
    procedure :: slope
    procedure :: keep
  end type slope_type

contains

  !> Add a row.
  pure subroutine add(self, time, value)
    class(slope_type), intent(inout) :: self  !! with this row on return
    real(wp), intent(in) :: time              !! after those of earlier rows [s]
    real(wp), intent(in) :: value             !! not below those of earlier rows
    real(wp) :: before
    integer :: n, first

    if (.not. allocated(self%levels)) allocate (self%levels(5, 0))
    n = size(self%levels, 2)
    if (n > 0) then
      if (value <= self%levels(value_of, n)) then
        associate (level => self%levels(:, n))
          before = time - level(mean_of)
          level(rows_of) = level(rows_of) + 1
          level(mean_of) = level(mean_of) + before/level(rows_of)
          level(spread_of) = level(spread_of) + before*(time - level(mean_of))
          level(last_of) = time
        end associate
        return
      end if
    end if
    self%levels = reshape([self%levels, value, 1.0_wp, time, 0.0_wp, time], [5, n + 1])
    n = n + 1
    ! levels behind the beginning of the window go; rounding of the value must not move it
    first = 1
    do while (first < n)
      if (self%levels(value_of, first + 1) > value - self%reach*(1 - 1.0e-6_wp)) exit
      first = first + 1
    end do
    self%levels = self%levels(:, first:)
    self%levels(rows_of:spread_of, 1) = [1.0_wp, self%levels(last_of, 1), 0.0_wp]
  end subroutine add

  !> The slope; 0 before any growth.
  pure real(wp) function slope(self)
    class(slope_type), intent(in) :: self  !! with all rows so far
    real(wp) :: time, value, spread, product

    slope = 0.0_wp
    if (.not. allocated(self%levels)) return
    if (size(self%levels, 2) < 2) return
    associate (n => self%levels(rows_of, :), mean => self%levels(mean_of, :), &
      & values => self%levels(value_of, :))
      time = sum(n*mean)/sum(n)
      value = sum(n*values)/sum(n)
      spread = sum(self%levels(spread_of, :) + n*(mean - time)**2)
      product = sum(n*(mean - time)*(values - value))
    end associate
    if (spread > 0.0_wp) slope = product/spread
  end function slope

  !> Keep the window, or put it back.
  subroutine keep(self, archive, name)
    class(slope_type), intent(inout) :: self       !! set where the archive reads
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    character(*), intent(in) :: name               !! what the archive calls it

    if (archive%reading .and. allocated(self%levels)) deallocate (self%levels)
    call archive%keep(name, self%levels)
  end subroutine keep

end module pd_output_measures_slope
