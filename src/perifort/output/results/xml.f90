!> Files of VTK's XML: arrays as base64 within the text, which every reader knows, and a series of
!> files, one for each output, with a .pvd file that lists their times.
module pd_output_results_xml
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, sp, i1, i8
  use pd_base_text, only: newline
  use pd_output_results_base64, only: base64_encoder, base64_length
  use pd_output_results_files, only: file_exists, in_directory, remove_file, rename_file
  use pd_output_results_layout, only: block_rows, to_single
  use pd_output_results_sink, only: sink_type
  use pd_output_results_xdmf, only: escaped
  implicit none (type, external)
  private
  public :: array_type, begin_array, put_bytes, put_reals, put_rows, put_vectors, end_array
  public :: member, write_list, remove_series

  !> An array within the XML that is being written.
  type :: array_type
    type(base64_encoder) :: encoder
    character(:), allocatable :: text
  end type array_type

contains

  !> `stem_000012.vtu`
  pure function member(stem, index, ending) result(name)
    character(*), intent(in) :: stem     !! name of the series
    integer, intent(in) :: index         !! of the output, from 0
    character(*), intent(in) :: ending   !! with its dot
    character(:), allocatable :: name
    character(16) :: number

    write (number, '(i0.6)') index
    name = stem//'_'//trim(number)//ending
  end function member

  !> Begin an array of `bytes` bytes; its encoded bytes start with their number.
  subroutine begin_array(sink, array, kind_name, name, components, bytes, error, labels)
    type(sink_type), intent(inout) :: sink        !! an open file
    type(array_type), intent(inout) :: array      !! under way on return
    character(*), intent(in) :: kind_name, name   !! `Float64` ..; of the array
    integer, intent(in) :: components             !! of each of its rows
    integer(i8), intent(in) :: bytes              !! that will follow
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in), optional :: labels  !! names of the components, parted by blanks
    character(:), allocatable :: named
    character(8) :: number

    named = ''
    if (present(labels)) named = component_names(labels)
    write (number, '(i0)') components
    call sink%put('<DataArray type="'//kind_name//'" Name="'//trim(name) &
      & //'" NumberOfComponents="'//trim(number)//'"'//named//' format="binary">', error)
    if (.not. allocated(error)) call put_bytes(sink, array, transfer(bytes, [0_i1]), error)
  end subroutine begin_array

  !> Names of components as attributes. Readers know x, y and z by themselves.
  pure function component_names(labels) result(text)
    character(*), intent(in) :: labels            !! parted by blanks
    character(:), allocatable :: text, rest
    character(8) :: number
    integer :: c, blank

    text = ''
    rest = trim(labels)
    c = 0
    do while (rest /= '' .and. labels /= 'x y z')
      blank = index(rest//' ', ' ')
      write (number, '(i0)') c
      text = text//' ComponentName'//trim(number)//'="'//rest(:blank - 1)//'"'
      rest = trim(adjustl(rest(blank:)))
      c = c + 1
    end do
  end function component_names

  !> Write bytes of an array.
  subroutine put_bytes(sink, array, bytes, error)
    type(sink_type), intent(inout) :: sink            !! an open file
    type(array_type), intent(inout) :: array          !! under way
    integer(i1), contiguous, intent(in) :: bytes(:)   !! the next ones
    type(error_type), allocatable, intent(out) :: error
    integer :: length, needed

    needed = base64_length(size(bytes))
    if (allocated(array%text)) then
      if (len(array%text) < needed) deallocate (array%text)
    end if
    if (.not. allocated(array%text)) allocate (character(needed) :: array%text)
    call array%encoder%put(bytes, array%text, length)
    call sink%put(array%text(:length), error)
  end subroutine put_bytes

  !> End an array.
  subroutine end_array(sink, array, error)
    type(sink_type), intent(inout) :: sink      !! an open file
    type(array_type), intent(inout) :: array    !! under way, with all its bytes
    type(error_type), allocatable, intent(out) :: error
    integer :: length

    call array%encoder%finish(array%text, length)
    call sink%line(array%text(:length)//'</DataArray>', error)
  end subroutine end_array

  !> Write `values(n, components)` as an array of vectors, block by block.
  subroutine put_vectors(sink, name, values, single, error, labels)
    type(sink_type), intent(inout) :: sink   !! an open file
    character(*), intent(in) :: name         !! of the array
    real(wp), intent(in) :: values(:, :)     !! (n, components)
    logical, intent(in) :: single            !! in single precision
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in), optional :: labels  !! names of the components, parted by blanks
    type(array_type) :: array

    call begin_array(sink, array, merge('Float32', 'Float64', single), name, size(values, 2), &
      & merge(4_i8, 8_i8, single)*size(values, kind=i8), error, labels)
    if (.not. allocated(error)) call put_rows(sink, array, values, single, error)
    if (.not. allocated(error)) call end_array(sink, array, error)
  end subroutine put_vectors

  !> Write rows `values(n, components)` of an array, block by block.
  subroutine put_rows(sink, array, values, single, error)
    type(sink_type), intent(inout) :: sink      !! an open file
    type(array_type), intent(inout) :: array    !! under way
    real(wp), intent(in) :: values(:, :)        !! (n, components), the next rows
    logical, intent(in) :: single               !! in single precision
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: turned(:)
    integer :: n, first, count, width, i

    n = size(values, 1)
    width = size(values, 2)
    allocate (turned(width*min(n, block_rows)))
    do first = 0, n - 1, block_rows
      count = min(block_rows, n - first)
      do i = 1, count
        turned(width*(i - 1) + 1:width*i) = values(first + i, :)
      end do
      call put_reals(sink, array, turned(:width*count), single, error)
      if (allocated(error)) return
    end do
  end subroutine put_rows

  !> Write reals in the wanted precision.
  subroutine put_reals(sink, array, values, single, error)
    type(sink_type), intent(inout) :: sink                   !! an open file
    type(array_type), intent(inout) :: array                 !! under way
    real(wp), contiguous, target, intent(in) :: values(:)    !! the next ones
    logical, intent(in) :: single                            !! in single precision
    type(error_type), allocatable, intent(out) :: error
    real(sp), allocatable, target :: short(:)
    integer(i1), pointer, contiguous :: bytes(:)

    if (single) then
      allocate (short, source=to_single(values))
      call c_f_pointer(c_loc(short), bytes, [4*size(values)])
    else
      call c_f_pointer(c_loc(values), bytes, [8*size(values)])
    end if
    call put_bytes(sink, array, bytes, error)
  end subroutine put_reals

  !> Write the list of times and files, and put it in the place of the one before.
  subroutine write_list(directory, stem, ending, times, error, there)
    character(*), intent(in) :: directory  !! folder of the files
    character(*), intent(in) :: stem       !! name of the series
    character(*), intent(in) :: ending     !! of its files, with its dot
    real(wp), intent(in) :: times(:)       !! of the outputs [s]
    type(error_type), allocatable, intent(out) :: error
    logical, intent(in), optional :: there(:)  !! (outputs) that have a file; absent: all
    type(error_type), allocatable :: ignored
    type(sink_type) :: list
    character(:), allocatable :: name
    character(24) :: time
    integer :: i

    name = in_directory(directory, stem//'.pvd')
    call list%open(name//'.part', error)
    if (allocated(error)) return
    call list%line('<?xml version="1.0"?>'//newline//'<VTKFile type="Collection" version="0.1"' &
      & //' byte_order="LittleEndian">'//newline//'<Collection>', error)
    do i = 1, size(times)
      if (allocated(error)) exit
      if (present(there)) then
        if (.not. there(i)) cycle
      end if
      write (time, '(es24.16e3)') times(i)
      call list%line('<DataSet timestep="'//trim(adjustl(time))//'" part="0" file="' &
        & //escaped(member(stem, i - 1, ending))//'"/>', error)
    end do
    if (.not. allocated(error)) call list%line('</Collection>'//newline//'</VTKFile>', error)
    if (.not. allocated(error)) then
      call list%close(error)
    else
      call list%close(ignored)
    end if
    if (.not. allocated(error)) call rename_file(name//'.part', name, error)
    if (allocated(error)) call remove_file(name//'.part')
  end subroutine write_list

  !> Remove the files of an older series from number `first` (0 = the first) on. The last goes
  !> first, so that an end in the midst leaves no gap that would hide the others.
  subroutine remove_series(directory, stem, ending, first)
    character(*), intent(in) :: directory  !! folder of the files; '' for the current one
    character(*), intent(in) :: stem       !! name of the files without number and ending
    character(*), intent(in) :: ending     !! of the files, with its dot
    integer, intent(in) :: first           !! number of the first that is removed
    integer :: last, i

    if (first == 0) call remove_file(in_directory(directory, stem//'.pvd'))
    last = first
    do while (file_exists(in_directory(directory, member(stem, last, ending))))
      last = last + 1
    end do
    do i = last - 1, first, -1
      call remove_file(in_directory(directory, member(stem, i, ending)))
    end do
  end subroutine remove_series

end module pd_output_results_xml
