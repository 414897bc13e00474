!> The tip of a crack: the point farthest along a direction among those that steps of at most 1.5
!> spacings through points with damage above a threshold join with a place (doc/user-guide.md).
!> Positions are those before any displacement.
!>
!> What is joined is found step by step as the damage grows, so that a row costs little, and again
!> from the damage after a restart. Only the path and the window of the speed go from row to row.
!>
!> Ranks tell each other their points with such damage, which are few, and each joins all of them.
module pd_output_measures_tip
  use pd_base_archive, only: archive_type
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_order, only: ascending_order, owned_point, ranks_type
  use pd_base_reduce, only: count_of_ranks, largest_over, least_over
  use pd_base_text, only: line => labelled_line, to_text
  use pd_base_warnings, only: warnings_type
  use pd_body_body, only: allocate_points, body_type, number_at, own_points
  use pd_body_shapes, only: touch
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_motion_system, only: system_type
  use pd_output_measures_measure, only: measure_list_type, measure_type, row_source_type
  use pd_output_measures_reach, only: reach_type
  use pd_output_measures_slope, only: slope_type
  use pd_output_results_types, only: column_type
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: add_tips

  character(*), parameter :: xyz(3) = ['x', 'y', 'z']
  real(wp), parameter :: behind = 5.0_wp         !! the tip, where fronts are counted [spacings]
  real(wp), parameter :: speed_over = 10.0_wp    !! growth [spacings]

  type, extends(measure_type) :: tip_measure_type
    character(:), allocatable :: name
    integer :: group = 0                     !! its number among the groups
    real(wp) :: from(3) = 0.0_wp             !! [m]
    real(wp) :: direction(3) = 0.0_wp        !! of unit length
    real(wp) :: threshold = 0.0_wp           !! of the damage
    integer :: across = 0                    !! axis along the front, in 3D; 0: not chosen yet
    ! what follows from the damage
    type(reach_type) :: reach                !! points of the crack
    type(body_type), allocatable :: damaged  !! on ranks: the points of all with enough damage
    logical, allocatable :: told(:)          !! (owned points) they are among them
    integer(i4), allocatable :: recent(:)    !! those not far behind the tip
    real(wp) :: farthest = 0.0_wp            !! way of the farthest along the direction [m]
    integer :: branches = 0
    integer(i8) :: broken = -1_i8            !! bonds, at the last row
    real(wp) :: spacing = 0.0_wp             !! the largest of all points [m]
    real(wp) :: side = 0.0_wp                !! where the first place along the front begins [m]
    real(wp), allocatable :: front(:)        !! farthest way of each place along it [m]
    ! what goes from row to row
    integer(i8) :: number = 0_i8             !! of the point at the tip; 0: none yet
    real(wp) :: length = 0.0_wp              !! of its path [m]
    type(slope_type) :: speed                !! of its projection
  contains
    procedure :: begin => begin_tip
    procedure :: columns => columns_of_tip
    procedure :: row => row_of_tip
    procedure :: keep => keep_tip
    procedure :: describe => describe_tip
    procedure :: warn => warn_of_tip
  end type tip_measure_type

contains

  !> Add the tips of a scene.
  subroutine add_tips(scene, measures)
    type(scene_type), intent(in) :: scene                !! a checked scene
    type(measure_list_type), intent(inout) :: measures   !! added to
    type(tip_measure_type) :: measure
    integer :: i

    associate (dim => scene%header%dimension)
      do i = 1, size(scene%tips)
        measure%name = trim(scene%tips(i)%name)
        measure%group = i
        measure%from = 0.0_wp
        measure%from(:dim) = scene%tips(i)%from(:dim)
        measure%direction = 0.0_wp
        measure%direction(:dim) = scene%tips(i)%direction(:dim)/norm2(scene%tips(i)%direction(:dim))
        measure%threshold = scene%tips(i)%threshold
        measure%across = index('xyz', trim(scene%tips(i)%across))
        if (scene%tips(i)%across == '') measure%across = 0
        call measures%add(measure)
      end do
    end associate
  end subroutine add_tips

  !> Sort the points into cells, and choose the axis along the front. An error if nothing in the
  !> scene can be damaged.
  subroutine begin_tip(measure, scene, system, error)
    class(tip_measure_type), intent(inout) :: measure
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: lower, upper, least
    integer :: c, axis

    associate (body => system%body)
      if (size(system%state%damage) == 0) then
        call scene_fault(error, scene, 'tip', measure%group, 'name', 'the tip '//measure%name// &
          & ' cannot be found: no bond can break, so that there is no damage', &
          & 'expected a material with critical_stretch, or a &crack')
        return
      end if
      measure%spacing = largest_over(body%order, body%spacing)
      if (associated(body%order%ranks)) then
        allocate (measure%damaged)
        call allocate_points(measure%damaged, body%dim, 0)
        allocate (measure%told(body%order%n_owned), source=.false.)
      else
        call measure%reach%begin(body, measure%from)
      end if
      measure%speed%reach = speed_over*measure%spacing
      measure%recent = [integer(i4) ::]
      allocate (measure%front(0))
      if (body%dim < 3) return
      axis = measure%across
      least = huge(least)
      do c = 1, 3
        if (measure%across > 0 .or. c == maxloc(abs(measure%direction), dim=1)) cycle
        lower = least_over(body%order, body%x(:, c))
        upper = largest_over(body%order, body%x(:, c))
        ! of equal ones the last; rounding does not decide
        if (upper - lower > least + touch*measure%spacing) cycle
        least = upper - lower
        axis = c
      end do
      measure%across = axis
      lower = least_over(body%order, body%x(:, axis))
      upper = largest_over(body%order, body%x(:, axis))
      measure%side = lower - measure%spacing/2
      deallocate (measure%front)
      allocate (measure%front(max(1, nint((upper - lower)/measure%spacing) + 1)), &
        & source=-huge(1.0_wp))
    end associate
  end subroutine begin_tip

  !> Where the tip is, its way and speed, how many fronts it has; in 3D the front.
  function columns_of_tip(measure, dim) result(columns)
    class(tip_measure_type), intent(in) :: measure
    integer, intent(in) :: dim
    type(column_type), allocatable :: columns(:)
    integer :: c

    columns = [(of(xyz(c), 'm'), c=1, dim), of('length', 'm'), of('projection', 'm'), &
      & of('speed', 'm/s'), of('branches', '1')]
    if (dim == 3) columns = [columns, of('projection_mean', 'm'), of('projection_least', 'm'), &
      & of('projection_most', 'm')]

  contains

    !> One column.
    type(column_type) function of(what, unit) result(column)
      character(*), intent(in) :: what, unit
      column = column_type(measure%name//'_'//what, unit, 'tip')
    end function of
  end function columns_of_tip

  !> Let the crack grow to the present damage, and the tip go on.
  subroutine row_of_tip(measure, now, values)
    class(tip_measure_type), intent(inout) :: measure
    type(row_source_type), intent(in) :: now
    real(wp), intent(out) :: values(:)
    type(body_type), allocatable :: damaged
    integer(i4), allocatable :: found(:)
    logical :: grows

    associate (system => now%system)
      ! damage grows where bonds break, or where a law softens
      grows = system%broken /= measure%broken .or. system%model%generic
      measure%broken = system%broken
      if (associated(system%body%order%ranks)) then
        call move_alloc(measure%damaged, damaged)
        if (grows) call gather_damaged(measure, system, damaged, grows)
        if (grows) then
          ! places among the points have changed: all are joined anew
          measure%recent = [integer(i4) ::]
          measure%front = -huge(1.0_wp)
          call measure%reach%begin(damaged, measure%from)
          call measure%reach%grow(damaged, damaged%volume, 0.0_wp, found)
          if (size(found) > 0) call take(measure, damaged, found)
        end if
        call go_on(measure, damaged, now%instant%time, values)
        call move_alloc(damaged, measure%damaged)
        return
      end if
      if (grows) then
        call measure%reach%grow(system%body, system%state%damage, measure%threshold, found)
        if (size(found) > 0) call take(measure, system%body, found)
      end if
      call go_on(measure, system%body, now%instant%time, values)
    end associate
  end subroutine row_of_tip

  !> Tell all ranks the points whose damage is above the threshold since the last time. Their volume
  !> is 1 here: no rank needs it.
  subroutine gather_damaged(measure, system, damaged, grows)
    class(tip_measure_type), intent(inout) :: measure
    type(system_type), intent(in) :: system
    type(body_type), intent(inout) :: damaged  !! the points of all ranks, in the order of numbers
    logical, intent(out) :: grows              !! there are new ones
    real(wp), allocatable :: values(:, :)      ! (number, spacing, position; points)
    real(wp), allocatable :: flat(:)
    integer(i4), allocatable :: fresh(:)
    integer, allocatable :: sorted(:)
    class(ranks_type), pointer :: ranks
    integer(i8) :: before, all_fresh
    integer :: i, n, old

    ranks => system%body%order%ranks
    associate (body => system%body, dim => system%body%dim)
      fresh = pack(body%slot(:body%order%n_owned), .not. measure%told .and. &
        & system%state%damage(body%slot(:body%order%n_owned)) > measure%threshold)
      measure%told(body%point(fresh)) = .true.
      all_fresh = count_of_ranks(body%order, int(size(fresh), i8))
      grows = all_fresh > 0_i8
      if (.not. grows) return
      before = ranks%number_before(int(size(fresh), i8))
      old = damaged%n_points
      n = old + int(all_fresh)
      allocate (values(dim + 2, n), source=0.0_wp)
      do i = 1, size(fresh)
        associate (k => fresh(i))
          values(:, old + int(before) + i) = [real(number_at(body, int(k)), wp), body%spacing(k), &
            & body%x(k, :)]
        end associate
      end do
      flat = reshape(values(:, old + 1:), [int(all_fresh)*(dim + 2)])
      call ranks%add_all(flat)
      values(:, old + 1:) = reshape(flat, [dim + 2, int(all_fresh)])
      do i = 1, old
        values(:, i) = [real(damaged%number(i), wp), damaged%spacing(i), damaged%x(i, :)]
      end do
      sorted = ascending_order(nint(values(1, :), i8))
      call allocate_points(damaged, dim, n)
      damaged%volume = 1.0_wp
      damaged%spacing = values(2, sorted)
      damaged%x = transpose(values(3:, sorted))
      call own_points(damaged, n, nint(values(1, sorted), i8), body%order%n_global)
    end associate
  end subroutine gather_damaged

  !> Let the tip go on among the points of the crack that are known, and say where it is.
  subroutine go_on(measure, body, time, values)
    class(tip_measure_type), intent(inout) :: measure
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: time         !! [s]
    real(wp), intent(out) :: values(:)
    real(wp) :: place(3)
    integer :: dim

    dim = body%dim
    if (size(measure%recent) > 0) call move_tip(measure, body)
    call measure%speed%add(time, measure%farthest)
    place = measure%from
    if (measure%number > 0_i8) place(:dim) = place_of(body, measure%number)
    values(:dim + 4) = [place(:dim), measure%length, measure%farthest, measure%speed%slope(), &
      & real(measure%branches, wp)]
    if (dim < 3) return
    values(dim + 5:) = 0.0_wp
    if (size(measure%recent) == 0) return
    associate (there => measure%front > -huge(1.0_wp))
      values(dim + 5) = sum(measure%front, mask=there)/count(there)
      values(dim + 6) = minval(measure%front, mask=there)
      values(dim + 7) = maxval(measure%front, mask=there)
    end associate
  end subroutine go_on

  !> Where a point lies that is known [m].
  pure function place_of(body, number) result(place)
    type(body_type), intent(in) :: body
    integer(i8), intent(in) :: number  !! among the points of all ranks
    real(wp) :: place(body%dim)
    place = body%x(body%slot(owned_point(body%order, number)), :)
  end function place_of

  !> Take new points of the crack into the account: the farthest, those not far behind it, the
  !> front, and the parts into which it falls.
  subroutine take(measure, body, found)
    class(tip_measure_type), intent(inout) :: measure
    type(body_type), intent(in) :: body
    integer(i4), intent(in) :: found(:)  !! points
    logical, allocatable :: near(:)
    real(wp) :: way
    integer :: i, at

    if (size(measure%recent) == 0) measure%farthest = -huge(1.0_wp)
    do i = 1, size(found)
      way = projection(measure, body, found(i))
      measure%farthest = max(measure%farthest, way)
      if (body%dim < 3) cycle
      at = 1 + int((body%x(body%slot(found(i)), measure%across) - measure%side)/measure%spacing)
      at = min(max(at, 1), size(measure%front))
      measure%front(at) = max(measure%front(at), way)
    end do
    measure%recent = [measure%recent, found]
    allocate (near(size(measure%recent)))
    do i = 1, size(near)
      near(i) = projection(measure, body, measure%recent(i)) >= measure%farthest &
        & - (behind + touch)*measure%spacing
    end do
    measure%recent = pack(measure%recent, near)
    measure%branches = measure%reach%parts(body, measure%recent)
  end subroutine take

  !> Move the tip to the farthest point, and its path with it. Among equally far ones it stays where
  !> it is, or goes to the nearest; then the lowest number decides.
  subroutine move_tip(measure, body)
    class(tip_measure_type), intent(inout) :: measure
    type(body_type), intent(in) :: body
    real(wp) :: old(body%dim), distance, least, slack
    integer(i4) :: next
    integer :: i

    slack = touch*measure%spacing
    old = measure%from(:body%dim)
    if (measure%number > 0_i8) old = place_of(body, measure%number)
    least = huge(least)
    next = 0_i4
    do i = 1, size(measure%recent)
      associate (point => measure%recent(i))
        if (projection(measure, body, point) < measure%farthest - slack) cycle
        distance = norm2(body%x(body%slot(point), :) - old)
        if (distance > least + slack) cycle
        if (distance > least - slack .and. point > next) cycle
        least = distance
        next = point
      end associate
    end do
    if (number_at(body, int(body%slot(next))) == measure%number) return
    measure%number = number_at(body, int(body%slot(next)))
    measure%length = measure%length + least
  end subroutine move_tip

  !> The way of a point along the direction, from where the crack begins [m].
  pure real(wp) function projection(measure, body, point)
    class(tip_measure_type), intent(in) :: measure
    type(body_type), intent(in) :: body
    integer(i4), intent(in) :: point   !! here

    projection = dot_product(body%x(body%slot(point), :) - measure%from(:body%dim), &
      & measure%direction(:body%dim))
  end function projection

  !> Keep the path of the tip and the window of its speed.
  subroutine keep_tip(measure, archive)
    class(tip_measure_type), intent(inout) :: measure
    class(archive_type), intent(inout) :: archive
    integer :: point

    point = int(measure%number)
    call archive%keep('point of '//measure%name, point)
    measure%number = int(point, i8)
    call archive%keep('length of '//measure%name, measure%length)
    call measure%speed%keep(archive, 'growth of '//measure%name)
  end subroutine keep_tip

  !> Where it begins, where it goes, and in 3D along which axis its front extends.
  function describe_tip(measure, system) result(text)
    class(tip_measure_type), intent(in) :: measure
    type(system_type), intent(in) :: system
    character(:), allocatable :: text

    text = measure%name//' from '//vector(measure%from)//' m along '// &
      & vector(measure%direction)//', through damage above '//to_text(measure%threshold, 4)
    if (system%body%dim == 3) text = text//'; its front extends along '//xyz(measure%across)
    text = line('tip', text)

  contains

    !> `(0.1, 0.2)`
    pure function vector(value) result(words)
      real(wp), intent(in) :: value(3)
      character(:), allocatable :: words
      integer :: c

      words = '('//to_text(value(1), 4)
      do c = 2, system%body%dim
        words = words//', '//to_text(value(c), 4)
      end do
      words = words//')'
    end function vector
  end function describe_tip

  !> A crack that begins where no point is cannot be found, nor can one beside which the damage
  !> stays below the threshold.
  subroutine warn_of_tip(measure, system, warnings)
    class(tip_measure_type), intent(in) :: measure
    type(system_type), intent(in) :: system
    type(warnings_type), intent(inout) :: warnings
    real(wp) :: beside

    if (.not. measure%reach%has_place(system%body)) call warnings%add('tip '// &
      & to_text(measure%group), 'no point lies within 1.5 spacings of the place from which '// &
      & 'the tip '//measure%name//' is looked for: its crack cannot be found', tell=.false.)
    if (system%body%dim == 1) return
    beside = damage_beside(measure, system)
    if (beside <= measure%threshold) call warnings%add('threshold '//to_text(measure%group), &
      & 'the damage beside a straight crack is '//to_text(beside, 2)//', not above the '// &
      & 'threshold of the tip '//measure%name//' ('//to_text(measure%threshold, 3)// &
      & '): it follows branches and rough cracks at best; a lower threshold finds more', &
      & tell=.false.)
  end subroutine warn_of_tip

  !> The damage of a point inside a body half a spacing beside a long, straight crack along the
  !> direction, and in 3D along its front: the part of its family that lies beyond.
  real(wp) function damage_beside(measure, system) result(damage)
    class(tip_measure_type), intent(in) :: measure
    type(system_type), intent(in) :: system
    integer, parameter :: looked_at = 1000  ! points among which the one with most bonds is taken
    type(bonds_type) :: bonds
    real(wp) :: normal(3), along(3)
    integer :: i, best, k

    associate (body => system%body, d => measure%direction)
      along = [0.0_wp, 0.0_wp, 1.0_wp]
      if (body%dim == 3) along = merge(1.0_wp, 0.0_wp, [1, 2, 3] == measure%across)
      normal = [along(2)*d(3) - along(3)*d(2), along(3)*d(1) - along(1)*d(3), &
        & along(1)*d(2) - along(2)*d(1)]
      normal = normal/norm2(normal)
      call allocate_bonds(system%family, bonds)
      best = 0
      k = int(body%slot(1))
      do i = 1, body%n_points, max(1, body%n_points/looked_at)
        call system%family%bonds_of(int(body%slot(i)), bonds)
        if (bonds%n <= best) cycle
        best = bonds%n
        k = int(body%slot(i))
      end do
      call system%family%bonds_of(k, bonds)
      damage = 0.0_wp
      if (bonds%n == 0) return
      associate (beyond => matmul(bonds%xi(:bonds%n, :), normal(:body%dim)))
        damage = sum(bonds%weight(:bonds%n), mask=beyond > 0.5_wp*body%spacing(k)*(1 + touch)) &
          & /sum(bonds%weight(:bonds%n))
      end associate
    end associate
  end function damage_beside

end module pd_output_measures_tip
