!> What the history has of a boundary with a name: the reaction force, and the mean displacement of
!> its points, so that load against displacement is two columns.
module pd_output_measures_boundary
  use pd_base_kinds, only: wp
  use pd_base_reduce, only: add_point, new_running, running_type, total_of_running
  use pd_motion_conditions, only: motion_type
  use pd_motion_pose, only: rotation_of
  use pd_motion_system, only: system_type
  use pd_output_measures_measure, only: measure_list_type, measure_type, row_source_type
  use pd_output_results_types, only: column_type
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: add_boundaries

  character(*), parameter :: xyz(3) = ['x', 'y', 'z']

  !> A boundary with a name.
  type, extends(measure_type) :: boundary_measure_type
    character(:), allocatable :: name
    integer :: number = 0                !! of its group and of its motion
    logical :: is_pin = .false.          !! has moments and rotations, too
  contains
    procedure :: columns => columns_of_boundary
    procedure :: row => row_of_boundary
  end type boundary_measure_type

contains

  !> Add the boundaries of a scene that have a name.
  subroutine add_boundaries(scene, measures)
    type(scene_type), intent(in) :: scene                !! a checked scene
    type(measure_list_type), intent(inout) :: measures   !! added to
    type(boundary_measure_type) :: measure
    integer :: i

    do i = 1, size(scene%boundaries)
      if (scene%boundaries(i)%name == '') cycle
      measure%name = trim(scene%boundaries(i)%name)
      measure%number = i
      measure%is_pin = scene%boundaries(i)%motion == 'pin'
      call measures%add(measure)
    end do
  end subroutine add_boundaries

  !> The force that the boundary exerts on the body, and the mean displacement; of a pin the moment
  !> about its centre and its rotation, too.
  function columns_of_boundary(measure, dim) result(columns)
    class(boundary_measure_type), intent(in) :: measure
    integer, intent(in) :: dim
    type(column_type), allocatable :: columns(:)
    integer :: c, n, axes

    axes = merge(rotations(dim), 0, measure%is_pin)
    allocate (columns(2*dim + 2*axes))
    do c = 1, dim
      columns(c) = column_type(measure%name//'_reaction_'//xyz(c), 'N', 'boundary')
      columns(dim + c) = column_type(measure%name//'_displacement_'//xyz(c), 'm', 'boundary')
    end do
    do n = 1, axes
      c = 3 - axes + n
      columns(2*dim + n) = column_type(measure%name//'_moment_'//xyz(c), 'N m', 'boundary')
      columns(2*dim + axes + n) = column_type(measure%name//'_rotation_'//xyz(c), 'rad', 'boundary')
    end do
  end function columns_of_boundary

  !> Their values.
  subroutine row_of_boundary(measure, now, values)
    class(boundary_measure_type), intent(inout) :: measure
    type(row_source_type), intent(in) :: now
    real(wp), intent(out) :: values(:)

    real(wp) :: rotation(3)
    integer :: axes

    associate (motion => now%system%motions(measure%number), dim => now%system%body%dim)
      values(:dim) = motion%reaction(:dim)
      values(dim + 1:2*dim) = mean_displacement(now%system, motion)
      if (.not. measure%is_pin) return
      axes = rotations(dim)
      rotation = rotation_of(motion%pose)
      values(2*dim + 1:2*dim + axes) = motion%moment(4 - axes:)
      values(2*dim + axes + 1:) = rotation(4 - axes:)
    end associate
  end subroutine row_of_boundary

  !> Axes about which a body can rotate: none, z, or all.
  pure integer function rotations(dim)
    integer, intent(in) :: dim   !! dimension of the scene
    rotations = (dim*(dim - 1))/2
  end function rotations

  !> The mean displacement of a boundary's points, weighted by their volumes (dim) [m].
  function mean_displacement(system, motion) result(mean)
    type(system_type), intent(in) :: system
    type(motion_type), intent(in) :: motion  !! whose slots stand in the order of points
    real(wp) :: mean(system%body%dim)
    type(running_type) :: running
    real(wp) :: totals(6)
    integer :: i

    associate (body => system%body)
      call new_running(running)
      do i = 1, size(motion%slots)
        associate (k => motion%slots(i))
          call add_point(body%order, body%point(k), body%volume(k)*[1.0_wp, &
            & system%state%u(k, :)], running)
        end associate
      end do
      totals = total_of_running(body%order, running)
      mean = totals(2:1 + body%dim)/totals(1)
    end associate
  end function mean_displacement

end module pd_output_measures_boundary
