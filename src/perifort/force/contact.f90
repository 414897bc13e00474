!> Contact of points that share no intact bond (doc/theory.md, 17): a term of the force.
!>
!> Two points closer than a distance D, or than they were at the start if that was less, push apart
!> along the line between them: k pushes j with the force density s c (D - d)/delta V_k, c the bond
!> constant of the mean of both materials. What separates pushes less if there is a restitution e,
!> by e^2; or a dashpot acts along the line. Friction acts across it.
!>
!> With smoothed normals the overlap of points of different bodies is that along the normal of both
!> surfaces, shared among all that are beside each other (`pd_force_normals`).
!>
!> Pairs are searched in cells whose reach is D and a skin; the pairs are kept until some point has
!> moved by half the skin, so that none is missed: two points that were farther apart than D and the
!> skin are then still farther apart than D. What a point sums up is in the order of the others'
!> numbers, and pairs farther apart than D add nothing: so the bits do not depend on when the search
!> was, nor on the number of threads.
module pd_force_contact
  use pd_base_archive, only: archive_type
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i4
  use pd_body_body, only: body_type
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_force_movement, only: is_noted, moved, movement_type, new_movement, note_instant, &
    & remember_places
  use pd_force_normals, only: add_couples, find_normals, find_rates, frame_type, meet, &
    & normal_of_pair, patch_radius, patch_type, renew_intact, surface_normals, surface_type, &
    & take_surface
  use pd_force_pairs, only: pairs_type, search_pairs
  use pd_force_term, only: density_of, force_term_type, no_tangent, term_view_type
  use pd_law_material, only: material_type
  implicit none (type, external)
  private
  public :: contact_type, contact_rule_type, new_contact, of_normal_force, of_friction
  public :: normal_force, slope

  !> What a term of contact is: pushing along the line between points, or friction across it.
  integer, parameter :: of_normal_force = 1, of_friction = 2

  real(wp), parameter :: skin_between = 0.5_wp   !! of the smaller spacing, of bodies apart
  real(wp), parameter :: skin_within = 0.09_wp   !! where bonded neighbours would be candidates
  real(wp), parameter :: usual_distance = 0.9_wp !! of the smaller spacing
  real(wp), parameter :: slope = 0.5_wp
    !! dashpot that regularises friction, over the critical one of a pair
  !> Contacts that a point may have at once, by dimension, for the bound of the stiffness.
  integer, parameter :: most_contacts(3) = [2, 4, 8]
  integer, parameter :: at_once = 128            !! points of a chunk of a thread
  integer, parameter :: worth_threads = 1000     !! points that are near others
  !> Overlap over the spacing that is none: pairs that are where they were at the start do not touch
  !> yet, however their distance is rounded; a dashpot would act at once.
  real(wp), parameter :: nothing = 1.0e-12_wp
  !> Half of the skin may be used up but for rounding.
  real(wp), parameter :: but_rounding = 1 - 1.0e-6_wp

  !> What a `&contact` says.
  type :: contact_rule_type
    integer, allocatable :: side(:)        !! (bodies) that may meet those of other sides; 0: none
    logical :: pieces = .false.            !! points of one side meet, too, unless bonded
    real(wp) :: stiffness = 1.0_wp         !! s [-]
    real(wp) :: distance = 0.0_wp          !! D [m], 0 for the usual one
    real(wp) :: friction = 0.0_wp          !! [-]
    real(wp) :: returned = 1.0_wp          !! e^2, part of the energy that comes back [-]
    real(wp) :: damping = 0.0_wp           !! over the critical one [-]
    logical :: smoothed = .true.           !! bodies push along normals of their surfaces
  end type contact_rule_type

  !> Contact as a term.
  type, extends(force_term_type) :: contact_type
    integer :: part = of_normal_force
    type(contact_rule_type) :: rule
    integer(i4), allocatable :: slots(:)     !! points that may touch, in order
    integer, allocatable :: side(:)          !! of each of these
    real(wp), allocatable :: reach(:)        !! up to which each meets points of other bodies, its
                                             !! half of the distance and of the skin [m]
    real(wp), allocatable :: within(:)       !! and of its own body [m]
    real(wp), allocatable :: begun(:, :)     !! (n_slots, dim) where points were at the start [m]
    logical :: smoothed = .false.            !! there are bodies that push along normals
    real(wp), allocatable :: normals(:, :)   !! (3, n_slots) normals of their surfaces then, times
                                             !! their weights, if so
    real(wp) :: skin = 0.0_wp                !! [m]
    real(wp) :: delta = 1.0_wp               !! horizon, the largest one of all points [m]
    real(wp) :: ratio = 0.0_wp               !! horizon over spacing of each point; 0: one horizon
    logical :: follows = .false.             !! it stands behind the term of the normal force of
                                             !! the same rule, and takes what that has found
    type(movement_type) :: movement          !! since the last search
    type(pairs_type) :: pairs                !! then
    type(surface_type) :: surface            !! of these points, if it is smoothed
    type(frame_type) :: frame                !! its normals at the noted instant
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
  end type contact_type

  !> How two points meet.
  type :: meeting_type
    type(patch_type) :: patch
    real(wp) :: n(3) = 0.0_wp        !! unit vector along which they push
    real(wp) :: begins = 0.0_wp      !! gap at which they begin to [m]
    real(wp) :: length = 0.0_wp      !! of the difference of their normals; 0: along their line [-]
  end type meeting_type

contains

  !> Contact by a rule: of the bodies' points in their slots.
  subroutine new_contact(body, delta, ratio, rule, part, contact)
    type(body_type), intent(in) :: body             !! arranged in slots
    real(wp), intent(in) :: delta                   !! horizon, the largest one of all points [m]
    real(wp), intent(in) :: ratio
      !! horizon over spacing, if points have their own, else 0 [-]
    type(contact_rule_type), intent(in) :: rule     !! who meets whom, and how
    integer, intent(in) :: part                     !! `of_normal_force` or `of_friction`
    type(contact_type), intent(out) :: contact      !! ready to begin
    real(wp) :: least
    integer :: i

    contact%name = 'contact'
    if (part == of_friction) contact%name = 'friction'
    contact%slots = pack(body%slot, rule%side(body%body(body%slot)) > 0)
    contact%side = rule%side(body%body(contact%slots))
    contact%smoothed = rule%smoothed .and. body%dim > 1 .and. count(rule%side > 0) > 1
    ! without losses no account of work is needed, which would look at all points in every step
    contact%conservative = part == of_normal_force .and. rule%returned >= 1.0_wp .and. &
      & rule%damping <= 0.0_wp
    contact%tangent = no_tangent
    contact%part = part
    contact%rule = rule
    contact%delta = delta
    contact%ratio = ratio
    contact%acts_on_few = .true.
    least = minval(body%spacing(contact%slots))
    contact%skin = merge(skin_within, skin_between, rule%pieces)*least
    allocate (contact%within(size(contact%slots)), contact%reach(size(contact%slots)))
    do i = 1, size(contact%slots)
      associate (spacing => body%spacing(contact%slots(i)))
        contact%within(i) = usual_distance*spacing/2
        if (rule%distance > 0.0_wp) contact%within(i) = rule%distance/2
        contact%reach(i) = contact%within(i)
        if (contact%smoothed) contact%reach(i) = reach_of_patch(contact%within(i), spacing/2)
      end associate
    end do
    contact%within = contact%within + contact%skin/2
    contact%reach = contact%reach + contact%skin/2
    call new_movement(body, contact%slots, contact%movement)
  end subroutine new_contact

  !> The longest distance of two points that touch along a normal [m].
  pure real(wp) function reach_of_patch(distance, spacing) result(reach)
    real(wp), intent(in) :: distance   !! at which they begin to push [m]
    real(wp), intent(in) :: spacing    !! mean of both [m]

    reach = sqrt(max(distance, patch_radius(spacing))**2 + patch_radius(spacing)**2)
  end function reach_of_patch

  !> Where points are at the start: pairs that are nearer then push from that distance on.
  subroutine begin(self, view)
    class(contact_type), intent(inout) :: self  !! the contact
    type(term_view_type), intent(in) :: view    !! the start

    real(wp), allocatable :: normals(:, :)

    self%begun = view%body%x + view%u
    if (.not. self%smoothed) return
    call surface_normals(view, self%slots, normals)
    if (allocated(self%normals)) deallocate (self%normals)
    allocate (self%normals(3, size(view%u, 1)), source=0.0_wp)
    self%normals(:, self%slots) = normals
  end subroutine begin

  !> Search anew if points may have come near: one of them has moved by half the skin.
  subroutine search(self, view, before)
    class(contact_type), intent(inout) :: self  !! the contact
    type(term_view_type), intent(in) :: view    !! the instant
    class(force_term_type), intent(in), optional :: before
      !! the term that stands before it in a list, which has searched

    if (self%follows .and. present(before)) then
      select type (before)
      type is (contact_type)
        if (self%movement%searches /= before%movement%searches) then
          self%pairs = before%pairs
          self%surface = before%surface
          self%movement%searches = before%movement%searches
        end if
        if (self%smoothed) then
          call renew_intact(self%surface, view)
          self%frame = before%frame
        end if
      class default
        call internal_fault('friction follows no contact')
      end select
    else if (.not. still_holds(self, view)) then
      call find_pairs(self, view, self%pairs, self%surface)
      call remember_places(self%movement, view%u)
    end if
    if (self%smoothed .and. .not. self%follows) then
      call renew_intact(self%surface, view)
      call find_frame(self, self%pairs, self%surface, view, self%frame)
    end if
    call note_instant(self%movement, view)
  end subroutine search

  !> Whether no pair is near that the last search has not found.
  logical function still_holds(self, view) result(holds)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view

    holds = .false.
    if (allocated(self%movement%u)) &
      & holds = moved(self%movement, view%u) < but_rounding*self%skin/2
  end function still_holds

  !> The pairs that are near, and the surfaces of those that had one at the start.
  subroutine find_pairs(self, view, pairs, surface)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    type(pairs_type), intent(out) :: pairs
    type(surface_type), intent(out) :: surface
    integer :: i

    if (.not. allocated(self%begun)) call internal_fault('contact has not begun')
    call search_pairs(view, self%slots, self%side, self%reach, self%within, self%rule%pieces, pairs)
    if (self%smoothed) call take_surface(view, pairs%slots, &
      & [(norm2(self%normals(:, pairs%slots(i))), i=1, size(pairs%slots))], surface)
  end subroutine find_pairs

  !> Points that are near others, and with smoothed normals their families.
  subroutine acting(self, view, slots)
    class(contact_type), intent(in) :: self     !! the contact
    type(term_view_type), intent(in) :: view    !! the instant
    integer(i4), allocatable, intent(out) :: slots(:)
    type(pairs_type) :: pairs
    type(surface_type) :: surface

    if (is_noted(self%movement, view)) then
      slots = self%pairs%slots
      if (self%smoothed) slots = self%surface%around
    else
      call find_pairs(self, view, pairs, surface)
      slots = pairs%slots
      if (self%smoothed) slots = surface%around
    end if
  end subroutine acting

  !> The force density that contact makes on each point.
  subroutine add_force(self, view, force)
    class(contact_type), intent(in) :: self     !! the contact
    type(term_view_type), intent(in) :: view    !! the instant
    real(wp), intent(inout), contiguous :: force(:, :)
      !! (n_slots, dim) force density, added to [N/m3]
    real(wp) :: energies(0)

    call pass(self, view, force, energies)
  end subroutine add_force

  !> What is stored: the elastic part of pushing, half of it at each end.
  subroutine add_energy(self, view, density)
    class(contact_type), intent(in) :: self     !! the contact
    type(term_view_type), intent(in) :: view    !! the instant
    real(wp), intent(inout), contiguous :: density(:)
      !! (n_slots) energy density, added to [J/m3]
    real(wp) :: forces(0, size(view%u, 2))

    if (self%part == of_normal_force) call pass(self, view, forces, density)
  end subroutine add_energy

  !> Forces or energies of all points, whichever has a size. At an instant that was not searched, as
  !> in a state that is only tried, it searches for itself.
  subroutine pass(self, view, force, energy)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: force(:, :)
    real(wp), intent(inout), contiguous :: energy(:)
    type(pairs_type) :: pairs
    type(surface_type) :: surface
    type(frame_type) :: frame

    if (is_noted(self%movement, view) .and. (.not. self%smoothed &
      & .or. self%surface%broken == view%broken)) then
      call sum_up(self, self%pairs, self%surface, self%frame, view, force, energy)
    else
      call find_pairs(self, view, pairs, surface)
      if (self%smoothed) call find_frame(self, pairs, surface, view, frame)
      call sum_up(self, pairs, surface, frame, view, force, energy)
    end if
  end subroutine pass

  !> The normals of points that may touch.
  subroutine find_frame(self, pairs, surface, view, frame)
    class(contact_type), intent(in) :: self
    type(pairs_type), intent(in) :: pairs
    type(surface_type), intent(in) :: surface
    type(term_view_type), intent(in) :: view
    type(frame_type), intent(out) :: frame
    logical, allocatable :: may_touch(:)

    if (.not. allocated(self%normals)) call internal_fault('contact has not begun')
    call find_close(self, pairs, view, may_touch)
    call find_normals(surface, view, may_touch, frame)
  end subroutine find_frame

  !> Sum up near pairs, and what acts on normals.
  subroutine sum_up(self, pairs, surface, frame, view, force, energy)
    class(contact_type), intent(in) :: self
    type(pairs_type), intent(in) :: pairs
    type(surface_type), intent(in) :: surface
    type(frame_type), intent(in) :: frame
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: force(:, :)
    real(wp), intent(inout), contiguous :: energy(:)
    real(wp), allocatable :: rates(:, :), couples(:, :)

    if (self%smoothed) then
      if (self%part == of_friction .or. loses(self%rule)) &
        & call find_rates(surface, frame, view, rates)
      allocate (couples(3, size(pairs%slots)))
    end if
    call sum_pairs(self, pairs, frame, rates, view, force, energy, couples)
    if (self%smoothed .and. size(force) > 0) call add_couples(surface, frame, couples, force)
  end subroutine sum_up

  !> Which points have one of another body so close that they may touch along a normal.
  subroutine find_close(self, pairs, view, may_touch)
    class(contact_type), intent(in) :: self
    type(pairs_type), intent(in) :: pairs
    type(term_view_type), intent(in) :: view
    logical, allocatable, intent(out) :: may_touch(:)
    real(wp) :: r(3), reach
    integer :: i, e, k, j

    allocate (may_touch(size(pairs%slots)))
    !$omp parallel do if (size(pairs%slots) >= worth_threads) default(none) &
    !$omp schedule(dynamic, at_once) shared(self, pairs, view, may_touch) &
    !$omp private(r, reach, i, e, k, j)
    do i = 1, size(pairs%slots)
      k = pairs%slots(i)
      may_touch(i) = .false.
      do e = pairs%start(i), pairs%start(i + 1) - 1
        j = pairs%other(e)
        if (view%body%body(k) == view%body%body(j)) cycle
        reach = reach_of_patch(reach_of(self, k, j, view%body), (view%body%spacing(k) &
          & + view%body%spacing(j))/2)
        r = difference(view%body%x, k, j) + difference(view%u, k, j)
        may_touch(i) = dot_product(r, r) < reach**2
        if (may_touch(i)) exit
      end do
    end do
    !$omp end parallel do
  end subroutine find_close

  !> Sum up near pairs, point by point. Along a normal n the force is minus the gradient of the
  !> energy K w (b - g)^2/2, with the gap g along it and the weight w across it. What acts on n
  !> itself is the couple of the points, which goes to their families.
  subroutine sum_pairs(self, pairs, frame, rates, view, force, energy, couples)
    class(contact_type), intent(in) :: self
    type(pairs_type), intent(in) :: pairs
    type(frame_type), intent(in) :: frame
    real(wp), allocatable, intent(in) :: rates(:, :)       !! of the normals, if needed
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: force(:, :)
    real(wp), intent(inout), contiguous :: energy(:)
    real(wp), allocatable, intent(inout) :: couples(:, :)
    type(bonds_type) :: bonds
    type(meeting_type) :: meeting
    real(wp), dimension(3) :: r, v, turning, total, couple
    real(wp) :: stiffness, stored, push, critical, speed, aside, back
    integer :: i, e, k, j, dim
    logical :: ready, listed

    dim = size(view%u, 2)
    !$omp parallel if (size(pairs%slots) >= worth_threads) default(none) &
    !$omp shared(self, pairs, frame, rates, view, force, energy, couples, dim) &
    !$omp private(bonds, meeting, r, v, turning, total, couple, stiffness, stored, push, &
    !$omp critical, speed, aside, back, i, e, k, j, ready, listed)
    ready = .false.
    !$omp do schedule(dynamic, at_once)
    do i = 1, size(pairs%slots)
      k = pairs%slots(i)
      listed = .false.
      total = 0.0_wp
      couple = 0.0_wp
      stored = 0.0_wp
      do e = pairs%start(i), pairs%start(i + 1) - 1
        j = pairs%other(e)
        ! the layer of a boundary is moved as one
        if (view%body%layer(k) > 0 .and. view%body%layer(k) == view%body%layer(j)) cycle
        r = difference(view%body%x, k, j) + difference(view%u, k, j)
        if (self%smoothed) then
          call meet_pair(self, view, k, j, r, meeting, frame%normals(:, i), &
            & frame%normals(:, pairs%place(e)))
        else
          call meet_pair(self, view, k, j, r, meeting)
        end if
        if (.not. meeting%patch%touches) cycle
        if (self%rule%pieces) then
          if (.not. ready) call allocate_bonds(view%family, bonds)
          ready = .true.
          if (.not. listed) call view%family%bonds_of(k, bonds)
          listed = .true.
          if (any(bonds%j(:bonds%n) == j .and. bonds%intact(:bonds%n))) cycle
        end if
        associate (patch => meeting%patch, n => meeting%n, t => meeting%patch%across, &
          & overlap => meeting%begins - meeting%patch%gap)
          v = difference(view%v, k, j)
          speed = dot_product(v, n)
          v = v - speed*n
          if (meeting%length > 0.0_wp .and. allocated(rates)) then
            ! the normal turns, too: across it that is no sliding, and it changes the gap
            turning = (rates(:, i) - rates(:, pairs%place(e)))/meeting%length
            turning = turning - dot_product(turning, n)*n
            speed = speed + dot_product(turning, t)
            v = v - patch%gap*turning
          end if
          stiffness = stiffness_of(self, view, k, j)
          critical = 0.0_wp
          if (self%rule%damping > 0.0_wp .or. self%part == of_friction) &
            & critical = critical_damping(view, k, j, stiffness*patch%weight)
          push = normal_force(self%rule, stiffness*patch%weight, overlap, speed, critical)
          if (self%part == of_normal_force) then
            total = total - push*n
            stored = stored + stiffness*patch%weight*overlap**2/4
            if (meeting%length > 0.0_wp) then
              back = 1.0_wp
              if (speed > 0.0_wp) back = self%rule%returned
              back = back*stiffness*overlap**2/2*patch%slope
              total = total + back*t
              couple = couple + (push + back*patch%gap)/meeting%length*t
            end if
          else
            aside = sqrt(dot_product(v, v))
            if (.not. aside > 0.0_wp) cycle
            v = min(self%rule%friction*push, slope*critical*aside)*(v/aside)
            total = total + v
            if (meeting%length > 0.0_wp) couple = couple + patch%gap/meeting%length*v
          end if
        end associate
      end do
      if (size(force) > 0) force(k, :) = force(k, :) + total(:dim)
      if (size(energy) > 0) energy(k) = energy(k) + stored
      if (self%smoothed) couples(:, i) = couple
    end do
    !$omp end parallel
  end subroutine sum_pairs

  !> How two points meet: along the normal of their surfaces, from the gap on that they had at the
  !> start if they were near then; along the line of centres where one has none, or had none.
  pure subroutine meet_pair(self, view, k, j, r, meeting, one, other)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: k, j              !! slots
    real(wp), intent(in) :: r(3)             !! from k to j [m]
    type(meeting_type), intent(out) :: meeting
    real(wp), intent(in), optional :: one(3), other(3)   !! their normals, if they are smoothed
    real(wp) :: r0(3), n0(3), spacing, length, distance
    logical :: smooth

    meeting%begins = reach_of(self, k, j, view%body)
    smooth = .false.
    if (present(one) .and. view%body%body(k) /= view%body%body(j)) then
      call normal_of_pair(one, other, meeting%n, meeting%length)
      call normal_of_pair(self%normals(:, k), self%normals(:, j), n0, length)
      smooth = meeting%length > 0.0_wp .and. length > 0.0_wp
    end if
    if (smooth) then
      spacing = (view%body%spacing(k) + view%body%spacing(j))/2
      r0 = difference(self%begun, k, j)
      if (dot_product(r0, r0) < meeting%begins**2 + patch_radius(spacing)**2) &
        & meeting%begins = min(meeting%begins, dot_product(r0, n0))
      call meet(r, meeting%n, view%body%dim, spacing, meeting%begins - nothing*spacing, &
        & meeting%patch)
    else
      meeting%length = 0.0_wp
      distance = sqrt(dot_product(r, r))
      if (distance >= meeting%begins) return
      r0 = difference(self%begun, k, j)
      meeting%begins = min(meeting%begins, sqrt(dot_product(r0, r0)))
      if (distance >= (1 - nothing)*meeting%begins) return
      meeting%patch%touches = .true.
      meeting%patch%gap = distance
      meeting%patch%weight = 1.0_wp
      ! points at one place push along the line that they began with
      if (distance > 0.0_wp) r0 = r
      meeting%n = r0/sqrt(dot_product(r0, r0))
    end if
  end subroutine meet_pair

  !> From the vector of one slot to that of another, with three components.
  pure function difference(values, k, j) result(from)
    real(wp), intent(in) :: values(:, :)   !! (n_slots, dim)
    integer, intent(in) :: k, j            !! slots
    real(wp) :: from(3)
    integer :: c

    from = 0.0_wp
    do c = 1, size(values, 2)
      from(c) = values(j, c) - values(k, c)
    end do
  end function difference

  !> Whether forces depend on velocities.
  pure logical function loses(rule)
    type(contact_rule_type), intent(in) :: rule
    loses = rule%returned < 1.0_wp .or. rule%damping > 0.0_wp
  end function loses

  !> The force density by which two points push: never an attraction [N/m3].
  pure real(wp) function normal_force(rule, stiffness, overlap, speed, critical) result(push)
    type(contact_rule_type), intent(in) :: rule  !! its restitution or damping
    real(wp), intent(in) :: stiffness   !! of the pair, per volume [N/m4]
    real(wp), intent(in) :: overlap     !! of both, positive [m]
    real(wp), intent(in) :: speed       !! at which they separate [m/s]
    real(wp), intent(in) :: critical    !! damping of the pair, per volume [N s/m4]

    push = stiffness*overlap
    if (rule%returned < 1.0_wp .and. speed > 0.0_wp) push = rule%returned*push
    if (rule%damping > 0.0_wp) push = max(0.0_wp, push - rule%damping*critical*speed)
  end function normal_force

  !> Critical damping of a pair, per volume of point k: 2 sqrt(K m) with its reduced mass m
  !> [N s/m4].
  pure real(wp) function critical_damping(view, k, j, stiffness) result(critical)
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: k, j         !! slots
    real(wp), intent(in) :: stiffness   !! of the pair, per volume of point k [N/m4]
    real(wp) :: one, other

    one = density_of(view, k)*view%body%volume(k)
    other = density_of(view, j)*view%body%volume(j)
    critical = 2*sqrt(stiffness*one*other/(one + other)/view%body%volume(k))
  end function critical_damping

  !> Distance D of two points [m].
  pure real(wp) function reach_of(self, k, j, body)
    class(contact_type), intent(in) :: self
    integer, intent(in) :: k, j          !! slots
    type(body_type), intent(in) :: body

    reach_of = self%rule%distance
    if (.not. reach_of > 0.0_wp) &
      & reach_of = usual_distance*min(body%spacing(k), body%spacing(j))
  end function reach_of

  !> The stiffness of a pair, per volume: s c V_j/delta with the larger horizon of both [N/m4].
  pure real(wp) function stiffness_of(self, view, k, j) result(stiffness)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: k, j   !! slots

    stiffness = self%rule%stiffness*(constant_of(view, k) + constant_of(view, j))/2/self%delta &
      & *view%body%volume(j)
    ! c/delta goes with the horizon to the power of -(dim + 2)
    if (self%ratio > 0.0_wp) stiffness = stiffness*(self%delta/(self%ratio &
      & *max(view%body%spacing(k), view%body%spacing(j))))**(view%body%dim + 2)
  end function stiffness_of

  !> The constant of bonds of a point's material: 18 K/(pi delta^4) in 3D [N/m6].
  pure real(wp) function constant_of(view, k) result(c)
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: k
    real(wp), parameter :: times(3) = [4.0_wp, 6.0_wp, 8.0_wp]

    associate (m => view%materials(view%body%material(k)))
      c = times(view%body%dim)*m%bulk_modulus*m%d
    end associate
  end function constant_of

  !> A point may touch a few others at once, with the stiffness of the largest of them; their
  !> displacements move it as its own does.
  subroutine add_stiffness_bound(self, view, bound)
    class(contact_type), intent(in) :: self     !! the contact
    type(term_view_type), intent(in) :: view    !! of the body
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the stiffness, added to [N/m4]
    real(wp) :: largest
    integer :: i, k

    if (self%part == of_friction .or. size(self%slots) == 0) return
    largest = largest_stiffness(self, view)
    do i = 1, size(self%slots)
      k = self%slots(i)
      bound(k) = bound(k) + 2*most_contacts(view%body%dim)*largest*part_of_largest(self, view, k)
    end do
  end subroutine add_stiffness_bound

  !> How stiff a point's pairs are at most, over the largest stiffness of all [-]: 1 for one
  !> horizon. With V_j proportional to h_j^n, h_j^n/max(h_k, h_j)^(n + 2) is largest where both
  !> spacings are those of the point: it goes with 1/h_k^2.
  pure real(wp) function part_of_largest(self, view, k) result(part)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: k

    part = 1.0_wp
    if (self%ratio > 0.0_wp) part = (minval(view%body%spacing(self%slots)) &
      & /view%body%spacing(k))**2
  end function part_of_largest

  !> The stiffness of a pair of the stiffest material and the largest volume, per volume [N/m4];
  !> where points have their own horizons, of two points of the least spacing.
  pure real(wp) function largest_stiffness(self, view) result(stiffness)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp) :: least
    integer :: i

    stiffness = self%rule%stiffness*maxval([(constant_of(view, int(self%slots(i))), i=1, &
      & size(self%slots))])/self%delta
    if (self%ratio > 0.0_wp) then
      associate (dim => view%body%dim, h => view%body%spacing(self%slots))
        least = minval(h)
        stiffness = stiffness*maxval(view%body%volume(self%slots)/h**dim)*least**dim &
          & *(self%delta/(self%ratio*least))**(dim + 2)
      end associate
    else
      stiffness = stiffness*maxval(view%body%volume(self%slots))
    end if
  end function largest_stiffness

  !> The dashpots of damping, or of friction.
  subroutine add_damping_bound(self, view, bound)
    class(contact_type), intent(in) :: self     !! the contact
    type(term_view_type), intent(in) :: view    !! of the body
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the damping, added to [N s/m4]
    real(wp) :: part, largest
    integer :: i, k

    part = self%rule%damping
    if (self%part == of_friction) part = slope
    if (.not. part > 0.0_wp .or. size(self%slots) == 0) return
    largest = largest_stiffness(self, view)
    do i = 1, size(self%slots)
      k = self%slots(i)
      bound(k) = bound(k) + 2*most_contacts(view%body%dim)*2*part &
        & *sqrt(largest*part_of_largest(self, view, k)*density_of(view, k))
    end do
  end subroutine add_damping_bound

  !> All follows from displacements; the pairs are searched anew, which changes no bit.
  subroutine keep(self, archive)
    class(contact_type), intent(inout) :: self     !! the contact
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read

    call archive%keep(self%name//' began', self%begun)
    if (self%smoothed) call archive%keep(self%name//' normals began', self%normals)
  end subroutine keep

  !> The scene's own lines describe it.
  function describe(self) result(text)
    class(contact_type), intent(in) :: self  !! the contact
    character(:), allocatable :: text

    text = ''
    if (.not. allocated(self%slots)) text = 'contact nowhere'
  end function describe

end module pd_force_contact
