!> The materials of a scene and their bond laws, with the constants that follow from dimension and
!> horizon.
module pd_set_up_materials
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text
  use pd_law_laws, only: law_item_type, law_table_type
  use pd_law_material, only: material_type, new_material
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: laws_of, scene_type, is_set
  implicit none (type, external)
  private
  public :: materials_of_scene

contains

  !> The materials with the horizon's parameters, and their laws. In plane strain alpha becomes
  !> (1 + nu) alpha. An error is set if a law cannot be had in this scene.
  subroutine materials_of_scene(scene, delta, materials, laws, error)
    type(scene_type), intent(in) :: scene  !! a checked scene
    real(wp), intent(in) :: delta          !! horizon [m]
    type(material_type), allocatable, intent(out) :: materials(:)  !! in the order of the groups
    type(law_item_type), allocatable, intent(out) :: laws(:)       !! (materials) set up
    type(error_type), allocatable, intent(out) :: error
    type(law_table_type) :: table
    character(:), allocatable :: reason
    real(wp) :: depth
    logical :: plane_strain
    integer :: i, p, q

    table = laws_of(scene)
    plane_strain = scene%header%dimension == 2 .and. scene%header%plane == 'strain'
    depth = merge(scene%header%area, scene%header%thickness, scene%header%dimension == 1)
    allocate (materials(size(scene%materials)), laws(size(scene%materials)))
    do i = 1, size(materials)
      ! gfortran 12 does not evaluate a function in a source
      p = table%number_of(scene%materials(i)%model)
      allocate (laws(i)%law, source=table%items(p)%law)
      associate (group => scene%materials(i), law => laws(i)%law)
        if (group%influence /= '') law%influence = group%influence
        if (allocated(group%parameters) .and. allocated(law%parameters)) then
          do p = 1, size(law%parameters)
            q = findloc(group%parameters%name, law%parameters(p)%name, dim=1)
            if (q > 0) law%parameters(p)%value = group%parameters(q)%value
          end do
        end if
        call law%set_up(new_material(group%youngs_modulus, group%poissons_ratio, group%density, &
          & scene%header%dimension, plane_strain, scene%header%thickness, scene%header%area, &
          & delta, law%bond_based), scene%header%dimension, plane_strain, delta, depth)
        associate (m => law%material)
          if (is_set(group%critical_stretch)) m%critical_stretch = group%critical_stretch
          if (is_set(group%critical_energy_release_rate)) m%critical_stretch = &
            & law%critical_stretch(group%critical_energy_release_rate)
          m%from_toughness = is_set(group%critical_energy_release_rate)
          if (m%critical_stretch < 0.0_wp) then
            call scene_fault(error, scene, 'material', i, 'critical_energy_release_rate', &
              & "model = '"//trim(group%model)//"' has no critical stretch for an energy "// &
              & 'release rate', "give 'critical_stretch'")
            return
          end if
          m%break_in_compression = group%break_in_compression
          if (is_set(group%scatter)) m%scatter = group%scatter
          m%seed = group%seed
          m%expansion = group%thermal_expansion
          if (plane_strain) m%expansion = (1 + m%poissons_ratio)*m%expansion
        end associate
        reason = law%refusal()
        if (len(reason) > 0) then
          call scene_fault(error, scene, 'material', i, 'model', &
            & "the scene cannot have model = '"//trim(group%model)//"'", reason)
          return
        end if
        materials(i) = law%material
      end associate
    end do
  end subroutine materials_of_scene

end module pd_set_up_materials
