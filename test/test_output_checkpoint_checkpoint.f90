!> Files of checkpoints: what is written comes back, and what is damaged is found.
module test_output_checkpoint_checkpoint
  use pd_base_archive, only: archive_type
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i1, i8
  use pd_output_checkpoint_file, only: meter_type, reader_type, writer_type
  use pd_output_results_files, only: file_bytes, make_directory
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  use bodies, only: expect_true
  implicit none (type, external)
  private
  public :: collect_output_checkpoint_checkpoint

  character(*), parameter :: here = 'build/test_output_checkpoint', &
    & path = here//'/some.checkpoint'

  !> One value of each kind.
  type :: values_type
    real(wp) :: x = 0.0_wp
    integer :: n = 0
    integer(i8) :: long = 0_i8
    logical :: yes = .false.
    character(:), allocatable :: text
    real(wp), allocatable :: line(:), table(:, :), block(:, :, :), absent(:), empty(:)
    integer(i1), allocatable :: flags(:)
    integer(i8), allocatable :: bits(:, :)
  end type values_type

contains

  subroutine collect_output_checkpoint_checkpoint(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('all values are restored', test_round), &
      & new_unittest('the size is known before writing', test_size), &
      & new_unittest('any changed byte is detected', test_damaged), &
      & new_unittest('any truncation is detected', test_cut), &
      & new_unittest('other files are refused', test_others), &
      & new_unittest('data that do not fit are refused', test_misfits)]
  end subroutine collect_output_checkpoint_checkpoint

  subroutine keep_values(archive, values)
    class(archive_type), intent(inout) :: archive
    type(values_type), intent(inout) :: values

    call archive%keep('a real', values%x)
    call archive%keep('an integer', values%n)
    call archive%keep('a long one', values%long)
    call archive%keep('a logical', values%yes)
    call archive%keep('a text', values%text)
    call archive%keep('a line', values%line)
    call archive%keep('a table', values%table)
    call archive%keep('a block', values%block)
    call archive%keep('absent', values%absent)
    call archive%keep('empty', values%empty)
    call archive%keep('flags', values%flags)
    call archive%keep('bits', values%bits)
  end subroutine keep_values

  function sample() result(values)
    type(values_type) :: values
    integer :: i
    values%x = -0.1_wp
    values%n = -7
    values%long = 2_i8**62
    values%yes = .true.
    values%text = 'caf'//char(195)//char(169)//' '
    values%line = [(1.0_wp/i, i=1, 5)]
    values%table = reshape([(sqrt(real(i, wp)), i=1, 6)], [2, 3])
    values%block = reshape([(exp(real(i, wp)), i=1, 8)], [2, 2, 2])
    allocate (values%empty(0))
    values%flags = [1_i1, -1_i1, 0_i1]
    values%bits = reshape([-1_i8, 5_i8], [2, 1])
  end function sample

  !> Write the sample.
  subroutine write_sample(error)
    type(error_type), allocatable, intent(inout) :: error
    type(values_type) :: values
    type(meter_type) :: meter
    type(writer_type) :: writer
    type(fault_type), allocatable :: fault

    call make_directory(here, fault)
    values = sample()
    call keep_values(meter, values)
    call writer%create(path, meter%bytes)
    call keep_values(writer, values)
    call writer%finish(fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine write_sample

  subroutine test_round(error)
    type(error_type), allocatable, intent(out) :: error
    type(values_type) :: values, expected
    type(reader_type) :: reader
    type(fault_type), allocatable :: fault

    call write_sample(error)
    call reader%open(path, fault)
    if (.not. allocated(fault)) call keep_values(reader, values)
    if (allocated(reader%error)) call move_alloc(reader%error, fault)
    call reader%close()
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    expected = sample()
    call expect_true(error, same([values%x], [expected%x]) .and. values%n == -7 .and. &
      & values%long == expected%long .and. values%yes, 'single values')
    call expect_true(error, values%text == expected%text .and. len(values%text) == 6, 'the text')
    call expect_true(error, same(values%line, expected%line) .and. &
      & same([values%table], [expected%table]) .and. all(shape(values%table) == [2, 3]) .and. &
      & same([values%block], [expected%block]), 'arrays of reals')
    call expect_true(error, .not. allocated(values%absent) .and. size(values%empty) == 0, &
      & 'no values')
    call expect_true(error, all(values%flags == expected%flags) .and. &
      & all(values%bits == expected%bits), 'arrays of integers')
  end subroutine test_round

  pure logical function same(a, b)
    real(wp), intent(in) :: a(:), b(:)
    same = size(a) == size(b)
    if (same) same = all(transfer(a, 0_i8, size(a)) == transfer(b, 0_i8, size(b)))
  end function same

  subroutine test_size(error)
    type(error_type), allocatable, intent(out) :: error
    type(values_type) :: values
    type(meter_type) :: meter

    call write_sample(error)
    if (allocated(error)) return
    values = sample()
    call keep_values(meter, values)
    call check(error, meter%bytes == file_bytes(path), 'measured and written sizes differ')
  end subroutine test_size

  !> Each byte in turn, wherever it stands.
  subroutine test_damaged(error)
    type(error_type), allocatable, intent(out) :: error
    type(reader_type) :: reader
    type(fault_type), allocatable :: fault
    integer(i1), allocatable :: bytes(:)
    integer :: i

    call write_sample(error)
    if (allocated(error)) return
    call read_bytes(bytes)
    do i = 1, size(bytes)
      bytes(i) = not(bytes(i))
      call write_bytes(bytes)
      bytes(i) = not(bytes(i))
      call reader%open(path, fault)
      call reader%close()
      call expect_true(error, allocated(fault), 'a changed byte is not found')
      if (allocated(error)) return
    end do
    call write_bytes(bytes)
    call reader%open(path, fault)
    call reader%close()
    call expect_true(error, .not. allocated(fault), 'the whole file is refused')
  end subroutine test_damaged

  subroutine test_cut(error)
    type(error_type), allocatable, intent(out) :: error
    type(reader_type) :: reader
    type(fault_type), allocatable :: fault
    integer(i1), allocatable :: bytes(:)
    integer :: n

    call write_sample(error)
    if (allocated(error)) return
    call read_bytes(bytes)
    do n = 0, size(bytes) + 3
      if (n == size(bytes)) cycle
      call write_bytes([bytes(:min(n, size(bytes))), spread(0_i1, 1, max(0, n - size(bytes)))])
      call reader%open(path, fault)
      call reader%close()
      call expect_true(error, allocated(fault), 'a wrong length is not found')
      if (allocated(error)) return
      call expect_true(error, index(fault%message, 'damaged') > 0, fault%message)
    end do
  end subroutine test_cut

  subroutine test_others(error)
    type(error_type), allocatable, intent(out) :: error
    type(reader_type) :: reader
    type(fault_type), allocatable :: fault

    call reader%open(here//'/none', fault)
    call expect_true(error, allocated(fault), 'a missing file')
    call write_bytes(spread(65_i1, 1, 200))
    call reader%open(path, fault)
    call expect_true(error, allocated(fault), 'a text')
    if (allocated(error)) return
    call expect_true(error, index(fault%message, 'is no checkpoint') > 0, fault%message)
    call reader%open(here, fault)
    call expect_true(error, allocated(fault), 'a folder')
  end subroutine test_others

  !> Another name, another shape, and extents that no file can hold.
  subroutine test_misfits(error)
    type(error_type), allocatable, intent(out) :: error
    type(writer_type) :: writer
    type(meter_type) :: meter
    type(reader_type) :: reader
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: values(:)
    real(wp) :: x
    integer(i8) :: absurd(1)

    call write_sample(error)
    if (allocated(error)) return
    x = 0.0_wp
    call reader%open(path, fault)
    call reader%keep('another real', x)
    call expect_true(error, allocated(reader%error), 'another name')
    call reader%close()

    values = [1.0_wp, 2.0_wp]
    call keep_two(meter)
    call writer%create(path, meter%bytes)
    call keep_two(writer)
    call writer%finish(fault)
    values = [1.0_wp]
    call reader%open(path, fault)
    call keep_two(reader)
    call reader%close()
    call expect_true(error, allocated(reader%error), 'another shape')

    absurd = 10_i8**17
    meter = meter_type()
    call meter%describe('line', 'real8', absurd)
    call writer%create(path, meter%bytes)
    call writer%describe('line', 'real8', absurd)
    call writer%finish(fault)
    deallocate (values)
    call reader%open(path, fault)
    call expect_true(error, .not. allocated(fault), 'a stranger''s file')
    call keep_two(reader)
    call reader%close()
    call expect_true(error, allocated(reader%error) .and. .not. allocated(values), 'absurd extents')

  contains

    subroutine keep_two(archive)
      class(archive_type), intent(inout) :: archive
      call archive%keep('line', values)
    end subroutine keep_two
  end subroutine test_misfits

  subroutine read_bytes(bytes)
    integer(i1), allocatable, intent(out) :: bytes(:)
    integer :: unit
    allocate (bytes(file_bytes(path)))
    open (newunit=unit, file=path, access='stream', form='unformatted', action='read')
    read (unit) bytes
    close (unit)
  end subroutine read_bytes

  subroutine write_bytes(bytes)
    integer(i1), intent(in) :: bytes(:)
    integer :: unit
    open (newunit=unit, file=path, access='stream', form='unformatted', status='replace', &
      & action='write')
    write (unit) bytes
    close (unit)
  end subroutine write_bytes

end module test_output_checkpoint_checkpoint
