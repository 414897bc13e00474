!> A checksum of bytes: the 64-bit cyclic redundancy check CRC-64/XZ (polynomial of ECMA-182, bits
!> reflected). It finds every change of up to 64 neighbouring bits, and any other but for one in
!> 2^64.
!>
!> Eight bytes are taken at a time, each through a table of its own ("slicing by 8").
module pd_base_checksum
  use pd_base_kinds, only: wp, i1, i8
  implicit none (type, external)
  private
  public :: checksum_type, parts_of, value_of

  integer(i8), parameter :: polynomial = not(int(z'3693A86A2878F0BD', i8))  ! C96C5795D7870F42
  integer(i8), parameter :: byte = 255_i8
  integer, parameter :: parts_in_number = 4, bits_of_part = 16
  integer(i8), parameter :: largest_part = 2_i8**bits_of_part - 1

  !> A checksum in progress.
  type :: checksum_type
    private
    integer(i8) :: state = -1_i8
    integer(i8), allocatable :: table(:, :)  !! (0:255, 0:7): a byte followed by so many others
  contains
    procedure :: add
    procedure :: value
    procedure :: begin_again
  end type checksum_type

contains

  !> Take in more bytes.
  pure subroutine add(self, bytes)
    class(checksum_type), intent(inout) :: self      !! the checksum; that of the bytes so far and
                                                     !! these on return
    integer(i1), contiguous, intent(in) :: bytes(:)  !! (any length), in the order in which they are
                                                     !! to be checked
    integer(i8) :: x, i, last

    if (.not. allocated(self%table)) call make_table(self)
    last = size(bytes, kind=i8)/8*8
    associate (t => self%table)
      do i = 1, last, 8
        x = ieor(self%state, transfer(bytes(i:i + 7), x))
        self%state = ieor(ieor(ieor(t(iand(x, byte), 7), t(iand(ishft(x, -8), byte), 6)), &
          & ieor(t(iand(ishft(x, -16), byte), 5), t(iand(ishft(x, -24), byte), 4))), &
          & ieor(ieor(t(iand(ishft(x, -32), byte), 3), t(iand(ishft(x, -40), byte), 2)), &
          & ieor(t(iand(ishft(x, -48), byte), 1), t(ishft(x, -56), 0))))
      end do
      do i = last + 1, size(bytes, kind=i8)
        x = iand(ieor(self%state, int(bytes(i), i8)), byte)
        self%state = ieor(t(x, 0), ishft(self%state, -8))
      end do
    end associate
  end subroutine add

  !> The checksum of all bytes so far.
  pure integer(i8) function value(self)
    class(checksum_type), intent(in) :: self  !! the checksum, which may go on
    value = not(self%state)
  end function value

  !> Forget the bytes so far.
  pure subroutine begin_again(self)
    class(checksum_type), intent(inout) :: self  !! the checksum, of no bytes on return
    self%state = -1_i8
  end subroutine begin_again

  !> A number in parts of 16 bits, whose sums over up to 2^37 numbers are exact as reals.
  pure function parts_of(number) result(parts)
    integer(i8), intent(in) :: number  !! any
    real(wp) :: parts(parts_in_number)
    integer :: i

    do i = 1, parts_in_number
      parts(i) = real(iand(ishft(number, -bits_of_part*(i - 1)), largest_part), wp)
    end do
  end function parts_of

  !> The sum of numbers, modulo 2^64, from the sums of their parts.
  pure integer(i8) function value_of(parts) result(number)
    real(wp), intent(in) :: parts(:)  !! (4) sums of `parts_of`, whole numbers from 0 to 2^53
    integer(i8) :: carried
    integer :: i

    number = 0_i8
    carried = 0_i8
    do i = 1, parts_in_number
      carried = carried + int(parts(i), i8)
      number = ior(number, ishft(iand(carried, largest_part), bits_of_part*(i - 1)))
      carried = ishft(carried, -bits_of_part)
    end do
  end function value_of

  pure subroutine make_table(self)
    class(checksum_type), intent(inout) :: self
    integer(i8) :: x, i
    integer :: bit, slice

    allocate (self%table(0:255, 0:7))
    do i = 0, 255
      x = i
      do bit = 1, 8
        x = ieor(ishft(x, -1), merge(polynomial, 0_i8, btest(x, 0)))
      end do
      self%table(i, 0) = x
    end do
    do slice = 1, 7
      do i = 0, 255
        x = self%table(i, slice - 1)
        self%table(i, slice) = ieor(self%table(iand(x, byte), 0), ishft(x, -8))
      end do
    end do
  end subroutine make_table

end module pd_base_checksum
