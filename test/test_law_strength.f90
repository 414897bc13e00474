!> Scatter of strength: the distribution of single factors, and bonds that break by it.
module test_law_strength
  use comparisons, only: expect_close
  use pd_base_kinds, only: wp, i8
  use pd_law_strength, only: strength_factor
  use perifort, only: answer_type, fault_type => error_type, read_scene_text, run_options_type, &
    & run_scene, scene_type
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_law_strength

  character(*), parameter :: nl = new_line('a')

contains

  subroutine collect_law_strength(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('factors have the distribution of Weibull', test_distribution), &
      & new_unittest('both ends, and no other bond or seed, have one factor', test_ends), &
      & new_unittest('the same bonds break in lattices and lists, on any threads', test_order), &
      & new_unittest('a strip breaks as its weakest bonds say', test_weakest)]
  end subroutine collect_law_strength

  !> Kolmogorov and Smirnov: of n independent numbers, the distribution function differs from the
  !> exact one by more than 2.0/sqrt(n) with a probability of 2 exp(-8), 7e-4. The numbers are of
  !> bonds between neighbouring points, which must be independent, too: the correlation of factors
  !> of bonds that share an end is at most 4/sqrt(n).
  subroutine test_distribution(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 20000
    real(wp), parameter :: moduli(3) = [1.0_wp, 5.0_wp, 40.0_wp]
    real(wp) :: factor(n), uniform(n), off, correlation
    integer :: m, i, bin, counts(0:1000)

    do m = 1, size(moduli)
      do i = 1, n
        factor(i) = strength_factor(moduli(m), 7, int(i, i8), int(i + 1, i8))
      end do
      uniform = 1 - exp(-(factor*gamma(1 + 1/moduli(m)))**moduli(m))
      counts = 0
      do i = 1, n
        bin = int(1000*uniform(i))
        counts(bin) = counts(bin) + 1
      end do
      off = 0.0_wp
      do bin = 0, 999
        off = max(off, abs(sum(counts(:bin))/real(n, wp) - (bin + 1)/1000.0_wp))
      end do
      call check(error, off <= 2/sqrt(real(n, wp)), 'distribution')
      if (allocated(error)) return
      correlation = sum((uniform(2:) - 0.5_wp)*(uniform(:n - 1) - 0.5_wp))/n*12
      call check(error, abs(correlation) <= 4/sqrt(real(n, wp)), 'neighbouring bonds correlate')
      if (allocated(error)) return
    end do
  end subroutine test_distribution

  subroutine test_ends(error)
    type(error_type), allocatable, intent(out) :: error

    associate (one => strength_factor(8.0_wp, 3, 17_i8, 123456789_i8))
      call expect_close(error, strength_factor(8.0_wp, 3, 123456789_i8, 17_i8), one, 0.0_wp, &
        & 'the other end')
      if (allocated(error)) return
      call check(error, abs(strength_factor(8.0_wp, 4, 17_i8, 123456789_i8) - one) > 0.0_wp, &
        & 'another seed')
      if (allocated(error)) return
      call check(error, abs(strength_factor(8.0_wp, 3, 17_i8, 123456790_i8) - one) > 0.0_wp, &
        & 'another bond')
    end associate
  end subroutine test_ends

  !> Numbers of broken bonds of a plate that tears, row by row.
  subroutine test_order(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: one(:), other(:)

    call run_it(plate('lattice', 'scatter = 6', '12'), 1, one, error)
    if (.not. allocated(error)) call run_it(plate('list', 'scatter = 6', '12'), 2, other, error)
    if (allocated(error)) return
    call expect_close(error, other, one, 0.0_wp, 'broken bonds')
    if (allocated(error)) return
    call check(error, one(size(one)) > 50.0_wp, 'bonds break')
    if (allocated(error)) return
    call run_it(plate('lattice', 'scatter = 6, seed = 2', '12'), 1, other, error)
    if (allocated(error)) return
    call check(error, any(abs(one - other) > 0.0_wp), 'another seed breaks other bonds')
  end subroutine test_order

  !> With a large modulus the strength is that without scatter; with a small one bonds break at
  !> strains at which none would otherwise.
  subroutine test_weakest(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: equal(:), nearly(:), scattered(:)

    call run_it(plate('lattice', '', '12'), 1, equal, error)
    if (.not. allocated(error)) call run_it(plate('lattice', 'scatter = 1e9', '12'), 1, nearly, &
      & error)
    if (allocated(error)) return
    call expect_close(error, nearly, equal, 0.02_wp*maxval(equal), 'a modulus of 1e9')
    if (allocated(error)) return
    ! strains of v/c = 0.8e-3, with overshoot, below a critical stretch of 2e-3
    call run_it(plate('lattice', '', '4'), 1, equal, error)
    if (.not. allocated(error)) call run_it(plate('lattice', 'scatter = 3', '4'), 1, scattered, &
      & error)
    if (allocated(error)) return
    call expect_close(error, equal, 0.0_wp, 0.0_wp, 'no bond breaks without scatter')
    if (allocated(error)) return
    call check(error, scattered(size(scattered)) > 0.0_wp, 'the weakest bonds break')
  end subroutine test_weakest

  !> A plate whose halves fly apart.
  function plate(family, more, velocity) result(text)
    character(*), intent(in) :: family, more
    character(*), intent(in) :: velocity  !! of each half [m/s]
    character(:), allocatable :: text
    text = '&scene dimension = 2, thickness = 1e-3 /'//nl// &
      & '&body lower = 0, 0, upper = 0.02, 0.012, points = 20, 12 /'//nl// &
      & "&material model = 'bond_based', youngs_modulus = 70e9, density = 2700, "// &
      & 'critical_stretch = 2e-3, '//more//' /'//nl// &
      & "&horizon family = '"//family//"' /"//nl// &
      & "&region name = 'right', shape = 'box', lower = 0.01 /"//nl// &
      & '&initial velocity_x = -'//velocity//' /'//nl// &
      & "&initial region = 'right', velocity_x = "//velocity//' /'//nl// &
      & '&time steps = 60 /'//nl//'&output history_every = 1 /'//nl
  end function plate

  subroutine run_it(text, threads, broken, error)
    character(*), intent(in) :: text
    integer, intent(in) :: threads
    real(wp), allocatable, intent(out) :: broken(:)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(answer_type) :: answer
    type(fault_type), allocatable :: fault

    options%files = .false.
    options%quiet = .true.
    options%threads = threads
    call read_scene_text(text, '', scene, fault)
    if (.not. allocated(fault)) call run_scene(scene, options, fault, answer=answer)
    if (.not. allocated(fault)) call answer%get_column('broken_bonds', broken, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine run_it

end module test_law_strength
