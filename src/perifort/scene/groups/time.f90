!> The group `&time`: how the state moves.
module pd_scene_groups_time
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: is_set, name_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type, change_of_the_end, change_refused
  implicit none (type, external)
  private
  public :: time_group

  !> `&time`
  type, extends(group_type) :: time_group
    character(name_length) :: method = 'explicit'             !! 'relaxation'
    character(name_length) :: integrator = 'forward_backward'
    real(wp) :: step = unset                     !! [s], instead of safety
    real(wp) :: safety = 0.8_wp                  !! fraction of the limit [-]
    character(name_length) :: limit = 'equation' !! 7.25, or 'spectral'
    integer :: steps = 0
    real(wp) :: duration = unset                 !! [s], instead of steps
    character(name_length) :: breaking = 'before_forces'      !! 'after_forces'
    logical :: substeps = .false.                !! finer grids take shorter steps
  contains
    procedure :: visit
    procedure, nopass :: change_of
  end type time_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(time_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys     !! the visitor: reads, describes, writes

    call keys%key('method', group%method, 'explicit steps in time, or relaxation to '// &
      & 'static equilibrium', allowed=[character(10) :: 'explicit', 'relaxation'])
    call keys%key('integrator', group%integrator, 'explicit: rule of the steps', &
      & allowed=[character(16) :: 'forward_backward', 'velocity_verlet', 'adams_bashforth', &
      & 'adams_moulton', 'runge_kutta'])
    call keys%key('step', group%step, 's', 'time step, instead of safety', above=0.0_wp)
    call keys%key('safety', group%safety, '-', 'the time step as a fraction of the '// &
      & "integrator's limit", above=0.0_wp, hidden=is_set(group%step))
    call keys%key('limit', group%limit, "explicit: the integrator's limit from equation 7.25, "// &
      & 'or from the largest frequency of the body, which is measured at the start', &
      & allowed=[character(8) :: 'equation', 'spectral'])
    call keys%key('steps', group%steps, '', 'number of steps', at_least=1, &
      & default='explicit: steps or duration is required', hidden=group%steps == 0)
    call keys%key('duration', group%duration, 's', 'time to compute, instead of steps', &
      & above=0.0_wp)
    call keys%key('breaking', group%breaking, 'explicit: a bond beyond its limit breaks before '// &
      & "the forces of the step are computed, or after that (as in the book's programs)", &
      & allowed=[character(13) :: 'before_forces', 'after_forces'])
    call keys%key('substeps', group%substeps, 'explicit, with lattices of different spacings: '// &
      & 'the step is that of the coarsest one, and a lattice 2^n times as fine takes 2^n '// &
      & 'substeps of it')
  end subroutine visit

  !> A run may become longer or shorter.
  pure integer function change_of(key) result(change)
    character(*), intent(in) :: key  !! its name, '' for the group as a whole

    change = change_refused
    if (key == 'steps' .or. key == 'duration') change = change_of_the_end
  end function change_of

end module pd_scene_groups_time
