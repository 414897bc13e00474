!> A small text beside the results file that lists its outputs, for programs that don't read VTKHDF:
!> XDMF, a collection of grids in time whose numbers are those of the HDF5 file.
!>
!> It must be well formed and true whenever its writer dies, and cheap with thousands of outputs. So
!> it is written with room for all planned outputs, whose entries stand in processing instructions,
!> which XML's readers pass over:
!>
!>     <?later ? <Grid> .. </Grid><?end ?>      not there yet
!>     <?later ?><Grid> .. </Grid><?end ?>      there
!>
!> An output is added by writing its time into the blanks kept for it, and then one byte. A finished
!> list is written once more, without these instructions. Its name is taken by a rename.
!>
!> An error is set where the file cannot be written.
module pd_output_results_xdmf
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: newline, to_text
  use pd_output_results_cells, only: cells_type
  use pd_output_results_files, only: remove_file, rename_file, sync_path
  use pd_output_results_sink, only: sink_type
  use pd_output_results_types, only: field_type
  use pd_output_results_views, only: view_of_cells, view_of_output, view_type, views_of
  implicit none (type, external)
  private
  public :: xdmf_file, escaped

  character(*), parameter :: waiting = '<?later ? ', present_mark = '<?later ?>'
  character(*), parameter :: before_time = newline//'<Grid Name="points" GridType="Uniform">' &
    & //newline//'<Time Value="'
  integer, parameter :: time_length = 24  !! of a time in the text [characters]
  integer, parameter :: default_outputs = 16

  !> A list under way.
  type :: xdmf_file
    private
    character(:), allocatable :: path     !! the final name
    character(:), allocatable :: current  !! the present name, '' while there is no file
    character(:), allocatable :: data     !! of the HDF5 file as it stands in the text
    type(view_type), allocatable :: views(:)
    real(wp), allocatable :: times(:)     !! of the outputs [s]
    integer :: outputs = 0                !! listed
    integer :: capacity = 0               !! outputs there is room for
    integer :: planned = default_outputs
    integer(i8) :: points = 0             !! and nodes
    integer(i8) :: cells = 0              !! 0: each point is one
    integer(i8) :: topology = 0           !! length of the list of cells
    integer(i8) :: head = 0               !! length before the first entry [bytes]
    integer(i8) :: record_length = 0       !! [bytes]
    logical :: single = .false.
    integer :: unit = 0
    logical :: is_open = .false.
  contains
    procedure :: create
    procedure :: resume
    procedure :: begin_output
    procedure :: end_output
    procedure :: sync
    procedure :: finish
    procedure :: leave
    procedure :: abandon
    procedure :: give_up
    procedure, private :: record
    procedure, private :: write_list
    procedure, private :: open_list
  end type xdmf_file

contains

  !> Begin the list `path` of outputs of `fields` in the HDF5 file `data` beside it; no file is made
  !> yet.
  subroutine create(self, path, data, points, fields, planned_outputs, single, cells)
    class(xdmf_file), intent(out) :: self      !! without an output
    character(*), intent(in) :: path           !! of the list, with its ending
    character(*), intent(in) :: data           !! name of the HDF5 file, in the same folder
    integer(i8), intent(in) :: points          !! their number
    type(field_type), intent(in) :: fields(:)  !! (any number) that every output has
    integer, intent(in) :: planned_outputs     !! their number; 0: unknown
    logical, intent(in) :: single              !! fields in single precision
    type(cells_type), intent(in), optional :: cells  !! of meshes; none without

    self%path = path
    self%current = ''
    self%data = escaped(data)
    self%points = points
    if (present(cells)) then
      self%points = points + cells%n_nodes()
      self%cells = cells%n_cells()
      if (self%cells > 0) self%topology = size(cells%topology, kind=i8)
    end if
    self%views = views_of(fields)
    self%single = single
    if (planned_outputs > 0) self%planned = planned_outputs
    allocate (self%times(0))
  end subroutine create

  !> Continue a list, made ready by `create`, after the outputs at `times` [s]; later ones are
  !> removed. Without one the file goes.
  subroutine resume(self, times, error)
    class(xdmf_file), intent(inout) :: self  !! as `create` left it; with these outputs on return
    real(wp), intent(in) :: times(:)         !! (outputs) that the checkpoint counts on [s]
    type(error_type), allocatable, intent(out) :: error

    self%times = times
    self%outputs = size(times)
    call remove_file(self%path//'.part')
    if (self%outputs == 0) then
      call remove_file(self%path)
      return
    end if
    call self%write_list(max(self%planned, self%outputs), .true., error)
    if (.not. allocated(error)) call rename_file(self%path//'.part', self%path, error)
    if (.not. allocated(error)) call self%open_list(self%path, error)
  end subroutine resume

  !> Make room for the next output.
  subroutine begin_output(self, error)
    class(xdmf_file), intent(inout) :: self  !! with room for the output on return
    type(error_type), allocatable, intent(out) :: error

    if (self%outputs < self%capacity) return
    call self%leave()
    call self%write_list(max(self%planned, 2*self%outputs), .true., error)
    if (allocated(error)) return
    if (self%outputs > 0) then
      call rename_file(self%path//'.part', self%path, error)
      if (.not. allocated(error)) call self%open_list(self%path, error)
    else
      call self%open_list(self%path//'.part', error)
    end if
  end subroutine begin_output

  !> List the output at `time` [s], which must be complete in the HDF5 file.
  subroutine end_output(self, time, error)
    class(xdmf_file), intent(inout) :: self  !! with one output more on return
    real(wp), intent(in) :: time             !! of the state [s]
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: at
    integer :: status
    character(512) :: message

    at = self%head + self%outputs*self%record_length + 1
    write (self%unit, pos=at + len(waiting//before_time), iostat=status, iomsg=message) &
      & time_text(time)
    if (status == 0) flush (self%unit, iostat=status, iomsg=message)
    if (status == 0) write (self%unit, pos=at + len(waiting) - 1, iostat=status, iomsg=message) &
      & present_mark(len(present_mark):)
    if (status == 0) flush (self%unit, iostat=status, iomsg=message)
    if (status /= 0) then
      call fail(error, 'cannot write '//self%current//': '//trim(message))
      return
    end if
    if (self%current /= self%path) then
      call rename_file(self%current, self%path, error)
      if (allocated(error)) return
      self%current = self%path
    end if
    self%times = [self%times(:self%outputs), time]
    self%outputs = self%outputs + 1
  end subroutine end_output

  !> A time [s] in the text, always of the same length.
  pure function time_text(time) result(text)
    real(wp), intent(in) :: time
    character(time_length) :: text
    write (text, '(es24.16e3)') time
  end function time_text

  !> The entry of an output.
  function record(self, output, time) result(text)
    class(xdmf_file), intent(in) :: self
    integer, intent(in) :: output        !! its number, from 0
    character(*), intent(in) :: time     !! `time_length` characters
    character(:), allocatable :: text
    character(:), allocatable :: n
    integer :: i

    n = to_text(self%points)
    if (self%cells > 0) then
      text = '<Topology TopologyType="Mixed" NumberOfElements="'//to_text(self%cells)//'">' &
        & //item(self, '/cells/topology', 'Int', 8, self%topology, 1)//'</Topology>'
    else
      text = '<Topology TopologyType="Polyvertex" NodesPerElement="1" NumberOfElements="'//n &
        & //'">'//item(self, '/VTKHDF/Vertices/Connectivity', 'Int', 8, self%points, 1) &
        & //'</Topology>'
    end if
    text = before_time//time//'"/>'//newline//text//newline &
      & //'<Geometry GeometryType="XYZ">' &
      & //item(self, '/VTKHDF/Points', 'Float', 8, self%points, 3)//'</Geometry>'//newline
    do i = 1, size(self%views)
      associate (view => self%views(i))
        text = text//attribute(self, view, 'Node', self%points, output)
        if (self%cells > 0) text = text//attribute(self, view_of_cells(view), 'Cell', &
          & self%cells, output)
      end associate
    end do
    text = text//'</Grid>'
  end function record

  !> A field of points or cells in an output.
  function attribute(self, view, centre, rows, output) result(text)
    type(xdmf_file), intent(in) :: self
    type(view_type), intent(in) :: view
    character(*), intent(in) :: centre   !! 'Node' or 'Cell'
    integer(i8), intent(in) :: rows
    integer, intent(in) :: output        !! its number, from 0
    character(:), allocatable :: text

    text = '<Attribute Name="'//trim(view%name)//'" AttributeType="'// &
      & merge('Vector', 'Scalar', view%components == 3)//'" Center="'//centre//'">'// &
      & item(self, view_of_output(view, int(output, i8)), 'Float', merge(4, 8, self%single), &
      & rows, view%components)//'</Attribute>'//newline
  end function attribute

  !> A reference to a dataset of the HDF5 file.
  function item(self, path, kind_name, bytes, rows, components) result(text)
    type(xdmf_file), intent(in) :: self
    character(*), intent(in) :: path, kind_name
    integer, intent(in) :: bytes
    integer(i8), intent(in) :: rows
    integer, intent(in) :: components
    character(:), allocatable :: text

    text = to_text(rows)
    if (components > 1) text = text//' '//to_text(components)
    text = '<DataItem Format="HDF" NumberType="'//kind_name//'" Precision="'//to_text(bytes) &
      & //'" Dimensions="'//text//'">'//self%data//':'//path//'</DataItem>'
  end function item

  !> Write the list of the outputs so far as a file of its own, `path.part`, with room for
  !> `capacity` outputs if it is to be continued.
  subroutine write_list(self, capacity, goes_on, error)
    class(xdmf_file), intent(inout) :: self
    integer, intent(in) :: capacity
    logical, intent(in) :: goes_on
    type(error_type), allocatable, intent(out) :: error
    type(error_type), allocatable :: ignored
    type(sink_type) :: list
    character(:), allocatable :: head, text
    character(time_length) :: time
    integer :: k

    head = '<?xml version="1.0"?>'//newline//'<Xdmf Version="3.0">'//newline//'<Domain>' &
      & //newline//'<Grid Name="outputs" GridType="Collection" CollectionType="Temporal">'//newline
    call list%open(self%path//'.part', error)
    if (allocated(error)) return
    call list%put(head, error)
    do k = 0, capacity - 1
      if (allocated(error)) exit
      time = ''
      if (k < self%outputs) time = time_text(self%times(k + 1))
      text = self%record(k, time)
      if (goes_on) text = merge(present_mark, waiting, k < self%outputs)//text//'<?end ?>'
      call list%line(text, error)
    end do
    if (.not. allocated(error)) call list%line('</Grid>'//newline//'</Domain>'//newline &
      & //'</Xdmf>', error)
    if (.not. allocated(error)) then
      call list%close(error)
    else
      call list%close(ignored)
    end if
    if (allocated(error)) then
      call remove_file(self%path//'.part')
    else if (goes_on) then
      self%capacity = capacity
      self%head = len(head)
      self%record_length = len(waiting//self%record(0, time)//'<?end ?>'//newline)
    end if
  end subroutine write_list

  !> Open the file to be changed in place.
  subroutine open_list(self, path, error)
    class(xdmf_file), intent(inout) :: self
    character(*), intent(in) :: path
    type(error_type), allocatable, intent(out) :: error
    integer :: status
    character(512) :: message

    open (newunit=self%unit, file=path, access='stream', form='unformatted', status='old', &
      & action='readwrite', iostat=status, iomsg=message)
    if (status /= 0) then
      call fail(error, 'cannot open '//path//': '//trim(message))
      return
    end if
    self%is_open = .true.
    self%current = path
  end subroutine open_list

  !> Wait until all outputs listed are on the disk.
  subroutine sync(self, error)
    class(xdmf_file), intent(in) :: self  !! the list
    type(error_type), allocatable, intent(out) :: error
    if (self%outputs > 0) call sync_path(self%path, error)
  end subroutine sync

  !> Write the complete list without room for more. If that fails the present one stays, which says
  !> the same.
  subroutine finish(self)
    class(xdmf_file), intent(inout) :: self  !! not open on return
    type(error_type), allocatable :: ignored

    call self%abandon()
    if (self%outputs == 0) return
    call self%write_list(self%outputs, .false., ignored)
    if (.not. allocated(ignored)) call rename_file(self%path//'.part', self%path, ignored)
  end subroutine finish

  !> Leave the list as it is, to be continued another time.
  subroutine leave(self)
    class(xdmf_file), intent(inout) :: self  !! open or not; not open on return
    integer :: status

    if (.not. self%is_open) return
    close (self%unit, iostat=status)
    if (status /= 0) self%unit = 0  ! all was flushed before
    self%is_open = .false.
  end subroutine leave

  !> Write nothing more. A list without an output is removed.
  subroutine abandon(self)
    class(xdmf_file), intent(inout) :: self  !! open or not; not open on return

    call self%leave()
    if (.not. allocated(self%current)) return
    if (self%current /= self%path) call remove_file(self%path//'.part')
  end subroutine abandon

  !> There is to be no list of these results.
  subroutine give_up(self)
    class(xdmf_file), intent(inout) :: self  !! not open on return

    call self%abandon()
    call remove_file(self%path)
  end subroutine give_up

  !> Text as XML wants it within quotes.
  pure function escaped(text) result(safe)
    character(*), intent(in) :: text  !! of any kind
    character(:), allocatable :: safe
    integer :: i

    safe = ''
    do i = 1, len(text)
      select case (text(i:i))
      case ('&')
        safe = safe//'&amp;'
      case ('<')
        safe = safe//'&lt;'
      case ('"')
        safe = safe//'&quot;'
      case default  ! any other character stands for itself
        safe = safe//text(i:i)
      end select
    end do
  end function escaped

end module pd_output_results_xdmf
