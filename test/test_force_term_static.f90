!> Terms of the force in static equilibrium, with terms that only tests know (`force_terms`): closed
!> forms, both solvers, restart, and what is refused.
module test_force_term_static
  use pd_base_error, only: fault_type => error_type, status_input
  use pd_base_kinds, only: wp
  use pd_force_terms, only: term_list_type
  use pd_motion_keep, only: keep_system
  use pd_motion_observer, only: observer_type
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: set_up_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: at_point, box_scene, diary_type, expect, expect_true, youngs_modulus
  use force_terms, only: spacing, friction_type, keeper_type, ground, dashpot, ready_with, &
    & two_boxes, link
  implicit none (type, external)
  private
  public :: collect_force_term_static

contains

  subroutine collect_force_term_static(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a restart within a relaxation has the same bits', test_static_restart), &
      & new_unittest('static equilibrium on springs, by both solvers', test_static), &
      & new_unittest('static equilibrium of two bodies with a link', test_static_link), &
      & new_unittest('a term without a tangent is refused by name', test_refusal)]
  end subroutine collect_force_term_static

  !> The same of both solvers, in the second of two load steps.
  subroutine test_static_restart(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(term_list_type) :: terms
    type(set_up_type) :: whole, again
    type(diary_type) :: diary
    type(keeper_type) :: keeper
    real(wp), parameter :: far = 1.0e-3_wp*spacing
    real(wp) :: s
    integer :: dynamic

    s = 1.0e-3_wp*youngs_modulus/spacing**2
    call terms%add(ground(s, s/far**2, 40*far))
    call box_scene([5, 4], spacing, 0.2_wp, scene)
    deallocate (scene%loads)
    allocate (scene%loads(1))
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%pressure = -1.0e-3_wp*youngs_modulus
    scene%time%method = 'relaxation'
    scene%relaxation%tolerance = 1.0e-8_wp
    scene%relaxation%load_steps = 2
    scene%relaxation%maximum_iterations = 20000
    do dynamic = 0, 1
      scene%relaxation%solver = 'conjugate_gradient'
      if (dynamic == 1) scene%relaxation%solver = 'dynamic_relaxation'
      call ready_with(scene, terms, whole, error)
      call ready_with(scene, terms, again, error)
      if (allocated(error)) return
      diary = diary_type()
      call rest(whole, diary, error)
      if (allocated(error)) return
      ! the diary has a row for the start, one for each iteration and one for each settled step
      keeper = keeper_type()
      keeper%step = (3*(diary%n - 3))/4
      call rest(again, keeper, error)
      call ready_with(scene, terms, again, error)
      if (allocated(error)) return
      call keeper%snapshot%rewind(reading=.true.)
      call keep_system(keeper%snapshot, again%system)
      call expect_true(error, .not. allocated(keeper%snapshot%error), 'the state is not put back')
      associate (memory => again%system%memory)
        call expect_true(error, memory%load_step == 2 .and. &
          & (memory%iteration > 0 .or. allocated(memory%newton)), trim(scene%relaxation%solver)// &
          & ' is not kept amid a load step')
      end associate
      call rest(again, diary, error)
      if (allocated(error)) return
      call expect_close(error, again%system%state%u, whole%system%state%u, 0.0_wp, &
        & trim(scene%relaxation%solver)//': displacements')
      call expect_close(error, again%system%state%force, whole%system%state%force, 0.0_wp, &
        & trim(scene%relaxation%solver)//': forces')
      call expect(error, again%system%external_work, whole%system%external_work, 0.0_wp, &
        & trim(scene%relaxation%solver)//': work')
    end do
  end subroutine test_static_restart

  !> A body that nothing but springs holds, under a body force b: everywhere s u + h u^3 = b. With
  !> unevenly spread loads the solvers must agree, and the springs bear what acts.
  subroutine test_static(error)
    type(error_type), allocatable, intent(out) :: error
    character(20), parameter :: solvers(*) = [character(20) :: 'conjugate_gradient', &
      & 'dynamic_relaxation']
    real(wp), parameter :: u = 1.0e-3_wp*spacing   ! expected displacement
    type(scene_type) :: scene
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: s, h, net, acting
    real(wp), allocatable :: found(:, :, :)
    integer :: i, hard, k

    s = 1.0e-3_wp*youngs_modulus/spacing**2
    do hard = 0, 1
      h = hard*s/u**2
      do i = 1, size(solvers)
        call box_scene([5, 4], spacing, 0.2_wp, scene)
        deallocate (scene%loads)
        allocate (scene%loads(1))
        scene%loads(1)%body_force(1) = s*u + h*u**3
        scene%time%method = 'relaxation'
        scene%relaxation%solver = solvers(i)
        scene%relaxation%tolerance = 1.0e-9_wp
        scene%relaxation%maximum_iterations = 20000
        terms = term_list_type()
        call terms%add(ground(s, h, 4*u))
        call ready_with(scene, terms, set_up, error)
        if (allocated(error)) return
        diary = diary_type()
        diary%every = 0
        call rest(set_up, diary, error)
        if (allocated(error)) return
        do k = 1, set_up%system%body%n_slots
          if (set_up%system%body%point(k) == 0) cycle
          call expect(error, set_up%system%state%u(k, 1)/u, 1.0_wp, 1.0e-7_wp, &
            & 'displacement by '//trim(solvers(i)))
          call expect(error, set_up%system%state%u(k, 2)/u, 0.0_wp, 1.0e-7_wp, &
            & 'displacement across by '//trim(solvers(i)))
        end do
        ! the work of the load is what the springs store
        call expect(error, diary%strain(diary%n)/(set_up%system%body%n_points*spacing**2 &
          & *scene%header%thickness), s*u**2/2 + h*u**4/4, 1.0e-6_wp*s*u**2, 'stored energy')
        ! a force at one side
        deallocate (scene%loads)
        allocate (scene%loads(1))
        scene%loads(1)%side = 'x_max'
        scene%loads(1)%pressure = -1.0e-4_wp*youngs_modulus
        call ready_with(scene, terms, set_up, error)
        if (allocated(error)) return
        call rest(set_up, diary, error)
        if (allocated(error)) return
        associate (system => set_up%system)
          if (.not. allocated(found)) allocate (found(system%body%n_slots, 2, 2))
          found(:, :, i) = system%state%u
          net = 0.0_wp
          do k = 1, system%body%n_slots
            net = net - system%body%volume(k)*(s + h*sum(system%state%u(k, :)**2)) &
              & *system%state%u(k, 1)
          end do
          acting = 1.0e-4_wp*youngs_modulus*4*spacing*scene%header%thickness
          call expect(error, net/acting, -1.0_wp, 1.0e-6_wp, 'the springs bear the load')
        end associate
      end do
      call expect_close(error, found(:, :, 1), found(:, :, 2), 1.0e-6_wp*max_abs(found(:, :, 1)), &
        & 'both solvers')
    end do
  end subroutine test_static

  !> Relax; a fault fails the test.
  subroutine rest(set_up, observer, error)
    type(set_up_type), intent(inout) :: set_up
    class(observer_type), intent(inout) :: observer
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    call run_relaxation(set_up%system, set_up%plan%relaxation, observer, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine rest

  !> A body that is held and one that hangs on it by a link at its middle, which a force through
  !> that point pulls by F: the link is longer by F/k, and the far body moves so much further than
  !> the end of the near one.
  subroutine test_static_link(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: force, k
    integer :: near, far

    call two_boxes(scene)
    deallocate (scene%boundaries, scene%loads)
    allocate (scene%boundaries(1), scene%loads(1))
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%displacement(:2) = 0.0_wp
    force = 100.0_wp
    k = 1.0e9_wp
    scene%loads(1)%body = 'other'
    scene%loads(1)%force(1) = force
    scene%time%method = 'relaxation'
    scene%relaxation%solver = 'conjugate_gradient'
    scene%relaxation%tolerance = 1.0e-9_wp
    call terms%add(link(k))
    call ready_with(scene, terms, set_up, error)
    if (allocated(error)) return
    diary%every = 0
    call rest(set_up, diary, error)
    if (allocated(error)) return
    associate (body => set_up%system%body, u => set_up%system%state%u)
      near = at_point(body, [1.5_wp*spacing, 1.5_wp*spacing])
      far = at_point(body, [9.5_wp*spacing, 1.5_wp*spacing])
      call expect(error, (u(far, 1) - u(near, 1))*k/force, 1.0_wp, 1.0e-5_wp, 'length of the link')
      call expect_true(error, u(near, 1) > 0.0_wp, 'the near body is not pulled')
    end associate
  end subroutine test_static_link

  !> Static equilibrium with friction, which has no tangent, and with dashpots, which need none.
  subroutine test_refusal(error)
    type(error_type), allocatable, intent(out) :: error
    type(friction_type) :: friction
    type(scene_type) :: scene
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault

    call box_scene([5, 4], spacing, 0.2_wp, scene)
    scene%time%method = 'relaxation'
    call terms%add(dashpot(1.0_wp))
    call ready_with(scene, terms, set_up, error)
    if (allocated(error)) return
    diary%every = 0
    call rest(set_up, diary, error)
    friction%name = 'slow slip'
    friction%s = 1.0e12_wp
    friction%yield = 1.0_wp
    call terms%add(friction)
    call ready_with(scene, terms, set_up, error)
    if (allocated(error)) return
    call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
    call expect_true(error, allocated(fault), 'a term without a tangent is accepted')
    if (allocated(error)) return
    call expect_true(error, fault%status == status_input .and. &
      & index(fault%message, '"slow slip"') > 0 .and. index(fault%message, 'tangent') > 0, &
      & 'the message is: '//fault%message)
  end subroutine test_refusal

end module test_force_term_static
