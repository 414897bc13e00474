!> Horizons from one spacing to larger than the body, bodies of one point's thickness, and bodies of
!> one or two points.
module test_extremes_geometry
  use pd_base_kinds, only: wp, i8
  use pd_base_error, only: fault_type => error_type, status_input
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_motion_account, only: energies_of, energies_type
  use pd_motion_system, only: evaluate
  use pd_scene_content_types, only: scene_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: prepare_run, at_point, box_scene, density_of_steel, diary_type, expect, &
    & expect_true, noise, ready_alone, text_of, youngs_modulus
  implicit none (type, external)
  private
  public :: collect_extremes_geometry

  real(wp), parameter :: dx = 1.0e-2_wp     !! spacing of all bodies here [m]
  real(wp), parameter :: area = 3.0e-4_wp   !! cross section of bars [m2]
  character(9), parameter :: families(*) = [character(9) :: 'lattice', 'list']
  real(wp), parameter :: ratios(*) = [1.0_wp, 1.5_wp, 2.999999_wp, 3.0_wp, 3.000001_wp, 3.015_wp, &
    & 10.0_wp, 50.0_wp]

contains

  subroutine collect_extremes_geometry(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('the modulus of a chain at every horizon ratio', test_modulus), &
      & new_unittest('bonds at the horizon: rules with and without a jump', test_edge), &
      & new_unittest('corrected bars have the same strain at every ratio', test_uniform), &
      & new_unittest('horizons from a spacing to beyond the body', test_ratios), &
      & new_unittest('bodies of one point''s thickness', test_thin), &
      & new_unittest('a chain in space is a bar held from contracting', test_chain), &
      & new_unittest('a chain or sheet bends without force', test_membrane), &
      & new_unittest('one point alone is refused, or moves freely', test_one_point), &
      & new_unittest('two points vibrate as their closed form', test_two_points)]
  end subroutine collect_extremes_geometry

  !> A bar without surface correction under the strain e, long enough for full families in its
  !> middle; what its middle stores, over E e^2/2.
  real(wp) function stored(ratio, correction, family, error) result(share)
    real(wp), intent(in) :: ratio
    character(*), intent(in) :: correction, family
    type(error_type), allocatable, intent(inout) :: error
    real(wp), parameter :: strain = 1.0e-6_wp
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(energies_type) :: all_, inner_
    integer :: n, k, trial

    share = 0.0_wp
    ! the energy that two more points bring is that of points in the middle
    n = 2*ceiling(ratio) + 3
    do trial = 1, 2
      call box_scene([n + 2*(trial - 1)], dx, 0.0_wp, scene)
      scene%horizon%ratio = ratio
      scene%horizon%volume_correction = correction
      scene%horizon%family = family
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      associate (system => set_up%system)
        do k = 1, system%body%n_slots
          if (system%body%point(k) > 0) system%state%u(k, 1) = strain*system%body%x(k, 1)
        end do
        inner_ = all_
        call energies_of(system, system%state%v, all_)
      end associate
    end do
    share = (all_%strain - inner_%strain)/(2*dx*area*youngs_modulus*strain**2/2)
  end function stored

  !> Uniform strain: W/(E e^2/2) = (2/m^2) sum v_c j over the neighbours j = 1, 2, .. of one side,
  !> m the ratio. With the book's correction that is exactly 1 at whole ratios.
  subroutine test_modulus(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: expected, m
    integer :: r, f, j

    do r = 1, size(ratios)
      m = ratios(r)
      expected = 0.0_wp
      do j = 1, floor(m)
        expected = expected + 2/m**2*min(1.0_wp, m + 0.5_wp - j)*j
      end do
      if (abs(m - nint(m)) <= 0.0_wp) call expect(error, expected, 1.0_wp, 1.0e-14_wp, 'the sum')
      do f = 1, size(families)
        call expect(error, stored(m, 'linear', trim(families(f)), error), expected, 1.0e-9_wp, &
          & 'modulus at ratio '//text_of(m))
      end do
      if (allocated(error)) return
    end do
  end subroutine test_modulus

  !> A neighbour at exactly three spacings. The book's rule counts half of its cell at ratio 3 and
  !> nothing at 2.999999: 1/3 of the modulus comes and goes. (The sum above: 1.5 of 4.5.) Without
  !> correction 3 of 6 do. The rules that follow the cell through the edge know no jump.
  subroutine test_edge(error)
    type(error_type), allocatable, intent(out) :: error
    character(15), parameter :: rules(*) = [character(15) :: 'linear', 'none', 'linear_extended', &
      & 'exact']
    real(wp), parameter :: jumps(*) = [1.0_wp/3, 2.0_wp/3, 0.0_wp, 0.0_wp]
    real(wp) :: below, at, above
    integer :: r

    do r = 1, size(rules)
      below = stored(2.999999_wp, trim(rules(r)), 'automatic', error)
      at = stored(3.0_wp, trim(rules(r)), 'automatic', error)
      above = stored(3.000001_wp, trim(rules(r)), 'automatic', error)
      ! the ratio itself, 3e-7 of which enter squared
      call expect(error, at - below, jumps(r), 5.0e-6_wp, 'jump below 3, '//trim(rules(r)))
      call expect(error, above - at, 0.0_wp, 5.0e-6_wp, 'jump above 3, '//trim(rules(r)))
    end do
  end subroutine test_edge

  !> The surface factors scale every point of a uniformly strained bar to E e^2/2 where its
  !> neighbours are as it is; a bar shorter than its horizon has none such, but the same law holds
  !> of all its bonds: a short bar's energy is right within the spread of its factors.
  subroutine test_uniform(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: strain = 1.0e-6_wp
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(energies_type) :: energies
    integer :: r, f, k

    do r = 1, size(ratios)
      do f = 1, size(families)
        call box_scene([40], dx, 0.0_wp, scene)
        scene%horizon%ratio = ratios(r)
        scene%horizon%family = families(f)
        scene%horizon%surface_correction = 'energy'
        call ready_alone(scene, set_up, error)
        if (allocated(error)) return
        associate (system => set_up%system)
          do k = 1, system%body%n_slots
            if (system%body%point(k) > 0) system%state%u(k, 1) = strain*system%body%x(k, 1)
          end do
          call energies_of(system, system%state%v, energies)
        end associate
        call expect(error, energies%strain/(40*dx*area*youngs_modulus*strain**2/2), 1.0_wp, &
          & 0.03_wp, 'energy at ratio '//text_of(ratios(r)))
      end do
    end do
  end subroutine test_uniform

  !> A cube of 6 points a side at every ratio: both kinds of families have the same bonds and the
  !> same forces to the rounding of sums, forces add up to nothing, and at the stable step it keeps
  !> its energy. At a ratio of 10 and beyond every point is bonded to every other.
  subroutine test_ratios(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 6
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: forces(n**3, 3, 2), total
    integer(i8) :: bonds
    integer :: r, f, i, c, seed

    do r = 1, size(ratios)
      do f = 1, size(families)
        call box_scene([n, n, n], dx, 0.3_wp, scene)
        scene%horizon%ratio = ratios(r)
        scene%horizon%family = families(f)
        scene%horizon%surface_correction = 'energy'
        call ready_alone(scene, set_up, error)
        if (allocated(error)) return
        associate (system => set_up%system)
          seed = 17
          do i = 1, n**3
            do c = 1, 3
              system%state%u(system%body%slot(i), c) = 1.0e-6_wp*dx*noise(seed)
            end do
          end do
          call evaluate(system, 0.0_wp, breaking=.false.)
          forces(:, :, f) = system%state%force(system%body%slot, :)
          do c = 1, 3
            call expect(error, sum(forces(:, c, f)), 0.0_wp, 1.0e-12_wp*sum(abs(forces(:, c, f))), &
              & 'net force at ratio '//text_of(ratios(r)))
          end do
          bonds = system%family%n_bonds
          if (r >= 7) call expect(error, real(bonds, wp), real(n**3*(n**3 - 1), wp), 0.0_wp, &
            & 'bonds of a cube smaller than its horizon')
          diary = diary_type()
          diary%every = 60
          call run_explicit(system, 'forward_backward', 0.9_wp*set_up%plan%limit, 120, diary, fault)
        end associate
        if (allocated(fault)) then
          call test_failed(error, fault%message)
          return
        end if
        ! leapfrog's energy differs from the one it keeps by at most a factor 1 +- (omega dt/2)^2
        total = diary%kinetic(1) + diary%strain(1)
        call expect_true(error, maxval(diary%kinetic + diary%strain) < 2*total, &
          & 'energy at ratio '//text_of(ratios(r)))
      end do
      call expect(error, norm2(forces(:, :, 1) - forces(:, :, 2)), 0.0_wp, &
        & 1.0e-12_wp*norm2(forces), 'lattice and list at ratio '//text_of(ratios(r)))
      if (allocated(error)) return
    end do
  end subroutine test_ratios

  !> Chains and sheets in space, a row in the plane, and a beam of 1 x 3 points: thrown at random
  !> they keep their energy at the stable step, as in test_ratios.
  subroutine test_thin(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: shapes(3, 6) = reshape([30, 1, 1, 1, 1, 30, 9, 9, 1, 1, 9, 9, 25, 1, 3, &
      & 30, 1, 0], [3, 6])
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: total(:)
    integer :: s, f, i, c, dim, seed

    do s = 1, size(shapes, 2)
      dim = count(shapes(:, s) > 0)
      do f = 1, size(families)
        call box_scene(shapes(:dim, s), dx, 0.45_wp, scene)
        scene%horizon%family = families(f)
        scene%horizon%surface_correction = 'energy'
        call ready_alone(scene, set_up, error)
        if (allocated(error)) return
        seed = 5
        associate (system => set_up%system)
          do i = 1, system%body%n_points
            do c = 1, dim
              system%state%v(system%body%slot(i), c) = 1.0e-3_wp*noise(seed)
            end do
          end do
          diary = diary_type()
          diary%every = 100
          call run_explicit(system, 'forward_backward', 0.95_wp*set_up%plan%limit, 1000, diary, &
            & fault)
        end associate
        if (allocated(fault)) then
          call test_failed(error, fault%message)
          return
        end if
        total = diary%kinetic + diary%strain
        call expect_true(error, maxval(total) < 2*total(1) .and. minval(total) > 0.2_wp*total(1), &
          & 'energy of a thin body: '//text_of(maxval(total)/total(1)))
      end do
    end do
  end subroutine test_thin

  !> A chain in space has no bonds that could contract sideways: surface correction gives it the
  !> energy of uniaxial strain, (kappa + 4 mu/3)/2, so at nu = 1/4 (no dilatation) it moves as a bar
  !> of 1.2 E, to the rounding of 400 steps.
  subroutine test_chain(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: chain, bar
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: dt
    integer :: f, i

    do f = 1, size(families)
      call box_scene([1, 25, 1], dx, 0.25_wp, scene)
      scene%horizon%family = families(f)
      scene%horizon%surface_correction = 'energy'
      call ready_alone(scene, chain, error)
      call box_scene([25], dx, 0.25_wp, scene)
      scene%horizon%surface_correction = 'energy'
      scene%materials(1)%youngs_modulus = 1.2_wp*youngs_modulus
      call ready_alone(scene, bar, error)
      if (allocated(error)) return
      call expect(error, chain%plan%limit, bar%plan%limit, 1.0e-10_wp*bar%plan%limit, 'step')
      do i = 1, 25
        chain%system%state%v(chain%system%body%slot(i), 2) = sin(0.3_wp*i)
        bar%system%state%v(bar%system%body%slot(i), 1) = sin(0.3_wp*i)
      end do
      dt = 0.8_wp*bar%plan%limit
      diary = diary_type()
      diary%every = 400
      call run_explicit(chain%system, 'forward_backward', dt, 400, diary, fault)
      diary = diary_type()
      diary%every = 400
      if (.not. allocated(fault)) call run_explicit(bar%system, 'forward_backward', dt, 400, &
        & diary, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      associate (found => chain%system%state%u(chain%system%body%slot, 2), &
        & expected => bar%system%state%u(bar%system%body%slot, 1))
        call expect(error, norm2(found - expected), 0.0_wp, 1.0e-10_wp*norm2(expected), 'motion')
      end associate
    end do
  end subroutine test_chain

  !> Motion across a chain or a sheet stretches its bonds in second order only: a tenth of the
  !> displacement has a thousandth of the force. They are a string and a membrane, without
  !> stiffness in bending: theory, not a fault.
  subroutine test_membrane(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: shapes(3, 2) = reshape([20, 1, 1, 8, 8, 1], [3, 2])
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp) :: largest(2)
    integer :: s, f, trial, k

    do s = 1, 2
      do f = 1, size(families)
        call box_scene(shapes(:, s), dx, 0.3_wp, scene)
        scene%horizon%family = families(f)
        scene%horizon%surface_correction = 'energy'
        call ready_alone(scene, set_up, error)
        if (allocated(error)) return
        associate (system => set_up%system)
          do trial = 1, 2
            do k = 1, system%body%n_slots
              if (system%body%point(k) == 0) cycle
              system%state%u(k, 3) = 10.0_wp**(-1 - trial)*dx*sin(40*system%body%x(k, 1))
            end do
            call evaluate(system, 0.0_wp, breaking=.false.)
            largest(trial) = max_abs(system%state%force(:, 3))
          end do
        end associate
        call expect_true(error, largest(1) > 0.0_wp, 'no force at all')
        call expect(error, largest(1)/largest(2), 1.0e3_wp, 1.0_wp, 'force across')
      end do
    end do
  end subroutine test_membrane

  !> Without any bond there is nothing to compute, in every dimension and method. A lonely point
  !> beside a body flies as it was thrown, and the body does not know of it.
  subroutine test_one_point(error)
    type(error_type), allocatable, intent(out) :: error
    character(10), parameter :: methods(*) = [character(10) :: 'explicit', 'relaxation']
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    integer :: dim, f, m, i, k

    do dim = 1, 3
      do f = 1, size(families)
        do m = 1, size(methods)
          call box_scene([(1, i=1, dim)], dx, 0.3_wp, scene)
          scene%horizon%family = families(f)
          scene%time%method = methods(m)
          scene%materials(1)%critical_stretch = 0.1_wp
          call prepare_run(scene, set_up, fault)
          call expect_true(error, allocated(fault), 'one point alone is accepted')
          if (allocated(error)) return
          call expect_true(error, fault%status == status_input .and. index(fault%message, &
            & 'no point of the scene has a neighbour') == 1, fault%message)
        end do
      end do
    end do
    do f = 1, size(families)
      call box_scene([4, 4, 4], dx, 0.3_wp, scene)
      scene%horizon%family = families(f)
      scene%bodies = [scene%bodies(1), scene%bodies(1)]
      scene%bodies(2)%name = 'lonely'
      scene%bodies(2)%points = 1
      ! on a grid of its own
      scene%bodies(2)%lower = 20.3_wp*dx
      scene%bodies(2)%upper = 21.3_wp*dx
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      call expect_true(error, index(set_up%warnings%text(), '1 1 point') == 1, &
        & set_up%warnings%text())
      k = set_up%system%body%slot(65)
      set_up%system%state%v(k, :) = [1.0_wp, -2.0_wp, 4.0_wp]
      diary = diary_type()
      call run_explicit(set_up%system, 'forward_backward', 2.0_wp**(-20), 100, diary, fault)
      associate (u => set_up%system%state%u)
        ! powers of 2: exact
        call expect(error, norm2(u(k, :) - 100*2.0_wp**(-20)*[1.0_wp, -2.0_wp, 4.0_wp]), 0.0_wp, &
          & 0.0_wp, 'flight of the lonely point')
        call expect_close(error, u(set_up%system%body%slot(:64), :), 0.0_wp, 0.0_wp, &
          & 'the body beside')
      end associate
    end do
  end subroutine test_one_point

  !> Two points swing against each other. Each has theta = d delta v_c V s, so the bond carries
  !> f = (4 a (d delta)^2 v_c V/|xi| + 4 b delta) v_c V s: omega^2 = 2 f/(rho s |xi|), and leapfrog
  !> from rest gives u_n = U cos(n phi), sin(phi/2) = omega dt/2. In 1D, 2D (plane stress), 3D.
  subroutine test_two_points(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: nu = 0.2_wp, ratio = 1.3_wp, delta = ratio*dx, amplitude = 1.0e-9_wp*dx
    real(wp), parameter :: pi = acos(-1.0_wp), h = 2.0e-3_wp
    integer, parameter :: steps = 100
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: mu, kappa, a, b, d, w, omega, dt, phi
    integer :: dim, f, n, k(2), points(3)

    mu = youngs_modulus/(2*(1 + nu))
    do dim = 1, 3
      select case (dim)
      case (1)
        a = 0.0_wp
        b = youngs_modulus/(2*area*delta**3)
        d = 1/(2*delta**2*area)
        w = 0.8_wp*dx*area
      case (2)
        kappa = youngs_modulus/(2*(1 - nu))
        a = (kappa - 2*mu)/2
        b = 6*mu/(pi*h*delta**4)
        d = 2/(pi*h*delta**3)
        w = 0.8_wp*dx**2*h
      case default
        kappa = youngs_modulus/(3*(1 - 2*nu))
        a = (kappa - 5*mu/3)/2
        b = 15*mu/(2*pi*delta**5)
        d = 9/(4*pi*delta**4)
        w = 0.8_wp*dx**3
      end select
      omega = sqrt(2*(4*a*(d*delta)**2*w/dx + 4*b*delta)*w/(density_of_steel*dx))
      do f = 1, size(families)
        points = 1
        points(dim) = 2
        call box_scene(points(:dim), dx, nu, scene)
        scene%horizon%ratio = ratio
        scene%horizon%family = families(f)
        call ready_alone(scene, set_up, error)
        if (allocated(error)) return
        k = set_up%system%body%slot(1:2)
        set_up%system%state%u(k, dim) = [-amplitude, amplitude]
        dt = 0.3_wp/omega
        phi = 2*asin(0.15_wp)
        diary = diary_type()
        diary%slot = k(2)
        call run_explicit(set_up%system, 'forward_backward', dt, steps, diary, fault)
        if (allocated(fault)) then
          call test_failed(error, fault%message)
          return
        end if
        do n = 0, steps
          ! the strain of 2e-9 bends the formula by as much at every swing
          call expect(error, diary%u(dim, n + 1), amplitude*cos(n*phi), 1.0e-6_wp*amplitude, &
            & 'two points, '//trim(families(f)))
        end do
        call expect(error, sum(set_up%system%state%u(k, dim)), 0.0_wp, 1.0e-12_wp*amplitude, &
          & 'centre of the two')
      end do
    end do
  end subroutine test_two_points

end module test_extremes_geometry
