!> What a run will do in time: the step and its number, or the relaxation's mass.
module pd_set_up_plan
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type, internal_fault
  use pd_base_reduce, only: any_of_ranks, largest_of_ranks, least_over
  use pd_base_text, only: to_text
  use pd_set_up_substeps, only: bound_by_levels
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: scene_type, is_set
  use pd_scene_groups_relaxation, only: batch_of, safety_of
  use pd_motion_static_events, only: why_not_events
  use pd_motion_static_relaxation, only: relaxation_type
  use pd_motion_explicit_spectrum, only: spectrum_type, largest_frequency, lasting_frequency, &
    & stable_step_of, may_be_unstable, lowest_eigenvalue
  use pd_force_term, only: term_view_type
  use pd_law_material, only: several_stiffnesses
  use pd_motion_loads, only: other_terms
  use pd_motion_system, only: ask_bonds, inverse_density, system_type, view_of
  use pd_motion_explicit_time_step, only: stable_step, printed_step, book_step, &
    & chapter_stiffness, constant_stiffness, integrator_limit, damped_step
  implicit none (type, external)
  private
  public :: plan_type, make_plan, steps_of, depth_of

  !> Of the square of the largest frequency; the step is at most half of it less than the largest.
  real(wp), parameter :: accuracy = 0.01_wp

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

  !> Make the plan of a scene for its system. An error is set if no point has a neighbour, if the
  !> step is not above 0, or if there would be too many steps.
  subroutine make_plan(scene, system, plan, error)
    type(scene_type), intent(in) :: scene       !! a checked scene
    type(system_type), intent(inout) :: system
      !! ready at t = 0; its state stays as it is
    type(plan_type), intent(out) :: plan        !! what the run will do
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: bound(:), rows(:)
    real(wp) :: stiffness, damping  ! of the terms of the force, over the density

    call bound_terms(system, bound, rows, stiffness, damping)
    plan%relaxes = scene%time%method == 'relaxation'
    plan%integrator = trim(scene%time%integrator)
    if (.not. any_of_ranks(system%body%order, any(bound > rows/2))) then
      call scene_fault(error, scene, 'horizon', 1, merge('length', 'ratio ', &
        & is_set(scene%horizon%length)), &
        & 'no point of the scene has a neighbour within the horizon: there is nothing to compute', &
        & 'is the horizon''s ratio or length too small?')
      return
    end if
    if (may_be_unstable(system)) call lowest_eigenvalue(system, plan%lowest)
    if (system%model%consistent .and. plan%lowest < 0.0_wp) then
      call scene_fault(error, scene, 'horizon', 1, 'surface_correction', &
        & "surface_correction = 'consistent' makes this body unstable: its stiffness has an "// &
        & 'eigenvalue of '//to_text(plan%lowest, 2)//' of the largest one', &
        & remedy_of(system)//", or surface_correction = 'energy'")
      return
    end if
    if (plan%relaxes) then
      call plan_relaxation(scene, system, bound, rows, plan%relaxation)
      plan%steps = plan%relaxation%load_steps
      call plan_growth(scene, system, plan%relaxation, error)
      return
    end if
    call bound_by_levels(system, bound)
    plan%equation = stable_step(system%body, system%model, bound) &
      & *integrator_limit(plan%integrator)/2
    if (damping > 0.0_wp) plan%equation = damped_step(plan%equation, damping, plan%integrator)
    plan%limit = plan%equation
    if (scene%time%limit == 'spectral') call measure_limit(system, stiffness, damping, plan)
    if (.not. (system%model%weighted .or. system%model%generic)) &
      & call printed_step(system%body, system%family, system%model, plan%printed)
    plan%book = book_step(system%model, system%body%dim, system%family%rule%delta, &
      & depth_of(scene), least_over(system%body%order, &
      & system%body%spacing))
    plan%step = scene%time%safety*plan%limit
    if (is_set(scene%time%step)) plan%step = scene%time%step
    if (.not. plan%step > 0.0_wp) then
      call scene_fault(error, scene, 'time', 1, 'step', 'a time step of '//to_text(plan%step)// &
        & ' s is too small', 'it must be above 0 (the stable step is '//to_text(plan%limit)//' s)')
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
    plan%steps = steps_of(scene%time%duration, plan%step)
    plan%step = scene%time%duration/plan%steps
  end subroutine make_plan

  !> What may make a body stable with consistent weights.
  function remedy_of(system) result(text)
    type(system_type), intent(in) :: system
    character(:), allocatable :: text

    if (size(system%body%parts) > 0) then
      text = 'use more elements across its thinnest part, or move layers instead of loads on facets'
    else if (several_stiffnesses(system%model%materials)) then
      text = 'use materials that differ less'
    else
      text = 'use more points at round and thin parts, small holes and corners, or move layers '// &
        & 'instead of loads on sides there'
    end if
  end function remedy_of

  !> The fewest steps of at most `step` that make up `duration`; a quotient that only rounding has
  !> lifted above a whole number is that number.
  pure integer function steps_of(duration, step) result(steps)
    real(wp), intent(in) :: duration  !! of the run [s]
    real(wp), intent(in) :: step      !! the longest step allowed [s]
    steps = max(1, ceiling(duration/step*(1 - 1.0e-12_wp)))
  end function steps_of

  !> The limit of the step from the largest frequency at the start: of the body as it is, or, where
  !> bonds can break, one that holds for any broken bonds, so that it is computed only once.
  subroutine measure_limit(system, stiffness, damping, plan)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: stiffness  !! what the terms of the force add to omega^2 [1/s2]
    real(wp), intent(in) :: damping    !! largest rate at which they slow down [1/s]
    type(plan_type), intent(inout) :: plan
    type(spectrum_type) :: spectrum
    real(wp) :: step

    if (system%model%breaking) then
      call lasting_frequency(system, accuracy, spectrum)
    else
      call largest_frequency(system, accuracy, spectrum)
    end if
    ! the terms may be stiffer later than they are now
    if (spectrum%squared > 0.0_wp) spectrum%squared = spectrum%squared + stiffness
    plan%evaluations = spectrum%evaluations
    step = stable_step_of(spectrum)*integrator_limit(plan%integrator)/2
    if (damping > 0.0_wp) step = damped_step(step, damping, plan%integrator)
    ! both bound every broken state of the body; where all is held, nothing vibrates
    if (.not. spectrum%squared > 0.0_wp) return
    if (system%model%breaking .and. step < plan%equation) return
    plan%spectral = .true.
    plan%limit = step
  end subroutine measure_limit

  !> The bound M of 7.25 of all terms of the force, half of what a row of the stiffness sums up to,
  !> and what terms beside the bonds do to it.
  subroutine bound_terms(system, bound, rows, stiffness, damping)
    type(system_type), intent(inout), target :: system  !! left as it is
    real(wp), allocatable, intent(out) :: bound(:)  !! (n_slots) M_k [N/m4]
    real(wp), allocatable, intent(out) :: rows(:)
      !! (n_slots) bound of the stiffness of the terms beside the bonds [N/m4]
    real(wp), intent(out) :: stiffness  !! the largest of these over the density [1/s2]
    real(wp), intent(out) :: damping    !! the largest rate at which they slow down [1/s]
    real(wp), allocatable :: rates(:)
    type(term_view_type) :: view
    integer :: k

    stiffness = 0.0_wp
    damping = 0.0_wp
    allocate (bound(system%body%n_slots), rows(system%body%n_slots), source=0.0_wp)
    call view_of(system, 0.0_wp, view)
    if (other_terms(system%terms) > 0) call system%terms%add_stiffness_bound(view, rows)
    call ask_bonds(system, view)
    call system%terms%add_stiffness_bound(view, bound)
    bound = bound/2
    if (other_terms(system%terms) == 0) return
    allocate (rates(size(bound)), source=0.0_wp)
    call system%terms%add_damping_bound(view, rates)
    do k = 1, size(bound)
      if (system%body%point(k) == 0) cycle
      stiffness = max(stiffness, rows(k)*inverse_density(system%model, k))
      damping = max(damping, rates(k)*inverse_density(system%model, k))
    end do
    stiffness = largest_of_ranks(system%body%order, stiffness)
    damping = largest_of_ranks(system%body%order, damping)
  end subroutine bound_terms

  !> The fictitious mass of every component, for a step of 1.
  subroutine plan_relaxation(scene, system, bound, rows, relaxation)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: bound(:)
    real(wp), intent(in) :: rows(:)    !! bound of the terms of the force (n_slots) [N/m4]
    type(relaxation_type), intent(out) :: relaxation
    real(wp) :: safety
    integer :: c

    relaxation%conjugate_gradient = scene%relaxation%solver == 'conjugate_gradient'
    relaxation%load_steps = scene%relaxation%load_steps
    relaxation%maximum_iterations = scene%relaxation%maximum_iterations
    relaxation%tolerance = scene%relaxation%tolerance
    allocate (relaxation%mass(system%body%n_slots, system%body%dim), source=0.0_wp)
    safety = safety_of(scene%relaxation)
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
    if (scene%relaxation%density_matrix == 'frame_invariant' .or. all(rows <= 0.0_wp)) return
    do c = 1, system%body%dim
      relaxation%mass(:, c) = relaxation%mass(:, c) + safety*rows/4
    end do
  end subroutine plan_relaxation

  !> By which rule bonds break. An error if the scene asks for events, or for a control that only
  !> they have, and cannot have them.
  subroutine plan_growth(scene, system, relaxation, error)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(relaxation_type), intent(inout) :: relaxation
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: reason
    logical :: asked

    asked = scene%relaxation%growth == 'events' .or. scene%relaxation%control == 'dissipation'
    reason = ''
    if (scene%relaxation%growth == 'load_steps') then
      if (asked) call scene_fault(error, scene, 'relaxation', 1, 'control', "control = '"// &
        & trim(scene%relaxation%control)//"' needs growth by events", &
        & "growth = 'load_steps' breaks bonds at the load factor of a load step")
      return
    end if
    if (.not. system%model%breaking) return
    reason = why_not_events(system)
    if (reason /= '') then
      if (asked) call scene_fault(error, scene, 'relaxation', 1, &
        & trim(merge('growth ', 'control', scene%relaxation%growth == 'events')), &
        & 'bonds cannot break by events: '//reason, 'by events everything grows in proportion '// &
        & "to the load factor, with ramp_time = 1 and without t; else growth = 'load_steps'")
      return
    end if
    relaxation%events = .true.
    relaxation%load_controlled = scene%relaxation%control == 'load'
    relaxation%batch = batch_of(scene%relaxation, scene%header%dimension)
    if (scene%relaxation%most_events > 0) relaxation%most_events = scene%relaxation%most_events
  end subroutine plan_growth

  !> What turns dx^dim into a volume: thickness in 2D, area in 1D. It is 1 in 3D [m in 2D, m2 in
  !> 1D].
  pure real(wp) function depth_of(scene) result(depth)
    type(scene_type), intent(in) :: scene  !! a checked scene
    select case (scene%header%dimension)
    case (1); depth = scene%header%area
    case (2); depth = scene%header%thickness
    case default; depth = 1.0_wp
    end select
  end function depth_of

end module pd_set_up_plan
