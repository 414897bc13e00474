!> Horizons that points have of their own: when a scene has them, and what cannot be had with them.
module pd_set_up_horizons
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp
  use pd_body_body, only: body_type
  use pd_family_volume, only: volume_rule_type, volume_rule_number
  use pd_law_weighted, only: weighted_law_type
  use pd_motion_system, only: system_type
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: has_own_horizons, has_refinement, scene_type
  implicit none (type, external)
  private
  public :: rule_of_scene, check_horizons

  !> Spacings that differ less are one, and so are their horizons: families of one grid stay what
  !> they are.
  real(wp), parameter :: same = 1.0e-9_wp

contains

  !> The volume correction and the horizon of a scene, or the ratio that gives each point its own.
  function rule_of_scene(scene, body, delta) result(rule)
    type(scene_type), intent(in) :: scene  !! a checked scene
    type(body_type), intent(in) :: body    !! knows the spacings of all points
    real(wp), intent(in) :: delta          !! horizon, the largest where points have their own [m]
    type(volume_rule_type) :: rule

    rule%kind = volume_rule_number(trim(scene%horizon%volume_correction))
    rule%delta = delta
    if (.not. has_own_horizons(scene)) return
    if (body%largest_spacing - body%least_spacing > same*body%largest_spacing) &
      & rule%ratio = scene%horizon%ratio
  end function rule_of_scene

  !> An error is set if a scene whose points have horizons of their own has what these do not serve.
  subroutine check_horizons(scene, system, error)
    type(scene_type), intent(in) :: scene    !! a checked scene
    type(system_type), intent(in) :: system  !! with its body, family and model
    type(error_type), allocatable, intent(out) :: error
    type(weighted_law_type) :: chapter
    integer :: i

    do i = 1, size(system%model%laws)
      associate (law => system%model%laws(i)%law)
        if (same_type_as(law, chapter) .and. .not. system%model%generic) cycle
      end associate
      call refuse('material', i, 'model', "model = '"//trim(scene%materials(i)%model)//"'", &
        & "only the constants of 'state_based' and 'bond_based', with one of them and one "// &
        & 'influence function in all materials, are known for the horizon of a bond')
      return
    end do
    if (scene%horizon%surface_correction == 'consistent' .and. size(system%body%parts) > 0) then
      call refuse('horizon', 1, 'surface_correction', "surface_correction = 'consistent' of a "// &
        & 'mesh', "the weights of its bonds are known for one horizon; give 'energy' or 'none'")
    else if (scene%time%method == 'relaxation' .and. &
      & scene%relaxation%density_matrix /= 'frame_invariant') then
      call refuse('relaxation', 1, 'density_matrix', "density_matrix = '"// &
        & trim(scene%relaxation%density_matrix)//"'", "it has one horizon: use 'frame_invariant'")
    end if

  contains

    subroutine refuse(group, number, key, what, why)
      character(*), intent(in) :: group, key, what, why
      integer, intent(in) :: number
      character(:), allocatable :: cause, instead

      instead = ''
      if (scene%horizon%local) then
        cause = '&horizon local does'
      else if (has_refinement(scene)) then
        cause = '&refine does'
      else
        cause = 'lattices of different spacings have horizons of their own, which do'
        instead = '; &horizon length gives all points one horizon'
      end if
      call scene_fault(error, scene, group, number, key, cause//' not serve '//what, why//instead)
    end subroutine refuse

  end subroutine check_horizons

end module pd_set_up_horizons
