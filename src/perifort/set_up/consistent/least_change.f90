!> The least change of weights from 1 that fulfils linear conditions, with bounds on the weights.
!>
!> Minimise sum c (G - 1)^2 under B G = r and low <= G: G - 1 = max(low - 1, B^T z/c), and the
!> multipliers z are the zero of r - B G(z), which is the gradient of a concave function of z.
!> Newton's method finds it: each step solves a system with the weights that are not at the bound,
!> by conjugate gradients with the blocks of the classes as preconditioner, and grids of splines
!> where each bond has a weight of its own (`pd_set_up_consistent_levels`). Without a bound one step
!> is enough, or some against the rounding of many iterations.
module pd_set_up_consistent_least_change
  use pd_base_kinds, only: wp, i8
  use pd_base_long_work, only: long_work_type
  use pd_base_text, only: to_text
  use pd_set_up_consistent_conditions, only: conditions_type, few
  use pd_set_up_consistent_levels, only: add_levels, level_type, new_levels
  use pd_set_up_consistent_products, only: block_of, spread_over, sums_of
  implicit none (type, external)
  private
  public :: least_change, unbounded, most_iterations

  real(wp), parameter :: unbounded = -1.0e30_wp  !! the bound that is none
  real(wp), parameter :: tolerance = 1.0e-12_wp     !! of the conditions [-]
  real(wp), parameter :: uneven = 1.0e-10_wp
    !! of those of points that all differ, and of others that more steps do not lower [-]
  real(wp), parameter :: part_of_changes = 1.0e-2_wp
    !! bonds that come to the bound or leave it in a step, over all at it
  real(wp), parameter :: much = 1.0e3_wp            !! growth of an error that is rounding
  real(wp), parameter :: far = 1.0e-6_wp            !! error of a first step that more do not mend
  integer, parameter :: most_newton = 60
  integer, parameter :: patience = 8  !! steps in which the error must fall to half
  real(wp), parameter :: stays = 0.7_wp  !! part of the error that a step in vain leaves
  !> Part of a step that is hardly any: with the weights that are at the bound there is no solution.
  real(wp), parameter :: short = 0.01_wp
  integer, parameter :: in_vain = 3      !! steps in vain after which there is no solution
  integer, parameter :: idle = 30        !! iterations of a step that do not lower the error
  integer, parameter :: most_iterations = 5000      !! of a step where weights at the bound stay
  integer, parameter :: most_bounded = 400          !! of a step with such weights
  integer, parameter :: most_of_bound = 2500        !! of all steps with a bound
  integer, parameter :: across = 40                 !! points across that these are enough for
  real(wp), parameter :: part_of_step = 1.0e-4_wp   !! of the error that a step with grids leaves
  !> The most of it while the weights at the bound change from step to step.
  real(wp), parameter :: most_of_step = 1.0e-2_wp

contains

  !> Weights G (unknowns). `found`: they fulfil the conditions to 1e-12 (1e-10 if rounding leaves
  !> that), or where each bond has a weight of its own to 1e-10; otherwise no weights above the
  !> bound do, or none were found.
  subroutine least_change(conditions, low, most_shared, G, residual, iterations, found, hopeless, &
    & work)
    type(conditions_type), intent(in) :: conditions
    real(wp), intent(in) :: low
      !! smallest allowed weight, or `unbounded`; of Gb alone where it is found with Gd [-]
    integer, intent(in) :: most_shared
      !! iterations of the first step after which weights that bonds share are given up
    real(wp), allocatable, intent(out) :: G(:)
      !! (unknowns) weights, counted from their base where they have one [-]
    real(wp), intent(out) :: residual            !! largest error of a condition [-]
    integer, intent(out) :: iterations           !! of the conjugate gradients
    logical, intent(out) :: found
    logical, intent(out) :: hopeless
      !! bonds share weights, and with any bound the iterations would not converge
    type(long_work_type), intent(inout) :: work  !! says how far the iterations are
    real(wp), allocatable :: step(:, :), r(:, :), t(:), change(:), tried(:), lows(:), of_one(:, :)
    real(wp), allocatable :: given(:)
    logical, allocatable :: free(:)
    logical :: settled
    type(level_type), allocatable :: levels(:)
    real(wp) :: value, before, slope, along, linear, length, history(most_newton), allowed, part
    integer :: newton, halving, vain, most

    associate (rows => conditions%rows, classes => conditions%classes, n => conditions%unknowns)
      allocate (r(rows, classes), step(rows, classes), of_one(rows, classes), source=0.0_wp)
      allocate (t(n), change(n), source=0.0_wp)
      allocate (G(n), given(size(conditions%unknown, kind=i8)))
      allocate (free(n), source=.true.)
      allocate (lows(n), source=low)
      if (allocated(conditions%base)) lows = lows - (conditions%base - 1)
      if (conditions%stretches > 0) lows(conditions%stretches + 1:) = unbounded
    end associate
    iterations = 0
    found = .false.
    hopeless = .false.
    linear = 0.0_wp
    vain = 0
    if (conditions%placed) then
      call new_levels(conditions, levels)
      allowed = uneven
    else
      allowed = tolerance
      allocate (levels(0))
    end if
    call sums_of(conditions, spread(1.0_wp, 1, size(G)), of_one)
    call weigh(conditions, lows, t, G, r, before)
    do newton = 1, most_newton
      residual = maxval(abs(r))
      found = residual <= allowed
      if (found) return
      ! without a solution the multipliers grow and the error stays
      history(newton) = residual
      if (newton > patience) then
        if (residual > 0.5_wp*history(newton - patience)) exit
      end if
      if (low > unbounded .and. iterations > most_of_bound*wider(conditions)) exit
      call set_free(t + 1 > lows, free, settled)
      part = part_of_step
      if (low > unbounded) part = max(part, min(most_of_step, residual))
      most = most_iterations
      if (.not. settled) most = nint(most_bounded*wider(conditions))
      if (.not. conditions%placed .and. newton == 1) most = most_shared
      call solve(conditions, levels, free, settled, part, most, r, given, step, iterations, work)
      ! multipliers of long waves are large, and what they give a bond is small: so the changes of
      ! weights are summed, and each step can mend what rounding leaves of the one before
      call spread_over(conditions, spread(.true., 1, size(free)), step, given, change)
      slope = sum(r*step)
      along = sum((conditions%right - of_one)*step)
      length = 1.0_wp
      do halving = 1, 30
        tried = t + length*change
        call weigh(conditions, lows, tried, G, r, value)
        value = value - linear - length*along
        if (value <= before - 1.0e-4_wp*length*slope + 1.0e-13_wp*abs(before)) exit
        if (maxval(abs(r)) <= 0.5_wp*residual) exit
        length = length/2
      end do
      if (.not. conditions%placed .and. newton == 1) then
        hopeless = iterations >= most_shared .and. maxval(abs(r)) > far
        if (hopeless) return
      end if
      if (low <= unbounded .or. maxval(abs(r)) <= max(far, stays*residual) .or. &
        & abs(count(t + 1 > lows) - count(tried + 1 > lows)) &
        & > part_of_changes*count(t + 1 <= lows)) then
        vain = 0
      else if (length <= short) then
        ! nearly the same weights stay at the bound, and so does the error
        vain = vain + 2
      else if (settled .and. length >= 1) then
        vain = vain + 1
      end if
      if (vain >= in_vain) exit
      t = tried
      linear = linear + length*along
      before = value
    end do
    ! more steps do not lower what is left, or take too long
    residual = maxval(abs(r))
    found = residual <= uneven
  end subroutine least_change

  !> Note which weights are not at the bound. `settled`: they are nearly those of the step before,
  !> so that it pays to solve for them to the end.
  pure subroutine set_free(now, free, settled)
    logical, intent(in) :: now(:)
    logical, intent(inout) :: free(:)  ! of the step before; set
    logical, intent(out) :: settled

    settled = count(now .neqv. free) <= part_of_changes*count(.not. now)
    free = now
  end subroutine set_free

  !> The width of a body of points that all differ, over that for which the numbers of iterations
  !> are; 1 for less and for classes that points share.
  pure real(wp) function wider(conditions)
    type(conditions_type), intent(in) :: conditions

    wider = max(1.0_wp, conditions%classes**(1/real(conditions%dim, wp))/across)
  end function wider

  !> Weights of the multipliers' sums t for each unknown, what the conditions miss, and the part of
  !> the function that is minimised that is not linear in the multipliers.
  subroutine weigh(conditions, low, t, G, r, value)
    type(conditions_type), intent(in) :: conditions
    real(wp), intent(in) :: low(:), t(:)
    real(wp), intent(inout) :: G(:), r(:, :)
    real(wp), intent(out) :: value

    G = max(low, 1 + t)
    call sums_of(conditions, G, r)
    r = conditions%right - r
    value = sum(conditions%counts*merge(t**2/2, (low - 1)*t - (low - 1)**2/2, 1 + t > low))
  end subroutine weigh

  !> Solve B D B^T step = r, with D = 1/c for free unknowns and 0 for others. The matrix is
  !> singular, and r in its range but for what the bound cuts off.
  subroutine solve(conditions, levels, free, settled, part, most, r, given, step, iterations, work)
    type(conditions_type), intent(in) :: conditions
    type(level_type), intent(in) :: levels(:)
    logical, intent(in) :: free(:)
    logical, intent(in) :: settled  ! `free` hardly changes any more
    real(wp), intent(in) :: part    ! of the error that may be left where there are grids
    integer, intent(in) :: most     ! iterations
    real(wp), intent(in) :: r(:, :)
    real(wp), intent(inout) :: given(:)  ! (bonds) room
    real(wp), intent(inout) :: step(:, :)
    integer, intent(inout) :: iterations
    type(long_work_type), intent(inout) :: work
    real(wp), allocatable :: inverse(:, :, :), rest(:, :), w(:, :), p(:, :), product(:, :), y(:)
    real(wp), allocatable :: best(:, :)
    real(wp) :: rho, rho_before, alpha, beta, curvature, target, error, least
    integer :: c, i, at

    call invert_blocks(conditions, free, inverse)
    allocate (rest, source=r)
    allocate (w, p, product, mold=r)
    allocate (y(conditions%unknowns))
    step = 0.0_wp
    p = 0.0_wp
    rho_before = 1.0_wp
    ! of a bounded solve the free unknowns change from step to step
    target = 0.02_wp*tolerance
    if (.not. all(free)) target = max(target, 1.0e-6_wp*maxval(abs(r)))
    if (size(levels) > 0) target = max(0.3_wp*uneven, part*maxval(abs(r)))
    least = huge(1.0_wp)
    at = 0
    do i = 1, most
      call precondition(inverse, rest, w)
      call add_levels(conditions, levels, rest, w)
      rho = product_of(rest, w)
      if (.not. rho > 0.0_wp) exit
      beta = merge(rho/rho_before, 0.0_wp, i > 1)
      !$omp parallel do schedule(static) default(none) shared(p, w, beta) private(c) &
      !$omp if (size(p, 2) > few)
      do c = 1, size(p, 2)
        p(:, c) = w(:, c) + beta*p(:, c)
      end do
      call spread_over(conditions, free, p, given, y)
      call sums_of(conditions, y, product)
      curvature = product_of(p, product)
      if (.not. curvature > 0.0_wp) exit
      alpha = rho/curvature
      error = 0.0_wp
      !$omp parallel do schedule(static) default(none) shared(step, rest, p, product, alpha) &
      !$omp private(c) reduction(max: error) if (size(p, 2) > few)
      do c = 1, size(p, 2)
        step(:, c) = step(:, c) + alpha*p(:, c)
        rest(:, c) = rest(:, c) - alpha*product(:, c)
        error = max(error, maxval(abs(rest(:, c))))
      end do
      rho_before = rho
      iterations = iterations + 1
      if (work%is_due()) call work%tell('iteration '//to_text(iterations)//'  error '// &
        & to_text(error, 2))
      if (error < least) then
        least = error
        best = step
        at = i
      end if
      if (error <= target) exit
      if (size(levels) == 0) cycle
      ! what rounding leaves outside of the matrix's range would grow without end
      if (error/much > least .or. (i - at > idle .and. .not. settled)) exit
    end do
    if (allocated(best)) step = best
  end subroutine solve

  !> The sum of the products of all elements, with the same bits on any number of threads.
  real(wp) function product_of(one, other) result(total)
    real(wp), intent(in) :: one(:, :), other(:, :)
    real(wp) :: of_class(size(one, 2))
    integer :: c

    !$omp parallel do schedule(static) default(none) shared(one, other, of_class) private(c) &
    !$omp if (size(one, 2) > few)
    do c = 1, size(one, 2)
      of_class(c) = dot_product(one(:, c), other(:, c))
    end do
    total = sum(of_class)
  end function product_of

  !> The inverses of the classes' blocks. Rows that follow from others of the class, as those of a
  !> family with a centre of symmetry, are left out by a large pivot.
  subroutine invert_blocks(conditions, free, inverse)
    type(conditions_type), intent(in) :: conditions
    logical, intent(in) :: free(:)
    real(wp), allocatable, intent(out) :: inverse(:, :, :)
    real(wp), parameter :: part = 1.0e-9_wp
    real(wp) :: largest
    integer :: c, i

    allocate (inverse(conditions%rows, conditions%rows, conditions%classes))
    !$omp parallel do schedule(dynamic, 16) default(none) private(c) &
    !$omp shared(conditions, free, inverse)
    do c = 1, conditions%classes
      call block_of(conditions, c, free, inverse(:, :, c))
    end do
    largest = 0.0_wp
    do i = 1, conditions%rows
      largest = max(largest, maxval(inverse(i, i, :)))
    end do
    !$omp parallel do schedule(static) default(none) shared(conditions, inverse, largest) private(c)
    do c = 1, conditions%classes
      call invert(inverse(:, :, c), part*largest, largest/part)
    end do
  end subroutine invert_blocks

  !> Replace a symmetric matrix by its inverse, with Cholesky's factor.
  pure subroutine invert(f, least, instead)
    real(wp), intent(inout) :: f(:, :)
    real(wp), intent(in) :: least      ! pivots up to this one
    real(wp), intent(in) :: instead    ! what they are set to
    real(wp) :: x(size(f, 1), size(f, 1)), pivot
    integer :: i, j, n

    n = size(f, 1)
    do j = 1, n
      pivot = f(j, j) - sum(f(j, :j - 1)**2)
      if (pivot <= least) pivot = instead
      f(j, j) = sqrt(pivot)
      do i = j + 1, n
        f(i, j) = (f(i, j) - dot_product(f(i, :j - 1), f(j, :j - 1)))/f(j, j)
      end do
    end do
    ! the factor's inverse, then its transpose times itself
    x = 0.0_wp
    do j = 1, n
      x(j, j) = 1/f(j, j)
      do i = j + 1, n
        x(i, j) = -dot_product(f(i, j:i - 1), x(j:i - 1, j))/f(i, i)
      end do
    end do
    do j = 1, n
      do i = 1, j
        f(i, j) = dot_product(x(j:, i), x(j:, j))
        f(j, i) = f(i, j)
      end do
    end do
  end subroutine invert

  !> The blocks' inverses times r.
  subroutine precondition(inverse, r, w)
    real(wp), intent(in) :: inverse(:, :, :), r(:, :)
    real(wp), intent(inout) :: w(:, :)
    integer :: c, i

    !$omp parallel do schedule(static) default(none) shared(inverse, r, w) private(c, i) &
    !$omp if (size(r, 2) > few)
    do c = 1, size(r, 2)
      w(:, c) = inverse(:, 1, c)*r(1, c)
      do i = 2, size(r, 1)
        w(:, c) = w(:, c) + inverse(:, i, c)*r(i, c)
      end do
    end do
  end subroutine precondition

end module pd_set_up_consistent_least_change
