!> Points that steps from point to point join with a place, where the points that may be stepped on
!> become more and more: those of a crack that grows.
!>
!> Points are searched for in linked cells, and each is visited once in a run.
module pd_output_measures_reach
  use pd_base_kinds, only: wp, i1, i4
  use pd_body_body, only: body_type
  use pd_family_cells, only: cells_around, cells_type, sort_into_cells
  implicit none (type, external)
  private
  public :: reach_type

  real(wp), parameter :: longest_step = 1.5_wp      !! of a step [spacings]
  real(wp), parameter :: slack = 1.0e-6_wp          !! of it, so that rounding does not decide
  integer(i1), parameter :: out = 0_i1, allowed = 1_i1, joined = 2_i1, chosen = 3_i1

  !> What is joined so far. Points are those of the body in point order.
  type :: reach_type
    private
    real(wp) :: from(3) = 0.0_wp            !! the place [m]
    type(cells_type) :: cells               !! of all points
    integer(i1), allocatable :: is(:)       !! (points) out, allowed, joined, chosen
  contains
    procedure :: begin
    procedure :: grow
    procedure :: parts
    procedure :: has_place
  end type reach_type

contains

  !> Begin: nothing is joined.
  subroutine begin(self, body, from)
    class(reach_type), intent(inout) :: self  !! new on return
    type(body_type), intent(in) :: body       !! points
    real(wp), intent(in) :: from(3)           !! the place; components beyond the dimension do not
                                              !! count [m]

    self%from = from
    call sort_into_cells(body%x(body%slot, :), longest_step*(1 + slack) &
      & *maxval(body%spacing(body%slot)), self%cells)
    if (allocated(self%is)) deallocate (self%is)
    allocate (self%is(body%n_points), source=out)
  end subroutine begin

  !> Whether a point lies within a step of the place.
  logical function has_place(self, body)
    class(reach_type), intent(in) :: self  !! begun
    type(body_type), intent(in) :: body    !! its points
    integer :: i

    has_place = .false.
    do i = 1, body%n_points
      has_place = within(body, body%slot(i), self%from(:body%dim), body%spacing(body%slot(i)))
      if (has_place) return
    end do
  end function has_place

  !> Let more points be stepped on, those whose `value` is above a threshold, and list the points
  !> that are joined by that.
  subroutine grow(self, body, value, threshold, found)
    class(reach_type), intent(inout) :: self           !! begun
    type(body_type), intent(in) :: body                !! its points
    real(wp), intent(in) :: value(:)                   !! (slots)
    real(wp), intent(in) :: threshold                  !! in the unit of the value
    integer(i4), allocatable, intent(out) :: found(:)  !! (any number) newly joined points
    integer(i4), allocatable :: fresh(:), near(:), queue(:)
    integer :: i, n, first, j

    allocate (fresh(16))
    n = 0
    do i = 1, body%n_points
      if (self%is(i) /= out .or. value(body%slot(i)) <= threshold) cycle
      self%is(i) = allowed
      if (n == size(fresh)) fresh = [fresh, fresh]
      n = n + 1
      fresh(n) = int(i, i4)
    end do
    fresh = fresh(:n)
    allocate (queue(max(16, n)))
    n = 0
    do i = 1, size(fresh)
      associate (k => body%slot(fresh(i)))
        if (self%is(fresh(i)) /= allowed) cycle
        if (.not. within(body, k, self%from(:body%dim), body%spacing(k))) then
          call cells_around(self%cells, body%x(k, :), near)
          do j = 1, size(near)
            if (self%is(near(j)) /= joined) cycle
            if (is_step(body, k, body%slot(near(j)))) exit
          end do
          if (j > size(near)) cycle
        end if
      end associate
      first = n + 1
      call join(fresh(i))
      do while (first <= n)
        associate (k => body%slot(queue(first)))
          call cells_around(self%cells, body%x(k, :), near)
          do j = 1, size(near)
            if (self%is(near(j)) /= allowed) cycle
            if (is_step(body, k, body%slot(near(j)))) call join(near(j))
          end do
        end associate
        first = first + 1
      end do
    end do
    found = queue(:n)

  contains

    !> Add a point to those that are joined.
    subroutine join(point)
      integer(i4), intent(in) :: point

      self%is(point) = joined
      if (n == size(queue)) queue = [queue, queue]
      n = n + 1
      queue(n) = point
    end subroutine join
  end subroutine grow

  !> In how many parts some joined points fall, if steps go from one of them to another.
  integer function parts(self, body, points)
    class(reach_type), intent(inout) :: self  !! begun; unchanged on return
    type(body_type), intent(in) :: body       !! its points
    integer(i4), intent(in) :: points(:)      !! (any number) joined ones
    integer(i4), allocatable :: queue(:), near(:)
    integer :: i, j, n, first

    parts = 0
    self%is(points) = chosen
    allocate (queue(size(points)))
    do i = 1, size(points)
      if (self%is(points(i)) /= chosen) cycle
      parts = parts + 1
      self%is(points(i)) = joined
      n = 1
      queue(1) = points(i)
      first = 1
      do while (first <= n)
        associate (k => body%slot(queue(first)))
          call cells_around(self%cells, body%x(k, :), near)
          do j = 1, size(near)
            if (self%is(near(j)) /= chosen) cycle
            if (.not. is_step(body, k, body%slot(near(j)))) cycle
            self%is(near(j)) = joined
            n = n + 1
            queue(n) = near(j)
          end do
        end associate
        first = first + 1
      end do
    end do
  end function parts

  !> Whether two points are a step apart, whose spacing is the mean of theirs.
  pure logical function is_step(body, k, j)
    type(body_type), intent(in) :: body
    integer(i4), intent(in) :: k, j  !! slots
    is_step = within(body, k, body%x(j, :), 0.5_wp*(body%spacing(k) + body%spacing(j)))
  end function is_step

  !> Whether a point lies within a step of a position.
  pure logical function within(body, k, x, spacing)
    type(body_type), intent(in) :: body
    integer(i4), intent(in) :: k       !! its slot
    real(wp), intent(in) :: x(:)       !! (dim) the position [m]
    real(wp), intent(in) :: spacing    !! [m]
    within = sum((body%x(k, :) - x)**2) <= (longest_step*spacing*(1 + slack))**2
  end function within

end module pd_output_measures_reach
