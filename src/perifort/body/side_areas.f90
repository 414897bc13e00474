!> Surface areas of points side by side, and their balance: the moments that weights of bonds need
!> (`pd_body_mesh_moments`).
module pd_body_side_areas
  use pd_base_kinds, only: wp, i4
  use pd_body_mesh_moments, only: fields_at, keep_sums, number_of_fields, solve_moments
  implicit none (type, external)
  private
  public :: side_areas_type, balance_sides, total_areas

  !> Faces of one normal on one body are a side; those at its outermost plane are another one than
  !> the rest, such as faces of holes.
  type :: side_areas_type
    integer, allocatable :: body(:)         !! (sides) number of the body, 0: layers
    integer, allocatable :: axis(:)         !! (sides) of the normal; 0: of all, by components
    integer, allocatable :: outward(:)      !! (sides) -1 or 1, where the normal points
    logical, allocatable :: outermost(:)    !! (sides) whether the faces are the body's outermost
    integer(i4), allocatable :: start(:)    !! (sides + 1) first entry of each side
    integer(i4), allocatable :: slot(:)     !! (entries) of points that share the side
    real(wp), allocatable :: face(:)        !! (entries) area of a face of the point [m2]
    real(wp), allocatable :: area(:, :)     !! (dim, entries) outward area; may be 0 [m2]
  end type side_areas_type

contains

  !> Change the areas of all sides by the least amount, beside that of a face, with which they have
  !> the moments that weights of bonds need. Each side's sum stays, and its first moments, if that
  !> is possible; of a side without axis both may change. `found` is false if there is no such
  !> change.
  subroutine balance_sides(x, volume, sides, found)
    real(wp), intent(in) :: x(:, :)                 !! (n_slots, dim) [m]
    real(wp), intent(in) :: volume(:)               !! (n_slots) 0 in dead slots [m3]
    type(side_areas_type), intent(inout) :: sides   !! of these points
    logical, intent(out) :: found
    real(wp), parameter :: flat = 1.0e-9_wp  !! error of linear moments of whole faces [-]
    real(wp), allocatable :: matrix(:, :), right(:), missing(:), w(:, :), divergence(:)
    real(wp), allocatable :: multiplier(:), values(:, :)
    real(wp) :: origin(size(x, 2)), scale, total
    logical :: linear
    integer, parameter :: passes = 3
    integer :: dim, n, s, pass

    dim = size(x, 2)
    n = number_of_fields(dim)
    allocate (w(dim, n), divergence(n), matrix(n, n), right(n), multiplier(n))
    call frame_of(x, volume, origin, scale)
    total = sum(volume)/scale
    call find_missing(right)
    linear = maxval(abs(right(:dim*(dim + 1)))) <= flat*total
    do
      matrix = 0.0_wp
      missing = right
      do s = 1, size(sides%axis)
        call fields_of_side(s, values)
        matrix = matrix + matmul(transpose(values), values)
      end do
      call solve_moments(matrix, missing, multiplier)
      found = maxval(abs(matmul(matrix, multiplier) - missing)) <= flat*total
      if (found .or. .not. linear) exit
      linear = .false.
    end do
    if (.not. found) return
    ! what rounding leaves of the sums would stay in the conditions on weights
    do pass = 1, passes
      do s = 1, size(sides%axis)
        call fields_of_side(s, values)
        call change_side(s, matmul(values, multiplier))
      end do
      if (pass == passes) exit
      call find_missing(missing)
      call solve_moments(matrix, missing, multiplier)
    end do

  contains

    !> What the areas miss of each sum.
    subroutine find_missing(right)
      real(wp), intent(out) :: right(:)
      integer :: k, e

      right = 0.0_wp
      do k = 1, size(volume)
        if (.not. volume(k) > 0.0_wp) cycle
        call fields_at((x(k, :) - origin)/scale, w, divergence)
        right = right + volume(k)/scale*divergence
      end do
      do e = 1, size(sides%slot)
        call fields_at((x(sides%slot(e), :) - origin)/scale, w, divergence)
        right = right - matmul(sides%area(:, e), w)
      end do
    end subroutine find_missing

    !> What a unit of each multiplier changes the entries of a side by, over the root of the face:
    !> (entries, fields), for a side without axis its components one after another.
    subroutine fields_of_side(s, values)
      integer, intent(in) :: s
      real(wp), allocatable, intent(inout) :: values(:, :)
      real(wp), allocatable :: root(:)
      integer :: e, c, row, rows

      associate (first => sides%start(s), last => sides%start(s + 1) - 1, axis => sides%axis(s))
        rows = (last - first + 1)*merge(dim, 1, axis == 0)
        if (allocated(values)) deallocate (values)
        allocate (values(rows, n))
        root = sqrt(sides%face(first:last))
        row = 0
        do c = 1, dim
          if (axis /= 0 .and. axis /= c) cycle
          do e = first, last
            row = row + 1
            call fields_at((x(sides%slot(e), :) - origin)/scale, w, divergence)
            values(row, :) = w(c, :)*root(e - first + 1)
          end do
        end do
        if (axis == 0) return
        call keep_sums(x(sides%slot(first:last), :), linear, values, root)
      end associate
    end subroutine fields_of_side

    !> Add the change of a side.
    subroutine change_side(s, change)
      integer, intent(in) :: s
      real(wp), intent(in) :: change(:)
      integer :: e, c, row

      row = 0
      do c = 1, dim
        if (sides%axis(s) /= 0 .and. sides%axis(s) /= c) cycle
        do e = sides%start(s), sides%start(s + 1) - 1
          row = row + 1
          sides%area(c, e) = sides%area(c, e) + change(row)*sqrt(sides%face(e))
        end do
      end do
    end subroutine change_side

  end subroutine balance_sides

  !> The centre of the box around the points, and half of its longest edge.
  pure subroutine frame_of(x, volume, origin, scale)
    real(wp), intent(in) :: x(:, :), volume(:)
    real(wp), intent(out) :: origin(:), scale
    real(wp) :: low, high
    integer :: c

    scale = tiny(1.0_wp)
    do c = 1, size(x, 2)
      low = minval(x(:, c), mask=volume > 0.0_wp)
      high = maxval(x(:, c), mask=volume > 0.0_wp)
      origin(c) = (low + high)/2
      scale = max(scale, (high - low)/2)
    end do
  end subroutine frame_of

  !> The outward areas of all points (n_slots, dim) [m2; m x thickness; cross section].
  pure function total_areas(sides, n_slots, dim) result(area)
    type(side_areas_type), intent(in) :: sides  !! balanced
    integer, intent(in) :: n_slots              !! of the body
    integer, intent(in) :: dim                  !! of the scene
    real(wp), allocatable :: area(:, :)
    integer :: e

    allocate (area(n_slots, dim), source=0.0_wp)
    do e = 1, size(sides%slot)
      associate (k => sides%slot(e))
        area(k, :) = area(k, :) + sides%area(:, e)
      end associate
    end do
  end function total_areas

end module pd_body_side_areas
