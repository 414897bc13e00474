!> Which bonds have the same weight (doc/theory.md, 4): points whose families look alike are of one
!> class, and bonds that stand at the same place in families of one class, from either end, are one
!> group. So a long face has few unknown weights, and its points share tables.
module pd_set_up_consistent_groups
  use pd_base_error, only: error_type, fail, internal_fault
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_lookup, only: lookup_type, mix
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type
  use pd_family_bond_weights, only: bond_weights_type
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  implicit none (type, external)
  private
  public :: groups_type, find_groups, spread_weights

  type :: groups_type
    integer :: n_groups = 0                 !! unknown weights of each kind
    integer :: n_classes = 0
    integer(i4), allocatable :: class(:)    !! (n_slots) of each slot, 0: dead or without bonds
    integer(i4), allocatable :: first(:)    !! (classes) the slot that stands for each class
    integer(i8), allocatable :: start(:)    !! (classes + 1) first bond of each class's slot
    integer(i8), allocatable :: key(:)      !! of its bonds, in the order of `bonds_of`
    integer(i4), allocatable :: sorted(:)   !! numbers of its bonds by increasing key
    integer(i4), allocatable :: group(:)    !! of its bonds
  end type groups_type

  integer, parameter :: bits = 18           !! of a component of xi in a key
  real(wp), parameter :: parts = 65536.0_wp !! of the horizon that a component is rounded to
  real(wp), parameter :: off = 0.37_wp      !! so that simple parts of it do not round both ways

contains

  !> Classes and groups of a body's bonds. `area` tells points apart that look alike and have other
  !> surface areas. Points are alike if what is within `reach` horizons, from bond to bond, looks
  !> alike. An error is set if two points of a family are at one place.
  subroutine find_groups(body, family, area, reach, groups, error)
    type(body_type), intent(in) :: body       !! arranged in the slots of the family
    class(family_type), intent(in) :: family  !! whole
    real(wp), intent(in) :: area(:, :)        !! (n_slots, any) surface areas, or what they do [any]
    integer, intent(in) :: reach
      !! horizons; 0: every point is a class and every bond a group of its own
    type(groups_type), intent(out) :: groups
    type(error_type), allocatable, intent(out) :: error

    integer(i4), allocatable :: label(:)
    integer :: round

    label = int(body%material, i4)
    do round = 1, max(1, reach)
      call find_classes(body, family, area, label, reach == 0, groups)
      if (round < reach) label = groups%class
    end do
    call list_keys(family, groups)
    call sort_keys(body, groups, error)
    if (allocated(error)) return
    call join_bonds(body, family, groups)
  end subroutine find_groups

  !> Give every slot the weights of its bonds' groups.
  subroutine spread_weights(body, family, groups, Gb, Gd, weights)
    type(body_type), intent(in) :: body         !! that the groups were found for
    class(family_type), intent(in) :: family    !! whole
    type(groups_type), intent(in) :: groups     !! of this family
    real(wp), intent(in) :: Gb(:), Gd(:)        !! (groups) weights [-]
    type(bond_weights_type), intent(out) :: weights
    type(bonds_type) :: bonds
    integer(i8), allocatable :: key(:)
    integer(i8) :: n, first
    integer :: k, i, c, row, pass

    allocate (weights%row(body%n_slots), source=0_i4)
    allocate (key(family%most_bonds))
    call allocate_bonds(family, bonds)
    do pass = 1, 2
      row = groups%n_classes
      n = groups%start(groups%n_classes + 1) - 1
      do k = 1, body%n_slots
        c = int(groups%class(k))
        if (c == 0) cycle
        if (pass == 2 .and. weights%row(k) == c) cycle
        call family%bonds_of(k, bonds)
        call keys_of(family, bonds, key)
        first = groups%start(c)
        if (all(key(:bonds%n) == groups%key(first:first + bonds%n - 1))) then
          weights%row(k) = int(c, i4)
          cycle
        end if
        row = row + 1
        if (pass == 2) then
          weights%row(k) = int(row, i4)
          weights%start(row) = n
          do i = 1, bonds%n
            associate (g => groups%group(first - 1 + place_of(groups, c, key(i))))
              weights%Gb(n + i) = Gb(g)
              weights%Gd(n + i) = Gd(g)
            end associate
          end do
        end if
        n = n + bonds%n
      end do
      if (pass == 2) exit
      allocate (weights%start(row), weights%Gb(n), weights%Gd(n))
      weights%start(:groups%n_classes) = groups%start(:groups%n_classes) - 1
      n = groups%start(groups%n_classes + 1) - 1
      weights%Gb(:n) = Gb(groups%group)
      weights%Gd(:n) = Gd(groups%group)
    end do
  end subroutine spread_weights

  !> Classes of slots, by keys of what is rounded of their families; then the families are compared.
  subroutine find_classes(body, family, area, label, alone, groups)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    real(wp), intent(in) :: area(:, :)
    integer(i4), intent(in) :: label(:)  ! what is known of each slot: the material, or a class
    logical, intent(in) :: alone
    type(groups_type), intent(inout) :: groups  ! gets classes
    type(lookup_type) :: classes
    type(bonds_type) :: bonds, others
    integer(i8), allocatable :: key(:), of_bonds(:), of_others(:)
    integer(i4), allocatable :: first(:)
    logical, allocatable :: differs(:)
    real(wp) :: scale
    integer :: k, number, c
    logical :: is_new

    allocate (key(body%n_slots), source=0_i8)
    scale = maxval(abs(area))
    if (.not. scale > 0.0_wp) scale = 1.0_wp
    !$omp parallel default(none) shared(body, family, area, label, key, scale) &
    !$omp private(bonds, of_bonds, k)
    call allocate_bonds(family, bonds)
    allocate (of_bonds(family%most_bonds))
    !$omp do schedule(dynamic, 256)
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      call family%bonds_of(k, bonds)
      if (bonds%n == 0) cycle
      call keys_of(family, bonds, of_bonds)
      key(k) = class_key(label, area(k, :)/scale, k, bonds, of_bonds)
    end do
    !$omp end parallel
    if (allocated(groups%class)) deallocate (groups%class)
    allocate (groups%class(body%n_slots), source=0_i4)
    allocate (first(body%n_points))
    do k = 1, body%n_slots
      if (key(k) == 0_i8) cycle
      if (alone) then
        call classes%own_number(number)
        is_new = .true.
      else
        call classes%number_of(key(k), number, is_new)
      end if
      groups%class(k) = int(number, i4)
      if (is_new) first(number) = int(k, i4)
    end do
    ! a slot that differs from its class after all is one of its own
    allocate (differs(body%n_slots), source=.false.)
    !$omp parallel default(none) shared(body, family, area, label, scale, groups, first, differs) &
    !$omp private(bonds, others, of_bonds, of_others, k, c)
    call allocate_bonds(family, bonds)
    call allocate_bonds(family, others)
    allocate (of_bonds(family%most_bonds), of_others(family%most_bonds))
    !$omp do schedule(dynamic, 256)
    do k = 1, body%n_slots
      c = int(groups%class(k))
      if (c == 0) cycle
      if (first(c) == k) cycle
      call family%bonds_of(k, bonds)
      call keys_of(family, bonds, of_bonds)
      call family%bonds_of(int(first(c)), others)
      call keys_of(family, others, of_others)
      differs(k) = any(abs(area(k, :) - area(first(c), :)) > 1.0e-9_wp*scale) .or. &
        & .not. same_family(body, label, k, bonds, of_bonds, int(first(c)), others, of_others)
    end do
    !$omp end parallel
    do k = 1, body%n_slots
      if (.not. differs(k)) cycle
      call classes%own_number(number)
      groups%class(k) = int(number, i4)
      first(number) = int(k, i4)
    end do
    groups%n_classes = classes%count
    groups%first = first(:classes%count)
  end subroutine find_classes

  !> The keys of the bonds of each class's slot.
  subroutine list_keys(family, groups)
    class(family_type), intent(in) :: family
    type(groups_type), intent(inout) :: groups
    type(bonds_type) :: bonds
    integer(i8) :: n
    integer :: c

    allocate (groups%start(groups%n_classes + 1))
    call allocate_bonds(family, bonds)
    n = 1_i8
    do c = 1, groups%n_classes
      call family%bonds_of(int(groups%first(c)), bonds)
      groups%start(c) = n
      n = n + bonds%n
    end do
    groups%start(groups%n_classes + 1) = n
    allocate (groups%key(n - 1))
    do c = 1, groups%n_classes
      call family%bonds_of(int(groups%first(c)), bonds)
      call keys_of(family, bonds, groups%key(groups%start(c):groups%start(c + 1) - 1))
    end do
  end subroutine list_keys

  !> A key for each bond: its xi, rounded.
  pure subroutine keys_of(family, bonds, key)
    class(family_type), intent(in) :: family
    type(bonds_type), intent(in) :: bonds
    integer(i8), intent(inout) :: key(:)
    integer :: i

    do i = 1, bonds%n
      key(i) = bond_key(bonds%xi(i, :)*(parts/family%rule%delta))
    end do
  end subroutine keys_of

  !> The key of a bond whose xi has been scaled.
  pure integer(i8) function bond_key(xi) result(key)
    real(wp), intent(in) :: xi(:)
    integer :: d

    key = 0_i8
    do d = 1, size(xi)
      key = ior(ishft(key, bits), nint(xi(d) + off, i8) + ishft(1_i8, bits - 1))
    end do
  end function bond_key

  !> A key of what the weights of a slot depend on, in any order of its bonds.
  pure integer(i8) function class_key(label, area, k, bonds, of_bonds) result(key)
    integer(i4), intent(in) :: label(:)
    real(wp), intent(in) :: area(:)  ! scaled
    integer, intent(in) :: k
    type(bonds_type), intent(in) :: bonds
    integer(i8), intent(in) :: of_bonds(:)
    integer :: i

    key = bonds%n
    do i = 1, bonds%n
      key = ieor(key, mix(mix(1_i8, of_bonds(i)), int(label(bonds%j(i)), i8)))
    end do
    key = mix(key, int(label(k), i8))
    do i = 1, size(area)
      key = mix(key, nint(area(i)*1048576.0_wp + off, i8))
    end do
    if (key == 0_i8) key = 1_i8
  end function class_key

  !> Whether two slots have the same material and volume and the same bonds, in any order.
  pure logical function same_family(body, label, k, bonds, of_bonds, other, others, of_others) &
    & result(same)
    type(body_type), intent(in) :: body
    integer(i4), intent(in) :: label(:)
    integer, intent(in) :: k, other
    type(bonds_type), intent(in) :: bonds, others
    integer(i8), intent(in) :: of_bonds(:), of_others(:)
    real(wp), parameter :: near = 1.0e-9_wp
    integer :: i, o

    same = bonds%n == others%n .and. label(k) == label(other) .and. &
      & abs(body%volume(k) - body%volume(other)) <= near*body%volume(k)
    if (.not. same) return
    do i = 1, bonds%n
      o = i
      if (of_others(o) /= of_bonds(i)) o = findloc(of_others(:others%n), of_bonds(i), dim=1)
      same = o > 0
      if (.not. same) return
      same = label(bonds%j(i)) == label(others%j(o)) .and. &
        & abs(bonds%weight(i) - others%weight(o)) <= near*body%volume(k)
      if (.not. same) return
    end do
  end function same_family

  !> Sort the keys of each class. An error is set if two are equal.
  subroutine sort_keys(body, groups, error)
    type(body_type), intent(in) :: body
    type(groups_type), intent(inout) :: groups
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: first
    integer(i4) :: moved
    integer :: c, i, o

    allocate (groups%sorted(size(groups%key)))
    do c = 1, groups%n_classes
      first = groups%start(c)
      associate (key => groups%key(first:groups%start(c + 1) - 1), &
        & order => groups%sorted(first:groups%start(c + 1) - 1))
        do i = 1, size(key)
          order(i) = int(i, i4)
          do o = i, 2, -1
            if (key(order(o - 1)) <= key(order(o))) exit
            moved = order(o)
            order(o) = order(o - 1)
            order(o - 1) = moved
          end do
        end do
        do i = 2, size(key)
          if (key(order(i)) > key(order(i - 1))) cycle
          call fail(error, "surface_correction = 'consistent' has no weights for points that "// &
            & 'lie at one place: point '//to_text(int(body%point(groups%first(c))))// &
            & ' has two such neighbours', group='horizon', number=1)
          return
        end do
      end associate
    end do
  end subroutine sort_keys

  !> The number of the bond with this key in the family of class `c`.
  pure integer function place_of(groups, c, key) result(place)
    type(groups_type), intent(in) :: groups
    integer, intent(in) :: c
    integer(i8), intent(in) :: key
    integer(i8) :: first, low, high, middle

    first = groups%start(c) - 1
    low = 1
    high = groups%start(c + 1) - 1 - first
    do while (low < high)
      middle = (low + high)/2
      if (groups%key(first + groups%sorted(first + middle)) < key) then
        low = middle + 1
      else
        high = middle
      end if
    end do
    place = int(groups%sorted(first + low))
    if (groups%key(first + place) /= key) call internal_fault('a bond that its class does not have')
  end function place_of

  !> Join the bonds that are one, seen from both ends, and number what hangs together.
  subroutine join_bonds(body, family, groups)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(groups_type), intent(inout) :: groups
    type(bonds_type) :: bonds
    integer(i8), allocatable :: parent(:), key(:)
    integer(i8) :: one, other, e
    integer :: k, i, c
    logical, allocatable :: inside(:)

    allocate (parent(size(groups%key)), key(family%most_bonds))
    parent = [(e, e=1_i8, size(groups%key, kind=i8))]
    allocate (inside(groups%n_classes), source=.false.)
    call allocate_bonds(family, bonds)
    do k = 1, body%n_slots
      c = int(groups%class(k))
      if (c == 0) cycle
      call family%bonds_of(k, bonds)
      ! points deep inside say the same
      if (all(groups%class(bonds%j(:bonds%n)) == c)) then
        if (inside(c)) cycle
        inside(c) = .true.
      end if
      call keys_of(family, bonds, key)
      do i = 1, bonds%n
        if (bonds%j(i) < k .and. groups%class(bonds%j(i)) /= c) cycle
        one = root(parent, groups%start(c) - 1 + place_of(groups, c, key(i)))
        associate (j => int(groups%class(bonds%j(i))))
          other = root(parent, groups%start(j) - 1 + place_of(groups, j, &
            & bond_key(-bonds%xi(i, :)*(parts/family%rule%delta))))
        end associate
        parent(max(one, other)) = min(one, other)
      end do
    end do
    allocate (groups%group(size(parent)), source=0_i4)
    groups%n_groups = 0
    do e = 1, size(parent, kind=i8)
      one = root(parent, e)
      if (one == e) then
        groups%n_groups = groups%n_groups + 1
        groups%group(e) = int(groups%n_groups, i4)
      else
        groups%group(e) = groups%group(one)
      end if
    end do
  end subroutine join_bonds

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
