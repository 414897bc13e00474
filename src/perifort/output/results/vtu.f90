!> A series of .vtu files, one for each output, with a .pvd file that lists their times: for
!> programs that don't read VTKHDF. Arrays are base64 within the XML, which every reader knows.
!>
!> Each file gets its name when it is complete, and the list names only complete files. An error is
!> set where one cannot be written.
module pd_output_results_vtu
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_text, only: newline
  use pd_output_results_files, only: file_exists, in_directory, remove_file, rename_file, sync_path
  use pd_output_results_layout, only: block_rows
  use pd_output_results_sink, only: sink_type
  use pd_output_results_types, only: field_type
  use pd_output_results_xml, only: array_type, begin_array, end_array, member, put_bytes, &
    & put_rows, remove_series, write_list
  implicit none (type, external)
  private
  public :: vtu_series, vtu_ending

  character(*), parameter :: vtu_ending = '.vtu'   !! of the files, with its dot
  integer(i1), parameter :: vertex_cell = 1_i1

  !> A series under way.
  type :: vtu_series
    private
    character(:), allocatable :: directory, stem
    type(field_type), allocatable :: fields(:)
    integer :: points = 0
    real(wp), allocatable :: times(:)
    integer :: outputs = 0
    integer :: synced = 0    !! outputs that are certainly on the disk
    logical :: single = .false.
    type(sink_type) :: sink
    type(array_type) :: array  !! under way
  contains
    procedure :: create
    procedure :: resume
    procedure :: sync
    procedure :: begin_output
    procedure :: put_positions
    procedure :: put_field
    procedure :: end_output
    procedure :: output_bytes
    procedure :: abandon
  end type vtu_series

contains

  !> Begin a series `stem_000000.vtu` ... in `directory` of `fields` at so many points.
  subroutine create(self, directory, stem, points, fields, single)
    class(vtu_series), intent(out) :: self     !! without an output; no file is made yet
    character(*), intent(in) :: directory      !! folder of the files, which is there
    character(*), intent(in) :: stem           !! name of the files without number and ending
    integer, intent(in) :: points              !! their number
    type(field_type), intent(in) :: fields(:)  !! (any number) that every output has
    logical, intent(in) :: single              !! fields in single precision

    self%directory = directory
    self%stem = stem
    allocate (self%fields, source=fields)
    self%points = points
    allocate (self%times(16))
    self%single = single
  end subroutine create

  !> Continue a series, made ready by `create`, after the outputs at `times` [s]; later ones are
  !> removed. An error if the file of one of them is missing.
  subroutine resume(self, times, error)
    class(vtu_series), intent(inout) :: self  !! as `create` left it; with these outputs on return
    real(wp), intent(in) :: times(:)          !! (outputs) that the checkpoint counts on [s]
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: name
    integer :: i

    do i = 1, size(times)
      name = in_directory(self%directory, member(self%stem, i - 1, vtu_ending))
      if (file_exists(name)) cycle
      call fail(error, 'there is no '//name//', which the checkpoint counts on')
      return
    end do
    self%outputs = size(times)
    self%synced = self%outputs
    self%times = [times, spread(0.0_wp, 1, size(self%times))]
    call write_list(self%directory, self%stem, vtu_ending, self%times(:self%outputs), error)
    if (allocated(error)) return
    call remove_series(self%directory, self%stem, vtu_ending, self%outputs)
    call remove_file(in_directory(self%directory, member(self%stem, self%outputs, &
      & vtu_ending)//'.part'))
  end subroutine resume

  !> Wait until all complete outputs are on the disk.
  subroutine sync(self, error)
    class(vtu_series), intent(inout) :: self  !! its complete outputs count as on the disk on return
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    do i = self%synced, self%outputs - 1
      call sync_path(in_directory(self%directory, member(self%stem, i, vtu_ending)), error)
      if (allocated(error)) return
    end do
    self%synced = self%outputs
    call sync_path(in_directory(self%directory, self%stem//'.pvd'), error)
  end subroutine sync

  !> Begin the file of the next output, up to its points.
  subroutine begin_output(self, error)
    class(vtu_series), intent(inout) :: self  !! with a file open on return
    type(error_type), allocatable, intent(out) :: error
    character(24) :: n

    write (n, '(i0)') self%points
    call self%sink%open(in_directory(self%directory, member(self%stem, self%outputs, &
      & vtu_ending)//'.part'), &
      & error)
    if (allocated(error)) return
    call self%sink%line('<?xml version="1.0"?>'//newline &
      & //'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian"' &
      & //' header_type="UInt64">'//newline//'<UnstructuredGrid>'//newline &
      & //'<Piece NumberOfPoints="'//trim(n)//'" NumberOfCells="'//trim(n)//'">'//newline &
      & //'<Points>', error)
  end subroutine begin_output

  !> A vertex at each point.
  subroutine put_cells(sink, n, error)
    type(sink_type), intent(inout) :: sink
    integer, intent(in) :: n
    type(error_type), allocatable, intent(out) :: error
    type(array_type) :: array
    integer(i8), allocatable, target :: numbers(:)
    integer(i1), pointer, contiguous :: bytes(:)
    integer(i1), allocatable :: kinds(:)
    integer :: pass, first, count, i

    allocate (numbers(min(n, block_rows)))
    do pass = 0, 1  ! connectivity 0 .. n-1, offsets 1 .. n
      call begin_array(sink, array, 'Int64', merge('offsets     ', 'connectivity', pass == 1), &
        & 1, 8_i8*n, error)
      do first = 0, n - 1, block_rows
        if (allocated(error)) return
        count = min(block_rows, n - first)
        do i = 1, count
          numbers(i) = first + i - 1 + pass
        end do
        call c_f_pointer(c_loc(numbers), bytes, [8*count])
        call put_bytes(sink, array, bytes, error)
      end do
      if (.not. allocated(error)) call end_array(sink, array, error)
      if (allocated(error)) return
    end do
    allocate (kinds(min(n, block_rows)), source=vertex_cell)
    call begin_array(sink, array, 'UInt8', 'types', 1, int(n, i8), error)
    do first = 0, n - 1, block_rows
      if (allocated(error)) return
      call put_bytes(sink, array, kinds(:min(block_rows, n - first)), error)
    end do
    if (.not. allocated(error)) call end_array(sink, array, error)
  end subroutine put_cells

  !> Write positions of points; the first rows come first. The cells follow those of the last point.
  subroutine put_positions(self, first, positions, error)
    class(vtu_series), intent(inout) :: self   !! with an output that has just begun
    integer(i8), intent(in) :: first           !! row of the first point, from 0
    real(wp), intent(in) :: positions(:, :)    !! (rows, 3) in point order [m]
    type(error_type), allocatable, intent(out) :: error

    call put_next(self, 'Points', '', first, positions, .false., error)
    if (allocated(error) .or. first + size(positions, 1) < self%points) return
    call self%sink%line('</Points>'//newline//'<Cells>', error)
    if (.not. allocated(error)) call put_cells(self%sink, self%points, error)
    if (.not. allocated(error)) call self%sink%line('</Cells>'//newline//'<PointData>', error)
  end subroutine put_positions

  !> Write rows of field `i` of the output under way; the first rows come first.
  subroutine put_field(self, i, first, values, error)
    class(vtu_series), intent(inout) :: self  !! the series
    integer, intent(in) :: i                  !! number of the field, from 1
    integer(i8), intent(in) :: first          !! row of the first value, from 0
    real(wp), intent(in) :: values(:, :)      !! (rows, components) in point order, in the field's
                                              !! unit
    type(error_type), allocatable, intent(out) :: error
    call put_next(self, trim(self%fields(i)%name), trim(self%fields(i)%labels), first, values, &
      & self%single, error)
  end subroutine put_field

  !> The next rows of an array, which begins with the first one and ends with the last.
  subroutine put_next(self, name, labels, first, values, single, error)
    class(vtu_series), intent(inout) :: self
    character(*), intent(in) :: name, labels
    integer(i8), intent(in) :: first
    real(wp), intent(in) :: values(:, :)
    logical, intent(in) :: single
    type(error_type), allocatable, intent(out) :: error
    integer :: width

    width = size(values, 2)
    if (first == 0) self%array = array_type()
    if (first == 0) call begin_array(self%sink, self%array, merge('Float32', 'Float64', single), &
      & name, width, merge(4_i8, 8_i8, single)*self%points*width, error, labels)
    if (.not. allocated(error)) call put_rows(self%sink, self%array, values, single, error)
    if (.not. allocated(error) .and. first + size(values, 1) >= self%points) &
      & call end_array(self%sink, self%array, error)
  end subroutine put_next

  !> Complete the file of the output at `time` [s] and list it.
  subroutine end_output(self, time, error)
    class(vtu_series), intent(inout) :: self  !! with one complete output more on return
    real(wp), intent(in) :: time              !! of the state [s]
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: name
    real(wp), allocatable :: longer(:)

    name = in_directory(self%directory, member(self%stem, self%outputs, vtu_ending))
    call self%sink%line('</PointData>'//newline//'</Piece>'//newline//'</UnstructuredGrid>' &
      & //newline//'</VTKFile>', error)
    if (.not. allocated(error)) call self%sink%close(error)
    if (.not. allocated(error)) call rename_file(name//'.part', name, error)
    if (allocated(error)) return
    if (self%outputs == size(self%times)) then
      allocate (longer(2*self%outputs))
      longer(:self%outputs) = self%times
      call move_alloc(longer, self%times)
    end if
    self%times(self%outputs + 1) = time
    call write_list(self%directory, self%stem, vtu_ending, self%times(:self%outputs + 1), error)
    if (.not. allocated(error)) self%outputs = self%outputs + 1
  end subroutine end_output

  !> Bytes of one file, within some hundreds.
  pure integer(i8) function output_bytes(self)
    class(vtu_series), intent(in) :: self  !! the series
    integer(i8) :: width

    width = 3*8 + 2*8 + 1 + sum(self%fields%components)*merge(4, 8, self%single)
    output_bytes = 4*(self%points*width)/3 + 1024
  end function output_bytes

  !> Give up the output under way and remove what there is of it.
  subroutine abandon(self)
    class(vtu_series), intent(inout) :: self  !! without an open file on return
    type(error_type), allocatable :: ignored

    if (.not. self%sink%is_open()) return
    call self%sink%close(ignored)
    call remove_file(in_directory(self%directory, member(self%stem, self%outputs, &
      & vtu_ending)//'.part'))
  end subroutine abandon

end module pd_output_results_vtu
