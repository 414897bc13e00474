!> Places inside of the elements of a mesh, curved ones included.
module pd_body_mesh_inside
  use pd_base_kinds, only: wp, i4, i8
  use pd_body_mesh_elements, only: kind_pyramid, kind_tetrahedron, kind_triangle, kind_wedge, &
    & most_nodes, n_shapes, shape_functions, shape_type
  use pd_body_mesh_mesh, only: all_shapes, mesh_type
  implicit none (type, external)
  private
  public :: places_in_mesh

  !> The elements that reach into each cell of a grid around a mesh.
  type :: cells_type
    integer :: dim = 0
    integer(i8) :: counts(3) = 1
    real(wp) :: low(3) = 0.0_wp, edge(3) = 1.0_wp    !! corner and edges of a cell [m]
    integer(i8), allocatable :: first(:)             !! (cells + 1)
    integer(i4), allocatable :: element(:)
  end type cells_type

  integer, parameter :: most_steps = 40       !! of Newton's method
  real(wp), parameter :: bulge = 0.25_wp      !! of its box, that a curved element may stick out
  real(wp), parameter :: converged = 1.0e-11_wp  !! residual over the size of an element
  real(wp), parameter :: rounding = 1.0e-10_wp   !! of a size, that a place may be off

contains

  !> Whether places are inside of an element of a dimension; those on its surface are. The map of
  !> the element is inverted, so that its inside is curved as it is.
  subroutine places_in_mesh(mesh, dim, x, tolerance, inside)
    type(mesh_type), intent(in) :: mesh             !! checked, with elements of the dimension
    integer, intent(in) :: dim                      !! of the elements that count
    real(wp), intent(in) :: x(:, :)                 !! (places, dim) [m]
    real(wp), intent(in) :: tolerance               !! how far outside still counts [m]
    logical, allocatable, intent(out) :: inside(:)  !! (places)
    type(shape_type) :: shapes(n_shapes)
    type(cells_type) :: cells
    real(wp), allocatable :: box(:, :, :)
    integer(i8) :: cell, i
    integer :: p

    shapes = all_shapes()
    allocate (inside(size(x, 1)), source=.false.)
    if (size(x, 1) == 0) return
    call boxes_of(mesh, shapes, dim, tolerance, box)
    call sort_into_cells(box, dim, cells)
    !$omp parallel do default(none) shared(mesh, shapes, dim, x, tolerance, inside, box, cells) &
    !$omp private(cell, i) schedule(dynamic, 1024)
    do p = 1, size(x, 1)
      cell = cell_of(cells, x(p, :))
      if (cell == 0) cycle
      do i = cells%first(cell), cells%first(cell + 1) - 1
        if (any(x(p, :) < box(:dim, 1, cells%element(i)))) cycle
        if (any(x(p, :) > box(:dim, 2, cells%element(i)))) cycle
        inside(p) = in_element(mesh, shapes(mesh%shape(cells%element(i))), int(cells%element(i)), &
          & x(p, :), tolerance)
        if (inside(p)) exit
      end do
    end do
    !$omp end parallel do
  end subroutine places_in_mesh

  !> Boxes around the elements; of those that do not count, empty ones.
  pure subroutine boxes_of(mesh, shapes, dim, tolerance, box)
    type(mesh_type), intent(in) :: mesh
    type(shape_type), intent(in) :: shapes(:)
    integer, intent(in) :: dim
    real(wp), intent(in) :: tolerance
    real(wp), allocatable, intent(out) :: box(:, :, :)  !! (3, low and high, elements) [m]
    integer(i4), allocatable :: nodes(:)
    real(wp) :: more(3)
    integer :: e, c

    allocate (box(3, 2, mesh%n_elements))
    box(:, 1, :) = huge(1.0_wp)
    box(:, 2, :) = -huge(1.0_wp)
    do e = 1, mesh%n_elements
      if (mesh%shape(e) == 0) cycle
      if (shapes(mesh%shape(e))%dim /= dim) cycle
      nodes = mesh%nodes_of(e)
      do c = 1, 3
        box(c, :, e) = [minval(mesh%x(c, nodes)), maxval(mesh%x(c, nodes))]
      end do
      more = tolerance
      if (shapes(mesh%shape(e))%quadratic) more = more + bulge*maxval(box(:, 2, e) - box(:, 1, e))
      box(:, 1, e) = box(:, 1, e) - more
      box(:, 2, e) = box(:, 2, e) + more
    end do
  end subroutine boxes_of

  !> Sort elements into cells, about as many as there are elements.
  pure subroutine sort_into_cells(box, dim, cells)
    real(wp), intent(in) :: box(:, :, :)
    integer, intent(in) :: dim
    type(cells_type), intent(out) :: cells
    integer(i8) :: first(3), last(3), i, j, k, cell
    integer(i8), allocatable :: next(:)
    real(wp) :: size_of(3), edge
    integer :: e, c, pass, n

    cells%dim = dim
    n = 0
    do e = 1, size(box, 3)
      if (box(1, 1, e) <= box(1, 2, e)) n = n + 1
    end do
    size_of = 0.0_wp
    do c = 1, dim
      cells%low(c) = minval(box(c, 1, :))
      size_of(c) = maxval(box(c, 2, :)) - cells%low(c)
    end do
    ! Flat meshes have a side of no length
    size_of(:dim) = max(size_of(:dim), 1.0e-6_wp*maxval(size_of), tiny(1.0_wp))
    edge = (product(size_of(:dim))/max(1, n))**(1.0_wp/dim)
    cells%counts(:dim) = max(1_i8, int(size_of(:dim)/edge, i8))
    cells%edge(:dim) = size_of(:dim)/cells%counts(:dim)
    allocate (cells%first(product(cells%counts) + 1), source=0_i8)
    do pass = 1, 2
      do e = 1, size(box, 3)
        if (box(1, 1, e) > box(1, 2, e)) cycle
        first = places(box(:, 1, e))
        last = places(box(:, 2, e))
        do k = first(3), last(3)
          do j = first(2), last(2)
            do i = first(1), last(1)
              cell = number_of(cells, [i, j, k])
              if (pass == 1) then
                cells%first(cell + 1) = cells%first(cell + 1) + 1
              else
                cells%element(next(cell)) = int(e, i4)
                next(cell) = next(cell) + 1
              end if
            end do
          end do
        end do
      end do
      if (pass == 2) exit
      cells%first(1) = 1
      do cell = 2, size(cells%first, kind=i8)
        cells%first(cell) = cells%first(cell) + cells%first(cell - 1)
      end do
      allocate (cells%element(cells%first(size(cells%first)) - 1))
      next = cells%first
    end do

  contains

    !> The cell of a place within the grid.
    pure function places(x) result(place)
      real(wp), intent(in) :: x(3)
      integer(i8) :: place(3)

      place = 1
      place(:dim) = min(cells%counts(:dim), max(1_i8, 1 + int((x(:dim) - cells%low(:dim)) &
        & /cells%edge(:dim), i8)))
    end function places

  end subroutine sort_into_cells

  !> The number of a cell, x fastest.
  pure integer(i8) function number_of(cells, place)
    type(cells_type), intent(in) :: cells
    integer(i8), intent(in) :: place(3)
    number_of = place(1) + cells%counts(1)*(place(2) - 1 + cells%counts(2)*(place(3) - 1))
  end function number_of

  !> The number of the cell of a place; 0 outside of the grid.
  pure integer(i8) function cell_of(cells, x) result(number)
    type(cells_type), intent(in) :: cells
    real(wp), intent(in) :: x(:)
    integer(i8) :: place(3)
    real(wp) :: at(3)

    number = 0
    at = 0.0_wp
    at(:cells%dim) = (x - cells%low(:cells%dim))/cells%edge(:cells%dim)
    if (.not. all(at >= 0.0_wp .and. at <= cells%counts)) return
    place = min(cells%counts, 1 + int(at, i8))
    number = number_of(cells, place)
  end function cell_of

  !> Whether a place is inside of an element, or within the tolerance of the one that its reference
  !> coordinates are moved to if they are outside of the shape. They are sought from the centre,
  !> then from near each corner.
  logical function in_element(mesh, shape, e, x, tolerance) result(inside)
    type(mesh_type), intent(in) :: mesh
    type(shape_type), intent(in) :: shape
    integer, intent(in) :: e
    real(wp), intent(in) :: x(:), tolerance
    real(wp) :: nodes(3, most_nodes), values(most_nodes), gradients(3, most_nodes)
    real(wp) :: centre(3), xi(3), length, apart
    integer :: start
    logical :: found

    nodes(:, :shape%nodes) = mesh%x(:, mesh%nodes_of(e))
    length = maxval(maxval(nodes(:, :shape%nodes), dim=2) - minval(nodes(:, :shape%nodes), dim=2))
    centre = sum(shape%reference(:, :shape%corners), dim=2)/shape%corners
    inside = .false.
    do start = 0, shape%corners
      xi = centre
      if (start > 0) xi = (centre + shape%reference(:, start))/2
      call seek(shape, nodes(:, :shape%nodes), x, length, xi, found)
      if (.not. found) cycle
      call shape_functions(shape, place_in_shape(shape%kind, xi), values(:shape%nodes), &
        & gradients(:, :shape%nodes))
      apart = norm2(x - matmul(nodes(:shape%dim, :shape%nodes), values(:shape%nodes)))
      inside = apart <= max(tolerance, rounding*length)
      if (inside) return
      ! A curved map has other places, far outside; where edges are straight there is none
      if (.not. shape%quadratic .or. all(abs(xi - place_in_shape(shape%kind, xi)) < 1.0_wp)) return
    end do
  end function in_element

  !> Newton's method for the reference coordinates of a place, with steps that are halved until they
  !> come nearer.
  subroutine seek(shape, nodes, x, length, xi, found)
    type(shape_type), intent(in) :: shape
    real(wp), intent(in) :: nodes(:, :), x(:)
    real(wp), intent(in) :: length           !! of the element [m]
    real(wp), intent(inout) :: xi(3)         !! a start; where the place is
    logical, intent(out) :: found
    real(wp) :: values(most_nodes), gradients(3, most_nodes), apart(3), step(3), map(3, 3)
    real(wp) :: rest, before, old(3)
    integer :: i, half, d, n

    d = shape%dim
    n = shape%nodes
    found = .false.
    call look(xi)
    do i = 1, most_steps
      found = rest <= converged
      if (found) return
      map(:d, :d) = matmul(nodes(:d, :), transpose(gradients(:d, :n)))
      call solve(map(:d, :d), apart(:d), step(:d))
      ! far outside of any element
      if (.not. all(abs(step(:d)) <= 1.0e6_wp)) return
      old = xi
      before = rest
      do half = 0, 12
        xi(:d) = old(:d) + step(:d)/2.0_wp**half
        if (shape%kind == kind_pyramid) xi(3) = min(xi(3), 1 - 0.1_wp*(1 - old(3)))
        call look(xi)
        if (rest < before) exit
      end do
      if (.not. rest < before) then
        ! rounding, or nowhere
        found = rest <= 1.0e3_wp*converged
        return
      end if
    end do

  contains

    !> What is left between a place in reference coordinates and the one that is sought.
    subroutine look(at)
      real(wp), intent(in) :: at(3)

      call shape_functions(shape, at, values(:n), gradients(:, :n))
      apart = 0.0_wp
      apart(:d) = x - matmul(nodes(:d, :), values(:n))
      rest = norm2(apart)/length
    end subroutine look

  end subroutine seek

  !> Solve a system of one to three equations; without a solution `step` is huge.
  pure subroutine solve(map, right, step)
    real(wp), intent(in) :: map(:, :), right(:)
    real(wp), intent(out) :: step(:)
    real(wp) :: a(3), b(3), c(3), det

    select case (size(right))
    case (1)
      det = map(1, 1)
      step = right
    case (2)
      det = map(1, 1)*map(2, 2) - map(1, 2)*map(2, 1)
      step = [map(2, 2)*right(1) - map(1, 2)*right(2), map(1, 1)*right(2) - map(2, 1)*right(1)]
    case default
      a = map(:, 1)
      b = map(:, 2)
      c = map(:, 3)
      det = triple(a, b, c)
      step = [triple(right, b, c), triple(a, right, c), triple(a, b, right)]
    end select
    if (abs(det) > tiny(1.0_wp)) then
      step = step/det
    else
      step = huge(1.0_wp)
    end if
  end subroutine solve

  !> The determinant of three columns.
  pure real(wp) function triple(a, b, c)
    real(wp), intent(in) :: a(3), b(3), c(3)
    triple = a(1)*(b(2)*c(3) - b(3)*c(2)) - b(1)*(a(2)*c(3) - a(3)*c(2)) + c(1)*(a(2)*b(3) &
      & - a(3)*b(2))
  end function triple

  !> The place in a shape that is near a place in reference coordinates, which may be outside.
  pure function place_in_shape(kind, xi) result(place)
    integer, intent(in) :: kind     !! one of `kind_*`
    real(wp), intent(in) :: xi(3)
    real(wp) :: place(3)

    place = min(1.0_wp, max(-1.0_wp, xi))
    select case (kind)
    case (kind_triangle, kind_wedge)
      place(:2) = max(0.0_wp, xi(:2))
      place(:2) = place(:2)/max(1.0_wp, sum(place(:2)))
    case (kind_tetrahedron)
      place = max(0.0_wp, xi)
      place = place/max(1.0_wp, sum(place))
    case (kind_pyramid)
      place(3) = max(0.0_wp, place(3))
      place(:2) = min(1 - place(3), max(place(3) - 1, xi(:2)))
    case default  ! lines, quadrilaterals, hexahedra
      return
    end select
  end function place_in_shape

end module pd_body_mesh_inside
