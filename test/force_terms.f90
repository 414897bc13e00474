!> Terms of the force that only tests know: springs to the ground, dashpots, links between points,
!> friction with a memory, a load; and how tests make and run bodies that have them.
module force_terms
  use omp_lib, only: omp_set_num_threads
  use pd_base_archive, only: archive_type
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_base_snapshot, only: snapshot_type
  use pd_force_term, only: force_term_type, term_view_type, has_tangent, no_stiffness
  use pd_force_terms, only: term_list_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_keep, only: keep_system
  use pd_motion_observer, only: instant_type, observer_type
  use pd_motion_system, only: system_type
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: prepare, set_up_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, test_failed
  use bodies, only: box_scene, density_of_steel, expect_true, shake
  implicit none (type, external)
  private
  public :: spacing, integrators, no_gradient, friction_type, wind_type, keeper_type, ground, &
    & dashpot, ready_with, plate_with, push, run, bare_limit, two_boxes, link, all_terms, shaken, &
    & same_bits

  real(wp), parameter :: spacing = 1.0e-3_wp  !! [m]
  real(wp), parameter :: no_gradient(3, 3) = 0.0_wp
  character(16), parameter :: integrators(*) = [character(16) :: 'forward_backward', &
    & 'velocity_verlet', 'adams_bashforth', 'adams_moulton', 'runge_kutta']

  !> Springs from all points to where they were: the force density is -(s + h |u|^2) u.
  type, extends(force_term_type) :: ground_type
    real(wp) :: s = 0.0_wp         !! [N/m4]
    real(wp) :: h = 0.0_wp         !! [N/m6]
    real(wp) :: farthest = 0.0_wp  !! displacement that is not exceeded [m]
  contains
    procedure :: add_force => ground_force
    procedure :: add_energy => ground_energy
    procedure :: add_stiffness_bound => ground_bound
    procedure :: add_tangent => ground_tangent
    procedure :: keep => ground_keep
    procedure :: describe => ground_describe
  end type ground_type

  !> Dashpots from all points to the ground: -c v. Stores nothing.
  type, extends(force_term_type) :: dashpot_type
    real(wp) :: c = 0.0_wp   !! [N s/m4]
  contains
    procedure :: add_force => dashpot_force
    procedure :: add_energy => dashpot_energy
    procedure :: add_stiffness_bound => dashpot_bound
    procedure :: add_damping_bound => dashpot_damping
    procedure :: keep => dashpot_keep
    procedure :: describe => dashpot_describe
  end type dashpot_type

  !> Springs with friction: -s (u - slip), whose size does not exceed `yield`, component by
  !> component; `slip` is its history.
  type, extends(force_term_type) :: friction_type
    real(wp) :: s = 0.0_wp                !! [N/m4]
    real(wp) :: yield = 0.0_wp            !! [N/m3]
    real(wp), allocatable :: slip(:, :)   !! (n_slots, dim) [m]
  contains
    procedure :: begin => friction_begin
    procedure :: advance => friction_advance
    procedure :: add_force => friction_force
    procedure :: add_energy => friction_energy
    procedure :: add_stiffness_bound => friction_bound
    procedure :: keep => friction_keep
    procedure :: describe => friction_describe
  end type friction_type

  !> A spring of stiffness `k` [N/m] in every direction between two points.
  type, extends(force_term_type) :: link_type
    real(wp) :: k = 0.0_wp
    integer :: one = 0, other = 0   !! numbers of the points
  contains
    procedure :: add_force => link_force
    procedure :: add_energy => link_energy
    procedure :: add_stiffness_bound => link_bound
    procedure :: add_tangent => link_tangent
    procedure :: keep => link_keep
    procedure :: describe => link_describe
  end type link_type

  !> An external force density that grows in time: b t/ramp.
  type, extends(force_term_type) :: wind_type
    real(wp) :: b(3) = 0.0_wp       !! [N/m3]
    real(wp) :: ramp = 1.0_wp       !! [s]
  contains
    procedure :: add_force => wind_force
    procedure :: add_energy => wind_energy
    procedure :: add_stiffness_bound => wind_bound
    procedure :: keep => wind_keep
    procedure :: describe => wind_describe
  end type wind_type

  !> Keeps the system at one step.
  type, extends(observer_type) :: keeper_type
    integer :: step = 0
    type(snapshot_type) :: snapshot
  contains
    procedure :: observe => keep_at_step
  end type keeper_type

contains

  ! ---------------------------------------------------------------- springs to the ground

  subroutine ground_force(self, view, force)
    class(ground_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: force(:, :)
    integer :: k

    !$omp parallel do schedule(static) default(none) shared(self, view, force) private(k)
    do k = 1, size(force, 1)
      if (view%body%point(k) > 0) force(k, :) = force(k, :) &
        & - (self%s + self%h*sum(view%u(k, :)**2))*view%u(k, :)
    end do
  end subroutine ground_force

  subroutine ground_energy(self, view, density)
    class(ground_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: density(:)
    integer :: k

    do k = 1, size(density)
      associate (square => sum(view%u(k, :)**2))
        if (view%body%point(k) > 0) density(k) = density(k) + self%s*square/2 + self%h*square**2/4
      end associate
    end do
  end subroutine ground_energy

  subroutine ground_bound(self, view, bound)
    class(ground_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: bound(:)

    ! h (|u|^2 + 2 u_c u_d) has rows of at most 5 h |u|^2
    where (view%body%point > 0) bound = bound + self%s + 5*self%h*self%farthest**2
  end subroutine ground_bound

  subroutine ground_tangent(self, view, w, kw)
    class(ground_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(in), contiguous :: w(:, :)
    real(wp), intent(inout), contiguous :: kw(:, :)
    integer :: k

    do k = 1, size(w, 1)
      if (view%body%point(k) > 0) kw(k, :) = kw(k, :) &
        & + (self%s + self%h*sum(view%u(k, :)**2))*w(k, :) &
        & + 2*self%h*dot_product(view%u(k, :), w(k, :))*view%u(k, :)
    end do
  end subroutine ground_tangent

  subroutine ground_keep(self, archive)
    class(ground_type), intent(inout) :: self
    class(archive_type), intent(inout) :: archive
    call archive%keep('stiffness of the ground', self%s)
  end subroutine ground_keep

  function ground_describe(self) result(text)
    class(ground_type), intent(in) :: self
    character(:), allocatable :: text
    text = 'springs to the ground'
    if (self%h > 0.0_wp) text = text//' that harden'
  end function ground_describe

  ! ---------------------------------------------------------------- dashpots

  subroutine dashpot_force(self, view, force)
    class(dashpot_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: force(:, :)
    force = force - self%c*view%v
  end subroutine dashpot_force

  !> Nothing is stored.
  subroutine dashpot_energy(self, view, density)
    class(dashpot_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: density(:)
    if (self%c < 0.0_wp) density = density + 0.0_wp*view%u(:, 1)
  end subroutine dashpot_energy

  !> Nothing is stiff.
  subroutine dashpot_bound(self, view, bound)
    class(dashpot_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: bound(:)
    if (self%c < 0.0_wp) bound = bound + 0.0_wp*view%u(:, 1)
  end subroutine dashpot_bound

  subroutine dashpot_damping(self, view, bound)
    class(dashpot_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: bound(:)
    where (view%body%point > 0) bound = bound + self%c
  end subroutine dashpot_damping

  subroutine dashpot_keep(self, archive)
    class(dashpot_type), intent(inout) :: self
    class(archive_type), intent(inout) :: archive
    call archive%keep('damping', self%c)
  end subroutine dashpot_keep

  function dashpot_describe(self) result(text)
    class(dashpot_type), intent(in) :: self
    character(:), allocatable :: text
    text = 'dashpots'
    if (self%c <= 0.0_wp) text = 'no '//text
  end function dashpot_describe

  ! ---------------------------------------------------------------- friction

  subroutine friction_begin(self, view)
    class(friction_type), intent(inout) :: self
    type(term_view_type), intent(in) :: view
    allocate (self%slip, mold=view%u)
    self%slip = 0.0_wp
  end subroutine friction_begin

  !> Where the spring would bear more than the yield, its end slips after it.
  subroutine friction_advance(self, view)
    class(friction_type), intent(inout) :: self
    type(term_view_type), intent(in) :: view
    self%slip = view%u - max(-self%yield/self%s, min(self%yield/self%s, view%u - self%slip))
  end subroutine friction_advance

  subroutine friction_force(self, view, force)
    class(friction_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: force(:, :)
    force = force - max(-self%yield, min(self%yield, self%s*(view%u - self%slip)))
  end subroutine friction_force

  subroutine friction_energy(self, view, density)
    class(friction_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: density(:)
    density = density + sum(max(-self%yield, min(self%yield, self%s*(view%u - self%slip)))**2, 2) &
      & /(2*self%s)
  end subroutine friction_energy

  subroutine friction_bound(self, view, bound)
    class(friction_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: bound(:)
    where (view%body%point > 0) bound = bound + self%s
  end subroutine friction_bound

  subroutine friction_keep(self, archive)
    class(friction_type), intent(inout) :: self
    class(archive_type), intent(inout) :: archive
    call archive%keep('slip', self%slip)
  end subroutine friction_keep

  function friction_describe(self) result(text)
    class(friction_type), intent(in) :: self
    character(:), allocatable :: text
    text = 'friction'
    if (self%s <= 0.0_wp) text = 'no '//text
  end function friction_describe

  ! ---------------------------------------------------------------- a link

  !> Slots of both ends.
  subroutine ends(self, view, i, j)
    class(link_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    integer, intent(out) :: i, j
    i = view%body%slot(self%one)
    j = view%body%slot(self%other)
  end subroutine ends

  subroutine link_force(self, view, force)
    class(link_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: force(:, :)
    integer :: i, j

    call ends(self, view, i, j)
    associate (pull => self%k*(view%u(j, :) - view%u(i, :)), volume => view%body%volume)
      force(i, :) = force(i, :) + pull/volume(i)
      force(j, :) = force(j, :) - pull/volume(j)
    end associate
  end subroutine link_force

  subroutine link_energy(self, view, density)
    class(link_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: density(:)
    integer :: i, j

    call ends(self, view, i, j)
    density(i) = density(i) + self%k*sum((view%u(j, :) - view%u(i, :))**2)/2/view%body%volume(i)
  end subroutine link_energy

  subroutine link_bound(self, view, bound)
    class(link_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: bound(:)
    integer :: i, j

    call ends(self, view, i, j)
    bound(i) = bound(i) + 2*self%k/view%body%volume(i)
    bound(j) = bound(j) + 2*self%k/view%body%volume(j)
  end subroutine link_bound

  subroutine link_tangent(self, view, w, kw)
    class(link_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(in), contiguous :: w(:, :)
    real(wp), intent(inout), contiguous :: kw(:, :)
    integer :: i, j

    call ends(self, view, i, j)
    associate (pull => self%k*(w(j, :) - w(i, :)), volume => view%body%volume)
      kw(i, :) = kw(i, :) - pull/volume(i)
      kw(j, :) = kw(j, :) + pull/volume(j)
    end associate
  end subroutine link_tangent

  subroutine link_keep(self, archive)
    class(link_type), intent(inout) :: self
    class(archive_type), intent(inout) :: archive
    call archive%keep('stiffness of a link', self%k)
  end subroutine link_keep

  function link_describe(self) result(text)
    class(link_type), intent(in) :: self
    character(:), allocatable :: text
    text = 'a link'
    if (self%one == self%other) text = text//' of a point to itself'
  end function link_describe

  ! ---------------------------------------------------------------- a load

  subroutine wind_force(self, view, force)
    class(wind_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: force(:, :)
    integer :: c

    do c = 1, size(force, 2)
      where (view%body%point > 0) force(:, c) = force(:, c) + self%b(c)*min(1.0_wp, &
        & view%time/self%ramp)
    end do
  end subroutine wind_force

  !> Nothing is stored.
  subroutine wind_energy(self, view, density)
    class(wind_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: density(:)
    if (self%ramp < 0.0_wp) density = density + 0.0_wp*view%u(:, 1)
  end subroutine wind_energy

  !> Nothing is stiff.
  subroutine wind_bound(self, view, bound)
    class(wind_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: bound(:)
    if (self%ramp < 0.0_wp) bound = bound + 0.0_wp*view%u(:, 1)
  end subroutine wind_bound

  subroutine wind_keep(self, archive)
    class(wind_type), intent(inout) :: self
    class(archive_type), intent(inout) :: archive
    call archive%keep('ramp', self%ramp)
  end subroutine wind_keep

  function wind_describe(self) result(text)
    class(wind_type), intent(in) :: self
    character(:), allocatable :: text
    text = 'wind'
    if (all(abs(self%b) <= 0.0_wp)) text = 'no '//text
  end function wind_describe

  ! ---------------------------------------------------------------- making and running them

  !> Springs of `s`, named and with their tangent.
  function ground(s, h, farthest) result(term)
    real(wp), intent(in) :: s
    real(wp), intent(in), optional :: h, farthest
    type(ground_type) :: term

    term%name = 'ground'
    term%tangent = has_tangent
    term%s = s
    if (present(h)) term%h = h
    if (present(farthest)) term%farthest = farthest
  end function ground

  function dashpot(c) result(term)
    real(wp), intent(in) :: c
    type(dashpot_type) :: term

    term%name = 'dashpot'
    term%conservative = .false.
    term%tangent = no_stiffness
    term%c = c
  end function dashpot

  !> Build a scene with terms; what is wrong with it fails the test.
  subroutine ready_with(scene, terms, set_up, error)
    type(scene_type), intent(in) :: scene
    type(term_list_type), intent(in) :: terms
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    call omp_set_num_threads(1)
    call prepare(scene, set_up, fault, terms=terms)
    if (allocated(fault)) call test_failed(error, 'the scene is refused: '//fault%message)
  end subroutine ready_with

  !> A small plate, ready with terms.
  subroutine plate_with(terms, set_up, error)
    type(term_list_type), intent(in) :: terms
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene

    call box_scene([5, 4], spacing, 0.2_wp, scene)
    call ready_with(scene, terms, set_up, error)
  end subroutine plate_with

  !> Move all points by `amplitude` [m] along x, without velocity.
  subroutine push(system, amplitude)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: amplitude

    system%state%u = 0.0_wp
    system%state%v = 0.0_wp
    where (system%body%point > 0) system%state%u(:, 1) = amplitude
  end subroutine push

  !> Run; a fault fails the test.
  subroutine run(system, integrator, dt, steps, diary, error)
    type(system_type), intent(inout) :: system
    character(*), intent(in) :: integrator
    real(wp), intent(in) :: dt
    integer, intent(in) :: steps
    class(observer_type), intent(inout) :: diary
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    call run_explicit(system, integrator, dt, steps, diary, fault)
    if (allocated(fault)) call test_failed(error, integrator//': '//fault%message)
  end subroutine run

  !> The stable step of the plate without terms [s].
  real(wp) function bare_limit(error) result(limit)
    type(error_type), allocatable, intent(inout) :: error
    type(set_up_type) :: set_up
    type(term_list_type) :: none

    call plate_with(none, set_up, error)
    limit = set_up%plan%limit
  end function bare_limit

  !> Two squares of 3 x 3 points, five spacings apart.
  subroutine two_boxes(scene)
    type(scene_type), intent(out) :: scene

    call box_scene([3, 3], spacing, 0.2_wp, scene)
    scene%bodies = [scene%bodies, scene%bodies]
    scene%bodies(2)%name = 'other'
    scene%bodies(2)%lower(1) = 8*spacing
    scene%bodies(2)%upper(1) = 11*spacing
  end subroutine two_boxes

  !> A link between the middle points of the two squares.
  function link(k) result(term)
    real(wp), intent(in) :: k
    type(link_type) :: term

    term%name = 'link'
    term%tangent = has_tangent
    term%k = k
    term%one = 5
    term%other = 14
  end function link

  !> Springs, dashpots, friction and wind on a plate that breaks nowhere, each with its own state.
  subroutine all_terms(dt, terms)
    real(wp), intent(in) :: dt   !! of the run [s]
    type(term_list_type), intent(out) :: terms
    type(friction_type) :: friction
    type(wind_type) :: wind

    call terms%add(ground(density_of_steel*(0.2_wp/dt)**2))
    call terms%add(dashpot(density_of_steel*0.02_wp/dt))
    friction%name = 'friction'
    friction%conservative = .false.
    friction%s = density_of_steel*(0.1_wp/dt)**2
    friction%yield = friction%s*2.0e-3_wp*spacing
    call terms%add(friction)
    wind%name = 'wind'
    wind%external = .true.
    wind%tangent = no_stiffness
    wind%b = [1.0e12_wp, -2.0e11_wp, 0.0_wp]
    wind%ramp = 20*dt
    call terms%add(wind)
  end subroutine all_terms

  subroutine keep_at_step(observer, system, instant, error)
    class(keeper_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error

    if (instant%step /= observer%step .or. allocated(error)) return
    call observer%snapshot%rewind(reading=.false.)
    call keep_system(observer%snapshot, system)
  end subroutine keep_at_step

  !> A start in which every point moves in its own way.
  subroutine shaken(system)
    type(system_type), intent(inout) :: system
    call shake(system%body, no_gradient, 1.0e-3_wp*spacing, 17, system%state%u)
  end subroutine shaken

  !> Fail unless both systems and the slips of their friction are the same to the last bit.
  subroutine same_bits(one, other, what, error)
    type(system_type), intent(in) :: one, other
    character(*), intent(in) :: what
    type(error_type), allocatable, intent(inout) :: error

    call expect_close(error, one%state%u, other%state%u, 0.0_wp, what//': displacements')
    call expect_close(error, one%state%v, other%state%v, 0.0_wp, what//': velocities')
    call expect_close(error, one%state%force, other%state%force, 0.0_wp, what//': forces')
    call expect_close(error, slip_of(one), slip_of(other), 0.0_wp, what//': slip')
    call expect_true(error, max_abs(slip_of(one)) > 0.0_wp, what//': nothing slipped')
  end subroutine same_bits

  !> The slip of the first term with friction.
  function slip_of(system) result(slip)
    type(system_type), intent(in) :: system
    real(wp), allocatable :: slip(:, :)
    integer :: i

    allocate (slip(0, 0))
    do i = 1, system%terms%number()
      select type (term => system%terms%items(i)%term)
      type is (friction_type)
        slip = term%slip
      class default  ! another term
        continue
      end select
    end do
  end function slip_of

end module force_terms
