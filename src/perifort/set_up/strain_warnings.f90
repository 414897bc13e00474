!> Loads and motions of a scene that predict strains above 1, mostly because numbers are not in SI
!> units: estimates by hand, of numbers and expressions alike.
module pd_set_up_strain_warnings
  use pd_base_kinds, only: wp, i1
  use pd_base_expression, only: expression_type
  use pd_base_field, only: field_type, field_values, new_field
  use pd_base_text, only: to_text
  use pd_base_warnings, only: warnings_type
  use pd_motion_conditions, only: impose, moved_by_displacement, moved_by_velocity
  use pd_motion_loads, only: load_of, load_type
  use pd_motion_static_pieces, only: find_pieces, pieces_type
  use pd_motion_system, only: system_type
  use pd_scene_content_expressions, only: expression_of
  use pd_scene_content_types, only: scene_type, is_set
  use pd_scene_content_units, only: units_advice
  use pd_set_up_plan, only: plan_type
  implicit none (type, external)
  private
  public :: warn_of_strains

  real(wp), parameter :: largest_strain = 1.0_wp  !! predicted by hand [-]
  integer, parameter :: samples = 20              !! of an expression in time
  integer, parameter :: most_points = 50          !! of a support that stand for all of it

  !> Points of supports that are compared with each other.
  type :: support_type
    integer, allocatable :: slot(:)
    integer, allocatable :: number(:)    !! of the boundary that each belongs to
    logical, allocatable :: held(:, :)   !! components whose course is known (point, dim)
    logical, allocatable :: turning(:)   !! all components are, and differ from point to point
  end type support_type

contains

  !> Add the warnings about loads, gravity, displacements and velocities.
  subroutine warn_of_strains(scene, system, plan, edges, warnings)
    type(scene_type), intent(in) :: scene            !! a checked scene
    type(system_type), intent(in), target :: system  !! made from it, ready at t = 0
    type(plan_type), intent(in) :: plan              !! method, step and number of steps
    real(wp), intent(in) :: edges(:)                 !! of the box around all bodies (dim) [m]
    type(warnings_type), intent(inout) :: warnings   !! added to

    call warn_of_loads(scene, system, end_of(plan), edges, warnings)
    call warn_of_supports(scene, system, plan, maxval(edges), warnings)
    if (.not. plan%relaxes) call warn_of_speeds(scene, system, end_of(plan), warnings)
  end subroutine warn_of_strains

  !> Time at which a run ends; load steps end at 1 [s].
  pure real(wp) function end_of(plan) result(finish)
    type(plan_type), intent(in) :: plan
    finish = 1.0_wp
    if (.not. plan%relaxes) finish = plan%step*plan%steps
  end function end_of

  !> Warn if a load or gravity predicts a strain above 1: pressure/E, force/(E A), body force L/E,
  !> density gravity L/E.
  subroutine warn_of_loads(scene, system, finish, edges, warnings)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in), target :: system
    real(wp), intent(in) :: finish                  !! of the run [s]
    real(wp), intent(in) :: edges(:)
    type(warnings_type), intent(inout) :: warnings
    type(load_type), pointer :: load
    real(wp) :: stiffness, strain
    integer :: l, c

    stiffness = minval(scene%materials%youngs_modulus)
    do l = 1, size(scene%loads)
      load => load_of(system%terms, l)
      associate (group => scene%loads(l))
        call warn(warnings, 'load', l, 'pressure', &
          & greatest(group%pressure, group%pressure_text)/stiffness)
        do c = 1, system%body%dim
          call warn(warnings, 'load', l, 'force', greatest(group%force(c), group%force_text(c)) &
            & /(cross_section(c)*stiffness))
          call warn(warnings, 'load', l, 'body_force', greatest(group%body_force(c), &
            & group%body_force_text(c))*edges(c)/stiffness)
        end do
      end associate
    end do
    do c = 1, system%body%dim
      if (.not. is_set(scene%header%gravity(c))) cycle
      strain = maxval(scene%materials%density/scene%materials%youngs_modulus) &
        & *abs(scene%header%gravity(c))*edges(c)
      call warn(warnings, 'scene', 0, 'gravity', strain)
    end do

  contains

    !> The greatest size of a number or an expression over the points and the course of the load.
    real(wp) function greatest(value, text) result(size_of)
      real(wp), intent(in) :: value
      character(*), intent(in) :: text

      size_of = 0.0_wp
      if (text /= '') then
        size_of = greatest_value(scene, text, system%body%x(load%slots, :), finish)
      else if (is_set(value)) then
        size_of = abs(value)
      end if
      size_of = size_of*maxval(abs(load%curve%values))
    end function greatest

    !> Area across direction `c` of the box around all bodies [m2].
    real(wp) function cross_section(c) result(area)
      integer, intent(in) :: c
      select case (scene%header%dimension)
      case (3); area = product(edges)/edges(c)
      case (2); area = edges(3 - c)*scene%header%thickness
      case default; area = scene%header%area
      end select
    end function cross_section
  end subroutine warn_of_loads

  !> The greatest size of an expression at some places, from the start to a time.
  real(wp) function greatest_value(scene, text, x, finish) result(greatest)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: text
    real(wp), intent(in) :: x(:, :)       !! (points, dim) [m]
    real(wp), intent(in) :: finish        !! [s]
    type(expression_type) :: expression
    type(field_type) :: field
    real(wp) :: values(size(x, 1))
    integer :: i, at

    greatest = 0.0_wp
    call expression_of(scene, text, expression)
    call new_field(expression, x, field)
    do i = 0, samples
      call field_values(field, i*finish/samples, values, at)
      if (at == 0 .and. size(values) > 0) greatest = max(greatest, maxval(abs(values)))
      if (.not. expression%in_time) exit
    end do
  end function greatest_value

  !> Warn if supports of one connected body move apart, or together, by more than its length: what
  !> moves it as a rigid body strains nothing. In a run in time a support that jumps at its start
  !> leaves the points behind that are free.
  subroutine warn_of_supports(scene, system, plan, length, warnings)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(plan_type), intent(in) :: plan
    real(wp), intent(in) :: length         !! of the box around all bodies [m]
    type(warnings_type), intent(inout) :: warnings
    type(support_type) :: points
    type(pieces_type) :: pieces
    real(wp), allocatable :: u(:, :), times(:)
    real(wp) :: worst(size(scene%boundaries), system%body%dim)
    logical :: jumps
    integer :: i, m, c

    call list_supports(system, plan%relaxes, points)
    if (size(points%slot) == 0) return
    call times_of(system, end_of(plan), times)
    worst = 0.0_wp
    do i = 1, size(times)
      u = system%state%u
      call impose(system%motions, times(i), u)
      jumps = i == 1 .and. .not. plan%relaxes
      ! two supports are no farther apart than twice the way of one
      if (.not. 2*maxval(abs(u)) > largest_strain*length) cycle
      if (pieces%number == 0) call find_pieces(system%body, system%family, pieces)
      call compare_supports(system, points, pieces, u, worst)
      if (jumps) call compare_with_free(system, points, pieces, u, system%state%u, worst)
    end do
    do m = 1, size(worst, 1)
      do c = 1, size(worst, 2)
        call warn(warnings, 'boundary', m, trim(merge('velocity    ', 'displacement', &
          & system%motions(m)%kind(c) == moved_by_velocity)), worst(m, c)/length)
      end do
    end do
  end subroutine warn_of_supports

  !> Points of every boundary with components whose displacements are given; in relaxation
  !> velocities give them, too.
  subroutine list_supports(system, relaxes, points)
    type(system_type), intent(in) :: system
    logical, intent(in) :: relaxes
    type(support_type), intent(out) :: points
    logical :: known(system%body%dim)
    integer :: m, i, n, pass

    do pass = 1, 2
      n = 0
      do m = 1, size(system%motions)
        associate (motion => system%motions(m))
          do i = 1, size(motion%slots), max(1, size(motion%slots)/most_points)
            known = motion%kind(:size(known)) == moved_by_displacement .or. &
              & (relaxes .and. motion%kind(:size(known)) == moved_by_velocity)
            if (.not. motion%is_pin) known = known .and. motion%held(i, :) == 1_i1
            if (.not. any(known)) cycle
            n = n + 1
            if (pass == 1) cycle
            points%slot(n) = motion%slots(i)
            points%number(n) = m
            points%held(n, :) = known
            points%turning(n) = all(known) .and. .not. motion%is_pin .and. &
              & (allocated(motion%profile) .or. any(motion%timed%value%in_space))
          end do
        end associate
      end do
      if (pass == 1) allocate (points%slot(n), points%number(n), points%turning(n), &
        & points%held(n, system%body%dim))
    end do
  end subroutine list_supports

  !> Times at which motions are looked at: of their tables, and between start and end of the run.
  subroutine times_of(system, finish, times)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: finish
    real(wp), allocatable, intent(out) :: times(:)
    integer :: i, m

    times = [(i*finish/samples, i=0, samples)]
    do m = 1, size(system%motions)
      times = [times, pack(system%motions(m)%curve%times, system%motions(m)%curve%times > 0.0_wp)]
    end do
  end subroutine times_of

  !> Raise `worst` (boundaries, dim) [m] to what two points of one piece are displaced beside each
  !> other. Of supports that may turn a common rotation counts for nothing: no more than the change
  !> of the distance of their points counts.
  pure subroutine compare_supports(system, points, pieces, u, worst)
    type(system_type), intent(in) :: system
    type(support_type), intent(in) :: points
    type(pieces_type), intent(in) :: pieces
    real(wp), intent(in) :: u(:, :)            !! (n_slots, dim) [m]
    real(wp), intent(inout) :: worst(:, :)
    real(wp) :: apart, x(system%body%dim), d(system%body%dim)
    integer :: i, j, c, m

    do i = 1, size(points%slot)
      do j = 1, i - 1
        associate (a => points%slot(i), b => points%slot(j))
          if (pieces%of(a) /= pieces%of(b)) cycle
          x = system%body%x(a, :) - system%body%x(b, :)
          d = u(a, :) - u(b, :)
          do c = 1, size(d)
            if (.not. (points%held(i, c) .and. points%held(j, c))) cycle
            apart = abs(d(c))
            if (points%turning(i) .and. points%turning(j)) apart = min(apart, abs(norm2(x + d) &
              & - norm2(x)))
            m = points%number(merge(i, j, abs(u(a, c)) >= abs(u(b, c))))
            worst(m, c) = max(worst(m, c), apart)
          end do
        end associate
      end do
    end do
  end subroutine compare_supports

  !> Raise `worst` to how far supports jump away from where the free points of their piece are.
  pure subroutine compare_with_free(system, points, pieces, u, free, worst)
    type(system_type), intent(in) :: system
    type(support_type), intent(in) :: points
    type(pieces_type), intent(in) :: pieces
    real(wp), intent(in) :: u(:, :)            !! (n_slots, dim) values of supports
    real(wp), intent(in) :: free(:, :)         !! (n_slots, dim) values at the start
    real(wp), intent(inout) :: worst(:, :)     !! (boundaries, dim)
    real(wp) :: mean
    integer :: i, c, p
    logical :: of_piece(system%body%n_slots)

    do p = 1, pieces%number
      if (.not. any(pieces%of(points%slot) == p)) cycle
      do c = 1, size(u, 2)
        of_piece = pieces%of == p .and. system%held(:, c) == 0_i1
        if (.not. any(of_piece)) cycle
        mean = sum(free(:, c), mask=of_piece)/count(of_piece)
        do i = 1, size(points%slot)
          if (pieces%of(points%slot(i)) /= p .or. .not. points%held(i, c)) cycle
          worst(points%number(i), c) = max(worst(points%number(i), c), &
            & abs(u(points%slot(i), c) - mean))
        end do
      end do
    end do
  end subroutine compare_with_free

  !> Warn if a boundary is faster, beside the free points of its body at the start, than waves in
  !> bars: a velocity v starts a strain of v over their speed.
  subroutine warn_of_speeds(scene, system, finish, warnings)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: finish
    type(warnings_type), intent(inout) :: warnings
    type(support_type) :: points
    type(pieces_type) :: pieces
    real(wp), allocatable :: u(:, :), v(:, :), times(:)
    real(wp) :: worst(size(scene%boundaries), system%body%dim), speed
    integer :: i, m, c

    call list_supports(system, .true., points)
    do i = 1, size(points%slot)
      where (system%motions(points%number(i))%kind(:system%body%dim) /= moved_by_velocity) &
        & points%held(i, :) = .false.
    end do
    if (.not. any(points%held)) return
    speed = sqrt(maxval(scene%materials%youngs_modulus/max(scene%materials%density, &
      & tiny(1.0_wp))))
    call times_of(system, finish, times)
    worst = 0.0_wp
    do i = 1, size(times)
      u = system%state%u
      v = system%state%v
      call impose(system%motions, times(i), u, v)
      if (.not. maxval(abs(v)) + maxval(abs(system%state%v)) > largest_strain*speed) cycle
      if (pieces%number == 0) call find_pieces(system%body, system%family, pieces)
      call compare_with_free(system, points, pieces, v, system%state%v, worst)
    end do
    do m = 1, size(worst, 1)
      do c = 1, size(worst, 2)
        call warn(warnings, 'boundary', m, 'velocity', worst(m, c)/speed)
      end do
    end do
  end subroutine warn_of_speeds

  !> Warn if a key of a group predicts a strain above 1; `number` is 0 where there is one group.
  subroutine warn(warnings, group, number, key, strain)
    type(warnings_type), intent(inout) :: warnings
    character(*), intent(in) :: group, key  !! of the scene
    integer, intent(in) :: number           !! of the group
    real(wp), intent(in) :: strain          !! predicted by hand [-]
    character(:), allocatable :: name

    if (strain <= largest_strain) return
    name = '&'//group
    if (number > 0) name = name//' number '//to_text(number)
    call warnings%add('strain '//group//' '//to_text(number)//' '//key, name//': its '//key// &
      & ' predicts a strain of '//to_text(strain, 2)//units_advice, tell=.false.)
  end subroutine warn

end module pd_set_up_strain_warnings
