!> Quadrature on the reference elements (equation 7.1): the points that a body may take from an
!> element, and finer rules for the volumes of curved ones.
module pd_body_mesh_quadrature
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp
  use pd_body_mesh_elements, only: kind_point, kind_line, kind_triangle, kind_quadrilateral, &
    & kind_tetrahedron, kind_hexahedron, kind_wedge, kind_pyramid
  implicit none (type, external)
  private
  public :: rule_type, gauss_rule, fine_rule, counts_of_kind

  !> A rule: the integral of f is the sum of weight f(place).
  type :: rule_type
    real(wp), allocatable :: place(:, :)  !! (3, points) reference coordinates [-]
    real(wp), allocatable :: weight(:)    !! (points) their sum is the reference element's size [-]
  end type rule_type

contains

  !> The numbers of Gauss points that a kind of elements may have, beside 1 for its centre.
  pure function counts_of_kind(kind) result(counts)
    integer, intent(in) :: kind  !! one of `kind_*` that has a volume in some dimension
    integer, allocatable :: counts(:)

    select case (kind)
    case (kind_line)
      counts = [2, 3]
    case (kind_triangle)
      counts = [3, 6]
    case (kind_quadrilateral)
      counts = [4, 9]
    case (kind_tetrahedron)
      counts = [4]
    case (kind_hexahedron)
      counts = [8, 27]
    case (kind_wedge)
      counts = [6]
    case (kind_pyramid)
      counts = [5]
    case default
      counts = [integer ::]  ! points have no rule
    end select
  end function counts_of_kind

  !> The rule with so many points. It integrates polynomials of degree 2 n - 1 along each axis of a
  !> line, quadrilateral or hexahedron of n points along each; of degree 2 (3 points) and 4 (6) in
  !> triangles, 2 in tetrahedra and pyramids; in wedges of degree 2 in the triangle, 3 along the
  !> axis. Triangles: Dunavant, Int. J. Numer. Methods Eng. 21 (1985) 1129; pyramids: Felippa, Eng.
  !> Comput. 21 (2004) 867.
  pure subroutine gauss_rule(kind, points, rule)
    integer, intent(in) :: kind            !! one of `kind_*`
    integer, intent(in) :: points          !! one of `counts_of_kind`; others are a fault of the
                                           !! program
    type(rule_type), intent(out) :: rule   !! the rule
    real(wp), parameter :: a = 0.5854101966249685_wp, b = 0.1381966011250105_wp
    real(wp), parameter :: p = 0.48686449556014765641_wp
    integer :: i

    if (all(counts_of_kind(kind) /= points)) call internal_fault('a rule of so many points')
    select case (kind)
    case (kind_line)
      call tensor_rule(1, points, rule)
    case (kind_quadrilateral)
      call tensor_rule(2, nint(sqrt(real(points, wp))), rule)
    case (kind_hexahedron)
      call tensor_rule(3, merge(2, 3, points == 8), rule)
    case (kind_triangle)
      call triangle_rule(points, rule)
    case (kind_tetrahedron)
      allocate (rule%place(3, 4), source=b)
      do i = 1, 3
        rule%place(i, i + 1) = a
      end do
      rule%weight = spread(1.0_wp/24, 1, 4)
    case (kind_wedge)
      call wedge_rule(2, rule)
    case (kind_pyramid)
      rule%place = reshape([-p, -p, 1.0_wp/6, p, -p, 1.0_wp/6, p, p, 1.0_wp/6, -p, p, 1.0_wp/6, &
        & 0.0_wp, 0.0_wp, 0.7_wp], [3, 5])
      rule%weight = [0.2109375_wp, 0.2109375_wp, 0.2109375_wp, 0.2109375_wp, 0.15625_wp]*4/3
    case default
      call internal_fault('a rule of a kind of elements')
    end select
  end subroutine gauss_rule

  !> A rule that integrates volume and centre of an element exactly, straight (`fine` false) or
  !> curved: Gauss's rule along each axis of the cube, which is drawn together for triangles,
  !> tetrahedra and pyramids.
  pure recursive subroutine fine_rule(kind, fine, rule)
    integer, intent(in) :: kind           !! one of `kind_*`
    logical, intent(in) :: fine           !! for maps of degree 2
    type(rule_type), intent(out) :: rule  !! the rule
    integer :: i, n
    real(wp) :: x, y, z

    n = merge(4, 2, fine)
    select case (kind)
    case (kind_point)
      allocate (rule%place(3, 1), source=0.0_wp)
      rule%weight = [1.0_wp]
    case (kind_line)
      call tensor_rule(1, n, rule)
    case (kind_quadrilateral)
      call tensor_rule(2, n, rule)
    case (kind_hexahedron)
      call tensor_rule(3, n, rule)
    case (kind_wedge)
      call wedge_rule(n, rule)
    case (kind_triangle)
      call tensor_rule(2, n, rule)
      do i = 1, size(rule%weight)
        x = (1 + rule%place(1, i))/2
        y = (1 + rule%place(2, i))/2
        rule%place(:, i) = [x*(1 - y), y, 0.0_wp]
        rule%weight(i) = rule%weight(i)*(1 - y)/4
      end do
    case (kind_tetrahedron)
      call tensor_rule(3, n, rule)
      do i = 1, size(rule%weight)
        x = (1 + rule%place(1, i))/2
        y = (1 + rule%place(2, i))/2
        z = (1 + rule%place(3, i))/2
        rule%place(:, i) = [x*(1 - y)*(1 - z), y*(1 - z), z]
        rule%weight(i) = rule%weight(i)*(1 - y)*(1 - z)**2/8
      end do
    case (kind_pyramid)
      call tensor_rule(3, 4, rule)
      do i = 1, size(rule%weight)
        z = (1 + rule%place(3, i))/2
        rule%place(:, i) = [rule%place(1, i)*(1 - z), rule%place(2, i)*(1 - z), z]
        rule%weight(i) = rule%weight(i)*(1 - z)**2/2
      end do
    case default
      call internal_fault('a fine rule of a kind of elements')
    end select
  end subroutine fine_rule

  !> Gauss's rule of n points along each axis of [-1, 1]^dim.
  pure subroutine tensor_rule(dim, n, rule)
    integer, intent(in) :: dim, n
    type(rule_type), intent(out) :: rule
    real(wp) :: place(n), weight(n)
    integer :: i, c, at

    call gauss_line(n, place, weight)
    allocate (rule%place(3, n**dim), source=0.0_wp)
    allocate (rule%weight(n**dim), source=1.0_wp)
    do i = 1, n**dim
      at = i - 1
      do c = 1, dim
        rule%place(c, i) = place(mod(at, n) + 1)
        rule%weight(i) = rule%weight(i)*weight(mod(at, n) + 1)
        at = at/n
      end do
    end do
  end subroutine tensor_rule

  !> Gauss's points on [-1, 1].
  pure subroutine gauss_line(n, place, weight)
    integer, intent(in) :: n
    real(wp), intent(out) :: place(n), weight(n)
    real(wp), parameter :: inner = 0.33998104358485626_wp, outer = 0.86113631159405258_wp
    real(wp), parameter :: inside = 0.65214515486254614_wp, outside = 0.34785484513745386_wp

    select case (n)
    case (2)
      place = [-1.0_wp, 1.0_wp]/sqrt(3.0_wp)
      weight = 1.0_wp
    case (3)
      place = [-1.0_wp, 0.0_wp, 1.0_wp]*sqrt(0.6_wp)
      weight = [5.0_wp, 8.0_wp, 5.0_wp]/9
    case (4)
      place = [-outer, -inner, inner, outer]
      weight = [outside, inside, inside, outside]
    case default
      place = 0.0_wp
      weight = 0.0_wp
      call internal_fault('a rule of Gauss with other than 2 to 4 points')
    end select
  end subroutine gauss_line

  !> Triangles with 3 or 6 points.
  pure subroutine triangle_rule(points, rule)
    integer, intent(in) :: points
    type(rule_type), intent(out) :: rule
    real(wp), parameter :: near(2) = [0.091576213509770743_wp, 0.445948490915964886_wp]
    real(wp), parameter :: weight(2) = [0.109951743655321868_wp, 0.223381589678011466_wp]
    integer :: i

    allocate (rule%place(3, points), source=0.0_wp)
    allocate (rule%weight(points))
    if (points == 3) then
      call add_three(rule, 1, 1.0_wp/6, 1.0_wp/3)
    else
      do i = 1, 2
        call add_three(rule, 3*i - 2, near(i), weight(i))
      end do
    end if
  end subroutine triangle_rule

  !> Three points at which two of a triangle's coordinates are `a`.
  pure subroutine add_three(rule, first, a, w)
    type(rule_type), intent(inout) :: rule
    integer, intent(in) :: first
    real(wp), intent(in) :: a, w

    rule%place(:2, first:first + 2) = reshape([a, a, 1 - 2*a, a, a, 1 - 2*a], [2, 3])
    rule%weight(first:first + 2) = w/2
  end subroutine add_three

  !> Wedges: a rule of the triangle times Gauss's rule.
  pure recursive subroutine wedge_rule(n, rule)
    integer, intent(in) :: n              !! points along the axis
    type(rule_type), intent(out) :: rule
    type(rule_type) :: flat
    real(wp) :: place(n), weight(n)
    integer :: i, k, at

    if (n == 2) then
      call triangle_rule(3, flat)
    else
      call fine_rule(kind_triangle, .true., flat)
    end if
    call gauss_line(n, place, weight)
    at = 0
    allocate (rule%place(3, n*size(flat%weight)), rule%weight(n*size(flat%weight)))
    do k = 1, n
      do i = 1, size(flat%weight)
        at = at + 1
        rule%place(:, at) = [flat%place(1, i), flat%place(2, i), place(k)]
        rule%weight(at) = flat%weight(i)*weight(k)
      end do
    end do
  end subroutine wedge_rule

end module pd_body_mesh_quadrature
