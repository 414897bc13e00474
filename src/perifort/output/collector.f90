!> Values of the points of all ranks, brought to the first rank in the order of the points: it alone
!> writes results.
module pd_output_collector
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i8
  use pd_body_body, only: body_type
  implicit none (type, external)
  private
  public :: collector_type

  !> Where the first rank puts what ranks send.
  type :: collector_type
    logical :: needed = .false.              !! there are more ranks than one
    logical :: writes = .true.               !! this is the first one, which writes
    integer :: n = 0                         !! points that this rank writes: all on the first one,
                                             !! else its own
    integer, allocatable, private :: at(:)   !! on the first rank: the point of each value
  contains
    procedure :: begin
    procedure :: whole
  end type collector_type

contains

  !> Find out which points come from which rank.
  subroutine begin(self, body)
    class(collector_type), intent(out) :: self
    type(body_type), intent(in) :: body  !! with its owned points
    real(wp), allocatable :: numbers(:)

    self%n = body%order%n_owned
    self%needed = associated(body%order%ranks)
    if (.not. self%needed) return
    ! numbers of points are exact as reals
    call body%order%ranks%collect(real(body%number(:body%order%n_owned), wp), numbers)
    self%writes = size(numbers) > 0
    if (.not. self%writes) return
    if (size(numbers, kind=i8) /= body%order%n_global) &
      & call internal_fault('points without a rank, or with two')
    self%at = nint(numbers)
    self%n = size(self%at)
  end subroutine begin

  !> Values of owned points become those of the points that this rank writes.
  subroutine whole(self, body, own, all_values)
    class(collector_type), intent(in) :: self
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: own(:)                       !! (owned points)
    real(wp), allocatable, intent(out) :: all_values(:)  !! (n)
    real(wp), allocatable :: got(:)

    if (.not. self%needed) then
      all_values = own
      return
    end if
    call body%order%ranks%collect(own, got)
    if (allocated(self%at)) then
      allocate (all_values(self%n))
      all_values(self%at) = got
    else
      all_values = own
    end if
  end subroutine whole

end module pd_output_collector
