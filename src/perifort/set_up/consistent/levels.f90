!> A preconditioner for the conditions on Gd in bodies where each bond has a weight of its own,
!> alone or together with those on Gb.
!>
!> Multipliers S (of theta) and w (of the force) give a bond (S_k + S_j):nn/2 - (w_j - w_k).n/|xi|,
!> which nearly vanishes where S is the symmetric gradient of a smooth w: the product of the
!> conditions with their transpose is like an operator of sixth order, and blocks of points alone
!> would need iterations by the cube of the body's width over its spacing. So w is also taken from
!> cubic B-splines on grids, each twice as wide as the one before (Bramble, Pasciak and Xu, Math.
!> Comput. 55 (1990) 1), with S = a grad w: diagonals on all but the widest, a factor on that.
module pd_set_up_consistent_levels
  use pd_base_kinds, only: wp, i4, i8
  use pd_set_up_consistent_conditions, only: conditions_type
  implicit none (type, external)
  private
  public :: level_type, new_levels, add_levels

  real(wp), parameter :: finest = 2.0_wp       !! width of the finest cells [mean spacings]
  integer, parameter :: most_of_widest = 340   !! unknowns of the widest grid
  integer, parameter :: packet = 256           !! bonds whose products are summed at once
  real(wp), parameter :: damping = 0.5_wp      !! of the diagonals, which overlap
  real(wp), parameter :: follows = 1.0e-10_wp  !! pivot of a row that follows from others [-]

  !> A grid of B-splines. A point sees four of them along each axis.
  type :: level_type
    integer :: dim = 0
    integer :: cells(3) = 1                      !! along each axis
    integer :: nodes(3) = 1                      !! splines along each axis: cells + 3
    integer(i4), allocatable :: cell(:, :)       !! (3, points) from 0
    real(wp), allocatable :: value(:, :, :)      !! (0:3, 3, points) of the splines [-]
    real(wp), allocatable :: slope(:, :, :)      !! (0:3, 3, points) [1/m]
    integer(i8), allocatable :: start(:)         !! (cells + 1) first in `order`
    integer(i4), allocatable :: order(:)         !! points cell by cell
    real(wp), allocatable :: inverse(:, :)       !! (dim, splines) of the diagonal
    real(wp), allocatable :: factor(:, :)        !! of the widest grid: of its scaled matrix
    real(wp), allocatable :: scale(:)            !! that makes its diagonal 1
    integer, allocatable :: chosen(:)            !! unknowns of the factor, in its order
  end type level_type

contains

  !> All grids of a body.
  subroutine new_levels(conditions, levels)
    type(conditions_type), intent(in) :: conditions  !! on Gd; each bond an unknown of its own
    type(level_type), allocatable, intent(out) :: levels(:)  !! the widest is the last
    type(level_type), allocatable :: more(:)
    real(wp) :: low(3), extent(3), width
    integer :: i

    low = 0.0_wp
    extent = 0.0_wp
    low(:conditions%dim) = minval(conditions%x, dim=2)
    extent(:conditions%dim) = maxval(conditions%x, dim=2) - low(:conditions%dim)
    width = finest*conditions%spacing
    allocate (levels(0))
    do
      allocate (more(size(levels) + 1))
      do i = 1, size(levels)
        more(i) = levels(i)
      end do
      call move_alloc(more, levels)
      associate (level => levels(size(levels)))
        call new_level(conditions, low, extent, width, level)
        if (conditions%dim*product(level%nodes) <= most_of_widest .or. all(level%cells == 1)) then
          call factorize(conditions, level)
          return
        end if
        call find_diagonal(conditions, level)
      end associate
      width = 2*width
    end do
  end subroutine new_levels

  !> A grid with cells about `width` wide.
  subroutine new_level(conditions, low, extent, width, level)
    type(conditions_type), intent(in) :: conditions
    real(wp), intent(in) :: low(3), extent(3), width
    type(level_type), intent(inout) :: level
    real(wp) :: edge, s
    integer(i8), allocatable :: next(:)
    integer :: d, k, c

    level%dim = conditions%dim
    level%cells(:level%dim) = max(1, nint(extent(:level%dim)/width))
    level%nodes(:level%dim) = level%cells(:level%dim) + 3
    allocate (level%cell(3, conditions%classes), source=0_i4)
    allocate (level%value(0:3, 3, conditions%classes), level%slope(0:3, 3, conditions%classes))
    do k = 1, conditions%classes
      do d = 1, level%dim
        edge = max(extent(d), width)/level%cells(d)
        s = (conditions%x(d, k) - low(d))/edge
        level%cell(d, k) = int(max(0, min(level%cells(d) - 1, int(s))), i4)
        s = s - level%cell(d, k)
        level%value(:, d, k) = [(1 - s)**3, 3*s**3 - 6*s**2 + 4, -3*s**3 + 3*s**2 + 3*s + 1, &
          & s**3]/6
        level%slope(:, d, k) = [-(1 - s)**2, 3*s**2 - 4*s, -3*s**2 + 2*s + 1, s**2]/(2*edge)
      end do
    end do
    ! points cell by cell, those of one cell in their order
    allocate (level%start(product(level%cells) + 1), source=0_i8)
    allocate (level%order(conditions%classes))
    do k = 1, conditions%classes
      c = cell_number(level, int(level%cell(:, k)))
      level%start(c + 1) = level%start(c + 1) + 1
    end do
    level%start(1) = 1_i8
    do c = 1, product(level%cells)
      level%start(c + 1) = level%start(c) + level%start(c + 1)
    end do
    next = level%start
    do k = 1, conditions%classes
      c = cell_number(level, int(level%cell(:, k)))
      level%order(next(c)) = int(k, i4)
      next(c) = next(c) + 1
    end do
  end subroutine new_level

  !> The number of a cell, from 1.
  pure integer function cell_number(level, cell) result(number)
    type(level_type), intent(in) :: level
    integer, intent(in) :: cell(3)  !! from 0
    number = 1 + cell(1) + level%cells(1)*(cell(2) + level%cells(2)*cell(3))
  end function cell_number

  !> The place of a spline, from 0, by its number from 1.
  pure function node_at(level, number) result(node)
    type(level_type), intent(in) :: level
    integer, intent(in) :: number
    integer :: node(3)
    node(1) = mod(number - 1, level%nodes(1))
    node(2) = mod((number - 1)/level%nodes(1), level%nodes(2))
    node(3) = (number - 1)/(level%nodes(1)*level%nodes(2))
  end function node_at

  !> The points that a spline reaches, cell by cell.
  pure subroutine points_under(level, node, points)
    type(level_type), intent(in) :: level
    integer, intent(in) :: node(3)                      !! from 0
    integer(i4), allocatable, intent(out) :: points(:)
    integer :: cell(3), number, i, j, l

    allocate (points(0))
    do l = 0, merge(3, 0, level%dim > 2)
      do j = 0, merge(3, 0, level%dim > 1)
        do i = 0, 3
          cell = node - [i, j, l]
          if (any(cell < 0) .or. any(cell >= level%cells)) cycle
          number = cell_number(level, cell)
          points = [points, level%order(level%start(number):level%start(number + 1) - 1)]
        end do
      end do
    end do
  end subroutine points_under

  !> A spline and its gradient at point k; 0 where it does not reach.
  pure subroutine spline_at(level, node, k, value, gradient)
    type(level_type), intent(in) :: level
    integer, intent(in) :: node(3)             !! from 0
    integer, intent(in) :: k                   !! point
    real(wp), intent(out) :: value             !! [-]
    real(wp), intent(out) :: gradient(3)       !! [1/m]
    real(wp) :: v(3)
    integer :: d, l

    value = 0.0_wp
    gradient = 0.0_wp
    v = 1.0_wp
    do d = 1, level%dim
      l = node(d) - level%cell(d, k)
      if (l < 0 .or. l > 3) return
      v(d) = level%value(l, d, k)
    end do
    value = product(v)
    do d = 1, level%dim
      gradient(d) = level%slope(node(d) - level%cell(d, k), d, k) &
        & *product(v, mask=[1, 2, 3] /= d)
    end do
  end subroutine spline_at

  !> What a spline of w along the bond's direction gives bond `u`, over the component of that
  !> direction.
  pure real(wp) function of_bond(conditions, level, node, u) result(q)
    type(conditions_type), intent(in) :: conditions
    type(level_type), intent(in) :: level
    integer, intent(in) :: node(3)
    integer, intent(in) :: u             !! unknown, with two ends, or one of an area; 0 of a Gb
    real(wp) :: value, gradient(3)
    integer(i8) :: e, i
    integer :: k

    q = 0.0_wp
    if (u <= conditions%stretches) return
    do i = conditions%first(u), conditions%first(u + 1) - 1
      e = conditions%bond(i)
      k = int(conditions%class(e))
      call spline_at(level, node, k, value, gradient)
      if (u > conditions%stretches + conditions%dilatations) gradient = 0.0_wp
      ! seen from the other end the direction is the opposite one
      q = q + conditions%strain(k)*conditions%factor(1, e)*dot_product(gradient(:level%dim), &
        & conditions%n(:, conditions%bond(conditions%first(u)))) &
        & + merge(1, -1, i == conditions%first(u))*conditions%shift(k)*conditions%factor(2, e)*value
    end do
  end function of_bond

  !> The diagonal of a grid's matrix.
  subroutine find_diagonal(conditions, level)
    type(conditions_type), intent(in) :: conditions
    type(level_type), intent(inout) :: level
    real(wp) :: diagonal(level%dim), part
    integer(i4), allocatable :: points(:)
    integer(i8) :: e
    integer :: number, node(3), i, k, j, u

    allocate (level%inverse(level%dim, product(level%nodes)))
    !$omp parallel do schedule(dynamic, 8) default(none) shared(conditions, level) &
    !$omp private(diagonal, part, points, e, number, node, i, k, j, u)
    do number = 1, product(level%nodes)
      node = node_at(level, number)
      diagonal = 0.0_wp
      call points_under(level, node, points)
      do i = 1, size(points)
        k = int(points(i))
        do e = conditions%start(k), conditions%start(k + 1) - 1
          u = int(conditions%unknown(e))
          if (u <= conditions%stretches) cycle
          part = of_bond(conditions, level, node, u)**2
          ! a bond with both ends here is met twice
          j = other_end(conditions, u, k)
          if (j > 0) then
            if (reaches(level, node, j)) part = part/2
          end if
          diagonal = diagonal + part*conditions%n(:, e)**2
        end do
      end do
      level%inverse(:, number) = diagonal
    end do
    part = follows*maxval(level%inverse)
    level%inverse = damping/max(level%inverse, part)
  end subroutine find_diagonal

  !> The point at the other end of a bond; 0 for an area.
  pure integer function other_end(conditions, u, k) result(j)
    type(conditions_type), intent(in) :: conditions
    integer, intent(in) :: u, k

    j = 0
    if (conditions%first(u + 1) - conditions%first(u) < 2) return
    j = int(conditions%class(conditions%bond(conditions%first(u))))
    if (j == k) j = int(conditions%class(conditions%bond(conditions%first(u) + 1)))
  end function other_end

  !> Whether a spline is not zero in the cell of point k.
  pure logical function reaches(level, node, k)
    type(level_type), intent(in) :: level
    integer, intent(in) :: node(3), k
    associate (d => node(:level%dim) - level%cell(:level%dim, k))
      reaches = all(d >= 0) .and. all(d <= 3)
    end associate
  end function reaches

  !> Cholesky's factor of the widest grid's matrix.
  subroutine factorize(conditions, level)
    type(conditions_type), intent(in) :: conditions
    type(level_type), intent(inout) :: level
    real(wp), allocatable :: of_bonds(:, :)
    real(wp) :: q
    integer :: n, nodes, first, last, u, number, column, dim

    dim = level%dim
    nodes = product(level%nodes)
    n = dim*nodes
    allocate (level%factor(n, n), source=0.0_wp)
    allocate (of_bonds(n, packet))
    do first = conditions%stretches + 1, conditions%unknowns, packet
      last = min(conditions%unknowns, first + packet - 1)
      !$omp parallel default(none) private(q, u, number, column) &
      !$omp shared(conditions, level, of_bonds, first, last, nodes, dim, n)
      !$omp do schedule(static)
      do u = first, last
        do number = 1, nodes
          q = of_bond(conditions, level, node_at(level, number), u)
          of_bonds(dim*(number - 1) + 1:dim*number, u - first + 1) = &
            & q*conditions%n(:, conditions%bond(conditions%first(u)))
        end do
      end do
      !$omp do schedule(static)
      do column = 1, n
        level%factor(:, column) = level%factor(:, column) + matmul(of_bonds(:, :last - first + 1), &
          & of_bonds(column, :last - first + 1))
      end do
      !$omp end parallel
    end do
    ! splines at the rim overlap few points: all have diagonals of 1
    allocate (level%scale(n), source=0.0_wp)
    do column = 1, n
      if (level%factor(column, column) > 0.0_wp) level%scale(column) = &
        & 1/sqrt(level%factor(column, column))
    end do
    do column = 1, n
      level%factor(:, column) = level%scale*level%factor(:, column)*level%scale(column)
    end do
    call factorize_pivoted(level%factor, level%chosen)
  end subroutine factorize

  !> Cholesky's factor of a semidefinite matrix with a diagonal of 1 or 0: rows in the order of the
  !> largest pivot, until what is left follows from those before. So no pivot is a rounding error,
  !> though all quadratic fields w are without effect.
  pure subroutine factorize_pivoted(f, chosen)
    real(wp), intent(inout) :: f(:, :)               !! the matrix; its factor in the chosen order
    integer, allocatable, intent(out) :: chosen(:)   !! rows in their order
    real(wp) :: left(size(f, 1)), column(size(f, 1))
    real(wp), allocatable :: factor(:, :)
    integer :: order(size(f, 1)), n, i, at

    n = size(f, 1)
    allocate (factor(n, n), source=0.0_wp)
    do i = 1, n
      left(i) = f(i, i)
    end do
    do i = 1, n
      at = maxloc(left, dim=1)
      if (.not. left(at) > follows) exit
      order(i) = at
      column = (f(:, at) - matmul(factor(:, :i - 1), factor(at, :i - 1)))/sqrt(left(at))
      left = left - column**2
      column(order(:i - 1)) = 0.0_wp
      left(order(:i)) = 0.0_wp
      factor(:, i) = column
    end do
    i = i - 1
    chosen = order(:i)
    f(:i, :i) = factor(chosen, :i)
  end subroutine factorize_pivoted

  !> Add to `w` what the grids give for the residual `r`.
  subroutine add_levels(conditions, levels, r, w)
    type(conditions_type), intent(in) :: conditions  !! of the grids
    type(level_type), intent(in) :: levels(:)        !! of `new_levels`
    real(wp), intent(in) :: r(:, :)                  !! (rows, points) [-]
    real(wp), intent(inout) :: w(:, :)               !! (rows, points), added to [-]
    real(wp), allocatable :: c(:, :)
    integer :: i

    do i = 1, size(levels)
      allocate (c(levels(i)%dim, product(levels(i)%nodes)))
      call gather(conditions, levels(i), r, c)
      if (allocated(levels(i)%factor)) then
        call solve(levels(i), c)
      else
        c = levels(i)%inverse*c
      end if
      call spread_out(conditions, levels(i), c, w)
      deallocate (c)
    end do
  end subroutine add_levels

  !> Solve by the factor of the widest grid.
  pure subroutine solve(level, c)
    type(level_type), intent(in) :: level
    real(wp), intent(inout) :: c(:, :)
    real(wp) :: all_of_it(size(c)), x(size(level%chosen))
    integer :: i

    all_of_it = level%scale*reshape(c, [size(c)])
    x = all_of_it(level%chosen)
    associate (f => level%factor)
      do i = 1, size(x)
        x(i) = (x(i) - dot_product(f(i, :i - 1), x(:i - 1)))/f(i, i)
      end do
      do i = size(x), 1, -1
        x(i) = (x(i) - dot_product(f(i + 1:size(x), i), x(i + 1:)))/f(i, i)
      end do
    end associate
    all_of_it = 0.0_wp
    all_of_it(level%chosen) = x
    c = reshape(level%scale*all_of_it, shape(c))
  end subroutine solve

  !> The rows of the conditions with the products of two components, behind those of the stretch.
  pure function rows_of(dim) result(rows)
    integer, intent(in) :: dim
    integer :: rows(3, 3)
    integer :: x, y, row

    rows = 0
    row = 0
    do x = 1, dim
      do y = x, dim
        row = row + 1
        rows(x, y) = row
        rows(y, x) = row
      end do
    end do
  end function rows_of

  !> The sums of a residual over splines: cell by cell over its points, then over the cells that a
  !> spline reaches, so that they have the same bits on any number of threads.
  subroutine gather(conditions, level, r, c)
    type(conditions_type), intent(in) :: conditions
    type(level_type), intent(in) :: level
    real(wp), intent(in) :: r(:, :)
    real(wp), intent(inout) :: c(:, :)  !! (dim, splines) set
    real(wp), allocatable :: of_cell(:, :, :)
    real(wp) :: shifts(3), strains(3, 3), value(64), gradient(3, 64)
    integer :: rows(3, 3), number, node(3), cell(3), i, k, l, m, n, x, dim, before

    dim = level%dim
    n = 4**dim
    before = conditions%before
    rows = rows_of(dim)
    allocate (of_cell(dim, n, product(level%cells)))
    !$omp parallel default(none) shared(conditions, level, r, c, of_cell, rows, dim, before, n) &
    !$omp private(shifts, strains, value, gradient, number, node, cell, i, k, l, m, x)
    !$omp do schedule(dynamic, 8)
    do number = 1, product(level%cells)
      of_cell(:, :, number) = 0.0_wp
      do i = int(level%start(number)), int(level%start(number + 1)) - 1
        k = int(level%order(i))
        call splines_at(level, k, value, gradient)
        shifts(:dim) = conditions%shift(k)*r(before + dim*(dim + 1)/2 + 1:before &
          & + dim*(dim + 1)/2 + dim, k)
        do x = 1, dim
          strains(:dim, x) = conditions%strain(k)*r(before + rows(:dim, x), k)
        end do
        do m = 1, n
          do x = 1, dim
            of_cell(x, m, number) = of_cell(x, m, number) + shifts(x)*value(m) &
              & + sum(strains(:dim, x)*gradient(:dim, m))
          end do
        end do
      end do
    end do
    !$omp do schedule(dynamic, 64)
    do number = 1, product(level%nodes)
      node = node_at(level, number)
      c(:, number) = 0.0_wp
      do m = 1, n
        l = m - 1
        cell = node - [mod(l, 4), mod(l/4, 4), l/16]
        if (any(cell < 0) .or. any(cell >= level%cells)) cycle
        c(:, number) = c(:, number) + of_cell(:, m, cell_number(level, cell))
      end do
    end do
    !$omp end parallel
  end subroutine gather

  !> All splines that reach point k, x fastest, and their gradients.
  pure subroutine splines_at(level, k, value, gradient)
    type(level_type), intent(in) :: level
    integer, intent(in) :: k                  !! point
    real(wp), intent(inout) :: value(:)       !! (4**dim) set [-]
    real(wp), intent(inout) :: gradient(:, :) !! (3, 4**dim) dim of them are set [1/m]
    real(wp) :: v, s
    integer :: m, n, i, j, d

    associate (of => level%value(:, :, k), slope => level%slope(:, :, k))
      value(:4) = of(:, 1)
      gradient(1, :4) = slope(:, 1)
      n = 4
      do d = 2, level%dim
        ! the first last, since the others are made of what it replaces
        do i = 4, 1, -1
          v = of(i, d)
          s = slope(i, d)
          do m = 1, n
            j = (i - 1)*n + m
            gradient(d, j) = value(m)*s
            gradient(:d - 1, j) = gradient(:d - 1, m)*v
            value(j) = value(m)*v
          end do
        end do
        n = 4*n
      end do
    end associate
  end subroutine splines_at

  !> The multipliers of splines, added to those of the points.
  subroutine spread_out(conditions, level, c, w)
    type(conditions_type), intent(in) :: conditions
    type(level_type), intent(in) :: level
    real(wp), intent(in) :: c(:, :)     !! (dim, splines)
    real(wp), intent(inout) :: w(:, :)  !! (rows, points), added to
    real(wp) :: shifts(3), strains(3, 3), value(64), gradient(3, 64)
    integer :: rows(3, 3), k, x, y, m, number, node(3), dim, l, before

    dim = level%dim
    before = conditions%before
    rows = rows_of(dim)
    !$omp parallel do schedule(static) default(none) &
    !$omp shared(conditions, level, c, w, dim, rows, before) &
    !$omp private(shifts, strains, value, gradient, k, x, y, m, number, node, l)
    do k = 1, conditions%classes
      call splines_at(level, k, value, gradient)
      shifts = 0.0_wp
      strains = 0.0_wp
      do m = 1, 4**dim
        l = m - 1
        node = level%cell(:, k) + [mod(l, 4), mod(l/4, 4), l/16]
        number = 1 + node(1) + level%nodes(1)*(node(2) + level%nodes(2)*node(3))
        do x = 1, dim
          shifts(x) = shifts(x) + value(m)*c(x, number)
          strains(:dim, x) = strains(:dim, x) + gradient(:dim, m)*c(x, number)
        end do
      end do
      do x = 1, dim
        associate (row => before + dim*(dim + 1)/2 + x)
          w(row, k) = w(row, k) + conditions%shift(k)*shifts(x)
        end associate
        do y = 1, dim
          associate (row => before + rows(x, y))
            w(row, k) = w(row, k) + conditions%strain(k)*strains(y, x)
          end associate
        end do
      end do
    end do
  end subroutine spread_out

end module pd_set_up_consistent_levels
