!> Points of bodies: lattices, removed shapes, clouds and layers.
module test_body_generate
  use pd_base_kinds, only: wp
  use pd_base_error, only: fault_type => error_type
  use pd_body_body, only: body_type
  use pd_body_generate, only: generate_body
  use pd_body_layers, only: layer_rows
  use pd_scene_content_types, only: scene_type, body_group, boundary_group
  use comparisons, only: expect_close
  use testdrive, only: error_type, new_unittest, unittest_type
  use bodies, only: box_scene, expect, expect_true
  use runs, only: refuse
  use test_scene_expect, only: line
  implicit none (type, external)
  private
  public :: collect_body_generate

contains

  subroutine collect_body_generate(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('lattice points run x fastest, at the centres of cells', test_order), &
      & new_unittest('shapes cut points out', test_removed), &
      & new_unittest('a completely removed body is refused', test_nothing_left), &
      & new_unittest('a body between the centres of cells is refused', test_no_cell), &
      & new_unittest('clouds come from files', test_cloud), &
      & new_unittest('bad clouds are refused', test_bad_cloud), &
      & new_unittest('layers follow the body, group by group', test_layers), &
      & new_unittest('layers continue only the outermost bodies', test_layers_of_bodies), &
      & new_unittest('rows of layers do not depend on rounding', test_rows)]
  end subroutine collect_body_generate

  !> Point (i, j, k), counted from 1, is number i + nx (j - 1) + nx ny (k - 1), at (i - 1/2) dx.
  subroutine test_order(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: count(3) = [5, 4, 3]
    type(scene_type) :: scene
    type(body_type) :: body
    type(fault_type), allocatable :: fault
    real(wp) :: delta, depth
    integer :: dim, i, j, k, n, last(3)

    do dim = 1, 3
      call box_scene(count(:dim), 0.25_wp, 0.3_wp, scene)
      scene%bodies(1)%lower(:dim) = scene%bodies(1)%lower(:dim) + 7
      scene%bodies(1)%upper(:dim) = scene%bodies(1)%upper(:dim) + 7
      call generate_body(scene, body, delta, fault)
      last = 1
      last(:dim) = count(:dim)
      call expect_true(error, body%n_points == product(last), 'number of points')
      n = 0
      do k = 1, last(3)
        do j = 1, last(2)
          do i = 1, last(1)
            n = n + 1
            associate (place => 7 + ([i, j, k] - 0.5_wp)*0.25_wp)
              ! sums of small binary fractions are exact
              call expect_close(error, body%x(n, :), place(:dim), 0.0_wp, &
                & 'position')
            end associate
          end do
        end do
      end do
      depth = 1.0_wp
      if (dim == 1) depth = scene%header%area
      if (dim == 2) depth = scene%header%thickness
      call expect(error, sum(body%volume), depth*product(last)*0.25_wp**dim, &
        & 1.0e-14_wp*product(last), 'volume')
      call expect(error, delta, 3.015_wp*0.25_wp, 1.0e-15_wp, 'horizon')
    end do
  end subroutine test_order

  !> Counts by hand: a sphere holds the centres with |x - c| <= r, its surface included.
  subroutine test_removed(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(body_type) :: body
    type(fault_type), allocatable :: fault
    real(wp) :: delta

    ! spacing 1, centres at half integers, so that offsets from the middle point are integers
    call box_scene([7, 7, 7], 1.0_wp, 0.25_wp, scene)
    deallocate (scene%removed)
    allocate (scene%removed(1))
    scene%removed(1)%shape = 'sphere'
    scene%removed(1)%centre = 3.5_wp
    ! integer triples with a sum of squares up to 5: 1 + 6 + 12 + 8 + 6 + 24; sqrt(5) is not exact
    scene%removed(1)%radius = sqrt(5.0_wp)
    call generate_body(scene, body, delta, fault)
    call expect(error, real(body%n_points, wp), real(343 - 57, wp), 0.0_wp, &
      & 'points around a sphere')
    scene%removed(1)%shape = 'cylinder'
    scene%removed(1)%axis = 'y'
    scene%removed(1)%radius = 2.0_wp
    scene%removed(1)%lower(2) = 1.5_wp
    ! 13 integer pairs with a sum of squares up to 4, in the rows from y = 1.5 to 6.5
    call generate_body(scene, body, delta, fault)
    call expect(error, real(body%n_points, wp), real(343 - 13*6, wp), 0.0_wp, &
      & 'points around a cylinder')
    scene%removed(1)%shape = 'box'
    scene%removed(1)%lower = [0.5_wp, 2.5_wp, 4.0_wp]
    scene%removed(1)%upper = [2.5_wp, 3.5_wp, 5.0_wp]
    call generate_body(scene, body, delta, fault)
    call expect(error, real(body%n_points, wp), real(343 - 3*2*1, wp), 0.0_wp, &
      & 'points around a box')
    ! order is kept: the first point left of the first row is the fourth of its kind
    scene%removed(1)%lower = 0.0_wp
    call generate_body(scene, body, delta, fault)
    call expect(error, body%x(1, 1), 3.5_wp, 0.0_wp, 'first point left')
    ! in a plane a sphere is a disc
    call box_scene([7, 7], 1.0_wp, 0.3_wp, scene)
    deallocate (scene%removed)
    allocate (scene%removed(1))
    scene%removed(1)%shape = 'sphere'
    scene%removed(1)%centre(:2) = 3.5_wp
    scene%removed(1)%radius = sqrt(2.0_wp)
    call generate_body(scene, body, delta, fault)
    call expect(error, real(body%n_points, wp), real(49 - 9, wp), 0.0_wp, 'points around a disc')
  end subroutine test_removed

  subroutine test_nothing_left(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(body_type) :: body
    type(fault_type), allocatable :: fault
    real(wp) :: delta

    call box_scene([4, 4], 1.0_wp, 0.3_wp, scene)
    deallocate (scene%removed)
    allocate (scene%removed(1))
    scene%removed(1)%shape = 'box'
    call generate_body(scene, body, delta, fault)
    call expect_true(error, allocated(fault), 'a body without points was accepted')
    if (allocated(error)) return
    call expect_true(error, index(fault%message, 'no points') > 0, 'message: '//fault%message)
  end subroutine test_nothing_left

  !> A shape between the centres of cells holds no point, beside a body with points or alone.
  subroutine test_no_cell(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: head = '&scene dimension = 3 /'//line// &
      & '&material youngs_modulus = 1 density = 1 poissons_ratio = 0.25 /'//line// &
      & '&time steps = 1 /'//line
    character(*), parameter :: disc = "&body name = 'disc' shape = 'cylinder' spacing = 1 "// &
      & 'radius = 0.1 height = 1 /'//line

    call refuse(error, head//disc, "the body 'disc' has no points|:4")
    call refuse(error, head//'&body lower = 2 0 0 upper = 6 4 4 points = 4 4 4 /'//line//disc, &
      & "the body 'disc' has no points|:5")
  end subroutine test_no_cell

  !> A cloud's spacing is what makes its volume a square: sqrt(V/h).
  subroutine test_cloud(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(body_type) :: body
    type(fault_type), allocatable :: fault
    real(wp) :: delta

    call write_cloud([character(22) :: '# x y z volume', &
      & '0.0 0.0 9.0 2.0e-3', '1.0, 0.25, 9, 8.0e-3'])
    call cloud_scene(scene)
    call generate_body(scene, body, delta, fault)
    if (allocated(fault)) then
      call expect_true(error, .false., fault%message)
      return
    end if
    call expect_true(error, body%n_points == 2, 'points of the cloud')
    if (allocated(error)) return
    call expect_close(error, body%x(2, :), [1.0_wp, 0.25_wp], 0.0_wp, 'position')
    call expect(error, body%volume(2), 8.0e-3_wp, 0.0_wp, 'volume')
    call expect(error, body%spacing(1), 1.0_wp, 1.0e-15_wp, 'spacing of the first')
    call expect(error, body%spacing(2), 2.0_wp, 1.0e-15_wp, 'spacing of the second')
    call expect(error, delta, 3.015_wp*2, 1.0e-14_wp, 'the largest spacing makes the horizon')
    call remove_cloud()
  end subroutine test_cloud

  subroutine test_bad_cloud(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call cloud_scene(scene)
    call remove_cloud()
    call expect_refused(scene, 'cannot find', error)
    call write_cloud(['0 0 0 1.0 ', '1 0 0 -1.0'])
    call expect_refused(scene, 'positive volume', error)
    call write_cloud(['0 0 0     '])
    call expect_refused(scene, ':1', error)
    call write_cloud(['0 0 zero 1'])
    call expect_refused(scene, 'zero', error)
    call write_cloud(['0 0 0 1   ', '1 0 0.1 1 '])
    call expect_refused(scene, 'no direction z', error)
    call write_cloud(['# nothing '])
    call expect_refused(scene, 'no rows', error)
    call remove_cloud()
  end subroutine test_bad_cloud

  !> The scene must be refused with `word` in the message.
  subroutine expect_refused(scene, word, error)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: word
    type(error_type), allocatable, intent(inout) :: error
    type(body_type) :: body
    type(fault_type), allocatable :: fault
    real(wp) :: delta

    if (allocated(error)) return
    call generate_body(scene, body, delta, fault)
    call expect_true(error, allocated(fault), 'a bad cloud was accepted; expected: '//word)
    if (allocated(error)) return
    call expect_true(error, index(fault%message, word) > 0, 'expected '//word//' in: ' &
      & //fault%message)
  end subroutine expect_refused

  subroutine cloud_scene(scene)
    type(scene_type), intent(out) :: scene

    call box_scene([2, 2], 1.0_wp, 0.3_wp, scene)
    scene%bodies(1) = body_group()
    scene%bodies(1)%file = 'test-cloud.txt'
  end subroutine cloud_scene

  subroutine write_cloud(lines)
    character(*), intent(in) :: lines(:)
    integer :: unit, i

    open (newunit=unit, file='test-cloud.txt', status='replace', action='write')
    write (unit, '(a)') (trim(lines(i)), i=1, size(lines))
    close (unit)
  end subroutine write_cloud

  subroutine remove_cloud()
    integer :: unit
    open (newunit=unit, file='test-cloud.txt')
    close (unit, status='delete')
  end subroutine remove_cloud

  !> Three rows outside each face at ratio 3.015, without corners, in the order of the groups; the
  !> layer's points run x fastest too, and continue the grid and the material.
  subroutine test_layers(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(body_type) :: body
    type(fault_type), allocatable :: fault
    real(wp) :: delta

    call box_scene([5, 4], 1.0_wp, 0.3_wp, scene)
    deallocate (scene%boundaries)
    allocate (scene%boundaries(3))
    scene%boundaries(1)%side = 'y_max'
    scene%boundaries(2)%region = 'elsewhere'
    scene%boundaries(3)%side = 'x_min'
    call generate_body(scene, body, delta, fault)
    call expect_true(error, body%n_points == 20 + 3*5 + 3*4, 'points with layers')
    if (allocated(error)) return
    call expect_true(error, all(body%layer(:20) == 0) .and. all(body%layer(21:35) == 1) &
      & .and. all(body%layer(36:) == 3), 'layers are numbered by their groups')
    call expect_close(error, body%x(21, :), [0.5_wp, 4.5_wp], 0.0_wp, &
      & 'first of the top')
    call expect_close(error, body%x(35, :), [4.5_wp, 6.5_wp], 0.0_wp, &
      & 'last of the top')
    call expect_close(error, body%x(36, :), [-2.5_wp, 0.5_wp], 0.0_wp, &
      & 'first at the left')
    call expect_close(error, body%x(47, :), [-0.5_wp, 3.5_wp], 0.0_wp, &
      & 'last at the left')
    call expect_true(error, all(body%material == 1) .and. all(body%body == 1) .and. &
      & all(body%grid == body%grid(1)), 'a layer continues its body')
  end subroutine test_layers

  !> Of two bodies in a row, each of its own material, only the outer one gets a layer, unless the
  !> inner one is named; then a layer may lie between them only if there is room.
  subroutine test_layers_of_bodies(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(body_type) :: body
    type(fault_type), allocatable :: fault
    type(body_group) :: group
    real(wp) :: delta

    call box_scene([5, 4], 1.0_wp, 0.3_wp, scene)
    group = scene%bodies(1)
    deallocate (scene%bodies)
    allocate (scene%bodies(2))
    scene%bodies(1) = group
    scene%bodies(1)%material = 'steel'
    scene%bodies(2) = group
    scene%bodies(2)%name = 'other'
    scene%bodies(2)%material = 'brass'
    scene%bodies(2)%lower(1) = 5.0_wp
    scene%bodies(2)%upper(1) = 10.0_wp
    call two_materials(scene)
    deallocate (scene%boundaries)
    allocate (scene%boundaries(1))
    scene%boundaries(1)%side = 'x_max'
    call generate_body(scene, body, delta, fault)
    call expect_true(error, body%n_points == 40 + 12, 'points of two bodies and a layer')
    if (allocated(error)) return
    call expect_true(error, all(body%body(41:) == 2) .and. all(body%material(41:) == 2), &
      & 'the layer is the outer body''s')
    call expect(error, minval(body%x(41:, 1)), 10.5_wp, 0.0_wp, 'the layer''s first row')
    scene%boundaries(1)%side = 'y_min'
    call generate_body(scene, body, delta, fault)
    call expect_true(error, body%n_points == 40 + 30, 'a common face has a layer along both bodies')
    if (allocated(error)) return
    call expect_true(error, count(body%material(41:) == 1) == 15, 'each continues its own material')
    scene%boundaries(1)%body = 'box'
    call generate_body(scene, body, delta, fault)
    call expect_true(error, body%n_points == 40 + 15 .and. all(body%body(41:) == 1), &
      & 'the named body''s layer alone')
  end subroutine test_layers_of_bodies

  subroutine two_materials(scene)
    type(scene_type), intent(inout) :: scene
    scene%materials = [scene%materials(1), scene%materials(1)]
    scene%materials(2)%name = 'brass'
  end subroutine two_materials

  !> delta exactly 3 spacings is 3 rows, whatever the rounding of delta and spacing.
  subroutine test_rows(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: spacing
    integer :: i

    do i = 1, 200
      spacing = 0.1_wp/i
      call expect_true(error, layer_rows(3*spacing, spacing) == 3, 'exactly three')
      call expect_true(error, layer_rows(nearest(3*spacing, -1.0_wp), spacing) == 3, &
        & 'three less rounding')
      call expect_true(error, layer_rows(3.015_wp*spacing, spacing) == 3, 'the usual ratio')
      call expect_true(error, layer_rows(2.99_wp*spacing, spacing) == 2, 'just below')
    end do
  end subroutine test_rows

end module test_body_generate
