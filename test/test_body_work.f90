!> What points cost, by which ranks share the work: against numbers counted by hand.
module test_body_work
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_body_body, only: body_type
  use pd_body_division, only: divide_space, division_type, owner_of, work_of_points
  use pd_body_generate, only: generate_body
  use pd_body_work, only: full_share, work_of, work_rule_type
  use pd_scene_content_types, only: scene_type
  use pd_set_up_ranks, only: bounds_of_bodies, rule_of_work, work_of_body
  use bodies, only: expect, expect_true
  use test_scene_expect, only: expect_scene, line
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_body_work

  character(*), parameter :: plane = '&scene dimension = 2 thickness = 1 /'//line// &
    & '&material youngs_modulus = 1 density = 1 poissons_ratio = 0.25 /'//line// &
    & '&time steps = 1 /'//line
  character(*), parameter :: plate = "&body name = 'plate' lower = 0 0 upper = 20 12 "// &
    & 'points = 20 12 /'//line
  character(*), parameter :: block = "&body name = 'block' lower = 5 12 upper = 13 20 "// &
    & 'points = 8 8 /'//line
  integer, parameter :: of_point = 15, members = 29  !! pi 3.015^2 = 28.6 of spacing 1

contains

  subroutine collect_body_work(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('points of full blocks cost their bonds', test_full), &
      & new_unittest('a block costs the same whatever points it lacks', test_blocks), &
      & new_unittest('finer points have more bonds', test_spacings), &
      & new_unittest('points that may touch another body cost more', test_contact), &
      & new_unittest('cuts share out contact', test_cuts)]
  end subroutine collect_body_work

  !> The work of a scene's points.
  subroutine work_of_scene(text, scene, body, work, error)
    character(*), intent(in) :: text
    type(scene_type), intent(out) :: scene
    type(body_type), intent(out) :: body
    real(wp), allocatable, intent(out) :: work(:)
    type(error_type), allocatable, intent(out) :: error
    type(fault_type), allocatable :: fault
    type(work_rule_type) :: rule
    real(wp) :: delta

    call expect_scene(error, text, scene)
    if (allocated(error)) return
    call generate_body(scene, body, delta, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    call rule_of(scene, body, rule)
    work = work_of(rule, body, body%slot)
  end subroutine work_of_scene

  subroutine rule_of(scene, body, rule)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    type(work_rule_type), intent(out) :: rule
    real(wp), dimension(3, size(scene%bodies)) :: lower, upper

    call bounds_of_bodies(body, lower, upper)
    call rule_of_work(scene, body%delta, body%largest_spacing, lower, upper, rule)
  end subroutine rule_of

  !> Rows of 16 points are two blocks of 8.
  subroutine test_full(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(body_type) :: body
    real(wp), allocatable :: work(:)

    call work_of_scene(plane//'&body lower = 0 0 upper = 16 5 points = 16 5 /'//line, scene, body, &
      & work, error)
    if (allocated(error)) return
    call expect_true(error, all(abs(work - full_share*(of_point + members)) <= 0.0_wp), 'work')
  end subroutine test_full

  !> Rows of 20 points: the last block has 4 of them. Lists have no blocks.
  subroutine test_blocks(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(body_type) :: body
    real(wp), allocatable :: work(:)

    call work_of_scene(plane//plate//"&remove shape = 'box' lower = 3 0 upper = 6 1 /"//line, &
      & scene, body, work, error)
    if (allocated(error)) return
    call expect_true(error, size(work) == 20*12 - 3, 'points')
    call expect(error, work(1), full_share*8*(of_point + members)/5, 0.0_wp, 'of 5 in a block')
    call expect(error, work(10), full_share*(of_point + members), 0.0_wp, 'of 8')
    call expect(error, work(17), full_share*2*(of_point + members), 0.0_wp, 'of 4')
    call expect(error, sum(work), full_share*8*3*12*(of_point + members), 0.0_wp, 'all blocks')
    call work_of_scene(plane//plate//"&horizon family = 'list' /"//line, scene, body, work, error)
    if (allocated(error)) return
    call expect_true(error, all(abs(work - full_share*(of_point + members)) <= 0.0_wp), 'in lists')
  end subroutine test_blocks

  !> One horizon, and spacings 1 and 1/2: pi 6.03^2 = 114.2.
  subroutine test_spacings(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(body_type) :: body
    real(wp), allocatable :: work(:)

    call work_of_scene(plane//plate//'&body lower = 50 0 upper = 54 4 points = 8 8 /'//line, &
      & scene, body, work, error)
    if (allocated(error)) return
    call expect_true(error, all(abs(work(241:) - full_share*(of_point + 114)) <= 0.0_wp), 'work')
  end subroutine test_spacings

  !> The plate's upper row below the block and the block's lowest row: they are 1 apart, and contact
  !> is looked for within 0.9 + 0.25 spacings, also beside the block.
  subroutine test_contact(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: bodies = plane//plate//block
    type(scene_type) :: scene
    type(body_type) :: body
    real(wp), allocatable :: with(:), without(:)
    integer, parameter :: of_member(4) = [0, 40, 88, 140], of_contact(4) = [1000, 800, 1760, 2800]
    character(60), parameter :: contacts(4) = [character(60) :: "normals = 'centres'", ' ', &
      & 'friction = 0.1', 'friction = 0.1 restitution = 0.5']
    logical, allocatable :: touching(:)
    integer :: i

    call work_of_scene(bodies, scene, body, without, error)
    if (allocated(error)) return
    touching = (body%body == 1 .and. body%x(:, 2) > 11.0_wp .and. body%x(:, 1) > 4.0_wp .and. &
      & body%x(:, 1) < 14.0_wp) .or. (body%body == 2 .and. body%x(:, 2) < 13.0_wp)
    call expect_true(error, count(touching) == 10 + 8, 'points in contact')
    do i = 1, size(contacts)
      call work_of_scene(bodies//"&contact between = 'plate', 'block' "//trim(contacts(i))//' /'// &
        & line, scene, body, with, error)
      if (allocated(error)) return
      call expect_true(error, all(abs(with - without - merge(full_share*(of_contact(i) &
        & + of_member(i)*members), 0.0_wp, touching)) <= 0.0_wp), trim(contacts(i)))
    end do
    call work_of_scene(bodies//"&contact within = 'plate' /"//line, scene, body, with, error)
    if (allocated(error)) return
    call expect_true(error, all(abs(with - without) <= 0.0_wp), 'pieces are not foreseen')
  end subroutine test_contact

  !> Of a plate with a block at its end, one of two ranks has the contact but for the part that
  !> balances the work.
  subroutine test_cuts(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(body_type) :: body
    type(work_rule_type) :: rule
    type(work_of_points) :: alike, weighed
    type(division_type) :: division
    real(wp), allocatable :: work(:)
    real(wp) :: shares(0:1)
    integer :: i, r

    call work_of_scene(plane//"&body name = 'plate' lower = 0 0 upper = 400 12 "// &
      & 'points = 400 12 /'//line//"&body name = 'block' lower = 300 12 upper = 396 24 "// &
      & 'points = 96 12 /'//line// &
      & "&contact between = 'plate', 'block' friction = 0.1 /"//line, scene, body, work, error)
    if (allocated(error)) return
    call rule_of(scene, body, rule)
    call work_of_body(body, 1, weighed, rule)
    call divide_space(weighed, 2, division)
    ! a column of the plate with contact costs 2 (1760 + 88 29) + 24 (15 + 29) bonds, of all
    ! 96 2 (1760 + 88 29) + 5952 (15 + 29)
    call expect_true(error, maxval(division%work) <= 1.01_wp*sum(division%work)/2, 'balance')
    call expect_true(error, division%at(1) > 300.0_wp .and. division%at(1) < 396.0_wp, 'the cut')
    shares = 0.0_wp
    do i = 1, body%n_points
      r = owner_of(division, body%x(i, :))
      shares(r) = shares(r) + work(i)
    end do
    call expect_true(error, all(abs(shares - division%work) <= 0.0_wp), 'the work of the ranks')
    call work_of_body(body, 1, alike)
    call divide_space(alike, 2, division)
    call expect_true(error, division%at(1) < 300.0_wp, 'the cut without contact')
  end subroutine test_cuts

end module test_body_work
