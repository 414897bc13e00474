!> The search for families: linked cells against brute force, and what must not depend on rounding.
module test_family_cells
  use pd_base_kinds, only: wp, i2, i4, i8
  use pd_body_body, only: body_type, allocate_points
  use pd_family_cells, only: cells_type, sort_into_cells, brute_force_neighbours
  use pd_family_family, only: bonds_type, allocate_bonds
  use pd_family_list, only: list_family_type, new_list_family
  use pd_family_volume, only: volume_rule_type, volume_correction, reach, volume_none, &
    & volume_linear, volume_linear_extended, volume_exact
  use testdrive, only: error_type, new_unittest, unittest_type
  use bodies, only: expect, expect_true, noise
  implicit none (type, external)
  private
  public :: collect_family_cells

contains

  subroutine collect_family_cells(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('lattices: the same families as brute force', test_lattices), &
      & new_unittest('random clouds of varying spacing: the same families as brute force', &
      & test_clouds), &
      & new_unittest('points of several grids: the same families as brute force', test_grids), &
      & new_unittest('whole families have the known numbers of members', test_counts), &
      & new_unittest('membership at the horizon does not depend on rounding', test_edge), &
      & new_unittest('distant points need no extra memory', test_far_flung), &
      & new_unittest('work grows linearly with the points', test_work), &
      & new_unittest('long: a million points', test_million)]
  end subroutine collect_family_cells

  !> A block of cubic cells, in 1D, 2D or 3D.
  subroutine lattice(count, spacing, shift, body)
    integer, intent(in) :: count(:)
    real(wp), intent(in) :: spacing
    real(wp), intent(in) :: shift      !! of every coordinate [m]
    type(body_type), intent(out) :: body
    integer :: i, c, rest

    call allocate_points(body, size(count), product(count))
    do i = 1, product(count)
      rest = i - 1
      do c = 1, size(count)
        body%x(i, c) = shift + (mod(rest, count(c)) + 0.5_wp)*spacing
        rest = rest/count(c)
      end do
    end do
    body%volume = spacing**size(count)
    body%spacing = spacing
    body%body = 1_i2
    body%material = 1_i2
  end subroutine lattice

  !> Families of `body` against all pairs, by the points' numbers, and their weights against the
  !> volume correction. Lists have its formula in a loop of their own, and so have their force
  !> loops, which test_force_contract holds to these weights for every rule.
  subroutine compare(body, rule, what, error, apart)
    type(body_type), intent(in) :: body
    type(volume_rule_type), intent(in) :: rule
    character(*), intent(in) :: what
    type(error_type), allocatable, intent(inout) :: error
    logical, intent(in), optional :: apart  !! without the bonds within grids
    type(body_type) :: sorted
    type(list_family_type) :: family
    type(bonds_type) :: bonds
    real(wp), allocatable :: half_reach(:)
    integer(i4), allocatable :: truth(:)
    integer(i8) :: total
    logical :: mine(body%n_points), theirs(body%n_points)
    integer :: i, b

    sorted = body
    call new_list_family(sorted, rule, family, apart)
    allocate (half_reach(body%n_points))
    do i = 1, body%n_points
      half_reach(i) = reach(rule, body%spacing(i), body%dim)/2
    end do
    call allocate_bonds(family, bonds)
    total = 0
    do i = 1, body%n_points
      call family%bonds_of(int(sorted%slot(i)), bonds)
      call brute_force_neighbours(body%x, half_reach, i, truth)
      if (present(apart)) truth = pack(truth, body%grid(truth) == 0_i2 &
        & .or. body%grid(truth) /= body%grid(i))
      total = total + size(truth)
      mine = .false.
      theirs = .false.
      do b = 1, bonds%n
        call expect_true(error, .not. mine(sorted%point(bonds%j(b))), what &
          & //': a member stands twice')
        mine(sorted%point(bonds%j(b))) = .true.
        associate (j => bonds%j(b), xi => bonds%xi(b, :))
          call expect(error, bonds%weight(b)/sorted%volume(j), volume_correction(rule, xi, &
            & norm2(xi), (body%spacing(i) + sorted%spacing(j))/2), 1.0e-13_wp, &
            & what//': the volume correction')
        end associate
      end do
      theirs(truth) = .true.
      call expect_true(error, all(mine .eqv. theirs), what//': another family than by brute force')
      if (allocated(error)) return
    end do
    call expect_true(error, family%n_bonds == total, what//': number of bonds')
    call expect_true(error, total > 0, what//': no bonds at all')
  end subroutine compare

  subroutine test_lattices(error)
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: body
    integer :: kind

    do kind = volume_none, volume_exact
      call lattice([40], 0.1_wp, 0.0_wp, body)
      call compare(body, volume_rule_type(kind, 0.3_wp), 'bar', error)
      call lattice([13, 21], 0.1_wp, -0.4_wp, body)
      call compare(body, volume_rule_type(kind, 0.3015_wp), 'plate', error)
      call lattice([9, 7, 11], 0.1_wp, 100.0_wp, body)
      call compare(body, volume_rule_type(kind, 0.3015_wp), 'block', error)
      ! thin ones: less than one horizon across
      call lattice([30, 1], 0.1_wp, 0.0_wp, body)
      call compare(body, volume_rule_type(kind, 0.3_wp), 'a row in the plane', error)
      call lattice([12, 12, 1], 0.1_wp, 0.0_wp, body)
      call compare(body, volume_rule_type(kind, 0.3_wp), 'a sheet in space', error)
      call lattice([1, 1, 30], 0.1_wp, 0.0_wp, body)
      call compare(body, volume_rule_type(kind, 0.3_wp), 'a chain in space', error)
    end do
  end subroutine test_lattices

  subroutine test_clouds(error)
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: body
    integer :: dim, i, c, kind, state

    state = 5
    do dim = 1, 3
      call allocate_points(body, dim, 400)
      do i = 1, 400
        do c = 1, dim
          body%x(i, c) = noise(state)*merge(5.0_wp, 1.0_wp, c == 1)
        end do
        ! spacings over a factor of 4
        body%spacing(i) = 0.05_wp*4.0_wp**((noise(state) + 1)/2)
      end do
      body%volume = body%spacing**dim
      body%material = 1_i2
      do kind = volume_none, volume_exact
        call compare(body, volume_rule_type(kind, 0.33_wp), 'cloud', error)
      end do
    end do
  end subroutine test_clouds

  !> Points of several grids, side by side or mixed, and of none, with spacings that differ; more
  !> grids than are kept apart, too. With all bonds, and without those within grids.
  subroutine test_grids(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 400, grids(3) = [2, 5, 100]
    type(body_type) :: body
    integer :: dim, i, c, g, kind, state
    logical :: mixed

    state = 7
    do dim = 1, 3
      do g = 1, size(grids)
        do kind = 1, 2
          mixed = kind == 2
          call allocate_points(body, dim, n)
          do i = 1, n
            ! numbers from 0 on, of which some are missing
            body%grid(i) = int(2*merge(mod(i, grids(g)), (i - 1)*grids(g)/n, mixed), i2)
            do c = 1, dim
              body%x(i, c) = noise(state)
            end do
            body%x(i, 1) = merge(5*body%x(i, 1), 10.0_wp*i/n, mixed)
            body%spacing(i) = 0.06_wp*2.0_wp**mod(int(body%grid(i)/2), 3)
          end do
          body%volume = body%spacing**dim
          body%material = 1_i2
          call compare(body, volume_rule_type(volume_linear, 0.4_wp), 'grids', error)
          call compare(body, volume_rule_type(volume_linear, 0.4_wp), 'between grids', error, &
            & apart=.true.)
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_grids

  !> At delta = 3.015 spacings: the integer points within 3 of the origin: 6, 28, 122.
  subroutine test_counts(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: known(3) = [6, 28, 122]
    type(body_type) :: body
    type(list_family_type) :: family
    integer :: dim

    do dim = 1, 3
      call lattice(spread(7, 1, dim), 0.1_wp, 0.0_wp, body)
      call new_list_family(body, volume_rule_type(volume_linear, 0.3015_wp), family)
      call expect_true(error, family%most_bonds == known(dim), 'members of a whole family')
    end do
  end subroutine test_counts

  !> delta exactly 3 spacings, lattices shifted far away and spacings that no binary fraction is:
  !> differences of coordinates are then off by up to 1e-10 of a spacing, and every family must
  !> still be the same.
  subroutine test_edge(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: shifts(*) = [0.0_wp, 1.0_wp/3, -7.7_wp, 1234.567_wp]
    real(wp), parameter :: spacings(*) = [0.1_wp, 1.0e-2_wp/3, 7.0e-3_wp]
    integer, parameter :: count(3) = [9, 8, 7]
    type(body_type) :: body
    type(list_family_type) :: family
    integer(i8) :: expected
    integer :: dim, s, i, kind

    do dim = 1, 3
      do kind = volume_none, volume_linear_extended
        call lattice(count(:dim), 1.0_wp, 0.0_wp, body)
        call new_list_family(body, volume_rule_type(kind, 3.0_wp), family)
        expected = family%n_bonds
        do s = 1, size(shifts)
          do i = 1, size(spacings)
            call lattice(count(:dim), spacings(i), shifts(s), body)
            call new_list_family(body, volume_rule_type(kind, 3*spacings(i)), family)
            call expect_true(error, family%n_bonds == expected, 'bonds of a shifted lattice')
            call lattice(count(:dim), spacings(i), shifts(s), body)
            call new_list_family(body, volume_rule_type(kind, &
              & 3*spacings(i)*(1 - 4*epsilon(1.0_wp))), family)
            call expect_true(error, family%n_bonds == expected, 'bonds of a horizon rounded down')
          end do
        end do
      end do
    end do
  end subroutine test_edge

  !> Two clusters a million horizons apart: as many cells as the points are worth, no more.
  subroutine test_far_flung(error)
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: body
    type(cells_type) :: cells

    call lattice([6, 6, 6], 0.1_wp, 0.0_wp, body)
    body%x(109:, :) = body%x(109:, :) + 1.0e5_wp
    call sort_into_cells(body%x, 0.3_wp, cells)
    call expect_true(error, size(cells%first) <= 4*216 + 65, 'cells of far-flung points')
    call compare(body, volume_rule_type(volume_linear, 0.3015_wp), 'far-flung points', error)
  end subroutine test_far_flung

  !> Counted, not timed: the pairs that a search looks at are those of the 27 cells around a point.
  !> Cells are at most twice as wide as the reach (on small bodies, where the last would be a part),
  !> so the pairs per point stay below a bound that doesn't know how many points there are.
  subroutine test_work(error)
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: body
    integer :: n

    do n = 8, 40, 8
      call lattice([n, n, n], 0.1_wp, 0.0_wp, body)
      call expect_true(error, pairs_per_point(body, 0.3015_wp) <= (3*2*3.015_wp + 3)**3, &
        & 'pairs looked at')
    end do
    call lattice([100000], 0.1_wp, 0.0_wp, body)
    call expect_true(error, pairs_per_point(body, 0.3015_wp) < 12.0_wp, 'pairs looked at in a bar')
  end subroutine test_work

  !> Mean number of points in the cells around a point.
  real(wp) function pairs_per_point(body, distance) result(pairs)
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: distance
    type(cells_type) :: cells
    integer :: cx, cy, cz, at, other, dx, dy, dz, i(3)

    call sort_into_cells(body%x, distance, cells)
    pairs = 0.0_wp
    do cz = 0, cells%count(3) - 1
      do cy = 0, cells%count(2) - 1
        do cx = 0, cells%count(1) - 1
          at = 1 + cx + cells%count(1)*(cy + cells%count(2)*cz)
          do dz = -1, 1
            do dy = -1, 1
              do dx = -1, 1
                i = [cx + dx, cy + dy, cz + dz]
                if (any(i < 0) .or. any(i >= cells%count)) cycle
                other = 1 + i(1) + cells%count(1)*(i(2) + cells%count(2)*i(3))
                pairs = pairs + real(cells%first(at + 1) - cells%first(at), wp) &
                  & *real(cells%first(other + 1) - cells%first(other), wp)
              end do
            end do
          end do
        end do
      end do
    end do
    pairs = pairs/body%n_points
  end function pairs_per_point

  !> 100^3 points: pairs are the sum over the 122 offsets of the cells that have such a neighbour.
  subroutine test_million(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 100
    type(body_type) :: body
    type(list_family_type) :: family
    integer(i8) :: expected
    integer :: i, j, k

    expected = 0
    do k = -3, 3
      do j = -3, 3
        do i = -3, 3
          if (i**2 + j**2 + k**2 > 9 .or. (i == 0 .and. j == 0 .and. k == 0)) cycle
          expected = expected + int(n - abs(i), i8)*int(n - abs(j), i8)*int(n - abs(k), i8)
        end do
      end do
    end do
    call lattice([n, n, n], 1.0e-3_wp, 0.0_wp, body)
    call new_list_family(body, volume_rule_type(volume_linear, 3.015e-3_wp), family)
    call expect_true(error, family%n_bonds == expected, 'bonds of a million points')
    ! a pack has few bonds if the eight points are not close together, or few members find a
    ! partner: cubes of two points a side have 4.3 for a member inside the body, by counting, and
    ! 7 for a pack if most of their outer members are paired
    call expect_true(error, 2*family%n_bonds > 13*size(family%bits, kind=i8), 'packs are full')
    call expect_true(error, pairs_per_point(body, 3.015e-3_wp) <= (3*3.2_wp + 1)**3, &
      & 'pairs of a million points')
  end subroutine test_million

end module test_family_cells
