!> Relaxations that are stopped after every iteration and go on: their results are those of one in
!> one piece, bit for bit.
module test_output_checkpoint_static
  use pd_base_error, only: fault_type => error_type, status_interrupted, status_no_answer
  use pd_base_kinds, only: wp, i1
  use pd_output_results_files, only: file_exists
  use pd_scene_content_types, only: scene_type, unset
  use testdrive, only: check, error_type, new_unittest, unittest_type
  use bodies, only: expect_true, youngs_modulus
  use restarts, only: accept, expect_broken, expect_same_file, expect_same_results, here, &
    & read_bytes, run, run_in_pieces, slow_plate, spacing
  implicit none (type, external)
  private
  public :: collect_output_checkpoint_static

contains

  subroutine collect_output_checkpoint_static(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('long: a relaxation with a growing crack', test_relaxation), &
      & new_unittest('long: growth by events is the same in pieces', test_events), &
      & new_unittest('long: relaxations with a change of method', test_ways_to_rest), &
      & new_unittest('no row of a load step that has not converged', test_no_row), &
      & new_unittest('more iterations are given to a relaxation', test_more_iterations)]
  end subroutine collect_output_checkpoint_static

  !> Two load steps, in the second of which bonds break and it relaxes again; cut after every
  !> iteration and every load step, with a load beside the imposed displacements.
  subroutine test_relaxation(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: solvers(2) = [character(18) :: 'conjugate_gradient', &
      & 'dynamic_relaxation']
    type(scene_type) :: scene
    integer :: i

    call slow_plate(scene)
    do i = 1, size(solvers)
      if (allocated(error)) return
      scene%relaxation%solver = solvers(i)
      call expect_same_growth(scene, error)
    end do
  end subroutine test_relaxation

  !> Bonds break in equilibrium, in one piece as in pieces that are cut after every iteration.
  subroutine expect_same_growth(scene, error)
    type(scene_type), intent(in) :: scene
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault
    integer :: pieces

    call run(scene, 'static/whole', fault, threads=2)
    call accept(error, fault)
    call expect_broken(error, 'static/whole')
    if (allocated(error)) return
    call run_in_pieces(scene, 'static/pieces', 1, pieces, error)
    call expect_true(error, pieces > 10, 'it is cut at load steps alone')
    call expect_same_results(error, 'static/whole', 'static/pieces', 2)
    call expect_same_file(error, here//'/static/whole/iterations.csv', &
      & here//'/static/pieces/iterations.csv')
  end subroutine expect_same_growth

  !> Growth by events, with the load controlled and down where it snaps back; cut after every
  !> iteration and every equilibrium.
  subroutine test_events(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: controls(2) = [character(11) :: 'load', 'dissipation']
    type(scene_type) :: scene
    integer :: i

    call slow_plate(scene)
    scene%relaxation%load_steps = 2
    scene%relaxation%growth = 'events'
    scene%relaxation%tolerance = 1.0e-2_wp
    scene%relaxation%most_events = 3
    do i = 1, size(controls)
      if (allocated(error)) return
      scene%relaxation%control = controls(i)
      call expect_same_growth(scene, error)
    end do
  end subroutine test_events

  !> A slender plate that bends by so much that the conjugate gradient leaves it to dynamic
  !> relaxation; and one that nothing supports. Both cut after every iteration.
  subroutine test_ways_to_rest(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces, way

    do way = 1, 2
      if (allocated(error)) return
      call slow_plate(scene)
      deallocate (scene%cracks, scene%boundaries, scene%regions, scene%loads)
      allocate (scene%cracks(0), scene%boundaries(2 - way), scene%regions(0), scene%loads(way))
      scene%bodies(1)%upper(:2) = [12, 2]*spacing
      scene%bodies(1)%points(:2) = [12, 2]
      scene%sections(1)%point(2) = spacing
      scene%materials(1)%critical_stretch = unset
      scene%relaxation%load_steps = way
      scene%loads(1)%side = 'x_max'
      if (way == 1) then
        scene%boundaries(1)%side = 'x_min'
        scene%boundaries(1)%displacement(:2) = 0.0_wp
        scene%loads(1)%force(2) = 0.125_wp*youngs_modulus*spacing*scene%header%thickness
        scene%relaxation%tolerance = 2.0e-2_wp
      else
        scene%relaxation%tolerance = 1.0e-4_wp
        scene%loads(2)%side = 'x_min'
        scene%loads%pressure = -1.0e-3_wp*youngs_modulus
      end if
      call run(scene, 'static/whole', fault, threads=2)
      call accept(error, fault)
      if (allocated(error)) return
      call run_in_pieces(scene, 'static/pieces', 1, pieces, error)
      call expect_true(error, pieces > 10, 'it is cut at load steps alone')
      call expect_same_results(error, 'static/whole', 'static/pieces', way + 1)
      if (way == 1) call expect_same_file(error, here//'/static/whole/warnings.txt', &
        & here//'/static/pieces/warnings.txt')
    end do
  end subroutine test_ways_to_rest

  !> A relaxation that stops amid its load step has its state as an output, but no row of it: the
  !> file has the names and the start.
  subroutine test_no_row(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer(i1), allocatable :: bytes(:)
    integer(i1), parameter :: end_of_line = 10_i1
    integer :: piece

    call slow_plate(scene)
    do piece = 1, 3
      call run(scene, 'static/no_row', fault, restart=piece > 1, minutes=1.0e-12_wp)
      call expect_true(error, allocated(fault), 'one iteration was enough')
      if (allocated(error)) return
      call check(error, fault%status, status_interrupted)
      if (allocated(error)) return
      call expect_true(error, piece == 1 .or. index(fault%message, 'of load step 1, which is '// &
        & 'not in equilibrium yet') > 0, fault%message)
      call read_bytes(here//'/static/no_row/history.csv', bytes)
      call check(error, count(bytes == end_of_line), 2, 'lines of the history')
      if (allocated(error)) return
      call expect_true(error, file_exists(here//'/static/no_row/plate_000001.vtu') .eqv. &
        & piece > 1, 'the state at the stop is an output')
      if (allocated(error)) return
    end do
  end subroutine test_no_row

  !> Checkpoints are written by time amid a load step, too: a relaxation whose iterations are used
  !> up goes on from there when it is given more, to the end of one that had them from the start.
  subroutine test_more_iterations(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call slow_plate(scene)
    scene%relaxation%tolerance = 1.0e-6_wp
    call run(scene, 'static/whole', fault)
    call accept(error, fault)
    if (allocated(error)) return
    scene%output%checkpoint_minutes = 1.0e-12_wp
    scene%relaxation%maximum_iterations = 6
    call run(scene, 'static/more', fault)
    call expect_true(error, allocated(fault), 'six iterations were enough')
    if (allocated(error)) return
    call check(error, fault%status, status_no_answer)
    scene%output%checkpoint_minutes = 0.0_wp
    scene%relaxation%maximum_iterations = 100000
    call run(scene, 'static/more', fault, restart=.true.)
    call accept(error, fault)
    call expect_same_results(error, 'static/whole', 'static/more', 2)
  end subroutine test_more_iterations

end module test_output_checkpoint_static
