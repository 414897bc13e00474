!> The measured quantity of a study, and its values in one run.
!>
!> A measure is a quantity at one place or many, at one instant or many: a probe is one place over
!> the rows of the history, a field many places in the final state, and a column of the history has
!> no place at all.
module pd_study_trade_measure
  use pd_base_error, only: error_type, internal_fault
  use pd_base_kinds, only: wp
  use pd_base_text, only: join, nearest_name
  use pd_output_fields_field, only: output_field_type
  use pd_output_fields_table, only: field_table_type
  use pd_output_report_columns, only: columns_of_scene
  use pd_output_results_types, only: column_type
  use pd_scene_content_rules, only: rule_fault
  use pd_scene_format_source, only: source_type
  use pd_scene_content_types, only: name_length, scene_type
  implicit none (type, external)
  private
  public :: measure_type, record_type, resolve_measure, of_probe, of_column, of_field, &
    & difference, measure_unit, quantity_unit, value_of

  integer, parameter :: of_probe = 1, of_column = 2, of_field = 3

  type :: measure_type
    integer :: kind = 0
    character(:), allocatable :: name      !! as the user wrote it
    type(output_field_type) :: field       !! probe or field: its quantity
    character(32) :: unit = '1'            !! of what is measured, '1' for none
    integer :: probe = 0                   !! number of its group
    integer :: component = 0               !! 0: all
    character(:), allocatable :: region    !! of a field; '' = all points of bodies
    character(:), allocatable :: norm      !! 'rms', 'maximum' or 'relative'
  end type measure_type

  !> What one run shows: `values(component, place, row)`.
  type :: record_type
    integer :: rows = 0                        !! as many are filled
    real(wp), allocatable :: x(:, :)           !! places (dim, place) [m]; a column: (dim, 0)
    real(wp), allocatable :: weight(:)         !! of the places in the norm
    real(wp), allocatable :: time(:)           !! of the rows [s]
    real(wp), allocatable :: values(:, :, :)
    real(wp) :: spacing = 0.0_wp               !! [m]
    logical :: timeless = .false.              !! a state of which no time is known
    integer :: place = 1                       !! whose value is reported; 0: the mean square of all
  end type record_type

contains

  !> What the name `name` means in a scene; `source` gives an error its place. An error is set if
  !> the scene has no such probe, column or field.
  subroutine resolve_measure(name, region, norm, scene, table, source, measure, error)
    character(*), intent(in) :: name             !! value of `measure` in &study
    character(*), intent(in) :: region  !! value of `region` in &study, '' for all body points
    character(*), intent(in) :: norm             !! value of `norm` in &study
    type(scene_type), intent(in) :: scene        !! whose fields are in the table
    type(field_table_type), intent(in) :: table  !! of fields
    type(source_type), intent(in) :: source      !! the scanned file, for places
    type(measure_type), intent(out) :: measure   !! what the name means
    type(error_type), allocatable, intent(out) :: error
    type(column_type), allocatable :: columns(:)
    type(output_field_type) :: field
    character(:), allocatable :: probe
    integer :: p, c, component
    logical :: found

    measure%name = name
    measure%region = region
    measure%norm = norm
    associate (dim => scene%header%dimension)
      do p = 1, size(scene%probes)
        probe = trim(scene%probes(p)%name)
        if (name == probe) then
          field = table%field(scene%probes(p)%fields(1))
          component = 0
        else if (index(name, probe//'_') == 1) then
          call table%find_component(name(len(probe) + 2:), dim, field, component, found)
          if (.not. found) cycle
        else
          cycle
        end if
        measure%kind = of_probe
        measure%probe = p
        measure%field = field
        measure%component = component
      end do
      if (measure%kind == 0) then
        columns = measurable_columns(scene, table)
        c = findloc(columns%name == name, .true., dim=1)
        if (c > 0) measure%kind = of_column
      end if
      if (measure%kind == 0) then
        call table%find_component(name, dim, measure%field, measure%component, found)
        if (found) measure%kind = of_field
      end if
    end associate
    measure%unit = measure%field%unit
    if (measure%kind == of_column) measure%unit = columns(c)%unit
    if (measure%kind == 0) then
      call rule_fault(error, 'study', 1, 'measure', "nothing is named '"//name//"'", &
        & hint(scene, table, name), source)
    else if (measure%kind /= of_field .and. region /= '') then
      call rule_fault(error, 'study', 1, 'region', "'region' goes with a field, but '"//name// &
        & "' is not a field", 'expected no region', source)
    end if
  end subroutine resolve_measure

  !> Columns of the history without those of probes, the step and the time.
  function measurable_columns(scene, table) result(columns)
    type(scene_type), intent(in) :: scene
    type(field_table_type), intent(in) :: table
    type(column_type), allocatable :: columns(:)

    columns = columns_of_scene(scene, table)
    columns = pack(columns, columns%name /= 'step' .and. columns%name /= 'time')
  end function measurable_columns

  function hint(scene, table, name) result(note)
    type(scene_type), intent(in) :: scene
    type(field_table_type), intent(in) :: table
    character(*), intent(in) :: name
    character(:), allocatable :: note, nearest
    character(name_length), allocatable :: names(:)
    type(column_type), allocatable :: columns(:)
    integer :: p

    names = [character(name_length) :: (scene%probes(p)%name, p=1, size(scene%probes))]
    columns = measurable_columns(scene, table)
    names = [names, [character(name_length) :: columns%name], table%names()]
    nearest = nearest_name(name, names)
    note = 'expected a probe, a column of the history or a field: '//join(names, ', ')
    if (len(nearest) > 0) note = "did you mean '"//nearest//"'?  "//note
  end function hint

  !> The norm of the differences of a record from its reference, of the same shape. `of` (place,
  !> row) says what is compared.
  pure real(wp) function difference(norm, record, reference, of) result(error)
    character(*), intent(in) :: norm            !! 'rms', 'maximum' or 'relative'
    type(record_type), intent(in) :: record     !! what the run showed
    real(wp), intent(in) :: reference(:, :, :)  !! (component, place, row), in the unit of the
                                                !! record
    logical, intent(in) :: of(:, :)             !! (place, row), whether it is compared
    real(wp) :: squares, answer, weights, square, largest
    integer :: p, r

    squares = 0.0_wp
    answer = 0.0_wp
    weights = 0.0_wp
    largest = 0.0_wp
    do r = 1, size(of, 2)
      do p = 1, size(of, 1)
        if (.not. of(p, r)) cycle
        square = sum((record%values(:, p, r) - reference(:, p, r))**2)
        largest = max(largest, square)
        squares = squares + record%weight(p)*square
        answer = answer + record%weight(p)*sum(reference(:, p, r)**2)
        weights = weights + record%weight(p)
      end do
    end do
    select case (norm)
    case ('maximum')
      error = sqrt(largest)
    case ('rms')
      error = sqrt(squares/max(weights, tiny(1.0_wp)))
    case ('relative')
      error = sqrt(squares/max(answer, tiny(1.0_wp)))
    case default
      call internal_fault('unknown norm of a study')
    end select
  end function difference

  !> What a run measured, as one number: the value in the last row; of a vector its length; of many
  !> places the root of the mean square, weighted as in the norm. Of a single place its value with
  !> its sign. 0 without rows.
  pure real(wp) function value_of(record) result(value)
    type(record_type), intent(in) :: record  !! what the run showed
    integer :: p

    value = 0.0_wp
    if (record%rows == 0) return
    associate (last => record%values(:, :, record%rows))
      if (record%place == 0) then
        value = sqrt(sum([(record%weight(p)*sum(last(:, p)**2), p=1, size(last, 2))]) &
          & /sum(record%weight))
      else if (size(last, 1) == 1) then
        value = last(1, record%place)
      else
        value = norm2(last(:, record%place))
      end if
    end associate
  end function value_of

  !> The unit of an error, '' if it has none.
  pure function measure_unit(measure) result(unit)
    type(measure_type), intent(in) :: measure  !! with its norm
    character(:), allocatable :: unit

    unit = ''
    if (measure%norm /= 'relative') unit = quantity_unit(measure)
  end function measure_unit

  !> The unit of the measured quantity, '' if it has none.
  pure function quantity_unit(measure) result(unit)
    type(measure_type), intent(in) :: measure  !! with its kind and field
    character(:), allocatable :: unit

    unit = trim(measure%unit)
    if (unit == '1') unit = ''
  end function quantity_unit

end module pd_study_trade_measure
