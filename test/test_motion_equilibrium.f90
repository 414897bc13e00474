!> What is accepted as static equilibrium: reactions against loads, whatever way the supports have
!> gone and however stiffness differs; loose pieces; and free bodies as they are found.
module test_motion_equilibrium
  use pd_base_kinds, only: wp, i1
  use pd_base_error, only: fault_type => error_type, status_no_answer
  use pd_base_reduce, only: noise
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_observer, only: observer_type, instant_type
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_motion_static_rigid, only: rigid_type, find_free_motions, turn_back
  use pd_motion_account, only: energies_type, energies_of
  use pd_motion_system, only: system_type
  use pd_scene_content_types, only: scene_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, unittest_type, test_failed
  use bodies, only: at_point, box_scene, expect, expect_true, ready_alone, rotation_matrix
  implicit none (type, external)
  private
  public :: collect_motion_equilibrium

  real(wp), parameter :: spacing = 1.0e-2_wp
  character(*), parameter :: solvers(2) = [character(18) :: 'conjugate_gradient', &
    & 'dynamic_relaxation']

  !> Keeps what a relaxation says and the state that it shows last.
  type, extends(observer_type) :: listener_type
    character(:), allocatable :: notes
    real(wp) :: residual = -1.0_wp     !! of the last settled instant
    real(wp) :: strain = 0.0_wp        !! energy then [J]
    integer :: settled = 0             !! load steps
    integer :: iterations = 0
  contains
    procedure :: observe
  end type listener_type

contains

  subroutine collect_motion_equilibrium(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a load on a support that has moved', test_moved), &
      & new_unittest('a stiff block pressed into a soft pad', test_pad), &
      & new_unittest('supports that rotate a body', test_turned), &
      & new_unittest('a load below rounding error', test_drowned), &
      & new_unittest('supports that strain less than rounding', test_drowned_supports), &
      & new_unittest('a small load on a heated body', test_heated), &
      & new_unittest('a detached piece and isolated points keep their place', test_loose), &
      & new_unittest('a detached piece with its load', test_torn_off), &
      & new_unittest('a detached piece without load', test_goes_on), &
      & new_unittest('a free body is written as it was found', test_curl), &
      & new_unittest('a rigid motion is undone exactly', test_turn_back)]
  end subroutine collect_motion_equilibrium

  subroutine observe(observer, system, instant, error)
    class(listener_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error
    type(energies_type) :: energies

    if (allocated(error)) return
    if (.not. allocated(observer%notes)) observer%notes = ''
    if (allocated(instant%note)) observer%notes = observer%notes//instant%note//'|'
    observer%iterations = instant%step
    if (.not. instant%settled .or. instant%rescued) return
    observer%residual = instant%residual
    if (instant%load_step > 0) observer%settled = observer%settled + 1
    call energies_of(system, system%state%v, energies)
    observer%strain = energies%strain
  end subroutine observe

  !> A strip held by a region of three columns at its left end, loaded at its right end.
  subroutine strip(points, scene)
    integer, intent(in) :: points(2)
    type(scene_type), intent(out) :: scene

    call box_scene(points, spacing, 0.3_wp, scene)
    deallocate (scene%boundaries, scene%regions, scene%loads)
    allocate (scene%boundaries(1), scene%regions(1), scene%loads(1))
    scene%regions(1)%name = 'foot'
    scene%regions(1)%shape = 'box'
    scene%regions(1)%upper(1) = 3*spacing
    scene%boundaries(1)%name = 'foot'
    scene%boundaries(1)%region = 'foot'
    scene%boundaries(1)%displacement(:2) = 0.0_wp
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%force(:2) = [0.0_wp, -1.0_wp]
    scene%time%method = 'relaxation'
    scene%horizon%surface_correction = 'energy'
    scene%horizon%dilatation = 'unprojected'
  end subroutine strip

  !> Relax a scene.
  subroutine relax(scene, set_up, listener, error, fault)
    type(scene_type), intent(in) :: scene
    type(set_up_type), intent(inout) :: set_up
    type(listener_type), intent(out) :: listener
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable, intent(out), optional :: fault
    type(fault_type), allocatable :: found

    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    call run_relaxation(set_up%system, set_up%plan%relaxation, listener, found)
    if (present(fault)) then
      call move_alloc(found, fault)
    else if (allocated(found)) then
      call test_failed(error, found%message)
    end if
  end subroutine relax

  !> A slender strip bears 1 N across its end, whether its foot stays or is moved by 1 mm (2000
  !> times what the load does) or by its length: the reaction is the load (statics), and the end
  !> moves by as much beside the foot. Both to 1e-3, as promised at the default tolerance.
  subroutine test_moved(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: moves(3) = [0.0_wp, 1.0e-3_wp, 24*spacing]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(listener_type) :: listener
    real(wp) :: unmoved
    integer :: s, m, k

    unmoved = 0.0_wp
    do s = 1, size(solvers)
      do m = 1, size(moves)
        call strip([24, 3], scene)
        scene%relaxation%solver = solvers(s)
        scene%boundaries(1)%displacement(:2) = [moves(m), -moves(m)/2]
        if (m == 3) scene%loads(1)%force(2) = -10.0_wp
        call relax(scene, set_up, listener, error)
        if (allocated(error)) return
        associate (system => set_up%system, load => scene%loads(1)%force(2))
          call expect(error, system%motions(1)%reaction(2), -load, 1.0e-3_wp*abs(load), &
            & 'reaction across, '//trim(solvers(s)))
          call expect(error, system%motions(1)%reaction(1), 0.0_wp, 1.0e-3_wp*abs(load), &
            & 'reaction along, '//trim(solvers(s)))
          k = at_point(system%body, [23.5_wp, 0.5_wp]*spacing)
          if (m == 1 .and. s == 1) unmoved = system%state%u(k, 2)
          call expect(error, (system%state%u(k, 2) + moves(m)/2)/abs(load), unmoved, &
            & 1.0e-3_wp*abs(unmoved), 'displacement of the end, '//trim(solvers(s)))
        end associate
      end do
    end do
    call expect_true(error, unmoved < 0.0_wp, 'the end did not move')
  end subroutine test_moved

  !> Steel on a pad 200,000 times softer, pressed by 0.1 mm: what the floor bears is what presses
  !> (equilibrium), at a loose tolerance, too; and both solvers find the same force.
  subroutine test_pad(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(listener_type) :: listener
    real(wp) :: first
    integer :: s

    first = 0.0_wp
    do s = 1, size(solvers)
      call strip([12, 4], scene)
      deallocate (scene%loads, scene%boundaries)
      allocate (scene%loads(0), scene%boundaries(2))
      scene%bodies = [scene%bodies(1), scene%bodies(1)]
      scene%bodies%name = ['pad  ', 'steel']
      scene%bodies%material = ['pad  ', 'steel']
      scene%bodies(2)%lower(2) = 4*spacing
      scene%bodies(2)%upper(2) = 8*spacing
      scene%materials = [scene%materials(1), scene%materials(1)]
      scene%materials(2)%name = 'pad'
      scene%materials(2)%youngs_modulus = 1.0e6_wp
      scene%regions(1)%upper(1) = huge(1.0_wp)
      scene%regions(1)%lower(2) = 7*spacing
      scene%boundaries(1)%side = 'y_min'
      scene%boundaries(1)%displacement(:2) = 0.0_wp
      scene%boundaries(2)%region = 'foot'
      scene%boundaries(2)%displacement(:2) = [0.0_wp, -1.0e-4_wp]
      scene%relaxation%solver = solvers(s)
      scene%relaxation%tolerance = 1.0e-5_wp
      call relax(scene, set_up, listener, error)
      if (allocated(error)) return
      associate (motions => set_up%system%motions)
        call expect_true(error, motions(1)%reaction(2) > 0.0_wp, 'the pad pulls')
        call expect(error, motions(2)%reaction(2), -motions(1)%reaction(2), &
          & 1.0e-3_wp*motions(1)%reaction(2), 'reactions, '//trim(solvers(s)))
        if (s == 1) first = motions(1)%reaction(2)
        call expect(error, motions(1)%reaction(2), first, 1.0e-3_wp*first, 'solvers')
      end associate
    end do
  end subroutine test_pad

  !> Two single points hold a plate and carry it as a quarter turn about its corner would: the plate
  !> goes along as a rigid body, and nothing is strained or left to iterate but rounding.
  subroutine test_turned(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(listener_type) :: listener
    real(wp) :: at(2), to(2)
    integer :: s, i, k

    do s = 1, size(solvers)
      call strip([8, 6], scene)
      deallocate (scene%loads, scene%boundaries, scene%regions)
      allocate (scene%loads(0), scene%boundaries(2), scene%regions(2))
      scene%regions%shape = 'box'
      scene%regions%name = ['first ', 'second']
      scene%boundaries%region = scene%regions%name
      do i = 1, 2
        at = spacing*merge([0.5_wp, 0.5_wp], [6.5_wp, 4.5_wp], i == 1)
        scene%regions(i)%lower(:2) = at - spacing/4
        scene%regions(i)%upper(:2) = at + spacing/4
        scene%boundaries(i)%displacement(:2) = [-at(2), at(1)] - at
      end do
      scene%relaxation%solver = solvers(s)
      call relax(scene, set_up, listener, error)
      if (allocated(error)) return
      associate (system => set_up%system)
        do i = 1, system%body%n_points
          k = system%body%slot(i)
          to = [-system%body%x(k, 2), system%body%x(k, 1)] - system%body%x(k, :)
          call expect_close(error, system%state%u(k, :), to, 1.0e-12_wp*spacing, &
            & 'the plate, '//trim(solvers(s)))
        end do
      end associate
      call expect_true(error, listener%iterations <= 50 .and. listener%settled == 1, &
        & 'iterations '//trim(solvers(s)))
    end do
  end subroutine test_turned

  !> A load of 1e-12 N on a strip of steel that is moved by a metre cannot be told from the rounding
  !> of forces: no answer, in words.
  subroutine test_drowned(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(listener_type) :: listener
    type(fault_type), allocatable :: fault
    integer :: s

    do s = 1, size(solvers)
      call strip([24, 3], scene)
      scene%relaxation%solver = solvers(s)
      scene%boundaries(1)%displacement(1) = 1.0_wp
      scene%loads(1)%force(2) = 1.0e-12_wp
      call relax(scene, set_up, listener, error, fault)
      if (allocated(error)) return
      call expect_true(error, allocated(fault), 'an equilibrium was found')
      if (.not. allocated(fault)) return
      call expect_true(error, fault%status == status_no_answer .and. &
        & index(fault%message, 'rounding') > 0, 'message: '//fault%message)
    end do
  end subroutine test_drowned

  !> Both ends of a strip move by a metre, in the same way: nothing acts. Where one goes 1e-12 m
  !> farther, all that acts vanishes in rounding, and that is said.
  subroutine test_drowned_supports(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(listener_type) :: listener
    type(fault_type), allocatable :: fault
    integer :: s, i

    do s = 1, size(solvers)
      do i = 1, 2
        call strip([12, 3], scene)
        deallocate (scene%loads, scene%regions)
        allocate (scene%loads(0), scene%regions(2))
        scene%regions%name = ['foot', 'head']
        scene%regions%shape = 'box'
        scene%regions(1)%upper(1) = 3*spacing
        scene%regions(2)%lower(1) = 9*spacing
        scene%boundaries = [scene%boundaries, scene%boundaries]
        scene%boundaries(2)%name = 'head'
        scene%boundaries(2)%region = 'head'
        scene%boundaries(1)%displacement(:2) = [1.0_wp, -0.5_wp]
        scene%boundaries(2)%displacement(:2) = [1.0_wp, -0.5_wp]
        if (i == 2) scene%boundaries(2)%displacement(1) = 1.0_wp + 1.0e-12_wp
        scene%relaxation%solver = solvers(s)
        call relax(scene, set_up, listener, error, fault)
        if (allocated(error)) return
        call expect_true(error, allocated(fault) .eqv. i == 2, merge('refused ', 'accepted', &
          & i == 1))
        if (allocated(error)) return
        if (.not. allocated(fault)) cycle
        call expect_true(error, fault%status == status_no_answer .and. &
          & index(fault%message, 'rounding') > 0, 'message: '//fault%message)
      end do
    end do
  end subroutine test_drowned_supports

  !> A strip is heated so that its thermal forces are about a million times the load across its end.
  !> The reaction is the load (statics), to 1e-3.
  subroutine test_heated(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: load = -1.0e-2_wp
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(listener_type) :: listener
    integer :: s, c

    do s = 1, size(solvers)
      call strip([12, 3], scene)
      scene%materials%thermal_expansion = 1.0e-5_wp
      if (allocated(scene%initial)) deallocate (scene%initial)
      allocate (scene%initial(1))
      scene%initial(1)%temperature_change = 100.0_wp
      scene%loads(1)%force(2) = load
      scene%relaxation%solver = solvers(s)
      call relax(scene, set_up, listener, error)
      if (allocated(error)) return
      do c = 1, 2
        call expect(error, set_up%system%motions(1)%reaction(c), merge(0.0_wp, -load, c == 1), &
          & 1.0e-3_wp*abs(load), 'reaction, '//trim(solvers(s)))
      end do
    end do
  end subroutine test_heated

  !> A crack parts the right half, on which nothing acts, and two cracks isolate the last column's
  !> points: they stay where they are, it is said, and the left half bears its load as ever.
  subroutine test_loose(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(listener_type) :: listener
    integer :: s, i, k

    do s = 1, size(solvers)
      call strip([16, 3], scene)
      deallocate (scene%cracks, scene%loads)
      allocate (scene%cracks(4), scene%loads(1))
      do i = 1, 2
        scene%cracks(i)%from(:2) = [merge(8, 15, i == 1), -1]*spacing
        scene%cracks(i)%to(:2) = [merge(8, 15, i == 1), 4]*spacing
        scene%cracks(i + 2)%from(:2) = [15.0_wp, real(i, wp)]*spacing
        scene%cracks(i + 2)%to(:2) = [16.0_wp, real(i, wp)]*spacing
      end do
      deallocate (scene%regions)
      allocate (scene%regions(2))
      scene%regions%name = ['foot', 'load']
      scene%regions%shape = 'box'
      scene%regions(1)%upper(1) = 3*spacing
      scene%regions(2)%lower(1) = 7*spacing
      scene%regions(2)%upper(1) = 8*spacing
      scene%loads(1)%region = 'load'
      scene%loads(1)%body_force(2) = -1.0e4_wp
      scene%relaxation%solver = solvers(s)
      call relax(scene, set_up, listener, error)
      if (allocated(error)) return
      call expect_true(error, index(listener%notes, '24 points') > 0 .and. &
        & index(listener%notes, 'can move freely') > 0, 'notes: '//listener%notes)
      associate (system => set_up%system)
        ! three points of a cell each
        call expect(error, system%motions(1)%reaction(2), 1.0e4_wp*3*spacing**2*2.0e-3_wp, &
          & 1.0e-3_wp*0.006_wp, 'reaction')
        do i = 1, system%body%n_points
          k = system%body%slot(i)
          if (system%body%x(k, 1) > 8*spacing) call expect(error, &
            & max_abs(system%state%u(k, :)), 0.0_wp, 0.0_wp, 'a loose point')
        end do
      end associate
    end do
  end subroutine test_loose

  !> A strip that is pulled beyond its strength tears, and its loaded end can go nowhere: status 3,
  !> and it is said which piece, after few iterations.
  subroutine test_torn_off(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(listener_type) :: listener
    type(fault_type), allocatable :: fault
    integer :: s

    do s = 1, size(solvers)
      call strip([16, 3], scene)
      scene%materials(1)%critical_stretch = 1.0e-5_wp
      scene%loads(1)%force(:2) = [1.0e3_wp, 0.0_wp]
      scene%relaxation%solver = solvers(s)
      call relax(scene, set_up, listener, error, fault)
      if (allocated(error)) return
      call expect_true(error, allocated(fault), 'an equilibrium was found')
      if (.not. allocated(fault)) return
      call expect_true(error, fault%status == status_no_answer .and. &
        & index(fault%message, 'is free to move') > 0 .and. &
        & index(fault%message, 'net force') > 0, 'message: '//fault%message)
      call expect_true(error, listener%iterations < 3000, 'iterations')
    end do
  end subroutine test_torn_off

  !> A strip is drawn apart by its ends in three load steps and tears: each half is carried by its
  !> end without strain, and the run goes on to its last load step.
  subroutine test_goes_on(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(listener_type) :: listener
    integer :: s

    do s = 1, size(solvers)
      call strip([20, 3], scene)
      deallocate (scene%loads, scene%boundaries, scene%no_fail)
      allocate (scene%loads(0), scene%boundaries(2), scene%no_fail(2))
      scene%boundaries(1)%side = 'x_min'
      scene%boundaries(2)%side = 'x_max'
      scene%boundaries(1)%displacement(:2) = 0.0_wp
      scene%boundaries(2)%displacement(:2) = [6.0e-4_wp, 0.0_wp]
      scene%no_fail%shape = 'box'
      scene%no_fail(1)%upper(1) = 6*spacing
      scene%no_fail(2)%lower(1) = 14*spacing
      scene%materials(1)%critical_stretch = 1.0e-3_wp
      scene%relaxation%load_steps = 3
      scene%relaxation%growth = 'load_steps'
      scene%relaxation%solver = solvers(s)
      call relax(scene, set_up, listener, error)
      if (allocated(error)) return
      call expect_true(error, listener%settled == 3, 'load steps')
      call expect_true(error, set_up%system%broken > 0, 'nothing broke')
      ! of what the strip would store at its strength, E s_c^2/2 = 0.1 MPa in 12e-6 m3
      call expect(error, listener%strain, 0.0_wp, 1.0e-6_wp*1.2_wp, 'strain energy')
    end do
  end subroutine test_goes_on

  !> A strip whose lower half is heated curls, unsupported, in the plane and in space: the state
  !> that is left has the residual that was asked for, and no mean displacement or rotation.
  subroutine test_curl(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(listener_type) :: listener
    real(wp) :: spin
    integer :: dim, c, d

    do dim = 2, 3
      call box_scene([24, 4, 2], spacing, 0.25_wp, scene)
      if (dim == 2) call box_scene([24, 4], spacing, 0.25_wp, scene)
      scene%horizon%dilatation = 'unprojected'
      scene%time%method = 'relaxation'
      scene%materials(1)%thermal_expansion = 1.0e-4_wp
      deallocate (scene%initial, scene%regions)
      allocate (scene%initial(1), scene%regions(1))
      scene%regions(1)%name = 'low'
      scene%regions(1)%shape = 'box'
      scene%regions(1)%upper(1:2) = [16, 2]*spacing
      scene%initial(1)%region = 'low'
      scene%initial(1)%temperature_change = 600.0_wp
      call relax(scene, set_up, listener, error)
      if (allocated(error)) return
      call expect_true(error, listener%residual >= 0.0_wp .and. listener%residual <= 1.0e-6_wp, &
        & 'residual')
      associate (u => set_up%system%state%u, x => set_up%system%body%x)
        call expect_true(error, max_abs(u) > 0.3_wp*spacing, 'it does not curl')
        do c = 1, dim
          call expect(error, sum(u(:, c)), 0.0_wp, 1.0e-10_wp*sum(abs(u)), 'mean displacement')
          do d = c + 1, dim
            ! the volumes are equal, and sum(u) vanishes
            spin = sum(x(:, c)*u(:, d) - x(:, d)*u(:, c))
            call expect(error, spin, 0.0_wp, 1.0e-10_wp*sum(abs(u))*24*spacing, 'mean rotation')
          end do
        end do
      end associate
    end do
  end subroutine test_curl

  !> A strained free body turned by up to two radians and moved comes back to where its own mean
  !> rotation vanishes, and to the same place from everywhere, to rounding.
  subroutine test_turn_back(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(rigid_type) :: rigid
    real(wp), allocatable :: start(:, :), turned(:, :), y(:, :)
    real(wp) :: R(3, 3), axis(3)
    integer :: dim, turn, state, i, c

    state = 7
    do dim = 1, 3
      call box_scene([5, 4, 3], spacing, 0.25_wp, scene)
      if (dim == 2) call box_scene([5, 4], spacing, 0.25_wp, scene)
      if (dim == 1) call box_scene([5], spacing, 0.25_wp, scene)
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      call find_free_motions(set_up%system, rigid)
      call expect_true(error, rigid%pieces%number == 1 .and. &
        & rigid%piece(1)%number == dim*(dim + 1)/2, 'free motions')
      if (allocated(error)) return
      associate (body => set_up%system%body)
        start = 0*body%x
        do c = 1, dim
          do i = 1, body%n_points
            start(body%slot(i), c) = 0.1_wp*spacing*noise(state)
          end do
        end do
        call turn_back(set_up%system, rigid, .true., start)
        do turn = 1, 4
          axis = [0.0_wp, 0.0_wp, 1.0_wp]
          if (dim == 3) axis = [noise(state), noise(state), noise(state)]
          R = rotation_matrix(axis/norm2(axis), merge(0.0_wp, 0.5_wp*turn, dim == 1))
          y = body%x + start
          turned = matmul(y, transpose(R(:dim, :dim))) + 0.3_wp - body%x
          where (spread(body%point == 0, 2, dim)) turned = 0.0_wp
          call turn_back(set_up%system, rigid, .true., turned)
          call expect_close(error, turned, start, 1.0e-13_wp, 'the way back')
        end do
      end associate
    end do
  end subroutine test_turn_back

end module test_motion_equilibrium
