!> Adaptive dynamic relaxation against the direct solution of the same linear system, and its rules.
module test_motion_static_relaxation
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_error, only: fault_type => error_type, status_input, status_no_answer
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_motion_system, only: system_type, add_loads, evaluate
  use pd_scene_content_types, only: scene_type, unset
  use elimination, only: eliminate
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, unittest_type, test_failed
  use bodies, only: at_point, box_scene, diary_type, expect, expect_true, ready, ready_alone, &
    & youngs_modulus
  implicit none (type, external)
  private
  public :: collect_motion_static_relaxation

  real(wp), parameter :: spacing = 1.0e-2_wp
  real(wp), &
    & parameter :: pressure = -1.0e4_wp  !! pulls; strains of 1e-7, so far from nothing is linear

contains

  subroutine collect_motion_static_relaxation(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('the result is that of the linear system', test_direct), &
      & new_unittest('all density matrices lead to the same result', test_masses), &
      & new_unittest('load steps converge one by one', test_load_steps), &
      & new_unittest('balanced loads need no support', test_balanced), &
      & new_unittest('unbalanced loads without support are refused', test_unbalanced), &
      & new_unittest('a state that has not converged is an error', test_unconverged), &
      & new_unittest('a strained body without loads reaches equilibrium', test_released), &
      & new_unittest('bonds break only in equilibrium', test_breaks_at_rest), &
      & new_unittest('a bar broken in two reaches equilibrium again', test_torn), &
      & new_unittest('long: conjugate gradients continue for a slender body', test_slender)]
  end subroutine collect_motion_static_relaxation

  !> Bodies held at x_min by a layer and pulled at x_max: thick and thin, one material and two, with
  !> and without surface correction.
  subroutine body_number(number, scene, name)
    integer, intent(in) :: number
    type(scene_type), intent(out) :: scene
    character(:), allocatable, intent(out) :: name

    select case ((number + 1)/2)
    case (1)
      name = 'bar'
      call box_scene([14], spacing, 0.3_wp, scene)
    case (2)
      name = 'plate'
      call box_scene([7, 5], spacing, 0.2_wp, scene)
    case (3)
      name = 'plate of the special ratio'
      call box_scene([7, 5], spacing, 1.0_wp/3, scene)
    case (4)
      name = 'block'
      call box_scene([5, 4, 3], spacing, 0.2_wp, scene)
    case (5)
      name = 'stiff block'
      call box_scene([5, 4, 3], spacing, 0.4_wp, scene)
    case (6)
      name = 'sheet in space'
      call box_scene([6, 5, 1], spacing, 0.3_wp, scene)
    case (7)
      name = 'chain in space'
      call box_scene([10, 1, 1], spacing, 0.3_wp, scene)
    case default
      name = 'plate of two materials'
      call box_scene([4, 5], spacing, 0.3_wp, scene)
      scene%bodies = [scene%bodies(1), scene%bodies(1)]
      scene%bodies(2)%name = 'other'
      scene%bodies(2)%lower(1) = 4*spacing
      scene%bodies(2)%upper(1) = 8*spacing
      scene%materials = [scene%materials(1), scene%materials(1)]
      scene%materials(2)%name = 'other'
      scene%materials(2)%youngs_modulus = youngs_modulus/10
      scene%materials(2)%poissons_ratio = 0.1_wp
      scene%bodies(1)%material = 'steel'
      scene%bodies(2)%material = 'other'
    end select
    if (mod(number, 2) == 0) then
      scene%horizon%surface_correction = 'energy'
      name = name//', corrected'
    end if
    call pull(scene)
  end subroutine body_number

  subroutine pull(scene)
    type(scene_type), intent(inout) :: scene

    deallocate (scene%boundaries, scene%loads)
    allocate (scene%boundaries(1), scene%loads(1))
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%displacement(:scene%header%dimension) = 0.0_wp
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%pressure = pressure
    scene%time%method = 'relaxation'
    scene%relaxation%solver = 'dynamic_relaxation'
    scene%relaxation%tolerance = 1.0e-9_wp
  end subroutine pull

  !> Solve K u = b by elimination, K from differences of the forces: exact but for the force's
  !> curvature, a relative 1e-7. Components across thin bodies have no stiffness and no load: left
  !> out.
  subroutine direct(system, t, u, error)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: t
    real(wp), allocatable, intent(out) :: u(:, :)
    type(error_type), allocatable, intent(inout) :: error
    real(wp), parameter :: h = 1.0e-7_wp*spacing
    real(wp), allocatable :: K(:, :), b(:, :), plus(:, :), x(:)
    integer, allocatable :: slots(:), components(:)
    integer :: n, c, s, i, j
    logical :: singular

    associate (body => system%body, state => system%state)
      allocate (slots(0), components(0))
      do c = 1, body%dim
        if (maxval(body%x(body%slot, c)) - minval(body%x(body%slot, c)) < spacing/2) cycle
        do i = 1, body%n_points
          s = body%slot(i)
          if (system%held(s, c) == 1_i1) cycle
          slots = [slots, s]
          components = [components, c]
        end do
      end do
      n = size(slots)
      allocate (K(n, n), x(n))
      allocate (b(body%n_slots, body%dim), source=0.0_wp)
      call add_loads(system, t, 1.0_wp, .false., b)
      do j = 1, n
        state%u = 0.0_wp
        state%u(slots(j), components(j)) = h
        call evaluate(system, 0.0_wp, breaking=.false.)
        plus = state%force
        state%u = 0.0_wp
        state%u(slots(j), components(j)) = -h
        call evaluate(system, 0.0_wp, breaking=.false.)
        do i = 1, n
          K(i, j) = (state%force(slots(i), components(i)) - plus(slots(i), components(i)))/(2*h)
        end do
      end do
      state%u = 0.0_wp
      do i = 1, n
        x(i) = b(slots(i), components(i))
      end do
      call eliminate(K, x, singular)
      if (singular) then
        call test_failed(error, 'the linear system is singular')
        return
      end if
      allocate (u(body%n_slots, body%dim), source=0.0_wp)
      do i = 1, n
        u(slots(i), components(i)) = x(i)
      end do
    end associate
  end subroutine direct

  !> Relax a scene.
  subroutine relax(scene, set_up, diary, error)
    type(scene_type), intent(in) :: scene
    type(set_up_type), intent(inout) :: set_up
    type(diary_type), intent(out) :: diary
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    call ready(scene, set_up, error)
    if (allocated(error)) return
    diary%every = 0
    call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine relax

  !> The residual is relaxed to 1e-9 of the load; the answer's error is that times the condition of
  !> these small systems (up to some 1e3): 1e-6 of the largest displacement.
  subroutine test_direct(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    character(:), allocatable :: name
    real(wp), allocatable :: u(:, :), found(:, :)
    integer :: number

    do number = 1, 16
      call body_number(number, scene, name)
      call relax(scene, set_up, diary, error)
      if (allocated(error)) return
      found = set_up%system%state%u
      call direct(set_up%system, 1.0_wp, u, error)
      if (allocated(error)) return
      call expect_true(error, max_abs(u) > 1.0e-10_wp, 'nothing moved: '//name)
      call expect_close(error, found, u, 1.0e-6_wp*max_abs(u), name)
    end do
  end subroutine test_direct

  !> The way differs, the end doesn't.
  subroutine test_masses(error)
    type(error_type), allocatable, intent(out) :: error
    character(16), parameter :: kinds(3) = [character(16) :: 'frame_invariant', 'chapter', &
      & 'constant']
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    character(:), allocatable :: name
    real(wp), allocatable :: first(:, :)
    integer :: i

    do i = 1, size(kinds)
      call body_number(3, scene, name)
      scene%relaxation%density_matrix = kinds(i)
      call relax(scene, set_up, diary, error)
      if (allocated(error)) return
      if (i == 1) first = set_up%system%state%u
      call expect_close(error, set_up%system%state%u, first, &
        & 1.0e-6_wp*max_abs(first), &
        & trim(kinds(i)))
    end do
  end subroutine test_masses

  !> At small loads the displacement after load step i of n is i/n of the last.
  subroutine test_load_steps(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    character(:), allocatable :: name
    integer :: i

    call body_number(4, scene, name)
    scene%relaxation%load_steps = 4
    call ready(scene, set_up, error)
    if (allocated(error)) return
    diary%every = 0
    diary%slot = at_point(set_up%system%body, [6.5_wp, 0.5_wp]*spacing)
    call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
    call expect_true(error, .not. allocated(fault), 'the relaxation failed')
    if (allocated(error)) return
    call expect_true(error, diary%settled == 4 .and. diary%n == 5, 'load steps that came to rest')
    if (allocated(error)) return
    do i = 0, 4
      call expect(error, diary%time(i + 1), 0.25_wp*i, 0.0_wp, 'time')
      call expect_close(error, diary%u(:, i + 1), 0.25_wp*i*diary%u(:, 5), &
        & 2.0e-6_wp*max_abs(diary%u(:, 5)), 'displacement of a load step')
      ! W = half load times displacement; at each step the work done is the strain energy
      if (i > 0) call expect(error, diary%work(i + 1), diary%strain(i + 1), &
        & 1.0e-5_wp*diary%strain(5), 'work')
    end do
  end subroutine test_load_steps

  !> Pulled at both ends: no net translation or rotation, mirror symmetry, and the strain of a bar
  !> that is held in its middle.
  subroutine test_balanced(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    integer :: dim, c, i
    integer, parameter :: points(3) = [8, 5, 4]

    do dim = 1, 3
      call box_scene(points(:dim), spacing, 0.3_wp, scene)
      call pull(scene)
      deallocate (scene%boundaries, scene%loads)
      allocate (scene%boundaries(0), scene%loads(2))
      scene%loads(1)%side = 'x_min'
      scene%loads(2)%side = 'x_max'
      scene%loads%pressure = pressure
      call relax(scene, set_up, diary, error)
      if (allocated(error)) return
      associate (u => set_up%system%state%u, body => set_up%system%body)
        do c = 1, dim
          call expect(error, sum(u(:, c)), 0.0_wp, 1.0e-10_wp*sum(abs(u(:, c))), &
            & 'mean displacement')
        end do
        if (dim > 1) call expect(error, sum(u(:, 2)*(body%x(:, 1) - 4*spacing) &
          & - u(:, 1)*(body%x(:, 2) - 2.5_wp*spacing)), 0.0_wp, 1.0e-8_wp*sum(abs(u))*spacing, &
          & 'mean rotation')
        do i = 1, body%n_points
          ! the opposite point of a lattice is the last but i - 1
          associate (k => body%slot(i), j => body%slot(body%n_points + 1 - i))
            call expect_close(error, u(k, :) + u(j, :), 0.0_wp, 1.0e-6_wp*max_abs(u), &
              & 'symmetry')
          end associate
        end do
        associate (k => at_point(body, [4.5_wp, spread(2.5_wp, 1, dim - 1)]*spacing), &
          & j => at_point(body, [3.5_wp, spread(2.5_wp, 1, dim - 1)]*spacing))
          ! stress over E, whatever ends and edges do: without correction surfaces are softer by
          ! half
          call expect_true(error, (u(k, 1) - u(j, 1))/spacing > -0.8_wp*pressure/youngs_modulus &
            & .and. &
            & (u(k, 1) - u(j, 1))/spacing < -4*pressure/youngs_modulus, 'strain in the middle')
        end associate
      end associate
    end do
  end subroutine test_balanced

  subroutine test_unbalanced(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    integer :: case

    do case = 1, 3
      call box_scene([8, 5], spacing, 0.3_wp, scene)
      call pull(scene)
      select case (case)
      case (1)  ! pulled at one end, free
        deallocate (scene%boundaries)
        allocate (scene%boundaries(0))
      case (2)  ! a couple turns it
        deallocate (scene%boundaries, scene%loads)
        allocate (scene%boundaries(0), scene%loads(2))
        scene%loads(1)%side = 'x_min'
        scene%loads(2)%side = 'x_max'
        scene%loads(1)%force(2) = 5.0_wp
        scene%loads(2)%force(2) = -5.0_wp
      case default  ! held across, pulled along
        scene%boundaries(1)%displacement(1) = -huge(1.0_wp)
      end select
      call ready(scene, set_up, error)
      if (allocated(error)) return
      call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
      call expect_true(error, allocated(fault), 'unbalanced loads were accepted')
      if (.not. allocated(fault)) return
      call expect_true(error, fault%status == status_input, 'exit status')
      call expect_true(error, index(fault%message, 'free to move') > 0, 'message: '//fault%message)
    end do
  end subroutine test_unbalanced

  subroutine test_unconverged(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    character(:), allocatable :: name

    call body_number(3, scene, name)
    scene%relaxation%maximum_iterations = 5
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
    call expect_true(error, allocated(fault), 'five iterations were enough')
    if (.not. allocated(fault)) return
    call expect_true(error, fault%status == status_no_answer, 'exit status')
    call expect_true(error, index(fault%message, 'not converged') == 1, 'message: '//fault%message)
  end subroutine test_unconverged

  !> A cantilever of 60 x 3 points, its inner half 10^4 times softer, is bent by a pull across at
  !> its end: 99,999 iterations of dynamic relaxation aren't enough, and with the default number the
  !> conjugate gradient solver goes on. The reaction is that of statics, within the 10^-3 that every
  !> accepted state obeys, and the deflection that of the other solver, within 10^-3 of it.
  subroutine test_slender(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: density = 1.0e-3_wp  ! of the force at the end [N/m3]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: u(:, :)
    real(wp) :: load, reaction
    integer :: i

    call box_scene([30, 3], spacing, 0.3_wp, scene)
    scene%bodies = [scene%bodies(1), scene%bodies(1)]
    scene%bodies(2)%name = 'other'
    scene%bodies(2)%lower(1) = 30*spacing
    scene%bodies(2)%upper(1) = 60*spacing
    scene%materials = [scene%materials(1), scene%materials(1)]
    scene%materials(2)%name = 'other'
    scene%materials(2)%youngs_modulus = youngs_modulus/1.0e4_wp
    scene%bodies(1)%material = 'other'
    scene%bodies(2)%material = 'steel'
    call pull(scene)
    scene%relaxation%tolerance = 1.0e-6_wp
    deallocate (scene%regions)
    allocate (scene%regions(1))
    scene%regions(1)%name = 'end'
    scene%regions(1)%shape = 'box'
    scene%regions(1)%lower(1) = 57*spacing
    scene%regions(1)%upper(1) = 61*spacing
    scene%loads(1)%side = ''
    scene%loads(1)%pressure = unset
    scene%loads(1)%region = 'end'
    scene%loads(1)%body_force(2) = density

    scene%relaxation%maximum_iterations = 99999
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    diary%every = 0
    call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
    call expect_true(error, allocated(fault), 'dynamic relaxation needs no help')
    if (allocated(error)) return

    scene%relaxation%maximum_iterations = 100000
    do i = 1, 2
      call relax(scene, set_up, diary, error)
      if (allocated(error)) return
      associate (body => set_up%system%body)
        load = density*sum(body%volume, body%x(:, 1) > 57*spacing)
        reaction = sum(set_up%system%state%force(:, 2)*body%volume, &
          & set_up%system%held(:, 2) == 1_i1)
      end associate
      call expect_close(error, reaction, load, 1.0e-3_wp*load, 'reaction')
      if (i == 1) u = set_up%system%state%u
      scene%relaxation%solver = 'conjugate_gradient'
    end do
    call expect_close(error, u, set_up%system%state%u, 1.0e-3_wp*max_abs(u), 'displacements')
  end subroutine test_slender

  !> A stretched free plate shrinks back to no strain energy.
  subroutine test_released(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary

    call box_scene([7, 6], spacing, 0.2_wp, scene)
    call pull(scene)
    deallocate (scene%boundaries, scene%loads, scene%initial)
    allocate (scene%boundaries(0), scene%loads(0), scene%initial(1))
    scene%initial(1)%displacement_gradient(1, 1) = 1.0e-4_wp
    call relax(scene, set_up, diary, error)
    if (allocated(error)) return
    call expect_true(error, diary%strain(1) > 1.0e-6_wp, 'no strain at the start')
    call expect(error, diary%strain(diary%n), 0.0_wp, 1.0e-14_wp*diary%strain(1), &
      & 'strain energy at rest')
  end subroutine test_released

  !> A layer jumps so far that a wave would pass s_c by far, but the state of rest stays at 0.7 of
  !> it: nothing breaks. One and a half times that, and it does.
  subroutine test_breaks_at_rest(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary

    call stretched_bar(3.0_wp, scene)
    scene%boundaries(2)%displacement(1) = 0.7e-2_wp*20*spacing
    call relax(scene, set_up, diary, error)
    if (allocated(error)) return
    call expect_true(error, set_up%system%broken == 0_i8, 'bonds broke on the way to rest')
    call expect(error, maxval(set_up%system%state%damage), 0.0_wp, 0.0_wp, 'damage')
    scene%boundaries(2)%displacement(1) = 1.4e-2_wp*20*spacing
    call relax(scene, set_up, diary, error)
    if (allocated(error)) return
    call expect_true(error, set_up%system%broken > 0_i8, &
      & 'no bond broke beyond the critical stretch')
  end subroutine test_breaks_at_rest

  !> A bar between layers, in one load step, s_c = 0.01. Its ends are softer and stretch more: they
  !> are held from breaking.
  subroutine stretched_bar(zone, scene)
    real(wp), intent(in) :: zone   !! width of the no-fail zone at each end [spacings]
    type(scene_type), intent(out) :: scene

    call box_scene([20], spacing, 0.3_wp, scene)
    call pull(scene)
    deallocate (scene%boundaries, scene%loads, scene%no_fail)
    allocate (scene%boundaries(2), scene%loads(0), scene%no_fail(2))
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%displacement(1) = 0.0_wp
    scene%boundaries(2)%side = 'x_max'
    scene%materials(1)%critical_stretch = 0.01_wp
    scene%relaxation%growth = 'load_steps'
    scene%no_fail%shape = 'box'
    scene%no_fail(1)%upper(1) = zone*spacing
    scene%no_fail(2)%lower(1) = (20 - zone)*spacing
  end subroutine stretched_bar

  !> After breaking it relaxes again until no bond is beyond its limit, in one load step as in five:
  !> here the middle is torn through, the halves are at rest without strain, each with its layer,
  !> and what was stored is dissipated.
  subroutine test_torn(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: jump, wanted
    integer :: i, k, load_steps

    do load_steps = 1, 5, 4
      call stretched_bar(7.0_wp, scene)
      jump = 3.0e-2_wp*20*spacing
      scene%boundaries(2)%displacement(1) = jump
      scene%relaxation%load_steps = load_steps
      call relax(scene, set_up, diary, error)
      if (allocated(error)) return
      call expect_true(error, diary%settled == load_steps, 'load steps')
      associate (system => set_up%system)
        do i = 1, system%body%n_points
          k = system%body%slot(i)
          if (abs(system%body%x(k, 1) - 10*spacing) < 3*spacing) cycle
          wanted = merge(0.0_wp, jump, system%body%x(k, 1) < 10*spacing)
          call expect(error, system%state%u(k, 1), wanted, 1.0e-5_wp*jump, 'the halves')
        end do
        ! what a strain of s_c would store in the bar
        call expect(error, diary%strain(diary%n), 0.0_wp, 1.0e-6_wp*youngs_modulus*0.01_wp**2/2 &
          & *20*spacing*3.0e-4_wp, 'strain energy')
        call expect_true(error, system%broken > 0_i8 .and. system%dissipated > 0.0_wp, &
          & 'nothing broke')
        ! the layers pulled with the force there was before the bonds broke
        call expect_true(error, system%external_work > system%dissipated, &
          & 'no one paid for the cracks')
      end associate
    end do
  end subroutine test_torn

end module test_motion_static_relaxation
