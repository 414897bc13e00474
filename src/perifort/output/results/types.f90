!> What the results are made of: fields over the points and columns of the history.
module pd_output_results_types
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: field_type, column_type, line_type, kept_type, label_length
  public :: nodes_mean, nodes_linear, nodes_nearest

  integer, parameter :: label_length = 160  !! longest name of a field or column [characters]

  !> How values at the nodes and of the elements of a mesh follow from those of its points.
  integer, parameter :: nodes_mean = 0     !! means
  integer, parameter :: nodes_linear = 1   !! nodes: the linear function that fits; elements: means
  integer, parameter :: nodes_nearest = 2  !! the value of one point: numbers, not quantities

  !> A quantity that every output holds at every point.
  type :: field_type
    character(label_length) :: name = ''
    integer :: components = 1              !! 3 for vectors in any dimension (unused ones 0)
    character(32) :: unit = ''             !! SI, for instance 'm/s'; '1' for none
    character(32) :: labels = ''           !! names of the components, parted by blanks: 'x y z'
    integer :: at_nodes = nodes_mean       !! one of `nodes_*`
  end type field_type

  !> A quantity that every row of the history holds.
  type :: column_type
    character(label_length) :: name = ''
    character(32) :: unit = ''             !! SI; '1' for none
    character(16) :: origin = ''           !! 'run', 'boundary', 'probe', ..: what it belongs to
  end type column_type

  !> A line along which every output holds profiles of fields.
  type :: line_type
    character(label_length) :: name = ''
    real(wp), allocatable :: positions(:, :)      !! (n, dim) [m]
    type(field_type), allocatable :: fields(:)    !! with as many components as the dimension asks
  end type line_type

  !> What of the results a checkpoint counts on.
  type :: kept_type
    real(wp), allocatable :: rows(:, :)      !! the history (column, row)
    real(wp), allocatable :: times(:)        !! of the outputs [s]
    character(:), allocatable :: scene_text  !! the resolved scene of the run that wrote them
  end type kept_type

end module pd_output_results_types
