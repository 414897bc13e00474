!> Contact of points that share no intact bond (doc/theory.md, 17): a term of the force.
!>
!> Two points closer than a distance D, or than they were at the start if that was less, push apart
!> along the line between them: k pushes j with the force density s c (D - d)/delta V_k, c the bond
!> constant of the mean of both materials. What separates pushes less if there is a restitution e,
!> by e^2; or a dashpot acts along the line. Friction acts across it.
!>
!> With smoothed normals the overlap is that along the normal of both surfaces, shared among all
!> that are beside each other (`pd_force_normals`).
!>
!> Pairs are searched in cells whose reach is D and a skin; the pairs are kept until some point has
!> moved by half the skin, so that none is missed: two points that were farther apart than D and the
!> skin are then still farther apart than D. What a point sums up is in the order of the others'
!> numbers, and pairs farther apart than D add nothing: so the bits do not depend on when the search
!> was, nor on the number of threads.
module pd_force_contact
  use pd_base_archive, only: archive_type
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i4, i8
  use pd_body_body, only: body_type
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_base_order, only: place_in
  use pd_force_movement, only: is_noted, moved, movement_type, new_movement, note_instant, &
    & remember_places
  use pd_force_normals, only: meet, normal_of_pair, patch_radius, patch_type, surface_normals
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
    logical :: smoothed = .false.          !! they push along normals of their surfaces
  end type contact_rule_type

  !> Contact as a term.
  type, extends(force_term_type) :: contact_type
    integer :: part = of_normal_force
    type(contact_rule_type) :: rule
    integer(i4), allocatable :: slots(:)     !! points that may touch, in order
    integer, allocatable :: side(:)          !! of each of these
    real(wp), allocatable :: reach(:)        !! half of D of each, and its half of the skin [m]
    real(wp), allocatable :: begun(:, :)     !! (n_slots, dim) where points were at the start [m]
    real(wp), allocatable :: normals(:, :)   !! (dim, n_slots) normals of their surfaces then, if
                                             !! the rule is smoothed
    real(wp) :: skin = 0.0_wp                !! [m]
    real(wp) :: delta = 1.0_wp               !! horizon, the largest one of all points [m]
    real(wp) :: ratio = 0.0_wp               !! horizon over spacing of each point; 0: one horizon
    logical :: follows = .false.             !! it stands behind the term of the normal force of
                                             !! the same rule, and takes what that has found
    type(movement_type) :: movement          !! since the last search
    type(pairs_type) :: pairs                !! then
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
    ! without losses no account of work is needed, which would look at all points in every step
    ! normals turn without work: the account tells what that comes to
    contact%conservative = part == of_normal_force .and. rule%returned >= 1.0_wp .and. &
      & rule%damping <= 0.0_wp .and. .not. rule%smoothed
    contact%tangent = no_tangent
    contact%part = part
    contact%rule = rule
    contact%delta = delta
    contact%ratio = ratio
    contact%acts_on_few = .true.
    contact%slots = pack(body%slot, rule%side(body%body(body%slot)) > 0)
    contact%side = rule%side(body%body(contact%slots))
    least = minval(body%spacing(contact%slots))
    contact%skin = merge(skin_within, skin_between, rule%pieces)*least
    contact%reach = [((usual_distance*body%spacing(contact%slots(i)) + contact%skin)/2, i=1, &
      & size(contact%slots))]
    if (rule%distance > 0.0_wp) contact%reach = (rule%distance + contact%skin)/2
    if (rule%smoothed) contact%reach = sqrt(max((contact%reach - contact%skin/2)**2, &
      & patch_radius(body%spacing(contact%slots))**2/4) + patch_radius(body%spacing( &
      & contact%slots))**2/4) + contact%skin/2
    call new_movement(body, contact%slots, contact%movement)
  end subroutine new_contact

  !> Where points are at the start: pairs that are nearer then push from that distance on.
  subroutine begin(self, view)
    class(contact_type), intent(inout) :: self  !! the contact
    type(term_view_type), intent(in) :: view    !! the start

    real(wp), allocatable :: normals(:, :)

    self%begun = view%body%x + view%u
    if (.not. self%rule%smoothed) return
    call surface_normals(view, self%slots, normals)
    if (allocated(self%normals)) deallocate (self%normals)
    allocate (self%normals(size(view%u, 2), size(view%u, 1)), source=0.0_wp)
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
          self%movement%searches = before%movement%searches
        end if
      class default
        call internal_fault('friction follows no contact')
      end select
    else if (.not. still_holds(self, view)) then
      call find_pairs(self, view, self%pairs)
      call remember_places(self%movement, view%u)
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

  !> The pairs that are near.
  subroutine find_pairs(self, view, pairs)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    type(pairs_type), intent(out) :: pairs

    if (.not. allocated(self%begun)) call internal_fault('contact has not begun')
    call search_pairs(view, self%slots, self%side, self%reach, self%rule%pieces, pairs)
  end subroutine find_pairs

  !> Points that are near others.
  subroutine acting(self, view, slots)
    class(contact_type), intent(in) :: self     !! the contact
    type(term_view_type), intent(in) :: view    !! the instant
    integer(i4), allocatable, intent(out) :: slots(:)
    type(pairs_type) :: anew

    if (is_noted(self%movement, view)) then
      slots = self%pairs%slots
    else
      call find_pairs(self, view, anew)
      call move_alloc(anew%slots, slots)
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
    type(pairs_type) :: anew

    if (self%rule%smoothed) then
      if (is_noted(self%movement, view)) then
        call sum_smoothed(self, self%pairs, view, force, energy)
      else
        call find_pairs(self, view, anew)
        call sum_smoothed(self, anew, view, force, energy)
      end if
    else if (is_noted(self%movement, view)) then
      call sum_pairs(self, self%pairs, view, force, energy)
    else
      call find_pairs(self, view, anew)
      call sum_pairs(self, anew, view, force, energy)
    end if
  end subroutine pass

  !> Sum up near pairs, point by point.
  subroutine sum_pairs(self, pairs, view, force, energy)
    class(contact_type), intent(in) :: self
    type(pairs_type), intent(in) :: pairs
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: force(:, :)
    real(wp), intent(inout), contiguous :: energy(:)
    type(bonds_type) :: bonds
    real(wp), dimension(size(view%u, 2)) :: r, r0, n, v, total
    real(wp) :: distance, begins, stiffness, stored, push, critical, speed
    integer :: i, e, k, j
    logical :: ready, listed

    !$omp parallel if (size(pairs%slots) >= worth_threads) default(none) &
    !$omp shared(self, pairs, view, force, energy) &
    !$omp private(bonds, r, r0, n, v, total, distance, begins, stiffness, stored, push, critical, &
    !$omp speed, i, e, k, j, ready, listed)
    ready = .false.
    !$omp do schedule(dynamic, at_once)
    do i = 1, size(pairs%slots)
      k = pairs%slots(i)
      listed = .false.
      total = 0.0_wp
      stored = 0.0_wp
      do e = pairs%start(i), pairs%start(i + 1) - 1
        j = pairs%other(e)
        r = (view%body%x(j, :) - view%body%x(k, :)) + (view%u(j, :) - view%u(k, :))
        distance = norm2(r)
        ! the layer of a boundary is moved as one
        if (view%body%layer(k) > 0 .and. view%body%layer(k) == view%body%layer(j)) cycle
        begins = reach_of(self, k, j, view%body)
        if (distance >= begins) cycle
        r0 = self%begun(j, :) - self%begun(k, :)
        begins = min(begins, norm2(r0))
        if (distance >= begins) cycle
        if (self%rule%pieces) then
          if (.not. ready) call allocate_bonds(view%family, bonds)
          ready = .true.
          if (.not. listed) call view%family%bonds_of(k, bonds)
          listed = .true.
          if (any(bonds%j(:bonds%n) == j .and. bonds%intact(:bonds%n))) cycle
        end if
        ! points at one place push along the line that they began with
        n = r0
        if (distance > 0.0_wp) n = r
        n = n/norm2(n)
        v = view%v(j, :) - view%v(k, :)
        speed = dot_product(v, n)
        stiffness = stiffness_of(self, view, k, j)
        critical = 0.0_wp
        if (self%rule%damping > 0.0_wp .or. self%part == of_friction) &
          & critical = critical_damping(view, k, j, stiffness)
        push = normal_force(self%rule, stiffness, begins - distance, speed, critical)
        if (self%part == of_normal_force) then
          total = total - push*n
          stored = stored + stiffness*(begins - distance)**2/4
        else
          v = v - speed*n
          speed = norm2(v)
          if (speed > 0.0_wp) total = total &
            & + min(self%rule%friction*push, slope*critical*speed)*(v/speed)
        end if
      end do
      if (size(force) > 0) force(k, :) = force(k, :) + total
      if (size(energy) > 0) energy(k) = energy(k) + stored
    end do
    !$omp end parallel
  end subroutine sum_pairs

  !> Sum up near pairs of surfaces, point by point. Along normals that stay the force is the
  !> gradient of the energy K w (b - g)^2/2, with the overlap b - g along the normal and the weight
  !> w across it, whose gradient is the part across.
  subroutine sum_smoothed(self, pairs, view, force, energy)
    class(contact_type), intent(in) :: self
    type(pairs_type), intent(in) :: pairs
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: force(:, :)
    real(wp), intent(inout), contiguous :: energy(:)
    type(patch_type) :: patch
    integer(i8), allocatable :: points(:)
    real(wp), allocatable :: normals(:, :)
    real(wp), dimension(size(view%u, 2)) :: r, n, v, total
    real(wp) :: begins, stiffness, stored, push, critical, speed, back
    integer :: i, e, k, j

    if (.not. allocated(self%normals)) call internal_fault('contact has not begun')
    call surface_normals(view, pairs%slots, normals)
    points = int(view%body%point(pairs%slots), i8)
    !$omp parallel do if (size(pairs%slots) >= worth_threads) default(none) &
    !$omp schedule(dynamic, at_once) shared(self, pairs, view, force, energy, normals, points) &
    !$omp private(patch, r, n, v, total, begins, stiffness, stored, push, critical, speed, back, &
    !$omp i, e, k, j)
    do i = 1, size(pairs%slots)
      k = pairs%slots(i)
      total = 0.0_wp
      stored = 0.0_wp
      do e = pairs%start(i), pairs%start(i + 1) - 1
        j = pairs%other(e)
        if (view%body%layer(k) > 0 .and. view%body%layer(k) == view%body%layer(j)) cycle
        r = (view%body%x(j, :) - view%body%x(k, :)) + (view%u(j, :) - view%u(k, :))
        n = normal_of_pair(normals(:, i), normals(:, place_in(points, int(view%body%point(j), i8))))
        call meet_pair(self, view, k, j, r, n, begins, patch)
        if (.not. patch%touches) cycle
        v = view%v(j, :) - view%v(k, :)
        speed = dot_product(v, n)
        stiffness = stiffness_of(self, view, k, j)
        critical = 0.0_wp
        if (self%rule%damping > 0.0_wp .or. self%part == of_friction) &
          & critical = critical_damping(view, k, j, stiffness*patch%weight)
        push = normal_force(self%rule, stiffness*patch%weight, begins - patch%gap, speed, critical)
        if (self%part == of_normal_force) then
          back = 1.0_wp
          if (speed > 0.0_wp) back = self%rule%returned
          total = total - push*n + back*stiffness*(begins - patch%gap)**2/2*patch%slope &
            & *patch%across(:size(r))
          stored = stored + stiffness*patch%weight*(begins - patch%gap)**2/4
        else
          v = v - speed*n
          speed = norm2(v)
          if (speed > 0.0_wp) total = total &
            & + min(self%rule%friction*push, slope*critical*speed)*(v/speed)
        end if
      end do
      if (size(force) > 0) force(k, :) = force(k, :) + total
      if (size(energy) > 0) energy(k) = energy(k) + stored
    end do
    !$omp end parallel do
  end subroutine sum_smoothed

  !> How two points meet: along the normal of their surfaces, from the gap on that they had at the
  !> start if they were near then; along the line of centres, which `n` then becomes, without one.
  pure subroutine meet_pair(self, view, k, j, r, n, begins, patch)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: k, j              !! slots
    real(wp), intent(in) :: r(:)             !! from k to j [m]
    real(wp), intent(inout) :: n(:)          !! unit vector; 0: none of both
    real(wp), intent(out) :: begins          !! [m]
    type(patch_type), intent(out) :: patch
    real(wp) :: r0(size(r)), n0(size(r)), spacing

    r0 = self%begun(j, :) - self%begun(k, :)
    n0 = normal_of_pair(self%normals(:, k), self%normals(:, j))
    begins = reach_of(self, k, j, view%body)
    if (any(abs(n) > 0.0_wp) .and. any(abs(n0) > 0.0_wp)) then
      spacing = (view%body%spacing(k) + view%body%spacing(j))/2
      if (sum(r0**2) < begins**2 + patch_radius(spacing)**2) begins = min(begins, &
        & dot_product(r0, n0))
      call meet(r, n, spacing, begins, patch)
    else
      begins = min(begins, norm2(r0))
      patch%gap = norm2(r)
      patch%weight = 1.0_wp
      patch%touches = patch%gap < begins
      n = r0
      if (patch%gap > 0.0_wp) n = r
      n = n/norm2(n)
    end if
  end subroutine meet_pair

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
    if (self%rule%smoothed) call archive%keep(self%name//' normals began', self%normals)
  end subroutine keep

  !> The scene's own lines describe it.
  function describe(self) result(text)
    class(contact_type), intent(in) :: self  !! the contact
    character(:), allocatable :: text

    text = ''
    if (.not. allocated(self%slots)) text = 'contact nowhere'
  end function describe

end module pd_force_contact
