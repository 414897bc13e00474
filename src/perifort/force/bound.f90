!> The bound M of the bonds' stiffness: from the bonds one by one, and the same number for lattices
!> from the weights of their blocks, `lanes` slots at a time.
module pd_force_bound
  use pd_base_kinds, only: wp, i8
  use pd_base_lanes, only: lanes
  use pd_body_body, only: body_type, share_halo
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  use pd_family_lattice, only: lattice_family_type, grid_at
  use pd_family_surface, only: bond_factor
  use pd_force_generic_pass, only: generic_bound
  use pd_force_model, only: bond_factors_of, model_type, q_of, t_of
  use pd_force_weights, only: allocate_weights, block_weights, half_of
  use pd_force_workspace, only: lattice_workspace_type, weights_type, workspace_type
  implicit none (type, external)
  private
  public :: stiffness_bound, lattice_printed_bound

contains

  !> M_k [N/m4] of every slot, 0 for points without bonds:
  !> sum_j [ (q_k+q_j) Gb + (m_k I_k + m_j I_j) Gd ] vc V_j/|xi|, m = 2 max(a,0) (d delta)^2,
  !> I_k = sum_l Gd vc V_l/|xi|. The step sqrt(2 rho/M) and the relaxation's mass come from it.
  subroutine stiffness_bound(body, family, model, workspace, bound)
    type(body_type), intent(in) :: body       !! arranged in the slots of the family
    class(family_type), intent(in) :: family  !! whole; broken bonds count as if they were intact
    type(model_type), intent(in) :: model     !! with surface factors, if there are any
    type(workspace_type), intent(in) :: workspace  !! of this family and model
    real(wp), intent(inout), contiguous :: bound(:)  !! (n_slots) M_k [N/m4]
    type(bonds_type) :: bonds
    real(wp), allocatable :: inverse(:)
    real(wp) :: n(body%dim)
    integer :: k, i, j

    if (model%generic) then
      call generic_bound(family, model, workspace%generic, bound)
      return
    end if
    select type (family)
    type is (lattice_family_type)
      ! the weights hold all that is needed, unless they are not made yet
      if (allocated(workspace%lattice%table)) then
        call lattice_bound(body, family, model, workspace%lattice, bound)
        return
      end if
    class default  ! below, bond by bond, which suits any family
      continue
    end select
    allocate (inverse(body%n_slots), source=0.0_wp)
    if (model%dilatation) then
      !$omp parallel default(none) shared(body, family, model, inverse) private(bonds, n, k, i, j)
      call allocate_bonds(family, bonds)
      !$omp do schedule(dynamic, 256)
      do k = 1, body%n_slots
        if (body%point(k) == 0) cycle
        call family%bonds_of(k, bonds)
        do i = 1, bonds%n
          j = bonds%j(i)
          n = bonds%xi(i, :)/bonds%length(i)
          inverse(k) = inverse(k) + factor_size(model, k, i, j, bonds%length(i), n, .true.) &
            & *bonds%weight(i)/bonds%length(i)
        end do
        associate (m => model%materials(model%material(k)))
          inverse(k) = inverse(k)*2*max(m%a, 0.0_wp)*t_of(model, k)**2
        end associate
      end do
      !$omp end parallel
      call share_halo(body, inverse)
    end if
    !$omp parallel default(none) shared(body, family, model, bound, inverse) &
    !$omp private(bonds, n, k, i, j)
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 256)
    do k = 1, body%n_slots
      bound(k) = 0.0_wp
      if (body%point(k) == 0) cycle
      call family%bonds_of(k, bonds)
      do i = 1, bonds%n
        j = bonds%j(i)
        n = bonds%xi(i, :)/bonds%length(i)
        bound(k) = bound(k) + ((q_of(model, k) + q_of(model, j)) &
          & *factor_size(model, k, i, j, bonds%length(i), n, .false.) &
          & + (inverse(k) + inverse(j))*factor_size(model, k, i, j, bonds%length(i), n, .true.)) &
          & *bonds%weight(i)/bonds%length(i)
      end do
    end do
    !$omp end parallel
  end subroutine stiffness_bound

  !> The size of all factors of the `i`-th bond of slot `k`, to slot `j`: that by which the law
  !> weighs it, and its surface factor or consistent weight.
  pure real(wp) function factor_size(model, k, i, j, length, n, of_dilatation) result(factor)
    type(model_type), intent(in) :: model
    integer, intent(in) :: k, i, j
    real(wp), intent(in) :: length, n(:)      !! |xi| [m] and direction
    logical, intent(in) :: of_dilatation      !! Gd, else Gb

    factor = law_factor(model, k, j, length, of_dilatation)
    if (model%consistent) then
      factor = factor*bond_size(model, k, i, of_dilatation)
    else if (model%surface .and. of_dilatation) then
      factor = factor*abs(bond_factor(n, model%D(k, :), model%D(j, :), model%axes))
    else if (model%surface) then
      factor = factor*abs(bond_factor(n, model%S(k, :), model%S(j, :), model%axes))
    end if
  end function factor_size

  !> The size of the consistent weight of the `i`-th bond of slot `k`.
  pure real(wp) function bond_size(model, k, i, of_dilatation) result(weight)
    type(model_type), intent(in) :: model
    integer, intent(in) :: k, i
    logical, intent(in) :: of_dilatation

    associate (place => model%weights%before(k) + i)
      weight = abs(merge(model%weights%Gd(place), model%weights%Gb(place), of_dilatation))
    end associate
  end function bond_size

  !> The size of a law's factor of a bond: that of the dilatation or of the stretch.
  pure real(wp) function law_factor(model, k, j, length, of_dilatation) result(factor)
    type(model_type), intent(in) :: model
    integer, intent(in) :: k, j
    real(wp), intent(in) :: length
    logical, intent(in) :: of_dilatation
    real(wp) :: gb, gd

    factor = 1.0_wp
    if (.not. model%weighted) return
    call bond_factors_of(model, k, j, length, gb, gd)
    factor = abs(merge(gd, gb, of_dilatation))
  end function law_factor

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
