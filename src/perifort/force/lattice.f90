!> The passes over the bonds of a lattice family, `lanes` slots at a time: for each offset, the
!> bonds of the lanes to the slots that far away. A block's sums stay in registers through all its
!> offsets. Broken bonds, large strains and terms that few scenes have cost only the blocks that
!> have them.
!>
!> With e = (2 xi.eta + eta.eta)/|xi|^2, the deformed length is |xi| sqrt(1 + e), the stretch
!> s = sqrt(1 + e) - 1 and |xi|/|xi+eta| = r = 1/sqrt(1 + e). The force needs s r = 1 - r, which for
!> |e| <= 0.02 is e h(e) with a polynomial h (relative error 3e-16): no root, no division, and no
!> cancellation. Bonds that are strained further are left to the general formulas, each by its own
!> strain, so that no bond is added twice or undone.
!>
!> In 3D each bond is computed once, from the end whose slot comes first, and added to both ends. In
!> 2D and 1D that costs more than it saves: what was just added to a row cannot be loaded again at
!> once, and there are few other rows to turn to.
module pd_force_lattice
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_family_lattice, only: lattice_family_type, weights_type, grid_at, both_ends, lanes, &
    & word_bits
  use pd_force_general, only: general_dilatation, general_force, general_energy
  use pd_force_model, only: model_type
  use pd_force_weights, only: block_weights, allocate_weights
  implicit none (type, external)
  private
  public :: lattice_dilatation, lattice_force, lattice_energy

  !> Limit and coefficients of h: (1 - 1/sqrt(1 + e))/e = 1/2 - 3/8 e + e^2 (Chebyshev interpolation
  !> of the rest).
  real(wp), parameter :: small_strain = 0.02_wp
  real(wp), parameter :: h0 = 0.5_wp, h1 = -0.375_wp, h2 = 0.31250000000037114_wp, &
    & h3 = -0.27343750000352559_wp, h4 = 0.24609373329889834_wp, h5 = -0.22558592163388049_wp, &
    & h6 = 0.20958398402647260_wp, h7 = -0.19648637700069084_wp

  !> Room of one thread.
  type :: scratch_type
    type(weights_type) :: weights           !! of a block that shares none
    real(wp), allocatable :: left(:, :)     !! weights of bonds that the fast loop left out
  end type scratch_type

contains

  !> p_k = 2 a d delta theta_k of all slots; marks strained slots where bonds can break, and keeps
  !> in `family%large` which blocks the fast formula doesn't serve.
  subroutine lattice_dilatation(family, model, u, p, strained)
    type(lattice_family_type), intent(inout) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: p(:)
    integer(i1), intent(inout), contiguous :: strained(:)
    type(scratch_type) :: scratch
    real(wp) :: limit
    logical :: both
    integer :: b, s, k, colour

    both = both_ends(family%dim)
    limit = fast_limit(model)
    !$omp parallel default(none) shared(family, model, u, p, strained, both, limit) &
    !$omp private(scratch, b, s, k, colour)
    allocate (scratch%left(lanes, family%most_bonds))
    if (both) then
      !$omp do simd schedule(static)
      do k = 1, size(p)
        p(k) = 0.0_wp
      end do
    end if
    call clear(strained)
    do colour = 1, 2
      !$omp do schedule(static)
      do s = family%slabs%colour(colour), family%slabs%colour(colour + 1) - 1
        do b = family%slabs%first(s), family%slabs%first(s + 1) - 1
          if (shared_weights(family, b, both)) then
            call dilatation_of_block(family, model, both, limit, b, &
              & family%table(family%weights(b)), scratch%left, u, p, strained)
          else
            call weights_now(family, model, b, scratch%weights)
            call dilatation_of_block(family, model, both, limit, b, scratch%weights, scratch%left, &
              & u, p, strained)
          end if
        end do
      end do
    end do
    if (both) then
      !$omp do schedule(static)
      do k = 1, size(p), lanes
        call scale(model, int(k, i8), p)
      end do
    end if
    !$omp end parallel
  end subroutine lattice_dilatation

  !> Force density of all slots (n_slots, dim) [N/m3]. With a dilatation this follows
  !> `lattice_dilatation` at the same displacements.
  subroutine lattice_force(family, model, u, p, force, strained)
    type(lattice_family_type), intent(inout) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(inout), contiguous :: force(:, :)
    integer(i1), intent(inout), contiguous :: strained(:)
    type(scratch_type) :: scratch
    real(wp) :: limit
    logical :: both
    integer :: b, c, s, k, colour

    both = both_ends(family%dim)
    limit = fast_limit(model)
    !$omp parallel default(none) shared(family, model, u, p, force, strained, both, limit) &
    !$omp private(scratch, b, c, s, k, colour)
    allocate (scratch%left(lanes, family%most_bonds))
    if (both) then
      do c = 1, size(force, 2)
        !$omp do simd schedule(static)
        do k = 1, size(force, 1)
          force(k, c) = 0.0_wp
        end do
        !$omp end do simd nowait
      end do
    end if
    call clear(strained)
    do colour = 1, 2
      !$omp do schedule(static)
      do s = family%slabs%colour(colour), family%slabs%colour(colour + 1) - 1
        do b = family%slabs%first(s), family%slabs%first(s + 1) - 1
          if (shared_weights(family, b, both)) then
            call force_of_block(family, model, both, limit, b, family%table(family%weights(b)), &
              & scratch%left, u, p, force, strained)
          else
            call weights_now(family, model, b, scratch%weights)
            call force_of_block(family, model, both, limit, b, scratch%weights, scratch%left, u, &
              & p, force, strained)
          end if
        end do
      end do
    end do
    !$omp end parallel
  end subroutine lattice_force

  !> Strain energy density of all slots [J/m3].
  subroutine lattice_energy(family, model, u, energy)
    type(lattice_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(out), contiguous :: energy(:)
    type(weights_type) :: scratch
    integer :: b

    energy = 0.0_wp
    !$omp parallel default(none) shared(family, model, u, energy) private(scratch, b)
    !$omp do schedule(static)
    do b = 1, size(family%block)
      if (shared_weights(family, b, .false.)) then
        call general_energy(model, family%table(family%weights(b)), family%block(b), u, energy)
      else
        call weights_now(family, model, b, scratch)
        call general_energy(model, scratch, family%block(b), u, energy)
      end if
    end do
    !$omp end parallel
  end subroutine lattice_energy

  !> p from theta of the lanes at `first`.
  pure subroutine scale(model, first, p)
    type(model_type), intent(in) :: model
    integer(i8), intent(in) :: first
    real(wp), intent(inout), contiguous :: p(:)
    real(wp) :: factor
    integer(i8) :: k

    if (size(model%materials) == 1) then
      factor = model%materials(1)%p*model%materials(1)%t
      p(first:first + lanes - 1) = factor*p(first:first + lanes - 1)
      return
    end if
    do k = first, first + lanes - 1
      associate (m => model%materials(model%material(k)))
        p(k) = m%p*m%t*p(k)
      end associate
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

  !> Bonds with |e| below this are served by the fast formulas; 0: none.
  pure real(wp) function fast_limit(model) result(limit)
    type(model_type), intent(in) :: model

    limit = small_strain
    ! with the tensile limit s, |e| reaches (1 + s)^2 - 1; in compression 1 - (1 - s)^2 is less
    if (model%breaking) limit = min(small_strain, &
      & model%least_critical*(2 - model%least_critical)*(1 - 1.0e-9_wp))
    if (model%thermal .or. (model%dilatation .and. .not. model%projected)) limit = 0.0_wp
  end function fast_limit

  !> Whether the block can take the weights it shares with others: it has some, and no broken bond
  !> (with `forward` among those alone that lie forward).
  pure logical function shared_weights(family, b, forward)
    type(lattice_family_type), intent(in) :: family
    integer, intent(in) :: b
    logical, intent(in) :: forward
    integer :: w
    integer(i8) :: first, any_broken, bits

    shared_weights = family%weights(b) > 0
    if (.not. (shared_weights .and. allocated(family%broken))) return
    first = family%block(b)
    any_broken = 0_i8
    associate (grid => family%grids(grid_at(family, first)))
      do w = 1, size(grid%forward_bits)
        bits = iany(family%broken(first:first + lanes - 1, w))
        if (forward) bits = iand(bits, grid%forward_bits(w))
        any_broken = ior(any_broken, bits)
      end do
    end associate
    shared_weights = any_broken == 0_i8
  end function shared_weights

  !> The weights of a block as its bonds are now, those of broken bonds 0.
  pure subroutine weights_now(family, model, b, weights)
    type(lattice_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    integer, intent(in) :: b
    type(weights_type), intent(inout) :: weights
    integer :: m, o, w, l, n
    integer(i8) :: first, bit
    real(wp) :: intact(lanes)

    first = family%block(b)
    if (.not. allocated(weights%offset)) call allocate_weights(family, model, weights)
    if (family%weights(b) > 0) then
      associate (shared => family%table(family%weights(b)))
        n = shared%n
        weights%n = n
        weights%n_forward = shared%n_forward
        weights%offset(:n) = shared%offset
        weights%shift(:n) = shared%shift
        weights%geometry(:, :n) = shared%geometry
        weights%stretch(:, :n) = shared%stretch
        if (model%dilatation) weights%dilatation(:, :n) = shared%dilatation
      end associate
    else
      call block_weights(family, model, first, weights)
    end if
    if (.not. allocated(family%broken)) return
    do m = 1, weights%n
      o = weights%offset(m)
      w = (o - 1)/word_bits + 1
      do l = 1, lanes
        bit = iand(ishft(family%broken(first + l - 1, w), -mod(o - 1, word_bits)), 1_i8)
        intact(l) = real(1_i8 - bit, wp)
      end do
      weights%stretch(:, m) = weights%stretch(:, m)*intact
      if (model%dilatation) weights%dilatation(:, m) = weights%dilatation(:, m)*intact
    end do
  end subroutine weights_now

  !> p of one block; where loops add to both ends of a bond, theta of its bonds added to `p`.
  subroutine dilatation_of_block(family, model, both, limit, b, weights, left, u, p, strained)
    type(lattice_family_type), intent(inout) :: family
    type(model_type), intent(in) :: model
    logical, intent(in) :: both
    real(wp), intent(in) :: limit
    integer, intent(in) :: b
    type(weights_type), intent(in) :: weights
    real(wp), intent(inout), contiguous :: left(:, :), p(:)
    real(wp), intent(in), contiguous :: u(:, :)
    integer(i1), intent(inout), contiguous :: strained(:)
    integer(i8) :: first
    integer :: n
    logical :: missed

    first = family%block(b)
    n = weights%n
    if (both) n = weights%n_forward
    missed = limit <= 0.0_wp
    if (.not. missed) then
      ! constant dimensions, so that each has code of its own
      select case (family%dim)
      case (3)
        call fast_dilatation_3(n, weights%dilatation, weights%shift, weights%geometry, first, &
          & family%n_slots, u, limit, p, left, missed)
      case (2)
        call fast_dilatation_2(n, weights%dilatation, weights%shift, weights%geometry, first, &
          & family%n_slots, u, limit, p, left, missed)
      case default
        call fast_dilatation_1(n, weights%dilatation, weights%shift, weights%geometry, first, &
          & family%n_slots, u, limit, p, left, missed)
      end select
    end if
    if (missed .and. both .and. limit > 0.0_wp) then
      call general_dilatation(model, both, n, weights, left, first, u, p, strained)
    else if (missed) then
      if (.not. both) p(first:first + lanes - 1) = 0.0_wp
      call general_dilatation(model, both, n, weights, weights%dilatation, first, u, p, strained)
    end if
    family%large(b) = merge(1_i1, 0_i1, missed)
    if (.not. both) call scale(model, first, p)
  end subroutine dilatation_of_block

  !> Forces of one block's bonds, added to `force`.
  subroutine force_of_block(family, model, both, limit, b, weights, left, u, p, force, strained)
    type(lattice_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    logical, intent(in) :: both
    real(wp), intent(in) :: limit
    integer, intent(in) :: b
    type(weights_type), intent(in) :: weights
    real(wp), intent(inout), contiguous :: left(:, :), force(:, :)
    real(wp), intent(in), contiguous :: u(:, :), p(:)
    integer(i1), intent(inout), contiguous :: strained(:)
    integer(i8) :: first
    integer :: n
    logical :: fast, missed

    first = family%block(b)
    n = weights%n
    if (both) n = weights%n_forward
    fast = limit > 0.0_wp
    if (model%dilatation) fast = family%large(b) == 0_i1
    missed = .not. fast
    if (fast) then
      select case (family%dim)
      case (3)
        call fast_force_3(model%dilatation, n, weights%dilatation, weights%stretch, weights%shift, &
          & weights%geometry, first, family%n_slots, u, p, limit, force, left, missed)
      case (2)
        call fast_force_2(model%dilatation, n, weights%dilatation, weights%stretch, weights%shift, &
          & weights%geometry, first, family%n_slots, u, p, limit, force, left, missed)
      case default
        call fast_force_1(model%dilatation, n, weights%dilatation, weights%stretch, weights%shift, &
          & weights%geometry, first, family%n_slots, u, p, limit, force, left, missed)
      end select
    end if
    if (missed .and. both .and. fast) then
      call general_force(model, both, n, weights, left, first, u, p, force, strained)
    else if (missed) then
      if (.not. both) force(first:first + lanes - 1, :) = 0.0_wp
      call general_force(model, both, n, weights, weights%stretch, first, u, p, force, strained)
    end if
  end subroutine force_of_block

  ! One text for all dimensions, and code of its own for each: the dimension must be a constant
  ! where the loops are compiled.

  subroutine fast_dilatation_1(n, weight, shift, geometry, first, n_slots, u, limit, theta, left, &
    & missed)
    integer, parameter :: dim = 1
    logical, parameter :: both = .false.
    include 'fast_dilatation.inc'
  end subroutine fast_dilatation_1

  subroutine fast_dilatation_2(n, weight, shift, geometry, first, n_slots, u, limit, theta, left, &
    & missed)
    integer, parameter :: dim = 2
    logical, parameter :: both = .false.
    include 'fast_dilatation.inc'
  end subroutine fast_dilatation_2

  subroutine fast_dilatation_3(n, weight, shift, geometry, first, n_slots, u, limit, theta, left, &
    & missed)
    integer, parameter :: dim = 3
    logical, parameter :: both = .true.
    include 'fast_dilatation.inc'
  end subroutine fast_dilatation_3

  subroutine fast_force_1(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 1
    logical, parameter :: both = .false.
    include 'fast_force.inc'
  end subroutine fast_force_1

  subroutine fast_force_2(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 2
    logical, parameter :: both = .false.
    include 'fast_force.inc'
  end subroutine fast_force_2

  subroutine fast_force_3(dilatation, n, weight, stretch, shift, geometry, first, n_slots, u, p, &
    & limit, force, left, missed)
    integer, parameter :: dim = 3
    logical, parameter :: both = .true.
    include 'fast_force.inc'
  end subroutine fast_force_3

end module pd_force_lattice
