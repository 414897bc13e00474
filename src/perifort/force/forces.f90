!> The internal forces and energies of a whole body, whatever its family: the class is selected
!> once per pass.
module pd_force_forces
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i1, i8
  use pd_body_body, only: body_type, share_halo
  use pd_family_composite, only: composite_family_type
  use pd_family_family, only: family_type
  use pd_family_list, only: list_family_type
  use pd_family_lattice, only: lattice_family_type
  use pd_force_composite, only: composite_dilatation, composite_energy, composite_force
  use pd_force_generic_pass, only: generic_energy, generic_force, generic_pulls
  use pd_force_lattice, only: lattice_dilatation, lattice_force, lattice_energy
  use pd_force_list, only: list_dilatation, list_force, list_energy
  use pd_force_model, only: force_options_type, model_type
  use pd_force_workspace, only: workspace_type
  implicit none (type, external)
  private
  public :: internal_force, energy_pass
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
        & call dilatation_pass(family, model, options, workspace, u, p, strained)
      if (now /= up_to_marks) call share_dilatation(body, family, workspace, p)
      if (now /= up_to_marks) &
        & call force_pass(family, model, options, workspace, u, p, force, strained)
    else if (now /= after_marks) then
      call force_pass(family, model, options, workspace, u, p, force, strained)
    end if
    if (asked .and. now /= up_to_marks) call share_halo(body, force)
  end subroutine internal_force

  !> Take the dilatation of copies from the ranks that own their points. Where results must not
  !> depend on the ranks, take the range of formulas of lattice blocks from there, too: a rank that
  !> has a part of a block's bonds alone cannot know which one the whole block needs.
  subroutine share_dilatation(body, family, workspace, p)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(workspace_type), intent(inout) :: workspace
    real(wp), intent(inout), contiguous :: p(:)
    real(wp), allocatable :: both(:, :)
    integer(i8) :: first, last
    integer :: b, k

    if (.not. associated(body%order%ranks)) return
    select type (family)
    type is (lattice_family_type)
      if (body%order%reproducible) then
        allocate (both(size(p), 2))
        both(:, 1) = p
        both(:, 2) = 0.0_wp
        do b = 1, size(family%block)
          first = family%block(b)
          last = first + family%block_length - 1
          both(first:last, 2) = workspace%lattice%formulas_used(b)
        end do
        call share_halo(body, both)
        p = both(:, 1)
        ! a block belongs to one rank: where this one has a copy of a point, it has no other points
        do b = 1, size(family%block)
          first = family%block(b)
          do k = int(first), int(first) + family%block_length - 1
            if (body%point(k) <= body%order%n_owned) cycle
            workspace%lattice%formulas_used(b) = int(nint(both(k, 2)), i1)
            exit
          end do
        end do
        return
      end if
    class default  ! formulas of lists do not depend on the ranks where they must not
      continue
    end select
    call share_halo(body, p)
  end subroutine share_dilatation

  !> p_k = 2 a d delta theta_k of all slots from displacements `u` (n_slots, dim) [m]. Where bonds
  !> can break, `strained` becomes 1 for slots with a bond (nearly) beyond its limit, else 0.
  subroutine dilatation_pass(family, model, options, workspace, u, p, strained)
    class(family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(workspace_type), intent(inout) :: workspace
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: p(:)
    integer(i1), intent(inout), contiguous :: strained(:)

    select type (family)
    type is (list_family_type)
      call list_dilatation(family, model, options, workspace%list, u, p, strained)
    type is (lattice_family_type)
      call lattice_dilatation(family, model, options, workspace%lattice, u, p, strained)
    type is (composite_family_type)
      call composite_dilatation(family, model, options, workspace, u, p, strained)
    class default
      call internal_fault('the dilatation of a family that has no loops')
    end select
  end subroutine dilatation_pass

  !> Internal force density of all slots (n_slots, dim) [N/m3]; `strained` as above.
  subroutine force_pass(family, model, options, workspace, u, p, force, strained)
    class(family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(workspace_type), intent(inout) :: workspace
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(inout), contiguous :: force(:, :)
    integer(i1), intent(inout), contiguous :: strained(:)

    select type (family)
    type is (list_family_type)
      call list_force(family, model, options, workspace%list, u, p, force, strained)
    type is (lattice_family_type)
      call lattice_force(family, model, options, workspace%lattice, u, p, force, strained)
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
