!> What a run will do in time: the step and its number, or the relaxation's mass.
module pd_set_up_plan
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type, internal_fault
  use pd_base_text, only: to_text
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: scene_type, is_set
  use pd_motion_static_relaxation, only: relaxation_type
  use pd_motion_explicit_spectrum, only: spectrum_type, largest_frequency, lasting_frequency, &
    & stable_step_of, may_be_unstable, lowest_eigenvalue
  use pd_motion_system, only: system_type
  use pd_motion_explicit_time_step, only: stiffness_bound, stable_step, printed_step, book_step, &
    & chapter_stiffness, constant_stiffness, integrator_limit
  implicit none (type, external)
  private
  public :: plan_type, make_plan, depth_of

  !> Of the square of the largest frequency; the step is at most half of it less than the largest.
  real(wp), parameter :: accuracy = 0.01_wp
  real(wp), parameter :: default_safety = 5.0_wp  !! of the masses that are not stable by themselves

  type :: plan_type
    logical :: relaxes = .false.
    character(:), allocatable :: integrator
    real(wp) :: step = 0.0_wp          !! [s]
    integer :: steps = 0
    real(wp) :: limit = 0.0_wp         !! of the step, for the integrator [s]
    real(wp) :: equation = 0.0_wp      !! 7.25 in the form that is used, for the integrator [s]
    logical :: spectral = .false.      !! the limit is from the largest frequency, not from 7.25
    integer :: evaluations = 0         !! of the forces, that the largest frequency took
    real(wp) :: printed = 0.0_wp       !! 7.25 as printed [s], 0 if it has no value
    real(wp) :: book = 0.0_wp          !! the book's estimate sqrt(2 rho dx/(V_h c)) [s]
    real(wp) :: lowest = 0.0_wp        !! < 0: the body is unstable as it stands, by this eigenvalue
                                       !! of its stiffness over the largest one [-]
    type(relaxation_type) :: relaxation
  end type plan_type

contains

  !> Make the plan of a scene for its system.
  subroutine make_plan(scene, system, plan, error)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(inout) :: system
    type(plan_type), intent(out) :: plan
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: bound(:)

    allocate (bound(system%body%n_slots))
    call stiffness_bound(system%body, system%family, system%model, bound)
    plan%relaxes = scene%time%method == 'relaxation'
    plan%integrator = trim(scene%time%integrator)
    if (.not. any(bound > 0.0_wp)) then
      call scene_fault(error, scene, 'horizon', 1, merge('length', 'ratio ', &
        & is_set(scene%horizon%length)), &
        & 'no point of the scene has a neighbour within the horizon: there is nothing to compute', &
        & 'is the horizon''s ratio or length too small?')
      return
    end if
    if (may_be_unstable(system)) call lowest_eigenvalue(system, plan%lowest)
    if (plan%relaxes) then
      call plan_relaxation(scene, system, bound, plan%relaxation)
      plan%steps = plan%relaxation%load_steps
      return
    end if
    plan%equation = stable_step(system%body, system%model, bound) &
      & *integrator_limit(plan%integrator)/2
    plan%limit = plan%equation
    if (scene%time%limit == 'spectral') call measure_limit(system, plan)
    call printed_step(system%body, system%family, system%model, plan%printed)
    plan%book = book_step(system%model, system%body%dim, system%family%rule%delta, &
      & depth_of(scene), minval(system%body%spacing, mask=system%body%point > 0))
    plan%step = scene%time%safety*plan%limit
    if (is_set(scene%time%step)) plan%step = scene%time%step
    if (.not. plan%step > 0.0_wp) then
      call scene_fault(error, scene, 'time', 1, 'step', 'a time step of '//to_text(plan%step)// &
        & ' s leads nowhere', 'it must be above 0 (the stable step is '//to_text(plan%limit)//' s)')
      return
    end if
    plan%steps = scene%time%steps
    if (.not. is_set(scene%time%duration)) return
    if (scene%time%duration/plan%step > 0.9_wp*huge(1)) then
      call scene_fault(error, scene, 'time', 1, 'duration', 'the duration of '// &
        & to_text(scene%time%duration)//' s needs '//to_text(scene%time%duration/plan%step)// &
        & ' steps of '//to_text(plan%step)//' s', 'there may be '//to_text(huge(1)))
      return
    end if
    plan%steps = max(1, ceiling(scene%time%duration/plan%step*(1 - 1.0e-12_wp)))
    plan%step = scene%time%duration/plan%steps
  end subroutine make_plan

  !> The limit of the step from the largest frequency at the start: of the body as it is, or, where
  !> bonds can break, one that no breaking can lower, so that it needs no second look.
  subroutine measure_limit(system, plan)
    type(system_type), intent(inout) :: system
    type(plan_type), intent(inout) :: plan
    type(spectrum_type) :: spectrum
    real(wp) :: step

    if (system%model%breaking) then
      call lasting_frequency(system, accuracy, spectrum)
    else
      call largest_frequency(system, accuracy, spectrum)
    end if
    plan%evaluations = spectrum%evaluations
    step = stable_step_of(spectrum)*integrator_limit(plan%integrator)/2
    ! both bound every broken state of the body; where all is held, nothing vibrates
    if (.not. spectrum%squared > 0.0_wp) return
    if (system%model%breaking .and. step < plan%equation) return
    plan%spectral = .true.
    plan%limit = step
  end subroutine measure_limit

  !> The fictitious mass of every component, for a step of 1.
  subroutine plan_relaxation(scene, system, bound, relaxation)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: bound(:)
    type(relaxation_type), intent(out) :: relaxation
    real(wp) :: safety
    integer :: c

    relaxation%conjugate_gradient = scene%relaxation%solver == 'conjugate_gradient'
    relaxation%load_steps = scene%relaxation%load_steps
    relaxation%maximum_iterations = scene%relaxation%maximum_iterations
    relaxation%tolerance = scene%relaxation%tolerance
    allocate (relaxation%mass(system%body%n_slots, system%body%dim), source=0.0_wp)
    safety = default_safety
    if (scene%relaxation%density_matrix == 'frame_invariant') safety = 1.0_wp
    if (is_set(scene%relaxation%safety)) safety = scene%relaxation%safety
    select case (scene%relaxation%density_matrix)
    case ('chapter')
      call chapter_stiffness(system%body, system%family, system%model, relaxation%mass)
      relaxation%mass = safety*relaxation%mass/4
    case ('constant')
      call constant_stiffness(system%body, system%model, system%family%rule%delta, &
        & depth_of(scene), relaxation%mass(:, 1))
      do c = system%body%dim, 1, -1
        relaxation%mass(:, c) = safety*relaxation%mass(:, 1)/4
      end do
    case ('frame_invariant')
      do c = 1, system%body%dim
        relaxation%mass(:, c) = safety*bound/2
      end do
    case default
      call internal_fault('unknown density matrix')
    end select
  end subroutine plan_relaxation

  !> What turns dx^dim into a volume: thickness in 2D, area in 1D.
  pure real(wp) function depth_of(scene) result(depth)
    type(scene_type), intent(in) :: scene
    select case (scene%header%dimension)
    case (1); depth = scene%header%area
    case (2); depth = scene%header%thickness
    case default; depth = 1.0_wp
    end select
  end function depth_of

end module pd_set_up_plan
