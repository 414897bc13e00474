!> Points of a lattice that are alike when axes are mirrored (doc/theory.md, 4): around a round hole
!> there are up to four such points in the plane and eight in space, holes of one shape are alike,
!> and so are the layers along a hole through a thick plate. Bonds of points that are alike get the
!> same weights, so that few are unknown.
!>
!> The points whose bonds have unknown weights make pieces that hang together. A way to mirror the
!> axes is a symmetry of a piece if its points, so mirrored, are at the same places; two pieces are
!> alike if one, mirrored, is the other. Points near each other that only look alike, as those along
!> a step of a round rim, are not: with equal weights there would be no solution. Nor are axes
!> exchanged: splines on a grid along the axes would not be smooth across a diagonal, and the
!> iterations would take twice as many.
module pd_set_up_consistent_symmetries
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_lookup, only: lookup_type, mix
  use pd_body_body, only: body_type
  use pd_family_bond_weights, only: bond_weights_type
  use pd_set_up_consistent_patterns, only: patterns_type, place_of, xi_of_key
  use pd_set_up_consistent_pieces, only: both, find_codes, find_layers, find_pieces, join_layers, &
    & layer_of, mirrored_place, mirrors, piece_type
  implicit none (type, external)
  private
  public :: symmetries_type, known_type, symmetries_of_box, find_symmetries, mirrored_key

  type :: symmetries_type
    integer :: n_classes = 0
    integer(i4), allocatable :: class(:)       !! (n_slots) of points that are alike; 0: none
    integer(i4), allocatable :: first(:)       !! (classes) the slot that stands for each
    integer(i4), allocatable :: way(:)         !! (n_slots) that makes of what is around a point
                                               !! what is around the first one of its class
    logical, allocatable :: keeps(:, :)        !! (ways, classes) what is around the first one stays
                                               !! as it is when mirrored in this way
    real(wp), allocatable :: sign(:, :)        !! (dim, ways) of components mirrored in each way
    integer(i8), allocatable :: key(:)         !! of all bonds, increasing
    integer(i8), allocatable :: mirrored(:, :) !! (ways, keys) what each becomes
  end type symmetries_type

  !> What is known of bonds and points, and must be the same of those that are alike.
  type :: known_type
    logical, allocatable :: near(:)            !! (n_slots) points whose bonds have unknown weights
    logical, allocatable :: fixed(:)           !! (n_slots) those with areas that loads act through
    real(wp), allocatable :: area(:, :)        !! (n_slots, dim) outward surface areas [m2]
    type(patterns_type) :: patterns            !! of the body's families
    type(patterns_type) :: of_box              !! of those of the box around it
    type(bond_weights_type) :: weights         !! of the box; without rows: not known yet
  end type known_type

  !> Classes over points above which the points have weights of their own: with symmetries each
  !> iteration takes longer.
  real(wp), parameter :: most_of_points = 0.7_wp

contains

  !> The points of a box that are alike: symmetries of the box turn one into the other, or they lie
  !> in layers that are alike.
  subroutine symmetries_of_box(body, delta, within, known, symmetries)
    type(body_type), intent(in) :: body       !! a lattice with all cells of a box
    real(wp), intent(in) :: delta             !! horizon [m]
    integer, intent(in) :: within             !! horizons from a face to where layers are alike
    type(known_type), intent(in) :: known     !! of all points
    type(symmetries_type), allocatable, intent(out) :: symmetries  !! not allocated if not found
    type(piece_type) :: pieces(1)
    integer, allocatable :: place(:, :), slot_at(:, :, :), piece(:)
    integer :: n(3), d, i
    logical :: found

    allocate (symmetries)
    call mirror_keys(body, known%patterns, delta, symmetries, found)
    if (found) then
      call place_points(body, body, place, slot_at)
      n = shape(slot_at)
      associate (box => pieces(1))
        box%list = pack(slot_at, slot_at > 0)
        box%low = 1
        box%high = n
        box%same = spread(.true., 1, 2**body%dim)
        allocate (box%layer(maxval(n), 3))
        do d = 1, 3
          box%layer(:, d) = [(i, i=1, maxval(n))]
          call join_layers(1, n(d), within*int(delta/minval(body%spacing, &
            & mask=body%point > 0)), box%layer(:, d))
        end do
      end associate
      piece = merge(1, 0, body%point > 0)
      call find_classes(place, slot_at, pieces, symmetries)
      call check_classes(known, piece, pieces, symmetries, found)
    end if
    if (.not. found) deallocate (symmetries)
  end subroutine symmetries_of_box

  !> The points of a body that are alike among those whose bonds have unknown weights.
  subroutine find_symmetries(cells, body, delta, within, known, symmetries)
    type(body_type), intent(in) :: cells      !! a point in each cell of the box around the body, in
                                              !! its slots
    type(body_type), intent(in) :: body       !! one lattice
    real(wp), intent(in) :: delta             !! horizon [m]
    integer, intent(in) :: within             !! horizons to the end of layers that are all alike,
                                              !! in which they are not taken as one
    type(known_type), intent(in) :: known
    type(symmetries_type), allocatable, intent(out) :: symmetries
      !! not allocated if hardly any points are alike
    type(piece_type), allocatable :: pieces(:)
    integer, allocatable :: place(:, :), slot_at(:, :, :), piece(:)
    integer :: wide, round, p
    logical :: found

    allocate (symmetries)
    call mirror_keys(body, known%patterns, delta, symmetries, found)
    if (found) then
      associate (spacing => cells%spacing(findloc(cells%point > 0, .true., dim=1)))
        wide = within*int(delta/spacing)
      end associate
      call place_points(cells, body, place, slot_at)
      call find_pieces(known%near, known%patterns, place, slot_at, piece, pieces)
      do p = 1, size(pieces)
        allocate (pieces(p)%same(2**body%dim))
        call find_codes(known%fixed, place, pieces(p))
        call find_layers(known%fixed, place, wide, pieces(p))
      end do
      do round = 1, size(pieces) + 1
        call find_classes(place, slot_at, pieces, symmetries)
        call check_classes(known, piece, pieces, symmetries, found)
        if (found) exit
      end do
      found = found .and. symmetries%n_classes <= most_of_points*count(known%near)
    end if
    if (.not. found) deallocate (symmetries)
  end subroutine find_symmetries

  !> The key of a bond, mirrored in a way.
  pure integer(i8) function mirrored_key(symmetries, way, key) result(mirrored)
    type(symmetries_type), intent(in) :: symmetries
    integer, intent(in) :: way        !! number
    integer(i8), intent(in) :: key    !! of a bond
    integer :: low, high, middle

    mirrored = key
    if (way == 1) return
    low = 1
    high = size(symmetries%key)
    do while (low < high)
      middle = (low + high)/2
      if (symmetries%key(middle) < key) then
        low = middle + 1
      else
        high = middle
      end if
    end do
    mirrored = symmetries%mirrored(way, low)
  end function mirrored_key

  !> What each bond becomes. `found`: each has one place in the lattice.
  subroutine mirror_keys(body, patterns, delta, symmetries, found)
    type(body_type), intent(in) :: body
    type(patterns_type), intent(in) :: patterns
    real(wp), intent(in) :: delta
    type(symmetries_type), intent(inout) :: symmetries
    logical, intent(out) :: found
    type(lookup_type) :: met
    integer(i8), allocatable :: keys(:)
    integer, allocatable :: offset(:, :)
    integer(i8) :: i, largest
    integer :: m, w, o, d, number
    logical :: is_new

    allocate (keys(0))
    do i = 1, size(patterns%key, kind=i8)
      call met%number_of(patterns%key(i), number, is_new)
      if (is_new) keys = [keys, patterns%key(i)]
    end do
    allocate (symmetries%key(size(keys)))
    largest = -huge(1_i8)
    do m = 1, size(keys)
      symmetries%key(m) = minval(keys, mask=keys > largest)
      largest = symmetries%key(m)
    end do
    associate (dim => body%dim)
      symmetries%sign = reshape([((merge(-1.0_wp, 1.0_wp, mirrors(w, d)), d=1, dim), &
        & w=1, 2**dim)], [dim, 2**dim])
      allocate (symmetries%mirrored(2**dim, size(keys)), source=0_i8)
      allocate (offset(dim, size(keys)))
    end associate
    associate (spacing => body%spacing(findloc(body%point > 0, .true., dim=1)))
      do m = 1, size(keys)
        offset(:, m) = nint(xi_of_key(symmetries%key(m), body%dim, delta)/spacing)
      end do
    end associate
    found = .true.
    do w = 1, size(symmetries%sign, 2)
      do m = 1, size(keys)
        number = 0
        do o = 1, size(keys)
          if (any(offset(:, o) /= nint(symmetries%sign(:, w))*offset(:, m))) cycle
          number = number + 1
          symmetries%mirrored(w, m) = symmetries%key(o)
        end do
        found = found .and. number == 1
      end do
    end do
  end subroutine mirror_keys

  !> The places of points along the axes, from 1, and the slots at places.
  subroutine place_points(cells, body, place, slot_at)
    type(body_type), intent(in) :: cells, body
    integer, allocatable, intent(out) :: place(:, :)         ! (3, n_slots)
    integer, allocatable, intent(out) :: slot_at(:, :, :)    ! 0: no point of the body
    integer :: k, d

    allocate (place(3, cells%n_slots), source=1)
    associate (spacing => cells%spacing(findloc(cells%point > 0, .true., dim=1)))
      do d = 1, body%dim
        associate (x => cells%x(:, d))
          where (cells%point > 0) place(d, :) = 1 + nint((x - minval(x, mask=cells%point > 0)) &
            & /spacing)
        end associate
      end do
    end associate
    allocate (slot_at(maxval(place(1, :)), maxval(place(2, :)), maxval(place(3, :))), source=0)
    do k = 1, body%n_slots
      if (body%point(k) > 0) slot_at(place(1, k), place(2, k), place(3, k)) = k
    end do
  end subroutine place_points

  !> Classes of points, as the pieces that have symmetries or are alike make them.
  subroutine find_classes(place, slot_at, pieces, symmetries)
    integer, intent(in) :: place(:, :), slot_at(:, :, :)
    type(piece_type), intent(in) :: pieces(:)
    type(symmetries_type), intent(inout) :: symmetries   ! gets classes
    type(lookup_type) :: codes
    integer :: standing(size(pieces)), p, s, i, number, way, at(3)
    logical :: is_new

    symmetries%n_classes = 0
    symmetries%class = spread(0_i4, 1, size(place, 2))
    symmetries%way = spread(1_i4, 1, size(place, 2))
    if (allocated(symmetries%first)) deallocate (symmetries%first, symmetries%keeps)
    allocate (symmetries%first(1024), symmetries%keeps(size(symmetries%sign, 2), 1024))
    do p = 1, size(pieces)
      s = p
      if (.not. pieces(p)%alone) then
        call codes%number_of(pieces(p)%least, number, is_new)
        if (is_new) standing(number) = p
        s = standing(number)
      end if
      if (s == p) then
        do i = 1, size(pieces(p)%list)
          associate (k => pieces(p)%list(i))
            if (all(layer_of(pieces(p), place(:, k)) == place(:, k))) call take(pieces(p), k)
          end associate
        end do
      end if
      ! what makes the one piece of the other
      way = both(findloc(pieces(s)%same, .true., dim=1), findloc(pieces(p)%same, .true., dim=1))
      do i = 1, size(pieces(p)%list)
        associate (k => pieces(p)%list(i))
          if (symmetries%class(k) > 0) cycle
          at = place(:, k)
          if (s /= p) at = mirrored_place(pieces(p), way, at) - pieces(p)%low + pieces(s)%low
          associate (found => slot_of(layer_of(pieces(s), at)))
            symmetries%class(k) = symmetries%class(found)
            symmetries%way(k) = int(both(int(symmetries%way(found)), way), i4)
          end associate
        end associate
      end do
    end do
    symmetries%first = symmetries%first(:symmetries%n_classes)
    symmetries%keeps = symmetries%keeps(:, :symmetries%n_classes)

  contains

    !> Give a point its class: that of the first of those that it is mirrored to.
    subroutine take(piece, k)
      type(piece_type), intent(in) :: piece
      integer, intent(in) :: k          ! slot
      integer :: at(3), best(3), w, c
      logical :: keeps(size(symmetries%sign, 2))

      keeps = .false.
      best = huge(1)
      do w = 1, size(keeps)
        if (piece%alone .and. w > 1) exit
        ! all that make the code of one way are symmetries one after another
        if (.not. piece%alone .and. .not. piece%same(both(findloc(piece%same, .true., dim=1), w))) &
          & cycle
        at = layer_of(piece, mirrored_place(piece, w, place(:, k)))
        ! by the last axis first
        c = findloc(at /= best, .true., dim=1, back=.true.)
        if (c > 0) then
          if (at(c) > best(c)) cycle
          keeps = .false.
          best = at
        end if
        keeps(w) = .true.
      end do
      associate (first => slot_of(best))
        if (symmetries%class(first) == 0) then
          symmetries%n_classes = symmetries%n_classes + 1
          if (symmetries%n_classes > size(symmetries%first)) call make_room()
          symmetries%class(first) = int(symmetries%n_classes, i4)
          symmetries%first(symmetries%n_classes) = int(first, i4)
        end if
        symmetries%class(k) = symmetries%class(first)
        symmetries%way(k) = int(findloc(keeps, .true., dim=1), i4)
        if (first == k) symmetries%keeps(:, symmetries%class(k)) = keeps
      end associate
    end subroutine take

    subroutine make_room()
      integer(i4), allocatable :: first(:)
      logical, allocatable :: keeps(:, :)

      associate (n => size(symmetries%first))
        allocate (first(2*n), keeps(size(symmetries%keeps, 1), 2*n))
        first(:n) = symmetries%first
        keeps(:, :n) = symmetries%keeps
      end associate
      call move_alloc(first, symmetries%first)
      call move_alloc(keeps, symmetries%keeps)
    end subroutine make_room

    integer function slot_of(at) result(k)
      integer, intent(in) :: at(3)
      k = slot_at(at(1), at(2), at(3))
    end function slot_of

  end subroutine find_classes

  !> Whether points of one class are alike in all that is known of them; pieces with others stand
  !> alone from now on.
  subroutine check_classes(known, piece, pieces, symmetries, found)
    type(known_type), intent(in) :: known
    integer, intent(in) :: piece(:)
    type(piece_type), intent(inout) :: pieces(:)
    type(symmetries_type), intent(in) :: symmetries
    logical, intent(out) :: found
    real(wp), parameter :: near_area = 1.0e-9_wp    ! of areas that are the same, over the largest
    real(wp), parameter :: near_weight = 1.0e-9_wp  ! of weights that are the same
    type(lookup_type) :: kinds
    logical :: differs(size(pieces))
    integer, allocatable :: list(:)
    integer(i8) :: kind
    real(wp) :: small
    integer :: i, k, w, p, number
    logical :: is_new

    ! of points with one pattern one is enough
    allocate (list(size(piece)))
    do k = 1, size(piece)
      if (piece(k) == 0) cycle
      kind = mix(int(known%patterns%of(k), i8), int(piece(k), i8))
      if (allocated(known%weights%row)) kind = mix(kind, int(known%weights%row(k), i8))
      kind = mix(mix(kind, int(symmetries%class(k), i8)), int(symmetries%way(k), i8))
      call kinds%number_of(kind, number, is_new)
      if (is_new) list(number) = k
    end do
    list = list(:kinds%count)
    small = near_area*maxval(abs(known%area))
    differs = .false.
    !$omp parallel default(none) reduction(.or.: differs) private(i, k, w, p) &
    !$omp shared(known, piece, symmetries, small, list)
    !$omp do schedule(static)
    do k = 1, size(piece)
      p = piece(k)
      if (p == 0) cycle
      if (.not. same_area(k, int(symmetries%first(symmetries%class(k))), &
        & int(symmetries%way(k)))) differs(p) = .true.
    end do
    !$omp do schedule(dynamic, 64)
    do i = 1, size(list)
      k = list(i)
      p = piece(k)
      if (.not. alike(k, int(symmetries%first(symmetries%class(k))), int(symmetries%way(k)))) &
        & differs(p) = .true.
    end do
    !$omp do schedule(dynamic, 64)
    do i = 1, symmetries%n_classes
      k = int(symmetries%first(i))
      do w = 2, size(symmetries%keeps, 1)
        if (.not. symmetries%keeps(w, i)) cycle
        if (.not. (same_area(k, k, w) .and. alike(k, k, w))) differs(piece(k)) = .true.
      end do
    end do
    !$omp end parallel
    found = .not. any(differs)
    do p = 1, size(pieces)
      if (.not. differs(p)) cycle
      if (pieces(p)%alone) call internal_fault('a point that is not like itself')
      pieces(p)%alone = .true.
    end do

  contains

    !> Whether the area of point k is, mirrored in a way, that of another.
    logical function same_area(k, other, way)
      integer, intent(in) :: k, other, way
      same_area = all(abs(symmetries%sign(:, way)*known%area(k, :) - known%area(other, :)) &
        & <= small)
    end function same_area

    !> Whether the bonds of point k are, mirrored in a way, those of another.
    logical function alike(k, other, way)
      integer, intent(in) :: k, other, way
      integer(i8) :: e, key
      integer :: place, its_place

      associate (p => known%patterns%of(k), q => int(known%patterns%of(other)), &
        & start => known%patterns%start)
        alike = start(p + 1) - start(p) == start(q + 1) - start(q)
        do e = start(p), start(p + 1) - 1
          if (.not. alike) return
          key = mirrored_key(symmetries, way, known%patterns%key(e))
          alike = place_of(known%patterns, q, key) > 0
          if (.not. alike) return
          if (.not. allocated(known%weights%row)) cycle
          place = place_of(known%of_box, int(known%of_box%of(k)), known%patterns%key(e))
          its_place = place_of(known%of_box, int(known%of_box%of(other)), key)
          associate (weights => known%weights)
            associate (one => weights%before(k) + place, two => weights%before(other) + its_place)
              alike = abs(weights%Gb(one) - weights%Gb(two)) <= near_weight .and. &
                & abs(weights%Gd(one) - weights%Gd(two)) <= near_weight
            end associate
          end associate
        end do
      end associate
    end function alike

  end subroutine check_classes

end module pd_set_up_consistent_symmetries
