!> What the history measures besides the columns that every run has: an abstract kind, and the list
!> of the measures of a run. Each kind has a module of its own in this folder;
!> `pd_output_measures_table` lists them.
!>
!>     call measures_of(scene, table, measures)         ! known before there are points
!>     call measures%begin(scene, system, error)        ! where they measure
!>     columns = measures%columns(dim)
!>     call measures%row(now, values)                   ! once for each row of the history
!>     call measures%keep(archive)                      ! in a checkpoint
module pd_output_measures_measure
  use pd_base_archive, only: archive_type
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp
  use pd_base_warnings, only: warnings_type
  use pd_motion_observer, only: instant_type
  use pd_motion_account, only: energies_type
  use pd_motion_system, only: system_type
  use pd_output_fields_field, only: moment_type
  use pd_output_results_types, only: column_type
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: measure_type, measure_list_type, row_source_type

  !> What a row of the history is taken from.
  type, extends(moment_type) :: row_source_type
    type(instant_type) :: instant
    type(energies_type) :: energies      !! at this instant
  end type row_source_type

  !> One measure. `columns` and `row` are needed; the other procedures may be left out.
  type, abstract :: measure_type
  contains
    procedure(columns_interface), deferred :: columns  !! what it adds to the history
    procedure(row_interface), deferred :: row          !! their values
    procedure :: begin => begin_nothing                !! find where it measures
    procedure :: keep => keep_nothing                  !! state that a restart needs
    procedure :: describe => describe_nothing          !! lines of the summary before a run
    procedure :: warn => warn_of_nothing               !! warnings before a run
  end type measure_type

  !> A measure of any kind.
  type :: item_type
    class(measure_type), allocatable :: measure
  end type item_type

  !> The measures of a run, in the order of their columns.
  type :: measure_list_type
    type(item_type), allocatable :: items(:)
  contains
    procedure :: add
    procedure :: begin
    procedure :: columns
    procedure :: row
    procedure :: keep
    procedure :: describe
    procedure :: warn
  end type measure_list_type

  abstract interface
    !> Columns of the history. They are asked for before `begin`, too.
    function columns_interface(measure, dim) result(columns)
      import :: column_type, measure_type
      implicit none (type, external)
      class(measure_type), intent(in) :: measure  !! as its scene describes it
      integer, intent(in) :: dim                  !! 1, 2 or 3
      type(column_type), allocatable :: columns(:)
    end function columns_interface

    !> Values of the columns at an instant. Called once for each row of the history, in the order of
    !> the rows, so that a measure may carry something from row to row.
    subroutine row_interface(measure, now, values)
      import :: measure_type, row_source_type, wp
      implicit none (type, external)
      class(measure_type), intent(inout) :: measure  !! begun
      type(row_source_type), intent(in) :: now       !! the instant
      real(wp), intent(out) :: values(:)             !! (columns) in their units
    end subroutine row_interface
  end interface

contains

  !> Find where a measure measures: nothing to find.
  subroutine begin_nothing(measure, scene, system, error)
    class(measure_type), intent(inout) :: measure  !! ready for rows on return
    type(scene_type), intent(in) :: scene          !! for the places of errors
    type(system_type), intent(in) :: system        !! before its first step
    type(error_type), allocatable, intent(out) :: error
    associate (unused_measure => measure, unused_scene => scene, unused_system => system)
    end associate
  end subroutine begin_nothing

  !> Keep the state that goes from row to row: there is none.
  subroutine keep_nothing(measure, archive)
    class(measure_type), intent(inout) :: measure  !! begun; set where the archive reads
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    associate (unused_measure => measure, unused_archive => archive)
    end associate
  end subroutine keep_nothing

  !> Lines of the summary before a run, each with its end: none.
  function describe_nothing(measure, system) result(text)
    class(measure_type), intent(in) :: measure     !! begun
    type(system_type), intent(in) :: system        !! before its first step
    character(:), allocatable :: text
    associate (unused_measure => measure, unused_system => system)
    end associate
    text = ''
  end function describe_nothing

  !> Add warnings that are known before a run: none.
  subroutine warn_of_nothing(measure, system, warnings)
    class(measure_type), intent(in) :: measure       !! begun
    type(system_type), intent(in) :: system          !! before its first step
    type(warnings_type), intent(inout) :: warnings   !! added to
    associate (unused_measure => measure, unused_system => system, unused_warnings => warnings)
    end associate
  end subroutine warn_of_nothing

  !> Add a measure at the end.
  subroutine add(self, measure)
    class(measure_list_type), intent(inout) :: self  !! with one more on return
    class(measure_type), intent(in) :: measure       !! copied
    type(item_type), allocatable :: longer(:)
    integer :: i, n

    n = 0
    if (allocated(self%items)) n = size(self%items)
    allocate (longer(n + 1))
    do i = 1, n
      call move_alloc(self%items(i)%measure, longer(i)%measure)
    end do
    allocate (longer(n + 1)%measure, source=measure)
    call move_alloc(longer, self%items)
  end subroutine add

  !> Find where all of them measure. An error if a measure cannot be had of this system, or if two
  !> columns have one name.
  subroutine begin(self, scene, system, error)
    class(measure_list_type), intent(inout) :: self  !! of the scene
    type(scene_type), intent(in) :: scene            !! for the places of errors
    type(system_type), intent(in) :: system          !! made from it, before its first step
    type(error_type), allocatable, intent(out) :: error
    type(column_type), allocatable :: columns(:)
    integer :: i, j

    columns = self%columns(system%body%dim)
    do i = 2, size(columns)
      j = findloc(columns(:i - 1)%name, columns(i)%name, dim=1)
      if (j == 0) cycle
      call fail(error, "two columns of the history would be named '"//trim(columns(i)%name)// &
        & "', of a "//trim(columns(j)%origin)//' and of a '//trim(columns(i)%origin)// &
        & ': give one of the groups another name')
      return
    end do
    do i = 1, size(self%items)
      call self%items(i)%measure%begin(scene, system, error)
      if (allocated(error)) return
    end do
  end subroutine begin

  !> The columns of all.
  function columns(self, dim)
    class(measure_list_type), intent(in) :: self  !! of a scene, begun or not
    integer, intent(in) :: dim                    !! 1, 2 or 3
    type(column_type), allocatable :: columns(:)
    integer :: i

    allocate (columns(0))
    do i = 1, size(self%items)
      columns = [columns, self%items(i)%measure%columns(dim)]
    end do
  end function columns

  !> The values of `columns` at an instant, once for each row of the history.
  subroutine row(self, now, values)
    class(measure_list_type), intent(inout) :: self     !! begun
    type(row_source_type), intent(in) :: now            !! the instant
    real(wp), allocatable, intent(out) :: values(:)     !! (columns) in their units
    real(wp), allocatable :: mine(:)
    integer :: i

    allocate (values(0))
    do i = 1, size(self%items)
      associate (measure => self%items(i)%measure)
        allocate (mine(size(measure%columns(now%system%body%dim))), source=0.0_wp)
        call measure%row(now, mine)
        values = [values, mine]
        deallocate (mine)
      end associate
    end do
  end subroutine row

  !> Keep what goes from row to row, or put it back.
  subroutine keep(self, archive)
    class(measure_list_type), intent(inout) :: self  !! begun; set where the archive reads
    class(archive_type), intent(inout) :: archive    !! a checkpoint that is written or read
    integer :: i

    do i = 1, size(self%items)
      call self%items(i)%measure%keep(archive)
    end do
  end subroutine keep

  !> Lines of the summary before a run, each with its end.
  function describe(self, system) result(text)
    class(measure_list_type), intent(in) :: self   !! begun
    type(system_type), intent(in) :: system        !! before its first step
    character(:), allocatable :: text
    integer :: i

    text = ''
    do i = 1, size(self%items)
      text = text//self%items(i)%measure%describe(system)
    end do
  end function describe

  !> Add the warnings that are known before a run.
  subroutine warn(self, system, warnings)
    class(measure_list_type), intent(in) :: self     !! begun
    type(system_type), intent(in) :: system          !! before its first step
    type(warnings_type), intent(inout) :: warnings   !! added to
    integer :: i

    do i = 1, size(self%items)
      call self%items(i)%measure%warn(system, warnings)
    end do
  end subroutine warn

end module pd_output_measures_measure
