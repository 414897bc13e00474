!> The results file: one HDF5 file that VTK reads as a time series of points or cells
!> (VTKHDF: PolyData, UnstructuredGrid).
!>
!> It must be whole whenever its writer dies. HDF5 doesn't write its own records in one step, so
!> they change only rarely: the file is laid out under another name with room for all planned
!> outputs (the system stores only what is written), closed, and opened again. From then on an
!> output is plain data written into places that exist, and after it eight bytes that count: NSteps,
!> the length of a history column. A file that needs more room is copied into a bigger one, which
!> then takes its name in one step.
!>
!> An error is set where the file cannot be written or read; it is then as it was at its last
!> complete output.
module pd_output_results_vtkhdf
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, sp, i1, i4, i8
  use pd_base_text, only: to_text
  use pd_output_results_cells, only: at_nodes, cells_type, of_cells
  use pd_output_results_datasets, only: get_chunk, get_shape, make_dataset, put_array, read_rows, &
    & set_rows, storage_f8, storage_i1, storage_i4, write_rows
  use pd_output_results_files, only: remove_file, rename_file, sync_path
  use pd_output_results_hdf5, only: change_attribute, close_file, create_file, flush_file, &
    & get_attribute, get_text, hdf5_file, make_group, object_exists, open_file, put_text, &
    & remove_object, start_hdf5
  use pd_output_results_layout, only: copy_scene, layout_type, pieces_of, put_geometry, put_scene, &
    & to_single, write_vectors, write_vertices
  use pd_output_results_profiles, only: put_profile
  use pd_output_results_types, only: column_type, field_type, kept_type, line_type
  use pd_output_results_views, only: views_fit
  implicit none (type, external)
  private
  public :: vtkhdf_file, real_points, short_points, byte_points

  !> Kinds of arrays over the points.
  integer, parameter :: real_points = storage_f8, short_points = storage_i4, &
    & byte_points = storage_i1

  integer(i8), parameter :: default_outputs = 16_i8, default_rows = 4096_i8

  !> An open results file.
  type :: vtkhdf_file
    private
    type(hdf5_file) :: file
    type(hdf5_file) :: shared             !! the same while all ranks write rows into it
    type(layout_type) :: layout
    character(:), allocatable :: path     !! the final name
    character(:), allocatable :: current  !! the present name
    integer(i8) :: outputs = 0            !! complete ones
    integer(i8) :: rows = 0               !! complete ones
    logical :: sealed = .false.           !! laid out for good
    type(layout_type) :: plan             !! what a file that continues is to hold
  contains
    procedure :: create
    procedure :: resume
    procedure :: cut
    procedure :: has_views
    procedure, private :: put_points_real, put_points_i4, put_points_i1
    !> Add an array over the points to `/points`, before the first output.
    generic :: put_points => put_points_real, put_points_i4, put_points_i1
    procedure :: attend
    procedure :: make_points
    procedure :: put_rows_of_points
    procedure :: put_geometry_of_rows
    procedure :: seal
    procedure :: open_shared
    procedure :: close_shared
    procedure :: put_rows
    procedure :: begin_output
    procedure, private :: put_scalar, put_vector
    !> Write one field of the output under way: `values(n)` or `values(n, components)`.
    generic :: put_field => put_scalar, put_vector
    procedure :: put_line
    procedure :: end_output
    procedure :: append_rows
    procedure :: publish
    procedure :: sync
    procedure :: put_warnings
    procedure :: finish
    procedure :: leave
    procedure :: abandon
    procedure :: output_bytes
    procedure :: layout_bytes
  end type vtkhdf_file

contains

  !> Lay out a file for `planned_outputs` outputs of `fields` and `planned_rows` history rows of
  !> `columns` (0 = unknown) at the points `positions(n, 3)` [m]. It is
  !> made under another name until `publish`.
  subroutine create(self, path, points, positions, fields, planned_outputs, columns, &
    & planned_rows, single, scene_text, command, version, error, lines, cells)
    class(vtkhdf_file), intent(out) :: self      !! open on return, unless an error is set
    character(*), intent(in) :: path             !! of the file, with its ending
    integer(i8), intent(in) :: points            !! their number
    real(wp), intent(in) :: positions(:, :)      !! (n_points, 3) in point order [m]; (0, 3): rows
                                                 !! of points come by `put_geometry_of_rows`
    type(field_type), intent(in) :: fields(:)    !! (any number) that every output has
    integer, intent(in) :: planned_outputs       !! their number; 0: unknown
    type(column_type), intent(in) :: columns(:)  !! (any number) of the history
    integer, intent(in) :: planned_rows          !! their number; 0: unknown
    logical, intent(in) :: single                !! fields in single precision
    character(*), intent(in) :: scene_text       !! the resolved scene
    character(*), intent(in) :: command          !! the command line of the run
    character(*), intent(in) :: version          !! of the program
    type(error_type), allocatable, intent(out) :: error
    type(line_type), intent(in), optional :: lines(:)  !! (any number) with profiles; none without
    type(cells_type), intent(in), optional :: cells    !! of meshes; none without

    self%path = path
    self%current = path//'.part'
    if (present(cells)) self%layout%cells = cells
    call plan_layout(self, points, fields, planned_outputs, columns, planned_rows, single)
    if (present(lines)) self%layout%lines = lines
    call start_hdf5(error)
    if (allocated(error)) return
    call remove_file(path//'.grow')  ! a killed run may have left it
    call create_file(self%current, self%file, error)
    if (allocated(error)) then
      call remove_file(self%current)  ! there may be a file, with nothing in it
      return
    end if
    call self%layout%make_heart(self%file, error)
    if (.not. allocated(error)) call put_geometry(self%file, points, positions, &
      & self%layout%cells, error)
    if (.not. allocated(error)) call put_scene(self%file, scene_text, command, version, error)
    if (.not. allocated(error)) call make_group(self%file, '/points', error)
    if (.not. allocated(error)) call self%layout%make_time_series(self%file, error)
    if (allocated(error)) call self%abandon()
  end subroutine create

  !> What the file is to hold, and room for how much of it.
  subroutine plan_layout(self, points, fields, planned_outputs, columns, planned_rows, single)
    type(vtkhdf_file), intent(inout) :: self
    integer(i8), intent(in) :: points
    type(field_type), intent(in) :: fields(:)
    integer, intent(in) :: planned_outputs
    type(column_type), intent(in) :: columns(:)
    integer, intent(in) :: planned_rows
    logical, intent(in) :: single

    allocate (self%layout%lines(0))
    allocate (self%layout%fields, source=fields)
    allocate (self%layout%columns, source=columns)
    self%layout%points = points
    self%layout%single = single
    self%layout%capacity = default_outputs
    if (planned_outputs > 0) self%layout%capacity = planned_outputs
    self%layout%row_capacity = default_rows
    if (planned_rows > 0) self%layout%row_capacity = planned_rows
  end subroutine plan_layout

  !> Open a file that was left at or after the outputs and rows in `kept`, to be continued after
  !> `cut`; it is not changed yet. The other arguments are those of `create`. An error
  !> if the file has fewer of them, other times, or the results of another scene.
  subroutine resume(self, path, points, fields, planned_outputs, columns, planned_rows, single, &
    & scene_text, kept, error, lines, cells)
    class(vtkhdf_file), intent(out) :: self      !! open on return, unless an error is set
    character(*), intent(in) :: path             !! of the file, with its ending
    integer(i8), intent(in) :: points            !! their number
    type(field_type), intent(in) :: fields(:)    !! (any number) that every output has
    integer, intent(in) :: planned_outputs       !! of the whole run; 0: unknown
    type(column_type), intent(in) :: columns(:)  !! (any number) of the history
    integer, intent(in) :: planned_rows          !! of the whole run; 0: unknown
    logical, intent(in) :: single                !! fields in single precision
    character(*), intent(in) :: scene_text       !! the resolved scene of this run
    type(kept_type), intent(in) :: kept  !! rows, times and scene that the checkpoint counts on
    type(error_type), allocatable, intent(out) :: error
    type(line_type), intent(in), optional :: lines(:)  !! (any number) with profiles; none without
    type(cells_type), intent(in), optional :: cells    !! of meshes; none without
    character(:), allocatable :: text

    self%path = path
    self%current = path
    if (present(cells)) self%layout%cells = cells
    call plan_layout(self, points, fields, planned_outputs, columns, planned_rows, single)
    if (present(lines)) self%layout%lines = lines
    call start_hdf5(error)
    if (allocated(error)) return
    call remove_file(path//'.grow')
    call remove_file(path//'.part')
    call open_file(path, .true., self%file, error)
    if (allocated(error)) return
    self%sealed = .true.
    call get_text(self%file, '/scene/text', text, error)
    if (.not. allocated(error)) call check_kept(self, kept, error)
    if (.not. allocated(error) .and. text /= kept%scene_text .and. text /= scene_text) &
      & call fail(error, path//' holds the results of another scene than the checkpoint')
    if (allocated(error)) return
    self%outputs = size(kept%times, kind=i8)
    self%rows = size(kept%rows, 2, kind=i8)

    self%plan = self%layout
    self%plan%capacity = max(self%plan%capacity, self%outputs + 1)
    self%plan%row_capacity = max(self%plan%row_capacity, self%rows + 1)
    call find_capacity(self, error)
  end subroutine resume

  !> Remove the data beyond those that `resume` was told to keep, and make the room that the run
  !> needs; a changed `scene_text` is written. An error if the file cannot be read or written.
  subroutine cut(self, scene_text, command, version, error)
    class(vtkhdf_file), intent(inout) :: self    !! as `resume` left it; ready for an output on
                                                 !! return
    character(*), intent(in) :: scene_text       !! the resolved scene of this run
    character(*), intent(in) :: command          !! the command line of this run
    character(*), intent(in) :: version          !! of this program
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: text
    logical :: renew

    call get_text(self%file, '/scene/text', text, error)
    if (allocated(error)) return
    renew = self%layout%capacity < self%plan%capacity .or. &
      & self%layout%row_capacity < self%plan%row_capacity .or. text /= scene_text
    ! an earlier version made no views
    renew = renew .or. (.not. self%has_views() .and. &
      & views_fit(self%plan%fields, self%plan%capacity))
    if (renew) then
      call enlarge(self, self%plan%capacity, self%plan%row_capacity, error, scene_text, command, &
        & version)
    else
      call cut_back(self, error)
    end if
  end subroutine cut

  !> Whether the file shows its outputs one by one.
  logical function has_views(self)
    class(vtkhdf_file), intent(in) :: self  !! open
    has_views = object_exists(self%file, '/outputs')
  end function has_views

  !> Whether the file has the outputs and rows that the checkpoint counts.
  subroutine check_kept(self, kept, error)
    class(vtkhdf_file), intent(in) :: self
    type(kept_type), intent(in) :: kept
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: values(:)
    integer(i8) :: outputs, rows

    call get_attribute(self%file, '/VTKHDF/Steps', 'NSteps', outputs, error)
    if (.not. allocated(error)) call get_attribute(self%file, '/history', 'rows', rows, error)
    if (allocated(error)) return
    if (outputs < size(kept%times) .or. rows < size(kept%rows, 2)) then
      call fail(error, self%path//' holds '//to_text(outputs)//' outputs and '//to_text(rows)// &
        & ' rows of history, less than the '//to_text(size(kept%times))//' and '// &
        & to_text(size(kept%rows, 2))//' that the checkpoint counts on')
      return
    end if
    allocate (values(size(kept%times)))
    call read_rows(self%file, '/VTKHDF/Steps/Values', 0_i8, values, error)
    if (allocated(error)) return
    if (any(abs(values - kept%times) > 0.0_wp)) call fail(error, self%path// &
      & ' has outputs at other times than the checkpoint: it belongs to another run')
  end subroutine check_kept

  !> Room for how many outputs and rows a file was laid out for.
  subroutine find_capacity(self, error)
    class(vtkhdf_file), intent(inout) :: self
    type(error_type), allocatable, intent(out) :: error
    integer :: components

    call get_shape(self%file, '/VTKHDF/Steps/PartOffsets', components, self%layout%capacity, error)
    if (allocated(error) .or. size(self%layout%columns) == 0) return
    call get_chunk(self%file, '/history/'//trim(self%layout%columns(1)%name), &
      & self%layout%row_capacity, error)
  end subroutine find_capacity

  !> Let the file count its outputs and rows as they are counted here, which is less than before.
  subroutine cut_back(self, error)
    class(vtkhdf_file), intent(inout) :: self
    type(error_type), allocatable, intent(out) :: error

    ! as when they are added, the count never says more than a column has
    call change_attribute(self%file, '/history', 'rows', self%rows, error)
    if (.not. allocated(error)) call flush_file(self%file, error)
    if (.not. allocated(error)) call set_columns(self, max(1_i8, self%rows), error)
    if (.not. allocated(error)) call set_rows(self%file, '/VTKHDF/Steps/Values', 1, &
      & max(1_i8, self%outputs), error)
    if (.not. allocated(error)) call change_attribute(self%file, '/VTKHDF/Steps', 'NSteps', &
      & self%outputs, error)
    if (.not. allocated(error)) call flush_file(self%file, error)
  end subroutine cut_back

  !> An array of reals over the points. An error if its length is wrong or the layout has ended.
  subroutine put_points_real(self, name, values, error)
    class(vtkhdf_file), intent(inout) :: self      !! being laid out
    character(*), intent(in) :: name               !! of the array, below `/points`
    real(wp), contiguous, intent(in) :: values(:)  !! (n_points) in point order
    type(error_type), allocatable, intent(out) :: error
    call check_points(self, name, size(values, kind=i8), error)
    if (.not. allocated(error)) call put_array(self%file, '/points/'//trim(name), values, error)
  end subroutine put_points_real

  !> An array of 32-bit integers over the points. An error if its length is wrong or the layout has
  !> ended.
  subroutine put_points_i4(self, name, values, error)
    class(vtkhdf_file), intent(inout) :: self         !! being laid out
    character(*), intent(in) :: name                  !! of the array, below `/points`
    integer(i4), contiguous, intent(in) :: values(:)  !! (n_points) in point order
    type(error_type), allocatable, intent(out) :: error
    call check_points(self, name, size(values, kind=i8), error)
    if (.not. allocated(error)) call put_array(self%file, '/points/'//trim(name), values, error)
  end subroutine put_points_i4

  !> An array of 8-bit integers over the points. An error if its length is wrong or the layout has
  !> ended.
  subroutine put_points_i1(self, name, values, error)
    class(vtkhdf_file), intent(inout) :: self         !! being laid out
    character(*), intent(in) :: name                  !! of the array, below `/points`
    integer(i1), contiguous, intent(in) :: values(:)  !! (n_points) in point order
    type(error_type), allocatable, intent(out) :: error
    call check_points(self, name, size(values, kind=i8), error)
    if (.not. allocated(error)) call put_array(self%file, '/points/'//trim(name), values, error)
  end subroutine put_points_i1

  !> An array over the points has a value for each, and comes while the file is laid out.
  subroutine check_points(self, name, count, error)
    class(vtkhdf_file), intent(in) :: self
    character(*), intent(in) :: name
    integer(i8), intent(in) :: count
    type(error_type), allocatable, intent(out) :: error

    if (self%sealed) then
      call fail(error, 'points/'//trim(name)//' must be given before the first output')
    else if (count /= self%layout%points) then
      call fail(error, 'points/'//trim(name)//' needs one value for each point')
    end if
  end subroutine check_points

  !> Take part in the file of the first rank, without files of one's own: what is needed to write
  !> rows into it.
  subroutine attend(self, path, points, fields, single)
    class(vtkhdf_file), intent(out) :: self     !! not open; knows its rows on return
    character(*), intent(in) :: path            !! of the file, with its ending
    integer(i8), intent(in) :: points           !! of all ranks
    type(field_type), intent(in) :: fields(:)   !! (any number) that every output has
    logical, intent(in) :: single               !! fields in single precision

    self%path = path
    self%current = path
    call plan_layout(self, points, fields, 0, [column_type ::], 0, single)
  end subroutine attend

  !> Make an array over the points in `/points`, before the first output; its rows come by
  !> `put_rows_of_points`.
  subroutine make_points(self, name, kind_of_points, error)
    class(vtkhdf_file), intent(inout) :: self  !! being laid out
    character(*), intent(in) :: name           !! of the array, below `/points`
    integer, intent(in) :: kind_of_points      !! `real_points`, `short_points` or `byte_points`
    type(error_type), allocatable, intent(out) :: error

    call check_points(self, name, self%layout%points, error)
    if (.not. allocated(error)) call make_dataset(self%file, '/points/'//trim(name), &
      & kind_of_points, 1, self%layout%points, error)
  end subroutine make_points

  !> Write rows of an array over the points.
  subroutine put_rows_of_points(self, name, kind_of_points, first, values, error)
    class(vtkhdf_file), intent(inout) :: self      !! made; open, shared or by this rank alone
    character(*), intent(in) :: name               !! of the array, below `/points`
    integer, intent(in) :: kind_of_points          !! as it was made
    integer(i8), intent(in) :: first               !! row of the first value, from 0
    real(wp), contiguous, intent(in) :: values(:)  !! (rows) in point order
    type(error_type), allocatable, intent(out) :: error
    type(hdf5_file) :: file
    character(:), allocatable :: path

    file = self%file
    if (self%shared%id >= 0) file = self%shared
    path = '/points/'//trim(name)
    select case (kind_of_points)
    case (real_points)
      call write_rows(file, path, first, values, error)
    case (short_points)
      call write_rows(file, path, first, nint(values, i4), error)
    case (byte_points)
      call write_rows(file, path, first, nint(values, i1), error)
    case default
      call fail(error, 'points/'//trim(name)//' is of an unknown kind')
    end select
  end subroutine put_rows_of_points

  !> Write the positions of some points, and their vertices.
  subroutine put_geometry_of_rows(self, first, positions, most, error)
    class(vtkhdf_file), intent(inout) :: self  !! open, shared or by this rank alone
    integer(i8), intent(in) :: first           !! row of the first point, from 0
    real(wp), intent(in) :: positions(:, :)    !! (rows, 3) in point order [m]
    integer(i8), intent(in) :: most            !! rows of the rank that has most, where all write
    type(error_type), allocatable, intent(out) :: error
    type(hdf5_file) :: file

    file = self%file
    if (self%shared%id >= 0) file = self%shared
    call write_vectors(file, '/VTKHDF/Points', first, positions, .false., most, error)
    if (.not. allocated(error)) call write_vertices(file, first, size(positions, 1, kind=i8), &
      & self%layout%points, most, error)
  end subroutine put_geometry_of_rows

  !> Open the file on all ranks, to write rows into it until `close_shared`. HDF5's own records must
  !> not change in between. A file that the first rank has open, too: HDF5 knows it twice there, and
  !> the other way alone writes records.
  subroutine open_shared(self, published, error)
    class(vtkhdf_file), intent(inout) :: self  !! laid out by the first rank
    logical, intent(in) :: published           !! it has its final name
    type(error_type), allocatable, intent(out) :: error

    call start_hdf5(error)
    if (allocated(error)) return
    call open_file(self%path//trim(merge('     ', '.part', published)), .true., self%shared, &
      & error, together=.true.)
  end subroutine open_shared

  !> Close the file on all ranks.
  subroutine close_shared(self, error)
    class(vtkhdf_file), intent(inout) :: self  !! opened by `open_shared`
    type(error_type), allocatable, intent(out) :: error
    call close_file(self%shared, error)
  end subroutine close_shared

  !> Write rows of field `i` of output `output`.
  subroutine put_rows(self, i, output, first, values, most, error)
    class(vtkhdf_file), intent(inout) :: self  !! open, shared or by this rank alone
    integer, intent(in) :: i                   !! number of the field, from 1
    integer, intent(in) :: output              !! its number, from 0
    integer(i8), intent(in) :: first           !! row of the first value in the output, from 0
    real(wp), intent(in) :: values(:, :)       !! (rows, components) in point order
    integer(i8), intent(in) :: most            !! rows of the rank that has most, where all write
    type(error_type), allocatable, intent(out) :: error
    type(hdf5_file) :: file
    character(:), allocatable :: path
    integer(i8) :: at

    file = self%file
    if (self%shared%id >= 0) file = self%shared
    path = '/VTKHDF/PointData/'//trim(self%layout%fields(i)%name)
    at = output*self%layout%points + first
    if (size(values, 2) == 1) then
      call put_column(file, path, at, values(:, 1), self%layout%single, most, error)
    else
      call write_vectors(file, path, at, values, self%layout%single, most, error)
    end if
  end subroutine put_rows

  !> End the layout: from here on HDF5's own records stay as they are.
  subroutine seal(self, error)
    class(vtkhdf_file), intent(inout) :: self  !! laid out
    type(error_type), allocatable, intent(out) :: error

    if (self%sealed) return
    call close_file(self%file, error)
    if (.not. allocated(error)) call open_file(self%current, .true., self%file, error)
    self%sealed = .not. allocated(error)
  end subroutine seal

  !> Make room for the next output.
  subroutine begin_output(self, error)
    class(vtkhdf_file), intent(inout) :: self  !! with room for the output on return
    type(error_type), allocatable, intent(out) :: error

    call seal(self, error)
    if (allocated(error)) return
    if (self%outputs >= self%layout%capacity) &
      & call enlarge(self, 2*self%layout%capacity, self%layout%row_capacity, error)
  end subroutine begin_output

  !> Write field `i` of the output under way: `values(n)`.
  subroutine put_scalar(self, i, values, error)
    class(vtkhdf_file), intent(inout) :: self      !! the results file
    integer, intent(in) :: i                       !! number of the field, from 1
    real(wp), contiguous, intent(in) :: values(:)  !! (n_points) in point order, in the field's unit
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: name
    integer(i8) :: at

    name = trim(self%layout%fields(i)%name)
    associate (layout => self%layout, rule => self%layout%fields(i)%at_nodes)
      at = self%outputs*layout%rows_of_output()
      call put_column(self%file, '/VTKHDF/PointData/'//name, at, values, layout%single, &
        & size(values, kind=i8), error)
      if (layout%cells%n_cells() == 0 .or. allocated(error)) return
      call put_column(self%file, '/VTKHDF/PointData/'//name, at + layout%points, &
        & at_nodes(layout%cells, rule, values), layout%single, layout%cells%n_nodes(), error)
      if (.not. allocated(error)) call put_column(self%file, '/VTKHDF/CellData/'//name, &
        & self%outputs*layout%cells%n_cells(), of_cells(layout%cells, rule, values), &
        & layout%single, layout%cells%n_cells(), error)
    end associate
  end subroutine put_scalar

  !> Write numbers from row `at` of a dataset on. `most`: rows of the rank that has most, where all
  !> write.
  subroutine put_column(file, path, at, values, single, most, error)
    type(hdf5_file), intent(in) :: file
    character(*), intent(in) :: path
    integer(i8), intent(in) :: at
    real(wp), contiguous, intent(in) :: values(:)
    logical, intent(in) :: single
    integer(i8), intent(in) :: most
    type(error_type), allocatable, intent(out) :: error
    real(sp), allocatable :: short(:)
    integer(i8) :: n, first, last, k, pieces

    n = size(values, kind=i8)
    pieces = pieces_of(file, most)
    do k = 1, pieces
      first = n*(k - 1)/pieces
      last = n*k/pieces
      if (single) then
        short = to_single(values(first + 1:last))
        call write_rows(file, path, at + first, short, error)
      else
        call write_rows(file, path, at + first, values(first + 1:last), error)
      end if
      if (allocated(error)) return
    end do
  end subroutine put_column

  !> Write field `i` of the output under way: `values(n, components)`.
  subroutine put_vector(self, i, values, error)
    class(vtkhdf_file), intent(inout) :: self  !! the results file
    integer, intent(in) :: i                   !! number of the field, from 1
    real(wp), intent(in) :: values(:, :)       !! (n_points, 3) in point order, in the field's unit
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: nodes(:, :), cells(:, :)
    character(:), allocatable :: name
    integer(i8) :: at
    integer :: c

    name = trim(self%layout%fields(i)%name)
    associate (layout => self%layout, rule => self%layout%fields(i)%at_nodes)
      at = self%outputs*layout%rows_of_output()
      call write_vectors(self%file, '/VTKHDF/PointData/'//name, at, values, layout%single, &
        & size(values, 1, kind=i8), error)
      if (layout%cells%n_cells() == 0 .or. allocated(error)) return
      allocate (nodes(layout%cells%n_nodes(), size(values, 2)))
      allocate (cells(layout%cells%n_cells(), size(values, 2)))
      do c = 1, size(values, 2)
        nodes(:, c) = at_nodes(layout%cells, rule, values(:, c))
        cells(:, c) = of_cells(layout%cells, rule, values(:, c))
      end do
      call write_vectors(self%file, '/VTKHDF/PointData/'//name, at + layout%points, nodes, &
        & layout%single, layout%cells%n_nodes(), error)
      if (.not. allocated(error)) call write_vectors(self%file, '/VTKHDF/CellData/'//name, &
        & self%outputs*layout%cells%n_cells(), cells, layout%single, layout%cells%n_cells(), error)
    end associate
  end subroutine put_vector

  !> Write the profiles of line `i` of the output under way.
  subroutine put_line(self, i, values, error)
    class(vtkhdf_file), intent(inout) :: self  !! the results file
    integer, intent(in) :: i                   !! number of the line, from 1
    real(wp), intent(in) :: values(:, :)       !! (components of all its fields, position)
    type(error_type), allocatable, intent(out) :: error
    call put_profile(self%file, self%layout%lines(i), self%outputs, values, error)
  end subroutine put_line

  !> Complete the output under way at `time` [s]: from here on it counts.
  subroutine end_output(self, time, error)
    class(vtkhdf_file), intent(inout) :: self  !! with one complete output more on return
    real(wp), intent(in) :: time               !! of the state [s]
    type(error_type), allocatable, intent(out) :: error
    type(error_type), allocatable :: ignored

    call set_rows(self%file, '/VTKHDF/Steps/Values', 1, self%outputs + 1, error)
    if (allocated(error)) return
    call write_rows(self%file, '/VTKHDF/Steps/Values', self%outputs, [time], error)
    if (.not. allocated(error)) call change_attribute(self%file, '/VTKHDF/Steps', 'NSteps', &
      & self%outputs + 1, error)
    if (allocated(error)) then
      ! the new length is still in memory only: take it back
      call set_rows(self%file, '/VTKHDF/Steps/Values', 1, max(1_i8, self%outputs), ignored)
      return
    end if
    call flush_file(self%file, error)
    if (.not. allocated(error)) self%outputs = self%outputs + 1
  end subroutine end_output

  !> Append `table(rows, columns)` to the history.
  subroutine append_rows(self, table, error)
    class(vtkhdf_file), intent(inout) :: self        !! with these rows on return
    real(wp), contiguous, intent(in) :: table(:, :)  !! (row, column) to be added
    type(error_type), allocatable, intent(out) :: error
    type(error_type), allocatable :: ignored
    integer(i8) :: rows
    integer :: i

    rows = self%rows + size(table, 1, kind=i8)
    if (size(table, 1) == 0) return
    call seal(self, error)
    if (allocated(error)) return
    if (rows > self%layout%row_capacity) &
      & call enlarge(self, self%layout%capacity, max(rows, 2*self%layout%row_capacity), error)
    if (.not. allocated(error)) call set_columns(self, rows, error)
    do i = 1, size(self%layout%columns)
      if (allocated(error)) exit
      call write_rows(self%file, '/history/'//trim(self%layout%columns(i)%name), self%rows, &
        & table(:, i), error)
    end do
    if (allocated(error)) then
      ! the new lengths are still in memory only: take them back
      call set_columns(self, max(1_i8, self%rows), ignored)
      return
    end if
    ! the count follows the columns' lengths, so that it never says more than a column has
    call flush_file(self%file, error)
    if (.not. allocated(error)) call change_attribute(self%file, '/history', 'rows', rows, error)
    if (.not. allocated(error)) call flush_file(self%file, error)
    if (.not. allocated(error)) self%rows = rows
  end subroutine append_rows

  !> Give all columns of the history the same length.
  subroutine set_columns(self, rows, error)
    class(vtkhdf_file), intent(in) :: self
    integer(i8), intent(in) :: rows
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    do i = 1, size(self%layout%columns)
      call set_rows(self%file, '/history/'//trim(self%layout%columns(i)%name), 1, rows, error)
      if (allocated(error)) return
    end do
  end subroutine set_columns

  !> Copy the file into one with more room, which takes its place; with another scene, if one is
  !> given.
  subroutine enlarge(self, capacity, row_capacity, error, scene_text, command, version)
    class(vtkhdf_file), intent(inout) :: self
    integer(i8), intent(in) :: capacity, row_capacity
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in), optional :: scene_text, command, version
    type(error_type), allocatable :: ignored
    type(hdf5_file) :: bigger
    character(:), allocatable :: name
    integer(i8) :: old_capacity, old_rows

    old_capacity = self%layout%capacity
    old_rows = self%layout%row_capacity
    self%layout%capacity = capacity
    self%layout%row_capacity = row_capacity
    name = self%path//'.grow'
    call create_file(name, bigger, error)
    if (.not. allocated(error)) call self%layout%make_heart(bigger, error)
    if (.not. allocated(error)) call self%layout%copy_static(self%file, bigger, error)
    if (.not. allocated(error)) then
      if (present(scene_text)) then
        call put_scene(bigger, scene_text, command, version, error)
      else
        call copy_scene(self%file, bigger, error)
      end if
    end if
    if (.not. allocated(error)) call self%layout%make_time_series(bigger, error)
    if (.not. allocated(error)) call self%layout%copy_time_series(self%file, &
      & self%outputs, self%rows, old_capacity, bigger, error)
    if (.not. allocated(error)) then
      call close_file(bigger, error)
    else
      call close_file(bigger, ignored)
    end if
    if (.not. allocated(error)) call close_file(self%file, error)
    if (.not. allocated(error)) call rename_file(name, self%current, error)
    if (.not. allocated(error)) then
      call open_file(self%current, .true., self%file, error)
    else
      call remove_file(name)
      self%layout%capacity = old_capacity
      self%layout%row_capacity = old_rows
    end if
  end subroutine enlarge

  !> Give the file its final name, in place of an older one.
  subroutine publish(self, error)
    class(vtkhdf_file), intent(inout) :: self  !! has its final name on return
    type(error_type), allocatable, intent(out) :: error

    if (self%current == self%path) return
    call seal(self, error)
    if (.not. allocated(error)) call rename_file(self%current, self%path, error)
    if (allocated(error)) return
    self%current = self%path
    self%file%name = self%path
  end subroutine publish

  !> Wait until all that was written is on the disk.
  subroutine sync(self, error)
    class(vtkhdf_file), intent(inout) :: self  !! the results file
    type(error_type), allocatable, intent(out) :: error

    call flush_file(self%file, error)
    if (.not. allocated(error)) call sync_path(self%current, error)
  end subroutine sync

  !> Close the file with its unused space, to continue it later.
  subroutine leave(self, error)
    class(vtkhdf_file), intent(inout) :: self  !! not open on return
    type(error_type), allocatable, intent(out) :: error
    call close_file(self%file, error)
  end subroutine leave

  !> Keep the warnings of a run as `/scene/warnings`, in place of those that are there. To be called
  !> before `finish`, since it changes HDF5's own records. A file without them is as good.
  subroutine put_warnings(self, text)
    class(vtkhdf_file), intent(inout) :: self  !! the results file
    character(*), intent(in) :: text           !! a line for each; '' for none
    type(error_type), allocatable :: ignored

    if (self%file%id < 0) return
    if (object_exists(self%file, '/scene/warnings')) &
      & call remove_object(self%file, '/scene/warnings', ignored)
    if (text /= '') call put_text(self%file, '/scene/warnings', text, ignored)
  end subroutine put_warnings

  !> Remove unused space and close the file.
  subroutine finish(self, error)
    class(vtkhdf_file), intent(inout) :: self  !! open or not; not open on return
    type(error_type), allocatable, intent(out) :: error

    if (self%file%id < 0) return
    call self%layout%trim_time_series(self%file, self%outputs, self%rows, error)
    if (.not. allocated(error)) call close_file(self%file, error)
  end subroutine finish

  !> Write nothing more. A file that has its final name is left as it was at its last complete
  !> output: closing it would write records that belong to what failed, so its identifier is
  !> given up instead. One that never got its final name is removed.
  subroutine abandon(self)
    class(vtkhdf_file), intent(inout) :: self  !! open or not; not open on return
    type(error_type), allocatable :: ignored

    if (allocated(self%current)) then
      if (self%current /= self%path) then
        call close_file(self%file, ignored)
        call remove_file(self%current)
      end if
    end if
    self%file%id = -1
    self%shared%id = -1
  end subroutine abandon

  !> Bytes that one output takes.
  pure integer(i8) function output_bytes(self)
    class(vtkhdf_file), intent(in) :: self  !! the results file
    output_bytes = self%layout%output_bytes()
  end function output_bytes

  !> Bytes that are written before the first output.
  pure integer(i8) function layout_bytes(self)
    class(vtkhdf_file), intent(in) :: self  !! the results file
    layout_bytes = self%layout%fixed_bytes()
  end function layout_bytes

end module pd_output_results_vtkhdf
