!> Contact along smoothed normals: the normals, forces as gradients of the energy, sliding,
!> rebounds, and what is refused.
module test_force_normals
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i4
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
      & new_unittest('forces are the gradient of the energy', test_gradient), &
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

  !> Two blocks whose lattices do not fit, one shifted at random so that normals stay: the force on
  !> it is the gradient of the stored energy, by differences; forces are opposite to rounding, and
  !> bumps are small: the ends of the blocks make most of what is across.
  subroutine test_gradient(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: h = 1.0e-7_wp
    type(set_up_type), target :: set_up
    real(wp) :: force(3), energies(2), shift(3), other(3), known
    integer :: state, i, c, e, dim

    state = 9
    do dim = 2, 3
      if (dim == 2) call run('&scene dimension = 2 /'//line//soft// &
        & "&body name = 'a' lower = 0, 0 upper = 0.3, 0.04 points = 30, 4 /"//line// &
        & "&body name = 'b' lower = 0.1, 0.042 upper = 0.199, 0.078 points = 11, 4 /"//line// &
        & "&contact between = 'a', 'b' normals = 'smoothed' stiffness = 2 /"//line// &
        & '&time steps = 1 /', set_up, error)
      if (dim == 3) call run('&scene dimension = 3 /'//line//soft// &
        & "&body name = 'a' lower = 0, 0, 0 upper = 0.2, 0.2, 0.04 points = 20, 20, 4 /"//line// &
        & "&body name = 'b' lower = 0.06, 0.06, 0.042 upper = 0.141, 0.141, 0.078 "// &
        & 'points = 9, 9, 4 /'//line// &
        & "&contact between = 'a', 'b' normals = 'smoothed' stiffness = 2 /"//line// &
        & '&time steps = 1 /', set_up, error)
      if (allocated(error)) return
      do i = 1, 6
        shift = 0.0_wp
        shift(:dim - 1) = 0.01_wp*[(noise(state), c=1, dim - 1)]
        shift(dim) = -3.9e-3_wp + 3.0e-4_wp*noise(state)
        call act(shift, force, energies(1), other)
        call expect_close(error, force + other, 0.0_wp, 1.0e-12_wp*norm2(force), 'momentum')
        known = energies(1)
        call expect_true(error, force(dim) > 0.0_wp .and. known > 0.0_wp, 'they do not touch')
        do c = 1, dim
          do e = 1, 2
            other = shift
            other(c) = shift(c) + merge(h, -h, e == 1)
            call act(other, force, energies(e), shift_of_others=other)
          end do
          call act(shift, force, known, other)
          call expect(error, force(c), -(energies(1) - energies(2))/(2*h), 1.0e-5_wp*norm2(force), &
            & 'gradient')
        end do
        call expect_true(error, norm2(force(:dim - 1)) < 0.15_wp*force(dim), 'bumps')
        if (allocated(error)) return
      end do
    end do

  contains

    !> Shift the second body: the force on it, the energy, and the force on the other one.
    subroutine act(shift, force, energy, shift_of_others)
      real(wp), intent(in) :: shift(3)
      real(wp), intent(out) :: force(3), energy
      real(wp), intent(inout) :: shift_of_others(3)
      type(term_view_type) :: view
      real(wp), allocatable :: forces(:, :), density(:)
      integer :: k, t

      associate (system => set_up%system, body => set_up%system%body)
        system%state%u = 0.0_wp
        do k = 1, body%n_slots
          if (body%point(k) > 0 .and. body%body(k) == 2) system%state%u(k, :) = shift(:body%dim)
        end do
        ! an instant that no search knows
        call view_of(system, 1.0_wp, view)
        allocate (forces(body%n_slots, body%dim), density(body%n_slots), source=0.0_wp)
        do t = 1, system%terms%number()
          select type (term => system%terms%items(t)%term)
          type is (contact_type)
            call term%add_force(view, forces)
            call term%add_energy(view, density)
          class default
            continue
          end select
        end do
        force = 0.0_wp
        shift_of_others = 0.0_wp
        energy = 0.0_wp
        do k = 1, body%n_slots
          if (body%point(k) == 0) cycle
          energy = energy + density(k)*body%volume(k)
          if (body%body(k) == 2) force(:body%dim) = force(:body%dim) + forces(k, :)*body%volume(k)
          if (body%body(k) == 1) shift_of_others(:body%dim) = shift_of_others(:body%dim) &
            & + forces(k, :)*body%volume(k)
        end do
      end associate
    end subroutine act
  end subroutine test_gradient

  !> A rigid block of 30 x 4 points slides over equal ones, pressed to an overlap of 0.05 spacings:
  !> its loss of momentum over the load's is the coefficient of friction. With a damping of 0.2 the
  !> bumps of lines of centres add more than 0.1 to it, normals 0.035 as measured, which is what the
  !> ends of the block make.
  subroutine test_slide(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: along

    call slide('smoothed', '0.3', '0', along)
    call expect(error, along, 0.3_wp, 0.02_wp, 'friction')
    call slide('smoothed', '0', '0.2', along)
    call expect_true(error, along > 0.0_wp .and. along < 0.05_wp, 'normals')
    call slide('centres', '0', '0.2', along)
    call expect_true(error, along > 0.1_wp, 'lines of centres')

  contains

    subroutine slide(normals, friction, damping, coefficient)
      character(*), intent(in) :: normals, friction, damping
      real(wp), intent(out) :: coefficient
      type(set_up_type) :: set_up
      type(scene_type) :: scene
      type(gauge_type) :: gauge
      type(fault_type), allocatable :: fault

      coefficient = huge(coefficient)
      if (allocated(error)) return
      call expect_scene(error, '&scene dimension = 2 /'//line//soft// &
        & "&body name = 'base' lower = 0, -0.01 upper = 0.6, 0.03 points = 60, 4 /"//line// &
        & "&body name = 'block' lower = 0.1, 0.02909 upper = 0.4, 0.06909 points = 30, 4 /"// &
        & line// &
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
      coefficient = 1.0e3_wp*0.3_wp*0.04_wp*(20 - set_up%system%motions(2)%pose%velocity(1)) &
        & /gauge%pressed
    end subroutine slide
  end subroutine test_slide

  !> Two discs of unlike lattices that hit each other beside their centres: the account of contact
  !> closes, and what turning normals give or take is below 1 % of the energy.
  subroutine test_rebound(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(diary_type) :: diary

    call run('&scene dimension = 2 /'//line//soft// &
      & "&body name = 'a' shape = 'sphere' centre = 0, 0 radius = 0.1 spacing = 0.01 /"//line// &
      & "&body name = 'b' shape = 'sphere' centre = 0.05, 0.2 radius = 0.1 spacing = 0.0093 /"// &
      & line//"&region name = 'b' where = '(x - 0.05)^2 + (y - 0.2)^2 < 0.0101' /"//line// &
      & "&initial region = 'b' velocity_y = -20 velocity_x = 3 /"//line// &
      & "&contact between = 'a', 'b' normals = 'smoothed' stiffness = 3 /"//line// &
      & '&time duration = 3e-3 /', set_up, error, diary)
    if (allocated(error)) return
    associate (n => diary%n, start => diary%kinetic(1))
      call expect(error, diary%kinetic(n) + diary%strain(n) + diary%dissipated(n), start, &
        & 1.0e-3_wp*start, 'balance')
      call expect_close(error, diary%dissipated, 0.0_wp, 0.01_wp*start, 'energy that normals take')
      call expect_true(error, minval(diary%kinetic) < 0.9_wp*start, 'they hardly touch')
    end associate
  end subroutine test_rebound

  !> A small body flies into a block at 50 and 800 m/s: no pair is missed from step to step.
  subroutine test_fast(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: speeds(2) = [character(3) :: '50', '800']
    type(set_up_type) :: set_up
    type(scene_type) :: scene
    type(judge_type) :: judge
    type(fault_type), allocatable :: fault
    integer :: i

    do i = 1, 2
      call expect_scene(error, '&scene dimension = 3 /'//line//soft// &
        & "&body name = 'block' lower = -4e-3, -4e-3, -3e-3 upper = 4e-3, 4e-3, 0 "// &
        & 'points = 8, 8, 3 /'//line//"&body name = 'shot' lower = -1e-3, -1e-3, 1e-3 "// &
        & 'upper = 1e-3, 1e-3, 3e-3 points = 2, 2, 2 /'//line// &
        & "&region name = 'shot' where = 'z > 0.5e-3' /"//line// &
        & "&initial region = 'shot' velocity_z = -"//trim(speeds(i))//' velocity_x = 30 /'//line// &
        & "&contact between = 'block', 'shot' normals = 'smoothed' friction = 0.2 /"//line// &
        & '&time steps = '//trim(merge('150', '60 ', i == 1))//' /', scene)
      if (.not. allocated(error)) call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      judge = judge_type()
      call run_explicit(set_up%system, 'forward_backward', set_up%plan%step, set_up%plan%steps, &
        & judge, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      call expect_true(error, judge%touching > 3, 'they hardly touch')
      call expect(error, judge%off, 0.0_wp, 0.0_wp, 'forces')
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
    character(*), parameter :: steps = '&time steps = 3 /'

    call expect_fault(error, good_head//"&contact within = 'plate' normals = 'smoothed' /"//line// &
      & steps, 'smoothed|pieces|between')
    call expect_fault(error, good_head//"&contact between = 'all' normals = 'smoothed' /"//line// &
      & steps, 'smoothed|pieces')
    call expect_fault(error, good_head//"&contact within = 'plate' normals = 'round' /"//line// &
      & steps, 'round|smoothed')
    call expect_fault(error, good_head//"&rigid name = 'ball' shape = 'sphere' centre = 0.5, 1 "// &
      & "radius = 0.1 mass = 1 /"//line//"&contact between = 'plate', 'ball' normals = "// &
      & "'smoothed' /"//line//steps, 'smoothed|one body|rigid')
  end subroutine test_refused

end module test_force_normals
