!> Tables for the loops of list families. Clusters whose points lie the same way, as those of one
!> lattice do, share xi and 1/|xi|^2 (a shape); those whose bonds have the same weights, too, share
!> these. Clusters whose points have different surface factors, materials or spacings have weights
!> in any case, if nobody shares them of their own.
module pd_force_list_tables
  use pd_base_kinds, only: wp, sp, i1, i4, i8
  use pd_base_lanes, only: lanes
  use pd_base_lookup, only: lookup_type, mix
  use pd_family_clusters, only: lane_bit
  use pd_family_list, only: list_family_type
  use pd_force_list_general, only: work_type, fill_tables, take_up
  use pd_force_model, only: force_options_type, model_type, options_of
  use pd_force_polynomial, only: fast_limit, narrow
  use pd_force_workspace, only: list_workspace_type
  implicit none (type, external)
  private
  public :: make_tables

  !> What all shapes may take [bytes], and what they may take for each slot beside.
  integer(i8), parameter :: room = 16777216_i8, bytes_per_slot = 100_i8

  !> What the values of each lane are multiplied with, so that their sum may stand for them in a
  !> key: of 20 bits, so that nothing overflows, and odd.
  integer(i8), parameter :: factors(lanes, 3) = reshape([648055_i8, 353197_i8, 1001289_i8, &
    & 772423_i8, 127641_i8, 885667_i8, 514229_i8, 290531_i8, 961333_i8, 431747_i8, 705961_i8, &
    & 218645_i8, 839211_i8, 573859_i8, 162907_i8, 1020703_i8, 387433_i8, 743551_i8, 95621_i8, &
    & 916157_i8, 619789_i8, 254043_i8, 807331_i8, 468977_i8], [lanes, 3])

  !> Clusters with one key.
  type :: kinds_type
    integer(i4), allocatable :: of(:)     !! number of each cluster's kind, 0: none
    integer(i4), allocatable :: first(:)  !! first cluster of each kind
    integer(i4), allocatable :: uses(:)   !! clusters of each kind
  end type kinds_type

contains

  !> Make the tables of all clusters: `stored`, `weight_D`, `weight_S`, `shape` and `geometry`.
  subroutine make_tables(family, model, workspace)
    type(list_family_type), intent(in) :: family  !! the family
    type(model_type), intent(in) :: model         !! parameters of the slots
    type(list_workspace_type), intent(inout) :: workspace  !! surveyed (`pd_force_list_points`)
    type(kinds_type) :: shapes, weights
    type(force_options_type) :: options
    real(wp) :: near

    allocate (workspace%stored(size(workspace%plain)), source=0_i8)
    allocate (workspace%shape(size(workspace%plain)), source=0_i8)
    allocate (workspace%weight_S(lanes, 0), workspace%weight_D(lanes, 0))
    allocate (workspace%geometry(lanes, 0))
    ! general formulas fill tables of their own; a heated body has tangents without thermal strain
    options = options_of(model)
    options%thermal = .false.
    if (fast_limit(model, options, narrow) <= 0.0_wp) return

    ! positions are off by their last bits
    near = min(8*epsilon(1.0_wp)*maxval(abs(family%x)), &
      & 2.0e-13_wp*family%rule%delta)
    if (family%fixed_order) then
      ! which clusters are alike depends on the ranks: each has weights of its own
      workspace%plain = 0_i1
      allocate (shapes%of(size(workspace%plain)), weights%of(size(workspace%plain)), source=0_i4)
      allocate (shapes%first(0))
    else
      call find_shapes(family, workspace, near, shapes)
      call find_weights(family, model, workspace, shapes, weights)
      call share_weights(family, model, near, workspace, shapes, weights)
    end if
    call store_own_weights(family, model, shapes, weights, workspace)
    call store_shapes(family, shapes, workspace)
  end subroutine make_tables

  ! ---------------------------------------------------------------- kinds of clusters

  !> The shapes that enough clusters share. A key finds them, the positions decide.
  subroutine find_shapes(family, workspace, near, shapes)
    type(list_family_type), intent(in) :: family
    type(list_workspace_type), intent(in) :: workspace
    real(wp), intent(in) :: near           !! positions that differ less are the same [m]
    type(kinds_type), intent(out) :: shapes
    integer(i8), allocatable :: key(:)
    integer(i8) :: bytes
    integer :: c, least

    allocate (key(size(workspace%plain)))
    !$omp parallel do schedule(dynamic, 32) default(none) shared(family, key) private(c)
    do c = 1, size(key)
      key(c) = shape_key(family, c)
    end do
    call number_kinds(key, workspace%key_bits, shapes)
    ! if there is no room for all, those that most clusters share
    least = workspace%least_shared
    do
      bytes = 0_i8
      do c = 1, size(shapes%first)
        if (shapes%uses(c) >= least) bytes = bytes + 8*lanes*columns(family) &
          & *packs_of(family, int(shapes%first(c)))
      end do
      if (bytes <= room + bytes_per_slot*family%n_slots) exit
      least = 2*least
    end do
    !$omp parallel do schedule(dynamic, 32) default(none) shared(family, shapes, near, least) &
    !$omp private(c)
    do c = 1, size(key)
      if (shapes%uses(shapes%of(c)) < least) then
        shapes%of(c) = 0_i4
      else if (.not. same_shape(family, c, int(shapes%first(shapes%of(c))), near)) then
        shapes%of(c) = 0_i4
      end if
    end do
  end subroutine find_shapes

  !> The weights that clusters of one shape share. A cluster whose points are alike needs no tables:
  !> it gives up its shape if too few share its weights.
  subroutine find_weights(family, model, workspace, shapes, weights)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(list_workspace_type), intent(in) :: workspace
    type(kinds_type), intent(inout) :: shapes
    type(kinds_type), intent(out) :: weights
    type(work_type) :: work
    integer(i8), allocatable :: key(:)
    integer :: c

    allocate (key(size(workspace%plain)), source=0_i8)
    !$omp parallel do schedule(dynamic, 32) default(none) &
    !$omp shared(family, model, workspace, shapes, key) private(work, c)
    do c = 1, size(key)
      if (shapes%of(c) == 0_i4) cycle
      call weights_of(family, model, workspace, c, work)
      key(c) = weight_key(model, work, int(shapes%of(c), i8))
    end do
    call number_kinds(key, workspace%key_bits, weights)
    do c = 1, size(key)
      if (shapes%of(c) == 0_i4) then
        weights%of(c) = 0_i4
      else if (workspace%plain(c) == 1_i1 &
        & .and. weights%uses(weights%of(c)) < workspace%least_shared) then
        weights%of(c) = 0_i4
        shapes%of(c) = 0_i4
      else if (weights%uses(weights%of(c)) < min(2, workspace%least_shared)) then
        weights%of(c) = 0_i4
      end if
    end do
  end subroutine find_weights

  !> Number the kinds of clusters by their keys.
  subroutine number_kinds(key, key_bits, kinds)
    integer(i8), intent(in) :: key(:)
    integer(i8), intent(in) :: key_bits  !! bits that count
    type(kinds_type), intent(out) :: kinds
    type(lookup_type) :: numbers
    integer :: c, number
    logical :: is_new

    allocate (kinds%of(size(key)), kinds%first(size(key)), kinds%uses(size(key)))
    kinds%uses = 0_i4
    do c = 1, size(key)
      call numbers%number_of(iand(key(c), key_bits), number, is_new)
      kinds%of(c) = int(number, i4)
      if (is_new) kinds%first(number) = int(c, i4)
      kinds%uses(number) = kinds%uses(number) + 1_i4
    end do
    kinds%first = kinds%first(:numbers%count)
    kinds%uses = kinds%uses(:numbers%count)
  end subroutine number_kinds

  !> A key of the lanes' bonds and their xi, rounded to a part of the horizon. That begins off zero:
  !> what is zero or another simple part of the horizon must not fall where it rounds both ways.
  pure integer(i8) function shape_key(family, c) result(key)
    type(list_family_type), intent(in) :: family
    integer, intent(in) :: c  !! cluster
    real(wp), parameter :: off = 0.37_wp
    real(wp) :: geometry(lanes, columns(family)), scale
    integer(i8) :: e, value
    integer :: d

    scale = 65536/family%rule%delta
    key = packs_of(family, c)
    do e = family%start(c), family%start(c + 1) - 1
      call geometry_of(family, c, e, geometry)
      value = ior(ishft(iand(int(family%first(e), i8), 255_i8), 8), &
        & iand(int(family%bits(e), i8), 255_i8))
      do d = 1, family%dim
        value = value + sum(factors(:, d)*nint(geometry(:, d)*scale + off, i8))
      end do
      key = mix(key, value)
    end do
  end function shape_key

  !> Whether cluster `c` has the bonds of cluster `other`, with xi that differ by `near` at most.
  pure logical function same_shape(family, c, other, near)
    type(list_family_type), intent(in) :: family
    integer, intent(in) :: c, other
    real(wp), intent(in) :: near
    real(wp) :: one(lanes, columns(family)), two(lanes, columns(family))
    integer(i8) :: e, o
    integer :: i

    same_shape = c == other
    if (same_shape .or. packs_of(family, c) /= packs_of(family, other)) return
    do i = 1, int(packs_of(family, c))
      e = family%start(c) + i - 1
      o = family%start(other) + i - 1
      if (family%bits(e) /= family%bits(o) .or. family%first(e) /= family%first(o)) return
      call geometry_of(family, c, e, one)
      call geometry_of(family, other, o, two)
      if (any(abs(one(:, :family%dim) - two(:, :family%dim)) > near)) return
    end do
    same_shape = .true.
  end function same_shape

  !> A key of a cluster's weights, which `work` has, as parts of the greatest.
  pure integer(i8) function weight_key(model, work, shape) result(key)
    type(model_type), intent(in) :: model
    type(work_type), intent(in) :: work
    integer(i8), intent(in) :: shape  !! number of its shape
    real(wp) :: most_S, most_D
    integer(i8) :: value
    integer :: i

    most_S = max(tiny(1.0_wp), maxval(abs(work%stretch(:, :work%n))))
    most_D = max(tiny(1.0_wp), maxval(abs(work%dilatation(:, :work%n))))
    key = mix(shape, int(bits_of(fraction(most_S) + fraction(most_D)/3), i8))
    do i = 1, work%n
      value = sum(factors(:, 1)*bits_of(work%stretch(:, i)/most_S))
      if (model%dilatation) value = value &
        & + sum(factors(:, 2)*bits_of(work%dilatation(:, i)/most_D))
      key = mix(key, value)
    end do
  end function weight_key

  !> A value's bits in single precision.
  elemental integer(i4) function bits_of(value)
    real(wp), intent(in) :: value
    bits_of = transfer(real(value, sp), 0_i4)
  end function bits_of

  ! ---------------------------------------------------------------- tables

  !> Store the weights of each kind; clusters that have others after all lose their kind.
  subroutine share_weights(family, model, near, workspace, shapes, weights)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in) :: near
    type(list_workspace_type), intent(inout) :: workspace
    type(kinds_type), intent(inout) :: shapes, weights
    type(work_type) :: work
    integer(i8), allocatable :: place(:)
    integer(i8) :: n
    real(wp) :: off
    integer :: c, i

    allocate (place(size(weights%first)), source=0_i8)
    n = 0_i8
    do i = 1, size(place)
      c = int(weights%first(i))
      if (weights%of(c) /= i) cycle
      place(i) = n + 1
      n = n + packs_of(family, c)
    end do
    call resize(model, n, workspace)
    !$omp parallel do schedule(dynamic, 4) default(none) &
    !$omp shared(family, model, workspace, weights, place) private(work, c, i)
    do i = 1, size(place)
      if (place(i) == 0_i8) cycle
      c = int(weights%first(i))
      call weights_of(family, model, workspace, c, work)
      call put_weights(model, work, place(i), workspace)
    end do
    ! the volume correction changes by what |xi| does, over the spacing
    off = 64*epsilon(1.0_wp) + 2*near/minval(family%spacing, mask=family%spacing > 0.0_wp)
    !$omp parallel do schedule(dynamic, 32) default(none) private(work, c) &
    !$omp shared(family, model, workspace, off, shapes, weights, place)
    do c = 1, size(weights%of)
      if (weights%of(c) == 0_i4) cycle
      if (shapes%of(weights%first(weights%of(c))) == shapes%of(c) &
        & .and. place(weights%of(c)) > 0_i8) then
        call weights_of(family, model, workspace, c, work)
        if (same_weights(model, workspace, work, place(weights%of(c)), off)) then
          workspace%stored(c) = place(weights%of(c))
          cycle
        end if
      end if
      weights%of(c) = 0_i4
      if (workspace%plain(c) == 1_i1) shapes%of(c) = 0_i4
    end do
  end subroutine share_weights

  !> Store weights of their own for clusters that need some and share none.
  subroutine store_own_weights(family, model, shapes, weights, workspace)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(kinds_type), intent(in) :: shapes, weights
    type(list_workspace_type), intent(inout) :: workspace
    type(work_type) :: work
    integer(i8) :: n
    integer :: c

    n = size(workspace%weight_S, 2, kind=i8)
    do c = 1, size(workspace%plain)
      if (weights%of(c) > 0_i4) cycle
      if (workspace%plain(c) == 1_i1 .and. shapes%of(c) == 0_i4) cycle
      workspace%stored(c) = n + 1
      n = n + packs_of(family, c)
    end do
    call resize(model, n, workspace)
    !$omp parallel do schedule(dynamic, 32) default(none) &
    !$omp shared(family, model, weights, workspace) private(work, c)
    do c = 1, size(workspace%plain)
      if (weights%of(c) > 0_i4 .or. workspace%stored(c) == 0_i8) cycle
      call weights_of(family, model, workspace, c, work)
      call put_weights(model, work, workspace%stored(c), workspace)
    end do
  end subroutine store_own_weights

  !> Store the shapes that clusters have.
  subroutine store_shapes(family, shapes, workspace)
    type(list_family_type), intent(in) :: family
    type(kinds_type), intent(in) :: shapes
    type(list_workspace_type), intent(inout) :: workspace
    integer(i8), allocatable :: place(:)
    integer(i8) :: n, e, s
    integer :: c, i

    allocate (place(size(shapes%first)), source=0_i8)
    n = 0_i8
    do c = 1, size(workspace%plain)
      i = int(shapes%of(c))
      if (i == 0) cycle
      if (place(i) == 0_i8) then
        place(i) = n + 1
        n = n + columns(family)*packs_of(family, c)
      end if
      workspace%shape(c) = place(i)
    end do
    deallocate (workspace%geometry)
    allocate (workspace%geometry(lanes, n))
    do i = 1, size(place)
      if (place(i) == 0_i8) cycle
      c = int(shapes%first(i))
      do e = family%start(c), family%start(c + 1) - 1
        s = place(i) + columns(family)*(e - family%start(c))
        call geometry_of(family, c, e, workspace%geometry(:, s:s + columns(family) - 1))
      end do
    end do
  end subroutine store_shapes

  !> Room for `n` packs of weights; those that are there stay.
  subroutine resize(model, n, workspace)
    type(model_type), intent(in) :: model
    integer(i8), intent(in) :: n
    type(list_workspace_type), intent(inout) :: workspace
    real(wp), allocatable :: longer(:, :)
    integer(i8) :: m

    m = size(workspace%weight_S, 2, kind=i8)
    if (n == m) return
    allocate (longer(lanes, n))
    longer(:, :m) = workspace%weight_S
    call move_alloc(longer, workspace%weight_S)
    if (.not. model%dilatation) return
    allocate (longer(lanes, n))
    longer(:, :m) = workspace%weight_D
    call move_alloc(longer, workspace%weight_D)
  end subroutine resize

  !> Turn to cluster `c` and fill the tables of `work`.
  subroutine weights_of(family, model, workspace, c, work)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(list_workspace_type), intent(in) :: workspace
    integer, intent(in) :: c
    type(work_type), intent(inout) :: work

    call take_up(family, workspace, c, work)
    call fill_tables(family, model, workspace, &
      & family%bits(family%start(c):family%start(c + 1) - 1), .false., work)
    ! (q_k + q_j) Gb vc V |xi|
    work%stretch(:, :work%n) = work%stretch(:, :work%n)/work%geometry(:, :work%n)
  end subroutine weights_of

  !> Put the weights that `work` has at `place`.
  subroutine put_weights(model, work, place, workspace)
    type(model_type), intent(in) :: model
    type(work_type), intent(in) :: work
    integer(i8), intent(in) :: place
    type(list_workspace_type), intent(inout) :: workspace

    associate (last => place + work%n - 1)
      workspace%weight_S(:, place:last) = work%stretch(:, :work%n)
      if (model%dilatation) workspace%weight_D(:, place:last) = work%dilatation(:, :work%n)
    end associate
  end subroutine put_weights

  !> Whether the weights at `place` are those that `work` has, but for a part `off` of the greatest.
  pure logical function same_weights(model, workspace, work, place, off)
    type(model_type), intent(in) :: model
    type(list_workspace_type), intent(in) :: workspace
    type(work_type), intent(in) :: work
    integer(i8), intent(in) :: place
    real(wp), intent(in) :: off

    associate (n => work%n, last => place + work%n - 1)
      same_weights = maxval(abs(work%stretch(:, :n) - workspace%weight_S(:, place:last))) &
        & <= off*maxval(abs(work%stretch(:, :n)))
      if (.not. (model%dilatation .and. same_weights)) return
      same_weights = maxval(abs(work%dilatation(:, :n) - workspace%weight_D(:, place:last))) &
        & <= off*maxval(abs(work%dilatation(:, :n)))
    end associate
  end function same_weights

  !> xi of the lanes in pack `e` of cluster `c`, and 2/|xi|^2, below 0 where the bond goes to the
  !> pack's second member; all 0 where there is no bond.
  pure subroutine geometry_of(family, c, e, geometry)
    type(list_family_type), intent(in) :: family
    integer, intent(in) :: c
    integer(i8), intent(in) :: e
    real(wp), intent(out) :: geometry(:, :)  !! (lane, column)
    real(wp) :: square(lanes)
    logical :: there(lanes), from(lanes)
    integer :: d, j, m, k

    j = family%member(1, e)
    m = family%member(2, e)
    k = lanes*(c - 1)
    from = iand(family%first(e), lane_bit) /= 0_i1
    there = iand(family%bits(e), lane_bit) /= 0_i1
    geometry = 0.0_wp
    square = 0.0_wp
    do d = 1, family%dim
      geometry(:, d) = merge(merge(family%x(d, j), family%x(d, m), from) &
        & - family%x(d, k + 1:k + lanes), 0.0_wp, there)
      square = square + geometry(:, d)**2
    end do
    geometry(:, columns(family)) = merge(merge(2.0_wp, -2.0_wp, from) &
      & /merge(square, 1.0_wp, there), 0.0_wp, there)
  end subroutine geometry_of

  !> Columns of a pack in `geometry`. The loops have two components at least.
  pure integer function columns(family)
    type(list_family_type), intent(in) :: family
    columns = max(2, family%dim) + 1
  end function columns

  !> Packs of cluster `c`.
  pure integer(i8) function packs_of(family, c)
    type(list_family_type), intent(in) :: family
    integer, intent(in) :: c
    packs_of = family%start(c + 1) - family%start(c)
  end function packs_of

end module pd_force_list_tables
