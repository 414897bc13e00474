!> Interpolation between places and instants: exact for what it is made of.
module test_output_fields_interpolate
  use pd_base_kinds, only: wp
  use pd_family_cells, only: cells_type
  use pd_output_fields_interpolate, only: find_stencil, grid_of_places, rows_around, stencil_type
  use bodies, only: expect, expect_true
  use testdrive, only: error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_output_fields_interpolate

contains

  subroutine collect_output_fields_interpolate(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('second degree is exact in every dimension', test_quadratic), &
      & new_unittest('the value of an existing point is used', test_same), &
      & new_unittest('too few places', test_few), &
      & new_unittest('a cubic in time is exact', test_time), &
      & new_unittest('no value beyond the last row', test_ends)]
  end subroutine collect_output_fields_interpolate

  !> Places of a box of n^dim cells of the edge `h`, shaken by a tenth of it.
  subroutine box(dim, n, h, x)
    integer, intent(in) :: dim, n
    real(wp), intent(in) :: h
    real(wp), allocatable, intent(out) :: x(:, :)
    integer :: i, c

    allocate (x(dim, n**dim))
    do i = 1, n**dim
      do c = 1, dim
        x(c, i) = h*(modulo((i - 1)/n**(c - 1), n) + 0.5_wp + 0.1_wp*shake(3*i + c))
      end do
    end do
  end subroutine box

  !> Numbers between -1 and 1 without order.
  pure real(wp) function shake(i)
    integer, intent(in) :: i
    shake = 2*modulo(0.6180339887_wp*i, 1.0_wp) - 1
  end function shake

  pure real(wp) function polynomial(x)
    real(wp), intent(in) :: x(:)
    integer :: c
    polynomial = 1.0_wp
    do c = 1, size(x)
      polynomial = polynomial + c*x(c) - 2*x(c)**2 + 3*x(1)*x(c)
    end do
  end function polynomial

  !> Normal equations of a condition about 1e3 leave 1e-11 of values of order 1; inside, near a side
  !> and in a corner.
  subroutine test_quadratic(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: x(:, :), at(:)
    type(cells_type) :: cells
    type(stencil_type) :: stencil
    real(wp), parameter :: h = 0.1_wp
    real(wp) :: value
    integer :: dim, i, j

    do dim = 1, 3
      call box(dim, 9, h, x)
      call grid_of_places(x, h, cells)
      do i = 1, 12
        at = [(0.45_wp + 0.4_wp*shake(100*i + j), j=1, dim)]
        if (i == 1) at = 0.051_wp
        if (i == 2) at(1) = 0.85_wp
        call find_stencil(cells, x, h, at, stencil)
        value = sum([(stencil%weight(j)*polynomial(x(:, stencil%place(j))), &
          & j=1, size(stencil%place))])
        call expect(error, value, polynomial(at), 1.0e-10_wp, 'value')
        call expect_true(error, size(stencil%place) > 1, 'several places')
      end do
    end do
  end subroutine test_quadratic

  subroutine test_same(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: x(:, :)
    type(cells_type) :: cells
    type(stencil_type) :: stencil

    call box(2, 6, 0.5_wp, x)
    call grid_of_places(x, 0.5_wp, cells)
    call find_stencil(cells, x, 0.5_wp, x(:, 17) + 1.0e-9_wp, stencil)
    call expect_true(error, size(stencil%place) == 1, 'one place')
    if (allocated(error)) return
    call expect_true(error, stencil%place(1) == 17, 'that place')
    call expect(error, stencil%weight(1), 1.0_wp, 0.0_wp, 'its value')
  end subroutine test_same

  !> A row of points in the plane says nothing across it; far away there is nothing at all.
  subroutine test_few(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: x(2, 5)
    type(cells_type) :: cells
    type(stencil_type) :: stencil
    integer :: i

    x(1, :) = [(1.0_wp*i, i=1, 5)]
    x(2, :) = 0.0_wp
    call grid_of_places(x, 1.0_wp, cells)
    call find_stencil(cells, x, 1.0_wp, [2.2_wp, 0.1_wp], stencil)
    call expect_true(error, size(stencil%place) == 1, 'the nearest alone')
    if (.not. allocated(error)) call expect_true(error, stencil%place(1) == 2, 'number 2')
    call find_stencil(cells, x, 1.0_wp, [30.0_wp, 0.0_wp], stencil)
    call expect_true(error, size(stencil%place) == 0, 'nothing')
  end subroutine test_few

  subroutine test_time(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: times(6) = [0.0_wp, 1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp, 4.3_wp]
    type(stencil_type) :: rows
    real(wp) :: t
    integer :: i

    do i = 0, 43
      t = 0.1_wp*i
      call rows_around(times, t, rows)
      call expect(error, sum(rows%weight*cubic(times(rows%place))), cubic(t), 1.0e-12_wp, 'value')
    end do

  contains

    elemental real(wp) function cubic(at)
      real(wp), intent(in) :: at
      cubic = 1 - at + 0.5_wp*at**2 - 0.1_wp*at**3
    end function cubic
  end subroutine test_time

  subroutine test_ends(error)
    type(error_type), allocatable, intent(out) :: error
    type(stencil_type) :: rows

    call rows_around([0.0_wp, 1.0_wp], 1.1_wp, rows)
    call expect_true(error, size(rows%place) == 0, 'behind the last')
    call rows_around([0.5_wp, 1.0_wp], 0.4_wp, rows)
    call expect_true(error, size(rows%place) == 0, 'before the first')
    call rows_around([0.0_wp, 1.0_wp], 1 + 1.0e-12_wp, rows)
    call expect_true(error, size(rows%place) == 2, 'a hair behind is the last')
    call rows_around([2.0_wp], 2.0_wp, rows)
    call expect_true(error, size(rows%place) == 1, 'a single row')
  end subroutine test_ends

end module test_output_fields_interpolate
