!> Values of the points that ranks own, dealt out anew so that each rank has those of points that
!> follow each other: the rows that it writes.
module pd_output_deal
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i8
  use pd_body_body, only: body_type
  use pd_output_results_rows, only: all_rows, rows_of_rank, rows_type
  implicit none (type, external)
  private
  public :: deal_type

  !> Which values go where.
  type :: deal_type
    logical :: needed = .false.                !! there are more ranks than one
    type(rows_type) :: rows                    !! of this rank
    integer, allocatable, private :: given(:)  !! owned points whose rows each rank has
    integer, allocatable, private :: at(:)     !! row here of each value that comes
  contains
    procedure :: begin
    procedure :: values_of_rows
  end type deal_type

contains

  !> Find out which points' rows are whose; a call of all ranks.
  subroutine begin(self, body)
    class(deal_type), intent(out) :: self
    type(body_type), intent(in) :: body  !! with its owned points
    integer(i8), allocatable :: bounds(:)
    real(wp), allocatable :: numbers(:)
    integer :: i, r

    self%rows = all_rows(body%order%n_owned)
    self%needed = associated(body%order%ranks)
    if (.not. self%needed) return
    call rows_of_rank(body%order%ranks, body%order%n_global, self%rows, bounds)
    allocate (self%given(0:ubound(bounds, 1) - 1), source=0)
    associate (number => body%number(:body%order%n_owned))
      ! they ascend, so the values are in the order of the ranks already
      r = 0
      do i = 1, size(number)
        do while (number(i) > bounds(r + 1))
          r = r + 1
        end do
        self%given(r) = self%given(r) + 1
      end do
      ! numbers of points are exact as reals
      call body%order%ranks%deal(real(number, wp), self%given, numbers)
    end associate
    if (size(numbers) /= self%rows%n) call internal_fault('points without a rank, or with two')
    self%at = int(nint(numbers, i8) - self%rows%before)
  end subroutine begin

  !> Values of owned points become those of the rows that this rank writes; a call of all ranks.
  subroutine values_of_rows(self, body, own, of_rows)
    class(deal_type), intent(in) :: self
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: own(:)                      !! (owned points)
    real(wp), allocatable, intent(out) :: of_rows(:)    !! (rows)
    real(wp), allocatable :: got(:)

    if (.not. self%needed) then
      of_rows = own
      return
    end if
    call body%order%ranks%deal(own, self%given, got)
    allocate (of_rows(self%rows%n))
    of_rows(self%at) = got
  end subroutine values_of_rows

end module pd_output_deal
