!> Warnings about conditions that vary in time: times after the end of a run, settings that
!> relaxation ignores, temperatures that strain nothing.
module pd_set_up_course_warnings
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type
  use pd_base_text, only: to_text, with_unit
  use pd_base_warnings, only: warnings_type
  use pd_motion_curve, only: curve_type
  use pd_set_up_plan, only: plan_type
  use pd_motion_loads, only: load_of, load_type, number_of_loads
  use pd_motion_system, only: system_type
  use pd_scene_content_rules, only: given
  use pd_scene_content_change, only: scan_scene
  use pd_scene_format_source, only: source_type
  use pd_scene_content_types, only: scene_type, is_set
  implicit none (type, external)
  private
  public :: warn_of_courses

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
    call warn_of_idle_heat(scene, warnings)

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
    integer :: i, c

    do i = 1, size(scene%boundaries)
      do c = 1, system%body%dim
        associate (velocity => scene%boundaries(i)%velocity(c))
          if (.not. is_set(velocity)) cycle
          if (abs(velocity) <= 0.0_wp) cycle
          way = velocity*system%motions(i)%curve%integral(1.0_wp)
          call warnings%add('velocity '//to_text(i)//directions(c:c), 'relaxation has no '// &
            & 'speeds: velocity_'//directions(c:c)//' of &boundary number '//to_text(i)// &
            & ' displaces its points by '//with_unit(way, 'm', 3)//' over the load steps, '// &
            & 'whose time runs from 0 to 1 s; displacement_'//directions(c:c)// &
            & ' gives this directly', tell=.false.)
        end associate
      end do
    end do
    if (any(abs(system%state%v) > 0.0_wp .and. system%held == 0)) call warnings%add( &
      & 'initial velocity', 'relaxation has no velocities: those of &initial have no effect', &
      & tell=.false.)
  end subroutine warn_of_velocities

  !> Bodies that are heated, but whose material says nothing of its expansion. Keys are looked for
  !> in the scene's text; a scene built in memory has none.
  subroutine warn_of_idle_heat(scene, warnings)
    type(scene_type), intent(in) :: scene
    type(warnings_type), intent(inout) :: warnings
    type(source_type) :: source
    type(error_type), allocatable :: ignored
    integer :: m

    if (.not. any((is_set(scene%initial%temperature_change) .and. &
      & abs(scene%initial%temperature_change) > 0.0_wp) .or. &
      & scene%initial%temperature_text /= '')) return
    if (.not. allocated(scene%text)) return
    if (len(scene%text) == 0) return
    call scan_scene(scene, source, ignored)
    if (allocated(ignored)) return
    do m = 1, size(scene%materials)
      if (given('material', m, 'thermal_expansion', source)) cycle
      call warnings%add('no expansion '//to_text(m), 'the temperature changes, but material '// &
        & trim(scene%materials(m)%name)//' has no thermal_expansion and does not expand', &
        & tell=.false.)
    end do
  end subroutine warn_of_idle_heat

end module pd_set_up_course_warnings
