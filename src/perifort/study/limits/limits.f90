!> Numerical limits of a scene: its largest stable step, measured, compared with equation 7.25 and
!> confirmed by short runs; the rounding error; the energy drift of the integrators.
module pd_study_limits_limits
  use, intrinsic :: iso_fortran_env, only: output_unit
  use omp_lib, only: omp_set_num_threads
  use pd_base_threads, only: is_worth_threads
  use pd_base_kinds, only: wp, i1
  use pd_base_clock, only: duration_text, wall_time
  use pd_base_error, only: error_type, fail, status_no_answer
  use pd_base_text, only: newline, to_text, with_unit
  use pd_force_bound, only: stiffness_bound
  use pd_output_fields_check, only: check_names
  use pd_output_report_begin, only: fields_of, run_options_type
  use pd_set_up_prepare, only: prepare, set_up_type
  use pd_motion_watch_fault, only: place
  use pd_motion_explicit_spectrum, only: spectrum_type, largest_frequency, lasting_frequency, &
    & stable_step_of
  use pd_motion_system, only: system_type, inverse_density
  use pd_motion_tangent, only: apply_tangent
  use pd_motion_explicit_time_step, only: printed_stiffness
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: scene_type
  use pd_study_limits_drift, only: study_drift
  use pd_study_limits_rounding, only: study_rounding
  use pd_study_limits_vibration, only: random_shape
  implicit none (type, external)
  private
  public :: run_limits, limits_type, measure_limits, growth_of

  real(wp), parameter :: accuracy = 2.0e-3_wp    !! of the largest omega^2
  real(wp), parameter :: just_below = 0.995_wp, just_above = 1.005_wp
  integer, parameter :: most_steps = 1000        !! of a confirming run
  !> Beyond this a disturbance has grown without bound: at 0.995 of the limit, none can grow more
  !> than 1/sqrt(1 - 0.995^2) = 10-fold in energy's norm.
  real(wp), parameter :: unbounded = 1.0e6_wp
  real(wp), parameter :: bounded = 1.0e3_wp

  !> Steps at which an oscillator of the body reaches omega dt = 2 [s], and where 7.25 is least.
  type :: limits_type
    real(wp) :: equation = 0.0_wp      !! 7.25 with surface factors
    real(wp) :: most = 0.0_wp          !! its largest value over the points
    real(wp) :: printed = 0.0_wp       !! 7.25 as printed; 0: its sum is negative somewhere
    logical :: chapter = .true.        !! the laws are the chapter's, which 7.25 is for
    integer :: slot = 0                !! where `equation` is least
    integer :: printed_slot = 0        !! where `printed` is
    real(wp) :: spectral = 0.0_wp      !! 2/omega of the body as it is
    real(wp) :: lasting = 0.0_wp       !! a lower bound for any broken bonds; 0: none can break
    type(spectrum_type) :: spectrum
  end type limits_type

contains

  !> Measure a scene and print the results, each part as soon as it is known, to `unit`. Everything
  !> but the building and the measurement of the largest frequency takes about `seconds`. An error
  !> if the scene cannot be set up, if nothing in it can vibrate, or if the runs contradict the
  !> measured limit.
  subroutine run_limits(scene, options, seconds, error, unit)
    type(scene_type), intent(in) :: scene  !! to be measured; a static one as if it were explicit
    type(run_options_type), intent(in) :: options  !! of the command line: the number of threads
    real(wp), intent(in) :: seconds  !! wall time of all but set-up and largest frequency, about [s]
    type(error_type), allocatable, intent(out) :: error
    integer, intent(in), optional :: unit          !! of the text; absent: standard output
    type(scene_type) :: explicit
    type(set_up_type) :: set_up
    type(limits_type) :: limits
    real(wp) :: begin
    integer :: out

    out = output_unit
    if (present(unit)) out = unit
    if (options%threads > 0) call omp_set_num_threads(options%threads)
    explicit = scene
    explicit%time%limit = 'equation'
    explicit%time%method = 'explicit'
    if (scene%time%method == 'relaxation') explicit%time%steps = 1
    call check_names(scene, fields_of(options), error)
    if (.not. allocated(error)) call prepare(explicit, set_up, error)
    if (allocated(error)) return
    if (set_up%system%model%generic) then
      call scene_fault(error, scene, 'material', 1, 'model', &
        & 'limits are measured for laws of the fast loops only', &
        & 'bond laws of the generic pass may change their stiffness, so that no frequency lasts')
      return
    end if
    associate (system => set_up%system)
      call choose_threads(options, system)
      if (scene%header%title /= '') write (out, '(a)') trim(scene%header%title)
      write (out, '(a)') '  '//to_text(system%body%n_points)//' points, '// &
        & to_text(system%family%n_bonds)//' bonds, '//system%family%describe()// &
        & system%workspace%describe()
      if (scene%time%method == 'relaxation') write (out, '(a)') '  The scene is static: '// &
        & 'these are the limits of explicit steps of its body, with the', &
        & '  densities given in &material, or 1 kg/m3 without one'
      write (out, '(a)') '  measuring the largest frequency, in a few hundred evaluations of '// &
        & 'the forces ...'
      flush (out)
      call measure_limits(system, limits)
      if (.not. limits%spectral < huge(1.0_wp)) then
        call fail(error, 'nothing can vibrate: every component of every point with bonds is '// &
          & 'constrained, so that there is no limit of the step')
        return
      end if
      write (out, '(a)') text_of(system, limits)
      flush (out)
      begin = wall_time()
      call confirm(system, limits%spectral, 0.2_wp*seconds, out, error)
      if (allocated(error)) return
      call study_rounding(system, limits%spectral, 0.25_wp*seconds, out, error)
      if (allocated(error)) return
      call study_drift(system, limits%spectral, seconds - (wall_time() - begin), out, error)
      if (allocated(error)) return
    end associate
    write (out, '(/, a, /, a, /, a)') 'step_equation_7_25 = '//to_text(limits%equation, 7), &
      & 'step_spectral = '//to_text(limits%spectral, 7), &
      & 'ratio = '//to_text(limits%spectral/limits%equation, 5)
  end subroutine run_limits

  !> 7.25 point by point and the largest frequency, about the present state of `system`.
  subroutine measure_limits(system, limits)
    type(system_type), intent(inout) :: system  !! at the state about which the forces are
                                                !! linearised
    type(limits_type), intent(out) :: limits    !! 7.25 and the measured steps [s]
    real(wp), allocatable :: sums(:)
    type(spectrum_type) :: lasting

    allocate (sums(system%body%n_slots), source=0.0_wp)
    call stiffness_bound(system%body, system%family, system%model, system%workspace, sums)
    call least_step(system, sums, limits%equation, limits%slot, limits%most)
    limits%chapter = .not. system%model%weighted
    if (limits%chapter) then
      call printed_stiffness(system%body, system%family, system%model, sums)
      call least_step(system, sums, limits%printed, limits%printed_slot)
    end if
    call largest_frequency(system, accuracy, limits%spectrum)
    limits%spectral = stable_step_of(limits%spectrum)
    if (.not. system%model%breaking) return
    call lasting_frequency(system, accuracy, lasting)
    limits%lasting = max(limits%equation, stable_step_of(lasting))
  end subroutine measure_limits

  !> The least and the largest sqrt(2 rho/sum) over the points, and the slot of the least; a
  !> negative sum has no step, 0 is given.
  subroutine least_step(system, sums, least, slot, most)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: sums(:)
    real(wp), intent(out) :: least
    integer, intent(out) :: slot
    real(wp), intent(out), optional :: most
    real(wp) :: step
    integer :: i, k

    least = huge(least)
    slot = 0
    if (present(most)) most = 0.0_wp
    do i = 1, system%body%n_points
      k = system%body%slot(i)
      if (.not. abs(sums(k)) > 0.0_wp) cycle
      step = 0.0_wp
      if (sums(k) > 0.0_wp) step = sqrt(2/(inverse_density(system%model, k)*sums(k)))
      if (present(most)) most = max(most, step)
      ! differences within the tolerance are ties: the position must not depend on rounding
      if (step >= least*(1 - 1.0e-9_wp)) cycle
      least = step
      slot = k
    end do
  end subroutine least_step

  !> What was measured, in lines.
  function text_of(system, limits) result(text)
    type(system_type), intent(in) :: system
    type(limits_type), intent(in) :: limits
    character(:), allocatable :: text

    text = newline//'Largest stable step: omega dt = 2, as forward_backward has it; for '// &
      & 'adams_bashforth 0.36 of it,'//newline//'adams_moulton 0.645, runge_kutta 1.415'//newline
    text = text//'  7.25 as used     '//with_unit(limits%equation, 's', 6)//', least at '// &
      & where_is(system, limits%slot)//'; elsewhere up to '//with_unit(limits%most, 's', 4)//newline
    if (.not. limits%chapter) then
      text = text//"  7.25 as printed  is for the chapter's laws with influence = 'inverse'"// &
        & newline
    else if (limits%printed > 0.0_wp) then
      text = text//'  7.25 as printed  '//with_unit(limits%printed, 's', 6)//', least at '// &
        & where_is(system, limits%printed_slot)//', without surface factors'//newline
    else
      text = text//'  7.25 as printed  has no value: its sum is negative at '// &
        & where_is(system, limits%printed_slot)//newline
    end if
    text = text//'  spectral         '//with_unit(limits%spectral, 's', 6)//', '// &
      & to_text(limits%spectral/limits%equation, 4)//' of 7.25 as used'
    if (limits%printed > 0.0_wp) text = text//', '// &
      & to_text(limits%spectral/limits%printed, 4)//' of 7.25 as printed'
    text = text//newline//'                   ('//to_text(limits%spectrum%evaluations)// &
      & ' evaluations of the forces; omega^2 to '// &
      & to_text(100*limits%spectrum%residual/limits%spectrum%squared, 1)//' %)'//newline
    if (limits%lasting > 0.0_wp) text = text//'  bonds breaking   '// &
      & with_unit(limits%lasting, 's', 6)//', '//to_text(limits%lasting/limits%equation, 4)// &
      & " of 7.25 as used: valid for any broken bonds, used by &time limit = 'spectral'"//newline
    text = text//'Check by the growth of a small random disturbance:'
  end function text_of

  !> A point and its place.
  function where_is(system, slot) result(text)
    type(system_type), intent(in) :: system
    integer, intent(in) :: slot
    character(:), allocatable :: text
    text = 'point '//to_text(int(system%body%point(slot)))//' at ('//place(system, slot)//') m'
  end function where_is

  !> Run just below and just above the limit, print the growth of the disturbance, and fail if that
  !> contradicts the limit. The two runs share about `seconds`.
  subroutine confirm(system, limit, seconds, unit, error)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: limit, seconds
    integer, intent(in) :: unit
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: parts(2) = [just_below, just_above]
    character(:), allocatable :: text
    real(wp) :: growth
    integer :: steps, i

    do i = 1, 2
      call growth_of(system, parts(i)*limit, seconds/2, growth, steps)
      text = '  at '//to_text(parts(i))//' of it   amplitude times '//to_text(growth, 3)//' in '// &
        & to_text(steps)//' steps: '
      if (growth >= unbounded) then
        text = text//'unstable'
      else if (steps < most_steps) then
        text = text//'undecided: the time was used up'
      else if (growth < bounded) then
        text = text//'stable'
      else
        text = text//'undecided'
      end if
      write (unit, '(a)') text
      if ((i == 1 .and. growth >= unbounded) .or. &
        & (i == 2 .and. growth < unbounded .and. steps == most_steps)) then
        call fail(error, 'the runs contradict the measured limit of '//with_unit(limit, 's', 6)// &
          & '. Is the body near buckling, or unstable because of large strain?', &
          & status_no_answer)
        return
      end if
    end do
  end subroutine confirm

  !> How much a random disturbance of the present state grows (largest displacement over that of the
  !> start) by 7.8 and 7.9 with steps of `dt` [s] on the forces linearised about the state, until it
  !> has grown without bound, the steps are made, or `seconds` have gone by.
  subroutine growth_of(system, dt, seconds, growth, steps)
    type(system_type), intent(inout) :: system  !! at the state about which the forces are
                                                !! linearised
    real(wp), intent(in) :: dt                  !! time step [s]
    real(wp), intent(in) :: seconds             !! longest wall time [s]
    real(wp), intent(out) :: growth  !! largest amplitude over that of the start, at least 1 [-]
    integer, intent(out) :: steps               !! that were made, at most 1000
    real(wp), allocatable :: w(:, :), v(:, :), kw(:, :)
    real(wp) :: begin, start, kick
    integer :: k, c

    begin = wall_time()
    call random_shape(system, w)
    allocate (v, kw, source=0*w)
    start = maxval(abs(w))
    growth = 1.0_wp
    kick = dt/2
    do steps = 1, most_steps
      call apply_tangent(system, system%state%u, w, kw)
      do c = 1, size(w, 2)
        !$omp parallel do schedule(static) default(none) private(k) &
        !$omp shared(system, w, v, kw, kick, dt, c)
        do k = 1, size(w, 1)
          if (system%body%point(k) == 0 .or. system%held(k, c) == 1_i1) cycle
          v(k, c) = v(k, c) - kick*inverse_density(system%model, k)*kw(k, c)
          w(k, c) = w(k, c) + dt*v(k, c)
        end do
      end do
      kick = dt
      growth = max(growth, maxval(abs(w))/start)
      if (growth >= unbounded .or. steps == most_steps) exit
      if (wall_time() - begin > seconds) exit
    end do
  end subroutine growth_of

  !> Use one thread for a body whose step is over before another thread has woken, unless the user
  !> has asked for a number.
  subroutine choose_threads(options, system)
    type(run_options_type), intent(in) :: options
    type(system_type), intent(in) :: system
    if (options%threads == 0 .and. .not. is_worth_threads(system%family%n_bonds)) &
      & call omp_set_num_threads(1)
  end subroutine choose_threads

end module pd_study_limits_limits
