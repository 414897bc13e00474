!> Give a key of a scanned scene another value, as if the user had written it.
!>
!> The new words carry the place of the text they come from, so that what is wrong with them is
!> reported there. The scene is read anew afterwards: a changed scene obeys the same rules as any.
module pd_scene_content_change
  use pd_base_error, only: error_type
  use pd_base_text, only: join, lower_case, nearest_name, to_text
  use pd_scene_format_elements, only: find_elements, growing
  use pd_scene_content_groups, only: describe_group, group_names, group_repeatable
  use pd_scene_format_keys, only: keys_type
  use pd_scene_content_rules, only: find_section
  use pd_scene_format_source, only: entry_type, section_type, source_fault, source_type, token_type
  use pd_scene_content_types, only: name_length
  implicit none (type, external)
  private
  public :: target_type, find_target, change_key, words_of, full_name

  !> A key of a scene, or an element of one.
  type :: target_type
    character(:), allocatable :: group
    integer :: number = 1                    !! of the group among those of its name
    logical :: numbered = .false.            !! the user has given the number
    character(:), allocatable :: key
    character(:), allocatable :: subscript   !! unallocated without
    character(:), allocatable :: kind        !! of the key, as in the reference: 'real(3)', ...
  end type target_type

contains

  !> The key that `name` means: `group%key`, `group.key`, or `key` alone where only one group has
  !> such a key; a group that is repeated needs its number, `group(2)%key`; `key(2)` is an element.
  !> `place` is where the name stands, for messages.
  subroutine find_target(source, name, place, target, error)
    type(source_type), intent(in) :: source
    character(*), intent(in) :: name
    type(token_type), intent(in) :: place
    type(target_type), intent(out) :: target
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: text, number
    integer :: at, status

    text = without_blanks(lower_case(name))
    at = scan(text, '%.')
    target%group = text(:max(0, at - 1))
    target%key = text(at + 1:)
    call cut_subscript(target%key, target%subscript)
    call cut_subscript(target%group, number)
    if (index(target%group, '&') == 1) target%group = target%group(2:)
    if (at == 0) then
      call search_groups(source, place, target, error)
    else if (all(group_names /= target%group) .or. target%group == 'study') then
      call bad("no group &"//target%group//' can be varied', hint(target%group, &
        & pack(group_names, group_names /= 'study')))
    end if
    if (allocated(error)) return
    call describe(target)
    if (len(target%kind) == 0) then
      call bad("&"//target%group//" has no key '"//target%key//"'", hint(target%key, &
        & keys_of(target%group)))
      return
    end if
    target%numbered = allocated(number)
    if (target%numbered) then
      read (number, *, iostat=status) target%number
      if (status /= 0 .or. verify(number, '0123456789') > 0) target%number = 0
      if (target%number < 1 .or. find_section(source, target%group, target%number) == 0) &
        & call bad('there is no group &'//target%group//' number '//number, &
        & 'the scene has '//to_text(groups_named(source, target%group)))
    else if (group_repeatable(target%group) .and. target%key /= 'points') then
      if (groups_named(source, target%group) > 1) call bad('the scene has '// &
        & to_text(groups_named(source, target%group))//' groups &'//target%group, &
        & 'say which: '//target%group//'(1)%'//target%key)
    end if
    if (allocated(error)) return
    if (group_repeatable(target%group) .and. groups_named(source, target%group) == 0) &
      & call bad('the scene has no group &'//target%group, 'there is nothing to vary')

  contains

    subroutine bad(message, note)
      character(*), intent(in) :: message, note
      if (.not. allocated(error)) call source_fault(source, place%line, place%column, &
        & place%width, message, note, error)
    end subroutine bad
  end subroutine find_target

  !> The group of a key that is named alone.
  subroutine search_groups(source, place, target, error)
    type(source_type), intent(in) :: source
    type(token_type), intent(in) :: place
    type(target_type), intent(inout) :: target
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: found
    integer :: g, number

    number = 0
    found = ''
    do g = 1, size(group_names)
      if (group_names(g) == 'study') cycle
      target%group = trim(group_names(g))
      call describe(target)
      if (len(target%kind) == 0) cycle
      if (group_repeatable(target%group) .and. groups_named(source, target%group) == 0) cycle
      number = number + 1
      if (number > 1) found = found//', '
      found = found//target%group//'%'//target%key
    end do
    if (number == 1) then
      target%group = found(:index(found, '%') - 1)
    else if (number == 0) then
      call source_fault(source, place%line, place%column, place%width, "no group of the scene "// &
        & "has a key '"//target%key//"'", 'expected group%key, as in horizon%ratio', error)
    else
      call source_fault(source, place%line, place%column, place%width, "'"//target%key// &
        & "' is a key of several groups", 'say which: '//found, error)
    end if
  end subroutine search_groups

  !> The name in full, `group(2)%key(1)`; the number only where the scene has several such groups.
  function full_name(source, target) result(name)
    type(source_type), intent(in) :: source
    type(target_type), intent(in) :: target
    character(:), allocatable :: name

    name = target%group
    if (groups_named(source, target%group) > 1) name = name//'('//to_text(target%number)//')'
    name = name//'%'//target%key
    if (allocated(target%subscript)) name = name//'('//target%subscript//')'
  end function full_name

  !> Give the key the value that `word` says: one value as it is written, or several parted by
  !> commas. `place` is where it stands.
  subroutine change_key(source, target, word, place, error)
    type(source_type), intent(inout) :: source
    type(target_type), intent(in) :: target
    character(*), intent(in) :: word
    type(token_type), intent(in) :: place
    type(error_type), allocatable, intent(out) :: error
    type(token_type), allocatable :: tokens(:)
    integer :: section

    call words_of(word, place, tokens)
    section = find_section(source, target%group, target%number)
    if (section == 0) then
      call append_section(source, target%group, place)
      section = size(source%sections)
    end if
    if (allocated(target%subscript)) then
      call change_element(source, section, target, tokens(1), error)
    else
      call replace_entries(source, section, target%key, [''], [1], tokens, place)
    end if
  end subroutine change_key

  !> The tokens of a word as it is written: a text in quotes, or values parted by commas.
  subroutine words_of(word, place, tokens)
    character(*), intent(in) :: word
    type(token_type), intent(in) :: place
    type(token_type), allocatable, intent(out) :: tokens(:)
    character(:), allocatable :: rest
    integer :: number, i, comma

    rest = trim(adjustl(word))
    if (index(rest, "'") == 1) then
      allocate (tokens(1))
      tokens(1) = place
      tokens(1)%text = undoubled(rest(2:len(rest) - 1))
      tokens(1)%quoted = .true.
      tokens(1)%repeat = 1
      return
    end if
    number = 1
    do i = 1, len(rest)
      if (rest(i:i) == ',') number = number + 1
    end do
    allocate (tokens(number))
    do i = 1, number
      comma = index(rest//',', ',')
      tokens(i) = place
      tokens(i)%text = trim(adjustl(rest(:comma - 1)))
      tokens(i)%quoted = .false.
      tokens(i)%repeat = 1
      rest = rest(min(comma + 1, len(rest) + 1):)
    end do
  end subroutine words_of

  !> Doubled quotes made one.
  pure function undoubled(text) result(plain)
    character(*), intent(in) :: text
    character(:), allocatable :: plain
    integer :: at, next

    plain = ''
    at = 1
    do
      next = index(text(at:), "''")
      if (next == 0) exit
      plain = plain//text(at:at + next - 1)
      at = at + next + 1
    end do
    plain = plain//text(at:)
  end function undoubled

  !> Change one element of a vector, a matrix or a list; the others keep their words.
  subroutine change_element(source, section, target, token, error)
    type(source_type), intent(inout) :: source
    integer, intent(in) :: section
    type(target_type), intent(in) :: target
    type(token_type), intent(in) :: token
    type(error_type), allocatable, intent(out) :: error
    type(token_type), allocatable :: tokens(:)
    character(name_length), allocatable :: subscripts(:)
    integer, allocatable :: extents(:), slots(:), with(:), given(:)
    logical, allocatable :: used(:)
    integer :: element, i, n

    call extents_of(target, extents)
    element = element_of(target%subscript, extents)
    if (element == 0) then
      call source_fault(source, token%line, token%column, token%width, "'"//target%key//'('// &
        & target%subscript//")' is no element of '"//target%key//"'", 'it is '//target%kind, error)
      return
    end if
    allocate (used(size(source%entries)))
    call find_elements(source, section, target%key, extents, slots, used, error)
    if (allocated(error)) return
    allocate (given(max(size(slots), element)), source=0)
    given(:size(slots)) = slots
    given(element) = -1
    n = count(given /= 0)
    allocate (tokens(n), subscripts(n), with(n))
    n = 0
    do i = 1, size(given)
      if (given(i) == 0) cycle
      n = n + 1
      if (given(i) < 0) tokens(n) = token
      if (given(i) > 0) tokens(n) = source%tokens(given(i))
      tokens(n)%repeat = 1
      with(n) = n
      subscripts(n) = to_text(i)
      if (size(extents) == 2) subscripts(n) = to_text(modulo(i - 1, extents(1)) + 1)//','// &
        & to_text((i - 1)/extents(1) + 1)
    end do
    call replace_entries(source, section, target%key, subscripts, with, tokens, token)
  end subroutine change_element

  !> Put other entries in the place of those of a key: entry i has the subscript `subscripts(i)`
  !> and the tokens from `first(i)` up to the next entry's.
  subroutine replace_entries(source, section, key, subscripts, first, tokens, place)
    type(source_type), intent(inout) :: source
    integer, intent(in) :: section
    character(*), intent(in) :: key, subscripts(:)
    integer, intent(in) :: first(:)
    type(token_type), intent(in) :: tokens(:), place
    type(entry_type), allocatable :: entries(:)
    type(token_type), allocatable :: longer(:)
    integer :: before, i, n, kept

    before = size(source%tokens)
    allocate (longer(before + size(tokens)))
    longer(:before) = source%tokens
    longer(before + 1:) = tokens
    call move_alloc(longer, source%tokens)
    source%token_count = size(source%tokens)

    allocate (entries(size(source%entries) + size(first)))
    n = 0
    do i = 1, source%sections(section)%last
      if (i >= source%sections(section)%first .and. source%entries(i)%key == key) cycle
      n = n + 1
      entries(n) = source%entries(i)
    end do
    kept = n
    do i = 1, size(first)
      n = n + 1
      entries(n)%key = key
      if (len_trim(subscripts(i)) > 0) entries(n)%subscript = trim(subscripts(i))
      entries(n)%line = place%line
      entries(n)%column = place%column
      entries(n)%width = place%width
      entries(n)%subscript_column = place%column
      entries(n)%first = before + first(i)
      entries(n)%last = before + size(tokens)
      if (i < size(first)) entries(n)%last = before + first(i + 1) - 1
    end do
    do i = source%sections(section)%last + 1, size(source%entries)
      entries(n + i - source%sections(section)%last) = source%entries(i)
    end do
    n = n - source%sections(section)%last
    source%sections(section)%last = kept + size(first)
    source%sections(section + 1:)%first = source%sections(section + 1:)%first + n
    source%sections(section + 1:)%last = source%sections(section + 1:)%last + n
    source%entry_count = size(source%entries) + n
    source%entries = entries(:source%entry_count)
  end subroutine replace_entries

  !> An empty group at the end.
  subroutine append_section(source, group, place)
    type(source_type), intent(inout) :: source
    character(*), intent(in) :: group
    type(token_type), intent(in) :: place
    type(section_type), allocatable :: sections(:)
    integer :: n

    n = size(source%sections)
    allocate (sections(n + 1))
    sections(:n) = source%sections
    sections(n + 1)%name = group
    sections(n + 1)%line = place%line
    sections(n + 1)%column = place%column
    sections(n + 1)%width = place%width
    sections(n + 1)%first = size(source%entries) + 1
    sections(n + 1)%last = size(source%entries)
    call move_alloc(sections, source%sections)
    source%section_count = n + 1
  end subroutine append_section

  !> The kind of a key, '' if its group has none of that name.
  subroutine describe(target)
    type(target_type), intent(inout) :: target
    type(keys_type) :: keys
    integer :: k

    target%kind = ''
    call describe_group(keys, target%group)
    do k = 1, keys%count
      if (keys%known(k)%name == target%key) target%kind = keys%known(k)%kind
    end do
  end subroutine describe

  !> The names of all keys of a group.
  function keys_of(group) result(names)
    character(*), intent(in) :: group
    character(name_length), allocatable :: names(:)
    type(keys_type) :: keys
    integer :: k

    call describe_group(keys, group)
    allocate (names(keys%count))
    do k = 1, keys%count
      names(k) = keys%known(k)%name
    end do
  end function keys_of

  !> The shape that a key's kind tells.
  subroutine extents_of(target, extents)
    type(target_type), intent(in) :: target
    integer, allocatable, intent(out) :: extents(:)
    integer :: opening, status

    opening = index(target%kind, '(')
    if (index(target%kind, 'list') > 0) then
      extents = growing
    else if (opening == 0) then
      extents = [integer ::]
    else
      allocate (extents(merge(2, 1, index(target%kind, ',') > 0)), source=0)
      read (target%kind(opening + 1:len(target%kind) - 1), *, iostat=status) extents
      if (status /= 0) extents = 0
    end if
  end subroutine extents_of

  !> The element, in the order of memory, that a subscript of whole numbers means; 0 if none.
  pure integer function element_of(subscript, extents) result(element)
    character(*), intent(in) :: subscript
    integer, intent(in) :: extents(:)
    integer :: at(size(extents)), status, commas, i

    element = 0
    commas = count([(subscript(i:i) == ',', i=1, len(subscript))])
    if (size(extents) == 0 .or. commas /= size(extents) - 1) return
    if (verify(subscript, '0123456789,') > 0) return
    read (subscript, *, iostat=status) at
    if (status /= 0) return
    if (any(at < 1) .or. any(at > extents)) return
    element = at(1)
    if (size(extents) == 2) element = at(1) + extents(1)*(at(2) - 1)
  end function element_of

  !> How many groups of a name there are.
  pure integer function groups_named(source, name) result(number)
    type(source_type), intent(in) :: source
    character(*), intent(in) :: name
    integer :: i

    number = 0
    do i = 1, source%section_count
      if (source%sections(i)%name == name) number = number + 1
    end do
  end function groups_named

  !> Take `(...)` off the end of a text.
  pure subroutine cut_subscript(text, subscript)
    character(:), allocatable, intent(inout) :: text
    character(:), allocatable, intent(out) :: subscript
    integer :: opening

    opening = index(text, '(')
    if (opening == 0 .or. index(text, ')') /= len(text)) return
    subscript = text(opening + 1:len(text) - 1)
    text = text(:opening - 1)
  end subroutine cut_subscript

  pure function without_blanks(text) result(dense)
    character(*), intent(in) :: text
    character(:), allocatable :: dense
    integer :: i

    dense = ''
    do i = 1, len_trim(text)
      if (text(i:i) /= ' ') dense = dense//text(i:i)
    end do
  end function without_blanks

  pure function hint(name, known) result(note)
    character(*), intent(in) :: name, known(:)
    character(:), allocatable :: note, nearest

    note = 'known: '//join(known, ', ')
    nearest = nearest_name(name, known)
    if (len(nearest) > 0) note = "did you mean '"//nearest//"'?  "//note
  end function hint

end module pd_scene_content_change
