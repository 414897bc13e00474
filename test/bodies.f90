!> Bodies that tests share, built from plain numbers, and what tests do with all of them.
module bodies
  use omp_lib, only: omp_set_num_threads
  use pd_base_kinds, only: wp
  use pd_base_error, only: fault_type => error_type
  use pd_base_reduce, only: noise
  use pd_body_body, only: body_type
  use pd_law_material, only: material_type, new_material
  use pd_set_up_prepare, only: set_up_type, prepare
  use pd_motion_observer, only: observer_type, instant_type
  use pd_motion_account, only: energies_type, energies_of, velocities_now
  use pd_motion_system, only: system_type
  use pd_scene_content_types, only: scene_type, name_length
  use comparisons, only: expect => close_number, text_of
  use testdrive, only: error_type, test_failed
  use pd_output_report_before, only: foresee_output
  use pd_output_fields_table, only: all_fields
  use pd_output_measures_measure, only: measure_list_type
  implicit none (type, external)
  private
  public :: prepare_run, box_scene, ready, ready_alone, expect, expect_true, noise, shake, &
    & diary_type, rotation_matrix, at_point, youngs_modulus, density_of_steel, text_of

  real(wp), parameter :: youngs_modulus = 200.0e9_wp   !! of every test's material [Pa]
  real(wp), parameter :: density_of_steel = 7850.0_wp  !! [kg/m3]

  !> Keeps what an explicit run shows: a row per instant.
  type, extends(observer_type) :: diary_type
    integer :: every = 1                    !! rows at multiples of this step; 0: settled ones
    integer :: slot = 0                     !! slot whose displacement is kept, 0 for none
    integer :: n = 0
    integer :: settled = 0                  !! load steps that converged
    real(wp), allocatable :: time(:)
    real(wp), allocatable :: kinetic(:), strain(:), dissipated(:), work(:)
    real(wp), allocatable :: u(:, :)        !! (dim, row)
  contains
    procedure :: observe
  end type diary_type

contains

  !> A scene of one lattice body of steel at the origin, everything else as by default but without
  !> surface correction.
  subroutine box_scene(points, spacing, poissons_ratio, scene)
    integer, intent(in) :: points(:)       !! along each direction; their number is the dimension
    real(wp), intent(in) :: spacing        !! [m]
    real(wp), intent(in) :: poissons_ratio
    type(scene_type), intent(out) :: scene
    integer :: dim

    dim = size(points)
    scene%file = ''
    scene%text = ''
    scene%header%dimension = dim
    scene%header%thickness = 2.0e-3_wp
    scene%header%area = 3.0e-4_wp
    allocate (scene%bodies(1), scene%materials(1))
    scene%bodies(1)%name = 'box'
    scene%bodies(1)%lower(:dim) = 0.0_wp
    scene%bodies(1)%upper(:dim) = points*spacing
    scene%bodies(1)%points(:dim) = points
    scene%materials(1)%name = 'steel'
    scene%materials(1)%youngs_modulus = youngs_modulus
    scene%materials(1)%poissons_ratio = poissons_ratio
    scene%materials(1)%density = density_of_steel
    scene%horizon%surface_correction = 'none'
    allocate (scene%kept(0), scene%removed(0), scene%regions(0), scene%sides(0), scene%cracks(0), &
      & scene%no_fail(0), scene%initial(0), scene%boundaries(0), scene%loads(0), &
      & scene%contacts(0), scene%rigids(0), scene%probes(0), scene%sections(0), scene%lines(0), &
      & scene%tips(0), scene%j_integrals(0))
    scene%time%steps = 1
    allocate (scene%output%fields(0))
  end subroutine box_scene

  !> Build a scene; what is wrong with it fails the test.
  subroutine ready(scene, set_up, error)
    type(scene_type), intent(in) :: scene
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    call prepare_run(scene, set_up, fault)
    if (allocated(fault)) call test_failed(error, 'the scene is refused: '//fault%message)
  end subroutine ready

  !> As `ready`, and on one thread to the end of the test: a body of a few points gains nothing from
  !> more, and where others compute it waits for them at every step.
  subroutine ready_alone(scene, set_up, error)
    type(scene_type), intent(in) :: scene
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error

    call omp_set_num_threads(1)
    call ready(scene, set_up, error)
  end subroutine ready_alone

  !> Fail unless it is so; a failure that stands is kept.
  subroutine expect_true(error, is_so, what)
    type(error_type), allocatable, intent(inout) :: error
    logical, intent(in) :: is_so
    character(*), intent(in) :: what

    if (allocated(error)) return
    if (.not. is_so) call test_failed(error, what)
  end subroutine expect_true

  !> Displacements of all points: a given gradient and a random part, its components up to `size`
  !> [m].
  subroutine shake(body, gradient, size, seed, u)
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: gradient(3, 3)
    real(wp), intent(in) :: size
    integer, intent(in) :: seed
    real(wp), intent(out) :: u(:, :)
    integer :: state, i, c, k

    u = 0.0_wp
    state = seed
    do i = 1, body%n_points
      k = body%slot(i)
      do c = 1, body%dim
        u(k, c) = dot_product(gradient(c, :body%dim), body%x(k, :)) + size*noise(state)
      end do
    end do
  end subroutine shake

  !> Rotation by `angle` [rad] about `axis` (a unit vector); in the plane the axis is z.
  pure function rotation_matrix(axis, angle) result(R)
    real(wp), intent(in) :: axis(3)
    real(wp), intent(in) :: angle
    real(wp) :: R(3, 3)
    integer :: i

    R(:, 1) = (1 - cos(angle))*axis*axis(1) + sin(angle)*[0.0_wp, axis(3), -axis(2)]
    R(:, 2) = (1 - cos(angle))*axis*axis(2) + sin(angle)*[-axis(3), 0.0_wp, axis(1)]
    R(:, 3) = (1 - cos(angle))*axis*axis(3) + sin(angle)*[axis(2), -axis(1), 0.0_wp]
    do i = 1, 3
      R(i, i) = R(i, i) + cos(angle)
    end do
  end function rotation_matrix

  !> The slot of the point nearest to `x`.
  pure integer function at_point(body, x) result(slot)
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: x(:)
    integer :: i, k
    real(wp) :: least, distance

    slot = 0
    least = huge(least)
    do i = 1, body%n_points
      k = body%slot(i)
      distance = sum((body%x(k, :) - x)**2)
      if (distance < least) then
        least = distance
        slot = k
      end if
    end do
  end function at_point

  !> Keep a row. Velocities are those of the instant, as results show them.
  subroutine observe(observer, system, instant, error)
    class(diary_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error
    type(energies_type) :: energies
    real(wp), allocatable :: v(:, :), now(:)

    if (allocated(error)) return
    if (instant%settled .and. instant%load_step > 0) observer%settled = observer%settled + 1
    if (observer%every == 0) then
      if (.not. instant%settled) return
    else if (mod(instant%step, observer%every) /= 0 .and. .not. instant%last) then
      return
    end if
    if (.not. allocated(observer%time)) then
      allocate (observer%time(0), observer%kinetic(0), observer%strain(0), observer%dissipated(0), &
        & observer%work(0), observer%u(system%body%dim, 0))
    end if
    call velocities_now(system, instant%time, instant%kick, v)
    call energies_of(system, v, energies)
    observer%n = observer%n + 1
    observer%time = [observer%time, instant%time]
    observer%kinetic = [observer%kinetic, energies%kinetic]
    observer%strain = [observer%strain, energies%strain]
    observer%dissipated = [observer%dissipated, system%dissipated]
    observer%work = [observer%work, system%external_work]
    if (observer%slot > 0) then
      now = [observer%u, system%state%u(observer%slot, :)]
      observer%u = reshape(now, [system%body%dim, observer%n])
    end if
  end subroutine observe

  !> Prepare a scene as a run does, warnings about its output included.
  subroutine prepare_run(scene, set_up, error)
    type(scene_type), intent(in) :: scene
    type(set_up_type), intent(out) :: set_up
    type(fault_type), allocatable, intent(out) :: error
    type(measure_list_type) :: measures
    call prepare(scene, set_up, error)
    if (.not. allocated(error)) call foresee_output(scene, all_fields(), set_up, measures, error)
  end subroutine prepare_run

end module bodies
