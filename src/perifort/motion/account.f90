!> The accounts of a system in motion: work, reactions and energies of an instant
!> (doc/theory.md, 9 and 10).
module pd_motion_account
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_reduce, only: add_point, inner, new_running, running_type, sum_listed, &
    & total_of_running
  use pd_body_body, only: number_at, owned
  use pd_force_forces, only: energy_pass
  use pd_force_generic_points, only: commit_laws
  use pd_force_term, only: term_view_type
  use pd_motion_conditions, only: accelerations_of, advance_paths, motion_type
  use pd_motion_heating, only: apply_factors, apply_rate, is_timed
  use pd_motion_loads, only: acts_along, density_of, load_of, load_type, number_of_loads, &
    & other_terms
  use pd_motion_pose, only: moments_about
  use pd_motion_rigid_body, only: kinetic_of
  use pd_motion_system, only: add_loads, apply_to_held, ask_bonds, find_loaded, inverse_density, &
    & system_type, view_of
  implicit none (type, external)
  private
  public :: account, energies_type, energies_of, velocities_now, rows_of_work

  !> Points of a load from which on threads share the sum of its work.
  integer, parameter :: worth_threads = 4096

  !> Energies at one instant [J].
  type :: energies_type
    real(wp) :: kinetic = 0.0_wp
    real(wp) :: strain = 0.0_wp
    real(wp) :: rigid = 0.0_wp     !! the part of the kinetic energy that rigid bodies have
  end type energies_type

contains

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
    real(wp), allocatable :: acceleration(:), density(:, :)
    type(running_type) :: running
    real(wp) :: force, mass, work, totals(6)
    logical :: first
    type(load_type), pointer :: load
    type(term_view_type) :: view
    integer :: m, l, c, i, k, n

    system%time = t
    first = .not. allocated(system%last_u)
    if (first) call allocate_account(system)
    if (allocated(system%heating%curves)) call account_heat(system, t, first)
    call apply_to_held(system, t)
    n = 0
    do m = 1, size(system%motions)
      associate (motion => system%motions(m))
        motion%reaction = 0.0_wp
        if (motion%is_pin) call account_moment(system, t, motion)
        allocate (acceleration(size(motion%slots)), source=0.0_wp)
        do c = 1, system%body%dim
          if (.not. system%static) call accelerations_of(motion, c, t, acceleration)
          call new_running(running)
          do i = 1, size(motion%slots)
            if (motion%held(i, c) == 0_i1) cycle
            k = motion%slots(i)
            mass = 0.0_wp
            if (.not. system%static) mass = system%body%volume(k)/inverse_density(system%model, k)
            force = system%state%force(k, c)
            if (allocated(system%applied)) force = force + system%applied(k, c)
            force = -force*system%body%volume(k)
            n = n + 1
            call add_work(system, n, first, work, system%state%u(k, c), force, mass, &
              & system%state%v(k, c))
            call add_point(system%body%order, system%body%point(k), &
              & [mass*acceleration(i) + force, work], running)
          end do
          totals = total_of_running(system%body%order, running)
          motion%reaction(c) = totals(1)
          system%external_work = system%external_work + totals(2)
        end do
        deallocate (acceleration)
      end associate
    end do
    do l = 1, number_of_loads(system%terms)
      load => load_of(system%terms, l)
      if (allocated(load%parts)) then
        call density_of(load, t, density)
        call account_load(system, load, density, t, first, n)
      else
        call account_load(system, load, load%density, t, first, n)
      end if
    end do
    call advance_paths(system%motions, t)
    if (system%model%generic) call commit(system)
    if (other_terms(system%terms) == 0) return
    call view_of(system, t, view)
    call system%terms%account(view, system%external_work, system%dissipated)
    call system%terms%advance(view)
  end subroutine account

  !> The work of one load since the last call; `n` counts the components.
  subroutine account_load(system, load, density, t, first, n)
    type(system_type), intent(inout) :: system
    type(load_type), intent(in) :: load
    real(wp), intent(in), contiguous :: density(:, :)  !! of the load at factor 1 (slot, dim) [N/m3]
    real(wp), intent(in) :: t
    logical, intent(in) :: first
    integer, intent(inout) :: n
    real(wp) :: work(size(load%slots)), factor, force
    integer :: c, i, k, from

    factor = load%curve%value(t)
    associate (body => system%body, points => size(load%slots))
      do c = 1, body%dim
        if (.not. acts_along(load, c) .and. .not. associated(body%order%ranks)) cycle
        from = n
        !$omp parallel do schedule(static) if (points >= worth_threads) default(none) &
        !$omp private(i, k, force) shared(system, load, density, work, c, factor, first, from)
        do i = 1, size(load%slots)
          k = load%slots(i)
          force = density(i, c)*factor*system%body%volume(k)
          call add_work(system, from + i, first, work(i), system%state%u(k, c), force)
        end do
        n = n + points
        system%external_work = system%external_work &
          & + sum_listed(body%order, body%point(load%slots), work)
      end do
    end associate
  end subroutine account_load

  !> The moment about its centre by which a pin is turned: of what accelerates its points beyond
  !> the forces on them. Turning is free, so that it vanishes but for rounding, or in static
  !> equilibrium for the tolerance.
  subroutine account_moment(system, t, motion)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: t
    type(motion_type), intent(inout) :: motion  !! a pin; gets its moment
    real(wp) :: density(system%body%dim, size(motion%slots)), acceleration(size(motion%slots))
    real(wp) :: totals(6)
    integer :: c, i, k

    density = 0.0_wp
    do c = 1, system%body%dim
      if (.not. system%static) then
        call accelerations_of(motion, c, t, acceleration)
        density(c, :) = acceleration*motion%pose%masses/system%body%volume(motion%slots)
      end if
      do i = 1, size(motion%slots)
        k = motion%slots(i)
        density(c, i) = density(c, i) - system%state%force(k, c)
        if (allocated(system%applied)) density(c, i) = density(c, i) - system%applied(k, c)
      end do
    end do
    totals = moments_about(system%body, motion%slots, motion%pose, density)
    motion%moment = totals(4:)
  end subroutine account_moment

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
      call apply_rate(system%body%order, system%heating, i, t, 0.5_wp, &
        & system%model%expansion, h)
      if (h > 0.0_wp) then
        rate = strain_energy(system)
        call apply_rate(system%body%order, system%heating, i, t, -0.5_wp, &
          & system%model%expansion, h)
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

  !> The `work` of the `n`-th component since its last force and place. With `mass` and the imposed
  !> velocity `v` its gain in kinetic energy comes on top.
  pure subroutine add_work(system, n, first, work, u, force, mass, v)
    type(system_type), intent(inout) :: system
    integer, intent(in) :: n
    logical, intent(in) :: first
    real(wp), intent(out) :: work
    real(wp), intent(in) :: u, force
    real(wp), intent(in), optional :: mass, v

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
    end do
    call find_loaded(system)
    n = n*system%body%dim
    allocate (system%last_u(n), system%last_force(n), system%last_v(n), source=0.0_wp)
  end subroutine allocate_account

  !> Which point and which component of what each value of `last_u`, `last_force` and `last_v`
  !> belongs to, in the order of `account`.
  subroutine rows_of_work(system, keys, own)
    type(system_type), intent(in), target :: system  !! with its motions and loads
    integer(i8), allocatable, intent(out) :: keys(:)
      !! (values) a number for each, the same on any number of ranks; 0: not used; below 0, with
      !! the sign changed: of a load that is 0 here and need not be there elsewhere
    logical, allocatable, intent(out) :: own(:)      !! (values) whether the point is this rank's
    type(load_type), pointer :: load
    integer(i8) :: codes, code
    integer :: n, m, l, c, i

    associate (body => system%body, motions => system%motions)
      n = 0
      do m = 1, size(motions)
        n = n + size(motions(m)%slots)
      end do
      do l = 1, number_of_loads(system%terms)
        load => load_of(system%terms, l)
        n = n + size(load%slots)
      end do
      allocate (keys(body%dim*n), source=0_i8)
      allocate (own(body%dim*n), source=.false.)
      codes = int(body%dim, i8)*(size(motions) + number_of_loads(system%terms))
      code = 0_i8
      n = 0
      do m = 1, size(motions)
        do c = 1, body%dim
          do i = 1, size(motions(m)%slots)
            if (motions(m)%held(i, c) == 0_i1) cycle
            call add(int(motions(m)%slots(i)), .true.)
          end do
          code = code + 1
        end do
      end do
      do l = 1, number_of_loads(system%terms)
        load => load_of(system%terms, l)
        do c = 1, body%dim
          if (acts_along(load, c) .or. associated(body%order%ranks)) then
            do i = 1, size(load%slots)
              call add(int(load%slots(i)), acts_along(load, c))
            end do
          end if
          code = code + 1
        end do
      end do
    end associate

  contains

    !> The next value, of a slot.
    subroutine add(slot, acts)
      integer, intent(in) :: slot
      logical, intent(in) :: acts  !! else the value may be missing elsewhere

      n = n + 1
      keys(n) = number_at(system%body, slot)*codes + code
      if (.not. acts) keys(n) = -keys(n)
      own(n) = owned(system%body, slot)
    end subroutine add
  end subroutine rows_of_work

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
    if (system%goes_beyond) then
      do c = 1, size(v, 2)
        do k = 1, size(v, 1)
          v(k, c) = v(k, c) + kick*system%beyond(k, c)*inverse_density(system%model, k)
        end do
      end do
    end if
    call add_loads(system, t, kick, .true., v)
    where (system%held == 1) v = system%state%v
  end subroutine velocities_now

  !> Kinetic energy of points and rigid bodies, and stored energy [J]: strain energy of the bonds
  !> and what terms of the force store.
  !> `v` are the velocities at the instant of the displacements.
  subroutine energies_of(system, v, energies)
    type(system_type), intent(inout), target :: system
      !! its state stays as it is; its workspace changes
    real(wp), intent(in) :: v(:, :)               !! (n_slots, dim) [m/s]
    type(energies_type), intent(out) :: energies  !! those of this instant
    type(term_view_type) :: view
    real(wp), allocatable :: density(:), mass(:)
    integer :: k, c

    allocate (density(system%body%n_slots), mass(system%body%n_slots))
    call view_of(system, system%time, view)
    call ask_bonds(system, view)
    energies%strain = system%terms%energy(view)
    !$omp parallel do schedule(static) default(none) shared(system, v, density, mass) private(k, c)
    do k = 1, system%body%n_slots
      mass(k) = system%body%volume(k)/inverse_density(system%model, k)
      density(k) = 0.0_wp
      do c = 1, system%body%dim
        density(k) = density(k) + v(k, c)**2
      end do
    end do
    energies%kinetic = inner(system%body%order, mass, density)/2
    do k = 1, size(system%rigid_bodies)
      energies%rigid = energies%rigid + sum(kinetic_of(system%rigid_bodies(k), system%time))
    end do
    energies%kinetic = energies%kinetic + energies%rigid
  end subroutine energies_of

end module pd_motion_account
