!> The visitor behind every key: one declaration of a key reads it, checks it, describes it and
!> writes it.
!>
!> A group's declaration calls `key`, `list` or `triple` once per key. What the call does depends
!> on the mode: reading assigns what the file gives; describing notes name, type, unit, meaning,
!> allowed values and the default, which is the component's own initial value; writing puts the
!> present value down as namelist text; a template does so with comments.
module pd_scene_format_keys
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type
  use pd_base_text, only: join, lower_case, nearest_name, to_text
  use pd_scene_format_convert, only: to_real, to_integer, to_logical, to_string, to_word, &
    & real_range, integer_range, unit_note
  use pd_scene_format_elements, only: find_elements, growing
  use pd_scene_format_source, only: source_type, source_fault
  use pd_scene_format_given, only: is_set, name_length, unset
  use pd_scene_format_values, only: exact_text, list_text, quoted_text, vector_text
  implicit none (type, external)
  private
  public :: keys_type, key_info, mode_read, mode_describe, mode_write, real_or_expression

  !> Kind of a key that may be a number or an expression.
  character(*), parameter :: real_or_expression = 'real or expression'

  enum, bind(c)
    enumerator :: mode_read, mode_describe, mode_write
  end enum

  !> What is known of one key.
  type :: key_info
    character(:), allocatable :: name
    character(:), allocatable :: kind     !! 'real', 'integer(3)', 'text list', ...
    character(:), allocatable :: unit     !! '' = none
    character(:), allocatable :: meaning
    character(:), allocatable :: default  !! as text
    character(:), allocatable :: allowed  !! values or range, '' = any
    character(:), allocatable :: value    !! the present value as namelist text, '' = not given
  end type key_info

  !> The visitor.
  type :: keys_type
    integer :: mode = mode_describe
    type(source_type), pointer :: source => null()  !! reading: the scanned file
    integer :: section = 0                          !! reading: the group's number in it
    type(key_info), allocatable :: known(:)         !! every key visited so far
    integer :: count = 0
    type(error_type), allocatable :: fault          !! reading: the first faulty value
    type(error_type), allocatable :: missing        !! reading: the first missing key
    logical, allocatable :: used(:)                 !! reading: entries that a key has taken
    character(name_length), allocatable :: fields(:)  !! describing: those of the output
  contains
    procedure :: describe_fields
    procedure :: field_names
    procedure :: start
    procedure :: start_reading
    procedure :: finish_reading
    procedure :: triple
    procedure :: words
    procedure, private :: text_key, integer_key, real_key, logical_key
    procedure, private :: integers_key, reals_key, matrix_key
    procedure, private :: real_list, text_list
    generic :: key => text_key, integer_key, real_key, logical_key, integers_key, reals_key, &
      & matrix_key
    generic :: list => real_list, text_list
    procedure, private :: note_key, complain, note_missing, find
  end type keys_type

contains

  !> Begin a group in a mode that needs no file.
  subroutine start(keys, mode)
    class(keys_type), intent(inout) :: keys  !! the visitor, without a key on return
    integer, intent(in) :: mode              !! `mode_describe` or `mode_write`; `mode_read` needs
                                             !! `start_reading`

    keys%mode = mode
    keys%count = 0
    if (allocated(keys%known)) deallocate (keys%known)
    allocate (keys%known(24))
  end subroutine start

  !> Let descriptions list the fields of the output, which the scene does not know by itself.
  pure subroutine describe_fields(keys, names)
    class(keys_type), intent(inout) :: keys  !! the visitor, with these names on return
    character(*), intent(in) :: names(:)
      !! (any number) of the fields of the output; unless told, descriptions list none

    allocate (keys%fields(size(names)))
    keys%fields(:) = names
  end subroutine describe_fields

  !> Names of the fields of the output, none if they are not known.
  pure function field_names(keys) result(names)
    class(keys_type), intent(in) :: keys  !! the visitor
    character(name_length), allocatable :: names(:)

    allocate (names(0))
    if (allocated(keys%fields)) names = keys%fields
  end function field_names

  !> Begin to read group number `section` of a scanned file.
  subroutine start_reading(keys, source, section)
    class(keys_type), intent(inout) :: keys  !! the visitor, without a key or an error on return
    type(source_type), intent(in), target :: source  !! the scanned file; it must stay in its place
                                                     !! until the group is read
    integer, intent(in) :: section                   !! number of the group in it

    call keys%start(mode_read)
    keys%source => source
    keys%section = section
    if (allocated(keys%fault)) deallocate (keys%fault)
    if (allocated(keys%missing)) deallocate (keys%missing)
    if (allocated(keys%used)) deallocate (keys%used)
    allocate (keys%used(source%entry_count), source=.false.)
  end subroutine start_reading

  !> After the last key: the error of an unknown key first, then of a faulty value, then of a
  !> missing key.
  subroutine finish_reading(keys, error)
    class(keys_type), intent(inout) :: keys  !! the visitor after the last key; keeps no error
    type(error_type), allocatable, intent(out) :: error
    character(64), allocatable :: names(:)
    character(:), allocatable :: nearest, note
    integer :: e, i

    allocate (names(keys%count))
    do i = 1, keys%count
      names(i) = keys%known(i)%name
    end do
    associate (group => keys%source%sections(keys%section))
      do e = group%first, group%last
        if (keys%used(e)) cycle
        nearest = nearest_name(keys%source%entries(e)%key, names)
        note = 'known: '//join(names, ', ')
        if (len(nearest) > 0) note = "did you mean '"//nearest//"'?  "//note
        call source_fault(keys%source, keys%source%entries(e)%line, &
          & keys%source%entries(e)%column, keys%source%entries(e)%width, &
          & "unknown key '"//keys%source%entries(e)%key//"' in group &"//group%name, note, error)
        return
      end do
    end associate
    if (allocated(keys%fault)) then
      call move_alloc(keys%fault, error)
    else if (allocated(keys%missing)) then
      call move_alloc(keys%missing, error)
    end if
  end subroutine finish_reading

  !> A text. `allowed`: the only values, matched in any case; `word`: a name that may stand in
  !> column headers, so letters, digits, `_` and `-` only; `hidden`: not to be written.
  subroutine text_key(keys, name, value, meaning, required, allowed, default, word, hidden)
    class(keys_type), intent(inout) :: keys           !! the visitor; notes the key, and in reading
                                                      !! what is wrong with it
    character(*), intent(in) :: name                  !! of the key, in lower case
    ! allow(C072): a text is assigned only after its length has been checked.
    character(*), intent(inout) :: value              !! component of the group; set in reading
                                                      !! where the file gives it
    character(*), intent(in) :: meaning               !! what the reference says of the key
    logical, intent(in), optional :: required         !! the file must give it; absent: no
    character(*), intent(in), optional :: allowed(:)  !! (any number), the only values, matched in
                                                      !! any case; absent: any text
    character(*), intent(in), optional :: default     !! how the reference calls the default;
                                                      !! absent: by the value
    logical, intent(in), optional :: word             !! letters, digits, _ and - only; absent: no
    logical, intent(in), optional :: hidden           !! the value is not written; absent: it is
    character(:), allocatable :: choice, shown, message, note
    integer, allocatable :: slots(:)

    choice = ''
    if (present(allowed)) choice = list_text(allowed)
    shown = ''
    if (len_trim(value) > 0) shown = quoted_text(trim(value))
    if (present(hidden)) then
      if (hidden) shown = ''
    end if
    call keys%note_key(name, 'text', '', meaning, shown, choice, required, default)
    if (keys%mode /= mode_read) return
    call keys%find(name, [integer ::], slots)
    call keys%note_missing(name, size(slots) == 0, required)
    if (size(slots) == 0 .or. allocated(keys%fault)) return
    associate (token => keys%source%tokens(slots(1)))
      if (present(allowed)) then
        call to_string(token, name, value, message, note, allowed, word)
      else
        call to_string(token, name, value, message, note, word=word)
      end if
    end associate
    call keys%complain(slots(1), message, note)
  end subroutine text_key

  !> A whole number within `at_least` and `at_most`.
  subroutine integer_key(keys, name, value, unit, meaning, required, at_least, at_most, default, &
      & hidden)
    class(keys_type), intent(inout) :: keys        !! the visitor; notes the key, and in reading
                                                   !! what is wrong with it
    character(*), intent(in) :: name               !! of the key, in lower case
    integer, intent(inout) :: value                !! component of the group; set in reading where
                                                   !! the file gives it
    character(*), intent(in) :: unit               !! SI symbol; '' or '-' for none
    character(*), intent(in) :: meaning            !! what the reference says of the key
    logical, intent(in), optional :: required      !! the file must give it; absent: no
    integer, intent(in), optional :: at_least      !! smallest value; absent: no such bound
    integer, intent(in), optional :: at_most       !! largest value; absent: no such bound
    character(*), intent(in), optional :: default  !! how the reference calls the default; absent:
                                                   !! by the value
    logical, intent(in), optional :: hidden        !! the value is not written; absent: it is
    integer, allocatable :: slots(:)
    character(:), allocatable :: shown, message, note

    shown = to_text(value)
    if (present(hidden)) then
      if (hidden) shown = ''
    end if
    call keys%note_key(name, 'integer', unit, meaning, shown, integer_range(at_least, at_most), &
      & required, default)
    if (keys%mode /= mode_read) return
    call keys%find(name, [integer ::], slots)
    call keys%note_missing(name, size(slots) == 0, required)
    if (size(slots) == 0 .or. allocated(keys%fault)) return
    call to_integer(keys%source%tokens(slots(1)), name, value, message, note, at_least, at_most)
    call keys%complain(slots(1), message, note)
  end subroutine integer_key

  !> A real within the open bounds `above`, `below` and the closed ones `at_least`, `at_most`. With
  !> `text` it may be an expression in quotes instead, which bounds do not hold for.
  subroutine real_key(keys, name, value, unit, meaning, required, above, below, at_least, at_most, &
      & default, hidden, text)
    class(keys_type), intent(inout) :: keys        !! the visitor; notes the key, and in reading
                                                   !! what is wrong with it
    character(*), intent(in) :: name               !! of the key, in lower case
    real(wp), intent(inout) :: value               !! component of the group; set in reading where
                                                   !! the file gives it
    character(*), intent(in) :: unit               !! SI symbol; '' or '-' for none
    character(*), intent(in) :: meaning            !! what the reference says of the key
    logical, intent(in), optional :: required      !! the file must give it; absent: no
    real(wp), intent(in), optional :: above  !! the value must be larger; absent: no such bound
    real(wp), intent(in), optional :: below  !! the value must be smaller; absent: no such bound
    real(wp), intent(in), optional :: at_least     !! smallest value; absent: no such bound
    real(wp), intent(in), optional :: at_most      !! largest value; absent: no such bound
    character(*), intent(in), optional :: default  !! how the reference calls the default; absent:
                                                   !! by the value
    logical, intent(in), optional :: hidden        !! the value is not written; absent: it is
    ! allow(C072): a text is assigned only after its length has been checked.
    character(*), intent(inout), optional :: text
      !! component of the group for an expression, '' where there is a number; absent: only numbers
    integer, allocatable :: slots(:)
    character(:), allocatable :: shown, kind, message, note

    shown = ''
    if (is_set(value)) shown = exact_text(value)
    kind = 'real'
    if (present(text)) then
      if (text /= '') shown = quoted_text(trim(text))
      kind = real_or_expression
    end if
    if (present(hidden)) then
      if (hidden) shown = ''
    end if
    call keys%note_key(name, kind, unit, meaning, shown, &
      & real_range(above, below, at_least, at_most), required, default)
    if (keys%mode /= mode_read) return
    call keys%find(name, [integer ::], slots)
    call keys%note_missing(name, size(slots) == 0, required)
    if (size(slots) == 0 .or. allocated(keys%fault)) return
    if (present(text)) then
      if (keys%source%tokens(slots(1))%quoted) then
        call to_string(keys%source%tokens(slots(1)), name, text, message, note)
        call keys%complain(slots(1), message, note)
        value = unset
        return
      end if
      text = ''
    end if
    call to_real(keys%source%tokens(slots(1)), name, unit, value, message, note, above, below, &
      & at_least, at_most)
    call keys%complain(slots(1), message, note)
  end subroutine real_key

  !> True or false.
  subroutine logical_key(keys, name, value, meaning)
    class(keys_type), intent(inout) :: keys  !! the visitor; notes the key, and in reading what is
                                             !! wrong with it
    character(*), intent(in) :: name         !! of the key, in lower case
    logical, intent(inout) :: value          !! component of the group; set in reading where the
                                             !! file gives it
    character(*), intent(in) :: meaning      !! what the reference says of the key
    integer, allocatable :: slots(:)
    character(:), allocatable :: message, note

    call keys%note_key(name, 'logical', '', meaning, '.'//to_text(value)//'.', '')
    if (keys%mode /= mode_read) return
    call keys%find(name, [integer ::], slots)
    if (size(slots) == 0 .or. allocated(keys%fault)) return
    call to_logical(keys%source%tokens(slots(1)), name, value, message, note)
    call keys%complain(slots(1), message, note)
  end subroutine logical_key

  !> Whole numbers along the directions.
  subroutine integers_key(keys, name, value, unit, meaning, required, at_least, default, hidden)
    class(keys_type), intent(inout) :: keys        !! the visitor; notes the key, and in reading
                                                   !! what is wrong with it
    character(*), intent(in) :: name               !! of the key, in lower case
    integer, intent(inout) :: value(:)             !! (directions); elements are set in reading
                                                   !! where the file gives them
    character(*), intent(in) :: unit               !! SI symbol; '' or '-' for none
    character(*), intent(in) :: meaning            !! what the reference says of the key
    logical, intent(in), optional :: required      !! the file must give it; absent: no
    integer, intent(in), optional :: at_least      !! smallest value of each; absent: no such bound
    character(*), intent(in), optional :: default  !! how the reference calls the default; absent:
                                                   !! by the value
    logical, intent(in), optional :: hidden        !! the value is not written; absent: it is
    integer, allocatable :: slots(:)
    character(:), allocatable :: shown, message, note
    integer :: i

    shown = list_text(value(:findloc(value /= 0, .true., dim=1, back=.true.)))
    if (present(hidden)) then
      if (hidden) shown = ''
    end if
    call keys%note_key(name, 'integer('//to_text(size(value))//')', unit, meaning, shown, &
      & integer_range(at_least), required, default)
    if (keys%mode /= mode_read) return
    call keys%find(name, shape(value), slots)
    call keys%note_missing(name, size(slots) == 0, required)
    do i = 1, size(slots)
      if (slots(i) == 0 .or. allocated(keys%fault)) cycle
      call to_integer(keys%source%tokens(slots(i)), name, value(i), message, note, at_least)
      call keys%complain(slots(i), message, note)
    end do
  end subroutine integers_key

  !> Reals along the directions; elements that are not given keep their defaults.
  subroutine reals_key(keys, name, value, unit, meaning, required, default, hidden)
    class(keys_type), intent(inout) :: keys        !! the visitor; notes the key, and in reading
                                                   !! what is wrong with it
    character(*), intent(in) :: name               !! of the key, in lower case
    real(wp), intent(inout) :: value(:)            !! (directions); elements are set in reading
                                                   !! where the file gives them
    character(*), intent(in) :: unit               !! SI symbol; '' or '-' for none
    character(*), intent(in) :: meaning            !! what the reference says of the key
    logical, intent(in), optional :: required      !! the file must give it; absent: no
    character(*), intent(in), optional :: default  !! how the reference calls the default; absent:
                                                   !! by the value
    logical, intent(in), optional :: hidden        !! the value is not written; absent: it is
    integer, allocatable :: slots(:)
    integer :: i
    character(:), allocatable :: shown, message, note

    shown = vector_text(name, value, is_set(value))
    if (present(hidden)) then
      if (hidden) shown = ''
    end if
    call keys%note_key(name, 'real('//to_text(size(value))//')', unit, meaning, shown, '', &
      & required, default)
    if (keys%mode /= mode_read) return
    call keys%find(name, shape(value), slots)
    call keys%note_missing(name, size(slots) == 0, required)
    do i = 1, size(slots)
      if (slots(i) == 0 .or. allocated(keys%fault)) cycle
      call to_real(keys%source%tokens(slots(i)), name, unit, value(i), message, note)
      call keys%complain(slots(i), message, note)
    end do
  end subroutine reals_key

  !> A matrix, its elements in column order if no subscripts are given.
  subroutine matrix_key(keys, name, value, unit, meaning)
    class(keys_type), intent(inout) :: keys  !! the visitor; notes the key, and in reading what is
                                             !! wrong with it
    character(*), intent(in) :: name         !! of the key, in lower case
    real(wp), intent(inout) :: value(:, :)   !! (rows, columns); elements are set in reading where
                                             !! the file gives them
    character(*), intent(in) :: unit         !! SI symbol; '' or '-' for none
    character(*), intent(in) :: meaning      !! what the reference says of the key
    integer, allocatable :: slots(:)
    character(:), allocatable :: shown, message, note
    logical :: given
    integer :: i, j, k

    shown = ''
    if (keys%mode == mode_describe) shown = '0.0'
    given = any(ieee_is_nan(value))
    if (.not. given) given = any(abs(value) > 0.0_wp)
    if (given) shown = list_text([value])
    call keys%note_key(name, 'real('//to_text(size(value, 1))//','//to_text(size(value, 2))//')', &
      & unit, meaning, shown, '')
    if (keys%mode /= mode_read) return
    call keys%find(name, shape(value), slots)
    do k = 1, size(slots)
      if (slots(k) == 0 .or. allocated(keys%fault)) cycle
      i = modulo(k - 1, size(value, 1)) + 1
      j = (k - i)/size(value, 1) + 1
      call to_real(keys%source%tokens(slots(k)), name, unit, value(i, j), message, note)
      call keys%complain(slots(k), message, note)
    end do
  end subroutine matrix_key

  !> Three keys `<name>_x`, `<name>_y`, `<name>_z` for the components of one vector.
  subroutine triple(keys, name, value, unit, meaning, default, text)
    class(keys_type), intent(inout) :: keys        !! the visitor; notes the key, and in reading
                                                   !! what is wrong with it
    character(*), intent(in) :: name               !! what the three names begin with
    real(wp), intent(inout) :: value(3)  !! (3), x, y, z; set in reading where the file gives them
    character(*), intent(in) :: unit               !! SI symbol; '' or '-' for none
    character(*), intent(in) :: meaning  !! what the reference says of them, before `along x`
    character(*), intent(in), optional :: default  !! how the reference calls the default; absent:
                                                   !! by the value
    ! allow(C072): a text is assigned only after its length has been checked.
    character(*), intent(inout), optional :: text(3)
      !! (3) for expressions, as in `real_key`; absent: only numbers
    character(*), parameter :: directions = 'xyz'
    integer :: i

    do i = 1, 3
      if (present(text)) then
        call keys%key(name//'_'//directions(i:i), value(i), unit, meaning//' along '// &
          & directions(i:i), default=default, text=text(i))
        cycle
      end if
      call keys%key(name//'_'//directions(i:i), value(i), unit, meaning//' along '// &
        & directions(i:i), default=default)
    end do
  end subroutine triple

  !> Reals, as many as are given.
  subroutine real_list(keys, name, value, unit, meaning, default)
    class(keys_type), intent(inout) :: keys           !! the visitor; notes the key, and in reading
                                                      !! what is wrong with it
    character(*), intent(in) :: name                  !! of the key, in lower case
    real(wp), allocatable, intent(inout) :: value(:)  !! (any number); in reading made anew if the
                                                      !! file gives the key
    character(*), intent(in) :: unit                  !! SI symbol; '' or '-' for none
    character(*), intent(in) :: meaning               !! what the reference says of the key
    character(*), intent(in), optional :: default     !! how the reference calls the default;
                                                      !! absent: by the value
    integer, allocatable :: slots(:)
    character(:), allocatable :: shown, message, note
    integer :: i

    shown = ''
    if (allocated(value)) shown = list_text(value)
    call keys%note_key(name, 'real list', unit, meaning, shown, '', default=default)
    if (keys%mode /= mode_read) return
    call keys%find(name, growing, slots)
    if (size(slots) == 0 .or. allocated(keys%fault)) return
    if (allocated(value)) deallocate (value)
    allocate (value(size(slots)), source=0.0_wp)
    do i = 1, size(slots)
      ! tables come from other programs, with their rounding errors
      call to_real(keys%source%tokens(slots(i)), name, unit, value(i), message, note, &
        & tiny_is_zero=.true.)
      call keys%complain(slots(i), message, note)
      if (allocated(keys%fault)) return
    end do
  end subroutine real_list

  !> Names, as many as are given, kept in lower case, each once. `known` is what descriptions list;
  !> whether a name is known is checked where the whole list is.
  subroutine text_list(keys, name, value, meaning, known, default, as_written)
    class(keys_type), intent(inout) :: keys  !! the visitor
    character(*), intent(in) :: name         !! of the key
    ! allow(C072): a text is assigned only after its length has been checked.
    character(*), allocatable, intent(inout) :: value(:)
      !! (any number); in reading made anew if the file gives the key
    character(*), intent(in) :: meaning      !! what it is, for the reference
    character(*), intent(in) :: known(:)     !! (any number) names that descriptions list
    character(*), intent(in), optional :: default
      !! what descriptions show for it; the value if absent
    logical, intent(in), optional :: as_written
      !! any texts, in the case of letters of the file, and repeated ones; absent: no
    integer, allocatable :: slots(:)
    character(:), allocatable :: shown, listed, message, note
    integer :: i
    logical :: plain

    plain = .false.
    if (present(as_written)) plain = as_written
    shown = ''
    if (allocated(value)) shown = list_text(value)
    listed = ''
    if (size(known) > 0) listed = list_text(known)
    call keys%note_key(name, 'text list', '', meaning, shown, listed, default=default)
    if (keys%mode /= mode_read) return
    call keys%find(name, growing, slots)
    if (size(slots) == 0 .or. allocated(keys%fault)) return
    if (allocated(value)) deallocate (value)
    allocate (value(size(slots)))
    do i = 1, size(slots)
      value(i) = ''
      call to_string(keys%source%tokens(slots(i)), name, value(i), message, note, &
        & word=.not. plain)
      call keys%complain(slots(i), message, note)
      if (allocated(keys%fault)) return
      if (plain) cycle
      value(i) = lower_case(value(i))
      if (any(value(:i - 1) == value(i))) then
        call keys%complain(slots(i), "'"//trim(value(i))//"' is given twice in '"//name//"'", &
          & 'once is enough')
        return
      end if
    end do
  end subroutine text_list

  !> Values of any kind, as many as are given, kept as they are written: texts with their quotes.
  subroutine words(keys, name, value, meaning, required)
    class(keys_type), intent(inout) :: keys    !! the visitor; notes the key, and in reading what is
                                               !! wrong with it
    character(*), intent(in) :: name           !! of the key, in lower case
    ! allow(C072): a text is assigned only after its length has been checked.
    character(*), allocatable, intent(inout) :: value(:)  !! (any number); in reading made anew if
                                                          !! the file gives the key
    character(*), intent(in) :: meaning        !! what the reference says of the key
    logical, intent(in), optional :: required  !! the file must give it; absent: no
    integer, allocatable :: slots(:)
    character(:), allocatable :: shown, message, note
    integer :: i

    shown = ''
    if (allocated(value)) shown = join(value, ', ')
    call keys%note_key(name, 'list', '', meaning, shown, '', required)
    if (keys%mode /= mode_read) return
    call keys%find(name, growing, slots)
    call keys%note_missing(name, size(slots) == 0, required)
    if (size(slots) == 0 .or. allocated(keys%fault)) return
    if (allocated(value)) deallocate (value)
    allocate (value(size(slots)))
    do i = 1, size(slots)
      call to_word(keys%source%tokens(slots(i)), name, value(i), message, note)
      call keys%complain(slots(i), message, note)
    end do
  end subroutine words

  !> Store the description of a key.
  subroutine note_key(keys, name, kind, unit, meaning, shown, allowed, required, default)
    class(keys_type), intent(inout) :: keys
    character(*), intent(in) :: name, kind, unit, meaning, shown, allowed
    logical, intent(in), optional :: required
    character(*), intent(in), optional :: default
    type(key_info), allocatable :: wider(:)

    if (keys%count == size(keys%known)) then
      allocate (wider(2*keys%count))
      wider(:keys%count) = keys%known
      call move_alloc(wider, keys%known)
    end if
    keys%count = keys%count + 1
    associate (info => keys%known(keys%count))
      info%name = name
      info%kind = kind
      info%unit = unit
      info%meaning = meaning
      info%allowed = allowed
      info%value = shown
      info%default = shown
      if (len(shown) == 0) info%default = 'none'
      if (present(default)) info%default = default
      if (present(required)) then
        if (required) info%default = 'required'
      end if
    end associate
  end subroutine note_key

  !> Tokens of each element of a key; an error in them is kept as the first fault.
  subroutine find(keys, name, extents, slots)
    class(keys_type), intent(inout) :: keys
    character(*), intent(in) :: name
    integer, intent(in) :: extents(:)
    integer, allocatable, intent(out) :: slots(:)
    type(error_type), allocatable :: error

    call find_elements(keys%source, keys%section, name, extents, slots, keys%used, error)
    if (allocated(error) .and. .not. allocated(keys%fault)) call move_alloc(error, keys%fault)
    if (all(extents == growing(1)) .and. size(extents) == 1 .and. .not. allocated(keys%fault)) &
      & call check_gaps(keys, name, slots)
  end subroutine find

  !> Keep the first error of a value; a message '' means no error.
  subroutine complain(keys, token, message, note)
    class(keys_type), intent(inout) :: keys
    integer, intent(in) :: token
    character(*), intent(in) :: message, note

    if (allocated(keys%fault) .or. len(message) == 0) return
    associate (place => keys%source%tokens(token))
      call source_fault(keys%source, place%line, place%column, place%width, message// &
        & ' in group &'//keys%source%sections(keys%section)%name, note, keys%fault)
    end associate
  end subroutine complain

  !> Keep the first required key that is missing.
  subroutine note_missing(keys, name, missing, required)
    class(keys_type), intent(inout) :: keys
    character(*), intent(in) :: name
    logical, intent(in) :: missing
    logical, intent(in), optional :: required

    if (.not. present(required)) return
    if (.not. required .or. .not. missing .or. allocated(keys%missing)) return
    associate (group => keys%source%sections(keys%section), &
        & info => keys%known(keys%count))
      call source_fault(keys%source, group%line, group%column, group%width, &
        & "group &"//group%name//" lacks the key '"//name//"'", info%meaning// &
        & unit_note(info%unit), keys%missing)
    end associate
  end subroutine note_missing

  !> A list must be given from its first element on without gaps.
  subroutine check_gaps(keys, name, slots)
    class(keys_type), intent(inout) :: keys
    character(*), intent(in) :: name
    integer, intent(in) :: slots(:)
    integer :: i

    do i = 1, size(slots)
      if (slots(i) /= 0) cycle
      call keys%complain(slots(size(slots)), "'"//name//'('// &
        & to_text(i)//")' is not given", 'element '//to_text(size(slots))//' needs all before it')
      return
    end do
  end subroutine check_gaps

end module pd_scene_format_keys
