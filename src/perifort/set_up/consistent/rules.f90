!> What a scene with consistent weights can have, and the weights of its bonds.
module pd_set_up_consistent_rules
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i8
  use pd_base_long_work, only: long_work_type
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type
  use pd_body_mesh_part, only: count_pieces, count_twins
  use pd_body_meshes, only: balance_surface
  use pd_body_side_areas, only: balance_sides, side_areas_type
  use pd_family_bond_weights, only: bond_weights_type
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  use pd_family_free_faces, only: find_sides, grids_touch
  use pd_family_outline, only: cloud_side, uneven
  use pd_force_model, only: bond_factors_of, follows, model_type
  use pd_law_material, only: material_type, several_stiffnesses
  use pd_motion_loads, only: load_type
  use pd_motion_system, only: system_type
  use pd_scene_content_rules, only: place_fault, scene_fault
  use pd_scene_content_types, only: has_cut_cells, is_set, scene_type
  use pd_set_up_consistent_weights, only: alone_text, consistent_weights, solution_type
  implicit none (type, external)
  private
  public :: check_consistent, prepare_surface, loaded_sides, weigh_bonds

  !> What a negative energy of the dilatation may take from the bonds of a point, over what these
  !> have [-]. Near 1 a point with broken bonds has hardly any stiffness against some displacement,
  !> and static equilibrium is not found.
  real(wp), parameter :: most_taken = 0.75_wp

contains

  !> An error is set if a scene with consistent weights has what they do not serve.
  subroutine check_consistent(scene, system, error)
    type(scene_type), intent(in) :: scene    !! a checked scene
    type(system_type), intent(in) :: system  !! with its body, family and model
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    if (scene%horizon%surface_correction /= 'consistent') return
    do i = 1, size(scene%bodies)
      if (scene%bodies(i)%mesh /= '') then
        if (size(scene%bodies) > 1) then
          call refuse('body', i, 'mesh', 'a mesh beside other bodies', &
            & 'the surface between bodies that touch is not known')
          return
        end if
        if (count_pieces(system%body%parts(1)) > 1 .or. &
          & count_twins(system%body%parts(1), minval(system%body%spacing, &
          & mask=system%body%point > 0)) > 0) then
          call refuse('body', i, 'mesh', 'a mesh in pieces, or with nodes that lie on others', &
            & 'points on both sides are bonded across a surface')
          return
        end if
      end if
      if (has_cut_cells(scene%bodies(i))) then
        call refuse('body', i, 'fill', 'cells that a surface cuts', &
          & "their surface areas are not those of whole cells; fill = 'centre' has whole cells")
        return
      end if
      if (scene%bodies(i)%file == '') cycle
      if (size(scene%bodies) > 1) then
        call refuse('body', i, 'file', 'a cloud beside other bodies', &
          & 'the surface between bodies that touch is not known')
        return
      end if
      associate (h => system%body%spacing, there => system%body%point > 0)
        if (maxval(h, mask=there) > uneven*minval(h, mask=there)) then
          call refuse('body', i, 'file', 'a cloud whose spacings differ by more than '// &
            & to_text(uneven), 'its outline is found with one spacing')
          return
        end if
      end associate
    end do
    do i = 1, size(system%model%laws)
      associate (law => system%model%laws(i)%law)
        if (law%corrected .and. .not. (system%model%generic .or. merge(system%model%influenced, &
          & system%model%weighted, allocated(system%model%horizon)))) cycle
      end associate
      call refuse('material', i, 'model', 'this bond law', &
        & "its weights are known for the chapter's laws with influence = 'inverse'")
      return
    end do
    if (size(system%body%parts) > 0 .and. several_stiffnesses(system%model%materials)) then
      call refuse('material', 2, '', 'materials of different stiffness in a mesh', &
        & 'the areas of the facets between them are not shared')
      return
    end if
    if (scene%header%precision == 'mixed') then
      call refuse('scene', 1, 'precision', "precision = 'mixed'", &
        & 'its conditions hold to rounding in double precision')
      return
    end if
    do i = 1, size(scene%boundaries)
      if (.not. scene%boundaries(i)%absorbing) cycle
      call refuse('boundary', i, 'absorbing', 'an absorbing boundary', &
        & 'its dashpots are tuned to uncorrected layers')
      return
    end do
    do i = 1, size(scene%loads)
      if (scene%loads(i)%side == '' .or. .not. any(is_set(scene%loads(i)%stiffness))) cycle
      call refuse('load', i, 'stiffness', 'springs at a side', &
        & 'tractions act on the second row, too, with the other sign')
      return
    end do

  contains

    subroutine refuse(group, number, key, what, why)
      character(*), intent(in) :: group, key, what, why
      integer, intent(in) :: number
      call scene_fault(error, scene, group, number, key, &
        & "surface_correction = 'consistent' does not serve "//what, why// &
        & "; give surface_correction = 'energy' or 'none'")
    end subroutine refuse

  end subroutine check_consistent

  !> Prepare the surface areas that loads and weights take: those of a mesh, and of lattices of
  !> several grids that touch, are balanced. An error is set if that cannot be.
  subroutine prepare_surface(scene, materials, family, body, error)
    type(scene_type), intent(in) :: scene            !! a checked scene
    type(material_type), intent(in) :: materials(:)  !! (any number) by the points' numbers
    class(family_type), intent(in) :: family         !! whole
    type(body_type), intent(inout) :: body           !! arranged in its slots
    type(error_type), allocatable, intent(out) :: error
    type(side_areas_type) :: sides
    integer :: alone
    logical :: found

    if (scene%horizon%surface_correction /= 'consistent') return
    if (size(body%parts) > 0) then
      call balance_surface(body, error)
      call place_fault(error, scene, 'body', 1, 'mesh')
      return
    end if
    if (scene%bodies(1)%file == '') then
      if (.not. grids_touch(body, family) .and. family%rule%ratio <= 0.0_wp) return
    end if
    if (several_stiffnesses(materials)) then
      call scene_fault(error, scene, 'material', 2, '', &
        & "surface_correction = 'consistent' does not serve materials of different stiffness "// &
        & 'in clouds, or on lattices of different spacings or offsets', 'the surface between '// &
        & "them is not known; give surface_correction = 'energy' or 'none'")
      return
    end if
    alone = 0
    found = .true.
    if (scene%bodies(1)%file == '') then
      call find_sides(body, family, sides, alone)
    else
      call cloud_side(body, sides, found)
    end if
    if (alone > 0) then
      call fail(error, alone_text(body, alone), group='horizon', number=1)
      call place_fault(error, scene, 'horizon', 1, 'surface_correction')
      return
    end if
    if (found) call balance_sides(body%x, body%volume, sides, found)
    if (.not. found) then
      call scene_fault(error, scene, 'horizon', 1, 'surface_correction', 'no surface areas of '// &
        & "these points have the moments that surface_correction = 'consistent' needs", &
        & "use more points across, or surface_correction = 'energy'")
      return
    end if
    body%sides = sides
  end subroutine prepare_surface

  !> The points (n_slots) on which loads on sides act: through their surface areas.
  pure function loaded_sides(scene, body, loads) result(loaded)
    type(scene_type), intent(in) :: scene     !! a checked scene
    type(body_type), intent(in) :: body       !! arranged in its slots
    type(load_type), intent(in) :: loads(:)   !! those of its `&load`, in their order
    logical, allocatable :: loaded(:)
    integer :: l

    allocate (loaded(body%n_slots), source=.false.)
    do l = 1, size(loads)
      if (scene%loads(l)%side /= '') loaded(loads(l)%slots) = .true.
    end do
  end function loaded_sides

  !> Give the model the weights of its bonds. An error is set if there are none, or if a body that
  !> breaks could gain energy.
  subroutine weigh_bonds(scene, system, materials, fixed, work, error)
    type(scene_type), intent(in) :: scene               !! with consistent weights
    type(system_type), intent(inout) :: system          !! with body, whole family and model
    type(material_type), intent(in) :: materials(:)     !! (any number) by the points' numbers
    logical, intent(in) :: fixed(:)                     !! of `loaded_sides`
    type(long_work_type), intent(inout) :: work         !! says how far this is
    type(error_type), allocatable, intent(out) :: error
    type(solution_type) :: stretch, dilatation
    type(bond_weights_type) :: weights
    integer :: slot
    logical :: cut, breaking

    cut = system%model%breaking .or. size(scene%cracks) > 0
    breaking = cut .and. system%model%dilatation
    ! contact between bodies that touch cuts the bonds between them
    cut = cut .or. size(scene%contacts) > 0
    if (allocated(system%model%horizon)) then
      call consistent_weights(system%body, system%family, materials, fixed, breaking, weights, &
        & stretch, dilatation, error, work, system%model)
    else
      call consistent_weights(system%body, system%family, materials, fixed, breaking, weights, &
        & stretch, dilatation, error, work)
    end if
    call place_fault(error, scene, 'horizon', 1, 'surface_correction')
    if (allocated(error)) return
    system%model%weights = weights
    system%model%consistent = .true.
    system%model%followers = cut .and. stretch%least < 0.0_wp
    if (.not. breaking) return
    slot = outweighed(system%body, system%family, system%model, materials)
    if (slot > 0) call scene_fault(error, scene, 'horizon', 1, 'surface_correction', &
      & "surface_correction = 'consistent' does not serve fracture here: with this Poisson's "// &
      & 'ratio the dilatation has a negative energy, and when some bonds of point '// &
      & to_text(int(system%body%point(slot)))//' are broken, that may be more than '// &
      & to_text(most_taken)//' of the energy of the others', &
      & "give surface_correction = 'energy' or 'none', or a Poisson's ratio nearer to that "// &
      & 'without dilatation: 1/4 in 3D and in plane strain, 1/3 in plane stress')
  end subroutine weigh_bonds

  !> A slot where a negative energy of the dilatation may take too much of that of the bonds, if
  !> some of them are broken; 0: none. By the inequality of Cauchy and Schwarz |a| theta^2 is at
  !> most 2 |a| t^2 sum(Gd^2 vc V/(q Gb |xi|)) times the energy of the bonds, whichever are broken.
  integer function outweighed(body, family, model, materials) result(slot)
    type(body_type), intent(in) :: body              !! arranged in the slots of the family
    class(family_type), intent(in) :: family         !! whole
    type(model_type), intent(in) :: model            !! with consistent weights
    type(material_type), intent(in) :: materials(:)  !! (any number) by the points' numbers
    type(bonds_type) :: bonds
    real(wp) :: total, gb, gd
    integer(i8) :: at
    integer :: k, i

    call allocate_bonds(family, bonds)
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      slot = k
      associate (m => materials(body%material(k)))
        if (m%a >= 0.0_wp) cycle
        call family%bonds_of(k, bonds)
        at = model%weights%before(k)
        total = 0.0_wp
        do i = 1, bonds%n
          if (follows(model, k, i)) cycle
          if (.not. model%weights%Gb(at + i) > 0.0_wp) return
          gb = 1.0_wp
          gd = 1.0_wp
          if (allocated(model%horizon)) &
            & call bond_factors_of(model, k, int(bonds%j(i)), bonds%length(i), gb, gd)
          gb = gb*model%weights%Gb(at + i)
          gd = gd*model%weights%Gd(at + i)
          total = total + gd**2*bonds%weight(i)/(gb*m%q*bonds%length(i))
        end do
        if (-2*m%a*m%t**2*total > most_taken) return
      end associate
    end do
    slot = 0
  end function outweighed

end module pd_set_up_consistent_rules
