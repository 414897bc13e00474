!> The line that says what long work before the first step does, so that a user does not wait in
!> silence: nothing in the first seconds, then a line that is rewritten on a terminal and erased in
!> the end, or now and then a full line in a log.
module pd_base_long_work
  use, intrinsic :: iso_fortran_env, only: output_unit
  use pd_base_clock, only: duration_text, log_interval, output_is_terminal, rewrite_line, &
    & terminal_interval, wall_time
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: long_work_type

  real(wp), parameter :: patience = 2.0_wp  !! before the first line [s]

  !> One piece of long work after another. Not begun, it says nothing.
  type :: long_work_type
    private
    logical :: quiet = .true.
    logical :: terminal = .false.
    logical :: open_line = .false.        !! a rewritten line stands on the terminal
    integer :: unit = output_unit
    real(wp) :: started = 0.0_wp          !! [s]
    real(wp) :: shown = 0.0_wp            !! [s]
    character(:), allocatable :: subject  !! what is worked at
  contains
    procedure :: begin
    procedure :: turn_to
    procedure :: is_due
    procedure :: tell
    procedure :: finish
  end type long_work_type

contains

  !> Begin. Without `unit` lines go to standard output.
  subroutine begin(self, quiet, unit, is_terminal)
    class(long_work_type), intent(inout) :: self  !! at its beginning on return
    logical, intent(in) :: quiet                  !! say nothing at all
    integer, intent(in), optional :: unit         !! of the lines
    logical, intent(in), optional :: is_terminal  !! rewrite one line; absent: if it is one

    self%quiet = quiet
    self%terminal = output_is_terminal()
    if (present(is_terminal)) self%terminal = is_terminal
    if (present(unit)) self%unit = unit
    self%open_line = .false.
    self%started = wall_time()
    self%shown = self%started - log_interval + patience
    if (self%terminal) self%shown = self%started - terminal_interval + patience
  end subroutine begin

  !> Work at something else.
  pure subroutine turn_to(self, subject)
    class(long_work_type), intent(inout) :: self  !! gets the subject
    character(*), intent(in) :: subject           !! such as 'weights of the stretch'
    self%subject = subject
  end subroutine turn_to

  !> Whether it is time for a line.
  logical function is_due(self)
    class(long_work_type), intent(in) :: self  !! begun or not

    is_due = .false.
    if (self%quiet) return
    is_due = wall_time() - self%shown >= merge(terminal_interval, log_interval, self%terminal)
  end function is_due

  !> Say how far the work is.
  subroutine tell(self, text)
    class(long_work_type), intent(inout) :: self  !! notes when this was
    character(*), intent(in) :: text              !! such as 'iteration 12'
    character(:), allocatable :: line

    if (self%quiet) return
    self%shown = wall_time()
    line = text//'  for '//duration_text(self%shown - self%started)
    if (allocated(self%subject)) line = self%subject//'  '//line
    if (self%terminal) then
      call rewrite_line(self%unit, line)
      self%open_line = .true.
    else
      write (self%unit, '(a)') line
    end if
    flush (self%unit)
  end subroutine tell

  !> Erase the line that is rewritten. May be called at any time.
  subroutine finish(self)
    class(long_work_type), intent(inout) :: self  !! without an open line on return

    if (self%open_line) then
      call rewrite_line(self%unit, '')
      flush (self%unit)
    end if
    self%open_line = .false.
  end subroutine finish

end module pd_base_long_work
