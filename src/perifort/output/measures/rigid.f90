!> What the history has of a rigid body of a given shape: where it is, how it moves and turns, and
!> the force and moment of contact on it.
module pd_output_measures_rigid
  use pd_base_kinds, only: wp
  use pd_base_text, only: line => labelled_line, to_text
  use pd_base_warnings, only: warnings_type
  use pd_motion_pose, only: rotation_of
  use pd_motion_rigid_body, only: kinetic_of, spin_now
  use pd_motion_system, only: system_type
  use pd_output_measures_measure, only: measure_list_type, measure_type, row_source_type
  use pd_output_results_types, only: column_type
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: add_rigids

  character(*), parameter :: xyz(3) = ['x', 'y', 'z']

  !> A rigid body.
  type, extends(measure_type) :: rigid_measure_type
    character(:), allocatable :: name
    character(:), allocatable :: shape
    integer :: number = 0                !! of its group
    logical :: touched = .false.         !! a &contact names it
  contains
    procedure :: columns => columns_of_rigid
    procedure :: row => row_of_rigid
    procedure :: describe => describe_rigid
    procedure :: warn => warn_of_rigid
  end type rigid_measure_type

contains

  !> Add the rigid bodies of a scene.
  subroutine add_rigids(scene, measures)
    type(scene_type), intent(in) :: scene                !! a checked scene
    type(measure_list_type), intent(inout) :: measures   !! added to
    type(rigid_measure_type) :: measure
    integer :: i, j

    do i = 1, size(scene%rigids)
      measure%name = trim(scene%rigids(i)%name)
      measure%shape = trim(scene%rigids(i)%shape)
      measure%number = i
      measure%touched = .false.
      do j = 1, size(scene%contacts)
        measure%touched = measure%touched .or. &
          & any(scene%contacts(j)%between == scene%rigids(i)%name)
      end do
      call measures%add(measure)
    end do
  end subroutine add_rigids

  !> Displacement and velocity of the centre and the force on it; rotation, angular velocity and the
  !> moment about the centre; the kinetic energy, which is part of that of the run.
  function columns_of_rigid(measure, dim) result(columns)
    class(rigid_measure_type), intent(in) :: measure
    integer, intent(in) :: dim
    type(column_type), allocatable :: columns(:)
    integer :: c, n, axes

    axes = rotations(dim)
    allocate (columns(3*dim + 3*axes + 1))
    do c = 1, dim
      columns(c) = column_type(measure%name//'_displacement_'//xyz(c), 'm', 'rigid')
      columns(dim + c) = column_type(measure%name//'_velocity_'//xyz(c), 'm/s', 'rigid')
      columns(2*dim + c) = column_type(measure%name//'_force_'//xyz(c), 'N', 'rigid')
    end do
    do n = 1, axes
      c = 3 - axes + n
      columns(3*dim + n) = column_type(measure%name//'_rotation_'//xyz(c), 'rad', 'rigid')
      columns(3*dim + axes + n) = column_type(measure%name//'_spin_'//xyz(c), 'rad/s', 'rigid')
      columns(3*dim + 2*axes + n) = column_type(measure%name//'_moment_'//xyz(c), 'N m', 'rigid')
    end do
    columns(3*dim + 3*axes + 1) = column_type(measure%name//'_kinetic_energy', 'J', 'rigid')
  end function columns_of_rigid

  !> Their values.
  subroutine row_of_rigid(measure, now, values)
    class(rigid_measure_type), intent(inout) :: measure
    type(row_source_type), intent(in) :: now
    real(wp), intent(out) :: values(:)
    real(wp) :: rotation(3), spin(3)
    integer :: axes

    associate (rigid => now%system%rigid_bodies(measure%number), dim => now%system%body%dim)
      axes = rotations(dim)
      rotation = rotation_of(rigid%pose)
      spin = spin_now(rigid, now%system%time)
      values(:dim) = rigid%pose%place(:dim)
      values(dim + 1:2*dim) = rigid%pose%velocity(:dim)
      values(2*dim + 1:3*dim) = rigid%pose%force(:dim)
      values(3*dim + 1:3*dim + axes) = rotation(4 - axes:)
      values(3*dim + axes + 1:3*dim + 2*axes) = spin(4 - axes:)
      values(3*dim + 2*axes + 1:3*dim + 3*axes) = rigid%pose%torque(4 - axes:)
      values(3*dim + 3*axes + 1) = sum(kinetic_of(rigid, now%system%time))
    end associate
  end subroutine row_of_rigid

  !> Its shape and mass.
  function describe_rigid(measure, system) result(text)
    class(rigid_measure_type), intent(in) :: measure
    type(system_type), intent(in) :: system
    character(:), allocatable :: text

    text = measure%name//': '//measure%shape
    associate (mass => system%rigid_bodies(measure%number)%pose%mass)
      if (mass > 0.0_wp) text = text//', '//to_text(mass, 6)//' kg'
    end associate
    text = line('rigid body', text)
  end function describe_rigid

  !> A rigid body that no contact names is passed through.
  subroutine warn_of_rigid(measure, system, warnings)
    class(rigid_measure_type), intent(in) :: measure
    type(system_type), intent(in) :: system
    type(warnings_type), intent(inout) :: warnings

    associate (unused_system => system)
    end associate
    if (.not. measure%touched) call warnings%add('rigid '//to_text(measure%number), &
      & 'no &contact names the rigid body '//measure%name//': bodies pass through it', tell=.false.)
  end subroutine warn_of_rigid

  !> Axes about which a body can rotate: none, z, or all.
  pure integer function rotations(dim)
    integer, intent(in) :: dim   !! dimension of the scene
    rotations = (dim*(dim - 1))/2
  end function rotations

end module pd_output_measures_rigid
