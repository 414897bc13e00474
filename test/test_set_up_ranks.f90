!> What a run on several ranks refuses, by name, and what it does not.
module test_set_up_ranks
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_scene_content_types, only: name_length, scene_type
  use pd_set_up_ranks, only: check_ranks, reproducible_layer
  use bodies, only: box_scene, expect_true
  use testdrive, only: error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_set_up_ranks

  integer, parameter :: kinds = 10   !! of scenes that are refused

contains

  subroutine collect_set_up_ranks(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('what is refused', test_refused), &
      & new_unittest('what is not', test_allowed)]
  end subroutine collect_set_up_ranks

  !> Each has an error that names it.
  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    character(:), allocatable :: name
    integer :: kind

    do kind = 1, kinds
      call refused_scene(kind, scene, name)
      call check_ranks(scene, fault)
      call expect_true(error, allocated(fault), 'not refused: '//name)
      if (allocated(error)) return
      call expect_true(error, index(fault%message, 'several ranks cannot have '//name) > 0, &
        & name//' is refused as: '//fault%message)
    end do
  end subroutine test_refused

  !> A scene with one thing that is refused, and what the error calls it.
  subroutine refused_scene(kind, scene, name)
    integer, intent(in) :: kind
    type(scene_type), intent(out) :: scene
    character(:), allocatable, intent(out) :: name

    call box_scene([10, 10], 0.1_wp, 0.3_wp, scene)
    deallocate (scene%boundaries, scene%loads, scene%initial, scene%probes)
    allocate (scene%boundaries(1), scene%loads(1), scene%initial(1), scene%probes(1))
    select case (kind)
    case (1)
      name = 'a mesh'
      scene%bodies(1)%mesh = 'part.msh'
    case (2)
      name = 'a surface'
      scene%bodies(1)%surface = 'part.stl'
    case (3)
      name = 'growth by events'
      scene%time%method = 'relaxation'
      scene%materials(1)%critical_stretch = 0.01_wp
    case (4)
      name = 'horizons of points'
      scene%horizon%local = .true.
    case (5)
      name = "surface_correction = 'consistent'"
      scene%horizon%surface_correction = 'consistent'
    case (6)
      name = '&j_integral'
      deallocate (scene%j_integrals)
      allocate (scene%j_integrals(1))
    case (7)
      name = "a probe of the field 'fragment'"
      scene%probes(1)%fields = [character(name_length) :: 'damage', 'fragment']
    case (8)
      name = "a line of the field 'fragment'"
      deallocate (scene%lines)
      allocate (scene%lines(1))
      scene%lines(1)%fields = [character(name_length) :: 'fragment']
    case (9)
      name = '&refine'
      allocate (scene%refines(1))
    case default
      name = 'cells'
      scene%output%cells = .true.
    end select
  end subroutine refused_scene

  !> Explicit runs with cracks, boundaries, loads, heat and probes; static equilibrium, also with
  !> bonds that break in load steps.
  subroutine test_allowed(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call box_scene([10, 10], 0.1_wp, 0.3_wp, scene)
    deallocate (scene%boundaries, scene%loads, scene%initial, scene%probes, scene%cracks)
    allocate (scene%boundaries(2), scene%loads(1), scene%initial(3), scene%probes(1))
    allocate (scene%cracks(1))
    scene%materials(1)%critical_stretch = 0.01_wp
    scene%materials(1)%scatter = 10.0_wp
    scene%horizon%surface_correction = 'energy'
    scene%boundaries(1)%absorbing = .true.
    scene%boundaries(2)%motion = 'pin'
    deallocate (scene%tips)
    allocate (scene%tips(1))
    scene%output%fragments = .true.
    scene%loads(1)%stiffness(2) = 1.0_wp
    scene%initial(1)%file = 'state.txt'
    scene%initial(2)%temperature_change = 10.0_wp
    scene%initial(3)%temperature_text = 't'
    scene%probes(1)%interpolate = .true.
    deallocate (scene%sections, scene%lines)
    allocate (scene%sections(1), scene%lines(1))
    deallocate (scene%rigids, scene%contacts)
    allocate (scene%rigids(1), scene%contacts(2))
    scene%bodies(1)%name = 'block'
    scene%rigids(1)%name = 'ball'
    scene%contacts(1)%between = [character(len(scene%contacts(1)%between)) :: 'block', 'ball']
    scene%contacts(2)%within = 'block'
    call check_ranks(scene, fault)
    call expect_true(error, .not. allocated(fault), 'an explicit run is refused')
    scene%time%method = 'relaxation'
    scene%relaxation%growth = 'load_steps'
    call check_ranks(scene, fault)
    call expect_true(error, .not. allocated(fault), 'growth in load steps is refused')
    deallocate (scene%cracks)
    allocate (scene%cracks(0))
    call box_scene([10, 10], 0.1_wp, 0.3_wp, scene)
    scene%time%method = 'relaxation'
    call check_ranks(scene, fault)
    call expect_true(error, .not. allocated(fault), 'static equilibrium is refused')
    call expect_true(error, reproducible_layer(.false.) == 8 .and. reproducible_layer(.true.) == &
      & 16, 'blocks of rows')
  end subroutine test_allowed

end module test_set_up_ranks
