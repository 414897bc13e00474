!> Values at the nodes and of the elements of a mesh, from those of its points, as weighted sums.
module pd_body_mesh_nodal
  use pd_base_eigen, only: eigenvectors
  use pd_base_kinds, only: wp, i4, i8
  use pd_body_mesh_around, only: around_type, elements_at_nodes, points_of, widen
  use pd_body_mesh_part, only: part_type
  implicit none (type, external)
  private
  public :: sums_type, nodes_with_points, sums_of_nodes, sums_of_elements, append_sums, summed

  integer, parameter :: most_rings = 3  !! of elements around a node that a linear fit may use
  !> How far outside of the points, in their standard deviations along a direction, a linear fit
  !> goes.
  real(wp), parameter :: farthest = 4.0_wp
  !> A variance, over that of all directions, of points that lie in a plane or on a line.
  real(wp), parameter :: flat = 1.0e-12_wp

  !> Weighted sums of values of points, one after another. The weights of each sum add to 1.
  type :: sums_type
    integer(i8), allocatable :: first(:)   !! (sums + 1) where the terms of each begin
    integer(i4), allocatable :: point(:)   !! (terms) numbers of points
    real(wp), allocatable :: weight(:)     !! (terms) [-]
  end type sums_type

contains

  !> The nodes of elements that have points, in ascending order.
  pure function nodes_with_points(part) result(nodes)
    type(part_type), intent(in) :: part     !! with its faces
    integer(i4), allocatable :: nodes(:)
    logical, allocatable :: used(:)
    integer :: e, i

    allocate (used(part%mesh%n_nodes), source=.false.)
    do e = 1, part%mesh%n_elements
      if (part%points(2, e) > 0_i4) used(part%mesh%nodes_of(e)) = .true.
    end do
    nodes = pack([(int(i, i4), i=1, size(used))], used)
  end function nodes_with_points

  !> Values of nodes: the means, by volume, of the points of the elements around each one, and the
  !> values there of the linear function that fits those points best, by volume. The fit takes more
  !> rings of elements, up to three, where the points lie too close to a plane or line for it; a
  !> direction that they do not have after that gets no slope.
  subroutine sums_of_nodes(part, nodes, x, volume, mean, linear)
    type(part_type), intent(in) :: part          !! with its faces
    integer(i4), intent(in) :: nodes(:)          !! (nodes) that are meant
    real(wp), intent(in) :: x(:, :)              !! (points of the part, dim) positions [m]
    real(wp), intent(in) :: volume(:)            !! (points of the part) [m3]
    type(sums_type), intent(out) :: mean         !! (nodes) with the numbers of points in the part
    type(sums_type), intent(out) :: linear       !! (nodes)
    type(around_type) :: around
    integer(i4), allocatable :: elements(:), points(:)
    integer, allocatable :: mark(:)
    real(wp), allocatable :: weight(:)
    integer :: i, ring
    logical :: complete

    call elements_at_nodes(part, around)
    allocate (mark(part%mesh%n_elements), source=0)
    call begin(mean, size(nodes))
    call begin(linear, size(nodes))
    do i = 1, size(nodes)
      elements = around%element(around%first(nodes(i)):around%first(nodes(i) + 1) - 1)
      mark(elements) = i
      points = points_of(part, elements)
      weight = volume(points)/sum(volume(points))
      call put(mean, i, points, weight)
      do ring = 1, most_rings
        call fit(x(points, :), volume(points), part%mesh%x(:part%dim, nodes(i)), weight, complete)
        if (complete .or. ring == most_rings) exit
        call widen(part, around, i, mark, elements)
        points = points_of(part, elements)
      end do
      call put(linear, i, points, weight)
    end do
    call finish(mean)
    call finish(linear)
  end subroutine sums_of_nodes

  !> Values of elements: the means of their points, by volume.
  subroutine sums_of_elements(part, elements, volume, mean)
    type(part_type), intent(in) :: part          !! with its faces
    integer(i4), intent(in) :: elements(:)       !! (elements) with points
    real(wp), intent(in) :: volume(:)            !! (points of the part) [m3]
    type(sums_type), intent(out) :: mean         !! (elements) by numbers of points in the part
    integer(i4), allocatable :: points(:)
    integer :: i

    call begin(mean, size(elements))
    do i = 1, size(elements)
      points = points_of(part, elements(i:i))
      if (size(points) == 1) then
        call put(mean, i, points, [1.0_wp])  ! a quotient might round
      else
        call put(mean, i, points, volume(points)/sum(volume(points)))
      end if
    end do
    call finish(mean)
  end subroutine sums_of_elements

  !> The weights of the points `x` in the value at `at` of the linear function that fits values of
  !> these points best. Not `complete`: `at` lies too far outside of them along some direction, in
  !> which the function is constant.
  pure subroutine fit(x, volume, at, weight, complete)
    real(wp), intent(in) :: x(:, :), volume(:), at(:)
    real(wp), allocatable, intent(out) :: weight(:)
    logical, intent(out) :: complete
    real(wp) :: centre(size(at)), spread(size(at), size(at)), values(size(at)), &
      & vectors(size(at), size(at)), slope(size(at)), along, none
    integer :: i, p

    weight = volume/sum(volume)
    centre = matmul(weight, x)
    spread = 0.0_wp
    do p = 1, size(weight)
      do i = 1, size(at)
        spread(:, i) = spread(:, i) + weight(p)*(x(p, :) - centre)*(x(p, i) - centre(i))
      end do
    end do
    call eigenvectors(spread, values, vectors)
    ! of a single point rounding leaves a variance that means nothing
    none = flat*sum(values) + (16*epsilon(1.0_wp)*maxval(abs(x)))**2
    complete = .true.
    slope = 0.0_wp
    do i = 1, size(at)
      along = dot_product(at - centre, vectors(:, i))
      if (values(i) <= none) then
        complete = complete .and. along**2 <= none
      else if (along**2 > farthest**2*values(i)) then
        complete = .false.
      else
        slope = slope + along/values(i)*vectors(:, i)
      end if
    end do
    do p = 1, size(weight)
      weight(p) = weight(p)*(1 + dot_product(slope, x(p, :) - centre))
    end do
  end subroutine fit

  !> Begin `n` sums.
  pure subroutine begin(sums, n)
    type(sums_type), intent(out) :: sums
    integer, intent(in) :: n

    allocate (sums%first(n + 1), source=1_i8)
    allocate (sums%point(8*n + 8), source=0_i4)
    allocate (sums%weight(8*n + 8), source=0.0_wp)
  end subroutine begin

  !> Put the terms of sum `i` behind those of the sum before it.
  pure subroutine put(sums, i, points, weight)
    type(sums_type), intent(inout) :: sums
    integer, intent(in) :: i
    integer(i4), intent(in) :: points(:)
    real(wp), intent(in) :: weight(:)
    integer(i8) :: last

    last = sums%first(i) + size(points) - 1
    do while (last > size(sums%point, kind=i8))
      sums%point = [sums%point, sums%point]
      sums%weight = [sums%weight, sums%weight]
    end do
    sums%point(sums%first(i):last) = points
    sums%weight(sums%first(i):last) = weight
    sums%first(i + 1) = last + 1
  end subroutine put

  !> Drop the room that the terms did not need.
  pure subroutine finish(sums)
    type(sums_type), intent(inout) :: sums

    sums%point = sums%point(:sums%first(size(sums%first)) - 1)
    sums%weight = sums%weight(:sums%first(size(sums%first)) - 1)
  end subroutine finish

  !> Put sums behind others; their points count from `before` on.
  pure subroutine append_sums(sums, more, before)
    type(sums_type), intent(inout) :: sums  !! with all sums on return; may be without any before
    type(sums_type), intent(in) :: more     !! of a part
    integer, intent(in) :: before           !! points before those of the part

    if (.not. allocated(sums%first)) call begin(sums, 0)
    if (size(sums%first) == 1) call finish(sums)
    sums%first = [sums%first, sums%first(size(sums%first)) - 1 + more%first(2:)]
    sums%point = [sums%point, more%point + int(before, i4)]
    sums%weight = [sums%weight, more%weight]
  end subroutine append_sums

  !> The sums of the values of points.
  pure function summed(sums, values) result(found)
    type(sums_type), intent(in) :: sums     !! with the numbers of the points
    real(wp), intent(in) :: values(:)       !! (points)
    real(wp), allocatable :: found(:)
    integer(i8) :: t
    integer :: i

    allocate (found(size(sums%first) - 1))
    do i = 1, size(found)
      found(i) = 0.0_wp
      do t = sums%first(i), sums%first(i + 1) - 1
        found(i) = found(i) + sums%weight(t)*values(sums%point(t))
      end do
    end do
  end function summed

end module pd_body_mesh_nodal
