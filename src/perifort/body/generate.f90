!> Points of a scene: lattices, clouds, removed shapes, and the layers that boundaries add.
!>
!> Order (that of the results): body by body, a lattice's points x fastest, then y, then z; then
!> the layers in the order of their boundary groups.
module pd_body_generate
  use pd_base_kinds, only: wp, i2, i4
  use pd_base_error, only: error_type, fail
  use pd_base_text, only: newline, to_text, with_unit
  use pd_scene_types, only: scene_type, body_group, is_set
  use pd_scene_file, only: resolve_path
  use pd_scene_rules, only: place_fault, scene_fault
  use pd_scene_table, only: table_type, read_table
  use pd_body_body, only: body_type, grid_type, allocate_points, append_points, keep_points
  use pd_body_shapes, only: inside
  implicit none (type, external)
  private
  public :: generate_body, horizon_of, lattice_points, layer_rows, touch

  real(wp), parameter :: same_grid = 1.0e-6_wp  !! how far two grids may differ [spacings]
  real(wp), parameter :: touch = 1.0e-6_wp      !! what counts as on a surface [spacings]
  real(wp), parameter :: largest_ratio = 1.0e4_wp  !! of horizon to spacing
  real(wp), parameter :: most_members = 2.0e5_wp  !! of the box around a horizon [points]

contains

  !> All points of the scene, in point order, and the horizon delta [m].
  subroutine generate_body(scene, body, delta, error)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(out) :: body
    real(wp), intent(out) :: delta
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: one
    real(wp) :: depth
    integer :: i

    delta = 0.0_wp
    depth = 1.0_wp
    if (scene%header%dimension == 2) depth = scene%header%thickness
    if (scene%header%dimension == 1) depth = scene%header%area
    call allocate_points(body, scene%header%dimension, 0)
    do i = 1, size(scene%bodies)
      if (scene%bodies(i)%file /= '') then
        call cloud_points(scene, i, depth, one, error)
        if (allocated(error)) return
      else
        call lattice_points(body%dim, scene%bodies(i), depth, one)
        one%grid = number_of_grid(body, lattice_grid(scene%bodies(i), body%dim))
      end if
      one%body = int(i, i2)
      one%material = material_number(scene, scene%bodies(i)%material)
      call append_points(body, one)
    end do
    do i = 1, size(scene%removed)
      call keep_points(body, .not. inside(scene%removed(i), body%x, touch*minval(body%spacing)))
    end do
    if (body%n_points == 0) then
      call scene_fault(error, scene, 'remove', size(scene%removed), 'shape', &
        & 'the scene has no points: every point of its bodies was removed', '')
      return
    end if
    delta = horizon_of(scene, maxval(body%spacing))
    call check_family_size(scene, body%dim, delta, minval(body%spacing), error)
    if (allocated(error)) return
    do i = 1, size(scene%boundaries)
      if (scene%boundaries(i)%side == '') cycle
      call add_layer(scene, i, delta, depth, body)
    end do
  end subroutine generate_body

  !> An error if the horizon holds more points than any computation is meant to have in a family;
  !> what is counted in families and offsets below then fits its integers.
  subroutine check_family_size(scene, dim, delta, spacing, error)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: dim
    real(wp), intent(in) :: delta, spacing
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: members, points
    integer :: i

    members = (2*min(delta/spacing, most_members))**dim
    if (members <= most_members) return
    if (all(scene%bodies%file == '')) then
      points = 0.0_wp
      do i = 1, size(scene%bodies)
        points = points + product(real(scene%bodies(i)%points(:dim), wp))
      end do
      ! a small body may lie in its horizon as a whole
      if (points <= most_members .and. delta/spacing <= largest_ratio) return
    end if
    call scene_fault(error, scene, 'horizon', 1, merge('length', 'ratio ', &
      & is_set(scene%horizon%length)), 'the horizon of '//with_unit(delta, 'm')//' is too large &
      &for a smallest spacing of '//with_unit(spacing, 'm'), 'a family of the points around one &
      &may have about '//to_text(most_members)//' members')
  end subroutine check_family_size

  !> delta [m]: the length given, or the ratio times the largest spacing.
  pure real(wp) function horizon_of(scene, largest_spacing) result(delta)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: largest_spacing
    delta = scene%horizon%ratio*largest_spacing
    if (is_set(scene%horizon%length)) delta = scene%horizon%length
  end function horizon_of

  !> Points of a lattice at the centres of its cells. `depth` is what makes dx^dim a volume.
  pure subroutine lattice_points(dim, group, depth, body)
    integer, intent(in) :: dim
    type(body_group), intent(in) :: group
    real(wp), intent(in) :: depth
    type(body_type), intent(out) :: body
    type(grid_type) :: grid
    integer :: count(3)

    count = 1
    count(:dim) = group%points(:dim)
    grid = lattice_grid(group, dim)
    call box_of_cells(dim, grid, [1, 1, 1], count, depth, body)
  end subroutine lattice_points

  !> The grid of a lattice body: its cell 1 begins at the body's lower corner.
  pure type(grid_type) function lattice_grid(group, dim) result(grid)
    type(body_group), intent(in) :: group
    integer, intent(in) :: dim
    grid%origin(:dim) = group%lower(:dim)
    grid%spacing = (group%upper(1) - group%lower(1))/group%points(1)
  end function lattice_grid

  !> Points at the centres of the cells first..last of a grid, x fastest.
  pure subroutine box_of_cells(dim, grid, first, last, depth, body)
    integer, intent(in) :: dim
    type(grid_type), intent(in) :: grid
    integer, intent(in) :: first(3), last(3)
    real(wp), intent(in) :: depth
    type(body_type), intent(out) :: body
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

  !> Number of `grid` among the body's grids; a new one is added. Grids that coincide are one.
  integer(i2) function number_of_grid(body, grid) result(number)
    type(body_type), intent(inout) :: body
    type(grid_type), intent(in) :: grid
    real(wp) :: shift(3)
    integer :: i

    do i = 1, size(body%grids)
      if (abs(body%grids(i)%spacing - grid%spacing) > same_grid*grid%spacing) cycle
      shift = (grid%origin - body%grids(i)%origin)/grid%spacing
      if (maxval(abs(shift - anint(shift))) > same_grid) cycle
      number = int(i, i2)
      return
    end do
    body%grids = [body%grids, grid]
    number = int(size(body%grids), i2)
  end function number_of_grid

  !> Points of a cloud file: columns x y z volume. Coordinates that the dimension doesn't use must be
  !> the same for all points.
  subroutine cloud_points(scene, i, depth, body, error)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: i
    real(wp), intent(in) :: depth
    type(body_type), intent(out) :: body
    type(error_type), allocatable, intent(out) :: error
    type(table_type) :: table
    character(:), allocatable :: path
    integer :: worst, c

    path = resolve_path(trim(scene%bodies(i)%file), scene%file)
    call read_table(path, table, error, columns=4)
    call place_fault(error, scene, 'body', i, 'file')
    if (allocated(error)) return
    call allocate_points(body, scene%header%dimension, size(table%values, 2))
    body%x = transpose(table%values(:body%dim, :))
    body%volume = table%values(4, :)
    worst = minloc(body%volume, dim=1)
    if (body%volume(worst) <= 0.0_wp) then
      call fail(error, &
        & 'every point of a cloud needs a positive volume (the fourth column), but here '// &
        & 'it is '//to_text(body%volume(worst))//newline//' --> '//path//':'// &
        & to_text(table%lines(worst)))
      return
    end if
    body%spacing = (body%volume/depth)**(1.0_wp/body%dim)
    do c = body%dim + 1, 3
      worst = maxloc(abs(table%values(c, :) - table%values(c, 1)), dim=1)
      if (abs(table%values(c, worst) - table%values(c, 1)) <= touch*maxval(body%spacing)) cycle
      call fail(error, 'a scene of dimension '//to_text(body%dim)//' has no direction '// &
        & 'xyz'(c:c)//', but the points of the cloud differ in it: '// &
        & to_text(table%values(c, 1))//' and '//to_text(table%values(c, worst))//newline// &
        & ' --> '//path//':'//to_text(table%lines(worst)))
      return
    end do
  end subroutine cloud_points

  !> Number of a material by name; '' is the only one.
  pure integer(i2) function material_number(scene, name) result(number)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: name
    integer :: i

    number = 1_i2
    do i = 1, size(scene%materials)
      if (name /= '' .and. scene%materials(i)%name == name) number = int(i, i2)
    end do
  end function material_number

  !> Rows of a boundary layer (doc/theory.md, 10): 3 at a ratio of 3.015.
  pure integer function layer_rows(delta, spacing) result(rows)
    real(wp), intent(in) :: delta, spacing
    rows = max(1, floor(delta/spacing*(1 + 1.0e-9_wp)))
  end function layer_rows

  !> The layer of boundary `number`: rows of cells outside the face of its body, or outside the
  !> common face of all bodies, where each body that reaches the face continues its own lattice.
  subroutine add_layer(scene, number, delta, depth, body)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: number
    real(wp), intent(in) :: delta, depth
    type(body_type), intent(inout) :: body
    type(body_type) :: layer
    type(grid_type) :: grid
    real(wp) :: face, own
    logical :: at_lower
    integer :: axis, first(3), last(3), i, rows

    axis = index('xyz', scene%boundaries(number)%side(1:1))
    at_lower = scene%boundaries(number)%side(3:5) == 'min'
    face = face_of_all(scene, axis, at_lower)
    do i = 1, size(scene%bodies)
      associate (group => scene%bodies(i), wanted => scene%boundaries(number)%body)
        if (wanted /= '' .and. group%name /= wanted) cycle
        if (group%file /= '') cycle
        own = merge(group%lower(axis), group%upper(axis), at_lower)
        grid = lattice_grid(group, body%dim)
        if (wanted == '' .and. abs(own - face) > grid%spacing/2) cycle
        rows = layer_rows(delta, grid%spacing)
        first = 1
        last = 1
        last(:body%dim) = group%points(:body%dim)
        if (at_lower) then
          first(axis) = 1 - rows
          last(axis) = 0
        else
          first(axis) = group%points(axis) + 1
          last(axis) = group%points(axis) + rows
        end if
        call box_of_cells(body%dim, grid, first, last, depth, layer)
        layer%grid = number_of_grid(body, grid)
        layer%body = int(i, i2)
        layer%material = material_number(scene, group%material)
        layer%layer = int(number, i2)
        call append_points(body, layer)
      end associate
    end do
  end subroutine add_layer

  !> The bounding face of all lattice bodies along `axis` [m].
  pure real(wp) function face_of_all(scene, axis, at_lower) result(face)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: axis
    logical, intent(in) :: at_lower
    integer :: i

    face = merge(huge(face), -huge(face), at_lower)
    do i = 1, size(scene%bodies)
      if (scene%bodies(i)%file /= '') cycle
      if (at_lower) face = min(face, scene%bodies(i)%lower(axis))
      if (.not. at_lower) face = max(face, scene%bodies(i)%upper(axis))
    end do
  end function face_of_all

end module pd_body_generate
