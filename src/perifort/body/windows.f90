!> The points of ranks, each of which makes its own: by the windows of a survey ranks divide the
!> space, then each makes the cells of lattices that it needs, and is sent the points of clouds,
!> with their numbers among all.
module pd_body_windows
  use pd_base_error, only: error_type, internal_fault
  use pd_base_kinds, only: wp, i2, i8
  use pd_body_body, only: allocate_points, body_type, grid_type, keep_points, own_points
  use pd_body_clouds, only: points_of_rows
  use pd_body_division, only: box_of, division_type, owner_of, take_part, work_of_points, work_type
  use pd_body_survey, only: make_points, survey_type, window_type
  use pd_body_work, only: work_of, work_rule_type
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: work_of_windows, begin_work, make_part

  !> The work of all points.
  type, extends(work_type) :: work_of_windows
    type(scene_type), pointer, private :: scene => null()
    type(survey_type), pointer, private :: survey => null()
    type(work_rule_type), private :: rule
  contains
    procedure :: add_to => add_windows
  end type work_of_windows

  !> The points that a rank needs of one window.
  type :: kept_type
    real(wp), allocatable :: volume(:)   !! one for all, or of each
    real(wp), allocatable :: spacing(:)  !! one for all, or of each
    real(wp), allocatable :: x(:, :)
    integer(i8), allocatable :: number(:)
  end type kept_type

contains

  !> The work of the points that have been counted.
  subroutine begin_work(scene, survey, rule, blocks, work)
    type(scene_type), intent(in), target :: scene    !! must stay where it is as long as the work,
    type(survey_type), intent(in), target :: survey  !! and so must what is known of its points
    type(work_rule_type), intent(in) :: rule         !! what points cost
    integer, intent(in) :: blocks                    !! cuts across x lie between so many points of
                                                     !! a row; 1: between any
    type(work_of_windows), intent(out) :: work       !! ready for `divide_space`
    integer :: c

    work%scene => scene
    work%survey => survey
    work%rule = rule
    work%dim = survey%none%dim
    associate (spacing => survey%none%least_spacing)
      do c = 1, work%dim
        work%lower(c) = minval(survey%lower(c, :)) - spacing/2
        work%upper(c) = maxval(survey%upper(c, :)) + spacing/2
        work%layer(c) = spacing
      end do
      work%layer(1) = blocks*spacing
    end associate
  end subroutine begin_work

  !> Add the work of all points to the histograms of the parts that are to be cut next.
  subroutine add_windows(self, division, first, start, axis, histogram)
    class(work_of_windows), intent(inout) :: self
    type(division_type), intent(in) :: division
    integer, intent(in) :: first, start(:), axis(:)
    real(wp), intent(inout) :: histogram(:)
    type(work_of_points) :: work
    type(body_type) :: points
    type(error_type), allocatable :: error
    integer :: w

    work%dim = self%dim
    work%lower = self%lower
    work%upper = self%upper
    work%layer = self%layer
    do w = 1 + self%survey%rank, size(self%survey%windows), self%survey%ranks
      call make_points(self%scene, self%survey, w, self%survey%windows(w)%first, &
        & self%survey%windows(w)%last, points, error)
      if (allocated(error)) call internal_fault('points that could be counted')
      work%weight = work_of(self%rule, points, points%slot)
      call move_alloc(points%x, work%x)
      if (allocated(work%part)) deallocate (work%part)
      call work%add_to(division, first, start, axis, histogram)
    end do
    if (associated(self%survey%together)) call self%survey%together%add_all(histogram)
  end subroutine add_windows

  !> The points of a rank and copies of others that its bonds can reach. All ranks that count
  !> together call this.
  subroutine make_part(scene, survey, division, rank, distance, body, owner)
    type(scene_type), intent(in) :: scene        !! the one that was surveyed
    type(survey_type), intent(in) :: survey      !! of its points
    type(division_type), intent(in) :: division  !! the boxes of the ranks
    integer, intent(in) :: rank                  !! from 0
    real(wp), intent(in) :: distance             !! how far bonds reach [m]
    type(body_type), intent(out) :: body         !! as `take_part` leaves it
    integer, allocatable, intent(out) :: owner(:)  !! rank that owns each copy
    type(kept_type), allocatable :: kept(:)
    integer(i8), allocatable :: number(:)
    real(wp) :: box(survey%none%dim, 2)
    integer :: w, n, i, first(3), last(3)

    allocate (kept(size(survey%windows)))
    if (any(survey%grid == 0_i2)) call deal_rows(scene, survey, division, rank, distance, kept)
    box = box_of(division, rank)
    box(:, 1) = box(:, 1) - distance
    box(:, 2) = box(:, 2) + distance
    do w = 1, size(kept)
      if (survey%grid(survey%windows(w)%body) == 0_i2) cycle
      call clip(survey, w, box, first, last)
      if (all(last >= first)) call take_points(scene, survey, w, first, last, division, rank, &
        & distance, kept(w))
    end do
    n = 0
    do w = 1, size(kept)
      if (allocated(kept(w)%number)) n = n + size(kept(w)%number)
    end do
    call allocate_points(body, survey%none%dim, n)
    allocate (number(n))
    n = 0
    do w = 1, size(kept)
      if (.not. allocated(kept(w)%number)) cycle
      associate (here => kept(w), window => survey%windows(w))
        i = n + size(here%number)
        body%x(n + 1:i, :) = here%x
        if (size(here%volume) == 1) then
          body%volume(n + 1:i) = here%volume(1)
          body%spacing(n + 1:i) = here%spacing(1)
        else
          body%volume(n + 1:i) = here%volume
          body%spacing(n + 1:i) = here%spacing
        end if
        body%body(n + 1:i) = int(window%body, i2)
        body%grid(n + 1:i) = survey%grid(window%body)
        body%material(n + 1:i) = survey%material(window%body)
        if (window%layer > 0) body%layer(n + 1:i) = &
          & int(survey%layers(window%layer)%tally%boundary, i2)
        number(n + 1:i) = here%number
        n = i
        deallocate (here%x, here%number)
      end associate
    end do
    body%grids = survey%none%grids
    body%lattices = survey%none%lattices
    body%delta = survey%none%delta
    body%least_spacing = survey%none%least_spacing
    body%largest_spacing = survey%none%largest_spacing
    call own_points(body, n, number, survey%none%order%n_global)
    deallocate (number)
    call take_part(division, rank, distance, body, owner)
  end subroutine make_part

  !> Send the points of clouds to the ranks that need them, which are sent those that they need.
  subroutine deal_rows(scene, survey, division, rank, distance, kept)
    type(scene_type), intent(in) :: scene
    type(survey_type), intent(in) :: survey
    type(division_type), intent(in) :: division
    integer, intent(in) :: rank
    real(wp), intent(in) :: distance             !! how far bonds reach [m]
    type(kept_type), intent(inout) :: kept(:)    !! (windows) those of clouds are set
    type(body_type) :: points
    type(error_type), allocatable :: error
    real(wp), allocatable :: sent(:), got(:)
    logical, allocatable :: needed(:)
    real(wp) :: low(survey%none%dim), high(survey%none%dim), box(survey%none%dim, 2)
    integer, dimension(0:division%ranks - 1) :: given, place
    integer :: columns, w, r, i, first, last, pass

    columns = survey%none%dim + 3  ! window, number among all points, position, volume
    given = 0
    do pass = 1, 2
      if (pass == 2) then
        allocate (sent(sum(given)))
        place = [(sum(given(:r - 1)), r=0, division%ranks - 1)]
      end if
      do w = 1, size(survey%rows)
        if (.not. allocated(survey%rows(w)%values)) cycle
        call make_points(scene, survey, w, survey%windows(w)%first, survey%windows(w)%last, &
          & points, error)
        if (allocated(error)) call internal_fault('points that could be counted')
        low = minval(points%x, dim=1)
        high = maxval(points%x, dim=1)
        do r = 0, division%ranks - 1
          ! where nobody counts with it, the rank that is asked for gets its points from all rows
          if (.not. associated(survey%together) .and. r /= rank) cycle
          box = box_of(division, r)
          if (any(low > box(:, 2) + distance .or. high < box(:, 1) - distance)) cycle
          needed = needed_points(points, division, r, distance)
          if (pass == 1) given(r) = given(r) + columns*count(needed)
          if (pass == 1) cycle
          do i = 1, points%n_points
            if (.not. needed(i)) cycle
            sent(place(r) + 1:place(r) + columns) = [real(w, wp), &
              & real(survey%windows(w)%before + i, wp), points%x(i, :), points%volume(i)]
            place(r) = place(r) + columns
          end do
        end do
      end do
    end do
    if (associated(survey%together)) then
      call survey%together%deal(sent, given, got)
    else
      call move_alloc(sent, got)
    end if
    first = 1
    do while (first < size(got))
      ! the points of a window come from one rank, one after another
      w = nint(got(first))
      last = first - 1
      do while (last < size(got))
        if (nint(got(last + 1)) /= w) exit
        last = last + columns
      end do
      associate (rows => reshape(got(first:last), [columns, (last - first + 1)/columns]))
        call points_of_rows(rows(3:, :), survey%depth, points)
        kept(w)%number = nint(rows(2, :), i8)
      end associate
      call move_alloc(points%x, kept(w)%x)
      call move_alloc(points%volume, kept(w)%volume)
      call move_alloc(points%spacing, kept(w)%spacing)
      first = last + 1
    end do
  end subroutine deal_rows

  !> Which points a rank owns or may need.
  pure function needed_points(points, division, rank, distance) result(needed)
    type(body_type), intent(in) :: points
    type(division_type), intent(in) :: division
    integer, intent(in) :: rank               !! from 0
    real(wp), intent(in) :: distance          !! how far bonds reach [m]
    logical :: needed(points%n_points)
    real(wp) :: box(division%dim, 2), x(division%dim)
    integer :: i

    box = box_of(division, rank)
    do i = 1, points%n_points
      x = points%x(i, :)
      needed(i) = all(x >= box(:, 1) - distance .and. x <= box(:, 2) + distance)
      if (.not. needed(i)) needed(i) = owner_of(division, x) == rank
    end do
  end function needed_points

  !> The cells of a window whose points may lie in a box; last < first if there are none. Where the
  !> grid is turned, or where a window lacks points, so that the others have to be counted, that is
  !> the whole window.
  pure subroutine clip(survey, w, box, first, last)
    type(survey_type), intent(in) :: survey
    integer, intent(in) :: w
    real(wp), intent(in) :: box(:, :)           !! (dim, 2) its corners [m]
    integer, intent(out) :: first(3), last(3)
    type(grid_type) :: grid
    real(wp) :: low, high
    integer :: c

    associate (window => survey%windows(w))
      first = window%first
      last = window%last
      if (window%n == 0_i8) last = first - 1
      grid = survey%none%lattices(window%body)%grid
      if (grid%turned .or. window%n == 0_i8) return
      ! a cell more, for the rounding of positions
      do c = 1, size(box, 1)
        low = (box(c, 1) - grid%origin(c))/grid%spacing - 0.5_wp
        high = (box(c, 2) - grid%origin(c))/grid%spacing + 1.5_wp
        first(c) = floor(max(real(window%first(c), wp), min(low, real(window%last(c) + 1, wp))))
        last(c) = ceiling(min(real(window%last(c), wp), max(high, real(window%first(c) - 1, wp))))
      end do
      if (any(last < first) .or. is_full(window)) return
      first = window%first
      last = window%last
    end associate
  end subroutine clip

  !> Whether each cell of a window has its point.
  pure logical function is_full(window)
    type(window_type), intent(in) :: window
    is_full = window%n == product(int(window%last - window%first + 1, i8))
  end function is_full

  !> Make the points of some cells of a window, and keep those that a rank owns or may need.
  subroutine take_points(scene, survey, w, first, last, division, rank, distance, kept)
    type(scene_type), intent(in) :: scene
    type(survey_type), intent(in) :: survey
    integer, intent(in) :: w
    integer, intent(in) :: first(3), last(3)   !! from `clip`
    type(division_type), intent(in) :: division
    integer, intent(in) :: rank
    real(wp), intent(in) :: distance
    type(kept_type), intent(out) :: kept
    type(body_type) :: points
    type(error_type), allocatable :: error
    integer(i8), allocatable :: number(:)
    logical, allocatable :: keep(:)
    integer :: i, j, k, n, row(2)

    call make_points(scene, survey, w, first, last, points, error)
    if (allocated(error)) call internal_fault('points that could be counted')
    associate (window => survey%windows(w))
      if (is_full(window)) then
        row = window%last(:2) - window%first(:2) + 1
        allocate (number(points%n_points))
        n = 0
        do k = first(3), last(3)
          do j = first(2), last(2)
            do i = first(1), last(1)
              n = n + 1
              number(n) = window%before + 1 + i - window%first(1) + int(row(1), i8) &
                & *(j - window%first(2) + int(row(2), i8)*(k - window%first(3)))
            end do
          end do
        end do
      else
        number = [(window%before + i, i=1, points%n_points)]
      end if
    end associate
    keep = needed_points(points, division, rank, distance)
    kept%number = pack(number, keep)
    kept%volume = points%volume(:min(1, points%n_points))
    kept%spacing = points%spacing(:min(1, points%n_points))
    call keep_points(points, keep)
    call move_alloc(points%x, kept%x)
  end subroutine take_points

end module pd_body_windows
