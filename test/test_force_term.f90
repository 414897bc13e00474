!> Terms of the force that only this module knows: springs to the ground, dashpots, links between
!> points, friction with a memory, a load. All that the program does with terms (time step, energy
!> balance, restart, static equilibrium) is compared with closed forms.
module test_force_term
  use omp_lib, only: omp_set_num_threads
  use pd_base_archive, only: archive_type
  use pd_base_error, only: fault_type => error_type, status_input, status_no_answer
  use pd_base_kinds, only: wp
  use pd_base_snapshot, only: snapshot_type
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_force_bonds, only: bond_term_type
  use pd_force_forces, only: after_marks, up_to_marks
  use pd_force_model, only: options_of
  use pd_force_reference, only: point_force
  use pd_force_tangent, only: central, tangent_type
  use pd_force_term, only: force_term_type, term_view_type, has_tangent, no_stiffness
  use pd_force_terms, only: term_list_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_keep, only: keep_system
  use pd_motion_loads, only: other_terms
  use pd_motion_observer, only: instant_type, observer_type
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_motion_system, only: ask_bonds, system_type, view_of
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: prepare, set_up_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: at_point, box_scene, density_of_steel, diary_type, expect, expect_true, shake, &
    & youngs_modulus
  implicit none (type, external)
  private
  public :: collect_force_term

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

  subroutine collect_force_term(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a body on springs vibrates as leapfrog''s formula says', test_frequency), &
      & new_unittest('every integrator converges to the vibration', test_orders), &
      & new_unittest('dashpots damp as the discrete equation predicts', test_damping), &
      & new_unittest('friction dissipates yield times slip', test_friction), &
      & new_unittest('the step is stable up to the limit and not beyond', test_step), &
      & new_unittest('the limit from the largest frequency includes terms', test_spectral_step), &
      & new_unittest('a link keeps momentum and energy', test_link), &
      & new_unittest('an external term is a load', test_external), &
      & new_unittest('a restart has the same bits', test_restart), &
      & new_unittest('a restart within a relaxation has the same bits', test_static_restart), &
      & new_unittest('the same bits on any number of threads', test_threads), &
      & new_unittest('static equilibrium on springs, by both solvers', test_static), &
      & new_unittest('static equilibrium of two bodies with a link', test_static_link), &
      & new_unittest('a term without a tangent is refused by name', test_refusal), &
      & new_unittest('a list sums its terms', test_list), &
      & new_unittest('the bonds are the first term of a system', test_bonds)]
  end subroutine collect_force_term

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

  ! ---------------------------------------------------------------- an external term

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

  ! ---------------------------------------------------------------- what tests share

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

  ! ---------------------------------------------------------------- tests

  !> All points move alike, u_n = A cos(n phi) with sin(phi/2) = omega dt/2, omega^2 = s/rho, and
  !> the kinetic and stored energy at t_n are (s A^2 V/2) (1 - sin(phi/2)^2 sin(n phi)^2): to
  !> rounding, which n steps add up.
  subroutine test_frequency(error)
    type(error_type), allocatable, intent(out) :: error
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp), parameter :: amplitude = 0.01_wp*spacing
    integer, parameter :: steps = 200
    real(wp) :: dt, omega, phi, volume, whole
    integer :: n, i

    do i = 1, 2
      dt = 0.5_wp*bare_limit(error)
      if (allocated(error)) return
      omega = 0.6_wp/dt
      terms = term_list_type()
      call terms%add(ground(density_of_steel*omega**2))
      call plate_with(terms, set_up, error)
      if (allocated(error)) return
      call push(set_up%system, amplitude)
      diary = diary_type()
      diary%slot = at_point(set_up%system%body, [2*spacing, spacing])
      call run(set_up%system, trim(integrators(i)), dt, steps, diary, error)
      if (allocated(error)) return
      phi = 2*asin(omega*dt/2)
      volume = sum(set_up%system%body%volume, mask=set_up%system%body%point > 0)
      whole = density_of_steel*omega**2*amplitude**2*volume/2
      call expect_true(error, diary%n == steps + 1, 'rows of the diary')
      do n = 0, steps
        call expect(error, diary%u(1, n + 1)/amplitude, cos(n*phi), 1.0e-11_wp, 'displacement')
        call expect(error, (diary%kinetic(n + 1) + diary%strain(n + 1))/whole, &
          & 1 - (sin(phi/2)*sin(n*phi))**2, 1.0e-11_wp, 'energy')
      end do
      call expect_close(error, abs(diary%work) + abs(diary%dissipated), 0.0_wp, 0.0_wp, &
        & 'springs to the ground do no work and lose nothing')
    end do
  end subroutine test_frequency

  !> A cos(omega t) is met to the order of each integrator: halving the step divides the error, the
  !> largest of all steps.
  subroutine test_orders(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: orders(*) = [2.0_wp, 2.0_wp, 3.0_wp, 2.0_wp, 4.0_wp]
    real(wp), parameter :: amplitude = 0.01_wp*spacing
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: dt, omega, off(2)
    integer :: i, r, steps

    dt = 0.2_wp*bare_limit(error)
    if (allocated(error)) return
    omega = 0.2_wp/dt
    call terms%add(ground(density_of_steel*omega**2))
    do i = 1, size(integrators)
      do r = 1, 2
        steps = 40*2**(r - 1)
        call plate_with(terms, set_up, error)
        if (allocated(error)) return
        call push(set_up%system, amplitude)
        diary = diary_type()
        diary%slot = at_point(set_up%system%body, [2*spacing, spacing])
        call run(set_up%system, trim(integrators(i)), dt/2**(r - 1), steps, diary, error)
        if (allocated(error)) return
        off(r) = max_abs(diary%u(1, :)/amplitude - cos(omega*diary%time))
      end do
      call expect(error, log(off(1)/off(2))/log(2.0_wp), orders(i), 0.2_wp, 'order of '// &
        & trim(integrators(i)))
    end do
  end subroutine test_orders

  !> With forces from the velocities of half a step before, u_n obeys
  !> u_{n+1} - (2 - r - k) u_n + (1 - r) u_{n-1} = 0, r = c dt/rho, k = (omega dt)^2, from
  !> u_1 = (1 - k/2) u_0. Energy: what is lost is what dashpots took, to k/4 of the whole, by which
  !> rho v_{n+1/2}^2/2 + s u_n u_{n+1}/2 differs at the start, what leapfrog keeps without dashpots:
  !> that loses what they take to the last digit.
  subroutine test_damping(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: amplitude = 0.01_wp*spacing, r = 0.05_wp, k = 0.04_wp
    integer, parameter :: steps = 150
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: dt, u(0:steps), volume, whole
    integer :: n

    dt = 0.4_wp*bare_limit(error)
    if (allocated(error)) return
    call terms%add(ground(density_of_steel*k/dt**2))
    call terms%add(dashpot(density_of_steel*r/dt))
    call plate_with(terms, set_up, error)
    if (allocated(error)) return
    call push(set_up%system, amplitude)
    diary%slot = at_point(set_up%system%body, [2*spacing, spacing])
    call run(set_up%system, 'forward_backward', dt, steps, diary, error)
    if (allocated(error)) return
    u(0) = 1.0_wp
    u(1) = 1 - k/2
    do n = 1, steps - 1
      u(n + 1) = (2 - r - k)*u(n) - (1 - r)*u(n - 1)
    end do
    call expect_close(error, diary%u(1, :)/amplitude, u, 1.0e-11_wp, 'damped swing')
    call expect_true(error, max_abs(u(steps - 20:)) < 0.05_wp, 'it should be damped')
    volume = sum(set_up%system%body%volume, mask=set_up%system%body%point > 0)
    whole = density_of_steel*k/dt**2*amplitude**2*volume/2
    call expect_close(error, (diary%kinetic + diary%strain + diary%dissipated)/whole, 1.0_wp, &
      & k/4*1.1_wp, 'energy balance')
    call expect(error, diary%dissipated(diary%n)/whole, 1 - k/4, 6.0e-4_wp, &
      & 'dissipated in the end')
  end subroutine test_damping

  !> A body that flies against friction until that holds it has lost yield times the way that the
  !> springs slipped: rho v^2/2 less yield^2/(2 s), a sixteenth of it here, which they store. Where
  !> they begin to slip the trapezoidal rule errs by s (v dt)^2/8 at most, 1e-4 of the whole.
  subroutine test_friction(error)
    type(error_type), allocatable, intent(out) :: error
    type(friction_type) :: friction
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: dt, volume, speed, begin, slipped
    integer :: slot

    dt = 0.2_wp*bare_limit(error)
    if (allocated(error)) return
    speed = 1.0_wp
    friction%name = 'friction'
    friction%conservative = .false.
    friction%s = density_of_steel*(0.02_wp/dt)**2
    ! it stops after some 200 steps
    friction%yield = density_of_steel*speed/(200*dt)
    call terms%add(friction)
    call plate_with(terms, set_up, error)
    if (allocated(error)) return
    where (set_up%system%body%point > 0) set_up%system%state%v(:, 1) = speed
    slot = at_point(set_up%system%body, [2*spacing, spacing])
    diary%slot = slot
    call run(set_up%system, 'forward_backward', dt, 260, diary, error)
    if (allocated(error)) return
    volume = sum(set_up%system%body%volume, mask=set_up%system%body%point > 0)
    begin = density_of_steel*speed**2*volume/2
    select type (term => set_up%system%terms%items(2)%term)
    type is (friction_type)
      slipped = term%slip(slot, 1)
    class default
      call test_failed(error, 'the term has become another one')
      return
    end select
    call expect(error, slipped/(density_of_steel*speed**2/(2*friction%yield)), 15.0_wp/16, &
      & 1.0e-3_wp, 'slip')
    call expect(error, diary%dissipated(diary%n)/begin, friction%yield*slipped*volume/begin, &
      & 2.0e-4_wp, 'dissipated')
    call expect_close(error, (diary%kinetic + diary%strain + diary%dissipated)/begin, 1.0_wp, &
      & 2.0e-4_wp, 'energy balance')
  end subroutine test_friction

  !> Springs far stiffer than the bonds, with dashpots and without: the limit is below the exact
  !> one by no more than the bonds' part, just below it the body swings, just above it it flies off.
  subroutine test_step(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: amplitude = 1.0e-6_wp*spacing
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: bare, omega, rate, exact
    integer :: i

    bare = bare_limit(error)
    if (allocated(error)) return
    omega = 2*20/bare
    do i = 0, 1
      rate = i*omega
      terms = term_list_type()
      call terms%add(ground(density_of_steel*omega**2))
      if (i == 1) call terms%add(dashpot(density_of_steel*rate))
      call plate_with(terms, set_up, error)
      if (allocated(error)) return
      ! (omega dt/2)^2 + rate dt/2 = 1
      exact = (sqrt(rate**2/4 + omega**2) - rate/2)*2/omega**2
      call expect(error, set_up%plan%limit/exact, 1.0_wp, 2.0e-3_wp, 'stable step')
      call expect_true(error, set_up%plan%limit <= exact, 'the limit is beyond the stable step')
      call push(set_up%system, amplitude)
      call run(set_up%system, 'forward_backward', 0.999_wp*set_up%plan%limit, 3000, diary, error)
      if (allocated(error)) return
      call expect_true(error, max_abs(set_up%system%state%u) <= 40*amplitude, &
        & 'just below the limit')
      call push(set_up%system, amplitude)
      diary = diary_type()
      diary%every = 100000
      call run_explicit(set_up%system, 'forward_backward', 1.01_wp*exact, 3000, diary, fault)
      call expect_true(error, allocated(fault), 'no fault just above the limit')
      if (allocated(error)) return
      call expect_true(error, fault%status == status_no_answer, fault%message)
    end do
    ! pure damping decides about the others
    do i = 1, size(integrators)
      terms = term_list_type()
      call terms%add(dashpot(density_of_steel*100/bare))
      call damped_plate(trim(integrators(i)), terms, set_up, error)
      if (allocated(error)) return
      where (set_up%system%body%point > 0) set_up%system%state%v(:, 1) = 1.0_wp
      diary = diary_type()
      call run(set_up%system, trim(integrators(i)), set_up%plan%limit, 300, diary, error)
      if (allocated(error)) return
      call expect_true(error, diary%kinetic(diary%n) <= 1.0e-3_wp*diary%kinetic(1), &
        & trim(integrators(i))//' does not damp at the stable step')
      call expect_true(error, set_up%plan%limit > 0.4_wp*bare/100, &
        & trim(integrators(i))//': the limit is far from the stable step')
    end do
  end subroutine test_step

  !> A plate for one integrator.
  subroutine damped_plate(integrator, terms, set_up, error)
    character(*), intent(in) :: integrator
    type(term_list_type), intent(in) :: terms
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene

    call box_scene([5, 4], spacing, 0.2_wp, scene)
    scene%time%integrator = integrator
    call ready_with(scene, terms, set_up, error)
  end subroutine damped_plate

  !> 4/dt^2 of the limit is the bonds' largest omega^2 plus what the terms add: s/rho.
  subroutine test_spectral_step(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(term_list_type) :: terms, none
    type(set_up_type) :: set_up
    real(wp) :: bare, s

    call box_scene([5, 4], spacing, 0.2_wp, scene)
    scene%time%limit = 'spectral'
    call ready_with(scene, none, set_up, error)
    if (allocated(error)) return
    call expect_true(error, set_up%plan%spectral, 'the limit is not from the largest frequency')
    bare = set_up%plan%limit
    s = density_of_steel*(2/bare)**2
    call terms%add(ground(s))
    call ready_with(scene, terms, set_up, error)
    if (allocated(error)) return
    call expect(error, (bare/set_up%plan%limit)**2, 2.0_wp, 1.0e-12_wp, 'omega^2')
  end subroutine test_spectral_step

  !> Two bodies out of each other's reach with a link between points at their middles: the sum of
  !> momenta stays as it was to rounding, each one's changes, and the energy stays to the
  !> integrator's error.
  subroutine test_link(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: before, after, of_one, mass
    logical, allocatable :: first(:)
    real(wp), parameter :: speed = 1.0_wp

    call two_boxes(scene)
    call terms%add(link(1.0e6_wp))
    call ready_with(scene, terms, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      first = system%body%body == 1 .and. system%body%point > 0
      where (first) system%state%v(:, 1) = speed
      mass = density_of_steel*sum(system%body%volume, mask=first)
      before = momentum(system)
      call run(system, 'forward_backward', 0.5_wp*set_up%plan%limit, 400, diary, error)
      if (allocated(error)) return
      after = momentum(system)
      of_one = density_of_steel*sum(system%body%volume*system%state%v(:, 1), mask=first)
    end associate
    call expect(error, before/(mass*speed), 1.0_wp, 1.0e-12_wp, 'momentum at the start')
    call expect(error, after/before, 1.0_wp, 1.0e-12_wp, 'momentum at the end')
    call expect_true(error, of_one < 0.9_wp*mass*speed, 'the link did not pull')
    call expect_close(error, (diary%kinetic + diary%strain)/diary%kinetic(1), 1.0_wp, 2.0e-2_wp, &
      & 'energy')
    call expect_true(error, maxval(diary%strain) > 0.05_wp*diary%kinetic(1), 'nothing is stored')
  end subroutine test_link

  !> Momentum along x [kg m/s].
  pure real(wp) function momentum(system)
    type(system_type), intent(in) :: system
    momentum = density_of_steel*sum(system%body%volume*system%state%v(:, 1), &
      & mask=system%body%point > 0)
  end function momentum

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

  !> The motion under an external term, and its work, are those under a &load with the same force
  !> density, held points and all; the internal forces do not contain it.
  subroutine test_external(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(term_list_type) :: terms, none
    type(wind_type) :: wind
    type(set_up_type) :: blown, loaded
    type(diary_type) :: diary, other
    integer, parameter :: steps = 100
    real(wp) :: dt, scale
    integer :: i

    call box_scene([5, 4], spacing, 0.2_wp, scene)
    deallocate (scene%boundaries)
    allocate (scene%boundaries(1))
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%velocity(:2) = [3.0_wp, 0.0_wp]
    wind%name = 'wind'
    wind%external = .true.
    wind%tangent = no_stiffness
    wind%b = [1.0e12_wp, -2.0e11_wp, 0.0_wp]
    do i = 1, size(integrators)
      terms = term_list_type()
      call ready_with(scene, none, loaded, error)
      if (allocated(error)) return
      dt = 0.3_wp*loaded%plan%limit
      wind%ramp = 50*dt
      call terms%add(wind)
      call ready_with(scene, terms, blown, error)
      deallocate (scene%loads)
      allocate (scene%loads(1))
      scene%loads(1)%body_force(:2) = wind%b(:2)
      scene%loads(1)%ramp_time = wind%ramp
      call ready_with(scene, none, loaded, error)
      deallocate (scene%loads)
      allocate (scene%loads(0))
      if (allocated(error)) return
      diary = diary_type()
      other = diary_type()
      call run(blown%system, trim(integrators(i)), dt, steps, diary, error)
      call run(loaded%system, trim(integrators(i)), dt, steps, other, error)
      if (allocated(error)) return
      scale = max_abs(loaded%system%state%u)
      ! the load leaves out the boundary layer, the wind does not: they are held
      call expect_close(error, blown%system%state%u, loaded%system%state%u, 1.0e-12_wp*scale, &
        & trim(integrators(i))//': displacements')
      call expect_close(error, blown%system%state%force, loaded%system%state%force, &
        & 1.0e-9_wp*max_abs(loaded%system%state%force), trim(integrators(i))//': internal force')
      call expect_true(error, diary%work(diary%n) > 0.0_wp, 'no work was done')
      call expect_close(error, diary%work, other%work, 1.0e-11_wp*other%work(other%n), &
        & trim(integrators(i))//': external work')
      call expect_close(error, diary%kinetic, other%kinetic, 1.0e-11_wp*other%work(other%n), &
        & trim(integrators(i))//': kinetic energy')
    end do
  end subroutine test_external

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

  !> A run that is kept at step 25, put into a system made anew, and goes on, has the bits of one
  !> that never stopped: displacements, forces, accounts, and the history of the term.
  subroutine test_restart(error)
    type(error_type), allocatable, intent(out) :: error
    type(term_list_type) :: terms
    type(set_up_type) :: whole, again
    type(keeper_type) :: keeper
    type(diary_type) :: diary, rest
    real(wp) :: dt
    integer :: i
    integer, parameter :: steps = 60

    dt = 0.4_wp*bare_limit(error)
    if (allocated(error)) return
    call all_terms(dt, terms)
    do i = 1, size(integrators)
      call plate_with(terms, whole, error)
      call plate_with(terms, again, error)
      if (allocated(error)) return
      call shaken(whole%system)
      call shaken(again%system)
      keeper%step = 25
      call run(again%system, trim(integrators(i)), dt, 40, keeper, error)
      call plate_with(terms, again, error)
      if (allocated(error)) return
      call keeper%snapshot%rewind(reading=.true.)
      call keep_system(keeper%snapshot, again%system)
      call expect_true(error, .not. allocated(keeper%snapshot%error), 'the state is not put back')
      call expect_true(error, again%system%memory%step == 25, 'step of the state put back')
      diary = diary_type()
      rest = diary_type()
      call run(whole%system, trim(integrators(i)), dt, steps, diary, error)
      call run(again%system, trim(integrators(i)), dt, steps, rest, error)
      if (allocated(error)) return
      call same_bits(whole%system, again%system, trim(integrators(i)), error)
      call expect_close(error, [diary%work(diary%n), diary%dissipated(diary%n), &
        & diary%strain(diary%n)], [rest%work(rest%n), rest%dissipated(rest%n), &
        & rest%strain(rest%n)], 0.0_wp, trim(integrators(i))//': accounts')
      call expect_true(error, diary%dissipated(diary%n) > 0.0_wp .and. &
        & abs(diary%work(diary%n)) > 0.0_wp, 'nothing was accounted')
    end do
  end subroutine test_restart

  !> The same of both solvers, in the second of two load steps.
  subroutine test_static_restart(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(term_list_type) :: terms
    type(set_up_type) :: whole, again
    type(diary_type) :: diary
    type(keeper_type) :: keeper
    real(wp), parameter :: far = 1.0e-3_wp*spacing
    real(wp) :: s
    integer :: dynamic

    s = 1.0e-3_wp*youngs_modulus/spacing**2
    call terms%add(ground(s, s/far**2, 40*far))
    call box_scene([5, 4], spacing, 0.2_wp, scene)
    deallocate (scene%loads)
    allocate (scene%loads(1))
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%pressure = -1.0e-3_wp*youngs_modulus
    scene%time%method = 'relaxation'
    scene%relaxation%tolerance = 1.0e-8_wp
    scene%relaxation%load_steps = 2
    scene%relaxation%maximum_iterations = 20000
    do dynamic = 0, 1
      scene%relaxation%solver = 'conjugate_gradient'
      if (dynamic == 1) scene%relaxation%solver = 'dynamic_relaxation'
      call ready_with(scene, terms, whole, error)
      call ready_with(scene, terms, again, error)
      if (allocated(error)) return
      diary = diary_type()
      call rest(whole, diary, error)
      if (allocated(error)) return
      ! the diary has a row for the start, one for each iteration and one for each settled step
      keeper = keeper_type()
      keeper%step = (3*(diary%n - 3))/4
      call rest(again, keeper, error)
      call ready_with(scene, terms, again, error)
      if (allocated(error)) return
      call keeper%snapshot%rewind(reading=.true.)
      call keep_system(keeper%snapshot, again%system)
      call expect_true(error, .not. allocated(keeper%snapshot%error), 'the state is not put back')
      associate (memory => again%system%memory)
        call expect_true(error, memory%load_step == 2 .and. &
          & (memory%iteration > 0 .or. allocated(memory%newton)), trim(scene%relaxation%solver)// &
          & ' is not kept amid a load step')
      end associate
      call rest(again, diary, error)
      if (allocated(error)) return
      call expect_close(error, again%system%state%u, whole%system%state%u, 0.0_wp, &
        & trim(scene%relaxation%solver)//': displacements')
      call expect_close(error, again%system%state%force, whole%system%state%force, 0.0_wp, &
        & trim(scene%relaxation%solver)//': forces')
      call expect(error, again%system%external_work, whole%system%external_work, 0.0_wp, &
        & trim(scene%relaxation%solver)//': work')
    end do
  end subroutine test_static_restart

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

  !> On one thread and on three, over several blocks of sums.
  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(term_list_type) :: terms
    type(set_up_type) :: one, many
    type(diary_type) :: diary, other
    real(wp) :: dt

    dt = 0.4_wp*bare_limit(error)
    if (allocated(error)) return
    call all_terms(dt, terms)
    call box_scene([110, 50], spacing, 0.2_wp, scene)
    call ready_with(scene, terms, one, error)
    call ready_with(scene, terms, many, error)
    if (allocated(error)) return
    call shaken(one%system)
    call shaken(many%system)
    call omp_set_num_threads(1)
    call run(one%system, 'forward_backward', dt, 30, diary, error)
    call omp_set_num_threads(3)
    call run(many%system, 'forward_backward', dt, 30, other, error)
    call omp_set_num_threads(1)
    if (allocated(error)) return
    call same_bits(one%system, many%system, 'three threads', error)
    call expect_close(error, diary%work, other%work, 0.0_wp, 'work')
    call expect_close(error, diary%dissipated, other%dissipated, 0.0_wp, 'dissipated')
    call expect_close(error, diary%strain, other%strain, 0.0_wp, 'stored')
    call expect_close(error, diary%kinetic, other%kinetic, 0.0_wp, 'kinetic')
  end subroutine test_threads

  !> A body that nothing but springs holds, under a body force b: everywhere s u + h u^3 = b. With
  !> unevenly spread loads the solvers must agree, and the springs bear what acts.
  subroutine test_static(error)
    type(error_type), allocatable, intent(out) :: error
    character(20), parameter :: solvers(*) = [character(20) :: 'conjugate_gradient', &
      & 'dynamic_relaxation']
    real(wp), parameter :: u = 1.0e-3_wp*spacing   ! expected displacement
    type(scene_type) :: scene
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: s, h, net, acting
    real(wp), allocatable :: found(:, :, :)
    integer :: i, hard, k

    s = 1.0e-3_wp*youngs_modulus/spacing**2
    do hard = 0, 1
      h = hard*s/u**2
      do i = 1, size(solvers)
        call box_scene([5, 4], spacing, 0.2_wp, scene)
        deallocate (scene%loads)
        allocate (scene%loads(1))
        scene%loads(1)%body_force(1) = s*u + h*u**3
        scene%time%method = 'relaxation'
        scene%relaxation%solver = solvers(i)
        scene%relaxation%tolerance = 1.0e-9_wp
        scene%relaxation%maximum_iterations = 20000
        terms = term_list_type()
        call terms%add(ground(s, h, 4*u))
        call ready_with(scene, terms, set_up, error)
        if (allocated(error)) return
        diary = diary_type()
        diary%every = 0
        call rest(set_up, diary, error)
        if (allocated(error)) return
        do k = 1, set_up%system%body%n_slots
          if (set_up%system%body%point(k) == 0) cycle
          call expect(error, set_up%system%state%u(k, 1)/u, 1.0_wp, 1.0e-7_wp, &
            & 'displacement by '//trim(solvers(i)))
          call expect(error, set_up%system%state%u(k, 2)/u, 0.0_wp, 1.0e-7_wp, &
            & 'displacement across by '//trim(solvers(i)))
        end do
        ! the work of the load is what the springs store
        call expect(error, diary%strain(diary%n)/(set_up%system%body%n_points*spacing**2 &
          & *scene%header%thickness), s*u**2/2 + h*u**4/4, 1.0e-6_wp*s*u**2, 'stored energy')
        ! a force at one side
        deallocate (scene%loads)
        allocate (scene%loads(1))
        scene%loads(1)%side = 'x_max'
        scene%loads(1)%pressure = -1.0e-4_wp*youngs_modulus
        call ready_with(scene, terms, set_up, error)
        if (allocated(error)) return
        call rest(set_up, diary, error)
        if (allocated(error)) return
        associate (system => set_up%system)
          if (.not. allocated(found)) allocate (found(system%body%n_slots, 2, 2))
          found(:, :, i) = system%state%u
          net = 0.0_wp
          do k = 1, system%body%n_slots
            net = net - system%body%volume(k)*(s + h*sum(system%state%u(k, :)**2)) &
              & *system%state%u(k, 1)
          end do
          acting = 1.0e-4_wp*youngs_modulus*4*spacing*scene%header%thickness
          call expect(error, net/acting, -1.0_wp, 1.0e-6_wp, 'the springs bear the load')
        end associate
      end do
      call expect_close(error, found(:, :, 1), found(:, :, 2), 1.0e-6_wp*max_abs(found(:, :, 1)), &
        & 'both solvers')
    end do
  end subroutine test_static

  !> Relax; a fault fails the test.
  subroutine rest(set_up, observer, error)
    type(set_up_type), intent(inout) :: set_up
    class(observer_type), intent(inout) :: observer
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    call run_relaxation(set_up%system, set_up%plan%relaxation, observer, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine rest

  !> A body that is held and one that hangs on it by a link at its middle, which a force through
  !> that point pulls by F: the link is longer by F/k, and the far body moves so much further than
  !> the end of the near one.
  subroutine test_static_link(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: force, k
    integer :: near, far

    call two_boxes(scene)
    deallocate (scene%boundaries, scene%loads)
    allocate (scene%boundaries(1), scene%loads(1))
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%displacement(:2) = 0.0_wp
    force = 100.0_wp
    k = 1.0e9_wp
    scene%loads(1)%body = 'other'
    scene%loads(1)%force(1) = force
    scene%time%method = 'relaxation'
    scene%relaxation%solver = 'conjugate_gradient'
    scene%relaxation%tolerance = 1.0e-9_wp
    call terms%add(link(k))
    call ready_with(scene, terms, set_up, error)
    if (allocated(error)) return
    diary%every = 0
    call rest(set_up, diary, error)
    if (allocated(error)) return
    associate (body => set_up%system%body, u => set_up%system%state%u)
      near = at_point(body, [1.5_wp*spacing, 1.5_wp*spacing])
      far = at_point(body, [9.5_wp*spacing, 1.5_wp*spacing])
      call expect(error, (u(far, 1) - u(near, 1))*k/force, 1.0_wp, 1.0e-5_wp, 'length of the link')
      call expect_true(error, u(near, 1) > 0.0_wp, 'the near body is not pulled')
    end associate
  end subroutine test_static_link

  !> Static equilibrium with friction, which has no tangent, and with dashpots, which need none.
  subroutine test_refusal(error)
    type(error_type), allocatable, intent(out) :: error
    type(friction_type) :: friction
    type(scene_type) :: scene
    type(term_list_type) :: terms
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault

    call box_scene([5, 4], spacing, 0.2_wp, scene)
    scene%time%method = 'relaxation'
    call terms%add(dashpot(1.0_wp))
    call ready_with(scene, terms, set_up, error)
    if (allocated(error)) return
    diary%every = 0
    call rest(set_up, diary, error)
    friction%name = 'slow slip'
    friction%s = 1.0e12_wp
    friction%yield = 1.0_wp
    call terms%add(friction)
    call ready_with(scene, terms, set_up, error)
    if (allocated(error)) return
    call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
    call expect_true(error, allocated(fault), 'a term without a tangent is accepted')
    if (allocated(error)) return
    call expect_true(error, fault%status == status_input .and. &
      & index(fault%message, '"slow slip"') > 0 .and. index(fault%message, 'tangent') > 0, &
      & 'the message is: '//fault%message)
  end subroutine test_refusal

  !> What a list says is the sum of what its terms say, external ones apart; a list in a list is
  !> its terms; and each line is there.
  subroutine test_list(error)
    type(error_type), allocatable, intent(out) :: error
    type(term_list_type) :: inner, terms
    type(wind_type) :: wind
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: bound(:)

    call inner%add(ground(3.0_wp))
    call inner%add(dashpot(2.0_wp))
    call terms%add(ground(4.0_wp, 1.0_wp, 0.0_wp))
    call terms%add(inner)
    wind%external = .true.
    wind%tangent = no_stiffness
    wind%b(1) = 1.0_wp
    call terms%add(wind)
    call expect_true(error, terms%number() == 4 .and. terms%inside == 3 .and. terms%outside == 1, &
      & 'numbers of terms')
    call expect_true(error, terms%describe() == 'springs to the ground that harden'// &
      & new_line('a')//'springs to the ground'//new_line('a')//'dashpots'//new_line('a')//'wind'// &
      & new_line('a'), 'the lines are: '//terms%describe())
    call expect_true(error, terms%without_tangent() == '', 'all have a tangent or need none')
    call box_scene([5, 4], spacing, 0.2_wp, scene)
    deallocate (scene%loads)
    allocate (scene%loads(1))
    scene%loads(1)%body_force(1) = 1.0_wp
    call ready_with(scene, terms, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      call expect_true(error, system%terms%number() == 6 .and. system%terms%outside == 2 &
        & .and. system%terms%bonds == 1, 'bonds and the load of the scene are terms, too')
      allocate (bound(system%body%n_slots), source=0.0_wp)
      call bounds(system, bound)
      call expect_close(error, pack(bound, system%body%point > 0), 7.0_wp, 1.0e-14_wp, 'bound')
      call expect_close(error, pack(bound, system%body%point == 0), 0.0_wp, 0.0_wp, 'dead slots')
    end associate
  end subroutine test_list

  !> A list is the sum of its bonds and of others where a view asks for the bonds, and of the others
  !> alone where it does not. Forces are compared with those of the bonds one by one plus the
  !> springs', the bound with a product, the product with the forces, which are linear in small
  !> displacements but for 1e-7 of them, and the energy with half of their work.
  subroutine test_bonds(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type), target :: set_up
    type(term_list_type) :: terms
    type(tangent_type) :: tangent
    type(term_view_type) :: view
    type(bonds_type) :: bonds
    real(wp), allocatable :: force(:, :), expected(:, :), w(:, :), kw(:, :), bound(:), energy(:)
    real(wp) :: stored
    integer :: k

    call terms%add(ground(1.0e15_wp))
    call plate_with(terms, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      select type (term => system%terms%items(1)%term)
      type is (bond_term_type)
        call expect_true(error, system%terms%bonds == 1 .and. term%sets, 'the bonds lead the list')
      class default
        call test_failed(error, 'the first term is another one')
      end select
      call expect_true(error, other_terms(system%terms) == 1 .and. system%terms%inside == 1, &
        & 'numbers of terms')
      call shake(system%body, no_gradient, 1.0e-7_wp*spacing, 3, system%state%u)
      allocate (force, expected, w, kw, mold=system%state%u)
      call view_of(system, 0.0_wp, view)
      expected = 0.0_wp
      call system%terms%add_force(view, expected)
      call expect_close(error, expected, -1.0e15_wp*system%state%u, 0.0_wp, 'springs alone')

      ! the second part of an evaluation completes the first, and needs its dilatation
      call ask_bonds(system, view, up_to_marks)
      force = 0.0_wp
      call system%terms%add_force(view, force)
      call ask_bonds(system, view, after_marks)
      call system%terms%add_force(view, force)
      call allocate_bonds(system%family, bonds)
      do k = 1, system%body%n_slots
        if (system%body%point(k) == 0) cycle
        call system%family%bonds_of(k, bonds)
        expected(k, :) = expected(k, :) + point_force(system%model, system%state%u, &
          & system%state%p, k, bonds)
      end do
      call expect_close(error, force, expected, 1.0e-10_wp*max_abs(expected), 'bonds and springs')

      w = 0.0_wp
      call shake(system%body, no_gradient, 1.0_wp, 5, w)
      tangent%difference = central
      tangent%step = 1.0e-7_wp*spacing
      tangent%options = options_of(system%model)
      call ask_bonds(system, view, tangent=tangent)
      kw = 0.0_wp
      call system%terms%add_tangent(view, w, kw)
      expected = kw
      system%state%u = tangent%step*w
      call system%terms%add_force(view, force)
      call expect_close(error, -force/tangent%step, expected, 1.0e-6_wp*max_abs(expected), &
        & 'product')

      allocate (bound(system%body%n_slots), energy(system%body%n_slots), source=0.0_wp)
      call system%terms%add_stiffness_bound(view, bound)
      call expect_true(error, all(abs(kw) <= spread(bound, 2, system%body%dim)*max_abs(w)), &
        & 'no product exceeds the bound')
      call system%terms%add_energy(view, energy)
      stored = sum(energy*system%body%volume)
      call expect(error, system%terms%energy(view), stored, 1.0e-13_wp, 'energy')
      ! of linear forces it is half of what they do on the way
      call expect(error, stored, -sum(force*system%state%u*spread(system%body%volume, 2, &
        & system%body%dim))/2, 1.0e-6_wp, 'work')
    end associate
  end subroutine test_bonds

  !> The bound of the stiffness of a system's terms.
  subroutine bounds(system, bound)
    type(system_type), intent(in), target :: system
    real(wp), intent(inout), contiguous :: bound(:)
    type(term_view_type) :: view

    view%body => system%body
    view%u => system%state%u
    call system%terms%add_stiffness_bound(view, bound)
  end subroutine bounds

end module test_force_term
