!> Durations in words, phases, and the progress line.
module test_base_clock
  use, intrinsic :: iso_fortran_env, only: compiler_options
  use pd_base_clock, only: duration_text, phase_timer_type, progress_text, progress_type, wall_time
  use pd_base_kinds, only: i8, wp
  use testdrive, only: check, error_type, new_unittest, skip_test, unittest_type
  implicit none (type, external)
  private
  public :: collect_base_clock

contains

  subroutine collect_base_clock(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('durations are written in words', test_durations), &
      & new_unittest('impossible durations are marked', test_strange_durations), &
      & new_unittest('the clock runs forward', test_clock), &
      & new_unittest('a phase counts only its own time', test_phases), &
      & new_unittest('many phases are kept apart', test_many_phases), &
      & new_unittest('the table names phases, other time and total', test_table), &
      & new_unittest('the progress line is complete', test_progress_text), &
      & new_unittest('100 % is printed only at the end', test_not_yet), &
      & new_unittest('a log has few lines and the last one', test_log), &
      & new_unittest('a terminal is rewritten in place', test_terminal), &
      & new_unittest('a quiet run shows nothing', test_quiet), &
      & new_unittest('showing progress is cheap', test_cheap)]
  end subroutine collect_base_clock

  subroutine test_durations(error)
    type(error_type), allocatable, intent(out) :: error
    call check(error, duration_text(0.0_wp), '0 s')
    if (allocated(error)) return
    call check(error, duration_text(2.5e-3_wp), '2.5 ms')
    if (allocated(error)) return
    call check(error, duration_text(3.4_wp), '3.4 s')
    if (allocated(error)) return
    call check(error, duration_text(9.97_wp), '10 s')
    if (allocated(error)) return
    call check(error, duration_text(59.4_wp), '59 s')
    if (allocated(error)) return
    call check(error, duration_text(59.6_wp), '1 min 00 s')
    if (allocated(error)) return
    call check(error, duration_text(125.0_wp), '2 min 05 s')
    if (allocated(error)) return
    call check(error, duration_text(3725.0_wp), '1 h 02 min')
    if (allocated(error)) return
    call check(error, duration_text(3.0_wp*86400 + 4.5_wp*3600), '3 d 04 h')
  end subroutine test_durations

  subroutine test_strange_durations(error)
    type(error_type), allocatable, intent(out) :: error
    call check(error, duration_text(-1.0_wp), 'unknown')
    if (allocated(error)) return
    call check(error, duration_text(huge(1.0_wp)), 'over 100 years')
  end subroutine test_strange_durations

  subroutine test_clock(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: first, waited
    first = wall_time()
    waited = wait_for(0.01_wp)
    call check(error, wall_time() - first >= 0.01_wp, 'the clock stands still')
    if (allocated(error)) return
    call check(error, waited < 5.0_wp, 'the clock jumps')
  end subroutine test_clock

  subroutine test_phases(error)
    type(error_type), allocatable, intent(out) :: error
    type(phase_timer_type) :: timer
    real(wp) :: forces, inner, waited

    call timer%start('forces')
    forces = wait_for(0.02_wp)
    call timer%start('inner')
    inner = wait_for(0.01_wp)
    call timer%stop('inner')
    call timer%stop('forces')
    waited = wait_for(0.01_wp)
    call timer%start('forces')
    forces = forces + wait_for(0.01_wp)
    call timer%stop('forces')
    call timer%stop('never started')

    call check(error, timer%seconds('forces') >= forces + inner, 'time got lost')
    if (allocated(error)) return
    call check(error, timer%seconds('inner') >= inner, 'time of the inner phase got lost')
    if (allocated(error)) return
    call check(error, timer%seconds('forces') <= timer%total() - waited, 'the pause was counted')
    if (allocated(error)) return
    call check(error, timer%seconds('never started') <= 0.0_wp)
  end subroutine test_phases

  subroutine test_many_phases(error)
    type(error_type), allocatable, intent(out) :: error
    type(phase_timer_type) :: timer
    real(wp) :: waited
    integer :: i

    do i = 1, 40
      call timer%start('phase '//achar(48 + i))
      if (i == 7) waited = wait_for(0.01_wp)
      call timer%stop('phase '//achar(48 + i))
    end do
    call check(error, timer%seconds('phase '//achar(55)) >= waited, 'phase 7 lost its time')
    if (allocated(error)) return
    call check(error, timer%seconds('phase '//achar(48 + 40)) < 0.01_wp, 'phase 40 has another''s')
  end subroutine test_many_phases

  subroutine test_table(error)
    type(error_type), allocatable, intent(out) :: error
    type(phase_timer_type) :: timer
    character(:), allocatable :: text
    real(wp) :: waited

    call check(error, len(timer%table()), 0, 'an unused timer has no table')
    if (allocated(error)) return
    call timer%start('families')
    waited = wait_for(0.01_wp)
    call timer%stop('families')
    waited = wait_for(0.01_wp)
    text = timer%table()
    call check(error, index(text, 'families') > 0 .and. index(text, 'other') > 0, text)
    if (allocated(error)) return
    call check(error, index(text, 'total') > index(text, 'other'), text)
    if (allocated(error)) return
    call check(error, index(text, '100.0 %') > index(text, 'total'), text)
  end subroutine test_table

  subroutine test_progress_text(error)
    type(error_type), allocatable, intent(out) :: error
    call check(error, progress_text(6500_i8, 26000_i8, 1.264e-3_wp, 12_i8, 13.0_wp), &
      & ' 25.0 %  step 6500/26000  1.264 ms  broken bonds 12  500 steps/s  left 39 s')
    if (allocated(error)) return
    call check(error, progress_text(0_i8, 10_i8, 0.0_wp, 0_i8, 1.0_wp), &
      & '  0.0 %  step 0/10  0 s  broken bonds 0')
    if (allocated(error)) return
    call check(error, progress_text(10_i8, 10_i8, 1.0_wp, 0_i8, 4.0_wp), &
      & '100.0 %  step 10/10  1 s  broken bonds 0  2.5 steps/s  took 4 s')
    if (allocated(error)) return
    ! A run that goes on from step 90 counts only what it did itself.
    call check(error, progress_text(95_i8, 100_i8, 1.0_wp, 0_i8, 1.0_wp, 90_i8), &
      & ' 95.0 %  step 95/100  1 s  broken bonds 0  5 steps/s  left 1 s')
  end subroutine test_progress_text

  subroutine test_not_yet(error)
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: text
    text = progress_text(99999_i8, 100000_i8, 1.0_wp, 0_i8, 1.0_wp)
    call check(error, text(:7), ' 99.9 %')
  end subroutine test_not_yet

  subroutine test_log(error)
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: text
    integer :: lines
    text = shown(terminal=.false., quiet=.false., lines=lines)
    call check(error, lines, 1, text)
    if (allocated(error)) return
    call check(error, index(text, '100.0 %') == 1 .and. index(text, achar(13)) == 0, text)
  end subroutine test_log

  subroutine test_terminal(error)
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: text
    integer :: lines, returns, i
    text = shown(terminal=.true., quiet=.false., lines=lines)
    returns = count([(text(i:i) == achar(13), i=1, len(text))])
    call check(error, lines, 1, 'a rewritten line must stay one line')
    if (allocated(error)) return
    call check(error, returns >= 2, 'the line was not rewritten')
    if (allocated(error)) return
    call check(error, index(text, '100.0 %') > 0, 'the end is missing')
  end subroutine test_terminal

  subroutine test_quiet(error)
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: text
    integer :: lines
    text = shown(terminal=.true., quiet=.true., lines=lines)
    call check(error, len(text), 0, text)
  end subroutine test_quiet

  subroutine test_cheap(error)
    type(error_type), allocatable, intent(out) :: error
    type(progress_type) :: progress
    integer(i8), parameter :: calls = 2000000_i8
    real(wp) :: start, end_of_updates, end_of_looks, latest
    integer(i8) :: step
    integer :: unit

    ! Such builds watch or count each access to memory, but not the clock.
    if (index(compiler_options(), '-fsanitize') + index(compiler_options(), '-fprofile') > 0) then
      call skip_test(error, 'in a build that looks for faults costs are not those of the program')
      return
    end if
    open (newunit=unit, status='scratch', action='readwrite')
    call progress%start(calls + 1, .true., .false., unit=unit)
    latest = 0
    call cpu_time(start)
    do step = 1, calls
      call progress%update(step, 0.0_wp, 0_i8)
    end do
    call cpu_time(end_of_updates)
    do step = 1, calls
      latest = max(latest, wall_time())
    end do
    call cpu_time(end_of_looks)
    close (unit)
    ! Processor time against processor time, so that neither other work on the machine nor a slow
    ! build counts. If each call looked at the clock, it could not cost less than a look.
    call check(error, end_of_updates - start < 0.5_wp*(end_of_looks - end_of_updates), &
      & 'an update costs as much as a look at the clock')
  end subroutine test_cheap

  !> What a run of half a second shows, as one text, and its number of lines.
  function shown(terminal, quiet, lines) result(text)
    logical, intent(in) :: terminal, quiet
    integer, intent(out) :: lines
    character(:), allocatable :: text
    character(*), parameter :: file = 'build/test_base_clock.txt'
    type(progress_type) :: progress
    real(wp) :: waited
    integer :: unit, length, i
    integer(i8) :: step

    open (newunit=unit, file=file, status='replace', action='write')
    call progress%start(50_i8, terminal, quiet, unit=unit)
    do step = 1, 50
      waited = wait_for(0.01_wp)
      call progress%update(step, waited, 0_i8)
    end do
    close (unit)

    ! Byte by byte, since a carriage return ends a record when it is read formatted.
    open (newunit=unit, file=file, status='old', action='read', access='stream', form='unformatted')
    inquire (unit=unit, size=length)
    allocate (character(length) :: text)
    if (length > 0) read (unit) text
    close (unit, status='delete')
    lines = count([(text(i:i) == new_line('a'), i=1, length)])
  end function shown

  !> Let time pass; returns how much it was [s].
  function wait_for(seconds) result(waited)
    real(wp), intent(in) :: seconds
    real(wp) :: waited, start
    start = wall_time()
    do
      waited = wall_time() - start
      if (waited >= seconds) exit
    end do
  end function wait_for

end module test_base_clock
