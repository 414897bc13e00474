!> Volume correction (7.2; doc/theory.md, 3): how much of a family member's volume lies in the
!> horizon.
module pd_family_volume
  use pd_base_kinds, only: wp
  use pd_base_error, only: internal_fault
  implicit none (type, external)
  private
  public :: volume_rule_type, volume_correction, reach, covered_fraction, horizon_of_bond, &
    & rule_of_bond
  public :: volume_none, volume_linear, volume_linear_extended, volume_exact, volume_rule_number

  integer, parameter :: volume_none = 1, volume_linear = 2, volume_linear_extended = 3, &
    & volume_exact = 4
  !> Membership at the horizon's edge must not depend on rounding.
  real(wp), parameter :: edge = 1.0e-9_wp

  type :: volume_rule_type
    integer :: kind = volume_linear
    real(wp) :: delta = 0.0_wp  !! horizon, the largest one where points have their own [m]
    real(wp) :: ratio = 0.0_wp  !! horizon over spacing of each point; 0: all have `delta` [-]
  end type volume_rule_type

contains

  !> The rule's number from its name in the scene.
  pure integer function volume_rule_number(name) result(number)
    character(*), intent(in) :: name  !! value of `volume_correction` in &horizon
    select case (name)
    case ('none'); number = volume_none
    case ('linear'); number = volume_linear
    case ('linear_extended'); number = volume_linear_extended
    case ('exact'); number = volume_exact
    case default
      call internal_fault('unknown volume correction')
    end select
  end function volume_rule_number

  !> The horizon of a bond: of two points with their own the larger one [m]. Both ends get the same
  !> bits.
  pure real(wp) function horizon_of_bond(rule, one, other) result(delta)
    type(volume_rule_type), intent(in) :: rule  !! volume correction and horizon
    real(wp), intent(in) :: one, other          !! spacings of the bond's ends [m]

    delta = rule%delta
    if (rule%ratio > 0.0_wp) delta = rule%ratio*max(one, other)
  end function horizon_of_bond

  !> The rule of a bond: with its horizon for `delta`.
  pure type(volume_rule_type) function rule_of_bond(rule, one, other) result(own)
    type(volume_rule_type), intent(in) :: rule  !! volume correction and horizon
    real(wp), intent(in) :: one, other          !! spacings of the bond's ends [m]

    own = rule
    own%delta = horizon_of_bond(rule, one, other)
  end function rule_of_bond

  !> Largest |xi| of a family [m] for a spacing [m]: delta, or further where the rule counts
  !> members whose centres lie outside but whose cells don't.
  pure real(wp) function reach(rule, spacing, dim)
    type(volume_rule_type), intent(in) :: rule  !! volume correction and horizon
    real(wp), intent(in) :: spacing             !! mean spacing of a bond's ends [m]
    integer, intent(in) :: dim                  !! of the body: 1 to 3

    reach = rule%delta
    if (rule%kind == volume_linear_extended) reach = rule%delta + spacing/2
    if (rule%kind == volume_exact) reach = rule%delta + spacing/2*sqrt(real(dim, wp))
    reach = reach*(1 + edge)
  end function reach

  !> v_c of a bond `xi` [m] between points with mean spacing `spacing` [m].
  pure real(wp) function volume_correction(rule, xi, length, spacing) result(vc)
    type(volume_rule_type), intent(in) :: rule  !! volume correction and horizon
    real(wp), intent(in) :: xi(:)               !! (dim) bond vector, used by `exact` alone [m]
    real(wp), intent(in) :: length              !! |xi| [m]
    real(wp), intent(in) :: spacing             !! mean spacing of its ends [m]

    select case (rule%kind)
    case (volume_none)
      vc = 1.0_wp
    case (volume_exact)
      vc = covered_fraction(xi, spacing, rule%delta)
    case (volume_linear, volume_linear_extended)
      vc = max(0.0_wp, min(1.0_wp, (rule%delta + spacing/2 - length)/spacing))
    case default
      call internal_fault('unknown volume correction')
    end select
  end function volume_correction

  !> Part of a cubic cell (edge `h`, centred at `xi`) inside the ball of radius `delta` at 0:
  !> closed form in 1D and 2D; in 3D Gauss quadrature over the discs that slice the ball.
  pure real(wp) function covered_fraction(xi, h, delta) result(fraction)
    real(wp), intent(in) :: xi(:)  !! (dim) centre of the cell [m]
    real(wp), intent(in) :: h      !! its edge [m]
    real(wp), intent(in) :: delta  !! radius of the ball [m]
    real(wp) :: c(size(xi))

    c = abs(xi)
    if (sum((c + h/2)**2) <= delta**2) then
      fraction = 1.0_wp
      return
    end if
    if (sum(max(c - h/2, 0.0_wp)**2) >= delta**2) then
      fraction = 0.0_wp
      return
    end if
    select case (size(xi))
    case (1)
      fraction = (min(c(1) + h/2, delta) - max(c(1) - h/2, -delta))/h
    case (2)
      fraction = rectangle_in_disc(c(1) - h/2, c(1) + h/2, c(2) - h/2, c(2) + h/2, delta)/h**2
    case default
      fraction = slices(c, h, delta)/h**3
    end select
    fraction = max(0.0_wp, min(1.0_wp, fraction))
  end function covered_fraction

  !> Volume of cell and ball in common [m3]: the slice's area is smooth in z between the heights
  !> at which the circle passes a corner of the square or touches an edge, so each piece is
  !> integrated by itself.
  pure real(wp) function slices(c, h, delta) result(volume)
    real(wp), intent(in) :: c(:)
    real(wp), intent(in) :: h
    real(wp), intent(in) :: delta
    real(wp), parameter :: node(6) = [-0.9324695142031521_wp, -0.6612093864662645_wp, &
      & -0.2386191860831969_wp, 0.2386191860831969_wp, 0.6612093864662645_wp, 0.9324695142031521_wp]
    real(wp), parameter :: share(6) = [0.1713244923791704_wp, 0.3607615730481386_wp, &
      & 0.4679139345726910_wp, 0.4679139345726910_wp, 0.3607615730481386_wp, 0.1713244923791704_wp]
    real(wp) :: cut(17), r2(15), low, high, half, middle, z, swap, xs(3), ys(3)
    integer :: i, j, n

    low = c(3) - h/2
    high = min(c(3) + h/2, delta)
    xs = [c(1) - h/2, c(1) + h/2, 0.0_wp]
    ys = [c(2) - h/2, c(2) + h/2, 0.0_wp]
    n = 0
    do i = 1, 3
      do j = 1, 3
        n = n + 1
        r2(n) = delta**2 - xs(i)**2 - ys(j)**2
      end do
    end do
    cut(1:2) = [low, high]
    j = 2
    do i = 1, n
      if (r2(i) <= 0.0_wp) cycle
      z = sqrt(r2(i))
      if (z > low .and. z < high) then
        j = j + 1
        cut(j) = z
      end if
    end do
    n = j
    do i = 2, n
      do j = i, 2, -1
        if (cut(j) >= cut(j - 1)) exit
        swap = cut(j)
        cut(j) = cut(j - 1)
        cut(j - 1) = swap
      end do
    end do
    volume = 0.0_wp
    do i = 2, n
      half = (cut(i) - cut(i - 1))/2
      middle = (cut(i) + cut(i - 1))/2
      do j = 1, 6
        z = middle + half*node(j)
        volume = volume + half*share(j)*rectangle_in_disc(xs(1), xs(2), ys(1), ys(2), &
          & sqrt(max(0.0_wp, delta**2 - z**2)))
      end do
    end do
  end function slices

  !> Area of the rectangle [x1, x2] x [y1, y2] inside the disc of radius r at 0.
  pure real(wp) function rectangle_in_disc(x1, x2, y1, y2, r) result(area)
    real(wp), intent(in) :: x1, x2, y1, y2, r
    area = corner_in_disc(x2, y2, r) - corner_in_disc(x1, y2, r) &
      & - corner_in_disc(x2, y1, r) + corner_in_disc(x1, y1, r)
  end function rectangle_in_disc

  !> Signed area of the rectangle between 0 and (x, y) inside the disc of radius r.
  pure real(wp) function corner_in_disc(x, y, r) result(area)
    real(wp), intent(in) :: x, y, r
    real(wp) :: u, v, w

    u = min(abs(x), r)
    v = min(abs(y), r)
    if (u**2 + v**2 <= r**2) then
      area = u*v
    else
      w = sqrt(max(0.0_wp, r**2 - v**2))  ! up to here the rectangle's edge is the limit
      area = v*w + primitive(u) - primitive(w)
    end if
    area = sign(area, x*y)
    if (abs(x) <= 0.0_wp .or. abs(y) <= 0.0_wp) area = 0.0_wp

  contains

    !> Integral of sqrt(r^2 - t^2) from 0 to t.
    pure real(wp) function primitive(t)
      real(wp), intent(in) :: t
      real(wp) :: root
      ! atan2 keeps its digits where t is all but r, and r many times the cell
      root = sqrt(max(0.0_wp, (r - t)*(r + t)))
      primitive = (t*root + r**2*atan2(t, root))/2
    end function primitive
  end function corner_in_disc

end module pd_family_volume
