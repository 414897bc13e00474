!> Products of the conditions on weights (`pd_set_up_consistent_conditions`) with values of the
!> unknowns and with multipliers, and their blocks. Loops run over the bonds of a class one by one,
!> so that a processor takes eight at a time.
module pd_set_up_consistent_products
  use pd_base_kinds, only: wp, i8
  use pd_set_up_consistent_conditions, only: coefficients, conditions_type, few, most_rows
  implicit none (type, external)
  private
  public :: sums_of, spread_over, block_of

  integer, parameter :: most_run = 128  !! bonds that are worked with at once

contains

  !> The sums of the conditions (rows, classes) for values of the unknowns.
  subroutine sums_of(conditions, y, sums)
    type(conditions_type), intent(in) :: conditions
    real(wp), intent(in) :: y(:)           !! (unknowns) [-]
    real(wp), intent(inout) :: sums(:, :)  !! (rows, classes) set [-]
    real(wp) :: values(most_rows), of_bonds(most_run)
    integer(i8) :: e, last
    integer :: c, i, low, high

    !$omp parallel do schedule(dynamic, 64) default(none) shared(conditions, y, sums) &
    !$omp private(values, of_bonds, e, last, c, i, low, high) if (conditions%classes > few)
    do c = 1, conditions%classes
      sums(:, c) = 0.0_wp
      do e = conditions%start(c), conditions%last(1, c), most_run
        last = min(e + most_run - 1, conditions%last(1, c))
        do i = 1, int(last - e) + 1
          of_bonds(i) = y(conditions%unknown(e + i - 1))
        end do
        call sum_stretches(conditions%n(e:last, :), conditions%factor(e:last, 1), of_bonds, &
          & sums(:conditions%before, c))
      end do
      do e = conditions%last(1, c) + 1, conditions%last(2, c), most_run
        last = min(e + most_run - 1, conditions%last(2, c))
        do i = 1, int(last - e) + 1
          of_bonds(i) = y(conditions%unknown(e + i - 1))
        end do
        call sum_dilatations(conditions%n(e:last, :), conditions%factor(e:last, :), of_bonds, &
          & sums(conditions%before + 1:, c))
      end do
      ! components of areas
      do e = conditions%last(2, c) + 1, conditions%start(c + 1) - 1
        call coefficients(conditions, e, values, low, high)
        sums(low:high, c) = sums(low:high, c) + y(conditions%unknown(e))*values(low:high)
      end do
    end do
  end subroutine sums_of

  !> The transposed product over `counts`: what multipliers of the conditions give each unknown.
  subroutine spread_over(conditions, free, multipliers, given, y)
    type(conditions_type), intent(in) :: conditions
    logical, intent(in) :: free(:)             !! (unknowns) others get 0
    real(wp), intent(in) :: multipliers(:, :)  !! (rows, classes) [-]
    real(wp), intent(inout) :: given(:)        !! (bonds) room for what each bond gets
    real(wp), intent(inout) :: y(:)            !! (unknowns) set [-]
    real(wp) :: values(most_rows), sum
    integer(i8) :: e, last, i
    integer :: c, u, low, high, pairs

    ! where each unknown is of one bond, its two ends follow each other
    pairs = merge(conditions%stretches + conditions%dilatations, 0, conditions%alone)
    !$omp parallel default(none) shared(conditions, free, multipliers, y, given, pairs) &
    !$omp private(values, sum, e, last, i, c, u, low, high) if (conditions%classes > few)
    ! what the multipliers of a class give its bonds, class by class; then the sum of each unknown
    !$omp do schedule(dynamic, 64)
    do c = 1, conditions%classes
      do e = conditions%start(c), conditions%last(1, c), most_run
        last = min(e + most_run - 1, conditions%last(1, c))
        call spread_stretches(conditions%n(e:last, :), conditions%factor(e:last, 1), &
          & multipliers(:conditions%before, c), given(e:last))
      end do
      do e = conditions%last(1, c) + 1, conditions%last(2, c), most_run
        last = min(e + most_run - 1, conditions%last(2, c))
        call spread_dilatations(conditions%n(e:last, :), conditions%factor(e:last, :), &
          & multipliers(conditions%before + 1:, c), given(e:last))
      end do
      ! components of areas
      do e = conditions%last(2, c) + 1, conditions%start(c + 1) - 1
        call coefficients(conditions, e, values, low, high)
        given(e) = dot_product(values(low:high), multipliers(low:high, c))
      end do
    end do
    !$omp do schedule(static)
    do u = 1, pairs
      y(u) = merge((given(conditions%bond(2*u - 1)) + given(conditions%bond(2*u))) &
        & /conditions%counts(u), 0.0_wp, free(u))
    end do
    !$omp do schedule(static)
    do u = pairs + 1, conditions%unknowns
      sum = 0.0_wp
      do i = conditions%first(u), conditions%first(u + 1) - 1
        sum = sum + given(conditions%bond(i))
      end do
      y(u) = merge(sum/conditions%counts(u), 0.0_wp, free(u))
    end do
    !$omp end parallel
  end subroutine spread_over

  !> Add the rows of the stretch for values of Gb.
  pure subroutine sum_stretches(n, factor, y, sums)
    real(wp), intent(in) :: n(:, :)     ! (bonds, dim)
    real(wp), intent(in) :: factor(:)   ! (bonds)
    real(wp), intent(in) :: y(:)        ! (at least as many as bonds)
    real(wp), intent(inout) :: sums(:)  ! (rows of the stretch)
    real(wp) :: one(most_run), two(most_run), sum
    integer :: row, x, z, w, i

    row = 0
    do x = 1, size(n, 2)
      do i = 1, size(n, 1)
        one(i) = y(i)*factor(i)*n(i, x)
      end do
      do z = x, size(n, 2)
        do i = 1, size(n, 1)
          two(i) = one(i)*n(i, z)
        end do
        do w = z, size(n, 2)
          sum = 0.0_wp
          do i = 1, size(n, 1)
            sum = sum + two(i)*n(i, w)
          end do
          row = row + 1
          sums(row) = sums(row) + sum
        end do
      end do
    end do
  end subroutine sum_stretches

  !> Add the rows of the dilatation for values of Gd.
  pure subroutine sum_dilatations(n, factor, y, sums)
    real(wp), intent(in) :: n(:, :)       ! (bonds, dim)
    real(wp), intent(in) :: factor(:, :)  ! (bonds, 2)
    real(wp), intent(in) :: y(:)          ! (at least as many as bonds)
    real(wp), intent(inout) :: sums(:)    ! (rows of the dilatation)
    real(wp) :: one(most_run), sum
    integer :: row, of_force, x, z, i

    row = 0
    of_force = size(sums) - size(n, 2)
    do x = 1, size(n, 2)
      sum = 0.0_wp
      do i = 1, size(n, 1)
        one(i) = y(i)*factor(i, 1)*n(i, x)
        sum = sum + y(i)*factor(i, 2)*n(i, x)
      end do
      sums(of_force + x) = sums(of_force + x) + sum
      do z = x, size(n, 2)
        sum = 0.0_wp
        do i = 1, size(n, 1)
          sum = sum + one(i)*n(i, z)
        end do
        row = row + 1
        sums(row) = sums(row) + sum
      end do
    end do
  end subroutine sum_dilatations

  !> What multipliers of the stretch give each bond.
  pure subroutine spread_stretches(n, factor, multipliers, given)
    real(wp), intent(in) :: n(:, :)         ! (bonds, dim)
    real(wp), intent(in) :: factor(:)       ! (bonds)
    real(wp), intent(in) :: multipliers(:)  ! (rows of the stretch)
    real(wp), intent(inout) :: given(:)     ! (bonds) set
    real(wp) :: one(most_run), two(most_run)
    integer :: row, x, z, w, i

    given = 0.0_wp
    row = 0
    do x = 1, size(n, 2)
      one(:size(n, 1)) = 0.0_wp
      do z = x, size(n, 2)
        two(:size(n, 1)) = 0.0_wp
        do w = z, size(n, 2)
          row = row + 1
          do i = 1, size(n, 1)
            two(i) = two(i) + multipliers(row)*n(i, w)
          end do
        end do
        do i = 1, size(n, 1)
          one(i) = one(i) + two(i)*n(i, z)
        end do
      end do
      do i = 1, size(n, 1)
        given(i) = given(i) + one(i)*factor(i)*n(i, x)
      end do
    end do
  end subroutine spread_stretches

  !> What multipliers of the dilatation give each bond.
  pure subroutine spread_dilatations(n, factor, multipliers, given)
    real(wp), intent(in) :: n(:, :)         ! (bonds, dim)
    real(wp), intent(in) :: factor(:, :)    ! (bonds, 2)
    real(wp), intent(in) :: multipliers(:)  ! (rows of the dilatation)
    real(wp), intent(inout) :: given(:)     ! (bonds) set
    real(wp) :: one(most_run)
    integer :: row, of_force, x, z, i

    given = 0.0_wp
    row = 0
    of_force = size(multipliers) - size(n, 2)
    do x = 1, size(n, 2)
      one(:size(n, 1)) = 0.0_wp
      do z = x, size(n, 2)
        row = row + 1
        do i = 1, size(n, 1)
          one(i) = one(i) + multipliers(row)*n(i, z)
        end do
      end do
      do i = 1, size(n, 1)
        given(i) = given(i) + (one(i)*factor(i, 1) + multipliers(of_force + x)*factor(i, 2))*n(i, x)
      end do
    end do
  end subroutine spread_dilatations

  !> The block (rows, rows) of class `c` in the product of the conditions with their transpose over
  !> `counts`, of the unknowns that are `free`.
  pure subroutine block_of(conditions, c, free, block)
    type(conditions_type), intent(in) :: conditions
    integer, intent(in) :: c              !! class
    logical, intent(in) :: free(:)        !! (unknowns)
    real(wp), intent(out) :: block(:, :)  !! (rows, rows) [-]
    real(wp) :: values(most_rows), of_unknown(most_rows)
    integer(i8) :: e, i
    integer :: row, low, high

    block = 0.0_wp
    do e = conditions%start(c), conditions%start(c + 1) - 1
      associate (u => conditions%unknown(e))
        if (.not. free(u)) cycle
        ! all bonds of the class with this unknown, at the first of them
        of_unknown = 0.0_wp
        low = 1
        high = 0
        do i = conditions%first(u), conditions%first(u + 1) - 1
          if (conditions%class(conditions%bond(i)) /= c) cycle
          if (conditions%bond(i) < e) exit
          call coefficients(conditions, conditions%bond(i), values, low, high)
          of_unknown(low:high) = of_unknown(low:high) + values(low:high)
        end do
        if (i < conditions%first(u + 1)) cycle
      end associate
      of_unknown(low:high) = of_unknown(low:high)/sqrt(conditions%counts(conditions%unknown(e)))
      do row = low, high
        block(low:high, row) = block(low:high, row) + of_unknown(row)*of_unknown(low:high)
      end do
    end do
  end subroutine block_of

end module pd_set_up_consistent_products
