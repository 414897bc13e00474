!> A loop's turns shared out to threads: each is taken once, and first by its own thread.
module test_base_shares
  use omp_lib, only: omp_get_max_threads, omp_get_thread_num, omp_set_num_threads
  use pd_base_shares, only: shares_type
  use bodies, only: expect_true
  use testdrive, only: error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_base_shares

contains

  subroutine collect_base_shares(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('every turn is taken once', test_once), &
      & new_unittest('one thread takes what the others leave', test_left), &
      & new_unittest('a thread begins with its own part', test_own)]
  end subroutine collect_base_shares

  !> Every turn is taken by one thread, whatever the number of threads, turns and pieces; the same
  !> shares may be begun again, with other threads.
  subroutine test_once(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: threads(4) = [1, 2, 3, 7], turns(7) = [0, 1, 2, 6, 31, 1000, 12345], &
      & pieces(3) = [1, 32, 100000], before = 5
    type(shares_type) :: shares
    integer, allocatable :: taken(:)
    integer :: i, j, k, t, first, last, threads_of_caller

    threads_of_caller = omp_get_max_threads()
    do i = 1, size(threads)
      call omp_set_num_threads(threads(i))
      do j = 1, size(turns)
        do k = 1, size(pieces)
          allocate (taken(before + turns(j) + before), source=0)
          call shares%begin(before + 1, before + turns(j), pieces(k))
          !$omp parallel default(none) shared(shares, taken) private(first, last, t)
          do
            call shares%take(first, last)
            if (first > last) exit
            do t = first, last
              !$omp atomic
              taken(t) = taken(t) + 1
            end do
          end do
          !$omp end parallel
          call expect_true(error, all(taken(before + 1:before + turns(j)) == 1), &
            & 'a turn was not taken once')
          if (.not. allocated(error)) call expect_true(error, sum(taken) == turns(j), &
            & 'turns were taken that there are not')
          deallocate (taken)
          if (allocated(error)) exit
        end do
      end do
    end do
    call omp_set_num_threads(threads_of_caller)
  end subroutine test_once

  !> One thread alone takes all parts, its own first, in pieces no longer than asked for.
  subroutine test_left(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 4000, piece = 32
    type(shares_type) :: shares
    logical :: taken(n)
    integer :: first, last, longest, threads_of_caller

    threads_of_caller = omp_get_max_threads()
    call omp_set_num_threads(4)
    call shares%begin(1, n, piece)
    call omp_set_num_threads(threads_of_caller)
    taken = .false.
    longest = 0
    do
      call shares%take(first, last)
      if (first > last) exit
      call expect_true(error, .not. any(taken(first:last)), 'a turn was taken twice')
      if (allocated(error)) return
      taken(first:last) = .true.
      longest = max(longest, last - first + 1)
    end do
    call expect_true(error, all(taken), 'a turn was left')
    if (allocated(error)) return
    call expect_true(error, longest == piece, 'a piece has another length')
  end subroutine test_left

  !> What each of three threads takes first lies in its own third.
  subroutine test_own(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 3000
    type(shares_type) :: shares
    integer :: begun(3), first, last, me, threads_of_caller

    threads_of_caller = omp_get_max_threads()
    call omp_set_num_threads(3)
    call shares%begin(1, n, 8)
    begun = 0
    !$omp parallel default(none) shared(shares, begun) private(first, last, me)
    me = omp_get_thread_num() + 1
    call shares%take(first, last)
    begun(me) = first
    !$omp end parallel
    call omp_set_num_threads(threads_of_caller)
    call expect_true(error, all(begun == [1, 1001, 2001]), 'a thread began in another part')
  end subroutine test_own

end module test_base_shares
