!> Shared by the suites of scenes: messages must hold what they promise.
module test_scene_expect
  use pd_base_error, only: scene_error => error_type
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: scene_type
  use pd_scene_format_file, only: line_type
  use testdrive, only: error_type, test_failed
  implicit none (type, external)
  private
  public :: expect_parts, expect_fault, expect_scene, good_head, line, changes_of

  character(*), parameter :: line = new_line('a')
  !> Three lines that make a valid scene together with a `&time` group.
  character(*), parameter :: good_head = '&scene dimension = 2 /'//line// &
    & '&material youngs_modulus = 1e9 density = 1e3 poissons_ratio = 0.3 /'//line// &
    & "&body name = 'plate' lower = 0, 0 upper = 1, 0.5 points = 100, 50 /"//line

contains

  !> Every part, up to the next `|`, must be in the message of `found`.
  subroutine expect_parts(error, found, parts)
    type(error_type), allocatable, intent(out) :: error
    type(scene_error), allocatable, intent(in) :: found
    character(*), intent(in) :: parts
    integer :: first, last

    if (.not. allocated(found)) then
      call test_failed(error, 'no error, expected: '//parts)
      return
    end if
    first = 1
    do while (first <= len(parts))
      last = index(parts(first:), '|')
      last = merge(len(parts), first + last - 2, last == 0)
      if (index(found%message, parts(first:last)) == 0) then
        call test_failed(error, '"'//parts(first:last)//'" is not in:'//line//found%message)
        return
      end if
      first = last + 2
    end do
  end subroutine expect_parts

  !> Reading this text must fail with these parts in the message.
  subroutine expect_fault(error, text, parts)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text
    character(*), intent(in) :: parts
    type(scene_type) :: scene
    type(scene_error), allocatable :: found

    if (allocated(error)) return
    call read_scene_text(text, 'a/b.nml', scene, found)
    call expect_parts(error, found, parts)
  end subroutine expect_fault

  !> Reading this text must succeed.
  subroutine expect_scene(error, text, scene)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text
    type(scene_type), intent(out) :: scene
    type(scene_error), allocatable :: found

    if (allocated(error)) return
    call read_scene_text(text, 'a/b.nml', scene, found)
    if (allocated(found)) call test_failed(error, found%message)
  end subroutine expect_scene

  !> The changes `group%key=value` that are parted by `|`.
  subroutine changes_of(text, changes)
    character(*), intent(in) :: text
    type(line_type), allocatable, intent(out) :: changes(:)
    integer :: i, first, next

    allocate (changes(1 + count([(text(i:i) == '|', i=1, len(text))])))
    first = 1
    do i = 1, size(changes)
      next = first + index(text(first:)//'|', '|') - 1
      changes(i)%text = text(first:next - 1)
      first = next + 1
    end do
  end subroutine changes_of

end module test_scene_expect
