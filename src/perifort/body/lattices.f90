!> Lattices: points at the centres of the cells of a grid, and the cell that holds a point.
module pd_body_lattices
  use pd_base_kinds, only: wp
  use pd_base_vectors, only: cross
  use pd_scene_content_types, only: body_group, is_turned
  use pd_body_body, only: body_type, grid_type, lattice_type, allocate_points
  implicit none (type, external)
  private
  public :: lattice_of, box_of_cells, lattice_grid, cell_of, axes_of, place_in, coordinate

contains

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
    if (.not. is_turned(group)) return
    grid%turned = .true.
    grid%axes = axes_of(group, dim)
    ! shapes are turned about their centre
    if (group%shape == 'sphere' .or. group%shape == 'cylinder') grid%origin(:dim) = &
      & group%centre(:dim) + matmul(grid%axes(:dim, :dim), group%lower(:dim) - group%centre(:dim))
  end function lattice_grid

  !> The directions of a lattice's rows as columns: `axis_1`, and in 3D the part of `axis_2` that is
  !> normal to it; x, y and z if it is not turned.
  pure function axes_of(group, dim) result(axes)
    type(body_group), intent(in) :: group  !! checked
    integer, intent(in) :: dim             !! of the scene: 1, 2 or 3
    real(wp) :: axes(3, 3)
    integer :: c

    axes = 0.0_wp
    do c = 1, 3
      axes(c, c) = 1.0_wp
    end do
    if (.not. is_turned(group)) return
    axes(:dim, 1) = group%axis_1(:dim)/norm2(group%axis_1(:dim))
    if (dim == 2) then
      axes(:2, 2) = [-axes(2, 1), axes(1, 1)]
    else
      axes(:, 2) = group%axis_2 - dot_product(group%axis_2, axes(:, 1))*axes(:, 1)
      axes(:, 2) = axes(:, 2)/norm2(axes(:, 2))
      axes(:, 3) = cross(axes(:, 1), axes(:, 2))
    end if
  end function axes_of

  !> Where a point lies along the axes of a grid, in spacings from its origin (dim).
  pure function place_in(grid, x) result(place)
    type(grid_type), intent(in) :: grid    !! whose axes are meant
    real(wp), intent(in) :: x(:)           !! position (dim) [m]
    real(wp) :: place(size(x))

    place = x - grid%origin(:size(x))
    if (grid%turned) place = matmul(place, grid%axes(:size(x), :size(x)))
    place = place/grid%spacing
  end function place_in

  !> Positions along axis `c` of a grid [m].
  pure function coordinate(grid, x, c) result(along)
    type(grid_type), intent(in) :: grid    !! whose axes are meant
    real(wp), intent(in) :: x(:, :)        !! positions (n, dim) [m]
    integer, intent(in) :: c               !! number of the axis
    real(wp), allocatable :: along(:)

    if (grid%turned) then
      along = matmul(x, grid%axes(:size(x, 2), c))
    else
      along = x(:, c)
    end if
  end function coordinate

  !> Points at the centres of the cells first..last of a grid, x fastest.
  pure subroutine box_of_cells(dim, grid, first, last, depth, body)
    integer, intent(in) :: dim                !! of the scene: 1, 2 or 3
    type(grid_type), intent(in) :: grid       !! whose cells are meant
    integer, intent(in) :: first(3), last(3)  !! cell 1 begins at the grid's origin
    real(wp), intent(in) :: depth             !! what makes dx^dim a volume
    type(body_type), intent(out) :: body      !! points with positions, volumes and spacings, in
                                              !! point order
    integer :: i, j, k, n, cell(3)

    call allocate_points(body, dim, product(max(0, last - first + 1)))
    n = 0
    if (grid%turned) then
      do k = first(3), last(3)
        do j = first(2), last(2)
          do i = first(1), last(1)
            n = n + 1
            cell = [i, j, k]
            body%x(n, :) = grid%origin(:dim) + matmul(grid%axes(:dim, :dim), (cell(:dim) &
              & - 0.5_wp)*grid%spacing)
          end do
        end do
      end do
      body%volume = depth*grid%spacing**dim
      body%spacing = grid%spacing
      return
    end if
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
    if (grid%turned) then
      cell(:size(x)) = nint(place_in(grid, x) + 0.5_wp)
      return
    end if
    do c = 1, size(x)
      cell(c) = nint((x(c) - grid%origin(c))/grid%spacing + 0.5_wp)
    end do
  end function cell_of

end module pd_body_lattices
