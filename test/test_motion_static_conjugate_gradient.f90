!> Rest by conjugate gradients: against linear equations written from the bonds, a uniform field
!> that is exact at any strain, dynamic relaxation, and what it owes the user when there is no rest.
module test_motion_static_conjugate_gradient
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_error, only: fault_type => error_type, status_input, status_no_answer
  use pd_set_up_prepare, only: set_up_type
  use pd_family_family, only: bonds_type, allocate_bonds
  use pd_motion_observer, only: observer_type, instant_type
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_motion_system, only: system_type, add_loads
  use pd_scene_content_types, only: scene_type
  use elimination, only: eliminate
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, unittest_type, test_failed
  use bodies, only: at_point, box_scene, expect, expect_true, noise, ready, youngs_modulus
  implicit none (type, external)
  private
  public :: collect_motion_static_conjugate_gradient

  real(wp), parameter :: spacing = 1.0e-2_wp

  !> Counts what a relaxation shows.
  type, extends(observer_type) :: witness_type
    integer :: seen = 0             !! calls
    integer :: settled = 0          !! load steps that converged
    integer :: gave_way = 0         !! calls after the conjugate gradient gave way
    integer :: iterations = 0
    integer :: first = 0            !! iterations of the first load step
    logical :: falls = .true.       !! the residual shown is finite and above 0 on the way
  contains
    procedure :: observe
  end type witness_type

contains

  subroutine collect_motion_static_conjugate_gradient(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('the result is that of the linear equations', test_linear), &
      & new_unittest('a uniform field at any strain', test_uniform), &
      & new_unittest('the same equilibrium as dynamic relaxation', test_same_rest), &
      & new_unittest('bonds break as in dynamic relaxation', test_breaking), &
      & new_unittest('a bar broken in two reaches equilibrium again', test_torn), &
      & new_unittest('a body without support aligns with its loads', test_unsupported), &
      & new_unittest('the last increment is used in the next load step', test_trend), &
      & new_unittest('a state that has not converged is an error', test_unconverged), &
      & new_unittest('loads beyond the strength end with a message', test_no_rest), &
      & new_unittest('a solved problem needs no iteration', test_nothing), &
      & new_unittest('the same bits on one and two threads', test_threads)]
  end subroutine collect_motion_static_conjugate_gradient

  !> Held at x_min by a layer, pulled at x_max.
  subroutine pulled(points, poissons_ratio, pressure, scene)
    integer, intent(in) :: points(:)
    real(wp), intent(in) :: poissons_ratio, pressure
    type(scene_type), intent(out) :: scene

    call box_scene(points, spacing, poissons_ratio, scene)
    deallocate (scene%boundaries, scene%loads)
    allocate (scene%boundaries(1), scene%loads(1))
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%displacement(:size(points)) = 0.0_wp
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%pressure = pressure
    scene%time%method = 'relaxation'
    scene%relaxation%solver = 'conjugate_gradient'
    scene%relaxation%tolerance = 1.0e-9_wp
  end subroutine pulled

  !> Relax a scene; `fault` is what the relaxation says, for those who expect something. These
  !> bodies are small enough for one thread, as a run would find, unless `threads` says otherwise.
  subroutine relax(scene, set_up, witness, error, fault, threads)
    type(scene_type), intent(in) :: scene
    type(set_up_type), intent(inout) :: set_up
    type(witness_type), intent(out) :: witness
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable, intent(out), optional :: fault
    integer, intent(in), optional :: threads
    type(fault_type), allocatable :: found
    integer :: before

    call ready(scene, set_up, error)
    if (allocated(error)) return
    before = omp_get_max_threads()
    call omp_set_num_threads(1)
    if (present(threads)) call omp_set_num_threads(threads)
    call run_relaxation(set_up%system, set_up%plan%relaxation, witness, found)
    call omp_set_num_threads(before)
    if (present(fault)) then
      call move_alloc(found, fault)
    else if (allocated(found)) then
      call test_failed(error, found%message)
    end if
  end subroutine relax

  subroutine observe(observer, system, instant, error)
    class(witness_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error

    if (allocated(error)) return
    if (instant%rescued) return
    observer%seen = observer%seen + 1
    observer%iterations = instant%step
    if (instant%gave_way) observer%gave_way = observer%gave_way + 1
    if (instant%settled .and. instant%load_step > 0) observer%settled = observer%settled + 1
    if (instant%settled .and. instant%load_step == 1) observer%first = instant%step
    if (.not. (instant%residual >= 0.0_wp .and. instant%residual < huge(1.0_wp) .and. &
      & all(abs(system%state%v) <= 0.0_wp))) observer%falls = .false.
  end subroutine observe

  !> Minus the force density under small displacements `w`, as theory 2 and 4 have it, with
  !> s = n.(w_j - w_k)/|xi| in place of the stretch.
  subroutine linear_force(system, w, force)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: w(:, :)
    real(wp), intent(out) :: force(:, :)
    type(bonds_type) :: bonds
    real(wp) :: p(size(w, 1)), n(size(w, 2)), s
    integer :: k, i, j, pass

    call allocate_bonds(system%family, bonds)
    p = 0.0_wp
    force = 0.0_wp
    do pass = 1, 2
      do k = 1, size(w, 1)
        if (system%body%point(k) == 0) cycle
        call system%family%bonds_of(k, bonds)
        do i = 1, bonds%n
          if (.not. bonds%intact(i)) cycle
          j = bonds%j(i)
          n = bonds%xi(i, :)/bonds%length(i)
          s = dot_product(n, w(j, :) - w(k, :))/bonds%length(i)
          associate (m => system%model%materials, own => system%model%material(k), &
            & other => system%model%material(j), volume => bonds%weight(i))
            if (pass == 1) then
              p(k) = p(k) + m(own)%p*m(own)%t*factor(system, system%model%D, n, k, j)*s*volume
            else
              force(k, :) = force(k, :) - n*volume*((m(own)%q + m(other)%q)*s &
                & *factor(system, system%model%S, n, k, j) &
                & + (p(k) + p(j))*factor(system, system%model%D, n, k, j)/bonds%length(i))
            end if
          end associate
        end do
      end do
    end do
  end subroutine linear_force

  !> G of theory 4.
  pure real(wp) function factor(system, g, n, k, j)
    type(system_type), intent(in) :: system
    real(wp), allocatable, intent(in) :: g(:, :)
    real(wp), intent(in) :: n(:)
    integer, intent(in) :: k, j
    factor = 1.0_wp
    if (system%model%surface) factor = 1/sqrt(sum((2*n/(g(k, :) + g(j, :)))**2))
  end function factor

  !> Solve the linear equations by elimination. Components across thin bodies have no stiffness and
  !> no load: left out.
  subroutine direct(system, t, u, error)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: t
    real(wp), allocatable, intent(out) :: u(:, :)
    type(error_type), allocatable, intent(inout) :: error
    real(wp), allocatable :: K(:, :), x(:), w(:, :), force(:, :)
    integer, allocatable :: slots(:), components(:)
    integer :: n, c, s, i, j
    logical :: singular

    associate (body => system%body)
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
      allocate (K(n, n), x(n), force(body%n_slots, body%dim))
      allocate (w(body%n_slots, body%dim), source=0.0_wp)
      do j = 1, n
        w(slots(j), components(j)) = 1.0_wp
        call linear_force(system, w, force)
        w(slots(j), components(j)) = 0.0_wp
        do i = 1, n
          K(i, j) = force(slots(i), components(i))
        end do
      end do
      call add_loads(system, t, 1.0_wp, .false., w)
      ! what is imposed pulls, too
      force = 0.0_wp
      where (system%held == 1_i1) force = system%state%u
      u = force
      call linear_force(system, u, force)
      do i = 1, n
        x(i) = w(slots(i), components(i)) - force(slots(i), components(i))
      end do
      call eliminate(K, x, singular)
      if (singular) then
        call test_failed(error, 'the linear equations are singular')
        return
      end if
      do i = 1, n
        u(slots(i), components(i)) = x(i)
      end do
    end associate
  end subroutine direct

  !> Strains of 1e-13, so that nothing is left but the linear equations. Their residual is relaxed
  !> to 1e-12 of the load; the answer's error is that times the condition of these small systems (up
  !> to some 1e3): 1e-8 of the largest displacement. Bodies thick and thin, of one material and two,
  !> as lattice and as list, with a crack, pulled by a load and by an imposed displacement.
  subroutine test_linear(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(witness_type) :: witness
    character(:), allocatable :: name
    real(wp), allocatable :: u(:, :), found(:, :)
    integer :: number

    do number = 1, 18
      select case ((number + 1)/2)
      case (1); name = 'bar'; call pulled([14], 0.3_wp, -1.0e-2_wp, scene)
      case (2); name = 'plate'; call pulled([7, 5], 0.2_wp, -1.0e-2_wp, scene)
      case (3); name = 'bond-based plate'; call pulled([7, 5], 1.0_wp/3, -1.0e-2_wp, scene)
      case (4); name = 'block'; call pulled([5, 4, 3], 0.4_wp, -1.0e-2_wp, scene)
      case (5); name = 'list'; call pulled([7, 5], 0.1_wp, -1.0e-2_wp, scene)
        scene%horizon%family = 'list'
      case (6); name = 'chain in space'; call pulled([10, 1, 1], 0.3_wp, -1.0e-2_wp, scene)
      case (7); name = 'unprojected, nu = 0.49'; call pulled([7, 5], 0.49_wp, -1.0e-2_wp, scene)
        scene%horizon%dilatation = 'unprojected'
      case (8); name = 'two materials, cracked'; call two_materials(scene)
      case default; name = 'pulled by a layer'; call pulled([8, 5], 0.2_wp, 0.0_wp, scene)
        scene%boundaries = [scene%boundaries(1), scene%boundaries(1)]
        scene%boundaries(2)%side = 'x_max'
        scene%boundaries(2)%displacement(1:2) = [1.0e-14_wp, 3.0e-15_wp]
      end select
      if (mod(number, 2) == 0) then
        scene%horizon%surface_correction = 'energy'
        name = name//', corrected'
      end if
      scene%relaxation%tolerance = 1.0e-12_wp
      call relax(scene, set_up, witness, error)
      if (allocated(error)) return
      found = set_up%system%state%u
      call direct(set_up%system, 1.0_wp, u, error)
      if (allocated(error)) return
      call expect_true(error, max_abs(u) > 1.0e-16_wp, 'nothing moved: '//name)
      call expect_close(error, found, u, 1.0e-8_wp*max_abs(u), name)
      call expect_true(error, witness%gave_way == 0 .and. witness%settled == 1 .and. &
        & witness%falls, 'the way to rest: '//name)
    end do
  end subroutine test_linear

  !> Steel and something ten times softer, bonded, and cut from the edge.
  subroutine two_materials(scene)
    type(scene_type), intent(out) :: scene

    call pulled([4, 5], 0.3_wp, -1.0e-2_wp, scene)
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
    deallocate (scene%cracks)
    allocate (scene%cracks(1))
    scene%cracks(1)%from(:2) = [4.5_wp, 0.0_wp]*spacing
    scene%cracks(1)%to(:2) = [4.5_wp, 2.0_wp]*spacing
  end subroutine two_materials

  !> u = H x is at rest at any H inside a body whose points within two horizons of its surface have
  !> it imposed: all families are complete and deformed alike. The points inside start anywhere.
  !> Strains from 1e-14 to 1 and a rotation by 40 degrees. The error is the residual of 1e-10 of the
  !> support's force times the condition (below 100): 1e-8 of the largest displacement.
  subroutine test_uniform(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: sizes(4) = [1.0e-14_wp, 1.0e-4_wp, 0.1_wp, 1.0_wp]
    type(scene_type) :: scene
    real(wp) :: H(2, 2)
    integer :: i, model

    do i = 1, size(sizes)
      do model = 1, 2
        call pulled([20, 20], merge(0.2_wp, 1.0_wp/3, model == 1), 0.0_wp, scene)
        H = sizes(i)*reshape([1.0_wp, 0.1_wp, 0.2_wp, 0.6_wp], [2, 2])
        call one_uniform(scene, H, error)
        if (allocated(error)) return
      end do
    end do
    call pulled([20, 20], 0.2_wp, 0.0_wp, scene)
    H = reshape([cos(0.7_wp) - 1, sin(0.7_wp), -sin(0.7_wp), cos(0.7_wp) - 1], [2, 2])
    call one_uniform(scene, H, error)
  end subroutine test_uniform

  subroutine one_uniform(scene, H, error)
    type(scene_type), intent(inout) :: scene
    real(wp), intent(in) :: H(2, 2)
    type(error_type), allocatable, intent(inout) :: error
    type(set_up_type) :: set_up
    type(witness_type) :: witness
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: wanted(:, :)
    integer :: k, state

    deallocate (scene%boundaries, scene%loads, scene%regions, scene%initial)
    allocate (scene%boundaries(4), scene%loads(0), scene%regions(4), scene%initial(1))
    scene%initial(1)%displacement_gradient(:2, :2) = H
    scene%regions%shape = 'box'
    do k = 1, 4
      scene%regions(k)%name = 'edge '//achar(iachar('0') + k)
      scene%boundaries(k)%region = scene%regions(k)%name
      scene%boundaries(k)%velocity(:2) = 0.0_wp
    end do
    scene%regions(1)%upper(1) = 6*spacing
    scene%regions(2)%lower(1) = 14*spacing
    scene%regions(3)%upper(2) = 6*spacing
    scene%regions(4)%lower(2) = 14*spacing
    scene%relaxation%tolerance = 1.0e-10_wp
    call ready(scene, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      wanted = system%state%u
      state = 4711
      do k = 1, system%body%n_slots
        if (system%held(k, 1) == 0_i1 .and. system%body%point(k) > 0) &
          & system%state%u(k, :) = wanted(k, :) + 0.2_wp*spacing*max_abs(H) &
          & *[noise(state), noise(state)]
      end do
      call run_relaxation(system, set_up%plan%relaxation, witness, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      call expect_close(error, system%state%u, wanted, &
        & 1.0e-8_wp*max_abs(wanted), 'a uniform field')
      call expect_true(error, witness%gave_way == 0, 'the conjugate gradient gave way')
    end associate
  end subroutine one_uniform

  !> Bodies far from linear: bent, heated, stretched by a fifth, pressed, soft on stiff.
  !> Both ways stop at a residual of 1e-9; slender bodies have a condition of some 1e4.
  subroutine test_same_rest(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(witness_type) :: witness
    real(wp), allocatable :: found(:, :)
    character(:), allocatable :: name
    integer :: number

    do number = 1, 6
      call pulled([12, 6], 0.2_wp, -2.0e9_wp, scene)
      select case (number)
      case (1)
        name = 'bent'
        call pulled([24, 3], 0.3_wp, 0.0_wp, scene)
        scene%loads(1)%force(2) = 2.0e4_wp
        scene%relaxation%load_steps = 3
      case (2)
        name = 'heated'
        scene%materials(1)%thermal_expansion = 1.0e-5_wp
        deallocate (scene%initial)
        allocate (scene%initial(1))
        scene%initial(1)%temperature_change = 800.0_wp
      case (3)
        name = 'stretched'
        scene%loads(1)%pressure = -4.0e10_wp
      case (4)
        name = 'unprojected'
        scene%horizon%dilatation = 'unprojected'
      case (5)
        name = 'pressed'
        scene%loads(1)%pressure = 4.0e9_wp
        scene%horizon%surface_correction = 'energy'
      case default
        name = 'soft on stiff'
        call two_materials(scene)
        scene%materials(2)%youngs_modulus = 1.0e-4_wp*youngs_modulus
        scene%loads(1)%pressure = -1.0e4_wp
      end select
      call relax(scene, set_up, witness, error)
      if (allocated(error)) return
      call expect_true(error, witness%gave_way == 0, 'gave way: '//name)
      found = set_up%system%state%u
      scene%relaxation%solver = 'dynamic_relaxation'
      call relax(scene, set_up, witness, error)
      if (allocated(error)) return
      call expect_close(error, found, set_up%system%state%u, &
        & 1.0e-5_wp*max_abs(found), name)
    end do
  end subroutine test_same_rest

  !> A plate with a slit, torn in load steps: the same bonds break, whichever way it comes to rest.
  subroutine test_breaking(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(witness_type) :: witness
    real(wp), allocatable :: damage(:)
    integer(i8) :: broken
    real(wp) :: dissipated

    call pulled([16, 16], 1.0_wp/3, 0.0_wp, scene)
    deallocate (scene%boundaries, scene%loads, scene%cracks)
    allocate (scene%boundaries(2), scene%loads(0), scene%cracks(1))
    scene%boundaries(1)%side = 'y_min'
    scene%boundaries(1)%displacement(2) = -1.2e-2_wp*8*spacing
    scene%boundaries(2)%side = 'y_max'
    scene%boundaries(2)%displacement(2) = 1.2e-2_wp*8*spacing
    scene%cracks(1)%from(:2) = [0.0_wp, 8.0_wp]*spacing
    scene%cracks(1)%to(:2) = [6.0_wp, 8.0_wp]*spacing
    scene%materials(1)%critical_stretch = 0.02_wp
    scene%relaxation%load_steps = 4
    scene%relaxation%tolerance = 1.0e-7_wp
    call relax(scene, set_up, witness, error)
    if (allocated(error)) return
    broken = set_up%system%broken
    dissipated = set_up%system%dissipated
    damage = set_up%system%state%damage
    call expect_true(error, broken > 0_i8, 'nothing broke')
    scene%relaxation%solver = 'dynamic_relaxation'
    call relax(scene, set_up, witness, error)
    if (allocated(error)) return
    call expect_true(error, set_up%system%broken == broken, 'number of broken bonds')
    call expect_close(error, set_up%system%state%damage, damage, 0.0_wp, 'damage')
    call expect(error, set_up%system%dissipated, dissipated, 1.0e-4_wp*dissipated, 'dissipated')
  end subroutine test_breaking

  !> Torn through, the halves rest without strain, each with its layer, though nothing holds them
  !> but one end: in one load step as in five.
  subroutine test_torn(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(witness_type) :: witness
    real(wp) :: jump, wanted
    integer :: i, k, load_steps

    jump = 3.0e-2_wp*20*spacing
    do load_steps = 1, 5, 4
      call pulled([20], 0.3_wp, 0.0_wp, scene)
      deallocate (scene%no_fail, scene%loads)
      allocate (scene%no_fail(2), scene%loads(0))
      scene%boundaries = [scene%boundaries(1), scene%boundaries(1)]
      scene%boundaries(2)%side = 'x_max'
      scene%boundaries(2)%displacement(1) = jump
      scene%materials(1)%critical_stretch = 0.01_wp
      scene%no_fail%shape = 'box'
      scene%no_fail(1)%upper(1) = 7*spacing
      scene%no_fail(2)%lower(1) = 13*spacing
      scene%relaxation%load_steps = load_steps
      scene%relaxation%growth = 'load_steps'
      call relax(scene, set_up, witness, error)
      if (allocated(error)) return
      call expect_true(error, witness%settled == load_steps, 'load steps')
      associate (system => set_up%system)
        call expect_true(error, system%broken > 0_i8, 'nothing broke')
        do i = 1, system%body%n_points
          k = system%body%slot(i)
          if (abs(system%body%x(k, 1) - 10*spacing) < 3*spacing) cycle
          wanted = merge(0.0_wp, jump, system%body%x(k, 1) < 10*spacing)
          call expect(error, system%state%u(k, 1), wanted, 1.0e-5_wp*jump, 'the halves')
        end do
      end associate
    end do
  end subroutine test_torn

  !> A plate with notches, pulled at both ends and held nowhere: it turns until the loads are in
  !> line, as in dynamic relaxation, and the answer has no mean translation.
  subroutine test_unsupported(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(witness_type) :: witness
    real(wp), allocatable :: found(:, :)
    integer :: c

    call pulled([16, 8], 0.3_wp, 0.0_wp, scene)
    deallocate (scene%boundaries, scene%loads, scene%removed)
    allocate (scene%boundaries(0), scene%loads(2), scene%removed(2))
    scene%removed%shape = 'box'
    scene%removed(1)%lower(:2) = [3.0_wp, 5.0_wp]*spacing
    scene%removed(1)%upper(:2) = [5.0_wp, 9.0_wp]*spacing
    scene%removed(2)%lower(:2) = [10.0_wp, -1.0_wp]*spacing
    scene%removed(2)%upper(:2) = [14.0_wp, 3.0_wp]*spacing
    scene%loads(1)%side = 'x_min'
    scene%loads(2)%side = 'x_max'
    scene%loads%pressure = -1.0e9_wp
    scene%relaxation%tolerance = 1.0e-8_wp
    call relax(scene, set_up, witness, error)
    if (allocated(error)) return
    call expect_true(error, witness%gave_way == 0, 'the conjugate gradient gave way')
    found = set_up%system%state%u
    do c = 1, 2
      call expect(error, sum(found(:, c)), 0.0_wp, 1.0e-10_wp*sum(abs(found(:, c))), 'mean')
    end do
    scene%relaxation%solver = 'dynamic_relaxation'
    call relax(scene, set_up, witness, error)
    if (allocated(error)) return
    ! the turn has the stiffness of the load alone, a thousandth of the body's: 1e-8 over that
    call expect_close(error, found, set_up%system%state%u, &
      & 1.0e-4_wp*max_abs(found), 'the same rest')
  end subroutine test_unsupported

  !> Nine more load steps of a body that is all but linear cost less than the first.
  subroutine test_trend(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(witness_type) :: witness
    integer :: way

    do way = 1, 2
      call pulled([16, 8], 0.3_wp, -1.0e4_wp, scene)
      if (way == 2) then
        deallocate (scene%loads)
        allocate (scene%loads(0))
        scene%boundaries = [scene%boundaries(1), scene%boundaries(1)]
        scene%boundaries(2)%side = 'x_max'
        scene%boundaries(2)%displacement(1) = 1.0e-8_wp
      end if
      scene%relaxation%load_steps = 10
      scene%relaxation%tolerance = 1.0e-6_wp
      call relax(scene, set_up, witness, error)
      if (allocated(error)) return
      call expect_true(error, witness%settled == 10 .and. witness%first > 10, 'load steps')
      call expect_true(error, witness%iterations < 2*witness%first, 'the trend is lost')
    end do
  end subroutine test_trend

  subroutine test_unconverged(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(witness_type) :: witness
    type(fault_type), allocatable :: fault

    call pulled([16, 8], 0.3_wp, -1.0e4_wp, scene)
    scene%relaxation%maximum_iterations = 5
    call relax(scene, set_up, witness, error, fault)
    if (allocated(error)) return
    call expect_true(error, allocated(fault), 'five iterations were enough')
    if (.not. allocated(fault)) return
    call expect_true(error, fault%status == status_no_answer, 'exit status')
    call expect_true(error, index(fault%message, 'not converged: after 5 iterations') == 1, &
      & 'message: '//fault%message)
    ! the start and five iterations, each for the history
    call expect_true(error, witness%seen == 6 .and. witness%settled == 0, 'what was shown')
  end subroutine test_unconverged

  !> A piece that a crack has parted from its support, pulled away: no equilibrium, which is said
  !> before the first iteration. A load beyond anything: none either. Both end in words, and not
  !> with NaN.
  subroutine test_no_rest(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(witness_type) :: witness
    type(fault_type), allocatable :: fault
    integer :: number

    do number = 1, 2
      call pulled([12, 4], 0.3_wp, merge(-1.0e6_wp, -1.0e16_wp, number == 1), scene)
      if (number == 1) then
        deallocate (scene%cracks)
        allocate (scene%cracks(1))
        scene%cracks(1)%from(:2) = [6.0_wp, -1.0_wp]*spacing
        scene%cracks(1)%to(:2) = [6.0_wp, 5.0_wp]*spacing
      end if
      scene%relaxation%maximum_iterations = 300
      call relax(scene, set_up, witness, error, fault)
      if (allocated(error)) return
      call expect_true(error, allocated(fault), 'a rest was found')
      if (.not. allocated(fault)) return
      call expect_true(error, fault%status == merge(status_input, status_no_answer, number == 1), &
        & 'exit status')
      if (number == 1) then
        call expect_true(error, index(fault%message, 'the piece of 24 points') == 1 .and. &
          & index(fault%message, 'is free to move') > 0 .and. witness%seen == 0, 'message: '// &
          & fault%message)
      else
        call expect_true(error, index(fault%message, 'not converged') == 1 .or. &
          & index(fault%message, 'the relaxation diverges') == 1, 'message: '//fault%message)
      end if
      call expect_true(error, witness%falls, 'residuals that are none')
    end do
  end subroutine test_no_rest

  !> A body on which nothing acts is at rest without an iteration.
  subroutine test_nothing(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(witness_type) :: witness

    call pulled([12, 4], 0.3_wp, 0.0_wp, scene)
    call relax(scene, set_up, witness, error)
    if (allocated(error)) return
    call expect_true(error, witness%iterations == 0 .and. witness%settled == 1, 'iterations')
    call expect_close(error, set_up%system%state%u, 0.0_wp, 0.0_wp, 'displacement')
  end subroutine test_nothing

  !> Several blocks of the sums, and strains at which the tangent serves.
  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(witness_type) :: witness
    real(wp), allocatable :: first(:, :)
    integer :: threads, iterations

    call pulled([70, 60], 0.2_wp, 0.0_wp, scene)
    deallocate (scene%loads)
    allocate (scene%loads(0))
    scene%boundaries = [scene%boundaries(1), scene%boundaries(1)]
    scene%boundaries(2)%side = 'x_max'
    scene%boundaries(2)%displacement(1:2) = [4.0e-2_wp, 8.0e-2_wp]*80*spacing
    scene%relaxation%tolerance = 1.0e-4_wp
    do threads = 1, 2
      call relax(scene, set_up, witness, error, threads=threads)
      if (threads == 1 .and. .not. allocated(error)) first = set_up%system%state%u
      if (threads == 1) iterations = witness%iterations
    end do
    if (allocated(error)) return
    call expect_true(error, witness%iterations == iterations .and. iterations > 0, 'iterations')
    call expect_close(error, first, set_up%system%state%u, 0.0_wp, 'bits')
  end subroutine test_threads

end module test_motion_static_conjugate_gradient
