!> Material points as structure of arrays.
!>
!> A point's place in the arrays is its slot. A body is made in point order (slot = point); the
!> family then arranges it: a list family sorts the points, a lattice family also adds dead slots
!> (padding and cells cut out), which have no volume and no bonds. Results are written in point
!> order. `gather` and `scatter` translate between the two.
!>
!> A process owns its first points; the others, its halo, are copies of what other processes own.
!> One process alone owns all.
module pd_body_body
  use pd_base_text, only: to_text
  use pd_base_kinds, only: wp, i2, i4, i8
  use pd_base_order, only: exchange, number_points, order_type, owns
  use pd_body_mesh_part, only: part_type
  use pd_body_side_areas, only: side_areas_type
  use pd_body_surface_surface, only: surface_type
  implicit none (type, external)
  private
  public :: body_type, not_finite_text, grid_type, lattice_type, skin_type, allocate_points, &
    & append_points, keep_points, order_points, arrange, gather, scatter, own_points, owned, &
    & number_at, share_halo, start_halo, finish_halo

  !> A uniform grid: points at origin + axes (i - 1/2) spacing, i integer.
  type :: grid_type
    real(wp) :: origin(3) = 0.0_wp  !! [m]
    real(wp) :: spacing = 0.0_wp    !! [m]
    logical :: turned = .false.     !! its axes are not x, y and z
    !> The least place of a point of any rank along each axis, known where forces must not depend
    !> on the ranks [m].
    real(wp), allocatable :: lowest(:)
    !> Unit vectors in columns.
    real(wp) :: axes(3, 3) = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3])
  end type grid_type

  !> The cells of a body that is a lattice.
  type :: lattice_type
    type(grid_type) :: grid
    integer :: cells(3) = 0         !! of the box around it, along each axis; 0: no lattice
  end type lattice_type

  !> The surface that a body's lattice fills.
  type :: skin_type
    integer :: body = 0             !! number of the body
    type(lattice_type) :: lattice   !! its cells
    type(surface_type) :: surface
  end type skin_type

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
    type(order_type) :: order               !! the points that the process owns, for sums over them
    integer(i8), allocatable :: number(:)   !! of each point among those of all processes; not
                                            !! allocated: its number here
    type(grid_type), allocatable :: grids(:)
    real(wp) :: delta = 0.0_wp              !! the horizon, the largest one of all points [m]
    real(wp) :: least_spacing = 0.0_wp      !! of the points of all processes; 0 where these have
    real(wp) :: largest_spacing = 0.0_wp    !! not been counted [m]
    type(part_type), allocatable :: parts(:)  !! bodies that are meshes
    type(skin_type), allocatable :: skins(:)  !! bodies that fill surfaces
    type(lattice_type), allocatable :: lattices(:)  !! (bodies of the scene)
    type(side_areas_type), allocatable :: sides  !! of the arranged points, where weights of bonds
                                                 !! need balanced ones
    real(wp), allocatable :: surface_area(:, :) !! (n_slots, dim) outward areas that were found with
                                                 !! weights of bonds, if any were [m2]
  end type body_type

  interface take
    module procedure :: take_real, take_small
  end interface take

  !> Values, or vectors, of slots in the order of the points that the process owns.
  interface gather
    module procedure :: gather_reals, gather_vectors, gather_small, gather_logicals
  end interface gather

  !> Values of the points that the process owns into their slots; other slots stay as they are.
  interface scatter
    module procedure :: scatter_reals, scatter_vectors
  end interface scatter

  !> Copy values of points that other processes own from there.
  interface share_halo
    module procedure :: share_scalars, share_vectors
  end interface share_halo

  !> The same in two calls. What is computed between them must not need values of copies. The first
  !> sends the values of owned points, which then may change; the second waits for those of copies.
  interface start_halo
    module procedure :: start_scalars, start_vectors
  end interface start_halo

  interface finish_halo
    module procedure :: finish_scalars, finish_vectors
  end interface finish_halo

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
    allocate (body%grids(0), body%parts(0), body%skins(0), body%lattices(0))
    call own_all(body)
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
    call own_all(body)
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
    call own_all(body)
  end subroutine keep_points

  !> Put the points of a body into another order: point i becomes what point `order(i)` was.
  pure subroutine order_points(body, order)
    type(body_type), intent(inout) :: body  !! in point order, before and after
    integer(i4), intent(in) :: order(:)     !! (n_points) each number once
    call gather_all(body, order)
    call own_all(body)
  end subroutine order_points

  !> Move every point into its slot. `point(slot)` is 0 for dead slots.
  pure subroutine arrange(body, point)
    type(body_type), intent(inout) :: body  !! in point order; with its slots and their order on
                                            !! return
    integer(i4), intent(in) :: point(:)     !! (n_slots), the point that each slot takes; 0: a dead
                                            !! slot
    integer(i8) :: n_global
    integer :: s, n_owned

    call gather_all(body, point)
    body%point = point
    do s = 1, size(point)
      if (point(s) > 0) body%slot(point(s)) = int(s, i4)
    end do
    ! a dead slot needs a valid material, so that loops over rows need no test
    where (point == 0) body%material = 1_i2
    n_owned = body%order%n_owned
    n_global = body%order%n_global
    call order_owned(body, n_owned, n_global)
  end subroutine arrange

  !> The process owns all points.
  pure subroutine own_all(body)
    type(body_type), intent(inout) :: body
    if (allocated(body%number)) deallocate (body%number)
    if (allocated(body%order%number)) deallocate (body%order%number)
    call number_points(body%slot, body%order)
  end subroutine own_all

  !> Note which points the process owns: the first ones.
  pure subroutine own_points(body, n_owned, number, n_global)
    type(body_type), intent(inout) :: body  !! in point order or arranged in slots
    integer, intent(in) :: n_owned          !! how many
    integer(i8), intent(in) :: number(:)    !! (n_points) among the points of all processes; those
                                            !! of owned points ascend
    integer(i8), intent(in) :: n_global     !! points of all processes

    body%number = number
    call order_owned(body, n_owned, n_global)
  end subroutine own_points

  !> Bring the order of the owned points up to date.
  pure subroutine order_owned(body, n_owned, n_global)
    type(body_type), intent(inout) :: body
    integer, intent(in) :: n_owned
    integer(i8), intent(in) :: n_global

    if (allocated(body%number)) then
      call number_points(body%slot(:n_owned), body%order, body%number(:n_owned), n_global)
    else
      call number_points(body%slot, body%order)
    end if
  end subroutine order_owned

  !> The number of a slot's point among those of all processes; 0 for a dead slot.
  elemental integer(i8) function number_at(body, slot) result(number)
    type(body_type), intent(in) :: body  !! arranged in slots
    integer, intent(in) :: slot          !! 1 to n_slots
    number = int(body%point(slot), i8)
    if (allocated(body%number) .and. number > 0_i8) number = body%number(number)
  end function number_at

  !> Whether the process owns the point of a slot; no process owns dead slots.
  elemental logical function owned(body, slot)
    type(body_type), intent(in) :: body  !! with its owned points
    integer, intent(in) :: slot          !! 1 to n_slots
    owned = owns(body%order, body%point(slot))
  end function owned

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
    call take(body%volume, from)
    call take(body%spacing, from)
    call take(body%body, from)
    call take(body%material, from)
    call take(body%layer, from)
    call take(body%grid, from)
  end subroutine gather_all

  pure subroutine take_real(values, from)
    real(wp), allocatable, intent(inout) :: values(:)
    integer(i4), intent(in) :: from(:)
    real(wp), allocatable :: gathered(:)
    integer :: i

    allocate (gathered(size(from)), source=0.0_wp)
    do i = 1, size(from)
      if (from(i) > 0) gathered(i) = values(from(i))
    end do
    call move_alloc(gathered, values)
  end subroutine take_real

  pure subroutine take_small(values, from)
    integer(i2), allocatable, intent(inout) :: values(:)
    integer(i4), intent(in) :: from(:)
    integer(i2), allocatable :: gathered(:)
    integer :: i

    allocate (gathered(size(from)), source=0_i2)
    do i = 1, size(from)
      if (from(i) > 0) gathered(i) = values(from(i))
    end do
    call move_alloc(gathered, values)
  end subroutine take_small

  pure subroutine gather_reals(body, of_slots, of_points)
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: of_slots(:)       !! (n_slots)
    real(wp), intent(inout) :: of_points(:)   !! (owned points)
    integer :: i

    do i = 1, body%order%n_owned
      of_points(i) = of_slots(body%slot(i))
    end do
  end subroutine gather_reals

  pure subroutine gather_vectors(body, of_slots, of_points)
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: of_slots(:, :)       !! (n_slots, components)
    real(wp), intent(inout) :: of_points(:, :)   !! (owned points, as many or more)
    integer :: i, c

    do c = 1, size(of_slots, 2)
      do i = 1, body%order%n_owned
        of_points(i, c) = of_slots(body%slot(i), c)
      end do
    end do
  end subroutine gather_vectors

  pure subroutine gather_small(body, of_slots, of_points)
    type(body_type), intent(in) :: body
    integer(i2), intent(in) :: of_slots(:)       !! (n_slots)
    integer(i4), intent(inout) :: of_points(:)   !! (owned points)
    integer :: i

    do i = 1, body%order%n_owned
      of_points(i) = int(of_slots(body%slot(i)), i4)
    end do
  end subroutine gather_small

  pure subroutine gather_logicals(body, of_slots, of_points)
    type(body_type), intent(in) :: body
    logical, intent(in) :: of_slots(:)       !! (n_slots)
    logical, intent(inout) :: of_points(:)   !! (owned points)
    integer :: i

    do i = 1, body%order%n_owned
      of_points(i) = of_slots(body%slot(i))
    end do
  end subroutine gather_logicals

  pure subroutine scatter_reals(body, of_points, of_slots)
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: of_points(:)      !! (owned points)
    real(wp), intent(inout) :: of_slots(:)    !! (n_slots)
    integer :: i

    do i = 1, body%order%n_owned
      of_slots(body%slot(i)) = of_points(i)
    end do
  end subroutine scatter_reals

  pure subroutine scatter_vectors(body, of_points, of_slots)
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: of_points(:, :)      !! (owned points, components)
    real(wp), intent(inout) :: of_slots(:, :)    !! (n_slots, components)
    integer :: i, c

    do c = 1, size(of_points, 2)
      do i = 1, body%order%n_owned
        of_slots(body%slot(i), c) = of_points(i, c)
      end do
    end do
  end subroutine scatter_vectors

  subroutine share_scalars(body, values)
    type(body_type), intent(in) :: body
    real(wp), intent(inout), contiguous :: values(:)      !! (n_slots)
    call start_scalars(body, values)
    call finish_scalars(body, values)
  end subroutine share_scalars

  subroutine share_vectors(body, values)
    type(body_type), intent(in) :: body
    real(wp), intent(inout), contiguous :: values(:, :)   !! (n_slots, components)
    if (associated(body%order%ranks)) call body%order%ranks%share(values)
  end subroutine share_vectors

  subroutine start_scalars(body, values)
    type(body_type), intent(in) :: body
    real(wp), intent(in), contiguous, target :: values(:)  !! (n_slots)
    real(wp), pointer, contiguous :: vectors(:, :)

    if (.not. associated(body%order%ranks)) return
    vectors(1:size(values), 1:1) => values
    call body%order%ranks%start_sharing(vectors, exchange)
  end subroutine start_scalars

  subroutine finish_scalars(body, values)
    type(body_type), intent(in) :: body
    real(wp), intent(inout), contiguous, target :: values(:)  !! (n_slots)
    real(wp), pointer, contiguous :: vectors(:, :)

    if (.not. associated(body%order%ranks)) return
    vectors(1:size(values), 1:1) => values
    call body%order%ranks%finish_sharing(vectors, exchange)
  end subroutine finish_scalars

  subroutine start_vectors(body, values, which)
    type(body_type), intent(in) :: body
    real(wp), intent(in), contiguous :: values(:, :)     !! (n_slots, components)
    integer, intent(in), optional :: which               !! `exchange` if absent
    integer :: number

    number = exchange
    if (present(which)) number = which
    if (associated(body%order%ranks)) call body%order%ranks%start_sharing(values, number)
  end subroutine start_vectors

  subroutine finish_vectors(body, values, which)
    type(body_type), intent(in) :: body
    real(wp), intent(inout), contiguous :: values(:, :)  !! (n_slots, components)
    integer, intent(in), optional :: which               !! `exchange` if absent
    integer :: number

    number = exchange
    if (present(which)) number = which
    if (associated(body%order%ranks)) call body%order%ranks%finish_sharing(values, number)
  end subroutine finish_vectors

  !> Where and when a value is not finite.
  function not_finite_text(body, slot, t) result(text)
    type(body_type), intent(in) :: body  !! the points
    integer(i4), intent(in) :: slot      !! of the point; 0: it belongs to none
    real(wp), intent(in) :: t            !! time [s]
    character(:), allocatable :: text
    integer :: c

    if (slot == 0) then
      text = 'has no finite value at t = '//to_text(t)//' s'
      return
    end if
    text = 'has no finite value at point '//to_text(number_at(body, int(slot)))//' at ('
    do c = 1, body%dim
      if (c > 1) text = text//', '
      text = text//to_text(body%x(slot, c))
    end do
    text = text//') m, t = '//to_text(t)//' s'
  end function not_finite_text

end module pd_body_body
