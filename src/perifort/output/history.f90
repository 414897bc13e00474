!> The history: a table of a row per reported step, gathered in memory and written now and then.
module pd_output_history
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: newline, to_text
  use pd_output_sink, only: sink_type
  use pd_output_types, only: column_type
  implicit none (type, external)
  private
  public :: history_type, csv_type

  integer, parameter :: first_rows = 256, many_rows = 4096

  !> Rows that wait to be written.
  type :: history_type
    private
    real(wp), allocatable :: rows(:, :)  !! (column, row): a row is added at once
    integer :: waiting = 0
    integer :: columns = 0
    integer(i8) :: written_at = 0        !! clock count of the last writing
  contains
    procedure :: start
    procedure :: add
    procedure :: is_due
    procedure :: has_rows
    procedure :: take
  end type history_type

  !> The table as text, numbers with all their digits, parted by commas.
  type :: csv_type
    private
    type(sink_type) :: sink
  contains
    procedure :: open => open_csv
    procedure :: append => append_csv
    procedure :: close => close_csv
    procedure :: is_open => is_csv_open
  end type csv_type

contains

  !> Begin a table of so many columns.
  subroutine start(self, columns)
    class(history_type), intent(out) :: self
    integer, intent(in) :: columns

    self%columns = columns
    allocate (self%rows(columns, first_rows))
    call system_clock(self%written_at)
  end subroutine start

  !> Add a row: a value for each column.
  subroutine add(self, values, error)
    class(history_type), intent(inout) :: self
    real(wp), intent(in) :: values(:)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: longer(:, :)

    if (size(values) /= self%columns) then
      call fail(error, 'a history row has '//to_text(size(values))//' values for ' &
        & //to_text(self%columns)//' columns')
      return
    end if
    if (self%waiting == size(self%rows, 2)) then
      allocate (longer(self%columns, 2*self%waiting))
      longer(:, :self%waiting) = self%rows
      call move_alloc(longer, self%rows)
    end if
    self%waiting = self%waiting + 1
    self%rows(:, self%waiting) = values
  end subroutine add

  !> Whether rows wait since a second, or are many.
  logical function is_due(self)
    class(history_type), intent(in) :: self
    integer(i8) :: now, rate

    is_due = self%waiting >= many_rows
    if (is_due .or. self%waiting == 0) return
    call system_clock(now, rate)
    is_due = now - self%written_at >= rate
  end function is_due

  !> Whether rows wait.
  pure logical function has_rows(self)
    class(history_type), intent(in) :: self
    has_rows = self%waiting > 0
  end function has_rows

  !> Hand out the waiting rows as `table(row, column)` and forget them.
  subroutine take(self, table)
    class(history_type), intent(inout) :: self
    real(wp), allocatable, intent(out) :: table(:, :)

    allocate (table(self%waiting, self%columns), source=transpose(self%rows(:, :self%waiting)))
    self%waiting = 0
    call system_clock(self%written_at)
  end subroutine take

  !> Make the file with its line of names.
  subroutine open_csv(self, path, columns, error)
    class(csv_type), intent(inout) :: self
    character(*), intent(in) :: path
    type(column_type), intent(in) :: columns(:)
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: line
    integer :: i

    call self%sink%open(path, error)
    if (allocated(error)) return
    line = ''
    do i = 1, size(columns)
      if (i > 1) line = line//','
      line = line//trim(columns(i)%name)
    end do
    call self%sink%line(line, error)
  end subroutine open_csv

  !> Append `table(row, column)` and hand it to the system.
  subroutine append_csv(self, table, error)
    class(csv_type), intent(inout) :: self
    real(wp), intent(in) :: table(:, :)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: width = 24
    character(:), allocatable :: line
    character(width) :: number
    integer :: i, j, last, digits

    allocate (character((width + 1)*size(table, 2)) :: line)
    do i = 1, size(table, 1)
      last = 0
      do j = 1, size(table, 2)
        write (number, '(es24.16e3)') table(i, j)
        number = adjustl(number)
        digits = len_trim(number)
        line(last + 1:last + digits) = number(:digits)
        line(last + digits + 1:last + digits + 1) = ','
        last = last + digits + 1
      end do
      if (last > 0) line(last:last) = newline
      call self%sink%put(line(:last), error)
      if (allocated(error)) return
    end do
    call self%sink%flush(error)
  end subroutine append_csv

  !> Complete the file.
  subroutine close_csv(self, error)
    class(csv_type), intent(inout) :: self
    type(error_type), allocatable, intent(out) :: error
    call self%sink%close(error)
  end subroutine close_csv

  !> Whether the file is open.
  logical function is_csv_open(self)
    class(csv_type), intent(in) :: self
    is_csv_open = self%sink%is_open()
  end function is_csv_open

end module pd_output_history
