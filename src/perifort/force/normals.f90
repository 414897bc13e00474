!> Smoothed normals of surface points (doc/theory.md, 17): against the side on which a point's
!> family is, as it lies now, so that they turn with the body.
module pd_force_normals
  use pd_base_kinds, only: wp, i4
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_force_term, only: term_view_type
  implicit none (type, external)
  private
  public :: surface_normals, normal_of_pair, patch_type, patch_radius, meet

  !> Sum of directions to the others, times their volumes, over the sum of these: below it a point
  !> has no surface. A half-space makes 1/2 in 3D and 2/pi in 2D for points at its surface.
  real(wp), parameter :: least = 0.1_wp
  real(wp), parameter :: opposed = 1.0_wp          !! least length of the difference of two normals
  real(wp), parameter :: wide = 1.5_wp             !! radius of a patch over the mean spacing
  real(wp), parameter :: pi = acos(-1.0_wp)
  integer, parameter :: at_once = 32               !! points of a chunk of a thread
  integer, parameter :: worth_threads = 200        !! points

  !> How two points meet along a given normal: the patch of one sees the other.
  type :: patch_type
    logical :: touches = .false.
    real(wp) :: gap = 0.0_wp        !! distance along the normal [m]
    real(wp) :: weight = 0.0_wp     !! part of the stiffness of the pair [-]
    real(wp) :: slope = 0.0_wp      !! its gradient over the vector across the normal [1/m2]
    real(wp) :: across(3) = 0.0_wp  !! that vector [m]
  end type patch_type

contains

  !> Outward unit normals of points, 0 where there is no surface: from intact bonds within a body.
  subroutine surface_normals(view, slots, normals)
    type(term_view_type), intent(in) :: view                 !! the instant
    integer(i4), intent(in) :: slots(:)                      !! of the points
    real(wp), allocatable, intent(out) :: normals(:, :)      !! (dim, points)
    type(bonds_type) :: bonds
    real(wp), dimension(size(view%u, 2)) :: r, total
    real(wp) :: volume, length
    integer :: i, b, k, j

    allocate (normals(size(view%u, 2), size(slots)))
    !$omp parallel if (size(slots) >= worth_threads) default(none) shared(view, slots, normals) &
    !$omp private(bonds, r, total, volume, length, i, b, k, j)
    call allocate_bonds(view%family, bonds)
    !$omp do schedule(dynamic, at_once)
    do i = 1, size(slots)
      k = slots(i)
      call view%family%bonds_of(k, bonds)
      total = 0.0_wp
      volume = 0.0_wp
      do b = 1, bonds%n
        if (.not. bonds%intact(b)) cycle
        j = bonds%j(b)
        if (view%body%body(j) /= view%body%body(k)) cycle
        r = (view%body%x(j, :) - view%body%x(k, :)) + (view%u(j, :) - view%u(k, :))
        length = norm2(r)
        if (.not. length > 0.0_wp) cycle
        total = total - view%body%volume(j)*(r/length)
        volume = volume + view%body%volume(j)
      end do
      length = norm2(total)
      normals(:, i) = 0.0_wp
      if (length > least*volume) normals(:, i) = total/length
    end do
    !$omp end parallel
  end subroutine surface_normals

  !> The normal of a pair, from one point to the other: half-way between the normal of one and the
  !> opposite of the other's; 0 if one has none, or if they do not face each other.
  pure function normal_of_pair(one, other) result(n)
    real(wp), intent(in) :: one(:)    !! outward unit normal, or 0
    real(wp), intent(in) :: other(:)  !! outward unit normal, or 0
    real(wp) :: n(size(one))          !! unit vector, or 0
    real(wp) :: length

    n = one - other
    length = norm2(n)
    if (length > opposed .and. any(abs(one) > 0.0_wp) .and. any(abs(other) > 0.0_wp)) then
      n = n/length
    else
      n = 0.0_wp
    end if
  end function normal_of_pair

  !> How two points meet: the weights (1 - t^2/R^2)^2 of all others on a lattice add up to about 1,
  !> t the distance across the normal.
  pure subroutine meet(r, n, spacing, begins, patch)
    real(wp), intent(in) :: r(:)        !! from one to the other [m]
    real(wp), intent(in) :: n(:)        !! normal of the pair, a unit vector
    real(wp), intent(in) :: spacing     !! mean of both [m]
    real(wp), intent(in) :: begins      !! gap at which they begin to push [m]
    type(patch_type), intent(out) :: patch
    real(wp) :: radius, square, most

    radius = patch_radius(spacing)
    patch%gap = dot_product(r, n)
    patch%across(:size(r)) = r - patch%gap*n
    square = sum(patch%across**2)
    patch%touches = patch%gap < begins .and. square < radius**2 .and. patch%gap > -radius
    if (.not. patch%touches) return
    ! the integral over the lattice's line or plane is one spacing or its square
    most = 15*spacing/(16*radius)
    if (size(r) == 3) most = 3*spacing**2/(pi*radius**2)
    patch%weight = most*(1 - square/radius**2)**2
    patch%slope = -4*most*(1 - square/radius**2)/radius**2
  end subroutine meet

  !> The distance across the normal up to which two points meet [m].
  elemental real(wp) function patch_radius(spacing) result(radius)
    real(wp), intent(in) :: spacing     !! mean of both [m]
    radius = wide*spacing
  end function patch_radius

end module pd_force_normals
