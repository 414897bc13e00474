!> A scene file as text with places: groups, keys and values, each with its line and column.
!>
!> The scan knows nothing of which groups and keys exist. It masks comments and quotes, so that a
!> `/`, `=` or `&` inside them means nothing, and finds errors that a namelist read would silently
!> ignore or report without a place.
module pd_scene_format_source
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: i8
  use pd_base_text, only: is_control, lower_case, to_text, newline
  use pd_scene_format_file, only: line_type, split_lines
  implicit none (type, external)
  private
  public :: source_type, section_type, entry_type, token_type, scan_source, source_fault, &
    & add_option, check_text

  !> One value as written: a word or the inside of a quoted text.
  type :: token_type
    character(:), allocatable :: text  !! without quotes and repeat count
    logical :: quoted = .false.
    integer :: repeat = 1              !! `3*0.0`: 3
    integer :: line = 0, column = 0, width = 0
  end type token_type

  !> One `key = values` or `key(subscript) = values`.
  type :: entry_type
    character(:), allocatable :: key        !! lower case
    character(:), allocatable :: subscript  !! inside of the parentheses, unallocated without
    integer :: line = 0, column = 0, width = 0
    integer :: subscript_column = 0
    integer :: first = 1, last = 0          !! its tokens in `source_type%tokens`
  end type entry_type

  !> One group, `&name ... /`.
  type :: section_type
    character(:), allocatable :: name  !! lower case
    integer :: line = 0, column = 0, width = 0
    integer :: first = 1, last = 0     !! its entries in `source_type%entries`
  end type section_type

  !> A scanned scene file.
  type :: source_type
    character(:), allocatable :: file
    type(line_type), allocatable :: lines(:)
    type(section_type), allocatable :: sections(:)
    type(entry_type), allocatable :: entries(:)
    type(token_type), allocatable :: tokens(:)
    integer :: section_count = 0, entry_count = 0, token_count = 0
    integer :: option_count = 0  !! lines at the end that are options of the command line
    integer(i8) :: before = 0_i8  !! lines of the file before these
    logical :: in_memory = .false.     !! the text of a scene in memory: places are groups and keys
  end type source_type

  character(*), parameter :: tab = achar(9)
  character(*), parameter :: blanks = ' '//achar(9)
  character(*), parameter :: word_ends = ' ,/!=&''"'//achar(9)
  integer, parameter :: longest_shown = 110  !! columns of a source line shown in a message
  integer, parameter :: lead_shown = 36      !! columns shown before the fault in a cut line

  !> The last token of a group, to distinguish an empty value from a trailing comma.
  enum, bind(c)
    enumerator :: after_name, after_equals, after_value, after_comma
  end enum

contains

  !> Find groups, keys and values in `text`; `file` is the name used in messages. An error, with its
  !> place, if text stands outside of groups, if a group or quote is not closed, if a key or value
  !> is missing, or for a control character. With `in_memory` the text is of no file, and messages
  !> name groups and keys in place of lines.
  subroutine scan_source(text, file, source, error, in_memory)
    character(*), intent(in) :: text          !! of the scene file
    character(*), intent(in) :: file          !! name of the file, for messages
    type(source_type), intent(out) :: source  !! its groups, keys and values with their places
    type(error_type), allocatable, intent(out) :: error
    logical, intent(in), optional :: in_memory
    integer :: line, column, state
    logical :: inside

    source%file = file
    if (present(in_memory)) source%in_memory = in_memory
    call split_lines(text, source%lines)
    call check_text(source, error)
    if (allocated(error)) return
    allocate (source%sections(8), source%entries(32), source%tokens(64))
    inside = .false.
    state = after_name
    do line = 1, size(source%lines)
      column = 1
      do
        column = skip_blanks(source%lines(line)%text, column)
        if (column > len(source%lines(line)%text)) exit
        if (source%lines(line)%text(column:column) == '!') exit
        if (inside) then
          call scan_inside(source, line, column, state, inside, error)
        else
          call open_section(source, line, column, error)
          inside = .true.
          state = after_name
        end if
        if (allocated(error)) return
      end do
    end do
    if (inside) call not_closed(source, 'the end of the file', error)
    if (allocated(error)) return
    call trim_lists(source)
  end subroutine scan_source

  !> An error if the lines hold a control character other than a tab: no text file does, and shown
  !> on a terminal or put into a name it does harm.
  subroutine check_text(source, error)
    type(source_type), intent(in) :: source  !! with its lines and the file's name
    type(error_type), allocatable, intent(out) :: error
    integer :: line, column

    do line = 1, size(source%lines)
      associate (text => source%lines(line)%text)
        do column = 1, len(text)
          if (.not. is_control(text(column:column)) .or. text(column:column) == tab) cycle
          call source_fault(source, line, column, 1, 'a control character, byte '// &
            & to_text(iachar(text(column:column))), 'expected plain text in ASCII or UTF-8', error)
          return
        end do
      end associate
    end do
  end subroutine check_text

  !> `&name`, or the error that text stands outside of groups.
  subroutine open_section(source, line, column, error)
    type(source_type), intent(inout) :: source
    integer, intent(in) :: line
    integer, intent(inout) :: column
    type(error_type), allocatable, intent(out) :: error
    integer :: last
    character(:), allocatable :: note

    associate (text => source%lines(line)%text)
      if (text(column:column) /= '&') then
        note = "groups are written &name ... /, comments start with '!'"
        if (source%section_count > 0) then
          note = "a '/' before it has closed &"//source%sections(source%section_count)%name// &
            & "; a text that holds '/' needs quotes"
        end if
        last = len_trim(text)
        call source_fault(source, line, column, last - column + 1, &
          & 'text outside of any group', note, error)
        return
      end if
      last = word_end(text, column + 1)
      if (last == column) then
        call source_fault(source, line, column, 1, "'&' without the name of a group", &
          & 'expected &name', error)
        return
      end if
      call grow_sections(source)
      associate (section => source%sections(source%section_count))
        section%name = lower_case(text(column + 1:last))
        section%line = line
        section%column = column
        section%width = last - column + 1
        section%first = source%entry_count + 1
        section%last = source%entry_count
      end associate
    end associate
    column = last + 1
  end subroutine open_section

  !> The next thing inside a group: its end, a comma, a key or a value.
  subroutine scan_inside(source, line, column, state, inside, error)
    type(source_type), intent(inout) :: source
    integer, intent(in) :: line
    integer, intent(inout) :: column, state
    logical, intent(inout) :: inside
    type(error_type), allocatable, intent(out) :: error
    logical :: found

    select case (source%lines(line)%text(column:column))
    case ('/')
      call check_entry(source, state, error)
      inside = .false.
      column = column + 1
    case ('&')
      call check_entry(source, state, error)
      if (allocated(error)) return
      associate (text => source%lines(line)%text)
        call not_closed(source, "'"//text(column:word_end(text, column + 1))//"' on line "// &
          & to_text(line), error)
      end associate
    case (',')
      if (state /= after_value) then
        call source_fault(source, line, column, 1, 'empty value', &
          & "expected a value before the ','", error)
        return
      end if
      state = after_comma
      column = column + 1
    case ('=')
      call source_fault(source, line, column, 1, "'=' without a key before it", &
        & 'expected key = value', error)
    case default
      call scan_key(source, line, column, state, found, error)
      if (allocated(error) .or. found) return
      if (state == after_name) then
        associate (text => source%lines(line)%text)
          call source_fault(source, line, column, &
            & max(1, word_end(text, column) - column + 1), 'a value without a key in group &'// &
            & source%sections(source%section_count)%name, 'expected key = value', error)
        end associate
        return
      end if
      call scan_value(source, line, column, error)
      state = after_value
    end select
  end subroutine scan_inside

  !> `key =` or `key(subscript) =`; `found` is false if a value stands here.
  subroutine scan_key(source, line, column, state, found, error)
    type(source_type), intent(inout) :: source
    integer, intent(in) :: line
    integer, intent(inout) :: column, state
    logical, intent(out) :: found
    type(error_type), allocatable, intent(out) :: error
    integer :: last, next, opening, closing

    found = .false.
    opening = 0
    closing = 0
    associate (text => source%lines(line)%text)
      last = word_end(text, column)
      if (last < column) return
      if (index(text(column:last), '(') > 1) last = column + index(text(column:last), '(') - 2
      next = skip_blanks(text, last + 1)
      if (next > len(text)) return
      if (text(next:next) == '(') then
        opening = next
        closing = index(text(opening:), ')')
        if (closing == 0) return
        closing = opening + closing - 1
        next = skip_blanks(text, closing + 1)
        if (next > len(text)) return
      end if
      if (text(next:next) /= '=') return
      found = .true.
      call check_entry(source, state, error)
      if (allocated(error)) return
      call grow_entries(source)
      associate (entry => source%entries(source%entry_count))
        entry%key = lower_case(text(column:last))
        if (opening > 0) then
          entry%subscript = text(opening + 1:closing - 1)
          entry%subscript_column = opening + 1
        end if
        entry%line = line
        entry%column = column
        entry%width = last - column + 1
        entry%first = source%token_count + 1
        entry%last = source%token_count
      end associate
      source%sections(source%section_count)%last = source%entry_count
    end associate
    state = after_equals
    column = next + 1
  end subroutine scan_key

  !> One value, with its repeat count and quotes taken off.
  subroutine scan_value(source, line, column, error)
    type(source_type), intent(inout) :: source
    integer, intent(in) :: line
    integer, intent(inout) :: column
    type(error_type), allocatable, intent(out) :: error
    integer :: last, star, status
    type(token_type) :: token

    associate (text => source%lines(line)%text)
      token%line = line
      token%column = column
      last = word_end(text, column)
      star = 0
      if (last > column) star = index(text(column:last), '*')
      if (star > 1) then
        if (verify(text(column:column + star - 2), '0123456789') == 0) then
          read (text(column:column + star - 2), *, iostat=status) token%repeat
          if (status /= 0 .or. token%repeat < 1) then
            call source_fault(source, line, column, star, 'bad repeat count', &
              & 'expected a whole number above 0 before the ''*''', error)
            return
          end if
          column = column + star
        end if
      end if
      if (column > len(text)) then
        last = column - 1
      else if (scan(text(column:column), '''"') > 0) then
        call scan_quoted(source, line, column, token, last, error)
        if (allocated(error)) return
      else
        last = word_end(text, column)
        token%text = text(column:last)
      end if
      if (.not. allocated(token%text)) token%text = ''
      if (len(token%text) == 0 .and. .not. token%quoted) then
        call source_fault(source, line, token%column, max(1, last - token%column + 1), &
          & 'empty value', 'expected a value after the repeat count', error)
        return
      end if
      token%width = last - token%column + 1
      column = last + 1
    end associate
    call grow_tokens(source)
    source%tokens(source%token_count) = token
    source%entries(source%entry_count)%last = source%token_count
  end subroutine scan_value

  !> A text in quotes, doubled quotes inside it standing for one; it may not cross a line's end.
  subroutine scan_quoted(source, line, column, token, last, error)
    type(source_type), intent(in) :: source
    integer, intent(in) :: line, column
    type(token_type), intent(inout) :: token
    integer, intent(out) :: last
    type(error_type), allocatable, intent(out) :: error
    character :: quote
    integer :: i

    associate (text => source%lines(line)%text)
      quote = text(column:column)
      token%quoted = .true.
      token%text = ''
      last = column
      i = column + 1
      do while (i <= len(text))
        if (text(i:i) == quote) then
          if (i == len(text)) then
            last = i
            return
          end if
          if (text(i + 1:i + 1) /= quote) then
            last = i
            return
          end if
          i = i + 1
        end if
        token%text = token%text//text(i:i)
        i = i + 1
      end do
      call source_fault(source, line, column, len_trim(text) - column + 1, 'unclosed quote', &
        & 'expected a closing '//quote//' on this line', error)
    end associate
  end subroutine scan_quoted

  !> Before a group ends or a key starts: has the last key got a value?
  subroutine check_entry(source, state, error)
    type(source_type), intent(in) :: source
    integer, intent(in) :: state
    type(error_type), allocatable, intent(out) :: error

    if (state /= after_equals) return
    associate (entry => source%entries(source%entry_count))
      call source_fault(source, entry%line, entry%column, entry%width, "key '"//entry%key// &
        & "' in group &"//source%sections(source%section_count)%name//' has no value', &
        & "expected a value after the '='", error)
    end associate
  end subroutine check_entry

  !> The error that the open group lacks its end.
  subroutine not_closed(source, before, error)
    type(source_type), intent(in) :: source
    character(*), intent(in) :: before
    type(error_type), allocatable, intent(out) :: error

    associate (section => source%sections(source%section_count))
      call source_fault(source, section%line, section%column, section%width, 'group &'// &
        & section%name//' is not closed', "expected a '/' before "//before, error)
    end associate
  end subroutine not_closed

  !> The first column from `column` on that is neither blank nor tab.
  pure integer function skip_blanks(text, column) result(next)
    character(*), intent(in) :: text
    integer, intent(in) :: column

    next = len(text) + 1
    if (column > len(text)) return
    next = verify(text(column:), blanks)
    next = merge(len(text) + 1, column + next - 1, next == 0)
  end function skip_blanks

  !> The last column of the word that starts at `column`; `column - 1` if none does.
  pure integer function word_end(text, column) result(last)
    character(*), intent(in) :: text
    integer, intent(in) :: column

    last = column - 1
    if (column > len(text)) return
    last = scan(text(column:), word_ends)
    last = merge(len(text), column + last - 2, last == 0)
  end function word_end

  !> Add a line that stands on the command line instead of the file; `line` is its number.
  subroutine add_option(source, text, line)
    type(source_type), intent(inout) :: source  !! with the line behind those of the file on return
    character(*), intent(in) :: text      !! the option as it is typed, without the shell's quotes
    integer, intent(out) :: line          !! its number, for places
    type(line_type), allocatable :: longer(:)
    integer :: i

    line = size(source%lines) + 1
    allocate (longer(line))
    do i = 1, line - 1
      call move_alloc(source%lines(i)%text, longer(i)%text)
    end do
    longer(line)%text = text
    call move_alloc(longer, source%lines)
    source%option_count = source%option_count + 1
  end subroutine add_option

  !> Make an error with place, line and carets. `line` 0 names the file only; lines of options name
  !> the command line.
  subroutine source_fault(source, line, column, width, message, note, error)
    type(source_type), intent(in) :: source  !! with its lines and the file's name
    integer, intent(in) :: line              !! number of the line, from 1; 0: of none
    integer, intent(in) :: column            !! of the first character at fault, from 1
    integer, intent(in) :: width             !! number of characters at fault
    character(*), intent(in) :: message      !! what was wrong
    character(*), intent(in) :: note         !! what was expected; '' for nothing
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: number, text, shown, pad, place
    integer :: first, last, i, carets

    if (source%in_memory) then
      text = message//newline//' --> '//place_in_memory(source, line)
      if (len(note) > 0) text = text//newline//'  = '//note
      call fail(error, text)
      return
    end if
    if (line < 1 .or. line > size(source%lines)) then
      text = message//newline//' --> '//source%file
      if (len(note) > 0) text = text//newline//'  = '//note
      call fail(error, text)
      return
    end if
    number = to_text(source%before + line)
    place = source%file//':'//number
    if (line > size(source%lines) - source%option_count) then
      number = ''
      place = 'the command line'
    end if
    first = 1
    last = len_trim(source%lines(line)%text)
    if (last > longest_shown) then
      first = max(1, min(column - lead_shown, last - longest_shown + 1))
      last = min(last, first + longest_shown - 1)
    end if
    shown = source%lines(line)%text(first:last)
    ! Tabs stay, so that the carets stand under the same columns; the later bytes of an UTF-8
    ! character take no column.
    pad = ''
    do i = first, column - 1
      if (source%lines(line)%text(i:i) == tab) then
        pad = pad//tab
      else if (.not. continues(source%lines(line)%text(i:i))) then
        pad = pad//' '
      end if
    end do
    carets = 0
    do i = column, min(column + width - 1, last)
      if (.not. continues(source%lines(line)%text(i:i))) carets = carets + 1
    end do
    text = message//newline//' --> '//place//newline// &
      & '  '//number//' | '//shown//newline// &
      & repeat(' ', len(number) + 2)//' | '//pad//repeat('^', max(1, carets))
    if (len(note) > 0) text = text//' '//note
    call fail(error, text)
  end subroutine source_fault

  !> The group, and the key if there is one, that stand in a line of a text that is of no file.
  pure function place_in_memory(source, line) result(place)
    type(source_type), intent(in) :: source
    integer, intent(in) :: line
    character(:), allocatable :: place
    integer :: s, e, here

    place = 'the scene in memory'
    here = 0
    do s = 1, source%section_count
      if (source%sections(s)%line <= line) here = s
    end do
    if (here == 0 .or. line < 1) return
    associate (section => source%sections(here))
      place = 'group &'//section%name//' number '// &
        & to_text(count([(source%sections(s)%name == section%name, s=1, here)]))
      do e = section%first, section%last
        if (source%entries(e)%line /= line) cycle
        place = place//', key '//source%entries(e)%key
        return
      end do
    end associate
  end function place_in_memory

  !> Whether a byte is a later one of an UTF-8 character.
  pure logical function continues(byte)
    character, intent(in) :: byte
    continues = iachar(byte) >= 128 .and. iachar(byte) < 192
  end function continues

  !> Room for one more section.
  subroutine grow_sections(source)
    type(source_type), intent(inout) :: source
    type(section_type), allocatable :: wider(:)

    if (source%section_count == size(source%sections)) then
      allocate (wider(2*size(source%sections)))
      wider(:source%section_count) = source%sections
      call move_alloc(wider, source%sections)
    end if
    source%section_count = source%section_count + 1
  end subroutine grow_sections

  !> Room for one more entry.
  subroutine grow_entries(source)
    type(source_type), intent(inout) :: source
    type(entry_type), allocatable :: wider(:)

    if (source%entry_count == size(source%entries)) then
      allocate (wider(2*size(source%entries)))
      wider(:source%entry_count) = source%entries
      call move_alloc(wider, source%entries)
    end if
    source%entry_count = source%entry_count + 1
  end subroutine grow_entries

  !> Room for one more token.
  subroutine grow_tokens(source)
    type(source_type), intent(inout) :: source
    type(token_type), allocatable :: wider(:)

    if (source%token_count == size(source%tokens)) then
      allocate (wider(2*size(source%tokens)))
      wider(:source%token_count) = source%tokens
      call move_alloc(wider, source%tokens)
    end if
    source%token_count = source%token_count + 1
  end subroutine grow_tokens

  !> Trim the lists to their used length.
  subroutine trim_lists(source)
    type(source_type), intent(inout) :: source
    source%sections = source%sections(:source%section_count)
    source%entries = source%entries(:source%entry_count)
    source%tokens = source%tokens(:source%token_count)
  end subroutine trim_lists

end module pd_scene_format_source
