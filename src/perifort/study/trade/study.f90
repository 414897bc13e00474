!> `perifort study`: the runs of a study made one after another, measured, and put into a table.
module pd_study_trade_study
  use, intrinsic :: iso_fortran_env, only: output_unit
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_clock, only: duration_text, output_is_terminal, wall_time
  use pd_base_error, only: error_type, fail, status_interrupted, status_no_answer
  use pd_base_interrupt, only: watch_for_interrupt
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: ascending
  use pd_base_shell, only: program_command, quoted
  use pd_base_text, only: newline, to_text
  use pd_output_fields_check, only: check_names
  use pd_output_fields_table, only: field_table_type
  use pd_output_report_begin, only: fields_of, output_directory, run_options_type
  use pd_output_results_files, only: file_exists, in_directory, make_directory
  use pd_scene_format_file, only: line_type, resolve_path
  use pd_scene_content_rules, only: find_entry, find_section, rule_fault
  use pd_study_trade_analytic, only: find_form
  use pd_study_trade_closed_form, only: closed_form_type
  use pd_study_trade_front, only: mark_front
  use pd_study_trade_lines, only: finest_of, mark_true_errors
  use pd_study_trade_measure, only: measure_type, of_column, record_type, resolve_measure
  use pd_study_trade_plan, only: plan_study, plan_type, trial_type
  use pd_study_trade_reference, only: judge_by_form, judge_by_record, read_reference
  use pd_study_trade_table, only: csv_text, head_text, put_file, row_text, settings_text, table_text
  use pd_study_trade_trial, only: check_trial, outcome_type, run_trial
  implicit none (type, external)
  private
  public :: session_type, run_study, begin_study, run_all, run_one, keep_tables, add_trial, say

  integer, parameter :: worth_a_thread = 40000  ! bonds; see choose_threads of pd_driver

  !> A study while it runs.
  type :: session_type
    type(plan_type) :: plan
    type(field_table_type) :: fields            !! that the scenes may name
    type(measure_type) :: measure
    type(outcome_type), allocatable :: outcomes(:)
    type(record_type) :: truth                  !! finest run or file
    integer :: finest = 0                       !! number of the run compared with, 0: none
    real(wp) :: around = 0.0_wp                 !! of its probe kept so far [m]
    character(:), allocatable :: directory
    logical :: quiet = .false.
    logical :: terminal = .false.
    real(wp) :: spent = 0.0_wp, work = 0.0_wp   !! on runs so far [s], and their estimated work
  end type session_type

contains

  !> The whole command. After an interrupt the finished runs are kept. An error is set if the study
  !> is wrong, a run cannot be made, or none has an answer.
  subroutine run_study(path, options, error, changes)
    character(*), intent(in) :: path                     !! of the scene file
    type(run_options_type), intent(in) :: options        !! of the command line
    type(error_type), allocatable, intent(out) :: error
    type(line_type), intent(in) :: changes(:)  !! `group%key=value`: see `--set`
    type(session_type) :: session

    call begin_study(path, options, session, error, changes)
    if (.not. allocated(error)) call run_all(session, error)
    if (allocated(error)) return
    call say(session, '')
    call say(session, table_text(session%plan, session%outcomes, session%measure))
    call say(session, '  results in '//session%directory//': study.csv, study.txt'//newline// &
      & '  pictures: '//plot_command(session%directory))
    if (.not. any(session%outcomes%judged)) call fail(error, 'no run of the study has an answer', &
      & status_no_answer)
  end subroutine run_study

  !> The command that draws the tables. `./pf` makes the pictures; where the program was started by
  !> itself, that of its project's folder is named.
  function plot_command(directory) result(text)
    character(*), intent(in) :: directory      !! of the tables
    character(:), allocatable :: text
    integer :: status

    call get_environment_variable('PERIFORT_COMMAND', status=status)
    text = './pf'
    if (status == 0) text = program_command()
    text = text//' plot '//quoted(directory)
  end function plot_command

  !> Plan everything, and check and set up every scene before the first run. An error is set if the
  !> study is wrong, a scene cannot be set up, or there are results already.
  subroutine begin_study(path, options, session, error, changes)
    character(*), intent(in) :: path                     !! of the scene file
    type(run_options_type), intent(in) :: options        !! of the command line
    type(session_type), intent(out) :: session
      !! planned, with what the runs are compared with, and its folder made
    type(error_type), allocatable, intent(out) :: error
    type(line_type), intent(in) :: changes(:)  !! `group%key=value`: see `--set`
    integer :: t

    session%quiet = options%quiet
    session%terminal = output_is_terminal() .and. .not. options%quiet
    call plan_study(path, session%plan, error, changes)
    if (allocated(error)) return
    session%fields = fields_of(options)
    associate (plan => session%plan)
      call check_names(plan%scene, session%fields, error)
      if (allocated(error)) return
      call resolve_measure(plan%measure, plan%region, plan%norm, plan%scene, session%fields, &
        & plan%source, session%measure, error)
      if (allocated(error)) return
      call find_truth(session, error)
      if (allocated(error)) return
      session%directory = output_directory(plan%scene, options)
      if (file_exists(in_directory(session%directory, 'study.csv')) .and. .not. options%overwrite) &
        & then
        call fail(error, "'"//in_directory(session%directory, 'study.csv')// &
          & "' is there already; use --overwrite, or --output for another folder")
        return
      end if
      allocate (session%outcomes(size(plan%trials)))
      call choose_threads(options, plan)
      call check_trials(session, error)
      if (.not. allocated(error)) call make_directory(session%directory, error)
      if (allocated(error)) return
      call say(session, to_text(size(plan%trials))//' run(s), '// &
        & to_text(nint(minval(plan%trials%points)))//' to '// &
        & to_text(nint(maxval(plan%trials%points)))//' points, '// &
        & to_text(omp_get_max_threads())//' thread(s); '//session%measure%norm//' error of '// &
        & session%measure%name//' against '//against_text(session))
    end associate
    do t = 1, size(session%outcomes)
      session%outcomes(t)%truth = t == session%finest
    end do
    call watch_for_interrupt()
  end subroutine begin_study

  !> What is compared with, in words.
  function against_text(session) result(text)
    type(session_type), intent(in) :: session
    character(:), allocatable :: text
    type(closed_form_type) :: form
    character(:), allocatable :: reason

    associate (plan => session%plan)
      text = plan%against
      if (plan%against == 'analytic') then
        call find_form(plan%analytic, plan%trials(1)%scene, form, reason)
        text = "the closed form '"//form%name//"'"
      else if (session%finest > 0) then
        text = 'the finest run, '//settings_text(plan, session%finest)
      end if
    end associate
  end function against_text

  !> What the runs are compared with: every scene has its closed form, the finest run is known, or
  !> the file is read.
  subroutine find_truth(session, error)
    type(session_type), intent(inout) :: session
    type(error_type), allocatable, intent(out) :: error
    type(closed_form_type) :: form
    character(:), allocatable :: reason, probe, path
    integer :: t

    associate (plan => session%plan)
      select case (plan%against)
      case ('analytic')
        if (session%measure%kind == of_column) then
          call at_key(plan, 'measure', "no closed form knows the column '"//plan%measure//"'", &
            & 'closed forms are compared with a probe or a field', error)
          return
        end if
        do t = 1, size(plan%trials)
          call find_form(plan%analytic, plan%trials(t)%scene, form, reason)
          if (len(reason) == 0) cycle
          call at_key(plan, merge('analytic', 'against ', plan%analytic /= ''), reason, &
            & 'with '//settings_text(plan, t), error)
          return
        end do
      case ('finest')
        session%around = maxval(plan%trials%spacing)
        if (size(plan%trials) == 1) then
          call at_key(plan, 'against', 'a single run has no finer one', &
            & "give 'values' several values", error)
          return
        end if
        call finest_of(plan, session%finest, reason)
        if (len(reason) > 0) call at_key(plan, 'against', reason, 'one run must be at least as '// &
          & 'fine as all others in every key: add it, or compare with a closed form or a file', &
          & error)
      case default  ! the name of a file; one that is not there is an error
        probe = ''
        if (session%measure%probe > 0) probe = trim(plan%scene%probes(session%measure%probe)%name)
        path = resolve_path(plan%against, plan%scene%file)
        if (.not. file_exists(path)) then
          call at_key(plan, 'against', "cannot find the file '"//path//"'", &
            & "expected 'analytic', 'finest' or the name of a file", error)
          return
        end if
        call read_reference(path, session%measure, probe, &
          & plan%scene%header%dimension, session%truth, error)
      end select
    end associate
  end subroutine find_truth

  !> An error at a key of the first `&study` that has it.
  subroutine at_key(plan, key, message, note, error)
    type(plan_type), intent(in) :: plan
    character(*), intent(in) :: key, message, note
    type(error_type), allocatable, intent(out) :: error
    integer :: number

    do number = 1, size(plan%scene%studies) - 1
      if (find_entry(plan%source, find_section(plan%source, 'study', number), trim(key)) > 0) exit
    end do
    call rule_fault(error, 'study', number, trim(key), message, note, plan%source)
  end subroutine at_key

  !> Set up every scene, in memory and one after another: what is wrong with the last is reported
  !> before the first one runs.
  subroutine check_trials(session, error)
    type(session_type), intent(inout) :: session
    type(error_type), allocatable, intent(out) :: error   !! with the settings of the scene
    type(closed_form_type), allocatable :: form
    character(:), allocatable :: reason
    integer :: t

    do t = 1, size(session%plan%trials)
      if (allocated(form)) deallocate (form)
      associate (plan => session%plan)
        if (plan%against == 'analytic') then
          allocate (form)
          call find_form(plan%analytic, plan%trials(t)%scene, form, reason)
        end if
        call check_trial(plan%trials(t)%scene, session%fields, session%measure, form, error)
        if (.not. allocated(error)) cycle
        error%message = settings_text(plan, t)//': '//error%message
        return
      end associate
    end do
  end subroutine check_trials

  !> The same number of threads for all runs: as asked for, or one if even the largest is small.
  subroutine choose_threads(options, plan)
    type(run_options_type), intent(in) :: options
    type(plan_type), intent(in) :: plan
    if (options%threads > 0) then
      call omp_set_num_threads(options%threads)
    else if (maxval(plan%trials%bonds) < worth_a_thread) then
      call omp_set_num_threads(1)
    end if
  end subroutine choose_threads

  !> All runs, coarse to fine; with 'finest' that run comes first, since its answer is needed. An
  !> error as of `run_one`; what was done before it is in the tables.
  subroutine run_all(session, error)
    type(session_type), intent(inout) :: session  !! begun; with the outcome of every run on return
    type(error_type), allocatable, intent(out) :: error
    integer, allocatable :: order(:)
    real(wp), allocatable :: work(:)
    integer :: i

    work = session%plan%trials%work
    order = ascending(work)
    if (session%finest > 0) order = [session%finest, pack(order, order /= session%finest)]
    call say(session, head_text(session%plan, session%measure))
    do i = 1, size(order)
      call run_one(session, order(i), sum(session%plan%trials(order(i + 1:))%work), error)
      if (allocated(error)) exit
    end do
    if (.not. allocated(error)) return
    if (error%status == status_interrupted) error%message = 'interrupted: '//to_text(i - 1)// &
      & ' of '//to_text(size(order))//' runs are in '//in_directory(session%directory, 'study.csv')
  end subroutine run_all

  !> Make run `t`, compare it and write the tables anew. An error if its scene cannot be set up, if
  !> the user interrupts, if the finest run has no answer, if nothing of it can be compared, or if
  !> the tables cannot be written.
  subroutine run_one(session, t, remaining, error, silent)
    type(session_type), intent(inout) :: session  !! begun; with the outcome of this run on return
    integer, intent(in) :: t                      !! number of the run
    real(wp), intent(in) :: remaining             !! estimated work of the later runs; 0: their time
                                                  !! is not shown
    type(error_type), allocatable, intent(out) :: error
    logical, intent(in), optional :: silent      !! the row is not shown
    type(closed_form_type), allocatable :: form
    type(record_type) :: record
    character(:), allocatable :: reason, line
    real(wp) :: begin, around
    logical :: truth

    begin = wall_time()
    truth = t == session%finest
    associate (plan => session%plan, outcome => session%outcomes(t))
      if (session%terminal) call say(session, settings_text(plan, t)//' ...')
      if (plan%against == 'analytic') then
        allocate (form)
        call find_form(plan%analytic, plan%trials(t)%scene, form, reason)
      end if
      ! the surroundings of the probe of the finest run are kept, so that the places of coarser ones
      ! can be found in it: their points are at most half a cell's diagonal away
      around = 0.0_wp
      if (truth) around = session%around + 3*plan%trials(t)%spacing
      call run_trial(plan%trials(t)%scene, session%fields, session%measure, around, &
        & session%terminal, form, outcome, record, error)
      if (allocated(error)) return
      outcome%truth = truth
      if (outcome%done) call judge(session, record, form, t, error)
      if (allocated(error)) return
      if (truth .and. .not. outcome%done) then
        call fail(error, 'the finest run, the reference, has no answer: '// &
          & outcome%fault, status_no_answer)
        return
      end if
      session%spent = session%spent + (wall_time() - begin)
      session%work = session%work + plan%trials(t)%work
      call keep_tables(session, error)
      if (allocated(error)) return
      if (present(silent)) return
      line = row_text(plan, t, outcome)
      if (remaining > 0.0_wp) line = line//'   left '// &
        & duration_text(session%spent/session%work*remaining)
      call say(session, line)
    end associate
  end subroutine run_one

  !> The error of a run.
  subroutine judge(session, record, form, t, error)
    type(session_type), intent(inout) :: session
    type(record_type), intent(in) :: record
    type(closed_form_type), allocatable, intent(in) :: form
    integer, intent(in) :: t
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: fault

    associate (outcome => session%outcomes(t))
      if (outcome%truth) then
        session%truth = record
        fault = ''
      else if (allocated(form)) then
        call judge_by_form(form, session%measure, record, outcome%error, fault)
      else
        call judge_by_record(session%truth, session%measure, record, outcome%error, fault)
      end if
      outcome%judged = len(fault) == 0
      if (.not. outcome%judged) call at_key(session%plan, 'measure', fault, 'with '// &
        & settings_text(session%plan, t), error)
    end associate
  end subroutine judge

  !> Write study.csv and study.txt with the runs made so far. An error if they cannot be written.
  subroutine keep_tables(session, error)
    type(session_type), intent(inout) :: session  !! its outcomes get front and true errors
    type(error_type), allocatable, intent(out) :: error

    call mark_front(session%outcomes)
    call mark_true_errors(session%plan, session%outcomes)
    call put_file(session%directory, 'study.csv', csv_text(session%plan, session%outcomes), error)
    if (allocated(error)) return
    call put_file(session%directory, 'study.txt', table_text(session%plan, session%outcomes, &
      & session%measure), error)
  end subroutine keep_tables

  !> One more run at the end of the plan.
  subroutine add_trial(session, trial)
    type(session_type), intent(inout) :: session  !! with one run more on return, which is not made
                                                  !! yet
    type(trial_type), intent(in) :: trial         !! the run, with words and scene
    type(trial_type), allocatable :: trials(:)
    type(outcome_type), allocatable :: outcomes(:)
    integer :: n

    n = size(session%plan%trials)
    allocate (trials(n + 1), outcomes(n + 1))
    trials(:n) = session%plan%trials
    trials(n + 1) = trial
    outcomes(:n) = session%outcomes
    call move_alloc(trials, session%plan%trials)
    call move_alloc(outcomes, session%outcomes)
  end subroutine add_trial

  !> Print to standard output, unless the study is quiet.
  subroutine say(session, text)
    type(session_type), intent(in) :: session  !! tells whether the study is quiet
    character(*), intent(in) :: text           !! a line or several
    if (session%quiet) return
    write (output_unit, '(a)') text
    flush (output_unit)
  end subroutine say

end module pd_study_trade_study
