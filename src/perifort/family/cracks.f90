!> Pre-existing cracks (7.9): bonds that pass through a crack are broken before the run.
!>
!> The rule, which doesn't depend on rounding: a point on the crack's plane (within a millionth of
!> its spacing) counts as lying on the side the normal points to; a bond is cut if its ends lie on
!> different sides and it passes through the crack or its rim (again within a millionth).
module pd_family_cracks
  use pd_base_kinds, only: wp, i8
  use pd_base_vectors, only: cross
  use pd_scene_content_types, only: crack_group, is_set
  use pd_body_body, only: body_type
  use pd_family_family, only: family_type, bonds_type, allocate_bonds
  implicit none (type, external)
  private
  public :: cut_bonds, part_bodies, crosses, crack_type, new_crack, pieces_of, points_on, extents_of

  integer, parameter :: segment = 1, parallelogram = 2, disc = 3
  real(wp), parameter :: on_plane = 1.0e-6_wp  !! [spacings]

  !> A crack as a piece of a plane: centre or corner, normal, and what bounds it.
  type :: crack_type
    integer :: kind = segment
    real(wp) :: origin(3) = 0.0_wp
    real(wp) :: normal(3) = 0.0_wp    !! unit vector
    real(wp) :: edge_1(3) = 0.0_wp
    real(wp) :: edge_2(3) = 0.0_wp
    real(wp) :: radius = 0.0_wp
  end type crack_type

contains

  !> The plane pieces of a crack: one, or the segments of a chain.
  pure function pieces_of(group, dim) result(pieces)
    type(crack_group), intent(in) :: group  !! the crack in the scene, checked
    integer, intent(in) :: dim              !! of the scene: 2 or 3
    type(crack_type), allocatable :: pieces(:)
    type(crack_group) :: one
    integer :: i

    if (.not. allocated(group%points)) then
      allocate (pieces(1))
      pieces(1) = new_crack(group, dim)
      return
    end if
    allocate (pieces(size(group%points)/2 - 1))
    do i = 1, size(pieces)
      one%from(:2) = group%points(2*i - 1:2*i)
      one%to(:2) = group%points(2*i + 1:2*i + 2)
      pieces(i) = new_crack(one, dim)
    end do
  end function pieces_of

  !> A crack of one piece as the scene describes it. In 2D the normal is `to - from` turned left.
  pure type(crack_type) function new_crack(group, dim) result(crack)
    type(crack_group), intent(in) :: group  !! the crack in the scene, checked
    integer, intent(in) :: dim              !! of the scene: 2 or 3

    if (dim == 2) then
      crack%kind = segment
      crack%origin(:2) = group%from(:2)
      crack%edge_1(:2) = group%to(:2) - group%from(:2)
      crack%normal = [-crack%edge_1(2), crack%edge_1(1), 0.0_wp]
    else if (is_set(group%radius)) then
      crack%kind = disc
      crack%origin = group%centre
      crack%normal = group%normal
      crack%radius = group%radius
    else
      crack%kind = parallelogram
      crack%origin = group%corner
      crack%edge_1 = group%edge_1
      crack%edge_2 = group%edge_2
      crack%normal = cross(group%edge_1, group%edge_2)
    end if
    crack%normal = crack%normal/norm2(crack%normal)
  end function new_crack

  !> Break every bond that a crack of the scene cuts; `cut` is their number (unordered).
  subroutine cut_bonds(cracks, body, family, cut)
    type(crack_group), intent(in) :: cracks(:)   !! (any number) those of the scene
    type(body_type), intent(in) :: body          !! arranged in the slots of the family
    class(family_type), intent(inout) :: family  !! with the cut bonds broken at both ends on return
    integer(i8), intent(out) :: cut              !! bonds that were intact before, each counted once
    type(bonds_type) :: bonds
    type(crack_type), allocatable :: pieces(:)
    type(crack_type) :: crack
    integer :: c, k, i

    cut = 0_i8
    allocate (pieces(0))
    do c = 1, size(cracks)
      pieces = [pieces, pieces_of(cracks(c), body%dim)]
    end do
    do c = 1, size(pieces)
      crack = pieces(c)
      !$omp parallel default(none) shared(crack, body, family) private(bonds, k, i) &
      !$omp reduction(+:cut) if(.not. family%bytes_are_shared())
      call allocate_bonds(family, bonds)
      ! chunks of whole groups, whose bonds one thread must break
      !$omp do schedule(dynamic, 256)
      do k = 1, body%n_slots
        if (body%point(k) == 0) cycle
        if (far(crack, body%x(k, :), family%rule%delta + 2*body%spacing(k))) cycle
        call family%bonds_of(k, bonds)
        do i = 1, bonds%n
          if (.not. bonds%intact(i)) cycle
          if (.not. crosses(crack, body%x(k, :), body%x(bonds%j(i), :), &
            & on_plane*(body%spacing(k) + body%spacing(bonds%j(i)))/2)) cycle
          call family%break_bond(k, i)
          cut = cut + 1_i8
        end do
      end do
      !$omp end parallel
    end do
    cut = cut/2_i8
  end subroutine cut_bonds

  !> Break every bond between bodies of different sides; `parted` is their number (unordered).
  subroutine part_bodies(side, body, family, parted)
    integer, intent(in) :: side(:)               !! (bodies) 0: of no side, its bonds stay
    type(body_type), intent(in) :: body          !! arranged in the slots of the family
    class(family_type), intent(inout) :: family  !! with these bonds broken at both ends on return
    integer(i8), intent(out) :: parted           !! bonds that were intact, each counted once
    type(bonds_type) :: bonds
    integer :: k, i, mine, its

    parted = 0_i8
    !$omp parallel default(none) shared(side, body, family) private(bonds, k, i, mine, its) &
    !$omp reduction(+:parted) if(.not. family%bytes_are_shared())
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 256)
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      mine = side(body%body(k))
      if (mine == 0) cycle
      call family%bonds_of(k, bonds)
      do i = 1, bonds%n
        its = side(body%body(bonds%j(i)))
        if (its == 0 .or. its == mine .or. .not. bonds%intact(i)) cycle
        call family%break_bond(k, i)
        parted = parted + 1_i8
      end do
    end do
    !$omp end parallel
    parted = parted/2_i8
  end subroutine part_bodies

  !> Whether no bond from `x` shorter than `distance` can reach the crack's plane.
  pure logical function far(crack, x, distance)
    type(crack_type), intent(in) :: crack
    real(wp), intent(in) :: x(:)
    real(wp), intent(in) :: distance
    real(wp) :: r(3)

    r = -crack%origin
    r(:size(x)) = r(:size(x)) + x
    far = abs(dot_product(r, crack%normal)) > distance
  end function far

  !> Whether the bond between `a` and `b` (positions, dim) is cut by the crack.
  pure logical function crosses(crack, a, b, tolerance)
    type(crack_type), intent(in) :: crack  !! as `new_crack` made it
    real(wp), intent(in) :: a(:), b(:)     !! (dim) positions of the bond's ends [m]
    real(wp), intent(in) :: tolerance
      !! within which a point lies on the plane, and a bond meets the rim [m]
    real(wp) :: ra(3), rb(3), ha, hb, r(3)

    ra = -crack%origin
    rb = -crack%origin
    ra(:size(a)) = ra(:size(a)) + a
    rb(:size(b)) = rb(:size(b)) + b
    ha = dot_product(ra, crack%normal)
    hb = dot_product(rb, crack%normal)
    crosses = .false.
    if ((ha >= -tolerance) .eqv. (hb >= -tolerance)) return
    r = ra + (rb - ra)*(ha/(ha - hb))
    crosses = in_bounds(crack, r, tolerance)
  end function crosses

  !> Whether `r`, on the plane of the crack and from its origin [m], lies within its rim.
  pure logical function in_bounds(crack, r, tolerance)
    type(crack_type), intent(in) :: crack
    real(wp), intent(in) :: r(3)
    real(wp), intent(in) :: tolerance

    select case (crack%kind)
    case (disc)
      in_bounds = norm2(r - crack%normal*dot_product(r, crack%normal)) <= crack%radius + tolerance
    case (segment)
      in_bounds = within(dot_product(r, crack%edge_1), dot_product(crack%edge_1, crack%edge_1), &
        & tolerance)
    case default
      in_bounds = in_parallelogram(crack, r, tolerance)
    end select
  end function in_bounds

  !> Number of the points of a body through which a crack runs.
  pure integer function points_on(group, body) result(number)
    type(crack_group), intent(in) :: group   !! the crack
    type(body_type), intent(in) :: body      !! whose points are checked, in slots
    type(crack_type), allocatable :: pieces(:)
    real(wp) :: r(3)
    integer :: k, p

    pieces = pieces_of(group, body%dim)
    number = 0
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      do p = 1, size(pieces)
        r = -pieces(p)%origin
        r(:body%dim) = r(:body%dim) + body%x(k, :)
        if (abs(dot_product(r, pieces(p)%normal)) > on_plane*body%spacing(k)) cycle
        if (.not. in_bounds(pieces(p), r, on_plane*body%spacing(k))) cycle
        number = number + 1
        exit
      end do
    end do
  end function points_on

  !> How large a crack is [m]: the length of a segment or chain; a parallelogram's two edges; a
  !> disc's diameter.
  pure function extents_of(group, dim) result(extents)
    type(crack_group), intent(in) :: group   !! the crack
    integer, intent(in) :: dim               !! of the scene
    real(wp), allocatable :: extents(:)
    type(crack_type), allocatable :: pieces(:)
    type(crack_type) :: crack
    integer :: p

    pieces = pieces_of(group, dim)
    if (size(pieces) > 1) then
      extents = [sum([(norm2(pieces(p)%edge_1), p=1, size(pieces))])]
      return
    end if
    crack = pieces(1)
    select case (crack%kind)
    case (disc); extents = [2*crack%radius]
    case (segment); extents = [norm2(crack%edge_1)]
    case default; extents = [norm2(crack%edge_1), norm2(crack%edge_2)]
    end select
  end function extents_of

  !> Whether `r`, on the plane of the crack and from its corner, lies between its edges.
  pure logical function in_parallelogram(crack, r, tolerance)
    type(crack_type), intent(in) :: crack
    real(wp), intent(in) :: r(3)
    real(wp), intent(in) :: tolerance
    real(wp) :: across(3)

    across = cross(crack%normal, crack%edge_2)
    in_parallelogram = within_of(crack%edge_1, across)
    across = cross(crack%normal, crack%edge_1)
    in_parallelogram = in_parallelogram .and. within_of(crack%edge_2, across)

  contains

    !> Whether r's part along `edge`, measured across the other edge, is between 0 and the edge's
    !> end.
    pure logical function within_of(edge, normal)
      real(wp), intent(in) :: edge(3), normal(3)
      real(wp) :: height, at
      height = dot_product(edge, normal)/norm2(normal)
      at = dot_product(r, normal)/norm2(normal)
      within_of = at*sign(1.0_wp, height) >= -tolerance .and. &
        & at*sign(1.0_wp, height) <= abs(height) + tolerance
    end function within_of
  end function in_parallelogram

  !> Whether 0 <= t/L <= L for t = r.e and L2 = e.e, with a tolerance [m].
  pure logical function within(t, L2, tolerance)
    real(wp), intent(in) :: t, L2, tolerance
    real(wp) :: length
    length = sqrt(L2)
    within = t/length >= -tolerance .and. t/length <= length + tolerance
  end function within

end module pd_family_cracks
