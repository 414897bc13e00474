!> Slabs of a lattice: how a loop that adds to both ends of every bond is shared out to threads.
!>
!> A block of slots adds to slots up to the horizon away. The blocks of a grid are therefore cut
!> into slabs across one axis, so thick that slabs of one colour, every other one, never reach the
!> same slot. All slabs of the first colour are worked through, in any order and by any threads, and
!> then those of the second: what is added to a slot, and in which order, never depends on the
!> threads.
!>
!> Where other ranks own some of the points, blocks that need values of these come late, in two more
!> colours, so that the others can be worked through while messages are on their way.
module pd_family_slabs
  use pd_base_kinds, only: i8
  use pd_family_offsets, only: offsets_type, first_cell
  implicit none (type, external)
  private
  public :: slabs_type, find_slabs

  !> Blocks sorted by slab, slabs by colour.
  type :: slabs_type
    integer, allocatable :: first(:)   !! first block of each slab, and one past the last block
    integer :: colour(5) = 1           !! first slab of each colour, and one past the last slab:
                                       !! the third and fourth are those that come late
  end type slabs_type

  integer, parameter :: enough = 16       !! slabs that make another axis than the slowest needless
  integer, parameter :: most_pairs = 64  !! more slabs of a colour are of no use
  integer, parameter :: least_blocks = 16 !! blocks of a slab, on average

contains

  !> Cut the blocks of all grids into slabs, and sort `block`, the first slot of each, that way. All
  !> blocks are `block_length` slots long. No bond joins two grids. Where loops do not add to `both`
  !> ends of a bond, there is nothing to keep apart.
  pure subroutine find_slabs(grids, dim, both, block_length, block, slabs, late)
    type(offsets_type), intent(in) :: grids(:)  !! (any number) with their boxes
    integer, intent(in) :: dim                  !! of the body: 1 to 3
    integer, intent(in) :: block_length         !! slots of a block
    logical, intent(in) :: both                 !! loops add to both ends of a bond
    integer(i8), intent(inout) :: block(:)
      !! (any number) first slot of each block; sorted by slab on return
    type(slabs_type), intent(out) :: slabs      !! of the sorted blocks
    logical, intent(in), optional :: late(:)    !! which blocks come late, in their first order;
                                                !! absent: none
    integer, allocatable :: slab(:), of_grid(:), order(:), layer(:, :)
    logical, allocatable :: waits(:)
    integer :: b, g, n, m, reach(dim)

    allocate (waits(size(block)), source=.false.)
    if (present(late)) waits = late
    if (.not. both) then
      ! all are of the first colour, and of the third those that come late
      block = [pack(block, .not. waits), pack(block, waits)]
      m = count(waits)
      n = max(1, min(2*most_pairs, (size(block) - m)/least_blocks))
      slabs%first = [(1 + int(int(size(block) - m, i8)*b/n), b=0, n)]
      slabs%colour = n + 1
      slabs%colour(1) = 1
      if (m == 0) return
      n = max(1, min(2*most_pairs, m/least_blocks))
      slabs%first = [slabs%first, (size(block) - m + 1 + int(int(m, i8)*b/n), b=1, n)]
      slabs%colour(4:) = slabs%colour(3) + n
      return
    end if
    allocate (slab(size(block)))
    n = 0
    do g = 1, size(grids)
      associate (blocks => pack([(b, b=1, size(block))], &
        & block >= grids(g)%first .and. block <= grids(g)%last))
        ! one layer more, since dead lanes at the end of a row reach into the row behind, if only to
        ! add nothing
        reach = grids(g)%reach_cells + 1
        reach(1) = (grids(g)%reach_cells - 1)/block_length + 1
        call find_layers(grids(g), dim, block_length, block(blocks), layer)
        if (grids(g)%fixed) then
          of_grid = fixed_slabs(layer(:, dim) + grids(g)%before(dim), reach(dim))
        else
          call cut_grid(layer, reach, of_grid)
        end if
        slab(blocks) = of_grid + n
        ! each grid begins with the first colour
        n = n + maxval(of_grid)
        n = n + modulo(n, 2)
      end associate
    end do
    if (any(grids%fixed)) call keep_order(slab, n, waits)
    call sort_into_slabs(slab, waits, slabs, order)
    block = block(order)
  end subroutine find_slabs

  !> Where what is added to a slot must come in the same order on all ranks, slabs come late as a
  !> whole, and those of the second colour after both of their neighbours, which add to the same
  !> slots before them.
  pure subroutine keep_order(slab, slabs, late)
    integer, intent(in) :: slab(:)        !! of each block, from 1
    integer, intent(in) :: slabs          !! how many there are
    logical, intent(inout) :: late(:)     !! (blocks)
    logical :: waits(0:slabs + 1), even(0:slabs + 1)
    integer :: b, s

    waits = .false.
    do b = 1, size(slab)
      waits(slab(b)) = waits(slab(b)) .or. late(b)
    end do
    even = waits
    do s = 2, slabs, 2
      even(s) = any(waits(s - 1:s + 1))
    end do
    late = even(slab)
  end subroutine keep_order

  !> The layer of each block along each axis, from 0; along x, layers are as thick as blocks.
  pure subroutine find_layers(grid, dim, block_length, block, layer)
    type(offsets_type), intent(in) :: grid
    integer, intent(in) :: dim, block_length
    integer(i8), intent(in) :: block(:)
    integer, allocatable, intent(out) :: layer(:, :)
    integer(i8) :: rest
    integer :: b, c

    allocate (layer(size(block), dim))
    do b = 1, size(block)
      rest = block(b) - first_cell(grid)
      do c = dim, 1, -1
        layer(b, c) = int(rest/grid%stride(c))
        rest = modulo(rest, int(grid%stride(c), i8))
      end do
      layer(b, 1) = layer(b, 1)/block_length
    end do
  end subroutine find_layers

  !> Slab of each block of one grid, numbered from 1. `layer(b, a)` is the layer of block b along
  !> axis a, from 0, `reach(a)` how many layers on a block adds to; along the slowest axis it adds
  !> in one direction only, along the others in both.
  pure subroutine cut_grid(layer, reach, slab)
    integer, intent(in) :: layer(:, :), reach(:)
    integer, allocatable, intent(out) :: slab(:)
    integer, dimension(size(reach)) :: thickness, layers, slabs
    integer, allocatable :: number(:)
    integer :: axis

    thickness = 2*reach
    thickness(size(reach)) = reach(size(reach))
    layers = maxval(layer, dim=1) + 1
    slabs = layers/thickness
    axis = size(reach)
    if (slabs(axis) < enough) axis = maxloc(slabs, dim=1, back=.true.)
    call cut_layers(layer(:, axis), layers(axis), thickness(axis), &
      & even_number(min(slabs(axis), size(layer, 1)/least_blocks)), number)
    slab = number(layer(:, axis) + 1)
  end subroutine cut_grid

  !> The slab of each block where forces must not depend on the ranks: slabs are as thick as may be
  !> and counted from the lowest layer of all ranks, so that what is added to a slot comes in the
  !> same order on all. Slab 1 may be empty.
  pure function fixed_slabs(layer, thickness) result(slab)
    integer, intent(in) :: layer(:)    !! of each block along the slowest axis, from 0
    integer, intent(in) :: thickness   !! of a slab
    integer :: slab(size(layer))
    integer :: first

    slab = layer/thickness
    first = minval(slab)
    slab = slab - (first - modulo(first, 2)) + 1
  end function fixed_slabs

  !> Slabs to make where there could be `most`: 1, or twice 1, 2, 3, 4, 6, 8, 12 and so on, which
  !> most numbers of threads divide.
  pure integer function even_number(most) result(n)
    integer, intent(in) :: most
    integer :: power

    n = 1
    power = 1
    do while (power <= most_pairs)
      if (2*power <= most) n = 2*power
      if (modulo(power, 2) == 0 .and. 3*power <= most) n = 3*power
      power = 2*power
    end do
  end function even_number

  !> The slab of each of the layers 0 to `layers` - 1: `n` slabs with about as many blocks each,
  !> none thinner than `thickness`.
  pure subroutine cut_layers(layer, layers, thickness, n, slab)
    integer, intent(in) :: layer(:), layers, thickness, n
    integer, allocatable, intent(out) :: slab(:)
    integer(i8) :: blocks(0:layers - 1), so_far
    integer :: b, i, s, began

    blocks = 0_i8
    do b = 1, size(layer)
      blocks(layer(b)) = blocks(layer(b)) + 1
    end do
    allocate (slab(layers))
    so_far = 0_i8
    s = 1
    began = 0
    do i = 0, layers - 1
      ! the next slab begins where this one has its share, if it is thick enough, and at the latest
      ! where the rest need all layers that are left
      if (s < n .and. i - began >= thickness) then
        if (so_far*n >= s*int(size(layer), i8) .or. layers - i <= (n - s)*thickness) then
          s = s + 1
          began = i
        end if
      end if
      slab(i + 1) = s
      so_far = so_far + blocks(i)
    end do
  end subroutine cut_layers

  !> Slabs of all grids together, and the order that sorts their blocks: `order(i)` is the block
  !> that becomes the i-th. Odd slabs are of the first colour, even ones of the second; what of them
  !> comes late is a slab of its own, of the third or fourth.
  pure subroutine sort_into_slabs(slab, late, slabs, order)
    integer, intent(in) :: slab(:)
    logical, intent(in) :: late(:)
    type(slabs_type), intent(out) :: slabs
    integer, allocatable, intent(out) :: order(:)
    integer, allocatable :: next(:)
    integer :: b, n, odd, s, times

    n = maxval(slab)
    odd = (n + 1)/2
    times = merge(2, 1, any(late))
    allocate (slabs%first(times*n + 1), order(size(slab)))
    slabs%colour = times*n + 1
    slabs%colour(:3) = [1, odd + 1, n + 1]
    if (times == 2) slabs%colour(4) = n + odd + 1
    slabs%first = 0
    do b = 1, size(slab)
      s = sorted(slab(b), late(b))
      slabs%first(s + 1) = slabs%first(s + 1) + 1
    end do
    slabs%first(1) = 1
    do s = 1, times*n
      slabs%first(s + 1) = slabs%first(s + 1) + slabs%first(s)
    end do
    next = slabs%first
    do b = 1, size(slab)
      s = sorted(slab(b), late(b))
      order(next(s)) = b
      next(s) = next(s) + 1
    end do

  contains

    !> Odd slabs come first.
    pure integer function sorted(s, waits)
      integer, intent(in) :: s
      logical, intent(in) :: waits
      sorted = (s + 1)/2
      if (modulo(s, 2) == 0) sorted = odd + s/2
      if (waits) sorted = sorted + n
    end function sorted
  end subroutine sort_into_slabs

end module pd_family_slabs
