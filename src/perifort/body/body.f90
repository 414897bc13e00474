!> Material points as structure of arrays.
!>
!> A point's place in the arrays is its slot. A body is made in point order (slot = point); the
!> family then arranges it: a list family sorts the points, a lattice family also adds dead slots
!> (padding and cells cut out), which have no volume and no bonds. Results are written in point
!> order.
module pd_body_body
  use pd_base_kinds, only: wp, i2, i4
  implicit none (type, external)
  private
  public :: body_type, grid_type, allocate_points, append_points, keep_points, arrange, &
    & in_point_order

  !> A uniform grid: points at origin + (i - 1/2) spacing, i integer.
  type :: grid_type
    real(wp) :: origin(3) = 0.0_wp  !! [m]
    real(wp) :: spacing = 0.0_wp    !! [m]
  end type grid_type

  type :: body_type
    integer :: dim = 0
    integer :: n_points = 0                 !! live points
    integer :: n_slots = 0                  !! length of the arrays
    real(wp), allocatable :: x(:, :)        !! reference positions (n_slots, dim) [m]
    real(wp), allocatable :: volume(:)      !! [m3], 0 in dead slots
    real(wp), allocatable :: spacing(:)     !! [m]; clouds: volume^(1/dim)
    integer(i2), allocatable :: body(:)     !! number of the point's body
    integer(i2), allocatable :: material(:) !! number of its material
    integer(i2), allocatable :: layer(:)    !! 0, or the number of its boundary group
    integer(i2), allocatable :: grid(:)     !! number of its grid, 0 in a cloud
    integer(i4), allocatable :: point(:)    !! the slot's point, 0 if dead
    integer(i4), allocatable :: slot(:)     !! the point's slot (n_points)
    type(grid_type), allocatable :: grids(:)
  end type body_type

  interface gather
    module procedure :: gather_real, gather_small
  end interface gather

  !> Values (or vectors) of slots in the order of points.
  interface in_point_order
    module procedure :: reals_in_point_order, integers_in_point_order
  end interface in_point_order

contains

  !> An empty body with room for `n` points, slots in point order.
  pure subroutine allocate_points(body, dim, n)
    type(body_type), intent(out) :: body  !! positions, volumes and numbers are 0, grids none
    integer, intent(in) :: dim            !! of the scene: 1, 2 or 3
    integer, intent(in) :: n              !! number of points
    integer :: k

    body%dim = dim
    body%n_points = n
    body%n_slots = n
    allocate (body%x(n, dim), body%volume(n), body%spacing(n), source=0.0_wp)
    allocate (body%body(n), body%material(n), body%layer(n), body%grid(n), source=0_i2)
    body%point = [(int(k, i4), k=1, n)]
    body%slot = body%point
    allocate (body%grids(0))
  end subroutine allocate_points

  !> Put the points of `more` behind those of `body`; both in point order, grids are those of
  !> `body`.
  pure subroutine append_points(body, more)
    type(body_type), intent(inout) :: body  !! in point order; with the points of both on return
    type(body_type), intent(in) :: more     !! in point order, of the same dimension
    real(wp), allocatable :: x(:, :)
    integer :: n, k

    n = body%n_points
    allocate (x(n + more%n_points, body%dim))
    x(:n, :) = body%x
    x(n + 1:, :) = more%x
    call move_alloc(x, body%x)
    body%volume = [body%volume, more%volume]
    body%spacing = [body%spacing, more%spacing]
    body%body = [body%body, more%body]
    body%material = [body%material, more%material]
    body%layer = [body%layer, more%layer]
    body%grid = [body%grid, more%grid]
    body%n_points = n + more%n_points
    body%n_slots = body%n_points
    body%point = [(int(k, i4), k=1, body%n_points)]
    body%slot = body%point
  end subroutine append_points

  !> Drop the points where `keep` is false; the body is in point order before and after.
  pure subroutine keep_points(body, keep)
    type(body_type), intent(inout) :: body  !! in point order; without the dropped points on return
    logical, intent(in) :: keep(:)          !! (n_points), whether the point stays
    integer(i4), allocatable :: kept(:)
    integer :: k

    kept = pack([(int(k, i4), k=1, size(keep))], keep)
    body%n_points = size(kept)
    call gather_all(body, kept)
    body%point = [(int(k, i4), k=1, body%n_points)]
    body%slot = body%point
  end subroutine keep_points

  !> Move every point into its slot. `point(slot)` is 0 for dead slots.
  pure subroutine arrange(body, point)
    type(body_type), intent(inout) :: body  !! in point order; with its slots and their order on
                                            !! return
    integer(i4), intent(in) :: point(:)     !! (n_slots), the point that each slot takes; 0: a dead
                                            !! slot
    integer :: s

    call gather_all(body, point)
    body%point = point
    do s = 1, size(point)
      if (point(s) > 0) body%slot(point(s)) = int(s, i4)
    end do
    ! a dead slot needs a valid material, so that loops over rows need no test
    where (point == 0) body%material = 1_i2
  end subroutine arrange

  !> Take the values of `from(i)` to place i; 0 gives zeros.
  pure subroutine gather_all(body, from)
    type(body_type), intent(inout) :: body
    integer(i4), intent(in) :: from(:)
    real(wp), allocatable :: x(:, :)
    integer :: c, i

    body%n_slots = size(from)
    allocate (x(size(from), body%dim), source=0.0_wp)
    do c = 1, body%dim
      do i = 1, size(from)
        if (from(i) > 0) x(i, c) = body%x(from(i), c)
      end do
    end do
    call move_alloc(x, body%x)
    call gather(body%volume, from)
    call gather(body%spacing, from)
    call gather(body%body, from)
    call gather(body%material, from)
    call gather(body%layer, from)
    call gather(body%grid, from)
  end subroutine gather_all

  pure subroutine gather_real(values, from)
    real(wp), allocatable, intent(inout) :: values(:)
    integer(i4), intent(in) :: from(:)
    real(wp), allocatable :: gathered(:)
    integer :: i

    allocate (gathered(size(from)), source=0.0_wp)
    do i = 1, size(from)
      if (from(i) > 0) gathered(i) = values(from(i))
    end do
    call move_alloc(gathered, values)
  end subroutine gather_real

  pure subroutine gather_small(values, from)
    integer(i2), allocatable, intent(inout) :: values(:)
    integer(i4), intent(in) :: from(:)
    integer(i2), allocatable :: gathered(:)
    integer :: i

    allocate (gathered(size(from)), source=0_i2)
    do i = 1, size(from)
      if (from(i) > 0) gathered(i) = values(from(i))
    end do
    call move_alloc(gathered, values)
  end subroutine gather_small

  !> Real numbers of slots in the order of points.
  pure subroutine reals_in_point_order(body, values, ordered)
    type(body_type), intent(in) :: body    !! gives the slot of each point
    real(wp), intent(in) :: values(:)      !! (n_slots), in the order of slots
    real(wp), intent(inout) :: ordered(:)  !! (n_points), in the order of points on return
    integer :: i

    do i = 1, body%n_points
      ordered(i) = values(body%slot(i))
    end do
  end subroutine reals_in_point_order

  !> Short integers of slots in the order of points.
  pure subroutine integers_in_point_order(body, values, ordered)
    type(body_type), intent(in) :: body       !! gives the slot of each point
    integer(i2), intent(in) :: values(:)      !! (n_slots), in the order of slots
    integer(i4), intent(inout) :: ordered(:)  !! (n_points), in the order of points on return
    integer :: i

    do i = 1, body%n_points
      ordered(i) = int(values(body%slot(i)), i4)
    end do
  end subroutine integers_in_point_order

end module pd_body_body
