!> Gravity, springs and absorbing boundaries of a scene, against closed forms.
module test_set_up_terms
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_body_waves, only: longitudinal_speed
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_scene_content_complete, only: complete_scene
  use pd_scene_content_types, only: scene_type
  use pd_set_up_move, only: move
  use pd_set_up_prepare, only: set_up_type
  use bodies, only: at_point, box_scene, density_of_steel, diary_type, expect, expect_true, ready, &
    & youngs_modulus
  use comparisons, only: expect_close, text_of
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_set_up_terms

  real(wp), parameter :: spacing = 1.0e-3_wp  !! [m]

contains

  subroutine collect_set_up_terms(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('bodies of different density fall alike', test_fall), &
      & new_unittest('a hanging bar is stretched by its weight', test_hanging), &
      & new_unittest('long: springs yield by force over stiffness', test_springs), &
      & new_unittest('an absorbing boundary takes in a longitudinal wave', test_absorbing), &
      & new_unittest('combinations that mean nothing are refused', test_refused)]
  end subroutine collect_set_up_terms

  !> Bodies far apart fall by g t^2/2, which forward_backward integrates to rounding; the work of
  !> gravity becomes kinetic energy.
  subroutine test_fall(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), parameter :: g(3) = [3.0_wp, -4.0_wp, 12.0_wp]
    integer, parameter :: steps = 50
    real(wp) :: dt
    integer :: k

    call box_scene([4, 3, 3], spacing, 0.2_wp, scene)
    scene%bodies = [scene%bodies(1), scene%bodies(1)]
    scene%bodies(2)%name = 'other'
    scene%bodies(2)%lower(1) = 20*spacing
    scene%bodies(2)%upper(1) = 24*spacing
    scene%bodies%material = 'steel'
    scene%bodies(2)%material = 'light'
    scene%materials = [scene%materials(1), scene%materials(1)]
    scene%materials(2)%name = 'light'
    scene%materials(2)%density = density_of_steel/5
    scene%header%gravity = g
    call ready(scene, set_up, error)
    if (allocated(error)) return
    dt = set_up%plan%step
    diary%every = 10
    diary%slot = at_point(set_up%system%body, [21*spacing, spacing, spacing])
    call run_explicit(set_up%system, 'forward_backward', dt, steps, diary, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    do k = 1, set_up%system%body%n_slots
      if (set_up%system%body%point(k) == 0) cycle
      call expect_close(error, set_up%system%state%u(k, :)/((steps*dt)**2/2), g, 1.0e-10_wp, &
        & 'path')
    end do
    call expect_close(error, diary%u(2, :), g(2)*diary%time**2/2, 1.0e-10_wp*(steps*dt)**2, &
      & 'path at all times')
    call expect_close(error, diary%kinetic(2:)/diary%work(2:), 1.0_wp, 1.0e-10_wp, 'energy')
  end subroutine test_fall

  !> A bar that hangs in a layer: its end moves by rho g L^2/(2 E); sums over points instead of
  !> integrals and the layer's own extension err by some spacings over the length, 1/25 each. The
  !> layer bears the weight of all points, up to the tolerance of static equilibrium.
  subroutine test_hanging(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    integer, parameter :: n = 50
    real(wp), parameter :: g = -9.81_wp
    real(wp) :: weight

    call box_scene([n], spacing, 0.2_wp, scene)
    scene%header%gravity(1) = g
    deallocate (scene%boundaries)
    allocate (scene%boundaries(1))
    scene%boundaries(1)%side = 'x_max'
    scene%boundaries(1)%name = 'hook'
    scene%boundaries(1)%displacement(1) = 0.0_wp
    scene%time%method = 'relaxation'
    call complete_scene(scene, fault)
    if (.not. allocated(fault)) call ready(scene, set_up, error)
    if (allocated(error)) return
    if (.not. allocated(fault)) then
      diary%slot = at_point(set_up%system%body, [0.0_wp])
      call move(set_up%system, set_up%plan, diary, fault)
    end if
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    weight = density_of_steel*g*sum(set_up%system%body%volume)
    call expect(error, set_up%system%motions(1)%reaction(1)/weight, -1.0_wp, 1.0e-3_wp, 'reaction')
    call expect(error, diary%u(1, diary%n)*2*youngs_modulus/(density_of_steel*g*(n*spacing)**2), &
      & 1.0_wp, 0.04_wp, 'end')
  end subroutine test_hanging

  !> A plate on springs at one side, pulled at the other: the mean displacement over the springs'
  !> volume is force over stiffness, whatever the plate does, up to the tolerance of equilibrium.
  !> Across, springs alone hold it.
  subroutine test_springs(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), parameter :: force = 100.0_wp, stiffness(2) = [2.0e6_wp, 5.0e5_wp]
    real(wp) :: mean(2)
    integer :: s
    character(20), parameter :: solvers(2) = [character(20) :: 'dynamic_relaxation', &
      & 'conjugate_gradient']

    do s = 1, 2
      call box_scene([12, 6], spacing, 0.3_wp, scene)
      deallocate (scene%loads)
      allocate (scene%loads(2))
      scene%loads(1)%side = 'x_min'
      scene%loads(1)%stiffness(:2) = stiffness
      scene%loads(2)%side = 'x_max'
      scene%loads(2)%force(1) = force
      scene%loads(2)%force(2) = force/20
      scene%time%method = 'relaxation'
      scene%relaxation%solver = solvers(s)
      call complete_scene(scene, fault)
      if (.not. allocated(fault)) call ready(scene, set_up, error)
      if (allocated(error)) return
      if (.not. allocated(fault)) call move(set_up%system, set_up%plan, diary, fault)
      if (allocated(fault)) then
        call test_failed(error, trim(solvers(s))//': '//fault%message)
        return
      end if
      associate (body => set_up%system%body, u => set_up%system%state%u)
        mean = sum(u(pack(body%slot, body%x(body%slot, 1) < spacing), :), 1)/6
      end associate
      call expect_close(error, mean*stiffness/force, [1.0_wp, 0.05_wp], 1.0e-3_wp, trim(solvers(s)))
    end do
  end subroutine test_springs

  !> A pulse 20 spacings wide at half its height runs into an absorbing layer. Less than 5 % of its
  !> amplitude, 0.25 % of its energy, comes back: in a bar all energy that is left in the end, in a
  !> plate that is too wide for its long sides to matter in that time the velocity on its axis. What
  !> is gone was dissipated.
  subroutine test_absorbing(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    character(6), parameter :: corrections(2) = [character(6) :: 'energy', 'none']
    real(wp), parameter :: width = 8.5_wp*spacing
    real(wp) :: c, dt, x, whole, left
    integer :: k, dim, n, i

    do i = 1, 4
      dim = (i + 1)/2
      n = merge(120, 100, dim == 1)
      if (dim == 1) call box_scene([n], spacing, 0.2_wp, scene)
      if (dim == 2) call box_scene([n, 160], spacing, 0.25_wp, scene)
      scene%horizon%surface_correction = corrections(modulo(i, 2) + 1)
      deallocate (scene%boundaries)
      allocate (scene%boundaries(1))
      scene%boundaries(1)%side = 'x_max'
      scene%boundaries(1)%absorbing = .true.
      scene%time%safety = 0.6_wp
      call complete_scene(scene, fault)
      if (.not. allocated(fault)) call ready(scene, set_up, error)
      if (allocated(error)) return
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      diary = diary_type()
      associate (system => set_up%system)
        c = longitudinal_speed(system%model%materials(1))
        dt = set_up%plan%step
        do k = 1, system%body%n_slots
          if (system%body%point(k) == 0) cycle
          x = (system%body%x(k, 1) - 0.55_wp*n*spacing)/width
          system%state%u(k, 1) = 1.0e-8_wp*exp(-x**2/2)
          system%state%v(k, 1) = system%state%u(k, 1)*x*c/width
        end do
        diary%every = 1000
        call run_explicit(system, 'forward_backward', dt, nint(merge(0.9_wp, 0.75_wp, dim == 1) &
          & *n*spacing/(c*dt)), diary, fault)
        if (allocated(fault)) then
          call test_failed(error, fault%message)
          return
        end if
        whole = diary%kinetic(1) + diary%strain(1)
        left = diary%kinetic(diary%n) + diary%strain(diary%n)
        if (dim == 1) then
          call expect_true(error, left < 0.05_wp**2*whole, 'in a bar, '// &
            & trim(corrections(modulo(i, 2) + 1))//': '//text_of(left/whole))
        else
          left = 0.0_wp
          do k = 20, n - 5
            x = abs(system%state%v(at_point(system%body, [k*spacing, 80*spacing]), 1))
            left = max(left, x)
          end do
          left = left/(1.0e-8_wp*exp(-0.5_wp)*c/width)
          call expect_true(error, left < 0.05_wp, 'in the plane, '// &
            & trim(corrections(modulo(i, 2) + 1))//': '//text_of(left))
        end if
        call expect(error, (diary%kinetic(diary%n) + diary%strain(diary%n) &
          & + diary%dissipated(diary%n))/whole, 1.0_wp, 1.0e-2_wp, 'energy balance')
      end associate
    end do
  end subroutine test_absorbing

  !> What contradicts itself is refused at its key.
  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: i
    character(40), parameter :: texts(7) = [character(40) :: "boundary with 'name'", &
      & "boundary with 'displacement_x'", "boundary with 'absorbing'", "'stiffness' is negative", &
      & "'stiffness' has too few values", 'springs with a course', "'gravity' has too many values"]

    do i = 1, size(texts)
      call box_scene([12, 6], spacing, 0.3_wp, scene)
      deallocate (scene%loads, scene%boundaries)
      allocate (scene%loads(merge(1, 0, i > 3 .and. i < 7)), scene%boundaries(merge(1, 0, i < 4)))
      scene%boundaries%side = 'x_max'
      scene%boundaries%absorbing = .true.
      scene%loads%side = 'x_max'
      select case (i)
      case (1); scene%boundaries(1)%name = 'end'
      case (2); scene%boundaries(1)%displacement(1) = 0.0_wp
      case (3); scene%time%method = 'relaxation'
      case (4); scene%loads(1)%stiffness(:2) = [1.0_wp, -1.0_wp]
      case (5); scene%loads(1)%stiffness(1) = 1.0_wp
      case (6)
        scene%loads(1)%stiffness(:2) = 1.0_wp
        scene%loads(1)%ramp_time = 1.0_wp
      case default; scene%header%gravity = 9.81_wp
      end select
      if (i == 3) scene%time%steps = 0
      call complete_scene(scene, fault)
      if (.not. allocated(fault)) then
        call test_failed(error, 'accepted: '//texts(i))
        return
      end if
      call expect_true(error, index(fault%message, trim(texts(i))) > 0, trim(texts(i))//': '// &
        & fault%message)
      if (allocated(error)) return
    end do
  end subroutine test_refused

end module test_set_up_terms
