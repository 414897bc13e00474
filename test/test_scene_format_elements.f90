!> Which word gives which element.
module test_scene_format_elements
  use pd_base_error, only: scene_error => error_type
  use pd_scene_format_elements, only: find_elements, growing
  use pd_scene_format_source, only: scan_source, source_type
  use test_scene_expect, only: expect_parts
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_format_elements

contains

  subroutine collect_scene_format_elements(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a scalar', test_scalar), &
      & new_unittest('a vector keeps gaps', test_vector), &
      & new_unittest('a matrix runs down its columns', test_matrix), &
      & new_unittest('a list grows', test_list), &
      & new_unittest('one element of a matrix', test_element)]
  end subroutine collect_scene_format_elements

  !> Elements of key `a` in the text `&g ... /`.
  subroutine elements(text, extents, slots, found)
    character(*), intent(in) :: text
    integer, intent(in) :: extents(:)
    integer, allocatable, intent(out) :: slots(:)
    type(scene_error), allocatable, intent(out) :: found
    type(source_type) :: source
    logical, allocatable :: used(:)

    call scan_source('&g '//text//' /', 'x', source, found)
    if (allocated(found)) return
    allocate (used(source%entry_count), source=.false.)
    call find_elements(source, 1, 'a', extents, slots, used, found)
  end subroutine elements

  subroutine expect(error, text, extents, expected)
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in) :: text
    integer, intent(in) :: extents(:), expected(:)
    integer, allocatable :: slots(:)
    type(scene_error), allocatable :: found

    call elements(text, extents, slots, found)
    call check(error,.not. allocated(found), 'refused: '//text)
    if (allocated(error)) return
    call check(error, size(slots), size(expected), text)
    if (allocated(error)) return
    call check(error, all(slots == expected), 'wrong elements: '//text)
  end subroutine expect

  subroutine test_scalar(error)
    type(error_type), allocatable, intent(out) :: error
    call expect(error, 'b = 1 a = 5', [integer ::], [2])
    if (allocated(error)) return
    call expect(error, 'b = 1', [integer ::], [integer ::])
  end subroutine test_scalar

  subroutine test_vector(error)
    type(error_type), allocatable, intent(out) :: error
    call expect(error, 'a(3) = 5 a(1) = 7', [3], [2, 0, 1])
    if (allocated(error)) return
    call expect(error, 'a(2:) = 2*5', [3], [0, 1, 1])
    if (allocated(error)) return
    call expect(error, 'a(:2) = 1 2', [3], [1, 2])
  end subroutine test_vector

  subroutine test_matrix(error)
    type(error_type), allocatable, intent(out) :: error
    call expect(error, 'a = 1 2 3 4', [3, 3], [1, 2, 3, 4])
    if (allocated(error)) return
    call expect(error, 'a(2, :) = 1 2 3', [3, 3], [0, 1, 0, 0, 2, 0, 0, 3])
    if (allocated(error)) return
    call expect(error, 'a(2:3, 2:3) = 1 2 3 4', [3, 3], [0, 0, 0, 0, 1, 2, 0, 3, 4])
  end subroutine test_matrix

  subroutine test_list(error)
    type(error_type), allocatable, intent(out) :: error
    integer, allocatable :: slots(:)
    type(scene_error), allocatable :: found

    call expect(error, 'a = 1, 3*2', growing, [1, 2, 2, 2])
    if (allocated(error)) return
    call elements('a = 100000*1', growing, slots, found)
    call check(error, size(slots), 100000)
    if (allocated(error)) return
    call elements('a = 3000000*1', growing, slots, found)
    call expect_parts(error, found, "too many values for 'a'")
  end subroutine test_list

  subroutine test_element(error)
    type(error_type), allocatable, intent(out) :: error
    integer, allocatable :: slots(:)
    type(scene_error), allocatable :: found

    call expect(error, 'a(3, 1) = 1', [3, 3], [0, 0, 1])
    if (allocated(error)) return
    call elements('a(3, 1) = 1 2', [3, 3], slots, found)
    call expect_parts(error, found, "too many values for 'a'|room for 1 value")
    if (allocated(error)) return
    call elements('a(3, 1) = 1 a = 5*2 3', [3, 3], slots, found)
    call expect_parts(error, found, "duplicate key 'a'")
  end subroutine test_element

end module test_scene_format_elements
