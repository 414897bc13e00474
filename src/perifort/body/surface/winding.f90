!> The winding number of a surface that need not be closed: the solid angle in which its facets are
!> seen, over 4 pi (Jacobson, Kavan and Sorkine, ACM Trans. Graph. 32 (2013) 33). Facets far away
!> count as the dipole of their sum (Barill et al., ACM Trans. Graph. 37 (2018) 43).
module pd_body_surface_winding
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_vectors, only: cross
  use pd_body_surface_surface, only: area_vector, centre_of, corners_of, surface_type
  implicit none (type, external)
  private
  public :: tree_type, new_tree, winding_number, sort_along_curve, levels_of, range_of

  integer, parameter :: leaf = 8             !! facets of the smallest nodes
  real(wp), parameter :: far = 2.5_wp        !! radii from where a node is a dipole
  integer, parameter :: deepest = 40         !! levels of the tree; facets have 32-bit numbers
  real(wp), parameter :: pi = acos(-1.0_wp)

  !> Facets sorted along a curve that fills space, and a binary tree of ranges of them: node k has
  !> the nodes 2k and 2k + 1, whose ranges are halves of its own.
  type :: tree_type
    integer :: levels = 0                      !! the last one has the leaves
    integer(i4), allocatable :: facet(:)       !! (facets) in the order of the curve
    real(wp), allocatable :: vector(:, :)      !! (3, nodes) sum of area vectors [m2]
    real(wp), allocatable :: centre(:, :)      !! (3, nodes) mean of facets' centres by area [m]
    real(wp), allocatable :: radius(:)         !! (nodes) of the ball around it that holds all [m]
  end type tree_type

contains

  !> The tree of a surface.
  subroutine new_tree(surface, tree)
    type(surface_type), intent(in) :: surface  !! finished, with a facet or more
    type(tree_type), intent(out) :: tree       !! ready for `winding_number`
    real(wp) :: weight, total, vector(3), x(3, 3)
    integer :: f, k, level, first, last, i, nodes

    call sort_along_curve(surface, tree%facet)
    tree%levels = levels_of(surface%n_facets)
    nodes = 2**(tree%levels + 1) - 1
    allocate (tree%vector(3, nodes), tree%centre(3, nodes), source=0.0_wp)
    allocate (tree%radius(nodes), source=0.0_wp)
    do level = 0, tree%levels
      !$omp parallel do default(none) schedule(static) shared(surface, tree, level) &
      !$omp private(k, first, last, total, weight, vector, x, i, f)
      do k = 2**level, 2**(level + 1) - 1
        call range_of(surface%n_facets, k, level, first, last)
        total = 0.0_wp
        do i = first, last
          f = tree%facet(i)
          vector = area_vector(surface, f)
          weight = norm2(vector)
          total = total + weight
          tree%vector(:, k) = tree%vector(:, k) + vector
          tree%centre(:, k) = tree%centre(:, k) + weight*centre_of(surface, f)
        end do
        if (total > 0.0_wp) then
          tree%centre(:, k) = tree%centre(:, k)/total
        else if (last >= first) then
          tree%centre(:, k) = centre_of(surface, int(tree%facet(first)))
        end if
        do i = first, last
          x = corners_of(surface, int(tree%facet(i)))
          tree%radius(k) = max(tree%radius(k), norm2(x(:, 1) - tree%centre(:, k)), &
            & norm2(x(:, 2) - tree%centre(:, k)), norm2(x(:, 3) - tree%centre(:, k)))
        end do
      end do
    end do
  end subroutine new_tree

  !> The facets in the order in which a curve that fills space passes their centres.
  subroutine sort_along_curve(surface, facet)
    type(surface_type), intent(in) :: surface            !! finished, with a facet or more
    integer(i4), allocatable, intent(out) :: facet(:)    !! (facets) their numbers
    integer(i8), allocatable :: key(:)
    real(wp) :: size_of_box
    integer :: f

    allocate (key(surface%n_facets), facet(surface%n_facets))
    size_of_box = max(maxval(surface%high - surface%low), tiny(1.0_wp))
    do f = 1, surface%n_facets
      key(f) = place_on_curve((centre_of(surface, f) - surface%low)/size_of_box)
      facet(f) = int(f, i4)
    end do
    call sort_by_key(key, facet)
  end subroutine sort_along_curve

  !> The last level of a tree, whose nodes have few facets.
  pure integer function levels_of(n) result(levels)
    integer, intent(in) :: n  !! facets

    levels = 0
    do while (ishft(n, -levels) > leaf)
      levels = levels + 1
    end do
  end function levels_of

  !> The range of sorted facets of a node.
  pure subroutine range_of(n, node, level, first, last)
    integer, intent(in) :: n            !! facets
    integer, intent(in) :: node         !! of the tree, 1 at the top
    integer, intent(in) :: level        !! of the node, 0 at the top
    integer, intent(out) :: first       !! sorted facet, from 1
    integer, intent(out) :: last        !! sorted facet
    integer(i8) :: place

    place = node - 2_i8**level
    first = int(n*place/2_i8**level) + 1
    last = int(n*(place + 1)/2_i8**level)
  end subroutine range_of

  !> Twenty bits of each coordinate in turn (Morton's curve).
  pure integer(i8) function place_on_curve(x) result(key)
    real(wp), intent(in) :: x(3)  !! 0 to 1
    integer :: bit, c, cell(3)

    cell = int(min(max(x, 0.0_wp), 1.0_wp)*1048575.0_wp)
    key = 0_i8
    do bit = 0, 19
      do c = 1, 3
        if (btest(cell(c), bit)) key = ibset(key, 3*bit + c - 1)
      end do
    end do
  end function place_on_curve

  !> Sort by keys, those with equal ones in the order that they have.
  subroutine sort_by_key(key, order)
    integer(i8), allocatable, intent(inout) :: key(:)
    integer(i4), allocatable, intent(inout) :: order(:)
    integer, parameter :: bits = 12, passes = 5
    integer(i8), allocatable :: keys(:)
    integer(i4), allocatable :: orders(:)
    integer :: start(0:2**bits), pass, i, d

    allocate (keys(size(key)), orders(size(key)))
    do pass = 0, passes - 1
      start = 0
      do i = 1, size(key)
        d = int(ibits(key(i), pass*bits, bits))
        start(d + 1) = start(d + 1) + 1
      end do
      do d = 1, 2**bits
        start(d) = start(d) + start(d - 1)
      end do
      do i = 1, size(key)
        d = int(ibits(key(i), pass*bits, bits))
        start(d) = start(d) + 1
        keys(start(d)) = key(i)
        orders(start(d)) = order(i)
      end do
      call move_alloc(keys, key)
      call move_alloc(orders, order)
      allocate (keys(size(key)), orders(size(key)))
    end do
  end subroutine sort_by_key

  !> The winding number at a place: 1 inside of a closed surface, 0 outside, between them near gaps.
  pure real(wp) function winding_number(surface, tree, place) result(winding)
    type(surface_type), intent(in) :: surface  !! finished
    type(tree_type), intent(in) :: tree        !! of the surface
    real(wp), intent(in) :: place(3)           !! [m]
    integer :: stack(deepest), levels(deepest), top, node, level, first, last, i
    real(wp) :: r(3), distance

    winding = 0.0_wp
    top = 1
    stack(1) = 1
    levels(1) = 0
    do while (top > 0)
      node = stack(top)
      level = levels(top)
      top = top - 1
      r = tree%centre(:, node) - place
      distance = norm2(r)
      if (distance > far*tree%radius(node)) then
        if (distance > 0.0_wp) winding = winding + dot_product(tree%vector(:, node), r) &
          & /(4*pi*distance**3)
      else if (level == tree%levels) then
        call range_of(size(tree%facet), node, level, first, last)
        do i = first, last
          winding = winding + solid_angle(corners_of(surface, int(tree%facet(i))), place)/(4*pi)
        end do
      else
        stack(top + 1:top + 2) = [2*node + 1, 2*node]
        levels(top + 1:top + 2) = level + 1
        top = top + 2
      end if
    end do
  end function winding_number

  !> The solid angle of a facet, positive where its inner side is seen (van Oosterom and Strackee,
  !> IEEE Trans. Biomed. Eng. 30 (1983) 125).
  pure real(wp) function solid_angle(corners, place) result(angle)
    real(wp), intent(in) :: corners(3, 3), place(3)
    real(wp) :: a(3), b(3), c(3), la, lb, lc, above, below

    a = corners(:, 1) - place
    b = corners(:, 2) - place
    c = corners(:, 3) - place
    la = norm2(a)
    lb = norm2(b)
    lc = norm2(c)
    above = dot_product(a, cross(b, c))
    below = la*lb*lc + dot_product(a, b)*lc + dot_product(b, c)*la + dot_product(c, a)*lb
    angle = 0.0_wp
    if (abs(above) > 0.0_wp .or. abs(below) > 0.0_wp) angle = 2*atan2(above, below)
  end function solid_angle

end module pd_body_surface_winding
