!> Tools for the rules that a scene must keep: a fault at the place of a key, names that must
!> exist, components that the dimension does not have.
!>
!> A scene built in memory has no source; its faults then name the group and the key only.
module pd_scene_content_rules
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type, fail
  use pd_base_text, only: join, lower_case, nearest_name, newline, to_text
  use pd_scene_content_change, only: scan_scene
  use pd_scene_format_file, only: resolve_path
  use pd_scene_format_find, only: find_entry, find_section, given
  use pd_scene_format_source, only: source_type, source_fault
  use pd_scene_content_types, only: scene_type, is_set, name_length
  implicit none (type, external)
  private
  public :: rule_fault, scene_fault, place_fault, given, check_known, check_unique, &
    & check_region, check_mesh_name, check_components, check_vector, check_finite_box, check_file, &
    & find_section, find_entry

contains

  !> A broken rule, at the key of the `number`-th group of this name, or at the group itself if
  !> the key is not given or ''. With `value`, at that value of the key.
  subroutine rule_fault(error, group, number, key, message, note, source, value)
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in) :: group                  !! name of the group, without `&`
    integer, intent(in) :: number                      !! which group of this name, from 1
    character(*), intent(in) :: key                    !! name of the key, or ''
    character(*), intent(in) :: message                !! what is wrong
    character(*), intent(in) :: note                   !! what was expected instead; '' for none
    type(source_type), intent(in), optional :: source
      !! the scanned file; without, the message names group, number and key
    character(*), intent(in), optional :: value
      !! the word that is wrong; without it, or if it is not there, the key is the place
    character(:), allocatable :: text
    integer :: section, entry, token

    if (.not. present(source)) then
      text = message//newline//' --> group &'//group//' number '//to_text(number)
      if (len(key) > 0) text = text//', key '//key
      if (len(note) > 0) text = text//newline//'  = '//note
      call fail(error, text)
      return
    end if
    section = find_section(source, group, number)
    if (section == 0) then
      call source_fault(source, 0, 0, 0, message, note, error)
      return
    end if
    token = 0
    if (present(value)) token = find_value(source, section, key, value)
    if (token > 0) then
      associate (place => source%tokens(token))
        call source_fault(source, place%line, place%column, place%width, message, note, error)
      end associate
      return
    end if
    entry = find_entry(source, section, key)
    if (entry == 0) then
      associate (place => source%sections(section))
        call source_fault(source, place%line, place%column, place%width, message, note, error)
      end associate
    else
      associate (place => source%entries(entry))
        call source_fault(source, place%line, place%column, place%width, message, note, error)
      end associate
    end if
  end subroutine rule_fault

  !> A fault that only the points of a scene show, at the place of the key that is to blame: as
  !> `rule_fault`, for a scene that has been read before. Its text is scanned again, which costs
  !> nothing that matters once something is wrong.
  subroutine scene_fault(error, scene, group, number, key, message, note, value)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type), intent(in) :: scene
      !! whose text gives the place; built in memory it gives none
    character(*), intent(in) :: group            !! name of the group, without `&`
    integer, intent(in) :: number                !! which group of this name, from 1
    character(*), intent(in) :: key              !! name of the key, or ''
    character(*), intent(in) :: message          !! what is wrong
    character(*), intent(in) :: note             !! what was expected instead; '' for none
    character(*), intent(in), optional :: value
      !! the word that is wrong; without it, or if it is not there, the key is the place
    type(source_type) :: source
    type(error_type), allocatable :: ignored

    if (allocated(scene%text)) then
      if (len(scene%text) > 0) then
        call scan_scene(scene, source, ignored)
        if (.not. allocated(ignored)) then
          call rule_fault(error, group, number, key, message, note, source, value)
          return
        end if
      end if
    end if
    call rule_fault(error, group, number, key, message, note)
  end subroutine scene_fault

  !> Give the error of a procedure that knows nothing of scene files a place: that of the group it
  !> blames, or of the one named here. One that has a place keeps it.
  subroutine place_fault(error, scene, group, number, key)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type), intent(in) :: scene  !! whose text gives the place
    character(*), intent(in) :: group      !! to blame if the error names none
    integer, intent(in) :: number          !! which group of this name, from 1
    character(*), intent(in) :: key        !! of that group, or ''
    type(error_type), allocatable :: placed

    if (.not. allocated(error)) return
    if (index(error%message, newline//' --> ') > 0) return
    if (allocated(error%group)) then
      call scene_fault(placed, scene, error%group, error%number, '', error%message, '')
    else
      call scene_fault(placed, scene, group, number, key, error%message, '')
    end if
    placed%status = error%status
    call move_alloc(placed, error)
  end subroutine place_fault

  !> The token of a value of a key in a group, whatever its case; 0 if it is not given.
  pure integer function find_value(source, section, key, value) result(token)
    type(source_type), intent(in) :: source
    integer, intent(in) :: section
    character(*), intent(in) :: key, value
    integer :: i

    do i = source%sections(section)%first, source%sections(section)%last
      if (source%entries(i)%key /= key) cycle
      do token = source%entries(i)%first, source%entries(i)%last
        if (lower_case(source%tokens(token)%text) == lower_case(value)) return
      end do
    end do
    token = 0
  end function find_value

  !> A name must be one of `names`; blank ones among these do not count.
  subroutine check_known(name, names, kind, group, number, key, error, source)
    character(*), intent(in) :: name                   !! to be found; a blank one is right
    character(*), intent(in) :: names(:)               !! (any number) the known ones
    character(*), intent(in) :: kind                   !! what they are names of, for the message
    character(*), intent(in) :: group                  !! name of the group, without `&`
    integer, intent(in) :: number                      !! which group of this name, from 1
    character(*), intent(in) :: key                    !! that has the name as its value
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    character(name_length), allocatable :: known(:)
    character(:), allocatable :: note, nearest

    if (len_trim(name) == 0 .or. any(names == name)) return
    allocate (known(count(names /= '')))
    known(:) = pack(names, names /= '')
    if (size(known) == 0) then
      note = 'no '//kind//' has a name'
    else
      note = 'known: '//join(known, ', ')
      nearest = nearest_name(name, known)
      if (len(nearest) > 0) note = "did you mean '"//nearest//"'?  "//note
    end if
    call rule_fault(error, group, number, key, 'no '//kind//" is named '"//trim(name)//"'", &
      & note, source)
  end subroutine check_known

  !> The name of a region, or of a set of a mesh as `BODY:NAME`; a blank one is right.
  subroutine check_region(scene, name, group, number, key, error, source)
    type(scene_type), intent(in) :: scene              !! with its regions and bodies
    character(*), intent(in) :: name                   !! to be found
    character(*), intent(in) :: group                  !! name of the group, without `&`
    integer, intent(in) :: number                      !! which group of this name, from 1
    character(*), intent(in) :: key                    !! that has the name as its value
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    character(name_length), allocatable :: names(:)
    integer :: i

    if (index(name, ':') > 0) then
      call check_mesh_name(scene, name, group, number, key, error, source)
      return
    end if
    allocate (names(size(scene%regions)))
    do i = 1, size(names)
      names(i) = scene%regions(i)%name
    end do
    call check_known(name, names, 'region', group, number, key, error, source)
  end subroutine check_region

  !> A name `BODY:NAME`: the body must be a mesh, or a surface if facets are meant. What its sets
  !> are is seen when it is read.
  subroutine check_mesh_name(scene, name, group, number, key, error, source, facets)
    type(scene_type), intent(in) :: scene              !! with its bodies
    character(*), intent(in) :: name                   !! with a colon
    character(*), intent(in) :: group                  !! name of the group, without `&`
    integer, intent(in) :: number                      !! which group of this name, from 1
    character(*), intent(in) :: key                    !! that has the name as its value
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    logical, intent(in), optional :: facets            !! whether facets are meant; absent: points
    character(name_length), allocatable :: names(:)
    integer :: i

    allocate (names(size(scene%bodies)))
    do i = 1, size(names)
      names(i) = scene%bodies(i)%name
    end do
    if (index(name, ':') == 1) then
      call rule_fault(error, group, number, key, "'"//trim(name)//"' names no body", &
        & "expected 'BODY:NAME'", source)
      return
    end if
    call check_known(name(:index(name, ':') - 1), names, 'body', group, number, key, error, source)
    if (allocated(error)) return
    i = findloc(names == name(:index(name, ':') - 1), .true., dim=1)
    if (scene%bodies(i)%surface /= '') then
      if (present(facets)) return
      call rule_fault(error, group, number, key, "'"//trim(name)//"' names facets of a "// &
        & 'surface, not points', "use it as a 'side', or give a &region", source)
      return
    end if
    if (scene%bodies(i)%mesh == '') call rule_fault(error, group, number, key, "the body '"// &
      & trim(names(i))//"' is no mesh: it has no named sets", &
      & "sets belong to a body with the key 'mesh'", source)
  end subroutine check_mesh_name

  !> Names must differ; blank ones do not count.
  subroutine check_unique(names, group, error, source)
    character(*), intent(in) :: names(:)               !! (groups) of all groups of a kind
    character(*), intent(in) :: group                  !! the kind, without `&`
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    integer :: i

    do i = 2, size(names)
      if (names(i) == '' .or. all(names(:i - 1) /= names(i))) cycle
      call rule_fault(error, group, i, 'name', "the name '"//trim(names(i))// &
        & "' is used by another &"//group, 'names must differ', source)
      return
    end do
  end subroutine check_unique

  !> Keys `<key>_x`.. of directions that the dimension does not have must not be given.
  subroutine check_components(value, dimension, key, group, number, error, source)
    real(wp), intent(in) :: value(3)  !! of <key>_x, <key>_y and <key>_z, `unset` where not given
    integer, intent(in) :: dimension                   !! of the scene
    character(*), intent(in) :: key                    !! name of the three keys, without _x
    character(*), intent(in) :: group                  !! name of the group, without `&`
    integer, intent(in) :: number                      !! which group of this name, from 1
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    character(*), parameter :: directions = 'xyz'
    integer :: i

    do i = dimension + 1, 3
      if (.not. is_set(value(i))) cycle
      call rule_fault(error, group, number, key//'_'//directions(i:i), "'"//key//'_'// &
        & directions(i:i)//"' in a scene of dimension "//to_text(dimension), &
        & 'there is no direction '//directions(i:i), source)
      return
    end do
  end subroutine check_components

  !> A position or direction: all components of the dimension given, none other but zeros. Else, and
  !> if the key is not given at all, an error is set.
  subroutine check_vector(value, dimension, key, group, number, error, source)
    real(wp), intent(in) :: value(3)                   !! the vector, `unset` where not given
    integer, intent(in) :: dimension                   !! of the scene
    character(*), intent(in) :: key                    !! name of the key
    character(*), intent(in) :: group                  !! name of the group, without `&`
    integer, intent(in) :: number                      !! which group of this name, from 1
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    integer :: i

    if (.not. any(is_set(value))) then
      call rule_fault(error, group, number, key, 'group &'//group//" lacks the key '"//key//"'", &
        & 'expected '//counted(dimension), source)
    else if (.not. all(is_set(value(:dimension)))) then
      call rule_fault(error, group, number, key, "'"//key//"' has too few values", &
        & 'expected '//counted(dimension)//' in a scene of dimension '//to_text(dimension), source)
    else
      do i = dimension + 1, 3
        if (.not. is_set(value(i)) .or. abs(value(i)) <= 0.0_wp) cycle
        call rule_fault(error, group, number, key, "'"//key//"' has too many values", &
          & 'expected '//counted(dimension)//' in a scene of dimension '//to_text(dimension), &
          & source)
        return
      end do
    end if
  end subroutine check_vector

  !> Where both corners bound a direction, the lower one must be below the upper.
  subroutine check_finite_box(lower, upper, group, number, error, source)
    real(wp), intent(in) :: lower(:), upper(:)  !! (up to 3) corners, `unset` where unbounded [m]
    character(*), intent(in) :: group                  !! name of the group, without `&`
    integer, intent(in) :: number                      !! which group of this name, from 1
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    character(*), parameter :: directions = 'xyz'
    integer :: i

    do i = 1, size(lower)
      if (.not. is_set(lower(i)) .or. .not. is_set(upper(i)) .or. lower(i) < upper(i)) cycle
      call rule_fault(error, group, number, 'upper', "'upper' is not above 'lower' along "// &
        & directions(i:i), 'lower: '//to_text(lower(i))//', upper: '//to_text(upper(i)), source)
      return
    end do
  end subroutine check_finite_box

  !> `1 value`, `2 values`.
  pure function counted(n) result(text)
    integer, intent(in) :: n
    character(:), allocatable :: text
    text = to_text(n)//' value'
    if (n > 1) text = text//'s'
  end function counted

  !> A file that a group names must be there. An error is set if it is not.
  subroutine check_file(name, scene_file, group, number, error, source, key)
    character(*), intent(in) :: name                     !! of the file, as the scene says it
    character(:), allocatable, intent(in) :: scene_file
      !! path of the scene file, whose folder is looked in first; may be unallocated
    character(*), intent(in) :: group                    !! name of the group that names the file
    integer, intent(in) :: number                        !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source    !! the scanned file, for places
    character(*), intent(in), optional :: key            !! that names it; absent: `file`
    character(:), allocatable :: path, at
    logical :: exists

    at = 'file'
    if (present(key)) at = key
    path = trim(name)
    if (allocated(scene_file)) path = resolve_path(trim(name), scene_file)
    inquire (file=path, exist=exists)
    if (.not. exists) call rule_fault(error, group, number, at, "cannot find the file '"// &
      & trim(name)//"'", "looked for '"//path//"', then for that name in the working directory", &
      & source)
  end subroutine check_file

end module pd_scene_content_rules
