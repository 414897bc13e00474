!> Volume correction: how much of a cell lies in the horizon.
module test_family_volume
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: pi
  use pd_family_volume, only: volume_rule_type, volume_correction, covered_fraction, reach, &
    & volume_rule_number, volume_none, volume_linear, volume_linear_extended, volume_exact
  use testdrive, only: error_type, new_unittest, unittest_type
  use bodies, only: expect, expect_true, noise
  implicit none (type, external)
  private
  public :: collect_family_volume

contains

  subroutine collect_family_volume(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('the linear rule is the book''s', test_linear), &
      & new_unittest('the extended rule reaches half a spacing further', test_extended), &
      & new_unittest('cells of a bar: covered lengths', test_bar), &
      & new_unittest('cells of a grid add up to the disc and the ball', test_ball), &
      & new_unittest('cells cut by a plane-like or quarter horizon', test_known_cells), &
      & new_unittest('covered parts do not depend on direction', test_symmetry), &
      & new_unittest('a cell halved in each direction keeps its covered volume', test_halves), &
      & new_unittest('rules by name', test_names)]
  end subroutine collect_family_volume

  !> 1 up to delta - r, (delta + r - |xi|)/2r up to delta; 1/2 at the edge itself.
  subroutine test_linear(error)
    type(error_type), allocatable, intent(out) :: error
    type(volume_rule_type) :: rule

    rule = volume_rule_type(volume_linear, 3.0_wp)
    call expect(error, at(2.4_wp), 1.0_wp, 0.0_wp, 'inside')
    call expect(error, at(2.5_wp), 1.0_wp, 0.0_wp, 'at delta - r')
    call expect(error, at(2.75_wp), 0.75_wp, 1.0e-15_wp, 'half way')
    call expect(error, at(3.0_wp), 0.5_wp, 1.0e-15_wp, 'at the edge')
    call expect(error, reach(rule, 1.0_wp, 3), 3.0_wp, 1.0e-8_wp, 'reach')
    rule = volume_rule_type(volume_none, 3.0_wp)
    call expect(error, at(3.0_wp), 1.0_wp, 0.0_wp, 'without correction')
    call expect(error, reach(rule, 1.0_wp, 3), 3.0_wp, 1.0e-8_wp, 'reach without correction')

  contains

    real(wp) function at(distance)
      real(wp), intent(in) :: distance
      at = volume_correction(rule, [distance, 0.0_wp, 0.0_wp], distance, 1.0_wp)
    end function at
  end subroutine test_linear

  subroutine test_extended(error)
    type(error_type), allocatable, intent(out) :: error
    type(volume_rule_type) :: rule

    rule = volume_rule_type(volume_linear_extended, 3.0_wp)
    call expect(error, volume_correction(rule, [3.25_wp], 3.25_wp, 1.0_wp), 0.25_wp, 1.0e-15_wp, &
      & 'beyond delta')
    call expect(error, volume_correction(rule, [3.5_wp], 3.5_wp, 1.0_wp), 0.0_wp, 1.0e-15_wp, &
      & 'at delta + r')
    call expect(error, reach(rule, 1.0_wp, 1), 3.5_wp, 1.0e-8_wp, 'reach')
    ! the linear rule is the true one in a bar
    call expect(error, volume_correction(rule, [2.9_wp], 2.9_wp, 1.0_wp), &
      & covered_fraction([2.9_wp], 1.0_wp, 3.0_wp), 1.0e-15_wp, 'bar')
  end subroutine test_extended

  subroutine test_bar(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: total
    integer :: i

    call expect(error, covered_fraction([2.0_wp], 1.0_wp, 3.0_wp), 1.0_wp, 0.0_wp, 'inside')
    call expect(error, covered_fraction([-3.2_wp], 1.0_wp, 3.0_wp), 0.3_wp, 1.0e-15_wp, &
      & 'across the edge')
    call expect(error, covered_fraction([3.6_wp], 1.0_wp, 3.0_wp), 0.0_wp, 0.0_wp, 'outside')
    call expect(error, covered_fraction([0.1_wp], 1.0_wp, 0.2_wp), 0.4_wp, 1.0e-15_wp, &
      & 'horizon inside the cell')
    total = 0.0_wp
    do i = -4, 4
      total = total + covered_fraction([real(i, wp)], 1.0_wp, 3.2_wp)
    end do
    call expect(error, total, 6.4_wp, 1.0e-14_wp, 'all cells are the horizon')
  end subroutine test_bar

  !> Whatever the grid's place and width: in 2D closed forms, so to rounding; in 3D six Gauss points
  !> per smooth piece, whose square-root ends cost up to some 1e-5 of a cell each (measured: 2e-6 of
  !> the ball at 3 spacings).
  subroutine test_ball(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: ratios(*) = [0.7_wp, 1.0_wp, 2.0_wp, 3.0_wp, 3.015_wp, 4.2_wp]
    real(wp) :: total, offset(3)
    integer :: r, i, j, k, n, place

    do r = 1, size(ratios)
      do place = 1, 2
        offset = 0.0_wp
        if (place == 2) offset = [0.21_wp, -0.37_wp, 0.11_wp]
        n = ceiling(ratios(r)) + 2
        total = 0.0_wp
        do j = -n, n
          do i = -n, n
            total = total + covered_fraction([real(i, wp), real(j, wp)] + offset(:2), 1.0_wp, &
              & ratios(r))
          end do
        end do
        call expect(error, total, pi*ratios(r)**2, 1.0e-13_wp*total, 'disc')
        total = 0.0_wp
        do k = -n, n
          do j = -n, n
            do i = -n, n
              total = total + covered_fraction([real(i, wp), real(j, wp), real(k, wp)] + offset, &
                & 1.0_wp, ratios(r))
            end do
          end do
        end do
        call expect(error, total, 4*pi*ratios(r)**3/3, 2.0e-5_wp*total, 'ball')
      end do
    end do
  end subroutine test_ball

  !> One cell at a time: a quarter of a disc, an eighth of a ball, and a horizon so large that its
  !> edge is a plane, here aslant through the cell's middle and through its third.
  subroutine test_known_cells(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: far = 1.0e3_wp
    real(wp) :: middle(3)

    call expect(error, covered_fraction([0.5_wp, 0.5_wp], 1.0_wp, 0.8_wp), pi*0.64_wp/4, &
      & 1.0e-14_wp, 'quarter disc')
    call expect(error, covered_fraction([0.5_wp, 0.5_wp, 0.5_wp], 1.0_wp, 0.8_wp), pi*0.512_wp/6, &
      & 1.0e-5_wp, 'eighth of a ball')
    middle = far/sqrt(3.0_wp)
    ! the edge is not quite plane: a cell's corner is up to 3/(8 far) off it
    call expect(error, covered_fraction(middle, 1.0_wp, far), 0.5_wp, 4.0e-4_wp, &
      & 'plane through the middle')
    middle = [far + 0.25_wp, 0.0_wp, 0.0_wp]
    call expect(error, covered_fraction(middle(:2), 1.0_wp, far), 0.25_wp, 1.0e-4_wp, &
      & 'straight, 2D')
    call expect(error, covered_fraction(middle, 1.0_wp, far), 0.25_wp, 2.0e-4_wp, 'straight, 3D')
    ! a corner alone inside: the triangle below x + y = t has area t^2/2, with t = 0.4
    middle(:2) = far/sqrt(2.0_wp) + 0.5_wp - 0.2_wp
    call expect(error, covered_fraction(middle(:2), 1.0_wp, far), 0.08_wp, 1.0e-4_wp, 'a corner')
  end subroutine test_known_cells

  !> Signs and order of the coordinates don't matter: momentum and isotropy rest on it. The 3D rule
  !> treats z unlike x and y, which shows in its quadrature's error; arcs near a quarter lose
  !> digits.
  subroutine test_symmetry(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: x(3), base
    integer :: i, state

    state = 77
    do i = 1, 200
      x = [noise(state), noise(state), noise(state)]*3.4_wp
      base = covered_fraction(x(:2), 1.0_wp, 3.0_wp)
      call expect_true(error, base >= -1.0e-14_wp .and. base <= 1 + 1.0e-14_wp, &
        & 'a fraction is between 0 and 1')
      call expect(error, covered_fraction(-x(:2), 1.0_wp, 3.0_wp), base, 0.0_wp, 'opposite, 2D')
      call expect(error, covered_fraction([x(2), -x(1)], 1.0_wp, 3.0_wp), base, 1.0e-13_wp, &
        & 'turned, 2D')
      base = covered_fraction(x, 1.0_wp, 3.0_wp)
      call expect(error, covered_fraction(-x, 1.0_wp, 3.0_wp), base, 0.0_wp, 'opposite, 3D')
      call expect(error, covered_fraction([x(2), x(1), -x(3)], 1.0_wp, 3.0_wp), base, &
        & 1.0e-11_wp, 'turned, 3D')
      call expect(error, covered_fraction(cshift(x, 1), 1.0_wp, 3.0_wp), base, 1.0e-4_wp, &
        & 'axes changed, 3D')
    end do
  end subroutine test_symmetry

  !> The parts of a cell cover together what the whole covers.
  subroutine test_halves(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: x(3), parts
    integer :: n, i, j, k, state

    state = 78
    do n = 1, 100
      x = 3.0_wp*[0.6_wp, 0.5_wp, 0.62_wp] + 0.5_wp*[noise(state), noise(state), noise(state)]
      parts = 0.0_wp
      do j = -1, 1, 2
        do i = -1, 1, 2
          parts = parts + covered_fraction(x(:2) + 0.25_wp*[i, j], 0.5_wp, 2.5_wp)/4
        end do
      end do
      call expect(error, covered_fraction(x(:2), 1.0_wp, 2.5_wp), parts, 1.0e-13_wp, &
        & 'four quarters')
      parts = 0.0_wp
      do k = -1, 1, 2
        do j = -1, 1, 2
          do i = -1, 1, 2
            parts = parts + covered_fraction(x + 0.25_wp*[i, j, k], 0.5_wp, 3.0_wp)/8
          end do
        end do
      end do
      call expect(error, covered_fraction(x, 1.0_wp, 3.0_wp), parts, 1.0e-4_wp, 'eight eighths')
    end do
  end subroutine test_halves

  subroutine test_names(error)
    type(error_type), allocatable, intent(out) :: error
    call expect_true(error, volume_rule_number('none') == volume_none .and. &
      & volume_rule_number('linear') == volume_linear .and. &
      & volume_rule_number('linear_extended') == volume_linear_extended .and. &
      & volume_rule_number('exact') == volume_exact, 'a rule has another name')
  end subroutine test_names

end module test_family_volume
