!> The recorder of a run, and an observer of the caller's own beside it.
module pd_output_report_pair
  use pd_base_error, only: error_type, status_interrupted
  use pd_motion_observer, only: instant_type, observer_type
  use pd_motion_system, only: system_type
  use pd_output_report_recorder, only: recorder_type
  implicit none (type, external)
  private
  public :: pair_type

  type, extends(observer_type) :: pair_type
    type(recorder_type), pointer :: recorder => null()  !! of the run
    class(observer_type), pointer :: own => null()      !! of the caller, if there is one
    logical :: own_fault = .false.                      !! the caller's has ended the run
  contains
    procedure :: observe
  end type pair_type

  character(*), parameter :: phase = 'own observer'  !! in the table of times

contains

  !> Let the caller's observer see the instant, then the recorder. An error of the former with
  !> `status_interrupted` stops the run in order: the recorder writes this state first. The last
  !> good state of a diverged run is passed only to the recorder.
  subroutine observe(observer, system, instant, error)
    class(pair_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(error_type), allocatable, intent(out) :: error

    if (associated(observer%own) .and. .not. instant%rescued) then
      associate (timer => observer%recorder%timer)
        call timer%stop(observer%recorder%phase())
        call timer%start(phase)
        call observer%own%observe(system, instant, error)
        call timer%stop(phase)
        call timer%start(observer%recorder%phase())
      end associate
      if (allocated(error)) then
        observer%own_fault = error%status /= status_interrupted
        if (observer%own_fault) return
        observer%recorder%wish = error%message
        deallocate (error)
      end if
    end if
    call observer%recorder%observe(system, instant, error)
  end subroutine observe

end module pd_output_report_pair
