!> Arrays in an HDF5 file: datasets of fixed size and series whose rows grow.
!>
!> Arrays of several components are `values(component, row)` in memory and (row, component) for
!> readers in C's order. Rows count from 0.
!>
!> An error is set if HDF5 fails (no such dataset, a name that is taken, a write that the system
!> refuses): it names the file and HDF5's reason.
module pd_output_results_datasets
  use, intrinsic :: iso_c_binding, only: c_bool, c_int, c_int64_t, c_loc, c_ptr
  use hdf5, only: H5D_ALLOC_TIME_EARLY_F, H5D_FILL_TIME_NEVER_F, H5P_DATASET_CREATE_F, &
    & H5P_DEFAULT_F, &
    & H5S_SELECT_SET_F, H5S_UNLIMITED_F, H5T_IEEE_F32LE, H5T_IEEE_F64LE, H5T_STD_I32LE, &
    & H5T_STD_I64LE, H5T_STD_I8LE, H5T_STD_U8LE, h5dclose_f, h5dcreate_f, &
    & h5dget_create_plist_f, h5dget_space_f, h5dopen_f, &
    & h5dread_f, h5dset_extent_f, h5dwrite_f, h5pclose_f, h5pcreate_f, h5pset_alloc_time_f, &
    & h5pget_chunk_f, h5pset_chunk_f, h5pset_fill_time_f, h5pset_virtual_f, h5sclose_f, &
    & h5screate_simple_f, &
    & h5sget_simple_extent_dims_f, h5sget_simple_extent_ndims_f, h5sselect_hyperslab_f, hid_t, &
    & hsize_t
  use pd_base_error, only: error_type, fail, internal_fault
  use pd_base_kinds, only: wp, sp, i1, i4, i8
  use pd_output_results_hdf5, only: explain, hdf5_file
  implicit none (type, external)
  private
  public :: put_array, make_dataset, make_series, write_rows, read_rows, set_rows, get_shape
  public :: put_unsigned, get_chunk, make_view, settled_properties, storage_f8, storage_f4, &
    & storage_i8, storage_i4, storage_i1

  integer, parameter :: storage_f8 = 1  !! 64-bit real
  integer, parameter :: storage_f4 = 2  !! 32-bit real
  integer, parameter :: storage_i8 = 3  !! 64-bit integer
  integer, parameter :: storage_i4 = 4  !! 32-bit integer
  integer, parameter :: storage_i1 = 5  !! 8-bit integer
  integer, parameter :: storage_u1 = 6  !! 8-bit integer without sign

  !> Write a whole array as a dataset of its own, or one value as a dataset of shape (1).
  interface put_array
    module procedure :: put_array_real, put_array_i1, put_array_i4, put_array_i8
  end interface put_array

  !> Write rows `first` .. (counted from 0) of a dataset: `values(row)` or `values(component, row)`.
  interface write_rows
    module procedure :: write_rows_real, write_rows_single, write_rows_i8, write_rows_i4, &
      & write_rows_i1, write_table_real, write_table_single, write_table_i8
  end interface write_rows

  !> Read rows of a dataset, as `write_rows` writes them.
  interface read_rows
    module procedure :: read_rows_real, read_rows_i8, read_table_real
  end interface read_rows

  interface
    integer(c_int) function h5_track_times(properties, track) bind(c, &
      & name='H5Pset_obj_track_times')
      import :: c_bool, c_int, c_int64_t
      implicit none (type, external)
      integer(c_int64_t), value :: properties
      logical(c_bool), value :: track
    end function h5_track_times
  end interface

contains

  !> HDF5's identifier of a kind of number.
  integer(hid_t) function storage_id(storage)
    integer, intent(in) :: storage

    select case (storage)
    case (storage_f8)
      storage_id = H5T_IEEE_F64LE
    case (storage_f4)
      storage_id = H5T_IEEE_F32LE
    case (storage_i8)
      storage_id = H5T_STD_I64LE
    case (storage_i4)
      storage_id = H5T_STD_I32LE
    case (storage_i1)
      storage_id = H5T_STD_I8LE
    case (storage_u1)
      storage_id = H5T_STD_U8LE
    case default
      storage_id = -1
      call internal_fault('storage_id does not know a kind of number')
    end select
  end function storage_id

  !> Make a dataset of fixed size: `rows`, or `rows` x `components` if that is above 1.
  !> Its place in the file is set aside at once; its values are undefined until written.
  subroutine make_dataset(file, path, storage, components, rows, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer, intent(in) :: storage       !! kind of its numbers: `storage_f8`, `storage_f4`,
                                         !! `storage_i8`, ...
    integer, intent(in) :: components    !! numbers in a row
    integer(i8), intent(in) :: rows      !! their number, for good
    type(error_type), allocatable, intent(out) :: error

    call make_any(file, path, storage, components, rows, 0_i8, error)
  end subroutine make_dataset

  !> Make a dataset whose number of rows can change, stored in blocks of `chunk` rows.
  !> The blocks of its first `rows` are set aside at once and not filled, so that
  !> writing them later changes none of the file's own records.
  subroutine make_series(file, path, storage, components, rows, chunk, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer, intent(in) :: storage       !! kind of its numbers: `storage_f8`, `storage_f4`,
                                         !! `storage_i8`, ...
    integer, intent(in) :: components    !! numbers in a row
    integer(i8), intent(in) :: rows      !! their number to begin with
    integer(i8), intent(in) :: chunk     !! rows of a block; less than 1 is taken as 1
    type(error_type), allocatable, intent(out) :: error

    call make_any(file, path, storage, components, rows, max(1_i8, chunk), error)
  end subroutine make_series

  !> Properties of a new dataset whose place in the file is set aside at once and not filled, so
  !> that writing its values changes none of the file's own records. To be closed by the caller.
  subroutine settled_properties(properties, status)
    integer(hid_t), intent(out) :: properties  !! HDF5's identifier
    integer, intent(out) :: status             !! is 0 where they are there

    call h5pcreate_f(H5P_DATASET_CREATE_F, properties, status)
    ! times of change would be one more record to keep
    if (status == 0) status = int(h5_track_times(properties, .false._c_bool))
    if (status == 0) call h5pset_alloc_time_f(properties, H5D_ALLOC_TIME_EARLY_F, status)
    if (status == 0) call h5pset_fill_time_f(properties, H5D_FILL_TIME_NEVER_F, status)
  end subroutine settled_properties

  subroutine make_any(file, path, storage, components, rows, chunk, error)
    type(hdf5_file), intent(in) :: file
    character(*), intent(in) :: path
    integer, intent(in) :: storage, components
    integer(i8), intent(in) :: rows, chunk
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: space, properties, dataset
    integer(hsize_t) :: extent(2), most(2)
    integer :: rank, status, ignored

    ! the Fortran interface reverses the order of dimensions
    rank = merge(2, 1, components > 1)
    extent = [int(components, hsize_t), int(rows, hsize_t)]
    if (rank == 1) extent(1) = extent(2)
    most = extent
    if (chunk > 0) most(rank) = H5S_UNLIMITED_F

    call settled_properties(properties, status)
    if (status == 0 .and. chunk > 0) then
      if (rank == 1) then
        call h5pset_chunk_f(properties, 1, [int(chunk, hsize_t)], status)
      else
        call h5pset_chunk_f(properties, 2, [int(components, hsize_t), int(chunk, hsize_t)], status)
      end if
    end if
    if (status == 0) call h5screate_simple_f(rank, extent(:rank), space, status, most(:rank))
    if (status == 0) then
      call h5dcreate_f(file%id, path, storage_id(storage), space, dataset, status, &
        & dcpl_id=properties)
      if (status == 0) call h5dclose_f(dataset, status)
      if (status /= 0) call explain(error, 'make '//path//' in', file%name)
      call h5sclose_f(space, ignored)
    else
      call explain(error, 'describe '//path//' of', file%name)
    end if
    call h5pclose_f(properties, ignored)
  end subroutine make_any

  !> Make a dataset that has no values of its own but shows rows of another one in the same file
  !> (HDF5's virtual datasets): all components of them, or one.
  subroutine make_view(file, path, storage, source, components, total, first, rows, component, &
    & error)
    type(hdf5_file), intent(in) :: file  !! open and writable
    character(*), intent(in) :: path     !! of the new dataset
    integer, intent(in) :: storage       !! kind of the numbers of the other one
    character(*), intent(in) :: source   !! path of the other one
    integer, intent(in) :: components    !! numbers in a row of the other one
    integer(i8), intent(in) :: total     !! rows of the other one, at least `first + rows`
    integer(i8), intent(in) :: first     !! row that is shown first, from 0
    integer(i8), intent(in) :: rows      !! how many are shown
    integer, intent(in) :: component     !! the one that is shown, from 1; 0: all
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: here, there, properties, dataset
    integer(hsize_t) :: extent(2), most(2), start(2), count(2)
    integer :: rank, shown, status, ignored

    rank = merge(2, 1, components > 1)
    shown = merge(2, 1, components > 1 .and. component == 0)
    extent = [int(components, hsize_t), int(total, hsize_t)]
    start = [int(max(0, component - 1), hsize_t), int(first, hsize_t)]
    count = [int(merge(1, components, component > 0), hsize_t), int(rows, hsize_t)]
    most = [int(components, hsize_t), int(H5S_UNLIMITED_F, hsize_t)]
    if (rank == 1) then
      extent(1) = extent(2)
      start(1) = start(2)
      count(1) = count(2)
      most(1) = most(2)
    end if
    call h5pcreate_f(H5P_DATASET_CREATE_F, properties, status)
    if (status == 0) status = int(h5_track_times(properties, .false._c_bool))
    if (status == 0) call h5screate_simple_f(rank, extent(:rank), there, status, most(:rank))
    if (status == 0) then
      call h5sselect_hyperslab_f(there, H5S_SELECT_SET_F, start(:rank), count(:rank), status)
      if (shown == 1) count(1) = count(rank)
      if (status == 0) call h5screate_simple_f(shown, count(:shown), here, status)
      if (status == 0) then
        ! '.' is the file itself, whatever name it has or gets
        call h5pset_virtual_f(properties, here, '.', source, there, status)
        if (status == 0) call h5dcreate_f(file%id, path, storage_id(storage), here, dataset, &
          & status, dcpl_id=properties)
        if (status == 0) call h5dclose_f(dataset, status)
        if (status /= 0) call explain(error, 'make '//path//' in', file%name)
        call h5sclose_f(here, ignored)
      end if
      call h5sclose_f(there, ignored)
    end if
    call h5pclose_f(properties, ignored)
    if (status /= 0 .and. .not. allocated(error)) &
      & call fail(error, 'cannot describe '//path//' of '//file%name)
  end subroutine make_view

  !> Change the number of rows of a series.
  subroutine set_rows(file, path, components, rows, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer, intent(in) :: components    !! numbers in a row
    integer(i8), intent(in) :: rows      !! their new number; those beyond it are lost, new ones are
                                         !! undefined
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: dataset
    integer :: status, ignored

    call h5dopen_f(file%id, path, dataset, status)
    if (status == 0) then
      if (components > 1) then
        call h5dset_extent_f(dataset, [int(components, hsize_t), int(rows, hsize_t)], status)
      else
        call h5dset_extent_f(dataset, [int(rows, hsize_t)], status)
      end if
      if (status /= 0) call explain(error, 'resize '//path//' in', file%name)
      call h5dclose_f(dataset, ignored)
    else
      call explain(error, 'find '//path//' in', file%name)
    end if
  end subroutine set_rows

  !> The shape of a dataset: `rows`, and `components` (1 if it has one dimension).
  subroutine get_shape(file, path, components, rows, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer, intent(out) :: components   !! numbers in a row
    integer(i8), intent(out) :: rows     !! their number
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: dataset, space
    integer(hsize_t) :: extent(2), most(2)
    integer :: rank, status, ignored

    components = 0
    rows = 0
    call h5dopen_f(file%id, path, dataset, status)
    if (status /= 0) then
      call explain(error, 'find '//path//' in', file%name)
      return
    end if
    call h5dget_space_f(dataset, space, status)
    call h5sget_simple_extent_ndims_f(space, rank, status)
    extent = 0
    if (rank == 1 .or. rank == 2) call h5sget_simple_extent_dims_f(space, extent, most, status)
    components = 1
    if (rank == 2) components = int(extent(1))
    rows = extent(max(1, min(2, rank)))
    call h5sclose_f(space, ignored)
    call h5dclose_f(dataset, ignored)
  end subroutine get_shape

  !> Rows of a chunk of a series of one component. An error if there is none or it has no chunks.
  subroutine get_chunk(file, path, rows, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i8), intent(out) :: rows     !! of a chunk
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: dataset, properties
    integer(hsize_t) :: extent(1)
    integer :: status, ignored

    rows = 0
    call h5dopen_f(file%id, path, dataset, status)
    if (status /= 0) then
      call explain(error, 'find '//path//' in', file%name)
      return
    end if
    call h5dget_create_plist_f(dataset, properties, status)
    if (status == 0) call h5pget_chunk_f(properties, 1, extent, status)
    if (status < 0) then
      call explain(error, 'read the chunks of '//path//' of', file%name)
    else
      rows = extent(1)
    end if
    call h5pclose_f(properties, ignored)
    call h5dclose_f(dataset, ignored)
  end subroutine get_chunk

  !> Move rows between memory and a dataset, one hyperslab.
  subroutine move_rows(file, path, storage, components, first, rows, buffer, writing, error)
    type(hdf5_file), intent(in) :: file
    character(*), intent(in) :: path
    integer, intent(in) :: storage, components
    integer(i8), intent(in) :: first, rows
    type(c_ptr), intent(in) :: buffer
    logical, intent(in) :: writing
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: dataset, here, there
    integer(hsize_t) :: count(2), start(2)
    type(c_ptr) :: place
    integer :: rank, status, ignored

    if (rows == 0) return
    place = buffer
    rank = merge(2, 1, components > 1)
    count = [int(components, hsize_t), int(rows, hsize_t)]
    start = [0_hsize_t, int(first, hsize_t)]
    if (rank == 1) then
      count(1) = count(2)
      start(1) = start(2)
    end if
    call h5dopen_f(file%id, path, dataset, status)
    if (status /= 0) then
      call explain(error, 'find '//path//' in', file%name)
      return
    end if
    call h5dget_space_f(dataset, there, status)
    if (status == 0) then
      call h5sselect_hyperslab_f(there, H5S_SELECT_SET_F, start(:rank), count(:rank), status)
      if (status == 0) call h5screate_simple_f(rank, count(:rank), here, status)
      if (status == 0) then
        if (writing) then
          call h5dwrite_f(dataset, storage_id(storage), place, status, here, there, &
            & merge(file%writing, H5P_DEFAULT_F, file%writing >= 0))
          if (status /= 0) call explain(error, 'write', file%name)
        else
          call h5dread_f(dataset, storage_id(storage), place, status, here, there)
          if (status /= 0) call explain(error, 'read '//path//' of', file%name)
        end if
        call h5sclose_f(here, ignored)
      end if
      call h5sclose_f(there, ignored)
    end if
    call h5dclose_f(dataset, ignored)
    if (status /= 0 .and. .not. allocated(error)) &
      & call fail(error, 'cannot select rows of '//path//' in '//file%name)
  end subroutine move_rows

  !> A vector of reals as a dataset.
  subroutine put_array_real(file, path, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    real(wp), contiguous, target, intent(in) :: values(:)  !! (rows), kept as 64-bit reals
    type(error_type), allocatable, intent(out) :: error

    call make_dataset(file, path, storage_f8, 1, size(values, kind=i8), error)
    if (allocated(error) .or. size(values) == 0) return
    call move_rows(file, path, storage_f8, 1, 0_i8, size(values, kind=i8), c_loc(values), .true., &
      & error)
  end subroutine put_array_real

  !> A vector of 8-bit integers as a dataset.
  subroutine put_array_i1(file, path, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i1), contiguous, target, intent(in) :: values(:)  !! (rows), kept as 8-bit integers
    type(error_type), allocatable, intent(out) :: error

    call make_dataset(file, path, storage_i1, 1, size(values, kind=i8), error)
    if (allocated(error) .or. size(values) == 0) return
    call move_rows(file, path, storage_i1, 1, 0_i8, size(values, kind=i8), c_loc(values), .true., &
      & error)
  end subroutine put_array_i1

  !> A vector of 8-bit integers, none below 0, as a dataset of integers without sign.
  subroutine put_unsigned(file, path, values, error)
    type(hdf5_file), intent(in) :: file  !! open and writable
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i1), contiguous, target, intent(in) :: values(:)  !! (rows), 0 to 127
    type(error_type), allocatable, intent(out) :: error

    call make_dataset(file, path, storage_u1, 1, size(values, kind=i8), error)
    if (allocated(error) .or. size(values) == 0) return
    call move_rows(file, path, storage_i1, 1, 0_i8, size(values, kind=i8), c_loc(values), .true., &
      & error)
  end subroutine put_unsigned

  !> A vector of 32-bit integers as a dataset.
  subroutine put_array_i4(file, path, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i4), contiguous, target, intent(in) :: values(:)  !! (rows), kept as 32-bit integers
    type(error_type), allocatable, intent(out) :: error

    call make_dataset(file, path, storage_i4, 1, size(values, kind=i8), error)
    if (allocated(error) .or. size(values) == 0) return
    call move_rows(file, path, storage_i4, 1, 0_i8, size(values, kind=i8), c_loc(values), .true., &
      & error)
  end subroutine put_array_i4

  !> A vector of 64-bit integers as a dataset.
  subroutine put_array_i8(file, path, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i8), contiguous, target, intent(in) :: values(:)  !! (rows), kept as 64-bit integers
    type(error_type), allocatable, intent(out) :: error

    call make_dataset(file, path, storage_i8, 1, size(values, kind=i8), error)
    if (allocated(error) .or. size(values) == 0) return
    call move_rows(file, path, storage_i8, 1, 0_i8, size(values, kind=i8), c_loc(values), .true., &
      & error)
  end subroutine put_array_i8

  !> Write rows of one 64-bit real each.
  subroutine write_rows_real(file, path, first, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i8), intent(in) :: first     !! row of the first value, from 0
    real(wp), contiguous, target, intent(in) :: values(:)  !! (rows), as many as are to be written
    type(error_type), allocatable, intent(out) :: error

    if (size(values) == 0) return
    call move_rows(file, path, storage_f8, 1, first, size(values, kind=i8), &
      & c_loc(values), .true., error)
  end subroutine write_rows_real

  !> Write rows of one 32-bit real each.
  subroutine write_rows_single(file, path, first, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i8), intent(in) :: first     !! row of the first value, from 0
    real(sp), contiguous, target, intent(in) :: values(:)  !! (rows), as many as are to be written
    type(error_type), allocatable, intent(out) :: error

    if (size(values) == 0) return
    call move_rows(file, path, storage_f4, 1, first, size(values, kind=i8), &
      & c_loc(values), .true., error)
  end subroutine write_rows_single

  !> Write rows of one 64-bit integer each.
  subroutine write_rows_i8(file, path, first, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i8), intent(in) :: first     !! row of the first value, from 0
    integer(i8), contiguous, target, intent(in) :: values(:)
      !! (rows), as many as are to be written
    type(error_type), allocatable, intent(out) :: error

    if (size(values) == 0) return
    call move_rows(file, path, storage_i8, 1, first, size(values, kind=i8), &
      & c_loc(values), .true., error)
  end subroutine write_rows_i8

  !> Write rows of one 32-bit integer each.
  subroutine write_rows_i4(file, path, first, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i8), intent(in) :: first     !! row of the first value, from 0
    integer(i4), contiguous, target, intent(in) :: values(:)
      !! (rows), as many as are to be written
    type(error_type), allocatable, intent(out) :: error

    if (size(values) == 0) return
    call move_rows(file, path, storage_i4, 1, first, size(values, kind=i8), &
      & c_loc(values), .true., error)
  end subroutine write_rows_i4

  !> Write rows of one 8-bit integer each.
  subroutine write_rows_i1(file, path, first, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i8), intent(in) :: first     !! row of the first value, from 0
    integer(i1), contiguous, target, intent(in) :: values(:)
      !! (rows), as many as are to be written
    type(error_type), allocatable, intent(out) :: error

    if (size(values) == 0) return
    call move_rows(file, path, storage_i1, 1, first, size(values, kind=i8), &
      & c_loc(values), .true., error)
  end subroutine write_rows_i1

  !> Write rows of several 64-bit reals each.
  subroutine write_table_real(file, path, first, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i8), intent(in) :: first     !! row of the first column of `values`, from 0
    real(wp), contiguous, target, intent(in) :: values(:, :)
      !! (component, row), as many rows as are to be written
    type(error_type), allocatable, intent(out) :: error

    if (size(values) == 0) return
    call move_rows(file, path, storage_f8, size(values, 1), first, size(values, 2, kind=i8), &
      & c_loc(values), .true., error)
  end subroutine write_table_real

  !> Write rows of several 32-bit reals each.
  subroutine write_table_single(file, path, first, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i8), intent(in) :: first     !! row of the first column of `values`, from 0
    real(sp), contiguous, target, intent(in) :: values(:, :)
      !! (component, row), as many rows as are to be written
    type(error_type), allocatable, intent(out) :: error

    if (size(values) == 0) return
    call move_rows(file, path, storage_f4, size(values, 1), first, size(values, 2, kind=i8), &
      & c_loc(values), .true., error)
  end subroutine write_table_single

  !> Write rows of several 64-bit integers each.
  subroutine write_table_i8(file, path, first, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i8), intent(in) :: first     !! row of the first column of `values`, from 0
    integer(i8), contiguous, target, intent(in) :: values(:, :)
      !! (component, row), as many rows as are to be written
    type(error_type), allocatable, intent(out) :: error

    if (size(values) == 0) return
    call move_rows(file, path, storage_i8, size(values, 1), first, size(values, 2, kind=i8), &
      & c_loc(values), .true., error)
  end subroutine write_table_i8

  !> Read rows of one real each; single precision in the file is widened.
  subroutine read_rows_real(file, path, first, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i8), intent(in) :: first     !! row of the first value, from 0
    real(wp), contiguous, target, intent(out) :: values(:)  !! (rows), as many as are to be read
    type(error_type), allocatable, intent(out) :: error

    if (size(values) == 0) return
    call move_rows(file, path, storage_f8, 1, first, size(values, kind=i8), &
      & c_loc(values), .false., error)
  end subroutine read_rows_real

  !> Read rows of one integer each.
  subroutine read_rows_i8(file, path, first, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i8), intent(in) :: first     !! row of the first value, from 0
    integer(i8), contiguous, target, intent(out) :: values(:)  !! (rows), as many as are to be read
    type(error_type), allocatable, intent(out) :: error

    if (size(values) == 0) return
    call move_rows(file, path, storage_i8, 1, first, size(values, kind=i8), &
      & c_loc(values), .false., error)
  end subroutine read_rows_i8

  !> Read rows of several reals each; single precision in the file is widened.
  subroutine read_table_real(file, path, first, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is written
    character(*), intent(in) :: path     !! of the dataset in the file
    integer(i8), intent(in) :: first     !! row of the first column of `values`, from 0
    real(wp), contiguous, target, intent(out) :: values(:, :)
      !! (component, row), as many rows as are to be read
    type(error_type), allocatable, intent(out) :: error

    if (size(values) == 0) return
    call move_rows(file, path, storage_f8, size(values, 1), first, size(values, 2, kind=i8), &
      & c_loc(values), .false., error)
  end subroutine read_table_real

end module pd_output_results_datasets
