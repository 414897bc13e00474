!> Facets cut at the planes between the cells of a lattice, and the parts of cells that are inside.
!>
!> The volume inside of a cell is, by the theorem of Gauss along x, a sum over the pieces of facets
!> in the cell and in those before it in its row: integrals of polynomials of degree 2 over planar
!> pieces, which are exact.
module pd_body_surface_cut
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_lookup, only: lookup_type
  use pd_base_vectors, only: cross
  use pd_body_surface_surface, only: corners_of, surface_type
  implicit none (type, external)
  private
  public :: pieces_type, cut_facet, parts_type, cut_cells

  integer, parameter :: most_corners = 12  !! of a triangle cut by six planes: 9

  !> The pieces of one facet.
  type :: pieces_type
    integer :: n = 0
    integer, allocatable :: cell(:, :)       !! (3, n or more) from 1; any number along each axis
    integer, allocatable :: corners(:)       !! (n or more)
    real(wp), allocatable :: x(:, :, :)      !! (3, most_corners, n or more) in order [m]
  end type pieces_type

  !> Cells that a surface cuts, in the order of the lattice, x fastest.
  type :: parts_type
    integer :: n = 0
    integer, allocatable :: cell(:, :)       !! (3, n)
    real(wp), allocatable :: volume(:)       !! (n) inside of the surface [m3]
    real(wp), allocatable :: moment(:, :)    !! (3, n) its integral of the place from the cell's
                                             !! centre [m4]
  end type parts_type

contains

  !> Cut a facet at the planes origin + k spacing, along z, y and x.
  pure subroutine cut_facet(corners, origin, spacing, pieces)
    real(wp), intent(in) :: corners(3, 3)        !! a corner in each column [m]
    real(wp), intent(in) :: origin(3)            !! lower corner of cell 1 [m]
    real(wp), intent(in) :: spacing              !! edge of the cells [m]
    type(pieces_type), intent(inout) :: pieces   !! those of this facet on return
    real(wp) :: whole(3, most_corners)

    if (.not. allocated(pieces%cell)) allocate (pieces%cell(3, 64), pieces%corners(64), &
      & pieces%x(3, most_corners, 64))
    pieces%n = 0
    whole = 0.0_wp
    whole(:, :3) = corners
    call split(3, whole, 3, [1, 1, 1], origin, spacing, pieces)
  end subroutine cut_facet

  !> Cut a polygon along one axis and those before it.
  pure recursive subroutine split(axis, whole, n, cell, origin, spacing, pieces)
    integer, intent(in) :: axis
    real(wp), intent(in) :: whole(3, most_corners)
    integer, intent(in) :: n                    !! corners of the polygon
    integer, intent(in) :: cell(3)              !! where it is along the axes behind this one
    real(wp), intent(in) :: origin(3), spacing
    type(pieces_type), intent(inout) :: pieces
    real(wp) :: rest(3, most_corners), below(3, most_corners), above(3, most_corners), plane
    integer :: n_rest, n_below, n_above, k, last, at(3)

    rest = whole
    n_rest = n
    k = floor((minval(whole(axis, :n)) - origin(axis))/spacing) + 1
    last = floor((maxval(whole(axis, :n)) - origin(axis))/spacing) + 1
    at = cell
    do k = k, last
      at(axis) = k
      if (k == last) then
        below = rest
        n_below = n_rest
      else
        plane = origin(axis) + k*spacing
        call part(rest, n_rest, axis, plane, below, n_below, above, n_above)
        rest = above
        n_rest = n_above
      end if
      if (n_below >= 3) then
        if (axis > 1) then
          call split(axis - 1, below, n_below, at, origin, spacing, pieces)
        else
          call add_piece(pieces, at, below, n_below)
        end if
      end if
      if (n_rest < 3) exit
    end do
  end subroutine split

  !> Part a polygon at a plane.
  pure subroutine part(x, n, axis, plane, below, n_below, above, n_above)
    real(wp), intent(in) :: x(3, most_corners)
    integer, intent(in) :: n, axis
    real(wp), intent(in) :: plane
    real(wp), intent(out) :: below(3, most_corners), above(3, most_corners)
    integer, intent(out) :: n_below, n_above
    real(wp) :: here, there, cut(3)
    integer :: i, j

    below = 0.0_wp
    above = 0.0_wp
    n_below = 0
    n_above = 0
    do i = 1, n
      j = mod(i, n) + 1
      here = x(axis, i) - plane
      there = x(axis, j) - plane
      if (here <= 0.0_wp) call add(below, n_below, x(:, i))
      if (here >= 0.0_wp) call add(above, n_above, x(:, i))
      if (here*there >= 0.0_wp) cycle
      cut = x(:, i) + (x(:, j) - x(:, i))*(here/(here - there))
      cut(axis) = plane
      call add(below, n_below, cut)
      call add(above, n_above, cut)
    end do
    ! one that only touches the plane is on one side; one in the plane is above
    if (all(x(axis, :n) >= plane)) n_below = 0
    if (all(x(axis, :n) <= plane) .and. any(x(axis, :n) < plane)) n_above = 0
  end subroutine part

  !> Add a corner to a polygon.
  pure subroutine add(x, n, corner)
    real(wp), intent(inout) :: x(3, most_corners)
    integer, intent(inout) :: n
    real(wp), intent(in) :: corner(3)

    if (n == most_corners) return  ! a convex polygon has at most 9; rounding may add slivers
    n = n + 1
    x(:, n) = corner
  end subroutine add

  !> Add a piece.
  pure subroutine add_piece(pieces, cell, x, n)
    type(pieces_type), intent(inout) :: pieces
    integer, intent(in) :: cell(3)
    real(wp), intent(in) :: x(3, most_corners)
    integer, intent(in) :: n
    integer, allocatable :: cells(:, :)
    real(wp), allocatable :: corners(:, :, :)

    if (pieces%n == size(pieces%corners)) then
      allocate (cells(3, 2*pieces%n), corners(3, most_corners, 2*pieces%n))
      cells(:, :pieces%n) = pieces%cell
      corners(:, :, :pieces%n) = pieces%x
      call move_alloc(cells, pieces%cell)
      call move_alloc(corners, pieces%x)
      pieces%corners = [pieces%corners, pieces%corners]
    end if
    pieces%n = pieces%n + 1
    pieces%cell(:, pieces%n) = cell
    pieces%corners(pieces%n) = n
    pieces%x(:, :, pieces%n) = x
  end subroutine add_piece

  !> The cells of a lattice that a surface cuts, with their parts inside.
  subroutine cut_cells(surface, origin, spacing, cells, windings, parts)
    type(surface_type), intent(in) :: surface          !! finished
    real(wp), intent(in) :: origin(3)                  !! lower corner of the first cell [m]
    real(wp), intent(in) :: spacing                    !! edge of the cells [m]
    integer, intent(in) :: cells(3)                    !! along each axis
    integer(i1), intent(in) :: windings(:, :, :)       !! (cells) at the cells' centres
    type(parts_type), intent(out) :: parts             !! those with a facet in them
    type(lookup_type) :: table
    type(pieces_type) :: pieces
    real(wp), allocatable :: own(:, :), passed(:, :), longer(:, :)
    integer, allocatable :: cell(:, :), order(:)
    integer :: f, p, number, at(3)
    logical :: is_new

    ! per cell: volume and moment by its own pieces; area and its moments for the cells behind
    allocate (own(4, 4096), passed(3, 4096), cell(3, 4096))
    do f = 1, surface%n_facets
      call cut_facet(corners_of(surface, f), origin, spacing, pieces)
      do p = 1, pieces%n
        at = max(1, min(cells, pieces%cell(:, p)))
        call table%number_of(int(at(1), i8) + cells(1)*((at(2) - 1_i8) + cells(2)*(at(3) - 1_i8)), &
          & number, is_new)
        if (is_new) then
          if (number > size(own, 2)) then
            allocate (longer(4, 2*size(own, 2)), source=0.0_wp)
            longer(:, :size(own, 2)) = own
            call move_alloc(longer, own)
            allocate (longer(3, 2*size(passed, 2)), source=0.0_wp)
            longer(:, :size(passed, 2)) = passed
            call move_alloc(longer, passed)
            cell = reshape([cell, cell], [3, 2*size(cell, 2)])
          end if
          own(:, number) = 0.0_wp
          passed(:, number) = 0.0_wp
          cell(:, number) = at
        end if
        call add_integrals(pieces%x(:, :pieces%corners(p), p) - spread(origin + spacing &
          & *(at - 0.5_wp), 2, pieces%corners(p)), spacing, own(:, number), passed(:, number))
      end do
    end do
    parts%n = table%count
    call order_of_cells(cell(:, :parts%n), cells, order)
    parts%cell = cell(:, order)
    call sweep(parts, own(:, order), passed(:, order), spacing, windings)
  end subroutine cut_cells

  !> Add a piece's integrals, with places from the centre of its cell: of the column between the
  !> piece and the cell's upper face along x, and of the piece's shadow on that face.
  pure subroutine add_integrals(x, spacing, own, passed)
    real(wp), intent(in) :: x(:, :)           !! (3, corners) [m]
    real(wp), intent(in) :: spacing           !! [m]
    real(wp), intent(inout) :: own(4)         !! volume and moments
    real(wp), intent(inout) :: passed(3)      !! area and its moments along y and z
    real(wp) :: shadow, middle(3), vector(3), height
    integer :: i, m

    do i = 2, size(x, 2) - 1
      vector = cross(x(:, i) - x(:, 1), x(:, i + 1) - x(:, 1))/2
      ! the inside is behind facets that face against x
      shadow = -vector(1)/3
      if (abs(shadow) <= 0.0_wp) cycle
      do m = 1, 3
        ! the middles of the edges integrate degree 2
        select case (m)
        case (1); middle = (x(:, 1) + x(:, i))/2
        case (2); middle = (x(:, i) + x(:, i + 1))/2
        case default; middle = (x(:, i + 1) + x(:, 1))/2
        end select
        height = spacing/2 - middle(1)
        own = own + shadow*[height, height*(spacing/2 + middle(1))/2, height*middle(2), &
          & height*middle(3)]
        passed = passed + shadow*[1.0_wp, middle(2), middle(3)]
      end do
    end do
  end subroutine add_integrals

  !> The order of cells along the lattice, x fastest.
  subroutine order_of_cells(cell, cells, order)
    integer, intent(in) :: cell(:, :)
    integer, intent(in) :: cells(3)
    integer, allocatable, intent(out) :: order(:)
    integer, allocatable :: start(:), before(:)
    integer :: axis, i

    ! by x, then by y, then by z, each time keeping the order that is there
    order = [(i, i=1, size(cell, 2))]
    do axis = 1, 3
      if (allocated(start)) deallocate (start)
      allocate (start(cells(axis) + 1), source=0)
      do i = 1, size(order)
        associate (n => start(cell(axis, i) + 1))
          n = n + 1
        end associate
      end do
      do i = 2, size(start)
        start(i) = start(i) + start(i - 1)
      end do
      before = order
      do i = 1, size(order)
        associate (n => start(cell(axis, before(i))))
          n = n + 1
          order(n) = before(i)
        end associate
      end do
    end do
  end subroutine order_of_cells

  !> Volumes and moments: what is passed along a row adds up, and begins anew behind cells that are
  !> not cut, which are inside or outside as a whole. So a gap spoils no more than the cells at it.
  subroutine sweep(parts, own, passed, spacing, windings)
    type(parts_type), intent(inout) :: parts
    real(wp), intent(in) :: own(:, :), passed(:, :)
    real(wp), intent(in) :: spacing
    integer(i1), intent(in) :: windings(:, :, :)
    real(wp) :: carried(3), volume
    integer :: p, before(3)

    allocate (parts%volume(parts%n), parts%moment(3, parts%n))
    before = 0
    carried = 0.0_wp
    do p = 1, parts%n
      associate (at => parts%cell(:, p))
        if (any(at /= before + [1, 0, 0])) then
          carried = 0.0_wp
          if (at(1) > 1) then
            if (windings(at(1) - 1, at(2), at(3)) > 0_i1) carried(1) = spacing**2
          end if
        end if
        volume = own(1, p) + carried(1)*spacing
        parts%moment(:, p) = [own(2, p), own(3:4, p) + carried(2:)*spacing]
        ! rounding, gaps and shells within each other may leave the range of a cell
        parts%volume(p) = max(0.0_wp, min(spacing**3, volume))
        if (volume > spacing**3*(1 + 1.0e-9_wp) .or. volume < 0.0_wp) parts%moment(:, p) = 0.0_wp
        carried = carried + passed(:, p)
        before = at
      end associate
    end do
  end subroutine sweep

end module pd_body_surface_cut
