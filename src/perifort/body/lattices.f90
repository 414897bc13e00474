!> Lattices: points at the centres of the cells of a grid, and the cell that holds a point.
module pd_body_lattices
  use pd_base_kinds, only: wp
  use pd_scene_types, only: body_group
  use pd_body_body, only: body_type, grid_type, allocate_points
  implicit none (type, external)
  private
  public :: lattice_points, points_of_cells, lattice_grid, cell_of

contains

  !> Points of a lattice, x fastest.
  pure subroutine lattice_points(dim, group, depth, body)
    integer, intent(in) :: dim
    type(body_group), intent(in) :: group  !! with lower, upper and points
    real(wp), intent(in) :: depth          !! what makes dx^dim a volume: thickness, area or 1
    type(body_type), intent(out) :: body
    integer, allocatable :: cells(:, :)
    integer :: i, j, k, n, count(3)

    count = 1
    count(:dim) = group%points(:dim)
    allocate (cells(3, product(count)))
    n = 0
    do k = 1, count(3)
      do j = 1, count(2)
        do i = 1, count(1)
          n = n + 1
          cells(:, n) = [i, j, k]
        end do
      end do
    end do
    call points_of_cells(dim, lattice_grid(group, dim), cells, depth, body)
  end subroutine lattice_points

  !> Points at the centres of these cells of a grid, in their order.
  pure subroutine points_of_cells(dim, grid, cells, depth, body)
    integer, intent(in) :: dim
    type(grid_type), intent(in) :: grid
    integer, intent(in) :: cells(:, :)     !! (3, n); cell 1 begins at the grid's origin
    real(wp), intent(in) :: depth          !! what makes dx^dim a volume
    type(body_type), intent(out) :: body
    integer :: c, n

    call allocate_points(body, dim, size(cells, 2))
    do c = 1, dim
      do n = 1, size(cells, 2)
        body%x(n, c) = grid%origin(c) + (cells(c, n) - 0.5_wp)*grid%spacing
      end do
    end do
    body%volume = depth*grid%spacing**dim
    body%spacing = grid%spacing
  end subroutine points_of_cells

  !> The grid of a lattice body: its cell 1 begins at the body's lower corner.
  pure type(grid_type) function lattice_grid(group, dim) result(grid)
    type(body_group), intent(in) :: group
    integer, intent(in) :: dim
    grid%origin(:dim) = group%lower(:dim)
    grid%spacing = (group%upper(1) - group%lower(1))/group%points(1)
  end function lattice_grid

  !> The cell (3) of a grid whose centre is nearest to `x`; 1 along axes that are not used.
  pure function cell_of(grid, x) result(cell)
    type(grid_type), intent(in) :: grid
    real(wp), intent(in) :: x(:)           !! position (dim) [m]
    integer :: cell(3)
    integer :: c

    cell = 1
    do c = 1, size(x)
      cell(c) = nint((x(c) - grid%origin(c))/grid%spacing + 0.5_wp)
    end do
  end function cell_of

end module pd_body_lattices
