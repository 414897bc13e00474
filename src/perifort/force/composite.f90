!> The passes over the bonds of a composite family: those of its lattice on the family's slots,
!> those of its list on the slots of that, whose values are copied from the family's and added to
!> them.
module pd_force_composite
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i1, i4
  use pd_family_composite, only: composite_family_type
  use pd_force_lattice, only: lattice_dilatation, lattice_energy, lattice_force
  use pd_force_list, only: list_dilatation, list_energy, list_force, prepare_list
  use pd_force_model, only: force_options_type, model_type
  use pd_force_weights, only: build_weights
  use pd_force_workspace, only: composite_workspace_type, workspace_type
  implicit none (type, external)
  private
  public :: prepare_composite, composite_dilatation, composite_energy, composite_force

contains

  !> Make what the loops of both parts keep of the model; afterwards the model must not change, but
  !> for thermal strains.
  subroutine prepare_composite(family, model, workspace)
    type(composite_family_type), intent(inout) :: family  !! whole; its lattice loses its classes
    type(model_type), intent(in) :: model                 !! complete, with surface factors
    type(workspace_type), intent(inout) :: workspace      !! ready for passes, without a state

    call build_weights(family%lattice, model, workspace%lattice)
    call begin_list(family, model, workspace%composite)
    call prepare_list(family%list, workspace%composite%model, workspace%list)
  end subroutine prepare_composite

  !> p_k = 2 a d delta theta_k of all slots; marks strained slots where bonds can break.
  subroutine composite_dilatation(family, model, options, workspace, u, p, strained)
    type(composite_family_type), intent(in) :: family  !! the family
    type(model_type), intent(in) :: model              !! that the workspace was made for
    type(force_options_type), intent(in) :: options    !! what the forces take in
    type(workspace_type), intent(inout) :: workspace   !! of this model
    real(wp), intent(in), contiguous :: u(:, :)        !! (n_slots, dim) displacements [m]
    real(wp), intent(inout), contiguous :: p(:)
      !! (n_slots) 2 a d delta theta, set for all slots [N/m5]
    integer(i1), intent(inout), contiguous :: strained(:)
      !! (n_slots) 1 for slots with a bond nearly at its limit, of size 0 if none can break
    integer :: k

    call lattice_dilatation(family%lattice, model, options, workspace%lattice, u, p, strained)
    call begin_list(family, model, workspace%composite)
    associate (part => workspace%composite)
      call take_state(family, model, u, part)
      call list_dilatation(family%list, part%model, options, workspace%list, part%u, part%p, &
        & part%strained)
      do k = family%first_free, family%n_slots
        p(k) = 0.0_wp
      end do
      call add_values(family%slot, part%p, p)
      call add_marks(family, part%strained, strained)
    end associate
  end subroutine composite_dilatation

  !> Force density of all slots (n_slots, dim) [N/m3]. With a dilatation this follows
  !> `composite_dilatation` at the same displacements.
  subroutine composite_force(family, model, options, workspace, u, p, force, strained)
    type(composite_family_type), intent(in) :: family   !! the family
    type(model_type), intent(in) :: model               !! that the workspace was made for
    type(force_options_type), intent(in) :: options
      !! what the forces take in, as for `composite_dilatation`
    type(workspace_type), intent(inout) :: workspace    !! of this model
    real(wp), intent(in), contiguous :: u(:, :)         !! (n_slots, dim) displacements [m]
    real(wp), intent(in), contiguous :: p(:)
      !! (n_slots) 2 a d delta theta, of size 0 without a dilatation [N/m5]
    real(wp), intent(inout), contiguous :: force(:, :)  !! (n_slots, dim) set for all slots [N/m3]
    integer(i1), intent(inout), contiguous :: strained(:)
      !! (n_slots) 1 for slots with a bond nearly at its limit, of size 0 if none can break
    integer :: c, k

    call lattice_force(family%lattice, model, options, workspace%lattice, u, p, force, strained)
    call begin_list(family, model, workspace%composite)
    associate (part => workspace%composite)
      if (options%dilatation) then
        call take_values(family%slot, p, part%p)
        call list_force(family%list, part%model, options, workspace%list, part%u, part%p, &
          & part%force, part%strained)
      else
        call take_state(family, model, u, part)
        call list_force(family%list, part%model, options, workspace%list, part%u, part%p(:0), &
          & part%force, part%strained)
      end if
      do c = 1, family%dim
        do k = family%first_free, family%n_slots
          force(k, c) = 0.0_wp
        end do
        call add_values(family%slot, part%force(:, c), force(:, c))
      end do
      call add_marks(family, part%strained, strained)
    end associate
  end subroutine composite_force

  !> Strain energy density of all slots [J/m3].
  subroutine composite_energy(family, model, workspace, u, energy)
    type(composite_family_type), intent(in) :: family  !! the family
    type(model_type), intent(in) :: model              !! that the workspace was made for
    type(workspace_type), intent(inout) :: workspace   !! of this model; gets the displacements
    real(wp), intent(in), contiguous :: u(:, :)        !! (n_slots, dim) displacements [m]
    real(wp), intent(inout), contiguous :: energy(:)   !! (n_slots) set for all slots [J/m3]
    real(wp), allocatable :: theta(:), more(:), more_theta(:)
    integer :: k

    allocate (theta(family%n_slots))
    allocate (more(family%list%n_slots), more_theta(family%list%n_slots))
    call lattice_energy(family%lattice, model, workspace%lattice, u, energy, theta)
    call begin_list(family, model, workspace%composite)
    associate (part => workspace%composite)
      call take_state(family, model, u, part)
      call list_energy(family%list, part%model, workspace%list, part%u, more, more_theta)
    end associate
    call add_values(family%slot, more, energy)
    call add_values(family%slot, more_theta, theta)
    !$omp parallel do schedule(static) default(none) shared(family, model, energy, theta) private(k)
    do k = 1, family%n_slots
      energy(k) = energy(k) + model%materials(model%material(k))%a*theta(k)**2
    end do
  end subroutine composite_energy

  !> Room for what stands in the slots of the list, and the model of these, if there is none.
  subroutine begin_list(family, model, part)
    type(composite_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(composite_workspace_type), intent(inout) :: part
    integer :: n

    n = family%list%n_slots
    if (allocated(part%u)) then
      if (size(part%u, 1) /= n) call internal_fault('a workspace of another family')
      return
    end if
    allocate (part%u(n, family%dim), part%force(n, family%dim), source=0.0_wp)
    allocate (part%p(n), source=0.0_wp)
    allocate (part%strained(merge(n, 0, model%breaking)), source=0_i1)
    call model_of_list(family, model, part%model)
  end subroutine begin_list

  !> The parameters of the list's slots. Dead ones, at its end, have those of the last live one.
  subroutine model_of_list(family, model, part)
    type(composite_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(model_type), intent(out) :: part
    integer(i4), allocatable :: from(:)

    if (model%consistent) call internal_fault('weights of the bonds of a composite family')
    allocate (from(family%list%n_slots))
    from(:size(family%slot)) = family%slot
    if (size(family%slot) > 0) from(size(family%slot) + 1:) = family%slot(size(family%slot))
    part%dim = model%dim
    part%dilatation = model%dilatation
    part%projected = model%projected
    part%surface = model%surface
    part%thermal = model%thermal
    part%breaking = model%breaking
    part%compression = model%compression
    part%weighted = model%weighted
    part%influenced = model%influenced
    part%least_critical = model%least_critical
    allocate (part%materials, source=model%materials)
    if (allocated(model%laws)) allocate (part%laws, source=model%laws)
    part%material = model%material(from)
    if (allocated(model%scale)) part%scale = model%scale(from)
    if (allocated(model%horizon)) part%horizon = model%horizon(from)
    if (allocated(model%of_stretch)) part%of_stretch = model%of_stretch(from)
    if (allocated(model%of_dilatation)) part%of_dilatation = model%of_dilatation(from)
    if (allocated(model%D)) part%D = model%D(from, :)
    if (allocated(model%S)) part%S = model%S(from, :)
    if (allocated(model%axes)) part%axes = model%axes
    if (allocated(model%expansion)) part%expansion = model%expansion(from)
    if (allocated(model%critical)) part%critical = model%critical(from)
    if (allocated(model%compressed)) part%compressed = model%compressed(from)
    if (allocated(model%number)) part%number = model%number(from)
    if (allocated(model%weakest)) part%weakest = model%weakest(from)
  end subroutine model_of_list

  !> Copy displacements, and thermal strains, which vary in time, to the slots of the list.
  subroutine take_state(family, model, u, part)
    type(composite_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    type(composite_workspace_type), intent(inout) :: part
    integer :: c

    do c = 1, family%dim
      call take_values(family%slot, u(:, c), part%u(:, c))
    end do
    if (model%thermal) call take_values(family%slot, model%expansion, part%model%expansion)
  end subroutine take_state

  !> Values of the list's slots from those of the family's.
  subroutine take_values(slot, values, of_list)
    integer(i4), intent(in) :: slot(:)
    real(wp), intent(in), contiguous :: values(:)
    real(wp), intent(inout), contiguous :: of_list(:)
    integer :: k

    !$omp parallel do schedule(static) default(none) shared(slot, values, of_list) private(k)
    do k = 1, size(slot)
      of_list(k) = values(slot(k))
    end do
  end subroutine take_values

  !> Add values of the list's slots to those of the family's, each of which has one at most.
  subroutine add_values(slot, of_list, values)
    integer(i4), intent(in) :: slot(:)
    real(wp), intent(in), contiguous :: of_list(:)
    real(wp), intent(inout), contiguous :: values(:)
    integer :: k

    !$omp parallel do schedule(static) default(none) shared(slot, values, of_list) private(k)
    do k = 1, size(slot)
      values(slot(k)) = values(slot(k)) + of_list(k)
    end do
  end subroutine add_values

  !> Mark the slots that the list has marked.
  subroutine add_marks(family, marked, strained)
    type(composite_family_type), intent(in) :: family
    integer(i1), intent(in) :: marked(:)
    integer(i1), intent(inout) :: strained(:)
    integer :: k

    do k = 1, min(size(family%slot), size(marked))
      if (marked(k) == 1_i1) strained(family%slot(k)) = 1_i1
    end do
  end subroutine add_marks

end module pd_force_composite
