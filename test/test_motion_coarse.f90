!> The coarse part of the preconditioner of conjugate gradients: its functions, its factor, and what
!> it does to the number of iterations.
module test_motion_coarse
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i4, i8
  use pd_motion_coarse, only: add_slow, coarse_type, factorise, restrict_to, solve_for
  use pd_motion_static_coarsen, only: make_coarse
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: set_up_type
  use bodies, only: diary_type, expect, expect_true, noise, ready_alone
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use test_scene_expect, only: expect_scene, line
  implicit none (type, external)
  private
  public :: collect_motion_coarse

  !> What all scenes begin with.
  character(*), parameter :: head = '&scene dimension = 2 /'//line// &
    & "&material name = 'steel' youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.25 /"// &
    & line// &
    & "&time method = 'relaxation' /"//line//'&relaxation tolerance = 1e-8 /'//line
  character(*), parameter :: cantilever = &
    & "&boundary side = 'x_min' displacement_x = 0 displacement_y = 0 /"//line// &
    & "&load side = 'x_max' force_y = 1e3 /"//line

contains

  subroutine collect_motion_coarse(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('functions give linear fields', test_linear), &
      & new_unittest('restriction is the transpose', test_transpose), &
      & new_unittest('the sides of a crack move apart', test_crack), &
      & new_unittest('nothing moves what is held', test_held), &
      & new_unittest('solutions of small equations', test_factor), &
      & new_unittest('iterations do not grow with the body', test_iterations), &
      & new_unittest('the answer is that of dynamic relaxation', test_solvers)]
  end subroutine collect_motion_coarse

  !> A plate of so many points, with edges of 1 m and more groups in `text`.
  subroutine make(points, text, set_up, error)
    character(*), intent(in) :: points
    character(*), intent(in) :: text
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(out) :: error

    call make_of(head//"&body name = 'plate' lower = 0, 0 upper = 1, 1 points = "//points//' /'// &
      & line//text, set_up, error)
  end subroutine make

  !> The system of a scene.
  subroutine make_of(text, set_up, error)
    character(*), intent(in) :: text
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call expect_scene(error, text, scene)
    call ready_alone(scene, set_up, error)
  end subroutine make_of

  !> 1 for every component of a field: nothing is held.
  pure function everywhere(field) result(one)
    real(wp), intent(in) :: field(:, :)
    real(wp) :: one(size(field, 1), size(field, 2))
    one = 1.0_wp
  end function everywhere

  !> Hat functions sum to every linear field, to rounding: each function is given the field's value
  !> at its node.
  subroutine test_linear(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(coarse_type) :: coarse
    real(wp), allocatable :: field(:, :), nodes(:), weight(:), where_node(:, :)
    real(wp) :: at(2)
    real(wp) :: largest
    integer :: e, a, i, k, c, n

    call make('40, 40', '', set_up, error)
    if (allocated(error)) return
    call make_coarse(set_up%system, coarse)
    associate (body => set_up%system%body)
      ! a cell's corners follow from two of its points with different places
      allocate (where_node(2, coarse%n), nodes(coarse%n), weight(coarse%n), source=0.0_wp)
      do e = 1, size(coarse%start) - 1
        i = coarse%start(e)
        n = coarse%start(e + 1) - 1
        do c = 1, 2
          at = coarse%place(c, [i, n])
          associate (x => body%x(coarse%slots([i, n]), c))
            at(2) = (x(2) - x(1))/(at(2) - at(1))
            at(1) = x(1) - coarse%place(c, i)*at(2)
          end associate
          do a = 1, 4
            do k = 1, 2
              where_node(c, coarse%unknown(k, a, e)) = at(1) &
                & + merge(at(2), 0.0_wp, btest(a - 1, c - 1))
            end do
          end do
        end do
      end do
      do e = 1, size(coarse%start) - 1
        do a = 1, 4
          do c = 1, 2
            k = coarse%unknown(c, a, e)
            nodes(k) = c + 0.3_wp*where_node(1, k) - c*0.7_wp*where_node(2, k)
          end do
        end do
      end do
      allocate (field(body%n_slots, 2), source=0.0_wp)
      call add_slow(coarse, nodes, 1.0_wp, everywhere(field), field, largest)
      do c = 1, 2
        call expect_close(error, pack(field(:, c), body%point > 0), pack(c &
          & + 0.3_wp*body%x(:, 1) - c*0.7_wp*body%x(:, 2), body%point > 0), 1.0e-13_wp, &
          & 'linear field')
      end do
    end associate
  end subroutine test_linear

  !> The sum over unknowns of amounts and restricted field is that over points of volume, field and
  !> the combination, for random numbers.
  subroutine test_transpose(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(coarse_type) :: coarse
    real(wp), allocatable :: field(:, :), combination(:, :), amounts(:), forces(:)
    real(wp) :: largest
    integer :: i, state

    call make('45, 45', '&crack from = 0.2, 0.5 to = 0.8, 0.45 /'//line//cantilever, set_up, error)
    if (allocated(error)) return
    associate (body => set_up%system%body)
      call make_coarse(set_up%system, coarse)
      call expect_true(error, coarse%n > 100, 'there are functions')
      allocate (field(body%n_slots, 2), combination(body%n_slots, 2), source=0.0_wp)
      allocate (amounts(coarse%n), forces(coarse%n))
      state = 1
      do i = 1, body%n_slots
        if (body%point(i) > 0) field(i, :) = [noise(state), noise(state)]
      end do
      do i = 1, coarse%n
        amounts(i) = noise(state)
      end do
      call restrict_to(coarse, body%volume, field, forces)
      call add_slow(coarse, amounts, 1.0_wp, everywhere(field), combination, largest)
      call expect(error, dot_product(amounts, forces), sum(field*combination &
        & *spread(body%volume, 2, 2)), 1.0e-13_wp*sum(body%volume), 'inner products')
    end associate
  end subroutine test_transpose

  !> A crack through the whole plate: as many more functions as nodes whose cells it crosses, and
  !> the halves have no function in common. A shorter one: all points have common ones by chains.
  subroutine test_crack(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(coarse_type) :: coarse
    integer :: e, a, above, below
    logical, allocatable :: upper(:), lower(:)

    call make('40, 40', '&crack from = -0.1, 0.51 to = 1.1, 0.51 /'//line, set_up, error)
    if (allocated(error)) return
    call make_coarse(set_up%system, coarse)
    allocate (upper(coarse%n), lower(coarse%n), source=.false.)
    do e = 1, size(coarse%start) - 1
      associate (y => set_up%system%body%x(coarse%slots(coarse%start(e)), 2))
        do a = 1, 4
          if (y > 0.51_wp) then
            upper(coarse%unknown(:, a, e)) = .true.
          else
            lower(coarse%unknown(:, a, e)) = .true.
          end if
        end do
      end associate
    end do
    above = count(upper)
    below = count(lower)
    call expect_true(error, .not. any(upper .and. lower), 'the halves share no function')
    call expect_true(error, above + below == coarse%n .and. above > 0 .and. below > 0, &
      & 'all functions belong to a half')
  end subroutine test_crack

  !> No function moves a component that a boundary holds.
  subroutine test_held(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(coarse_type) :: coarse
    real(wp), allocatable :: field(:, :)
    real(wp) :: largest
    integer :: i

    call make('40, 40', "&boundary side = 'x_min' displacement_x = 0 /"//line// &
      & "&boundary side = 'y_min' displacement_y = 0 /"//line, set_up, error)
    if (allocated(error)) return
    call make_coarse(set_up%system, coarse)
    associate (body => set_up%system%body)
      allocate (field(body%n_slots, 2), source=0.0_wp)
      call add_slow(coarse, [(1 + mod(i, 7)/7.0_wp, i=1, coarse%n)], 1.0_wp, everywhere(field), &
        & field, largest)
      call expect(error, largest, max_abs(field), 0.0_wp, 'largest component')
      call expect_close(error, pack(field, set_up%system%held == 1), 0.0_wp, 0.0_wp, &
        & 'held components')
      call expect_true(error, any(abs(pack(field(:, 1), set_up%system%held(:, 2) == 1)) &
        & > 0.1_wp), 'the others move')
    end associate
  end subroutine test_held

  !> A tridiagonal matrix (2, -1), whose solution is a parabola; and one of two springs in a row
  !> that nothing holds, whose last unknown meets no stiffness and stays 0.
  subroutine test_factor(error)
    type(error_type), allocatable, intent(out) :: error
    type(coarse_type) :: coarse
    integer, parameter :: n = 20
    real(wp) :: amounts(n)
    integer :: i

    coarse%n = n
    coarse%first = [(int(max(1, i - 1), i4), i=1, n)]
    coarse%before = [(int(i - 1, i8), i=1, n)]
    allocate (coarse%entry(2*n - 1))
    do i = 1, n
      coarse%entry(coarse%before(i) + i) = 2.0_wp
      if (i > 1) coarse%entry(coarse%before(i) + i - 1) = -1.0_wp
    end do
    call factorise(coarse)
    call solve_for(coarse, [(1.0_wp, i=1, n)], amounts)
    call expect_close(error, amounts, [(i*(n + 1 - i)/2.0_wp, i=1, n)], 1.0e-12_wp, 'parabola')
    coarse = coarse_type()
    coarse%n = 3
    coarse%first = [1_i4, 1_i4, 2_i4]
    coarse%before = [0_i8, 1_i8, 2_i8]
    coarse%entry = [1.0_wp, -1.0_wp, 2.0_wp, -1.0_wp, 1.0_wp]
    call factorise(coarse)
    call solve_for(coarse, [1.0_wp, 0.0_wp, -1.0_wp], amounts(:3))
    call expect_close(error, amounts(:3), [2.0_wp, 1.0_wp, 0.0_wp], 1.0e-14_wp, 'free springs')
  end subroutine test_factor

  !> A square cantilever of 2, 4 and 9 thousand points: a diagonal preconditioner alone needs 2.1
  !> times as many iterations for the last as for the first, in proportion to the length of an edge.
  subroutine test_iterations(error)
    type(error_type), allocatable, intent(out) :: error
    type(fault_type), allocatable :: fault
    type(set_up_type), allocatable :: set_up
    type(diary_type) :: diary
    integer :: iterations(3), i
    character(3), parameter :: points(3) = [character(3) :: '45', '64', '95']

    do i = 1, 3
      allocate (set_up)
      call make(points(i)//', '//points(i), cantilever, set_up, error)
      if (allocated(error)) return
      diary = diary_type()
      call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      if (allocated(error)) return
      iterations(i) = diary%n
      deallocate (set_up)
    end do
    call expect_true(error, 3*maxval(iterations) <= 5*minval(iterations), 'iterations')
  end subroutine test_iterations

  !> The displacements are those of dynamic relaxation, which has no such preconditioner: a plate of
  !> two materials with a slit, on a pin and on springs. Both are solved until their error energy is
  !> 1e-3 of the strain energy at most, which bounds the difference of the work.
  subroutine test_solvers(error)
    type(error_type), allocatable, intent(out) :: error
    type(fault_type), allocatable :: fault
    type(set_up_type), allocatable :: set_up
    type(diary_type) :: diary
    real(wp), allocatable :: u(:, :, :)
    real(wp) :: work(2)
    character(18), parameter :: solvers(2) = [character(18) :: 'conjugate_gradient', &
      & 'dynamic_relaxation']
    integer :: i

    do i = 1, 2
      allocate (set_up)
      call make_of(head//'&crack from = 0.3, 0.6 to = 1.1, 0.6 /'//line// &
        & "&body name = 'a' lower = 0, 0 upper = 1, 0.5 points = 40, 20 material = 'soft' /"// &
        & line// &
        & "&body name = 'b' lower = 0, 0.5 upper = 1, 1 points = 40, 20 material = 'steel' /"// &
        & line// &
        & "&region name = 'hole' shape = 'sphere' centre = 0.8, 0.75 radius = 0.06 /"//line// &
        & "&region name = 'left' shape = 'box' upper(1) = 0.1 /"//line// &
        & "&material name = 'soft' youngs_modulus = 2e10 density = 8e3 poissons_ratio = 0.25 /" &
        & //line//"&boundary region = 'hole' motion = 'pin' displacement_y = 1e-3 /"//line// &
        & "&load region = 'left' stiffness = 1e9, 1e9 /"//line, set_up, error)
      if (allocated(error)) return
      diary%every = 0
      if (i == 2) set_up%plan%relaxation%conjugate_gradient = .false.
      call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
      if (allocated(fault)) call test_failed(error, solvers(i)//': '//fault%message)
      if (allocated(error)) return
      if (.not. allocated(u)) allocate (u(size(set_up%system%state%u, 1), 2, 2))
      u(:, :, i) = set_up%system%state%u
      work(i) = set_up%system%external_work
      deallocate (set_up)
    end do
    call expect(error, work(1), work(2), 2.0e-6_wp*work(2), 'work')
    call expect_close(error, u(:, :, 1), u(:, :, 2), 1.0e-3_wp*1.0e-3_wp, 'displacements')
  end subroutine test_solvers

end module test_motion_coarse
