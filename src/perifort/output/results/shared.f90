!> Rows of points that several ranks share, and how they come into the files of the first rank
!> (`pd_output_results_results`). All ranks make the same calls, each with its own rows. Rows of the
!> HDF5 file are written by their ranks, `together`, if the HDF5 library is a parallel one; else,
!> and for `.vtu` files, the first rank gets them in turns, as many at a time as it has itself.
!>
!> The files are those of the results: a rank that has none of a kind (`has_hdf5`, `has_vtu`) takes
!> part in the calls, but writes nothing into it.
module pd_output_results_shared
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: lower_case
  use pd_output_results_rows, only: rows_type
  use pd_output_results_together, only: can_write_together
  use pd_output_results_types, only: field_type
  use pd_output_results_vtkhdf, only: vtkhdf_file
  use pd_output_results_vtu, only: vtu_series
  implicit none (type, external)
  private
  public :: shared_type

  !> An array over the points that waits to be written by all ranks.
  type :: waiting_type
    character(:), allocatable :: name
    integer :: kind_of_points = 0
    real(wp), allocatable :: values(:)  !! (rows of this rank)
  end type waiting_type

  type :: shared_type
    type(rows_type) :: rows              !! of the points, that this rank has
    logical :: has_hdf5 = .false.        !! this rank has the HDF5 file
    logical :: has_vtu = .false.         !! and `.vtu` files
    logical :: together = .false.        !! all ranks write rows of the HDF5 file
    logical :: hdf5_in_turns = .false.   !! the first rank writes those of all into that file, ..
    logical :: vtu_in_turns = .false.    !! and into .vtu files
    real(wp), allocatable :: here(:, :)  !! positions of the points, while they are needed
    type(waiting_type), allocatable :: of_points(:)  !! arrays that all ranks have to write
  contains
    procedure :: divided
    procedure :: share
    procedure :: put_points
    procedure :: settle
    procedure :: begin_output
    procedure :: put_field
    procedure :: end_output
    procedure :: written_by
  end type shared_type

contains

  !> Whether there are several ranks.
  pure logical function divided(self)
    class(shared_type), intent(in) :: self  !! the rows
    divided = self%rows%divided()
  end function divided

  !> Find out how ranks write the files of the first one; all learn whether these go on from an
  !> earlier run. To be called on several ranks alone.
  subroutine share(self, path, format, fields, single, resumed, vtkhdf)
    class(shared_type), intent(inout) :: self     !! with its rows and what this rank has
    character(*), intent(in) :: path              !! of the HDF5 file
    character(*), intent(in) :: format            !! 'vtkhdf', 'vtu' or 'both'
    type(field_type), intent(in) :: fields(:)     !! (any number) that every output has
    logical, intent(in) :: single                 !! fields in single precision
    logical, intent(inout) :: resumed             !! on the first rank given, on the others set
    type(vtkhdf_file), intent(inout) :: vtkhdf    !! of ranks without a file it attends that one
    real(wp) :: goes_on(1)
    logical :: hdf5

    hdf5 = lower_case(format) /= 'vtu'
    self%together = hdf5 .and. can_write_together()
    self%hdf5_in_turns = hdf5 .and. .not. self%together
    self%vtu_in_turns = lower_case(format) /= 'vtkhdf'
    allocate (self%of_points(0))
    goes_on = merge(1.0_wp, 0.0_wp, resumed)
    call self%rows%ranks%take_largest(goes_on)
    if (self%rows%on_first) return
    if (hdf5) call vtkhdf%attend(path, self%rows%all, fields, single)
    resumed = goes_on(1) > 0.0_wp
  end subroutine share

  !> An array over the points: the first rank makes it. All write their rows when the file is laid
  !> out, or the first one gets them now. An error if its length is wrong, or if it cannot be made.
  subroutine put_points(self, vtkhdf, name, kind_of_points, values, error)
    class(shared_type), intent(inout) :: self   !! shared
    type(vtkhdf_file), intent(inout) :: vtkhdf  !! before its first output
    character(*), intent(in) :: name            !! of the array, below `/points`
    integer, intent(in) :: kind_of_points       !! as of `pd_output_results_vtkhdf`
    real(wp), intent(in) :: values(:)           !! (rows of this rank)
    type(error_type), allocatable, intent(out) :: error
    type(waiting_type) :: waiting
    real(wp), allocatable :: got(:, :)
    integer(i8) :: first
    integer :: turn

    if (size(values) /= self%rows%n) then
      call fail(error, 'points/'//trim(name)//' needs one value for each point')
      return
    end if
    if (self%has_hdf5) call vtkhdf%make_points(name, kind_of_points, error)
    if (allocated(error)) return
    if (self%together) then
      waiting%name = trim(name)
      waiting%kind_of_points = kind_of_points
      waiting%values = values
      self%of_points = [self%of_points, waiting]
    else if (self%hdf5_in_turns) then
      do turn = 1, self%rows%turns()
        call self%rows%take_turn(turn, reshape(values, [size(values), 1]), first, got)
        if (self%has_hdf5) call vtkhdf%put_rows_of_points(name, kind_of_points, first, &
          & got(:, 1), error)
        if (allocated(error)) return
      end do
    end if
  end subroutine put_points

  !> After the last `put_points` and before the first output: write what the points are, unless the
  !> files go on from an earlier run. An error if that cannot be written.
  subroutine settle(self, vtkhdf, resumed, error)
    class(shared_type), intent(inout) :: self   !! keeps positions for `.vtu` files alone on return
    type(vtkhdf_file), intent(inout) :: vtkhdf  !! with its points on return
    logical, intent(in) :: resumed              !! the files go on
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: got(:, :)
    integer(i8) :: first
    integer :: i, turn

    if (self%together .and. .not. resumed) then
      if (self%has_hdf5) call vtkhdf%seal(error)
      if (allocated(error)) return
      call self%rows%wait()
      call vtkhdf%open_shared(.false., error)
      if (.not. allocated(error)) call vtkhdf%put_geometry_of_rows(self%rows%before, self%here, &
        & self%rows%most, error)
      do i = 1, size(self%of_points)
        if (allocated(error)) exit
        associate (waiting => self%of_points(i))
          call vtkhdf%put_rows_of_points(waiting%name, waiting%kind_of_points, &
            & self%rows%before, waiting%values, error)
        end associate
      end do
      if (.not. allocated(error)) call vtkhdf%close_shared(error)
      deallocate (self%of_points)
    else if (self%hdf5_in_turns .and. .not. resumed) then
      do turn = 1, self%rows%turns()
        call self%rows%take_turn(turn, self%here, first, got)
        if (self%has_hdf5) call vtkhdf%put_geometry_of_rows(first, got, size(got, 1, kind=i8), &
          & error)
        if (allocated(error)) exit
      end do
    end if
    if (.not. (self%has_vtu .or. self%vtu_in_turns) .and. allocated(self%here)) &
      & deallocate (self%here)
  end subroutine settle

  !> Begin the rows of an output: all ranks open the HDF5 file, whose records stay as they are from
  !> now on, and `.vtu` files get the positions. An error if that fails.
  subroutine begin_output(self, vtkhdf, vtu, has_name, error)
    class(shared_type), intent(inout) :: self   !! settled
    type(vtkhdf_file), intent(inout) :: vtkhdf  !! open for all on return, if they write together
    type(vtu_series), intent(inout) :: vtu      !! with the positions of its output on return
    logical, intent(in) :: has_name             !! the HDF5 file has its name already
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: got(:, :)
    integer(i8) :: first
    integer :: turn

    if (self%together) then
      call self%rows%wait()
      call vtkhdf%open_shared(has_name, error)
      if (allocated(error)) return
    end if
    if (self%vtu_in_turns) then
      do turn = 1, self%rows%turns()
        call self%rows%take_turn(turn, self%here, first, got)
        if (self%has_vtu) call vtu%put_positions(first, got, error)
        if (allocated(error)) return
      end do
    else if (self%has_vtu) then
      call vtu%put_positions(0_i8, self%here, error)
    end if
  end subroutine begin_output

  !> Write the rows of a field. An error if that fails.
  subroutine put_field(self, vtkhdf, vtu, field, output, values, error)
    class(shared_type), intent(inout) :: self   !! with an output under way
    type(vtkhdf_file), intent(inout) :: vtkhdf  !! with the rows on return
    type(vtu_series), intent(inout) :: vtu      !! likewise
    integer, intent(in) :: field                !! its number, from 1
    integer, intent(in) :: output               !! complete outputs before this one
    real(wp), intent(in) :: values(:, :)        !! (rows of this rank, components)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: got(:, :)
    integer(i8) :: first
    integer :: turn

    if (self%together) call vtkhdf%put_rows(field, output, self%rows%before, values, &
      & self%rows%most, error)
    if (allocated(error) .or. .not. (self%hdf5_in_turns .or. self%vtu_in_turns)) return
    do turn = 1, self%rows%turns()
      call self%rows%take_turn(turn, values, first, got)
      if (self%has_hdf5 .and. self%hdf5_in_turns) call vtkhdf%put_rows(field, output, first, got, &
        & size(got, 1, kind=i8), error)
      if (self%has_vtu .and. .not. allocated(error)) call vtu%put_field(field, first, got, error)
      if (allocated(error)) return
    end do
  end subroutine put_field

  !> Wait until all ranks have written their rows of an output: it counts only then. An error if
  !> the file cannot be closed.
  subroutine end_output(self, vtkhdf, error)
    class(shared_type), intent(inout) :: self   !! with an output under way
    type(vtkhdf_file), intent(inout) :: vtkhdf  !! closed for ranks that attend it on return
    type(error_type), allocatable, intent(out) :: error

    if (.not. self%together) return
    call vtkhdf%close_shared(error)
    if (.not. allocated(error)) call self%rows%wait()
  end subroutine end_output

  !> Which ranks write the fields; '' where there is one, or no file.
  pure function written_by(self) result(text)
    class(shared_type), intent(in) :: self  !! the rows
    character(:), allocatable :: text

    text = ''
    if (self%together) text = 'all ranks'
    if (self%hdf5_in_turns .or. (self%vtu_in_turns .and. .not. self%together)) &
      & text = 'the first rank'
  end function written_by

end module pd_output_results_shared
