!> Free vibration of a scene's body: the same points, bonds, corrections and cracks without loads,
!> temperature and breaking, constrained components held at rest; also shifted or in another size.
!> What the program measures of a body's motion, it measures on this.
module pd_study_limits_vibration
  use pd_base_kinds, only: wp, i1, i2, i4
  use pd_base_lanes, only: lanes
  use pd_base_error, only: error_type, internal_fault
  use pd_base_reduce, only: largest_of_ranks, noise, bring_noise
  use pd_body_body, only: body_type, allocate_points, gather, scatter
  use pd_law_laws, only: law_item_type
  use pd_law_material, only: material_type, never, new_material
  use pd_family_family, only: bonds_type, allocate_bonds
  use pd_family_composite, only: composite_family_type, new_composite_family
  use pd_family_lattice, only: find_listed, lattice_family_type, new_lattice_family
  use pd_family_list, only: list_family_type, new_list_family
  use pd_family_surface, only: surface_factors
  use pd_family_volume, only: volume_rule_type
  use pd_force_composite, only: prepare_composite
  use pd_force_generic_bonds, only: begin_laws
  use pd_force_model, only: give_horizons, model_type, new_model
  use pd_force_weights, only: build_weights
  use pd_motion_conditions, only: motion_type, moved_by_displacement
  use pd_motion_curve, only: constant_curve
  use pd_motion_observer, only: observer_type, instant_type
  use pd_motion_account, only: energies_type, energies_of
  use pd_motion_system, only: system_type, start_system, inverse_density
  use pd_motion_tangent, only: apply_tangent
  implicit none (type, external)
  private
  public :: free_body, random_shape, smoothed, in_points, put_points, energy_watch_type

  !> Keeps the total energy of a run. With velocities at half steps the energy of an instant swings
  !> about a constant by as much as (omega dt)^2; with `half_steps` that constant is taken, the
  !> energy less dt^2/8 of the sum of rho V a^2, which the scheme keeps to rounding if all is
  !> linear.
  type, extends(observer_type) :: energy_watch_type
    integer :: every = 0                     !! steps between looks, 0 for none
    logical :: half_steps = .false.
    integer :: n = 0                         !! looks so far
    real(wp), allocatable :: step(:)         !! at which step (n)
    real(wp), allocatable :: energy(:)       !! kinetic and strain energy [J] (n)
  contains
    procedure :: observe
  end type energy_watch_type

contains

  !> The body of `system`, moved by `shift` [m] along each direction after it was made `factor`
  !> times as large (thickness and cross section stay), at rest and undeformed. An error if its
  !> lattice cannot be built.
  subroutine free_body(system, shift, factor, twin, error)
    type(system_type), intent(in) :: system  !! of which a copy is made
    real(wp), intent(in) :: shift            !! along each direction, after the change of size [m]
    real(wp), intent(in) :: factor           !! size of the copy over that of `system` [-]
    type(system_type), intent(out) :: twin   !! the copy
    type(error_type), allocatable, intent(out) :: error
    type(law_item_type), allocatable :: laws(:)
    type(material_type), allocatable :: materials(:)
    type(lattice_family_type), allocatable :: lattice
    type(list_family_type), allocatable :: list
    type(composite_family_type), allocatable :: composite
    type(volume_rule_type) :: rule
    logical, allocatable :: listed(:)
    logical :: cut

    call copy_points(system%body, shift, factor, twin%body)
    rule = system%family%rule
    rule%delta = factor*rule%delta
    call resized(system%model, rule%delta, laws, materials)
    cut = .false.
    if (size(system%state%damage) > 0) cut = any(system%state%damage > 0.0_wp)
    select type (family => system%family)
    type is (lattice_family_type)
      allocate (lattice)
      call new_lattice_family(twin%body, rule, cut, &
        & family%grids(1)%alignment > lanes, lattice, error)
      if (allocated(error)) return
      call move_alloc(lattice, twin%family)
    type is (list_family_type)
      allocate (list)
      call new_list_family(twin%body, rule, list)
      call move_alloc(list, twin%family)
    type is (composite_family_type)
      allocate (composite)
      call find_listed(twin%body, rule, listed)
      call new_composite_family(twin%body, rule, listed, cut, composite, error)
      if (allocated(error)) return
      call move_alloc(composite, twin%family)
    class default
      call internal_fault('free_body does not know a kind of family')
    end select
    call new_model(twin%body, materials, system%model%projected, &
      & spread(.false., 1, twin%body%n_slots), spread(0.0_wp, 1, twin%body%n_slots), &
      & twin%model, laws)
    if (rule%ratio > 0.0_wp) call give_horizons(twin%body, rule, twin%model)
    twin%model%surface = system%model%surface
    if (twin%model%surface) call surface_factors(twin%body, twin%family, materials, twin%model%D, &
      & twin%model%S, laws, system%model%axes)
    if (allocated(system%model%axes)) twin%model%axes = system%model%axes
    if (system%model%consistent) then
      if (any(twin%body%point /= system%body%point)) &
        & call internal_fault('a twin in another order')
      twin%model%consistent = .true.
      twin%model%weights = system%model%weights
    end if
    call begin_laws(twin%body, twin%family, twin%model, twin%workspace%generic)
    select type (family => twin%family)
    type is (lattice_family_type)
      call build_weights(family, twin%model, twin%workspace%lattice)
    type is (list_family_type)  ! its first pass prepares the workspace
      continue
    type is (composite_family_type)
      call prepare_composite(family, twin%model, twin%workspace)
    class default
      call internal_fault('free_body does not know a kind of family')
    end select
    if (cut) call copy_cuts(system, twin)
    call hold(system, twin)
    allocate (twin%state%u(twin%body%n_slots, twin%body%dim), source=0.0_wp)
    allocate (twin%state%v, source=twin%state%u)
    call start_system(twin)
  end subroutine free_body

  !> The points in their order, elsewhere and in another size.
  subroutine copy_points(body, shift, factor, copy)
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: shift, factor
    type(body_type), intent(out) :: copy
    integer(i4), allocatable :: number(:)
    integer :: c, g

    call allocate_points(copy, body%dim, body%n_points)
    allocate (number(body%n_points))
    do c = 1, body%dim
      call gather(body, body%x(:, c), copy%x(:, c))
      copy%x(:, c) = factor*copy%x(:, c) + shift
    end do
    call gather(body, body%volume, copy%volume)
    copy%volume = copy%volume*factor**body%dim
    call gather(body, body%spacing, copy%spacing)
    copy%spacing = copy%spacing*factor
    call gather(body, body%body, number)
    copy%body = int(number, i2)
    call gather(body, body%material, number)
    copy%material = int(number, i2)
    call gather(body, body%layer, number)
    copy%layer = int(number, i2)
    call gather(body, body%grid, number)
    copy%grid = int(number, i2)
    copy%grids = body%grids
    do g = 1, size(copy%grids)
      copy%grids(g)%origin(:body%dim) = factor*copy%grids(g)%origin(:body%dim) + shift
      copy%grids(g)%spacing = factor*copy%grids(g)%spacing
    end do
  end subroutine copy_points

  !> The same laws and materials for another horizon; none can fail or expand.
  subroutine resized(model, delta, laws, materials)
    type(model_type), intent(in) :: model                          !! with its laws
    real(wp), intent(in) :: delta                                  !! horizon of the copy [m]
    type(law_item_type), allocatable, intent(out) :: laws(:)       !! set up for it
    type(material_type), allocatable, intent(out) :: materials(:)  !! of these laws
    integer :: i

    if (.not. allocated(model%laws)) call internal_fault('a body whose materials have no laws')
    allocate (laws, source=model%laws)
    allocate (materials(size(laws)))
    do i = 1, size(laws)
      associate (law => laws(i)%law, old => model%materials(i))
        call law%set_up(new_material(old%youngs_modulus, old%poissons_ratio, old%density, law%dim, &
          & law%plane_strain, law%depth, law%depth, delta, law%bond_based), law%dim, &
          & law%plane_strain, delta, law%depth)
        law%material%critical_stretch = never
        law%material%expansion = 0.0_wp
        materials(i) = law%material
      end associate
    end do
  end subroutine resized

  !> Cut in `twin` the bonds that are broken in `system`.
  subroutine copy_cuts(system, twin)
    type(system_type), intent(in) :: system
    type(system_type), intent(inout) :: twin
    type(bonds_type) :: bonds, others
    integer :: i, b, m, k

    call allocate_bonds(system%family, bonds)
    call allocate_bonds(twin%family, others)
    do i = 1, system%body%n_points
      if (.not. system%state%damage(system%body%slot(i)) > 0.0_wp) cycle
      call system%family%bonds_of(int(system%body%slot(i)), bonds)
      k = twin%body%slot(i)
      call twin%family%bonds_of(k, others)
      do b = 1, bonds%n
        if (bonds%intact(b)) cycle
        m = findloc(twin%body%point(others%j(:others%n)), system%body%point(bonds%j(b)), dim=1)
        if (m > 0) call twin%family%break_bond(k, m)
      end do
    end do
  end subroutine copy_cuts

  !> Hold what is constrained in `system`: a motion for each direction.
  subroutine hold(system, twin)
    type(system_type), intent(in) :: system
    type(system_type), intent(inout) :: twin
    integer :: c

    allocate (twin%motions(system%body%dim))
    do c = 1, system%body%dim
      associate (motion => twin%motions(c))
        motion%name = 'held'
        motion%slots = pack(twin%body%slot, system%held(system%body%slot, c) == 1_i1)
        motion%kind(c) = moved_by_displacement
        motion%curve = constant_curve()
      end associate
    end do
  end subroutine hold

  !> Displacements of all frequencies alike: at random, always the same; 0 where held. [-]
  subroutine random_shape(system, shape)
    type(system_type), intent(in) :: system  !! gives points, bonds and constrained components
    real(wp), allocatable, intent(out) :: shape(:, :)  !! (n_slots, dim), with a largest gradient of
                                                       !! 1
    integer :: i, c, state

    allocate (shape(system%body%n_slots, system%body%dim), source=0.0_wp)
    do i = 1, system%body%order%n_owned
      call bring_noise(system%body%order, i, 4711, system%body%dim, state)
      do c = 1, system%body%dim
        shape(system%body%slot(i), c) = noise(state)
        if (system%held(system%body%slot(i), c) == 1_i1) shape(system%body%slot(i), c) = 0.0_wp
      end do
    end do
    shape = shape/largest_gradient(system, shape)
  end subroutine random_shape

  !> What remains of `shape` when the high frequencies are taken out of it: each pass multiplies the
  !> part of frequency omega by 1 - (omega step/2)^2, `step` = 2/(largest omega) [s].
  subroutine smoothed(system, step, passes, shape)
    type(system_type), intent(inout) :: system  !! free; forces are linearised about its undeformed
                                                !! state
    real(wp), intent(in) :: step                !! 2/(largest omega) [s]
    integer, intent(in) :: passes               !! how often the filter is applied
    real(wp), intent(inout), contiguous :: shape(:, :)  !! (n_slots, dim); smoothed on return, with
                                                        !! a largest gradient of 1
    real(wp), allocatable :: kw(:, :), undeformed(:, :)
    integer :: i, k, c

    allocate (kw, undeformed, source=0*shape)
    do i = 1, passes
      call apply_tangent(system, undeformed, shape, kw)
      do c = 1, size(shape, 2)
        do k = 1, size(shape, 1)
          if (system%body%point(k) > 0 .and. system%held(k, c) == 0_i1) &
            & shape(k, c) = shape(k, c) - step**2/4*inverse_density(system%model, k)*kw(k, c)
        end do
      end do
    end do
    shape = shape/largest_gradient(system, shape)
  end subroutine smoothed

  !> The largest displacement of a bond's end against the other over its length, in any direction,
  !> so that it counts where a motion stretches nothing (a chain in space), too; 1 if there is none.
  real(wp) function largest_gradient(system, u) result(largest)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: u(:, :)
    type(bonds_type) :: bonds
    integer :: k, i

    largest = 0.0_wp
    !$omp parallel default(none) shared(system, u) private(bonds, k, i) reduction(max:largest)
    call allocate_bonds(system%family, bonds)
    !$omp do schedule(dynamic, 256)
    do k = 1, system%body%n_slots
      if (system%body%point(k) == 0) cycle
      call system%family%bonds_of(k, bonds)
      do i = 1, bonds%n
        if (bonds%intact(i)) largest = max(largest, norm2(u(bonds%j(i), :) - u(k, :)) &
          & /bonds%length(i))
      end do
    end do
    !$omp end parallel
    largest = largest_of_ranks(system%body%order, largest)
    if (.not. largest > 0.0_wp) largest = 1.0_wp
  end function largest_gradient

  !> Values of slots in the order of the points.
  subroutine in_points(body, values, ordered)
    type(body_type), intent(in) :: body   !! gives the slot of each point
    real(wp), intent(in) :: values(:, :)  !! (n_slots, components)
    real(wp), allocatable, intent(out) :: ordered(:, :)  !! (n_points, components)

    allocate (ordered(body%n_points, size(values, 2)))
    call gather(body, values, ordered)
  end subroutine in_points

  !> `factor` times values in the order of the points into their slots.
  pure subroutine put_points(body, ordered, factor, values)
    type(body_type), intent(in) :: body      !! gives the slot of each point
    real(wp), intent(in) :: ordered(:, :)    !! (n_points, components)
    real(wp), intent(in) :: factor           !! of all values [-]
    real(wp), intent(inout) :: values(:, :)  !! (n_slots, components); 0 in dead slots

    values = 0.0_wp
    call scatter(body, factor*ordered, values)
  end subroutine put_points

  !> Look at the energy every `every` steps. No error is set.
  subroutine observe(observer, system, instant, error)
    class(energy_watch_type), intent(inout) :: observer  !! keeps the energy once more on return if
                                                         !! that is due
    type(system_type), intent(inout) :: system  !! gives velocities, forces and energies
    type(instant_type), intent(in) :: instant   !! gives the step, and how much of a step the
                                                !! velocities lack
    type(error_type), allocatable, intent(out) :: error
    type(energies_type) :: energies, of_kick
    real(wp), allocatable :: v(:, :), kick(:, :)
    integer :: k

    if (allocated(error)) return
    if (observer%every == 0) return
    if (mod(instant%step, observer%every) /= 0) return
    allocate (kick, mold=system%state%v)
    do k = 1, size(kick, 1)
      kick(k, :) = instant%dt/2*inverse_density(system%model, k)*system%state%force(k, :)
    end do
    where (system%held == 1_i1) kick = 0.0_wp
    v = system%state%v
    if (instant%kick > 0.0_wp) v = v + kick
    if (observer%half_steps) call energies_of(system, kick, of_kick)
    call energies_of(system, v, energies)
    energies%kinetic = energies%kinetic - (of_kick%kinetic - of_kick%rigid)
    if (observer%n == 0) allocate (observer%step(0), observer%energy(0))
    observer%n = observer%n + 1
    observer%step = [observer%step, real(instant%step, wp)]
    observer%energy = [observer%energy, energies%kinetic + energies%strain]
  end subroutine observe

end module pd_study_limits_vibration
