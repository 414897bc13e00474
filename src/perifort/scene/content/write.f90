!> A scene as namelist text: every group it has, every key with the value computed with.
!>
!> The text reads back to the same scene, bit for bit.
module pd_scene_content_write
  use pd_base_text, only: newline
  use pd_scene_content_groups, only: table_of
  use pd_scene_format_keys, only: keys_type, key_info, mode_write
  use pd_scene_content_types, only: group_table, scene_type
  implicit none (type, external)
  private
  public :: scene_text, commented_text

  integer, parameter :: comment_column = 44  !! where comments of a template begin

contains

  !> The resolved scene as text; keys without a value are left out. Lists that are not allocated
  !> count as empty.
  function scene_text(scene) result(text)
    type(scene_type), intent(in) :: scene  !! lists that are not allocated count as empty
    character(:), allocatable :: text
    type(keys_type) :: keys
    text = all_groups(scene, commented=.false., keys=keys)
  end function scene_text

  !> The same with comments: meaning, unit and choice of every key; keys at their defaults stand
  !> behind a `!`.
  function commented_text(scene, fields) result(text)
    type(scene_type), intent(in) :: scene
      !! the template; lists that are not allocated count as empty
    character(*), intent(in), optional :: fields(:)  !! names of the fields of the output
    character(:), allocatable :: text
    type(keys_type) :: keys

    if (present(fields)) call keys%describe_fields(fields)
    text = all_groups(scene, commented=.true., keys=keys)
  end function commented_text

  !> Every group in the order of the reference.
  function all_groups(scene, commented, keys) result(text)
    type(scene_type), intent(in) :: scene
    logical, intent(in) :: commented
    type(keys_type), intent(inout) :: keys  !! knows the fields of the output
    character(:), allocatable :: text
    type(scene_type) :: copy
    type(group_table) :: table
    integer :: g, i

    ! The visitor may change what it visits, so it gets a copy.
    copy = scene
    call table_of(scene, table)
    text = ''
    do g = 1, table%count
      do i = 1, table%number_in(copy, g)
        call keys%start(mode_write)
        call table%visit(copy, g, i, keys)
        if (commented .and. table%entries(g)%name == 'relaxation' .and. &
          & copy%time%method /= 'relaxation') cycle
        call put_group(text, keys, table, g, commented, first=i == 1)
      end do
    end do
  end function all_groups

  !> Append one group.
  subroutine put_group(text, keys, table, place, commented, first)
    character(:), allocatable, intent(inout) :: text
    type(keys_type), intent(in) :: keys
    type(group_table), intent(in) :: table
    integer, intent(in) :: place             !! of the group in the table
    logical, intent(in) :: commented
    logical, intent(in) :: first
    type(keys_type) :: defaults
    integer :: k

    if (commented .and. len(text) > 0) text = text//newline
    if (commented .and. first) text = text//'! '//table%entries(place)%purpose//newline
    text = text//'&'//trim(table%entries(place)%name)//newline
    call table%describe(trim(table%entries(place)%name), defaults)
    do k = 1, keys%count
      associate (key => keys%known(k))
        if (commented) then
          text = text//commented_line(key, defaults%known(k))//newline
        else if (len(key%value) > 0) then
          text = text//assignment(key%name, key%value)//newline
        end if
      end associate
    end do
    text = text//'/'//newline
  end subroutine put_group

  !> `  name = value`; a value that starts with a subscript carries its own `=`.
  pure function assignment(name, value) result(line)
    character(*), intent(in) :: name, value
    character(:), allocatable :: line

    line = '  '//name//' = '//value
    if (value(1:1) == '(') line = '  '//name//value
  end function assignment

  !> A key of a template: as an assignment if it differs from its default, else commented out.
  function commented_line(key, default) result(line)
    type(key_info), intent(in) :: key, default
    character(:), allocatable :: line
    logical :: named  ! the default is a value that is filled in later, not a description

    named = len(default%value) == 0 .and. index(default%default, "'") == 1
    if (len(key%value) > 0 .and. key%value /= default%value) then
      line = assignment(key%name, key%value)
    else if (len(default%value) > 0) then
      line = '  ! '//key%name//' = '//default%value
    else if (named) then
      line = '  ! '//key%name//' = '//default%default
    else
      line = '  ! '//key%name//' = ...'
    end if
    line = line//repeat(' ', max(1, comment_column - len(line)))//'! '//key%meaning
    if (len(key%unit) > 0 .and. key%unit /= '-') line = line//' ['//key%unit//']'
    if (len(key%allowed) > 0) line = line//'; '//key%allowed
    if (len(key%value) == 0 .and. default%default /= 'none' .and. .not. named) &
      & line = line//'; default: '//default%default
  end function commented_line

end module pd_scene_content_write
