!> The last good state of a motion: kept while it runs, and shown to the observer when the motion
!> has gone wrong.
module pd_motion_watch_rescue
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp
  use pd_base_snapshot, only: snapshot_type
  use pd_motion_keep, only: keep_system
  use pd_motion_observer, only: observer_type, instant_type
  use pd_motion_account, only: energies_type, energies_of, velocities_now
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: good_state_type, keep_good, show_good

  type :: good_state_type
    private
    type(snapshot_type) :: snapshot
    type(instant_type) :: instant
    real(wp) :: most = huge(1.0_wp)   !! energy beyond which it is no good one after all [J]
    logical :: there = .false.
  end type good_state_type

contains

  !> Keep the state of this instant, whose forces are known, in the place of the one before. If it
  !> is ever wanted, it must not have more energy than `most` [J]: computing that costs as much as
  !> several steps.
  subroutine keep_good(good, system, instant, most)
    type(good_state_type), intent(inout) :: good  !! gets this state
    type(system_type), intent(inout) :: system  !! left as it is
    type(instant_type), intent(in) :: instant  !! of the state
    real(wp), intent(in), optional :: most     !! energy that the state may have; any by default [J]

    call good%snapshot%rewind(reading=.false.)
    call keep_system(good%snapshot, system)
    good%instant = instant
    good%most = huge(good%most)
    if (present(most)) good%most = most
    good%there = .not. allocated(good%snapshot%error)
  end subroutine keep_good

  !> Put the last good state back and let the observer see it as what is left of the motion. An
  !> error in writing it goes to the end of `error`, the fault that ended the motion.
  subroutine show_good(good, system, observer, error)
    type(good_state_type), intent(inout) :: good
      !! the last good state; without one nothing is done
    type(system_type), intent(inout) :: system       !! in that state on return
    class(observer_type), intent(inout) :: observer  !! sees that state
    type(error_type), allocatable, intent(inout) :: error
    type(error_type), allocatable :: late
    type(energies_type) :: energies
    real(wp), allocatable :: v(:, :)

    if (.not. good%there) return
    call good%snapshot%rewind(reading=.true.)
    call keep_system(good%snapshot, system)
    if (allocated(good%snapshot%error)) return
    system%time = good%instant%time
    if (good%most < huge(good%most)) then
      call velocities_now(system, good%instant%time, good%instant%kick, v)
      call energies_of(system, v, energies)
      if (.not. energies%kinetic + energies%strain + system%dissipated <= good%most) return
    end if
    good%instant%rescued = .true.
    call observer%observe(system, good%instant, late)
    if (allocated(late)) error%message = error%message//new_line('a')//'  '//late%message
  end subroutine show_good

end module pd_motion_watch_rescue
