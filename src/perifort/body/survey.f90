!> Points that are never there all at once: they are made in windows, boxes of cells of a lattice
!> or rows of a cloud's file of a bounded number, in the order of all points. A survey counts the
!> points of each window.
!>
!> Ranks share the windows among them while they count, and then add up what they have found. Cells
!> are made again whenever they are needed. Rows are read once, by one rank, which keeps them.
module pd_body_survey
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i2, i8
  use pd_base_order, only: ranks_type
  use pd_body_body, only: allocate_points, body_type, keep_points, own_points
  use pd_body_clouds, only: begin_cloud, cloud_piece, cloud_type, pieces_of_cloud, points_of_rows
  use pd_body_generate, only: body_cells, check_family_size, find_taken, horizon_of, no_cell, &
    & nothing_left, number_of_cuts, number_of_grid
  use pd_body_lattices, only: coordinate, lattice_of
  use pd_body_layers, only: begin_layers, begin_side, box_of_layer, check_layer, choose_sides, &
    & layer_cells, layer_count_type, layer_type, see_points
  use pd_body_meshes, only: material_number
  use pd_scene_content_rules, only: place_fault
  use pd_scene_content_types, only: has_own_horizons, scene_type
  use pd_scene_format_pieces, only: piece_type
  implicit none (type, external)
  private
  public :: survey_type, window_type, survey_points, make_points, agree_on_error

  integer, parameter :: most_cells = 32768  !! of a window

  !> Cells whose points are made at once, of one body or of one side of a layer, or rows of a cloud.
  type :: window_type
    integer :: body = 0              !! its number
    integer :: layer = 0             !! number of the layer; 0: the body itself
    integer :: side = 0              !! of the layer
    integer :: first(3) = 1          !! cells, from the body's corner; rows are 1 to the last one
    integer :: last(3) = 0
    type(piece_type) :: piece        !! of a cloud's file
    integer(i8) :: n = 0_i8          !! points in it
    integer(i8) :: before = 0_i8     !! points of all windows before it
  end type window_type

  !> Rows of a cloud that a rank has read.
  type :: rows_type
    real(wp), allocatable :: values(:, :)  !! (dim + 1, rows) positions [m] and volumes [m3]
  end type rows_type

  !> What is left of each body after each cut, by all `&keep` or by a `&remove`.
  type :: left_type
    integer(i8), allocatable :: points(:, :)  !! (0:cuts, bodies)
    real(wp), allocatable :: least(:, :)      !! (0:cuts, bodies) spacing of these [m]
    real(wp), allocatable :: largest(:)       !! (bodies) spacing after all cuts [m]
  end type left_type

  !> What is known of the points of a scene.
  type :: survey_type
    type(body_type) :: none                    !! a body without points: its grids and lattices, its
                                               !! horizon and spacings, and how many points there
                                               !! are; `lowest` of grids is not set
    real(wp), allocatable :: lower(:, :)       !! (3, bodies) the least and the largest positions
    real(wp), allocatable :: upper(:, :)       !! of each body, layers included [m]
    real(wp), allocatable :: lowest(:, :)      !! (3, grids) the same along the axes of each grid,
    real(wp), allocatable :: highest(:, :)     !! of its points [m]
    type(layer_count_type), allocatable :: counts(:)  !! (layers) what their columns came to
    type(window_type), allocatable :: windows(:)
    type(layer_type), allocatable :: layers(:)
    type(cloud_type), allocatable :: clouds(:)  !! (bodies)
    type(rows_type), allocatable :: rows(:)     !! (windows) those that this rank has read
    integer(i2), allocatable :: grid(:)      !! of each body; 0: it is a cloud
    integer(i2), allocatable :: material(:)  !! of each body
    real(wp), allocatable :: spacing(:)      !! the least of each body [m]
    real(wp), allocatable :: at_cut(:)       !! the least spacing of the points before each
                                              !! cut [m]
    real(wp) :: depth = 1.0_wp                   !! what makes dx^dim a volume
    integer :: rank = 0                          !! of this process, from 0
    integer :: ranks = 1                         !! that share the windows
    class(ranks_type), pointer :: together => null()
  end type survey_type

contains

  !> Count the points of a scene. An error if a cloud cannot be read, if no point is left, if the
  !> horizon holds too many points or if a layer joins none; whether bodies overlap is not seen.
  subroutine survey_points(scene, survey, error, together, rank, ranks, cells)
    type(scene_type), intent(in) :: scene    !! a checked scene of lattices and clouds, none refined
    type(survey_type), intent(out) :: survey             !! what is known of the points
    type(error_type), allocatable, intent(out) :: error  !! on all ranks, if on one
    class(ranks_type), intent(inout), target, optional :: together
      !! the ranks that count together; must stay where it is as long as the survey; absent: one
    integer, intent(in), optional :: rank    !! of this process, from 0
    integer, intent(in), optional :: ranks   !! how many there are
    integer, intent(in), optional :: cells   !! the most of a window, and rows; for tests
    type(left_type) :: left
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
    allocate (survey%windows(0), survey%clouds(size(scene%bodies)))
    allocate (survey%lower(3, size(scene%bodies)), survey%upper(3, size(scene%bodies)))
    associate (none => survey%none)
      call allocate_points(none, scene%header%dimension, 0)
      deallocate (none%lattices)
      allocate (none%lattices(size(scene%bodies)))
      allocate (survey%grid(size(scene%bodies)), source=0_i2)
      allocate (survey%material(size(scene%bodies)))
      do b = 1, size(scene%bodies)
        survey%material(b) = material_number(scene, scene%bodies(b)%material)
        if (scene%bodies(b)%file /= '') then
          call add_rows(scene, survey, b, most, error)
          if (allocated(error)) return
          cycle
        end if
        none%lattices(b) = lattice_of(scene%bodies(b), none%dim)
        survey%grid(b) = number_of_grid(none, none%lattices(b)%grid)
        call add_boxes(window_type(body=b), [1, 1, 1], none%lattices(b)%cells, most, &
          & survey%windows)
      end do
      survey%spacing = none%lattices%grid%spacing
      call read_rows(scene, survey, error)
      if (allocated(error)) return
      allocate (survey%lowest(3, size(none%grids)), source=huge(1.0_wp))
      allocate (survey%highest(3, size(none%grids)), source=-huge(1.0_wp))
      call count_bodies(scene, survey, left, error)
      if (allocated(error)) return
      none%least_spacing = minval(left%least(ubound(left%least, 1), :))
      none%largest_spacing = maxval(left%largest)
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

  !> Add the windows of a cloud. The first rank looks for the rows in the file, for all.
  subroutine add_rows(scene, survey, number, most, error)
    type(scene_type), intent(in) :: scene
    type(survey_type), intent(inout) :: survey
    integer, intent(in) :: number                   !! of the body
    integer, intent(in) :: most                     !! rows of a window
    type(error_type), allocatable, intent(out) :: error
    type(piece_type), allocatable :: pieces(:)
    type(window_type), allocatable :: more(:)
    real(wp) :: found(1)
    real(wp), allocatable :: places(:, :)
    integer :: i

    found = 0.0_wp
    if (survey%rank == 0) call pieces_of_cloud(scene, number, most, pieces, error)
    if (survey%rank == 0 .and. .not. allocated(error)) found = size(pieces)
    if (associated(survey%together)) then
      call agree_on_error(survey%together, survey%rank, error)
      if (.not. allocated(error)) call survey%together%add_all(found)
    end if
    if (allocated(error)) return
    allocate (places(4, nint(found(1))), source=0.0_wp)
    if (survey%rank == 0) then
      places(1, :) = real(pieces%at, wp)
      places(2, :) = real(pieces%bytes, wp)
      places(3, :) = real(pieces%lines, wp)
      places(4, :) = real(pieces%rows, wp)
    end if
    if (associated(survey%together)) call add_all_columns(survey%together, places)
    allocate (more(size(places, 2)))
    do i = 1, size(more)
      more(i)%body = number
      more(i)%piece = piece_type(nint(places(1, i), i8), nint(places(2, i), i8), &
        & nint(places(3, i), i8), nint(places(4, i)))
      more(i)%last = [more(i)%piece%rows, 1, 1]
    end do
    call begin_cloud(scene, number, survey%depth, more(1)%piece, survey%clouds(number), error)
    if (associated(survey%together)) call agree_on_error(survey%together, survey%rank, error)
    survey%windows = [survey%windows, more]
  end subroutine add_rows

  !> Add the values of all ranks.
  subroutine add_all_columns(together, values)
    class(ranks_type), intent(inout) :: together
    real(wp), intent(inout) :: values(:, :)
    real(wp), allocatable :: flat(:)

    flat = reshape(values, [size(values)])
    call together%add_all(flat)
    values = reshape(flat, shape(values))
  end subroutine add_all_columns

  !> Read the rows of clouds, of which each rank has its share, and note their least spacing.
  subroutine read_rows(scene, survey, error)
    type(scene_type), intent(in) :: scene
    type(survey_type), intent(inout) :: survey  !! with all windows of the bodies
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: points
    real(wp) :: least(size(survey%grid))
    integer :: w

    allocate (survey%rows(size(survey%windows)))
    if (all(survey%grid > 0_i2)) return
    least = -huge(1.0_wp)
    do w = 1 + survey%rank, size(survey%windows), survey%ranks
      associate (window => survey%windows(w), rows => survey%rows(w))
        if (survey%grid(window%body) > 0_i2) cycle
        call cloud_piece(survey%clouds(window%body), window%piece, rows%values, error)
        call place_fault(error, scene, 'body', window%body, 'file')
        if (allocated(error)) exit
        call points_of_rows(rows%values, survey%depth, points)
        least(window%body) = max(least(window%body), -minval(points%spacing))
      end associate
    end do
    if (associated(survey%together)) then
      call agree_on_error(survey%together, w, error)
      if (.not. allocated(error)) call survey%together%take_largest(least)
    end if
    where (survey%grid == 0_i2) survey%spacing = -least
  end subroutine read_rows

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
    type(left_type), intent(out) :: left
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: points
    real(wp) :: least
    integer :: w, l, s, cuts

    cuts = number_of_cuts(scene)
    allocate (left%points(0:cuts, size(scene%bodies)), left%least(0:cuts, size(scene%bodies)), &
      & left%largest(size(scene%bodies)))
    allocate (survey%at_cut(cuts), source=minval(survey%spacing))
    do
      left%points = 0_i8
      left%least = huge(1.0_wp)
      left%largest = 0.0_wp
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
      call share_left(survey, left)
      if (any(left%points(0, :) == 0_i8)) then
        call no_cell(scene, findloc(left%points(0, :), 0_i8, dim=1), error)
        return
      end if
      do s = 0, cuts
        if (sum(left%points(s, :)) == 0_i8) call nothing_left(scene, s, error)
        if (allocated(error)) return
        if (s == cuts) exit
        least = minval(left%least(s, :))
        if (survey%at_cut(s + 1) < least) then
          survey%at_cut(s + 1:) = least
          exit
        end if
      end do
      if (s == cuts) exit
    end do
    call share_windows(survey, 1)
    call share_sides(scene, survey, left%points(cuts, :))
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
    integer :: b, c, g

    survey%windows(w)%n = points%n_points
    if (points%n_points == 0) return
    b = survey%windows(w)%body
    g = survey%grid(b)
    do c = 1, points%dim
      survey%lower(c, b) = min(survey%lower(c, b), minval(points%x(:, c)))
      survey%upper(c, b) = max(survey%upper(c, b), maxval(points%x(:, c)))
      if (g == 0) cycle
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
    real(wp), allocatable :: values(:, :)

    if (.not. associated(survey%together)) return
    values = real(counts, wp)
    call add_all_columns(survey%together, values)
    counts = nint(values, i8)
  end subroutine add_counts

  !> What is left on all ranks.
  subroutine share_left(survey, left)
    type(survey_type), intent(inout) :: survey
    type(left_type), intent(inout) :: left
    real(wp) :: values(size(left%least) + size(left%largest))
    integer :: n

    if (.not. associated(survey%together)) return
    call add_counts(survey, left%points)
    n = size(left%least)
    values = [-reshape(left%least, [n]), left%largest]
    call survey%together%take_largest(values)
    left%least = reshape(-values(:n), shape(left%least))
    left%largest = values(n + 1:)
  end subroutine share_left

  !> Tell all ranks the numbers of points of the windows from `first` on.
  subroutine share_windows(survey, first)
    type(survey_type), intent(inout) :: survey
    integer, intent(in) :: first
    integer(i8), allocatable :: counts(:, :)

    counts = reshape(survey%windows(first:)%n, [1, size(survey%windows) - first + 1])
    call add_counts(survey, counts)
    survey%windows(first:)%n = counts(1, :)
  end subroutine share_windows

  !> How far the points of all ranks reach.
  subroutine share_bounds(survey)
    type(survey_type), intent(inout) :: survey

    if (.not. associated(survey%together)) return
    call share_least(survey%lower, survey%upper)
    call share_least(survey%lowest, survey%highest)

  contains

    !> The least and the largest values of all ranks.
    subroutine share_least(least, largest)
      real(wp), intent(inout) :: least(:, :), largest(:, :)
      real(wp) :: values(2*size(least))
      integer :: n

      n = size(least)
      values = [-reshape(least, [n]), reshape(largest, [n])]
      call survey%together%take_largest(values)
      least = reshape(-values(:n), shape(least))
      largest = reshape(values(n + 1:), shape(largest))
    end subroutine share_least
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
          if (left(b) == 0_i8 .or. survey%grid(b) == 0_i2) cycle
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
    type(left_type), intent(inout), optional :: left  !! the points of this window are added
    integer, intent(in), optional :: cuts     !! that are made; all if absent
    logical, allocatable :: taken(:)
    integer(i8) :: before
    integer :: s, i, b, n

    b = survey%windows(w)%body
    if (survey%windows(w)%layer > 0) then
      call layer_cells(scene, survey%none%dim, survey%none%grids, survey%layers, &
        & survey%windows(w)%layer, survey%windows(w)%side, first, last, survey%depth, points, n)
      points%lattices = survey%none%lattices
      return
    end if
    if (survey%grid(b) == 0_i2) then
      call rows_of_window(survey, w, points, error)
      if (allocated(error)) return
    else
      call body_cells(survey%none%dim, scene%bodies(b), first, last, survey%depth, points)
    end if
    points%grid = survey%grid(b)
    points%body = int(b, i2)
    points%material = survey%material(b)
    points%lattices = survey%none%lattices
    if (present(left)) call note_left(left, 0, b, points)
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
      if (present(left)) call note_left(left, s, b, points)
    end do
  end subroutine make_points

  !> The points of a window of a cloud, before any cut: of rows that the rank has read, or, to find
  !> the number of a point for a message, from the file.
  subroutine rows_of_window(survey, w, points, error)
    type(survey_type), intent(in) :: survey
    integer, intent(in) :: w                  !! number of the window
    type(body_type), intent(out) :: points
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: values(:, :)

    if (allocated(survey%rows(w)%values)) then
      call points_of_rows(survey%rows(w)%values, survey%depth, points)
    else
      associate (window => survey%windows(w))
        call cloud_piece(survey%clouds(window%body), window%piece, values, error)
      end associate
      if (.not. allocated(error)) call points_of_rows(values, survey%depth, points)
    end if
  end subroutine rows_of_window

  !> Note what a cut has left of the points of a window.
  subroutine note_left(left, cut, body, points)
    type(left_type), intent(inout) :: left
    integer, intent(in) :: cut, body           !! their numbers
    type(body_type), intent(in) :: points

    left%points(cut, body) = left%points(cut, body) + points%n_points
    if (points%n_points == 0) return
    left%least(cut, body) = min(left%least(cut, body), minval(points%spacing))
    if (cut == ubound(left%points, 1)) left%largest(body) = max(left%largest(body), &
      & maxval(points%spacing))
  end subroutine note_left

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

end module pd_body_survey
