!> Families of a scene: a lattice where the points allow it, lattices joined by a list where few
!> points need that, a list otherwise.
module pd_set_up_families
  use pd_base_error, only: error_type, internal_fault
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type
  use pd_body_lattices, only: axes_of
  use pd_body_survey, only: survey_type
  use pd_family_composite, only: composite_family_type, composite_suits, new_composite_family
  use pd_family_lattice, only: cells_between, lattice_family_type, lattice_suits, &
    & new_lattice_family
  use pd_family_list, only: list_family_type, new_list_family
  use pd_family_volume, only: volume_rule_type
  use pd_force_composite, only: prepare_composite
  use pd_force_list, only: prepare_list
  use pd_force_weights, only: build_weights
  use pd_law_laws, only: law_item_type
  use pd_motion_system, only: system_type
  use pd_scene_content_rules, only: place_fault, scene_fault
  use pd_scene_content_types, only: is_turned, scene_type
  use pd_set_up_memory, only: any_critical
  implicit none (type, external)
  private
  public :: family_choice_type, choose_family, make_family, finish_family, axes_of_factors

  !> The kind of families that the points of a scene get.
  type :: family_choice_type
    character(:), allocatable :: kind      !! 'lattice', 'composite' or 'list'
    character(:), allocatable :: reason    !! why no lattice has all bonds
    logical :: regular = .false.           !! a lattice has
    logical, allocatable :: listed(:)      !! (n_points) points with bonds in a composite's list
  end type family_choice_type

contains

  !> The kind of families that suits the points: lattices, lattices joined by a list, or a list of
  !> all. An error is set if the scene asks for a lattice, or for mixed precision, that its points
  !> cannot have.
  subroutine choose_family(scene, rule, body, laws, divided, choice, error, survey)
    type(scene_type), intent(in) :: scene       !! a checked scene
    type(volume_rule_type), intent(in) :: rule  !! volume correction and horizon
    type(body_type), intent(in) :: body         !! in point order, with all points, or those of a
                                                !! rank
    type(law_item_type), intent(in) :: laws(:)  !! (materials) their bond laws
    logical, intent(in) :: divided              !! several ranks have, or will have, parts of it, or
                                                !! may have with the same results
    type(family_choice_type), intent(out) :: choice
    type(error_type), allocatable, intent(out) :: error
    type(survey_type), intent(in), optional :: survey  !! of all points, where a rank has its own
    integer :: cells(3, size(body%grids)), c, g

    choice%kind = 'list'
    if (scene%horizon%family == 'list') then
      choice%reason = 'asked for'
    else
      if (present(survey)) then
        do g = 1, size(body%grids)
          cells(:, g) = 1
          do c = 1, body%dim
            cells(c, g) = cells_between(survey%lowest(c, g), survey%highest(c, g), &
              & body%grids(g)%spacing)
          end do
        end do
        call lattice_suits(body, rule, choice%regular, choice%reason, choice%listed, cells)
      else
        call lattice_suits(body, rule, choice%regular, choice%reason, choice%listed)
      end if
      if (choice%regular) choice%kind = 'lattice'
    end if
    if (scene%horizon%family == 'lattice' .and. .not. choice%regular) then
      call scene_fault(error, scene, 'horizon', 1, 'family', &
        & 'the scene cannot have the lattice families that &horizon family requests', &
        & choice%reason)
      return
    end if
    if (scene%header%precision == 'mixed' .and. .not. choice%regular) call scene_fault(error, &
      & scene, 'scene', 1, 'precision', "precision = 'mixed' needs lattice families, but the "// &
      & 'scene gets lists', choice%reason)
    if (allocated(error) .or. choice%regular .or. scene%horizon%family == 'list') return
    call choose_composite(scene, rule, body, laws, divided, choice)
  end subroutine choose_family

  !> Take a composite family instead of a list, if the points and what the scene has allow it.
  subroutine choose_composite(scene, rule, body, laws, divided, choice)
    type(scene_type), intent(in) :: scene
    type(volume_rule_type), intent(in) :: rule
    type(body_type), intent(in) :: body
    type(law_item_type), intent(in) :: laws(:)
    logical, intent(in) :: divided
    type(family_choice_type), intent(inout) :: choice
    character(:), allocatable :: reason
    logical :: suits
    integer :: i

    if (all(body%grid == 0)) return
    reason = ''
    if (divided) reason = 'on several ranks and with --reproducible'
    if (scene%horizon%surface_correction == 'consistent') &
      & reason = "surface_correction = 'consistent'"
    do i = 1, size(laws)
      if (.not. laws(i)%law%weighted) reason = 'bond laws on the generic pass'
    end do
    if (reason == '') then
      call composite_suits(body, rule, choice%listed, suits, reason)
      if (suits) choice%kind = 'composite'
    end if
    if (reason /= '') choice%reason = choice%reason//'; no composite family: '//reason
  end subroutine choose_composite

  !> Families of the kind that was chosen; the body is arranged in their slots. An error is set if
  !> the lattice cannot be made.
  subroutine make_family(scene, rule, choice, system, error)
    type(scene_type), intent(in) :: scene       !! a checked scene
    type(volume_rule_type), intent(in) :: rule  !! volume correction and horizon
    type(family_choice_type), intent(in) :: choice
    type(system_type), intent(inout) :: system
      !! with its body in point order; gets its family, its body in the slots of that
    type(error_type), allocatable, intent(out) :: error
    type(lattice_family_type), allocatable :: lattice
    type(composite_family_type), allocatable :: composite
    type(list_family_type), allocatable :: list
    logical :: breakable

    breakable = size(scene%cracks) + size(scene%contacts) > 0 .or. any_critical(scene)
    select case (choice%kind)
    case ('lattice')
      allocate (lattice)
      call new_lattice_family(system%body, rule, breakable, scene%header%precision == 'mixed', &
        & lattice, error)
      if (.not. allocated(error)) call move_alloc(lattice, system%family)
    case ('composite')
      allocate (composite)
      call new_composite_family(system%body, rule, choice%listed, breakable, composite, error)
      if (.not. allocated(error)) call move_alloc(composite, system%family)
    case ('list')
      allocate (list)
      call new_list_family(system%body, rule, list)
      list%reason = choice%reason
      call move_alloc(list, system%family)
    case default
      call internal_fault('make_family does not know a kind of family')
    end select
    call place_fault(error, scene, 'body', 1, 'points')
  end subroutine make_family

  !> The directions of surface factors where bodies are turned: their axes. An error if these differ
  !> between bodies, or on lists, whose loops have factors along x, y and z.
  subroutine axes_of_factors(scene, system, error)
    type(scene_type), intent(in) :: scene         !! a checked scene
    type(system_type), intent(inout) :: system    !! with its family; its model gets the axes
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: same_axes = 1.0e-9_wp
    character(:), allocatable :: reason
    real(wp) :: axes(3, 3)
    integer :: b, turned

    turned = findloc(is_turned(scene%bodies), .true., dim=1)
    if (turned == 0) return
    reason = ''
    axes = axes_of(scene%bodies(turned), system%body%dim)
    do b = 1, size(scene%bodies)
      if (any(abs(axes_of(scene%bodies(b), system%body%dim) - axes) > same_axes)) &
        & reason = 'the axes of bodies 1 and '//to_text(b)//' differ'
    end do
    select type (family => system%family)
    type is (lattice_family_type)
      continue
    class default  ! lists: their loops take the factors along x, y and z
      reason = 'the scene gets lists, which take it along x, y and z'
    end select
    if (reason == '') then
      system%model%axes = axes(:system%body%dim, :system%body%dim)
    else
      call scene_fault(error, scene, 'body', turned, 'axis_1', &
        & "surface_correction = 'energy' is "// &
        & "taken along the rows of a turned body, but "//reason, "surface_correction = 'none' "// &
        & 'needs no axes')
    end if
  end subroutine axes_of_factors

  !> What the force loops keep of the model: the weights of the bonds.
  subroutine finish_family(system)
    type(system_type), intent(inout) :: system  !! with its model; its workspace is made

    if (system%model%generic) return  ! its pass needs no weights
    select type (family => system%family)
    type is (lattice_family_type)
      call build_weights(family, system%model, system%workspace%lattice)
    type is (list_family_type)
      call prepare_list(family, system%model, system%workspace%list)
    type is (composite_family_type)
      call prepare_composite(family, system%model, system%workspace)
    class default
      call internal_fault('finish_family does not know a kind of family')
    end select
  end subroutine finish_family

end module pd_set_up_families
