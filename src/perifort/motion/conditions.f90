!> Imposed motion of points (7.8; doc/theory.md, 10): by a course in time, or by expressions of
!> position and time.
module pd_motion_conditions
  use pd_base_archive, only: archive_type, same
  use pd_base_expression, only: derivative_in_time, expression_type
  use pd_base_field, only: field_type, field_values, new_field
  use pd_base_kinds, only: wp, i1, i4
  use pd_base_text, only: to_text
  use pd_base_vectors, only: cross
  use pd_body_body, only: body_type, number_at, owned
  use pd_motion_curve, only: curve_type
  use pd_motion_pose, only: pose_type, arm_of, displacement_of, keep_pose, spin_of, spin_rate_of
  implicit none (type, external)
  private
  public :: motion_type, free_component, moved_by_displacement, moved_by_velocity, impose, moves, &
    & remember_start, vary_in_time, advance_paths, keep_paths, accelerations_of, renew_motions, &
    & condition_fault, note_fault, guide, keep_poses

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
    logical :: is_pin = .false.             !! its points move as one rigid body, which `kind` and
                                            !! what else is imposed guide by its centre
    type(pose_type), allocatable :: pose    !! of a pin, once the system is ready
    real(wp) :: moment(3) = 0.0_wp          !! of a pin, about its centre [N m]
  end type motion_type

contains

  !> Whether a motion imposes any other displacement or velocity than 0 on some component.
  pure logical function moves(motion)
    type(motion_type), intent(in) :: motion  !! of some points
    integer :: c

    moves = .false.
    do c = 1, size(motion%kind)
      if (motion%kind(c) == free_component) cycle
      moves = moves .or. motion%by_time(c) .or. abs(motion%amplitude(c)) > 0.0_wp
      if (.not. allocated(motion%profile)) cycle
      if (c <= size(motion%profile, 2)) moves = moves .or. any(abs(motion%profile(:, c)) > 0.0_wp)
    end do
  end function moves

  !> Keep the displacements at t = 0, from which imposed velocities integrate.
  pure subroutine remember_start(motions, u)
    type(motion_type), intent(inout) :: motions(:)  !! (any number) get `start`
    real(wp), intent(in) :: u(:, :)                 !! (n_slots, dim) displacements at t = 0 [m]
    integer :: m, c

    do m = 1, size(motions)
      if (allocated(motions(m)%pose)) then
        motions(m)%start = reshape(motions(m)%pose%place(:size(u, 2)), [1, size(u, 2)])
        cycle
      end if
      if (.not. allocated(motions(m)%start)) &
        & allocate (motions(m)%start(size(motions(m)%slots), size(u, 2)))
      do c = 1, size(u, 2)
        motions(m)%start(:, c) = u(motions(m)%slots, c)
      end do
    end do
  end subroutine remember_start

  !> Set displacement and velocity of the constrained components at time `t` [s].
  subroutine impose(motions, t, u, v, but_pins)
    type(motion_type), intent(in) :: motions(:)   !! (any number) with `start` and `held` set
    real(wp), intent(in) :: t  !! time; in relaxation 0 to 1 over the load steps [s]
    real(wp), intent(inout) :: u(:, :)            !! displacements (n_slots, dim) [m]
    real(wp), intent(inout), optional :: v(:, :)  !! velocities (n_slots, dim) [m/s]
    logical, intent(in), optional :: but_pins     !! whether pins are left as they are
    real(wp) :: factor, rate, path
    integer :: m, c, i

    do m = 1, size(motions)
      associate (motion => motions(m))
        if (allocated(motion%pose)) then
          if (present(but_pins)) cycle
          if (present(v)) then
            call impose_pose(motion, t, u, v)
          else
            call impose_pose(motion, t, u)
          end if
          cycle
        end if
        if (all(motion%kind == free_component)) cycle
        factor = motion%curve%value(t)
        rate = motion%curve%slope(t)
        path = motion%curve%integral(t)
        if (any(motion%by_time)) then
          if (present(v)) then
            call impose_by_time(motion, t, u, v)
          else
            call impose_by_time(motion, t, u)
          end if
        end if
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

  !> Set displacement and velocity of a pin's points: all its components.
  subroutine impose_pose(motion, t, u, v)
    type(motion_type), intent(in) :: motion       !! a pin
    real(wp), intent(in) :: t                     !! time [s]
    real(wp), intent(inout) :: u(:, :)            !! displacements (n_slots, dim) [m]
    real(wp), intent(inout), optional :: v(:, :)  !! velocities (n_slots, dim) [m/s]
    real(wp) :: place(3), velocity(3), spin(3), moved(3)
    integer :: i, k

    call guide(motion, t, place, velocity)
    spin = spin_of(motion%pose)
    do i = 1, size(motion%slots)
      k = motion%slots(i)
      moved = displacement_of(motion%pose, i, place)
      u(k, :) = moved(:size(u, 2))
      if (.not. present(v)) cycle
      moved = velocity + cross(spin, arm_of(motion%pose, i))
      v(k, :) = moved(:size(u, 2))
    end do
  end subroutine impose_pose

  !> Displacement and velocity of a pin's centre at time `t`: what is imposed, else what its pose
  !> has.
  subroutine guide(motion, t, place, velocity)
    type(motion_type), intent(in) :: motion  !! a pin with its `start`
    real(wp), intent(in) :: t                !! time [s]
    real(wp), intent(out) :: place(3)        !! [m]
    real(wp), intent(out) :: velocity(3)     !! [m/s]
    real(wp), allocatable :: places(:, :), speeds(:, :)
    integer :: c, at, component

    place = motion%pose%place
    velocity = motion%pose%velocity
    if (any(motion%by_time)) then
      places = motion%place
      speeds = motion%speed
      if (abs(t - motion%time) > 0.0_wp) call places_at(motion, t, places, speeds, at, component)
    end if
    do c = 1, motion%pose%dim
      if (motion%by_time(c)) then
        place(c) = places(1, c)
        velocity(c) = speeds(1, c)
      else if (motion%kind(c) == moved_by_displacement) then
        place(c) = motion%amplitude(c)*motion%curve%value(t)
        velocity(c) = motion%amplitude(c)*motion%curve%slope(t)
      else if (motion%kind(c) == moved_by_velocity) then
        place(c) = motion%start(1, c) + motion%amplitude(c)*motion%curve%integral(t)
        velocity(c) = motion%amplitude(c)*motion%curve%value(t)
      end if
    end do
  end subroutine guide

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
    real(wp) :: of_centre(1)

    if (allocated(motion%pose)) then
      call imposed_accelerations(motion, c, t, of_centre)
      if (motion%kind(c) == free_component) of_centre = motion%pose%force(c)/motion%pose%mass
      call add_turning(motion%pose, c, of_centre(1), acceleration)
    else
      call imposed_accelerations(motion, c, t, acceleration)
    end if
  end subroutine accelerations_of

  !> What is imposed: on every point, or on the centre of a pin, which counts as one.
  subroutine imposed_accelerations(motion, c, t, acceleration)
    type(motion_type), intent(in) :: motion
    integer, intent(in) :: c
    real(wp), intent(in) :: t
    real(wp), intent(out), contiguous :: acceleration(:)
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
  end subroutine imposed_accelerations

  !> Accelerations of a rigid body's points from that of its centre and its turning.
  pure subroutine add_turning(pose, c, of_centre, acceleration)
    type(pose_type), intent(in) :: pose
    integer, intent(in) :: c
    real(wp), intent(in) :: of_centre
    real(wp), intent(out) :: acceleration(:)
    real(wp) :: spin(3), rate(3), arm(3), turning(3)
    integer :: i

    spin = spin_of(pose)
    rate = spin_rate_of(pose)
    do i = 1, size(acceleration)
      arm = arm_of(pose, i)
      turning = cross(rate, arm) + cross(spin, cross(spin, arm))
      acceleration(i) = of_centre + turning(c)
    end do
  end subroutine add_turning

  !> The step to time `t` is complete: keep the paths until then.
  subroutine advance_paths(motions, t)
    type(motion_type), intent(inout) :: motions(:)  !! (any number) get `path`
    real(wp), intent(in) :: t                       !! time [s]
    real(wp), allocatable :: path(:)
    integer :: m, c, at

    do m = 1, size(motions)
      associate (motion => motions(m))
        if (.not. any(motion%by_time .and. motion%kind == moved_by_velocity)) cycle
        allocate (path(size(motion%path, 1)))
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
  subroutine keep_paths(archive, body, motions)
    class(archive_type), intent(inout) :: archive   !! a checkpoint that is written or read
    type(body_type), intent(in) :: body             !! whose slots the motions have
    type(motion_type), intent(inout) :: motions(:)  !! (any number) get their paths where it reads
    character(:), allocatable :: name
    integer, allocatable :: slots(:)
    integer :: m

    do m = 1, size(motions)
      if (.not. any(motions(m)%by_time .and. motions(m)%kind == moved_by_velocity)) cycle
      name = 'path of boundary '//to_text(m)
      slots = int(motions(m)%slots)
      call archive%name_rows(name, number_at(body, slots), owned(body, slots))
      call archive%over(name)
      call archive%keep(name, motions(m)%path)
      call archive%over(same)
      call archive%keep('time of path '//to_text(m), motions(m)%path_time)
      motions(m)%time = never
    end do
  end subroutine keep_paths

  !> Keep where pins are, or put them back.
  subroutine keep_poses(archive, motions)
    class(archive_type), intent(inout) :: archive   !! a checkpoint that is written or read
    type(motion_type), intent(inout) :: motions(:)  !! (any number) get their poses where it reads
    integer :: m

    do m = 1, size(motions)
      if (allocated(motions(m)%pose)) call keep_pose(archive, &
        & 'pin of boundary '//to_text(m), motions(m)%pose)
    end do
  end subroutine keep_poses

  !> Note the first value of a condition that is not finite.
  pure subroutine note_fault(group, number, key, slot, t, fault)
    character(*), intent(in) :: group  !! name of the group, without `&`
    integer, intent(in) :: number      !! which group of this name
    character(*), intent(in) :: key    !! that has the expression
    integer(i4), intent(in) :: slot    !! of the point; 0: it belongs to none
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
