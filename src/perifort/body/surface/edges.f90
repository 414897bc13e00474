!> Edges of a surface: whether it is closed, and whether its facets all face the same way.
!>
!> On a closed surface each edge runs as often in one direction as in the other.
module pd_body_surface_edges
  use pd_base_error, only: error_type
  use pd_base_joining, only: each_alone, settle_groups, unite
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_lookup, only: lookup_type, mix
  use pd_base_text, only: to_text
  use pd_body_surface_surface, only: surface_fault, surface_type
  implicit none (type, external)
  private
  public :: edges_type, check_edges

  !> What the edges of a surface came to.
  type :: edges_type
    integer :: n_open = 0              !! edges of one facet
    integer :: first_open = 0          !! number of such a facet, 0 if there is none
    integer :: n_many = 0              !! edges of four or more facets, where solids touch
    integer :: first_many = 0          !! number of such a facet, 0 if there is none
    real(wp), allocatable :: holes(:, :)  !! (6, any number) boxes around chains of open edges:
                                          !! lower, then upper corners [m]
  end type edges_type

contains

  !> Count the edges of a surface. An error, with its place, if two facets at an edge face opposite
  !> ways, or if an edge has three facets or another number that does not close.
  subroutine check_edges(surface, edges, error)
    type(surface_type), intent(in) :: surface  !! finished
    type(edges_type), intent(out) :: edges     !! what was found
    type(error_type), allocatable, intent(out) :: error
    type(lookup_type) :: table
    integer(i4), allocatable :: uses(:), net(:), facet(:), ends(:, :)
    integer :: f, i, a, b, number
    logical :: is_new

    allocate (uses(2*surface%n_facets + 1024), net(2*surface%n_facets + 1024), &
      & facet(2*surface%n_facets + 1024), ends(2, 2*surface%n_facets + 1024))
    do f = 1, surface%n_facets
      do i = 1, 3
        a = surface%corner(i, f)
        b = surface%corner(mod(i, 3) + 1, f)
        call table%number_of(mix(mix(0_i8, int(min(a, b), i8)), int(max(a, b), i8)), number, is_new)
        if (.not. is_new) then
          ! two edges may have one key, if hardly ever: the later one is then open
          is_new = any(ends(:, number) /= [min(a, b), max(a, b)])
          if (is_new) call table%own_number(number)
        end if
        if (is_new) then
          if (number > size(uses)) then
            ! more than two edges to a facet: hardly any is shared
            uses = [uses, uses]
            net = [net, net]
            facet = [facet, facet]
            ends = reshape([ends, ends], [2, 2*size(ends, 2)])
          end if
          uses(number) = 0_i4
          net(number) = 0_i4
          facet(number) = int(f, i4)
          ends(:, number) = int([min(a, b), max(a, b)], i4)
        end if
        uses(number) = uses(number) + 1_i4
        net(number) = net(number) + merge(1_i4, -1_i4, a < b)
      end do
    end do
    do i = 1, table%count
      if (uses(i) == 1_i4) then
        edges%n_open = edges%n_open + 1
        if (edges%first_open == 0) edges%first_open = facet(i)
      else if (net(i) == 0_i4) then
        if (uses(i) == 2_i4) cycle
        edges%n_many = edges%n_many + 1
        if (edges%first_many == 0) edges%first_many = facet(i)
      else if (uses(i) == 2_i4) then
        call surface_fault(surface, 'two facets at the edge from '//place(int(ends(1, i)))// &
          & ' to '//place(int(ends(2, i)))//' face opposite ways', error, &
          & 'the corners of each facet turn to the left, seen from outside', int(facet(i)))
        return
      else
        call surface_fault(surface, to_text(int(uses(i)))//' facets meet at the edge from '// &
          & place(int(ends(1, i)))//' to '//place(int(ends(2, i))), error, &
          & 'a closed surface has two at each edge; is there a facet twice, or a wall inside?', &
          & int(facet(i)))
        return
      end if
    end do
    call find_holes(surface, pack_columns(ends(:, :table%count), uses(:table%count) == 1_i4), edges)

  contains

    !> Where a vertex is.
    function place(vertex) result(text)
      integer, intent(in) :: vertex
      character(:), allocatable :: text

      associate (x => surface%x(:, vertex))
        text = '('//to_text(x(1), 6)//', '//to_text(x(2), 6)//', '//to_text(x(3), 6)//') m'
      end associate
    end function place

  end subroutine check_edges

  !> The columns of a table that are chosen.
  pure function pack_columns(table, chosen) result(packed)
    integer(i4), intent(in) :: table(:, :)
    logical, intent(in) :: chosen(:)
    integer(i4), allocatable :: packed(:, :)
    integer :: i, n

    allocate (packed(size(table, 1), count(chosen)))
    n = 0
    do i = 1, size(chosen)
      if (.not. chosen(i)) cycle
      n = n + 1
      packed(:, n) = table(:, i)
    end do
  end function pack_columns

  !> Boxes around the open edges that hang together.
  subroutine find_holes(surface, ends, edges)
    type(surface_type), intent(in) :: surface
    integer(i4), intent(in) :: ends(:, :)      !! (2, edges) vertices of each open edge
    type(edges_type), intent(inout) :: edges
    integer(i4), allocatable :: lowest(:), box(:)
    integer :: e, n, i

    allocate (edges%holes(6, 0))
    if (size(ends, 2) == 0) return
    allocate (box(surface%n_vertices), source=0_i4)
    lowest = each_alone(surface%n_vertices)
    do e = 1, size(ends, 2)
      call unite(lowest, ends(1, e), ends(2, e))
    end do
    call settle_groups(lowest)
    n = 0
    do e = 1, size(ends, 2)
      associate (first => lowest(ends(1, e)))
        if (box(first) > 0_i4) cycle
        n = n + 1
        box(first) = int(n, i4)
      end associate
    end do
    deallocate (edges%holes)
    allocate (edges%holes(6, n))
    edges%holes(:3, :) = huge(1.0_wp)
    edges%holes(4:, :) = -huge(1.0_wp)
    do e = 1, size(ends, 2)
      n = box(lowest(ends(1, e)))
      do i = 1, 2
        edges%holes(:3, n) = min(edges%holes(:3, n), surface%x(:, ends(i, e)))
        edges%holes(4:, n) = max(edges%holes(4:, n), surface%x(:, ends(i, e)))
      end do
    end do
  end subroutine find_holes

end module pd_body_surface_edges
