!> The general formulas of list families, for the bonds of one cluster: any strain, temperature,
!> either dilatation, and the marks of strained slots. They take weights from tables, which are
!> filled first, and always three components, those that a body does not have being zero.
module pd_force_list_general
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_lanes, only: lanes
  use pd_family_clusters, only: lane_bit
  use pd_family_list, only: list_family_type
  use pd_family_volume, only: volume_none, volume_exact
  use pd_force_list_loop, only: least
  use pd_force_list_points, only: given_q, given_half, given_D, given_S
  use pd_force_model, only: bond_factors_of, force_options_type, model_type
  use pd_force_workspace, only: list_workspace_type, at_volume, at_p
  implicit none (type, external)
  private
  public :: work_type, fill_tables, cluster_theta, cluster_force, cluster_energy, take_up, &
    & take_place, take_given

  !> Where the displacement and what the model gives stand in `own`, behind the position.
  integer, parameter :: own_moved = 4, own_given = 8

  !> What one cluster is worked with: one for each thread.
  type :: work_type
    integer :: cluster = 0
    integer :: first = 1                       !! its first slot
    integer :: n = 0                           !! its packs
    real(wp) :: own(lanes, 16) = 0.0_wp        !! what `place`, `moved` and `given` have of
                                               !! its own slots
    real(wp), allocatable :: stretch(:, :)     !! (q_k + q_j) Gb vc V_j/|xi|, 0 where there is no
                                               !! intact bond (lane, pack)
    real(wp), allocatable :: dilatation(:, :)  !! Gd vc V_j
    real(wp), allocatable :: geometry(:, :)    !! 1/|xi|^2
    real(wp) :: heat(lanes) = 0.0_wp           !! alpha dT of the lanes, halved
    real(wp) :: tension(lanes) = 0.0_wp        !! greatest stretch of each lane's intact bonds
    real(wp) :: compression(lanes) = 0.0_wp    !! and of its negative
  end type work_type

contains

  !> Turn to cluster `c`.
  pure subroutine take_up(family, workspace, c, work)
    type(list_family_type), intent(in) :: family  !! the family
    type(list_workspace_type), intent(in) :: workspace  !! prepared, with the state gathered
    integer, intent(in) :: c                      !! cluster
    type(work_type), intent(inout) :: work
      !! gets what its slots have; its tables stay those of another cluster
    integer :: d, l

    work%cluster = c
    work%first = lanes*(c - 1) + 1
    work%n = int(family%start(c + 1) - family%start(c))
    do d = 1, at_p
      do l = 1, lanes
        work%own(l, own_moved + d) = workspace%moved(d, work%first + l - 1)
      end do
    end do
  end subroutine take_up

  !> Take where its slots are, too.
  pure subroutine take_place(workspace, work)
    type(list_workspace_type), intent(in) :: workspace  !! prepared
    type(work_type), intent(inout) :: work              !! of the cluster it has taken up
    integer :: d, l

    do d = 1, at_volume
      do l = 1, lanes
        work%own(l, d) = workspace%place(d, work%first + l - 1)
      end do
    end do
  end subroutine take_place

  !> Take what the model gives its slots, too.
  pure subroutine take_given(workspace, work)
    type(list_workspace_type), intent(in) :: workspace  !! prepared
    type(work_type), intent(inout) :: work              !! of the cluster it has taken up
    integer :: d, l

    do d = 1, size(workspace%given, 1)
      do l = 1, lanes
        work%own(l, own_given + d) = workspace%given(d, work%first + l - 1)
      end do
    end do
  end subroutine take_given

  !> Room for the tables of any cluster.
  subroutine allocate_tables(family, work)
    type(list_family_type), intent(in) :: family
    type(work_type), intent(inout) :: work

    if (allocated(work%stretch)) return
    associate (n => family%most_packs)
      allocate (work%stretch(lanes, n), work%dilatation(lanes, n), work%geometry(lanes, n))
    end associate
  end subroutine allocate_tables

  !> Weights of a cluster's bonds, for any rule, material and surface factor: of those that `bits`
  !> (packs of the cluster) has. `own`: with 2 q_k in place of q_k + q_j, as the energy needs them.
  subroutine fill_tables(family, model, workspace, bits, own, work)
    type(list_family_type), intent(in) :: family  !! the family
    type(model_type), intent(in) :: model  !! parameters of the slots
    type(list_workspace_type), intent(in) :: workspace  !! prepared for the model
    integer(i1), intent(in) :: bits(:)  !! (packs) lanes whose bonds count, such as the intact ones
    logical, intent(in) :: own          !! 2 q_k in place of q_k + q_j
    type(work_type), intent(inout) :: work
      !! of the cluster it has taken up; gets the tables of its bonds
    real(wp), dimension(lanes) :: x, y, z, q, length, weight, spacing, delta, a, b, c, gb, gd
    logical :: there(lanes), from(lanes)
    integer(i8) :: e, place(lanes)
    integer :: i, j, m, f, l

    call allocate_tables(family, work)
    call take_place(workspace, work)
    call take_given(workspace, work)
    if (model%consistent) then
      do l = 1, lanes
        place(l) = 0_i8
        if (model%weights%row(work%first + l - 1) > 0_i4) &
          & place(l) = model%weights%before(work%first + l - 1)
      end do
    end if
    do i = 1, work%n
      e = family%start(work%cluster) + i - 1
      j = family%member(1, e)
      m = family%member(2, e)
      from = iand(family%first(e), lane_bit) /= 0_i1
      there = iand(bits(i), lane_bit) /= 0_i1
      x = merge(workspace%place(1, j), workspace%place(1, m), from) - work%own(:, 1)
      y = merge(workspace%place(2, j), workspace%place(2, m), from) - work%own(:, 2)
      z = merge(workspace%place(3, j), workspace%place(3, m), from) - work%own(:, 3)
      weight = merge(merge(workspace%place(at_volume, j), workspace%place(at_volume, m), from), &
        & 0.0_wp, there)
      q = work%own(:, own_given + given_q)
      if (.not. own) then
        q = q + merge(workspace%given(given_q, j), workspace%given(given_q, m), from)
      else
        q = 2*q
      end if
      ! an empty lane may be the member itself
      length = sqrt(merge(x**2 + y**2 + z**2, 1.0_wp, there))
      select case (family%rule%kind)
      case (volume_none)
        continue
      case (volume_exact)
        weight = weight*family%fraction(:, e)
      case default
        spacing = work%own(:, own_given + given_half) &
          & + merge(workspace%given(given_half, j), workspace%given(given_half, m), from)
        if (family%rule%ratio > 0.0_wp) then
          ! the bits of `horizon_of_bond`: halves are exact
          delta = family%rule%ratio*(2*max(work%own(:, own_given + given_half), &
            & merge(workspace%given(given_half, j), workspace%given(given_half, m), from)))
          weight = weight*max(0.0_wp, min(1.0_wp, (delta + spacing/2 - length)/spacing))
        else
          weight = weight*max(0.0_wp, min(1.0_wp, (family%rule%delta + spacing/2 - length)/spacing))
        end if
      end select
      work%geometry(:, i) = 1/length**2
      work%dilatation(:, i) = weight
      work%stretch(:, i) = q*weight/length
      if (allocated(model%horizon) .and. .not. model%influenced) then
        ! `bond_factors_of` without its calls
        associate (first => work%first, last => work%first + lanes - 1)
          work%stretch(:, i) = work%stretch(:, i)*min(model%of_stretch(first:last), &
            & merge(model%of_stretch(j), model%of_stretch(m), from))
          work%dilatation(:, i) = weight*min(model%of_dilatation(first:last), &
            & merge(model%of_dilatation(j), model%of_dilatation(m), from))
        end associate
      else if (model%weighted) then
        do l = 1, lanes
          gb(l) = 0.0_wp
          gd(l) = 0.0_wp
          if (there(l)) call bond_factors_of(model, work%first + l - 1, merge(j, m, from(l)), &
            & length(l), gb(l), gd(l))
        end do
        work%stretch(:, i) = work%stretch(:, i)*gb
        work%dilatation(:, i) = weight*gd
      end if
      if (model%consistent) then
        ! weights stand in the order of each slot's bonds, broken ones included
        do l = 1, lanes
          if (iand(family%bits(e), lane_bit(l)) == 0_i1) cycle
          place(l) = place(l) + 1
          work%stretch(l, i) = work%stretch(l, i)*model%weights%Gb(place(l))
          work%dilatation(l, i) = work%dilatation(l, i)*model%weights%Gd(place(l))
        end do
      end if
      if (.not. model%surface) cycle
      x = x/length
      y = y/length
      z = z/length
      do f = given_D, given_S, given_S - given_D
        a = work%own(:, own_given + f) + merge(workspace%given(f, j), workspace%given(f, m), from)
        b = work%own(:, own_given + f + 1) &
          & + merge(workspace%given(f + 1, j), workspace%given(f + 1, m), from)
        c = work%own(:, own_given + f + 2) &
          & + merge(workspace%given(f + 2, j), workspace%given(f + 2, m), from)
        ! with a common denominator there is one division
        a = 0.5_wp*a*b*c/sqrt(merge((x*b*c)**2 + (y*a*c)**2 + (z*a*b)**2, 1.0_wp, there))
        if (f == given_D) work%dilatation(:, i) = work%dilatation(:, i)*a
        if (f == given_S) work%stretch(:, i) = work%stretch(:, i)*a
      end do
    end do
  end subroutine fill_tables

  !> theta of the lanes.
  pure subroutine cluster_theta(family, model, options, workspace, work, theta)
    type(list_family_type), intent(in) :: family     !! the family
    type(model_type), intent(in) :: model            !! parameters of the slots
    type(force_options_type), intent(in) :: options  !! what the dilatation takes in
    type(list_workspace_type), intent(in) :: workspace
      !! with displacements gathered
    type(work_type), intent(inout) :: work
      !! with tables; gets the greatest tension and compression of each lane
    real(wp), intent(out) :: theta(lanes)            !! sum of Gd s Lambda vc V of each lane [m3]
    real(wp), dimension(lanes) :: s, lambda, r, p
    real(wp) :: y(lanes, 3)
    integer :: i

    call begin(model, options, work)
    theta = 0.0_wp
    do i = 1, work%n
      call deform_cluster(family, model, options, workspace, work, i, s, lambda, r, y, p)
      theta = theta + work%dilatation(:, i)*s*lambda
    end do
  end subroutine cluster_theta

  !> Force density of the lanes (lanes, 3) [N/m3].
  pure subroutine cluster_force(family, model, options, workspace, work, force)
    type(list_family_type), intent(in) :: family     !! the family
    type(model_type), intent(in) :: model            !! parameters of the slots
    type(force_options_type), intent(in) :: options  !! what the forces take in
    type(list_workspace_type), intent(in) :: workspace
      !! with displacements, and p if there is one, gathered
    type(work_type), intent(inout) :: work
      !! with tables; gets the greatest tension and compression of each lane
    real(wp), intent(out) :: force(lanes, 3)
      !! force density; components that the body does not have are 0 [N/m3]
    real(wp), dimension(lanes) :: s, lambda, r, p
    real(wp) :: y(lanes, 3)
    integer :: i, c

    call begin(model, options, work)
    force = 0.0_wp
    do i = 1, work%n
      call deform_cluster(family, model, options, workspace, work, i, s, lambda, r, y, p)
      s = work%stretch(:, i)*s
      if (options%dilatation) &
        & s = s + (work%own(:, own_moved + at_p) + p)*work%dilatation(:, i) &
        & *work%geometry(:, i)*lambda
      do c = 1, 3
        force(:, c) = force(:, c) + s*r*y(:, c)
      end do
    end do
  end subroutine cluster_force

  !> Strain energy density of the lanes' stretches [J/m3], from tables with each lane's own q twice,
  !> and theta.
  pure subroutine cluster_energy(family, model, options, workspace, work, energy, theta)
    type(list_family_type), intent(in) :: family     !! the family
    type(model_type), intent(in) :: model            !! parameters of the slots
    type(force_options_type), intent(in) :: options  !! what the energy takes in
    type(list_workspace_type), intent(in) :: workspace
      !! with displacements gathered
    type(work_type), intent(inout) :: work
      !! with tables of each lane's own q; gets the greatest tension and compression
    real(wp), intent(out) :: energy(lanes)           !! of the stretches alone [J/m3]
    real(wp), intent(out) :: theta(lanes)
      !! sum of Gd s Lambda vc V of each lane, 0 without a dilatation [m3]
    real(wp), dimension(lanes) :: s, lambda, r, p
    real(wp) :: y(lanes, 3)
    integer :: i

    call begin(model, options, work)
    energy = 0.0_wp
    theta = 0.0_wp
    do i = 1, work%n
      call deform_cluster(family, model, options, workspace, work, i, s, lambda, r, y, p)
      energy = energy + 0.25_wp*work%stretch(:, i)*s**2/work%geometry(:, i)
      if (options%dilatation) theta = theta + work%dilatation(:, i)*s*lambda
    end do
  end subroutine cluster_energy

  pure subroutine begin(model, options, work)
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(work_type), intent(inout) :: work

    work%tension = 0.0_wp
    work%compression = 0.0_wp
    if (options%thermal) work%heat = model%expansion(work%first:work%first + lanes - 1)/2
  end subroutine begin

  !> State of a cluster's bonds in its `i`-th pack: mechanical stretch, Lambda, r = |xi|/|y|, the
  !> deformed bond y [m] and p of the other end.
  pure subroutine deform_cluster(family, model, options, workspace, work, i, s, lambda, r, y, p)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(list_workspace_type), intent(in) :: workspace
    type(work_type), intent(inout) :: work
    integer, intent(in) :: i
    real(wp), intent(out) :: s(lanes), lambda(lanes), r(lanes), y(lanes, 3), p(lanes)
    real(wp) :: xi(lanes, 3), eta(lanes, 3), x, e, length, printed, plain
    real(wp) :: heat(lanes)
    logical :: from(lanes)
    integer(i8) :: pack
    integer :: l, c, j, m

    pack = family%start(work%cluster) + i - 1
    j = family%member(1, pack)
    m = family%member(2, pack)
    from = iand(family%first(pack), lane_bit) /= 0_i1
    do c = 1, 3
      xi(:, c) = merge(workspace%place(c, j), workspace%place(c, m), from) - work%own(:, c)
      eta(:, c) = merge(workspace%moved(c, j), workspace%moved(c, m), from) &
        & - work%own(:, own_moved + c)
    end do
    p = merge(workspace%moved(at_p, j), workspace%moved(at_p, m), from)
    heat = 0.0_wp
    if (options%thermal) heat = work%heat &
      & + merge(model%expansion(j), model%expansion(m), from)/2
    printed = merge(1.0_wp, 0.0_wp, options%projected)
    plain = 1 - printed
    !$omp simd private(x, e, length)
    do l = 1, lanes
      y(l, 1) = xi(l, 1) + eta(l, 1)
      y(l, 2) = xi(l, 2) + eta(l, 2)
      y(l, 3) = xi(l, 3) + eta(l, 3)
      x = work%geometry(l, i)*(xi(l, 1)*eta(l, 1) + xi(l, 2)*eta(l, 2) + xi(l, 3)*eta(l, 3))
      e = 2*x + work%geometry(l, i)*(eta(l, 1)**2 + eta(l, 2)**2 + eta(l, 3)**2)
      length = sqrt(work%geometry(l, i)*(y(l, 1)**2 + y(l, 2)**2 + y(l, 3)**2))
      s(l) = e/(1 + length) - heat(l)
      r(l) = merge(1/max(length, least), 0.0_wp, length > least)
      lambda(l) = plain + printed*(1 + x)*r(l)
      x = merge(s(l), 0.0_wp, work%stretch(l, i) > 0.0_wp)
      work%tension(l) = max(work%tension(l), x)
      work%compression(l) = max(work%compression(l), -x)
    end do
  end subroutine deform_cluster

end module pd_force_list_general
