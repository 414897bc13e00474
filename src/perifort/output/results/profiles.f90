!> Lines in the results: `/lines/NAME/position` (n, dim) and `/lines/NAME/FIELD` (outputs, n,
!> components) of the HDF5 file, and the table `NAME.csv` beside it, a row for each output and
!> position.
!>
!> As all that outputs write, the datasets are laid out in full at the start
!> (`pd_output_results_vtkhdf`): what they hold counts as far as the outputs do. An error is set if
!> a file cannot be written.
module pd_output_results_profiles
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: to_text
  use pd_output_results_blocks, only: make_blocks, read_block, set_blocks, write_block
  use pd_output_results_datasets, only: make_dataset, storage_f8, write_rows
  use pd_output_results_hdf5, only: hdf5_file, make_group, put_attribute
  use pd_output_results_lines, only: lines_type
  use pd_output_results_types, only: line_type
  implicit none (type, external)
  private
  public :: make_profiles, put_profile, copy_profiles, trim_profiles, bytes_of_profiles
  public :: head_of_profile, add_profile

  integer(i8), parameter :: together = 65536_i8  !! blocks of so much are stored as one [bytes]

contains

  !> Lay out the lines of a file, with room for so many outputs.
  subroutine make_profiles(file, lines, capacity, error)
    type(hdf5_file), intent(in) :: file       !! writable, without `/lines`
    type(line_type), intent(in) :: lines(:)   !! (any number); without any nothing is made
    integer(i8), intent(in) :: capacity       !! outputs there is room for
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: path
    integer :: i, f, n

    if (size(lines) == 0) return
    call make_group(file, '/lines', error)
    do i = 1, size(lines)
      associate (line => lines(i))
        n = size(line%positions, 1)
        path = '/lines/'//trim(line%name)
        if (.not. allocated(error)) call make_group(file, path, error)
        if (.not. allocated(error)) call make_dataset(file, path//'/position', storage_f8, &
          & size(line%positions, 2), int(n, i8), error)
        if (allocated(error)) return
        if (size(line%positions, 2) == 1) then
          call write_rows(file, path//'/position', 0_i8, line%positions(:, 1), error)
        else
          call write_rows(file, path//'/position', 0_i8, transpose(line%positions), error)
        end if
        if (.not. allocated(error)) call put_attribute(file, path//'/position', 'units', 'm', error)
        do f = 1, size(line%fields)
          if (allocated(error)) return
          associate (field => line%fields(f), at => path//'/'//trim(line%fields(f)%name))
            call make_blocks(file, at, field%components, n, capacity, &
              & min(capacity, together/(8_i8*n*field%components)), error)
            if (.not. allocated(error)) call put_attribute(file, at, 'units', trim(field%unit), &
              & error)
            if (field%labels /= '' .and. .not. allocated(error)) &
              & call put_attribute(file, at, 'components', trim(field%labels), error)
          end associate
        end do
      end associate
      if (allocated(error)) return
    end do
  end subroutine make_profiles

  !> Write the profiles of a line for an output.
  subroutine put_profile(file, line, output, values, error)
    type(hdf5_file), intent(in) :: file      !! laid out, open and writable
    type(line_type), intent(in) :: line
    integer(i8), intent(in) :: output        !! its number, from 0
    real(wp), intent(in) :: values(:, :)     !! (components of all fields, position)
    type(error_type), allocatable, intent(out) :: error
    integer :: f, first, n

    first = 1
    do f = 1, size(line%fields)
      n = line%fields(f)%components
      call write_block(file, '/lines/'//trim(line%name)//'/'//trim(line%fields(f)%name), output, &
        & values(first:first + n - 1, :), error)
      if (allocated(error)) return
      first = first + n
    end do
  end subroutine put_profile

  !> Copy the profiles of the complete outputs, and of one under way.
  subroutine copy_profiles(from, to, lines, outputs, capacity, error)
    type(hdf5_file), intent(in) :: from       !! a file of the same lines
    type(hdf5_file), intent(in) :: to         !! laid out with room for as many
    type(line_type), intent(in) :: lines(:)
    integer(i8), intent(in) :: outputs        !! complete ones
    integer(i8), intent(in) :: capacity       !! outputs that `from` has room for
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: path
    real(wp), allocatable :: values(:, :)
    integer(i8) :: o
    integer :: i, f

    do i = 1, size(lines)
      do f = 1, size(lines(i)%fields)
        path = '/lines/'//trim(lines(i)%name)//'/'//trim(lines(i)%fields(f)%name)
        allocate (values(lines(i)%fields(f)%components, size(lines(i)%positions, 1)))
        do o = 0, min(outputs, capacity - 1)
          call read_block(from, path, o, values, error)
          if (.not. allocated(error)) call write_block(to, path, o, values, error)
          if (allocated(error)) return
        end do
        deallocate (values)
      end do
    end do
  end subroutine copy_profiles

  !> Cut off the room that `outputs` outputs did not need.
  subroutine trim_profiles(file, lines, outputs, error)
    type(hdf5_file), intent(in) :: file       !! open and writable
    type(line_type), intent(in) :: lines(:)
    integer(i8), intent(in) :: outputs        !! that stay
    type(error_type), allocatable, intent(out) :: error
    integer :: i, f

    do i = 1, size(lines)
      do f = 1, size(lines(i)%fields)
        call set_blocks(file, '/lines/'//trim(lines(i)%name)//'/'//trim(lines(i)%fields(f)%name), &
          & lines(i)%fields(f)%components, size(lines(i)%positions, 1), outputs, error)
        if (allocated(error)) return
      end do
    end do
  end subroutine trim_profiles

  !> Bytes of an output.
  pure integer(i8) function bytes_of_profiles(lines) result(bytes)
    type(line_type), intent(in) :: lines(:)
    integer :: i

    bytes = 0
    do i = 1, size(lines)
      bytes = bytes + 8_i8*size(lines(i)%positions, 1)*sum(lines(i)%fields%components)
    end do
  end function bytes_of_profiles

  !> The names of the columns of a line's table.
  pure function head_of_profile(line) result(head)
    type(line_type), intent(in) :: line
    character(:), allocatable :: head
    character(*), parameter :: xyz = 'xyz'
    character(:), allocatable :: labels
    integer :: c, f, blank

    head = 'output,time'
    do c = 1, size(line%positions, 2)
      head = head//','//xyz(c:c)
    end do
    head = head//',distance'
    do f = 1, size(line%fields)
      labels = trim(line%fields(f)%labels)
      if (labels == '') head = head//','//trim(line%fields(f)%name)
      do while (labels /= '')
        blank = index(labels//' ', ' ')
        head = head//','//trim(line%fields(f)%name)//'_'//labels(:blank - 1)
        labels = trim(labels(min(blank + 1, len(labels) + 1):))
      end do
    end do
  end function head_of_profile

  !> Add the rows of an output to a line's table.
  subroutine add_profile(csv, line, output, time, values, error)
    type(lines_type), intent(inout) :: csv  !! the table, begun
    type(line_type), intent(in) :: line
    integer, intent(in) :: output                !! its number, from 0
    real(wp), intent(in) :: time                 !! [s]
    real(wp), intent(in) :: values(:, :)         !! (components of all fields, position)
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: text
    character(24) :: number
    real(wp), allocatable :: row(:)
    integer :: p, i

    do p = 1, size(values, 2)
      row = [time, line%positions(p, :), norm2(line%positions(p, :) - line%positions(1, :)), &
        & values(:, p)]
      text = to_text(output)
      do i = 1, size(row)
        write (number, '(es24.16e3)') row(i)
        text = text//','//trim(adjustl(number))
      end do
      call csv%add(text, error)
      if (allocated(error)) return
    end do
    call csv%hand_over(error)
  end subroutine add_profile

end module pd_output_results_profiles
