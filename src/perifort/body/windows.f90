!> Points of lattices that are never there all at once: they are made in windows, boxes of cells of
!> a bounded number, in the order of all points. A survey counts the points of each window; with it
!> ranks divide the space and make the points of their boxes alone, with their numbers among all.
!>
!> Ranks share the windows among them while they count, and then add up what they have found.
module pd_body_windows
  use pd_base_error, only: error_type, fail, internal_fault
  use pd_base_kinds, only: wp, i2, i8
  use pd_base_order, only: ranks_type
  use pd_body_body, only: allocate_points, body_type, grid_type, keep_points, own_points
  use pd_body_division, only: box_of, division_type, owner_of, take_part, work_of_points, &
    & work_type
  use pd_body_generate, only: body_cells, check_family_size, find_taken, horizon_of, &
    & no_cell, nothing_left, number_of_cuts, number_of_grid
  use pd_body_lattices, only: coordinate, lattice_of
  use pd_body_layers, only: begin_layers, begin_side, box_of_layer, check_layer, choose_sides, &
    & layer_cells, layer_count_type, layer_type, see_points
  use pd_body_meshes, only: material_number
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: has_own_horizons, has_refinement, is_lattice, scene_type
  implicit none (type, external)
  private
  public :: survey_type, work_of_windows, has_windows, survey_points, begin_work, make_part, &
    & agree_on_error

  integer, parameter :: most_cells = 32768  !! of a window

  !> Cells whose points are made at once, of one body or of one side of a layer.
  type :: window_type
    integer :: body = 0              !! its number
    integer :: layer = 0             !! number of the layer; 0: the body itself
    integer :: side = 0              !! of the layer
    integer :: first(3) = 1          !! cells, from the body's corner
    integer :: last(3) = 0
    integer(i8) :: n = 0_i8          !! points in it
    integer(i8) :: before = 0_i8     !! points of all windows before it
  end type window_type

  !> What is known of the points of a scene.
  type :: survey_type
    type(body_type) :: none                    !! a body without points: its grids and lattices, its
                                               !! horizon and spacings, and how many points there
                                               !! are; `lowest` of grids is not set
    real(wp) :: lower(3) = huge(1.0_wp)        !! the least and the largest positions [m]
    real(wp) :: upper(3) = -huge(1.0_wp)
    real(wp), allocatable :: lowest(:, :)      !! (3, grids) the same along the axes of each grid,
    real(wp), allocatable :: highest(:, :)     !! of its points [m]
    type(layer_count_type), allocatable :: counts(:)  !! (layers) what their columns came to
    type(window_type), allocatable, private :: windows(:)
    type(layer_type), allocatable, private :: layers(:)
    integer(i2), allocatable, private :: grid(:)       ! of each body
    integer(i2), allocatable, private :: material(:)   ! of each body
    real(wp), allocatable, private :: spacing(:)       ! of each body [m]
    real(wp), allocatable, private :: at_cut(:)        ! the least spacing of the points before each
                                                       ! cut [m]
    real(wp), private :: depth = 1.0_wp                ! what makes dx^dim a volume
    integer, private :: rank = 0                       ! of this process, from 0
    integer, private :: ranks = 1                      ! that share the windows
    class(ranks_type), pointer, private :: together => null()
  end type survey_type

  !> The work of all points, each with a weight of 1.
  type, extends(work_type) :: work_of_windows
    type(scene_type), pointer, private :: scene => null()
    type(survey_type), pointer, private :: survey => null()
  contains
    procedure :: add_to => add_windows
  end type work_of_windows

  !> The points that a rank needs of one window.
  type :: kept_type
    integer :: window = 0
    real(wp) :: volume = 0.0_wp
    real(wp) :: spacing = 0.0_wp
    real(wp), allocatable :: x(:, :)
    integer(i8), allocatable :: number(:)
  end type kept_type

contains

  !> Whether the points of a scene can be made in windows: all bodies are lattices, none refined.
  pure logical function has_windows(scene)
    type(scene_type), intent(in) :: scene  !! a checked scene
    has_windows = all(is_lattice(scene%bodies)) .and. .not. has_refinement(scene)
  end function has_windows

  !> Count the points of a scene. An error if no point is left, if the horizon holds too many points
  !> or if a layer joins none; whether bodies overlap is not seen.
  subroutine survey_points(scene, survey, error, together, rank, ranks, cells)
    type(scene_type), intent(in) :: scene    !! a checked scene that `has_windows`
    type(survey_type), intent(out) :: survey             !! what is known of the points
    type(error_type), allocatable, intent(out) :: error  !! on all ranks, if on one
    class(ranks_type), intent(inout), target, optional :: together
      !! the ranks that count together; must stay where it is as long as the survey; absent: one
    integer, intent(in), optional :: rank    !! of this process, from 0
    integer, intent(in), optional :: ranks   !! how many there are
    integer, intent(in), optional :: cells   !! the most of a window; for tests
    integer(i8), allocatable :: left(:, :)   ! points of each body after each cut
    real(wp) :: spacing
    integer :: b, l, most

    most = most_cells
    if (present(cells)) most = cells
    if (present(together) .and. present(rank) .and. present(ranks)) then
      survey%together => together
      survey%rank = rank
      survey%ranks = ranks
    end if
    if (scene%header%dimension == 2) survey%depth = scene%header%thickness
    if (scene%header%dimension == 1) survey%depth = scene%header%area
    allocate (survey%windows(0))
    associate (none => survey%none)
      call allocate_points(none, scene%header%dimension, 0)
      deallocate (none%lattices)
      allocate (none%lattices(size(scene%bodies)))
      allocate (survey%grid(size(scene%bodies)), survey%material(size(scene%bodies)))
      do b = 1, size(scene%bodies)
        none%lattices(b) = lattice_of(scene%bodies(b), none%dim)
        survey%grid(b) = number_of_grid(none, none%lattices(b)%grid)
        survey%material(b) = material_number(scene, scene%bodies(b)%material)
        call add_boxes(window_type(body=b), [1, 1, 1], none%lattices(b)%cells, most, &
          & survey%windows)
      end do
      survey%spacing = none%lattices%grid%spacing
      allocate (survey%lowest(3, size(none%grids)), source=huge(1.0_wp))
      allocate (survey%highest(3, size(none%grids)), source=-huge(1.0_wp))
      call count_bodies(scene, survey, left, error)
      if (allocated(error)) return
      associate (there => left(ubound(left, 1), :) > 0_i8)
        none%least_spacing = minval(survey%spacing, mask=there)
        none%largest_spacing = maxval(survey%spacing, mask=there)
      end associate
      none%delta = horizon_of(scene, none%largest_spacing)
      spacing = none%largest_spacing
      if (has_own_horizons(scene)) spacing = none%least_spacing
      call check_family_size(scene, none, horizon_of(scene, spacing), none%least_spacing, error)
      if (allocated(error)) return
      do l = 1, size(survey%layers)
        call choose_sides(scene, none%delta, none%dim, survey%layers(l))
      end do
      call count_layers(scene, survey, most, error)
      if (allocated(error)) return
      call share_bounds(survey)
      survey%counts = survey%layers%tally
      none%order%n_global = sum(survey%windows%n)
      do b = 2, size(survey%windows)
        survey%windows(b)%before = survey%windows(b - 1)%before + survey%windows(b - 1)%n
      end do
    end associate
  end subroutine survey_points

  !> Add the windows of a box of cells, in the order of its cells: planes, parts of a plane that
  !> have whole rows, or parts of a row.
  pure subroutine add_boxes(like, first, last, most, windows)
    type(window_type), intent(in) :: like           !! what all of them have
    integer, intent(in) :: first(3), last(3)        !! of the box
    integer, intent(in) :: most                     !! cells of a window
    type(window_type), allocatable, intent(inout) :: windows(:)
    type(window_type), allocatable :: more(:)
    integer :: width(3), number(3), cells(3), i, j, k, n

    cells = last - first + 1
    if (any(cells < 1)) return
    width = 1
    width(1) = min(cells(1), most)
    if (width(1) == cells(1)) width(2) = min(cells(2), max(1, most/width(1)))
    if (all(width(:2) == cells(:2))) width(3) = min(cells(3), max(1, most/(width(1)*width(2))))
    number = (cells - 1)/width + 1
    allocate (more(size(windows) + product(number)))
    n = size(windows)
    more(:n) = windows
    do k = 0, number(3) - 1
      do j = 0, number(2) - 1
        do i = 0, number(1) - 1
          n = n + 1
          more(n) = like
          more(n)%first = first + width*[i, j, k]
          more(n)%last = min(last, more(n)%first + width - 1)
        end do
      end do
    end do
    call move_alloc(more, windows)
  end subroutine add_boxes

  !> Count the points of the bodies, and let the layers see them. Whether a point on a surface is
  !> cut depends on the least spacing of the points that are there, which is known for certain when
  !> they have been counted.
  subroutine count_bodies(scene, survey, left, error)
    type(scene_type), intent(in) :: scene
    type(survey_type), intent(inout) :: survey
    integer(i8), allocatable, intent(out) :: left(:, :)  !! (0:cuts, bodies) points after each cut
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: points
    real(wp) :: least
    integer :: w, l, s, cuts

    cuts = number_of_cuts(scene)
    allocate (left(0:cuts, size(scene%bodies)))
    allocate (survey%at_cut(cuts), source=minval(survey%spacing))
    do
      left = 0_i8
      survey%windows%n = 0_i8
      survey%lower = huge(1.0_wp)
      survey%upper = -huge(1.0_wp)
      survey%lowest = huge(1.0_wp)
      survey%highest = -huge(1.0_wp)
      call begin_layers(scene, survey%layers)
      do w = 1 + survey%rank, size(survey%windows), survey%ranks
        call make_points(scene, survey, w, survey%windows(w)%first, survey%windows(w)%last, &
          & points, error, left)
        if (allocated(error)) exit
        call note_points(survey, w, points)
        do l = 1, size(survey%layers)
          call see_points(scene, points, points%n_points, survey%layers(l))
        end do
      end do
      if (associated(survey%together)) call agree_on_error(survey%together, w, error)
      if (allocated(error)) return
      call add_counts(survey, left)
      if (any(left(0, :) == 0_i8)) then
        call no_cell(scene, findloc(left(0, :), 0_i8, dim=1), error)
        return
      end if
      do s = 0, cuts
        if (sum(left(s, :)) == 0_i8) call nothing_left(scene, s, error)
        if (allocated(error)) return
        if (s == cuts) exit
        least = minval(survey%spacing, mask=left(s, :) > 0_i8)
        if (survey%at_cut(s + 1) < least) then
          survey%at_cut(s + 1:) = least
          exit
        end if
      end do
      if (s == cuts) exit
    end do
    call share_windows(survey, 1)
    call share_sides(scene, survey, left(cuts, :))
  end subroutine count_bodies

  !> Add the windows of the layers, and count their points.
  subroutine count_layers(scene, survey, most, error)
    type(scene_type), intent(in) :: scene
    type(survey_type), intent(inout) :: survey  !! with the sides of its layers
    integer, intent(in) :: most                 !! cells of a window
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: points
    integer(i8) :: shared(1, size(survey%layers))
    integer :: w, l, s, n, first(3), last(3), of_bodies

    of_bodies = size(survey%windows)
    do l = 1, size(survey%layers)
      do s = 1, size(survey%layers(l)%sides)
        if (.not. any(survey%layers(l)%sides(s)%has)) cycle
        call box_of_layer(survey%layers(l), s, first, last)
        call add_boxes(window_type(body=survey%layers(l)%sides(s)%body, layer=l, side=s), first, &
          & last, most, survey%windows)
      end do
    end do
    shared = 0_i8
    do w = of_bodies + 1 + survey%rank, size(survey%windows), survey%ranks
      associate (window => survey%windows(w))
        call layer_cells(scene, survey%none%dim, survey%none%grids, survey%layers, window%layer, &
          & window%side, window%first, window%last, survey%depth, points, n)
        shared(1, window%layer) = shared(1, window%layer) + n
      end associate
      call note_points(survey, w, points)
    end do
    call share_windows(survey, of_bodies + 1)
    call add_counts(survey, shared)
    do l = 1, size(survey%layers)
      survey%layers(l)%tally%shared = int(shared(1, l))
      call check_layer(scene, survey%layers(l), sum(survey%windows%n, &
        & mask=survey%windows%layer == l), error)
      if (allocated(error)) return
    end do
  end subroutine count_layers

  !> What one rank has found, or several, all of them have: the one with the first place reports it.
  subroutine agree_on_error(together, place, error)
    class(ranks_type), intent(inout) :: together  !! all ranks, which all call this
    integer, intent(in) :: place                  !! where this rank has found it, if it has: no
                                                  !! other one has found any there
    type(error_type), allocatable, intent(inout) :: error  !! allocated on all ranks on return, if
                                                           !! it is on one
    real(wp) :: first(1)

    first = -huge(1.0_wp)
    if (allocated(error)) first = -real(place, wp)
    call together%take_largest(first)
    if (.not. first(1) > -huge(1.0_wp)) return
    if (allocated(error)) then
      error%elsewhere = first(1) > -place
    else
      call fail(error, 'another rank has found an error')
      error%elsewhere = .true.
    end if
    error%everywhere = .true.
  end subroutine agree_on_error

  !> Note how many points a window has and how far they reach.
  subroutine note_points(survey, w, points)
    type(survey_type), intent(inout) :: survey
    integer, intent(in) :: w
    type(body_type), intent(in) :: points
    integer :: c, g

    survey%windows(w)%n = points%n_points
    if (points%n_points == 0) return
    g = survey%grid(survey%windows(w)%body)
    do c = 1, points%dim
      survey%lower(c) = min(survey%lower(c), minval(points%x(:, c)))
      survey%upper(c) = max(survey%upper(c), maxval(points%x(:, c)))
      associate (along => coordinate(survey%none%grids(g), points%x, c))
        survey%lowest(c, g) = min(survey%lowest(c, g), minval(along))
        survey%highest(c, g) = max(survey%highest(c, g), maxval(along))
      end associate
    end do
  end subroutine note_points

  !> Add the counts of all ranks.
  subroutine add_counts(survey, counts)
    type(survey_type), intent(inout) :: survey
    integer(i8), intent(inout) :: counts(:, :)
    real(wp) :: values(size(counts))

    if (.not. associated(survey%together)) return
    values = real(reshape(counts, [size(counts)]), wp)
    call survey%together%add_all(values)
    counts = reshape(nint(values, i8), shape(counts))
  end subroutine add_counts

  !> Tell all ranks the numbers of points of the windows from `first` on.
  subroutine share_windows(survey, first)
    type(survey_type), intent(inout) :: survey
    integer, intent(in) :: first
    integer(i8) :: counts(1, size(survey%windows) - first + 1)

    counts(1, :) = survey%windows(first:)%n
    call add_counts(survey, counts)
    survey%windows(first:)%n = counts(1, :)
  end subroutine share_windows

  !> How far the points of all ranks reach.
  subroutine share_bounds(survey)
    type(survey_type), intent(inout) :: survey
    real(wp) :: values(6 + 2*size(survey%lowest))
    integer :: n

    if (.not. associated(survey%together)) return
    n = size(survey%lowest)
    values = [-survey%lower, survey%upper, reshape(-survey%lowest, [n]), &
      & reshape(survey%highest, [n])]
    call survey%together%take_largest(values)
    survey%lower = -values(:3)
    survey%upper = values(4:6)
    survey%lowest = reshape(-values(7:6 + n), shape(survey%lowest))
    survey%highest = reshape(values(7 + n:), shape(survey%highest))
  end subroutine share_bounds

  !> The outermost cells that any rank has seen of the sides of layers.
  subroutine share_sides(scene, survey, left)
    type(scene_type), intent(in) :: scene
    type(survey_type), intent(inout) :: survey
    integer(i8), intent(in) :: left(:)     !! points of each body that are left
    real(wp), allocatable :: top(:)
    integer :: l, b

    if (.not. associated(survey%together)) return
    do l = 1, size(survey%layers)
      associate (name => scene%boundaries(survey%layers(l)%tally%boundary)%body)
        do b = 1, size(left)
          if (left(b) == 0_i8) cycle
          if (name /= '' .and. scene%bodies(b)%name /= name) cycle
          associate (side => survey%layers(l)%of_body(0, b))
            if (side%number == 0_i2) call begin_side(survey%none%dim, survey%layers(l)%axis, &
              & survey%none%lattices(b), 0, b, survey%grid(b), survey%material(b), side)
            top = real(reshape(side%top, [size(side%top)]), wp)
            call survey%together%take_largest(top)
            side%top = reshape(nint(top), shape(side%top))
          end associate
        end do
      end associate
    end do
  end subroutine share_sides

  !> The points of some cells of a window.
  recursive subroutine make_points(scene, survey, w, first, last, points, error, left, cuts)
    type(scene_type), intent(in) :: scene
    type(survey_type), intent(in) :: survey
    integer, intent(in) :: w                  !! number of the window
    integer, intent(in) :: first(3), last(3)  !! its cells, or some of them
    type(body_type), intent(out) :: points
    type(error_type), allocatable, intent(out) :: error
    integer(i8), intent(inout), optional :: left(0:, :)
      !! (0:cuts, bodies) points after each cut; those of this window are added
    integer, intent(in), optional :: cuts     !! that are made; all if absent
    logical, allocatable :: taken(:)
    integer(i8) :: before
    integer :: s, i, b, n

    b = survey%windows(w)%body
    if (survey%windows(w)%layer > 0) then
      call layer_cells(scene, survey%none%dim, survey%none%grids, survey%layers, &
        & survey%windows(w)%layer, survey%windows(w)%side, first, last, survey%depth, points, n)
      return
    end if
    call body_cells(survey%none%dim, scene%bodies(b), first, last, survey%depth, points)
    points%grid = survey%grid(b)
    points%body = int(b, i2)
    points%material = survey%material(b)
    points%lattices = survey%none%lattices
    if (present(left)) left(0, b) = left(0, b) + points%n_points
    n = size(survey%at_cut)
    if (present(cuts)) n = cuts
    do s = 1, n
      if (points%n_points == 0) exit
      points%least_spacing = survey%at_cut(s)
      call find_taken(scene, points, s, taken, error)
      if (allocated(error)) then
        ! once more, with the number of the point among all that are there
        before = 0_i8
        do i = 1, w - 1
          call count_window(scene, survey, i, s - 1, before)
        end do
        call own_points(points, points%n_points, [(before + i, i=1, points%n_points)], before)
        call find_taken(scene, points, s, taken, error)
        return
      end if
      call keep_points(points, .not. taken)
      if (present(left)) left(s, b) = left(s, b) + points%n_points
    end do
  end subroutine make_points

  !> Add the number of points of a window that some cuts leave.
  recursive subroutine count_window(scene, survey, w, cuts, number)
    type(scene_type), intent(in) :: scene
    type(survey_type), intent(in) :: survey
    integer, intent(in) :: w, cuts
    integer(i8), intent(inout) :: number
    type(body_type) :: points
    type(error_type), allocatable :: error

    call make_points(scene, survey, w, survey%windows(w)%first, survey%windows(w)%last, points, &
      & error, cuts=cuts)
    number = number + points%n_points
  end subroutine count_window

  !> The work of the points that have been counted.
  subroutine begin_work(scene, survey, blocks, work)
    type(scene_type), intent(in), target :: scene    !! must stay where it is as long as the work,
    type(survey_type), intent(in), target :: survey  !! and so must what is known of its points
    integer, intent(in) :: blocks                    !! cuts across x lie between so many points of
                                                     !! a row; 1: between any
    type(work_of_windows), intent(out) :: work       !! ready for `divide_space`
    integer :: c

    work%scene => scene
    work%survey => survey
    work%dim = survey%none%dim
    associate (spacing => survey%none%least_spacing)
      do c = 1, work%dim
        work%lower(c) = survey%lower(c) - spacing/2
        work%upper(c) = survey%upper(c) + spacing/2
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
      call move_alloc(points%x, work%x)
      if (allocated(work%part)) deallocate (work%part)
      work%weight = spread(1.0_wp, 1, size(work%x, 1))
      call work%add_to(division, first, start, axis, histogram)
    end do
    if (associated(self%survey%together)) call self%survey%together%add_all(histogram)
  end subroutine add_windows

  !> Make the points of a rank and copies of others that its bonds can reach.
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
    integer :: w, m, n, i, pass, first(3), last(3)

    box = box_of(division, rank)
    box(:, 1) = box(:, 1) - distance
    box(:, 2) = box(:, 2) + distance
    do pass = 1, 2
      m = 0
      do w = 1, size(survey%windows)
        call clip(survey, w, box, first, last)
        if (any(last < first)) cycle
        m = m + 1
        if (pass == 2) call take_points(scene, survey, w, first, last, division, rank, distance, &
          & kept(m))
      end do
      if (pass == 1) allocate (kept(m))
    end do
    n = 0
    do m = 1, size(kept)
      n = n + size(kept(m)%number)
    end do
    call allocate_points(body, survey%none%dim, n)
    allocate (number(n))
    n = 0
    do m = 1, size(kept)
      associate (here => kept(m), window => survey%windows(kept(m)%window))
        i = n + size(here%number)
        body%x(n + 1:i, :) = here%x
        body%volume(n + 1:i) = here%volume
        body%spacing(n + 1:i) = here%spacing
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
    real(wp) :: box(division%dim, 2), x(division%dim)
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
    box = box_of(division, rank)
    allocate (keep(points%n_points))
    do i = 1, points%n_points
      x = points%x(i, :)
      keep(i) = all(x >= box(:, 1) - distance .and. x <= box(:, 2) + distance)
      if (.not. keep(i)) keep(i) = owner_of(division, x) == rank
    end do
    kept%window = w
    kept%number = pack(number, keep)
    if (points%n_points > 0) then
      kept%volume = points%volume(1)
      kept%spacing = points%spacing(1)
    end if
    call keep_points(points, keep)
    call move_alloc(points%x, kept%x)
  end subroutine take_points

end module pd_body_windows
