!> Relaxations by conjugate gradients that are cut after every iteration, each piece in a body made
!> anew: the end has the bits of the relaxation in one piece, whatever its way to rest was.
module test_motion_newton
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_kinds, only: wp, i8
  use pd_base_error, only: fault_type => error_type, fail, status_interrupted, status_no_answer
  use pd_base_snapshot, only: snapshot_type
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_keep, only: keep_system
  use pd_motion_observer, only: observer_type, instant_type
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_motion_system, only: system_type
  use pd_scene_content_types, only: scene_type
  use testdrive, only: error_type, new_unittest, unittest_type, test_failed
  use bodies, only: box_scene, expect_true, ready
  implicit none (type, external)
  private
  public :: collect_motion_newton

  real(wp), parameter :: spacing = 1.0e-2_wp

  !> Looks at a relaxation, or stops it at the first instant that it sees and keeps it.
  type, extends(observer_type) :: cutter_type
    logical :: cuts = .false.
    type(snapshot_type) :: snapshot
    integer :: seen = 0                       !! instants
    integer :: undeformed = 0, tangent = 0    !! in the midst of a solve with that stiffness
    integer :: ahead = 0                      !! ... of one that goes uphill
    integer :: strict = 0                     !! ... of one that must not, since one was taken back
    integer :: dynamic = 0                    !! in the midst of a dynamic relaxation
    integer(i8) :: broken = 0_i8              !! bonds at the last instant
    logical :: rescued = .false.              !! a last good state was shown
  contains
    procedure :: observe
  end type cutter_type

contains

  subroutine collect_motion_newton(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('small strains in load steps', test_linear), &
      & new_unittest('Newton''s iterations at large strains', test_large), &
      & new_unittest('solves with growing residual', test_uphill), &
      & new_unittest('a growing crack', test_crack), &
      & new_unittest('a body without support', test_unsupported), &
      & new_unittest('long: left to dynamic relaxation', test_fallback), &
      & new_unittest('a list of bonds', test_list), &
      & new_unittest('a block in mixed precision', test_mixed), &
      & new_unittest('no unconverged state within a load step becomes an output', test_no_rest)]
  end subroutine collect_motion_newton

  !> Count what this instant is amid, and stop there if asked for.
  subroutine observe(observer, system, instant, error)
    class(cutter_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error

    if (instant%rescued) observer%rescued = .true.
    observer%seen = observer%seen + 1
    observer%broken = system%broken
    if (allocated(system%memory%newton)) then
      associate (newton => system%memory%newton)
        if (newton%krylov%deformed) then
          observer%tangent = observer%tangent + 1
        else
          observer%undeformed = observer%undeformed + 1
        end if
        if (newton%ahead > 0) observer%ahead = observer%ahead + 1
        if (newton%strict) observer%strict = observer%strict + 1
      end associate
    else if (.not. instant%settled) then
      observer%dynamic = observer%dynamic + 1
    end if
    if (.not. observer%cuts .or. instant%last .or. instant%rescued) return
    call observer%snapshot%rewind(reading=.false.)
    call keep_system(observer%snapshot, system)
    call fail(error, 'cut', status_interrupted)
  end subroutine observe

  !> Relax a scene in pieces of one iteration, on `threads`, each in a body made anew.
  subroutine relax_in_pieces(scene, threads, set_up, cutter, error)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: threads
    type(set_up_type), intent(out) :: set_up
    type(cutter_type), intent(inout) :: cutter
    type(error_type), allocatable, intent(inout) :: error
    integer, parameter :: most = 5000
    type(fault_type), allocatable :: fault
    integer :: piece, before

    before = omp_get_max_threads()
    call omp_set_num_threads(threads)
    do piece = 1, most
      call ready(scene, set_up, error)
      if (allocated(error)) exit
      if (piece > 1) then
        call cutter%snapshot%rewind(reading=.true.)
        call keep_system(cutter%snapshot, set_up%system)
        if (allocated(cutter%snapshot%error)) then
          call test_failed(error, cutter%snapshot%error%message)
          exit
        end if
      end if
      call run_relaxation(set_up%system, set_up%plan%relaxation, cutter, fault)
      if (.not. allocated(fault)) exit
      if (fault%status == status_interrupted) cycle
      call test_failed(error, fault%message)
      exit
    end do
    call omp_set_num_threads(before)
    call expect_true(error, piece <= most, 'the pieces do not come to their end')
  end subroutine relax_in_pieces

  !> Whole on one number of threads, in pieces on another: the same bits. `whole` counts what was on
  !> the way.
  subroutine expect_same_end(scene, whole, error, threads)
    type(scene_type), intent(in) :: scene
    type(cutter_type), intent(out) :: whole
    type(error_type), allocatable, intent(inout) :: error
    integer, intent(in), optional :: threads  !! of the pieces
    type(set_up_type) :: first, second
    type(cutter_type) :: cutter
    type(fault_type), allocatable :: fault
    integer :: before, number

    if (allocated(error)) return
    number = 1
    if (present(threads)) number = threads
    call ready(scene, first, error)
    if (allocated(error)) return
    before = omp_get_max_threads()
    call omp_set_num_threads(3 - number)
    call run_relaxation(first%system, first%plan%relaxation, whole, fault)
    call omp_set_num_threads(before)
    if (allocated(fault)) call test_failed(error, fault%message)
    cutter%cuts = .true.
    call relax_in_pieces(scene, number, second, cutter, error)
    if (allocated(error)) return
    call expect_true(error, cutter%seen == whole%seen, 'number of instants')
    associate (a => first%system, b => second%system)
      call expect_same_bits(error, [a%state%u], [b%state%u], 'displacement')
      call expect_same_bits(error, [a%state%force], [b%state%force], 'force')
      call expect_same_bits(error, a%state%damage, b%state%damage, 'damage')
      call expect_same_bits(error, [a%external_work, a%dissipated], &
        & [b%external_work, b%dissipated], 'work')
      call expect_true(error, a%broken == b%broken, 'broken bonds')
    end associate
  end subroutine expect_same_end

  subroutine expect_same_bits(error, a, b, what)
    type(error_type), allocatable, intent(inout) :: error
    real(wp), intent(in) :: a(:), b(:)
    character(*), intent(in) :: what

    call expect_true(error, size(a) == size(b), 'size of '//what)
    if (allocated(error)) return
    call expect_true(error, all(transfer(a, 0_i8, size(a)) == transfer(b, 0_i8, size(b))), &
      & what//' differs')
  end subroutine expect_same_bits

  !> Held at x_min by a layer, pulled at x_max.
  subroutine pulled(points, pressure, scene)
    integer, intent(in) :: points(:)
    real(wp), intent(in) :: pressure
    type(scene_type), intent(out) :: scene

    call box_scene(points, spacing, 0.3_wp, scene)
    deallocate (scene%boundaries, scene%loads)
    allocate (scene%boundaries(1), scene%loads(1))
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%displacement(:size(points)) = 0.0_wp
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%pressure = pressure
    scene%time%method = 'relaxation'
    scene%relaxation%solver = 'conjugate_gradient'
  end subroutine pulled

  subroutine test_linear(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(cutter_type) :: whole
    integer :: threads

    call pulled([8, 5], -1.0e6_wp, scene)
    scene%relaxation%load_steps = 3
    do threads = 1, 2
      call expect_same_end(scene, whole, error, threads)
    end do
    call expect_true(error, whole%undeformed > 10 .and. whole%dynamic == 0, 'another way to rest')
  end subroutine test_linear

  !> A fifth longer, with what is imposed beside the load.
  subroutine test_large(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(cutter_type) :: whole

    call pulled([8, 5], -4.0e10_wp, scene)
    scene%boundaries(1)%displacement(2) = 0.1_wp*spacing
    call expect_same_end(scene, whole, error)
    call expect_true(error, whole%undeformed > 0 .and. whole%tangent > 0 .and. &
      & whole%dynamic == 0, 'another way to rest')
  end subroutine test_large

  !> A slender body that bends by far.
  subroutine test_uphill(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(cutter_type) :: whole

    call pulled([16, 3], 0.0_wp, scene)
    scene%loads(1)%force(2) = 3.0e4_wp
    scene%relaxation%load_steps = 2
    call expect_same_end(scene, whole, error)
    call expect_true(error, whole%ahead > 0 .and. whole%dynamic == 0, 'another way to rest')
  end subroutine test_uphill

  !> A notched plate whose ends are drawn apart: after bonds have broken it relaxes again.
  subroutine test_crack(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(cutter_type) :: whole
    integer :: threads

    call pulled([8, 8], 0.0_wp, scene)
    deallocate (scene%boundaries, scene%loads, scene%cracks)
    allocate (scene%boundaries(2), scene%loads(0), scene%cracks(1))
    scene%boundaries(1)%side = 'y_min'
    scene%boundaries(1)%displacement(2) = -8.0e-3_wp*4*spacing
    scene%boundaries(2)%side = 'y_max'
    scene%boundaries(2)%displacement(2) = 8.0e-3_wp*4*spacing
    scene%cracks(1)%from(:2) = [0.0_wp, 4.0_wp]*spacing
    scene%cracks(1)%to(:2) = [3.0_wp, 4.0_wp]*spacing
    scene%materials(1)%critical_stretch = 0.009_wp
    scene%relaxation%load_steps = 2
    scene%horizon%surface_correction = 'energy'
    do threads = 1, 2
      call expect_same_end(scene, whole, error, threads)
    end do
    call expect_true(error, whole%undeformed > 0 .and. whole%broken > 0_i8, 'nothing broke')
  end subroutine test_crack

  !> Pulled at both ends of a strip with a notch, which turns until the loads are in line.
  subroutine test_unsupported(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(cutter_type) :: whole

    call pulled([10, 5], 0.0_wp, scene)
    deallocate (scene%boundaries, scene%loads, scene%removed)
    allocate (scene%boundaries(0), scene%loads(2), scene%removed(1))
    scene%removed(1)%shape = 'box'
    scene%removed(1)%lower(:2) = [3.0_wp, 3.0_wp]*spacing
    scene%removed(1)%upper(:2) = [5.0_wp, 6.0_wp]*spacing
    scene%loads(1)%side = 'x_min'
    scene%loads(2)%side = 'x_max'
    scene%loads%pressure = -1.0e8_wp
    call expect_same_end(scene, whole, error)
    call expect_true(error, whole%undeformed > 0 .and. whole%dynamic == 0, 'another way to rest')
  end subroutine test_unsupported

  !> Bent so far that shortened steps lead nowhere: solves are taken back on the way, and both the
  !> conjugate gradient and the dynamic relaxation after it are cut.
  subroutine test_fallback(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(cutter_type) :: whole

    call pulled([12, 2], 0.0_wp, scene)
    scene%loads(1)%force(2) = 5.0e5_wp
    scene%relaxation%tolerance = 1.0e-4_wp
    call expect_same_end(scene, whole, error)
    call expect_true(error, whole%tangent > 0 .and. whole%ahead > 0 .and. whole%strict > 0 .and. &
      & whole%dynamic > 0, 'another way to rest')
  end subroutine test_fallback

  subroutine test_list(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(cutter_type) :: whole

    call pulled([8, 4], -4.0e10_wp, scene)
    scene%horizon%family = 'list'
    scene%materials(1)%model = 'bond_based'
    scene%materials(1)%poissons_ratio = 1.0_wp/3.0_wp
    call expect_same_end(scene, whole, error)
    call expect_true(error, whole%tangent > 0, 'another way to rest')
  end subroutine test_list

  !> In 3D, with bonds in single precision.
  subroutine test_mixed(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(cutter_type) :: whole

    call pulled([6, 5, 5], -2.0e9_wp, scene)
    scene%header%precision = 'mixed'
    scene%relaxation%tolerance = 1.0e-4_wp
    call expect_same_end(scene, whole, error)
    call expect_true(error, whole%undeformed > 0, 'another way to rest')
  end subroutine test_mixed

  !> What goes on amid a load step and finds no rest has no good state to show: the one that it
  !> began with is none.
  subroutine test_no_rest(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(cutter_type) :: cutter
    type(fault_type), allocatable :: fault
    integer :: piece

    call pulled([8, 5], -1.0e6_wp, scene)
    scene%relaxation%maximum_iterations = 5
    cutter%cuts = .true.
    do piece = 1, 4
      call ready(scene, set_up, error)
      if (allocated(error)) return
      if (piece > 1) then
        call cutter%snapshot%rewind(reading=.true.)
        call keep_system(cutter%snapshot, set_up%system)
      end if
      cutter%cuts = piece < 4
      call run_relaxation(set_up%system, set_up%plan%relaxation, cutter, fault)
      call expect_true(error, allocated(fault), 'five iterations were enough')
      if (allocated(error)) return
    end do
    call expect_true(error, fault%status == status_no_answer, 'exit status')
    call expect_true(error, cutter%seen == 6, 'iterations of all pieces count')
    call expect_true(error, .not. cutter%rescued, 'a state amid a load step is no good one')
  end subroutine test_no_rest

end module test_motion_newton
