!> The lines of a study: runs that differ in one continuous variable alone, each with its own fit of
!> error and time (doc/theory.md, 14); and the finest run.
module pd_study_trade_lines
  use pd_base_kinds, only: wp
  use pd_base_text, only: newline, to_text
  use pd_scene_content_types, only: is_set, scene_type
  use pd_study_trade_front, only: is_step, step_variable
  use pd_study_trade_plan, only: plan_type, shown_word, trial_type
  use pd_study_trade_predict, only: error_at, fit_law, law_type, least_order, true_error_at
  use pd_study_trade_table, only: settings_text
  use pd_study_trade_trial, only: outcome_type
  implicit none (type, external)
  private
  public :: continuous_variable, finest_of, law_of, on_line, line_notes, mark_true_errors, &
    & step_of, usable_runs

contains

  !> The run that is the finest in every variable that refines (points, levels, time step, safety,
  !> tolerance). Among several the one with the smallest spacing, then with the smallest time step
  !> or tolerance, then the first. `reason` is '' unless there is no such run.
  subroutine finest_of(plan, finest, reason)
    type(plan_type), intent(in) :: plan                   !! of the study
    integer, intent(out) :: finest                        !! number of the run; 0 if there is none
    character(:), allocatable, intent(out) :: reason      !! why there is none
    logical :: left(size(plan%trials))
    real(wp) :: step(size(plan%trials))
    character(:), allocatable :: wanted
    integer :: t, v, refining

    finest = 0
    reason = ''
    wanted = ''
    refining = 0
    left = .true.
    do v = 1, size(plan%variables)
      if (.not. is_step(plan, v)) cycle
      refining = refining + 1
      step = [(step_of(plan, v, plan%trials(t)), t=1, size(step))]
      left = left .and. step <= minval(step)*(1 + 1.0e-9_wp)
      if (len(wanted) > 0) wanted = wanted//', '
      wanted = wanted//plan%variables(v)%name//' = '// &
        & shown_word(plan%trials(minloc(step, dim=1))%words(v))
    end do
    step = plan%trials%spacing
    if (.not. any(left)) then
      reason = 'no run is the finest in every varied key: none has '//wanted
      return
    else if (refining == 0 .and. minval(step) >= maxval(step)*(1 - 1.0e-9_wp)) then
      reason = 'no run is finer than the others: no varied key refines points, levels, '// &
        & 'time step, safety or tolerance'
      return
    end if
    do t = 1, size(plan%trials)
      if (.not. left(t)) cycle
      if (finest == 0) finest = t
      if (step(t) > step(finest)*(1 + 1.0e-9_wp)) cycle
      if (step(t) < step(finest)*(1 - 1.0e-9_wp) .or. &
        & care(plan%trials(t)%scene) < care(plan%trials(finest)%scene)) finest = t
    end do
  end subroutine finest_of

  !> The smaller, the smaller the error in time or of relaxation.
  pure real(wp) function care(scene)
    type(scene_type), intent(in) :: scene
    if (scene%time%method == 'relaxation') then
      care = scene%relaxation%tolerance
    else if (is_set(scene%time%step)) then
      care = scene%time%step
    else
      care = scene%time%safety
    end if
  end function care

  !> The variable that may take values between and beyond those given: one that refines a body, else
  !> the time step, its safety or the tolerance; 0 if none. Variables that vary together with it
  !> must be positive numbers.
  pure integer function continuous_variable(plan) result(free)
    type(plan_type), intent(in) :: plan  !! of the study

    do free = 1, size(plan%variables)
      if (plan%variables(free)%refines .and. follows(free)) return
    end do
    do free = 1, size(plan%variables)
      if (is_step(plan, free) .and. follows(free)) return
    end do
    free = 0

  contains

    pure logical function follows(with)
      integer, intent(in) :: with
      integer :: v
      follows = .true.
      do v = 1, size(plan%variables)
        if (plan%variables(v)%axis /= plan%variables(with)%axis) cycle
        follows = follows .and. plan%variables(v)%numeric
        if (follows) follows = all(plan%variables(v)%numbers > 0.0_wp)
      end do
    end function follows
  end function continuous_variable

  !> The runs that differ from run `t` on the axis of the variable `free` alone.
  pure function on_line(plan, free, t) result(on)
    type(plan_type), intent(in) :: plan  !! of the study
    integer, intent(in) :: free          !! number of the continuous variable
    integer, intent(in) :: t             !! number of the run
    logical :: on(size(plan%trials))
    integer :: i

    do i = 1, size(on)
      on(i) = .not. any(plan%trials(i)%words /= plan%trials(t)%words .and. &
        & plan%variables%axis /= plan%variables(free)%axis)
    end do
  end function on_line

  !> The runs that have an error of their own: done, judged, and not the one compared with.
  pure function usable_runs(outcomes) result(usable)
    type(outcome_type), intent(in) :: outcomes(:)  !! (runs) in the order of the plan
    logical :: usable(size(outcomes))
    usable = outcomes%done .and. outcomes%judged .and. .not. outcomes%truth
  end function usable_runs

  !> The law of the chosen runs; of runs at the same step the last counts.
  subroutine law_of(plan, outcomes, free, chosen, law)
    type(plan_type), intent(in) :: plan            !! of the study
    type(outcome_type), intent(in) :: outcomes(:)  !! (runs) in the order of the plan
    integer, intent(in) :: free                    !! the continuous variable
    logical, intent(in) :: chosen(:)               !! runs of one line
    type(law_type), intent(out) :: law             !! fit of error and time over the step of `free`
    real(wp) :: h(size(chosen)), reference
    logical :: used(size(chosen))
    integer :: t

    used = chosen
    reference = 0.0_wp
    do t = 1, size(chosen)
      h(t) = step_of(plan, free, plan%trials(t))
      where (used(:t - 1) .and. abs(h(:t - 1) - h(t)) <= 1.0e-9_wp*h(t)) &
        & used(:t - 1) = .not. chosen(t)
      if (outcomes(t)%truth) reference = h(t)
    end do
    ! a reference that is no finer in this variable does not bound the error in it
    if (any(used .and. h <= reference*(1 + 1.0e-9_wp))) reference = 0.0_wp
    call fit_law(pack(h, used), pack(outcomes%error, used), pack(outcomes%seconds, used), &
      & reference, law)
  end subroutine law_of

  !> The step of the variable `free` in a run; 0 if its value is no number.
  real(wp) function step_of(plan, free, trial) result(step)
    type(plan_type), intent(in) :: plan    !! of the study
    integer, intent(in) :: free            !! number of the variable
    type(trial_type), intent(in) :: trial  !! the run, which need not be one of the plan
    character(len(trial%words)) :: word
    real(wp) :: value
    integer :: status
    word = trial%words(free)
    read (word, *, iostat=status) value
    step = 0.0_wp
    if (status == 0) step = step_variable(plan, free, value)
  end function step_of

  !> Where all are compared with the finest run: set the extrapolated true error of each run, C h^p
  !> by the fit C (h^p - r^p) of its line, r the step of the finest run.
  subroutine mark_true_errors(plan, outcomes)
    type(plan_type), intent(in) :: plan               !! of the study
    type(outcome_type), intent(inout) :: outcomes(:)  !! (runs) in the order of the plan; true
                                                      !! errors are set
    type(law_type) :: law
    logical :: usable(size(outcomes)), line(size(outcomes))
    integer :: free, t

    outcomes%extrapolated = .false.
    free = continuous_variable(plan)
    if (free == 0 .or. .not. any(outcomes%truth)) return
    usable = usable_runs(outcomes)
    do t = 1, size(outcomes)
      line = on_line(plan, free, t)
      call law_of(plan, outcomes, free, usable .and. line, law)
      if (.not. (usable(t) .or. outcomes(t)%truth)) cycle
      call true_error_at(law, step_of(plan, free, plan%trials(t)), outcomes(t)%true_error, &
        & outcomes(t)%extrapolated)
    end do
  end subroutine mark_true_errors

  !> For each line the result of the fit, and the reasons why runs are not used with their own
  !> error, one per line.
  function line_notes(plan, outcomes) result(text)
    type(plan_type), intent(in) :: plan            !! of the study
    type(outcome_type), intent(in) :: outcomes(:)  !! (runs) in the order of the plan
    character(:), allocatable :: text
    type(law_type) :: law
    logical :: seen(size(outcomes)), usable(size(outcomes)), line(size(outcomes))
    integer :: free, t

    text = ''
    free = continuous_variable(plan)
    if (free == 0) then
      text = 'No fit: no varied key is a number of points, a time step, a safety or a '// &
        & 'tolerance. The choice is one of the runs.'//newline
      return
    end if
    usable = usable_runs(outcomes)
    seen = .false.
    do t = 1, size(outcomes)
      if (seen(t)) cycle
      line = on_line(plan, free, t)
      seen = seen .or. line
      call law_of(plan, outcomes, free, usable .and. line, law)
      text = text//'Fit '//others_text(plan, free, t)//': '//fit_text(law)//newline// &
        & run_notes(plan, outcomes, free, line, law)
    end do
  end function line_notes

  !> What the fit of a line says.
  function fit_text(law) result(text)
    type(law_type), intent(in) :: law
    character(:), allocatable :: text

    if (law%n < 2) then
      text = 'none, '//to_text(law%n)//' run(s) with an error; a fit needs two'
    else if (any(law%error <= 0.0_wp)) then
      text = 'none, a run has the error 0'
    else if (law%order < least_order) then
      text = 'order '//to_text(law%order, 2)//', below '//to_text(least_order, 2)// &
        & ': the error does not decrease, no extrapolation'
    else
      text = 'order '//to_text(law%order, 3)
      if (law%last_order < law%order) text = text//', '//to_text(law%last_order, 3)// &
        & ' of the three finest runs'
      text = text//'; target divided by '//to_text(law%margin, 3)//' for the scatter of the runs'
      if (.not. law%extrapolates) text = text//'; no extrapolation'
      if (law%reference > 0.0_wp) text = text//'; no prediction nearer to the finest run than '// &
        & 'twice its step'
    end if
  end function fit_text

  !> Why runs of a line are not used, or not with their own error.
  function run_notes(plan, outcomes, free, line, law) result(text)
    type(plan_type), intent(in) :: plan
    type(outcome_type), intent(in) :: outcomes(:)
    integer, intent(in) :: free
    logical, intent(in) :: line(:)
    type(law_type), intent(in) :: law
    character(:), allocatable :: text, why
    real(wp) :: expected
    integer :: t, i

    text = ''
    do t = 1, size(outcomes)
      if (.not. line(t)) cycle
      why = ''
      if (allocated(outcomes(t)%fault)) then
        why = 'not used: no answer'
      else if (outcomes(t)%truth) then
        why = 'not used: it is the reference run'
      else if (.not. outcomes(t)%judged) then
        why = 'not used: its error is not known'
      else
        expected = error_at(law, step_of(plan, free, plan%trials(t)))
        if (expected > outcomes(t)%error*(1 + 1.0e-9_wp)) then
          why = 'error taken as '//to_text(expected, 4)//' instead of '// &
            & to_text(outcomes(t)%error, 4)//': a finer run has that error'
          do i = 1, size(outcomes)
            if (line(i) .and. abs(outcomes(i)%error - expected) <= 0.0_wp) &
              & why = why//' ('//settings_text(plan, i)//')'
          end do
        end if
      end if
      if (len(why) > 0) text = text//'  '//settings_text(plan, t)//': '//why//newline
    end do
  end function run_notes

  !> The settings of run `t` that its line has in common: `with a = 1, b = 2`.
  function others_text(plan, free, t) result(text)
    type(plan_type), intent(in) :: plan
    integer, intent(in) :: free, t
    character(:), allocatable :: text
    integer :: v

    text = ''
    do v = 1, size(plan%variables)
      if (plan%variables(v)%axis == plan%variables(free)%axis) cycle
      if (len(text) > 0) text = text//', '
      text = text//plan%variables(v)%name//' = '//shown_word(plan%trials(t)%words(v))
    end do
    if (len(text) > 0) text = 'with '//text//', '
    text = text//'over '//plan%variables(free)%name
  end function others_text

end module pd_study_trade_lines
