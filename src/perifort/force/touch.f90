!> Contact of points with the surface of a rigid body (doc/theory.md, 17): a term of the force.
!>
!> A point nearer to the surface than a distance D, or than it was at the start if that was less, is
!> pushed along the normal of the surface with the force density s d (d + 1) K/delta^2 (D - gap) in
!> d dimensions, what the bonds of half a family make of such a displacement. Restitution, damping
!> and friction are those of contact between points (`pd_force_contact_law`). The body bears the
!> opposite force where the point is, so that no moment is lost.
!>
!> The points within D and a skin of the surface are listed. The distance of a point changes by no
!> more than the point, the body's centre, and by rotation the body's material beside the point have
!> moved: as long as these together are less than the skin, no other point can touch.
!>
!> Of several ranks each has its own points, and all have the body. They list anew together, so that
!> lists do not depend on the ranks.
module pd_force_touch
  use pd_base_archive, only: archive_type, same
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_reduce, only: add_point, count_of_ranks, largest_of_ranks, new_running, &
    & running_type, total_of_running
  use pd_base_text, only: to_text
  use pd_base_vectors, only: cross
  use pd_body_body, only: body_type, number_at
  use pd_force_contact_law, only: contact_rule_type, normal_force, of_friction, of_normal_force, &
    & slope
  use pd_force_movement, only: is_noted, moved, movement_type, new_movement, note_instant, &
    & remember_places
  use pd_force_obstacle, only: find_gap, note_pose, obstacle_type, reach_of_shape, shift_at, &
    & surface_of, turned_at_most, velocity_at
  use pd_force_term, only: density_of, force_term_type, no_tangent, term_view_type
  use pd_force_terms, only: term_list_type
  implicit none (type, external)
  private
  public :: touch_type, new_touch, loads_on, points_within

  real(wp), parameter :: usual_distance = 0.5_wp  !! of the point's spacing: where its cell ends
  real(wp), parameter :: crowded = 2.0_wp
    !! points that touch at once over those of a lattice on the area, for the bound of the stiffness

  real(wp), parameter :: skin = 1.0_wp            !! of the smallest spacing
  !> The skin may be used up but for rounding.
  real(wp), parameter :: but_rounding = 1 - 1.0e-6_wp
  integer, parameter :: worth_threads = 1000      !! points that are near the surface

  !> Contact with one rigid body as a term.
  type, extends(force_term_type) :: touch_type
    integer :: part = of_normal_force
    integer :: obstacle = 0                  !! number of the rigid body
    type(contact_rule_type) :: rule
    integer(i4), allocatable :: slots(:)     !! owned points that may touch, in order
    integer(i8), allocatable :: numbers(:)   !! their numbers among the points of all ranks
    real(wp), allocatable :: begins(:)       !! gap at which each is pushed [m]
    integer(i8) :: points = 0_i8             !! that may touch, of all ranks; of these
    real(wp) :: least = 0.0_wp               !! the smallest spacing [m]
    real(wp) :: first = 0.0_wp               !! the largest gap at which one is pushed [m]
    real(wp) :: delta = 1.0_wp               !! horizon, if points do not have their own [m]
    real(wp) :: ratio = 0.0_wp               !! horizon over spacing of each point; 0: one horizon
    real(wp) :: skin = 0.0_wp                !! [m]
    logical :: follows = .false.             !! it stands behind the term of the normal force of
                                             !! the same rule, and takes what that has found
    integer, allocatable :: near(:)          !! which of the points were near at the last search
    type(obstacle_type) :: then              !! the surface then
    real(wp) :: farthest = 0.0_wp            !! from its centre was a point of any rank then [m]
    type(movement_type) :: movement          !! of the points since
  contains
    procedure :: add_force
    procedure :: add_energy
    procedure :: add_stiffness_bound
    procedure :: add_damping_bound
    procedure :: begin
    procedure :: search
    procedure :: acting
    procedure :: keep
    procedure :: describe
    procedure :: subtract_partner
  end type touch_type

contains

  !> Contact of the points of some bodies with a rigid body. All ranks call it together.
  subroutine new_touch(body, delta, ratio, rule, touches, obstacle, part, touch)
    type(body_type), intent(in) :: body             !! arranged in slots
    real(wp), intent(in) :: delta                   !! horizon, if points do not have their own [m]
    real(wp), intent(in) :: ratio
      !! horizon over spacing, if points have their own, else 0 [-]
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
    touch%ratio = ratio
    associate (owned => body%slot(:body%order%n_owned))
      touch%slots = pack(owned, touches(body%body(owned)))
    end associate
    touch%numbers = number_at(body, int(touch%slots))
    touch%points = count_of_ranks(body%order, size(touch%slots, kind=i8))
    touch%least = -largest_of_ranks(body%order, -minval(body%spacing(touch%slots)))
    touch%begins = usual_distance*body%spacing(touch%slots)
    if (rule%distance > 0.0_wp) touch%begins = rule%distance
    touch%acts_on_few = .true.
    if (touch%points > 0_i8) touch%skin = skin*touch%least
    call new_movement(body, touch%slots, touch%movement)
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
    self%first = largest_of_ranks(view%body%order, maxval(self%begins))
  end subroutine begin

  !> List the points near the surface anew if others may have come near.
  subroutine search(self, view, before)
    class(touch_type), intent(inout) :: self   !! the contact
    type(term_view_type), intent(in) :: view   !! the instant
    class(force_term_type), intent(in), optional :: before
      !! the term that stands before it in a list, which has searched

    if (self%follows .and. present(before)) then
      select type (before)
      type is (touch_type)
        if (self%movement%searches /= before%movement%searches) then
          self%near = before%near
          self%movement%searches = before%movement%searches
        end if
      class default
        call internal_fault('friction follows no contact with a rigid body')
      end select
    else if (.not. still_holds(self, view)) then
      call find_near(self, view, self%near, self%farthest)
      self%farthest = largest_of_ranks(view%body%order, self%farthest)
      call note_pose(view%obstacles(self%obstacle), self%then)
      call remember_places(self%movement, view%u)
    end if
    call note_instant(self%movement, view)
  end subroutine search

  !> Whether no point of any rank is near that the last search has not found.
  logical function still_holds(self, view) result(holds)
    class(touch_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp) :: way

    holds = .false.
    if (.not. allocated(self%movement%u) .or. self%points == 0_i8) return
    associate (now => view%obstacles(self%obstacle))
      way = norm2(now%centre - self%then%centre)
      ! without a look at the points if the body alone has moved too far
      if (way >= self%skin) return
      way = way + largest_of_ranks(view%body%order, moved(self%movement, view%u))
      way = way + turned_at_most(self%then, now, self%first, self%farthest + way)
    end associate
    holds = way < but_rounding*self%skin
  end function still_holds

  !> The points near the surface, and how far from the body's centre any point of this rank is.
  subroutine find_near(self, view, near, farthest)
    class(touch_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    integer, allocatable, intent(out) :: near(:)
    real(wp), intent(out) :: farthest             !! [m]
    logical :: is_near(size(self%slots))
    real(wp) :: gap, normal(3), y(size(view%u, 2)), away, within
    integer :: i

    farthest = 0.0_wp
    within = reach_of_shape(view%obstacles(self%obstacle))
    !$omp parallel do schedule(static) default(none) &
    !$omp shared(self, view, is_near, within) private(i, y, away, gap, normal) &
    !$omp reduction(max:farthest)
    do i = 1, size(self%slots)
      y = place_of(view, int(self%slots(i)))
      away = norm2(y - view%obstacles(self%obstacle)%centre(:size(y)))
      farthest = max(farthest, away)
      is_near(i) = away < within + self%begins(i) + self%skin
      if (.not. is_near(i)) cycle
      call find_gap(view%obstacles(self%obstacle), y, gap, normal)
      is_near(i) = gap < self%begins(i) + self%skin
    end do
    near = pack([(i, i=1, size(self%slots))], is_near)
  end subroutine find_near

  !> Points that are near the surface.
  subroutine acting(self, view, slots)
    class(touch_type), intent(in) :: self       !! the contact
    type(term_view_type), intent(in) :: view    !! the instant
    integer(i4), allocatable, intent(out) :: slots(:)
    integer, allocatable :: near(:)

    call take_near(self, view, near)
    slots = self%slots(near)
  end subroutine acting

  !> Which points are near the surface: at an instant that was not searched, all may be.
  subroutine take_near(self, view, near)
    class(touch_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    integer, allocatable, intent(out) :: near(:)
    integer :: i

    if (is_noted(self%movement, view)) then
      near = self%near
    else
      near = [(i, i=1, size(self%slots))]
    end if
  end subroutine take_near

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
    integer, allocatable :: near(:)
    real(wp) :: push(3), stored
    integer :: n, k
    logical :: touches

    call take_near(self, view, near)
    !$omp parallel do schedule(static) if (size(near) >= worth_threads) default(none) &
    !$omp shared(self, view, force, near) private(n, k, push, stored, touches)
    do n = 1, size(near)
      call touch_point(self, view, near(n), touches, push, stored)
      if (.not. touches) cycle
      k = self%slots(near(n))
      force(k, :) = force(k, :) + push(:size(force, 2))
    end do
  end subroutine add_force

  !> What is stored: the elastic part of pushing.
  subroutine add_energy(self, view, density)
    class(touch_type), intent(in) :: self       !! the contact
    type(term_view_type), intent(in) :: view    !! the instant
    real(wp), intent(inout), contiguous :: density(:)
      !! (n_slots) energy density, added to [J/m3]
    integer, allocatable :: near(:)
    real(wp) :: push(3), stored
    integer :: n, k
    logical :: touches

    if (self%part /= of_normal_force) return
    call take_near(self, view, near)
    !$omp parallel do schedule(static) if (size(near) >= worth_threads) default(none) &
    !$omp shared(self, view, density, near) private(n, k, push, stored, touches)
    do n = 1, size(near)
      call touch_point(self, view, near(n), touches, push, stored)
      k = self%slots(near(n))
      if (touches) density(k) = density(k) + stored
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
    real(wp) :: delta

    delta = self%delta
    if (self%ratio > 0.0_wp) delta = self%ratio*view%body%spacing(k)
    associate (dim => view%body%dim)
      stiffness = self%rule%stiffness*dim*(dim + 1) &
        & *view%materials(view%body%material(k))%bulk_modulus/delta**2
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
    integer, allocatable :: near(:)
    real(wp), allocatable :: push(:, :)
    logical, allocatable :: touches(:)
    real(wp) :: force(3), arm(3), stored
    integer :: n, k

    call take_near(self, view, near)
    allocate (push(3, size(near)), touches(size(near)))
    !$omp parallel do schedule(static) if (size(near) >= worth_threads) default(none) &
    !$omp shared(self, view, push, touches, near) private(n, stored)
    do n = 1, size(near)
      call touch_point(self, view, near(n), touches(n), push(:, n), stored)
    end do
    call new_running(running)
    do n = 1, size(near)
      if (.not. touches(n)) cycle
      k = self%slots(near(n))
      force = -push(:, n)*view%body%volume(k)
      arm = -view%obstacles(self%obstacle)%centre
      arm(:view%body%dim) = arm(:view%body%dim) + place_of(view, k)
      call add_point(view%body%order, view%body%point(k), [force, cross(arm, force)], running)
    end do
    totals = total_of_running(view%body%order, running)
  end function loads_of

  !> How many of the points that may touch a rigid body are within it, in all terms and of all
  !> ranks, and one of them: the first. All ranks call it together.
  subroutine points_within(terms, view, number, within, first)
    type(term_list_type), intent(in) :: terms   !! of a system
    type(term_view_type), intent(in) :: view    !! the start
    integer, intent(in) :: number               !! of the rigid body
    integer(i8), intent(out) :: within
    integer(i8), intent(out) :: first           !! its number, 0 if there is none
    real(wp) :: gap, normal(3)
    integer :: t, i

    within = 0_i8
    first = huge(0)
    do t = 1, terms%number()
      select type (touch => terms%items(t)%term)
      type is (touch_type)
        if (touch%obstacle /= number .or. touch%part /= of_normal_force) cycle
        do i = 1, size(touch%slots)
          call find_gap(view%obstacles(number), place_of(view, int(touch%slots(i))), gap, normal)
          if (gap >= 0.0_wp) cycle
          within = within + 1_i8
          first = min(first, touch%numbers(i))
        end do
      class default  ! it does not touch the body
        continue
      end select
    end do
    within = count_of_ranks(view%body%order, within)
    ! numbers of points are exact as reals
    first = -nint(largest_of_ranks(view%body%order, -real(first, wp)), i8)
    if (within == 0_i8) first = 0_i8
  end subroutine points_within

  !> Take from displacements since the last instant what the body's material has moved beside each
  !> point: what is left does work on contact.
  subroutine subtract_partner(self, view, slots, moved)
    class(touch_type), intent(in) :: self       !! the contact
    type(term_view_type), intent(in) :: view    !! the instant
    integer(i4), intent(in) :: slots(:)         !! of some points
    real(wp), intent(inout) :: moved(:, :)      !! (slots, dim) by how much they have moved [m]
    real(wp) :: shift(3)
    integer :: n

    do n = 1, size(slots)
      shift = shift_at(view%obstacles(self%obstacle), place_of(view, int(slots(n))))
      moved(n, :) = moved(n, :) - shift(:size(moved, 2))
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

    if (self%part == of_friction .or. self%points == 0_i8) return
    ratio = mass_ratio(self, view)
    do i = 1, size(self%slots)
      k = self%slots(i)
      bound(k) = bound(k) + 2*stiffness_of(self, view, k)*max(1.0_wp, ratio*density_of(view, k))
    end do
  end subroutine add_stiffness_bound

  !> The volume of all points that may touch at once over the mass that they move, and turn [m3/kg].
  !> All ranks call it together.
  real(wp) function mass_ratio(self, view) result(ratio)
    type(touch_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp) :: least, largest, arm

    ratio = 0.0_wp
    associate (obstacle => view%obstacles(self%obstacle), body => view%body)
      if (.not. max(obstacle%per_mass, obstacle%per_inertia) > 0.0_wp) return
      least = minval(body%spacing(self%slots))
      least = -largest_of_ranks(body%order, -least)
      arm = norm2(obstacle%half) + self%first
      ratio = crowded*surface_of(obstacle, self%first)/least**(body%dim - 1)
      ratio = min(ratio, real(self%points, wp))
      largest = maxval(body%volume(self%slots))
      largest = largest_of_ranks(body%order, largest)
      ratio = ratio*largest*(obstacle%per_mass + arm**2*obstacle%per_inertia)
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
    if (.not. part > 0.0_wp .or. self%points == 0_i8) return
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

    call archive%name_rows(self%name//' with body '//to_text(self%obstacle), self%numbers, &
      & spread(.true., 1, size(self%numbers)))
    call archive%over(self%name//' with body '//to_text(self%obstacle))
    call archive%keep(self%name//' with a rigid body began', self%begins)
    call archive%over(same)
  end subroutine keep

  !> The scene's own lines describe it.
  function describe(self) result(text)
    class(touch_type), intent(in) :: self  !! the contact
    character(:), allocatable :: text

    text = ''
    if (.not. allocated(self%slots)) call internal_fault('contact with a rigid body has no points')
  end function describe

end module pd_force_touch
