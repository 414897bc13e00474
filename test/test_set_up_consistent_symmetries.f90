!> Symmetries of lattices with missing cells: weights that are found with them are those that are
!> found without, and points are alike only where all that is known of them is.
module test_set_up_consistent_symmetries
  use bodies, only: box_scene, expect_true, ready, text_of
  use comparisons, only: expect_close, max_abs
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_base_long_work, only: long_work_type
  use pd_body_body, only: body_type
  use pd_family_areas, only: area_vectors
  use pd_family_bond_weights, only: bond_weights_type
  use pd_family_family, only: family_type
  use pd_law_material, only: material_type
  use pd_scene_content_types, only: scene_type
  use pd_set_up_consistent_boxes, only: box_type, fill_box, find_alike, take_from_box
  use pd_set_up_consistent_conditions, only: conditions_type, dilatation_conditions, &
    & stretch_conditions
  use pd_set_up_consistent_groups, only: find_groups, groups_type, spread_weights
  use pd_set_up_consistent_least_change, only: least_change, most_iterations
  use pd_set_up_prepare, only: set_up_type
  use testdrive, only: error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_set_up_consistent_symmetries

  real(wp), parameter :: spacing = 1.0e-2_wp

contains

  subroutine collect_set_up_consistent_symmetries(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)

    testsuite = [ &
      & new_unittest('weights with symmetries are those without', test_same), &
      & new_unittest('points are alike only where their areas may change alike', test_fixed), &
      & new_unittest('layers along a slot are alike but for those at its ends', test_layers), &
      & new_unittest('areas that change are symmetric', test_areas)]
  end subroutine collect_set_up_consistent_symmetries

  !> The box around a plate with holes, with its weights; the plate, and its areas.
  subroutine make(cells, centres, radius, set_up, box, area, error)
    integer, intent(in) :: cells(2)
    real(wp), intent(in) :: centres(:, :)  ! (2, holes) [spacings]
    real(wp), intent(in) :: radius         ! [spacings]
    type(set_up_type), intent(out) :: set_up
    type(box_type), allocatable, intent(out) :: box
    real(wp), allocatable, intent(out) :: area(:, :)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene
    type(set_up_type) :: whole
    integer :: i, alone

    call box_scene(cells, spacing, 0.3_wp, scene)
    scene%horizon%surface_correction = 'consistent'
    call ready(scene, whole, error)
    if (allocated(error)) return
    deallocate (scene%removed)
    allocate (scene%removed(size(centres, 2)))
    do i = 1, size(centres, 2)
      scene%removed(i)%shape = 'cylinder'
      scene%removed(i)%centre(:2) = centres(:, i)*spacing
      scene%removed(i)%radius = radius*spacing
    end do
    call ready(scene, set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      call area_vectors(system%body, system%family, [1.0_wp], area, alone)
      call fill_box(system%body, system%family, area, box)
    end associate
    call expect_true(error, allocated(box) .and. alone == 0, 'a box')
    if (.not. allocated(error)) box%weights = whole%system%model%weights
  end subroutine make

  !> Weights of a plate's bonds near missing cells, with the symmetries of a box if it has any.
  subroutine weigh(body, family, materials, area, box, weights, unknowns, error)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(material_type), intent(in) :: materials(:)
    real(wp), intent(in) :: area(:, :)
    type(box_type), intent(in) :: box
    type(bond_weights_type), intent(out) :: weights
    integer, intent(out) :: unknowns
    type(error_type), allocatable, intent(inout) :: error
    type(groups_type) :: groups
    type(conditions_type) :: conditions
    type(long_work_type) :: work
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: Gb(:), Gd(:)
    real(wp) :: residual
    integer :: iterations
    logical :: found, hopeless

    call find_groups(body, family, area, 0, groups, fault, box%near, box%alike)
    call expect_true(error, .not. allocated(fault), 'groups')
    if (allocated(error)) return
    call take_from_box(box, groups)
    unknowns = groups%n_groups
    call stretch_conditions(body, family, materials, groups, materials(1)%shear_modulus*area, &
      & conditions)
    call least_change(conditions, 0.05_wp, most_iterations, Gb, residual, iterations, found, &
      & hopeless, work)
    call expect_true(error, found, 'weights of the stretch')
    if (allocated(error)) return
    Gb = Gb + conditions%base - 1
    call dilatation_conditions(body, family, materials, [1.0_wp], groups, area, conditions)
    call least_change(conditions, -0.5_wp, most_iterations, Gd, residual, iterations, found, &
      & hopeless, work)
    call expect_true(error, found, 'weights of the dilatation')
    if (allocated(error)) return
    Gd = Gd + conditions%base - 1
    call spread_weights(groups, Gb, Gd, weights)
  end subroutine weigh

  !> The least change is unique: with symmetries it is what it is without. The conditions are
  !> fulfilled to 1e-10; weights follow them within 1e-7.
  subroutine test_same(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(box_type), allocatable :: box
    type(bond_weights_type) :: with, without
    real(wp), allocatable :: area(:, :), centres(:, :)
    integer :: i, k, n, few, many

    do i = 1, 3
      if (i == 1) centres = reshape([20.0_wp, 28.0_wp], [2, 1])
      ! two holes that only a shift makes one of the other, and one that is in the middle of a row
      if (i == 2) centres = reshape([24.3_wp, 22.1_wp, 77.3_wp, 24.1_wp], [2, 2])
      if (i == 3) centres = reshape([20.0_wp, 28.5_wp], [2, 1])
      call make(merge([104, 46], [40, 56], i == 2), centres, 4.2_wp, set_up, box, area, error)
      if (allocated(error)) return
      associate (body => set_up%system%body, family => set_up%system%family, &
        & materials => set_up%system%model%materials)
        call weigh(body, family, materials, area, box, without, many, error)
        call find_alike(body, family, area, faces_of(body), box)
        call expect_true(error, allocated(box%alike), 'symmetries of '//text_of(real(i, wp)))
        if (allocated(error)) return
        call weigh(body, family, materials, area, box, with, few, error)
        if (allocated(error)) return
        call expect_true(error, few < merge(0.51_wp, 0.28_wp, i == 2)*many, &
          & 'few unknowns: '//text_of(real(few, wp))//' of '//text_of(real(many, wp)))
        call expect_true(error, all((with%row > 0) .eqv. (without%row > 0)), 'the same points')
        if (allocated(error)) return
        do k = 1, body%n_slots
          if (with%row(k) == 0) cycle
          n = bonds_at(box, k, body)
          associate (one => with%before(k), other => without%before(k))
            call expect_close(error, with%Gb(one + 1:one + n), without%Gb(other + 1:other + n), &
              & 1.0e-7_wp, 'Gb of hole '//text_of(real(i, wp)))
            call expect_close(error, with%Gd(one + 1:one + n), without%Gd(other + 1:other + n), &
              & 1.0e-7_wp, 'Gd of hole '//text_of(real(i, wp)))
          end associate
          if (allocated(error)) return
        end do
      end associate
    end do
  end subroutine test_same

  !> The faces of points' cells: any area may change.
  pure function faces_of(body) result(face)
    type(body_type), intent(in) :: body
    real(wp) :: face(body%n_slots)

    face = 0.0_wp
    where (body%point > 0) face = body%volume/body%spacing
  end function faces_of

  !> The number of bonds of a point of a body in a box.
  integer function bonds_at(box, k, body) result(n)
    type(box_type), intent(in) :: box
    integer, intent(in) :: k               ! slot
    type(body_type), intent(in) :: body
    associate (p => box%patterns%of(k))
      n = count(body%point(k + box%patterns%ahead(box%patterns%start(p): &
        & box%patterns%start(p + 1) - 1)) > 0)
    end associate
  end function bonds_at

  !> Areas that may not change on one side of a hole: the sides are not alike then, but above and
  !> below are.
  subroutine test_fixed(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(box_type), allocatable :: box
    real(wp), allocatable :: area(:, :), face(:)
    integer, allocatable :: slot(:, :)
    integer :: x, y, round

    call make([40, 36], reshape([20.0_wp, 18.0_wp], [2, 1]), 4.2_wp, set_up, box, area, error)
    if (allocated(error)) return
    associate (body => set_up%system%body)
      call place_slots(body, [40, 36], slot)
      do round = 1, 2
        face = faces_of(body)
        if (round == 2) where (body%x(:, 1) > 20*spacing) face = 0.0_wp
        call find_alike(body, set_up%system%family, area, face, box)
        call expect_true(error, allocated(box%alike), 'symmetries')
        if (allocated(error)) return
        do y = 1, 36
          do x = 1, 40
            if (slot(x, y) == 0) cycle
            associate (class => box%alike%class)
              if (class(slot(x, y)) == 0) cycle
              call expect_true(error, class(slot(x, y)) == class(slot(x, 37 - y)), &
                & 'above and below')
              call expect_true(error, (class(slot(x, y)) == class(slot(41 - x, y))) &
                & .eqv. round == 1, 'left and right')
            end associate
          end do
        end do
        if (allocated(error)) return
      end do
    end associate
  end subroutine test_fixed

  !> The slots of points by their places in a plate.
  subroutine place_slots(body, cells, slot)
    type(body_type), intent(in) :: body
    integer, intent(in) :: cells(2)
    integer, allocatable, intent(out) :: slot(:, :)  ! 0: a missing cell
    integer :: k

    allocate (slot(cells(1), cells(2)), source=0)
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      associate (at => nint(body%x(k, :)/spacing + 0.5_wp))
        slot(at(1), at(2)) = k
      end associate
    end do
  end subroutine place_slots

  !> Between the ends of a slot 60 spacings long columns of points are of one class, and the number
  !> of classes does not grow with its length.
  subroutine test_layers(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(box_type), allocatable :: box
    real(wp), allocatable :: area(:, :)
    integer, allocatable :: slot(:, :)
    integer :: classes(2), length, i, y, alone

    do i = 1, 2
      length = merge(60, 90, i == 1)
      call box_scene([length + 40, 44], spacing, 0.3_wp, scene)
      deallocate (scene%removed)
      allocate (scene%removed(1))
      scene%removed(1)%shape = 'box'
      scene%removed(1)%lower(:2) = [20, 20]*spacing
      scene%removed(1)%upper(:2) = [length + 20, 24]*spacing
      call ready(scene, set_up, error)
      if (allocated(error)) return
      associate (body => set_up%system%body, family => set_up%system%family)
        call area_vectors(body, family, [1.0_wp], area, alone)
        call fill_box(body, family, area, box)
        call expect_true(error, allocated(box), 'a box')
        if (allocated(error)) return
        call find_alike(body, family, area, faces_of(body), box)
        call expect_true(error, allocated(box%alike), 'symmetries')
        if (allocated(error)) return
        classes(i) = box%alike%n_classes
        call place_slots(body, [length + 40, 44], slot)
        do y = 9, 20
          associate (class => box%alike%class)
            call expect_true(error, class(slot(45, y)) > 0 .and. &
              & class(slot(45, y)) == class(slot(50, y)) .and. &
              & class(slot(45, y)) == class(slot(45, 45 - y)), 'columns along a slot')
            call expect_true(error, class(slot(45, y)) /= class(slot(20, y)), 'its end')
          end associate
        end do
      end associate
      if (allocated(error)) return
    end do
    call expect_true(error, classes(1) == classes(2), 'a longer slot')
  end subroutine test_layers

  !> Around a hole of 12 spacings areas change: those of a point and of its mirror image are mirror
  !> images.
  subroutine test_areas(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(box_type), allocatable :: box
    real(wp), allocatable :: area(:, :)
    integer, allocatable :: slot(:, :)
    integer :: x, y

    call make([60, 60], reshape([30.0_wp, 30.0_wp], [2, 1]), 12.0_wp, set_up, box, area, error)
    if (allocated(error)) return
    associate (body => set_up%system%body)
      call expect_true(error, allocated(body%surface_area), 'areas that change')
      if (allocated(error)) return
      call place_slots(body, [60, 60], slot)
      do y = 1, 60
        do x = 1, 60
          if (slot(x, y) == 0) cycle
          associate (own => body%surface_area(slot(x, y), :))
            call expect_close(error, body%surface_area(slot(61 - x, y), :), [-own(1), own(2)], &
              & 1.0e-12_wp*max_abs(body%surface_area), 'left and right')
            call expect_close(error, body%surface_area(slot(x, 61 - y), :), [own(1), -own(2)], &
              & 1.0e-12_wp*max_abs(body%surface_area), 'above and below')
          end associate
        end do
      end do
    end associate
  end subroutine test_areas

end module test_set_up_consistent_symmetries
