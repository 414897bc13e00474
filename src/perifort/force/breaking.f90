!> Bond breaking. The fast loops only say which slots are strained to the limit; what breaks is
!> decided here, by one formula that gives both ends of a bond the same bits.
module pd_force_breaking
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_order, only: ascending_order, owns
  use pd_base_reduce, only: add_point, count_of_ranks, largest_of_ranks, new_running, &
    & running_type, total_of_running
  use pd_base_lanes, only: lanes
  use pd_body_body, only: body_type
  use pd_family_family, only: family_type, bonds_type, allocate_bonds
  use pd_law_material, only: never
  use pd_force_generic_bonds, only: refresh_slot
  use pd_force_generic_points, only: generic_energy_product, generic_point_damage, &
    & generic_energy_of_work
  use pd_force_model, only: model_type, bond_limit, follows
  use pd_force_reference, only: energies_of_loss, point_damage, stretch_of_bond
  use pd_force_workspace, only: generic_workspace_type
  implicit none (type, external)
  private
  public :: strained_slots, break_bonds, add_followed, cut_followers, damage_of, find_weakest, &
    & stretch_ratios

contains

  !> The slots marked by a pass over the body.
  subroutine strained_slots(strained, slots)
    integer(i1), intent(in) :: strained(:)
      !! (n_slots) 1 for marked slots, else 0; of size 0 if no bond can break
    integer(i4), allocatable, intent(out) :: slots(:)  !! (any number) the marked ones, ascending
    integer :: k, n

    n = 0
    !$omp parallel do schedule(static) default(none) shared(strained) private(k) reduction(+:n)
    do k = 1, size(strained)
      n = n + strained(k)
    end do
    allocate (slots(n))
    if (n == 0) return
    n = 0
    do k = 1, size(strained)
      if (strained(k) == 0_i1) cycle
      n = n + 1
      slots(n) = int(k, i4)
    end do
  end subroutine strained_slots

  !> Break the bonds of `slots` that are beyond their limit at displacements `u`, and count the
  !> strain energy that is lost: at fixed `u`, and, for each set of `others`, with the products of
  !> the stretches and dilatations under `u` and under that set in place of the squares
  !> (doc/theory.md, 9).
  subroutine break_bonds(body, family, model, u, slots, damage, broken, dissipated, others, &
    & products, laws, part, level, expansions)
    type(body_type), intent(in) :: body          !! its volumes [m3]
    class(family_type), intent(inout) :: family  !! with the bonds broken at both ends on return
    type(model_type), intent(in) :: model        !! limits of the bonds, and the strain energy
    real(wp), intent(in), contiguous :: u(:, :)  !! displacements (n_slots, dim) [m]
    integer(i4), allocatable, intent(inout) :: slots(:)  !! to be checked, ascending;
                                                         !! then those that lost a bond
    real(wp), intent(inout) :: damage(:)  !! brought up to date (n_slots) [-]
    integer(i8), intent(out) :: broken    !! how many bonds broke, each counted once
    real(wp), intent(out) :: dissipated   !! energy lost at fixed u [J]
    real(wp), allocatable, intent(in), optional :: others(:, :, :)
      !! (n_slots, dim, sets) other displacements, read at `slots` and at the ends of their bonds
      !! alone [m]
    real(wp), intent(out), optional :: products(:)     !! energy lost with each set of them [J]
    type(generic_workspace_type), intent(inout), optional :: laws
      !! of the generic pass, where the model is generic; knows the broken bonds on return
    real(wp), intent(in), optional :: part
      !! of its limit, beyond which a bond breaks; 1 by default [-]
    integer, intent(in), optional :: level
      !! of substeps: bonds of this level alone break; all by default
    real(wp), allocatable, intent(in), optional :: expansions(:, :)
      !! (n_slots, sets) thermal strains with each set of `others`; absent or not allocated: those
      !! of the model [-]
    type(bonds_type) :: bonds
    real(wp), allocatable :: lost(:, :), before(:), after(:)
    logical, allocatable :: gone(:), loses(:)
    real(wp) :: of_limit
    integer, allocatable :: number(:), first(:), order(:)
    type(running_type) :: running
    real(wp) :: totals(6)
    logical :: breaks, together
    integer :: g, m, k, i, sets, only

    only = -1
    if (present(level)) only = level
    of_limit = 1.0_wp
    if (present(part)) of_limit = part
    sets = 0
    if (present(others)) sets = size(others, 3)
    allocate (lost(size(slots), 0:sets), before(0:sets), after(0:sets), source=0.0_wp)
    allocate (number(size(slots)), source=0)
    call group_slots(slots, first)
    if (model%followers) call find_losers(family, model, u, slots, of_limit, loses)
    together = family%bytes_are_shared()
    !$omp parallel default(none) &
    !$omp shared(body, family, model, u, others, slots, damage, lost, number, first, laws) &
    !$omp shared(of_limit, only, expansions, loses) &
    !$omp firstprivate(before, after) private(bonds, gone, g, m, k, i, breaks) if(.not. together)
    call allocate_bonds(family, bonds)
    allocate (gone(family%most_bonds))
    !$omp do schedule(dynamic, 4)
    do g = 1, size(first) - 1
      do m = first(g), first(g + 1) - 1
        k = slots(m)
        call family%bonds_of(k, bonds)
        do i = 1, bonds%n
          call decide(model, u, k, bonds, i, of_limit, breaks)
          if (model%followers) breaks = breaks .or. goes_along(model, k, bonds, i, loses)
          if (breaks .and. only >= 0) &
            & breaks = family%level_of_bond(k, int(bonds%j(i))) == only
          gone(i) = breaks
          if (.not. breaks) cycle
          number(m) = number(m) + 1
          call family%break_bond(k, i)
        end do
        if (number(m) == 0) cycle
        if (model%generic) then
          call energies(family, model, laws, u, k, before, others, expansions)
          call family%bonds_of(k, bonds)
          call refresh_slot(k, bonds, laws)
          call energies(family, model, laws, u, k, after, others, expansions)
          damage(k) = generic_point_damage(family, model, laws, u, k, bonds)
        else
          call energies_of_loss(model, u, k, bonds, gone, before, after, others, expansions)
          call family%bonds_of(k, bonds)
          damage(k) = point_damage(bonds)
        end if
        lost(m, :) = (before - after)*body%volume(k)
      end do
    end do
    !$omp end parallel
    broken = count_of_ranks(body%order, sum(int(number, i8), mask=owns(body%order, &
      & body%point(slots))))/2_i8
    order = ascending_order(body%point(slots))
    call new_running(running)
    do i = 1, size(order)
      m = order(i)
      call add_point(body%order, body%point(slots(m)), lost(m, :), running)
    end do
    totals = total_of_running(body%order, running)
    dissipated = totals(1)
    if (present(products)) products = totals(2:sets + 1)
    slots = pack(slots, number > 0)
  end subroutine break_bonds

  !> Which slots lose a bond at displacements `u` by themselves.
  subroutine find_losers(family, model, u, slots, part, loses)
    class(family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    integer(i4), intent(in) :: slots(:)           ! the slots that may
    real(wp), intent(in) :: part                  ! of its limit, beyond which a bond breaks
    logical, allocatable, intent(out) :: loses(:)
    type(bonds_type) :: bonds
    logical :: breaks
    integer :: m, i

    allocate (loses(family%n_slots), source=.false.)
    !$omp parallel default(none) shared(family, model, u, slots, part, loses) &
    !$omp private(bonds, breaks, m, i)
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 16)
    do m = 1, size(slots)
      call family%bonds_of(int(slots(m)), bonds)
      do i = 1, bonds%n
        call decide(model, u, int(slots(m)), bonds, i, part, breaks)
        if (.not. breaks) cycle
        loses(slots(m)) = .true.
        exit
      end do
    end do
    !$omp end parallel
  end subroutine find_losers

  !> Whether the `i`-th bond of slot `k` breaks because one of its ends loses another; in a no-fail
  !> zone none does.
  pure logical function goes_along(model, k, bonds, i, loses)
    type(model_type), intent(in) :: model
    integer, intent(in) :: k
    type(bonds_type), intent(in) :: bonds
    integer, intent(in) :: i
    logical, intent(in) :: loses(:)
    real(wp) :: lower, upper

    goes_along = .false.
    if (.not. bonds%intact(i)) return
    if (.not. (loses(k) .or. loses(bonds%j(i)))) return
    if (.not. follows(model, k, i)) return
    goes_along = .true.
    if (.not. model%breaking) return
    call bond_limit(model, k, int(bonds%j(i)), lower, upper)
    goes_along = upper < never
  end function goes_along

  !> Add the other ends of the bonds that break along with those of `slots` at displacements `u`:
  !> `break_bonds` must look at them, too.
  subroutine add_followed(family, model, u, slots, part)
    class(family_type), intent(in) :: family     !! with its intact bonds
    type(model_type), intent(in) :: model        !! limits of the bonds, and their weights
    real(wp), intent(in), contiguous :: u(:, :)  !! displacements (n_slots, dim) [m]
    integer(i4), allocatable, intent(inout) :: slots(:)
      !! all with a bond beyond its limit, ascending; more of them on return
    real(wp), intent(in), optional :: part
      !! of its limit, beyond which a bond breaks; 1 by default [-]
    type(bonds_type) :: bonds
    logical, allocatable :: loses(:), there(:)
    real(wp) :: of_limit
    integer :: m, i, k

    if (.not. model%followers) return
    of_limit = 1.0_wp
    if (present(part)) of_limit = part
    call find_losers(family, model, u, slots, of_limit, loses)
    allocate (there(family%n_slots), source=.false.)
    there(slots) = .true.
    call allocate_bonds(family, bonds)
    do m = 1, size(slots)
      if (.not. loses(slots(m))) cycle
      call family%bonds_of(int(slots(m)), bonds)
      do i = 1, bonds%n
        if (goes_along(model, int(slots(m)), bonds, i, loses)) there(bonds%j(i)) = .true.
      end do
    end do
    slots = pack([(int(k, i4), k=1, size(there))], there)
  end subroutine add_followed

  !> Cut the bonds that break with others only, where cracks have cut another bond of either end.
  subroutine cut_followers(body, family, model, cut)
    type(body_type), intent(in) :: body          !! arranged in the slots of the family
    class(family_type), intent(inout) :: family  !! after all cuts; less bonds on return
    type(model_type), intent(in) :: model        !! weights of the bonds
    integer(i8), intent(out) :: cut              !! bonds that this has cut, each counted once
    type(bonds_type) :: bonds
    logical, allocatable :: loses(:)
    integer :: k, i

    cut = 0_i8
    if (.not. model%followers) return
    allocate (loses(family%n_slots), source=.false.)
    call allocate_bonds(family, bonds)
    do k = 1, family%n_slots
      if (body%point(k) == 0) cycle
      call family%bonds_of(k, bonds)
      do i = 1, bonds%n
        loses(k) = loses(k) .or. .not. (bonds%intact(i) .or. follows(model, k, i))
      end do
    end do
    do k = 1, family%n_slots
      if (body%point(k) == 0) cycle
      call family%bonds_of(k, bonds)
      do i = 1, bonds%n
        if (.not. goes_along(model, k, bonds, i, loses)) cycle
        call family%break_bond(k, i)
        if (bonds%j(i) > k) cut = cut + 1
      end do
    end do
  end subroutine cut_followers

  !> Energy density of slot `k` by the generic pass [J/m3], with what has been dissipated since the
  !> last commit: as it is, and with the products of each set of `others`.
  pure subroutine energies(family, model, laws, u, k, density, others, expansions)
    class(family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(generic_workspace_type), intent(in), optional :: laws
    real(wp), intent(in), contiguous :: u(:, :)        !! displacements (n_slots, dim) [m]
    integer, intent(in) :: k
    real(wp), intent(out) :: density(0:)               !! (0:sets) [J/m3]
    real(wp), intent(in), optional :: others(:, :, :)  !! (n_slots, dim, sets) [m]
    real(wp), intent(in), optional :: expansions(:, :)  !! (n_slots, sets) [-]
    integer :: o

    if (.not. present(laws)) call internal_fault('bonds of laws break without their history')
    density(0) = generic_energy_of_work(family, model, laws, u, k)
    do o = 1, ubound(density, 1)
      if (present(expansions)) then
        density(o) = generic_energy_product(family, model, laws, u, others(:, :, o), k, &
          & expansions(:, o))
      else
        density(o) = generic_energy_product(family, model, laws, u, others(:, :, o), k)
      end if
    end do
  end subroutine energies

  !> Ascending slots in groups that one thread must work on: those whose bonds may share a byte. The
  !> slots of group g are `slots(first(g):first(g+1) - 1)`.
  pure subroutine group_slots(slots, first)
    integer(i4), intent(in) :: slots(:)
    integer, allocatable, intent(out) :: first(:)
    integer :: m, n, group, last

    allocate (first(size(slots) + 1))
    n = 0
    last = -1
    do m = 1, size(slots)
      group = (slots(m) - 1)/lanes
      if (group == last) cycle
      last = group
      n = n + 1
      first(n) = m
    end do
    first(n + 1) = size(slots) + 1
    first = first(:n + 1)
  end subroutine group_slots

  !> Where the strength of bonds scatters: the smallest critical stretch of each slot's bonds, and
  !> of all, by which the loops choose the bonds to check.
  subroutine find_weakest(body, family, model)
    type(body_type), intent(in) :: body        !! arranged in the slots of the family
    class(family_type), intent(in) :: family   !! whole
    type(model_type), intent(inout) :: model   !! gets `weakest` and a new `least_critical`
    type(bonds_type) :: bonds
    real(wp) :: lower, upper
    integer :: k, i

    if (.not. allocated(model%number)) return
    allocate (model%weakest(family%n_slots), source=never)
    !$omp parallel default(none) shared(family, model) private(bonds, lower, upper, k, i)
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      call family%bonds_of(k, bonds)
      do i = 1, bonds%n
        if (follows(model, k, i)) cycle
        call bond_limit(model, k, int(bonds%j(i)), lower, upper)
        model%weakest(k) = min(model%weakest(k), upper)
      end do
    end do
    !$omp end parallel
    model%least_critical = -largest_of_ranks(body%order, -minval(model%weakest))
  end subroutine find_weakest

  !> Whether the `i`-th bond of slot `k` is beyond `part` of its limit.
  pure subroutine decide(model, u, k, bonds, i, part, breaks)
    type(model_type), intent(in) :: model
    real(wp), intent(in) :: u(:, :)
    integer, intent(in) :: k
    type(bonds_type), intent(in) :: bonds
    integer, intent(in) :: i
    real(wp), intent(in) :: part
    logical, intent(out) :: breaks
    real(wp) :: lower, upper, stretch

    breaks = .false.
    if (.not. bonds%intact(i)) return
    if (follows(model, k, i)) return
    call bond_limit(model, k, int(bonds%j(i)), lower, upper)
    stretch = stretch_of_bond(model, u, k, bonds, i)
    ! parts of limits that are never reached may be beyond all numbers
    breaks = .false.
    if (upper < never) breaks = stretch > part*upper
    if (lower > -never) breaks = breaks .or. stretch < part*lower
  end subroutine decide

  !> The largest mechanical stretch over its limit of the intact bonds of every slot: 0 where none
  !> is stretched, both ends of a bond with the same bits.
  subroutine stretch_ratios(family, model, u, ratios)
    class(family_type), intent(in) :: family     !! with its intact bonds
    type(model_type), intent(in) :: model        !! with bonds that can break
    real(wp), intent(in), contiguous :: u(:, :)  !! displacements (n_slots, dim) [m]
    real(wp), intent(out) :: ratios(:)           !! (n_slots) [-]
    type(bonds_type) :: bonds
    real(wp) :: stretch, lower, upper
    integer :: k, i

    !$omp parallel default(none) shared(family, model, u, ratios) &
    !$omp private(bonds, stretch, lower, upper, k, i)
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 64)
    do k = 1, family%n_slots
      ratios(k) = 0.0_wp
      call family%bonds_of(k, bonds)
      do i = 1, bonds%n
        if (.not. bonds%intact(i)) cycle
        if (follows(model, k, i)) cycle
        call bond_limit(model, k, int(bonds%j(i)), lower, upper)
        if (.not. upper < never) cycle
        stretch = stretch_of_bond(model, u, k, bonds, i)
        ratios(k) = max(ratios(k), stretch/upper)
        if (lower > -never) ratios(k) = max(ratios(k), stretch/lower)
      end do
    end do
    !$omp end parallel
  end subroutine stretch_ratios

  !> Local damage of every slot [-].
  subroutine damage_of(body, family, damage)
    type(body_type), intent(in) :: body       !! arranged in the slots of the family
    class(family_type), intent(in) :: family  !! with its broken bonds, cut ones included
    real(wp), intent(out) :: damage(:)
      !! (n_slots) lost part of each family's volume, 0 for dead slots [-]
    type(bonds_type) :: bonds
    integer :: k

    !$omp parallel default(none) shared(body, family, damage) private(bonds, k)
    call allocate_bonds(family, bonds)
    !$omp do schedule(static)
    do k = 1, family%n_slots
      damage(k) = 0.0_wp
      if (body%point(k) == 0) cycle
      call family%bonds_of(k, bonds)
      damage(k) = point_damage(bonds)
    end do
    !$omp end parallel
  end subroutine damage_of

end module pd_force_breaking
