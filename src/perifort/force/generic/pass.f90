!> The generic pass: forces and energies of any bond law, on any family. A first loop gives each law
!> all bonds of a point at once and keeps the point's own part of each pair force, the *pull*; a
!> second one adds the pulls of both ends. Every value is written by the point that owns it, in the
!> order of its bonds, so that the bits do not depend on the number of threads.
!>
!> Histories are read, never changed: trial states leave nothing behind.
module pd_force_generic_pass
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  use pd_force_general, only: mark_slot
  use pd_force_generic_bonds, only: new_law_bonds, check_room, gather_bonds
  use pd_force_model, only: early, force_options_type, model_type, options_of
  use pd_force_workspace, only: generic_workspace_type
  use pd_law_law, only: law_bonds_type
  implicit none (type, external)
  private
  public :: generic_pulls, generic_force, renew_pulls, generic_energy, generic_bound

contains

  !> The pulls of all bonds at displacements `u`. Where bonds can break, `strained` becomes 1 for
  !> slots with an intact bond (nearly) beyond its limit, else 0.
  subroutine generic_pulls(family, model, options, workspace, u, strained)
    class(family_type), intent(in) :: family     !! the bonds of each point
    type(model_type), intent(in) :: model        !! with its laws
    type(force_options_type), intent(in) :: options  !! whether with thermal strain and Lambda
    type(generic_workspace_type), intent(inout) :: workspace  !! gets the pulls
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    integer(i1), intent(inout), contiguous :: strained(:)
      !! (n_slots) marks, of size 0 if no bond can break
    type(law_bonds_type) :: seen
    integer :: k

    call check_room(family, workspace)
    !$omp parallel default(none) shared(family, model, options, workspace, u, strained) &
    !$omp private(seen, k)
    call new_law_bonds(family, model, seen)
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      if (size(strained) > 0) strained(k) = 0_i1
      if (workspace%start(k + 1) == workspace%start(k)) cycle
      call pulls_of(model, options, workspace, u, k, seen)
      if (model%breaking .and. size(strained) > 0) call mark(model, k, seen, strained)
    end do
    !$omp end parallel
  end subroutine generic_pulls

  !> The pulls of one slot.
  subroutine pulls_of(model, options, workspace, u, k, seen)
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(generic_workspace_type), intent(inout) :: workspace
    real(wp), intent(in), contiguous :: u(:, :)
    integer, intent(in) :: k
    type(law_bonds_type), intent(inout) :: seen

    call gather_bonds(model, options, workspace, u, k, seen)
    associate (first => workspace%start(k), last => workspace%start(k + 1) - 1)
      call model%laws(model%material(k))%law%forces(seen, workspace%pull(first:last))
    end associate
  end subroutine pulls_of

  !> Mark a slot with an intact bond near its limit.
  pure subroutine mark(model, k, seen, strained)
    type(model_type), intent(in) :: model
    integer, intent(in) :: k
    type(law_bonds_type), intent(in) :: seen
    integer(i1), intent(inout), contiguous :: strained(:)
    integer :: i

    do i = 1, seen%n
      if (abs(seen%stretch(i)) <= model%least_critical*early) cycle
      if (seen%volume(i) > 0.0_wp) call mark_slot(model, int(k, i8), seen%stretch(i), strained)
    end do
  end subroutine mark

  !> The pulls of some slots again, after they lost bonds.
  subroutine renew_pulls(family, model, workspace, u, slots)
    class(family_type), intent(in) :: family     !! as its bonds are now
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(inout) :: workspace  !! gets the pulls of these slots
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    integer(i4), intent(in) :: slots(:)          !! (any number) which
    type(law_bonds_type) :: seen
    integer :: m

    if (size(slots) == 0) return
    call new_law_bonds(family, model, seen)
    do m = 1, size(slots)
      call pulls_of(model, options_of(model), workspace, u, int(slots(m)), seen)
    end do
  end subroutine renew_pulls

  !> Force density from the pulls of both ends of each bond, along the deformed bond (7.3, 7.4).
  subroutine generic_force(family, workspace, u, force)
    class(family_type), intent(in) :: family     !! the bonds of each point
    type(generic_workspace_type), intent(in) :: workspace  !! with the pulls at `u`
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    real(wp), intent(inout), contiguous :: force(:, :)  !! (n_slots, dim) set for all slots [N/m3]
    real(wp) :: sums(3)
    integer(i8) :: first, last
    integer :: k, c

    !$omp parallel default(none) shared(family, workspace, u, force) &
    !$omp private(sums, first, last, k, c)
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      first = workspace%start(k)
      last = workspace%start(k + 1) - 1
      call add_pulls(size(u, 1), family%dim, int(last - first) + 1, workspace%member(first:last), &
        & workspace%partner(first:last), workspace%volume(first:last), &
        & workspace%pull(first:last), size(workspace%pull, kind=i8), workspace%pull, workspace%x, &
        & u, k, sums)
      do c = 1, family%dim
        force(k, c) = sums(c)
      end do
    end do
    !$omp end parallel
  end subroutine generic_force

  !> The sum over the `n` bonds of slot `k`. A bond crushed to a point has no direction.
  pure subroutine add_pulls(n_slots, dim, n, member, partner, volume, own, n_bonds, pull, x, u, k, &
    & sums)
    integer, intent(in) :: n_slots, dim, n, k
    integer(i4), intent(in) :: member(n)
    integer(i8), intent(in) :: partner(n)
    integer(i8), intent(in) :: n_bonds
    real(wp), intent(in) :: volume(n), own(n), pull(n_bonds), x(n_slots, dim), u(n_slots, dim)
    real(wp), intent(out) :: sums(3)
    real(wp) :: y(n, dim), square(n), both(n)
    integer :: i, c

    square = 0.0_wp
    do c = 1, dim
      do i = 1, n
        y(i, c) = (x(member(i), c) - x(k, c)) + (u(member(i), c) - u(k, c))
        square(i) = square(i) + y(i, c)**2
      end do
    end do
    do i = 1, n
      both(i) = own(i) + pull(partner(i))
    end do
    do i = 1, n
      both(i) = merge(both(i)*volume(i)/sqrt(max(square(i), tiny(1.0_wp))), 0.0_wp, &
        & square(i) > 0.0_wp)
    end do
    sums = 0.0_wp
    do c = 1, dim
      do i = 1, n
        sums(c) = sums(c) + both(i)*y(i, c)
      end do
    end do
  end subroutine add_pulls

  !> Strain energy density of all slots.
  subroutine generic_energy(family, model, workspace, u, energy)
    class(family_type), intent(in) :: family     !! as its bonds are now
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(in) :: workspace  !! with the history
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    real(wp), intent(inout), contiguous :: energy(:)  !! (n_slots) set for all slots [J/m3]
    type(law_bonds_type) :: seen
    integer :: k

    call check_room(family, workspace)
    !$omp parallel default(none) shared(family, model, workspace, u, energy) private(seen, k)
    call new_law_bonds(family, model, seen)
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      energy(k) = 0.0_wp
      if (workspace%start(k + 1) == workspace%start(k)) cycle
      call gather_bonds(model, options_of(model), workspace, u, k, seen)
      energy(k) = model%laws(model%material(k))%law%energy(seen)
    end do
    !$omp end parallel
  end subroutine generic_energy

  !> M_k of every slot: the sum of the bounds that both ends give each bond, times vc V_j. Twice it
  !> bounds the absolute row sum of the stiffness (doc/theory.md, 6).
  subroutine generic_bound(family, model, workspace, bound)
    class(family_type), intent(in) :: family     !! broken bonds count as if they were intact
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(in) :: workspace  !! begun
    real(wp), intent(inout), contiguous :: bound(:)  !! (n_slots) M_k, 0 without bonds [N/m4]
    type(bonds_type) :: bonds
    type(law_bonds_type) :: seen
    real(wp), allocatable :: own(:), undeformed(:, :)
    integer(i8) :: b
    integer :: k, i

    call check_room(family, workspace)
    allocate (own(size(workspace%pull, kind=i8)))
    allocate (undeformed(family%n_slots, family%dim), source=0.0_wp)
    !$omp parallel default(none) shared(family, model, workspace, bound, own, undeformed) &
    !$omp private(bonds, seen, b, k, i)
    call allocate_bonds(family, bonds)
    call new_law_bonds(family, model, seen)
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      if (workspace%start(k + 1) == workspace%start(k)) cycle
      call family%bonds_of(k, bonds)
      call gather_bonds(model, options_of(model), workspace, undeformed, k, seen)
      seen%volume(:bonds%n) = bonds%weight(:bonds%n)
      call model%laws(model%material(k))%law%stiffness(seen, &
        & own(workspace%start(k):workspace%start(k + 1) - 1))
    end do
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      bound(k) = 0.0_wp
      if (workspace%start(k + 1) == workspace%start(k)) cycle
      call family%bonds_of(k, bonds)
      do i = 1, bonds%n
        b = workspace%start(k) + i - 1
        bound(k) = bound(k) + (own(b) + own(workspace%partner(b))) &
          & *bonds%weight(i)
      end do
    end do
    !$omp end parallel
  end subroutine generic_bound

end module pd_force_generic_pass
