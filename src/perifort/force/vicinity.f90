!> Contact of points of several ranks (doc/architecture.md, Ranks): the points of this rank
!> that are near others, those others, whatever rank owns them, and the families of all that have
!> normals.
!>
!> A search begins with boxes: every rank tells where its points are, and sends those that lie in
!> the box of another rank, widened by the longest distance of a pair. Each rank then has all points
!> that its own can meet, and finds the pairs of these. What it needs of other ranks' points from
!> then on it asks their owners for. Those send displacements and velocities at every instant, then
!> normals and their rates, and, when the pairs are summed, what acts on normals. So every force is
!> computed once, by the owner of its point, from the same numbers in the same order as on one rank:
!> that of the points' numbers.
!>
!> All is in *places*: first the points that are near others, in the order of their numbers, then
!> the other members of families. Every rank makes the same calls in the same order.
module pd_force_vicinity
  use pd_base_archive, only: archive_type
  use pd_base_clock, only: wall_time
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i2, i4, i8
  use pd_base_order, only: ascending_order, owned_point, place_in
  use pd_base_reduce, only: largest_of_ranks, sum_of_ranks
  use pd_body_body, only: allocate_points, body_type, number_at, share_halo
  use pd_family_family, only: bonds_type, family_type
  use pd_force_contact_law, only: contact_law_type, find_close, sum_pairs
  use pd_force_normals, only: add_couples, find_normals, find_rates, frame_type, renew_intact, &
    & surface_type, take_surface, turn_couples
  use pd_force_pairs, only: pairs_type, search_pairs
  use pd_force_term, only: term_view_type
  implicit none (type, external)
  private
  public :: owners_type, vicinity_type, find_owners, find_vicinity, renew_vicinity, sum_vicinity, &
    & points_of_vicinity

  integer, parameter :: of_received = 5   !! numbers that are sent of a point beside its position

  !> The ranks, and who owns the copies that this one has.
  type :: owners_type
    integer :: rank = 0                      !! of this process, from 0
    integer :: ranks = 0                     !! how many there are; 0: this process has all points
    integer, allocatable :: owner(:)         !! (n_slots) rank that owns the point, from 0
    integer(i8), allocatable :: number(:)    !! of the copies' points, ascending
    integer(i4), allocatable :: slot(:)      !! of each of these
  end type owners_type

  !> The family of the body, by places.
  type, extends(family_type) :: family_of_places_type
    class(family_type), pointer :: of_slots => null()
    integer(i4), pointer :: slot(:) => null()    !! (places) 0: none
    integer(i4), pointer :: place(:) => null()   !! (n_slots) 0: none
  contains
    procedure :: bonds_of
    procedure :: break_bond
    procedure :: keep_bonds
    procedure :: bytes
    procedure :: describe
  end type family_of_places_type

  !> What is near, and how it is now.
  type :: vicinity_type
    integer :: near = 0                      !! the first places: points that are near others
    integer(i4), allocatable :: slot(:)      !! (places) here; 0: there is none
    integer(i4), allocatable :: place(:)     !! (n_slots) of each slot, 0: none
    logical, allocatable :: own(:)           !! (places) whether the point is this rank's
    integer, allocatable :: given(:)         !! (ranks) how many points each gets from this one
    integer(i4), allocatable :: sent(:)      !! their places, rank by rank
    integer(i4), allocatable :: taken(:)     !! places that this one gets, rank by rank
    integer, allocatable :: taken_from(:)    !! (ranks) how many of them from each
    type(body_type) :: body                  !! the points of the places
    real(wp), allocatable :: u(:, :)         !! (places, dim) displacements [m]
    real(wp), allocatable :: v(:, :)         !! (places, dim) velocities [m/s]
    type(contact_law_type) :: law            !! with the start of the places
    type(pairs_type) :: pairs                !! of the near points; those of other ranks have none
    type(surface_type) :: surface            !! of the near points, if normals are smoothed
    type(frame_type) :: frame                !! their normals
    real(wp), allocatable :: rates(:, :)     !! (3, near) of the normals [1/s]
  end type vicinity_type

  !> Points that other ranks have sent.
  type :: received_type
    integer, allocatable :: from(:)          !! (points) rank that owns each
    integer(i8), allocatable :: number(:)    !! among the points of all ranks
    real(wp), allocatable :: y(:, :)         !! (points, dim) where they are [m]
    real(wp), allocatable :: reach(:), within(:)   !! [m]
    integer, allocatable :: side(:), body(:)
  end type received_type

contains

  !> Find out which ranks there are, and who owns the copies here.
  subroutine find_owners(body, owners)
    type(body_type), intent(in) :: body          !! arranged in slots, its ranks joined
    type(owners_type), intent(out) :: owners
    real(wp), allocatable :: rank(:)
    integer, allocatable :: order(:)

    if (.not. associated(body%order%ranks)) return
    owners%ranks = nint(sum_of_ranks(body%order, 1.0_wp))
    owners%rank = int(body%order%ranks%number_before(1_i8))
    allocate (rank(body%n_slots), source=real(owners%rank, wp))
    call share_halo(body, rank)
    owners%owner = nint(rank)
    associate (n => body%order%n_owned)
      owners%number = body%number(n + 1:)
      order = ascending_order(owners%number)
      owners%number = owners%number(order)
      owners%slot = body%slot(n + order)
    end associate
  end subroutine find_owners

  !> Search the pairs of points that are near each other, and ask for what is needed of other ranks'
  !> points.
  subroutine find_vicinity(owners, law, view, slots, side, reach, within, vicinity)
    type(owners_type), intent(in) :: owners    !! the ranks
    type(contact_law_type), intent(in) :: law    !! what pairs do; begun
    type(term_view_type), intent(in) :: view     !! the instant
    integer(i4), intent(in) :: slots(:)          !! of owned points that may touch, in their order
    integer, intent(in) :: side(:)               !! of each
    real(wp), intent(in) :: reach(:)             !! of each [m]
    real(wp), intent(in) :: within(:)            !! of each, for others of its body [m]
    type(vicinity_type), intent(out) :: vicinity !! to be renewed before it is summed
    type(received_type) :: received
    type(pairs_type) :: found
    integer, allocatable :: candidate(:), owner(:)
    integer(i8), allocatable :: number(:)

    call exchange_points(owners, law, view, slots, side, reach, within, received)
    call search_all(law, view, slots, side, reach, within, received, candidate, found)
    call take_near(owners, law, view, slots, received, candidate, found, owner, number, vicinity)
    call join(owners, view, owner, number, vicinity)
    call take_start(law, view, vicinity)
  end subroutine find_vicinity

  !> Send points to the ranks that have others where these may be near.
  subroutine exchange_points(owners, law, view, slots, side, reach, within, received)
    type(owners_type), intent(in) :: owners
    type(contact_law_type), intent(in) :: law
    type(term_view_type), intent(in) :: view
    integer(i4), intent(in) :: slots(:)
    integer, intent(in) :: side(:)
    real(wp), intent(in) :: reach(:), within(:)
    type(received_type), intent(out) :: received
    real(wp), allocatable :: y(:, :), box(:, :, :, :), message(:), got(:)
    integer, allocatable :: of_side(:), given(:), taken(:), going(:)
    real(wp) :: most
    integer :: dim, columns, sides, i, r, n, pass

    dim = size(view%u, 2)
    columns = dim + of_received
    y = view%body%x(slots, :) + view%u(slots, :)
    ! with points of one side that meet, there is one box
    sides = max(1, maxval(law%rule%side))
    of_side = side
    if (law%rule%pieces) then
      sides = 1
      of_side = 1
    end if
    call find_boxes(owners, view, y, of_side, sides, box)
    most = 2*largest_of_ranks(view%body%order, maxval(reach))
    allocate (given(0:owners%ranks - 1), source=0)
    do pass = 1, 2
      n = 0
      do r = 0, owners%ranks - 1
        if (r == owners%rank) cycle
        do i = 1, size(slots)
          if (.not. may_meet(i, r)) cycle
          n = n + 1
          if (pass == 1) given(r) = given(r) + 1
          if (pass == 2) going(n) = i
        end do
      end do
      if (pass == 1) allocate (going(n))
    end do
    allocate (message(columns*n))
    do n = 1, size(going)
      i = going(n)
      message((n - 1)*columns + 1:n*columns) = [y(i, :), real(number_at(view%body, &
        & int(slots(i))), wp), reach(i), within(i), real(side(i), wp), &
        & real(view%body%body(slots(i)), wp)]
    end do
    call tell_numbers(view, given, taken)
    call view%body%order%ranks%deal(message, columns*given, got, columns*taken)
    n = sum(taken)
    received%from = [([(r, i=1, taken(r + 1))], r=0, owners%ranks - 1)]
    allocate (received%y(n, dim), received%number(n), received%reach(n), received%within(n), &
      & received%side(n), received%body(n))
    do i = 1, n
      associate (row => got((i - 1)*columns + 1:i*columns))
        received%y(i, :) = row(:dim)
        received%number(i) = nint(row(dim + 1), i8)
        received%reach(i) = row(dim + 2)
        received%within(i) = row(dim + 3)
        received%side(i) = nint(row(dim + 4))
        received%body(i) = nint(row(dim + 5))
      end associate
    end do

  contains

    !> Whether point `i` lies where rank `r` may have others near.
    pure logical function may_meet(i, r)
      integer, intent(in) :: i, r
      integer :: s

      may_meet = .false.
      do s = 1, sides
        if (.not. law%rule%pieces .and. s == of_side(i)) cycle
        may_meet = may_meet .or. (all(y(i, :) >= box(:, 1, s, r + 1) - most) &
          & .and. all(y(i, :) <= box(:, 2, s, r + 1) + most))
      end do
    end function may_meet
  end subroutine exchange_points

  !> The boxes around the points of each side of each rank; where it has none, they hold nothing.
  subroutine find_boxes(owners, view, y, side, sides, box)
    type(owners_type), intent(in) :: owners
    type(term_view_type), intent(in) :: view
    real(wp), intent(in) :: y(:, :)
    integer, intent(in) :: side(:), sides
    real(wp), allocatable, intent(out) :: box(:, :, :, :)   !! (dim, 2, sides, ranks) [m]
    real(wp), allocatable :: flat(:)
    real(wp) :: mine(size(y, 2), 2, sides)
    integer :: s, c, n

    do s = 1, sides
      do c = 1, size(y, 2)
        mine(c, 1, s) = minval(y(:, c), mask=side == s)
        mine(c, 2, s) = maxval(y(:, c), mask=side == s)
      end do
    end do
    n = size(mine)
    allocate (flat(n*owners%ranks), source=0.0_wp)
    flat(n*owners%rank + 1:n*(owners%rank + 1)) = reshape(mine, [n])
    call view%body%order%ranks%add_all(flat)
    box = reshape(flat, [size(y, 2), 2, sides, owners%ranks])
  end subroutine find_boxes

  !> Tell every rank how many points it gets.
  subroutine tell_numbers(view, given, taken)
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: given(:)                  !! (ranks)
    integer, allocatable, intent(out) :: taken(:)    !! (ranks) how many each gives to this one
    real(wp), allocatable :: got(:)
    integer :: r

    call view%body%order%ranks%deal(real(given, wp), [(1, r=1, size(given))], got)
    taken = nint(got)
  end subroutine tell_numbers

  !> Search the pairs of this rank's points and of those received; in them stand numbers of
  !> candidates.
  subroutine search_all(law, view, slots, side, reach, within, received, candidate, found)
    type(contact_law_type), intent(in) :: law
    type(term_view_type), intent(in) :: view
    integer(i4), intent(in) :: slots(:)
    integer, intent(in) :: side(:)
    real(wp), intent(in) :: reach(:), within(:)
    type(received_type), intent(in) :: received
    integer, allocatable, intent(out) :: candidate(:)
      !! by the numbers of points: which one of `slots`, or behind them of those received, each is
    type(pairs_type), intent(out) :: found
    type(body_type), target :: body
    real(wp), allocatable, target :: nothing(:, :)
    type(term_view_type) :: here
    integer(i8), allocatable :: number(:)
    integer, allocatable :: all_sides(:), all_bodies(:)
    real(wp), allocatable :: all_y(:, :), all_reach(:), all_within(:)
    integer :: c, n

    number = [number_at(view%body, int(slots)), received%number]
    candidate = ascending_order(number)
    n = size(candidate)
    call allocate_points(body, size(view%u, 2), n)
    allocate (all_y(n, body%dim), nothing(n, body%dim))
    nothing = 0.0_wp
    do c = 1, body%dim
      all_y(:size(slots), c) = view%body%x(slots, c) + view%u(slots, c)
      all_y(size(slots) + 1:, c) = received%y(:, c)
      body%x(:, c) = all_y(candidate, c)
    end do
    all_sides = [side, received%side]
    all_bodies = [int(view%body%body(slots)), received%body]
    all_reach = [reach, received%reach]
    all_within = [within, received%within]
    body%body = int(all_bodies(candidate), i2)
    here%body => body
    here%u => nothing
    call search_pairs(here, body%slot, all_sides(candidate), all_reach(candidate), &
      & all_within(candidate), law%rule%pieces, found)
  end subroutine search_all

  !> The places: points that are near one of this rank's, and points near whose families this rank
  !> has a part of, then the others of all families that make normals.
  subroutine take_near(owners, law, view, slots, received, candidate, found, owner, number, &
      & vicinity)
    type(owners_type), intent(in) :: owners
    type(contact_law_type), intent(in) :: law
    type(term_view_type), intent(in) :: view
    integer(i4), intent(in) :: slots(:)
    type(received_type), intent(in) :: received
    integer, intent(in) :: candidate(:)
    type(pairs_type), intent(in) :: found
    integer, allocatable, intent(out) :: owner(:)          !! (places) rank that owns each, from 0
    integer(i8), allocatable, intent(out) :: number(:)     !! (places) among all points
    type(vicinity_type), intent(inout) :: vicinity
    logical :: keep(size(candidate))
    integer, allocatable :: order(:), place_of(:)
    integer(i4), allocatable :: of_slot(:), others(:)
    real(wp), allocatable :: weight(:)
    integer :: i, c, n, k

    keep = .false.
    do i = 1, size(found%slots)
      if (candidate(found%slots(i)) > size(slots)) cycle
      keep(found%slots(i)) = .true.
      keep(found%other(found%start(i):found%start(i + 1) - 1)) = .true.
    end do
    ! their owners know which copies are near others, and the weights of their normals
    allocate (weight(view%body%n_slots), source=0.0_wp)
    if (law%smoothed) then
      do i = 1, size(found%slots)
        c = candidate(found%slots(i))
        if (c <= size(slots)) weight(slots(c)) = norm2(law%normals(:, slots(c)))
      end do
      call share_halo(view%body, weight)
    end if
    n = count(keep) + count(weight(owners%slot) > 0.0_wp)
    allocate (owner(n), number(n), vicinity%slot(n), place_of(n))
    allocate (of_slot(view%body%n_slots), source=0_i4)
    n = 0
    do c = 1, size(candidate)
      if (.not. keep(c)) cycle
      n = n + 1
      place_of(n) = c
      i = candidate(c)
      if (i <= size(slots)) then
        vicinity%slot(n) = slots(i)
        owner(n) = owners%rank
        number(n) = number_at(view%body, int(slots(i)))
      else
        owner(n) = received%from(i - size(slots))
        number(n) = received%number(i - size(slots))
        k = place_in(owners%number, number(n))
        vicinity%slot(n) = 0_i4
        if (k > 0) vicinity%slot(n) = owners%slot(k)
      end if
      if (vicinity%slot(n) > 0_i4) of_slot(vicinity%slot(n)) = 1_i4
    end do
    do i = 1, size(owners%slot)
      k = owners%slot(i)
      if (.not. weight(k) > 0.0_wp .or. of_slot(k) > 0_i4) cycle
      n = n + 1
      place_of(n) = 0
      vicinity%slot(n) = int(k, i4)
      owner(n) = owners%owner(k)
      number(n) = owners%number(i)
    end do
    order = ascending_order(number(:n))
    number = number(order)
    owner = owner(order)
    vicinity%slot = vicinity%slot(order)
    vicinity%near = n
    call take_pairs(candidate, size(slots), found, place_of(order), vicinity)
    of_slot = 0_i4
    do i = 1, n
      if (vicinity%slot(i) > 0_i4) of_slot(vicinity%slot(i)) = int(i, i4)
    end do
    if (.not. law%smoothed) return
    allocate (others(0))
    call take_surface(view, vicinity%slot, [(weight_of(vicinity%slot(i)), i=1, n)], &
      & vicinity%surface)
    do i = 1, size(vicinity%surface%around)
      k = vicinity%surface%around(i)
      if (of_slot(k) == 0_i4) then
        n = n + 1
        of_slot(k) = int(n, i4)
        others = [others, int(k, i4)]
      end if
      vicinity%surface%around(i) = of_slot(k)
    end do
    vicinity%slot = [vicinity%slot, others]
    owner = [owner, owners%owner(others)]
    number = [number, number_at(view%body, int(others))]

  contains

    !> The weight of the normal of a slot.
    pure real(wp) function weight_of(slot)
      integer(i4), intent(in) :: slot   !! or 0: its family is not here

      weight_of = 0.0_wp
      if (slot > 0_i4) weight_of = weight(slot)
    end function weight_of
  end subroutine take_near

  !> Bring the pairs of this rank's points from candidates to places; other points get none.
  subroutine take_pairs(candidate, mine, found, of_place, vicinity)
    integer, intent(in) :: candidate(:)
    integer, intent(in) :: mine                !! candidates up to this one are this rank's
    type(pairs_type), intent(in) :: found
    integer, intent(in) :: of_place(:)         !! candidate of each place; 0: none
    type(vicinity_type), intent(inout) :: vicinity
    integer(i4), allocatable :: place(:)
    integer, allocatable :: row(:)
    integer :: i, n, first, last

    allocate (place(size(candidate)), source=0_i4)
    allocate (row(size(candidate)), source=0)
    do i = 1, size(of_place)
      if (of_place(i) > 0) place(of_place(i)) = int(i, i4)
    end do
    do i = 1, size(found%slots)
      if (candidate(found%slots(i)) <= mine) row(found%slots(i)) = i
    end do
    associate (pairs => vicinity%pairs)
      pairs%slots = [(int(i, i4), i=1, size(of_place))]
      allocate (pairs%start(size(of_place) + 1), pairs%other(size(found%other)))
      n = 1
      do i = 1, size(of_place)
        pairs%start(i) = n
        if (of_place(i) == 0) cycle
        if (row(of_place(i)) == 0) cycle
        first = found%start(row(of_place(i)))
        last = found%start(row(of_place(i)) + 1) - 1
        pairs%other(n:n + last - first) = place(found%other(first:last))
        n = n + last - first + 1
      end do
      pairs%start(size(of_place) + 1) = n
      pairs%other = pairs%other(:n - 1)
      pairs%place = pairs%other
    end associate
  end subroutine take_pairs

  !> Ask the owners of other ranks' points for their values, and find out which points others ask
  !> this rank for: those, too, get places.
  subroutine join(owners, view, owner, number, vicinity)
    type(owners_type), intent(in) :: owners
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: owner(:)          !! (places)
    integer(i8), intent(in) :: number(:)     !! (places)
    type(vicinity_type), intent(inout) :: vicinity
    integer :: wanted(0:owners%ranks - 1)
    integer(i4), allocatable :: of_slot(:), more(:)
    integer, allocatable :: others(:)
    real(wp), allocatable :: asked(:)
    integer :: i, n, k

    others = pack([(i, i=1, size(owner))], owner /= owners%rank)
    others = others(ascending_order(int(owner(others), i8)))
    vicinity%taken = int(others, i4)
    wanted = 0
    do i = 1, size(others)
      wanted(owner(others(i))) = wanted(owner(others(i))) + 1
    end do
    vicinity%taken_from = wanted
    call tell_numbers(view, wanted, vicinity%given)
    ! numbers of points are exact as reals
    call view%body%order%ranks%deal(real(number(others), wp), wanted, asked, vicinity%given)
    allocate (of_slot(view%body%n_slots), source=0_i4)
    do i = 1, size(owner)
      if (owner(i) == owners%rank) of_slot(vicinity%slot(i)) = int(i, i4)
    end do
    allocate (vicinity%sent(size(asked)), more(size(asked)))
    n = 0
    do i = 1, size(asked)
      k = owned_point(view%body%order, nint(asked(i), i8))
      if (k == 0) call internal_fault('a rank is asked for a point that it does not own')
      k = view%body%slot(k)
      if (of_slot(k) == 0_i4) then
        n = n + 1
        more(n) = int(k, i4)
        of_slot(k) = int(size(owner) + n, i4)
      end if
      vicinity%sent(i) = of_slot(k)
    end do
    vicinity%own = [owner == owners%rank, [(.true., i=1, n)]]
    vicinity%slot = [vicinity%slot, more(:n)]
    of_slot = 0_i4
    do i = 1, size(vicinity%slot)
      if (vicinity%slot(i) > 0_i4) of_slot(vicinity%slot(i)) = int(i, i4)
    end do
    call move_alloc(of_slot, vicinity%place)
  end subroutine join

  !> Get the values of other ranks' points from their owners.
  subroutine share_places(view, vicinity, values)
    type(term_view_type), intent(in) :: view
    type(vicinity_type), intent(in) :: vicinity
    real(wp), intent(inout) :: values(:, :)   !! (places, components)
    real(wp), allocatable :: message(:), got(:)
    real(wp) :: begin
    integer :: i, m

    begin = wall_time()
    m = size(values, 2)
    allocate (message(m*size(vicinity%sent)))
    do i = 1, size(vicinity%sent)
      message((i - 1)*m + 1:i*m) = values(vicinity%sent(i), :)
    end do
    call view%body%order%ranks%deal(message, m*vicinity%given, got, m*vicinity%taken_from)
    do i = 1, size(vicinity%taken)
      values(vicinity%taken(i), :) = got((i - 1)*m + 1:i*m)
    end do
    associate (ranks => view%body%order%ranks)
      ranks%bytes = ranks%bytes + 8_i8*size(message)
      ranks%messages = ranks%messages + count(vicinity%given > 0)
      ranks%sharing = ranks%sharing + wall_time() - begin
    end associate
  end subroutine share_places

  !> What does not change until the next search: points, and how they began.
  subroutine take_start(law, view, vicinity)
    type(contact_law_type), intent(in) :: law
    type(term_view_type), intent(in) :: view
    type(vicinity_type), intent(inout) :: vicinity
    real(wp), allocatable :: values(:, :)
    integer :: dim, n, i, k

    dim = view%body%dim
    n = size(vicinity%slot)
    allocate (values(n, 2*dim + 8), source=0.0_wp)
    do i = 1, n
      if (.not. vicinity%own(i)) cycle
      k = vicinity%slot(i)
      values(i, :dim) = view%body%x(k, :)
      values(i, dim + 1:2*dim) = law%begun(k, :)
      values(i, 2*dim + 1:2*dim + 5) = [view%body%volume(k), view%body%spacing(k), &
        & real(view%body%body(k), wp), real(view%body%material(k), wp), &
        & real(view%body%layer(k), wp)]
      if (law%smoothed) values(i, 2*dim + 6:) = law%normals(:, k)
    end do
    call share_places(view, vicinity, values)
    call allocate_points(vicinity%body, dim, n)
    associate (body => vicinity%body, here => vicinity%law)
      body%x = values(:, :dim)
      body%volume = values(:, 2*dim + 1)
      body%spacing = values(:, 2*dim + 2)
      body%body = int(nint(values(:, 2*dim + 3)), i2)
      body%material = int(nint(values(:, 2*dim + 4)), i2)
      body%layer = int(nint(values(:, 2*dim + 5)), i2)
      here%rule = law%rule
      here%delta = law%delta
      here%ratio = law%ratio
      here%smoothed = law%smoothed
      here%begun = values(:, dim + 1:2*dim)
      if (law%smoothed) here%normals = transpose(values(:, 2*dim + 6:))
    end associate
  end subroutine take_start

  !> What the vicinity has of an instant, as a term sees it.
  subroutine look_at(view, vicinity, family, here)
    type(term_view_type), intent(in) :: view
    type(vicinity_type), intent(in), target :: vicinity
    type(family_of_places_type), intent(out), target :: family
    type(term_view_type), intent(out) :: here
      !! valid as long as the vicinity and the family stay where they are

    family%dim = view%family%dim
    family%n_slots = size(vicinity%slot)
    family%most_bonds = view%family%most_bonds
    family%rule = view%family%rule
    family%of_slots => view%family
    family%slot => vicinity%slot
    family%place => vicinity%place
    here%body => vicinity%body
    here%family => family
    here%materials => view%materials
    here%u => vicinity%u
    here%v => vicinity%v
    here%time = view%time
    here%step = view%step
    here%broken = view%broken
  end subroutine look_at

  !> Bring the vicinity to an instant: displacements, velocities, normals and their rates.
  subroutine renew_vicinity(view, vicinity)
    type(term_view_type), intent(in) :: view       !! the instant
    type(vicinity_type), intent(inout), target :: vicinity
    type(family_of_places_type), target :: family
    type(term_view_type) :: here
    logical, allocatable :: wanted(:)
    real(wp), allocatable :: values(:, :)
    integer :: dim, i

    dim = view%body%dim
    allocate (values(size(vicinity%slot), 2*dim), source=0.0_wp)
    do i = 1, size(vicinity%slot)
      if (.not. vicinity%own(i)) cycle
      values(i, :dim) = view%u(vicinity%slot(i), :)
      values(i, dim + 1:) = view%v(vicinity%slot(i), :)
    end do
    call share_places(view, vicinity, values)
    vicinity%u = values(:, :dim)
    vicinity%v = values(:, dim + 1:)
    if (.not. vicinity%law%smoothed) return
    associate (n => vicinity%near, frame => vicinity%frame)
      call look_at(view, vicinity, family, here)
      call renew_intact(vicinity%surface, view)
      call find_close(vicinity%law, vicinity%pairs, here, wanted)
      ! of the families of copies this rank has a part: their bonds count, their normals do not
      wanted = wanted .or. .not. vicinity%own(:n)
      call find_normals(vicinity%surface, here, wanted, frame)
      where (.not. vicinity%own(:n)) frame%of_sum = 0.0_wp
      call find_rates(vicinity%surface, frame, here, vicinity%rates)
      deallocate (values)
      allocate (values(size(vicinity%slot), 6), source=0.0_wp)
      values(:n, :3) = transpose(frame%normals)
      values(:n, 4:) = transpose(vicinity%rates)
      call share_places(view, vicinity, values)
      frame%normals = transpose(values(:n, :3))
      vicinity%rates = transpose(values(:n, 4:))
    end associate
  end subroutine renew_vicinity

  !> Sum up the pairs of this rank's points, and what acts on the normals of their families. All
  !> ranks call it together, with the same part and the same kind of sums.
  subroutine sum_vicinity(vicinity, part, view, force, energy)
    type(vicinity_type), intent(in), target :: vicinity   !! renewed at the instant
    integer, intent(in) :: part                           !! `of_normal_force` or `of_friction`
    type(term_view_type), intent(in) :: view              !! the instant
    real(wp), intent(inout), contiguous :: force(:, :)
      !! (n_slots, dim) force density, added to; of size 0: not wanted [N/m3]
    real(wp), intent(inout), contiguous :: energy(:)
      !! (n_slots) energy density, added to; of size 0: not wanted [J/m3]
    type(family_of_places_type), target :: family
    type(term_view_type) :: here
    real(wp), allocatable :: forces(:, :), energies(:), couples(:, :), values(:, :)
    logical :: of_force
    integer :: i, n

    n = size(vicinity%slot)
    of_force = size(force, 1) > 0
    allocate (forces(merge(n, 0, of_force), view%body%dim), source=0.0_wp)
    allocate (energies(merge(n, 0, size(energy) > 0)), source=0.0_wp)
    if (vicinity%law%smoothed) allocate (couples(3, vicinity%near))
    ! sums go on from what is there, as they do on one rank
    do i = 1, n
      if (.not. vicinity%own(i)) cycle
      if (of_force) forces(i, :) = force(vicinity%slot(i), :)
      if (size(energy) > 0) energies(i) = energy(vicinity%slot(i))
    end do
    call look_at(view, vicinity, family, here)
    call sum_pairs(vicinity%law, part, vicinity%pairs, vicinity%frame, vicinity%rates, here, &
      & forces, energies, couples)
    if (vicinity%law%smoothed .and. of_force) then
      call turn_couples(vicinity%surface, vicinity%frame, couples)
      allocate (values(n, 3), source=0.0_wp)
      values(:vicinity%near, :) = transpose(couples)
      call share_places(view, vicinity, values)
      call add_couples(vicinity%surface, vicinity%frame, &
        & transpose(values(:vicinity%near, :)), forces)
    end if
    do i = 1, n
      if (.not. vicinity%own(i)) cycle
      if (of_force) force(vicinity%slot(i), :) = forces(i, :)
      if (size(energy) > 0) energy(vicinity%slot(i)) = energies(i)
    end do
  end subroutine sum_vicinity

  !> The slots of this rank's points on which contact may act, in the order of their points.
  subroutine points_of_vicinity(vicinity, slots)
    type(vicinity_type), intent(in) :: vicinity
    integer(i4), allocatable, intent(out) :: slots(:)
    integer(i4), allocatable :: places(:)

    places = vicinity%pairs%slots
    if (vicinity%law%smoothed) places = vicinity%surface%around
    places = pack(places, vicinity%own(places))
    slots = vicinity%slot(places)
  end subroutine points_of_vicinity

  ! ---------------------------------------------------------------- the family by places

  !> The bonds of a place; those to points that have no place lead to 0.
  pure subroutine bonds_of(family, k, bonds)
    class(family_of_places_type), intent(in) :: family   !! the family
    integer, intent(in) :: k                             !! place
    type(bonds_type), intent(inout) :: bonds             !! as of any family
    integer :: b

    bonds%n = 0
    if (family%slot(k) == 0_i4) return
    call family%of_slots%bonds_of(int(family%slot(k)), bonds)
    do b = 1, bonds%n
      bonds%j(b) = family%place(bonds%j(b))
    end do
  end subroutine bonds_of

  !> Break a bond of a place.
  pure subroutine break_bond(family, k, i)
    class(family_of_places_type), intent(inout) :: family   !! with this bond broken on return
    integer, intent(in) :: k                                !! place that has a slot
    integer, intent(in) :: i                                !! number of the bond, from 1

    call family%of_slots%break_bond(int(family%slot(k)), i)
  end subroutine break_bond

  !> The body's family keeps its bonds itself.
  subroutine keep_bonds(family, archive)
    class(family_of_places_type), intent(inout) :: family   !! stays as it is
    class(archive_type), intent(inout) :: archive           !! stays as it is

    if (associated(family%of_slots) .or. archive%reading) &
      & call internal_fault('the bonds of a vicinity are kept by its body')
  end subroutine keep_bonds

  !> It has no memory of its own.
  pure integer(i8) function bytes(family)
    class(family_of_places_type), intent(in) :: family   !! the family
    bytes = 0_i8*family%n_slots
  end function bytes

  !> What kind of family it is.
  function describe(family) result(text)
    class(family_of_places_type), intent(in) :: family   !! the family
    character(:), allocatable :: text
    text = family%of_slots%describe()
  end function describe

end module pd_force_vicinity
