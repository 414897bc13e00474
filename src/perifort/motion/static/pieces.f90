!> Connected pieces of a body: points that chains of intact bonds join. What is in equilibrium is a
!> piece, not the body.
module pd_motion_static_pieces
  use pd_base_joining, only: each_alone, unite, settle_groups
  use pd_base_kinds, only: wp, i4
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type
  use pd_family_family, only: family_type, bonds_type, allocate_bonds
  implicit none (type, external)
  private
  public :: pieces_type, find_pieces, piece_text

  !> Which points belong together. Pieces are numbered by their first points.
  type :: pieces_type
    integer :: number = 0
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
  end subroutine find_pieces

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
      if (size(slots) == 1) then
        text = 'point '//to_text(int(body%point(slots(1))))//' (without intact bonds) at ('
      else
        text = 'the piece of '//to_text(size(slots))//' points (point '// &
          & to_text(int(minval(body%point(slots))))//' is one of them) around ('
      end if
      do c = 1, body%dim
        centre = sum(body%x(slots, c))/size(slots)
        if (c > 1) text = text//', '
        text = text//to_text(centre, 4)
      end do
      text = text//')'
    end associate
  end function piece_text

end module pd_motion_static_pieces
