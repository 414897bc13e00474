!> Surfaces from STL files, as text or binary. A text may have several solids, each with a name.
!> Normals of the file are not used: the corners of a facet turn to the left, seen from outside.
module pd_body_surface_stl
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, sp, i4, i8
  use pd_base_text, only: lower_case, printable, to_text
  use pd_body_mesh_cursor, only: cursor_type, read_plain_real, shown
  use pd_body_surface_surface, only: add_facet, finish_surface, surface_fault, surface_type
  use pd_scene_format_file, only: read_text_file
  use pd_scene_format_given, only: name_length
  use pd_scene_format_values, only: largest_real
  implicit none (type, external)
  private
  public :: read_stl, read_stl_text

  integer, parameter :: header = 84        !! bytes of a binary file before its facets
  integer, parameter :: facet_bytes = 50   !! of one facet
  integer, parameter :: most_facets = 500000000  !! numbers of edges have 32 bits

contains

  !> Read a surface. An error if the file cannot be read, is no STL file, or ends too early.
  subroutine read_stl(path, scale, surface, error)
    character(*), intent(in) :: path             !! of the file
    real(wp), intent(in) :: scale                !! metres of one unit of the file
    type(surface_type), intent(out) :: surface   !! finished
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: text

    call read_text_file(path, text, error)
    if (allocated(error)) return
    call read_stl_text(text, path, scale, surface, error)
  end subroutine read_stl

  !> Read a surface from the content of its file, with the errors of `read_stl`.
  subroutine read_stl_text(text, path, scale, surface, error)
    character(:), allocatable, intent(inout) :: text  !! of the file; deallocated on return
    character(*), intent(in) :: path                  !! its name, for messages
    real(wp), intent(in) :: scale                     !! metres of one unit of the file
    type(surface_type), intent(out) :: surface        !! finished
    type(error_type), allocatable, intent(out) :: error
    type(cursor_type) :: cursor
    integer(i8) :: first, last

    surface%file = path
    allocate (surface%names(8))
    cursor%file = path
    call move_alloc(text, cursor%text)
    ! some programs begin binary files with "solid", too: their length tells
    if (has_binary_length(cursor)) then
      call read_binary(cursor, scale, surface, error)
    else
      call cursor%next_word(first, last)
      if (is_word(cursor, first, last, 'solid') .and. .not. looks_binary(cursor)) then
        call read_lines(cursor, scale, surface, error)
      else
        call refuse_length(cursor, error)
      end if
    end if
    if (allocated(error)) return
    if (surface%n_facets == 0) then
      call surface_fault(surface, 'the surface has no facets', error)
      return
    end if
    call finish_surface(surface)
  end subroutine read_stl_text

  !> Whether the length of a file is the one that its count of facets asks for.
  pure logical function has_binary_length(cursor) result(fits)
    type(cursor_type), intent(in) :: cursor

    fits = len(cursor%text, kind=i8) >= header
    if (fits) fits = header + facet_bytes*count_in(cursor) == len(cursor%text, kind=i8)
  end function has_binary_length

  !> The count of facets of a binary file, unsigned, the low byte first.
  pure integer(i8) function count_in(cursor) result(number)
    type(cursor_type), intent(in) :: cursor
    integer :: i

    number = 0_i8
    do i = header, header - 3, -1
      number = 256_i8*number + iachar(cursor%text(i:i))
    end do
  end function count_in

  !> Whether a file that begins with "solid" holds bytes that no text has.
  pure logical function looks_binary(cursor) result(looks)
    type(cursor_type), intent(in) :: cursor
    looks = index(cursor%text(:min(512_i8, len(cursor%text, kind=i8))), achar(0)) > 0
  end function looks_binary

  !> A file that is neither a text nor a whole binary file.
  subroutine refuse_length(cursor, error)
    type(cursor_type), intent(inout) :: cursor
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: length

    length = len(cursor%text, kind=i8)
    if (length < header) then
      cursor%at = 1_i8
      call cursor%fault('this is no STL file', error, &
        & "expected a text that begins with 'solid', or a binary file of 84 bytes or more")
      return
    end if
    cursor%binary = .true.
    cursor%at = header - 3
    call cursor%fault('this is no STL file, or a damaged one: a binary file of '// &
      & to_text(count_in(cursor))//' facets has '//to_text(header + facet_bytes*count_in(cursor)) &
      & //' bytes, this one has '//to_text(length), error, &
      & "it may have been cut off; a text begins with 'solid'")
  end subroutine refuse_length

  !> The facets of a binary file: a normal, three corners, and two bytes without meaning.
  subroutine read_binary(cursor, scale, surface, error)
    type(cursor_type), intent(inout) :: cursor
    real(wp), intent(in) :: scale
    type(surface_type), intent(inout) :: surface
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: corners(3, 3)
    integer :: f, i, k, n
    integer(i8) :: begin

    call add_name(surface, name_in_header(cursor%text(:80)))
    cursor%binary = .true.
    if (count_in(cursor) > most_facets) then
      cursor%at = header - 3
      call cursor%fault('too many facets: '//to_text(count_in(cursor)), error)
      return
    end if
    n = int(count_in(cursor))
    do f = 1, n
      begin = header + facet_bytes*(f - 1_i8) + 12
      do i = 1, 3
        do k = 1, 3
          corners(k, i) = real_at(cursor%text, begin + 12*(i - 1) + 4*(k - 1) + 1)
        end do
      end do
      ! not a number is above no limit
      if (.not. all(abs(corners) <= largest_real)) then
        cursor%at = begin + 1
        call cursor%fault('facet '//to_text(f)//' has a corner that is not finite', error)
        return
      end if
      call add_facet(surface, scale*corners, 1, f, 0)
    end do
  end subroutine read_binary

  !> The number in four bytes, the low one first. What is not finite becomes a huge number.
  pure real(wp) function real_at(text, first) result(value)
    character(*), intent(in) :: text
    integer(i8), intent(in) :: first
    integer(i4) :: bits
    integer :: i

    bits = 0_i4
    do i = 3, 0, -1
      bits = ior(ishft(bits, 8), int(iachar(text(first + i:first + i)), i4))
    end do
    value = huge(value)
    ! all ones in the exponent: infinite or no number
    if (iand(ishft(bits, -23), 255_i4) /= 255_i4) value = real(transfer(bits, 0.0_sp), wp)
  end function real_at

  !> The name in the header of a binary file that begins with `solid NAME`; '' without.
  pure function name_in_header(text) result(name)
    character(*), intent(in) :: text
    character(:), allocatable :: name
    integer :: i

    name = ''
    if (lower_case(text(:6)) /= 'solid ') return
    name = text(7:)
    do i = 1, len(name)
      if (iachar(name(i:i)) >= 32 .and. iachar(name(i:i)) < 127) cycle
      name = name(:i - 1)
      exit
    end do
    name = trim(adjustl(name))
  end function name_in_header

  !> Add the name of a solid.
  pure subroutine add_name(surface, name)
    type(surface_type), intent(inout) :: surface
    character(*), intent(in) :: name
    character(name_length), allocatable :: longer(:)

    if (surface%n_solids == size(surface%names)) then
      allocate (longer(2*surface%n_solids))
      longer(:surface%n_solids) = surface%names
      call move_alloc(longer, surface%names)
    end if
    surface%n_solids = surface%n_solids + 1
    surface%names(surface%n_solids) = name
  end subroutine add_name

  !> Whether a word of the text is this one, in any case of letters.
  pure logical function is_word(cursor, first, last, word) result(is)
    type(cursor_type), intent(in) :: cursor
    integer(i8), intent(in) :: first, last
    character(*), intent(in) :: word

    is = .false.
    if (last - first + 1 /= len(word)) return
    is = cursor%text(first:last) == word
    if (.not. is) is = lower_case(cursor%text(first:last)) == word
  end function is_word

  !> The solids of a text. The cursor stands behind the first `solid`.
  subroutine read_lines(cursor, scale, surface, error)
    type(cursor_type), intent(inout) :: cursor
    real(wp), intent(in) :: scale
    type(surface_type), intent(inout) :: surface
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: name
    integer(i8) :: first, last
    real(wp) :: corners(3, 3)
    integer :: number, line, i
    logical :: found

    number = 0
    do
      call cursor%next_line(name, found)
      call add_name(surface, trim(adjustl(printable(name))))
      do
        call cursor%next_word(first, last)
        if (is_word(cursor, first, last, 'endsolid')) exit
        if (.not. is_word(cursor, first, last, 'facet')) then
          call expected("'facet' or 'endsolid'")
          return
        end if
        line = cursor%line
        if (number == most_facets) then
          call cursor%fault('too many facets', error)
          return
        end if
        number = number + 1
        call skip_normal()
        if (.not. allocated(error)) call word('outer')
        if (.not. allocated(error)) call word('loop')
        if (allocated(error)) return
        do i = 1, 3
          call word('vertex')
          if (.not. allocated(error)) call read_corner(cursor, number, corners(:, i), error)
          if (allocated(error)) return
        end do
        call word('endloop')
        if (.not. allocated(error)) call word('endfacet')
        if (allocated(error)) return
        call add_facet(surface, scale*corners, surface%n_solids, number, line)
      end do
      ! the name may stand again behind endsolid
      call cursor%next_line(name, found)
      call cursor%next_word(first, last)
      if (last < first) return
      if (is_word(cursor, first, last, 'solid')) cycle
      call expected("'solid' or the end of the file")
      return
    end do

  contains

    !> A word that must stand here.
    subroutine word(what)
      character(*), intent(in) :: what

      call cursor%next_word(first, last)
      if (.not. is_word(cursor, first, last, what)) call expected("'"//what//"'")
    end subroutine word

    !> The normal of a facet, which is not used.
    subroutine skip_normal()
      integer :: k

      call word('normal')
      do k = 1, 3
        if (allocated(error)) return
        call cursor%next_word(first, last)
        if (last < first) call expected('a normal')
      end do
    end subroutine skip_normal

    !> Something else stands here than what must.
    subroutine expected(what)
      character(*), intent(in) :: what

      if (last < first) then
        call cursor%fault('the file ends where '//what//' is expected', error, &
          & 'it may have been cut off')
      else
        call cursor%fault('expected '//what//", but found '"//shown(cursor%text(first:last))// &
          & "'", error, 'in facet '//to_text(max(1, number)))
      end if
    end subroutine expected

  end subroutine read_lines

  !> The three coordinates of a corner.
  subroutine read_corner(cursor, number, corner, error)
    type(cursor_type), intent(inout) :: cursor
    integer, intent(in) :: number             !! of the facet
    real(wp), intent(out) :: corner(3)
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: note
    integer(i8) :: first, last
    integer :: k
    logical :: plain

    corner = 0.0_wp
    do k = 1, 3
      call cursor%next_word(first, last)
      if (last < first) then
        call cursor%fault('the file ends inside of facet '//to_text(number), error, &
          & 'it may have been cut off')
        return
      end if
      call quick_real(cursor%text(first:last), corner(k), plain)
      if (plain) cycle
      call read_plain_real(cursor%text(first:last), corner(k), note)
      if (len(note) == 0) cycle
      call cursor%fault('expected a coordinate of facet '//to_text(number)//", but found '"// &
        & shown(cursor%text(first:last))//"'", error, note)
      return
    end do
  end subroutine read_corner

  !> A number of at most 15 digits and an exponent of at most 22: one product or quotient of two
  !> numbers without rounding, so that the result is rounded once. `plain` is false for others.
  pure subroutine quick_real(word, value, plain)
    character(*), intent(in) :: word
    real(wp), intent(out) :: value
    logical, intent(out) :: plain
    integer, parameter :: most = 22
    real(wp), parameter :: powers(0:most) = [1e0_wp, 1e1_wp, 1e2_wp, 1e3_wp, 1e4_wp, 1e5_wp, &
      & 1e6_wp, 1e7_wp, 1e8_wp, 1e9_wp, 1e10_wp, 1e11_wp, 1e12_wp, 1e13_wp, 1e14_wp, 1e15_wp, &
      & 1e16_wp, 1e17_wp, 1e18_wp, 1e19_wp, 1e20_wp, 1e21_wp, 1e22_wp]
    integer(i8) :: whole
    integer :: i, n, digits, behind, exponent, sign_of, begin, d
    logical :: point

    value = 0.0_wp
    plain = .false.
    n = len(word)
    begin = 1
    if (word(1:1) == '-' .or. word(1:1) == '+') begin = 2
    whole = 0_i8
    digits = 0
    behind = 0
    point = .false.
    do i = begin, n
      d = iachar(word(i:i)) - iachar('0')
      if (d >= 0 .and. d <= 9) then
        whole = 10_i8*whole + d
        digits = digits + 1
        if (digits > 15) return
        if (point) behind = behind + 1
      else if (word(i:i) == '.' .and. .not. point) then
        point = .true.
      else
        exit
      end if
    end do
    if (digits == 0) return
    exponent = 0
    if (i <= n) then
      if (word(i:i) /= 'e' .and. word(i:i) /= 'E') return
      i = i + 1
      if (i > n) return
      sign_of = 1
      if (word(i:i) == '-') sign_of = -1
      if (word(i:i) == '-' .or. word(i:i) == '+') i = i + 1
      if (i > n .or. n - i > 2) return
      do while (i <= n)
        d = iachar(word(i:i)) - iachar('0')
        if (d < 0 .or. d > 9) return
        exponent = 10*exponent + d
        i = i + 1
      end do
      exponent = sign_of*exponent
    end if
    exponent = exponent - behind
    if (abs(exponent) > most) return
    value = real(whole, wp)
    if (exponent < 0) then
      value = value/powers(-exponent)
    else
      value = value*powers(exponent)
    end if
    if (word(1:1) == '-') value = -value
    plain = abs(value) <= largest_real
  end subroutine quick_real

end module pd_body_surface_stl
