!> Wave speeds and the energy of a critical stretch, against closed forms.
module test_body_waves
  use pd_base_kinds, only: wp
  use pd_law_material, only: energy_from_critical_stretch, material_type, new_material
  use pd_body_waves, only: longitudinal_speed, rayleigh_speed, shear_speed
  use testdrive, only: error_type, new_unittest, unittest_type
  use bodies, only: expect
  implicit none (type, external)
  private
  public :: collect_body_waves

  real(wp), parameter :: E = 200.0e9_wp, rho = 7850.0_wp, delta = 3.0e-3_wp
  real(wp), parameter :: rounding = 1.0e-13_wp

contains

  subroutine collect_body_waves(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('waves within a body', test_body_speeds), &
      & new_unittest('surface waves', test_rayleigh), &
      & new_unittest('the energy of a critical stretch', test_energy)]
  end subroutine collect_body_waves

  !> A material in `dim` dimensions.
  pure type(material_type) function material(dim, nu, plane_strain)
    integer, intent(in) :: dim
    real(wp), intent(in) :: nu
    logical, intent(in) :: plane_strain
    material = new_material(E, nu, rho, dim, plane_strain, 1.0_wp, 1.0_wp, delta, .false.)
  end function material

  !> E(1-nu)/((1+nu)(1-2nu) rho) in 3D and plane strain, E/((1-nu^2) rho) in plates, E/rho in bars.
  subroutine test_body_speeds(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: nu = 0.3_wp
    real(wp), parameter :: bulk = sqrt(E*(1 - nu)/((1 + nu)*(1 - 2*nu)*rho))

    call expect(error, longitudinal_speed(material(3, nu, .false.))/bulk, 1.0_wp, rounding, '3D')
    call expect(error, longitudinal_speed(material(2, nu, .true.))/bulk, 1.0_wp, rounding, &
      & 'plane strain')
    call expect(error, longitudinal_speed(material(2, nu, .false.))/sqrt(E/((1 - nu**2)*rho)), &
      & 1.0_wp, rounding, 'plate')
    call expect(error, longitudinal_speed(material(1, nu, .false.))/sqrt(E/rho), 1.0_wp, &
      & rounding, 'bar')
    call expect(error, shear_speed(material(2, nu, .false.))/sqrt(E/(2*(1 + nu)*rho)), 1.0_wp, &
      & rounding, 'shear')
  end subroutine test_body_speeds

  !> For nu = 1/4 the polynomial factorises: c_R/c_S = sqrt(2 - 2/sqrt(3)). A plate in plane stress
  !> with nu = 1/3 has the same (c_S/c_P)^2 = 1/3. An incompressible solid: 0.95531 (Rayleigh).
  subroutine test_rayleigh(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: quarter = sqrt(2 - 2/sqrt(3.0_wp))
    type(material_type) :: m

    m = material(3, 0.25_wp, .false.)
    call expect(error, rayleigh_speed(m)/shear_speed(m), quarter, rounding, 'nu = 1/4')
    m = material(2, 1.0_wp/3.0_wp, .false.)
    call expect(error, rayleigh_speed(m)/shear_speed(m), quarter, rounding, 'plate, nu = 1/3')
    m = material(3, 0.4999999_wp, .false.)
    call expect(error, rayleigh_speed(m)/shear_speed(m), 0.95531_wp, 1.0e-5_wp, 'nu = 1/2')
  end subroutine test_rayleigh

  !> Bond-based: Gc = 9 kappa s_c^2 delta/5 in 3D (Silling and Askari 2005), 9 E s_c^2 delta/(4 pi)
  !> in plane stress; E s_c^2 delta/3 in 1D.
  subroutine test_energy(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: s = 1.0e-3_wp, pi = acos(-1.0_wp)
    type(material_type) :: m

    m = material(3, 0.25_wp, .false.)
    m%critical_stretch = s
    call expect(error, energy_from_critical_stretch(m, 3, delta)/(9*E/1.5_wp*s**2*delta/5), &
      & 1.0_wp, rounding, '3D')
    m = material(2, 1.0_wp/3.0_wp, .false.)
    m%critical_stretch = s
    call expect(error, energy_from_critical_stretch(m, 2, delta)/(9*E*s**2*delta/(4*pi)), 1.0_wp, &
      & rounding, '2D')
    m = material(1, 0.25_wp, .false.)
    m%critical_stretch = s
    call expect(error, energy_from_critical_stretch(m, 1, delta)/(E*s**2*delta/3), 1.0_wp, &
      & rounding, '1D')
  end subroutine test_energy

end module test_body_waves
