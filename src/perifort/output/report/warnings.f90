!> Warnings before a run about input that is allowed but probably not intended: keys of the scene,
!> points, plan and conditions. Notes report correct, but possibly unexpected facts.
module pd_output_report_warnings
  use pd_base_kinds, only: wp
  use pd_base_text, only: counted, to_text, with_unit
  use pd_base_warnings, only: warnings_type
  use pd_scene_content_types, only: adds_layer, scene_type, is_set
  use pd_scene_content_warnings, only: warnings_of_scene
  use pd_body_body, only: body_type
  use pd_family_warnings, only: warn_of_points
  use pd_motion_conditions, only: free_component
  use pd_set_up_course_warnings, only: warn_of_courses
  use pd_body_regions, only: region_mask
  use pd_set_up_conditions, only: no_fail_mask
  use pd_set_up_plan, only: plan_type
  use pd_motion_system, only: system_type
  use pd_output_measures_measure, only: measure_list_type
  implicit none (type, external)
  private
  public :: warn_before, note_before

contains

  !> Add all warnings that are known before a run.
  subroutine warn_before(scene, system, plan, measures, isolated, warnings)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(plan_type), intent(in) :: plan
    type(measure_list_type), intent(in) :: measures  !! of the history
    integer, intent(in) :: isolated        !! points without a bond
    type(warnings_type), intent(inout) :: warnings
    integer :: i

    if (isolated > 0) call warnings%add('isolated', counted(isolated, 'point')// &
      & ' without a neighbour within the horizon: no bond holds them', tell=.false.)
    if (.not. plan%relaxes .and. plan%step > plan%limit) call warnings%add('step', &
      & 'the time step is above the stable one', tell=.false.)
    call warn_of_schedule(scene, plan, warnings)
    ! no rank sees all points: `check` on one rank looks for the rest
    if (associated(system%body%order%ranks)) return
    call warnings_of_scene(scene, edges_of(system%body), warnings)
    call warn_of_points(scene, system%body, system%family, warnings)
    call warn_of_courses(scene, system, plan, warnings)
    if (plan%lowest < 0.0_wp) call warnings%add('unstable body', &
      & 'the body is unstable before any load: its stiffness has an eigenvalue of '// &
      & to_text(plan%lowest, 2)//' of the largest one. With a strongly negative '// &
      & "poissons_ratio, surface_correction = '"//trim(scene%horizon%surface_correction)// &
      & "' makes the dilatation of corners too strong; with 'none' it is not", tell=.false.)
    do i = 1, size(scene%bodies)
      associate (body => system%body)
        if (any(body%body == i .and. body%layer == 0 .and. body%point > 0)) cycle
      end associate
      call warnings%add('empty body '//to_text(i), '&body number '//to_text(i)// &
        & ' holds no point: &remove cuts its shapes out of all bodies', tell=.false.)
    end do
    do i = 1, size(scene%regions)
      if (any(region_mask(scene, system%body, scene%regions(i)%name))) cycle
      call warnings%add('empty region '//to_text(i), 'the region '// &
        & trim(scene%regions(i)%name)//' holds no point', tell=.false.)
    end do
    do i = 1, size(scene%no_fail)
      if (any(no_fail_mask(scene, system%body, i))) cycle
      call warnings%add('empty no-fail zone '//to_text(i), '&no_fail number '//to_text(i)// &
        & ' holds no point', tell=.false.)
    end do
    call measures%warn(system, warnings)
  end subroutine warn_before

  !> Warn of outputs and rows of the history that lie beyond the end of the run.
  subroutine warn_of_schedule(scene, plan, warnings)
    type(scene_type), intent(in) :: scene
    type(plan_type), intent(in) :: plan
    type(warnings_type), intent(inout) :: warnings
    real(wp), parameter :: slack = 1.0e-9_wp  ! of rounding
    real(wp) :: finish

    associate (output => scene%output)
      finish = plan%steps*plan%step
      if (plan%relaxes) finish = 1.0_wp
      if (is_set(output%interval)) then
        if (output%interval > finish*(1 + slack)) call warnings%add('output interval', &
          & 'the &output interval of '//with_unit(output%interval, 's', 4)// &
          & ' is longer than the run ('//with_unit(finish, 's', 4)//consequence(), tell=.false.)
      else if (output%every > plan%steps) then
        call warnings%add('output every', '&output every = '//to_text(output%every)// &
          & ' is more than the run has steps ('//to_text(plan%steps)//consequence(), tell=.false.)
      end if
      ! iterations of a relaxation are not known before
      if (plan%relaxes .or. output%history_every <= plan%steps) return
      call warnings%add('history every', '&output history_every = '// &
        & to_text(output%history_every)//' is more than the run has steps ('// &
        & to_text(plan%steps)//'): the history has its first and its last row only', tell=.false.)
    end associate

  contains

    !> What such a run writes.
    pure function consequence() result(text)
      character(:), allocatable :: text
      text = '): only the first and the final state are written'
    end function consequence
  end subroutine warn_of_schedule

  !> Notes on a scene's conditions: a region held in all components is clamped.
  subroutine note_before(scene, system, notes)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(warnings_type), intent(inout) :: notes   !! added to
    character(:), allocatable :: held
    integer :: m

    if (system%body%dim == 1) return
    do m = 1, size(system%motions)
      associate (motion => system%motions(m))
        if (adds_layer(scene%boundaries(m)) .or. size(motion%slots) < 2) cycle
        if (motion%is_pin) cycle
        if (any(motion%kind(:system%body%dim) == free_component)) cycle
        held = "region '"//trim(scene%boundaries(m)%region)
        if (scene%boundaries(m)%side /= '') held = "facets '"//trim(scene%boundaries(m)%side)
        call notes%add('clamp '//to_text(m), '&boundary number '//to_text(m)//" holds all "// &
          & "components of the "//held//"': it cannot rotate there, as in a clamp", tell=.false.)
      end associate
    end do
  end subroutine note_before

  !> Edges of the box around the cells of all points of the bodies, layers aside (dim) [m].
  pure function edges_of(body) result(edges)
    type(body_type), intent(in) :: body
    real(wp) :: edges(body%dim)
    logical, allocatable :: mine(:)
    integer :: c

    mine = body%point > 0 .and. body%layer == 0
    do c = 1, body%dim
      edges(c) = maxval(body%x(:, c) + body%spacing/2, mask=mine) &
        & - minval(body%x(:, c) - body%spacing/2, mask=mine)
    end do
  end function edges_of

end module pd_output_report_warnings
