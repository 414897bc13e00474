!> Laws of error and time: exact where the numbers follow a law, careful where they do not.
module test_study_trade_predict
  use pd_base_kinds, only: wp
  use pd_study_trade_predict, only: error_at, fit_law, law_type, seconds_at, true_error_at
  use bodies, only: expect, expect_true
  use testdrive, only: error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_study_trade_predict

  real(wp), parameter :: h(4) = [0.1_wp, 0.05_wp, 0.025_wp, 0.0125_wp]

contains

  subroutine collect_study_trade_predict(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a power law is extrapolated', test_power), &
      & new_unittest('against the finest run', test_reference), &
      & new_unittest('the true error behind errors against a finest run', test_true), &
      & new_unittest('the prediction is not optimistic for an error that levels off', test_level), &
      & new_unittest('an accidentally small error of a coarse run is not used', test_luck), &
      & new_unittest('scatter requires a margin', test_margin), &
      & new_unittest('a single run predicts nothing', test_single)]
  end subroutine collect_study_trade_predict

  !> Orders are searched in steps of 0.02, which at 8 times finer is 4 % at most.
  subroutine test_power(error)
    type(error_type), allocatable, intent(out) :: error
    type(law_type) :: law
    integer :: p

    do p = 1, 3
      ! the order of the runs does not matter
      call fit_law(h([3, 1, 4, 2]), 5*h([3, 1, 4, 2])**p, 2*h([3, 1, 4, 2])**(-2.5_wp), 0.0_wp, &
        & law)
      call expect(error, law%order, real(p, wp), 0.02_wp, 'order')
      call expect(error, error_at(law, 0.03_wp)/(5*0.03_wp**p), 1.0_wp, 1.0e-10_wp, 'between')
      call expect(error, error_at(law, h(4)/8)/(5*(h(4)/8)**p), 1.0_wp, 0.05_wp, 'beyond')
      call expect(error, seconds_at(law, 0.03_wp)/(2*0.03_wp**(-2.5_wp)), 1.0_wp, 1.0e-10_wp, &
        & 'time between')
      call expect(error, seconds_at(law, h(4)/8)/(2*(h(4)/8)**(-2.5_wp)), 1.0_wp, 1.0e-10_wp, &
        & 'time beyond')
      call expect(error, law%margin, 1.1_wp, 1.0e-12_wp, 'margin')
      call expect_true(error, error_at(law, 0.11_wp) > 1.0e300_wp, 'nothing coarser')
    end do
  end subroutine test_power

  !> Errors C (h^p - r^p); nothing is said nearer to r than 2 r.
  subroutine test_reference(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: r = 0.003_wp
    type(law_type) :: law

    call fit_law(h, 5*(h - r), 1/h, r, law)
    call expect(error, law%order, 1.0_wp, 0.03_wp, 'order')
    call expect(error, error_at(law, 0.008_wp)/(5*(0.008_wp - r)), 1.0_wp, 0.03_wp, 'beyond')
    call expect_true(error, error_at(law, 1.9_wp*r) > 1.0e300_wp, 'too near')
  end subroutine test_reference

  !> Errors C (h^p - r^p) of order 2 stand for true errors C h^2, that of the reference included;
  !> orders are searched in steps of 0.02, which changes C h^p by 0.5 ln(2) 0.02 about the runs and
  !> by a few per cent at r. Without a reference, or from one run, nothing is known.
  subroutine test_true(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: r = 0.005_wp
    type(law_type) :: law
    real(wp) :: found
    logical :: known
    integer :: i

    call fit_law(h, 5*(h**2 - r**2), 1/h, r, law)
    do i = 1, size(h)
      call true_error_at(law, h(i), found, known)
      call expect_true(error, known, 'known')
      call expect(error, found/(5*h(i)**2), 1.0_wp, 0.02_wp, 'of a run')
    end do
    call true_error_at(law, r, found, known)
    call expect(error, found/(5*r**2), 1.0_wp, 0.03_wp, 'of the finest run')
    call fit_law(h, 5*h**2, 1/h, 0.0_wp, law)
    call true_error_at(law, h(1), found, known)
    call expect_true(error, .not. known, 'against an exact answer')
    call fit_law(h(:1), h(:1), 1/h(:1), r, law)
    call true_error_at(law, h(1), found, known)
    call expect_true(error, .not. known, 'one run')
    call fit_law(h, 1 + 0*h, 1/h, r, law)
    call true_error_at(law, h(1), found, known)
    call expect_true(error, law%order >= 0.5_wp .and. known, 'the least order with a reference')
  end subroutine test_true

  !> 1e-3 + h^2: the last runs hardly improve, so that a tenth of them is not expected.
  subroutine test_level(error)
    type(error_type), allocatable, intent(out) :: error
    type(law_type) :: law

    call fit_law(h, 1.0e-3_wp + h**2, 1/h, 0.0_wp, law)
    call expect_true(error, error_at(law, h(4)/4) > 0.3_wp*1.0e-3_wp, 'levels off')
    call fit_law(h, 1.0e-3_wp + h**4, 1/h, 0.0_wp, law)
    call expect_true(error,.not. law%extrapolates, 'flat: nothing beyond')
    call expect_true(error, error_at(law, h(4)/2) > 1.0e300_wp, 'huge beyond')
  end subroutine test_level

  !> The second run is better than the third: it counts as the third, or as the fit says.
  subroutine test_luck(error)
    type(error_type), allocatable, intent(out) :: error
    type(law_type) :: law

    call fit_law(h, [8.0_wp, 1.0_wp, 2.0_wp, 0.5_wp], 1/h, 0.0_wp, law)
    call expect(error, error_at(law, h(2)), 2.0_wp, 1.0e-12_wp, 'at the lucky run')
    call expect_true(error, error_at(law, sqrt(h(2)*h(3))) >= 2.0_wp*(1 - 1.0e-12_wp), 'behind it')
    call expect_true(error, error_at(law, sqrt(h(1)*h(2))) >= 4.0_wp*(1 - 1.0e-12_wp), 'before it')
    call expect_true(error, error_at(law, sqrt(h(3)*h(4))) >= 1.0_wp, 'before the finest')
    call expect_true(error, error_at(law, 0.9_wp*h(4)) > 0.2_wp, 'beyond')
    call expect(error, error_at(law, h(4)), 0.5_wp, 1.0e-12_wp, 'at the finest')
  end subroutine test_luck

  subroutine test_margin(error)
    type(error_type), allocatable, intent(out) :: error
    type(law_type) :: law

    call fit_law(h, h*[1.0_wp, 1.3_wp, 0.8_wp, 1.2_wp], 1/h, 0.0_wp, law)
    call expect_true(error, law%margin > 1.2_wp .and. law%margin < 1.7_wp, 'margin')
  end subroutine test_margin

  subroutine test_single(error)
    type(error_type), allocatable, intent(out) :: error
    type(law_type) :: law

    call fit_law([0.1_wp], [2.0_wp], [3.0_wp], 0.0_wp, law)
    call expect(error, error_at(law, 0.1_wp), 2.0_wp, 0.0_wp, 'the run itself')
    call expect(error, seconds_at(law, 0.1_wp), 3.0_wp, 0.0_wp, 'its time')
    call expect_true(error, error_at(law, 0.05_wp) > 1.0e300_wp, 'and nothing else')
  end subroutine test_single

end module test_study_trade_predict
