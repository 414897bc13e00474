!> Moments that the surface areas of points must have for weights of bonds to exist that are exact
!> under uniform strain (doc/theory.md, 4): sum_k A_k . w(x_k) = sum_k V_k div w(x_k) for all fields
!> w whose component along any line is at most quadratic along that line. Those are all quadratic
!> fields, and the cubic ones that turn: q(x) times the rotation in the plane, q(x) x in space.
module pd_body_mesh_moments
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: moments_type, number_of_fields, fields_at, turn_to, solve_moments, vector_at, &
    & keep_sums

  !> A combination of the fields, in coordinates (x - origin)/scale.
  type :: moments_type
    real(wp) :: origin(3) = 0.0_wp           !! [m]
    real(wp) :: scale = 1.0_wp               !! [m]
    logical :: linear = .true.               !! facets keep linear functions as they are
    real(wp), allocatable :: multiplier(:)   !! (fields)
  end type moments_type

contains

  !> How many fields there are; some of the cubic ones depend on others.
  pure integer function number_of_fields(dim) result(n)
    integer, intent(in) :: dim  !! number of dimensions
    n = dim*(dim + 1)*(dim + 2)/2
    if (dim == 2) n = n + 3
    if (dim == 3) n = n + 18
  end function number_of_fields

  !> All fields at a place, and their divergences with respect to the scaled coordinates. The first
  !> dim (dim + 1) are constant or linear.
  pure subroutine fields_at(x, w, divergence)
    real(wp), intent(in) :: x(:)                !! (dim) scaled coordinates [-]
    real(wp), intent(out) :: w(:, :)            !! (dim, fields)
    real(wp), intent(out) :: divergence(:)      !! (fields)
    real(wp) :: turned(size(x))
    integer :: dim, n, a, b, c

    dim = size(x)
    w = 0.0_wp
    divergence = 0.0_wp
    n = 0
    do c = 1, dim
      n = n + 1
      w(c, n) = 1.0_wp
    end do
    do a = 1, dim
      do c = 1, dim
        n = n + 1
        w(c, n) = x(a)
        if (a == c) divergence(n) = 1.0_wp
      end do
    end do
    do a = 1, dim
      do b = a, dim
        do c = 1, dim
          n = n + 1
          w(c, n) = x(a)*x(b)
          if (a == c) divergence(n) = divergence(n) + x(b)
          if (b == c) divergence(n) = divergence(n) + x(a)
        end do
      end do
    end do
    if (dim == 1) return
    ! a field without divergence times q has the divergence grad q . field
    do a = 1, dim
      do b = a, dim
        do c = merge(3, 1, dim == 2), 3
          n = n + 1
          call turn_to(x, c, turned)
          w(:, n) = x(a)*x(b)*turned
          divergence(n) = x(b)*turned(a) + x(a)*turned(b)
        end do
      end do
    end do
  end subroutine fields_at

  !> The rotation about an axis, at a place.
  pure subroutine turn_to(x, axis, turned)
    real(wp), intent(in) :: x(:)          !! (dim) place
    integer, intent(in) :: axis           !! 1 to 3; in the plane 3
    real(wp), intent(out) :: turned(:)    !! (dim) axis x place
    integer :: one, other

    one = 1 + mod(axis, 3)
    other = 1 + mod(axis + 1, 3)
    turned = 0.0_wp
    turned(one) = -x(other)
    turned(other) = x(one)
  end subroutine turn_to

  !> Multipliers of the fields from their symmetric matrix, of which some rows follow from others.
  pure subroutine solve_moments(matrix, right, multiplier)
    real(wp), intent(in) :: matrix(:, :)       !! (fields, fields) semidefinite
    real(wp), intent(in) :: right(:)           !! (fields)
    real(wp), intent(out) :: multiplier(:)     !! (fields) 0 for those that follow from others
    real(wp), parameter :: follows = 1.0e-12_wp
    real(wp) :: f(size(right), size(right)), pivot
    logical :: left_out(size(right))
    integer :: i, j, n

    n = size(right)
    f = matrix
    multiplier = right
    do j = 1, n
      pivot = f(j, j) - sum(f(j, :j - 1)**2)
      left_out(j) = pivot <= follows*max(matrix(j, j), 1.0e-6_wp*maxval([(matrix(i, i), i=1, n)]))
      if (left_out(j)) then
        f(j, :) = 0.0_wp
        f(:, j) = 0.0_wp
        f(j, j) = 1.0_wp
        multiplier(j) = 0.0_wp
        cycle
      end if
      f(j, j) = sqrt(pivot)
      do i = j + 1, n
        f(i, j) = (f(i, j) - dot_product(f(i, :j - 1), f(j, :j - 1)))/f(j, j)
      end do
    end do
    do j = 1, n
      if (left_out(j)) cycle
      multiplier(j) = (multiplier(j) - dot_product(f(j, :j - 1), multiplier(:j - 1)))/f(j, j)
    end do
    do j = n, 1, -1
      if (left_out(j)) cycle
      multiplier(j) = (multiplier(j) - dot_product(f(j + 1:, j), multiplier(j + 1:)))/f(j, j)
    end do
  end subroutine solve_moments

  !> Take from each column of `values` its sum and, with `linear`, its first moments: the part that
  !> is a linear function of the places. With `root` that is so for root x values.
  pure subroutine keep_sums(x, linear, values, root)
    real(wp), intent(in) :: x(:, :)            !! (points, dim) [m]
    logical, intent(in) :: linear              !! whether first moments are taken, too
    real(wp), intent(inout) :: values(:, :)    !! (points, columns)
    real(wp), intent(in), optional :: root(:)  !! (points) > 0
    real(wp), parameter :: follows = 1.0e-10_wp
    real(wp) :: base(size(x, 1), size(x, 2) + 1), length, before
    integer :: i, j, n, again

    base(:, 1) = 1.0_wp
    base(:, 2:) = x - spread(sum(x, dim=1)/size(x, 1), 1, size(x, 1))
    n = merge(size(base, 2), 1, linear)
    if (present(root)) base = base*spread(root, 2, size(base, 2))
    ! Gram and Schmidt, each twice against rounding
    do i = 1, n
      before = norm2(base(:, i))
      do again = 1, 2
        do j = 1, i - 1
          base(:, i) = base(:, i) - dot_product(base(:, j), base(:, i))*base(:, j)
        end do
      end do
      length = norm2(base(:, i))
      base(:, i) = merge(base(:, i)/max(length, tiny(1.0_wp)), 0.0_wp, length > follows*before)
    end do
    do again = 1, 2
      do i = 1, n
        do j = 1, size(values, 2)
          values(:, j) = values(:, j) - dot_product(base(:, i), values(:, j))*base(:, i)
        end do
      end do
    end do
  end subroutine keep_sums

  !> The combined field at a place.
  pure function vector_at(moments, x) result(w)
    type(moments_type), intent(in) :: moments  !! with multipliers
    real(wp), intent(in) :: x(:)               !! (dim) [m]
    real(wp) :: w(size(x))
    real(wp) :: fields(size(x), size(moments%multiplier)), divergence(size(moments%multiplier))

    call fields_at((x - moments%origin(:size(x)))/moments%scale, fields, divergence)
    w = matmul(fields, moments%multiplier)
  end function vector_at

end module pd_body_mesh_moments
