!> Energy drift of each integrator in a free vibration, at fractions of its own largest stable step.
module pd_study_limits_drift
  use pd_base_kinds, only: wp
  use pd_base_clock, only: wall_time
  use pd_base_error, only: error_type
  use pd_base_text, only: to_text, with_unit
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_system, only: system_type
  use pd_motion_explicit_time_step, only: integrator_limit
  use pd_study_limits_vibration, only: energy_watch_type, free_body, random_shape, smoothed
  implicit none (type, external)
  private
  public :: study_drift, slope_of

  character(16), parameter :: integrators(4) = [character(16) :: 'forward_backward', &
    & 'adams_bashforth', 'adams_moulton', 'runge_kutta']
  real(wp), parameter :: parts(3) = [0.5_wp, 0.8_wp, 0.95_wp]  !! of the integrator's largest step
  real(wp), parameter :: strain = 1.0e-6_wp  !! at the start: second-order terms are negligible
  integer, parameter :: looks = 50           !! at the energy, in each run
  integer, parameter :: passes = 60          !! of smoothing
  integer, parameter :: most_steps = 1000000

contains

  !> Run and print the table; `step` is 2/(largest omega) [s]. The runs share about `seconds`. An
  !> error if the free body cannot be built; a run that is unstable is a word in the table.
  subroutine study_drift(system, step, seconds, unit, error)
    type(system_type), intent(in) :: system  !! as the scene sets it up; it is not changed
    real(wp), intent(in) :: step             !! 2/(largest omega) [s]
    real(wp), intent(in) :: seconds          !! wall time that all runs may take, about [s]
    integer, intent(in) :: unit              !! of the table
    type(error_type), allocatable, intent(out) :: error
    type(system_type) :: body
    real(wp), allocatable :: rough(:, :), smooth(:, :)
    real(wp) :: each, dt, begin
    character(24) :: columns(2)
    integer :: i, p, every

    begin = wall_time()
    call free_body(system, 0.0_wp, 1.0_wp, body, error)
    if (allocated(error)) return
    call random_shape(body, rough)
    smooth = rough
    call smoothed(body, step, passes, smooth)
    write (unit, '(/, a, 3(/, a))') 'Energy drift of a free vibration: relative change in a '// &
      & 'million steps, extrapolated from the steps made;', 'where that is large, the number '// &
      & 'of steps in which the energy changes by half. smooth:', 'start without high '// &
      & 'frequencies; rough: start with all frequencies alike', &
      & '  integrator        part of its limit  steps made  smooth'// &
      & repeat(' ', 18)//'rough'
    do i = 1, size(integrators)
      do p = 1, size(parts)
        dt = parts(p)*step*integrator_limit(integrators(i))/2
        if (p == 1) each = seconds_of_step(body, integrators(i), dt, smooth)
        ! its share of the time that is left, for the two starts of this and of those to come
        every = int(min(real(most_steps, wp), (seconds - (wall_time() - begin)) &
          & /(2*(12 - 3*(i - 1) - (p - 1))*each))/looks)
        every = max(1, every)
        call measure(body, integrators(i), dt, every, smooth, columns(1))
        call measure(body, integrators(i), dt, every, rough, columns(2))
        write (unit, '(a)') row(integrators(i), parts(p), every*looks, columns)
        flush (unit)
      end do
    end do
    write (unit, '(a)') '  velocity_verlet is the same scheme as forward_backward; most '// &
      & 'scenes are closer to the smooth start'
  end subroutine study_drift

  !> Wall time of a step [s].
  real(wp) function seconds_of_step(body, integrator, dt, shape) result(seconds)
    type(system_type), intent(inout) :: body
    character(*), intent(in) :: integrator
    real(wp), intent(in) :: dt
    real(wp), intent(in) :: shape(:, :)
    type(energy_watch_type) :: nothing
    type(error_type), allocatable :: fault
    real(wp) :: begin
    integer :: steps

    body%state%u = strain*shape
    body%state%v = 0.0_wp
    steps = 10
    do
      begin = wall_time()
      call run_explicit(body, trim(integrator), dt, steps, nothing, fault)
      seconds = (wall_time() - begin)/steps
      if (seconds*steps > 0.02_wp .or. allocated(fault)) exit
      steps = 2*steps
    end do
  end function seconds_of_step

  !> One run from `shape`, and the change of its energy in words.
  subroutine measure(body, integrator, dt, every, shape, result)
    type(system_type), intent(inout) :: body
    character(*), intent(in) :: integrator
    real(wp), intent(in) :: dt
    integer, intent(in) :: every
    real(wp), intent(in) :: shape(:, :)
    character(24), intent(out) :: result
    type(energy_watch_type) :: watch
    type(error_type), allocatable :: fault
    real(wp) :: drift
    integer :: half

    watch%every = every
    watch%half_steps = integrator == 'forward_backward'
    body%state%u = strain*shape
    body%state%v = 0.0_wp
    call run_explicit(body, trim(integrator), dt, every*looks, watch, fault)
    if (allocated(fault)) then
      result = 'unstable'
      return
    end if
    drift = slope_of(watch%step, watch%energy)/watch%energy(1)
    half = findloc(watch%energy < watch%energy(1)/2, .true., dim=1)
    if (half > 0) then
      result = '-50 % in '//to_text(nint(watch%step(half)))
    else if (abs(drift) <= 0.5e-6_wp) then
      result = trim(merge('+', ' ', drift > 0.0_wp))//to_text(1.0e6_wp*drift, 2)
    else if (drift < 0.0_wp) then
      result = '-50 % in '//trim(with_unit(0.5_wp/abs(drift), '', 2))
    else
      result = '+50 % in '//trim(with_unit(0.5_wp/abs(drift), '', 2))
    end if
  end subroutine measure

  !> Slope of the straight line through values, by least squares.
  pure real(wp) function slope_of(x, y) result(slope)
    real(wp), intent(in) :: x(:)  !! (n), not all alike
    real(wp), intent(in) :: y(:)  !! (n)
    real(wp) :: middle
    middle = sum(x)/size(x)
    slope = sum((x - middle)*y)/sum((x - middle)**2)
  end function slope_of

  function row(integrator, part, steps, columns) result(text)
    character(*), intent(in) :: integrator
    real(wp), intent(in) :: part
    integer, intent(in) :: steps
    character(*), intent(in) :: columns(2)
    character(:), allocatable :: text
    character(18) :: first
    character(19) :: second
    character(12) :: third

    first = integrator
    second = to_text(part, 2)
    third = to_text(steps)
    text = '  '//first//second//third//columns(1)//trim(columns(2))
  end function row

end module pd_study_limits_drift
