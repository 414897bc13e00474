!> Deformation gradient, strain, stresses and fragments against answers in closed form: bodies under
!> one gradient of the displacements, which may be large and rotate, and bodies that are cut.
module test_output_fields_stress
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i8
  use pd_base_numbers, only: pi
  use pd_base_tensors, only: principal_values
  use pd_base_text, only: to_text
  use pd_driver, only: run_scene
  use pd_force_forces, only: energy_pass
  use pd_motion_system, only: renew_forces, start_system, system_type
  use pd_output_fields_field, only: moment_type, output_field_type
  use pd_output_fields_gradient, only: shared_type
  use pd_output_fields_table, only: all_fields, field_table_type
  use pd_output_report_begin, only: run_options_type
  use pd_output_results_datasets, only: get_shape, read_rows
  use pd_output_results_files, only: make_directory
  use pd_output_results_hdf5, only: close_file, hdf5_file, open_file
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: scene_type
  use pd_scene_format_file, only: line_type
  use pd_set_up_prepare, only: set_up_type
  use pd_study_trade_study, only: begin_study, run_all, session_type
  use pd_study_trade_table, only: put_file
  use bodies, only: at_point, box_scene, expect_true, prepare_run, ready_alone, rotation_matrix, &
    & youngs_modulus
  use comparisons, only: expect_close, max_abs
  use force_subjects, only: build, kinds, subject_type
  use test_scene_expect, only: expect_parts, line
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_output_fields_stress

  character(*), parameter :: here = 'build/test_stress'
  real(wp), parameter :: axis(3) = [2.0_wp, -3.0_wp, 6.0_wp]/7.0_wp
  real(wp), parameter :: shear(3, 3) = reshape([0.03_wp, -0.02_wp, 0.01_wp, 0.05_wp, -0.01_wp, &
    & 0.02_wp, -0.015_wp, 0.04_wp, 0.025_wp], [3, 3])  !! a gradient of no symmetry

contains

  subroutine collect_output_fields_stress(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('one gradient everywhere is found at every point', test_gradient), &
      & new_unittest('the stress of one gradient in closed form', test_stress), &
      & new_unittest('a rotated body has a rotated stress', test_turned), &
      & new_unittest('stress of bonds: what their energy says', test_bond_energy), &
      & new_unittest('stress of bonds: the classical one in a fine family', test_bond_stress), &
      & new_unittest('stress of bonds: the same on the generic pass', test_generic), &
      & new_unittest('principal values of known tensors', test_principal), &
      & new_unittest('bonds that give no gradient are counted', test_undefined), &
      & new_unittest('fragments of a body with and without a crack', test_fragments), &
      & new_unittest('laws with a history have the stress of bonds only', test_refused), &
      & new_unittest('tensors in files, probes and studies', test_run)]
  end subroutine collect_output_fields_stress

  !> A gradient of displacements in `dim` dimensions: a stretch and shear, turned by 40 degrees.
  pure function turned_gradient(dim) result(gradient)
    integer, intent(in) :: dim
    real(wp) :: gradient(3, 3)
    real(wp) :: F(3, 3)
    integer :: c

    F = 0.0_wp
    F(:dim, :dim) = shear(:dim, :dim)
    do c = 1, 3
      F(c, c) = F(c, c) + 1
    end do
    if (dim == 2) F = matmul(rotation_matrix([0.0_wp, 0.0_wp, 1.0_wp], 40*pi/180), F)
    if (dim == 3) F = matmul(rotation_matrix(axis, 40*pi/180), F)
    gradient = F
    do c = 1, 3
      gradient(c, c) = gradient(c, c) - 1
    end do
    if (dim == 2) gradient(3, 3) = 0.0_wp
  end function turned_gradient

  !> A subject as a system whose displacements have one gradient, with its forces.
  subroutine strained_system(subject, gradient, system)
    type(subject_type), intent(inout) :: subject  !! built; its family moves
    real(wp), intent(in) :: gradient(3, 3)
    type(system_type), target, intent(out) :: system
    integer :: k, dim

    dim = subject%dim
    system%body = subject%body
    call move_alloc(subject%family, system%family)
    system%model = subject%model
    system%workspace = subject%workspace
    allocate (system%state%u(system%body%n_slots, dim), system%state%v(system%body%n_slots, dim), &
      & source=0.0_wp)
    do k = 1, system%body%n_slots
      if (system%body%point(k) > 0) &
        & system%state%u(k, :) = matmul(gradient(:dim, :dim), system%body%x(k, :))
    end do
    call start_system(system)
    call renew_forces(system, 0.0_wp)
  end subroutine strained_system

  !> A field of all points by `fill`, compared with what `at_slot` gives for one of them.
  subroutine field_of(error, system, name, values)
    type(error_type), allocatable, intent(inout) :: error
    type(system_type), target, intent(in) :: system
    character(*), intent(in) :: name
    real(wp), allocatable, intent(out) :: values(:, :)  !! (point, component)
    type(field_table_type) :: table
    type(output_field_type) :: field
    type(moment_type) :: now
    real(wp), allocatable :: one(:, :)
    integer :: n

    table = all_fields()
    field = table%field(name)
    now%system => system
    now%v => system%state%v
    n = field%components(system%body%dim)
    allocate (values(system%body%n_points, n), one(n, 1))
    call field%all_values(now, values)
    call field%values_at(now, [int(system%body%slot(3))], one)
    call expect_close(error, one(:, 1), values(3, :), 1.0e-12_wp*max_abs(values(3, :)), &
      & name//' at one point')
  end subroutine field_of

  !> Fail unless all points have one value.
  subroutine expect_field(error, system, name, expected, tolerance, what)
    type(error_type), allocatable, intent(inout) :: error
    type(system_type), target, intent(in) :: system
    character(*), intent(in) :: name
    real(wp), intent(in) :: expected(:)
    real(wp), intent(in) :: tolerance
    character(*), intent(in) :: what
    real(wp), allocatable :: values(:, :)
    integer :: c

    call field_of(error, system, name, values)
    call expect_true(error, size(values, 2) == size(expected), name//': components')
    if (allocated(error)) return
    do c = 1, size(expected)
      call expect_close(error, values(:, c), expected(c), tolerance, name//' '//to_text(c)//', '// &
        & what)
    end do
  end subroutine expect_field

  !> The components of a symmetric tensor that the output has.
  pure function parts(tensor, dim, with_zz) result(values)
    real(wp), intent(in) :: tensor(3, 3)
    integer, intent(in) :: dim
    logical, intent(in) :: with_zz
    real(wp), allocatable :: values(:)

    select case (dim)
    case (1); values = [tensor(1, 1)]
    case (2)
      values = [tensor(1, 1), tensor(2, 2), tensor(1, 2)]
      if (with_zz) values = [tensor(1, 1), tensor(2, 2), tensor(3, 3), tensor(1, 2)]
    case default
      values = [tensor(1, 1), tensor(2, 2), tensor(3, 3), tensor(1, 2), tensor(2, 3), tensor(1, 3)]
    end select
  end function parts

  !> On every kind of family, on clouds, with a hole and a crack.
  subroutine test_gradient(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: i, dim

    do dim = 1, 3
      do i = 1, size(kinds)
        call one_gradient(kinds(i), dim, .false.)
      end do
      call one_gradient('list', dim, .true.)
    end do

  contains

    subroutine one_gradient(kind, dim, cloud)
      character(*), intent(in) :: kind
      integer, intent(in) :: dim
      logical, intent(in) :: cloud
      type(subject_type) :: subject
      type(system_type), target :: system
      real(wp) :: gradient(3, 3), F(3, 3), strain(3, 3)
      integer :: c

      if (allocated(error)) return
      subject%kind = kind
      subject%dim = dim
      subject%cloud = cloud
      subject%hole = .not. cloud
      subject%crack = dim > 1
      subject%projected = .false.
      call build(subject)
      gradient = turned_gradient(dim)
      call strained_system(subject, gradient, system)
      F = gradient
      do c = 1, 3
        F(c, c) = F(c, c) + 1
      end do
      if (dim == 2) F(3, 3) = 1.0_wp
      strain = matmul(transpose(F), F)/2
      do c = 1, 3
        strain(c, c) = strain(c, c) - 0.5_wp
      end do
      call expect_field(error, system, 'deformation_gradient', &
        & reshape(transpose(F(:dim, :dim)), [dim**2]), 1.0e-12_wp, kind)
      call expect_field(error, system, 'strain', parts(strain, dim, .false.), 1.0e-12_wp, kind)
    end subroutine one_gradient
  end subroutine test_gradient

  !> Stretches l along the axes and a rotation R: the stress is R diag(s l^2/J) R^T, s that of the
  !> strains (l^2 - 1)/2 by Hooke's law as the compliance states it.
  subroutine test_stress(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: stretch(3) = [1.02_wp, 0.99_wp, 1.01_wp], nu = 0.2_wp
    integer :: dim, plane

    do dim = 1, 3
      do plane = 1, merge(2, 1, dim == 2)
        call one_stress(dim, plane == 2)
      end do
    end do

  contains

    subroutine one_stress(dim, plane_strain)
      integer, intent(in) :: dim
      logical, intent(in) :: plane_strain
      type(subject_type) :: subject
      type(system_type), target :: system
      real(wp) :: F(3, 3), R(3, 3), l(3), s(3), strain(3), stress(3, 3), answer(3), mises
      integer :: c

      if (allocated(error)) return
      subject%kind = 'lattice'
      subject%dim = dim
      subject%poissons_ratio = nu
      subject%plane_strain = plane_strain
      call build(subject)
      R = rotation_matrix([0.0_wp, 0.0_wp, 1.0_wp], merge(0.0_wp, 0.7_wp, dim == 1))
      if (dim == 3) R = rotation_matrix(axis, 0.7_wp)
      l = 1.0_wp
      l(:dim) = stretch(:dim)
      F = 0.0_wp
      do c = 1, 3
        F(:, c) = R(:, c)*l(c)
      end do
      strain = (l**2 - 1)/2
      s = 0.0_wp
      select case (dim)
      case (1)
        s(1) = youngs_modulus*strain(1)
      case (2)
        s(:2) = youngs_modulus/(1 - nu**2)*(strain(:2) + nu*strain([2, 1]))
        if (plane_strain) then
          s(:2) = youngs_modulus/((1 + nu)*(1 - 2*nu))*((1 - nu)*strain(:2) + nu*strain([2, 1]))
          s(3) = nu*(s(1) + s(2))
        end if
      case default
        s = youngs_modulus/(1 + nu)*(strain + nu/(1 - 2*nu)*sum(strain))
      end select
      s = s*l**2/product(l)
      stress = 0.0_wp
      do c = 1, 3
        stress = stress + s(c)*spread(R(:, c), 2, 3)*spread(R(:, c), 1, 3)
      end do
      do c = 1, 3
        F(c, c) = F(c, c) - 1
      end do
      call strained_system(subject, F, system)
      call expect_field(error, system, 'stress', parts(stress, dim, .true.), &
        & 1.0e-11_wp*youngs_modulus, 'of one gradient')
      mises = sqrt(((s(1) - s(2))**2 + (s(2) - s(3))**2 + (s(3) - s(1))**2)/2)
      call expect_field(error, system, 'von_mises', [mises], 1.0e-11_wp*youngs_modulus, &
        & 'of one gradient')
      answer = [maxval(s), sum(s) - maxval(s) - minval(s), minval(s)]
      call expect_field(error, system, 'principal_stress', answer, 1.0e-11_wp*youngs_modulus, &
        & 'of one gradient')
    end subroutine one_stress
  end subroutine test_stress

  !> With thermal strain, too, which differs from point to point: where nothing moves the stress is
  !> -E alpha dT/(1 - 2 nu) in 3D and in plane strain, zz included, and -E alpha dT/(1 - nu) in
  !> plane stress. Turned with the body it has other axes.
  subroutine test_turned(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: nu = 0.2_wp
    real(wp) :: per_strain
    integer :: dim, plane

    do dim = 2, 3
      do plane = 1, merge(2, 1, dim == 2)
        per_strain = -youngs_modulus/(1 - 2*nu)
        if (dim == 2) per_strain = -youngs_modulus/(1 - nu)
        ! a scene's material gets (1 + nu) alpha for alpha in plane strain, a subject's does not
        if (plane == 2) per_strain = -youngs_modulus/((1 - 2*nu)*(1 + nu))
        call one_turn(dim, plane == 2)
      end do
    end do

  contains

    subroutine one_turn(dim, plane_strain)
      integer, intent(in) :: dim
      logical, intent(in) :: plane_strain
      type(subject_type) :: subject
      type(system_type), target :: system
      real(wp), allocatable :: at_rest(:, :), before(:, :), after(:, :)
      real(wp) :: R(3, 3), F(3, 3), stress(3, 3), turned(3, 3), swelling
      integer :: c, i, k

      if (allocated(error)) return
      subject%kind = 'list'
      subject%dim = dim
      subject%poissons_ratio = nu
      subject%plane_strain = plane_strain
      subject%thermal = .true.
      call build(subject)
      F = turned_gradient(dim)
      call strained_system(subject, F, system)
      call field_of(error, system, 'stress', before)
      R = rotation_matrix([0.0_wp, 0.0_wp, 1.0_wp], 1.1_wp)
      if (dim == 3) R = rotation_matrix(axis, 1.1_wp)
      do c = 1, 3
        F(c, c) = F(c, c) + 1
      end do
      F = matmul(R, F)
      do c = 1, 3
        F(c, c) = F(c, c) - 1
      end do
      do k = 1, system%body%n_slots
        system%state%u(k, :) = matmul(F(:dim, :dim), system%body%x(k, :))
      end do
      call field_of(error, system, 'stress', after)
      system%state%u = 0.0_wp
      call field_of(error, system, 'stress', at_rest)
      if (allocated(error)) return
      do i = 1, system%body%n_points
        stress = matrix_of(before(i, :))
        turned = matmul(R, matmul(stress, transpose(R)))
        call expect_close(error, after(i, :), parts(turned, dim, .true.), &
          & 1.0e-11_wp*youngs_modulus, 'turned')
        swelling = system%model%expansion(system%body%slot(i))
        call expect_close(error, at_rest(i, :2), per_strain*swelling, 1.0e-14_wp*youngs_modulus, &
          & 'at rest')
        if (plane_strain .or. dim == 3) call expect_close(error, at_rest(i, 3), &
          & per_strain*swelling, 1.0e-14_wp*youngs_modulus, 'zz at rest')
      end do
    end subroutine one_turn

    pure function matrix_of(values) result(tensor)
      real(wp), intent(in) :: values(:)
      real(wp) :: tensor(3, 3)

      tensor = 0.0_wp
      tensor(1, 1) = values(1)
      tensor(2, 2) = values(2)
      tensor(3, 3) = values(3)
      tensor(1, 2) = values(4)
      if (size(values) == 6) then
        tensor(2, 3) = values(5)
        tensor(1, 3) = values(6)
      end if
      tensor(2, 1) = tensor(1, 2)
      tensor(3, 2) = tensor(2, 3)
      tensor(3, 1) = tensor(1, 3)
    end function matrix_of
  end subroutine test_turned

  !> Under a small strain e that is the same everywhere, the energy of the bonds of an interior
  !> point is half the product of their stress with e, on any lattice.
  subroutine test_bond_energy(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: dim

    do dim = 1, 3
      call one_energy(dim)
    end do

  contains

    subroutine one_energy(dim)
      integer, intent(in) :: dim
      type(subject_type) :: subject
      type(system_type), target :: system
      real(wp), allocatable :: stress(:, :), energy(:)
      real(wp) :: strain(3, 3)
      real(wp), allocatable :: e(:), times(:)
      integer :: k, counts(3)

      if (allocated(error)) return
      subject%kind = 'lattice'
      subject%dim = dim
      subject%poissons_ratio = 0.35_wp
      counts = 1
      counts(:dim) = 15
      subject%points = counts
      call build(subject)
      strain = 1.0e-7_wp*(shear + transpose(shear))/norm2(shear)
      call strained_system(subject, strain, system)
      call field_of(error, system, 'bond_stress', stress)
      allocate (energy(system%body%n_slots))
      call energy_pass(system%family, system%model, system%workspace, system%state%u, energy)
      e = parts(strain, dim, .false.)
      allocate (times(size(e)), source=2.0_wp)
      times(:dim) = 1.0_wp
      k = system%body%point(at_point(system%body, spread(sum(system%body%x(:, 1), &
        & mask=system%body%point > 0)/system%body%n_points, 1, dim)))
      if (allocated(error)) return
      call expect_close(error, dot_product(stress(k, :)*times, e)/2, &
        & energy(system%body%slot(k)), 1.0e-5_wp*energy(system%body%slot(k)), 'energy')
    end subroutine one_energy
  end subroutine test_bond_energy

  !> A family of eight spacings, cut exactly, is an integral up to some tenths of a per cent.
  subroutine test_bond_stress(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type), target :: set_up
    real(wp), allocatable :: bonds(:, :), classical(:, :)
    real(wp) :: centre(2)
    integer :: k, i, plane

    do plane = 1, 2
      call box_scene([41, 41], 0.01_wp, 0.25_wp, scene)
      scene%horizon%ratio = 8.015_wp
      scene%horizon%volume_correction = 'exact'
      scene%header%plane = merge('stress', 'strain', plane == 1)
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      associate (system => set_up%system)
        do i = 1, system%body%n_slots
          system%state%u(i, :) = matmul(1.0e-6_wp*(shear(:2, :2) + transpose(shear(:2, :2))), &
            & system%body%x(i, :))
        end do
        call renew_forces(system, 0.0_wp)
        call field_of(error, system, 'bond_stress', bonds)
        call field_of(error, system, 'stress', classical)
        centre = 0.205_wp
        k = system%body%point(at_point(system%body, centre))
        if (allocated(error)) return
        call expect_close(error, bonds(k, :), classical(k, [1, 2, 4]), &
          & 0.005_wp*max_abs(classical(k, :)), 'stress of bonds')
      end associate
    end do
  end subroutine test_bond_stress

  !> Also with surface factors, thermal strain, a crack and two materials.
  subroutine test_generic(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: fast(:, :), slow(:, :)
    integer :: dim

    do dim = 2, 3
      call stress_on('list', dim, fast)
      call stress_on('generic', dim, slow)
      if (allocated(error)) return
      call expect_close(error, slow, fast, 1.0e-12_wp*youngs_modulus, 'stress of bonds')
      call expect_true(error, max_abs(fast) > 1.0e-3_wp*youngs_modulus, 'there is no stress')
    end do

  contains

    subroutine stress_on(kind, dim, values)
      character(*), intent(in) :: kind
      integer, intent(in) :: dim
      real(wp), allocatable, intent(out) :: values(:, :)
      type(subject_type) :: subject
      type(system_type), target :: system

      subject%kind = kind
      subject%dim = dim
      subject%surface = .true.
      subject%thermal = .true.
      subject%crack = .true.
      subject%two_materials = .true.
      subject%projected = .false.
      call build(subject)
      call strained_system(subject, turned_gradient(dim), system)
      call field_of(error, system, 'bond_stress', values)
    end subroutine stress_on
  end subroutine test_generic

  !> Turned diagonals: distinct, double, threefold and nearly double values, large, small and none.
  subroutine test_principal(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: known(3, 7) = reshape([ &
      & 3.0_wp, 2.0_wp, -1.0_wp, &
      & 2.0_wp, 2.0_wp, -1.0_wp, &
      & 5.0_wp, 1.0_wp, 1.0_wp, &
      & 4.0_wp, 4.0_wp, 4.0_wp, &
      & 1.0_wp + 1.0e-13_wp, 1.0_wp, 0.5_wp, &
      & 1.0e200_wp, 1.0_wp, -1.0e200_wp, &
      & 0.0_wp, 0.0_wp, 0.0_wp], [3, 7])
    integer, parameter :: orders(3, 3) = reshape([1, 2, 3, 3, 1, 2, 2, 3, 1], [3, 3])
    real(wp) :: R(3, 3), tensor(3, 3), values(3)
    integer :: i, j, c, order

    do i = 1, size(known, 2)
      do j = 0, 4
        R = rotation_matrix(axis, 0.3_wp*j)
        do order = 1, 3
          tensor = 0.0_wp
          do c = 1, 3
            tensor = tensor + known(orders(c, order), i)*spread(R(:, c), 2, 3)*spread(R(:, c), 1, 3)
          end do
          call expect_close(error, principal_values(tensor), known(:, i), &
            & 4.0e-15_wp*max_abs(known(:, i)), 'principal values')
        end do
      end do
    end do
    tensor(2, 3) = ieee_value(1.0_wp, ieee_quiet_nan)
    values = principal_values(tensor)
    call expect_true(error, all(ieee_is_nan(values)), 'principal values of no number')
  end subroutine test_principal

  !> A straight chain in the plane has no gradient across; a plate has one everywhere.
  subroutine test_undefined(error)
    type(error_type), allocatable, intent(out) :: error

    call count_undefined([9, 1], 9)
    call count_undefined([9, 2], 0)
    call count_undefined([1, 1], 1)

  contains

    subroutine count_undefined(points, expected)
      integer, intent(in) :: points(2), expected
      type(subject_type) :: subject
      type(system_type), target :: system
      type(shared_type), target :: shared
      type(field_table_type) :: table
      type(output_field_type) :: field
      type(moment_type) :: now
      real(wp) :: values(product(points), 4)

      if (allocated(error)) return
      subject%kind = 'list'
      subject%dim = 2
      subject%points = [points, 1]
      call build(subject)
      call strained_system(subject, turned_gradient(2), system)
      table = all_fields()
      field = table%field('deformation_gradient')
      now%system => system
      now%v => system%state%v
      now%shared => shared
      call field%all_values(now, values)
      call expect_true(error, shared%undefined == expected, to_text(shared%undefined)//' points')
      if (expected > 0) call expect_close(error, values(1, :), [1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], &
        & 0.0_wp, 'F')
      if (expected == 0) call expect_true(error, abs(values(1, 1) - 1) > 0.01_wp, 'F')
    end subroutine count_undefined
  end subroutine test_undefined

  !> A plate cut along y = 0.5: points below belong to the first fragment.
  subroutine test_fragments(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type), target :: set_up
    real(wp), allocatable :: values(:, :)
    integer :: i, c

    do c = 0, 1
      call box_scene([10, 10], 0.1_wp, 0.25_wp, scene)
      if (c == 1) then
        deallocate (scene%cracks)
        allocate (scene%cracks(1))
        scene%cracks(1)%from(:2) = [-1.0_wp, 0.5_wp]
        scene%cracks(1)%to(:2) = [2.0_wp, 0.5_wp]
      end if
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      call field_of(error, set_up%system, 'fragment', values)
      associate (body => set_up%system%body)
        do i = 1, body%n_points
          call expect_close(error, values(i, 1), merge(2.0_wp, 1.0_wp, c == 1 .and. &
            & body%x(body%slot(i), 2) > 0.5_wp), 0.0_wp, 'fragment')
        end do
      end associate
    end do
  end subroutine test_fragments

  !> Of a plastic body; an elastic one has all of them.
  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: names(5) = [character(16) :: 'stress', 'von_mises', &
      & 'principal_stress', 'bond_stress', 'strain']
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    integer :: i, plastic

    do plastic = 0, 1
      do i = 1, size(names)
        call box_scene([5, 5, 5], 0.1_wp, 0.25_wp, scene)
        if (plastic == 1) then
          scene%materials(1)%model = 'lps_plastic'
          scene%materials(1)%influence = 'linear'
          allocate (scene%materials(1)%parameters(2))
          scene%materials(1)%parameters%name = ['yield_stress', 'hardening   ']
          scene%materials(1)%parameters%value = [1.0e8_wp, 0.0_wp]
          scene%horizon%dilatation = 'unprojected'
        end if
        scene%output%fields = [names(i)]
        call prepare_run(scene, set_up, fault)
        if (plastic == 1 .and. i <= 3) then
          call expect_parts(error, fault, "this scene has no field '"//trim(names(i))//"'|"// &
            & "model 'lps_plastic'|history|'bond_stress'")
        else if (allocated(fault)) then
          call test_failed(error, trim(names(i))//' is refused: '//fault%message)
        end if
        if (allocated(error)) return
      end do
    end do
  end subroutine test_refused

  !> A plate that is strained from the start and flies for two steps of no length to speak of.
  subroutine test_run(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: points = 30
    character(*), parameter :: plate = '&scene dimension = 2 /'//line// &
      & '&body lower = 0.0, 0.0 upper = 0.6, 0.5 points = 6, 5 /'//line// &
      & '&initial velocity_x = 3.0 displacement_gradient(1,1) = 1.0e-3 /'//line// &
      & '&material youngs_modulus = 200.0e9 poissons_ratio = 0.25 density = 7850.0 /'//line// &
      & '&time step = 1.0e-12 duration = 2.0e-12 /'//line// &
      & "&probe name = 'p' point = 0.3, 0.2 fields = 'stress', 'deformation_gradient', "// &
      & "'principal_stress', 'fragment' /"//line
    real(wp), parameter :: strain = 1.0e-3_wp + 0.5e-6_wp
    real(wp), parameter :: xx = 200.0e9_wp*strain/(1 - 0.0625_wp)*1.001_wp, &
      & yy = 0.25_wp*200.0e9_wp*strain/(1 - 0.0625_wp)/1.001_wp
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(session_type) :: session
    type(hdf5_file) :: file
    type(fault_type), allocatable :: fault
    real(wp) :: tensors(4, 2*points), three(3, 2*points), column(3)
    integer(i8) :: rows
    integer :: components, threads

    threads = omp_get_max_threads()
    options%output_directory = here//'/plate'
    options%quiet = .true.
    options%overwrite = .true.
    options%threads = 1
    call make_directory(here, fault)
    if (.not. allocated(fault)) call read_scene_text(plate//"&output fields = 'stress', "// &
      & "'principal_stress', 'von_mises', 'strain', 'bond_stress', 'deformation_gradient', "// &
      & "'fragment' every = 2 history_every = 1 format = 'both' /", 'plate.nml', scene, fault)
    if (.not. allocated(fault)) call run_scene(scene, options, fault)
    call omp_set_num_threads(threads)
    if (.not. allocated(fault)) call open_file(here//'/plate/plate.vtkhdf', .false., file, fault)
    if (.not. allocated(fault)) call get_shape(file, '/VTKHDF/PointData/stress', components, rows, &
      & fault)
    if (.not. allocated(fault)) call read_rows(file, '/VTKHDF/PointData/stress', 0_i8, tensors, &
      & fault)
    if (.not. allocated(fault)) call read_rows(file, '/VTKHDF/PointData/principal_stress', 0_i8, &
      & three, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call expect_true(error, components == 4 .and. rows == 2*points, 'shape of the stress')
    call expect_close(error, tensors(1, :), xx, 1.0e-6_wp*xx, 'xx')
    call expect_close(error, tensors(2, :), yy, 1.0e-6_wp*xx, 'yy')
    call expect_close(error, tensors(3, :), 0.0_wp, 0.0_wp, 'zz')
    call expect_close(error, tensors(4, :), 0.0_wp, 1.0e-6_wp*xx, 'xy')
    call expect_close(error, three(1, :), xx, 1.0e-6_wp*xx, 'the largest')
    call expect_close(error, three(2, :), yy, 1.0e-6_wp*xx, 'the one between')
    call expect_close(error, three(3, :), 0.0_wp, 1.0e-6_wp*xx, 'the smallest')
    call expect_column('p_stress_yy', yy, 1.0e-6_wp*xx)
    call expect_column('p_stress_zz', 0.0_wp, 0.0_wp)
    call expect_column('p_deformation_gradient_xx', 1.001_wp, 1.0e-9_wp)
    call expect_column('p_deformation_gradient_yx', 0.0_wp, 1.0e-9_wp)
    call expect_column('p_principal_stress_1', xx, 1.0e-6_wp*xx)
    call expect_column('p_fragment', 1.0_wp, 0.0_wp)
    call close_file(file, fault)
    if (.not. allocated(fault)) call put_file(here, 'study.nml', plate// &
      & "&study vary = 'time%step' values = 1.0e-12, 0.5e-12 measure = 'p_stress_xx' "// &
      & "against = 'finest' norm = 'rms' /"//line, fault)
    options%output_directory = here//'/study'
    if (.not. allocated(fault)) call begin_study(here//'/study.nml', options, session, fault, &
      & [line_type ::])
    if (.not. allocated(fault)) call run_all(session, fault)
    call omp_set_num_threads(threads)
    call accept(error, fault)
    if (allocated(error)) return
    call expect_close(error, session%outcomes(1)%value, xx, 1.0e-6_wp*xx, 'measured xx')

  contains

    subroutine expect_column(name, expected, tolerance)
      character(*), intent(in) :: name
      real(wp), intent(in) :: expected, tolerance

      if (allocated(error)) return
      call read_rows(file, '/history/'//name, 0_i8, column, fault)
      call accept(error, fault)
      call expect_close(error, column, expected, tolerance, name)
    end subroutine expect_column
  end subroutine test_run

  subroutine accept(error, fault)
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable, intent(in) :: fault
    if (allocated(fault) .and. .not. allocated(error)) call test_failed(error, fault%message)
  end subroutine accept

end module test_output_fields_stress
