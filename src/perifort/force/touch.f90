!> Contact of points with the surface of a rigid body (doc/theory.md, 17): a term of the force.
!>
!> A point nearer to the surface than a distance D, or than it was at the start if that was less, is
!> pushed along the normal of the surface with the force density s d (d + 1) K/delta^2 (D - gap) in
!> d dimensions, what the bonds of half a family make of such a displacement. Restitution, damping
!> and friction are those of contact between points (`pd_force_contact`). The body bears the
!> opposite force where the point is, so that no moment is lost.
module pd_force_touch
  use pd_base_archive, only: archive_type
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i4
  use pd_base_reduce, only: add_point, new_running, running_type, total_of_running
  use pd_base_vectors, only: cross
  use pd_body_body, only: body_type
  use pd_force_contact, only: contact_rule_type, normal_force, of_friction, of_normal_force, slope
  use pd_force_obstacle, only: find_gap, shift_at, surface_of, velocity_at
  use pd_force_term, only: density_of, force_term_type, no_tangent, term_list_type, term_view_type
  implicit none (type, external)
  private
  public :: touch_type, new_touch, loads_on, points_within

  real(wp), parameter :: usual_distance = 0.5_wp  !! of the point's spacing: where its cell ends
  real(wp), parameter :: crowded = 2.0_wp
    !! points that touch at once over those of a lattice on the area, for the bound of the stiffness

  !> Contact with one rigid body as a term.
  type, extends(force_term_type) :: touch_type
    integer :: part = of_normal_force
    integer :: obstacle = 0                  !! number of the rigid body
    type(contact_rule_type) :: rule
    integer(i4), allocatable :: slots(:)     !! points that may touch, in order
    real(wp), allocatable :: begins(:)       !! gap at which each is pushed [m]
    real(wp) :: delta = 1.0_wp               !! horizon [m]
  contains
    procedure :: add_force
    procedure :: add_energy
    procedure :: add_stiffness_bound
    procedure :: add_damping_bound
    procedure :: begin
    procedure :: keep
    procedure :: describe
    procedure :: subtract_partner
  end type touch_type

contains

  !> Contact of the points of some bodies with a rigid body.
  subroutine new_touch(body, delta, rule, touches, obstacle, part, touch)
    type(body_type), intent(in) :: body             !! arranged in slots
    real(wp), intent(in) :: delta                   !! horizon [m]
    type(contact_rule_type), intent(in) :: rule     !! how they meet; its sides do not count
    logical, intent(in) :: touches(:)               !! (bodies) whose points may touch
    integer, intent(in) :: obstacle                 !! number of the rigid body
    integer, intent(in) :: part                     !! `of_normal_force` or `of_friction`
    type(touch_type), intent(out) :: touch          !! ready to begin

    touch%name = 'contact'
    if (part == of_friction) touch%name = 'friction'
    touch%conservative = part == of_normal_force .and. rule%returned >= 1.0_wp .and. &
      & rule%damping <= 0.0_wp
    touch%tangent = no_tangent
    touch%has_partner = .true.
    touch%part = part
    touch%obstacle = obstacle
    touch%rule = rule
    touch%delta = delta
    touch%slots = pack(body%slot, touches(body%body(body%slot)))
    touch%begins = usual_distance*body%spacing(touch%slots)
    if (rule%distance > 0.0_wp) touch%begins = rule%distance
  end subroutine new_touch

  !> Where points are at the start: those that are nearer then are pushed from that gap on.
  subroutine begin(self, view)
    class(touch_type), intent(inout) :: self  !! the contact
    type(term_view_type), intent(in) :: view  !! the start
    real(wp) :: gap, normal(3)
    integer :: i

    do i = 1, size(self%slots)
      call find_gap(view%obstacles(self%obstacle), place_of(view, int(self%slots(i))), gap, normal)
      self%begins(i) = min(self%begins(i), gap)
    end do
  end subroutine begin

  !> Where a point is [m].
  pure function place_of(view, k) result(y)
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: k   !! slot
    real(wp) :: y(size(view%u, 2))
    y = view%body%x(k, :) + view%u(k, :)
  end function place_of

  !> The force density that contact makes on each point.
  subroutine add_force(self, view, force)
    class(touch_type), intent(in) :: self       !! the contact
    type(term_view_type), intent(in) :: view    !! the instant
    real(wp), intent(inout), contiguous :: force(:, :)
      !! (n_slots, dim) force density, added to [N/m3]
    real(wp) :: push(3), stored
    integer :: i, k
    logical :: touches

    !$omp parallel do schedule(static) default(none) shared(self, view, force) &
    !$omp private(i, k, push, stored, touches)
    do i = 1, size(self%slots)
      call touch_point(self, view, i, touches, push, stored)
      if (.not. touches) cycle
      k = self%slots(i)
      force(k, :) = force(k, :) + push(:size(force, 2))
    end do
  end subroutine add_force

  !> What is stored: the elastic part of pushing.
  subroutine add_energy(self, view, density)
    class(touch_type), intent(in) :: self       !! the contact
    type(term_view_type), intent(in) :: view    !! the instant
    real(wp), intent(inout), contiguous :: density(:)
      !! (n_slots) energy density, added to [J/m3]
    real(wp) :: push(3), stored
    integer :: i
    logical :: touches

    if (self%part /= of_normal_force) return
    !$omp parallel do schedule(static) default(none) shared(self, view, density) &
    !$omp private(i, push, stored, touches)
    do i = 1, size(self%slots)
      call touch_point(self, view, i, touches, push, stored)
      if (touches) density(self%slots(i)) = density(self%slots(i)) + stored
    end do
  end subroutine add_energy

  !> The force density on the `i`-th point, and the energy density that it stores.
  pure subroutine touch_point(self, view, i, touches, push, stored)
    class(touch_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: i
    logical, intent(out) :: touches
    real(wp), intent(out) :: push(3)     !! [N/m3]
    real(wp), intent(out) :: stored      !! [J/m3]
    real(wp) :: y(size(view%u, 2)), v(3), normal(3)
    real(wp) :: gap, stiffness, critical, speed, normal_part
    integer :: k

    k = self%slots(i)
    y = place_of(view, k)
    associate (obstacle => view%obstacles(self%obstacle))
      call find_gap(obstacle, y, gap, normal)
      touches = gap < self%begins(i)
      push = 0.0_wp
      stored = 0.0_wp
      if (.not. touches) return
      stiffness = stiffness_of(self, view, k)
      stored = stiffness*(self%begins(i) - gap)**2/2
      v = -velocity_at(obstacle, y)
      v(:size(y)) = v(:size(y)) + view%v(k, :)
      speed = dot_product(v, normal)
      critical = 0.0_wp
      if (self%rule%damping > 0.0_wp .or. self%part == of_friction) critical = &
        & critical_damping(view, k, stiffness, obstacle%per_mass)
      normal_part = normal_force(self%rule, stiffness, self%begins(i) - gap, speed, critical)
      if (self%part == of_normal_force) then
        push = normal_part*normal
      else
        v = v - speed*normal
        speed = norm2(v)
        if (speed > 0.0_wp) push = -min(self%rule%friction*normal_part, slope*critical*speed) &
          & *(v/speed)
      end if
    end associate
  end subroutine touch_point

  !> Stiffness of a point against the surface, per volume [N/m4].
  pure real(wp) function stiffness_of(self, view, k) result(stiffness)
    class(touch_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: k   !! slot

    associate (dim => view%body%dim)
      stiffness = self%rule%stiffness*dim*(dim + 1) &
        & *view%materials(view%body%material(k))%bulk_modulus/self%delta**2
    end associate
  end function stiffness_of

  !> Critical damping of a point against the body, per volume: 2 sqrt(K m) with the reduced mass m
  !> of both [N s/m4].
  pure real(wp) function critical_damping(view, k, stiffness, per_mass) result(critical)
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: k                !! slot
    real(wp), intent(in) :: stiffness       !! per volume [N/m4]
    real(wp), intent(in) :: per_mass        !! of the body [1/kg]

    associate (density => density_of(view, k))
      critical = 2*sqrt(stiffness*density/(1 + density*view%body%volume(k)*per_mass))
    end associate
  end function critical_damping

  !> Force and moment about its centre [N], [N m] that the points of all contacts exert on a rigid
  !> body.
  function loads_on(terms, view, number) result(totals)
    type(term_list_type), intent(in) :: terms   !! of a system
    type(term_view_type), intent(in) :: view    !! the instant
    integer, intent(in) :: number               !! of the rigid body
    real(wp) :: totals(6)                       !! force, then moment
    integer :: t

    totals = 0.0_wp
    do t = 1, terms%number()
      select type (touch => terms%items(t)%term)
      type is (touch_type)
        if (touch%obstacle == number) totals = totals + loads_of(touch, view)
      class default  ! it does not touch the body
        continue
      end select
    end do
  end function loads_on

  !> Those of one term: points are tried by all threads, and summed in their order.
  function loads_of(self, view) result(totals)
    type(touch_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp) :: totals(6)
    type(running_type) :: running
    real(wp), allocatable :: push(:, :)
    logical, allocatable :: touches(:)
    real(wp) :: force(3), arm(3), stored
    integer :: i, k

    allocate (push(3, size(self%slots)), touches(size(self%slots)))
    !$omp parallel do schedule(static) default(none) shared(self, view, push, touches) &
    !$omp private(i, stored)
    do i = 1, size(self%slots)
      call touch_point(self, view, i, touches(i), push(:, i), stored)
    end do
    call new_running(view%body%order, running)
    do i = 1, size(self%slots)
      if (.not. touches(i)) cycle
      k = self%slots(i)
      force = -push(:, i)*view%body%volume(k)
      arm = -view%obstacles(self%obstacle)%centre
      arm(:view%body%dim) = arm(:view%body%dim) + place_of(view, k)
      call add_point(view%body%order, view%body%point(k), [force, cross(arm, force)], running)
    end do
    totals = total_of_running(view%body%order, running)
  end function loads_of

  !> How many of the points that may touch a rigid body are within it, in all terms, and one of
  !> them: the first.
  subroutine points_within(terms, view, number, within, first)
    type(term_list_type), intent(in) :: terms   !! of a system
    type(term_view_type), intent(in) :: view    !! the start
    integer, intent(in) :: number               !! of the rigid body
    integer, intent(out) :: within
    integer, intent(out) :: first               !! slot, 0 if there is none
    real(wp) :: gap, normal(3)
    integer :: t, i

    within = 0
    first = 0
    do t = 1, terms%number()
      select type (touch => terms%items(t)%term)
      type is (touch_type)
        if (touch%obstacle /= number .or. touch%part /= of_normal_force) cycle
        do i = 1, size(touch%slots)
          call find_gap(view%obstacles(number), place_of(view, int(touch%slots(i))), gap, normal)
          if (gap >= 0.0_wp) cycle
          within = within + 1
          if (first == 0) first = touch%slots(i)
        end do
      class default  ! it does not touch the body
        continue
      end select
    end do
  end subroutine points_within

  !> Take from displacements since the last instant what the body's material has moved at the points
  !> that touch it: what is left does work on contact.
  subroutine subtract_partner(self, view, moved)
    class(touch_type), intent(in) :: self       !! the contact
    type(term_view_type), intent(in) :: view    !! the instant
    real(wp), intent(inout) :: moved(:, :)      !! (n_slots, dim) [m]
    real(wp) :: shift(3)
    integer :: i, k

    do i = 1, size(self%slots)
      k = self%slots(i)
      shift = shift_at(view%obstacles(self%obstacle), place_of(view, k))
      moved(k, :) = moved(k, :) - shift(:size(moved, 2))
    end do
  end subroutine subtract_partner

  !> A spring between a point and the body: a frequency omega^2 of at most twice that of the point
  !> alone or of the body alone with all springs that may touch it at once, whichever is more.
  subroutine add_stiffness_bound(self, view, bound)
    class(touch_type), intent(in) :: self       !! the contact
    type(term_view_type), intent(in) :: view    !! of the body
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the stiffness, added to [N/m4]
    real(wp) :: ratio
    integer :: i, k

    if (self%part == of_friction .or. size(self%slots) == 0) return
    ratio = mass_ratio(self, view)
    do i = 1, size(self%slots)
      k = self%slots(i)
      bound(k) = bound(k) + 2*stiffness_of(self, view, k)*max(1.0_wp, ratio*density_of(view, k))
    end do
  end subroutine add_stiffness_bound

  !> The volume of all points that may touch at once over the mass that they move, and turn [m3/kg].
  real(wp) function mass_ratio(self, view) result(ratio)
    type(touch_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp) :: least, arm

    ratio = 0.0_wp
    associate (obstacle => view%obstacles(self%obstacle), body => view%body)
      if (.not. max(obstacle%per_mass, obstacle%per_inertia) > 0.0_wp) return
      least = minval(body%spacing(self%slots))
      arm = norm2(obstacle%half) + maxval(self%begins)
      ratio = crowded*surface_of(obstacle, maxval(self%begins))/least**(body%dim - 1)
      ratio = min(ratio, real(size(self%slots), wp))
      ratio = ratio*maxval(body%volume(self%slots))*(obstacle%per_mass &
        & + arm**2*obstacle%per_inertia)
    end associate
  end function mass_ratio

  !> The dashpots of damping, or of friction.
  subroutine add_damping_bound(self, view, bound)
    class(touch_type), intent(in) :: self       !! the contact
    type(term_view_type), intent(in) :: view    !! of the body
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the damping, added to [N s/m4]
    real(wp) :: part, ratio
    integer :: i, k

    part = self%rule%damping
    if (self%part == of_friction) part = slope
    if (.not. part > 0.0_wp .or. size(self%slots) == 0) return
    ratio = mass_ratio(self, view)
    do i = 1, size(self%slots)
      k = self%slots(i)
      bound(k) = bound(k) + 2*part*critical_damping(view, k, stiffness_of(self, view, k), 0.0_wp) &
        & *max(1.0_wp, ratio*density_of(view, k))
    end do
  end subroutine add_damping_bound

  !> All follows from displacements but where contact begins.
  subroutine keep(self, archive)
    class(touch_type), intent(inout) :: self       !! the contact
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read

    call archive%keep(self%name//' with a rigid body began', self%begins)
  end subroutine keep

  !> The scene's own lines describe it.
  function describe(self) result(text)
    class(touch_type), intent(in) :: self  !! the contact
    character(:), allocatable :: text

    text = ''
    if (.not. allocated(self%slots)) call internal_fault('contact with a rigid body has no points')
  end function describe

end module pd_force_touch
