!> The results of a run, in the files that the user selects: the interface for the solver.
!>
!>     call results%create(directory, stem, positions, fields, ...)
!>     call results%put_points('volume', volume, error)       ! any number of these
!>     call results%settle(error)                             ! needed on several ranks only
!>     call results%add_row([...], error)                     ! at any time
!>     call results%begin_output(time, error)
!>     call results%put_field('displacement', u, error)       ! each field once
!>     call results%end_output(error)
!>     call results%close(error)
!>
!> Nothing of an earlier run is touched before the first output is complete. After an error call
!> `close` none the less: it leaves the files as they were at the last complete output. Where there
!> are none, the folder is removed again if `create` made it.
!>
!> Several ranks share the rows of the points (`pd_output_results_shared`), and all make the same
!> calls, each with its own rows. The first one has the files.
!>
!> Without a folder nothing is written. The history is in memory in any case; with `keep_outputs` so
!> are the fields of the last output, and `answer` gives both.
module pd_output_results_results
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_text, only: join, lower_case, to_text, with_unit
  use pd_output_checkpoint_checkpoint, only: remove_checkpoints
  use pd_output_results_answer, only: answer_type, values_type
  use pd_output_results_cells, only: cells_type
  use pd_output_results_description, only: check_description, has_list
  use pd_output_checkpoint_earlier, only: existing_results, mark_complete, mark_unfinished, &
    & refuse_existing
  use pd_output_results_files, only: file_exists, in_directory, make_directory, remove_empty, &
    & remove_file, sync_path
  use pd_output_results_history, only: csv_type, history_type
  use pd_output_results_lines, only: lines_type
  use pd_output_results_rows, only: all_rows, rows_type
  use pd_output_results_shared, only: shared_type
  use pd_output_results_sink, only: sink_type
  use pd_output_results_profiles, only: add_profile, head_of_profile
  use pd_output_results_types, only: column_type, field_type, kept_type, label_length, line_type
  use pd_output_results_vtkhdf, only: byte_points, real_points, short_points, vtkhdf_file
  use pd_output_results_surfaces, only: remove_surfaces, surface_series, triangles_type
  use pd_output_results_vtu, only: vtu_ending, vtu_series
  use pd_output_results_xdmf, only: xdmf_file
  use pd_output_results_xml, only: remove_series
  implicit none (type, external)
  private
  public :: results_type, column_type, field_type, label_length

  !> The results of one run.
  type :: results_type
    private
    character(:), allocatable :: directory, stem
    type(field_type), allocatable :: fields(:)
    type(column_type), allocatable :: columns(:)
    logical, allocatable :: given(:)     !! fields of the output under way
    type(vtkhdf_file) :: vtkhdf
    type(xdmf_file) :: xdmf              !! lists what is in the HDF5 file
    type(vtu_series) :: vtu
    type(surface_series) :: surfaces     !! of rigid bodies
    real(wp), allocatable :: places(:, :), velocity(:, :)  !! of their vertices in the output under
                                                           !! way
    type(history_type) :: history
    type(csv_type) :: csv
    type(lines_type) :: iterations, fragments
    type(line_type), allocatable :: lines(:)
    type(lines_type), allocatable :: profiles(:)        !! their tables
    type(values_type), allocatable :: waiting(:)        !! their values of the output under way
    type(shared_type) :: shared          !! rows of the points, and how ranks write them
    integer :: planned_outputs = 0
    integer :: outputs = 0               !! complete ones
    character(:), allocatable :: warnings       !! a line for each
    real(wp), allocatable :: times(:)    !! of them [s]
    real(wp) :: time = 0.0_wp            !! of the output under way [s]
    logical :: in_output = .false.
    logical :: use_vtkhdf = .false., use_xdmf = .false., use_vtu = .false.
    logical :: use_surfaces = .false.
    logical :: open = .false.
    logical :: started = .false.         !! the files have their names
    logical :: resumed = .false.         !! they are those of a run that continues
    logical :: failed = .false.
    logical :: in_files = .true.         !! there is a folder to write to
    integer :: made_folder = 0           !! part of its path that was made, as of `make_directory`
    real(wp), allocatable :: positions(:, :)       !! what stays in memory: points, ...
    type(values_type), allocatable :: latest(:)    !! fields of the output under way, ...
    type(values_type), allocatable :: complete(:)  !! and of the last complete one
  contains
    procedure :: create
    procedure, private :: put_points_real, put_points_i4, put_points_i1
    !> Write an array over the points (volume [m3], body, region_NAME, ...), before the first
    !> output: `values(n)` real, 32-bit or 8-bit integer. Only the HDF5 file has a place for it.
    generic :: put_points => put_points_real, put_points_i4, put_points_i1
    procedure :: settle
    procedure :: begin_output
    procedure, private :: put_scalar_at, put_vector_at, put_scalar_named, put_vector_named
    !> Write one field of the output under way, by its number or name: `values(n)`, or
    !> `values(n, components)`.
    generic :: put_field => put_scalar_at, put_vector_at, put_scalar_named, put_vector_named
    procedure :: put_line
    procedure :: put_surfaces
    procedure :: end_output
    procedure :: add_row
    procedure :: add_iteration
    procedure :: add_fragments
    procedure :: put_warnings
    procedure :: close => close_results
    procedure :: sync
    procedure :: kept => rows_and_times
    procedure :: resumes
    procedure :: written_by
    procedure :: keep_outputs
    procedure :: answer
  end type results_type

contains

  !> Begin the results `directory/stem.*` and `directory/history.csv`, or, where `directory` is '',
  !> results that are in memory alone.
  !>
  !> Everything per point comes in point order. `planned_outputs` and `planned_rows` may be too few
  !> or 0 (unknown): the file then grows by copying itself. With `kept`, the files that are there go
  !> on after the outputs and rows in it; where there are none, new ones begin with its rows.
  !>
  !> An error if the description is unusable, if older results are in the way, if the files do not
  !> belong to the checkpoint, or if they cannot be written.
  subroutine create(self, directory, stem, positions, fields, planned_outputs, columns, &
    & planned_rows, precision, format, scene_text, command, version, overwrite, error, kept, &
    & lines, cells, triangles, rows)
    class(results_type), intent(out) :: self       !! open on return, unless an error is set
    character(*), intent(in) :: directory          !! folder of the files, made if needed; '' for
                                                   !! the current one
    character(*), intent(in) :: stem               !! name of the files without their endings
    real(wp), intent(in) :: positions(:, :)        !! (n_points, 3) in point order [m], of the rows
                                                   !! of this rank
    type(field_type), intent(in) :: fields(:)      !! (any number) that every output has
    integer, intent(in) :: planned_outputs         !! their number; 0: unknown
    type(column_type), intent(in) :: columns(:)    !! (any number) of the history; none: no history
                                                   !! file
    integer, intent(in) :: planned_rows            !! their number; 0: unknown
    character(*), intent(in) :: precision          !! of the fields: 'double' or 'single'
    character(*), intent(in) :: format             !! 'vtkhdf', 'vtu' or 'both'
    character(*), intent(in) :: scene_text         !! the resolved scene, kept in the file
    character(*), intent(in) :: command            !! the command line of the run, kept in the file
    character(*), intent(in) :: version            !! of the program, kept in the file
    logical, intent(in) :: overwrite               !! older results may go; else they are an error
    type(error_type), allocatable, intent(out) :: error
    type(kept_type), intent(in), optional :: kept  !! rows, times and scene of a checkpoint to start
                                                   !! from; absent: a new run
    type(line_type), intent(in), optional :: lines(:)  !! (any number) with profiles in each output
    type(cells_type), intent(in), optional :: cells    !! of meshes, for the HDF5 file and its list
    type(triangles_type), intent(in), optional :: triangles
      !! of rigid bodies, for files of their own; none without
    type(rows_type), intent(in), optional :: rows  !! that this rank writes; absent: all
    logical :: single

    call check_description(positions, fields, columns, precision, format, error)
    if (allocated(error)) return
    self%shared%rows = all_rows(size(positions, 1))
    if (present(rows)) self%shared%rows = rows
    self%resumed = .false.
    self%in_files = directory /= '' .and. self%shared%rows%on_first
    if (self%in_files) then
      if (present(kept)) self%resumed = existing_results(directory, stem) /= ''
      if (.not. self%resumed) call refuse_existing(directory, stem, overwrite, error)
      if (allocated(error)) return
      call make_directory(directory, error, self%made_folder)
      if (allocated(error)) return
    end if

    self%directory = trim(directory)
    self%stem = trim(stem)
    allocate (self%fields, source=fields)
    allocate (self%columns, source=columns)
    allocate (self%given(size(fields)), source=.false.)
    self%planned_outputs = planned_outputs
    allocate (self%lines(0))
    if (present(lines)) self%lines = lines
    allocate (self%profiles(size(self%lines)), self%waiting(size(self%lines)))
    single = lower_case(precision) == 'single'
    self%use_vtkhdf = self%in_files .and. lower_case(format) /= 'vtu'
    self%use_vtu = self%in_files .and. lower_case(format) /= 'vtkhdf'
    self%shared%has_hdf5 = self%use_vtkhdf
    self%shared%has_vtu = self%use_vtu
    if (directory /= '' .and. self%shared%divided()) call self%shared%share( &
      & in_directory(directory, self%stem//'.vtkhdf'), format, fields, single, self%resumed, &
      & self%vtkhdf)
    if (self%use_vtu .or. self%shared%divided()) self%shared%here = positions
    ! room for one output at least; whether there are too many shows with the file
    self%use_xdmf = self%use_vtkhdf .and. has_list(stem, format, fields, 1)
    if (present(triangles)) self%use_surfaces = self%in_files .and. size(triangles%body) > 0
    call self%history%start(size(columns))
    allocate (self%times(0))
    if (present(kept)) then
      ! rows with other columns, those of other probes for instance, cannot be continued
      if (size(kept%rows, 1) == size(columns)) &
        & call self%history%restore(kept%rows, written=self%resumed)
    end if
    if (self%use_vtu) call self%vtu%create(self%directory, self%stem, int(self%shared%rows%all), &
      & fields, single)
    if (self%use_surfaces) call self%surfaces%create(self%directory, self%stem, triangles)
    if (self%use_xdmf) call self%xdmf%create(in_directory(directory, self%stem//'.xdmf'), &
      & self%stem//'.vtkhdf', self%shared%rows%all, fields, planned_outputs, single, cells)
    if (self%resumed .and. self%in_files) then
      if (self%use_vtkhdf) call self%vtkhdf%resume(in_directory(directory, self%stem//'.vtkhdf'), &
        & self%shared%rows%all, fields, planned_outputs, columns, planned_rows, single, &
        & scene_text, kept, error, self%lines, cells)
      if (self%use_vtkhdf .and. .not. allocated(error)) &
        & call cut_back(self, kept%times, scene_text, command, version, error)
      if (.not. allocated(error)) call resume_others(self, kept, error)
      if (allocated(error)) return
    else if (self%resumed) then
      self%times = kept%times
      self%outputs = size(kept%times)
      self%started = .true.
    else if (self%use_vtkhdf) then
      call self%vtkhdf%create(in_directory(directory, self%stem//'.vtkhdf'), self%shared%rows%all, &
        & positions(:merge(0, size(positions, 1), self%shared%divided()), :), fields, &
        & planned_outputs, columns, planned_rows, single, scene_text, command, version, error, &
        & self%lines, cells)
      if (allocated(error)) then
        call explain_need(self, 'the layout', self%vtkhdf%layout_bytes(), error)
        call remove_empty(self%directory, self%made_folder)
        return
      end if
    end if
    self%open = .true.
  end subroutine create

  !> Cut the HDF5 file to the outputs at `times`, and the list of its outputs before it, so that the
  !> list never has more of them than the file.
  subroutine cut_back(self, times, scene_text, command, version, error)
    class(results_type), intent(inout) :: self
    real(wp), intent(in) :: times(:)
    character(*), intent(in) :: scene_text, command, version
    type(error_type), allocatable, intent(out) :: error
    logical :: listed

    listed = self%use_xdmf .and. self%vtkhdf%has_views()
    if (listed) call self%xdmf%resume(times, error)
    if (.not. allocated(error)) call self%vtkhdf%cut(scene_text, command, version, error)
    if (allocated(error)) return
    call check_views(self)
    if (self%use_xdmf .and. .not. listed) call self%xdmf%resume(times, error)
  end subroutine cut_back

  !> A file with too many outputs does not show them one by one: then there is no list of them.
  subroutine check_views(self)
    class(results_type), intent(inout) :: self

    if (.not. self%use_xdmf) return
    self%use_xdmf = self%vtkhdf%has_views()
    if (self%use_xdmf) return
    if (self%started .or. self%resumed) then
      call self%xdmf%give_up()
    else
      call self%xdmf%abandon()  ! an earlier run's list stays until the first output is complete
    end if
  end subroutine check_views

  !> Begin the tables of the lines, or continue them behind the complete outputs.
  subroutine begin_profiles(self, go_on, error)
    class(results_type), intent(inout) :: self
    logical, intent(in) :: go_on
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    do i = 1, size(self%lines)
      call self%profiles(i)%begin(in_directory(self%directory, trim(self%lines(i)%name)//'.csv'), &
        & head_of_profile(self%lines(i)), go_on, self%outputs - 1, error)
      if (allocated(error)) return
    end do
  end subroutine begin_profiles

  !> Continue the files beside the HDF5 file.
  subroutine resume_others(self, kept, error)
    class(results_type), intent(inout) :: self
    type(kept_type), intent(in) :: kept
    type(error_type), allocatable, intent(out) :: error

    self%times = kept%times
    self%outputs = size(kept%times)
    call mark_unfinished(self%directory, self%stem, error)
    if (self%use_vtu .and. .not. allocated(error)) call self%vtu%resume(kept%times, error)
    if (self%use_surfaces .and. .not. allocated(error)) call self%surfaces%resume(kept%times, error)
    if (size(self%columns) > 0 .and. .not. allocated(error)) call self%csv%replace( &
      & in_directory(self%directory, 'history.csv'), self%columns, kept%rows, error)
    if (.not. allocated(error)) call begin_profiles(self, .true., error)
    self%started = .not. allocated(error)
  end subroutine resume_others

  !> An array of reals over the points. An error if its length is wrong or an output has begun.
  subroutine put_points_real(self, name, values, error)
    class(results_type), intent(inout) :: self     !! the results
    character(*), intent(in) :: name               !! of the array, below `/points`
    real(wp), contiguous, intent(in) :: values(:)  !! (n_points) in point order
    type(error_type), allocatable, intent(out) :: error
    if (self%shared%divided()) then
      call self%shared%put_points(self%vtkhdf, name, real_points, values, error)
    else if (self%use_vtkhdf) then
      call self%vtkhdf%put_points(name, values, error)
    end if
    if (allocated(error)) self%failed = .true.
  end subroutine put_points_real

  !> An array of 32-bit integers over the points. An error if its length is wrong or an output has
  !> begun.
  subroutine put_points_i4(self, name, values, error)
    class(results_type), intent(inout) :: self        !! the results
    character(*), intent(in) :: name                  !! of the array, below `/points`
    integer(i4), contiguous, intent(in) :: values(:)  !! (n_points) in point order
    type(error_type), allocatable, intent(out) :: error
    if (self%shared%divided()) then
      call self%shared%put_points(self%vtkhdf, name, short_points, real(values, wp), error)
    else if (self%use_vtkhdf) then
      call self%vtkhdf%put_points(name, values, error)
    end if
    if (allocated(error)) self%failed = .true.
  end subroutine put_points_i4

  !> An array of 8-bit integers over the points. An error if its length is wrong or an output has
  !> begun.
  subroutine put_points_i1(self, name, values, error)
    class(results_type), intent(inout) :: self        !! the results
    character(*), intent(in) :: name                  !! of the array, below `/points`
    integer(i1), contiguous, intent(in) :: values(:)  !! (n_points) in point order
    type(error_type), allocatable, intent(out) :: error
    if (self%shared%divided()) then
      call self%shared%put_points(self%vtkhdf, name, byte_points, real(values, wp), error)
    else if (self%use_vtkhdf) then
      call self%vtkhdf%put_points(name, values, error)
    end if
    if (allocated(error)) self%failed = .true.
  end subroutine put_points_i1

  !> On several ranks, after the last `put_points` and before the first output: write what the
  !> points are, unless the files go on from an earlier run.
  subroutine settle(self, error)
    class(results_type), intent(inout) :: self  !! created
    type(error_type), allocatable, intent(out) :: error

    call self%shared%settle(self%vtkhdf, self%resumed, error)
    if (allocated(error)) self%failed = .true.
  end subroutine settle

  !> Begin the output of the state at `time` [s]. An error if the results are not open, if another
  !> output is under way, or if the files cannot be written.
  subroutine begin_output(self, time, error)
    class(results_type), intent(inout) :: self  !! open; an output is under way on return
    real(wp), intent(in) :: time                !! of the state [s]; in a relaxation its load factor
    type(error_type), allocatable, intent(out) :: error

    if (.not. self%open .or. self%in_output) then
      call fail(error, 'an output begins in results that are not open, or within another')
      return
    end if
    self%given = .false.
    self%time = time
    if (self%use_vtkhdf) call self%vtkhdf%begin_output(error)
    if (.not. allocated(error)) call check_views(self)
    if (self%use_xdmf .and. .not. allocated(error)) call self%xdmf%begin_output(error)
    if (self%use_vtu .and. .not. allocated(error)) call self%vtu%begin_output(error)
    if (.not. allocated(error)) call self%shared%begin_output(self%vtkhdf, self%vtu, &
      & self%started .or. self%resumed, error)
    if (allocated(error)) call explain_output(self, error)
    self%in_output = .not. allocated(error)
  end subroutine begin_output

  !> A field of one component, by its number. An error outside an output, for a field given twice or
  !> of another shape, or if it cannot be written.
  subroutine put_scalar_at(self, field, values, error)
    class(results_type), intent(inout) :: self     !! with an output under way
    integer, intent(in) :: field                   !! its number, from 1
    real(wp), contiguous, intent(in) :: values(:)  !! (n_points) in point order, in the field's unit
    type(error_type), allocatable, intent(out) :: error

    call check_field(self, field, size(values), 1, error)
    if (allocated(error)) return
    if (self%shared%divided()) then
      call self%shared%put_field(self%vtkhdf, self%vtu, field, self%outputs, &
        & reshape(values, [size(values), 1]), error)
    else
      if (self%use_vtkhdf) call self%vtkhdf%put_field(field, values, error)
      if (self%use_vtu .and. .not. allocated(error)) call self%vtu%put_field(field, 0_i8, &
        & reshape(values, [size(values), 1]), error)
    end if
    if (allocated(error)) call explain_output(self, error)
    self%given(field) = .not. allocated(error)
    if (allocated(self%latest)) self%latest(field)%values = reshape(values, [size(values), 1])
  end subroutine put_scalar_at

  !> A field of three components, by its number. An error outside an output, for a field given twice
  !> or of another shape, or if it cannot be written.
  subroutine put_vector_at(self, field, values, error)
    class(results_type), intent(inout) :: self  !! with an output under way
    integer, intent(in) :: field                !! its number, from 1
    real(wp), intent(in) :: values(:, :)        !! (n_points, 3) in point order, in the field's
                                                !! unit; unused components 0
    type(error_type), allocatable, intent(out) :: error

    call check_field(self, field, size(values, 1), size(values, 2), error)
    if (allocated(error)) return
    if (self%shared%divided()) then
      call self%shared%put_field(self%vtkhdf, self%vtu, field, self%outputs, values, error)
    else
      if (self%use_vtkhdf) call self%vtkhdf%put_field(field, values, error)
      if (self%use_vtu .and. .not. allocated(error)) call self%vtu%put_field(field, 0_i8, values, &
        & error)
    end if
    if (allocated(error)) call explain_output(self, error)
    self%given(field) = .not. allocated(error)
    if (allocated(self%latest)) self%latest(field)%values = values
  end subroutine put_vector_at

  !> The profiles of a line in the output under way, by its number. An error outside an output, for
  !> another shape, or if they cannot be written.
  subroutine put_line(self, number, values, error)
    class(results_type), intent(inout) :: self   !! with an output under way
    integer, intent(in) :: number                !! of the line, from 1
    real(wp), intent(in) :: values(:, :)         !! (components of all its fields, position)
    type(error_type), allocatable, intent(out) :: error

    if (.not. self%in_output .or. number < 1 .or. number > size(self%lines)) then
      call fail(error, 'line '//to_text(number)//' is given outside an output, or there is none')
      return
    end if
    associate (line => self%lines(number))
      if (any(shape(values) /= [sum(line%fields%components), size(line%positions, 1)])) then
        call fail(error, 'line '//trim(line%name)//' is given with another shape')
        return
      end if
    end associate
    if (self%use_vtkhdf) call self%vtkhdf%put_line(number, values, error)
    if (allocated(error)) call explain_output(self, error)
    self%waiting(number)%values = values
  end subroutine put_line

  !> Where the vertices of the triangles are in the output under way. An error outside an output.
  subroutine put_surfaces(self, places, velocity, error)
    class(results_type), intent(inout) :: self   !! with an output under way
    real(wp), intent(in) :: places(:, :)         !! (vertices, 3) [m]
    real(wp), intent(in) :: velocity(:, :)       !! (vertices, 3) [m/s]
    type(error_type), allocatable, intent(out) :: error

    if (.not. self%in_output) then
      call fail(error, 'surfaces are given outside an output')
      return
    end if
    self%places = places
    self%velocity = velocity
  end subroutine put_surfaces

  !> Write what the tables of the lines get from the output under way.
  subroutine write_profiles(self, error)
    class(results_type), intent(inout) :: self
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    if (.not. self%in_files) return
    do i = 1, size(self%lines)
      call add_profile(self%profiles(i), self%lines(i), self%outputs, self%time, &
        & self%waiting(i)%values, error)
      if (allocated(error)) return
    end do
  end subroutine write_profiles

  !> A field of one component, by its name. An error as by its number, and for an unknown name.
  subroutine put_scalar_named(self, name, values, error)
    class(results_type), intent(inout) :: self     !! with an output under way
    character(*), intent(in) :: name               !! of the field
    real(wp), contiguous, intent(in) :: values(:)  !! (n_points) in point order, in the field's unit
    type(error_type), allocatable, intent(out) :: error
    integer :: field

    call find_field(self, name, field, error)
    if (.not. allocated(error)) call self%put_field(field, values, error)
  end subroutine put_scalar_named

  !> A field of three components, by its name. An error as by its number, and for an unknown name.
  subroutine put_vector_named(self, name, values, error)
    class(results_type), intent(inout) :: self  !! with an output under way
    character(*), intent(in) :: name            !! of the field
    real(wp), intent(in) :: values(:, :)        !! (n_points, 3) in point order, in the field's
                                                !! unit; unused components 0
    type(error_type), allocatable, intent(out) :: error
    integer :: field

    call find_field(self, name, field, error)
    if (.not. allocated(error)) call self%put_field(field, values, error)
  end subroutine put_vector_named

  !> The number of a field.
  subroutine find_field(self, name, field, error)
    class(results_type), intent(in) :: self
    character(*), intent(in) :: name
    integer, intent(out) :: field
    type(error_type), allocatable, intent(out) :: error
    character(label_length), allocatable :: names(:)

    allocate (names(size(self%fields)))
    do field = 1, size(self%fields)
      names(field) = self%fields(field)%name
      if (names(field) == name) return
    end do
    call fail(error, 'these results have no field '''//trim(name)//''': '// &
      & join(names, ', '))
  end subroutine find_field

  !> Whether a field can be written now, with values of this shape.
  subroutine check_field(self, field, points, components, error)
    class(results_type), intent(in) :: self
    integer, intent(in) :: field, points, components
    type(error_type), allocatable, intent(out) :: error

    if (.not. self%in_output) then
      call fail(error, 'a field is given outside an output')
    else if (field < 1 .or. field > size(self%fields)) then
      call fail(error, 'these results have no field '//to_text(field))
    else if (self%given(field)) then
      call fail(error, 'field '//trim(self%fields(field)%name)//' is given twice in one output')
    else if (points /= self%shared%rows%n .or. components /= self%fields(field)%components) then
      call fail(error, 'field '//trim(self%fields(field)%name)//' is '// &
        & to_text(self%shared%rows%n)//' x '//to_text(self%fields(field)%components)//', not '// &
        & to_text(points)//' x '//to_text(components))
    end if
  end subroutine check_field

  !> Complete the output under way. History rows so far go with it. An error if a field has not been
  !> given, if a file has been removed, or if the files cannot be written.
  subroutine end_output(self, error)
    class(results_type), intent(inout) :: self  !! with an output under way, which is complete on
                                                !! return
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: table(:, :)
    integer :: i

    if (.not. self%in_output) then
      call fail(error, 'an output ends that has not begun')
      return
    end if
    do i = 1, size(self%fields)
      if (self%given(i)) cycle
      call fail(error, 'field '//trim(self%fields(i)%name)//' is missing from an output')
      return
    end do
    do i = 1, size(self%lines)
      if (allocated(self%waiting(i)%values)) cycle
      call fail(error, 'line '//trim(self%lines(i)%name)//' is missing from an output')
      return
    end do
    if (self%use_surfaces .and. .not. allocated(self%places)) then
      call fail(error, 'the surfaces of rigid bodies are missing from an output')
      return
    end if
    ! the output counts when all ranks have written their rows
    call self%shared%end_output(self%vtkhdf, error)
    if (allocated(error)) then
      call explain_output(self, error)
      return
    end if
    ! rows first: a file that counts this output holds the history up to it
    call self%history%take(table)
    if (self%use_vtkhdf) then
      call self%vtkhdf%append_rows(table, error)
      if (.not. allocated(error)) call self%vtkhdf%end_output(self%time, error)
    end if
    if (self%use_vtu .and. .not. allocated(error)) call self%vtu%end_output(self%time, error)
    if (self%use_surfaces .and. .not. allocated(error)) call self%surfaces%add(self%time, &
      & self%places, self%velocity, error)
    if (.not. allocated(error)) call start_files(self, error)
    if (self%use_xdmf .and. .not. allocated(error)) call self%xdmf%end_output(self%time, error)
    if (.not. allocated(error) .and. self%csv%is_open()) call self%csv%append(table, error)
    if (.not. allocated(error)) call write_profiles(self, error)
    if (.not. allocated(error)) call check_there(self, error)
    if (allocated(error)) then
      call explain_output(self, error)
    else
      self%outputs = self%outputs + 1
      self%times = [self%times, self%time]
      self%in_output = .false.
      if (allocated(self%places)) deallocate (self%places)
      do i = 1, size(self%lines)
        deallocate (self%waiting(i)%values)
      end do
      if (allocated(self%latest)) then
        call move_alloc(self%latest, self%complete)
        allocate (self%latest(size(self%fields)))
      end if
    end if
  end subroutine end_output

  !> An error if the files are no longer where they are written: the system continues to write files
  !> whose names or folder have been removed, and they vanish with the program.
  subroutine check_there(self, error)
    class(results_type), intent(in) :: self
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: path

    path = in_directory(self%directory, self%stem//'.vtkhdf')
    if (self%use_vtkhdf .and. .not. file_exists(path)) then
      call fail(error, path//' has been removed while it is written')
      return
    end if
    path = in_directory(self%directory, 'history.csv')
    if (self%csv%is_open() .and. .not. file_exists(path)) &
      & call fail(error, path//' has been removed while it is written')
  end subroutine check_there

  !> Put the files in their places, once: here, and not before, older results go.
  subroutine start_files(self, error)
    class(results_type), intent(inout) :: self
    type(error_type), allocatable, intent(out) :: error

    if (self%started) return
    self%started = .not. self%in_files
    if (self%started) return
    call mark_unfinished(self%directory, self%stem, error)
    if (allocated(error)) return
    call remove_checkpoints(self%directory, self%stem)
    call remove_file(in_directory(self%directory, self%stem//'.xdmf'))
    if (self%use_vtkhdf) then
      call self%vtkhdf%publish(error)
    else
      call remove_file(in_directory(self%directory, self%stem//'.vtkhdf'))
    end if
    if (allocated(error)) return
    call remove_series(self%directory, self%stem, vtu_ending, merge(1, 0, self%use_vtu))
    call remove_surfaces(self%directory, self%stem, merge(1, 0, self%use_surfaces))
    call remove_file(in_directory(self%directory, 'iterations.csv'))
    call remove_file(in_directory(self%directory, 'fragments.csv'))
    if (size(self%columns) > 0) then
      call self%csv%open(in_directory(self%directory, 'history.csv'), self%columns, error)
    else
      call remove_file(in_directory(self%directory, 'history.csv'))
    end if
    if (.not. allocated(error)) call begin_profiles(self, .false., error)
    self%started = .not. allocated(error)
  end subroutine start_files

  !> Add a row of the history: a value for each column. Rows reach the files with each output, at
  !> least about once a second, and with `close`. An error if the results are not open, if values
  !> are missing, or if the files cannot be written.
  subroutine add_row(self, values, error)
    class(results_type), intent(inout) :: self  !! open; has one row more on return
    real(wp), intent(in) :: values(:)           !! (columns), in their units
    type(error_type), allocatable, intent(out) :: error

    if (.not. self%open) then
      call fail(error, 'a history row is given to results that are not open')
      return
    end if
    call self%history%add(values, error)
    if (allocated(error) .or. .not. self%started .or. self%in_output) return
    if (self%history%is_due()) call write_rows(self, error)
  end subroutine add_row

  !> Add a line about an iteration of a relaxation to `iterations.csv`. Of a run that continues,
  !> lines up to step `last` stay.
  subroutine add_iteration(self, line, last, error)
    class(results_type), intent(inout) :: self  !! after the first output; earlier lines are dropped
    character(*), intent(in) :: line  !! values in the order of the file's head, parted by commas
    integer, intent(in) :: last                 !! step of the last line that stays
    type(error_type), allocatable, intent(out) :: error

    if (.not. (self%started .and. self%in_files) .or. self%failed) return
    if (.not. self%iterations%has_begun()) call self%iterations%begin( &
      & in_directory(self%directory, 'iterations.csv'), 'step,load_step,time,iteration,solver,'// &
      & 'residual,change,broken_bonds', self%resumed, last, error)
    if (.not. allocated(error)) call self%iterations%add(line, error)
    if (allocated(error)) call explain_need(self, 'iterations.csv', int(len(line), i8), error)
  end subroutine add_iteration

  !> Add the fragments of the last complete output to `fragments.csv`. Of a run that continues,
  !> those of outputs that the checkpoint counts stay.
  subroutine add_fragments(self, values, error)
    class(results_type), intent(inout) :: self  !! after an output
    real(wp), intent(in) :: values(:, :)        !! (12, fragments): points, mass, centre, velocity,
                                                !! spin, size
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: head = 'output,time,number,points,mass,centre_x,centre_y,'// &
      & 'centre_z,velocity_x,velocity_y,velocity_z,spin_x,spin_y,spin_z,size'
    character(24) :: numbers(12)
    character(:), allocatable :: line
    integer :: i, c

    if (.not. (self%started .and. self%in_files) .or. self%failed) return
    if (.not. self%fragments%has_begun()) call self%fragments%begin( &
      & in_directory(self%directory, 'fragments.csv'), head, self%resumed, self%outputs - 2, error)
    do i = 1, size(values, 2)
      if (allocated(error)) exit
      write (numbers(1), '(es24.16e3)') self%time
      do c = 2, size(values, 1)
        write (numbers(c), '(es24.16e3)') values(c, i)
      end do
      line = to_text(self%outputs - 1)//','//trim(adjustl(numbers(1)))//','//to_text(i)//','// &
        & to_text(nint(values(1, i)))
      do c = 2, size(values, 1)
        line = line//','//trim(adjustl(numbers(c)))
      end do
      call self%fragments%add(line, error)
    end do
    if (allocated(error)) then
      call explain_need(self, 'fragments.csv', 300_i8*size(values, 2), error)
    else
      call self%fragments%hand_over(error)
    end if
  end subroutine add_fragments

  !> Keep the warnings so far, a line for each, in place of those of an earlier call: at once in
  !> `warnings.txt`, and in the HDF5 file when the results are complete. What goes wrong with them
  !> is no reason to end a run.
  subroutine put_warnings(self, text)
    class(results_type), intent(inout) :: self  !! after the first output; earlier calls do nothing
    character(*), intent(in) :: text            !! a line for each warning; '' for none
    type(sink_type) :: sink
    type(error_type), allocatable :: ignored

    if (.not. self%started .or. self%failed) return
    if (allocated(self%warnings)) then
      if (self%warnings == text) return
    end if
    self%warnings = text
    if (.not. self%in_files) return
    if (text == '') then
      call remove_file(in_directory(self%directory, 'warnings.txt'))
      return
    end if
    call sink%open(in_directory(self%directory, 'warnings.txt'), ignored)
    if (allocated(ignored)) return
    call sink%put(text, ignored)
    call sink%close(ignored)
  end subroutine put_warnings

  !> Write the rows that wait.
  subroutine write_rows(self, error)
    class(results_type), intent(inout) :: self
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: table(:, :)

    call self%history%take(table)
    if (self%use_vtkhdf) call self%vtkhdf%append_rows(table, error)
    if (self%csv%is_open() .and. .not. allocated(error)) call self%csv%append(table, error)
    if (allocated(error)) call explain_need(self, 'the history', &
      & 8_i8*size(table, kind=i8), error)
  end subroutine write_rows

  !> Say which output failed.
  subroutine explain_output(self, error)
    class(results_type), intent(inout) :: self
    type(error_type), allocatable, intent(inout) :: error
    integer(i8) :: bytes

    bytes = 0
    if (self%use_vtkhdf .or. self%shared%together) bytes = self%vtkhdf%output_bytes()
    if (self%use_vtu) bytes = bytes + self%vtu%output_bytes()
    if (self%use_surfaces) bytes = bytes + self%surfaces%output_bytes()
    call explain_need(self, 'output '//to_text(self%outputs + 1)//' at '// &
      & with_unit(self%time, 's'), bytes, error)
  end subroutine explain_output

  !> Report what failed, its size and the complete outputs. No more data are written after that.
  subroutine explain_need(self, what, bytes, error)
    class(results_type), intent(inout) :: self
    character(*), intent(in) :: what
    integer(i8), intent(in) :: bytes
    type(error_type), allocatable, intent(inout) :: error

    self%failed = .true.
    error%message = 'results, '//what//': '//error%message//' ('//what//' needs ' &
      & //with_unit(real(bytes, wp), 'B', 3)//'; complete before it: '//to_text(self%outputs) &
      & //' outputs)'
  end subroutine explain_need

  !> Wait until all that was written is on the disk, with the rows that wait. An error if the system
  !> reports a failure.
  subroutine sync(self, error)
    class(results_type), intent(inout) :: self  !! open; before the first output this does nothing
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    if (.not. (self%open .and. self%started)) return
    ! what a rank has written may lie in the memory of its machine
    if (self%shared%together .and. .not. self%in_files) then
      call sync_path(in_directory(self%directory, self%stem//'.vtkhdf'), error)
      return
    end if
    call write_rows(self, error)
    if (self%use_vtkhdf .and. .not. allocated(error)) call self%vtkhdf%sync(error)
    if (self%use_xdmf .and. .not. allocated(error)) call self%xdmf%sync(error)
    if (self%use_vtu .and. .not. allocated(error)) call self%vtu%sync(error)
    if (self%use_surfaces .and. .not. allocated(error)) call self%surfaces%sync(error)
    if (self%csv%is_open() .and. .not. allocated(error)) call self%csv%sync(error)
    if (.not. allocated(error)) call self%iterations%sync(error)
    if (.not. allocated(error)) call self%fragments%sync(error)
    do i = 1, size(self%lines)
      if (.not. allocated(error)) call self%profiles(i)%sync(error)
    end do
  end subroutine sync

  !> What a checkpoint counts on: all rows and outputs but the last `rows` and `outputs`.
  pure function rows_and_times(self, but_rows, but_outputs) result(kept)
    class(results_type), intent(in) :: self  !! the results
    integer, intent(in) :: but_rows          !! how many of the last rows to leave out
    integer, intent(in) :: but_outputs       !! how many of the last outputs to leave out
    type(kept_type) :: kept

    kept%rows = self%history%first_rows(but_rows)
    kept%times = self%times(:self%outputs - but_outputs)
  end function rows_and_times

  !> Whether these are the files of a run that continues, with all that was written before the first
  !> output.
  pure logical function resumes(self)
    class(results_type), intent(in) :: self  !! the results
    resumes = self%resumed
  end function resumes

  !> Which ranks write the fields; '' where there is one, or no file.
  pure function written_by(self) result(text)
    class(results_type), intent(in) :: self  !! the results
    character(:), allocatable :: text

    text = self%shared%written_by()
  end function written_by

  !> From now on keep the fields of each output in memory until the next one is complete.
  subroutine keep_outputs(self, positions)
    class(results_type), intent(inout) :: self
    real(wp), intent(in) :: positions(:, :)   !! of the points (point, 3) [m]

    self%positions = positions
    if (.not. allocated(self%latest)) allocate (self%latest(size(self%fields)))
  end subroutine keep_outputs

  !> The history so far, and the last complete output if it was to be kept.
  subroutine answer(self, found)
    class(results_type), intent(in) :: self
    type(answer_type), intent(out) :: found

    found%warnings = ''
    if (allocated(self%warnings)) found%warnings = self%warnings
    if (.not. allocated(self%columns)) return
    found%columns = self%columns
    found%history = transpose(self%history%first_rows(0))
    found%fields = self%fields
    found%outputs = self%outputs
    if (self%outputs > 0) found%time = self%times(self%outputs)
    if (allocated(self%positions)) found%positions = self%positions
    allocate (found%values(size(self%fields)))
    if (allocated(self%complete)) found%values = self%complete
  end subroutine answer

  !> Complete the files. Those of a run that was `stopped` stay as they are, to be continued another
  !> time; with `keep_mark` they stay marked as unfinished. After an error in writing they stay as
  !> they were at the last complete output; if nothing was written, nothing is left behind. An error
  !> if what waits cannot be written, or if a file has been removed.
  subroutine close_results(self, error, stopped, keep_mark)
    class(results_type), intent(inout) :: self  !! open or not; not open on return
    type(error_type), allocatable, intent(out) :: error
    logical, intent(in), optional :: stopped    !! leave the files to a restart; absent: no
    logical, intent(in), optional :: keep_mark  !! keep the mark of unfinished results; absent: no
    type(error_type), allocatable :: ignored
    logical :: leave, complete
    integer :: i

    if (.not. self%open) return
    leave = .false.
    if (present(stopped)) leave = stopped
    complete = .not. leave
    if (present(keep_mark)) complete = complete .and. .not. keep_mark
    self%open = .false.
    if (self%use_vtu) call self%vtu%abandon()
    call self%iterations%close(ignored)
    do i = 1, size(self%lines)
      if (.not. allocated(ignored)) call self%profiles(i)%close(ignored)
    end do
    if (allocated(ignored) .and. .not. self%failed) call move_alloc(ignored, error)
    call self%fragments%close(ignored)
    if (allocated(ignored) .and. .not. (self%failed .or. allocated(error))) &
      & call move_alloc(ignored, error)
    if (.not. (self%failed .or. allocated(error))) then
      if (.not. self%started .and. self%history%has_rows()) call start_files(self, error)
      if (self%started .and. .not. allocated(error)) call write_rows(self, error)
    end if
    if (self%started .and. .not. self%failed .and. .not. allocated(error)) &
      & call check_there(self, error)
    if (self%failed .or. allocated(error) .or. .not. self%started) then
      if (self%use_vtkhdf) call self%vtkhdf%abandon()
      if (self%use_xdmf) call self%xdmf%abandon()
      if (self%csv%is_open()) call self%csv%close(ignored)
      ! a folder made for these results goes if nothing has come to be in it
      call remove_empty(self%directory, self%made_folder)
      return
    end if
    if (self%use_vtkhdf) then
      if (leave) then
        if (self%use_xdmf) call self%xdmf%leave()
        call self%vtkhdf%leave(error)
      else
        if (self%use_xdmf) call self%xdmf%finish()
        if (allocated(self%warnings)) call self%vtkhdf%put_warnings(self%warnings)
        call self%vtkhdf%finish(error)
      end if
    end if
    if (self%csv%is_open()) then
      call self%csv%close(ignored)
      if (allocated(ignored) .and. .not. allocated(error)) call move_alloc(ignored, error)
    end if
    if (complete .and. self%in_files .and. .not. allocated(error)) &
      & call mark_complete(self%directory, self%stem)
  end subroutine close_results

end module pd_output_results_results
