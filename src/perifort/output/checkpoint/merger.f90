!> Reads what ranks of another number have written, and puts it together for the points of this
!> rank.
!>
!> A set of checkpoints is one file of each of the ranks that wrote it. Arrays with a row for each
!> slot (`name_rows`) are put together by the numbers of the points: each row comes from the file
!> of the rank that owned the point. Tables that belong to all ranks together (`joined`) stand one
!> behind another. All else is the same in all files, and the first one has it.
!>
!> Files without a point that this rank has are closed at once, but for the first one. One array of
!> one file at a time is in memory.
module pd_output_checkpoint_merger
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc, c_ptr
  use pd_base_archive, only: archive_type, joined, of_slots, same
  use pd_base_error, only: fail, internal_fault
  use pd_base_kinds, only: i1, i8
  use pd_base_order, only: ascending_order, place_in
  use pd_base_text, only: to_text
  use pd_output_checkpoint_file, only: bytes_of_kind, reader_type
  implicit none (type, external)
  private
  public :: merger_type, part_path_type

  integer, parameter :: most_extents = 3
  integer, parameter :: the_slots = 1, the_last = 2  !! in `named`

  !> Path of a file.
  type :: part_path_type
    character(:), allocatable :: path
  end type part_path_type

  !> Which rows of a file go where.
  type :: map_type
    integer(i8) :: rows = 0_i8           !! that the file has
    integer, allocatable :: from(:)      !! rows of the file that are needed here
    integer, allocatable :: to(:)        !! their rows here
  end type map_type

  !> Rows of a name.
  type :: rows_type
    character(:), allocatable :: name
    integer(i8) :: rows = 0_i8           !! here
    type(map_type), allocatable :: of_file(:)
  end type rows_type

  type, extends(archive_type) :: merger_type
    private
    type(part_path_type), allocatable :: paths(:)  !! of the files, by the rank that wrote them
    type(reader_type), allocatable :: files(:)     !! those that are read, the first rank's first
    integer :: used = 0                            !! how many of them there are
    type(rows_type) :: named(2)                    !! the rows of slots, and those named last
    integer(i8), allocatable :: extents(:, :)      !! of the value in hand (extent, file)
    integer(i8) :: element = 0_i8                  !! bytes of one of its elements
  contains
    procedure :: open => open_merger
    procedure :: close => close_merger
    procedure :: name_rows
    procedure :: describe
    procedure :: move
  end type merger_type

contains

  !> Begin with the files of a set, each of which some rank has verified.
  subroutine open_merger(self, paths)
    class(merger_type), intent(inout) :: self       !! fresh; before its first value on return
    type(part_path_type), intent(in) :: paths(:)    !! (ranks that wrote them)
    integer :: r

    self%reading = .true.
    self%merges = .true.
    self%rows = same
    allocate (self%paths(size(paths)), self%files(size(paths)))
    do r = 1, size(paths)
      self%paths(r)%path = paths(r)%path
    end do
  end subroutine open_merger

  !> Close the files.
  subroutine close_merger(self)
    class(merger_type), intent(inout) :: self  !! open or not; not open on return
    integer :: f

    do f = 1, self%used
      call self%files(f)%close()
    end do
    self%used = 0
  end subroutine close_merger

  !> Find the rows of the files that are needed here. The rows of slots come first: by them files
  !> are chosen.
  subroutine name_rows(self, rows, keys, own)
    class(merger_type), intent(inout) :: self  !! open; its `error` is set if a row is in no file
    character(*), intent(in) :: rows           !! name of the rows
    integer(i8), intent(in) :: keys(:)         !! (rows) as for any archive
    logical, intent(in) :: own(:)              !! (rows) not used: copies come from files, too
    integer(i8), allocatable :: sorted(:)
    integer, allocatable :: order(:)
    logical :: found(size(keys))

    associate (unused => own)
    end associate
    if (allocated(self%error)) return
    call self%over(same)
    order = ascending_order(abs(keys))
    sorted = abs(keys(order))
    found = .false.
    if (rows == of_slots) then
      call choose_files(self, sorted, order, found)
    else
      call read_maps(self, rows, sorted, order, found)
    end if
    if (allocated(self%error)) return
    if (any(keys > 0_i8 .and. .not. found)) call fail(self%error, 'the checkpoints of '// &
      & to_text(size(self%paths))//' ranks do not hold all points of '//rows)
  end subroutine name_rows

  !> Open the files one after another, and keep those open that have points of this rank.
  subroutine choose_files(self, sorted, order, found)
    type(merger_type), intent(inout) :: self
    integer(i8), intent(in) :: sorted(:)
    integer, intent(in) :: order(:)
    logical, intent(inout) :: found(:)
    integer :: r, f

    associate (rows => self%named(the_slots))
      rows%name = of_slots
      rows%rows = size(order, kind=i8)
      allocate (rows%of_file(size(self%paths)))
      do r = 1, size(self%paths)
        f = self%used + 1
        call self%files(f)%open(self%paths(r)%path, self%error, verified=.true.)
        if (allocated(self%error)) return
        self%used = f
        call self%files(f)%find('points of '//of_slots)
        call read_map(self%files(f), of_slots, sorted, order, rows%of_file(f), found)
        call take_errors(self)
        if (allocated(self%error)) return
        ! the first rank's file has what all ranks have alike
        if (r == 1 .or. size(rows%of_file(f)%from) > 0) cycle
        call self%files(f)%close()
        self%used = f - 1
      end do
    end associate
  end subroutine choose_files

  !> Rows of another name, of the files that are open.
  subroutine read_maps(self, name, sorted, order, found)
    type(merger_type), intent(inout) :: self
    character(*), intent(in) :: name
    integer(i8), intent(in) :: sorted(:)
    integer, intent(in) :: order(:)
    logical, intent(inout) :: found(:)
    integer :: f

    associate (rows => self%named(the_last))
      rows%name = name
      rows%rows = size(order, kind=i8)
      if (allocated(rows%of_file)) deallocate (rows%of_file)
      allocate (rows%of_file(self%used))
      do f = 1, self%used
        call read_map(self%files(f), name, sorted, order, rows%of_file(f), found)
      end do
    end associate
    call take_errors(self)
  end subroutine read_maps

  !> Read the keys of a file, and find those that are here.
  subroutine read_map(file, name, sorted, order, map, found)
    type(reader_type), intent(inout) :: file
    character(*), intent(in) :: name
    integer(i8), intent(in) :: sorted(:)  !! keys here, ascending
    integer, intent(in) :: order(:)       !! the row of each
    type(map_type), intent(out) :: map
    logical, intent(inout) :: found(:)
    integer(i8), allocatable :: table(:, :)
    integer :: i, n, place

    call file%keep('points of '//name, table)
    if (allocated(file%error) .or. .not. allocated(table)) allocate (table(0, 1))
    map%rows = size(table, 1, kind=i8)
    allocate (map%from(size(table, 1)), map%to(size(table, 1)))
    n = 0
    do i = 1, size(table, 1)
      if (table(i, 1) == 0_i8) cycle
      place = place_in(sorted, abs(table(i, 1)))
      if (place == 0) cycle
      n = n + 1
      map%from(n) = i
      map%to(n) = order(place)
      found(order(place)) = .true.
    end do
    map%from = map%from(:n)
    map%to = map%to(:n)
  end subroutine read_map

  !> The first error of the files becomes that of the archive.
  subroutine take_errors(self)
    type(merger_type), intent(inout) :: self
    integer :: f

    do f = 1, self%used
      if (allocated(self%error)) return
      if (allocated(self%files(f)%error)) self%error = self%files(f)%error
    end do
  end subroutine take_errors

  !> Which of the named rows the value in hand has; 0: none.
  integer function rows_in_hand(self) result(which)
    type(merger_type), intent(in) :: self

    which = 0
    if (self%rows == same .or. self%rows == joined) return
    which = merge(the_slots, the_last, self%rows == of_slots)
    if (self%rows /= self%named(which)%name) &
      & call internal_fault('the rows '//self%rows//' have not been named')
  end function rows_in_hand

  !> Begin a value: its extents here, from those in the files.
  subroutine describe(self, name, kind_name, extents)
    class(merger_type), intent(inout) :: self  !! open; its `error` is set if the files do not agree
                                               !! with each other or with what is asked for
    character(*), intent(in) :: name           !! of the value
    character(*), intent(in) :: kind_name      !! kind of its elements
    integer(i8), intent(inout) :: extents(:)   !! (rank) those here on return; -1: not allocated
    integer(i8) :: of_file(size(extents))
    integer :: f, which

    if (self%used == 0) call internal_fault('the rows of slots have not been named')
    self%element = bytes_of_kind(kind_name)
    if (allocated(self%extents)) deallocate (self%extents)
    allocate (self%extents(most_extents, self%used), source=1_i8)
    do f = 1, self%used
      if (self%rows == joined) call self%files(f)%find(name)
      if (.not. allocated(self%files(f)%error)) &
        & call self%files(f)%describe(name, kind_name, of_file)
      if (allocated(self%files(f)%error)) exit
      self%extents(:size(extents), f) = of_file
    end do
    call take_errors(self)
    if (allocated(self%error)) return
    extents = self%extents(:size(extents), 1)
    which = rows_in_hand(self)
    if (which > 0) then
      call take_extents(self, self%named(which), name, extents)
      if (allocated(self%error)) return
      ! nothing is moved of a value without elements
      if (extents(1) == 0_i8) call skip_all(self, 1)
    else if (self%rows == joined) then
      extents(1) = sum(self%extents(1, :))
      if (size(extents) > 1) then
        if (any(self%extents(2, :) /= 1_i8)) call fail(self%error, name//' has several columns')
      end if
    else
      call skip_all(self, 2)
    end if
    call take_errors(self)
  end subroutine describe

  !> The extents of an array with rows: as many rows as there are here, unless all files have none.
  subroutine take_extents(self, rows, name, extents)
    type(merger_type), intent(inout) :: self
    type(rows_type), intent(in) :: rows
    character(*), intent(in) :: name
    integer(i8), intent(inout) :: extents(:)  !! those of the first file
    integer :: n

    n = size(extents)
    if (all(self%extents(:n, :) < 0_i8)) return  ! not allocated anywhere
    if (all(self%extents(1, :) == rows%of_file(:self%used)%rows)) then
      extents(1) = rows%rows
    else if (any(self%extents(1, :) /= 0_i8)) then
      call fail(self%error, name//' has other rows than '//rows%name//' in the checkpoints')
      return
    end if
    if (any(self%extents(2:n, :) /= spread(extents(2:n), 2, self%used))) &
      & call fail(self%error, name//' has different extents in the checkpoints')
  end subroutine take_extents

  !> Bytes that a file has of the value in hand.
  pure integer(i8) function bytes_in(self, f) result(bytes)
    type(merger_type), intent(in) :: self
    integer, intent(in) :: f
    bytes = 0_i8
    if (all(self%extents(:, f) > 0_i8)) bytes = self%element*product(self%extents(:, f))
  end function bytes_in

  !> Pass over the value in hand in the files from the `first` one on.
  subroutine skip_all(self, first)
    type(merger_type), intent(inout) :: self
    integer, intent(in) :: first
    integer :: f

    do f = first, self%used
      call self%files(f)%skip(bytes_in(self, f))
    end do
  end subroutine skip_all

  !> Put the elements of the value in hand together.
  subroutine move(self, place, bytes)
    class(merger_type), intent(inout) :: self  !! with a value described; its `error` is set if it
                                               !! cannot be read
    type(c_ptr), intent(in) :: place           !! address of the value's first byte
    integer(i8), intent(in) :: bytes           !! length of the value here [bytes]
    integer(i1), pointer, contiguous :: here(:), part(:)
    integer(i1), allocatable, target :: there(:)
    integer(i8) :: at
    integer :: f, which

    if (allocated(self%error)) return
    call c_f_pointer(place, here, [bytes])
    which = rows_in_hand(self)
    if (which > 0) then
      here = 0_i1
      associate (rows => self%named(which))
        do f = 1, self%used
          if (size(rows%of_file(f)%from) == 0) then
            call self%files(f)%skip(bytes_in(self, f))
          else if (bytes_in(self, f) > 0_i8) then
            allocate (there(bytes_in(self, f)))
            call self%files(f)%move(c_loc(there), size(there, kind=i8))
            call put_rows(rows%of_file(f), self%element, rows%rows, there, here)
            deallocate (there)
          end if
        end do
      end associate
    else if (self%rows == joined) then
      at = 0_i8
      do f = 1, self%used
        if (bytes_in(self, f) == 0_i8) cycle
        part => here(at + 1:at + bytes_in(self, f))
        call self%files(f)%move(c_loc(part), bytes_in(self, f))
        at = at + bytes_in(self, f)
      end do
    else
      call self%files(1)%move(place, bytes)
    end if
    call take_errors(self)
  end subroutine move

  !> The rows of one file to their places, column by column.
  pure subroutine put_rows(map, element, rows, there, here)
    type(map_type), intent(in) :: map
    integer(i8), intent(in) :: element, rows   !! bytes of an element, rows here
    integer(i1), intent(in) :: there(:)
    integer(i1), intent(inout) :: here(:)
    integer(i8) :: c, from, to
    integer :: i

    do c = 0_i8, size(here, kind=i8)/(element*rows) - 1_i8
      do i = 1, size(map%from)
        from = element*(c*map%rows + map%from(i) - 1)
        to = element*(c*rows + map%to(i) - 1)
        here(to + 1:to + element) = there(from + 1:from + element)
      end do
    end do
  end subroutine put_rows

end module pd_output_checkpoint_merger
