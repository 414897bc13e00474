!> The materials of a scene, with the constants that follow from dimension and horizon.
module pd_set_up_materials
  use pd_base_kinds, only: wp
  use pd_law_material, only: material_type, new_material, critical_stretch_from_energy
  use pd_scene_content_types, only: scene_type, is_set
  implicit none (type, external)
  private
  public :: materials_of_scene

contains

  !> The materials with the horizon's parameters. In plane strain alpha becomes (1 + nu) alpha.
  pure function materials_of_scene(scene, delta) result(materials)
    type(scene_type), intent(in) :: scene  !! a checked scene
    real(wp), intent(in) :: delta          !! horizon [m]
    type(material_type), allocatable :: materials(:)
    logical :: plane_strain
    integer :: i

    plane_strain = scene%header%dimension == 2 .and. scene%header%plane == 'strain'
    allocate (materials(size(scene%materials)))
    do i = 1, size(materials)
      associate (group => scene%materials(i), m => materials(i))
        m = new_material(group%youngs_modulus, group%poissons_ratio, group%density, &
          & scene%header%dimension, plane_strain, scene%header%thickness, scene%header%area, &
          & delta, group%model == 'bond_based')
        if (is_set(group%critical_stretch)) m%critical_stretch = group%critical_stretch
        if (is_set(group%critical_energy_release_rate)) m%critical_stretch = &
          & critical_stretch_from_energy(m, group%critical_energy_release_rate, &
          & scene%header%dimension, delta)
        m%break_in_compression = group%break_in_compression
        m%expansion = group%thermal_expansion
        if (plane_strain) m%expansion = (1 + m%poissons_ratio)*m%expansion
      end associate
    end do
  end function materials_of_scene

end module pd_set_up_materials
