!> Numbers of a scene that look as if they were not in SI units. A scene in millimetres, newtons and
!> megapascals is computed without an error, and its results are wrong by powers of ten.
module pd_scene_content_units
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text, with_unit
  use pd_base_warnings, only: warnings_type
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: warn_of_units, units_advice

  real(wp), parameter :: softest = 1.0e3_wp, stiffest = 1.0e13_wp  !! Young's moduli [Pa]
  real(wp), parameter :: lightest = 10.0_wp, heaviest = 3.0e4_wp   !! densities [kg/m3]
  real(wp), parameter :: jelly = 1.0e6_wp                          !! softer than rubber [Pa]
  real(wp), parameter :: large = 1.0_wp                            !! for a body of jelly [m]
  !> What a warning of such numbers ends with.
  character(*), parameter :: units_advice = &
    & '; all numbers of a scene are in SI units (m, N, Pa, kg, s)'

contains

  !> Warn of stiffness and density that no solid has, and of megapascals beside millimetres.
  subroutine warn_of_units(scene, edges, warnings)
    type(scene_type), intent(in) :: scene            !! checked
    real(wp), intent(in) :: edges(:)                 !! of the box around all bodies (dim) [m]
    type(warnings_type), intent(inout) :: warnings   !! added to
    integer :: i

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

  contains

    !> A warning with the advice on units.
    subroutine warn(subject, text)
      character(*), intent(in) :: subject  !! what makes it the same as another
      character(*), intent(in) :: text     !! what was found
      call warnings%add(subject, text//units_advice, tell=.false.)
    end subroutine warn
  end subroutine warn_of_units

end module pd_scene_content_units
