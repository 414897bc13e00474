!> Contact of points that share no intact bond (doc/theory.md, 17): a term of the force.
!>
!> Two points closer than a distance D, or than they were at the start if that was less, push apart
!> as their law says (`pd_force_contact_law`). Pairs are searched in cells whose reach is D and a
!> skin; the pairs are kept until some point has moved by half the skin, so that none is missed: two
!> points that were farther apart than D and the skin are then still farther apart than D. What a
!> point sums up is in the order of the others' numbers, and pairs farther apart than D add nothing:
!> so the bits do not depend on when the search was, nor on the number of threads.
!>
!> Of several ranks each sums what its own points get (`pd_force_vicinity`). All search together, as
!> soon as a point of any of them has moved by half the skin.
module pd_force_contact
  use pd_base_archive, only: archive_type, of_slots, same
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_reduce, only: count_of_ranks, largest_of_ranks
  use pd_body_body, only: body_type, share_halo
  use pd_force_contact_law, only: constant_of, contact_law_type, contact_rule_type, find_close, &
    & loses, of_friction, of_normal_force, reach_of_patch, slope, sum_pairs, usual_distance
  use pd_force_movement, only: is_noted, moved, movement_type, new_movement, note_instant, &
    & remember_places
  use pd_force_normals, only: add_couples, find_normals, find_rates, frame_type, renew_intact, &
    & surface_normals, surface_type, take_surface, turn_couples
  use pd_force_pairs, only: pairs_type, search_pairs
  use pd_force_term, only: density_of, force_term_type, no_tangent, term_view_type
  use pd_force_vicinity, only: owners_type, find_vicinity, find_owners, points_of_vicinity, &
    & renew_vicinity, sum_vicinity, vicinity_type
  implicit none (type, external)
  private
  public :: contact_type, new_contact, skin_between

  real(wp), parameter :: skin_between = 0.5_wp   !! of the smaller spacing, of bodies apart
  real(wp), parameter :: skin_within = 0.09_wp   !! where bonded neighbours would be candidates
  !> Contacts that a point may have at once, by dimension, for the bound of the stiffness.
  integer, parameter :: most_contacts(3) = [2, 4, 8]
  !> Half of the skin may be used up but for rounding.
  real(wp), parameter :: but_rounding = 1 - 1.0e-6_wp

  !> Contact as a term.
  type, extends(force_term_type) :: contact_type
    integer :: part = of_normal_force
    type(contact_law_type) :: law
    integer(i4), allocatable :: slots(:)     !! owned points that may touch, in order
    integer(i8) :: points = 0_i8             !! that may touch, of all ranks
    real(wp) :: least = 0.0_wp               !! the smallest spacing of these [m]
    integer, allocatable :: side(:)          !! of each of these
    real(wp), allocatable :: reach(:)        !! up to which each meets points of other bodies, its
                                             !! half of the distance and of the skin [m]
    real(wp), allocatable :: within(:)       !! and of its own body [m]
    real(wp) :: skin = 0.0_wp                !! [m]
    logical :: follows = .false.             !! it stands behind the term of the normal force of
                                             !! the same rule, and takes what that has found
    type(movement_type) :: movement          !! since the last search
    type(pairs_type) :: pairs                !! then
    type(surface_type) :: surface            !! of these points, if it is smoothed
    type(frame_type) :: frame                !! its normals at the noted instant
    type(owners_type) :: owners            !! the ranks
    type(vicinity_type) :: vicinity          !! of several ranks in place of pairs and surface
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

  !> Contact by a rule: of the bodies' points in their slots. All ranks call it together.
  subroutine new_contact(body, delta, ratio, rule, part, contact)
    type(body_type), intent(in) :: body             !! arranged in slots
    real(wp), intent(in) :: delta                   !! horizon, the largest one of all points [m]
    real(wp), intent(in) :: ratio
      !! horizon over spacing, if points have their own, else 0 [-]
    type(contact_rule_type), intent(in) :: rule     !! who meets whom, and how
    integer, intent(in) :: part                     !! `of_normal_force` or `of_friction`
    type(contact_type), intent(out) :: contact      !! ready to begin
    integer :: i

    contact%name = 'contact'
    if (part == of_friction) contact%name = 'friction'
    associate (owned => body%slot(:body%order%n_owned))
      contact%slots = pack(owned, rule%side(body%body(owned)) > 0)
    end associate
    contact%points = count_of_ranks(body%order, size(contact%slots, kind=i8))
    contact%side = rule%side(body%body(contact%slots))
    contact%law%smoothed = rule%smoothed .and. body%dim > 1 .and. count(rule%side > 0) > 1
    ! without losses no account of work is needed
    contact%conservative = part == of_normal_force .and. rule%returned >= 1.0_wp .and. &
      & rule%damping <= 0.0_wp
    contact%tangent = no_tangent
    contact%part = part
    contact%law%rule = rule
    contact%law%delta = delta
    contact%law%ratio = ratio
    contact%acts_on_few = .true.
    contact%least = -largest_of_ranks(body%order, -minval(body%spacing(contact%slots)))
    contact%skin = merge(skin_within, skin_between, rule%pieces)*contact%least
    allocate (contact%within(size(contact%slots)), contact%reach(size(contact%slots)))
    do i = 1, size(contact%slots)
      associate (spacing => body%spacing(contact%slots(i)))
        contact%within(i) = usual_distance*spacing/2
        if (rule%distance > 0.0_wp) contact%within(i) = rule%distance/2
        contact%reach(i) = contact%within(i)
        if (contact%law%smoothed) contact%reach(i) = reach_of_patch(contact%within(i), spacing/2)
      end associate
    end do
    contact%within = contact%within + contact%skin/2
    contact%reach = contact%reach + contact%skin/2
    call new_movement(body, contact%slots, contact%movement)
  end subroutine new_contact

  !> Where points are at the start: pairs that are nearer then push from that distance on.
  subroutine begin(self, view)
    class(contact_type), intent(inout) :: self  !! the contact
    type(term_view_type), intent(in) :: view    !! the start

    real(wp), allocatable :: normals(:, :)

    call find_owners(view%body, self%owners)
    ! families reach to copies of other ranks' points
    call share_halo(view%body, view%u)
    self%law%begun = view%body%x + view%u
    if (.not. self%law%smoothed) return
    call surface_normals(view, self%slots, normals)
    if (allocated(self%law%normals)) deallocate (self%law%normals)
    allocate (self%law%normals(3, size(view%u, 1)), source=0.0_wp)
    self%law%normals(:, self%slots) = normals
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
          self%vicinity = before%vicinity
          self%movement%searches = before%movement%searches
        end if
        if (self%owners%ranks > 0) then
          call follow(before%vicinity, self%vicinity)
          call note_instant(self%movement, view)
          return
        end if
        if (self%law%smoothed) then
          call renew_intact(self%surface, view)
          self%frame = before%frame
        end if
      class default
        call internal_fault('friction follows no contact')
      end select
    else if (.not. still_holds(self, view)) then
      if (self%owners%ranks > 0) then
        call search_vicinity(self, view, self%vicinity)
      else
        call find_pairs(self, view, self%pairs, self%surface)
      end if
      call remember_places(self%movement, view%u)
    end if
    if (self%owners%ranks > 0) then
      call renew_vicinity(view, self%vicinity)
    else if (self%law%smoothed .and. .not. self%follows) then
      call renew_intact(self%surface, view)
      call find_frame(self, self%pairs, self%surface, view, self%frame)
    end if
    call note_instant(self%movement, view)
  end subroutine search

  !> Take what another term has found out of an instant since the last search.
  subroutine follow(before, vicinity)
    type(vicinity_type), intent(in) :: before
    type(vicinity_type), intent(inout) :: vicinity  !! of the same search

    vicinity%u = before%u
    vicinity%v = before%v
    if (.not. vicinity%law%smoothed) return
    vicinity%surface%intact = before%surface%intact
    vicinity%surface%broken = before%surface%broken
    vicinity%frame = before%frame
    vicinity%rates = before%rates
  end subroutine follow

  !> Whether no pair is near that the last search has not found, on any rank.
  logical function still_holds(self, view) result(holds)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view

    holds = .false.
    if (allocated(self%movement%u)) &
      & holds = largest_of_ranks(view%body%order, moved(self%movement, view%u)) &
      & < but_rounding*self%skin/2
  end function still_holds

  !> The pairs that are near, and the surfaces of those that had one at the start.
  subroutine find_pairs(self, view, pairs, surface)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    type(pairs_type), intent(out) :: pairs
    type(surface_type), intent(out) :: surface
    integer :: i

    if (.not. allocated(self%law%begun)) call internal_fault('contact has not begun')
    call search_pairs(view, self%slots, self%side, self%reach, self%within, &
      & self%law%rule%pieces, pairs)
    if (self%law%smoothed) call take_surface(view, pairs%slots, &
      & [(norm2(self%law%normals(:, pairs%slots(i))), i=1, size(pairs%slots))], surface)
  end subroutine find_pairs

  !> The same of several ranks.
  subroutine search_vicinity(self, view, vicinity)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    type(vicinity_type), intent(out) :: vicinity

    if (.not. allocated(self%law%begun)) call internal_fault('contact has not begun')
    call find_vicinity(self%owners, self%law, view, self%slots, self%side, self%reach, &
      & self%within, vicinity)
  end subroutine search_vicinity

  !> Points that are near others, and with smoothed normals their families.
  subroutine acting(self, view, slots)
    class(contact_type), intent(in) :: self     !! the contact
    type(term_view_type), intent(in) :: view    !! the instant
    integer(i4), allocatable, intent(out) :: slots(:)
    type(pairs_type) :: pairs
    type(surface_type) :: surface
    type(vicinity_type) :: vicinity

    if (self%owners%ranks > 0) then
      if (is_noted(self%movement, view)) then
        call points_of_vicinity(self%vicinity, slots)
      else
        call search_vicinity(self, view, vicinity)
        call points_of_vicinity(vicinity, slots)
      end if
    else if (is_noted(self%movement, view)) then
      slots = self%pairs%slots
      if (self%law%smoothed) slots = self%surface%around
    else
      call find_pairs(self, view, pairs, surface)
      slots = pairs%slots
      if (self%law%smoothed) slots = surface%around
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
    type(vicinity_type) :: vicinity

    if (self%owners%ranks > 0) then
      if (is_noted(self%movement, view) .and. (.not. self%law%smoothed &
        & .or. self%vicinity%surface%broken == view%broken)) then
        call sum_vicinity(self%vicinity, self%part, view, force, energy)
      else
        call search_vicinity(self, view, vicinity)
        call renew_vicinity(view, vicinity)
        call sum_vicinity(vicinity, self%part, view, force, energy)
      end if
    else if (is_noted(self%movement, view) .and. (.not. self%law%smoothed &
      & .or. self%surface%broken == view%broken)) then
      call sum_up(self, self%pairs, self%surface, self%frame, view, force, energy)
    else
      call find_pairs(self, view, pairs, surface)
      if (self%law%smoothed) call find_frame(self, pairs, surface, view, frame)
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

    if (.not. allocated(self%law%normals)) call internal_fault('contact has not begun')
    call find_close(self%law, pairs, view, may_touch)
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

    if (self%law%smoothed) then
      if (size(force) > 0 .and. (self%part == of_friction .or. loses(self%law%rule))) &
        & call find_rates(surface, frame, view, rates)
      allocate (couples(3, size(pairs%slots)))
    end if
    call sum_pairs(self%law, self%part, pairs, frame, rates, view, force, energy, couples)
    if (.not. self%law%smoothed .or. size(force) == 0) return
    call turn_couples(surface, frame, couples)
    call add_couples(surface, frame, couples, force)
  end subroutine sum_up

  !> A point may touch a few others at once, with the stiffness of the largest of them; their
  !> displacements move it as its own does. All ranks call it together.
  subroutine add_stiffness_bound(self, view, bound)
    class(contact_type), intent(in) :: self     !! the contact
    type(term_view_type), intent(in) :: view    !! of the body
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the stiffness, added to [N/m4]
    real(wp) :: largest
    integer :: i, k

    if (self%part == of_friction .or. self%points == 0_i8) return
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
    if (self%law%ratio > 0.0_wp) part = (self%least/view%body%spacing(k))**2
  end function part_of_largest

  !> The stiffness of a pair of the stiffest material and the largest volume, per volume [N/m4];
  !> where points have their own horizons, of two points of the least spacing. All ranks call it
  !> together.
  real(wp) function largest_stiffness(self, view) result(stiffness)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp) :: constant, volume
    integer :: i

    constant = maxval([(constant_of(view, int(self%slots(i))), i=1, size(self%slots))])
    stiffness = self%law%rule%stiffness*largest_of_ranks(view%body%order, constant)/self%law%delta
    associate (dim => view%body%dim)
      if (self%law%ratio > 0.0_wp) then
        volume = maxval(view%body%volume(self%slots)/view%body%spacing(self%slots)**dim)
        stiffness = stiffness*largest_of_ranks(view%body%order, volume)*self%least**dim &
          & *(self%law%delta/(self%law%ratio*self%least))**(dim + 2)
      else
        volume = maxval(view%body%volume(self%slots))
        stiffness = stiffness*largest_of_ranks(view%body%order, volume)
      end if
    end associate
  end function largest_stiffness

  !> The dashpots of damping, or of friction. All ranks call it together.
  subroutine add_damping_bound(self, view, bound)
    class(contact_type), intent(in) :: self     !! the contact
    type(term_view_type), intent(in) :: view    !! of the body
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the damping, added to [N s/m4]
    real(wp) :: part, largest
    integer :: i, k

    part = self%law%rule%damping
    if (self%part == of_friction) part = slope
    if (.not. part > 0.0_wp .or. self%points == 0_i8) return
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

    real(wp), allocatable :: normals(:, :)

    call archive%over(of_slots)
    call archive%keep(self%name//' began', self%law%begun)
    if (self%law%smoothed) then
      normals = transpose(self%law%normals)
      call archive%keep(self%name//' normals began', normals)
      self%law%normals = transpose(normals)
    end if
    call archive%over(same)
  end subroutine keep

  !> The scene's own lines describe it.
  function describe(self) result(text)
    class(contact_type), intent(in) :: self  !! the contact
    character(:), allocatable :: text

    text = ''
    if (.not. allocated(self%slots)) text = 'contact nowhere'
  end function describe

end module pd_force_contact
