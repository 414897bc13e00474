!> A body in motion: points, families, force model, state and conditions, and the one call that
!> brings the forces up to date. Integrators and relaxation work on this type alone.
module pd_motion_system
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_error, only: error_type, fail, status_no_answer
  use pd_base_text, only: to_text
  use pd_base_reduce, only: any_of_ranks, largest_over
  use pd_base_order, only: side_exchange
  use pd_body_body, only: body_type, finish_halo, not_finite_text, share_halo, start_halo
  use pd_family_family, only: family_type, bonds_type, allocate_bonds
  use pd_force_breaking, only: add_followed, strained_slots, break_bonds, stretch_ratios
  use pd_force_generic_pass, only: renew_pulls
  use pd_force_bonds, only: new_bond_term
  use pd_force_forces, only: whole, up_to_marks, after_marks
  use pd_force_model, only: model_type, options_of, p_of
  use pd_force_obstacle, only: obstacle_type
  use pd_force_reference, only: point_dilatation, point_force
  use pd_force_tangent, only: tangent_type
  use pd_force_term, only: bonds_view_type, term_view_type
  use pd_force_terms, only: term_list_type
  use pd_force_workspace, only: workspace_type
  use pd_motion_conditions, only: motion_type, impose, remember_start, free_component, &
    & condition_fault, renew_motions
  use pd_motion_loads, only: load_type, number_of_loads, load_of, acts_along, density_of, &
    & renew_load
  use pd_motion_heating, only: heating_type, heat, heat_at, heating_fault
  use pd_motion_memory, only: memory_type
  use pd_motion_pose, only: fit_pose, moments_about, new_pose
  use pd_motion_rigid_body, only: rigid_body_type
  use pd_motion_energy_watch, only: watch_type
  implicit none (type, external)
  private
  public :: system_type, state_type, pairing_type, start_system, bring_temperature, evaluate, &
    & renew_forces, renew_conditions, explain_condition, break_now, break_batch, break_marked, &
    & greatest_ratio, settle_account, add_loads, inverse_density, view_of, ask_bonds, find_loaded, &
    & apply_to_held

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
    type(term_list_type) :: terms               !! what acts: the bonds, then loads, then others
    type(rigid_body_type), allocatable :: rigid_bodies(:)  !! of given shapes
    type(obstacle_type), allocatable :: obstacles(:)       !! their surfaces, as the terms see them
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
    real(wp), allocatable :: applied(:, :)      !! loads where both, as last asked for [N/m3]
    type(watch_type) :: watch                   !! over the energies
    type(condition_fault), allocatable :: fault !! first value of a condition that is not finite
    real(wp) :: stable_step = 0.0_wp            !! the integrator's limit, 0: unknown [s]
    integer :: levels = 0                       !! finest level of substeps; 0: there are none
    real(wp), allocatable :: beyond(:, :)       !! with them: what kicks have beside the forces, for
                                                !! bonds of longer steps (n_slots, dim) [N/m3]
    logical :: goes_beyond = .false.            !! such bonds are due at the present instant
  end type system_type

  !> The other instant in the products of stretches by which the energy of breaking bonds is counted
  !> (doc/theory.md, 9): its displacements are u + offset (v + kick a), those of constrained
  !> components their course's. The default, no offset, makes the products squares.
  type :: pairing_type
    real(wp) :: offset = 0.0_wp  !! from the present instant to the other one [s]
    real(wp) :: kick = 0.0_wp    !! 0 where the accelerations a of the present are not known yet [s]
    real(wp) :: held = 0.0_wp    !! the offset that the work of imposed motion implies [s]
    real(wp) :: heat = 0.0_wp    !! the offset that the work of temperatures implies [s]
  end type pairing_type

  !> Points of a load from which on threads share it.
  integer, parameter :: worth_threads = 4096

contains

  !> Make a system ready at t = 0: `u` and `v` hold the initial state, conditions are in place.
  subroutine start_system(system)
    type(system_type), intent(inout), target :: system
      !! with body, family, model, conditions, terms, `u` and `v`; gets the term of its bonds, and
      !! room for forces and marks
    type(term_view_type) :: view
    integer :: n

    call system%terms%add(new_bond_term())
    n = system%body%n_slots
    if (.not. allocated(system%motions)) allocate (system%motions(0))
    if (.not. allocated(system%rigid_bodies)) allocate (system%rigid_bodies(0))
    if (.not. allocated(system%obstacles)) allocate (system%obstacles(0))
    allocate (system%state%force(n, system%body%dim), source=0.0_wp)
    allocate (system%state%p(merge(n, 0, system%model%dilatation)), source=0.0_wp)
    allocate (system%strained(merge(n, 0, system%model%breaking)), source=0_i1)
    if (.not. allocated(system%state%damage)) allocate (system%state%damage(merge(n, 0, &
      & system%model%breaking)), source=0.0_wp)
    call hold_components(system)
    call make_poses(system)
    call find_loaded(system)
    call remember_start(system%motions, system%state%u)
    call renew_conditions(system, 0.0_wp)
    call impose(system%motions, 0.0_wp, system%state%u, system%state%v)
    call view_of(system, 0.0_wp, view)
    call system%terms%begin(view)
  end subroutine start_system

  !> What the terms of the force see of a system at time `t` of its displacements, or of `u` in
  !> their place; nothing is asked of the bonds. Valid as long as the system stays where it is in
  !> memory.
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
    if (allocated(system%obstacles)) view%obstacles => system%obstacles
    view%time = t
    view%step = max(0, system%memory%step)
    view%broken = system%broken
  end subroutine view_of

  !> Ask a view for the bonds as well: for their forces, as the model has them, at the view's
  !> displacements, which give the state its dilatation and the system its marks, for their energy,
  !> bound, or product with the `tangent`.
  subroutine ask_bonds(system, view, part, of_copies, tangent)
    type(system_type), intent(inout), target :: system
      !! must not move in memory while the view is used
    type(term_view_type), intent(inout) :: view  !! of this system
    integer, intent(in), optional :: part        !! of an evaluation; `whole` by default
    logical, intent(in), optional :: of_copies
      !! forces of copies of other processes' points are asked for; they are by default
    type(tangent_type), intent(inout), target, optional :: tangent
      !! how a product is formed; no product is asked for by default

    view%bonds = bonds_view_type()
    associate (bonds => view%bonds)
      bonds%asked = .true.
      bonds%model => system%model
      bonds%workspace => system%workspace
      bonds%options = options_of(system%model)
      bonds%p => system%state%p
      bonds%strained => system%strained
      if (present(part)) bonds%part = part
      if (present(of_copies)) bonds%of_copies = of_copies
      if (present(tangent)) bonds%tangent => tangent
    end associate
  end subroutine ask_bonds

  !> Make the rigid bodies of pins, in their places of the initial displacements and with the
  !> momentum of the initial velocities.
  subroutine make_poses(system)
    type(system_type), intent(inout) :: system  !! with `u` and `v` of the start
    real(wp), allocatable :: density(:, :), masses(:)
    real(wp) :: totals(6)
    integer :: m, i

    do m = 1, size(system%motions)
      associate (motion => system%motions(m), body => system%body)
        if (.not. motion%is_pin) cycle
        masses = [(body%volume(motion%slots(i))/inverse_density(system%model, &
          & int(motion%slots(i))), i=1, size(motion%slots))]
        if (allocated(motion%pose)) deallocate (motion%pose)
        allocate (motion%pose)
        call new_pose(body, motion%slots, masses, motion%pose)
        call fit_pose(body, motion%slots, system%state%u, motion%pose)
        ! momentum sums like force: of mass times velocity over volume
        allocate (density(body%dim, size(motion%slots)))
        do i = 1, size(motion%slots)
          density(:, i) = masses(i)/body%volume(motion%slots(i))*system%state%v(motion%slots(i), :)
        end do
        totals = moments_about(body, motion%slots, motion%pose, density)
        deallocate (density)
        motion%pose%velocity = totals(:3)/motion%pose%mass
        motion%pose%momentum = totals(4:)
      end associate
    end do
  end subroutine make_poses

  !> Note which components are constrained; where several motions claim one, the last holds it.
  pure subroutine hold_components(system)
    type(system_type), intent(inout) :: system
    integer(i4), allocatable :: holder(:, :)
    integer :: m, c

    allocate (holder(system%body%n_slots, system%body%dim), source=0_i4)
    do m = 1, size(system%motions)
      do c = 1, system%body%dim
        if (system%motions(m)%kind(c) /= free_component .or. system%motions(m)%is_pin) &
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
    ! the velocities of copies are needed where bonds break
    if (system%model%breaking) call start_halo(system%body, system%state%v, side_exchange)
    call bring_temperature(system, t)
    if (early) then
      call renew_forces(system, t, up_to_marks)
      call finish_halo(system%body, system%state%v, side_exchange)
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
      if (system%model%breaking) call finish_halo(system%body, system%state%v, side_exchange)
    end if
    if (late) call break_marked(system, t, pair, slots)
  end subroutine evaluate

  !> The internal forces at the present displacements and time `t` into the system's state: those of
  !> the bonds, as the model has them, and of the terms that are not external. Nothing is imposed
  !> and no bond breaks. Of an evaluation's `part`s (`pd_force_forces`) it makes the whole by
  !> default; other terms act with the last one.
  subroutine renew_forces(system, t, part)
    type(system_type), intent(inout), target :: system
      !! its displacements stay as they are; forces, dilatation and marks change
    real(wp), intent(in) :: t  !! [s]
    integer, intent(in), optional :: part  !! `whole`, `up_to_marks` or `after_marks`
    type(term_view_type) :: view
    logical :: of_copies, others

    system%time = t
    ! explicit steps take displacements of copies from their owners before each evaluation; their
    ! forces are needed for the energy of bonds that break after the forces alone
    of_copies = system%static .or. system%break_late
    call view_of(system, t, view)
    call ask_bonds(system, view, part, of_copies)
    others = system%terms%inside > 0 .and. view%bonds%part /= up_to_marks
    if (others) call system%terms%search(view)
    call system%terms%add_force(view, system%state%force)
    if (others .and. of_copies) call share_halo(system%body, system%state%force)
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
    call add_followed(system%family, system%model, system%state%u, slots, part)
    call break_bonds(system%body, system%family, system%model, system%state%u, slots, &
      & system%state%damage, number, dissipated, laws=system%workspace%generic, part=part)
    system%broken = system%broken + number
    system%dissipated = system%dissipated + dissipated
  end subroutine break_batch

  !> Break bonds of the marked slots and count what that dissipates.
  subroutine break_marked(system, t, pairing, slots, level)
    type(system_type), intent(inout) :: system
      !! after the pass that marks; bonds, damage and accounts are up to date on return
    real(wp), intent(in) :: t                          !! of the present displacements [s]
    type(pairing_type), intent(in) :: pairing          !! for their energy
    integer(i4), allocatable, intent(out) :: slots(:)  !! those that lost some, ascending
    integer, intent(in), optional :: level             !! of substeps: bonds of this level alone
    real(wp), allocatable :: others(:, :, :), expansions(:, :), products(:)
    real(wp) :: dissipated
    integer(i8) :: broken
    integer :: m

    call strained_slots(system%strained, slots)
    if (present(level)) slots = pack(slots, [(system%family%has_level(int(slots(m)), level), &
      & m=1, size(slots))])
    call add_followed(system%family, system%model, system%state%u, slots)
    if (size(slots) == 0 .and. .not. associated(system%body%order%ranks)) return
    if (any(abs([pairing%offset, pairing%held, pairing%heat]) > 0.0_wp)) then
      call displacements_at(system, t, pairing, slots, others)
      call expansions_at(system, t, pairing, size(others, 3), expansions)
      allocate (products(size(others, 3)))
      ! not allocated is not present
      call break_bonds(system%body, system%family, system%model, system%state%u, slots, &
        & system%state%damage, broken, dissipated, others, products, system%workspace%generic, &
        & level=level, expansions=expansions)
      ! what bonds that break after the forces still do, they do in the step to come
      system%dissipation_due = system%dissipation_due + (products(1) - dissipated)
      ! the trapezoidal rule lets bonds pull at constrained points, and temperatures act on them, up
      ! to half a step before or after the present, whatever the integrator does
      if (size(products) > 1) system%work_due = system%work_due + (products(1) - products(2))
      if (.not. system%break_late) call settle_account(system)
    else
      call break_bonds(system%body, system%family, system%model, system%state%u, slots, &
        & system%state%damage, broken, dissipated, laws=system%workspace%generic, level=level)
    end if
    system%broken = system%broken + broken
    system%dissipated = system%dissipated + dissipated
  end subroutine break_marked

  !> Add what is due to the accounts.
  pure subroutine settle_account(system)
    type(system_type), intent(inout) :: system  !! its dissipated energy and external work change
    system%dissipated = system%dissipated + system%dissipation_due
    system%external_work = system%external_work + system%work_due
    system%dissipation_due = 0.0_wp
    system%work_due = 0.0_wp
  end subroutine settle_account

  !> Displacements of the other instant of a pairing; where the work of constrained components or
  !> temperatures is summed with another offset, these in a second set. They are made only where
  !> they are needed, at `slots` and at the ends of their bonds: the rest of `others` is left as it
  !> is allocated, so that a step in which few bonds break pays for these alone.
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
    two = two .or. (allocated(system%heating%curves) &
      & .and. abs(pairing%offset - pairing%heat) > 0.0_wp)
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
    ! a pin's pose is that of the present instant alone: its points move on with their velocities
    if (abs(pairing%offset) > 0.0_wp) call impose(system%motions, t + pairing%offset, &
      & others(:, :, 1), but_pins=.true.)
    if (two) call impose(system%motions, t + pairing%held, others(:, :, 2), but_pins=.true.)

  contains

    !> One slot of `others`.
    subroutine fill(k)
      integer, intent(in) :: k
      real(wp) :: v(size(others, 2))
      integer :: o

      v = system%state%v(k, :)
      if (abs(pairing%kick) > 0.0_wp) then
        ! constrained components are imposed below, and those of pins know their velocities
        where (system%held(k, :) == 0_i1) v = v + pairing%kick*inverse_density(system%model, k) &
          & *system%state%force(k, :)
        if (system%goes_beyond) then
          where (system%held(k, :) == 0_i1) v = v + pairing%kick &
            & *inverse_density(system%model, k)*system%beyond(k, :)
        end if
        if (allocated(loads)) then
          where (system%held(k, :) == 0_i1) v = v + pairing%kick &
            & *inverse_density(system%model, k)*loads(k, :)
        end if
      end if
      do o = 1, size(others, 3)
        others(k, :, o) = system%state%u(k, :) + pairing%offset*v
      end do
    end subroutine fill

  end subroutine displacements_at

  !> Thermal strains of the other instant, with each set of displacements; not allocated where the
  !> temperature is constant.
  subroutine expansions_at(system, t, pairing, sets, expansions)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: t                             !! of the present displacements [s]
    type(pairing_type), intent(in) :: pairing
    integer, intent(in) :: sets                           !! 1 or 2
    real(wp), allocatable, intent(out) :: expansions(:, :)  !! (n_slots, sets) [-]

    if (.not. allocated(system%heating%curves)) return
    expansions = spread(system%model%expansion, 2, sets)
    call heat_at(system%heating, t + pairing%offset, expansions(:, 1))
    if (sets > 1) call heat_at(system%heating, t + pairing%heat, expansions(:, 2))
  end subroutine expansions_at

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
        if (.not. acts_along(load, c)) cycle
        !$omp parallel do schedule(static) if (size(load%slots) >= worth_threads) default(none) &
        !$omp private(i, k, by) shared(model, load, density, values, c, factor, per_density)
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

  !> Find out which points with constrained components also bear a load.
  subroutine find_loaded(system)
    type(system_type), intent(inout), target :: system
      !! with its constraints; gets `loaded_and_held`, and its loads their points of this kind
    type(load_type), pointer :: load
    integer :: l, i

    do l = 1, number_of_loads(system%terms)
      load => load_of(system%terms, l)
      load%on_held = pack([(i, i=1, size(load%slots))], any(system%held(load%slots, :) == 1_i1, 2))
      if (size(load%on_held) > 0) system%loaded_and_held = .true.
    end do
    ! other external terms may act anywhere
    if (system%terms%outside > number_of_loads(system%terms)) &
      & system%loaded_and_held = system%loaded_and_held .or. any(system%held == 1_i1)
    system%loaded_and_held = any_of_ranks(system%body%order, system%loaded_and_held)
  end subroutine find_loaded

  !> Bring the system's `applied` to time `t`: the force density of loads and other external terms
  !> on all points with a constrained component; it is not allocated where none acts there.
  subroutine apply_to_held(system, t)
    type(system_type), intent(inout), target :: system  !! gets `applied`
    real(wp), intent(in) :: t                           !! time of the loads [s]
    type(load_type), pointer :: load
    integer :: l

    if (.not. system%loaded_and_held) return
    if (.not. allocated(system%applied)) allocate (system%applied(system%body%n_slots, &
      & system%body%dim), source=0.0_wp)
    if (system%terms%outside > number_of_loads(system%terms)) then
      system%applied = 0.0_wp
      call add_loads(system, t, 1.0_wp, .false., system%applied)
      return
    end if
    do l = 1, number_of_loads(system%terms)
      load => load_of(system%terms, l)
      system%applied(load%slots(load%on_held), :) = 0.0_wp
    end do
    do l = 1, number_of_loads(system%terms)
      load => load_of(system%terms, l)
      call apply(load)
    end do

  contains

    !> One load.
    subroutine apply(load)
      type(load_type), intent(in) :: load
      real(wp), allocatable :: density(:, :)
      real(wp) :: factor
      integer :: n, i, c

      factor = load%curve%value(t)
      if (allocated(load%parts)) call density_of(load, t, density)
      do c = 1, system%body%dim
        if (.not. acts_along(load, c)) cycle
        do n = 1, size(load%on_held)
          i = load%on_held(n)
          associate (sum_of_loads => system%applied(load%slots(i), c))
            if (allocated(density)) then
              sum_of_loads = sum_of_loads + factor*density(i, c)
            else
              sum_of_loads = sum_of_loads + factor*load%density(i, c)
            end if
          end associate
        end do
      end do
    end subroutine apply
  end subroutine apply_to_held

end module pd_motion_system
