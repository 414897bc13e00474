!> The generic pass: forces and energies of any bond law, on any family. A first loop gives each law
!> all bonds of a point at once and keeps the point's own part of each pair force, the *pull*; a
!> second one adds the pulls of both ends. Every value is written by the point that owns it, in the
!> order of its bonds, so that the bits do not depend on the number of threads.
!>
!> History belongs to the ordered bond, (k, j), and is owned by k. Passes read it; `commit_laws`
!> alone changes it, after an accepted step.
module pd_force_generic
  use pd_base_archive, only: archive_type
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i1, i2, i4, i8
  use pd_base_reduce, only: inner
  use pd_body_body, only: body_type
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  use pd_family_surface, only: bond_factor
  use pd_force_general, only: mark_slot
  use pd_force_model, only: early, has_scales, model_type
  use pd_force_workspace, only: generic_workspace_type
  use pd_law_law, only: allocate_law_bonds, law_bonds_type
  implicit none (type, external)
  private
  public :: begin_laws, generic_pulls, generic_force, renew_pulls, generic_energy, generic_bound
  public :: commit_laws, generic_point_energy, generic_point_dilatation, generic_point_damage
  public :: generic_energy_product, keep_laws, new_law_bonds

contains

  !> What the laws take from the whole family, before cracks are cut: scales of the points on the fast
  !> loops, or constants of the points and room for the pulls and histories of the generic pass.
  subroutine begin_laws(body, family, model, workspace)
    type(body_type), intent(in) :: body       !! arranged in the slots of the family
    class(family_type), intent(in) :: family  !! whole
    type(model_type), intent(inout) :: model  !! with its laws; gets the scales of its slots
    type(generic_workspace_type), intent(inout) :: workspace  !! made if the model is generic
    type(bonds_type) :: bonds
    type(law_bonds_type) :: seen
    integer(i8) :: n
    integer :: k

    if (.not. (model%generic .or. has_scales(model))) return
    if (model%generic) then
      allocate (workspace%start(family%n_slots + 1))
      call allocate_bonds(family, bonds)
      n = 1_i8
      do k = 1, family%n_slots
        workspace%start(k) = n
        call family%bonds_of(k, bonds)
        n = n + bonds%n
      end do
      workspace%start(family%n_slots + 1) = n
      call find_other_ends(family, workspace)
      allocate (workspace%pull(n - 1), source=0.0_wp)
      allocate (workspace%history(most(model, 'bond'), n - 1), source=0.0_wp)
      allocate (workspace%of_point(most(model, 'point'), family%n_slots), source=0.0_wp)
      allocate (workspace%constants(most(model, 'constants'), family%n_slots), source=0.0_wp)
    else
      allocate (model%scale(family%n_slots), source=1.0_wp)
    end if
    !$omp parallel default(none) shared(body, family, model, workspace) private(bonds, seen, k)
    call allocate_bonds(family, bonds)
    call new_law_bonds(family, model, seen)
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      if (body%point(k) == 0) cycle
      call family%bonds_of(k, bonds)
      seen%n = bonds%n
      seen%length(:bonds%n) = bonds%length(:bonds%n)
      seen%volume(:bonds%n) = bonds%weight(:bonds%n)
      associate (law => model%laws(model%material(k))%law)
        call law%begin(seen)
        if (model%generic) then
          workspace%constants(:, k) = seen%constants
        else if (law%point_constants > 0) then
          model%scale(k) = seen%constants(1)
        end if
      end associate
    end do
    !$omp end parallel
  end subroutine begin_laws

  !> The most reals that a law in use has of a kind.
  pure integer function most(model, kind)
    type(model_type), intent(in) :: model
    character(*), intent(in) :: kind
    integer :: i

    most = 0
    do i = 1, size(model%laws)
      associate (law => model%laws(i)%law)
        select case (kind)
        case ('bond'); most = max(most, law%bond_history)
        case ('point'); most = max(most, law%point_history)
        case ('constants'); most = max(most, law%point_constants)
        case default
          call internal_fault('an unknown kind of history')
        end select
      end associate
    end do
  end function most

  !> Room for what the laws of a model see of a point.
  pure subroutine new_law_bonds(family, model, seen)
    class(family_type), intent(in) :: family   !! whose largest number of bonds counts
    type(model_type), intent(in) :: model      !! with its laws
    type(law_bonds_type), intent(out) :: seen  !! without a bond
    call allocate_law_bonds(family%most_bonds, most(model, 'bond'), most(model, 'point'), &
      & most(model, 'constants'), seen)
  end subroutine new_law_bonds

  !> The number that each bond has in the family of its other end. The bonds of j in the order of
  !> their other ends belong, one by one, to the slots that have a bond to j, in their order.
  subroutine find_other_ends(family, workspace)
    class(family_type), intent(in) :: family
    type(generic_workspace_type), intent(inout) :: workspace
    type(bonds_type) :: bonds
    integer, allocatable :: order(:)
    integer(i4), allocatable :: met(:)
    integer(i2), allocatable :: sorted(:)
    integer :: k, i, j

    allocate (workspace%back(workspace%start(family%n_slots + 1) - 1))
    allocate (sorted(size(workspace%back, kind=i8)))
    !$omp parallel default(none) shared(family, workspace, sorted) private(bonds, order, k, i)
    call allocate_bonds(family, bonds)
    allocate (order(family%most_bonds))
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      call family%bonds_of(k, bonds)
      call sort_by(bonds%j(:bonds%n), order(:bonds%n))
      do i = 1, bonds%n
        sorted(workspace%start(k) + i - 1) = int(order(i), i2)
      end do
    end do
    !$omp end parallel
    allocate (met(family%n_slots), source=0_i4)
    call allocate_bonds(family, bonds)
    do k = 1, family%n_slots
      call family%bonds_of(k, bonds)
      do i = 1, bonds%n
        j = bonds%j(i)
        workspace%back(workspace%start(k) + i - 1) = sorted(workspace%start(j) + met(j))
        met(j) = met(j) + 1_i4
      end do
    end do
    if (any(met /= workspace%start(2:) - workspace%start(:family%n_slots))) &
      & call internal_fault('a bond that its other end does not have')
  end subroutine find_other_ends

  !> The order of ascending values, by merging.
  pure subroutine sort_by(values, order)
    integer(i4), intent(in) :: values(:)
    integer, intent(out) :: order(:)
    integer :: merged(size(values))
    integer :: width, first, middle, last, a, b, m

    order = [(m, m=1, size(values))]
    width = 1
    do while (width < size(values))
      do first = 1, size(values), 2*width
        middle = min(first + width, size(values) + 1)
        last = min(first + 2*width, size(values) + 1)
        a = first
        b = middle
        do m = first, last - 1
          if (b >= last) then
            merged(m) = order(a)
            a = a + 1
          else if (a >= middle) then
            merged(m) = order(b)
            b = b + 1
          else if (values(order(a)) <= values(order(b))) then
            merged(m) = order(a)
            a = a + 1
          else
            merged(m) = order(b)
            b = b + 1
          end if
        end do
      end do
      order = merged
      width = 2*width
    end do
  end subroutine sort_by

  ! ---------------------------------------------------------------- what a law sees

  !> The bonds of slot `k` at displacements `u` as its law sees them, with the committed history.
  pure subroutine look(model, workspace, u, k, bonds, seen)
    type(model_type), intent(in) :: model
    type(generic_workspace_type), intent(in) :: workspace
    real(wp), intent(in), contiguous :: u(:, :)
    integer, intent(in) :: k
    type(bonds_type), intent(in) :: bonds
    type(law_bonds_type), intent(inout) :: seen
    real(wp) :: eta, along, square, y, direction(size(u, 2))
    integer(i8) :: first
    integer :: i, j, c, n

    n = bonds%n
    seen%n = n
    do i = 1, n
      j = bonds%j(i)
      along = 0.0_wp
      square = 0.0_wp
      y = 0.0_wp
      do c = 1, size(u, 2)
        eta = u(j, c) - u(k, c)
        along = along + bonds%xi(i, c)*eta
        square = square + eta**2
        y = y + (bonds%xi(i, c) + eta)**2
      end do
      y = sqrt(y)
      associate (length => bonds%length(i))
        seen%length(i) = length
        seen%volume(i) = merge(bonds%weight(i), 0.0_wp, bonds%intact(i))
        ! without cancellation (doc/theory.md, 2)
        seen%stretch(i) = (2*along + square)/(length*(y + length))
        if (model%projected) then
          seen%projection(i) = 0.0_wp
          if (y > 0.0_wp) seen%projection(i) = (length**2 + along)/(y*length)
        end if
      end associate
    end do
    if (model%thermal) then
      do i = 1, n
        seen%stretch(i) = seen%stretch(i) - (model%expansion(k) + model%expansion(bonds%j(i)))/2
      end do
    end if
    if (model%surface) then
      do i = 1, n
        direction = bonds%xi(i, :)/bonds%length(i)
        seen%Gd(i) = bond_factor(direction, model%D(k, :), model%D(bonds%j(i), :))
        seen%Gb(i) = bond_factor(direction, model%S(k, :), model%S(bonds%j(i), :))
      end do
    end if
    first = workspace%start(k)
    if (size(seen%history, 1) > 0) seen%history(:, :n) = workspace%history(:, first:first + n - 1)
    seen%of_point = workspace%of_point(:, k)
    seen%constants = workspace%constants(:, k)
  end subroutine look

  ! ---------------------------------------------------------------- forces

  !> The pulls of all bonds at displacements `u`. Where bonds can break, `strained` becomes 1 for
  !> slots with an intact bond (nearly) beyond its limit, else 0.
  subroutine generic_pulls(family, model, workspace, u, strained)
    class(family_type), intent(in) :: family     !! who interacts with whom
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(inout) :: workspace  !! gets the pulls
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    integer(i1), intent(inout), contiguous :: strained(:)
      !! (n_slots) marks, of size 0 if no bond can break
    type(bonds_type) :: bonds
    type(law_bonds_type) :: seen
    integer :: k

    call check_room(family, workspace)
    !$omp parallel default(none) shared(family, model, workspace, u, strained) &
    !$omp private(bonds, seen, k)
    call allocate_bonds(family, bonds)
    call new_law_bonds(family, model, seen)
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      if (size(strained) > 0) strained(k) = 0_i1
      if (workspace%start(k + 1) == workspace%start(k)) cycle
      call pulls_of(family, model, workspace, u, k, bonds, seen)
      if (model%breaking .and. size(strained) > 0) call mark(model, k, seen, strained)
    end do
    !$omp end parallel
  end subroutine generic_pulls

  !> The pulls of one slot.
  subroutine pulls_of(family, model, workspace, u, k, bonds, seen)
    class(family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(generic_workspace_type), intent(inout) :: workspace
    real(wp), intent(in), contiguous :: u(:, :)
    integer, intent(in) :: k
    type(bonds_type), intent(inout) :: bonds
    type(law_bonds_type), intent(inout) :: seen

    call family%bonds_of(k, bonds)
    call look(model, workspace, u, k, bonds, seen)
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
    type(bonds_type) :: bonds
    type(law_bonds_type) :: seen
    integer :: m

    if (size(slots) == 0) return
    call allocate_bonds(family, bonds)
    call new_law_bonds(family, model, seen)
    do m = 1, size(slots)
      call pulls_of(family, model, workspace, u, int(slots(m)), bonds, seen)
    end do
  end subroutine renew_pulls

  !> Force density from the pulls of both ends of each bond, along the deformed bond (7.3, 7.4).
  subroutine generic_force(family, workspace, u, force)
    class(family_type), intent(in) :: family     !! as its bonds are now
    type(generic_workspace_type), intent(in) :: workspace  !! with the pulls at `u`
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    real(wp), intent(inout), contiguous :: force(:, :)  !! (n_slots, dim) set for all slots [N/m3]
    type(bonds_type) :: bonds
    real(wp) :: y(3), square, pull, sums(3)
    integer(i8) :: b
    integer :: k, i, j, c

    !$omp parallel default(none) shared(family, workspace, u, force) &
    !$omp private(bonds, y, square, pull, sums, b, k, i, j, c)
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      sums = 0.0_wp
      if (workspace%start(k + 1) > workspace%start(k)) call family%bonds_of(k, bonds)
      do i = 1, int(workspace%start(k + 1) - workspace%start(k))
        if (.not. bonds%intact(i)) cycle
        j = bonds%j(i)
        b = workspace%start(k) + i - 1
        pull = workspace%pull(b) + workspace%pull(workspace%start(j) + workspace%back(b) - 1)
        square = 0.0_wp
        do c = 1, size(u, 2)
          y(c) = bonds%xi(i, c) + u(j, c) - u(k, c)
          square = square + y(c)**2
        end do
        ! a bond crushed to a point has no direction
        if (.not. square > 0.0_wp) cycle
        pull = pull*bonds%weight(i)/sqrt(square)
        do c = 1, size(u, 2)
          sums(c) = sums(c) + pull*y(c)
        end do
      end do
      do c = 1, size(u, 2)
        force(k, c) = sums(c)
      end do
    end do
    !$omp end parallel
  end subroutine generic_force

  !> A workspace that was made for another family is an error of the program.
  subroutine check_room(family, workspace)
    class(family_type), intent(in) :: family
    type(generic_workspace_type), intent(in) :: workspace

    if (.not. allocated(workspace%start)) call internal_fault('laws that have not begun')
    if (size(workspace%start) /= family%n_slots + 1) &
      & call internal_fault('a workspace of another family')
  end subroutine check_room

  ! ---------------------------------------------------------------- energies, bounds, history

  !> Strain energy density of all slots.
  subroutine generic_energy(family, model, workspace, u, energy)
    class(family_type), intent(in) :: family     !! as its bonds are now
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(in) :: workspace  !! with the history
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    real(wp), intent(inout), contiguous :: energy(:)  !! (n_slots) set for all slots [J/m3]
    type(bonds_type) :: bonds
    type(law_bonds_type) :: seen
    integer :: k

    call check_room(family, workspace)
    !$omp parallel default(none) shared(family, model, workspace, u, energy) private(bonds, seen, k)
    call allocate_bonds(family, bonds)
    call new_law_bonds(family, model, seen)
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      energy(k) = 0.0_wp
      if (workspace%start(k + 1) == workspace%start(k)) cycle
      call family%bonds_of(k, bonds)
      call look(model, workspace, u, k, bonds, seen)
      energy(k) = model%laws(model%material(k))%law%energy(seen)
    end do
    !$omp end parallel
  end subroutine generic_energy

  !> Strain energy density of one slot [J/m3].
  pure real(wp) function generic_point_energy(family, model, workspace, u, k, bonds) result(energy)
    class(family_type), intent(in) :: family     !! the family
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(in) :: workspace  !! with the history
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    integer, intent(in) :: k                     !! slot
    type(bonds_type), intent(in) :: bonds        !! of slot `k`
    type(law_bonds_type) :: seen

    call new_law_bonds(family, model, seen)
    call look(model, workspace, u, k, bonds, seen)
    energy = model%laws(model%material(k))%law%energy(seen)
  end function generic_point_energy

  !> The strain energy density of one slot with the products of the stretches under `u` and `other`
  !> in place of their squares; of laws with a history, whose energy is no form of the stretches
  !> alone, that under `u` [J/m3].
  pure real(wp) function generic_energy_product(family, model, workspace, u, other, k, bonds) &
    & result(energy)
    class(family_type), intent(in) :: family     !! the family
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(in) :: workspace  !! with the history
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    real(wp), intent(in), contiguous :: other(:, :)
      !! (n_slots, dim) displacements of another instant [m]
    integer, intent(in) :: k                     !! slot
    type(bonds_type), intent(in) :: bonds        !! of slot `k`
    type(law_bonds_type) :: seen
    real(wp) :: stretch(bonds%n), stretch_of_other(bonds%n)

    associate (law => model%laws(model%material(k))%law)
      if (law%bond_history + law%point_history > 0) then
        energy = generic_point_energy(family, model, workspace, u, k, bonds)
        return
      end if
      call new_law_bonds(family, model, seen)
      call look(model, workspace, other, k, bonds, seen)
      stretch_of_other = seen%stretch(:bonds%n)
      call look(model, workspace, u, k, bonds, seen)
      stretch = seen%stretch(:bonds%n)
      ! Q(a, b) = Q((a + b)/2) - Q((a - b)/2) of a quadratic form Q
      seen%stretch(:bonds%n) = (stretch + stretch_of_other)/2
      energy = law%energy(seen)
      seen%stretch(:bonds%n) = (stretch - stretch_of_other)/2
      energy = energy - law%energy(seen)
    end associate
  end function generic_energy_product

  !> Dilatation of one slot by its law [-].
  pure real(wp) function generic_point_dilatation(family, model, workspace, u, k, bonds) result(theta)
    class(family_type), intent(in) :: family     !! the family
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(in) :: workspace  !! with the history
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    integer, intent(in) :: k                     !! slot
    type(bonds_type), intent(in) :: bonds        !! of slot `k`
    type(law_bonds_type) :: seen

    call new_law_bonds(family, model, seen)
    call look(model, workspace, u, k, bonds, seen)
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
    call look(model, workspace, u, k, bonds, seen)
    damage = damage_seen(model, k, bonds, seen)
  end function generic_point_damage

  pure real(wp) function damage_seen(model, k, bonds, seen) result(damage)
    type(model_type), intent(in) :: model
    integer, intent(in) :: k
    type(bonds_type), intent(in) :: bonds
    type(law_bonds_type), intent(in) :: seen
    real(wp) :: lost(seen%n)

    lost = 0.0_wp
    associate (law => model%laws(model%material(k))%law)
      if (law%softens) call law%bond_damage(seen, lost)
    end associate
    where (.not. bonds%intact(:seen%n)) lost = 1.0_wp
    damage = 0.0_wp
    if (seen%n > 0) damage = sum(lost*bonds%weight(:seen%n))/sum(bonds%weight(:seen%n))
  end function damage_seen

  !> M_k of every slot: the sum of the bounds that both ends give each bond, times vc V_j. Twice of it
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
      bonds%intact = .true.
      call look(model, workspace, undeformed, k, bonds, seen)
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
        bound(k) = bound(k) + (own(b) + own(workspace%start(bonds%j(i)) + workspace%back(b) - 1)) &
          & *bonds%weight(i)
      end do
    end do
    !$omp end parallel
  end subroutine generic_bound

  !> Bring the history of all points and bonds to the present state, after an accepted step, and
  !> local damage with it where a law softens.
  subroutine commit_laws(body, family, model, workspace, u, damage, dissipated)
    type(body_type), intent(in) :: body          !! its volumes
    class(family_type), intent(in) :: family     !! as its bonds are now
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(inout) :: workspace  !! gets the new history
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    real(wp), intent(inout), contiguous :: damage(:)
      !! (n_slots) brought up to date, of size 0 if nothing can be damaged [-]
    real(wp), intent(out) :: dissipated          !! what the laws dissipated since the last call [J]
    type(bonds_type) :: bonds
    type(law_bonds_type) :: seen
    real(wp), allocatable :: density(:)
    integer :: k

    dissipated = 0.0_wp
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
        call look(model, workspace, u, k, bonds, seen)
        call law%commit(seen, density(k))
        if (size(seen%history, 1) > 0) workspace%history(:, first:last) = seen%history(:, :seen%n)
        workspace%of_point(:, k) = seen%of_point
        if (law%softens .and. size(damage) > 0) damage(k) = damage_seen(model, k, bonds, seen)
      end associate
    end do
    !$omp end parallel
    dissipated = inner(body%order, density, body%volume)
  end subroutine commit_laws

  !> Keep the history, or put it back.
  subroutine keep_laws(archive, workspace)
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    type(generic_workspace_type), intent(inout) :: workspace  !! set where the archive reads

    if (.not. allocated(workspace%start)) return
    call archive%keep('history of bonds', workspace%history)
    call archive%keep('history of points', workspace%of_point)
  end subroutine keep_laws

end module pd_force_generic
