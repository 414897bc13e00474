!> Warnings before a run about input that is allowed but probably not intended: keys of the scene,
!> points, plan and conditions. Notes report correct, but possibly unexpected facts.
module pd_output_report_warnings
  use pd_base_kinds, only: wp, i1
  use pd_base_text, only: counted, to_text, with_unit
  use pd_base_warnings, only: warnings_type
  use pd_scene_content_types, only: adds_layer, scene_type, is_set
  use pd_scene_content_warnings, only: warnings_of_scene
  use pd_body_body, only: body_type
  use pd_family_warnings, only: warn_of_points
  use pd_set_up_course_warnings, only: warn_of_courses
  use pd_set_up_strain_warnings, only: warn_of_strains
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
    call warn_of_strains(scene, system, plan, edges_of(system%body), warnings)
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

  !> Notes on a scene's conditions: points that one group or several together hold in all
  !> components are clamped, if they cannot turn: more than a point of a body in 2D, and more than a
  !> line of points in 3D.
  subroutine note_before(scene, system, notes)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(warnings_type), intent(inout) :: notes   !! added to
    character(:), allocatable :: held
    integer, allocatable :: holder(:, :)
    logical, allocatable :: to_see(:), alike(:)
    integer :: c, d, i, k, n, dim
    logical :: clamped

    dim = system%body%dim
    if (dim == 1) return
    ! pins move as they turn; the points of layers lie outside of the bodies
    allocate (holder(system%body%n_slots, dim), source=0)
    do i = 1, size(system%motions)
      associate (motion => system%motions(i))
        if (motion%is_pin .or. adds_layer(scene%boundaries(i))) cycle
        do c = 1, dim
          where (motion%held(:, c) == 1_i1) holder(motion%slots, c) = i
        end do
      end associate
    end do
    to_see = all(holder > 0, dim=2) .and. system%body%point > 0
    do n = 1, system%body%n_points
      k = system%body%slot(n)
      if (.not. to_see(k)) cycle
      alike = to_see
      do c = 1, dim
        alike = alike .and. holder(:, c) == holder(k, c)
      end do
      to_see = to_see .and. .not. alike
      clamped = .false.
      do i = 1, size(scene%bodies)
        if (cannot_turn(system%body, alike .and. system%body%body == i)) clamped = .true.
      end do
      if (.not. clamped) cycle
      i = holder(k, 1)
      if (all(holder(k, :) == i)) then
        held = "region '"//trim(scene%boundaries(i)%region)
        if (scene%boundaries(i)%side /= '') held = "facets '"//trim(scene%boundaries(i)%side)
        held = '&boundary number '//to_text(i)//' holds all components of the '//held//"'"
      else
        held = ''
        do d = 1, size(scene%boundaries)
          if (.not. any(holder(k, :) == d)) cycle
          if (held /= '') held = held//' and '
          held = held//'number '//to_text(d)
        end do
        held = '&boundary '//held//' together hold all components of '//counted(count(alike), &
          & 'point')
      end if
      call notes%add('clamp '//held, held//': it cannot rotate there, as in a clamp', tell=.false.)
    end do
  end subroutine note_before

  !> Whether held points keep a body from rotating: two of them in 2D, three that are not on one
  !> line in 3D.
  pure logical function cannot_turn(body, held)
    type(body_type), intent(in) :: body
    logical, intent(in) :: held(:)       !! (n_slots) marks
    real(wp), parameter :: apart = 1.0e-6_wp  ! of a spacing, or of an angle
    real(wp) :: along(body%dim), r(body%dim), across(body%dim)
    integer :: first, k
    logical :: there

    cannot_turn = .false.
    there = .false.
    first = findloc(held, .true., dim=1)
    if (first == 0) return
    along = 0.0_wp
    do k = first + 1, size(held)
      if (.not. held(k)) cycle
      r = body%x(k, :) - body%x(first, :)
      if (norm2(r) <= apart*body%spacing(first)) cycle
      if (.not. there) along = r/norm2(r)
      there = .true.
      across = r - dot_product(r, along)*along
      cannot_turn = body%dim == 2 .or. norm2(across) > apart*norm2(r)
      if (cannot_turn) return
    end do
  end function cannot_turn

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
