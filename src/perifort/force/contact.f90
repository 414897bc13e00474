!> Contact of points that share no intact bond (doc/theory.md, 17): a term of the force.
!>
!> Two points closer than a distance D, or than they were at the start if that was less, push apart
!> along the line between them: k pushes j with the force density s c (D - d)/delta V_k, c the bond
!> constant of the mean of both materials. What separates pushes less if there is a restitution e,
!> by e^2; or a dashpot acts along the line. Friction acts across it.
!>
!> Pairs are searched in cells whose reach is D and a skin; the pairs are kept until some point has
!> moved by half the skin, so that none is missed. What a point sums up is in the order of the
!> others' numbers, and pairs farther apart than D add nothing: so the bits do not depend on when
!> the search was, nor on the number of threads.
module pd_force_contact
  use pd_base_archive, only: archive_type
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i4
  use pd_base_order, only: ascending_order
  use pd_body_body, only: body_type
  use pd_family_cells, only: cells_type, neighbours_of, sort_into_cells
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  use pd_force_term, only: density_of, force_term_type, no_tangent, term_view_type
  use pd_law_material, only: material_type
  implicit none (type, external)
  private
  public :: contact_type, contact_rule_type, new_contact, of_normal_force, of_friction
  public :: normal_force, slope

  !> What a term of contact is: pushing along the line between points, or friction across it.
  integer, parameter :: of_normal_force = 1, of_friction = 2

  real(wp), parameter :: skin_between = 0.3_wp   !! of the smaller spacing, of bodies apart
  real(wp), parameter :: skin_within = 0.09_wp   !! where bonded neighbours would be candidates
  real(wp), parameter :: usual_distance = 0.9_wp !! of the smaller spacing
  real(wp), parameter :: slope = 0.5_wp
    !! dashpot that regularises friction, over the critical one of a pair
  !> Contacts that a point may have at once, by dimension, for the bound of the stiffness.
  integer, parameter :: most_contacts(3) = [2, 4, 8]
  integer, parameter :: at_once = 128            !! points of a chunk of a thread

  !> What a `&contact` says.
  type :: contact_rule_type
    integer, allocatable :: side(:)        !! (bodies) that may meet those of other sides; 0: none
    logical :: pieces = .false.            !! points of one side meet, too, unless bonded
    real(wp) :: stiffness = 1.0_wp         !! s [-]
    real(wp) :: distance = 0.0_wp          !! D [m], 0 for the usual one
    real(wp) :: friction = 0.0_wp          !! [-]
    real(wp) :: returned = 1.0_wp          !! e^2, part of the energy that comes back [-]
    real(wp) :: damping = 0.0_wp           !! over the critical one [-]
  end type contact_rule_type

  !> Pairs that are near.
  type :: pairs_type
    integer, allocatable :: start(:)        !! (points + 1) first near one of each point
    integer(i4), allocatable :: other(:)    !! slots, in the order of points
    real(wp), allocatable :: u(:, :)        !! (point, dim) displacements at the search [m]
  end type pairs_type

  !> Contact as a term.
  type, extends(force_term_type) :: contact_type
    integer :: part = of_normal_force
    type(contact_rule_type) :: rule
    integer(i4), allocatable :: slots(:)     !! points that may touch, in order
    integer, allocatable :: side(:)          !! of each of these
    real(wp), allocatable :: reach(:)        !! half of D of each, and its half of the skin [m]
    real(wp), allocatable :: begun(:, :)     !! (n_slots, dim) where points were at the start [m]
    real(wp) :: skin = 0.0_wp                !! [m]
    real(wp) :: delta = 1.0_wp               !! horizon [m]
    type(pairs_type) :: pairs                !! as last searched
  contains
    procedure :: add_force
    procedure :: add_energy
    procedure :: add_stiffness_bound
    procedure :: add_damping_bound
    procedure :: begin
    procedure :: advance
    procedure :: keep
    procedure :: describe
  end type contact_type

contains

  !> Contact by a rule: of the bodies' points in their slots.
  subroutine new_contact(body, delta, rule, part, contact)
    type(body_type), intent(in) :: body             !! arranged in slots
    real(wp), intent(in) :: delta                   !! horizon [m]
    type(contact_rule_type), intent(in) :: rule     !! who meets whom, and how
    integer, intent(in) :: part                     !! `of_normal_force` or `of_friction`
    type(contact_type), intent(out) :: contact      !! ready to begin
    real(wp) :: least
    integer :: i

    contact%name = 'contact'
    if (part == of_friction) contact%name = 'friction'
    ! without losses no account of work is needed, which would look at all points in every step
    contact%conservative = part == of_normal_force .and. rule%returned >= 1.0_wp .and. &
      & rule%damping <= 0.0_wp
    contact%tangent = no_tangent
    contact%part = part
    contact%rule = rule
    contact%delta = delta
    contact%slots = pack(body%slot, rule%side(body%body(body%slot)) > 0)
    contact%side = rule%side(body%body(contact%slots))
    least = minval(body%spacing(contact%slots))
    contact%skin = merge(skin_within, skin_between, rule%pieces)*least
    contact%reach = [((usual_distance*body%spacing(contact%slots(i)) + contact%skin)/2, i=1, &
      & size(contact%slots))]
    if (rule%distance > 0.0_wp) contact%reach = (rule%distance + contact%skin)/2
  end subroutine new_contact

  !> Where points are at the start: pairs that are nearer then push from that distance on.
  subroutine begin(self, view)
    class(contact_type), intent(inout) :: self  !! the contact
    type(term_view_type), intent(in) :: view    !! the start

    self%begun = view%body%x + view%u
    call search(self, view, self%pairs)
  end subroutine begin

  !> Search anew in time.
  subroutine advance(self, view)
    class(contact_type), intent(inout) :: self  !! the contact
    type(term_view_type), intent(in) :: view    !! the instant

    if (moved(self, self%pairs, view) > self%skin/4) call search(self, view, self%pairs)
  end subroutine advance

  !> How far a point has moved since a search [m].
  real(wp) function moved(self, pairs, view) result(most)
    class(contact_type), intent(in) :: self
    type(pairs_type), intent(in) :: pairs
    type(term_view_type), intent(in) :: view
    real(wp) :: square
    integer :: i, c, k

    most = 0.0_wp
    if (.not. allocated(pairs%u)) call internal_fault('contact has not begun')
    !$omp parallel do schedule(static) default(none) shared(self, pairs, view) &
    !$omp private(i, c, k, square) reduction(max:most)
    do i = 1, size(self%slots)
      k = self%slots(i)
      square = 0.0_wp
      do c = 1, size(view%u, 2)
        square = square + (view%u(k, c) - pairs%u(i, c))**2
      end do
      most = max(most, square)
    end do
    most = sqrt(most)
  end function moved

  !> Find the pairs that are near: closer than both their reaches.
  subroutine search(self, view, pairs)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    type(pairs_type), intent(inout) :: pairs
    type(cells_type) :: cells
    real(wp), allocatable :: y(:, :), low(:), high(:)
    logical, allocatable :: here(:)
    integer, allocatable :: index_of(:)
    integer :: i, c, n, m, dim

    dim = size(view%u, 2)
    n = size(self%slots)
    allocate (y(n, dim))
    pairs%u = view%u(self%slots, :)
    do c = 1, dim
      y(:, c) = view%body%x(self%slots, c) + pairs%u(:, c)
    end do
    if (allocated(pairs%start)) deallocate (pairs%start, pairs%other)
    allocate (pairs%start(n + 1), source=1)
    allocate (pairs%other(0))
    if (n == 0) return
    ! of bodies apart, only those points that are near another's
    allocate (here(n), source=.true.)
    if (.not. self%rule%pieces) then
      allocate (low(dim), high(dim))
      do m = 1, maxval(self%side)
        if (count(self%side == m) == 0) cycle
        do c = 1, dim
          low(c) = minval(y(:, c), mask=self%side == m) - 2*maxval(self%reach)
          high(c) = maxval(y(:, c), mask=self%side == m) + 2*maxval(self%reach)
        end do
        ! with two sides a point must be in the box of the other
        if (maxval(self%side) > 2) exit
        do i = 1, n
          if (self%side(i) /= m) here(i) = all(y(i, :) >= low .and. y(i, :) <= high)
        end do
      end do
    end if
    index_of = pack([(i, i=1, n)], here)
    if (size(index_of) == 0) return
    call sort_into_cells(y(index_of, :), 2*maxval(self%reach), cells)
    call collect()

  contains

    !> All pairs, point by point; twice, first to count.
    subroutine collect()
      integer, allocatable :: counted(:)
      integer(i4), allocatable :: found(:), near(:)
      real(wp), allocatable :: place(:, :), reach(:)
      integer(i4) :: number
      integer :: pass, p, i, filled

      place = y(index_of, :)
      reach = self%reach(index_of)
      allocate (counted(n), source=0)
      do pass = 1, 2
        !$omp parallel default(none) shared(self, pairs, cells, place, reach, index_of, pass, &
        !$omp counted) private(found, number, p, i, near, filled)
        !$omp do schedule(dynamic, at_once)
        do p = 1, size(index_of)
          i = index_of(p)
          if (pass == 2 .and. counted(i) == 0) cycle
          call neighbours_of(place, reach, cells, p, number, found)
          near = index_of(found(:number))
          if (.not. self%rule%pieces) near = pack(near, self%side(near) /= self%side(i))
          filled = size(near)
          if (pass == 1) then
            counted(i) = filled
          else
            ! points stand in their order, so that their numbers ascend with their places here
            near = near(ascending_order(near))
            pairs%other(pairs%start(i):pairs%start(i) + filled - 1) = self%slots(near)
          end if
        end do
        !$omp end parallel
        if (pass == 2) exit
        do i = 1, n
          pairs%start(i + 1) = pairs%start(i) + counted(i)
        end do
        deallocate (pairs%other)
        allocate (pairs%other(pairs%start(n + 1) - 1))
      end do
    end subroutine collect
  end subroutine search

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

  !> Forces or energies of all points, whichever has a size. Where points have moved too far since
  !> the last search, as in a step that is only tried, it searches for itself.
  subroutine pass(self, view, force, energy)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(inout), contiguous :: force(:, :)
    real(wp), intent(inout), contiguous :: energy(:)
    type(pairs_type) :: anew

    if (moved(self, self%pairs, view) < self%skin/2) then
      call sum_pairs(self, self%pairs, view, force, energy)
    else
      call search(self, view, anew)
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
    logical :: ready

    !$omp parallel default(none) shared(self, pairs, view, force, energy) &
    !$omp private(bonds, r, r0, n, v, total, distance, begins, stiffness, stored, push, critical, &
    !$omp speed, i, e, k, j, ready)
    ready = .false.
    !$omp do schedule(dynamic, at_once)
    do i = 1, size(self%slots)
      if (pairs%start(i + 1) == pairs%start(i)) cycle
      k = self%slots(i)
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
          call view%family%bonds_of(k, bonds)
          if (any(bonds%j(:bonds%n) == j .and. bonds%intact(:bonds%n))) cycle
        end if
        ! points at one place push along the line that they began with
        n = r0
        if (distance > 0.0_wp) n = r
        n = n/norm2(n)
        v = view%v(j, :) - view%v(k, :)
        speed = dot_product(v, n)
        stiffness = self%rule%stiffness*(constant_of(view, k) + constant_of(view, j))/2/self%delta &
          & *view%body%volume(j)
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
      bound(k) = bound(k) + 2*most_contacts(view%body%dim)*largest
    end do
  end subroutine add_stiffness_bound

  !> The stiffness of a pair of the stiffest material and the largest volume, per volume [N/m4].
  pure real(wp) function largest_stiffness(self, view) result(stiffness)
    class(contact_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    integer :: i

    stiffness = self%rule%stiffness*maxval([(constant_of(view, int(self%slots(i))), i=1, &
      & size(self%slots))])/self%delta*maxval(view%body%volume(self%slots))
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
      bound(k) = bound(k) + 2*most_contacts(view%body%dim)*2*part*sqrt(largest*density_of(view, k))
    end do
  end subroutine add_damping_bound

  !> All follows from displacements; the pairs are searched anew, which changes no bit.
  subroutine keep(self, archive)
    class(contact_type), intent(inout) :: self     !! the contact
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read

    call archive%keep(self%name//' began', self%begun)
  end subroutine keep

  !> The scene's own lines describe it.
  function describe(self) result(text)
    class(contact_type), intent(in) :: self  !! the contact
    character(:), allocatable :: text

    text = ''
    if (.not. allocated(self%slots)) text = 'contact nowhere'
  end function describe

end module pd_force_contact
