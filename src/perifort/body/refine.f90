!> Lattices that are finer in some places (`&refine`): cells of level n are those of the body's
!> lattice, each divided in half n times along every axis.
module pd_body_refine
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type, grid_type, lattice_type, allocate_points
  use pd_body_choice, only: choose_points
  use pd_body_lattices, only: box_of_cells
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: refine_lattice, finer, level_of, spread_levels

  integer(i8), parameter :: most_points = 1000000000_i8

contains

  !> The points of a lattice that fills a box, with its refined cells: the others in the order of
  !> the lattice, then level 1, level 2 and so on, x fastest within a level. A cell has the level of
  !> the finest `&refine` that its centre lies in, or what its neighbours need (`spread_levels`). An
  !> error, with its place, if there would be too many points.
  subroutine refine_lattice(scene, lattice, depth, used, body, level, error)
    type(scene_type), intent(in) :: scene         !! a checked scene, with its `&refine` groups
    type(lattice_type), intent(in) :: lattice     !! cells of the body, a whole box of them
    real(wp), intent(in) :: depth                 !! what makes dx^dim a volume: thickness, area, 1
    logical, intent(inout) :: used(:)             !! (groups) whether it has refined some cell
    type(body_type), intent(inout) :: body        !! points of the cells; of all levels on return
    integer(i4), allocatable, intent(out) :: level(:)  !! (n_points) of each point then
    type(error_type), allocatable, intent(out) :: error
    integer(i4), allocatable :: levels(:, :, :)
    logical, allocatable :: chosen(:)
    type(body_type) :: coarse, points
    integer(i8) :: total
    integer :: i, n, next, dim

    dim = body%dim
    coarse = body
    allocate (levels(lattice%cells(1), lattice%cells(2), lattice%cells(3)), source=0_i4)
    do i = 1, size(scene%refines)
      call choose_points(scene, coarse, scene%refines(i), 'refine', i, chosen, error)
      if (allocated(error)) return
      used(i) = used(i) .or. any(chosen)
      where (reshape(chosen, shape(levels))) levels = max(levels, int(scene%refines(i)%levels, i4))
    end do
    call spread_levels(scene%horizon%ratio, dim, levels)
    total = 0_i8
    do n = 0, maxval(levels)
      total = total + count(levels == n, kind=i8)*2_i8**(dim*n)
      if (total > most_points) then
        call scene_fault(error, scene, 'refine', maxloc(scene%refines%levels, dim=1), 'levels', &
          & 'refined cells make more than '//to_text(most_points)//' points', &
          & 'refine a smaller part, or by fewer levels')
        return
      end if
    end do
    call allocate_points(body, dim, int(total))
    allocate (level(total))
    next = 0
    do n = 0, maxval(levels)
      call cells_of_level(dim, lattice, levels, n, depth, points)
      associate (last => next + points%n_points)
        body%x(next + 1:last, :) = points%x
        body%volume(next + 1:last) = points%volume
        body%spacing(next + 1:last) = points%spacing
        level(next + 1:last) = n
        next = last
      end associate
    end do
  end subroutine refine_lattice

  !> Give cells the levels that their neighbours need: bonds then join cells whose levels differ by
  !> one at most. Between cells of level n and n - 2 a rim of level n - 1 is as wide as the horizon
  !> of the coarsest.
  pure subroutine spread_levels(ratio, dim, levels)
    real(wp), intent(in) :: ratio                !! horizon over spacing of each cell [-]
    integer, intent(in) :: dim                   !! number of dimensions
    integer(i4), intent(inout) :: levels(:, :, :)  !! of the cells of the lattice
    logical, allocatable :: inside(:, :, :)
    integer :: n, width, c

    do n = maxval(levels), 2, -1
      ! in cells of level 0, of which those of level n - 2 are parts
      width = ceiling(ratio/2**(n - 2)*(1 - 1.0e-9_wp))
      inside = levels >= n
      do c = 1, dim
        call widen(c, width, inside)
      end do
      where (inside) levels = max(levels, int(n - 1, i4))
    end do
  end subroutine spread_levels

  !> Take in what is within `width` cells along axis `c`.
  pure subroutine widen(c, width, inside)
    integer, intent(in) :: c, width
    logical, intent(inout) :: inside(:, :, :)
    logical, allocatable :: before(:, :, :)
    integer :: i, j, k, at(3), low(3), high(3)

    allocate (before, source=inside)
    do k = 1, size(before, 3)
      do j = 1, size(before, 2)
        do i = 1, size(before, 1)
          if (.not. before(i, j, k)) cycle
          at = [i, j, k]
          low = at
          high = at
          low(c) = max(1, at(c) - width)
          high(c) = min(size(before, c), at(c) + width)
          inside(low(1):high(1), low(2):high(2), low(3):high(3)) = .true.
        end do
      end do
    end do
  end subroutine widen

  !> The points of one level, x fastest.
  pure subroutine cells_of_level(dim, lattice, levels, n, depth, points)
    integer, intent(in) :: dim
    type(lattice_type), intent(in) :: lattice
    integer(i4), intent(in) :: levels(:, :, :)
    integer, intent(in) :: n
    real(wp), intent(in) :: depth
    type(body_type), intent(out) :: points
    type(body_type) :: row
    type(grid_type) :: grid
    integer :: parts(3), i, j, k, next, first(3), last(3)

    parts = 1
    parts(:dim) = 2**n
    grid = finer(lattice%grid, n)
    call allocate_points(points, dim, int(count(levels == n, kind=i8)*product(parts)))
    next = 0
    do k = 0, size(levels, 3)*parts(3) - 1
      do j = 0, size(levels, 2)*parts(2) - 1
        do i = 1, size(levels, 1)
          if (levels(i, 1 + j/parts(2), 1 + k/parts(3)) /= n) cycle
          first = [parts(1)*(i - 1) + 1, j + 1, k + 1]
          last = [parts(1)*i, j + 1, k + 1]
          call box_of_cells(dim, grid, first, last, depth, row)
          points%x(next + 1:next + parts(1), :) = row%x
          next = next + parts(1)
        end do
      end do
    end do
    points%spacing = grid%spacing
    points%volume = depth*grid%spacing**dim
  end subroutine cells_of_level

  !> The grid of the cells of level `n`.
  pure type(grid_type) function finer(grid, n)
    type(grid_type), intent(in) :: grid  !! of the body
    integer, intent(in) :: n             !! level

    finer = grid
    finer%spacing = grid%spacing/2**n
  end function finer

  !> The level of the point in a slot: 0 in clouds and meshes.
  pure integer function level_of(body, slot) result(level)
    type(body_type), intent(in) :: body  !! with its lattices
    integer, intent(in) :: slot          !! of a point

    level = 0
    if (body%grid(slot) == 0) return
    associate (grid => body%lattices(body%body(slot))%grid)
      level = nint(log(grid%spacing/body%spacing(slot))/log(2.0_wp))
    end associate
  end function level_of

end module pd_body_refine
