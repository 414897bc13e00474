!> Composite families: which bodies have one, and that they compute what a list of all bonds does.
module test_family_composite
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i1
  use pd_body_body, only: gather
  use pd_family_composite, only: composite_family_type
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_force_forces, only: internal_force
  use pd_force_model, only: options_of
  use pd_force_reference, only: reference_force
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_motion_system, only: system_type
  use pd_output_results_files, only: make_directory
  use pd_output_results_sink, only: sink_type
  use pd_scene_content_types, only: scene_type, unset
  use pd_set_up_prepare, only: set_up_type
  use pd_study_limits_vibration, only: free_body
  use bodies, only: box_scene, diary_type, expect_true, noise, ready, shake
  use comparisons, only: expect_close, max_abs
  use force_subjects, only: some_gradient, spacing
  use restarts, only: accept, expect_broken, expect_same_results, plate, run, run_in_pieces
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_family_composite

  !> Of the order of sums: each force is off by some roundings of its largest term.
  real(wp), parameter :: of_order = 1.0e-12_wp
  character(*), parameter :: here = 'build/test_family_composite'

contains

  subroutine collect_family_composite(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('which scenes have one, and why others do not', test_choice), &
      & new_unittest('bonds are counted and listed as in a list', test_bonds), &
      & new_unittest('forces agree with the theory point by point', test_forces), &
      & new_unittest('long: a crack through the joint grows as in a list', test_crack), &
      & new_unittest('cracks cut the bonds that they cut in a list', test_cuts), &
      & new_unittest('static equilibrium is that of a list', test_static), &
      & new_unittest('a cloud beside a lattice moves as in a list', test_cloud), &
      & new_unittest('a run in pieces has the same bits', test_pieces)]
  end subroutine collect_family_composite

  !> Two bodies side by side, the right one of half the spacing, turned into 3D where asked.
  subroutine two_bodies(dim, own, scene)
    integer, intent(in) :: dim
    logical, intent(in) :: own  !! horizons by the spacing of each body, else one
    type(scene_type), intent(out) :: scene
    integer :: points(3)

    points = [merge(16, 12, dim < 3), 10, 6]
    if (dim == 1) points(1) = 20
    call box_scene(points(:dim), spacing, 0.3_wp, scene)
    scene%horizon%surface_correction = 'energy'
    if (.not. own) scene%horizon%length = scene%horizon%ratio*spacing
    scene%bodies = [scene%bodies(1), scene%bodies(1)]
    scene%bodies(2)%name = 'fine'
    scene%bodies(2)%lower(1) = scene%bodies(1)%upper(1)
    scene%bodies(2)%upper(1) = scene%bodies(1)%upper(1)*1.5_wp
    scene%bodies(2)%points(:dim) = 2*points(:dim)
    scene%bodies(2)%points(1) = points(1)
  end subroutine two_bodies

  !> The family of a scene, or none and a failed test.
  subroutine expect_kind(error, scene, composite, words)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type), intent(in) :: scene
    logical, intent(in) :: composite
    character(*), intent(in) :: words  !! in its description
    type(set_up_type) :: set_up
    character(:), allocatable :: text
    logical :: is_composite

    if (allocated(error)) return
    call ready(scene, set_up, error)
    if (allocated(error)) return
    is_composite = .false.
    select type (family => set_up%system%family)
    type is (composite_family_type)
      is_composite = .true.
    class default  ! what it is else does not matter
      continue
    end select
    text = set_up%system%family%describe()
    call check(error, is_composite, composite, 'composite or not: '//text)
    call expect_true(error, index(text, words) > 0, 'no "'//words//'" in: '//text)
  end subroutine expect_kind

  subroutine test_choice(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call two_bodies(2, .false., scene)
    call expect_kind(error, scene, .true., '2 grids')
    scene%horizon%family = 'list'
    call expect_kind(error, scene, .false., 'asked for')
    call two_bodies(2, .true., scene)
    call expect_kind(error, scene, .true., '% of the bonds that join grids')
    scene%bodies(2)%lower(1) = scene%bodies(2)%lower(1) + 4*spacing
    scene%bodies(2)%upper(1) = scene%bodies(2)%upper(1) + 4*spacing
    call expect_kind(error, scene, .false., '2 grids')
    call two_bodies(2, .false., scene)
    scene%horizon%length = 3.015_wp*spacing
    scene%horizon%surface_correction = 'consistent'
    call expect_kind(error, scene, .false., &
      & "no composite family: surface_correction = 'consistent'")
    call two_bodies(3, .false., scene)
    scene%horizon%length = 5*spacing
    call expect_kind(error, scene, .false., 'too many points have bonds beyond their grid')
  end subroutine test_choice

  !> The bonds of a family as one number for each point: their count, volumes and lengths.
  subroutine moments(scene, number, error)
    type(scene_type), intent(in) :: scene
    real(wp), allocatable, intent(out) :: number(:, :)
    type(error_type), allocatable, intent(inout) :: error
    type(set_up_type) :: set_up
    type(bonds_type) :: bonds
    real(wp), allocatable :: of_slot(:, :)
    integer :: k, c

    call ready(scene, set_up, error)
    if (allocated(error)) return
    associate (body => set_up%system%body, family => set_up%system%family)
      allocate (of_slot(body%n_slots, 4), source=0.0_wp)
      allocate (number(body%n_points, 4))
      call allocate_bonds(family, bonds)
      do k = 1, body%n_slots
        call family%bonds_of(k, bonds)
        of_slot(k, 1) = count(bonds%intact(:bonds%n))
        of_slot(k, 2) = sum(bonds%weight(:bonds%n))
        of_slot(k, 3) = sum(bonds%length(:bonds%n))
        do c = 1, bonds%n
          of_slot(k, 4) = of_slot(k, 4) + bonds%xi(c, 1)*body%x(bonds%j(c), 1)
        end do
      end do
      call check(error, sum(nint(of_slot(:, 1))), int(family%n_bonds), 'number of bonds')
      call expect_true(error, maxval(nint(of_slot(:, 1))) <= family%most_bonds, &
        & 'most bonds of a point')
      do c = 1, 4
        call gather(body, of_slot(:, c), number(:, c))
      end do
    end associate
  end subroutine moments

  subroutine test_bonds(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    real(wp), allocatable :: composite(:, :), list(:, :)
    integer :: dim, c, l

    do dim = 1, 3
      do l = 1, 2
        call two_bodies(dim, l == 2, scene)
        call moments(scene, composite, error)
        scene%horizon%family = 'list'
        if (.not. allocated(error)) call moments(scene, list, error)
        if (allocated(error)) return
        do c = 1, 4
          call expect_close(error, composite(:, c), list(:, c), &
            & of_order*max_abs(list(:, c)), 'bonds')
        end do
      end do
    end do
  end subroutine test_bonds

  !> Small strains, and those that need the general formulas.
  subroutine test_forces(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: strains(*) = [1.0e-4_wp, 0.2_wp]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: u(:, :), force(:, :), expected(:, :), p(:)
    integer(i1) :: marks(0)
    integer :: dim, l, i

    do dim = 1, 3
      do l = 1, 2
        call two_bodies(dim, l == 2, scene)
        call ready(scene, set_up, error)
        if (allocated(error)) return
        associate (system => set_up%system)
          allocate (u(system%body%n_slots, dim), source=0.0_wp)
          allocate (force, expected, source=u)
          allocate (p(merge(system%body%n_slots, 0, system%model%dilatation)), source=0.0_wp)
          do i = 1, size(strains)
            call shake(system%body, some_gradient(strains(i)), 0.3_wp*strains(i)*spacing, 7, u)
            call internal_force(system%body, system%family, system%model, &
              & options_of(system%model), system%workspace, u, p, force, marks)
            call reference_force(system%family, system%model, u, expected)
            call expect_true(error, max_abs(expected) > 0.0_wp, 'no force')
            call expect_close(error, force, expected, of_order*max_abs(expected), 'forces')
          end do
          deallocate (u, force, expected, p)
        end associate
      end do
    end do
  end subroutine test_forces

  !> The end of a run in the order of the points: displacements, and damage as the last component.
  subroutine final_state(scene, static, state, diary, error)
    type(scene_type), intent(in) :: scene
    logical, intent(in) :: static
    real(wp), allocatable, intent(out) :: state(:, :)
    type(diary_type), intent(out) :: diary
    type(error_type), allocatable, intent(inout) :: error
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    integer :: c, dim

    if (allocated(error)) return
    call ready(scene, set_up, error)
    if (allocated(error)) return
    dim = scene%header%dimension
    if (static) then
      call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
    else
      call run_explicit(set_up%system, 'forward_backward', set_up%plan%step, scene%time%steps, &
        & diary, fault)
    end if
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    allocate (state(set_up%system%body%n_points, dim + 1), source=0.0_wp)
    do c = 1, dim
      call gather(set_up%system%body, set_up%system%state%u(:, c), state(:, c))
    end do
    if (set_up%system%model%breaking) &
      & call gather(set_up%system%body, set_up%system%state%damage, state(:, dim + 1))
  end subroutine final_state

  !> Hold the end of a run to that with one list.
  subroutine expect_like_list(error, scene, static, tolerance, damaged)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type), intent(in) :: scene
    logical, intent(in) :: static
    real(wp), intent(in) :: tolerance  !! of the largest displacement and energy, and of the damage
    logical, intent(in) :: damaged
    type(scene_type) :: other
    real(wp), allocatable :: state(:, :), expected(:, :)
    type(diary_type) :: diary, of_list
    integer :: dim

    dim = scene%header%dimension
    other = scene
    other%horizon%family = 'list'
    call expect_kind(error, scene, .true., '')
    call final_state(scene, static, state, diary, error)
    call final_state(other, static, expected, of_list, error)
    if (allocated(error)) return
    call expect_true(error, max_abs(expected(:, :dim)) > 1.0e-4_wp*spacing, 'nothing moved')
    call expect_true(error, max_abs(expected(:, dim + 1)) > 0.1_wp .eqv. damaged, 'damage')
    call expect_close(error, state(:, :dim), expected(:, :dim), &
      & tolerance*max_abs(expected(:, :dim)), 'displacements')
    call expect_close(error, state(:, dim + 1), expected(:, dim + 1), tolerance, 'damage')
    call expect_close(error, diary%strain(:diary%n), of_list%strain(:of_list%n), &
      & tolerance*max_abs(of_list%strain(:of_list%n)), 'strain energies')
    call expect_close(error, diary%dissipated(:diary%n), of_list%dissipated(:of_list%n), &
      & tolerance*max(max_abs(of_list%dissipated(:of_list%n)), tiny(1.0_wp)), 'dissipated')
  end subroutine expect_like_list

  !> Bonds on either side and across break, with one horizon and with two.
  subroutine test_crack(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    integer :: dim, l

    do dim = 2, 3
      do l = 1, 2
        call two_bodies(dim, l == 2, scene)
        scene%time%steps = merge(60, 20, dim == 2)
        scene%materials(1)%critical_stretch = 0.02_wp
        deallocate (scene%initial)
        allocate (scene%initial(1))
        scene%initial(1)%velocity_gradient(2, 2) = merge(3.0e4_wp, 6.0e4_wp, dim == 2)
        if (dim == 2) then
          deallocate (scene%cracks)
          allocate (scene%cracks(1))
          scene%cracks(1)%from(:2) = spacing*[10.0_wp, 4.9_wp]
          scene%cracks(1)%to(:2) = spacing*[20.0_wp, 5.1_wp]
        end if
        ! the difference of two states grows with the steps, a bond that breaks is the same one
        call expect_like_list(error, scene, .false., 1.0e-9_wp, .true.)
        if (allocated(error)) return
      end do
    end do
  end subroutine test_crack

  !> Bonds of points that lie far apart share bytes of the list: cutting on several threads must not
  !> lose any. The free twin, on which limits are measured, has the same cuts.
  subroutine test_cuts(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: composite, list
    type(system_type) :: twin
    type(fault_type), allocatable :: fault
    integer :: before, i

    call two_bodies(2, .true., scene)
    deallocate (scene%cracks)
    allocate (scene%cracks(1))
    scene%cracks(1)%from(:2) = spacing*[16.1_wp, -1.0_wp]
    scene%cracks(1)%to(:2) = spacing*[16.2_wp, 9.1_wp]
    before = omp_get_max_threads()
    call omp_set_num_threads(4)
    do i = 1, 5
      call ready(scene, composite, error)
      if (allocated(error)) exit
      scene%horizon%family = 'list'
      call ready(scene, list, error)
      scene%horizon%family = 'automatic'
      if (allocated(error)) exit
      call expect_true(error, list%cut > 100, 'the crack cuts little')
      call expect_true(error, composite%cut == list%cut, 'cut bonds')
      call expect_close(error, sum(composite%system%state%damage), sum(list%system%state%damage), &
        & of_order*sum(list%system%state%damage), 'damage')
    end do
    if (.not. allocated(error)) call free_body(composite%system, 0.0_wp, 1.0_wp, twin, fault)
    call omp_set_num_threads(before)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    call expect_close(error, sum(intact_of(twin)), sum(intact_of(composite%system)), 0.0_wp, &
      & 'intact bonds of the twin')
  end subroutine test_cuts

  !> Intact bonds of each slot.
  function intact_of(system) result(number)
    type(system_type), intent(in) :: system
    real(wp) :: number(system%body%n_slots)
    type(bonds_type) :: bonds
    integer :: k

    call allocate_bonds(system%family, bonds)
    do k = 1, system%body%n_slots
      call system%family%bonds_of(k, bonds)
      number(k) = count(bonds%intact(:bonds%n))
    end do
  end function intact_of

  subroutine test_static(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call two_bodies(2, .true., scene)
    scene%time%method = 'relaxation'
    scene%relaxation%tolerance = 1.0e-9_wp
    deallocate (scene%boundaries)
    allocate (scene%boundaries(2))
    scene%boundaries%side = 'x_min'
    scene%boundaries(1)%name = 'left'
    scene%boundaries(1)%body = 'box'
    scene%boundaries(1)%displacement(:2) = 0.0_wp
    scene%boundaries(2)%name = 'right'
    scene%boundaries(2)%body = 'fine'
    scene%boundaries(2)%side = 'x_max'
    scene%boundaries(2)%displacement(:2) = spacing*[0.01_wp, 0.02_wp]
    ! both are solved to 1e-9 of the forces
    call expect_like_list(error, scene, .true., 1.0e-6_wp, .false.)
  end subroutine test_static

  !> Points off any lattice, from a file, to the right of a lattice.
  subroutine test_cloud(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    type(sink_type) :: sink
    character(120) :: line
    integer :: i, j, state

    state = 5
    call make_directory(here, fault)
    if (.not. allocated(fault)) call sink%open(here//'/cloud.txt', fault)
    do j = 1, 10
      do i = 1, 5
        write (line, '(4(es24.16, 1x))') spacing*(19.5_wp + i + 0.1_wp*noise(state)), &
          & spacing*(j - 0.5_wp + 0.1_wp*noise(state)), 0.0_wp, 2.0e-3_wp*spacing**2
        if (.not. allocated(fault)) call sink%put(trim(line)//new_line('a'), fault)
      end do
    end do
    if (.not. allocated(fault)) call sink%close(fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    call two_bodies(2, .false., scene)
    scene%bodies(1)%upper(1) = 20*spacing
    scene%bodies(1)%points(1) = 20
    scene%bodies(2)%file = here//'/cloud.txt'
    scene%bodies(2)%points = 0
    scene%bodies(2)%lower = unset
    scene%bodies(2)%upper = unset
    scene%time%steps = 60
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%velocity_gradient = some_gradient(100.0_wp)
    call expect_like_list(error, scene, .false., 1.0e-10_wp, .false.)
  end subroutine test_cloud

  !> A crack grows beside a body of another spacing, and the run is cut after every step.
  subroutine test_pieces(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces

    call plate(scene)
    scene%bodies = [scene%bodies(1), scene%bodies(1)]
    scene%bodies(2)%name = 'fine'
    scene%bodies(2)%lower(1) = scene%bodies(1)%upper(1)
    scene%bodies(2)%upper(1) = 1.5_wp*scene%bodies(1)%upper(1)
    scene%bodies(2)%points(:2) = [12, 24]
    scene%boundaries(:2)%body = 'box'
    call expect_kind(error, scene, .true., '2 grids')
    call run(scene, 'composite/whole', fault, threads=2)
    call accept(error, fault)
    call expect_broken(error, 'composite/whole')
    if (allocated(error)) return
    call run_in_pieces(scene, 'composite/pieces', 1, pieces, error)
    call expect_same_results(error, 'composite/whole', 'composite/pieces', 6)
  end subroutine test_pieces

end module test_family_composite
