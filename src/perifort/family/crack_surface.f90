!> Cracks that are surfaces: bonds that pass through a facet are broken before the run.
!>
!> The rule is that of plane cracks (`pd_family_cracks`), facet by facet. Facets lie in cubes as
!> wide as the longest bond, and a bond looks only into the cubes that it passes.
module pd_family_crack_surface
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_vectors, only: cross
  use pd_body_body, only: body_type
  use pd_body_surface_surface, only: corners_of, surface_type
  use pd_family_family, only: family_type, bonds_type, allocate_bonds
  implicit none (type, external)
  private
  public :: cut_by_facets, facet_crosses, points_on_facets

  real(wp), parameter :: on_plane = 1.0e-6_wp  !! [spacings]
  integer, parameter :: most_cubes = 400       !! along each axis

  !> Facets in cubes; those of cube c are facet(first(c):first(c + 1) - 1).
  type :: cubes_type
    real(wp) :: low(3) = 0.0_wp
    real(wp) :: width = 1.0_wp
    integer :: n(3) = 1
    integer(i8), allocatable :: first(:)
    integer(i4), allocatable :: facet(:)
  end type cubes_type

contains

  !> Break every bond that passes through a facet; `cut` is their number (unordered).
  subroutine cut_by_facets(surface, body, family, cut)
    type(surface_type), intent(in) :: surface    !! finished; open or closed
    type(body_type), intent(in) :: body          !! arranged in the slots of the family
    class(family_type), intent(inout) :: family  !! with the cut bonds broken at both ends on return
    integer(i8), intent(out) :: cut              !! bonds that were intact before, each counted once
    type(bonds_type) :: bonds
    type(cubes_type) :: cubes
    real(wp) :: reach
    integer :: k, i

    cut = 0_i8
    reach = family%rule%delta + 2*maxval(body%spacing, mask=body%point > 0)
    call sort_facets(surface, reach, cubes)
    !$omp parallel default(none) shared(surface, body, family, cubes, reach) private(bonds, k, i) &
    !$omp reduction(+:cut) if(.not. family%bytes_are_shared())
    call allocate_bonds(family, bonds)
    ! chunks of whole groups, whose bonds one thread must break
    !$omp do schedule(dynamic, 256)
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      if (any(body%x(k, :) < surface%low - reach) .or. any(body%x(k, :) > surface%high + reach)) &
        & cycle
      call family%bonds_of(k, bonds)
      do i = 1, bonds%n
        if (.not. bonds%intact(i)) cycle
        ! from the same end whichever one asks
        if (.not. passes(surface, cubes, body%x(min(k, int(bonds%j(i))), :), body%x(max(k, &
          & int(bonds%j(i))), :), on_plane*(body%spacing(k) + body%spacing(bonds%j(i)))/2)) cycle
        call family%break_bond(k, i)
        cut = cut + 1_i8
      end do
    end do
    !$omp end parallel
    cut = cut/2_i8
  end subroutine cut_by_facets

  !> How many points lie on facets, within the tolerance of the rule.
  integer function points_on_facets(surface, body) result(number)
    type(surface_type), intent(in) :: surface   !! finished; open or closed
    type(body_type), intent(in) :: body         !! its points, in slots
    type(cubes_type) :: cubes
    integer :: n, k

    call sort_facets(surface, 2*maxval(body%spacing, mask=body%point > 0), cubes)
    number = 0
    do n = 1, body%n_points
      k = body%slot(n)
      if (on_a_facet(surface, cubes, body%x(k, :), on_plane*body%spacing(k))) number = number + 1
    end do
  end function points_on_facets

  !> Whether a place lies on some facet.
  pure logical function on_a_facet(surface, cubes, place, tolerance)
    type(surface_type), intent(in) :: surface
    type(cubes_type), intent(in) :: cubes
    real(wp), intent(in) :: place(3), tolerance
    real(wp) :: corners(3, 3), normal(3), edge(3)
    integer :: i, j, k, c, low(3), high(3)
    integer(i8) :: f

    on_a_facet = .false.
    if (any(place < surface%low - tolerance) .or. any(place > surface%high + tolerance)) return
    low = cube_at(cubes, place - tolerance)
    high = cube_at(cubes, place + tolerance)
    do k = low(3), high(3)
      do j = low(2), high(2)
        do i = low(1), high(1)
          do f = cubes%first(number_of(cubes, i, j, k)), &
            & cubes%first(number_of(cubes, i, j, k) + 1) - 1
            corners = corners_of(surface, int(cubes%facet(f)))
            normal = cross(corners(:, 2) - corners(:, 1), corners(:, 3) - corners(:, 1))
            if (.not. norm2(normal) > 0.0_wp) cycle
            normal = normal/norm2(normal)
            if (abs(dot_product(place - corners(:, 1), normal)) > tolerance) cycle
            on_a_facet = .true.
            do c = 1, 3
              edge = corners(:, mod(c, 3) + 1) - corners(:, c)
              if (dot_product(cross(normal, edge), place - corners(:, c)) &
                & < -tolerance*norm2(edge)) on_a_facet = .false.
            end do
            if (on_a_facet) return
          end do
        end do
      end do
    end do
  end function on_a_facet

  !> Sort facets into the cubes that the boxes around them meet.
  subroutine sort_facets(surface, width, cubes)
    type(surface_type), intent(in) :: surface
    real(wp), intent(in) :: width              !! at least [m]
    type(cubes_type), intent(out) :: cubes
    integer(i8), allocatable :: next(:)
    integer :: f, pass, i, j, k, low(3), high(3), c
    real(wp) :: corners(3, 3)

    cubes%width = max(width, maxval(surface%high - surface%low)/most_cubes)
    ! bonds end within a tolerance of facets
    cubes%low = surface%low - on_plane*width
    cubes%n = 1 + floor((surface%high + on_plane*width - cubes%low)/cubes%width)
    allocate (next(product(cubes%n) + 1), source=0_i8)
    do pass = 1, 2
      do f = 1, surface%n_facets
        corners = corners_of(surface, f)
        low = cube_at(cubes, minval(corners, dim=2) - on_plane*width)
        high = cube_at(cubes, maxval(corners, dim=2) + on_plane*width)
        do k = low(3), high(3)
          do j = low(2), high(2)
            do i = low(1), high(1)
              c = number_of(cubes, i, j, k)
              if (pass == 2) cubes%facet(next(c)) = int(f, i4)
              next(c) = next(c) + 1_i8
            end do
          end do
        end do
      end do
      if (pass == 2) exit
      allocate (cubes%first(size(next)))
      cubes%first(1) = 1_i8
      do c = 1, size(next) - 1
        cubes%first(c + 1) = cubes%first(c) + next(c)
      end do
      allocate (cubes%facet(cubes%first(size(next)) - 1))
      next = cubes%first
    end do
  end subroutine sort_facets

  !> The cube of a place, the nearest one for places outside.
  pure function cube_at(cubes, place) result(at)
    type(cubes_type), intent(in) :: cubes
    real(wp), intent(in) :: place(3)
    integer :: at(3)
    at = 1 + floor(max(0.0_wp, min(real(cubes%n - 1, wp), (place - cubes%low)/cubes%width)))
  end function cube_at

  !> The number of a cube.
  pure integer function number_of(cubes, i, j, k) result(number)
    type(cubes_type), intent(in) :: cubes
    integer, intent(in) :: i, j, k
    number = i + cubes%n(1)*(j - 1 + cubes%n(2)*(k - 1))
  end function number_of

  !> Whether a bond passes through some facet.
  pure logical function passes(surface, cubes, a, b, tolerance)
    type(surface_type), intent(in) :: surface
    type(cubes_type), intent(in) :: cubes
    real(wp), intent(in) :: a(3), b(3), tolerance
    integer :: i, j, k, low(3), high(3)
    integer(i8) :: f

    passes = .false.
    low = cube_at(cubes, min(a, b))
    high = cube_at(cubes, max(a, b))
    do k = low(3), high(3)
      do j = low(2), high(2)
        do i = low(1), high(1)
          do f = cubes%first(number_of(cubes, i, j, k)), &
            & cubes%first(number_of(cubes, i, j, k) + 1) - 1
            passes = facet_crosses(corners_of(surface, int(cubes%facet(f))), a, b, tolerance)
            if (passes) return
          end do
        end do
      end do
    end do
  end function passes

  !> Whether the bond between `a` and `b` is cut by a facet. A point within the tolerance of the
  !> facet's plane counts as lying on the side that the facet faces to.
  pure logical function facet_crosses(corners, a, b, tolerance) result(crosses)
    real(wp), intent(in) :: corners(3, 3)     !! a corner in each column [m]
    real(wp), intent(in) :: a(3), b(3)        !! the bond's ends [m]
    real(wp), intent(in) :: tolerance
      !! within which a point lies on the plane, and a bond meets the rim [m]
    real(wp) :: normal(3), edge(3), place(3), ha, hb, length
    integer :: i, j

    crosses = .false.
    normal = cross(corners(:, 2) - corners(:, 1), corners(:, 3) - corners(:, 1))
    length = norm2(normal)
    if (.not. length > 0.0_wp) return
    normal = normal/length
    ha = dot_product(a - corners(:, 1), normal)
    hb = dot_product(b - corners(:, 1), normal)
    if ((ha >= -tolerance) .eqv. (hb >= -tolerance)) return
    place = a + (b - a)*(ha/(ha - hb))
    do i = 1, 3
      j = mod(i, 3) + 1
      edge = corners(:, j) - corners(:, i)
      if (dot_product(cross(normal, edge), place - corners(:, i)) < -tolerance*norm2(edge)) return
    end do
    crosses = .true.
  end function facet_crosses

end module pd_family_crack_surface
