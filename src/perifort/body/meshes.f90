!> Bodies that are meshes: their points, and what their names, and those of surfaces
!> (`pd_body_surfaces`), mean among the points of a scene.
module pd_body_meshes
  use pd_base_error, only: error_type, internal_fault
  use pd_base_kinds, only: wp, i2, i4
  use pd_base_text, only: counted, printable, to_text
  use pd_base_warnings, only: warnings_type
  use pd_body_body, only: body_type, allocate_points
  use pd_body_mesh_geometry, only: mesh_points
  use pd_body_mesh_near, only: points_near
  use pd_body_mesh_part, only: count_pieces, count_twins, facets_named, facets_type, find_faces, &
    & outer_facets, part_type, points_named
  use pd_body_mesh_read, only: read_mesh
  use pd_body_mesh_shares, only: balance_areas, share_areas
  use pd_body_surfaces, only: facets_of_side, near_side, side_areas, skin_named
  use pd_scene_content_rules, only: place_fault
  use pd_scene_content_types, only: has_own_horizons, scene_type, words_of_body
  use pd_scene_format_file, only: resolve_path
  implicit none (type, external)
  private
  public :: mesh_body, keep_part, material_number, names_set, set_mask, facet_mask, facet_areas, &
    & balance_surface, surface_areas, check_set, place_set_fault

contains

  !> The points of a body that is a mesh. An error, with its place, if the mesh cannot be read or is
  !> no body. `warnings` get what may surprise: pieces, nodes that lie on others.
  subroutine mesh_body(scene, number, depth, body, part, spacing, error, warnings)
    type(scene_type), intent(in) :: scene        !! a checked scene
    integer, intent(in) :: number                !! of the body
    real(wp), intent(in) :: depth                !! what makes an area or length a volume
    type(body_type), intent(out) :: body         !! its points, in the order of the elements
    type(part_type), intent(out) :: part         !! the mesh with what its names need
    real(wp), intent(out) :: spacing             !! median of the points', by volume [m]
    type(error_type), allocatable, intent(out) :: error
    type(warnings_type), intent(inout), optional :: warnings
    real(wp), allocatable :: x(:, :), volume(:)
    logical, allocatable :: chosen(:)
    integer :: s

    spacing = 0.0_wp
    part%body = number
    part%dim = scene%header%dimension
    part%depth = depth
    associate (group => scene%bodies(number))
      call read_mesh(resolve_path(trim(group%mesh), scene%file), part%dim, group%scale, part%mesh, &
        & error)
      if (.not. allocated(error)) call mesh_points(part%mesh, part%dim, group%points_per_element, &
        & depth, x, volume, part%element, error)
      if (.not. allocated(error)) then
        part%n_points = size(volume)
        call find_faces(part, error)
      end if
      call place_fault(error, scene, 'body', number, 'mesh')
      if (allocated(error)) return
      call allocate_points(body, part%dim, part%n_points)
      body%x = x
      body%volume = volume
      body%spacing = (volume/depth)**(1.0_wp/part%dim)
      spacing = weighted_median(body%spacing, volume)
      body%material = material_number(scene, group%material)
      if (allocated(group%material_set)) then
        do s = 1, size(group%material_set)
          call points_named(part, trim(group%material_set(s)), chosen, error)
          call place_fault(error, scene, 'body', number, 'material_set')
          if (allocated(error)) return
          where (chosen) body%material = material_number(scene, group%material_name(s))
        end do
      end if
    end associate
    if (present(warnings)) call warn_of_mesh(scene, part, minval(body%spacing), warnings)
  end subroutine mesh_body

  !> What may surprise of a mesh.
  subroutine warn_of_mesh(scene, part, spacing, warnings)
    type(scene_type), intent(in) :: scene
    type(part_type), intent(in) :: part
    real(wp), intent(in) :: spacing           !! the smallest [m]
    type(warnings_type), intent(inout) :: warnings
    character(:), allocatable :: name
    integer :: pieces, twins

    name = words_of_body(scene%bodies, part%body)
    if (allocated(part%mesh%first_skipped)) call warnings%add('skipped of mesh '// &
      & to_text(part%body), name//': '//counted(part%mesh%skipped, 'keyword')//' of its file '// &
      & trim(merge('is ', 'are', part%mesh%skipped == 1))//" skipped, first '"// &
      & printable(part%mesh%first_skipped)//"': materials, supports and loads are those of the "// &
      & 'scene', tell=.false.)
    pieces = count_pieces(part)
    if (pieces > 1) call warnings%add('pieces of mesh '//to_text(part%body), name//': its mesh '// &
      & 'falls into '//to_text(pieces)//' pieces that share no node; points within the horizon '// &
      & 'of each other are bonded all the same', tell=.false.)
    twins = count_twins(part, spacing)
    if (twins > 0) call warnings%add('twins of mesh '//to_text(part%body), name//': '// &
      & counted(twins, 'node')//' of its mesh '//trim(merge('lies', 'lie ', twins == 1))// &
      & ' on another one; points on both sides are bonded where they are within the horizon, '// &
      & 'unless a &crack parts them', tell=.false.)
  end subroutine warn_of_mesh

  !> The value that half of the weight is below of.
  pure real(wp) function weighted_median(values, weights) result(median)
    real(wp), intent(in) :: values(:), weights(:)
    real(wp) :: low, high, half, below
    integer :: i

    ! by halving: bounds are values in the end, and no list need be sorted
    low = minval(values)
    high = maxval(values)
    half = sum(weights)/2
    do i = 1, 200
      if (high - low <= 1.0e-12_wp*high) exit
      median = (low + high)/2
      below = sum(weights, mask=values <= median)
      if (below >= half) then
        high = maxval(values, mask=values <= median)
      else
        low = minval(values, mask=values > median)
      end if
    end do
    median = high
  end function weighted_median

  !> Add a part to a body.
  subroutine keep_part(body, part)
    type(body_type), intent(inout) :: body  !! with one part more
    type(part_type), intent(in) :: part     !! the part
    type(part_type), allocatable :: parts(:)
    integer :: i

    allocate (parts(size(body%parts) + 1))
    do i = 1, size(body%parts)
      parts(i) = body%parts(i)
    end do
    parts(size(parts)) = part
    call move_alloc(parts, body%parts)
  end subroutine keep_part

  !> Number of a material by name; '' is the only one.
  pure integer(i2) function material_number(scene, name) result(number)
    type(scene_type), intent(in) :: scene  !! with its materials
    character(*), intent(in) :: name       !! of a material
    integer :: i

    number = 1_i2
    do i = 1, size(scene%materials)
      if (name /= '' .and. scene%materials(i)%name == name) number = int(i, i2)
    end do
  end function material_number

  !> Whether a name means a set of a mesh, as `BODY:NAME`.
  elemental logical function names_set(name)
    character(*), intent(in) :: name  !! of a region or side
    names_set = index(name, ':') > 0
  end function names_set

  !> The part that a name belongs to.
  pure integer function part_named(scene, body, name) result(p)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    character(*), intent(in) :: name

    do p = 1, size(body%parts)
      if (scene%bodies(body%parts(p)%body)%name == name(:index(name, ':') - 1)) return
    end do
    call internal_fault('a set of a body that is no mesh')
  end function part_named

  !> The name of a set without that of its body.
  pure function set_of(name) result(set)
    character(*), intent(in) :: name
    character(:), allocatable :: set
    set = trim(name(index(name, ':') + 1:))
  end function set_of

  !> An error, with its place, if a name of a mesh or surface means no points, or no facets.
  subroutine check_set(scene, body, name, facets, group, number, key, error)
    type(scene_type), intent(in) :: scene     !! a checked scene
    type(body_type), intent(in) :: body       !! with its parts
    character(*), intent(in) :: name          !! `BODY:NAME`; another name is right
    logical, intent(in) :: facets             !! whether it must have facets; else points
    character(*), intent(in) :: group         !! name of the group that has it, without `&`
    integer, intent(in) :: number             !! which group of this name
    character(*), intent(in) :: key           !! that has it
    type(error_type), allocatable, intent(out) :: error
    logical, allocatable :: chosen(:)
    type(facets_type) :: found

    if (.not. names_set(name)) return
    if (skin_named(scene, body, name) > 0) then
      if (.not. facets) call internal_fault('a surface has no sets of points')
      call facets_of_side(scene, body%skins(skin_named(scene, body, name)), set_of(name), chosen, &
        & error)
      call place_set_fault(error, scene, group, number, key)
      return
    end if
    associate (part => body%parts(part_named(scene, body, name)))
      if (facets) then
        call facets_named(part, trim(name(index(name, ':') + 1:)), found, error)
      else
        call points_named(part, trim(name(index(name, ':') + 1:)), chosen, error)
      end if
    end associate
    call place_set_fault(error, scene, group, number, key)
  end subroutine check_set

  !> The place of a fault of a set is in the scene; the mesh is named, too.
  subroutine place_set_fault(error, scene, group, number, key)
    type(error_type), allocatable, intent(inout) :: error  !! gets its place; none stays none
    type(scene_type), intent(in) :: scene                  !! whose text gives the place
    character(*), intent(in) :: group                      !! name of the group, without `&`
    integer, intent(in) :: number                          !! which group of this name
    character(*), intent(in) :: key                        !! that names the set
    integer :: at

    if (.not. allocated(error)) return
    at = index(error%message, ' --> ')
    if (at > 0) error%message(at:at + 4) = ' in: '
    call place_fault(error, scene, group, number, key)
  end subroutine place_set_fault

  !> The slots with the points of a set of a mesh.
  function set_mask(scene, body, name) result(mask)
    type(scene_type), intent(in) :: scene  !! a checked scene
    type(body_type), intent(in) :: body    !! its points, arranged in slots
    character(*), intent(in) :: name       !! `BODY:NAME`, checked
    logical, allocatable :: mask(:)
    logical, allocatable :: chosen(:)
    type(error_type), allocatable :: error

    associate (part => body%parts(part_named(scene, body, name)))
      call points_named(part, trim(name(index(name, ':') + 1:)), chosen, error)
      if (allocated(error)) call internal_fault('a set without points')
      mask = to_slots(body, part, chosen)
    end associate
  end function set_mask

  !> The slots with the points of a part that are chosen.
  pure function to_slots(body, part, chosen) result(mask)
    type(body_type), intent(in) :: body
    type(part_type), intent(in) :: part
    logical, intent(in) :: chosen(:)
    logical, allocatable :: mask(:)
    integer :: i

    allocate (mask(body%n_slots), source=.false.)
    do i = 1, size(chosen)
      if (chosen(i)) mask(body%slot(part%first + i - 1)) = .true.
    end do
  end function to_slots

  !> The positions of a part's points (n_points, dim) [m].
  pure function positions_of(body, part) result(x)
    type(body_type), intent(in) :: body
    type(part_type), intent(in) :: part
    real(wp), allocatable :: x(:, :)
    x = body%x(body%slot(part%first:part%first + part%n_points - 1), :)
  end function positions_of

  !> The slots with the points within the horizon of facets of a mesh or surface, and of its body.
  function facet_mask(scene, body, name) result(mask)
    type(scene_type), intent(in) :: scene  !! a checked scene
    type(body_type), intent(in) :: body    !! its points, arranged in slots
    character(*), intent(in) :: name       !! `BODY:NAME`, checked
    logical, allocatable :: mask(:)
    logical, allocatable :: near(:)
    type(facets_type) :: facets
    type(error_type), allocatable :: error

    if (skin_named(scene, body, name) > 0) then
      call near_side(scene, body, skin_named(scene, body, name), set_of(name), mask, error)
      if (allocated(error)) call internal_fault('a side without facets')
      return
    end if
    associate (part => body%parts(part_named(scene, body, name)))
      call facets_named(part, trim(name(index(name, ':') + 1:)), facets, error)
      if (allocated(error)) call internal_fault('a set without facets')
      if (has_own_horizons(scene)) then
        call points_near(part, positions_of(body, part), facets, body%delta, near, &
          & scene%horizon%ratio*body%spacing(body%slot(part%first:part%first + part%n_points - 1)))
      else
        call points_near(part, positions_of(body, part), facets, body%delta, near)
      end if
      mask = to_slots(body, part, near)
    end associate
  end function facet_mask

  !> The points that share the area of facets of a mesh or surface, with their parts of it. An error
  !> if a facet lies inside of the body, or has no points behind it that could share its area.
  subroutine facet_areas(scene, body, name, slots, vector, area, error)
    type(scene_type), intent(in) :: scene   !! a checked scene
    type(body_type), intent(in) :: body     !! its points, arranged in slots
    character(*), intent(in) :: name        !! `BODY:NAME`, checked
    integer(i4), allocatable, intent(out) :: slots(:)   !! (points) in the order of the points
    real(wp), allocatable, intent(out) :: vector(:, :)  !! (points, dim) along the normals [m2]
    real(wp), allocatable, intent(out) :: area(:)       !! (points) [m2]
    type(error_type), allocatable, intent(out) :: error
    type(facets_type) :: facets
    real(wp), allocatable :: all_vectors(:, :), all_areas(:)
    integer(i4), allocatable :: points(:)
    integer :: i

    if (skin_named(scene, body, name) > 0) then
      call side_areas(scene, body, skin_named(scene, body, name), set_of(name), slots, vector, &
        & area, error)
      return
    end if
    associate (part => body%parts(part_named(scene, body, name)))
      call facets_named(part, trim(name(index(name, ':') + 1:)), facets, error)
      if (allocated(error)) call internal_fault('a set without facets')
      if (.not. all(facets%outer)) then
        allocate (error)
        error%message = "the facets of '"//trim(name)//"' lie inside of the body: "// &
          & 'a load acts on its surface'
        return
      end if
      call share_areas(part, positions_of(body, part), facets, all_vectors, all_areas, error)
      if (allocated(error)) return
      points = pack([(int(i, i4), i=1, part%n_points)], any(abs(all_vectors) > 0.0_wp, dim=2) &
        & .or. abs(all_areas) > 0.0_wp)
      slots = body%slot(part%first + points - 1)
      vector = all_vectors(points, :)
      area = all_areas(points)
    end associate
  end subroutine facet_areas

  !> Give the surface areas of a body that is one mesh the moments that weights of bonds need. An
  !> error if that cannot be.
  subroutine balance_surface(body, error)
    type(body_type), intent(inout) :: body  !! arranged in slots, with one part
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: x(:, :), volume(:)

    x = positions_of(body, body%parts(1))
    volume = body%volume(body%slot(:body%n_points))
    call balance_areas(body%parts(1), x, volume, error)
  end subroutine balance_surface

  !> The outward areas of the points of a body that is one mesh (n_slots, dim) [m2; m x thickness;
  !> cross section]. An error if a facet has no points behind it that could share its area.
  subroutine surface_areas(body, area, error)
    type(body_type), intent(in) :: body                 !! arranged in slots, with one part
    real(wp), allocatable, intent(out) :: area(:, :)    !! (n_slots, dim)
    type(error_type), allocatable, intent(out) :: error
    type(facets_type) :: facets
    real(wp), allocatable :: vector(:, :), of_points(:)

    call outer_facets(body%parts(1), facets)
    call share_areas(body%parts(1), positions_of(body, body%parts(1)), facets, vector, of_points, &
      & error)
    if (allocated(error)) return
    allocate (area(body%n_slots, body%dim), source=0.0_wp)
    area(body%slot(:body%n_points), :) = vector
  end subroutine surface_areas

end module pd_body_meshes
