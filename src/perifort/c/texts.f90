!> Texts, pointers and arrays on their way from and to C.
module pd_c_texts
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_pointer, c_int64_t, &
    & c_null_char, c_ptr, c_size_t
  use pd_base_error, only: error_type, fail, status_usage
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text
  implicit none (type, external)
  private
  public :: c_text_type, put_text, text_from, put_pointer, hand_over, side_by_side

  !> A text for C, ended by a null character.
  type :: c_text_type
    character(kind=c_char), allocatable :: characters(:)
  end type c_text_type

  interface
    !> C: length of a text up to its null character.
    function c_strlen(text) bind(c, name='strlen') result(length)
      import :: c_ptr, c_size_t
      implicit none (type, external)
      type(c_ptr), value :: text
      integer(c_size_t) :: length
    end function c_strlen
  end interface

contains

  !> A text for C.
  subroutine put_text(text, holder)
    character(*), intent(in) :: text
    type(c_text_type), intent(inout) :: holder
    integer :: i

    if (allocated(holder%characters)) deallocate (holder%characters)
    allocate (holder%characters(len(text) + 1))
    do i = 1, len(text)
      holder%characters(i) = text(i:i)
    end do
    holder%characters(len(text) + 1) = c_null_char
  end subroutine put_text

  !> A text of C's.
  function text_from(place) result(text)
    type(c_ptr), intent(in) :: place   !! not NULL
    character(:), allocatable :: text
    character(kind=c_char), pointer :: characters(:)
    integer :: i, n

    n = int(c_strlen(place))
    call c_f_pointer(place, characters, [n])
    allocate (character(n) :: text)
    do i = 1, n
      text(i:i) = characters(i)
    end do
  end function text_from

  !> Put a pointer where the caller wants it; nowhere if that place is NULL.
  subroutine put_pointer(place, pointer)
    type(c_ptr), intent(in) :: place, pointer
    type(c_ptr), pointer :: there

    if (.not. c_associated(place)) return
    call c_f_pointer(place, there)
    there = pointer
  end subroutine put_pointer

  !> Values into the caller's room.
  subroutine hand_over(found, place, room, where, error)
    real(wp), intent(in) :: found(:)
    type(c_ptr), intent(in) :: place
    integer(c_int64_t), intent(in) :: room
    character(*), intent(in) :: where
    type(error_type), allocatable, intent(out) :: error
    real(c_double), pointer :: values(:)

    if (.not. c_associated(place)) then
      call fail(error, where//': the array for the values is NULL', status_usage)
    else if (room < size(found, kind=c_int64_t)) then
      call fail(error, where//': there are '//to_text(size(found))//' values, more than there '// &
        & 'is room for', status_usage)
    else
      call c_f_pointer(place, values, [size(found)])
      values = found
    end if
  end subroutine hand_over

  !> The components of each point side by side.
  pure function side_by_side(values) result(line)
    real(wp), intent(in) :: values(:, :)   !! (point, component)
    real(wp), allocatable :: line(:)
    line = [transpose(values)]
  end function side_by_side

end module pd_c_texts
