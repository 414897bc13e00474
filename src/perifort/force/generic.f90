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
  use pd_force_model, only: early, force_options_type, has_scales, model_type, options_of
  use pd_force_reference, only: point_damage
  use pd_force_workspace, only: generic_workspace_type
  use pd_law_law, only: allocate_law_bonds, law_bonds_type
  implicit none (type, external)
  private
  public :: begin_laws, generic_pulls, generic_force, renew_pulls, generic_energy, generic_bound
  public :: commit_laws, generic_point_energy, generic_point_dilatation, generic_point_damage
  public :: generic_energy_product, keep_laws, new_law_bonds, refresh_bonds, refresh_slot
  public :: has_plasticity

contains

  !> What the laws take from the whole family, before cracks are cut: scales of the points on the
  !> fast loops, or constants of the points and room for the pulls and histories of the generic
  !> pass.
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
      workspace%x = body%x
      call allocate_bonds(family, bonds)
      n = 1_i8
      do k = 1, family%n_slots
        workspace%start(k) = n
        call family%bonds_of(k, bonds)
        n = n + bonds%n
      end do
      workspace%start(family%n_slots + 1) = n
      allocate (workspace%member(n - 1), workspace%volume(n - 1))
      call find_other_ends(family, workspace)
      call refresh_bonds(family, workspace)
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

  !> Where each bond stands in the family of its other end. The bonds of j in the order of
  !> their other ends belong, one by one, to the slots that have a bond to j, in their order.
  subroutine find_other_ends(family, workspace)
    class(family_type), intent(in) :: family
    type(generic_workspace_type), intent(inout) :: workspace
    type(bonds_type) :: bonds
    integer, allocatable :: order(:)
    integer(i4), allocatable :: met(:)
    integer(i2), allocatable :: sorted(:)
    integer :: k, i, j

    allocate (workspace%partner(workspace%start(family%n_slots + 1) - 1))
    allocate (sorted(size(workspace%partner, kind=i8)))
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
        workspace%member(workspace%start(k) + i - 1) = int(j, i4)
        workspace%partner(workspace%start(k) + i - 1) = workspace%start(j) &
          & + sorted(workspace%start(j) + met(j)) - 1
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

  !> Note which bonds are intact.
  subroutine refresh_bonds(family, workspace)
    class(family_type), intent(in) :: family      !! as its bonds are now
    type(generic_workspace_type), intent(inout) :: workspace  !! begun; gets the volumes of bonds
    type(bonds_type) :: bonds
    integer :: k

    if (.not. allocated(workspace%start)) return
    !$omp parallel default(none) shared(family, workspace) private(bonds, k)
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      call family%bonds_of(k, bonds)
      call refresh_slot(k, bonds, workspace)
    end do
    !$omp end parallel
  end subroutine refresh_bonds

  !> Note which bonds of slot `k` are intact.
  pure subroutine refresh_slot(k, bonds, workspace)
    integer, intent(in) :: k                !! slot
    type(bonds_type), intent(in) :: bonds   !! its bonds as they are now
    type(generic_workspace_type), intent(inout) :: workspace  !! begun; gets the volumes of bonds

    workspace%volume(workspace%start(k):workspace%start(k + 1) - 1) = &
      & merge(bonds%weight(:bonds%n), 0.0_wp, bonds%intact(:bonds%n))
  end subroutine refresh_slot

  !> The bonds of slot `k` at displacements `u` as its law sees them, with the committed history.
  pure subroutine gather_bonds(model, options, workspace, u, k, seen)
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(generic_workspace_type), intent(in) :: workspace
    real(wp), intent(in), contiguous :: u(:, :)
    integer, intent(in) :: k
    type(law_bonds_type), intent(inout) :: seen
    integer(i8) :: first, last
    integer :: n

    first = workspace%start(k)
    last = workspace%start(k + 1) - 1
    n = int(last - first) + 1
    seen%n = n
    seen%volume(:n) = workspace%volume(first:last)
    call deform(size(u, 1), size(u, 2), n, workspace%member(first:last), workspace%x, u, k, &
      & options%projected, seen%length, seen%stretch, seen%projection)
    if (.not. options%projected) seen%projection(:n) = 1.0_wp
    if (options%thermal) seen%stretch(:n) = seen%stretch(:n) - (model%expansion(k) &
      & + model%expansion(workspace%member(first:last)))/2
    if (model%surface) call correct(model, workspace, k, seen)
    if (size(seen%history, 1) > 0) seen%history(:, :n) = workspace%history(:, first:last)
    seen%of_point = workspace%of_point(:, k)
    seen%constants = workspace%constants(:, k)
  end subroutine gather_bonds

  !> Lengths, stretches without cancellation (doc/theory.md, 2) and, if `projected`, Lambda.
  pure subroutine deform(n_slots, dim, n, member, x, u, k, projected, length, stretch, projection)
    integer, intent(in) :: n_slots, dim, n, k
    integer(i4), intent(in) :: member(n)
    real(wp), intent(in) :: x(n_slots, dim), u(n_slots, dim)
    logical, intent(in) :: projected
    real(wp), intent(inout) :: length(n), stretch(n), projection(n)
    real(wp) :: along(n), xi, eta
    integer :: i, c

    length = 0.0_wp
    stretch = 0.0_wp
    along = 0.0_wp
    do c = 1, dim
      do i = 1, n
        xi = x(member(i), c) - x(k, c)
        eta = u(member(i), c) - u(k, c)
        length(i) = length(i) + xi**2
        along(i) = along(i) + xi*eta
        stretch(i) = stretch(i) + eta**2
      end do
    end do
    do i = 1, n
      stretch(i) = 2*along(i) + stretch(i)
    end do
    if (projected) then
      do i = 1, n
        projection(i) = (length(i) + along(i))/max(sqrt(max(length(i) + stretch(i), 0.0_wp) &
          & *length(i)), tiny(1.0_wp))
      end do
    end if
    do i = 1, n
      stretch(i) = stretch(i)/(length(i) + sqrt(max(length(i) + stretch(i), 0.0_wp)*length(i)))
      length(i) = sqrt(length(i))
    end do
  end subroutine deform

  !> Surface factors of the bonds of slot `k`.
  pure subroutine correct(model, workspace, k, seen)
    type(model_type), intent(in) :: model
    type(generic_workspace_type), intent(in) :: workspace
    integer, intent(in) :: k
    type(law_bonds_type), intent(inout) :: seen
    real(wp) :: direction(model%dim)
    integer :: i, j

    do i = 1, seen%n
      j = workspace%member(workspace%start(k) + i - 1)
      direction = (workspace%x(j, :) - workspace%x(k, :))/seen%length(i)
      seen%Gd(i) = bond_factor(direction, model%D(k, :), model%D(j, :))
      seen%Gb(i) = bond_factor(direction, model%S(k, :), model%S(j, :))
    end do
  end subroutine correct

  ! ---------------------------------------------------------------- forces

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

  !> The strain energy density of one slot with the products of the stretches under `u` and `other`
  !> in place of their squares; of laws with a history, whose energy is no form of the stretches
  !> alone, that under `u` [J/m3].
  pure real(wp) function generic_energy_product(family, model, workspace, u, other, k) &
    & result(energy)
    class(family_type), intent(in) :: family     !! the family
    type(model_type), intent(in) :: model        !! with its laws
    type(generic_workspace_type), intent(in) :: workspace  !! with the history
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    real(wp), intent(in), contiguous :: other(:, :)
      !! (n_slots, dim) displacements of another instant [m]
    integer, intent(in) :: k                     !! slot
    type(law_bonds_type) :: seen
    real(wp), allocatable :: stretch(:), stretch_of_other(:)
    integer :: n

    associate (law => model%laws(model%material(k))%law)
      if (law%bond_history + law%point_history > 0) then
        energy = generic_point_energy(family, model, workspace, u, k)
        return
      end if
      n = int(workspace%start(k + 1) - workspace%start(k))
      call new_law_bonds(family, model, seen)
      call gather_bonds(model, options_of(model), workspace, other, k, seen)
      stretch_of_other = seen%stretch(:n)
      call gather_bonds(model, options_of(model), workspace, u, k, seen)
      stretch = seen%stretch(:n)
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

end module pd_force_generic
