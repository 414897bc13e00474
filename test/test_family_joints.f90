!> Bonds between bodies: how many, and what the user is told.
module test_family_joints
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: to_text
  use pd_set_up_prepare, only: set_up_type
  use pd_family_joints, only: joint_type, count_joints
  use pd_scene_content_types, only: scene_type
  use testdrive, only: error_type, new_unittest, unittest_type
  use bodies, only: box_scene, expect_true, ready_alone
  implicit none (type, external)
  private
  public :: collect_family_joints

contains

  subroutine collect_family_joints(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('bonds between bodies are counted pair by pair', test_count), &
      & new_unittest('no warning if no bond joins bodies', test_none)]
  end subroutine collect_family_joints

  !> Three bodies in a row, the third one first in the scene and turned, on one grid and on three,
  !> against all pairs of points.
  subroutine test_count(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(joint_type), allocatable :: joints(:)
    integer(i8) :: wanted(3, 3)
    integer :: variant, dim, i, j, k, a, b

    do variant = 1, 2
      do dim = 1, 3
        call row_of_three(dim, merge(0.0_wp, 0.1_wp, variant == 1), scene)
        call ready_alone(scene, set_up, error)
        if (allocated(error)) return
        wanted = 0_i8
        associate (body => set_up%system%body)
          do i = 1, body%n_points
            do j = 1, i - 1
              k = body%slot(j)
              if (norm2(body%x(body%slot(i), :) - body%x(k, :)) > set_up%system%family%rule%delta) &
                & cycle
              a = min(body%body(k), body%body(body%slot(i)))
              b = max(body%body(k), body%body(body%slot(i)))
              wanted(a, b) = wanted(a, b) + 1_i8
            end do
          end do
        end associate
        call count_joints(set_up%system%body, set_up%system%family, joints)
        call expect_true(error, size(joints) == 2, 'pairs of bodies')
        if (allocated(error)) return
        call expect_true(error, all(joints(1)%bodies == [1, 3]) .and. &
          & all(joints(2)%bodies == [2, 3]), 'their numbers')
        call expect_true(error, joints(1)%bonds == wanted(1, 3) .and. joints(2)%bonds &
          & == wanted(2, 3) .and. wanted(1, 2) == 0_i8, 'their bonds')
        call expect_true(error, index(set_up%warnings%text(), to_text(wanted(1, 3))// &
          & ' bonds join the body ''right'' and the body ''middle''') > 0, set_up%warnings%text())
      end do
    end do
  end subroutine test_count

  !> Bodies named left, middle and right with a gap between them [spacings].
  subroutine row_of_three(dim, gap, scene)
    integer, intent(in) :: dim
    real(wp), intent(in) :: gap
    type(scene_type), intent(out) :: scene
    character(6), parameter :: names(3) = ['right ', 'left  ', 'middle']
    integer, parameter :: place(3) = [2, 0, 1]
    integer :: i

    call box_scene([5, 4, 3], 1.0_wp, 0.25_wp, scene)
    scene%header%dimension = dim
    scene%bodies = [(scene%bodies(1), i=1, 3)]
    do i = 1, 3
      scene%bodies(i)%name = names(i)
      scene%bodies(i)%lower(1) = place(i)*(5 + gap)
      scene%bodies(i)%upper(1) = scene%bodies(i)%lower(1) + 5
    end do
  end subroutine row_of_three

  !> Bodies farther apart than the horizon, bodies parted by a crack, one body in two pieces, one
  !> body whole.
  subroutine test_none(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(joint_type), allocatable :: joints(:)
    integer :: variant

    do variant = 1, 4
      call row_of_three(2, merge(3.1_wp, 0.0_wp, variant == 1), scene)
      deallocate (scene%removed, scene%cracks)
      allocate (scene%removed(0), scene%cracks(0))
      if (variant == 2) then
        deallocate (scene%cracks)
        allocate (scene%cracks(2))
        scene%cracks(1)%from(1:2) = [5.0_wp, -1.0_wp]
        scene%cracks(1)%to(1:2) = [5.0_wp, 5.0_wp]
        scene%cracks(2)%from(1:2) = [10.0_wp, -1.0_wp]
        scene%cracks(2)%to(1:2) = [10.0_wp, 5.0_wp]
      end if
      if (variant > 2) scene%bodies = scene%bodies(2:2)
      if (variant == 3) then
        deallocate (scene%removed)
        allocate (scene%removed(1))
        scene%removed(1)%shape = 'box'
        scene%removed(1)%lower(1) = 2.0_wp
        scene%removed(1)%upper(1) = 3.0_wp
      end if
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      call count_joints(set_up%system%body, set_up%system%family, joints)
      call expect_true(error, size(joints) == 0, 'bonds between bodies')
      call expect_true(error, index(set_up%warnings%text(), 'bonds join') == 0, &
        & set_up%warnings%text())
    end do
  end subroutine test_none

end module test_family_joints
