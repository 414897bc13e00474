!> In which keys two resolved scenes differ.
module pd_scene_content_compare
  use pd_base_text, only: newline, to_text
  implicit none (type, external)
  private
  public :: difference_type, scene_differences

  !> A key that differs.
  type :: difference_type
    character(:), allocatable :: group   !! its name
    character(:), allocatable :: key     !! '' if the whole group is there in one scene only
    character(:), allocatable :: text    !! `&time steps: 100 -> 200`
  end type difference_type

  !> One key of a text: its group with its number, its name and its value.
  type :: entry_type
    character(:), allocatable :: group
    integer :: number = 0
    character(:), allocatable :: key     !! '' for the group itself
    character(:), allocatable :: value
  end type entry_type

contains

  !> The differences between two texts as `pd_scene_content_write` makes them, in the order of the
  !> first, followed by keys of the second only.
  function scene_differences(before, now) result(differences)
    character(*), intent(in) :: before  !! text of the first scene
    character(*), intent(in) :: now     !! text of the second scene
    type(difference_type), allocatable :: differences(:)
    type(entry_type), allocatable :: old(:), new(:)
    integer :: i, j

    old = entries_of(before)
    new = entries_of(now)
    allocate (differences(0))
    do i = 1, size(old)
      j = place_of(old(i), new)
      if (j == 0) then
        call note(old(i), old(i)%value, 'none')
      else if (new(j)%value /= old(i)%value .or. len(new(j)%value) /= len(old(i)%value)) then
        call note(old(i), old(i)%value, new(j)%value)
      end if
    end do
    do j = 1, size(new)
      if (place_of(new(j), old) == 0) call note(new(j), 'none', new(j)%value)
    end do

  contains

    subroutine note(entry, from, to)
      type(entry_type), intent(in) :: entry
      character(*), intent(in) :: from, to
      type(difference_type) :: difference
      integer :: last

      difference%group = entry%group
      difference%key = entry%key
      difference%text = '&'//entry%group
      if (entry%number > 1) difference%text = difference%text//' number '//to_text(entry%number)
      if (entry%key == '') then
        difference%text = difference%text//': '//trim(merge('new ', 'gone', from == 'none'))
      else
        ! the keys of a group that is there in one scene only say nothing more
        last = size(differences)
        if (last > 0) then
          if (differences(last)%key == '' .and. &
            & index(differences(last)%text, difference%text//':') == 1) return
        end if
        difference%text = difference%text//' '//entry%key//': '//from//' -> '//to
      end if
      differences = [differences, difference]
    end subroutine note
  end function scene_differences

  !> Index of a key in another scene; 0 if it is missing.
  pure integer function place_of(entry, entries) result(place)
    type(entry_type), intent(in) :: entry
    type(entry_type), intent(in) :: entries(:)

    do place = 1, size(entries)
      if (entries(place)%number == entry%number .and. entries(place)%group == entry%group .and. &
        & entries(place)%key == entry%key) return
    end do
    place = 0
  end function place_of

  !> The groups of a text and their keys.
  pure function entries_of(text) result(entries)
    character(*), intent(in) :: text
    type(entry_type), allocatable :: entries(:)
    type(entry_type) :: entry
    integer :: at, end, equals, i

    allocate (entries(0))
    at = 1
    do while (at <= len(text))
      end = index(text(at:)//newline, newline) + at - 2
      if (text(at:at) == '&') then
        entry%group = text(at + 1:end)
        entry%number = 1
        do i = 1, size(entries)
          if (entries(i)%group == entry%group .and. entries(i)%key == '') &
            & entry%number = entry%number + 1
        end do
        entry%key = ''
        entry%value = ''
        entries = [entries, entry]
      else if (text(at:at) == ' ') then
        equals = index(text(at:end), '=')
        if (equals > 0) then
          entry%key = trim(adjustl(text(at:at + equals - 2)))
          entry%value = trim(adjustl(text(at + equals:end)))
          entries = [entries, entry]
        end if
      end if
      at = end + 2
    end do
  end function entries_of

end module pd_scene_content_compare
