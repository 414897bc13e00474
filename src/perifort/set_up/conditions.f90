!> Boundary conditions and loads of a scene, on the slots they hold.
module pd_set_up_conditions
  use pd_base_kinds, only: wp, i2, i4
  use pd_base_error, only: error_type
  use pd_base_reduce, only: add_point, new_running, running_type, total_of_running
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: scene_type, load_group, is_set
  use pd_scene_groups_course, only: ramp_of
  use pd_body_body, only: body_type
  use pd_body_generate, only: touch
  use pd_body_shapes, only: inside
  use pd_motion_conditions, only: motion_type, load_type, moved_by_displacement, moved_by_velocity
  use pd_motion_curve, only: curve_type, constant_curve, ramp, table_curve
  use pd_motion_heating, only: heating_type, new_heating
  implicit none (type, external)
  private
  public :: volume_of, motions_of_scene, loads_of_scene, heating_of_scene, region_mask, no_fail_mask, &
    & in_no_fail_zones

contains

  !> Imposed motion of every `&boundary`: of its layer, or of the body points in its region. An
  !> error is set if one holds no point.
  subroutine motions_of_scene(scene, body, motions, error)
    type(scene_type), intent(in) :: scene                      !! a checked scene
    type(body_type), intent(in) :: body                        !! its points, arranged in slots
    type(motion_type), allocatable, intent(out) :: motions(:)
      !! (boundaries) in the order of the groups
    type(error_type), allocatable, intent(out) :: error
    logical, allocatable :: chosen(:)
    integer :: m, c

    allocate (motions(size(scene%boundaries)))
    do m = 1, size(motions)
      associate (group => scene%boundaries(m), motion => motions(m))
        motion%name = trim(group%name)
        if (group%side /= '') then
          chosen = body%layer == m .and. body%point > 0
        else
          chosen = region_mask(scene, body, group%region) .and. body%layer == 0
        end if
        motion%slots = slots_where(body, chosen)
        if (size(motion%slots) == 0) then
          call scene_fault(error, scene, 'boundary', m, 'region', no_points('&boundary', &
            & group%name, group%region), 'expected a shape that holds points of the bodies')
          return
        end if
        do c = 1, 3
          if (is_set(group%velocity(c))) then
            motion%kind(c) = moved_by_velocity
            motion%amplitude(c) = group%velocity(c)
          end if
          if (is_set(group%displacement(c))) then
            motion%kind(c) = moved_by_displacement
            motion%amplitude(c) = group%displacement(c)
          end if
        end do
        motion%curve = course(scene, group%ramp_time, group%times, group%values)
      end associate
    end do
  end subroutine motions_of_scene

  !> Force densities of every `&load`: pressure, total force and body force of a group add up. An
  !> error is set if one holds no point.
  subroutine loads_of_scene(scene, body, loads, error)
    type(scene_type), intent(in) :: scene                  !! a checked scene
    type(body_type), intent(in) :: body                    !! its points, arranged in slots
    type(load_type), allocatable, intent(out) :: loads(:)  !! (loads) in the order of the groups
    type(error_type), allocatable, intent(out) :: error
    logical, allocatable :: chosen(:)
    real(wp) :: outward
    integer :: l, c, axis

    allocate (loads(size(scene%loads)))
    do l = 1, size(loads)
      associate (group => scene%loads(l), load => loads(l))
        if (group%side /= '') then
          chosen = outermost_row(scene, body, group)
        else if (group%region /= '') then
          chosen = region_mask(scene, body, group%region) .and. body%layer == 0
        else
          chosen = body%point > 0 .and. body%layer == 0
        end if
        if (group%body /= '') chosen = chosen .and. body%body == body_number(scene, group%body)
        load%slots = slots_where(body, chosen)
        if (size(load%slots) == 0) then
          call scene_fault(error, scene, 'load', l, 'region', no_points('&load', group%body, &
            & group%region), 'expected a place that holds points of the bodies')
          return
        end if
        allocate (load%density(size(load%slots), body%dim), source=0.0_wp)
        do c = 1, body%dim
          if (is_set(group%body_force(c))) load%density(:, c) = group%body_force(c)
          if (is_set(group%force(c))) load%density(:, c) = load%density(:, c) &
            & + group%force(c)/volume_of(body, load%slots)
        end do
        if (is_set(group%pressure)) then
          axis = index('xyz', group%side(1:1))
          outward = merge(-1.0_wp, 1.0_wp, group%side(3:5) == 'min')
          load%density(:, axis) = load%density(:, axis) &
            & - group%pressure*outward/body%spacing(load%slots)
        end if
        load%curve = course(scene, group%ramp_time, group%times, group%values)
      end associate
    end do
  end subroutine loads_of_scene

  !> The volume of points, whose slots stand in the order of the points [m3].
  real(wp) function volume_of(body, slots) result(volume)
    type(body_type), intent(in) :: body     !! the points, arranged in slots
    integer(i4), intent(in) :: slots(:)     !! (any number) in the order of the points
    type(running_type) :: running
    real(wp) :: totals(6)
    integer :: i

    call new_running(body%order, running)
    do i = 1, size(slots)
      call add_point(body%order, body%point(slots(i)), [body%volume(slots(i))], running)
    end do
    totals = total_of_running(body%order, running)
    volume = totals(1)
  end function volume_of

  !> Courses of the temperature changes of every `&initial`.
  subroutine heating_of_scene(scene, heated_by, expansion, heating)
    type(scene_type), intent(in) :: scene       !! a checked scene
    integer(i2), intent(in) :: heated_by(:)     !! number of the group that heats each slot, or 0
    real(wp), intent(in) :: expansion(:)        !! alpha dT of each slot at factor 1 [-]
    type(heating_type), intent(out) :: heating  !! empty if the temperature is constant in time
    type(curve_type), allocatable :: curves(:)
    integer :: i

    allocate (curves(size(scene%initial)))
    do i = 1, size(curves)
      associate (group => scene%initial(i))
        curves(i) = course(scene, group%ramp_time, group%times, group%values)
      end associate
    end do
    call new_heating(expansion, heated_by, curves, heating)
  end subroutine heating_of_scene

  !> Slots in the region of this name.
  function region_mask(scene, body, name) result(mask)
    type(scene_type), intent(in) :: scene  !! a checked scene
    type(body_type), intent(in) :: body    !! its points, layers included, arranged in slots
    character(*), intent(in) :: name       !! of a `&region`; no slot is in one that is not there
    logical, allocatable :: mask(:)
    integer :: r

    allocate (mask(body%n_slots), source=.false.)
    do r = 1, size(scene%regions)
      if (scene%regions(r)%name /= name) cycle
      mask = inside(scene%regions(r), body%x, touch*minval(body%spacing, mask=body%point > 0)) &
        & .and. body%point > 0
    end do
  end function region_mask

  !> Slots in no-fail zone `number` of a scene.
  function no_fail_mask(scene, body, number) result(mask)
    type(scene_type), intent(in) :: scene  !! a checked scene
    type(body_type), intent(in) :: body    !! its points, layers included, arranged in slots
    integer, intent(in) :: number          !! of the `&no_fail` group
    logical, allocatable :: mask(:)

    if (scene%no_fail(number)%region /= '') then
      mask = region_mask(scene, body, scene%no_fail(number)%region)
    else
      mask = inside(scene%no_fail(number), body%x, &
        & touch*minval(body%spacing, mask=body%point > 0)) .and. body%point > 0
    end if
  end function no_fail_mask

  !> Slots in any no-fail zone of a scene.
  function in_no_fail_zones(scene, body) result(mask)
    type(scene_type), intent(in) :: scene  !! a checked scene
    type(body_type), intent(in) :: body    !! its points, layers included, arranged in slots
    logical, allocatable :: mask(:)
    integer :: i

    allocate (mask(body%n_slots), source=.false.)
    do i = 1, size(scene%no_fail)
      mask = mask .or. no_fail_mask(scene, body, i)
    end do
  end function in_no_fail_zones

  !> The outermost row of body points at a side: of one body, or of all whose face is the outermost.
  function outermost_row(scene, body, group) result(chosen)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    type(load_group), intent(in) :: group
    logical, allocatable :: chosen(:)
    real(wp), allocatable :: face(:)
    real(wp) :: direction, outermost
    integer :: axis

    axis = index('xyz', group%side(1:1))
    direction = merge(-1.0_wp, 1.0_wp, group%side(3:5) == 'min')
    chosen = body%point > 0 .and. body%layer == 0
    if (group%body /= '') chosen = chosen .and. body%body == body_number(scene, group%body)
    ! a row's points reach half a spacing further out than their centres
    face = direction*body%x(:, axis) + body%spacing/2
    outermost = maxval(face, mask=chosen)
    chosen = chosen .and. face > outermost - body%spacing/2
  end function outermost_row

  !> Number of a body by name.
  pure integer function body_number(scene, name) result(number)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: name
    do number = 1, size(scene%bodies)
      if (scene%bodies(number)%name == name) return
    end do
    number = 0
  end function body_number

  !> How a condition varies in time.
  function course(scene, ramp_time, times, values) result(curve)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: ramp_time
    real(wp), allocatable, intent(in) :: times(:), values(:)
    type(curve_type) :: curve
    real(wp) :: length
    logical :: tabulated

    tabulated = allocated(times)
    if (tabulated) tabulated = size(times) > 0
    if (tabulated) then
      curve = table_curve(times, values)
    else
      length = ramp_of(scene%time%method, ramp_time)
      curve = constant_curve()
      if (is_set(length)) curve = ramp(length)
    end if
  end function course

  !> The marked slots in point order, so that sums over them don't depend on the family.
  pure function slots_where(body, chosen) result(slots)
    type(body_type), intent(in) :: body
    logical, intent(in) :: chosen(:)
    integer(i4), allocatable :: slots(:)
    slots = pack(body%slot, chosen(body%slot))
  end function slots_where

  pure function no_points(group, name, region) result(message)
    character(*), intent(in) :: group, name, region
    character(:), allocatable :: message
    message = group
    if (name /= '') message = message//" '"//trim(name)//"'"
    message = message//' holds no point'
    if (region /= '') message = message//": the region '"//trim(region)//"' is empty"
  end function no_points

end module pd_set_up_conditions
