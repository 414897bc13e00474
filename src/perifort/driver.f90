!> From a scene to its results, in the steps of chapter 7.
module pd_driver
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_error, only: error_type
  use pd_base_interrupt, only: handlers_type, let_writes_fail, put_back_handlers, &
    & signal_handlers, watch_for_interrupt
  use pd_comm_world, only: begin_world, world_type
  use pd_force_terms, only: term_list_type
  use pd_motion_observer, only: observer_type
  use pd_output_report_begin, only: run_options_type
  use pd_output_report_pair, only: pair_type
  use pd_output_results_answer, only: answer_type
  use pd_output_run, only: run_output_type
  use pd_scene_content_complete, only: complete_scene
  use pd_scene_content_types, only: scene_type
  use pd_set_up_move, only: move
  use pd_set_up_prepare, only: prepare, set_up_type
  implicit none (type, external)
  private
  public :: run_scene

contains

  !> Compute a scene and write its results. The scene, which may have been read from a file or built
  !> in memory, is completed and checked first; the caller's stays as it is. Number of threads and
  !> handlers of signals are the caller's again thereafter.
  subroutine run_scene(scene, options, error, observer, answer, terms)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options    !! how, where to, with how many threads
    type(error_type), allocatable, intent(out) :: error
    !> sees every instant; an error with `status_interrupted` stops the run in order, others end it
    class(observer_type), intent(inout), optional, target :: observer
    !> results in memory, those before an error included
    type(answer_type), intent(out), optional :: answer
    !> that act on the points beside their bonds, loads and boundaries
    type(term_list_type), intent(in), optional :: terms
    type(scene_type) :: complete
    type(handlers_type) :: handlers
    integer :: threads

    complete = scene
    call complete_scene(complete, error)
    if (allocated(error)) return
    threads = omp_get_max_threads()
    handlers = signal_handlers()
    call compute(complete, options, error, observer, answer, terms)
    call put_back_handlers(handlers)
    call omp_set_num_threads(threads)
  end subroutine run_scene

  !> `run_scene` of a complete scene, with signals and threads of its own.
  subroutine compute(scene, given, error, observer, answer, terms)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: given
    type(error_type), allocatable, intent(out) :: error
    class(observer_type), intent(inout), optional, target :: observer
    type(answer_type), intent(out), optional :: answer
    type(term_list_type), intent(in), optional :: terms
    type(run_options_type) :: own
    type(set_up_type) :: set_up
    type(run_output_type), target :: output
    type(pair_type) :: watchers
    type(world_type), target :: world

    own = given
    call let_writes_fail()
    call begin_world(world)
    world%reproducible = own%reproducible
    ! the first rank writes and speaks for all
    own%quiet = own%quiet .or. world%rank > 0
    call output%look_back(scene, own, world, error)
    if (allocated(error) .or. output%complete) return

    ! points and families (7.1, 7.11), volumes (7.2) and surfaces (7.7), conditions (7.8), cracks
    ! and no-fail zones (7.9), and the time step (7.4) or the mass of relaxation (7.5)
    call prepare(scene, set_up, error, own%threads, terms, world, own%quiet)
    if (.not. allocated(error)) call output%foresee(scene, own, set_up, error)
    if (allocated(error)) return

    call output%open(scene, own, set_up, present(answer), error)
    if (allocated(error) .or. output%complete) return
    watchers%recorder => output%recorder
    if (present(observer)) watchers%own => observer
    call watch_for_interrupt()
    call world%count_anew()

    ! integration in time (7.3) or load steps to equilibrium (7.5), with breaking (7.9, 7.10)
    call move(set_up%system, set_up%plan, watchers, error)

    call output%close(scene, own, set_up, .not. watchers%own_fault, error)
    if (present(answer)) call output%answer(answer)
  end subroutine compute

end module pd_driver
