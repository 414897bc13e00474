!> The file of a checkpoint: values one after another, each with its name, kind and extents, between
!> a head that says what the file is and how long, and a checksum of every byte before it.
!>
!> Nothing in a file is believed before its length and its checksum are right.
module pd_output_checkpoint_file
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc, c_ptr
  use pd_base_archive, only: archive_type
  use pd_base_checksum, only: checksum_type
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_text, only: newline, to_text
  use pd_output_results_files, only: file_bytes, file_exists
  use pd_output_results_sink, only: sink_type
  implicit none (type, external)
  private
  public :: meter_type, writer_type, reader_type, bytes_of_kind

  character(*), parameter :: magic = 'perifort checkpoint'//newline
  integer(i8), parameter :: order = 72623859790382856_i8  !! bytes 8, 7, .. 1, low ones first
  integer(i8), parameter :: format_version = 3_i8
  integer(i8), parameter :: head_bytes = len(magic) + 3*8, tail_bytes = 8
  integer(i8), parameter :: block_bytes = 1048576_i8
  integer, parameter :: longest_name = 64

  !> Measures the size of a file.
  type, extends(archive_type) :: meter_type
    integer(i8) :: bytes = head_bytes + tail_bytes  !! of the whole file
  contains
    procedure :: describe => measure_description
    procedure :: move => measure_bytes
  end type meter_type

  !> Writes a file.
  type, extends(archive_type) :: writer_type
    private
    type(sink_type) :: sink
    type(checksum_type) :: checksum
  contains
    procedure :: create
    procedure :: finish
    procedure :: describe => write_description
    procedure :: move => write_bytes
  end type writer_type

  !> Reads a file.
  type, extends(archive_type) :: reader_type
    private
    character(:), allocatable :: path
    integer :: unit = -1
    integer(i8) :: left = 0_i8    !! bytes of values that are still to come
  contains
    procedure :: open => open_reader
    procedure :: close => close_reader
    procedure :: find
    procedure :: skip
    procedure :: describe => read_description
    procedure :: move => read_bytes
  end type reader_type

contains

  !> Add the size of name, kind and extents of a value in a file.
  subroutine measure_description(self, name, kind_name, extents)
    class(meter_type), intent(inout) :: self  !! has the size of the head of this value more on
                                              !! return
    character(*), intent(in) :: name          !! of the value
    character(*), intent(in) :: kind_name     !! kind of its elements
    integer(i8), intent(inout) :: extents(:)  !! (rank) of the value; unchanged
    self%bytes = self%bytes + len(description(name, kind_name)) + 8_i8*(1 + size(extents))
  end subroutine measure_description

  !> Add the size of the elements of a value in a file.
  subroutine measure_bytes(self, place, bytes)
    class(meter_type), intent(inout) :: self  !! has these bytes more on return
    type(c_ptr), intent(in) :: place          !! not used
    integer(i8), intent(in) :: bytes          !! length of the value [bytes]
    ! the place is that of a value, and has nothing to be measured
    associate (unused => place)
    end associate
    self%bytes = self%bytes + bytes
  end subroutine measure_bytes

  !> Begin a file of so many bytes, as a meter has found them.
  subroutine create(self, path, bytes)
    class(writer_type), intent(out) :: self  !! open on return; its `error` is set if the file
                                             !! cannot be made
    character(*), intent(in) :: path         !! of the file; one that is there is replaced
    integer(i8), intent(in) :: bytes         !! length of the whole file [bytes]

    call self%sink%open(path, self%error)
    call write_text(self, magic)
    call write_numbers(self, [order, format_version, bytes])
  end subroutine create

  !> Complete the file: when this returns without an error, it is on the disk. The error is the
  !> first one since `create`.
  subroutine finish(self, error)
    class(writer_type), intent(inout) :: self  !! with all values written; not open on return
    type(error_type), allocatable, intent(out) :: error
    type(error_type), allocatable :: late

    call write_numbers(self, [self%checksum%value()])
    if (.not. allocated(self%error)) call self%sink%sync(self%error)
    call self%sink%close(late)
    if (allocated(self%error)) then
      call move_alloc(self%error, error)
    else
      call move_alloc(late, error)
    end if
  end subroutine finish

  !> Name and kind of a value as they stand in the file, in lines of fixed length.
  pure function description(name, kind_name) result(text)
    character(*), intent(in) :: name, kind_name
    character(longest_name) :: text
    text = name//': '//kind_name
    text(longest_name:) = newline
  end function description

  !> Write name, kind, rank and extents of a value.
  subroutine write_description(self, name, kind_name, extents)
    class(writer_type), intent(inout) :: self  !! open; its `error` is set if the file cannot be
                                               !! written
    character(*), intent(in) :: name           !! of the value; with its kind at most 61 characters
    character(*), intent(in) :: kind_name      !! kind of its elements
    integer(i8), intent(inout) :: extents(:)   !! (rank) of the value; unchanged

    call write_text(self, description(name, kind_name))
    call write_numbers(self, [size(extents, kind=i8), extents])
  end subroutine write_description

  subroutine write_text(self, text)
    class(writer_type), intent(inout) :: self
    character(*), target, intent(in) :: text
    call self%move(c_loc(text), len(text, kind=i8))
  end subroutine write_text

  subroutine write_numbers(self, numbers)
    class(writer_type), intent(inout) :: self
    integer(i8), target, intent(in) :: numbers(:)
    call self%move(c_loc(numbers), 8_i8*size(numbers))
  end subroutine write_numbers

  !> Write the elements of a value, and add them to the checksum.
  subroutine write_bytes(self, place, bytes)
    class(writer_type), intent(inout) :: self  !! open; its `error` is set if the file cannot be
                                               !! written
    type(c_ptr), intent(in) :: place           !! address of the value's first byte
    integer(i8), intent(in) :: bytes           !! length of the value [bytes]
    integer(i1), pointer, contiguous :: values(:)

    if (allocated(self%error)) return
    call c_f_pointer(place, values, [bytes])
    call self%checksum%add(values)
    call self%sink%put_bytes(place, bytes, self%error)
  end subroutine write_bytes

  !> Open a file and make sure of it: after that, its values can be read one by one. An error says
  !> what is wrong with it: no such file, no checkpoint, of another version, damaged.
  subroutine open_reader(self, path, error, verified)
    class(reader_type), intent(out) :: self  !! at the first value on return; not open after an
                                             !! error
    character(*), intent(in) :: path         !! of the checkpoint
    type(error_type), allocatable, intent(out) :: error
    logical, intent(in), optional :: verified
      !! its checksum has been found right already, by this or another rank; absent: it has not
    character(512) :: reason
    logical :: sound
    integer :: status

    self%reading = .true.
    self%path = path
    if (.not. file_exists(path)) then
      call fail(error, 'there is no checkpoint '//path)
      return
    end if
    reason = ''
    open (newunit=self%unit, file=path, access='stream', form='unformatted', action='read', &
      & status='old', iostat=status, iomsg=reason)
    if (status /= 0) then
      call fail(error, 'cannot read the checkpoint '//path//': '//trim(reason))
      self%unit = -1
      return
    end if
    sound = .false.
    if (present(verified)) sound = verified
    call check_file(self, sound, error)
    if (allocated(error)) call self%close()
  end subroutine open_reader

  !> Head, length and, unless it is known to be `sound`, checksum; afterwards the file stands at its
  !> first value.
  subroutine check_file(self, sound, error)
    class(reader_type), intent(inout) :: self
    logical, intent(in) :: sound
    type(error_type), allocatable, intent(out) :: error
    character(len(magic)) :: begins
    integer(i8) :: numbers(3), bytes, at, checksum
    integer(i1), allocatable :: block(:)
    type(checksum_type) :: found
    integer :: status

    bytes = file_bytes(self%path)
    if (bytes < head_bytes + tail_bytes) then
      call fail(error, damaged(self%path, 'it ends after '//to_text(bytes)//' bytes'))
      return
    end if
    read (self%unit, iostat=status) begins, numbers
    if (status /= 0) then
      call fail(error, 'cannot read the checkpoint '//self%path)
    else if (begins /= magic) then
      call fail(error, self%path//' is no checkpoint')
    else if (numbers(1) /= order) then
      call fail(error, self%path//' was written on a machine with another order of bytes')
    else if (numbers(2) /= format_version) then
      call fail(error, self%path//' has the format '//to_text(numbers(2))// &
        & ', and this perifort reads '//to_text(format_version))
    else if (numbers(3) /= bytes) then
      call fail(error, damaged(self%path, 'it has '//to_text(bytes)//' bytes instead of '// &
        & to_text(numbers(3))))
    end if
    if (allocated(error)) return
    self%left = bytes - head_bytes - tail_bytes
    if (sound) return

    allocate (block(block_bytes))
    at = 0
    do while (at < bytes - tail_bytes)
      associate (part => block(:min(block_bytes, bytes - tail_bytes - at)))
        read (self%unit, pos=at + 1, iostat=status) part
        if (status /= 0) exit
        call found%add(part)
        at = at + size(part)
      end associate
    end do
    if (status == 0) read (self%unit, pos=bytes - tail_bytes + 1, iostat=status) checksum
    if (status /= 0) then
      call fail(error, damaged(self%path, 'it cannot be read to its end'))
    else if (checksum /= found%value()) then
      call fail(error, damaged(self%path, 'its checksum is wrong'))
    end if
    if (allocated(error)) return
    read (self%unit, pos=1) begins, numbers
  end subroutine check_file

  pure function damaged(path, why) result(text)
    character(*), intent(in) :: path, why
    character(:), allocatable :: text
    text = 'the checkpoint '//path//' is damaged: '//why
  end function damaged

  !> Read name, kind, rank and extents of a value, and check them.
  subroutine read_description(self, name, kind_name, extents)
    class(reader_type), intent(inout) :: self  !! at the value; its `error` is set if another one
                                               !! stands there or the file is too short
    character(*), intent(in) :: name           !! of the value; it must be that in the file
    character(*), intent(in) :: kind_name      !! kind of its elements; it must be that in the file
    integer(i8), intent(inout) :: extents(:)   !! (rank) those in the file on return; negative: not
                                               !! allocated
    character(longest_name) :: found
    integer(i8) :: rank, bytes
    integer :: status, i

    found = ''
    read (self%unit, iostat=status) found, rank
    self%left = self%left - longest_name - 8
    if (status /= 0 .or. found /= description(name, kind_name) .or. rank /= size(extents)) then
      call fail(self%error, 'the checkpoint '//self%path//' holds '''// &
        & trim(found(:longest_name - 1))//''' where this perifort expects '''//name//'''')
      return
    end if
    read (self%unit, iostat=status) extents
    if (status /= 0) then
      call fail(self%error, 'the checkpoint '//self%path//' ends within '//name)
      return
    end if
    self%left = self%left - 8*rank
    ! a file of unknown origin may request any size
    bytes = bytes_of_kind(kind_name)
    do i = 1, size(extents)
      if (extents(i) <= 0) exit
      if (extents(i) > self%left/bytes) then
        call fail(self%error, 'the checkpoint '//self%path//' ends within '//name)
        return
      end if
      bytes = bytes*extents(i)
    end do
  end subroutine read_description

  !> Read the elements of a value.
  subroutine read_bytes(self, place, bytes)
    class(reader_type), intent(inout) :: self  !! behind the value on return; its `error` is set if
                                               !! it cannot be read
    type(c_ptr), intent(in) :: place           !! address of the value's first byte
    integer(i8), intent(in) :: bytes           !! length of the value [bytes]
    integer(i1), pointer, contiguous :: values(:)
    integer :: status

    if (allocated(self%error)) return
    call c_f_pointer(place, values, [bytes])
    read (self%unit, iostat=status) values
    self%left = self%left - bytes
    if (status /= 0) call fail(self%error, 'the checkpoint '//self%path//' cannot be read')
  end subroutine read_bytes

  !> Bytes of an element of a kind.
  pure integer(i8) function bytes_of_kind(kind_name) result(bytes)
    character(*), intent(in) :: kind_name  !! `real8`, `integer1`, `integer8`
    bytes = 1_i8
    if (kind_name(len(kind_name):) == '8') bytes = 8_i8
  end function bytes_of_kind

  !> Go forward to a value, past those before it.
  subroutine find(self, name)
    class(reader_type), intent(inout) :: self  !! at the value on return; its `error` is set if
                                               !! there is none of this name further on
    character(*), intent(in) :: name           !! of the value
    integer(i8), parameter :: most_extents = 3_i8
    character(longest_name) :: found
    integer(i8) :: rank, at, extents(most_extents)
    integer :: status, colon

    if (allocated(self%error)) return
    do
      inquire (unit=self%unit, pos=at)
      if (self%left < longest_name + 8) exit
      read (self%unit, iostat=status) found, rank
      if (status /= 0) exit
      colon = index(found, ': ', back=.true.)
      if (colon < 1 .or. rank < 1_i8 .or. rank > most_extents) exit
      if (found(:colon - 1) == name) then
        ! back to where its name stands
        read (self%unit, pos=at, iostat=status)
        if (status /= 0) exit
        return
      end if
      read (self%unit, iostat=status) extents(:rank)
      if (status /= 0) exit
      self%left = self%left - longest_name - 8*(1 + rank)
      if (any(extents(:rank) <= 0_i8)) cycle
      if (any(extents(:rank) > self%left) .or. product(real(extents(:rank), wp)) &
        & > real(self%left, wp)) exit
      call self%skip(bytes_of_kind(trim(found(:longest_name - 1)))*product(extents(:rank)))
      if (allocated(self%error)) return
    end do
    call fail(self%error, 'the checkpoint '//self%path//' does not hold '''//name//'''')
  end subroutine find

  !> Pass over the elements of a value.
  subroutine skip(self, bytes)
    class(reader_type), intent(inout) :: self  !! behind them on return; its `error` is set if the
                                               !! file ends before
    integer(i8), intent(in) :: bytes           !! length of the value [bytes]
    integer(i8) :: at
    integer :: status

    if (allocated(self%error) .or. bytes == 0_i8) return
    status = -1
    if (bytes > 0_i8 .and. bytes <= self%left) then
      inquire (unit=self%unit, pos=at)
      read (self%unit, pos=at + bytes, iostat=status)
      self%left = self%left - bytes
    end if
    if (status /= 0) call fail(self%error, 'the checkpoint '//self%path//' cannot be read')
  end subroutine skip

  !> Close the file.
  subroutine close_reader(self)
    class(reader_type), intent(inout) :: self  !! open or not; not open on return
    if (self%unit /= -1) close (self%unit)
    self%unit = -1
  end subroutine close_reader

end module pd_output_checkpoint_file
