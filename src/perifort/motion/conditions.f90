!> Boundary conditions (7.8; doc/theory.md, 10): imposed motion of points and external loads.
module pd_motion_conditions
  use pd_base_archive, only: archive_type
  use pd_base_error, only: internal_fault
  use pd_base_expression, only: derivative_in_time, expression_type
  use pd_base_field, only: field_type, field_values, new_field
  use pd_base_kinds, only: wp, i1, i4
  use pd_base_text, only: to_text
  use pd_force_term, only: force_term_type, term_list_type, term_view_type, no_stiffness
  use pd_motion_curve, only: curve_type
  implicit none (type, external)
  private
  public :: motion_type, load_type, free_component, moved_by_displacement, moved_by_velocity
  public :: impose, remember_start, add_loads_to, number_of_loads, load_of
  public :: vary_in_time, advance_paths, keep_paths, accelerations_of, add_part, acts_along, &
    & density_of, renew_motions, renew_load, condition_fault, note_fault

  integer, parameter :: free_component = 0
  integer, parameter :: moved_by_displacement = 1
  integer, parameter :: moved_by_velocity = 2

  real(wp), parameter :: never = -huge(1.0_wp)

  !> One component of an imposed motion that is an expression of t, and its derivatives.
  type :: timed_type
    type(field_type) :: value   !! displacement or velocity, whichever is imposed
    type(field_type) :: rate    !! its first derivative in t
    type(field_type) :: second  !! its second one
  end type timed_type

  !> The first value of a condition that is not finite.
  type :: condition_fault
    character(:), allocatable :: group   !! that has the expression
    character(:), allocatable :: key
    integer :: number = 0                !! which group of this name
    integer(i4) :: slot = 0
    real(wp) :: time = 0.0_wp            !! [s]
  end type condition_fault

  !> Imposed motion of some slots.
  type :: motion_type
    character(:), allocatable :: name
    integer(i4), allocatable :: slots(:)
    integer :: kind(3) = free_component     !! what is imposed on each component
    real(wp) :: amplitude(3) = 0.0_wp       !! [m] or [m/s], times the curve
    real(wp), allocatable :: profile(:, :)  !! amplitude of each point (slot, dim), if it varies
    type(timed_type) :: timed(3)            !! where `by_time`
    logical :: by_time(3) = .false.         !! components that are expressions of t
    real(wp), allocatable :: path(:, :)     !! integral of velocities `by_time` (slot, dim) [m] ...
    real(wp) :: path_time = 0.0_wp          !! ... until this time [s]
    real(wp) :: time = never                !! of `place` and `speed` [s]
    real(wp), allocatable :: place(:, :)    !! imposed displacements `by_time` (slot, dim) [m]
    real(wp), allocatable :: speed(:, :)    !! and velocities [m/s]
    type(curve_type) :: curve
    real(wp), allocatable :: start(:, :)    !! displacement at t = 0 (slot, dim) [m]
    integer(i1), allocatable :: held(:, :)  !! 1 where this motion holds, not a later one
    real(wp) :: reaction(3) = 0.0_wp        !! force the boundary exerts on the body [N]
  end type motion_type

  !> A part of a load that is an expression of t.
  type :: load_part_type
    type(field_type) :: field
    integer :: component = 0
    real(wp), allocatable :: weight(:)      !! of each slot
    character(:), allocatable :: key        !! that has the expression
  end type load_part_type

  !> External force density on some slots: the plainest term of the force.
  type, extends(force_term_type) :: load_type
    integer(i4), allocatable :: slots(:)
    real(wp), allocatable :: density(:, :)  !! at factor 1 (slot, dim) [N/m3]
    type(curve_type) :: curve
    type(load_part_type), allocatable :: parts(:)  !! to be added to `density`; the factor is then 1
    real(wp) :: time = never                !! of `now` [s]
    real(wp), allocatable :: now(:, :)      !! density with its parts (slot, dim) [N/m3]
  contains
    procedure :: add_force => add_force_of_load
    procedure :: add_energy => add_no_energy
    procedure :: add_stiffness_bound => add_no_bound
    procedure :: keep => keep_nothing
    procedure :: describe => describe_load
  end type load_type

contains

  !> Put loads into a list of terms, before all others.
  subroutine add_loads_to(terms, loads)
    type(term_list_type), intent(inout) :: terms
      !! without terms other than loads; with these loads at its end on return
    type(load_type), intent(inout) :: loads(:)
      !! (any number) external, without stiffness and summed apart on return
    integer :: l

    if (terms%number() > number_of_loads(terms)) call internal_fault('loads come first')
    do l = 1, size(loads)
      loads(l)%external = .true.
      loads(l)%tangent = no_stiffness
      loads(l)%summed_apart = .true.
      call terms%add(loads(l))
    end do
  end subroutine add_loads_to

  !> How many loads a list of terms begins with.
  pure integer function number_of_loads(terms) result(number)
    type(term_list_type), intent(in) :: terms  !! with its loads first
    integer :: i

    number = 0
    do i = 1, terms%number()
      select type (term => terms%items(i)%term)
      type is (load_type)
        number = i
      class default  ! another term
        continue
      end select
    end do
  end function number_of_loads

  !> The `l`-th load of a list of terms. It is the term itself, not a copy.
  function load_of(terms, l) result(load)
    type(term_list_type), intent(in), target :: terms  !! with its loads first
    integer, intent(in) :: l
      !! number of the load, from 1; that of another term is a fault of the program
    type(load_type), pointer :: load

    load => null()
    select type (term => terms%items(l)%term)
    type is (load_type)
      load => term
    class default
      call internal_fault('a term is taken for a load')
    end select
  end function load_of

  !> The load's force density at the time of the view.
  subroutine add_force_of_load(self, view, force)
    class(load_type), intent(in) :: self      !! the load
    type(term_view_type), intent(in) :: view  !! whose time counts
    real(wp), intent(inout), contiguous :: force(:, :)
      !! (n_slots, dim) force density, added to [N/m3]
    real(wp), allocatable :: density(:, :)
    real(wp) :: factor
    integer :: c, i

    factor = self%curve%value(view%time)
    if (allocated(self%parts)) then
      call density_of(self, view%time, density)
    else
      density = self%density
    end if
    do c = 1, size(force, 2)
      do i = 1, size(self%slots)
        force(self%slots(i), c) = force(self%slots(i), c) + factor*density(i, c)
      end do
    end do
  end subroutine add_force_of_load

  !> A load stores nothing.
  subroutine add_no_energy(self, view, density)
    class(load_type), intent(in) :: self      !! the load
    type(term_view_type), intent(in) :: view  !! the instant
    real(wp), intent(inout), contiguous :: density(:)
      !! (n_slots) energy density, left as it is [J/m3]
    call must_be_load(self, view, density)
  end subroutine add_no_energy

  !> It doesn't depend on displacements.
  subroutine add_no_bound(self, view, bound)
    class(load_type), intent(in) :: self      !! the load
    type(term_view_type), intent(in) :: view  !! the instant
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the stiffness, left as it is [N/m4]
    call must_be_load(self, view, bound)
  end subroutine add_no_bound

  !> The interface gives what a load has no use for; it must be of the body that it acts on.
  subroutine must_be_load(self, view, values)
    class(load_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(in) :: values(:)
    if (size(self%slots) > size(values) .or. size(values) /= size(view%u, 1)) &
      & call internal_fault('a load on another body')
  end subroutine must_be_load

  !> Nor does it carry anything from one instant to the next.
  subroutine keep_nothing(self, archive)
    class(load_type), intent(inout) :: self        !! the load, left as it is
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    if (archive%reading .and. .not. allocated(self%slots)) call internal_fault('an empty load')
  end subroutine keep_nothing

  !> The report of a scene lists its loads.
  function describe_load(self) result(text)
    class(load_type), intent(in) :: self  !! the load
    character(:), allocatable :: text
    text = ''
    if (.not. self%external) text = 'a load outside the list of terms'
  end function describe_load

  !> Keep the displacements at t = 0, from which imposed velocities integrate.
  pure subroutine remember_start(motions, u)
    type(motion_type), intent(inout) :: motions(:)  !! (any number) get `start`
    real(wp), intent(in) :: u(:, :)                 !! (n_slots, dim) displacements at t = 0 [m]
    integer :: m, c

    do m = 1, size(motions)
      if (.not. allocated(motions(m)%start)) &
        & allocate (motions(m)%start(size(motions(m)%slots), size(u, 2)))
      do c = 1, size(u, 2)
        motions(m)%start(:, c) = u(motions(m)%slots, c)
      end do
    end do
  end subroutine remember_start

  !> Set displacement and velocity of the constrained components at time `t` [s].
  subroutine impose(motions, t, u, v)
    type(motion_type), intent(in) :: motions(:)   !! (any number) with `start` and `held` set
    real(wp), intent(in) :: t  !! time; in relaxation 0 to 1 over the load steps [s]
    real(wp), intent(inout) :: u(:, :)            !! displacements (n_slots, dim) [m]
    real(wp), intent(inout), optional :: v(:, :)  !! velocities (n_slots, dim) [m/s]
    real(wp) :: factor, rate, path
    integer :: m, c, i

    do m = 1, size(motions)
      associate (motion => motions(m))
        if (all(motion%kind == free_component)) cycle
        factor = motion%curve%value(t)
        rate = motion%curve%slope(t)
        path = motion%curve%integral(t)
        if (any(motion%by_time)) call impose_by_time(motion, t, u, v)
        do c = 1, size(u, 2)
          if (motion%by_time(c)) cycle
          select case (motion%kind(c))
          case (moved_by_displacement)
            do i = 1, size(motion%slots)
              if (motion%held(i, c) == 0_i1) cycle
              u(motion%slots(i), c) = amplitude_of(motion, i, c)*factor
              if (present(v)) v(motion%slots(i), c) = amplitude_of(motion, i, c)*rate
            end do
          case (moved_by_velocity)
            do i = 1, size(motion%slots)
              if (motion%held(i, c) == 0_i1) cycle
              u(motion%slots(i), c) = motion%start(i, c) + amplitude_of(motion, i, c)*path
              if (present(v)) v(motion%slots(i), c) = amplitude_of(motion, i, c)*factor
            end do
          case default
            continue  ! a free component
          end select
        end do
      end associate
    end do
  end subroutine impose

  !> What a component of point `i` is at factor 1.
  pure real(wp) function amplitude_of(motion, i, c) result(amplitude)
    type(motion_type), intent(in) :: motion
    integer, intent(in) :: i, c

    amplitude = motion%amplitude(c)
    if (allocated(motion%profile)) amplitude = motion%profile(i, c)
  end function amplitude_of

  !> Make component `c` of a motion an expression of t.
  subroutine vary_in_time(motion, c, expression, x)
    type(motion_type), intent(inout) :: motion       !! with its slots and kinds
    integer, intent(in) :: c                         !! component
    type(expression_type), intent(in) :: expression  !! of x, y, z, t
    real(wp), intent(in) :: x(:, :)                  !! positions of its points (slot, dim) [m]
    type(expression_type) :: rate, second

    call derivative_in_time(expression, rate)
    call derivative_in_time(rate, second)
    call new_field(expression, x, motion%timed(c)%value)
    call new_field(rate, x, motion%timed(c)%rate)
    call new_field(second, x, motion%timed(c)%second)
    motion%by_time(c) = .true.
    if (allocated(motion%place)) return
    allocate (motion%place(size(x, 1), size(x, 2)), motion%speed(size(x, 1), size(x, 2)), &
      & motion%path(size(x, 1), size(x, 2)), source=0.0_wp)
  end subroutine vary_in_time

  !> Imposed displacements and velocities at time `t` of the components that are expressions of t.
  !> `at_fault` is the first of the points with a value that is not finite, `component` its
  !> component; 0 if there is none. Such values are left as they are.
  subroutine places_at(motion, t, place, speed, at_fault, component)
    type(motion_type), intent(in) :: motion
    real(wp), intent(in) :: t                          !! [s]
    real(wp), intent(inout) :: place(:, :), speed(:, :)  !! (slot, dim) [m], [m/s]
    integer, intent(out) :: at_fault, component
    real(wp) :: values(size(place, 1))
    integer :: c, at

    at_fault = 0
    component = 0
    do c = 1, size(place, 2)
      if (.not. motion%by_time(c)) cycle
      call field_values(motion%timed(c)%value, t, values, at)
      if (at == 0 .and. motion%kind(c) == moved_by_displacement) then
        place(:, c) = values
        call field_values(motion%timed(c)%rate, t, values, at)
        if (at == 0) speed(:, c) = values
      else if (at == 0) then
        speed(:, c) = values
        call path_between(motion%timed(c)%value, motion%path_time, t, values, at)
        if (at == 0) place(:, c) = motion%start(:, c) + (motion%path(:, c) + values)
      end if
      if (at == 0 .or. at_fault > 0) cycle
      at_fault = at
      component = c
    end do
  end subroutine places_at

  !> The integral of a field over time, by Gauss's rule with three points: exact for polynomials of
  !> degree 5, so of sixth order in the interval.
  subroutine path_between(field, from, to, path, at_fault)
    type(field_type), intent(in) :: field
    real(wp), intent(in) :: from, to      !! [s]
    real(wp), intent(out) :: path(:)      !! of each point
    integer, intent(out) :: at_fault      !! point with a value that is not finite, or 0
    real(wp), parameter :: node(3) = [-sqrt(0.6_wp), 0.0_wp, sqrt(0.6_wp)]
    real(wp), parameter :: weight(3) = [5.0_wp, 8.0_wp, 5.0_wp]/18
    real(wp) :: values(size(path))
    integer :: i

    path = 0.0_wp
    at_fault = 0
    if (abs(to - from) <= 0.0_wp) return
    do i = 1, 3
      call field_values(field, (from + to)/2 + node(i)*(to - from)/2, values, at_fault)
      if (at_fault > 0) return
      path = path + weight(i)*(to - from)*values
    end do
  end subroutine path_between

  !> Bring the kept values of motions that are expressions of t to time `t`. `fault` is allocated at
  !> the first one that is not finite.
  subroutine renew_motions(motions, t, fault)
    type(motion_type), intent(inout) :: motions(:)  !! (any number) get `place` and `speed`
    real(wp), intent(in) :: t                       !! [s]
    type(condition_fault), allocatable, intent(inout) :: fault  !! the first one stays
    character(*), parameter :: xyz = 'xyz'
    integer :: m, at, c

    do m = 1, size(motions)
      if (.not. any(motions(m)%by_time)) cycle
      associate (motion => motions(m))
        call places_at(motion, t, motion%place, motion%speed, at, c)
        motion%time = t
        if (at > 0) call note_fault('boundary', m, trim(merge('displacement_', 'velocity_    ', &
          & motion%kind(c) == moved_by_displacement))//xyz(c:c), motion%slots(at), t, fault)
      end associate
    end do
  end subroutine renew_motions

  !> Set displacement and velocity of the components that are expressions of t.
  subroutine impose_by_time(motion, t, u, v)
    type(motion_type), intent(in) :: motion       !! with `start` and `held` set
    real(wp), intent(in) :: t                     !! time [s]
    real(wp), intent(inout) :: u(:, :)            !! displacements (n_slots, dim) [m]
    real(wp), intent(inout), optional :: v(:, :)  !! velocities (n_slots, dim) [m/s]
    real(wp), allocatable :: place(:, :), speed(:, :)
    integer :: c, i, at, component

    place = motion%place
    speed = motion%speed
    if (abs(t - motion%time) > 0.0_wp) call places_at(motion, t, place, speed, at, component)
    do c = 1, size(u, 2)
      if (.not. motion%by_time(c)) cycle
      do i = 1, size(motion%slots)
        if (motion%held(i, c) == 0_i1) cycle
        u(motion%slots(i), c) = place(i, c)
        if (present(v)) v(motion%slots(i), c) = speed(i, c)
      end do
    end do
  end subroutine impose_by_time

  !> Accelerations of component `c` at time `t` [m/s2]: for the force that moves the points.
  subroutine accelerations_of(motion, c, t, acceleration)
    type(motion_type), intent(in) :: motion        !! an imposed motion
    integer, intent(in) :: c                       !! component
    real(wp), intent(in) :: t                      !! time [s]
    real(wp), intent(out), contiguous :: acceleration(:)  !! (slot) [m/s2]
    real(wp) :: slope
    integer :: at, i

    acceleration = 0.0_wp
    if (motion%by_time(c)) then
      if (motion%kind(c) == moved_by_displacement) then
        call field_values(motion%timed(c)%second, t, acceleration, at)
      else
        call field_values(motion%timed(c)%rate, t, acceleration, at)
      end if
      if (at > 0) acceleration = 0.0_wp
    else if (motion%kind(c) == moved_by_velocity) then
      slope = motion%curve%slope(t)
      do i = 1, size(acceleration)
        acceleration(i) = amplitude_of(motion, i, c)*slope
      end do
    end if
  end subroutine accelerations_of

  !> The step to time `t` is complete: keep the paths until then.
  subroutine advance_paths(motions, t)
    type(motion_type), intent(inout) :: motions(:)  !! (any number) get `path`
    real(wp), intent(in) :: t                       !! time [s]
    real(wp), allocatable :: path(:)
    integer :: m, c, at

    do m = 1, size(motions)
      associate (motion => motions(m))
        if (.not. any(motion%by_time .and. motion%kind == moved_by_velocity)) cycle
        allocate (path(size(motion%slots)))
        do c = 1, size(motion%path, 2)
          if (.not. motion%by_time(c) .or. motion%kind(c) /= moved_by_velocity) cycle
          call path_between(motion%timed(c)%value, motion%path_time, t, path, at)
          if (at == 0) motion%path(:, c) = motion%path(:, c) + path
        end do
        motion%path_time = t
        deallocate (path)
      end associate
    end do
  end subroutine advance_paths

  !> Keep the paths, or put them back.
  subroutine keep_paths(archive, motions)
    class(archive_type), intent(inout) :: archive   !! a checkpoint that is written or read
    type(motion_type), intent(inout) :: motions(:)  !! (any number) get their paths where it reads
    integer :: m

    do m = 1, size(motions)
      if (.not. any(motions(m)%by_time .and. motions(m)%kind == moved_by_velocity)) cycle
      call archive%keep('path of boundary '//to_text(m), motions(m)%path)
      call archive%keep('time of path '//to_text(m), motions(m)%path_time)
      motions(m)%time = never
    end do
  end subroutine keep_paths

  ! ---------------------------------------------------------------- loads that are expressions of t

  !> Add a part to a load: `weight` times an expression of t, along one component.
  subroutine add_part(load, key, component, expression, x, weight)
    type(load_type), intent(inout) :: load           !! with its slots
    character(*), intent(in) :: key                  !! that has the expression
    integer, intent(in) :: component                 !! along which it acts
    type(expression_type), intent(in) :: expression  !! of x, y, z, t
    real(wp), intent(in) :: x(:, :)                  !! positions of its points (slot, dim) [m]
    real(wp), intent(in) :: weight(:)                !! (slot) force density at the value 1
    type(load_part_type), allocatable :: parts(:)
    integer :: n

    n = 0
    if (allocated(load%parts)) n = size(load%parts)
    allocate (parts(n + 1))
    if (n > 0) parts(:n) = load%parts
    parts(n + 1)%component = component
    parts(n + 1)%weight = weight
    parts(n + 1)%key = key
    call new_field(expression, x, parts(n + 1)%field)
    call move_alloc(parts, load%parts)
  end subroutine add_part

  !> Whether a load may act along component `c`.
  pure logical function acts_along(load, c) result(acts)
    type(load_type), intent(in) :: load  !! the load
    integer, intent(in) :: c             !! component
    integer :: i

    acts = any(abs(load%density(:, c)) > 0.0_wp)
    if (.not. allocated(load%parts)) return
    do i = 1, size(load%parts)
      acts = acts .or. load%parts(i)%component == c
    end do
  end function acts_along

  !> Force densities at time `t` of a load that has parts; its factor is 1.
  subroutine density_of(load, t, density)
    class(load_type), intent(in) :: load                !! the load
    real(wp), intent(in) :: t                           !! time [s]
    real(wp), allocatable, intent(out) :: density(:, :)  !! (slot, dim) [N/m3]
    integer :: at, part

    if (abs(t - load%time) > 0.0_wp) then
      density = load%density
      call add_parts(load, t, density, at, part)
    else
      density = load%now
    end if
  end subroutine density_of

  !> Add the parts of a load at time `t`, but those that are not finite.
  subroutine add_parts(load, t, density, at_fault, part)
    class(load_type), intent(in) :: load
    real(wp), intent(in) :: t
    real(wp), intent(inout) :: density(:, :)
    integer, intent(out) :: at_fault, part   !! the first point and part that is not finite, 0: none
    real(wp) :: values(size(density, 1))
    integer :: i, at

    at_fault = 0
    part = 0
    do i = 1, size(load%parts)
      call field_values(load%parts(i)%field, t, values, at)
      if (at == 0) then
        associate (c => load%parts(i)%component)
          density(:, c) = density(:, c) + load%parts(i)%weight*values
        end associate
      else if (part == 0) then
        at_fault = at
        part = i
      end if
    end do
  end subroutine add_parts

  !> Bring the kept density of load `number` to time `t`. `fault` is allocated if it is not finite.
  subroutine renew_load(load, number, t, fault)
    type(load_type), intent(inout) :: load  !! gets `now`
    integer, intent(in) :: number           !! which load, for `fault`
    real(wp), intent(in) :: t               !! [s]
    type(condition_fault), allocatable, intent(inout) :: fault  !! the first one stays
    integer :: at, part

    if (.not. allocated(load%parts)) return
    load%now = load%density
    call add_parts(load, t, load%now, at, part)
    load%time = t
    if (at > 0) call note_fault('load', number, load%parts(part)%key, load%slots(at), t, fault)
  end subroutine renew_load

  !> Note the first value of a condition that is not finite.
  pure subroutine note_fault(group, number, key, slot, t, fault)
    character(*), intent(in) :: group  !! name of the group, without `&`
    integer, intent(in) :: number      !! which group of this name
    character(*), intent(in) :: key    !! that has the expression
    integer(i4), intent(in) :: slot    !! of the point
    real(wp), intent(in) :: t          !! time [s]
    type(condition_fault), allocatable, intent(inout) :: fault  !! the first one stays

    if (allocated(fault)) return
    allocate (fault)
    fault%group = group
    fault%number = number
    fault%key = key
    fault%slot = slot
    fault%time = t
  end subroutine note_fault

end module pd_motion_conditions
