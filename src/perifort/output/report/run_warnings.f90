!> Warnings during a run about states for which the method is not valid: contact, rotated parts,
!> large strains. Each is a text, '' without a warning.
module pd_output_report_run_warnings
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: pi
  use pd_base_text, only: counted, to_text
  use pd_motion_system, only: system_type
  use pd_output_report_contact, only: touching_points
  use pd_output_report_rotation, only: turned_part
  use pd_output_report_strain, only: find_large_strains, find_strains_beyond, large_strain
  implicit none (type, external)
  private
  public :: contact_warning, gradient_warning, large_strain_warning, rotation_warning, &
    & strain_warning

  !> Rotations that cause a warning with the projected dilatation: beyond 10 degrees its error is
  !> 1.5 % and more. So large a share of the points must have turned: a few may turn at the tip of a
  !> crack.
  real(wp), parameter :: small_rotation = pi/18
  real(wp), parameter :: least_turned = 0.02_wp

contains

  !> Points pass through each other, which the method doesn't hinder.
  function contact_warning(system, time) result(text)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: time              !! [s]
    character(:), allocatable :: text
    integer :: first, second

    text = ''
    call touching_points(system%body, system%family, system%state%u, first, second)
    if (first > 0) text = 'at t = '//to_text(time)//' s points '// &
      & to_text(first)//' and '//to_text(second)// &
      & ', which share no intact bond, are closer than half a spacing: '// &
      & trim(merge('their &contact is too soft, or they have none      ', &
      & 'there is no contact: pieces pass through each other', system%terms%has('contact')))
  end function contact_warning

  !> Parts of the body have turned where the dilatation is projected.
  function rotation_warning(system, time) result(text)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: time              !! [s]
    character(:), allocatable :: text
    real(wp) :: share, largest

    text = ''
    if (.not. (system%model%dilatation .and. system%model%projected)) return
    call turned_part(system%body, system%family, system%state%u, small_rotation, share, largest)
    if (share > least_turned) text = 'at t = '//to_text(time)//' s '// &
      & to_text(100*share, 2)//' % of the points are turned by more than 10 degrees, up to '// &
      & to_text(largest*180/pi, 3)//': the projected dilatation shrinks by the cosine of a '// &
      & "rotation, so forces and energies are wrong; &horizon dilatation = 'unprojected' has "// &
      & 'no such error'
  end function rotation_warning

  !> Strains are too large for a law that is linear in the stretch.
  function strain_warning(system, time) result(text)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: time              !! [s]
    character(:), allocatable :: text
    integer :: number, point
    real(wp) :: stretch

    text = ''
    call find_large_strains(system, number, point, stretch)
    if (number > 0) text = 'at t = '//to_text(time)//' s intact bonds of '// &
      & counted(number, 'point')//' are strained by more than '//to_text(nint(100*large_strain))// &
      & ' %, the most by '//to_text(100*stretch, 3)//' % (point '//to_text(point)// &
      & '): the material is linear in the strain and not valid for large strains'
  end function strain_warning

  !> Strains are beyond those for which a law for large strains was found to be accurate.
  function large_strain_warning(system, time) result(text)
    type(system_type), intent(in) :: system   !! at the present displacements
    real(wp), intent(in) :: time              !! [s]
    character(:), allocatable :: text
    integer :: number, point
    real(wp) :: strain, limit

    text = ''
    call find_strains_beyond(system, number, point, strain, limit)
    if (number > 0) text = 'at t = '//to_text(time)//' s intact bonds of '// &
      & counted(number, 'point')//' have logarithmic strains beyond '//to_text(limit, 3)// &
      & ', the most '//to_text(strain, 3)//' (point '//to_text(point)//'): model = '''// &
      & trim(system%model%laws(system%body%material(system%body%slot(point)))%law%name)// &
      & ''' was found to be accurate up to that; beyond, its flow stress and volume are off by more'
  end function large_strain_warning

  !> Points have too few bonds for a gradient of the displacements, which a field of the output
  !> needs.
  function gradient_warning(number, time) result(text)
    integer, intent(in) :: number             !! points
    real(wp), intent(in) :: time              !! [s]
    character(:), allocatable :: text

    text = ''
    if (number > 0) text = 'at t = '//to_text(time)//' s the intact bonds of '// &
      & counted(number, 'point')//' do not span the space: their deformation gradient is not '// &
      & 'defined and is written as 1, their strain as 0'
  end function gradient_warning

end module pd_output_report_run_warnings
