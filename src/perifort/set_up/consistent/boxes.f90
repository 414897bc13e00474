!> The whole box around a lattice with missing cells, such as a plate with a round hole
!> (doc/theory.md, 4). In the box bonds in like surroundings share weights, so that few are unknown.
!> Bonds that are far from missing cells keep them, and only those near missing cells get weights
!> of their own.
!>
!> Such weights exist: what bonds with weights of the box bear sums up to nothing for all
!> multipliers that no bond sees, since the areas of missing cells' faces are exact for these, too.
module pd_set_up_consistent_boxes
  use pd_base_error, only: error_type, internal_fault
  use pd_base_kinds, only: wp, i2, i4, i8
  use pd_body_body, only: allocate_points, body_type
  use pd_family_areas, only: area_vectors
  use pd_family_bond_weights, only: bond_weights_type
  use pd_family_family, only: family_type
  use pd_family_lattice, only: cells_between, lattice_family_type, new_lattice_family
  use pd_family_volume, only: volume_rule_type
  use pd_set_up_consistent_groups, only: groups_type, spread_weights
  use pd_set_up_consistent_patterns, only: find_patterns, patterns_type
  use pd_set_up_consistent_symmetries, only: find_symmetries, known_type, &
    & symmetries_of_box, symmetries_type
  implicit none (type, external)
  private
  public :: box_type, fill_box, find_alike, symmetries_within, take_from_box, join_weights

  type :: box_type
    type(body_type) :: body                !! a point in each cell of the box, in the slots of those
                                           !! of the body inside it
    type(lattice_family_type) :: family
    type(patterns_type) :: patterns        !! of its families
    real(wp), allocatable :: area(:, :)    !! (n_slots, dim) outward surface areas [m2]
    logical, allocatable :: near(:)        !! (n_slots) points of the body near missing cells
    type(bond_weights_type) :: weights     !! of the box
    type(symmetries_type), allocatable :: alike  !! points of the body that are, if many are
  end type box_type

  !> Bonds from a missing cell, one after another, within which points are near it. With 2 the
  !> largest possible bound on Gb is 0 around a hole with a radius of 30 points, and -0.3 in a plate
  !> of 12 points' thickness.
  integer, parameter :: near_bonds = 4
  integer, parameter :: most_cells = 100  !! slots of a box, for each point of the body

contains

  !> The box around a body, if that is one lattice.
  subroutine fill_box(body, family, area, box)
    type(body_type), intent(in) :: body               !! arranged in the family's slots
    class(family_type), intent(in) :: family          !! whole
    real(wp), intent(in) :: area(:, :)                !! (n_slots, dim) outward surface areas [m2]
    type(box_type), allocatable, intent(out) :: box   !! all but its weights; not allocated: none
    type(error_type), allocatable :: error
    type(volume_rule_type) :: rule
    real(wp), parameter :: same_place = 1.0e-6_wp  ! of a cell of both [spacings]
    logical :: found
    integer :: k, alone

    select type (family)
    type is (lattice_family_type)
      if (size(family%grids) /= 1 .or. family%partial .or. family%mixed) return
      if (body%n_slots/most_cells > body%n_points) return
      rule = family%rule
    class default  ! no lattice
      return
    end select
    allocate (box)
    call fill_cells(body, box%body)
    call new_lattice_family(box%body, rule, .false., .false., box%family, error)
    found = .not. allocated(error)
    if (found) then
      if (box%body%n_slots /= body%n_slots) &
        & call internal_fault('a box has other slots than its body')
      do k = 1, body%n_slots
        if (body%point(k) == 0) cycle
        if (.not. all(abs(box%body%x(k, :) - body%x(k, :)) <= same_place*body%spacing(k))) &
          & call internal_fault('a cell of a box is not where that of its body is')
      end do
      call area_vectors(box%body, box%family, spread(1.0_wp, 1, int(maxval(body%material))), &
        & box%area, alone)
      found = alone == 0
    end if
    if (found) then
      call find_patterns(box%body, box%family, box%patterns, error)
      found = .not. allocated(error)
    end if
    if (found) then
      call find_near(box, body, area)
    else
      deallocate (box)
    end if
  end subroutine fill_box

  !> A point in each cell of the box around a lattice along the axes.
  subroutine fill_cells(body, filled)
    type(body_type), intent(in) :: body      ! one lattice
    type(body_type), intent(out) :: filled   ! in point order
    real(wp) :: low(body%dim)
    integer :: cells(3), place(3), c, n, first

    first = findloc(body%point > 0, .true., dim=1)
    associate (spacing => body%spacing(first), dim => body%dim)
      cells = 1
      do c = 1, dim
        low(c) = minval(body%x(:, c), mask=body%point > 0)
        cells(c) = cells_between(low(c), maxval(body%x(:, c), mask=body%point > 0), spacing)
      end do
      call allocate_points(filled, dim, product(cells))
      do n = 1, filled%n_points
        place = [mod(n - 1, cells(1)), mod((n - 1)/cells(1), cells(2)), (n - 1)/product(cells(:2))]
        filled%x(n, :) = low + place(:dim)*spacing
      end do
      filled%volume = body%volume(first)
      filled%spacing = spacing
      filled%body = body%body(first)
      filled%material = body%material(first)
      filled%grid = 1_i2
      filled%grids = [body%grids(body%grid(first))]
      filled%delta = body%delta
      filled%order%reproducible = body%order%reproducible
    end associate
  end subroutine fill_cells

  !> The points of a body near those whose families or areas are not those of the box.
  subroutine find_near(box, body, area)
    type(box_type), intent(inout) :: box     ! gets `near`
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: area(:, :)       ! (n_slots, dim) of the body [m2]
    real(wp), parameter :: same = 1.0e-9_wp  ! of areas that are the same, over the largest
    integer(i4), allocatable :: reached(:), next(:)
    real(wp) :: small
    integer(i8) :: i
    integer :: k, j, round, n

    small = same*maxval(abs(box%area))
    allocate (box%near(body%n_slots), source=.false.)
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      associate (p => box%patterns%of(k))
        do i = box%patterns%start(p), box%patterns%start(p + 1) - 1
          if (body%point(k + box%patterns%ahead(i)) == 0) box%near(k) = .true.
        end do
      end associate
      if (any(abs(area(k, :) - box%area(k, :)) > small)) box%near(k) = .true.
    end do
    reached = pack([(int(k, i4), k=1, body%n_slots)], box%near)
    allocate (next(body%n_points))
    do round = 2, near_bonds
      n = 0
      do k = 1, size(reached)
        associate (p => box%patterns%of(reached(k)))
          do i = box%patterns%start(p), box%patterns%start(p + 1) - 1
            j = int(reached(k) + box%patterns%ahead(i))
            if (body%point(j) == 0 .or. box%near(j)) cycle
            box%near(j) = .true.
            n = n + 1
            next(n) = int(j, i4)
          end do
        end associate
      end do
      reached = next(:n)
    end do
  end subroutine find_near

  !> The points of the box that are alike, with layers that are from some horizons inside on.
  subroutine symmetries_within(box, reach, symmetries)
    type(box_type), intent(in) :: box
    integer, intent(in) :: reach        !! horizons
    type(symmetries_type), allocatable, intent(out) :: symmetries   !! not allocated if not found
    type(known_type) :: known

    known%patterns = box%patterns
    known%area = box%area
    call symmetries_of_box(box%body, box%family%rule%delta, reach, known, symmetries)
  end subroutine symmetries_within

  !> Find the points near missing cells that are alike.
  subroutine find_alike(body, family, area, face, box)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family   !! whole
    real(wp), intent(in) :: area(:, :)         !! (n_slots, dim) outward surface areas [m2]
    real(wp), intent(in) :: face(:)            !! (n_slots) of points whose areas may change;
                                               !! 0: fixed [m2]
    type(box_type), intent(inout) :: box       !! gets what is alike
    type(known_type) :: known
    type(error_type), allocatable :: error

    call find_patterns(body, family, known%patterns, error)
    if (allocated(error)) return
    known%near = box%near
    known%fixed = any(abs(area) > 0.0_wp, dim=2) .and. .not. face > 0.0_wp
    known%area = area
    known%of_box = box%patterns
    known%weights = box%weights
    call find_symmetries(box%body, body, family%rule%delta, near_bonds, known, box%alike)
  end subroutine find_alike

  !> Give groups the weights that their bonds have in the box.
  subroutine take_from_box(box, groups)
    type(box_type), intent(in) :: box           !! with its weights
    type(groups_type), intent(inout) :: groups  !! of points of the body; get what is known
    integer(i8) :: i, of_box, e, at
    integer :: c, k

    allocate (groups%known_b(size(groups%group)), groups%known_d(size(groups%group)))
    do c = 1, groups%n_classes
      k = int(groups%first(c))
      associate (own => groups%patterns, p => groups%patterns%of(k))
        ! both patterns are in the order of keys, and that of the box has more bonds
        of_box = box%patterns%start(box%patterns%of(k))
        do i = own%start(p), own%start(p + 1) - 1
          do while (box%patterns%key(of_box) /= own%key(i))
            of_box = of_box + 1
          end do
          e = groups%start(c) - 1 + own%place(i)
          at = box%weights%before(k) + box%patterns%place(of_box)
          groups%known_b(e) = box%weights%Gb(at)
          groups%known_d(e) = box%weights%Gd(at)
        end do
      end associate
    end do
  end subroutine take_from_box

  !> The weights of the body: rows of the box, and others of points near missing cells.
  subroutine join_weights(box, groups, Gb, Gd, weights)
    type(box_type), intent(in) :: box                  !! with its weights
    type(groups_type), intent(in) :: groups            !! of points near missing cells, with what is
                                                       !! known
    real(wp), intent(in) :: Gb(:), Gd(:)               !! (groups) [-]
    type(bond_weights_type), intent(out) :: weights    !! of the body

    ! far from missing cells the bonds of both stand in one order
    weights = box%weights
    where (groups%patterns%of == 0) weights%row = 0_i4
    call spread_weights(groups, Gb, Gd, weights)
  end subroutine join_weights

end module pd_set_up_consistent_boxes
