!> Surfaces that move, as triangles: a file `STEM_000012.vtp` for each output and a `STEM.pvd` that
!> lists their times, for ParaView and all that reads VTK's XML.
!>
!> Each file gets its name when it is complete, and the list names only complete files. An error is
!> set where one cannot be written.
module pd_output_results_surfaces
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_text, only: newline, to_text
  use pd_output_results_files, only: file_exists, in_directory, remove_file, rename_file, sync_path
  use pd_output_results_sink, only: sink_type
  use pd_output_results_xml, only: array_type, begin_array, end_array, member, put_bytes, &
    & put_vectors, remove_series, write_list
  implicit none (type, external)
  private
  public :: surface_series, triangles_type, remove_surfaces

  character(*), parameter :: ending = '.vtp'

  !> Triangles whose vertices move.
  type :: triangles_type
    integer :: n_vertices = 0
    integer(i4), allocatable :: corner(:, :)   !! (3, triangles) vertices from 1
    integer(i4), allocatable :: body(:)        !! (triangles) which body each belongs to, from 1
  end type triangles_type

  !> A series under way.
  type :: surface_series
    private
    character(:), allocatable :: directory, stem
    type(triangles_type) :: triangles
    real(wp), allocatable :: times(:)     !! of the outputs [s]
    logical, allocatable :: there(:)      !! (outputs) whether there is a file
    integer :: synced = 0                 !! outputs that are certainly on the disk
  contains
    procedure :: create
    procedure :: resume
    procedure :: add
    procedure :: sync
    procedure :: output_bytes
  end type surface_series

contains

  !> `STEM_rigid`, to which the results `STEM` belong.
  pure function stem_of(stem) result(own)
    character(*), intent(in) :: stem
    character(:), allocatable :: own
    own = trim(stem)//'_rigid'
  end function stem_of

  !> Begin a series beside the results `stem` in `directory`; no file is made yet.
  subroutine create(self, directory, stem, triangles)
    class(surface_series), intent(out) :: self        !! without an output
    character(*), intent(in) :: directory             !! folder of the files, which is there
    character(*), intent(in) :: stem                  !! name of the results without ending
    type(triangles_type), intent(in) :: triangles     !! whose vertices each output has

    self%directory = directory
    self%stem = stem_of(stem)
    self%triangles = triangles
    allocate (self%times(0), self%there(0))
  end subroutine create

  !> Continue a series, made ready by `create`, after the outputs at `times` [s]; later ones are
  !> removed. An earlier version of the program may have written none of them.
  subroutine resume(self, times, error)
    class(surface_series), intent(inout) :: self   !! as `create` left it; with these outputs
    real(wp), intent(in) :: times(:)               !! (outputs) that the checkpoint counts on [s]
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    self%times = times
    self%there = [(file_exists(in_directory(self%directory, member(self%stem, i - 1, ending))), &
      & i=1, size(times))]
    self%synced = size(times)
    call write_list(self%directory, self%stem, ending, self%times, error, self%there)
    if (.not. allocated(error)) call remove_series(self%directory, self%stem, ending, size(times))
  end subroutine resume

  !> Write the file of the output at `time` [s] and list it.
  subroutine add(self, time, places, velocity, error)
    class(surface_series), intent(inout) :: self  !! with one output more on return
    real(wp), intent(in) :: time                  !! of the state [s]
    real(wp), intent(in) :: places(:, :)          !! (vertices, 3) [m]
    real(wp), intent(in) :: velocity(:, :)        !! (vertices, 3) of the material there [m/s]
    type(error_type), allocatable, intent(out) :: error
    type(error_type), allocatable :: ignored
    type(sink_type) :: sink
    character(:), allocatable :: path
    integer :: n

    n = size(self%triangles%body)
    path = in_directory(self%directory, member(self%stem, size(self%times), ending))
    call sink%open(path//'.part', error)
    if (allocated(error)) return
    call sink%line('<?xml version="1.0"?>'//newline &
      & //'<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">' &
      & //newline//'<PolyData>'//newline//'<Piece NumberOfPoints="'//to_text(size(places, 1)) &
      & //'" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="'//to_text(n) &
      & //'">'//newline//'<Points>', error)
    if (.not. allocated(error)) call put_vectors(sink, 'Points', places, .false., error)
    if (.not. allocated(error)) call sink%line('</Points>'//newline//'<Polys>', error)
    if (.not. allocated(error)) call put_integers(sink, 'connectivity', 'Int64', &
      & reshape(int(self%triangles%corner, i8) - 1_i8, [3*n]), error)
    if (.not. allocated(error)) call put_integers(sink, 'offsets', 'Int64', &
      & count_by_three(n), error)
    if (.not. allocated(error)) call sink%line('</Polys>'//newline//'<PointData>', error)
    if (.not. allocated(error)) call put_vectors(sink, 'velocity', velocity, .false., error)
    if (.not. allocated(error)) call sink%line('</PointData>'//newline//'<CellData>', error)
    if (.not. allocated(error)) call put_integers(sink, 'rigid_body', 'Int64', &
      & int(self%triangles%body, i8), error)
    if (.not. allocated(error)) call sink%line('</CellData>'//newline//'</Piece>'//newline &
      & //'</PolyData>'//newline//'</VTKFile>', error)
    if (allocated(error)) then
      call sink%close(ignored)
    else
      call sink%close(error)
    end if
    if (.not. allocated(error)) call rename_file(path//'.part', path, error)
    if (allocated(error)) then
      call remove_file(path//'.part')
      return
    end if
    self%times = [self%times, time]
    self%there = [self%there, .true.]
    call write_list(self%directory, self%stem, ending, self%times, error, self%there)
  end subroutine add

  !> 3, 6, .., 3 n.
  pure function count_by_three(n) result(offsets)
    integer, intent(in) :: n
    integer(i8) :: offsets(n)
    integer :: i
    offsets = [(3_i8*i, i=1, n)]
  end function count_by_three

  !> Write integers as an array.
  subroutine put_integers(sink, name, kind_name, values, error)
    type(sink_type), intent(inout) :: sink
    character(*), intent(in) :: name, kind_name
    integer(i8), intent(in) :: values(:)
    type(error_type), allocatable, intent(out) :: error
    integer(i8), allocatable, target :: copied(:)
    integer(i1), pointer, contiguous :: bytes(:)
    type(array_type) :: array

    copied = values
    call begin_array(sink, array, kind_name, name, 1, 8*size(values, kind=i8), error)
    if (allocated(error)) return
    call c_f_pointer(c_loc(copied), bytes, [8*size(copied)])
    call put_bytes(sink, array, bytes, error)
    if (.not. allocated(error)) call end_array(sink, array, error)
  end subroutine put_integers

  !> Wait until all complete outputs are on the disk.
  subroutine sync(self, error)
    class(surface_series), intent(inout) :: self  !! its outputs count as on the disk on return
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    do i = self%synced + 1, size(self%times)
      call sync_path(in_directory(self%directory, member(self%stem, i - 1, ending)), error)
      if (allocated(error)) return
    end do
    self%synced = size(self%times)
    call sync_path(in_directory(self%directory, self%stem//'.pvd'), error)
  end subroutine sync

  !> Bytes of one file, within some hundreds.
  pure integer(i8) function output_bytes(self)
    class(surface_series), intent(in) :: self  !! the series
    output_bytes = 4*(48_i8*self%triangles%n_vertices + 40_i8*size(self%triangles%body))/3 + 1024
  end function output_bytes

  !> Remove the files of an older series beside the results `stem`, from number `first` (0 = the
  !> first) on.
  subroutine remove_surfaces(directory, stem, first)
    character(*), intent(in) :: directory  !! folder of the files; '' for the current one
    character(*), intent(in) :: stem       !! name of the results without ending
    integer, intent(in) :: first           !! number of the first that is removed
    call remove_series(directory, stem_of(stem), ending, first)
  end subroutine remove_surfaces

end module pd_output_results_surfaces
