!> Slots of a lattice whose surroundings look the same: what follows from a family alone is computed
!> once for each class of them.
module pd_family_classes
  use pd_base_kinds, only: i1, i2, i4, i8
  use pd_base_lanes, only: word_bits
  use pd_base_lookup, only: lookup_type, mix
  use pd_family_offsets, only: offsets_type
  implicit none (type, external)
  private
  public :: find_classes

  integer, parameter :: chunk = 65536  !! slots that are compared before they are numbered

contains

  !> Number the kinds of surroundings: slots of the same grid and material with the same members are
  !> of one class. A key finds the class, the members themselves decide.
  subroutine find_classes(grids, alive, material, apart, words, key_bits, class_of, first_of, &
    & n_bonds)
    type(offsets_type), intent(in) :: grids(:)  !! (any number) with shifts set
    integer(i1), intent(in) :: alive(:)     !! 1 where a slot holds a point
    integer(i2), intent(in) :: material(:)  !! of each slot
    logical, intent(in) :: apart(:)         !! slots in other classes than all that are not apart
    integer, intent(in) :: words            !! of 64-bit words that hold a bit for each offset
    integer(i8), intent(in) :: key_bits     !! bits of keys that count
    integer(i4), allocatable, intent(out) :: class_of(:)  !! of each slot, 0: dead
    integer(i4), allocatable, intent(out) :: first_of(:)  !! the first slot of each class
    integer(i8), intent(out) :: n_bonds     !! directed ones
    type(lookup_type) :: classes
    ! grid, material and whether it is apart, bits of the members; 0: dead
    integer(i8), allocatable :: kind(:, :)
    integer(i8), allocatable :: kind_of(:, :)  ! the same of each class
    integer(i8) :: first, last
    integer :: g

    allocate (kind(0:words, chunk), kind_of(0:words, 1024), source=0_i8)
    allocate (class_of(size(alive)), first_of(1024), source=0_i4)
    n_bonds = 0_i8
    do g = 1, size(grids)
      do first = grids(g)%first, grids(g)%last, chunk
        last = min(first + chunk - 1, grids(g)%last)
        call find_kinds(grids(g), g, alive, material, apart, words, first, last, kind, n_bonds)
        call number_kinds(first, last, kind, key_bits, classes, kind_of, class_of, first_of)
      end do
    end do
    first_of = first_of(:classes%count)
  end subroutine find_classes

  !> What the slots from `first` to `last` of grid number `g` are; adds their bonds to `n_bonds`.
  subroutine find_kinds(grid, g, alive, material, apart, words, first, last, kind, n_bonds)
    type(offsets_type), intent(in) :: grid
    integer, intent(in) :: g, words
    integer(i1), intent(in) :: alive(:)
    integer(i2), intent(in) :: material(:)
    logical, intent(in) :: apart(:)
    integer(i8), intent(in) :: first, last
    integer(i8), intent(inout) :: kind(0:, :)
    integer(i8), intent(inout) :: n_bonds
    integer(i8) :: count, bits, k
    integer :: o, w

    count = 0_i8
    !$omp parallel do schedule(static) default(none) reduction(+:count) private(k, w, o, bits) &
    !$omp shared(grid, g, alive, material, apart, words, first, last, kind)
    do k = first, last
      kind(0, k - first + 1) = 0_i8
      if (alive(k) == 0_i1) cycle
      kind(0, k - first + 1) = ior(ishft(int(g, i8), 32), int(material(k), i8))
      if (apart(k)) kind(0, k - first + 1) = ibset(kind(0, k - first + 1), 62)
      do w = 0, words - 1
        bits = 0_i8
        do o = 1, min(word_bits, grid%n - w*word_bits)
          bits = ior(bits, ishft(int(alive(k + grid%shift(o + w*word_bits)), i8), o - 1))
        end do
        count = count + popcnt(bits)
        kind(w + 1, k - first + 1) = bits
      end do
    end do
    n_bonds = n_bonds + count
  end subroutine find_kinds

  !> Give the slots from `first` to `last` their classes. New ones join `kind_of` and `first_of`.
  subroutine number_kinds(first, last, kind, key_bits, classes, kind_of, class_of, first_of)
    integer(i8), intent(in) :: first, last
    integer(i8), intent(in) :: kind(0:, :)
    integer(i8), intent(in) :: key_bits
    type(lookup_type), intent(inout) :: classes
    integer(i8), allocatable, intent(inout) :: kind_of(:, :)
    integer(i4), intent(inout) :: class_of(:)
    integer(i4), allocatable, intent(inout) :: first_of(:)
    integer(i8), allocatable :: longer(:, :)
    integer(i8) :: key, k
    integer :: at, w, number
    logical :: is_new

    do k = first, last
      at = int(k - first) + 1
      if (kind(0, at) == 0_i8) cycle
      if (at > 1) then
        if (all(kind(:, at) == kind(:, at - 1))) then
          class_of(k) = class_of(k - 1)
          cycle
        end if
      end if
      key = 0_i8
      do w = 0, ubound(kind, 1)
        key = mix(key, kind(w, at))
      end do
      call classes%number_of(iand(key, key_bits), number, is_new)
      if (.not. is_new) then
        is_new = any(kind_of(:, number) /= kind(:, at))
        if (is_new) call classes%own_number(number)
      end if
      class_of(k) = int(number, i4)
      if (.not. is_new) cycle
      if (number > size(first_of)) then
        first_of = [first_of, first_of]
        allocate (longer(0:ubound(kind, 1), size(first_of)), source=0_i8)
        longer(:, :number - 1) = kind_of(:, :number - 1)
        call move_alloc(longer, kind_of)
      end if
      first_of(number) = int(k, i4)
      kind_of(:, number) = kind(:, at)
    end do
  end subroutine number_kinds

end module pd_family_classes
