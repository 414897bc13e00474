!> Critical stretches by which a crack grows through the lattice at the given energy release rate:
!> `&material critical = 'lattice'`.
module pd_set_up_toughness_toughness
  use pd_base_clock, only: duration_text, wall_time
  use pd_base_kinds, only: wp
  use pd_base_long_work, only: long_work_type
  use pd_base_text, only: to_text
  use pd_base_warnings, only: warnings_type
  use pd_body_body, only: body_type
  use pd_family_volume, only: volume_rule_type, volume_rule_number
  use pd_law_law, only: bond_law_type
  use pd_law_laws, only: law_item_type
  use pd_law_material, only: material_type
  use pd_law_weighted, only: weighted_law_type
  use pd_scene_content_types, only: has_grid, has_own_horizons, scene_type
  use pd_set_up_toughness_grow, only: grow_crack, subject_type, toughness_type
  use pd_set_up_toughness_table, only: look_up
  implicit none (type, external)
  private
  public :: set_critical_by_lattice

  real(wp), parameter :: same_spacing = 1.0e-6_wp  !! how far spacings of one lattice may differ
  !> Horizons of more spacings take too long: the work grows with the square of the family and with
  !> the horizon.
  real(wp), parameter :: longest(2:3) = [6.5_wp, 4.5_wp]

contains

  !> Give the materials of a scene that ask for it a critical stretch by the lattice. Where that
  !> cannot be had the formula's stays, and a note tells why.
  subroutine set_critical_by_lattice(scene, body, delta, materials, laws, notes, work)
    type(scene_type), intent(in) :: scene                !! a checked scene
    type(body_type), intent(in) :: body                  !! knows the spacings of its points
    real(wp), intent(in) :: delta                        !! horizon [m]
    type(material_type), intent(inout) :: materials(:)   !! (materials) with s_c of the formula
    type(law_item_type), intent(inout) :: laws(:)        !! (materials) that have these materials
    type(warnings_type), intent(inout) :: notes          !! gets a note for each that keeps it, and
                                                         !! for each that is not tabulated
    type(long_work_type), intent(inout) :: work          !! says how far a solve is
    type(subject_type) :: subject
    character(:), allocatable :: reason, name
    integer :: i

    do i = 1, size(materials)
      if (scene%materials(i)%critical /= 'lattice') cycle
      name = 'material '//to_text(i)
      call subject_of(scene, body, delta, subject, reason)
      if (reason == '') call solve(laws(i)%law, subject, materials(i), notes, name, &
        & work, reason)
      if (reason /= '') call notes%add('critical '//name, name//": critical = 'chapter', since "// &
        & reason, tell=.false.)
      laws(i)%law%material = materials(i)
    end do
  end subroutine set_critical_by_lattice

  !> The lattice of a scene, or the reason why there is none.
  subroutine subject_of(scene, body, delta, subject, reason)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: delta
    type(subject_type), intent(out) :: subject
    character(:), allocatable, intent(out) :: reason  !! empty if there is one
    real(wp) :: spacing

    reason = ''
    if (scene%header%dimension == 1) then
      reason = 'a bar has no crack that grows'
    else if (.not. all(has_grid(scene%bodies))) then
      reason = 'some points are a cloud'
    else
      spacing = body%largest_spacing
      subject%dim = scene%header%dimension
      subject%plane_strain = subject%dim == 2 .and. scene%header%plane == 'strain'
      subject%rule = volume_rule_type(volume_rule_number(trim(scene%horizon%volume_correction)), &
        & delta/spacing)
      subject%corrected = scene%horizon%surface_correction /= 'none'
      ! lattices with horizons of their own are all alike in spacings
      if (.not. has_own_horizons(scene) .and. &
        & spacing - body%least_spacing > same_spacing*spacing) then
        reason = 'spacings differ'
      else if (subject%rule%delta > longest(subject%dim)) then
        reason = 'the lattice is solved for horizons of at most '// &
          & to_text(longest(subject%dim))//' spacings'
      end if
    end if
  end subroutine subject_of

  !> The critical stretch of a material by its lattice, from the table or a solve.
  subroutine solve(law, subject, material, notes, name, work, reason)
    class(bond_law_type), intent(in) :: law
    type(subject_type), intent(in) :: subject
    type(material_type), intent(inout) :: material  !! with s_c of the formula; gets the lattice's
    type(warnings_type), intent(inout) :: notes
    character(*), intent(in) :: name                !! of the material, for notes
    type(long_work_type), intent(inout) :: work
    character(:), allocatable, intent(out) :: reason  !! why there is none; else empty
    type(weighted_law_type) :: plain
    type(toughness_type) :: straight, diagonal
    real(wp) :: begin
    logical :: found

    reason = ''
    select type (law)
    class is (weighted_law_type)
      if (.not. (same_type_as(law, plain) .and. law%weighted)) then
        reason = "the lattice is not solved for model = '"//trim(law%name)//"'"
        return
      end if
      call look_up(law, subject, material%toughness, material%mean_toughness, &
        & material%diagonal_toughness, found)
      if (.not. found) then
        begin = wall_time()
        call work%turn_to('toughness of the lattice, straight')
        call grow_crack(law, subject, .false., straight, work=work)
        if (.not. straight%known) then
          reason = 'no crack grows straight through the lattice'
          return
        end if
        call work%turn_to('toughness of the lattice, diagonal')
        call grow_crack(law, subject, .true., diagonal, work=work)
        material%toughness = straight%largest
        material%mean_toughness = straight%mean
        material%diagonal_toughness = merge(diagonal%largest, 0.0_wp, diagonal%known)
        call notes%add('solved '//name, name//': the toughness of this lattice is not in the '// &
          & 'table; its solve took '//duration_text(wall_time() - begin), tell=.false.)
      end if
      material%critical_stretch = material%critical_stretch/sqrt(material%toughness)
    class default  ! a law with a force of its own
      reason = "the lattice is not solved for model = '"//trim(law%name)//"'"
    end select
  end subroutine solve

end module pd_set_up_toughness_toughness
