!> Growth in statics by events, against the closed form of a chain, against a chain whose bonds
!> break one by one in equations that are solved directly, and in symmetric plates.
module test_motion_static_events
  use pd_base_kinds, only: wp, i8
  use pd_base_error, only: fault_type => error_type, status_input
  use pd_family_family, only: bonds_type, allocate_bonds
  use pd_motion_observer, only: observer_type, instant_type
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_motion_account, only: energies_of, energies_type
  use pd_motion_system, only: greatest_ratio, system_type
  use pd_scene_content_types, only: scene_type, unset
  use pd_set_up_prepare, only: set_up_type
  use elimination, only: eliminate
  use comparisons, only: expect_close
  use testdrive, only: error_type, new_unittest, unittest_type, test_failed
  use bodies, only: at_point, box_scene, expect, expect_true, prepare_run, ready, ready_alone, &
    & text_of
  implicit none (type, external)
  private
  public :: collect_motion_static_events

  real(wp), parameter :: spacing = 1.0e-2_wp

  !> Keeps every settled equilibrium, a row each.
  type, extends(observer_type) :: curve_type
    integer :: n = 0
    real(wp), allocatable :: factor(:), ratio(:), broken(:), events(:), strain(:), work(:)
    logical, allocatable :: between(:)
    character(:), allocatable :: notes
  contains
    procedure :: observe
  end type curve_type

contains

  subroutine collect_motion_static_events(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('the weakest bond of a chain breaks at its load factor', test_chain), &
      & new_unittest('a chain snaps back as its equations say', test_snap_back), &
      & new_unittest('what is released is the area between two responses', test_released), &
      & new_unittest('curves do not depend on load steps', test_load_steps), &
      & new_unittest('mirror twins break together', test_twins), &
      & new_unittest('a wider batch breaks more at once', test_batch), &
      & new_unittest('a body that comes apart ends the run', test_apart), &
      & new_unittest('heat in proportion to the load factor breaks bonds', test_heat), &
      & new_unittest('what is not proportional is refused by name', test_refused)]
  end subroutine collect_motion_static_events

  !> Keep a row.
  subroutine observe(observer, system, instant, error)
    class(curve_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error
    type(energies_type) :: energies

    if (allocated(error)) return
    if (.not. allocated(observer%factor)) then
      allocate (observer%factor(0), observer%ratio(0), observer%broken(0), observer%events(0), &
        & observer%strain(0), observer%work(0), observer%between(0))
      observer%notes = ''
    end if
    if (allocated(instant%note)) observer%notes = observer%notes//instant%note
    if (.not. instant%settled) return
    call energies_of(system, system%state%v, energies)
    observer%n = observer%n + 1
    observer%factor = [observer%factor, instant%time]
    observer%ratio = [observer%ratio, greatest_ratio(system)]
    observer%broken = [observer%broken, real(system%broken, wp)]
    observer%events = [observer%events, real(instant%events, wp)]
    observer%strain = [observer%strain, energies%strain]
    observer%work = [observer%work, system%external_work]
    observer%between = [observer%between, instant%between]
  end subroutine observe

  !> Run a scene by events.
  subroutine grow(scene, set_up, curve, error)
    type(scene_type), intent(in) :: scene
    type(set_up_type), intent(out) :: set_up
    type(curve_type), intent(out) :: curve
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    call expect_true(error, set_up%plan%relaxation%events, 'it is not by events')
    if (allocated(error)) return
    call run_relaxation(set_up%system, set_up%plan%relaxation, curve, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine grow

  !> A chain between layers, drawn apart by `strain` of its length; bonds within `zone` of its ends
  !> do not break.
  subroutine chain(points, ratio, zone, strain, scene)
    integer, intent(in) :: points
    real(wp), intent(in) :: ratio   !! horizon over spacing
    real(wp), intent(in) :: zone    !! [spacings]
    real(wp), intent(in) :: strain
    type(scene_type), intent(out) :: scene

    call box_scene([points], spacing, 0.3_wp, scene)
    scene%horizon%ratio = ratio
    deallocate (scene%boundaries, scene%no_fail)
    allocate (scene%boundaries(2), scene%no_fail(2))
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%displacement(1) = 0.0_wp
    scene%boundaries(2)%side = 'x_max'
    scene%boundaries(2)%displacement(1) = strain*points*spacing
    scene%materials(1)%critical_stretch = 0.01_wp
    scene%no_fail%shape = 'box'
    scene%no_fail(1)%upper(1) = zone*spacing
    scene%no_fail(2)%lower(1) = (points - zone)*spacing
    scene%time%method = 'relaxation'
    scene%relaxation%tolerance = 1.0e-9_wp
  end subroutine chain

  !> 10 points and a layer point at each end, bonds to the next points alone: 11 equal springs, of
  !> which only the middle one can break. It is at s_c when the ends have been drawn 11 s_c spacings
  !> apart, whatever the load steps; then nothing is left of the strain.
  subroutine test_chain(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(curve_type) :: curve
    integer :: load_steps, at

    do load_steps = 1, 4, 3
      call chain(10, 1.015_wp, 4.0_wp, 0.03_wp, scene)
      scene%relaxation%load_steps = load_steps
      call grow(scene, set_up, curve, error)
      if (allocated(error)) return
      at = findloc(curve%between, .true., dim=1)
      call expect_true(error, at > 0, 'no event')
      if (allocated(error)) return
      ! the solver's tolerance, and that of being at the limit, which is ten times as large
      call expect(error, curve%factor(at), 0.01_wp*11/(0.03_wp*10), 2.0e-8_wp, 'load factor')
      call expect(error, curve%ratio(at), 1.0_wp, 1.0e-8_wp, 'stretch over its limit')
      call expect(error, curve%broken(at), 0.0_wp, 0.0_wp, 'bonds broken before')
      call expect(error, curve%broken(at + 1), 1.0_wp, 0.0_wp, 'bonds broken after')
      call expect(error, curve%factor(at + 1), curve%factor(at), 0.0_wp, 'load factor after')
      call expect(error, curve%strain(at + 1), 0.0_wp, 1.0e-12_wp*curve%strain(at), 'strain energy')
      ! one at the limit, one after breaking, the start and the load steps
      call expect(error, real(curve%n, wp), load_steps + 3.0_wp, 0.0_wp, 'equilibria')
      call expect(error, curve%factor(curve%n), 1.0_wp, 0.0_wp, 'the end')
    end do
  end subroutine test_chain

  !> Load factors at which the bonds of a chain break one batch after the other, and how much work
  !> the ends do per square of the load factor [J], by elimination: in 1D forces are linear in the
  !> displacements, whatever their size.
  subroutine solve_chain(system, ends, batch, events, factors, works, error)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: ends            !! displacement of the right layer at factor 1 [m]
    real(wp), intent(in) :: batch
    integer, intent(out) :: events
    real(wp), intent(out) :: factors(:), works(:)
    type(error_type), allocatable, intent(inout) :: error
    type(bonds_type) :: bonds
    real(wp), allocatable :: spring(:, :), distance(:, :), K(:, :), x(:), u(:), ratio(:, :)
    integer, allocatable :: free(:)
    real(wp) :: limit, most
    integer :: n, i, j, b
    logical :: singular

    n = system%body%n_points
    allocate (spring(n, n), distance(n, n), ratio(n, n), source=0.0_wp)
    call allocate_bonds(system%family, bonds)
    do i = 1, n
      call system%family%bonds_of(system%body%slot(i), bonds)
      do b = 1, bonds%n
        j = int(system%body%point(bonds%j(b)))
        ! force between the points per difference of their displacements
        spring(i, j) = 2*system%model%materials(1)%q*bonds%weight(b)/bonds%length(b) &
          & *system%body%volume(system%body%slot(i))
        distance(i, j) = bonds%length(b)
      end do
    end do
    call expect_true(error, .not. system%model%dilatation, 'the chain has a dilatation')
    free = pack([(i, i=1, n)], system%held(system%body%slot(:n), 1) == 0)
    allocate (u(n), source=0.0_wp)
    where (system%body%x(system%body%slot(:n), 1) > maxval(system%body%x(system%body%slot(free), &
      & 1))) u = ends
    events = 0
    do while (events < size(factors))
      K = -spring(free, free)
      x = [(0.0_wp, i=1, size(free))]
      do i = 1, size(free)
        K(i, i) = sum(spring(free(i), :))
        do j = 1, n
          if (any(free == j)) cycle
          x(i) = x(i) + spring(free(i), j)*u(j)
        end do
      end do
      call eliminate(K, x, singular)
      if (singular) exit
      u(free) = x
      ratio = 0.0_wp
      do i = 1, n
        do j = 1, n
          if (.not. spring(i, j) > 0.0_wp) cycle
          limit = min(system%model%critical(system%body%slot(i)), &
            & system%model%critical(system%body%slot(j)))
          if (limit < 0.0_wp) cycle  ! no-fail
          ratio(i, j) = (u(j) - u(i))*sign(1.0_wp, system%body%x(system%body%slot(j), 1) &
            & - system%body%x(system%body%slot(i), 1))/distance(i, j)/limit
        end do
      end do
      most = maxval(ratio)
      if (most < 1.0e-6_wp) exit
      events = events + 1
      factors(events) = 1/most
      works(events) = 0.0_wp
      do i = 1, n
        works(events) = works(events) + sum(spring(i, :)*(u - u(i))**2)/4
      end do
      where (ratio >= most*(1 - batch)) spring = 0.0_wp
    end do
  end subroutine solve_chain

  !> A chain with bonds to the next two points, which loses them in its middle one after the other:
  !> load factors, up and down, are those of the equations.
  subroutine test_snap_back(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up, other
    type(curve_type) :: curve
    real(wp) :: factors(20), works(20)
    integer :: i, events, at

    call chain(14, 2.015_wp, 5.0_wp, 0.03_wp, scene)
    scene%relaxation%control = 'dissipation'
    call ready(scene, other, error)
    if (allocated(error)) return
    call solve_chain(other%system, 0.03_wp*14*spacing, 1.0e-6_wp, events, factors, works, error)
    call grow(scene, set_up, curve, error)
    if (allocated(error)) return
    call expect_true(error, events >= 3, 'few events: '//text_of(real(events, wp)))
    call expect_true(error, any(factors(2:events) < factors(:events - 1)), 'it does not snap back')
    call expect(error, real(count(curve%between), wp), real(events, wp), 0.0_wp, 'events')
    if (allocated(error)) return
    at = 0
    do i = 1, curve%n
      if (.not. curve%between(i)) cycle
      at = at + 1
      call expect(error, curve%factor(i), factors(at), 2.0e-8_wp*factors(at), &
        & 'load factor of event')
      call expect(error, curve%strain(i), works(at)*factors(at)**2, 1.0e-6_wp*works(1) &
        & *factors(1)**2, 'strain energy at event')
    end do
  end subroutine test_snap_back

  !> In a linear body, external work less the change of strain energy between two equilibria at
  !> which bonds reach their limit is the area of the triangle between the two responses:
  !> (r1 d2 - r2 d1)/2 with reactions r and displacements d.
  subroutine test_released(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up, other
    type(curve_type) :: curve
    integer, allocatable :: rows(:)
    real(wp) :: factors(20), works(20), released
    integer :: i, events

    call chain(14, 2.015_wp, 5.0_wp, 0.03_wp, scene)
    scene%relaxation%control = 'dissipation'
    call ready(scene, other, error)
    if (allocated(error)) return
    call solve_chain(other%system, 0.03_wp*14*spacing, 1.0e-6_wp, events, factors, works, error)
    call grow(scene, set_up, curve, error)
    if (allocated(error)) return
    rows = pack([(i, i=1, curve%n)], curve%between)
    call expect_true(error, size(rows) >= 2, 'few events')
    if (allocated(error)) return
    do i = 2, size(rows)
      released = curve%work(rows(i)) - curve%work(rows(i - 1)) - curve%strain(rows(i)) &
        & + curve%strain(rows(i - 1))
      ! reaction times displacement is twice the work
      call expect(error, released, factors(i)*factors(i - 1)*(works(i - 1) - works(i)), &
        & 1.0e-6_wp*works(1)*factors(1)**2, 'released energy')
      call expect_true(error, released > 0.0_wp, 'growth costs nothing')
    end do
  end subroutine test_released

  !> A plate with a notch, symmetric, drawn apart.
  subroutine notched(scene)
    type(scene_type), intent(out) :: scene
    integer :: i

    call box_scene([12, 12], spacing, 0.3_wp, scene)
    deallocate (scene%cracks, scene%boundaries)
    allocate (scene%cracks(1), scene%boundaries(2))
    scene%cracks(1)%from(:2) = [-1.0_wp, 6.0_wp]*spacing
    scene%cracks(1)%to(:2) = [4.0_wp, 6.0_wp]*spacing
    scene%materials(1)%critical_stretch = 0.01_wp
    do i = 1, 2
      scene%boundaries(i)%side = merge('y_min', 'y_max', i == 1)
      scene%boundaries(i)%displacement(2) = merge(-1, 1, i == 1)*0.1_wp*spacing
    end do
    scene%time%method = 'relaxation'
    scene%relaxation%tolerance = 1.0e-6_wp
  end subroutine notched

  !> Load factors and broken bonds at the events are the same with one load step and with nine, to
  !> the accuracy with which bonds are at their limit.
  subroutine test_load_steps(error)
    type(error_type), allocatable, intent(out) :: error
    character(11), parameter :: controls(2) = [character(11) :: 'load', 'dissipation']
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(curve_type) :: once, often
    real(wp), allocatable :: one(:), other(:)
    integer :: way

    do way = 1, 2
      if (allocated(error)) return
      call notched(scene)
      scene%relaxation%control = controls(way)
      scene%relaxation%most_events = 12
      call grow(scene, set_up, once, error)
      if (allocated(error)) return
      scene%relaxation%load_steps = 9
      call grow(scene, set_up, often, error)
      if (allocated(error)) return
      one = pack(once%broken, once%between)
      other = pack(often%broken, often%between)
      call expect_true(error, size(one) > 12 .and. size(one) == size(other), 'events: '// &
        & text_of(real(size(one), wp))//', '//text_of(real(size(other), wp)))
      if (allocated(error)) return
      call expect_close(error, one, other, 0.0_wp, 'broken bonds')
      one = pack(once%factor, once%between)
      other = pack(often%factor, often%between)
      call expect_close(error, one/other, 1.0_wp, 3.0e-5_wp, 'load factors')
      if (way == 1) call expect_true(error, all(one(2:) >= one(:size(one) - 1)), &
        & 'the load factor decreases')
      if (way == 2) call expect_true(error, any(one(2:) < one(:size(one) - 1)), &
        & 'the load factor never decreases')
      if (way == 2) call expect_true(error, all(abs(pack(once%ratio, once%between) - 1) <= &
        & 1.0e-5_wp), 'a bond is not at its limit')
    end do
  end subroutine test_load_steps

  !> The damage of a symmetric plate is symmetric after every number of events.
  subroutine test_twins(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(curve_type) :: curve
    integer :: i, k, mirrored

    call notched(scene)
    scene%relaxation%control = 'dissipation'
    scene%relaxation%most_events = 7
    call grow(scene, set_up, curve, error)
    if (allocated(error)) return
    call expect_true(error, set_up%system%broken > 7_i8, 'no twins')
    associate (body => set_up%system%body, damage => set_up%system%state%damage)
      do i = 1, body%n_points
        k = body%slot(i)
        mirrored = at_point(body, [body%x(k, 1), 12*spacing - body%x(k, 2)])
        call expect(error, damage(k), damage(mirrored), 1.0e-14_wp, 'damage of the mirror image')
      end do
    end associate
  end subroutine test_twins

  !> With a batch of 0.3 the same bonds take fewer events.
  subroutine test_batch(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(curve_type) :: fine, coarse
    real(wp) :: per_event(2)

    call notched(scene)
    scene%relaxation%control = 'dissipation'
    scene%relaxation%most_events = 6
    call grow(scene, set_up, fine, error)
    if (allocated(error)) return
    scene%relaxation%batch = 0.3_wp
    call grow(scene, set_up, coarse, error)
    if (allocated(error)) return
    per_event = [fine%broken(fine%n)/fine%events(fine%n), coarse%broken(coarse%n) &
      & /coarse%events(coarse%n)]
    call expect_true(error, per_event(2) > 2*per_event(1), 'bonds per event: '// &
      & text_of(per_event(1))//', '//text_of(per_event(2)))
    ! the first bond is the same one
    call expect(error, coarse%factor(2), fine%factor(2), 1.0e-5_wp*fine%factor(2), 'first event')
  end subroutine test_batch

  !> A chain drawn by a force at its free end: what is left after its bond has broken bears no load
  !> but 0, and the run says so and ends. With the load controlled there is no equilibrium.
  subroutine test_apart(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(curve_type) :: curve
    type(fault_type), allocatable :: fault

    call chain(10, 1.015_wp, 4.0_wp, 0.0_wp, scene)
    deallocate (scene%loads)
    allocate (scene%loads(1))
    scene%boundaries = scene%boundaries(:1)
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%force(1) = 0.02_wp*200.0e9_wp*3.0e-4_wp
    scene%relaxation%control = 'dissipation'
    call grow(scene, set_up, curve, error)
    if (allocated(error)) return
    call expect(error, curve%factor(curve%n), 0.0_wp, 0.0_wp, 'load factor at the end')
    call expect(error, curve%strain(curve%n), 0.0_wp, 0.0_wp, 'strain energy at the end')
    call expect(error, curve%broken(curve%n), 1.0_wp, 0.0_wp, 'broken bonds')
    call expect_true(error, index(curve%notes, 'come apart') > 0, 'notes: '//curve%notes)
    scene%relaxation%control = 'load'
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    call run_relaxation(set_up%system, set_up%plan%relaxation, curve, fault)
    call expect_true(error, allocated(fault), 'a torn chain bears a load')
  end subroutine test_apart

  !> The chain, held at both ends and cooled: its mechanical stretch is -alpha dT of the whole
  !> length over the length between the layers' points that bear it.
  subroutine test_heat(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(curve_type) :: curve
    integer :: at

    call chain(10, 1.015_wp, 4.0_wp, 0.0_wp, scene)
    scene%materials(1)%thermal_expansion = 1.0e-4_wp
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%temperature_change = -150.0_wp
    call grow(scene, set_up, curve, error)
    if (allocated(error)) return
    at = findloc(curve%between, .true., dim=1)
    call expect_true(error, at > 0, 'no event')
    if (allocated(error)) return
    ! every bond would shrink by 0.015 and none can
    call expect(error, curve%factor(at), 0.01_wp/0.015_wp, 1.0e-7_wp, 'load factor')
  end subroutine test_heat

  !> Scenes whose conditions are not proportional to the load factor grow after load steps, and are
  !> refused if they ask for events or their control.
  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    integer :: number

    do number = 1, 5
      if (allocated(error)) return
      call notched(scene)
      select case (number)
      case (1)
        scene%boundaries(1)%displacement(2) = unset
        scene%boundaries(1)%displacement_text(2) = '-1e-4*t^2'
        call expect_refused('expression of t')
      case (2)
        scene%boundaries(2)%ramp_time = 0.5_wp
        call expect_refused('displacement of a boundary is not proportional')
      case (3)
        deallocate (scene%loads)
        allocate (scene%loads(1))
        scene%loads(1)%side = 'x_max'
        scene%loads(1)%pressure = 1.0e5_wp
        scene%loads(1)%times = [0.0_wp, 1.0_wp]
        scene%loads(1)%values = [0.5_wp, 1.0_wp]
        call expect_refused('load is not proportional')
      case (4)
        deallocate (scene%initial)
        allocate (scene%initial(1))
        scene%materials(1)%thermal_expansion = 1.0e-5_wp
        scene%initial(1)%temperature_change = 10.0_wp
        scene%initial(1)%times = [0.0_wp, 1.0_wp]
        scene%initial(1)%values = [1.0_wp, 1.0_wp]
        call expect_refused('temperature change')
      case default
        scene%relaxation%growth = 'load_steps'
        scene%relaxation%control = 'dissipation'
        call expect_fault('needs growth by events')
      end select
    end do

  contains

    subroutine expect_refused(words)
      character(*), intent(in) :: words

      call ready(scene, set_up, error)
      if (allocated(error)) return
      call expect_true(error, .not. set_up%plan%relaxation%events, 'it grows by events: '//words)
      scene%relaxation%control = 'dissipation'
      call expect_fault(words)
      scene%relaxation%control = 'load'
      scene%relaxation%growth = 'events'
      call expect_fault(words)
    end subroutine expect_refused

    subroutine expect_fault(words)
      character(*), intent(in) :: words
      type(fault_type), allocatable :: fault

      call prepare_run(scene, set_up, fault)
      call expect_true(error, allocated(fault), 'accepted: '//words)
      if (allocated(error)) return
      call expect_true(error, fault%status == status_input .and. index(fault%message, words) > 0, &
        & fault%message)
    end subroutine expect_fault
  end subroutine test_refused

end module test_motion_static_events
