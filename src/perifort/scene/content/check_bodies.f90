!> Rules for bodies: lattices, their shapes and axes, surfaces, meshes, clouds.
module pd_scene_content_check_bodies
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type, internal_fault
  use pd_base_text, only: join, nearest_name, to_text, with_unit
  use pd_scene_content_rules, only: rule_fault, given, check_file, check_finite_box, check_known, &
    & check_vector
  use pd_scene_format_source, only: source_type
  use pd_scene_content_types, only: scene_type, body_group, is_set, name_length
  implicit none (type, external)
  private
  public :: check_body

  real(wp), parameter :: spacing_tolerance = 1.0e-6_wp  !! relative, between directions
  !> Peak memory of a point of a lattice, while families are built, measured on cubes [bytes].
  real(wp), parameter :: memory_per_point = 400.0_wp
  real(wp), parameter :: most_points = 1.0e9_wp         !! points and slots have 32-bit numbers
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

end module pd_scene_content_check_bodies
