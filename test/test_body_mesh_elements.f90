!> Shapes of elements and their rules against closed forms.
module test_body_mesh_elements
  use pd_base_kinds, only: wp
  use pd_body_mesh_elements, only: face_nodes, kind_hexahedron, kind_line, kind_pyramid, &
    & kind_quadrilateral, kind_tetrahedron, kind_triangle, kind_wedge, n_shapes, shape_functions, &
    & shape_numbered, shape_type
  use pd_body_mesh_quadrature, only: counts_of_kind, fine_rule, gauss_rule, rule_type
  use testdrive, only: error_type, new_unittest, unittest_type
  use bodies, only: expect_true
  use comparisons, only: expect_close, text_of
  implicit none (type, external)
  private
  public :: collect_body_mesh_elements

contains

  subroutine collect_body_mesh_elements(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('shape functions are 1 at their node and 0 at others', test_nodes), &
      & new_unittest('shape functions reproduce linear functions', test_linear), &
      & new_unittest('gradients are those of the functions', test_gradients), &
      & new_unittest('faces have their nodes between corners', test_faces), &
      & new_unittest('every rule integrates its degree', test_rules), &
      & new_unittest('fine rules integrate volumes and centres of curved elements', test_fine)]
  end subroutine collect_body_mesh_elements

  subroutine test_nodes(error)
    type(error_type), allocatable, intent(out) :: error
    type(shape_type) :: shape
    real(wp), allocatable :: values(:), gradients(:, :), expected(:)
    integer :: s, i

    do s = 1, n_shapes
      shape = shape_numbered(s)
      allocate (values(shape%nodes), gradients(3, shape%nodes), expected(shape%nodes))
      do i = 1, shape%nodes
        call shape_functions(shape, shape%reference(:, i), values, gradients)
        expected = 0.0_wp
        expected(i) = 1.0_wp
        call expect_close(error, values, expected, 1.0e-14_wp, trim(shape%name)//' of '// &
          & text_of(1.0_wp*shape%nodes)//' nodes')
      end do
      deallocate (values, gradients, expected)
    end do
  end subroutine test_nodes

  subroutine test_linear(error)
    type(error_type), allocatable, intent(out) :: error
    type(shape_type) :: shape
    real(wp), allocatable :: values(:), gradients(:, :)
    real(wp), parameter :: xi(3) = [0.21_wp, 0.17_wp, 0.33_wp]
    real(wp) :: place(3)
    integer :: s

    do s = 2, n_shapes
      shape = shape_numbered(s)
      allocate (values(shape%nodes), gradients(3, shape%nodes))
      call shape_functions(shape, xi, values, gradients)
      place = 0.0_wp
      place(:shape%dim) = xi(:shape%dim)
      call expect_close(error, [sum(values), matmul(shape%reference(:, :shape%nodes), values)], &
        & [1.0_wp, place], 1.0e-14_wp, trim(shape%name))
      deallocate (values, gradients)
    end do
  end subroutine test_linear

  !> Against differences of second order: their error is of the third derivative times h^2/6.
  subroutine test_gradients(error)
    type(error_type), allocatable, intent(out) :: error
    type(shape_type) :: shape
    real(wp), allocatable :: values(:), gradients(:, :), up(:), down(:), unused(:, :)
    real(wp), parameter :: xi(3) = [0.21_wp, 0.17_wp, 0.33_wp], h = 1.0e-5_wp
    real(wp) :: step(3)
    integer :: s, c

    do s = 2, n_shapes
      shape = shape_numbered(s)
      allocate (values(shape%nodes), gradients(3, shape%nodes), unused(3, shape%nodes), &
        & up(shape%nodes), down(shape%nodes))
      call shape_functions(shape, xi, values, gradients)
      do c = 1, 3
        step = 0.0_wp
        step(c) = h
        call shape_functions(shape, xi + step, up, unused)
        call shape_functions(shape, xi - step, down, unused)
        call expect_close(error, gradients(c, :), (up - down)/(2*h), 1.0e-9_wp, trim(shape%name))
      end do
      deallocate (values, gradients, unused, up, down)
    end do
  end subroutine test_gradients

  !> On the reference element each node of a face is where the face's own shape has it.
  subroutine test_faces(error)
    type(error_type), allocatable, intent(out) :: error
    type(shape_type) :: shape, flat
    integer, allocatable :: nodes(:)
    real(wp), allocatable :: corners(:, :), gradients(:, :), values(:)
    integer :: s, f, i, of_face

    do s = 4, n_shapes
      shape = shape_numbered(s)
      do f = 1, shape%faces
        call face_nodes(shape, f, nodes, of_face)
        flat = shape_numbered(of_face)
        call expect_true(error, flat%nodes == size(nodes) .and. flat%dim == shape%dim - 1, &
          & 'nodes and dimension of a face of a '//trim(shape%name))
        if (allocated(error)) return
        corners = shape%reference(:, nodes(:flat%corners))
        do i = flat%corners + 1, flat%nodes
          allocate (values(flat%nodes), gradients(3, flat%nodes))
          call straight(flat, flat%reference(:, i), values)
          call expect_close(error, shape%reference(:, nodes(i)), matmul(corners, &
            & values(:flat%corners)), 1.0e-14_wp, 'a node of a face of a '//trim(shape%name))
          deallocate (values, gradients)
        end do
      end do
    end do

  contains

    !> The linear functions of a line, triangle or square, written out.
    subroutine straight(flat, xi, values)
      type(shape_type), intent(in) :: flat
      real(wp), intent(in) :: xi(3)
      real(wp), intent(out) :: values(:)

      values = 0.0_wp
      select case (flat%kind)
      case (kind_line)
        values(:2) = [1 - xi(1), 1 + xi(1)]/2
      case (kind_triangle)
        values(:3) = [1 - xi(1) - xi(2), xi(1), xi(2)]
      case default
        values(:4) = [(1 - xi(1))*(1 - xi(2)), (1 + xi(1))*(1 - xi(2)), (1 + xi(1))*(1 + xi(2)), &
          & (1 - xi(1))*(1 + xi(2))]/4
      end select
    end subroutine straight

  end subroutine test_faces

  subroutine test_rules(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: kinds(*) = [kind_line, kind_line, kind_triangle, kind_triangle, &
      & kind_quadrilateral, kind_quadrilateral, kind_tetrahedron, kind_hexahedron, &
      & kind_hexahedron, kind_wedge, kind_pyramid]
    integer, parameter :: points(*) = [2, 3, 3, 6, 4, 9, 4, 8, 27, 6, 5]
    integer, parameter :: degree(*) = [3, 5, 2, 4, 3, 5, 2, 3, 5, 2, 2]
    type(rule_type) :: rule
    integer :: r

    do r = 1, size(kinds)
      call expect_true(error, any(counts_of_kind(kinds(r)) == points(r)), 'a rule is offered')
      call gauss_rule(kinds(r), points(r), rule)
      call expect_true(error, size(rule%weight) == points(r), 'as many points as asked for')
      call expect_true(error, all(rule%weight > 0.0_wp), 'positive weights')
      call integrate(kinds(r), rule, degree(r), error)
    end do
  end subroutine test_rules

  subroutine test_fine(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: kinds(*) = [kind_line, kind_triangle, kind_quadrilateral, &
      & kind_tetrahedron, kind_hexahedron, kind_wedge, kind_pyramid]
    integer, parameter :: straight(*) = [1, 1, 2, 1, 2, 2, 3]
    integer, parameter :: curved(*) = [5, 5, 7, 5, 7, 5, 3]
    type(rule_type) :: rule
    integer :: r

    do r = 1, size(kinds)
      call fine_rule(kinds(r), .false., rule)
      call integrate(kinds(r), rule, straight(r), error)
      call fine_rule(kinds(r), .true., rule)
      call integrate(kinds(r), rule, curved(r), error)
    end do
  end subroutine test_fine

  !> All monomials up to a degree: along each axis for cubes, in total for the others.
  subroutine integrate(kind, rule, degree, error)
    integer, intent(in) :: kind, degree
    type(rule_type), intent(in) :: rule
    type(error_type), allocatable, intent(inout) :: error
    integer :: a, b, c
    logical :: cube
    real(wp) :: numeric

    cube = any(kind == [kind_line, kind_quadrilateral, kind_hexahedron])
    do a = 0, degree
      do b = 0, merge(degree, 0, kind /= kind_line)
        do c = 0, merge(degree, 0, any(kind == [kind_tetrahedron, kind_hexahedron, kind_wedge, &
          & kind_pyramid]))
          if (.not. cube .and. a + b + c > degree) cycle
          numeric = sum(rule%weight*rule%place(1, :)**a*rule%place(2, :)**b*rule%place(3, :)**c)
          call expect_close(error, [numeric], [exact(kind, a, b, c)], 1.0e-14_wp, &
            & 'the integral of a monomial')
        end do
      end do
    end do
  end subroutine integrate

  !> The integral of x^a y^b z^c over a reference element.
  pure real(wp) function exact(kind, a, b, c)
    integer, intent(in) :: kind, a, b, c

    select case (kind)
    case (kind_line)
      exact = line(a)
    case (kind_quadrilateral)
      exact = line(a)*line(b)
    case (kind_hexahedron)
      exact = line(a)*line(b)*line(c)
    case (kind_triangle)
      exact = gamma(a + 1.0_wp)*gamma(b + 1.0_wp)/gamma(a + b + 3.0_wp)
    case (kind_tetrahedron)
      exact = gamma(a + 1.0_wp)*gamma(b + 1.0_wp)*gamma(c + 1.0_wp)/gamma(a + b + c + 4.0_wp)
    case (kind_wedge)
      exact = gamma(a + 1.0_wp)*gamma(b + 1.0_wp)/gamma(a + b + 3.0_wp)*line(c)
    case default
      exact = line(a)*line(b)*gamma(c + 1.0_wp)*gamma(a + b + 3.0_wp)/gamma(a + b + c + 4.0_wp)
    end select
  end function exact

  !> The integral of x^n over [-1, 1].
  pure real(wp) function line(n)
    integer, intent(in) :: n
    line = merge(2.0_wp/(n + 1), 0.0_wp, mod(n, 2) == 0)
  end function line

end module test_body_mesh_elements
