!> The output of one run, from what is there of earlier ones to the last word: the driver's partner.
!>
!>     call output%look_back(scene, options, world, error)   ! earlier results, a checkpoint
!>     call output%foresee(scene, options, set_up, error)      ! measures, schedule, warnings
!>     call output%open(scene, options, set_up, error)
!>     ...                                            ! the motion, seen by output%recorder
!>     call output%close(scene, options, set_up, error)
module pd_output_run
  use pd_base_error, only: error_type, status_input, status_interrupted
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: newline, to_text
  use pd_motion_keep, only: checksum_of_points, checksum_of_start
  use pd_output_checkpoint_earlier, only: mark_complete, refuse_existing
  use pd_comm_world, only: world_type
  use pd_output_checkpoint_restart, only: find_restart, put_back, restart_type
  use pd_output_fields_check, only: check_names
  use pd_output_report_after, only: summary_after
  use pd_output_report_before, only: foresee_output
  use pd_output_report_begin, only: command_of, fields_of, keep_checkpoints, open_recorder, &
    & output_directory, run_options_type, stem_of, text_of
  use pd_output_measures_measure, only: measure_list_type
  use pd_output_report_recorder, only: recorder_type
  use pd_output_report_say, only: say
  use pd_output_report_summary, only: summary_before
  use pd_output_results_answer, only: answer_type
  use pd_scene_content_rules, only: place_fault
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: set_up_type
  implicit none (type, external)
  private
  public :: run_output_type

  real(wp), parameter :: large_balance = 0.1_wp      !! error, of the energy in play
  real(wp), parameter :: large_dissipation = 0.05_wp !! error, of the dissipated energy

  type :: run_output_type
    type(recorder_type) :: recorder           !! sees the motion
    logical :: complete = .false.             !! there is nothing to compute: all is there already
    type(restart_type), private :: restart
    type(measure_list_type), private :: measures  !! of the history
    character(:), allocatable, private :: directory  !! '' = no files
    character(:), allocatable, private :: stem
    character(:), allocatable, private :: folder     !! of checkpoints, which all ranks write
  contains
    procedure :: look_back
    procedure :: foresee
    procedure :: open => open_output
    procedure :: close => close_output
    procedure :: answer
  end type run_output_type

contains

  !> See to it that the scene's fields are known and that no earlier results are overwritten
  !> unasked, or find the checkpoint from which a run continues.
  subroutine look_back(self, scene, options, world, error)
    class(run_output_type), intent(inout) :: self
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    type(world_type), intent(inout) :: world   !! the ranks of the run
    type(error_type), allocatable, intent(out) :: error

    call check_names(scene, fields_of(options), error)
    if (allocated(error)) return
    self%stem = stem_of(scene)
    self%folder = output_directory(scene, options)
    self%restart%rank = world%rank
    self%restart%ranks = world%ranks
    self%directory = self%folder
    if (world%rank > 0) self%directory = ''
    if (self%folder == '') return
    if (options%restart) then
      call find_restart(self%folder, self%stem, text_of(options%checkpoint), scene, &
        & command_of(options), world, self%restart, error)
      if (allocated(error)) return
      call say(self%restart%note, options%quiet)
      self%complete = self%restart%complete
    else if (world%rank == 0) then
      call refuse_existing(self%directory, self%stem, options%overwrite, error)
    end if
  end subroutine look_back

  !> Data of the output known before the first step; warnings and notes go to the set-up.
  subroutine foresee(self, scene, options, set_up, error)
    class(run_output_type), intent(inout) :: self
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    type(set_up_type), intent(inout) :: set_up
    type(error_type), allocatable, intent(out) :: error
    call foresee_output(scene, fields_of(options), set_up, self%measures, error)
  end subroutine foresee

  !> Set the system to the state of its checkpoint, if there is one, print the summary, and open the
  !> files. With `in_memory` the last output stays in memory, too.
  subroutine open_output(self, scene, options, set_up, in_memory, error)
    class(run_output_type), intent(inout) :: self
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    type(set_up_type), intent(inout) :: set_up
    logical, intent(in) :: in_memory
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: start, points

    associate (system => set_up%system, plan => set_up%plan, recorder => self%recorder)
      start = checksum_of_start(system)
      points = checksum_of_points(system)
      if (self%restart%found) call put_back(self%restart, scene, points, system, plan, &
        & self%measures, error)
      if (allocated(error)) return
      self%complete = self%restart%complete
      if (self%complete) then
        call say('  complete        the run has as many steps already', options%quiet)
        return
      end if
      call say(summary_before(scene, system, plan, self%measures, set_up%cut, set_up%warnings, &
        & set_up%notes, set_up%team%threads()), options%quiet)
      recorder%timer = set_up%timer
      recorder%team = set_up%team
      recorder%measures = self%measures
      recorder%warnings = set_up%warnings
      call open_recorder(scene, options, system, plan, self%folder, self%stem, self%restart, &
        & recorder, in_memory, error)
      if (allocated(error)) return
      call keep_checkpoints(scene, options, plan, start, points, self%folder, self%restart, &
        & recorder)
      call recorder%timer%start(recorder%phase())
    end associate
  end subroutine open_output

  !> After the motion: judge the energy balance, close the files, keep the end, and say what it came
  !> to. An error of the motion stays and gets what is to be said of it; `place_it`: one that it
  !> found in the input gets a place in the scene.
  subroutine close_output(self, scene, options, set_up, place_it, error)
    class(run_output_type), intent(inout) :: self
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    type(set_up_type), intent(inout) :: set_up
    logical, intent(in) :: place_it
    type(error_type), allocatable, intent(inout) :: error
    type(error_type), allocatable :: late
    real(wp) :: balance, share, of_dissipated
    logical :: stopped

    associate (system => set_up%system, recorder => self%recorder)
      if (allocated(error)) then
        ! what the motion finds wrong with the input, it finds before the first iteration
        if (error%status == status_input .and. recorder%rows == 0 .and. place_it) &
          & call place_fault(error, scene, 'time', 1, 'method')
        if (allocated(recorder%rescued)) error%message = error%message//newline//'  '// &
          & recorder%rescued
      end if
      call recorder%timer%stop(recorder%phase())
      call recorder%progress%finish()
      call recorder%energy_balance(system, balance, share, of_dissipated)
      if (.not. allocated(error)) call warn_of_balance(recorder, share, of_dissipated)
      call recorder%results%put_warnings(recorder%warnings%text())
      stopped = .false.
      if (allocated(error)) stopped = error%status == status_interrupted
      call recorder%results%close(late, stopped, keep_mark=.true.)
      if (.not. allocated(error) .and. allocated(late)) call move_alloc(late, error)
      if (allocated(error)) return
      ! the end is kept when the results are complete, and then the mark of unfinished ones goes
      system%memory%step = recorder%steps_done
      if (recorder%checkpoint%keeps_end()) call recorder%keep_state(system, finished=.true.)
      if (self%directory /= '') call mark_complete(self%directory, self%stem)
      call say(summary_after(system, recorder, self%directory), options%quiet)
    end associate
  end subroutine close_output

  !> The results in memory.
  subroutine answer(self, found)
    class(run_output_type), intent(in) :: self
    type(answer_type), intent(out) :: found
    call self%recorder%results%answer(found)
  end subroutine answer

  !> Warn of a large error of the energy balance: relative to the largest energy, or to the
  !> dissipated energy.
  subroutine warn_of_balance(recorder, share, of_dissipated)
    type(recorder_type), intent(inout) :: recorder
    real(wp), intent(in) :: share          !! of the energy in play [-], < 0 without a balance
    real(wp), intent(in) :: of_dissipated
      !! of the dissipated energy [-], < 0 where that is no noticeable part of the energy

    if (share > large_balance) then
      call recorder%warn('balance', 'the energy balance is off by '//to_text(100*share, 2)// &
        & ' % of the energy: the answer is not reliable; a smaller step may help')
    else if (of_dissipated > large_dissipation) then
      call recorder%warn('dissipation', 'the energy balance is off by '// &
        & to_text(100*of_dissipated, 2)// &
        & ' % of the dissipated energy, which is known no better; a smaller step helps')
    end if
  end subroutine warn_of_balance

end module pd_output_run
