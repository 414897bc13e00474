!> Signed distance of places from a closed surface, with its normal there.
!>
!> The nearest place of the surface lies within a facet, on an edge or at a vertex. Within a facet
!> its normal tells the side; on an edge and at a vertex the sum of normals of the facets there
!> does, at a vertex each times its angle (Baerentzen and Aanaes, IEEE Trans. Vis. Comput. Graph. 11
!> (2005) 243). Where edges have four facets, or facets no area, the winding number tells it
!> instead. Facets are searched in a binary tree of boxes.
module pd_body_surface_distance
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_lookup, only: lookup_type, mix
  use pd_base_numbers, only: pi
  use pd_base_vectors, only: cross
  use pd_body_surface_surface, only: area_vector, centre_of, corners_of, surface_fault, surface_type
  use pd_body_surface_winding, only: new_tree, range_of, tree_type, winding_number
  implicit none (type, external)
  private
  public :: facets_type, new_facets, facet_gap, area_around

  integer, parameter :: deepest = 80            !! nodes that wait: two for each level of the tree
  real(wp), parameter :: flat = 1.0e-10_wp      !! height over length of what has no area
  real(wp), parameter :: at_surface = 1.0e-12_wp  !! of the largest radius: no direction is left
  real(wp), parameter :: aside = 1.0e-6_wp      !! of a facet's size, where its sides are tested
  real(wp), parameter :: beside = 0.9_wp        !! of the way to a corner, where it is tested, too
  !> Where a nearest place is: within the facet, at corner i, or on the edge from corner i - 3 to
  !> the next.
  integer, parameter :: within = 0

  !> A closed surface, ready for distances. Facets are in the order of the tree.
  type :: facets_type
    type(surface_type) :: surface
    real(wp) :: reach = 0.0_wp                   !! farthest vertex from the origin [m]
    real(wp) :: area = 0.0_wp                    !! [m2]
    real(wp) :: bend = 0.0_wp                    !! length times angle of its convex edges [m]
    real(wp) :: cones = 0.0_wp                   !! solid angles of its convex vertices [-]
    logical, private :: by_winding = .false.     !! normals do not tell the side everywhere
    type(tree_type), private :: tree
    real(wp), allocatable, private :: low(:, :), high(:, :)  !! (3, nodes) boxes [m]
    real(wp), allocatable, private :: x(:, :, :)        !! (3, corners, facets) [m]
    real(wp), allocatable, private :: normal(:, :)      !! (3, facets) 0 of those without area
    real(wp), allocatable, private :: at_edge(:, :, :)  !! (3, edges, facets) sum of both normals
    real(wp), allocatable, private :: at_vertex(:, :)   !! (3, vertices) normals times angles
    integer(i4), allocatable, private :: vertex(:, :)   !! (corners, facets)
  end type facets_type

contains

  !> Make a surface ready. An error, with its place, if a facet lies within another shell, or faces
  !> into the body.
  subroutine new_facets(surface, n_many, facets, error)
    type(surface_type), intent(in) :: surface    !! closed; distances are measured in its axes
    integer, intent(in) :: n_many                !! edges of four facets or more
    type(facets_type), intent(out) :: facets     !! ready for `facet_gap`
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: vector(3), a(3), b(3), x(3, 3), longest
    real(wp), allocatable :: turned(:)
    integer :: f, i, k

    facets%surface = surface
    facets%by_winding = n_many > 0 .or. surface%n_flat > 0
    facets%reach = sqrt(maxval(sum(surface%x(:, :surface%n_vertices)**2, dim=1)))
    call new_tree(facets%surface, facets%tree)
    associate (n => surface%n_facets)
      allocate (facets%x(3, 3, n), facets%normal(3, n), facets%at_edge(3, 3, n), &
        & facets%at_vertex(3, surface%n_vertices), facets%vertex(3, n))
      allocate (turned(surface%n_vertices), source=0.0_wp)
      facets%at_vertex = 0.0_wp
      do i = 1, n
        f = facets%tree%facet(i)
        x = corners_of(surface, f)
        facets%x(:, :, i) = x
        facets%vertex(:, i) = surface%corner(:, f)
        vector = area_vector(surface, f)
        longest = max(sum((x(:, 2) - x(:, 1))**2), sum((x(:, 3) - x(:, 2))**2), &
          & sum((x(:, 1) - x(:, 3))**2))
        facets%area = facets%area + norm2(vector)
        facets%normal(:, i) = 0.0_wp
        if (norm2(vector) > flat*longest) facets%normal(:, i) = vector/norm2(vector)
        do k = 1, 3
          a = x(:, mod(k, 3) + 1) - x(:, k)
          b = x(:, mod(k + 1, 3) + 1) - x(:, k)
          associate (angle => atan2(norm2(cross(a, b)), dot_product(a, b)), &
            & v => surface%corner(k, f))
            facets%at_vertex(:, v) = facets%at_vertex(:, v) + angle*facets%normal(:, i)
            turned(v) = turned(v) + angle
          end associate
        end do
      end do
    end associate
    facets%cones = sum(max(0.0_wp, 2*pi - turned))
    call join_edges(facets)
    call make_boxes(facets)
    call check_sides(facets, error)
  end subroutine new_facets

  !> The sums of normals at edges, and how much the surface bends there.
  subroutine join_edges(facets)
    type(facets_type), intent(inout) :: facets
    type(lookup_type) :: table
    integer(i4), allocatable :: ends(:, :), next(:, :), of_edge(:, :)
    real(wp), allocatable :: total(:, :)
    integer :: i, k, a, b, number, n
    real(wp) :: ahead(3), edge(3)
    logical :: is_new

    n = size(facets%normal, 2)
    allocate (ends(2, 3*n), next(2, 3*n), of_edge(3, n), total(3, 3*n))
    do i = 1, n
      do k = 1, 3
        a = min(facets%vertex(k, i), facets%vertex(mod(k, 3) + 1, i))
        b = max(facets%vertex(k, i), facets%vertex(mod(k, 3) + 1, i))
        call table%number_of(mix(mix(0_i8, int(a, i8)), int(b, i8)), number, is_new)
        if (.not. is_new) then
          ! two edges may have one key, if hardly ever; the side is then told without them
          if (any(ends(:, number) /= [a, b])) facets%by_winding = .true.
          ahead = facets%normal(:, next(1, number))
          edge = facets%x(:, mod(next(2, number), 3) + 1, next(1, number)) &
            & - facets%x(:, next(2, number), next(1, number))
          ahead = cross(ahead, facets%normal(:, i))
          if (dot_product(ahead, edge) > 0.0_wp) facets%bend = facets%bend + norm2(edge) &
            & *atan2(norm2(ahead), dot_product(facets%normal(:, next(1, number)), &
            & facets%normal(:, i)))
        else
          ends(:, number) = int([a, b], i4)
          next(:, number) = int([i, k], i4)
          total(:, number) = 0.0_wp
        end if
        of_edge(k, i) = int(number, i4)
        total(:, number) = total(:, number) + facets%normal(:, i)
      end do
    end do
    do i = 1, n
      do k = 1, 3
        facets%at_edge(:, k, i) = total(:, of_edge(k, i))
      end do
    end do
  end subroutine join_edges

  !> The boxes of the tree: of facets at its leaves, of two boxes above them.
  subroutine make_boxes(facets)
    type(facets_type), intent(inout) :: facets
    integer :: level, node, first, last, c

    allocate (facets%low(3, 2**(facets%tree%levels + 1) - 1), &
      & facets%high(3, 2**(facets%tree%levels + 1) - 1))
    do level = facets%tree%levels, 0, -1
      do node = 2**level, 2**(level + 1) - 1
        if (level < facets%tree%levels) then
          facets%low(:, node) = min(facets%low(:, 2*node), facets%low(:, 2*node + 1))
          facets%high(:, node) = max(facets%high(:, 2*node), facets%high(:, 2*node + 1))
        else
          call range_of(size(facets%tree%facet), node, level, first, last)
          do c = 1, 3
            facets%low(c, node) = minval(facets%x(c, :, first:last))
            facets%high(c, node) = maxval(facets%x(c, :, first:last))
          end do
        end if
      end do
    end do
  end subroutine make_boxes

  !> The outside is before and the inside behind the middle of each facet, and a facet beside each
  !> vertex; an error if it is not.
  subroutine check_sides(facets, error)
    type(facets_type), intent(in) :: facets
    type(error_type), allocatable, intent(out) :: error
    integer, allocatable :: facet_of(:)   !! of each facet, then of each vertex
    real(wp) :: place(3), step(3), before, behind
    integer :: i, f, v, k, wrong

    associate (surface => facets%surface)
      facet_of = [(f, f=1, surface%n_facets), (0, v=1, surface%n_vertices)]
      do f = surface%n_facets, 1, -1
        if (.not. norm2(area_vector(surface, f)) > 0.0_wp) cycle
        do k = 1, 3
          facet_of(surface%n_facets + surface%corner(k, f)) = f
        end do
      end do
    end associate
    wrong = facets%surface%n_facets + 1
    !$omp parallel do default(none) schedule(dynamic, 64) shared(facets, facet_of) &
    !$omp private(place, step, before, behind, f) reduction(min:wrong)
    do i = 1, size(facet_of)
      f = facet_of(i)
      if (f == 0) cycle
      place = centre_of(facets%surface, f)
      step = area_vector(facets%surface, f)
      if (.not. norm2(step) > 0.0_wp) cycle
      if (i > facets%surface%n_facets) place = place + beside*(facets%surface%x(:, i &
        & - facets%surface%n_facets) - place)
      step = aside*step/sqrt(norm2(step))
      before = winding_number(facets%surface, facets%tree, place + step)
      behind = before + 1
      ! facets upon each other have edges of four
      if (facets%by_winding) behind = winding_number(facets%surface, facets%tree, place - step)
      if (abs(before) > 0.25_wp .or. abs(behind - 1) > 0.25_wp) wrong = min(wrong, f)
    end do
    if (wrong <= facets%surface%n_facets) call surface_fault(facets%surface, 'a facet has not '// &
      & 'the outside before it and the inside behind it', error, 'do shells pass through each '// &
      & 'other, or face inwards? Unite them; the facets of a cavity face into it', wrong)
  end subroutine check_sides

  !> Signed distance of a place from the surface, negative inside, and the normal there, outwards.
  pure subroutine facet_gap(facets, place, gap, normal)
    type(facets_type), intent(in) :: facets   !! the surface
    real(wp), intent(in) :: place(3)          !! in its axes [m]
    real(wp), intent(out) :: gap              !! [m]
    real(wp), intent(out) :: normal(3)        !! unit vector
    real(wp) :: foot(3), r(3), side

    block
      integer :: facet, feature

      call find_nearest(facets, place, facet, feature, foot)
      if (feature == within) then
        normal = facets%normal(:, facet)
        gap = dot_product(place - facets%x(:, 1, facet), normal)
        return
      end if
      if (feature <= 3) normal = facets%at_vertex(:, facets%vertex(feature, facet))
      if (feature > 3) normal = facets%at_edge(:, feature - 3, facet)
    end block
    r = place - foot
    gap = norm2(r)
    side = dot_product(r, normal)
    if (facets%by_winding) side = 0.5_wp - winding_number(facets%surface, facets%tree, place)
    if (norm2(normal) > 0.0_wp) normal = normal/norm2(normal)
    if (gap > at_surface*facets%reach .or. .not. norm2(normal) > 0.5_wp) then
      normal = r/max(gap, tiny(gap))
      if (side < 0.0_wp) normal = -normal
    end if
    if (side < 0.0_wp) gap = -gap
  end subroutine facet_gap

  !> The nearest place of the surface: nodes that are nearer than what was found are looked into,
  !> the nearer one of two first.
  pure subroutine find_nearest(facets, place, facet, feature, foot)
    type(facets_type), intent(in) :: facets
    real(wp), intent(in) :: place(3)
    integer, intent(out) :: facet, feature
    real(wp), intent(out) :: foot(3)
    integer :: stack(deepest), levels(deepest), top, node, level, first, last, i, at, child, nearer
    real(wp) :: bounds(deepest), best, square, found(3), to(2)

    best = huge(best)
    facet = 1
    feature = within
    foot = facets%x(:, 1, 1)
    top = 1
    stack(1) = 1
    levels(1) = 0
    bounds(1) = 0.0_wp
    do while (top > 0)
      node = stack(top)
      level = levels(top)
      top = top - 1
      if (bounds(top + 1) >= best) cycle
      if (level == facets%tree%levels) then
        call range_of(size(facets%tree%facet), node, level, first, last)
        do i = first, last
          call nearest_of_facet(facets%x(:, :, i), facets%normal(:, i), place, found, at)
          square = sum((place - found)**2)
          if (square >= best) cycle
          best = square
          facet = i
          feature = at
          foot = found
        end do
        cycle
      end if
      do child = 1, 2
        to(child) = square_to_box(facets%low(:, 2*node + child - 1), &
          & facets%high(:, 2*node + child - 1), place)
      end do
      nearer = merge(1, 2, to(1) <= to(2))
      do child = 1, 2
        ! the nearer one is taken from the stack first
        i = merge(3 - nearer, nearer, child == 1)
        if (to(i) >= best) cycle
        top = top + 1
        stack(top) = 2*node + i - 1
        levels(top) = level + 1
        bounds(top) = to(i)
      end do
    end do
  end subroutine find_nearest

  !> The square of the distance of a place from a box [m2].
  pure real(wp) function square_to_box(low, high, place) result(square)
    real(wp), intent(in) :: low(3), high(3), place(3)
    square = sum(max(low - place, 0.0_wp, place - high)**2)
  end function square_to_box

  !> The nearest place of a triangle: by the signs of areas, which tell its corner, edge or inside
  !> (Ericson, Real-time collision detection, 2005, 5.1.5).
  pure subroutine nearest_of_facet(x, normal, place, foot, feature)
    real(wp), intent(in) :: x(3, 3)
    real(wp), intent(in) :: normal(3)        !! 0 if it has no area
    real(wp), intent(in) :: place(3)
    real(wp), intent(out) :: foot(3)
    integer, intent(out) :: feature
    real(wp) :: ab(3), ac(3), r(3), d(6), area(3)

    if (.not. sum(normal**2) > 0.0_wp) then
      call nearest_of_edges(x, place, foot, feature)
      return
    end if
    ab = x(:, 2) - x(:, 1)
    ac = x(:, 3) - x(:, 1)
    r = place - x(:, 1)
    d(1) = dot_product(ab, r)
    d(2) = dot_product(ac, r)
    r = place - x(:, 2)
    d(3) = dot_product(ab, r)
    d(4) = dot_product(ac, r)
    r = place - x(:, 3)
    d(5) = dot_product(ab, r)
    d(6) = dot_product(ac, r)
    area = [d(3)*d(6) - d(5)*d(4), d(5)*d(2) - d(1)*d(6), d(1)*d(4) - d(3)*d(2)]
    if (d(1) <= 0.0_wp .and. d(2) <= 0.0_wp) then
      feature = 1
      foot = x(:, 1)
    else if (d(3) >= 0.0_wp .and. d(4) <= d(3)) then
      feature = 2
      foot = x(:, 2)
    else if (d(6) >= 0.0_wp .and. d(5) <= d(6)) then
      feature = 3
      foot = x(:, 3)
    else if (area(3) <= 0.0_wp .and. d(1) >= 0.0_wp .and. d(3) <= 0.0_wp) then
      feature = 4
      foot = x(:, 1) + d(1)/(d(1) - d(3))*ab
    else if (area(1) <= 0.0_wp .and. d(4) >= d(3) .and. d(5) >= d(6)) then
      feature = 5
      foot = x(:, 2) + (d(4) - d(3))/((d(4) - d(3)) + (d(5) - d(6)))*(x(:, 3) - x(:, 2))
    else if (area(2) <= 0.0_wp .and. d(2) >= 0.0_wp .and. d(6) <= 0.0_wp) then
      feature = 6
      foot = x(:, 1) + d(2)/(d(2) - d(6))*ac
    else
      feature = within
      foot = place - dot_product(place - x(:, 1), normal)*normal
    end if
  end subroutine nearest_of_facet

  !> The nearest place of three edges.
  pure subroutine nearest_of_edges(x, place, foot, feature)
    real(wp), intent(in) :: x(3, 3), place(3)
    real(wp), intent(out) :: foot(3)
    integer, intent(out) :: feature
    real(wp) :: along(3), part, best, found(3)
    integer :: k

    best = huge(best)
    feature = 1
    foot = x(:, 1)
    do k = 1, 3
      along = x(:, mod(k, 3) + 1) - x(:, k)
      part = dot_product(place - x(:, k), along)/sum(along**2)
      found = x(:, k) + max(0.0_wp, min(1.0_wp, part))*along
      if (sum((place - found)**2) >= best) cycle
      best = sum((place - found)**2)
      foot = found
      feature = 3 + k
      if (part <= 0.0_wp) feature = k
      if (part >= 1.0_wp) feature = mod(k, 3) + 1
    end do
  end subroutine nearest_of_edges

  !> The area of the surface that lies around the body at a distance (Steiner's formula; more than
  !> that where the body is not convex) [m2].
  pure real(wp) function area_around(facets, margin) result(area)
    type(facets_type), intent(in) :: facets   !! the surface
    real(wp), intent(in) :: margin            !! the distance [m]
    area = facets%area + margin*facets%bend + margin**2*facets%cones
  end function area_around

end module pd_body_surface_distance
