!> A loop's turns shared out to threads, so that each thread has the same part of them in every
!> loop: what it has written stands in its own cache the next time. A thread that is done takes
!> what others have left, because some turns may take many times as long as others. OpenMP's
!> schedules give one or the other: `static` the same parts, `dynamic` what is left.
module pd_base_shares
  use omp_lib, only: omp_get_max_threads, omp_get_thread_num
  use pd_base_kinds, only: i8
  implicit none (type, external)
  private
  public :: shares_type

  !> Counters in one cache line would go to and fro between the cores: so many apart, they share
  !> none, nor one with its neighbour.
  integer, parameter :: apart = 32

  !> What is left of a loop's turns. Begun by one thread, then shared by all.
  type :: shares_type
    private
    integer :: parts = 0                          !! as many as threads
    integer :: piece = 1                          !! turns that are taken at once
    integer, allocatable :: last(:)               !! last turn of each part (parts)
    integer, allocatable :: next(:, :)            !! its next one, in the first row (apart, parts)
  contains
    procedure :: begin
    procedure :: take
  end type shares_type

contains

  !> Share out the turns from `first` to `last`. Outside a parallel region.
  subroutine begin(self, first, last, piece)
    class(shares_type), intent(inout) :: self  !! whose turns before are done
    integer, intent(in) :: first               !! first turn
    integer, intent(in) :: last                !! last turn; below `first`: there is none
    integer, intent(in) :: piece
      !! turns that a thread takes at once, > 0; fewer if they are few
    integer :: part, n

    n = max(0, last - first + 1)
    self%parts = omp_get_max_threads()
    self%piece = max(1, min(piece, n/(16*self%parts)))
    if (allocated(self%last)) then
      if (size(self%last) /= self%parts) deallocate (self%last, self%next)
    end if
    if (.not. allocated(self%last)) allocate (self%last(self%parts), self%next(apart, self%parts))
    do part = 1, self%parts
      self%next(1, part) = first + int(int(n, i8)*(part - 1)/self%parts)
      self%last(part) = first + int(int(n, i8)*part/self%parts) - 1
    end do
  end subroutine begin

  !> Take turns: those of the thread's own part, then of the others'. `first` is above `last` if
  !> none is left.
  subroutine take(self, first, last)
    class(shares_type), intent(inout) :: self  !! begun
    integer, intent(out) :: first              !! first turn of the piece
    integer, intent(out) :: last               !! last turn of it
    integer :: own, i, part, piece

    piece = self%piece
    own = omp_get_thread_num()
    do i = 0, self%parts - 1
      part = 1 + mod(own + i, self%parts)
      !$omp atomic read
      first = self%next(1, part)
      if (first > self%last(part)) cycle
      !$omp atomic capture
      first = self%next(1, part)
      self%next(1, part) = self%next(1, part) + piece
      !$omp end atomic
      last = min(first + piece - 1, self%last(part))
      if (first <= last) return
    end do
    first = 1
    last = 0
  end subroutine take

end module pd_base_shares
