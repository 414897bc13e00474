!> Results written by the public interface and read back through HDF5 and as text.
module test_output_results_results
  use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
  use pd_base_error, only: failure_type => error_type
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_text, only: to_text
  use pd_output_results_datasets, only: get_shape, read_rows
  use pd_output_checkpoint_earlier, only: existing_results, refuse_existing
  use pd_output_results_files, only: file_bytes, file_exists
  use pd_output_results_hdf5, only: close_file, get_attribute, hdf5_file, object_exists, open_file
  use pd_output_results_results, only: column_type, field_type, results_type
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_output_results_results

  character(*), parameter :: here = 'build/test_output_results_results'

  interface
    !> How many identifiers of a kind HDF5 has given out and not got back.
    integer(c_int) function h5_members(kind, number) bind(c, name='H5Inmembers')
      import :: c_int, c_int64_t
      implicit none (type, external)
      integer(c_int), value :: kind
      integer(c_int64_t), intent(out) :: number
    end function h5_members
  end interface

contains

  subroutine collect_output_results_results(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)

    testsuite = [ &
      & new_unittest('as_planned', as_planned), &
      & new_unittest('single_precision', single_precision), &
      & new_unittest('more_than_planned', more_than_planned), &
      & new_unittest('growth_within_an_output', growth_within_an_output), &
      & new_unittest('less_than_planned', less_than_planned), &
      & new_unittest('no_output_at_all', no_output_at_all), &
      & new_unittest('rows_without_output', rows_without_output), &
      & new_unittest('nothing_stays_open', nothing_stays_open), &
      & new_unittest('refuses_to_overwrite', refuses_to_overwrite), &
      & new_unittest('old_results_live_until_the_first_output', old_results_live), &
      & new_unittest('overwrite_removes_other_formats', overwrite_removes_other_formats), &
      & new_unittest('history_table', history_table), &
      & new_unittest('files_for_each_output', files_for_each_output), &
      & new_unittest('incomplete_output_does_not_count', incomplete_output), &
      & new_unittest('bad_calls', bad_calls), &
      & new_unittest('bad_descriptions', bad_descriptions), &
      & new_unittest('place_that_cannot_be_written', place_that_cannot_be_written) &
      & ]
  end subroutine collect_output_results_results

  !> Displacement of point `i` in output `k`, component `c`: exact in single precision.
  pure elemental real(wp) function value(k, i, c)
    integer, intent(in) :: k, i, c
    value = 1000*k + 4*mod(i, 100) + c + 0.25_wp
  end function value

  !> Begin results of `n` points in `here`, with a vector, a scalar and two columns.
  subroutine begin(results, stem, n, outputs, rows, failure, format, precision, overwrite)
    type(results_type), intent(inout) :: results
    character(*), intent(in) :: stem
    integer, intent(in) :: n, outputs, rows
    type(failure_type), allocatable, intent(out) :: failure
    character(*), intent(in), optional :: format, precision
    logical, intent(in), optional :: overwrite
    type(field_type) :: fields(2)
    type(column_type) :: columns(2)
    real(wp), allocatable :: positions(:, :)
    character(8) :: the_format, the_precision
    logical :: replace
    integer :: i

    fields(1) = field_type('displacement', 3, 'm')
    fields(2) = field_type('damage', 1, '1')
    columns(1) = column_type('time', 's')
    columns(2) = column_type('strain_energy', 'J')
    allocate (positions(n, 3), source=0.0_wp)
    positions(:, 1) = [(0.5_wp*i, i=1, n)]
    the_format = 'vtkhdf'
    if (present(format)) the_format = format
    the_precision = 'double'
    if (present(precision)) the_precision = precision
    replace = .true.
    if (present(overwrite)) replace = overwrite
    call results%create(here, stem, positions, fields, outputs, columns, rows, &
      & trim(the_precision), trim(the_format), '&scene /', 'perifort run', '1.2.3', replace, &
      & failure)
  end subroutine begin

  !> Write outputs `first` .. `last`, each after `rows` history rows.
  subroutine write_outputs(results, n, first, last, rows, failure)
    type(results_type), intent(inout) :: results
    integer, intent(in) :: n, first, last, rows
    type(failure_type), allocatable, intent(out) :: failure
    real(wp), allocatable :: u(:, :), d(:)
    integer :: k, i, c

    allocate (u(n, 3), d(n))
    do k = first, last
      do i = 1, rows
        call results%add_row([real(k*rows + i, wp), -real(k*rows + i, wp)], failure)
        if (allocated(failure)) return
      end do
      do i = 1, n
        u(i, :) = [(value(k, i, c), c=1, 3)]
        d(i) = value(k, i, 0)
      end do
      call results%begin_output(0.125_wp*k, failure)
      if (.not. allocated(failure)) call results%put_field('displacement', u, failure)
      if (.not. allocated(failure)) call results%put_field(2, d, failure)
      if (.not. allocated(failure)) call results%end_output(failure)
      if (allocated(failure)) return
    end do
  end subroutine write_outputs

  !> Everything about a complete file of `n` points, `outputs` outputs and `rows` rows.
  subroutine check_file(error, stem, n, outputs, rows)
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in) :: stem
    integer, intent(in) :: n, outputs, rows
    type(failure_type), allocatable :: failure
    type(hdf5_file) :: file
    character(*), parameter :: scalars(6) = [character(40) :: 'Values', 'PartOffsets', &
      & 'PointOffsets', 'NumberOfParts', 'PointDataOffsets/displacement', 'PointDataOffsets/damage']
    real(wp), allocatable :: u(:, :), d(:), times(:), column(:)
    integer(i8), allocatable :: offsets(:)
    integer(i8) :: count, steps
    integer :: components, i, k, c

    call open_file(here//'/'//stem//'.vtkhdf', .false., file, failure)
    if (allocated(failure)) then
      call test_failed(error, failure%message)
      return
    end if
    checks: block
      call get_attribute(file, '/VTKHDF/Steps', 'NSteps', steps, failure)
      call check(error, int(steps), outputs, 'NSteps')
      if (allocated(error)) exit checks
      do i = 1, size(scalars)
        call get_shape(file, '/VTKHDF/Steps/'//trim(scalars(i)), components, count, failure)
        call check(error, int(count), outputs, trim(scalars(i)))
        if (allocated(error)) exit checks
      end do
      call get_shape(file, '/VTKHDF/Steps/CellOffsets', components, count, failure)
      call check(error, components == 4 .and. count == outputs, 'CellOffsets')
      if (allocated(error)) exit checks
      call get_shape(file, '/VTKHDF/PointData/displacement', components, count, failure)
      call check(error, components == 3 .and. count == outputs*n, 'shape of displacement')
      if (allocated(error)) exit checks
      call get_shape(file, '/VTKHDF/PointData/damage', components, count, failure)
      call check(error, components == 1 .and. count == outputs*n, 'shape of damage')
      if (allocated(error)) exit checks
      call get_shape(file, '/VTKHDF/Points', components, count, failure)
      call check(error, components == 3 .and. count == n, 'shape of Points')
      if (allocated(error)) exit checks

      allocate (u(3, n), d(n), times(outputs), offsets(outputs))
      call read_rows(file, '/VTKHDF/Points', 0_i8, u, failure)
      call check(error, all(abs(u(1, :) - [(0.5_wp*i, i=1, n)]) <= 0.0_wp), 'Points')
      if (allocated(error)) exit checks
      call read_rows(file, '/VTKHDF/Steps/Values', 0_i8, times, failure)
      call check(error, all(abs(times - [(0.125_wp*k, k=0, outputs - 1)]) <= 0.0_wp), 'Values')
      if (allocated(error)) exit checks
      call read_rows(file, '/VTKHDF/Steps/PointDataOffsets/damage', 0_i8, offsets, failure)
      call check(error, all(offsets == [(int(k, i8)*n, k=0, outputs - 1)]), 'PointDataOffsets')
      if (allocated(error)) exit checks
      do k = 0, outputs - 1
        call read_rows(file, '/VTKHDF/PointData/displacement', int(k, i8)*n, u, failure)
        call read_rows(file, '/VTKHDF/PointData/damage', int(k, i8)*n, d, failure)
        do c = 1, 3
          call check(error, all(abs(u(c, :) - [(value(k, i, c), i=1, n)]) <= 0.0_wp), &
            & 'displacement of output '//to_text(k))
          if (allocated(error)) exit checks
        end do
        call check(error, all(abs(d - [(value(k, i, 0), i=1, n)]) <= 0.0_wp), &
          & 'damage of output '//to_text(k))
        if (allocated(error)) exit checks
      end do

      call get_attribute(file, '/history', 'rows', count, failure)
      call check(error, int(count), rows, 'rows of the history')
      if (allocated(error)) exit checks
      call get_shape(file, '/history/strain_energy', components, count, failure)
      call check(error, int(count), rows, 'length of a column')
      if (allocated(error)) exit checks
      allocate (column(rows))
      call read_rows(file, '/history/strain_energy', 0_i8, column, failure)
      call check(error, all(abs(column + [(real(i, wp), i=1, rows)]) <= 0.0_wp), 'column')
      if (allocated(error)) exit checks
      call check(error, all([object_exists(file, '/scene/text'), &
        & object_exists(file, '/scene/command')]), 'scene')
    end block checks
    call close_file(file, failure)
    if (allocated(error)) return
    call check(error,.not. file_exists(here//'/'//stem//'.vtkhdf.part'), 'a part is left behind')
    if (allocated(error)) return
    call check(error,.not. file_exists(here//'/'//stem//'.vtkhdf.grow'), 'a copy is left behind')
  end subroutine check_file

  !> Write a whole file and check it.
  subroutine whole(error, stem, n, outputs, planned, rows, planned_rows, precision)
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in) :: stem
    integer, intent(in) :: n, outputs, planned, rows, planned_rows
    character(*), intent(in), optional :: precision
    type(failure_type), allocatable :: failure
    type(results_type) :: results

    call begin(results, stem, n, planned, planned_rows, failure, precision=precision)
    if (.not. allocated(failure)) &
      & call write_outputs(results, n, 0, outputs - 1, rows, failure)
    if (.not. allocated(failure)) call results%close(failure)
    if (allocated(failure)) then
      call test_failed(error, failure%message)
      return
    end if
    call check_file(error, stem, n, outputs, outputs*rows)
  end subroutine whole

  subroutine as_planned(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results
    type(hdf5_file) :: file
    real(wp) :: volume(7)
    integer(i8) :: count
    integer :: components, i

    call begin(results, 'planned', 7, 3, 12, failure)
    if (.not. allocated(failure)) &
      & call results%put_points('volume', [(0.5_wp*i, i=1, 7)], failure)
    if (.not. allocated(failure)) call results%put_points('body', [(1_i4, i=1, 7)], failure)
    if (.not. allocated(failure)) call results%put_points('region_left', [(0_i1, i=1, 7)], failure)
    if (.not. allocated(failure)) call write_outputs(results, 7, 0, 2, 4, failure)
    if (.not. allocated(failure)) call results%close(failure)
    if (allocated(failure)) then
      call test_failed(error, failure%message)
      return
    end if
    call check_file(error, 'planned', 7, 3, 12)
    if (allocated(error)) return
    call open_file(here//'/planned.vtkhdf', .false., file, failure)
    call get_shape(file, '/points/region_left', components, count, failure)
    call read_rows(file, '/points/volume', 0_i8, volume, failure)
    call check(error, count == 7_i8 .and. abs(sum(volume) - 14.0_wp) <= 0.0_wp, 'points')
    call close_file(file, failure)
  end subroutine as_planned

  subroutine single_precision(error)
    type(error_type), allocatable, intent(out) :: error

    call whole(error, 'single', 5, 3, 3, 4, 12, 'single')
    if (allocated(error)) return
    call whole(error, 'single_grown', 5, 7, 2, 4, 3, 'single')
  end subroutine single_precision

  subroutine more_than_planned(error)
    type(error_type), allocatable, intent(out) :: error

    call whole(error, 'more', 11, 9, 2, 1, 9)
    if (allocated(error)) return
    call whole(error, 'unknown', 3, 40, 0, 2, 0)
    if (allocated(error)) return
    ! more points than are converted at a time
    call whole(error, 'many_points', 70000, 3, 1, 1, 1)
  end subroutine more_than_planned

  !> The history outgrows its room while an output's fields are written and not yet counted.
  subroutine growth_within_an_output(error)
    type(error_type), allocatable, intent(out) :: error
    call whole(error, 'growth', 11, 5, 5, 10, 15)
  end subroutine growth_within_an_output

  subroutine less_than_planned(error)
    type(error_type), allocatable, intent(out) :: error

    call whole(error, 'less', 11, 3, 50, 2, 100)
    if (allocated(error)) return
    call whole(error, 'less_in_chunks', 10000, 2, 5, 2, 100)
  end subroutine less_than_planned

  subroutine no_output_at_all(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results

    call begin(results, 'nothing', 4, 3, 3, failure)
    if (.not. allocated(failure)) call results%close(failure)
    call check(error,.not. allocated(failure))
    if (allocated(error)) return
    call check(error,.not. file_exists(here//'/nothing.vtkhdf'), 'an empty file is left')
    if (allocated(error)) return
    call check(error,.not. file_exists(here//'/nothing.vtkhdf.part'), 'a part is left')
  end subroutine no_output_at_all

  subroutine rows_without_output(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results

    call begin(results, 'rows', 4, 3, 3, failure)
    if (.not. allocated(failure)) call results%add_row([1.0_wp, -1.0_wp], failure)
    if (.not. allocated(failure)) call results%close(failure)
    call check(error,.not. allocated(failure))
    if (allocated(error)) return
    call check_file(error, 'rows', 4, 0, 1)
  end subroutine rows_without_output

  !> Results that are written and read leave no file, group, type, space, set or attribute open:
  !> otherwise thousands of runs in one program would become slower and slower.
  subroutine nothing_stays_open(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: kinds = 6   ! H5I_FILE to H5I_ATTR
    integer(c_int64_t) :: before(kinds), after(kinds)
    integer :: i

    call whole(error, 'open', 4, 2, 2, 1, 2)
    if (allocated(error)) return
    call count_open(before)
    do i = 1, 3
      call whole(error, 'open', 4, 2, 2, 1, 2)
      if (allocated(error)) return
    end do
    call count_open(after)
    call check(error, all(after == before), 'identifiers of HDF5 stay open')
    if (allocated(error)) return
    call check(error, all(after([1, 2, 5, 6]) == 0), 'a file, a group or a set is open')

  contains

    subroutine count_open(number)
      integer(c_int64_t), intent(out) :: number(kinds)
      integer :: kind

      do kind = 1, kinds
        if (h5_members(int(kind, c_int), number(kind)) < 0) number(kind) = 0
      end do
    end subroutine count_open
  end subroutine nothing_stays_open

  subroutine refuses_to_overwrite(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results

    call whole(error, 'kept', 4, 2, 2, 1, 2)
    if (allocated(error)) return
    call refuse_existing(here, 'kept', .true., failure)
    call check(error,.not. allocated(failure), '--overwrite is not heard')
    if (allocated(error)) return
    call refuse_existing(here, 'kept', .false., failure)
    call check(error, allocated(failure), 'old results are not seen')
    if (allocated(error)) return
    call check(error, index(failure%message, here//'/kept.vtkhdf') > 0 .and. &
      & index(failure%message, '--overwrite') > 0, failure%message)
    if (allocated(error)) return
    call begin(results, 'kept', 4, 2, 2, failure, overwrite=.false.)
    call check(error, allocated(failure), 'create writes over old results')
    if (allocated(error)) return
    call check_file(error, 'kept', 4, 2, 2)
    if (allocated(error)) return
    call check(error, existing_results(here//'/nowhere', 'kept'), '')
  end subroutine refuses_to_overwrite

  subroutine old_results_live(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results
    integer(i8) :: bytes

    call whole(error, 'old', 4, 2, 2, 1, 2)
    if (allocated(error)) return
    bytes = file_bytes(here//'/history.csv')
    call begin(results, 'old', 6, 3, 3, failure)
    if (.not. allocated(failure)) call results%add_row([1.0_wp, 2.0_wp], failure)
    if (.not. allocated(failure)) call results%begin_output(0.0_wp, failure)
    call check(error,.not. allocated(failure))
    if (allocated(error)) return
    call check_file_during(error)
    if (allocated(error)) return
    call check(error, file_bytes(here//'/history.csv') == bytes, 'the old table is changed')
    if (allocated(error)) return
    call results%close(failure)
    call check(error,.not. allocated(failure))
    if (allocated(error)) return
    call whole(error, 'old', 6, 3, 3, 1, 3)
  contains
    subroutine check_file_during(error)
      type(error_type), allocatable, intent(out) :: error
      type(hdf5_file) :: file
      integer(i8) :: count
      integer :: components

      call open_file(here//'/old.vtkhdf', .false., file, failure)
      call check(error,.not. allocated(failure), 'the old file is gone')
      if (allocated(error)) return
      call get_shape(file, '/VTKHDF/Points', components, count, failure)
      call check(error, int(count), 4)
      call close_file(file, failure)
    end subroutine check_file_during
  end subroutine old_results_live

  subroutine overwrite_removes_other_formats(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: first, second

    call begin(first, 'both', 4, 3, 3, failure, format='both')
    if (.not. allocated(failure)) call write_outputs(first, 4, 0, 2, 1, failure)
    if (.not. allocated(failure)) call first%close(failure)
    call check(error, all([.not. allocated(failure), file_exists(here//'/both_000002.vtu'), &
      & file_exists(here//'/both.pvd')]), 'no series')
    if (allocated(error)) return
    call check_file(error, 'both', 4, 3, 3)
    if (allocated(error)) return
    call begin(second, 'both', 4, 1, 1, failure, format='vtkhdf')
    if (.not. allocated(failure)) call write_outputs(second, 4, 0, 0, 1, failure)
    if (.not. allocated(failure)) call second%close(failure)
    call check(error,.not. any([allocated(failure), file_exists(here//'/both_000000.vtu'), &
      & file_exists(here//'/both_000002.vtu'), file_exists(here//'/both.pvd')]), &
      & 'parts of the old run are left among the new one''s')
    if (allocated(error)) return
    call check_file(error, 'both', 4, 1, 1)
  end subroutine overwrite_removes_other_formats

  subroutine history_table(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results
    real(wp) :: row(2), given(2, 600)
    character(100) :: line
    integer :: unit, i, status

    call begin(results, 'table', 3, 2, 600, failure)
    do i = 1, 600  ! more than wait at first
      given(:, i) = [real(i, wp)/3.0_wp, -1.0e-300_wp*i]
      if (.not. allocated(failure)) call results%add_row(given(:, i), failure)
    end do
    if (.not. allocated(failure)) call results%close(failure)
    call check(error,.not. allocated(failure))
    if (allocated(error)) return
    open (newunit=unit, file=here//'/history.csv', status='old', action='read')
    read (unit, '(a)') line
    call check(error, trim(line), 'time,strain_energy')
    do i = 1, 600
      if (allocated(error)) exit
      read (unit, '(a)', iostat=status) line
      call check(error, status == 0 .and. index(trim(line), ' ') == 0, 'line '//to_text(i))
      if (allocated(error)) exit
      read (line, *) row
      ! all digits: the same bits come back
      call check(error, all(abs(row - given(:, i)) <= 0.0_wp), 'row '//to_text(i))
    end do
    if (.not. allocated(error)) then
      read (unit, '(a)', iostat=status) line
      call check(error, status /= 0, 'more rows than were given')
    end if
    close (unit)
  end subroutine history_table

  subroutine files_for_each_output(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results
    character(400) :: line
    logical :: found
    integer :: unit, status

    call begin(results, 'series', 1, 2, 2, failure, format='vtu')
    if (.not. allocated(failure)) call write_outputs(results, 1, 0, 1, 1, failure)
    if (.not. allocated(failure)) call results%close(failure)
    call check(error,.not. allocated(failure))
    if (allocated(error)) return
    call check(error,.not. file_exists(here//'/series.vtkhdf'), 'an HDF5 file nobody wanted')
    if (allocated(error)) return
    found = .false.
    open (newunit=unit, file=here//'/series_000000.vtu', status='old', action='read')
    do
      read (unit, '(a)', iostat=status) line
      if (status /= 0) exit
      ! eight bytes of length (8, little endian) and the number 0.25 + 4 of the first point
      if (index(line, 'Name="damage"') > 0) &
        & found = index(line, '>CAAAAAAAAAAAAAAAAAARQA==</DataArray>') > 0
    end do
    close (unit)
    call check(error, found, 'the scalar''s bytes are not as expected')
    if (allocated(error)) return
    found = .false.
    open (newunit=unit, file=here//'/series.pvd', status='old', action='read')
    do
      read (unit, '(a)', iostat=status) line
      if (status /= 0) exit
      if (index(line, 'timestep="1.2500000000000000E-001"') > 0) &
        & found = index(line, 'file="series_000001.vtu"') > 0
    end do
    close (unit)
    call check(error, found, 'the second output is not listed')
  end subroutine files_for_each_output

  !> An output that was begun and not ended is no output.
  subroutine incomplete_output(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results

    call begin(results, 'incomplete', 4, 5, 5, failure, format='both')
    if (.not. allocated(failure)) call write_outputs(results, 4, 0, 1, 1, failure)
    if (.not. allocated(failure)) call results%begin_output(9.0_wp, failure)
    if (.not. allocated(failure)) &
      & call results%put_field('damage', [1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], failure)
    call check(error,.not. allocated(failure))
    if (allocated(error)) return
    call results%end_output(failure)
    call check(error, allocated(failure), 'an output without one of its fields')
    if (allocated(error)) return
    call results%close(failure)
    call check(error,.not. allocated(failure))
    if (allocated(error)) return
    call check(error,.not. file_exists(here//'/incomplete_000002.vtu'))
    if (allocated(error)) return
    call check_file(error, 'incomplete', 4, 2, 2)
  end subroutine incomplete_output

  subroutine bad_calls(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results

    call begin(results, 'calls', 4, 5, 5, failure)
    call check(error,.not. allocated(failure))
    if (allocated(error)) return
    call results%put_field('damage', [1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], failure)
    call expect('outside an output')
    call results%add_row([1.0_wp], failure)
    call expect('1 values for 2')
    call results%begin_output(0.0_wp, failure)
    call results%put_field('damage', [1.0_wp, 2.0_wp], failure)
    call expect('4 x 1, not 2 x 1')
    call results%put_field('displacement', [1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], failure)
    call expect('4 x 3, not 4 x 1')
    call results%put_field('speed', [1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], failure)
    call expect('displacement, damage')
    call results%put_field(3, [1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], failure)
    call expect('no field 3')
    call results%put_field(2, [1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], failure)
    call results%put_field(2, [1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], failure)
    call expect('twice')
    call results%put_points('late', [1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], failure)
    call expect('before the first output')
    call results%close(failure)
    call results%add_row([1.0_wp, 2.0_wp], failure)
    call expect('not open')
  contains
    subroutine expect(words)
      character(*), intent(in) :: words
      if (allocated(error)) return
      call check(error, allocated(failure), 'no error about: '//words)
      if (allocated(error)) return
      call check(error, index(failure%message, words) > 0, failure%message)
    end subroutine expect
  end subroutine bad_calls

  subroutine bad_descriptions(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results
    type(column_type) :: columns(2)
    real(wp) :: positions(2, 3)

    call begin(results, 'bad', 4, 5, 5, failure, format='xdmf')
    call check(error, allocated(failure), 'an unknown format')
    if (allocated(error)) return
    call check(error, index(failure%message, 'vtkhdf, vtu, both') > 0, failure%message)
    if (allocated(error)) return
    call begin(results, 'bad', 4, 5, 5, failure, precision='half')
    call check(error, allocated(failure), 'an unknown precision')
    if (allocated(error)) return
    positions = 0.0_wp
    columns(:)%name = 'time'
    call results%create(here, 'bad', positions, [field_type('damage', 1, '1')], 1, columns, 1, &
      & 'double', 'vtkhdf', '', '', '', .true., failure)
    call check(error, allocated(failure), 'two columns of one name')
    if (allocated(error)) return
    call results%create(here, 'bad', positions, [field_type('a/b', 1, '1')], 1, columns(:1), 1, &
      & 'double', 'vtkhdf', '', '', '', .true., failure)
    call check(error, allocated(failure), 'a field that is a path')
    if (allocated(error)) return
    call results%create(here, 'bad', positions, [field_type('u', 2, 'm')], 1, columns(:1), 1, &
      & 'double', 'vtkhdf', '', '', '', .true., failure)
    call check(error, allocated(failure), 'a field of two components')
    if (allocated(error)) return
    call check(error,.not. file_exists(here//'/bad.vtkhdf.part'))
  end subroutine bad_descriptions

  subroutine place_that_cannot_be_written(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results
    real(wp) :: positions(2, 3)

    positions = 0.0_wp
    call results%create('/dev/null/results', 'x', positions, [field_type('damage', 1, '1')], 1, &
      & [column_type('time', 's')], 1, 'double', 'vtkhdf', '', '', '', .true., failure)
    call check(error, allocated(failure))
    if (allocated(error)) return
    call check(error, index(failure%message, '/dev/null/results') > 0, failure%message)
  end subroutine place_that_cannot_be_written

end module test_output_results_results
