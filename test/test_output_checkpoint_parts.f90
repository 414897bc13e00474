!> Runs that are stopped after every step and go on, with what carries a state from step to step:
!> laws with a history, temperatures, expressions of t, pins, contact, rigid bodies.
module test_output_checkpoint_parts
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_scene_content_types, only: scene_type, unset
  use testdrive, only: error_type, new_unittest, unittest_type
  use bodies, only: expect_true, youngs_modulus
  use restarts, only: accept, expect_broken, expect_same_results, plate, run, run_in_pieces, &
    & slow_plate, spacing
  implicit none (type, external)
  private
  public :: collect_output_checkpoint_parts

contains

  subroutine collect_output_checkpoint_parts(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('long: a law with a history', test_plastic), &
      & new_unittest('long: temperatures that vary in time', test_heated), &
      & new_unittest('conditions that are expressions of t', test_expressions), &
      & new_unittest('pins in motion and in equilibrium', test_pins), &
      & new_unittest('contact with friction', test_contact), &
      & new_unittest('rigid bodies that spin and are moved', test_rigid)]
  end subroutine collect_output_checkpoint_parts

  !> An elastic-plastic block: explicit, where bonds break after they have flowed; in load steps.
  subroutine test_plastic(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: block
    type(fault_type), allocatable :: fault
    integer :: pieces, way

    do way = 1, 2
      if (allocated(error)) return
      if (way == 1) call plate(block)
      if (way == 2) call slow_plate(block)
      block%header%dimension = 3
      block%bodies(1)%lower = 0.0_wp
      block%bodies(1)%upper = [6.0_wp, 7.0_wp, 4.0_wp]*spacing
      block%bodies(1)%points = [6, 7, 4]
      deallocate (block%cracks)
      allocate (block%cracks(0))
      block%probes(1)%point = 0.0_wp
      associate (material => block%materials(1))
        material%model = 'lps_plastic'
        material%influence = 'linear'
        allocate (material%parameters(2))
        material%parameters%name = ['yield_stress', 'hardening   ']
        material%parameters%value = [1.0e-4_wp, 1.0e-2_wp]*youngs_modulus
        material%critical_stretch = merge(0.002_wp, unset, way == 1)
      end associate
      block%time%steps = 9
      block%relaxation%load_steps = 2
      if (way == 2) block%boundaries(:2)%displacement(2) = &
        & block%boundaries(:2)%displacement(2)/20
      call run(block, 'parts/whole', fault, threads=2)
      call accept(error, fault)
      if (way == 1) call expect_broken(error, 'parts/whole')
      if (allocated(error)) return
      call run_in_pieces(block, 'parts/pieces', 1, pieces, error)
      call expect_same_results(error, 'parts/whole', 'parts/pieces', 3)
    end do
  end subroutine test_plastic

  !> Heat that comes in during the steps, explicit and over load steps.
  subroutine test_heated(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces, i

    do i = 1, 2
      if (allocated(error)) return
      if (i == 1) then
        call plate(scene)
        scene%time%steps = 12
      else
        call slow_plate(scene)
        scene%relaxation%load_steps = 2
      end if
      deallocate (scene%initial)
      allocate (scene%initial(1))
      scene%initial(1)%temperature_change = 100.0_wp
      scene%initial(1)%times = [0.0_wp, merge(1.0e-6_wp, 1.0_wp, i == 1)]
      scene%initial(1)%values = [0.2_wp, 1.0_wp]
      scene%materials(1)%thermal_expansion = 1.0e-5_wp
      call run(scene, 'parts/whole', fault)
      call accept(error, fault)
      if (allocated(error)) return
      call run_in_pieces(scene, 'parts/pieces', 1, pieces, error)
      call expect_same_results(error, 'parts/whole', 'parts/pieces', 3)
    end do
  end subroutine test_heated

  !> Imposed motion, loads and temperatures that are expressions of t, with paths that are summed.
  subroutine test_expressions(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: names(3) = [character(16) :: 'velocity_verlet', 'runge_kutta', '']
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces, i

    do i = 1, 3
      if (allocated(error)) return
      if (i < 3) then
        call plate(scene)
        scene%time%steps = 9
        scene%time%integrator = names(i)
        scene%boundaries(1)%velocity_text(2) = '-40*exp(1e5*t)*(1 + x)'
        scene%boundaries(2)%displacement_text(2) = '40*t*cos(x) + 1e6*t^2'
        scene%loads(1)%body_force_text(1) = '1e8*cos(1e6*t + 1000*y)'
      else
        call slow_plate(scene)
        scene%relaxation%load_steps = 3
        scene%boundaries(1)%velocity_text(2) = '-1e-5*t^2'
        scene%boundaries(2)%displacement_text(2) = '1e-5*t^3'
        scene%loads(1)%body_force_text(1) = '1e6*sin(t + x)'
      end if
      scene%boundaries(1)%velocity(2) = unset
      scene%boundaries(1)%displacement(2) = unset
      scene%boundaries(2)%velocity(2) = unset
      scene%boundaries(2)%displacement(2) = unset
      scene%loads(1)%body_force(1) = unset
      if (allocated(scene%boundaries(1)%times)) deallocate (scene%boundaries(1)%times, &
        & scene%boundaries(1)%values)
      if (allocated(scene%boundaries(2)%times)) deallocate (scene%boundaries(2)%times, &
        & scene%boundaries(2)%values)
      deallocate (scene%initial)
      allocate (scene%initial(1))
      scene%initial(1)%temperature_text = merge('100*sin(1e6*t + 9*x)', '20*t^2 + 10*x       ', &
        & i < 3)
      scene%materials(1)%thermal_expansion = 1.0e-5_wp
      call run(scene, 'parts/whole', fault, threads=2)
      call accept(error, fault)
      if (allocated(error)) return
      call run_in_pieces(scene, 'parts/pieces', 1, pieces, error)
      call expect_true(error, pieces > 2, 'it is not cut')
      call expect_same_results(error, 'parts/whole', 'parts/pieces', merge(3, 4, i < 3))
    end do
  end subroutine test_expressions

  !> A plate that breaks beside a pin, and one that is bent about pins, cut after every iteration.
  subroutine test_pins(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: solvers(2) = [character(18) :: 'conjugate_gradient', &
      & 'dynamic_relaxation']
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces, i

    do i = 0, 2
      if (allocated(error)) return
      if (i == 0) then
        call plate(scene)
      else
        call slow_plate(scene)
        scene%relaxation%solver = solvers(max(1, i))
      end if
      scene%boundaries(1)%motion = 'pin'
      if (i > 0) then
        scene%boundaries(1)%displacement(1) = 0.0_wp
        scene%boundaries(2)%motion = 'pin'
        scene%materials(1)%critical_stretch = unset
      end if
      call run(scene, 'parts/whole', fault, threads=2)
      call accept(error, fault)
      if (allocated(error)) return
      call run_in_pieces(scene, 'parts/pieces', 1, pieces, error)
      call expect_true(error, pieces > 10, 'it is not cut')
      call expect_same_results(error, 'parts/whole', 'parts/pieces', merge(6, 2, i == 0))
    end do
  end subroutine test_pins

  !> Two blocks that graze each other, cut after every step.
  subroutine test_contact(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces

    call plate(scene)
    deallocate (scene%bodies, scene%cracks, scene%boundaries, scene%contacts, scene%initial)
    allocate (scene%bodies(2), scene%cracks(0), scene%boundaries(0), scene%contacts(1), &
      & scene%initial(1))
    scene%bodies%name = ['low ', 'high']
    scene%bodies(1)%lower(:2) = 0.0_wp
    scene%bodies(1)%upper(:2) = [12, 6]*spacing
    scene%bodies(2)%lower(:2) = [3, 6]*spacing
    scene%bodies(2)%upper(:2) = [9, 12]*spacing
    scene%bodies(1)%points(:2) = [12, 6]
    scene%bodies(2)%points(:2) = [6, 6]
    allocate (scene%contacts(1)%between(2))
    scene%contacts(1)%between(:) = ['low ', 'high']
    scene%contacts(1)%friction = 0.3_wp
    scene%contacts(1)%stiffness = 4.0_wp
    scene%initial(1)%velocity_text(1) = '50*(y > 0.006)'
    scene%initial(1)%velocity_text(2) = '-400*(y > 0.006)'
    call run(scene, 'parts/whole', fault, threads=2)
    call accept(error, fault)
    if (allocated(error)) return
    call run_in_pieces(scene, 'parts/pieces', 1, pieces, error)
    call expect_true(error, pieces > 10, 'it is not cut')
    call expect_same_results(error, 'parts/whole', 'parts/pieces', 6)
  end subroutine test_contact

  !> A free disc and a wall that is moved hit a plate from two sides, cut after every step.
  subroutine test_rigid(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces, i

    call plate(scene)
    deallocate (scene%cracks, scene%boundaries, scene%contacts, scene%initial, scene%rigids)
    allocate (scene%cracks(0), scene%boundaries(0), scene%contacts(2), scene%initial(0), &
      & scene%rigids(2))
    scene%rigids%name = [character(4) :: 'disc', 'wall']
    scene%rigids%shape = [character(10) :: 'sphere', 'half_space']
    scene%rigids(1)%centre(:2) = [5.0_wp, 15.3_wp]*spacing
    scene%rigids(1)%radius = 3*spacing
    scene%rigids(1)%density = 3000.0_wp
    scene%rigids(1)%velocity(:2) = [200.0_wp, -500.0_wp]
    scene%rigids(1)%spin(3) = 1.0e5_wp
    scene%rigids(2)%centre(:2) = 0.0_wp
    scene%rigids(2)%normal(:2) = [0.0_wp, 1.0_wp]
    scene%rigids(2)%displacement_text(2) = '20*t + 1e7*t^2'
    do i = 1, 2
      allocate (scene%contacts(i)%between(2))
      scene%contacts(i)%between(:) = [character(4) :: 'box', scene%rigids(i)%name]
      scene%contacts(i)%friction = 0.3_wp
    end do
    scene%contacts(2)%restitution = 0.7_wp
    call run(scene, 'parts/whole', fault, threads=2)
    call accept(error, fault)
    if (allocated(error)) return
    call run_in_pieces(scene, 'parts/pieces', 1, pieces, error)
    call expect_true(error, pieces > 10, 'it is not cut')
    call expect_same_results(error, 'parts/whole', 'parts/pieces', 6)
  end subroutine test_rigid

end module test_output_checkpoint_parts
