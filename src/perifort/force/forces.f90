!> The internal forces and energies of a whole body, whatever its family: the class is selected
!> once per pass.
module pd_force_forces
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i1, i8
  use pd_body_body, only: body_type, finish_halo, share_halo, start_halo
  use pd_family_composite, only: composite_family_type
  use pd_family_family, only: family_type
  use pd_family_list, only: list_family_type
  use pd_family_lattice, only: lattice_family_type
  use pd_force_composite, only: composite_dilatation, composite_energy, composite_force
  use pd_force_generic_pass, only: generic_energy, generic_force, generic_pulls
  use pd_force_lattice, only: lattice_dilatation, lattice_force, lattice_energy
  use pd_force_list, only: list_dilatation, list_force, list_energy
  use pd_force_model, only: force_options_type, model_type
  use pd_force_workspace, only: all_blocks, early_blocks, late_blocks, workspace_type
  implicit none (type, external)
  private
  public :: internal_force, arriving_force, energy_pass
  public :: whole, up_to_marks, after_marks

  !> Parts of an evaluation. The first pass over the bonds marks what is strained to the limit; who
  !> breaks bonds does so between the parts, and then renews what the first pass gave the points
  !> that lost some: their dilatation or, where the forces have none, their force; on the generic
  !> pass the pulls.
  integer, parameter :: whole = 0, up_to_marks = 1, after_marks = 2

contains

  !> Internal force density of all slots at displacements `u`: the dilatation of all points first,
  !> if the forces have one, then the forces. Whoever needs internal forces calls this. Values at
  !> points that other processes own come from there: dilatation and forces here, displacements from
  !> whoever calls.
  subroutine internal_force(body, family, model, options, workspace, u, p, force, strained, part, &
    & of_copies)
    type(body_type), intent(in) :: body                 !! what the process owns of it
    class(family_type), intent(in) :: family            !! the bonds of each point
    type(model_type), intent(in) :: model               !! parameters of the slots
    type(force_options_type), intent(in) :: options     !! what the forces take in
    type(workspace_type), intent(inout) :: workspace    !! of this family and model
    real(wp), intent(in), contiguous :: u(:, :)         !! displacements (n_slots, dim) [m]
    real(wp), intent(inout), contiguous :: p(:)         !! 2 a d delta theta (n_slots), of size 0
                                                        !! if there is no dilatation
    real(wp), intent(inout), contiguous :: force(:, :)  !! force density (n_slots, dim) [N/m3]
    integer(i1), intent(inout), contiguous :: strained(:)  !! becomes 1 for slots with a bond
                                                        !! (nearly) beyond its limit, else 0
                                                        !! (n_slots), of size 0 if none can break
    integer, intent(in), optional :: part               !! `whole` by default
    logical, intent(in), optional :: of_copies
      !! the forces of copies of other processes' points are asked for; they are by default
    logical :: asked
    integer :: now

    asked = .true.
    if (present(of_copies)) asked = of_copies

    now = whole
    if (present(part)) now = part
    if (model%generic) then
      if (now /= after_marks) &
        & call generic_pulls(family, model, options, workspace%generic, u, strained)
      if (now /= up_to_marks) call generic_force(family, workspace%generic, u, force)
    else if (options%dilatation) then
      if (now /= after_marks) &
        & call dilatation_pass(family, model, options, workspace, u, p, strained, all_blocks)
      if (now /= up_to_marks) call force_of_dilatation(body, family, model, options, workspace, u, &
        & p, force, strained)
    else if (now /= after_marks) then
      call force_pass(family, model, options, workspace, u, p, force, strained, all_blocks)
    end if
    if (asked .and. now /= up_to_marks) call share_halo(body, force)
  end subroutine internal_force

  !> The same where the displacements of copies are on their way (`start_halo`): what needs none of
  !> them is computed before they are waited for.
  subroutine arriving_force(body, family, model, options, workspace, u, p, force, strained, part, &
    & of_copies)
    type(body_type), intent(in) :: body                 !! as for `internal_force`, so all that
                                                        !! follows but
    class(family_type), intent(in) :: family            !! the bonds of each point
    type(model_type), intent(in) :: model               !! parameters of the slots
    type(force_options_type), intent(in) :: options     !! what the forces take in
    type(workspace_type), intent(inout) :: workspace    !! of this family and model
    real(wp), intent(inout), contiguous :: u(:, :)      !! displacements (n_slots, dim); those of
                                                        !! copies are set [m]
    real(wp), intent(inout), contiguous :: p(:)         !! 2 a d delta theta (n_slots)
    real(wp), intent(inout), contiguous :: force(:, :)  !! force density (n_slots, dim) [N/m3]
    integer(i1), intent(inout), contiguous :: strained(:)  !! marks (n_slots)
    integer, intent(in) :: part                         !! `whole` or `up_to_marks`
    logical, intent(in) :: of_copies                    !! the forces of copies are asked for

    if (model%generic .or. .not. has_early_blocks(family)) then
      call finish_halo(body, u)
      call internal_force(body, family, model, options, workspace, u, p, force, strained, part, &
        & of_copies)
    else if (options%dilatation) then
      call dilatation_pass(family, model, options, workspace, u, p, strained, early_blocks)
      call finish_halo(body, u)
      call dilatation_pass(family, model, options, workspace, u, p, strained, late_blocks)
      if (part == whole) call internal_force(body, family, model, options, workspace, u, p, force, &
        & strained, after_marks, of_copies)
    else
      call force_pass(family, model, options, workspace, u, p, force, strained, early_blocks)
      call finish_halo(body, u)
      call force_pass(family, model, options, workspace, u, p, force, strained, late_blocks)
      if (of_copies .and. part == whole) call share_halo(body, force)
    end if
  end subroutine arriving_force

  !> Whether a pass has blocks that need nothing of other ranks' points, and others.
  logical function has_early_blocks(family) result(has)
    class(family_type), intent(in) :: family

    has = .false.
    select type (family)
    type is (lattice_family_type)
      associate (colour => family%slabs%colour)
        has = colour(1) < colour(3) .and. colour(3) < colour(5)
      end associate
    type is (list_family_type)
      if (allocated(family%turn)) has = family%n_early > 0
    class default  ! a composite family has no copies
      continue
    end select
  end function has_early_blocks

  !> The forces of bonds when the dilatation of owned points is known. That of copies comes from the
  !> ranks that own their points. Where results must not depend on the ranks, the range of formulas
  !> of lattice blocks comes from there, too: a rank that has a part of a block's bonds alone cannot
  !> know which one the whole block needs.
  subroutine force_of_dilatation(body, family, model, options, workspace, u, p, force, strained)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(workspace_type), intent(inout) :: workspace
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: p(:)
    real(wp), intent(inout), contiguous :: force(:, :)
    integer(i1), intent(inout), contiguous :: strained(:)
    real(wp), allocatable :: both(:, :)
    logical :: early, with_formulas

    early = associated(body%order%ranks) .and. has_early_blocks(family)
    with_formulas = .false.
    select type (family)
    type is (lattice_family_type)
      with_formulas = associated(body%order%ranks) .and. body%order%reproducible
      if (with_formulas) call add_formulas(family, workspace, p, both)
    class default  ! formulas of lists do not depend on the ranks where they must not
      continue
    end select
    if (with_formulas) then
      call start_halo(body, both)
    else
      call start_halo(body, p)
    end if
    if (early) call force_pass(family, model, options, workspace, u, p, force, strained, &
      & early_blocks)
    if (with_formulas) then
      call finish_halo(body, both)
      select type (family)
      type is (lattice_family_type)
        call take_formulas(body, family, both, workspace, p)
      class default
        call internal_fault('formulas of a family that is no lattice')
      end select
    else
      call finish_halo(body, p)
    end if
    call force_pass(family, model, options, workspace, u, p, force, strained, merge(late_blocks, &
      & all_blocks, early))
  end subroutine force_of_dilatation

  !> The dilatation and the range of formulas of each slot's block.
  subroutine add_formulas(family, workspace, p, both)
    type(lattice_family_type), intent(in) :: family
    type(workspace_type), intent(in) :: workspace
    real(wp), intent(in), contiguous :: p(:)
    real(wp), allocatable, intent(out) :: both(:, :)  !! (n_slots, 2)
    integer(i8) :: first, last
    integer :: b

    allocate (both(size(p), 2))
    both(:, 1) = p
    both(:, 2) = 0.0_wp
    do b = 1, size(family%block)
      first = family%block(b)
      last = first + family%block_length - 1
      both(first:last, 2) = workspace%lattice%formulas_used(b)
    end do
  end subroutine add_formulas

  !> The other way round, of copies. A block belongs to one rank: where this one has a copy of a
  !> point, it has no other points.
  subroutine take_formulas(body, family, both, workspace, p)
    type(body_type), intent(in) :: body
    type(lattice_family_type), intent(in) :: family
    real(wp), intent(in) :: both(:, :)
    type(workspace_type), intent(inout) :: workspace
    real(wp), intent(inout), contiguous :: p(:)
    integer :: b, k

    p = both(:, 1)
    do b = 1, size(family%block)
      do k = int(family%block(b)), int(family%block(b)) + family%block_length - 1
        if (body%point(k) <= body%order%n_owned) cycle
        workspace%lattice%formulas_used(b) = int(nint(both(k, 2)), i1)
        exit
      end do
    end do
  end subroutine take_formulas

  !> p_k = 2 a d delta theta_k of all slots from displacements `u` (n_slots, dim) [m]. Where bonds
  !> can break, `strained` becomes 1 for slots with a bond (nearly) beyond its limit, else 0.
  subroutine dilatation_pass(family, model, options, workspace, u, p, strained, blocks)
    class(family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(workspace_type), intent(inout) :: workspace
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: p(:)
    integer(i1), intent(inout), contiguous :: strained(:)
    integer, intent(in) :: blocks  !! of a lattice or a list; others have all of them

    select type (family)
    type is (list_family_type)
      call list_dilatation(family, model, options, workspace%list, u, p, strained, blocks)
    type is (lattice_family_type)
      call lattice_dilatation(family, model, options, workspace%lattice, u, p, strained, blocks)
    type is (composite_family_type)
      call composite_dilatation(family, model, options, workspace, u, p, strained)
    class default
      call internal_fault('the dilatation of a family that has no loops')
    end select
  end subroutine dilatation_pass

  !> Internal force density of all slots (n_slots, dim) [N/m3]; `strained` as above.
  subroutine force_pass(family, model, options, workspace, u, p, force, strained, blocks)
    class(family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(workspace_type), intent(inout) :: workspace
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(inout), contiguous :: force(:, :)
    integer(i1), intent(inout), contiguous :: strained(:)
    integer, intent(in) :: blocks  !! of a lattice or a list; others have all of them

    select type (family)
    type is (list_family_type)
      call list_force(family, model, options, workspace%list, u, p, force, strained, blocks)
    type is (lattice_family_type)
      call lattice_force(family, model, options, workspace%lattice, u, p, force, strained, blocks)
    type is (composite_family_type)
      call composite_force(family, model, options, workspace, u, p, force, strained)
    class default
      call internal_fault('the forces of a family that has no loops')
    end select
  end subroutine force_pass

  !> Strain energy density of all slots [J/m3].
  subroutine energy_pass(family, model, workspace, u, energy)
    class(family_type), intent(in) :: family          !! the bonds of each point
    type(model_type), intent(in) :: model             !! parameters of the slots
    type(workspace_type), intent(inout) :: workspace  !! of this family and model
    real(wp), intent(in), contiguous :: u(:, :)       !! (n_slots, dim) displacements [m]
    real(wp), intent(inout), contiguous :: energy(:)  !! (n_slots) set for all slots [J/m3]

    if (model%generic) then
      call generic_energy(family, model, workspace%generic, u, energy)
      return
    end if
    select type (family)
    type is (list_family_type)
      call list_energy(family, model, workspace%list, u, energy)
    type is (lattice_family_type)
      call lattice_energy(family, model, workspace%lattice, u, energy)
    type is (composite_family_type)
      call composite_energy(family, model, workspace, u, energy)
    class default
      call internal_fault('the energy of a family that has no loops')
    end select
  end subroutine energy_pass

end module pd_force_forces
