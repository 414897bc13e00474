!> The bound M of a lattice's stiffness, summed from the weights of its blocks: the same number as
!> from the bonds one by one, `lanes` slots at a time.
module pd_force_bound
  use pd_base_kinds, only: wp, i8
  use pd_base_lanes, only: lanes
  use pd_body_body, only: body_type, share_halo
  use pd_family_lattice, only: lattice_family_type, grid_at
  use pd_force_model, only: model_type, t_of
  use pd_force_weights, only: allocate_weights, block_weights, half_of
  use pd_force_workspace, only: lattice_workspace_type, weights_type
  implicit none (type, external)
  private
  public :: lattice_bound, lattice_printed_bound

contains

  !> M_k of every slot [N/m4] (doc/theory.md, the time step), as if no bond were broken. Weights of
  !> either sign count with their size.
  subroutine lattice_bound(body, family, model, workspace, bound)
    type(body_type), intent(in) :: body              !! arranged in the slots of the family
    type(lattice_family_type), intent(in) :: family  !! the family
    type(model_type), intent(in) :: model            !! that the weights were made for
    type(lattice_workspace_type), intent(in) :: workspace  !! with its weights
    real(wp), intent(inout), contiguous :: bound(:)  !! (n_slots) M_k, 0 for dead slots [N/m4]
    type(weights_type) :: scratch, half
    real(wp), allocatable :: inverse(:)
    integer :: b, pass

    allocate (inverse(family%n_slots), source=0.0_wp)
    bound = 0.0_wp
    do pass = merge(1, 2, model%dilatation), 2
      !$omp parallel default(none) shared(family, model, workspace, bound, inverse, pass) &
      !$omp private(scratch, half, b)
      call allocate_weights(family, model, scratch)
      !$omp do schedule(static)
      do b = 1, size(family%block)
        if (workspace%weights(b) > 0) then
          call add_block(family, model, pass, b, workspace%table(workspace%weights(b)), half, &
            & inverse, bound)
        else
          call block_weights(family, model, family%block(b), scratch)
          call add_block(family, model, pass, b, scratch, half, inverse, bound)
        end if
      end do
      !$omp end parallel
      if (pass == 1) call share_halo(body, inverse)
    end do
  end subroutine lattice_bound

  !> One block of the `pass`; `half` is room for half of it, if it is long.
  pure subroutine add_block(family, model, pass, b, weights, half, inverse, bound)
    type(lattice_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    integer, intent(in) :: pass, b
    type(weights_type), intent(in) :: weights
    type(weights_type), intent(inout) :: half
    real(wp), intent(inout), contiguous :: inverse(:), bound(:)
    integer :: l

    if (.not. family%mixed) then
      call add(model, pass, family%block(b), weights, inverse, bound)
      return
    end if
    do l = 0, family%block_length - lanes, lanes
      call half_of(family, weights, l, half)
      call add(model, pass, family%block(b) + l, half, inverse, bound)
    end do
  end subroutine add_block

  !> Pass 1: m_k I_k of `lanes` slots into `inverse`; pass 2: their M_k.
  pure subroutine add(model, pass, first, weights, inverse, bound)
    type(model_type), intent(in) :: model
    integer, intent(in) :: pass
    integer(i8), intent(in) :: first
    type(weights_type), intent(in) :: weights
    real(wp), intent(inout), contiguous :: inverse(:), bound(:)
    real(wp) :: sums(lanes), own(lanes), inverse_length
    integer(i8) :: j
    integer :: m, l

    sums = 0.0_wp
    own = inverse(first:first + lanes - 1)
    do m = 1, weights%n
      inverse_length = sqrt(weights%geometry(4, m))
      if (pass == 1) then
        sums = sums + abs(weights%dilatation(:, m))*inverse_length
        cycle
      end if
      sums = sums + abs(weights%stretch(:, m))*weights%geometry(4, m)
      if (.not. model%dilatation) cycle
      j = first + weights%shift(m)
      sums = sums + (own + inverse(j:j + lanes - 1))*abs(weights%dilatation(:, m))*inverse_length
    end do
    if (pass == 2) then
      bound(first:first + lanes - 1) = sums
      return
    end if
    do l = 1, lanes
      associate (m => model%materials(model%material(first + l - 1)))
        inverse(first + l - 1) = sums(l)*2*max(m%a, 0.0_wp)*t_of(model, int(first) + l - 1)**2
      end associate
    end do
  end subroutine add

  !> The sum of 7.25 as printed for every slot [N/m4]: no surface factors, a with its sign, and
  !> everything of the slot's own material.
  subroutine lattice_printed_bound(family, model, printed)
    type(lattice_family_type), intent(in) :: family    !! the family
    type(model_type), intent(in) :: model              !! materials of the slots
    real(wp), intent(inout), contiguous :: printed(:)  !! (n_slots) the sum of each slot [N/m4]
    real(wp), allocatable :: inverse(:)
    integer :: b, l, pass

    allocate (inverse(family%n_slots), source=0.0_wp)
    printed = 0.0_wp
    !$omp parallel default(none) shared(family, model, printed, inverse) private(b, l, pass)
    do pass = 1, 2
      !$omp do schedule(static)
      do b = 1, size(family%block)
        do l = 0, family%block_length - lanes, lanes
          call add_printed(family, model, pass, family%block(b) + l, inverse, printed)
        end do
      end do
    end do
    !$omp end parallel
  end subroutine lattice_printed_bound

  !> Pass 1: the sum I of `lanes` slots into `inverse`; pass 2: their share of 7.25.
  pure subroutine add_printed(family, model, pass, first, inverse, printed)
    type(lattice_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    integer, intent(in) :: pass
    integer(i8), intent(in) :: first
    real(wp), intent(inout), contiguous :: inverse(:), printed(:)
    real(wp) :: sums(lanes), own(lanes), weight, there
    integer(i8) :: j
    integer :: o, l

    do l = 1, lanes
      associate (m => model%materials(model%material(first + l - 1)))
        own(l) = 2*m%a*m%t**2
      end associate
    end do
    sums = 0.0_wp
    associate (grid => family%grids(grid_at(family, first)), alive => family%alive)
      do o = 1, grid%n
        weight = grid%fraction(o)*grid%cell_volume/grid%length(o)
        j = first + grid%shift(o)
        do l = 0, lanes - 1
          there = weight*real(alive(first + l)*alive(j + l), wp)
          if (pass == 2) there = there*(own(l + 1)*(inverse(first + l) + inverse(j + l)) &
            & + 2*model%materials(model%material(first + l))%q)
          sums(l + 1) = sums(l + 1) + there
        end do
      end do
    end associate
    if (pass == 1) inverse(first:first + lanes - 1) = sums
    if (pass == 2) printed(first:first + lanes - 1) = sums
  end subroutine add_printed

end module pd_force_bound
