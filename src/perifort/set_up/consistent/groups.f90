!> Which bonds have the same weight (doc/theory.md, 4): points whose families look alike are of one
!> class, and bonds that stand at the same place in families of one class, from either end, are one
!> group. So a long face has few unknown weights, and its points share tables.
module pd_set_up_consistent_groups
  use pd_base_error, only: error_type, internal_fault
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_lookup, only: lookup_type, mix
  use pd_body_body, only: body_type
  use pd_family_bond_weights, only: bond_weights_type
  use pd_family_family, only: family_type
  use pd_set_up_consistent_patterns, only: find_patterns, find_shapes, patterns_type, place_of
  use pd_set_up_consistent_symmetries, only: symmetries_type, mirrored_key
  implicit none (type, external)
  private
  public :: groups_type, find_groups, bonds_of_class, changeable_axes, spread_weights

  type :: groups_type
    integer :: n_groups = 0                 !! unknown weights of each kind
    integer :: n_classes = 0
    integer(i4), allocatable :: class(:)    !! (n_slots) of each slot, 0: dead or without bonds
    integer(i4), allocatable :: first(:)    !! (classes) the slot that stands for each class
    integer(i8), allocatable :: start(:)    !! (classes + 1) first bond of each class's slot
    integer(i4), allocatable :: group(:)    !! of its bonds, in the order of `bonds_of`
    integer(i4), allocatable :: members(:)  !! (groups) how many there would be without symmetries
    integer(i4), allocatable :: mirrored(:) !! (classes) the same of classes
    type(patterns_type) :: patterns         !! of all families
    type(symmetries_type), allocatable :: symmetries  !! that the classes are of
    logical :: placed = .false.             !! neighbours of a class's first slot are those of the
                                            !! first slots of its neighbours, so that multipliers
                                            !! are smooth fields
    real(wp), allocatable :: known_b(:)     !! of bonds: Gb of those without a group; of others what
                                            !! they change from. Not allocated: all have groups [-]
    real(wp), allocatable :: known_d(:)     !! the same of Gd [-]
  end type groups_type

contains

  !> Classes and groups of a body's bonds. `area` tells points apart that look alike and have other
  !> surface areas. Points are alike if what is within `reach` horizons, from bond to bond, looks
  !> alike. An error is set if two points of a family are at one place.
  subroutine find_groups(body, family, area, reach, groups, error, inside, symmetries)
    type(body_type), intent(in) :: body       !! arranged in the slots of the family
    class(family_type), intent(in) :: family  !! whole
    real(wp), intent(in) :: area(:, :)        !! (n_slots, any) surface areas, or what they do [any]
    integer, intent(in) :: reach
      !! horizons; 0: every point is a class and every bond a group of its own
    type(groups_type), intent(out) :: groups
    type(error_type), allocatable, intent(out) :: error
    logical, intent(in), optional :: inside(:)
      !! (n_slots) points that have classes, with a reach of 0; bonds to others have group 0.
      !! Absent: all have
    type(symmetries_type), intent(in), optional :: symmetries
      !! of points that have classes; bonds to others have group 0. With a reach of 0 neighbours
      !! of a class's first slot have classes whose first slots are near it
    type(patterns_type) :: patterns
    integer(i4), allocatable :: label(:)
    integer :: round

    call find_patterns(body, family, patterns, error)
    if (allocated(error)) return
    groups%placed = reach == 0
    if (present(symmetries)) then
      groups%symmetries = symmetries
      groups%n_classes = symmetries%n_classes
      groups%class = symmetries%class
      groups%first = symmetries%first
    else if (reach == 0) then
      label = merge(1_i4, 0_i4, patterns%of > 0)
      if (present(inside)) label = merge(label, 0_i4, inside)
      call part_all(label > 0, groups)
    else
      call find_shapes(body, family, patterns)
      label = int(body%material, i4)
      do round = 1, reach
        call find_classes(body, patterns, area, label, groups)
        if (round < reach) label = groups%class
      end do
    end if
    groups%patterns = patterns
    call count_bonds(patterns, groups)
    call join_bonds(body, patterns, groups)
  end subroutine find_groups

  !> The bond of its class that stands for a bond of a slot, or for the same bond at its other end.
  integer(i8) function bond_of(groups, k, key) result(e)
    type(groups_type), intent(in) :: groups
    integer, intent(in) :: k          ! slot with a class
    integer(i8), intent(in) :: key    ! of the bond, seen from k
    integer(i8) :: mirrored
    integer :: place

    mirrored = key
    if (allocated(groups%symmetries)) mirrored = mirrored_key(groups%symmetries, &
      & int(groups%symmetries%way(k)), key)
    associate (c => groups%class(k))
      place = place_of(groups%patterns, int(groups%patterns%of(groups%first(c))), mirrored)
      if (place == 0) call internal_fault('a bond that its class does not have')
      e = groups%start(c) - 1 + place
    end associate
  end function bond_of

  !> The bonds of its class that stand for those of a slot, in the order of `bonds_of`.
  function bonds_of_class(groups, k) result(numbers)
    type(groups_type), intent(in) :: groups
    integer, intent(in) :: k                  !! slot with a class
    integer(i8), allocatable :: numbers(:)
    integer(i8) :: i

    associate (of => groups%patterns, p => groups%patterns%of(k))
      allocate (numbers(of%start(p + 1) - of%start(p)))
      do i = of%start(p), of%start(p + 1) - 1
        numbers(of%place(i)) = bond_of(groups, k, of%key(i))
      end do
    end associate
  end function bonds_of_class

  !> The axes along which the surface area of a class may change: all, or those that no symmetry of
  !> what is around its first slot mirrors.
  pure function changeable_axes(groups, c, dim) result(axes)
    type(groups_type), intent(in) :: groups
    integer, intent(in) :: c     !! class
    integer, intent(in) :: dim   !! dimension
    integer, allocatable :: axes(:)
    integer :: d

    axes = [(d, d=1, dim)]
    if (.not. allocated(groups%symmetries)) return
    associate (symmetries => groups%symmetries)
      axes = pack(axes, [(all(symmetries%sign(d, :) > 0.0_wp .or. &
        & .not. symmetries%keeps(:, c)), d=1, dim)])
    end associate
  end function changeable_axes

  !> Give slots with classes the weights of their bonds' groups, and what is known of others. Slots
  !> of one class share a row where their bonds stand in one order, mirrored in the same way.
  subroutine spread_weights(groups, Gb, Gd, weights)
    type(groups_type), intent(in) :: groups
    real(wp), intent(in) :: Gb(:), Gd(:)               !! (groups) weights [-]
    type(bond_weights_type), intent(inout) :: weights  !! rows of other slots, if any, are kept
    real(wp), allocatable :: of_bond_b(:), of_bond_d(:), kept_b(:), kept_d(:)
    integer(i8), allocatable :: numbers(:), kept(:)
    integer(i4), allocatable :: maker(:, :)  ! slots that the rows of a class are made for
    integer(i8) :: e, n
    integer :: k, c, w, rows, ways, pass

    allocate (of_bond_b(size(groups%group)), of_bond_d(size(groups%group)))
    do e = 1, size(groups%group, kind=i8)
      associate (g => groups%group(e))
        if (g > 0) then
          of_bond_b(e) = Gb(g)
          of_bond_d(e) = Gd(g)
        else
          of_bond_b(e) = groups%known_b(e)
          of_bond_d(e) = groups%known_d(e)
        end if
      end associate
    end do
    allocate (kept(0), kept_b(0), kept_d(0))
    if (allocated(weights%row)) then
      call move_alloc(weights%start, kept)
      call move_alloc(weights%Gb, kept_b)
      call move_alloc(weights%Gd, kept_d)
    else
      allocate (weights%row(size(groups%class)), source=0_i4)
    end if
    ways = 1
    if (allocated(groups%symmetries)) ways = size(groups%symmetries%sign, 2)
    do pass = 1, 2
      allocate (maker(ways, groups%n_classes), source=0_i4)
      rows = size(kept)
      n = size(kept_b, kind=i8)
      do k = 1, size(weights%row)
        c = int(groups%class(k))
        if (c == 0) cycle
        w = 1
        if (allocated(groups%symmetries)) w = int(groups%symmetries%way(k))
        associate (first => maker(w, c))
          if (first > 0) then
            if (same_order(groups%patterns, k, int(first))) then
              weights%row(k) = weights%row(first)
              cycle
            end if
          else
            first = int(k, i4)
          end if
        end associate
        rows = rows + 1
        weights%row(k) = int(rows, i4)
        if (pass == 2) then
          numbers = bonds_of_class(groups, k)
          weights%start(rows) = n
          weights%Gb(n + 1:n + size(numbers)) = of_bond_b(numbers)
          weights%Gd(n + 1:n + size(numbers)) = of_bond_d(numbers)
        end if
        n = n + groups%start(c + 1) - groups%start(c)
      end do
      if (pass == 2) exit
      deallocate (maker)
      allocate (weights%start(rows), weights%Gb(n), weights%Gd(n))
      weights%start(:size(kept)) = kept
      weights%Gb(:size(kept_b)) = kept_b
      weights%Gd(:size(kept_d)) = kept_d
    end do
  end subroutine spread_weights

  !> Whether the bonds of two slots of one class stand in one order.
  pure logical function same_order(patterns, k, other)
    type(patterns_type), intent(in) :: patterns
    integer, intent(in) :: k, other

    associate (place => patterns%place, start => patterns%start, p => patterns%of(k), &
      & q => patterns%of(other))
      same_order = p == q
      if (same_order) return
      same_order = all(place(start(p):start(p + 1) - 1) == place(start(q):start(q + 1) - 1))
    end associate
  end function same_order

  !> A class for each of some slots.
  subroutine part_all(has_class, groups)
    logical, intent(in) :: has_class(:)  ! (n_slots)
    type(groups_type), intent(inout) :: groups
    integer :: k

    allocate (groups%class(size(has_class)), source=0_i4)
    allocate (groups%first(count(has_class)))
    do k = 1, size(has_class)
      if (.not. has_class(k)) cycle
      groups%n_classes = groups%n_classes + 1
      groups%class(k) = int(groups%n_classes, i4)
      groups%first(groups%n_classes) = int(k, i4)
    end do
  end subroutine part_all

  !> Classes of slots, by keys of their shapes, labels and areas; then these are compared.
  subroutine find_classes(body, patterns, area, label, groups)
    type(body_type), intent(in) :: body
    type(patterns_type), intent(in) :: patterns
    real(wp), intent(in) :: area(:, :)
    integer(i4), intent(in) :: label(:)  ! what is known of each slot: the material, or a class
    type(groups_type), intent(inout) :: groups  ! gets classes
    real(wp), parameter :: near = 1.0e-9_wp      ! of areas that are the same, or 0
    type(lookup_type) :: classes
    integer(i8), allocatable :: key(:)
    integer(i4), allocatable :: first(:)
    integer(i1), allocatable :: even(:)     ! 1: all members have the slot's own label
    logical, allocatable :: differs(:)
    real(wp) :: scale, small
    integer(i8) :: of_members, i
    integer :: k, f, d, p, q, number, c
    logical :: is_new

    allocate (key(body%n_slots), source=0_i8)
    allocate (even(body%n_slots), source=0_i1)
    scale = maxval(abs(area))
    if (.not. scale > 0.0_wp) scale = 1.0_wp
    small = near*scale
    !$omp parallel do schedule(dynamic, 4096) default(none) private(k, p, i, d, of_members) &
    !$omp shared(body, patterns, area, label, key, even, scale, small)
    do k = 1, body%n_slots
      p = int(patterns%of(k))
      if (p == 0) cycle
      key(k) = mix(int(patterns%shape(p), i8), int(label(k), i8))
      even(k) = 1_i1
      do i = patterns%start(p), patterns%start(p + 1) - 1
        if (label(k + patterns%ahead(i)) /= label(k)) even(k) = 0_i1
      end do
      if (even(k) == 0_i1) then
        of_members = 1_i8
        do i = patterns%start(p), patterns%start(p + 1) - 1
          of_members = mix(of_members, int(label(k + patterns%ahead(i)), i8))
        end do
        key(k) = mix(key(k), of_members)
      end if
      do d = 1, size(area, 2)
        if (abs(area(k, d)) > small) key(k) = mix(mix(key(k), int(d, i8)), &
          & nint(area(k, d)/scale*1048576.0_wp + 0.37_wp, i8))
      end do
      if (key(k) == 0_i8) key(k) = 1_i8
    end do
    if (allocated(groups%class)) deallocate (groups%class)
    allocate (groups%class(body%n_slots), source=0_i4)
    allocate (first(body%n_points))
    do k = 1, body%n_slots
      if (key(k) == 0_i8) cycle
      call classes%number_of(key(k), number, is_new)
      groups%class(k) = int(number, i4)
      if (is_new) first(number) = int(k, i4)
    end do
    ! a slot that differs from its class after all is one of its own
    allocate (differs(body%n_slots), source=.false.)
    !$omp parallel do schedule(dynamic, 4096) default(none) private(k, f, d, p, q, i) &
    !$omp shared(body, patterns, area, label, even, small, groups, first, differs)
    do k = 1, body%n_slots
      if (groups%class(k) == 0) cycle
      f = int(first(groups%class(k)))
      p = int(patterns%of(k))
      q = int(patterns%of(f))
      differs(k) = patterns%shape(p) /= patterns%shape(q) .or. label(k) /= label(f) .or. &
        & even(k) /= even(f)
      do d = 1, size(area, 2)
        if (abs(area(k, d) - area(f, d)) > small) differs(k) = .true.
      end do
      if (differs(k) .or. even(k) == 1_i1) cycle
      do i = 0, patterns%start(p + 1) - patterns%start(p) - 1
        if (label(k + patterns%ahead(patterns%start(p) + i)) &
          & /= label(f + patterns%ahead(patterns%start(q) + i))) differs(k) = .true.
      end do
    end do
    do k = 1, body%n_slots
      if (.not. differs(k)) cycle
      call classes%own_number(c)
      groups%class(k) = int(c, i4)
      first(c) = int(k, i4)
    end do
    groups%n_classes = classes%count
    groups%first = first(:classes%count)
  end subroutine find_classes

  !> Where the bonds of each class start.
  subroutine count_bonds(patterns, groups)
    type(patterns_type), intent(in) :: patterns
    type(groups_type), intent(inout) :: groups
    integer :: c, p

    allocate (groups%start(groups%n_classes + 1))
    groups%start(1) = 1_i8
    do c = 1, groups%n_classes
      p = int(patterns%of(groups%first(c)))
      groups%start(c + 1) = groups%start(c) + patterns%start(p + 1) - patterns%start(p)
    end do
  end subroutine count_bonds

  !> Join the bonds that are one, seen from both ends or by symmetry, and number what hangs
  !> together.
  subroutine join_bonds(body, patterns, groups)
    type(body_type), intent(in) :: body
    type(patterns_type), intent(in) :: patterns
    type(groups_type), intent(inout) :: groups
    integer(i8), allocatable :: parent(:)
    integer(i8) :: one, other, e, i
    integer :: k, j, c, d, p, w
    logical, allocatable :: same(:), inside(:), outside(:)
    integer(i8), allocatable :: parent_in_all(:), start_in_all(:)
    integer, allocatable :: way(:), first(:), number_in_all(:, :)
    type(lookup_type) :: met
    logical :: is_new, shared
    integer :: number

    allocate (way(body%n_slots), source=1)
    if (allocated(groups%symmetries)) way = groups%symmetries%way
    shared = 2*groups%n_classes < count(groups%class > 0)
    allocate (first(merge(body%n_slots, 0, shared)))
    parent = [(e, e=1_i8, groups%start(groups%n_classes + 1) - 1)]
    call count_mirrored(body, way, groups, number_in_all, start_in_all)
    parent_in_all = [(e, e=1_i8, merge(start_in_all(size(start_in_all)) - 1, 0_i8, &
      & allocated(groups%symmetries)))]
    allocate (inside(groups%n_classes), same(body%n_slots), source=.false.)
    !$omp parallel do schedule(dynamic, 4096) default(none) private(k, j, p, i) &
    !$omp shared(body, patterns, groups, same, way)
    do k = 1, body%n_slots
      p = int(patterns%of(k))
      if (p == 0) cycle
      same(k) = .true.
      do i = patterns%start(p), patterns%start(p + 1) - 1
        j = k + int(patterns%ahead(i))
        if (groups%class(j) /= groups%class(k) .or. way(j) /= way(k)) same(k) = .false.
      end do
    end do
    allocate (outside(size(parent)), source=.false.)
    do k = 1, body%n_slots
      c = int(groups%class(k))
      if (c == 0) cycle
      ! points deep inside say the same, and so do those with the same around them
      if (same(k)) then
        if (inside(c)) cycle
        inside(c) = .true.
      end if
      p = int(patterns%of(k))
      if (shared) then
        call met%number_of(key_of(k), number, is_new)
        if (is_new) then
          first(number) = k
        else
          if (say_the_same(k, first(number))) cycle
        end if
      end if
      do i = patterns%start(p), patterns%start(p + 1) - 1
        j = k + int(patterns%ahead(i))
        d = int(groups%class(j))
        if (d == 0) outside(bond_of(groups, k, patterns%key(i))) = .true.
        if (d == 0 .or. (j < k .and. d /= c)) cycle
        one = bond_of(groups, k, patterns%key(i))
        other = bond_of(groups, j, patterns%mate(i))
        call join(one, other, parent)
        if (allocated(groups%symmetries)) call join(in_all(k, one), in_all(j, other), &
          & parent_in_all)
      end do
    end do
    if (allocated(groups%symmetries)) then
      associate (symmetries => groups%symmetries)
        do c = 1, groups%n_classes
          k = int(groups%first(c))
          p = int(patterns%of(k))
          do w = 2, size(symmetries%keeps, 1)
            if (.not. symmetries%keeps(w, c)) cycle
            do i = patterns%start(p), patterns%start(p + 1) - 1
              call join(bond_of(groups, k, patterns%key(i)), bond_of(groups, k, &
                & mirrored_key(symmetries, w, patterns%key(i))), parent)
            end do
          end do
        end do
      end associate
    end if
    ! what is known of one bond is of all that are joined with it
    do e = 1, size(parent, kind=i8)
      if (outside(e)) outside(root(parent, e)) = .true.
    end do
    allocate (groups%group(size(parent)), source=0_i4)
    groups%n_groups = 0
    do e = 1, size(parent, kind=i8)
      one = root(parent, e)
      if (outside(one)) cycle
      if (one == e) then
        groups%n_groups = groups%n_groups + 1
        groups%group(e) = int(groups%n_groups, i4)
      else
        groups%group(e) = groups%group(one)
      end if
    end do
    if (.not. allocated(groups%symmetries)) then
      groups%members = spread(1_i4, 1, groups%n_groups)
      return
    end if
    groups%members = spread(0_i4, 1, groups%n_groups)
    do c = 1, groups%n_classes
      do w = 1, size(number_in_all, 1)
        if (number_in_all(w, c) == 0) cycle
        do e = groups%start(c), groups%start(c + 1) - 1
          if (groups%group(e) == 0) cycle
          i = e - groups%start(c) + start_in_all(number_in_all(w, c))
          if (root(parent_in_all, i) == i) groups%members(groups%group(e)) &
            & = groups%members(groups%group(e)) + 1_i4
        end do
      end do
    end do

  contains

    !> A key of the bonds of a slot, and of the classes and ways of its neighbours.
    integer(i8) function key_of(k) result(key)
      integer, intent(in) :: k
      integer(i8) :: b

      key = mix(int(groups%class(k), i8), int(way(k), i8))
      do b = patterns%start(patterns%of(k)), patterns%start(patterns%of(k) + 1) - 1
        j = k + int(patterns%ahead(b))
        key = mix(mix(key, patterns%key(b)), &
          & ior(ishft(int(groups%class(j), i8), 8), int(way(j), i8)))
      end do
    end function key_of

    !> Whether these are the same for two slots.
    logical function say_the_same(k, other)
      integer, intent(in) :: k, other
      integer(i8) :: b, from, its_from

      from = patterns%start(patterns%of(k))
      its_from = patterns%start(patterns%of(other))
      associate (n => patterns%start(patterns%of(k) + 1) - from)
        say_the_same = n == patterns%start(patterns%of(other) + 1) - its_from .and. &
          & groups%class(k) == groups%class(other) .and. way(k) == way(other)
        if (.not. say_the_same) return
        do b = 0, n - 1
          j = k + int(patterns%ahead(from + b))
          associate (its => other + patterns%ahead(its_from + b))
            say_the_same = patterns%key(from + b) == patterns%key(its_from + b) .and. &
              & groups%class(j) == groups%class(its) .and. way(j) == way(its)
          end associate
          if (.not. say_the_same) return
        end do
      end associate
    end function say_the_same

    !> The number of a bond of the class of slot k, were there no symmetries.
    integer(i8) function in_all(k, bond)
      integer, intent(in) :: k
      integer(i8), intent(in) :: bond
      associate (c => groups%class(k))
        in_all = bond - groups%start(c) + start_in_all(number_in_all(way(k), c))
      end associate
    end function in_all

  end subroutine join_bonds

  !> Number the classes that there would be without symmetries, and count those of each class.
  subroutine count_mirrored(body, way, groups, number, start)
    type(body_type), intent(in) :: body
    integer, intent(in) :: way(:)                           ! (n_slots)
    type(groups_type), intent(inout) :: groups
    integer, allocatable, intent(out) :: number(:, :)       ! (ways, classes) 0: none
    integer(i8), allocatable, intent(out) :: start(:)       ! first bond of each, then one more
    integer :: k, n, c

    allocate (number(2**body%dim, groups%n_classes), source=0)
    allocate (start(size(number) + 1))
    start(1) = 1_i8
    n = 0
    do k = 1, body%n_slots
      c = int(groups%class(k))
      if (c == 0) cycle
      if (number(way(k), c) > 0) cycle
      n = n + 1
      number(way(k), c) = n
      start(n + 1) = start(n) + groups%start(c + 1) - groups%start(c)
    end do
    start = start(:n + 1)
    groups%mirrored = int(count(number > 0, dim=1), i4)
  end subroutine count_mirrored

  !> Let two bonds be of one group.
  subroutine join(bond, same_bond, parent)
    integer(i8), intent(in) :: bond, same_bond
    integer(i8), intent(inout) :: parent(:)
    integer(i8) :: one, other

    one = root(parent, bond)
    other = root(parent, same_bond)
    parent(max(one, other)) = min(one, other)
  end subroutine join

  !> The first bond of the group so far, with the way there shortened.
  integer(i8) function root(parent, e)
    integer(i8), intent(inout) :: parent(:)
    integer(i8), intent(in) :: e

    root = e
    do while (parent(root) /= root)
      parent(root) = parent(parent(root))
      root = parent(root)
    end do
  end function root

end module pd_set_up_consistent_groups
