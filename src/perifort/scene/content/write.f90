!> A scene as namelist text: every group it has, every key with the value computed with.
!>
!> The text reads back to the same scene, bit for bit.
module pd_scene_content_write
  use pd_base_error, only: internal_fault
  use pd_base_text, only: newline
  use pd_scene_content_groups, only: describe_group, group_purpose, group_names, &
    & visit_scene_header, visit_body, visit_remove, visit_region, visit_material, visit_horizon, &
    & visit_crack, visit_no_fail, visit_initial, visit_boundary, visit_load, visit_time, &
    & visit_relaxation, visit_output, visit_probe, visit_study
  use pd_scene_format_keys, only: keys_type, key_info, mode_write
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: scene_text, commented_text

  integer, parameter :: comment_column = 44  !! where comments of a template begin

contains

  !> The resolved scene as text; keys without a value are left out. Lists that are not allocated
  !> count as empty.
  function scene_text(scene) result(text)
    type(scene_type), intent(in) :: scene
    character(:), allocatable :: text
    text = all_groups(scene, commented=.false.)
  end function scene_text

  !> The same with comments: meaning, unit and choice of every key; keys at their defaults stand
  !> behind a `!`.
  function commented_text(scene, fields) result(text)
    type(scene_type), intent(in) :: scene
    character(*), intent(in), optional :: fields(:)  !! names of the fields of the output
    character(:), allocatable :: text
    text = all_groups(scene, commented=.true., fields=fields)
  end function commented_text

  !> Every group in the order of the reference.
  function all_groups(scene, commented, fields) result(text)
    type(scene_type), intent(in) :: scene
    logical, intent(in) :: commented
    character(*), intent(in), optional :: fields(:)
    character(:), allocatable :: text
    type(scene_type) :: copy
    type(keys_type) :: keys
    integer :: g, i

    ! The visitor may change what it visits, so it gets a copy.
    copy = scene
    text = ''
    call keys%describe_fields(fields)
    do g = 1, size(group_names)
      do i = 1, number_of_groups(copy, trim(group_names(g)))
        call keys%start(mode_write)
        call visit_one(keys, copy, trim(group_names(g)), i)
        if (commented .and. trim(group_names(g)) == 'relaxation' .and. &
          & copy%time%method /= 'relaxation') cycle
        call put_group(text, keys, trim(group_names(g)), commented, first=i == 1)
      end do
    end do
  end function all_groups

  !> How many groups of a name a scene has.
  pure integer function number_of_groups(scene, name) result(number)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: name

    number = 0
    select case (name)
    case ('body')
      if (allocated(scene%bodies)) number = size(scene%bodies)
    case ('remove')
      if (allocated(scene%removed)) number = size(scene%removed)
    case ('region')
      if (allocated(scene%regions)) number = size(scene%regions)
    case ('material')
      if (allocated(scene%materials)) number = size(scene%materials)
    case ('crack')
      if (allocated(scene%cracks)) number = size(scene%cracks)
    case ('no_fail')
      if (allocated(scene%no_fail)) number = size(scene%no_fail)
    case ('initial')
      if (allocated(scene%initial)) number = size(scene%initial)
    case ('boundary')
      if (allocated(scene%boundaries)) number = size(scene%boundaries)
    case ('load')
      if (allocated(scene%loads)) number = size(scene%loads)
    case ('probe')
      if (allocated(scene%probes)) number = size(scene%probes)
    case ('study')
      if (allocated(scene%studies)) number = size(scene%studies)
    case ('scene', 'horizon', 'time', 'relaxation', 'output')
      number = 1
    case default
      call internal_fault('number_of_groups does not know the group '//name)
    end select
  end function number_of_groups

  !> Let `keys` see the `i`-th group of a name.
  subroutine visit_one(keys, scene, name, i)
    type(keys_type), intent(inout) :: keys
    type(scene_type), intent(inout) :: scene
    character(*), intent(in) :: name
    integer, intent(in) :: i

    select case (name)
    case ('scene')
      call visit_scene_header(keys, scene%header)
    case ('body')
      call visit_body(keys, scene%bodies(i))
    case ('remove')
      call visit_remove(keys, scene%removed(i))
    case ('region')
      call visit_region(keys, scene%regions(i))
    case ('material')
      call visit_material(keys, scene%materials(i))
    case ('horizon')
      call visit_horizon(keys, scene%horizon)
    case ('crack')
      call visit_crack(keys, scene%cracks(i))
    case ('no_fail')
      call visit_no_fail(keys, scene%no_fail(i))
    case ('initial')
      call visit_initial(keys, scene%initial(i))
    case ('boundary')
      call visit_boundary(keys, scene%boundaries(i))
    case ('load')
      call visit_load(keys, scene%loads(i))
    case ('time')
      call visit_time(keys, scene%time)
    case ('relaxation')
      call visit_relaxation(keys, scene%relaxation)
    case ('output')
      call visit_output(keys, scene%output)
    case ('probe')
      call visit_probe(keys, scene%probes(i))
    case ('study')
      call visit_study(keys, scene%studies(i))
    case default
      call internal_fault('visit_one does not know the group '//name)
    end select
  end subroutine visit_one

  !> Append one group.
  subroutine put_group(text, keys, name, commented, first)
    character(:), allocatable, intent(inout) :: text
    type(keys_type), intent(in) :: keys
    character(*), intent(in) :: name
    logical, intent(in) :: commented
    logical, intent(in) :: first
    type(keys_type) :: defaults
    integer :: k

    if (commented .and. len(text) > 0) text = text//newline
    if (commented .and. first) text = text//'! '//group_purpose(name)//newline
    text = text//'&'//name//newline
    call describe_group(defaults, name)
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

    if (len(key%value) > 0 .and. key%value /= default%value) then
      line = assignment(key%name, key%value)
    else if (len(default%value) > 0) then
      line = '  ! '//key%name//' = '//default%value
    else
      line = '  ! '//key%name//' = ...'
    end if
    line = line//repeat(' ', max(1, comment_column - len(line)))//'! '//key%meaning
    if (len(key%unit) > 0 .and. key%unit /= '-') line = line//' ['//key%unit//']'
    if (len(key%allowed) > 0) line = line//'; '//key%allowed
    if (len(key%value) == 0 .and. default%default /= 'none') &
      & line = line//'; default: '//default%default
  end function commented_line

end module pd_scene_content_write
