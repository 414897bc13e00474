!> Pre-existing cracks: which bonds they cut, by the rule that the module states, and the damage
!> that follows.
module test_family_cracks
  use pd_base_kinds, only: wp, i8
  use pd_set_up_prepare, only: set_up_type
  use pd_family_cracks, only: crack_type, crosses, new_crack, pieces_of
  use pd_scene_content_types, only: scene_type, crack_group
  use comparisons, only: expect_close
  use testdrive, only: error_type, new_unittest, unittest_type
  use bodies, only: at_point, box_scene, expect, expect_true, ready, rotation_matrix
  implicit none (type, external)
  private
  public :: collect_family_cracks

  real(wp), parameter :: hair = 1.0e-6_wp  !! tolerance given to `crosses`

contains

  subroutine collect_family_cracks(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('local damage beside a straight crack', test_damage), &
      & new_unittest('a segment cuts the bonds through it', test_segment), &
      & new_unittest('a chain of segments', test_chain), &
      & new_unittest('a point on the crack''s plane lies on its normal''s side', test_on_plane), &
      & new_unittest('a bond that touches the rim is cut', test_rim), &
      & new_unittest('a parallelogram, aslant and not rectangular', test_parallelogram), &
      & new_unittest('a disc, aslant', test_disc), &
      & new_unittest('a crack through a row of points at any position', test_shifted), &
      & new_unittest('a disc in a block cuts the counted bonds', test_disc_in_block), &
      & new_unittest('two cracks through one bond cut it once', test_twice)]
  end subroutine collect_family_cracks

  !> delta = 3 spacings, linear volume correction, a long crack half a spacing from the row: worked
  !> out in doc/theory.md, 8. Beside it the book prints 0.38, 0.14, 0.24 (on the crack's plane,
  !> ahead of and behind the tip) and 0.38, 0.16, 0.02 (0.5, 1.5, 2.5 spacings from it): the first
  !> three are the counts 11, 4 and 7 of 29, the point itself counted, so not of one definition with
  !> the last.
  subroutine test_damage(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: allowed = 5.0e-4_wp  !! half of the last digit given
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp) :: tip

    ! rows at -0.5, 0.5, 1.5.. around the crack at y = 10; points at half integers
    call box_scene([21, 20], 1.0_wp, 0.3_wp, scene)
    scene%horizon%ratio = 3.0_wp
    deallocate (scene%cracks)
    allocate (scene%cracks(1))
    scene%cracks(1)%from(:2) = [-1.0_wp, 10.0_wp]
    scene%cracks(1)%to(:2) = [30.0_wp, 10.0_wp]
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expect(error, damage([10.5_wp, 10.5_wp]), 0.399_wp, allowed, &
      & 'half a spacing from the crack')
    call expect(error, damage([10.5_wp, 9.5_wp]), 0.399_wp, allowed, 'on its other side')
    call expect(error, damage([10.5_wp, 11.5_wp]), 0.196_wp, allowed, 'one and a half')
    call expect(error, damage([10.5_wp, 12.5_wp]), 0.020_wp, allowed, 'two and a half')
    call expect(error, damage([10.5_wp, 13.5_wp]), 0.0_wp, 0.0_wp, 'beyond the horizon')
    tip = 10.5_wp - 1.0e-3_wp
    scene%cracks(1)%to(1) = tip
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expect(error, damage([10.5_wp, 10.5_wp]), 0.149_wp, allowed, &
      & 'tip just short of the column')
    tip = 10.5_wp + 1.0e-3_wp
    scene%cracks(1)%to(1) = tip
    call ready(scene, set_up, error)
    if (allocated(error)) return
    call expect(error, damage([10.5_wp, 10.5_wp]), 0.250_wp, allowed, 'tip just past the column')

  contains

    real(wp) function damage(x)
      real(wp), intent(in) :: x(2)
      damage = set_up%system%state%damage(at_point(set_up%system%body, x))
    end function damage
  end subroutine test_damage

  !> Whether the bond a-b is cut, the same from both ends.
  logical function cut(crack, a, b, error)
    type(crack_type), intent(in) :: crack
    real(wp), intent(in) :: a(:), b(:)
    type(error_type), allocatable, intent(inout) :: error
    cut = crosses(crack, a, b, hair)
    call expect_true(error, cut .eqv. crosses(crack, b, a, hair), &
      & 'a bond is cut from one end alone')
  end function cut

  !> A chain of segments cuts the bonds that pass through it: a square corner, whose inside a bond
  !> enters or leaves. Points of bonds in the middle of cells pass the corner itself, too.
  subroutine test_chain(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: samples = 2520  !! has many divisors, so that corners are met
    type(crack_group) :: group
    type(crack_type), allocatable :: pieces(:)
    real(wp) :: a(2), b(2), at(2)
    logical :: found, expected, inside, first
    integer :: i, j, k, l, t, p, number

    group%points = [real(wp) :: -9, 0, -4, 0, 0, 0, 0, -9]
    pieces = pieces_of(group, 2)
    call expect_true(error, size(pieces) == 3, 'segments of a chain')
    number = 0
    do i = -3, 2
      do j = -3, 2
        do k = -3, 3
          do l = -3, 3
            a = [i + 0.5_wp, j + 0.5_wp]
            b = a + [k, l]
            expected = .false.
            first = inside_of(a)
            do t = 1, samples
              at = a + [k, l]*(real(t, wp)/samples)
              inside = inside_of(at)
              if (inside .neqv. first) expected = .true.
            end do
            found = .false.
            do p = 1, size(pieces)
              found = found .or. cut(pieces(p), a, b, error)
            end do
            number = number + merge(1, 0, found)
            call expect_true(error, found .eqv. expected, 'a bond at a corner of a chain')
          end do
        end do
      end do
    end do
    call expect_true(error, number > 100, 'bonds that are cut')

  contains

    !> The corner with its sides.
    pure logical function inside_of(x)
      real(wp), intent(in) :: x(2)
      inside_of = all(x <= 1.0e-9_wp)
    end function inside_of

  end subroutine test_chain

  subroutine test_segment(error)
    type(error_type), allocatable, intent(out) :: error
    type(crack_type) :: crack

    crack = segment([0.0_wp, 0.0_wp], [4.0_wp, 3.0_wp])
    call expect_true(error, cut(crack, [2.0_wp, 0.0_wp], [1.0_wp, 3.0_wp], error), &
      & 'straight through')
    call expect_true(error, .not. cut(crack, [2.0_wp, 0.0_wp], [4.0_wp, 2.9_wp], error), &
      & 'both below')
    call expect_true(error, .not. cut(crack, [4.0_wp, 2.0_wp], [5.0_wp, 5.0_wp], error), &
      & 'past the end')
    call expect_true(error, .not. cut(crack, [-1.0_wp, 0.1_wp], [0.5_wp, -1.0_wp], error), &
      & 'before the start')
    call expect_true(error, cut(crack, [4.4_wp, 2.0_wp], [3.3_wp, 4.0_wp], error), &
      & 'just within the end')
    ! collinear bonds pass along the crack, not through it
    call expect_true(error, .not. cut(crack, [0.4_wp, 0.3_wp], [0.8_wp, 0.6_wp], error), &
      & 'along the crack')
  end subroutine test_segment

  type(crack_type) function segment(from, to) result(crack)
    real(wp), intent(in) :: from(2), to(2)
    type(crack_group) :: group
    group%from(:2) = from
    group%to(:2) = to
    crack = new_crack(group, 2)
  end function segment

  !> The normal of a segment is its direction turned left; points on the line count as left of it,
  !> also if rounding puts them a little to the right. Reversing the crack changes their side.
  subroutine test_on_plane(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: on(2) = [1.0_wp, 0.0_wp], left(2) = [1.0_wp, 1.0_wp], &
      & right(2) = [1.0_wp, -1.0_wp]
    type(crack_type) :: crack

    crack = segment([0.0_wp, 0.0_wp], [2.0_wp, 0.0_wp])
    call expect_true(error, .not. cut(crack, on, left, error), 'to the left')
    call expect_true(error, cut(crack, on, right, error), 'to the right')
    call expect_true(error, cut(crack, on - [0.0_wp, 1.0e-12_wp], right, error), &
      & 'a rounding below, to the right')
    call expect_true(error, .not. cut(crack, on - [0.0_wp, 1.0e-12_wp], left, error), &
      & 'a rounding below, to the left')
    call expect_true(error, cut(crack, on + [0.0_wp, 1.0e-12_wp], right, error), &
      & 'a rounding above, to the right')
    call expect_true(error, .not. cut(crack, on, [0.5_wp, 0.0_wp], error), 'both on the line')
    crack = segment([2.0_wp, 0.0_wp], [0.0_wp, 0.0_wp])
    call expect_true(error, cut(crack, on, left, error), 'reversed, to the left')
    call expect_true(error, .not. cut(crack, on, right, error), 'reversed, to the right')
  end subroutine test_on_plane

  !> A bond through the very end of the crack is cut, within a hair on either side of it.
  subroutine test_rim(error)
    type(error_type), allocatable, intent(out) :: error
    type(crack_type) :: crack
    real(wp) :: x

    crack = segment([0.0_wp, 0.0_wp], [2.0_wp, 0.0_wp])
    x = 2.0_wp
    call expect_true(error, cut(crack, [x, 1.0_wp], [x, -1.0_wp], error), 'at the end')
    x = 2.0_wp + hair/2
    call expect_true(error, cut(crack, [x, 1.0_wp], [x, -1.0_wp], error), 'a rounding past the end')
    x = 2.0_wp + 3*hair
    call expect_true(error, .not. cut(crack, [x, 1.0_wp], [x, -1.0_wp], error), 'past the end')
    x = -hair/2
    call expect_true(error, cut(crack, [x, 1.0_wp], [x, -1.0_wp], error), &
      & 'a rounding before the start')
  end subroutine test_rim

  !> The bond's crossing point is corner + s edge_1 + t edge_2: cut if 0 <= s, t <= 1.
  subroutine test_parallelogram(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: e1(3) = [2.0_wp, 0.5_wp, 0.0_wp], e2(3) = [0.7_wp, 1.0_wp, 0.9_wp]
    real(wp), parameter :: places(*) = [-0.4_wp, -0.01_wp, 0.01_wp, 0.5_wp, 0.99_wp, 1.01_wp, &
      & 1.6_wp]
    type(crack_group) :: group
    type(crack_type) :: crack
    real(wp) :: through(3), along(3)
    integer :: i, j

    group%corner = [0.3_wp, -0.2_wp, 0.1_wp]
    group%edge_1 = e1
    group%edge_2 = e2
    crack = new_crack(group, 3)
    call expect(error, dot_product(crack%normal, e1), 0.0_wp, 1.0e-15_wp, &
      & 'normal to the first edge')
    call expect(error, dot_product(crack%normal, e2), 0.0_wp, 1.0e-15_wp, &
      & 'normal to the second edge')
    along = [0.4_wp, -0.7_wp, 0.8_wp]
    do i = 1, size(places)
      do j = 1, size(places)
        through = group%corner + places(i)*e1 + places(j)*e2
        call expect_true(error, cut(crack, through + 0.3_wp*along, through - 1.1_wp*along, &
          & error) .eqv. &
          & (abs(places(i) - 0.5_wp) < 0.5_wp .and. abs(places(j) - 0.5_wp) < 0.5_wp), &
          & 'parallelogram')
        call expect_true(error, .not. cut(crack, through + 0.3_wp*along, through + 1.1_wp*along, &
          & error), &
          & 'a bond that ends before the crack')
      end do
    end do
  end subroutine test_parallelogram

  subroutine test_disc(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: normal(3) = [2.0_wp, -3.0_wp, 6.0_wp]   ! not a unit vector
    real(wp), parameter :: radial(3) = [3.0_wp, 2.0_wp, 0.0_wp]/sqrt(13.0_wp)
    type(crack_group) :: group
    type(crack_type) :: crack
    real(wp) :: R(3, 3), rim(3), along(3)
    integer :: i

    group%centre = [1.0_wp, 2.0_wp, 3.0_wp]
    group%normal = normal
    group%radius = 0.8_wp
    crack = new_crack(group, 3)
    along = normal/7 + 0.9_wp*radial
    do i = 0, 11
      R = rotation_matrix(normal/7, 0.5_wp*i)
      rim = matmul(R, radial)
      associate (inside => group%centre + 0.79_wp*rim, outside => group%centre + 0.81_wp*rim)
        call expect_true(error, cut(crack, inside + along, inside - 2*along, error), &
          & 'inside the disc')
        call expect_true(error, .not. cut(crack, outside + along, outside - 2*along, error), &
          & 'outside the disc')
        call expect_true(error, .not. cut(crack, inside + along, inside + 2*along, error), &
          & 'before the disc')
      end associate
    end do
  end subroutine test_disc

  !> A crack exactly along a row: the row stays with the side that the normal points to. Bonds cut
  !> are those from the row and above to below, whatever rounding makes of the coordinates.
  subroutine test_shifted(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: shifts(*) = [0.0_wp, 1.0_wp/3, -7.7_wp, 77.123_wp]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    integer(i8) :: expected
    integer :: s, i, j, below
    real(wp) :: spacing

    spacing = 0.1_wp/3
    ! a bond (i, j) crosses the gap below the row: number of rows that it can start from, times
    ! columns
    expected = 0
    do j = 1, 3
      do i = -3, 3
        if (i**2 + j**2 > 9) cycle
        below = j
        expected = expected + int(below*(12 - abs(i)), i8)
      end do
    end do
    do s = 1, size(shifts)
      call box_scene([12, 11], spacing, 0.3_wp, scene)
      scene%bodies(1)%lower = scene%bodies(1)%lower + shifts(s)
      scene%bodies(1)%upper = scene%bodies(1)%upper + shifts(s)
      deallocate (scene%cracks)
      allocate (scene%cracks(1))
      scene%cracks(1)%from(:2) = shifts(s) + [-1.0_wp, 5.5_wp]*spacing
      scene%cracks(1)%to(:2) = shifts(s) + [13.0_wp, 5.5_wp]*spacing
      call ready(scene, set_up, error)
      if (allocated(error)) return
      call expect_true(error, set_up%cut == expected, 'bonds cut along a row of points')
    end do
  end subroutine test_shifted

  !> Every pair of points compared with the disc by geometry written anew here.
  subroutine test_disc_in_block(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    integer(i8) :: expected
    integer :: i, j
    real(wp) :: a(3), b(3), r(3), t

    call box_scene([10, 9, 8], 1.0_wp, 0.3_wp, scene)
    deallocate (scene%cracks)
    allocate (scene%cracks(1))
    scene%cracks(1)%centre = [4.9_wp, 4.4_wp, 4.1_wp]
    scene%cracks(1)%normal = [0.0_wp, 0.0_wp, 2.0_wp]
    scene%cracks(1)%radius = 2.2_wp
    call ready(scene, set_up, error)
    if (allocated(error)) return
    expected = 0
    do i = 1, set_up%system%body%n_points
      do j = i + 1, set_up%system%body%n_points
        a = set_up%system%body%x(set_up%system%body%slot(i), :)
        b = set_up%system%body%x(set_up%system%body%slot(j), :)
        if (norm2(b - a) > 3.015_wp .or. (a(3) - 4.1_wp)*(b(3) - 4.1_wp) > 0.0_wp) cycle
        t = (4.1_wp - a(3))/(b(3) - a(3))
        r = a + t*(b - a) - scene%cracks(1)%centre
        if (norm2(r(:2)) <= 2.2_wp) expected = expected + 1
      end do
    end do
    call expect_true(error, expected > 100 .and. set_up%cut == expected, 'bonds cut by a disc')
  end subroutine test_disc_in_block

  subroutine test_twice(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: once, twice
    integer :: c

    call box_scene([10, 9], 1.0_wp, 0.3_wp, scene)
    do c = 1, 2
      deallocate (scene%cracks)
      allocate (scene%cracks(c))
      scene%cracks(:)%from(1) = 2.0_wp
      scene%cracks(:)%from(2) = 4.0_wp
      scene%cracks(:)%to(1) = 7.0_wp
      scene%cracks(:)%to(2) = 4.0_wp
      if (c == 1) call ready(scene, once, error)
      if (c == 2) call ready(scene, twice, error)
      if (allocated(error)) return
    end do
    if (allocated(error)) return
    call expect_true(error, once%cut > 0 .and. once%cut == twice%cut, &
      & 'bonds cut by two cracks in one place')
    call expect_close(error, once%system%state%damage, twice%system%state%damage, &
      & 0.0_wp, 'damage')
  end subroutine test_twice

end module test_family_cracks
