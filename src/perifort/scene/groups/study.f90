!> The group `&study`: a key that is varied.
module pd_scene_groups_study
  use pd_scene_format_given, only: name_length, path_length
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  public :: study_group, closed_forms

  !> Answers that a study knows in closed form.
  character(15), parameter :: closed_forms(6) = [character(15) :: 'bar_vibration', 'bar_tension', &
    & 'uniaxial_stress', 'plate_hole', 'chain_wave', 'linear_field']

  !> `&study`: one key that a study varies; `measure` is read from the first group that has it.
  type, extends(group_type) :: study_group
    character(name_length) :: vary = ''          !! `group%key`, `group(2)%key`, `key(1)`, ...
    character(path_length), allocatable :: values(:)  !! as written, texts with their quotes
    logical :: together = .false.                !! in step with the group before
    character(name_length) :: measure = ''       !! a probe, a column of the history or a field
    character(path_length) :: against = ''       !! 'analytic', 'finest' or the name of a file
    character(name_length) :: analytic = ''      !! name of a closed form; '' = the one that fits
    character(name_length) :: norm = ''          !! '' = 'relative'
    character(name_length) :: region = ''        !! a field is measured here; '' = all body points
  contains
    procedure :: visit
  end type study_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(study_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys      !! the visitor: reads, describes, writes

    call keys%key('vary', group%vary, 'the key that is varied: group%key, or key alone where '// &
      & 'it is the only one of its name; group(2)%key where a group is repeated, key(2) for an '// &
      & 'element', required=.true.)
    call keys%words('values', group%values, 'its values, one for each run; of body%points the '// &
      & 'count along x, the other counts follow in proportion', required=.true.)
    call keys%key('together', group%together, 'varies together with the group before it '// &
      & 'instead of making the product')
    call keys%key('measure', group%measure, 'a probe, a column of the history, or a field in '// &
      & 'the final state', default='required in one group')
    call keys%key('against', group%against, 'reference for the error: analytic, a closed '// &
      & 'form; finest, the run that is the finest in every varied key; or the name of a file, '// &
      & 'history.csv, a table of positions and values, or results (.vtkhdf)', &
      & default='required in one group')
    call keys%key('analytic', group%analytic, 'the closed form', allowed=closed_forms, &
      & default='the one that fits the scene')
    call keys%key('norm', group%norm, 'root mean square of the differences, the largest, or '// &
      & "the root of their squares over the answer's", &
      & allowed=[character(8) :: 'rms', 'maximum', 'relative'], default="'relative'")
    call keys%key('region', group%region, 'field: name of a region whose points count', &
      & default='all points of the bodies')
  end subroutine visit

end module pd_scene_groups_study
