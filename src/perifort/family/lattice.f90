!> Lattice families: points on one uniform grid share a table of offsets, and a family is that table.
!>
!> Slots are the cells of a padded box, x fastest, so that the family member at offset o of slot k is
!> slot k + shift(o), for every k and without a test. Padding and cells that hold no point are dead
!> slots. Nothing is stored per bond but a bit where bonds can break.
!>
!> The force loops work on blocks of `lanes` slots of one row. Blocks whose surroundings look the
!> same (and most do) share one table of weights with the surface factors in it.
module pd_family_lattice
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_error, only: error_type, fail
  use pd_base_lookup, only: lookup_type, mix
  use pd_base_text, only: to_text, with_unit
  use pd_body_body, only: body_type, arrange
  use pd_family_family, only: family_type, bonds_type
  use pd_family_volume, only: volume_rule_type, volume_correction, reach
  implicit none (type, external)
  private
  public :: lattice_family_type, weights_type, new_lattice_family, lattice_suits, lanes, word_bits

  integer, parameter :: lanes = 8        !! slots of a block: one 512-bit register of reals
  integer, parameter :: word_bits = 64   !! bonds in one word of bits
  real(wp), parameter :: least_filled = 0.05_wp     !! part of the box's cells that must hold points
  integer, parameter :: most_slots = 1000000000     !! slots and shifts are 32-bit numbers

  !> Weights of the bonds of one block, or of many that are alike.
  type :: weights_type
    integer :: n = 0                           !! offsets that any lane has
    integer(i4), allocatable :: offset(:)      !! their numbers (n)
    integer(i8), allocatable :: shift(:)       !! their shifts (n)
    real(wp), allocatable :: geometry(:, :)    !! their geometry (4, n)
    real(wp), allocatable :: dilatation(:, :)  !! Gd v_c V_j (lanes, n)
    real(wp), allocatable :: stretch(:, :)     !! (q_k + q_j) Gb v_c V_j |xi| (lanes, n)
  end type weights_type

  type, extends(family_type) :: lattice_family_type
    real(wp) :: spacing = 0.0_wp
    integer :: stride(3) = 0                   !! from one cell to the next along x, y, z [slots]
    integer :: n_offsets = 0
    integer :: words = 0                       !! words of bits of one slot
    integer :: reach_cells = 0                 !! farthest offset along an axis
    integer(i8), allocatable :: shift(:)       !! (n_offsets) [slots]
    real(wp), allocatable :: xi(:, :)          !! bond vectors (n_offsets, dim) [m]
    real(wp), allocatable :: length(:)         !! |xi| [m]
    real(wp), allocatable :: fraction(:)       !! v_c
    real(wp), allocatable :: geometry(:, :)    !! xi/|xi|^2 (rows 1:3) and 1/|xi|^2 (4, n_offsets)
    real(wp) :: cell_volume = 0.0_wp           !! of every point [m3]
    integer(i1), allocatable :: alive(:)       !! 1 where a slot holds a point
    integer(i4), allocatable :: class_of(:)    !! slots of one class have alike families; 0 dead
    integer(i8), allocatable :: broken(:, :)   !! 1-bits are broken bonds (n_slots, words), if any can
    integer(i8), allocatable :: block(:)       !! first slot of each block
    integer(i4), allocatable :: weights(:)     !! which weights each block has; 0: made on the fly
    integer(i1), allocatable :: large(:)       !! 1: the block is strained beyond the fast formula
    type(weights_type), allocatable :: table(:)
  contains
    procedure :: bonds_of
    procedure :: break_bond
    procedure :: bytes
    procedure :: describe
    procedure :: allow_breaking
  end type lattice_family_type

contains

  !> Whether a lattice family can serve a body in point order: all points on one grid that they fill
  !> reasonably. Otherwise `reason` says why not.
  subroutine lattice_suits(body, suits, reason)
    type(body_type), intent(in) :: body
    logical, intent(out) :: suits
    character(:), allocatable, intent(out) :: reason
    integer :: cells(3)

    suits = .false.
    reason = ''
    if (any(body%grid == 0)) then
      reason = 'some points are a cloud'
    else if (any(body%grid /= body%grid(1))) then
      reason = 'the bodies lie on different grids'
    else
      cells = extent(body)
      suits = body%n_points >= least_filled*product(real(cells, wp))
      if (.not. suits) reason = 'the points fill too little of their grid'
    end if
  end subroutine lattice_suits

  !> Cells along each axis of the box around all points, 1 for axes that are not used.
  pure function extent(body) result(cells)
    type(body_type), intent(in) :: body
    integer :: cells(3), c

    cells = 1
    do c = 1, body%dim
      cells(c) = nint((maxval(body%x(:, c)) - minval(body%x(:, c)))/body%spacing(1)) + 1
    end do
  end function extent

  !> Families of a body whose points all lie on one grid; the body is arranged in slots.
  !> `breakable`: bonds may break or be cut, so each gets a bit.
  subroutine new_lattice_family(body, rule, breakable, family, error)
    type(body_type), intent(inout) :: body
    type(volume_rule_type), intent(in) :: rule
    logical, intent(in) :: breakable
    type(lattice_family_type), intent(out) :: family
    type(error_type), allocatable, intent(out) :: error

    family%dim = body%dim
    family%rule = rule
    family%spacing = body%spacing(1)
    family%cell_volume = body%volume(1)
    call make_offsets(family)
    call lay_out(body, family, error)
    if (allocated(error)) return
    call classify(body, family)
    call find_blocks(family)
    if (breakable) call family%allow_breaking()
  end subroutine new_lattice_family

  !> The table of offsets, ascending in slots once `stride` is known.
  subroutine make_offsets(family)
    type(lattice_family_type), intent(inout) :: family
    real(wp) :: xi(3), farthest, vc
    integer :: i, j, k, m, n, pass, high(3)

    farthest = reach(family%rule, family%spacing, family%dim)
    m = floor(farthest/family%spacing)
    family%reach_cells = m
    high = 0
    high(:family%dim) = m
    do pass = 1, 2
      n = 0
      do k = -high(3), high(3)
        do j = -high(2), high(2)
          do i = -high(1), high(1)
            if (i == 0 .and. j == 0 .and. k == 0) cycle
            xi = family%spacing*[i, j, k]
            if (norm2(xi) > farthest) cycle
            vc = volume_correction(family%rule, xi(:family%dim), norm2(xi), family%spacing)
            n = n + 1
            if (pass == 1) cycle
            family%xi(n, :) = xi(:family%dim)
            family%length(n) = norm2(xi)
            family%fraction(n) = vc
          end do
        end do
      end do
      if (pass == 1) allocate (family%xi(n, family%dim), family%length(n), family%fraction(n), &
        & family%shift(n))
    end do
    allocate (family%geometry(4, n), source=0.0_wp)
    do i = 1, n
      family%geometry(:family%dim, i) = family%xi(i, :)/sum(family%xi(i, :)**2)
      family%geometry(4, i) = 1/sum(family%xi(i, :)**2)
    end do
    family%n_offsets = n
    family%most_bonds = n
    family%words = (n + word_bits - 1)/word_bits
  end subroutine make_offsets

  !> Put every point into its cell of the padded box. The padding at the end of one row serves the
  !> beginning of the next as well, and so for planes. Rows are a multiple of `lanes` long, so that
  !> all of them are cut into blocks alike.
  subroutine lay_out(body, family, error)
    type(body_type), intent(inout) :: body
    type(lattice_family_type), intent(inout) :: family
    type(error_type), allocatable, intent(out) :: error
    integer(i4), allocatable :: point(:)
    integer(i8) :: n_slots, margin, first, at
    integer :: cells(3), c, k, m, o
    real(wp) :: lower(3)

    m = family%reach_cells
    cells = extent(body)
    lower = 0.0_wp
    do c = 1, body%dim
      lower(c) = minval(body%x(:, c))
    end do
    family%stride = [1, whole_blocks(cells(1) + m), 0]
    family%stride(3) = family%stride(2)*(cells(2) + m)
    if (body%dim < 3) family%stride(3) = 0
    if (body%dim < 2) family%stride(2) = 0
    margin = whole_blocks(int(min(m*sum(int(family%stride, i8)), int(most_slots, i8))))
    first = margin + 1
    n_slots = 2*margin + whole_blocks(cells(1)) &
      & + sum((cells(2:) - 1)*int(family%stride(2:), i8))
    if (n_slots > most_slots) then
      call fail(error, 'the lattice needs '//to_text(n_slots)//' slots, more than '//to_text(most_slots))
      return
    end if
    do o = 1, family%n_offsets
      family%shift(o) = 0_i8
      do c = 1, body%dim
        family%shift(o) = family%shift(o) + nint(family%xi(o, c)/family%spacing)*int(family%stride(c), i8)
      end do
    end do
    allocate (point(n_slots), source=0_i4)
    do k = 1, body%n_points
      at = first
      do c = 1, body%dim
        at = at + nint((body%x(k, c) - lower(c))/family%spacing)*int(family%stride(c), i8)
      end do
      if (point(at) > 0_i4) then
        call fail(error, 'bodies '//to_text(int(body%body(point(at))))//' and '// &
          & to_text(int(body%body(k)))//' overlap: their points '//to_text(int(point(at)))//' and '// &
          & to_text(k)//' are in one cell')
        return
      end if
      point(at) = int(k, i4)
    end do
    call arrange(body, point)
    family%n_slots = body%n_slots
    allocate (family%alive(n_slots))
    family%alive = merge(1_i1, 0_i1, point > 0_i4)
  end subroutine lay_out

  !> The next multiple of `lanes`.
  pure integer function whole_blocks(slots)
    integer, intent(in) :: slots
    whole_blocks = (slots + lanes - 1)/lanes*lanes
  end function whole_blocks

  !> Number the kinds of surroundings: slots of the same material with the same members are alike.
  !> Counts the bonds on the way.
  subroutine classify(body, family)
    type(body_type), intent(in) :: body
    type(lattice_family_type), intent(inout) :: family
    type(lookup_type) :: classes
    integer(i8), allocatable :: key(:), bits(:)
    integer(i8) :: count, first, last
    integer :: o, w, number
    integer(i8) :: k
    logical :: is_new

    first = findloc(family%alive, 1_i1, dim=1, kind=i8)
    last = findloc(family%alive, 1_i1, dim=1, kind=i8, back=.true.)
    allocate (key(family%n_slots), bits(family%n_slots))
    count = 0_i8
    key = int(body%material, i8)
    do w = 1, family%words
      !$omp parallel do schedule(static) default(none) shared(family, bits, key, first, last, w) &
      !$omp private(k, o) reduction(+:count)
      do k = first, last
        bits(k) = 0_i8
        if (family%alive(k) == 0_i1) cycle
        do o = 1, min(word_bits, family%n_offsets - (w - 1)*word_bits)
          bits(k) = ior(bits(k), ishft(int(family%alive(k + family%shift(o + (w - 1)*word_bits)), i8), o - 1))
        end do
        count = count + popcnt(bits(k))
        key(k) = mix(key(k), bits(k))
      end do
    end do
    family%n_bonds = count
    allocate (family%class_of(family%n_slots), source=0_i4)
    do k = first, last
      if (family%alive(k) == 0_i1) cycle
      if (k > first) then
        if (family%alive(k - 1) == 1_i1 .and. key(k) == key(k - 1)) then
          family%class_of(k) = family%class_of(k - 1)
          cycle
        end if
      end if
      call classes%number_of(key(k), number, is_new)
      family%class_of(k) = int(number, i4)
    end do
  end subroutine classify

  !> Cover the live slots with blocks. Rows begin at multiples of `lanes`, and so do blocks.
  subroutine find_blocks(family)
    type(lattice_family_type), intent(inout) :: family
    integer(i8) :: k, n
    integer :: pass

    do pass = 1, 2
      n = 0_i8
      do k = 1, family%n_slots - lanes + 1, lanes
        if (all(family%alive(k:k + lanes - 1) == 0_i1)) cycle
        n = n + 1
        if (pass == 2) family%block(n) = k
      end do
      if (pass == 1) allocate (family%block(n), family%weights(n), family%large(n))
    end do
    family%weights = 0_i4
    family%large = 0_i1
  end subroutine find_blocks

  !> Give every bond its bit, all intact.
  subroutine allow_breaking(family)
    class(lattice_family_type), intent(inout) :: family
    if (.not. allocated(family%broken)) allocate (family%broken(family%n_slots, family%words), source=0_i8)
  end subroutine allow_breaking

  pure subroutine bonds_of(family, k, bonds)
    class(lattice_family_type), intent(in) :: family
    integer, intent(in) :: k
    type(bonds_type), intent(inout) :: bonds
    integer :: o, n
    integer(i8) :: j

    n = 0
    bonds%n = 0
    if (family%alive(k) == 0_i1) return
    do o = 1, family%n_offsets
      j = k + family%shift(o)
      if (family%alive(j) == 0_i1) cycle
      n = n + 1
      bonds%j(n) = int(j, i4)
      bonds%xi(n, :) = family%xi(o, :)
      bonds%length(n) = family%length(o)
      bonds%weight(n) = family%fraction(o)*family%cell_volume
      bonds%intact(n) = .true.
      if (allocated(family%broken)) bonds%intact(n) = &
        & .not. btest(family%broken(k, (o - 1)/word_bits + 1), mod(o - 1, word_bits))
    end do
    bonds%n = n
  end subroutine bonds_of

  pure subroutine break_bond(family, k, i)
    class(lattice_family_type), intent(inout) :: family
    integer, intent(in) :: k, i
    integer :: o, n, w

    n = 0
    do o = 1, family%n_offsets
      if (family%alive(k + family%shift(o)) == 0_i1) cycle
      n = n + 1
      if (n < i) cycle
      w = (o - 1)/word_bits + 1
      family%broken(k, w) = ibset(family%broken(k, w), mod(o - 1, word_bits))
      return
    end do
  end subroutine break_bond

  pure integer(i8) function bytes(family)
    class(lattice_family_type), intent(in) :: family
    integer :: t

    bytes = 5_i8*family%n_slots
    if (allocated(family%broken)) bytes = bytes + 8_i8*family%n_slots*family%words
    if (allocated(family%block)) bytes = bytes + 8_i8*size(family%block)
    if (allocated(family%weights)) bytes = bytes + 4_i8*size(family%weights)
    if (.not. allocated(family%table)) return
    do t = 1, size(family%table)
      bytes = bytes + family%table(t)%n*(16_i8*lanes + 44)
    end do
  end function bytes

  function describe(family) result(text)
    class(lattice_family_type), intent(in) :: family
    character(:), allocatable :: text
    text = 'lattice: all points on one grid of '//with_unit(family%spacing, 'm')//', '// &
      & to_text(family%n_offsets)//' offsets'
    if (allocated(family%table)) text = text//', '//to_text(size(family%table))//' tables of weights'
  end function describe

end module pd_family_lattice
