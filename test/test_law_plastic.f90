!> The elastic-plastic linear peridynamic solid at single points whose stretches are prescribed,
!> against the elastic law and the classical theory of plasticity.
module test_law_plastic
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: pi
  use pd_base_reduce, only: noise
  use pd_law_law, only: allocate_law_bonds, bond_law_type, law_bonds_type
  use pd_law_lps, only: lps_law, lps_law_type
  use pd_law_lps_plastic, only: lps_plastic_law, lps_plastic_law_type
  use pd_law_material, only: new_material
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, unittest_type
  use bodies, only: expect, expect_true, youngs_modulus
  implicit none (type, external)
  private
  public :: collect_law_plastic

  real(wp), parameter :: delta = 2.7e-3_wp, nu = 0.3_wp
  real(wp), parameter :: mu = youngs_modulus/(2*(1 + nu)), kappa = youngs_modulus/(3*(1 - 2*nu))
  real(wp), parameter :: yield_stress = 250.0e6_wp
  real(wp), parameter :: slope = youngs_modulus/50  !! of hardening [Pa]
  real(wp), parameter :: unit(3, 3) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, &
    & 0.0_wp, 0.0_wp, 1.0_wp], [3, 3])
  real(wp), parameter :: shear(3, 3) = reshape([0.0_wp, 0.5_wp, 0.0_wp, 0.5_wp, 0.0_wp, 0.0_wp, &
    & 0.0_wp, 0.0_wp, 0.0_wp], [3, 3])
  real(wp), parameter :: uniaxial(3, 3) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
    & 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [3, 3])

  !> A point with its law.
  type :: subject_type
    type(lps_plastic_law_type) :: law
    type(law_bonds_type) :: bonds
    real(wp), allocatable :: n(:, :)   !! (3, bonds) directions
  end type subject_type

contains

  subroutine collect_law_plastic(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('before it yields it is the elastic law', test_elastic), &
      & new_unittest('it yields where the equivalent stress is the yield stress', test_yield), &
      & new_unittest('stress returns to the yield surface, and unloads elastically', test_return), &
      & new_unittest('a continuum has the classical stresses', test_classical), &
      & new_unittest('a lattice has them but for its own error', test_lattice), &
      & new_unittest('work is stored or dissipated', test_closure), &
      & new_unittest('the forces are the slope of the energy', test_slope), &
      & new_unittest('expansion does not yield, whatever is broken', test_expansion), &
      & new_unittest('it is refused in planes and bars', test_refused)]
  end subroutine collect_law_plastic

  ! ---------------------------------------------------------------- points

  !> A point of a lattice of `m` spacings to the horizon.
  subroutine lattice_point(m, influence, hardening, subject)
    integer, intent(in) :: m
    character(*), intent(in) :: influence
    real(wp), intent(in) :: hardening
    type(subject_type), intent(out) :: subject
    real(wp) :: x(3), dx
    integer :: i, j, k, n

    dx = delta/m
    call allocate_law_bonds((2*m + 1)**3, 2, 1, 2, subject%bonds)
    allocate (subject%n(3, (2*m + 1)**3))
    n = 0
    do i = -m, m
      do j = -m, m
        do k = -m, m
          x = dx*[i, j, k]
          if (norm2(x) > delta*(1 + 1.0e-12_wp) .or. all([i, j, k] == 0)) cycle
          n = n + 1
          subject%bonds%length(n) = norm2(x)
          subject%bonds%volume(n) = dx**3
          subject%n(:, n) = x/norm2(x)
        end do
      end do
    end do
    subject%bonds%n = n
    call start_law(influence, hardening, subject)
  end subroutine lattice_point

  !> A point of a continuum: its bonds are the places of a rule that integrates the fourth moments
  !> of all directions exactly.
  subroutine continuum_point(influence, hardening, subject)
    character(*), intent(in) :: influence
    real(wp), intent(in) :: hardening
    type(subject_type), intent(out) :: subject
    real(wp), parameter :: node(3) = [-sqrt(0.6_wp), 0.0_wp, sqrt(0.6_wp)]
    real(wp), parameter :: share(3) = [5.0_wp, 8.0_wp, 5.0_wp]/9
    integer, parameter :: angles = 6, layers = 4
    integer :: i, j, l, n
    real(wp) :: phi

    call allocate_law_bonds(angles*3*layers, 2, 1, 2, subject%bonds)
    allocate (subject%n(3, angles*3*layers))
    n = 0
    do l = 1, layers
      do j = 1, 3
        do i = 1, angles
          n = n + 1
          phi = 2*pi*(i + 0.3_wp*l)/angles
          subject%bonds%length(n) = delta*(l - 0.5_wp)/layers
          subject%bonds%volume(n) = 2*pi/angles*share(j)*subject%bonds%length(n)**2*delta/layers
          subject%n(:, n) = [sqrt(1 - node(j)**2)*cos(phi), sqrt(1 - node(j)**2)*sin(phi), node(j)]
        end do
      end do
    end do
    subject%bonds%n = n
    call start_law(influence, hardening, subject)
  end subroutine continuum_point

  subroutine start_law(influence, hardening, subject)
    character(*), intent(in) :: influence
    real(wp), intent(in) :: hardening
    type(subject_type), intent(inout) :: subject
    integer :: i

    subject%law = lps_plastic_law()
    do i = 1, size(subject%law%parameters)
      associate (parameter => subject%law%parameters(i))
        parameter%value = merge(hardening, yield_stress, parameter%name == 'hardening')
      end associate
    end do
    call set_up(subject%law, influence)
    call subject%law%begin(subject%bonds)
  end subroutine start_law

  subroutine set_up(law, influence)
    class(bond_law_type), intent(inout) :: law
    character(*), intent(in) :: influence

    law%influence = influence
    call law%set_up(new_material(youngs_modulus, nu, 1.0_wp, 3, .false., 1.0_wp, 1.0_wp, delta, &
      & .false.), 3, .false., delta, 1.0_wp)
  end subroutine set_up

  !> Stretches of a strain, in the linear theory.
  pure subroutine strain_to(subject, strain)
    type(subject_type), intent(inout) :: subject
    real(wp), intent(in) :: strain(3, 3)
    integer :: i

    do i = 1, subject%bonds%n
      subject%bonds%stretch(i) = dot_product(subject%n(:, i), matmul(strain, subject%n(:, i)))
    end do
  end subroutine strain_to

  !> Break about one in four bonds.
  subroutine break_some(state, bonds)
    integer, intent(inout) :: state
    type(law_bonds_type), intent(inout) :: bonds
    integer :: i

    do i = 1, bonds%n
      if (noise(state) > 0.5_wp) bonds%volume(i) = 0.0_wp
    end do
  end subroutine break_some

  !> Add a random part to every stretch.
  subroutine disturb(state, by, bonds)
    integer, intent(inout) :: state
    real(wp), intent(in) :: by
    type(law_bonds_type), intent(inout) :: bonds
    integer :: i

    do i = 1, bonds%n
      bonds%stretch(i) = bonds%stretch(i) + by*noise(state)
    end do
  end subroutine disturb

  function pull_of(subject) result(pull)
    type(subject_type), intent(in) :: subject
    real(wp), allocatable :: pull(:)

    allocate (pull(subject%bonds%n))
    call subject%law%forces(subject%bonds, pull)
  end function pull_of

  !> The stress of the bonds of a point in a homogeneous state, where both ends give the same.
  function stress_of(subject, pull) result(stress)
    type(subject_type), intent(in) :: subject
    real(wp), intent(in) :: pull(:)
    real(wp) :: stress(3, 3)
    integer :: i, c

    stress = 0.0_wp
    do i = 1, subject%bonds%n
      do c = 1, 3
        stress(:, c) = stress(:, c) + pull(i)*subject%bonds%length(i)*subject%bonds%volume(i) &
          & *subject%n(:, i)*subject%n(c, i)
      end do
    end do
  end function stress_of

  !> sqrt(2 m psi/5) with psi = (1/2) sum t^2/omega V, from the forces of a whole family.
  real(wp) function equivalent_stress(subject, pull) result(equivalent)
    type(subject_type), intent(in) :: subject
    real(wp), intent(in) :: pull(:)
    real(wp) :: omega(subject%bonds%n), t(subject%bonds%n), m, theta
    integer :: i

    associate (b => subject%bonds)
      do i = 1, b%n
        omega(i) = subject%law%omega(b%length(i)/delta)
      end do
      m = sum(omega*b%length(:b%n)**2*b%volume(:b%n))
      theta = 3/m*sum(omega*b%length(:b%n)**2*b%stretch(:b%n)*b%volume(:b%n))
      t = pull - 3*kappa*theta*omega*b%length(:b%n)/m
      equivalent = sqrt(2*m/5*sum(t**2/omega*b%volume(:b%n))/2)
    end associate
  end function equivalent_stress

  pure real(wp) function mises(stress)
    real(wp), intent(in) :: stress(3, 3)
    real(wp) :: s(3, 3)

    s = stress - unit*(stress(1, 1) + stress(2, 2) + stress(3, 3))/3
    mises = sqrt(1.5_wp*sum(s**2))
  end function mises

  !> Fraction of the strain at which the elastic stress of a continuum would yield.
  pure real(wp) function to_yield(strain) result(factor)
    real(wp), intent(in) :: strain(3, 3)
    factor = yield_stress/mises(2*mu*strain)
  end function to_yield

  ! ---------------------------------------------------------------- tests

  !> The same bonds under both laws: any stretches that do not reach yield, any projections, with
  !> and without broken bonds, with every influence function. `linear` has none at the horizon.
  subroutine test_elastic(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: influences(4) = [character(8) :: 'inverse', 'constant', 'linear', &
      & 'gaussian']
    type(subject_type) :: subject
    type(lps_law_type) :: elastic
    type(law_bonds_type) :: before
    real(wp), allocatable :: pull(:), expected(:)
    real(wp) :: dissipated, energy
    integer :: f, broken, state, i

    state = 5
    do f = 1, size(influences)
      call lattice_point(3, influences(f), slope, subject)
      elastic = lps_law()
      call set_up(elastic, influences(f))
      expect_same: associate (b => subject%bonds)
        allocate (pull(b%n), expected(b%n))
        call elastic%stiffness(b, expected)
        call subject%law%stiffness(b, pull)
        call expect_close(error, pull, expected, 1.0e-14_wp*max_abs(expected), 'stiffness')
        do broken = 0, 1
          if (broken == 1) call break_some(state, b)
          call strain_to(subject, 0.1_wp*to_yield(shear)*(shear + unit))
          call disturb(state, 0.1_wp*to_yield(shear), b)
          do i = 1, b%n
            b%projection(i) = 1 - broken*0.1_wp*abs(noise(state))
          end do
          call elastic%forces(b, expected)
          call subject%law%forces(b, pull)
          call expect_close(error, pull, expected, 1.0e-13_wp*max_abs(expected), 'forces')
          energy = elastic%energy(b)
          call expect(error, subject%law%energy(b), energy, 1.0e-13_wp*energy, 'energy')
          call expect(error, subject%law%dilatation(b), elastic%dilatation(b), 0.0_wp, &
            & 'dilatation')
          before = b
          call subject%law%commit(b, dissipated)
          call expect(error, dissipated, 0.0_wp, 0.0_wp, 'dissipation')
          call expect_close(error, b%history(1, :), before%history(1, :), 0.0_wp, 'flow')
          call expect(error, b%of_point(1), 0.0_wp, 0.0_wp, 'plastic strain')
        end do
        deallocate (pull, expected)
      end associate expect_same
      call expect(error, subject%law%critical_stretch(1.0_wp), elastic%critical_stretch(1.0_wp), &
        & 0.0_wp, 'critical stretch')
    end do
  end subroutine test_elastic

  !> Strains that make the equivalent stress, from sums over the elastic forces here, the yield
  !> stress: just below nothing flows, just above something does.
  subroutine test_yield(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp) :: strain(3, 3), dissipated
    integer :: way, side

    do way = 1, 2
      strain = merge(shear, uniaxial, way == 1)
      call lattice_point(3, 'constant', slope, subject)
      call strain_to(subject, 1.0e-6_wp*strain)
      strain = strain*1.0e-6_wp*yield_stress/equivalent_stress(subject, pull_of(subject))
      ! the lattice of a few spacings is a few per cent away from the continuum
      call expect(error, mises(2*mu*strain), yield_stress, 0.1_wp*yield_stress, 'yield')
      do side = -1, 1, 2
        call lattice_point(3, 'constant', slope, subject)
        call strain_to(subject, strain*(1 + side*1.0e-9_wp))
        call subject%law%commit(subject%bonds, dissipated)
        call expect_true(error, (subject%bonds%of_point(1) > 0.0_wp) .eqv. side > 0, &
          & 'it yields elsewhere')
        call expect_true(error, (dissipated > 0.0_wp) .eqv. side > 0, 'dissipation')
      end do
    end do
  end subroutine test_yield

  !> A random path with and without hardening. After every step the equivalent stress, from the
  !> forces, is at most yield stress + slope times the plastic strain: exactly that where the
  !> plastic strain has grown; where it hasn't, the forces have changed by those of the elastic law.
  subroutine test_return(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    type(lps_law_type) :: elastic
    type(law_bonds_type) :: change
    real(wp), allocatable :: pull(:), before(:), expected(:)
    real(wp) :: dissipated, strength, plastic
    integer :: state, i, way, flowed, unloaded

    state = 7
    elastic = lps_law()
    call set_up(elastic, 'gaussian')
    do way = 0, 1
      call lattice_point(3, 'gaussian', way*slope, subject)
      flowed = 0
      unloaded = 0
      associate (b => subject%bonds)
        b%stretch = 0.0_wp
        pull = pull_of(subject)
        allocate (expected(b%n))
        do i = 1, 60
          before = pull
          change = b
          plastic = b%of_point(1)
          call disturb(state, 0.5_wp*to_yield(shear), b)
          if (mod(i, 3) == 0) b%stretch = 0.6_wp*b%stretch
          pull = pull_of(subject)
          call subject%law%commit(b, dissipated)
          call expect_close(error, pull_of(subject), pull, 1.0e-12_wp*max_abs(pull), &
            & 'forces after the commit')
          strength = yield_stress + way*slope*b%of_point(1)
          if (b%of_point(1) > plastic) then
            flowed = flowed + 1
            call expect(error, equivalent_stress(subject, pull), strength, 1.0e-12_wp*strength, &
              & 'stress after the return')
            call expect_true(error, dissipated > 0.0_wp, 'flow does not dissipate')
          else
            unloaded = unloaded + 1
            call expect(error, b%of_point(1), plastic, 0.0_wp, 'plastic strain')
            call expect_true(error, equivalent_stress(subject, pull) <= strength*(1 + 1.0e-12_wp), &
              & 'stress above yield')
            change%stretch(:b%n) = b%stretch(:b%n) - change%stretch(:b%n)
            call elastic%forces(change, expected)
            call expect_close(error, pull - before, expected, 1.0e-11_wp*max_abs(pull), &
              & 'forces of unloading')
            call expect(error, dissipated, 0.0_wp, 0.0_wp, 'dissipation of unloading')
          end if
        end do
        deallocate (expected)
      end associate
      call expect_true(error, flowed > 5 .and. unloaded > 5, 'the path does not do both')
    end do
  end subroutine test_return

  !> Stresses of J2 plasticity with linear isotropic hardening by radial return (Simo and Hughes,
  !> Computational Inelasticity, chapter 3), brought to a strain.
  subroutine classical(strain, hardening, plastic, equivalent, stress)
    real(wp), intent(in) :: strain(3, 3), hardening
    real(wp), intent(inout) :: plastic(3, 3), equivalent
    real(wp), intent(out) :: stress(3, 3)
    real(wp) :: s(3, 3), direction(3, 3), theta, over, gamma

    theta = strain(1, 1) + strain(2, 2) + strain(3, 3)
    s = 2*mu*(strain - unit*theta/3 - plastic)
    over = norm2(s) - sqrt(2.0_wp/3)*(yield_stress + hardening*equivalent)
    if (over > 0.0_wp) then
      gamma = over/(2*mu*(1 + hardening/(3*mu)))
      direction = s/norm2(s)
      s = s - 2*mu*gamma*direction
      plastic = plastic + gamma*direction
      equivalent = equivalent + sqrt(2.0_wp/3)*gamma
    end if
    stress = s + kappa*theta*unit
  end subroutine classical

  !> Loading, unloading, reversal and turns of a path of strain: stress, plastic strain and the
  !> dissipated work sum of (sigma_old + sigma_new)/2 : d strain_p are classical.
  subroutine follow(subject, hardening, tolerance, error)
    type(subject_type), intent(inout) :: subject
    real(wp), intent(in) :: hardening, tolerance
    type(error_type), allocatable, intent(inout) :: error
    real(wp) :: strain(3, 3), plastic(3, 3), before(3, 3), equivalent, stress(3, 3), last(3, 3)
    real(wp) :: dissipated, total, expected
    integer :: i

    plastic = 0.0_wp
    equivalent = 0.0_wp
    last = 0.0_wp
    total = 0.0_wp
    expected = 0.0_wp
    do i = 1, 200
      ! two cycles of shear, with tension that sets in later and some compression
      strain = to_yield(shear)*(4*sin(4*pi*i/200.0_wp)*shear + max(0, i - 80)/40.0_wp*uniaxial &
        & - i/100.0_wp*unit)
      before = plastic
      call classical(strain, hardening, plastic, equivalent, stress)
      call strain_to(subject, strain)
      call expect_close(error, stress_of(subject, pull_of(subject)), stress, &
        & tolerance*yield_stress, 'stress')
      call subject%law%commit(subject%bonds, dissipated)
      call expect(error, subject%bonds%of_point(1), equivalent, tolerance*to_yield(shear)*5, &
        & 'plastic strain')
      total = total + dissipated
      expected = expected + sum((stress + last)/2*(plastic - before))
      call expect(error, total, expected, tolerance*5*yield_stress*to_yield(shear), 'dissipation')
      last = stress
    end do
    call expect_true(error, equivalent > 5*to_yield(shear), 'the path hardly flows')
  end subroutine follow

  subroutine test_classical(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    character(*), parameter :: influences(2) = [character(8) :: 'constant', 'inverse']
    integer :: way

    do way = 0, 1
      call continuum_point(influences(way + 1), way*slope, subject)
      call follow(subject, way*slope, 1.0e-11_wp, error)
    end do
  end subroutine test_classical

  !> At 9 spacings to the horizon yield is met to 2 % and hardening to 5 %, in shear and in uniaxial
  !> strain.
  subroutine test_lattice(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp) :: strain(3, 3), plastic(3, 3), equivalent, stress(3, 3), found(3, 3), dissipated
    real(wp) :: rise, expected
    integer :: way, i

    do way = 1, 2
      strain = merge(shear, uniaxial, way == 1)
      strain = to_yield(strain)*strain
      call lattice_point(9, 'constant', slope, subject)
      plastic = 0.0_wp
      equivalent = 0.0_wp
      rise = 0.0_wp
      expected = 0.0_wp
      do i = 1, 4
        call classical(1.5_wp*i*strain, slope, plastic, equivalent, stress)
        call strain_to(subject, 1.5_wp*i*strain)
        found = stress_of(subject, pull_of(subject))
        call subject%law%commit(subject%bonds, dissipated)
        if (i == 1) then
          call expect(error, mises(found), mises(stress), 0.02_wp*mises(stress), 'yield')
          rise = mises(found)
          expected = mises(stress)
        end if
      end do
      expected = mises(stress) - expected
      call expect(error, mises(found) - rise, expected, 0.05_wp*expected, 'hardening')
      call expect_true(error, expected > 0.05_wp*yield_stress, 'it hardly hardens')
    end do
  end subroutine test_lattice

  !> Random paths on which bonds break at times: the work of the pulls, by the trapezoidal rule, is
  !> what the energy grows by, what broken bonds take with them and what is dissipated.
  subroutine test_closure(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: pull(:), before(:), stretch(:)
    real(wp) :: work, dissipated, total, energy, lost, largest
    integer :: state, i, way

    state = 11
    do way = 0, 1
      call lattice_point(3, 'linear', way*slope, subject)
      associate (b => subject%bonds)
        b%stretch = 0.0_wp
        pull = pull_of(subject)
        work = 0.0_wp
        total = 0.0_wp
        lost = 0.0_wp
        largest = 0.0_wp
        do i = 1, 60
          before = pull
          stretch = b%stretch(:b%n)
          call disturb(state, to_yield(shear), b)
          pull = pull_of(subject)
          work = work + sum((before + pull)/2*(b%stretch(:b%n) - stretch)*b%length(:b%n) &
            & *b%volume(:b%n))
          energy = subject%law%energy(b)
          call subject%law%commit(b, dissipated)
          call expect_true(error, dissipated >= 0.0_wp, 'energy comes from flow')
          total = total + dissipated
          largest = max(largest, energy)
          call expect(error, subject%law%energy(b), energy, 1.0e-13_wp*energy, &
            & 'energy after the commit')
          if (i == 20 .or. i == 40) then
            call break_some(state, b)
            pull = pull_of(subject)
            call expect_true(error, all(abs(pull) <= 0.0_wp .or. b%volume(:b%n) > 0.0_wp), &
              & 'a broken bond pulls')
            lost = lost + energy - subject%law%energy(b)
          end if
          call expect(error, subject%law%energy(b) + lost + total, work, &
            & 1.0e-12_wp*(largest + total + lost), 'balance')
        end do
        call expect_true(error, total > largest .and. lost > 0.1_wp*largest, &
          & 'little is dissipated or lost')
      end associate
    end do
  end subroutine test_closure

  !> dW/de = pull V with the history held: elastic states of a point that has flowed and has lost
  !> bonds, by central differences, which are exact for a quadratic energy.
  subroutine test_slope(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: pull(:), slope_of(:)
    real(wp) :: dissipated, stretch
    real(wp), parameter :: h = 1.0e-5_wp
    integer :: state, i

    state = 13
    call lattice_point(2, 'constant', slope, subject)
    associate (b => subject%bonds)
      b%stretch = 0.0_wp
      call disturb(state, 10*to_yield(shear), b)
      call subject%law%commit(b, dissipated)
      call break_some(state, b)
      b%stretch = 0.9_wp*b%stretch
      pull = pull_of(subject)
      allocate (slope_of(b%n), source=0.0_wp)
      do i = 1, b%n
        if (b%volume(i) <= 0.0_wp) cycle
        stretch = b%stretch(i)
        b%stretch(i) = stretch + h
        slope_of(i) = subject%law%energy(b)
        b%stretch(i) = stretch - h
        slope_of(i) = (slope_of(i) - subject%law%energy(b))/(2*h*b%length(i)*b%volume(i))
        b%stretch(i) = stretch
      end do
      call expect_close(error, pull, slope_of, 1.0e-8_wp*max_abs(pull), 'slope of the energy')
      call expect_true(error, b%of_point(1) > 0.0_wp, 'it has not flowed')
    end associate
  end subroutine test_slope

  !> Any isotropic expansion is free of flow.
  subroutine test_expansion(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp) :: dissipated
    integer :: state

    state = 17
    call lattice_point(3, 'gaussian', slope, subject)
    call break_some(state, subject%bonds)
    call strain_to(subject, 0.5_wp*unit)
    call subject%law%commit(subject%bonds, dissipated)
    call expect(error, subject%bonds%of_point(1), 0.0_wp, 0.0_wp, 'plastic strain')
    call expect_true(error, subject%law%energy(subject%bonds) > 0.0_wp, 'energy')
  end subroutine test_expansion

  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    type(lps_plastic_law_type) :: law
    integer :: dim

    do dim = 1, 3
      law = lps_plastic_law()
      call law%set_up(new_material(youngs_modulus, nu, 1.0_wp, dim, .false., 1.0_wp, 1.0_wp, &
        & delta, .false.), dim, .false., delta, 1.0_wp)
      call expect_true(error, (law%refusal() == '') .eqv. dim == 3, 'dimensions')
    end do
  end subroutine test_refused

end module test_law_plastic
