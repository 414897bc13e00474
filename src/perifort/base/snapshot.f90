!> An archive in memory, for a state that may be restored later in the same run.
module pd_base_snapshot
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_ptr
  use pd_base_archive, only: archive_type
  use pd_base_error, only: fail
  use pd_base_kinds, only: i1, i8
  implicit none (type, external)
  private
  public :: snapshot_type

  !> One value that is kept.
  type :: parcel_type
    integer(i8), allocatable :: extents(:)
    integer(i1), allocatable :: bytes(:)
  end type parcel_type

  !> Values in the order of the calls. Call `rewind` before each use and between writing and
  !> reading. Writing again reuses the allocated memory.
  type, extends(archive_type) :: snapshot_type
    private
    type(parcel_type), allocatable :: parcels(:)
    integer :: at = 0                          !! the parcel in hand
  contains
    procedure :: describe
    procedure :: move
    procedure :: rewind => rewind_snapshot
  end type snapshot_type

contains

  !> Go to the start, to read or to write.
  subroutine rewind_snapshot(self, reading)
    class(snapshot_type), intent(inout) :: self  !! the archive, set to its first value and without
                                                 !! an error; values that it keeps stay
    logical, intent(in) :: reading  !! whether values are to be put back; else they are taken

    self%reading = reading
    self%in_memory = .true.
    self%at = 0
    if (allocated(self%error)) deallocate (self%error)
    if (.not. allocated(self%parcels)) allocate (self%parcels(32))
  end subroutine rewind_snapshot

  !> Go to the next value: note its extents, or in reading return them.
  subroutine describe(self, name, kind_name, extents)
    class(snapshot_type), intent(inout) :: self  !! the archive, at the next value on return; its
                                              !! `error` is set if none of this rank is kept
    character(*), intent(in) :: name          !! of the value, for the message; it is not compared
    character(*), intent(in) :: kind_name     !! kind of its elements, for the message; it is not
                                              !! compared
    integer(i8), intent(inout) :: extents(:)  !! (rank) of the value; in reading those that were
                                              !! kept on return
    type(parcel_type), allocatable :: more(:)
    integer :: i

    self%at = self%at + 1
    if (self%reading) then
      if (self%at <= size(self%parcels)) then
        if (allocated(self%parcels(self%at)%extents)) then
          if (size(self%parcels(self%at)%extents) == size(extents)) then
            extents = self%parcels(self%at)%extents
            return
          end if
        end if
      end if
      call fail(self%error, name//' of kind '//kind_name//' was not kept')
      return
    end if
    if (self%at > size(self%parcels)) then
      allocate (more(2*size(self%parcels)))
      do i = 1, size(self%parcels)
        call move_alloc(self%parcels(i)%extents, more(i)%extents)
        call move_alloc(self%parcels(i)%bytes, more(i)%bytes)
      end do
      call move_alloc(more, self%parcels)
    end if
    self%parcels(self%at)%extents = extents
  end subroutine describe

  !> Copy the bytes of the value that was described last, from `place` or back to it.
  subroutine move(self, place, bytes)
    class(snapshot_type), intent(inout) :: self  !! the archive, with the value described
    type(c_ptr), intent(in) :: place          !! address of the value's first byte
    integer(i8), intent(in) :: bytes          !! length of the value [bytes]
    integer(i1), pointer, contiguous :: there(:)

    call c_f_pointer(place, there, [bytes])
    associate (parcel => self%parcels(self%at))
      if (self%reading) then
        there(:) = parcel%bytes
      else
        if (allocated(parcel%bytes)) then
          if (size(parcel%bytes, kind=i8) /= bytes) deallocate (parcel%bytes)
        end if
        if (.not. allocated(parcel%bytes)) allocate (parcel%bytes(bytes))
        parcel%bytes(:) = there
      end if
    end associate
  end subroutine move

end module pd_base_snapshot
