!> The general formulas of list families, for the bonds of one cluster: any strain, temperature,
!> either dilatation. They take weights from tables and always three components, those that a body
!> does not have being zero.
module pd_force_list_general
  use pd_base_kinds, only: wp, i4
  use pd_family_list, only: at_moved, at_p
  use pd_family_offsets, only: lanes
  use pd_force_general, only: crushed
  use pd_force_list_fast, only: theta_loop, force_loop
  use pd_force_model, only: model_type
  implicit none (type, external)
  private
  public :: work_type, general_theta, general_force, general_energy

  !> What one cluster is worked with: one for each thread.
  type :: work_type
    integer :: cluster = 0
    integer :: first = 1                       !! its first slot
    integer :: n = 0                           !! its members
    logical :: tabled = .false.                !! its weights are in the tables
    procedure(theta_loop), pointer, nopass :: theta => null()  !! the fast loops for them
    procedure(force_loop), pointer, nopass :: force => null()
    real(wp) :: own(lanes, at_p) = 0.0_wp      !! what `at` has of its own slots
    real(wp), allocatable :: stretch(:, :)     !! (q_k + q_j) Gb vc V_j/|xi|, 0 where there is no
                                               !! intact bond (lane, member)
    real(wp), allocatable :: dilatation(:, :)  !! Gd vc V_j
    real(wp), allocatable :: geometry(:, :)    !! 1/|xi|^2
    real(wp) :: edge = 0.0_wp                  !! where vc reaches zero [m]
    real(wp) :: per_spacing = 0.0_wp           !! slope of vc [1/m]
    real(wp) :: q = 0.0_wp                     !! q_k + q_j
    real(wp) :: heat(lanes) = 0.0_wp           !! alpha dT of the lanes, halved
    real(wp) :: tension(lanes) = 0.0_wp        !! greatest stretch of each lane's intact bonds
    real(wp) :: compression(lanes) = 0.0_wp    !! and of its negative
  end type work_type

  !> Deformed length over the undeformed one below which a bond has no direction: it pulls nowhere.
  real(wp), parameter :: least = sqrt(crushed)

contains

  !> theta of the lanes.
  pure subroutine general_theta(model, work, member, at, theta)
    type(model_type), intent(in) :: model
    type(work_type), intent(inout) :: work
    integer(i4), intent(in) :: member(:)
    real(wp), intent(in), contiguous :: at(:, :)
    real(wp), intent(out) :: theta(lanes)
    real(wp), dimension(lanes) :: s, lambda, r
    real(wp) :: y(lanes, 3)
    integer :: i

    call begin(model, work)
    theta = 0.0_wp
    do i = 1, size(member)
      call deform(model, work, i, int(member(i)), at, s, lambda, r, y)
      theta = theta + work%dilatation(:, i)*s*lambda
    end do
  end subroutine general_theta

  !> Force density of the lanes (lanes, 3) [N/m3].
  pure subroutine general_force(model, work, member, at, force)
    type(model_type), intent(in) :: model
    type(work_type), intent(inout) :: work
    integer(i4), intent(in) :: member(:)
    real(wp), intent(in), contiguous :: at(:, :)
    real(wp), intent(out) :: force(lanes, 3)
    real(wp), dimension(lanes) :: s, lambda, r
    real(wp) :: y(lanes, 3), p
    integer :: i, c, l

    call begin(model, work)
    force = 0.0_wp
    do i = 1, size(member)
      call deform(model, work, i, int(member(i)), at, s, lambda, r, y)
      s = work%stretch(:, i)*s
      if (model%dilatation) then
        p = at(at_p, member(i))
        do l = 1, lanes
          s(l) = s(l) + (work%own(l, at_p) + p)*work%dilatation(l, i)*work%geometry(l, i)*lambda(l)
        end do
      end if
      do c = 1, 3
        do l = 1, lanes
          force(l, c) = force(l, c) + s(l)*r(l)*y(l, c)
        end do
      end do
    end do
  end subroutine general_force

  !> Strain energy density of the lanes' stretches [J/m3], from tables with each lane's own q twice,
  !> and theta.
  pure subroutine general_energy(model, work, member, at, energy, theta)
    type(model_type), intent(in) :: model
    type(work_type), intent(inout) :: work
    integer(i4), intent(in) :: member(:)
    real(wp), intent(in), contiguous :: at(:, :)
    real(wp), intent(out) :: energy(lanes), theta(lanes)
    real(wp), dimension(lanes) :: s, lambda, r
    real(wp) :: y(lanes, 3)
    integer :: i

    call begin(model, work)
    energy = 0.0_wp
    theta = 0.0_wp
    do i = 1, size(member)
      call deform(model, work, i, int(member(i)), at, s, lambda, r, y)
      energy = energy + 0.25_wp*work%stretch(:, i)*s**2/work%geometry(:, i)
      if (model%dilatation) theta = theta + work%dilatation(:, i)*s*lambda
    end do
  end subroutine general_energy

  pure subroutine begin(model, work)
    type(model_type), intent(in) :: model
    type(work_type), intent(inout) :: work

    work%tension = 0.0_wp
    work%compression = 0.0_wp
    if (model%thermal) work%heat = model%expansion(work%first:work%first + lanes - 1)/2
  end subroutine begin

  !> State of a cluster's bonds to its `i`-th member in slot `j`: mechanical stretch, Lambda,
  !> r = |xi|/|y| and the deformed bond y [m].
  pure subroutine deform(model, work, i, j, at, s, lambda, r, y)
    type(model_type), intent(in) :: model
    type(work_type), intent(inout) :: work
    integer, intent(in) :: i, j
    real(wp), intent(in), contiguous :: at(:, :)
    real(wp), intent(out) :: s(lanes), lambda(lanes), r(lanes), y(lanes, 3)
    real(wp) :: there(at_p), x1, x2, x3, e1, e2, e3, x, e, length, heat, printed, plain
    integer :: l

    there = at(:, j)
    heat = 0.0_wp
    if (model%thermal) heat = model%expansion(j)/2
    printed = merge(1.0_wp, 0.0_wp, model%projected)
    plain = 1 - printed
    !$omp simd private(x1, x2, x3, e1, e2, e3, x, e, length)
    do l = 1, lanes
      x1 = there(1) - work%own(l, 1)
      x2 = there(2) - work%own(l, 2)
      x3 = there(3) - work%own(l, 3)
      e1 = there(at_moved + 1) - work%own(l, at_moved + 1)
      e2 = there(at_moved + 2) - work%own(l, at_moved + 2)
      e3 = there(at_moved + 3) - work%own(l, at_moved + 3)
      y(l, 1) = x1 + e1
      y(l, 2) = x2 + e2
      y(l, 3) = x3 + e3
      x = work%geometry(l, i)*(x1*e1 + x2*e2 + x3*e3)
      e = 2*x + work%geometry(l, i)*(e1*e1 + e2*e2 + e3*e3)
      length = sqrt(work%geometry(l, i)*(y(l, 1)**2 + y(l, 2)**2 + y(l, 3)**2))
      s(l) = e/(1 + length) - work%heat(l) - heat
      r(l) = merge(1/max(length, least), 0.0_wp, length > least)
      lambda(l) = plain + printed*(1 + x)*r(l)
      x = merge(s(l), 0.0_wp, work%stretch(l, i) > 0.0_wp)
      work%tension(l) = max(work%tension(l), x)
      work%compression(l) = max(work%compression(l), -x)
    end do
  end subroutine deform

end module pd_force_list_general
