!> Imposed motion, heating and no-fail zones of a scene, on the slots that they hold.
module pd_set_up_conditions
  use pd_base_kinds, only: wp, i2, i4, i8
  use pd_base_error, only: error_type
  use pd_base_expression, only: constant_value, expression_type
  use pd_scene_content_expressions, only: expression_of, varies_in_time
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: scene_type, is_set
  use pd_scene_groups_course, only: ramp_of
  use pd_base_reduce, only: any_of_ranks, count_of_ranks
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type, owned
  use pd_body_meshes, only: facet_mask, names_set
  use pd_body_choice, only: values_on
  use pd_body_regions, only: in_shape, region_mask
  use pd_motion_conditions, only: motion_type, moved_by_displacement, moved_by_velocity, &
    & vary_in_time
  use pd_motion_curve, only: curve_type, constant_curve, ramp, table_curve
  use pd_motion_heating, only: heating_type, new_heating, new_timed_heat, timed_heat_type
  implicit none (type, external)
  private
  public :: motions_of_scene, heating_of_scene, no_fail_mask, in_no_fail_zones
  public :: course, no_points, slots_where

  character(*), parameter :: xyz = 'xyz'

contains

  !> Imposed motion of every `&boundary`: of its layer, of the body points in its region, or of
  !> those near facets of a mesh. An error is set if one holds no point.
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
        motion%is_pin = group%motion == 'pin'
        if (names_set(group%side)) then
          chosen = facet_mask(scene, body, group%side)
        else if (group%side /= '') then
          chosen = body%layer == m .and. body%point > 0
        else
          chosen = region_mask(scene, body, group%region) .and. body%layer == 0
        end if
        motion%slots = slots_where(body, chosen)
        if (.not. any_of_ranks(body%order, size(motion%slots) > 0)) then
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
        do c = 1, body%dim
          call move_by_expression(scene, body, m, c, group%velocity_text(c), 'velocity', &
            & moved_by_velocity, motion, error)
          if (.not. allocated(error)) call move_by_expression(scene, body, m, c, &
            & group%displacement_text(c), 'displacement', moved_by_displacement, motion, error)
          if (allocated(error)) return
        end do
        motion%curve = course(scene, group%ramp_time, group%times, group%values, &
          & any(motion%by_time))
      end associate
    end do
    call check_pins_apart(scene, body, motions, error)
  end subroutine motions_of_scene

  !> An error if another boundary holds a point of a pin, or a pin's points are at one place.
  subroutine check_pins_apart(scene, body, motions, error)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    type(motion_type), intent(in) :: motions(:)  !! in the order of the groups
    type(error_type), allocatable, intent(out) :: error
    logical, allocatable :: of_pin(:)
    integer :: m, other

    if (.not. any(motions%is_pin)) return
    allocate (of_pin(body%n_slots))
    do m = 1, size(motions)
      if (.not. motions(m)%is_pin) cycle
      if (body%dim > 1 .and. count_of_ranks(body%order, count(owned(body, &
        & int(motions(m)%slots)), kind=i8)) == 1_i8) then
        call scene_fault(error, scene, 'boundary', m, 'motion', 'a pin of one point', &
          & 'a single point has no rotation: leave out motion, or take a region with more points')
        return
      end if
      of_pin = .false.
      of_pin(motions(m)%slots) = .true.
      do other = 1, size(motions)
        if (other == m .or. scene%boundaries(other)%absorbing) cycle
        if (.not. any(of_pin(motions(other)%slots))) cycle
        call scene_fault(error, scene, 'boundary', max(m, other), 'motion', &
          & '&boundary number '//to_text(min(m, other))//' and number '//to_text(max(m, other))// &
          & ' share points, and one of them is a pin', &
          & 'the points of a pin move as one rigid body: part the regions')
        return
      end do
    end do
  end subroutine check_pins_apart

  !> A component of an imposed motion that is given by an expression. What has no t is an amplitude,
  !> of each point if it has x, y or z. An error is set if a value is not finite.
  subroutine move_by_expression(scene, body, number, c, text, key, kind, motion, error)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    integer, intent(in) :: number               !! of the `&boundary`
    integer, intent(in) :: c                    !! component
    character(*), intent(in) :: text, key
    integer, intent(in) :: kind
    type(motion_type), intent(inout) :: motion  !! with its slots
    type(error_type), allocatable, intent(out) :: error
    type(expression_type) :: expression
    real(wp), allocatable :: values(:)
    integer :: i

    if (text == '') return
    motion%kind(c) = kind
    call expression_of(scene, text, expression)
    if (expression%in_time) then
      if (motion%is_pin) then
        ! the same at every place, also where a rank has none of its points
        call vary_in_time(motion, c, expression, reshape([real(wp) ::], [1, body%dim], [0.0_wp]))
      else
        call vary_in_time(motion, c, expression, body%x(motion%slots, :))
      end if
      return
    end if
    call values_on(scene, text, body, motion%slots, 'boundary', number, key//'_'//xyz(c:c), &
      & values, error)
    if (allocated(error)) return
    if (.not. expression%in_space) then
      motion%amplitude(c) = constant_value(expression)
      if (allocated(motion%profile)) motion%profile(:, c) = motion%amplitude(c)
      return
    end if
    if (.not. allocated(motion%profile)) then
      allocate (motion%profile(size(motion%slots), body%dim))
      do i = 1, body%dim
        motion%profile(:, i) = motion%amplitude(i)
      end do
    end if
    motion%profile(:, c) = values
  end subroutine move_by_expression

  !> Courses of the temperature changes of every `&initial`.
  subroutine heating_of_scene(scene, body, heated_by, expansion, heating)
    type(scene_type), intent(in) :: scene       !! a checked scene
    type(body_type), intent(in) :: body         !! its points
    integer(i2), intent(in) :: heated_by(:)     !! number of the group that heats each slot, or 0
    real(wp), intent(in) :: expansion(:)        !! alpha dT of each slot at factor 1 [-]
    type(heating_type), intent(out) :: heating  !! empty if the temperature is constant in time
    type(curve_type), allocatable :: curves(:)
    type(timed_heat_type), allocatable :: timed(:)
    type(expression_type) :: expression
    integer(i4), allocatable :: slots(:)
    integer :: i

    allocate (curves(size(scene%initial)), timed(size(scene%initial)))
    do i = 1, size(curves)
      associate (group => scene%initial(i))
        curves(i) = course(scene, group%ramp_time, group%times, group%values, &
          & varies_in_time(scene, group%temperature_text))
        if (.not. varies_in_time(scene, group%temperature_text)) cycle
        call expression_of(scene, group%temperature_text, expression)
        slots = slots_where(body, heated_by == i)
        call new_timed_heat(expression, slots, body%x(slots, :), timed(i))
      end associate
    end do
    if (any(timed%is_there)) then
      call new_heating(body%order, expansion, heated_by, curves, heating, timed)
    else
      call new_heating(body%order, expansion, heated_by, curves, heating)
    end if
  end subroutine heating_of_scene

  !> Slots in no-fail zone `number` of a scene.
  function no_fail_mask(scene, body, number) result(mask)
    type(scene_type), intent(in) :: scene  !! a checked scene
    type(body_type), intent(in) :: body    !! its points, layers included, arranged in slots
    integer, intent(in) :: number          !! of the `&no_fail` group
    logical, allocatable :: mask(:)

    if (scene%no_fail(number)%region /= '') then
      mask = region_mask(scene, body, scene%no_fail(number)%region)
    else
      mask = in_shape(scene, body, scene%no_fail(number))
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

  !> How a condition varies in time.
  function course(scene, ramp_time, times, values, timed) result(curve)
    type(scene_type), intent(in) :: scene                     !! whether it relaxes
    real(wp), intent(in) :: ramp_time                         !! of the group, or unset [s]
    real(wp), allocatable, intent(in) :: times(:), values(:)  !! of the group, if given [s], [-]
    logical, intent(in) :: timed  !! an expression of t is the course
    type(curve_type) :: curve
    real(wp) :: length
    logical :: tabulated

    curve = constant_curve()
    if (timed) return
    tabulated = allocated(times)
    if (tabulated) tabulated = size(times) > 0
    if (tabulated) then
      curve = table_curve(times, values)
    else
      length = ramp_of(scene%time%method, ramp_time)
      if (is_set(length)) curve = ramp(length)
    end if
  end function course

  !> The marked slots in point order, so that sums over them don't depend on the family.
  pure function slots_where(body, chosen) result(slots)
    type(body_type), intent(in) :: body   !! its points in their slots
    logical, intent(in) :: chosen(:)      !! (n_slots) marks
    integer(i4), allocatable :: slots(:)
    slots = pack(body%slot, chosen(body%slot))
  end function slots_where

  !> What is wrong with a group that holds no point.
  pure function no_points(group, name, region) result(message)
    character(*), intent(in) :: group    !! its name with `&`
    character(*), intent(in) :: name     !! that it has, or ''
    character(*), intent(in) :: region   !! that it names, or ''
    character(:), allocatable :: message
    message = group
    if (name /= '') message = message//" '"//trim(name)//"'"
    message = message//' holds no point'
    if (region /= '') message = message//": the region '"//trim(region)//"' is empty"
  end function no_points

end module pd_set_up_conditions
