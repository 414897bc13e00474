!> Grids of lattice families: the box of slots in which a grid's cells lie, and its table of
!> offsets.
module pd_family_offsets
  use pd_base_kinds, only: wp, i8
  use pd_base_lanes, only: lanes, word_bits
  use pd_family_volume, only: volume_rule_type, volume_correction, reach
  implicit none (type, external)
  private
  public :: offsets_type, make_offsets, turn_offsets, order_offsets, first_cell, whole_blocks, &
    & both_ends

  !> One grid: its box of slots and its table of offsets.
  type :: offsets_type
    integer :: n = 0                           !! offsets
    integer :: alignment = lanes               !! rows are a multiple of this long [slots]
    integer :: reach_cells = 0                 !! farthest offset along an axis
    integer :: stride(3) = 0                   !! from one cell to the next along x, y, z [slots]
    integer :: before(3) = 0                   !! cells along each axis that other ranks have before
                                               !! this box, where forces do not depend on the ranks
    logical :: fixed = .false.                 !! they do not
    integer(i8) :: first = 0_i8                !! first slot of the box
    integer(i8) :: last = 0_i8                 !! its last slot
    real(wp) :: spacing = 0.0_wp               !! [m]
    real(wp) :: cell_volume = 0.0_wp           !! of every point [m3]
    integer, allocatable :: order(:)           !! in which loops take the offsets (n)
    integer(i8), allocatable :: forward_bits(:) !! 1 for offsets with a shift > 0 (words)
    integer(i8), allocatable :: shift(:)       !! from a slot to the member (n) [slots]
    real(wp), allocatable :: xi(:, :)          !! bond vectors (n, dim) [m]
    real(wp), allocatable :: length(:)         !! |xi| [m]
    real(wp), allocatable :: fraction(:)       !! v_c
    real(wp), allocatable :: geometry(:, :)    !! xi/|xi|^2 (rows 1:3) and 1/|xi|^2 (4, n)
  end type offsets_type

contains

  !> The bond vectors of a grid: all offsets within the rule's reach, x fastest, that join two of
  !> its `cells`. The second matters for thin bodies and for horizons larger than the body, whose
  !> tables would be mostly empty and, in space, of any size.
  subroutine make_offsets(rule, dim, cells, grid)
    type(volume_rule_type), intent(in) :: rule  !! how far families reach
    integer, intent(in) :: dim                  !! of the body: 1 to 3
    integer, intent(in) :: cells(3)
      !! cells of the grid along x, y, z, 1 for axes that are not used
    type(offsets_type), intent(inout) :: grid
      !! with a spacing; gets its offsets, x fastest, and room for their shifts
    real(wp) :: xi(3), farthest
    integer :: i, j, k, n, pass, high(3)

    farthest = reach(rule, grid%spacing, dim)
    high = 0
    high(:dim) = int(min(farthest/grid%spacing, real(cells(:dim) - 1, wp)))
    grid%reach_cells = maxval(high)
    do pass = 1, 2
      n = 0
      do k = -high(3), high(3)
        do j = -high(2), high(2)
          do i = -high(1), high(1)
            if (i == 0 .and. j == 0 .and. k == 0) cycle
            xi = grid%spacing*[i, j, k]
            if (norm2(xi) > farthest) cycle
            n = n + 1
            if (pass == 1) cycle
            grid%xi(n, :) = xi(:dim)
            grid%length(n) = norm2(xi)
            grid%fraction(n) = volume_correction(rule, xi(:dim), norm2(xi), grid%spacing)
            grid%geometry(:3, n) = xi/sum(xi**2)
            grid%geometry(4, n) = 1/sum(xi**2)
          end do
        end do
      end do
      if (pass == 1) allocate (grid%xi(n, dim), grid%length(n), grid%fraction(n), grid%shift(n), &
        & grid%geometry(4, n))
    end do
    grid%n = n
  end subroutine make_offsets

  !> Turn the bond vectors of a grid to its axes. Lengths, volumes and cells stay.
  pure subroutine turn_offsets(grid, axes)
    type(offsets_type), intent(inout) :: grid  !! with the shifts of its offsets
    real(wp), intent(in) :: axes(:, :)         !! (dim, dim) unit vectors in columns
    integer :: o, dim

    dim = size(axes, 1)
    do o = 1, grid%n
      grid%xi(o, :) = matmul(axes, grid%xi(o, :))
      grid%geometry(:dim, o) = grid%xi(o, :)*grid%geometry(4, o)
    end do
  end subroutine turn_offsets

  !> The order in which loops take a grid's offsets: forward ones first, so that a loop that adds to
  !> both ends of a bond takes these alone; and one of each row in turn, since what was just added
  !> to eight slots of a row cannot be loaded again at once, some slots on.
  pure subroutine order_offsets(grid)
    type(offsets_type), intent(inout) :: grid  !! with shifts; gets `order` and `forward_bits`
    integer :: in_row(grid%n), o, n, i

    in_row = 1
    do o = grid%n/2 + 2, grid%n
      if (grid%shift(o) == grid%shift(o - 1) + 1) in_row(o) = in_row(o - 1) + 1
    end do
    allocate (grid%order(grid%n), grid%forward_bits((grid%n + word_bits - 1)/word_bits))
    n = 0
    do i = 1, maxval(in_row)
      do o = grid%n/2 + 1, grid%n
        if (in_row(o) /= i) cycle
        n = n + 1
        grid%order(n) = o
      end do
    end do
    grid%order(n + 1:) = grid%n + 1 - grid%order(:n)
    grid%forward_bits = 0_i8
    do o = grid%n/2 + 1, grid%n
      associate (bits => grid%forward_bits((o - 1)/word_bits + 1))
        bits = ibset(bits, mod(o - 1, word_bits))
      end associate
    end do
  end subroutine order_offsets

  !> The slot of a grid's first cell, with as much room before it as the farthest offset reaches
  !> back.
  pure integer(i8) function first_cell(grid)
    type(offsets_type), intent(in) :: grid  !! with its first slot, strides and reach
    first_cell = grid%first + whole_blocks(int(grid%reach_cells &
      & *sum(int(grid%stride, i8))), grid%alignment)
  end function first_cell

  !> Whether loops in `dim` dimensions take forward offsets alone and add to both ends of a bond. In
  !> 1D the next offset would have to load again what was just added.
  pure logical function both_ends(dim, mixed)
    integer, intent(in) :: dim    !! of the body: 1 to 3
    logical, intent(in) :: mixed  !! bonds in single precision
    both_ends = dim > 2 .or. (dim == 2 .and. .not. mixed)
  end function both_ends

  !> The next multiple of the length of a block.
  pure integer function whole_blocks(slots, block_length)
    integer, intent(in) :: slots         !! number of slots, rounded up
    integer, intent(in) :: block_length  !! slots of a block
    whole_blocks = (slots + block_length - 1)/block_length*block_length
  end function whole_blocks

end module pd_family_offsets
