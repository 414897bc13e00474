!> Forces that boundaries exert on single points: they add up to the reactions of the boundaries,
!> which other tests compare with statics and with momentum.
module test_motion_reactions
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i1
  use pd_motion_reactions, only: point_reactions
  use pd_scene_content_complete, only: complete_scene
  use pd_scene_content_types, only: scene_type
  use pd_set_up_move, only: move
  use pd_set_up_prepare, only: set_up_type
  use bodies, only: box_scene, diary_type, expect_true, ready
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_motion_reactions

  real(wp), parameter :: spacing = 1.0e-3_wp  !! [m]

contains

  subroutine collect_motion_reactions(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('they add up to the reactions of boundaries', test_sums)]
  end subroutine collect_motion_reactions

  !> A layer that is moved ever faster and a region that is held and loaded, in time and in static
  !> equilibrium: two sums of some dozen terms differ by their rounding.
  subroutine test_sums(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: reaction(:, :)
    character(10), parameter :: methods(2) = [character(10) :: 'explicit', 'relaxation']
    integer :: i, m

    do i = 1, 2
      call box_scene([12, 6], spacing, 0.3_wp, scene)
      deallocate (scene%boundaries, scene%regions, scene%loads)
      allocate (scene%boundaries(2), scene%regions(1), scene%loads(1))
      scene%regions(1)%name = 'foot'
      scene%regions(1)%where = 'x < 0.003'
      scene%boundaries(1)%side = 'x_max'
      scene%boundaries(2)%region = 'foot'
      scene%boundaries(2)%displacement(1) = 0.0_wp
      scene%boundaries(2)%displacement(2) = 0.0_wp
      scene%loads(1)%region = 'foot'
      scene%loads(1)%body_force(2) = 1.0e6_wp
      scene%time%method = methods(i)
      if (i == 1) then
        scene%boundaries(1)%velocity(1) = 10.0_wp
        scene%boundaries(1)%ramp_time = 1.0_wp
        scene%time%steps = 40
      else
        scene%boundaries(1)%displacement(1) = 1.0e-6_wp
        scene%time%steps = 0
      end if
      call complete_scene(scene, fault)
      if (.not. allocated(fault)) call ready(scene, set_up, error)
      if (allocated(error)) return
      if (.not. allocated(fault)) call move(set_up%system, set_up%plan, diary, fault)
      if (allocated(fault)) then
        call test_failed(error, trim(methods(i))//': '//fault%message)
        return
      end if
      associate (system => set_up%system)
        allocate (reaction(system%body%n_slots, 2))
        call point_reactions(system, reaction)
        do m = 1, 2
          call expect_true(error, norm2(system%motions(m)%reaction) > 0.0_wp, 'a reaction')
          call expect_close(error, sum(reaction(system%motions(m)%slots, :), 1) &
            & /norm2(system%motions(m)%reaction), system%motions(m)%reaction(:2) &
            & /norm2(system%motions(m)%reaction), 1.0e-12_wp, trim(methods(i)))
        end do
        call expect_true(error, max_abs(pack(reaction, system%held == 0_i1)) <= 0.0_wp, &
          & 'free components have none')
        deallocate (reaction)
      end associate
    end do
  end subroutine test_sums

end module test_motion_reactions
