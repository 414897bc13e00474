!> Cholesky's factor of a sparse semidefinite matrix of blocks, kept within its envelope: of each
!> row all elements from the first one that may differ from zero (George and Liu, Computer Solution
!> of Large Sparse Positive Definite Systems, 1981). The last rows, which may have elements in all
!> columns, are taken in the order of the largest pivot: what has no effect, such as quadratic
!> fields all over a body, is found among them.
module pd_set_up_consistent_envelope
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i8
  implicit none (type, external)
  private
  public :: envelope_type, new_envelope, work_of_envelope, add_product, add_block, move_to, &
    & factorize_envelope, solve_envelope

  type :: envelope_type
    integer :: components = 0              !! rows of a block
    integer, allocatable :: place(:)       !! (nodes) place of each node's block among the rows
    integer, allocatable :: first(:)       !! (rows) column of the first element that is kept
    integer(i8), allocatable :: before(:)  !! (rows) element (i, j) is `element(before(i) + j)`
    real(wp), allocatable :: element(:)
    real(wp), allocatable :: scale(:)      !! (rows) that makes the diagonal 1
    integer :: early = 0                   !! rows before the last ones
    integer, allocatable :: chosen(:)      !! of the last ones: in the order of their pivots
    real(wp), allocatable :: factor(:, :)  !! of what is left for these
  end type envelope_type

  !> A smaller pivot is of a row that follows from those before: a rounding error.
  real(wp), parameter :: follows = 1.0e-7_wp
  !> Part of a component's largest diagonal that is none: of a spline that hardly reaches any point.
  real(wp), parameter :: nothing = 1.0e-12_wp
  character(*), parameter :: outside = 'an element outside of an envelope'

contains

  !> Room for a matrix of zeros.
  pure subroutine new_envelope(place, lowest, last, components, envelope)
    integer, intent(in) :: place(:)     !! (nodes) place of each in an order that keeps those that
                                        !! have elements together near each other
    integer, intent(in) :: lowest(:)    !! (places) the lowest place that has elements with this one
    integer, intent(in) :: last         !! places of the last rows, whose lowest is 1
    integer, intent(in) :: components   !! rows of a node
    type(envelope_type), intent(out) :: envelope
    integer(i8) :: n
    integer :: p, c, row

    envelope%components = components
    envelope%place = place
    envelope%early = components*(size(place) - last)
    allocate (envelope%first(components*size(place)), envelope%before(components*size(place)))
    n = 0
    do p = 1, size(place)
      do c = 1, components
        row = components*(p - 1) + c
        envelope%first(row) = components*(lowest(p) - 1) + 1
        envelope%before(row) = n - envelope%first(row) + 1
        n = n + row - envelope%first(row) + 1
      end do
    end do
    allocate (envelope%element(n), source=0.0_wp)
  end subroutine new_envelope

  !> Multiplications that factorizing will take.
  pure real(wp) function work_of_envelope(lowest, components) result(work)
    integer, intent(in) :: lowest(:)    !! as in `new_envelope`
    integer, intent(in) :: components   !! rows of a node
    integer :: p

    work = 0.0_wp
    do p = 1, size(lowest)
      work = work + components*(real(components, wp)*(p - lowest(p) + 1))**2/2
    end do
  end function work_of_envelope

  !> Add the product of a vector with its transpose.
  subroutine add_product(nodes, vector, low, high, envelope)
    integer, intent(in) :: nodes(:)       !! nodes where the vector is not zero
    real(wp), intent(in) :: vector(:, :)  !! (components, same)
    integer, intent(in) :: low, high      !! first and last component that is not zero
    type(envelope_type), intent(inout) :: envelope  !! not yet factorized
    integer :: a, b

    do a = 1, size(nodes)
      do b = 1, size(nodes)
        associate (p => envelope%place(nodes(a)), q => envelope%place(nodes(b)))
          if (q <= p) call add_elements(p, q, 1.0_wp, vector(:, a), vector(:, b), low, high, &
            & envelope)
        end associate
      end do
    end do
  end subroutine add_product

  !> Add a matrix of nodes, each of its elements times the product of a pattern with its transpose.
  subroutine add_block(nodes, block, pattern, low, high, envelope)
    integer, intent(in) :: nodes(:)       !! nodes of the block's rows
    real(wp), intent(in) :: block(:, :)   !! (nodes, nodes) symmetric
    real(wp), intent(in) :: pattern(:)    !! (components)
    integer, intent(in) :: low, high      !! first and last component that is not zero
    type(envelope_type), intent(inout) :: envelope  !! not yet factorized
    integer :: a, b

    do a = 1, size(nodes)
      do b = 1, size(nodes)
        associate (p => envelope%place(nodes(a)), q => envelope%place(nodes(b)))
          if (q <= p) call add_elements(p, q, block(b, a), pattern, pattern, low, &
            & high, envelope)
        end associate
      end do
    end do
  end subroutine add_block

  !> Add a matrix with one component for each node in the same way, and make it zero.
  subroutine move_to(of_nodes, pattern, low, high, envelope)
    type(envelope_type), intent(inout) :: of_nodes  !! of the same nodes in the same order
    real(wp), intent(in) :: pattern(:)              !! (components)
    integer, intent(in) :: low, high                !! first and last component that is not zero
    type(envelope_type), intent(inout) :: envelope  !! not yet factorized
    integer :: p, q

    do p = 1, size(of_nodes%place)
      do q = of_nodes%first(p), p
        associate (value => of_nodes%element(of_nodes%before(p) + q))
          if (.not. abs(value) > 0.0_wp) cycle
          call add_elements(p, q, value, pattern, pattern, low, high, envelope)
          value = 0.0_wp
        end associate
      end do
    end do
  end subroutine move_to

  !> Add a value times the product of two vectors to the elements of two places.
  subroutine add_elements(p, q, value, one, other, low, high, envelope)
    integer, intent(in) :: p, q                   ! places, the second not above the first
    real(wp), intent(in) :: value
    real(wp), intent(in) :: one(:), other(:)      ! (components) of either place
    integer, intent(in) :: low, high              ! first and last component that is not zero
    type(envelope_type), intent(inout) :: envelope
    integer :: c, last, row

    do c = low, high
      row = envelope%components*(p - 1) + c
      last = merge(c, high, p == q)
      associate (column => envelope%components*(q - 1))
        if (column + 1 < envelope%first(row)) call internal_fault(outside)
        associate (at => envelope%before(row) + column, part => value*one(c))
          envelope%element(at + low:at + last) = envelope%element(at + low:at + last) &
            & + part*other(low:last)
        end associate
      end associate
    end do
  end subroutine add_elements

  !> Replace the matrix by its factor.
  subroutine factorize_envelope(envelope)
    type(envelope_type), intent(inout) :: envelope
    real(wp), parameter :: never = 1.0e30_wp  ! pivot of a row that follows from others
    real(wp), allocatable :: rest(:, :)
    real(wp) :: largest(envelope%components), pivot
    integer :: i, j, low

    associate (f => envelope%element, before => envelope%before, first => envelope%first, &
      & early => envelope%early)
      allocate (envelope%scale(size(first)), source=0.0_wp)
      largest = 0.0_wp
      do i = 1, size(first)
        associate (of_component => largest(modulo(i - 1, envelope%components) + 1))
          of_component = max(of_component, f(before(i) + i))
        end associate
      end do
      do i = 1, size(first)
        pivot = f(before(i) + i)
        if (pivot > nothing*largest(modulo(i - 1, envelope%components) + 1)) &
          & envelope%scale(i) = 1/sqrt(pivot)
        do j = first(i), i
          f(before(i) + j) = envelope%scale(i)*f(before(i) + j)*envelope%scale(j)
        end do
      end do
      do i = 1, size(first)
        do j = first(i), min(i - 1, early)
          low = max(first(i), first(j))
          f(before(i) + j) = (f(before(i) + j) - product_of(f(before(i) + low:before(i) + j - 1), &
            & f(before(j) + low:before(j) + j - 1)))/f(before(j) + j)
        end do
        if (i > early) cycle
        pivot = f(before(i) + i) - product_of(f(before(i) + first(i):before(i) + i - 1), &
          & f(before(i) + first(i):before(i) + i - 1))
        if (.not. pivot > follows) pivot = never
        f(before(i) + i) = sqrt(pivot)
      end do
      allocate (rest(size(first) - early, size(first) - early))
      do i = early + 1, size(first)
        do j = early + 1, i
          rest(i - early, j - early) = f(before(i) + j) - product_of( &
            & f(before(i) + 1:before(i) + early), f(before(j) + 1:before(j) + early))
          rest(j - early, i - early) = rest(i - early, j - early)
        end do
      end do
    end associate
    call factorize_pivoted(rest, envelope%chosen)
    envelope%factor = rest(:size(envelope%chosen), :size(envelope%chosen))
  end subroutine factorize_envelope

  !> Cholesky's factor of a semidefinite matrix: rows in the order of the largest pivot, until what
  !> is left follows from those before.
  pure subroutine factorize_pivoted(f, chosen)
    real(wp), intent(inout) :: f(:, :)               ! the matrix; its factor in the chosen order
    integer, allocatable, intent(out) :: chosen(:)   ! rows in their order
    real(wp) :: left(size(f, 1)), column(size(f, 1)), factor(size(f, 1), size(f, 1))
    integer :: order(size(f, 1)), n, i, at

    n = size(f, 1)
    factor = 0.0_wp
    do i = 1, n
      left(i) = f(i, i)
    end do
    do i = 1, n
      at = maxloc(left, dim=1)
      if (.not. left(at) > follows) exit
      order(i) = at
      column = (f(:, at) - matmul(factor(:, :i - 1), factor(at, :i - 1)))/sqrt(left(at))
      left = left - column**2
      column(order(:i - 1)) = 0.0_wp
      left(order(:i)) = 0.0_wp
      factor(:, i) = column
    end do
    i = i - 1
    chosen = order(:i)
    f(:i, :i) = factor(chosen, :i)
  end subroutine factorize_pivoted

  !> Solve for the values of nodes.
  subroutine solve_envelope(envelope, c)
    type(envelope_type), intent(in) :: envelope  !! factorized
    real(wp), intent(inout) :: c(:, :)           !! (components, nodes) right side, then solution
    real(wp) :: x(size(c)), last(size(c) - envelope%early), y(size(envelope%chosen))
    integer :: i, n, s

    n = envelope%components
    do s = 1, size(c, 2)
      associate (at => n*(envelope%place(s) - 1))
        x(at + 1:at + n) = envelope%scale(at + 1:at + n)*c(:, s)
      end associate
    end do
    associate (f => envelope%element, before => envelope%before, first => envelope%first, &
      & early => envelope%early, chosen => envelope%chosen, late => envelope%factor)
      do i = 1, early
        x(i) = (x(i) - product_of(f(before(i) + first(i):before(i) + i - 1), x(first(i):i - 1))) &
          & /f(before(i) + i)
      end do
      do i = early + 1, size(x)
        last(i - early) = x(i) - product_of(f(before(i) + 1:before(i) + early), x(:early))
      end do
      y = last(chosen)
      do i = 1, size(y)
        y(i) = y(i)/late(i, i)
        y(i + 1:) = y(i + 1:) - y(i)*late(i + 1:, i)
      end do
      do i = size(y), 1, -1
        y(i) = (y(i) - dot_product(late(i + 1:, i), y(i + 1:)))/late(i, i)
      end do
      x(early + 1:) = 0.0_wp
      x(early + chosen) = y
      do i = early + 1, size(x)
        x(:early) = x(:early) - x(i)*f(before(i) + 1:before(i) + early)
      end do
      do i = early, 1, -1
        x(i) = x(i)/f(before(i) + i)
        x(first(i):i - 1) = x(first(i):i - 1) - x(i)*f(before(i) + first(i):before(i) + i - 1)
      end do
    end associate
    do s = 1, size(c, 2)
      associate (at => n*(envelope%place(s) - 1))
        c(:, s) = envelope%scale(at + 1:at + n)*x(at + 1:at + n)
      end associate
    end do
  end subroutine solve_envelope

  !> The sum of the products of two rows of numbers.
  pure real(wp) function product_of(one, other) result(total)
    real(wp), contiguous, intent(in) :: one(:), other(:)  ! (same)
    integer :: i

    total = 0.0_wp
    !$omp simd reduction(+: total)
    do i = 1, size(one)
      total = total + one(i)*other(i)
    end do
  end function product_of

end module pd_set_up_consistent_envelope
