!> Tests of `pd_base_long_work`: what a user is told during long work before the first step.
module test_base_long_work
  use pd_base_long_work, only: long_work_type
  use testdrive, only: new_unittest, unittest_type, error_type, check
  implicit none (type, external)
  private
  public :: collect_base_long_work

contains

  subroutine collect_base_long_work(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('nothing is told at first, or not begun, or quiet', test_silence), &
      & new_unittest('a line is rewritten and erased, or stands in a log', test_lines)]
  end subroutine collect_base_long_work

  subroutine test_silence(error)
    type(error_type), allocatable, intent(out) :: error
    type(long_work_type) :: work
    integer :: unit

    call check(error, .not. work%is_due(), 'due before it begins')
    if (allocated(error)) return
    open (newunit=unit, status='scratch', action='readwrite')
    call work%begin(.true., unit, .true.)
    call work%tell('something')
    call check(error, .not. work%is_due(), 'due although quiet')
    if (.not. allocated(error)) call check(error, size_of(unit) == 0, 'quiet, and tells')
    if (allocated(error)) return
    call work%begin(.false., unit, .true.)
    call check(error, .not. work%is_due(), 'due at once')
    close (unit)
  end subroutine test_silence

  subroutine test_lines(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: back = achar(13), clear = achar(27)//'[K'
    character(:), allocatable :: text

    text = told(.false., 'iteration 7')
    call check(error, index(text, 'weights  iteration 7  for ') == 1 &
      & .and. index(text, new_line('a')) == len(text), 'the line of a log: '//text)
    if (allocated(error)) return
    ! 79 characters of the line stand between what moves the cursor
    text = told(.true., repeat('x', 300))
    call check(error, len(text) == 79 + 2*len(back//clear), 'a rewritten line wraps: '//text)
    if (allocated(error)) return
    call check(error, text(1:9) == back//'weights ' &
      & .and. text(81:) == clear//back//clear, 'the line is not erased: '//text)
  end subroutine test_lines

  !> What is written when work at weights is told about once, and ends.
  function told(terminal, what) result(text)
    logical, intent(in) :: terminal
    character(*), intent(in) :: what
    character(:), allocatable :: text
    character(*), parameter :: file = 'build/test_base_long_work.txt'
    type(long_work_type) :: work
    integer :: unit, length

    open (newunit=unit, file=file, status='replace', action='write')
    call work%begin(.false., unit, terminal)
    call work%turn_to('weights')
    call work%tell(what)
    call work%finish()
    ! no line end of the last record, which closing would write
    length = size_of(unit)
    allocate (character(length) :: text)
    close (unit)
    ! byte by byte, since a carriage return ends a record when it is read formatted
    open (newunit=unit, file=file, status='old', action='read', access='stream', form='unformatted')
    if (len(text) > 0) read (unit) text
    close (unit, status='delete')
  end function told

  !> Bytes that were written to a file.
  integer function size_of(unit)
    integer, intent(in) :: unit
    flush (unit)
    inquire (unit=unit, size=size_of)
  end function size_of

end module test_base_long_work
