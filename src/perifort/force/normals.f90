!> Smoothed normals of surface points (doc/theory.md, 17): against the side on which a point's
!> family is, as it lies now, so that they turn with the body.
!>
!> A normal depends on where the family is. What pushes along it therefore acts on the family as
!> well: the forces are the gradient of the energy of contact, couples included, so that energy,
!> momentum and angular momentum are conserved.
module pd_force_normals
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_order, only: ascending_order
  use pd_body_body, only: share_halo
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_force_term, only: term_view_type
  implicit none (type, external)
  private
  public :: surface_type, frame_type, patch_type
  public :: surface_normals, take_surface, renew_intact, find_normals, find_rates, turn_couples, &
    & add_couples
  public :: normal_of_pair, patch_radius, meet

  !> Sum of directions to the others, times their volumes and 1 - |xi|/delta, over the sum of these:
  !> below it a point has no surface. A half-space makes 1/2 in 3D and 2/pi in 2D for points at its
  !> surface.
  real(wp), parameter :: least = 0.1_wp
  real(wp), parameter :: most_cosine = 0.5_wp    !! most cosine of two normals that make one
  real(wp), parameter :: wide = 1.5_wp             !! radius of a patch over the mean spacing
  real(wp), parameter :: pi = acos(-1.0_wp)
  !> Mean of 1 - N_k.N_j on a face: beyond it a normal counts less in those of pairs.
  real(wp), parameter :: even = 2.0e-3_wp
  integer, parameter :: at_once = 32               !! points of a chunk of a thread
  integer, parameter :: worth_threads = 200        !! points
  integer, parameter :: at_a_time = 16384          !! points whose bonds are held at a time

  !> Some points with the bonds within their bodies, of which their normals are made.
  type :: surface_type
    integer(i4), allocatable :: slots(:)    !! of the points; 0: of another rank, without a copy
    real(wp), allocatable :: weight(:)      !! of their normals; 0: none [-]
    integer(i4), allocatable :: around(:)   !! slots of them and of the others of their bonds, in
                                            !! the order of points: the places of what follows
    real(wp), allocatable :: volume(:)      !! (places) [m3]
    integer(i4), allocatable :: place(:)    !! of each point
    integer(i4), allocatable :: own(:)      !! (places) which of the points each is; 0: none
    integer, allocatable :: start(:)        !! (points + 1) first bond of each
    integer(i4), allocatable :: member(:)   !! place of the other end of each bond
    integer(i4), allocatable :: owner(:)    !! which of the points has it
    real(wp), allocatable :: near(:)        !! 1 - |xi|/delta, with the horizon of the point [-]
    logical, allocatable :: intact(:)       !! whether it is
    integer(i8) :: broken = 0_i8            !! bonds of all bodies that were broken then
    integer, allocatable :: first(:)        !! (places + 1) first entry of each in `bond`
    integer, allocatable :: bond(:)         !! bonds at whose other end it is
  end type surface_type

  !> Normals of the points of a surface at an instant. All vectors have three components.
  type :: frame_type
    real(wp), allocatable :: normals(:, :)   !! (3, points) outward unit vectors times the weights
                                             !! of the points; 0: no surface
    real(wp), allocatable :: of_sum(:)       !! (points) their lengths over those of the sums that
                                             !! they are the directions of [1/m3]
    real(wp), allocatable :: unit(:, :)      !! (3, bonds) directions, set for points with normals
    real(wp), allocatable :: inverse(:)      !! (bonds) `near` over the distance, 0 for one that
                                             !! does not count [1/m]
  end type frame_type

  !> How two points meet along a given normal: the patch of one sees the other.
  type :: patch_type
    logical :: touches = .false.
    real(wp) :: gap = 0.0_wp        !! distance along the normal [m]
    real(wp) :: weight = 0.0_wp     !! part of the stiffness of the pair [-]
    real(wp) :: slope = 0.0_wp      !! its gradient over the vector across the normal [1/m2]
    real(wp) :: across(3) = 0.0_wp  !! that vector [m]
  end type patch_type

contains

  !> Outward normals of points, 0 where there is no surface: from intact bonds within a body. Their
  !> lengths, up to 1, are the weights that they have in normals of pairs: less at edges, where they
  !> are inclined to the faces, than on faces. All ranks call it together.
  subroutine surface_normals(view, slots, normals)
    type(term_view_type), intent(in) :: view
      !! the instant, with the displacements of copies of other ranks' points
    integer(i4), intent(in) :: slots(:)
      !! of the points, in their order; of several ranks those that this one owns
    real(wp), allocatable, intent(out) :: normals(:, :)      !! (3, points)
    real(wp), allocatable :: of_slot(:, :), by_slot(:, :)
    integer(i4), allocatable :: place(:)
    integer :: first, last, i

    allocate (normals(3, size(slots)), of_slot(3, view%body%n_slots), source=0.0_wp)
    allocate (place(view%body%n_slots), source=0_i4)
    do first = 1, size(slots), at_a_time
      last = min(first + at_a_time - 1, size(slots))
      some: block
        type(surface_type) :: surface
        type(frame_type) :: frame

        surface%slots = slots(first:last)
        surface%weight = [(1.0_wp, i=first, last)]
        call take_bonds(view, surface)
        call take_places(view, place, surface)
        call find_normals(surface, view, [(.true., i=first, last)], frame)
        of_slot(:, slots(first:last)) = frame%normals
      end block some
    end do
    do i = 1, size(slots)
      normals(:, i) = of_slot(:, slots(i))
    end do
    if (associated(view%body%order%ranks)) then
      by_slot = transpose(of_slot)
      call share_halo(view%body, by_slot)
      of_slot = transpose(by_slot)
    end if
    call weigh(view, slots, of_slot, normals)
  end subroutine surface_normals

  !> Weigh normals by how much those of near points differ from them: the mean of 1 - N_k.N_j, in
  !> which others count by the square of N_k.N_j, so that the opposite face of a thin body does not.
  subroutine weigh(view, slots, of_slot, normals)
    type(term_view_type), intent(in) :: view
    integer(i4), intent(in) :: slots(:)
    real(wp), intent(in) :: of_slot(:, :)          !! (3, n_slots) unit normals or 0
    real(wp), intent(inout) :: normals(:, :)       !! (3, points) times the weights on return
    type(bonds_type) :: bonds
    real(wp) :: differs, like, cosine
    integer :: i, b, k, j

    !$omp parallel if (size(slots) >= worth_threads) default(none) &
    !$omp shared(view, slots, of_slot, normals) private(bonds, differs, like, cosine, i, b, k, j)
    call allocate_bonds(view%family, bonds)
    !$omp do schedule(dynamic, at_once)
    do i = 1, size(slots)
      k = slots(i)
      if (.not. any(abs(of_slot(:, k)) > 0.0_wp)) cycle
      call view%family%bonds_of(k, bonds)
      differs = 0.0_wp
      like = 0.0_wp
      do b = 1, bonds%n
        j = bonds%j(b)
        if (.not. bonds%intact(b) .or. view%body%body(j) /= view%body%body(k)) cycle
        if (bonds%length(b) > patch_radius(view%body%spacing(k))) cycle
        cosine = min(1.0_wp, max(0.0_wp, dot_product(of_slot(:, k), of_slot(:, j))))
        differs = differs + cosine**2*(1 - cosine)
        like = like + cosine**2
      end do
      if (like > 0.0_wp) normals(:, i) = normals(:, i)/(1 + differs/like/even)**2
    end do
    !$omp end parallel
  end subroutine weigh

  !> The bonds of points of which normals are made, and the points at their other ends.
  subroutine take_surface(view, slots, weight, surface)
    type(term_view_type), intent(in) :: view         !! the instant
    integer(i4), intent(in) :: slots(:)              !! of the points, in their order
    real(wp), intent(in) :: weight(:)                !! of their normals; 0: they get none [-]
    type(surface_type), intent(out) :: surface
    integer(i4), allocatable :: place(:)

    surface%slots = slots
    surface%weight = weight
    call take_bonds(view, surface)
    allocate (place(view%body%n_slots), source=0_i4)
    call take_places(view, place, surface)
    call turn_round(surface)
  end subroutine take_surface

  !> The bonds of points within their bodies; their members are slots yet.
  subroutine take_bonds(view, surface)
    type(term_view_type), intent(in) :: view
    type(surface_type), intent(inout) :: surface
    type(bonds_type) :: bonds
    integer :: i, b, n

    allocate (surface%start(size(surface%slots) + 1), source=0)
    !$omp parallel if (size(surface%slots) >= worth_threads) default(none) shared(surface, view) &
    !$omp private(bonds, i, b, n)
    call allocate_bonds(view%family, bonds)
    !$omp do schedule(dynamic, at_once)
    do i = 1, size(surface%slots)
      if (.not. surface%weight(i) > 0.0_wp) cycle
      call view%family%bonds_of(int(surface%slots(i)), bonds)
      surface%start(i + 1) = count(view%body%body(bonds%j(:bonds%n)) &
        & == view%body%body(surface%slots(i)))
    end do
    !$omp end do
    !$omp single
    surface%start(1) = 1
    do i = 1, size(surface%slots)
      surface%start(i + 1) = surface%start(i + 1) + surface%start(i)
    end do
    n = surface%start(size(surface%slots) + 1) - 1
    allocate (surface%member(n), surface%owner(n), surface%near(n), surface%intact(n))
    !$omp end single
    !$omp do schedule(dynamic, at_once)
    do i = 1, size(surface%slots)
      if (.not. surface%weight(i) > 0.0_wp) cycle
      call view%family%bonds_of(int(surface%slots(i)), bonds)
      n = surface%start(i)
      do b = 1, bonds%n
        if (view%body%body(bonds%j(b)) /= view%body%body(surface%slots(i))) cycle
        surface%member(n) = bonds%j(b)
        surface%owner(n) = int(i, i4)
        surface%near(n) = max(0.0_wp, 1 - bonds%length(b)/horizon(view, int(surface%slots(i))))
        surface%intact(n) = bonds%intact(b)
        n = n + 1
      end do
    end do
    !$omp end parallel
    surface%broken = view%broken
  end subroutine take_bonds

  !> The places of points and members, which replace the slots of these.
  subroutine take_places(view, place, surface)
    type(term_view_type), intent(in) :: view
    integer(i4), intent(inout) :: place(:)    !! (n_slots) 0, on return again
    type(surface_type), intent(inout) :: surface
    integer(i4), allocatable :: around(:)
    integer :: n, i, b

    allocate (around(size(surface%slots) + size(surface%member)))
    n = 0
    do i = 1, size(surface%slots)
      call enter(int(surface%slots(i)))
    end do
    do b = 1, size(surface%member)
      call enter(int(surface%member(b)))
    end do
    surface%around = around(:n)
    if (n > 1) surface%around = around(ascending_order(int(view%body%point(around(:n)), i4)))
    surface%volume = view%body%volume(surface%around)
    do i = 1, n
      place(surface%around(i)) = int(i, i4)
    end do
    allocate (surface%place(size(surface%slots)), source=0_i4)
    allocate (surface%own(n), source=0_i4)
    do i = 1, size(surface%slots)
      if (surface%slots(i) == 0_i4) cycle
      surface%place(i) = place(surface%slots(i))
      surface%own(surface%place(i)) = int(i, i4)
    end do
    surface%member = place(surface%member)
    place(surface%around) = 0_i4

  contains

    subroutine enter(slot)
      integer, intent(in) :: slot

      if (slot == 0) return
      if (place(slot) > 0_i4) return
      n = n + 1
      place(slot) = int(n, i4)
      around(n) = int(slot, i4)
    end subroutine enter
  end subroutine take_places

  !> The bonds at whose other end each place is.
  subroutine turn_round(surface)
    type(surface_type), intent(inout) :: surface
    integer, allocatable :: next(:)
    integer :: n, b, a

    n = size(surface%around)
    allocate (surface%first(n + 1), source=0)
    do b = 1, size(surface%member)
      a = surface%member(b)
      surface%first(a + 1) = surface%first(a + 1) + 1
    end do
    surface%first(1) = 1
    do a = 1, n
      surface%first(a + 1) = surface%first(a + 1) + surface%first(a)
    end do
    allocate (surface%bond(size(surface%member)))
    next = surface%first(:n)
    do b = 1, size(surface%member)
      a = surface%member(b)
      surface%bond(next(a)) = b
      next(a) = next(a) + 1
    end do
  end subroutine turn_round

  !> How far the family of a point reaches before the motion [m].
  pure real(wp) function horizon(view, k)
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: k   !! slot

    horizon = view%family%rule%delta
    if (view%family%rule%ratio > 0.0_wp) horizon = view%family%rule%ratio*view%body%spacing(k)
  end function horizon

  !> Bring up to date which bonds are intact, if any has broken since.
  subroutine renew_intact(surface, view)
    type(surface_type), intent(inout) :: surface   !! of this body
    type(term_view_type), intent(in) :: view       !! the instant
    type(bonds_type) :: bonds
    integer :: i, b, n

    if (surface%broken == view%broken) return
    surface%broken = view%broken
    !$omp parallel if (size(surface%slots) >= worth_threads) default(none) shared(surface, view) &
    !$omp private(bonds, i, b, n)
    call allocate_bonds(view%family, bonds)
    !$omp do schedule(dynamic, at_once)
    do i = 1, size(surface%slots)
      if (surface%start(i + 1) == surface%start(i)) cycle
      call view%family%bonds_of(int(surface%slots(i)), bonds)
      n = surface%start(i)
      do b = 1, bonds%n
        if (view%body%body(bonds%j(b)) /= view%body%body(surface%slots(i))) cycle
        surface%intact(n) = bonds%intact(b)
        n = n + 1
      end do
    end do
    !$omp end parallel
  end subroutine renew_intact

  !> Normals of those points of a surface that are `wanted`, with what couples need; others get 0.
  subroutine find_normals(surface, view, wanted, frame)
    type(surface_type), intent(in) :: surface   !! with the bonds that are intact now
    type(term_view_type), intent(in) :: view    !! the instant
    logical, intent(in) :: wanted(:)            !! (points)
    type(frame_type), intent(out) :: frame
    real(wp), allocatable :: y(:, :)
    real(wp) :: here(3), r(3), total(3), volume, square, part, length
    integer :: i, b, j

    if (surface%broken /= view%broken) call internal_fault('a surface of other bonds')
    allocate (frame%normals(3, size(surface%slots)), frame%of_sum(size(surface%slots)))
    allocate (frame%unit(3, size(surface%member)), frame%inverse(size(surface%member)))
    call gather(surface%around, view%u, y, view%body%x)
    !$omp parallel do if (size(surface%slots) >= worth_threads) default(none) &
    !$omp schedule(dynamic, at_once) shared(surface, wanted, frame, y) &
    !$omp private(here, r, total, volume, square, part, length, i, b, j)
    do i = 1, size(surface%slots)
      frame%normals(:, i) = 0.0_wp
      frame%of_sum(i) = 0.0_wp
      if (.not. wanted(i) .or. .not. surface%weight(i) > 0.0_wp) cycle
      here = y(:, surface%place(i))
      total = 0.0_wp
      volume = 0.0_wp
      do b = surface%start(i), surface%start(i + 1) - 1
        j = surface%member(b)
        r = y(:, j) - here
        square = r(1)**2 + r(2)**2 + r(3)**2
        frame%inverse(b) = 0.0_wp
        if (.not. surface%intact(b) .or. .not. square > 0.0_wp) cycle
        part = 1/sqrt(square)
        frame%inverse(b) = surface%near(b)*part
        frame%unit(:, b) = part*r
        total = total - surface%volume(j)*frame%inverse(b)*r
        volume = volume + surface%volume(j)*surface%near(b)
      end do
      length = sqrt(total(1)**2 + total(2)**2 + total(3)**2)
      if (.not. length > least*volume) cycle
      frame%of_sum(i) = surface%weight(i)/length
      frame%normals(:, i) = frame%of_sum(i)*total
    end do
    !$omp end parallel do
  end subroutine find_normals

  !> Rates of the normals, of the velocities at that instant.
  subroutine find_rates(surface, frame, view, rates)
    type(surface_type), intent(in) :: surface    !! that the normals were found of
    type(frame_type), intent(in) :: frame        !! the normals
    type(term_view_type), intent(in) :: view     !! the instant
    real(wp), allocatable, intent(out) :: rates(:, :)   !! (3, points) [1/s]
    real(wp), allocatable :: v(:, :)
    real(wp) :: here(3), w(3), total(3)
    integer :: i, b, j

    allocate (rates(3, size(surface%slots)))
    call gather(surface%around, view%v, v)
    !$omp parallel do if (size(surface%slots) >= worth_threads) default(none) &
    !$omp schedule(dynamic, at_once) shared(surface, frame, v, rates) &
    !$omp private(here, w, total, i, b, j)
    do i = 1, size(surface%slots)
      rates(:, i) = 0.0_wp
      if (.not. frame%of_sum(i) > 0.0_wp) cycle
      here = v(:, surface%place(i))
      total = 0.0_wp
      do b = surface%start(i), surface%start(i + 1) - 1
        if (.not. frame%inverse(b) > 0.0_wp) cycle
        j = surface%member(b)
        w = v(:, j) - here
        w = w - (w(1)*frame%unit(1, b) + w(2)*frame%unit(2, b) + w(3)*frame%unit(3, b)) &
          & *frame%unit(:, b)
        total = total - surface%volume(j)*frame%inverse(b)*w
      end do
      rates(:, i) = turned(frame, i, total)
    end do
    !$omp end parallel do
  end subroutine find_rates

  !> From couples on the normals to those on the sums that these are the directions of.
  pure subroutine turn_couples(surface, frame, couples)
    type(surface_type), intent(in) :: surface     !! that the normals were found of
    type(frame_type), intent(in) :: frame         !! the normals
    real(wp), intent(inout) :: couples(:, :)
      !! (3, points) on unit normals, per volume [N/m2]; on return on the sums
    integer :: i

    do i = 1, size(surface%slots)
      if (any(abs(couples(:, i)) > 0.0_wp)) couples(:, i) = turned(frame, i, couples(:, i))
    end do
  end subroutine turn_couples

  !> The forces on points and their families by what acts on the normals: the power of the couple c
  !> of a point is c.dN/dt per volume of the point.
  subroutine add_couples(surface, frame, couples, force)
    type(surface_type), intent(in) :: surface     !! that the normals were found of
    type(frame_type), intent(in) :: frame         !! the normals
    real(wp), intent(in) :: couples(:, :)         !! (3, points) from `turn_couples`
    real(wp), intent(inout), contiguous :: force(:, :)
      !! (n_slots, dim) force density, added to [N/m3]
    real(wp) :: total(3), c(3)
    logical :: turns(size(surface%slots))
    integer :: a, i, e, b, k

    do i = 1, size(surface%slots)
      turns(i) = .not. all(abs(couples(:, i)) <= 0.0_wp)
    end do
    !$omp parallel do if (size(surface%slots) >= worth_threads) default(none) &
    !$omp schedule(dynamic, at_once) shared(surface, frame, couples, turns, force) &
    !$omp private(total, c, a, i, e, b, k)
    do a = 1, size(surface%around)
      total = 0.0_wp
      do e = surface%first(a), surface%first(a + 1) - 1
        b = surface%bond(e)
        i = surface%owner(b)
        if (.not. turns(i)) cycle
        if (.not. frame%inverse(b) > 0.0_wp) cycle
        c = couples(:, i)
        c = c - (c(1)*frame%unit(1, b) + c(2)*frame%unit(2, b) + c(3)*frame%unit(3, b)) &
          & *frame%unit(:, b)
        total = total - surface%volume(surface%place(i))*frame%inverse(b)*c
      end do
      i = surface%own(a)
      if (i > 0) then
        if (turns(i)) then
          do b = surface%start(i), surface%start(i + 1) - 1
            if (.not. frame%inverse(b) > 0.0_wp) cycle
            c = couples(:, i)
            c = c - (c(1)*frame%unit(1, b) + c(2)*frame%unit(2, b) + c(3)*frame%unit(3, b)) &
              & *frame%unit(:, b)
            total = total + surface%volume(surface%member(b))*frame%inverse(b)*c
          end do
        end if
      end if
      k = surface%around(a)
      force(k, :) = force(k, :) + total(:size(force, 2))
    end do
    !$omp end parallel do
  end subroutine add_couples

  !> What a change of the sum of directions does to the normal, or what acts on the normal does to
  !> the sum.
  pure function turned(frame, i, change)
    type(frame_type), intent(in) :: frame
    integer, intent(in) :: i                !! point with a normal
    real(wp), intent(in) :: change(3)
    real(wp) :: turned(3)

    associate (n => frame%normals(:, i))
      turned = frame%of_sum(i)*(change - dot_product(change, n)/dot_product(n, n)*n)
    end associate
  end function turned

  !> Vectors of some slots with three components, those that there are none of 0; with the values of
  !> `more` added.
  subroutine gather(slots, values, vectors, more)
    integer(i4), intent(in) :: slots(:)
    real(wp), intent(in) :: values(:, :)
    real(wp), allocatable, intent(out) :: vectors(:, :)
    real(wp), intent(in), optional :: more(:, :)
    integer :: a, c

    allocate (vectors(3, size(slots)), source=0.0_wp)
    do c = 1, size(values, 2)
      if (present(more)) then
        do a = 1, size(slots)
          vectors(c, a) = values(slots(a), c) + more(slots(a), c)
        end do
      else
        do a = 1, size(slots)
          vectors(c, a) = values(slots(a), c)
        end do
      end if
    end do
  end subroutine gather

  !> The normal of a pair, from one point to the other: between the normal of one and the opposite
  !> of the other's, nearer to that of the larger weight; 0 if one has none, or if they do not face
  !> each other.
  pure subroutine normal_of_pair(one, other, n, length)
    real(wp), intent(in) :: one(3)    !! outward normal times its weight, or 0
    real(wp), intent(in) :: other(3)  !! of the other
    real(wp), intent(out) :: n(3)     !! unit vector, or 0
    real(wp), intent(out) :: length   !! of the difference of both normals, 0 without n [-]
    real(wp) :: both

    n = 0.0_wp
    length = 0.0_wp
    both = sqrt(dot_product(one, one)*dot_product(other, other))
    if (.not. both > 0.0_wp .or. dot_product(one, other) > most_cosine*both) return
    length = sqrt(dot_product(one - other, one - other))
    n = (one - other)/length
  end subroutine normal_of_pair

  !> How two points meet: the weights (1 - t^2/R^2)^2 of all others on a lattice add up to about 1,
  !> t the distance across the normal.
  pure subroutine meet(r, n, dim, spacing, begins, patch)
    real(wp), intent(in) :: r(3)        !! from one to the other [m]
    real(wp), intent(in) :: n(3)        !! normal of the pair, a unit vector
    integer, intent(in) :: dim          !! 2 or 3
    real(wp), intent(in) :: spacing     !! mean of both [m]
    real(wp), intent(in) :: begins      !! gap at which they begin to push [m]
    type(patch_type), intent(out) :: patch
    real(wp) :: radius, square, most

    radius = patch_radius(spacing)
    patch%gap = dot_product(r, n)
    patch%across = r - patch%gap*n
    square = dot_product(patch%across, patch%across)
    patch%touches = patch%gap < begins .and. square < radius**2 .and. patch%gap > -radius
    if (.not. patch%touches) return
    ! the integral over the lattice's line or plane is one spacing or its square
    most = 15*spacing/(16*radius)
    if (dim == 3) most = 3*spacing**2/(pi*radius**2)
    patch%weight = most*(1 - square/radius**2)**2
    patch%slope = -4*most*(1 - square/radius**2)/radius**2
  end subroutine meet

  !> The distance across the normal up to which two points meet [m].
  elemental real(wp) function patch_radius(spacing) result(radius)
    real(wp), intent(in) :: spacing     !! mean of both [m]
    radius = wide*spacing
  end function patch_radius

end module pd_force_normals
