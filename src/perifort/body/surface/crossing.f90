!> Facets that pass through each other: an edge of one goes through the other. Pairs whose boxes
!> overlap are found in a binary tree of boxes of facets sorted along a curve that fills space.
module pd_body_surface_crossing
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_text, only: to_text
  use pd_base_vectors, only: cross
  use pd_body_surface_surface, only: corners_of, of_single, place_of_facet, surface_type
  use pd_body_surface_winding, only: levels_of, range_of, sort_along_curve
  implicit none (type, external)
  private
  public :: crossings_type, find_crossings, crossings_text

  integer, parameter :: deepest = 40         !! levels of the tree; facets have 32-bit numbers
  real(wp), parameter :: clear = 4.0_wp      !! roundings of single precision that are no crossing
  !> The edges of a facet, from corner to corner.
  integer, parameter :: from(3) = [1, 2, 3], to(3) = [2, 3, 1]

  type :: crossings_type
    integer(i8) :: n = 0_i8               !! pairs of facets that cross
    integer :: first(2) = 0               !! the first of these pairs, by its lower facet
    real(wp) :: place(3) = 0.0_wp         !! where it crosses [m]
  end type crossings_type

contains

  !> What is said of facets that pass through each other; '' if there are none.
  function crossings_text(surface) result(text)
    type(surface_type), intent(in) :: surface  !! finished
    character(:), allocatable :: text
    type(crossings_type) :: found

    call find_crossings(surface, found)
    text = ''
    if (found%n > 0_i8) text = to_text(found%n)//' pairs of facets pass through each other, '// &
      & 'the first at '//place_of(found%first(1))//' and '//place_of(found%first(2))// &
      & ', near ('//to_text(found%place(1), 5)//', '//to_text(found%place(2), 5)//', '// &
      & to_text(found%place(3), 5)//') m'

  contains

    !> Where a facet is in the file.
    function place_of(facet) result(place)
      integer, intent(in) :: facet
      character(:), allocatable :: place
      place = place_of_facet(surface%file, int(surface%number(facet)), int(surface%line(facet)))
    end function place_of

  end function crossings_text

  !> The pairs of facets that cross each other by more than the rounding of the file. Facets with a
  !> common edge, and facets in one plane, are not looked at.
  subroutine find_crossings(surface, crossings)
    type(surface_type), intent(in) :: surface         !! finished
    type(crossings_type), intent(out) :: crossings    !! none, or their number and the first
    type(crossings_type) :: own
    integer(i4), allocatable :: facet(:)
    real(wp), allocatable :: box(:, :), nodes(:, :)
    real(wp) :: near
    integer :: levels, leaf

    if (surface%n_facets < 2) return
    near = clear*of_single*max(maxval(abs(surface%low)), maxval(abs(surface%high)))
    call sort_along_curve(surface, facet)
    levels = levels_of(surface%n_facets)
    call enclose(surface, facet, levels, box, nodes)
    !$omp parallel default(none) shared(surface, facet, levels, box, nodes, near, crossings) &
    !$omp private(leaf, own)
    own = crossings_type()
    !$omp do schedule(dynamic, 64)
    do leaf = 2**levels, 2**(levels + 1) - 1
      call cross_leaf(surface, facet, levels, box, nodes, near, leaf, own)
    end do
    !$omp end do
    !$omp critical
    call unite(own, crossings)
    !$omp end critical
    !$omp end parallel
  end subroutine find_crossings

  !> The boxes of sorted facets, and of the nodes of the tree.
  subroutine enclose(surface, facet, levels, box, nodes)
    type(surface_type), intent(in) :: surface
    integer(i4), intent(in) :: facet(:)
    integer, intent(in) :: levels
    real(wp), allocatable, intent(out) :: box(:, :)    !! (6, facets) lower and upper corner
    real(wp), allocatable, intent(out) :: nodes(:, :)  !! (6, nodes)
    real(wp) :: x(3, 3)
    integer :: i, k, first, last

    allocate (box(6, size(facet)), nodes(6, 2**(levels + 1) - 1))
    nodes(:3, :) = huge(1.0_wp)
    nodes(4:, :) = -huge(1.0_wp)
    do k = 2**levels, 2**(levels + 1) - 1
      call range_of(size(facet), k, levels, first, last)
      do i = first, last
        x = corners_of(surface, int(facet(i)))
        box(:, i) = [minval(x, dim=2), maxval(x, dim=2)]
        nodes(:3, k) = min(nodes(:3, k), box(:3, i))
        nodes(4:, k) = max(nodes(4:, k), box(4:, i))
      end do
    end do
    do k = 2**levels - 1, 1, -1
      nodes(:3, k) = min(nodes(:3, 2*k), nodes(:3, 2*k + 1))
      nodes(4:, k) = max(nodes(4:, 2*k), nodes(4:, 2*k + 1))
    end do
  end subroutine enclose

  !> Whether two boxes have a place in common.
  pure logical function overlap(a, b)
    real(wp), intent(in) :: a(6), b(6)
    overlap = a(1) <= b(4) .and. b(1) <= a(4) .and. a(2) <= b(5) .and. b(2) <= a(5) .and. &
      & a(3) <= b(6) .and. b(3) <= a(6)
  end function overlap

  !> The crossings of the facets of a leaf with each other and with those of later leaves.
  subroutine cross_leaf(surface, facet, levels, box, nodes, near, leaf, found)
    type(surface_type), intent(in) :: surface
    integer(i4), intent(in) :: facet(:)
    integer, intent(in) :: levels, leaf
    real(wp), intent(in) :: box(:, :), nodes(:, :), near
    type(crossings_type), intent(inout) :: found
    type(crossings_type) :: one
    integer :: stack(deepest), level(deepest), top, node, depth, first, last, begin, end, i, j
    real(wp) :: normal(3), corner(3)
    logical :: through

    call range_of(size(facet), leaf, levels, first, last)
    top = 1
    stack(1) = 1
    level(1) = 0
    do while (top > 0)
      node = stack(top)
      depth = level(top)
      top = top - 1
      ! its last leaf comes before this one
      if (ishft(node + 1, levels - depth) <= leaf) cycle
      if (.not. overlap(nodes(:, node), nodes(:, leaf))) cycle
      if (depth < levels) then
        stack(top + 1:top + 2) = [2*node + 1, 2*node]
        level(top + 1:top + 2) = depth + 1
        top = top + 2
        cycle
      end if
      call range_of(size(facet), node, levels, begin, end)
      do i = first, last
        normal = normal_of(corners_of(surface, int(facet(i))), near)
        corner = surface%x(:, surface%corner(1, facet(i)))
        do j = max(begin, i + 1), end
          if (.not. overlap(box(:, i), box(:, j))) cycle
          if (beside(surface, int(facet(j)), corner, normal, near)) cycle
          if (beside(surface, int(facet(i)), surface%x(:, surface%corner(1, facet(j))), &
            & normal_of(corners_of(surface, int(facet(j))), near), near)) cycle
          one%first = [min(facet(i), facet(j)), max(facet(i), facet(j))]
          call cross_pair(surface, one%first(1), one%first(2), near, through, one%place)
          if (.not. through) cycle
          one%n = 1_i8
          call unite(one, found)
        end do
      end do
    end do
  end subroutine cross_leaf

  !> The unit normal of a facet; zero if it is thinner than what counts, so that its plane is not
  !> known.
  pure function normal_of(x, near) result(normal)
    real(wp), intent(in) :: x(3, 3), near
    real(wp) :: normal(3), longest

    normal = cross(x(:, 2) - x(:, 1), x(:, 3) - x(:, 1))
    longest = sqrt(max(sum((x(:, 2) - x(:, 1))**2), sum((x(:, 3) - x(:, 1))**2), &
      & sum((x(:, 3) - x(:, 2))**2)))
    if (norm2(normal) > near*longest) then
      normal = normal/norm2(normal)
    else
      normal = 0.0_wp
    end if
  end function normal_of

  !> Whether a facet is on one side of a plane, or in it: then it at most touches facets there. No
  !> facet is beside an unknown plane.
  pure logical function beside(surface, facet, corner, normal, near)
    type(surface_type), intent(in) :: surface
    integer, intent(in) :: facet
    real(wp), intent(in) :: corner(3), normal(3), near
    real(wp) :: height(3)
    integer :: c

    do c = 1, 3
      associate (x => surface%x(:, surface%corner(c, facet)))
        height(c) = normal(1)*(x(1) - corner(1)) + normal(2)*(x(2) - corner(2)) + &
          & normal(3)*(x(3) - corner(3))
      end associate
    end do
    beside = minval(height) >= -near .or. maxval(height) <= near
    if (beside) beside = any(abs(normal) > 0.0_wp)
  end function beside

  !> Add crossings to others; the first of both stays.
  pure subroutine unite(more, all)
    type(crossings_type), intent(in) :: more
    type(crossings_type), intent(inout) :: all
    logical :: before

    if (more%n == 0_i8) return
    before = more%first(1) < all%first(1) .or. (more%first(1) == all%first(1) .and. &
      & more%first(2) < all%first(2))
    if (all%n == 0_i8 .or. before) then
      all%first = more%first
      all%place = more%place
    end if
    all%n = all%n + more%n
  end subroutine unite

  !> Whether an edge of one of two facets goes through the other one. Edges that begin at a common
  !> corner cannot.
  pure subroutine cross_pair(surface, a, b, near, through, place)
    type(surface_type), intent(in) :: surface
    integer, intent(in) :: a, b
    real(wp), intent(in) :: near
    logical, intent(out) :: through
    real(wp), intent(out) :: place(3)
    logical :: common_a(3), common_b(3)
    real(wp) :: x(3, 3), y(3, 3)
    integer :: c

    through = .false.
    place = 0.0_wp
    do c = 1, 3
      common_a(c) = any(surface%corner(c, a) == surface%corner(:, b))
      common_b(c) = any(surface%corner(c, b) == surface%corner(:, a))
    end do
    if (count(common_a) > 1) return
    x = corners_of(surface, a)
    y = corners_of(surface, b)
    do c = 1, 3
      if (.not. (common_a(from(c)) .or. common_a(to(c)))) call cross_edge(x(:, from(c)), &
        & x(:, to(c)), y, near, through, place)
      if (through) return
      if (.not. (common_b(from(c)) .or. common_b(to(c)))) call cross_edge(y(:, from(c)), &
        & y(:, to(c)), x, near, through, place)
      if (through) return
    end do
  end subroutine cross_pair

  !> Whether a line from p to q goes through a facet: its ends are on both sides by more than
  !> `near`, and it meets the facet or its edges.
  pure subroutine cross_edge(p, q, x, near, through, place)
    real(wp), intent(in) :: p(3), q(3)
    real(wp), intent(in) :: x(3, 3)
    real(wp), intent(in) :: near
    logical, intent(out) :: through
    real(wp), intent(out) :: place(3)
    real(wp) :: normal(3), above, below, side(3)
    integer :: c

    place = p
    through = .false.
    normal = normal_of(x, near)
    above = dot_product(p - x(:, 1), normal)
    below = dot_product(q - x(:, 1), normal)
    if (min(above, below) >= -near .or. max(above, below) <= near) return
    place = p + above/(above - below)*(q - p)
    do c = 1, 3
      side = x(:, to(c)) - x(:, from(c))
      if (dot_product(cross(side, place - x(:, from(c))), normal) < -near*norm2(side)) return
    end do
    through = .true.
  end subroutine cross_edge

end module pd_body_surface_crossing
