!> Layers, the rows of points that `&boundary side` adds outside a side (doc/theory.md, 10).
!>
!> A layer continues the lattice of its body, column by column. Seen from the side, a column's layer
!> starts outside the outermost cell that is left of it, if that cell lies within the horizon of the
!> outermost cell of all columns. Where cells are refined, columns are those of the cells that stand
!> outermost, and their layers have the spacing and the horizon of these.
module pd_body_layers
  use pd_base_kinds, only: wp, i2, i8
  use pd_base_error, only: error_type
  use pd_base_text, only: to_text, with_unit
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: adds_layer, has_own_horizons, has_refinement, scene_type
  use pd_body_body, only: body_type, grid_type, lattice_type, allocate_points, append_points, &
    & keep_points
  use pd_body_lattices, only: box_of_cells, cell_of, place_in
  use pd_body_refine, only: finer, level_of
  implicit none (type, external)
  private
  public :: add_layers, layer_rows, layer_count_type, layer_count_text
  public :: layer_type, begin_layers, begin_side, see_points, choose_sides, box_of_layer, &
    & layer_cells, check_layer

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

  !> A layer in the making: first its sides see the points of the bodies, all at once or some after
  !> others, then its columns are chosen, then its cells are made.
  type :: layer_type
    type(layer_count_type) :: tally    !! with the boundary's number
    integer :: axis = 0                !! across the side: 1, 2, 3
    integer :: outward = 0             !! 1 at an upper side, -1 at a lower one
    type(side_type), allocatable :: of_body(:, :)  !! (0:levels, bodies) while points are seen
    type(side_type), allocatable :: sides(:)       !! those of which something is left
  end type layer_type

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
    type(layer_type), allocatable :: layers(:)
    type(body_type) :: layer, part
    integer :: i, s, shared, n_body, first(3), last(3)

    n_body = body%n_points
    call begin_layers(scene, layers)
    do i = 1, size(layers)
      call see_points(scene, body, n_body, layers(i))
      call choose_sides(scene, delta, body%dim, layers(i))
      call allocate_points(layer, body%dim, 0)
      do s = 1, size(layers(i)%sides)
        if (.not. any(layers(i)%sides(s)%has)) cycle
        call box_of_layer(layers(i), s, first, last)
        call layer_cells(scene, body%dim, body%grids, layers, i, s, first, last, depth, part, &
          & shared)
        layers(i)%tally%shared = layers(i)%tally%shared + shared
        call append_points(layer, part)
      end do
      call check_layer(scene, layers(i), int(layer%n_points, i8), error)
      if (allocated(error)) return
      call append_points(body, layer)
    end do
    counts = layers%tally
  end subroutine add_layers

  !> The layers of a scene, of which no points have been seen yet.
  subroutine begin_layers(scene, layers)
    type(scene_type), intent(in) :: scene                    !! a checked scene
    type(layer_type), allocatable, intent(out) :: layers(:)  !! in the order of the groups
    integer :: i, n, levels

    allocate (layers(count(adds_layer(scene%boundaries))))
    levels = 0
    if (has_refinement(scene)) levels = maxval(scene%refines%levels)
    n = 0
    do i = 1, size(scene%boundaries)
      if (.not. adds_layer(scene%boundaries(i))) cycle
      n = n + 1
      layers(n)%tally%boundary = i
      layers(n)%axis = index('xyz', scene%boundaries(i)%side(1:1))
      layers(n)%outward = merge(-1, 1, scene%boundaries(i)%side(3:5) == 'min')
      allocate (layers(n)%of_body(0:levels, size(scene%bodies)))
    end do
  end subroutine begin_layers

  !> An error, with its place, for a layer without a point.
  subroutine check_layer(scene, layer, points, error)
    type(scene_type), intent(in) :: scene   !! gives the boundary
    type(layer_type), intent(in) :: layer   !! with its sides
    integer(i8), intent(in) :: points       !! that it has
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: why

    if (points > 0_i8) return
    if (size(layer%sides) == 0) then
      why = 'every point of the body was removed'
    else if (all(layer%sides%rows == 0)) then
      why = 'the horizon of '//with_unit(layer%sides(1)%delta, 'm')// &
        & ' is shorter than the spacing of '//with_unit(layer%sides(1)%grid%spacing, 'm')
    else
      why = 'all its cells belong to the layers of earlier &boundary groups'
    end if
    associate (number => layer%tally%boundary)
      call scene_fault(error, scene, 'boundary', number, 'side', 'the layer at side '''// &
        & trim(scene%boundaries(number)%side)//''' joins no point', why)
    end associate
  end subroutine check_layer

  !> The points of a layer in the cells first..last of one of its sides, x fastest. Where the corner
  !> between two sides is cut or round, both layers reach for the same cells: the earlier one has
  !> them. Two layers at one side, or of different bodies, must not meet like that; there the cells
  !> remain, and are found to overlap.
  subroutine layer_cells(scene, dim, grids, layers, layer, side, first, last, depth, part, shared)
    type(scene_type), intent(in) :: scene       !! gives the boundaries
    integer, intent(in) :: dim                  !! of the scene
    type(grid_type), intent(in) :: grids(:)     !! all grids of the bodies
    type(layer_type), intent(in) :: layers(:)   !! this one and those before it have their sides
    integer, intent(in) :: layer, side          !! which layer, and which of its sides
    integer, intent(in) :: first(3), last(3)    !! cells of the side's grid
    real(wp), intent(in) :: depth               !! what makes dx^dim a volume
    type(body_type), intent(out) :: part        !! the points
    integer, intent(out) :: shared              !! cells that an earlier layer has
    logical, allocatable :: chosen(:)
    integer :: i, j, k, n, l

    associate (this => layers(layer)%sides(side), boundary => layers(layer)%tally%boundary)
      call box_of_cells(dim, this%grid, first, last, depth, part)
      chosen = cells_of_layer(layers(layer), side, first, last)
      shared = count(chosen)
      n = 0
      do k = first(3), last(3)
        do j = first(2), last(2)
          do i = first(1), last(1)
            n = n + 1
            if (.not. chosen(n)) cycle
            l = claimed_by(layers(:layer - 1), dim, grids(this%number), this, [i, j, k])
            if (l == 0) cycle
            associate (earlier => scene%boundaries(layers(l)%tally%boundary), &
              & own => scene%boundaries(boundary))
              chosen(n) = earlier%body /= own%body .or. earlier%side(1:1) == own%side(1:1)
            end associate
          end do
        end do
      end do
      shared = shared - count(chosen)
      if (.not. all(chosen)) call keep_points(part, chosen)
      part%grid = this%number
      part%body = int(this%body, i2)
      part%material = this%material
      part%layer = int(boundary, i2)
    end associate
  end subroutine layer_cells

  !> The first of some layers that has a cell of a side's grid; 0 if none has it.
  pure integer function claimed_by(layers, dim, grid, side, cell) result(l)
    type(layer_type), intent(in) :: layers(:)  !! with their sides
    integer, intent(in) :: dim                 !! of the scene
    type(grid_type), intent(in) :: grid        !! that the side and others are on
    type(side_type), intent(in) :: side        !! whose corner the cell counts from
    integer, intent(in) :: cell(3)
    integer :: s, c(2), at(3), level

    do l = 1, size(layers)
      c = across(layers(l)%axis)
      do s = 1, size(layers(l)%sides)
        associate (other => layers(l)%sides(s))
          if (other%number /= side%number) cycle
          ! cells are counted from the body's corner, and bodies of one grid have different ones
          at = cell
          at(:dim) = at(:dim) + nint(place_in(grid, side%grid%origin(:dim))) &
            & - nint(place_in(grid, other%grid%origin(:dim)))
          if (any(at(c) < 1 .or. at(c) > shape(other%top))) cycle
          if (.not. other%has(at(c(1)), at(c(2)))) cycle
          level = layers(l)%outward*at(layers(l)%axis) - other%top(at(c(1)), at(c(2)))
          if (level > 0 .and. level <= other%rows) return
        end associate
      end do
    end do
    l = 0
  end function claimed_by

  !> Look at points of bodies: the outermost cell of each column of the sides, one side for each
  !> level of the cells of a lattice body.
  subroutine see_points(scene, body, n_body, layer)
    type(scene_type), intent(in) :: scene     !! gives the boundary
    type(body_type), intent(in) :: body       !! some points or all, with the lattices of all bodies
    integer, intent(in) :: n_body             !! its first points, which are no layer
    type(layer_type), intent(inout) :: layer  !! from `begin_layers`; may have seen others
    integer :: b, c(2), k, cell(3), level
    logical :: refined

    c = across(layer%axis)
    refined = has_refinement(scene)
    level = 0
    associate (name => scene%boundaries(layer%tally%boundary)%body)
      do k = 1, n_body
        b = body%body(k)
        if (body%grid(k) == 0) cycle
        if (name /= '' .and. scene%bodies(b)%name /= name) cycle
        if (refined) level = level_of(body, k)
        associate (side => layer%of_body(level, b))
          if (side%number == 0_i2) call begin_side(body%dim, layer%axis, body%lattices(b), level, &
            & b, body%grid(k), body%material(k), side)
          cell = cell_of(side%grid, body%x(k, :))
          side%top(cell(c(1)), cell(c(2))) = max(side%top(cell(c(1)), cell(c(2))), &
            & layer%outward*cell(layer%axis))
        end associate
      end do
    end associate
  end subroutine see_points

  !> A side of which nothing has been seen.
  subroutine begin_side(dim, axis, lattice, level, body, grid, material, side)
    integer, intent(in) :: dim                  !! of the scene
    integer, intent(in) :: axis                 !! across the side: 1, 2, 3
    type(lattice_type), intent(in) :: lattice   !! of the body
    integer, intent(in) :: level                !! of its cells
    integer, intent(in) :: body                 !! its number
    integer(i2), intent(in) :: grid, material   !! numbers of those of the points
    type(side_type), intent(out) :: side
    integer :: c(2), points(3)

    c = across(axis)
    side%number = grid
    side%material = material
    side%body = body
    side%grid = finer(lattice%grid, level)
    side%parts = 2**level
    points = lattice%cells
    points(:dim) = points(:dim)*side%parts
    allocate (side%top(points(c(1)), points(c(2))), source=nothing)
    allocate (side%hidden(points(c(1)), points(c(2))), side%has(points(c(1)), points(c(2))), &
      & source=.false.)
  end subroutine begin_side

  !> When all points have been seen: the sides of which something is left, in the order of the
  !> bodies, the coarsest level first, and the columns that get the layer.
  subroutine choose_sides(scene, delta, dim, layer)
    type(scene_type), intent(in) :: scene     !! a checked scene
    real(wp), intent(in) :: delta             !! horizon, the largest one of all points [m]
    integer, intent(in) :: dim                !! of the scene
    type(layer_type), intent(inout) :: layer  !! gets its sides
    integer :: b, n, level

    allocate (layer%sides(count(layer%of_body%number /= 0_i2)))
    n = 0
    do b = 1, size(layer%of_body, 2)
      do level = 0, ubound(layer%of_body, 1)
        if (layer%of_body(level, b)%number == 0_i2) cycle
        n = n + 1
        layer%sides(n) = layer%of_body(level, b)
        associate (side => layer%sides(n))
          side%delta = delta
          if (has_own_horizons(scene)) side%delta = scene%horizon%ratio*side%grid%spacing
          side%rows = layer_rows(side%delta, side%grid%spacing)
        end associate
      end do
    end do
    deallocate (layer%of_body)
    call choose_columns(dim, layer%axis, layer%outward, layer%sides, layer%tally)
  end subroutine choose_sides

  !> The axes across an axis, in ascending order.
  pure function across(axis)
    integer, intent(in) :: axis
    integer :: across(2)
    across = pack([1, 2, 3], [1, 2, 3] /= axis)
  end function across

  !> Mark the columns that get the layer, and count.
  subroutine choose_columns(dim, axis, outward, sides, tally)
    integer, intent(in) :: dim                      !! of the scene
    integer, intent(in) :: axis, outward            !! as in `layer_type`
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
    integer, intent(in) :: axis, outward  !! as in `layer_type`
    integer, intent(in) :: level          !! height of the cell
    face = outward*side%grid%origin(axis) + (level + merge(1, 0, outward < 0)) &
      & *side%grid%spacing
  end function face_of

  !> Mark the columns of a side before which cells of `other` stand, seen from outside.
  subroutine hide(side, other, dim, axis, outward, hidden)
    type(side_type), intent(in) :: side      !! whose columns are looked at
    type(side_type), intent(in) :: other     !! of another body
    integer, intent(in) :: dim               !! of the scene
    integer, intent(in) :: axis, outward     !! as in `layer_type`
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

  !> The box of cells first..last around the layer at one of its sides, which some column has.
  pure subroutine box_of_layer(layer, s, first, last)
    type(layer_type), intent(in) :: layer      !! with its sides
    integer, intent(in) :: s                   !! which of them; some column of it has the layer
    integer, intent(out) :: first(3), last(3)  !! cells; last < first if it has no rows
    integer :: low, high

    associate (side => layer%sides(s), axis => layer%axis, outward => layer%outward)
      first = 1
      last(across(axis)) = shape(side%top)
      low = minval(side%top, mask=side%has) + 1
      high = maxval(side%top, mask=side%has) + side%rows
      first(axis) = min(outward*low, outward*high)
      last(axis) = max(outward*low, outward*high)
      if (side%rows == 0) last(axis) = first(axis) - 1
    end associate
  end subroutine box_of_layer

  !> Which of the cells first..last, x fastest, belong to the layer at one of its sides.
  pure function cells_of_layer(layer, s, first, last) result(chosen)
    type(layer_type), intent(in) :: layer     !! with its sides
    integer, intent(in) :: s                  !! which of them
    integer, intent(in) :: first(3), last(3)  !! in the box of `box_of_layer`
    logical, allocatable :: chosen(:)
    integer :: c(2), i, j, k, n, level, at(3)

    c = across(layer%axis)
    allocate (chosen(product(max(0, last - first + 1))))
    n = 0
    associate (side => layer%sides(s))
      do k = first(3), last(3)
        do j = first(2), last(2)
          do i = first(1), last(1)
            n = n + 1
            at = [i, j, k]
            chosen(n) = side%has(at(c(1)), at(c(2)))
            if (.not. chosen(n)) cycle
            level = layer%outward*at(layer%axis) - side%top(at(c(1)), at(c(2)))
            chosen(n) = level > 0 .and. level <= side%rows
          end do
        end do
      end do
    end associate
  end function cells_of_layer

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
