!> A body in motion: points, families, force model, state and conditions, and the one call that
!> brings the forces up to date. Integrators and relaxation work on this type alone.
module pd_motion_system
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_error, only: error_type, fail, status_no_answer
  use pd_base_text, only: to_text
  use pd_base_reduce, only: add_point, inner, largest_over, new_running, running_type, &
    & total_of_running
  use pd_body_body, only: body_type, not_finite_text, share_halo
  use pd_family_family, only: family_type, bonds_type, allocate_bonds
  use pd_force_breaking, only: strained_slots, break_bonds, stretch_ratios
  use pd_force_generic_pass, only: renew_pulls
  use pd_force_generic_points, only: commit_laws
  use pd_force_forces, only: internal_force, energy_pass, whole, up_to_marks, after_marks
  use pd_force_model, only: model_type, options_of, p_of
  use pd_force_reference, only: point_dilatation, point_force
  use pd_force_term, only: term_list_type, term_view_type
  use pd_force_workspace, only: workspace_type
  use pd_motion_conditions, only: motion_type, impose, remember_start, free_component, &
    & accelerations_of, advance_paths, condition_fault, renew_motions
  use pd_motion_loads, only: load_type, number_of_loads, load_of, acts_along, density_of, &
    & renew_load
  use pd_motion_heating, only: heating_type, heat, apply_factors, apply_rate, is_timed, &
    & heating_fault
  use pd_motion_memory, only: memory_type
  use pd_motion_energy_watch, only: watch_type
  implicit none (type, external)
  private
  public :: system_type, state_type, pairing_type, start_system, bring_temperature, evaluate, &
    & renew_forces, renew_conditions, explain_condition, break_now, break_batch, greatest_ratio, &
    & account, energies_type, &
    & energies_of, add_loads, inverse_density, velocities_now, view_of, stored_energy

  !> What moves. All arrays are over slots; dead slots stay zero.
  type :: state_type
    real(wp), allocatable :: u(:, :)       !! displacement (n_slots, dim) [m]
    real(wp), allocatable :: v(:, :)       !! velocity (n_slots, dim) [m/s]
    real(wp), allocatable :: force(:, :)   !! internal force density (n_slots, dim) [N/m3]: of the
                                           !! bonds and of the terms that are not external
    real(wp), allocatable :: p(:)          !! 2 a d delta theta, if the model needs it
    real(wp), allocatable :: damage(:)     !! local damage [-], of size 0 if nothing can be damaged
  end type state_type

  type :: system_type
    type(body_type) :: body
    class(family_type), allocatable :: family
    type(model_type) :: model
    type(workspace_type) :: workspace           !! what the force loops keep, of this model
    type(state_type) :: state
    type(motion_type), allocatable :: motions(:)
    type(term_list_type) :: terms               !! what acts beside the bonds: loads first
    type(heating_type) :: heating               !! temperature changes that vary in time
    integer(i1), allocatable :: held(:, :)      !! 1 where a component is constrained (n_slots, dim)
    integer(i1), allocatable :: strained(:)     !! marks of the last pass
    integer(i8) :: broken = 0_i8                !! bonds broken during the run
    real(wp) :: dissipated = 0.0_wp             !! energy lost by breaking, laws and terms [J]
    real(wp) :: plastic_energy = 0.0_wp         !! the part of it by plastic bond laws [J]
    real(wp) :: external_work = 0.0_wp          !! of loads and imposed motion [J]
    real(wp) :: dissipation_due = 0.0_wp        !! parts of both that fall into the step to come,
    real(wp) :: work_due = 0.0_wp               !! of bonds that broke after the last forces [J]
    real(wp), allocatable :: last_u(:)          !! work accounting: place, force and imposed
    real(wp), allocatable :: last_force(:)      !! velocity (0 of loads) of each component that
    real(wp), allocatable :: last_v(:)          !! does work, at the last step
    type(memory_type) :: memory                 !! what the motion carries from instant to instant
    logical :: break_late = .false.             !! bonds break after the step's forces
    real(wp) :: time = 0.0_wp                   !! of the present displacements [s]
    logical :: static = .false.                 !! nothing has mass: static equilibrium
    logical :: loaded_and_held = .false.        !! some constrained component also bears a load
    type(watch_type) :: watch                   !! over the energies
    type(condition_fault), allocatable :: fault !! first value of a condition that is not finite
    real(wp) :: stable_step = 0.0_wp            !! the integrator's limit, 0: unknown [s]
  end type system_type

  !> The other instant in the products of stretches by which the energy of breaking bonds is counted
  !> (doc/theory.md, 9): its displacements are u + offset (v + kick a), those of constrained
  !> components their course's. The default, no offset, makes the products squares.
  type :: pairing_type
    real(wp) :: offset = 0.0_wp  !! from the present instant to the other one [s]
    real(wp) :: kick = 0.0_wp    !! 0 where the accelerations a of the present are not known yet [s]
    real(wp) :: held = 0.0_wp    !! the offset that the work of imposed motion implies [s]
  end type pairing_type

  !> Energies at one instant [J].
  type :: energies_type
    real(wp) :: kinetic = 0.0_wp
    real(wp) :: strain = 0.0_wp
  end type energies_type

contains

  !> Make a system ready at t = 0: `u` and `v` hold the initial state, conditions are in place.
  subroutine start_system(system)
    type(system_type), intent(inout), target :: system
      !! with body, family, model, conditions, `u` and `v`; gets room for forces and marks
    type(term_view_type) :: view
    integer :: n

    n = system%body%n_slots
    if (.not. allocated(system%motions)) allocate (system%motions(0))
    allocate (system%state%force(n, system%body%dim), source=0.0_wp)
    allocate (system%state%p(merge(n, 0, system%model%dilatation)), source=0.0_wp)
    allocate (system%strained(merge(n, 0, system%model%breaking)), source=0_i1)
    if (.not. allocated(system%state%damage)) allocate (system%state%damage(merge(n, 0, &
      & system%model%breaking)), source=0.0_wp)
    call hold_components(system)
    call remember_start(system%motions, system%state%u)
    call renew_conditions(system, 0.0_wp)
    call impose(system%motions, 0.0_wp, system%state%u, system%state%v)
    call view_of(system, 0.0_wp, view)
    call system%terms%begin(view)
  end subroutine start_system

  !> What the terms of the force see of a system at time `t` of its displacements, or of `u` in
  !> their place. Valid as long as the system stays where it is in memory.
  subroutine view_of(system, t, view, u)
    type(system_type), intent(in), target :: system
      !! must not move in memory while the view is used
    real(wp), intent(in) :: t                                    !! [s]
    type(term_view_type), intent(out) :: view                    !! points into the system
    real(wp), intent(in), contiguous, target, optional :: u(:, :)  !! (n_slots, dim) [m]

    view%body => system%body
    view%family => system%family
    view%materials => system%model%materials
    view%u => system%state%u
    if (present(u)) view%u => u
    view%v => system%state%v
    view%time = t
    view%step = max(0, system%memory%step)
  end subroutine view_of

  !> Note which components are constrained; where several motions claim one, the last holds it.
  pure subroutine hold_components(system)
    type(system_type), intent(inout) :: system
    integer(i4), allocatable :: holder(:, :)
    integer :: m, c

    allocate (holder(system%body%n_slots, system%body%dim), source=0_i4)
    do m = 1, size(system%motions)
      do c = 1, system%body%dim
        if (system%motions(m)%kind(c) /= free_component) &
          & holder(system%motions(m)%slots, c) = int(m, i4)
      end do
    end do
    do m = 1, size(system%motions)
      associate (motion => system%motions(m))
        if (allocated(motion%held)) deallocate (motion%held)
        allocate (motion%held(size(motion%slots), system%body%dim), source=0_i1)
        do c = 1, system%body%dim
          where (holder(motion%slots, c) == m) motion%held(:, c) = 1_i1
        end do
      end associate
    end do
    if (allocated(system%held)) deallocate (system%held)
    allocate (system%held(system%body%n_slots, system%body%dim))
    system%held = merge(1_i1, 0_i1, holder > 0)
  end subroutine hold_components

  !> The first half of a step (doc/theory.md, 5): impose at time `t`, break bonds (unless `breaking`
  !> is false), dilatation, forces. Breaking needs no pass of its own: the first pass over the bonds
  !> marks the strained slots, and only those are computed again. With `break_late` the bonds of
  !> this instant still pull and break thereafter, as in the book's programs: a bond then lives up
  !> to a step too long, an error of first order in the step; the other order errs both ways.
  subroutine evaluate(system, t, breaking, pairing)
    type(system_type), intent(inout) :: system
      !! gets imposed motion, temperature, broken bonds and forces of this instant
    real(wp), intent(in) :: t                            !! of this instant [s]
    logical, intent(in) :: breaking                      !! whether bonds may break
    type(pairing_type), intent(in), optional :: pairing  !! for their energy; squares by default
    integer(i4), allocatable :: slots(:)
    type(pairing_type) :: pair
    logical :: early, late

    if (present(pairing)) pair = pairing
    early = breaking .and. system%model%breaking .and. .not. system%break_late
    late = breaking .and. system%model%breaking .and. system%break_late
    if (late) call settle_account(system)
    call renew_conditions(system, t)
    call impose(system%motions, t, system%state%u, system%state%v)
    if (system%model%breaking) call share_halo(system%body, system%state%v)
    call bring_temperature(system, t)
    if (early) then
      call renew_forces(system, t, up_to_marks)
      call break_marked(system, t, pair, slots)
      if (system%model%generic) then
        call renew_pulls(system%family, system%model, system%workspace%generic, system%state%u, &
          & slots)
      else if (system%model%dilatation) then
        call renew_dilatation(system, slots)
      else
        call renew_force(system, slots)
      end if
      call renew_forces(system, t, after_marks)
    else
      call renew_forces(system, t)
    end if
    if (late) call break_marked(system, t, pair, slots)
  end subroutine evaluate

  !> The internal forces at the present displacements and time `t` into the system's state: those of
  !> the bonds, as the model has them, and of the terms that are not external. Nothing is imposed
  !> and no bond breaks. Of an evaluation's `part`s (`pd_force_forces`) it makes the whole by
  !> default; terms come last.
  subroutine renew_forces(system, t, part)
    type(system_type), intent(inout), target :: system
      !! its displacements stay as they are; forces, dilatation and marks change
    real(wp), intent(in) :: t  !! [s]
    integer, intent(in), optional :: part  !! `whole`, `up_to_marks` or `after_marks`
    type(term_view_type) :: view
    integer :: now

    system%time = t
    now = whole
    if (present(part)) now = part
    if (now /= after_marks) call share_halo(system%body, system%state%u)
    associate (state => system%state)
      call internal_force(system%body, system%family, system%model, options_of(system%model), &
        & system%workspace, state%u, state%p, state%force, system%strained, now)
    end associate
    if (system%terms%inside == 0 .or. now == up_to_marks) return
    call view_of(system, t, view)
    call system%terms%add_force(view, system%state%force)
    call share_halo(system%body, system%state%force)
  end subroutine renew_forces

  !> Bring conditions that are expressions of t to time `t`. The first value that is not finite is
  !> noted in `fault` of the system; conditions go on without it.
  subroutine renew_conditions(system, t)
    type(system_type), intent(inout), target :: system
      !! its motions and loads keep the values of this time
    real(wp), intent(in) :: t  !! [s]; in relaxation 0 to 1 over the load steps
    type(load_type), pointer :: load
    integer :: l

    call renew_motions(system%motions, t, system%fault)
    do l = 1, number_of_loads(system%terms)
      load => load_of(system%terms, l)
      call renew_load(load, l, t, system%fault)
    end do
    call heating_fault(system%heating, t, system%fault)
  end subroutine renew_conditions

  !> The error of a condition that is not finite; the fault is then taken note of.
  subroutine explain_condition(system, status, error)
    type(system_type), intent(inout) :: system  !! with a `fault`, without it on return
    integer, intent(in) :: status               !! exit status of the program
    type(error_type), allocatable, intent(out) :: error

    character(:), allocatable :: step

    step = ''
    if (status == status_no_answer) step = 'step '//to_text(system%memory%step)//': '
    associate (fault => system%fault)
      call fail(error, step//fault%key//' of &'//fault%group//' number '// &
        & to_text(fault%number)//' '//not_finite_text(system%body, fault%slot, fault%time), &
        & status, fault%group, fault%number)
    end associate
    deallocate (system%fault)
  end subroutine explain_condition

  !> Bring the thermal strains to time `t`.
  subroutine bring_temperature(system, t)
    type(system_type), intent(inout) :: system
      !! its thermal strains change if the temperature varies
    real(wp), intent(in) :: t  !! [s]; in relaxation 0 to 1 over the load steps
    if (allocated(system%heating%curves)) call heat(system%heating, t, system%model%expansion)
  end subroutine bring_temperature

  !> Break every bond beyond its limit at the present displacements (relaxation, after a load step);
  !> `number` is how many broke. Forces are not renewed. What breaks at an equilibrium dissipates
  !> its energy at fixed displacements.
  subroutine break_now(system, number)
    type(system_type), intent(inout) :: system
      !! with bonds broken, damage and dissipated energy up to date on return
    integer(i8), intent(out) :: number  !! bonds broken by this call, each counted once
    integer(i4), allocatable :: slots(:)

    number = system%broken
    if (system%model%breaking) call break_marked(system, 0.0_wp, pairing_type(), slots)
    number = system%broken - number
  end subroutine break_now

  !> The largest mechanical stretch of an intact bond over its limit: 1 where the next one breaks;
  !> 0 where none is stretched, or none can break [-].
  real(wp) function greatest_ratio(system) result(ratio)
    type(system_type), intent(in) :: system  !! at its displacements and temperature
    real(wp), allocatable :: ratios(:)

    ratio = 0.0_wp
    if (.not. system%model%breaking) return
    allocate (ratios(system%body%n_slots))
    call stretch_ratios(system%family, system%model, system%state%u, ratios)
    ratio = largest_over(system%body%order, ratios)
  end function greatest_ratio

  !> Break every bond beyond `part` of its limit at the present displacements; otherwise as
  !> `break_now`.
  subroutine break_batch(system, part, number)
    type(system_type), intent(inout) :: system
      !! with bonds broken, damage and dissipated energy up to date on return
    real(wp), intent(in) :: part        !! of the limit [-]
    integer(i8), intent(out) :: number  !! bonds broken by this call, each counted once
    real(wp), allocatable :: ratios(:)
    integer(i4), allocatable :: slots(:)
    real(wp) :: dissipated
    integer :: k

    allocate (ratios(system%body%n_slots))
    call stretch_ratios(system%family, system%model, system%state%u, ratios)
    slots = pack([(int(k, i4), k=1, size(ratios))], ratios > part)
    call break_bonds(system%body, system%family, system%model, system%state%u, slots, &
      & system%state%damage, number, dissipated, laws=system%workspace%generic, part=part)
    system%broken = system%broken + number
    system%dissipated = system%dissipated + dissipated
  end subroutine break_batch

  !> Break bonds of the marked slots and count what that dissipates.
  subroutine break_marked(system, t, pairing, slots)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: t                          !! of the present displacements [s]
    type(pairing_type), intent(in) :: pairing
    integer(i4), allocatable, intent(out) :: slots(:)  !! those that lost some
    real(wp), allocatable :: others(:, :, :), products(:)
    real(wp) :: dissipated
    integer(i8) :: broken

    call strained_slots(system%strained, slots)
    if (size(slots) == 0 .and. .not. associated(system%body%order%ranks)) return
    if (abs(pairing%offset) > 0.0_wp .or. abs(pairing%held) > 0.0_wp) then
      call displacements_at(system, t, pairing, slots, others)
      allocate (products(size(others, 3)))
      call break_bonds(system%body, system%family, system%model, system%state%u, slots, &
        & system%state%damage, broken, dissipated, others, products, system%workspace%generic)
      ! what bonds that break after the forces still do, they do in the step to come
      system%dissipation_due = products(1) - dissipated
      ! the trapezoidal rule lets bonds pull at constrained points up to half a step before or after
      ! the present, whatever the integrator does
      if (size(products) > 1) system%work_due = products(1) - products(2)
      if (.not. system%break_late) call settle_account(system)
    else
      call break_bonds(system%body, system%family, system%model, system%state%u, slots, &
        & system%state%damage, broken, dissipated, laws=system%workspace%generic)
    end if
    system%broken = system%broken + broken
    system%dissipated = system%dissipated + dissipated
  end subroutine break_marked

  !> Add what is due to the accounts.
  pure subroutine settle_account(system)
    type(system_type), intent(inout) :: system
    system%dissipated = system%dissipated + system%dissipation_due
    system%external_work = system%external_work + system%work_due
    system%dissipation_due = 0.0_wp
    system%work_due = 0.0_wp
  end subroutine settle_account

  !> Displacements of the other instant of a pairing; where the work of constrained components is
  !> summed with another offset, these in a second set. They are made only where they are needed, at
  !> `slots` and at the ends of their bonds: the rest of `others` is left as it is allocated, so
  !> that a step in which few bonds break pays for these alone.
  subroutine displacements_at(system, t, pairing, slots, others)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: t                            !! of the present displacements [s]
    type(pairing_type), intent(in) :: pairing
    integer(i4), intent(in) :: slots(:)
    real(wp), allocatable, intent(out) :: others(:, :, :)  !! (n_slots, dim, 1 or 2) [m]
    real(wp), allocatable :: loads(:, :)
    type(bonds_type) :: bonds
    logical :: two
    integer :: m, i

    two = size(system%motions) > 0 .and. abs(pairing%offset - pairing%held) > 0.0_wp
    allocate (others(size(system%state%u, 1), size(system%state%u, 2), merge(2, 1, two)))
    if (abs(pairing%kick) > 0.0_wp .and. system%terms%outside > 0) then
      allocate (loads(size(others, 1), size(others, 2)), source=0.0_wp)
      call add_loads(system, t, 1.0_wp, .false., loads)
    end if
    call allocate_bonds(system%family, bonds)
    do m = 1, size(slots)
      call system%family%bonds_of(slots(m), bonds)
      call fill(int(slots(m)))
      do i = 1, bonds%n
        call fill(int(bonds%j(i)))
      end do
    end do
    if (abs(pairing%offset) > 0.0_wp) &
      & call impose(system%motions, t + pairing%offset, others(:, :, 1))
    if (two) call impose(system%motions, t + pairing%held, others(:, :, 2))

  contains

    !> One slot of `others`.
    subroutine fill(k)
      integer, intent(in) :: k
      real(wp) :: v(size(others, 2))
      integer :: o

      v = system%state%v(k, :)
      if (abs(pairing%kick) > 0.0_wp) then
        v = v + pairing%kick*inverse_density(system%model, k)*system%state%force(k, :)
        if (allocated(loads)) &
          & v = v + pairing%kick*inverse_density(system%model, k)*loads(k, :)
      end if
      do o = 1, size(others, 3)
        others(k, :, o) = system%state%u(k, :) + pairing%offset*v
      end do
    end subroutine fill

  end subroutine displacements_at

  !> Dilatation of some slots again, after they lost bonds.
  subroutine renew_dilatation(system, slots)
    type(system_type), intent(inout) :: system
    integer(i4), intent(in) :: slots(:)
    type(bonds_type) :: bonds
    integer :: m, k

    if (size(slots) == 0) return
    call allocate_bonds(system%family, bonds)
    associate (model => system%model)
      do m = 1, size(slots)
        k = slots(m)
        call system%family%bonds_of(k, bonds)
        system%state%p(k) = p_of(model, k)*point_dilatation(model, system%state%u, k, bonds)
      end do
    end associate
  end subroutine renew_dilatation

  !> Force of some slots again, after they lost bonds.
  subroutine renew_force(system, slots)
    type(system_type), intent(inout) :: system
    integer(i4), intent(in) :: slots(:)
    type(bonds_type) :: bonds
    integer :: m, k

    if (size(slots) == 0) return
    call allocate_bonds(system%family, bonds)
    do m = 1, size(slots)
      k = slots(m)
      call system%family%bonds_of(k, bonds)
      system%state%force(k, :) = point_force(system%model, system%state%u, system%state%p, k, bonds)
    end do
  end subroutine renew_force

  !> Add `scale` times the force density of loads and other external terms at time `t` to `values`
  !> (n_slots, dim); `per_density` divides by the point's density, which turns force density into
  !> acceleration.
  subroutine add_loads(system, t, scale, per_density, values)
    type(system_type), intent(in), target :: system  !! its external terms
    real(wp), intent(in) :: t                        !! time of the loads [s]
    real(wp), intent(in) :: scale                    !! factor
    logical, intent(in) :: per_density               !! divide by the density of each point
    real(wp), intent(inout) :: values(:, :)          !! (n_slots, dim) added to
    real(wp), allocatable :: force(:, :)
    type(load_type), pointer :: load
    type(term_view_type) :: view
    integer :: l, c, k, loads

    if (system%terms%outside == 0) return
    loads = number_of_loads(system%terms)
    do l = 1, loads
      load => load_of(system%terms, l)
      call add_load(system%model, load, t, scale, per_density, values)
    end do
    if (system%terms%outside == loads) return
    call view_of(system, t, view)
    allocate (force(size(values, 1), size(values, 2)), source=0.0_wp)
    call system%terms%add_external(view, force)
    do c = 1, size(values, 2)
      do k = 1, size(values, 1)
        if (per_density) force(k, c) = force(k, c)*inverse_density(system%model, k)
        values(k, c) = values(k, c) + scale*force(k, c)
      end do
    end do
  end subroutine add_loads

  !> One load.
  subroutine add_load(model, load, t, scale, per_density, values)
    type(model_type), intent(in) :: model
    type(load_type), intent(in) :: load
    real(wp), intent(in) :: t, scale
    logical, intent(in) :: per_density
    real(wp), intent(inout) :: values(:, :)
    real(wp), allocatable :: density(:, :)

    if (allocated(load%parts)) then
      call density_of(load, t, density)
      call put(density)
    else
      call put(load%density)
    end if

  contains

    subroutine put(density)
      real(wp), intent(in), contiguous :: density(:, :)
      real(wp) :: factor, by
      integer :: i, c, k

      factor = scale*load%curve%value(t)
      do c = 1, size(values, 2)
        do i = 1, size(load%slots)
          k = load%slots(i)
          by = factor
          if (per_density) by = factor*inverse_density(model, k)
          values(k, c) = values(k, c) + by*density(i, c)
        end do
      end do
    end subroutine put
  end subroutine add_load

  !> 1/rho of slot `k` [m3/kg].
  pure real(wp) function inverse_density(model, k)
    type(model_type), intent(in) :: model  !! densities of the slots
    integer, intent(in) :: k               !! slot
    inverse_density = 1.0_wp/model%materials(model%material(k))%density
  end function inverse_density

  !> Work of loads and imposed motion since the last call, by the trapezoidal rule, and the
  !> reactions at time `t`. To be called once per step, after `evaluate`. What accelerates the
  !> imposed points enters as their gain in kinetic energy: that is exact, and it holds where an
  !> imposed velocity jumps (at the end of a ramped displacement), too. In static
  !> equilibrium, where imposed motion has no speed, nothing is accelerated.
  !>
  !> Terms of the force come to the present, too: their work is summed, and they bring their history
  !> up to date. So do bond laws: the step is accepted.
  subroutine account(system, t)
    type(system_type), intent(inout), target :: system
      !! its work, reactions and the histories of its terms are those of this instant on return
    real(wp), intent(in) :: t                 !! time of the displacements [s]
    real(wp), allocatable :: applied(:, :), acceleration(:), density(:, :)
    type(running_type) :: running
    real(wp) :: force, mass, work, factor, totals(6)
    logical :: first
    type(load_type), pointer :: load
    type(term_view_type) :: view
    integer :: m, l, c, i, k, n

    system%time = t
    first = .not. allocated(system%last_u)
    if (first) call allocate_account(system)
    if (allocated(system%heating%curves)) call account_heat(system, t, first)
    if (system%loaded_and_held) then
      allocate (applied(system%body%n_slots, system%body%dim), source=0.0_wp)
      call add_loads(system, t, 1.0_wp, .false., applied)
    end if
    n = 0
    do m = 1, size(system%motions)
      associate (motion => system%motions(m))
        motion%reaction = 0.0_wp
        do c = 1, system%body%dim
          allocate (acceleration(size(motion%slots)), source=0.0_wp)
          if (.not. system%static) call accelerations_of(motion, c, t, acceleration)
          call new_running(system%body%order, running)
          do i = 1, size(motion%slots)
            if (motion%held(i, c) == 0_i1) cycle
            k = motion%slots(i)
            mass = 0.0_wp
            if (.not. system%static) mass = system%body%volume(k)/inverse_density(system%model, k)
            force = system%state%force(k, c)
            if (allocated(applied)) force = force + applied(k, c)
            force = -force*system%body%volume(k)
            call add_work(system, n, first, work, system%state%u(k, c), force, mass, &
              & system%state%v(k, c))
            call add_point(system%body%order, system%body%point(k), &
              & [mass*acceleration(i) + force, work], running)
          end do
          totals = total_of_running(system%body%order, running)
          motion%reaction(c) = totals(1)
          deallocate (acceleration)
          system%external_work = system%external_work + totals(2)
        end do
      end associate
    end do
    do l = 1, number_of_loads(system%terms)
      load => load_of(system%terms, l)
      factor = load%curve%value(t)
      if (allocated(load%parts)) call density_of(load, t, density)
      do c = 1, system%body%dim
        if (.not. acts_along(load, c) .and. &
          & .not. associated(system%body%order%ranks)) cycle
        call new_running(system%body%order, running)
        do i = 1, size(load%slots)
          k = load%slots(i)
          force = load%density(i, c)
          if (allocated(load%parts)) force = density(i, c)
          call add_work(system, n, first, work, system%state%u(k, c), &
            & force*factor*system%body%volume(k))
          call add_point(system%body%order, system%body%point(k), [work], running)
        end do
        totals = total_of_running(system%body%order, running)
        system%external_work = system%external_work + totals(1)
      end do
    end do
    call advance_paths(system%motions, t)
    if (system%model%generic) call commit(system)
    if (system%terms%number() == number_of_loads(system%terms)) return
    call view_of(system, t, view)
    call system%terms%account(view, system%external_work, system%dissipated)
    call system%terms%advance(view)
  end subroutine account

  !> Commit the histories of the bond laws.
  subroutine commit(system)
    type(system_type), intent(inout) :: system
    real(wp) :: dissipated, plastic

    call commit_laws(system%body, system%family, system%model, system%workspace%generic, &
      & system%state%u, system%state%damage, dissipated, plastic)
    system%plastic_energy = system%plastic_energy + plastic
    system%dissipated = system%dissipated + dissipated
  end subroutine commit

  !> Work of varying temperature since the last call: the strain energy that it changes at fixed
  !> displacements, by the trapezoidal rule. The energy is quadratic in the thermal strain, so that
  !> a central difference gives its rate exactly.
  subroutine account_heat(system, t, first)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: t         !! of the present instant [s]
    logical, intent(in) :: first      !! whether nothing has been accounted yet
    real(wp) :: rate
    integer :: i, last

    associate (heating => system%heating)
      do i = 1, size(heating%curves)
        last = size(heating%curves(i)%times)
        rate = 0.0_wp
        ! past its last time a course is constant
        if (is_timed(heating, i)) then
          rate = rate_by_time()
        else if (t < heating%curves(i)%times(last) .or. &
          & abs(heating%factors(i) - heating%last_factors(i)) > 0.0_wp) then
          rate = energy_at(heating%factors(i) + 0.5_wp) - energy_at(heating%factors(i) - 0.5_wp)
          call apply_factors(heating, heating%factors, system%model%expansion)
        end if
        if (.not. first) system%external_work = system%external_work + (heating%last_rates(i) &
          & + rate)/2*(heating%factors(i) - heating%last_factors(i))
        heating%last_factors(i) = heating%factors(i)
        heating%last_rates(i) = rate
      end do
    end associate

  contains

    !> The rate of the strain energy that the temperature's rate makes at fixed displacements [W].
    real(wp) function rate_by_time() result(rate)
      real(wp) :: h

      rate = 0.0_wp
      call apply_rate(system%heating, i, t, 0.5_wp, system%model%expansion, h)
      if (h > 0.0_wp) then
        rate = strain_energy(system)
        call apply_rate(system%heating, i, t, -0.5_wp, system%model%expansion, h)
        rate = (rate - strain_energy(system))/h
      end if
      call apply_factors(system%heating, system%heating%factors, system%model%expansion)
    end function rate_by_time

    !> Strain energy with another factor of the `i`-th course [J].
    real(wp) function energy_at(factor)
      real(wp), intent(in) :: factor
      real(wp) :: factors(size(system%heating%factors))

      factors = system%heating%factors
      factors(i) = factor
      call apply_factors(system%heating, factors, system%model%expansion)
      energy_at = strain_energy(system)
    end function energy_at
  end subroutine account_heat

  !> Strain energy of the present displacements [J].
  real(wp) function strain_energy(system) result(energy)
    type(system_type), intent(inout) :: system
    real(wp), allocatable :: density(:)

    allocate (density(system%body%n_slots))
    call energy_pass(system%family, system%model, system%workspace, system%state%u, density)
    energy = inner(system%body%order, density, system%body%volume)
  end function strain_energy

  !> What the terms of the force store at the present displacements [J].
  real(wp) function stored_energy(system) result(energy)
    type(system_type), intent(in), target :: system  !! at the instant of its time
    type(term_view_type) :: view

    call view_of(system, system%time, view)
    energy = system%terms%energy(view)
  end function stored_energy

  !> One component's `work` since its last force and place; `n` counts the components. With `mass`
  !> and the imposed velocity `v` its gain in kinetic energy comes on top.
  pure subroutine add_work(system, n, first, work, u, force, mass, v)
    type(system_type), intent(inout) :: system
    integer, intent(inout) :: n
    logical, intent(in) :: first
    real(wp), intent(out) :: work
    real(wp), intent(in) :: u, force
    real(wp), intent(in), optional :: mass, v

    n = n + 1
    work = 0.0_wp
    if (.not. first) work = (system%last_force(n) + force)/2*(u - system%last_u(n))
    system%last_u(n) = u
    system%last_force(n) = force
    if (.not. present(v)) return
    if (.not. first) work = work + mass/2*(v - system%last_v(n))*(v + system%last_v(n))
    system%last_v(n) = v
  end subroutine add_work

  !> Room for the last force and place of every component that does work.
  subroutine allocate_account(system)
    type(system_type), intent(inout), target :: system
    type(load_type), pointer :: load
    integer :: n, m, l

    n = 0
    do m = 1, size(system%motions)
      n = n + size(system%motions(m)%slots)
    end do
    do l = 1, number_of_loads(system%terms)
      load => load_of(system%terms, l)
      n = n + size(load%slots)
      if (any(system%held(load%slots, :) == 1_i1)) system%loaded_and_held = .true.
    end do
    ! other external terms may act anywhere
    if (system%terms%outside > number_of_loads(system%terms)) &
      & system%loaded_and_held = system%loaded_and_held .or. any(system%held == 1_i1)
    n = n*system%body%dim
    allocate (system%last_u(n), system%last_force(n), system%last_v(n), source=0.0_wp)
  end subroutine allocate_account

  !> Velocities at the time `t` of the displacements [m/s], half a kick [s] on from those that the
  !> integrator keeps.
  subroutine velocities_now(system, t, kick, v)
    type(system_type), intent(in) :: system  !! with the forces of this instant
    real(wp), intent(in) :: t     !! time of the displacements [s]
    real(wp), intent(in) :: kick  !! time that velocities lag behind, 0 if they do not [s]
    real(wp), allocatable, intent(out) :: v(:, :)  !! (n_slots, dim) [m/s]
    integer :: k, c

    allocate (v, source=system%state%v)
    if (kick <= 0.0_wp) return
    do c = 1, size(v, 2)
      !$omp parallel do schedule(static) default(none) shared(system, kick, v, c) private(k)
      do k = 1, size(v, 1)
        v(k, c) = v(k, c) + kick*system%state%force(k, c)*inverse_density(system%model, k)
      end do
    end do
    call add_loads(system, t, kick, .true., v)
    where (system%held == 1) v = system%state%v
  end subroutine velocities_now

  !> Kinetic and stored energy [J]: strain energy of the bonds and what terms of the force store.
  !> `v` are the velocities at the instant of the displacements.
  subroutine energies_of(system, v, energies)
    type(system_type), intent(inout), target :: system
      !! its state stays as it is; its workspace changes
    real(wp), intent(in) :: v(:, :)               !! (n_slots, dim) [m/s]
    type(energies_type), intent(out) :: energies  !! those of this instant
    real(wp), allocatable :: density(:), mass(:)
    integer :: k, c

    allocate (density(system%body%n_slots), mass(system%body%n_slots))
    energies%strain = strain_energy(system)
    if (system%terms%inside > 0) energies%strain = energies%strain + stored_energy(system)
    !$omp parallel do schedule(static) default(none) shared(system, v, density, mass) private(k, c)
    do k = 1, system%body%n_slots
      mass(k) = system%body%volume(k)/inverse_density(system%model, k)
      density(k) = 0.0_wp
      do c = 1, system%body%dim
        density(k) = density(k) + v(k, c)**2
      end do
    end do
    energies%kinetic = inner(system%body%order, mass, density)/2
  end subroutine energies_of

end module pd_motion_system
