!> Points that come too close without a bond between them.
module test_output_report_contact
  use pd_base_kinds, only: wp
  use pd_set_up_prepare, only: set_up_type
  use pd_family_family, only: bonds_type, allocate_bonds
  use pd_output_report_contact, only: touching_points
  use pd_scene_content_types, only: scene_type
  use testdrive, only: check, error_type, new_unittest, unittest_type
  use bodies, only: at_point, box_scene, ready
  implicit none (type, external)
  private
  public :: collect_output_report_contact

  real(wp), parameter :: spacing = 1.0e-2_wp

  !> Both kinds of families: what they call a bond must not matter.
  character(8), parameter :: kinds(*) = [character(8) :: 'lattice', 'list']

contains

  subroutine collect_output_report_contact(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('no contact in the undeformed body', test_rest), &
      & new_unittest('a body that meets another is found', test_bodies), &
      & new_unittest('the mean spacing counts', test_spacings), &
      & new_unittest('intact neighbours may come close, broken ones not', test_crushed), &
      & new_unittest('a body may touch itself', test_folded)]
  end subroutine collect_output_report_contact

  !> Two plates of 6 x 5 points, the second as fine as asked for, with a gap of 10 spacings; their
  !> lower rows are in line.
  subroutine two_plates(kind, finer, scene)
    character(*), intent(in) :: kind
    real(wp), intent(in) :: finer
    type(scene_type), intent(out) :: scene

    call box_scene([6, 5], spacing, 0.2_wp, scene)
    scene%horizon%family = kind
    scene%bodies = [scene%bodies(1), scene%bodies(1)]
    scene%bodies(2)%name = 'second'
    scene%bodies(2)%lower(:2) = [16.0_wp, 0.5_wp - finer/2]*spacing
    scene%bodies(2)%upper(:2) = scene%bodies(2)%lower(:2) + [6, 5]*finer*spacing
  end subroutine two_plates

  !> Hold what is found to a pair of points, 0 and 0 for none.
  subroutine expect_pair(error, set_up, u, first, second, what)
    type(error_type), allocatable, intent(inout) :: error
    type(set_up_type), intent(in) :: set_up
    real(wp), intent(in) :: u(:, :)
    integer, intent(in) :: first, second
    character(*), intent(in) :: what
    integer :: found(2)

    if (allocated(error)) return
    call touching_points(set_up%system%body, set_up%system%family, u, found(1), found(2))
    call check(error, found(1), first, what//': first point')
    if (allocated(error)) return
    call check(error, found(2), second, what//': second point')
  end subroutine expect_pair

  subroutine test_rest(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    integer :: kind, dim

    do kind = 1, size(kinds)
      do dim = 1, 3
        call box_scene(spread(6, 1, dim), spacing, 0.2_wp, scene)
        scene%horizon%family = kinds(kind)
        call ready(scene, set_up, error)
        if (allocated(error)) return
        call expect_pair(error, set_up, 0*set_up%system%body%x, 0, 0, 'a box')
      end do
      call two_plates(kinds(kind), 1.0_wp, scene)
      scene%bodies(2)%lower(1) = 6*spacing
      scene%bodies(2)%upper(1) = 12*spacing
      ! a crack parts them, so that no bond excuses their nearness
      deallocate (scene%cracks)
      allocate (scene%cracks(1))
      scene%cracks(1)%from(:2) = [6.0_wp, -1.0_wp]*spacing
      scene%cracks(1)%to(:2) = [6.0_wp, 6.0_wp]*spacing
      call ready(scene, set_up, error)
      if (allocated(error)) return
      call expect_pair(error, set_up, 0*set_up%system%body%x, 0, 0, 'plates side by side')
    end do
  end subroutine test_rest

  !> The distance of the facing columns is 11 spacings. Points are numbered x fastest: the first
  !> that meets another is the sixth, and the first of the second plate is number 31.
  subroutine test_bodies(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: u(:, :)
    integer :: kind

    do kind = 1, size(kinds)
      call two_plates(kinds(kind), 1.0_wp, scene)
      call ready(scene, set_up, error)
      if (allocated(error)) return
      associate (body => set_up%system%body)
        u = 0*body%x
        where (body%body == 2) u(:, 1) = -10.49_wp*spacing
        call expect_pair(error, set_up, u, 0, 0, 'a little more than half a spacing')
        where (body%body == 2) u(:, 1) = -10.51_wp*spacing
        call expect_pair(error, set_up, u, 6, 31, 'a little less')
        where (body%body == 2) u(:, 1) = -11.0_wp*spacing
        call expect_pair(error, set_up, u, 6, 31, 'on top of each other')
        ! the second plate's fourth row onto the first one's lowest
        where (body%body == 2) u(:, 2) = -3.0_wp*spacing
        call expect_pair(error, set_up, u, 6, 31 + 3*6, 'shifted down')
        ! through and beyond: the plates lie on each other
        where (body%body == 2) u(:, 1) = -16.0_wp*spacing
        where (body%body == 2) u(:, 2) = 0.0_wp
        call expect_pair(error, set_up, u, 1, 31, 'one plate in the other')
        where (body%body == 2) u(:, 1) = -30.0_wp*spacing
        call expect_pair(error, set_up, u, 0, 0, 'passed through')
      end associate
    end do
  end subroutine test_bodies

  !> With spacings 1 and 0.5 a distance below (1 + 0.5)/4 is too close. The facing columns are
  !> 10.75 apart.
  subroutine test_spacings(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: u(:, :)
    integer :: kind

    do kind = 1, size(kinds)
      call two_plates(kinds(kind), 0.5_wp, scene)
      call ready(scene, set_up, error)
      if (allocated(error)) return
      associate (body => set_up%system%body)
        u = 0*body%x
        where (body%body == 2) u(:, 1) = -(10.75_wp - 0.376_wp)*spacing
        call expect_pair(error, set_up, u, 0, 0, 'a little more')
        where (body%body == 2) u(:, 1) = -(10.75_wp - 0.374_wp)*spacing
        call expect_pair(error, set_up, u, 6, 31, 'a little less')
      end associate
    end do
  end subroutine test_spacings

  !> A bar pressed together to a third: neighbours are a third of a spacing apart. Only where the
  !> bond of points 4 and 5 is broken has anybody to be told.
  subroutine test_crushed(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: u(:, :)
    integer :: kind, four, five

    do kind = 1, size(kinds)
      call box_scene([12], spacing, 0.2_wp, scene)
      scene%horizon%family = kinds(kind)
      scene%materials(1)%critical_stretch = 1.0e-3_wp
      call ready(scene, set_up, error)
      if (allocated(error)) return
      associate (system => set_up%system)
        u = -2*system%body%x/3
        call expect_pair(error, set_up, u, 0, 0, 'intact')
        four = at_point(system%body, [3.5_wp*spacing])
        five = at_point(system%body, [4.5_wp*spacing])
        call cut(four, five)
        call cut(five, four)
        call expect_pair(error, set_up, u, 4, 5, 'broken')
        call expect_pair(error, set_up, 0*u, 0, 0, 'broken, at rest')
      end associate
    end do

  contains

    !> Break one direction of a bond.
    subroutine cut(k, j)
      integer, intent(in) :: k, j
      type(bonds_type) :: bonds
      call allocate_bonds(set_up%system%family, bonds)
      call set_up%system%family%bonds_of(k, bonds)
      call set_up%system%family%break_bond(k, findloc(bonds%j(:bonds%n) == j, .true., dim=1))
    end subroutine cut
  end subroutine test_crushed

  !> A strip of one row bent into a hairpin: its last point comes to lie upon its first, far beyond
  !> the horizon at rest.
  subroutine test_folded(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: u(:, :)
    integer :: kind, i, k

    do kind = 1, size(kinds)
      call box_scene([20, 1], spacing, 0.2_wp, scene)
      scene%horizon%family = kinds(kind)
      call ready(scene, set_up, error)
      if (allocated(error)) return
      associate (body => set_up%system%body)
        u = 0*body%x
        do i = 11, 20
          k = body%slot(i)
          u(k, 1) = (21 - 2*i)*spacing
          u(k, 2) = 0.6_wp*spacing
        end do
        call expect_pair(error, set_up, u, 0, 0, 'a hairpin with a gap')
        u(body%slot(20), 2) = 0.4_wp*spacing
        call expect_pair(error, set_up, u, 1, 20, 'a closed hairpin')
      end associate
    end do
  end subroutine test_folded

end module test_output_report_contact
