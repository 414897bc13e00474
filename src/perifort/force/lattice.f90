!> The force loops of lattice families, `lanes` slots at a time: for each offset, the bonds of the
!> lanes to the slots that far away. A block's sums stay in registers through all its offsets.
!>
!> With e = (2 xi.eta + eta.eta)/|xi|^2, the deformed length is |xi| sqrt(1 + e), the stretch
!> s = sqrt(1 + e) - 1 and |xi|/|xi+eta| = r = 1/sqrt(1 + e). The force needs s r = 1 - r, which for
!> |e| <= 0.02 is e h(e) with a polynomial h (relative error 3e-16): no root, no division, and no
!> cancellation. A block that is strained further takes the formulas with root and division.
module pd_force_lattice
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_family_lattice, only: lattice_family_type, weights_type, lanes, word_bits
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
  !> Squared length, over the undeformed one, below which a bond is crushed to a point and has no
  !> direction but that of rounding: it pulls nowhere, rather than anywhere or NaN.
  real(wp), parameter :: crushed = 1.0e-24_wp

  !> Switches of the general formulas.
  type :: terms_type
    logical :: dilatation = .false.
    logical :: projected = .true.
    logical :: thermal = .false.
    logical :: breaking = .false.
    real(wp) :: fast_limit = 0.0_wp      !! the fast formula serves blocks with |e| below; 0: none
  end type terms_type

contains

  !> p_k = 2 a d delta theta_k of all slots; marks strained slots where bonds can break, and keeps
  !> in `family%large` which blocks the fast formula doesn't serve.
  subroutine lattice_dilatation(family, model, u, p, strained)
    type(lattice_family_type), intent(inout) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: p(:)
    integer(i1), intent(inout), contiguous :: strained(:)
    type(weights_type) :: scratch
    type(terms_type) :: terms
    integer :: b

    terms = terms_of(model)
    !$omp parallel default(none) shared(family, model, u, p, strained, terms) private(scratch, b)
    !$omp do schedule(static)
    do b = 1, size(family%block)
      if (shared_weights(family, b)) then
        call dilatation_of_block(family, model, terms, b, family%table(family%weights(b)), u, p, &
          & strained)
      else
        call weights_now(family, model, b, scratch)
        call dilatation_of_block(family, model, terms, b, scratch, u, p, strained)
      end if
    end do
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
    type(weights_type) :: scratch
    type(terms_type) :: terms
    integer :: b

    terms = terms_of(model)
    !$omp parallel default(none) shared(family, model, u, p, force, strained, terms) &
    !$omp private(scratch, b)
    !$omp do schedule(static)
    do b = 1, size(family%block)
      if (shared_weights(family, b)) then
        call force_of_block(family, model, terms, b, family%table(family%weights(b)), u, p, force, &
          & strained)
      else
        call weights_now(family, model, b, scratch)
        call force_of_block(family, model, terms, b, scratch, u, p, force, strained)
      end if
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
    type(terms_type) :: terms
    integer :: b

    terms = terms_of(model)
    energy = 0.0_wp
    !$omp parallel default(none) shared(family, model, u, energy, terms) private(scratch, b)
    !$omp do schedule(static)
    do b = 1, size(family%block)
      if (shared_weights(family, b)) then
        call energy_of_block(family, model, terms, b, family%table(family%weights(b)), u, energy)
      else
        call weights_now(family, model, b, scratch)
        call energy_of_block(family, model, terms, b, scratch, u, energy)
      end if
    end do
    !$omp end parallel
  end subroutine lattice_energy

  pure type(terms_type) function terms_of(model) result(terms)
    type(model_type), intent(in) :: model

    terms%dilatation = model%dilatation
    terms%projected = model%projected
    terms%thermal = model%thermal
    terms%breaking = model%breaking
    ! with the tensile limit s, |e| reaches (1 + s)^2 - 1; in compression 1 - (1 - s)^2 is less
    terms%fast_limit = small_strain
    if (model%breaking) terms%fast_limit = min(small_strain, &
      & model%least_critical*(2 - model%least_critical)*(1 - 1.0e-9_wp))
    if (model%thermal .or. (model%dilatation .and. .not. model%projected)) terms%fast_limit = 0.0_wp
  end function terms_of

  !> Whether the block can take the weights it shares with others: it has some, and no broken bond.
  pure logical function shared_weights(family, b)
    type(lattice_family_type), intent(in) :: family
    integer, intent(in) :: b
    integer :: w
    integer(i8) :: first, any_broken

    shared_weights = family%weights(b) > 0
    if (.not. (shared_weights .and. allocated(family%broken))) return
    first = family%block(b)
    any_broken = 0_i8
    do w = 1, family%words
      any_broken = ior(any_broken, iany(family%broken(first:first + lanes - 1, w)))
    end do
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

  !> p of one block.
  subroutine dilatation_of_block(family, model, terms, b, weights, u, p, strained)
    type(lattice_family_type), intent(inout) :: family
    type(model_type), intent(in) :: model
    type(terms_type), intent(in) :: terms
    integer, intent(in) :: b
    type(weights_type), intent(in) :: weights
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: p(:)
    integer(i1), intent(inout), contiguous :: strained(:)
    real(wp) :: theta(lanes), largest
    integer(i8) :: first
    integer :: l

    first = family%block(b)
    largest = huge(largest)
    if (terms%fast_limit > 0.0_wp) then
      ! constant dimensions, so that each has code of its own
      select case (family%dim)
      case (3)
        call fast_dilatation_3(weights%n, weights%dilatation, weights%shift, weights%geometry, &
          & first, family%n_slots, u, theta, largest)
      case (2)
        call fast_dilatation_2(weights%n, weights%dilatation, weights%shift, weights%geometry, &
          & first, family%n_slots, u, theta, largest)
      case default
        call fast_dilatation_1(weights%n, weights%dilatation, weights%shift, weights%geometry, &
          & first, family%n_slots, u, theta, largest)
      end select
    end if
    family%large(b) = merge(0_i1, 1_i1, largest < terms%fast_limit)
    if (family%large(b) == 1_i1) then
      call general_dilatation(family, model, terms, first, weights, u, theta, strained)
    else if (terms%breaking) then
      strained(first:first + lanes - 1) = 0_i1
    end if
    if (size(model%materials) == 1) then
      p(first:first + lanes - 1) = model%materials(1)%p*model%materials(1)%t*theta
    else
      do l = 1, lanes
        associate (m => model%materials(model%material(first + l - 1)))
          p(first + l - 1) = m%p*m%t*theta(l)
        end associate
      end do
    end if
  end subroutine dilatation_of_block

  !> Force density of one block.
  subroutine force_of_block(family, model, terms, b, weights, u, p, force, strained)
    type(lattice_family_type), intent(inout) :: family
    type(model_type), intent(in) :: model
    type(terms_type), intent(in) :: terms
    integer, intent(in) :: b
    type(weights_type), intent(in) :: weights
    real(wp), intent(in), contiguous :: u(:, :), p(:)
    real(wp), intent(inout), contiguous :: force(:, :)
    integer(i1), intent(inout), contiguous :: strained(:)
    real(wp) :: f(lanes, 3), largest
    integer(i8) :: first
    integer :: c

    first = family%block(b)
    largest = huge(largest)
    if (terms%dilatation) then
      if (family%large(b) == 0_i1) largest = 0.0_wp
    end if
    if (terms%fast_limit > 0.0_wp .and. (.not. terms%dilatation .or. largest <= 0.0_wp)) then
      select case (family%dim)
      case (3)
        call fast_force_3(terms%dilatation, weights%n, weights%dilatation, weights%stretch, &
          & weights%shift, weights%geometry, first, family%n_slots, u, p, &
          & f, largest)
      case (2)
        call fast_force_2(terms%dilatation, weights%n, weights%dilatation, weights%stretch, &
          & weights%shift, weights%geometry, first, family%n_slots, u, p, &
          & f, largest)
      case default
        call fast_force_1(terms%dilatation, weights%n, weights%dilatation, weights%stretch, &
          & weights%shift, weights%geometry, first, family%n_slots, u, p, &
          & f, largest)
      end select
    end if
    if (largest >= terms%fast_limit) then
      call general_force(family, model, terms, first, weights, u, p, f, strained)
    else if (terms%breaking) then
      strained(first:first + lanes - 1) = 0_i1
    end if
    do c = 1, family%dim
      force(first:first + lanes - 1, c) = f(:, c)
    end do
  end subroutine force_of_block

  ! The fast loops have one text for all dimensions, and each dimension its own code: the dimension
  ! must be a constant where the loops are compiled.

  subroutine fast_dilatation_1(n, weight, shift, geometry, first, n_slots, u, &
    & theta, largest)
    integer, parameter :: dim = 1
    include 'fast_dilatation.inc'
  end subroutine fast_dilatation_1

  subroutine fast_dilatation_2(n, weight, shift, geometry, first, n_slots, u, &
    & theta, largest)
    integer, parameter :: dim = 2
    include 'fast_dilatation.inc'
  end subroutine fast_dilatation_2

  subroutine fast_dilatation_3(n, weight, shift, geometry, first, n_slots, u, &
    & theta, largest)
    integer, parameter :: dim = 3
    include 'fast_dilatation.inc'
  end subroutine fast_dilatation_3

  subroutine fast_force_1(dilatation, n, weight, stretch, shift, geometry, first, &
    & n_slots, u, p, force, largest)
    integer, parameter :: dim = 1
    include 'fast_force.inc'
  end subroutine fast_force_1

  subroutine fast_force_2(dilatation, n, weight, stretch, shift, geometry, first, &
    & n_slots, u, p, force, largest)
    integer, parameter :: dim = 2
    include 'fast_force.inc'
  end subroutine fast_force_2

  subroutine fast_force_3(dilatation, n, weight, stretch, shift, geometry, first, &
    & n_slots, u, p, force, largest)
    integer, parameter :: dim = 3
    include 'fast_force.inc'
  end subroutine fast_force_3

  !> State of the bonds at one offset by the general formulas: mechanical stretch, Lambda,
  !> r = |xi|/|y| and the bond's direction over |xi|.
  pure subroutine deform(dim, model, terms, first, shift, g, u, s, lambda, r, along)
    integer, intent(in) :: dim
    type(model_type), intent(in) :: model
    type(terms_type), intent(in) :: terms
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
    do c = 1, dim
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
    if (.not. terms%projected) lambda = 1.0_wp
    if (terms%thermal) then
      s = s - (model%expansion(first:first + lanes - 1) + model%expansion(j:j + lanes - 1))/2
    end if
  end subroutine deform

  !> The sums of `fast_dilatation` for any strain and with every term; marks strained slots.
  subroutine general_dilatation(family, model, terms, first, weights, u, theta, strained)
    type(lattice_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(terms_type), intent(in) :: terms
    integer(i8), intent(in) :: first
    type(weights_type), intent(in) :: weights
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(out) :: theta(lanes)
    integer(i1), intent(inout), contiguous :: strained(:)
    real(wp), dimension(lanes) :: s, lambda, r, most, least
    real(wp) :: along(lanes, 3)
    integer :: m

    theta = 0.0_wp
    most = 0.0_wp
    least = 0.0_wp
    do m = 1, weights%n
      call deform(family%dim, model, terms, first, weights%shift(m), weights%geometry(:, m), u, s, &
        & lambda, r, along)
      theta = theta + weights%dilatation(:, m)*s*lambda
      if (terms%breaking) call widen(s, weights%stretch(:, m), most, least)
    end do
    if (terms%breaking) call mark(model, first, most, least, strained)
  end subroutine general_dilatation

  !> The sums of `fast_force` for any strain and with every term; marks strained slots.
  subroutine general_force(family, model, terms, first, weights, u, p, force, strained)
    type(lattice_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(terms_type), intent(in) :: terms
    integer(i8), intent(in) :: first
    type(weights_type), intent(in) :: weights
    real(wp), intent(in), contiguous :: u(:, :), p(:)
    real(wp), intent(out) :: force(lanes, 3)
    integer(i1), intent(inout), contiguous :: strained(:)
    real(wp), dimension(lanes) :: s, lambda, r, most, least, magnitude
    real(wp) :: along(lanes, 3)
    integer(i8) :: j
    integer :: m, c

    force = 0.0_wp
    most = 0.0_wp
    least = 0.0_wp
    do m = 1, weights%n
      call deform(family%dim, model, terms, first, weights%shift(m), weights%geometry(:, m), u, s, &
        & lambda, r, along)
      magnitude = weights%stretch(:, m)*s
      if (terms%dilatation) then
        j = first + weights%shift(m)
        magnitude = magnitude + (p(first:first + lanes - 1) + p(j:j + lanes - 1)) &
          & *weights%dilatation(:, m)*lambda
      end if
      magnitude = magnitude*r
      do c = 1, family%dim
        force(:, c) = force(:, c) + magnitude*along(:, c)
      end do
      if (terms%breaking) call widen(s, weights%stretch(:, m), most, least)
    end do
    if (terms%breaking) call mark(model, first, most, least, strained)
  end subroutine general_force

  !> Strain energy density of one block, by the general formulas.
  subroutine energy_of_block(family, model, terms, b, weights, u, energy)
    type(lattice_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(terms_type), intent(in) :: terms
    integer, intent(in) :: b
    type(weights_type), intent(in) :: weights
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: energy(:)
    real(wp), dimension(lanes) :: s, lambda, r, theta, stretches
    real(wp) :: along(lanes, 3)
    integer(i8) :: first, j
    integer :: m, l

    first = family%block(b)
    theta = 0.0_wp
    stretches = 0.0_wp
    do m = 1, weights%n
      call deform(family%dim, model, terms, first, weights%shift(m), weights%geometry(:, m), u, s, &
        & lambda, r, along)
      if (terms%dilatation) theta = theta + weights%dilatation(:, m)*s*lambda
      if (size(model%materials) > 1) then
        ! the weights hold q_k + q_j, the energy takes q_k/2 of the slot's own material
        j = first + weights%shift(m)
        do l = 1, lanes
          associate (q => model%materials(model%material(first + l - 1))%q)
            s(l) = s(l)*sqrt(2*q/(q + model%materials(model%material(j + l - 1))%q))
          end associate
        end do
      end if
      stretches = stretches + weights%stretch(:, m)*s**2
    end do
    do l = 1, lanes
      associate (mat => model%materials(model%material(first + l - 1)))
        energy(first + l - 1) = stretches(l)/4 + mat%a*(mat%t*theta(l))**2
      end associate
    end do
  end subroutine energy_of_block

  !> Largest and least stretch of each lane's bonds that are there.
  pure subroutine widen(s, weight, most, least)
    real(wp), intent(in) :: s(lanes), weight(lanes)
    real(wp), intent(inout) :: most(lanes), least(lanes)
    where (weight > 0.0_wp)
      most = max(most, s)
      least = min(least, s)
    end where
  end subroutine widen

  !> Mark the slots with a bond at its limit, a hair's breadth early: what breaks is decided
  !> elsewhere.
  subroutine mark(model, first, most, least, strained)
    type(model_type), intent(in) :: model
    integer(i8), intent(in) :: first
    real(wp), intent(in) :: most(lanes), least(lanes)
    integer(i1), intent(inout), contiguous :: strained(:)
    real(wp) :: limit
    integer(i8) :: k
    integer :: l

    limit = model%least_critical*(1 - 1.0e-9_wp)
    do l = 1, lanes
      k = first + l - 1
      strained(k) = 0_i1
      if (model%critical(k) < 0.0_wp) cycle
      if (most(l) > limit) strained(k) = 1_i1
      if (.not. model%compression) cycle
      if (model%compressed(k) == 1_i1 .and. -least(l) > limit) strained(k) = 1_i1
    end do
  end subroutine mark

end module pd_force_lattice
