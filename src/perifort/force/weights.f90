!> Weights of lattice blocks: volume correction, surface factors and stiffness of every bond of
!> neighbouring slots. Blocks whose surroundings are alike share them, so that surface
!> correction costs nothing in a step and next to no memory.
module pd_force_weights
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, sp, i1, i4, i8
  use pd_base_lanes, only: lanes, word_bits
  use pd_base_lookup, only: lookup_type, mix
  use pd_family_lattice, only: lattice_family_type, use_double, grid_at, both_ends
  use pd_family_surface, only: bond_factor
  use pd_force_model, only: bond_factors_of, model_type, options_of, q_of
  use pd_force_polynomial, only: fast_limit, narrow, single
  use pd_force_workspace, only: lattice_workspace_type, singles_type, weights_type
  implicit none (type, external)
  private
  public :: build_weights, prepare_blocks, block_weights, allocate_weights, weights_now, half_of

  !> Factors of points that differ less are those of one surrounding, off by the order of its sums.
  real(wp), parameter :: alike = 64*epsilon(1.0_wp)
  integer(i8), parameter :: bytes_per_slot = 100_i8  !! that tables may take beside their room

contains

  !> Find the blocks that are alike and make the weights of each kind, those that most blocks share
  !> first. When the kinds become too many (a lattice full of random holes), blocks of the others
  !> make theirs in every pass.
  subroutine build_weights(family, model, workspace)
    type(lattice_family_type), intent(inout) :: family
      !! whole; loses its classes, and mixed precision where the model has no such loops
    type(model_type), intent(in) :: model  !! complete, with surface factors
    type(lattice_workspace_type), intent(inout) :: workspace  !! gets the tables
    integer(i8), allocatable :: first(:), first_of_table(:)
    integer(i4), allocatable :: table_of(:)
    integer, allocatable :: uses(:), order(:)
    type(weights_type), allocatable :: table(:)
    integer(i8) :: bytes, most
    integer :: b, i, made

    if (fast_limit(model, options_of(model), merge(single, narrow, family%mixed)) <= 0.0_wp) &
      & call use_double(family)
    call prepare_blocks(family, model, workspace)
    ! without surface factors, members farther away than a block's own do not count
    if (model%consistent) then
      family%class_of = model%weights%row
    else if (.not. (model%surface .or. allocated(model%scale))) then
      family%class_of = merge(int(model%material, i4), 0_i4, family%alive == 1_i1)
    end if
    if (family%partial .and. (model%surface .or. allocated(model%scale))) &
      & call part_by_factors(model, family)
    call find_kinds(family, model%consistent, workspace, first, uses)
    order = most_used_first(uses)
    allocate (table(size(uses)), first_of_table(size(uses)), table_of(0:size(uses)))
    table_of = 0_i4
    bytes = 0_i8
    most = workspace%room + bytes_per_slot*family%n_slots
    made = 0
    do i = 1, size(order)
      associate (from => first(order(i)))
        if (bytes + table_bytes(family, family%grids(grid_at(family, from))%n) > most) exit
        made = i
        first_of_table(made) = from
        call allocate_weights(family, model, table(made))
        call block_weights(family, model, from, table(made))
      end associate
      call trim_weights(table(made))
      bytes = bytes + table_bytes(family, table(made)%n)
      table_of(order(i)) = int(made, i4)
    end do
    do b = 1, size(family%block)
      workspace%weights(b) = table_of(workspace%weights(b))
    end do
    workspace%table = table(:made)
    call compare_surroundings(family, model%consistent, first_of_table, workspace)
    deallocate (family%class_of)  ! no longer needed
  end subroutine build_weights

  !> Classes of slots with the same material, scale and surface factors, where the lattice does not
  !> have all bonds that these follow from: copies of other ranks' points have theirs from there. In
  !> a composite family factors are alike but for the order of sums; on ranks bit by bit.
  subroutine part_by_factors(model, family)
    type(model_type), intent(in) :: model
    type(lattice_family_type), intent(inout) :: family  !! gets other classes
    type(lookup_type) :: known
    real(wp) :: factors(2*family%dim + 1)
    integer(i8) :: key
    integer, allocatable :: first(:)
    integer :: k, c, number
    logical :: is_new, exact

    exact = family%last_owned < huge(family%last_owned)
    allocate (first(family%n_slots), source=0)
    do k = 1, int(family%n_slots)
      if (family%alive(k) == 0_i1) cycle
      key = int(model%material(k), i8)
      factors = factors_at(model, k)
      if (.not. exact) factors = real(real(factors, sp), wp)
      do c = 1, size(factors)
        key = mix(key, transfer(factors(c), key))
      end do
      call known%number_of(key, number, is_new)
      if (is_new) first(number) = k
      ! values that have the key of others get a class of their own
      if (.not. same_factors(model, k, first(number), merge(0.0_wp, alike, exact))) then
        call known%own_number(number)
        first(number) = k
      end if
      family%class_of(k) = int(number, i4)
    end do
  end subroutine part_by_factors

  !> Surface factors and scale of a slot, 1 where it has none [-].
  pure function factors_at(model, k) result(factors)
    type(model_type), intent(in) :: model
    integer, intent(in) :: k
    real(wp) :: factors(2*model%dim + 1)

    factors = 1.0_wp
    if (model%surface) factors(:2*model%dim) = [model%D(k, :), model%S(k, :)]
    if (allocated(model%scale)) factors(2*model%dim + 1) = model%scale(k)
  end function factors_at

  !> Whether two slots have the same material and the same factors within `tolerance`.
  pure logical function same_factors(model, one, other, tolerance)
    type(model_type), intent(in) :: model
    integer, intent(in) :: one, other
    real(wp), intent(in) :: tolerance

    associate (first => factors_at(model, one), second => factors_at(model, other))
      same_factors = model%material(one) == model%material(other) &
        & .and. all(abs(first - second) <= tolerance*abs(first))
    end associate
  end function same_factors

  !> Room for what is kept of each block, if there is none: blocks make their weights in every pass
  !> as long as nobody has built tables of them.
  subroutine prepare_blocks(family, model, workspace)
    type(lattice_family_type), intent(in) :: family  !! in the precision that it keeps
    type(model_type), intent(in) :: model            !! whether there is a dilatation
    type(lattice_workspace_type), intent(inout) :: workspace  !! unchanged if it has room

    if (allocated(workspace%weights)) then
      if (size(workspace%weights) /= size(family%block)) &
        & call internal_fault('a workspace of another family')
      return
    end if
    allocate (workspace%weights(size(family%block)), source=0_i4)
    allocate (workspace%formulas_used(size(family%block)), source=0_i1)
    if (family%mixed) call allocate_singles(family, model, workspace%singles)
  end subroutine prepare_blocks

  !> Number the kinds of blocks by their surroundings, into `weights` of the workspace.
  subroutine find_kinds(family, own, workspace, first, uses)
    type(lattice_family_type), intent(in) :: family
    logical, intent(in) :: own  !! the classes of a block's own slots say all
    type(lattice_workspace_type), intent(inout) :: workspace
    integer(i8), allocatable, intent(out) :: first(:)  !! first slot of the first block of each kind
    integer, allocatable, intent(out) :: uses(:)       !! blocks of each kind
    type(lookup_type) :: kinds
    integer(i8), allocatable :: column(:)
    integer(i8) :: key
    integer :: b, g, i, reach, number
    logical :: is_new

    if (own) then
      column = int(family%class_of, i8)
    else
      call column_keys(family, column)
    end if
    allocate (first(size(family%block)))
    allocate (uses(size(family%block)), source=0)
    do b = 1, size(family%block)
      g = grid_at(family, family%block(b))
      key = int(g, i8)
      reach = merge(0, family%grids(g)%reach_cells, own)
      do i = -reach, family%block_length - 1 + reach
        key = mix(key, column(family%block(b) + i))
      end do
      call kinds%number_of(iand(key, family%key_bits), number, is_new)
      workspace%weights(b) = int(number, i4)
      if (is_new) first(number) = family%block(b)
      uses(number) = uses(number) + 1
    end do
    first = first(:kinds%count)
    uses = uses(:kinds%count)
  end subroutine find_kinds

  !> The numbers of the kinds, those with most `uses` first, equal ones in their order.
  pure function most_used_first(uses) result(order)
    integer, intent(in) :: uses(:)
    integer :: order(size(uses))
    integer, allocatable :: before(:)  ! kinds with more uses, or as many and placed
    integer :: k

    allocate (before(maxval([0, uses])), source=0)
    do k = 1, size(uses)
      if (uses(k) > 1) before(uses(k) - 1) = before(uses(k) - 1) + 1
    end do
    do k = size(before) - 1, 1, -1
      before(k) = before(k) + before(k + 1)
    end do
    do k = 1, size(uses)
      before(uses(k)) = before(uses(k)) + 1
      order(before(uses(k))) = k
    end do
  end function most_used_first

  !> Memory of a table of weights [bytes].
  pure integer(i8) function table_bytes(family, n) result(bytes)
    type(lattice_family_type), intent(in) :: family
    integer, intent(in) :: n  !! its offsets
    bytes = n*(16_i8*lanes + merge(60, 44, family%mixed))
  end function table_bytes

  !> A key of 64 bits hardly ever belongs to two kinds of blocks. Where it does, blocks that look
  !> another way than the one that their table was made for, by its `first` slot, make their weights
  !> in every pass.
  subroutine compare_surroundings(family, own, first, workspace)
    type(lattice_family_type), intent(in) :: family
    logical, intent(in) :: own  !! the classes of a block's own slots say all
    integer(i8), intent(in) :: first(:)
    type(lattice_workspace_type), intent(inout) :: workspace
    integer :: b

    !$omp parallel do schedule(static) default(none) private(b) &
    !$omp shared(family, own, first, workspace)
    do b = 1, size(family%block)
      if (workspace%weights(b) == 0_i4) cycle
      if (.not. alike_blocks(family, own, family%block(b), first(workspace%weights(b)))) &
        & workspace%weights(b) = 0_i4
    end do
  end subroutine compare_surroundings

  !> Whether two blocks, by their first slots, and all slots within reach of them are of the same
  !> classes, and so have the same weights.
  pure logical function alike_blocks(family, own, one, other)
    type(lattice_family_type), intent(in) :: family
    logical, intent(in) :: own  !! the slots of the blocks alone say all
    integer(i8), intent(in) :: one, other
    integer(i8) :: from, to
    integer :: g, m, my, mz, j, k

    alike_blocks = one == other
    if (alike_blocks) return
    g = grid_at(family, one)
    if (grid_at(family, other) /= g) return
    associate (grid => family%grids(g))
      m = merge(0, grid%reach_cells, own)
      my = merge(m, 0, family%dim > 1)
      mz = merge(m, 0, family%dim > 2)
      do k = -mz, mz
        do j = -my, my
          from = j*int(grid%stride(2), i8) + k*int(grid%stride(3), i8) - m
          to = from + family%block_length - 1 + 2*m
          if (any(family%class_of(one + from:one + to) &
            & /= family%class_of(other + from:other + to))) return
        end do
      end do
    end associate
    alike_blocks = .true.
  end function alike_blocks

  !> A key for each slot that says what its cross-section of rows looks like: a block's surroundings
  !> are the columns from its first slot less the reach to its last slot plus the reach.
  subroutine column_keys(family, column)
    type(lattice_family_type), intent(in) :: family
    integer(i8), allocatable, intent(out) :: column(:)
    integer :: g, m, my, mz, j, k
    integer(i8) :: margin, first, last, s, row

    allocate (column(family%n_slots), source=0_i8)
    do g = 1, size(family%grids)
      associate (grid => family%grids(g))
        m = grid%reach_cells
        my = merge(m, 0, family%dim > 1)
        mz = merge(m, 0, family%dim > 2)
        ! rows of the padding that would look beyond the box hold nothing that a block needs
        margin = my*int(grid%stride(2), i8) + mz*int(grid%stride(3), i8)
        first = grid%first + margin
        last = grid%last - margin
        do k = -mz, mz
          do j = -my, my
            row = j*int(grid%stride(2), i8) + k*int(grid%stride(3), i8)
            !$omp parallel do simd schedule(static) default(none) private(s) &
            !$omp shared(family, column, row, first, last)
            do s = first, last
              column(s) = mix(column(s), int(family%class_of(s + row), i8))
            end do
          end do
        end do
      end associate
    end do
  end subroutine column_keys

  !> What the loops in mixed precision work on; the first pass fills it.
  pure subroutine allocate_singles(family, model, singles)
    type(lattice_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(singles_type), intent(inout) :: singles
    integer :: n

    n = family%n_slots
    singles%volume = volume_unit(family)
    allocate (singles%high(n, family%dim), singles%low(n, family%dim))
    allocate (singles%p(merge(n, 0, model%dilatation)))
    allocate (singles%sums(merge(n, 0, both_ends(family%dim, family%mixed)), family%dim))
  end subroutine allocate_singles

  !> The unit of volumes in single precision, a power of 2 [m3].
  pure real(wp) function volume_unit(family)
    type(lattice_family_type), intent(in) :: family
    volume_unit = 2.0_wp**exponent(maxval(family%grids%cell_volume))
  end function volume_unit

  !> Room for the weights of any block.
  pure subroutine allocate_weights(family, model, weights)
    type(lattice_family_type), intent(in) :: family  !! with its lengths of blocks and of families
    type(model_type), intent(in) :: model            !! whether there is a dilatation
    type(weights_type), intent(out) :: weights       !! of any block, not set
    integer :: n

    n = family%most_bonds
    allocate (weights%offset(n), weights%shift(n), weights%geometry(4, n))
    allocate (weights%stretch(family%block_length, n))
    allocate (weights%dilatation(family%block_length, merge(n, 0, model%dilatation)))
    if (.not. family%mixed) return
    allocate (weights%single_geometry(4, n), weights%single_stretch(family%block_length, n))
    allocate (weights%single_dilatation(family%block_length, merge(n, 0, model%dilatation)))
  end subroutine allocate_weights

  !> Weights of the block that begins at slot `first`, as if no bond were broken, in the grid's
  !> order of offsets. Offsets that no lane has are left out.
  pure subroutine block_weights(family, model, first, weights)
    type(lattice_family_type), intent(in) :: family  !! the family
    type(model_type), intent(in) :: model            !! complete, with surface factors
    integer(i8), intent(in) :: first                 !! slot of the block's first lane
    type(weights_type), intent(inout) :: weights
      !! with room for any block; those of this one on return
    real(wp) :: weight, n(family%dim), gb, gd
    integer(i8) :: k, j
    integer(i8), allocatable :: place(:, :)
    integer :: i, o, l, m, length

    length = family%block_length
    if (model%consistent) then
      call find_places(family, model, first, place)
    else
      allocate (place(0, 0))
    end if
    m = 0
    weights%n_forward = 0
    associate (grid => family%grids(grid_at(family, first)), alive => family%alive)
      do i = 1, grid%n
        o = grid%order(i)
        j = first + grid%shift(o)
        if (.not. any(alive(first:first + length - 1) == 1_i1 &
          & .and. alive(j:j + length - 1) == 1_i1)) cycle
        m = m + 1
        if (grid%shift(o) > 0_i8) weights%n_forward = m
        weights%offset(m) = int(o, i4)
        weights%shift(m) = grid%shift(o)
        weights%geometry(:, m) = grid%geometry(:, o)
        n = grid%xi(o, :)/grid%length(o)
        do l = 1, length
          k = first + l - 1
          j = k + grid%shift(o)
          weights%stretch(l, m) = 0.0_wp
          if (model%dilatation) weights%dilatation(l, m) = 0.0_wp
          if (alive(k) == 0_i1 .or. alive(j) == 0_i1) cycle
          weight = grid%fraction(o)*grid%cell_volume
          if (.not. allocated(model%scale)) then
            weights%stretch(l, m) = weight*grid%length(o)*(model%materials(model%material(k))%q &
              & + model%materials(model%material(j))%q)
          else
            weights%stretch(l, m) = weight*grid%length(o)*(q_of(model, int(k)) &
              & + q_of(model, int(j)))
          end if
          if (model%dilatation) weights%dilatation(l, m) = weight
          if (model%weighted) then
            call bond_factors_of(model, int(k), int(j), grid%length(o), gb, gd)
            weights%stretch(l, m) = weights%stretch(l, m)*gb
            if (model%dilatation) weights%dilatation(l, m) = weight*gd
          end if
          if (model%consistent) then
            weights%stretch(l, m) = weights%stretch(l, m)*model%weights%Gb(place(l, o))
            if (model%dilatation) weights%dilatation(l, m) = weight*model%weights%Gd(place(l, o))
          end if
          if (.not. model%surface) cycle
          weights%stretch(l, m) = weights%stretch(l, m)*bond_factor(n, model%S(k, :), model%S(j, &
            & :), model%axes)
          if (.not. model%dilatation) cycle
          weights%dilatation(l, m) = weights%dilatation(l, m) &
            & *bond_factor(n, model%D(k, :), model%D(j, :), model%axes)
        end do
      end do
    end associate
    weights%n = m
    if (.not. family%mixed) return
    weights%single_geometry(:, :m) = real(weights%geometry(:, :m), sp)
    weights%single_stretch(:, :m) = real(weights%stretch(:, :m), sp)
    if (model%dilatation) weights%single_dilatation(:, :m) = &
      & real(weights%dilatation(:, :m)/volume_unit(family), sp)
  end subroutine block_weights

  !> Where the weights of a block's bonds stand (lane, offset): in the order of `bonds_of`.
  pure subroutine find_places(family, model, first, place)
    type(lattice_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    integer(i8), intent(in) :: first
    integer(i8), allocatable, intent(out) :: place(:, :)
    integer(i8) :: k, next
    integer :: l, o

    associate (grid => family%grids(grid_at(family, first)), alive => family%alive)
      allocate (place(family%block_length, grid%n))
      do l = 1, family%block_length
        k = first + l - 1
        place(l, :) = 0_i8
        if (model%weights%row(k) == 0_i4) cycle
        next = model%weights%before(int(k))
        do o = 1, grid%n
          if (alive(k + grid%shift(o)) == 0_i1) cycle
          next = next + 1
          place(l, o) = next
        end do
      end do
    end associate
  end subroutine find_places

  !> Give back the room of offsets that were left out, and of the precision that is not needed.
  pure subroutine trim_weights(weights)
    type(weights_type), intent(inout) :: weights
    integer :: n

    n = weights%n
    weights%offset = weights%offset(:n)
    weights%shift = weights%shift(:n)
    weights%geometry = weights%geometry(:, :n)
    if (allocated(weights%single_stretch)) then
      weights%single_geometry = weights%single_geometry(:, :n)
      weights%single_stretch = weights%single_stretch(:, :n)
      if (size(weights%single_dilatation) > 0) &
        & weights%single_dilatation = weights%single_dilatation(:, :n)
      deallocate (weights%stretch, weights%dilatation)
      return
    end if
    weights%stretch = weights%stretch(:, :n)
    if (size(weights%dilatation) > 0) weights%dilatation = weights%dilatation(:, :n)
  end subroutine trim_weights

  !> The weights of a block as its bonds are now, those of broken bonds 0.
  pure subroutine weights_now(family, model, workspace, b, weights)
    type(lattice_family_type), intent(in) :: family  !! the family
    type(model_type), intent(in) :: model            !! that the tables were made for
    type(lattice_workspace_type), intent(in) :: workspace  !! with tables, if there are any
    integer, intent(in) :: b                         !! number of the block
    type(weights_type), intent(inout) :: weights
      !! those of this block on return; gets room if it has none
    integer :: m, o, w, l, n
    integer(i8) :: first, bit
    real(wp) :: intact(family%block_length)

    first = family%block(b)
    if (.not. allocated(weights%offset)) call allocate_weights(family, model, weights)
    if (workspace%weights(b) > 0) then
      associate (shared => workspace%table(workspace%weights(b)))
        n = shared%n
        weights%n = n
        weights%n_forward = shared%n_forward
        weights%offset(:n) = shared%offset
        weights%shift(:n) = shared%shift
        weights%geometry(:, :n) = shared%geometry
        if (family%mixed) then
          weights%single_geometry(:, :n) = shared%single_geometry
          weights%single_stretch(:, :n) = shared%single_stretch
          if (model%dilatation) weights%single_dilatation(:, :n) = shared%single_dilatation
        else
          weights%stretch(:, :n) = shared%stretch
          if (model%dilatation) weights%dilatation(:, :n) = shared%dilatation
        end if
      end associate
    else
      call block_weights(family, model, first, weights)
    end if
    if (.not. allocated(family%broken)) return
    do m = 1, weights%n
      o = weights%offset(m)
      w = (o - 1)/word_bits + 1
      do l = 1, family%block_length
        bit = iand(ishft(family%broken(first + l - 1, w), -mod(o - 1, word_bits)), 1_i8)
        intact(l) = real(1_i8 - bit, wp)
      end do
      if (family%mixed) then
        weights%single_stretch(:, m) = weights%single_stretch(:, m)*real(intact, sp)
        if (model%dilatation) weights%single_dilatation(:, m) = &
          & weights%single_dilatation(:, m)*real(intact, sp)
      else
        weights%stretch(:, m) = weights%stretch(:, m)*intact
        if (model%dilatation) weights%dilatation(:, m) = weights%dilatation(:, m)*intact
      end if
    end do
  end subroutine weights_now

  !> The weights in double precision of `lanes` slots of a block, `skipped` slots behind its first,
  !> from those in single precision.
  pure subroutine half_of(family, weights, skipped, half)
    type(lattice_family_type), intent(in) :: family  !! in mixed precision
    type(weights_type), intent(in) :: weights  !! of the whole block
    integer, intent(in) :: skipped             !! slots of the block before this part: 0 or `lanes`
    type(weights_type), intent(inout) :: half
      !! those of this part on return; gets room if it has none
    integer :: n

    n = weights%n
    if (.not. allocated(half%shift)) then
      allocate (half%shift(family%most_bonds), half%geometry(4, family%most_bonds))
      allocate (half%stretch(lanes, family%most_bonds), half%dilatation(lanes, family%most_bonds))
    end if
    half%n = n
    half%n_forward = weights%n_forward
    half%shift(:n) = weights%shift(:n)
    half%geometry(:, :n) = weights%geometry(:, :n)
    half%stretch(:, :n) = weights%single_stretch(skipped + 1:skipped + lanes, :n)
    if (size(weights%single_dilatation) > 0) half%dilatation(:, :n) = &
      & volume_unit(family)*weights%single_dilatation(skipped + 1:skipped + lanes, :n)
  end subroutine half_of

end module pd_force_weights
