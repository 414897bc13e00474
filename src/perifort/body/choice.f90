!> Points that a shape, an expression and a region choose, and expressions of a scene on points.
module pd_body_choice
  use pd_base_error, only: error_type
  use pd_base_expression, only: expression_type
  use pd_base_field, only: field_type, field_values, new_field
  use pd_base_kinds, only: wp, i4
  use pd_body_body, only: body_type, not_finite_text
  use pd_body_mesh_geometry, only: mesh_points
  use pd_body_mesh_inside, only: places_in_mesh
  use pd_body_mesh_mesh, only: mesh_type
  use pd_body_mesh_read, only: read_mesh
  use pd_body_shapes, only: inside, touch
  use pd_body_surfaces, only: inside_surface
  use pd_scene_content_expressions, only: expression_of
  use pd_scene_content_rules, only: place_fault, scene_fault
  use pd_scene_content_types, only: scene_type, shape_group, is_of_file
  use pd_scene_format_file, only: resolve_path
  implicit none (type, external)
  private
  public :: choose_points, field_on, inside_file, values_on

contains

  !> The points inside of a group's shape and region, and where its expression is not 0; what it
  !> does not have does not bound. An error, with its place, if an expression has no finite value at
  !> a point that the rest chooses.
  subroutine choose_points(scene, body, group, name, number, chosen, error)
    type(scene_type), intent(in) :: scene        !! a checked scene
    type(body_type), intent(in) :: body          !! in point order
    class(shape_group), intent(in) :: group      !! with a shape, a region or an expression
    character(*), intent(in) :: name             !! of the group, without `&`
    integer, intent(in) :: number                !! which group of this name
    logical, allocatable, intent(out) :: chosen(:)  !! (n_points)
    type(error_type), allocatable, intent(out) :: error
    logical, allocatable :: of_region(:)
    integer :: r

    call choose(scene, body, group, name, number, chosen, error)
    if (allocated(error) .or. group%region == '') return
    do r = 1, size(scene%regions)
      if (scene%regions(r)%name /= group%region) cycle
      call choose(scene, body, scene%regions(r), 'region', r, of_region, error)
      if (allocated(error)) return
      chosen = chosen .and. of_region
    end do
  end subroutine choose_points

  !> The same without a region.
  subroutine choose(scene, body, group, name, number, chosen, error)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    class(shape_group), intent(in) :: group
    character(*), intent(in) :: name
    integer, intent(in) :: number
    logical, allocatable, intent(out) :: chosen(:)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: values(:)
    real(wp) :: spacing
    integer(i4), allocatable :: points(:)
    integer :: k

    spacing = body%least_spacing
    if (.not. spacing > 0.0_wp) spacing = minval(body%spacing)
    if (is_of_file(group)) then
      call inside_file(scene, group, body%x, spacing, name, number, chosen, error)
      if (allocated(error)) return
    else if (group%shape /= '') then
      chosen = inside(group, body%x, touch*spacing)
    else
      allocate (chosen(body%n_points), source=.true.)
    end if
    if (group%where == '') return
    points = pack([(int(k, i4), k=1, body%n_points)], chosen)
    call values_on(scene, group%where, body, points, name, number, 'where', values, error)
    if (allocated(error)) return
    chosen(points) = abs(values) > 0.0_wp
  end subroutine choose

  !> The places inside of the surface or the mesh of a group. An error, with its place, if the file
  !> cannot be read, or holds no surface or mesh.
  subroutine inside_file(scene, group, x, spacing, name, number, inside, error)
    type(scene_type), intent(in) :: scene        !! a checked scene
    class(shape_group), intent(in) :: group      !! with a surface or a mesh
    real(wp), intent(in) :: x(:, :)              !! (places, dim) [m]
    real(wp), intent(in) :: spacing              !! of the points [m]
    character(*), intent(in) :: name             !! of the group, without `&`
    integer, intent(in) :: number                !! which group of this name
    logical, allocatable, intent(out) :: inside(:)  !! (places)
    type(error_type), allocatable, intent(out) :: error

    if (group%surface /= '') then
      call inside_surface(scene, group%surface, group%scale, x, spacing, inside, error)
      call place_fault(error, scene, name, number, 'surface')
    else
      call inside_mesh(scene, group%mesh, group%scale, x, touch*spacing, inside, error)
      call place_fault(error, scene, name, number, 'mesh')
    end if
  end subroutine inside_file

  !> The places inside of the elements of a mesh, curved ones included. An error if it cannot be
  !> read, or has no elements of the scene's dimension, or such without volume.
  subroutine inside_mesh(scene, name, scale, x, tolerance, inside, error)
    type(scene_type), intent(in) :: scene           !! whose folder the file is looked for in
    character(*), intent(in) :: name                !! of the file, as the scene says it
    real(wp), intent(in) :: scale                   !! metres of one unit of it
    real(wp), intent(in) :: x(:, :)                 !! (places, dim) [m]
    real(wp), intent(in) :: tolerance               !! how far outside still counts [m]
    logical, allocatable, intent(out) :: inside(:)  !! (places)
    type(error_type), allocatable, intent(out) :: error
    type(mesh_type) :: mesh
    real(wp), allocatable :: centre(:, :), volume(:)
    integer(i4), allocatable :: element(:)

    associate (dim => scene%header%dimension)
      call read_mesh(resolve_path(trim(name), scene%file), dim, scale, mesh, error)
      if (.not. allocated(error)) call mesh_points(mesh, dim, 1, 1.0_wp, centre, volume, element, &
        & error)
      if (allocated(error)) return
      call places_in_mesh(mesh, dim, x(:, :dim), tolerance, inside)
    end associate
  end subroutine inside_mesh

  !> An expression of a checked scene at some points.
  subroutine field_on(scene, text, body, slots, field)
    type(scene_type), intent(in) :: scene    !! a checked scene
    character(*), intent(in) :: text         !! the expression
    type(body_type), intent(in) :: body      !! the points
    integer(i4), intent(in) :: slots(:)      !! (points) of them
    type(field_type), intent(out) :: field   !! ready for `field_values`
    type(expression_type) :: expression

    call expression_of(scene, text, expression)
    call new_field(expression, body%x(slots, :), field)
  end subroutine field_on

  !> The values of an expression at t = 0. An error is set at its key if one is not finite.
  subroutine values_on(scene, text, body, slots, group, number, key, values, error)
    type(scene_type), intent(in) :: scene      !! a checked scene
    character(*), intent(in) :: text           !! the expression
    type(body_type), intent(in) :: body        !! the points
    integer(i4), intent(in) :: slots(:)        !! (points) of them
    character(*), intent(in) :: group          !! name of the group that has it, without `&`
    integer, intent(in) :: number              !! which group of this name
    character(*), intent(in) :: key            !! that has it
    real(wp), allocatable, intent(out) :: values(:)  !! (points)
    type(error_type), allocatable, intent(out) :: error
    type(field_type) :: field
    integer :: at

    call field_on(scene, text, body, slots, field)
    allocate (values(size(slots)))
    call field_values(field, 0.0_wp, values, at)
    if (at > 0) call scene_fault(error, scene, group, number, key, "'"//key//"' "// &
      & not_finite_text(body, slots(at), 0.0_wp), trim(text))
  end subroutine values_on

end module pd_body_choice
