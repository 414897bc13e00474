!> Whether what the results are to hold can be written: names, shapes and words.
module pd_output_results_description
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: lower_case
  use pd_output_results_types, only: column_type, field_type, label_length
  use pd_output_results_views, only: views_fit
  implicit none (type, external)
  private
  public :: check_description, has_list, names_of_files

contains

  !> An error if there is no point, if positions do not have three components, if precision or
  !> format are unknown, if a name is unusable or taken twice, or if a field has neither 1 nor 3
  !> components.
  subroutine check_description(positions, fields, columns, precision, format, error)
    real(wp), intent(in) :: positions(:, :)      !! (n_points, 3) [m]
    type(field_type), intent(in) :: fields(:)    !! (any number) of every output
    type(column_type), intent(in) :: columns(:)  !! (any number) of the history
    character(*), intent(in) :: precision        !! of the fields: 'single' or 'double', in any case
    character(*), intent(in) :: format  !! of the files: 'vtkhdf', 'vtu' or 'both', in any case
    type(error_type), allocatable, intent(out) :: error
    character(label_length), allocatable :: names(:)
    integer :: i

    if (size(positions, 1) < 1) then
      call fail(error, 'results need at least one point')
    else if (size(positions, 2) /= 3) then
      call fail(error, 'positions need three components, whatever the dimension')
    else if (all(lower_case(trim(precision)) /= ['single', 'double'])) then
      call fail(error, 'unknown precision '''//trim(precision)//''': single, double')
    else if (all(lower_case(trim(format)) /= ['vtkhdf', 'vtu   ', 'both  '])) then
      call fail(error, 'unknown format '''//trim(format)//''': vtkhdf, vtu, both')
    end if
    allocate (names(max(size(fields), size(columns))))
    do i = 1, size(fields)
      if (allocated(error)) return
      names(i) = fields(i)%name
      call check_name(names(i), names(:i - 1), error)
      if (.not. allocated(error) .and. all(fields(i)%components /= [1, 3, 4, 6, 9])) &
        & call fail(error, 'field '//trim(fields(i)%name)//' has not 1, 3, 4, 6 or 9 components')
    end do
    do i = 1, size(columns)
      if (allocated(error)) return
      names(i) = columns(i)%name
      call check_name(names(i), names(:i - 1), error)
    end do
  end subroutine check_description

  !> A name is there, new, and no path; a comma would part it in the table.
  subroutine check_name(name, others, error)
    character(*), intent(in) :: name, others(:)
    type(error_type), allocatable, intent(out) :: error

    if (name == '' .or. scan(trim(name), '/,"<>&'//new_line('a')) > 0 .or. name == '.') then
      call fail(error, '''' //trim(name)//''' can''t name a field or column of the results')
    else if (any(others == name)) then
      call fail(error, 'two fields or columns of the results are named '//trim(name))
    end if
  end subroutine check_name

  !> Whether results in these files have a list of outputs, `STEM.xdmf`, beside the HDF5 file. Its
  !> readers take what is before a colon for the name of the HDF5 file.
  pure logical function has_list(stem, format, fields, outputs)
    character(*), intent(in) :: stem           !! name of the files without their endings
    character(*), intent(in) :: format         !! 'vtkhdf', 'vtu' or 'both', in any case
    type(field_type), intent(in) :: fields(:)  !! (any number) of every output
    integer, intent(in) :: outputs             !! planned
    has_list = lower_case(format) /= 'vtu' .and. index(stem, ':') == 0 .and. &
      & views_fit(fields, int(outputs, i8))
  end function has_list

  !> The files that a run will write, for its user.
  pure function names_of_files(stem, format, fields, outputs) result(text)
    character(*), intent(in) :: stem           !! name of the files without their endings
    character(*), intent(in) :: format         !! 'vtkhdf', 'vtu' or 'both', in any case
    type(field_type), intent(in) :: fields(:)  !! (any number) of every output
    integer, intent(in) :: outputs             !! planned
    character(:), allocatable :: text

    text = ''
    if (lower_case(format) /= 'vtu') text = stem//'.vtkhdf, '
    if (has_list(stem, format, fields, outputs)) then
      text = text//stem//'.xdmf (opens in ParaView and pyvista), '
    else if (lower_case(format) /= 'vtu' .and. index(stem, ':') == 0) then
      text = text//'no '//stem//'.xdmf for so many outputs, '
    end if
    if (lower_case(format) /= 'vtkhdf') text = text//stem//'.pvd with .vtu files, '
    text = text//'history.csv'
  end function names_of_files

end module pd_output_results_description
