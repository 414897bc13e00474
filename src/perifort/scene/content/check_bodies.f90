!> Rules for the initial geometry: bodies, shapes, materials and cracks.
module pd_scene_content_check_bodies
  use pd_base_elasticity, only: bond_based_ratio
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type, internal_fault
  use pd_base_text, only: join, nearest_name, to_text, with_unit
  use pd_law_law, only: required
  use pd_law_laws, only: law_item_type, law_table_type
  use pd_scene_format_file, only: resolve_path
  use pd_scene_content_rules, only: rule_fault, given, check_known, check_vector, check_finite_box
  use pd_scene_format_source, only: source_type
  use pd_scene_content_types, only: scene_type, body_group, shape_group, material_group, &
    & crack_group, side_group, is_set, laws_of, name_length
  implicit none (type, external)
  private
  public :: check_body, check_shape, check_side, check_material, check_crack, check_file

  real(wp), parameter :: spacing_tolerance = 1.0e-6_wp  !! relative, between directions
  !> Peak memory of a point of a lattice, while families are built, measured on cubes [bytes].
  real(wp), parameter :: memory_per_point = 400.0_wp
  real(wp), parameter :: most_points = 1.0e9_wp         !! points and slots have 32-bit numbers
  real(wp), parameter :: ratio_tolerance = 1.0e-3_wp    !! 0.333 is meant to be 1/3
  integer, parameter :: most_trials = 10000             !! counts that are tried for a proposal

contains

  !> One `&body`: its material, and its lattice or its file. The only material is the default. An
  !> error is set if a rule is broken, such as unequal spacings.
  subroutine check_body(scene, number, error, source)
    type(scene_type), intent(inout) :: scene           !! gets the default of the body's `material`
    integer, intent(in) :: number                      !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    integer :: i, d
    logical :: lattice

    d = scene%header%dimension
    associate (body => scene%bodies(number))
      if (body%material == '' .and. size(scene%materials) > 1) then
        call rule_fault(error, 'body', number, '', "group &body lacks the key 'material'", &
          & 'there are '//to_text(size(scene%materials))//' materials to choose from', source)
        return
      end if
      if (body%material == '') body%material = scene%materials(1)%name
      call check_known(body%material, [character(name_length) :: (scene%materials(i)%name, &
        & i=1, size(scene%materials))], 'material', 'body', number, 'material', error, source)
      if (allocated(error)) return
      lattice = any(is_set(body%lower)) .or. any(is_set(body%upper)) .or. any(body%points /= 0)
      call check_surface(scene, number, error, source)
      if (allocated(error) .or. body%surface /= '') return
      call check_mesh(scene, number, lattice, error, source)
      if (allocated(error)) return
      call fill_shape(body, d, number, error, source)
      if (.not. allocated(error)) call check_axes(scene, body, number, error, source)
      if (allocated(error) .or. body%mesh /= '') return
      lattice = lattice .or. body%shape /= ''
      if (body%file /= '') then
        if (lattice) then
          call rule_fault(error, 'body', number, 'file', &
            & 'a body is a lattice or a cloud, not both', &
            & "give either 'file' or 'lower', 'upper' and 'points'", source)
        else
          call check_file(body%file, scene%file, 'body', number, error, source)
        end if
        return
      end if
      if (.not. lattice) then
        call rule_fault(error, 'body', number, '', 'a body without points', &
          & "expected 'lower', 'upper' and 'points' for a lattice, 'surface' and 'spacing', "// &
          & "'file' for a cloud, or 'mesh'", source)
        return
      end if
      call check_vector(body%lower, d, 'lower', 'body', number, error, source)
      if (allocated(error)) return
      call check_vector(body%upper, d, 'upper', 'body', number, error, source)
      if (allocated(error)) return
      call check_finite_box(body%lower(:d), body%upper(:d), 'body', number, error, source)
      if (allocated(error)) return
      if (any(body%points(:d) < 1) .or. any(body%points(d + 1:) > 1)) then
        call rule_fault(error, 'body', number, 'points', "'points' needs "//to_text(d)// &
          & trim(merge(' count ', ' counts', d == 1))//' in a scene of dimension '//to_text(d), &
          & 'one count along each direction', source)
        return
      end if
      if (product(real(body%points(:d), wp)) > most_points) then
        call rule_fault(error, 'body', number, 'points', 'too many points: '// &
          & to_text(product(real(body%points(:d), wp)), 3), 'a body has at most '// &
          & to_text(most_points, 3)//'; these would need about '//with_unit(memory_per_point &
          & *product(real(body%points(:d), wp)), 'B', 3)//' of memory', source)
        return
      end if
      call check_spacing(body, d, number, error, source)
    end associate
  end subroutine check_body

  !> The axes of a turned lattice: directions that span a frame, and nothing beside them that knows
  !> x, y and z alone.
  subroutine check_axes(scene, body, number, error, source)
    type(scene_type), intent(in) :: scene
    type(body_group), intent(in) :: body
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    real(wp), parameter :: parallel = 1.0e-6_wp
    real(wp) :: cross(3)
    integer :: i

    if (.not. any(is_set([body%axis_1, body%axis_2]))) return
    associate (d => scene%header%dimension)
      if (body%file /= '' .or. body%mesh /= '' .or. d == 1) then
        call rule_fault(error, 'body', number, 'axis_1', 'only lattices in 2D and 3D have axes', &
          & 'a cloud or a mesh is turned in its file', source)
        return
      end if
      call check_vector(body%axis_1, d, 'axis_1', 'body', number, error, source)
      if (allocated(error)) return
      if (d == 2 .and. any(is_set(body%axis_2))) then
        call rule_fault(error, 'body', number, 'axis_2', "'axis_2' in a scene of dimension 2", &
          & "it is 'axis_1' turned left", source)
        return
      else if (d == 3) then
        call check_vector(body%axis_2, d, 'axis_2', 'body', number, error, source)
        if (allocated(error)) return
        cross = [body%axis_1(2)*body%axis_2(3) - body%axis_1(3)*body%axis_2(2), &
          & body%axis_1(3)*body%axis_2(1) - body%axis_1(1)*body%axis_2(3), &
          & body%axis_1(1)*body%axis_2(2) - body%axis_1(2)*body%axis_2(1)]
        if (norm2(cross) <= parallel*norm2(body%axis_1)*norm2(body%axis_2)) then
          call rule_fault(error, 'body', number, 'axis_2', &
            & "'axis_1' and 'axis_2' are parallel or "// &
            & 'zero', 'expected two directions', source)
          return
        end if
      end if
      if (norm2(body%axis_1(:d)) <= 0.0_wp) then
        call rule_fault(error, 'body', number, 'axis_1', "'axis_1' is zero", &
          & 'expected a direction', &
          & source)
      else if (scene%horizon%surface_correction == 'consistent') then
        call rule_fault(error, 'body', number, 'axis_1', &
          & "a turned body with surface_correction "// &
          & "= 'consistent'", "its weights are found along x, y and z; 'energy' and 'none' "// &
          & "know "// &
          & 'the axes of bodies', source)
      end if
      do i = 1, size(scene%boundaries)
        if (allocated(error) .or. .not. scene%boundaries(i)%absorbing) cycle
        call rule_fault(error, 'boundary', i, 'absorbing', &
          & 'an absorbing boundary in a scene with '// &
          & 'a turned body', 'its dashpots act along x, y and z', source)
      end do
      if (allocated(error) .or. size(scene%bodies) == 1) return
      do i = 1, size(scene%boundaries)
        if (scene%boundaries(i)%side == '' .or. index(scene%boundaries(i)%side, ':') > 0 .or. &
          & scene%boundaries(i)%body /= '') cycle
        call rule_fault(error, 'boundary', i, 'side', 'a side of all bodies, of which some are '// &
          & 'turned', "sides of a turned body are its own: name it by 'body'", source)
        return
      end do
      do i = 1, size(scene%loads)
        if (scene%loads(i)%side == '' .or. index(scene%loads(i)%side, ':') > 0 .or. &
          & scene%loads(i)%body /= '') cycle
        call rule_fault(error, 'load', i, 'side', 'a side of all bodies, of which some are '// &
          & 'turned', &
          & "sides of a turned body are its own: name it by 'body'", source)
        return
      end do
    end associate
  end subroutine check_axes

  !> The box of cells of a body that has a shape: `lower`, `upper` and `points` follow from its
  !> keys.
  subroutine fill_shape(body, d, number, error, source)
    type(body_group), intent(inout) :: body
    integer, intent(in) :: d
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    integer :: c, half, along
    real(wp) :: length

    if (body%shape == '') then
      call refuse(['spacing', 'centre ', 'radius ', 'axis   ', 'height '], 'a body without a shape')
      return
    end if
    call refuse(['file  ', 'mesh  ', 'points'], "a body with a 'shape'")
    if (allocated(error)) return
    if (.not. is_set(body%spacing)) then
      call fault('', "a body with a 'shape' needs the key 'spacing'", 'distance of its points [m]')
      return
    end if
    along = 0
    select case (body%shape)
    case ('box')
      call refuse(['centre', 'radius', 'axis  ', 'height'], 'a box')
      if (.not. allocated(error)) call check_vector(body%lower, d, 'lower', 'body', number, error, &
        & source)
      if (.not. allocated(error)) call check_vector(body%upper, d, 'upper', 'body', number, error, &
        & source)
      if (.not. allocated(error)) call check_finite_box(body%lower(:d), body%upper(:d), 'body', &
        & number, error, source)
    case ('sphere')
      call refuse(['lower ', 'upper ', 'axis  ', 'height'], 'a sphere')
      if (d == 1) call fault('shape', 'a sphere in a scene of dimension 1', "expected 'box'")
    case ('cylinder')
      call refuse(['lower', 'upper'], 'a cylinder')
      along = index('xyz', trim(body%axis))
      if (d == 1 .or. (d == 2 .and. (along < 3 .or. is_set(body%height)))) then
        call fault('shape', 'this cylinder in a scene of dimension '//to_text(d), &
          & "in 2D it is a disc: axis = 'z', without 'height'")
      else if (d == 3 .and. .not. is_set(body%height)) then
        call fault('', "a cylinder without the key 'height'", 'its length along the axis [m]')
      end if
    case default
      call internal_fault('a shape of a body')
    end select
    if (allocated(error)) return
    if (body%shape /= 'box' .and. .not. is_set(body%radius)) then
      call fault('', 'a '//trim(body%shape)//" without the key 'radius'", 'its radius [m]')
      return
    end if
    do c = 1, d
      if (body%shape == 'box') then
        length = body%upper(c) - body%lower(c)
      else if (c == along) then
        length = body%height
        body%lower(c) = body%centre(c)
        body%upper(c) = body%centre(c) + length
      else
        ! cells whose centres may lie inside, as many on both sides
        if (body%radius > most_points*body%spacing) then
          call fault('spacing', 'too many points', 'the radius is '// &
            & to_text(body%radius/body%spacing, 3)//' spacings')
          return
        end if
        half = max(1, floor(body%radius/body%spacing + 0.5_wp + spacing_tolerance))
        body%points(c) = 2*half
        body%lower(c) = body%centre(c) - half*body%spacing
        body%upper(c) = body%centre(c) + half*body%spacing
        cycle
      end if
      body%points(c) = nint(min(length/body%spacing, most_points))
      if (abs(body%points(c)*body%spacing - length) > 0.5_wp*spacing_tolerance*length .or. &
        & body%points(c) < 1) then
        call fault('spacing', 'the spacing does not divide the length of '//to_text(length)// &
          & ' m along '//'xyz'(c:c), 'it does so with '//to_text(length/max(1, body%points(c)))// &
          & ' m ('//to_text(max(1, body%points(c)))//' points)')
        return
      end if
    end do

  contains

    !> A broken rule of this body.
    subroutine fault(key, message, note)
      character(*), intent(in) :: key, message, note
      call rule_fault(error, 'body', number, key, message, note, source)
    end subroutine fault

    !> An error if one of these keys is given.
    subroutine refuse(keys, who)
      character(*), intent(in) :: keys(:), who
      integer :: i

      do i = 1, size(keys)
        if (allocated(error) .or. .not. given('body', number, trim(keys(i)), source)) cycle
        call fault(trim(keys(i)), who//" has no key '"//trim(keys(i))//"'", &
          & "keys of a 'shape': see the reference of &body")
      end do
    end subroutine refuse

  end subroutine fill_shape

  !> The keys of a surface: in 3D, with a spacing, and none beside those of boxes, clouds or meshes.
  subroutine check_surface(scene, number, error, source)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source

    associate (body => scene%bodies(number))
      if (body%surface == '') then
        if (body%fill /= 'centre') then
          call rule_fault(error, 'body', number, 'fill', "'fill' of a body without a surface", &
            & "it belongs to the key 'surface'", source)
        end if
      else if (scene%header%dimension /= 3) then
        call rule_fault(error, 'body', number, 'surface', 'a surface in a scene of dimension '// &
          & to_text(scene%header%dimension), 'facets enclose a volume in 3D only; in 2D use a '// &
          & 'mesh, or a lattice with &remove', source)
      else if (any(is_set([body%axis_1, body%axis_2]))) then
        call rule_fault(error, 'body', number, 'axis_1', 'a surface with axes', &
          & 'a surface is turned in its file', source)
      else if (body%file /= '' .or. body%mesh /= '' .or. body%shape /= '' .or. &
        & any(is_set(body%upper)) .or. any(body%points /= 0)) then
        call rule_fault(error, 'body', number, 'surface', 'a body is a box, another shape, a '// &
          & 'surface, a cloud or a mesh, not several of them', &
          & "give 'surface' and 'spacing' alone", source)
      else if (allocated(body%material_set) .or. allocated(body%material_name) .or. &
        & body%points_per_element /= 1) then
        call rule_fault(error, 'body', number, 'surface', 'keys of a mesh beside a surface', &
          & "'material_set', 'material_name' and 'points_per_element' belong to 'mesh'", source)
      else if (.not. is_set(body%spacing)) then
        call rule_fault(error, 'body', number, 'surface', "group &body lacks the key 'spacing'", &
          & 'a surface needs the edge of the lattice cells [m]', source)
      else
        if (any(is_set(body%lower))) call check_vector(body%lower, 3, 'lower', 'body', number, &
          & error, source)
        if (.not. allocated(error)) call check_file(body%surface, scene%file, 'body', number, &
          & error, source, 'surface')
      end if
    end associate
  end subroutine check_surface

  !> One `&side`: an expression or a normal. An error is set if it has neither.
  subroutine check_side(side, number, error, source)
    type(side_group), intent(in) :: side               !! the group
    integer, intent(in) :: number                      !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places

    if (side%where == '' .and. .not. any(is_set(side%normal))) then
      call rule_fault(error, 'side', number, '', "group &side lacks the key 'where' or 'normal'", &
        & 'expected one of them, or both', source)
    else if (any(is_set(side%normal))) then
      call check_vector(side%normal, 3, 'normal', 'side', number, error, source)
      if (allocated(error)) return
      if (norm2(side%normal) <= 0.0_wp) call rule_fault(error, 'side', number, 'normal', &
        & "'normal' is zero", 'expected a direction', source)
    else if (given('side', number, 'angle', source)) then
      call rule_fault(error, 'side', number, 'angle', "'angle' without 'normal'", &
        & 'it is measured from the normal', source)
    end if
  end subroutine check_side

  !> The keys of a mesh: none beside those of a lattice or cloud, sets in pairs with materials.
  subroutine check_mesh(scene, number, lattice, error, source)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: number
    logical, intent(in) :: lattice            !! the body has keys of a lattice
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    integer :: i, sets, names

    associate (body => scene%bodies(number))
      sets = 0
      names = 0
      if (allocated(body%material_set)) sets = size(body%material_set)
      if (allocated(body%material_name)) names = size(body%material_name)
      if (body%mesh == '') then
        if (sets + names > 0) then
          call rule_fault(error, 'body', number, trim(merge('material_set ', 'material_name', &
            & sets > 0)), 'sets of a body that is no mesh', "they belong to the key 'mesh'", source)
        else if (body%points_per_element /= 1 .or. abs(body%scale - 1.0_wp) > 0.0_wp) then
          call rule_fault(error, 'body', number, trim(merge('points_per_element', &
            & 'scale             ', body%points_per_element /= 1)), 'a body without a mesh has '// &
            & "no elements and no 'scale'", "they belong to 'mesh', 'scale' to 'surface', too", &
            & source)
        end if
        return
      end if
      if (lattice .or. body%file /= '') then
        call rule_fault(error, 'body', number, 'mesh', &
          & 'a body is a lattice, a cloud or a mesh, not several of them', &
          & "give 'mesh', or 'file', or 'lower', 'upper' and 'points'", source)
      else if (sets /= names) then
        call rule_fault(error, 'body', number, trim(merge('material_set ', 'material_name', &
          & sets > names)), "'material_set' and 'material_name' differ in length", &
          & to_text(sets)//' sets, '//to_text(names)//' materials', source)
      else
        call check_file(body%mesh, scene%file, 'body', number, error, source, 'mesh')
      end if
      if (allocated(error)) return
      do i = 1, names
        call check_known(body%material_name(i), [character(name_length) :: &
          & scene%materials%name], 'material', 'body', number, 'material_name', error, source)
        if (allocated(error)) return
      end do
    end associate
  end subroutine check_mesh

  !> The spacing must be the same along all directions.
  subroutine check_spacing(body, d, number, error, source)
    type(body_group), intent(in) :: body
    integer, intent(in) :: d
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    real(wp) :: length(d), spacing(d), mean
    integer :: i, k, counts(d), start
    character(:), allocatable :: note

    length = body%upper(:d) - body%lower(:d)
    spacing = length/real(body%points(:d), wp)
    if (maxval(spacing) <= minval(spacing)*(1.0_wp + spacing_tolerance)) return
    note = ''
    ! First the counts that keep one of the user's, then those around the mean spacing.
    do i = 1, d
      call fit(spacing(i))
    end do
    mean = exp(sum(log(spacing))/real(d, wp))
    start = max(1, nint(min(length(1)/mean, most_points)))
    do k = 0, min(start, most_trials)
      if (len(note) > 0) exit
      if (k < start) call fit(length(1)/real(start - k, wp))
      if (len(note) == 0) call fit(length(1)/real(start + k, wp))
    end do
    if (len(note) > 0) then
      note = 'equal with points = '//note
    else
      counts = max(1, nint(min(length/mean, most_points)))
      note = 'no counts near these fit the box; with points = '//listed(counts)// &
        & ' and spacing '//to_text(mean)//' m its lengths would be '
      do i = 1, d
        note = note//to_text(real(counts(i), wp)*mean)//' m'
        if (i < d) note = note//', '
      end do
    end if
    do i = 1, d
      if (i == 1) note = note//';  spacings now: '
      note = note//to_text(spacing(i))
      if (i < d) note = note//', '
    end do
    call rule_fault(error, 'body', number, 'points', &
      & 'the spacing of the lattice differs between directions', note//' m', source)

  contains

    !> Add the counts at spacing `h` to the note if they fill the box.
    subroutine fit(h)
      real(wp), intent(in) :: h
      integer :: filled(d)

      if (any(length/h > most_points)) return
      filled = nint(length/h)
      if (any(filled < 1)) return
      if (any(abs(real(filled, wp)*h - length) > 0.5_wp*spacing_tolerance*length)) return
      if (len(note) > 0) then
        if (index(note, listed(filled)) > 0) return
        note = note//' or '
      end if
      note = note//listed(filled)
    end subroutine fit

  end subroutine check_spacing

  !> `100, 50`
  pure function listed(counts) result(text)
    integer, intent(in) :: counts(:)
    character(:), allocatable :: text
    integer :: i

    text = to_text(counts(1))
    do i = 2, size(counts)
      text = text//', '//to_text(counts(i))
    end do
  end function listed

  !> A file that a group names must be there. An error is set if it is not.
  subroutine check_file(name, scene_file, group, number, error, source, key)
    character(*), intent(in) :: name                     !! of the file, as the scene says it
    character(:), allocatable, intent(in) :: scene_file
      !! path of the scene file, whose folder is looked in first; may be unallocated
    character(*), intent(in) :: group                    !! name of the group that names the file
    integer, intent(in) :: number                        !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source    !! the scanned file, for places
    character(*), intent(in), optional :: key            !! that names it; absent: `file`
    character(:), allocatable :: path, at
    logical :: exists

    at = 'file'
    if (present(key)) at = key
    path = trim(name)
    if (allocated(scene_file)) path = resolve_path(trim(name), scene_file)
    inquire (file=path, exist=exists)
    if (.not. exists) call rule_fault(error, group, number, at, "cannot find the file '"// &
      & trim(name)//"'", "looked for '"//path//"', then for that name in the working directory", &
      & source)
  end subroutine check_file

  !> The shape keys of `&remove`, `&keep`, `&region` and `&no_fail`: those of its kind and no
  !> others. An
  !> error is set if a rule is broken.
  subroutine check_shape(shape, dimension, scene_file, group, number, error, source)
    class(shape_group), intent(in) :: shape            !! the group, or its part that is a shape
    integer, intent(in) :: dimension                   !! of the scene
    character(:), allocatable, intent(in) :: scene_file
      !! path of the scene file, whose folder is looked in first; may be unallocated
    character(*), intent(in) :: group                  !! name of the group
    integer, intent(in) :: number                      !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places

    if (shape%surface /= '') then
      call check_shape_surface()
      return
    else if (abs(shape%scale - 1.0_wp) > 0.0_wp) then
      call rule_fault(error, group, number, 'scale', "'scale' without a surface", &
        & "it belongs to the key 'surface'", source)
      return
    end if
    select case (shape%shape)
    case ('box')
      call refuse(['centre   ', 'radius   ', 'axis     ', 'direction', 'height   ', 'angle    '])
      if (allocated(error)) return
      if (.not. any(is_set(shape%lower(:dimension))) .and. &
        & .not. any(is_set(shape%upper(:dimension)))) then
        call rule_fault(error, group, number, 'shape', 'a box without bounds', &
          & "expected 'lower', 'upper' or both; a component not given is unbounded", source)
      end if
    case ('sphere')
      call refuse(['lower    ', 'upper    ', 'axis     ', 'direction', 'height   ', 'angle    '])
      call need(shape%radius, 'radius', 'its radius [m]')
    case ('cylinder')
      call refuse(['angle    '])
      if (any(is_set(shape%direction))) call refuse(['lower    ', 'upper    ', 'axis     '])
      call need(shape%radius, 'radius', 'its radius [m]')
      if (any(is_set(shape%direction))) call need_direction()
    case ('cone')
      call refuse(['lower    ', 'upper    ', 'radius   ', 'axis     '])
      call need(shape%angle, 'angle', 'its opening angle [degrees]')
      call need_direction()
    case ('half_space')
      call refuse(['lower    ', 'upper    ', 'radius   ', 'axis     ', 'height   ', 'angle    '])
      call need_direction()
    case default
      call rule_fault(error, group, number, 'shape', 'group &'//group//" lacks the key 'shape'", &
        & "expected 'box', 'sphere', 'cylinder', 'cone' or 'half_space', or the key 'surface'"// &
        & alternatives(group), source)
    end select
    if (allocated(error)) return
    call check_finite_box(shape%lower, shape%upper, group, number, error, source)

  contains

    !> A surface instead of a shape.
    subroutine check_shape_surface()
      if (dimension /= 3) then
        call rule_fault(error, group, number, 'surface', 'a surface in a scene of dimension '// &
          & to_text(dimension), 'facets enclose a volume in 3D only', source)
      else if (shape%shape /= '' .or. any(is_set([shape%lower, shape%upper, shape%direction])) &
        & .or. any(is_set([shape%radius, shape%height, shape%angle]))) then
        call rule_fault(error, group, number, 'surface', "'surface' beside a shape", &
          & 'give one of them', source)
      else
        call check_file(shape%surface, scene_file, group, number, error, source, 'surface')
      end if
    end subroutine check_shape_surface

    !> An error if a key of another kind of shape is given.
    subroutine refuse(keys)
      character(*), intent(in) :: keys(:)
      integer :: i

      do i = 1, size(keys)
        if (allocated(error) .or. .not. given(group, number, trim(keys(i)), source)) cycle
        call rule_fault(error, group, number, trim(keys(i)), "'"//trim(keys(i))// &
          & "' is no key of a "//trim(shape%shape)//trim(merge(' with a direction', &
          & '                 ', shape%shape == 'cylinder' .and. keys(i) /= 'angle')), &
          & "it belongs to another kind of 'shape'", source)
      end do
    end subroutine refuse

    !> An error if a measure of the shape is not given.
    subroutine need(value, key, what)
      real(wp), intent(in) :: value
      character(*), intent(in) :: key, what

      if (allocated(error) .or. is_set(value)) return
      call rule_fault(error, group, number, 'shape', 'a '//trim(shape%shape)// &
        & " without the key '"//key//"'", 'expected '//what, source)
    end subroutine need

    !> An error if a direction is missing or has no length.
    subroutine need_direction()
      if (allocated(error)) return
      call check_vector(shape%direction, dimension, 'direction', group, number, error, source)
      if (allocated(error)) return
      if (norm2(shape%direction(:dimension)) <= 0.0_wp) call rule_fault(error, group, number, &
        & 'direction', "'direction' is zero", 'expected a vector', source)
    end subroutine need_direction

  end subroutine check_shape

  !> What a group may have instead of a shape, for a message.
  pure function alternatives(group) result(text)
    character(*), intent(in) :: group
    character(:), allocatable :: text

    select case (group)
    case ('region')
      text = ", or 'where'"
    case ('remove', 'keep')
      text = ", or 'region' or 'where'"
    case default  ! groups that have a shape or nothing
      text = ''
    end select
  end function alternatives

  !> One `&material`; fills in the default Poisson's ratio and density. An error is set if a rule is
  !> broken.
  subroutine check_material(scene, number, error, source)
    type(scene_type), intent(inout) :: scene           !! gets the material's defaults
    integer, intent(in) :: number                      !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places

    type(law_item_type) :: item

    call find_law(scene, number, item, error, source)
    if (allocated(error)) return
    associate (material => scene%materials(number))
      if (.not. is_set(material%youngs_modulus)) then
        call rule_fault(error, 'material', number, '', &
          & "group &material lacks the key 'youngs_modulus'", "Young's modulus E [Pa]", source)
      else if (is_set(material%critical_stretch) .and. &
        & is_set(material%critical_energy_release_rate)) then
        call rule_fault(error, 'material', number, 'critical_energy_release_rate', &
          & "'critical_stretch' and 'critical_energy_release_rate' are both given", &
          & 'give one of them; each follows from the other', source)
      else if (material%critical /= '' .and. .not. &
        & is_set(material%critical_energy_release_rate)) then
        call rule_fault(error, 'material', number, 'critical', &
          & "'critical' without 'critical_energy_release_rate'", "it says how the critical "// &
          & "stretch follows from that; a given 'critical_stretch' holds as it is", source)
      else if (is_set(material%scatter) .and. .not. (is_set(material%critical_stretch) .or. &
        & is_set(material%critical_energy_release_rate))) then
        call rule_fault(error, 'material', number, 'scatter', &
          & "'scatter' without a strength that could scatter", &
          & "give 'critical_stretch' or 'critical_energy_release_rate', too", source)
      else if (is_set(material%scatter) .and. item%law%softens) then
        call rule_fault(error, 'material', number, 'scatter', "model = '"// &
          & trim(material%model)//"' has no 'scatter'", &
          & 'its bonds lose their strength little by little', source)
      else if (.not. is_set(material%density) .and. any(is_set(scene%header%gravity))) then
        call rule_fault(error, 'material', number, 'density', &
          & "group &material lacks the key 'density'", &
          & 'gravity needs the mass density [kg/m3]', source)
      else if (.not. is_set(material%density) .and. scene%time%method == 'explicit') then
        call rule_fault(error, 'material', number, '', &
          & "group &material lacks the key 'density'", &
          & 'explicit steps in time need the mass density [kg/m3]', source)
      else
        call check_ratio(material, item%law%bond_based, scene%header%dimension, &
          & scene%header%plane, number, error, source)
      end if
      ! Relaxation has its own mass; 1 keeps quantities derived from the density finite.
      if (.not. is_set(material%density)) material%density = 1.0_wp
    end associate
  end subroutine check_material

  !> The law of a material, whose influence function and parameters get their defaults. An error is
  !> set if there is no such law, if it lacks a parameter, or if it does not have one that is given.
  subroutine find_law(scene, number, item, error, source)
    type(scene_type), intent(inout) :: scene
    integer, intent(in) :: number
    type(law_item_type), intent(out) :: item
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    type(law_table_type) :: laws
    character(:), allocatable :: note, nearest
    integer :: i, j

    laws = laws_of(scene)
    associate (material => scene%materials(number))
      i = laws%number_of(material%model)
      if (i == 0) then
        note = 'allowed: '//join(laws%names(), ', ')
        nearest = nearest_name(trim(material%model), laws%names())
        if (len(nearest) > 0) note = "did you mean '"//nearest//"'?  "//note
        call rule_fault(error, 'material', number, 'model', "unknown value '"// &
          & trim(material%model)//"' of key 'model' in group &material", note, source)
        return
      end if
      allocate (item%law, source=laws%items(i)%law)
      if (material%influence == '') material%influence = item%law%influence
      if (.not. allocated(material%parameters)) return
      do i = 1, size(material%parameters)
        associate (given => material%parameters(i))
          j = 0
          if (allocated(item%law%parameters)) j = findloc(item%law%parameters%name, given%name, &
            & dim=1)
          if (j == 0 .and. is_set(given%value)) then
            call rule_fault(error, 'material', number, trim(given%name), "'"//trim(given%name)// &
              & "' is no key of model = '"//trim(material%model)//"'", 'it belongs to '// &
              & owners(laws, given%name), source)
            return
          else if (j > 0 .and. .not. is_set(given%value)) then
            given%value = item%law%parameters(j)%default
            if (given%value <= required) then
              call rule_fault(error, 'material', number, '', "group &material lacks the key '"// &
                & trim(given%name)//"'", "model = '"//trim(material%model)//"' needs it: "// &
                & trim(given%meaning)//' ['//trim(given%unit)//']', source)
              return
            end if
          end if
        end associate
      end do
    end associate
  end subroutine find_law

  !> The laws that have a parameter: `model = 'a', 'b'`.
  pure function owners(laws, name) result(text)
    type(law_table_type), intent(in) :: laws
    character(*), intent(in) :: name
    character(:), allocatable :: text
    integer :: i

    text = ''
    do i = 1, size(laws%items)
      if (.not. allocated(laws%items(i)%law%parameters)) cycle
      if (.not. any(laws%items(i)%law%parameters%name == name)) cycle
      if (len(text) > 0) text = text//', '
      text = text//"'"//trim(laws%items(i)%law%name)//"'"
    end do
    text = 'model = '//text
  end function owners

  !> Poisson's ratio: in its range, and that of a bond-based law.
  subroutine check_ratio(material, bond_based, dimension, plane, number, error, source)
    type(material_group), intent(inout) :: material
    logical, intent(in) :: bond_based
    integer, intent(in) :: dimension
    character(*), intent(in) :: plane
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    real(wp) :: needed
    character(:), allocatable :: kind

    needed = bond_based_ratio(dimension, plane == 'strain')
    if (dimension == 1) then
      if (.not. is_set(material%poissons_ratio)) material%poissons_ratio = 0.0_wp
      return
    end if
    kind = 'in 3D'
    if (dimension == 2) kind = 'in plane '//trim(plane)
    if (bond_based) then
      if (is_set(material%poissons_ratio) .and. .not. material%ignore_poissons_ratio .and. &
        & abs(material%poissons_ratio - needed) > ratio_tolerance) then
        call rule_fault(error, 'material', number, 'poissons_ratio', 'the bond-based model '// &
          & "cannot have Poisson's ratio "//to_text(material%poissons_ratio), kind//' it has '// &
          & trim(merge('1/3', '1/4', needed > 0.3_wp))//"; use model = 'state_based', or "// &
          & 'ignore_poissons_ratio = .true.', source)
        return
      end if
      ! The resolved scene shows the value used in the computation.
      material%poissons_ratio = needed
    else if (.not. is_set(material%poissons_ratio)) then
      call rule_fault(error, 'material', number, '', &
        & "group &material lacks the key 'poissons_ratio'", &
        & "model = '"//trim(material%model)//"' needs it "//kind, source)
    else if (material%poissons_ratio >= 0.5_wp .and. .not. (dimension == 2 .and. &
      & plane == 'stress')) then
      call rule_fault(error, 'material', number, 'poissons_ratio', &
        & "'poissons_ratio' is out of range", 'expected > -1 and < 0.5 '//kind, source)
    end if
  end subroutine check_ratio

  !> One `&crack`: one kind, the one of the dimension, complete and not degenerate. An error is set
  !> if a rule is broken.
  subroutine check_crack(crack, dimension, scene_file, number, error, source)
    type(crack_group), intent(in) :: crack             !! the group
    integer, intent(in) :: dimension                   !! of the scene
    character(:), allocatable, intent(in) :: scene_file
      !! path of the scene file, whose folder is looked in first; may be unallocated
    integer, intent(in) :: number                      !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    logical :: segment, parallelogram, disc, chain
    character(:), allocatable :: kinds
    real(wp) :: cross(3)

    segment = any(is_set(crack%from)) .or. any(is_set(crack%to))
    parallelogram = any(is_set(crack%corner)) .or. any(is_set(crack%edge_1)) .or. &
      & any(is_set(crack%edge_2))
    disc = any(is_set(crack%centre)) .or. any(is_set(crack%normal)) .or. is_set(crack%radius)
    chain = allocated(crack%points)
    if (chain) then
      call check_chain(crack, dimension, segment .or. parallelogram .or. disc, number, error, &
        & source)
    else if (crack%surface /= '') then
      if (dimension /= 3) then
        call rule_fault(error, 'crack', number, 'surface', 'a surface in a scene of dimension '// &
          & to_text(dimension), 'facets are cracks in 3D; in 2D a crack is a segment', source)
      else if (segment .or. parallelogram .or. disc) then
        call rule_fault(error, 'crack', number, 'surface', "'surface' beside another kind of "// &
          & 'crack', 'give a &crack for each', source)
      else
        call check_file(crack%surface, scene_file, 'crack', number, error, source, 'surface')
      end if
    else if (abs(crack%scale - 1.0_wp) > 0.0_wp) then
      call rule_fault(error, 'crack', number, 'scale', "'scale' without a surface", &
        & "it belongs to the key 'surface'", source)
    else if (dimension == 1) then
      call rule_fault(error, 'crack', number, '', 'a crack in a scene of dimension 1', &
        & 'cracks are segments (2D), parallelograms or discs (3D)', source)
    else if (count([segment, parallelogram, disc]) /= 1 .or. (segment .neqv. dimension == 2)) then
      if (dimension == 2) then
        kinds = "expected a segment: 'from' and 'to', or a chain of them: 'points'"
      else
        kinds = "expected a parallelogram: 'corner', 'edge_1', 'edge_2', a disc: "// &
          & "'centre', 'normal', 'radius', or a 'surface'"
      end if
      call rule_fault(error, 'crack', number, '', 'this is not a crack of dimension '// &
        & to_text(dimension), kinds, source)
    else if (segment) then
      call check_vector(crack%from, 2, 'from', 'crack', number, error, source)
      if (allocated(error)) return
      call check_vector(crack%to, 2, 'to', 'crack', number, error, source)
      if (allocated(error)) return
      if (all(abs(crack%from(:2) - crack%to(:2)) <= 0.0_wp)) call rule_fault(error, 'crack', &
        & number, 'to', 'a crack without length', "'from' and 'to' are the same point", source)
    else if (parallelogram) then
      call check_vector(crack%corner, 3, 'corner', 'crack', number, error, source)
      if (allocated(error)) return
      call check_vector(crack%edge_1, 3, 'edge_1', 'crack', number, error, source)
      if (allocated(error)) return
      call check_vector(crack%edge_2, 3, 'edge_2', 'crack', number, error, source)
      if (allocated(error)) return
      cross = [crack%edge_1(2)*crack%edge_2(3) - crack%edge_1(3)*crack%edge_2(2), &
        & crack%edge_1(3)*crack%edge_2(1) - crack%edge_1(1)*crack%edge_2(3), &
        & crack%edge_1(1)*crack%edge_2(2) - crack%edge_1(2)*crack%edge_2(1)]
      if (norm2(cross) <= 1.0e-12_wp*norm2(crack%edge_1)*norm2(crack%edge_2)) &
        & call rule_fault(error, 'crack', number, 'edge_2', 'a crack without area', &
        & "'edge_1' and 'edge_2' are parallel or zero", source)
    else
      call check_vector(crack%centre, 3, 'centre', 'crack', number, error, source)
      if (allocated(error)) return
      call check_vector(crack%normal, 3, 'normal', 'crack', number, error, source)
      if (allocated(error)) return
      if (norm2(crack%normal) <= 0.0_wp) then
        call rule_fault(error, 'crack', number, 'normal', "'normal' is zero", &
          & 'expected a direction', source)
      else if (.not. is_set(crack%radius)) then
        call rule_fault(error, 'crack', number, '', "group &crack lacks the key 'radius'", &
          & 'expected the radius of the disc [m]', source)
      end if
    end if
  end subroutine check_crack

  !> A crack that is a chain of segments: two points at least, none of them twice in a row.
  subroutine check_chain(crack, dimension, others, number, error, source)
    type(crack_group), intent(in) :: crack
    integer, intent(in) :: dimension
    logical, intent(in) :: others             !! it has keys of other kinds of cracks
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    integer :: i

    if (dimension /= 2) then
      call rule_fault(error, 'crack', number, 'points', 'a chain of segments in a scene of '// &
        & 'dimension '//to_text(dimension), 'it belongs to dimension 2', source)
    else if (others) then
      call rule_fault(error, 'crack', number, 'points', "'points' with keys of another kind of "// &
        & 'crack', 'give one kind in a &crack', source)
    else if (modulo(size(crack%points), 2) == 1 .or. size(crack%points) < 4) then
      call rule_fault(error, 'crack', number, 'points', "'points' has "// &
        & to_text(size(crack%points))//' values', 'expected x and y of two points or more', source)
    else
      do i = 1, size(crack%points) - 3, 2
        if (any(abs(crack%points(i:i + 1) - crack%points(i + 2:i + 3)) > 0.0_wp)) cycle
        call rule_fault(error, 'crack', number, 'points', 'a crack without length', 'points '// &
          & to_text((i + 1)/2)//' and '//to_text((i + 3)/2)//' are the same', source)
        return
      end do
    end if
  end subroutine check_chain

end module pd_scene_content_check_bodies
