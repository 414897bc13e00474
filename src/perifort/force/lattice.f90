!> The passes over the bonds of a lattice family, `lanes` slots at a time: for each offset, the
!> bonds of the lanes to the slots that far away. A block's sums stay in registers through all its
!> offsets. Broken bonds, large strains and terms that few scenes have cost only the blocks that
!> have them.
!>
!> Bonds that are strained beyond the range of the fast formulas (`pd_force_fast`) are left to the
!> general formulas, each by its own strain, so that no bond is added twice or undone.
!>
!> In 3D and 2D each bond is computed once, from the end whose slot comes first, and added to both
!> ends. In 1D, and in 2D with bonds in single precision, that costs more than it saves: what was
!> just added to a row cannot be loaded again at once, and there are few other rows to turn to.
!>
!> In mixed precision blocks are twice as long, and the fast loops compute a block's bonds in single
!> precision; what they leave is computed in double, one half of a block after the other.
module pd_force_lattice
  use pd_base_kinds, only: wp, sp, i1, i8
  use pd_base_lanes, only: lanes, word_bits
  use pd_family_lattice, only: lattice_family_type, grid_at, both_ends
  use pd_force_fast, only: fast_dilatation, fast_force, fast_energy
  use pd_force_general, only: general_dilatation, general_force, general_energy
  use pd_force_mixed, only: mixed_dilatation, mixed_force
  use pd_force_model, only: dilatation_of, force_options_type, model_type, options_of, p_of, t_of
  use pd_force_polynomial, only: fast_limit, fast_terms, narrow, wide, single
  use pd_force_singles, only: split_displacements, round_dilatation, clear_sums, add_sums
  use pd_force_weights, only: prepare_blocks, weights_now, half_of
  use pd_force_workspace, only: all_blocks, early_blocks, late_blocks, lattice_workspace_type, &
    & singles_type, weights_type
  implicit none (type, external)
  private
  public :: lattice_dilatation, lattice_force, lattice_energy

  !> Room of one thread.
  type :: scratch_type
    real(wp), allocatable :: left(:, :, :)      !! weights of bonds that the fast loops left out
                                                !! (lane, offset, range)
    real(sp), allocatable :: single_left(:, :)  !! those of the loops in mixed precision
    type(weights_type) :: half                  !! half of a block's weights, in double precision
  end type scratch_type

contains

  !> p_k = 2 a d delta theta_k of all slots; marks strained slots where bonds can break, and keeps
  !> in `formulas_used` of the workspace which fast formulas each block has used.
  subroutine lattice_dilatation(family, model, options, workspace, u, p, strained, blocks)
    type(lattice_family_type), intent(in) :: family  !! the family
    type(model_type), intent(in) :: model            !! that the weights were made for
    type(force_options_type), intent(in) :: options  !! what the forces take in
    type(lattice_workspace_type), intent(inout) :: workspace
      !! with weights of this model; `formulas_used` and what is in single precision are set
    real(wp), intent(in), contiguous :: u(:, :)      !! (n_slots, dim) displacements [m]
    real(wp), intent(inout), contiguous :: p(:)
      !! (n_slots) 2 a d delta theta, set for all slots [N/m5]
    integer(i1), intent(inout), contiguous :: strained(:)
      !! (n_slots) 1 for slots with a bond nearly at its limit, of size 0 if none can break
    integer, intent(in), optional :: blocks
      !! `early_blocks`, then, in a call of its own, `late_blocks`; `all_blocks` if absent
    type(scratch_type) :: scratch
    type(weights_type) :: own
    real(wp) :: limit(2)
    logical :: both, in_parts, begins, ends
    integer :: b, s, k, colour, colours(2)

    call prepare_blocks(family, model, workspace)
    call choose_colours(family, blocks, colours, begins, ends)
    both = both_ends(family%dim, family%mixed)
    limit = fast_limits(family, model, options)
    in_parts = allocated(workspace%part)
    !$omp parallel default(none) &
    !$omp shared(family, model, options, workspace, u, p, strained, both, limit, in_parts) &
    !$omp shared(begins, ends, colours) private(scratch, own, b, s, k, colour)
    call allocate_scratch(family, scratch)
    ! once more before late blocks, which need those of copies
    if (family%mixed) call split_displacements(workspace%singles, u)
    if (family%mixed .and. both .and. begins) call clear_sums(workspace%singles, 1)
    if (both .and. begins) then
      !$omp do simd schedule(static)
      do k = 1, size(p)
        p(k) = 0.0_wp
      end do
    end if
    if (begins) call clear(strained)
    do colour = colours(1), colours(2)
      !$omp do schedule(static)
      do s = family%slabs%colour(colour), family%slabs%colour(colour + 1) - 1
        do b = family%slabs%first(s), family%slabs%first(s + 1) - 1
          if (in_parts) then
            if (.not. is_due(workspace, b)) cycle
          end if
          if (shared_weights(family, workspace, b, both)) then
            call dilatation_of_block(family, model, options, workspace%singles, both, limit, b, &
              & workspace%table(workspace%weights(b)), scratch, u, p, &
              & workspace%formulas_used(b), strained)
          else
            call weights_now(family, model, workspace, b, own)
            call dilatation_of_block(family, model, options, workspace%singles, both, limit, b, &
              & own, scratch, u, p, workspace%formulas_used(b), strained)
          end if
        end do
      end do
    end do
    if (family%mixed .and. both .and. ends) &
      & call add_sums(workspace%singles, 1, workspace%singles%volume, p)
    if (both .and. ends) then
      !$omp do schedule(static)
      do k = 1, size(p), lanes
        call scale(model, int(k, i8), p)
      end do
    end if
    !$omp end parallel
  end subroutine lattice_dilatation

  !> Force density of all slots (n_slots, dim) [N/m3]. With a dilatation this follows
  !> `lattice_dilatation` at the same displacements.
  subroutine lattice_force(family, model, options, workspace, u, p, force, strained, blocks)
    type(lattice_family_type), intent(in) :: family     !! the family
    type(model_type), intent(in) :: model               !! that the weights were made for
    type(force_options_type), intent(in) :: options
      !! what the forces take in, as for `lattice_dilatation`
    type(lattice_workspace_type), intent(inout) :: workspace
      !! with weights of this model; what is in single precision is set
    real(wp), intent(in), contiguous :: u(:, :)         !! (n_slots, dim) displacements [m]
    real(wp), intent(in), contiguous :: p(:)
      !! (n_slots) 2 a d delta theta, of size 0 without a dilatation [N/m5]
    real(wp), intent(inout), contiguous :: force(:, :)  !! (n_slots, dim) set for all slots [N/m3]
    integer(i1), intent(inout), contiguous :: strained(:)
      !! (n_slots) 1 for slots with a bond nearly at its limit, of size 0 if none can break
    integer, intent(in), optional :: blocks
      !! `early_blocks`, then, in a call of its own, `late_blocks`; `all_blocks` if absent
    type(scratch_type) :: scratch
    type(weights_type) :: own
    real(wp) :: limit(2)
    logical :: both, in_parts, fresh, ends
    integer :: b, c, s, k, colour, colours(2)

    call prepare_blocks(family, model, workspace)
    call choose_colours(family, blocks, colours, fresh, ends)
    both = both_ends(family%dim, family%mixed)
    limit = fast_limits(family, model, options)
    in_parts = allocated(workspace%part)
    if (in_parts) fresh = fresh .and. .not. workspace%onto
    !$omp parallel default(none) &
    !$omp shared(family, model, options, workspace, u, p, force, strained, both, limit, in_parts) &
    !$omp shared(fresh, ends, colours) private(scratch, own, b, c, s, k, colour)
    call allocate_scratch(family, scratch)
    if (family%mixed .and. .not. options%dilatation) call split_displacements(workspace%singles, u)
    if (family%mixed .and. options%dilatation) call round_dilatation(workspace%singles, p)
    if (family%mixed .and. both .and. colours(1) == 1) &
      & call clear_sums(workspace%singles, size(force, 2))
    if (fresh .and. (both .or. in_parts)) then
      do c = 1, size(force, 2)
        !$omp do simd schedule(static)
        do k = 1, size(force, 1)
          force(k, c) = 0.0_wp
        end do
        !$omp end do simd nowait
      end do
    end if
    if (fresh) call clear(strained)
    do colour = colours(1), colours(2)
      !$omp do schedule(static)
      do s = family%slabs%colour(colour), family%slabs%colour(colour + 1) - 1
        do b = family%slabs%first(s), family%slabs%first(s + 1) - 1
          if (in_parts) then
            if (.not. is_due(workspace, b)) cycle
          end if
          if (shared_weights(family, workspace, b, both)) then
            call force_of_block(family, model, options, workspace%singles, both, limit, b, &
              & workspace%table(workspace%weights(b)), scratch, u, p, &
              & workspace%formulas_used(b), force, strained)
          else
            call weights_now(family, model, workspace, b, own)
            call force_of_block(family, model, options, workspace%singles, both, limit, b, own, &
              & scratch, u, p, workspace%formulas_used(b), force, strained)
          end if
        end do
      end do
    end do
    if (family%mixed .and. both .and. ends) then
      do c = 1, size(force, 2)
        call add_sums(workspace%singles, c, 1.0_wp, force(:, c))
      end do
    end if
    !$omp end parallel
  end subroutine lattice_force

  !> The first and the last colour of the slabs that a pass works through, and whether it begins and
  !> ends with this call.
  pure subroutine choose_colours(family, blocks, colours, begins, ends)
    type(lattice_family_type), intent(in) :: family
    integer, intent(in), optional :: blocks
    integer, intent(out) :: colours(2)
    logical, intent(out) :: begins, ends
    integer :: which

    which = all_blocks
    if (present(blocks)) which = blocks
    begins = which /= late_blocks
    ends = which /= early_blocks
    colours = [merge(1, 3, begins), merge(4, 2, ends)]
    if (begins .and. family%slabs%colour(3) == family%slabs%colour(5)) colours(2) = 2
  end subroutine choose_colours

  !> Strain energy density of all slots [J/m3]. With `theta` that of the stretches alone, and the
  !> dilatation beside it.
  subroutine lattice_energy(family, model, workspace, u, energy, theta)
    type(lattice_family_type), intent(in) :: family  !! the family
    type(model_type), intent(in) :: model            !! that the weights were made for
    type(lattice_workspace_type), intent(inout) :: workspace  !! with weights of this model
    real(wp), intent(in), contiguous :: u(:, :)      !! (n_slots, dim) displacements [m]
    real(wp), intent(out), contiguous :: energy(:)
      !! (n_slots) of each slot, 0 for dead ones [J/m3]
    real(wp), intent(out), contiguous, optional, target :: theta(:)
      !! (n_slots) of each slot, 0 for dead ones [-]
    type(weights_type) :: own, half
    real(wp), pointer :: apart(:)
    integer :: b

    call prepare_blocks(family, model, workspace)
    energy = 0.0_wp
    apart => null()
    if (present(theta)) then
      theta = 0.0_wp
      apart => theta
    end if
    !$omp parallel default(none) shared(family, model, workspace, u, energy, apart) &
    !$omp private(own, half, b)
    !$omp do schedule(static)
    do b = 1, size(family%block)
      if (shared_weights(family, workspace, b, .false.)) then
        call energy_of_block(family, model, b, workspace%table(workspace%weights(b)), half, u, &
          & energy, apart)
      else
        call weights_now(family, model, workspace, b, own)
        call energy_of_block(family, model, b, own, half, u, energy, apart)
      end if
    end do
    !$omp end parallel
  end subroutine lattice_energy

  !> The strains up to which the fast formulas are valid: those that are tried first and, for bonds
  !> beyond them, the second; 0: none.
  pure function fast_limits(family, model, options) result(limit)
    type(lattice_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    real(wp) :: limit(2)

    limit = 0.0_wp
    if (family%mixed) then
      if (.not. options%double) limit(1) = fast_limit(model, options, single)
      return
    end if
    limit(1) = fast_limit(model, options, narrow)
    ! where bonds break at strains so small that the first are valid for all, there is no second
    limit(2) = fast_limit(model, options, wide)
    if (limit(2) <= limit(1)) limit(2) = 0.0_wp
  end function fast_limits

  !> Room of one thread for its blocks.
  pure subroutine allocate_scratch(family, scratch)
    type(lattice_family_type), intent(in) :: family
    type(scratch_type), intent(out) :: scratch

    allocate (scratch%left(lanes, family%most_bonds, 2))
    if (family%mixed) allocate (scratch%single_left(family%block_length, family%most_bonds))
  end subroutine allocate_scratch

  !> p from theta of the lanes at `first`.
  pure subroutine scale(model, first, p)
    type(model_type), intent(in) :: model
    integer(i8), intent(in) :: first
    real(wp), intent(inout), contiguous :: p(:)
    real(wp) :: factor
    integer(i8) :: k

    if (size(model%materials) == 1 .and. .not. allocated(model%scale)) then
      factor = model%materials(1)%p*model%materials(1)%t
      p(first:first + lanes - 1) = factor*p(first:first + lanes - 1)
      return
    end if
    do k = first, first + lanes - 1
      p(k) = p_of(model, int(k))*t_of(model, int(k))*p(k)
    end do
  end subroutine scale

  !> Take all marks away. Called by all threads, which then wait for each other.
  subroutine clear(strained)
    integer(i1), intent(inout), contiguous :: strained(:)
    integer :: k

    !$omp do simd schedule(static)
    do k = 1, size(strained)
      strained(k) = 0_i1
    end do
  end subroutine clear

  !> Whether the passes take block `b`, where they take some.
  pure logical function is_due(workspace, b)
    type(lattice_workspace_type), intent(in) :: workspace
    integer, intent(in) :: b
    is_due = workspace%part(b) >= workspace%due(1) .and. workspace%part(b) <= workspace%due(2)
  end function is_due

  !> Whether the block can take the weights it shares with others: it has some, and no broken bond
  !> (with `forward` among those alone that lie forward).
  pure logical function shared_weights(family, workspace, b, forward)
    type(lattice_family_type), intent(in) :: family
    type(lattice_workspace_type), intent(in) :: workspace
    integer, intent(in) :: b
    logical, intent(in) :: forward
    integer :: w
    integer(i8) :: first, any_broken, bits

    shared_weights = workspace%weights(b) > 0
    if (.not. (shared_weights .and. allocated(family%broken))) return
    first = family%block(b)
    any_broken = 0_i8
    associate (grid => family%grids(grid_at(family, first)))
      do w = 1, size(grid%forward_bits)
        bits = iany(family%broken(first:first + family%block_length - 1, w))
        if (forward) bits = iand(bits, grid%forward_bits(w))
        any_broken = ior(any_broken, bits)
      end do
    end associate
    shared_weights = any_broken == 0_i8
  end function shared_weights

  !> p of one block; where loops add to both ends of a bond, theta of its bonds added to `p`.
  !> `range` gets the range of the fast formulas that it has used, or 0.
  subroutine dilatation_of_block(family, model, options, singles, both, limit, b, weights, &
    & scratch, u, p, range, strained)
    type(lattice_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(singles_type), intent(inout) :: singles
    logical, intent(in) :: both
    real(wp), intent(in) :: limit(:)
    integer, intent(in) :: b
    type(weights_type), intent(in) :: weights
    type(scratch_type), intent(inout) :: scratch
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: p(:)
    integer(i1), intent(out) :: range
    integer(i1), intent(inout), contiguous :: strained(:)
    integer(i8) :: first, last
    integer :: n, l, formulas, kind
    logical :: missed

    kind = dilatation_of(options)
    first = family%block(b)
    last = first + family%block_length - 1
    n = weights%n
    if (both) n = weights%n_forward
    formulas = narrow
    missed = limit(1) <= 0.0_wp
    if (family%mixed) then
      call mixed_dilatation(family, singles, kind, n, limit(1), weights, first, p, &
        & scratch%single_left, missed)
    else if (.not. missed) then
      associate (dim => family%dim, m => family%n_slots, w => weights, left => scratch%left)
        call fast_dilatation(dim, narrow, kind, n, m, w%dilatation, w%shift, w%geometry, first, &
          & u, limit(1), p, left(:, :, 1), missed)
        if (missed .and. limit(2) > 0.0_wp) then
          formulas = wide
          if (both) then
            call fast_dilatation(dim, wide, kind, n, m, left(:, :, 1), w%shift, w%geometry, first, &
              & u, limit(2), p, left(:, :, 2), missed)
          else
            call fast_dilatation(dim, wide, kind, n, m, w%dilatation, w%shift, w%geometry, first, &
              & u, limit(2), p, left(:, :, 2), missed)
          end if
        end if
      end associate
    end if
    range = int(merge(0, formulas, missed), i1)
    if (missed) then
      if (.not. both) p(first:last) = 0.0_wp
      if (family%mixed) then
        do l = 0, family%block_length - lanes, lanes
          call half_of(family, weights, l, scratch%half)
          if (both) scratch%half%dilatation(:, :n) = singles%volume &
            & *scratch%single_left(l + 1:l + lanes, :n)
          call general_dilatation(model, options, both, n, scratch%half, scratch%half%dilatation, &
            & first + l, u, p, strained)
        end do
      else if (both .and. limit(1) > 0.0_wp) then
        call general_dilatation(model, options, both, n, weights, scratch%left(:, :, formulas), &
          & first, u, p, strained)
      else
        call general_dilatation(model, options, both, n, weights, weights%dilatation, first, u, p, &
          & strained)
      end if
    end if
    if (both) return
    do l = 0, family%block_length - lanes, lanes
      call scale(model, first + l, p)
    end do
  end subroutine dilatation_of_block

  !> Forces of one block's bonds, added to `force`. With a dilatation, `range` of the fast formulas
  !> is used, if that is not 0.
  subroutine force_of_block(family, model, options, singles, both, limit, b, weights, scratch, u, &
    & p, range, force, strained)
    type(lattice_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(singles_type), intent(inout) :: singles
    logical, intent(in) :: both
    real(wp), intent(in) :: limit(:)
    integer, intent(in) :: b
    type(weights_type), intent(in) :: weights
    type(scratch_type), intent(inout) :: scratch
    real(wp), intent(inout), contiguous :: force(:, :)
    real(wp), intent(in), contiguous :: u(:, :), p(:)
    integer(i1), intent(in) :: range
    integer(i1), intent(inout), contiguous :: strained(:)
    integer(i8) :: first
    integer :: n, l, formulas, kind
    logical :: fast, missed

    kind = dilatation_of(options)
    first = family%block(b)
    n = weights%n
    if (both) n = weights%n_forward
    fast = limit(1) > 0.0_wp
    formulas = narrow
    if (options%dilatation) then
      fast = range > 0_i1
      formulas = int(range)
    end if
    missed = .not. fast
    if (fast .and. family%mixed) then
      call mixed_force(family, singles, kind, n, limit(1), weights, first, force, &
        & scratch%single_left, missed)
    else if (fast) then
      associate (dim => family%dim, m => family%n_slots, w => weights, left => scratch%left)
        call fast_force(dim, formulas, kind, n, m, w%dilatation, w%stretch, w%shift, w%geometry, &
          & first, u, p, limit(1), force, left(:, :, 1), missed)
        if (missed .and. limit(2) > 0.0_wp) then
          formulas = wide
          if (both) then
            call fast_force(dim, wide, kind, n, m, w%dilatation, left(:, :, 1), w%shift, &
              & w%geometry, first, u, p, limit(2), force, left(:, :, 2), missed)
          else
            call fast_force(dim, wide, kind, n, m, w%dilatation, w%stretch, w%shift, &
              & w%geometry, first, u, p, limit(2), force, left(:, :, 2), missed)
          end if
        end if
      end associate
    end if
    if (.not. missed) return
    if (.not. both) force(first:first + family%block_length - 1, :) = 0.0_wp
    if (family%mixed) then
      do l = 0, family%block_length - lanes, lanes
        call half_of(family, weights, l, scratch%half)
        if (both .and. fast) scratch%half%stretch(:, :n) = scratch%single_left(l + 1:l + lanes, :n)
        call general_force(model, options, both, n, scratch%half, scratch%half%stretch, first + l, &
          & u, p, force, strained)
      end do
    else if (both .and. fast) then
      call general_force(model, options, both, n, weights, scratch%left(:, :, formulas), first, u, &
        & p, force, strained)
    else
      call general_force(model, options, both, n, weights, weights%stretch, first, u, p, force, &
        & strained)
    end if
  end subroutine force_of_block

  !> Strain energy density of one block; `half` is room for half of it, if it is long. The
  !> dilatation is left `apart`, if that is associated.
  subroutine energy_of_block(family, model, b, weights, half, u, energy, apart)
    type(lattice_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    integer, intent(in) :: b
    type(weights_type), intent(in) :: weights
    type(weights_type), intent(inout) :: half
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: energy(:)
    real(wp), pointer, intent(in) :: apart(:)
    integer :: l

    if (.not. family%mixed) then
      call energy_of_lanes(model, weights, family%block(b), u, energy, apart)
      return
    end if
    do l = 0, family%block_length - lanes, lanes
      call half_of(family, weights, l, half)
      call energy_of_lanes(model, half, family%block(b) + l, u, energy, apart)
    end do
  end subroutine energy_of_block

  !> Strain energy density of `lanes` slots from `first` on.
  subroutine energy_of_lanes(model, weights, first, u, energy, apart)
    type(model_type), intent(in) :: model
    type(weights_type), intent(in) :: weights
    integer(i8), intent(in) :: first
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: energy(:)
    real(wp), pointer, intent(in) :: apart(:)
    type(force_options_type) :: options
    real(wp) :: stretches(lanes), theta(lanes)
    integer :: l

    options = options_of(model)
    if (size(model%materials) > 1 .or. allocated(model%scale) .or. .not. fast_terms(options)) then
      call general_energy(model, options, weights, first, u, stretches, theta)
    else
      call fast_energy(model%dim, dilatation_of(options), weights%n, size(u, 1), &
        & weights%dilatation, weights%stretch, weights%shift, weights%geometry, first, u, &
        & stretches, theta)
    end if
    do l = 1, lanes
      associate (m => model%materials(model%material(first + l - 1)))
        if (associated(apart)) then
          energy(first + l - 1) = stretches(l)/4
          apart(first + l - 1) = t_of(model, int(first) + l - 1)*theta(l)
        else
          energy(first + l - 1) = stretches(l)/4 &
            & + m%a*(t_of(model, int(first) + l - 1)*theta(l))**2
        end if
      end associate
    end do
  end subroutine energy_of_lanes

end module pd_force_lattice
