!> The watch over the energy of a motion: what moves cannot have more of it than was there at the
!> start and has been supplied since (doc/theory.md, 9).
!>
!> Every few steps the integrator compares the kinetic energy, which alone must not exceed what was
!> supplied: what is unstable grows at the highest frequencies, where a good half of the energy is
!> motion at any step. Strain and dissipated energy are added when all energies are
!> computed: for the history, or by the integrator if that is long ago, since the strain energy
!> costs as much as several steps.
module pd_motion_energy_watch
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: watch_type

  !> A wave of frequency omega keeps an energy that differs from this one by
  !> 1/(1 - (omega dt/2)^2), which is 50 at 0.99 of the limit; beyond the limit it grows without
  !> end.
  real(wp), parameter :: too_much = 100.0_wp
  !> More than the balance is off at any stable step, bonds that break included (doc/theory.md, 9).
  real(wp), parameter :: good = 1.1_wp
  integer, parameter :: kinetic_every = 10  !! steps between checks of the kinetic energy
  integer, parameter :: all_every = 2000    !! most steps between checks of all energies
  integer, parameter :: first_kept = 50     !! steps; then at 100, 200, 400, 800, 1200, ...
  integer, parameter :: longest = 400       !! steps from one state that is kept to the next

  type :: watch_type
    private
    real(wp), public :: rounding = 0.0_wp  !! energy that is none [J]
    real(wp), public :: heaviest = 0.0_wp  !! mass of a point [kg]
    real(wp) :: start = 0.0_wp             !! energy at the start, without what was supplied [J]
    real(wp) :: supply = -1.0_wp           !! greatest energy that there can have been [J]
    real(wp) :: energy = 0.0_wp            !! at the last check [J]
    real(wp) :: kinetic = 0.0_wp           !! at the last check of it alone [J]
    logical :: exceeded = .false.          !! the last check found too much
    integer :: checked = -1                !! step of the last check, -1: none yet
    integer :: kept = -1                   !! step of the last state that was kept
    logical, public :: sound = .true.      !! nothing has been found
  contains
    procedure :: check
    procedure :: check_is_due
    procedure :: keeps
    procedure :: check_kinetic
    procedure :: kinetic_is_due
    procedure :: most_of_good
    procedure :: supplied
    procedure :: found
    procedure, private :: is_old
    procedure, private :: most
  end type watch_type

contains

  !> Check all energies after `step` steps [J]. The first check takes them as the start.
  pure subroutine check(self, step, kinetic, strain, dissipated, work)
    class(watch_type), intent(inout) :: self  !! with the result in `exceeded` on return
    integer, intent(in) :: step               !! complete steps
    real(wp), intent(in) :: kinetic           !! kinetic energy [J]
    real(wp), intent(in) :: strain            !! strain energy and what terms of the force store [J]
    real(wp), intent(in) :: dissipated        !! energy lost since the start [J]
    real(wp), intent(in) :: work              !! of loads and imposed motion since the start [J]

    self%energy = kinetic + strain + dissipated
    if (self%checked < 0) self%start = self%energy - work
    self%checked = step
    call self%supplied(work)
    self%exceeded = .not. self%energy <= self%most()
  end subroutine check

  !> Whether all energies must be checked after `step` steps, since the last check is long ago.
  pure logical function check_is_due(self, step)
    class(watch_type), intent(in) :: self  !! the watch
    integer, intent(in) :: step            !! complete steps
    check_is_due = self%checked < 0 .or. step - self%checked >= all_every
  end function check_is_due

  !> Whether the kinetic energy must be checked after `step` steps: from time to time, if it may
  !> be too much, and before a state is kept. `bound` is what it does not exceed [J].
  pure logical function kinetic_is_due(self, step, bound)
    class(watch_type), intent(in) :: self  !! the watch
    integer, intent(in) :: step            !! complete steps
    real(wp), intent(in) :: bound          !! that the kinetic energy does not exceed [J]
    kinetic_is_due = mod(step, kinetic_every) == 0
    if (kinetic_is_due) kinetic_is_due = .not. bound <= self%most() .or. &
      & (self%checked < step .and. self%is_old(step))
  end function kinetic_is_due

  !> Whether the state after `step` steps is to be kept, because the one that is kept is old and the
  !> energies agree: all of them, if they were just checked, or the kinetic energy, which was
  !> then, if the last check of all is long ago. The caller keeps it.
  logical function keeps(self, step)
    class(watch_type), intent(inout) :: self  !! notes the step if its state is to be kept
    integer, intent(in) :: step               !! complete steps

    keeps = self%sound .and. self%is_old(step)
    if (.not. keeps) return
    if (self%checked == step) then
      keeps = self%energy <= self%most_of_good()
    else
      keeps = mod(step, kinetic_every) == 0 .and. self%kinetic <= self%most_of_good()
    end if
    if (keeps) self%kept = step
  end function keeps

  !> Whether the state that is kept is old after `step` steps, and so is the last check, unless it
  !> is of this step.
  pure logical function is_old(self, step)
    class(watch_type), intent(in) :: self
    integer, intent(in) :: step
    is_old = self%kept < 0
    if (.not. is_old) is_old = is_long(self%kept, step)
    if (self%checked >= 0 .and. self%checked < step) &
      & is_old = is_old .and. is_long(self%checked, step)
  end function is_old

  !> The energy beyond which a state is not a good one [J].
  pure real(wp) function most_of_good(self)
    class(watch_type), intent(in) :: self  !! the watch
    most_of_good = good*self%supply
  end function most_of_good

  !> Whether it is long from one step to another: steps 50, 100, 200, 400, 800, 1200, ...
  pure logical function is_long(from, to)
    integer, intent(in) :: from, to
    is_long = to - from >= min(longest, max(first_kept, from))
  end function is_long

  !> Note the work of loads and imposed motion since the start [J], in every step. A load that has
  !> just begun to push has given velocity, but its work is known a step later; hence a check that
  !> found too much is judged then.
  pure subroutine supplied(self, work)
    class(watch_type), intent(inout) :: self
      !! with the greatest energy that there can have been, and `sound` brought up to date
    real(wp), intent(in) :: work  !! of loads and imposed motion since the start [J]
    if (self%checked < 0) return
    self%supply = max(self%supply, self%start + work, 0.0_wp)
    if (self%exceeded .and. .not. self%energy <= self%most()) self%sound = .false.
    self%exceeded = .false.
  end subroutine supplied

  !> Check the kinetic energy alone [J], at any step.
  pure subroutine check_kinetic(self, kinetic)
    class(watch_type), intent(inout) :: self  !! not `sound` on return if this is too much
    real(wp), intent(in) :: kinetic           !! kinetic energy [J]
    self%kinetic = kinetic
    if (self%supply < 0.0_wp .or. kinetic <= self%most()) return
    self%sound = .false.
    self%energy = kinetic
  end subroutine check_kinetic

  !> The energy beyond which there is too much [J].
  pure real(wp) function most(self)
    class(watch_type), intent(in) :: self
    most = too_much*self%supply + self%rounding
  end function most

  !> The energy that was found and the greatest one that there can have been [J].
  pure subroutine found(self, energy, supply)
    class(watch_type), intent(in) :: self  !! the watch
    real(wp), intent(out) :: energy  !! at the last check, or the kinetic one that was too much [J]
    real(wp), intent(out) :: supply  !! greatest energy that there can have been [J]
    energy = self%energy
    supply = self%supply
  end subroutine found

end module pd_motion_energy_watch
