!> The passes over the bonds of list families, cluster by cluster. Each takes the loop that just
!> does: for points that are alike or with stored weights, for small strain or larger one; what no
!> loop is valid for (strains beyond 5 % or near breaking, temperature) is done by general formulas.
module pd_force_list
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_lanes, only: lanes
  use pd_base_shares, only: shares_type
  use pd_family_clusters, only: lane_bit
  use pd_family_list, only: list_family_type
  use pd_force_general, only: mark_slot
  use pd_force_list_fast, only: choose_loop
  use pd_force_list_general, only: work_type, fill_tables, cluster_theta, cluster_force, &
    & cluster_energy, take_given, take_place, take_up
  use pd_force_list_loop, only: all_tables, for_energy, for_force, for_theta, no_tables, &
    & pass_loop, task_type, weights_alone
  use pd_force_list_points, only: new_task, plain_task, survey
  use pd_force_list_tables, only: make_tables
  use pd_force_model, only: early, force_options_type, model_type, options_of, p_of, t_of
  use pd_force_polynomial, only: fast_limit, narrow, wide
  use pd_force_workspace, only: all_blocks, at_p, at_volume, early_blocks, late_blocks, &
    & list_workspace_type
  implicit none (type, external)
  private
  public :: prepare_list, list_dilatation, list_force, list_energy

  !> How far a cluster is strained (`large` of the workspace): within the narrow polynomial, within
  !> the wide one, beyond. Where bonds have a fixed order, `large` has the bits of lanes beyond
  !> instead.
  integer(i1), parameter :: little = 0_i1, more = 1_i1, beyond = 2_i1

  !> Clusters that a thread takes at once.
  integer, parameter :: at_once = 32

  !> The loops of a pass, and the strains for which they are valid.
  type :: loops_type
    procedure(pass_loop), pointer, nopass :: plain => null()   !! for clusters without tables,
    procedure(pass_loop), pointer, nopass :: stored => null()  !! with weights,
    procedure(pass_loop), pointer, nopass :: shaped => null()  !! with weights and geometry
    type(task_type) :: task                                    !! what is the same for all
    real(wp) :: narrow = 0.0_wp, wide = 0.0_wp                 !! limits of |e|, 0: none
  end type loops_type

contains

  !> Make what the loops keep of the model: which clusters have points alike, and tables. The first
  !> pass does it if nobody has; afterwards the model must not change.
  subroutine prepare_list(family, model, workspace)
    type(list_family_type), intent(in) :: family  !! the family
    type(model_type), intent(in) :: model         !! parameters of the slots
    type(list_workspace_type), intent(inout) :: workspace
      !! ready for passes, without a state; unchanged if it is
    integer :: k

    if (allocated(workspace%given)) then
      if (size(workspace%place, 2) /= family%n_slots) &
        & call internal_fault('a workspace of another family')
      return
    end if
    allocate (workspace%place(at_volume, family%n_slots), workspace%moved(at_p, family%n_slots), &
      & source=0.0_wp)
    do k = 1, family%n_slots
      workspace%place(:family%dim, k) = family%x(:, k)
      workspace%place(at_volume, k) = family%volume(k)
    end do
    allocate (workspace%large(size(family%start) - 1), source=little)
    call survey(family, model, workspace)
    call make_tables(family, model, workspace)
  end subroutine prepare_list

  !> p_k = 2 a d delta theta_k of all slots. If bonds can break, `strained` gets 1 for slots with an
  !> intact bond beyond its limit.
  subroutine list_dilatation(family, model, options, workspace, u, p, strained, blocks)
    type(list_family_type), intent(in) :: family     !! the family
    type(model_type), intent(in) :: model            !! parameters of the slots
    type(force_options_type), intent(in) :: options  !! what the forces take in
    type(list_workspace_type), intent(inout) :: workspace
      !! of this model; gets the displacements and how far clusters are strained
    real(wp), intent(in), contiguous :: u(:, :)      !! (n_slots, dim) displacements [m]
    real(wp), intent(inout), contiguous :: p(:)
      !! (n_slots) 2 a d delta theta, set for all slots [N/m5]
    integer(i1), intent(inout), contiguous :: strained(:)
      !! (n_slots) 1 for slots with a bond nearly at its limit, of size 0 if none can break
    integer, intent(in), optional :: blocks
      !! `early_blocks`, then, in a call of its own, `late_blocks`; `all_blocks` if absent
    type(loops_type) :: loops
    type(work_type) :: work
    type(shares_type) :: shares
    real(wp) :: sums(lanes, 3)
    integer(i1) :: strain
    integer :: c, i, k, l, first, last

    call prepare_list(family, model, workspace)
    call new_loops(family, model, options, for_theta, loops)
    call share_clusters(family, blocks, shares)
    call gather_state(family, blocks, u, workspace)
    !$omp parallel default(none) private(work, sums, strain, c, i, k, l, first, last) &
    !$omp shared(family, model, options, workspace, p, strained, loops, shares)
    do
      call shares%take(first, last)
      if (first > last) exit
      do i = first, last
        c = cluster_of_turn(family, i)
        strain = little
        call sum_cluster(family, model, options, workspace, loops, for_theta, c, work, strain, &
          & sums, strained)
        workspace%large(c) = strain
        do l = 1, lanes
          k = work%first + l - 1
          p(k) = p_of(model, k)*t_of(model, k)*sums(l, 1)
        end do
      end do
    end do
    !$omp end parallel
  end subroutine list_dilatation

  !> Force density of all slots (n_slots, dim) [N/m3]. With a dilatation this follows
  !> `list_dilatation` at the same displacements.
  subroutine list_force(family, model, options, workspace, u, p, force, strained, blocks)
    type(list_family_type), intent(in) :: family        !! the family
    type(model_type), intent(in) :: model               !! parameters of the slots
    type(force_options_type), intent(in) :: options
      !! what the forces take in, as for `list_dilatation`
    type(list_workspace_type), intent(inout) :: workspace
      !! of this model; gets the displacements or `p`
    real(wp), intent(in), contiguous :: u(:, :)         !! (n_slots, dim) displacements [m]
    real(wp), intent(in), contiguous :: p(:)
      !! (n_slots) 2 a d delta theta, of size 0 without a dilatation [N/m5]
    real(wp), intent(inout), contiguous :: force(:, :)  !! (n_slots, dim) set for all slots [N/m3]
    integer(i1), intent(inout), contiguous :: strained(:)
      !! (n_slots) 1 for slots with a bond nearly at its limit, of size 0 if none can break
    integer, intent(in), optional :: blocks
      !! `early_blocks`, then, in a call of its own, `late_blocks`; `all_blocks` if absent
    type(loops_type) :: loops
    type(work_type) :: work
    type(shares_type) :: shares
    real(wp) :: sums(lanes, 3)
    integer(i1) :: strain
    integer :: c, d, i, first, last

    call prepare_list(family, model, workspace)
    call new_loops(family, model, options, for_force, loops)
    call share_clusters(family, blocks, shares)
    ! with a dilatation, the pass before has gathered the displacements
    if (options%dilatation) then
      call gather_p(family, blocks, p, workspace)
    else
      call gather_state(family, blocks, u, workspace)
    end if
    !$omp parallel default(none) private(work, sums, strain, c, d, i, first, last) &
    !$omp shared(family, model, options, workspace, force, strained, loops, shares)
    do
      call shares%take(first, last)
      if (first > last) exit
      do i = first, last
        c = cluster_of_turn(family, i)
        ! the pass before has checked the strain
        strain = merge(workspace%large(c), little, options%dilatation)
        call sum_cluster(family, model, options, workspace, loops, for_force, c, work, strain, &
          & sums, strained)
        do d = 1, model%dim
          force(work%first:work%first + lanes - 1, d) = sums(:, d)
        end do
      end do
    end do
    !$omp end parallel
  end subroutine list_force

  !> Strain energy density of all slots [J/m3]. With `theta` that of the stretches alone, and the
  !> dilatation beside it.
  subroutine list_energy(family, model, workspace, u, energy, theta)
    type(list_family_type), intent(in) :: family      !! the family
    type(model_type), intent(in) :: model             !! parameters of the slots
    type(list_workspace_type), intent(inout) :: workspace  !! of this model; gets the displacements
    real(wp), intent(in), contiguous :: u(:, :)       !! (n_slots, dim) displacements [m]
    real(wp), intent(inout), contiguous :: energy(:)  !! (n_slots) set for all slots [J/m3]
    real(wp), intent(inout), optional :: theta(:)     !! (n_slots) set for all slots [-]
    type(force_options_type) :: options
    type(loops_type) :: loops
    type(work_type) :: work
    real(wp) :: sums(lanes, 3)
    logical :: missed
    integer :: c, k, l

    call prepare_list(family, model, workspace)
    options = options_of(model)
    call new_loops(family, model, options, for_energy, loops)
    call gather_state(family, all_blocks, u, workspace)
    !$omp parallel do schedule(dynamic, 32) default(none) &
    !$omp shared(family, model, options, workspace, energy, theta, loops) &
    !$omp private(work, sums, missed, c, k, l)
    do c = 1, size(workspace%large)
      call take_up(family, workspace, c, work)
      call take_place(workspace, work)
      call take_given(workspace, work)
      if (options%thermal .or. model%weighted .or. model%consistent .or. family%fixed_order) then
        associate (e => family%start(c), n => work%n)
          call fill_tables(family, model, workspace, family%intact(e:e + n - 1), &
            & .true., work)
        end associate
        call cluster_energy(family, model, options, workspace, work, sums(:, 1), sums(:, 2))
      else
        call run_loop(family, workspace, work, loops%stored, loops%task, sums, missed)
      end if
      do l = 1, lanes
        k = work%first + l - 1
        associate (m => model%materials(model%material(k)))
          energy(k) = sums(l, 1)
          if (present(theta)) then
            theta(k) = 0.0_wp
            if (options%dilatation) theta(k) = t_of(model, k)*sums(l, 2)
          else if (options%dilatation) then
            energy(k) = energy(k) + m%a*(t_of(model, k)*sums(l, 2))**2
          end if
        end associate
      end do
    end do
  end subroutine list_energy

  ! ---------------------------------------------------------------- one cluster

  !> The loops of a pass.
  subroutine new_loops(family, model, options, pass, loops)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    integer, intent(in) :: pass
    type(loops_type), intent(out) :: loops

    call choose_loop(family%dim, pass, no_tables, options%dilatation, options%projected, &
      & loops%plain)
    call choose_loop(family%dim, pass, weights_alone, options%dilatation, options%projected, &
      & loops%stored)
    call choose_loop(family%dim, pass, all_tables, options%dilatation, options%projected, &
      & loops%shaped)
    call new_task(family, model, loops%task)
    loops%narrow = fast_limit(model, options, narrow)
    loops%wide = fast_limit(model, options, wide)
    ! where bonds break early, it is valid no further than the narrow one
    if (loops%wide <= loops%narrow) loops%wide = 0.0_wp
  end subroutine new_loops

  !> Take up cluster `c`. Its sums by whatever is valid for its strain, which is at least `strain`;
  !> on return `strain` says how far it is strained. Slots beyond the loops are marked, if bonds can
  !> break.
  subroutine sum_cluster(family, model, options, workspace, loops, pass, c, work, strain, sums, &
    & strained)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(list_workspace_type), intent(in) :: workspace
    type(loops_type), intent(in) :: loops
    integer, intent(in) :: pass                !! `for_theta` or `for_force`
    integer, intent(in) :: c
    type(work_type), intent(inout) :: work
    integer(i1), intent(inout) :: strain
    real(wp), intent(inout) :: sums(lanes, 3)
    integer(i1), intent(inout), contiguous :: strained(:)
    logical :: general

    call take_up(family, workspace, c, work)
    if (model%breaking) strained(work%first:work%first + lanes - 1) = 0_i1
    if (family%fixed_order) then
      call sum_lanes(family, model, options, workspace, loops, pass, work, strain, sums)
      general = strain /= little
    else
      call sum_up(family, model, options, workspace, loops, work, strain, sums)
      general = strain == beyond
      if (general) call sum_generally(family, model, options, workspace, pass, work, sums)
    end if
    if (general .and. model%breaking) call mark_cluster(model, work, strained)
  end subroutine sum_cluster

  !> Sums of a cluster by the general formulas.
  subroutine sum_generally(family, model, options, workspace, pass, work, sums)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(list_workspace_type), intent(in) :: workspace
    integer, intent(in) :: pass                !! `for_theta` or `for_force`
    type(work_type), intent(inout) :: work
    real(wp), intent(inout) :: sums(lanes, 3)

    associate (e => family%start(work%cluster))
      call fill_tables(family, model, workspace, family%intact(e:e + work%n - 1), .false., work)
    end associate
    if (pass == for_theta) then
      call cluster_theta(family, model, options, workspace, work, sums(:, 1))
    else
      call cluster_force(family, model, options, workspace, work, sums)
    end if
  end subroutine sum_generally

  !> Sums of a cluster by the loops valid for its strain, which is at least `strain`; on return
  !> `strain` says which did, or that none does.
  subroutine sum_up(family, model, options, workspace, loops, work, strain, sums)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(list_workspace_type), intent(in) :: workspace
    type(loops_type), intent(in) :: loops
    type(work_type), intent(inout) :: work
    integer(i1), intent(inout) :: strain
    real(wp), intent(inout) :: sums(lanes, 3)
    type(task_type) :: task
    logical :: missed

    task = loops%task
    if (workspace%stored(work%cluster) == 0_i8) &
      & call plain_task(family, model, options, workspace, work%cluster, task)
    if (strain == little .and. loops%narrow > 0.0_wp) then
      task%limit = loops%narrow
      call run_either(family, workspace, work, loops, task, sums, missed)
      if (.not. missed) return
    end if
    if (strain < beyond .and. loops%wide > 0.0_wp) then
      task%limit = loops%wide
      task%wide = .true.
      call run_either(family, workspace, work, loops, task, sums, missed)
      strain = more
      if (.not. missed) return
    end if
    strain = beyond
  end subroutine sum_up

  !> The same where sums must not depend on which points share a cluster: each lane has the
  !> polynomial of the widest range, or, if its own bonds are beyond, the general formulas. `strain`
  !> has the bits of lanes that are known to be beyond, and of all that are on return.
  subroutine sum_lanes(family, model, options, workspace, loops, pass, work, strain, sums)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    type(force_options_type), intent(in) :: options
    type(list_workspace_type), intent(in) :: workspace
    type(loops_type), intent(in) :: loops
    integer, intent(in) :: pass                !! `for_theta` or `for_force`
    type(work_type), intent(inout) :: work
    integer(i1), intent(inout) :: strain
    real(wp), intent(inout) :: sums(lanes, 3)
    type(task_type) :: task
    real(wp) :: of_lanes(lanes, 3)
    logical :: missed, general(lanes)
    integer :: l

    task = loops%task
    task%wide = loops%wide > 0.0_wp
    task%limit = max(loops%narrow, loops%wide)
    general = .true.
    if (task%limit > 0.0_wp) then
      call take_place(workspace, work)
      call run_loop(family, workspace, work, loops%stored, task, sums, missed)
      general = iand(strain, lane_bit) /= 0_i1
      do l = 1, lanes
        if (.not. missed) exit
        call run_loop(family, workspace, work, loops%stored, task, of_lanes, general(l), &
          & lane_bit(l))
      end do
    end if
    strain = iany(merge(lane_bit, 0_i1, general))
    if (strain == 0_i1) return
    of_lanes = 0.0_wp
    call sum_generally(family, model, options, workspace, pass, work, of_lanes)
    do l = 1, lanes
      if (general(l)) sums(l, :) = of_lanes(l, :)
    end do
  end subroutine sum_lanes

  !> The loop for the tables that the cluster has. That for shapes takes all of their bonds.
  subroutine run_either(family, workspace, work, loops, task, sums, missed)
    type(list_family_type), intent(in) :: family
    type(list_workspace_type), intent(in) :: workspace
    type(work_type), intent(inout) :: work
    type(loops_type), intent(in) :: loops
    type(task_type), intent(in) :: task
    real(wp), intent(inout) :: sums(lanes, 3)
    logical, intent(out) :: missed

    if (workspace%shape(work%cluster) > 0_i8 .and. is_whole(family, work)) then
      call run_loop(family, workspace, work, loops%shaped, task, sums, missed)
      return
    end if
    call take_place(workspace, work)
    if (workspace%stored(work%cluster) == 0_i8) then
      call run_loop(family, workspace, work, loops%plain, task, sums, missed)
    else
      call run_loop(family, workspace, work, loops%stored, task, sums, missed)
    end if
  end subroutine run_either

  !> Whether all bonds of a cluster are intact.
  pure logical function is_whole(family, work)
    type(list_family_type), intent(in) :: family
    type(work_type), intent(in) :: work

    associate (first => family%start(work%cluster), last => family%start(work%cluster + 1) - 1)
      ! all of them, without an exit, is done in vector registers
      is_whole = iany(ieor(family%intact(first:last), family%bits(first:last))) == 0_i1
    end associate
  end function is_whole

  !> One loop over the packs of a cluster, or over the bonds of some of its lanes.
  subroutine run_loop(family, workspace, work, loop, task, sums, missed, some)
    type(list_family_type), intent(in) :: family
    type(list_workspace_type), intent(in) :: workspace
    type(work_type), intent(in) :: work
    procedure(pass_loop), pointer, intent(in) :: loop
    type(task_type), intent(in) :: task
    real(wp), intent(inout) :: sums(lanes, 3)
    logical, intent(out) :: missed
    integer(i1), intent(in), optional :: some  !! bits of these lanes; absent: all
    integer(i8) :: e, last, b, f, d, s

    ! tables that are not there have no second element; loops that need them are not called then
    e = family%start(work%cluster)
    last = e + work%n - 1
    b = max(1_i8, workspace%stored(work%cluster))
    s = max(1_i8, workspace%shape(work%cluster))
    f = merge(e, 1_i8, size(family%fraction) > 0)
    d = merge(b, 1_i8, size(workspace%weight_D) > 0)
    if (present(some)) then
      call loop(work%n, family%member(:, e:last), family%first(e:last), &
        & iand(family%intact(e:last), some), workspace%place, workspace%moved, workspace%given, &
        & family%fraction(:, f:), workspace%geometry(:, s:), workspace%weight_D(:, d:), &
        & workspace%weight_S(:, b:), work%own, task, sums, missed)
      return
    end if
    call loop(work%n, family%member(:, e:last), family%first(e:last), family%intact(e:last), &
      & workspace%place, workspace%moved, workspace%given, family%fraction(:, f:), &
      & workspace%geometry(:, s:), workspace%weight_D(:, d:), workspace%weight_S(:, b:), work%own, &
      & task, sums, missed)
  end subroutine run_loop

  !> Copy displacements, point by point: what a bond needs of its other end then stands in one
  !> place. Before late clusters those of copies have come, which alone are new.
  subroutine gather_state(family, blocks, u, workspace)
    type(list_family_type), intent(in) :: family
    integer, intent(in), optional :: blocks
    real(wp), intent(in), contiguous :: u(:, :)
    type(list_workspace_type), intent(inout) :: workspace
    integer :: k, d

    if (are_late(blocks)) then
      do d = 1, size(u, 2)
        workspace%moved(d, family%copies) = u(family%copies, d)
      end do
      return
    end if
    select case (size(u, 2))
    case (3)
      !$omp parallel do schedule(static) default(none) shared(u, workspace) private(k)
      do k = 1, size(u, 1)
        workspace%moved(:3, k) = u(k, :3)
      end do
    case (2)
      !$omp parallel do schedule(static) default(none) shared(u, workspace) private(k)
      do k = 1, size(u, 1)
        workspace%moved(:2, k) = u(k, :2)
      end do
    case default
      workspace%moved(1, :) = u(:, 1)
    end select
  end subroutine gather_state

  !> Copy the dilatation coefficients beside them.
  subroutine gather_p(family, blocks, p, workspace)
    type(list_family_type), intent(in) :: family
    integer, intent(in), optional :: blocks
    real(wp), intent(in), contiguous :: p(:)
    type(list_workspace_type), intent(inout) :: workspace
    integer :: k

    if (are_late(blocks)) then
      workspace%moved(at_p, family%copies) = p(family%copies)
      return
    end if
    !$omp parallel do schedule(static) default(none) shared(p, workspace) private(k)
    do k = 1, size(p)
      workspace%moved(at_p, k) = p(k)
    end do
  end subroutine gather_p

  ! ---------------------------------------------------------------- which clusters

  !> Share out the turns of the clusters that a pass takes.
  subroutine share_clusters(family, blocks, shares)
    type(list_family_type), intent(in) :: family
    integer, intent(in), optional :: blocks
    type(shares_type), intent(inout) :: shares
    integer :: which, first, last

    which = all_blocks
    if (present(blocks)) which = blocks
    first = 1
    last = size(family%start) - 1
    if (which /= all_blocks .and. .not. allocated(family%turn)) &
      & call internal_fault('early clusters where none are late')
    select case (which)
    case (all_blocks)
      continue
    case (early_blocks)
      last = family%n_early
    case (late_blocks)
      first = family%n_early + 1
    case default
      call internal_fault('a pass over unknown clusters')
    end select
    call shares%begin(first, last, at_once)
  end subroutine share_clusters

  !> The cluster of a turn. Its sums are its own alone, and so do not depend on the turn.
  pure integer function cluster_of_turn(family, i) result(c)
    type(list_family_type), intent(in) :: family
    integer, intent(in) :: i

    c = i
    if (allocated(family%turn)) c = int(family%turn(i))
  end function cluster_of_turn

  !> Whether a pass takes what was left by one before it.
  pure logical function are_late(blocks)
    integer, intent(in), optional :: blocks

    are_late = .false.
    if (present(blocks)) are_late = blocks == late_blocks
  end function are_late

  ! ---------------------------------------------------------------- breaking

  !> Mark the lanes with an intact bond near the smallest critical stretch of all (`early`).
  pure subroutine mark_cluster(model, work, strained)
    type(model_type), intent(in) :: model
    type(work_type), intent(in) :: work
    integer(i1), intent(inout), contiguous :: strained(:)
    real(wp) :: limit
    integer(i8) :: k
    integer :: l

    limit = model%least_critical*early
    do l = 1, lanes
      k = work%first + l - 1
      if (work%tension(l) > limit) call mark_slot(model, k, work%tension(l), strained)
      if (work%compression(l) > limit) call mark_slot(model, k, -work%compression(l), strained)
    end do
  end subroutine mark_cluster

end module pd_force_list
