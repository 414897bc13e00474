!> Pieces of points that bonds with unknown weights join (`pd_set_up_consistent_symmetries`): codes
!> of a piece in all ways to mirror it, and the layers that stand for others like them.
module pd_set_up_consistent_pieces
  use pd_base_kinds, only: i8
  use pd_base_lookup, only: mix
  use pd_set_up_consistent_patterns, only: patterns_type
  implicit none (type, external)
  private
  public :: piece_type, find_pieces, find_codes, find_layers, join_layers, mirrored_place, &
    & layer_of, mirrors, both

  !> A piece of points that hang together.
  type :: piece_type
    integer, allocatable :: list(:)            !! slots, by their places
    integer :: low(3) = 0, high(3) = 0         !! the least and the largest places
    integer(i8) :: least = 0_i8                !! the least of the codes that it has in all ways
    logical, allocatable :: same(:)            !! (ways) with this code
    integer, allocatable :: layer(:, :)        !! (places, dim) place of the layer that stands for
                                               !! that at a place along an axis
    logical :: alone = .false.                 !! it has no symmetries, and no other piece is alike
  end type piece_type

contains

  !> Whether a way mirrors an axis: bit by bit what is set in its number, less 1.
  elemental logical function mirrors(way, axis)
    integer, intent(in) :: way   !! number, 1: no axis
    integer, intent(in) :: axis  !! 1 to 3
    mirrors = btest(way - 1, axis - 1)
  end function mirrors

  !> The way to mirror that is one after another, in either order.
  elemental integer function both(one, other) result(way)
    integer, intent(in) :: one    !! way
    integer, intent(in) :: other  !! way
    way = 1 + ieor(one - 1, other - 1)
  end function both

  !> Pieces of points that bonds with unknown weights join, by the place of the first point.
  subroutine find_pieces(near, patterns, place, slot_at, piece, pieces)
    logical, intent(in) :: near(:)             !! (n_slots) points whose bonds have unknown weights
    type(patterns_type), intent(in) :: patterns          !! of the families
    integer, intent(in) :: place(:, :)                   !! (3, n_slots) places along the axes
    integer, intent(in) :: slot_at(:, :, :)              !! slots at places; 0: none
    integer, allocatable, intent(out) :: piece(:)        !! (n_slots) of each point; 0: none
    type(piece_type), allocatable, intent(out) :: pieces(:)
      !! with slots and places
    integer, allocatable :: order(:), reached(:), next(:)
    integer :: i, j, k, n, p, count_of
    integer(i8) :: e

    ! by places, x fastest
    order = pack(slot_at, slot_at > 0)
    order = pack(order, near(order))
    allocate (piece(size(near)), source=0)
    allocate (reached(size(order)))
    p = 0
    do i = 1, size(order)
      if (piece(order(i)) > 0) cycle
      p = p + 1
      piece(order(i)) = p
      reached(1) = order(i)
      n = 1
      count_of = 0
      do while (count_of < n)
        count_of = count_of + 1
        k = reached(count_of)
        associate (of => patterns%of(k), start => patterns%start)
          do e = start(of), start(of + 1) - 1
            j = k + int(patterns%ahead(e))
            if (piece(j) > 0 .or. .not. near(j)) cycle
            piece(j) = p
            n = n + 1
            reached(n) = j
          end do
        end associate
      end do
    end do
    allocate (pieces(p), next(p))
    next = 0
    do i = 1, size(order)
      next(piece(order(i))) = next(piece(order(i))) + 1
    end do
    do p = 1, size(pieces)
      allocate (pieces(p)%list(next(p)))
    end do
    next = 0
    do i = 1, size(order)
      associate (of => pieces(piece(order(i))), n => next(piece(order(i))))
        n = n + 1
        of%list(n) = order(i)
      end associate
    end do
    do p = 1, size(pieces)
      pieces(p)%low = minval(place(:, pieces(p)%list), dim=2)
      pieces(p)%high = maxval(place(:, pieces(p)%list), dim=2)
    end do
  end subroutine find_pieces

  !> Places in a piece, mirrored in it.
  pure function mirrored_place(piece, way, place) result(at)
    type(piece_type), intent(in) :: piece
    integer, intent(in) :: way       !! number
    integer, intent(in) :: place(3)  !! in the piece
    integer :: at(3)
    integer :: d

    at = merge(piece%low + piece%high - place, place, [(mirrors(way, d), d=1, 3)])
  end function mirrored_place

  !> The least of a piece's codes in all ways to see it.
  subroutine find_codes(fixed, place, piece)
    logical, intent(in) :: fixed(:)          !! (n_slots) areas that loads act through
    integer, intent(in) :: place(:, :)       !! (3, n_slots) places along the axes
    type(piece_type), intent(inout) :: piece !! gets `least` and `same`, which has its size
    integer(i8), allocatable :: code(:)
    integer(i8) :: of_point
    integer :: at(3), w, i, d

    allocate (code(size(piece%same)), source=0_i8)
    !$omp parallel do schedule(static) default(none) private(w, i, d, at, of_point) &
    !$omp shared(fixed, place, piece, code)
    do w = 1, size(code)
      do i = 1, size(piece%list)
        at = mirrored_place(piece, w, place(:, piece%list(i))) - piece%low
        of_point = merge(1_i8, 0_i8, fixed(piece%list(i)))
        do d = 1, size(at)
          of_point = mix(of_point, int(at(d), i8))
        end do
        code(w) = ieor(code(w), mix(1_i8, of_point))
      end do
    end do
    piece%least = minval(code)
    piece%same = code == piece%least
  end subroutine find_codes

  !> Layers of a piece across an axis that follow each other and are all alike: but for those near
  !> the first and the last one, one of them stands for all.
  subroutine find_layers(fixed, place, wide, piece)
    logical, intent(in) :: fixed(:)          !! (n_slots) areas that loads act through
    integer, intent(in) :: place(:, :)       !! (3, n_slots) places along the axes
    integer, intent(in) :: wide              !! layers at either end that are not like others
    type(piece_type), intent(inout) :: piece !! gets `layer`
    integer(i8), allocatable :: code(:)
    integer(i8) :: of_point
    integer :: d, c, i, first, last

    allocate (piece%layer(maxval(piece%high), 3))
    do d = 1, 3
      piece%layer(:, d) = [(i, i=1, size(piece%layer, 1))]
      if (piece%high(d) - piece%low(d) <= 2*wide) cycle
      if (allocated(code)) deallocate (code)
      allocate (code(piece%low(d):piece%high(d)), source=0_i8)
      do i = 1, size(piece%list)
        associate (at => place(:, piece%list(i)))
          of_point = merge(1_i8, 0_i8, fixed(piece%list(i)))
          do c = 1, 3
            if (c /= d) of_point = mix(of_point, int(at(c), i8))
          end do
          code(at(d)) = ieor(code(at(d)), mix(1_i8, of_point))
        end associate
      end do
      first = piece%low(d)
      do while (first <= piece%high(d))
        last = first
        do while (last < piece%high(d))
          if (code(last + 1) /= code(first)) exit
          last = last + 1
        end do
        call join_layers(first, last, wide, piece%layer(:, d))
        first = last + 1
      end do
    end do
  end subroutine find_layers

  !> Let one layer stand for all between a first and a last one that are far from these.
  pure subroutine join_layers(first, last, wide, layer)
    integer, intent(in) :: first           !! layer
    integer, intent(in) :: last            !! layer
    integer, intent(in) :: wide            !! layers at either end that stand for themselves
    integer, intent(inout) :: layer(:)     !! that stands for each

    if (last - first > 2*wide) layer(first + wide:last - wide) = first + wide
  end subroutine join_layers

  !> The place in the layers that stand for those of a place.
  pure function layer_of(piece, place) result(at)
    type(piece_type), intent(in) :: piece
    integer, intent(in) :: place(:)        !! (up to 3) along the axes
    integer :: at(3)
    integer :: d

    at = 1
    do d = 1, size(place)
      at(d) = piece%layer(place(d), d)
    end do
  end function layer_of

end module pd_set_up_consistent_pieces
