!> Series of blocks in an HDF5 file: datasets (block, row, component) for readers in C's order,
!> `values(component, row)` of each block in memory. Blocks count from 0.
!>
!> An error is set if HDF5 fails.
module pd_output_results_blocks
  use hdf5, only: H5S_SELECT_SET_F, H5S_UNLIMITED_F, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, &
    & h5dclose_f, h5dcreate_f, h5dget_space_f, h5dopen_f, h5dread_f, h5dset_extent_f, h5dwrite_f, &
    & h5pclose_f, h5pset_chunk_f, h5sclose_f, h5screate_simple_f, h5sselect_hyperslab_f, hid_t, &
    & hsize_t
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i8
  use pd_output_results_datasets, only: settled_properties
  use pd_output_results_hdf5, only: explain, hdf5_file
  implicit none (type, external)
  private
  public :: make_blocks, write_block, read_block, set_blocks

contains

  !> Make a series of `blocks` blocks, set aside at once and not filled, whose number can change.
  subroutine make_blocks(file, path, components, rows, blocks, chunk, error)
    type(hdf5_file), intent(in) :: file  !! open and writable
    character(*), intent(in) :: path     !! of the dataset in the file
    integer, intent(in) :: components    !! numbers in a row
    integer, intent(in) :: rows          !! of a block
    integer(i8), intent(in) :: blocks    !! to begin with
    integer(i8), intent(in) :: chunk     !! blocks that are stored together
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: space, properties, dataset
    integer(hsize_t) :: extent(3), most(3), together(3)
    integer :: status, ignored

    extent = [int(components, hsize_t), int(rows, hsize_t), int(blocks, hsize_t)]
    most = extent
    most(3) = H5S_UNLIMITED_F
    together = extent
    together(3) = max(1_i8, chunk)
    call settled_properties(properties, status)
    if (status == 0) call h5pset_chunk_f(properties, 3, together, status)
    if (status == 0) call h5screate_simple_f(3, extent, space, status, most)
    if (status == 0) then
      call h5dcreate_f(file%id, path, H5T_IEEE_F64LE, space, dataset, status, dcpl_id=properties)
      if (status == 0) call h5dclose_f(dataset, status)
      call h5sclose_f(space, ignored)
    end if
    if (status /= 0) call explain(error, 'make '//path//' in', file%name)
    call h5pclose_f(properties, ignored)
  end subroutine make_blocks

  !> Write one block.
  subroutine write_block(file, path, block, values, error)
    type(hdf5_file), intent(in) :: file      !! open and writable
    character(*), intent(in) :: path         !! of the dataset in the file
    integer(i8), intent(in) :: block         !! its number, from 0
    real(wp), intent(in) :: values(:, :)     !! (component, row)
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: dataset, here, there
    integer :: status

    call select_block(file, path, block, shape(values), dataset, here, there, error)
    if (allocated(error)) return
    call h5dwrite_f(dataset, H5T_NATIVE_DOUBLE, values, int(shape(values), hsize_t), status, &
      & here, there)
    if (status /= 0) call explain(error, 'write', file%name)
    call release(dataset, here, there)
  end subroutine write_block

  !> Read one block.
  subroutine read_block(file, path, block, values, error)
    type(hdf5_file), intent(in) :: file      !! open
    character(*), intent(in) :: path         !! of the dataset in the file
    integer(i8), intent(in) :: block         !! its number, from 0
    real(wp), intent(out) :: values(:, :)    !! (component, row)
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: dataset, here, there
    integer :: status

    call select_block(file, path, block, shape(values), dataset, here, there, error)
    if (allocated(error)) return
    call h5dread_f(dataset, H5T_NATIVE_DOUBLE, values, int(shape(values), hsize_t), status, &
      & here, there)
    if (status /= 0) call explain(error, 'read '//path//' of', file%name)
    call release(dataset, here, there)
  end subroutine read_block

  !> Change the number of blocks; those beyond it are lost, new ones are undefined.
  subroutine set_blocks(file, path, components, rows, blocks, error)
    type(hdf5_file), intent(in) :: file  !! open and writable
    character(*), intent(in) :: path     !! of the dataset in the file
    integer, intent(in) :: components    !! numbers in a row
    integer, intent(in) :: rows          !! of a block
    integer(i8), intent(in) :: blocks    !! their new number
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: dataset
    integer :: status, ignored

    call h5dopen_f(file%id, path, dataset, status)
    if (status == 0) then
      call h5dset_extent_f(dataset, [int(components, hsize_t), int(rows, hsize_t), &
        & int(blocks, hsize_t)], status)
      call h5dclose_f(dataset, ignored)
    end if
    if (status /= 0) call explain(error, 'resize '//path//' in', file%name)
  end subroutine set_blocks

  !> Open a dataset and select one of its blocks.
  subroutine select_block(file, path, block, extents, dataset, here, there, error)
    type(hdf5_file), intent(in) :: file
    character(*), intent(in) :: path
    integer(i8), intent(in) :: block
    integer, intent(in) :: extents(2)
    integer(hid_t), intent(out) :: dataset, here, there
    type(error_type), allocatable, intent(out) :: error
    integer(hsize_t) :: count(3), start(3)
    integer :: status

    count = [int(extents, hsize_t), 1_hsize_t]
    start = [0_hsize_t, 0_hsize_t, int(block, hsize_t)]
    here = -1
    there = -1
    call h5dopen_f(file%id, path, dataset, status)
    if (status /= 0) then
      call explain(error, 'find '//path//' in', file%name)
      return
    end if
    call h5dget_space_f(dataset, there, status)
    if (status == 0) call h5sselect_hyperslab_f(there, H5S_SELECT_SET_F, start, count, status)
    if (status == 0) call h5screate_simple_f(3, count, here, status)
    if (status == 0) return
    call explain(error, 'select '//path//' of', file%name)
    call release(dataset, here, there)
  end subroutine select_block

  !> Close what `select_block` opened.
  subroutine release(dataset, here, there)
    integer(hid_t), intent(in) :: dataset, here, there
    integer :: ignored

    if (here >= 0) call h5sclose_f(here, ignored)
    if (there >= 0) call h5sclose_f(there, ignored)
    call h5dclose_f(dataset, ignored)
  end subroutine release

end module pd_output_results_blocks
