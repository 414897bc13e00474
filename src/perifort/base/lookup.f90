!> A table from 64-bit keys to numbers 1, 2, 3, ... in the order of their first appearance, and the
!> mixing of values into such keys. Different values may have the same key, if hardly ever: who asks
!> compares the values with those that had the key first, and takes a number of their own if they
!> differ.
module pd_base_lookup
  use pd_base_kinds, only: i4, i8
  implicit none (type, external)
  private
  public :: lookup_type, mix

  type :: lookup_type
    integer :: count = 0
    integer(i8), allocatable :: keys(:)     !! open addressing; the size is a power of two
    integer(i4), allocatable :: numbers(:)  !! 0: the place is empty
  contains
    procedure :: number_of
    procedure :: look
    procedure :: own_number
  end type lookup_type

contains

  !> `key` with one more value mixed in, all of its 64 bits. Rotation and exclusive or cannot
  !> overflow; products of 22 bits with a factor of 40 spread the value without overflow either.
  !> Turned by 22 bits each, one goes on where the one before ends: no bit stands for another.
  elemental integer(i8) function mix(key, value)
    integer(i8), intent(in) :: key    !! of the values mixed in so far; any number to begin with
    integer(i8), intent(in) :: value  !! to be mixed in
    integer(i8), parameter :: spread = 679535556991_i8  ! 2^40 over the golden ratio, odd
    integer(i8), parameter :: low = 4194303_i8          ! 22 bits

    mix = ieor(ishftc(key, 23), iand(value, low)*spread)
    mix = ieor(mix, ishftc(iand(ishft(value, -22), low)*spread, 22))
    mix = ieor(mix, ishftc(iand(ishft(value, -44), low)*spread, 44))
    mix = ieor(mix, ishftc(iand(mix, low)*spread, 29))
  end function mix

  !> The number of `key`; a new key gets the next one.
  subroutine number_of(table, key, number, is_new)
    class(lookup_type), intent(inout) :: table  !! a new key is added to it
    integer(i8), intent(in) :: key              !! to be looked up
    integer, intent(out) :: number  !! of the key: 1, 2, 3, ... in the order of first appearance
    logical, intent(out) :: is_new              !! whether the key was not in the table before
    integer :: at

    if (.not. allocated(table%keys)) then
      allocate (table%keys(1024), table%numbers(1024))
      table%numbers = 0_i4
    end if
    if (2*table%count >= size(table%keys)) call grow(table)
    at = place(table, key)
    is_new = table%numbers(at) == 0_i4
    if (is_new) then
      table%count = table%count + 1
      table%keys(at) = key
      table%numbers(at) = int(table%count, i4)
    end if
    number = table%numbers(at)
  end subroutine number_of

  !> The number of `key`, 0 if it is not in the table.
  pure integer function look(table, key) result(number)
    class(lookup_type), intent(in) :: table  !! left as it is
    integer(i8), intent(in) :: key           !! to be looked up

    number = 0
    if (allocated(table%keys)) number = table%numbers(place(table, key))
  end function look

  !> The next number, for values whose key belongs to others: no key leads to it.
  subroutine own_number(table, number)
    class(lookup_type), intent(inout) :: table  !! counts one number more
    integer, intent(out) :: number              !! the next one, which no key has
    table%count = table%count + 1
    number = table%count
  end subroutine own_number

  !> Index at which `key` is or would be stored.
  pure integer function place(table, key) result(at)
    type(lookup_type), intent(in) :: table
    integer(i8), intent(in) :: key

    at = int(iand(ieor(key, ishft(key, -32)), int(size(table%keys) - 1, i8))) + 1
    do while (table%numbers(at) /= 0_i4)
      if (table%keys(at) == key) return
      at = iand(at, size(table%keys) - 1) + 1
    end do
  end function place

  !> Twice the room.
  pure subroutine grow(table)
    type(lookup_type), intent(inout) :: table
    type(lookup_type) :: larger
    integer :: i, at

    allocate (larger%keys(2*size(table%keys)), larger%numbers(2*size(table%keys)))
    larger%numbers = 0_i4
    do i = 1, size(table%keys)
      if (table%numbers(i) == 0_i4) cycle
      at = place(larger, table%keys(i))
      larger%keys(at) = table%keys(i)
      larger%numbers(at) = table%numbers(i)
    end do
    call move_alloc(larger%keys, table%keys)
    call move_alloc(larger%numbers, table%numbers)
  end subroutine grow

end module pd_base_lookup
