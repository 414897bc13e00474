!> Lattices: points at the centres of the cells of a grid, and the cell that holds a point.
module pd_body_lattices
  use pd_base_kinds, only: wp
  use pd_scene_content_types, only: body_group
  use pd_body_body, only: body_type, grid_type, lattice_type, allocate_points
  implicit none (type, external)
  private
  public :: lattice_points, lattice_of, box_of_cells, lattice_grid, cell_of

contains

  !> Points of a lattice, x fastest.
  pure subroutine lattice_points(dim, group, depth, body)
    integer, intent(in) :: dim             !! of the scene: 1, 2 or 3
    type(body_group), intent(in) :: group  !! with lower, upper and points
    real(wp), intent(in) :: depth          !! what makes dx^dim a volume: thickness, area or 1
    type(body_type), intent(out) :: body   !! points with positions, volumes and spacings, in point
                                           !! order
    type(grid_type) :: grid
    integer :: count(3)

    count = 1
    count(:dim) = group%points(:dim)
    grid = lattice_grid(group, dim)
    call box_of_cells(dim, grid, [1, 1, 1], count, depth, body)
  end subroutine lattice_points

  !> The cells of a lattice body.
  pure type(lattice_type) function lattice_of(group, dim) result(lattice)
    type(body_group), intent(in) :: group  !! with lower, upper and points
    integer, intent(in) :: dim             !! of the scene: 1, 2 or 3
    lattice%grid = lattice_grid(group, dim)
    lattice%cells = 1
    lattice%cells(:dim) = group%points(:dim)
  end function lattice_of

  !> The grid of a lattice body: its cell 1 begins at the body's lower corner.
  pure type(grid_type) function lattice_grid(group, dim) result(grid)
    type(body_group), intent(in) :: group  !! with lower, upper and points
    integer, intent(in) :: dim             !! of the scene: 1, 2 or 3
    grid%origin(:dim) = group%lower(:dim)
    grid%spacing = (group%upper(1) - group%lower(1))/group%points(1)
  end function lattice_grid

  !> Points at the centres of the cells first..last of a grid, x fastest.
  pure subroutine box_of_cells(dim, grid, first, last, depth, body)
    integer, intent(in) :: dim                !! of the scene: 1, 2 or 3
    type(grid_type), intent(in) :: grid       !! whose cells are meant
    integer, intent(in) :: first(3), last(3)  !! cell 1 begins at the grid's origin
    real(wp), intent(in) :: depth             !! what makes dx^dim a volume
    type(body_type), intent(out) :: body      !! points with positions, volumes and spacings, in
                                              !! point order
    integer :: i, j, k, n

    call allocate_points(body, dim, product(max(0, last - first + 1)))
    n = 0
    do k = first(3), last(3)
      do j = first(2), last(2)
        do i = first(1), last(1)
          n = n + 1
          body%x(n, 1) = grid%origin(1) + (i - 0.5_wp)*grid%spacing
          if (dim > 1) body%x(n, 2) = grid%origin(2) + (j - 0.5_wp)*grid%spacing
          if (dim > 2) body%x(n, 3) = grid%origin(3) + (k - 0.5_wp)*grid%spacing
        end do
      end do
    end do
    body%volume = depth*grid%spacing**dim
    body%spacing = grid%spacing
  end subroutine box_of_cells

  !> The cell (3) of a grid whose centre is nearest to `x`; 1 along axes that are not used.
  pure function cell_of(grid, x) result(cell)
    type(grid_type), intent(in) :: grid    !! whose cells are meant
    real(wp), intent(in) :: x(:)           !! position (dim) [m]
    integer :: cell(3)
    integer :: c

    cell = 1
    do c = 1, size(x)
      cell(c) = nint((x(c) - grid%origin(c))/grid%spacing + 0.5_wp)
    end do
  end function cell_of

end module pd_body_lattices
