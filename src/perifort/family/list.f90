!> List families for any cloud of points. Points are sorted so that eight that follow each other lie
!> close together: a cluster, whose families have most of their members in common. What is stored
!> are packs of each cluster's members: one, or two that no lane has both in its family, with a bit
!> for every lane that has a bond. The loops take the eight lanes of one pack at a time.
!>
!> Nothing else of the family is stored: xi, |xi| and v_c come from the points, but for exact
!> volumes. Tables of what they and the model give, where they help the loops, belong to these
!> (`pd_force_list_tables`).
module pd_family_list
  use pd_base_archive, only: archive_type
  use pd_base_kinds, only: wp, i1, i2, i4, i8
  use pd_base_lanes, only: lanes
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type, arrange, number_of_slot => number_at
  use pd_family_clusters, only: rows_type, order_in_rows, collect_members, lane_bit, &
    & pair_members, single_members
  use pd_family_family, only: family_type, bonds_type
  use pd_family_volume, only: volume_rule_type, volume_correction, reach, volume_exact, &
    & volume_none, horizon_of_bond, rule_of_bond
  implicit none (type, external)
  private
  public :: list_family_type, new_list_family, find_turns

  type, extends(family_type) :: list_family_type
    integer(i8), allocatable :: start(:)       !! first pack of each cluster (clusters + 1)
    integer(i4), allocatable :: member(:, :)   !! slots at the other ends (2, packs)
    integer(i1), allocatable :: first(:)       !! lanes whose bond goes to `member(1, :)`
    integer(i1), allocatable :: bits(:)        !! the lanes that have a bond (packs)
    integer(i1), allocatable :: intact(:)      !! those of them whose bond is intact
    integer :: most_packs = 0                  !! largest number of packs of a cluster
    real(wp), allocatable :: x(:, :)           !! position of each slot (dim, n_slots) [m]
    real(wp), allocatable :: volume(:)         !! (n_slots) [m3]
    real(wp), allocatable :: spacing(:)        !! (n_slots) [m]
    logical :: one_spacing = .false.           !! all points have the same
    logical :: fixed_order = .false.           !! bonds of each point are in the order of numbers of
                                               !! points, and no pack has two members
    real(wp), allocatable :: fraction(:, :)    !! v_c of every lane (lanes, packs), only where it is
                                               !! no simple formula, else of size 0
    integer(i4), allocatable :: turn(:)        !! clusters, those that need nothing of copies of
                                               !! other ranks' points first; not allocated where
                                               !! there are no copies
    integer :: n_early = 0                     !! how many come first
    integer(i4), allocatable :: copies(:)      !! slots of copies, where there are some
    character(:), allocatable :: reason        !! why this family and no lattice
  contains
    procedure :: bonds_of
    procedure :: number_at
    procedure :: break_bond
    procedure :: may_have_broken
    procedure :: keep_bonds
    procedure :: bytes
    procedure :: describe
  end type list_family_type

contains

  !> Families of all points of `body`, which is sorted, and filled with dead slots up to whole
  !> clusters. Members are those within the rule's reach for the bond's mean spacing and, where
  !> points have their own horizons, the larger one of both ends. In a composite family points of
  !> one grid are no members of each other here. Where results must not depend on the ranks, the
  !> bonds of a point have a fixed order.
  subroutine new_list_family(body, rule, family, apart)
    type(body_type), intent(inout) :: body
      !! in point order; arranged in the slots of the family on return
    type(volume_rule_type), intent(in) :: rule     !! volume correction and horizon
    type(list_family_type), intent(out) :: family  !! whole, all bonds intact
    logical, intent(in), optional :: apart
      !! bonds within grids are elsewhere; absent: they are here
    type(rows_type), allocatable :: rows(:)
    type(volume_rule_type) :: beyond
    real(wp), allocatable :: half_reach(:), own(:)
    integer(i4), allocatable :: order(:), point(:), member(:)
    integer(i2), allocatable :: label(:)
    integer :: k, n

    n = body%n_points
    call order_points(body, rule, rows, order)
    allocate (point(lanes*((n + lanes - 1)/lanes)), source=0_i4)
    point(:n) = body%point(order)
    call arrange(body, point)
    family%dim = body%dim
    family%n_slots = body%n_slots
    family%rule = rule
    allocate (half_reach(n), own(n))
    beyond = rule
    if (rule%ratio > 0.0_wp) beyond%delta = 0.0_wp
    do k = 1, n
      half_reach(k) = reach(beyond, body%spacing(k), body%dim)/2
      own(k) = 0.0_wp
      associate (h => body%spacing(k))
        if (rule%ratio > 0.0_wp) own(k) = reach(rule_of_bond(rule, h, h), 0.0_wp, body%dim)
      end associate
    end do
    allocate (label(n), source=0_i2)
    if (present(apart)) label = merge(body%grid(:n), 0_i2, apart)
    call collect_members(body%x(:n, :), half_reach, own, label, rows, family%start, member, &
      & family%bits)
    family%fixed_order = body%order%reproducible
    if (family%fixed_order) then
      call single_members(number_of_slot(body, [(k, k=1, n)]), family%start, member, family%bits, &
        & family%member, family%first)
    else
      call pair_members(family%start, member, family%bits, family%member, family%first)
    end if
    allocate (family%intact, source=family%bits)
    call count_bonds(family)
    if (body%order%n_owned > 0 .and. n > body%order%n_owned) &
      & call find_turns(family, body%slot(body%order%n_owned + 1:n))
    family%spacing = body%spacing
    family%one_spacing = maxval(body%spacing(:n)) <= minval(body%spacing(:n))
    allocate (family%x(family%dim, family%n_slots), family%volume(family%n_slots), source=0.0_wp)
    do k = 1, n
      family%x(:, k) = body%x(k, :)
      family%volume(k) = body%volume(k)
    end do
    if (rule%kind == volume_exact) then
      call store_fractions(family)
    else
      allocate (family%fraction(lanes, 0))
    end if
  end subroutine new_list_family

  !> The order of points in clusters. Those of one grid stand together, in cells for their spacing:
  !> clusters of two grids would be loose, and hardly one like another.
  subroutine order_points(body, rule, rows, order)
    type(body_type), intent(in) :: body                 !! in point order
    type(volume_rule_type), intent(in) :: rule          !! volume correction and horizon
    type(rows_type), allocatable, intent(out) :: rows(:)
      !! (groups) the cells of each grid, or of all points
    integer(i4), allocatable, intent(out) :: order(:)   !! (n_points) the points in their order
    integer, parameter :: most_groups = 64              !! every cluster looks at all of them
    logical :: has_points(0:huge(1_i2))
    integer(i4), allocatable :: some(:), sorted(:)
    integer :: g, i, k

    has_points = .false.
    do k = 1, body%n_points
      has_points(body%grid(k)) = .true.
    end do
    if (count(has_points) > most_groups .or. count(has_points) < 2) then
      allocate (rows(1))
      call order_in_rows(body%x, edge_of(body%spacing, all(body%grid > 0_i2)), 0, rows(1), order)
      return
    end if
    allocate (rows(count(has_points)), order(0))
    i = 0
    do g = 0, ubound(has_points, 1)
      if (.not. has_points(g)) cycle
      i = i + 1
      some = pack([(int(k, i4), k=1, body%n_points)], body%grid(:body%n_points) == g)
      call order_in_rows(body%x(some, :), edge_of(body%spacing(some), g > 0), size(order), &
        & rows(i), sorted)
      order = [order, some(sorted)]
    end do

  contains

    !> Width of the cells for points with these spacings [m].
    pure real(wp) function edge_of(spacing, on_grids)
      real(wp), intent(in) :: spacing(:)
      logical, intent(in) :: on_grids

      edge_of = maxval(spacing)
      ! cells for the finest points: in cells for the coarsest ones, eight fine points in a row
      ! along x would not lie close together
      if (rule%ratio > 0.0_wp) edge_of = minval(spacing)
      ! bonds in a fixed order have no tables in common
      edge_of = rows_high(body%dim, on_grids .and. .not. body%order%reproducible)*edge_of
    end function edge_of
  end subroutine order_points

  !> How many points lie above each other in a row of cells, so that clusters, eight points that
  !> follow each other in a row, are compact: eight in 1D, two by two by two in 3D. In 2D three by
  !> three, where packs have most bonds; but four by two on a lattice, where all clusters of a row
  !> then have one shape, whose tables stay in the first-level cache.
  pure integer function rows_high(dim, alike)
    integer, intent(in) :: dim    !! dimensions
    logical, intent(in) :: alike  !! points on lattices, whose clusters have tables in common

    select case (dim)
    case (1)
      rows_high = lanes
    case (2)
      rows_high = merge(2, 3, alike)
    case default
      rows_high = 2
    end select
  end function rows_high

  !> Note which points are copies of other ranks' points, and sort the clusters by whether they need
  !> something of these: one of their own points is a copy, or a member is.
  subroutine find_turns(family, copies)
    type(list_family_type), intent(inout) :: family  !! with its packs; knows its turns on return
    integer(i4), intent(in) :: copies(:)             !! slots of the copies, any number
    integer(i1), allocatable :: copy(:)
    logical, allocatable :: late(:)
    integer(i8) :: e
    integer :: c

    family%copies = copies
    allocate (copy(family%n_slots), source=0_i1)
    copy(copies) = 1_i1
    allocate (late(size(family%start) - 1))
    !$omp parallel do schedule(static) default(none) shared(family, copy, late) private(c, e)
    do c = 1, size(late)
      late(c) = any(copy(lanes*(c - 1) + 1:lanes*c) == 1_i1)
      do e = family%start(c), family%start(c + 1) - 1
        if (late(c)) exit
        late(c) = any(copy(family%member(:, e)) == 1_i1)
      end do
    end do
    family%n_early = count(.not. late)
    family%turn = [pack([(int(c, i4), c=1, size(late))], .not. late), &
      & pack([(int(c, i4), c=1, size(late))], late)]
  end subroutine find_turns

  !> The number of bonds, and the most that one point and the most packs that one cluster has.
  subroutine count_bonds(family)
    type(list_family_type), intent(inout) :: family
    integer(i8) :: e, n_bonds
    integer :: number(lanes), c, most_bonds, most_packs

    n_bonds = 0_i8
    most_bonds = 0
    most_packs = 0
    !$omp parallel do schedule(static) default(none) shared(family) private(c, e, number) &
    !$omp reduction(+:n_bonds) reduction(max:most_bonds, most_packs)
    do c = 1, size(family%start) - 1
      number = 0
      do e = family%start(c), family%start(c + 1) - 1
        where (iand(family%bits(e), lane_bit) /= 0_i1) number = number + 1
      end do
      n_bonds = n_bonds + sum(number)
      most_bonds = max(most_bonds, maxval(number))
      most_packs = max(most_packs, int(family%start(c + 1) - family%start(c)))
    end do
    family%n_bonds = n_bonds
    family%most_bonds = most_bonds
    family%most_packs = most_packs
  end subroutine count_bonds

  !> Keep the covered part of each cell: computing it in every step is too expensive.
  subroutine store_fractions(family)
    type(list_family_type), intent(inout) :: family
    real(wp) :: xi(family%dim)
    integer(i8) :: e
    integer :: c, l, k, j

    allocate (family%fraction(lanes, size(family%bits)))
    !$omp parallel do schedule(dynamic, 32) default(none) shared(family) &
    !$omp private(c, l, k, j, e, xi)
    do c = 1, size(family%start) - 1
      do e = family%start(c), family%start(c + 1) - 1
        do l = 1, lanes
          family%fraction(l, e) = 0.0_wp
          if (iand(family%bits(e), lane_bit(l)) == 0_i1) cycle
          k = lanes*(c - 1) + l
          j = other_end(family, e, l)
          xi = family%x(:, j) - family%x(:, k)
          family%fraction(l, e) = volume_correction(rule_of_bond(family%rule, family%spacing(k), &
            & family%spacing(j)), xi, norm2(xi), (family%spacing(k) + family%spacing(j))/2)
        end do
      end do
    end do
  end subroutine store_fractions

  !> The slot at the other end of lane `l`'s bond in pack `e`.
  pure integer function other_end(family, e, l) result(j)
    class(list_family_type), intent(in) :: family
    integer(i8), intent(in) :: e
    integer, intent(in) :: l
    j = family%member(merge(1, 2, iand(family%first(e), lane_bit(l)) /= 0_i1), e)
  end function other_end

  !> All bonds of slot `k` in the order of its cluster's packs, broken ones too.
  pure subroutine bonds_of(family, k, bonds)
    class(list_family_type), intent(in) :: family  !! the family
    integer, intent(in) :: k                       !! slot; a dead one has no bonds
    type(bonds_type), intent(inout) :: bonds
      !! made by `allocate_bonds`; the first `bonds%n` entries are set
    real(wp) :: spacing, delta
    integer(i8) :: e
    integer :: i, n, c, l, d

    c = (k - 1)/lanes + 1
    l = k - lanes*(c - 1)
    n = 0
    do e = family%start(c), family%start(c + 1) - 1
      if (iand(family%bits(e), lane_bit(l)) == 0_i1) cycle
      n = n + 1
      bonds%j(n) = other_end(family, e, l)
      bonds%intact(n) = iand(family%intact(e), lane_bit(l)) /= 0_i1
      bonds%weight(n) = family%volume(bonds%j(n))
      if (size(family%fraction) > 0) bonds%weight(n) = bonds%weight(n)*family%fraction(l, e)
    end do
    bonds%n = n
    bonds%length(:n) = 0.0_wp
    do d = 1, family%dim
      do i = 1, n
        bonds%xi(i, d) = family%x(d, bonds%j(i)) - family%x(d, k)
        bonds%length(i) = bonds%length(i) + bonds%xi(i, d)**2
      end do
    end do
    do i = 1, n
      bonds%length(i) = sqrt(bonds%length(i))
    end do
    if (size(family%fraction) > 0 .or. family%rule%kind == volume_none) return
    if (family%rule%ratio > 0.0_wp) then
      do i = 1, n
        spacing = (family%spacing(k) + family%spacing(bonds%j(i)))/2
        delta = horizon_of_bond(family%rule, family%spacing(k), family%spacing(bonds%j(i)))
        bonds%weight(i) = bonds%weight(i) &
          & *max(0.0_wp, min(1.0_wp, (delta + spacing/2 - bonds%length(i))/spacing))
      end do
      return
    end if
    do i = 1, n
      spacing = (family%spacing(k) + family%spacing(bonds%j(i)))/2
      bonds%weight(i) = bonds%weight(i) &
        & *max(0.0_wp, min(1.0_wp, (family%rule%delta + spacing/2 - bonds%length(i))/spacing))
    end do
  end subroutine bonds_of

  !> How many bonds slot `k` has, broken ones too.
  pure integer function number_at(family, k) result(n)
    class(list_family_type), intent(in) :: family  !! the family
    integer, intent(in) :: k                       !! slot; a dead one has none
    integer :: c

    c = (k - 1)/lanes + 1
    associate (bits => family%bits(family%start(c):family%start(c + 1) - 1))
      n = count(iand(bits, lane_bit(k - lanes*(c - 1))) /= 0_i1)
    end associate
  end function number_at

  !> Break the `i`-th bond of slot `k`; the other direction is another call.
  pure subroutine break_bond(family, k, i)
    class(list_family_type), intent(inout) :: family  !! with this bond broken on return
    integer, intent(in) :: k                          !! slot whose bond is broken
    integer, intent(in) :: i                          !! number of the bond in `bonds_of(k)`, from 1
    integer(i8) :: e
    integer :: c, l, n

    c = (k - 1)/lanes + 1
    l = k - lanes*(c - 1)
    n = 0
    do e = family%start(c), family%start(c + 1) - 1
      if (iand(family%bits(e), lane_bit(l)) == 0_i1) cycle
      n = n + 1
      if (n < i) cycle
      family%intact(e) = iand(family%intact(e), not(lane_bit(l)))
      return
    end do
  end subroutine break_bond

  !> Whether some bond of slot `k` is broken.
  pure logical function may_have_broken(family, k)
    class(list_family_type), intent(in) :: family  !! the family
    integer, intent(in) :: k                       !! slot
    integer(i8) :: e
    integer :: c

    c = (k - 1)/lanes + 1
    may_have_broken = .false.
    do e = family%start(c), family%start(c + 1) - 1
      if (iand(ieor(family%bits(e), family%intact(e)), lane_bit(k - lanes*(c - 1))) == 0_i1) cycle
      may_have_broken = .true.
      return
    end do
  end function may_have_broken

  !> Keep the bits of intact bonds, or put them back.
  subroutine keep_bonds(family, archive)
    class(list_family_type), intent(inout) :: family
      !! its intact bonds are set where the archive reads
    class(archive_type), intent(inout) :: archive     !! a checkpoint that is written or read
    call archive%keep('intact bonds of clusters', family%intact)
  end subroutine keep_bonds

  !> Memory of the packs, slots and fractions [bytes].
  pure integer(i8) function bytes(family)
    class(list_family_type), intent(in) :: family  !! the family
    ! 8 B of members and 3 of bits a pack; position, volume and spacing a slot
    bytes = 11_i8*size(family%bits, kind=i8) + int(family%n_slots, i8)*8*(family%dim + 2) &
      & + 8_i8*size(family%start)
    if (allocated(family%fraction)) bytes = bytes + 8*size(family%fraction, kind=i8)
    if (allocated(family%turn)) bytes = bytes + 4_i8*(size(family%turn) + size(family%copies))
  end function bytes

  !> How many bonds a pack has on average and why it is no lattice, in a line.
  function describe(family) result(text)
    class(list_family_type), intent(in) :: family  !! the family
    character(:), allocatable :: text
    text = 'list: packs of the neighbours of every eight points, each with '//to_text( &
      & real(family%n_bonds, wp)/max(1, size(family%bits)), 2)//' bonds'
    if (allocated(family%reason)) text = text//' ('//family%reason//')'
    if (size(family%fraction) > 0) text = text//', with their volume fractions'
  end function describe

end module pd_family_list
