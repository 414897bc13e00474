!> What the loops of list families keep of the model: q, spacing and surface factors of each slot
!> beside each other, and for which clusters all of that is alike, so that their loops need none of
!> it.
module pd_force_list_points
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_lanes, only: lanes
  use pd_family_clusters, only: lane_bit
  use pd_family_list, only: list_family_type
  use pd_family_volume, only: volume_none, volume_linear, volume_linear_extended, volume_exact
  use pd_force_list_loop, only: task_type, no_correction, one_spacing, own_spacing, &
    & stored_fraction
  use pd_force_model, only: force_options_type, model_type, q_of
  use pd_force_workspace, only: list_workspace_type
  implicit none (type, external)
  private
  public :: survey, new_task, plain_task
  public :: given_q, given_half, given_D, given_S

  !> Where things stand in `given`: q, half the spacing, surface factors of dilatation and of
  !> stretches.
  integer, parameter :: given_q = 1, given_half = 2, given_D = 3, given_S = 6

  !> Surface factors that differ less are those of one surrounding, off by the order of its sums.
  real(wp), parameter :: alike = 64*epsilon(1.0_wp)

contains

  !> Put what the model gives into the workspace, and find the clusters whose points are alike.
  subroutine survey(family, model, workspace)
    type(list_family_type), intent(in) :: family  !! the family
    type(model_type), intent(in) :: model         !! parameters of the slots
    type(list_workspace_type), intent(inout) :: workspace  !! gets `given` and `plain`
    integer :: k, c, d

    ! without a factor the sum of both ends is 1, in directions that the body does not have, too
    allocate (workspace%given(8, family%n_slots), source=0.5_wp)
    allocate (workspace%plain(size(family%start) - 1), source=0_i1)
    !$omp parallel default(none) shared(family, model, workspace) private(k, c, d)
    !$omp do schedule(static)
    do k = 1, family%n_slots
      workspace%given(given_q, k) = q_of(model, k)
      workspace%given(given_half, k) = family%spacing(k)/2
      if (.not. model%surface) cycle
      do d = 1, family%dim
        workspace%given(given_D + d - 1, k) = model%D(k, d)
        workspace%given(given_S + d - 1, k) = model%S(k, d)
      end do
    end do
    !$omp do schedule(dynamic, 32)
    do c = 1, size(workspace%plain)
      ! loops of plain clusters know no factors of a law, and no weights of bonds
      if (model%weighted .or. model%consistent) cycle
      if (is_plain(family, workspace%given, model%surface, c)) workspace%plain(c) = 1_i1
    end do
    !$omp end parallel
  end subroutine survey

  !> Whether all points of cluster `c` and its members have one q, one spacing and one surface
  !> factor, the same along every direction.
  pure logical function is_plain(family, given, surface, c)
    type(list_family_type), intent(in) :: family
    real(wp), intent(in) :: given(:, :)
    logical, intent(in) :: surface
    integer, intent(in) :: c
    real(wp) :: low(8), high(8)
    integer(i8) :: e
    integer :: l, m, j

    is_plain = .false.
    if (family%rule%kind == volume_exact) return
    low = huge(1.0_wp)
    high = -huge(1.0_wp)
    do e = family%start(c), family%start(c + 1) - 1
      do m = 1, 2
        j = family%member(m, e)
        low = min(low, given(:, j))
        high = max(high, given(:, j))
      end do
      do l = 1, lanes
        if (iand(family%bits(e), lane_bit(l)) == 0_i1) cycle
        j = lanes*(c - 1) + l
        low = min(low, given(:, j))
        high = max(high, given(:, j))
      end do
    end do
    is_plain = all(high(:given_half) <= low(:given_half))
    if (.not. (surface .and. is_plain)) return
    associate (d => given_D + family%dim - 1, s => given_S + family%dim - 1)
      is_plain = maxval(high(given_D:d)) - minval(low(given_D:d)) <= alike*minval(low(given_D:d)) &
        & .and. maxval(high(given_S:s)) - minval(low(given_S:s)) <= alike*minval(low(given_S:s))
    end associate
  end function is_plain

  !> What the loops for energies must know, and what is the same for all clusters.
  subroutine new_task(family, model, task)
    type(list_family_type), intent(in) :: family  !! with its volume rule
    type(model_type), intent(in) :: model         !! whether there are surface factors
    type(task_type), intent(out) :: task          !! without a limit of strain

    task%surface = model%surface
    select case (family%rule%kind)
    case (volume_none)
      task%volume = no_correction
    case (volume_linear, volume_linear_extended)
      task%volume = own_spacing
      task%edge = family%rule%delta
      if (family%one_spacing) call set_spacing(family, family%spacing(1), task)
    case (volume_exact)
      task%volume = stored_fraction
    case default
      ! a rule that the loops do not know must not give a result
      task%volume = one_spacing
      task%slope = ieee_value(1.0_wp, ieee_quiet_nan)
    end select
  end subroutine new_task

  !> vc for one spacing [m].
  pure subroutine set_spacing(family, spacing, task)
    type(list_family_type), intent(in) :: family
    real(wp), intent(in) :: spacing
    type(task_type), intent(inout) :: task

    task%volume = one_spacing
    task%slope = 1/spacing
    task%edge = family%rule%delta + spacing/2
    ! so far away that vc is 1 everywhere
    if (family%rule%kind == volume_none) task%edge = 3*task%edge
  end subroutine set_spacing

  !> What the loops of plain cluster `c` multiply with.
  pure subroutine plain_task(family, model, options, workspace, c, task)
    type(list_family_type), intent(in) :: family     !! with its volume rule
    type(model_type), intent(in) :: model            !! whether there are surface factors
    type(force_options_type), intent(in) :: options  !! whether the forces have a dilatation
    type(list_workspace_type), intent(in) :: workspace  !! surveyed
    integer, intent(in) :: c                         !! cluster whose points are alike
    type(task_type), intent(inout) :: task
      !! gets the volume correction and the factors of this cluster
    real(wp) :: Gb

    associate (given => workspace%given(:, lanes*(c - 1) + 1))
      call set_spacing(family, 2*given(given_half), task)
      Gb = 1.0_wp
      task%factor = 1.0_wp
      if (model%surface) then
        Gb = given(given_S)
        task%factor = given(given_D)
      end if
      task%q = 2*given(given_q)*Gb/task%factor
      if (.not. options%dilatation) task%factor = 2*given(given_q)*Gb
    end associate
  end subroutine plain_task

end module pd_force_list_points
