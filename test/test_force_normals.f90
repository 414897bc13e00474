!> Contact along smoothed normals: the normals, forces as gradients of the energy, sliding,
!> rebounds, and what is refused.
module test_force_normals
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i4, i8
  use pd_body_body, only: body_type
  use pd_force_contact, only: contact_type
  use pd_force_normals, only: surface_normals
  use pd_force_term, only: term_view_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_observer, only: instant_type, observer_type
  use pd_motion_system, only: system_type, view_of
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: set_up_type
  use bodies, only: diary_type, expect, expect_true, noise, ready_alone, rotation_matrix
  use comparisons, only: expect_close, max_abs
  use runs, only: run
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use test_scene_expect, only: expect_fault, expect_scene, good_head, line
  implicit none (type, external)
  private
  public :: collect_force_normals

  character(*), parameter :: soft = '&material youngs_modulus = 1e9 density = 1e3 '// &
    & 'poissons_ratio = 0.25 /'//line

  !> Sums up the load on the second boundary, a pin.
  type, extends(observer_type) :: gauge_type
    real(wp) :: pressed = 0.0_wp    !! [N s]
  contains
    procedure :: observe
  end type gauge_type

  !> Compares forces from lists with those of a search that reaches ten times as far.
  type, extends(observer_type) :: judge_type
    integer :: touching = 0         !! steps with forces
    real(wp) :: off = 0.0_wp        !! largest deviation of a force over the largest force
  contains
    procedure :: observe => compare
  end type judge_type

contains

  subroutine observe(observer, system, instant, error)
    class(gauge_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error

    observer%pressed = observer%pressed + instant%dt*system%motions(2)%pose%force(2)
    if (instant%step < 0) allocate (error)
  end subroutine observe

  subroutine compare(observer, system, instant, error)
    class(judge_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error
    type(term_view_type) :: view
    type(contact_type) :: far
    real(wp), allocatable :: force(:, :), known(:, :)
    integer :: t

    allocate (force(system%body%n_slots, 3), known(system%body%n_slots, 3), source=0.0_wp)
    call view_of(system, instant%time, view)
    do t = 1, system%terms%number()
      select type (term => system%terms%items(t)%term)
      type is (contact_type)
        call term%add_force(view, force)
        far = term
        far%reach = 10*term%reach
        far%movement%noted = .false.
        call far%add_force(view, known)
      class default
        continue
      end select
    end do
    if (max_abs(known) > 0.0_wp) observer%touching = observer%touching + 1
    if (.not. max_abs(force - known) <= 1.0e-11_wp*max_abs(known)) observer%off = 1.0_wp
    if (instant%step < 0) allocate (error)
  end subroutine compare

  subroutine collect_force_normals(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('normals of a box and a ball', test_normals), &
      & new_unittest('forces are the gradient of the energy, without a moment', test_gradient), &
      & new_unittest('a block slides over another', test_slide), &
      & new_unittest('discs rebound', test_rebound), &
      & new_unittest('bodies that come fast', test_fast), &
      & new_unittest('the same bits on any number of threads', test_threads), &
      & new_unittest('what is refused', test_refused)]
  end subroutine collect_force_normals

  !> On a face they are exact, of a ball within the roughness of its lattice, within bodies there
  !> are none; they turn with the body.
  subroutine test_normals(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type), target :: set_up
    type(term_view_type) :: view
    real(wp), allocatable :: normals(:, :)
    integer(i4), allocatable :: slots(:)
    real(wp) :: turn(3, 3), place(3), worst
    integer :: i, k, faces, inner, way

    call run('&scene dimension = 3 /'//line//soft// &
      & "&body name = 'box' lower = -6e-3, -6e-3, -6e-3 upper = 6e-3, 6e-3, 6e-3 "// &
      & 'points = 12, 12, 12 /'//line// &
      & "&body name = 'ball' shape = 'sphere' centre = 0, 0, 0.03 "// &
      & 'radius = 8e-3 spacing = 1e-3 /'//line//"&contact between = 'box', 'ball' normals = "// &
      & "'smoothed' /"//line//'&time steps = 1 /', set_up, error)
    if (allocated(error)) return
    associate (body => set_up%system%body)
      slots = body%slot
      turn = rotation_matrix([0.6_wp, 0.0_wp, 0.8_wp], 0.7_wp)
      do way = 1, 2
        call view_of(set_up%system, 0.0_wp, view)
        call surface_normals(view, slots, normals)
        faces = 0
        inner = 0
        worst = 1.0_wp
        do i = 1, size(slots)
          k = slots(i)
          place = body%x(k, :)
          if (way == 2) normals(:, i) = matmul(transpose(turn), normals(:, i))
          if (norm2(normals(:, i)) > 0.0_wp) normals(:, i) = normals(:, i)/norm2(normals(:, i))
          if (body%body(k) == 2) then
            place = place - [0.0_wp, 0.0_wp, 0.03_wp]
            if (norm2(place) > 7.2e-3_wp) worst = min(worst, dot_product(normals(:, i), &
              & place/norm2(place)))
          else if (place(3) > 5.0e-3_wp .and. all(abs(place(:2)) < 3.0e-3_wp)) then
            faces = faces + 1
            call expect_close(error, normals(:, i), [0.0_wp, 0.0_wp, 1.0_wp], 1.0e-12_wp, 'face')
          else if (all(abs(place) < 3.0e-3_wp)) then
            inner = inner + 1
            call expect_close(error, normals(:, i), 0.0_wp, 1.0e-300_wp, 'within')
          end if
          if (allocated(error)) return
        end do
        call expect_true(error, faces == 36 .and. inner == 216, 'points are missing')
        call expect_true(error, worst > cos(0.2_wp), 'normals of the ball are off')
        do i = 1, size(slots)
          set_up%system%state%u(slots(i), :) = matmul(turn, body%x(slots(i), :)) &
            & - body%x(slots(i), :)
        end do
      end do
    end associate
  end subroutine test_normals

  !> Two blocks whose lattices do not fit, pressed together, strained, bent and turned at random:
  !> the force on every point is minus the gradient of the stored energy, by differences of
  !> displacements of points near the surface, which turn the normals as well. Forces and moments of
  !> all points add up to 0, with damping too, and in 2D with friction.
  subroutine test_gradient(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: h = 1.0e-7_wp
    character(*), parameter :: rules(3) = [character(28) :: '', 'restitution = 0.8', &
      & 'friction = 0.3 damping = 0.1']
    type(set_up_type), target :: set_up
    real(wp), allocatable :: force(:, :), shifted(:, :), u(:, :), v(:, :)
    real(wp) :: energies(2), known, largest, density
    integer :: state, dim, way, trial, k, c, e, probed, part

    state = 9
    do dim = 2, 3
      do way = 1, 3
        call run(blocks(dim, trim(rules(way))), set_up, error)
        if (allocated(error)) return
        associate (body => set_up%system%body)
          do trial = 1, 2
            call deform(body, state, u, v)
            ! the couple of friction about the normal is left in 3D
            part = merge(1, 0, dim == 3)
            call act(set_up, u, v, part, force, known)
            largest = max_abs(force)
            call expect_true(error, known > 0.0_wp .and. largest > 0.0_wp, 'they do not touch')
            call expect_balance(error, body, u, force)
            if (allocated(error)) return
            if (way > 1) cycle
            probed = 0
            do k = 1, body%n_slots, merge(11, 3, dim == 3)
              if (body%point(k) == 0) cycle
              if (norm2(force(k, :)) < 1.0e-3_wp*largest) cycle
              probed = probed + 1
              do c = 1, dim
                do e = 1, 2
                  shifted = u
                  shifted(k, c) = u(k, c) + merge(h, -h, e == 1)*body%spacing(k)
                  call act(set_up, shifted, v, part, energy=energies(e))
                end do
                density = -(energies(1) - energies(2))/(2*h*body%spacing(k)*body%volume(k))
                call expect(error, force(k, c), density, 1.0e-5_wp*largest, 'gradient')
                if (allocated(error)) return
              end do
            end do
            call expect_true(error, probed > 10, 'few points have forces')
          end do
        end associate
      end do
    end do
  end subroutine test_gradient

  !> Two blocks in contact.
  function blocks(dim, rule) result(text)
    integer, intent(in) :: dim
    character(*), intent(in) :: rule
    character(:), allocatable :: text

    if (dim == 2) then
      text = '&scene dimension = 2 /'//line//soft// &
        & "&body name = 'a' lower = 0, 0 upper = 0.2, 0.04 points = 20, 4 /"//line// &
        & "&body name = 'b' lower = 0.05, 0.042 upper = 0.149, 0.078 points = 11, 4 /"
    else
      text = '&scene dimension = 3 /'//line//soft// &
        & "&body name = 'a' lower = 0, 0, 0 upper = 0.12, 0.1, 0.04 points = 12, 10, 4 /"//line// &
        & "&body name = 'b' lower = 0.03, 0.03, 0.042 upper = 0.084, 0.084, 0.078 "// &
        & 'points = 6, 6, 4 /'
    end if
    text = text//line//"&contact between = 'a', 'b' stiffness = 2 "//rule//' /'//line// &
      & '&time steps = 1 /'
  end function blocks

  !> The upper block pressed into the lower one, both strained, bent and turned; velocities.
  subroutine deform(body, state, u, v)
    type(body_type), intent(in) :: body
    integer, intent(inout) :: state
    real(wp), allocatable, intent(out) :: u(:, :), v(:, :)
    real(wp) :: gradient(body%dim, body%dim), shift(body%dim), x(body%dim), turn(3, 3)
    integer :: k, c, b

    allocate (u(body%n_slots, body%dim), v(body%n_slots, body%dim), source=0.0_wp)
    do b = 1, 2
      gradient = 0.04_wp*reshape([(noise(state), c=1, body%dim**2)], [body%dim, body%dim])
      shift = 0.004_wp*[(noise(state), c=1, body%dim)]
      if (b == 1) shift = 0.0_wp
      if (b == 2) shift(body%dim) = -4.0e-3_wp
      do k = 1, body%n_slots
        if (body%point(k) == 0 .or. body%body(k) /= b) cycle
        x = body%x(k, :) - 0.04_wp
        u(k, :) = matmul(gradient, x) + shift
        u(k, body%dim) = u(k, body%dim) + 0.5_wp*x(1)**2
        v(k, :) = [(100*noise(state), c=1, body%dim)]
      end do
    end do
    turn = rotation_matrix([0.0_wp, 0.0_wp, 1.0_wp], 0.9_wp)
    if (body%dim == 3) turn = matmul(turn, rotation_matrix([0.6_wp, 0.8_wp, 0.0_wp], 1.3_wp))
    do k = 1, body%n_slots
      if (body%point(k) > 0) u(k, :) = matmul(turn(:body%dim, :body%dim), body%x(k, :) + u(k, :)) &
        & - body%x(k, :)
    end do
  end subroutine deform

  !> Forces of all terms of contact, or of one of them, and the energy, in a state.
  subroutine act(set_up, u, v, part, force, energy)
    type(set_up_type), intent(inout), target :: set_up
    real(wp), intent(in) :: u(:, :), v(:, :)
    integer, intent(in) :: part                    !! 0: all
    real(wp), allocatable, intent(out), optional :: force(:, :)
    real(wp), intent(out) :: energy
    type(term_view_type) :: view
    real(wp), allocatable :: forces(:, :), density(:)
    integer :: k, t

    associate (system => set_up%system, body => set_up%system%body)
      system%state%u = u
      system%state%v = v
      ! an instant that no search knows
      call view_of(system, 1.0_wp, view)
      allocate (forces(body%n_slots, body%dim), density(body%n_slots), source=0.0_wp)
      do t = 1, system%terms%number()
        select type (term => system%terms%items(t)%term)
        type is (contact_type)
          if (part > 0 .and. term%part /= part) cycle
          call term%add_force(view, forces)
          call term%add_energy(view, density)
        class default
          continue
        end select
      end do
      energy = sum([(density(k)*body%volume(k), k=1, body%n_slots)])
    end associate
    if (present(force)) force = forces
  end subroutine act

  !> Forces and moments of all points are 0 but for rounding.
  subroutine expect_balance(error, body, u, force)
    type(error_type), allocatable, intent(inout) :: error
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: u(:, :), force(:, :)
    real(wp), dimension(3) :: f, y, total, moment
    real(wp) :: scale
    integer :: k

    total = 0.0_wp
    moment = 0.0_wp
    scale = 0.0_wp
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      f = 0.0_wp
      y = 0.0_wp
      f(:body%dim) = force(k, :)*body%volume(k)
      y(:body%dim) = body%x(k, :) + u(k, :)
      total = total + f
      moment = moment + [y(2)*f(3) - y(3)*f(2), y(3)*f(1) - y(1)*f(3), y(1)*f(2) - y(2)*f(1)]
      scale = scale + norm2(f)
    end do
    call expect_close(error, total, 0.0_wp, 1.0e-13_wp*scale, 'momentum')
    call expect_close(error, moment, 0.0_wp, 1.0e-13_wp*scale*0.2_wp, 'angular momentum')
  end subroutine expect_balance

  !> A rigid block of points slides over equal ones, pressed to an overlap of 0.05 spacings: its
  !> loss of momentum over the load's is the coefficient of friction, within 1 % for a block of 30 x
  !> 4 points and one of 10 x 2, with damping too. With a damping of 0.2 the bumps of lines of
  !> centres add more than 0.1 to it.
  subroutine test_slide(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: along
    integer :: i

    do i = 1, 2
      call slide(i == 2, 'smoothed', '0.3', '0', along)
      call expect(error, along, 0.3_wp, 0.003_wp, 'friction')
      call slide(i == 2, 'smoothed', '0.3', '0.2', along)
      call expect(error, along, 0.3_wp, 0.003_wp, 'friction with damping')
      call slide(i == 2, 'smoothed', '0', '0.2', along)
      call expect(error, along, 0.0_wp, 0.003_wp, 'damping')
    end do
    call slide(.false., 'centres', '0', '0.2', along)
    call expect_true(error, along > 0.1_wp, 'lines of centres')

  contains

    subroutine slide(small, normals, friction, damping, coefficient)
      logical, intent(in) :: small
      character(*), intent(in) :: normals, friction, damping
      real(wp), intent(out) :: coefficient
      type(set_up_type) :: set_up
      type(scene_type) :: scene
      type(gauge_type) :: gauge
      type(fault_type), allocatable :: fault
      character(:), allocatable :: size_of_block

      coefficient = huge(coefficient)
      if (allocated(error)) return
      size_of_block = 'upper = 0.4, 0.06909 points = 30, 4'
      if (small) size_of_block = 'upper = 0.2, 0.04909 points = 10, 2'
      call expect_scene(error, '&scene dimension = 2 /'//line//soft// &
        & "&body name = 'base' lower = 0, -0.01 upper = 0.6, 0.03 points = 60, 4 /"//line// &
        & "&body name = 'block' lower = 0.1, 0.02909 "//size_of_block//' /'//line// &
        & "&region name = 'low' where = 'y < 0.0295' /"//line// &
        & "&region name = 'high' where = 'y > 0.0295' /"//line// &
        & "&boundary region = 'low' displacement_x = 0 displacement_y = 0 /"//line// &
        & "&boundary region = 'high' motion = 'pin' displacement_y = '-5.9e-4*min(1, t/2e-5)' /"// &
        & line//"&initial region = 'high' velocity_x = 20 /"//line// &
        & "&contact between = 'base', 'block' normals = '"//normals//"' stiffness = 0.03 "// &
        & 'friction = '//friction//' damping = '//damping//' /'//line// &
        & '&time duration = 4e-3 /', scene)
      if (.not. allocated(error)) call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      call run_explicit(set_up%system, 'forward_backward', set_up%plan%step, set_up%plan%steps, &
        & gauge, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      if (allocated(error)) return
      coefficient = 1.0e3_wp*merge(2.0e-3_wp, 1.2e-2_wp, small) &
        & *(20 - set_up%system%motions(2)%pose%velocity(1))/gauge%pressed
    end subroutine slide
  end subroutine test_slide

  !> Two discs of unlike lattices that hit each other beside their centres and spin thereafter:
  !> energy is conserved within what the step makes of it, momentum and angular momentum to
  !> rounding.
  subroutine test_rebound(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: start(3), momentum(2), spin, speed(2)
    integer :: k

    call run('&scene dimension = 2 /'//line//soft// &
      & "&body name = 'a' shape = 'sphere' centre = 0, 0 radius = 0.1 spacing = 0.01 /"//line// &
      & "&body name = 'b' shape = 'sphere' centre = 0.05, 0.2 radius = 0.1 spacing = 0.0093 /"// &
      & line//"&region name = 'b' where = '(x - 0.05)^2 + (y - 0.2)^2 < 0.0101' /"//line// &
      & "&initial region = 'b' velocity_y = -20 velocity_x = 3 /"//line// &
      & "&contact between = 'a', 'b' stiffness = 3 /"//line// &
      & '&time duration = 3e-3 /', set_up, error, diary)
    if (allocated(error)) return
    associate (n => diary%n, energy => diary%kinetic(1))
      call expect(error, diary%kinetic(n) + diary%strain(n), energy, 1.0e-4_wp*energy, 'energy')
      call expect_close(error, diary%dissipated, 0.0_wp, 0.0_wp, 'dissipated energy')
      call expect_true(error, minval(diary%kinetic) < 0.9_wp*energy, 'they hardly touch')
    end associate
    start = 0.0_wp
    associate (body => set_up%system%body, state => set_up%system%state)
      do k = 1, body%n_slots
        if (body%point(k) == 0 .or. body%body(k) /= 2) cycle
        start = start + 1.0e3_wp*body%volume(k) &
          & *[3.0_wp, -20.0_wp, -20*body%x(k, 1) - 3*body%x(k, 2)]
      end do
      momentum = 0.0_wp
      spin = 0.0_wp
      do k = 1, body%n_slots
        if (body%point(k) == 0) cycle
        speed = state%v(k, :)
        momentum = momentum + 1.0e3_wp*body%volume(k)*speed
        spin = spin + 1.0e3_wp*body%volume(k)*((body%x(k, 1) + state%u(k, 1))*speed(2) &
          & - (body%x(k, 2) + state%u(k, 2))*speed(1))
      end do
    end associate
    call expect_close(error, momentum, start(:2), 1.0e-12_wp*norm2(start(:2)), 'momentum')
    call expect(error, spin, start(3), 1.0e-12_wp*norm2(start(:2))*0.3_wp, 'angular momentum')
  end subroutine test_rebound

  !> A small body flies into a block at 50 and 800 m/s: no pair is missed from step to step. Where
  !> the block is brittle, normals know the bonds that have broken since pairs were searched.
  subroutine test_fast(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: speeds(3) = [character(3) :: '50', '800', '200']
    character(*), parameter :: steps(3) = [character(3) :: '150', '60', '100']
    character(*), parameter :: limits(3) = [character(24) :: '', '', 'critical_stretch = 0.01']
    type(set_up_type) :: set_up
    type(scene_type) :: scene
    type(judge_type) :: judge
    type(fault_type), allocatable :: fault
    integer :: i

    do i = 1, 3
      call expect_scene(error, '&scene dimension = 3 /'//line//'&material youngs_modulus = 1e9 '// &
        & 'density = 1e3 poissons_ratio = 0.25 '//trim(limits(i))//' /'//line// &
        & "&body name = 'block' lower = -4e-3, -4e-3, -3e-3 upper = 4e-3, 4e-3, 0 "// &
        & 'points = 8, 8, 3 /'//line//"&body name = 'shot' lower = -1e-3, -1e-3, 1e-3 "// &
        & 'upper = 1e-3, 1e-3, 3e-3 points = 2, 2, 2 /'//line// &
        & "&region name = 'shot' where = 'z > 0.5e-3' /"//line// &
        & "&initial region = 'shot' velocity_z = -"//trim(speeds(i))//' velocity_x = 30 /'//line// &
        & "&contact between = 'block', 'shot' normals = 'smoothed' friction = 0.2 /"//line// &
        & '&time steps = '//trim(steps(i))//' /', scene)
      if (.not. allocated(error)) call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      judge = judge_type()
      call run_explicit(set_up%system, 'forward_backward', set_up%plan%step, set_up%plan%steps, &
        & judge, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      call expect_true(error, judge%touching > 3, 'they hardly touch')
      call expect(error, judge%off, 0.0_wp, 0.0_wp, 'forces')
      if (i == 3) call expect_true(error, set_up%system%broken > 20_i8, 'few bonds break')
      if (allocated(error)) return
    end do
  end subroutine test_fast

  !> An impact with friction on one and two threads.
  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: text = '&scene dimension = 3 /'//line//soft// &
      & "&body name = 'a' lower = 0, 0, 0 upper = 0.12, 0.12, 0.03 points = 12, 12, 3 /"//line// &
      & "&body name = 'b' lower = 0.03, 0.03, 0.03 upper = 0.09, 0.09, 0.09 points = 6, 6, 6 /"// &
      & line//"&region name = 'b' where = 'z > 0.03' /"//line// &
      & "&initial region = 'b' velocity_x = 5 velocity_z = -8 /"//line// &
      & "&contact between = 'a', 'b' normals = 'smoothed' friction = 0.4 restitution = 0.9 "// &
      & 'stiffness = 5 /'//line//'&time steps = 100 /'
    type(set_up_type) :: one, two

    call run(text, one, error, threads=1)
    call run(text, two, error, threads=2)
    if (allocated(error)) return
    call expect_close(error, one%system%state%v, two%system%state%v, 0.0_wp, 'velocities')
    call expect_true(error, max_abs(one%system%state%force) > 0.0_wp, 'they have not touched')
  end subroutine test_threads

  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault(error, good_head//"&contact within = 'plate' normals = 'round' /"//line// &
      & '&time steps = 3 /', 'round|smoothed')
  end subroutine test_refused

end module test_force_normals
