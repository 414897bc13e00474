!> Single values: from the words of a scene file to numbers, and back to words.
!>
!> A word's form is checked first, because list-directed reads accept too much (`5abc/`, `NaN`,
!> `yes`); the runtime then does the conversion.
module pd_scene_format_values
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use pd_base_kinds, only: wp
  use pd_base_text, only: lower_case, to_text
  implicit none (type, external)
  private
  public :: parse_real, parse_integer, parse_logical, exact_text, quoted_text, list_text, &
    & vector_text
  public :: largest_real

  character(*), parameter :: digits = '0123456789'
  integer, parameter :: largest_power = 300     !! that is surely read without overflow
  !> Sizes beyond 1e-30 .. 1e30 stand for nothing in SI units, and products of a few powers of
  !> smaller ones, such as E/delta^4 and its square, stay finite.
  integer, parameter :: largest_exponent = 30

  real(wp), parameter :: largest_real = 10.0_wp**largest_exponent  !! largest size of a value

  !> Values as they stand after a key, parted by commas.
  interface list_text
    module procedure :: reals_text, integers_text, texts_text
  end interface list_text

contains

  !> A finite real; `note` says what was expected if the word is not one, else it is ''.
  subroutine parse_real(word, value, note, tiny_is_zero)
    character(*), intent(in) :: word                !! without blanks
    real(wp), intent(out) :: value                  !! to be used only if `note` is ''
    character(:), allocatable, intent(out) :: note  !! what was expected; '' if the word is good
    logical, intent(in), optional :: tiny_is_zero  !! read sizes below 1/largest_real as 0, as
                                                   !! computed tables have them, instead of
                                                   !! refusing them (default)
    logical :: zero
    integer :: i, whole, exponent, status, mark
    character(:), allocatable :: text

    zero = .false.
    if (present(tiny_is_zero)) zero = tiny_is_zero
    value = 0.0_wp
    note = 'expected a number'
    text = lower_case(word)
    i = 1
    if (scan(text(:min(1, len(text))), '+-') == 1) i = 2
    if (index(text(i:), 'nan') == 1 .or. index(text(i:), 'inf') == 1) then
      note = 'expected a finite number'
      return
    end if
    mark = scan(text, 'ed')
    if (mark == 0) mark = len(text) + 1
    if (scan(text(:mark - 1), digits) == 0) return
    if (verify(text(i:mark - 1), digits//'.') /= 0) return
    whole = index(text(i:mark - 1), '.')
    if (whole /= index(text(i:mark - 1), '.', back=.true.)) return
    whole = merge(mark - i, whole - 1, whole == 0)
    exponent = 0
    if (mark <= len(text)) then
      i = mark + 1
      if (scan(text(i:min(i, len(text))), '+-') == 1) i = i + 1
      if (i > len(text)) return
      if (verify(text(i:), digits) /= 0) return
      if (len(text) - i > 6) then
        note = out_of_range()
        if (zero .and. text(mark + 1:mark + 1) == '-') note = ''
        return
      end if
      read (text(mark + 1:), *, iostat=status) exponent
      if (status /= 0) return
    end if
    ! A read of 1e999 would raise an overflow, which a build with traps turns into a crash.
    if (abs(exponent + whole) > largest_power .and. scan(text(:mark - 1), '123456789') > 0) then
      note = out_of_range()
      if (zero .and. exponent < 0) note = ''
      return
    end if
    read (word, *, iostat=status) value
    if (status /= 0) return
    note = ''
    if (abs(value)*largest_real < 0.999_wp) then
      if (abs(value) > 0.0_wp .and. .not. zero) note = out_of_range()
      if (zero) value = 0.0_wp
    else if (abs(value) > largest_real) then
      note = out_of_range()
    end if
  end subroutine parse_real

  !> What is said of a real too large or too small to compute with.
  pure function out_of_range() result(note)
    character(:), allocatable :: note
    note = 'expected a size between 1e-'//to_text(largest_exponent)//' and 1e'// &
      & to_text(largest_exponent)
  end function out_of_range

  !> A whole number; `note` says what was expected if the word is not one, else it is ''.
  subroutine parse_integer(word, value, note)
    character(*), intent(in) :: word                !! without blanks
    integer, intent(out) :: value                   !! to be used only if `note` is ''
    character(:), allocatable, intent(out) :: note  !! what was expected; '' if the word is good
    integer :: first, status

    value = 0
    note = 'expected a whole number'
    first = 1
    if (scan(word(:min(1, len(word))), '+-') == 1) first = 2
    if (first > len(word)) return
    if (verify(word(first:), digits) /= 0) return
    read (word, *, iostat=status) value
    if (status /= 0) then
      note = 'expected a whole number of at most '//to_text(huge(value))
      return
    end if
    note = ''
  end subroutine parse_integer

  !> True or false; `note` says what was expected if the word is neither, else it is ''.
  subroutine parse_logical(word, value, note)
    character(*), intent(in) :: word                !! without blanks
    logical, intent(out) :: value                   !! to be used only if `note` is ''
    character(:), allocatable, intent(out) :: note  !! what was expected; '' if the word is good

    note = ''
    value = .false.
    select case (lower_case(word))
    case ('.true.', 'true', 't', '.t.')
      value = .true.
    case ('.false.', 'false', 'f', '.f.')
      value = .false.
    case default  ! neither: the note says so to the caller
      note = 'expected .true. or .false.'
    end select
  end subroutine parse_logical

  !> The shortest decimal that reads back to the very same bits.
  function exact_text(value) result(text)
    real(wp), intent(in) :: value  !! finite
    character(:), allocatable :: text
    integer :: n, status
    real(wp) :: back

    ! NaN and infinity are written as such, and are refused when read
    if (ieee_is_nan(value)) then
      text = 'NaN'
      return
    else if (abs(value) > huge(value)) then
      text = trim(merge('-Infinity', 'Infinity ', value < 0.0_wp))
      return
    end if
    do n = 6, 17
      text = to_text(value, n)
      read (text, *, iostat=status) back
      if (status == 0 .and. abs(back - value) <= 0.0_wp) exit
    end do
    if (scan(text, '.e') == 0) text = text//'.0'
  end function exact_text

  !> A text in single quotes, quotes inside it doubled.
  pure function quoted_text(text) result(quoted)
    character(*), intent(in) :: text  !! any characters
    character(:), allocatable :: quoted
    integer :: i

    quoted = "'"
    do i = 1, len(text)
      quoted = quoted//text(i:i)
      if (text(i:i) == "'") quoted = quoted//"'"
    end do
    quoted = quoted//"'"
  end function quoted_text

  !> Reals parted by commas.
  function reals_text(values) result(text)
    real(wp), intent(in) :: values(:)  !! (any number), finite
    character(:), allocatable :: text
    integer :: i

    text = ''
    do i = 1, size(values)
      if (i > 1) text = text//', '
      text = text//exact_text(values(i))
    end do
  end function reals_text

  !> Whole numbers parted by commas.
  pure function integers_text(values) result(text)
    integer, intent(in) :: values(:)  !! (any number)
    character(:), allocatable :: text
    integer :: i

    text = ''
    do i = 1, size(values)
      if (i > 1) text = text//', '
      text = text//to_text(values(i))
    end do
  end function integers_text

  !> The given elements of a vector as they stand behind its key and a `=`. Where there is a gap the
  !> elements are spelled one by one, the first without the key's own name.
  function vector_text(name, values, given) result(text)
    character(*), intent(in) :: name   !! of the key
    real(wp), intent(in) :: values(:)  !! (n), finite where given
    logical, intent(in) :: given(:)    !! (n), whether the element is to be written
    character(:), allocatable :: text
    integer :: i

    if (all(given(:count(given)))) then
      text = list_text(values(:count(given)))
      return
    end if
    text = ''
    do i = 1, size(values)
      if (.not. given(i)) cycle
      if (len(text) > 0) text = text//', '
      text = text//name//'('//to_text(i)//') = '//exact_text(values(i))
    end do
    text = text(len(name) + 1:)
  end function vector_text

  !> Quoted texts parted by commas.
  pure function texts_text(values) result(text)
    character(*), intent(in) :: values(:)  !! (any number); blanks at their ends are cut
    character(:), allocatable :: text
    integer :: i

    text = ''
    do i = 1, size(values)
      if (i > 1) text = text//', '
      text = text//quoted_text(trim(values(i)))
    end do
  end function texts_text

end module pd_scene_format_values
