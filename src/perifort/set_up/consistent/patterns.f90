!> What families look like: slots whose families are known to be alike have one pattern, so that
!> their bonds need not be listed slot by slot. Its bonds are in the order of keys, which are what
!> is rounded of xi.
module pd_set_up_consistent_patterns
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_lookup, only: lookup_type, mix
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  implicit none (type, external)
  private
  public :: patterns_type, find_patterns, find_shapes, place_of, xi_of_key

  type :: patterns_type
    integer :: n_patterns = 0
    integer(i4), allocatable :: of(:)     !! (n_slots) pattern of each slot; 0: dead, or no bonds
    integer(i4), allocatable :: first(:)  !! (patterns) the slot that stands for each
    integer(i8), allocatable :: start(:)  !! (patterns + 1) first bond of each
    integer(i8), allocatable :: key(:)    !! of bonds, increasing within a pattern
    integer(i8), allocatable :: mate(:)   !! of bonds: the key of the same bond at its other end
    integer(i4), allocatable :: ahead(:)  !! of bonds: slot of the member less that of the point
    integer(i4), allocatable :: place(:)  !! of bonds: their numbers in `bonds_of`
    integer(i4), allocatable :: shape(:)  !! (patterns) number; see `find_shapes`
  end type patterns_type

  integer, parameter :: bits = 18           !! of a component of xi in a key
  real(wp), parameter :: parts = 65536.0_wp !! of the horizon that a component is rounded to
  real(wp), parameter :: off = 0.37_wp      !! so that simple parts of it do not round both ways

contains

  !> The patterns of a body's families. An error is set if two points of a family are at one place.
  subroutine find_patterns(body, family, patterns, error)
    type(body_type), intent(in) :: body           !! arranged in the slots of the family
    class(family_type), intent(in) :: family      !! whole
    type(patterns_type), intent(out) :: patterns
    type(error_type), allocatable, intent(out) :: error
    type(bonds_type) :: bonds
    integer(i4), allocatable :: number(:), first(:), members(:)
    integer(i8), allocatable :: key(:), mate(:)
    integer :: k, a, p, twin

    allocate (patterns%of(body%n_slots), number(body%n_slots), source=0_i4)
    allocate (first(body%n_points))
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      a = family%alike(k)
      if (number(a) == 0) then
        patterns%n_patterns = patterns%n_patterns + 1
        number(a) = int(patterns%n_patterns, i4)
        first(patterns%n_patterns) = int(k, i4)
      end if
      patterns%of(k) = number(a)
    end do
    patterns%first = first(:patterns%n_patterns)
    allocate (members(patterns%n_patterns))
    !$omp parallel default(none) shared(family, patterns, members) private(bonds, p)
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 256)
    do p = 1, patterns%n_patterns
      call family%bonds_of(int(patterns%first(p)), bonds)
      members(p) = int(bonds%n, i4)
    end do
    !$omp end parallel
    allocate (patterns%start(patterns%n_patterns + 1))
    patterns%start(1) = 1_i8
    do p = 1, patterns%n_patterns
      patterns%start(p + 1) = patterns%start(p) + members(p)
    end do
    allocate (patterns%key(patterns%start(patterns%n_patterns + 1) - 1))
    allocate (patterns%mate, mold=patterns%key)
    allocate (patterns%ahead(size(patterns%key, kind=i8)))
    allocate (patterns%place, mold=patterns%ahead)
    twin = 0
    !$omp parallel default(none) shared(family, patterns) private(bonds, key, mate, p) &
    !$omp reduction(max:twin)
    call allocate_bonds(family, bonds)
    allocate (key(family%most_bonds), mate(family%most_bonds))
    !$omp do schedule(dynamic, 256)
    do p = 1, patterns%n_patterns
      call family%bonds_of(int(patterns%first(p)), bonds)
      call keys_of(family, bonds, key, mate)
      associate (from => patterns%start(p), to => patterns%start(p + 1) - 1)
        call sort_keys(key(:bonds%n), patterns%place(from:to))
        patterns%key(from:to) = key(patterns%place(from:to))
        patterns%mate(from:to) = mate(patterns%place(from:to))
        patterns%ahead(from:to) = bonds%j(patterns%place(from:to)) - patterns%first(p)
        if (any(patterns%key(from + 1:to) == patterns%key(from:to - 1))) twin = max(twin, p)
      end associate
    end do
    !$omp end parallel
    if (twin > 0) then
      call fail(error, "surface_correction = 'consistent' has no weights for points that lie "// &
        & 'at one place: point '//to_text(int(body%point(patterns%first(twin))))// &
        & ' has two such neighbours', group='horizon', number=1)
      return
    end if
    do k = 1, body%n_slots
      if (patterns%of(k) == 0) cycle
      if (members(patterns%of(k)) == 0) patterns%of(k) = 0_i4
    end do
  end subroutine find_patterns

  !> Number the shapes of patterns: those with the same bonds, material and volumes have one.
  subroutine find_shapes(body, family, patterns)
    type(body_type), intent(in) :: body             !! that the patterns were found for
    class(family_type), intent(in) :: family        !! whole
    type(patterns_type), intent(inout) :: patterns  !! gets shapes
    type(lookup_type) :: shapes
    type(bonds_type) :: bonds, others
    integer(i4), allocatable :: first(:)
    integer(i8) :: key, e
    integer :: p, number
    logical :: is_new

    allocate (patterns%shape(patterns%n_patterns), first(patterns%n_patterns))
    call allocate_bonds(family, bonds)
    call allocate_bonds(family, others)
    do p = 1, patterns%n_patterns
      key = int(body%material(patterns%first(p)), i8)
      do e = patterns%start(p), patterns%start(p + 1) - 1
        key = mix(key, patterns%key(e))
      end do
      call shapes%number_of(key, number, is_new)
      if (.not. is_new) then
        if (.not. same(p, int(first(number)))) then
          call shapes%own_number(number)
          is_new = .true.
        end if
      end if
      if (is_new) first(number) = int(p, i4)
      patterns%shape(p) = int(number, i4)
    end do

  contains

    !> Whether two patterns have the same keys, material and volumes.
    logical function same(p, other)
      integer, intent(in) :: p, other
      real(wp), parameter :: near = 1.0e-9_wp
      integer(i8) :: ahead, n

      associate (k => int(patterns%first(p)), o => int(patterns%first(other)), &
        & start => patterns%start)
        n = start(p + 1) - start(p)
        same = n == start(other + 1) - start(other) .and. body%material(k) == body%material(o) &
          & .and. abs(body%volume(k) - body%volume(o)) <= near*body%volume(k)
        if (.not. same) return
        call family%bonds_of(k, bonds)
        call family%bonds_of(o, others)
        do ahead = 0, n - 1
          same = patterns%key(start(p) + ahead) == patterns%key(start(other) + ahead) .and. &
            & abs(bonds%weight(patterns%place(start(p) + ahead)) &
            & - others%weight(patterns%place(start(other) + ahead))) <= near*body%volume(k)
          if (.not. same) return
        end do
      end associate
    end function same

  end subroutine find_shapes

  !> The keys of each bond and of the same bond from its other end: xi and -xi, rounded.
  pure subroutine keys_of(family, bonds, key, mate)
    class(family_type), intent(in) :: family
    type(bonds_type), intent(in) :: bonds
    integer(i8), intent(inout) :: key(:), mate(:)
    integer :: i

    do i = 1, bonds%n
      key(i) = bond_key(bonds%xi(i, :)*(parts/family%rule%delta))
      mate(i) = bond_key(-bonds%xi(i, :)*(parts/family%rule%delta))
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

  !> What a key has been rounded of.
  pure function xi_of_key(key, dim, delta) result(xi)
    integer(i8), intent(in) :: key
    integer, intent(in) :: dim      !! number of dimensions
    real(wp), intent(in) :: delta   !! horizon [m]
    real(wp) :: xi(dim)             !! the bond, to 1e-5 horizons [m]
    integer :: d

    do d = 1, dim
      xi(d) = (ibits(key, (dim - d)*bits, bits) - 2**(bits - 1) - off)*(delta/parts)
    end do
  end function xi_of_key

  !> The order of increasing keys.
  pure subroutine sort_keys(key, order)
    integer(i8), intent(in) :: key(:)
    integer(i4), intent(out) :: order(:)
    integer(i4) :: moved
    integer :: i, o

    do i = 1, size(key)
      order(i) = int(i, i4)
      do o = i, 2, -1
        if (key(order(o - 1)) <= key(order(o))) exit
        moved = order(o)
        order(o) = order(o - 1)
        order(o - 1) = moved
      end do
    end do
  end subroutine sort_keys

  !> The number in `bonds_of` of the bond with this key in a pattern; 0 if there is none.
  pure integer function place_of(patterns, p, key) result(place)
    type(patterns_type), intent(in) :: patterns
    integer, intent(in) :: p          !! pattern
    integer(i8), intent(in) :: key    !! of the bond
    integer(i8) :: low, high, middle

    place = 0
    low = patterns%start(p)
    high = patterns%start(p + 1) - 1
    if (high < low) return
    do while (low < high)
      middle = (low + high)/2
      if (patterns%key(middle) < key) then
        low = middle + 1
      else
        high = middle
      end if
    end do
    if (patterns%key(low) == key) place = int(patterns%place(low))
  end function place_of

end module pd_set_up_consistent_patterns
