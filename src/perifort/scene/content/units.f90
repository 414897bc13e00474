!> Numbers of a scene that look as if they were not in SI units. A scene in millimetres, newtons and
!> megapascals is computed without an error, and its results are wrong by powers of ten.
module pd_scene_content_units
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text, with_unit
  use pd_base_warnings, only: warnings_type
  use pd_scene_content_types, only: scene_type, is_set
  implicit none (type, external)
  private
  public :: warn_of_units

  real(wp), parameter :: softest = 1.0e3_wp, stiffest = 1.0e13_wp  !! Young's moduli [Pa]
  real(wp), parameter :: lightest = 10.0_wp, heaviest = 3.0e4_wp   !! densities [kg/m3]
  real(wp), parameter :: jelly = 1.0e6_wp                          !! softer than rubber [Pa]
  real(wp), parameter :: large = 1.0_wp                            !! for a body of jelly [m]
  real(wp), parameter :: largest_strain = 1.0_wp                   !! predicted by hand [-]
  character(*), parameter :: advice = '; all numbers of a scene are in SI units (m, N, Pa, kg, s)'

contains

  !> Warn of stiffness and density that no solid has, of megapascals beside millimetres, and of
  !> loads, displacements and velocities that predict a strain above 1.
  subroutine warn_of_units(scene, edges, warnings)
    type(scene_type), intent(in) :: scene            !! checked
    real(wp), intent(in) :: edges(:)                 !! of the box around all bodies (dim) [m]
    type(warnings_type), intent(inout) :: warnings   !! added to
    real(wp) :: stiffness, speed
    integer :: i, c

    do i = 1, size(scene%materials)
      associate (m => scene%materials(i), name => 'material '//to_text(i))
        if (m%youngs_modulus < softest .or. m%youngs_modulus > stiffest) then
          call warn('units '//name, name//" has a Young's modulus of "// &
            & with_unit(m%youngs_modulus, 'Pa', 3)//', outside '//with_unit(softest, 'Pa', 3)// &
            & ' to '//with_unit(stiffest, 'Pa', 3))
        else if (m%youngs_modulus < jelly .and. maxval(edges) >= large) then
          call warn('units '//name, name//" has a Young's modulus of "// &
            & with_unit(m%youngs_modulus, 'Pa', 3)//' and the bodies are '// &
            & with_unit(maxval(edges), 'm', 3)//' long, as if they were in MPa and mm')
        end if
        ! relaxation needs no density and sets 1
        if (scene%time%method == 'relaxation') cycle
        if (m%density < lightest .or. m%density > heaviest) call warn('density '//name, name// &
          & ' has a density of '//to_text(m%density, 3)//' kg/m3, outside '// &
          & to_text(lightest, 3)//' to '//to_text(heaviest, 3)//' kg/m3')
      end associate
    end do
    stiffness = minval(scene%materials%youngs_modulus)
    do i = 1, size(scene%loads)
      associate (load => scene%loads(i))
        if (is_set(load%pressure)) call check_strain('load', i, 'pressure', &
          & abs(load%pressure)*greatest(load%values)/stiffness)
        do c = 1, scene%header%dimension
          if (is_set(load%force(c))) call check_strain('load', i, 'force', abs(load%force(c)) &
            & *greatest(load%values)/(cross_section(c)*stiffness))
          if (is_set(load%body_force(c))) call check_strain('load', i, 'body_force', &
            & abs(load%body_force(c))*greatest(load%values)*edges(c)/stiffness)
        end do
      end associate
    end do
    speed = sqrt(maxval(scene%materials%youngs_modulus/max(scene%materials%density, &
      & tiny(1.0_wp))))
    do i = 1, size(scene%boundaries)
      associate (boundary => scene%boundaries(i))
        do c = 1, scene%header%dimension
          if (is_set(boundary%displacement(c))) call check_strain('boundary', i, 'displacement', &
            & abs(boundary%displacement(c))*greatest(boundary%values)/maxval(edges))
          if (scene%time%method == 'relaxation') cycle
          if (is_set(boundary%velocity(c))) call check_strain('boundary', i, 'velocity', &
            & abs(boundary%velocity(c))*greatest(boundary%values)/speed)
        end do
      end associate
    end do

  contains

    !> A warning with the advice on units.
    subroutine warn(subject, text)
      character(*), intent(in) :: subject  !! what makes it the same as another
      character(*), intent(in) :: text     !! what was found
      call warnings%add(subject, text//advice, tell=.false.)
    end subroutine warn

    !> Warn if a load, displacement or velocity of a group predicts a strain above 1.
    subroutine check_strain(group, number, key, strain)
      character(*), intent(in) :: group, key  !! of the scene
      integer, intent(in) :: number           !! of the group
      real(wp), intent(in) :: strain          !! predicted by hand [-]
      if (strain <= largest_strain) return
      call warn('strain '//group//' '//to_text(number)//' '//key, '&'//group//' number '// &
        & to_text(number)//': its '//key//' predicts a strain of '//to_text(strain, 2))
    end subroutine check_strain

    !> Area across direction `c` of the box around all bodies [m2].
    real(wp) function cross_section(c) result(area)
      integer, intent(in) :: c
      select case (scene%header%dimension)
      case (3); area = product(edges)/edges(c)
      case (2); area = edges(3 - c)*scene%header%thickness
      case default; area = scene%header%area
      end select
    end function cross_section
  end subroutine warn_of_units

  !> The greatest factor, in size, of a time course; 1 without one.
  pure real(wp) function greatest(values)
    real(wp), allocatable, intent(in) :: values(:)
    greatest = 1.0_wp
    if (.not. allocated(values)) return
    if (size(values) > 0) greatest = maxval(abs(values))
  end function greatest

end module pd_scene_content_units
