!> The unit test interface of test-drive v0.5.0, as far as perifort's tests use it.
!>
!> A test is a subroutine with one argument, an allocatable error that is allocated when it fails.
!> Tests run one after the other in the order of their suite.
module testdrive
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use, intrinsic :: iso_fortran_env, only: int8, int16, int32, int64, real32, real64
  implicit none (type, external)
  private
  public :: error_type, unittest_type, testsuite_type
  public :: test_interface, collect_interface
  public :: new_unittest, new_testsuite, select_test, select_suite
  public :: run_testsuite, run_selected
  public :: check, test_failed, skip_test

  integer, parameter :: status_fine = 0
  integer, parameter :: status_failed = 1
  integer, parameter :: status_skipped = 77
  character(*), parameter :: next_line = new_line('a')//'           '

  !> Failures raised since the running test began: a failure that a later check overwrote is still
  !> counted here.
  integer :: raised = 0

  !> Why a test failed, or why it was skipped.
  type :: error_type
    integer :: stat = status_fine           !! 0, failed or skipped
    character(:), allocatable :: message    !! what was found and what was expected
  end type error_type

  abstract interface
    !> A test: `error` stays unallocated if all is well.
    subroutine test_interface(error)
      import :: error_type
      implicit none (type, external)
      type(error_type), allocatable, intent(out) :: error
    end subroutine test_interface
  end interface

  !> One test and its name.
  type :: unittest_type
    character(:), allocatable :: name
    procedure(test_interface), pointer, nopass :: test => null()
    logical :: should_fail = .false.        !! passes by failing
  end type unittest_type

  abstract interface
    !> Hands over all tests of a suite.
    subroutine collect_interface(testsuite)
      import :: unittest_type
      implicit none (type, external)
      type(unittest_type), allocatable, intent(out) :: testsuite(:)
    end subroutine collect_interface
  end interface

  !> A named set of tests.
  type :: testsuite_type
    character(:), allocatable :: name
    procedure(collect_interface), pointer, nopass :: collect => null()
  end type testsuite_type

  !> Compare what a test found with what it expected; `error` is allocated if they differ.
  !> `message` replaces the text of the failure and `more` adds a line to it. Reals differ if
  !> |actual - expected| > `thr` (default: the kind's epsilon), with `rel` relative to |expected|.
  interface check
    module procedure :: check_status, check_expression, check_logical, check_text
    module procedure :: check_int8, check_int16, check_int32, check_int64
    module procedure :: check_real32, check_real64, check_number32, check_number64
  end interface check

contains

  !> Make a test from its name and its subroutine.
  function new_unittest(name, test, should_fail) result(self)
    character(*), intent(in) :: name
    procedure(test_interface) :: test
    logical, intent(in), optional :: should_fail
    type(unittest_type) :: self

    self%name = name
    self%test => test
    if (present(should_fail)) self%should_fail = should_fail
  end function new_unittest

  !> Make a suite from its name and the subroutine that hands over its tests.
  function new_testsuite(name, collect) result(self)
    character(*), intent(in) :: name
    procedure(collect_interface) :: collect
    type(testsuite_type) :: self

    self%name = name
    self%collect => collect
  end function new_testsuite

  !> Place of the test called `name`, 0 if there is none.
  function select_test(tests, name) result(at)
    type(unittest_type), intent(in) :: tests(:)
    character(*), intent(in) :: name
    integer :: at

    do at = size(tests), 1, -1
      if (tests(at)%name == name) return
    end do
  end function select_test

  !> Place of the suite called `name`, 0 if there is none.
  function select_suite(suites, name) result(at)
    type(testsuite_type), intent(in) :: suites(:)
    character(*), intent(in) :: name
    integer :: at

    do at = size(suites), 1, -1
      if (suites(at)%name == name) return
    end do
  end function select_suite

  !> Run all tests of a suite, a line each on `unit`, and add the failures to `stat`.
  !> `parallel` is part of the interface; here tests always run one at a time.
  subroutine run_testsuite(collect, unit, stat, parallel)
    procedure(collect_interface) :: collect
    integer, intent(in) :: unit
    integer, intent(inout) :: stat
    logical, intent(in), optional :: parallel
    type(unittest_type), allocatable :: tests(:)
    integer :: i

    if (present(parallel)) continue
    call collect(tests)
    do i = 1, size(tests)
      call run_one(tests(i), unit, stat)
    end do
  end subroutine run_testsuite

  !> Run the test called `name` and add its failure to `stat`; without such a test the known names
  !> are listed and `stat` becomes negative.
  subroutine run_selected(collect, name, unit, stat)
    procedure(collect_interface) :: collect
    character(*), intent(in) :: name
    integer, intent(in) :: unit
    integer, intent(inout) :: stat
    type(unittest_type), allocatable :: tests(:)
    integer :: i

    call collect(tests)
    i = select_test(tests, name)
    if (i > 0) then
      call run_one(tests(i), unit, stat)
      return
    end if
    write (unit, '(3a)') 'no test is called "', name, '"; there are:'
    write (unit, '(2x, a)') (tests(i)%name, i=1, size(tests))
    stat = -huge(stat)
  end subroutine run_selected

  !> Run one test and report it in a line, the reason of a failure below.
  subroutine run_one(test, unit, stat)
    type(unittest_type), intent(in) :: test
    integer, intent(in) :: unit
    integer, intent(inout) :: stat
    type(error_type), allocatable :: error
    character(:), allocatable :: verdict
    logical :: failed

    raised = 0
    call test%test(error)
    if (allocated(error)) raised = raised - 1
    failed = allocated(error)
    if (failed) failed = error%stat /= status_skipped

    if (raised > 0) then
      ! An overwritten failure is a fault of the test itself: `should_fail` does not excuse it.
      verdict = '[FAILED] a failed check was not looked at before the next one'
      stat = stat + 1
    else if (allocated(error) .and. .not. failed) then
      verdict = '[SKIPPED]'
    else if (failed .neqv. test%should_fail) then
      verdict = trim(merge('[UNEXPECTED PASS]', '[FAILED]         ', test%should_fail))
      stat = stat + 1
    else
      verdict = trim(merge('[EXPECTED FAIL]', '[PASSED]       ', test%should_fail))
    end if

    write (unit, '(2x, 3a)') test%name, ' ', verdict
    if (allocated(error)) write (unit, '(4x, a)') error%message
  end subroutine run_one

  !> Fail with a message.
  subroutine test_failed(error, message, more, and_more)
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in) :: message
    character(*), intent(in), optional :: more, and_more

    allocate (error)
    error%stat = status_failed
    error%message = message
    if (present(more)) error%message = error%message//next_line//more
    if (present(and_more)) error%message = error%message//next_line//and_more
    raised = raised + 1
  end subroutine test_failed

  !> Leave the test out, saying why.
  subroutine skip_test(error, message, more, and_more)
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in) :: message
    character(*), intent(in), optional :: more, and_more

    call test_failed(error, message, more, and_more)
    error%stat = status_skipped
  end subroutine skip_test

  !> The one place where a comparison fails: its own words, or those of the caller.
  subroutine differ(error, found, expected, message, more)
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in) :: found, expected
    character(*), intent(in), optional :: message, more

    if (present(message)) then
      call test_failed(error, message, more)
    else
      call test_failed(error, 'found '//found//', expected '//expected, more)
    end if
  end subroutine differ

  subroutine check_status(error, stat, message, more)
    type(error_type), allocatable, intent(out) :: error
    integer, intent(in) :: stat
    character(*), intent(in), optional :: message, more
    if (stat /= 0) call differ(error, 'status '//digits_of(int(stat, int64)), '0', message, more)
  end subroutine check_status

  subroutine check_expression(error, expression, message, more)
    type(error_type), allocatable, intent(out) :: error
    logical, intent(in) :: expression
    character(*), intent(in), optional :: message, more
    if (.not. expression) call differ(error, 'false', 'true', message, more)
  end subroutine check_expression

  subroutine check_logical(error, actual, expected, message, more)
    type(error_type), allocatable, intent(out) :: error
    logical, intent(in) :: actual, expected
    character(*), intent(in), optional :: message, more
    if (actual .eqv. expected) return
    call differ(error, trim(merge('true ', 'false', actual)), &
      & trim(merge('true ', 'false', expected)), message, more)
  end subroutine check_logical

  subroutine check_text(error, actual, expected, message, more)
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in) :: actual, expected
    character(*), intent(in), optional :: message, more
    if (actual /= expected) &
      & call differ(error, '"'//actual//'"', '"'//expected//'"', message, more)
  end subroutine check_text

  subroutine check_int8(error, actual, expected, message, more)
    type(error_type), allocatable, intent(out) :: error
    integer(int8), intent(in) :: actual, expected
    character(*), intent(in), optional :: message, more
    call compare_integers(error, int(actual, int64), int(expected, int64), message, more)
  end subroutine check_int8

  subroutine check_int16(error, actual, expected, message, more)
    type(error_type), allocatable, intent(out) :: error
    integer(int16), intent(in) :: actual, expected
    character(*), intent(in), optional :: message, more
    call compare_integers(error, int(actual, int64), int(expected, int64), message, more)
  end subroutine check_int16

  subroutine check_int32(error, actual, expected, message, more)
    type(error_type), allocatable, intent(out) :: error
    integer(int32), intent(in) :: actual, expected
    character(*), intent(in), optional :: message, more
    call compare_integers(error, int(actual, int64), int(expected, int64), message, more)
  end subroutine check_int32

  subroutine check_int64(error, actual, expected, message, more)
    type(error_type), allocatable, intent(out) :: error
    integer(int64), intent(in) :: actual, expected
    character(*), intent(in), optional :: message, more
    call compare_integers(error, actual, expected, message, more)
  end subroutine check_int64

  subroutine compare_integers(error, actual, expected, message, more)
    type(error_type), allocatable, intent(out) :: error
    integer(int64), intent(in) :: actual, expected
    character(*), intent(in), optional :: message, more
    if (actual /= expected) &
      & call differ(error, digits_of(actual), digits_of(expected), message, more)
  end subroutine compare_integers

  subroutine check_number32(error, actual, message, more)
    type(error_type), allocatable, intent(out) :: error
    real(real32), intent(in) :: actual
    character(*), intent(in), optional :: message, more
    if (ieee_is_nan(actual)) call differ(error, 'not-a-number', 'a number', message, more)
  end subroutine check_number32

  subroutine check_number64(error, actual, message, more)
    type(error_type), allocatable, intent(out) :: error
    real(real64), intent(in) :: actual
    character(*), intent(in), optional :: message, more
    if (ieee_is_nan(actual)) call differ(error, 'not-a-number', 'a number', message, more)
  end subroutine check_number64

  subroutine check_real32(error, actual, expected, message, more, thr, rel)
    type(error_type), allocatable, intent(out) :: error
    real(real32), intent(in) :: actual, expected
    character(*), intent(in), optional :: message, more
    real(real32), intent(in), optional :: thr
    logical, intent(in), optional :: rel
    real(real64) :: allowed

    allowed = epsilon(expected)
    if (present(thr)) allowed = thr
    call compare_reals(error, real(actual, real64), real(expected, real64), allowed, &
      & message, more, rel)
  end subroutine check_real32

  subroutine check_real64(error, actual, expected, message, more, thr, rel)
    type(error_type), allocatable, intent(out) :: error
    real(real64), intent(in) :: actual, expected
    character(*), intent(in), optional :: message, more
    real(real64), intent(in), optional :: thr
    logical, intent(in), optional :: rel
    real(real64) :: allowed

    allowed = epsilon(expected)
    if (present(thr)) allowed = thr
    call compare_reals(error, actual, expected, allowed, message, more, rel)
  end subroutine check_real64

  subroutine compare_reals(error, actual, expected, allowed, message, more, rel)
    type(error_type), allocatable, intent(out) :: error
    real(real64), intent(in) :: actual, expected, allowed
    character(*), intent(in), optional :: message, more
    logical, intent(in), optional :: rel
    real(real64) :: scale
    character(100) :: text

    call check(error, actual, message, more)
    if (allocated(error)) return
    scale = 1.0_real64
    if (present(rel)) then
      ! Written as a product below, so that an expected zero is no division by zero.
      if (rel) scale = abs(expected)
    end if
    if (abs(actual - expected) <= allowed*scale) return
    write (text, '(es24.16e3, ", within ", es10.3e2)') expected, allowed*scale
    call differ(error, real_text(actual), trim(adjustl(text)), message, more)
  end subroutine compare_reals

  pure function real_text(value) result(text)
    real(real64), intent(in) :: value
    character(:), allocatable :: text
    character(32) :: buffer
    write (buffer, '(es24.16e3)') value
    text = trim(adjustl(buffer))
  end function real_text

  pure function digits_of(value) result(text)
    integer(int64), intent(in) :: value
    character(:), allocatable :: text
    character(24) :: buffer
    write (buffer, '(i0)') value
    text = trim(buffer)
  end function digits_of

end module testdrive
