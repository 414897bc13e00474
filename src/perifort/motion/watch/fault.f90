!> A motion that is none any more: where it went wrong, how, and the likely cause.
module pd_motion_watch_fault
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use pd_base_kinds, only: wp, i8
  use pd_base_order, only: owned_point
  use pd_body_body, only: number_at
  use pd_base_reduce, only: first_largest, first_where, largest_of_ranks, sum_of_ranks
  use pd_base_error, only: error_type, fail, status_no_answer
  use pd_base_text, only: newline, to_text, with_unit
  use pd_family_family, only: bonds_type, allocate_bonds
  use pd_force_reference, only: bond_state_type, state_of_bond
  use pd_motion_account, only: energies_type
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: faulty_slot, stays_within, points_at_once, explain_fault, check_strain_energy, place, &
    & greatest_stretch

  !> Points of a block whose rates are summed up by themselves: few enough to bound the largest,
  !> and a few kB of each array.
  integer, parameter :: points_at_once = 512
  real(wp), parameter :: large_stretch = 0.1_wp  !! beyond it a bond is noticeably stiffer [-]

contains

  !> The slot where a motion is none any more: a rate that is not finite, or that carries a point
  !> across its horizon in one step `dt`; 0 if all is well. Cheap enough for every step. `squares`
  !> gets the sum of the squares of all components, whose rounding depends on the number of threads:
  !> it is a bound for the watch over the energy, and no answer depends on its last digits.
  integer function faulty_slot(system, rate, dt, squares) result(slot)
    type(system_type), intent(in) :: system     !! its horizon
    real(wp), intent(in), contiguous :: rate(:, :)
      !! (n_slots, dim) velocities [m/s], or displacements of an iteration [m]
    real(wp), intent(in) :: dt                  !! time step [s], or 1
    real(wp), intent(out), optional :: squares  !! sum of the squares of `rate`
    real(wp) :: sum_of_all, sum_of_block, largest_sum
    integer :: block, first, last, c

    sum_of_all = 0.0_wp
    largest_sum = 0.0_wp
    !$omp parallel do schedule(static) default(none) shared(rate) &
    !$omp private(block, first, last, c, sum_of_block) reduction(+:sum_of_all) &
    !$omp reduction(max:largest_sum)
    do block = 1, (size(rate, 1) + points_at_once - 1)/points_at_once
      first = (block - 1)*points_at_once + 1
      last = min(block*points_at_once, size(rate, 1))
      do c = 1, size(rate, 2)
        sum_of_block = sum_of_squares(last - first + 1, rate(first:last, c))
        sum_of_all = sum_of_all + sum_of_block
        largest_sum = max(largest_sum, sum_of_block)
      end do
    end do
    sum_of_all = sum_of_ranks(system%body%order, sum_of_all)
    largest_sum = largest_of_ranks(system%body%order, largest_sum)
    if (present(squares)) squares = sum_of_all
    slot = 0
    if (.not. stays_within(system, rate, dt, sum_of_all, largest_sum)) &
      & slot = fastest_slot(system, rate)
  end function faulty_slot

  !> An explicit shape, so that the loop runs in vector registers.
  pure real(wp) function sum_of_squares(n, values)
    integer, intent(in) :: n
    real(wp), intent(in) :: values(n)
    sum_of_squares = sum(values**2)
  end function sum_of_squares

  !> Whether all rates are finite and carry no point across its horizon in one step `dt`. `squares`
  !> is the sum of their squares, `largest_sum` the largest one of a component of a block, whose
  !> root none of them exceeds: sums are formed in passing, where the largest rate would cost as
  !> much as the rest of the pass. They suffice as long as a block whose points all move alike moves
  !> by less than a twentieth of the horizon; else the largest rate is computed.
  logical function stays_within(system, rate, dt, squares, largest_sum)
    type(system_type), intent(in) :: system  !! its horizon
    real(wp), intent(in), contiguous :: rate(:, :)
      !! (n_slots, dim) velocities [m/s], or displacements of an iteration [m]
    real(wp), intent(in) :: dt           !! time step [s], or 1
    real(wp), intent(in) :: squares      !! sum of the squares of `rate`
    real(wp), intent(in) :: largest_sum  !! largest sum of the squares of one component in a block
    real(wp) :: largest
    integer :: k, c

    stays_within = ieee_is_finite(squares)
    if (.not. stays_within) return
    associate (delta => system%family%rule%delta)
      if (sqrt(largest_sum)*dt <= delta) return
      largest = 0.0_wp
      do c = 1, size(rate, 2)
        !$omp parallel do simd schedule(static) default(none) shared(rate, c) private(k) &
        !$omp reduction(max:largest)
        do k = 1, size(rate, 1)
          largest = max(largest, abs(rate(k, c)))
        end do
      end do
      stays_within = largest_of_ranks(system%body%order, largest)*dt <= delta
    end associate
  end function stays_within

  !> The slot of the first point with a rate that is not finite, else with the largest component.
  !> Where another rank owns that point, it is a slot of this one, and not `mine`.
  integer function fastest_slot(system, rate, mine) result(slot)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: rate(:, :)
    logical, intent(out), optional :: mine
    integer(i8) :: point

    point = first_where(system%body%order, any(.not. ieee_is_finite(rate), dim=2))
    if (point == 0_i8) point = first_largest(system%body%order, maxval(abs(rate), dim=2))
    if (present(mine)) mine = owned_point(system%body%order, point) > 0
    slot = system%body%slot(max(1, owned_point(system%body%order, point)))
  end function fastest_slot

  !> The error for a motion that is none any more after `step` steps of `dt` [s]. Which of the two
  !> faults it is stands in the system: a point flies off, or energy comes from nowhere.
  subroutine explain_fault(system, step, dt, error)
    type(system_type), intent(in) :: system  !! after the step that failed
    integer, intent(in) :: step              !! number of that step
    real(wp), intent(in) :: dt               !! time step [s]
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: text
    real(wp) :: speed, stretch, energy, supply
    integer :: k
    logical :: mine

    k = fastest_slot(system, system%state%v, mine)
    speed = norm2(system%state%v(k, :))
    stretch = greatest_stretch(system, k)
    text = 'unstable at step '//to_text(step)//', t = '//with_unit(step*dt, 's')//': point '// &
      & to_text(number_at(system%body, k))//' at ('//place(system, k)//') '
    if (.not. ieee_is_finite(speed)) then
      text = text//'has a velocity that is not a finite number'
    else if (speed*dt > system%family%rule%delta) then
      text = text//'moves '//to_text(speed*dt/system%family%rule%delta, 3)//' horizons in a step'
    else
      call system%watch%found(energy, supply)
      text = text//'is the fastest, with '//with_unit(speed, 'm/s', 3)//', while the body has '// &
        & with_unit(energy, 'J', 3)//' of energy, of which no more than '// &
        & with_unit(supply, 'J', 3)//' were put in'
    end if
    if (ieee_is_finite(stretch)) then
      text = text//'; its bonds are stretched by up to '//to_text(stretch, 3)
    else
      text = text//'; its bonds'' stretches are not finite numbers'
    end if
    text = text//'; the step of '//with_unit(dt, 's')
    if (system%stable_step > 0.0_wp) then
      text = text//' is '//to_text(dt/system%stable_step, 4)
      if (dt > system%stable_step) text = text//' times'
      if (.not. dt > system%stable_step) text = text//' of'
      text = text//' the stable one'
    end if
    call fail(error, text//newline//'  likely cause: '//likely_cause(), status_no_answer)
    error%elsewhere = .not. mine
    error%everywhere = .true.

  contains

    function likely_cause() result(cause)
      character(:), allocatable :: cause
      if (system%stable_step > 0.0_wp .and. dt > system%stable_step) then
        cause = 'the step is above the stable one; leave &time step out, or safety at 0.8'
      else if (.not. stretch <= large_stretch) then
        cause = 'a load or an imposed velocity beyond what the body bears, or bonds crushed '// &
          & 'or stretched by so much, which are stiffer than at rest; lower &time safety, give '// &
          & 'what moves at once a ramp_time, or the material a critical_stretch'
      else
        cause = 'something is moved faster than the waves in the body, or a load is beyond '// &
          & 'what it bears; give it a ramp_time, or lower &time safety'
      end if
    end function likely_cause
  end subroutine explain_fault

  !> An error if the strain energy at time `t` [s] is below zero [J]. Only a < 0 can make it so, by
  !> dilatation: with a Poisson's ratio near -1 the corrected dilatation of corners outweighs the
  !> energy of their bonds. Such a body has no static equilibrium and is unstable at any step. The
  !> projected dilatation leaves the sign of energies open that are small beside the kinetic one.
  subroutine check_strain_energy(system, energies, t, error)
    type(system_type), intent(in) :: system      !! its materials and the rounding of its energies
    type(energies_type), intent(in) :: energies  !! at this instant
    real(wp), intent(in) :: t                    !! time [s]
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: cause

    if (energies%strain >= -max(system%watch%rounding, 0.01_wp*energies%kinetic)) return
    if (.not. any(system%model%materials%a < 0.0_wp)) return
    cause = 'a Poisson''s ratio of '// &
      & to_text(minval(system%model%materials%poissons_ratio))
    if (system%model%surface) cause = cause//' with surface correction, which strengthens the '// &
      & 'dilatation of corners (surface_correction = ''none'' does not)'
    if (system%model%consistent) cause = 'weights of surface_correction = ''consistent'' that '// &
      & 'are below 0 (surface_correction = ''energy'' has none)'
    call fail(error, 'unstable by t = '//to_text(t)//' s: the strain energy is negative, '// &
      & with_unit(energies%strain, 'J', 3)//'. The cause is not the step but '// &
      & cause, status_no_answer)
  end subroutine check_strain_energy

  !> The largest stretch, in size, of the intact bonds of slot `k`; not finite if displacements
  !> around it are not.
  real(wp) function greatest_stretch(system, k) result(stretch)
    type(system_type), intent(in) :: system  !! at the present displacements
    integer, intent(in) :: k                 !! slot
    type(bonds_type) :: bonds
    type(bond_state_type) :: bond
    integer :: i

    stretch = 0.0_wp
    call allocate_bonds(system%family, bonds)
    call system%family%bonds_of(k, bonds)
    do i = 1, bonds%n
      if (.not. bonds%intact(i)) cycle
      if (.not. all(ieee_is_finite(system%state%u(bonds%j(i), :)))) then
        stretch = sum(abs(system%state%u(bonds%j(i), :)))
        return
      end if
      bond = state_of_bond(system%model, system%state%u, k, bonds, i)
      if (abs(bond%stretch) > abs(stretch)) stretch = bond%stretch
    end do
  end function greatest_stretch

  !> Position of a slot as text.
  pure function place(system, k) result(text)
    type(system_type), intent(in) :: system  !! its positions
    integer, intent(in) :: k                 !! slot
    character(:), allocatable :: text
    integer :: c

    text = to_text(system%body%x(k, 1))
    do c = 2, system%body%dim
      text = text//', '//to_text(system%body%x(k, c))
    end do
  end function place

end module pd_motion_watch_fault
