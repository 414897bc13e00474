!> What lies around a place in a mesh: the elements at each node, rings of elements, their points.
module pd_body_mesh_around
  use pd_base_kinds, only: i4
  use pd_body_mesh_part, only: part_type
  implicit none (type, external)
  private
  public :: around_type, elements_at_nodes, points_of, widen

  !> The elements at each node.
  type :: around_type
    integer(i4), allocatable :: first(:)    !! (nodes + 1)
    integer(i4), allocatable :: element(:)
  end type around_type

contains

  !> The elements with points at each node.
  pure subroutine elements_at_nodes(part, around)
    type(part_type), intent(in) :: part        !! with its faces
    type(around_type), intent(out) :: around
    integer(i4), allocatable :: nodes(:), next(:)
    integer :: e, i

    allocate (around%first(part%mesh%n_nodes + 1), source=0_i4)
    do e = 1, part%mesh%n_elements
      if (part%points(2, e) == 0_i4) cycle
      nodes = part%mesh%nodes_of(e)
      around%first(nodes) = around%first(nodes) + 1_i4
    end do
    e = 1
    do i = 1, size(around%first)
      e = e + around%first(i)
      around%first(i) = int(e, i4) - around%first(i)
    end do
    allocate (around%element(e - 1))
    next = around%first
    do e = 1, part%mesh%n_elements
      if (part%points(2, e) == 0_i4) cycle
      nodes = part%mesh%nodes_of(e)
      do i = 1, size(nodes)
        around%element(next(nodes(i))) = int(e, i4)
        next(nodes(i)) = next(nodes(i)) + 1_i4
      end do
    end do
  end subroutine elements_at_nodes

  !> Add the elements that share a node with some.
  pure subroutine widen(part, around, f, mark, elements)
    type(part_type), intent(in) :: part           !! with its faces
    type(around_type), intent(in) :: around       !! of the part
    integer, intent(in) :: f                      !! the facet or node, which marks its elements
    integer, intent(inout) :: mark(:)             !! (elements) the last one that did
    integer(i4), allocatable, intent(inout) :: elements(:)  !! marked; gets more
    integer(i4), allocatable :: nodes(:), more(:)
    integer :: i, k, j, n
    integer(i4) :: e

    allocate (more(16))
    n = 0
    do i = 1, size(elements)
      nodes = part%mesh%nodes_of(int(elements(i)))
      do k = 1, size(nodes)
        do j = around%first(nodes(k)), around%first(nodes(k) + 1) - 1
          e = around%element(j)
          if (mark(e) == f) cycle
          mark(e) = f
          if (n == size(more)) more = [more, more]
          n = n + 1
          more(n) = e
        end do
      end do
    end do
    elements = [elements, more(:n)]
  end subroutine widen

  !> The points of some elements.
  pure function points_of(part, elements) result(points)
    type(part_type), intent(in) :: part      !! with its faces
    integer(i4), intent(in) :: elements(:)   !! with points
    integer(i4), allocatable :: points(:)
    integer :: i, n
    integer(i4) :: p

    allocate (points(sum(part%points(2, elements) - part%points(1, elements) + 1)))
    n = 0
    do i = 1, size(elements)
      do p = part%points(1, elements(i)), part%points(2, elements(i))
        n = n + 1
        points(n) = p
      end do
    end do
  end function points_of

end module pd_body_mesh_around
