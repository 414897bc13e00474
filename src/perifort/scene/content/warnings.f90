!> Warnings about input that is allowed but probably not intended: unused materials, keys without
!> effect, and numbers that look like those of other units (`pd_scene_content_units`).
module pd_scene_content_warnings
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text
  use pd_base_warnings, only: warnings_type
  use pd_scene_content_rules, only: given
  use pd_scene_content_change, only: scan_scene
  use pd_scene_format_source, only: source_type
  use pd_scene_content_types, only: scene_type
  use pd_scene_content_units, only: warn_of_units
  implicit none (type, external)
  private
  public :: warnings_of_scene

contains

  !> Add the warnings about a checked scene to `warnings`. Keys are looked for in its text; a scene
  !> built in memory has none.
  subroutine warnings_of_scene(scene, edges, warnings)
    type(scene_type), intent(in) :: scene           !! checked
    real(wp), intent(in) :: edges(:)   !! of the box around all bodies (dim) [m]
    type(warnings_type), intent(inout) :: warnings  !! added to
    type(source_type) :: source
    type(error_type), allocatable :: ignored
    integer :: i, b

    do i = 1, size(scene%materials)
      if (size(scene%materials) == 1) exit  ! bodies need not name it
      if (any([(scene%bodies(b)%material == scene%materials(i)%name, &
        & b=1, size(scene%bodies))])) cycle
      call warnings%add('unused material '//to_text(i), "the material '"// &
        & trim(scene%materials(i)%name)//"' is used by no body", tell=.false.)
    end do
    call warn_of_units(scene, edges, warnings)
    if (.not. allocated(scene%text)) return
    if (len(scene%text) == 0) return
    call scan_scene(scene, source, ignored)
    if (allocated(ignored)) return
    associate (d => scene%header%dimension)
      call warn_of_keys('scene', [character(20) :: 'plane', 'thickness'], d /= 2, &
        & 'in dimension '//to_text(d))
      call warn_of_keys('scene', [character(20) :: 'area'], d /= 1, 'in dimension '//to_text(d))
    end associate
    if (scene%time%method == 'relaxation') then
      call warn_of_keys('time', [character(20) :: 'integrator', 'step', 'safety', 'steps', &
        & 'duration', 'breaking'], .true., &
        & "with method = 'relaxation'; &relaxation has its settings")
      call warn_of_keys('relaxation', [character(20) :: 'control', 'batch', 'most_events'], &
        & scene%relaxation%growth == 'load_steps', "with growth = 'load_steps'")
    else
      call warn_of_keys('relaxation', [character(20) :: 'density_matrix', 'safety', 'tolerance', &
        & 'maximum_iterations', 'load_steps', 'growth', 'control', 'batch', &
        & 'most_events'], .true., "with &time method = 'explicit'")
    end if

  contains

    !> A warning for each of these keys that is given but has no effect.
    subroutine warn_of_keys(group, keys, idle, where_it_stands)
      character(*), intent(in) :: group, keys(:), where_it_stands
      logical, intent(in) :: idle
      integer :: k

      if (.not. idle) return
      do k = 1, size(keys)
        if (.not. given(group, 1, trim(keys(k)), source)) cycle
        call warnings%add('idle key '//group//' '//trim(keys(k)), '&'//group//' '// &
          & trim(keys(k))//' has no effect '//where_it_stands, tell=.false.)
      end do
    end subroutine warn_of_keys

  end subroutine warnings_of_scene

end module pd_scene_content_warnings
