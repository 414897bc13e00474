!> Watches the energies of a run: an answer whose energy comes from nowhere is none.
!>
!> A step above the stable one shows soon by points that cross their horizon in a step, unless bonds
!> can break: then the body beats itself to dust, and nothing ever grows that fast. Its energies
!> show it: they grow without any work.
module pd_motion_watch
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type, fail, status_no_answer
  use pd_base_text, only: to_text, with_unit
  use pd_motion_observer, only: instant_type
  use pd_motion_system, only: system_type, energies_type
  implicit none (type, external)
  private
  public :: watch_type, cause_of_fault

  integer, parameter :: patience = 20  !! steps before a gain is judged: rules of work start roughly
  !> A gain of so many times what was put in is none of a stable step. A wave of frequency omega
  !> keeps an energy that differs from this one by 1/(1 - (omega dt/2)^2), which is 50 at 0.99 of
  !> the limit; beyond the limit it grows without end.
  real(wp), parameter :: most_gain = 100.0_wp

  type :: watch_type
    real(wp) :: stable_step = 0.0_wp         !! of the run's integrator [s], 0 if it has no steps
    logical, private :: begun = .false.
    integer, private :: first_step = 0
    real(wp), private :: start = 0.0_wp      !! energy at the start, before any work [J]
    real(wp), private :: supplied = 0.0_wp   !! the most that start and work have come to [J]
  contains
    procedure :: look
  end type watch_type

contains

  !> An error if the energies of an instant can't be those of a body in motion: strain energy below
  !> zero, or, in explicit runs, far more energy than was ever put in.
  subroutine look(watch, system, energies, instant, error)
    class(watch_type), intent(inout) :: watch
    type(system_type), intent(in) :: system
    type(energies_type), intent(in) :: energies
    type(instant_type), intent(in) :: instant
    type(error_type), allocatable, intent(out) :: error
    ! a strain below this is rounding
    real(wp), parameter :: smallest_strain = 1.0e-12_wp
    real(wp) :: noise, total, gain

    noise = maxval(system%model%materials%youngs_modulus)*smallest_strain**2 &
      & *sum(system%body%volume)
    ! the projected dilatation leaves the sign of small energies open
    if (energies%strain < -max(noise, 0.01_wp*energies%kinetic)) then
      call explain_negative(system, energies, instant, error)
      return
    end if
    if (watch%stable_step <= 0.0_wp) return
    total = energies%kinetic + energies%strain + system%dissipated
    if (.not. watch%begun) then
      watch%begun = .true.
      watch%first_step = instant%step
      watch%start = total - system%external_work
    end if
    watch%supplied = max(watch%supplied, watch%start + system%external_work)
    gain = total - watch%start - system%external_work
    if (instant%step < watch%first_step + patience) return
    if (gain <= most_gain*watch%supplied + noise) return
    call fail(error, 'unstable by t = '//to_text(instant%time)//' s (step '// &
      & to_text(instant%step)//'): of the energy of '//with_unit(total, 'J', 3)//' '// &
      & with_unit(gain, 'J', 3)//' come from nowhere. '// &
      & cause_of_fault(instant%dt, watch%stable_step), status_no_answer)
  end subroutine look

  !> Only a < 0 can make the strain energy negative, by dilatation: with a Poisson's ratio near -1
  !> the corrected dilatation of corners outweighs the energy of their bonds. Such a body has no
  !> state of rest and blows itself up, at any step.
  subroutine explain_negative(system, energies, instant, error)
    type(system_type), intent(in) :: system
    type(energies_type), intent(in) :: energies
    type(instant_type), intent(in) :: instant
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: advice

    advice = ''
    if (system%model%surface) advice = ' with surface correction, which strengthens the '// &
      & 'dilatation of corners (surface_correction = ''none'' does not)'
    call fail(error, 'unstable by t = '//to_text(instant%time)//' s: the strain energy is '// &
      & 'negative, '//with_unit(energies%strain, 'J', 3)//'. The cause is not the step but a '// &
      & 'Poisson''s ratio of '//to_text(minval(system%model%materials%poissons_ratio))//advice, &
      & status_no_answer)
  end subroutine explain_negative

  !> Whether steps of `dt` [s] are to blame for a motion that is none any more, and what to do.
  pure function cause_of_fault(dt, stable_step) result(text)
    real(wp), intent(in) :: dt, stable_step
    character(:), allocatable :: text

    if (dt > stable_step*(1 + 1.0e-9_wp)) then
      text = 'The step is '//to_text(dt/stable_step, 3)//' times the stable one of '// &
        & to_text(stable_step, 3)//' s: leave step out, or safety at 1 or below'
    else
      text = 'The step is not above the stable one of '//to_text(stable_step, 3)//' s. Likely '// &
        & 'cause: a load or an imposed velocity beyond what the body bears (ramp_time lets it '// &
        & 'grow), or bonds crushed or stretched by tens of per cent, which are stiffer than at '// &
        & 'rest (lower safety, or give a critical_stretch)'
    end if
  end function cause_of_fault

end module pd_motion_watch
