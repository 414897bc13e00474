!> What points cost in a step, for ranks that share the work alike (7.12): their bonds, slots
!> without a point that loops compute with theirs, and the contact that they may have.
!>
!> The unit of costs is a bond on a lattice, of those that start at a point. The numbers are
!> measured (doc/clusters.md, How the points are divided). They are integers, so that sums do not
!> depend on the order of points, and all ranks cut space alike.
module pd_body_work
  use pd_base_kinds, only: wp
  use pd_base_lanes, only: lanes
  use pd_body_body, only: body_type, lattice_type
  use pd_body_lattices, only: cell_of
  implicit none (type, external)
  private
  public :: work_rule_type, zone_type, work_of, full_share

  !> What divides by every number of points that a block may have.
  integer, parameter :: share_of_block = 840
  !> The share of a block that each of its points has, if it has all.
  real(wp), parameter :: full_share = real(share_of_block/lanes, wp)
  integer, parameter :: of_point = 15       !! what a point costs beside its bonds [bonds]
  real(wp), parameter :: most_members = 1.0e6_wp

  !> Where points of a body may touch others: near the box around another body.
  type :: zone_type
    integer :: body = 0                     !! whose points
    real(wp) :: lower(3) = 0.0_wp           !! corners [m]
    real(wp) :: upper(3) = 0.0_wp
    integer :: of_contact = 0               !! what contact costs a point [bonds] ..
    integer :: of_member = 0                !! .. and for each member of its family
  end type zone_type

  !> What the work of a scene's points depends on.
  type :: work_rule_type
    real(wp) :: delta = 0.0_wp              !! horizon [m]
    logical :: in_blocks = .false.          !! points of lattices are computed in blocks of a row
    type(zone_type), allocatable :: zones(:)
  end type work_rule_type

contains

  !> The work of points that follow each other in point order.
  pure function work_of(rule, points, slots) result(work)
    type(work_rule_type), intent(in) :: rule
    type(body_type), intent(in) :: points   !! with the lattices of the bodies
    integer, intent(in) :: slots(:)         !! of the points, in point order
    real(wp), allocatable :: work(:)        !! (points) whole numbers, `full_share` for a bond
    integer :: i, first, last, members, share

    allocate (work(size(slots)))
    first = 1
    do while (first <= size(slots))
      last = first
      share = share_of_block/lanes
      if (rule%in_blocks .and. points%grid(slots(first)) > 0) then
        last = end_of_block(points, slots, first)
        share = share_of_block/(last - first + 1)
      end if
      do i = first, last
        members = members_of(rule, points%dim, points%spacing(slots(i)))
        work(i) = real(share, wp)*(of_point + members) &
          & + full_share*contact_of(rule, points, slots(i), members)
      end do
      first = last + 1
    end do
  end function work_of

  !> The last point of the block of a lattice's row in which a point is the first one.
  pure integer function end_of_block(points, slots, first) result(last)
    type(body_type), intent(in) :: points
    integer, intent(in) :: slots(:), first
    integer :: cell(3), next(3)

    last = first
    cell = block_at(slots(first))
    do while (last < size(slots))
      if (points%body(slots(last + 1)) /= points%body(slots(first)) .or. &
        & points%layer(slots(last + 1)) /= points%layer(slots(first))) return
      next = block_at(slots(last + 1))
      if (any(next /= cell)) return
      last = last + 1
    end do

  contains

    !> Block and row of a point.
    pure function block_at(slot) result(place)
      integer, intent(in) :: slot
      integer :: place(3)
      associate (lattice => points%lattices(points%body(slot)))
        place = cell_of(lattice%grid, points%x(slot, :))
      end associate
      place(1) = floor((place(1) - 1)/real(lanes, wp))
    end function block_at
  end function end_of_block

  !> How many members the family of a point has, if all points around it are as large.
  pure integer function members_of(rule, dim, spacing) result(members)
    type(work_rule_type), intent(in) :: rule
    integer, intent(in) :: dim
    real(wp), intent(in) :: spacing  !! [m]
    real(wp), parameter :: pi = acos(-1.0_wp)
    real(wp), parameter :: ball(3) = [2.0_wp, pi, 4*pi/3]
    members = nint(min(most_members, ball(dim)*(rule%delta/spacing)**dim))
  end function members_of

  !> What contact costs a point, in bonds: the most of the zones in which it is.
  pure real(wp) function contact_of(rule, points, slot, members) result(work)
    type(work_rule_type), intent(in) :: rule
    type(body_type), intent(in) :: points
    integer, intent(in) :: slot, members
    integer :: z

    work = 0.0_wp
    do z = 1, size(rule%zones)
      associate (zone => rule%zones(z), x => points%x(slot, :))
        if (zone%body /= points%body(slot)) cycle
        if (any(x < zone%lower(:points%dim) .or. x > zone%upper(:points%dim))) cycle
        work = max(work, real(zone%of_contact, wp) + real(zone%of_member, wp)*members)
      end associate
    end do
  end function contact_of

end module pd_body_work
