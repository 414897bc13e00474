!> A scene from a file or a text: scan, read every group, check the whole.
module pd_scene_content_read
  use pd_base_error, only: error_type, internal_fault
  use pd_base_text, only: join, nearest_name
  use pd_scene_content_check, only: check_scene
  use pd_scene_format_file, only: read_text_file
  use pd_scene_content_groups, only: group_names, group_repeatable, visit_scene_header, &
    & visit_body, visit_remove, visit_region, visit_material, visit_horizon, visit_crack, &
    & visit_no_fail, visit_initial, visit_boundary, visit_load, visit_time, visit_relaxation, &
    & visit_output, visit_probe, visit_study
  use pd_scene_format_keys, only: keys_type
  use pd_scene_format_source, only: source_type, scan_source, source_fault
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: read_scene, read_scene_text, read_scene_source

contains

  !> Read the scene file at `path`. On an error `scene` is not fit for use.
  subroutine read_scene(path, scene, error)
    character(*), intent(in) :: path
    type(scene_type), intent(out) :: scene
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: text

    call read_text_file(path, text, error)
    if (allocated(error)) return
    call read_scene_text(text, path, scene, error)
  end subroutine read_scene

  !> Read a scene from its text; `name` stands for the file in messages and for relative paths.
  subroutine read_scene_text(text, name, scene, error)
    character(*), intent(in) :: text
    character(*), intent(in) :: name
    type(scene_type), intent(out) :: scene
    type(error_type), allocatable, intent(out) :: error
    type(source_type) :: source

    call scan_source(text, name, source, error)
    if (allocated(error)) return
    call read_scene_source(source, scene, error)
    scene%text = text
  end subroutine read_scene_text

  !> Read a scene from a scanned file; its text is left empty.
  subroutine read_scene_source(source, scene, error)
    type(source_type), intent(in), target :: source
    type(scene_type), intent(out) :: scene
    type(error_type), allocatable, intent(out) :: error
    integer :: s

    call check_groups(source, error)
    if (allocated(error)) return
    scene%file = source%file
    scene%text = ''
    allocate (scene%bodies(number_of('body', source%section_count)))
    allocate (scene%removed(number_of('remove', source%section_count)))
    allocate (scene%regions(number_of('region', source%section_count)))
    allocate (scene%materials(number_of('material', source%section_count)))
    allocate (scene%cracks(number_of('crack', source%section_count)))
    allocate (scene%no_fail(number_of('no_fail', source%section_count)))
    allocate (scene%initial(number_of('initial', source%section_count)))
    allocate (scene%boundaries(number_of('boundary', source%section_count)))
    allocate (scene%loads(number_of('load', source%section_count)))
    allocate (scene%probes(number_of('probe', source%section_count)))
    allocate (scene%studies(number_of('study', source%section_count)))
    do s = 1, source%section_count
      call read_group(source, s, number_of(source%sections(s)%name, s), scene, error)
      if (allocated(error)) return
    end do
    call check_scene(scene, error, source)

  contains

    !> How many of the first `last` groups have this name.
    integer function number_of(group, last)
      character(*), intent(in) :: group
      integer, intent(in) :: last
      integer :: i

      number_of = 0
      do i = 1, last
        if (source%sections(i)%name == group) number_of = number_of + 1
      end do
    end function number_of

  end subroutine read_scene_source

  !> Every group is a known one, and only repeatable ones are repeated.
  subroutine check_groups(source, error)
    type(source_type), intent(in) :: source
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: nearest, note
    integer :: s, earlier

    if (source%section_count == 0) then
      call source_fault(source, 0, 0, 0, 'the file has no groups', &
        & 'groups are written &name ... /; known: '//join(group_names, ', '), error)
      return
    end if
    do s = 1, source%section_count
      associate (section => source%sections(s))
        if (all(group_names /= section%name)) then
          nearest = nearest_name(section%name, group_names)
          note = 'known: '//join(group_names, ', ')
          if (len(nearest) > 0) note = "did you mean '&"//nearest//"'?  "//note
          call source_fault(source, section%line, section%column, section%width, &
            & 'unknown group &'//section%name, note, error)
          return
        end if
        if (group_repeatable(section%name)) cycle
        do earlier = 1, s - 1
          if (source%sections(earlier)%name /= section%name) cycle
          call source_fault(source, section%line, section%column, section%width, &
            & 'group &'//section%name//' is given twice', 'it may stand only once', error)
          return
        end do
      end associate
    end do
  end subroutine check_groups

  !> Group number `section` of the file into place `number` of its kind.
  subroutine read_group(source, section, number, scene, error)
    type(source_type), intent(in), target :: source
    integer, intent(in) :: section
    integer, intent(in) :: number
    type(scene_type), intent(inout) :: scene
    type(error_type), allocatable, intent(out) :: error
    type(keys_type) :: keys

    call keys%start_reading(source, section)
    select case (source%sections(section)%name)
    case ('scene')
      call visit_scene_header(keys, scene%header)
    case ('body')
      call visit_body(keys, scene%bodies(number))
    case ('remove')
      call visit_remove(keys, scene%removed(number))
    case ('region')
      call visit_region(keys, scene%regions(number))
    case ('material')
      call visit_material(keys, scene%materials(number))
    case ('horizon')
      call visit_horizon(keys, scene%horizon)
    case ('crack')
      call visit_crack(keys, scene%cracks(number))
    case ('no_fail')
      call visit_no_fail(keys, scene%no_fail(number))
    case ('initial')
      call visit_initial(keys, scene%initial(number))
    case ('boundary')
      call visit_boundary(keys, scene%boundaries(number))
    case ('load')
      call visit_load(keys, scene%loads(number))
    case ('time')
      call visit_time(keys, scene%time)
    case ('relaxation')
      call visit_relaxation(keys, scene%relaxation)
    case ('output')
      call visit_output(keys, scene%output)
    case ('probe')
      call visit_probe(keys, scene%probes(number))
    case ('study')
      call visit_study(keys, scene%studies(number))
    case default
      call internal_fault('read_group does not know the group '//source%sections(section)%name)
    end select
    call keys%finish_reading(error)
  end subroutine read_group

end module pd_scene_content_read
