!> Numbers for keys, and keys from values.
module test_base_lookup
  use pd_base_kinds, only: wp, i8
  use pd_base_lookup, only: lookup_type, mix
  use testdrive, only: check, error_type, new_unittest, unittest_type
  use bodies, only: expect_true
  implicit none (type, external)
  private
  public :: collect_base_lookup

contains

  subroutine collect_base_lookup(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('numbers come in the order of first appearance', test_order), &
      & new_unittest('numbers stay while the table grows', test_growth), &
      & new_unittest('every bit of a value changes the key', test_bits), &
      & new_unittest('the order of values changes the key', test_sequence), &
      & new_unittest('keys of neighbouring values are spread', test_spread)]
  end subroutine collect_base_lookup

  subroutine test_order(error)
    type(error_type), allocatable, intent(out) :: error
    integer(i8), parameter :: keys(*) = [7_i8, -3_i8, 7_i8, 0_i8, huge(0_i8), -3_i8, 0_i8, 8_i8, &
      & -huge(0_i8), 7_i8]
    integer, parameter :: expected(*) = [1, 2, 1, 3, 4, 2, 3, 5, 6, 1]
    logical, parameter :: first_time(*) = [.true., .true., .false., .true., .true., .false., &
      & .false., .true., .true., .false.]
    type(lookup_type) :: table
    integer :: i, number
    logical :: is_new

    call check(error, table%count, 0)
    do i = 1, size(keys)
      if (allocated(error)) return
      call table%number_of(keys(i), number, is_new)
      call check(error, number, expected(i), 'number of a key')
      call expect_true(error, is_new .eqv. first_time(i), 'whether a key is new')
    end do
    if (allocated(error)) return
    call check(error, table%count, 6, 'keys counted')
  end subroutine test_order

  !> Many times the room there is at first, with keys as they are made and with plain ones.
  subroutine test_growth(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 200000
    type(lookup_type) :: table
    integer :: pass, i, number
    logical :: is_new

    do pass = 1, 2
      do i = 1, n
        if (mod(i, 2) == 0) then
          call table%number_of(int(i, i8), number, is_new)
        else
          call table%number_of(mix(17_i8, int(i, i8)), number, is_new)
        end if
        if (number == i .and. (is_new .eqv. pass == 1)) cycle
        call check(error, number, i, 'number of a key')
        call expect_true(error, .false., 'an old key is new, or a new one old')
        return
      end do
    end do
    call check(error, table%count, n, 'keys counted')
  end subroutine test_growth

  !> Bits of a value say which neighbours are there, so none may be lost, the sign's neither, and no
  !> two or three may stand for others: all values that differ from one in up to three bits have
  !> keys of their own.
  subroutine test_bits(error)
    type(error_type), allocatable, intent(out) :: error
    integer(i8), parameter :: before(*) = [0_i8, -1_i8, 123456789012345_i8]
    integer(i8), parameter :: values(*) = [0_i8, -1_i8, 81985529216486895_i8]
    type(lookup_type) :: table
    integer :: b, v, i, j, k, tried

    do b = 1, size(before)
      do v = 1, size(values)
        table = lookup_type()
        tried = 0
        call try(0_i8)
        do i = 0, 63
          call try(ibset(0_i8, i))
          do j = 0, i - 1
            call try(ibset(ibset(0_i8, i), j))
            do k = 0, j - 1
              call try(ibset(ibset(ibset(0_i8, i), j), k))
            end do
          end do
        end do
        call check(error, table%count, tried, 'different keys')
        if (allocated(error)) return
      end do
    end do

  contains

    !> Number the key of the value with some bits changed.
    subroutine try(bits)
      integer(i8), intent(in) :: bits
      integer :: number
      logical :: is_new
      call table%number_of(mix(before(b), ieor(values(v), bits)), number, is_new)
      tried = tried + 1
    end subroutine try
  end subroutine test_bits

  subroutine test_sequence(error)
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: i, j

    do i = 0, 60
      do j = 0, i - 1
        call expect_true(error, mix(mix(1_i8, i), j) /= mix(mix(1_i8, j), i), &
          & 'the order of two values does not count')
      end do
    end do
  end subroutine test_sequence

  !> Three small values, as classes of slots are: all keys differ, and by the bits that choose their
  !> place they fall into 1024 drawers of 64 each. Were they thrown at random, 8 more or fewer would
  !> be one standard deviation; six of them happen once in some 10^6 tables.
  subroutine test_spread(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: drawers = 1024
    type(lookup_type) :: table
    integer :: i, j, k, number, filled(0:drawers - 1), at
    integer(i8) :: key
    logical :: is_new

    filled = 0
    do i = 0, 15
      do j = 0, 63
        do k = 0, 63
          key = mix(mix(mix(0_i8, int(i, i8)), int(j, i8)), int(k, i8))
          call table%number_of(key, number, is_new)
          at = int(iand(ieor(key, ishft(key, -32)), int(drawers - 1, i8)))
          filled(at) = filled(at) + 1
        end do
      end do
    end do
    call check(error, table%count, 16*64*64, 'different keys')
    if (allocated(error)) return
    call expect_true(error, maxval(filled) <= 64 + 48, 'keys crowd in few places')
    call expect_true(error, sum((real(filled, wp) - 64)**2)/drawers < 2*64.0_wp, &
      & 'keys are uneven')
  end subroutine test_spread

end module test_base_lookup
