!> Points of a scene: lattices, also inside of surfaces (`pd_body_surfaces`), clouds
!> (`pd_body_clouds`), meshes (`pd_body_meshes`), removed shapes, and the layers that boundaries add
!> (`pd_body_layers`).
!>
!> Order (that of the results): body by body, a lattice's points x fastest, then y, then z; then
!> the layers in the order of their boundary groups.
module pd_body_generate
  use pd_base_kinds, only: wp, i2, i4
  use pd_base_error, only: error_type
  use pd_base_text, only: to_text, with_unit
  use pd_base_warnings, only: warnings_type
  use pd_scene_content_types, only: body_group, has_cut_cells, has_own_horizons, has_refinement, &
    & is_lattice, scene_type, is_set, unset, words_of_body
  use pd_scene_content_rules, only: scene_fault
  use pd_body_body, only: body_type, grid_type, lattice_type, skin_type, allocate_points, &
    & append_points, keep_points
  use pd_body_clouds, only: cloud_points
  use pd_body_meshes, only: keep_part, material_number, mesh_body
  use pd_body_mesh_part, only: part_type
  use pd_body_lattices, only: box_of_cells, lattice_grid, lattice_of, place_in
  use pd_body_layers, only: add_layers, layer_count_type
  use pd_body_overlap, only: check_lattices
  use pd_body_refine, only: finer, refine_lattice
  use pd_body_choice, only: choose_points
  use pd_body_shapes, only: inside_body, touch
  use pd_body_surfaces, only: keep_skin, surface_body
  implicit none (type, external)
  private
  public :: generate_body, horizon_of, body_cells, check_family_size, number_of_grid
  public :: number_of_cuts, find_taken, no_cell, nothing_left

  real(wp), parameter :: same_grid = 1.0e-6_wp  !! how far two grids may differ [spacings]
  real(wp), parameter :: same_axes = 1.0e-9_wp  !! how far those of one grid may differ
  real(wp), parameter :: largest_ratio = 1.0e4_wp  !! of horizon to spacing
  real(wp), parameter :: most_members = 2.0e5_wp  !! of the box around a horizon [points]

contains

  !> All points of the scene, in point order. An error if a cloud cannot be read or has a point
  !> without volume, if no point is left, if the horizon holds too many points, if a layer joins
  !> none, or if bodies or layers overlap.
  subroutine generate_body(scene, body, delta, error, counts, warnings)
    type(scene_type), intent(in) :: scene  !! checked, with its files' names
    type(body_type), intent(out) :: body   !! all points, layers last, in point order
    real(wp), intent(out) :: delta                          !! the (largest) horizon [m]
    type(error_type), allocatable, intent(out) :: error
    type(layer_count_type), allocatable, intent(out), optional :: counts(:)  !! what the columns
                                                            !! of each layer came to
    type(warnings_type), intent(inout), optional :: warnings  !! get what may surprise of meshes
    type(part_type) :: part
    type(skin_type) :: skin
    type(lattice_type), allocatable :: lattices(:)
    logical, allocatable :: used(:)
    real(wp) :: spacing, largest
    type(layer_count_type), allocatable :: counted(:)
    type(body_type) :: one
    real(wp) :: depth
    integer :: i

    delta = 0.0_wp
    spacing = 0.0_wp
    depth = 1.0_wp
    if (scene%header%dimension == 2) depth = scene%header%thickness
    if (scene%header%dimension == 1) depth = scene%header%area
    call allocate_points(body, scene%header%dimension, 0)
    allocate (lattices(size(scene%bodies)))
    do i = 1, size(scene%bodies)
      largest = -1.0_wp
      if (scene%bodies(i)%mesh /= '') then
        call mesh_body(scene, i, depth, one, part, largest, error, warnings)
        if (allocated(error)) return
        call keep_part(body, part)
      else if (scene%bodies(i)%file /= '') then
        call cloud_points(scene, i, depth, one, error)
        if (allocated(error)) return
      else if (scene%bodies(i)%surface /= '') then
        call surface_body(scene, i, one, lattices(i), skin, error, warnings)
        if (allocated(error)) return
        call keep_skin(body, skin)
        if (.not. has_cut_cells(scene%bodies(i))) one%grid = number_of_grid(body, lattices(i)%grid)
      else
        lattices(i) = lattice_of(scene%bodies(i), body%dim)
        call body_cells(body%dim, scene%bodies(i), [1, 1, 1], lattices(i)%cells, depth, one)
        one%grid = number_of_grid(body, lattices(i)%grid)
        if (has_refinement(scene)) call refine(scene, lattices(i), depth, used, body, one, error)
        if (allocated(error)) return
      end if
      if (one%n_points == 0) call no_cell(scene, i, error)
      if (allocated(error)) return
      one%body = int(i, i2)
      if (scene%bodies(i)%mesh == '') one%material = material_number(scene, &
        & scene%bodies(i)%material)
      spacing = max(spacing, largest)
      call append_points(body, one)
    end do
    call move_alloc(lattices, body%lattices)
    if (allocated(used)) then
      if (.not. all(used)) then
        i = findloc(used, .false., dim=1)
        call scene_fault(error, scene, 'refine', i, '', '&refine number '//to_text(i)// &
          & ' refines no cell', 'expected a place that holds the centre of a cell of a lattice')
        return
      end if
    end if
    call cut_shapes(scene, body, error)
    if (allocated(error)) return
    do i = 1, size(body%parts)
      body%parts(i)%first = findloc(int(body%body), body%parts(i)%body, dim=1)
    end do
    ! of a mesh counts the median, where the scene has one horizon
    spacing = max(spacing, maxval(body%spacing, mask=.not. of_mesh(scene, body)))
    ! or each point has its own, of which this is the largest
    if (has_own_horizons(scene)) spacing = maxval(body%spacing)
    delta = horizon_of(scene, spacing)
    body%delta = delta
    if (has_own_horizons(scene)) spacing = minval(body%spacing)
    call check_family_size(scene, body, horizon_of(scene, spacing), minval(body%spacing), error)
    if (allocated(error)) return
    body%least_spacing = minval(body%spacing)
    body%largest_spacing = maxval(body%spacing)
    call add_layers(scene, delta, depth, body, counted, error)
    if (allocated(error)) return
    if (present(counts)) call move_alloc(counted, counts)
    call check_lattices(scene, body, error)
  end subroutine generate_body

  !> Divide the cells of a lattice that `&refine` names; each level has a grid of its own.
  subroutine refine(scene, lattice, depth, used, body, one, error)
    type(scene_type), intent(in) :: scene
    type(lattice_type), intent(in) :: lattice
    real(wp), intent(in) :: depth
    logical, allocatable, intent(inout) :: used(:)  ! which groups have refined something
    type(body_type), intent(inout) :: body          ! gets the grids
    type(body_type), intent(inout) :: one           ! the body's cells; all its points on return
    type(error_type), allocatable, intent(out) :: error
    integer(i4), allocatable :: level(:)
    integer(i2) :: number
    integer :: n

    if (.not. allocated(used)) allocate (used(size(scene%refines)), source=.false.)
    call refine_lattice(scene, lattice, depth, used, one, level, error)
    if (allocated(error)) return
    do n = 0, maxval(level)
      if (.not. any(level == n)) cycle
      number = number_of_grid(body, finer(lattice%grid, n))
      where (level == n) one%grid = number
    end do
  end subroutine refine

  !> The points of a lattice body in its cells first..last, x fastest: those that lie in its shape,
  !> which is turned with it.
  pure subroutine body_cells(dim, group, first, last, depth, body)
    integer, intent(in) :: dim                !! of the scene: 1, 2 or 3
    type(body_group), intent(in) :: group     !! with lower, upper and points
    integer, intent(in) :: first(3), last(3)  !! cells of the body's lattice, from 1
    real(wp), intent(in) :: depth             !! what makes dx^dim a volume: thickness, area or 1
    type(body_type), intent(out) :: body      !! points with positions, volumes and spacings
    type(body_group) :: straight
    type(body_type) :: points

    call box_of_cells(dim, lattice_grid(group, dim), first, last, depth, body)
    if (group%shape == '') return
    straight = group
    straight%axis_1 = unset
    call box_of_cells(dim, lattice_grid(straight, dim), first, last, depth, points)
    call keep_points(body, inside_body(group, points%x, touch*minval(points%spacing)))
  end subroutine body_cells

  !> Leave out the points that no `&keep` keeps, then those that a `&remove` takes. An error if that
  !> takes points of a mesh, or all.
  subroutine cut_shapes(scene, body, error)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(inout) :: body
    type(error_type), allocatable, intent(out) :: error
    logical, allocatable :: taken(:)
    character(:), allocatable :: group
    integer :: s

    do s = 1, number_of_cuts(scene)
      call find_taken(scene, body, s, taken, error)
      if (allocated(error)) return
      if (any(taken .and. of_mesh(scene, body))) then
        group = name_of_cut(scene, s)
        call scene_fault(error, scene, group, group_of_cut(scene, s), 'shape', '&'//group// &
          & ' takes points of a mesh', 'cut the shape out of the geometry before it is meshed')
        return
      end if
      call keep_points(body, .not. taken)
      if (body%n_points == 0) call nothing_left(scene, s, error)
      if (allocated(error)) return
    end do
  end subroutine cut_shapes

  !> How often the points of a scene are cut: by all `&keep` at once, then by each `&remove`.
  pure integer function number_of_cuts(scene) result(cuts)
    type(scene_type), intent(in) :: scene  !! a checked scene
    cuts = min(1, size(scene%kept)) + size(scene%removed)
  end function number_of_cuts

  !> Which `&remove` makes a cut; 1 for that of all `&keep`.
  pure integer function group_of_cut(scene, cut) result(number)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: cut
    number = cut
    if (size(scene%kept) > 0 .and. cut > 1) number = cut - 1
  end function group_of_cut

  !> Of which kind the group is.
  pure function name_of_cut(scene, cut) result(name)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: cut
    character(:), allocatable :: name
    name = 'remove'
    if (size(scene%kept) > 0 .and. cut == 1) name = 'keep'
  end function name_of_cut

  !> An error where a body has no point before any cut.
  subroutine no_cell(scene, number, error)
    type(scene_type), intent(in) :: scene  !! a checked scene
    integer, intent(in) :: number          !! of the body
    type(error_type), allocatable, intent(out) :: error

    call scene_fault(error, scene, 'body', number, 'shape', &
      & words_of_body(scene%bodies, number)//' has no points: no cell of its lattice has '// &
      & 'its centre in its shape', 'is the spacing too large?')
  end subroutine no_cell

  !> An error where a cut leaves no point.
  subroutine nothing_left(scene, cut, error)
    type(scene_type), intent(in) :: scene  !! a checked scene
    integer, intent(in) :: cut             !! 1 to `number_of_cuts`
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: group

    group = name_of_cut(scene, cut)
    call scene_fault(error, scene, group, group_of_cut(scene, cut), 'shape', &
      & 'the scene has no points: every point of its bodies was '// &
      & trim(merge('left out', 'removed ', group == 'keep')), '')
  end subroutine nothing_left

  !> The points that a cut takes. An error if an expression has no finite value at one.
  subroutine find_taken(scene, body, cut, taken, error)
    type(scene_type), intent(in) :: scene          !! a checked scene
    type(body_type), intent(in) :: body            !! what earlier cuts have left
    integer, intent(in) :: cut                     !! 1 to `number_of_cuts`
    logical, allocatable, intent(out) :: taken(:)  !! (n_points)
    type(error_type), allocatable, intent(out) :: error
    logical, allocatable :: chosen(:)
    integer :: i

    i = group_of_cut(scene, cut)
    if (name_of_cut(scene, cut) == 'remove') then
      call choose_points(scene, body, scene%removed(i), 'remove', i, taken, error)
      return
    end if
    allocate (taken(body%n_points), source=.true.)
    do i = 1, size(scene%kept)
      call choose_points(scene, body, scene%kept(i), 'keep', i, chosen, error)
      if (allocated(error)) return
      taken = taken .and. .not. chosen
    end do
  end subroutine find_taken

  !> An error if the horizon holds more points than any computation is meant to have in a family;
  !> counts in families and offsets below then fit their integers.
  subroutine check_family_size(scene, body, delta, spacing, error)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: delta, spacing
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: members, points
    integer :: i, dim

    dim = body%dim
    members = (2*min(delta/spacing, most_members))**dim
    if (members <= most_members) return
    if (all(scene%bodies%file == '')) then
      points = 0.0_wp
      do i = 1, size(scene%bodies)
        if (is_lattice(scene%bodies(i))) points = points + product(real( &
          & scene%bodies(i)%points(:dim), wp))
      end do
      do i = 1, size(body%parts)
        points = points + body%parts(i)%n_points
      end do
      do i = 1, size(body%skins)
        points = points + count(body%body == body%skins(i)%body)
      end do
      ! a small body may lie in its horizon as a whole
      if (points <= most_members .and. delta/spacing <= largest_ratio) return
    end if
    call scene_fault(error, scene, 'horizon', 1, merge('length', 'ratio ', &
      & is_set(scene%horizon%length)), 'the horizon of '//with_unit(delta, 'm')//' is too large &
      &for a smallest spacing of '//with_unit(spacing, 'm'), 'a family of the points around one &
      &may have about '//to_text(most_members)//' members')
  end subroutine check_family_size

  !> Which points belong to meshes.
  pure function of_mesh(scene, body) result(mask)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    logical, allocatable :: mask(:)
    logical :: meshed(size(scene%bodies))

    meshed = scene%bodies%mesh /= ''
    mask = meshed(body%body)
  end function of_mesh

  !> delta [m]: the length given, or the ratio times the largest spacing.
  pure real(wp) function horizon_of(scene, largest_spacing) result(delta)
    type(scene_type), intent(in) :: scene    !! gives the length or the ratio
    real(wp), intent(in) :: largest_spacing  !! of all points [m]
    delta = scene%horizon%ratio*largest_spacing
    if (is_set(scene%horizon%length)) delta = scene%horizon%length
  end function horizon_of

  !> Number of `grid` among the body's grids; a new one is added. Grids that coincide are one.
  integer(i2) function number_of_grid(body, grid) result(number)
    type(body_type), intent(inout) :: body
    type(grid_type), intent(in) :: grid
    real(wp) :: shift(3)
    integer :: i

    do i = 1, size(body%grids)
      if (abs(body%grids(i)%spacing - grid%spacing) > same_grid*grid%spacing) cycle
      if (any(abs(body%grids(i)%axes - grid%axes) > same_axes)) cycle
      shift = 0.0_wp
      shift(:body%dim) = place_in(body%grids(i), grid%origin(:body%dim))
      if (maxval(abs(shift - anint(shift))) > same_grid) cycle
      number = int(i, i2)
      return
    end do
    body%grids = [body%grids, grid]
    number = int(size(body%grids), i2)
  end function number_of_grid

end module pd_body_generate
