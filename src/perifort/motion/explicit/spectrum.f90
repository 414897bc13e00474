!> The largest frequency of a body as it is now, by the Lanczos method on its forces, and the stable
!> step that follows from it (doc/theory.md, 6).
!>
!> K is minus the derivative of the forces, D the densities. With y = sqrt(rho V) u, D^-1 K becomes
!> a symmetric matrix, and the plain three-term recurrence needs no more than three vectors.
!> Rounding makes the vectors lose their orthogonality and largest values appear several times, but
!> it does not harm the value itself nor its residual (C. C. Paige, J. Inst. Maths Applics 18 (1976)
!> 341).
module pd_motion_explicit_spectrum
  use pd_base_kinds, only: wp, i1, i2, i4, i8
  use pd_base_numbers, only: pi
  use pd_base_reduce, only: count_of_ranks, inner, largest_of_ranks, noise, bring_noise
  use pd_body_body, only: owned
  use pd_law_material, only: material_type, several_stiffnesses
  use pd_family_family, only: bonds_type, allocate_bonds
  use pd_family_surface, only: bond_factor
  use pd_force_model, only: bond_factors_of, force_options_type, model_type, options_of, q_of, t_of
  use pd_force_workspace, only: workspace_type
  use pd_motion_pins, only: held_but_for_pins
  use pd_motion_system, only: system_type, inverse_density
  use pd_motion_tangent, only: apply_tangent
  implicit none (type, external)
  private
  public :: spectrum_type, largest_frequency, lasting_frequency, stable_step_of
  public :: may_be_unstable, lowest_eigenvalue

  !> What was found.
  type :: spectrum_type
    real(wp) :: squared = 0.0_wp       !! largest omega^2, a bound from below [1/s2]
    real(wp) :: residual = 0.0_wp      !! some omega^2 of the body is within this of `squared`
    integer :: evaluations = 0         !! applications of the tangent
    logical :: converged = .false.     !! `residual` is as small as was asked for
  end type spectrum_type

  !> Chance that the start vector hides a frequency more than `accuracy` above the one found.
  real(wp), parameter :: chance = 1.0e-6_wp
  integer, parameter :: most_evaluations = 2000  !! no body needs them but by a fault
  integer, parameter :: check_every = 8           !! evaluations between checks of the Ritz value
  integer, parameter :: seed = 20250829          !! of the start vector
  !> Bodies have been found unstable from nu = -0.18 downwards (doc/extremes.md).
  real(wp), parameter :: suspicious_ratio = -0.1_wp
  !> An eigenvalue this far below 0, over the largest, is no rounding of a rigid motion's.
  real(wp), parameter :: surely_negative = -1.0e-6_wp
  !> Enough to find an eigenvalue below -1e-3 of the largest in a body of 1e8 components, with the
  !> chance above.
  integer, parameter :: stability_evaluations = 400

contains

  !> The largest frequency of `system` about its present displacements, its constrained components
  !> held, to `accuracy` of its square. Stops when the residual is small enough and when enough
  !> steps were made for the gap-free bound of Kuczynski and Wozniakowski (SIAM J. Matrix Anal.
  !> Appl. 13 (1992) 1094): for a random start vector, the chance that the value found is more than
  !> eps below the largest is at most 1.648 sqrt(n) exp(-sqrt(eps) (2 m - 1)) after m steps. The
  !> start vector is random, yet always the same, and so is the result, on any number of threads.
  subroutine largest_frequency(system, accuracy, spectrum, options, model, workspace)
    type(system_type), intent(inout) :: system
      !! its state stays as it is; its workspace changes
    real(wp), intent(in) :: accuracy              !! of omega^2, relative
    type(spectrum_type), intent(out) :: spectrum               !! what was found
    type(force_options_type), intent(in), optional :: options  !! of the forces; the model's own by
                                                               !! default
    type(model_type), intent(in), optional :: model            !! the system's by default
    type(workspace_type), intent(inout), optional :: workspace !! of `model`, given with it
    real(wp), allocatable :: scale(:, :, :), now(:, :), before(:, :), w(:, :), kw(:, :)
    real(wp), allocatable :: diagonal(:), beside(:)
    type(force_options_type) :: taken
    real(wp) :: length, last
    integer :: m, least, free

    taken = options_of(system%model)
    if (present(options)) taken = options
    call make_scale(system, scale, free)
    if (free == 0) then
      spectrum%converged = .true.
      return
    end if
    least = ceiling((1 + log(1.648_wp*sqrt(real(free, wp))/chance)/sqrt(accuracy))/2)
    allocate (now, before, w, kw, mold=scale(:, :, 1))
    allocate (diagonal(most_evaluations), beside(most_evaluations))
    before = 0.0_wp
    call random_start(system, scale(:, :, 1), now)
    length = length_of(system, now)
    do m = 1, most_evaluations
      call recur(system, taken, system%state%u, scale, length, now, before, w, kw, diagonal(m), &
        & beside(m), model, workspace)
      length = beside(m)
      spectrum%evaluations = m
      ! a length of rounding: the vectors so far hold all that the start vector consists of
      if (length <= 1.0e-13_wp*maxval(abs(diagonal(:m)))) beside(m) = 0.0_wp
      if (mod(m, check_every) /= 0 .and. beside(m) > 0.0_wp) cycle
      call largest_ritz_value(diagonal(:m), beside(:m - 1), spectrum%squared, last)
      spectrum%residual = beside(m)*last
      spectrum%converged = spectrum%residual <= accuracy*spectrum%squared .and. &
        & (m >= least .or. beside(m) <= 0.0_wp)
      if (spectrum%converged .or. beside(m) <= 0.0_wp) exit
    end do
  end subroutine largest_frequency

  !> A bound of the largest frequency that no breaking of bonds can exceed, however many and in
  !> whatever order. By the inequality of Cauchy the dilatation's energy at k is at most beta_k - 1
  !> times that of k's stretches, whichever of its bonds are left, so that the stretches alone, the
  !> share of each point times its beta_k, have the larger energy, which every broken bond lowers.
  !>
  !> Where beta differs from material to material, it stands at each point. In bodies of one
  !> material the largest beta is taken out of the sum instead: that costs at most a few per cent of
  !> the step, and a lattice keeps the tables of its weights.
  subroutine lasting_frequency(system, accuracy, spectrum)
    type(system_type), intent(inout) :: system
      !! its state stays as it is; its workspace changes
    real(wp), intent(in) :: accuracy               !! of omega^2, relative
    type(spectrum_type), intent(out) :: spectrum   !! `squared` and `residual` of the bound
    real(wp), parameter :: alike = 1.01_wp         !! one material's largest beta over another's
    real(wp), allocatable :: share(:), largest(:)
    type(force_options_type) :: options
    real(wp) :: beta
    integer :: k

    call dilatation_shares(system, share)
    allocate (largest(size(system%model%materials)), source=0.0_wp)
    do k = 1, system%body%n_slots
      if (system%body%point(k) == 0) cycle
      associate (m => system%model%material(k))
        largest(m) = max(largest(m), share(k))
      end associate
    end do
    do k = 1, size(largest)
      largest(k) = largest_of_ranks(system%body%order, largest(k))
    end do
    beta = maxval(largest)
    options = options_of(system%model)
    options%dilatation = .false.
    if (beta > alike*minval(largest, mask=largest > 0.0_wp)) then
      call stiffened_frequency(system, share, options, accuracy, spectrum)
    else
      call largest_frequency(system, accuracy, spectrum, options)
      spectrum%squared = beta*spectrum%squared
      spectrum%residual = beta*spectrum%residual
    end if
  end subroutine lasting_frequency

  !> The largest frequency with the stiffness q of every slot times its `share`, rounded up by at
  !> most half a per cent (by more where that makes too many materials): slots of one material and
  !> of shares that are rounded to one number have a material of their own in a copy of the model,
  !> which has a workspace of its own: without tables, since they would be many, so that a lattice
  !> makes its weights anew in every pass.
  subroutine stiffened_frequency(system, share, options, accuracy, spectrum)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: share(:)               !! at least 1 (n_slots) [-]
    type(force_options_type), intent(in) :: options  !! of the forces: without a dilatation
    real(wp), intent(in) :: accuracy               !! of omega^2, relative
    type(spectrum_type), intent(out) :: spectrum
    integer, parameter :: most_materials = 30000   !! whose numbers have two bytes
    real(wp) :: grain                              !! one rounded share over the next smaller one
    type(model_type) :: stiffened
    type(material_type), allocatable :: finer(:)
    type(workspace_type) :: workspace
    integer, allocatable :: number(:, :)
    integer :: k, g, n

    stiffened = system%model
    stiffened%dilatation = .false.
    associate (materials => system%model%materials, material => system%model%material)
      grain = max(1.005_wp, maxval(share)**(real(size(materials), wp)/most_materials))
      allocate (number(size(materials), 0:grains(maxval(share))), source=0)
      allocate (finer(size(number)))
      n = 0
      do k = 1, system%body%n_slots
        g = grains(share(k))
        associate (m => material(k))
          if (number(m, g) == 0) then
            n = n + 1
            number(m, g) = n
            finer(n) = materials(m)
            finer(n)%q = materials(m)%q*grain**g
          end if
          stiffened%material(k) = int(number(m, g), i2)
        end associate
      end do
    end associate
    stiffened%materials = finer(:n)
    call largest_frequency(system, accuracy, spectrum, options, stiffened, workspace)

  contains

    !> The number of grains that a share is rounded up to.
    pure integer function grains(value)
      real(wp), intent(in) :: value
      grains = ceiling(log(max(1.0_wp, value))/log(grain))
    end function grains

  end subroutine stiffened_frequency

  !> Whether a body may be unstable as it stands, before any load: with a strongly negative
  !> Poisson's ratio and surface factors, which strengthen the dilatation of corners, while a < 0;
  !> and with consistent weights on a mesh, on lattices that touch, of materials of different
  !> stiffness, or of which some are below 0, as at round and thin bodies.
  pure logical function may_be_unstable(system)
    type(system_type), intent(in) :: system  !! with its model
    may_be_unstable = .false.
    if (system%model%consistent) may_be_unstable = size(system%body%parts) > 0 .or. &
      & allocated(system%body%sides) .or. several_stiffnesses(system%model%materials) .or. &
      & any(system%model%weights%Gb < 0.0_wp)
    may_be_unstable = may_be_unstable .or. &
      & (system%model%dilatation .and. system%model%surface .and. &
      & any(system%model%materials%a < 0.0_wp .and. &
      & system%model%materials%poissons_ratio < suspicious_ratio))
  end function may_be_unstable

  !> The lowest eigenvalue of the undeformed, unheated body's stiffness, its constrained components
  !> held, over the largest one [-]; 0 unless it is surely negative. A Ritz value is never below the
  !> lowest eigenvalue, so what is found negative is proved to be, and the search ends there: the
  !> lowest eigenvalue may lie further down.
  subroutine lowest_eigenvalue(system, lowest)
    type(system_type), intent(inout) :: system
      !! its state stays as it is; its workspace changes
    real(wp), intent(out) :: lowest  !! < 0 if the body is unstable, else 0 [-]
    real(wp), allocatable :: scale(:, :, :), now(:, :), before(:, :), w(:, :), kw(:, :), &
      & undeformed(:, :)
    real(wp), allocatable :: diagonal(:), beside(:)
    real(wp) :: length, top, bottom, last
    type(force_options_type) :: options
    integer :: m, free

    lowest = 0.0_wp
    call make_scale(system, scale, free)
    if (free == 0) return
    allocate (now, before, w, kw, mold=scale(:, :, 1))
    allocate (diagonal(stability_evaluations), beside(stability_evaluations))
    allocate (undeformed, mold=scale(:, :, 1))
    undeformed = 0.0_wp
    options = options_of(system%model)
    options%thermal = .false.
    before = 0.0_wp
    call random_start(system, scale(:, :, 1), now)
    length = length_of(system, now)
    do m = 1, stability_evaluations
      call recur(system, options, undeformed, scale, length, now, before, w, kw, diagonal(m), &
        & beside(m))
      length = beside(m)
      if (length <= 1.0e-13_wp*maxval(abs(diagonal(:m)))) beside(m) = 0.0_wp
      if (mod(m, check_every) /= 0 .and. beside(m) > 0.0_wp) cycle
      call largest_ritz_value(diagonal(:m), beside(:m - 1), top, last)
      call largest_ritz_value(-diagonal(:m), beside(:m - 1), bottom, last)
      if (-bottom < surely_negative*top) lowest = -bottom/top
      if (lowest < 0.0_wp .or. beside(m) <= 0.0_wp) exit
    end do
  end subroutine lowest_eigenvalue

  !> 2/omega [s], with the residual on the side of caution; huge if nothing vibrates.
  elemental real(wp) function stable_step_of(spectrum) result(step)
    type(spectrum_type), intent(in) :: spectrum  !! as found
    step = huge(step)
    if (spectrum%squared > 0.0_wp) step = 2/sqrt(spectrum%squared + spectrum%residual)
  end function stable_step_of

  !> beta_k = 1 + m_k sum(Gd^2/Gb vc V/|xi|)/q_k of every slot, 1 where there is no point. A
  !> negative a lowers the energy and counts as 0.
  subroutine dilatation_shares(system, beta)
    type(system_type), intent(in) :: system
    real(wp), allocatable, intent(out) :: beta(:)   !! (n_slots) [-]
    type(bonds_type) :: bonds
    real(wp) :: sum_of_bonds, Gd, Gb, n(system%body%dim), stretch_factor, dilatation_factor
    integer :: k, i

    allocate (beta(system%body%n_slots), source=1.0_wp)
    if (.not. system%model%dilatation) return
    !$omp parallel default(none) shared(system, beta) &
    !$omp private(bonds, sum_of_bonds, Gd, Gb, n, stretch_factor, dilatation_factor, k, i)
    call allocate_bonds(system%family, bonds)
    !$omp do schedule(dynamic, 256)
    do k = 1, system%body%n_slots
      if (system%body%point(k) == 0) cycle
      associate (model => system%model, material => system%model%materials( &
        & system%model%material(k)))
        if (material%a <= 0.0_wp) cycle
        call system%family%bonds_of(k, bonds)
        sum_of_bonds = 0.0_wp
        Gd = 1.0_wp
        Gb = 1.0_wp
        do i = 1, bonds%n
          if (.not. bonds%intact(i)) cycle
          if (model%surface) then
            n = bonds%xi(i, :)/bonds%length(i)
            Gd = bond_factor(n, model%D(k, :), model%D(bonds%j(i), :), model%axes)
            Gb = bond_factor(n, model%S(k, :), model%S(bonds%j(i), :), model%axes)
          end if
          if (model%consistent) then
            Gd = model%weights%Gd(model%weights%before(k) + i)
            Gb = model%weights%Gb(model%weights%before(k) + i)
            if (.not. Gb > 0.0_wp) cycle
          end if
          if (model%weighted) then
            call bond_factors_of(model, k, int(bonds%j(i)), bonds%length(i), stretch_factor, &
              & dilatation_factor)
            Gd = dilatation_factor*merge(Gd, 1.0_wp, model%surface .or. model%consistent)
            Gb = stretch_factor*merge(Gb, 1.0_wp, model%surface .or. model%consistent)
            if (.not. Gb > 0.0_wp) cycle
          end if
          sum_of_bonds = sum_of_bonds + Gd**2/Gb*bonds%weight(i)/bonds%length(i)
        end do
        beta(k) = 1 + 2*material%a*t_of(model, k)**2*sum_of_bonds/q_of(model, k)
      end associate
    end do
    !$omp end parallel
  end subroutine dilatation_shares

  !> u = scale(:, :, 1) y and, for the forces f = K u, A y = scale(:, :, 2) f; both 0 where nothing
  !> can move. `free` is how many components can.
  subroutine make_scale(system, scale, free)
    type(system_type), intent(in) :: system
    real(wp), allocatable, intent(out) :: scale(:, :, :)
    integer, intent(out) :: free
    integer(i1), allocatable :: held(:, :)
    integer :: k, c

    held = held_but_for_pins(system)
    allocate (scale(system%body%n_slots, system%body%dim, 2), source=0.0_wp)
    free = 0
    do c = 1, system%body%dim
      do k = 1, system%body%n_slots
        if (system%body%point(k) == 0 .or. held(k, c) == 1_i1) cycle
        scale(k, c, 1) = sqrt(inverse_density(system%model, k)/system%body%volume(k))
        scale(k, c, 2) = sqrt(inverse_density(system%model, k)*system%body%volume(k))
        if (owned(system%body, k)) free = free + 1
      end do
    end do
    free = int(count_of_ranks(system%body%order, int(free, i8)))
  end subroutine make_scale

  !> A vector of every direction alike: normally distributed components, drawn in the order of the
  !> points, so that both families start with the same.
  subroutine random_start(system, to_place, now)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: to_place(:, :)
    real(wp), intent(out) :: now(:, :)
    integer :: state, i, c, k
    real(wp) :: radius

    now = 0.0_wp
    do i = 1, system%body%order%n_owned
      call bring_noise(system%body%order, i, seed, 2*system%body%dim, state)
      k = system%body%slot(i)
      do c = 1, system%body%dim
        radius = sqrt(-2*log((1 + noise(state))/2))
        now(k, c) = radius*cos(pi*noise(state))
        if (.not. to_place(k, c) > 0.0_wp) now(k, c) = 0.0_wp
      end do
    end do
  end subroutine random_start

  !> |y|.
  real(wp) function length_of(system, y)
    type(system_type), intent(in) :: system
    real(wp), intent(in), contiguous :: y(:, :)
    length_of = sqrt(inner(system%body%order, y, y))
  end function length_of

  !> One step of the recurrence: q = now/length becomes the newest vector, and
  !> A q - diagonal q - length before, of length `beside`, the one to come.
  subroutine recur(system, options, u, scale, length, now, before, w, kw, diagonal, beside, model, &
    & workspace)
    type(system_type), intent(inout) :: system
    type(force_options_type), intent(in) :: options      !! of the forces
    real(wp), intent(in), contiguous :: u(:, :)          !! about these displacements [m]
    real(wp), intent(in), contiguous :: scale(:, :, :)   !! of places and of forces
    real(wp), intent(in) :: length
    real(wp), intent(inout), contiguous :: now(:, :)     !! in: not normalised; out: the next
    real(wp), intent(inout), contiguous :: before(:, :)  !! in: the vector before; out: q
    real(wp), intent(inout), contiguous :: w(:, :), kw(:, :)  !! room
    real(wp), intent(out) :: diagonal, beside
    type(model_type), intent(in), optional :: model      !! the system's by default
    type(workspace_type), intent(inout), optional :: workspace  !! of `model`, given with it
    integer :: c

    do c = 1, size(now, 2)
      call multiply(now(:, c), 1/length)
      w(:, c) = now(:, c)
      call multiply_by(w(:, c), scale(:, c, 1))
    end do
    call apply_tangent(system, u, w, kw, options, model, workspace)
    do c = 1, size(now, 2)
      call multiply_by(kw(:, c), scale(:, c, 2))
      call subtract(kw(:, c), length, before(:, c))
    end do
    diagonal = inner(system%body%order, now, kw)
    do c = 1, size(now, 2)
      before(:, c) = now(:, c)
      now(:, c) = kw(:, c)
      call subtract(now(:, c), diagonal, before(:, c))
    end do
    beside = length_of(system, now)
  end subroutine recur

  ! One rounding in each loop: how the compiler pairs products and sums may differ between the
  ! middle of a thread's part and its end, and with it the bits.

  !> a = factor a.
  subroutine multiply(a, factor)
    real(wp), intent(inout), contiguous :: a(:)
    real(wp), intent(in) :: factor
    integer :: k

    !$omp parallel do simd schedule(static) default(none) shared(a, factor) private(k)
    do k = 1, size(a)
      a(k) = factor*a(k)
    end do
  end subroutine multiply

  !> a = a b, component by component.
  subroutine multiply_by(a, b)
    real(wp), intent(inout), contiguous :: a(:)
    real(wp), intent(in), contiguous :: b(:)
    integer :: k

    !$omp parallel do simd schedule(static) default(none) shared(a, b) private(k)
    do k = 1, size(a)
      a(k) = a(k)*b(k)
    end do
  end subroutine multiply_by

  !> a = a - factor b.
  subroutine subtract(a, factor, b)
    real(wp), intent(inout), contiguous :: a(:)
    real(wp), intent(in) :: factor
    real(wp), intent(in), contiguous :: b(:)
    integer :: k

    !$omp parallel do simd schedule(static) default(none) shared(a, factor, b) private(k)
    do k = 1, size(a)
      a(k) = a(k) - factor*b(k)
    end do
  end subroutine subtract

  !> The largest eigenvalue of a symmetric tridiagonal matrix and the size of the last component of
  !> its unit eigenvector. With the pivots d_j of (theta - T), all positive just above the largest
  !> eigenvalue, the last of them vanishes there, and its derivative is one over the square of that
  !> component: d_j' = 1 + (beside_{j-1}/d_{j-1})^2 d_{j-1}', a sum without cancellation.
  pure subroutine largest_ritz_value(diagonal, beside, largest, last)
    real(wp), intent(in) :: diagonal(:), beside(:)
    real(wp), intent(out) :: largest, last
    real(wp), parameter :: out_of_sight = 1.0e100_wp
    real(wp) :: below, middle, pivot, slope
    integer :: j, m

    m = size(diagonal)
    below = maxval(diagonal)
    largest = below + 2*maxval([abs(beside), 0.0_wp]) + tiny(below)
    do
      middle = below + (largest - below)/2
      if (middle <= below .or. middle >= largest) exit
      if (all_below(middle)) then
        largest = middle
      else
        below = middle
      end if
    end do
    pivot = largest - diagonal(1)
    slope = 1.0_wp  ! the root of the derivative
    do j = 2, m
      slope = min(out_of_sight, hypot(1.0_wp, beside(j - 1)/pivot*slope))
      pivot = largest - diagonal(j) - beside(j - 1)**2/pivot
    end do
    last = 1/slope

  contains

    !> Whether all eigenvalues lie below `value`.
    pure logical function all_below(value)
      real(wp), intent(in) :: value
      real(wp) :: d
      integer :: i

      all_below = .false.
      d = value - diagonal(1)
      do i = 2, m
        if (d <= 0.0_wp) return
        d = value - diagonal(i) - beside(i - 1)**2/d
      end do
      all_below = d > 0.0_wp
    end function all_below

  end subroutine largest_ritz_value

end module pd_motion_explicit_spectrum
