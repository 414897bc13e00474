!> The rounding error of a run: the same free vibration with displacements of any size, far
!> from the origin, and in other sizes, compared digit by digit.
module pd_study_limits_rounding
  use pd_base_kinds, only: wp
  use pd_base_clock, only: wall_time
  use pd_base_error, only: error_type
  use pd_base_text, only: to_text
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_system, only: system_type
  use pd_study_limits_vibration, only: energy_watch_type, free_body, in_points, put_points, &
    & random_shape, smoothed
  implicit none (type, external)
  private
  public :: study_rounding, digits_of

  real(wp), parameter :: without_curvature = 1.0e-20_wp  !! strain at which all is linear
  real(wp), parameter :: tiny_strain = 1.0e-10_wp        !! up to which second order is no matter
  real(wp), parameter :: slope_strain = 1.0e-5_wp        !! at which the geometry's share is taken
  real(wp), parameter :: usual = 1.0e-6_wp               !! that of the moved and resized bodies
  real(wp), parameter :: strains(8) = [1.0e-12_wp, 1.0e-10_wp, 1.0e-8_wp, 1.0e-6_wp, 1.0e-4_wp, &
    & 1.0e-3_wp, 1.0e-2_wp, 1.0e-1_wp]
  integer, parameter :: most_steps = 200, least_steps = 20
  integer, parameter :: passes = 60                      !! of smoothing

contains

  !> Run and print the table; `step` is the largest stable step [s]. The runs share about `seconds`.
  !> An error if a free body cannot be built, or if a run of those compared with fails.
  subroutine study_rounding(system, step, seconds, unit, error)
    type(system_type), intent(in) :: system  !! as the scene sets it up; it is not changed
    real(wp), intent(in) :: step             !! largest stable step [s]
    real(wp), intent(in) :: seconds          !! wall time that all runs may take, about [s]
    integer, intent(in) :: unit              !! of the table
    type(error_type), allocatable, intent(out) :: error
    type(system_type) :: body
    real(wp), allocatable :: shape(:, :), start(:, :), linear(:, :), slope(:, :)
    real(wp), allocatable :: reference(:, :), answer(:, :)
    real(wp) :: size_of_body, begin, least
    type(error_type), allocatable :: fault
    integer :: steps, i

    call free_body(system, 0.0_wp, 1.0_wp, body, error)
    if (allocated(error)) return
    call random_shape(body, shape)
    call smoothed(body, step, passes, shape)
    call in_points(body%body, shape, start)
    ! a few steps to measure the time of a step
    begin = wall_time()
    call vibrate(body, start, without_curvature, step, least_steps, linear, error)
    if (allocated(error)) return
    steps = int(min(real(most_steps, wp), seconds/14*least_steps/(wall_time() - begin)))
    steps = max(steps, least_steps)

    call vibrate(body, start, without_curvature, step, steps, linear, error)
    if (allocated(error)) return
    call vibrate(body, start, slope_strain, step, steps, slope, error)
    if (allocated(error)) return
    call vibrate(body, -start, slope_strain, step, steps, answer, error)
    if (allocated(error)) return
    slope = (slope + answer)/(2*slope_strain)
    write (unit, '(/, a, 3(/, a))') 'Rounding error of a free vibration without high '// &
      & 'frequencies after '//to_text(steps)//' steps: relative', 'difference from the run '// &
      & 'with a strain of 1e-20. The geometric nonlinearity is the part of the', &
      & 'difference that is of first order in the strain; the last column counts the digits '// &
      & 'that agree without it.', &
      & '  largest strain  difference without nonlinearity          digits'
    least = 16.0_wp
    do i = 1, size(strains)
      call vibrate(body, start, strains(i), step, steps, answer, fault)
      if (allocated(fault)) then
        write (unit, '(a)') '  '//to_text(strains(i), 1)//': '//fault%message
        exit
      end if
      write (unit, '(a)') row(to_text(strains(i), 1), answer, linear, strains(i)*slope)
      flush (unit)
      if (strains(i) <= tiny_strain) &
        & least = min(least, digits_of(apart(answer - strains(i)*slope, linear)))
      if (strains(i) <= usual) call move_alloc(answer, reference)
    end do
    associate (x => system%body%x(system%body%slot, :))
      size_of_body = maxval(maxval(x, 1) - minval(x, 1)) + maxval(system%body%spacing)
    end associate
    call twin('moved by 1e6', 1.0e6_wp*size_of_body, 1.0_wp)
    call twin('in nanometres', 0.0_wp, 1.0e-9_wp)
    call twin('in kilometres', 0.0_wp, 1.0e3_wp)
    if (allocated(error)) return
    write (unit, '(a)') '  The moved and the resized bodies have a strain of '// &
      & to_text(usual, 1)//'. They and strains up to '//to_text(tiny_strain, 1)//' agree to '// &
      & to_text(least, 3)//' digits'

  contains

    !> The run of the body elsewhere or in another size; times grow with the size.
    subroutine twin(label, shift, factor)
      character(*), intent(in) :: label
      real(wp), intent(in) :: shift, factor
      type(system_type) :: other
      real(wp), allocatable :: there(:, :)

      if (allocated(error)) return
      call free_body(system, shift, factor, other, error)
      if (allocated(error)) return
      if (other%family%n_bonds /= body%family%n_bonds) then
        least = 0.0_wp
        write (unit, '(a)') '  '//label//': has '//to_text(other%family%n_bonds)// &
          & ' bonds instead of '//to_text(body%family%n_bonds)// &
          & ': rounding of positions changes which bonds exist'
        return
      end if
      call vibrate(other, factor*start, usual, factor*step, steps, there, error)
      if (allocated(error)) return
      write (unit, '(a)') row(label, there/factor, reference)
      least = min(least, digits_of(apart(there/factor, reference)))
      flush (unit)
    end subroutine twin

  end subroutine study_rounding

  !> Displacements over `strain`, in point order, after `steps` of 0.8 of `step` from `strain` times
  !> `start`.
  subroutine vibrate(body, start, strain, step, steps, answer, error)
    type(system_type), intent(inout) :: body
    real(wp), intent(in) :: start(:, :)
    real(wp), intent(in) :: strain, step
    integer, intent(in) :: steps
    real(wp), allocatable, intent(out) :: answer(:, :)
    type(error_type), allocatable, intent(out) :: error
    type(energy_watch_type) :: nothing

    call put_points(body%body, start, strain, body%state%u)
    body%state%v = 0.0_wp
    call run_explicit(body, 'forward_backward', 0.8_wp*step, steps, nothing, error)
    if (allocated(error)) return
    call in_points(body%body, body%state%u, answer)
    answer = answer/strain
  end subroutine vibrate

  !> A line of the table; `share` is the geometry's.
  function row(label, answer, reference, share) result(text)
    character(*), intent(in) :: label
    real(wp), intent(in) :: answer(:, :), reference(:, :)
    real(wp), intent(in), optional :: share(:, :)
    character(:), allocatable :: text
    character(16) :: first
    character(11) :: second
    character(30) :: third
    character(4) :: last
    real(wp) :: remaining

    remaining = apart(answer, reference)
    first = label
    second = to_text(remaining, 2)
    if (present(share)) remaining = apart(answer - share, reference)
    third = to_text(remaining, 2)
    write (last, '(f4.1)') digits_of(remaining)
    text = '  '//first//second//third//last
  end function row

  !> The largest difference over the largest value.
  pure real(wp) function apart(a, b)
    real(wp), intent(in) :: a(:, :), b(:, :)
    apart = maxval(abs(a - b))/maxval(abs(b))
  end function apart

  !> Digits that agree, at most 16, of values that are `apart` relative to their size.
  pure real(wp) function digits_of(apart) result(digits)
    real(wp), intent(in) :: apart  !! difference over size, not negative [-]
    digits = 16.0_wp
    if (apart > 1.0e-16_wp) digits = max(0.0_wp, -log10(apart))
  end function digits_of

end module pd_study_limits_rounding
