!> The defaults that have changed from version to version.
!>
!> `&scene defaults` names the version for which a scene was written; without it, this version. Keys
!> that are not listed here have had the same default in all versions.
!>
!> | version | what has changed                                                                  |
!> |---------|-----------------------------------------------------------------------------------|
!> | 0.2     | `&horizon dilatation`: 'unprojected', before 'projected'                          |
!> | 0.2     | `&output history_every`: rows take at most 5 % of the time; before, this was not  |
!> |         | looked at: max(1, steps/2000)                                                     |
!> | 0.2     | relaxation, `&output history_every`: 1, before max(1, maximum_iterations/2000)    |
!> | 0.2     | relaxation, temperature changes of `&initial`: by a ramp over the load steps,     |
!> |         | before at once                                                                    |
!> | 0.2     | `&material critical`: 'lattice', before 'chapter'                                 |
!> | 0.2     | `&relaxation growth`: 'events' where bonds can break and all acts in proportion   |
!> |         | to t, before 'load_steps'                                                         |
module pd_scene_content_defaults
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp
  use pd_base_text, only: join
  use pd_scene_content_expressions, only: varies_in_time
  use pd_scene_content_rules, only: rule_fault
  use pd_scene_content_types, only: scene_type, is_given, is_set
  use pd_scene_format_source, only: source_type
  use pd_scene_groups_header, only: known_defaults, own_defaults
  implicit none (type, external)
  private
  public :: fill_defaults, rows_by_cost

  integer, parameter :: rows_wanted = 2000  !! of a history, in version 0.1

contains

  !> Give keys that the user has not given the default of the scene's version. An error if the
  !> version is not known.
  subroutine fill_defaults(scene, error, source)
    type(scene_type), intent(inout) :: scene                !! with all lists allocated
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source       !! the scanned file, for places
    integer :: i

    if (scene%header%defaults == '') scene%header%defaults = own_defaults
    if (all(known_defaults /= scene%header%defaults)) then
      call rule_fault(error, 'scene', 1, 'defaults', "unknown version '"// &
        & trim(scene%header%defaults)//"' of the defaults", 'known: '//join(known_defaults, ', '), &
        & source)
      return
    end if
    if (scene%horizon%dilatation == '') then
      scene%horizon%dilatation = 'unprojected'
      if (before_0_2(scene)) scene%horizon%dilatation = 'projected'
    end if
    do i = 1, size(scene%materials)
      associate (material => scene%materials(i))
        if (material%critical /= '' .or. .not. is_set(material%critical_energy_release_rate)) cycle
        material%critical = 'lattice'
        if (before_0_2(scene)) material%critical = 'chapter'
      end associate
    end do
    if (scene%time%method /= 'relaxation' .or. .not. before_0_2(scene)) return
    if (scene%relaxation%growth == '') scene%relaxation%growth = 'load_steps'
    if (scene%output%history_every == 0) &
      & scene%output%history_every = max(1, scene%relaxation%maximum_iterations/rows_wanted)
    do i = 1, size(scene%initial)
      associate (initial => scene%initial(i))
        if (.not. is_given(initial%temperature_change, initial%temperature_text) .and. &
          & initial%file == '') cycle
        ! what depends on t has a course of its own
        if (varies_in_time(scene, initial%temperature_text)) cycle
        if (is_set(initial%ramp_time) .or. allocated(initial%times) .or. &
          & allocated(initial%values)) cycle
        initial%times = [0.0_wp, 1.0_wp]
        initial%values = [1.0_wp, 1.0_wp]
      end associate
    end do
  end subroutine fill_defaults

  !> Whether the default interval of history rows is so large that rows take little time. Their
  !> number follows from the steps, which only the plan of a run knows.
  pure logical function rows_by_cost(scene)
    type(scene_type), intent(in) :: scene  !! checked, with its version of the defaults
    rows_by_cost = .not. before_0_2(scene)
  end function rows_by_cost

  pure logical function before_0_2(scene)
    type(scene_type), intent(in) :: scene
    before_0_2 = scene%header%defaults == '0.1'
  end function before_0_2

end module pd_scene_content_defaults
