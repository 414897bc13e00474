!> The watch over the energy of a motion: what moves cannot have more of it than was there at the
!> start and has been supplied since (doc/theory.md, 9).
!>
!> Every few steps the integrator compares the kinetic energy, which alone must not exceed what was
!> supplied. Strain and dissipated energy are added when somebody looks at all energies: the
!> history, or the integrator if that has not been for long.
module pd_motion_watch
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: watch_type

  !> A wave of frequency omega keeps an energy that differs from this one by
  !> 1/(1 - (omega dt/2)^2), which is 50 at 0.99 of the limit; beyond the limit it grows without
  !> end.
  real(wp), parameter :: too_much = 100.0_wp
  !> More than the balance is off where many bonds break (doc/theory.md, 9).
  real(wp), parameter :: good = 1.1_wp
  integer, parameter :: first_look = 50   !! steps; then at 100, 200, 400, 800, 1200, ...
  integer, parameter :: longest = 400     !! steps from one look to the next

  type :: watch_type
    private
    real(wp), public :: rounding = 0.0_wp  !! energy that is none [J]
    real(wp) :: start = 0.0_wp             !! energy at the start, without what was supplied [J]
    real(wp) :: supply = -1.0_wp           !! greatest energy that there can have been [J]
    real(wp) :: energy = 0.0_wp            !! at the last look [J]
    logical :: doubtful = .false.          !! the last look found too much
    integer :: looked = -1                 !! step of the last look, -1: none yet
    integer :: kept = -1                   !! step of the last state that was kept
    logical, public :: sound = .true.      !! nothing has been found
  contains
    procedure :: look
    procedure :: look_is_due
    procedure :: keeps
    procedure :: look_at_kinetic
    procedure :: supplied
    procedure :: found
    procedure, private :: most
  end type watch_type

contains

  !> Look at all energies after `step` steps [J]. The first look takes them for what is there.
  pure subroutine look(self, step, kinetic, strain, dissipated, work)
    class(watch_type), intent(inout) :: self
    integer, intent(in) :: step
    real(wp), intent(in) :: kinetic, strain, dissipated, work

    self%energy = kinetic + strain + dissipated
    if (self%looked < 0) self%start = self%energy - work
    self%looked = step
    call self%supplied(work)
    self%doubtful = .not. self%energy <= self%most()
  end subroutine look

  !> Whether the energies must be looked at after `step` steps, since nobody has for long.
  pure logical function look_is_due(self, step)
    class(watch_type), intent(in) :: self
    integer, intent(in) :: step
    look_is_due = self%looked < 0 .or. is_long(self%looked, step)
  end function look_is_due

  !> Whether the state after `step` steps is to be kept, because its energies were looked at and
  !> agreed, and the one that is kept is old. The caller keeps it.
  logical function keeps(self, step)
    class(watch_type), intent(inout) :: self
    integer, intent(in) :: step
    keeps = self%sound .and. self%looked == step .and. self%energy <= good*self%supply
    if (keeps .and. self%kept >= 0) keeps = is_long(self%kept, step)
    if (keeps) self%kept = step
  end function keeps

  !> Whether it is long from one step to another: steps 50, 100, 200, 400, 800, 1200, ...
  pure logical function is_long(from, to)
    integer, intent(in) :: from, to
    is_long = to - from >= min(longest, max(first_look, from))
  end function is_long

  !> Note the work of loads and imposed motion since the start [J], in every step. A load that has
  !> just begun to push has given velocity, but its work is known a step later; hence a look that
  !> found too much is judged then.
  pure subroutine supplied(self, work)
    class(watch_type), intent(inout) :: self
    real(wp), intent(in) :: work
    if (self%looked < 0) return
    self%supply = max(self%supply, self%start + work, 0.0_wp)
    if (self%doubtful .and. .not. self%energy <= self%most()) self%sound = .false.
    self%doubtful = .false.
  end subroutine supplied

  !> Look at the kinetic energy alone [J], at any step.
  pure subroutine look_at_kinetic(self, kinetic)
    class(watch_type), intent(inout) :: self
    real(wp), intent(in) :: kinetic
    if (self%supply < 0.0_wp .or. kinetic <= self%most()) return
    self%sound = .false.
    self%energy = kinetic
  end subroutine look_at_kinetic

  !> The energy beyond which there is too much [J].
  pure real(wp) function most(self)
    class(watch_type), intent(in) :: self
    most = too_much*self%supply + self%rounding
  end function most

  !> The energy that was found and the greatest one that there can have been [J].
  pure subroutine found(self, energy, supply)
    class(watch_type), intent(in) :: self
    real(wp), intent(out) :: energy, supply
    energy = self%energy
    supply = self%supply
  end subroutine found

end module pd_motion_watch
