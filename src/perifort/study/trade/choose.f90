!> `perifort choose`: the fastest settings that meet an error, predicted from the runs of a study
!> and then run.
!>
!> One variable may take values between and beyond its listed ones: the number of points, or else
!> the time step, its safety or the tolerance. The runs that differ in it alone make a line with its
!> own fit of error and time; all others keep to their values. The fastest of all lines is chosen.
module pd_study_trade_choose
  use pd_base_clock, only: duration_text
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp
  use pd_base_text, only: newline, to_text
  use pd_output_report_begin, only: run_options_type
  use pd_scene_content_types, only: path_length
  use pd_scene_format_file, only: line_type
  use pd_scene_format_values, only: exact_text
  use pd_study_trade_lines, only: continuous_variable, law_of, line_notes, on_line, usable_runs
  use pd_study_trade_plan, only: common_divisor, plan_type, scene_of, size_up, trial_type, &
    & variable_type
  use pd_study_trade_predict, only: error_at, law_type, seconds_at
  use pd_study_trade_study, only: add_trial, begin_study, run_all, run_one, say, session_type
  use pd_study_trade_table, only: settings_text, table_text
  implicit none (type, external)
  private
  public :: run_choose

  integer, parameter :: most_tries = 3
  real(wp), parameter :: farthest = 16.0_wp   !! steps finer than the finest run's by no more

  !> Settings with their predicted error and time.
  type :: choice_type
    logical :: found = .false.
    logical :: meets = .false.           !! error and time are expected to be met
    character(path_length), allocatable :: words(:)
    real(wp) :: error = huge(1.0_wp)
    real(wp) :: seconds = huge(1.0_wp)   !! [s]
  end type choice_type

contains

  !> The whole command. `target`: the error to be met; `limit`: the longest a run may take [s], 0
  !> for any. An error with the status of bad input if the target is missed.
  subroutine run_choose(path, options, target, limit, error, changes)
    character(*), intent(in) :: path                     !! of the scene file
    type(run_options_type), intent(in) :: options        !! of the command line
    real(wp), intent(in) :: target  !! error to be met, in the norm of the study
    real(wp), intent(in) :: limit  !! longest time that a run may take, 0 for any [s]
    type(error_type), allocatable, intent(out) :: error
    type(line_type), intent(in) :: changes(:)  !! `group%key=value`: see `--set`
    type(session_type) :: session
    type(choice_type) :: choice
    logical :: met
    integer :: try

    call begin_study(path, options, session, error, changes)
    if (.not. allocated(error)) call run_all(session, error)
    if (allocated(error)) return
    call say(session, newline//table_text(session%plan, session%outcomes, &
      & session%measure))
    call say(session, line_notes(session%plan, session%outcomes))
    met = .false.
    do try = 1, most_tries
      call choose_affordable(session, target, limit, choice)
      if (.not. choice%found) exit
      call verify_choice(session, choice, target, limit, met, error)
      if (allocated(error) .or. met .or. .not. choice%meets) exit
      if (try < most_tries) call say(session, 'Target missed. Next try, with this run in the fit:')
    end do
    if (allocated(error) .or. met) return
    if (.not. choice%found) then
      call fail(error, 'no settings can be chosen: no run has an answer or can be built')
    else if (.not. choice%meets) then
      call fail(error, 'the error of '//to_text(target)//' cannot be met with these values'// &
        & trim(within(limit))//'; the best settings are shown above')
    else
      call fail(error, 'the error of '//to_text(target)//trim(within(limit))//' was missed')
    end if
  end subroutine run_choose

  pure function within(limit) result(text)
    real(wp), intent(in) :: limit
    character(:), allocatable :: text
    text = ''
    if (limit > 0.0_wp) text = ' within '//duration_text(limit)
  end function within

  !> The best choice whose scene can be built and fits into the memory.
  subroutine choose_affordable(session, target, limit, choice)
    type(session_type), intent(in) :: session
    real(wp), intent(in) :: target, limit
    type(choice_type), intent(out) :: choice
    type(trial_type) :: trial
    type(error_type), allocatable :: fault
    real(wp) :: reach
    integer :: i

    reach = farthest
    do i = 1, 8
      call find_choice(session, target, limit, reach, choice)
      if (.not. choice%found) return
      trial%words = choice%words
      call scene_of(session%plan, trial, fault)
      if (.not. allocated(fault)) call size_up(trial, fault)
      if (.not. allocated(fault)) return
      reach = 1 + (reach - 1)/2
    end do
    choice%found = .false.
  end subroutine choose_affordable

  !> The cheapest settings that are expected to meet `target` within `limit` [s] (0: any time); if
  !> none are, those with the least error within the limit, and without any the cheapest. Steps are
  !> finer than the finest run's by no more than the factor `reach`.
  subroutine find_choice(session, target, limit, reach, choice)
    type(session_type), intent(in) :: session
    real(wp), intent(in) :: target, limit, reach
    type(choice_type), intent(out) :: choice
    logical, allocatable :: open(:), chosen(:)
    integer :: t, free
    type(law_type) :: law

    associate (plan => session%plan, outcomes => session%outcomes)
      free = continuous_variable(plan)
      open = usable_runs(outcomes)
      do t = 1, size(open)
        if (.not. open(t)) cycle
        if (free == 0) then
          call consider(choice, plan%trials(t)%words, outcomes(t)%error, outcomes(t)%seconds, &
            & target, limit)
          cycle
        end if
        chosen = open .and. on_line(plan, free, t)
        call law_of(plan, outcomes, free, chosen, law)
        call search_line(plan, free, law, t, target, limit, reach, choice)
        open = open .and. .not. chosen
      end do
    end associate
  end subroutine find_choice

  !> All settings on the line of run `t`, coarse to fine.
  subroutine search_line(plan, free, law, t, target, limit, reach, choice)
    type(plan_type), intent(in) :: plan
    integer, intent(in) :: free, t
    type(law_type), intent(in) :: law
    real(wp), intent(in) :: target, limit, reach
    type(choice_type), intent(inout) :: choice
    real(wp), parameter :: fine = 1.01_wp   ! factor from step to step
    character(path_length), allocatable :: words(:)
    real(wp) :: h, expected
    integer :: i, multiple
    logical :: refines, levels

    refines = plan%variables(free)%refines
    levels = plan%variables(free)%levels
    multiple = count_step(plan, plan%variables(free))
    ! the runs themselves: their results are known
    do i = 1, law%n
      words = words_at(plan, free, t, law%h(i))
      call consider(choice, words, maxval(law%error(i:)), seconds_at(law, law%h(i)), target, limit)
    end do
    if (law%n < 2) return
    h = law%h(1)
    do while (h > law%h(law%n)/reach)
      if (refines) then
        h = 1/real(multiple*ceiling(fine/h/multiple - 1.0e-9_wp), wp)
      else if (levels) then
        h = h/2
      else
        h = h/fine
      end if
      expected = error_at(law, h)
      if (expected >= huge(1.0_wp)) cycle
      words = words_at(plan, free, t, h)
      call consider(choice, words, expected, seconds_at(law, h), target/law%margin, limit)
      if (expected <= target/law%margin .and. h < law%h(law%n)) exit
    end do
  end subroutine search_line

  !> Counts of points are multiples of this: whole in all directions, and even where all listed ones
  !> are, since the middle of a body lies on a point or between two by that. In a scene with cut out
  !> shapes or cracks they keep all that the listed ones have in common: their edges then lie on the
  !> lattice as in the runs that are known.
  pure integer function count_step(plan, variable) result(step)
    type(plan_type), intent(in) :: plan
    type(variable_type), intent(in) :: variable
    integer :: i

    step = variable%step
    if (size(plan%scene%kept) + size(plan%scene%removed) + size(plan%scene%cracks) > 0) then
      step = 0
      do i = 1, size(variable%numbers)
        step = common_divisor(step, nint(variable%numbers(i)))
      end do
    else if (modulo(step, 2) == 1 .and. all(modulo(nint(variable%numbers), 2) == 0)) then
      step = 2*step
    end if
  end function count_step

  !> The words of run `t` with another step on the axis of `free`; what goes in step with it follows
  !> a power law through the nearest two of its values.
  function words_at(plan, free, t, h) result(words)
    type(plan_type), intent(in) :: plan
    integer, intent(in) :: free, t
    real(wp), intent(in) :: h
    character(path_length), allocatable :: words(:)
    real(wp) :: value
    integer :: v

    words = plan%trials(t)%words
    do v = 1, size(words)
      associate (variable => plan%variables(v))
        if (variable%axis /= plan%variables(free)%axis) cycle
        value = h
        if (plan%variables(free)%refines) value = 1/h
        if (plan%variables(free)%levels) value = log(1/h)/log(2.0_wp)
        if (v /= free) value = companion(plan%variables(free)%numbers, variable%numbers, value)
        if (index(variable%target%kind, 'integer') > 0) then
          words(v) = to_text(nint(value))
        else
          words(v) = listed_or_exact(variable%numbers, variable%words, value)
        end if
      end associate
    end do
  end function words_at

  !> A listed number as it was written, another one to four digits.
  function listed_or_exact(numbers, words, value) result(word)
    real(wp), intent(in) :: numbers(:), value
    character(*), intent(in) :: words(:)
    character(:), allocatable :: word
    character(16) :: rounded
    real(wp) :: kept
    integer :: i, status

    do i = 1, size(numbers)
      if (abs(numbers(i) - value) > 1.0e-9_wp*abs(value)) cycle
      word = trim(words(i))
      return
    end do
    write (rounded, '(es10.3)') value
    read (rounded, *, iostat=status) kept
    if (status /= 0) kept = value
    word = exact_text(kept)
  end function listed_or_exact

  !> y at x by the power law through the two nearest pairs.
  pure real(wp) function companion(xs, ys, x) result(y)
    real(wp), intent(in) :: xs(:), ys(:)
    real(wp), intent(in) :: x
    integer :: first, second
    real(wp) :: distance(size(xs))

    distance = abs(log(xs/x))
    first = minloc(distance, dim=1)
    y = ys(first)
    if (distance(first) <= 1.0e-9_wp) return
    distance(first) = huge(1.0_wp)
    second = minloc(distance, dim=1)
    if (size(xs) < 2 .or. abs(xs(first) - xs(second)) <= 0.0_wp) return
    y = ys(first)*(x/xs(first))**(log(ys(second)/ys(first))/log(xs(second)/xs(first)))
  end function companion

  !> Take settings if they are better than those chosen so far.
  subroutine consider(choice, words, expected, seconds, target, limit)
    type(choice_type), intent(inout) :: choice
    character(*), intent(in) :: words(:)
    real(wp), intent(in) :: expected, seconds, target, limit
    logical :: meets, in_time, better, choice_in_time

    in_time = limit <= 0.0_wp .or. seconds <= limit
    meets = in_time .and. expected <= target
    choice_in_time = limit <= 0.0_wp .or. choice%seconds <= limit
    if (.not. choice%found) then
      better = .true.
    else if (meets .neqv. choice%meets) then
      better = meets
    else if (meets) then
      better = seconds < choice%seconds
    else if (in_time .neqv. choice_in_time) then
      better = in_time
    else if (in_time) then
      better = expected < choice%error
    else
      better = seconds < choice%seconds
    end if
    if (.not. better) return
    choice%found = .true.
    choice%meets = meets
    choice%words = words
    choice%error = expected
    choice%seconds = seconds
  end subroutine consider

  !> Run the chosen settings and compare them with the prediction.
  subroutine verify_choice(session, choice, target, limit, met, error)
    type(session_type), intent(inout) :: session
    type(choice_type), intent(in) :: choice
    real(wp), intent(in) :: target, limit
    logical, intent(out) :: met
    type(error_type), allocatable, intent(out) :: error
    type(trial_type) :: trial
    integer :: t

    met = .false.
    trial%words = choice%words
    call scene_of(session%plan, trial, error)
    if (.not. allocated(error)) call size_up(trial, error)
    if (allocated(error)) return
    call add_trial(session, trial)
    t = size(session%plan%trials)
    if (choice%meets) then
      call say(session, 'The fastest settings with a predicted error of at most '// &
        & to_text(target)//within(limit)//':')
    else
      call say(session, 'No settings have a predicted error of at most '//to_text(target)// &
        & within(limit)//'. The best of them:')
    end if
    call say(session, '  chosen           '//settings_text(session%plan, t))
    call say(session, '  predicted        error '//to_text(choice%error, 4)//', '// &
      & duration_text(choice%seconds))
    call run_one(session, t, 0.0_wp, error, silent=.true.)
    if (allocated(error)) return
    associate (outcome => session%outcomes(t))
      if (.not. outcome%judged) then
        call say(session, '  measured         no answer: '//outcome%fault)
        return
      end if
      call say(session, '  measured         error '//to_text(outcome%error, 4)//', '// &
        & duration_text(outcome%seconds))
      call say(session, '  over predicted   error '//ratio(outcome%error, choice%error)// &
        & ', time '//ratio(outcome%seconds, choice%seconds))
      met = outcome%error <= target
      if (limit > 0.0_wp) met = met .and. outcome%seconds <= limit
      call say(session, '  target           '//trim(merge('met   ', 'missed', met)))
    end associate
  end subroutine verify_choice

  pure function ratio(value, of) result(text)
    real(wp), intent(in) :: value, of
    character(:), allocatable :: text
    text = 'unknown'
    if (of > 0.0_wp) text = to_text(value/of, 3)
  end function ratio

end module pd_study_trade_choose
