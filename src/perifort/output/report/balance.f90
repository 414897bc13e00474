!> The balance of energy over the rows of a run's history.
module pd_output_report_balance
  use pd_base_kinds, only: wp
  use pd_motion_account, only: energies_type
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: balance_type

  !> Dissipated energy that the balance is compared with, of the energy in play [-]: that of a few
  !> bonds, or of a contact that hardly slides, is less than any step gets right.
  real(wp), parameter :: noticeable = 1.0e-3_wp

  !> What the balance is made from.
  type :: balance_type
    type(energies_type) :: energies      !! of the last row
    real(wp) :: supply = 0.0_wp          !! energy at the first row, with breaking at t = 0 [J]
  contains
    procedure :: begin
    procedure :: gap
  end type balance_type

contains

  !> Take the energy of the first row as the initial energy.
  pure subroutine begin(balance, system)
    class(balance_type), intent(inout) :: balance
    type(system_type), intent(in) :: system
    balance%supply = balance%energies%kinetic + balance%energies%strain + system%dissipated
  end subroutine begin

  !> Deviation of the energies of the last row from the initial plus the supplied energy.
  pure subroutine gap(balance, system, off, share, of_dissipated)
    class(balance_type), intent(in) :: balance
    type(system_type), intent(in) :: system
    real(wp), intent(out) :: off         !! [J]
    real(wp), intent(out) :: share       !! of the energy in play [-], -1 where there is none
    real(wp), intent(out) :: of_dissipated
      !! share of the dissipated energy [-], -1 unless this is a noticeable part of that in play
    real(wp) :: supply, largest

    share = -1.0_wp
    of_dissipated = -1.0_wp
    supply = balance%supply + system%external_work
    associate (now => balance%energies)
      off = now%kinetic + now%strain + system%dissipated - supply
      largest = max(abs(now%kinetic) + abs(now%strain) + system%dissipated, abs(supply))
    end associate
    if (largest > 0.0_wp) share = abs(off)/largest
    if (abs(system%dissipated) > noticeable*largest) of_dissipated = abs(off/system%dissipated)
  end subroutine gap

end module pd_output_report_balance
