!> Rules for materials: their bond law with its parameters, their moduli and strength.
module pd_scene_content_check_materials
  use pd_base_elasticity, only: bond_based_ratio
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type
  use pd_base_text, only: join, nearest_name, to_text
  use pd_law_law, only: required
  use pd_law_laws, only: law_item_type, law_table_type
  use pd_scene_content_rules, only: rule_fault, given
  use pd_scene_format_source, only: source_type
  use pd_scene_content_types, only: scene_type, material_group, is_set, laws_of, name_length
  implicit none (type, external)
  private
  public :: check_material

  real(wp), parameter :: ratio_tolerance = 1.0e-3_wp    !! 0.333 is meant to be 1/3

contains

  !> One `&material`; fills in the default Poisson's ratio and density. An error is set if a rule is
  !> broken.
  subroutine check_material(scene, number, error, source)
    type(scene_type), intent(inout) :: scene           !! gets the material's defaults
    integer, intent(in) :: number                      !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places

    type(law_item_type) :: item

    call find_law(scene, number, item, error, source)
    if (allocated(error)) return
    associate (material => scene%materials(number))
      if (.not. is_set(material%youngs_modulus)) then
        call rule_fault(error, 'material', number, '', &
          & "group &material lacks the key 'youngs_modulus'", "Young's modulus E [Pa]", source)
      else if (is_set(material%critical_stretch) .and. &
        & is_set(material%critical_energy_release_rate)) then
        call rule_fault(error, 'material', number, 'critical_energy_release_rate', &
          & "'critical_stretch' and 'critical_energy_release_rate' are both given", &
          & 'give one of them; each follows from the other', source)
      else if (material%critical /= '' .and. .not. &
        & is_set(material%critical_energy_release_rate)) then
        call rule_fault(error, 'material', number, 'critical', &
          & "'critical' without 'critical_energy_release_rate'", "it says how the critical "// &
          & "stretch follows from that; a given 'critical_stretch' holds as it is", source)
      else if (is_set(material%scatter) .and. .not. (is_set(material%critical_stretch) .or. &
        & is_set(material%critical_energy_release_rate))) then
        call rule_fault(error, 'material', number, 'scatter', &
          & "'scatter' without a strength that could scatter", &
          & "give 'critical_stretch' or 'critical_energy_release_rate', too", source)
      else if (is_set(material%scatter) .and. item%law%softens) then
        call rule_fault(error, 'material', number, 'scatter', "model = '"// &
          & trim(material%model)//"' has no 'scatter'", &
          & 'its bonds lose their strength little by little', source)
      else if (.not. is_set(material%density) .and. any(is_set(scene%header%gravity))) then
        call rule_fault(error, 'material', number, 'density', &
          & "group &material lacks the key 'density'", &
          & 'gravity needs the mass density [kg/m3]', source)
      else if (.not. is_set(material%density) .and. scene%time%method == 'explicit') then
        call rule_fault(error, 'material', number, '', &
          & "group &material lacks the key 'density'", &
          & 'explicit steps in time need the mass density [kg/m3]', source)
      else
        call check_ratio(material, item%law%bond_based, scene%header%dimension, &
          & scene%header%plane, number, error, source)
      end if
      ! Relaxation has its own mass; 1 keeps quantities derived from the density finite.
      if (.not. is_set(material%density)) material%density = 1.0_wp
    end associate
  end subroutine check_material

  !> The law of a material, whose influence function and parameters get their defaults. An error is
  !> set if there is no such law, if it lacks a parameter, or if it does not have one that is given.
  subroutine find_law(scene, number, item, error, source)
    type(scene_type), intent(inout) :: scene
    integer, intent(in) :: number
    type(law_item_type), intent(out) :: item
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    type(law_table_type) :: laws
    character(:), allocatable :: note, nearest
    integer :: i, j

    laws = laws_of(scene)
    associate (material => scene%materials(number))
      i = laws%number_of(material%model)
      if (i == 0) then
        note = 'allowed: '//join(laws%names(), ', ')
        nearest = nearest_name(trim(material%model), laws%names())
        if (len(nearest) > 0) note = "did you mean '"//nearest//"'?  "//note
        call rule_fault(error, 'material', number, 'model', "unknown value '"// &
          & trim(material%model)//"' of key 'model' in group &material", note, source)
        return
      end if
      allocate (item%law, source=laws%items(i)%law)
      if (material%influence == '') material%influence = item%law%influence
      if (.not. allocated(material%parameters)) return
      do i = 1, size(material%parameters)
        associate (given => material%parameters(i))
          j = 0
          if (allocated(item%law%parameters)) j = findloc(item%law%parameters%name, given%name, &
            & dim=1)
          if (j == 0 .and. is_set(given%value)) then
            call rule_fault(error, 'material', number, trim(given%name), "'"//trim(given%name)// &
              & "' is no key of model = '"//trim(material%model)//"'", 'it belongs to '// &
              & owners(laws, given%name), source)
            return
          else if (j > 0 .and. .not. is_set(given%value)) then
            given%value = item%law%parameters(j)%default
            if (given%value <= required) then
              call rule_fault(error, 'material', number, '', "group &material lacks the key '"// &
                & trim(given%name)//"'", "model = '"//trim(material%model)//"' needs it: "// &
                & trim(given%meaning)//' ['//trim(given%unit)//']', source)
              return
            end if
          end if
        end associate
      end do
    end associate
  end subroutine find_law

  !> The laws that have a parameter: `model = 'a', 'b'`.
  pure function owners(laws, name) result(text)
    type(law_table_type), intent(in) :: laws
    character(*), intent(in) :: name
    character(:), allocatable :: text
    integer :: i

    text = ''
    do i = 1, size(laws%items)
      if (.not. allocated(laws%items(i)%law%parameters)) cycle
      if (.not. any(laws%items(i)%law%parameters%name == name)) cycle
      if (len(text) > 0) text = text//', '
      text = text//"'"//trim(laws%items(i)%law%name)//"'"
    end do
    text = 'model = '//text
  end function owners

  !> Poisson's ratio: in its range, and that of a bond-based law.
  subroutine check_ratio(material, bond_based, dimension, plane, number, error, source)
    type(material_group), intent(inout) :: material
    logical, intent(in) :: bond_based
    integer, intent(in) :: dimension
    character(*), intent(in) :: plane
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    real(wp) :: needed
    character(:), allocatable :: kind

    needed = bond_based_ratio(dimension, plane == 'strain')
    if (dimension == 1) then
      if (.not. is_set(material%poissons_ratio)) material%poissons_ratio = 0.0_wp
      return
    end if
    kind = 'in 3D'
    if (dimension == 2) kind = 'in plane '//trim(plane)
    if (bond_based) then
      if (is_set(material%poissons_ratio) .and. .not. material%ignore_poissons_ratio .and. &
        & abs(material%poissons_ratio - needed) > ratio_tolerance) then
        call rule_fault(error, 'material', number, 'poissons_ratio', 'the bond-based model '// &
          & "cannot have Poisson's ratio "//to_text(material%poissons_ratio), kind//' it has '// &
          & trim(merge('1/3', '1/4', needed > 0.3_wp))//"; use model = 'state_based', or "// &
          & 'ignore_poissons_ratio = .true.', source)
        return
      end if
      ! The resolved scene shows the value used in the computation.
      material%poissons_ratio = needed
    else if (.not. is_set(material%poissons_ratio)) then
      call rule_fault(error, 'material', number, '', &
        & "group &material lacks the key 'poissons_ratio'", &
        & "model = '"//trim(material%model)//"' needs it "//kind, source)
    else if (material%poissons_ratio >= 0.5_wp .and. .not. (dimension == 2 .and. &
      & plane == 'stress')) then
      call rule_fault(error, 'material', number, 'poissons_ratio', &
        & "'poissons_ratio' is out of range", 'expected > -1 and < 0.5 '//kind, source)
    end if
  end subroutine check_ratio

end module pd_scene_content_check_materials
