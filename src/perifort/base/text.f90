!> Text: numbers as words, lower case, the nearest of some names, joining and padding.
module pd_base_text
  use pd_base_kinds, only: wp, i8
  implicit none (type, external)
  private
  public :: to_text, lower_case, nearest_name, edit_distance, join, with_unit, newline
  public :: is_control, printable, labelled_line, counted

  character(*), parameter :: newline = new_line('a')

  !> A number in its shortest readable form.
  interface to_text
    module procedure :: integer_to_text, long_to_text, real_to_text, logical_to_text
  end interface to_text

contains

  !> An integer without blanks.
  pure function integer_to_text(value) result(text)
    integer, intent(in) :: value  !! any integer
    character(:), allocatable :: text
    text = long_to_text(int(value, i8))
  end function integer_to_text

  !> A long integer without blanks.
  pure function long_to_text(value) result(text)
    integer(i8), intent(in) :: value  !! any long integer
    character(:), allocatable :: text
    character(24) :: buffer
    write (buffer, '(i0)') value
    text = trim(buffer)
  end function long_to_text

  !> A real with `digits` significant digits (default 6), trailing zeros cut.
  pure function real_to_text(value, digits) result(text)
    real(wp), intent(in) :: value            !! any real, NaN and infinity too
    integer, intent(in), optional :: digits  !! significant ones, at least 1; absent: 6
    character(:), allocatable :: text
    character(40) :: buffer
    character(16) :: form
    integer :: n, e, last

    n = 6
    if (present(digits)) n = digits
    if (abs(value) >= 1.0e-3_wp .and. abs(value) < 1.0e6_wp) then
      e = max(0, n - 1 - floor(log10(abs(value))))
      write (form, '("(f40.",i0,")")') e
      write (buffer, form) value
      text = trim(adjustl(buffer))
      if (index(text, '.') > 0) then
        last = verify(text, '0', back=.true.)
        if (text(last:last) == '.') last = last - 1
        text = text(:last)
      end if
    else if (abs(value) > 0.0_wp) then
      write (form, '("(es40.",i0,"e3)")') n - 1
      write (buffer, form) value
      text = shorten_exponent(trim(adjustl(buffer)))
    else
      text = '0'
    end if
  end function real_to_text

  !> `1.20000E-005` -> `1.2e-5`; text without an exponent (NaN, Infinity) is left alone.
  pure function shorten_exponent(number) result(text)
    character(*), intent(in) :: number
    character(:), allocatable :: text
    character(8) :: exponent
    integer :: at, last, e, status

    at = index(number, 'E')
    text = number
    if (at == 0) return
    read (number(at + 1:), *, iostat=status) e
    if (status /= 0) return
    last = verify(number(:at - 1), '0', back=.true.)
    if (number(last:last) == '.') last = last - 1
    write (exponent, '(i0)') e
    text = number(:last)//'e'//trim(exponent)
  end function shorten_exponent

  !> `true` or `false`.
  pure function logical_to_text(value) result(text)
    logical, intent(in) :: value  !! to be named
    character(:), allocatable :: text
    text = trim(merge('true ', 'false', value))
  end function logical_to_text

  !> A value with an SI prefix and a unit: `with_unit(1.946e-7, 's')` is `194.6 ns`.
  pure function with_unit(value, unit, digits) result(text)
    real(wp), intent(in) :: value            !! in the unit without a prefix
    character(*), intent(in) :: unit         !! its symbol, to which a prefix may be put
    integer, intent(in), optional :: digits  !! significant ones, at least 1; absent: 6
    character(:), allocatable :: text
    character(*), parameter :: prefixes(-5:4) = ['f', 'p', 'n', 'u', 'm', ' ', 'k', 'M', 'G', 'T']
    integer :: step

    step = 0
    if (abs(value) > 0.0_wp) step = min(4, max(-5, floor(log10(abs(value))/3.0_wp + 1.0e-12_wp)))
    text = real_to_text(value/10.0_wp**(3*step), digits)//' '//trim(prefixes(step))//unit
    if (step == 0) text = real_to_text(value, digits)//' '//unit
  end function with_unit

  !> A number of things: `1 point`, `12 points`.
  pure function counted(number, thing) result(text)
    integer, intent(in) :: number      !! how many there are
    character(*), intent(in) :: thing  !! in the singular; the plural has an s more
    character(:), allocatable :: text
    text = to_text(number)//' '//thing
    if (number /= 1) text = text//'s'
  end function counted

  !> A line of a summary: a label, its content in a column of its own, a newline.
  pure function labelled_line(label, content) result(text)
    character(*), intent(in) :: label     !! at most 15 characters, which leave a blank
    character(*), intent(in) :: content   !! of any length, without a newline
    character(:), allocatable :: text
    character(18) :: column
    column = '  '//label
    text = column//content//newline
  end function labelled_line

  !> ASCII letters in lower case.
  pure function lower_case(text) result(lower)
    character(*), intent(in) :: text  !! any characters; those beyond ASCII stay
    character(len(text)) :: lower
    integer :: i, code

    do i = 1, len(text)
      code = iachar(text(i:i))
      if (code >= iachar('A') .and. code <= iachar('Z')) code = code + 32
      lower(i:i) = achar(code)
    end do
  end function lower_case

  !> Whether a byte is a control character of ASCII.
  pure logical function is_control(byte)
    character, intent(in) :: byte  !! one character of a text
    is_control = iachar(byte) < 32 .or. iachar(byte) == 127
  end function is_control

  !> A text as it may be shown on a terminal: control characters, by which a file name or a line of
  !> a file could move the cursor or worse, become question marks. Line ends and tabs stay.
  pure function printable(text) result(shown)
    character(*), intent(in) :: text  !! any characters, from a file or the command line
    character(len(text)) :: shown
    integer :: i

    shown = text
    do i = 1, len(text)
      if (is_control(text(i:i)) .and. text(i:i) /= newline .and. text(i:i) /= achar(9)) &
        & shown(i:i) = '?'
    end do
  end function printable

  !> The one of `names` that `name` was probably meant to be; '' if none is near.
  pure function nearest_name(name, names) result(nearest)
    character(*), intent(in) :: name      !! as it was typed; case does not matter
    character(*), intent(in) :: names(:)  !! (any number) that are allowed
    character(:), allocatable :: nearest
    integer :: i, distance, best

    nearest = ''
    best = max(2, len_trim(name)/3) + 1
    do i = 1, size(names)
      distance = edit_distance(lower_case(trim(name)), lower_case(trim(names(i))))
      if (distance < best) then
        best = distance
        nearest = trim(names(i))
      end if
    end do
  end function nearest_name

  !> Least number of insertions, deletions, substitutions and swaps of neighbours from `a` to `b`.
  pure integer function edit_distance(a, b) result(distance)
    character(*), intent(in) :: a  !! one text; blanks and case count
    character(*), intent(in) :: b  !! the other
    integer :: d(0:len(a), 0:len(b))
    integer :: i, j, k, l, cost

    d(:, 0) = [(i, i=0, len(a))]
    d(0, :) = [(j, j=0, len(b))]
    do j = 1, len(b)
      do i = 1, len(a)
        cost = merge(0, 1, a(i:i) == b(j:j))
        d(i, j) = min(d(i - 1, j) + 1, d(i, j - 1) + 1, d(i - 1, j - 1) + cost)
        if (min(i, j) == 1) cycle
        k = max(i - 2, 0)
        l = max(j - 2, 0)
        if (a(i:i) == b(l + 1:l + 1) .and. a(k + 1:k + 1) == b(j:j)) &
          & d(i, j) = min(d(i, j), d(k, l) + 1)
      end do
    end do
    distance = d(len(a), len(b))
  end function edit_distance

  !> Names in one line, parted by `separator`.
  pure function join(names, separator) result(text)
    character(*), intent(in) :: names(:)   !! (any number); blanks at their ends are cut
    character(*), intent(in) :: separator  !! between two names, blanks included
    character(:), allocatable :: text
    integer :: i

    text = ''
    do i = 1, size(names)
      if (i > 1) text = text//separator
      text = text//trim(names(i))
    end do
  end function join

end module pd_base_text
