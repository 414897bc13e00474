!> Which places are inside of a surface: by the crossings of lines along x, and by the true winding
!> number where the surface has gaps or a line's crossings do not add up to zero.
module pd_body_surface_fill
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i1
  use pd_base_text, only: to_text, with_unit
  use pd_body_surface_edges, only: check_edges, edges_type
  use pd_body_surface_rows, only: bin_of, new_rows, row_windings, rows_type
  use pd_body_surface_stl, only: read_stl
  use pd_body_surface_surface, only: of_single, place_of_facet, surface_fault, surface_type, &
    & weld_vertices
  use pd_body_surface_winding, only: new_tree, tree_type, winding_number
  implicit none (type, external)
  private
  public :: solid_type, new_solid, read_solid, fill_cells, points_inside, gaps_text

  !> What counts as on the surface: parts of a spacing, and at most of that.
  real(wp), parameter :: touch = 1.0e-6_wp, most_touch = 1.0e-2_wp
  integer, parameter :: most_winding = 100
  real(wp), parameter :: hem = 0.5_wp   !! around holes, where seams may part [spacings]

  !> A surface with what finds its inside.
  type :: solid_type
    type(surface_type) :: surface
    type(edges_type) :: edges
    type(rows_type) :: rows
  end type solid_type

contains

  !> Read a surface and check it. An error, with its place, if it cannot be read, or has no inside.
  subroutine read_solid(path, scale, solid, error)
    character(*), intent(in) :: path          !! of the file
    real(wp), intent(in) :: scale             !! metres of one unit of the file
    type(solid_type), intent(out) :: solid    !! ready to be filled
    type(error_type), allocatable, intent(out) :: error

    call read_stl(path, scale, solid%surface, error)
    if (.not. allocated(error)) call new_solid(solid, error)
  end subroutine read_solid

  !> Check a surface and make what finds its inside. An error, with its place, if facets at an edge
  !> contradict each other, or if the surface is inside out or flat.
  subroutine new_solid(solid, error)
    type(solid_type), intent(inout) :: solid  !! with its surface
    type(error_type), allocatable, intent(out) :: error
    integer :: welded

    associate (surface => solid%surface)
      call check_edges(surface, solid%edges, error)
      if (allocated(error)) return
      if (solid%edges%n_open > 0) then
        call weld_vertices(surface, welded)
        if (welded > 0) call check_edges(surface, solid%edges, error)
        if (allocated(error)) return
      end if
      if (.not. surface%volume > 1.0e-12_wp*maxval(surface%high - surface%low)**3) then
        if (surface%volume < 0.0_wp) then
          call surface_fault(surface, 'the surface is inside out: its facets face inwards', error, &
            & 'the corners of each facet turn to the left, seen from outside', 1)
        else
          call surface_fault(surface, 'the surface holds no volume', error, &
            & 'the box around it is '//with_unit(surface%high(1) - surface%low(1), 'm', 4)//' by ' &
            & //with_unit(surface%high(2) - surface%low(2), 'm', 4)//' by '// &
            & with_unit(surface%high(3) - surface%low(3), 'm', 4), 1)
        end if
        return
      end if
      call new_rows(surface, solid%rows)
    end associate
  end subroutine new_solid

  !> What is said of open edges, of edges of many facets, and of facets without area; '' of none.
  function gaps_text(solid) result(text)
    type(solid_type), intent(in) :: solid  !! as `new_solid` made it
    character(:), allocatable :: text

    text = ''
    associate (surface => solid%surface, edges => solid%edges)
      if (edges%n_open > 0) text = text//'; '//to_text(edges%n_open)//' edges belong to one '// &
        & 'facet only, the first at '//place(edges%first_open)//': the inside is where the '// &
        & 'winding number is above 1/2'
      if (edges%n_many > 0) text = text//'; '//to_text(edges%n_many)//' edges have four facets '// &
        & 'or more, the first at '//place(edges%first_many)
      if (surface%n_flat > 0) text = text//'; '//to_text(surface%n_flat)//' facets have no '// &
        & 'area, the first at '//place_of_facet(surface%file, surface%first_flat, &
        & surface%line_flat)
      if (len(text) > 0) text = text(3:)
    end associate

  contains

    !> Where a facet is.
    function place(facet)
      integer, intent(in) :: facet
      character(:), allocatable :: place
      place = place_of_facet(solid%surface%file, int(solid%surface%number(facet)), &
        & int(solid%surface%line(facet)))
    end function place

  end function gaps_text

  !> How far a place is moved, the same along each axis, so that one on the surface counts as inside
  !> at its lower faces and as outside at its upper ones, whatever the rounding of the file.
  pure real(wp) function shift_of(surface, spacing) result(shift)
    type(surface_type), intent(in) :: surface
    real(wp), intent(in) :: spacing
    shift = touch*spacing + min(of_single*max(maxval(abs(surface%low)), &
      & maxval(abs(surface%high))), most_touch*spacing)
  end function shift_of

  !> The winding number, rounded, at the centre of each cell of a lattice. An error if the surface
  !> has a hole wider than some cells, or is inside out somewhere.
  subroutine fill_cells(solid, origin, spacing, cells, windings, error)
    type(solid_type), intent(in) :: solid     !! as `new_solid` made it
    real(wp), intent(in) :: origin(3)         !! lower corner of the first cell [m]
    real(wp), intent(in) :: spacing           !! edge of the cells [m]
    integer, intent(in) :: cells(3)           !! along each axis
    integer(i1), allocatable, intent(out) :: windings(:, :, :)  !! (cells)
    type(error_type), allocatable, intent(out) :: error
    logical(i1), allocatable :: doubtful(:, :, :)
    logical, allocatable :: again(:, :)
    type(tree_type) :: tree
    real(wp), allocatable :: x(:)
    integer, allocatable :: found(:)
    real(wp) :: start(3), winding
    integer :: i, j, k, at(3)
    logical :: balanced

    start = origin + shift_of(solid%surface, spacing)
    allocate (windings(cells(1), cells(2), cells(3)), again(cells(2), cells(3)))
    x = start(1) + spacing*[(i - 0.5_wp, i=1, cells(1))]
    !$omp parallel default(none) shared(solid, start, spacing, cells, windings, again, x) &
    !$omp private(j, k, found, balanced)
    allocate (found(cells(1)))
    !$omp do collapse(2) schedule(dynamic, 64)
    do k = 1, cells(3)
      do j = 1, cells(2)
        call row_windings(solid%surface, solid%rows, start(2) + spacing*(j - 0.5_wp), start(3) &
          & + spacing*(k - 0.5_wp), x, found, balanced)
        windings(:, j, k) = int(max(-most_winding, min(most_winding, found)), i1)
        again(j, k) = .not. balanced
      end do
    end do
    !$omp end parallel
    again = again .or. near_holes(solid%edges, origin(2:) + 0.5_wp*spacing, [spacing, spacing], &
      & cells(2:), hem*spacing)
    if (any(again)) then
      call new_tree(solid%surface, tree)
      allocate (doubtful(cells(1), cells(2), cells(3)), source=.false._i1)
      !$omp parallel do default(none) collapse(2) schedule(dynamic, 16) &
      !$omp shared(solid, tree, start, spacing, cells, windings, again, doubtful, x) &
      !$omp private(i, j, k, winding)
      do k = 1, cells(3)
        do j = 1, cells(2)
          if (.not. again(j, k)) cycle
          do i = 1, cells(1)
            winding = winding_number(solid%surface, tree, [x(i), start(2) + spacing*(j - 0.5_wp), &
              & start(3) + spacing*(k - 0.5_wp)])
            winding = max(-real(most_winding, wp), min(real(most_winding, wp), winding))
            windings(i, j, k) = nint(winding, i1)
            doubtful(i, j, k) = abs(winding - nint(winding)) > 0.25_wp
          end do
        end do
      end do
      call find_hole(doubtful, at)
      if (all(at > 0)) then
        if (solid%edges%first_open > 0) then
          call surface_fault(solid%surface, 'the surface is open: near '//place_text(at)// &
            & ' neither inside nor outside can be told', error, 'a gap may be about two cells '// &
            & 'wide; '//to_text(solid%edges%n_open)//' edges belong to one facet only', &
            & solid%edges%first_open)
        else
          call surface_fault(solid%surface, 'near '//place_text(at)//' the inside of the '// &
            & 'surface cannot be told', error, 'do its facets pass through each other?')
        end if
        return
      end if
    end if
    if (all(windings >= 0_i1)) return
    at = findloc(windings < 0_i1, .true.)
    call surface_fault(solid%surface, 'a shell of the surface is inside out, near '// &
      & place_text(at), error, 'outer shells face outwards, those of cavities into the cavity')

  contains

    !> Where the centre of a cell is.
    function place_text(cell) result(text)
      integer, intent(in) :: cell(3)
      character(:), allocatable :: text
      real(wp) :: place(3)

      place = origin + spacing*(cell - 0.5_wp)
      text = '('//to_text(place(1), 5)//', '//to_text(place(2), 5)//', '//to_text(place(3), 5)// &
        & ') m'
    end function place_text

  end subroutine fill_cells

  !> Which lines along x, on a grid over y and z, pass a hole within `reach`.
  pure function near_holes(edges, first, step, n, reach) result(near)
    type(edges_type), intent(in) :: edges
    real(wp), intent(in) :: first(2)         !! the first line [m]
    real(wp), intent(in) :: step(2)          !! from one to the next [m]
    integer, intent(in) :: n(2)              !! lines along y and z
    real(wp), intent(in) :: reach            !! [m]
    logical, allocatable :: near(:, :)
    integer, allocatable :: more(:, :)
    integer :: hole, low(2), high(2), k, j

    ! the corners of all boxes, summed up: no box is filled line by line
    allocate (more(0:n(1) + 1, 0:n(2) + 1), source=0)
    do hole = 1, size(edges%holes, 2)
      associate (box => edges%holes(:, hole))
        low = 1 + ceiling(max(-1.0_wp, min(real(n, wp), (box(2:3) - reach - first)/step)))
        high = 1 + floor(max(-1.0_wp, min(real(n, wp), (box(5:6) + reach - first)/step)))
      end associate
      low = max(1, low)
      high = min(n, high)
      if (any(low > high)) cycle
      more(low(1), low(2)) = more(low(1), low(2)) + 1
      more(high(1) + 1, low(2)) = more(high(1) + 1, low(2)) - 1
      more(low(1), high(2) + 1) = more(low(1), high(2) + 1) - 1
      more(high(1) + 1, high(2) + 1) = more(high(1) + 1, high(2) + 1) + 1
    end do
    do k = 1, n(2) + 1
      do j = 1, n(1) + 1
        more(j, k) = more(j, k) + more(j - 1, k) + more(j, k - 1) - more(j - 1, k - 1)
      end do
    end do
    near = more(1:n(1), 1:n(2)) > 0
  end function near_holes

  !> A cell that is in doubt as four of its six neighbours or more are, which those beyond the
  !> lattice count as; 0 if there is none. A hole as wide as two cells has no such cell.
  pure subroutine find_hole(doubtful, at)
    logical(i1), intent(in) :: doubtful(:, :, :)
    integer, intent(out) :: at(3)
    integer, parameter :: enough = 4
    integer :: i, j, k, n(3), axis, side, there(3), around

    n = shape(doubtful)
    at = 0
    do k = 1, n(3)
      do j = 1, n(2)
        do i = 1, n(1)
          if (.not. doubtful(i, j, k)) cycle
          around = 0
          do axis = 1, 3
            do side = -1, 1, 2
              there = [i, j, k]
              there(axis) = there(axis) + side
              if (there(axis) < 1 .or. there(axis) > n(axis)) then
                around = around + 1
              else if (doubtful(there(1), there(2), there(3))) then
                around = around + 1
              end if
            end do
          end do
          if (around < enough) cycle
          at = [i, j, k]
          return
        end do
      end do
    end do
  end subroutine find_hole

  !> Whether each of some places is inside of a surface.
  subroutine points_inside(solid, x, spacing, inside)
    type(solid_type), intent(in) :: solid            !! as `new_solid` made it
    real(wp), intent(in) :: x(:, :)                  !! (places, 3) [m]
    real(wp), intent(in) :: spacing                  !! of the points [m]
    logical, allocatable, intent(out) :: inside(:)   !! (places)
    type(tree_type) :: tree
    logical, allocatable :: again(:), open_bins(:, :)
    real(wp) :: shift, y, z, place(3)
    integer :: p, winding(1)
    logical :: balanced

    allocate (inside(size(x, 1)), again(size(x, 1)))
    associate (rows => solid%rows)
      open_bins = near_holes(solid%edges, rows%low + rows%width/2, rows%width, rows%n, &
        & hem*spacing + maxval(rows%width))
    end associate
    shift = shift_of(solid%surface, spacing)
    !$omp parallel do default(none) schedule(dynamic, 256) &
    !$omp shared(solid, x, shift, inside, again, open_bins) private(p, y, z, winding, balanced)
    do p = 1, size(x, 1)
      y = x(p, 2) + shift
      z = x(p, 3) + shift
      call row_windings(solid%surface, solid%rows, y, z, [x(p, 1) + shift], winding, balanced)
      inside(p) = winding(1) > 0
      again(p) = .not. balanced .or. open_bins(bin_of(solid%rows, 1, y), bin_of(solid%rows, 2, z))
    end do
    if (.not. any(again)) return
    call new_tree(solid%surface, tree)
    !$omp parallel do default(none) schedule(dynamic, 256) shared(solid, tree, x, inside, again) &
    !$omp private(p, place)
    do p = 1, size(x, 1)
      if (.not. again(p)) cycle
      place = x(p, :)
      inside(p) = winding_number(solid%surface, tree, place) > 0.5_wp
    end do
  end subroutine points_inside

end module pd_body_surface_fill
