!> Layers: where they start on sides that are whole, cut, curved or shared by bodies, and what is
!> refused.
module test_body_layers
  use pd_base_kinds, only: wp
  use pd_base_error, only: fault_type => error_type
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type, gather
  use pd_body_generate, only: generate_body
  use pd_body_layers, only: layer_count_type, layer_count_text
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_scene_content_types, only: scene_type, body_group, shape_group, unset
  use testdrive, only: error_type, new_unittest, unittest_type, test_failed
  use bodies, only: box_scene, diary_type, expect, expect_true, ready_alone, youngs_modulus
  implicit none (type, external)
  private
  public :: collect_body_layers

  character(5), parameter :: sides(6) = ['x_min', 'x_max', 'y_min', 'y_max', 'z_min', 'z_max']

contains

  subroutine collect_body_layers(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a body cut to size has the layers of a smaller one', test_cut), &
      & new_unittest('a cut strip has the exact reaction', test_pull), &
      & new_unittest('reactions of layers on all sides', test_reactions), &
      & new_unittest('columns at holes and curved sides start correctly', test_columns), &
      & new_unittest('columns without a layer are counted', test_counts), &
      & new_unittest('at a cut corner the earlier layer has the cells', test_corner), &
      & new_unittest('only the outermost of several bodies has a layer', test_cover), &
      & new_unittest('layers without bonds, or that overlap, are refused', test_refused), &
      & new_unittest('initial states and no-fail shapes hold for layers', test_state)]
  end subroutine collect_body_layers

  !> A body of n + 3 cells along one axis, three of them removed, on either side, is the body of n
  !> cells: the same points, layers included.
  subroutine test_cut(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: count(3) = [7, 5, 6]
    type(scene_type) :: scene, small
    type(body_type) :: cut, whole
    type(fault_type), allocatable :: fault
    real(wp) :: delta
    integer :: dim, axis, at_lower

    do dim = 1, 3
      do axis = 1, dim
        do at_lower = 0, 1
          ! small binary fractions, so that both ways give the same positions
          call box_scene(count(:dim), 0.25_wp, 0.3_wp, small)
          scene = small
          scene%bodies(1)%points(axis) = count(axis) + 3
          deallocate (scene%removed)
          allocate (scene%removed(1))
          scene%removed(1)%shape = 'box'
          if (at_lower == 1) then
            scene%bodies(1)%lower(axis) = -0.75_wp
            scene%removed(1)%upper(axis) = 0.0_wp
          else
            scene%bodies(1)%upper(axis) = 0.25_wp*(count(axis) + 3)
            scene%removed(1)%lower(axis) = 0.25_wp*count(axis)
          end if
          call layered(scene, 2*dim)
          call layered(small, 2*dim)
          call generate_body(scene, cut, delta, fault)
          if (allocated(fault)) call test_failed(error, fault%message)
          call generate_body(small, whole, delta, fault)
          if (allocated(fault)) call test_failed(error, fault%message)
          if (allocated(error)) return
          call expect_true(error, cut%n_points == whole%n_points, 'number of points')
          if (allocated(error)) return
          call expect_true(error, all(abs(cut%x - whole%x) <= 0.0_wp), 'positions')
          call expect_true(error, all(abs(cut%volume - whole%volume) <= 0.0_wp) .and. &
            & all(cut%layer == whole%layer) .and. all(cut%material == whole%material) .and. &
            & all(cut%body == whole%body) .and. all(cut%grid == whole%grid), 'numbers')
        end do
      end do
    end do
  end subroutine test_cut

  !> A strip of 40 x 20 cells, its last four columns removed, pulled by layers: the force is that of
  !> the strip of 36 columns, up to the solver's tolerance, and E A U/L up to the method's error on
  !> 20 points (5 %; 1.6 % is measured).
  subroutine test_pull(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: dx = 0.025_wp, jump = 1.0e-3_wp
    type(scene_type) :: scene
    real(wp) :: force(2)
    integer :: i

    do i = 1, 2
      call box_scene([merge(40, 36, i == 1), 20], dx, 0.3_wp, scene)
      scene%horizon%surface_correction = 'energy'
      if (i == 1) then
        deallocate (scene%removed)
        allocate (scene%removed(1))
        scene%removed(1)%shape = 'box'
        scene%removed(1)%lower(1) = 0.9_wp
      end if
      call layered(scene, 2)
      scene%boundaries(1)%displacement(1) = 0.0_wp
      scene%boundaries(2)%displacement(1) = jump
      scene%time%method = 'relaxation'
      scene%relaxation%solver = 'conjugate_gradient'
      scene%relaxation%tolerance = 1.0e-9_wp
      force(i) = pull_of(scene, jump, error)
      if (allocated(error)) return
    end do
    call expect(error, force(1), force(2), 1.0e-6_wp*force(2), 'the strip that needs no cut')
    associate (exact => youngs_modulus*20*dx*scene%header%thickness*jump/(36*dx))
      call expect(error, force(1), exact, 0.05_wp*exact, 'E A U/L')
    end associate
  end subroutine test_pull

  !> The force at the end of a linear pull by `jump`: 2 W/U [N].
  real(wp) function pull_of(scene, jump, error) result(force)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: jump
    type(error_type), allocatable, intent(inout) :: error
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault

    force = 0.0_wp
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    diary%every = 0
    call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    force = 2*diary%strain(diary%n)/jump
  end function pull_of

  !> A square of 20 x 20 points held at equal strain in both directions by layers on all sides. The
  !> reactions exceed the exact ones, E eps/(1 - nu) over a side, as doc/theory.md, 10, explains: by
  !> 1.0893 in the equations of small strain, assembled and solved elsewhere by a sparse direct
  !> solver. The strain of 1e-4 and the rounding of that number allow 2e-4.
  subroutine test_reactions(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: strain = 1.0e-4_wp, factor = 1.0893_wp
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    type(fault_type), allocatable :: fault
    real(wp) :: exact
    integer :: s, axis

    call box_scene([20, 20], 0.05_wp, 0.3_wp, scene)
    scene%horizon%surface_correction = 'energy'
    call layered(scene, 4)
    do s = 1, 4
      scene%boundaries(s)%displacement = unset
      scene%boundaries(s)%velocity(1:2) = 0.0_wp
    end do
    deallocate (scene%initial)
    allocate (scene%initial(1))
    scene%initial(1)%displacement_gradient(1, 1) = strain
    scene%initial(1)%displacement_gradient(2, 2) = strain
    scene%time%method = 'relaxation'
    scene%relaxation%solver = 'conjugate_gradient'
    scene%relaxation%tolerance = 1.0e-8_wp
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    call run_relaxation(set_up%system, set_up%plan%relaxation, diary, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    exact = youngs_modulus*strain/0.7_wp*scene%header%thickness
    do s = 1, 4
      axis = (s + 1)/2
      call expect(error, set_up%system%motions(s)%reaction(axis), (2*modulo(s - 1, 2) - 1)*factor &
        & *exact, 2.0e-4_wp*exact, 'reaction at '//sides(s))
    end do
  end subroutine test_reactions

  !> Bodies with holes, steps and round corners, against the rule as it is written: of all points of
  !> a column, the outermost; if no column ends further out by more than delta, three points follow.
  subroutine test_columns(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(body_type) :: body
    type(fault_type), allocatable :: fault
    type(layer_count_type), allocatable :: counts(:)
    real(wp) :: delta, outermost, top, wanted(3)
    integer :: dim, kind, s, axis, outward, k, j, r, n, n_body

    do dim = 1, 3
      do kind = 1, 3
        do s = 1, 2*dim
          call box_scene([15, 12, 10], 1.0_wp, 0.3_wp, scene)
          scene%header%dimension = dim
          call shapes(kind, dim, scene)
          deallocate (scene%boundaries)
          allocate (scene%boundaries(1))
          scene%boundaries(1)%side = sides(s)
          call generate_body(scene, body, delta, fault, counts)
          if (allocated(fault)) call test_failed(error, fault%message)
          if (allocated(error)) return
          axis = (s + 1)/2
          outward = 2*modulo(s - 1, 2) - 1
          n_body = count(body%layer == 0)
          outermost = maxval(outward*body%x(:n_body, axis))
          n = 0
          do k = 1, n_body
            top = -huge(top)
            do j = 1, n_body
              if (sum(abs(body%x(j, :) - body%x(k, :))) - abs(body%x(j, axis) - body%x(k, axis)) &
                & > 0.1_wp) cycle
              top = max(top, outward*body%x(j, axis))
            end do
            if (outward*body%x(k, axis) < top - 0.5_wp .or. outermost - top > delta) cycle
            n = n + 1
            do r = 1, 3
              wanted = 0.0_wp
              wanted(:dim) = body%x(k, :)
              wanted(axis) = wanted(axis) + outward*r
              call expect_true(error, any([(all(abs(body%x(j, :) - wanted(:dim)) <= 1.0e-12_wp), &
                & j=n_body + 1, body%n_points)]), 'a point of the layer is missing')
            end do
          end do
          call expect_true(error, body%n_points == n_body + 3*n, 'points of the layer')
          call expect_true(error, counts(1)%columns == n, 'columns of the layer')
          call expect_true(error, all(body%layer(n_body + 1:) == 1), 'their numbers')
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_columns

  !> What is removed: two balls at sides, steps, or a ball at a corner.
  subroutine shapes(kind, dim, scene)
    integer, intent(in) :: kind, dim
    type(scene_type), intent(inout) :: scene
    type(shape_group) :: ball, box
    integer :: i

    deallocate (scene%removed)
    ball%shape = 'sphere'
    ball%radius = 3.3_wp
    box%shape = 'box'
    select case (kind)
    case (1)
      ball%centre = [6.2_wp, 12.0_wp, 5.1_wp]
      scene%removed = [ball, ball]
      scene%removed(2)%centre = [15.0_wp, 3.3_wp, 10.0_wp]
    case (2)
      allocate (scene%removed(0))
      do i = 1, 4
        ! x from 0 to i, everything else from 0 to 2 (5 - i): steps of one cell and more
        box%upper(:dim) = 2.0_wp*(5 - i)
        box%upper(1) = real(i, wp)
        scene%removed = [scene%removed, box]
      end do
    case default
      ball%radius = 5.7_wp
      ball%centre = 0.0_wp
      scene%removed = [ball]
    end select
  end subroutine shapes

  !> Boundaries on the first sides, all of one kind.
  subroutine layered(scene, n)
    type(scene_type), intent(inout) :: scene
    integer, intent(in) :: n
    integer :: s

    deallocate (scene%boundaries)
    allocate (scene%boundaries(n))
    do s = 1, n
      scene%boundaries(s)%side = sides(s)
      scene%boundaries(s)%displacement(1) = 0.0_wp
    end do
  end subroutine layered

  !> 10 columns: 2 are empty, 3 begin 5 cells in, 1 begins 2 cells in. On a whole side there is
  !> nothing to say.
  subroutine test_counts(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(body_type) :: body
    type(layer_count_type), allocatable :: counts(:)

    call box_scene([8, 10], 1.0_wp, 0.3_wp, scene)
    call layered(scene, 2)
    call generate(scene, body, counts, error)
    if (allocated(error)) return
    call expect_true(error, layer_count_text(scene, counts(1)) == '', 'a whole side')
    deallocate (scene%removed)
    allocate (scene%removed(3))
    scene%removed%shape = 'box'
    scene%removed(1)%upper(2) = 2.0_wp
    scene%removed(2)%lower(2) = 2.0_wp
    scene%removed(2)%upper(1:2) = 5.0_wp
    scene%removed(3)%lower(2) = 9.0_wp
    scene%removed(3)%upper(1) = 2.0_wp
    call generate(scene, body, counts, error)
    if (allocated(error)) return
    associate (one => counts(1))
      call expect_true(error, one%boundary == 1 .and. one%columns == 5 .and. one%farther_in == 3 &
        & .and. one%empty == 2 .and. one%covered == 0 .and. one%shared == 0, 'columns at the left')
      call expect_true(error, layer_count_text(scene, one) == 'the layer of &boundary number 1 '// &
        & '(x_min) covers 5 of 10 columns; 3 begin farther in than the horizon; 2 hold no '// &
        & 'point', layer_count_text(scene, one))
    end associate
    call expect_true(error, count(body%layer == 1) == 15 .and. count(body%layer == 2) == 24, &
      & 'points of layers')
  end subroutine test_counts

  !> The points of a scene that must be accepted.
  subroutine generate(scene, body, counts, error)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(out) :: body
    type(layer_count_type), allocatable, intent(out) :: counts(:)
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault
    real(wp) :: delta

    call generate_body(scene, body, delta, fault, counts)
    if (allocated(fault) .and. .not. allocated(error)) call test_failed(error, fault%message)
  end subroutine generate

  !> One cell is cut from a corner of a plate: both layers reach for that cell, the one of the
  !> earlier group has it, and the other goes on behind.
  subroutine test_corner(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(body_type) :: body
    type(layer_count_type), allocatable :: counts(:)
    integer :: first, k, at

    do first = 1, 2
      call box_scene([8, 8], 1.0_wp, 0.3_wp, scene)
      deallocate (scene%removed)
      allocate (scene%removed(1))
      scene%removed(1)%shape = 'box'
      scene%removed(1)%upper(1:2) = 1.0_wp
      call layered(scene, 2)
      scene%boundaries(first)%side = 'x_min'
      scene%boundaries(3 - first)%side = 'y_min'
      call generate(scene, body, counts, error)
      if (allocated(error)) return
      call expect_true(error, counts(1)%shared == 0 .and. counts(2)%shared == 1, 'shared points')
      call expect_true(error, body%n_points == 63 + 2*24 - 1, 'number of points')
      at = findloc([(all(abs(body%x(k, :) - 0.5_wp) < 0.1_wp), k=1, body%n_points)], .true., dim=1)
      call expect_true(error, at > 0, 'nothing in the corner')
      if (allocated(error)) return
      call expect_true(error, body%layer(at) == 1, 'the layer in the corner')
    end do
  end subroutine test_corner

  !> A body of finer spacing stands on the left half of another one. Where it stands, the layer is
  !> its; the bare half ends lower, but within the horizon, and has its own.
  subroutine test_cover(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(body_type) :: body
    type(layer_count_type), allocatable :: counts(:)

    call box_scene([8, 4], 1.0_wp, 0.3_wp, scene)
    scene%bodies = [scene%bodies(1), scene%bodies(1)]
    scene%bodies(2)%name = 'fine'
    scene%bodies(2)%lower(1:2) = [0.0_wp, 4.0_wp]
    scene%bodies(2)%upper(1:2) = [4.0_wp, 6.0_wp]
    scene%bodies(2)%points(1:2) = [8, 4]
    scene%horizon%length = 3.015_wp
    call layered(scene, 1)
    scene%boundaries(1)%side = 'y_max'
    call generate(scene, body, counts, error)
    if (allocated(error)) return
    ! 3.015 of the coarse spacing are 6 fine rows
    call expect_true(error, count(body%layer == 1 .and. body%body == 2) == 8*6, 'the fine body')
    call expect_true(error, count(body%layer == 1 .and. body%body == 1) == 4*3, 'the bare half')
    call expect_true(error, counts(1)%columns == 12 .and. counts(1)%covered == 4, 'columns')
    call expect(error, minval(body%x(:, 2), mask=body%layer == 1 .and. body%body == 1), 4.5_wp, &
      & 1.0e-12_wp, 'begin of the coarse layer')
    ! too wide by the digits that its corner lacks, it covers no fifth column
    scene%bodies(2)%upper(1) = 4.003_wp
    call generate(scene, body, counts, error)
    if (allocated(error)) return
    call expect_true(error, counts(1)%columns == 12 .and. counts(1)%covered == 4, 'a sliver')
    ! shifted by half a fine cell, the fine body covers a part of a fifth column
    scene%bodies(2)%lower(1) = 0.25_wp
    scene%bodies(2)%upper(1) = 4.25_wp
    call generate(scene, body, counts, error)
    if (allocated(error)) return
    call expect_true(error, counts(1)%columns == 11 .and. counts(1)%covered == 5, 'shifted')
    ! higher than the horizon, it leaves nothing to the lower one
    scene%bodies(2)%upper(2) = 8.0_wp
    scene%bodies(2)%points(2) = 8
    call generate(scene, body, counts, error)
    if (allocated(error)) return
    call expect_true(error, counts(1)%columns == 8 .and. counts(1)%covered == 0 .and. &
      & count(body%layer == 1) == 8*6, 'the high body alone')
    ! on one grid, too
    scene%bodies(2)%lower(1:2) = [0.0_wp, 4.0_wp]
    scene%bodies(2)%upper(1:2) = [4.0_wp, 6.0_wp]
    scene%bodies(2)%points(1:2) = [4, 2]
    call generate(scene, body, counts, error)
    if (allocated(error)) return
    call expect_true(error, counts(1)%columns == 8 .and. counts(1)%covered == 4 .and. &
      & count(body%layer == 1) == 24, 'one grid')
  end subroutine test_cover

  !> What has no layer: a body of which nothing is left, one whose spacing is longer than the
  !> horizon; and a layer where another body, layer or cloud is.
  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    integer :: i, unit

    call two_bodies(1.0_wp, scene)
    deallocate (scene%removed)
    allocate (scene%removed(1))
    scene%removed(1)%shape = 'box'
    scene%removed(1)%upper(1) = 6.0_wp
    scene%boundaries(1)%body = 'box'
    call judge(scene, 'every point of the body was removed', 1, error)
    call two_bodies(1.0_wp, scene)
    scene%horizon%length = 0.9_wp
    call judge(scene, 'shorter than the spacing', 1, error)
    ! a layer of 3 rows needs room for 3 rows
    do i = 0, 3
      call two_bodies(real(i, wp), scene)
      scene%boundaries(1)%body = 'box'
      scene%boundaries(1)%side = 'x_max'
      call judge(scene, 'the layer of &boundary number 1 (x_max) at body 1', merge(1, 0, i < 3), &
        & error)
    end do
    ! and two layers, from both bodies, twice as much
    do i = 5, 6
      call two_bodies(real(i, wp), scene)
      scene%boundaries = [scene%boundaries(1), scene%boundaries(1)]
      scene%boundaries(1)%body = 'box'
      scene%boundaries(1)%side = 'x_max'
      scene%boundaries(2)%body = 'other'
      call judge(scene, 'overlap', merge(2, 0, i < 6), error)
    end do
    ! one side twice
    call two_bodies(1.0_wp, scene)
    scene%boundaries = [scene%boundaries(1), scene%boundaries(1)]
    scene%boundaries(2)%body = 'box'
    call judge(scene, 'overlap', 2, error)
    ! a cloud's point in a cell of the layer, and one behind the layer
    do i = 0, 1
      open (newunit=unit, file='test-layer-cloud.txt', status='replace', action='write')
      write (unit, '(f0.2, a)') merge(9.2_wp, 8.7_wp, i == 0), ' 2.2 0 2.0e-3'
      close (unit)
      call two_bodies(1.0_wp, scene)
      scene%boundaries(1)%body = 'box'
      scene%boundaries(1)%side = 'x_max'
      scene%bodies(2) = body_group()
      scene%bodies(2)%file = 'test-layer-cloud.txt'
      call judge(scene, 'overlap', i, error)
    end do
    open (newunit=unit, file='test-layer-cloud.txt')
    close (unit, status='delete')
  end subroutine test_refused

  !> Two bodies of 6 x 5 cells with so many cells between them, and a layer at the left of both.
  subroutine two_bodies(gap, scene)
    real(wp), intent(in) :: gap
    type(scene_type), intent(out) :: scene

    call box_scene([6, 5], 1.0_wp, 0.3_wp, scene)
    scene%bodies = [scene%bodies(1), scene%bodies(1)]
    scene%bodies(2)%name = 'other'
    scene%bodies(2)%lower(1) = 6 + gap
    scene%bodies(2)%upper(1) = 12 + gap
    call layered(scene, 1)
  end subroutine two_bodies

  !> The scene must be refused in these words, at the boundary of this number; 0: be accepted.
  subroutine judge(scene, words, number, error)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: words
    integer, intent(in) :: number
    type(error_type), allocatable, intent(inout) :: error
    type(body_type) :: body
    type(fault_type), allocatable :: fault
    real(wp) :: delta

    if (allocated(error)) return
    call generate_body(scene, body, delta, fault)
    if (number == 0) then
      if (allocated(fault)) call test_failed(error, fault%message)
      return
    end if
    call expect_true(error, allocated(fault), 'accepted; expected: '//words)
    if (allocated(error)) return
    call expect_true(error, index(fault%message, words) > 0 .and. index(fault%message, &
      & ' --> group &boundary number '//to_text(number)) > 0, 'expected '//words//' in: '// &
      & fault%message)
  end subroutine judge

  !> On a cut side: an initial velocity of all points is the layer's too, but for the component that
  !> its boundary moves; a table has a row for each of its points; and no bond of a no-fail box that
  !> holds the layer breaks.
  subroutine test_state(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: v(:)
    integer :: unit, i

    call box_scene([8, 6], 1.0_wp, 0.3_wp, scene)
    call layered(scene, 1)
    scene%boundaries(1)%displacement(1) = unset
    scene%boundaries(1)%velocity(1) = 3.0_wp
    deallocate (scene%removed, scene%initial, scene%no_fail)
    allocate (scene%removed(1), scene%initial(1), scene%no_fail(1))
    scene%removed(1)%shape = 'box'
    scene%removed(1)%upper(1) = 2.0_wp
    scene%initial(1)%velocity(1:2) = [5.0_wp, 7.0_wp]
    scene%no_fail(1)%shape = 'box'
    scene%no_fail(1)%upper(1) = 2.0_wp
    scene%materials(1)%critical_stretch = 0.1_wp
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    associate (body => set_up%system%body, state => set_up%system%state)
      call expect_true(error, body%n_points == 36 + 18, 'number of points')
      if (allocated(error)) return
      call expect_true(error, all(abs(state%v(body%slot(37:), 2) - 7.0_wp) <= 0.0_wp), 'free')
      call expect_true(error, all(abs(state%v(body%slot(37:), 1) - 3.0_wp) <= 0.0_wp), 'moved')
      call expect_true(error, all(abs(state%v(body%slot(:36), 1) - 5.0_wp) <= 0.0_wp), 'the body')
      call expect_true(error, all(set_up%system%model%critical(body%slot(37:)) < 0.0_wp) .and. &
        & all(set_up%system%model%critical(body%slot(:36)) > 0.0_wp), 'the no-fail zone')
    end associate
    open (newunit=unit, file='test-layer-state.txt', status='replace', action='write')
    write (unit, '(a)') 'velocity_y'
    write (unit, '(i0)') (i, i=1, 54)
    close (unit)
    scene%initial(1)%velocity = unset
    scene%initial(1)%file = 'test-layer-state.txt'
    call ready_alone(scene, set_up, error)
    open (newunit=unit, file='test-layer-state.txt')
    close (unit, status='delete')
    if (allocated(error)) return
    allocate (v(54), source=0.0_wp)
    call gather(set_up%system%body, set_up%system%state%v(:, 2), v)
    call expect_true(error, all(abs(v - [(real(i, wp), i=1, 54)]) <= 0.0_wp), 'rows of a table')
  end subroutine test_state

end module test_body_layers
