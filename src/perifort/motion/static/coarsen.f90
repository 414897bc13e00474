!> Make the slowly varying displacements that conjugate gradients are preconditioned with
!> (`pd_motion_coarse`): the grid of their nodes, which points belong together in a cell and around
!> a node, and the stiffness. That is the classical one, with the moduli of the points' materials
!> and the share of bonds that are intact: a preconditioner need not be exact, and so it costs no
!> evaluation of the forces.
module pd_motion_static_coarsen
  use pd_base_joining, only: each_alone, unite, settle_groups
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_motion_coarse, only: coarse_type, factorise
  use pd_motion_conditions, only: free_component
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: make_coarse

  !> Width of a cell over the horizon, if its unknowns are few enough.
  real(wp), parameter :: cell_width = 1.35_wp
  !> Bodies of fewer points are solved as fast without.
  integer, parameter :: fewest_points = 1000
  !> Bounds per point of what the factor keeps, and of the multiplications that make it.
  real(wp), parameter :: most_entries = 4.0_wp, most_work = 2.0e4_wp
  !> How much wider the cells become, as long as they are too many.
  real(wp), parameter :: widening = 1.1_wp
  !> An axis along which the points extend less than this part of the horizon has no gradients.
  real(wp), parameter :: flat = 1.0e-3_wp
  !> Neighbours of a part that are remembered, so that their bonds are looked at once only.
  integer, parameter :: remembered = 8

  !> The grid of nodes.
  type :: grid_type
    integer :: cells(3) = 1              !! along each axis; 0 where the body is flat
    real(wp) :: lower(3) = 0.0_wp        !! [m]
    real(wp) :: width(3) = 1.0_wp        !! of a cell [m]
    integer :: rank(3) = [1, 2, 3]       !! axes, the one with most cells last
  end type grid_type

contains

  !> Make the coarse part for a system's bonds as they are now, if it has not been made for them.
  subroutine make_coarse(system, coarse)
    type(system_type), intent(in) :: system      !! its body, family, model and constraints
    type(coarse_type), intent(inout) :: coarse   !! n = 0 where the body is too small
    type(grid_type) :: grid
    integer(i4), allocatable :: cell(:), part(:), node(:, :)
    real(wp), allocatable :: intact(:)

    if (coarse%broken == system%broken) return
    coarse = coarse_type()
    coarse%broken = system%broken
    coarse%dim = system%body%dim
    if (system%body%n_points < fewest_points .or. associated(system%body%order%ranks) .or. &
      & system%body%order%reproducible) return
    call choose_grid(system, grid)
    if (all(grid%cells(:coarse%dim) <= 1)) return
    call find_cells(system, grid, cell)
    call join_points(system, cell, part, intact)
    call list_parts(system, grid, cell, part, coarse)
    call join_parts(system, grid, cell, part, coarse, node)
    call number_unknowns(system, grid, cell, node, coarse)
    if (coarse%n == 0) return
    call assemble(system, grid, intact, coarse)
    call factorise(coarse)
  end subroutine make_coarse

  !> Cells somewhat wider than the horizon, or as wide as the bounds on their number ask for.
  pure subroutine choose_grid(system, grid)
    type(system_type), intent(in) :: system
    type(grid_type), intent(out) :: grid
    real(wp) :: extent(3), width, unknowns, band
    integer :: c, dim, i, j, k

    dim = system%body%dim
    extent = 0.0_wp
    do c = 1, dim
      grid%lower(c) = minval(system%body%x(:, c), mask=system%body%point > 0)
      extent(c) = maxval(system%body%x(:, c), mask=system%body%point > 0) - grid%lower(c)
    end do
    width = cell_width*system%family%rule%delta
    do
      grid%cells = 0
      where (extent > flat*system%family%rule%delta) grid%cells = max(1, ceiling(extent/width))
      unknowns = dim*product(real(grid%cells + 1, wp))
      band = 1.5_wp*unknowns/real(maxval(grid%cells) + 1, wp)
      if (unknowns*band <= most_entries*system%body%n_points .and. &
        & unknowns*band**2 <= most_work*system%body%n_points*dim) exit
      if (all(grid%cells <= 1)) exit
      width = widening*width
    end do
    grid%width = 1.0_wp
    where (grid%cells > 0) grid%width = extent/grid%cells
    ! by insertion
    do i = 2, dim
      k = grid%rank(i)
      do j = i - 1, 1, -1
        if (grid%cells(grid%rank(j)) <= grid%cells(k)) exit
        grid%rank(j + 1) = grid%rank(j)
      end do
      grid%rank(j + 1) = k
    end do
  end subroutine choose_grid

  !> The cell of each slot, 0 at dead slots.
  pure subroutine find_cells(system, grid, cell)
    type(system_type), intent(in) :: system
    type(grid_type), intent(in) :: grid
    integer(i4), allocatable, intent(out) :: cell(:)
    integer :: k, c, at(3)

    allocate (cell(system%body%n_slots), source=0_i4)
    do k = 1, system%body%n_slots
      if (system%body%point(k) == 0) cycle
      at = 0
      do c = 1, system%body%dim
        at(c) = max(0, min(grid%cells(c) - 1, &
          & int((system%body%x(k, c) - grid%lower(c))/grid%width(c))))
      end do
      cell(k) = int(1 + at(1) + max(1, grid%cells(1))*(at(2) + max(1, grid%cells(2))*at(3)), i4)
    end do
  end subroutine find_cells

  !> Which slots of a cell intact bonds join: each is given the lowest one. `intact` is the share of
  !> a point's bonds that is, by their volumes.
  subroutine join_points(system, cell, part, intact)
    type(system_type), intent(in) :: system
    integer(i4), intent(in) :: cell(:)
    integer(i4), allocatable, intent(out) :: part(:)
    real(wp), allocatable, intent(out) :: intact(:)
    type(bonds_type) :: bonds
    real(wp) :: all_bonds
    integer :: k, i

    part = each_alone(size(cell))
    allocate (intact(size(cell)), source=0.0_wp)
    call allocate_bonds(system%family, bonds)
    do k = 1, size(cell)
      if (cell(k) == 0) cycle
      call system%family%bonds_of(k, bonds)
      all_bonds = 0.0_wp
      do i = 1, bonds%n
        all_bonds = all_bonds + bonds%weight(i)
        if (.not. bonds%intact(i)) cycle
        intact(k) = intact(k) + bonds%weight(i)
        if (bonds%j(i) < k) then
          if (cell(bonds%j(i)) == cell(k)) call unite(part, int(k, i4), bonds%j(i))
        end if
      end do
      if (all_bonds > 0.0_wp) intact(k) = intact(k)/all_bonds
    end do
    call settle_groups(part)
  end subroutine join_points

  !> The points part by part, parts in the order of their lowest slots; `part` is numbered so then.
  pure subroutine list_parts(system, grid, cell, part, coarse)
    type(system_type), intent(in) :: system
    type(grid_type), intent(in) :: grid
    integer(i4), intent(in) :: cell(:)
    integer(i4), intent(inout) :: part(:)
    type(coarse_type), intent(inout) :: coarse
    integer(i4), allocatable :: number(:), next(:)
    integer :: k, c, n, at(3)

    allocate (number(size(part)), source=0_i4)
    n = 0
    do k = 1, size(part)
      if (cell(k) == 0) cycle
      if (part(k) == k) then
        n = n + 1
        number(k) = int(n, i4)
      end if
    end do
    allocate (coarse%start(n + 1), source=0_i4)
    do k = 1, size(part)
      if (cell(k) == 0) cycle
      part(k) = number(part(k))
      coarse%start(part(k) + 1) = coarse%start(part(k) + 1) + 1_i4
    end do
    coarse%start(1) = 1_i4
    do k = 1, n
      coarse%start(k + 1) = coarse%start(k + 1) + coarse%start(k)
    end do
    next = coarse%start
    allocate (coarse%slots(coarse%start(n + 1) - 1))
    allocate (coarse%place(3, size(coarse%slots)), source=0.0_wp)
    do k = 1, size(part)
      if (cell(k) == 0) cycle
      coarse%slots(next(part(k))) = int(k, i4)
      at = cell_place(grid, cell(k))
      do c = 1, coarse%dim
        if (grid%cells(c) > 0) coarse%place(c, next(part(k))) = max(0.0_wp, min(1.0_wp, &
          & (system%body%x(k, c) - grid%lower(c))/grid%width(c) - at(c)))
      end do
      next(part(k)) = next(part(k)) + 1_i4
    end do
  end subroutine list_parts

  !> Where a cell stands in the grid, from 0.
  pure function cell_place(grid, cell) result(at)
    type(grid_type), intent(in) :: grid
    integer(i4), intent(in) :: cell
    integer :: at(3), along(3)

    along = max(1, grid%cells)
    at(1) = mod(cell - 1, along(1))
    at(2) = mod((cell - 1)/along(1), along(2))
    at(3) = (cell - 1)/(along(1)*along(2))
  end function cell_place

  !> Which corners of parts are one: those at the same node whose parts intact bonds join.
  subroutine join_parts(system, grid, cell, part, coarse, node)
    type(system_type), intent(in) :: system
    type(grid_type), intent(in) :: grid
    integer(i4), intent(in) :: cell(:), part(:)
    type(coarse_type), intent(in) :: coarse
    integer(i4), allocatable, intent(out) :: node(:, :)
      !! (2**dim, parts) the lowest corner of a part, counted through, that is the same
    type(bonds_type) :: bonds
    integer(i4), allocatable :: same(:), known(:, :)
    integer :: k, i, j, a, b, c, corners, shift(3), of_a(3), of_b(3)

    corners = 2**coarse%dim
    same = each_alone(corners*(size(coarse%start) - 1))
    allocate (known(remembered, size(coarse%start) - 1), source=0_i4)
    call allocate_bonds(system%family, bonds)
    do k = 1, size(cell)
      if (cell(k) == 0) cycle
      call system%family%bonds_of(k, bonds)
      do i = 1, bonds%n
        j = bonds%j(i)
        if (j > k .or. .not. bonds%intact(i)) cycle
        if (cell(j) == cell(k) .or. any(known(:, part(k)) == part(j))) cycle
        known(2:, part(k)) = known(:remembered - 1, part(k))
        known(1, part(k)) = part(j)
        shift = cell_place(grid, cell(j)) - cell_place(grid, cell(k))
        do a = 1, corners
          do c = 1, 3
            of_a(c) = merge(1, 0, btest(a - 1, c - 1))
          end do
          of_b = of_a - shift
          if (any(of_b < 0 .or. of_b > 1)) cycle
          b = 1 + of_b(1) + 2*of_b(2) + 4*of_b(3)
          call unite(same, int(corners*(part(k) - 1) + a, i4), int(corners*(part(j) - 1) + b, i4))
        end do
      end do
    end do
    call settle_groups(same)
    node = reshape(same, [corners, size(coarse%start) - 1])
  end subroutine join_parts

  !> Number the unknowns, nodes that are near to each other together. A function has none where a
  !> constraint holds a point that it moves.
  pure subroutine number_unknowns(system, grid, cell, node, coarse)
    type(system_type), intent(in) :: system
    type(grid_type), intent(in) :: grid
    integer(i4), intent(in) :: cell(:), node(:, :)
    type(coarse_type), intent(inout) :: coarse
    logical, allocatable :: held(:, :), stuck(:, :)
    integer(i4), allocatable :: head(:), next(:), unknown(:, :)
    integer :: e, a, c, i, k, at(3), total(3), place, corners

    corners = 2**coarse%dim
    call find_held(system, held)
    allocate (stuck(coarse%dim, size(node)), source=.false.)
    do e = 1, size(node, 2)
      do i = coarse%start(e), coarse%start(e + 1) - 1
        k = coarse%slots(i)
        if (.not. any(held(k, :))) cycle
        do a = 1, corners
          stuck(:, node(a, e)) = stuck(:, node(a, e)) .or. held(k, :)
        end do
      end do
    end do
    ! lists of what stands at each node of the grid
    total = grid%cells + 1
    allocate (head(product(total)), source=0_i4)
    allocate (next(size(node)), source=0_i4)
    do e = size(node, 2), 1, -1
      do a = corners, 1, -1
        i = corners*(e - 1) + a
        if (node(a, e) /= i) cycle
        at = cell_place(grid, cell(coarse%slots(coarse%start(e))))
        do c = 1, coarse%dim
          if (btest(a - 1, c - 1)) at(c) = at(c) + 1
        end do
        if (any(at > grid%cells)) cycle
        place = 1 + at(grid%rank(1)) + total(grid%rank(1))*(at(grid%rank(2)) &
          & + total(grid%rank(2))*at(grid%rank(3)))
        next(i) = head(place)
        head(place) = int(i, i4)
      end do
    end do
    allocate (unknown(coarse%dim, size(node)), source=0_i4)
    allocate (coarse%slot_of(coarse%dim*size(node)))
    do place = 1, size(head)
      i = head(place)
      do while (i > 0)
        do c = 1, coarse%dim
          if (stuck(c, i)) cycle
          coarse%n = coarse%n + 1
          unknown(c, i) = int(coarse%n, i4)
          coarse%slot_of(coarse%n) = coarse%slots(coarse%start(1 + (i - 1)/corners))
        end do
        i = next(i)
      end do
    end do
    coarse%slot_of = coarse%slot_of(:coarse%n)
    allocate (coarse%unknown(coarse%dim, corners, size(node, 2)))
    do e = 1, size(node, 2)
      do a = 1, corners
        coarse%unknown(:, a, e) = unknown(:, node(a, e))
      end do
    end do
  end subroutine number_unknowns

  !> Components that cannot move: those of pins can, where they are free.
  pure subroutine find_held(system, held)
    type(system_type), intent(in) :: system
    logical, allocatable, intent(out) :: held(:, :)  !! (n_slots, dim)
    integer :: m, c

    held = system%held == 1_i1
    do m = 1, size(system%motions)
      if (.not. system%motions(m)%is_pin) cycle
      do c = 1, system%body%dim
        held(system%motions(m)%slots, c) = system%motions(m)%kind(c) /= free_component
      end do
    end do
  end subroutine find_held

  !> The stiffness of the functions: of every point the classical one, W = kappa/2 (tr eps)^2
  !> + mu dev eps : dev eps, times its volume and the share of its bonds that is intact.
  subroutine assemble(system, grid, intact, coarse)
    type(system_type), intent(in) :: system
    type(grid_type), intent(in) :: grid
    real(wp), intent(in) :: intact(:)           !! (n_slots)
    type(coarse_type), intent(inout) :: coarse  !! with its unknowns; gets rows and entries
    real(wp), allocatable :: local(:, :, :)
    integer :: e, i, j, one, other, n, corners

    corners = 2**coarse%dim
    n = corners*coarse%dim
    allocate (coarse%first(coarse%n), coarse%before(coarse%n))
    coarse%first = [(int(i, i4), i=1, coarse%n)]
    do e = 1, size(coarse%start) - 1
      one = minval(coarse%unknown(:, :, e), mask=coarse%unknown(:, :, e) > 0)
      do i = 1, corners
        do j = 1, coarse%dim
          other = coarse%unknown(j, i, e)
          if (other > 0) coarse%first(other) = min(coarse%first(other), int(one, i4))
        end do
      end do
    end do
    coarse%before(1) = 0_i8
    do i = 2, coarse%n
      coarse%before(i) = coarse%before(i - 1) + i - coarse%first(i)
    end do
    allocate (coarse%entry(coarse%before(coarse%n) + coarse%n), source=0.0_wp)
    allocate (local(n, n, size(coarse%start) - 1))
    !$omp parallel do schedule(static) default(none) shared(system, grid, intact, coarse, local) &
    !$omp private(e)
    do e = 1, size(local, 3)
      call stiffness_of_part(system, grid, intact, coarse, e, local(:, :, e))
    end do
    do e = 1, size(local, 3)
      do i = 1, n
        one = coarse%unknown(1 + mod(i - 1, coarse%dim), 1 + (i - 1)/coarse%dim, e)
        if (one == 0) cycle
        do j = 1, n
          other = coarse%unknown(1 + mod(j - 1, coarse%dim), 1 + (j - 1)/coarse%dim, e)
          if (other == 0 .or. other > one) cycle
          coarse%entry(coarse%before(one) + other) = coarse%entry(coarse%before(one) + other) &
            & + local(j, i, e)
        end do
      end do
    end do
  end subroutine assemble

  !> The stiffness of one part; unknowns corner by corner.
  pure subroutine stiffness_of_part(system, grid, intact, coarse, e, local)
    type(system_type), intent(in) :: system
    type(grid_type), intent(in) :: grid
    real(wp), intent(in) :: intact(:)
    type(coarse_type), intent(in) :: coarse
    integer, intent(in) :: e
    real(wp), intent(out) :: local(:, :)  !! (corners dim, corners dim) [N/m]
    real(wp) :: gradient(coarse%dim, 2**coarse%dim), stiff, shear, lame
    integer :: i, k, a, b, c, d, dim

    dim = coarse%dim
    local = 0.0_wp
    do i = coarse%start(e), coarse%start(e + 1) - 1
      k = coarse%slots(i)
      stiff = system%body%volume(k)*intact(k)
      if (allocated(system%model%scale)) stiff = stiff*system%model%scale(k)
      associate (material => system%model%materials(system%model%material(k)))
        shear = stiff*material%shear_modulus
        lame = stiff*(material%bulk_modulus - 2*material%shear_modulus/dim)
        if (dim == 1) shear = 0.0_wp
        if (dim == 1) lame = stiff*material%youngs_modulus
      end associate
      gradient = corner_gradients(grid, dim, coarse%place(:dim, i))
      do b = 1, size(gradient, 2)
        do a = 1, size(gradient, 2)
          associate (g => gradient(:, a), h => gradient(:, b))
            do d = 1, dim
              do c = 1, dim
                local(dim*(a - 1) + c, dim*(b - 1) + d) = local(dim*(a - 1) + c, dim*(b - 1) + d) &
                  & + lame*g(c)*h(d) + shear*g(d)*h(c)
              end do
              local(dim*(a - 1) + d, dim*(b - 1) + d) = local(dim*(a - 1) + d, dim*(b - 1) + d) &
                & + shear*dot_product(g, h)
            end do
          end associate
        end do
      end do
    end do
  end subroutine stiffness_of_part

  !> The gradients of the functions of a cell's corners at a place in it [1/m]; 0 along axes along
  !> which the body is flat.
  pure function corner_gradients(grid, dim, place) result(gradient)
    type(grid_type), intent(in) :: grid
    integer, intent(in) :: dim
    real(wp), intent(in) :: place(dim)
    real(wp) :: gradient(dim, 2**dim)
    integer :: a, c, d

    do a = 1, 2**dim
      do c = 1, dim
        gradient(c, a) = 0.0_wp
        if (grid%cells(c) == 0) cycle
        gradient(c, a) = merge(1.0_wp, -1.0_wp, btest(a - 1, c - 1))/grid%width(c)
        do d = 1, dim
          if (d == c) cycle
          gradient(c, a) = gradient(c, a) &
            & *merge(place(d), 1 - place(d), btest(a - 1, d - 1))
        end do
      end do
    end do
  end function corner_gradients

end module pd_motion_static_coarsen
