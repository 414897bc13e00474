!> Bond laws of the generic pass at single points: energy, dilatation, damage; and what becomes of
!> their histories. `commit_laws` alone changes these, after an accepted step.
module pd_force_generic_points
  use pd_base_archive, only: archive_type
  use pd_base_kinds, only: wp
  use pd_base_reduce, only: inner
  use pd_body_body, only: body_type
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  use pd_force_generic_bonds, only: new_law_bonds, refresh_bonds, check_room, gather_bonds
  use pd_force_model, only: model_type, options_of
  use pd_force_reference, only: point_damage
  use pd_force_workspace, only: generic_workspace_type
  use pd_law_law, only: law_bonds_type
  implicit none (type, external)
  private
  public :: generic_point_energy, generic_point_dilatation, generic_point_damage
  public :: generic_energy_product, generic_energy_of_work, commit_laws, keep_laws, has_plasticity

contains

  !> Strain energy density of one slot [J/m3].
  pure real(wp) function generic_point_energy(family, model, workspace, u, k) result(energy)
    class(family_type), intent(in) :: family     !! the family
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(in) :: workspace  !! with the history
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    integer, intent(in) :: k                     !! slot
    type(law_bonds_type) :: seen

    call new_law_bonds(family, model, seen)
    call gather_bonds(model, options_of(model), workspace, u, k, seen)
    energy = model%laws(model%material(k))%law%energy(seen)
  end function generic_point_energy

  !> What one slot stores and, since the last commit, has dissipated at `u`: the change of this sum
  !> is the work of its forces, whatever flows meanwhile [J/m3].
  pure real(wp) function generic_energy_of_work(family, model, workspace, u, k) result(energy)
    class(family_type), intent(in) :: family     !! the family
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(in) :: workspace  !! with the history
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    integer, intent(in) :: k                     !! slot
    type(law_bonds_type) :: seen

    call new_law_bonds(family, model, seen)
    call gather_bonds(model, options_of(model), workspace, u, k, seen)
    energy = energy_of_work(model, k, seen)
  end function generic_energy_of_work

  !> The same of bonds that were gathered.
  pure real(wp) function energy_of_work(model, k, seen) result(energy)
    type(model_type), intent(in) :: model
    integer, intent(in) :: k
    type(law_bonds_type), intent(in) :: seen
    type(law_bonds_type) :: later
    real(wp) :: dissipated

    associate (law => model%laws(model%material(k))%law)
      if (law%bond_history + law%point_history == 0) then
        energy = law%energy(seen)
        return
      end if
      later = seen
      call law%commit(later, dissipated)
      energy = law%energy(later) + dissipated
    end associate
  end function energy_of_work

  !> The strain energy density of one slot with the products of the stretches under `u` and `other`
  !> in place of their squares. Laws with a history have no energy that is quadratic in the
  !> stretches alone: of these, what is stored and dissipated at `u`, less half the work of the
  !> forces there on the way from `other`. That is the product if the energy is quadratic, and
  !> differs from the exact work by the error of the trapezoidal rule otherwise [J/m3].
  pure real(wp) function generic_energy_product(family, model, workspace, u, other, k, &
    & expansion) result(energy)
    class(family_type), intent(in) :: family     !! the family
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(in) :: workspace  !! with the history
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    real(wp), intent(in), contiguous :: other(:, :)
      !! (n_slots, dim) displacements of another instant [m]
    integer, intent(in) :: k                     !! slot
    real(wp), intent(in), optional :: expansion(:)
      !! (n_slots) thermal strains with `other`; those of the model by default [-]
    type(law_bonds_type) :: seen
    real(wp), allocatable :: stretch(:), stretch_of_other(:), pull(:)
    integer :: n

    associate (law => model%laws(model%material(k))%law)
      n = int(workspace%start(k + 1) - workspace%start(k))
      call new_law_bonds(family, model, seen)
      call gather_bonds(model, options_of(model), workspace, other, k, seen)
      stretch_of_other = seen%stretch(:n)
      if (present(expansion)) then
        associate (member => workspace%member(workspace%start(k):workspace%start(k + 1) - 1))
          stretch_of_other = stretch_of_other + (model%expansion(k) - expansion(k) &
            & + model%expansion(member) - expansion(member))/2
        end associate
      end if
      call gather_bonds(model, options_of(model), workspace, u, k, seen)
      stretch = seen%stretch(:n)
      if (law%bond_history + law%point_history > 0) then
        allocate (pull(n))
        call law%forces(seen, pull)
        energy = energy_of_work(model, k, seen) - sum(pull*seen%length(:n)*seen%volume(:n) &
          & *(stretch - stretch_of_other))/2
        return
      end if
      ! Q(a, b) = Q((a + b)/2) - Q((a - b)/2) of a quadratic form Q
      seen%stretch(:n) = (stretch + stretch_of_other)/2
      energy = law%energy(seen)
      seen%stretch(:n) = (stretch - stretch_of_other)/2
      energy = energy - law%energy(seen)
    end associate
  end function generic_energy_product

  !> Dilatation of one slot by its law [-].
  pure real(wp) function generic_point_dilatation(family, model, workspace, u, k) result(theta)
    class(family_type), intent(in) :: family     !! the family
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(in) :: workspace  !! with the history
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    integer, intent(in) :: k                     !! slot
    type(law_bonds_type) :: seen

    call new_law_bonds(family, model, seen)
    call gather_bonds(model, options_of(model), workspace, u, k, seen)
    theta = model%laws(model%material(k))%law%dilatation(seen)
  end function generic_point_dilatation

  !> Local damage of one slot: the part of its family's volume behind broken bonds, and of intact
  !> bonds as much as their law has taken from them [-].
  pure real(wp) function generic_point_damage(family, model, workspace, u, k, bonds) result(damage)
    class(family_type), intent(in) :: family     !! the family
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(in) :: workspace  !! with the history
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    integer, intent(in) :: k                     !! slot
    type(bonds_type), intent(in) :: bonds        !! of slot `k`, broken ones included
    type(law_bonds_type) :: seen

    call new_law_bonds(family, model, seen)
    call gather_bonds(model, options_of(model), workspace, u, k, seen)
    damage = damage_seen(model, k, bonds, seen)
  end function generic_point_damage

  pure real(wp) function damage_seen(model, k, bonds, seen) result(damage)
    type(model_type), intent(in) :: model
    integer, intent(in) :: k
    type(bonds_type), intent(in) :: bonds
    type(law_bonds_type), intent(in) :: seen
    real(wp) :: lost(seen%n)

    if (.not. model%laws(model%material(k))%law%softens) then
      damage = point_damage(bonds)
      return
    end if
    call model%laws(model%material(k))%law%bond_damage(seen, lost)
    where (.not. bonds%intact(:seen%n)) lost = 1.0_wp
    damage = 0.0_wp
    if (seen%n > 0) damage = min(1.0_wp, sum(lost*bonds%weight(:seen%n)) &
      & /sum(bonds%weight(:seen%n)))
  end function damage_seen

  !> Bring the history of all points and bonds to the present state, after an accepted step, and
  !> local damage with it where a law softens.
  subroutine commit_laws(body, family, model, workspace, u, damage, dissipated, plastic)
    type(body_type), intent(in) :: body          !! its volumes
    class(family_type), intent(in) :: family     !! as its bonds are now
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(inout) :: workspace  !! gets the new history
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    real(wp), intent(inout), contiguous :: damage(:)
      !! (n_slots) brought up to date, of size 0 if nothing can be damaged [-]
    real(wp), intent(out) :: dissipated          !! what the laws dissipated since the last call [J]
    real(wp), intent(out) :: plastic             !! the part of it by plastic laws [J]
    type(bonds_type) :: bonds
    type(law_bonds_type) :: seen
    real(wp), allocatable :: density(:)
    integer :: k

    dissipated = 0.0_wp
    plastic = 0.0_wp
    call check_room(family, workspace)
    if (size(workspace%history, 1) + size(workspace%of_point, 1) == 0) return
    allocate (density(family%n_slots), source=0.0_wp)
    !$omp parallel default(none) shared(family, model, workspace, u, damage, density) &
    !$omp private(bonds, seen, k)
    call allocate_bonds(family, bonds)
    call new_law_bonds(family, model, seen)
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      if (workspace%start(k + 1) == workspace%start(k)) cycle
      associate (law => model%laws(model%material(k))%law, first => workspace%start(k), &
        & last => workspace%start(k + 1) - 1)
        if (law%bond_history + law%point_history == 0) cycle
        call family%bonds_of(k, bonds)
        call gather_bonds(model, options_of(model), workspace, u, k, seen)
        call law%commit(seen, density(k))
        if (size(seen%history, 1) > 0) workspace%history(:, first:last) = seen%history(:, :seen%n)
        workspace%of_point(:, k) = seen%of_point
        if (law%softens .and. size(damage) > 0) damage(k) = damage_seen(model, k, bonds, seen)
      end associate
    end do
    !$omp end parallel
    dissipated = inner(body%order, density, body%volume)
    if (.not. has_plasticity(model)) return
    do k = 1, family%n_slots
      if (.not. model%laws(model%material(k))%law%plastic) density(k) = 0.0_wp
    end do
    plastic = inner(body%order, density, body%volume)
  end subroutine commit_laws

  !> Whether some law dissipates plastic energy.
  pure logical function has_plasticity(model)
    type(model_type), intent(in) :: model  !! the model
    integer :: i

    has_plasticity = .false.
    if (.not. allocated(model%laws)) return
    do i = 1, size(model%laws)
      has_plasticity = has_plasticity .or. model%laws(i)%law%plastic
    end do
  end function has_plasticity

  !> Keep the history, or put it back. The bonds of the family were kept before.
  subroutine keep_laws(archive, family, workspace)
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    class(family_type), intent(in) :: family       !! with its broken bonds
    type(generic_workspace_type), intent(inout) :: workspace  !! set where the archive reads

    if (.not. allocated(workspace%start)) return
    call archive%keep('history of bonds', workspace%history)
    call archive%keep('history of points', workspace%of_point)
    call refresh_bonds(family, workspace)
  end subroutine keep_laws

end module pd_force_generic_points
