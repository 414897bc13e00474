!> What a study compares with: a closed form, the finest run, or a file.
module pd_study_trade_reference
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: lower_case, to_text
  use pd_family_cells, only: cells_type
  use pd_output_fields_field, only: rank_scalar
  use pd_output_results_datasets, only: get_shape, read_rows
  use pd_output_results_hdf5, only: close_file, get_attribute, hdf5_file, object_exists, &
    & open_file, start_hdf5
  use pd_scene_format_table, only: column_of, read_table, table_type
  use pd_scene_content_types, only: name_length
  use pd_study_trade_closed_form, only: closed_form_type, field_at
  use pd_output_fields_interpolate, only: find_stencil, grid_of_places, rows_around, stencil_type
  use pd_study_trade_measure, only: difference, measure_type, of_column, of_field, record_type
  implicit none (type, external)
  private
  public :: judge_by_form, judge_by_record, read_reference

contains

  !> The error of a record by a closed form. `fault` is '' unless the form says nothing of what is
  !> measured.
  subroutine judge_by_form(form, measure, record, error_norm, fault)
    type(closed_form_type), intent(in) :: form       !! complete
    type(measure_type), intent(in) :: measure        !! a probe or a field
    type(record_type), intent(in) :: record          !! what the run showed
    real(wp), intent(out) :: error_norm  !! the error, in the norm of the measure; 0 with a fault
    character(:), allocatable, intent(out) :: fault  !! why there is no error; '' if there is one
    real(wp), allocatable :: reference(:, :, :), values(:)
    logical, allocatable :: of(:, :)
    integer :: p, r

    allocate (reference, mold=record%values)
    allocate (values(measure%field%components(form%dim)))
    allocate (of(size(record%x, 2), record%rows))
    reference = 0.0_wp
    do r = 1, record%rows
      do p = 1, size(record%x, 2)
        call field_at(form, measure%field, record%x(:, p), record%time(r), values, of(p, r))
        if (measure%component > 0) then
          reference(1, p, r) = values(measure%component)
        else
          reference(:, p, r) = values
        end if
      end do
    end do
    fault = ''
    error_norm = 0.0_wp
    if (.not. any(of)) then
      fault = "the closed form '"//form%name//"' has no values of '"//measure%name//"'"
      if (form%lower > -huge(1.0_wp)) fault = fault//', or only between x = '// &
        & to_text(form%lower)//' and '//to_text(form%upper)//' m, before waves from the ends arrive'
      return
    end if
    error_norm = difference(measure%norm, record, reference, of)
  end subroutine judge_by_form

  !> The error of a record by another one, that of the finest run or of a file: interpolated to the
  !> places and instants of `record`, as far as it reaches. `fault` is '' unless final states are of
  !> different times, or no place and instant of the run lies within those compared with.
  subroutine judge_by_record(truth, measure, record, error_norm, fault)
    type(record_type), intent(in) :: truth           !! what is compared with
    type(measure_type), intent(in) :: measure        !! what was measured, with its norm
    type(record_type), intent(in) :: record          !! what the run showed
    real(wp), intent(out) :: error_norm  !! the error, in the norm of the measure; 0 with a fault
    character(:), allocatable, intent(out) :: fault  !! why there is no error; '' if there is one
    type(cells_type) :: cells
    type(stencil_type) :: around, rows
    real(wp), allocatable :: reference(:, :, :)
    logical, allocatable :: of(:, :)
    integer :: p, r, i, j

    fault = ''
    error_norm = 0.0_wp
    if (measure%kind == of_field .and. .not. truth%timeless) then
      if (abs(truth%time(truth%rows) - record%time(record%rows)) > 1.0e-6_wp &
        & *abs(record%time(record%rows))) then
        fault = 'the final states are at different times, '//to_text(record%time(record%rows))// &
          & ' and '//to_text(truth%time(truth%rows))//' s; give &time a duration'
        return
      end if
    end if
    allocate (reference, mold=record%values)
    allocate (of(size(record%values, 2), record%rows), source=.false.)
    reference = 0.0_wp
    if (size(truth%x, 2) > 0) call grid_of_places(truth%x, truth%spacing, cells)
    do p = 1, size(of, 1)
      if (size(truth%x, 2) > 0) then
        call find_stencil(cells, truth%x, truth%spacing, record%x(:, p), around)
      else
        around = stencil_type([1], [1.0_wp])
      end if
      if (size(around%place) == 0) cycle
      do r = 1, record%rows
        if (measure%kind == of_field) then
          rows = stencil_type([truth%rows], [1.0_wp])
        else
          call rows_around(truth%time, record%time(r), rows)
        end if
        of(p, r) = size(rows%place) > 0
        do j = 1, size(rows%place)
          do i = 1, size(around%place)
            reference(:, p, r) = reference(:, p, r) + around%weight(i)*rows%weight(j) &
              & *truth%values(:, around%place(i), rows%place(j))
          end do
        end do
      end do
    end do
    if (.not. any(of)) then
      fault = 'no position and time of the run is inside the range of the reference'
      return
    end if
    error_norm = difference(measure%norm, record, reference, of)
  end subroutine judge_by_record

  !> What a file says of the measure: `.vtkhdf` results, or a table whose first line names its
  !> columns. Histories need `time` and the column itself or the probe's columns; fields need `x` ..
  !> and the field's columns. An error if the file cannot be read or lacks one of these.
  subroutine read_reference(path, measure, probe, dim, record, error)
    character(*), intent(in) :: path             !! of the file
    type(measure_type), intent(in) :: measure    !! what is measured
    character(*), intent(in) :: probe            !! name of the probe, '' without
    integer, intent(in) :: dim                   !! of the scene: 1, 2 or 3
    type(record_type), intent(out) :: record     !! what the file shows of it
    type(error_type), allocatable, intent(out) :: error

    if (ending(path) == '.vtkhdf') then
      call read_results(path, measure, probe, dim, record, error)
    else
      call read_columns(path, measure, probe, dim, record, error)
    end if
  end subroutine read_reference

  pure function ending(path) result(text)
    character(*), intent(in) :: path
    character(:), allocatable :: text
    text = path(max(1, index(path, '.', back=.true.)):)
  end function ending

  !> The columns in which the measure stands.
  pure function columns_of(measure, probe, dim) result(names)
    type(measure_type), intent(in) :: measure
    character(*), intent(in) :: probe
    integer, intent(in) :: dim
    character(name_length), allocatable :: names(:)
    character(:), allocatable :: stem
    integer :: c

    if (measure%kind == of_column) then
      names = [character(name_length) :: measure%name]
      return
    end if
    stem = trim(measure%field%name)
    if (len(probe) > 0) stem = probe//'_'//stem
    associate (field => measure%field)
      if (measure%component > 0) then
        names = [character(name_length) :: stem//'_'//field%component_name(measure%component, dim)]
      else if (field%rank == rank_scalar) then
        names = [character(name_length) :: stem]
      else
        names = [character(name_length) :: (stem//'_'//field%component_name(c, dim), &
          & c=1, field%components(dim))]
      end if
    end associate
  end function columns_of

  !> A table of text.
  subroutine read_columns(path, measure, probe, dim, record, error)
    character(*), intent(in) :: path, probe
    type(measure_type), intent(in) :: measure
    integer, intent(in) :: dim
    type(record_type), intent(inout) :: record
    type(error_type), allocatable, intent(out) :: error
    type(table_type) :: table
    character(name_length), allocatable :: names(:)
    integer, allocatable :: number(:)
    integer :: c, n, first

    call read_table(path, table, error, allowed=['*'])
    if (allocated(error)) return
    first = 1
    names = [[character(name_length) :: 'time'], columns_of(measure, probe, dim)]
    if (measure%kind == of_field) then
      first = dim
      names = [[character(name_length) :: 'x', 'y', 'z'], columns_of(measure, '', dim)]
      names = [names(:dim), names(4:)]
    end if
    number = [(column_of(table, lower_case(trim(names(c)))), c=1, size(names))]
    do c = 1, size(names)
      if (number(c) > 0) cycle
      call fail(error, "the file '"//path//"' has no column '"//trim(names(c))// &
        & "', which is compared with '"//measure%name//"'")
      return
    end do
    n = size(table%values, 2)
    if (measure%kind == of_field) then
      record%rows = 1
      record%time = [0.0_wp]
      record%timeless = .true.
      record%x = table%values(number(:dim), :)
      record%values = reshape(table%values(number(dim + 1:), :), [size(names) - first, n, 1])
      call guess_spacing(record)
    else
      record%rows = n
      record%time = table%values(number(1), :)
      allocate (record%x(dim, 0))
      record%values = reshape(table%values(number(2:), :), [size(names) - first, 1, n])
    end if
  end subroutine read_columns

  !> The mean spacing of places that fill their box.
  subroutine guess_spacing(record)
    type(record_type), intent(inout) :: record
    real(wp) :: extent(size(record%x, 1))

    extent = maxval(record%x, 2) - minval(record%x, 2)
    record%spacing = (product(max(extent, 1.0e-6_wp*maxval(extent))) &
      & /size(record%x, 2))**(1.0_wp/size(extent))
  end subroutine guess_spacing

  !> Results of a run: the last output's field, or the history.
  subroutine read_results(path, measure, probe, dim, record, error)
    character(*), intent(in) :: path, probe
    type(measure_type), intent(in) :: measure
    integer, intent(in) :: dim
    type(record_type), intent(inout) :: record
    type(error_type), allocatable, intent(out) :: error
    type(hdf5_file) :: file
    type(error_type), allocatable :: late

    call start_hdf5(error)
    if (allocated(error)) return
    call open_file(path, .false., file, error)
    if (allocated(error)) return
    if (measure%kind == of_field) then
      call read_field(path, file, measure, dim, record, error)
    else
      call read_history(path, file, columns_of(measure, probe, dim), dim, record, error)
    end if
    call close_file(file, late)
    if (.not. allocated(error) .and. allocated(late)) call move_alloc(late, error)
  end subroutine read_results

  !> Columns of the history of a results file.
  subroutine read_history(path, file, names, dim, record, error)
    character(*), intent(in) :: path
    type(hdf5_file), intent(in) :: file
    character(*), intent(in) :: names(:)
    integer, intent(in) :: dim
    type(record_type), intent(inout) :: record
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: column(:)
    integer(i8) :: rows
    integer :: c

    call get_attribute(file, '/history', 'rows', rows, error)
    if (allocated(error)) return
    allocate (record%time(rows), column(rows))
    allocate (record%values(size(names), 1, rows), record%x(dim, 0))
    record%rows = int(rows)
    call read_rows(file, '/history/time', 0_i8, record%time, error)
    do c = 1, size(names)
      if (allocated(error)) return
      if (.not. object_exists(file, '/history/'//trim(names(c)))) then
        call fail(error, "the history in '"//path//"' has no column '"//trim(names(c))//"'")
        return
      end if
      call read_rows(file, '/history/'//trim(names(c)), 0_i8, column, error)
      record%values(c, 1, :) = column
    end do
  end subroutine read_history

  !> The last output of a field of a results file, at the points of the bodies.
  subroutine read_field(path, file, measure, dim, record, error)
    character(*), intent(in) :: path
    type(hdf5_file), intent(in) :: file
    type(measure_type), intent(in) :: measure
    integer, intent(in) :: dim
    type(record_type), intent(inout) :: record
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: x(:, :), values(:, :), line(:), times(:)
    integer(i8), allocatable :: layer(:)
    character(:), allocatable :: path_of_field
    integer(i8) :: outputs, n, each, rows
    integer, allocatable :: kept(:)
    integer :: components, i

    path_of_field = '/VTKHDF/PointData/'//trim(measure%field%name)
    if (.not. object_exists(file, path_of_field)) then
      call fail(error, "the results in '"//path//"' have no field '"//trim(measure%field%name)//"'")
      return
    end if
    call get_attribute(file, '/VTKHDF/Steps', 'NSteps', outputs, error)
    if (.not. allocated(error)) call get_shape(file, '/points/layer', components, n, error)
    ! with cells their nodes stand behind the points
    if (.not. allocated(error)) call get_shape(file, '/VTKHDF/Points', components, each, error)
    if (allocated(error)) return
    allocate (x(3, n), layer(n), times(outputs))
    call read_rows(file, '/VTKHDF/Points', 0_i8, x, error)
    if (.not. allocated(error)) call read_rows(file, '/points/layer', 0_i8, layer, error)
    if (.not. allocated(error)) call read_rows(file, '/VTKHDF/Steps/Values', 0_i8, times, error)
    if (allocated(error)) return
    call get_shape(file, path_of_field, components, rows, error)
    if (allocated(error)) return
    if (components == 1) then
      allocate (line(n))
      call read_rows(file, path_of_field, (outputs - 1)*each, line, error)
      values = reshape(line, [1, size(line)])
    else
      allocate (values(components, n))
      call read_rows(file, path_of_field, (outputs - 1)*each, values, error)
    end if
    if (allocated(error)) return
    kept = pack([(i, i=1, int(n))], layer == 0)
    record%rows = 1
    record%time = [times(outputs)]
    record%x = x(:dim, kept)
    if (measure%component > 0) values = values(measure%component:measure%component, :)
    components = min(size(values, 1), measure%field%components(dim))
    record%values = reshape(values(:components, kept), [components, size(kept), 1])
    call guess_spacing(record)
  end subroutine read_field

end module pd_study_trade_reference
