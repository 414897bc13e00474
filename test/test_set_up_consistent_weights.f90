!> Consistent weights of bonds: surface areas, the weights of an independent program, the classical
!> answer to uniform strains, loads and held layers, and the order of the error in bending.
module test_set_up_consistent_weights
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_long_work, only: long_work_type
  use pd_base_error, only: fault_type => error_type
  use pd_body_body, only: allocate_points, body_type
  use pd_body_meshes, only: surface_areas
  use pd_body_side_areas, only: total_areas
  use pd_family_areas, only: area_vectors
  use pd_family_cracks, only: cut_bonds
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_family_list, only: list_family_type, new_list_family
  use pd_family_volume, only: volume_linear, volume_rule_type
  use pd_force_breaking, only: cut_followers
  use pd_force_forces, only: energy_pass, internal_force
  use pd_force_model, only: model_type, new_model, options_of
  use pd_force_reference, only: reference_dilatation, reference_energy, reference_force
  use pd_law_material, only: material_type, new_material
  use pd_motion_explicit_spectrum, only: lowest_eigenvalue
  use pd_motion_system, only: evaluate, system_type
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_scene_content_read, only: read_scene_text
  use pd_motion_loads, only: load_type
  use pd_scene_content_types, only: scene_type
  use pd_set_up_consistent_weights, only: solution_type, weights_of_areas
  use pd_set_up_consistent_least_change, only: unbounded
  use pd_set_up_loads, only: loads_of_scene
  use pd_set_up_move, only: move
  use pd_set_up_prepare, only: prepare, set_up_type
  use comparisons, only: expect_close, max_abs
  use meshes, only: block_sample, gmsh_text, number_text, sample_type, write_file
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: at_point, box_scene, diary_type, expect, expect_true, noise, ready, &
    & ready_alone, rotation_matrix, text_of, youngs_modulus
  implicit none (type, external)
  private
  public :: collect_set_up_consistent_weights

  real(wp), parameter :: spacing = 1.0e-2_wp
  character(*), parameter :: lf = new_line('a')
  real(wp), parameter :: zeta = 1.0e-11_wp  !! strain: its square is below what is compared
  real(wp), parameter :: tension = zeta*youngs_modulus  !! of loads [Pa]

contains

  subroutine collect_set_up_consistent_weights(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('surface areas of bodies with corners and holes', test_areas), &
      & new_unittest('the weights of an independent program', test_independent), &
      & new_unittest('points that look alike have the same weights in bodies of any size', &
      & test_alike), &
      & new_unittest('long: uniform strains are in equilibrium with classical tractions', &
      & test_uniform), &
      & new_unittest('weights of the whole box far from missing cells', test_missing_cells), &
      & new_unittest('long: uniform strains of bodies of two materials', test_two_materials), &
      & new_unittest('strains that leave tractions continuous need no force', test_continuous), &
      & new_unittest('two materials in series', test_series), &
      & new_unittest('long: grids of several spacings and offsets that touch', test_grids), &
      & new_unittest('loads on sides and held layers of refined plates', test_refined), &
      & new_unittest('a rotated strip of points without a lattice', test_clouds), &
      & new_unittest('clouds whose surface areas are found', test_outlines), &
      & new_unittest('long: the centres of tetrahedra', test_tetrahedra), &
      & new_unittest('long: a large cloud', test_large_cloud), &
      & new_unittest('meshes of every shape in the plane', test_meshes), &
      & new_unittest('tetrahedra and discs with surface areas of their own', test_own_areas), &
      & new_unittest('a pulled mesh is strained uniformly', test_pulled_mesh), &
      & new_unittest('what consistent weights do not serve of meshes is refused', &
      & test_refused_meshes), &
      & new_unittest('loads on sides strain a body uniformly', test_loads), &
      & new_unittest('held layers strain a body uniformly', test_layers), &
      & new_unittest('long: the error in bending is of second order', test_bending), &
      & new_unittest('long: forces have no resultant and follow from the energy', &
      & test_conservation), &
      & new_unittest('an explicit run keeps its energy; the step beside that by energy', &
      & test_explicit), &
      & new_unittest('long: random fracture dissipates', test_fracture), &
      & new_unittest('bonds with negative weights go with others', test_negative), &
      & new_unittest('what consistent weights do not serve is refused', test_refused)]
  end subroutine collect_set_up_consistent_weights

  !> A scene of a name: bar, plate, block, L, plate with a hole.
  subroutine scene_of(name, poissons_ratio, scene)
    character(*), intent(in) :: name
    real(wp), intent(in) :: poissons_ratio
    type(scene_type), intent(out) :: scene

    select case (name)
    case ('bar')
      call box_scene([20], spacing, poissons_ratio, scene)
    case ('block')
      call box_scene([10, 6, 6], spacing, poissons_ratio, scene)
    case default
      call box_scene([20, 16], spacing, poissons_ratio, scene)
      if (name /= 'plate') then
        deallocate (scene%removed)
        allocate (scene%removed(1))
      end if
      if (name == 'L') then
        scene%removed(1)%shape = 'box'
        scene%removed(1)%lower(:2) = [12.0_wp, 8.0_wp]*spacing
      else if (name == 'hole') then
        scene%removed(1)%shape = 'cylinder'
        scene%removed(1)%centre(:2) = [10.0_wp, 8.0_wp]*spacing
        scene%removed(1)%radius = 3.2_wp*spacing
      end if
    end select
    scene%horizon%surface_correction = 'consistent'
  end subroutine scene_of

  !> Areas sum to nothing, and with the positions to the volume; on a face they are 1.5 and -0.5.
  subroutine test_areas(error)
    type(error_type), allocatable, intent(out) :: error
    character(5), parameter :: names(*) = [character(5) :: 'bar', 'plate', 'block', 'L', 'hole']
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: area(:, :), moment(:, :)
    integer :: i, c, d, k, alone

    do i = 1, size(names)
      call scene_of(trim(names(i)), 0.3_wp, scene)
      scene%horizon%surface_correction = 'none'
      call ready(scene, set_up, error)
      if (allocated(error)) return
      associate (body => set_up%system%body)
        call area_vectors(body, set_up%system%family, [1.0_wp], area, alone)
        call expect_true(error, alone == 0, 'a point alone: '//names(i))
        allocate (moment(body%dim, body%dim))
        do c = 1, body%dim
          call expect(error, sum(area(:, c)), 0.0_wp, 1.0e-12_wp*sum(abs(area)), &
            & 'sum of areas: '//names(i))
          do d = 1, body%dim
            moment(c, d) = sum(area(:, c)*body%x(:, d))
            if (c == d) moment(c, d) = moment(c, d) - sum(body%volume)
          end do
        end do
        call expect_close(error, moment, 0.0_wp, 1.0e-12_wp*sum(body%volume), &
          & 'areas and positions: '//names(i))
        deallocate (moment)
        if (names(i) /= 'plate') cycle
        ! left edge, in its middle, and the point behind: thickness 2 mm
        k = at_point(body, [0.5_wp, 8.5_wp]*spacing)
        call expect_close(error, area(k, :), [-1.5_wp, 0.0_wp]*spacing*2.0e-3_wp, 1.0e-18_wp, &
          & 'at a face')
        k = at_point(body, [1.5_wp, 8.5_wp]*spacing)
        call expect_close(error, area(k, :), [0.5_wp, 0.0_wp]*spacing*2.0e-3_wp, 1.0e-18_wp, &
          & 'behind a face')
      end associate
    end do
  end subroutine test_areas

  !> Weights of single bonds without bounds, as LSQR of SciPy finds them for these bodies: largest,
  !> smallest and sum of squares, over ordered bonds. Its tolerance was 1e-12 of the residual, the
  !> weights agree to 1e-9.
  subroutine test_independent(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: found(6, 2) = reshape([ &
      & -0.669462668235874_wp, 7.3110466186414484_wp, 6059.060383612568_wp, &
      & -3.510026950283696_wp, 6.63937854141627_wp, 8445.548031350554_wp, &
      & -3.3884146943854807_wp, 14.546227312731396_wp, 108118.69381696152_wp, &
      & -5.741731445797753_wp, 13.754668189519075_wp, 175464.9697849915_wp], [6, 2])
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    integer :: i, family

    do i = 1, 2
      do family = 1, 2
        if (i == 1) call box_scene([20, 8], spacing, 0.3_wp, scene)
        if (i == 2) call box_scene([10, 6, 6], spacing, 0.3_wp, scene)
        if (family == 2) scene%horizon%family = 'list'
        call ready(scene, set_up, error)
        if (allocated(error)) return
        call compare(set_up%system, found(:, i))
        if (allocated(error)) return
      end do
    end do

  contains

    subroutine compare(system, expected)
      type(system_type), intent(inout) :: system
      real(wp), intent(in) :: expected(:)
      type(solution_type) :: b, d
      type(long_work_type) :: work
      type(fault_type), allocatable :: fault
      real(wp), allocatable :: of_stretch(:, :), of_dilatation(:, :)
      integer :: alone

      associate (m => system%model%materials, weights => system%model%weights)
        call area_vectors(system%body, system%family, m%shear_modulus, of_stretch, alone)
        call area_vectors(system%body, system%family, [sign(1.0_wp, m(1)%a)], of_dilatation, alone)
        call weights_of_areas(system%body, system%family, m, of_stretch, of_dilatation, .true., &
          & [unbounded], weights, b, d, fault, work)
        if (allocated(fault)) then
          call test_failed(error, fault%message)
          return
        end if
        call expect_close(error, [minval(weights%Gb), maxval(weights%Gb), &
          & sum(weights%Gb**2)/2, minval(weights%Gd), maxval(weights%Gd), &
          & sum(weights%Gd**2)/2]/expected, 1.0_wp, 1.0e-8_wp, 'weights over those expected')
      end associate
    end subroutine compare

  end subroutine test_independent

  !> A wide plate and a wider one need the same weights, on lattices and on lists. Inside, bonds of
  !> one length class have one weight: what is there is symmetric.
  subroutine test_alike(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp) :: extremes(4, 3)
    integer :: i

    do i = 1, 3
      call box_scene([merge(40, 24, i == 2), merge(26, 24, i == 2)], spacing, 0.4_wp, scene)
      scene%horizon%surface_correction = 'consistent'
      if (i == 3) scene%horizon%family = 'list'
      call ready(scene, set_up, error)
      if (allocated(error)) return
      associate (w => set_up%system%model%weights)
        extremes(:, i) = [minval(w%Gb), maxval(w%Gb), minval(w%Gd), maxval(w%Gd)]
      end associate
    end do
    call expect_close(error, extremes(:, 2), extremes(:, 1), 1.0e-9_wp, 'a wider plate')
    call expect_close(error, extremes(:, 3), extremes(:, 1), 1.0e-9_wp, 'a list')
    call expect_true(error, extremes(1, 1) > 0.049_wp .and. extremes(3, 1) > -0.101_wp, &
      & 'the bounds of the weights')
  end subroutine test_alike

  !> All uniform strains of several bodies, ratios and both families, by the fast loops and by the
  !> reference. Forces are within 1e-9 of the largest traction over a spacing, dilatations and the
  !> total energy within 1e-9 of the classical.
  subroutine test_uniform(error)
    type(error_type), allocatable, intent(out) :: error
    character(5), parameter :: names(*) = [character(5) :: 'bar', 'plate', 'block', 'L', 'hole']
    real(wp), parameter :: ratios(*) = [0.2_wp, 0.3_wp, 0.45_wp]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    integer :: i, r, family

    do i = 1, size(names)
      do r = 1, size(ratios)
        do family = 1, 2
          if (names(i) == 'block' .and. r + family /= 3) cycle
          if (r /= 2 .and. names(i) /= 'plate' .and. names(i) /= 'block') cycle
          if (names(i) == 'L' .and. family == 1 .or. names(i) == 'hole' .and. family == 2) cycle
          call scene_of(trim(names(i)), ratios(r), scene)
          scene%horizon%family = trim(merge('list   ', 'lattice', family == 2))
          call ready(scene, set_up, error)
          if (allocated(error)) return
          call strain_all(set_up%system, names(i)//' at '//text_of(ratios(r)), error)
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_uniform

  !> Plates and a block with holes: uniform strains are in equilibrium, with the areas of faces and
  !> where areas change; points far from the hole have the weights of the whole box, to the last
  !> bit; and what those near it have does not depend on the size of the plate.
  subroutine test_missing_cells(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: few = 4  ! horizons that are near
    type(scene_type) :: scene
    type(set_up_type) :: set_up, whole
    type(bonds_type) :: bonds
    real(wp) :: middle(3), extremes(4, 2)
    integer :: cells(3), i, k, o, apart

    do i = 1, 4
      cells = [48, 44, 1]
      if (i == 2) cells = [56, 60, 1]
      if (i == 3) cells = [60, 60, 1]
      if (i == 4) cells = [30, 22, 6]
      middle = [cells(1)/2, 22, 0]*spacing
      if (i == 4) middle(:2) = [9, 11]*spacing
      call box_scene(cells(:merge(3, 2, i == 4)), spacing, 0.3_wp, scene)
      scene%horizon%surface_correction = 'consistent'
      call ready(scene, whole, error)
      if (allocated(error)) return
      if (allocated(scene%removed)) deallocate (scene%removed)
      allocate (scene%removed(1))
      scene%removed(1)%shape = 'cylinder'
      scene%removed(1)%centre = middle
      ! 12 spacings: there are no weights Gb of 0.05 with the areas of faces
      scene%removed(1)%radius = merge(12.0_wp, merge(2.2_wp, 6.2_wp, i == 4), i == 3)*spacing
      call ready(scene, set_up, error)
      if (allocated(error)) return
      call strain_all(set_up%system, 'missing cells '//text_of(real(i, wp)), error)
      if (allocated(error)) return
      call expect_true(error, allocated(set_up%system%body%surface_area) .eqv. i == 3, &
        & 'areas change: '//text_of(real(i, wp)))
      call allocate_bonds(set_up%system%family, bonds)
      apart = 0
      associate (body => set_up%system%body, own => set_up%system%model%weights, &
        & box => whole%system%model%weights)
        call expect_true(error, body%n_slots == whole%system%body%n_slots, 'the same slots')
        do k = 1, body%n_slots
          if (body%point(k) == 0) cycle
          o = whole%system%body%point(k)
          if (norm2(body%x(k, :2) - middle(:2)) <= scene%removed(1)%radius + (few + 1)*body%delta) &
            & cycle
          apart = apart + 1
          call expect_true(error, o > 0, 'a point of the box')
          call set_up%system%family%bonds_of(k, bonds)
          call expect_close(error, own%Gb(own%before(k) + 1:own%before(k) + bonds%n), &
            & box%Gb(box%before(k) + 1:box%before(k) + bonds%n), 0.0_wp, 'Gb far from the hole')
          call expect_close(error, own%Gd(own%before(k) + 1:own%before(k) + bonds%n), &
            & box%Gd(box%before(k) + 1:box%before(k) + bonds%n), 0.0_wp, 'Gd far from the hole')
          if (allocated(error)) return
        end do
        call expect_true(error, apart > 0, 'points far from the hole')
        if (i < 3) extremes(:, i) = [minval(own%Gb), maxval(own%Gb), minval(own%Gd), &
          & maxval(own%Gd)]
      end associate
      if (allocated(error)) return
    end do
    call expect_close(error, extremes(:, 2), extremes(:, 1), 1.0e-8_wp, 'a larger plate')
    call expect_true(error, extremes(1, 1) > 0.049_wp .and. extremes(3, 1) > -0.501_wp, &
      & 'the bounds of the weights')
  end subroutine test_missing_cells

  !> Put every uniform strain on a system.
  subroutine strain_all(system, what, error)
    type(system_type), intent(inout) :: system
    character(*), intent(in) :: what
    type(error_type), allocatable, intent(inout) :: error
    real(wp), allocatable :: of_lambda(:, :), of_mu(:, :), p(:), energy(:)
    integer(i1), allocatable :: strained(:)
    type(fault_type), allocatable :: fault
    integer :: alone, x, y

    allocate (p(merge(system%body%n_slots, 0, system%model%dilatation)), source=0.0_wp)
    allocate (energy(system%body%n_slots), strained(0))
    associate (body => system%body, m => system%model%materials)
      if (allocated(body%surface_area)) then
        of_mu = body%surface_area
      else if (allocated(body%sides)) then
        of_mu = total_areas(body%sides, body%n_slots, body%dim)
      else if (size(body%parts) > 0) then
        call surface_areas(body, of_mu, fault)
      end if
      if (allocated(of_mu)) then
        of_lambda = maxval(lame_of(m, body%dim))*of_mu
        of_mu = maxval(shear_of(m, body%dim))*of_mu
      else
        ! what the dilatation and the stretches carry, each parted by its own stiffness
        call area_vectors(body, system%family, twice_a_of(m, body%dim), of_lambda, alone)
        call area_vectors(body, system%family, shear_of(m, body%dim), of_mu, alone)
        if (body%dim > 1) of_lambda = of_lambda + of_mu
      end if
    end associate
    do x = 1, system%body%dim
      do y = x, system%body%dim
        call one_strain(x, y)
        if (allocated(error)) return
      end do
    end do

  contains

    subroutine one_strain(x, y)
      integer, intent(in) :: x, y
      real(wp) :: strain(system%body%dim, system%body%dim), trace, classical
      real(wp), allocatable :: u(:, :), force(:, :), expected(:, :), theta(:)
      integer :: k, c

      strain = 0.0_wp
      strain(x, y) = strain(x, y) + zeta/2
      strain(y, x) = strain(y, x) + zeta/2
      trace = merge(zeta, 0.0_wp, x == y)
      associate (body => system%body, model => system%model)
        allocate (u(body%n_slots, body%dim), force(body%n_slots, body%dim), source=0.0_wp)
        allocate (expected, mold=u)
        allocate (theta(body%n_slots), source=0.0_wp)
        u = matmul(body%x, strain)
        expected = 0.0_wp
        do k = 1, body%n_slots
          if (body%point(k) == 0) then
            u(k, :) = 0.0_wp
          else
            expected(k, :) = -(of_lambda(k, :)*trace + 2*matmul(strain, of_mu(k, :))) &
              & /body%volume(k)
          end if
        end do
        call internal_force(body, system%family, model, options_of(model), system%workspace, u, &
          & p, force, strained)
        call expect_close(error, force, expected, 1.0e-9_wp*max_abs(expected), &
          & 'forces of the loops: '//what)
        call reference_force(system%family, model, u, force)
        call expect_close(error, force, expected, 1.0e-9_wp*max_abs(expected), &
          & 'forces of the reference: '//what)
        call reference_dilatation(system%family, model, u, theta)
        call expect_close(error, theta, [(merge(trace, 0.0_wp, body%point(k) > 0), &
          & k=1, body%n_slots)], 1.0e-9_wp*zeta, 'dilatations: '//what)
        classical = 0.0_wp
        do c = 1, body%dim
          classical = classical - sum(u(:, c)*expected(:, c)*body%volume)/2
        end do
        call energy_pass(system%family, model, system%workspace, u, energy)
        call expect(error, sum(energy*body%volume), classical, 1.0e-9_wp*classical, &
          & 'energy of the loops: '//what)
        call reference_energy(system%family, model, u, energy)
        call expect(error, sum(energy*body%volume), classical, 1.0e-9_wp*classical, &
          & 'energy of the reference: '//what)
      end associate
    end subroutine one_strain

  end subroutine strain_all

  !> A mesh of 8 by 6 cells of a shape, warped so that no two elements are alike and quadratic ones
  !> are curved, as build/consistent.msh; and the text of a scene with it.
  subroutine put_mesh(number, points, poissons_ratio, text)
    integer, intent(in) :: number     !! of the shape
    integer, intent(in) :: points     !! of an element
    character(*), intent(in) :: poissons_ratio
    character(:), allocatable, intent(out) :: text
    type(sample_type) :: sample
    integer :: i, cells(3)

    cells = merge([12, 10, 1], [7, 6, 1], points == 1)
    call block_sample(number, cells, [0.08_wp, 0.06_wp, 1.0_wp], sample)
    do i = 1, sample%n_nodes
      associate (x => sample%x(:, i))
        x(:2) = x(:2) + [0.003_wp*sin(80*x(2)), 0.002_wp*sin(70*x(1) + 1)]
      end associate
    end do
    call write_file('consistent.msh', gmsh_text(sample, 4, .true., .false.))
    text = '&scene dimension = 2 thickness = 0.01 /'//lf//"&body name = 'part' mesh = "// &
      & "'consistent.msh' points_per_element = "//number_text(points)//' /'//lf// &
      & '&material youngs_modulus = 2e11 density = 7800 poissons_ratio = '//poissons_ratio//' /' &
      & //lf//"&horizon surface_correction = 'consistent' /"//lf// &
      & "&time method = 'relaxation' /"//lf
  end subroutine put_mesh

  !> Read a scene that stands in build/ and make it ready; `fault` is what stops it.
  subroutine ready_of_text(text, set_up, fault)
    character(*), intent(in) :: text
    type(set_up_type), intent(out) :: set_up
    type(fault_type), allocatable, intent(out) :: fault
    type(scene_type) :: scene

    call read_scene_text(text, 'build/consistent.nml', scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
  end subroutine ready_of_text

  !> Every uniform strain on warped meshes, with one point for each element and with several.
  !> Triangles with one point, whose diagonals are all alike, have stable weights only with surface
  !> areas of their own: with a load on a side they are refused.
  subroutine test_meshes(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: several(4:8) = [3, 6, 4, 9, 4]
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text, name
    logical :: own
    integer :: s, r

    ! triangles of 3 and 6 nodes, quadrilaterals of 4, 8 and 9
    do s = 4, 8
      do r = 1, 2
        own = s < 6 .and. r == 1
        name = 'shape '//text_of(real(s, wp))//' with '//text_of(real(r, wp))
        call put_mesh(s, merge(1, several(s), r == 1), '0.4', text)
        call ready_of_text(text, set_up, fault)
        if (allocated(fault)) then
          call test_failed(error, name//': '//fault%message)
          return
        end if
        call expect_true(error, allocated(set_up%system%body%surface_area) .eqv. own, &
          & 'own areas: '//name)
        if (allocated(error)) return
        call strain_all(set_up%system, name, error)
        if (allocated(error)) return
        if (.not. own) cycle
        call ready_of_text(text//"&load side = 'part:LEFT' pressure = 1 /"//lf, set_up, fault)
        call expect_true(error, allocated(fault), 'not refused: '//name)
        if (allocated(error)) return
        call expect_true(error, index(fault%message, 'makes this body unstable') > 0, fault%message)
        if (allocated(error)) return
      end do
    end do
  end subroutine test_meshes

  !> Every uniform strain on a mesh of tetrahedra, and on discs of a lattice that have no stable
  !> weights for the areas of their faces. Points on which a load acts keep these.
  subroutine test_own_areas(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: radii(*) = [3.0_wp, 7.0_wp, 8.0_wp]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    type(load_type), allocatable :: loads(:)
    type(sample_type) :: sample
    character(:), allocatable :: n, text
    real(wp), allocatable :: of_faces(:, :)
    integer :: i, alone

    call block_sample(9, [3, 3, 3], [0.06_wp, 0.06_wp, 0.06_wp], sample)
    call write_file('consistent.msh', gmsh_text(sample, 4, .true., .false.))
    call strain_text(grid_scene(3, "&body name = 'part' mesh = 'consistent.msh' /"//lf// &
      & "&horizon surface_correction = 'consistent' /"), 'tetrahedra')
    do i = 1, size(radii)
      n = number_text(nint(2*radii(i)))
      text = grid_scene(2, '&body lower = 0, 0 upper = '//n//', '//n//' points = '//n//', '//n// &
        & ' /'//lf//"&keep shape = 'sphere' centre = "//text_of(radii(i))//', '// &
        & text_of(radii(i))//' radius = '//text_of(radii(i))//' /'//lf// &
        & "&horizon surface_correction = 'consistent' /"//lf)
      call strain_text(text, 'disc of '//n)
    end do
    if (allocated(error)) return
    text = text//"&load side = 'x_min' pressure = 1 /"//lf
    call strain_text(text, 'loaded disc')
    if (allocated(error)) return
    call read_scene_text(text, 'build/consistent.nml', scene, fault)
    associate (body => set_up%system%body, family => set_up%system%family)
      call loads_of_scene(scene, body, family, loads, fault)
      call area_vectors(body, family, [1.0_wp], of_faces, alone)
      associate (slots => loads(1)%slots)
        call expect_true(error, size(slots) > 0 .and. all(abs(body%surface_area(slots, :) &
          & - of_faces(slots, :)) <= 0.0_wp), 'a load acts on other areas')
        call expect_true(error, any(abs(body%surface_area - of_faces) &
          & > 1.0e-3_wp*max_abs(of_faces)), 'no area has changed')
      end associate
    end associate

  contains

    subroutine strain_text(text, what)
      character(*), intent(in) :: text, what

      if (allocated(error)) return
      call ready_of_text(text, set_up, fault)
      if (allocated(fault)) then
        call test_failed(error, what//': '//fault%message)
        return
      end if
      call expect_true(error, allocated(set_up%system%body%surface_area), 'own areas: '//what)
      if (allocated(error)) return
      call strain_all(set_up%system, what, error)
    end subroutine strain_text

  end subroutine test_own_areas

  !> Pressure on the ends of a straight mesh strains it by sigma/E along and -nu sigma/E across, to
  !> the square of the strain of 5e-8; what is held is a point.
  subroutine test_pulled_mesh(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: stress = 1.0e4_wp, modulus = 2.0e11_wp, nu = 0.3_wp
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    type(sample_type) :: sample
    real(wp), allocatable :: u(:, :), x(:, :), expected(:, :)
    real(wp) :: turn

    call block_sample(6, [12, 10, 1], [0.12_wp, 0.1_wp, 1.0_wp], sample)
    call write_file('consistent.msh', gmsh_text(sample, 4, .true., .false.))
    call ready_of_text('&scene dimension = 2 thickness = 0.01 /'//lf// &
      & "&body name = 'part' mesh = 'consistent.msh' /"//lf// &
      & '&material youngs_modulus = 2e11 density = 7800 poissons_ratio = 0.3 /'//lf// &
      & "&horizon surface_correction = 'consistent' /"//lf// &
      & "&load side = 'part:LEFT' pressure = -1e4 /"//lf// &
      & "&load side = 'part:RIGHT' pressure = -1e4 /"//lf// &
      & "&time method = 'relaxation' /"//lf//'&relaxation tolerance = 1e-11 /'//lf, set_up, fault)
    if (.not. allocated(fault)) call run_relaxation(set_up%system, set_up%plan%relaxation, diary, &
      & fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    associate (body => set_up%system%body)
      x = body%x(body%slot, :)
      u = set_up%system%state%u(body%slot, :)
    end associate
    ! without what a rigid motion adds
    x = x - spread(sum(x, dim=1)/size(x, 1), 1, size(x, 1))
    u = u - spread(sum(u, dim=1)/size(u, 1), 1, size(u, 1))
    turn = sum(x(:, 1)*u(:, 2) - x(:, 2)*u(:, 1))
    expected = x
    expected(:, 1) = stress/modulus*x(:, 1)
    expected(:, 2) = -nu*stress/modulus*x(:, 2)
    turn = (turn - sum(x(:, 1)*expected(:, 2) - x(:, 2)*expected(:, 1)))/sum(x**2)
    expected(:, 1) = expected(:, 1) - turn*x(:, 2)
    expected(:, 2) = expected(:, 2) + turn*x(:, 1)
    call expect_close(error, u, expected, 1.0e-6_wp*max_abs(expected), 'displacements')
  end subroutine test_pulled_mesh

  !> Each refusal of a mesh names its reason.
  subroutine test_refused_meshes(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text

    call put_mesh(6, 1, '0.3', text)
    call refuse(text//'&body lower = 0.2, 0 upper = 0.26, 0.06 points = 6, 6 /'//lf, &
      & 'a mesh beside other bodies')
    ! two squares that touch and share no node
    call write_file('consistent.msh', '$MeshFormat'//lf//'2.2 0 8'//lf//'$EndMeshFormat'//lf// &
      & '$Nodes'//lf//'8'//lf//'1 0 0 0'//lf//'2 1 0 0'//lf//'3 1 1 0'//lf//'4 0 1 0'//lf// &
      & '5 1 0 0'//lf//'6 2 0 0'//lf//'7 2 1 0'//lf//'8 1 1 0'//lf//'$EndNodes'//lf//'$Elements' &
      & //lf//'2'//lf//'1 3 2 0 0 1 2 3 4'//lf//'2 3 2 0 0 5 6 7 8'//lf//'$EndElements'//lf)
    call refuse(text, 'a mesh in pieces')

  contains

    subroutine refuse(scene, words)
      character(*), intent(in) :: scene, words

      if (allocated(error)) return
      call ready_of_text(scene, set_up, fault)
      if (.not. allocated(fault)) then
        call test_failed(error, 'not refused: '//words)
      else if (index(fault%message, words) == 0) then
        call test_failed(error, fault%message)
      end if
    end subroutine refuse

  end subroutine test_refused_meshes

  !> Lame's first constant of the dimension, from kappa; in 1D E takes the part of 2 mu.
  pure function lame_of(m, dim) result(lame)
    type(material_type), intent(in) :: m(:)
    integer, intent(in) :: dim
    real(wp) :: lame(size(m))
    lame = m%bulk_modulus - 2*m%shear_modulus/dim
    if (dim == 1) lame = 0.0_wp
  end function lame_of

  !> lambda - mu, which the dilatation alone gives.
  pure function twice_a_of(m, dim) result(twice_a)
    type(material_type), intent(in) :: m(:)
    integer, intent(in) :: dim
    real(wp) :: twice_a(size(m))
    twice_a = lame_of(m, dim)
    if (dim > 1) twice_a = twice_a - m%shear_modulus
  end function twice_a_of

  pure function shear_of(m, dim) result(mu)
    type(material_type), intent(in) :: m(:)
    integer, intent(in) :: dim
    real(wp) :: mu(size(m))
    mu = m%shear_modulus
    if (dim == 1) mu = m%youngs_modulus/2
  end function shear_of

  !> A scene of dimension `dim` at rest with bodies, and what else is in `groups`, by its text.
  function grid_scene(dim, groups) result(text)
    integer, intent(in) :: dim
    character(*), intent(in) :: groups
    character(:), allocatable :: text
    text = '&scene dimension = '//achar(iachar('0') + dim)//' thickness = 0.002 area = 3e-4 /'// &
      & lf//"&material name = 'steel' youngs_modulus = 2e11 density = 7800 poissons_ratio = 0.3 /" &
      & //lf// &
      & "&time method = 'relaxation' /"//lf// &
      & "&relaxation solver = 'conjugate_gradient' tolerance = 1e-12 /"//lf//groups//lf
  end function grid_scene

  !> Uniform strains where grids touch: refined in part, at an edge and inside; spacings of 1:2 with
  !> a horizon each, and with one; cells offset by half a cell, whose faces cover one another in
  !> part. The balanced areas have the moments of the body, and hardly differ from 1.5 and -0.5.
  !> Bodies that do not touch have none, and are as before.
  subroutine test_grids(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: plate = '&body lower = 0, 0 upper = 0.16, 0.12 points = 16, 12 /', &
      & weighted = "&horizon surface_correction = 'consistent' /", &
      & coarse = "&body name = 'a' lower = 0, 0 upper = 0.08, 0.12 points = 8, 12 /"//lf, &
      & fine = "&body name = 'b' lower = 0.08, 0 upper = 0.16, 0.12 points = 16, 24 /"//lf, &
      & offset = "&body name = 'b' lower = 0.08, 0.005 upper = 0.16, 0.115 points = 8, 11 /"//lf, &
      & apart = "&body name = 'b' lower = 0.09, 0 upper = 0.17, 0.12 points = 16, 24 /"//lf
    character(200) :: groups(8)
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: area(:, :), moment(:, :)
    integer :: i, c, d, dim

    groups = [character(200) :: &
      & '&body lower = 0 upper = 0.2 points = 20 /'//lf//"&refine where = 'x > 0.1' /"//weighted, &
      & plate//lf//"&refine where = 'x > 0.08' /"//weighted, &
      & plate//lf//"&refine shape = 'cylinder' centre = 0.07, 0 radius = 0.045 /"//weighted, &
      & plate//lf//"&refine shape = 'box' lower = 0.05, 0.03 upper = 0.1, 0.08 /"//weighted, &
      & coarse//fine//weighted, &
      & coarse//fine//"&horizon surface_correction = 'consistent' length = 0.03015 /", &
      & coarse//offset//weighted, &
      & '&body lower = 0, 0, 0 upper = 0.06, 0.04, 0.04 points = 6, 4, 4 /'//lf// &
      & "&refine where = 'x > 0.03' /"//weighted]
    do i = 1, size(groups)
      dim = merge(1, merge(3, 2, i == 8), i == 1)
      call ready_of_text(grid_scene(dim, trim(groups(i))), set_up, fault)
      if (allocated(fault)) then
        call test_failed(error, 'grids '//text_of(real(i, wp))//': '//fault%message)
        return
      end if
      call expect_true(error, allocated(set_up%system%body%sides), 'no sides')
      if (allocated(error)) return
      call strain_all(set_up%system, 'grids '//text_of(real(i, wp)), error)
      if (allocated(error)) return
      associate (body => set_up%system%body)
        area = total_areas(body%sides, body%n_slots, dim)
        moment = matmul(transpose(area), body%x)
        do c = 1, dim
          call expect(error, sum(area(:, c)), 0.0_wp, 1.0e-9_wp*sum(abs(area)), 'sum of areas')
          do d = 1, dim
            call expect(error, moment(c, d), merge(sum(body%volume), 0.0_wp, c == d), &
              & 1.0e-9_wp*sum(body%volume), 'areas and positions')
          end do
        end do
        ! in the middle of a coarse face
        if (i /= 2) cycle
        c = at_point(body, [0.005_wp, 0.055_wp])
        call expect_close(error, area(c, :), [-1.5_wp, 0.0_wp]*spacing*2.0e-3_wp, &
          & 0.4_wp*spacing*2.0e-3_wp, 'at a face')
      end associate
    end do
    call ready_of_text(grid_scene(2, coarse//apart// &
      & "&horizon surface_correction = 'consistent' length = 0.03015 /"), set_up, fault)
    call expect_true(error, .not. allocated(set_up%system%body%sides), 'bodies apart have sides')
  end subroutine test_grids

  !> A refined plate under pressures and forces on its sides, and with held layers.
  subroutine test_refined(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: plate = &
      & '&body lower = 0, 0 upper = 0.16, 0.12 points = 16, 12 /'//lf// &
      & "&refine where = 'x > 0.08' /"//lf//"&horizon surface_correction = 'consistent' /"//lf, &
      & strain = "displacement_x = '1e-11*x' displacement_y = '-0.3e-11*y' /"//lf
    type(set_up_type) :: set_up
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: i

    do i = 1, 3
      if (i == 1) call read_scene_text(grid_scene(2, plate// &
        & "&load side = 'x_min' pressure = -2 /"//lf//"&load side = 'x_max' pressure = -2 /"), &
        & 'grids', scene, fault)
      if (i == 2) call read_scene_text(grid_scene(2, plate// &
        & "&load side = 'x_min' force_x = -4.8e-4 /"//lf// &
        & "&load side = 'x_max' force_x = '4.8e-4' /"), 'grids', scene, fault)
      if (i == 3) call read_scene_text(grid_scene(2, plate//"&boundary side = 'x_min' "//strain// &
        & "&boundary side = 'x_max' "//strain), 'grids', scene, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      call uniform_at_rest(scene, [zeta, -0.3_wp*zeta], 'refined '//text_of(real(i, wp)), error)
      if (allocated(error)) return
    end do
    ! a side under a layer has no free face
    call ready_of_text(grid_scene(2, plate//"&boundary side = 'x_min' "//strain// &
      & "&load side = 'x_min' pressure = -2 /"), set_up, fault)
    call expect_true(error, allocated(fault), 'not refused: a load under a layer')
    if (allocated(error)) return
    call expect_true(error, index(fault%message, 'have no free face') > 0, fault%message)
    ! several materials between grids
    call ready_of_text(grid_scene(2, &
      & "&material name = 'soft' youngs_modulus = 1e11 density = 1 poissons_ratio = 0.3 /"//lf// &
      & "&body name = 'a' material = 'soft' lower = 0, 0 upper = 0.08, 0.12 points = 8, 12 /"// &
      & lf//"&body name = 'b' material = 'steel' lower = 0.08, 0 upper = 0.16, 0.12 "// &
      & 'points = 16, 24 /'//lf//"&horizon surface_correction = 'consistent' /"), set_up, fault)
    call expect_true(error, allocated(fault), 'not refused: several materials')
    if (allocated(error)) return
    call expect_true(error, index(fault%message, 'materials of different stiffness in clouds') &
      & > 0, fault%message)
  end subroutine test_refined

  !> Uniform strains of clouds: a bar, a strip at 30 degrees, a plate with a hole and a block, of
  !> points that are off their places by up to 0.3 of a spacing, with volumes of 0.8 to 1.2 cells;
  !> their areas have the moments of the body, and the sum of their outward parts is that of a
  !> side.
  subroutine test_outlines(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: dims(*) = [1, 2, 2, 3]
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: area(:, :), moment(:, :)
    integer :: i, c, d

    do i = 1, size(dims)
      call strain_cloud(i, dims(i), set_up, error)
      if (allocated(error)) return
      associate (body => set_up%system%body)
        area = body%surface_area
        moment = matmul(transpose(area), body%x)
        do c = 1, body%dim
          call expect(error, sum(area(:, c)), 0.0_wp, 1.0e-9_wp*sum(abs(area)), 'sum of areas')
          do d = 1, body%dim
            call expect(error, moment(c, d), merge(sum(body%volume), 0.0_wp, c == d), &
              & 1.0e-9_wp*sum(body%volume), 'areas and positions')
          end do
        end do
        ! the right side of the plate with a hole and half of the hole
        if (i /= 3) cycle
        call expect(error, sum(area(:, 1), mask=body%x(:, 1) > 0.15_wp), 0.14_wp*2.0e-3_wp, &
          & 0.05_wp*0.14_wp*2.0e-3_wp, 'the right side')
      end associate
    end do
    call put_cloud(2)
    call ready_of_text(grid_scene(2, "&body name = 'a' file = 'consistent.txt' /"//lf// &
      & "&body name = 'b' lower = 1, 0 upper = 1.1, 0.1 points = 10, 10 /"//lf// &
      & "&horizon surface_correction = 'consistent' /"), set_up, fault)
    call expect_true(error, allocated(fault), 'not refused: a cloud beside a lattice')
    if (allocated(error)) return
    call expect_true(error, index(fault%message, 'a cloud beside other bodies') > 0, fault%message)
    call write_file('consistent.txt', '0 0 0 1'//lf//'1 0 0 1'//lf//'0 1 0 9'//lf)
    call ready_of_text(grid_scene(2, "&body file = 'consistent.txt' /"//lf// &
      & "&horizon surface_correction = 'consistent' /"), set_up, fault)
    call expect_true(error, allocated(fault), 'not refused: uneven spacings')
    if (allocated(error)) return
    call expect_true(error, index(fault%message, 'a cloud whose spacings differ') > 0, &
      & fault%message)
  end subroutine test_outlines

  !> Set up a cloud of `put_cloud` and hold it to all uniform strains.
  subroutine strain_cloud(number, dim, set_up, error)
    integer, intent(in) :: number, dim
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault
    character(:), allocatable :: name

    name = 'cloud '//text_of(real(number, wp))
    call put_cloud(number)
    call ready_of_text(grid_scene(dim, "&body file = 'consistent.txt' /"//lf// &
      & "&horizon surface_correction = 'consistent' /"), set_up, fault)
    if (allocated(fault)) then
      call test_failed(error, name//': '//fault%message)
      return
    end if
    call strain_all(set_up%system, name, error)
  end subroutine strain_cloud

  !> The centres of tetrahedra four cells across, with their volumes and with volumes that are 0.8
  !> to 1.2 times as large: with surface areas that are not changed no weights Gb are all positive,
  !> and the body has negative eigenvalues.
  subroutine test_tetrahedra(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    real(wp) :: lowest
    integer :: i

    do i = 5, 7, 2
      call strain_cloud(i, 3, set_up, error)
      if (allocated(error)) return
      associate (Gb => set_up%system%model%weights%Gb)
        call expect_true(error, all(Gb > 0.049_wp), 'a weight Gb of '//text_of(minval(Gb)))
      end associate
      if (allocated(error)) return
      call lowest_eigenvalue(set_up%system, lowest)
      call expect_true(error, lowest >= 0.0_wp, 'an eigenvalue of '//text_of(lowest))
      if (allocated(error)) return
    end do
  end subroutine test_tetrahedra

  !> 60 x 60 points off their places by up to 0.3 of a spacing, with volumes of 0.8 to 1.2 cells:
  !> with surface areas that are not changed for the weights Gd these grow with the body's width, to
  !> 50 here, and it has negative eigenvalues.
  subroutine test_large_cloud(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    real(wp) :: lowest

    call put_cloud(6)
    call ready_of_text(grid_scene(2, "&body file = 'consistent.txt' /"//lf// &
      & "&horizon surface_correction = 'consistent' /"), set_up, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    call strain_all(set_up%system, 'a large cloud', error)
    if (allocated(error)) return
    associate (weights => set_up%system%model%weights)
      call expect_true(error, all(abs(weights%Gd) < 25.0_wp), 'weights Gd of '// &
        & text_of(minval(weights%Gd))//' to '//text_of(maxval(weights%Gd)))
      call expect_true(error, all(weights%Gb > 0.049_wp), 'a weight Gb of '// &
        & text_of(minval(weights%Gb)))
    end associate
    if (allocated(error)) return
    call lowest_eigenvalue(set_up%system, lowest)
    call expect_true(error, lowest >= 0.0_wp, 'an eigenvalue of '//text_of(lowest))
  end subroutine test_large_cloud

  !> Write cloud `number` as build/consistent.txt.
  subroutine put_cloud(number)
    integer, intent(in) :: number
    real(wp), parameter :: turn(2, 2) = reshape([0.866025403784438647_wp, 0.5_wp, -0.5_wp, &
      & 0.866025403784438647_wp], [2, 2])
    integer, parameter :: cells(3, 7) = reshape([20, 1, 1, 18, 12, 1, 20, 14, 1, 8, 6, 6, &
      & 4, 4, 4, 60, 60, 1, 4, 4, 4], [3, 7]), order(3, 6) = reshape([1, 2, 3, 1, 3, 2, 2, 1, 3, &
      & 2, 3, 1, 3, 1, 2, 3, 2, 1], [3, 6]), dims(7) = [1, 2, 2, 3, 3, 2, 3]
    logical, parameter :: tetrahedra(7) = [.false., .false., .false., .false., .true., .false., &
      & .true.]
    character(:), allocatable :: text
    character(100) :: line
    real(wp) :: x(3), corner(3), depth
    integer :: i, j, k, c, t, seed

    text = ''
    seed = 7
    depth = 1.0_wp
    if (dims(number) == 2) depth = 2.0e-3_wp
    if (dims(number) == 1) depth = 3.0e-4_wp
    do k = 1, cells(3, number)
      do j = 1, cells(2, number)
        do i = 1, cells(1, number)
          do t = 1, merge(6, 1, tetrahedra(number))
            x = [i, j, k] - 0.5_wp
            if (tetrahedra(number)) then
              ! the centre of a tetrahedron between two corners of the cell
              x = [i, j, k] - 1.0_wp
              corner = x
              do c = 1, 3
                corner(order(c, t)) = corner(order(c, t)) + 1
                x = x + (corner - [i, j, k] + 1)/4
              end do
            else
              do c = 1, dims(number)
                x(c) = x(c) + merge(0.2_wp, 0.3_wp, number == 4)*noise(seed)
              end do
            end if
            if (number == 3 .and. norm2(x(:2) - [10, 7]) < 3.5_wp) cycle
            x(dims(number) + 1:) = 0.0_wp
            x = spacing*x
            if (number == 2) x(:2) = matmul(turn, x(:2))
            write (line, '(4(es24.16, 1x))') x, depth*spacing**dims(number) &
              & *merge(1/6.0_wp, 1.0_wp, tetrahedra(number)) &
              & *(1 + merge(0.0_wp, 0.2_wp, number == 5)*noise(seed))
            text = text//trim(line)//lf
          end do
        end do
      end do
    end do
    call write_file('consistent.txt', text)
  end subroutine put_cloud

  !> A strip at 30 degrees to the axes, as a cloud, with the areas of the straight strip turned with
  !> it.
  subroutine test_clouds(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: nx = 16, ny = 12
    real(wp), parameter :: height = 2.0e-3_wp
    type(body_type) :: body
    type(list_family_type) :: family
    type(model_type) :: model
    type(material_type) :: material
    type(solution_type) :: b, d
    type(long_work_type) :: work
    type(fault_type), allocatable :: fault
    type(volume_rule_type) :: rule
    real(wp) :: R(3, 3), x(nx*ny, 2), area(nx*ny, 2), strain(2, 2)
    real(wp), allocatable :: a(:, :), u(:, :), force(:, :), expected(:, :), theta(:)
    integer :: i, j, k

    R = rotation_matrix([0.0_wp, 0.0_wp, 1.0_wp], acos(-1.0_wp)/6)
    rule = volume_rule_type(volume_linear, 3.015_wp*spacing)
    material = new_material(youngs_modulus, 0.25_wp, 1.0_wp, 2, .false., height, 1.0_wp, &
      & rule%delta, .false.)
    area = 0.0_wp
    do j = 1, ny
      do i = 1, nx
        k = i + nx*(j - 1)
        x(k, :) = [i - 0.5_wp, j - 0.5_wp]*spacing
        area(k, 1) = side(i, nx)*spacing*height
        area(k, 2) = side(j, ny)*spacing*height
      end do
    end do
    call allocate_points(body, 2, nx*ny)
    body%x = matmul(x, transpose(R(:2, :2)))
    body%volume = spacing**2*height
    body%spacing = spacing
    body%material = 1
    body%body = 1
    call new_list_family(body, rule, family)
    call new_model(body, [material], .false., spread(.false., 1, body%n_slots), &
      & spread(0.0_wp, 1, body%n_slots), model)
    allocate (a(body%n_slots, 2), u(body%n_slots, 2), source=0.0_wp)
    allocate (force, expected, mold=u)
    allocate (theta(body%n_slots))
    a(body%slot, :) = matmul(area, transpose(R(:2, :2)))
    call weights_of_areas(body, family, [material], material%shear_modulus*a, &
      & sign(1.0_wp, material%a)*a, .false., [0.05_wp], model%weights, b, d, fault, work)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    model%consistent = .true.
    strain = zeta*reshape([1.0_wp, 0.4_wp, 0.4_wp, -0.3_wp], [2, 2])
    do k = 1, body%n_slots
      u(k, :) = 0.0_wp
      if (body%point(k) > 0) u(k, :) = matmul(strain, body%x(k, :))
    end do
    expected = 0.0_wp
    associate (mu => material%shear_modulus, lame => lame_of([material], 2))
      do k = 1, body%n_slots
        if (body%point(k) > 0) expected(k, :) = -(lame(1)*0.7_wp*zeta*a(k, :) &
          & + 2*mu*matmul(strain, a(k, :)))/body%volume(k)
      end do
    end associate
    call reference_force(family, model, u, force)
    call expect_close(error, force, expected, 1.0e-9_wp*max_abs(expected), 'forces')
    call reference_dilatation(family, model, u, theta)
    call expect_close(error, theta(body%slot), 0.7_wp*zeta, 1.0e-9_wp*zeta, 'dilatations')
    if (allocated(error)) return

  contains

    !> Area of a point in a row over a face's.
    pure real(wp) function side(i, n)
      integer, intent(in) :: i, n
      side = 0.0_wp
      if (i == 1) side = -1.5_wp
      if (i == 2) side = 0.5_wp
      if (i == n) side = 1.5_wp
      if (i == n - 1) side = -0.5_wp
    end function side

  end subroutine test_clouds

  !> Bodies of two materials that touch: box by box along x, the first two, or in the plane a frame
  !> of four around the last. Every second body, or the last, is of the other material.
  subroutine two_materials(name, ratio, poissons_ratios, scene)
    character(*), intent(in) :: name                !! 'bar', 'plate', 'block', 'inclusion', 'board'
    real(wp), intent(in) :: ratio                   !! of the other Young's modulus
    real(wp), intent(in) :: poissons_ratios(2)
    type(scene_type), intent(out) :: scene
    integer, parameter :: frame(4, 5) = reshape([0, 0, 7, 20, 7, 0, 13, 7, 7, 13, 13, 20, &
      & 13, 0, 20, 20, 7, 7, 13, 13], [4, 5])
    integer :: i, n

    select case (name)
    case ('bar')
      call box_scene([9], spacing, poissons_ratios(1), scene)
      n = 2
    case ('block')
      call box_scene([5, 6, 6], spacing, poissons_ratios(1), scene)
      n = 2
    case ('plate')
      call box_scene([10, 11], spacing, poissons_ratios(1), scene)
      n = 2
    case ('inclusion')
      call box_scene([20, 20], spacing, poissons_ratios(1), scene)
      n = 5
    case default
      call box_scene([3, 3], spacing, poissons_ratios(1), scene)
      n = 16
    end select
    associate (one => scene%bodies(1))
      scene%bodies = [(one, i=1, n)]
    end associate
    scene%materials = [scene%materials(1), scene%materials(1)]
    scene%materials(2)%name = 'other'
    scene%materials(2)%youngs_modulus = ratio*youngs_modulus
    scene%materials(2)%poissons_ratio = poissons_ratios(2)
    do i = 1, n
      associate (body => scene%bodies(i), width => scene%bodies(1)%points(1)*spacing)
        body%name = 'body '//text_of(real(i, wp))
        body%material = trim(merge('steel', 'other', modulo(i, 2) == 1))
        if (name == 'inclusion') then
          body%material = trim(merge('steel', 'other', i < n))
          body%points(:2) = frame(3:, i) - frame(:2, i)
          body%lower(:2) = frame(:2, i)*spacing
          body%upper(:2) = frame(3:, i)*spacing
        else if (name == 'board') then
          body%material = trim(merge('steel', 'other', modulo(i + (i - 1)/4, 2) == 1))
          body%lower(:2) = [modulo(i - 1, 4), (i - 1)/4]*width
          body%upper(:2) = body%lower(:2) + width
        else
          body%lower(1) = (i - 1)*width
          body%upper(1) = i*width
        end if
      end associate
    end do
    scene%horizon%surface_correction = 'consistent'
  end subroutine two_materials

  !> Uniform strains of bodies of two materials, of like and unlike Poisson's ratios: classical
  !> jumps of tractions at interfaces. `ready` says that the bodies are stable.
  subroutine test_two_materials(error)
    type(error_type), allocatable, intent(out) :: error
    character(9), parameter :: names(*) = [character(9) :: 'bar', 'bar', 'plate', 'plate', &
      & 'plate', 'inclusion', 'inclusion', 'board', 'block']
    real(wp), parameter :: ratios(*) = [0.25_wp, 100.0_wp, 0.25_wp, 0.25_wp, 0.01_wp, 0.25_wp, &
      & 4.0_wp, 0.25_wp, 0.25_wp], poissons_ratios(2, 9) = reshape([0.3_wp, 0.3_wp, 0.3_wp, &
      & 0.3_wp, 0.4_wp, 0.4_wp, 0.4_wp, 0.1_wp, 0.2_wp, 0.45_wp, 0.3_wp, 0.4_wp, 0.25_wp, &
      & 0.25_wp, 0.3_wp, 0.4_wp, 0.4_wp, 0.1_wp], [2, 9])
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    integer :: i

    do i = 1, size(names)
      call two_materials(trim(names(i)), ratios(i), poissons_ratios(:, i), scene)
      if (i == 4) scene%horizon%family = 'list'
      call ready(scene, set_up, error)
      if (allocated(error)) return
      call strain_all(set_up%system, trim(names(i))//' of '//text_of(ratios(i)), error)
      if (allocated(error)) return
    end do
  end subroutine test_two_materials

  !> Two materials of one Poisson's ratio beside each other in x, strained alike so that the
  !> traction on their interface is continuous, (lambda + 2 mu) exx + lambda eyy the same in both:
  !> no point needs a force but those of the two outer rows, on which the surface acts.
  subroutine test_continuous(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: ratios(*) = [0.1_wp, 0.35_wp], poissons_ratios(*) = [0.2_wp, 0.3_wp]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: u(:, :), force(:, :), p(:)
    integer(i1), allocatable :: strained(:)
    logical, allocatable :: inside(:)
    real(wp) :: strain(2), lambda(2), mu(2)
    integer :: i, c

    do i = 1, size(ratios)
      call two_materials('plate', ratios(i), spread(poissons_ratios(i), 1, 2), scene)
      call ready(scene, set_up, error)
      if (allocated(error)) return
      associate (system => set_up%system, body => set_up%system%body)
        lambda = lame_of(system%model%materials, 2)
        mu = shear_of(system%model%materials, 2)
        strain = zeta*[-(lambda(2) - lambda(1))/(lambda(2) - lambda(1) + 2*(mu(2) - mu(1))), 1.0_wp]
        if (allocated(u)) deallocate (u, force, p, strained)
        allocate (u(body%n_slots, 2), force(body%n_slots, 2), source=0.0_wp)
        allocate (p(merge(body%n_slots, 0, system%model%dilatation)), source=0.0_wp)
        allocate (strained(0))
        inside = body%point > 0
        do c = 1, 2
          where (body%point > 0) u(:, c) = strain(c)*body%x(:, c)
          inside = inside .and. body%x(:, c) > 2*spacing .and. &
            & body%x(:, c) < maxval(body%x(:, c), mask=body%point > 0) - 1.5_wp*spacing
        end do
        call internal_force(body, system%family, system%model, options_of(system%model), &
          & system%workspace, u, p, force, strained)
        call expect_true(error, count(inside) == 16*7, 'points inside')
        call expect_close(error, pack(force, spread(inside, 2, 2)), 0.0_wp, &
          & 1.0e-9_wp*max_abs(force), 'inside')
      end associate
      if (allocated(error)) return
    end do
  end subroutine test_continuous

  !> Bars of two materials in series, pulled at the ends: in each the classical strain away from
  !> the interface, which is as soft as less than a row of the softer one.
  subroutine test_series(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: points(*) = [30, 60]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: miss(size(points)), strain(2)
    integer :: i

    do i = 1, size(points)
      call two_materials('bar', 0.25_wp, [0.3_wp, 0.3_wp], scene)
      scene%bodies%points(1) = points(i)
      scene%bodies(1)%upper(1) = points(i)*spacing
      scene%bodies(2)%lower(1) = points(i)*spacing
      scene%bodies(2)%upper(1) = 2*points(i)*spacing
      call load_ends(scene)
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      call move(set_up%system, set_up%plan, diary, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      associate (u => set_up%system%state%u(set_up%system%body%slot, 1), n => points(i))
        ! four points at either end see no interface
        strain = [u(4) - u(1), u(2*n) - u(2*n - 3)]/(3*spacing)
        call expect_close(error, strain, zeta*[1.0_wp, 4.0_wp], 1.0e-9_wp*zeta, 'strains')
        ! rows of the softer body that the interface is as soft as
        miss(i) = (u(2*n) - u(1) - zeta*spacing*5*(n - 0.5_wp))/(4*zeta*spacing)
      end associate
    end do
    call expect_true(error, all(abs(miss) < 1.0_wp), 'the interface is as soft as '// &
      & text_of(miss(1))//' rows')
    call expect(error, miss(2), miss(1), 1.0e-6_wp, 'an interface of more points')
  end subroutine test_series

  !> Pull at both ends, without support.
  subroutine load_ends(scene)
    type(scene_type), intent(inout) :: scene

    if (allocated(scene%loads)) deallocate (scene%loads)
    allocate (scene%loads(2))
    scene%loads(1)%side = 'x_min'
    scene%loads(2)%side = 'x_max'
    scene%loads%pressure = -tension
    if (size(scene%bodies) > 1) then
      scene%loads(1)%body = scene%bodies(1)%name
      scene%loads(2)%body = scene%bodies(2)%name
    end if
    call at_rest(scene)
  end subroutine load_ends

  subroutine at_rest(scene)
    type(scene_type), intent(inout) :: scene
    scene%time%method = 'relaxation'
    scene%relaxation%solver = 'conjugate_gradient'
    scene%relaxation%tolerance = 1.0e-12_wp
  end subroutine at_rest

  !> Pressure on two sides, and a force in its place: every point has the classical displacement,
  !> but for what the tolerance of 1e-12 leaves.
  subroutine test_loads(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    integer :: i

    do i = 1, 4
      call scene_of(trim(merge('block', 'plate', i == 3)), merge(0.4_wp, 0.25_wp, i == 2), scene)
      if (i == 4) scene%horizon%family = 'list'
      call load_ends(scene)
      if (i == 2) then
        ! the same as a force over the side
        deallocate (scene%loads)
        allocate (scene%loads(2))
        scene%loads(1)%side = 'x_min'
        scene%loads(2)%side = 'x_max'
        scene%loads(1)%force(1) = -tension*16*spacing*scene%header%thickness
        scene%loads(2)%force(1) = tension*16*spacing*scene%header%thickness
      end if
      call uniform_at_rest(scene, [zeta, -scene%materials(1)%poissons_ratio*zeta, &
        & -scene%materials(1)%poissons_ratio*zeta], 'load '//text_of(real(i, wp)), error)
      if (allocated(error)) return
    end do
  end subroutine test_loads

  !> Layers at two sides follow a uniform strain; between them the sides are free.
  subroutine test_layers(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    character(*), parameter :: along = '1e-11*x', across = '-0.3e-11*y'
    integer :: i

    do i = 1, 2
      call scene_of('plate', 0.3_wp, scene)
      deallocate (scene%boundaries)
      allocate (scene%boundaries(2))
      scene%boundaries(1)%side = 'x_min'
      scene%boundaries(2)%side = 'x_max'
      scene%boundaries%displacement_text(1) = along
      scene%boundaries%displacement_text(2) = across
      if (i == 2) scene%horizon%family = 'list'
      call at_rest(scene)
      call uniform_at_rest(scene, [zeta, -0.3_wp*zeta], 'layers', error)
      if (allocated(error)) return
    end do
  end subroutine test_layers

  !> Solve a scene and compare differences of displacements with those of a strain along the axes.
  subroutine uniform_at_rest(scene, strain, what, error)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: strain(:)
    character(*), intent(in) :: what
    type(error_type), allocatable, intent(inout) :: error
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: found(:), expected(:)
    integer :: c

    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    call move(set_up%system, set_up%plan, diary, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    associate (body => set_up%system%body, u => set_up%system%state%u)
      do c = 1, body%dim
        found = u(body%slot, c)
        found = found - sum(found)/size(found)
        expected = strain(c)*body%x(body%slot, c)
        expected = expected - sum(expected)/size(expected)
        call expect_close(error, found, expected, 1.0e-9_wp*max_abs(expected), what)
      end do
    end associate
  end subroutine uniform_at_rest

  !> A strip under end moments by a pressure that is linear across: its curvature, from the rotation
  !> of sections a depth from the ends, beside M/EI of plane stress. Halving the spacing quarters
  !> the error.
  subroutine test_bending(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: across(*) = [5, 10, 20]
    real(wp), parameter :: depth = 0.1_wp
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: h, miss(size(across)), slope(2)
    integer :: i, s

    do i = 1, size(across)
      h = depth/across(i)
      call box_scene([4*across(i), across(i)], h, 0.3_wp, scene)
      scene%horizon%surface_correction = 'consistent'
      deallocate (scene%loads)
      allocate (scene%loads(2))
      scene%loads(1)%side = 'x_min'
      scene%loads(2)%side = 'x_max'
      ! E kappa (y - 0.05) with kappa = 1e-10/m
      scene%loads%pressure_text = '20*(y - 0.05)'
      call at_rest(scene)
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      call move(set_up%system, set_up%plan, diary, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      associate (body => set_up%system%body, u => set_up%system%state%u)
        do s = 1, 2
          associate (x => merge(depth, 3*depth, s == 1))
            slope(s) = rotation(body, u(:, 1), x + h/2) + rotation(body, u(:, 1), x - h/2)
          end associate
        end do
      end associate
      miss(i) = abs((slope(2) - slope(1))/2/(2*depth)/(-1.0e-10_wp) - 1)
    end do
    call expect_true(error, all(miss < [0.2_wp, 0.05_wp, 0.0125_wp]), 'curvature off by '// &
      & text_of(miss(1))//', '//text_of(miss(2))//', '//text_of(miss(3)))
    call expect_true(error, miss(1) > 3*miss(2) .and. miss(2) > 3*miss(3), &
      & 'not of second order: '//text_of(miss(1))//', '//text_of(miss(2))//', '// &
      & text_of(miss(3)))
  end subroutine test_bending

  !> du_x/dy of the column of points at `x`, by least squares.
  real(wp) function rotation(body, u, x) result(slope)
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: u(:), x
    real(wp), allocatable :: y(:), v(:)
    logical :: there(body%n_slots)

    there = body%point > 0 .and. abs(body%x(:, 1) - x) < 1.0e-6_wp
    y = pack(body%x(:, 2), there)
    v = pack(u, there)
    y = y - sum(y)/size(y)
    slope = sum(y*v)/sum(y**2)
  end function rotation

  !> Random displacements of finite size, both families: no resultant force or moment, and the force
  !> is minus the gradient of the energy, by central differences of 1e-6 spacings (their error is
  !> the square of that, over the strain).
  subroutine test_conservation(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    integer :: family, i

    do i = 1, 2
      do family = 1, 2
        call scene_of(trim(merge('hole ', 'block', i == 1)), 0.4_wp, scene)
        scene%horizon%family = trim(merge('list   ', 'lattice', family == 2))
        call ready(scene, set_up, error)
        if (allocated(error)) return
        call one(set_up%system)
        if (allocated(error)) return
      end do
    end do

  contains

    subroutine one(system)
      type(system_type), intent(inout) :: system
      real(wp), allocatable :: u(:, :), way(:, :), force(:, :), reference(:, :), p(:), energy(:)
      integer(i1) :: strained(0)
      real(wp) :: total(2), slope, size_of_forces
      integer :: k, c, seed, s

      associate (body => system%body, model => system%model)
        allocate (u(body%n_slots, body%dim), source=0.0_wp)
        allocate (way, source=u)
        allocate (force, reference, mold=u)
        allocate (p(body%n_slots), energy(body%n_slots), source=0.0_wp)
        seed = 3
        do k = 1, body%n_slots
          if (body%point(k) == 0) cycle
          do c = 1, body%dim
            u(k, c) = 0.003_wp*spacing*noise(seed)
            way(k, c) = spacing*noise(seed)
          end do
        end do
        call internal_force(body, system%family, model, options_of(model), system%workspace, u, &
          & p, force, strained)
        call reference_force(system%family, model, u, reference)
        call expect_close(error, force, reference, 1.0e-11_wp*max_abs(reference), &
          & 'loops beside the reference')
        size_of_forces = sum(abs(force(:, 1))*body%volume)
        do c = 1, body%dim
          call expect(error, sum(force(:, c)*body%volume), 0.0_wp, 1.0e-12_wp*size_of_forces, &
            & 'resultant force')
        end do
        call expect(error, sum(body%volume*((body%x(:, 1) + u(:, 1))*force(:, 2) &
          & - (body%x(:, 2) + u(:, 2))*force(:, 1))), 0.0_wp, &
          & 1.0e-12_wp*size_of_forces*maxval(body%x), 'resultant moment')
        do s = 1, 2
          call energy_pass(system%family, model, system%workspace, &
            & u + (2*s - 3)*1.0e-6_wp*way, energy)
          total(s) = sum(energy*body%volume)
        end do
        slope = (total(2) - total(1))/2.0e-6_wp
        call expect(error, slope, -sum([(sum(force(:, c)*way(:, c)*body%volume), c=1, body%dim)]), &
          & 1.0e-6_wp*abs(slope) + 1.0e-9_wp*size_of_forces*spacing, 'gradient of the energy')
      end associate
    end subroutine one

  end subroutine test_conservation

  !> A plate that swings freely: kinetic and strain energy together change by the square of the
  !> step, and stay. The stable step is at most 1.3 times smaller than with the correction by
  !> energy.
  subroutine test_explicit(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene, other
    type(set_up_type) :: set_up, by_energy
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: total(:)
    integer :: k

    call scene_of('plate', 0.4_wp, scene)
    scene%time%steps = 400
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    other = scene
    other%horizon%surface_correction = 'energy'
    call ready_alone(other, by_energy, error)
    if (allocated(error)) return
    call expect_true(error, set_up%plan%limit > by_energy%plan%limit/1.3_wp, 'step '// &
      & text_of(set_up%plan%limit)//', by energy '//text_of(by_energy%plan%limit))
    associate (body => set_up%system%body, v => set_up%system%state%v)
      do k = 1, body%n_slots
        if (body%point(k) > 0) v(k, 1) = 1.0e-3_wp*sin(20*body%x(k, 1) + 10*body%x(k, 2))
      end do
    end associate
    call move(set_up%system, set_up%plan, diary, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    total = diary%kinetic + diary%strain
    call expect_true(error, maxval(diary%strain) > 0.1_wp*total(1), 'nothing swings')
    call expect_close(error, total, total(1), 0.02_wp*total(1), 'energy')
  end subroutine test_explicit

  !> Plates, whole, with a hole and round, and blocks, that random velocities break in many places:
  !> what has been dissipated never falls, the strain energy is never below 0, and the sum with that
  !> of motion is that of the start, to the (omega dt/2)^2 = 0.01 by which that of the fastest mode
  !> swings at a tenth of the stable step. Velocities are such that no points pass through others.
  !> A theta^2 may grow when a bond breaks that is stretched while its point is compressed: in the
  !> last block, of nu = 0.4, and with the correction by energy, too. There 3e-3 of the energy may
  !> be given back in one step.
  subroutine test_fracture(error)
    type(error_type), allocatable, intent(out) :: error
    character(5), parameter :: names(*) = [character(5) :: 'plate', 'hole', 'disc', 'plate', &
      & 'hole', 'plate', 'block', 'block']
    real(wp), parameter :: ratios(*) = [1.0_wp/3.0_wp, 1.0_wp/3.0_wp, 1.0_wp/3.0_wp, 0.4_wp, &
      & 0.4_wp, 0.25_wp, 0.25_wp, 0.4_wp]
    real(wp), parameter :: speeds(*) = [60, 60, 60, 40, 40, 40, 60, 40]  ! largest one [m/s]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: total(:)
    real(wp) :: fall
    integer :: i, k, c, n, seed

    seed = 3
    do i = 1, size(names)
      if (names(i) == 'disc') then
        call box_scene([16, 16], spacing, ratios(i), scene)
        scene%horizon%surface_correction = 'consistent'
        deallocate (scene%kept)
        allocate (scene%kept(1))
        scene%kept(1)%shape = 'sphere'
        scene%kept(1)%centre(:2) = 8*spacing
        scene%kept(1)%radius = 8*spacing
      else
        call scene_of(trim(names(i)), ratios(i), scene)
      end if
      scene%time%steps = 1500
      scene%time%safety = 0.1_wp
      scene%materials(1)%critical_stretch = 0.01_wp
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      associate (body => set_up%system%body, v => set_up%system%state%v)
        do k = 1, body%n_slots
          if (body%point(k) == 0) cycle
          do c = 1, body%dim
            v(k, c) = speeds(i)*noise(seed)
          end do
        end do
      end associate
      diary = diary_type()
      call move(set_up%system, set_up%plan, diary, fault)
      if (allocated(fault)) then
        call test_failed(error, trim(names(i))//': '//fault%message)
        return
      end if
      n = size(diary%dissipated)
      total = diary%kinetic + diary%strain + diary%dissipated
      fall = merge(3.0e-3_wp, 0.0_wp, i == size(names))*total(1)
      call expect_true(error, all(diary%dissipated(2:) >= diary%dissipated(:n - 1) - fall), &
        & 'dissipation falls: '//names(i))
      call expect_true(error, all(diary%strain >= 0.0_wp), 'negative strain energy: '//names(i))
      call expect_true(error, diary%dissipated(n) > 0.05_wp*total(1), 'little breaks: '//names(i))
      call expect_close(error, total, total(1), 0.01_wp*total(1), 'energy: '//names(i))
      call expect_followers(set_up, names(i), error)
      if (allocated(error)) return
    end do
  end subroutine test_fracture

  !> Bonds with a negative Gb are broken where, and only where, one of their ends has lost another.
  subroutine expect_followers(set_up, name, error)
    type(set_up_type), intent(in) :: set_up
    character(*), intent(in) :: name
    type(error_type), allocatable, intent(inout) :: error
    type(bonds_type) :: bonds
    logical, allocatable :: lost(:), positive(:)
    integer :: k, i, pass, followers
    integer(i8) :: at

    if (allocated(error)) return
    followers = 0
    associate (family => set_up%system%family, model => set_up%system%model, &
      & point => set_up%system%body%point)
      allocate (lost(family%n_slots), source=.false.)
      call allocate_bonds(family, bonds)
      do pass = 1, 2
        do k = 1, family%n_slots
          if (point(k) == 0) cycle
          call family%bonds_of(k, bonds)
          at = model%weights%before(k)
          positive = model%weights%Gb(at + 1:at + bonds%n) >= 0.0_wp
          if (pass == 1) then
            lost(k) = any(positive .and. .not. bonds%intact(:bonds%n))
            cycle
          end if
          do i = 1, bonds%n
            if (positive(i)) cycle
            followers = followers + merge(0, 1, bonds%intact(i))
            call expect_true(error, bonds%intact(i) .neqv. (lost(k) .or. lost(bonds%j(i))), &
              & 'a bond with a negative weight does not follow: '//name)
          end do
        end do
      end do
      if (model%followers) call expect_true(error, followers > 0, &
        & 'no bond with a negative weight has followed: '//name)
    end associate
  end subroutine expect_followers

  !> Bonds with a negative Gb go with others, when these break and when a crack cuts them: here one
  !> bond in nine has one. A material whose dilatation has a negative energy is refused where bonds
  !> could not balance it.
  subroutine test_negative(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    integer(i8) :: cut, followed
    integer :: k, c, seed

    seed = 5
    call scene_of('plate', 1.0_wp/3.0_wp, scene)
    scene%materials(1)%critical_stretch = 0.01_wp
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call make_negative(set_up%system)
    associate (body => set_up%system%body, u => set_up%system%state%u)
      do k = 1, body%n_slots
        do c = 1, body%dim
          u(k, c) = 0.008_wp*spacing*noise(seed)
        end do
      end do
    end associate
    call evaluate(set_up%system, 0.0_wp, breaking=.true.)
    call expect_followers(set_up, 'breaking', error)
    if (allocated(error)) return

    call ready(scene, set_up, error)
    if (allocated(error)) return
    call make_negative(set_up%system)
    deallocate (scene%cracks)
    allocate (scene%cracks(1))
    scene%cracks(1)%from(:2) = [10.0_wp, 0.0_wp]*spacing
    scene%cracks(1)%to(:2) = [10.0_wp, 6.0_wp]*spacing
    associate (system => set_up%system)
      call cut_bonds(scene%cracks, system%body, system%family, cut)
      call cut_followers(system%body, system%family, system%model, followed)
    end associate
    call expect_followers(set_up, 'crack', error)
    call expect_true(error, followed > 0, 'a crack cuts no bond with a negative weight')

    call scene_of('block', 0.24_wp, scene)
    scene%materials(1)%critical_stretch = 0.01_wp
    call refused(scene, 'does not serve fracture', error)
    call scene_of('plate', 0.2_wp, scene)
    scene%materials(1)%critical_stretch = 0.01_wp
    call refused(scene, 'does not serve fracture', error)
  end subroutine test_negative

  !> Give one bond in nine, between points whose numbers add up to multiples of 9, a negative Gb.
  subroutine make_negative(system)
    type(system_type), intent(inout) :: system
    type(bonds_type) :: bonds
    integer(i8) :: n
    integer :: k, i

    system%model%followers = .true.
    associate (weights => system%model%weights, point => system%body%point)
      n = 0
      call allocate_bonds(system%family, bonds)
      deallocate (weights%start, weights%Gb, weights%Gd)
      allocate (weights%start(system%family%n_slots))
      allocate (weights%Gb(system%family%n_bonds), source=1.0_wp)
      do k = 1, system%family%n_slots
        weights%row(k) = k
        weights%start(k) = n
        if (point(k) == 0) cycle
        call system%family%bonds_of(k, bonds)
        do i = 1, bonds%n
          if (modulo(point(k) + point(bonds%j(i)), 9) == 0) weights%Gb(n + i) = -0.2_wp
        end do
        n = n + bonds%n
      end do
      weights%Gd = weights%Gb
    end associate
  end subroutine make_negative

  !> Each refusal names its reason.
  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call scene_of('plate', 0.3_wp, scene)
    scene%header%precision = 'mixed'
    call refused(scene, 'mixed', error)
    call scene_of('plate', 0.3_wp, scene)
    scene%materials(1)%influence = 'constant'
    call refused(scene, 'bond law', error)
    call scene_of('plate', 0.3_wp, scene)
    deallocate (scene%loads)
    allocate (scene%loads(1))
    scene%loads(1)%side = 'x_min'
    scene%loads(1)%stiffness(1) = 1.0_wp
    call refused(scene, 'springs at a side', error)
    call scene_of('plate', 0.3_wp, scene)
    deallocate (scene%boundaries)
    allocate (scene%boundaries(1))
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%absorbing = .true.
    call refused(scene, 'absorbing', error)
    call two_materials('board', 0.01_wp, [0.3_wp, 0.4_wp], scene)
    call refused(scene, 'use materials that differ less', error)
    call box_scene([10, 1], spacing, 0.3_wp, scene)
    scene%horizon%surface_correction = 'consistent'
    call refused(scene, 'lower the dimension', error)
    ! of one material, unstable by weights below 0: two rows of points with loads on their sides
    call box_scene([6, 2], spacing, 0.3_wp, scene)
    scene%horizon%surface_correction = 'consistent'
    deallocate (scene%loads)
    allocate (scene%loads(2))
    scene%loads(1)%side = 'y_min'
    scene%loads(2)%side = 'y_max'
    scene%loads%pressure = 1.0_wp
    call refused(scene, 'round and thin parts', error)
  end subroutine test_refused

  !> Fail unless a scene is refused with a message that has `word`.
  subroutine refused(scene, word, error)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: word
    type(error_type), allocatable, intent(inout) :: error
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    call prepare(scene, set_up, fault)
    if (.not. allocated(fault)) then
      call test_failed(error, 'not refused: '//word)
      return
    end if
    call expect_true(error, index(fault%message, word) > 0, fault%message)
  end subroutine refused

end module test_set_up_consistent_weights
