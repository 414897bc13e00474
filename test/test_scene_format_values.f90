!> Words to values and back.
module test_scene_format_values
  use pd_base_kinds, only: wp
  use pd_scene_format_values, only: exact_text, list_text, parse_integer, parse_logical, &
    & parse_real, quoted_text
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_format_values

contains

  subroutine collect_scene_format_values(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('reals', test_reals), &
      & new_unittest('words that are not reals', test_no_reals), &
      & new_unittest('whole numbers', test_integers), &
      & new_unittest('true and false', test_logicals), &
      & new_unittest('a real is written with all its bits', test_exact), &
      & new_unittest('texts are quoted', test_quoted)]
  end subroutine collect_scene_format_values

  subroutine test_reals(error)
    type(error_type), allocatable, intent(out) :: error
    character(8), parameter :: words(9) = [character(8) :: '1', '-2.5', '+.5', '3.', '1e3', &
      & '1.5D-3', '2E+2', '0', '0e999']
    real(wp), parameter :: values(9) = [1.0_wp, -2.5_wp, 0.5_wp, 3.0_wp, 1000.0_wp, 1.5e-3_wp, &
      & 200.0_wp, 0.0_wp, 0.0_wp]
    character(:), allocatable :: note
    real(wp) :: value
    integer :: i

    do i = 1, size(words)
      call parse_real(trim(words(i)), value, note)
      call check(error, note, '', trim(words(i)))
      if (allocated(error)) return
      call check(error, value, values(i), trim(words(i)))
      if (allocated(error)) return
    end do
  end subroutine test_reals

  subroutine test_no_reals(error)
    type(error_type), allocatable, intent(out) :: error
    character(12), parameter :: words(19) = [character(12) :: 'abc', '1.5.2', '1e', '1e+', 'e5', &
      & '.', '-', '1,5', '(1,2)', 'nan', '-inf', 'Infinity', '1e999', '1e-999', '1e99999999', &
      & '5Pa', '1e3.5', '--1', '1+5']
    character(:), allocatable :: note
    real(wp) :: value
    integer :: i

    do i = 1, size(words)
      call parse_real(trim(words(i)), value, note)
      call check(error, len(note) > 0, 'accepted: '//trim(words(i)))
      if (allocated(error)) return
    end do
    call parse_real('NaN', value, note)
    call check(error, note, 'expected a finite number')
  end subroutine test_no_reals

  subroutine test_integers(error)
    type(error_type), allocatable, intent(out) :: error
    character(12), parameter :: wrong(7) = [character(12) :: '1.5', '1e3', 'abc', '+', '1-', &
      & '99999999999', '0x10']
    character(:), allocatable :: note
    integer :: value, i

    call parse_integer('-42', value, note)
    call check(error, len(note) == 0 .and. value == -42)
    if (allocated(error)) return
    call parse_integer('+7', value, note)
    call check(error, len(note) == 0 .and. value == 7)
    if (allocated(error)) return
    do i = 1, size(wrong)
      call parse_integer(trim(wrong(i)), value, note)
      call check(error, len(note) > 0, 'accepted: '//trim(wrong(i)))
      if (allocated(error)) return
    end do
  end subroutine test_integers

  subroutine test_logicals(error)
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: note
    logical :: value

    call parse_logical('.TRUE.', value, note)
    call check(error, value .and. len(note) == 0)
    if (allocated(error)) return
    call parse_logical('f', value, note)
    call check(error,.not. value .and. len(note) == 0)
    if (allocated(error)) return
    call parse_logical('yes', value, note)
    call check(error, len(note) > 0, 'accepted: yes')
    if (allocated(error)) return
    ! A list-directed read would take this for true.
    call parse_logical('tomorrow', value, note)
    call check(error, len(note) > 0, 'accepted: tomorrow')
  end subroutine test_logicals

  subroutine test_exact(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: values(8), back
    character(:), allocatable :: note
    integer :: i

    values = [0.1_wp, 1.0_wp/3.0_wp, 1.94598e-7_wp, 200.0e9_wp, -3.4028234663852886e28_wp, 0.0_wp, &
      & acos(-1.0_wp)*1.0e-20_wp, nearest(1.0_wp, 2.0_wp)]
    do i = 1, size(values)
      call parse_real(exact_text(values(i)), back, note)
      call check(error, abs(back - values(i)) <= 0.0_wp .and. len(note) == 0, &
        & exact_text(values(i)))
      if (allocated(error)) return
    end do
    call check(error, exact_text(0.1_wp)//' '//exact_text(7850.0_wp), '0.1 7850.0')
  end subroutine test_exact

  subroutine test_quoted(error)
    type(error_type), allocatable, intent(out) :: error
    call check(error, quoted_text("it's"), "'it''s'")
    if (allocated(error)) return
    call check(error, list_text([character(3) :: 'a', 'bcd']), "'a', 'bcd'")
    if (allocated(error)) return
    call check(error, list_text([1.0_wp, 0.5_wp]), '1.0, 0.5')
  end subroutine test_quoted

end module test_scene_format_values
