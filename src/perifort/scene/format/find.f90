!> Where a group or a key stands in a scanned file.
module pd_scene_format_find
  use pd_scene_format_source, only: source_type
  implicit none (type, external)
  private
  public :: find_entry, find_section, given

contains

  !> Whether the file gives this key; false for a scene built in memory.
  pure logical function given(group, number, key, source)
    character(*), intent(in) :: group  !! name of the group, without `&`
    integer, intent(in) :: number      !! which group of this name, from 1
    character(*), intent(in) :: key    !! name of the key
    type(source_type), intent(in), optional :: source
      !! the scanned file; absent if the scene was built in memory
    integer :: section

    given = .false.
    if (.not. present(source)) return
    section = find_section(source, group, number)
    if (section > 0) given = find_entry(source, section, key) > 0
  end function given

  !> The place of the `number`-th group of a name, 0 if there is none.
  pure integer function find_section(source, group, number) result(section)
    type(source_type), intent(in) :: source  !! the scanned file
    character(*), intent(in) :: group        !! name of the group, without `&`
    integer, intent(in) :: number            !! which group of this name, from 1
    integer :: i, found

    section = 0
    found = 0
    do i = 1, source%section_count
      if (source%sections(i)%name /= group) cycle
      found = found + 1
      if (found == number) section = i
    end do
  end function find_section

  !> The place of a key in a group, 0 if it is not given. Of a key that is given element by element
  !> it is the first entry.
  pure integer function find_entry(source, section, key) result(entry)
    type(source_type), intent(in) :: source  !! the scanned file
    integer, intent(in) :: section           !! place of the group
    character(*), intent(in) :: key          !! name of the key
    integer :: i

    entry = 0
    do i = source%sections(section)%last, source%sections(section)%first, -1
      if (source%entries(i)%key == key) entry = i
    end do
  end function find_entry

end module pd_scene_format_find
