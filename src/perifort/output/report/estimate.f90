!> How long a run will take: its first steps are taken and timed, and so are a row of the history
!> and checks made at an output.
module pd_output_report_estimate
  use pd_base_kinds, only: wp
  use pd_base_clock, only: duration_text, wall_time
  use pd_base_error, only: error_type, fail, status_interrupted
  use pd_base_numbers, only: ascending
  use pd_base_text, only: line => labelled_line, newline, to_text, with_unit
  use pd_scene_content_types, only: scene_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_observer, only: observer_type, instant_type
  use pd_set_up_plan, only: plan_type
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_motion_account, only: energies_type, energies_of, velocities_now
  use pd_motion_system, only: system_type
  use pd_output_report_contact, only: touching_points
  use pd_output_fields_field, only: output_field_type
  use pd_output_fields_table, only: field_table_type
  use pd_output_results_types, only: field_type
  use pd_output_report_schedule, only: planned_outputs, planned_rows, schedule_type
  use pd_output_report_strain, only: find_large_strains
  implicit none (type, external)
  private
  public :: estimate

  integer, parameter :: most_timed = 200        !! steps
  integer, parameter :: least_timed = 3         !! steps, however long they take
  real(wp), parameter :: enough = 0.5_wp        !! time of all timed steps [s]
  real(wp), parameter :: fast_disk = 1.0e9_wp, slow_disk = 1.0e8_wp  !! [bytes/s]

  !> Times the steps of a motion and ends it when it has seen enough.
  type, extends(observer_type) :: stopwatch_type
    integer :: n = -2                           !! steps timed; the first one touches the memory
    real(wp) :: last = 0.0_wp                   !! [s]
    real(wp) :: seconds(most_timed) = 0.0_wp    !! of each step [s]
  contains
    procedure :: observe
  end type stopwatch_type

contains

  !> Predict the time of a run from its first steps; the system is used up. Each line of `text` ends
  !> with a newline.
  subroutine estimate(scene, table, system, plan, schedule, set_up, text)
    type(scene_type), intent(in) :: scene
    type(field_table_type), intent(in) :: table  !! of the fields that the scene may name
    type(system_type), intent(inout) :: system
    type(plan_type), intent(in) :: plan
    type(schedule_type), intent(in) :: schedule
    real(wp), intent(in) :: set_up               !! time of all before the first step [s]
    character(:), allocatable, intent(out) :: text
    type(stopwatch_type) :: watch
    type(error_type), allocatable :: fault
    integer, allocatable :: order(:)
    real(wp) :: step, fast, slow, row, output, bytes, least, most
    integer :: n

    if (plan%relaxes) then
      call run_relaxation(system, plan%relaxation, watch, fault)
    else
      call run_explicit(system, plan%integrator, plan%step, plan%steps, watch, fault)
    end if
    if (allocated(fault)) then
      if (fault%status /= status_interrupted) then
        text = line('run time', 'not predicted, because the run fails: '//first_line(fault%message))
        return
      end if
    end if
    n = max(0, watch%n)
    if (n == 0) then
      text = line('run time', 'not predicted: the run is too short to time')
      return
    end if
    order = ascending(watch%seconds(:n))
    step = watch%seconds(order((n + 1)/2))
    fast = watch%seconds(order((n + 3)/4))
    slow = watch%seconds(order((3*n + 3)/4))
    call time_row(system, row)
    call time_output(system, output)
    bytes = bytes_of_output(scene, table, system)
    if (plan%relaxes) then
      text = line('run time', 'depends on the number of iterations, which is not known '// &
        & 'before the run')//line('an iteration', with_unit(step, 's', 3)//' (measured)')
    else
      least = set_up + plan%steps*fast + planned_rows(schedule)*row &
        & + planned_outputs(schedule, plan%step)*(output + bytes/fast_disk)
      most = set_up + plan%steps*slow*1.1_wp + planned_rows(schedule)*row*1.1_wp &
        & + planned_outputs(schedule, plan%step)*(output*1.1_wp + bytes/slow_disk)
      text = line('run time', between(least, most)//' with history and output (predicted)')// &
        & line('a step', with_unit(step, 's', 3)//' (measured); '//to_text(plan%steps)//' steps')
    end if
    text = text//line('a history row', with_unit(row, 's', 3)//' (measured); one after every '// &
      & due(schedule))
    text = text//line('an output', with_unit(bytes, 'B', 3)//'; '// &
      & with_unit(output, 's', 3)//' (measured) before it is written; '// &
      & to_text(planned_outputs(schedule, plan%step))//' outputs')
  end subroutine estimate

  !> When rows of the history are due. In relaxation `history_every` is about `iterations.csv`.
  pure function due(schedule) result(text)
    type(schedule_type), intent(in) :: schedule
    character(:), allocatable :: text

    if (schedule%relaxation) then
      text = 'load step'
    else if (schedule%history_every == 1) then
      text = 'step'
    else
      text = to_text(schedule%history_every)//' steps'
    end if
  end function due

  !> Time the step that is over, and end the motion when enough are timed.
  subroutine observe(observer, system, instant, error)
    class(stopwatch_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: now

    if (instant%rescued) return
    now = wall_time()
    observer%n = observer%n + 1
    if (observer%n > 0) observer%seconds(observer%n) = now - observer%last
    observer%last = now
    if (observer%n < least_timed) return
    if (observer%n == most_timed .or. sum(observer%seconds(:observer%n)) > enough) &
      & call fail(error, 'timed '//to_text(observer%n)//' steps of '// &
      & to_text(system%body%n_points)//' points', status_interrupted)
  end subroutine observe

  !> Time of a row of the history [s]: the second of two, when the memory has been touched.
  subroutine time_row(system, seconds)
    type(system_type), intent(inout) :: system
    real(wp), intent(out) :: seconds
    type(energies_type) :: energies
    real(wp), allocatable :: v(:, :)
    real(wp) :: began
    integer :: i

    do i = 1, 2
      began = wall_time()
      call velocities_now(system, 0.0_wp, 0.0_wp, v)
      call energies_of(system, v, energies)
      seconds = wall_time() - began
    end do
  end subroutine time_row

  !> Time of the checks at an output [s]: contact and large strains.
  subroutine time_output(system, seconds)
    type(system_type), intent(inout) :: system
    real(wp), intent(out) :: seconds
    real(wp) :: began, stretch
    integer :: first, second

    began = wall_time()
    call touching_points(system%body, system%family, system%state%u, first, second)
    call find_large_strains(system, first, second, stretch)
    seconds = wall_time() - began
  end subroutine time_output

  !> Bytes of one output.
  pure real(wp) function bytes_of_output(scene, table, system) result(bytes)
    type(scene_type), intent(in) :: scene
    type(field_table_type), intent(in) :: table
    type(system_type), intent(in) :: system
    type(output_field_type) :: field
    type(field_type) :: entry
    integer :: f

    bytes = 0.0_wp
    do f = 1, size(scene%output%fields)
      field = table%field(trim(scene%output%fields(f)))
      entry = field%in_file(system%body%dim)
      bytes = bytes + entry%components*real(system%body%n_points, wp) &
        & *merge(4, 8, scene%output%precision == 'single')
    end do
    if (scene%output%format == 'both') bytes = 2*bytes
  end function bytes_of_output

  !> Two durations as a range, or one if they read alike.
  pure function between(least, most) result(text)
    real(wp), intent(in) :: least, most          !! [s]
    character(:), allocatable :: text
    text = duration_text(least)
    if (text /= duration_text(most)) text = text//' to '//duration_text(most)
  end function between

  !> A text up to its first line break.
  pure function first_line(text) result(line_of_text)
    character(*), intent(in) :: text
    character(:), allocatable :: line_of_text
    line_of_text = text
    if (index(text, newline) > 0) line_of_text = text(:index(text, newline) - 1)
  end function first_line

end module pd_output_report_estimate
