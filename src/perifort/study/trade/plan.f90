!> The plan of a study: the varied keys and their values, the resulting runs, the measured quantity
!> and its reference.
!>
!> A run's scene is made by giving keys other words in the scanned file and reading it anew, so a
!> value that is refused is reported at its place in the group `&study`.
module pd_study_trade_plan
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type
  use pd_body_generate, only: generate_body, horizon_of
  use pd_set_up_memory, only: check_memory
  use pd_motion_explicit_time_step, only: horizon_volume
  use pd_scene_content_change, only: apply_changes, change_key, find_target, full_name, target_type
  use pd_scene_format_elements, only: find_elements, growing
  use pd_scene_format_file, only: line_type, read_text_file
  use pd_scene_content_read, only: read_scene_source
  use pd_scene_content_rules, only: find_entry, find_section, rule_fault
  use pd_scene_format_source, only: scan_source, source_fault, source_type, token_type
  use pd_scene_content_types, only: has_own_horizons, has_refinement, is_lattice, is_set, &
    & name_length, path_length, scene_type
  use pd_scene_format_values, only: parse_integer, parse_real
  implicit none (type, external)
  private
  public :: plan_type, variable_type, trial_type, plan_study, plan_from_text, scene_of, size_up, &
    & shown_word, common_divisor, result_columns

  !> The columns of the table behind the varied keys.
  character(12), parameter :: result_columns(10) = [character(12) :: 'error', 'seconds', &
    & 'points', 'bonds', 'steps', 'bytes', 'energy_drift', 'pareto', 'value', 'true_error']

  integer, parameter :: most_runs = 10000

  !> One key that is varied.
  type :: variable_type
    type(target_type) :: target
    character(:), allocatable :: name                 !! of its column
    type(token_type), allocatable :: places(:)        !! of its values
    character(path_length), allocatable :: words(:)   !! its values as they are written
    real(wp), allocatable :: numbers(:)               !! the same as numbers, if they are
    logical :: numeric = .false.
    logical :: refines = .false.                      !! it is the number of points of a body
    logical :: levels = .false.                       !! it is the number of levels of `&refine`
    integer :: step = 1                               !! refines: counts are multiples of this
    integer :: axis = 0                               !! variables of one axis go in step
  end type variable_type

  !> One run.
  type :: trial_type
    character(path_length), allocatable :: words(:)   !! a value for each variable
    type(scene_type) :: scene
    real(wp) :: points = 0.0_wp                       !! about; layers are not counted
    real(wp) :: spacing = 0.0_wp                      !! largest of the bodies [m]
    real(wp) :: bonds = 0.0_wp                        !! about
    real(wp) :: work = 0.0_wp                         !! a guess, to be compared only
  end type trial_type

  type :: plan_type
    type(source_type) :: source
    type(line_type), allocatable :: changes(:)        !! what `--set` changes in it
    type(scene_type) :: scene                         !! as it stands in the file
    type(variable_type), allocatable :: variables(:)
    type(trial_type), allocatable :: trials(:)        !! the first axis slowest
    character(:), allocatable :: measure, against, analytic, norm, region
  end type plan_type

contains

  !> Plan the study in the scene file at `path`. An error is set if the file cannot be read, or if
  !> the scene or its studies break a rule.
  subroutine plan_study(path, plan, error, changes)
    character(*), intent(in) :: path                     !! of the scene file
    type(plan_type), intent(out) :: plan                 !! its runs, with their scenes
    type(error_type), allocatable, intent(out) :: error
    type(line_type), intent(in) :: changes(:)  !! `group%key=value`: see `--set`
    character(:), allocatable :: text

    call read_text_file(path, text, error)
    if (allocated(error)) return
    call plan_from_text(text, path, plan, error, changes)
  end subroutine plan_study

  !> The same from a text; `name` stands for the file in messages. An error is set if the scene or
  !> its studies break a rule.
  subroutine plan_from_text(text, name, plan, error, changes)
    character(*), intent(in) :: text                     !! of a scene file
    character(*), intent(in) :: name                     !! path of the file; there need be none
    type(plan_type), intent(out) :: plan                 !! its runs, with their scenes
    type(error_type), allocatable, intent(out) :: error
    type(line_type), intent(in) :: changes(:)  !! `group%key=value`: see `--set`

    call scan_source(text, name, plan%source, error)
    if (allocated(error)) return
    plan%changes = changes
    call apply_changes(plan%source, plan%changes, error)
    if (allocated(error)) return
    call read_scene_source(plan%source, plan%scene, error)
    if (allocated(error)) return
    plan%scene%text = text
    if (size(plan%scene%studies) == 0) then
      call source_fault(plan%source, 0, 0, 0, 'the scene has no group &study', &
        & "expected at least one, with 'vary', 'values', 'measure' and 'against'", error)
      return
    end if
    call read_settings(plan, error)
    if (allocated(error)) return
    call read_variables(plan, error)
    if (allocated(error)) return
    call refuse_both(plan, error)
    if (allocated(error)) return
    call make_trials(plan, error)
  end subroutine plan_from_text

  !> What is measured: the keys that need stand in one group only and must agree if in several.
  subroutine read_settings(plan, error)
    type(plan_type), intent(inout) :: plan
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    plan%measure = ''
    plan%against = ''
    plan%analytic = ''
    plan%norm = ''
    plan%region = ''
    do i = 1, size(plan%scene%studies)
      associate (group => plan%scene%studies(i))
        call agree('measure', trim(group%measure), plan%measure)
        call agree('against', trim(group%against), plan%against)
        call agree('analytic', trim(group%analytic), plan%analytic)
        call agree('norm', trim(group%norm), plan%norm)
        call agree('region', trim(group%region), plan%region)
        if (allocated(error)) return
      end associate
    end do
    if (plan%measure == '') then
      call rule_fault(error, 'study', 1, '', "no group &study has the key 'measure'", &
        & 'expected a probe, a column of the history or a field', plan%source)
    else if (plan%against == '') then
      call rule_fault(error, 'study', 1, '', "no group &study has the key 'against'", &
        & "expected 'analytic', 'finest' or the name of a file", plan%source)
    else if (plan%analytic /= '' .and. plan%against /= 'analytic') then
      call rule_fault(error, 'study', 1, 'analytic', "'analytic' names a closed form, but "// &
        & "'against' is '"//plan%against//"'", "expected against = 'analytic'", plan%source)
    end if
    if (plan%norm == '') plan%norm = 'relative'

  contains

    subroutine agree(key, found, setting)
      character(*), intent(in) :: key, found
      character(:), allocatable, intent(inout) :: setting
      if (found == '' .or. allocated(error)) return
      if (setting /= '' .and. setting /= found) then
        call rule_fault(error, 'study', i, key, "'"//key//"' differs between groups &study", &
          & "it is '"//setting//"' in one before", plan%source)
      else
        setting = found
      end if
    end subroutine agree
  end subroutine read_settings

  !> The varied keys with their values.
  subroutine read_variables(plan, error)
    type(plan_type), intent(inout) :: plan
    type(error_type), allocatable, intent(out) :: error
    integer :: i, j

    allocate (plan%variables(size(plan%scene%studies)))
    do i = 1, size(plan%variables)
      associate (variable => plan%variables(i), group => plan%scene%studies(i))
        call find_target(plan%source, trim(group%vary), place_of(plan%source, i, 'vary'), &
          & variable%target, error)
        if (allocated(error)) return
        call name_column(plan, i, error)
        if (allocated(error)) return
        call collect_values(plan, i, error)
        if (allocated(error)) return
        variable%axis = 1
        if (i > 1) variable%axis = plan%variables(i - 1)%axis + merge(0, 1, group%together)
        if (i == 1 .or. .not. group%together) cycle
        if (size(variable%words) == size(plan%variables(i - 1)%words)) cycle
        call rule_fault(error, 'study', i, 'values', to_text(size(variable%words))// &
          & " values go together with "//to_text(size(plan%variables(i - 1)%words))// &
          & ' in the group before', 'expected as many', plan%source)
        return
      end associate
    end do
    do i = 2, size(plan%variables)
      do j = 1, i - 1
        if (full_name(plan%source, plan%variables(i)%target) /= &
          & full_name(plan%source, plan%variables(j)%target)) cycle
        call rule_fault(error, 'study', i, 'vary', 'this key is varied by another &study', &
          & 'give its values in one group', plan%source)
        return
      end do
    end do
  end subroutine read_variables

  !> A key cannot be set on the command line and varied: the study would take no notice of the
  !> option.
  subroutine refuse_both(plan, error)
    type(plan_type), intent(in) :: plan
    type(error_type), allocatable, intent(out) :: error
    integer :: v, e, section

    do v = 1, size(plan%variables)
      associate (target => plan%variables(v)%target, source => plan%source)
        section = find_section(source, target%group, target%number)
        if (section == 0) cycle
        e = find_entry(source, section, target%key)
        if (e == 0) cycle
        if (source%entries(e)%line <= size(source%lines) - source%option_count) cycle
        call source_fault(source, source%entries(e)%line, source%entries(e)%column, &
          & source%entries(e)%width, "'"//full_name(source, target)//"' is set here and varied "// &
          & 'by a group &study', 'set study%values, or leave the option out', error)
        return
      end associate
    end do
  end subroutine refuse_both

  !> The column has the name that the user wrote, in full where that is a column's already.
  subroutine name_column(plan, i, error)
    type(plan_type), intent(inout) :: plan
    integer, intent(in) :: i
    type(error_type), allocatable, intent(out) :: error

    associate (variable => plan%variables(i))
      variable%name = trim(plan%scene%studies(i)%vary)
      if (any(result_columns == variable%name) .or. scan(variable%name, ',"') > 0) &
        & variable%name = full_name(plan%source, variable%target)
      variable%levels = variable%target%group == 'refine' .and. variable%target%key == 'levels'
      variable%refines = variable%target%group == 'body' .and. variable%target%key == 'points' &
        & .and. .not. allocated(variable%target%subscript)
      if (.not. variable%refines) return
      if (.not. is_lattice(plan%scene%bodies(variable%target%number))) then
        call rule_fault(error, 'study', i, 'vary', 'the points of a cloud or mesh cannot be '// &
          & 'varied', "vary the 'file' or 'mesh' of the body", plan%source)
        return
      else if (plan%scene%bodies(variable%target%number)%shape /= '') then
        call rule_fault(error, 'study', i, 'vary', "a body with a 'shape' has no 'points'", &
          & "vary its 'spacing'", plan%source)
        return
      end if
      variable%step = smallest_step(plan%scene, variable%target)
    end associate
  end subroutine name_column

  !> The values of a variable; those of a vector are taken together, as many as there are
  !> directions.
  subroutine collect_values(plan, i, error)
    type(plan_type), intent(inout) :: plan
    integer, intent(in) :: i
    type(error_type), allocatable, intent(out) :: error
    integer, allocatable :: slots(:)
    logical, allocatable :: used(:)
    character(:), allocatable :: note
    integer :: each, number, j, k

    associate (variable => plan%variables(i), source => plan%source, &
        & group => plan%scene%studies(i))
      allocate (used(size(source%entries)))
      call find_elements(source, find_section(source, 'study', i), 'values', growing, slots, used, &
        & error)
      if (allocated(error)) return
      each = 1
      if (.not. allocated(variable%target%subscript) .and. .not. variable%refines) then
        if (index(variable%target%kind, '(3)') > 0) each = plan%scene%header%dimension
        if (index(variable%target%kind, 'list') > 0 .or. index(variable%target%kind, ',') > 0) then
          call rule_fault(error, 'study', i, 'vary', "'"//variable%target%key//"' is a "// &
            & variable%target%kind, 'vary one element of it, as in '//variable%target%key//'('// &
            & trim(merge('1,1', '2  ', index(variable%target%kind, ',') > 0))//')', source)
          return
        end if
      end if
      number = size(slots)/each
      if (number*each /= size(slots)) then
        call rule_fault(error, 'study', i, 'values', to_text(size(slots))//' values are not a '// &
          & 'whole number of vectors', 'expected '//to_text(each)//' for each', source)
        return
      end if
      allocate (variable%places(number), variable%words(number))
      allocate (variable%numbers(number), source=0.0_wp)
      variable%numeric = each == 1
      do j = 1, number
        variable%places(j) = source%tokens(slots((j - 1)*each + 1))
        variable%words(j) = group%values((j - 1)*each + 1)
        do k = 2, each
          variable%words(j) = trim(variable%words(j))//', '//group%values((j - 1)*each + k)
        end do
        if (.not. variable%numeric) cycle
        call parse_real(trim(variable%words(j)), variable%numbers(j), note)
        if (len(note) > 0) variable%numeric = .false.
      end do
    end associate
  end subroutine collect_values

  !> All runs: the product of the axes, the first slowest.
  subroutine make_trials(plan, error)
    type(plan_type), intent(inout) :: plan
    type(error_type), allocatable, intent(out) :: error
    integer, allocatable :: length(:), at(:)
    integer :: axes, a, v, t, rest

    axes = plan%variables(size(plan%variables))%axis
    allocate (length(axes), at(axes))
    do v = 1, size(plan%variables)
      length(plan%variables(v)%axis) = size(plan%variables(v)%words)
    end do
    if (product(real(length, wp)) > most_runs) then
      call fail(error, 'the study has '//to_text(product(real(length, wp)))// &
        & ' runs, more than '//to_text(most_runs))
      return
    end if
    allocate (plan%trials(product(length)))
    do t = 1, size(plan%trials)
      rest = t - 1
      do a = axes, 1, -1
        at(a) = modulo(rest, length(a)) + 1
        rest = rest/length(a)
      end do
      allocate (plan%trials(t)%words(size(plan%variables)))
      do v = 1, size(plan%variables)
        plan%trials(t)%words(v) = plan%variables(v)%words(at(plan%variables(v)%axis))
      end do
      call scene_of(plan, plan%trials(t), error)
      if (allocated(error)) return
      call size_up(plan%trials(t), error)
      if (.not. allocated(error)) cycle
      error%message = describe(plan, plan%trials(t))//': '//error%message
      return
    end do
  end subroutine make_trials

  !> `a = 1, b = 2`
  pure function describe(plan, trial) result(text)
    type(plan_type), intent(in) :: plan
    type(trial_type), intent(in) :: trial
    character(:), allocatable :: text
    integer :: v

    text = ''
    do v = 1, size(trial%words)
      if (v > 1) text = text//', '
      text = text//plan%variables(v)%name//' = '//trim(trial%words(v))
    end do
  end function describe

  !> The scene of a run from its words. An error, at the place of the value in `&study`, if the
  !> scene is refused.
  subroutine scene_of(plan, trial, error)
    type(plan_type), intent(in) :: plan       !! of the study
    type(trial_type), intent(inout) :: trial  !! with its words; its scene is set on return
    type(error_type), allocatable, intent(out) :: error
    type(source_type) :: source
    type(token_type) :: place
    integer :: v, j

    source = plan%source
    do v = 1, size(plan%variables)
      associate (variable => plan%variables(v))
        place = variable%places(1)
        do j = 1, size(variable%words)
          if (variable%words(j) == trial%words(v)) place = variable%places(j)
        end do
        if (variable%refines) then
          call refine(plan%scene, variable, trim(trial%words(v)), place, source, error)
        else
          call change_key(source, variable%target, trim(trial%words(v)), place, error)
        end if
        if (allocated(error)) return
      end associate
    end do
    call read_scene_source(source, trial%scene, error)
  end subroutine scene_of

  !> Give a body so many points along x, and the other directions and, unless the body was named by
  !> its number, the other bodies in proportion.
  subroutine refine(scene, variable, word, place, source, error)
    type(scene_type), intent(in) :: scene
    type(variable_type), intent(in) :: variable
    character(*), intent(in) :: word
    type(token_type), intent(in) :: place
    type(source_type), intent(inout) :: source
    type(error_type), allocatable, intent(out) :: error
    type(target_type) :: target
    character(:), allocatable :: note, counts
    integer :: number, b, c, base

    call parse_integer(word, number, note)
    if (len(note) == 0 .and. number < 1) note = 'expected a whole number above 0'
    if (len(note) == 0 .and. modulo(number, variable%step) /= 0) note = &
      & 'expected a multiple of '//to_text(variable%step)//', so that the cells stay cubes'
    if (len(note) > 0) then
      call source_fault(source, place%line, place%column, place%width, "bad value '"//word// &
        & "' for the points along x", note, error)
      return
    end if
    target = variable%target
    base = scene%bodies(target%number)%points(1)
    do b = 1, size(scene%bodies)
      if (.not. follows(scene, variable%target, b)) cycle
      target%number = b
      counts = ''
      do c = 1, scene%header%dimension
        if (c > 1) counts = counts//', '
        counts = counts//to_text(nint(real(scene%bodies(b)%points(c), wp)*number/base))
      end do
      call change_key(source, target, counts, place, error)
      if (allocated(error)) return
    end do
  end subroutine refine

  !> Whether body `b` is refined when the points of the target are varied.
  pure logical function follows(scene, target, b)
    type(scene_type), intent(in) :: scene
    type(target_type), intent(in) :: target
    integer, intent(in) :: b
    follows = is_lattice(scene%bodies(b)) .and. scene%bodies(b)%shape == '' .and. (b == &
      & target%number .or. .not. target%numbered)
  end function follows

  !> The smallest count along x at which all counts are whole in the same proportion.
  pure integer function smallest_step(scene, target) result(step)
    type(scene_type), intent(in) :: scene
    type(target_type), intent(in) :: target
    integer :: divisor, b, c

    divisor = 0
    do b = 1, size(scene%bodies)
      if (.not. follows(scene, target, b)) cycle
      do c = 1, scene%header%dimension
        divisor = common_divisor(divisor, scene%bodies(b)%points(c))
      end do
    end do
    step = scene%bodies(target%number)%points(1)/max(1, divisor)
  end function smallest_step

  !> The greatest common divisor; that of 0 and a number is the number.
  pure integer function common_divisor(first, second) result(divisor)
    integer, intent(in) :: first, second  !! 0 or positive
    integer :: rest, next

    divisor = first
    rest = second
    do while (rest /= 0)
      next = modulo(divisor, rest)
      divisor = rest
      rest = next
    end do
  end function common_divisor

  !> Points, spacing and an estimate of the work of a run; an error if it does not fit into the
  !> memory.
  subroutine size_up(trial, error)
    type(trial_type), intent(inout) :: trial  !! with its scene; points, spacing, bonds and work are
                                              !! set
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: body
    real(wp) :: delta, steps, speed, extent, spacing, finest
    integer :: i, dim

    call check_memory(trial%scene, error)
    if (allocated(error)) return
    trial%points = 0.0_wp
    trial%spacing = 0.0_wp
    finest = huge(finest)
    extent = 0.0_wp
    associate (scene => trial%scene)
      dim = scene%header%dimension
      if (any(.not. is_lattice(scene%bodies)) .or. has_refinement(scene)) then
        call generate_body(scene, body, delta, error)
        if (allocated(error)) return
        trial%points = body%n_points
        trial%spacing = maxval(body%spacing)
        finest = minval(body%spacing)
        extent = maxval(maxval(body%x, 1) - minval(body%x, 1))
      else
        do i = 1, size(scene%bodies)
          trial%points = trial%points + product(real(scene%bodies(i)%points(:dim), wp))
          spacing = (scene%bodies(i)%upper(1) - scene%bodies(i)%lower(1)) &
            & /scene%bodies(i)%points(1)
          trial%spacing = max(trial%spacing, spacing)
          finest = min(finest, spacing)
          extent = max(extent, maxval(scene%bodies(i)%upper(:dim) - scene%bodies(i)%lower(:dim)))
        end do
      end if
      delta = horizon_of(scene, trial%spacing)
      speed = sqrt(maxval(scene%materials%youngs_modulus/scene%materials%density))
      if (scene%time%method == 'relaxation') then
        steps = 10*scene%relaxation%load_steps*extent/finest
      else if (scene%time%steps > 0) then
        steps = scene%time%steps
      else if (is_set(scene%time%step)) then
        steps = scene%time%duration/scene%time%step
      else
        steps = scene%time%duration*speed/(scene%time%safety*finest)
      end if
      ! families of points with horizons of their own have about the same number of members
      spacing = merge(trial%spacing, finest, has_own_horizons(scene))
      trial%bonds = trial%points*horizon_volume(dim, delta, 1.0_wp)/spacing**dim
      trial%work = trial%bonds*steps
    end associate
  end subroutine size_up

  !> Where the value of a key of the `number`-th `&study` stands.
  function place_of(source, number, key) result(place)
    type(source_type), intent(in) :: source
    integer, intent(in) :: number
    character(*), intent(in) :: key
    type(token_type) :: place

    place = source%tokens(source%entries(find_entry(source, find_section(source, 'study', number), &
      & key))%first)
  end function place_of

  !> A value without its quotes, and parted by blanks if it is a vector.
  pure function shown_word(word) result(text)
    character(*), intent(in) :: word  !! as it stands in the scene file
    character(:), allocatable :: text
    integer :: comma

    text = trim(word)
    if (index(text, "'") == 1) text = text(2:len(text) - 1)
    do
      comma = index(text, ',')
      if (comma == 0) exit
      text = text(:comma - 1)//text(comma + 1:)
    end do
  end function shown_word

end module pd_study_trade_plan
