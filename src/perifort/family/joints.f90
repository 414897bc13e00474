!> Bonds that join bodies: how many there are between each two.
module pd_family_joints
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_lookup, only: lookup_type
  use pd_body_body, only: body_type
  use pd_family_family, only: family_type, bonds_type, allocate_bonds
  use pd_family_volume, only: reach
  implicit none (type, external)
  private
  public :: joint_type, count_joints

  integer, parameter :: most_boxes = 50  !! bodies up to which boxes are compared

  !> Two bodies and the bonds between them.
  type :: joint_type
    integer :: bodies(2) = 0     !! their numbers, the smaller one first
    integer(i8) :: bonds = 0_i8  !! intact ones, each counted once
  end type joint_type

contains

  !> The pairs of bodies that intact bonds join, in the order of their numbers. Layers belong to
  !> their bodies.
  subroutine count_joints(body, family, joints)
    type(body_type), intent(in) :: body                      !! arranged in the slots of the family
    class(family_type), intent(in) :: family                 !! its families, cracks cut
    type(joint_type), allocatable, intent(out) :: joints(:)  !! none for a single body
    type(lookup_type) :: pairs
    type(bonds_type) :: bonds
    integer(i4), allocatable :: foreign(:)
    real(wp), allocatable :: low(:, :), high(:, :)
    integer :: k, i, number
    logical :: is_new

    allocate (joints(0))
    k = findloc(body%point > 0_i4, .true., dim=1)
    if (k == 0) return
    if (all(body%body == body%body(k) .or. body%point == 0_i4)) return
    ! most points have no bond to another body: these are left out on all threads
    call find_boxes(body, reach(family%rule, maxval(body%spacing), body%dim), low, high)
    allocate (foreign(body%n_slots), source=0_i4)
    !$omp parallel default(none) shared(body, family, foreign, low, high) private(bonds, k)
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 256)
    do k = 1, body%n_slots
      if (body%point(k) == 0_i4) cycle
      if (.not. near_another(int(body%body(k)), body%x(k, :))) cycle
      call family%bonds_of(k, bonds)
      foreign(k) = int(count(bonds%intact(:bonds%n) .and. &
        & body%body(bonds%j(:bonds%n)) > body%body(k)), i4)
    end do
    !$omp end parallel
    call allocate_bonds(family, bonds)
    do k = 1, body%n_slots
      if (foreign(k) == 0_i4) cycle
      call family%bonds_of(k, bonds)
      do i = 1, bonds%n
        if (.not. bonds%intact(i) .or. body%body(bonds%j(i)) <= body%body(k)) cycle
        call pairs%number_of(65536_i8*body%body(k) + body%body(bonds%j(i)), number, is_new)
        if (is_new) joints = [joints, joint_type([int(body%body(k)), &
          & int(body%body(bonds%j(i)))])]
        joints(number)%bonds = joints(number)%bonds + 1_i8
      end do
    end do
    call sort(joints)

  contains

    !> Whether a point of body `b` at `x` may have bonds to another body.
    pure logical function near_another(b, x)
      integer, intent(in) :: b
      real(wp), intent(in) :: x(:)
      integer :: other

      ! checking the bonds is cheaper than checking many boxes
      near_another = size(low, 2) > most_boxes
      do other = 1, min(size(low, 2), most_boxes)
        if (near_another) return
        near_another = other /= b .and. all(x >= low(:, other) .and. x <= high(:, other))
      end do
    end function near_another
  end subroutine count_joints

  !> The boxes (dim, body) that hold all points of each body and what lies within `distance` [m] of
  !> them.
  pure subroutine find_boxes(body, distance, low, high)
    type(body_type), intent(in) :: body
    real(wp), intent(in) :: distance                          !! [m]
    real(wp), allocatable, intent(out) :: low(:, :), high(:, :)  !! corners (dim, body) [m]
    integer :: k

    allocate (low(body%dim, maxval(body%body)), source=huge(1.0_wp))
    allocate (high(body%dim, size(low, 2)), source=-huge(1.0_wp))
    do k = 1, body%n_slots
      if (body%point(k) == 0_i4) cycle
      associate (b => body%body(k))
        low(:, b) = min(low(:, b), body%x(k, :) - distance)
        high(:, b) = max(high(:, b), body%x(k, :) + distance)
      end associate
    end do
  end subroutine find_boxes

  !> Ascending by the numbers of the bodies.
  pure subroutine sort(joints)
    type(joint_type), intent(inout) :: joints(:)
    type(joint_type) :: one
    integer :: i, j

    do i = 2, size(joints)
      one = joints(i)
      do j = i - 1, 1, -1
        if (joints(j)%bodies(1) < one%bodies(1) .or. (joints(j)%bodies(1) == one%bodies(1) .and. &
          & joints(j)%bodies(2) <= one%bodies(2))) exit
        joints(j + 1) = joints(j)
      end do
      joints(j + 1) = one
    end do
  end subroutine sort

end module pd_family_joints
