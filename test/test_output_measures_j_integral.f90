!> The J integral: of the fields of Williams, whose J and stress intensity factors are known, and of
!> cracks in plates under load, against the handbook.
module test_output_measures_j_integral
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: pi
  use pd_base_text, only: to_text
  use pd_driver, only: run_scene
  use pd_motion_system, only: system_type
  use pd_output_fields_table, only: all_fields
  use pd_output_measures_measure, only: measure_list_type, row_source_type
  use pd_output_report_before, only: foresee_output
  use pd_output_report_begin, only: run_options_type
  use pd_output_results_answer, only: answer_type
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: prepare, set_up_type
  use bodies, only: expect_true
  use comparisons, only: expect_close
  use test_scene_expect, only: expect_fault, expect_parts, good_head, line
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_output_measures_j_integral

  real(wp), parameter :: youngs_modulus = 2.0e11_wp, sigma = 1.0e6_wp

contains

  subroutine collect_output_measures_j_integral(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('fields of Williams, both modes, plane stress', test_stress), &
      & new_unittest('fields of Williams, both modes, plane strain', test_strain), &
      & new_unittest('a crack along another direction', test_direction), &
      & new_unittest('a crack in the centre of a plate in tension', test_centre), &
      & new_unittest('boxes and runs that warn', test_warnings), &
      & new_unittest('J integrals that cannot be had', test_wrong)]
  end subroutine collect_output_measures_j_integral

  !> A square plate with a crack from the middle of a side to its centre, and two boxes.
  function square(plane, from, direction, more) result(text)
    character(*), intent(in) :: plane, from, direction
    character(*), intent(in) :: more
    character(:), allocatable :: text
    text = "&scene dimension = 2 thickness = 0.01 plane = '"//plane//"' /"//line// &
      & '&material youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.3 /'//line// &
      & "&body name = 'plate' lower = -0.5, -0.5 upper = 0.5, 0.5 points = 64, 64 /"//line// &
      & '&crack from = '//from//' to = 0, 0 /'//line//"&time method = 'relaxation' /"//line// &
      & "&output fields = 'displacement' /"//line// &
      & "&j_integral name = 'wide' lower = -0.4, -0.4 upper = 0.4, 0.4 direction = "//direction// &
      & ' /'//line//"&j_integral name = 'close' lower = -0.3, -0.25 upper = 0.3, 0.25 "// &
      & 'direction = '//direction//' /'//line//more
  end function square

  !> What the measures of a scene say of fields of Williams [m], with the given stress intensities
  !> [Pa m^0.5], of a crack that ends at the origin.
  subroutine measure_williams(error, text, K_I, K_II, values, plane_modulus)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text
    real(wp), intent(in) :: K_I, K_II
    real(wp), allocatable, intent(out) :: values(:)   !! (6) J, K_I and K_II of both boxes
    real(wp), intent(out) :: plane_modulus            !! E or E/(1 - nu^2) [Pa]
    type(scene_type) :: scene
    type(set_up_type), target :: set_up
    type(measure_list_type) :: measures
    type(row_source_type) :: now
    type(fault_type), allocatable :: fault
    real(wp) :: along(2), across(2), x(2), r, angle, mu, kolosov, u(2)
    integer :: k

    allocate (values(6), source=0.0_wp)
    plane_modulus = 1.0_wp
    if (allocated(error)) return
    call read_scene_text(text, 'j.nml', scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    if (.not. allocated(fault)) call foresee_output(scene, all_fields(), set_up, measures, fault)
    if (allocated(fault)) then
      call test_failed(error, 'refused: '//fault%message)
      return
    end if
    along = scene%j_integrals(1)%direction(:2)/norm2(scene%j_integrals(1)%direction(:2))
    across = [-along(2), along(1)]
    associate (system => set_up%system)
      mu = youngs_modulus/2.6_wp
      kolosov = (3 - 0.3_wp)/(1 + 0.3_wp)
      plane_modulus = youngs_modulus
      if (scene%header%plane == 'strain') then
        kolosov = 3 - 4*0.3_wp
        plane_modulus = youngs_modulus/(1 - 0.3_wp**2)
      end if
      do k = 1, system%body%n_slots
        if (system%body%point(k) == 0) cycle
        x = [dot_product(system%body%x(k, :), along), dot_product(system%body%x(k, :), across)]
        r = norm2(x)
        angle = atan2(x(2), x(1))/2
        u(1) = K_I*cos(angle)*(kolosov - 1 + 2*sin(angle)**2) &
          & + K_II*sin(angle)*(kolosov + 1 + 2*cos(angle)**2)
        u(2) = K_I*sin(angle)*(kolosov + 1 - 2*cos(angle)**2) &
          & - K_II*cos(angle)*(kolosov - 1 - 2*sin(angle)**2)
        u = u*sqrt(r/(2*pi))/(2*mu)
        system%state%u(k, :) = u(1)*along + u(2)*across
      end do
    end associate
    now%system => set_up%system
    now%v => set_up%system%state%v
    call measures%row(now, values)
  end subroutine measure_williams

  !> Both boxes within 2 % of J = (K_I^2 + K_II^2)/E', which also is their agreement; factors within
  !> 2 % of the larger one.
  subroutine expect_factors(error, values, K_I, K_II, plane_modulus, what)
    type(error_type), allocatable, intent(inout) :: error
    real(wp), intent(in) :: values(6), K_I, K_II, plane_modulus
    character(*), intent(in) :: what
    real(wp), parameter :: tolerance = 0.02_wp
    real(wp) :: J, largest
    integer :: i

    J = (K_I**2 + K_II**2)/plane_modulus
    largest = max(abs(K_I), abs(K_II))
    do i = 0, 3, 3
      call expect_close(error, values(i + 1), J, tolerance*J, 'J, '//what)
      call expect_close(error, values(i + 2), K_I, tolerance*largest, 'K_I, '//what)
      call expect_close(error, values(i + 3), K_II, tolerance*largest, 'K_II, '//what)
    end do
    call expect_close(error, values(4), values(1), tolerance*J, 'J of two boxes, '//what)
  end subroutine expect_factors

  !> Pure modes and mixed ones, of either sense.
  subroutine all_modes(error, text)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text
    real(wp), parameter :: modes(2, 4) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.7_wp, -0.5_wp, &
      & -0.4_wp, 0.8_wp], [2, 4])*1.0e6_wp
    real(wp), allocatable :: values(:)
    real(wp) :: plane_modulus
    integer :: m

    do m = 1, size(modes, 2)
      call measure_williams(error, text, modes(1, m), modes(2, m), values, plane_modulus)
      call expect_factors(error, values, modes(1, m), modes(2, m), plane_modulus, 'mode '// &
        & to_text(m))
    end do
  end subroutine all_modes

  subroutine test_stress(error)
    type(error_type), allocatable, intent(out) :: error
    call all_modes(error, square('stress', '-1, 0', '1, 0', ''))
  end subroutine test_stress

  subroutine test_strain(error)
    type(error_type), allocatable, intent(out) :: error
    call all_modes(error, square('strain', '-1, 0', '1, 0', ''))
  end subroutine test_strain

  subroutine test_direction(error)
    type(error_type), allocatable, intent(out) :: error
    call all_modes(error, square('stress', '0, 1', '0, -2', ''))
  end subroutine test_direction

  !> A plate of unit width and twice its height with a crack of length 2 a in its centre, pulled at
  !> its ends. Without crack for a = 0.
  function centre_cracked(a) result(text)
    real(wp), intent(in) :: a
    character(:), allocatable :: text
    text = '&scene dimension = 2 thickness = 0.01 /'//line// &
      & '&material youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.3 /'//line// &
      & "&body name = 'plate' lower = -0.5, -1 upper = 0.5, 1 points = 60, 120 /"//line// &
      & "&load side = 'y_min' pressure = -1e6 /"//line//"&load side = 'y_max' pressure = -1e6 /"// &
      & line//"&time method = 'relaxation' /"//line//'&relaxation tolerance = 1e-6 /'//line// &
      & "&output fields = 'displacement' /"//line
    if (a > 0.0_wp) text = text//'&crack from = '//to_text(-a)//', 0 to = '//to_text(a)//', 0 /'// &
      & line//"&j_integral name = 'wide' lower = -0.04, -0.28 upper = 0.44, 0.28 tip = 0.2, 0 "// &
      & 'direction = 1, 0 /'//line// &
      & "&j_integral name = 'close' lower = 0.02, -0.2 upper = 0.38, 0.2 direction = 1, 0 /"// &
      & line//"&j_integral name = 'left' lower = -0.44, -0.28 upper = 0.04, 0.28 tip = -0.2, 0 "// &
      & 'direction = -1, 0 /'//line
  end function centre_cracked

  !> The crack has the length that its compliance says: that with which linear elastic fracture
  !> mechanics gives the energy which the crack adds. For half of it, a, K_I of the handbook is
  !> sigma sqrt(pi a sec(pi a/W)) (Feddersen; within 0.5 % of exact solutions).
  subroutine test_centre(error)
    type(error_type), allocatable, intent(out) :: error
    type(answer_type) :: whole, cracked
    real(wp) :: energy, a, K, low, high
    real(wp) :: last(9)
    integer :: i, c

    call solve(error, centre_cracked(0.0_wp), whole)
    call solve(error, centre_cracked(0.2_wp), cracked)
    if (allocated(error)) return
    c = whole%column_number('strain_energy')
    energy = cracked%history(size(cracked%history, 1), c) - whole%history(size(whole%history, 1), c)
    low = 0.1_wp
    high = 0.3_wp
    do i = 1, 60
      a = (low + high)/2
      if (energy_of_crack(a) < energy) then
        low = a
      else
        high = a
      end if
    end do
    call expect_close(error, a, 0.2_wp, 0.5_wp/60, 'half the length of the crack by its compliance')
    K = sigma*sqrt(pi*a/cos(pi*a))
    last = cracked%history(size(cracked%history, 1), size(cracked%history, 2) - 8:)
    do i = 1, 9, 3
      call expect_close(error, last(i), K**2/youngs_modulus, 0.06_wp*K**2/youngs_modulus, 'J')
      call expect_close(error, last(i + 1), K, 0.03_wp*K, 'K_I')
      call expect_close(error, last(i + 2), 0.0_wp, 0.01_wp*K, 'K_II')
    end do
    call expect_close(error, last(4), last(1), 0.02_wp*last(1), 'J of another box')
  end subroutine test_centre

  !> The strain energy that a crack adds at constant load, the integral of 2 G t over half its
  !> length, by Simpson's rule [J].
  pure real(wp) function energy_of_crack(a) result(energy)
    real(wp), intent(in) :: a
    integer, parameter :: n = 200
    integer :: i
    real(wp) :: s, weight

    energy = 0.0_wp
    do i = 0, n
      s = a*i/n
      weight = merge(4.0_wp, 2.0_wp, mod(i, 2) == 1)
      if (i == 0 .or. i == n) weight = 1.0_wp
      energy = energy + weight*2*0.01_wp*sigma**2*pi*s/cos(pi*s)/youngs_modulus
    end do
    energy = energy*a/(3*n)
  end function energy_of_crack

  !> Run a scene without files.
  subroutine solve(error, text, answer)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text
    type(answer_type), intent(out) :: answer
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(fault_type), allocatable :: fault
    integer :: before

    if (allocated(error)) return
    call read_scene_text(text, 'j.nml', scene, fault)
    options%files = .false.
    options%quiet = .true.
    before = omp_get_max_threads()
    if (.not. allocated(fault)) call run_scene(scene, options, fault, answer=answer)
    call omp_set_num_threads(before)
    if (allocated(fault)) call test_failed(error, 'refused: '//fault%message)
  end subroutine solve

  !> Refused by a run before its first step.
  subroutine expect_refused(error, text, parts)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text, parts
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    call read_scene_text(text, 'j.nml', scene, fault)
    options%files = .false.
    options%quiet = .true.
    if (.not. allocated(fault)) call run_scene(scene, options, fault)
    call expect_parts(error, fault, parts)
  end subroutine expect_refused

  !> A run in time, and a box whose inner half barely holds the tip.
  subroutine test_warnings(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: narrow = &
      & "&j_integral name = 'narrow' lower = -0.08, -0.08 upper = 0.08, 0.08 "// &
      & 'direction = 1, 0 /'//line
    integer :: w
    type(scene_type) :: scene
    type(set_up_type), target :: set_up
    type(measure_list_type) :: measures
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text

    do w = 1, 3
      text = square('stress', '-1, 0', '1, 0', '')
      if (w == 2) text = square('stress', '-1, 0', '1, 0', narrow)
      if (w == 3) text = good_head//'&time steps = 5 /'//line//"&j_integral name = 'moving' "// &
        & 'lower = 0.3, 0.1 upper = 0.7, 0.4 direction = 1, 0 /'
      call read_scene_text(text, 'j.nml', scene, fault)
      if (.not. allocated(fault)) call prepare(scene, set_up, fault)
      if (.not. allocated(fault)) call foresee_output(scene, all_fields(), set_up, measures, fault)
      if (allocated(fault)) then
        call test_failed(error, 'refused: '//fault%message)
        return
      end if
      call expect_true(error, set_up%warnings%has('J integral 3') .eqv. w == 2, 'a narrow box')
      call expect_true(error, set_up%warnings%has('J integral') .eqv. w == 3, 'a run in time')
    end do
  end subroutine test_warnings

  subroutine test_wrong(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: steps = '&time steps = 5 /'//line
    character(*), parameter :: box = "&j_integral name = 'tip' direction = 1, 0 lower = 0.3, "// &
      & '0.1 upper = 0.7, 0.4 /'

    call expect_fault(error, '&scene dimension = 1 /'//line// &
      & '&material youngs_modulus = 1e9 density = 1e3 /'//line// &
      & "&body name = 'bar' lower = 0 upper = 1 points = 10 /"//line//steps// &
      & "&j_integral name = 'tip' direction = 1 lower = 0.3 upper = 0.7 /", &
      & '&j_integral in a scene of dimension 1|dimension = 2')
    call expect_fault(error, good_head//steps// &
      & "&j_integral name = 'tip' direction = 1, 0 lower = 0.3, 0.1 /", "lacks the key 'upper'")
    call expect_fault(error, good_head//steps// &
      & "&j_integral name = 'tip' direction = 1, 0 lower = 0.3, 0.1 upper = 0.7, 0.4 "// &
      & 'tip = 0.35, 0.25 /', "'tip' lies outside of the inner half")
    call expect_refused(error, good_head//steps// &
      & "&j_integral name = 'tip' direction = 1, 0 lower = 0.3, 0.2 upper = 0.7, 0.6 /", &
      & "there is no J integral 'tip'|the box reaches beyond the bodies")
    call expect_refused(error, good_head//steps// &
      & "&j_integral name = 'tip' direction = 1, 0 lower = 0.3, 0.1 upper = 0.7, 0.5 "// &
      & 'tip = 0.5, 0.21 /', &
      & "there is no J integral 'tip'|mirror image")
    call expect_refused(error, '&scene dimension = 2 /'//line// &
      & '&material youngs_modulus = 1e9 density = 1e3 poissons_ratio = 0.3 '// &
      & 'thermal_expansion = 1e-5 /'//line// &
      & "&body name = 'plate' lower = 0, 0 upper = 1, 0.5 points = 40, 20 /"//line//steps// &
      & '&initial temperature_change = 5 /'//line//box, "there is no J integral 'tip'|temperature")
    call expect_refused(error, '&scene dimension = 2 /'//line// &
      & "&material model = 'softening' critical_stretch = 0.01 peak_stretch = 0.005 "// &
      & 'youngs_modulus = 1e9 density = 1e3 /'//line// &
      & "&body name = 'plate' lower = 0, 0 upper = 1, 0.5 points = 40, 20 /"//line//steps//box, &
      & "there is no J integral 'tip'|depends on its history")
    call expect_refused(error, '&scene dimension = 2 /'//line// &
      & "&material name = 'a' youngs_modulus = 1e9 density = 1e3 poissons_ratio = 0.3 /"//line// &
      & "&material name = 'b' youngs_modulus = 2e9 density = 1e3 poissons_ratio = 0.3 /"//line// &
      & "&body name = 'one' lower = 0, 0 upper = 0.5, 0.5 points = 20, 20 material = 'a' /"// &
      & line//"&body name = 'two' lower = 0.5, 0 upper = 1, 0.5 points = 20, 20 "// &
      & "material = 'b' /"//line//steps//box, "there is no J integral 'tip'|more than one material")
  end subroutine test_wrong

end module test_output_measures_j_integral
