!> How many threads a run uses, and when it uses fewer.
!>
!> Threads meet at the end of every loop, and OpenMP's usual way is to wait there actively. On a
!> machine where other programs run, the thread that all wait for may have no processor core, and a
!> run on many threads then is many times slower than one on a single thread. So the team watches
!> what share of its time it had cores. If cores were missing, it continues with fewer threads, as
!> many as meet without waiting for each other, and tries more again later. Answers do not depend on
!> the number of threads, so that it may change at any instant. What the user has set (`--threads`,
!> OMP_NUM_THREADS, a way to wait) is kept.
module pd_base_threads
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_clock, only: wall_time
  use pd_base_kinds, only: wp, i8
  use pd_base_system, only: processor_quota
  use pd_base_text, only: to_text
  implicit none (type, external)
  private
  public :: team_type, is_worth_threads, default_threads

  integer(i8), parameter :: worth_a_thread = 40000_i8  !! bonds, about 20 us of work
  real(wp), parameter :: chunk = 0.05_wp            !! time of one measurement [s]
  real(wp), parameter :: look_interval = 0.005_wp   !! between looks at the clock [s]
  real(wp), parameter :: most_missing = 0.3_wp      !! of the time of one core, in a free team [-]
  real(wp), parameter :: moment = 0.01_wp           !! of a trial, some turns of a scheduler [s]
  real(wp), parameter :: standstill = 0.5e-3_wp     !! threads meet within this, if all run [s]
  real(wp), parameter :: most_standstill = 0.15_wp  !! of the time, in a free team [-]
  real(wp), parameter :: rarely = 60.0_wp           !! trials take at most 1/60 of the time
  real(wp), parameter :: first_wait = 1.0_wp, longest_wait = 30.0_wp  !! until more are tried [s]

  !> The threads of a run. Not begun, it changes nothing.
  type :: team_type
    private
    integer :: most = 1                  !! threads that the run may use
    integer :: now = 1                   !! threads that it uses
    logical :: watches = .false.         !! the number may be lowered
    logical :: passive = .false.         !! the user has set how threads wait
    integer(i8) :: stride = 1            !! instants from one look at the clock to the next
    integer(i8) :: left = 0              !! instants until the next look
    integer(i8) :: instants = 0          !! of the present measurement
    real(wp) :: wall = 0.0_wp            !! its time so far [s]
    real(wp) :: processor = 0.0_wp       !! its processor time so far, of all threads [s]
    real(wp) :: wall_mark = -1.0_wp      !! last look, < 0: the watch stands still [s]
    real(wp) :: processor_mark = 0.0_wp  !! processor time then [s]
    real(wp) :: wait = first_wait        !! from now on until more threads are tried [s]
    real(wp) :: next_trial = 0.0_wp      !! not before [s]
    real(wp) :: next_rise = 0.0_wp       !! to more threads, not before [s]
    real(wp) :: watched = 0.0_wp         !! time of all measurements [s]
    real(wp) :: reduced = 0.0_wp         !! part of it with fewer threads than `most` [s]
    real(wp) :: used = 0.0_wp            !! processor time of those with `most` threads [s]
    real(wp) :: offered = 0.0_wp         !! time of those, times threads [s]
  contains
    procedure :: begin => begin_team
    procedure :: fit
    procedure :: look
    procedure :: pause
    procedure :: threads
    procedure :: report
    procedure, private :: note => note_measurement
  end type team_type

contains

  !> Whether a body of so many bonds is worth more than one thread: a step of a smaller one is over
  !> before another thread has woken.
  pure logical function is_worth_threads(bonds)
    integer(i8), intent(in) :: bonds  !! ordered pairs
    is_worth_threads = bonds >= worth_a_thread
  end function is_worth_threads

  !> Default number of threads: as many as OpenMP offers, which knows the cores that the program may
  !> run on, and no more than a limit on its processor time allows (containers and queues set one).
  !> With OMP_NUM_THREADS it is that number.
  integer function default_threads()
    default_threads = omp_get_max_threads()
    if (is_given('OMP_NUM_THREADS')) return
    default_threads = max(1, min(default_threads, processor_quota()))
  end function default_threads

  !> Begin with `asked` threads, or, if that is 0, with the default number, which may then be
  !> lowered while other programs need the cores.
  subroutine begin_team(self, asked)
    class(team_type), intent(out) :: self  !! the threads of a run; OpenMP is told their number
    integer, intent(in) :: asked           !! number that the user asks for; 0: none

    self%passive = is_given('OMP_WAIT_POLICY') .or. is_given('GOMP_SPINCOUNT')
    self%watches = asked == 0 .and. .not. (is_given('OMP_NUM_THREADS') .or. self%passive)
    self%most = merge(asked, default_threads(), asked > 0)
    call use_threads(self, self%most)
  end subroutine begin_team

  !> Use one thread for a small body, unless the user has set a number. For others see whether the
  !> cores are free: where they are not, begin with one thread.
  subroutine fit(self, bonds, asked)
    class(team_type), intent(inout) :: self  !! the threads of a run; their number may be lowered
    integer(i8), intent(in) :: bonds  !! ordered pairs of the body
    integer, intent(in) :: asked      !! threads that the command line asks for, 0: none

    if (asked == 0 .and. .not. is_worth_threads(bonds)) then
      self%watches = .false.
      self%most = 1
      call use_threads(self, 1)
    end if
    if (self%watches .and. self%most > 1) call try_threads(self)
  end subroutine fit

  !> An instant is over (a step or an iteration): measure, and change the number of threads if that
  !> is due. Cheap: the clock is looked at some hundred times a second.
  subroutine look(self)
    class(team_type), intent(inout) :: self  !! the threads of a run; measures, and may change their
                                             !! number
    real(wp) :: now, processor

    if (self%most == 1) return
    self%instants = self%instants + 1
    self%left = self%left - 1
    if (self%left > 0) return
    now = wall_time()
    call cpu_time(processor)
    if (self%wall_mark < 0.0_wp) then
      self%instants = 0
    else
      self%wall = self%wall + (now - self%wall_mark)
      self%processor = self%processor + (processor - self%processor_mark)
      self%stride = max(1_i8, int(self%stride*min(2.0_wp, &
        & look_interval/max(1.0e-9_wp, now - self%wall_mark)), i8))
    end if
    self%left = self%stride
    self%wall_mark = now
    self%processor_mark = processor
    if (self%wall >= chunk .and. self%instants > 0_i8) call self%note(now)
  end subroutine look

  !> What follows until the next `look` is not measured (outputs).
  subroutine pause(self)
    class(team_type), intent(inout) :: self  !! the threads of a run; drops the measurement under
                                             !! way
    self%wall_mark = -1.0_wp
    self%left = 0
    self%instants = 0
    self%wall = 0.0_wp
    self%processor = 0.0_wp
  end subroutine pause

  !> A measurement is complete at time `now` [s]: choose the number of threads for the next one.
  subroutine note_measurement(self, now)
    class(team_type), intent(inout) :: self
    real(wp), intent(in) :: now
    logical :: short
    integer :: before

    short = self%now > 1 .and. self%now - self%processor/self%wall > most_missing
    self%watched = self%watched + self%wall
    if (self%now < self%most) then
      self%reduced = self%reduced + self%wall
    else
      self%used = self%used + self%processor
      self%offered = self%offered + self%now*self%wall
    end if
    self%instants = 0
    self%wall = 0.0_wp
    self%processor = 0.0_wp
    if (.not. self%watches .or. now < self%next_trial) return
    if (.not. short .and. self%now == self%most) self%wait = first_wait
    if (.not. short .and. (self%now == self%most .or. now < self%next_rise)) return
    before = self%now
    call try_threads(self)
    ! if the number must be reduced soon after an increase, wait longer before the next increase
    if (self%now < before) self%wait = min(2*self%wait, longest_wait)
  end subroutine note_measurement

  !> Go on with the number of threads that meet without waiting for each other: all of them, or a
  !> half, a quarter, ...; a single one always does.
  subroutine try_threads(self)
    class(team_type), intent(inout) :: self
    real(wp) :: began
    integer :: number

    began = wall_time()
    number = self%most
    do while (number > 1)
      if (share_of_standstill(number) <= most_standstill) exit
      number = number/2
    end do
    self%next_trial = wall_time() + rarely*(wall_time() - began)
    self%next_rise = wall_time() + self%wait
    call use_threads(self, number)
  end subroutine try_threads

  !> Threads that the run may use.
  pure integer function threads(self)
    class(team_type), intent(in) :: self  !! the threads of a run
    threads = self%most
  end function threads

  !> A line about the number of threads, if it changed; else ''.
  pure function report(self) result(text)
    class(team_type), intent(in) :: self  !! the threads of a run, at its end
    character(:), allocatable :: text
    real(wp) :: share

    text = ''
    if (self%most == 1 .or. self%watched <= 0.0_wp) return
    if (self%watches) then
      share = self%reduced/self%watched
      if (share > 0.05_wp) text = 'fewer than '//to_text(self%most)//' in '// &
        & to_text(nint(100*share))//' % of the time, because other programs used the cores'
    else if (.not. self%passive .and. self%offered > 0.0_wp) then
      share = self%used/self%offered
      if (share < 0.75_wp) text = to_text(self%most)//' as asked for, but they had cores in '// &
        & to_text(nint(100*share))//' % of the time only; fewer may be faster'
    end if
  end function report

  !> Use so many threads from now on.
  subroutine use_threads(self, number)
    class(team_type), intent(inout) :: self
    integer, intent(in) :: number
    self%now = number
    self%stride = 1
    self%left = 0
    call omp_set_num_threads(number)
  end subroutine use_threads

  !> The share of the time for which so many threads stand still, because one that the others wait
  !> for has no core.
  real(wp) function share_of_standstill(number) result(share)
    integer, intent(in) :: number
    real(wp) :: began, last, now

    call meet(number)  ! starts them
    share = 0.0_wp
    began = wall_time()
    last = began
    do
      call meet(number)
      now = wall_time()
      if (now - last > standstill) share = share + (now - last)
      last = now
      if (now - began >= moment) exit
    end do
    share = share/(now - began)
  end function share_of_standstill

  !> Let so many threads meet.
  subroutine meet(number)
    integer, intent(in) :: number
    !$omp parallel num_threads(number) default(none)
    !$omp barrier
    !$omp end parallel
  end subroutine meet

  !> Whether an environment variable is set to something.
  logical function is_given(name)
    character(*), intent(in) :: name
    integer :: length, status
    call get_environment_variable(name, length=length, status=status)
    is_given = status == 0 .and. length > 0
  end function is_given

end module pd_base_threads
