!> Observers of a motion: integrators and relaxation call one once per step, and know nothing of
!> files and terminals.
module pd_motion_observer
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: observer_type, instant_type, add_note

  !> One instant of a motion.
  type :: instant_type
    integer :: step = 0               !! complete steps (iterations in relaxation)
    integer :: load_step = 0          !! relaxation
    integer :: iteration = 0          !! relaxation: iterations in this load step
    logical :: dynamic = .false.      !! relaxation: they are those of dynamic relaxation
    real(wp) :: time = 0.0_wp         !! [s]; relaxation: 0 to 1 over the load steps
    real(wp) :: dt = 0.0_wp           !! step size [s]
    real(wp) :: kick = 0.0_wp         !! velocities at this instant are v + kick*force/rho [s]
    real(wp) :: residual = 0.0_wp     !! relaxation: relative residual force [-]
    real(wp) :: change = 0.0_wp       !! relaxation: change of displacement over displacement [-]
    character(:), allocatable :: note !! a warning for the user about this instant
    logical :: last = .false.         !! the final state
    logical :: settled = .true.       !! relaxation: a load step has converged
    logical :: between = .false.      !! growth by events: a settled state between load steps
    integer :: events = 0             !! growth by events: batches of bonds broken so far
    logical :: gave_way = .false.     !! the conjugate gradient left this to dynamic relaxation
    logical :: rescued = .false.      !! the last good state of a motion that has gone wrong since
  end type instant_type

  type, abstract :: observer_type
  contains
    procedure(observe_interface), deferred :: observe
  end type observer_type

  abstract interface
    !> Called after the forces of an instant are known. An error ends the motion.
    subroutine observe_interface(observer, system, instant, error)
      import :: observer_type, system_type, instant_type, error_type
      implicit none (type, external)
      class(observer_type), intent(inout) :: observer  !! the observer
      type(system_type), intent(inout) :: system       !! with its forces; its state must stay
      type(instant_type), intent(in) :: instant        !! which one it is
      type(error_type), allocatable, intent(out) :: error
    end subroutine observe_interface
  end interface

contains

  !> Add to the warnings for the user at this instant.
  pure subroutine add_note(instant, text)
    type(instant_type), intent(inout) :: instant  !! with this text behind what it had to tell
    character(*), intent(in) :: text   !! '' adds nothing

    if (text == '') return
    if (allocated(instant%note)) then
      if (instant%note /= '') then
        instant%note = instant%note//'; '//text
        return
      end if
    end if
    instant%note = text
  end subroutine add_note

end module pd_motion_observer
