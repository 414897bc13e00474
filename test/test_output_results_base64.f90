!> Base64 against the vectors of RFC 4648, and in pieces of every length.
module test_output_results_base64
  use pd_base_kinds, only: i1
  use pd_output_results_base64, only: base64_encoder, base64_length
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_output_results_base64

contains

  subroutine collect_output_results_base64(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)

    testsuite = [ &
      & new_unittest('standard_vectors', standard_vectors), &
      & new_unittest('high_bytes', high_bytes), &
      & new_unittest('pieces', pieces) &
      & ]
  end subroutine collect_output_results_base64

  !> The text of `bytes`, given to the encoder `piece` bytes at a time.
  function encoded(bytes, piece) result(text)
    integer(i1), contiguous, intent(in) :: bytes(:)
    integer, intent(in) :: piece
    character(:), allocatable :: text
    type(base64_encoder) :: encoder
    character(:), allocatable :: buffer
    integer :: first, length

    allocate (character(base64_length(piece)) :: buffer)
    text = ''
    do first = 1, size(bytes), piece
      call encoder%put(bytes(first:min(size(bytes), first + piece - 1)), buffer, length)
      text = text//buffer(:length)
    end do
    call encoder%finish(buffer, length)
    text = text//buffer(:length)
  end function encoded

  subroutine standard_vectors(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: plain = 'foobar'
    character(8), parameter :: expected(0:6) = [character(8) :: '', 'Zg==', 'Zm8=', 'Zm9v', &
      & 'Zm9vYg==', 'Zm9vYmE=', 'Zm9vYmFy']
    integer :: n, i

    do n = 0, len(plain)
      call check(error, encoded([(int(iachar(plain(i:i)), i1), i=1, n)], 6), trim(expected(n)))
      if (allocated(error)) return
    end do
  end subroutine standard_vectors

  subroutine high_bytes(error)
    type(error_type), allocatable, intent(out) :: error

    ! 0xff 0xef 0xbe 0x80, as signed bytes
    call check(error, encoded([-1_i1, -17_i1, -66_i1, -127_i1 - 1_i1], 4), '/+++gA==')
  end subroutine high_bytes

  subroutine pieces(error)
    type(error_type), allocatable, intent(out) :: error
    integer(i1), allocatable :: bytes(:)
    character(:), allocatable :: whole
    integer :: i, piece

    allocate (bytes(100))
    bytes(:) = [(int(mod(37*i, 256) - 128, i1), i=1, 100)]
    whole = encoded(bytes, 100)
    call check(error, len(whole), 136)
    do piece = 1, 99
      if (allocated(error)) return
      call check(error, encoded(bytes, piece) == whole, 'pieces of another length differ')
    end do
  end subroutine pieces

end module test_output_results_base64
