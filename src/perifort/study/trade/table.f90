!> A study as lines of a CSV file and as a table to read.
module pd_study_trade_table
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp
  use pd_base_text, only: join, newline, to_text
  use pd_output_results_files, only: in_directory, rename_file
  use pd_study_trade_front, only: observed_orders, order_type
  use pd_study_trade_measure, only: measure_type, measure_unit, quantity_unit
  use pd_study_trade_plan, only: plan_type, result_columns, shown_word
  use pd_study_trade_trial, only: outcome_type
  implicit none (type, external)
  private
  public :: csv_text, table_text, row_text, head_text, put_file, settings_text

  integer, parameter :: number_width = 11
  integer, parameter :: value_width = 13

contains

  !> The whole CSV file: a line for each run that has been made, in the order of the plan. A run
  !> without an answer has nan as its value and error. With the finest run as reference
  !> the true error is extrapolated, nan where it is not known; else it is the error.
  function csv_text(plan, outcomes) result(text)
    type(plan_type), intent(in) :: plan            !! of the study
    type(outcome_type), intent(in) :: outcomes(:)  !! (runs) in the order of the plan
    character(:), allocatable :: text
    integer :: t, v

    text = ''
    do v = 1, size(plan%variables)
      text = text//plan%variables(v)%name//','
    end do
    text = text//join(result_columns, ',')//newline
    do t = 1, size(outcomes)
      if (.not. known(outcomes(t))) cycle
      do v = 1, size(plan%variables)
        text = text//shown_word(plan%trials(t)%words(v))//','
      end do
      associate (o => outcomes(t))
        text = text//error_text(o, 9)//','//to_text(o%seconds, 6)//','//to_text(o%points)//','// &
          & to_text(o%bonds)//','//to_text(o%steps)//','//to_text(o%bytes)//','// &
          & to_text(o%energy_drift, 6)//','//trim(merge('1', '0', o%pareto))//','// &
          & value_text(o, 12)//','//true_error_of(o)//newline
      end associate
    end do

  contains

    !> The last column of a row.
    pure function true_error_of(outcome) result(text)
      type(outcome_type), intent(in) :: outcome
      character(:), allocatable :: text
      if (plan%against == 'finest') then
        text = true_text(outcome, 6, 'nan')
      else
        text = error_text(outcome, 9)
      end if
    end function true_error_of
  end function csv_text

  !> Whether a run was made, with or without an answer.
  pure logical function known(outcome)
    type(outcome_type), intent(in) :: outcome
    known = outcome%done .or. allocated(outcome%fault)
  end function known

  !> The error with so many digits; nan where there is none.
  pure function error_text(outcome, digits) result(text)
    type(outcome_type), intent(in) :: outcome
    integer, intent(in) :: digits
    character(:), allocatable :: text
    text = 'nan'
    if (outcome%judged) text = to_text(outcome%error, digits)
  end function error_text

  !> The measured value with so many digits; nan where there is none.
  pure function value_text(outcome, digits) result(text)
    type(outcome_type), intent(in) :: outcome
    integer, intent(in) :: digits
    character(:), allocatable :: text
    text = 'nan'
    if (outcome%done) text = to_text(outcome%value, digits)
  end function value_text

  !> The extrapolated true error with so many digits; `none` where it is not known.
  pure function true_text(outcome, digits, none) result(text)
    type(outcome_type), intent(in) :: outcome
    integer, intent(in) :: digits
    character(*), intent(in) :: none
    character(:), allocatable :: text
    text = none
    if (outcome%extrapolated) text = to_text(outcome%true_error, digits)
  end function true_text

  !> The complete table with its evaluation.
  function table_text(plan, outcomes, measure) result(text)
    type(plan_type), intent(in) :: plan            !! of the study
    type(outcome_type), intent(in) :: outcomes(:)  !! (runs) in the order of the plan
    type(measure_type), intent(in) :: measure      !! what is measured
    character(:), allocatable :: text
    type(order_type), allocatable :: orders(:)
    integer :: t, i

    text = ''
    if (allocated(plan%changes)) then
      do i = 1, size(plan%changes)
        text = text//'  set         '//plan%changes(i)%text//newline
      end do
      if (size(plan%changes) > 0) text = text//newline
    end if
    text = text//head_text(plan, measure)//newline
    do t = 1, size(outcomes)
      if (known(outcomes(t))) text = text//row_text(plan, t, outcomes(t))//newline
    end do
    text = text//newline//legend_text(plan, measure)
    call observed_orders(plan, outcomes, orders)
    if (size(orders) > 0) text = text//newline// &
      & "Observed orders: log of the errors' ratio over log of the values' ratio"// &
      & " (of points: of the spacings')"//newline
    do i = 1, size(orders)
      associate (o => orders(i))
        text = text//'  '//padded(settings_text(plan, o%from), settings_width(plan))//'  -> '// &
          & plan%variables(o%variable)%name//' = '// &
          & padded(shown_word(plan%trials(o%to)%words(o%variable)), 8)//right(fixed(o%order), 8)// &
          & newline
      end associate
    end do
    do t = 1, size(outcomes)
      if (.not. allocated(outcomes(t)%fault)) cycle
      text = text//newline//'No answer with '//settings_text(plan, t)//': '//outcomes(t)%fault// &
        & newline
    end do
  end function table_text

  !> What the columns mean, one a line.
  function legend_text(plan, measure) result(text)
    type(plan_type), intent(in) :: plan
    type(measure_type), intent(in) :: measure
    character(:), allocatable :: text

    text = '  value       '//measure%name//' at the end of the run; of a vector its length, of '// &
      & 'a field the root mean square over its points'//newline// &
      & '  error       '//measure%norm//' norm of the difference from '
    select case (plan%against)
    case ('analytic')
      text = text//'the closed form'
    case ('finest')
      text = text//'the finest run'
    case default  ! the name of a file
      text = text//plan%against
    end select
    text = text//newline
    if (plan%against == 'finest') text = text// &
      & '  true error  extrapolated: C h^p, by the fit C (h^p - r^p) of the errors; r is the '// &
      & 'step h of the finest run'//newline
    text = text//'  seconds     set-up and steps, median of the repeats'//newline// &
      & '  drift       largest error of the energy balance over the largest energy'//newline// &
      & '  *           on the Pareto front: no run has both a smaller error and a shorter time'// &
      & newline
  end function legend_text

  !> The line above the rows.
  function head_text(plan, measure) result(text)
    type(plan_type), intent(in) :: plan        !! of the study
    type(measure_type), intent(in) :: measure  !! what is measured
    character(:), allocatable :: text
    integer :: v

    text = ''
    do v = 1, size(plan%variables)
      text = text//right(plan%variables(v)%name, column_width(plan, v))
    end do
    text = text//right('value'//in_brackets(quantity_unit(measure)), value_width)// &
      & right('error'//in_brackets(measure_unit(measure)), number_width)
    if (plan%against == 'finest') text = text//right('true error', number_width)
    text = text//right('seconds', number_width)//right('points', number_width)// &
      & right('bonds', number_width)//right('steps', number_width)//right('bytes', number_width)// &
      & right('drift', number_width)
  end function head_text

  !> ` [m]`, or nothing without a unit.
  pure function in_brackets(unit) result(text)
    character(*), intent(in) :: unit
    character(:), allocatable :: text
    text = ''
    if (len(unit) > 0) text = ' ['//unit//']'
  end function in_brackets

  !> The row of one run.
  function row_text(plan, t, outcome) result(text)
    type(plan_type), intent(in) :: plan        !! of the study
    integer, intent(in) :: t                   !! number of the run
    type(outcome_type), intent(in) :: outcome  !! what it came to
    character(:), allocatable :: text
    integer :: v

    text = ''
    do v = 1, size(plan%variables)
      text = text//right(shown_word(plan%trials(t)%words(v)), column_width(plan, v))
    end do
    text = text//right(value_text(outcome, 6), value_width)// &
      & right(error_text(outcome, 4), number_width)
    if (plan%against == 'finest') text = text//right(true_text(outcome, 4, '-'), number_width)
    text = text//right(to_text(outcome%seconds, 3), number_width)// &
      & right(to_text(outcome%points), number_width)// &
      & right(to_text(outcome%bonds), number_width)//right(to_text(outcome%steps), number_width)// &
      & right(to_text(outcome%bytes), number_width)// &
      & right(to_text(outcome%energy_drift, 2), number_width)
    if (outcome%pareto) text = text//'  *'
    if (allocated(outcome%fault)) text = text//'  no answer'
  end function row_text

  !> `a = 1, b = 2` of run `t`.
  function settings_text(plan, t) result(text)
    type(plan_type), intent(in) :: plan  !! of the study
    integer, intent(in) :: t             !! number of the run
    character(:), allocatable :: text
    integer :: v

    text = ''
    do v = 1, size(plan%variables)
      if (v > 1) text = text//', '
      text = text//plan%variables(v)%name//' = '//shown_word(plan%trials(t)%words(v))
    end do
  end function settings_text

  integer function settings_width(plan) result(width)
    type(plan_type), intent(in) :: plan
    integer :: t
    width = 0
    do t = 1, size(plan%trials)
      width = max(width, len(settings_text(plan, t)))
    end do
  end function settings_width

  !> Width of a variable's column, with the gap before it.
  pure integer function column_width(plan, v) result(width)
    type(plan_type), intent(in) :: plan
    integer, intent(in) :: v
    integer :: t

    width = len(plan%variables(v)%name)
    do t = 1, size(plan%trials)
      width = max(width, len(shown_word(plan%trials(t)%words(v))))
    end do
    width = width + 2
  end function column_width

  pure function right(text, width) result(cell)
    character(*), intent(in) :: text
    integer, intent(in) :: width
    character(:), allocatable :: cell
    cell = repeat(' ', max(1, width - len(text)))//text
  end function right

  pure function padded(text, width) result(cell)
    character(*), intent(in) :: text
    integer, intent(in) :: width
    character(:), allocatable :: cell
    cell = text//repeat(' ', max(0, width - len(text)))
  end function padded

  pure function fixed(value) result(text)
    real(wp), intent(in) :: value
    character(:), allocatable :: text
    character(24) :: buffer
    write (buffer, '(f12.2)') value
    text = trim(adjustl(buffer))
  end function fixed

  !> Put a text into a file of a folder, in one step: an older file is kept until then. An error if
  !> it cannot be written.
  subroutine put_file(directory, name, text, error)
    character(*), intent(in) :: directory  !! folder of the file, which is there
    character(*), intent(in) :: name       !! of the file
    character(*), intent(in) :: text       !! the whole of it
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: path
    character(512) :: message
    integer :: unit, status

    path = in_directory(directory, name)
    message = ''
    open (newunit=unit, file=path//'.part', status='replace', action='write', access='stream', &
      & form='unformatted', iostat=status, iomsg=message)
    if (status == 0) write (unit, iostat=status, iomsg=message) text
    if (status == 0) close (unit, iostat=status, iomsg=message)
    if (status /= 0) then
      call fail(error, "cannot write the file '"//path//"': "//trim(message))
      return
    end if
    call rename_file(path//'.part', path, error)
  end subroutine put_file

end module pd_study_trade_table
