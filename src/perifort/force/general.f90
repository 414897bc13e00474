!> The general formulas of lattice families, for any strain and with every term: roots, divisions,
!> temperature, unprojected dilatation, and the marks of strained slots.
module pd_force_general
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_lanes, only: lanes
  use pd_force_model, only: early, force_options_type, model_type, q_of
  use pd_force_workspace, only: weights_type
  implicit none (type, external)
  private
  public :: general_dilatation, general_force, general_energy, crushed, mark_slot

  !> Squared length, over the undeformed one, below which a bond is crushed to a point and has no
  !> direction but that of rounding: it pulls nowhere, rather than anywhere or NaN.
  real(wp), parameter :: crushed = 1.0e-24_wp

contains

  !> Add Gd s Lambda vc V of the first `n` offsets' bonds to `theta` (n_slots), of both ends if
  !> `both`. `weight` (lanes, n) may be less than all bonds.
  subroutine general_dilatation(model, options, both, n, weights, weight, first, u, theta, &
    & strained)
    type(model_type), intent(in) :: model  !! parameters of the slots
    type(force_options_type), intent(in) :: options  !! what the dilatation takes in
    logical, intent(in) :: both            !! add to both ends of a bond
    integer, intent(in) :: n               !! offsets whose bonds are taken, the first of the block
    type(weights_type), intent(in) :: weights  !! of the block: shifts and geometry
    real(wp), intent(in) :: weight(:, :)   !! (lanes, n) Gd vc V, 0 for bonds to be left out [m3]
    integer(i8), intent(in) :: first       !! slot of the block's first lane
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    real(wp), intent(inout), contiguous :: theta(:)  !! (n_slots) sums, added to [m3]
    integer(i1), intent(inout), contiguous :: strained(:)
      !! (n_slots) set to 1 for slots with a bond at its limit, of size 0 if none can break
    real(wp), dimension(lanes) :: s, lambda, r, share
    real(wp) :: along(lanes, 3)
    integer(i8) :: j
    integer :: m

    do m = 1, n
      call deform_block(model, options, first, weights%shift(m), weights%geometry(:, m), u, s, &
        & lambda, r, along)
      share = weight(:, m)*s*lambda
      theta(first:first + lanes - 1) = theta(first:first + lanes - 1) + share
      j = first + weights%shift(m)
      if (both) theta(j:j + lanes - 1) = theta(j:j + lanes - 1) + share
      if (model%breaking) call mark_block(model, both, first, j, s, weight(:, m), strained)
    end do
  end subroutine general_dilatation

  !> Add what the first `n` offsets' bonds pull to `force` (n_slots, dim), at both ends if `both`.
  !> `stretch` (lanes, n) may be less than all bonds.
  subroutine general_force(model, options, both, n, weights, stretch, first, u, p, force, strained)
    type(model_type), intent(in) :: model  !! parameters of the slots
    type(force_options_type), intent(in) :: options  !! what the forces take in
    logical, intent(in) :: both            !! add to both ends of a bond
    integer, intent(in) :: n               !! offsets whose bonds are taken, the first of the block
    type(weights_type), intent(in) :: weights  !! of the block: shifts, geometry and dilatation
    real(wp), intent(in) :: stretch(:, :)
      !! (lanes, n) (q_k + q_j) Gb vc V |xi|, less for bonds computed already [N/m2]
    integer(i8), intent(in) :: first       !! slot of the block's first lane
    real(wp), intent(in), contiguous :: u(:, :)  !! (n_slots, dim) displacements [m]
    real(wp), intent(in), contiguous :: p(:)
      !! (n_slots) 2 a d delta theta, of size 0 without a dilatation [N/m5]
    real(wp), intent(inout), contiguous :: force(:, :)
      !! (n_slots, dim) force density, added to [N/m3]
    integer(i1), intent(inout), contiguous :: strained(:)
      !! (n_slots) set to 1 for slots with a bond at its limit, of size 0 if none can break
    real(wp), dimension(lanes) :: s, lambda, r, magnitude
    real(wp) :: along(lanes, 3)
    integer(i8) :: j
    integer :: m, c

    do m = 1, n
      call deform_block(model, options, first, weights%shift(m), weights%geometry(:, m), u, s, &
        & lambda, r, along)
      magnitude = stretch(:, m)*s
      j = first + weights%shift(m)
      if (options%dilatation) magnitude = magnitude + (p(first:first + lanes - 1) &
        & + p(j:j + lanes - 1))*weights%dilatation(:, m)*lambda
      magnitude = magnitude*r
      do c = 1, model%dim
        along(:, c) = magnitude*along(:, c)
        force(first:first + lanes - 1, c) = force(first:first + lanes - 1, c) + along(:, c)
        if (both) force(j:j + lanes - 1, c) = force(j:j + lanes - 1, c) - along(:, c)
      end do
      if (model%breaking) call mark_block(model, both, first, j, s, stretch(:, m), strained)
    end do
  end subroutine general_force

  !> Sums of the bonds of the block at slot `first`, for its energy: (q_k + q_j) Gb s^2 |xi| vc V,
  !> with q_k twice where materials differ, and Gd s Lambda vc V.
  subroutine general_energy(model, options, weights, first, u, stretches, theta)
    type(model_type), intent(in) :: model            !! parameters of the slots
    type(force_options_type), intent(in) :: options  !! what the energy takes in
    type(weights_type), intent(in) :: weights        !! of the block, in double precision
    integer(i8), intent(in) :: first                 !! slot of the block's first lane
    real(wp), intent(in), contiguous :: u(:, :)      !! (n_slots, dim) displacements [m]
    real(wp), intent(out) :: stretches(lanes)
      !! sum of the bonds' squared stretches of each lane [J/m3]
    real(wp), intent(out) :: theta(lanes)
      !! sum of Gd s Lambda vc V of each lane, 0 without a dilatation [m3]
    real(wp), dimension(lanes) :: s, lambda, r
    real(wp) :: along(lanes, 3)
    integer(i8) :: j
    integer :: m, l

    theta = 0.0_wp
    stretches = 0.0_wp
    do m = 1, weights%n
      call deform_block(model, options, first, weights%shift(m), weights%geometry(:, m), u, s, &
        & lambda, r, along)
      if (options%dilatation) theta = theta + weights%dilatation(:, m)*s*lambda
      if (size(model%materials) > 1 .or. allocated(model%scale)) then
        ! the weights hold q_k + q_j, the energy takes q_k/2 of the slot's own material
        j = first + weights%shift(m)
        do l = 1, lanes
          associate (q => q_of(model, int(first) + l - 1))
            s(l) = s(l)*sqrt(2*q/(q + q_of(model, int(j) + l - 1)))
          end associate
        end do
      end if
      stretches = stretches + weights%stretch(:, m)*s**2
    end do
  end subroutine general_energy

  !> State of the bonds at one offset by the general formulas: mechanical stretch, Lambda,
  !> r = |xi|/|y| and the bond's direction over |xi|.
  pure subroutine deform_block(model, options, first, shift, g, u, s, lambda, r, along)
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    integer(i8), intent(in) :: first, shift
    real(wp), intent(in) :: g(4)
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(out) :: s(lanes), lambda(lanes), r(lanes), along(lanes, 3)
    real(wp) :: x(lanes), e(lanes), y(lanes), eta(lanes)
    integer(i8) :: j
    integer :: c

    j = first + shift
    x = 0.0_wp
    e = 0.0_wp
    y = 0.0_wp
    do c = 1, model%dim
      eta = u(j:j + lanes - 1, c) - u(first:first + lanes - 1, c)
      x = x + g(c)*eta
      e = e + eta**2
      along(:, c) = g(c) + g(4)*eta
      y = y + along(:, c)**2/g(4)
    end do
    e = 2*x + g(4)*e
    s = e/(1 + sqrt(y))
    r = merge(1/sqrt(max(y, crushed)), 0.0_wp, y > crushed)
    lambda = (1 + x)*r
    if (.not. options%projected) lambda = 1.0_wp
    if (options%thermal) then
      s = s - (model%expansion(first:first + lanes - 1) + model%expansion(j:j + lanes - 1))/2
    end if
  end subroutine deform_block

  !> Mark the slots of the bonds between the lanes at `first` and those at `j` that are near their
  !> critical stretch (`early`). Slots in no-fail zones lose no bond.
  pure subroutine mark_block(model, both, first, j, s, weight, strained)
    type(model_type), intent(in) :: model
    logical, intent(in) :: both
    integer(i8), intent(in) :: first, j
    real(wp), intent(in) :: s(lanes), weight(lanes)
    integer(i1), intent(inout), contiguous :: strained(:)
    real(wp) :: limit
    integer :: l

    limit = model%least_critical*early
    if (all(abs(s) <= limit)) return
    do l = 1, lanes
      if (weight(l) <= 0.0_wp .or. abs(s(l)) <= limit) cycle
      call mark_slot(model, first + l - 1, s(l), strained)
      if (both) call mark_slot(model, j + l - 1, s(l), strained)
    end do
  end subroutine mark_block

  !> Mark slot `k`, one of whose bonds has the stretch `s` beyond the limit. Compression marks it
  !> only if its bonds break in compression.
  pure subroutine mark_slot(model, k, s, strained)
    type(model_type), intent(in) :: model  !! with bonds that can break
    integer(i8), intent(in) :: k           !! slot
    real(wp), intent(in) :: s              !! mechanical stretch, positive in tension [-]
    integer(i1), intent(inout), contiguous :: strained(:)
      !! (n_slots) 1 for slot `k` on return, unless it is in a no-fail zone or does not break so

    if (model%critical(k) < 0.0_wp) return
    if (allocated(model%weakest)) then
      if (abs(s) <= model%weakest(k)*early) return
    end if
    if (s < 0.0_wp) then
      if (.not. model%compression) return
      if (model%compressed(k) == 0_i1) return
    end if
    strained(k) = 1_i1
  end subroutine mark_slot

end module pd_force_general
