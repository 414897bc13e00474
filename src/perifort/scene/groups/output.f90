!> The group `&output`: fields, files and intervals of the output.
module pd_scene_groups_output
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: name_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type, change_harmless, change_of_the_files
  implicit none (type, external)
  private
  public :: output_group, default_fields

  !> The fields written if none are named.
  character(14), parameter :: default_fields(3) = [character(14) :: 'displacement', 'velocity', &
    & 'damage']

  !> `&output`
  type, extends(group_type) :: output_group
    integer :: every = 0                         !! steps (load steps in relaxation); 0 = steps/10
    real(wp) :: interval = unset                 !! [s], instead of every
    integer :: history_every = 0                 !! 0 = by their cost, at most about 2000
    character(name_length), allocatable :: fields(:)
    character(name_length) :: precision = 'double'   !! 'single'
    character(name_length) :: format = 'vtkhdf'      !! 'vtu', 'both'
    logical :: cells = .false.                   !! meshes are shown as elements
    logical :: fragments = .false.               !! in the history and in fragments.csv
    integer :: checkpoint_every = 0              !! steps (relaxation: iterations); 0 = none so
    real(wp) :: checkpoint_minutes = 15.0_wp     !! of wall time; 0 = not by time
  contains
    procedure :: visit
    procedure, nopass :: change_of
  end type output_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(output_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys       !! the visitor: reads, describes, writes

    call keys%key('every', group%every, '', 'steps (relaxation: load steps) between outputs', &
      & at_least=1, default='a tenth of the steps; relaxation: 1', hidden=group%every == 0)
    call keys%key('interval', group%interval, 's', 'time between outputs, instead of every', &
      & above=0.0_wp)
    call keys%key('history_every', group%history_every, '', &
      & 'steps between rows of the history (relaxation: iterations between lines of '// &
      & 'iterations.csv)', at_least=1, default='max(1, steps/2000), and so many that rows '// &
      & 'take at most 5 % of the time; relaxation: 1', &
      & hidden=group%history_every == 0)
    call keys%list('fields', group%fields, 'fields to write', keys%field_names(), &
      & default="'displacement', 'velocity', 'damage'")
    call keys%key('cells', group%cells, 'show meshes as their elements, with values of nodes '// &
      & 'and elements beside those of the points')
    call keys%key('fragments', group%fragments, 'count the parts that intact bonds join, in '// &
      & 'the history, and list them in fragments.csv at each output')
    call keys%key('precision', group%precision, 'of the fields in the file', &
      & allowed=[character(6) :: 'single', 'double'])
    call keys%key('format', group%format, 'vtkhdf: one HDF5 file, with a list of its '// &
      & 'outputs (.xdmf) for ParaView and pyvista; vtu: a .pvd series', &
      & allowed=[character(6) :: 'vtkhdf', 'vtu', 'both'])
    call keys%key('checkpoint_every', group%checkpoint_every, '', &
      & 'steps (relaxation: iterations) between checkpoints, from which a run can go on', &
      & at_least=1, default='by time only', hidden=group%checkpoint_every == 0)
    call keys%key('checkpoint_minutes', group%checkpoint_minutes, 'min', &
      & 'minutes of computing between checkpoints; 0: none by time', at_least=0.0_wp)
  end subroutine visit

  !> Intervals may be changed at any time; fields and formats only with other files.
  pure integer function change_of(key) result(change)
    character(*), intent(in) :: key  !! its name, '' for the group as a whole

    change = change_harmless
    if (any(key == [character(9) :: 'fields', 'cells', 'fragments', 'precision', &
      & 'format'])) &
      & change = change_of_the_files
  end function change_of

end module pd_scene_groups_output
