!> What the history has of a boundary with a name: the reaction force.
module pd_output_measures_boundary
  use pd_base_kinds, only: wp
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
      call measures%add(measure)
    end do
  end subroutine add_boundaries

  !> The force that the boundary exerts on the body.
  function columns_of_boundary(measure, dim) result(columns)
    class(boundary_measure_type), intent(in) :: measure
    integer, intent(in) :: dim
    type(column_type), allocatable :: columns(:)
    integer :: c

    allocate (columns(dim))
    do c = 1, dim
      columns(c) = column_type(measure%name//'_reaction_'//xyz(c), 'N', 'boundary')
    end do
  end function columns_of_boundary

  !> Their values.
  subroutine row_of_boundary(measure, now, values)
    class(boundary_measure_type), intent(inout) :: measure
    type(row_source_type), intent(in) :: now
    real(wp), intent(out) :: values(:)

    values(:) = now%system%motions(measure%number)%reaction(:size(values))
  end subroutine row_of_boundary

end module pd_output_measures_boundary
