!> Warnings about conditions that vary in time: times after the end of a run, settings that
!> relaxation ignores, temperatures that strain nothing.
module pd_set_up_course_warnings
  use pd_base_kinds, only: wp, i1
  use pd_base_error, only: error_type
  use pd_base_reduce, only: any_of_ranks
  use pd_base_text, only: to_text, with_unit
  use pd_base_warnings, only: warnings_type
  use pd_body_body, only: body_type
  use pd_motion_conditions, only: guide, impose, moved_by_velocity
  use pd_motion_curve, only: curve_type
  use pd_set_up_plan, only: plan_type
  use pd_motion_loads, only: load_of, load_type, number_of_loads
  use pd_motion_system, only: system_type
  use pd_scene_content_rules, only: given
  use pd_scene_content_change, only: scan_scene
  use pd_scene_format_source, only: source_type
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: warn_of_courses, warn_of_idle_heat

  character(*), parameter :: directions = 'xyz'

contains

  !> Add warnings about the conditions of a scene; `system` is ready at t = 0.
  subroutine warn_of_courses(scene, system, plan, warnings)
    type(scene_type), intent(in) :: scene            !! a checked scene
    type(system_type), intent(in), target :: system  !! made from it
    type(plan_type), intent(in) :: plan              !! method, step and number of steps
    type(warnings_type), intent(inout) :: warnings   !! what is added to
    type(load_type), pointer :: load
    integer :: i

    if (plan%relaxes) then
      call warn_of_velocities(scene, system, warnings)
    else
      do i = 1, size(system%motions)
        call warn_of_end('boundary', i, system%motions(i)%curve)
      end do
      do i = 1, number_of_loads(system%terms)
        load => load_of(system%terms, i)
        call warn_of_end('load', i, load%curve)
      end do
      if (allocated(system%heating%curves)) then
        do i = 1, size(system%heating%curves)
          call warn_of_end('initial', i, system%heating%curves(i))
        end do
      end if
    end if

  contains

    !> A warning if a run ends before a course does.
    subroutine warn_of_end(group, number, curve)
      character(*), intent(in) :: group
      integer, intent(in) :: number
      type(curve_type), intent(in) :: curve
      real(wp) :: duration, last

      duration = plan%step*plan%steps
      last = curve%times(size(curve%times))
      if (last <= duration*(1 + 1.0e-9_wp) .or. size(curve%times) < 2) return
      call warnings%add('course '//group//' '//to_text(number), 'the run ends at '// &
        & with_unit(duration, 's', 3)//', before the course of &'//group//' number '// &
        & to_text(number)//' does at '//with_unit(last, 's', 3)//': its factor is then '// &
        & to_text(curve%value(duration), 3), tell=.false.)
    end subroutine warn_of_end

  end subroutine warn_of_courses

  !> Relaxation seeks static equilibrium, in which nothing has a speed.
  subroutine warn_of_velocities(scene, system, warnings)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(warnings_type), intent(inout) :: warnings
    real(wp) :: way
    character(:), allocatable :: most
    integer :: i, c

    do i = 1, size(scene%boundaries)
      do c = 1, system%body%dim
        if (system%motions(i)%kind(c) /= moved_by_velocity) cycle
        call way_of(system, i, c, way, most)
        if (abs(way) <= 0.0_wp .and. .not. system%motions(i)%by_time(c)) cycle
        call warnings%add('velocity '//to_text(i)//directions(c:c), 'relaxation has no '// &
          & 'speeds: velocity_'//directions(c:c)//' of &boundary number '//to_text(i)// &
          & ' displaces its points by '//most//with_unit(way, 'm', 3)//' over the load steps, '// &
          & 'whose time runs from 0 to 1 s; displacement_'//directions(c:c)// &
          & ' gives this directly', tell=.false.)
      end do
    end do
    if (any(abs(system%state%v) > 0.0_wp .and. system%held == 0)) call warnings%add( &
      & 'initial velocity', 'relaxation has no velocities: those of &initial have no effect', &
      & tell=.false.)
  end subroutine warn_of_velocities

  !> How far an imposed velocity moves its points from time 0 to 1: the largest way, and 'up to '
  !> where points differ.
  subroutine way_of(system, number, c, way, most)
    type(system_type), intent(in) :: system
    integer, intent(in) :: number   !! of the motion
    integer, intent(in) :: c        !! component
    real(wp), intent(out) :: way    !! [m]
    character(:), allocatable, intent(out) :: most
    real(wp), allocatable :: u(:, :), ways(:)
    real(wp) :: place(3), velocity(3)

    most = ''
    associate (motion => system%motions(number))
      if (allocated(motion%pose)) then
        call guide(motion, 1.0_wp, place, velocity)
        way = place(c) - motion%start(1, c)
        return
      end if
      u = system%state%u
      call impose(system%motions(number:number), 1.0_wp, u)
      ways = pack(u(motion%slots, c) - motion%start(:, c), motion%held(:, c) == 1_i1)
    end associate
    way = 0.0_wp
    if (size(ways) == 0) return
    way = ways(maxloc(abs(ways), dim=1))
    if (maxval(ways) - minval(ways) > 1.0e-12_wp*abs(way)) most = 'up to '
  end subroutine way_of

  !> A warning for each material of heated points that says nothing of its expansion. Keys are
  !> looked for in the scene's text; a scene built in memory has none. All ranks call it together.
  subroutine warn_of_idle_heat(scene, body, temperature_change, warnings)
    type(scene_type), intent(in) :: scene            !! a checked scene
    type(body_type), intent(in) :: body              !! its points, arranged in slots
    real(wp), intent(in) :: temperature_change(:)
      !! (n_slots), from numbers, expressions and files alike; 1 K where it depends on t [K]
    type(warnings_type), intent(inout) :: warnings   !! added to
    type(source_type) :: source
    type(error_type), allocatable :: ignored
    character(:), allocatable :: name
    integer :: m

    if (.not. allocated(scene%text)) return
    if (len(scene%text) == 0) return
    call scan_scene(scene, source, ignored)
    if (allocated(ignored)) return
    do m = 1, size(scene%materials)
      if (given('material', m, 'thermal_expansion', source)) cycle
      if (.not. any_of_ranks(body%order, any(body%material == m .and. body%point > 0 .and. &
        & abs(temperature_change) > 0.0_wp))) cycle
      name = 'number '//to_text(m)
      if (scene%materials(m)%name /= '') name = "'"//trim(scene%materials(m)%name)//"'"
      call warnings%add('no expansion '//to_text(m), 'the temperature changes, but material '// &
        & name//' has no thermal_expansion and does not expand', tell=.false.)
    end do
  end subroutine warn_of_idle_heat

end module pd_set_up_course_warnings
