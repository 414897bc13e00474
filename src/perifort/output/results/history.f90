!> The history: a table of a row per reported step, gathered in memory and written now and then. All
!> rows stay in memory, since checkpoints hold them. Procedures of the text set an error if the file
!> cannot be written.
module pd_output_results_history
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: newline, to_text
  use pd_output_results_sink, only: sink_type
  use pd_output_results_types, only: column_type
  implicit none (type, external)
  private
  public :: history_type, csv_type

  integer, parameter :: initial_rows = 256, many_rows = 4096

  !> All rows, and which of them wait to be written.
  type :: history_type
    private
    real(wp), allocatable :: rows(:, :)  !! (column, row): a row is added at once
    integer :: count = 0                 !! rows
    integer :: written = 0               !! of them, handed out by `take`
    integer :: columns = 0
    integer(i8) :: written_at = 0        !! clock count of the last writing
  contains
    procedure :: start
    procedure :: add
    procedure :: is_due
    procedure :: has_rows
    procedure :: take
    procedure :: first_rows => rows_so_far
    procedure :: restore
  end type history_type

  !> The table as text, numbers with all their digits, parted by commas.
  type :: csv_type
    private
    type(sink_type) :: sink
  contains
    procedure :: open => open_csv
    procedure :: append => append_csv
    procedure :: replace => replace_csv
    procedure :: sync => sync_csv
    procedure :: close => close_csv
    procedure :: is_open => is_csv_open
  end type csv_type

contains

  !> Begin a table of so many columns.
  subroutine start(self, columns)
    class(history_type), intent(out) :: self  !! empty, with room for some rows
    integer, intent(in) :: columns            !! values in a row

    self%columns = columns
    allocate (self%rows(columns, initial_rows))
    call system_clock(self%written_at)
  end subroutine start

  !> Add a row: a value for each column. An error if their number is another one.
  subroutine add(self, values, error)
    class(history_type), intent(inout) :: self  !! with one row more on return
    real(wp), intent(in) :: values(:)           !! (columns), one for each
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: longer(:, :)

    if (size(values) /= self%columns) then
      call fail(error, 'a history row has '//to_text(size(values))//' values for ' &
        & //to_text(self%columns)//' columns')
      return
    end if
    if (self%count == size(self%rows, 2)) then
      allocate (longer(self%columns, max(initial_rows, 2*self%count)))
      longer(:, :self%count) = self%rows
      call move_alloc(longer, self%rows)
    end if
    self%count = self%count + 1
    self%rows(:, self%count) = values
  end subroutine add

  !> Whether rows wait since a second, or are many.
  logical function is_due(self)
    class(history_type), intent(in) :: self  !! with the rows that wait
    integer(i8) :: now, rate

    is_due = self%count - self%written >= many_rows
    if (is_due .or. self%count == self%written) return
    call system_clock(now, rate)
    is_due = now - self%written_at >= rate
  end function is_due

  !> Whether rows wait.
  pure logical function has_rows(self)
    class(history_type), intent(in) :: self  !! with the rows that wait
    has_rows = self%count > self%written
  end function has_rows

  !> Hand out the waiting rows as `table(row, column)`, which no longer wait.
  subroutine take(self, table)
    class(history_type), intent(inout) :: self  !! all its rows count as written on return
    real(wp), allocatable, intent(out) :: table(:, :)  !! (row, column) that waited

    allocate (table(self%count - self%written, self%columns), &
      & source=transpose(self%rows(:, self%written + 1:self%count)))
    self%written = self%count
    call system_clock(self%written_at)
  end subroutine take

  !> The first rows (column, row), all but the last `but`.
  pure function rows_so_far(self, but) result(rows)
    class(history_type), intent(in) :: self  !! with all rows
    integer, intent(in) :: but               !! how many of the last to leave out
    real(wp), allocatable :: rows(:, :)
    allocate (rows, source=self%rows(:, :self%count - but))
  end function rows_so_far

  !> Continue after `rows` (column, row), which the files have already if they are `written`.
  pure subroutine restore(self, rows, written)
    class(history_type), intent(inout) :: self  !! begun by `start`; has these rows only on return
    real(wp), intent(in) :: rows(:, :)          !! (column, row) of the run that continues
    logical, intent(in) :: written              !! whether the files have them; else they wait

    self%rows = rows
    self%count = size(rows, 2)
    self%written = merge(self%count, 0, written)
  end subroutine restore

  !> Make the file with its line of names.
  subroutine open_csv(self, path, columns, error)
    class(csv_type), intent(inout) :: self       !! open on return
    character(*), intent(in) :: path             !! of the file; one that is there is emptied
    type(column_type), intent(in) :: columns(:)  !! (any number), for the line of names
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

  !> Make the file anew with `rows` (column, row), in place of an older one in one step.
  subroutine replace_csv(self, path, columns, rows, error)
    class(csv_type), intent(inout) :: self       !! open on return, behind the rows
    character(*), intent(in) :: path             !! of the file
    type(column_type), intent(in) :: columns(:)  !! (any number), for the line of names
    real(wp), intent(in) :: rows(:, :)           !! (column, row), all from the first on
    type(error_type), allocatable, intent(out) :: error

    call self%open(path//'.part', columns, error)
    if (.not. allocated(error)) call self%append(transpose(rows), error)
    if (.not. allocated(error)) call self%sink%rename(path, error)
  end subroutine replace_csv

  !> Wait until all rows are on the disk.
  subroutine sync_csv(self, error)
    class(csv_type), intent(inout) :: self  !! open
    type(error_type), allocatable, intent(out) :: error
    call self%sink%sync(error)
  end subroutine sync_csv

  !> Append `table(row, column)` and hand it to the system.
  subroutine append_csv(self, table, error)
    class(csv_type), intent(inout) :: self  !! open
    real(wp), intent(in) :: table(:, :)     !! (row, column) to be added
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
    class(csv_type), intent(inout) :: self  !! open or not; not open on return
    type(error_type), allocatable, intent(out) :: error
    call self%sink%close(error)
  end subroutine close_csv

  !> Whether the file is open.
  logical function is_csv_open(self)
    class(csv_type), intent(in) :: self  !! the table as text
    is_csv_open = self%sink%is_open()
  end function is_csv_open

end module pd_output_results_history
