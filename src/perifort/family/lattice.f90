!> Lattice families: points on a uniform grid share a table of offsets, and a family is that table.
!>
!> Slots are the cells of a padded box, x fastest, so that the family member at offset o of slot k
!> is slot k + shift(o), for every k and without a test. Padding and cells that hold no point are
!> dead slots. Nothing is stored per bond but a bit where bonds can break.
!>
!> Bodies on grids of their own, which no bond joins, lie in boxes of their own, one after another.
!>
!> The force loops work on blocks of slots of one row: `lanes` of them in double precision, twice as
!> many where bonds are computed in single precision. The weights of their bonds are made of the
!> model and belong to the loops (`pd_force_workspace`).
module pd_family_lattice
  use pd_base_archive, only: archive_type
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_lanes, only: lanes, word_bits
  use pd_base_reduce, only: any_of_ranks, largest_of_ranks
  use pd_base_error, only: error_type, fail
  use pd_base_system, only: available_memory
  use pd_base_text, only: to_text, with_unit
  use pd_body_lattices, only: coordinate
  use pd_body_body, only: body_type, arrange
  use pd_family_cells, only: cells_type, points_across, sort_into_cells
  use pd_family_classes, only: find_classes
  use pd_family_family, only: family_type, bonds_type
  use pd_family_offsets, only: offsets_type, make_offsets, order_offsets, turn_offsets, &
    & first_cell, &
    & whole_blocks, both_ends
  use pd_family_slabs, only: slabs_type, find_slabs
  use pd_family_volume, only: volume_rule_type, reach, rule_of_bond
  implicit none (type, external)
  private
  public :: lattice_family_type, offsets_type, new_lattice_family, lattice_suits, use_double, &
    & grids_fit, find_listed, grid_at, both_ends, cells_between

  real(wp), parameter :: least_filled = 0.05_wp     !! part of the box's cells that must hold points
  integer, parameter :: most_slots = 1000000000     !! slots and shifts are 32-bit numbers

  type, extends(family_type) :: lattice_family_type
    type(offsets_type), allocatable :: grids(:)
    integer :: words = 0                       !! words of bits of one slot
    logical :: mixed = .false.                 !! bonds are computed in single precision
    logical :: partial = .false.               !! some slots have bonds that are not here: copies of
                                               !! other ranks' points, or points with bonds in the
                                               !! list of a composite family
    integer(i8) :: last_owned = huge(0_i8)     !! the last slot that is no copy
    integer(i4), allocatable :: copies(:)      !! slots of copies of other ranks' points, if any
    integer :: block_length = lanes            !! slots of a block; 2*lanes if mixed
    integer(i1), allocatable :: alive(:)       !! 1 where a slot holds a point
    integer(i8) :: key_bits = not(0_i8)        !! bits of keys that count: all, but in tests
    integer(i4), allocatable :: class_of(:)    !! slots of one class have alike families; 0 dead
    integer(i4), allocatable :: first_of(:)    !! the first slot of each class
    integer(i8), allocatable :: broken(:, :)   !! 1-bits: broken bonds (n_slots, words), if any can
    integer(i8), allocatable :: block(:)       !! first slot of each block
    type(slabs_type) :: slabs                  !! which blocks can be worked on at once
  contains
    procedure :: bonds_of
    procedure :: number_at
    procedure :: break_bond
    procedure :: keep_bonds
    procedure :: bytes
    procedure :: describe
    procedure :: alike
    procedure :: may_have_broken
    procedure :: allow_breaking
  end type lattice_family_type

contains

  !> Whether lattice families are possible for a body in point order: every point on a grid, grids
  !> that no bond joins, and grids filled reasonably. Otherwise `reason` says why not. Ranks with
  !> parts of a body come to one answer.
  subroutine lattice_suits(body, rule, suits, reason, listed, cells)
    type(body_type), intent(in) :: body               !! in point order, not yet arranged in slots:
                                                      !! all points, or those of a rank
    type(volume_rule_type), intent(in) :: rule        !! how far families reach
    logical, intent(out) :: suits                     !! a lattice family can be made
    character(:), allocatable, intent(out) :: reason
      !! why not, without a full stop; empty if it suits
    logical, allocatable, intent(out) :: listed(:)    !! (n_points) as `find_listed` has them
    integer, intent(in), optional :: cells(:, :)
      !! (3, grids) of the box around the points of all ranks on each grid, 0 if there are none;
      !! absent: all points are here

    suits = .false.
    call find_listed(body, rule, listed)
    if (any_of_ranks(body%order, any(body%grid == 0))) then
      reason = 'some points are a cloud, a mesh or cut cells'
    else if (any_of_ranks(body%order, any(listed))) then
      reason = 'bonds join bodies on different grids'
    else if (present(cells)) then
      call grids_fit(body, rule, suits, reason, cells)
    else
      call grids_fit(body, rule, suits, reason)
    end if
  end subroutine lattice_suits

  !> Whether the grids of a body are filled reasonably and have room for their slots.
  subroutine grids_fit(body, rule, suits, reason, cells)
    type(body_type), intent(in) :: body               !! in point order, not yet arranged in slots
    type(volume_rule_type), intent(in) :: rule        !! how far families reach
    logical, intent(out) :: suits                     !! they have
    character(:), allocatable, intent(out) :: reason
      !! why not, without a full stop; empty if it suits
    integer, intent(in), optional :: cells(:, :)      !! as in `lattice_suits`
    real(wp) :: room, filled
    integer :: g

    reason = ''
    room = 0.0_wp
    if (present(cells)) then
      room = sum(product(real(cells, wp), dim=1))
      filled = real(body%order%n_global, wp)
    else
      do g = 1, size(body%grids)
        if (any(body%grid == g)) room = room + product(real(extent(body, g), wp))
      end do
      filled = count(body%grid > 0)
    end if
    suits = filled >= least_filled*room
    if (.not. suits) then
      reason = 'the points fill too little of their grid'
      return
    end if
    room = 0.0_wp
    do g = 1, size(body%grids)
      if (any(body%grid == g)) room = room + padded(body, rule, g)
    end do
    room = largest_of_ranks(body%order, room)
    suits = room <= most_slots
    if (.not. suits) reason = 'with its padding the grid has '//to_text(room, 3)// &
      & ' cells, more than '//to_text(most_slots)
  end subroutine grids_fit

  !> The points of a body that a lattice alone cannot serve: those with bonds to points of another
  !> grid, and those on none.
  subroutine find_listed(body, rule, listed)
    type(body_type), intent(in) :: body           !! in point order, not yet arranged in slots
    type(volume_rule_type), intent(in) :: rule    !! how far families reach
    logical, allocatable, intent(out) :: listed(:)  !! (n_points) whether a point is one
    type(cells_type) :: cells
    real(wp), allocatable :: half_reach(:)
    integer :: k

    allocate (listed(body%n_points))
    listed = body%grid == 0
    if (all(body%grid == body%grid(1))) return
    allocate (half_reach(body%n_points))
    do k = 1, body%n_points
      half_reach(k) = reach(rule, body%spacing(k), body%dim)/2
    end do
    call sort_into_cells(body%x, 2*maxval(half_reach), cells)
    call points_across(body%x, half_reach, cells, body%grid, listed)
    listed = listed .or. body%grid == 0
  end subroutine find_listed

  !> The rule for the bonds within a grid: with the horizon that its spacing has.
  pure type(volume_rule_type) function rule_of_grid(rule, spacing) result(own)
    type(volume_rule_type), intent(in) :: rule
    real(wp), intent(in) :: spacing  !! of the grid [m]
    own = rule_of_bond(rule, spacing, spacing)
  end function rule_of_grid

  !> Slots of the box around the points of grid `g` with its padding, or a few less.
  pure real(wp) function padded(body, rule, g) result(slots)
    type(body_type), intent(in) :: body
    type(volume_rule_type), intent(in) :: rule
    integer, intent(in) :: g
    real(wp) :: cells(3), margin

    associate (spacing => body%grids(g)%spacing)
      margin = reach(rule_of_grid(rule, spacing), spacing, body%dim)/spacing
    end associate
    cells = real(extent(body, g), wp)
    ! rows and planes are followed by padding, and the box has it at both ends
    cells(:body%dim - 1) = cells(:body%dim - 1) + margin
    cells(body%dim) = cells(body%dim) + 2*margin
    slots = product(cells)
  end function padded

  !> Cells along each axis of the box around the points of grid `g`, 1 for axes that are not used.
  pure function extent(body, g) result(cells)
    type(body_type), intent(in) :: body
    integer, intent(in) :: g
    real(wp), allocatable :: along(:)
    integer :: cells(3), c

    cells = 1
    do c = 1, body%dim
      along = coordinate(body%grids(g), body%x, c)
      cells(c) = cells_between(minval(along, mask=body%grid == g), maxval(along, &
        & mask=body%grid == g), body%grids(g)%spacing)
    end do
  end function extent

  !> Cells of a row between two places of points, theirs included; 0 if there are no points.
  elemental integer function cells_between(lowest, highest, spacing) result(cells)
    real(wp), intent(in) :: lowest, highest  !! along the row; lowest > highest: no points [m]
    real(wp), intent(in) :: spacing          !! [m]

    cells = 0
    if (lowest > highest) return
    ! far apart, two bodies may span more cells than a number has room for
    cells = nint(min(real(most_slots, wp), (highest - lowest)/spacing)) + 1
  end function cells_between

  !> Families of a body that `lattice_suits`; the body is arranged in slots, points on no grid
  !> behind the others and without bonds. `breakable`: bonds may break or be cut, so each gets a
  !> bit. `mixed`: bonds in single precision, which 1D has no loops for. `key_bits`: the bits of
  !> keys that count; with fewer, different surroundings get one key.
  !> An error is set if the slots are too many for their numbers or for the memory, or if two points
  !> are in one cell.
  subroutine new_lattice_family(body, rule, breakable, mixed, family, error, key_bits, listed)
    type(body_type), intent(inout) :: body
      !! in point order; arranged in the slots of the family on return
    type(volume_rule_type), intent(in) :: rule        !! volume correction and horizon
    logical, intent(in) :: breakable                  !! bonds may break or be cut
    logical, intent(in) :: mixed  !! bonds in single precision, where there are loops for it
    type(lattice_family_type), intent(out) :: family
      !! whole, all bonds intact
    type(error_type), allocatable, intent(out) :: error
    integer(i8), intent(in), optional :: key_bits     !! all count if absent; for tests
    logical, intent(in), optional :: listed(:)
      !! (n_points) points with bonds in the list of a composite family; absent: none
    logical, allocatable :: apart(:)
    real(wp), allocatable :: spacing(:), volume(:)
    integer :: g, k

    if (present(key_bits)) family%key_bits = key_bits
    family%dim = body%dim
    family%partial = body%n_points > body%order%n_owned
    if (present(listed)) family%partial = family%partial .or. any(listed)
    family%mixed = mixed .and. body%dim > 1
    if (family%mixed) family%block_length = 2*lanes
    family%rule = rule
    allocate (family%grids(0))
    call find_cells(body, spacing, volume)
    do g = 1, size(body%grids)
      if (any(body%grid == g)) call add_grid(body, g, spacing(g), volume(g), family)
    end do
    family%most_bonds = maxval(family%grids%n)
    family%words = (family%most_bonds + word_bits - 1)/word_bits
    call place_points(body, family, error)
    if (allocated(error)) return
    if (body%n_points > body%order%n_owned) then
      family%last_owned = maxval(body%slot(:body%order%n_owned))
      family%copies = body%slot(body%order%n_owned + 1:)
    end if
    allocate (apart(body%n_slots), source=.false.)
    if (present(listed)) then
      do k = 1, body%n_slots
        if (body%point(k) > 0) apart(k) = listed(body%point(k))
      end do
    end if
    call find_classes(family%grids, family%alive, body%material, apart, family%words, &
      & family%key_bits, family%class_of, family%first_of, family%n_bonds)
    call find_blocks(family)
    if (breakable) call family%allow_breaking()
  end subroutine new_lattice_family

  !> Leave mixed precision: what a model needs has no loops for it.
  subroutine use_double(family)
    type(lattice_family_type), intent(inout) :: family
      !! with blocks of `lanes` slots on return; unchanged if not mixed

    if (.not. family%mixed) return
    family%mixed = .false.
    family%block_length = lanes
    call find_blocks(family)
  end subroutine use_double

  !> Spacing and volume of the cells of each grid: those of its first point of all ranks, since
  !> bodies on one grid may differ in the last digits. All ranks call it together.
  subroutine find_cells(body, spacing, volume)
    type(body_type), intent(in) :: body
    real(wp), allocatable, intent(out) :: spacing(:), volume(:)  !! (grids) [m], [m3]; 0: no point
    integer(i8) :: first, number
    integer :: g, k, p

    allocate (spacing(size(body%grids)), volume(size(body%grids)), source=0.0_wp)
    do g = 1, size(body%grids)
      first = huge(0)
      k = 0
      do p = 1, body%n_points
        if (body%grid(p) /= g) cycle
        number = p
        if (allocated(body%number)) number = body%number(p)
        if (number >= first) cycle
        first = number
        k = p
      end do
      ! numbers of points are exact as reals
      if (-largest_of_ranks(body%order, -real(first, wp)) < real(first, wp)) k = 0
      if (k > 0) spacing(g) = body%spacing(k)
      if (k > 0) volume(g) = body%volume(k)
      spacing(g) = largest_of_ranks(body%order, spacing(g))
      volume(g) = largest_of_ranks(body%order, volume(g))
    end do
  end subroutine find_cells

  !> The table of offsets and the padded box of grid `g` of the body, behind the boxes that are
  !> there. The padding at the end of one row serves the beginning of the next as well, and so for
  !> planes. Rows are a multiple of a block long, so that all of them are cut into blocks alike.
  subroutine add_grid(body, g, spacing, volume, family)
    type(body_type), intent(in) :: body
    integer, intent(in) :: g
    real(wp), intent(in) :: spacing, volume   !! of its cells
    type(lattice_family_type), intent(inout) :: family
    type(offsets_type) :: grid
    integer :: cells(3), c, o
    integer(i8) :: margin

    grid%spacing = spacing
    grid%cell_volume = volume
    cells = extent(body, g)
    grid%alignment = family%block_length
    if (allocated(body%grids(g)%lowest)) call fix_box(body, g, grid, cells)
    call make_offsets(rule_of_grid(family%rule, grid%spacing), body%dim, cells, grid)
    associate (m => grid%reach_cells)
      grid%stride = [1, whole_blocks(cells(1) + m, grid%alignment), 0]
      grid%stride(3) = grid%stride(2)*(cells(2) + m)
      if (body%dim < 3) grid%stride(3) = 0
      if (body%dim < 2) grid%stride(2) = 0
      margin = whole_blocks(int(min(m*sum(int(grid%stride, i8)), int(most_slots, i8))), &
        & grid%alignment)
    end associate
    grid%first = 1_i8
    if (size(family%grids) > 0) grid%first = family%grids(size(family%grids))%last + 1
    grid%last = grid%first - 1 + 2*margin + whole_blocks(cells(1), grid%alignment) &
      & + sum((cells(2:) - 1)*int(grid%stride(2:), i8))
    do o = 1, grid%n
      grid%shift(o) = 0_i8
      do c = 1, body%dim
        grid%shift(o) = grid%shift(o) + nint(grid%xi(o, c)/grid%spacing)*int(grid%stride(c), i8)
      end do
    end do
    if (body%grids(g)%turned) call turn_offsets(grid, body%grids(g)%axes(:body%dim, :body%dim))
    call order_offsets(grid)
    family%grids = [family%grids, grid]
  end subroutine add_grid

  !> Let the box of a grid begin where blocks of a row begin on all ranks, and count its cells from
  !> the lowest one of all ranks.
  subroutine fix_box(body, g, grid, cells)
    type(body_type), intent(in) :: body
    integer, intent(in) :: g
    type(offsets_type), intent(inout) :: grid  !! with its alignment
    integer, intent(inout) :: cells(3)         !! more along x on return
    integer :: c, more

    grid%fixed = .true.
    do c = 1, body%dim
      grid%before(c) = nint((lower_side(body, g, c) - body%grids(g)%lowest(c))/grid%spacing)
    end do
    more = modulo(grid%before(1), grid%alignment)
    grid%before(1) = grid%before(1) - more
    cells(1) = cells(1) + more
  end subroutine fix_box

  !> The least place of a point of grid `g` along its axis `c` [m].
  pure real(wp) function lower_side(body, g, c)
    type(body_type), intent(in) :: body
    integer, intent(in) :: g, c
    lower_side = minval(coordinate(body%grids(g), body%x, c), mask=body%grid == g)
  end function lower_side

  !> Put every point into its cell.
  subroutine place_points(body, family, error)
    type(body_type), intent(inout) :: body
    type(lattice_family_type), intent(inout) :: family
    type(error_type), allocatable, intent(out) :: error
    integer(i4), allocatable :: point(:)
    real(wp), allocatable :: lower(:, :)
    real(wp) :: x(body%dim)
    integer(i8) :: n_slots, need, at, free
    integer :: c, k, n, g
    integer, allocatable :: number(:)

    ! points on no grid stand behind the boxes of the grids
    free = family%grids(size(family%grids))%last
    n_slots = free + whole_blocks(count(body%grid == 0), lanes)
    if (n_slots > most_slots) then
      call fail(error, 'the lattice needs '//to_text(n_slots)//' slots, more than '// &
        & to_text(most_slots))
      return
    end if
    ! no scene does without positions, volumes, displacements, velocities and forces
    need = 8*(4*body%dim + 1)*n_slots
    if (need > available_memory()) then
      call fail(error, 'the box of the lattice, with the horizon around it, has '// &
        & to_text(n_slots)//' slots, which need more than '//with_unit(real(need, wp), 'B', 3)// &
        & ' of memory; only '//with_unit(real(available_memory(), wp), 'B', 3)//' are available')
      return
    end if
    allocate (number(size(body%grids)), lower(body%dim, size(body%grids)))
    n = 0
    do g = 1, size(body%grids)
      if (.not. any(body%grid == g)) cycle
      n = n + 1
      number(g) = n
      do c = 1, body%dim
        lower(c, g) = lower_side(body, g, c)
        if (family%grids(n)%fixed) lower(c, g) = body%grids(g)%lowest(c) &
          & + family%grids(n)%before(c)*family%grids(n)%spacing
      end do
    end do
    allocate (point(n_slots), source=0_i4)
    do k = 1, body%n_points
      g = body%grid(k)
      if (g == 0) then
        free = free + 1
        point(free) = int(k, i4)
        cycle
      end if
      associate (grid => family%grids(number(g)))
        at = first_cell(grid)
        x = body%x(k, :)
        if (body%grids(g)%turned) x = matmul(x, body%grids(g)%axes(:body%dim, :body%dim))
        do c = 1, body%dim
          at = at + nint((x(c) - lower(c, g))/grid%spacing)*int(grid%stride(c), i8)
        end do
      end associate
      if (point(at) > 0_i4) then
        call fail(error, 'bodies '//to_text(int(body%body(point(at))))//' and '// &
          & to_text(int(body%body(k)))//' overlap: their points '//to_text(int(point(at)))// &
          & ' and '//to_text(k)//' are in one cell', group='body', &
          & number=max(int(body%body(point(at))), int(body%body(k))))
        return
      end if
      point(at) = int(k, i4)
    end do
    call arrange(body, point)
    family%n_slots = body%n_slots
    allocate (family%alive(n_slots))
    family%alive = merge(1_i1, 0_i1, point > 0_i4)
    family%alive(family%grids(size(family%grids))%last + 1:) = 0_i1
  end subroutine place_points

  !> How many bonds slot `k` has, broken ones too.
  pure integer function number_at(family, k) result(n)
    class(lattice_family_type), intent(in) :: family  !! the family
    integer, intent(in) :: k                          !! slot; a dead one has none
    n = 0
    if (family%alive(k) == 0_i1) return
    associate (grid => family%grids(grid_at(family, int(k, i8))))
      n = sum(int(family%alive(k + grid%shift)))
    end associate
  end function number_at

  !> The number of the grid that holds slot `k`.
  pure integer function grid_at(family, k) result(g)
    class(lattice_family_type), intent(in) :: family  !! the family
    integer(i8), intent(in) :: k                      !! slot
    do g = 1, size(family%grids) - 1
      if (k <= family%grids(g)%last) exit
    end do
  end function grid_at

  !> Cover the live slots with blocks. Rows begin at multiples of their length, and so do blocks.
  !> Copies behind the last owned slot need none: loops that add to both ends of a bond add forward,
  !> and what copies have comes from their owners.
  subroutine find_blocks(family)
    type(lattice_family_type), intent(inout) :: family
    integer(i8) :: k, n
    integer :: pass

    if (allocated(family%block)) deallocate (family%block)
    do pass = 1, 2
      n = 0_i8
      do k = 1, family%n_slots - family%block_length + 1, family%block_length
        if (k > family%last_owned) exit
        if (all(family%alive(k:k + family%block_length - 1) == 0_i1)) cycle
        n = n + 1
        if (pass == 2) family%block(n) = k
      end do
      if (pass == 1) allocate (family%block(n))
    end do
    call find_slabs(family%grids, family%dim, both_ends(family%dim, family%mixed), &
      & family%block_length, family%block, family%slabs, touch_copies(family))
  end subroutine find_blocks

  !> Which blocks have bonds of copies of other ranks' points among those that loops compute for
  !> them.
  pure function touch_copies(family) result(touched)
    type(lattice_family_type), intent(in) :: family  !! with its blocks
    logical, allocatable :: touched(:)
    integer(i1), allocatable :: copy(:)
    integer(i8) :: first, last
    integer :: b, o
    logical :: both

    allocate (touched(size(family%block)), source=.false.)
    if (.not. allocated(family%copies)) return
    both = both_ends(family%dim, family%mixed)
    allocate (copy(family%n_slots), source=0_i1)
    copy(family%copies) = 1_i1
    do b = 1, size(family%block)
      first = family%block(b)
      last = first + family%block_length - 1
      touched(b) = any(copy(first:last) == 1_i1)
      if (touched(b)) cycle
      associate (grid => family%grids(grid_at(family, first)))
        do o = 1, grid%n
          if (both .and. grid%shift(o) < 0_i8) cycle
          touched(b) = any(copy(first + grid%shift(o):last + grid%shift(o)) == 1_i1)
          if (touched(b)) exit
        end do
      end associate
    end do
  end function touch_copies

  !> The first slot of the class of slot `k`; `k` itself if it is dead.
  pure integer function alike(family, k)
    class(lattice_family_type), intent(in) :: family  !! the family
    integer, intent(in) :: k                          !! slot
    alike = k
    if (.not. allocated(family%class_of)) return
    if (family%class_of(k) > 0_i4) alike = family%first_of(family%class_of(k))
  end function alike

  !> Whether some bond of slot `k` is broken.
  pure logical function may_have_broken(family, k)
    class(lattice_family_type), intent(in) :: family  !! the family
    integer, intent(in) :: k                          !! slot
    may_have_broken = .false.
    if (allocated(family%broken)) may_have_broken = any(family%broken(k, :) /= 0_i8)
  end function may_have_broken

  !> Give every bond its bit, all intact.
  subroutine allow_breaking(family)
    class(lattice_family_type), intent(inout) :: family
      !! with `broken` allocated on return; unchanged if it is
    if (allocated(family%broken)) return
    allocate (family%broken(family%n_slots, family%words), source=0_i8)
  end subroutine allow_breaking

  !> All bonds of slot `k` in the order of its grid's offsets, broken ones too.
  pure subroutine bonds_of(family, k, bonds)
    class(lattice_family_type), intent(in) :: family  !! the family
    integer, intent(in) :: k                          !! slot; a dead one has no bonds
    type(bonds_type), intent(inout) :: bonds
      !! made by `allocate_bonds`; the first `bonds%n` entries are set
    integer :: o, n
    integer(i8) :: j

    bonds%n = 0
    if (family%alive(k) == 0_i1) return
    n = 0
    associate (grid => family%grids(grid_at(family, int(k, i8))))
      do o = 1, grid%n
        j = k + grid%shift(o)
        if (family%alive(j) == 0_i1) cycle
        n = n + 1
        bonds%j(n) = int(j, i4)
        bonds%xi(n, :) = grid%xi(o, :)
        bonds%length(n) = grid%length(o)
        bonds%weight(n) = grid%fraction(o)*grid%cell_volume
        bonds%intact(n) = .true.
        if (allocated(family%broken)) bonds%intact(n) = &
          & .not. btest(family%broken(k, (o - 1)/word_bits + 1), mod(o - 1, word_bits))
      end do
    end associate
    bonds%n = n
  end subroutine bonds_of

  !> Break the `i`-th bond of slot `k`; the other direction is another call.
  pure subroutine break_bond(family, k, i)
    class(lattice_family_type), intent(inout) :: family
      !! that allows breaking; with this bond broken on return
    integer, intent(in) :: k                             !! slot whose bond is broken
    integer, intent(in) :: i  !! number of the bond in `bonds_of(k)`, from 1
    integer :: o, n, w

    n = 0
    associate (grid => family%grids(grid_at(family, int(k, i8))))
      do o = 1, grid%n
        if (family%alive(k + grid%shift(o)) == 0_i1) cycle
        n = n + 1
        if (n < i) cycle
        w = (o - 1)/word_bits + 1
        family%broken(k, w) = ibset(family%broken(k, w), mod(o - 1, word_bits))
        return
      end do
    end associate
  end subroutine break_bond

  !> Keep the bits of broken bonds, or put them back.
  subroutine keep_bonds(family, archive)
    class(lattice_family_type), intent(inout) :: family
      !! its broken bonds are set where the archive reads
    class(archive_type), intent(inout) :: archive        !! a checkpoint that is written or read
    call archive%keep('broken bonds of slots', family%broken)
  end subroutine keep_bonds

  !> Memory of the slots, blocks and bits [bytes].
  pure integer(i8) function bytes(family)
    class(lattice_family_type), intent(in) :: family  !! the family

    bytes = family%n_slots
    if (allocated(family%class_of)) bytes = bytes + 4_i8*family%n_slots
    if (allocated(family%broken)) bytes = bytes + 8_i8*family%n_slots*family%words
    if (allocated(family%block)) bytes = bytes + 8_i8*size(family%block)
  end function bytes

  !> Spacings of the grids, in a line.
  function describe(family) result(text)
    class(lattice_family_type), intent(in) :: family  !! the family
    character(:), allocatable :: text
    integer :: g

    text = 'lattice: all points on one grid of '
    if (size(family%grids) > 1) text = 'lattices: '//to_text(size(family%grids))//' grids of '
    do g = 1, size(family%grids)
      if (g > 1) text = text//', '
      text = text//with_unit(family%grids(g)%spacing, 'm')
    end do
  end function describe

end module pd_family_lattice
