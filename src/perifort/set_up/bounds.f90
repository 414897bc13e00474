!> Conditions that no computation follows, found before the first step: displacements of millions of
!> horizons, points that cross their horizon in a step, bodies that double their length by heat.
!>
!> These are slips of units or signs. Within these bounds the powers of a strain that the force
!> loops form stay finite.
module pd_set_up_bounds
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type
  use pd_base_text, only: to_text, with_unit
  use pd_motion_heating, only: largest_expansion
  use pd_set_up_plan, only: plan_type
  use pd_motion_system, only: system_type
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: scene_type, is_set
  implicit none (type, external)
  private
  public :: check_bounds

  real(wp), parameter :: most_horizons = 1.0e6_wp  !! between displacements of one body
  real(wp), parameter :: most_expansion = 1.0_wp   !! thermal strain [-]
  character(*), parameter :: xyz = 'xyz'

contains

  !> An error, at the group that is to blame, if a condition of the scene is beyond the bounds.
  !> `system` is ready at t = 0.
  subroutine check_bounds(scene, system, plan, error)
    type(scene_type), intent(in) :: scene    !! a checked scene
    type(system_type), intent(in) :: system  !! made from it, at t = 0
    type(plan_type), intent(in) :: plan      !! of its run
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: delta, factor, largest
    integer :: i, c

    delta = system%family%rule%delta
    do i = 1, size(scene%boundaries)
      associate (group => scene%boundaries(i))
        factor = 1.0_wp
        if (allocated(group%values)) factor = maxval(abs(group%values))
        do c = 1, system%body%dim
          if (is_set(group%displacement(c))) then
            if (abs(group%displacement(c))*factor > most_horizons*delta) call far('boundary', i, &
              & 'displacement_'//xyz(c:c), abs(group%displacement(c))*factor)
          else if (is_set(group%velocity(c)) .and. .not. plan%relaxes) then
            if (abs(group%velocity(c))*factor*plan%step > delta) call fast('boundary', i, &
              & 'velocity_'//xyz(c:c), abs(group%velocity(c))*factor)
          end if
          if (allocated(error)) return
        end do
      end associate
    end do
    if (size(scene%initial) == 0) return
    i = size(scene%initial)
    do c = 1, system%body%dim
      associate (u => system%state%u(:, c), v => system%state%v(:, c))
        if (maxval(u) - minval(u) > most_horizons*delta) then
          call far('initial', i, '', maxval(u) - minval(u))
        else if (maxval(abs(v))*plan%step > delta .and. .not. plan%relaxes) then
          call fast('initial', i, '', maxval(abs(v)))
        end if
      end associate
      if (allocated(error)) return
    end do
    if (.not. system%model%thermal) return
    largest = largest_expansion(system%heating, system%model%expansion)
    if (largest > most_expansion) call scene_fault(error, scene, 'initial', i, &
      & 'temperature_change', 'the temperature strains the body by '//to_text(largest, 3), &
      & 'thermal_expansion times temperature_change may be '//to_text(most_expansion))

  contains

    subroutine far(group, number, key, distance)
      character(*), intent(in) :: group, key
      integer, intent(in) :: number
      real(wp), intent(in) :: distance
      call scene_fault(error, scene, group, number, key, 'a displacement of '// &
        & with_unit(distance, 'm')//', more than a million horizons', 'the horizon is '// &
        & with_unit(delta, 'm')//'; displacements are in m')
    end subroutine far

    subroutine fast(group, number, key, speed)
      character(*), intent(in) :: group, key
      integer, intent(in) :: number
      real(wp), intent(in) :: speed
      call scene_fault(error, scene, group, number, key, 'a velocity of '// &
        & with_unit(speed, 'm/s')//', by which a point crosses its horizon in a step', &
        & 'the horizon is '//with_unit(delta, 'm')//', the step '//with_unit(plan%step, 's'))
    end subroutine fast

  end subroutine check_bounds

end module pd_set_up_bounds
