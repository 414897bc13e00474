!> Displacements that vary slowly, as a second part of the preconditioner of conjugate gradients
!> (doc/theory.md, 7): the diagonal alone needs as many iterations as a body is horizons long. They
!> are combinations of functions that are 1 at a node of a coarse grid and fall linearly to 0 at the
!> nodes next to it. A node whose surroundings a crack cuts in parts has one function for each part.
!>
!> Here: the functions, their stiffness as it is factored, and what a field is in terms of them.
!> `pd_motion_static_coarsen` makes them.
module pd_motion_coarse
  use pd_base_kinds, only: wp, i4, i8
  implicit none (type, external)
  private
  public :: coarse_type, restrict_to, solve_for, add_slow, factorise

  !> A pivot below this part of the diagonal is a motion without stiffness, which is left out.
  real(wp), parameter :: no_stiffness = 1.0e-9_wp

  integer, parameter :: most_corners = 8  !! of a cell

  type :: coarse_type
    integer :: dim = 0
    integer :: n = 0                    !! unknowns; 0: there is no coarse part
    integer(i8) :: broken = -1_i8       !! bonds that were broken when it was made
    ! points by parts of a cell of the grid
    integer(i4), allocatable :: start(:)   !! first place of each part in `slots` (parts + 1)
    integer(i4), allocatable :: slots(:)   !! of the points, part by part
    real(wp), allocatable :: place(:, :)   !! within the cell, 0 to 1 (3, points) [-]
    integer(i4), allocatable :: unknown(:, :, :)
      !! of each component, corner of the cell, and part (dim, 2**dim, parts); 0: none
    integer(i4), allocatable :: slot_of(:)  !! a slot of each unknown's part (n)
    ! lower half of the stiffness, rows from their first entry on; its Cholesky factor
    integer(i4), allocatable :: first(:)   !! column of each row's first entry (n)
    integer(i8), allocatable :: before(:)  !! entries before column 1 of a row would be (n)
    real(wp), allocatable :: entry(:)      !! row by row [N/m]
  end type coarse_type

contains

  !> The values of the functions of a cell's eight corners at a place in the cell: products of 1 - x
  !> or x for each axis. In 1D and 2D the place is 0 along the other axes, and so are the values of
  !> the corners there. Always eight, so that they are one vector of the processor.
  pure function corner_values(place) result(values)
    real(wp), intent(in) :: place(3)    !! 0 to 1 [-]
    real(wp) :: values(most_corners)
    real(wp), parameter :: at_0(most_corners, 3) = reshape([1, 0, 1, 0, 1, 0, 1, 0, &
      & 1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 1, 1, 0, 0, 0, 0]*1.0_wp, [most_corners, 3])
    real(wp), parameter :: slope(most_corners, 3) = 1 - 2*at_0

    values = (at_0(:, 1) + slope(:, 1)*place(1))*(at_0(:, 2) + slope(:, 2)*place(2)) &
      & *(at_0(:, 3) + slope(:, 3)*place(3))
  end function corner_values

  !> The sums over the points of volume, field and each function: for a force density the forces
  !> that act on the unknowns.
  subroutine restrict_to(coarse, volume, field, amounts)
    type(coarse_type), intent(in) :: coarse
    real(wp), intent(in), contiguous :: volume(:)    !! (n_slots) [m3]
    real(wp), intent(in), contiguous :: field(:, :)  !! (n_slots, dim)
    real(wp), intent(out) :: amounts(:)              !! (n) in units of the field times m3
    real(wp), allocatable :: of_part(:, :, :)
    real(wp) :: sums(most_corners)
    integer :: e, i, k, c, a

    allocate (of_part(most_corners, coarse%dim, size(coarse%start) - 1))
    !$omp parallel do schedule(static) default(none) shared(coarse, volume, field, of_part) &
    !$omp private(e, i, k, c, sums)
    do e = 1, size(of_part, 3)
      ! the values are made again for each component, so that the sums are one register
      do c = 1, size(of_part, 2)
        sums = 0.0_wp
        do i = coarse%start(e), coarse%start(e + 1) - 1
          k = coarse%slots(i)
          sums = sums + (volume(k)*field(k, c))*corner_values(coarse%place(:, i))
        end do
        of_part(:, c, e) = sums
      end do
    end do
    amounts = 0.0_wp
    do e = 1, size(of_part, 3)
      do a = 1, size(coarse%unknown, 2)
        do c = 1, coarse%dim
          i = coarse%unknown(c, a, e)
          if (i > 0) amounts(i) = amounts(i) + of_part(a, c, e)
        end do
      end do
    end do
  end subroutine restrict_to

  !> Add `factor` times the combination of the functions to a field, where `allowed` is positive.
  subroutine add_slow(coarse, amounts, factor, allowed, field, largest)
    type(coarse_type), intent(in) :: coarse
    real(wp), intent(in) :: amounts(:)         !! (n) of each function
    real(wp), intent(in) :: factor             !! [-]
    real(wp), intent(in), contiguous :: allowed(:, :)
      !! (n_slots, dim) components that are not > 0 stay as they are
    real(wp), intent(inout), contiguous :: field(:, :)  !! (n_slots, dim)
    real(wp), intent(out) :: largest           !! absolute value of the field at the points then
    real(wp) :: values(most_corners), corners(most_corners, 3)
    integer :: e, i, k, c, a

    largest = 0.0_wp
    !$omp parallel do schedule(static) default(none) shared(coarse, amounts, factor, field, &
    !$omp allowed) private(e, i, k, c, a, values, corners) reduction(max:largest)
    do e = 1, size(coarse%start) - 1
      corners = 0.0_wp
      do a = 1, size(coarse%unknown, 2)
        do c = 1, coarse%dim
          if (coarse%unknown(c, a, e) > 0) corners(a, c) = factor*amounts(coarse%unknown(c, a, e))
        end do
      end do
      do i = coarse%start(e), coarse%start(e + 1) - 1
        k = coarse%slots(i)
        values = corner_values(coarse%place(:, i))
        do c = 1, size(field, 2)
          if (allowed(k, c) > 0.0_wp) field(k, c) = field(k, c) + sum(values*corners(:, c))
          largest = max(largest, abs(field(k, c)))
        end do
      end do
    end do
  end subroutine add_slow

  !> Take the stiffness for its Cholesky factor. Unknowns that meet no stiffness beside those before
  !> them are left out: `solve_for` makes them 0.
  pure subroutine factorise(coarse)
    type(coarse_type), intent(inout) :: coarse  !! with its stiffness
    real(wp) :: pivot
    integer :: i, j, low

    associate (first => coarse%first, before => coarse%before, l => coarse%entry)
      do i = 1, coarse%n
        do j = first(i), i - 1
          if (.not. l(before(j) + j) > 0.0_wp) then
            l(before(i) + j) = 0.0_wp
            cycle
          end if
          low = max(first(i), first(j))
          l(before(i) + j) = (l(before(i) + j) - dot_product(l(before(i) + low:before(i) + j - 1), &
            & l(before(j) + low:before(j) + j - 1)))/l(before(j) + j)
        end do
        pivot = l(before(i) + i) &
          & - sum(l(before(i) + first(i):before(i) + i - 1)**2)
        if (pivot > no_stiffness*l(before(i) + i)) then
          l(before(i) + i) = sqrt(pivot)
        else
          l(before(i) + first(i):before(i) + i) = 0.0_wp
        end if
      end do
    end associate
  end subroutine factorise

  !> The displacements of the unknowns under given forces.
  pure subroutine solve_for(coarse, forces, amounts)
    type(coarse_type), intent(in) :: coarse  !! factored
    real(wp), intent(in) :: forces(:)        !! (n) [N]
    real(wp), intent(out) :: amounts(:)      !! (n) [m]
    integer :: i

    amounts = forces
    associate (first => coarse%first, before => coarse%before, l => coarse%entry)
      do i = 1, coarse%n
        if (l(before(i) + i) > 0.0_wp) then
          amounts(i) = (amounts(i) - dot_product(l(before(i) + first(i):before(i) + i - 1), &
            & amounts(first(i):i - 1)))/l(before(i) + i)
        else
          amounts(i) = 0.0_wp
        end if
      end do
      do i = coarse%n, 1, -1
        if (.not. l(before(i) + i) > 0.0_wp) cycle
        amounts(i) = amounts(i)/l(before(i) + i)
        amounts(first(i):i - 1) = amounts(first(i):i - 1) &
          & - amounts(i)*l(before(i) + first(i):before(i) + i - 1)
      end do
    end associate
  end subroutine solve_for

end module pd_motion_coarse
