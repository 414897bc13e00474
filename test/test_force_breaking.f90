!> Which bonds break, what they cost, and what counts as damage.
module test_force_breaking
  use pd_base_kinds, only: wp, i8
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_system, only: evaluate
  use pd_scene_content_types, only: scene_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, unittest_type
  use bodies, only: at_point, box_scene, expect, expect_true, ready
  implicit none (type, external)
  private
  public :: collect_force_breaking

  real(wp), parameter :: spacing = 1.0e-2_wp
  real(wp), parameter :: critical = 1.0e-3_wp  !! s_c where not said otherwise

contains

  subroutine collect_force_breaking(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('bonds hold up to the critical stretch and break beyond', test_limit), &
      & new_unittest('compression breaks only materials that allow it', test_compression), &
      & new_unittest('a broken bond stays broken', test_for_good), &
      & new_unittest('between materials the smaller critical stretch counts', test_interface), &
      & new_unittest('no-fail zones hold bonds with an end in them', test_no_fail), &
      & new_unittest('thermal expansion alone breaks nothing', test_thermal), &
      & new_unittest('pre-cracks are damage but not broken bonds', test_counts), &
      & new_unittest('a body torn apart dissipates all its strain energy', test_energy), &
      & new_unittest('forces after breaking are those of the bonds left', test_forces), &
      & new_unittest('unbreakable material needs no detection', test_no_breaking)]
  end subroutine collect_force_breaking

  !> A plate with critical stretch.
  subroutine plate(scene)
    type(scene_type), intent(out) :: scene
    call box_scene([9, 8], spacing, 0.2_wp, scene)
    scene%materials(1)%critical_stretch = critical
  end subroutine plate

  !> Stretch the plate uniformly by `strain` in all directions and break what breaks.
  subroutine expand(set_up, strain)
    type(set_up_type), intent(inout) :: set_up
    real(wp), intent(in) :: strain
    set_up%system%state%u = strain*set_up%system%body%x
    call evaluate(set_up%system, 0.0_wp, breaking=.true.)
  end subroutine expand

  !> Under uniform expansion every bond has the same stretch, the strain. To 1e-12 of the limit.
  subroutine test_limit(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up

    call plate(scene)
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expand(set_up, critical*(1 - 1.0e-12_wp))
    call expect_true(error, set_up%system%broken == 0, 'broken below the limit')
    call expand(set_up, critical*(1 + 1.0e-12_wp))
    call expect_true(error, 2*set_up%system%broken == set_up%system%family%n_bonds, &
      & 'whole above the limit')
    call expect(error, minval(set_up%system%state%damage(set_up%system%body%slot)), 1.0_wp, &
      & 0.0_wp, 'damage')
    call expect_close(error, set_up%system%state%force, 0.0_wp, 0.0_wp, &
      & 'force without bonds')
  end subroutine test_limit

  subroutine test_compression(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up

    call plate(scene)
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expand(set_up, -0.5_wp)
    call expect_true(error, set_up%system%broken == 0, 'compression broke bonds unasked')
    scene%materials(1)%break_in_compression = .true.
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expand(set_up, -critical*(1 - 1.0e-12_wp))
    call expect_true(error, set_up%system%broken == 0, 'broken below the limit')
    call expand(set_up, -critical*(1 + 1.0e-12_wp))
    call expect_true(error, 2*set_up%system%broken == set_up%system%family%n_bonds, &
      & 'whole above the limit')
  end subroutine test_compression

  subroutine test_for_good(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    integer(i8) :: broken

    call plate(scene)
    call ready(scene, set_up, error)
    if (allocated(error)) return
    set_up%system%state%u = 0.0_wp
    ! one point is pulled out
    set_up%system%state%u(at_point(set_up%system%body, [4.5_wp, 3.5_wp]*spacing), &
      & 1) = 0.1_wp*spacing
    call evaluate(set_up%system, 0.0_wp, breaking=.true.)
    broken = set_up%system%broken
    call expect_true(error, broken > 5 .and. broken < 28, 'bonds of the point that was pulled')
    set_up%system%state%u = 0.0_wp
    call evaluate(set_up%system, 0.0_wp, breaking=.true.)
    call expect_true(error, set_up%system%broken == broken, 'a second breaking')
    call expect_true(error, maxval(set_up%system%state%damage) > 0.1_wp, 'damage healed')
    call expect_close(error, set_up%system%state%force, 0.0_wp, 0.0_wp, 'force at rest')
  end subroutine test_for_good

  !> Two halves with limits 1 and 3 times s_c, stretched by 2 s_c: bonds within the tougher half are
  !> left. With compression allowed in one half alone, only bonds within that half break in it.
  subroutine test_interface(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    integer(i8) :: inside

    call plate(scene)
    inside = pairs(5, 8)
    call join_tougher(scene)
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expand(set_up, 2*critical)
    call expect_true(error, set_up%system%broken == set_up%system%family%n_bonds/2 - inside, &
      & 'bonds left within the tougher half')
    scene%materials(1)%break_in_compression = .true.
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expand(set_up, -2*critical)
    call expect_true(error, set_up%system%broken == pairs(9, 8), 'bonds broken in compression')
  end subroutine test_interface

  !> A second body of 5 columns at the right, three times as tough.
  subroutine join_tougher(scene)
    type(scene_type), intent(inout) :: scene
    scene%bodies = [scene%bodies(1), scene%bodies(1)]
    scene%bodies(1)%material = 'steel'
    scene%bodies(2)%name = 'right'
    scene%bodies(2)%material = 'tough'
    scene%bodies(2)%lower(1) = 9*spacing
    scene%bodies(2)%upper(1) = 14*spacing
    scene%bodies(2)%points(1) = 5
    scene%materials = [scene%materials(1), scene%materials(1)]
    scene%materials(2)%name = 'tough'
    scene%materials(2)%critical_stretch = 3*critical
  end subroutine join_tougher

  !> Pairs of points of an nx times ny lattice no further apart than 3 spacings.
  integer(i8) function pairs(nx, ny)
    integer, intent(in) :: nx, ny
    integer :: i, j

    pairs = 0
    do j = -3, 3
      do i = -3, 3
        if (i**2 + j**2 > 9 .or. (i == 0 .and. j == 0)) cycle
        pairs = pairs + max(0, nx - abs(i))*max(0, ny - abs(j))
      end do
    end do
    pairs = pairs/2
  end function pairs

  !> A zone of 3 columns: what is left are the bonds with an end in it, all others go.
  subroutine test_no_fail(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up

    call plate(scene)
    deallocate (scene%no_fail)
    allocate (scene%no_fail(1))
    scene%no_fail(1)%shape = 'box'
    scene%no_fail(1)%upper(1) = 2.5_wp*spacing
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expand(set_up, 2*critical)
    ! the zone's surface goes through the third column, which lies in it
    call expect_true(error, set_up%system%broken == pairs(6, 8), 'bonds outside the zone')
    associate (k => at_point(set_up%system%body, [2.5_wp, 3.5_wp]*spacing), &
      & j => at_point(set_up%system%body, [8.5_wp, 3.5_wp]*spacing))
      call expect(error, set_up%system%state%damage(k), 0.0_wp, 0.0_wp, 'damage in the zone')
      call expect(error, set_up%system%state%damage(j), 1.0_wp, 0.0_wp, 'damage far from it')
    end associate
  end subroutine test_no_fail

  !> The mechanical stretch decides: free expansion by ten times s_c breaks nothing, held heating by
  !> as much presses and breaks nothing, held cooling tears everything.
  subroutine test_thermal(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up

    call plate(scene)
    scene%materials(1)%thermal_expansion = 1.0e-5_wp
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%temperature_change = 10*critical/1.0e-5_wp
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expand(set_up, 10*critical)
    call expect_true(error, set_up%system%broken == 0, 'free expansion')
    call expand(set_up, 0.0_wp)
    call expect_true(error, set_up%system%broken == 0, 'held heating')
    scene%initial(1)%temperature_change = -scene%initial(1)%temperature_change
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expand(set_up, 0.0_wp)
    call expect_true(error, 2*set_up%system%broken == set_up%system%family%n_bonds, 'held cooling')
  end subroutine test_thermal

  subroutine test_counts(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    integer(i8) :: bonds

    call plate(scene)
    call ready(scene, set_up, error)
    if (allocated(error)) return
    bonds = set_up%system%family%n_bonds
    call expect_true(error, bonds == 2*pairs(9, 8), 'ordered pairs')
    deallocate (scene%cracks)
    allocate (scene%cracks(1))
    scene%cracks(1)%from(:2) = [-1.0_wp, 4.0_wp]*spacing
    scene%cracks(1)%to(:2) = [20.0_wp, 4.0_wp]*spacing
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expect_true(error, set_up%system%family%n_bonds == bonds, 'cut bonds count as bonds')
    call expect_true(error, set_up%system%broken == 0 .and. set_up%cut == pairs(9, &
      & 8) - 2*pairs(9, 4), &
      & 'bonds cut')
    call expect_true(error, maxval(set_up%system%state%damage) > 0.3_wp, 'damage of the cut')
    call expand(set_up, 2*critical)
    call expect_true(error, set_up%system%broken == 2*pairs(9, 4), &
      & 'broken ones don''t count the cut')
    call expect(error, minval(set_up%system%state%damage(set_up%system%body%slot)), 1.0_wp, &
      & 0.0_wp, 'damage counts both')
  end subroutine test_counts

  !> All the strain energy there is, theta^2 included, is dissipated when all bonds break at once: W
  !> of uniform expansion is, per point, a theta^2 + b delta s^2 sum |xi| v_c V; here from the sums.
  subroutine test_energy(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp) :: expected, theta, lengths, volumes, xi, vc, strain
    integer :: i, j

    call plate(scene)
    call ready(scene, set_up, error)
    if (allocated(error)) return
    strain = 2*critical
    expected = 0.0_wp
    associate (body => set_up%system%body, m => set_up%system%model%materials(1))
      do i = 1, body%n_points
        lengths = 0.0_wp
        volumes = 0.0_wp
        do j = 1, body%n_points
          xi = norm2(body%x(body%slot(j), :) - body%x(body%slot(i), :))/spacing
          if (i == j .or. xi > 3.015_wp) cycle
          vc = min(1.0_wp, 3.515_wp - xi)
          volumes = volumes + vc*body%volume(body%slot(j))
          lengths = lengths + vc*body%volume(body%slot(j))*xi*spacing
        end do
        theta = m%d*3.015_wp*spacing*strain*volumes
        expected = expected + body%volume(body%slot(i)) &
          & *(m%a*theta**2 + m%b*3.015_wp*spacing*strain**2*lengths)
      end do
    end associate
    call expand(set_up, strain)
    call expect(error, set_up%system%dissipated, expected, 1.0e-12_wp*expected, 'dissipated energy')
  end subroutine test_energy

  !> In the step in which bonds break, dilatation and force are already those without them.
  subroutine test_forces(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: force(:, :)
    integer :: model

    do model = 1, 2
      call plate(scene)
      if (model == 2) scene%materials(1)%model = 'bond_based'
      call ready(scene, set_up, error)
      if (allocated(error)) return
      set_up%system%state%u = 0.5_wp*critical*set_up%system%body%x
      set_up%system%state%u(at_point(set_up%system%body, [4.5_wp, 3.5_wp]*spacing), &
        & 1) = 0.05_wp*spacing
      call evaluate(set_up%system, 0.0_wp, breaking=.true.)
      call expect_true(error, set_up%system%broken > 5, 'no bond broke')
      force = set_up%system%state%force
      call evaluate(set_up%system, 0.0_wp, breaking=.false.)
      call expect_close(error, force, set_up%system%state%force, &
        & 1.0e-12_wp*max_abs(force), &
        & 'force of the step and of a look afterwards')
      call expect(error, sum(force), 0.0_wp, 1.0e-12_wp*sum(abs(force)), 'net force')
    end do
  end subroutine test_forces

  !> Without a critical stretch, or with a zone over everything, there is nothing that looks for it.
  subroutine test_no_breaking(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up

    call box_scene([9, 8], spacing, 0.2_wp, scene)
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expect_true(error, .not. set_up%system%model%breaking, 'a look without critical stretch')
    call expand(set_up, 5.0_wp)
    call expect_true(error, set_up%system%broken == 0, 'broken without critical stretch')
    call plate(scene)
    deallocate (scene%no_fail)
    allocate (scene%no_fail(1))
    scene%no_fail(1)%shape = 'box'
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expect_true(error, .not. set_up%system%model%breaking, &
      & 'a look with a zone over everything')
  end subroutine test_no_breaking

end module test_force_breaking
