!> Global sums, extremes, first places and random starts over the points of a body.
!>
!> Sums have the same bits in any order of the terms: for any arrangement of the slots, any number
!> of threads and any split of the points among ranks. Each term is cut into digits of 30 bits,
!> whole multiples of 2^(30 i), from the first one down, each the part towards 0 of what the digits
!> above leave. Sums of digits are sums of integers. Where the largest term begins with the digit i,
!> the sum is that of the digits i, i - 1 and i - 2 of all terms: what is left out is below 2^-60 of
!> the largest term for each. Terms beyond 9e288 are added as they come. (Demmel and Nguyen,
!> Parallel reproducible summation, IEEE Transactions on Computers 64, 2015, cut terms in this way.)
!>
!> What ranks exchange (`pd_base_order`) is one `add_all` or `take_largest` for some sums or an
!> extreme. The sums of digits are exact there, too.
module pd_base_reduce
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_order, only: block_points, number_of, order_type, owns, slots_of_block, take_block
  implicit none (type, external)
  private
  public :: sums_type, running_type
  public :: new_sums, add_block, total_of, new_running, add_point, total_of_running
  public :: inner, sum_over, sum_listed, sum_parts
  public :: largest_over, least_over, first_where, first_largest
  public :: largest_of_ranks, sum_of_ranks, count_of_ranks, any_of_ranks
  public :: noise, noise_after, bring_noise

  integer, parameter :: most_running = 6    !! sums that one `running_type` forms
  integer, parameter :: worth_threads = 4096 !! terms of a list that threads share

  integer, parameter :: bits = 30           !! of a digit
  integer, parameter :: bins = 63           !! digits that a number of the machine can have
  integer, parameter :: kept = 3            !! digits of a sum, from its first one
  integer, parameter :: middle = 32         !! the bin of multiples of 1
  real(wp), parameter :: largest_term = 2.0_wp**(bits*(bins + 1 - middle))  !! has no digits
  integer(i8), parameter :: base = 2_i8**bits

  !> The digits of the sum of some terms.
  type :: digits_type
    integer :: first = 0                  !! the largest term's first bin, 0: all terms are 0
    integer(i8) :: digit(kept) = 0_i8     !! from the bin `first` downwards
    real(wp) :: beyond = 0.0_wp           !! the plain sum of terms without digits
  end type digits_type

  !> The sum of many blocks: digits of all bins, how many blocks begin in each bin, and the plain
  !> sum of terms without digits.
  type :: whole_type
    integer(i8) :: digit(bins) = 0_i8
    integer(i8) :: carry(bins) = 0_i8     !! of the digits of several ranks, in units of 2^31 of
                                          !! these
    integer(i8) :: begin(bins) = 0_i8
    real(wp) :: beyond = 0.0_wp
  end type whole_type

  !> Some sums at once, block by block; blocks may be added by different threads.
  type :: sums_type
    private
    integer :: number = 0                              !! of sums
    type(digits_type), allocatable :: block(:, :)      !! (number, blocks)
  end type sums_type

  !> Some sums at once of a few points, in any order.
  type :: running_type
    private
    integer :: waiting = 0                             !! terms that are not in digits yet
    real(wp), allocatable :: terms(:, :)               !! (block_points, most_running)
    type(whole_type), allocatable :: whole(:)          !! (most_running)
  end type running_type

  !> Sum of a b over all points, of all components.
  interface inner
    module procedure :: inner_scalars, inner_vectors, inner_weighted
  end interface inner

  !> The largest value at a point.
  interface largest_over
    module procedure :: largest_scalar, largest_size
  end interface largest_over

contains

  ! ---------------------------------------------------------------- digits

  !> The digits of a sum of at most 256 terms.
  pure type(digits_type) function digits_of(terms) result(sum_of_digits)
    real(wp), intent(in), contiguous :: terms(:)
    real(wp) :: left(block_points), plain, largest, scale_up
    integer(i4) :: digit
    integer(i8) :: total
    integer :: n, i, d, b

    n = size(terms)
    plain = 0.0_wp
    do i = 1, n
      plain = plain + terms(i)
    end do
    if (.not. ieee_is_finite(plain)) then
      sum_of_digits%beyond = plain
      return
    end if
    largest = 0.0_wp
    do i = 1, n
      largest = max(largest, abs(terms(i)))
    end do
    if (largest >= largest_term) then
      sum_of_digits%beyond = plain
      return
    end if
    if (.not. largest > 0.0_wp) return
    ! the largest term is below 2^exponent
    b = max(kept, (exponent(largest) + bits*middle + bits - 1)/bits - 1)
    sum_of_digits%first = b
    scale_up = 2.0_wp**(bits*(middle - b))
    do i = 1, n
      left(i) = terms(i)*scale_up
    end do
    do d = 1, kept
      total = 0_i8
      do i = 1, n
        digit = int(left(i), i4)
        left(i) = (left(i) - digit)*base
        total = total + digit
      end do
      sum_of_digits%digit(d) = total
    end do
  end function digits_of

  !> Add digits to a whole sum.
  pure subroutine add_digits(more, whole)
    type(digits_type), intent(in) :: more
    type(whole_type), intent(inout) :: whole
    integer :: d

    if (.not. ieee_is_finite(more%beyond) .or. abs(more%beyond) > 0.0_wp) &
      & whole%beyond = whole%beyond + more%beyond
    if (more%first == 0) return
    whole%begin(more%first) = whole%begin(more%first) + 1_i8
    do d = 1, kept
      whole%digit(more%first - d + 1) = whole%digit(more%first - d + 1) + more%digit(d)
    end do
  end subroutine add_digits

  !> The values of whole sums, over all ranks.
  subroutine values_of(order, whole, total)
    type(order_type), intent(in) :: order            !! which ranks there are
    type(whole_type), intent(inout) :: whole(:)      !! of this rank
    real(wp), intent(out) :: total(:)
    integer(i8), parameter :: half = 2_i8**31
    real(wp), allocatable :: message(:, :)
    integer :: s

    if (associated(order%ranks)) then
      ! digits in two parts, so that their sums over any number of ranks are exact as reals
      allocate (message(3*bins + 1, size(whole)))
      do s = 1, size(whole)
        message(:bins, s) = real(whole(s)%digit/half, wp)
        message(bins + 1:2*bins, s) = real(mod(whole(s)%digit, half), wp)
        message(2*bins + 1:3*bins, s) = real(whole(s)%begin, wp)
        message(3*bins + 1, s) = whole(s)%beyond
      end do
      call add_everywhere(order, size(message), message)
      do s = 1, size(whole)
        whole(s)%carry = nint(message(:bins, s), i8)
        whole(s)%digit = nint(message(bins + 1:2*bins, s), i8)
        whole(s)%begin = nint(message(2*bins + 1:3*bins, s), i8)
        whole(s)%beyond = message(3*bins + 1, s)
      end do
    end if
    do s = 1, size(whole)
      total(s) = value_of(whole(s))
    end do
  end subroutine values_of

  !> Add numbers over all ranks.
  subroutine add_everywhere(order, n, numbers)
    type(order_type), intent(in) :: order
    integer, intent(in) :: n
    real(wp), intent(inout) :: numbers(n)
    call order%ranks%add_all(numbers)
  end subroutine add_everywhere

  !> The value of a whole sum. Its digits but the first are brought between 0 and 2^30, which is
  !> possible in one way only, so that the value depends on the sum alone.
  pure real(wp) function value_of(whole) result(total)
    type(whole_type), intent(in) :: whole
    integer(i8) :: digit(0:kept)   ! digit(0) is what exceeds the first bin
    integer :: d, first

    total = whole%beyond
    first = findloc(whole%begin > 0_i8, .true., dim=1, back=.true.)
    if (first == 0) return
    digit(0) = 0_i8
    do d = 1, kept
      digit(d) = whole%digit(first - d + 1)
      digit(d - 1) = digit(d - 1) + 2*whole%carry(first - d + 1)  ! 2^31 is twice the upper unit
    end do
    do d = kept, 1, -1
      digit(d - 1) = digit(d - 1) + (digit(d) - modulo(digit(d), base))/base
      digit(d) = modulo(digit(d), base)
    end do
    total = total + (((real(digit(0), wp)*base + real(digit(1), wp))*base + real(digit(2), wp)) &
      & + real(digit(3), wp)/base)*2.0_wp**(bits*(first - 1 - middle))
  end function value_of

  ! ---------------------------------------------------------------- sums in blocks

  !> Room for `number` sums.
  pure subroutine new_sums(order, number, sums)
    type(order_type), intent(in) :: order  !! which points are owned
    integer, intent(in) :: number  !! how many sums
    type(sums_type), intent(out) :: sums  !! nothing is added yet

    sums%number = number
    allocate (sums%block(number, order%blocks))
  end subroutine new_sums

  !> Take the terms of a block.
  pure subroutine add_block(block, terms, sums)
    integer, intent(in) :: block                  !! 1 to the order's `blocks`, each once
    real(wp), intent(in), contiguous :: terms(:, :)  !! (any of its points and zeros, number)
    type(sums_type), intent(inout) :: sums  !! with the sums of the block on return
    integer :: s

    do s = 1, sums%number
      sums%block(s, block) = digits_of(terms(:, s))
    end do
  end subroutine add_block

  !> The sums over all points, of all ranks.
  function total_of(order, sums) result(total)
    type(order_type), intent(in) :: order  !! which points are owned
    type(sums_type), intent(in) :: sums  !! every block has been added
    real(wp) :: total(sums%number)
    type(whole_type) :: whole(sums%number)
    integer :: b, s

    do b = 1, size(sums%block, 2)
      do s = 1, sums%number
        call add_digits(sums%block(s, b), whole(s))
      end do
    end do
    call values_of(order, whole, total)
  end function total_of

  ! ---------------------------------------------------------------- sums of a few points

  !> Begin sums of points that come one after another.
  pure subroutine new_running(running)
    type(running_type), intent(out) :: running  !! nothing is added yet
    allocate (running%terms(block_points, most_running), source=0.0_wp)
    allocate (running%whole(most_running))
  end subroutine new_running

  !> Add the terms of a point. Points that the process does not own are left to those that do.
  pure subroutine add_point(order, point, terms, running)
    type(order_type), intent(in) :: order  !! which points are owned
    integer(i4), intent(in) :: point           !! its number here
    real(wp), intent(in) :: terms(:)           !! at most `most_running`
    type(running_type), intent(inout) :: running  !! with the terms of this point on return

    if (.not. owns(order, point)) return
    if (running%waiting == block_points) call end_block(running)
    running%waiting = running%waiting + 1
    running%terms(running%waiting, :size(terms)) = terms
    running%terms(running%waiting, size(terms) + 1:) = 0.0_wp
  end subroutine add_point

  !> Bring the terms that wait into digits.
  pure subroutine end_block(running)
    type(running_type), intent(inout) :: running
    integer :: s

    do s = 1, most_running
      call add_digits(digits_of(running%terms(:running%waiting, s)), running%whole(s))
    end do
    running%waiting = 0
  end subroutine end_block

  !> The sums over all points that were added, on all ranks.
  function total_of_running(order, running) result(total)
    type(order_type), intent(in) :: order    !! which ranks there are
    type(running_type), intent(inout) :: running  !! nothing can be added any more
    real(wp) :: total(most_running)

    call end_block(running)
    call values_of(order, running%whole, total)
  end function total_of_running

  !> The sum of `terms` of some points, on all ranks: the same bits as adding one after another, but
  !> threads share the terms.
  real(wp) function sum_listed(order, points, terms) result(total)
    type(order_type), intent(in) :: order    !! which points are owned
    integer(i4), intent(in) :: points(:)     !! numbers here
    real(wp), intent(in) :: terms(:)         !! (points)
    type(digits_type) :: digits((size(points) + block_points - 1)/block_points)
    type(whole_type) :: whole(1)
    real(wp) :: some(block_points), totals(1)
    integer :: b, i, first, n

    !$omp parallel do schedule(static) if (size(points) >= worth_threads) default(none) &
    !$omp shared(order, points, terms, digits) private(b, i, first, n, some)
    do b = 1, size(digits)
      first = (b - 1)*block_points
      n = min(block_points, size(points) - first)
      do i = 1, n
        some(i) = 0.0_wp
        if (owns(order, points(first + i))) some(i) = terms(first + i)
      end do
      digits(b) = digits_of(some(:n))
    end do
    do b = 1, size(digits)
      call add_digits(digits(b), whole(1))
    end do
    call values_of(order, whole, totals)
    total = totals(1)
  end function sum_listed

  !> The sums of some terms over parts of the points, on all ranks: of each part and term the bits
  !> of `sum_listed`. Most parts are on one rank, which knows their sums; the digits of the others
  !> go from rank to rank, some parts at a time.
  subroutine sum_parts(order, start, all_points, points, terms, totals)
    type(order_type), intent(in) :: order      !! which points are owned
    integer(i4), intent(in) :: start(:)        !! (parts + 1) where each part begins in `points`
    integer(i8), intent(in) :: all_points(:)   !! (parts) how many points a part has on all ranks
    integer(i4), intent(in) :: points(:)       !! numbers here, part by part
    real(wp), intent(in) :: terms(:, :)        !! (terms, points); those of points that others own
                                               !! do not count
    real(wp), intent(out) :: totals(:, :)      !! (terms, parts)
    integer, parameter :: at_once = 64         ! parts of which digits are sent
    type(whole_type), allocatable :: whole(:)
    real(wp), allocatable :: divided(:), flat(:)
    integer, allocatable :: shared(:)
    integer :: p, n, first, last, here

    n = size(terms, 1)
    allocate (divided(size(all_points)), source=0.0_wp)
    do p = 1, size(all_points)
      call sum_here(order, points(start(p):start(p + 1) - 1), &
        & terms(:, start(p):start(p + 1) - 1), here, whole)
      if (here < all_points(p)) then
        if (here > 0) divided(p) = 1.0_wp
        totals(:, p) = 0.0_wp
      else
        totals(:, p) = [(value_of(whole(last)), last=1, n)]
      end if
    end do
    if (.not. associated(order%ranks)) return
    call order%ranks%take_largest(divided)
    flat = reshape(totals, [size(totals)])
    call order%ranks%add_all(flat)
    totals = reshape(flat, shape(totals))
    shared = pack([(p, p=1, size(divided))], divided > 0.0_wp)
    do first = 1, size(shared), at_once
      last = min(first + at_once - 1, size(shared))
      call sum_shared(shared(first:last))
    end do

  contains

    !> The sums of parts that several ranks have.
    subroutine sum_shared(parts)
      integer, intent(in) :: parts(:)
      type(whole_type), allocatable :: of_part(:), all_parts(:)
      real(wp) :: values(n*size(parts))
      integer :: i, points_here

      allocate (all_parts(n*size(parts)))
      do i = 1, size(parts)
        associate (a => start(parts(i)), b => start(parts(i) + 1) - 1)
          call sum_here(order, points(a:b), terms(:, a:b), points_here, of_part)
        end associate
        all_parts(n*(i - 1) + 1:n*i) = of_part
      end do
      call values_of(order, all_parts, values)
      totals(:, parts) = reshape(values, [n, size(parts)])
    end subroutine sum_shared
  end subroutine sum_parts

  !> The digits of the sums over those of some points that are owned, and how many these are.
  pure subroutine sum_here(order, points, terms, number, whole)
    type(order_type), intent(in) :: order
    integer(i4), intent(in) :: points(:)
    real(wp), intent(in) :: terms(:, :)   !! (terms, points)
    integer, intent(out) :: number
    type(whole_type), allocatable, intent(out) :: whole(:)  !! (terms)
    real(wp) :: some(block_points, size(terms, 1))
    integer :: i, n, s

    allocate (whole(size(terms, 1)))
    number = 0
    n = 0
    do i = 1, size(points)
      if (owns(order, points(i))) then
        number = number + 1
        n = n + 1
        some(n, :) = terms(:, i)
      end if
      if (n == 0 .or. (n < block_points .and. i < size(points))) cycle
      do s = 1, size(whole)
        call add_digits(digits_of(some(:n, s)), whole(s))
      end do
      n = 0
    end do
  end subroutine sum_here

  ! ---------------------------------------------------------------- sums of arrays over slots

  !> Sum of a b.
  function inner_scalars(order, a, b) result(total)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: a(:), b(:)  !! (n_slots)
    real(wp) :: total, sums_of_all(1)
    type(sums_type) :: sums
    real(wp) :: terms(block_points, 1), other(block_points)
    integer :: i

    call new_sums(order, 1, sums)
    !$omp parallel do schedule(static) default(none) shared(order, a, b, sums) &
    !$omp private(i, terms, other)
    do i = 1, order%blocks
      call take_block(order, i, a, terms(:, 1))
      call take_block(order, i, b, other)
      terms(:, 1) = terms(:, 1)*other
      call add_block(i, terms, sums)
    end do
    sums_of_all = total_of(order, sums)
    total = sums_of_all(1)
  end function inner_scalars

  !> Sum of a b over all components.
  function inner_vectors(order, a, b) result(total)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: a(:, :), b(:, :)  !! (n_slots, dim)
    real(wp) :: total, sums_of_all(1)
    type(sums_type) :: sums
    real(wp) :: terms(block_points, 1), one(block_points), other(block_points)
    integer :: i, c

    call new_sums(order, 1, sums)
    !$omp parallel do schedule(static) default(none) shared(order, a, b, sums) &
    !$omp private(i, c, terms, one, other)
    do i = 1, order%blocks
      terms = 0.0_wp
      do c = 1, size(a, 2)
        call take_block(order, i, a(:, c), one)
        call take_block(order, i, b(:, c), other)
        terms(:, 1) = terms(:, 1) + one*other
      end do
      call add_block(i, terms, sums)
    end do
    sums_of_all = total_of(order, sums)
    total = sums_of_all(1)
  end function inner_vectors

  !> Sum of weight a b over all components.
  function inner_weighted(order, weight, a, b) result(total)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: weight(:)         !! (n_slots)
    real(wp), intent(in), contiguous :: a(:, :), b(:, :)  !! (n_slots, dim)
    real(wp) :: total, sums_of_all(1)
    type(sums_type) :: sums
    real(wp) :: terms(block_points, 1), one(block_points), other(block_points)
    integer :: i, c

    call new_sums(order, 1, sums)
    !$omp parallel do schedule(static) default(none) shared(order, weight, a, b, sums) &
    !$omp private(i, c, terms, one, other)
    do i = 1, order%blocks
      if (order%in_runs) then
        call weigh_runs(order, i, weight, a, b, terms(:, 1))
      else
        terms = 0.0_wp
        do c = 1, size(a, 2)
          call take_block(order, i, a(:, c), one)
          call take_block(order, i, b(:, c), other)
          terms(:, 1) = terms(:, 1) + one*other
        end do
        call take_block(order, i, weight, one)
        terms(:, 1) = terms(:, 1)*one
      end if
      call add_block(i, terms, sums)
    end do
    sums_of_all = total_of(order, sums)
    total = sums_of_all(1)
  end function inner_weighted

  !> The terms of a block whose points stand in runs: nothing is copied.
  pure subroutine weigh_runs(order, block, weight, a, b, terms)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    integer, intent(in) :: block
    real(wp), intent(in), contiguous :: weight(:), a(:, :), b(:, :)
    real(wp), intent(out) :: terms(block_points)
    integer :: r, c, i, at, from, n

    n = sum(order%run_length(order%begin(block):order%begin(block + 1) - 1))
    if (n < block_points) terms = 0.0_wp
    do r = order%begin(block), order%begin(block + 1) - 1
      at = order%run_at(r) - 1
      from = order%run_slot(r) - 1
      do i = 1, order%run_length(r)
        terms(at + i) = a(from + i, 1)*b(from + i, 1)
      end do
      do c = 2, size(a, 2)
        do i = 1, order%run_length(r)
          terms(at + i) = terms(at + i) + a(from + i, c)*b(from + i, c)
        end do
      end do
      do i = 1, order%run_length(r)
        terms(at + i) = terms(at + i)*weight(from + i)
      end do
    end do
  end subroutine weigh_runs

  !> Sum of the values of all points.
  function sum_over(order, values) result(total)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: values(:)  !! (n_slots)
    real(wp) :: total, sums_of_all(1)
    type(sums_type) :: sums
    real(wp) :: terms(block_points, 1)
    integer :: i

    call new_sums(order, 1, sums)
    !$omp parallel do schedule(static) default(none) shared(order, values, sums) private(i, terms)
    do i = 1, order%blocks
      call take_block(order, i, values, terms(:, 1))
      call add_block(i, terms, sums)
    end do
    sums_of_all = total_of(order, sums)
    total = sums_of_all(1)
  end function sum_over

  ! ---------------------------------------------------------------- extremes and first places

  !> The largest value of a point; -huge where there is none.
  real(wp) function largest_scalar(order, values) result(largest)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: values(:)  !! (n_slots)
    integer :: block, i, n, slots(block_points)

    largest = -huge(largest)
    !$omp parallel do schedule(static) default(none) shared(order, values) &
    !$omp private(block, i, n, slots) reduction(max:largest)
    do block = 1, order%blocks
      call slots_of_block(order, block, n, slots)
      do i = 1, n
        largest = max(largest, values(slots(i)))
      end do
    end do
    largest = largest_of_ranks(order, largest)
  end function largest_scalar

  !> The largest size of a component of a point; 0 where there is none.
  real(wp) function largest_size(order, values) result(largest)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: values(:, :)  !! (n_slots, dim)
    integer :: block, i, n, c, slots(block_points)

    largest = 0.0_wp
    !$omp parallel do schedule(static) default(none) shared(order, values) &
    !$omp private(block, i, n, c, slots) reduction(max:largest)
    do block = 1, order%blocks
      call slots_of_block(order, block, n, slots)
      do c = 1, size(values, 2)
        do i = 1, n
          largest = max(largest, abs(values(slots(i), c)))
        end do
      end do
    end do
    largest = largest_of_ranks(order, largest)
  end function largest_size

  !> The least value of a point; huge where there is none.
  real(wp) function least_over(order, values) result(least)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: values(:)  !! (n_slots)
    integer :: block, i, n, slots(block_points)

    least = huge(least)
    !$omp parallel do schedule(static) default(none) shared(order, values) &
    !$omp private(block, i, n, slots) reduction(min:least)
    do block = 1, order%blocks
      call slots_of_block(order, block, n, slots)
      do i = 1, n
        least = min(least, values(slots(i)))
      end do
    end do
    least = -largest_of_ranks(order, -least)
  end function least_over

  !> The number, among the points of all ranks, of the first point that is marked; 0: none is.
  integer(i8) function first_where(order, marked) result(first)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    logical, intent(in) :: marked(:)  !! (n_slots)
    integer :: block, i, n, slots(block_points)

    first = 0_i8
    blocks: do block = 1, order%blocks
      call slots_of_block(order, block, n, slots)
      do i = 1, n
        if (.not. marked(slots(i))) cycle
        first = number_of(order, (block - 1)*block_points + i)
        exit blocks
      end do
    end do blocks
    if (.not. associated(order%ranks)) return
    ! numbers of points are exact as reals
    if (first == 0_i8) first = order%n_global + 1_i8
    first = -nint(largest_of_ranks(order, -real(first, wp)), i8)
    if (first > order%n_global) first = 0_i8
  end function first_where

  !> The number, among the points of all ranks, of the first point with the largest value.
  integer(i8) function first_largest(order, values) result(first)
    type(order_type), intent(in) :: order  !! the points that are owned, and their slots
    real(wp), intent(in), contiguous :: values(:)  !! (n_slots)
    real(wp) :: largest
    largest = largest_over(order, values)
    first = first_where(order, values >= largest)
  end function first_largest

  !> The largest of what each rank has.
  real(wp) function largest_of_ranks(order, value) result(largest)
    type(order_type), intent(in) :: order  !! which ranks there are
    real(wp), intent(in) :: value  !! what this rank has
    real(wp) :: values(1)

    largest = value
    if (.not. associated(order%ranks)) return
    values = value
    call order%ranks%take_largest(values)
    largest = values(1)
  end function largest_of_ranks

  !> Whether it is so on any rank.
  logical function any_of_ranks(order, here) result(anywhere)
    type(order_type), intent(in) :: order  !! which ranks there are
    logical, intent(in) :: here            !! on this rank
    anywhere = largest_of_ranks(order, merge(1.0_wp, 0.0_wp, here)) > 0.5_wp
  end function any_of_ranks

  !> The sum of what each rank has. Its rounding depends on the ranks: it is for what only watches.
  real(wp) function sum_of_ranks(order, value) result(total)
    type(order_type), intent(in) :: order  !! which ranks there are
    real(wp), intent(in) :: value  !! what this rank has
    real(wp) :: values(1)

    total = value
    if (.not. associated(order%ranks)) return
    values = value
    call order%ranks%add_all(values)
    total = values(1)
  end function sum_of_ranks

  !> The number that all ranks have counted together, up to 2^53.
  integer(i8) function count_of_ranks(order, number) result(total)
    type(order_type), intent(in) :: order  !! which ranks there are
    integer(i8), intent(in) :: number  !! what this rank has counted
    total = number
    if (associated(order%ranks)) total = nint(sum_of_ranks(order, real(number, wp)), i8)
  end function count_of_ranks

  ! ---------------------------------------------------------------- random numbers

  !> The next number in (-1, 1) of a sequence that is the same on every machine: the multiplicative
  !> generator of Park and Miller (1988), 16807 modulo 2^31 - 1. `state` starts it, from 1 to
  !> 2147483646, and is changed.
  real(wp) function noise(state)
    integer, intent(inout) :: state  !! of the sequence, 1 to 2147483646; the next one on return
    ! Schrage's way to keep 16807*state mod 2^31-1 within 32 bits
    state = 16807*mod(state, 127773) - 2836*(state/127773)
    if (state <= 0) state = state + 2147483647
    noise = 2*real(state, wp)/2147483647.0_wp - 1
  end function noise

  !> The state of `noise` before the numbers of an owned point, where each point draws as many, in
  !> the order of the points of all ranks.
  pure subroutine bring_noise(order, point, seed, each, state)
    type(order_type), intent(in) :: order  !! the points that are owned
    integer, intent(in) :: point           !! its number here; 1 first, then one by one
    integer, intent(in) :: seed            !! the state before the first of all points
    integer, intent(in) :: each            !! numbers that a point draws
    integer, intent(inout) :: state        !! after the numbers of the point before
    logical :: follows

    follows = .false.
    if (point > 1) follows = number_of(order, point) == number_of(order, point - 1) + 1_i8
    if (.not. follows) state = noise_after(seed, each*(number_of(order, point) - 1_i8))
  end subroutine bring_noise

  !> The state of `noise` after so many numbers: a rank begins with its own points.
  pure integer function noise_after(seed, drawn) result(state)
    integer, intent(in) :: seed  !! the state at the beginning, 1 to 2147483646
    integer(i8), intent(in) :: drawn  !! how many numbers
    integer(i8), parameter :: modulus = 2147483647_i8
    integer(i8) :: factor, power, left

    factor = 1_i8
    power = 16807_i8
    left = drawn
    do while (left > 0_i8)
      if (mod(left, 2_i8) == 1_i8) factor = mod(factor*power, modulus)
      power = mod(power*power, modulus)
      left = left/2_i8
    end do
    state = int(mod(factor*seed, modulus))
  end function noise_after

end module pd_base_reduce
