!> How the results file is laid out, and how its parts are made and copied.
!>
!> `/VTKHDF` follows VTK's file format of that name (version 2.0, with steps): of type PolyData,
!> each
!> point a vertex, or, with cells, UnstructuredGrid. The nodes of cells then stand behind the points
!> in `Points` and in all of `PointData`, and `CellData` has the values of cells.
!> `/scene`, `/points`, `/cells` and `/history` are this program's own, and other readers pass over
!> them.
!>
!> An error is set if HDF5 fails to read or write the file.
module pd_output_results_layout
  use, intrinsic :: iso_fortran_env, only: compiler_version
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, sp, i8
  use pd_output_results_cells, only: cells_type
  use pd_output_results_datasets, only: get_shape, make_dataset, make_series, make_view, &
    & put_array, put_unsigned, read_rows, set_rows, storage_f4, storage_f8, storage_i8, write_rows
  use pd_output_results_hdf5, only: change_attribute, copy_object, hdf5_file, make_group, &
    & object_exists, put_attribute, put_text, remove_object
  use pd_output_results_profiles, only: bytes_of_profiles, copy_profiles, make_profiles, &
    & trim_profiles
  use pd_output_results_types, only: column_type, field_type, line_type
  use pd_output_results_views, only: folder, folder_of_cells, view_of_cells, view_of_output, &
    & view_type, views_fit, views_of
  implicit none (type, external)
  private
  public :: layout_type, put_scene, put_geometry, write_vectors, write_vertices, copy_scene, &
    & to_single
  public :: chunk_rows, block_rows, pieces_of

  integer, parameter :: block_rows = 65536  !! points converted and written at a time
  integer, parameter :: rows_together = 1048576  !! the same where ranks wait for each other
  integer(i8), parameter :: small_chunk = 65536_i8, large_chunk = 4194304_i8  ! [bytes]
  integer(i8), parameter :: most_chunks = 65536_i8, most_bytes = 2147483648_i8

  !> What the file holds, and room for how much of it.
  type :: layout_type
    type(field_type), allocatable :: fields(:)
    type(column_type), allocatable :: columns(:)
    type(line_type), allocatable :: lines(:)
    integer(i8) :: points = 0        !! points
    integer(i8) :: capacity = 0      !! outputs there is room for
    integer(i8) :: row_capacity = 0  !! rows of the history there is room for
    logical :: single = .false.      !! fields in single precision
    type(cells_type) :: cells        !! none: each point is a vertex
  contains
    procedure :: rows_of_output
    procedure :: make_heart
    procedure :: make_time_series
    procedure, private :: make_views
    procedure :: copy_static
    procedure :: copy_time_series
    procedure :: trim_time_series
    procedure :: field_bytes
    procedure :: output_bytes
    procedure :: fixed_bytes
  end type layout_type

contains

  !> Begin a file, before all else: what an output is counted by.
  !>
  !> Readers take the number of times for NSteps, and VTK's writes past its memory when it finds
  !> more. So the two change together: made one after the other in a file that is still empty,
  !> their records are neighbours at a fixed place, and HDF5 joins them into one write.
  !> Should another version not do so, NSteps is written first.
  subroutine make_heart(self, file, error)
    class(layout_type), intent(in) :: self  !! what the file holds, and room for how much of it
    type(hdf5_file), intent(in) :: file     !! new, with nothing in it
    type(error_type), allocatable, intent(out) :: error

    call make_group(file, '/VTKHDF', error)
    if (allocated(error)) return
    call make_group(file, '/VTKHDF/Steps', error)
    if (allocated(error)) return
    call put_attribute(file, '/VTKHDF/Steps', 'NSteps', 0_i8, error)
    if (allocated(error)) return
    call make_series(file, '/VTKHDF/Steps/Values', storage_f8, 1, 1_i8, self%capacity, error)
    if (allocated(error)) return
    call put_attribute(file, '/VTKHDF', 'Version', [2_i8, 0_i8], error)
    if (allocated(error)) return
    if (self%cells%n_cells() > 0) then
      call put_attribute(file, '/VTKHDF', 'Type', 'UnstructuredGrid', error)
    else
      call put_attribute(file, '/VTKHDF', 'Type', 'PolyData', error)
    end if
  end subroutine make_heart

  !> Rows of `PointData` that an output takes: a value for each point, and for each node of cells.
  pure integer(i8) function rows_of_output(self)
    class(layout_type), intent(in) :: self  !! what the file holds, and room for how much of it
    rows_of_output = self%points + self%cells%n_nodes()
  end function rows_of_output

  !> `/scene`: what was computed, by what.
  subroutine put_scene(file, scene_text, command, version, error)
    type(hdf5_file), intent(in) :: file     !! writable, without `/scene`
    character(*), intent(in) :: scene_text  !! the resolved scene, as a scene file
    character(*), intent(in) :: command     !! the command line of the run
    character(*), intent(in) :: version     !! of the program
    type(error_type), allocatable, intent(out) :: error

    call make_group(file, '/scene', error)
    if (.not. allocated(error)) call put_text(file, '/scene/text', scene_text, error)
    if (.not. allocated(error)) call put_text(file, '/scene/command', command, error)
    if (.not. allocated(error)) call put_attribute(file, '/scene', 'version', version, error)
    if (.not. allocated(error)) &
      & call put_attribute(file, '/scene', 'compiler', compiler_version(), error)
  end subroutine put_scene

  !> What doesn't change with time: points, each of them a vertex, and no other cells; or points and
  !> nodes, with cells.
  subroutine put_geometry(file, points, positions, cells, error)
    type(hdf5_file), intent(in) :: file      !! writable, with `/VTKHDF`
    integer(i8), intent(in) :: points        !! their number
    real(wp), intent(in) :: positions(:, :)  !! (n_points, 3) [m]; (0, 3): they and the vertices
                                             !! are written later
    type(cells_type), intent(in) :: cells    !! of the file; none: vertices
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: empty(3) = [character(8) :: 'Lines', 'Polygons', 'Strips']
    character(:), allocatable :: group
    integer :: i

    if (cells%n_cells() > 0) then
      call put_grid(file, positions, cells, error)
      return
    end if
    call put_array(file, '/VTKHDF/NumberOfPoints', [points], error)
    if (allocated(error)) return
    call make_dataset(file, '/VTKHDF/Points', storage_f8, 3, points, error)
    if (allocated(error)) return
    if (size(positions, 1) > 0) call write_vectors(file, '/VTKHDF/Points', 0_i8, positions, &
      & .false., points, error)
    if (allocated(error)) return

    call make_group(file, '/VTKHDF/Vertices', error)
    if (allocated(error)) return
    call put_array(file, '/VTKHDF/Vertices/NumberOfCells', [points], error)
    if (allocated(error)) return
    call put_array(file, '/VTKHDF/Vertices/NumberOfConnectivityIds', [points], error)
    if (allocated(error)) return
    call make_dataset(file, '/VTKHDF/Vertices/Connectivity', storage_i8, 1, points, error)
    if (allocated(error)) return
    call make_dataset(file, '/VTKHDF/Vertices/Offsets', storage_i8, 1, points + 1, error)
    if (allocated(error)) return
    if (size(positions, 1) > 0) call write_vertices(file, 0_i8, points, points, points, error)
    if (allocated(error)) return
    do i = 1, size(empty)
      group = '/VTKHDF/'//trim(empty(i))
      call make_group(file, group, error)
      if (allocated(error)) return
      call put_array(file, group//'/NumberOfCells', [0_i8], error)
      if (allocated(error)) return
      call put_array(file, group//'/NumberOfConnectivityIds', [0_i8], error)
      if (allocated(error)) return
      call make_dataset(file, group//'/Connectivity', storage_i8, 1, 0_i8, error)
      if (allocated(error)) return
      call put_array(file, group//'/Offsets', [0_i8], error)
      if (allocated(error)) return
    end do
  end subroutine put_geometry

  !> Points, nodes and cells of an unstructured grid.
  subroutine put_grid(file, positions, cells, error)
    type(hdf5_file), intent(in) :: file
    real(wp), intent(in) :: positions(:, :)
    type(cells_type), intent(in) :: cells
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: n

    n = size(positions, 1, kind=i8) + cells%n_nodes()
    call put_array(file, '/VTKHDF/NumberOfPoints', [n], error)
    if (allocated(error)) return
    call make_dataset(file, '/VTKHDF/Points', storage_f8, 3, n, error)
    if (allocated(error)) return
    call write_vectors(file, '/VTKHDF/Points', 0_i8, positions, .false., n, error)
    if (allocated(error)) return
    call write_vectors(file, '/VTKHDF/Points', size(positions, 1, kind=i8), cells%nodes, .false., &
      & n, error)
    if (allocated(error)) return
    call put_array(file, '/VTKHDF/NumberOfCells', [cells%n_cells()], error)
    if (allocated(error)) return
    call put_array(file, '/VTKHDF/NumberOfConnectivityIds', &
      & [size(cells%connectivity, kind=i8)], error)
    if (allocated(error)) return
    call put_array(file, '/VTKHDF/Connectivity', cells%connectivity, error)
    if (allocated(error)) return
    call put_array(file, '/VTKHDF/Offsets', cells%offsets, error)
    if (allocated(error)) return
    call put_unsigned(file, '/VTKHDF/Types', cells%types, error)
    if (allocated(error)) return
    call make_group(file, '/cells', error)
    if (.not. allocated(error)) call put_array(file, '/cells/topology', cells%topology, error)
  end subroutine put_grid

  !> A dataset of `rows` integers 0, step, 2 step, ... that can grow.
  subroutine put_multiples(file, path, rows, step, chunk, error)
    type(hdf5_file), intent(in) :: file
    character(*), intent(in) :: path
    integer(i8), intent(in) :: rows, step, chunk
    type(error_type), allocatable, intent(out) :: error

    call make_series(file, path, storage_i8, 1, rows, chunk, error)
    if (.not. allocated(error)) call write_multiples(file, path, 0_i8, rows, step, rows, error)
  end subroutine put_multiples

  !> Write multiples of `step`: row k, from 0, has k step.
  subroutine write_multiples(file, path, first, rows, step, most, error)
    type(hdf5_file), intent(in) :: file
    character(*), intent(in) :: path
    integer(i8), intent(in) :: first, rows, step, most
    type(error_type), allocatable, intent(out) :: error
    integer(i8), allocatable :: buffer(:)
    integer(i8) :: i, pieces, k, before, count

    pieces = pieces_of(file, most)
    do k = 1, pieces
      before = rows*(k - 1)/pieces
      count = rows*k/pieces - before
      if (.not. allocated(buffer)) allocate (buffer(count + 1))
      do i = 1, count
        buffer(i) = (first + before + i - 1)*step
      end do
      call write_rows(file, path, first + before, buffer(:count), error)
      if (allocated(error)) return
    end do
  end subroutine write_multiples

  !> In how many pieces rows are converted and written, so that every rank has as many writes.
  pure integer(i8) function pieces_of(file, most) result(pieces)
    type(hdf5_file), intent(in) :: file  !! that gets them
    integer(i8), intent(in) :: most      !! rows of the rank that has most, where all ranks write
    integer :: rows
    rows = merge(rows_together, block_rows, file%writing >= 0)
    pieces = (most + rows - 1)/rows
  end function pieces_of

  !> Write the vertices of some points: each point is one.
  subroutine write_vertices(file, first, rows, points, most, error)
    type(hdf5_file), intent(in) :: file  !! open and writable
    integer(i8), intent(in) :: first     !! number of the first of these points, from 0
    integer(i8), intent(in) :: rows      !! how many
    integer(i8), intent(in) :: points    !! of all ranks
    integer(i8), intent(in) :: most      !! points of the rank that has most, where all ranks write
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: ends

    ! one offset more than points
    ends = merge(1_i8, 0_i8, first + rows == points)
    call write_multiples(file, '/VTKHDF/Vertices/Connectivity', first, rows, 1_i8, most, error)
    if (.not. allocated(error)) call write_multiples(file, '/VTKHDF/Vertices/Offsets', first, &
      & rows + ends, 1_i8, most, error)
  end subroutine write_vertices

  !> What else grows with time, with room for `capacity` outputs and `row_capacity` rows of history.
  subroutine make_time_series(self, file, error)
    class(layout_type), intent(in) :: self  !! what the file holds, and room for how much of it
    type(hdf5_file), intent(in) :: file     !! writable, begun by `make_heart`
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: steps = '/VTKHDF/Steps'
    character(:), allocatable :: path
    integer(i8), allocatable :: constant(:), cells(:, :)
    integer(i8) :: s, chunk
    integer :: i, kinds

    s = self%capacity
    chunk = min(s, small_chunk/8)
    call put_multiples(file, steps//'/PartOffsets', s, 0_i8, chunk, error)
    if (allocated(error)) return
    call put_multiples(file, steps//'/PointOffsets', s, 0_i8, chunk, error)
    if (allocated(error)) return
    call make_series(file, steps//'/NumberOfParts', storage_i8, 1, s, chunk, error)
    if (allocated(error)) return
    allocate (constant(s), source=1_i8)
    call write_rows(file, steps//'/NumberOfParts', 0_i8, constant, error)
    if (allocated(error)) return
    kinds = kinds_of_cells(self)
    allocate (cells(kinds, s), source=0_i8)
    call make_series(file, steps//'/CellOffsets', storage_i8, kinds, s, chunk, error)
    if (.not. allocated(error)) call make_series(file, steps//'/ConnectivityIdOffsets', &
      & storage_i8, kinds, s, chunk, error)
    if (allocated(error)) return
    if (kinds > 1) then
      call write_rows(file, steps//'/CellOffsets', 0_i8, cells, error)
      if (.not. allocated(error)) call write_rows(file, steps//'/ConnectivityIdOffsets', 0_i8, &
        & cells, error)
    else
      call write_rows(file, steps//'/CellOffsets', 0_i8, cells(1, :), error)
      if (.not. allocated(error)) call write_rows(file, steps//'/ConnectivityIdOffsets', 0_i8, &
        & cells(1, :), error)
    end if
    if (allocated(error)) return

    call make_fields(self, file, 'PointData', self%rows_of_output(), error)
    if (allocated(error)) return
    if (self%cells%n_cells() > 0) call make_fields(self, file, 'CellData', self%cells%n_cells(), &
      & error)
    if (allocated(error)) return

    call make_group(file, '/history', error)
    if (allocated(error)) return
    call put_attribute(file, '/history', 'rows', 0_i8, error)
    do i = 1, size(self%columns)
      if (allocated(error)) return
      path = '/history/'//trim(self%columns(i)%name)
      ! a single chunk, set aside by the one row that a column has from the start
      call make_series(file, path, storage_f8, 1, 1_i8, self%row_capacity, error)
      if (allocated(error)) return
      call write_rows(file, path, 0_i8, [0.0_wp], error)
      if (allocated(error)) return
      call put_attribute(file, path, 'units', trim(self%columns(i)%unit), error)
      if (allocated(error)) return
      if (self%columns(i)%origin /= '') call put_attribute(file, path, 'origin', &
        & trim(self%columns(i)%origin), error)
    end do
    if (.not. allocated(error)) call self%make_views(file, error)
    if (.not. allocated(error)) call make_profiles(file, self%lines, self%capacity, error)
  end subroutine make_time_series

  !> Kinds of cells that the format counts: vertices, lines, polygons, strips; or one of any kind.
  pure integer function kinds_of_cells(self) result(kinds)
    class(layout_type), intent(in) :: self
    kinds = merge(1, 4, self%cells%n_cells() > 0)
  end function kinds_of_cells

  !> All fields of points or cells, with `rows` rows in each output.
  subroutine make_fields(self, file, of, rows, error)
    class(layout_type), intent(in) :: self
    type(hdf5_file), intent(in) :: file
    character(*), intent(in) :: of           !! 'PointData' or 'CellData'
    integer(i8), intent(in) :: rows
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: path
    integer(i8) :: s
    integer :: i

    s = self%capacity
    call make_group(file, '/VTKHDF/'//of, error)
    if (allocated(error)) return
    call make_group(file, '/VTKHDF/Steps/'//of//'Offsets', error)
    if (allocated(error)) return
    do i = 1, size(self%fields)
      associate (field => self%fields(i))
        path = '/VTKHDF/'//of//'/'//trim(field%name)
        call make_series(file, path, merge(storage_f4, storage_f8, self%single), &
          & field%components, s*rows, chunk_rows(rows, field_bytes(self, i), s), error)
        if (allocated(error)) return
        call put_attribute(file, path, 'units', trim(field%unit), error)
        if (allocated(error)) return
        if (field%labels /= '') call put_attribute(file, path, 'components', trim(field%labels), &
          & error)
        if (allocated(error)) return
        call put_multiples(file, '/VTKHDF/Steps/'//of//'Offsets/'//trim(field%name), s, rows, &
          & min(s, small_chunk/8), error)
        if (allocated(error)) return
      end associate
    end do
  end subroutine make_fields

  !> `/outputs`: the outputs one by one, where they are not too many; `/cell_outputs`: of cells.
  subroutine make_views(self, file, error)
    class(layout_type), intent(in) :: self  !! what the file holds, and room for how much of it
    type(hdf5_file), intent(in) :: file     !! writable, with all fields
    type(error_type), allocatable, intent(out) :: error
    type(view_type), allocatable :: views(:)

    if (.not. views_fit(self%fields, self%capacity)) return
    views = views_of(self%fields)
    call make_some(views, folder, 'PointData', self%rows_of_output())
    if (self%cells%n_cells() == 0 .or. allocated(error)) return
    call make_some(view_of_cells(views), folder_of_cells, 'CellData', self%cells%n_cells())

  contains

    !> Views of points or of cells, in the same order.
    subroutine make_some(shown, top, of, rows)
      type(view_type), intent(in) :: shown(:)
      character(*), intent(in) :: top, of
      integer(i8), intent(in) :: rows
      integer(i8) :: k
      integer :: i

      call make_group(file, top, error)
      do i = 1, size(shown)
        if (allocated(error)) return
        associate (view => shown(i), field => self%fields(shown(i)%field))
          if (view%component == 1) call make_group(file, top//'/'//trim(field%name), error)
          if (.not. allocated(error)) call make_group(file, trim(view%group), error)
          do k = 0, self%capacity - 1
            if (allocated(error)) return
            call make_view(file, view_of_output(view, k), merge(storage_f4, storage_f8, &
              & self%single), '/VTKHDF/'//of//'/'//trim(field%name), field%components, &
              & self%capacity*rows, k*rows, rows, view%component, error)
          end do
        end associate
      end do
    end subroutine make_some

  end subroutine make_views

  !> Rows per chunk, for outputs of `points` rows of `row_bytes` bytes: several outputs if they
  !> are small; if they are large a part of one that divides it evenly, where there is such a part.
  pure integer(i8) function chunk_rows(points, row_bytes, outputs) result(rows)
    integer(i8), intent(in) :: points   !! points
    integer(i8), intent(in) :: row_bytes  !! bytes a point
    integer(i8), intent(in) :: outputs  !! outputs planned
    integer(i8) :: output_bytes, target_bytes, parts, i

    output_bytes = max(1_i8, points*row_bytes)
    if (output_bytes <= small_chunk) then
      rows = points*min(outputs, small_chunk/output_bytes)
    else
      ! few enough chunks that the file's index of them stays small
      target_bytes = min(most_bytes, max(large_chunk, output_bytes*outputs/most_chunks))
      parts = (output_bytes + target_bytes - 1)/target_bytes
      do i = parts, 2*parts
        if (mod(points, i) == 0) exit
      end do
      if (i <= 2*parts) parts = i
      rows = (points + parts - 1)/parts
    end if
    rows = max(1_i8, rows)
  end function chunk_rows

  !> Bytes a point of field `i`.
  pure integer(i8) function field_bytes(self, i)
    class(layout_type), intent(in) :: self  !! what the file holds, and room for how much of it
    integer, intent(in) :: i                !! number of the field
    field_bytes = self%fields(i)%components*merge(4, 8, self%single)
  end function field_bytes

  !> Bytes that one output takes.
  pure integer(i8) function output_bytes(self)
    class(layout_type), intent(in) :: self  !! what the file holds, and room for how much of it
    integer :: i

    output_bytes = bytes_of_profiles(self%lines)
    do i = 1, size(self%fields)
      output_bytes = output_bytes + (self%rows_of_output() + self%cells%n_cells()) &
        & *field_bytes(self, i)
    end do
  end function output_bytes

  !> Bytes written before the first output, within some kilobytes.
  pure integer(i8) function fixed_bytes(self)
    class(layout_type), intent(in) :: self  !! what the file holds, and room for how much of it

    fixed_bytes = self%rows_of_output()*(3*8 + 2*8 + 8 + 4*4) + self%capacity*8*(12 + &
      & size(self%fields)) &
      & + self%row_capacity*8*size(self%columns)
    ! a view has a record and a place in the index of its group
    if (views_fit(self%fields, self%capacity)) &
      & fixed_bytes = fixed_bytes + merge(1000, 500, self%cells%n_cells() > 0)*self%capacity &
      & *size(views_of(self%fields))
    if (self%cells%n_cells() > 0) fixed_bytes = fixed_bytes + 8*(size(self%cells%connectivity, &
      & kind=i8) + size(self%cells%topology, kind=i8))
  end function fixed_bytes

  !> Write `values(n, components)` as rows of components from row `at` on, turned block by block.
  subroutine write_vectors(file, path, at, values, single, most, error)
    type(hdf5_file), intent(in) :: file   !! open and writable
    character(*), intent(in) :: path      !! of the dataset, of three components
    integer(i8), intent(in) :: at         !! row of the first vector, from 0
    real(wp), intent(in) :: values(:, :)  !! (n, 3)
    logical, intent(in) :: single         !! the dataset is in single precision
    integer(i8), intent(in) :: most       !! rows of the rank that has most, where all ranks write
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: turned(:, :)
    real(sp), allocatable :: short(:, :)
    integer(i8) :: n, first, count, i, k, pieces

    n = size(values, 1, kind=i8)
    pieces = pieces_of(file, most)
    do k = 1, pieces
      first = n*(k - 1)/pieces
      count = n*k/pieces - first
      if (.not. allocated(turned)) allocate (turned(size(values, 2), count + 1))
      do i = 1, count
        turned(:, i) = values(first + i, :)
      end do
      if (single) then
        short = to_single(turned(:, :count))
        call write_rows(file, path, at + first, short, error)
      else
        call write_rows(file, path, at + first, turned(:, :count), error)
      end if
      if (allocated(error)) return
    end do
  end subroutine write_vectors

  !> To single precision; what is beyond its range goes to the end of the range.
  elemental real(sp) function to_single(value)
    real(wp), intent(in) :: value  !! of any size
    real(wp), parameter :: most = huge(1.0_sp)
    to_single = real(value, sp)
    if (abs(value) > most) to_single = sign(huge(1.0_sp), real(sign(1.0_wp, value), sp))
  end function to_single

  !> Copy all that doesn't grow but the scene.
  subroutine copy_static(self, from, to, error)
    class(layout_type), intent(in) :: self  !! what the file holds
    type(hdf5_file), intent(in) :: from  !! a complete file of this layout
    type(hdf5_file), intent(in) :: to    !! writable, begun by `make_heart`
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: parts(7) = [character(24) :: '/points', &
      & '/VTKHDF/NumberOfPoints', '/VTKHDF/Points', '/VTKHDF/Vertices', '/VTKHDF/Lines', &
      & '/VTKHDF/Polygons', '/VTKHDF/Strips']
    character(*), parameter :: of_grid(8) = [character(32) :: '/points', '/cells', &
      & '/VTKHDF/NumberOfPoints', '/VTKHDF/Points', '/VTKHDF/NumberOfCells', &
      & '/VTKHDF/NumberOfConnectivityIds', '/VTKHDF/Connectivity', '/VTKHDF/Offsets']
    integer :: i

    if (self%cells%n_cells() > 0) then
      do i = 1, size(of_grid)
        call copy_object(from, trim(of_grid(i)), to, error)
        if (allocated(error)) return
      end do
      call copy_object(from, '/VTKHDF/Types', to, error)
      return
    end if
    do i = 1, size(parts)
      call copy_object(from, trim(parts(i)), to, error)
      if (allocated(error)) return
    end do
  end subroutine copy_static

  !> Copy the scene.
  subroutine copy_scene(from, to, error)
    type(hdf5_file), intent(in) :: from  !! a file with `/scene`
    type(hdf5_file), intent(in) :: to    !! writable, without it
    type(error_type), allocatable, intent(out) :: error
    call copy_object(from, '/scene', to, error)
  end subroutine copy_scene

  !> Copy the complete outputs and rows, and what there is of an output under way, field by field
  !> and block by block. `outputs` and `rows` count the complete ones.
  subroutine copy_time_series(self, from, outputs, rows, room, to, error)
    class(layout_type), intent(in) :: self  !! what the file holds, and room for how much of it
    type(hdf5_file), intent(in) :: from     !! a file of the same fields and columns
    integer(i8), intent(in) :: outputs      !! complete ones
    integer(i8), intent(in) :: rows         !! complete ones of the history
    integer(i8), intent(in) :: room         !! outputs that `from` was laid out for
    type(hdf5_file), intent(in) :: to  !! writable, made by `make_time_series` with room for more
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    call set_rows(to, '/VTKHDF/Steps/Values', 1, max(1_i8, outputs), error)
    if (allocated(error)) return
    call copy_rows(from, to, '/VTKHDF/Steps/Values', outputs, .false., error)
    do i = 1, size(self%fields)
      if (allocated(error)) return
      call copy_rows(from, to, '/VTKHDF/PointData/'//trim(self%fields(i)%name), &
        & (outputs + 1)*self%rows_of_output(), self%single, error)
      if (allocated(error) .or. self%cells%n_cells() == 0) cycle
      call copy_rows(from, to, '/VTKHDF/CellData/'//trim(self%fields(i)%name), &
        & (outputs + 1)*self%cells%n_cells(), self%single, error)
    end do
    do i = 1, size(self%columns)
      if (allocated(error)) return
      call set_rows(to, '/history/'//trim(self%columns(i)%name), 1, max(1_i8, rows), error)
      if (allocated(error)) return
      call copy_rows(from, to, '/history/'//trim(self%columns(i)%name), rows, .false., &
        & error)
    end do
    if (.not. allocated(error)) call copy_profiles(from, to, self%lines, outputs, room, error)
    if (.not. allocated(error)) call change_attribute(to, '/history', 'rows', rows, error)
    if (.not. allocated(error)) &
      & call change_attribute(to, '/VTKHDF/Steps', 'NSteps', outputs, error)
  end subroutine copy_time_series

  !> Copy the first `rows` rows of a dataset of reals, or all if there are fewer.
  subroutine copy_rows(from, to, path, rows, single, error)
    type(hdf5_file), intent(in) :: from, to
    character(*), intent(in) :: path
    integer(i8), intent(in) :: rows
    logical, intent(in) :: single
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: values(:, :)
    real(sp), allocatable :: short(:, :)
    integer(i8) :: first, count, extent
    integer :: components

    call get_shape(from, path, components, extent, error)
    if (allocated(error)) return
    extent = min(extent, rows)
    do first = 0, extent - 1, block_rows
      count = min(int(block_rows, i8), extent - first)
      if (.not. allocated(values)) allocate (values(components, count))
      call read_rows(from, path, first, values(:, :count), error)
      if (allocated(error)) return
      if (single) then
        short = to_single(values(:, :count))
        call write_rows(to, path, first, short, error)
      else
        call write_rows(to, path, first, values(:, :count), error)
      end if
      if (allocated(error)) return
    end do
  end subroutine copy_rows

  !> Cut off the room that `outputs` outputs and `rows` rows of history didn't need.
  subroutine trim_time_series(self, file, outputs, rows, error)
    class(layout_type), intent(in) :: self  !! what the file holds, and room for how much of it
    type(hdf5_file), intent(in) :: file     !! open and writable
    integer(i8), intent(in) :: outputs      !! that stay
    integer(i8), intent(in) :: rows         !! of the history that stay
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: steps = '/VTKHDF/Steps/'
    character(*), parameter :: scalars(4) = [character(16) :: 'Values', 'PartOffsets', &
      & 'PointOffsets', 'NumberOfParts']
    character(*), parameter :: tables(2) = [character(24) :: 'CellOffsets', &
      & 'ConnectivityIdOffsets']
    type(view_type), allocatable :: views(:)
    integer(i8) :: k
    integer :: i

    if (outputs < self%capacity) then
      allocate (views(0))
      if (object_exists(file, '/outputs')) views = views_of(self%fields)
      do i = 1, size(views)
        do k = self%capacity - 1, outputs, -1
          call remove_object(file, view_of_output(views(i), k), error)
          if (.not. allocated(error) .and. self%cells%n_cells() > 0) call remove_object(file, &
            & view_of_output(view_of_cells(views(i)), k), error)
          if (allocated(error)) return
        end do
      end do
      call trim_profiles(file, self%lines, outputs, error)
      if (allocated(error)) return
      do i = 1, size(scalars)
        call set_rows(file, steps//trim(scalars(i)), 1, outputs, error)
        if (allocated(error)) return
      end do
      do i = 1, size(tables)
        call set_rows(file, steps//trim(tables(i)), kinds_of_cells(self), outputs, error)
        if (allocated(error)) return
      end do
      call trim_fields('PointData', self%rows_of_output())
      if (self%cells%n_cells() > 0 .and. .not. allocated(error)) &
        & call trim_fields('CellData', self%cells%n_cells())
      if (allocated(error)) return
    end if
    if (rows == 0) then
      do i = 1, size(self%columns)
        call set_rows(file, '/history/'//trim(self%columns(i)%name), 1, 0_i8, error)
        if (allocated(error)) return
      end do
    end if

  contains

    !> Cut the fields of points or cells, which have `each` rows in an output.
    subroutine trim_fields(of, each)
      character(*), intent(in) :: of
      integer(i8), intent(in) :: each
      integer :: f

      do f = 1, size(self%fields)
        associate (field => self%fields(f))
          call set_rows(file, steps//of//'Offsets/'//trim(field%name), 1, outputs, error)
          if (allocated(error)) return
          call set_rows(file, '/VTKHDF/'//of//'/'//trim(field%name), field%components, &
            & outputs*each, error)
          if (allocated(error)) return
        end associate
      end do
    end subroutine trim_fields

  end subroutine trim_time_series

end module pd_output_results_layout
