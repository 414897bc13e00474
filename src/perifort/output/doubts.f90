!> What points and plan of a scene show to be allowed, but hardly meant.
module pd_output_doubts
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text, with_unit
  use pd_base_warnings, only: warnings_type
  use pd_scene_doubts, only: doubts_of_scene
  use pd_scene_types, only: scene_type
  use pd_motion_course_warnings, only: warn_of_courses
  use pd_family_joints, only: joint_type, count_joints
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
    call warn_of_joints(scene, system, warnings)
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

  !> Warn of bodies that are bonded because points of both lie within one horizon: the first few
  !> pairs one by one.
  subroutine warn_of_joints(scene, system, warnings)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(warnings_type), intent(inout) :: warnings
    integer, parameter :: most = 10  ! pairs told one by one
    type(joint_type), allocatable :: joints(:)
    integer :: i

    call count_joints(system%body, system%family, joints)
    do i = 1, min(most, size(joints))
      call warnings%add('joint '//to_text(i), to_text(joints(i)%bonds)//' bonds join '// &
        & name(joints(i)%bodies(1))//' and '//name(joints(i)%bodies(2))//', whose points lie '// &
        & 'within a horizon of each other: they act as one; a &crack between them parts them', &
        & tell=.false.)
    end do
    if (size(joints) > most) call warnings%add('joints', to_text(sum(joints(most + 1:)%bonds))// &
      & ' bonds join '//to_text(size(joints) - most)//' more pairs of bodies', tell=.false.)

  contains

    !> A body's number, and its name if it has one.
    pure function name(b) result(text)
      integer, intent(in) :: b
      character(:), allocatable :: text
      text = 'body '//to_text(b)
      if (scene%bodies(b)%name /= '') text = text//" '"//trim(scene%bodies(b)%name)//"'"
    end function name
  end subroutine warn_of_joints

end module pd_output_doubts
