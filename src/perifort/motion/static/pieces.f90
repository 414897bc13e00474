!> Connected pieces of a body: points that chains of intact bonds join. What is in equilibrium is a
!> piece, not the body.
module pd_motion_static_pieces
  use pd_base_joining, only: each_alone, unite, settle_groups
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_order, only: ascending_order, place_in
  use pd_base_reduce, only: any_of_ranks, count_of_ranks
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type, share_halo
  use pd_family_family, only: family_type, bonds_type, allocate_bonds
  implicit none (type, external)
  private
  public :: pieces_type, find_pieces, piece_text

  !> Which points belong together. Pieces are numbered by their first points, on all ranks alike; a
  !> rank may have no point of some.
  type :: pieces_type
    integer :: number = 0
    integer(i8), allocatable :: first(:)   !! number of each piece's first point, among all
    integer(i8), allocatable :: points(:)  !! how many it has, on all ranks
    integer(i4), allocatable :: of(:)      !! piece of each slot, 0 at dead slots
    integer(i4), allocatable :: start(:)   !! first place of each piece in `slots` (number + 1)
    integer(i4), allocatable :: slots(:)   !! piece by piece, in the order of points
  end type pieces_type

contains

  !> The pieces of `body` as its bonds are now.
  subroutine find_pieces(body, family, pieces)
    type(body_type), intent(in) :: body         !! points
    class(family_type), intent(in) :: family    !! their bonds
    type(pieces_type), intent(out) :: pieces    !! what is joined
    type(bonds_type) :: bonds
    integer(i4), allocatable :: parent(:)
    integer(i4) :: k, first
    integer :: i, n

    n = body%n_slots
    parent = each_alone(n)
    call allocate_bonds(family, bonds)
    do k = 1, int(n, i4)
      if (body%point(k) == 0) cycle
      call family%bonds_of(int(k), bonds)
      do i = 1, bonds%n
        ! each bond is seen from both ends
        if (bonds%j(i) > k .or. .not. bonds%intact(i)) cycle
        call unite(parent, k, bonds%j(i))
      end do
    end do
    call settle_groups(parent)
    if (associated(body%order%ranks)) then
      call join_over_ranks(body, parent, pieces)
      call list_slots(body, pieces)
      return
    end if
    allocate (pieces%of(n), source=0_i4)
    do i = 1, body%n_points
      first = parent(body%slot(i))
      if (pieces%of(first) == 0_i4) then
        pieces%number = pieces%number + 1
        pieces%of(first) = int(pieces%number, i4)
      end if
      pieces%of(body%slot(i)) = pieces%of(first)
    end do
    call list_slots(body, pieces)
    pieces%points = pieces%start(2:) - pieces%start(:pieces%number)
    pieces%first = body%point(pieces%slots(pieces%start(:pieces%number)))
  end subroutine find_pieces

  !> The pieces of all ranks from those of the points that each rank has. Where a piece goes on, it
  !> is known by the lowest number of its points that the ranks have told each other, until they all
  !> agree.
  subroutine join_over_ranks(body, parent, pieces)
    type(body_type), intent(in) :: body
    integer(i4), intent(in) :: parent(:)    !! the first slot of each slot's piece here
    type(pieces_type), intent(inout) :: pieces
    real(wp), allocatable :: label(:), of_parent(:), all_first(:), counted(:)
    integer(i8) :: mine, before
    integer :: i, k, p, n
    logical :: changed

    allocate (label(body%n_slots), of_parent(body%n_slots), source=0.0_wp)
    do i = 1, body%n_points
      label(body%slot(i)) = real(body%number(i), wp)
    end do
    do
      of_parent = real(body%order%n_global + 1_i8, wp)
      do i = 1, body%n_points
        k = body%slot(i)
        of_parent(parent(k)) = min(of_parent(parent(k)), label(k))
      end do
      changed = .false.
      do i = 1, body%n_points
        k = body%slot(i)
        changed = changed .or. of_parent(parent(k)) < label(k)
        label(k) = of_parent(parent(k))
      end do
      if (.not. any_of_ranks(body%order, changed)) exit
      call share_halo(body, label)
    end do
    ! a piece is counted where its first point is owned
    mine = 0_i8
    do i = 1, body%order%n_owned
      if (nint(label(body%slot(i)), i8) == body%number(i)) mine = mine + 1_i8
    end do
    before = body%order%ranks%number_before(mine)
    pieces%number = int(count_of_ranks(body%order, mine))
    allocate (all_first(pieces%number), counted(pieces%number), source=0.0_wp)
    n = int(before)
    do i = 1, body%order%n_owned
      if (nint(label(body%slot(i)), i8) /= body%number(i)) cycle
      n = n + 1
      all_first(n) = label(body%slot(i))
    end do
    call body%order%ranks%add_all(all_first)
    pieces%first = nint(all_first, i8)
    pieces%first = pieces%first(ascending_order(pieces%first))
    allocate (pieces%of(body%n_slots), source=0_i4)
    do i = 1, body%n_points
      k = body%slot(i)
      p = place_in(pieces%first, nint(label(k), i8))
      pieces%of(k) = int(p, i4)
      if (i <= body%order%n_owned) counted(p) = counted(p) + 1
    end do
    call body%order%ranks%add_all(counted)
    pieces%points = nint(counted, i8)
  end subroutine join_over_ranks

  !> Slots piece by piece.
  pure subroutine list_slots(body, pieces)
    type(body_type), intent(in) :: body
    type(pieces_type), intent(inout) :: pieces
    integer(i4), allocatable :: next(:)
    integer(i4) :: k
    integer :: p, i

    allocate (pieces%start(pieces%number + 1), source=0_i4)
    do k = 1, size(pieces%of, kind=i4)
      p = pieces%of(k)
      if (p > 0) pieces%start(p + 1) = pieces%start(p + 1) + 1_i4
    end do
    pieces%start(1) = 1_i4
    do p = 1, pieces%number
      pieces%start(p + 1) = pieces%start(p + 1) + pieces%start(p)
    end do
    allocate (pieces%slots(pieces%start(pieces%number + 1) - 1))
    next = pieces%start
    do i = 1, body%n_points
      k = body%slot(i)
      p = pieces%of(k)
      pieces%slots(next(p)) = k
      next(p) = next(p) + 1_i4
    end do
  end subroutine list_slots

  !> A piece in words: how many points and where; 'the body' if there is but one.
  function piece_text(body, pieces, piece) result(text)
    type(body_type), intent(in) :: body         !! points
    type(pieces_type), intent(in) :: pieces     !! its pieces
    integer, intent(in) :: piece                !! the number of one
    character(:), allocatable :: text
    real(wp) :: centre
    integer :: c

    text = 'the body'
    if (pieces%number == 1) return
    associate (slots => pieces%slots(pieces%start(piece):pieces%start(piece + 1) - 1))
      if (pieces%points(piece) == 1_i8) then
        text = 'point '//to_text(pieces%first(piece))//' (without intact bonds)'
      else
        text = 'the piece of '//to_text(pieces%points(piece))//' points (point '// &
          & to_text(pieces%first(piece))//' is one of them)'
      end if
      ! where it is, other ranks may know
      if (associated(body%order%ranks)) return
      text = text//trim(merge(' at    ', ' around', pieces%points(piece) == 1_i8))//' ('
      do c = 1, body%dim
        centre = sum(body%x(slots, c))/size(slots)
        if (c > 1) text = text//', '
        text = text//to_text(centre, 4)
      end do
      text = text//')'
    end associate
  end function piece_text

end module pd_motion_static_pieces
