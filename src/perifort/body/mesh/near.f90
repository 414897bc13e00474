!> Points of a part near some of its facets.
module pd_body_mesh_near
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_lookup, only: lookup_type, mix
  use pd_base_vectors, only: cross
  use pd_body_mesh_elements, only: face_nodes, n_shapes, shape_numbered, shape_type
  use pd_body_mesh_mesh, only: all_shapes
  use pd_body_mesh_part, only: facets_type, part_type
  implicit none (type, external)
  private
  public :: points_near, distance

contains

  !> Whether each point of a part is within a distance of some facets, taken as flat between their
  !> corners. Points are found in cells of that distance.
  subroutine points_near(part, x, facets, reach, near, own)
    type(part_type), intent(in) :: part           !! with its faces
    real(wp), intent(in) :: x(:, :)               !! (n_points, dim) its points [m]
    type(facets_type), intent(in) :: facets       !! of the part
    real(wp), intent(in) :: reach                 !! the distance, larger than 0 [m]
    logical, allocatable, intent(out) :: near(:)  !! (n_points)
    real(wp), intent(in), optional :: own(:)
      !! (n_points) the distance for each point, at most `reach`; absent: `reach` for all [m]
    real(wp) :: within
    type(shape_type) :: shapes(n_shapes), of_face
    type(lookup_type) :: cells
    integer(i4), allocatable :: last(:), before(:), nodes(:)
    integer, allocatable :: numbers(:)
    real(wp) :: low(3), corners(3, 4), bounds(3, 2), place(3)
    integer(i8) :: first(3), final(3), cell(3)
    integer :: f, p, i, j, k, n, s, number, c
    logical :: is_new

    shapes = all_shapes()
    allocate (near(part%n_points), source=.false.)
    allocate (last(part%n_points), before(part%n_points), source=0_i4)
    low = 0.0_wp
    low(:part%dim) = minval(x, dim=1)
    do p = 1, part%n_points
      cell = cell_of(place_of(p))
      call cells%number_of(mix(mix(mix(0_i8, cell(1)), cell(2)), cell(3)), number, is_new)
      before(p) = last(number)
      last(number) = int(p, i4)
    end do
    do f = 1, facets%n
      associate (face => part%faces(facets%face(f)))
        nodes = part%mesh%nodes_of(int(face%element(1)))
        call face_nodes(shapes(part%mesh%shape(face%element(1))), int(face%face), numbers, s)
      end associate
      of_face = shape_numbered(s)
      n = of_face%corners
      corners(:, :n) = part%mesh%x(:, nodes(numbers(:n)))
      corners(part%dim + 1:, :n) = 0.0_wp
      do c = 1, 3
        bounds(c, :) = [minval(corners(c, :n)) - reach, maxval(corners(c, :n)) + reach]
      end do
      first = cell_of(bounds(:, 1))
      final = cell_of(bounds(:, 2))
      do k = int(max(first(3), 0_i8)), int(final(3))
        do j = int(max(first(2), 0_i8)), int(final(2))
          do i = int(max(first(1), 0_i8)), int(final(1))
            number = cells%look(mix(mix(mix(0_i8, int(i, i8)), int(j, i8)), int(k, i8)))
            if (number == 0) cycle
            p = last(number)
            do while (p > 0)
              if (.not. near(p)) then
                place = place_of(p)
                within = reach
                if (present(own)) within = own(p)
                near(p) = distance(place, corners(:, :n)) <= within*(1 + 1.0e-9_wp)
              end if
              p = before(p)
            end do
          end do
        end do
      end do
    end do

  contains

    !> The place of a point.
    pure function place_of(p) result(place)
      integer, intent(in) :: p
      real(wp) :: place(3)
      place = 0.0_wp
      place(:part%dim) = x(p, :)
    end function place_of

    !> The cell of a place.
    pure function cell_of(place) result(cell)
      real(wp), intent(in) :: place(3)
      integer(i8) :: cell(3)
      cell = floor(min(2.0e9_wp, max(-1.0_wp, (place - low)/reach)), i8)
    end function cell_of

  end subroutine points_near

  !> The distance of a place from a point, a line, a triangle or a quadrilateral (two triangles).
  pure real(wp) function distance(place, corners)
    real(wp), intent(in) :: place(3)       !! [m]
    real(wp), intent(in) :: corners(:, :)  !! (3, 1 to 4) [m]

    select case (size(corners, 2))
    case (1)
      distance = norm2(place - corners(:, 1))
    case (2)
      distance = from_line(place, corners(:, 1), corners(:, 2))
    case (3)
      distance = from_triangle(place, corners)
    case default
      distance = min(from_triangle(place, corners(:, [1, 2, 3])), from_triangle(place, &
        & corners(:, [1, 3, 4])))
    end select
  end function distance

  !> The distance from a line between two places.
  pure real(wp) function from_line(place, a, b) result(distance)
    real(wp), intent(in) :: place(3), a(3), b(3)
    real(wp) :: along

    along = 0.0_wp
    if (norm2(b - a) > 0.0_wp) along = dot_product(place - a, b - a)/sum((b - a)**2)
    distance = norm2(place - a - min(1.0_wp, max(0.0_wp, along))*(b - a))
  end function from_line

  !> The distance from a triangle: from its plane where the foot is inside, else from its edges.
  pure real(wp) function from_triangle(place, corners) result(distance)
    real(wp), intent(in) :: place(3), corners(3, 3)
    real(wp) :: normal(3), side(3), area
    integer :: i, next
    logical :: inside

    normal = cross(corners(:, 2) - corners(:, 1), corners(:, 3) - corners(:, 1))
    area = norm2(normal)
    inside = area > 0.0_wp
    distance = huge(distance)
    do i = 1, 3
      next = mod(i, 3) + 1
      side = cross(normal, corners(:, next) - corners(:, i))
      inside = inside .and. dot_product(side, place - corners(:, i)) >= 0.0_wp
      distance = min(distance, from_line(place, corners(:, i), corners(:, next)))
    end do
    if (inside) distance = abs(dot_product(place - corners(:, 1), normal))/area
  end function from_triangle

end module pd_body_mesh_near
