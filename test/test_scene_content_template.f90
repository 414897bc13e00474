!> Templates: each one is a valid scene that says what it is.
module test_scene_content_template
  use pd_base_error, only: scene_error => error_type, status_usage
  use pd_scene_content_groups, only: list_groups
  use pd_scene_content_template, only: template_names, template_text, write_template
  use pd_scene_content_types, only: group_table, scene_type
  use test_scene_expect, only: expect_parts, expect_scene, line
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_content_template

contains

  subroutine collect_scene_content_template(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('every template can be read', test_valid), &
      & new_unittest('every template has comments', test_comments), &
      & new_unittest('without a name there is one too', test_default), &
      & new_unittest('a template that does not exist', test_unknown)]
  end subroutine collect_scene_content_template

  subroutine test_valid(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: found
    character(:), allocatable :: text
    integer :: i, dimensions(3)

    dimensions = 0
    do i = 1, size(template_names)
      call template_text(trim(template_names(i)), text, found)
      call check(error,.not. allocated(found), trim(template_names(i)))
      if (allocated(error)) return
      call expect_scene(error, text, scene)
      if (allocated(error)) return
      dimensions(scene%header%dimension) = dimensions(scene%header%dimension) + 1
      call check(error, size(scene%bodies), 1)
      if (allocated(error)) return
    end do
    call check(error, all(dimensions > 0), 'a dimension has no template')
  end subroutine test_valid

  subroutine test_comments(error)
    type(error_type), allocatable, intent(out) :: error
    type(group_table) :: table
    type(scene_error), allocatable :: found
    character(:), allocatable :: text
    integer :: i

    do i = 1, size(template_names)
      call template_text(trim(template_names(i)), text, found)
      call check(error, index(text, "! Young's modulus E [Pa]") > 0 .and. &
        & index(text, '  ! ratio = 3.015 ') > 0 .and. index(text, '! horizon over the') > 0, text)
      if (allocated(error)) return
    end do
    call list_groups(table)
    call check(error, table%count, 26)
  end subroutine test_comments

  subroutine test_default(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: found
    character(:), allocatable :: text
    character(200) :: first
    integer :: unit, status

    call template_text('', text, found)
    call expect_scene(error, text, scene)
    if (allocated(error)) return
    open (newunit=unit, status='scratch', action='readwrite')
    call write_template(unit, '', found)
    rewind (unit)
    read (unit, '(a)', iostat=status) first
    close (unit)
    call check(error, status, 0)
    if (allocated(error)) return
    call check(error, trim(first), text(:index(text, line) - 1))
  end subroutine test_default

  subroutine test_unknown(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_error), allocatable :: found
    character(:), allocatable :: text

    call template_text('plait', text, found)
    call expect_parts(error, found, "no template is named 'plait'|did you mean 'plate'?|crack")
    if (allocated(error)) return
    call check(error, found%status, status_usage)
  end subroutine test_unknown

end module test_scene_content_template
