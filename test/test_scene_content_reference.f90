!> The reference: complete, and true to the defaults.
module test_scene_content_reference
  use pd_base_error, only: scene_error => error_type, status_usage
  use pd_scene_format_file, only: read_text_file
  use pd_output_fields_table, only: all_fields, field_table_type
  use pd_scene_content_groups, only: list_groups
  use pd_scene_content_types, only: group_table
  use pd_scene_format_keys, only: keys_type
  use pd_scene_content_reference, only: write_reference
  use test_scene_expect, only: expect_parts
  use testdrive, only: check, error_type, new_unittest, skip_test, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_content_reference

contains

  subroutine collect_scene_content_reference(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('every group and key is there', test_complete), &
      & new_unittest('one group', test_group), &
      & new_unittest('a group that does not exist', test_unknown), &
      & new_unittest('every key has a meaning', test_meaning), &
      & new_unittest('the page in doc is up to date', test_page)]
  end subroutine collect_scene_content_reference

  !> What `write_reference` writes.
  subroutine reference_of(group, text, found)
    character(*), intent(in) :: group
    character(:), allocatable, intent(out) :: text
    type(scene_error), allocatable, intent(out) :: found
    integer :: unit, status
    character(1000) :: row
    type(field_table_type) :: table

    open (newunit=unit, status='scratch', action='readwrite')
    table = all_fields()
    call write_reference(unit, group, found, table%names())
    rewind (unit)
    text = ''
    do
      read (unit, '(a)', iostat=status) row
      if (status /= 0) exit
      text = text//trim(row)//new_line('a')
    end do
    close (unit)
  end subroutine reference_of

  subroutine test_complete(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_error), allocatable :: found
    type(group_table) :: table
    type(keys_type) :: keys
    character(:), allocatable :: text
    integer :: g, k

    call reference_of('', text, found)
    call check(error,.not. allocated(found))
    if (allocated(error)) return
    call list_groups(table)
    do g = 1, table%count
      call check(error, index(text, '## &'//trim(table%entries(g)%name)) > 0, &
        & trim(table%entries(g)%name))
      if (allocated(error)) return
      call table%describe(trim(table%entries(g)%name), keys)
      call check(error, keys%count > 0, trim(table%entries(g)%name))
      if (allocated(error)) return
      do k = 1, keys%count
        call check(error, index(text, '| `'//keys%known(k)%name//'`') > 0, keys%known(k)%name)
        if (allocated(error)) return
      end do
    end do
  end subroutine test_complete

  subroutine test_group(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_error), allocatable :: found
    character(:), allocatable :: text

    call reference_of('&Horizon', text, found)
    call check(error,.not. allocated(found))
    if (allocated(error)) return
    call check(error, index(text, '## &horizon') == 1 .and. index(text, '&body') == 0, text)
    if (allocated(error)) return
    call check(error, index(text, '| real    | -    | 3.015         | horizon over') > 0, text)
    if (allocated(error)) return
    call check(error, index(text, "'linear', 'linear_extended', 'exact', 'none' |") > 0, text)
  end subroutine test_group

  subroutine test_unknown(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_error), allocatable :: found
    character(:), allocatable :: text

    call reference_of('materiel', text, found)
    call expect_parts(error, found, "no group is named 'materiel'|did you mean 'material'?|probe")
    if (allocated(error)) return
    call check(error, found%status, status_usage)
  end subroutine test_unknown

  subroutine test_meaning(error)
    type(error_type), allocatable, intent(out) :: error
    type(group_table) :: table
    type(keys_type) :: keys
    integer :: g, k

    call list_groups(table)
    do g = 1, table%count
      call check(error, len(table%entries(g)%purpose) > 20, &
        & trim(table%entries(g)%name))
      if (allocated(error)) return
      call table%describe(trim(table%entries(g)%name), keys)
      do k = 1, keys%count
        call check(error, len(keys%known(k)%meaning) > 5 .and. len(keys%known(k)%default) > 0, &
          & keys%known(k)%name)
        if (allocated(error)) return
      end do
    end do
  end subroutine test_meaning

  !> Tests run in the project's folder, so the page is at hand.
  subroutine test_page(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_error), allocatable :: found
    character(:), allocatable :: text, page

    call read_text_file('doc/input-reference.md', page, found)
    if (allocated(found)) then
      call skip_test(error, 'not run in the project''s folder')
      return
    end if
    call reference_of('', text, found)
    call check(error, page == text, 'doc/input-reference.md differs from what the program '// &
      & 'prints; write it anew with: ./pf reference > doc/input-reference.md')
  end subroutine test_page

end module test_scene_content_reference
