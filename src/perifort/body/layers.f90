!> Layers, the rows of points that `&boundary side` adds outside a side (doc/theory.md, 10).
!>
!> A layer continues the lattice of its body, column by column. Seen from the side, a column's layer
!> starts outside the outermost cell that is left of it, if that cell lies within the horizon of the
!> outermost cell of all columns. Where cells are refined, columns are those of the cells that stand
!> outermost, and their layers have the spacing and the horizon of these.
module pd_body_layers
  use pd_base_kinds, only: wp, i2, i8
  use pd_base_error, only: error_type
  use pd_base_lookup, only: lookup_type, mix
  use pd_base_text, only: to_text, with_unit
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: adds_layer, has_own_horizons, has_refinement, scene_type
  use pd_body_body, only: body_type, grid_type, allocate_points, append_points, keep_points
  use pd_body_lattices, only: box_of_cells, cell_of, place_in
  use pd_body_refine, only: finer, level_of
  implicit none (type, external)
  private
  public :: add_layers, layer_rows, layer_count_type, layer_count_text

  real(wp), parameter :: same_place = 1.0e-6_wp  !! of faces [spacings]
  !> Overlap of columns of two bodies that touch up to the digits of their corners [spacings].
  real(wp), parameter :: sliver = 1.0e-2_wp

  !> Number of columns of a side with the layer and reasons why others have none. Bodies without a
  !> column that has it are not counted.
  type :: layer_count_type
    integer :: boundary = 0     !! number of the `&boundary` group
    integer :: columns = 0      !! columns that have the layer
    integer :: farther_in = 0   !! columns that begin farther in than the horizon: no layer
    integer :: empty = 0        !! columns of which nothing is left: no layer
    integer :: covered = 0      !! columns with another body before them: no layer
    integer :: shared = 0       !! points left out, because an earlier layer has their cell
  end type layer_count_type

  !> The side of one lattice body, or of its cells of one level of `&refine`: the remaining cells of
  !> each column. Heights are numbers of cells along the axis, counted so that they grow outwards.
  type :: side_type
    type(grid_type) :: grid
    integer(i2) :: number = 0_i2       !! of the grid; 0: nothing is left of the body
    integer(i2) :: material = 0_i2     !! number of its material
    integer :: body = 0                !! number of the body
    integer :: parts = 1               !! columns along each axis into which one of the body's
                                       !! lattice is divided
    integer :: rows = 0                !! of the layer
    real(wp) :: delta = 0.0_wp         !! horizon of its points [m]
    integer, allocatable :: top(:, :)  !! height of each column's outermost cell, or `nothing`
    logical, allocatable :: hidden(:, :)  !! whether cells of another side stand before the column
    logical, allocatable :: has(:, :)  !! whether the column gets the layer
  end type side_type

  integer, parameter :: nothing = -huge(0)  !! height of a column of which nothing is left

contains

  !> Rows of a layer: 3 at a ratio of 3.015; 0 if the horizon is shorter than the spacing.
  pure integer function layer_rows(delta, spacing) result(rows)
    real(wp), intent(in) :: delta    !! horizon [m]
    real(wp), intent(in) :: spacing  !! [m]
    rows = floor(delta/spacing*(1 + 1.0e-9_wp))
  end function layer_rows

  !> Add the layers of all `&boundary side`, in the order of the groups. An error, with its place,
  !> for a layer without a point.
  subroutine add_layers(scene, delta, depth, body, counts, error)
    type(scene_type), intent(in) :: scene  !! gives the boundaries
    real(wp), intent(in) :: delta            !! horizon, the largest one of all points [m]
    real(wp), intent(in) :: depth            !! what makes dx^dim a volume: thickness, area or 1
    type(body_type), intent(inout) :: body   !! in point order, with its lattices, without layers
    type(layer_count_type), allocatable, intent(out) :: counts(:)
      !! (layers), what their columns came to
    type(error_type), allocatable, intent(out) :: error
    type(lookup_type) :: claimed
    integer(i2), allocatable :: owner(:)
    type(body_type) :: layer
    integer :: i, n_body

    allocate (counts(count(adds_layer(scene%boundaries))), owner(0))
    n_body = body%n_points
    counts%boundary = pack([(i, i=1, size(scene%boundaries))], adds_layer(scene%boundaries))
    do i = 1, size(counts)
      call make_layer(scene, delta, depth, body, n_body, claimed, owner, counts(i), layer, error)
      if (allocated(error)) return
      call append_points(body, layer)
    end do
  end subroutine add_layers

  !> The layer of one boundary.
  subroutine make_layer(scene, delta, depth, body, n_body, claimed, owner, tally, layer, error)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: delta                 !! horizon [m]
    real(wp), intent(in) :: depth                 !! what makes dx^dim a volume
    type(body_type), intent(in) :: body           !! its first `n_body` points are no layer
    integer, intent(in) :: n_body                 !! points of bodies
    type(lookup_type), intent(inout) :: claimed   !! cells that layers have
    integer(i2), allocatable, intent(inout) :: owner(:)  !! the boundary of each of these
    type(layer_count_type), intent(inout) :: tally  !! with the boundary's number; is filled in
    type(body_type), intent(out) :: layer         !! its points, on the grids of `body`
    type(error_type), allocatable, intent(out) :: error
    type(side_type), allocatable :: sides(:)
    type(body_type) :: part
    logical, allocatable :: chosen(:)
    integer :: axis, outward, i, n, first(3), last(3)

    associate (boundary => scene%boundaries(tally%boundary))
      axis = index('xyz', boundary%side(1:1))
      outward = merge(-1, 1, boundary%side(3:5) == 'min')
      call find_sides(scene, boundary%body, body, n_body, axis, outward, delta, sides)
      call choose_columns(body%dim, axis, outward, sides, tally)
      call allocate_points(layer, body%dim, 0)
      do i = 1, size(sides)
        if (.not. any(sides(i)%has)) cycle
        call box_of_layer(sides(i), axis, outward, first, last)
        call box_of_cells(body%dim, sides(i)%grid, first, last, depth, part)
        chosen = cells_of_layer(sides(i), axis, outward, first, last)
        n = count(chosen)
        call claim_cells(scene, tally%boundary, body, sides(i), first, last, claimed, owner, chosen)
        tally%shared = tally%shared + n - count(chosen)
        if (.not. all(chosen)) call keep_points(part, chosen)
        part%grid = sides(i)%number
        part%body = int(sides(i)%body, i2)
        part%material = sides(i)%material
        part%layer = int(tally%boundary, i2)
        call append_points(layer, part)
      end do
      if (layer%n_points > 0) return
      call scene_fault(error, scene, 'boundary', tally%boundary, 'side', 'the layer at side '''// &
        & trim(boundary%side)//''' joins no point', why_empty())
    end associate

  contains

    !> The error message for a layer without points.
    function why_empty() result(text)
      character(:), allocatable :: text

      if (size(sides) == 0) then
        text = 'every point of the body was removed'
      else if (all(sides%rows == 0)) then
        text = 'the horizon of '//with_unit(sides(1)%delta, 'm')// &
          & ' is shorter than the spacing of '//with_unit(sides(1)%grid%spacing, 'm')
      else
        text = 'all its cells belong to the layers of earlier &boundary groups'
      end if
    end function why_empty
  end subroutine make_layer

  !> The sides of the bodies that a boundary names, or of all lattice bodies, one for each level of
  !> their cells: those of which something is left.
  subroutine find_sides(scene, name, body, n_body, axis, outward, delta, sides)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: name       !! of the body, '' for all
    type(body_type), intent(in) :: body
    integer, intent(in) :: n_body          !! its first points, which are no layer
    integer, intent(in) :: axis            !! across the side: 1, 2, 3
    integer, intent(in) :: outward         !! 1 at an upper side, -1 at a lower one
    real(wp), intent(in) :: delta          !! horizon [m]
    type(side_type), allocatable, intent(out) :: sides(:)
      !! in the order of the bodies, the coarsest level first
    type(side_type), allocatable :: all_sides(:, :)
    integer :: b, c(2), k, n, cell(3), points(3), level, levels

    c = across(axis)
    levels = 0
    if (has_refinement(scene)) levels = maxval(scene%refines%levels)
    allocate (all_sides(0:levels, size(scene%bodies)))
    do k = 1, n_body
      b = body%body(k)
      if (body%grid(k) == 0) cycle
      if (name /= '' .and. scene%bodies(b)%name /= name) cycle
      level = level_of(body, k)
      associate (side => all_sides(level, b))
        if (side%number == 0_i2) then
          side%number = body%grid(k)
          side%material = body%material(k)
          side%body = b
          side%grid = finer(body%lattices(b)%grid, level)
          side%parts = 2**level
          side%delta = delta
          if (has_own_horizons(scene)) side%delta = scene%horizon%ratio*side%grid%spacing
          side%rows = layer_rows(side%delta, side%grid%spacing)
          points = body%lattices(b)%cells
          points(:body%dim) = points(:body%dim)*side%parts
          allocate (side%top(points(c(1)), points(c(2))), source=nothing)
          allocate (side%hidden(points(c(1)), points(c(2))), side%has(points(c(1)), &
            & points(c(2))), source=.false.)
        end if
        cell = cell_of(side%grid, body%x(k, :))
        side%top(cell(c(1)), cell(c(2))) = max(side%top(cell(c(1)), cell(c(2))), outward*cell(axis))
      end associate
    end do
    allocate (sides(count(all_sides%number /= 0_i2)))
    n = 0
    do b = 1, size(all_sides, 2)
      do level = 0, levels
        if (all_sides(level, b)%number == 0_i2) cycle
        n = n + 1
        sides(n) = all_sides(level, b)
      end do
    end do
  end subroutine find_sides

  !> The axes across an axis, in ascending order.
  pure function across(axis)
    integer, intent(in) :: axis
    integer :: across(2)
    across = pack([1, 2, 3], [1, 2, 3] /= axis)
  end function across

  !> Mark the columns that get the layer, and count.
  subroutine choose_columns(dim, axis, outward, sides, tally)
    integer, intent(in) :: dim                      !! of the scene
    integer, intent(in) :: axis, outward            !! as in `find_sides`
    type(side_type), intent(inout) :: sides(:)      !! `has` is set
    type(layer_count_type), intent(inout) :: tally  !! columns are added
    real(wp) :: outer(size(sides)), outermost
    integer :: i, j, first

    do i = 1, size(sides)
      outer(i) = face_of(sides(i), axis, outward, maxval(sides(i)%top))
    end do
    outermost = maxval(outer)
    do i = 1, size(sides)
      associate (side => sides(i), h => sides(i)%grid%spacing)
        do j = 1, size(sides)
          if (j == i .or. outermost - outer(i) > side%delta + same_place*h) cycle
          ! flat sides at one level, the usual case, hide nothing of each other
          if (outer(j) <= face_of(side, axis, outward, minval(side%top, &
            & mask=side%top /= nothing)) + same_place*h) cycle
          call hide(side, sides(j), dim, axis, outward, side%hidden)
        end do
        side%has = side%top /= nothing .and. .not. (side%hidden .or. too_far(side))
      end associate
    end do
    first = 1
    do i = 1, size(sides)
      if (i < size(sides)) then
        if (sides(i + 1)%body == sides(i)%body) cycle
      end if
      call count_columns(sides(first:i))
      first = i + 1
    end do

  contains

    !> Which columns begin farther in than the horizon.
    pure function too_far(side)
      type(side_type), intent(in) :: side
      logical :: too_far(size(side%top, 1), size(side%top, 2))
      integer :: m, n

      do n = 1, size(side%top, 2)
        do m = 1, size(side%top, 1)
          too_far(m, n) = .false.
          if (side%top(m, n) /= nothing) too_far(m, n) = outermost &
            & - face_of(side, axis, outward, side%top(m, n)) &
            & > side%delta + same_place*side%grid%spacing
        end do
      end do
    end function too_far

    !> Count the columns of one body, those of its lattice: one has the layer where a part of it
    !> has.
    subroutine count_columns(levels)
      type(side_type), intent(in) :: levels(:)  !! sides of the body
      integer, allocatable :: kind(:, :)
      integer, parameter :: empty = 0, farther_in = 1, covered = 2, joined = 3
      integer :: l, m, n, at(2), c(2), this

      if (.not. any([(any(levels(l)%has), l=1, size(levels))])) return
      c = across(axis)
      at = shape(levels(1)%top)
      where (c <= dim) at = at/levels(1)%parts
      allocate (kind(at(1), at(2)), source=empty)
      do l = 1, size(levels)
        associate (side => levels(l))
          do n = 1, size(side%top, 2)
            do m = 1, size(side%top, 1)
              if (side%top(m, n) == nothing) cycle
              this = farther_in
              if (side%hidden(m, n)) this = covered
              if (side%has(m, n)) this = joined
              at = [m, n]
              where (c <= dim) at = (at - 1)/side%parts + 1
              kind(at(1), at(2)) = max(kind(at(1), at(2)), this)
            end do
          end do
        end associate
      end do
      tally%columns = tally%columns + count(kind == joined)
      tally%farther_in = tally%farther_in + count(kind == farther_in)
      tally%empty = tally%empty + count(kind == empty)
      tally%covered = tally%covered + count(kind == covered)
    end subroutine count_columns
  end subroutine choose_columns

  !> How far out the outer face of a cell lies [m], growing outwards.
  pure real(wp) function face_of(side, axis, outward, level) result(face)
    type(side_type), intent(in) :: side
    integer, intent(in) :: axis, outward  !! as in `find_sides`
    integer, intent(in) :: level          !! height of the cell
    face = outward*side%grid%origin(axis) + (level + merge(1, 0, outward < 0)) &
      & *side%grid%spacing
  end function face_of

  !> Mark the columns of a side before which cells of `other` stand, seen from outside.
  subroutine hide(side, other, dim, axis, outward, hidden)
    type(side_type), intent(in) :: side      !! whose columns are looked at
    type(side_type), intent(in) :: other     !! of another body
    integer, intent(in) :: dim               !! of the scene
    integer, intent(in) :: axis, outward     !! as in `find_sides`
    logical, intent(inout) :: hidden(:, :)   !! the columns of `side`; marks are added
    real(wp) :: edge, face
    integer :: c(2), m, n, i, low(2), high(2)

    c = across(axis)
    do n = 1, size(other%top, 2)
      do m = 1, size(other%top, 1)
        if (other%top(m, n) == nothing) cycle
        ! the columns that this one overlaps
        low = 1
        high = 1
        do i = 1, 2
          if (c(i) > dim) cycle
          edge = (other%grid%origin(c(i)) - side%grid%origin(c(i)) &
            & + (merge(m, n, i == 1) - 1)*other%grid%spacing)/side%grid%spacing
          low(i) = floor(max(-1.0_wp, min(edge, size(side%top, i) + 1.0_wp)) + sliver) + 1
          edge = edge + other%grid%spacing/side%grid%spacing
          high(i) = ceiling(max(-1.0_wp, min(edge, size(side%top, i) + 1.0_wp)) - sliver)
        end do
        low = max(low, 1)
        high = min(high, shape(side%top))
        face = face_of(other, axis, outward, other%top(m, n))
        do i = low(2), high(2)
          hidden(low(1):high(1), i) = hidden(low(1):high(1), i) .or. &
            & ends_below(side%top(low(1):high(1), i), face)
        end do
      end do
    end do

  contains

    !> Whether columns with these levels end further in than `face`.
    elemental logical function ends_below(level, face) result(is_below)
      integer, intent(in) :: level
      real(wp), intent(in) :: face
      is_below = .false.
      if (level /= nothing) is_below = face_of(side, axis, outward, level) &
        & < face - same_place*side%grid%spacing
    end function ends_below
  end subroutine hide

  !> The box of cells first..last around the layer at one side, which some column has.
  pure subroutine box_of_layer(side, axis, outward, first, last)
    type(side_type), intent(in) :: side        !! with a column that has the layer
    integer, intent(in) :: axis, outward       !! as in `find_sides`
    integer, intent(out) :: first(3), last(3)  !! cells; last < first if it has no rows
    integer :: low, high

    first = 1
    last(across(axis)) = shape(side%top)
    low = minval(side%top, mask=side%has) + 1
    high = maxval(side%top, mask=side%has) + side%rows
    first(axis) = min(outward*low, outward*high)
    last(axis) = max(outward*low, outward*high)
    if (side%rows == 0) last(axis) = first(axis) - 1
  end subroutine box_of_layer

  !> Which cells of the box first..last, x fastest, belong to the layer at one side.
  pure function cells_of_layer(side, axis, outward, first, last) result(chosen)
    type(side_type), intent(in) :: side
    integer, intent(in) :: axis, outward      !! as in `find_sides`
    integer, intent(in) :: first(3), last(3)  !! of `box_of_layer`
    logical, allocatable :: chosen(:)
    integer :: c(2), i, j, k, n, level, at(3)

    c = across(axis)
    allocate (chosen(product(max(0, last - first + 1))))
    n = 0
    do k = first(3), last(3)
      do j = first(2), last(2)
        do i = first(1), last(1)
          n = n + 1
          at = [i, j, k]
          chosen(n) = side%has(at(c(1)), at(c(2)))
          if (.not. chosen(n)) cycle
          level = outward*at(axis) - side%top(at(c(1)), at(c(2)))
          chosen(n) = level > 0 .and. level <= side%rows
        end do
      end do
    end do
  end function cells_of_layer

  !> Where the corner between two sides is cut or round, both layers reach for the same cells: the
  !> earlier one has them, and they are taken from `chosen`. Two layers at one side, or of different
  !> bodies, must not meet like that; there the cells remain, and are found to overlap.
  subroutine claim_cells(scene, boundary, body, side, first, last, claimed, owner, chosen)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: boundary               !! number of the group
    type(body_type), intent(in) :: body           !! for its grids
    type(side_type), intent(in) :: side
    integer, intent(in) :: first(3), last(3)      !! the box of cells, x fastest
    type(lookup_type), intent(inout) :: claimed   !! cells that layers have
    integer(i2), allocatable, intent(inout) :: owner(:)  !! the boundary of each of these
    logical, intent(inout) :: chosen(:)           !! the layer's cells in the box
    logical :: is_new
    integer :: i, j, k, n, number, shift(3)
    integer(i8) :: key

    ! the numbers of cells count from the body's corner, bodies of one grid from different ones
    shift = 0
    shift(:body%dim) = nint(place_in(body%grids(side%number), side%grid%origin(:body%dim)))
    n = 0
    do k = first(3), last(3)
      do j = first(2), last(2)
        do i = first(1), last(1)
          n = n + 1
          if (.not. chosen(n)) cycle
          key = mix(mix(mix(int(side%number, i8), int(i + shift(1), i8)), int(j + shift(2), i8)), &
            & int(k + shift(3), i8))
          call claimed%number_of(key, number, is_new)
          if (is_new) then
            if (number > size(owner)) owner = [owner, spread(0_i2, 1, max(1024, number))]
            owner(number) = int(boundary, i2)
          else
            associate (earlier => scene%boundaries(owner(number)), &
              & this => scene%boundaries(boundary))
              chosen(n) = earlier%body /= this%body .or. earlier%side(1:1) == this%side(1:1)
            end associate
          end if
        end do
      end do
    end do
  end subroutine claim_cells

  !> What the user reads of a layer that does not cover its side; '' if it does.
  function layer_count_text(scene, tally) result(text)
    type(scene_type), intent(in) :: scene        !! gives the side of the boundary
    type(layer_count_type), intent(in) :: tally  !! of one layer
    character(:), allocatable :: text

    text = ''
    if (tally%farther_in + tally%empty + tally%covered + tally%shared == 0) return
    text = 'the layer of &boundary number '//to_text(tally%boundary)//' ('// &
      & trim(scene%boundaries(tally%boundary)%side)//') covers '//to_text(tally%columns)// &
      & ' of '//to_text(tally%columns + tally%farther_in + tally%empty + tally%covered)//' columns'
    if (tally%farther_in > 0) text = text//'; '//to_text(tally%farther_in)// &
      & ' begin farther in than the horizon'
    if (tally%empty > 0) text = text//'; '//to_text(tally%empty)//' hold no point'
    if (tally%covered > 0) text = text//'; '//to_text(tally%covered)//' lie behind another body'
    if (tally%shared > 0) text = text//'; an earlier layer has '//to_text(tally%shared)// &
      & ' of its points'
  end function layer_count_text

end module pd_body_layers
