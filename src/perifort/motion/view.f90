!> What an observer may ask of a body in motion: values at points, in the order of the results, body
!> by body and then layers, whatever place they have in the arrays.
module pd_motion_view
  use pd_base_kinds, only: wp
  use pd_motion_observer, only: instant_type
  use pd_motion_account, only: energies_type, energies_of, velocities_now
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: number_of_points, point_near, positions_of, volumes_of, displacements_of, &
    & velocities_of, force_densities_of, damage_of, find_energies

contains

  !> Number of points.
  pure integer function number_of_points(system) result(number)
    type(system_type), intent(in) :: system
    number = system%body%n_points
  end function number_of_points

  !> Number of the point nearest to a position, the lowest if there are several.
  pure integer function point_near(system, position) result(point)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: position(:)   !! as many components as dimensions, or more [m]
    real(wp) :: distance, least
    integer :: i

    point = 0
    least = huge(least)
    do i = 1, system%body%n_points
      distance = norm2(system%body%x(system%body%slot(i), :) - position(:system%body%dim))
      if (distance >= least) cycle
      least = distance
      point = i
    end do
  end function point_near

  !> Positions before the motion (point, component) [m].
  pure function positions_of(system) result(values)
    type(system_type), intent(in) :: system
    real(wp), allocatable :: values(:, :)
    values = system%body%x(system%body%slot, :)
  end function positions_of

  !> Volumes of the points [m3].
  pure function volumes_of(system) result(values)
    type(system_type), intent(in) :: system
    real(wp), allocatable :: values(:)
    values = system%body%volume(system%body%slot)
  end function volumes_of

  !> Displacements now (point, component) [m].
  pure function displacements_of(system) result(values)
    type(system_type), intent(in) :: system
    real(wp), allocatable :: values(:, :)
    values = system%state%u(system%body%slot, :)
  end function displacements_of

  !> Velocities at this instant (point, component) [m/s]. The state itself may hold those of half a
  !> step before.
  function velocities_of(system, instant) result(values)
    type(system_type), intent(in) :: system
    type(instant_type), intent(in) :: instant   !! that `observe` was given
    real(wp), allocatable :: values(:, :)
    real(wp), allocatable :: v(:, :)

    call velocities_now(system, instant%time, instant%kick, v)
    values = v(system%body%slot, :)
  end function velocities_of

  !> Densities of the internal forces now (point, component) [N/m3].
  pure function force_densities_of(system) result(values)
    type(system_type), intent(in) :: system
    real(wp), allocatable :: values(:, :)
    values = system%state%force(system%body%slot, :)
  end function force_densities_of

  !> Local damage of the points, 0 to 1 [-]; 0 where nothing can break.
  pure function damage_of(system) result(values)
    type(system_type), intent(in) :: system
    real(wp), allocatable :: values(:)

    allocate (values(system%body%n_points), source=0.0_wp)
    if (size(system%state%damage) > 0) values = system%state%damage(system%body%slot)
  end function damage_of

  !> Kinetic and strain energy at this instant [J]; the dissipated energy is `system%dissipated` and
  !> the work of loads and imposed motion `system%external_work`. Takes about two evaluations of the
  !> forces.
  subroutine find_energies(system, instant, energies)
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant   !! that `observe` was given
    type(energies_type), intent(out) :: energies
    real(wp), allocatable :: v(:, :)

    call velocities_now(system, instant%time, instant%kick, v)
    call energies_of(system, v, energies)
  end subroutine find_energies

end module pd_motion_view
