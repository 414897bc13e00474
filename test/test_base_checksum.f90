!> The checksum, against its published value and against itself in pieces.
module test_base_checksum
  use pd_base_checksum, only: checksum_type
  use pd_base_kinds, only: i1, i8
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_base_checksum

contains

  subroutine collect_base_checksum(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('the published value', test_published), &
      & new_unittest('in pieces as at once', test_pieces)]
  end subroutine collect_base_checksum

  !> The catalogue of CRC algorithms gives 995DC9BBDF1939FA for the nine digits 1 to 9.
  subroutine test_published(error)
    type(error_type), allocatable, intent(out) :: error
    type(checksum_type) :: checksum
    character(16) :: text

    call checksum%add([49_i1, 50_i1, 51_i1, 52_i1, 53_i1, 54_i1, 55_i1, 56_i1, 57_i1])
    write (text, '(z16.16)') checksum%value()
    call check(error, text, '995DC9BBDF1939FA')
  end subroutine test_published

  !> However bytes are dealt out, and the order of bytes counts.
  subroutine test_pieces(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 1000
    type(checksum_type) :: whole, parts, swapped
    integer(i1) :: bytes(n)
    integer :: i, at

    do i = 1, n
      bytes(i) = int(mod(37*i + i*i/7, 251) - 125, i1)
    end do
    call whole%add(bytes)
    at = 0
    i = 1
    do while (at < n)
      call parts%add(bytes(at + 1:min(n, at + i)))
      at = at + i
      i = mod(3*i + 1, 29)
    end do
    call check(error, whole%value() == parts%value(), 'pieces')
    if (allocated(error)) return
    bytes([500, 501]) = bytes([501, 500])
    call swapped%add(bytes)
    call check(error, whole%value() /= swapped%value(), 'two bytes exchanged')
  end subroutine test_pieces

end module test_base_checksum
