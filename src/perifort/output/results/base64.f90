!> Base64 (RFC 4648): bytes as text, piece by piece.
module pd_output_results_base64
  use pd_base_kinds, only: i1
  implicit none (type, external)
  private
  public :: base64_encoder, base64_length

  character(*), parameter :: alphabet = &
    & 'ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/'

  !> An encoder for one run of bytes that arrives in pieces of any length.
  type :: base64_encoder
    private
    integer(i1) :: carry(3) = 0_i1         !! bytes that wait for the rest of their three
    integer :: carried = 0
    character(2), allocatable :: pairs(:)  !! letters of twelve bits; a look-up for two letters
  contains
    procedure :: put
    procedure :: finish
  end type base64_encoder

contains

  !> The longest text that `put` makes of so many bytes, or `finish` of none.
  pure integer function base64_length(bytes)
    integer, intent(in) :: bytes  !! how many are given to `put`
    base64_length = 4*((bytes + 2)/3 + 1)
  end function base64_length

  !> Encode `bytes` into `text(:length)`; up to two bytes are kept for the next call.
  !> `text` has at least `base64_length(size(bytes))` characters.
  subroutine put(self, bytes, text, length)
    class(base64_encoder), intent(inout) :: self      !! the encoder, with up to two bytes of its
                                                      !! run that wait
    integer(i1), contiguous, intent(in) :: bytes(:)   !! (any length), the next ones of the run
    character(:), allocatable, intent(inout) :: text  !! room for the letters; the first `length`
                                                      !! are set
    integer, intent(out) :: length                    !! letters made: a multiple of 4
    integer :: i, first, bits

    if (.not. allocated(self%pairs)) call make_pairs(self)
    length = 0
    first = 1
    if (self%carried > 0) then
      do while (self%carried < 3 .and. first <= size(bytes))
        self%carried = self%carried + 1
        self%carry(self%carried) = bytes(first)
        first = first + 1
      end do
      if (self%carried < 3) return
      bits = three(self%carry(1), self%carry(2), self%carry(3))
      text(1:4) = self%pairs(ishft(bits, -12))//self%pairs(iand(bits, 4095))
      length = 4
      self%carried = 0
    end if
    do i = first, size(bytes) - 2, 3
      bits = three(bytes(i), bytes(i + 1), bytes(i + 2))
      text(length + 1:length + 2) = self%pairs(ishft(bits, -12))
      text(length + 3:length + 4) = self%pairs(iand(bits, 4095))
      length = length + 4
    end do
    self%carried = mod(size(bytes) - first + 1, 3)
    do i = 1, self%carried
      self%carry(i) = bytes(size(bytes) - self%carried + i)
    end do
  end subroutine put

  !> Encode what is left into `text(:length)`, padded with `=`, and be ready for another run.
  subroutine finish(self, text, length)
    class(base64_encoder), intent(inout) :: self      !! the encoder, with up to two bytes of its
                                                      !! run that wait
    character(:), allocatable, intent(inout) :: text  !! room for 4 letters; the first `length` are
                                                      !! set
    integer, intent(out) :: length                    !! letters made: 0 or 4
    integer :: bits

    length = 0
    if (self%carried == 0) return
    if (self%carried == 1) self%carry(2) = 0_i1
    bits = three(self%carry(1), self%carry(2), 0_i1)
    text(1:4) = self%pairs(ishft(bits, -12))//self%pairs(iand(bits, 4095))
    text(4:4) = '='
    if (self%carried == 1) text(3:3) = '='
    length = 4
    self%carried = 0
  end subroutine finish

  !> Three bytes as 24 bits.
  elemental integer function three(a, b, c)
    integer(i1), intent(in) :: a, b, c
    three = ior(ior(ishft(iand(int(a), 255), 16), ishft(iand(int(b), 255), 8)), iand(int(c), 255))
  end function three

  subroutine make_pairs(self)
    class(base64_encoder), intent(inout) :: self
    integer :: i, high, low

    allocate (self%pairs(0:4095))
    do i = 0, 4095
      high = i/64 + 1
      low = mod(i, 64) + 1
      self%pairs(i) = alphabet(high:high)//alphabet(low:low)
    end do
  end subroutine make_pairs

end module pd_output_results_base64
