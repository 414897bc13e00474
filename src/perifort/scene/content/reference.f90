!> The input reference, printed from the declarations: Markdown that reads well in a terminal.
module pd_scene_content_reference
  use pd_base_error, only: error_type, fail, status_usage
  use pd_base_text, only: join, lower_case, nearest_name
  use pd_scene_content_groups, only: list_groups
  use pd_scene_content_types, only: group_table
  use pd_scene_format_keys, only: keys_type, key_info
  implicit none (type, external)
  private
  public :: write_reference

  integer, parameter :: columns = 5
  character(7), parameter :: titles(columns) = [character(7) :: 'key', 'type', 'unit', 'default', &
    & 'meaning']

contains

  !> Write the reference of one group, or of all with a heading if `group` is ''. The group may be
  !> given with or without `&`. An error if there is no such group.
  subroutine write_reference(unit, group, error, fields, table)
    integer, intent(in) :: unit                       !! open for formatted writing
    character(*), intent(in) :: group                 !! its name in any case, or ''
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in), optional :: fields(:)   !! names of the fields of the output
    type(group_table), intent(in), optional :: table  !! of the groups; without, the program's own
    type(group_table) :: known
    type(keys_type) :: keys
    character(:), allocatable :: name, nearest, note
    integer :: g

    if (present(table)) then
      known = table
    else
      call list_groups(known)
    end if
    if (present(fields)) call keys%describe_fields(fields)
    name = lower_case(trim(adjustl(group)))
    if (index(name, '&') == 1) name = name(2:)
    if (len(name) == 0) then
      call write_heading(unit)
      do g = 1, known%count
        write (unit, '(a)') ''
        call write_group(unit, known, g, keys)
      end do
    else if (known%place_of(name) > 0) then
      call write_group(unit, known, known%place_of(name), keys)
    else
      nearest = nearest_name(name, known%names())
      note = ''
      if (len(nearest) > 0) note = " did you mean '"//nearest//"'? "
      call fail(error, "no group is named '"//name//"';"//note//' known: '// &
        & join(known%names(), ', '), status_usage)
    end if
  end subroutine write_reference

  !> What holds for all groups.
  subroutine write_heading(unit)
    integer, intent(in) :: unit

    write (unit, '(a)') '# Input reference', '', &
      & 'A scene is a text file of namelist groups, `&name key = value ... /`. Names of groups', &
      & 'and keys may be written in any case; a `!` starts a comment; texts are in quotes;', &
      & 'several values are separated by commas or blanks, `3*0.0` repeats a value. Values are', &
      & 'in SI units. `key(2) = ...` sets one element. Vectors have as many components as the', &
      & 'scene has dimensions. A 3 x 3 matrix without subscripts is read column by column:', &
      & '(1,1), (2,1), (3,1), (1,2), ...', '', &
      & 'Files named in a scene are looked for in the folder of the scene file, then in the', &
      & 'working directory.'
  end subroutine write_heading

  !> One group: purpose and a table of its keys.
  subroutine write_group(unit, table, place, keys)
    integer, intent(in) :: unit
    type(group_table), intent(in) :: table
    integer, intent(in) :: place            !! of the group in the table
    type(keys_type), intent(inout) :: keys  !! gets the group's; knows the fields of the output
    integer :: widths(columns), c, k

    call table%describe(trim(table%entries(place)%name), keys)
    write (unit, '(a)') '## &'//trim(table%entries(place)%name), '', table%entries(place)%purpose
    if (table%entries(place)%repeatable) then
      write (unit, '(a)') 'May be given several times.'
    else
      write (unit, '(a)') 'Given at most once.'
    end if
    write (unit, '(a)') ''
    do c = 1, columns
      widths(c) = len_trim(titles(c))
      do k = 1, keys%count
        widths(c) = max(widths(c), len(cell(keys%known(k), c)))
      end do
    end do
    widths(columns) = len_trim(titles(columns))
    write (unit, '(a)') '| '//padded(titles(1), 1)//padded(titles(2), 2)//padded(titles(3), 3)// &
      & padded(titles(4), 4)//padded(titles(5), 5)
    write (unit, '(6a)') ('|'//repeat('-', widths(c) + 2), c=1, columns), '|'
    do k = 1, keys%count
      write (unit, '(a)') '| '//padded(cell(keys%known(k), 1), 1)// &
        & padded(cell(keys%known(k), 2), 2)//padded(cell(keys%known(k), 3), 3)// &
        & padded(cell(keys%known(k), 4), 4)//cell(keys%known(k), 5)//' |'
    end do

  contains

    !> A cell's text filled to its column's width, with the bar behind it.
    function padded(text, column) result(filled)
      character(*), intent(in) :: text
      integer, intent(in) :: column
      character(:), allocatable :: filled

      filled = trim(text)//repeat(' ', max(0, widths(column) - len_trim(text)))//' |'
      if (column < columns) filled = filled//' '
    end function padded

  end subroutine write_group

  !> What stands in a column for a key.
  function cell(key, column) result(text)
    type(key_info), intent(in) :: key
    integer, intent(in) :: column
    character(:), allocatable :: text

    select case (column)
    case (1)
      text = '`'//key%name//'`'
    case (2)
      text = key%kind
    case (3)
      text = key%unit
    case (4)
      text = key%default
    case default
      text = key%meaning
      if (len(key%allowed) > 0) text = text//'; '//key%allowed
    end select
  end function cell

end module pd_scene_content_reference
