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
  implicit none (type, external)
  private
  public :: groups_type, find_groups, spread_weights

  type :: groups_type
    integer :: n_groups = 0                 !! unknown weights of each kind
    integer :: n_classes = 0
    integer(i4), allocatable :: class(:)    !! (n_slots) of each slot, 0: dead or without bonds
    integer(i4), allocatable :: first(:)    !! (classes) the slot that stands for each class
    integer(i8), allocatable :: start(:)    !! (classes + 1) first bond of each class's slot
    integer(i4), allocatable :: group(:)    !! of its bonds, in the order of `bonds_of`
    type(patterns_type) :: patterns         !! of all families
    real(wp), allocatable :: known_b(:)     !! of bonds: Gb of those without a group; of others what
                                            !! they change from. Not allocated: all have groups [-]
    real(wp), allocatable :: known_d(:)     !! the same of Gd [-]
  end type groups_type

contains

  !> Classes and groups of a body's bonds. `area` tells points apart that look alike and have other
  !> surface areas. Points are alike if what is within `reach` horizons, from bond to bond, looks
  !> alike. An error is set if two points of a family are at one place.
  subroutine find_groups(body, family, area, reach, groups, error, inside)
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
    type(patterns_type) :: patterns
    integer(i4), allocatable :: label(:)
    integer :: round

    call find_patterns(body, family, patterns, error)
    if (allocated(error)) return
    if (reach == 0) then
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
    call count_bonds(patterns, groups)
    call join_bonds(body, patterns, groups)
    groups%patterns = patterns
  end subroutine find_groups

  !> Give every slot the weights of its bonds' groups.
  subroutine spread_weights(body, groups, Gb, Gd, weights)
    type(body_type), intent(in) :: body         !! that the groups were found for
    type(groups_type), intent(in) :: groups     !! of its bonds
    real(wp), intent(in) :: Gb(:), Gd(:)        !! (groups) weights [-]
    type(bond_weights_type), intent(out) :: weights
    integer(i8) :: n, i, first, other
    integer :: k, c, p, row, pass

    allocate (weights%row(body%n_slots), source=0_i4)
    associate (of => groups%patterns)
      do pass = 1, 2
        row = groups%n_classes
        n = groups%start(groups%n_classes + 1) - 1
        do k = 1, body%n_slots
          c = int(groups%class(k))
          if (c == 0) cycle
          if (pass == 2 .and. weights%row(k) == c) cycle
          p = int(of%of(k))
          first = of%start(p)
          other = of%start(of%of(groups%first(c)))
          associate (bonds => of%start(p + 1) - first)
            if (first == other .or. all(of%place(first:first + bonds - 1) &
              & == of%place(other:other + bonds - 1))) then
              weights%row(k) = int(c, i4)
              cycle
            end if
            ! the same bonds in another order
            row = row + 1
            if (pass == 2) then
              weights%row(k) = int(row, i4)
              weights%start(row) = n
              do i = 0, bonds - 1
                associate (g => groups%group(groups%start(c) - 1 + of%place(other + i)))
                  weights%Gb(n + of%place(first + i)) = Gb(g)
                  weights%Gd(n + of%place(first + i)) = Gd(g)
                end associate
              end do
            end if
            n = n + bonds
          end associate
        end do
        if (pass == 2) exit
        allocate (weights%start(row), weights%Gb(n), weights%Gd(n))
        weights%start(:groups%n_classes) = groups%start(:groups%n_classes) - 1
        n = groups%start(groups%n_classes + 1) - 1
        weights%Gb(:n) = Gb(groups%group)
        weights%Gd(:n) = Gd(groups%group)
      end do
    end associate
  end subroutine spread_weights

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

  !> Join the bonds that are one, seen from both ends, and number what hangs together.
  subroutine join_bonds(body, patterns, groups)
    type(body_type), intent(in) :: body
    type(patterns_type), intent(in) :: patterns
    type(groups_type), intent(inout) :: groups
    integer(i8), allocatable :: parent(:)
    integer(i8) :: one, other, e, i
    integer :: k, j, c, d, p
    logical, allocatable :: same(:), inside(:), outside(:)

    parent = [(e, e=1_i8, groups%start(groups%n_classes + 1) - 1)]
    allocate (inside(groups%n_classes), same(body%n_slots), source=.false.)
    !$omp parallel do schedule(dynamic, 4096) default(none) private(k, p, i) &
    !$omp shared(body, patterns, groups, same)
    do k = 1, body%n_slots
      p = int(patterns%of(k))
      if (p == 0) cycle
      same(k) = .true.
      do i = patterns%start(p), patterns%start(p + 1) - 1
        if (groups%class(k + patterns%ahead(i)) /= groups%class(k)) same(k) = .false.
      end do
    end do
    allocate (outside(size(parent)), source=.false.)
    do k = 1, body%n_slots
      c = int(groups%class(k))
      if (c == 0) cycle
      ! points deep inside say the same
      if (same(k)) then
        if (inside(c)) cycle
        inside(c) = .true.
      end if
      p = int(patterns%of(k))
      do i = patterns%start(p), patterns%start(p + 1) - 1
        j = k + int(patterns%ahead(i))
        d = int(groups%class(j))
        if (d == 0) outside(bond_of(c, patterns%key(i))) = .true.
        if (d == 0 .or. (j < k .and. d /= c)) cycle
        one = root(parent, bond_of(c, patterns%key(i)))
        other = root(parent, bond_of(d, patterns%mate(i)))
        parent(max(one, other)) = min(one, other)
      end do
    end do
    allocate (groups%group(size(parent)), source=0_i4)
    groups%n_groups = 0
    do e = 1, size(parent, kind=i8)
      if (outside(e)) cycle
      one = root(parent, e)
      if (one == e) then
        groups%n_groups = groups%n_groups + 1
        groups%group(e) = int(groups%n_groups, i4)
      else
        groups%group(e) = groups%group(one)
      end if
    end do

  contains

    !> The bond with this key of a class.
    integer(i8) function bond_of(c, key)
      integer, intent(in) :: c
      integer(i8), intent(in) :: key
      integer :: place

      place = place_of(patterns, int(patterns%of(groups%first(c))), key)
      if (place == 0) call internal_fault('a bond that its class does not have')
      bond_of = groups%start(c) - 1 + place
    end function bond_of

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
