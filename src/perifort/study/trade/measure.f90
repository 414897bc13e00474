!> What a study measures, and what one run shows of it.
!>
!> A measure is a quantity at one place or many, at one instant or many: a probe is one place over
!> the rows of the history, a field many places in the final state, and a column of the history has
!> no place at all.
module pd_study_trade_measure
  use pd_base_error, only: error_type, internal_fault
  use pd_base_kinds, only: wp
  use pd_base_text, only: join, nearest_name
  use pd_scene_content_groups, only: field_names
  use pd_scene_content_rules, only: rule_fault
  use pd_scene_format_source, only: source_type
  use pd_scene_content_types, only: name_length, scene_type
  use pd_study_trade_closed_form, only: components_of
  implicit none (type, external)
  private
  public :: measure_type, record_type, resolve_measure, of_probe, of_column, of_field, &
    & difference, measure_unit, quantity_unit, value_of

  integer, parameter :: of_probe = 1, of_column = 2, of_field = 3

  type :: measure_type
    integer :: kind = 0
    character(:), allocatable :: name      !! as the user wrote it
    character(:), allocatable :: field     !! probe or field: its quantity
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

  character(*), parameter :: directions = 'xyz'

contains

  !> What the name `name` means in a scene. An error, at its place in `source`, if nothing has that
  !> name, or if a region is given for anything but a field.
  subroutine resolve_measure(name, region, norm, scene, source, measure, error)
    character(*), intent(in) :: name            !! as the user wrote it: of a probe, a column of the
                                                !! history or a field
    character(*), intent(in) :: region          !! of a field; '' for all points of bodies
    character(*), intent(in) :: norm            !! 'rms', 'maximum' or 'relative'
    type(scene_type), intent(in) :: scene       !! gives the probes and boundaries
    type(source_type), intent(in) :: source     !! the scanned file of the scene, for the place of
                                                !! an error
    type(measure_type), intent(out) :: measure  !! what the name means
    type(error_type), allocatable, intent(out) :: error
    character(name_length), allocatable :: columns(:)
    character(:), allocatable :: probe, rest
    integer :: p

    measure%name = name
    measure%region = region
    measure%norm = norm
    do p = 1, size(scene%probes)
      probe = trim(scene%probes(p)%name)
      if (name == probe) then
        measure%field = trim(scene%probes(p)%fields(1))
      else if (index(name, probe//'_') == 1) then
        rest = name(len(probe) + 2:)
        call split_component(rest, scene%header%dimension, measure%component)
        if (all(field_names /= rest)) cycle
        measure%field = rest
      else
        cycle
      end if
      measure%kind = of_probe
      measure%probe = p
    end do
    if (measure%kind == 0) then
      columns = columns_of(scene)
      if (any(columns == name)) measure%kind = of_column
    end if
    if (measure%kind == 0) then
      rest = name
      call split_component(rest, scene%header%dimension, measure%component)
      if (any(field_names == rest)) then
        measure%kind = of_field
        measure%field = rest
      end if
    end if
    if (measure%kind == 0) then
      call rule_fault(error, 'study', 1, 'measure', "nothing is named '"//name//"'", &
        & hint(scene, name), source)
    else if (measure%kind /= of_field .and. region /= '') then
      call rule_fault(error, 'study', 1, 'region', "'region' goes with a field, but '"//name// &
        & "' is not a field", 'expected no region', source)
    end if
  end subroutine resolve_measure

  !> `displacement_x` -> `displacement` and 1; other texts stay as they are, with 0.
  pure subroutine split_component(text, dim, component)
    character(:), allocatable, intent(inout) :: text
    integer, intent(in) :: dim
    integer, intent(out) :: component
    integer :: last

    component = 0
    last = len(text)
    if (last < 3) return
    if (text(last - 1:last - 1) /= '_') return
    component = index(directions(:dim), text(last:))
    if (component > 0) then
      if (components_of(text(:last - 2), dim) == 1 .and. dim > 1) component = 0
    end if
    if (component > 0) text = text(:last - 2)
  end subroutine split_component

  !> Columns of the history without those of probes, the step and the time.
  pure function columns_of(scene) result(columns)
    type(scene_type), intent(in) :: scene
    character(name_length), allocatable :: columns(:)
    integer :: b, c

    columns = [character(name_length) :: 'kinetic_energy', 'strain_energy', 'dissipated_energy', &
      & 'external_work', 'broken_bonds', 'maximum_damage', 'step_size']
    if (scene%time%method == 'relaxation') columns = [columns, &
      & [character(name_length) :: 'residual', 'load_step']]
    do b = 1, size(scene%boundaries)
      if (scene%boundaries(b)%name == '') cycle
      do c = 1, scene%header%dimension
        columns = [columns, [character(name_length) :: trim(scene%boundaries(b)%name)// &
          & '_reaction_'//directions(c:c)]]
      end do
    end do
  end function columns_of

  function hint(scene, name) result(note)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: name
    character(:), allocatable :: note, nearest
    character(name_length), allocatable :: names(:)
    integer :: p

    names = [character(name_length) :: (scene%probes(p)%name, p=1, size(scene%probes))]
    names = [names, columns_of(scene), [character(name_length) :: field_names]]
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

  !> The unit of an error, '' if it has none or is not known.
  pure function measure_unit(measure) result(unit)
    type(measure_type), intent(in) :: measure  !! with its norm
    character(:), allocatable :: unit

    unit = ''
    if (measure%norm /= 'relative') unit = quantity_unit(measure)
  end function measure_unit

  !> The unit of what is measured, '' if it has none or is not known.
  pure function quantity_unit(measure) result(unit)
    type(measure_type), intent(in) :: measure  !! with its kind and field
    character(:), allocatable :: unit

    unit = ''
    if (measure%kind == of_column) then
      if (index(measure%name, '_energy') > 0 .or. measure%name == 'external_work') unit = 'J'
      if (index(measure%name, '_reaction_') > 0) unit = 'N'
      return
    end if
    select case (measure%field)
    case ('displacement'); unit = 'm'
    case ('velocity'); unit = 'm/s'
    case ('force_density'); unit = 'N/m3'
    case ('energy_density'); unit = 'J/m3'
    case default  ! numbers without a unit
      unit = ''
    end select
  end function quantity_unit

end module pd_study_trade_measure
