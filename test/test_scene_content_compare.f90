!> The keys in which two scenes differ.
module test_scene_content_compare
  use pd_base_text, only: newline
  use pd_scene_content_compare, only: difference_type, scene_differences
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_content_compare

  character(*), parameter :: scene = '&body'//newline//"  name = 'a'"//newline//'/'//newline// &
    & '&body'//newline//"  name = 'b'"//newline//'  points = 3, 4'//newline//'/'//newline// &
    & '&time'//newline//'  steps = 10'//newline//'/'//newline

contains

  subroutine collect_scene_content_compare(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('equal scenes', test_equal), &
      & new_unittest('values, keys and groups', test_differences)]
  end subroutine collect_scene_content_compare

  subroutine test_equal(error)
    type(error_type), allocatable, intent(out) :: error
    call check(error, size(scene_differences(scene, scene)), 0)
  end subroutine test_equal

  !> A value of the second group of a name, a key that goes, one that comes, a group that comes.
  subroutine test_differences(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: other = '&body'//newline//"  name = 'a'"//newline//'/'//newline// &
      & '&body'//newline//"  name = 'b '"//newline//'  points = 3, 5'//newline//'/'//newline// &
      & '&time'//newline//'  duration = 1.0'//newline//'/'//newline// &
      & '&probe'//newline//"  name = 'p'"//newline//'/'//newline
    character(40), parameter :: expected(5) = [character(40) :: &
      & "&body number 2 name: 'b' -> 'b '", '&body number 2 points: 3, 4 -> 3, 5', &
      & '&time steps: 10 -> none', '&time duration: none -> 1.0', '&probe: new']
    type(difference_type), allocatable :: differences(:)
    integer :: i

    differences = scene_differences(scene, other)
    call check(error, size(differences), size(expected), 'number of differences')
    do i = 1, size(expected)
      if (allocated(error)) return
      call check(error, differences(i)%text, trim(expected(i)))
    end do
    if (.not. allocated(error)) call check(error, differences(2)%group//differences(2)%key, &
      & 'bodypoints')
  end subroutine test_differences

end module test_scene_content_compare
