!> The group `&relaxation`: how static equilibrium is found.
module pd_scene_groups_relaxation
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: is_set, name_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type, change_harmless, change_refused
  implicit none (type, external)
  private
  public :: relaxation_group, safety_of, batch_of

  !> `&relaxation`
  type, extends(group_type) :: relaxation_group
    character(name_length) :: solver = 'conjugate_gradient'      !! 'dynamic_relaxation'
    character(name_length) :: density_matrix = 'frame_invariant' !! 'chapter', 'constant'
    real(wp) :: safety = unset                   !! on the mass; 1, or 5 for 'chapter', 'constant'
    real(wp) :: tolerance = 1.0e-6_wp            !! of residual force and of displacement change [-]
    integer :: maximum_iterations = 100000       !! of each relaxation
    integer :: load_steps = 1
    character(name_length) :: growth = ''        !! 'events' or 'load_steps'; '' = as it can be
    character(name_length) :: control = 'load'   !! growth by events: 'load' or 'dissipation'
    real(wp) :: batch = unset                    !! growth by events: which bonds break together [-]
    integer :: most_events = 0                   !! growth by events: the run ends then; 0: no limit
  contains
    procedure :: visit
    procedure, nopass :: change_of
  end type relaxation_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(relaxation_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys           !! the visitor: reads, describes, writes

    call keys%key('solver', group%solver, 'conjugate_gradient: Newton''s method with conjugate '// &
      & 'gradients; dynamic_relaxation: adaptive, as in the book', &
      & allowed=[character(18) :: 'conjugate_gradient', 'dynamic_relaxation'])
    call keys%key('density_matrix', group%density_matrix, 'fictitious mass of dynamic '// &
      & 'relaxation, scale of conjugate gradients; chapter = 7.32', &
      & allowed=[character(15) :: 'frame_invariant', 'chapter', 'constant'])
    call keys%key('safety', group%safety, '-', 'factor on the fictitious mass', above=0.0_wp, &
      & default='1; 5 for chapter and constant')
    call keys%key('tolerance', group%tolerance, '-', 'converged when residual force and '// &
      & 'displacement change are below this', above=0.0_wp, below=1.0_wp)
    call keys%key('maximum_iterations', group%maximum_iterations, '', 'most iterations of each '// &
      & 'relaxation', at_least=1)
    call keys%key('load_steps', group%load_steps, '', 'steps in which loads and imposed '// &
      & 'displacements grow', at_least=1)
    call keys%key('growth', group%growth, 'how bonds break; events: one batch after the other, '// &
      & 'at the load factor at which its first bond reaches its limit; load_steps: all beyond '// &
      & 'their limit when a load step has converged', allowed=[character(10) :: 'events', &
      & 'load_steps'], default="'events' where bonds can break and all acts in proportion to t")
    call keys%key('control', group%control, 'growth by events; load: the load factor never '// &
      & 'decreases; dissipation: it follows the bonds, down where the response snaps back', &
      & allowed=[character(11) :: 'load', 'dissipation'])
    call keys%key('batch', group%batch, '-', 'growth by events: bonds break together whose '// &
      & 'stretch over their limit is within this part of the largest', at_least=0.0_wp, &
      & below=1.0_wp, default='1e-6; 0.02 in 3D')
    call keys%key('most_events', group%most_events, '', 'growth by events: the run ends after '// &
      & 'so many', at_least=0, default='no limit')
  end subroutine visit

  !> The factor on the fictitious mass, if nothing is said its default: masses that are stable by
  !> themselves need none.
  pure real(wp) function safety_of(group) result(safety)
    type(relaxation_group), intent(in) :: group  !! checked or not

    safety = group%safety
    if (is_set(safety)) return
    safety = 5.0_wp
    if (group%density_matrix == 'frame_invariant') safety = 1.0_wp
  end function safety_of

  !> Which part of the largest ratio of stretch and limit bonds that break together may be below it;
  !> if nothing is said its default: mirror twins, and in 3D more, for fewer events.
  pure real(wp) function batch_of(group, dimension) result(batch)
    type(relaxation_group), intent(in) :: group  !! checked or not
    integer, intent(in) :: dimension             !! of the scene

    batch = group%batch
    if (is_set(batch)) return
    batch = 1.0e-6_wp
    if (dimension == 3) batch = 0.02_wp
  end function batch_of

  !> More iterations are the same iterations.
  pure integer function change_of(key) result(change)
    character(*), intent(in) :: key  !! its name, '' for the group as a whole

    change = change_refused
    if (key == 'maximum_iterations') change = change_harmless
  end function change_of

end module pd_scene_groups_relaxation
