!> Widths that data and loops share: how many points a loop over bonds takes at a time, and how many
!> bonds one word of bits holds.
module pd_base_lanes
  implicit none (type, external)
  private
  public :: lanes, word_bits

  integer, parameter :: lanes = 8        !! a 512-bit register of reals: a block or half of it
  integer, parameter :: word_bits = 64   !! bonds in one word of bits

end module pd_base_lanes
