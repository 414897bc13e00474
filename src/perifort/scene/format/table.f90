!> Text tables of numbers: clouds of points and initial states.
!>
!> A row per line, columns parted by blanks, tabs or commas, `#` starts a comment; the first line
!> may name the columns.
module pd_scene_format_table
  use pd_base_kinds, only: wp, i8
  use pd_base_error, only: error_type
  use pd_base_text, only: join, lower_case, nearest_name, to_text
  use pd_scene_format_file, only: read_text_file, split_lines
  use pd_scene_format_source, only: source_type, check_text, source_fault
  use pd_scene_format_given, only: name_length
  use pd_scene_format_values, only: parse_real, largest_real
  implicit none (type, external)
  private
  public :: table_type, read_table, read_table_text, column_of, content_begins

  !> A table as read.
  type :: table_type
    character(name_length), allocatable :: names(:)  !! of the columns, size 0 without a header
    real(wp), allocatable :: values(:, :)            !! (column, row)
    integer(i8), allocatable :: lines(:)             !! the line of each row in the file
  end type table_type

  character(*), parameter :: separators = ' ,'//achar(9)
  character(*), parameter :: number_start = '+-.0123456789'
  integer, parameter :: longest_plain = 30  !! characters of a number that is surely in range

contains

  !> Read the table at `path`. `allowed`: the names that a header may use; with it a header is
  !> required, without it none may stand. An error, with its place, if the file cannot be read, if a
  !> column is unknown or stands twice, if rows differ in length or hold anything but numbers, or if
  !> there are none.
  subroutine read_table(path, table, error, columns, allowed)
    character(*), intent(in) :: path                  !! of the file
    type(table_type), intent(out) :: table            !! as it stands in the file
    type(error_type), allocatable, intent(out) :: error
    integer, intent(in), optional :: columns          !! how many there must be; absent: as many as
                                                      !! in the first row
    character(*), intent(in), optional :: allowed(:)  !! (any number), names of columns, '*' for
                                                      !! any; absent: no header
    character(:), allocatable :: text

    call read_text_file(path, text, error)
    if (allocated(error)) return
    if (present(allowed)) then
      call read_table_text(text, path, table, error, columns, allowed)
    else
      call read_table_text(text, path, table, error, columns)
    end if
  end subroutine read_table

  !> Read a table from its text, with the errors of `read_table`.
  subroutine read_table_text(text, name, table, error, columns, allowed, before)
    character(*), intent(in) :: text                  !! of the file
    character(*), intent(in) :: name                  !! of the file, for messages
    type(table_type), intent(out) :: table            !! as it stands in the text
    type(error_type), allocatable, intent(out) :: error
    integer, intent(in), optional :: columns          !! how many there must be; absent: as many as
                                                      !! in the first row
    character(*), intent(in), optional :: allowed(:)  !! (any number), names of columns, '*' for
                                                      !! any; absent: no header
    integer(i8), intent(in), optional :: before       !! lines of the file before the text; 0 if
                                                      !! absent
    type(source_type) :: source
    integer :: line, last, row, wide
    logical :: named

    source%file = name
    if (present(before)) source%before = before
    call split_lines(text, source%lines)
    call check_text(source, error)
    if (allocated(error)) return
    allocate (table%names(0), table%lines(size(source%lines)))
    named = .false.
    row = 0
    wide = 0
    if (present(columns)) wide = columns
    do line = 1, size(source%lines)
      last = content_end(source%lines(line)%text)
      if (last == 0) cycle
      if (present(allowed) .and. .not. named) then
        call read_header(source, line, last, allowed, table%names, error)
        if (allocated(error)) return
        wide = size(table%names)
        named = .true.
        cycle
      end if
      if (wide == 0) wide = count_words(source%lines(line)%text(:last))
      if (.not. allocated(table%values)) allocate (table%values(wide, size(source%lines)))
      row = row + 1
      table%lines(row) = source%before + line
      call read_row(source, line, last, table%values(:, row), error)
      if (allocated(error)) return
    end do
    if (row == 0) then
      call source_fault(source, 0, 0, 0, 'the table has no rows', &
        & "expected a row of numbers per line; '#' starts a comment", error)
      return
    end if
    table%lines = table%lines(:row)
    table%values = table%values(:, :row)
  end subroutine read_table_text

  !> The number of the column of this name, 0 if there is none.
  pure integer function column_of(table, name) result(column)
    type(table_type), intent(in) :: table  !! with a header, else no column is found
    character(*), intent(in) :: name       !! of the column, in lower case

    do column = size(table%names), 1, -1
      if (table%names(column) == name) return
    end do
  end function column_of

  !> The names of the columns: allowed ones, each once.
  subroutine read_header(source, line, last, allowed, names, error)
    type(source_type), intent(in) :: source
    integer, intent(in) :: line, last
    character(*), intent(in) :: allowed(:)
    character(name_length), allocatable, intent(inout) :: names(:)
    type(error_type), allocatable, intent(out) :: error
    integer :: i, first, final
    character(:), allocatable :: nearest, note, word

    associate (text => source%lines(line)%text)
      deallocate (names)
      allocate (names(count_words(text(:last))))
      final = 0
      do i = 1, size(names)
        call next_word(text(:last), final, first)
        word = lower_case(text(first:final))
        names(i) = word
        if (all(allowed /= word .and. allowed /= '*')) then
          note = 'allowed: '//join(allowed, ', ')
          nearest = nearest_name(word, allowed)
          if (len(nearest) > 0) note = "did you mean '"//nearest//"'?  "//note
          call source_fault(source, line, first, final - first + 1, &
            & "unknown column '"//word//"'; the first line must name the columns", note, error)
          return
        end if
        if (any(names(:i - 1) == word)) then
          call source_fault(source, line, first, final - first + 1, &
            & "column '"//word//"' is given twice", 'name each column once', error)
          return
        end if
      end do
    end associate
  end subroutine read_header

  !> One row of as many numbers as `values` has elements.
  subroutine read_row(source, line, last, values, error)
    type(source_type), intent(in) :: source
    integer, intent(in) :: line, last
    real(wp), intent(out) :: values(:)
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: note, count_note
    integer :: i, first, final, status, found

    associate (text => source%lines(line)%text)
      found = count_words(text(:last))
      if (found /= size(values)) then
        count_note = 'expected '//to_text(size(values))//', found '//to_text(found)
        call source_fault(source, line, 1, last, 'wrong number of columns', count_note, error)
        return
      end if
      ! The common case in one read; the slow way below finds the place of a fault.
      if (is_plain(text(:last))) then
        read (text(:last), *, iostat=status) values
        ! After a failed read the values are not set.
        if (status == 0) then
          if (all(abs(values) <= largest_real)) then
            where (abs(values)*largest_real < 0.999_wp) values = 0.0_wp
            return
          end if
        end if
      end if
      final = 0
      do i = 1, size(values)
        call next_word(text(:last), final, first)
        call parse_real(text(first:final), values(i), note, tiny_is_zero=.true.)
        if (len(note) == 0) cycle
        call source_fault(source, line, first, final - first + 1, &
          & "bad value '"//text(first:final)//"'", note, error)
        return
      end do
    end associate
  end subroutine read_row

  !> Whether a line surely holds only numbers in range: signs where they belong, no exponent of
  !> three digits. The runtime would read `2-5` as 2e-5, and trap on `1e999`.
  pure logical function is_plain(text) result(plain)
    character(*), intent(in) :: text
    integer :: first, final, mark, signs

    plain = index(text, ',') == 0
    final = 0
    do while (plain)
      call next_word(text, final, first)
      if (first > len(text)) return
      mark = scan(text(first:final), 'eEdD')
      mark = merge(final + 1, first + mark - 1, mark == 0)
      plain = final - first < longest_plain .and. verify(text(first:first), number_start) == 0 &
        & .and. verify(text(first + 1:mark - 1), '0123456789.') == 0
      if (mark > final) cycle
      signs = scan(text(mark + 1:min(mark + 1, final)), '+-')
      plain = plain .and. final - mark - signs <= 2 .and. &
        & verify(text(mark + 1 + signs:final), '0123456789') == 0
    end do
  end function is_plain

  !> What a character at the begin of a line means, or after separators there: whether it is the
  !> first of a word, or of a comment, so that the line has no content.
  pure subroutine content_begins(character, has_content, in_comment)
    character, intent(in) :: character
    logical, intent(out) :: has_content, in_comment

    in_comment = character == '#'
    has_content = .not. in_comment .and. index(separators, character) == 0
  end subroutine content_begins

  !> The last character before a comment and blanks, 0 for an empty line.
  pure integer function content_end(text) result(last)
    character(*), intent(in) :: text

    last = index(text, '#') - 1
    if (last < 0) last = len(text)
    last = verify(text(:last), separators, back=.true.)
  end function content_end

  !> How many words a line has.
  pure integer function count_words(text) result(number)
    character(*), intent(in) :: text
    integer :: first, final

    number = 0
    final = 0
    do
      call next_word(text, final, first)
      if (first > len(text)) exit
      number = number + 1
    end do
  end function count_words

  !> The word behind column `final`: its first column, beyond the text if there is none, and last.
  pure subroutine next_word(text, final, first)
    character(*), intent(in) :: text
    integer, intent(inout) :: final
    integer, intent(out) :: first
    integer :: step

    first = len(text) + 1
    if (final >= len(text)) return
    step = verify(text(final + 1:), separators)
    if (step == 0) return
    first = final + step
    step = scan(text(first:), separators)
    final = len(text)
    if (step > 0) final = first + step - 2
  end subroutine next_word

end module pd_scene_format_table
