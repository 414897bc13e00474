!> A field of the output: what is known of a quantity that every point has.
!>
!> One description is used by the results files, the probes, the columns of the history and the
!> studies. Each field has a module of its own in this folder; `pd_output_fields_table` lists them.
module pd_output_fields_field
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp
  use pd_motion_system, only: system_type
  use pd_output_fields_exact, only: exact_type
  use pd_output_fields_gradient, only: at_slot_from_gradient, fill_from_gradient, &
    & from_gradient_interface, shared_type
  use pd_output_results_types, only: field_type, nodes_mean
  use pd_scene_content_types, only: name_length
  implicit none (type, external)
  private
  public :: output_field_type, moment_type
  public :: rank_scalar, rank_vector, rank_symmetric, rank_stress, rank_tensor, rank_principal

  integer, parameter :: rank_scalar = 0
  integer, parameter :: rank_vector = 1
  integer, parameter :: rank_symmetric = 2  !! a symmetric tensor: xx, yy, zz, xy, yz, xz
  integer, parameter :: rank_stress = 3     !! the same, which in the plane has zz, too
  integer, parameter :: rank_tensor = 4     !! any tensor, row by row
  integer, parameter :: rank_principal = 5  !! the three principal values of a tensor

  !> A field. It has `fill` or `of_gradient`; the other procedures may be left out.
  type :: output_field_type
    character(name_length) :: name = ''       !! as in the scene, in lower case
    character(32) :: unit = '1'               !! SI, for instance 'm/s'; '1' for none
    character(160) :: meaning = ''            !! in a few words
    integer :: rank = rank_scalar
    integer :: at_nodes = nodes_mean          !! values at the nodes of a mesh: one of `nodes_*`
    procedure(fill_interface), pointer, nopass :: fill => null()
    procedure(point_interface), pointer, nopass :: at_slot => null()  !! else `fill` is called
    procedure(from_gradient_interface), pointer, nopass :: of_gradient => null()
      !! instead of `fill` and `at_slot`: the values follow from the gradient of the displacements
    procedure(exact_interface), pointer, nopass :: exact => null()    !! else no answer knows it
    procedure(lack_interface), pointer, nopass :: lack => null()      !! else always available
  contains
    procedure :: components
    procedure :: component_name
    procedure :: in_file
    procedure :: all_values
    procedure :: values_at
    procedure :: exact_values
    procedure :: missing
  end type output_field_type

  !> What fields are taken from: a system at one instant.
  type :: moment_type
    type(system_type), pointer :: system => null()        !! with forces that are up to date
    real(wp), pointer, contiguous :: v(:, :) => null()    !! velocities now (n_slots, dim) [m/s]
    type(shared_type), pointer :: shared => null()        !! else each field computes all it needs
  end type moment_type

  abstract interface
    !> Values of all points, in point order.
    subroutine fill_interface(now, values)
      import :: moment_type, wp
      implicit none (type, external)
      type(moment_type), intent(in) :: now
      real(wp), intent(out) :: values(:, :)       !! (n_points, components)
    end subroutine fill_interface

    !> Values of one point, for probes and measures: without a pass over the body.
    subroutine point_interface(now, k, values)
      import :: moment_type, wp
      implicit none (type, external)
      type(moment_type), intent(in) :: now
      integer, intent(in) :: k                    !! slot of the point
      real(wp), intent(out) :: values(:)          !! (components)
    end subroutine point_interface

    !> Values of an answer in closed form.
    pure subroutine exact_interface(state, values, known)
      import :: exact_type, wp
      implicit none (type, external)
      type(exact_type), intent(in) :: state
      real(wp), intent(out) :: values(:)          !! (components), 0 where not known
      logical, intent(out) :: known
    end subroutine exact_interface

    !> Why a run cannot have the field, '' if it can.
    function lack_interface(system) result(reason)
      import :: system_type
      implicit none (type, external)
      type(system_type), intent(in) :: system     !! before its first step
      character(:), allocatable :: reason
    end function lack_interface
  end interface

contains

  !> Number of components in `dim` dimensions.
  pure integer function components(field, dim)
    class(output_field_type), intent(in) :: field
    integer, intent(in) :: dim                    !! 1, 2 or 3

    select case (field%rank)
    case (rank_scalar); components = 1
    case (rank_vector); components = dim
    case (rank_symmetric); components = dim*(dim + 1)/2
    case (rank_stress); components = dim*(dim + 1)/2 + merge(1, 0, dim == 2)
    case (rank_tensor); components = dim**2
    case (rank_principal); components = 3
    case default
      components = 0
      call internal_fault('a field of the output has a rank that is not known')
    end select
  end function components

  !> Name of component `c` in `dim` dimensions: '' of a scalar; x y z; xx yy zz xy yz xz of a
  !> symmetric tensor; xx xy xz yx .. of any tensor; 1 2 3 of principal values.
  pure function component_name(field, c, dim) result(name)
    class(output_field_type), intent(in) :: field
    integer, intent(in) :: c                      !! 1 .. components
    integer, intent(in) :: dim                    !! 1, 2 or 3
    character(:), allocatable :: name
    character(*), parameter :: pairs(6) = ['xx', 'yy', 'zz', 'xy', 'yz', 'xz']
    character(*), parameter :: plane(3) = ['xx', 'yy', 'xy']
    character(*), parameter :: plane_stress(4) = ['xx', 'yy', 'zz', 'xy']
    character(*), parameter :: directions = 'xyz', numbers = '123'
    integer :: row, column

    select case (field%rank)
    case (rank_scalar)
      name = ''
    case (rank_vector)
      name = directions(c:c)
    case (rank_symmetric)
      name = pairs(c)
      if (dim == 2) name = plane(c)
    case (rank_stress)
      name = pairs(c)
      if (dim == 2) name = plane_stress(c)
    case (rank_tensor)
      row = (c - 1)/dim + 1
      column = mod(c - 1, dim) + 1
      name = directions(row:row)//directions(column:column)
    case (rank_principal)
      name = numbers(c:c)
    case default
      name = ''
      call internal_fault('a field of the output has a rank that is not known')
    end select
  end function component_name

  !> How the results files hold the field: vectors have three components in any dimension, since
  !> readers expect that; what is beyond the dimension is 0.
  pure type(field_type) function in_file(field, dim) result(entry)
    class(output_field_type), intent(in) :: field
    integer, intent(in) :: dim                    !! 1, 2 or 3
    integer :: c, shown

    shown = dim
    if (field%rank == rank_vector) shown = 3
    entry%name = field%name
    entry%unit = field%unit
    entry%at_nodes = field%at_nodes
    entry%components = field%components(shown)
    do c = 1, entry%components
      entry%labels = trim(entry%labels)//' '//field%component_name(c, shown)
    end do
    entry%labels = adjustl(entry%labels)
  end function in_file

  !> Values of all points, in point order. Fields of one output share what the moment has for that.
  subroutine all_values(field, now, values)
    class(output_field_type), intent(in) :: field
    type(moment_type), intent(in) :: now
    real(wp), intent(out) :: values(:, :)         !! (n_points, components)
    type(shared_type) :: own

    if (.not. associated(field%of_gradient)) then
      call field%fill(now, values)
    else if (associated(now%shared)) then
      call fill_from_gradient(now%system, now%shared, field%of_gradient, values)
    else
      call fill_from_gradient(now%system, own, field%of_gradient, values)
    end if
  end subroutine all_values

  !> Values at some slots.
  subroutine values_at(field, now, slots, values)
    class(output_field_type), intent(in) :: field
    type(moment_type), intent(in) :: now
    integer, intent(in) :: slots(:)               !! of points
    real(wp), intent(out) :: values(:, :)         !! (components, slot)
    real(wp), allocatable :: of_points(:, :)
    integer :: i

    if (associated(field%of_gradient)) then
      do i = 1, size(slots)
        call at_slot_from_gradient(now%system, slots(i), field%of_gradient, values(:, i))
      end do
    else if (associated(field%at_slot)) then
      do i = 1, size(slots)
        call field%at_slot(now, slots(i), values(:, i))
      end do
    else
      allocate (of_points(now%system%body%n_points, size(values, 1)))
      call field%fill(now, of_points)
      do i = 1, size(slots)
        values(:, i) = of_points(now%system%body%point(slots(i)), :)
      end do
    end if
  end subroutine values_at

  !> Values of an answer in closed form, as far as it knows the field.
  pure subroutine exact_values(field, state, values, known)
    class(output_field_type), intent(in) :: field
    type(exact_type), intent(in) :: state
    real(wp), intent(out) :: values(:)            !! (components), 0 where not known
    logical, intent(out) :: known

    values = 0.0_wp
    known = state%known .and. associated(field%exact)
    if (known) call field%exact(state, values, known)
  end subroutine exact_values

  !> Why a run cannot have the field, '' if it can.
  function missing(field, system) result(reason)
    class(output_field_type), intent(in) :: field
    type(system_type), intent(in) :: system       !! before its first step
    character(:), allocatable :: reason

    reason = ''
    if (associated(field%lack)) reason = field%lack(system)
  end function missing

end module pd_output_fields_field
