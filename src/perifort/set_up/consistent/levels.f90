!> A preconditioner for the conditions on weights, with smooth multipliers.
!>
!> Multipliers z of the stretch give a bond (z_j - z_k):nnn, which is small where z is smooth: the
!> product of the conditions with their transpose is like an operator of second order. Multipliers S
!> of theta and w of the force give (S_k + S_j):nn/2 - (w_j - w_k).n/|xi|, which nearly vanishes
!> where S is the symmetric gradient of a smooth w: that is like one of sixth order. Blocks of
!> points alone would need iterations by the width of the body over its spacing, or by its cube. So
!> z, and w with S = a grad w, are also taken from cubic B-splines on grids, each twice as wide as
!> the one before (Bramble, Pasciak and Xu, Math. Comput. 55 (1990) 1), with diagonals; w on the
!> widest grid with a factor.
module pd_set_up_consistent_levels
  use pd_base_kinds, only: wp, i4, i8
  use pd_set_up_consistent_conditions, only: area_products, conditions_type, kind_of, &
    & of_dilatation, of_stretches, triple_products
  use pd_set_up_consistent_splines, only: find_children, forget_points, grid_type, place_points, &
    & shares, spline_at, splines_at, values_at
  implicit none (type, external)
  private
  public :: level_type, new_levels, add_levels

  real(wp), parameter :: finest = 2.0_wp       !! width of the finest cells [mean spacings]
  integer, parameter :: narrow = 20            !! points across that need no grids of z
  integer, parameter :: most_of_widest = 340   !! unknowns of the widest grid of w
  integer, parameter :: packet = 256           !! bonds whose products are summed at once
  real(wp), parameter :: damping = 0.5_wp      !! of the diagonals, which overlap
  real(wp), parameter :: follows = 1.0e-10_wp  !! pivot of a row that follows from others [-]

  !> A grid of B-splines, for z or for w, and the inverse of its matrix.
  type, extends(grid_type) :: level_type
    logical :: of_stretch = .false.              !! whether the splines are those of z
    integer :: components = 0                    !! of z, or of w
    real(wp), allocatable :: inverse(:, :)       !! (components, splines) of the diagonal
    real(wp), allocatable :: factor(:, :)        !! of the widest grid: of its scaled matrix
    real(wp), allocatable :: scale(:)            !! that makes its diagonal 1
    integer, allocatable :: chosen(:)            !! unknowns of the factor, in its order
  end type level_type

contains

  !> All grids of a body.
  subroutine new_levels(conditions, levels)
    type(conditions_type), intent(in) :: conditions          !! on Gb, Gd or both
    type(level_type), allocatable, intent(out) :: levels(:)
      !! from fine to wide: those of z, if the body is wide, then those of w

    allocate (levels(0))
    if (conditions%stretches > 0 .and. conditions%classes > narrow**conditions%dim) &
      & call append_levels(conditions, .true., levels)
    if (conditions%dilatations > 0) call append_levels(conditions, .false., levels)
  end subroutine new_levels

  !> The grids of z or of w.
  subroutine append_levels(conditions, of_stretch, levels)
    type(conditions_type), intent(in) :: conditions
    logical, intent(in) :: of_stretch
    type(level_type), allocatable, intent(inout) :: levels(:)
    type(level_type), allocatable :: more(:)
    integer(i4), allocatable :: numbers(:), finer(:)
    real(wp) :: low(conditions%dim), edge(conditions%dim)
    integer :: cells(conditions%dim), fine(conditions%dim)
    logical :: widest

    low = minval(conditions%x, dim=2)
    edge = finest*conditions%spacing
    cells = int((maxval(conditions%x, dim=2) - low)/edge) + 1
    do
      allocate (more(size(levels) + 1))
      more(:size(levels)) = levels
      call move_alloc(more, levels)
      associate (level => levels(size(levels)))
        level%of_stretch = of_stretch
        level%components = merge(conditions%before, conditions%dim, of_stretch)
        call place_points(conditions%x, low, edge, cells, level%grid_type, numbers)
        widest = all(cells == 1)
        if (.not. of_stretch) widest = widest .or. &
          & level%dim*(size(level%first) - 1) <= most_of_widest
        if (widest .and. .not. of_stretch) then
          call factorize(conditions, level)
        else
          call find_diagonal(conditions, level)
        end if
        if (allocated(finer)) then
          call find_children(cells, fine, numbers, finer, level%grid_type)
          call forget_points(level%grid_type)
        end if
      end associate
      if (widest) return
      call move_alloc(numbers, finer)
      fine = cells
      cells = (cells + 1)/2
      edge = 2*edge
    end do
  end subroutine append_levels

  !> What a spline at point k, as any component, gives the unknown of bond `e` of k, over
  !> `pattern_of` that unknown and component.
  pure real(wp) function share_of(conditions, of_stretch, k, e, value, gradient) result(share)
    type(conditions_type), intent(in) :: conditions
    logical, intent(in) :: of_stretch
    integer, intent(in) :: k
    integer(i8), intent(in) :: e
    real(wp), intent(in) :: value, gradient(:)
    real(wp) :: along
    integer :: kind

    share = 0.0_wp
    kind = kind_of(conditions, int(conditions%unknown(e)))
    if (kind == merge(of_dilatation, of_stretches, of_stretch)) return
    associate (n => conditions%n(conditions%bond(conditions%first(conditions%unknown(e))), :), &
      & f => conditions%factor(e, :))
      ! seen from the other end the direction is the opposite one
      along = sign(1.0_wp, dot_product(n, conditions%n(e, :)))
      if (of_stretch) then
        share = along*conditions%stiffness(k)*f(1)*value
      else
        share = along*conditions%shift(k)*f(2)*value
        if (kind == of_dilatation) share = share &
          & + conditions%strain(k)*f(1)*dot_product(gradient, n)
      end if
    end associate
  end function share_of

  !> What the shares of an unknown are multiplied with for each component.
  pure subroutine pattern_of(conditions, of_stretch, u, pattern)
    type(conditions_type), intent(in) :: conditions
    logical, intent(in) :: of_stretch
    integer, intent(in) :: u
    real(wp), intent(inout) :: pattern(:)  ! (components) set

    associate (n => conditions%n(conditions%bond(conditions%first(u)), :))
      if (.not. of_stretch) then
        pattern = n
      else if (kind_of(conditions, u) == of_stretches) then
        call triple_products(n, pattern)
      else
        call area_products(n, pattern)
      end if
    end associate
  end subroutine pattern_of

  !> The diagonal of a grid's matrix.
  subroutine find_diagonal(conditions, level)
    type(conditions_type), intent(in) :: conditions
    type(level_type), intent(inout) :: level
    real(wp), allocatable :: share(:), diagonal(:), pattern(:)
    integer(i4), allocatable :: seen(:), met(:)
    real(wp) :: value, gradient(level%dim), part
    integer(i8) :: e
    integer :: s, i, p, k, u, n

    allocate (level%inverse(level%components, size(level%first) - 1))
    !$omp parallel default(none) shared(conditions, level) &
    !$omp private(share, diagonal, pattern, seen, met, value, gradient, part, e, s, i, p, k, u, n)
    allocate (share(conditions%unknowns), met(conditions%unknowns))
    allocate (seen(conditions%unknowns), source=0_i4)
    allocate (diagonal(level%components), pattern(level%components))
    !$omp do schedule(dynamic, 8)
    do s = 1, size(level%first) - 1
      n = 0
      do i = level%first(s), level%first(s + 1) - 1
        associate (cell => level%under(1, i))
          do p = level%start(cell), level%start(cell + 1) - 1
            k = int(level%order(p))
            call spline_at(level%grid_type, int(level%under(2, i)), k, value, &
              & gradient)
            do e = conditions%start(k), conditions%start(k + 1) - 1
              u = int(conditions%unknown(e))
              part = share_of(conditions, level%of_stretch, k, e, value, gradient)
              if (seen(u) == s) then
                share(u) = share(u) + part
              else
                seen(u) = int(s, i4)
                share(u) = part
                n = n + 1
                met(n) = int(u, i4)
              end if
            end do
          end do
        end associate
      end do
      diagonal = 0.0_wp
      do i = 1, n
        u = int(met(i))
        if (.not. abs(share(u)) > 0.0_wp) cycle
        call pattern_of(conditions, level%of_stretch, u, pattern)
        diagonal = diagonal + (share(u)*pattern)**2
      end do
      level%inverse(:, s) = diagonal
    end do
    !$omp end parallel
    part = follows*maxval(level%inverse)
    level%inverse = damping/max(level%inverse, part)
  end subroutine find_diagonal

  !> Cholesky's factor of the matrix of the widest grid of w.
  subroutine factorize(conditions, level)
    type(conditions_type), intent(in) :: conditions
    type(level_type), intent(inout) :: level
    real(wp), allocatable :: of_bonds(:, :)
    real(wp) :: value(64), gradient(3, 64), share
    integer(i8) :: i, e
    integer :: n, first, last, u, m, k, at, column, dim

    dim = level%dim
    n = dim*(size(level%first) - 1)
    allocate (level%factor(n, n), source=0.0_wp)
    allocate (of_bonds(n, packet))
    do first = conditions%stretches + 1, conditions%unknowns, packet
      last = min(conditions%unknowns, first + packet - 1)
      !$omp parallel default(none) private(value, gradient, share, i, e, u, m, k, at, column) &
      !$omp shared(conditions, level, of_bonds, first, last, dim, n)
      !$omp do schedule(dynamic, 16)
      do u = first, last
        of_bonds(:, u - first + 1) = 0.0_wp
        do i = conditions%first(u), conditions%first(u + 1) - 1
          e = conditions%bond(i)
          k = int(conditions%class(e))
          call splines_at(level%grid_type, k, value, gradient)
          do m = 1, 4**dim
            share = share_of(conditions, .false., k, e, value(m), gradient(:dim, m))
            at = dim*(level%spline(m, level%cell(k)) - 1)
            of_bonds(at + 1:at + dim, u - first + 1) = of_bonds(at + 1:at + dim, u - first + 1) &
              & + share*conditions%n(conditions%bond(conditions%first(u)), :)
          end do
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
    integer :: i, first

    first = 1
    do i = 1, size(levels)
      if (i < size(levels)) then
        if (allocated(levels(i + 1)%child)) cycle
      end if
      call add_grids(conditions, levels(first:i), r, w)
      first = i + 1
    end do
  end subroutine add_levels

  !> Add what the grids of z or of w give.
  subroutine add_grids(conditions, levels, r, w)
    type(conditions_type), intent(in) :: conditions
    type(level_type), intent(in) :: levels(:)
    real(wp), intent(in) :: r(:, :)
    real(wp), intent(inout) :: w(:, :)
    type :: values_type
      real(wp), allocatable :: c(:, :)  ! (components, splines)
    end type values_type
    type(values_type) :: of(size(levels))
    integer :: i

    allocate (of(1)%c(levels(1)%components, size(levels(1)%first) - 1))
    call gather(conditions, levels(1), r, of(1)%c)
    do i = 2, size(levels)
      allocate (of(i)%c(levels(i)%components, size(levels(i)%child, 2)))
      call sum_children(levels(i), of(i - 1)%c, of(i)%c)
    end do
    do i = size(levels), 1, -1
      associate (level => levels(i))
        if (allocated(level%factor)) then
          call solve(level, of(i)%c)
        else
          of(i)%c = level%inverse*of(i)%c
        end if
      end associate
      if (i < size(levels)) call add_parents(levels(i + 1), of(i + 1)%c, of(i)%c)
    end do
    call spread_out(conditions, levels(1), of(1)%c, w)
  end subroutine add_grids

  !> The sums over a grid's splines, from those over the splines of the next finer grid.
  subroutine sum_children(level, finer, c)
    type(level_type), intent(in) :: level
    real(wp), intent(in) :: finer(:, :)  ! (components, splines of the finer grid)
    real(wp), intent(inout) :: c(:, :)   ! (components, splines) set
    real(wp) :: share(5**level%dim)
    integer :: s, m

    share = shares(level%dim)
    !$omp parallel do schedule(static) default(none) shared(level, finer, c, share) private(s, m)
    do s = 1, size(c, 2)
      c(:, s) = 0.0_wp
      do m = 1, size(share)
        if (level%child(m, s) == 0) cycle
        c(:, s) = c(:, s) + share(m)*finer(:, level%child(m, s))
      end do
    end do
  end subroutine sum_children

  !> Add what the splines of a grid are to those of the next finer one, `finer`.
  subroutine add_parents(level, c, finer)
    type(level_type), intent(in) :: level
    real(wp), intent(in) :: c(:, :)         ! (components, splines)
    real(wp), intent(inout) :: finer(:, :)  ! (components, splines of the finer grid)
    real(wp) :: share(5**level%dim)
    integer :: s, i

    share = shares(level%dim)
    !$omp parallel do schedule(static) default(none) shared(level, finer, c, share) private(s, i)
    do s = 1, size(finer, 2)
      do i = level%above(s), level%above(s + 1) - 1
        finer(:, s) = finer(:, s) + share(level%parent(2, i))*c(:, level%parent(1, i))
      end do
    end do
  end subroutine add_parents

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
        x(i) = x(i)/f(i, i)
        x(i + 1:) = x(i + 1:) - x(i)*f(i + 1:size(x), i)
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
    real(wp), intent(inout) :: c(:, :)  !! (components, splines) set
    real(wp), allocatable :: of_cell(:, :, :)
    real(wp) :: fields(level%components), strains(3, 3), value(64), gradient(3, 64)
    integer :: rows(3, 3), cell, i, k, m, s, x, dim, before, splines

    dim = level%dim
    splines = 4**dim
    before = conditions%before
    rows = rows_of(dim)
    strains = 0.0_wp
    allocate (of_cell(level%components, splines, size(level%start) - 1))
    !$omp parallel default(none) shared(conditions, level, r, c, of_cell, rows, dim, before) &
    !$omp shared(splines) private(fields, strains, value, gradient, cell, i, k, m, s, x)
    !$omp do schedule(dynamic, 8)
    do cell = 1, size(of_cell, 3)
      of_cell(:, :, cell) = 0.0_wp
      do i = int(level%start(cell)), int(level%start(cell + 1)) - 1
        k = int(level%order(i))
        if (level%of_stretch) then
          call values_at(level%grid_type, k, value)
          fields = conditions%stiffness(k)*r(:before, k)
          do m = 1, splines
            of_cell(:, m, cell) = of_cell(:, m, cell) + fields*value(m)
          end do
          cycle
        end if
        call splines_at(level%grid_type, k, value, gradient)
        fields = conditions%shift(k)*r(before + dim*(dim + 1)/2 + 1:, k)
        do x = 1, dim
          strains(:dim, x) = conditions%strain(k)*r(before + rows(:dim, x), k)
        end do
        do m = 1, splines
          do x = 1, dim
            of_cell(x, m, cell) = of_cell(x, m, cell) + fields(x)*value(m) &
              & + sum(strains(:dim, x)*gradient(:dim, m))
          end do
        end do
      end do
    end do
    !$omp do schedule(dynamic, 64)
    do s = 1, size(c, 2)
      c(:, s) = 0.0_wp
      do i = level%first(s), level%first(s + 1) - 1
        c(:, s) = c(:, s) + of_cell(:, level%under(2, i), level%under(1, i))
      end do
    end do
    !$omp end parallel
  end subroutine gather

  !> The multipliers of splines, added to those of the points.
  subroutine spread_out(conditions, level, c, w)
    type(conditions_type), intent(in) :: conditions
    type(level_type), intent(in) :: level
    real(wp), intent(in) :: c(:, :)     !! (components, splines)
    real(wp), intent(inout) :: w(:, :)  !! (rows, points), added to
    real(wp) :: fields(level%components), strains(3, 3), value(64), gradient(3, 64)
    integer :: rows(3, 3), k, x, y, m, s, dim, before

    dim = level%dim
    before = conditions%before
    rows = rows_of(dim)
    !$omp parallel do schedule(static) default(none) &
    !$omp shared(conditions, level, c, w, dim, rows, before) &
    !$omp private(fields, strains, value, gradient, k, x, y, m, s)
    do k = 1, conditions%classes
      fields = 0.0_wp
      if (level%of_stretch) then
        call values_at(level%grid_type, k, value)
        do m = 1, 4**dim
          fields = fields + value(m)*c(:, level%spline(m, level%cell(k)))
        end do
        w(:before, k) = w(:before, k) + conditions%stiffness(k)*fields
        cycle
      end if
      call splines_at(level%grid_type, k, value, gradient)
      strains = 0.0_wp
      do m = 1, 4**dim
        s = int(level%spline(m, level%cell(k)))
        fields = fields + value(m)*c(:, s)
        do x = 1, dim
          strains(:dim, x) = strains(:dim, x) + gradient(:dim, m)*c(x, s)
        end do
      end do
      do x = 1, dim
        associate (row => before + dim*(dim + 1)/2 + x)
          w(row, k) = w(row, k) + conditions%shift(k)*fields(x)
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
