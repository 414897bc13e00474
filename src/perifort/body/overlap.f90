!> Bodies and layers that overlap: found by the arithmetic of their grids, in time linear in the
!> number of points.
module pd_body_overlap
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_lookup, only: lookup_type, mix
  use pd_base_error, only: error_type
  use pd_base_text, only: to_text
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: adds_layer, has_grid, scene_type
  use pd_body_body, only: body_type, grid_type, number_at
  use pd_body_lattices, only: cell_of, place_in
  use pd_body_refine, only: finer, level_of
  implicit none (type, external)
  private
  public :: check_lattices

  real(wp), parameter :: tolerance = 1.0e-6_wp  !! depth that a point may have in another body
                                                !! [spacings]

  !> The cells of one lattice body and its layers.
  type :: cells_type
    type(grid_type) :: grid
    integer :: n = 0                             !! points of the body, a cloud's too
    integer :: low(3) = huge(0)                  !! the box of cells around them
    integer :: high(3) = -huge(0)
    integer(i4), allocatable :: point(:, :, :)   !! the point in each cell of the box, 0 for none;
                                                 !! of a divided cell the last one
  end type cells_type

  !> Cells of the levels of `&refine` from 1 on: those that hold a point, and those of which a part
  !> does, each with such a point.
  type :: parts_type
    type(lookup_type) :: whole, divided
    integer(i4), allocatable :: in_whole(:), in_divided(:)
  end type parts_type

contains

  !> An error if a point of one lattice body or of its layers lies in another one by more than
  !> `tolerance`, if two layers of one body share a cell, or if a point of a cloud lies in a cell of
  !> a layer. A body is the union of the cells that are left of it: a point on the face between two
  !> of its cells lies in it, a point on its surface does not.
  subroutine check_lattices(scene, body, error)
    type(scene_type), intent(in) :: scene        !! gives the names of the bodies
    type(body_type), intent(in) :: body          !! in point order, with its lattices: all points,
                                                 !! or those that a rank has
    type(error_type), allocatable, intent(out) :: error
    type(cells_type), allocatable :: bodies(:)
    integer, allocatable :: first(:), order(:)
    logical, allocatable :: layered(:)
    integer :: a, b, k

    if (size(scene%bodies) == 1 .and. count(adds_layer(scene%boundaries)) < 2) return
    allocate (bodies(size(scene%bodies)), layered(size(scene%bodies)))
    layered = .false.
    do b = 1, size(bodies)
      if (has_grid(scene%bodies(b))) bodies(b)%grid = body%lattices(b)%grid
    end do
    do k = 1, body%n_points
      associate (one => bodies(body%body(k)))
        one%n = one%n + 1
        if (body%layer(k) > 0) layered(body%body(k)) = .true.
        if (body%grid(k) == 0) cycle
        one%low = min(one%low, cell_of(one%grid, body%x(k, :)))
        one%high = max(one%high, cell_of(one%grid, body%x(k, :)))
      end associate
    end do
    call sort_by_body(body, bodies%n, first, order)
    do b = 1, size(bodies)
      if (any(bodies(b)%low > bodies(b)%high)) cycle
      do a = 1, size(bodies)
        if (a == b .and. .not. layered(b)) cycle
        if (bodies(a)%n == 0 .or. .not. meet(a, b)) cycle
        if (.not. allocated(bodies(b)%point)) call place_points(scene, body, &
          & order(first(b):first(b + 1) - 1), bodies(b), error)
        if (allocated(error)) return
        if (a /= b) call look_for_points(scene, body, order(first(a):first(a + 1) - 1), bodies(b), &
          & error)
        if (allocated(error)) return
      end do
      if (allocated(bodies(b)%point)) deallocate (bodies(b)%point)
    end do

  contains

    !> Whether points of body `a` may lie in the box around body `b`.
    pure logical function meet(a, b)
      integer, intent(in) :: a, b
      integer :: c

      meet = .true.
      ! clouds matter to layers only
      if (.not. has_grid(scene%bodies(a))) then
        meet = layered(b)
        return
      end if
      if (bodies(a)%grid%turned .or. bodies(b)%grid%turned) return
      associate (one => bodies(a), other => bodies(b))
        do c = 1, body%dim
          meet = meet .and. centre(one%grid, c, one%low(c)) < centre(other%grid, c, &
            & other%high(c) + 1) .and. centre(one%grid, c, one%high(c)) > centre(other%grid, c, &
            & other%low(c) - 1)
        end do
      end associate
    end function meet

    !> Where a cell lies along axis `c` [m].
    pure real(wp) function centre(grid, c, cell)
      type(grid_type), intent(in) :: grid
      integer, intent(in) :: c, cell
      centre = grid%origin(c) + (cell - 0.5_wp)*grid%spacing
    end function centre
  end subroutine check_lattices

  !> The points of each body, layers included: `order(first(b):first(b + 1) - 1)`.
  pure subroutine sort_by_body(body, number, first, order)
    type(body_type), intent(in) :: body
    integer, intent(in) :: number(:)                 !! points of each body
    integer, allocatable, intent(out) :: first(:)    !! place in `order` (bodies + 1)
    integer, allocatable, intent(out) :: order(:)    !! points, body by body
    integer :: next(size(number)), b, k

    allocate (first(size(number) + 1), order(body%n_points))
    first(1) = 1
    do b = 1, size(number)
      first(b + 1) = first(b) + number(b)
    end do
    next = first(:size(number))
    do k = 1, body%n_points
      b = body%body(k)
      order(next(b)) = k
      next(b) = next(b) + 1
    end do
  end subroutine sort_by_body

  !> Put the points of one body into its cells; an error if two of them share one.
  subroutine place_points(scene, body, points, cells, error)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    integer, intent(in) :: points(:)                 !! of one body, its layers included
    type(cells_type), intent(inout) :: cells         !! with its box; `point` is made
    type(error_type), allocatable, intent(out) :: error
    type(parts_type) :: parts
    integer :: i, other, at(3)

    allocate (parts%in_whole(0), parts%in_divided(0))
    associate (low => cells%low, high => cells%high)
      allocate (cells%point(low(1):high(1), low(2):high(2), low(3):high(3)), source=0_i4)
    end associate
    do i = 1, size(points)
      at = cell_of(cells%grid, body%x(points(i), :))
      associate (there => cells%point(at(1), at(2), at(3)))
        if (there > 0_i4) then
          if (.not. (is_refined(int(there)) .and. is_refined(points(i)))) then
            call report(scene, body, int(there), points(i), error)
            return
          end if
        end if
        there = int(points(i), i4)
      end associate
      if (.not. is_refined(points(i))) cycle
      call place_part(body, cells%grid, points(i), parts, other)
      if (other == 0) cycle
      call report(scene, body, other, points(i), error)
      return
    end do

  contains

    !> Whether a point is one of several in a cell that is divided.
    pure logical function is_refined(k)
      integer, intent(in) :: k
      is_refined = body%spacing(k) < 0.75_wp*cells%grid%spacing
    end function is_refined

  end subroutine place_points

  !> Put a refined point into the cells of its level and note the cells of which it is a part;
  !> `other` is a point with which it shares one, or 0.
  subroutine place_part(body, grid, k, parts, other)
    type(body_type), intent(in) :: body
    type(grid_type), intent(in) :: grid         !! of the body's lattice
    integer, intent(in) :: k                    !! the point
    type(parts_type), intent(inout) :: parts
    integer, intent(out) :: other
    integer(i8) :: key(level_of(body, k))
    integer :: n, m

    n = size(key)
    do m = 1, n
      key(m) = key_of(m)
      other = found_in(parts%whole, parts%in_whole, key(m))
      if (other > 0) return
    end do
    other = found_in(parts%divided, parts%in_divided, key(n))
    if (other > 0) return
    call put(parts%whole, parts%in_whole, key(n))
    do m = 1, n - 1
      call put(parts%divided, parts%in_divided, key(m))
    end do

  contains

    !> The cell of level `m` in which the point lies.
    pure integer(i8) function key_of(m)
      integer, intent(in) :: m
      integer :: at(3)
      at = cell_of(finer(grid, m), body%x(k, :))
      key_of = mix(mix(mix(int(m, i8), int(at(1), i8)), int(at(2), i8)), int(at(3), i8))
    end function key_of

    !> The point that a table has under a key, if its cell meets that of this point; else 0.
    pure integer function found_in(table, point, key) result(j)
      type(lookup_type), intent(in) :: table
      integer(i4), intent(in) :: point(:)
      integer(i8), intent(in) :: key
      j = table%look(key)
      if (j == 0) return
      j = point(j)
      if (any(abs(body%x(j, :) - body%x(k, :)) > (0.5_wp - tolerance)*(body%spacing(j) &
        & + body%spacing(k)))) j = 0
    end function found_in

    subroutine put(table, point, key)
      type(lookup_type), intent(inout) :: table
      integer(i4), allocatable, intent(inout) :: point(:)
      integer(i8), intent(in) :: key
      integer :: number
      logical :: is_new
      call table%number_of(key, number, is_new)
      if (.not. is_new) return
      if (number > size(point)) point = [point, spread(0_i4, 1, max(1024, number))]
      point(number) = int(k, i4)
    end subroutine put

  end subroutine place_part

  !> An error if one of these points of another body lies in the cells; points of clouds must not
  !> lie in those of layers.
  subroutine look_for_points(scene, body, points, cells, error)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    integer, intent(in) :: points(:)                 !! of another body
    type(cells_type), intent(in) :: cells            !! of `place_points`
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: place(body%dim)
    integer :: i, c, low(3), high(3), inside, corners, other, x, y, z

    low = 1
    high = 1
    do i = 1, size(points)
      place = place_in(cells%grid, body%x(points(i), :))
      do c = 1, body%dim
        if (place(c) < cells%low(c) - 1.0_wp .or. place(c) > cells%high(c)) exit
        low(c) = floor(place(c) - tolerance) + 1
        high(c) = floor(place(c) + tolerance) + 1
        if (low(c) < cells%low(c) .or. high(c) > cells%high(c)) exit
      end do
      if (c <= body%dim) cycle
      ! of the cells around the point, one or, where it lies on their faces, several, more than half
      ! must be there: a point on the surface has half of them
      inside = 0
      corners = 0
      other = 0
      do z = low(3), high(3)
        do y = low(2), high(2)
          do x = low(1), high(1)
            corners = corners + 1
            if (cells%point(x, y, z) == 0_i4) cycle
            if (body%grid(points(i)) == 0) then
              if (body%layer(cells%point(x, y, z)) == 0) cycle
            end if
            inside = inside + 1
            other = cells%point(x, y, z)
          end do
        end do
      end do
      if (2*inside <= corners) cycle
      call report(scene, body, other, points(i), error)
      return
    end do
  end subroutine look_for_points

  !> Two points whose bodies or layers overlap.
  subroutine report(scene, body, k, j, error)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    integer, intent(in) :: k                         !! the point whose cell it is
    integer, intent(in) :: j                         !! the point that lies in it
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: group
    integer :: number

    if (body%layer(k) > 0 .or. body%layer(j) > 0) then
      group = 'boundary'
      number = max(int(body%layer(k)), int(body%layer(j)))
    else
      group = 'body'
      number = max(int(body%body(k)), int(body%body(j)))
    end if
    call scene_fault(error, scene, group, number, merge('side ', 'lower', group == 'boundary'), &
      & owner(k)//' and '//owner(j)//' overlap', 'point '//at(j)//' of the second lies in the '// &
      & 'cell of point '//at(k)//' of the first')

  contains

    !> The body or layer that a point belongs to.
    function owner(s) result(text)
      integer, intent(in) :: s
      character(:), allocatable :: text

      associate (b => int(body%body(s)))
        text = 'body '//to_text(b)
        if (scene%bodies(b)%name /= '') text = text//" '"//trim(scene%bodies(b)%name)//"'"
      end associate
      if (body%layer(s) > 0) text = 'the layer of &boundary number '// &
        & to_text(int(body%layer(s)))//' ('//trim(scene%boundaries(body%layer(s))%side)// &
        & ') at '//text
    end function owner

    !> A point's number and position.
    pure function at(s) result(text)
      integer, intent(in) :: s
      character(:), allocatable :: text
      integer :: c
      text = to_text(number_at(body, s))//' ('//to_text(body%x(s, 1))
      do c = 2, body%dim
        text = text//', '//to_text(body%x(s, c))
      end do
      text = text//')'
    end function at
  end subroutine report

end module pd_body_overlap
