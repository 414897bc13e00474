!> Bodies that are lattices inside of surfaces, what their names mean, and points inside of
!> surfaces.
module pd_body_surfaces
  use pd_base_error, only: error_type
  use pd_base_expression, only: expression_type
  use pd_base_field, only: field_type, field_values, new_field
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_lookup, only: lookup_type
  use pd_base_system, only: available_memory
  use pd_base_text, only: join, lower_case, nearest_name, to_text, with_unit
  use pd_base_warnings, only: warnings_type
  use pd_body_body, only: body_type, grid_type, lattice_type, skin_type, allocate_points
  use pd_body_surface_crossing, only: crossings_text
  use pd_body_surface_cut, only: cut_cells, parts_type
  use pd_body_surface_fill, only: fill_cells, gaps_text, points_inside, read_solid, solid_type
  use pd_body_surface_near, only: points_near_facets
  use pd_body_surface_shares, only: share_facets
  use pd_body_surface_surface, only: area_vector, centre_of, extent_text, surface_fault, &
    & surface_type
  use pd_scene_content_expressions, only: expression_of
  use pd_scene_content_rules, only: place_fault
  use pd_scene_content_types, only: scene_type, has_cut_cells, has_own_horizons, is_set, &
    & words_of_body
  use pd_scene_format_file, only: resolve_path
  use pd_scene_format_given, only: name_length
  implicit none (type, external)
  private
  public :: surface_body, keep_skin, skin_named, facets_of_side, near_side, side_areas, &
    & inside_surface

  real(wp), parameter :: most_cells = 1.0e9_wp        !! of the box around a surface
  real(wp), parameter :: memory_per_point = 400.0_wp  !! while families are built [bytes]
  real(wp), parameter :: same = 1.0e-3_wp             !! of a cell, that a surface may stick out
  real(wp), parameter :: sliver = 0.05_wp             !! of a cell; less goes to a neighbour
  real(wp), parameter :: much = 0.1_wp                !! of the volume, that whole cells may miss
  real(wp), parameter :: pi = acos(-1.0_wp)

contains

  !> The points of a body inside of a surface. An error, with its place, if the surface cannot be
  !> read, has no inside, or is too small or too large for its cells.
  subroutine surface_body(scene, number, body, lattice, skin, error, warnings)
    type(scene_type), intent(in) :: scene         !! a checked scene
    integer, intent(in) :: number                 !! of the body
    type(body_type), intent(out) :: body          !! its points, x fastest
    type(lattice_type), intent(out) :: lattice    !! its cells
    type(skin_type), intent(out) :: skin          !! its facets
    type(error_type), allocatable, intent(out) :: error
    type(warnings_type), intent(inout), optional :: warnings  !! get gaps and overlaps
    type(solid_type) :: solid
    integer(i1), allocatable :: windings(:, :, :)
    character(:), allocatable :: text

    associate (group => scene%bodies(number))
      call read_solid(resolve_path(trim(group%surface), scene%file), group%scale, solid, error)
      if (.not. allocated(error)) call choose_lattice(solid%surface, group%spacing, group%lower, &
        & lattice, error)
      if (.not. allocated(error)) call fill_cells(solid, lattice%grid%origin, &
        & lattice%grid%spacing, lattice%cells, windings, error)
      if (.not. allocated(error)) then
        if (has_cut_cells(group)) then
          call points_of_parts(solid%surface, lattice, windings, body, error)
        else
          call points_of_cells(solid%surface, lattice, windings, body, error)
        end if
      end if
      call place_fault(error, scene, 'body', number, 'surface')
      if (allocated(error)) return
      text = gaps_text(solid)
      skin%body = number
      skin%lattice = lattice
      call move_surface(solid%surface, skin%surface)
      if (.not. present(warnings)) return
      if (len(text) > 0) call warnings%add('gaps of surface '//to_text(number), &
        & words_of_body(scene%bodies, number)//': '//text, tell=.false.)
      text = crossings_text(skin%surface)
      if (len(text) > 0) call warnings%add('crossings of surface '//to_text(number), &
        & words_of_body(scene%bodies, number)//': '//text, tell=.false.)
      if (abs(sum(body%volume) - skin%surface%volume) > much*skin%surface%volume .and. &
        & all(windings <= 1_i1)) call warnings%add('volume of surface '//to_text(number), &
        & words_of_body(scene%bodies, number)//': its cells have a volume of '// &
        & with_unit(sum(body%volume), &
        & 'm3', 4)//', its surface holds '//with_unit(skin%surface%volume, 'm3', 4)//"; use a "// &
        & "smaller spacing, or fill = 'volume'", tell=.false.)
      if (any(windings > 1_i1)) call warnings%add('shells of surface '//to_text(number), &
        & words_of_body(scene%bodies, number)//': '//to_text(count(windings > 1_i1))// &
        & ' cells are inside of '// &
        & 'several shells of its surface, and count once, the first near '// &
        & place_text(findloc(windings > 1_i1, .true.))//'; shells that overlap or a surface '// &
        & 'that passes through itself do that; the facets of a cavity face into it', tell=.false.)
    end associate

  contains

    !> Where the centre of a cell is.
    function place_text(cell) result(text)
      integer, intent(in) :: cell(3)
      character(:), allocatable :: text
      real(wp) :: place(3)

      place = lattice%grid%origin + lattice%grid%spacing*(cell - 0.5_wp)
      text = '('//to_text(place(1), 5)//', '//to_text(place(2), 5)//', '//to_text(place(3), 5)// &
        & ') m'
    end function place_text

    !> Move what a skin needs; the rest goes with the solid.
    subroutine move_surface(from, to)
      type(surface_type), intent(inout) :: from
      type(surface_type), intent(inout) :: to

      to%file = from%file
      to%n_facets = from%n_facets
      to%n_vertices = from%n_vertices
      to%n_solids = from%n_solids
      to%low = from%low
      to%high = from%high
      to%volume = from%volume
      call move_alloc(from%x, to%x)
      call move_alloc(from%corner, to%corner)
      call move_alloc(from%solid, to%solid)
      call move_alloc(from%number, to%number)
      call move_alloc(from%line, to%line)
      to%names = from%names
    end subroutine move_surface

  end subroutine surface_body

  !> The cells around a surface: centred in its box, or with a corner of some cell at `lower`. An
  !> error if they are too many, or larger than the surface.
  subroutine choose_lattice(surface, spacing, lower, lattice, error)
    type(surface_type), intent(in) :: surface
    real(wp), intent(in) :: spacing               !! [m]
    real(wp), intent(in) :: lower(3)              !! `unset` if not given [m]
    type(lattice_type), intent(out) :: lattice
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: number(3), origin(3), need
    character(*), parameter :: note = "is 'scale' right? a file in millimetres has scale = 1e-3"

    if (all(is_set(lower))) then
      origin = lower + spacing*anint((surface%low - lower)/spacing)
      where (origin > surface%low + same*spacing) origin = origin - spacing
      number = max(1.0_wp, aint((surface%high - origin)/spacing + 1 - same))
    else
      number = max(1.0_wp, aint((surface%high - surface%low)/spacing + 1 - same))
      origin = (surface%low + surface%high)/2 - spacing*number/2
    end if
    if (surface%volume < spacing**3/2) then
      call surface_fault(surface, 'the surface holds less than half a cell of '// &
        & with_unit(spacing, 'm', 4)//': it is '//extent_text(surface), error, note)
    else if (product(number) > most_cells) then
      call surface_fault(surface, 'too many cells: the surface is '//extent_text(surface)// &
        & ', which takes '//to_text(product(number), 3)//' cells of '//with_unit(spacing, 'm', 4), &
        & error, 'a body has at most '//to_text(most_cells, 3)//'; '//note)
    end if
    if (allocated(error)) return
    need = product(number)*2 + memory_per_point*surface%volume/spacing**3
    if (need > real(available_memory(), wp)) then
      call surface_fault(surface, 'the surface is '//extent_text(surface)//' and holds about '// &
        & to_text(surface%volume/spacing**3, 3)//' cells of '//with_unit(spacing, 'm', 4)// &
        & ', which need '//with_unit(need, 'B', 3)//' of memory', error, &
        & 'only '//with_unit(real(available_memory(), wp), 'B', 3)//' are available; '//note)
      return
    end if
    lattice%grid%spacing = spacing
    lattice%grid%origin = origin
    lattice%cells = nint(number)
  end subroutine choose_lattice

  !> No cell is inside.
  subroutine no_cells(surface, lattice, error)
    type(surface_type), intent(in) :: surface
    type(lattice_type), intent(in) :: lattice
    type(error_type), allocatable, intent(out) :: error

    call surface_fault(surface, 'no cell of '//with_unit(lattice%grid%spacing, 'm', 4)// &
      & ' has its centre inside of the surface, which is '//extent_text(surface), error, &
      & "is 'scale' right, and 'spacing' smaller than the thinnest part?")
  end subroutine no_cells

  !> Points at the centres of the cells that are inside.
  subroutine points_of_cells(surface, lattice, windings, body, error)
    type(surface_type), intent(in) :: surface
    type(lattice_type), intent(in) :: lattice
    integer(i1), intent(in) :: windings(:, :, :)
    type(body_type), intent(out) :: body
    type(error_type), allocatable, intent(out) :: error
    integer :: i, j, k, n

    n = count(windings > 0_i1)
    if (n == 0) then
      call no_cells(surface, lattice, error)
      return
    end if
    call allocate_points(body, 3, n)
    n = 0
    do k = 1, lattice%cells(3)
      do j = 1, lattice%cells(2)
        do i = 1, lattice%cells(1)
          if (windings(i, j, k) <= 0_i1) cycle
          n = n + 1
          body%x(n, :) = lattice%grid%origin + ([i, j, k] - 0.5_wp)*lattice%grid%spacing
        end do
      end do
    end do
    body%volume = lattice%grid%spacing**3
    body%spacing = lattice%grid%spacing
  end subroutine points_of_cells

  !> Points at the centres of what is inside of each cell, with its volume. Slivers of a cut cell
  !> join the neighbour with the largest part.
  subroutine points_of_parts(surface, lattice, windings, body, error)
    type(surface_type), intent(in) :: surface
    type(lattice_type), intent(in) :: lattice
    integer(i1), intent(in) :: windings(:, :, :)
    type(body_type), intent(out) :: body
    type(error_type), allocatable, intent(out) :: error
    type(parts_type) :: parts
    type(lookup_type) :: table
    real(wp), allocatable :: volume(:), moment(:, :)
    logical, allocatable :: cut(:), kept(:)
    integer :: i, j, k, n, p, q, number, at(3), cells
    logical :: is_new

    if (any(windings > 1_i1)) then
      at = findloc(windings > 1_i1, .true.)
      call surface_fault(surface, "shells of the surface overlap, near ("// &
        & to_text(lattice%grid%origin(1) + lattice%grid%spacing*(at(1) - 0.5_wp), 5)//', '// &
        & to_text(lattice%grid%origin(2) + lattice%grid%spacing*(at(2) - 0.5_wp), 5)//', '// &
        & to_text(lattice%grid%origin(3) + lattice%grid%spacing*(at(3) - 0.5_wp), 5)//') m', &
        & error, "fill = 'volume' would count parts of cells twice; use 'centre', or unite them")
      return
    end if
    call cut_cells(surface, lattice%grid%origin, lattice%grid%spacing, lattice%cells, windings, &
      & parts)
    ! cut cells first, in the order of the lattice, then whole ones beside them that get slivers
    associate (h => lattice%grid%spacing)
      allocate (cut(product(int(lattice%cells, i8))), source=.false.)
      do p = 1, parts%n
        call table%number_of(index_of(parts%cell(:, p)), number, is_new)
        cut(index_of(parts%cell(:, p))) = .true.
      end do
      volume = parts%volume
      moment = parts%moment
      allocate (kept(parts%n))
      kept = volume > 1.0e-9_wp*h**3
      do p = 1, parts%n
        if (.not. kept(p) .or. volume(p) >= sliver*h**3) cycle
        call largest_neighbour(p, at, q)
        if (q == 0) cycle
        ! its place from the neighbour's centre
        moment(:, q) = moment(:, q) + moment(:, p) + volume(p)*h*(parts%cell(:, p) - at)
        volume(q) = volume(q) + volume(p)
        kept(p) = .false.
      end do
      n = count(windings > 0_i1 .and. .not. reshape(cut, lattice%cells)) + count(kept)
      if (n == 0) then
        call no_cells(surface, lattice, error)
        return
      end if
      call allocate_points(body, 3, n)
      n = 0
      cells = 0
      do k = 1, lattice%cells(3)
        do j = 1, lattice%cells(2)
          do i = 1, lattice%cells(1)
            cells = cells + 1
            p = 0
            if (cut(cells)) then
              p = table%look(int(cells, i8))
              if (.not. kept(p)) cycle
            else if (windings(i, j, k) <= 0_i1) then
              cycle
            end if
            n = n + 1
            body%x(n, :) = lattice%grid%origin + ([i, j, k] - 0.5_wp)*h
            body%volume(n) = h**3
            if (p == 0) cycle
            body%x(n, :) = body%x(n, :) + moment(:, p)/volume(p)
            body%volume(n) = volume(p)
          end do
        end do
      end do
      body%spacing = h
    end associate

  contains

    !> The number of a cell, x fastest.
    pure integer(i8) function index_of(cell)
      integer, intent(in) :: cell(3)
      index_of = cell(1) + int(lattice%cells(1), i8)*(cell(2) - 1 + int(lattice%cells(2), i8) &
        & *(cell(3) - 1))
    end function index_of

    !> The cut neighbour of a part that has the largest part, the first of equal ones; 0 if no
    !> neighbour has more than a sliver. A whole neighbour is none: it would become another size.
    subroutine largest_neighbour(p, at, q)
      integer, intent(in) :: p
      integer, intent(out) :: at(3), q
      integer :: axis, side, there(3), other
      real(wp) :: most

      q = 0
      at = 0
      most = sliver*lattice%grid%spacing**3
      do axis = 1, 3
        do side = -1, 1, 2
          there = parts%cell(:, p)
          there(axis) = there(axis) + side
          if (any(there < 1) .or. any(there > lattice%cells)) cycle
          other = table%look(index_of(there))
          if (other == 0) cycle
          if (.not. kept(other) .or. volume(other) <= most) cycle
          most = volume(other)
          q = other
          at = there
        end do
      end do
    end subroutine largest_neighbour

  end subroutine points_of_parts

  !> Add a skin to a body.
  subroutine keep_skin(body, skin)
    type(body_type), intent(inout) :: body  !! with one skin more
    type(skin_type), intent(in) :: skin     !! the skin
    type(skin_type), allocatable :: skins(:)
    integer :: i

    allocate (skins(size(body%skins) + 1))
    do i = 1, size(body%skins)
      skins(i) = body%skins(i)
    end do
    skins(size(skins)) = skin
    call move_alloc(skins, body%skins)
  end subroutine keep_skin

  !> The number of the skin that a name `BODY:NAME` belongs to, 0 if its body has none.
  pure integer function skin_named(scene, body, name) result(s)
    type(scene_type), intent(in) :: scene  !! a checked scene
    type(body_type), intent(in) :: body    !! with its skins
    character(*), intent(in) :: name       !! `BODY:NAME`

    do s = size(body%skins), 1, -1
      if (scene%bodies(body%skins(s)%body)%name == name(:index(name, ':') - 1)) return
    end do
  end function skin_named

  !> The facets that a name means: of a `&side`, else of a solid of the file. An error, with the
  !> file, if there is none.
  subroutine facets_of_side(scene, skin, name, chosen, error)
    type(scene_type), intent(in) :: scene            !! a checked scene
    type(skin_type), intent(in) :: skin              !! of a body
    character(*), intent(in) :: name                 !! without that of the body
    logical, allocatable, intent(out) :: chosen(:)   !! (facets)
    type(error_type), allocatable, intent(out) :: error
    integer :: i, k
    logical :: exact

    associate (surface => skin%surface)
      do i = 1, size(scene%sides)
        if (scene%sides(i)%name /= name) cycle
        call facets_where(scene, i, surface, chosen)
        if (.not. any(chosen)) call surface_fault(surface, "no facet of the surface belongs to "// &
          & "the &side '"//trim(name)//"'", error)
        return
      end do
      exact = any(surface%names(:surface%n_solids) == name)
      allocate (chosen(surface%n_facets), source=.false.)
      do i = 1, surface%n_solids
        if (surface%names(i) == '') cycle
        if (exact .and. surface%names(i) /= name) cycle
        if (.not. exact .and. lower_case(surface%names(i)) /= lower_case(name)) cycle
        do k = 1, surface%n_facets
          if (surface%solid(k) == i) chosen(k) = .true.
        end do
      end do
      if (.not. any(chosen)) call unknown_name(scene, surface, name, error)
    end associate
  end subroutine facets_of_side

  !> The facets of a `&side`.
  subroutine facets_where(scene, number, surface, chosen)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: number
    type(surface_type), intent(in) :: surface
    logical, allocatable, intent(out) :: chosen(:)
    type(expression_type) :: expression
    type(field_type) :: field
    real(wp), allocatable :: centres(:, :), values(:)
    real(wp) :: vector(3), direction(3), least
    integer :: f, at

    allocate (chosen(surface%n_facets), source=.true.)
    associate (side => scene%sides(number))
      if (any(is_set(side%normal))) then
        direction = side%normal/norm2(side%normal)
        least = cos(min(180.0_wp, side%angle)*pi/180)
        do f = 1, surface%n_facets
          vector = area_vector(surface, f)
          chosen(f) = norm2(vector) > 0.0_wp
          if (chosen(f)) chosen(f) = dot_product(vector, direction) >= (least - 1.0e-9_wp) &
            & *norm2(vector)
        end do
      end if
      if (side%where == '') return
      allocate (centres(surface%n_facets, 3), values(surface%n_facets))
      do f = 1, surface%n_facets
        centres(f, :) = centre_of(surface, f)
      end do
      call expression_of(scene, side%where, expression)
      call new_field(expression, centres, field)
      call field_values(field, 0.0_wp, values, at)
      chosen = chosen .and. abs(values) > 0.0_wp
    end associate
  end subroutine facets_where

  !> An error that names the solids and sides there are.
  subroutine unknown_name(scene, surface, name, error)
    type(scene_type), intent(in) :: scene
    type(surface_type), intent(in) :: surface
    character(*), intent(in) :: name
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: most = 20
    character(name_length), allocatable :: names(:)
    character(:), allocatable :: note, nearest
    integer :: i

    allocate (names(min(most, surface%n_solids) + size(scene%sides)))
    do i = 1, size(names) - size(scene%sides)
      names(i) = surface%names(i)
    end do
    do i = 1, size(scene%sides)
      names(size(names) - size(scene%sides) + i) = scene%sides(i)%name
    end do
    names = pack(names, names /= '')
    note = 'its solids have no names; give a &side'
    if (size(names) > 0) then
      note = 'there are: '//join(names, ', ')
      nearest = nearest_name(trim(name), names)
      if (len(nearest) > 0) note = "did you mean '"//nearest//"'?  "//note
    end if
    call surface_fault(surface, "the surface has no solid with facets, and the scene no &side, "// &
      & "named '"//trim(name)//"'", error, note)
  end subroutine unknown_name

  !> The slots of the points of a skin's body, layers left out, in the order of the points.
  pure function slots_of(body, skin) result(slots)
    type(body_type), intent(in) :: body
    type(skin_type), intent(in) :: skin
    integer(i4), allocatable :: slots(:)

    slots = pack(body%slot, body%body(body%slot) == skin%body .and. body%layer(body%slot) == 0)
  end function slots_of

  !> The slots with the points of a body within the horizon of facets of its surface.
  subroutine near_side(scene, body, number, name, mask, error)
    type(scene_type), intent(in) :: scene            !! a checked scene
    type(body_type), intent(in) :: body              !! its points, arranged in slots
    integer, intent(in) :: number                    !! of the skin
    character(*), intent(in) :: name                 !! of the side, without that of the body
    logical, allocatable, intent(out) :: mask(:)     !! (n_slots)
    type(error_type), allocatable, intent(out) :: error
    logical, allocatable :: chosen(:), near(:)
    integer(i4), allocatable :: slots(:)

    allocate (mask(body%n_slots), source=.false.)
    call facets_of_side(scene, body%skins(number), name, chosen, error)
    if (allocated(error)) return
    slots = slots_of(body, body%skins(number))
    if (size(slots) == 0) return
    if (has_own_horizons(scene)) then
      call points_near_facets(body%skins(number)%surface, chosen, body%x(slots, :), body%delta, &
        & near, scene%horizon%ratio*body%spacing(slots))
    else
      call points_near_facets(body%skins(number)%surface, chosen, body%x(slots, :), body%delta, &
        & near)
    end if
    mask(slots) = near
  end subroutine near_side

  !> The points that share the area of facets of a surface, with their parts of it. An error, with
  !> its place, if no point is near a facet.
  subroutine side_areas(scene, body, number, name, slots, vector, area, error)
    type(scene_type), intent(in) :: scene   !! a checked scene
    type(body_type), intent(in) :: body     !! its points, arranged in slots
    integer, intent(in) :: number           !! of the skin
    character(*), intent(in) :: name        !! of the side, without that of the body
    integer(i4), allocatable, intent(out) :: slots(:)   !! (points) in the order of the points
    real(wp), allocatable, intent(out) :: vector(:, :)  !! (points, 3) along the normals [m2]
    real(wp), allocatable, intent(out) :: area(:)       !! (points) [m2]
    type(error_type), allocatable, intent(out) :: error
    logical, allocatable :: chosen(:)
    real(wp), allocatable :: all_vectors(:, :), all_areas(:)
    integer(i4), allocatable :: used(:)
    integer :: i

    associate (skin => body%skins(number))
      call facets_of_side(scene, skin, name, chosen, error)
      if (allocated(error)) return
      slots = slots_of(body, skin)
      if (size(slots) == 0) then
        call surface_fault(skin%surface, 'every point of the body was removed', error)
        return
      end if
      call share_facets(skin%surface, chosen, body%x(slots, :), skin%lattice%grid%origin, &
        & skin%lattice%grid%spacing, all_vectors, all_areas, error)
      if (allocated(error)) return
    end associate
    used = pack([(int(i, i4), i=1, size(slots))], any(abs(all_vectors) > 0.0_wp, dim=2) .or. &
      & abs(all_areas) > 0.0_wp)
    slots = slots(used)
    vector = all_vectors(used, :)
    area = all_areas(used)
  end subroutine side_areas

  !> Whether each of some places is inside of a surface. An error, with its place, if the surface
  !> cannot be read, or has no inside.
  subroutine inside_surface(scene, name, scale, x, spacing, inside, error)
    type(scene_type), intent(in) :: scene           !! whose folder the file is looked for in
    character(*), intent(in) :: name                !! of the file, as the scene says it
    real(wp), intent(in) :: scale                   !! metres of one unit of it
    real(wp), intent(in) :: x(:, :)                 !! (places, 3) [m]
    real(wp), intent(in) :: spacing                 !! of the points [m]
    logical, allocatable, intent(out) :: inside(:)  !! (places)
    type(error_type), allocatable, intent(out) :: error
    type(solid_type) :: solid

    call read_solid(resolve_path(trim(name), scene%file), scale, solid, error)
    if (allocated(error)) return
    call points_inside(solid, x, spacing, inside)
  end subroutine inside_surface

end module pd_body_surfaces
