!> Substeps (doc/theory.md, 5): bonds of finer levels give their impulses more often than those of
!> coarser ones. A step is one of level 0; in it level n has 2^n substeps.
!>
!> Each bond has a level, and so has the dilatation of each point (`give_levels` of the composite
!> family). At an instant some levels are due, the finest always. Their forces stand in the state as
!> those of any instant; at the beginning of a step, where all are due, these are the forces of the
!> body. What impulses of coarser levels have beside them, over the shortest substep, is `beyond` of
!> the system.
module pd_motion_explicit_substeps
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i1, i4
  use pd_family_composite, only: composite_family_type
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_force_composite, only: composite_dilatation, composite_force
  use pd_force_lattice, only: lattice_force
  use pd_force_model, only: force_options_type, options_of, p_of
  use pd_force_reference, only: point_dilatation, point_force
  use pd_motion_conditions, only: impose
  use pd_motion_system, only: break_marked, bring_temperature, pairing_type, renew_conditions, &
    & settle_account, system_type
  implicit none (type, external)
  private
  public :: evaluate_level, level_due

contains

  !> The coarsest level that is due at the `n`-th substep of the finest one within a step.
  pure integer function level_due(levels, n)
    integer, intent(in) :: levels  !! the finest level
    integer, intent(in) :: n       !! from 0 to 2^levels - 1
    level_due = levels - min(levels, trailz(n))
  end function level_due

  !> What `evaluate` of `pd_motion_system` does at an instant without substeps, for the levels from
  !> `level` on: impose at time `t`, break bonds, each level's with its own pairing, dilatation,
  !> forces.
  subroutine evaluate_level(system, t, level, pairings)
    type(system_type), intent(inout) :: system
      !! with levels; gets imposed motion, broken bonds and forces of this instant
    real(wp), intent(in) :: t        !! of this instant [s]
    integer, intent(in) :: level     !! the coarsest that is due
    type(pairing_type), intent(in) :: pairings(0:)  !! (levels) for the energy of bonds that break
    type(force_options_type) :: options
    integer(i4), allocatable :: slots(:)
    logical :: early, late

    early = system%model%breaking .and. .not. system%break_late
    late = system%model%breaking .and. system%break_late
    if (late) call settle_account(system)
    call renew_conditions(system, t)
    call impose(system%motions, t, system%state%u, system%state%v)
    call bring_temperature(system, t)
    system%time = t
    options = options_of(system%model)
    if (options%dilatation) then
      call begin_parts(system, level, system%levels + 1)
      call dilatation_of_due(system, options, level)
      if (early) then
        call break_levels(system, t, level, pairings, slots)
        call renew_dilatation(system, level, slots)
      end if
    end if
    call forces_of_due(system, options, level)
    if (early .and. .not. options%dilatation) then
      call break_levels(system, t, level, pairings, slots)
      call renew_forces(system, level, slots)
    end if
    if (late) call break_levels(system, t, level, pairings, slots)
    ! whoever else computes forces takes all blocks
    call begin_parts(system, 0, system%levels + 1)
  end subroutine evaluate_level

  !> Have the passes take the parts of the lattice's blocks from `first` to `last`.
  pure subroutine begin_parts(system, first, last)
    type(system_type), intent(inout) :: system
    integer, intent(in) :: first, last

    system%workspace%lattice%due = int([first, last], i1)
    system%workspace%lattice%onto = .false.
  end subroutine begin_parts

  !> Break bonds of the levels that are due; `slots` are those that lost some, one for each level.
  subroutine break_levels(system, t, level, pairings, slots)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: t
    integer, intent(in) :: level
    type(pairing_type), intent(in) :: pairings(0:)
    integer(i4), allocatable, intent(out) :: slots(:)
    integer(i4), allocatable :: some(:)
    integer :: l

    allocate (slots(0))
    do l = level, system%levels
      call break_marked(system, t, pairings(l), some, l)
      slots = [slots, some]
    end do
  end subroutine break_levels

  !> p of the points whose level is due, 0 of others.
  subroutine dilatation_of_due(system, options, level)
    type(system_type), intent(inout) :: system
    type(force_options_type), intent(in) :: options
    integer, intent(in) :: level
    integer :: k

    select type (family => system%family)
    type is (composite_family_type)
      call composite_dilatation(family, system%model, options, system%workspace, system%state%u, &
        & system%state%p, system%strained)
      if (level == 0) return
      do k = 1, family%n_slots
        if (family%own_level(k) < level) system%state%p(k) = 0.0_wp
      end do
    class default
      call internal_fault('substeps without a composite family')
    end select
  end subroutine dilatation_of_due

  !> Dilatation of some slots again, after they lost bonds.
  subroutine renew_dilatation(system, level, slots)
    type(system_type), intent(inout) :: system
    integer, intent(in) :: level
    integer(i4), intent(in) :: slots(:)
    type(bonds_type) :: bonds
    integer :: m, k

    if (size(slots) == 0) return
    call allocate_bonds(system%family, bonds)
    select type (family => system%family)
    type is (composite_family_type)
      do m = 1, size(slots)
        k = slots(m)
        if (family%own_level(k) < level) cycle
        call family%bonds_of(k, bonds)
        system%state%p(k) = p_of(system%model, k) &
          & *point_dilatation(system%model, system%state%u, k, bonds)
      end do
    class default
      call internal_fault('substeps without a composite family')
    end select
  end subroutine renew_dilatation

  !> The forces of the levels that are due, and `beyond`. The sum of all levels so far, S, is taken
  !> after each pass: with w_l shortest substeps in one of level l, beyond is the sum of
  !> (w_l - w_{l+1}) S_l.
  subroutine forces_of_due(system, options, level)
    type(system_type), intent(inout) :: system
    type(force_options_type), intent(in) :: options
    integer, intent(in) :: level
    real(wp), allocatable :: p(:), others(:, :)
    integer :: l, k

    system%goes_beyond = level < system%levels
    select type (family => system%family)
    type is (composite_family_type)
      associate (state => system%state, lattice => system%workspace%lattice)
        if (system%goes_beyond .and. options%dilatation) then
          ! dilatations of coarser levels give impulses over their own steps in bonds of finer ones;
          ! the marks of these passes are made anew below
          allocate (p, source=state%p)
          do k = 1, family%n_slots
            l = family%own_level(k)
            if (l < system%levels .and. l >= level) p(k) = 2.0_wp**(system%levels - l)*p(k)
          end do
          allocate (others, mold=state%force)
          call begin_parts(system, system%levels, system%levels)
          call lattice_force(family%lattice, system%model, options, lattice, state%u, p, others, &
            & system%strained)
          call add(system%beyond, 1.0_wp, others, .true.)
          call lattice_force(family%lattice, system%model, options, lattice, state%u, state%p, &
            & others, system%strained)
          call add(system%beyond, -1.0_wp, others, .false.)
        end if
        do l = level, system%levels - 1
          call begin_parts(system, l, l)
          lattice%onto = l > level
          call lattice_force(family%lattice, system%model, options, lattice, state%u, state%p, &
            & state%force, system%strained)
          call add(system%beyond, 2.0_wp**(system%levels - l - 1), state%force, &
            & l == level .and. .not. options%dilatation)
        end do
        call begin_parts(system, system%levels, system%levels + 1)
        lattice%onto = system%goes_beyond
        call composite_force(family, system%model, options, system%workspace, state%u, state%p, &
          & state%force, system%strained)
      end associate
    class default
      call internal_fault('substeps without a composite family')
    end select
  end subroutine forces_of_due

  !> Forces of some slots again, after they lost bonds, where there is no dilatation.
  subroutine renew_forces(system, level, slots)
    type(system_type), intent(inout) :: system
    integer, intent(in) :: level
    integer(i4), intent(in) :: slots(:)
    type(bonds_type) :: bonds
    logical, allocatable :: intact(:)
    real(wp) :: force(system%body%dim)
    integer, allocatable :: of_bond(:)
    integer :: m, k, i, l

    if (size(slots) == 0) return
    call allocate_bonds(system%family, bonds)
    do m = 1, size(slots)
      k = slots(m)
      call system%family%bonds_of(k, bonds)
      of_bond = [(system%family%level_of_bond(k, int(bonds%j(i))), i=1, bonds%n)]
      intact = bonds%intact(:bonds%n)
      system%state%force(k, :) = 0.0_wp
      system%beyond(k, :) = 0.0_wp
      do l = level, system%levels
        bonds%intact(:bonds%n) = intact .and. of_bond == l
        force = point_force(system%model, system%state%u, system%state%p, k, bonds)
        system%state%force(k, :) = system%state%force(k, :) + force
        system%beyond(k, :) = system%beyond(k, :) + (2**(system%levels - l) - 1)*force
      end do
    end do
  end subroutine renew_forces

  !> values = values + factor others, or factor others at the `first` time.
  subroutine add(values, factor, others, first)
    real(wp), intent(inout), contiguous :: values(:, :)
    real(wp), intent(in) :: factor
    real(wp), intent(in), contiguous :: others(:, :)
    logical, intent(in) :: first
    integer :: c, k

    ! factors are powers of 2: the product has no rounding of its own
    do c = 1, size(values, 2)
      if (first) then
        !$omp parallel do simd schedule(static) default(none) shared(values, factor, others, c) &
        !$omp private(k)
        do k = 1, size(values, 1)
          values(k, c) = factor*others(k, c)
        end do
      else
        !$omp parallel do simd schedule(static) default(none) shared(values, factor, others, c) &
        !$omp private(k)
        do k = 1, size(values, 1)
          values(k, c) = values(k, c) + factor*others(k, c)
        end do
      end if
    end do
  end subroutine add

end module pd_motion_explicit_substeps
