!> Which word of a scene file belongs to which element of a key: subscripts, ranges, repeat counts.
!>
!> `x = 1, 2`, `x(2) = 5`, `x(1:3) = 3*0`, `h(1, 2) = 0.1` and `h(:, 1) = 1, 0, 0` are all known.
!> Elements without a word keep their defaults, as in a namelist.
module pd_scene_format_elements
  use pd_base_error, only: error_type
  use pd_base_text, only: to_text
  use pd_scene_format_source, only: source_type, entry_type, token_type, source_fault
  use pd_scene_format_values, only: parse_integer
  implicit none (type, external)
  private
  public :: find_elements, growing

  integer, parameter :: growing(1) = [1000000]  !! extents of a list without a fixed length

contains

  !> The token that gives each element of `key` in group number `section`, 0 where none does.
  !>
  !> `extents` is the key's shape, of size 0 for a scalar; `slots` runs in the order of the
  !> elements in memory and ends with the last element given. `used` marks the entries taken.
  !> An error, with its place, for a wrong subscript, an element given twice or too many values.
  subroutine find_elements(source, section, key, extents, slots, used, error)
    type(source_type), intent(in) :: source        !! the scanned file
    integer, intent(in) :: section                 !! number of the group in it
    character(*), intent(in) :: key                !! in lower case
    integer, intent(in) :: extents(:)  !! (rank), shape of the key; of size 0 for a scalar
    integer, allocatable, intent(out) :: slots(:)  !! (elements), number of the token of each; 0:
                                                   !! not given
    logical, intent(inout) :: used(:)              !! (entries of the file), marks those of the key
    type(error_type), allocatable, intent(out) :: error
    integer :: e

    allocate (slots(0))
    do e = source%sections(section)%first, source%sections(section)%last
      if (source%entries(e)%key /= key) cycle
      used(e) = .true.
      call place_entry(source, section, source%entries(e), extents, slots, error)
      if (allocated(error)) return
    end do
  end subroutine find_elements

  !> Put the tokens of one entry into `slots`.
  subroutine place_entry(source, section, entry, extents, slots, error)
    type(source_type), intent(in) :: source
    integer, intent(in) :: section
    type(entry_type), intent(in) :: entry
    integer, intent(in) :: extents(:)
    integer, allocatable, intent(inout) :: slots(:)
    type(error_type), allocatable, intent(out) :: error
    integer :: lower(2), upper(2), i, j, t, r, element, total

    lower = 1
    upper = 1
    upper(:size(extents)) = extents
    if (allocated(entry%subscript)) then
      call read_subscript(source, entry, extents, lower, upper, error)
      if (allocated(error)) return
    end if
    if (size(extents) == 1) then
      ! Long lists in one go, instead of element by element below.
      total = 0
      do t = entry%first, entry%last
        total = min(upper(1) - lower(1) + 1, total + min(upper(1), source%tokens(t)%repeat))
      end do
      call widen(slots, lower(1) + total - 1)
    end if
    i = lower(1) - 1
    j = lower(2)
    do t = entry%first, entry%last
      do r = 1, source%tokens(t)%repeat
        i = i + 1
        if (i > upper(1)) then
          i = lower(1)
          j = j + 1
        end if
        if (j > upper(2)) then
          call surplus(source, entry, source%tokens(t), lower, upper, error)
          return
        end if
        element = i
        if (size(extents) == 2) element = i + extents(1)*(j - 1)
        call widen(slots, element)
        if (slots(element) /= 0) then
          call given_twice(source, section, entry, slots(element), error)
          return
        end if
        slots(element) = t
      end do
    end do
  end subroutine place_entry

  !> The error that a key or element has been given before.
  subroutine given_twice(source, section, entry, earlier, error)
    type(source_type), intent(in) :: source
    integer, intent(in) :: section
    type(entry_type), intent(in) :: entry
    integer, intent(in) :: earlier
    type(error_type), allocatable, intent(out) :: error

    call source_fault(source, entry%line, entry%column, entry%width, "duplicate key '"// &
      & entry%key//"' in group &"//source%sections(section)%name, &
      & 'already given on line '//to_text(source%tokens(earlier)%line), error)
  end subroutine given_twice

  !> The error that there are more values than places.
  subroutine surplus(source, entry, token, lower, upper, error)
    type(source_type), intent(in) :: source
    type(entry_type), intent(in) :: entry
    type(token_type), intent(in) :: token
    integer, intent(in) :: lower(2), upper(2)
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: note
    integer :: room

    room = product(upper - lower + 1)
    note = 'there is room for '//to_text(room)//' value'
    if (room > 1) note = note//'s'
    if (verify(token%text(:1), '+-.0123456789') > 0 .and. .not. token%quoted) &
      & note = note//'; units are not written, values are in SI units'
    call source_fault(source, token%line, token%column, token%width, &
      & "too many values for '"//entry%key//"'", note, error)
  end subroutine surplus

  !> `2`, `1:3`, `:`, `2:`, `1, 2`, `:, 1`: bounds in each direction.
  subroutine read_subscript(source, entry, extents, lower, upper, error)
    type(source_type), intent(in) :: source
    type(entry_type), intent(in) :: entry
    integer, intent(in) :: extents(:)
    integer, intent(inout) :: lower(2), upper(2)
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: part, rest, note
    integer :: d, comma, colon

    if (size(extents) == 0) then
      call bad("'"//entry%key//"' is a single value without subscript")
      return
    end if
    rest = entry%subscript
    do d = 1, size(extents)
      comma = index(rest, ',')
      if (comma == 0) comma = len(rest) + 1
      part = rest(:comma - 1)
      if ((comma > len(rest)) .neqv. (d == size(extents))) then
        call bad('expected '//to_text(size(extents))//' subscripts')
        return
      end if
      rest = rest(min(comma + 1, len(rest) + 1):)
      colon = index(part, ':')
      if (colon == 0) then
        call parse_integer(trim(adjustl(part)), lower(d), note)
        if (len(note) > 0) exit
        upper(d) = lower(d)
      else
        if (len_trim(part(:colon - 1)) > 0) then
          call parse_integer(trim(adjustl(part(:colon - 1))), lower(d), note)
          if (len(note) > 0) exit
        end if
        if (len_trim(part(colon + 1:)) > 0) then
          call parse_integer(trim(adjustl(part(colon + 1:))), upper(d), note)
          if (len(note) > 0) exit
        end if
      end if
      if (lower(d) < 1 .or. upper(d) > extents(d) .or. lower(d) > upper(d)) then
        call bad('subscripts run from 1 to '//to_text(extents(d)))
        return
      end if
    end do
    if (allocated(note)) then
      if (len(note) > 0) call bad('expected whole numbers, such as (2) or (1:3)')
    end if

  contains

    subroutine bad(reason)
      character(*), intent(in) :: reason
      call source_fault(source, entry%line, entry%subscript_column, max(1, len(entry%subscript)), &
        & "bad subscript of '"//entry%key//"'", trim(reason), error)
    end subroutine bad

  end subroutine read_subscript

  !> Let `slots` reach `element`; new ones are 0.
  subroutine widen(slots, element)
    integer, allocatable, intent(inout) :: slots(:)
    integer, intent(in) :: element
    integer, allocatable :: wider(:)

    if (element <= size(slots)) return
    allocate (wider(element), source=0)
    wider(:size(slots)) = slots
    call move_alloc(wider, slots)
  end subroutine widen

end module pd_scene_format_elements
