!> Interface by which a part of the program stores the data that a restart needs, independent of
!> files: the same list of calls is used for writing, reading and measuring.
!>
!>     call archive%keep('displacement', state%u)
!>     call archive%keep('broken bonds', broken)
!>
!> When it writes, an archive takes the values; when it reads, it puts them back, in the same order.
!> An array that is allocated gets back values of its own shape only; one that is not takes that of
!> the archive. The first failure stays in `error`, and the calls after it do nothing.
!>
!> What one rank has written, other ranks of another number may read. So arrays whose rows belong to
!> points say to which:
!>
!>     call archive%name_rows(of_slots, numbers, own)
!>     call archive%over(of_slots)
!>     call archive%keep('displacement', state%u)
!>     call archive%over(same)                        ! values that all ranks have alike
!>
!> An archive in memory, which nobody else reads, takes no note of that.
module pd_base_archive
  use, intrinsic :: iso_c_binding, only: c_loc, c_ptr
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_text, only: to_text
  implicit none (type, external)
  private
  public :: archive_type, same, joined, of_slots

  character(*), parameter :: same = ''          !! values that all ranks have alike
  character(*), parameter :: joined = 'joined'  !! tables whose rows belong to all ranks together
  character(*), parameter :: of_slots = 'slots' !! arrays with a row for each slot

  integer(i8), parameter :: absent = -1_i8  !! first extent of an array that is not allocated

  type, abstract :: archive_type
    logical :: reading = .false.
    logical :: in_memory = .false.      !! of this process alone: rows have no names
    logical :: merges = .false.         !! reads what ranks of another number have written
    character(:), allocatable :: rows   !! what rows of the values to come belong to; `same`,
                                        !! `joined` or a name; not allocated: `same`
    type(error_type), allocatable :: error
  contains
    procedure :: name_rows
    procedure :: over
    procedure(describe_interface), deferred :: describe
    procedure(move_interface), deferred :: move
    procedure, private :: keep_real, keep_integer, keep_long, keep_logical, keep_text
    procedure, private :: keep_reals, keep_real_table, keep_real_block
    procedure, private :: keep_flags, keep_long_table
    !> Write or read back one value.
    generic :: keep => keep_real, keep_integer, keep_long, keep_logical, keep_text, keep_reals, &
      & keep_real_table, keep_real_block, keep_flags, keep_long_table
  end type archive_type

  abstract interface
    !> Begin a value: its name, the kind of its elements (`real8`, `integer1`, ...) and its extents.
    !> When reading, name and kind must agree, and the extents are those of the archive.
    subroutine describe_interface(self, name, kind_name, extents)
      import :: archive_type, i8
      implicit none (type, external)
      class(archive_type), intent(inout) :: self  !! the archive; its `error` is set if name, kind
                                                  !! or rank differ from those kept
      character(*), intent(in) :: name            !! what the archive calls the value
      character(*), intent(in) :: kind_name       !! kind of its elements: `real8`, `integer1`,
                                                  !! `integer8`
      integer(i8), intent(inout) :: extents(:)    !! (rank) of the value; in reading those of the
                                                  !! archive on return; -1: not allocated
    end subroutine describe_interface

    !> Take `bytes` bytes from `place`, or put them there.
    subroutine move_interface(self, place, bytes)
      import :: archive_type, c_ptr, i8
      implicit none (type, external)
      class(archive_type), intent(inout) :: self  !! the archive; its `error` is set if the bytes
                                                  !! cannot be moved
      type(c_ptr), intent(in) :: place            !! address of the value's first byte
      integer(i8), intent(in) :: bytes            !! length of the value [bytes]
    end subroutine move_interface
  end interface

contains

  !> Say which points the rows of some arrays belong to. A file keeps the keys, and gives back what
  !> was written with the same ones.
  subroutine name_rows(self, rows, keys, own)
    class(archive_type), intent(inout) :: self  !! the archive; its `error` is set if the keys
                                                !! cannot be kept, or in reading are others
    character(*), intent(in) :: rows     !! name of the rows for `over`, at most 40 characters
    integer(i8), intent(in) :: keys(:)
      !! (rows) above 0, different ones; 0: a row without a meaning; below 0: the key -`keys`, of
      !! which files of other ranks need not know: the values of the row are then 0
    logical, intent(in) :: own(:)
      !! (rows) whether the values here count: over all ranks each key has one such row
    integer(i8), allocatable :: table(:, :)

    if (self%in_memory .or. allocated(self%error)) return
    call self%over(same)
    allocate (table(size(keys), 1))
    table(:, 1) = merge(keys, 0_i8, own)
    call self%keep('points of '//rows, table)
    if (allocated(self%error) .or. .not. self%reading) return
    if (any(table(:, 1) /= merge(keys, 0_i8, own))) &
      & call fail(self%error, 'the points of '//rows//' are others')
  end subroutine name_rows

  !> What the rows of the values to come belong to.
  subroutine over(self, rows)
    class(archive_type), intent(inout) :: self  !! the archive
    character(*), intent(in) :: rows  !! `same`, `joined`, or a name that `name_rows` has given
    self%rows = rows
  end subroutine over

  !> Describe a value and say whether its bytes are to be moved. `there` says whether the value is
  !> allocated; on return whether it is to be.
  subroutine begin(self, name, kind_name, extents, there, moves)
    class(archive_type), intent(inout) :: self
    character(*), intent(in) :: name, kind_name
    integer(i8), intent(inout) :: extents(:)
    logical, intent(inout) :: there
    logical, intent(out) :: moves
    integer(i8) :: mine(size(extents))

    moves = .false.
    if (allocated(self%error)) return
    if (.not. there) extents = absent
    mine = extents
    call self%describe(name, kind_name, extents)
    if (allocated(self%error)) return
    if (there .and. any(extents /= mine)) then
      call fail(self%error, name//' has the extents '//listed(extents)//' there and '// &
        & listed(mine)//' here')
      return
    end if
    there = all(extents >= 0)
    moves = there .and. all(extents > 0)
  end subroutine begin

  pure function listed(extents) result(text)
    integer(i8), intent(in) :: extents(:)
    character(:), allocatable :: text
    integer :: i

    text = to_text(extents(1))
    do i = 2, size(extents)
      text = text//' x '//to_text(extents(i))
    end do
  end function listed

  !> A real number.
  subroutine keep_real(self, name, value)
    class(archive_type), intent(inout) :: self  !! the archive; its `error` is set if the value
                                                !! cannot be kept
    character(*), intent(in) :: name            !! what the archive calls the value
    real(wp), intent(inout) :: value            !! taken in writing, set in reading
    real(wp), allocatable :: one(:)
    allocate (one(1), source=value)
    call self%keep(name, one)
    if (.not. allocated(self%error)) value = one(1)
  end subroutine keep_real

  !> A long integer.
  subroutine keep_long(self, name, value)
    class(archive_type), intent(inout) :: self  !! the archive; its `error` is set if the value
                                                !! cannot be kept
    character(*), intent(in) :: name            !! what the archive calls the value
    integer(i8), intent(inout) :: value         !! taken in writing, set in reading
    integer(i8), allocatable :: one(:, :)
    allocate (one(1, 1), source=value)
    call self%keep(name, one)
    if (.not. allocated(self%error)) value = one(1, 1)
  end subroutine keep_long

  !> An integer, kept as a long one.
  subroutine keep_integer(self, name, value)
    class(archive_type), intent(inout) :: self  !! the archive; its `error` is set if the value
                                                !! cannot be kept
    character(*), intent(in) :: name            !! what the archive calls the value
    integer, intent(inout) :: value             !! taken in writing, set in reading
    integer(i8) :: long
    long = value
    call self%keep(name, long)
    if (.not. allocated(self%error)) value = int(long)
  end subroutine keep_integer

  !> A logical, kept as 1 or 0.
  subroutine keep_logical(self, name, value)
    class(archive_type), intent(inout) :: self  !! the archive; its `error` is set if the value
                                                !! cannot be kept
    character(*), intent(in) :: name            !! what the archive calls the value
    logical, intent(inout) :: value             !! taken in writing, set in reading
    integer(i8) :: long
    long = merge(1_i8, 0_i8, value)
    call self%keep(name, long)
    if (.not. allocated(self%error)) value = long == 1_i8
  end subroutine keep_logical

  !> A text; its length may change in reading.
  subroutine keep_text(self, name, value)
    class(archive_type), intent(inout) :: self  !! the archive; its `error` is set if the value
                                                !! cannot be kept
    character(*), intent(in) :: name            !! what the archive calls the value
    character(:), allocatable, intent(inout) :: value  !! any length; taken in writing, set in
                                                       !! reading
    integer(i1), allocatable :: codes(:)
    integer :: i

    if (.not. self%reading) then
      allocate (codes(len(value)))
      do i = 1, len(value)
        codes(i) = transfer(value(i:i), codes(i))
      end do
    end if
    call self%keep(name, codes)
    if (allocated(self%error) .or. .not. self%reading) return
    value = repeat(' ', size(codes))
    do i = 1, size(codes)
      value(i:i) = transfer(codes(i), value(i:i))
    end do
  end subroutine keep_text

  !> A vector of real numbers; one that is not allocated is kept as such.
  subroutine keep_reals(self, name, value)
    class(archive_type), intent(inout) :: self  !! the archive; its `error` is set if the value
                                                !! cannot be kept
    character(*), intent(in) :: name            !! what the archive calls the value
    real(wp), allocatable, target, intent(inout) :: value(:)
      !! (any length); taken in writing, set in reading and allocated if it is not
    integer(i8) :: extents(1)
    logical :: there, moves

    there = allocated(value)
    if (there) extents = shape(value, i8)
    call begin(self, name, 'real8', extents, there, moves)
    if (allocated(self%error)) return
    if (there .and. .not. allocated(value)) allocate (value(extents(1)))
    if (moves) call self%move(c_loc(value), 8_i8*product(extents))
  end subroutine keep_reals

  !> A table of real numbers; one that is not allocated is kept as such.
  subroutine keep_real_table(self, name, value)
    class(archive_type), intent(inout) :: self  !! the archive; its `error` is set if the value
                                                !! cannot be kept
    character(*), intent(in) :: name            !! what the archive calls the value
    real(wp), allocatable, target, intent(inout) :: value(:, :)
      !! (any shape); taken in writing, set in reading and allocated if it is not
    integer(i8) :: extents(2)
    logical :: there, moves

    there = allocated(value)
    if (there) extents = shape(value, i8)
    call begin(self, name, 'real8', extents, there, moves)
    if (allocated(self%error)) return
    if (there .and. .not. allocated(value)) allocate (value(extents(1), extents(2)))
    if (moves) call self%move(c_loc(value), 8_i8*product(extents))
  end subroutine keep_real_table

  !> Real numbers of rank 3; an array that is not allocated is kept as such.
  subroutine keep_real_block(self, name, value)
    class(archive_type), intent(inout) :: self  !! the archive; its `error` is set if the value
                                                !! cannot be kept
    character(*), intent(in) :: name            !! what the archive calls the value
    real(wp), allocatable, target, intent(inout) :: value(:, :, :)
      !! (any shape); taken in writing, set in reading and allocated if it is not
    integer(i8) :: extents(3)
    logical :: there, moves

    there = allocated(value)
    if (there) extents = shape(value, i8)
    call begin(self, name, 'real8', extents, there, moves)
    if (allocated(self%error)) return
    if (there .and. .not. allocated(value)) allocate (value(extents(1), extents(2), extents(3)))
    if (moves) call self%move(c_loc(value), 8_i8*product(extents))
  end subroutine keep_real_block

  !> A vector of integers of one byte; one that is not allocated is kept as such.
  subroutine keep_flags(self, name, value)
    class(archive_type), intent(inout) :: self  !! the archive; its `error` is set if the value
                                                !! cannot be kept
    character(*), intent(in) :: name            !! what the archive calls the value
    integer(i1), allocatable, target, intent(inout) :: value(:)
      !! (any length); taken in writing, set in reading and allocated if it is not
    integer(i8) :: extents(1)
    logical :: there, moves

    there = allocated(value)
    if (there) extents = shape(value, i8)
    call begin(self, name, 'integer1', extents, there, moves)
    if (allocated(self%error)) return
    if (there .and. .not. allocated(value)) allocate (value(extents(1)))
    if (moves) call self%move(c_loc(value), product(extents))
  end subroutine keep_flags

  !> A table of long integers; one that is not allocated is kept as such.
  subroutine keep_long_table(self, name, value)
    class(archive_type), intent(inout) :: self  !! the archive; its `error` is set if the value
                                                !! cannot be kept
    character(*), intent(in) :: name            !! what the archive calls the value
    integer(i8), allocatable, target, intent(inout) :: value(:, :)
      !! (any shape); taken in writing, set in reading and allocated if it is not
    integer(i8) :: extents(2)
    logical :: there, moves

    there = allocated(value)
    if (there) extents = shape(value, i8)
    call begin(self, name, 'integer8', extents, there, moves)
    if (allocated(self%error)) return
    if (there .and. .not. allocated(value)) allocate (value(extents(1), extents(2)))
    if (moves) call self%move(c_loc(value), 8_i8*product(extents))
  end subroutine keep_long_table

end module pd_base_archive
