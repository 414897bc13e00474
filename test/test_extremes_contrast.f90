!> Two bodies of very different materials on one bar.
module test_extremes_contrast
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: pi
  use pd_base_error, only: fault_type => error_type
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_motion_system, only: system_type
  use pd_scene_content_types, only: scene_type
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: box_scene, density_of_steel, diary_type, expect, ready_alone, youngs_modulus
  implicit none (type, external)
  private
  public :: collect_extremes_contrast

  real(wp), parameter :: dx = 1.0e-2_wp     !! spacing of all bodies here [m]
  character(9), parameter :: families(*) = [character(9) :: 'lattice', 'list']

contains

  subroutine collect_extremes_contrast(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('long: a wave meets a body 1e6 stiffer, 1e4 denser', test_impedance), &
      & new_unittest('stress passes into a body 1e6 times stiffer', test_stiff_in_series)]
  end subroutine collect_extremes_contrast

  !> Two bars in line, the second 1e6 times stiffer and 1e4 times denser.
  subroutine two_bars(points, family, scene)
    integer, intent(in) :: points(2)
    character(*), intent(in) :: family
    type(scene_type), intent(out) :: scene

    call box_scene(points(1:1), dx, 0.3_wp, scene)
    scene%horizon%surface_correction = 'energy'
    scene%horizon%family = family
    scene%bodies = [scene%bodies(1), scene%bodies(1)]
    scene%bodies(2)%name = 'other'
    scene%bodies(2)%points(1) = points(2)
    scene%bodies(2)%lower(1) = points(1)*dx
    scene%bodies(2)%upper(1) = sum(points)*dx
    scene%materials = [scene%materials(1), scene%materials(1)]
    scene%materials(1)%youngs_modulus = youngs_modulus/1.0e6_wp
    scene%materials(1)%density = density_of_steel/1.0e4_wp
    scene%materials(2)%name = 'other'
    scene%bodies(1)%material = 'steel'
    scene%bodies(2)%material = 'other'
  end subroutine two_bars

  !> A pulse 60 points long runs in the soft bar towards the stiff one. Of its energy the part
  !> 4 Z1 Z2/(Z1 + Z2)^2, Z = sqrt(E rho), goes on: 4e-5 at Z2/Z1 = 1e5. Momentum stays, and what is
  !> reflected carries twice the pulse's momentum into the stiff bar. The families across the
  !> interface smear it over 3 of 60 points: 5 %.
  subroutine test_impedance(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: points(2) = [120, 850]
    real(wp), parameter :: length = 60*dx, middle = 80*dx, amplitude = 1.0e-4_wp*dx
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: c, dt, x, total, passed, momentum
    integer :: f, i

    do f = 1, size(families)
      call two_bars(points, trim(families(f)), scene)
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      c = sqrt(youngs_modulus/density_of_steel/1.0e2_wp)
      associate (system => set_up%system)
        do i = 1, points(1)
          associate (k => system%body%slot(i))
            x = system%body%x(k, 1) - middle
            if (abs(x) > length/2) cycle
            ! u = f(x - c t), v = -c f'
            system%state%u(k, 1) = amplitude*(1 + cos(2*pi*x/length))/2
            system%state%v(k, 1) = c*amplitude*pi/length*sin(2*pi*x/length)
          end associate
        end do
        dt = 0.8_wp*set_up%plan%limit
        diary = diary_type()
        diary%every = 1000000
        momentum = momentum_of(system, 1, sum(points))
        call run_explicit(system, 'forward_backward', dt, nint(75*dx/c/dt), diary, fault)
        if (allocated(fault)) then
          call test_failed(error, fault%message)
          return
        end if
        total = diary%kinetic(1) + diary%strain(1)
        ! of a wave that travels half the energy is kinetic
        passed = 0.0_wp
        do i = points(1) + 1, sum(points)
          passed = passed + density_of_steel*3.0e-4_wp*dx*system%state%v(system%body%slot(i), 1)**2
        end do
        call expect(error, passed/total, 4.0e-5_wp, 0.05_wp*4.0e-5_wp, 'energy that goes on')
        call expect(error, diary%kinetic(2) + diary%strain(2), total, 1.0e-3_wp*total, 'energy')
        call expect(error, momentum_of(system, 1, sum(points)), momentum, 1.0e-9_wp &
          & *momentum_of(system, 1, sum(points), .true.), 'momentum')
      end associate
    end do
  end subroutine test_impedance

  !> Momentum of some points [kg m/s], or the sum of its absolute values.
  real(wp) function momentum_of(system, first, last, absolute) result(momentum)
    type(system_type), intent(in) :: system
    integer, intent(in) :: first, last
    logical, intent(in), optional :: absolute
    real(wp) :: own
    integer :: i

    momentum = 0.0_wp
    do i = first, last
      associate (k => system%body%slot(i))
        own = system%model%materials(system%model%material(k))%density*system%body%volume(k) &
          & *system%state%v(k, 1)
        if (present(absolute)) own = abs(own)
        momentum = momentum + own
      end associate
    end do
  end function momentum_of

  !> A pull of 1 kPa on both ends: the strain is P/E in each bar, away from ends and interface.
  subroutine test_stiff_in_series(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: strain(2)
    integer :: f

    do f = 1, size(families)
      call two_bars([20, 20], trim(families(f)), scene)
      scene%time%method = 'relaxation'
      scene%relaxation%tolerance = 1.0e-9_wp
      deallocate (scene%loads)
      allocate (scene%loads(2))
      scene%loads(1)%side = 'x_min'
      scene%loads(1)%body = 'box'
      scene%loads(2)%side = 'x_max'
      scene%loads(2)%body = 'other'
      scene%loads%pressure = -1.0e3_wp
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      diary = diary_type()
      call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      associate (u => set_up%system%state%u, slot => set_up%system%body%slot)
        strain(1) = (u(slot(13), 1) - u(slot(8), 1))/(5*dx)
        strain(2) = (u(slot(33), 1) - u(slot(28), 1))/(5*dx)
      end associate
      ! strains of 5e-3 and 5e-9; the residual of 1e-9 of the load is in equilibrium with both
      call expect(error, strain(1)*youngs_modulus/1.0e6_wp, 1.0e3_wp, 1.0_wp, 'stress, soft')
      call expect(error, strain(2)*youngs_modulus, 1.0e3_wp, 1.0_wp, 'stress, stiff')
    end do
  end subroutine test_stiff_in_series

end module test_extremes_contrast
