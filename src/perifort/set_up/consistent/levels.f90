!> A preconditioner for the conditions on weights, with smooth multipliers.
!>
!> Multipliers z of the stretch give a bond (z_j - z_k):nnn, which is small where z is smooth: the
!> product of the conditions with their transpose is like an operator of second order. Multipliers S
!> of theta and w of the force give (S_k + S_j):nn/2 - (w_j - w_k).n/|xi|, which nearly vanishes
!> where S is the symmetric gradient of a smooth w: that is like one of sixth order. Blocks of
!> points alone would need iterations by the width of the body over its spacing, or by its cube. So
!> z, and w with S = a grad w, are also taken from cubic B-splines on grids, each twice as wide as
!> the one before (Bramble, Pasciak and Xu, Math. Comput. 55 (1990) 1), with diagonals. On the first
!> grid that has few enough splines, the widest one, their whole matrix is solved: z and w together,
!> since areas that change join them.
module pd_set_up_consistent_levels
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_lookup, only: lookup_type, mix
  use pd_base_order, only: ascending_order
  use pd_set_up_consistent_conditions, only: area_products, conditions_type, few, kind_of, &
    & of_area, of_dilatation, of_stretches, triple_products
  use pd_set_up_consistent_envelope, only: add_block, add_product, envelope_type, &
    & factorize_envelope, move_to, new_envelope, solve_envelope, work_of_envelope
  use pd_set_up_consistent_splines, only: find_children, forget_points, grid_type, order_splines, &
    & place_points, shares, splines_at
  implicit none (type, external)
  private
  public :: level_type, new_levels, add_levels

  real(wp), parameter :: finest = 2.0_wp       !! width of the finest cells [mean spacings]
  real(wp), parameter :: damping = 0.5_wp      !! of the diagonals, which overlap
  real(wp), parameter :: nothing = 1.0e-10_wp  !! part of the largest diagonal that is none
  !> Multiplications that the factor of the widest grid may take: as many, and so many for each
  !> point.
  real(wp), parameter :: most_work = 3.0e8_wp, work_of_point = 1.0e5_wp
  integer, parameter :: bonds_of_row = 60      !! that the matrix is made of, for each of its rows
  integer, parameter :: others_of_row = 15     !! the same of those that are no pairs
  integer, parameter :: bonds_of_spline = 200  !! that a diagonal is made of, for each spline
  integer, parameter :: most_bonds = 64        !! of classes with one unknown
  integer, parameter :: last_of_all(3) = [4, 16, 36]  !! splines that its factor takes last: a few
                                                      !! more than fields without effect need
  !> How an unknown is counted: hardly any are left out, between places that only look alike.
  integer(i1), parameter :: left_out = 0_i1, a_pair = 1_i1, any_other = 2_i1
  real(wp), parameter :: golden = 0.6180339887498949_wp

  !> A grid of B-splines, and the inverse of its matrix. Components are those of z, then of w, as
  !> far as the conditions have them.
  type, extends(grid_type) :: level_type
    integer :: of_z = 0                          !! components of z
    integer :: components = 0                    !! all
    real(wp), allocatable :: inverse(:, :)       !! (components, splines) of the diagonal
    type(envelope_type), allocatable :: factor   !! of the widest grid: of its matrix
  end type level_type

contains

  !> All grids of a body.
  subroutine new_levels(conditions, levels)
    type(conditions_type), intent(in) :: conditions          !! on Gb, Gd or both
    type(level_type), allocatable, intent(out) :: levels(:)  !! from fine to wide
    type(level_type), allocatable :: more(:)
    integer(i4), allocatable :: numbers(:), finer(:)
    integer(i1), allocatable :: how(:)
    integer, allocatable :: place(:), lowest(:)
    real(wp) :: low(conditions%dim), edge(conditions%dim), farthest
    integer :: cells(conditions%dim), fine(conditions%dim), last
    logical :: widest

    allocate (levels(0))
    call look_at_unknowns(conditions, how, farthest)
    low = minval(conditions%x, dim=2)
    edge = finest*conditions%spacing
    cells = int((maxval(conditions%x, dim=2) - low)/edge) + 1
    do
      allocate (more(size(levels) + 1))
      more(:size(levels)) = levels
      call move_alloc(more, levels)
      associate (level => levels(size(levels)))
        if (conditions%stretches > 0) level%of_z = conditions%before
        level%components = level%of_z
        if (conditions%dilatations > 0) level%components = level%of_z + conditions%dim
        call place_points(conditions%x, low, edge, cells, level%grid_type, numbers)
        ! four splines along an axis reach a point, and a bond may leave the point's cell
        last = last_of_all(conditions%dim)
        call order_splines(level%grid_type, cells, numbers, 4 + int(farthest/edge(1)), last, &
          & place, lowest)
        widest = all(cells == 1) .or. work_of_envelope(lowest, level%components) <= most_work &
          & + work_of_point*conditions%classes
        if (widest) then
          call factorize(conditions, how, level, place, lowest, last)
        else
          call find_diagonal(conditions, how, level)
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
  end subroutine new_levels

  !> How the unknowns are counted, and the farthest that classes with one lie from each other along
  !> an axis.
  subroutine look_at_unknowns(conditions, how, farthest)
    type(conditions_type), intent(in) :: conditions
    integer(i1), allocatable, intent(out) :: how(:)
    real(wp), intent(out) :: farthest            ! [m]
    real(wp), parameter :: opposite = 1.0e-6_wp  ! of directions from the ends of one bond
    real(wp), parameter :: much = 1.001_wp       ! over the longest bond
    real(wp) :: apart
    integer(i8) :: i
    integer :: u, d

    allocate (how(conditions%unknowns), source=any_other)
    farthest = 0.0_wp
    do u = 1, conditions%unknowns
      associate (first => conditions%first(u), last => conditions%first(u + 1) - 1, &
        & class => conditions%class, bond => conditions%bond)
        apart = 0.0_wp
        do d = 1, conditions%dim
          apart = max(apart, maxval([(conditions%x(d, class(bond(i))), i=first, last)]) &
            & - minval([(conditions%x(d, class(bond(i))), i=first, last)]))
        end do
        if (apart > much*conditions%longest .or. last - first >= most_bonds) then
          how(u) = left_out
          cycle
        end if
        farthest = max(farthest, apart)
        if (last /= first + 1 .or. kind_of(conditions, u) == of_area) cycle
        if (all(abs(conditions%n(bond(first), :) + conditions%n(bond(last), :)) <= opposite)) &
          & how(u) = a_pair
      end associate
    end do
  end subroutine look_at_unknowns

  !> What a spline at point k gives the unknown of bond `e` of k, over `pattern_of` a bond in a
  !> direction n, which is that of `e` or the opposite one: as a component of z, and of w.
  pure function shares_of(conditions, k, e, n, value, gradient) result(share)
    type(conditions_type), intent(in) :: conditions
    integer, intent(in) :: k
    integer(i8), intent(in) :: e
    real(wp), intent(in) :: n(:)
    real(wp), intent(in) :: value, gradient(:)  ! of the spline
    real(wp) :: share(2)
    real(wp) :: along

    share = 0.0_wp
    associate (f => conditions%factor(e, :))
      ! seen from the other end the direction is the opposite one
      along = sign(1.0_wp, dot_product(n, conditions%n(e, :)))
      select case (kind_of(conditions, int(conditions%unknown(e))))
      case (of_stretches)
        share(1) = along*conditions%stiffness(k)*f(1)*value
      case (of_dilatation)
        share(2) = along*conditions%shift(k)*f(2)*value &
          & + conditions%strain(k)*f(1)*dot_product(gradient, n)
      case default
        ! a component of an area
        share = [conditions%stiffness(k)*f(1), conditions%shift(k)*f(2)]*value
      end select
    end associate
  end function shares_of

  !> What the shares of the unknown of bond `e` are multiplied with for each component.
  pure subroutine pattern_of(conditions, of_z, e, pattern)
    type(conditions_type), intent(in) :: conditions
    integer, intent(in) :: of_z            ! components of z
    integer(i8), intent(in) :: e
    real(wp), intent(inout) :: pattern(:)  ! (components) set

    associate (n => conditions%n(e, :))
      pattern = 0.0_wp
      select case (kind_of(conditions, int(conditions%unknown(e))))
      case (of_stretches)
        call triple_products(n, pattern)
      case (of_dilatation)
        pattern(of_z + 1:) = n
      case default
        call area_products(n, pattern)
        pattern(of_z + 1:) = n
      end select
    end associate
  end subroutine pattern_of

  !> What splines give the unknown of a pair of bonds: those that reach its points, and their
  !> shares.
  subroutine reach_of(conditions, level, u, met, n, share, at)
    type(conditions_type), intent(in) :: conditions
    type(level_type), intent(in) :: level   ! with its points
    integer, intent(in) :: u                ! unknown
    integer, intent(inout) :: met(:)        ! splines; n are set
    integer, intent(out) :: n
    real(wp), intent(inout) :: share(:, :)  ! (2, any) as components of z, and of w; n are set
    integer, intent(inout) :: at(:)         ! (splines) 0, before and after
    real(wp) :: value(64), gradient(64, 3)
    integer(i8) :: i
    integer :: k, m, s

    n = 0
    do i = conditions%first(u), conditions%first(u + 1) - 1
      k = int(conditions%class(conditions%bond(i)))
      call splines_at(level%grid_type, k, value, gradient)
      do m = 1, 4**level%dim
        s = int(level%spline(m, level%cell(k)))
        call meet(s, met, n, at, share)
        share(:, at(s)) = share(:, at(s)) + shares_of(conditions, k, conditions%bond(i), &
          & conditions%n(conditions%bond(conditions%first(u)), :), value(m), &
          & gradient(m, :level%dim))
      end do
    end do
    at(met(:n)) = 0
  end subroutine reach_of

  !> The same for any unknown, whose bonds need not have one direction: for each component.
  subroutine vectors_of(conditions, level, u, met, n, vector, at)
    type(conditions_type), intent(in) :: conditions
    type(level_type), intent(in) :: level    ! with its points
    integer, intent(in) :: u                 ! unknown
    integer, intent(inout) :: met(:)         ! splines; n are set
    integer, intent(out) :: n
    real(wp), intent(inout) :: vector(:, :)  ! (components, any) n are set
    integer, intent(inout) :: at(:)          ! (splines) 0, before and after
    real(wp) :: value(64), gradient(64, 3), pattern(level%components), share(2)
    integer(i8) :: i
    integer :: k, m, s

    n = 0
    do i = conditions%first(u), conditions%first(u + 1) - 1
      associate (e => conditions%bond(i), z => level%of_z)
        k = int(conditions%class(e))
        call splines_at(level%grid_type, k, value, gradient)
        call pattern_of(conditions, z, e, pattern)
        do m = 1, 4**level%dim
          s = int(level%spline(m, level%cell(k)))
          call meet(s, met, n, at, vector)
          share = shares_of(conditions, k, e, conditions%n(e, :), value(m), &
            & gradient(m, :level%dim))
          vector(:z, at(s)) = vector(:z, at(s)) + share(1)*pattern(:z)
          vector(z + 1:, at(s)) = vector(z + 1:, at(s)) + share(2)*pattern(z + 1:)
        end do
      end associate
    end do
    at(met(:n)) = 0
  end subroutine vectors_of

  !> Give a spline that is met for the first time the next number, and zeros.
  pure subroutine meet(s, met, n, at, values)
    integer, intent(in) :: s                 ! spline
    integer, intent(inout) :: met(:), n      ! splines, as in `reach_of`
    integer, intent(inout) :: at(:)          ! (splines) their numbers, 0: not met
    real(wp), intent(inout) :: values(:, :)  ! (any, any) of each number

    if (at(s) > 0) return
    n = n + 1
    met(n) = s
    at(s) = n
    values(:, n) = 0.0_wp
  end subroutine meet

  !> Whether an unknown is one of those that stand for all of their kind. Multiples of the golden
  !> section are spread evenly, and with them the directions of bonds.
  elemental logical function stands_for_others(u, part)
    integer, intent(in) :: u      ! unknown
    real(wp), intent(in) :: part  ! of all that are wanted
    stands_for_others = modulo(u*golden, 1.0_wp) <= part
  end function stands_for_others

  !> Which part of the unknowns of each kind makes so many of them; of areas all.
  pure function parts_of(conditions, needed) result(parts)
    type(conditions_type), intent(in) :: conditions
    real(wp), intent(in) :: needed  ! unknowns of a kind
    real(wp) :: parts(of_stretches:of_area)

    parts(of_stretches) = min(1.0_wp, needed/max(1, conditions%stretches))
    parts(of_dilatation) = min(1.0_wp, needed/max(1, conditions%dilatations))
    parts(of_area) = 1.0_wp
  end function parts_of

  !> The diagonal of a grid's matrix, from as many bonds as it needs.
  subroutine find_diagonal(conditions, how, level)
    type(conditions_type), intent(in) :: conditions
    integer(i1), intent(in) :: how(:)         ! the unknowns are counted
    type(level_type), intent(inout) :: level
    real(wp) :: pattern(level%components), parts(of_stretches:of_area), share(2, 128)
    real(wp) :: vector(level%components, 64*most_bonds)
    integer :: met(64*most_bonds), u, n, m, z
    integer, allocatable :: at(:)

    z = level%of_z
    associate (splines => size(level%first) - 1)
      allocate (level%inverse(level%components, splines), source=0.0_wp)
      allocate (at(splines), source=0)
      parts = parts_of(conditions, real(bonds_of_spline, wp)*splines)
    end associate
    do u = 1, conditions%unknowns
      associate (part => parts(kind_of(conditions, u)))
        if (.not. stands_for_others(u, part)) cycle
        select case (how(u))
        case (left_out)
          cycle
        case (a_pair)
          call pattern_of(conditions, z, conditions%bond(conditions%first(u)), pattern)
          pattern = pattern**2/(part*conditions%counts(u))
        case default  ! any other
          call vectors_of(conditions, level, u, met, n, vector, at)
          do m = 1, n
            level%inverse(:, met(m)) = level%inverse(:, met(m)) &
              & + vector(:, m)**2/(part*conditions%counts(u))
          end do
          cycle
        end select
      end associate
      call reach_of(conditions, level, u, met, n, share, at)
      do m = 1, n
        associate (diagonal => level%inverse(:, met(m)))
          diagonal(:z) = diagonal(:z) + share(1, m)**2*pattern(:z)
          diagonal(z + 1:) = diagonal(z + 1:) + share(2, m)**2*pattern(z + 1:)
        end associate
      end do
    end do
    call invert(level%inverse(:z, :))
    call invert(level%inverse(z + 1:, :))

  contains

    subroutine invert(diagonals)
      real(wp), intent(inout) :: diagonals(:, :)
      diagonals = damping/max(diagonals, nothing*maxval(diagonals))
    end subroutine invert

  end subroutine find_diagonal

  !> Cholesky's factor of the matrix of the widest grid, from as many bonds as it needs. Bonds of
  !> one direction have one pattern: what they give splines is summed first, cell by cell.
  subroutine factorize(conditions, how, level, place, lowest, last)
    type(conditions_type), intent(in) :: conditions
    integer(i1), intent(in) :: how(:)         ! the unknowns are counted
    type(level_type), intent(inout) :: level  ! gets its factor
    integer, intent(in) :: place(:), lowest(:), last  ! as in `new_envelope`
    type(envelope_type) :: of_direction
    real(wp) :: pattern(level%components), share(2, 128)
    real(wp) :: parts(of_stretches:of_area), of_others(of_stretches:of_area)
    real(wp) :: block(128, 128), vector(level%components, 64*most_bonds), part
    integer, allocatable :: at(:), chosen(:), order(:), direction(:)
    integer(i8), allocatable :: cells(:)
    integer :: met(64*most_bonds), n, i, u, m, z, low, high, which
    logical :: summed, last_one

    z = level%of_z
    allocate (level%factor)
    call new_envelope(place, lowest, last, level%components, level%factor)
    call new_envelope(place, lowest, last, 1, of_direction)
    allocate (at(size(place)), source=0)
    parts = parts_of(conditions, real(bonds_of_row, wp)*level%components*size(place))
    of_others = parts_of(conditions, real(others_of_row, wp)*level%components*size(place))
    allocate (chosen(conditions%unknowns))
    i = 0
    do u = 1, conditions%unknowns
      if (how(u) == left_out) cycle
      part = merge(parts(kind_of(conditions, u)), of_others(kind_of(conditions, u)), &
        & how(u) == a_pair)
      if (.not. stands_for_others(u, part)) cycle
      if (how(u) == a_pair) then
        i = i + 1
        chosen(i) = u
        cycle
      end if
      call vectors_of(conditions, level, u, met, n, vector, at)
      vector(:, :n) = vector(:, :n)/sqrt(part*conditions%counts(u))
      low = merge(z + 1, 1, kind_of(conditions, u) == of_dilatation)
      high = merge(z, level%components, kind_of(conditions, u) == of_stretches)
      call add_product(met(:n), vector(:, :n), low, high, level%factor)
    end do
    chosen = chosen(:i)
    call sort_by_direction(conditions, level, chosen, order, direction, cells)
    block = 0.0_wp
    summed = .false.
    do i = 1, size(order)
      u = chosen(order(i))
      which = merge(1, 2, kind_of(conditions, u) == of_stretches)
      call reach_of(conditions, level, u, met, n, share, at)
      do m = 1, n
        block(:n, m) = block(:n, m) + share(which, m)*share(which, :n)/conditions%counts(u)
      end do
      if (i < size(order)) then
        if (cells(order(i)) == cells(order(i + 1))) cycle
      end if
      ! the last one of these cells
      call pattern_of(conditions, z, conditions%bond(conditions%first(u)), pattern)
      pattern = pattern/sqrt(parts(kind_of(conditions, u)))
      low = merge(1, z + 1, which == 1)
      high = merge(z, level%components, which == 1)
      last_one = i == size(order)
      if (.not. last_one) last_one = direction(order(i)) /= direction(order(i + 1))
      if (last_one .and. .not. summed) then
        ! no other cells have bonds of this direction
        call add_block(met(:n), block(:n, :n), pattern, low, high, level%factor)
      else
        call add_block(met(:n), block(:n, :n), [1.0_wp], 1, 1, of_direction)
        summed = .true.
      end if
      block(:n, :n) = 0.0_wp
      if (.not. (last_one .and. summed)) cycle
      call move_to(of_direction, pattern, low, high, level%factor)
      summed = .false.
    end do
    call factorize_envelope(level%factor)
  end subroutine factorize

  !> Sort bonds by their directions and the cells of their points.
  subroutine sort_by_direction(conditions, level, chosen, order, direction, cells)
    type(conditions_type), intent(in) :: conditions
    type(level_type), intent(in) :: level
    integer, intent(in) :: chosen(:)                    ! unknowns that are of bonds
    integer, allocatable, intent(out) :: order(:)       ! (chosen) sorted
    integer, allocatable, intent(out) :: direction(:)   ! (chosen) number of each
    integer(i8), allocatable, intent(out) :: cells(:)   ! (chosen) number of direction and cells
    real(wp), parameter :: parts = 2.0_wp**26   ! of a component that is 1
    type(lookup_type) :: directions
    integer(i8) :: key, n(conditions%dim)
    integer :: i, u, number
    logical :: is_new

    allocate (direction(size(chosen)), cells(size(chosen)))
    do i = 1, size(chosen)
      u = chosen(i)
      associate (first => conditions%first(u), count => int(size(level%start) - 1, i8))
        n = nint(parts*conditions%n(conditions%bond(first), :), i8)
        ! a direction and the opposite one are one
        if (any(n /= 0_i8)) then
          if (n(findloc(n /= 0_i8, .true., dim=1)) < 0_i8) n = -n
        end if
        key = int(kind_of(conditions, u), i8)
        do number = 1, size(n)
          key = mix(key, n(number))
        end do
        if (key == 0_i8) key = 1_i8
        call directions%number_of(key, number, is_new)
        direction(i) = number
        cells(i) = (number*count + level%cell(conditions%class(conditions%bond(first))))*count &
          & + level%cell(conditions%class(conditions%bond(first + 1)))
      end associate
    end do
    order = ascending_order(cells)
  end subroutine sort_by_direction

  !> Add to `w` what the grids give for the residual `r`.
  subroutine add_levels(conditions, levels, r, w)
    type(conditions_type), intent(in) :: conditions  !! of the grids
    type(level_type), intent(in) :: levels(:)        !! of `new_levels`; may be none
    real(wp), intent(in) :: r(:, :)                  !! (rows, points) [-]
    real(wp), intent(inout) :: w(:, :)               !! (rows, points), added to [-]
    type :: values_type
      real(wp), allocatable :: c(:, :)  ! (components, splines)
    end type values_type
    type(values_type) :: of(size(levels))
    integer :: i

    if (size(levels) == 0) return
    allocate (of(1)%c(levels(1)%components, size(levels(1)%first) - 1))
    call gather(conditions, levels(1), r, of(1)%c)
    do i = 2, size(levels)
      allocate (of(i)%c(levels(i)%components, size(levels(i)%child, 2)))
      call sum_children(levels(i), of(i - 1)%c, of(i)%c)
    end do
    do i = size(levels), 1, -1
      associate (level => levels(i))
        if (allocated(level%factor)) then
          call solve_envelope(level%factor, of(i)%c)
        else
          of(i)%c = level%inverse*of(i)%c
        end if
      end associate
      if (i < size(levels)) call add_parents(levels(i + 1), of(i + 1)%c, of(i)%c)
    end do
    call spread_out(conditions, levels(1), of(1)%c, w)
  end subroutine add_levels

  !> The sums over a grid's splines, from those over the splines of the next finer grid.
  subroutine sum_children(level, finer, c)
    type(level_type), intent(in) :: level
    real(wp), intent(in) :: finer(:, :)  ! (components, splines of the finer grid)
    real(wp), intent(inout) :: c(:, :)   ! (components, splines) set
    real(wp) :: share(5**level%dim)
    integer :: s, m

    share = shares(level%dim)
    !$omp parallel do schedule(static) default(none) shared(level, finer, c, share) private(s, m) &
    !$omp if (size(c, 2) > few)
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
    !$omp parallel do schedule(static) default(none) shared(level, finer, c, share) private(s, i) &
    !$omp if (size(finer, 2) > few)
    do s = 1, size(finer, 2)
      do i = level%above(s), level%above(s + 1) - 1
        finer(:, s) = finer(:, s) + share(level%parent(2, i))*c(:, level%parent(1, i))
      end do
    end do
  end subroutine add_parents

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
    real(wp), intent(inout) :: c(:, :)  ! (components, splines) set
    real(wp), allocatable :: of_cell(:, :, :)
    real(wp) :: value(64), gradient(64, 3)
    integer :: rows(3, 3), cell, i, k, x, y, s, n, z, dim, before

    dim = level%dim
    n = 4**dim
    z = level%of_z
    before = conditions%before
    rows = rows_of(dim)
    allocate (of_cell(n, level%components, size(level%start) - 1))
    !$omp parallel default(none) shared(conditions, level, r, c, of_cell, rows, dim, before, n, z) &
    !$omp private(value, gradient, cell, i, k, x, y, s) if (conditions%classes > few)
    !$omp do schedule(dynamic, 8)
    do cell = 1, size(of_cell, 3)
      of_cell(:, :, cell) = 0.0_wp
      do i = int(level%start(cell)), int(level%start(cell + 1)) - 1
        k = int(level%order(i))
        call splines_at(level%grid_type, k, value, gradient)
        do x = 1, z
          of_cell(:, x, cell) = of_cell(:, x, cell) + conditions%stiffness(k)*r(x, k)*value(:n)
        end do
        do x = 1, level%components - z
          associate (sums => of_cell(:, z + x, cell))
            sums = sums + conditions%shift(k)*r(before + dim*(dim + 1)/2 + x, k)*value(:n)
            do y = 1, dim
              sums = sums + conditions%strain(k)*r(before + rows(y, x), k)*gradient(:n, y)
            end do
          end associate
        end do
      end do
    end do
    !$omp do schedule(dynamic, 64)
    do s = 1, size(c, 2)
      c(:, s) = 0.0_wp
      do i = level%first(s), level%first(s + 1) - 1
        c(:, s) = c(:, s) + of_cell(level%under(2, i), :, level%under(1, i))
      end do
    end do
    !$omp end parallel
  end subroutine gather

  !> The multipliers of splines, added to those of the points.
  subroutine spread_out(conditions, level, c, w)
    type(conditions_type), intent(in) :: conditions
    type(level_type), intent(in) :: level
    real(wp), intent(in) :: c(:, :)     ! (components, splines)
    real(wp), intent(inout) :: w(:, :)  ! (rows, points), added to
    real(wp) :: value(64), gradient(64, 3), here(64, level%components)
    integer :: rows(3, 3), cell, i, k, x, y, n, z, dim, before, row

    dim = level%dim
    n = 4**dim
    z = level%of_z
    before = conditions%before
    rows = rows_of(dim)
    !$omp parallel do schedule(dynamic, 8) default(none) &
    !$omp shared(conditions, level, c, w, rows, dim, before, n, z) &
    !$omp private(value, gradient, here, cell, i, k, x, y, row) if (conditions%classes > few)
    do cell = 1, size(level%start) - 1
      do i = 1, n
        here(i, :) = c(:, level%spline(i, cell))
      end do
      do i = int(level%start(cell)), int(level%start(cell + 1)) - 1
        k = int(level%order(i))
        call splines_at(level%grid_type, k, value, gradient)
        do x = 1, z
          w(x, k) = w(x, k) + conditions%stiffness(k)*dot_product(value(:n), here(:n, x))
        end do
        do x = 1, level%components - z
          row = before + dim*(dim + 1)/2 + x
          w(row, k) = w(row, k) + conditions%shift(k)*dot_product(value(:n), here(:n, z + x))
          do y = 1, dim
            row = before + rows(x, y)
            w(row, k) = w(row, k) + conditions%strain(k)*dot_product(gradient(:n, y), &
              & here(:n, z + x))
          end do
        end do
      end do
    end do
  end subroutine spread_out

end module pd_set_up_consistent_levels
