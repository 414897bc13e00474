!> What points and plan of a scene show to be allowed, but hardly meant.
module pd_output_doubts
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text, with_unit
  use pd_base_warnings, only: warnings_type
  use pd_scene_doubts, only: doubts_of_scene
  use pd_scene_types, only: scene_type
  use pd_motion_course_warnings, only: warn_of_courses
  use pd_motion_from_scene, only: region_mask
  use pd_motion_plan, only: plan_type
  use pd_motion_system, only: system_type
  use pd_output_recorder, only: probe_type
  implicit none (type, external)
  private
  public :: warn_before

contains

  !> Warn of what is allowed, but hardly meant.
  subroutine warn_before(scene, system, plan, probes, lonely, warnings)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(plan_type), intent(in) :: plan
    type(probe_type), intent(in) :: probes(:)
    integer, intent(in) :: lonely          !! points without a bond
    type(warnings_type), intent(inout) :: warnings
    real(wp) :: distance
    integer :: i, k

    call doubts_of_scene(scene, warnings)
    call warn_of_courses(scene, system, plan, warnings)
    if (lonely > 0) call warnings%add('lonely', to_text(lonely)// &
      & ' points have no neighbour: nothing pulls at them', tell=.false.)
    if (.not. plan%relaxes .and. plan%step > plan%limit) call warnings%add('step', &
      & 'the time step is above the stable one', tell=.false.)
    if (plan%lowest < 0.0_wp) call warnings%add('unstable body', &
      & 'the body is unstable before any load: its stiffness has an eigenvalue of '// &
      & to_text(plan%lowest, 2)//' of the largest one. With a strongly negative '// &
      & "poissons_ratio, surface_correction = '"//trim(scene%horizon%surface_correction)// &
      & "' makes the dilatation of corners too strong; with 'none' it is not", tell=.false.)
    do i = 1, size(scene%regions)
      if (any(region_mask(scene, system%body, scene%regions(i)%name))) cycle
      call warnings%add('empty region '//to_text(i), 'the region '// &
        & trim(scene%regions(i)%name)//' holds no point', tell=.false.)
    end do
    do i = 1, size(probes)
      k = int(probes(i)%slot)
      distance = norm2(system%body%x(k, :) - scene%probes(i)%point(:system%body%dim))
      if (distance > system%body%spacing(k)) call warnings%add('probe '//to_text(i), 'probe '// &
        & probes(i)%name//' lies outside the bodies: the nearest point is '// &
        & with_unit(distance, 'm', 3)//' away', tell=.false.)
    end do
  end subroutine warn_before

end module pd_output_doubts
