!> The results of a run in memory: the history as a table, and the last output's fields.
module pd_output_results_answer
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp
  use pd_base_text, only: join, nearest_name
  use pd_output_results_types, only: column_type, field_type, label_length
  implicit none (type, external)
  private
  public :: answer_type, values_type

  !> One field of an output.
  type :: values_type
    real(wp), allocatable :: values(:, :)            !! (point, component), in the field's unit
  end type values_type

  !> The results of a run. After an error the history extends to the step of the error, and the
  !> fields are those of the last complete output. Points are numbered as in the files: body by
  !> body, then layers.
  type :: answer_type
    type(column_type), allocatable :: columns(:)     !! of the history: names and units
    real(wp), allocatable :: history(:, :)           !! (row, column)
    real(wp), allocatable :: positions(:, :)         !! of the points (point, 3) [m]
    type(field_type), allocatable :: fields(:)       !! names, units and numbers of components
    type(values_type), allocatable :: values(:)      !! of each field, in the last output
    real(wp) :: time = 0.0_wp                        !! of the last output [s]
    integer :: outputs = 0                           !! of the run; without one fields are empty
    character(:), allocatable :: warnings            !! a line for each: how many times, the text
  contains
    procedure :: get_column
    procedure :: get_field
    procedure :: column_number
    procedure :: field_number
  end type answer_type

contains

  !> A column of the history by its name, a value for each row.
  subroutine get_column(self, name, values, error)
    class(answer_type), intent(in) :: self
    character(*), intent(in) :: name                     !! as in history.csv
    real(wp), allocatable, intent(out) :: values(:)      !! in the unit of the column
    type(error_type), allocatable, intent(out) :: error  !! no such column
    integer :: c

    c = self%column_number(name)
    if (c == 0) then
      call unknown('column', name, names_of_columns(self), error)
    else
      values = self%history(:, c)
    end if
  end subroutine get_column

  !> A field of the last output by its name.
  subroutine get_field(self, name, values, error)
    class(answer_type), intent(in) :: self
    character(*), intent(in) :: name                     !! as in `&output fields`
    real(wp), allocatable, intent(out) :: values(:, :)   !! (point, component); vectors have three
    type(error_type), allocatable, intent(out) :: error  !! no such field, or no output
    integer :: f

    f = self%field_number(name)
    if (f == 0) then
      call unknown('field', name, names_of_fields(self), error)
    else if (.not. allocated(self%values(f)%values)) then
      call fail(error, "there is no output that holds the field '"//trim(name)//"'")
    else
      values = self%values(f)%values
    end if
  end subroutine get_field

  !> Number of a column of the history, 0 if there is none of this name.
  pure integer function column_number(self, name) result(number)
    class(answer_type), intent(in) :: self
    character(*), intent(in) :: name

    number = 0
    if (.not. allocated(self%columns)) return
    do number = 1, size(self%columns)
      if (self%columns(number)%name == name) return
    end do
    number = 0
  end function column_number

  !> Number of a field, 0 if there is none of this name.
  pure integer function field_number(self, name) result(number)
    class(answer_type), intent(in) :: self
    character(*), intent(in) :: name

    number = 0
    if (.not. allocated(self%fields)) return
    do number = 1, size(self%fields)
      if (self%fields(number)%name == name) return
    end do
    number = 0
  end function field_number

  !> An error that lists the existing names.
  subroutine unknown(kind, name, names, error)
    character(*), intent(in) :: kind, name
    character(*), intent(in) :: names(:)
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: hint

    hint = nearest_name(name, names)
    if (len(hint) > 0) hint = "; did you mean '"//hint//"'?"
    if (size(names) == 0) then
      call fail(error, "there is no "//kind//" '"//trim(name)//"': the run has none")
    else
      call fail(error, "there is no "//kind//" '"//trim(name)//"'"//hint//' known: '// &
        & join(names, ', '))
    end if
  end subroutine unknown

  !> Names of all columns.
  pure function names_of_columns(self) result(names)
    class(answer_type), intent(in) :: self
    character(label_length), allocatable :: names(:)
    integer :: i

    allocate (names(0))
    if (allocated(self%columns)) names = [character(label_length) :: &
      & (self%columns(i)%name, i=1, size(self%columns))]
  end function names_of_columns

  !> Names of all fields.
  pure function names_of_fields(self) result(names)
    class(answer_type), intent(in) :: self
    character(label_length), allocatable :: names(:)
    integer :: i

    allocate (names(0))
    if (allocated(self%fields)) names = [character(label_length) :: &
      & (self%fields(i)%name, i=1, size(self%fields))]
  end function names_of_fields

end module pd_output_results_answer
