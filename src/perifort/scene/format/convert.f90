!> From the words of a scene file to the values of keys, checked against the allowed values.
!>
!> Every conversion gives back `message` and `note`: what was wrong and what was expected, both ''
!> if the value is good. The value is assigned only then.
module pd_scene_format_convert
  use pd_base_kinds, only: wp
  use pd_base_text, only: join, lower_case, nearest_name, to_text
  use pd_scene_format_source, only: token_type
  use pd_scene_format_values, only: parse_integer, parse_logical, parse_real, quoted_text
  implicit none (type, external)
  private
  public :: to_real, to_integer, to_logical, to_string, to_word, real_range, integer_range, &
    & unit_note

  character(*), parameter :: word_characters = &
    & 'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-'  !! of names

contains

  !> A real in `unit` within the open bounds `above`, `below` and the closed ones `at_least`,
  !> `at_most`.
  subroutine to_real(token, name, unit, value, message, note, above, below, at_least, at_most, &
    & tiny_is_zero)
    type(token_type), intent(in) :: token           !! the word with its place in the file
    character(*), intent(in) :: name                !! of the key, for the message
    character(*), intent(in) :: unit                !! SI symbol, for the note; '' or '-' for none
    real(wp), intent(inout) :: value                !! set if the word is good, else unchanged
    character(:), allocatable, intent(out) :: message  !! what was wrong; '' if the value is good
    character(:), allocatable, intent(out) :: note  !! what was expected; '' if the value is good
    real(wp), intent(in), optional :: above  !! the value must be larger; absent: no such bound
    real(wp), intent(in), optional :: below  !! the value must be smaller; absent: no such bound
    real(wp), intent(in), optional :: at_least      !! smallest value; absent: no such bound
    real(wp), intent(in), optional :: at_most       !! largest value; absent: no such bound
    logical, intent(in), optional :: tiny_is_zero  !! see `parse_real`
    real(wp) :: found
    logical :: inside

    message = ''
    call parse_real(token%text, found, note, tiny_is_zero)
    if (token%quoted) note = 'expected a number without quotes'
    if (len(note) > 0) then
      message = bad_value(token, name)
      note = note//unit_note(unit)
      return
    end if
    inside = .true.
    if (present(above)) inside = inside .and. found > above
    if (present(below)) inside = inside .and. found < below
    if (present(at_least)) inside = inside .and. found >= at_least
    if (present(at_most)) inside = inside .and. found <= at_most
    if (inside) then
      value = found
    else
      message = "'"//name//"' is out of range"
      note = 'expected '//real_range(above, below, at_least, at_most)//unit_note(unit)
    end if
  end subroutine to_real

  !> A whole number within closed bounds.
  subroutine to_integer(token, name, value, message, note, at_least, at_most)
    type(token_type), intent(in) :: token           !! the word with its place in the file
    character(*), intent(in) :: name                !! of the key, for the message
    integer, intent(inout) :: value                 !! set if the word is good, else unchanged
    character(:), allocatable, intent(out) :: message  !! what was wrong; '' if the value is good
    character(:), allocatable, intent(out) :: note  !! what was expected; '' if the value is good
    integer, intent(in), optional :: at_least       !! smallest value; absent: no such bound
    integer, intent(in), optional :: at_most        !! largest value; absent: no such bound
    integer :: found
    logical :: inside

    message = ''
    call parse_integer(token%text, found, note)
    if (token%quoted) note = 'expected a whole number without quotes'
    if (len(note) > 0) then
      message = bad_value(token, name)
      return
    end if
    inside = .true.
    if (present(at_least)) inside = inside .and. found >= at_least
    if (present(at_most)) inside = inside .and. found <= at_most
    if (inside) then
      value = found
    else
      message = "'"//name//"' is out of range"
      note = 'expected '//integer_range(at_least, at_most)
    end if
  end subroutine to_integer

  !> True or false.
  subroutine to_logical(token, name, value, message, note)
    type(token_type), intent(in) :: token           !! the word with its place in the file
    character(*), intent(in) :: name                !! of the key, for the message
    logical, intent(inout) :: value                 !! set if the word is good, else unchanged
    character(:), allocatable, intent(out) :: message  !! what was wrong; '' if the value is good
    character(:), allocatable, intent(out) :: note  !! what was expected; '' if the value is good
    logical :: found

    message = ''
    call parse_logical(token%text, found, note)
    if (token%quoted) note = 'expected .true. or .false. without quotes'
    if (len(note) > 0) then
      message = bad_value(token, name)
    else
      value = found
    end if
  end subroutine to_logical

  !> Any value as it is written, a text with its quotes.
  subroutine to_word(token, name, value, message, note)
    type(token_type), intent(in) :: token           !! the word with its place in the file
    character(*), intent(in) :: name                !! of the key, for the message
    ! allow(C072): a text is assigned only after its length has been checked.
    character(*), intent(inout) :: value            !! set if the word fits into it, else unchanged
    character(:), allocatable, intent(out) :: message  !! what was wrong; '' if the value is good
    character(:), allocatable, intent(out) :: note  !! what was expected; '' if the value is good
    character(:), allocatable :: word

    message = ''
    note = ''
    word = token%text
    if (token%quoted) word = quoted_text(word)
    if (len(word) <= len(value)) then
      value = word
    else
      message = "the text for key '"//name//"' is too long"
      note = to_text(len(word))//' characters, at most '//to_text(len(value))
    end if
  end subroutine to_word

  !> A text in quotes: one of `allowed` in any case, or, with `word`, a name that can stand in
  !> column headers. It must fit into `value`.
  subroutine to_string(token, name, value, message, note, allowed, word)
    type(token_type), intent(in) :: token             !! the word with its place in the file
    character(*), intent(in) :: name                  !! of the key, for the message
    ! allow(C072): a text is assigned only after its length has been checked.
    character(*), intent(inout) :: value              !! set if the text is good, else unchanged
    character(:), allocatable, intent(out) :: message  !! what was wrong; '' if the value is good
    character(:), allocatable, intent(out) :: note    !! what was expected; '' if the value is good
    character(*), intent(in), optional :: allowed(:)  !! (any number), the only values; absent: any
                                                      !! text
    logical, intent(in), optional :: word             !! letters, digits, _ and - only; absent: no
    character(:), allocatable :: nearest
    logical :: plain
    integer :: i

    message = ''
    note = ''
    plain = .false.
    if (present(word)) plain = word
    if (.not. token%quoted) then
      message = bad_value(token, name)
      note = "expected a text in quotes, such as '"//token%text//"'"
    else if (len_trim(token%text) == 0) then
      message = "empty text for key '"//name//"'"
      note = 'expected at least one character; leave the key out for its default'
    else if (len_trim(token%text) > len(value)) then
      message = "the text for key '"//name//"' is too long"
      note = to_text(len_trim(token%text))//' characters, at most '//to_text(len(value))
    else if (present(allowed)) then
      do i = 1, size(allowed)
        if (lower_case(trim(token%text)) /= lower_case(trim(allowed(i)))) cycle
        value = allowed(i)
        return
      end do
      message = "unknown value '"//token%text//"' of key '"//name//"'"
      note = 'allowed: '//join(allowed, ', ')
      nearest = nearest_name(token%text, allowed)
      if (len(nearest) > 0) note = "did you mean '"//nearest//"'?  "//note
    else if (plain .and. verify(trim(token%text), word_characters) > 0) then
      message = bad_value(token, name)
      note = 'names are made of letters, digits, _ and -'
    else
      value = token%text
    end if
  end subroutine to_string

  !> The first half of a message on a value.
  pure function bad_value(token, name) result(message)
    type(token_type), intent(in) :: token
    character(*), intent(in) :: name
    character(:), allocatable :: message
    message = "bad value '"//token%text//"' for key '"//name//"'"
  end function bad_value

  !> ` [Pa]`, or nothing without a unit.
  pure function unit_note(unit) result(note)
    character(*), intent(in) :: unit  !! SI symbol; '' or '-' for none
    character(:), allocatable :: note
    note = ''
    if (len(unit) > 0 .and. unit /= '-') note = ' ['//unit//']'
  end function unit_note

  !> Bounds of a real in words, '' without any.
  pure function real_range(above, below, at_least, at_most) result(range)
    real(wp), intent(in), optional :: above     !! the value must be larger; absent: no such bound
    real(wp), intent(in), optional :: below     !! the value must be smaller; absent: no such bound
    real(wp), intent(in), optional :: at_least  !! smallest value; absent: no such bound
    real(wp), intent(in), optional :: at_most   !! largest value; absent: no such bound
    character(:), allocatable :: range

    range = ''
    if (present(above)) range = '> '//to_text(above)
    if (present(at_least)) range = '>= '//to_text(at_least)
    if (len(range) > 0 .and. (present(below) .or. present(at_most))) range = range//' and '
    if (present(below)) range = range//'< '//to_text(below)
    if (present(at_most)) range = range//'<= '//to_text(at_most)
  end function real_range

  !> Bounds of a whole number in words, '' without any.
  pure function integer_range(at_least, at_most) result(range)
    integer, intent(in), optional :: at_least  !! smallest value; absent: no such bound
    integer, intent(in), optional :: at_most   !! largest value; absent: no such bound
    character(:), allocatable :: range

    range = ''
    if (present(at_least)) range = '>= '//to_text(at_least)
    if (present(at_least) .and. present(at_most)) range = range//' and '
    if (present(at_most)) range = range//'<= '//to_text(at_most)
  end function integer_range

end module pd_scene_format_convert
