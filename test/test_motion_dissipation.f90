!> What breaking bonds dissipate in motion (doc/theory.md, 9): the balance of energy of bodies that
!> break, against the invariant of leapfrog and by its order in the step.
module test_motion_dissipation
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_error, only: fault_type => error_type
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_observer, only: observer_type, instant_type
  use pd_motion_account, only: energies_type, energies_of, velocities_now
  use pd_motion_system, only: system_type, add_loads, inverse_density
  use pd_scene_content_types, only: scene_type
  use comparisons, only: max_abs
  use testdrive, only: error_type, new_unittest, unittest_type, test_failed
  use bodies, only: box_scene, expect, expect_true, ready, text_of
  use runs, only: ready_text
  implicit none (type, external)
  private
  public :: collect_motion_dissipation

  real(wp), parameter :: spacing = 1.0e-3_wp
  character(*), parameter :: nl = new_line('a')
  character(7), parameter :: families(2) = [character(7) :: 'lattice', 'list']
  character(13), parameter :: orders(2) = [character(13) :: 'before_forces', 'after_forces']
  character(16), parameter :: integrators(5) = [character(16) :: 'forward_backward', &
    & 'velocity_verlet', 'adams_bashforth', 'adams_moulton', 'runge_kutta']

  !> Keeps, for every step, how far the energies are from what was there and has been supplied.
  type, extends(observer_type) :: balance_type
    integer :: n = 0
    real(wp), allocatable :: gap(:)         !! kinetic + strain + dissipated - work [J]
    real(wp), allocatable :: invariant(:)   !! the same without dt^2/8 sum rho V a^2 [J]
    integer(i8), allocatable :: broken(:)   !! bonds broken so far
  contains
    procedure :: observe
  end type balance_type

contains

  subroutine collect_motion_dissipation(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('leapfrog''s invariant holds to rounding while bonds break', test_invariant), &
      & new_unittest('long: the balance closes at second order for every body', &
      & test_bodies), &
      & new_unittest('long: the balance closes at second order with every integrator', &
      & test_integrators), &
      & new_unittest('a bond that breaks at the start loses its energy at fixed displacements', &
      & test_start), &
      & new_unittest('what breaks by cooling loses the work of the temperature', test_cooling), &
      & new_unittest('the same bits on any number of threads', test_threads)]
  end subroutine collect_motion_dissipation

  !> A row of the balance at every step.
  subroutine observe(observer, system, instant, error)
    class(balance_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error
    type(energies_type) :: energies
    real(wp), allocatable :: v(:, :), a(:, :)
    real(wp) :: squares
    integer :: c, k

    if (allocated(error)) return
    call velocities_now(system, instant%time, instant%kick, v)
    call energies_of(system, v, energies)
    allocate (a, source=system%state%force)
    call add_loads(system, instant%time, 1.0_wp, .false., a)
    where (system%held == 1_i1) a = 0.0_wp
    squares = 0.0_wp
    do c = 1, system%body%dim
      do k = 1, system%body%n_slots
        squares = squares + a(k, c)**2*system%body%volume(k)*inverse_density(system%model, k)
      end do
    end do
    if (.not. allocated(observer%gap)) allocate (observer%gap(0), observer%invariant(0), &
      & observer%broken(0))
    observer%n = observer%n + 1
    observer%gap = [observer%gap, energies%kinetic + energies%strain + system%dissipated &
      & - system%external_work]
    observer%invariant = [observer%invariant, observer%gap(observer%n) &
      & - instant%dt**2/8*squares]
    observer%broken = [observer%broken, system%broken]
  end subroutine observe

  !> A body of `dim` dimensions that is pulled apart from both ends along x, faster and faster, and
  !> pressed from one side, so that bonds break within it and at the points that are held.
  subroutine pulled_body(dim, poissons_ratio, critical, speed, scene)
    integer, intent(in) :: dim
    real(wp), intent(in) :: poissons_ratio
    real(wp), intent(in) :: critical  !! stretch [-]
    real(wp), intent(in) :: speed     !! of each end, in the end [m/s]
    type(scene_type), intent(out) :: scene
    integer, parameter :: points(3, 3) = reshape([40, 0, 0, 16, 9, 0, 7, 4, 4], [3, 3])

    call box_scene(points(:dim, dim), spacing, poissons_ratio, scene)
    scene%materials(1)%critical_stretch = critical
    scene%horizon%dilatation = 'unprojected'
    scene%horizon%surface_correction = 'energy'
    deallocate (scene%boundaries)
    allocate (scene%boundaries(2))
    scene%boundaries%side = [character(5) :: 'x_min', 'x_max']
    scene%boundaries(1)%velocity(1) = -speed
    scene%boundaries(2)%velocity(1) = speed
    scene%boundaries(2)%ramp_time = 2.0e-6_wp
    if (dim == 1) return
    deallocate (scene%loads)
    allocate (scene%loads(1))
    scene%loads(1)%side = 'y_max'
    scene%loads(1)%pressure = 0.1_wp*critical*scene%materials(1)%youngs_modulus
    scene%loads(1)%ramp_time = 1.0e-6_wp
  end subroutine pulled_body

  !> Run a scene for `time` [s] in steps of `part` of the stable one.
  subroutine run(scene, integrator, part, time, balance, set_up, error)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: integrator
    real(wp), intent(in) :: part, time
    type(balance_type), intent(out) :: balance
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: timed
    type(fault_type), allocatable :: fault
    integer :: steps

    timed = scene
    timed%time%integrator = integrator
    call ready(timed, set_up, error)
    if (allocated(error)) return
    steps = max(1, nint(time/(part*set_up%plan%limit)))
    call run_explicit(set_up%system, integrator, time/steps, steps, balance, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine run

  !> For linear forces leapfrog keeps T + U + D - W - dt^2/8 sum rho V a^2 exactly, with any loads
  !> and imposed motion and whatever breaks, if and only if D is summed with the products of the
  !> stretches of the two instants between which a bond goes. At stretches of 1e-9 the geometry is
  !> linear to 1e-9, and forces and places are rounded at 1e-13 of themselves, over 100 steps. With
  !> the squares the sum is off by 2 to 20 % of D.
  subroutine test_invariant(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(balance_type) :: balance
    real(wp) :: off
    integer :: dim, f, o, state_based

    call omp_set_num_threads(1)  ! more would wait for each other in bodies this small
    do dim = 1, 3
      do f = 1, size(families)
        do o = 1, size(orders)
          do state_based = 0, merge(0, 1, dim == 1)
            call pulled_body(dim, merge(0.42_wp, merge(0.25_wp, 1.0_wp/3, dim == 3), &
              & state_based == 1), 1.0e-9_wp, 1.2e-5_wp, scene)
            scene%horizon%family = families(f)
            scene%time%breaking = orders(o)
            call run(scene, 'forward_backward', 0.8_wp, 8.0e-6_wp, balance, set_up, error)
            if (allocated(error)) return
            associate (D => set_up%system%dissipated, what => text_of(real(dim, wp))//' ' &
              & //families(f)//orders(o)//text_of(real(state_based, wp)))
              call expect_true(error, balance%broken(balance%n) > 3*dim**2 .and. D > 0.0_wp, &
                & 'hardly anything broke: '//what)
              off = max_abs(balance%invariant - balance%invariant(1))/D
              call expect(error, off, 0.0_wp, 1.0e-7_wp, 'invariant over dissipated: '//what)
              call expect_true(error, all(abs(balance%invariant) < huge(off)), 'finite: '//what)
            end associate
          end do
        end do
      end do
    end do
  end subroutine test_invariant

  !> The gap of the balance (root mean square of all steps) over what was dissipated, at 0.8, 0.4
  !> and 0.2 of the stable step: at most a few per cent at 0.8, and of second order between 0.4 and
  !> 0.2. Which bonds break when differs from step to step, so that the order is met to 0.5; with
  !> the squares it is 1.0.
  subroutine test_bodies(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    integer :: dim, o, state_based

    call omp_set_num_threads(1)
    do dim = 1, 3
      do o = 1, size(orders)
        do state_based = 0, merge(0, 1, dim == 1)
          call pulled_body(dim, merge(0.42_wp, merge(0.25_wp, 1.0_wp/3, dim == 3), &
            & state_based == 1), 1.0e-3_wp, 12.0_wp, scene)
          scene%horizon%family = families(o)
          scene%time%breaking = orders(o)
          call measure_order(scene, 'forward_backward', 0.03_wp, error)
        end do
      end do
    end do
  end subroutine test_bodies

  !> The same for the other integrators. Adams-Bashforth and Adams-Moulton take energy out of fast
  !> waves by themselves, so their gap at 0.8 is larger.
  subroutine test_integrators(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    integer :: i, o

    call omp_set_num_threads(1)
    do i = 2, size(integrators)
      do o = 1, size(orders)
        call pulled_body(2, 0.42_wp, 1.0e-3_wp, 12.0_wp, scene)
        scene%time%breaking = orders(o)
        call measure_order(scene, trim(integrators(i)), 0.06_wp, error)
      end do
    end do
  end subroutine test_integrators

  !> Fail unless the gap is at most `most` of what was dissipated at 0.8 of the limit, and of second
  !> order.
  subroutine measure_order(scene, integrator, most, error)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: integrator
    real(wp), intent(in) :: most
    type(error_type), allocatable, intent(inout) :: error
    type(set_up_type) :: set_up
    type(balance_type) :: balance
    real(wp) :: gap(3)
    integer :: s

    do s = 1, 3
      call run(scene, integrator, 0.8_wp/2**(s - 1), 8.0e-6_wp, balance, set_up, error)
      if (allocated(error)) return
      call expect_true(error, balance%broken(balance%n) > 3*set_up%system%body%dim**2, &
        & 'hardly anything broke')
      gap(s) = norm2(balance%gap - balance%gap(1))/sqrt(real(balance%n, wp)) &
        & /set_up%system%dissipated
    end do
    call expect(error, gap(1), 0.0_wp, most, 'gap at 0.8, '//integrator)
    call expect_true(error, log(gap(2)/gap(3))/log(2.0_wp) >= 1.5_wp, 'order of the gap, ' &
      & //integrator//' '//trim(scene%time%breaking)//': '//text_of(gap(2))//', '//text_of(gap(3)))
  end subroutine measure_order

  !> Before t = 0 there is no other instant: what breaks at the start loses W at fixed u.
  subroutine test_start(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(balance_type) :: balance
    type(energies_type) :: energies
    integer :: i

    do i = 1, size(integrators)
      call box_scene([9, 8], spacing, 0.2_wp, scene)
      scene%materials(1)%critical_stretch = 1.0e-3_wp
      deallocate (scene%initial)
      allocate (scene%initial(1))
      scene%initial(1)%displacement_gradient(1, 1) = 1.5e-3_wp
      scene%initial(1)%velocity_gradient(1, 1) = 1.0e3_wp
      call ready(scene, set_up, error)
      if (allocated(error)) return
      call energies_of(set_up%system, set_up%system%state%v, energies)
      call run(scene, trim(integrators(i)), 0.1_wp, 1.0e-9_wp, balance, set_up, error)
      if (allocated(error)) return
      call expect_true(error, balance%broken(1) > 20, 'nothing broke at the start')
      call expect(error, balance%gap(1), energies%kinetic + energies%strain, &
        & 1.0e-12_wp*energies%strain, 'energies after and before, '//trim(integrators(i)))
    end do
  end subroutine test_start

  !> A body whose points are held cools until all bonds have broken: nothing moves, so that they
  !> lose the work of the temperature, by steps of any length, integrators and orders, with the
  !> chapter's laws and one on the generic pass.
  subroutine test_cooling(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: models(3) = [character(11) :: 'state_based', 'bond_based', &
      & 'generic']
    character(*), parameter :: keys = ' youngs_modulus = 2e9 density = 1200 '// &
      & 'critical_stretch = 1e-2 thermal_expansion = 2e-5'
    character(*), parameter :: body = '&body lower = 0, 0 upper = 8e-3, 5e-3 points = 8, 5 /'//nl
    character(*), parameter :: other = &
      & "&body lower = 8e-3, 0 upper = 12e-3, 5e-3 points = 4, 5 material = 'B' /"//nl// &
      & "&material name = 'B' influence = 'constant' poissons_ratio = 0.2"//keys//' /'//nl
    character(:), allocatable :: text
    type(set_up_type) :: set_up
    type(balance_type) :: balance
    type(fault_type), allocatable :: fault
    integer :: i, o, m

    do m = 1, size(models)
      text = '&scene dimension = 2 thickness = 1e-3 /'//nl
      select case (models(m))
      case ('state_based')
        text = text//body//'&material poissons_ratio = 0.2'//keys//' /'//nl
      case ('bond_based')
        text = text//body//"&material model = 'bond_based'"//keys//' /'//nl
      case default
        ! two influence functions in one body
        text = text//body(:len(body) - 2)//"material = 'A' /"//nl// &
          & "&material name = 'A' poissons_ratio = 0.2"//keys//' /'//nl//other
      end select
      text = text//"&region name = 'all' shape = 'box' lower = -1, -1 /"//nl// &
        & "&boundary region = 'all' displacement_x = 0 displacement_y = 0 /"//nl// &
        & '&initial temperature_change = -1000 ramp_time = 1e-5 /'//nl
      do i = 1, size(integrators)
        do o = 1, size(orders)
          call ready_text(text//"&time integrator = '"//trim(integrators(i))//"' breaking = '"// &
            & trim(orders(o))//"' step = 1.3e-7 steps = 80 /"//nl, set_up, error)
          if (allocated(error)) return
          call expect_true(error, set_up%system%model%generic .eqv. models(m) == 'generic', &
            & 'not the pass that is to be tested')
          balance = balance_type()
          call run_explicit(set_up%system, trim(integrators(i)), 1.3e-7_wp, 80, balance, fault)
          if (allocated(fault)) call test_failed(error, fault%message)
          if (allocated(error)) return
          call expect_true(error, balance%broken(81) == balance%broken(79) &
            & .and. balance%broken(81) > 200, 'bonds do not break one after another')
          call expect(error, balance%gap(81), 0.0_wp, 1.0e-12_wp*set_up%system%dissipated, &
            & 'balance, '//trim(models(m))//' '//trim(integrators(i))//' '//trim(orders(o)))
        end do
      end do
    end do
  end subroutine test_cooling

  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(balance_type) :: one, many
    integer :: threads, i, o

    threads = omp_get_max_threads()
    do i = 1, size(integrators), 4
      do o = 1, size(orders)
        call pulled_body(2, 0.42_wp, 1.0e-3_wp, 12.0_wp, scene)
        scene%horizon%family = families(o)
        scene%time%breaking = orders(o)
        call omp_set_num_threads(1)
        call run(scene, trim(integrators(i)), 0.8_wp, 8.0e-6_wp, one, set_up, error)
        call omp_set_num_threads(3)
        call run(scene, trim(integrators(i)), 0.8_wp, 8.0e-6_wp, many, set_up, error)
        call omp_set_num_threads(threads)
        if (allocated(error)) return
        call expect_true(error, all(abs(one%gap - many%gap) <= 0.0_wp), 'the bits differ, '// &
          & trim(integrators(i))//' '//orders(o))
      end do
    end do
  end subroutine test_threads

end module test_motion_dissipation
