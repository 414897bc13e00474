!> A scene from a file or a text: scan, read every group, check the whole.
module pd_scene_content_read
  use pd_base_error, only: error_type
  use pd_base_text, only: join, nearest_name
  use pd_law_laws, only: law_table_type
  use pd_scene_content_change, only: apply_changes
  use pd_scene_content_check, only: check_scene
  use pd_scene_format_file, only: line_type, read_text_file
  use pd_scene_content_groups, only: list_groups
  use pd_scene_format_keys, only: keys_type
  use pd_scene_format_source, only: source_type, scan_source, source_fault
  use pd_scene_content_types, only: group_table, name_length, scene_type
  implicit none (type, external)
  private
  public :: read_scene, read_scene_text, read_scene_source

contains

  !> Read the scene file at `path`. On an error `scene` is not fit for use. An error is set if the
  !> file cannot be read, or if the scene or a change breaks a rule.
  subroutine read_scene(path, scene, error, changes, table, laws)
    character(*), intent(in) :: path  !! of the file; paths in it are relative to its folder
    type(scene_type), intent(out) :: scene               !! checked and complete, with its text
    type(error_type), allocatable, intent(out) :: error
    type(line_type), intent(in), optional :: changes(:)  !! `group%key=value`: see `--set`
    type(group_table), intent(in), optional :: table     !! of the groups that it may have
    type(law_table_type), intent(in), optional :: laws   !! bond laws that it may name
    character(:), allocatable :: text

    call read_text_file(path, text, error)
    if (allocated(error)) return
    if (present(changes)) then
      call read_scene_text(text, path, scene, error, changes, table, laws)
    else
      call read_scene_text(text, path, scene, error, table=table, laws=laws)
    end if
  end subroutine read_scene

  !> Read a scene from its text; `name` stands for the file in messages and for relative paths. An
  !> error is set if the scene or a change breaks a rule.
  subroutine read_scene_text(text, name, scene, error, changes, table, laws)
    character(*), intent(in) :: text                     !! of a scene file
    character(*), intent(in) :: name                     !! path of the file; there need be none
    type(scene_type), intent(out) :: scene               !! checked and complete, with its text
    type(error_type), allocatable, intent(out) :: error
    type(line_type), intent(in), optional :: changes(:)  !! `group%key=value`: see `--set`
    type(group_table), intent(in), optional :: table     !! of the groups that it may have
    type(law_table_type), intent(in), optional :: laws   !! bond laws that it may name
    type(source_type) :: source

    call scan_source(text, name, source, error)
    if (allocated(error)) return
    if (present(changes)) call apply_changes(source, changes, error, table)
    if (allocated(error)) return
    call read_scene_source(source, scene, error, table, laws)
    scene%text = text
    if (present(changes)) scene%changes = changes
  end subroutine read_scene_text

  !> Read a scene from a scanned file; its text is left empty. An error is set if the scene breaks a
  !> rule.
  subroutine read_scene_source(source, scene, error, table, laws)
    type(source_type), intent(in), target :: source      !! scanned, with all changes in it
    type(scene_type), intent(out) :: scene               !! checked and complete, without its text
    type(error_type), allocatable, intent(out) :: error
    type(group_table), intent(in), optional :: table     !! of the groups that it may have
    type(law_table_type), intent(in), optional :: laws   !! bond laws that it may name
    type(group_table) :: known
    type(keys_type) :: keys
    integer :: g, s

    if (present(table)) then
      known = table
      scene%table = table
    else
      call list_groups(known)
    end if
    if (present(laws)) scene%laws = laws
    call check_groups(source, known, error)
    if (allocated(error)) return
    scene%file = source%file
    scene%text = ''
    do g = 1, known%count
      call known%make_room(scene, g, number_of(trim(known%entries(g)%name), source%section_count))
    end do
    do s = 1, source%section_count
      call keys%start_reading(source, s)
      call known%visit(scene, known%place_of(source%sections(s)%name), &
        & number_of(source%sections(s)%name, s), keys)
      call keys%finish_reading(error)
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
  subroutine check_groups(source, table, error)
    type(source_type), intent(in) :: source
    type(group_table), intent(in) :: table
    type(error_type), allocatable, intent(out) :: error
    character(name_length), allocatable :: known(:)
    character(:), allocatable :: nearest, note
    integer :: s, earlier

    known = table%names()
    if (source%section_count == 0) then
      call source_fault(source, 0, 0, 0, 'the file has no groups', &
        & 'groups are written &name ... /; known: '//join(known, ', '), error)
      return
    end if
    do s = 1, source%section_count
      associate (section => source%sections(s))
        if (table%place_of(section%name) == 0) then
          nearest = nearest_name(section%name, known)
          note = 'known: '//join(known, ', ')
          if (len(nearest) > 0) note = "did you mean '&"//nearest//"'?  "//note
          call source_fault(source, section%line, section%column, section%width, &
            & 'unknown group &'//section%name, note, error)
          return
        end if
        if (table%entries(table%place_of(section%name))%repeatable) cycle
        do earlier = 1, s - 1
          if (source%sections(earlier)%name /= section%name) cycle
          call source_fault(source, section%line, section%column, section%width, &
            & 'group &'//section%name//' is given twice', 'it may be given only once', error)
          return
        end do
      end associate
    end do
  end subroutine check_groups

end module pd_scene_content_read
