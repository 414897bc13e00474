!> Reading a mesh file word by word, or number by number where it is binary. Every error says where
!> it is: the line of a text, the byte of binary data.
module pd_body_mesh_cursor
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_text, only: newline, printable, to_text
  use pd_scene_format_values, only: largest_real, parse_real
  implicit none (type, external)
  private
  public :: cursor_type, read_plain_real, shown

  integer, parameter :: longest_shown = 40  !! characters of a word that a message shows

  !> A place in a file.
  type :: cursor_type
    character(:), allocatable :: file      !! its name
    character(:), allocatable :: text      !! all of it
    integer(i8) :: at = 1_i8               !! the next character
    integer :: line = 1                    !! its line
    logical :: binary = .false.            !! numbers are binary
    logical :: swapped = .false.           !! in the other order of bytes
  contains
    procedure :: next_word
    procedure :: next_line
    procedure :: short
    procedure :: long
    procedure :: count_of
    procedure :: number
    procedure :: fault
    procedure :: left
    procedure, private :: bytes
    procedure, private :: word_of
  end type cursor_type

contains

  !> The characters that are left.
  pure integer(i8) function left(cursor)
    class(cursor_type), intent(in) :: cursor  !! the place
    left = len(cursor%text, kind=i8) - cursor%at + 1
  end function left

  !> An error at the place.
  pure subroutine fault(cursor, message, error, note)
    class(cursor_type), intent(in) :: cursor       !! the place
    character(*), intent(in) :: message            !! what is wrong
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in), optional :: note     !! what was expected; none if absent
    character(:), allocatable :: text

    text = message//newline//' --> '//cursor%file
    if (cursor%binary) then
      text = text//', byte '//to_text(min(cursor%at, len(cursor%text, kind=i8)))
    else
      text = text//':'//to_text(cursor%line)
    end if
    if (present(note)) text = text//newline//'  = '//note
    call fail(error, text)
  end subroutine fault

  !> The next word of a text: it is text(first:last), and empty at the end of the file.
  pure subroutine next_word(cursor, first, last)
    class(cursor_type), intent(inout) :: cursor  !! stands behind the word on return
    integer(i8), intent(out) :: first            !! where the word begins
    integer(i8), intent(out) :: last             !! where it ends; first - 1 if there is none
    integer(i8) :: n

    n = len(cursor%text, kind=i8)
    associate (at => cursor%at)
      do while (at <= n)
        if (iachar(cursor%text(at:at)) > 32) exit
        if (cursor%text(at:at) == achar(10)) cursor%line = cursor%line + 1
        at = at + 1
      end do
      first = at
      do while (at <= n)
        if (iachar(cursor%text(at:at)) <= 32) exit
        at = at + 1
      end do
      last = at - 1
    end associate
  end subroutine next_word

  !> The rest of the line, without its end.
  pure subroutine next_line(cursor, line, found)
    class(cursor_type), intent(inout) :: cursor       !! at the begin of the next line on return
    character(:), allocatable, intent(out) :: line    !! the text
    logical, intent(out) :: found                     !! false at the end of the file
    integer(i8) :: first

    first = cursor%at
    found = first <= len(cursor%text, kind=i8)
    line = ''
    if (.not. found) return
    do while (cursor%at <= len(cursor%text, kind=i8))
      if (cursor%text(cursor%at:cursor%at) == achar(10)) exit
      cursor%at = cursor%at + 1
    end do
    line = cursor%text(first:cursor%at - 1)
    if (len(line) > 0) then
      if (line(len(line):) == achar(13)) line = line(:len(line) - 1)
    end if
    cursor%at = cursor%at + 1
    cursor%line = cursor%line + 1
  end subroutine next_line

  !> The next word, or an error that says what is missing.
  subroutine word_of(cursor, what, word, error)
    class(cursor_type), intent(inout) :: cursor
    character(*), intent(in) :: what
    character(:), allocatable, intent(out) :: word
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: first, last

    call cursor%next_word(first, last)
    word = cursor%text(first:last)
    if (last < first) call cursor%fault('the file ends before '//what, error, &
      & 'it may have been cut off')
  end subroutine word_of

  !> The next integer: a word, or four bytes.
  subroutine short(cursor, what, value, error)
    class(cursor_type), intent(inout) :: cursor  !! behind it on return
    character(*), intent(in) :: what             !! what it is, for messages
    integer, intent(out) :: value                !! its value
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: wide
    character(4) :: four

    value = 0
    if (cursor%binary) then
      call cursor%bytes(what, four, error)
      if (.not. allocated(error)) value = int(transfer(four, 0_i4))
    else
      call cursor%long(what, wide, error)
      if (allocated(error)) return
      if (abs(wide) > huge(value)) then
        call cursor%fault(what//' is '//to_text(wide)//', out of range', error)
      else
        value = int(wide)
      end if
    end if
  end subroutine short

  !> The next long integer: a word, or eight bytes.
  subroutine long(cursor, what, value, error)
    class(cursor_type), intent(inout) :: cursor  !! behind it on return
    character(*), intent(in) :: what             !! what it is, for messages
    integer(i8), intent(out) :: value            !! its value
    type(error_type), allocatable, intent(out) :: error
    character(8) :: eight
    character(:), allocatable :: word
    integer :: i, begin
    logical :: good

    value = 0_i8
    if (cursor%binary) then
      call cursor%bytes(what, eight, error)
      if (.not. allocated(error)) value = transfer(eight, 0_i8)
      return
    end if
    call cursor%word_of(what, word, error)
    if (allocated(error)) return
    begin = 1
    if (word(1:1) == '-' .or. word(1:1) == '+') begin = 2
    good = len(word) - begin + 1 <= 18 .and. begin <= len(word)
    do i = begin, len(word)
      if (.not. good) exit
      good = word(i:i) >= '0' .and. word(i:i) <= '9'
      if (good) value = 10_i8*value + (iachar(word(i:i)) - iachar('0'))
    end do
    if (word(1:1) == '-') value = -value
    if (.not. good) call cursor%fault("expected "//what//", an integer, but found '"// &
      & shown(word)//"'", error)
  end subroutine long

  !> A count, whose items need at least so many bytes each: an error if it is negative, or if the
  !> rest of the file is too short for so many. Nothing need be allocated before.
  subroutine count_of(cursor, what, least, value, error)
    class(cursor_type), intent(inout) :: cursor  !! behind it on return
    character(*), intent(in) :: what             !! what is counted, for messages
    integer, intent(in) :: least                 !! bytes that one takes at least
    integer(i8), intent(out) :: value            !! the count
    type(error_type), allocatable, intent(out) :: error

    call cursor%long('the number of '//what, value, error)
    if (allocated(error)) return
    if (value < 0_i8) then
      call cursor%fault('the number of '//what//' is '//to_text(value), error)
    else if (value > cursor%left()/least + 1) then
      call cursor%fault('the number of '//what//' is '//to_text(value)//', but only '// &
        & to_text(cursor%left())//' bytes are left of the file', error, 'it may have been cut off')
    end if
  end subroutine count_of

  !> The next real number: a word, or eight bytes.
  subroutine number(cursor, what, value, error)
    class(cursor_type), intent(inout) :: cursor  !! behind it on return
    character(*), intent(in) :: what             !! what it is, for messages
    real(wp), intent(out) :: value               !! its value
    type(error_type), allocatable, intent(out) :: error
    character(8) :: eight
    character(:), allocatable :: word, note

    value = 0.0_wp
    if (cursor%binary) then
      call cursor%bytes(what, eight, error)
      if (allocated(error)) return
      value = transfer(eight, 0.0_wp)
      if (ieee_is_finite(value)) then
        if (abs(value) <= largest_real) return
      end if
      value = 0.0_wp
      call cursor%fault(what//' is not finite, or out of range', error)
      return
    end if
    call cursor%word_of(what, word, error)
    if (allocated(error)) return
    call read_plain_real(word, value, note)
    if (len(note) > 0) call cursor%fault("expected "//what//", but found '"//shown(word)//"'", &
      & error, note)
  end subroutine number

  !> A real number from a word: plain ones in one read, others with all checks.
  subroutine read_plain_real(word, value, note)
    character(*), intent(in) :: word                !! without blanks
    real(wp), intent(out) :: value                  !! its value, if `note` is ''
    character(:), allocatable, intent(out) :: note  !! what was expected; '' if the word is good
    integer :: mark, status, begin

    begin = 1
    if (len(word) > 1 .and. scan(word(1:1), '+-') == 1) begin = 2
    mark = scan(word, 'eEdD')
    if (mark == 0) mark = len(word) + 1
    if (len(word) <= 30 .and. begin < mark) then
      if (verify(word(begin:mark - 1), '0123456789.') == 0 .and. len(word) - mark <= 3) then
        if (mark >= len(word) .or. (scan(word(mark + 1:min(mark + 1, len(word))), '+-') == 1 &
          & .and. len(word) > mark + 1 .and. verify(word(mark + 2:), '0123456789') == 0)) then
          read (word, *, iostat=status) value
          note = ''
          if (status == 0) return
        end if
      end if
    end if
    call parse_real(word, value, note, tiny_is_zero=.true.)
  end subroutine read_plain_real

  !> The next bytes, in the machine's order.
  subroutine bytes(cursor, what, taken, error)
    class(cursor_type), intent(inout) :: cursor
    character(*), intent(in) :: what
    ! allow(C072): its length says how many bytes are taken.
    character(*), intent(inout) :: taken
    type(error_type), allocatable, intent(out) :: error
    integer :: i, n

    n = len(taken)
    if (cursor%left() < n) then
      call cursor%fault('the file ends before '//what, error, 'it may have been cut off')
      return
    end if
    if (cursor%swapped) then
      do i = 1, n
        taken(i:i) = cursor%text(cursor%at + n - i:cursor%at + n - i)
      end do
    else
      taken = cursor%text(cursor%at:cursor%at + n - 1)
    end if
    cursor%at = cursor%at + n
  end subroutine bytes

  !> A word as a message shows it.
  pure function shown(word) result(text)
    character(*), intent(in) :: word   !! any characters of a file
    character(:), allocatable :: text

    text = printable(word(:min(len(word), longest_shown)))
    if (len(word) > longest_shown) text = text//'..'
  end function shown

end module pd_body_mesh_cursor
