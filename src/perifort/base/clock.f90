!> Wall time: a clock, the time of named phases, durations in words, and the progress line of a run.
module pd_base_clock
  use, intrinsic :: iso_c_binding, only: c_int
  use, intrinsic :: iso_fortran_env, only: output_unit
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: to_text, with_unit
  implicit none (type, external)
  private
  public :: wall_time, duration_text, output_is_terminal, phase_timer_type, progress_type
  public :: progress_text, rewrite_line, terminal_interval, log_interval

  integer, parameter :: name_length = 32       !! longest name of a phase that is kept [characters]
  integer, parameter :: line_width = 79        !! a rewritten line must not wrap [characters]
  real(wp), parameter :: look_interval = 0.05_wp      !! between looks at the clock [s]
  real(wp), parameter :: terminal_interval = 0.2_wp   !! between rewritings [s]
  real(wp), parameter :: log_interval = 10.0_wp       !! between lines of a log [s]

  !> How long the parts of a run take. A phase is known by its name from its first start on; phases
  !> may be nested or left out, each has its own watch.
  type :: phase_timer_type
    private
    integer :: count = 0
    character(name_length), allocatable :: names(:)
    real(wp), allocatable :: spent(:)          !! [s]
    real(wp), allocatable :: since(:)          !! start of the interval, < 0: not running [s]
    real(wp) :: origin = -1.0_wp               !! first start of any phase [s]
  contains
    procedure :: start => start_phase
    procedure :: stop => stop_phase
    procedure :: seconds => seconds_of_phase
    procedure :: total => total_seconds
    procedure :: table => table_of_phases
    procedure, private :: find => find_phase
  end type phase_timer_type

  !> The line with the progress of a run: rewritten in place on a terminal, now and then a full line
  !> in a log file. `update` may be called every step: it looks at the clock only about twenty times
  !> a second.
  type :: progress_type
    private
    integer(i8) :: total = 0                   !! steps of the whole run
    integer(i8) :: first = 0                   !! step at which the run starts
    integer :: unit = output_unit
    logical :: quiet = .true.
    logical :: terminal = .false.
    logical :: load = .false.                  !! times are parts of the load
    logical :: open_line = .false.             !! the cursor stands at the end of a rewritten line
    integer(i8) :: stride = 1                  !! calls from one look at the clock to the next
    integer(i8) :: calls_left = 0
    real(wp) :: started = 0.0_wp               !! [s]
    real(wp) :: looked = 0.0_wp                !! [s]
    real(wp) :: shown = 0.0_wp                 !! [s]
  contains
    procedure :: start => start_progress
    procedure :: update => update_progress
    procedure :: finish => finish_progress
  end type progress_type

  interface
    !> POSIX: 1 if the file descriptor is a terminal.
    function posix_isatty(descriptor) bind(c, name='isatty') result(yes)
      import :: c_int
      implicit none (type, external)
      integer(c_int), value :: descriptor
      integer(c_int) :: yes
    end function posix_isatty
  end interface

contains

  !> Seconds of wall time since some fixed moment.
  function wall_time() result(seconds)
    real(wp) :: seconds
    integer(i8) :: count, rate
    call system_clock(count, rate)
    seconds = real(count, wp)/real(rate, wp)
  end function wall_time

  !> Whether standard output is a terminal.
  function output_is_terminal() result(yes)
    logical :: yes
    yes = posix_isatty(1_c_int) == 1_c_int
  end function output_is_terminal

  !> A duration as one says it: `3.4 s`, `2 min 05 s`, `1 h 02 min`, `3 d 04 h`.
  pure function duration_text(seconds) result(text)
    real(wp), intent(in) :: seconds            !! [s]
    character(:), allocatable :: text
    real(wp), parameter :: longest = 3.0e9_wp
    integer(i8) :: whole

    ! Not-a-number fails the first comparison and ends up here, too.
    if (.not. (seconds >= 0.0_wp .and. seconds < longest)) then
      text = 'unknown'
      if (seconds >= longest) text = 'over 100 years'
    else if (seconds < 0.9995_wp) then
      text = with_unit(seconds, 's', 3)
    else if (seconds < 9.95_wp) then
      text = to_text(seconds, 2)//' s'
    else
      whole = nint(seconds, i8)
      if (whole < 60) then
        text = to_text(whole)//' s'
      else if (whole < 3600) then
        text = two_parts(whole, 60_i8, ' min ', 1_i8, ' s')
      else if (whole < 86400) then
        text = two_parts(whole, 3600_i8, ' h ', 60_i8, ' min')
      else
        text = two_parts(whole, 86400_i8, ' d ', 3600_i8, ' h')
      end if
    end if
  end function duration_text

  pure function two_parts(whole, large, large_name, small, small_name) result(text)
    integer(i8), intent(in) :: whole, large, small   !! [s]
    character(*), intent(in) :: large_name, small_name
    character(:), allocatable :: text
    character(2) :: rest
    write (rest, '(i2.2)') mod(whole, large)/small
    text = to_text(whole/large)//large_name//rest//small_name
  end function two_parts

  !> Begin an interval of the phase `name`; a phase that is already running continues.
  subroutine start_phase(self, name)
    class(phase_timer_type), intent(inout) :: self  !! the timer; notes the time
    character(*), intent(in) :: name                !! of the phase; 32 characters count
    integer :: at
    real(wp) :: now

    now = wall_time()
    if (self%origin < 0.0_wp) self%origin = now
    if (.not. allocated(self%names)) then
      allocate (self%names(8), self%spent(8), self%since(8))
    end if
    at = self%find(name)
    if (at == 0) then
      if (self%count == size(self%names)) then
        self%names = [self%names, self%names]
        self%spent = [self%spent, self%spent]
        self%since = [self%since, self%since]
      end if
      self%count = self%count + 1
      at = self%count
      self%names(at) = name
      self%spent(at) = 0.0_wp
      self%since(at) = -1.0_wp
    end if
    if (self%since(at) < 0.0_wp) self%since(at) = now
  end subroutine start_phase

  !> End the interval of the phase `name`; without a start this does nothing.
  subroutine stop_phase(self, name)
    class(phase_timer_type), intent(inout) :: self  !! the timer; adds the interval to the phase's
                                                    !! time
    character(*), intent(in) :: name                !! of the phase; 32 characters count
    integer :: at

    at = self%find(name)
    if (at == 0) return
    if (self%since(at) < 0.0_wp) return
    self%spent(at) = self%spent(at) + (wall_time() - self%since(at))
    self%since(at) = -1.0_wp
  end subroutine stop_phase

  !> Time spent in the phase `name` so far [s]; 0 for an unknown one.
  function seconds_of_phase(self, name) result(seconds)
    class(phase_timer_type), intent(in) :: self  !! the timer
    character(*), intent(in) :: name             !! of the phase; 32 characters count
    real(wp) :: seconds
    integer :: at

    seconds = 0.0_wp
    at = self%find(name)
    if (at == 0) return
    seconds = self%spent(at)
    if (self%since(at) >= 0.0_wp) seconds = seconds + (wall_time() - self%since(at))
  end function seconds_of_phase

  !> Time since the first start of any phase [s].
  function total_seconds(self) result(seconds)
    class(phase_timer_type), intent(in) :: self  !! the timer
    real(wp) :: seconds
    seconds = 0.0_wp
    if (self%origin >= 0.0_wp) seconds = wall_time() - self%origin
  end function total_seconds

  !> The phases in the order of their first start: a line each with time and share of the total,
  !> then the time that no phase covers and the total. Lines are parted by `new_line`; '' if no
  !> phase was ever started.
  function table_of_phases(self) result(text)
    class(phase_timer_type), intent(in) :: self  !! the timer
    character(:), allocatable :: text
    real(wp) :: total, other
    integer :: i

    text = ''
    if (self%count == 0) return
    total = self%total()
    other = total
    do i = 1, self%count
      text = text//row(self%names(i), self%seconds(trim(self%names(i))), total)//new_line('a')
      other = other - self%seconds(trim(self%names(i)))
    end do
    if (other > 0.005_wp*total) text = text//row('other', other, total)//new_line('a')
    text = text//row('total', total, total)
  end function table_of_phases

  pure function row(name, seconds, total) result(text)
    character(*), intent(in) :: name
    real(wp), intent(in) :: seconds, total     !! [s]
    character(:), allocatable :: text
    character(120) :: buffer
    real(wp) :: share
    share = 100.0_wp*min(1.0_wp, seconds/max(total, tiny(1.0_wp)))
    write (buffer, '(2x, a24, a14, f8.1, " %")') name, adjust_right(duration_text(seconds), 14), &
      & share
    text = trim(buffer)
  end function row

  pure function adjust_right(text, width) result(right)
    character(*), intent(in) :: text
    integer, intent(in) :: width
    character(width) :: right
    right = repeat(' ', max(0, width - len(text)))//text
  end function adjust_right

  pure integer function find_phase(self, name) result(at)
    class(phase_timer_type), intent(in) :: self
    character(*), intent(in) :: name
    do at = self%count, 1, -1
      if (self%names(at) == name(:min(len(name), name_length))) return
    end do
  end function find_phase

  !> Begin. `is_terminal`: rewrite the line in place; `quiet`: show nothing at all.
  subroutine start_progress(self, total_steps, is_terminal, quiet, unit, first_step, load)
    class(progress_type), intent(inout) :: self       !! the progress line, set to its beginning
    integer(i8), intent(in) :: total_steps  !! of the whole run, those done before included
    logical, intent(in) :: is_terminal                !! rewrite the line in place; else write a new
                                                      !! line now and then
    logical, intent(in) :: quiet                      !! show nothing at all
    integer, intent(in), optional :: unit             !! default: standard output
    integer(i8), intent(in), optional :: first_step   !! steps that were done before, default 0
    logical, intent(in), optional :: load             !! the printed time is the part of the load

    self%total = total_steps
    self%terminal = is_terminal
    self%quiet = quiet
    self%unit = output_unit
    if (present(unit)) self%unit = unit
    self%first = 0
    if (present(first_step)) self%first = first_step
    self%load = .false.
    if (present(load)) self%load = load
    self%open_line = .false.
    self%stride = 1
    self%calls_left = 0
    self%started = wall_time()
    self%looked = self%started
    self%shown = self%started
  end subroutine start_progress

  !> Tell that `step` steps are complete. The last one is always shown. `note` is added.
  subroutine update_progress(self, step, time, bonds_broken, note)
    class(progress_type), intent(inout) :: self  !! the progress line; notes when it looked at the
                                                 !! clock and what it has shown
    integer(i8), intent(in) :: step  !! steps that are complete, those done before the run included
    real(wp), intent(in) :: time               !! simulated [s]
    integer(i8), intent(in) :: bonds_broken    !! since the start of the run
    character(*), intent(in), optional :: note   !! text behind the line; absent: none
    real(wp) :: now, waited, interval
    character(:), allocatable :: line

    if (self%quiet) return
    self%calls_left = self%calls_left - 1
    if (self%calls_left > 0 .and. step < self%total) return

    now = wall_time()
    ! The stride doubles at most, so that a sudden slowdown does not freeze the line.
    waited = max(now - self%looked, 1.0e-9_wp)
    self%stride = max(1_i8, int(real(self%stride, wp)*min(2.0_wp, look_interval/waited), i8))
    self%calls_left = self%stride
    self%looked = now

    interval = merge(terminal_interval, log_interval, self%terminal)
    if (now - self%shown < interval .and. step < self%total) return
    self%shown = now
    line = progress_text(step, self%total, time, bonds_broken, now - self%started, self%first, &
      & self%load)
    if (present(note)) line = line//'  '//note
    if (self%terminal) then
      call rewrite_line(self%unit, line)
      self%open_line = .true.
    else
      write (self%unit, '(a)') line
    end if
    flush (self%unit)
    if (step >= self%total) call self%finish()
  end subroutine update_progress

  !> Write a line of a terminal in place of what stands there; an empty one erases it.
  subroutine rewrite_line(unit, line)
    integer, intent(in) :: unit       !! of the terminal
    character(*), intent(in) :: line  !! cut to the width of a terminal

    ! Return to the first column, write, and clear the rest of an older, longer line.
    write (unit, '(a)', advance='no') achar(13)//line(:min(len(line), line_width))//achar(27)//'[K'
  end subroutine rewrite_line

  !> End the line, so that the next output starts on a new one. May be called at any time.
  subroutine finish_progress(self)
    class(progress_type), intent(inout) :: self  !! the progress line; no longer open on return
    if (self%open_line) write (self%unit, '(a)') ''
    self%open_line = .false.
  end subroutine finish_progress

  !> The progress line: percent, step, simulated time, bonds broken, steps per second and time left,
  !> the last two from the mean of the `elapsed` seconds.
  pure function progress_text(step, total, time, bonds_broken, elapsed, first, load) result(text)
    integer(i8), intent(in) :: step  !! steps that are complete, those before `first` included
    integer(i8), intent(in) :: total           !! steps of the whole run
    integer(i8), intent(in) :: bonds_broken    !! since the start of the run
    real(wp), intent(in) :: time, elapsed      !! [s]
    integer(i8), intent(in), optional :: first !! step at which the clock was started, default 0
    logical, intent(in), optional :: load      !! `time` is the part of the load, 0 to 1
    character(:), allocatable :: text
    character(:), allocatable :: clock, what
    character(8) :: percent
    real(wp) :: rate
    integer(i8) :: begun

    begun = 0
    if (present(first)) begun = first
    clock = with_unit(time, 's', 4)
    what = ' step'
    if (present(load)) then
      if (load) what = ' load step'
      if (load) clock = 'load factor '//to_text(time, 4)
    end if
    ! Rounded down: 100 % is only said when all is done.
    write (percent, '(f5.1)') floor(1000.0_wp*real(step, wp)/real(max(total, 1_i8), wp))/10.0_wp
    text = trim(percent)//' % '//what//' '//to_text(step)//'/'//to_text(total)//'  '// &
      & clock//'  broken bonds '//to_text(bonds_broken)
    if (present(load) .and. step <= begun .and. elapsed > 0.0_wp) then
      ! a load step may be all there is
      if (load) text = text//'  for '//duration_text(elapsed)
    end if
    if (step <= begun .or. elapsed <= 0.0_wp) return
    rate = real(step - begun, wp)/elapsed
    text = text//'  '//to_text(rate, 3)//what//'s/s'
    if (step < total) text = text//'  left '//duration_text(real(total - step, wp)/rate)
    if (step >= total) text = text//'  took '//duration_text(elapsed)
  end function progress_text

end module pd_base_clock
