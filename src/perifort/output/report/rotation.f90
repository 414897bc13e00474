!> How far a body has turned. The projected dilatation shrinks by the cosine of a rotation, so a run
!> with it checks whether parts have rotated.
module pd_output_report_rotation
  use pd_base_kinds, only: wp
  use pd_base_tensors, only: cofactors, determinant
  use pd_body_body, only: body_type
  use pd_family_family, only: family_type, bonds_type, allocate_bonds
  implicit none (type, external)
  private
  public :: turned_part, rotation_angle

  integer, parameter :: most_samples = 200      !! points that are checked
  real(wp), parameter :: least_intact = 0.5_wp  !! of a family's volume; points with less are loose
  real(wp), parameter :: golden = 0.61803398874989485_wp

contains

  !> The share of points that are turned by more than `limit` [rad] at displacements `u` (n_slots,
  !> dim) [m], and the largest rotation [rad]. Some 200 points, spread over all, stand for the body.
  !> Points with less than half their family left are left out: they move as they like.
  subroutine turned_part(body, family, u, limit, share, largest)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(in) :: limit
    real(wp), intent(out) :: share, largest
    type(bonds_type) :: bonds
    real(wp) :: moments(3, 3), moved(3, 3), angle
    integer :: i, k, samples, counted, turned

    share = 0.0_wp
    largest = 0.0_wp
    if (body%dim == 1) return
    samples = min(body%n_points, most_samples)
    counted = 0
    turned = 0
    call allocate_bonds(family, bonds)
    do i = 1, samples
      k = i
      ! multiples of the golden ratio fall between all rows
      if (samples < body%n_points) k = 1 + int(body%n_points*modulo(i*golden, 1.0_wp))
      k = body%slot(k)
      call family%bonds_of(k, bonds)
      associate (w => bonds%weight(:bonds%n))
        if (.not. sum(w, mask=bonds%intact(:bonds%n)) > least_intact*sum(w)) cycle
      end associate
      call moments_of(u, k, bonds, moments, moved)
      angle = rotation_angle(moments, moved)
      counted = counted + 1
      if (angle > limit) turned = turned + 1
      largest = max(largest, angle)
    end do
    if (counted > 0) share = real(turned, wp)/counted
  end subroutine turned_part

  !> Sums of w xi xi^T and w y xi^T over the intact bonds of slot `k`, w = vc V/|xi|^2. A plane body
  !> gets a third direction that stays where it is.
  pure subroutine moments_of(u, k, bonds, moments, moved)
    real(wp), intent(in) :: u(:, :)
    integer, intent(in) :: k
    type(bonds_type), intent(in) :: bonds
    real(wp), intent(out) :: moments(3, 3), moved(3, 3)
    real(wp) :: xi(3), y(3), w
    integer :: i, c

    moments = 0.0_wp
    moved = 0.0_wp
    xi = 0.0_wp
    y = 0.0_wp
    associate (dim => size(u, 2))
      do i = 1, bonds%n
        if (.not. bonds%intact(i)) cycle
        xi(:dim) = bonds%xi(i, :)
        y(:dim) = xi(:dim) + u(bonds%j(i), :) - u(k, :)
        w = bonds%weight(i)/bonds%length(i)**2
        do c = 1, dim
          moments(:, c) = moments(:, c) + w*xi*xi(c)
          moved(:, c) = moved(:, c) + w*y*xi(c)
        end do
      end do
      if (dim == 2) then
        moments(3, 3) = (moments(1, 1) + moments(2, 2))/2
        moved(3, 3) = moments(3, 3)
      end if
    end associate
  end subroutine moments_of

  !> The angle of the rotation [rad] in the polar decomposition of the deformation gradient F, from
  !> `moments` K = sum w xi xi^T and `moved` A = sum w y xi^T = F K. Where all bonds lie in a plane,
  !> its normal turns with it; a straight chain turns as its direction does. 0 where F is no
  !> deformation (a point turned inside out).
  pure real(wp) function rotation_angle(moments, moved) result(angle)
    real(wp), intent(in) :: moments(3, 3), moved(3, 3)
    real(wp), parameter :: flat = 1.0e-6_wp
    real(wp) :: K(3, 3), A(3, 3), R(3, 3), change(3, 3), normal(3), image(3), trace
    integer :: i

    angle = 0.0_wp
    trace = moments(1, 1) + moments(2, 2) + moments(3, 3)
    if (.not. trace > 0.0_wp) return
    K = moments/trace
    A = moved/trace
    if (.not. determinant(K) > flat**2) then
      R = cofactors(K)
      i = maxloc([R(1, 1), R(2, 2), R(3, 3)], dim=1)
      if (.not. R(i, i) > flat) then
        ! K = x x^T and A = y x^T
        if (norm2(A) > 0.0_wp) &
          & angle = acos(max(-1.0_wp, min(1.0_wp, (A(1, 1) + A(2, 2) + A(3, 3))/norm2(A))))
        return
      end if
      normal = R(:, i)/norm2(R(:, i))
      image = matmul(cofactors(A), normal)
      if (.not. norm2(image) > 0.0_wp) return
      image = image/norm2(image)
      K = K + spread(normal, 2, 3)*spread(normal, 1, 3)/2
      A = A + spread(image, 2, 3)*spread(normal, 1, 3)/2
    end if
    ! F = A K^-1, with K symmetric
    R = matmul(A, cofactors(K))/determinant(K)
    do i = 1, 50
      if (.not. determinant(R) > tiny(1.0_wp)**0.5_wp) return
      ! Newton: the mean of R and its inverse transposed
      change = (cofactors(R)/determinant(R) - R)/2
      R = R + change
      if (all(abs(change) <= 1.0e-9_wp)) exit
    end do
    angle = acos(max(-1.0_wp, min(1.0_wp, (R(1, 1) + R(2, 2) + R(3, 3) - 1)/2)))
  end function rotation_angle

end module pd_output_report_rotation
