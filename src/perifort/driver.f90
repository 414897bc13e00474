!> From a scene to its results, in the steps of chapter 7: points, families, cracks, surface
!> correction, initial and boundary conditions, time step or mass, integration.
module pd_driver
  use, intrinsic :: iso_fortran_env, only: output_unit
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_kinds, only: wp, i8
  use pd_base_error, only: error_type, status_input, status_interrupted
  use pd_base_interrupt, only: let_writes_fail, watch_for_interrupt
  use pd_base_text, only: newline, printable, to_text
  use pd_scene_content_types, only: scene_type
  use pd_scene_content_write, only: scene_text
  use pd_motion_explicit_integrators, only: run_explicit, begin_steps => begin_memory
  use pd_motion_keep, only: checksum_of_start
  use pd_motion_static_relaxation, only: run_relaxation, fill_memory
  use pd_motion_system, only: system_type, account
  use pd_output_report_begin, only: run_options_type, open_recorder, keep_checkpoints, &
    & output_directory, stem_of, command_of, text_of, fields_of
  use pd_output_checkpoint_checkpoint, only: about_type, checkpoint_bytes, new_about
  use pd_output_checkpoint_earlier, only: mark_complete, refuse_existing
  use pd_output_report_estimate, only: estimate
  use pd_output_report_overview, only: overview
  use pd_output_report_columns, only: history_columns
  use pd_output_report_probes, only: probe_type
  use pd_output_report_recorder, only: recorder_type
  use pd_output_report_schedule, only: planned_outputs, planned_rows, schedule_of, schedule_type
  use pd_output_checkpoint_restart, only: find_restart, put_back, restart_type
  use pd_output_report_after, only: summary_after
  use pd_output_report_summary, only: checkpoint_line, summary_before
  use pd_scene_content_rules, only: place_fault
  use pd_set_up_prepare, only: prepare, set_up_type
  use pd_output_fields_check, only: check_names
  use pd_output_report_before, only: foresee_output
  implicit none (type, external)
  private
  public :: run_scene, check_scene

  real(wp), parameter :: doubtful_balance = 0.1_wp      !! of the energy in play
  real(wp), parameter :: doubtful_dissipation = 0.05_wp !! of the dissipated energy

contains

  !> Compute a scene and write its results. The caller's number of threads is as it was thereafter.
  subroutine run_scene(scene, options, error)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options    !! how, where to, with how many threads
    type(error_type), allocatable, intent(out) :: error
    integer :: threads

    threads = omp_get_max_threads()
    call compute(scene, options, error)
    call omp_set_num_threads(threads)
  end subroutine run_scene

  !> Read, validate, build points and families, and say what a run would do, without running. The
  !> caller's number of threads is as it was thereafter.
  subroutine check_scene(scene, options, error)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options    !! with how many threads
    type(error_type), allocatable, intent(out) :: error
    integer :: threads

    threads = omp_get_max_threads()
    call examine(scene, options, error)
    call omp_set_num_threads(threads)
  end subroutine check_scene

  !> `run_scene` with threads of its own number.
  subroutine compute(scene, options, error)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(probe_type), allocatable :: probes(:)
    type(restart_type) :: restart
    type(recorder_type) :: recorder
    type(error_type), allocatable :: late
    character(:), allocatable :: directory, stem
    integer(i8) :: start
    logical :: stopped
    real(wp) :: balance, share

    call let_writes_fail()
    stem = stem_of(scene)
    directory = output_directory(scene, options)
    if (options%restart) then
      call find_restart(directory, stem, text_of(options%checkpoint), scene, &
        & command_of(options), restart, error)
      if (allocated(error)) return
      call say(options, restart%note)
      if (restart%complete) return
    else
      call refuse_existing(directory, stem, options%overwrite, error)
      if (allocated(error)) return
    end if
    call check_names(scene, fields_of(options), error)
    if (.not. allocated(error)) call prepare(scene, set_up, error, options%threads)
    if (allocated(error)) return
    call foresee_output(scene, fields_of(options), set_up, probes, error)
    if (allocated(error)) return
    associate (system => set_up%system, plan => set_up%plan)
      start = checksum_of_start(system)
      if (restart%found) call put_back(restart, scene, system, plan, error)
      if (allocated(error)) return
      if (restart%complete) then
        call say(options, '  complete        the run has as many steps already')
        return
      end if
      call say(options, summary_before(scene, system, plan, probes, set_up%cut, &
        & set_up%warnings, set_up%notes, set_up%team%threads()))
      recorder%timer = set_up%timer
      recorder%team = set_up%team
      recorder%probes = probes
      recorder%warnings = set_up%warnings
      call open_recorder(scene, options, system, plan, directory, stem, restart, recorder, error)
      if (allocated(error)) return
      call keep_checkpoints(scene, options, plan, start, directory, stem, restart, recorder)
      call watch_for_interrupt()
      system%stable_step = plan%limit
      call recorder%timer%start('time stepping')
      if (plan%relaxes) then
        call run_relaxation(system, plan%relaxation, recorder, error)
      else
        call run_explicit(system, plan%integrator, plan%step, plan%steps, recorder, error)
      end if
      if (allocated(error)) then
        ! what the motion finds wrong with the input, it finds before the first iteration
        if (error%status == status_input .and. recorder%rows == 0) &
          & call place_fault(error, scene, 'time', 1, 'method')
        if (allocated(recorder%rescued)) error%message = error%message//newline//'  '// &
          & recorder%rescued
      end if
      call recorder%timer%stop('time stepping')
      call recorder%progress%finish()
      call recorder%energy_balance(system, balance, share)
      if (.not. allocated(error)) call warn_of_balance(system, recorder, balance, share)
      call recorder%results%put_warnings(recorder%warnings%text())
      stopped = .false.
      if (allocated(error)) stopped = error%status == status_interrupted
      call recorder%results%close(late, stopped, keep_mark=.true.)
      if (.not. allocated(error) .and. allocated(late)) call move_alloc(late, error)
      if (allocated(error)) return
      ! the end is kept when the results are complete, and then the mark of unfinished ones goes
      system%memory%step = recorder%steps_done
      if (recorder%checkpoint%keeps_end()) call recorder%keep_state(system, finished=.true.)
      call mark_complete(directory, stem)
      call say(options, summary_after(system, recorder, directory))
    end associate
  end subroutine compute

  !> Warn if energy was gained or lost that nothing explains: much of what is in play, or, where
  !> bonds have broken, much of what they dissipated.
  subroutine warn_of_balance(system, recorder, balance, share)
    type(system_type), intent(in) :: system
    type(recorder_type), intent(inout) :: recorder
    real(wp), intent(in) :: balance  !! energy that nothing explains [J]
    real(wp), intent(in) :: share    !! its size over the energy in play [-], < 0 without a balance

    if (share > doubtful_balance) then
      call recorder%warn('balance', 'the energy balance is off by '//to_text(100*share, 2)// &
        & ' % of the energy: the answer is not reliable; a smaller step may help')
    else if (share >= 0.0_wp .and. abs(system%dissipated) > 0.0_wp .and. &
      & abs(balance) > doubtful_dissipation*abs(system%dissipated)) then
      call recorder%warn('dissipation', 'the energy balance is off by '// &
        & to_text(100*abs(balance/system%dissipated), 2)// &
        & ' % of the dissipated energy, which is known no better; a smaller step helps')
    end if
  end subroutine warn_of_balance

  !> `check_scene` with threads of its own number.
  subroutine examine(scene, options, error)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(probe_type), allocatable :: probes(:)
    character(:), allocatable :: text

    call check_names(scene, fields_of(options), error)
    if (.not. allocated(error)) call prepare(scene, set_up, error, options%threads)
    if (allocated(error)) return
    call foresee_output(scene, fields_of(options), set_up, probes, error)
    if (allocated(error)) return
    associate (system => set_up%system, plan => set_up%plan)
      call say(options, summary_before(scene, system, plan, probes, set_up%cut, &
        & set_up%warnings, set_up%notes, set_up%team%threads()))
      call say_lines(overview(scene, system, .not. plan%relaxes))
      call estimate(scene, fields_of(options), system, plan, &
        & schedule_of(scene, plan, system%family%n_bonds), set_up%timer%total(), text)
      call say_lines(text)
      call say(options, checkpoint_line(scene, bytes_of_checkpoint(scene, set_up, probes)))
    end associate

  contains

    !> Print lines that end with a newline.
    subroutine say_lines(lines)
      character(*), intent(in) :: lines
      if (len(lines) > 0) call say(options, lines(:len(lines) - 1))
    end subroutine say_lines
  end subroutine examine

  !> Bytes of the last checkpoint of a run, which has all that it carries, or of a relaxation's
  !> largest.
  integer(i8) function bytes_of_checkpoint(scene, set_up, probes) result(bytes)
    type(scene_type), intent(in) :: scene
    type(set_up_type), intent(inout) :: set_up
    type(probe_type), intent(in) :: probes(:)
    type(about_type) :: about
    type(schedule_type) :: schedule
    integer :: columns

    associate (system => set_up%system, plan => set_up%plan)
      schedule = schedule_of(scene, plan, system%family%n_bonds)
      about = new_about(scene_text(scene), 0_i8, plan%steps, plan%step)
      columns = size(history_columns(system, probes, plan%relaxes))
      allocate (about%kept%rows(columns, 0), about%kept%times(0))
      call account(system, 0.0_wp)
      if (plan%relaxes) then
        call fill_memory(system, plan%relaxation)
      else
        call begin_steps(system, plan%integrator)
      end if
      ! rows and times are counted and not made: a long run may have more than fit into the memory
      bytes = checkpoint_bytes(about, system) + 8*(int(columns, i8)*planned_rows(schedule) &
        & + planned_outputs(schedule, plan%step))
    end associate
  end function bytes_of_checkpoint

  subroutine say(options, text)
    type(run_options_type), intent(in) :: options
    character(*), intent(in) :: text
    if (.not. options%quiet) write (output_unit, '(a)') printable(text)
  end subroutine say

end module pd_driver
