!> Loads of a scene, on the slots that they act on.
module pd_set_up_loads
  use pd_base_kinds, only: wp, i4
  use pd_base_error, only: error_type
  use pd_base_expression, only: expression_type
  use pd_base_reduce, only: add_point, any_of_ranks, largest_of_ranks, new_running, &
    & running_type, total_of_running
  use pd_scene_content_expressions, only: expression_of, varies_in_time
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: body_group, is_turned, scene_type, load_group, is_set
  use pd_body_body, only: body_type
  use pd_body_lattices, only: axes_of
  use pd_body_meshes, only: facet_areas, names_set, place_set_fault
  use pd_body_choice, only: values_on
  use pd_body_regions, only: region_mask
  use pd_family_areas, only: behind_share, next_points, outermost_share
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  use pd_motion_loads, only: load_type, add_part
  use pd_set_up_conditions, only: course, no_points, slots_where
  implicit none (type, external)
  private
  public :: loads_of_scene, volume_of

  character(*), parameter :: xyz = 'xyz'

contains

  !> Force densities of every `&load`: pressure, total force and body force of a group add up. An
  !> error is set if one holds no point.
  subroutine loads_of_scene(scene, body, family, loads, error)
    type(scene_type), intent(in) :: scene                  !! a checked scene
    type(body_type), intent(in) :: body                    !! its points, arranged in slots
    class(family_type), intent(in) :: family               !! of the body, whole
    type(load_type), allocatable, intent(out) :: loads(:)  !! (loads) in the order of the groups
    type(error_type), allocatable, intent(out) :: error
    logical, allocatable :: chosen(:)
    real(wp), allocatable :: pressed(:, :), part(:), whole(:), per_force(:)
    real(wp) :: volume  ! or area
    integer :: l, c

    allocate (loads(size(scene%loads)))
    do l = 1, size(loads)
      associate (group => scene%loads(l), load => loads(l))
        if (names_set(group%side)) then
          call facet_load(scene, body, l, load, error)
          if (allocated(error)) return
          load%curve = course(scene, group%ramp_time, group%times, group%values, timed_load(scene, &
            & group))
          cycle
        else if (group%side /= '') then
          chosen = outermost_row(scene, body, group)
        else if (group%region /= '') then
          chosen = region_mask(scene, body, group%region) .and. body%layer == 0
        else
          chosen = body%point > 0 .and. body%layer == 0
        end if
        if (group%body /= '') chosen = chosen .and. body%body == body_number(scene, group%body)
        load%slots = slots_where(body, chosen)
        if (.not. any_of_ranks(body%order, size(load%slots) > 0)) then
          call scene_fault(error, scene, 'load', l, 'region', no_points('&load', group%body, &
            & group%region), 'expected a place that holds points of the bodies')
          return
        end if
        volume = volume_of(body, load%slots)
        call share_side(scene, body, family, group, chosen, load%slots, part)
        per_force = part*(1/volume)
        if (allocated(body%sides) .and. group%side /= '') then
          per_force = part/body%spacing(load%slots)
          volume = sum(per_force*body%volume(load%slots))
          if (.not. volume > 0.0_wp) then
            call scene_fault(error, scene, 'load', l, 'side', "the points at side = '"// &
              & trim(group%side)//"' have no free face: with surface_correction = 'consistent' "// &
              & 'a load on a side acts on free ones', 'is there a layer or another body?')
            return
          end if
          per_force = per_force/volume
        end if
        whole = merge(1.0_wp, 0.0_wp, chosen(load%slots))
        allocate (load%density(size(load%slots), body%dim), source=0.0_wp)
        do c = 1, body%dim
          if (is_set(group%body_force(c))) load%density(:, c) = group%body_force(c)*whole
          if (.not. is_set(group%force(c))) cycle
          if (allocated(body%sides) .and. group%side /= '') then
            load%density(:, c) = load%density(:, c) + per_force*group%force(c)
          else
            load%density(:, c) = load%density(:, c) + part*(group%force(c)/volume)
          end if
        end do
        call by_side()
        call load_by_expressions(scene, body, l, load, pressed, per_force, whole, error)
        if (allocated(error)) return
        load%curve = course(scene, group%ramp_time, group%times, group%values, timed_load(scene, &
          & group))
      end associate
    end do

  contains

    !> Pressure on the row at the load's side, and the force density of a unit of it.
    subroutine by_side()
      real(wp) :: outward, axes(3, 3)
      integer :: axis, d

      if (allocated(pressed)) deallocate (pressed)
      allocate (pressed(size(loads(l)%slots), body%dim), source=0.0_wp)
      associate (side => scene%loads(l)%side)
        if (side == '') return
        axis = index('xyz', side(1:1))
        outward = merge(-1.0_wp, 1.0_wp, side(3:5) == 'min')
        if (is_turned(side_body(scene, scene%loads(l)%body))) then
          axes = axes_of(side_body(scene, scene%loads(l)%body), body%dim)
          do d = 1, body%dim
            pressed(:, d) = -part*(axes(d, axis)*outward/body%spacing(loads(l)%slots))
            if (is_set(scene%loads(l)%pressure)) loads(l)%density(:, d) = loads(l)%density(:, d) &
              & + scene%loads(l)%pressure*pressed(:, d)
          end do
          return
        end if
        pressed(:, axis) = -part*(outward/body%spacing(loads(l)%slots))
        if (is_set(scene%loads(l)%pressure)) loads(l)%density(:, axis) = &
          & loads(l)%density(:, axis) - part*(scene%loads(l)%pressure*outward/body%spacing( &
          & loads(l)%slots))
      end associate
    end subroutine by_side

  end subroutine loads_of_scene

  !> Add the points behind those of a side to a load where consistent weights take tractions by
  !> extrapolation to the faces (doc/theory.md, 4), and say what part of its load each point has:
  !> 1.5 at the side, -0.5 behind; 1 in all other cases.
  subroutine share_side(scene, body, family, group, chosen, slots, part)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(load_group), intent(in) :: group
    logical, intent(in) :: chosen(:)                     !! slots that the group names
    integer(i4), allocatable, intent(inout) :: slots(:)  !! those in point order; gets more
    real(wp), allocatable, intent(out) :: part(:)        !! of each of them then [-]
    type(bonds_type) :: bonds
    real(wp), allocatable :: share(:)
    integer :: i, k, axis, inward, s, e, next(-1:1, body%dim)

    if (group%side == '' .or. scene%horizon%surface_correction /= 'consistent') then
      allocate (part(size(slots)), source=1.0_wp)
      return
    end if
    axis = index('xyz', group%side(1:1))
    inward = merge(1, -1, group%side(3:5) == 'min')
    allocate (share(body%n_slots), source=0.0_wp)
    if (allocated(body%sides)) then
      do s = 1, size(body%sides%axis)
        associate (sides => body%sides)
          if (sides%axis(s) /= axis .or. sides%outward(s) /= -inward) cycle
          if (.not. side_chosen(body, s, chosen)) cycle
          do e = sides%start(s), sides%start(s + 1) - 1
            k = sides%slot(e)
            share(k) = share(k) - inward*sides%area(axis, e)*body%spacing(k)/body%volume(k)
          end do
        end associate
      end do
      slots = slots_where(body, abs(share) > 0.0_wp .or. chosen)
      part = share(slots)
      return
    end if
    call allocate_bonds(family, bonds)
    do i = 1, size(slots)
      k = slots(i)
      call family%bonds_of(k, bonds)
      call next_points(body, bonds, k, next)
      if (next(inward, axis) == 0) then
        share(k) = share(k) + 1.0_wp
        cycle
      end if
      share(k) = share(k) + outermost_share
      share(next(inward, axis)) = share(next(inward, axis)) + behind_share
    end do
    slots = slots_where(body, abs(share) > 0.0_wp .or. chosen)
    part = share(slots)
  end subroutine share_side

  !> Whether a side of the balanced areas is one that a load means: the outermost faces of a body
  !> whose points are chosen.
  pure logical function side_chosen(body, s, chosen)
    type(body_type), intent(in) :: body
    integer, intent(in) :: s              !! side
    logical, intent(in) :: chosen(:)      !! slots of the outermost row
    side_chosen = body%sides%outermost(s)
    if (side_chosen) side_chosen = any(chosen .and. body%body == body%sides%body(s))
  end function side_chosen

  !> A load on facets of a mesh: pressure along their normals, a total force by their areas; both
  !> act on the points that share the areas. An error is set if these cannot be found.
  subroutine facet_load(scene, body, number, load, error)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    integer, intent(in) :: number            !! of the `&load`
    type(load_type), intent(inout) :: load   !! gets slots and densities
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: vector(:, :), area(:), pressed(:, :)
    integer :: c

    associate (group => scene%loads(number))
      call facet_areas(scene, body, group%side, load%slots, vector, area, error)
      call place_set_fault(error, scene, 'load', number, 'side')
      if (allocated(error)) return
      allocate (pressed(size(area), body%dim))
      do c = 1, body%dim
        pressed(:, c) = -vector(:, c)/body%volume(load%slots)
      end do
      area = area/sum(area)/body%volume(load%slots)
      allocate (load%density(size(area), body%dim), source=0.0_wp)
      do c = 1, body%dim
        if (is_set(group%force(c))) load%density(:, c) = group%force(c)*area
      end do
      if (is_set(group%pressure)) load%density = load%density + group%pressure*pressed
      call load_by_expressions(scene, body, number, load, pressed, area, 0*area + 1, error)
    end associate
  end subroutine facet_load

  !> Whether a load depends on t by an expression.
  logical function timed_load(scene, group) result(timed)
    type(scene_type), intent(in) :: scene
    type(load_group), intent(in) :: group
    integer :: c

    timed = varies_in_time(scene, group%pressure_text)
    do c = 1, 3
      timed = timed .or. varies_in_time(scene, group%force_text(c)) .or. &
        & varies_in_time(scene, group%body_force_text(c))
    end do
  end function timed_load

  !> The parts of a load that are given by expressions. Those without t add to its densities. An
  !> error is set if a value is not finite.
  subroutine load_by_expressions(scene, body, number, load, pressed, shared, whole, &
    & error)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    integer, intent(in) :: number            !! of the `&load`
    type(load_type), intent(inout) :: load   !! with its slots and its densities by numbers
    real(wp), intent(in) :: pressed(:, :)    !! (points, dim) density of a unit pressure [1/m]
    real(wp), intent(in) :: shared(:)        !! (points) density of a unit force [1/m3]
    real(wp), intent(in) :: whole(:)         !! (points) 1 where a body force acts, else 0 [-]
    type(error_type), allocatable, intent(out) :: error
    integer :: c

    associate (group => scene%loads(number))
      do c = 1, body%dim
        call add(group%body_force_text(c), 'body_force_'//xyz(c:c), c, whole)
        call add(group%force_text(c), 'force_'//xyz(c:c), c, shared)
      end do
      if (group%pressure_text == '') return
      do c = 1, body%dim
        if (any(abs(pressed(:, c)) > 0.0_wp)) call add(group%pressure_text, 'pressure', c, &
          & pressed(:, c))
      end do
    end associate

  contains

    !> One part.
    subroutine add(text, key, c, weight)
      character(*), intent(in) :: text, key
      integer, intent(in) :: c
      real(wp), intent(in) :: weight(:)
      type(expression_type) :: expression
      real(wp), allocatable :: values(:)

      if (allocated(error) .or. text == '') return
      call expression_of(scene, text, expression)
      if (expression%in_time) then
        call add_part(load, key, c, expression, body%x(load%slots, :), weight)
      else
        call values_on(scene, text, body, load%slots, 'load', number, key, values, error)
        if (.not. allocated(error)) load%density(:, c) = load%density(:, c) + values*weight
      end if
    end subroutine add

  end subroutine load_by_expressions

  !> The volume of points, whose slots stand in the order of the points [m3].
  real(wp) function volume_of(body, slots) result(volume)
    type(body_type), intent(in) :: body     !! the points, arranged in slots
    integer(i4), intent(in) :: slots(:)     !! (any number) in the order of the points
    type(running_type) :: running
    real(wp) :: totals(6)
    integer :: i

    call new_running(running)
    do i = 1, size(slots)
      call add_point(body%order, body%point(slots(i)), [body%volume(slots(i))], running)
    end do
    totals = total_of_running(body%order, running)
    volume = totals(1)
  end function volume_of

  !> The outermost row of body points at a side: of one body, or of all whose face is the outermost.
  function outermost_row(scene, body, group) result(chosen)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    type(load_group), intent(in) :: group
    logical, allocatable :: chosen(:)
    real(wp), allocatable :: face(:)
    real(wp) :: direction, outermost, axes(3, 3)
    integer :: axis

    axis = index('xyz', group%side(1:1))
    direction = merge(-1.0_wp, 1.0_wp, group%side(3:5) == 'min')
    chosen = body%point > 0 .and. body%layer == 0
    if (group%body /= '') chosen = chosen .and. body%body == body_number(scene, group%body)
    ! a row's points reach half a spacing further out than their centres
    face = direction*body%x(:, axis) + body%spacing/2
    if (is_turned(side_body(scene, group%body))) then
      axes = axes_of(side_body(scene, group%body), body%dim)
      face = direction*matmul(body%x, axes(:body%dim, axis)) + body%spacing/2
    end if
    outermost = largest_of_ranks(body%order, maxval(face, mask=chosen))
    chosen = chosen .and. face > outermost - body%spacing/2
  end function outermost_row

  !> The body whose side a load means: the one it names, or the first. Where some are turned a scene
  !> of several bodies has names.
  pure type(body_group) function side_body(scene, name) result(group)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: name
    group = scene%bodies(max(1, body_number(scene, name)))
  end function side_body

  !> Number of a body by name.
  pure integer function body_number(scene, name) result(number)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: name
    do number = 1, size(scene%bodies)
      if (scene%bodies(number)%name == name) return
    end do
    number = 0
  end function body_number

end module pd_set_up_loads
