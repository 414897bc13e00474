!> Binary decomposition of space: owners, halos, balance, and numbers of points and ranks that no
!> machine here could hold.
module test_body_division
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_order, only: number_of, order_type, owned_point
  use pd_base_reduce, only: first_largest, first_where, noise
  use pd_body_body, only: allocate_points, body_type, own_points
  use pd_body_division, only: box_of, divide_space, division_type, owner_of, take_part, &
    & work_of_box, work_of_points
  use pd_set_up_ranks, only: work_of_body
  use bodies, only: expect, expect_true
  use testdrive, only: error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_body_division

contains

  subroutine collect_body_division(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('each point has one owner, and its neighbours are there', test_owners), &
      & new_unittest('points of a lattice between cuts', test_lattice), &
      & new_unittest('balance of points at 1e5 a rank', test_balance), &
      & new_unittest('a hundred thousand ranks of a million points', test_many_ranks), &
      & new_unittest('numbers of points beyond 32 bits', test_large_numbers)]
  end subroutine collect_body_division

  !> Points at random in a box.
  subroutine cloud(dim, n, body)
    integer, intent(in) :: dim, n
    type(body_type), intent(out) :: body
    integer :: i, c, state

    call allocate_points(body, dim, n)
    state = 99
    do i = 1, n
      do c = 1, dim
        body%x(i, c) = c*noise(state)
      end do
    end do
    body%volume = 1.0_wp
    body%spacing = 0.05_wp
  end subroutine cloud

  !> The parts of all ranks are the whole, each point once; a rank has all points within the
  !> distance of its own, and knows who owns them.
  subroutine test_owners(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: distance = 0.12_wp
    type(body_type) :: whole, part
    type(work_of_points) :: work
    type(division_type) :: division
    integer, allocatable :: owner(:), owners(:), place(:)
    integer :: dim, ranks, r, i, j

    do dim = 1, 3
      call cloud(dim, 1500, whole)
      do ranks = 1, 7
        call work_of_body(whole, 1, work)
        call divide_space(work, ranks, division)
        if (allocated(owners)) deallocate (owners)
        allocate (owners(whole%n_points), source=-1)
        do r = 0, ranks - 1
          part = whole
          call take_part(division, r, distance, part, owner)
          associate (n => part%order%n_owned)
            call expect_true(error, all(owners(part%number(:n)) == -1), 'a point with two owners')
            owners(part%number(:n)) = r
            call expect_true(error, nint(division%work(r)) == n, 'the work of a rank')
            call expect_true(error, all(part%number(2:n) > part%number(:n - 1)), 'their order')
          end associate
        end do
        call expect_true(error, all(owners >= 0), 'a point without an owner')
        if (allocated(error)) return
        do r = 0, ranks - 1
          part = whole
          call take_part(division, r, distance, part, owner)
          allocate (place(whole%n_points), source=0)
          place(part%number) = [(i, i=1, part%n_points)]
          do i = 1, whole%n_points
            if (place(i) == 0) cycle
            call expect_true(error, all(abs(part%x(place(i), :) - whole%x(i, :)) <= 0.0_wp), &
              & 'the place of a point')
            if (place(i) > part%order%n_owned) then
              call expect_true(error, owner(place(i) - part%order%n_owned) == owners(i), &
                & 'the owner of a copy')
              cycle
            end if
            do j = 1, whole%n_points
              if (sum((whole%x(i, :) - whole%x(j, :))**2) > distance**2) cycle
              call expect_true(error, place(j) > 0, 'a neighbour that a rank does not have')
            end do
          end do
          deallocate (place)
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_owners

  !> Cuts lie between layers, also where layers are blocks of points.
  subroutine test_lattice(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: cells(3) = [37, 20, 11]
    real(wp), parameter :: dx = 0.013_wp
    type(body_type) :: body
    type(work_of_points) :: work
    type(division_type) :: division
    real(wp) :: in_layers
    integer :: i, j, k, n, ranks, blocks, p, c

    call allocate_points(body, 3, product(cells))
    n = 0
    do k = 1, cells(3)
      do j = 1, cells(2)
        do i = 1, cells(1)
          n = n + 1
          body%x(n, :) = dx*([i, j, k] - 0.5_wp) + 0.7_wp
        end do
      end do
    end do
    body%spacing = dx
    do blocks = 1, 8, 7
      do ranks = 2, 9
        call work_of_body(body, blocks, work)
        call divide_space(work, ranks, division)
        call expect(error, sum(division%work), real(n, wp), 0.0_wp, 'all points')
        do p = 1, division%parts
          c = division%axis(p)
          if (c == 0) cycle
          in_layers = (division%at(p) - 0.7_wp)/(dx*merge(blocks, 1, c == 1))
          ! positions are rounded
          call expect(error, in_layers, anint(in_layers), 1.0e-9_wp, 'a cut between layers')
        end do
      end do
    end do
  end subroutine test_lattice

  !> Within 5 % of the mean, wherever the layers lie: a rank's box is 46 cells wide.
  subroutine test_balance(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: ranks(8) = [2, 3, 5, 7, 16, 64, 1000, 4097]
    type(work_of_box) :: work
    type(division_type) :: division
    real(wp) :: edge
    integer :: r

    do r = 1, size(ranks)
      work%dim = 3
      edge = anint((1.0e5_wp*ranks(r))**(1.0_wp/3))
      work%lower = 0.0_wp
      work%upper = edge
      work%layer = 1.0_wp
      call divide_space(work, ranks(r), division)
      call expect(error, sum(division%work), edge**3, 0.0_wp, 'all points')
      call expect_true(error, maxval(division%work) <= 1.05_wp*edge**3/ranks(r), 'the largest rank')
    end do
  end subroutine test_balance

  !> 4642^3 points, more than 1e11, on 1e5 ranks: the whole tree, its balance and the halos for a
  !> horizon of three points.
  subroutine test_many_ranks(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: ranks = 100000, edge = 4642, reach = 3
    type(work_of_box) :: work
    type(division_type) :: division
    real(wp) :: box(3, 2), cells, halo
    integer :: r

    work%dim = 3
    work%lower = 0.0_wp
    work%upper = real(edge, wp)
    work%layer = 1.0_wp
    call divide_space(work, ranks, division)
    call expect_true(error, division%parts == 2*ranks - 1, 'the parts')
    ! sums of whole numbers below 2^53 are exact
    call expect(error, sum(division%work), real(edge, wp)**3, 0.0_wp, 'all points')
    call expect_true(error, maxval(division%work) <= 1.05_wp*real(edge, wp)**3/ranks, &
      & 'the largest rank')
    halo = 0.0_wp
    do r = 0, ranks - 1
      box = box_of(division, r)
      cells = product(box(:, 2) - box(:, 1))
      call expect(error, cells, division%work(r), 0.0_wp, 'the box of a rank')
      call expect_true(error, owner_of(division, (box(:, 1) + box(:, 2))/2) == r, 'its owner')
      halo = max(halo, (product(box(:, 2) - box(:, 1) + 2*reach) - cells)/cells)
    end do
    ! a cube of 100 cells would have (1 + 6/100)^3 - 1 = 19 %
    call expect_true(error, halo > 0.15_wp .and. halo < 0.25_wp, 'the largest halo')
  end subroutine test_many_ranks

  !> A rank that owns points with numbers above 2^31.
  subroutine test_large_numbers(error)
    type(error_type), allocatable, intent(out) :: error
    integer(i8), parameter :: before = 90000000000_i8
    type(body_type) :: body
    real(wp) :: values(50)
    integer :: i

    call cloud(2, 50, body)
    call own_points(body, 40, [(before + 3*i, i=1, 50)], before + 1000_i8)
    values = 0.0_wp
    values(17) = 1.0_wp
    values(45) = 2.0_wp
    associate (order => body%order)
      call expect_true(error, number_of(order, 17) == before + 51, 'the number of a point')
      call expect_true(error, first_largest(order, values) == before + 51, 'the first largest')
      call expect_true(error, first_where(order, values > 0.5_wp) == before + 51, 'the first')
      call expect_true(error, owned_point(order, before + 51) == 17, 'the point of a number')
      call expect_true(error, owned_point(order, before + 52) == 0, 'a number of another rank')
      call expect_true(error, owned_point(order, before + 3*45) == 0, 'a copy')
    end associate
  end subroutine test_large_numbers

end module test_body_division
