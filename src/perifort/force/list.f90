!> The passes over the bonds of list families, cluster by cluster. What a cluster needs beyond the
!> simplest case (surface factors, several materials or spacings, exact volumes) is put into tables
!> first; what the fast formulas do not serve (large strains, temperature, another dilatation) is
!> computed by the general ones.
module pd_force_list
  use pd_base_kinds, only: wp, i1, i8
  use pd_family_clusters, only: lane_bit
  use pd_family_list, only: list_family_type, at_volume, at_moved, at_p
  use pd_family_offsets, only: lanes
  use pd_family_volume, only: volume_none, volume_exact
  use pd_force_general, only: mark_slot
  use pd_force_list_fast, only: choose_theta, choose_force
  use pd_force_list_general, only: work_type, general_theta, general_force, general_energy
  use pd_force_model, only: model_type
  use pd_force_polynomial, only: fast_limit, narrow
  implicit none (type, external)
  private
  public :: list_dilatation, list_force, list_energy

contains

  !> p_k = 2 a d delta theta_k of all slots. If bonds can break, `strained` gets 1 for slots with an
  !> intact bond beyond its limit.
  subroutine list_dilatation(family, model, u, p, strained)
    type(list_family_type), intent(inout) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: p(:)
    integer(i1), intent(inout), contiguous :: strained(:)
    type(work_type) :: work
    real(wp) :: limit, theta(lanes)
    integer :: c, k, l
    logical :: missed

    limit = fast_limit(model, narrow)
    if (model%dilatation .and. .not. model%projected) limit = 0.0_wp
    call gather_state(family, u)
    !$omp parallel default(none) shared(family, model, p, strained, limit) &
    !$omp private(work, theta, c, k, l, missed)
    call begin_work(family, model, work)
    !$omp do schedule(dynamic, 32)
    do c = 1, size(family%large)
      call take_up(family, c, work)
      if (work%tabled) call fill_tables(family, model, work, own=.false.)
      if (model%breaking) strained(work%first:work%first + lanes - 1) = 0_i1
      missed = limit <= 0.0_wp
      associate (e => family%start(c), n => work%n)
        if (.not. missed) call work%theta(n, family%member(e:e + n - 1), &
          & family%intact(e:e + n - 1), family%at, work%own, work%dilatation, work%geometry, &
          & work%edge, work%per_spacing, limit, theta, missed)
      end associate
      family%large(c) = merge(1_i1, 0_i1, missed)
      if (missed) then
        if (.not. work%tabled) call fill_tables(family, model, work, own=.false.)
        associate (e => family%start(c))
          call general_theta(model, work, family%member(e:e + work%n - 1), family%at, theta)
        end associate
        if (model%breaking) call mark(model, work, strained)
      end if
      do l = 1, lanes
        k = work%first + l - 1
        associate (m => model%materials(model%material(k)))
          p(k) = m%p*m%t*theta(l)
        end associate
      end do
    end do
    !$omp end parallel
  end subroutine list_dilatation

  !> Force density of all slots (n_slots, dim) [N/m3]. With a dilatation this follows
  !> `list_dilatation` at the same displacements.
  subroutine list_force(family, model, u, p, force, strained)
    type(list_family_type), intent(inout) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(inout), contiguous :: force(:, :)
    integer(i1), intent(inout), contiguous :: strained(:)
    type(work_type) :: work
    real(wp) :: limit, f(lanes, 3)
    integer :: c, d
    logical :: missed

    limit = fast_limit(model, narrow)
    if (model%dilatation .and. .not. model%projected) limit = 0.0_wp
    call gather_state(family, u, p)
    !$omp parallel default(none) shared(family, model, force, strained, limit) &
    !$omp private(work, f, c, d, missed)
    call begin_work(family, model, work)
    !$omp do schedule(dynamic, 32)
    do c = 1, size(family%large)
      call take_up(family, c, work)
      if (work%tabled) call fill_tables(family, model, work, own=.false.)
      if (model%breaking) strained(work%first:work%first + lanes - 1) = 0_i1
      missed = limit <= 0.0_wp
      if (model%dilatation) missed = family%large(c) == 1_i1
      associate (e => family%start(c), n => work%n)
        if (.not. missed) call work%force(n, family%member(e:e + n - 1), &
          & family%intact(e:e + n - 1), family%at, work%own, work%stretch, work%dilatation, &
          & work%geometry, work%edge, work%per_spacing, work%q, limit, f, missed)
      end associate
      if (missed) then
        if (.not. work%tabled) call fill_tables(family, model, work, own=.false.)
        associate (e => family%start(c))
          call general_force(model, work, family%member(e:e + work%n - 1), family%at, f)
        end associate
        if (model%breaking) call mark(model, work, strained)
      end if
      do d = 1, model%dim
        force(work%first:work%first + lanes - 1, d) = f(:, d)
      end do
    end do
    !$omp end parallel
  end subroutine list_force

  !> Strain energy density of all slots [J/m3].
  subroutine list_energy(family, model, u, energy)
    type(list_family_type), intent(inout) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: energy(:)
    type(work_type) :: work
    real(wp) :: theta(lanes), stretches(lanes)
    integer :: c, k, l

    call gather_state(family, u)
    !$omp parallel default(none) shared(family, model, energy) &
    !$omp private(work, theta, stretches, c, k, l)
    call begin_work(family, model, work)
    !$omp do schedule(dynamic, 32)
    do c = 1, size(family%large)
      call take_up(family, c, work)
      call fill_tables(family, model, work, own=.true.)
      associate (e => family%start(c))
        call general_energy(model, work, family%member(e:e + work%n - 1), family%at, stretches, &
          & theta)
      end associate
      do l = 1, lanes
        k = work%first + l - 1
        associate (m => model%materials(model%material(k)))
          energy(k) = stretches(l) + m%a*(m%t*theta(l))**2
        end associate
      end do
    end do
    !$omp end parallel
  end subroutine list_energy

  ! ---------------------------------------------------------------- one cluster

  !> Room for any cluster, and what is the same for all of them.
  subroutine begin_work(family, model, work)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(work_type), intent(out) :: work

    work%tabled = model%surface .or. size(model%materials) > 1 .or. .not. family%one_spacing &
      & .or. family%rule%kind == volume_exact
    call choose_theta(family%dim, work%tabled, work%theta)
    call choose_force(family%dim, work%tabled, model%dilatation, work%force)
    associate (n => family%most_members)
      allocate (work%stretch(lanes, n), work%dilatation(lanes, n), work%geometry(lanes, n))
    end associate
    work%q = 2*model%materials(1)%q
    ! without tables all points have the spacing of the first
    work%per_spacing = 1/family%spacing(1)
    work%edge = family%rule%delta + family%spacing(1)/2
    ! so far away that vc is 1 everywhere
    if (family%rule%kind == volume_none) work%edge = 3*work%edge
  end subroutine begin_work

  !> Turn to cluster `c`.
  pure subroutine take_up(family, c, work)
    type(list_family_type), intent(in) :: family
    integer, intent(in) :: c
    type(work_type), intent(inout) :: work
    integer :: d, l

    work%cluster = c
    work%first = lanes*(c - 1) + 1
    work%n = int(family%start(c + 1) - family%start(c))
    do d = 1, at_p
      do l = 1, lanes
        work%own(l, d) = family%at(d, work%first + l - 1)
      end do
    end do
  end subroutine take_up

  !> Copy displacements, and p if there is one, point by point: what a bond needs of its other end
  !> then stands in one place.
  subroutine gather_state(family, u, p)
    type(list_family_type), intent(inout) :: family
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(in), contiguous, optional :: p(:)
    integer :: k, c

    !$omp parallel do schedule(static) default(none) shared(family, u, p) private(k, c)
    do k = 1, family%n_slots
      do c = 1, size(u, 2)
        family%at(at_moved + c, k) = u(k, c)
      end do
      if (.not. present(p)) cycle
      if (size(p) > 0) family%at(at_p, k) = p(k)
    end do
  end subroutine gather_state

  ! ---------------------------------------------------------------- tables

  !> Weights of a cluster's bonds, for any rule, material and surface factor. `own`: with 2 q_k in
  !> place of q_k + q_j, as the energy needs them.
  pure subroutine fill_tables(family, model, work, own)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(work_type), intent(inout) :: work
    logical, intent(in) :: own
    real(wp), dimension(lanes) :: length, spacing, q, q_own, weight
    real(wp) :: xi(lanes, 3)
    integer(i8) :: e, b
    integer :: i, j, d, l, last

    last = work%first + lanes - 1
    q = work%q
    if (size(model%materials) > 1) q_own = model%materials(model%material(work%first:last))%q
    b = 0_i8
    if (allocated(family%fraction)) b = family%first_bond(work%cluster)
    do i = 1, work%n
      e = family%start(work%cluster) + i - 1
      j = family%member(e)
      do d = 1, 3
        xi(:, d) = family%at(d, j) - work%own(:, d)
      end do
      ! a lane that is no bond may be the member itself
      where (iand(family%intact(e), lane_bit) == 0_i1) xi(:, 1) = work%edge
      length = xi(:, 1)**2 + xi(:, 2)**2 + xi(:, 3)**2
      work%geometry(:, i) = 1/length
      length = sqrt(length)
      weight = merge(family%at(at_volume, j), 0.0_wp, iand(family%intact(e), lane_bit) /= 0_i1)
      select case (family%rule%kind)
      case (volume_none)
        continue
      case (volume_exact)
        do l = 1, lanes
          if (iand(family%bits(e), lane_bit(l)) == 0_i1) cycle
          weight(l) = weight(l)*family%fraction(b)
          b = b + 1
        end do
      case default
        spacing = family%spacing(j)
        if (.not. family%one_spacing) spacing = (family%spacing(work%first:last) + spacing)/2
        weight = weight*max(0.0_wp, min(1.0_wp, (family%rule%delta + spacing/2 - length)/spacing))
      end select
      if (size(model%materials) > 1) then
        q = q_own + merge(q_own, spread(model%materials(model%material(j))%q, 1, lanes), own)
      end if
      work%dilatation(:, i) = weight
      work%stretch(:, i) = q*weight/length
      if (model%surface) then
        do d = 1, 3
          xi(:, d) = xi(:, d)/length
        end do
        if (model%dilatation) work%dilatation(:, i) = weight*factor(model%D, xi, work%first, j)
        work%stretch(:, i) = work%stretch(:, i)*factor(model%S, xi, work%first, j)
      end if
    end do
  end subroutine fill_tables

  !> Surface factors G = ( sum_alpha (n_alpha/g_alpha)^2 )^(-1/2) of a cluster's bonds to slot `j`
  !> with g = (g_k + g_j)/2 of their ends (7.7), from `g` (n_slots, dim) and directions `n`.
  pure function factor(g, n, first, j)
    real(wp), intent(in) :: g(:, :)
    real(wp), intent(in) :: n(lanes, 3)
    integer, intent(in) :: first, j
    real(wp) :: factor(lanes)
    real(wp) :: s(lanes, 3)
    integer :: d

    s = 1.0_wp
    do d = 1, size(g, 2)
      s(:, d) = g(first:first + lanes - 1, d) + g(j, d)
    end do
    ! with a common denominator there is one division
    factor = 0.5_wp*s(:, 1)*s(:, 2)*s(:, 3)/sqrt((n(:, 1)*s(:, 2)*s(:, 3))**2 &
      & + (n(:, 2)*s(:, 1)*s(:, 3))**2 + (n(:, 3)*s(:, 1)*s(:, 2))**2)
  end function factor

  ! ---------------------------------------------------------------- breaking

  !> Mark the lanes with an intact bond at its limit, a hair's breadth early and by the smallest
  !> limit of all: what breaks is decided elsewhere.
  pure subroutine mark(model, work, strained)
    type(model_type), intent(in) :: model
    type(work_type), intent(in) :: work
    integer(i1), intent(inout), contiguous :: strained(:)
    real(wp) :: limit
    integer(i8) :: k
    integer :: l

    limit = model%least_critical*(1 - 1.0e-9_wp)
    do l = 1, lanes
      k = work%first + l - 1
      if (work%tension(l) > limit) call mark_slot(model, k, work%tension(l), strained)
      if (work%compression(l) > limit) call mark_slot(model, k, -work%compression(l), strained)
    end do
  end subroutine mark

end module pd_force_list
