!> Binary decomposition of space (7.12): which rank owns which part of the body.
!>
!> The box around the points is cut in two across its longest side, so that each half has a share of
!> the work as large as its share of the ranks (p/2 and p - p/2 of p), and each half again, until
!> every part belongs to one rank. Work comes as a histogram over layers of a given thickness, so
!> that nobody needs all points at once, and cuts lie between layers.
module pd_body_division
  use pd_base_kinds, only: wp, i4, i8
  use pd_body_body, only: body_type, keep_points, order_points, own_points
  implicit none (type, external)
  private
  public :: division_type, work_type, work_of_points, work_of_box, divide_space, owner_of, &
    & take_part, box_of

  integer, parameter :: most_layers = 65536  !! of a histogram along one side

  !> The tree of cuts. Parts that are cut have two halves; the others are the ranks' boxes.
  type :: division_type
    integer :: dim = 0
    integer :: ranks = 0
    integer :: parts = 0
    integer, allocatable :: first_rank(:)    !! (parts) of the ranks that share a part, from 0
    integer, allocatable :: n_ranks(:)       !! how many
    integer, allocatable :: axis(:)          !! across which it is cut; 0: it is a rank's
    real(wp), allocatable :: at(:)           !! where [m]
    integer, allocatable :: half(:)          !! the lower half; the upper one follows it
    real(wp), allocatable :: lower(:, :)     !! (dim, parts) [m]
    real(wp), allocatable :: upper(:, :)     !! (dim, parts) [m]
    integer, allocatable :: part_of(:)       !! (0:ranks - 1) the part of each rank
    real(wp), allocatable :: work(:)         !! (0:ranks - 1) of each rank
  end type division_type

  !> Where the work is.
  type, abstract :: work_type
    integer :: dim = 0
    real(wp) :: lower(3) = 0.0_wp            !! box around all points [m]
    real(wp) :: upper(3) = 0.0_wp
    real(wp) :: layer(3) = 0.0_wp            !! thickness of layers along each axis, from `lower`
                                             !! on, between which cuts may lie [m]
  contains
    procedure(add_work), deferred :: add_to
  end type work_type

  abstract interface
    !> Add the work of all points to the histograms of the parts that are to be cut next.
    subroutine add_work(self, division, first, start, axis, histogram)
      import :: work_type, division_type, wp
      implicit none (type, external)
      class(work_type), intent(inout) :: self
      type(division_type), intent(in) :: division
      integer, intent(in) :: first             !! the first part of the level to be cut
      integer, intent(in) :: start(:)          !! (parts of the level) place before each histogram
      integer, intent(in) :: axis(:)           !! (parts of the level) across which each is cut
      real(wp), intent(inout) :: histogram(:)
    end subroutine add_work
  end interface

  !> The work of given points.
  type, extends(work_type) :: work_of_points
    real(wp), allocatable :: x(:, :)         !! (points, dim) [m]
    real(wp), allocatable :: weight(:)       !! (points) in any unit
    integer, allocatable :: part(:)          !! (points) the part that holds each so far
  contains
    procedure :: add_to => add_points
  end type work_of_points

  !> The work of a full box of cells, each with a weight of 1: no cell is visited.
  type, extends(work_type) :: work_of_box
  contains
    procedure :: add_to => add_box
  end type work_of_box

contains

  !> Divide the space among ranks.
  subroutine divide_space(work, ranks, division)
    class(work_type), intent(inout) :: work
    integer, intent(in) :: ranks                  !! 1 or more
    type(division_type), intent(out) :: division
    integer, allocatable :: start(:), axis(:)
    real(wp), allocatable :: histogram(:)
    integer :: first, last, p, n

    associate (d => division)
      d%dim = work%dim
      d%ranks = ranks
      n = 2*ranks - 1
      allocate (d%first_rank(n), d%n_ranks(n), d%axis(n), d%half(n), source=0)
      allocate (d%at(n), d%lower(d%dim, n), d%upper(d%dim, n), d%work(0:ranks - 1), source=0.0_wp)
      allocate (d%part_of(0:ranks - 1), source=1)
      d%parts = 1
      d%n_ranks(1) = ranks
      d%lower(:, 1) = work%lower(:d%dim)
      d%upper(:, 1) = work%upper(:d%dim)
      first = 1
      last = 1
      do
        allocate (start(last - first + 1), axis(last - first + 1))
        n = 0
        do p = first, last
          axis(p - first + 1) = longest_side(d%upper(:, p) - d%lower(:, p))
          start(p - first + 1) = n
          n = n + layers_of(work, d, p, axis(p - first + 1))
        end do
        allocate (histogram(n), source=0.0_wp)
        call work%add_to(d, first, start, axis, histogram)
        n = d%parts
        do p = first, last
          associate (here => histogram(start(p - first + 1) + 1:start(p - first + 1) &
            & + layers_of(work, d, p, axis(p - first + 1))))
            if (d%n_ranks(p) == 1) then
              d%part_of(d%first_rank(p)) = p
              d%work(d%first_rank(p)) = sum(here)
            else
              call cut_part(work, p, axis(p - first + 1), here, d)
            end if
          end associate
        end do
        deallocate (start, axis, histogram)
        if (d%parts == n) exit
        first = n + 1
        last = d%parts
      end do
    end associate
  end subroutine divide_space

  !> The number of the longest side; of sides as long as each other the last one, across which the
  !> rows of a lattice stay whole.
  pure integer function longest_side(sides) result(axis)
    real(wp), intent(in) :: sides(:)
    integer :: c

    axis = size(sides)
    do c = size(sides) - 1, 1, -1
      if (sides(c) > sides(axis)*(1 + 1.0e-6_wp)) axis = c
    end do
  end function longest_side

  !> Layers of a part across an axis: its sides are multiples of the layers' thickness.
  pure integer function layers_of(work, division, part, axis) result(layers)
    class(work_type), intent(in) :: work
    type(division_type), intent(in) :: division
    integer, intent(in) :: part, axis
    layers = max(1, min(most_layers, nint((division%upper(axis, part) &
      & - division%lower(axis, part))/work%layer(axis))))
  end function layers_of

  !> Cut a part in two halves, whose work is closest to their shares of the ranks.
  subroutine cut_part(work, part, axis, histogram, division)
    class(work_type), intent(in) :: work
    integer, intent(in) :: part, axis
    real(wp), intent(in) :: histogram(:)
    type(division_type), intent(inout) :: division
    real(wp) :: wanted, so_far, best, thickness
    integer :: i, cut, lower_ranks, h, n

    associate (d => division)
      lower_ranks = d%n_ranks(part)/2
      wanted = sum(histogram)*lower_ranks/d%n_ranks(part)
      n = size(histogram)
      so_far = 0.0_wp
      best = abs(wanted)
      cut = 0
      do i = 1, n
        so_far = so_far + histogram(i)
        if (abs(so_far - wanted) < best) then
          best = abs(so_far - wanted)
          cut = i
        end if
      end do
      thickness = (d%upper(axis, part) - d%lower(axis, part))/n
      d%axis(part) = axis
      d%at(part) = d%lower(axis, part) + cut*thickness
      ! on the grid of layers, so that all parts have the same one
      if (n < most_layers) d%at(part) = work%lower(axis) + work%layer(axis) &
        & *nint((d%at(part) - work%lower(axis))/work%layer(axis))
      if (abs(d%at(part)) < 1.0e-9_wp*work%layer(axis)) d%at(part) = 0.0_wp
      h = d%parts + 1
      d%half(part) = h
      d%parts = h + 1
      d%lower(:, h) = d%lower(:, part)
      d%upper(:, h) = d%upper(:, part)
      d%upper(axis, h) = d%at(part)
      d%lower(:, h + 1) = d%lower(:, part)
      d%upper(:, h + 1) = d%upper(:, part)
      d%lower(axis, h + 1) = d%at(part)
      d%first_rank(h) = d%first_rank(part)
      d%n_ranks(h) = lower_ranks
      d%first_rank(h + 1) = d%first_rank(part) + lower_ranks
      d%n_ranks(h + 1) = d%n_ranks(part) - lower_ranks
    end associate
  end subroutine cut_part

  !> The work of points: each finds the part of the new level that holds it.
  subroutine add_points(self, division, first, start, axis, histogram)
    class(work_of_points), intent(inout) :: self
    type(division_type), intent(in) :: division
    integer, intent(in) :: first, start(:), axis(:)
    real(wp), intent(inout) :: histogram(:)
    integer :: i, p, a, layer, layers

    if (.not. allocated(self%part)) allocate (self%part(size(self%x, 1)), source=1)
    do i = 1, size(self%part)
      p = self%part(i)
      do while (division%axis(p) > 0)
        p = division%half(p) + merge(0, 1, self%x(i, division%axis(p)) < division%at(p))
      end do
      self%part(i) = p
      if (p < first) cycle  ! a rank's for some levels already
      a = axis(p - first + 1)
      layers = layers_of(self, division, p, a)
      layer = int((self%x(i, a) - division%lower(a, p))*layers &
        & /(division%upper(a, p) - division%lower(a, p)))
      layer = min(max(layer, 0), layers - 1)
      layer = start(p - first + 1) + layer + 1
      histogram(layer) = histogram(layer) + self%weight(i)
    end do
  end subroutine add_points

  !> The work of a full box.
  subroutine add_box(self, division, first, start, axis, histogram)
    class(work_of_box), intent(inout) :: self
    type(division_type), intent(in) :: division
    integer, intent(in) :: first, start(:), axis(:)
    real(wp), intent(inout) :: histogram(:)
    real(wp) :: cells
    integer :: i, p, c, layers

    do i = 1, size(start)
      p = first + i - 1
      layers = layers_of(self, division, p, axis(i))
      cells = 1.0_wp
      do c = 1, self%dim
        if (c /= axis(i)) cells = cells*nint((division%upper(c, p) - division%lower(c, p)) &
          & /self%layer(c))
      end do
      histogram(start(i) + 1:start(i) + layers) = cells
    end do
  end subroutine add_box

  !> The rank that owns a place.
  pure integer function owner_of(division, x) result(rank)
    type(division_type), intent(in) :: division
    real(wp), intent(in) :: x(:)  !! (dim) [m]
    integer :: p

    p = 1
    do while (division%axis(p) > 0)
      p = division%half(p) + merge(0, 1, x(division%axis(p)) < division%at(p))
    end do
    rank = division%first_rank(p)
  end function owner_of

  !> The box of a rank (dim, 2): its lower and its upper corner [m].
  pure function box_of(division, rank) result(box)
    type(division_type), intent(in) :: division
    integer, intent(in) :: rank  !! from 0
    real(wp) :: box(division%dim, 2)
    box(:, 1) = division%lower(:, division%part_of(rank))
    box(:, 2) = division%upper(:, division%part_of(rank))
  end function box_of

  !> Reduce a body to the points of a rank and the copies of others that its bonds can reach.
  subroutine take_part(division, rank, distance, body, owner)
    type(division_type), intent(in) :: division
    integer, intent(in) :: rank                  !! from 0
    real(wp), intent(in) :: distance             !! how far bonds reach [m]
    type(body_type), intent(inout) :: body
      !! in point order with all points that the rank may need; owned points first on return
    integer, allocatable, intent(out) :: owner(:)  !! rank that owns each copy
    integer, allocatable :: of_point(:)
    integer(i8), allocatable :: number(:)
    integer(i8) :: n_global
    integer(i4), allocatable :: order(:)
    logical, allocatable :: keep(:)
    real(wp) :: box(division%dim, 2), x(division%dim)
    integer :: i, n_owned

    box = box_of(division, rank)
    n_global = body%order%n_global
    allocate (of_point(body%n_points), keep(body%n_points))
    !$omp parallel do schedule(static) default(none) private(i, x) &
    !$omp shared(body, division, of_point, keep, box, rank, distance)
    do i = 1, body%n_points
      x = body%x(i, :)
      of_point(i) = owner_of(division, x)
      keep(i) = of_point(i) == rank
      if (.not. keep(i)) keep(i) = all(x >= box(:, 1) - distance .and. x <= box(:, 2) + distance)
    end do
    if (allocated(body%number)) then
      number = pack(body%number, keep)
    else
      number = pack([(int(i, i8), i=1, body%n_points)], keep)
    end if
    of_point = pack(of_point, keep)
    call keep_points(body, keep)
    order = [pack([(int(i, i4), i=1, size(of_point))], of_point == rank), &
      & pack([(int(i, i4), i=1, size(of_point))], of_point /= rank)]
    n_owned = count(of_point == rank)
    call order_points(body, order)
    call own_points(body, n_owned, number(order), n_global)
    owner = of_point(order(n_owned + 1:))
  end subroutine take_part

end module pd_body_division
