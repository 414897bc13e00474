!> Pairs of points that are near each other in the deformed state.
module pd_force_pairs
  use pd_base_kinds, only: wp, i4
  use pd_base_order, only: ascending_order
  use pd_body_body, only: body_type
  use pd_family_cells, only: cells_type, rows_around, sort_into_cells
  use pd_force_term, only: term_view_type
  implicit none (type, external)
  private
  public :: pairs_type, search_pairs

  integer, parameter :: at_once = 256   !! points of a piece of work

  !> Pairs that are near, from both their ends.
  type :: pairs_type
    integer(i4), allocatable :: slots(:)   !! points that are near others, in order
    integer, allocatable :: start(:)       !! (slots + 1) first near one of each
    integer(i4), allocatable :: other(:)   !! slots, of each in the order of points
    integer(i4), allocatable :: place(:)   !! where each of these stands in `slots`
  end type pairs_type

  !> Points that are searched, cell by cell.
  type :: near_type
    real(wp), allocatable :: place(:, :)   !! (3, points) [m]
    real(wp), allocatable :: reach(:)      !! of each [m]
    real(wp), allocatable :: within(:)     !! of each, for others of its body [m]
    integer, allocatable :: side(:)        !! of each
    integer, allocatable :: body(:)        !! of each
    integer, allocatable :: in_order(:)    !! which candidate each is
    logical :: alike = .false.             !! points of one side are searched, too
    real(wp) :: farthest = 0.0_wp          !! square of the distance of any pair [m2]
  end type near_type

  !> What one piece of work finds.
  type :: found_type
    integer, allocatable :: counts(:)      !! others of each point
    integer(i4), allocatable :: other(:)   !! places in the list of points
  end type found_type

contains

  !> Find the pairs closer than the sum of both their `reach`, or of points of one body than that of
  !> both their `within`; of points that are not `alike` on any side, those of different sides
  !> alone.
  !>
  !> All points of a side are searched, those inside of a body, too. That a surface point would come
  !> near first holds only while the bodies have not entered each other: what is crushed or fast
  !> gets to inner points. Of two sides, points beyond the box around the other side have none near,
  !> wherever the surfaces are, and are left out.
  subroutine search_pairs(view, slots, side, reach, within, alike, pairs)
    type(term_view_type), intent(in) :: view     !! the instant
    integer(i4), intent(in) :: slots(:)          !! of the points, in order
    integer, intent(in) :: side(:)               !! of each
    real(wp), intent(in) :: reach(:)             !! of each [m]
    real(wp), intent(in) :: within(:)            !! of each, for others of its body [m]
    logical, intent(in) :: alike                 !! points of one side are searched, too
    type(pairs_type), intent(out) :: pairs
    type(cells_type) :: cells
    type(found_type), allocatable :: found(:)
    type(near_type) :: near
    real(wp), allocatable :: y(:, :)
    integer, allocatable :: number(:)
    integer :: c

    call take_candidates(view, slots, side, reach, alike, y, number)
    allocate (pairs%slots(0), pairs%other(0), pairs%place(0))
    pairs%start = [1]
    if (size(number) == 0) return
    call sort_into_cells(y, 2*maxval(reach), cells)
    ! side by side, cell by cell, in three dimensions, so that loops over them are none
    near%alike = alike
    near%farthest = max(2*maxval(reach), 2*maxval(within))**2
    near%in_order = cells%order
    allocate (near%place(3, size(number)), source=0.0_wp)
    do c = 1, size(y, 2)
      near%place(c, :) = y(near%in_order, c)
    end do
    number = number(near%in_order)
    near%reach = reach(number)
    near%within = within(number)
    near%side = side(number)
    near%body = view%body%body(slots(number))
    allocate (found((size(number) - 1)/at_once + 1))
    call find_all(cells, near, found)
    call join(slots, number, near%in_order, found, pairs)
  end subroutine search_pairs

  !> Points that may have others near, and where they are.
  subroutine take_candidates(view, slots, side, reach, alike, y, number)
    type(term_view_type), intent(in) :: view
    integer(i4), intent(in) :: slots(:)
    integer, intent(in) :: side(:)
    real(wp), intent(in) :: reach(:)
    logical, intent(in) :: alike
    real(wp), allocatable, intent(out) :: y(:, :)    !! (points, dim) [m]
    integer, allocatable, intent(out) :: number(:)   !! in `slots`
    logical, allocatable :: here(:)
    real(wp) :: low, high, most
    integer :: i, c, m, n

    n = size(slots)
    allocate (y(n, size(view%u, 2)))
    !$omp parallel do collapse(2) schedule(static) default(none) shared(y, view, slots, n) &
    !$omp private(i, c)
    do c = 1, size(view%u, 2)
      do i = 1, n
        y(i, c) = view%body%x(slots(i), c) + view%u(slots(i), c)
      end do
    end do
    allocate (here(n), source=.true.)
    if (.not. alike .and. n > 0) then
      if (maxval(side) <= 2) then
        most = 2*maxval(reach)
        do m = 1, maxval(side)
          if (count(side == m) == 0) cycle
          do c = 1, size(y, 2)
            low = minval(y(:, c), mask=side == m) - most
            high = maxval(y(:, c), mask=side == m) + most
            where (side /= m) here = here .and. y(:, c) >= low .and. y(:, c) <= high
          end do
        end do
      end if
    end if
    number = pack([(i, i=1, n)], here)
    if (size(number) < n) y = y(number, :)
  end subroutine take_candidates

  !> The near ones of all points, cell by cell.
  subroutine find_all(cells, near, found)
    type(cells_type), intent(in) :: cells
    type(near_type), intent(in) :: near
    type(found_type), intent(inout) :: found(:)
    integer(i4), allocatable :: others(:), list(:)
    integer :: piece, p, filled, n

    !$omp parallel default(none) shared(cells, near, found) &
    !$omp private(others, list, piece, p, filled, n)
    allocate (others(64), list(64*at_once))
    !$omp do schedule(dynamic)
    do piece = 1, size(found)
      associate (first => (piece - 1)*at_once + 1, last => min(piece*at_once, size(near%side)))
        allocate (found(piece)%counts(last - first + 1))
        filled = 0
        do p = first, last
          call visit_cells(cells, near, p, others, n)
          found(piece)%counts(p - first + 1) = n
          if (n == 0) cycle
          if (filled + n > size(list)) list = [list, list, others(:n)]
          list(filled + 1:filled + n) = others(:n)
          filled = filled + n
        end do
        found(piece)%other = list(:filled)
      end associate
    end do
    !$omp end parallel
  end subroutine find_all

  !> The near ones of one point in the cells around it.
  subroutine visit_cells(cells, near, p, others, n)
    type(cells_type), intent(in) :: cells
    type(near_type), intent(in) :: near
    integer, intent(in) :: p
    integer(i4), allocatable, intent(inout) :: others(:)   !! grows as needed
    integer, intent(out) :: n
    real(wp) :: here(3), d2, sum_of_both
    integer :: rows(2, 9), count_of_rows, r, q

    here = near%place(:, p)
    n = 0
    call rows_around(cells, int(cells%cell(near%in_order(p))), rows, count_of_rows)
    do r = 1, count_of_rows
      do q = rows(1, r), rows(2, r)
        d2 = (near%place(1, q) - here(1))**2 + (near%place(2, q) - here(2))**2 &
          & + (near%place(3, q) - here(3))**2
        if (d2 > near%farthest .or. q == p) cycle
        sum_of_both = near%reach(p) + near%reach(q)
        if (near%body(q) == near%body(p)) sum_of_both = near%within(p) + near%within(q)
        if (d2 > sum_of_both**2) cycle
        if (.not. near%alike .and. near%side(q) == near%side(p)) cycle
        if (n == size(others)) others = [others, others]
        n = n + 1
        others(n) = int(near%in_order(q), i4)
      end do
    end do
  end subroutine visit_cells

  !> Bring what was found into the order of points.
  subroutine join(slots, number, in_order, found, pairs)
    integer(i4), intent(in) :: slots(:)
    integer, intent(in) :: number(:)           !! in `slots`, of each point cell by cell
    integer, intent(in) :: in_order(:)         !! which candidate each is
    type(found_type), intent(in) :: found(:)
    type(pairs_type), intent(inout) :: pairs
    integer, allocatable :: counts(:), begin(:), of_candidate(:)
    integer(i4), allocatable :: near(:), rank(:)
    integer :: piece, i, p, at, n

    allocate (counts(size(number)), begin(size(number)), of_candidate(size(number)))
    of_candidate(in_order) = number
    p = 0
    do piece = 1, size(found)
      at = 1
      do i = 1, size(found(piece)%counts)
        p = p + 1
        counts(in_order(p)) = found(piece)%counts(i)
        begin(in_order(p)) = at
        at = at + found(piece)%counts(i)
      end do
    end do
    ! candidates stand in the order of points
    deallocate (pairs%slots, pairs%start, pairs%other, pairs%place)
    allocate (rank(size(number)))
    n = 0
    do i = 1, size(number)
      if (counts(i) > 0) n = n + 1
      rank(i) = int(n, i4)
    end do
    allocate (pairs%slots(n), pairs%start(n + 1), pairs%other(sum(counts)))
    allocate (pairs%place(size(pairs%other)))
    of_piece: block
      integer, allocatable :: piece_of(:)

      allocate (piece_of(size(number)))
      do p = 1, size(number)
        piece_of(in_order(p)) = (p - 1)/at_once + 1
      end do
      n = 0
      at = 1
      do i = 1, size(number)
        if (counts(i) == 0) cycle
        n = n + 1
        pairs%slots(n) = slots(of_candidate(i))
        pairs%start(n) = at
        near = found(piece_of(i))%other(begin(i):begin(i) + counts(i) - 1)
        if (size(near) > 1) near = near(ascending_order(near))
        pairs%other(at:at + counts(i) - 1) = slots(of_candidate(near))
        pairs%place(at:at + counts(i) - 1) = rank(near)
        at = at + counts(i)
      end do
      pairs%start(n + 1) = at
    end block of_piece
  end subroutine join

end module pd_force_pairs
