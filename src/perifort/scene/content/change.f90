!> Give a key of a scanned scene another value, as if the user had written it: a word of `&study`,
!> or one of the option `--set` of the command line.
!>
!> The new values keep the place of the text they come from, so that errors in them are reported
!> there. The scene is read anew afterwards: a changed scene obeys the same rules as any.
module pd_scene_content_change
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp
  use pd_base_text, only: join, lower_case, nearest_name, to_text
  use pd_scene_format_elements, only: find_elements, growing
  use pd_scene_content_groups, only: list_groups, table_of
  use pd_scene_content_types, only: group_table, name_length, path_length, scene_type
  use pd_scene_format_file, only: line_type
  use pd_scene_format_find, only: find_section
  use pd_scene_format_keys, only: keys_type, real_or_expression
  use pd_scene_format_source, only: add_option, check_text, entry_type, scan_source, section_type, &
    & source_fault, source_type, token_type
  use pd_scene_format_values, only: parse_real
  implicit none (type, external)
  private
  public :: target_type, find_target, change_key, words_of, full_name, apply_changes, scan_scene

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

  !> The text of a scene that has been read before, scanned again, with the changes of `--set`. An
  !> error is set if the text cannot be scanned or a change is wrong.
  subroutine scan_scene(scene, source, error)
    type(scene_type), intent(in) :: scene          !! with its text
    type(source_type), intent(out) :: source       !! the scanned text with the changes in it
    type(error_type), allocatable, intent(out) :: error
    type(group_table) :: table

    call scan_source(scene%text, scene%file, source, error)
    if (allocated(error) .or. .not. allocated(scene%changes)) return
    call table_of(scene, table)
    call apply_changes(source, scene%changes, error, table)
  end subroutine scan_scene

  !> Change a scanned scene as `--set group%key=value` asks, in this order. What is wrong with a
  !> change has its place on the command line.
  subroutine apply_changes(source, changes, error, table)
    type(source_type), intent(inout) :: source
      !! scanned; with the new values, and the options as lines of its text, on return
    type(line_type), intent(in) :: changes(:)         !! `group%key=value`, a change each
    type(error_type), allocatable, intent(out) :: error
    type(group_table), intent(in), optional :: table  !! of the groups; without, the program's own
    character(*), parameter :: option = '--set '
    type(target_type) :: target
    type(token_type) :: place
    type(token_type), allocatable :: tokens(:)
    character(path_length) :: names(size(changes))
    integer :: i, equals

    do i = 1, size(changes)
      associate (change => changes(i)%text)
        call add_option(source, option//change, place%line)
        call check_text(source, error)
        if (allocated(error)) return
        equals = index(change, '=')
        place%column = len(option) + 1
        place%width = max(1, equals - 1)
        if (equals < 2 .or. len_trim(change) == equals) then
          place%width = max(1, len(change))
          call source_fault(source, place%line, place%column, place%width, &
            & 'a change without a key or a value', 'expected group%key=value', error)
          return
        end if
        call find_target(source, change(:equals - 1), place, target, error, table, setting=.true.)
        if (allocated(error)) return
        names(i) = full_name(source, target)
        if (any(names(:i - 1) == names(i))) then
          call source_fault(source, place%line, place%column, place%width, "'"//trim(names(i))// &
            & "' is set twice", 'give one of the values', error)
          return
        end if
        call option_tokens(source, target, change(equals + 1:), len(option) + equals, place%line, &
          & tokens, error)
        if (allocated(error)) return
        call put_tokens(source, target, tokens, place, error)
        if (allocated(error)) return
      end associate
    end do
  end subroutine apply_changes

  !> The tokens of a value on the command line: written as in the file, but that texts need no
  !> quotes, which the shell takes away.
  subroutine option_tokens(source, target, value, before, line, tokens, error)
    type(source_type), intent(in) :: source
    type(target_type), intent(in) :: target
    character(*), intent(in) :: value
    integer, intent(in) :: before        !! columns of the option before the value
    integer, intent(in) :: line          !! of the option
    type(token_type), allocatable, intent(out) :: tokens(:)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: frame = '&x k = '
    type(source_type) :: inside
    type(error_type), allocatable :: fault
    type(token_type) :: token
    character(:), allocatable :: note
    real(wp) :: number
    logical :: plain
    integer :: last, i, next, first

    last = len_trim(value)
    plain = index(target%kind, 'text') == 1
    if (target%kind == real_or_expression) then
      call parse_real(trim(value), number, note)
      plain = len(note) > 0
    end if
    if (plain .and. value(:1) /= "'" .and. value(:1) /= '"') then
      allocate (tokens(0))
      first = 1
      do while (first <= last)
        next = last + 1
        if (target%kind == 'text list' .and. .not. allocated(target%subscript)) &
          & next = first + index(value(first:last)//',', ',') - 1
        token%text = trim(adjustl(value(first:next - 1)))
        token%quoted = .true.
        token%line = line
        token%column = before + first
        token%width = max(1, next - first)
        tokens = [tokens, token]
        first = next + 1
      end do
      return
    end if
    call scan_source(frame//value//' /', '', inside, fault)
    if (.not. allocated(fault)) then
      i = inside%token_count
      if (inside%entry_count == 1 .and. i > 0) then
        ! nothing may follow, be it another key or the end of the group
        if (inside%tokens(i)%column + inside%tokens(i)%width - 1 >= len(frame) + last) &
          & tokens = inside%tokens
      end if
    end if
    if (.not. allocated(tokens)) then
      call source_fault(source, line, before + 1, max(1, last), "bad value '"//trim(value)// &
        & "' for key '"//target%key//"'", 'expected a value as after key = in the file', error)
      return
    end if
    do i = 1, size(tokens)
      tokens(i)%line = line
      tokens(i)%column = tokens(i)%column - len(frame) + before
    end do
    if (allocated(target%subscript) .and. (size(tokens) > 1 .or. any(tokens%repeat > 1))) &
      & call source_fault(source, line, before + 1, max(1, last), "too many values for '"// &
      & target%key//'('//target%subscript//")'", 'expected one', error)
  end subroutine option_tokens

  !> The key that `name` means: `group%key`, `group.key`, or `key` alone where only one group has
  !> such a key; a group that is repeated needs its number, `group(2)%key`; `key(2)` is an element.
  !> `place` is where the name stands, for messages. An error is set if no key or several keys are
  !> meant, or if the scene has no such group.
  subroutine find_target(source, name, place, target, error, table, setting)
    type(source_type), intent(in) :: source           !! the scanned scene
    character(*), intent(in) :: name  !! of the key, in any case, with or without blanks
    type(token_type), intent(in) :: place             !! where the name stands
    type(target_type), intent(out) :: target  !! the key with its group, number, subscript and kind
    type(error_type), allocatable, intent(out) :: error
    type(group_table), intent(in), optional :: table  !! of the groups; without, the program's own
    logical, intent(in), optional :: setting          !! for `--set`; without, for `&study`
    type(group_table) :: known
    character(name_length), allocatable :: names(:)
    character(:), allocatable :: text, number, verb, done
    integer :: at, status
    logical :: repeatable

    if (present(table)) then
      known = table
    else
      call list_groups(known)
    end if
    names = known%names()
    verb = 'vary'
    done = 'varied'
    if (present(setting)) then
      if (setting) then
        verb = 'set'
        done = 'set'
      end if
    end if
    ! a study that varies itself would have no end
    if (verb == 'vary') names = pack(names, names /= 'study')
    text = without_blanks(lower_case(name))
    at = scan(text, '%.')
    target%group = text(:max(0, at - 1))
    target%key = text(at + 1:)
    call cut_subscript(target%key, target%subscript)
    call cut_subscript(target%group, number)
    if (index(target%group, '&') == 1) target%group = target%group(2:)
    if (at == 0) then
      call search_groups(source, known, names, place, target, error)
    else if (all(names /= target%group)) then
      call bad("no group &"//target%group//' can be '//done, hint(target%group, names))
    end if
    if (allocated(error)) return
    call describe(known, target)
    if (len(target%kind) == 0) then
      call bad("&"//target%group//" has no key '"//target%key//"'", hint(target%key, &
        & keys_of(known, target%group)))
      return
    end if
    repeatable = known%entries(known%place_of(target%group))%repeatable
    target%numbered = allocated(number)
    if (target%numbered) then
      read (number, *, iostat=status) target%number
      if (status /= 0 .or. verify(number, '0123456789') > 0) target%number = 0
      if (target%number < 1 .or. find_section(source, target%group, target%number) == 0) &
        & call bad('there is no group &'//target%group//' number '//number, &
        & 'the scene has '//to_text(groups_named(source, target%group)))
    else if (repeatable .and. (target%key /= 'points' .or. verb == 'set')) then
      ! a study varies the points of all bodies together
      if (groups_named(source, target%group) > 1) call bad('the scene has '// &
        & to_text(groups_named(source, target%group))//' groups &'//target%group, &
        & 'say which: '//target%group//'(1)%'//target%key)
    end if
    if (allocated(error)) return
    if (repeatable .and. groups_named(source, target%group) == 0) &
      & call bad('the scene has no group &'//target%group, 'there is nothing to '//verb)

  contains

    subroutine bad(message, note)
      character(*), intent(in) :: message, note
      if (.not. allocated(error)) call source_fault(source, place%line, place%column, &
        & place%width, message, note, error)
    end subroutine bad
  end subroutine find_target

  !> The group of a key that is named alone.
  subroutine search_groups(source, table, names, place, target, error)
    type(source_type), intent(in) :: source
    type(group_table), intent(in) :: table
    character(*), intent(in) :: names(:)       !! of the groups to be searched
    type(token_type), intent(in) :: place
    type(target_type), intent(inout) :: target
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: found
    integer :: g, number

    number = 0
    found = ''
    do g = 1, size(names)
      target%group = trim(names(g))
      call describe(table, target)
      if (len(target%kind) == 0) cycle
      if (table%entries(table%place_of(target%group))%repeatable .and. &
        & groups_named(source, target%group) == 0) cycle
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
    type(source_type), intent(in) :: source  !! the scanned scene
    type(target_type), intent(in) :: target  !! as `find_target` found it
    character(:), allocatable :: name

    name = target%group
    if (groups_named(source, target%group) > 1) name = name//'('//to_text(target%number)//')'
    name = name//'%'//target%key
    if (allocated(target%subscript)) name = name//'('//target%subscript//')'
  end function full_name

  !> Give the key the value that `word` says: one value as it is written, or several parted by
  !> commas. `place` is where it stands. An error is set if the key has no such element.
  subroutine change_key(source, target, word, place, error)
    type(source_type), intent(inout) :: source  !! scanned; with the new value on return
    type(target_type), intent(in) :: target     !! as `find_target` found it
    character(*), intent(in) :: word            !! the value, as in a scene file
    type(token_type), intent(in) :: place       !! gets the blame for what is wrong with the value
    type(error_type), allocatable, intent(out) :: error
    type(token_type), allocatable :: tokens(:)

    call words_of(word, place, tokens)
    call put_tokens(source, target, tokens, place, error)
  end subroutine change_key

  !> Give the key the value that the tokens say, or an element that the first of them says.
  subroutine put_tokens(source, target, tokens, place, error)
    type(source_type), intent(inout) :: source
    type(target_type), intent(in) :: target
    type(token_type), intent(in) :: tokens(:)
    type(token_type), intent(in) :: place      !! of the key
    type(error_type), allocatable, intent(out) :: error
    integer :: section

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
  end subroutine put_tokens

  !> The tokens of a word as it is written: a text in quotes, or values parted by commas.
  subroutine words_of(word, place, tokens)
    character(*), intent(in) :: word                         !! the value, as in a scene file
    type(token_type), intent(in) :: place                    !! given to all tokens
    type(token_type), allocatable, intent(out) :: tokens(:)  !! (values) each without quotes
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
        & target%subscript//")' is not an element of '"//target%key//"'", 'it is '// &
        & target%kind, error)
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
  subroutine describe(table, target)
    type(group_table), intent(in) :: table
    type(target_type), intent(inout) :: target
    type(keys_type) :: keys
    integer :: k

    target%kind = ''
    call table%describe(target%group, keys)
    do k = 1, keys%count
      if (keys%known(k)%name == target%key) target%kind = keys%known(k)%kind
    end do
  end subroutine describe

  !> The names of all keys of a group.
  function keys_of(table, group) result(names)
    type(group_table), intent(in) :: table
    character(*), intent(in) :: group
    character(name_length), allocatable :: names(:)
    type(keys_type) :: keys
    integer :: k

    call table%describe(group, keys)
    allocate (names(keys%count))
    do k = 1, keys%count
      names(k) = keys%known(k)%name
    end do
  end function keys_of

  !> The shape given by a key's kind.
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
