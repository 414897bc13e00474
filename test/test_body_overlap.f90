!> Bodies that overlap, and bodies that only touch.
module test_body_overlap
  use pd_base_kinds, only: wp
  use pd_base_error, only: fault_type => error_type
  use pd_set_up_prepare, only: set_up_type
  use pd_scene_content_types, only: scene_type, body_group
  use testdrive, only: error_type, new_unittest, unittest_type
  use bodies, only: prepare_run, box_scene, expect_true
  implicit none (type, external)
  private
  public :: collect_body_overlap

  character(*), parameter :: clouds(2) = ['test-overlap-1.txt', 'test-overlap-2.txt']

contains

  subroutine collect_body_overlap(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a point of one lattice in another is an overlap', test_lattices), &
      & new_unittest('lattices of different spacing', test_spacings), &
      & new_unittest('cells that were removed are free', test_hole), &
      & new_unittest('points of clouds may be close, but not coincide', test_clouds)]
  end subroutine collect_body_overlap

  !> Two boxes of 6 cells along each axis, the second one shifted. Depth by which the second one's
  !> first points lie in the first body: 5.5 - shift along every axis; from 1e-6 on they overlap.
  subroutine test_lattices(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: shifts(3, 12) = reshape([ &
      & 0.0_wp, 0.0_wp, 0.0_wp,   1.0_wp, 0.0_wp, 0.0_wp,   0.5_wp, 0.5_wp, 0.5_wp, &
      & 3.5_wp, 2.5_wp, 1.5_wp,   5.0_wp, 5.0_wp, 5.0_wp,   5.3_wp, 0.2_wp, 0.4_wp, &
      & 5.5_wp - 1.0e-5_wp, 0.5_wp, 0.0_wp, &
      & 5.5_wp, 0.0_wp, 0.0_wp,   5.5_wp, 0.5_wp, 0.5_wp,   5.6_wp, 0.3_wp, 0.1_wp, &
      & 6.0_wp, 0.0_wp, 0.0_wp,   6.0_wp, 0.5_wp, 0.3_wp], [3, 12])
    type(scene_type) :: scene
    integer :: dim, i, sign

    do dim = 1, 3
      do i = 1, size(shifts, 2)
        do sign = -1, 1, 2
          call box_scene([6, 6, 6], 1.0_wp, 0.25_wp, scene)
          scene%header%dimension = dim
          scene%bodies = [scene%bodies(1), scene%bodies(1)]
          scene%bodies(2)%name = 'other'
          scene%bodies(2)%lower = scene%bodies(2)%lower + sign*shifts(:, i)
          scene%bodies(2)%upper = scene%bodies(2)%upper + sign*shifts(:, i)
          call judge(scene, i <= 7, 'body 1 ''box'' and body 2 ''other'' overlap', error)
        end do
      end do
    end do
  end subroutine test_lattices

  !> A coarse body on fine ones: what counts are the points of both in the cells of both.
  subroutine test_spacings(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    integer :: i

    do i = 1, 2
      ! 2 x 2 cells of 3, and 4 x 4 of 1 in one cell of these, at no point of it
      call box_scene([2, 2], 3.0_wp, 0.25_wp, scene)
      scene%bodies = [scene%bodies(1), scene%bodies(1)]
      scene%bodies(2)%name = 'fine'
      scene%bodies(2)%points(1:2) = 4
      scene%bodies(2)%lower(1:2) = [2.1_wp, 5.6_wp]
      scene%bodies(2)%upper(1:2) = [6.1_wp, 9.6_wp]
      ! with the fine points 0.1 above the coarse cells they touch as far as points go
      if (i == 2) scene%bodies(2)%lower(2) = 5.4_wp
      if (i == 2) scene%bodies(2)%upper(2) = 9.4_wp
      call judge(scene, i == 2, 'overlap', error)
      ! in the other order
      scene%bodies = scene%bodies(2:1:-1)
      call judge(scene, i == 2, 'overlap', error)
    end do
  end subroutine test_spacings

  !> A fine body fills the room of four coarse cells that shapes have taken; one that is a cell
  !> larger does not fit.
  subroutine test_hole(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    integer :: larger

    do larger = 0, 1
      call box_scene([6, 6], 1.0_wp, 0.25_wp, scene)
      scene%bodies = [scene%bodies(1), scene%bodies(1)]
      scene%bodies(2)%name = 'plug'
      deallocate (scene%removed)
      allocate (scene%removed(4))
      ! small shapes around the centres of four cells, between the plug's points
      scene%removed%shape = 'sphere'
      scene%removed%radius = 0.01_wp
      scene%removed(1)%centre(1:2) = [2.5_wp, 2.5_wp]
      scene%removed(2)%centre(1:2) = [3.5_wp, 2.5_wp]
      scene%removed(3)%centre(1:2) = [2.5_wp, 3.5_wp]
      scene%removed(4)%centre(1:2) = [3.5_wp, 3.5_wp]
      scene%bodies(2)%points(1:2) = 8 + 2*larger
      scene%bodies(2)%lower(1:2) = 2.0_wp - 0.25_wp*larger
      scene%bodies(2)%upper(1:2) = 4.0_wp + 0.25_wp*larger
      call judge(scene, larger == 1, 'body 1 ''box'' and body 2 ''plug'' overlap', error)
    end do
  end subroutine test_hole

  !> Two clouds whose points interlock at a third of a spacing, as the centroids of tetrahedra may:
  !> accepted, as is a lattice with a cloud. Points in one place are refused, of one cloud, of two,
  !> or of a cloud and a lattice.
  subroutine test_clouds(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: shifts(*) = [0.3_wp, 1.0e-5_wp, 0.0_wp, 1.0e-7_wp]
    type(scene_type) :: scene
    integer :: i, with_lattice

    do with_lattice = 0, 1
      do i = 1, size(shifts)
        call box_scene([4, 4], 1.0_wp, 0.25_wp, scene)
        call write_cloud(clouds(1), 0.0_wp)
        call write_cloud(clouds(2), shifts(i))
        scene%bodies = [scene%bodies(1), body_group()]
        scene%bodies(2)%name = 'cloud'
        scene%bodies(2)%file = clouds(2)
        if (with_lattice == 0) then
          scene%bodies(1) = body_group()
          scene%bodies(1)%file = clouds(1)
        end if
        call judge(scene, i > 2, 'points of bodies 1 and 2 coincide', error)
      end do
    end do
    scene%bodies = scene%bodies(2:2)
    call write_cloud(clouds(2), 0.0_wp, twice=.true.)
    call judge(scene, .true., 'two points of body 1 coincide', error)
    call write_cloud(clouds(1), delete=.true.)
    call write_cloud(clouds(2), delete=.true.)
  end subroutine test_clouds

  !> 16 points at the centres of cells, shifted along x; the first one twice; or no file at all.
  subroutine write_cloud(file, shift, twice, delete)
    character(*), intent(in) :: file
    real(wp), intent(in), optional :: shift
    logical, intent(in), optional :: twice, delete
    integer :: unit, i, j

    open (newunit=unit, file=file)
    if (present(delete)) then
      close (unit, status='delete')
      return
    end if
    do j = 1, 4
      do i = 1, 4
        write (unit, '(2(f0.9, 1x), a)') i - 0.5_wp + shift, j - 0.5_wp, '0 2.0e-3'
      end do
    end do
    if (present(twice)) write (unit, '(a)') '0.5 0.5 0 2.0e-3'
    close (unit)
  end subroutine write_cloud

  !> The scene must be refused in these words, or accepted.
  subroutine judge(scene, overlaps, words, error)
    type(scene_type), intent(in) :: scene
    logical, intent(in) :: overlaps
    character(*), intent(in) :: words
    type(error_type), allocatable, intent(inout) :: error
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    call prepare_run(scene, set_up, fault)
    if (.not. overlaps) then
      if (.not. allocated(fault)) return
      call expect_true(error, .false., 'refused: '//fault%message)
      return
    end if
    call expect_true(error, allocated(fault), 'accepted; expected: '//words)
    if (allocated(error)) return
    call expect_true(error, index(fault%message, words) > 0 .and. &
      & index(fault%message, '&body number') > 0, 'expected '//words//' in: '//fault%message)
  end subroutine judge

end module test_body_overlap
