!> Rigid bodies of a scene that are closed surfaces from files: their facets and what they hold.
module pd_set_up_rigid_surface
  use pd_base_eigen, only: eigenvectors
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: pi
  use pd_base_text, only: counted
  use pd_body_surface_distance, only: new_facets
  use pd_body_surface_fill, only: read_solid, solid_type
  use pd_body_surface_moments, only: surface_moments
  use pd_body_surface_surface, only: surface_fault
  use pd_force_obstacle, only: a_closed_surface, obstacle_type
  use pd_motion_pose, only: turn_on, turned_by
  use pd_scene_content_rules, only: place_fault
  use pd_scene_content_types, only: is_set, scene_type
  use pd_scene_format_file, only: resolve_path
  implicit none (type, external)
  private
  public :: facets_of

contains

  !> A closed surface: its facets about their centre of mass, which stays where it is or goes where
  !> the group puts it; its volume, its principal moments of inertia for a mass of 1, their axes.
  subroutine facets_of(scene, number, obstacle, volume, centre, inertia, axes, error)
    type(scene_type), intent(in) :: scene             !! a checked scene
    integer, intent(in) :: number                     !! of the `&rigid`
    type(obstacle_type), intent(inout) :: obstacle    !! gets its shape, facets and axes
    real(wp), intent(out) :: volume        !! of what it holds [m3]
    real(wp), intent(out) :: centre(3)     !! of mass [m]
    real(wp), intent(out) :: inertia(3)    !! per mass [m2]
    real(wp), intent(out) :: axes(3, 3)    !! columns
    type(error_type), allocatable, intent(out) :: error
    type(solid_type) :: solid
    real(wp) :: tensor(3, 3), vectors(3, 3), turn(4)
    integer :: v, c

    associate (group => scene%rigids(number), surface => solid%surface)
      call read_solid(resolve_path(trim(group%surface), scene%file), group%scale, solid, error)
      if (.not. allocated(error)) then
        if (solid%edges%n_open > 0) call surface_fault(surface, 'the surface of a rigid body '// &
          & 'must be closed: '//counted(solid%edges%n_open, 'edge')//' of one facet only', error, &
          & 'a body of points may have gaps, distances from a surface need it closed', &
          & solid%edges%first_open)
      end if
      if (.not. allocated(error)) then
        call surface_moments(surface, volume, centre, tensor)
        do v = 1, surface%n_vertices
          surface%x(:, v) = surface%x(:, v) - centre
        end do
        surface%low = surface%low - centre
        surface%high = surface%high - centre
        allocate (obstacle%facets)
        call new_facets(surface, solid%edges%n_many, obstacle%facets, error)
      end if
      call place_fault(error, scene, 'rigid', number, 'surface')
      if (allocated(error)) return
      if (any(is_set(group%centre))) centre = group%centre
      obstacle%shape = a_closed_surface
      obstacle%half = [obstacle%facets%reach, 0.0_wp, 0.0_wp]
      turn = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
      call turn_on(group%angle*pi/180*group%axis/norm2(group%axis), turn)
      do c = 1, 3
        obstacle%frame(:, c) = 0.0_wp
        obstacle%frame(c, c) = 1.0_wp
        obstacle%frame(:, c) = obstacle%frame(:, c) + turned_by(turn, obstacle%frame(:, c))
      end do
      call eigenvectors(tensor/volume, inertia, vectors)
      axes = matmul(obstacle%frame, vectors)
    end associate
  end subroutine facets_of

end module pd_set_up_rigid_surface
