!> Lattice families as scenes get them: which bodies have one, several grids, many offsets, many
!> kinds of blocks. What their force loops compute is held to the theory and to lists.
module test_family_lattice
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i1, i2, i4, i8
  use pd_body_body, only: body_type, grid_type, allocate_points, gather, keep_points
  use pd_law_material, only: material_type, new_material
  use pd_set_up_prepare, only: set_up_type
  use pd_family_family, only: bonds_type, allocate_bonds, family_type
  use pd_family_lattice, only: lattice_family_type, new_lattice_family
  use pd_family_list, only: list_family_type, new_list_family
  use pd_family_surface, only: surface_factors
  use pd_family_volume, only: volume_linear, volume_rule_type
  use pd_force_breaking, only: break_bonds, damage_of
  use pd_force_model, only: new_model
  use pd_force_reference, only: reference_force
  use pd_force_weights, only: build_weights
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_output_results_files, only: make_directory
  use pd_output_results_sink, only: sink_type
  use pd_scene_content_types, only: scene_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  use bodies, only: prepare_run, box_scene, diary_type, expect, expect_true, noise, ready, shake, &
    & youngs_modulus
  use force_subjects, only: subject_type, fast_force, some_gradient, spacing
  implicit none (type, external)
  private
  public :: collect_family_lattice

  real(wp), parameter :: ratio = 3.015_wp   !! the horizon in spacings, where not said otherwise
  character(*), parameter :: here = 'build/test_family_lattice'

contains

  subroutine collect_family_lattice(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('bodies that no bond joins keep their grids', test_apart), &
      & new_unittest('a bond between two grids joins them by a list', test_joined), &
      & new_unittest('bodies on one grid share a lattice', test_shared), &
      & new_unittest('an impossible lattice is refused', test_refused), &
      & new_unittest('a requested list is a list', test_list), &
      & new_unittest('two grids move as two lists do', test_motion), &
      & new_unittest('overlapping bodies are refused', test_overlap), &
      & new_unittest('every bond has its bit', test_bits), &
      & new_unittest('breaking has the same result as in lists', test_breaking), &
      & new_unittest('random holes agree with the theory', test_holes), &
      & new_unittest('the most common kinds of blocks have tables', test_most_used), &
      & new_unittest('long: more kinds of blocks than tables', test_on_the_fly), &
      & new_unittest('a chain in space keeps its ends', test_chain)]
  end subroutine collect_family_lattice

  ! ---------------------------------------------------------------- scenes

  !> Two plates, the right one coarser by a quarter, whose facing columns are `gap` horizons apart
  !> and whose lowest rows are in line.
  subroutine two_grids(gap, scene)
    real(wp), intent(in) :: gap
    type(scene_type), intent(out) :: scene
    real(wp), parameter :: coarser = 1.25_wp

    call box_scene([12, 9], spacing, 0.25_wp, scene)
    scene%horizon%surface_correction = 'energy'
    scene%horizon%length = ratio*coarser*spacing
    scene%bodies = [scene%bodies(1), scene%bodies(1)]
    scene%bodies(2)%name = 'right'
    scene%bodies(2)%points(:2) = [7, 8]
    scene%bodies(2)%lower(:2) = spacing*[11.5_wp + gap*ratio*coarser - coarser/2, &
      & 0.5_wp - coarser/2]
    scene%bodies(2)%upper(:2) = scene%bodies(2)%lower(:2) + [7, 8]*coarser*spacing
  end subroutine two_grids

  !> Ordered pairs of points no further apart than `reach`, one by one.
  pure integer(i8) function pairs_within(body, reach) result(n)
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: reach
    integer :: i, j

    n = 0
    do i = 1, body%n_points
      do j = 1, body%n_points
        if (i == j) cycle
        if (norm2(body%x(body%slot(j), :) - body%x(body%slot(i), :)) <= reach) n = n + 1
      end do
    end do
  end function pairs_within

  !> The number of grids of a lattice family, 0 for a list.
  pure integer function grids_of(family) result(n)
    class(family_type), intent(in) :: family
    n = 0
    select type (family)
    type is (lattice_family_type)
      n = size(family%grids)
    end select
  end function grids_of

  !> Hold the message with which a scene is refused to the words it must have.
  subroutine expect_refused(error, scene, words)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: words(:)
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    integer :: i

    if (allocated(error)) return
    call prepare_run(scene, set_up, fault)
    if (.not. allocated(fault)) then
      call test_failed(error, 'not refused: '//trim(words(1)))
      return
    end if
    call check(error, fault%status, 1, 'exit status of: '//fault%message)
    do i = 1, size(words)
      call expect_true(error, index(fault%message, trim(words(i))) > 0, &
        & 'no "'//trim(words(i))//'" in: '//fault%message)
    end do
  end subroutine expect_refused

  ! ---------------------------------------------------------------- which family

  subroutine test_apart(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up

    call two_grids(1.0_wp + 1.0e-6_wp, scene)
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call check(error, grids_of(set_up%system%family), 2, 'grids just out of reach')
    if (allocated(error)) return
    associate (body => set_up%system%body)
      call expect_true(error, set_up%system%family%n_bonds == &
        & pairs_within(body, ratio*1.25_wp*spacing), 'bonds of two grids')
    end associate
    select type (family => set_up%system%family)
    type is (lattice_family_type)
      call expect(error, family%grids(1)%spacing, spacing, 1.0e-12_wp*spacing, 'first spacing')
      call expect(error, family%grids(2)%spacing, 1.25_wp*spacing, 1.0e-12_wp*spacing, 'second')
      ! |offset| <= 3.76875 and <= 3.015 cells
      call expect_true(error, all(family%grids%n == [44, 28]), 'offsets of the two grids')
      call expect_true(error, index(family%describe(), '2 grids') > 0, family%describe())
    end select
  end subroutine test_apart

  !> The same bodies nearer by two millionths of the horizon.
  subroutine test_joined(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up

    call two_grids(1.0_wp - 1.0e-6_wp, scene)
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expect_true(error, index(set_up%system%family%describe(), '2 grids') > 0 .and. &
      & index(set_up%system%family%describe(), 'join grids') > 0, &
      & set_up%system%family%describe())
    call expect_true(error, set_up%system%family%n_bonds == &
      & pairs_within(set_up%system%body, ratio*1.25_wp*spacing), 'bonds of joined bodies')
  end subroutine test_joined

  !> The second body begins where the first ends, or a whole number of cells later.
  subroutine test_shared(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    integer :: cells

    do cells = 0, 5
      call box_scene([7, 6], spacing, 0.25_wp, scene)
      scene%bodies = [scene%bodies(1), scene%bodies(1)]
      scene%bodies(2)%lower(:2) = spacing*[7 + cells, -2]
      scene%bodies(2)%upper(:2) = scene%bodies(2)%lower(:2) + [7, 6]*spacing
      call ready(scene, set_up, error)
      if (allocated(error)) return
      call check(error, grids_of(set_up%system%family), 1, 'grids of bodies in line')
      call expect_true(error, set_up%system%family%n_bonds == &
        & pairs_within(set_up%system%body, ratio*spacing), 'bonds of bodies in line')
      if (allocated(error)) return
    end do
  end subroutine test_shared

  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    character(40), parameter :: key = '&horizon family'

    call two_grids(0.5_wp, scene)
    scene%horizon%family = 'lattice'
    call expect_refused(error, scene, [character(40) :: key, 'different grids'])
    call box_scene([12, 9], spacing, 0.25_wp, scene)
    scene%horizon%family = 'lattice'
    scene%bodies = [scene%bodies(1), scene%bodies(1)]
    scene%bodies(2)%lower(:2) = spacing*[5000, 5000]
    scene%bodies(2)%upper(:2) = scene%bodies(2)%lower(:2) + [12, 9]*spacing
    call expect_refused(error, scene, [character(40) :: key, 'too little of their grid'])
    call write_cloud(error)
    call box_scene([7, 6], spacing, 0.25_wp, scene)
    scene%bodies(1)%file = here//'/cloud.txt'
    scene%horizon%family = 'lattice'
    call expect_refused(error, scene, [character(40) :: key, 'cloud'])
  end subroutine test_refused

  !> A cloud of 5 x 4 points, none of them quite in line.
  subroutine write_cloud(error)
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault
    type(sink_type) :: sink
    character(120) :: line
    integer :: i, j, state

    if (allocated(error)) return
    state = 5
    call make_directory(here, fault)
    if (.not. allocated(fault)) call sink%open(here//'/cloud.txt', fault)
    do j = 1, 4
      do i = 1, 5
        write (line, '(4(es24.16, 1x))') spacing*(i + 0.1_wp*noise(state)), &
          & spacing*(j + 0.1_wp*noise(state)), 0.0_wp, 2.0e-3_wp*spacing**2
        if (.not. allocated(fault)) call sink%put(trim(line)//new_line('a'), fault)
      end do
    end do
    if (.not. allocated(fault)) call sink%close(fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine write_cloud

  !> Asked for, or because the points are a cloud, which is then no error.
  subroutine test_list(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up

    call box_scene([7, 6], spacing, 0.25_wp, scene)
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call check(error, grids_of(set_up%system%family), 1, 'a plate by default')
    if (allocated(error)) return
    scene%horizon%family = 'list'
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call check(error, grids_of(set_up%system%family), 0, 'a plate with lists')
    if (allocated(error)) return
    call expect_true(error, index(set_up%system%family%describe(), 'asked for') > 0, &
      & set_up%system%family%describe())
    call write_cloud(error)
    scene%horizon%family = 'automatic'
    scene%bodies(1)%file = here//'/cloud.txt'
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call check(error, set_up%system%body%n_points, 20, 'points of the cloud')
    if (allocated(error)) return
    call check(error, grids_of(set_up%system%family), 0, 'a cloud')
  end subroutine test_list

  !> 60 steps from a velocity gradient, with a crack through either plate. The order of the sums
  !> differs, so each force differs by some roundings of its largest term, and u by as many.
  subroutine test_motion(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: u(:, :), first(:, :)
    integer :: run, c

    call two_grids(1.1_wp, scene)
    deallocate (scene%initial, scene%cracks)
    allocate (scene%initial(1), scene%cracks(2))
    scene%initial(1)%velocity_gradient = some_gradient(100.0_wp)
    scene%cracks(1)%from(:2) = spacing*[-1.0_wp, 3.9_wp]
    scene%cracks(1)%to(:2) = spacing*[5.2_wp, 4.1_wp]
    scene%cracks(2)%from(:2) = spacing*[20.0_wp, -1.0_wp]
    scene%cracks(2)%to(:2) = spacing*[20.1_wp, 5.3_wp]
    do run = 1, 2
      if (run == 2) scene%horizon%family = 'list'
      call ready(scene, set_up, error)
      if (allocated(error)) return
      call check(error, grids_of(set_up%system%family), merge(2, 0, run == 1), 'grids')
      if (allocated(error)) return
      call expect_true(error, set_up%cut > 40, 'the cracks cut little')
      call run_explicit(set_up%system, 'forward_backward', set_up%plan%step, 60, diary, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      if (allocated(error)) return
      if (allocated(u)) deallocate (u)
      allocate (u(set_up%system%body%n_points, 2))
      do c = 1, 2
        call gather(set_up%system%body, set_up%system%state%u(:, c), u(:, c))
      end do
      if (run == 1) first = u
    end do
    call expect_true(error, max_abs(u) > 1.0e-3_wp*spacing, 'nothing moved')
    call expect_close(error, u, first, 1.0e-12_wp*max_abs(u), &
      & 'displacements by lattices and lists')
  end subroutine test_motion

  !> On one grid two points would share a cell; on two grids points lie in cells of the other body:
  !> with less than half a cell in common the bodies are taken.
  subroutine test_overlap(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    real(wp), parameter :: shifts(*) = [0.0_wp, 1.0_wp, 6.0_wp, 0.3_wp, 6.49_wp, 6.51_wp]
    type(set_up_type) :: set_up
    integer :: i

    do i = 1, size(shifts)
      call box_scene([7, 6], spacing, 0.25_wp, scene)
      scene%bodies = [scene%bodies(1), scene%bodies(1)]
      scene%bodies(2)%lower(1) = scene%bodies(2)%lower(1) + shifts(i)*spacing
      scene%bodies(2)%upper(1) = scene%bodies(2)%upper(1) + shifts(i)*spacing
      ! the facing columns are shift - 6 apart
      if (i == size(shifts)) exit
      call expect_refused(error, scene, [character(16) :: 'overlap', 'body 1', 'body 2'])
    end do
    call ready(scene, set_up, error)
  end subroutine test_overlap

  ! ---------------------------------------------------------------- many offsets, many holes

  !> A box with part of its points taken out at random, surface factors, and a critical stretch of
  !> 0.02 where bonds may break.
  subroutine porous(count, horizon, part, kind, breakable, subject, room, surface)
    integer, intent(in) :: count(:)
    real(wp), intent(in) :: horizon          !! [spacings]
    real(wp), intent(in) :: part             !! of the points that are taken out
    character(*), intent(in) :: kind
    logical, intent(in) :: breakable
    type(subject_type), intent(out) :: subject
    integer(i8), intent(in), optional :: room  !! for tables of weights [bytes]
    logical, intent(in), optional :: surface   !! with surface factors; default: yes
    type(material_type) :: materials(1)
    logical, allocatable :: keep(:)
    type(lattice_family_type), allocatable :: lattice
    type(list_family_type), allocatable :: list
    type(fault_type), allocatable :: fault
    integer :: n, i, c, rest, state

    subject%dim = size(count)
    call allocate_points(subject%body, subject%dim, product(count))
    associate (body => subject%body)
      allocate (keep(body%n_points))
      state = 20
      do n = 1, body%n_points
        rest = n - 1
        do c = 1, subject%dim
          i = mod(rest, count(c))
          rest = rest/count(c)
          body%x(n, c) = (i + 0.5_wp)*spacing
        end do
        keep(n) = (1 + noise(state))/2 >= part
      end do
      body%volume = spacing**subject%dim
      body%spacing = spacing
      body%body = 1_i2
      body%material = 1_i2
      body%grid = 1_i2
      body%grids = [grid_type([0.0_wp, 0.0_wp, 0.0_wp], spacing)]
      call keep_points(body, keep)
      materials = new_material(youngs_modulus, 0.2_wp, 7850.0_wp, subject%dim, .false., 1.0_wp, &
        & 1.0_wp, horizon*spacing, .false.)
      if (breakable) materials%critical_stretch = 0.02_wp
      associate (rule => volume_rule_type(volume_linear, horizon*spacing))
        if (kind == 'list') then
          allocate (list)
          call new_list_family(body, rule, list)
          call move_alloc(list, subject%family)
        else
          allocate (lattice)
          call new_lattice_family(body, rule, breakable, .false., lattice, fault)
          if (present(room)) subject%workspace%lattice%room = room
          call move_alloc(lattice, subject%family)
        end if
      end associate
      call new_model(body, materials, .true., spread(.false., 1, body%n_slots), &
        & spread(0.0_wp, 1, body%n_slots), subject%model)
      subject%model%surface = .true.
      if (present(surface)) subject%model%surface = surface
      if (subject%model%surface) call surface_factors(body, subject%family, materials, &
        & subject%model%D, subject%model%S)
    end associate
    select type (family => subject%family)
    type is (lattice_family_type)
      call build_weights(family, subject%model, subject%workspace%lattice)
    end select
  end subroutine porous

  !> Hold the fast loops to the theory point by point, under small strains and large ones.
  subroutine expect_theory(error, subject, what)
    type(error_type), allocatable, intent(inout) :: error
    type(subject_type), intent(inout) :: subject
    character(*), intent(in) :: what
    real(wp), parameter :: strains(*) = [1.0e-4_wp, 0.2_wp]
    real(wp), allocatable :: u(:, :), force(:, :), p(:), expected(:, :)
    integer :: i

    if (allocated(error)) return
    allocate (u(subject%body%n_slots, subject%dim), expected(subject%body%n_slots, subject%dim))
    do i = 1, size(strains)
      call shake(subject%body, some_gradient(strains(i)), 0.3_wp*strains(i)*spacing, 7, u)
      call fast_force(subject, u, force, p)
      call reference_force(subject%family, subject%model, u, expected)
      call expect_true(error, max_abs(expected) > 0.0_wp, 'no force: '//what)
      call expect_close(error, force, expected, &
        & 1.0e-12_wp*max_abs(expected), 'force: '//what)
    end do
  end subroutine expect_theory

  !> One bond of a point after the other is broken: that one and no other.
  subroutine test_bits(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    type(bonds_type) :: bonds
    real(wp), parameter :: horizons(*) = [3.015_wp, 5.015_wp]
    integer, parameter :: offsets(*) = [122, 514], words(*) = [2, 9]
    integer :: h, i, k, other

    do h = 1, size(horizons)
      call porous([11, 11, 11], horizons(h), 0.0_wp, 'lattice', .true., subject)
      call check(error, subject%family%most_bonds, offsets(h), 'points within the horizon')
      if (allocated(error)) return
      select type (family => subject%family)
      type is (lattice_family_type)
        call check(error, family%words, words(h), 'words of bits')
        if (allocated(error)) return
        k = subject%body%slot((11**3 + 1)/2)
        other = subject%body%slot((11**3 - 1)/2)
        call allocate_bonds(family, bonds)
        do i = 1, offsets(h)
          call family%break_bond(k, i)
          call family%bonds_of(k, bonds)
          call check(error, bonds%n, offsets(h), 'bonds, broken ones included')
          if (allocated(error)) return
          call expect_true(error, .not. any(bonds%intact(:i)), 'a broken bond is intact')
          call expect_true(error, all(bonds%intact(i + 1:bonds%n)), 'an intact bond is broken')
        end do
        call family%bonds_of(other, bonds)
        call expect_true(error, all(bonds%intact(:bonds%n)), 'bonds of another point')
      end select
    end do
  end subroutine test_bits

  !> Bonds that break under a random displacement are the same in lattices and lists, and so are
  !> damage, dissipated energy and the forces of what is left. Positions are exact in binary, so
  !> stretches are the same to the last bit but for the order of the two ends.
  subroutine test_breaking(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), parameter :: horizons(*) = [3.015_wp, 5.015_wp]
    character(8), parameter :: kinds(2) = [character(8) :: 'list', 'lattice']
    real(wp), allocatable :: u(:, :), force(:, :), p(:), damage(:), ordered(:, :), first(:, :)
    integer(i4), allocatable :: slots(:)
    integer(i8) :: broken, broken_before
    real(wp) :: dissipated, dissipated_before
    integer :: h, kind, c, w, k

    do h = 1, size(horizons)
      do kind = 1, 2
        call porous([9, 8, 7], horizons(h), 0.1_wp, kinds(kind), .true., subject)
        associate (body => subject%body)
          if (allocated(u)) deallocate (u, damage, ordered)
          allocate (u(body%n_slots, 3), damage(body%n_slots), ordered(body%n_points, 4))
          call shake(body, some_gradient(0.02_wp), 0.08_wp*spacing, 9, u)
          slots = pack([(k, k=1, body%n_slots)], body%point > 0)
          damage = 0.0_wp
          call break_bonds(body, subject%family, subject%model, u, slots, damage, broken, &
            & dissipated, laws=subject%workspace%generic)
          call fast_force(subject, u, force, p)
          do c = 1, 3
            call gather(body, force(:, c), ordered(:, c))
          end do
          call gather(body, damage, ordered(:, 4))
          call expect_theory(error, subject, trim(kinds(kind))//' with broken bonds')
        end associate
        if (kind == 2) exit
        first = ordered
        broken_before = broken
        dissipated_before = dissipated
      end do
      call expect_true(error, 10*broken > subject%family%n_bonds/2 .and. &
        & 10*broken < 9*subject%family%n_bonds/2, 'too few bonds broke, or too many')
      call expect_true(error, broken == broken_before, 'numbers of broken bonds')
      call expect(error, dissipated, dissipated_before, 1.0e-12_wp*dissipated, 'dissipated')
      call expect_close(error, ordered(:, :3), first(:, :3), &
        & 1.0e-12_wp*max_abs(first(:, :3)), 'forces of lattices and lists')
      call expect_close(error, ordered(:, 4), first(:, 4), 1.0e-12_wp, 'damage')
      select type (family => subject%family)
      type is (lattice_family_type)
        do w = 1, family%words
          call expect_true(error, any(family%broken(:, w) /= 0_i8), 'a word without broken bonds')
        end do
      end select
      if (allocated(error)) return
    end do
  end subroutine test_breaking

  !> Hardly a block is like another, so tables are many.
  subroutine test_holes(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    logical :: breakable
    integer :: i

    do i = 1, 2
      breakable = i == 2
      call porous([70, 50], ratio, 0.3_wp, 'lattice', breakable, subject)
      associate (kept => subject%workspace%lattice)
        call expect_true(error, size(kept%table) > 300, 'too few kinds of blocks')
        call expect_true(error, all(kept%weights > 0), 'blocks without a table')
      end associate
      call expect_theory(error, subject, 'a plate full of holes')
      ! farther offsets than one word of bits holds: 80 of them
      call porous([40, 30], 5.015_wp, 0.3_wp, 'lattice', breakable, subject)
      call check(error, subject%family%most_bonds, 80, 'offsets')
      call expect_theory(error, subject, 'a plate full of holes, five spacings')
    end do
  end subroutine test_holes

  !> A cube of 24 points along an edge has 3 blocks in a row, and without surface factors 7 kinds of
  !> rows along y and z: those within 3 points of a side, and the others. Factors make that 13,
  !> since the far end of a bond has its own. Where the tables have room for some of 3*13*13 kinds
  !> only, the 3*(12 + 12 + 1) inside along y or z have them, which are 3 of 4 blocks.
  subroutine test_most_used(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject

    call porous([24, 24, 24], ratio, 0.0_wp, 'lattice', .false., subject, surface=.false.)
    associate (kept => subject%workspace%lattice)
      call check(error, size(kept%table), 3*7*7, 'kinds without surface factors')
      if (allocated(error)) return
      call expect_true(error, all(kept%weights > 0), 'blocks without a table')
    end associate
    call expect_theory(error, subject, 'a cube without surface factors')
    if (allocated(error)) return
    call porous([24, 24, 24], ratio, 0.0_wp, 'lattice', .false., subject, room=0_i8)
    associate (kept => subject%workspace%lattice)
      call expect_true(error, size(kept%table) < 3*13*13, 'no kind without a table')
      call expect_true(error, 4*count(kept%weights > 0) >= 3*size(kept%weights), &
        & 'blocks of common kinds without a table')
    end associate
    call expect_theory(error, subject, 'a cube with few tables')
    if (allocated(error)) return
    ! five spacings have 514 offsets: all kinds have tables
    call porous([20, 20, 20], 5.015_wp, 0.0_wp, 'lattice', .false., subject)
    call check(error, subject%family%most_bonds, 514, 'offsets')
    call expect_true(error, all(subject%workspace%lattice%weights > 0), &
      & 'five spacings: blocks without a table')
  end subroutine test_most_used

  !> Beyond the room of the tables, blocks make their weights in every pass: here 32 MiB, of 1200
  !> kinds with the 514 offsets of five spacings.
  subroutine test_on_the_fly(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    real(wp), allocatable :: u(:, :), damage(:)
    integer(i4), allocatable :: slots(:)
    integer(i8) :: broken
    real(wp) :: dissipated
    integer :: k

    call porous([20, 20, 20], 5.015_wp, 0.4_wp, 'lattice', .true., subject, room=32_i8*1024_i8**2)
    associate (kept => subject%workspace%lattice)
      call expect_true(error, count(kept%weights > 0) > 300, 'too few blocks with tables')
      call expect_true(error, count(kept%weights == 0) > 300, 'too few without')
    end associate
    call expect_theory(error, subject, 'a block full of holes')
    if (allocated(error)) return
    associate (body => subject%body)
      allocate (u(body%n_slots, 3), damage(body%n_slots))
      call shake(body, some_gradient(0.02_wp), 0.08_wp*spacing, 9, u)
      slots = pack([(k, k=1, body%n_slots)], body%point > 0)
      call damage_of(body, subject%family, damage)
      call break_bonds(body, subject%family, subject%model, u, slots, damage, broken, dissipated, &
        & laws=subject%workspace%generic)
      call expect_true(error, 10*broken > subject%family%n_bonds/2, 'too few bonds broke')
    end associate
    call expect_theory(error, subject, 'a block full of holes, with broken bonds')
  end subroutine test_on_the_fly

  !> A single row of points in space: what tells the surroundings of its end from those of its
  !> middle are the offsets along x alone, which stand in the middle of the table.
  subroutine test_chain(error)
    type(error_type), allocatable, intent(out) :: error
    type(subject_type) :: subject
    integer :: n

    do n = 25, 32
      call porous([n, 1, 1], ratio, 0.0_wp, 'lattice', .false., subject)
      call expect_theory(error, subject, 'a chain')
    end do
  end subroutine test_chain

end module test_family_lattice
