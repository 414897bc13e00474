!> The stretch without a root, for the strains that bodies mostly have.
!>
!> With e = (2 xi.eta + eta.eta)/|xi|^2, the deformed length is |xi| sqrt(1 + e), the stretch
!> s = sqrt(1 + e) - 1 and |xi|/|xi+eta| = r = 1/sqrt(1 + e). The force needs s r = 1 - r, which
!> is e h(e) with a polynomial h in a range around 0: no root, no division, and no cancellation. The
!> unprojected dilatation needs s itself, which is e g(e) with another polynomial g.
!>
!> h is 1/2 - 3/8 e, g is 1/2 - 1/8 e, and to each comes e^2 times the Chebyshev interpolation of
!> the rest: the polynomial through its values at the roots of the range's Chebyshev polynomial,
!> solved with 60 digits.
module pd_force_polynomial
  use pd_base_kinds, only: wp, sp
  use pd_force_model, only: early, force_options_type, model_type
  implicit none (type, external)
  private
  public :: fast_limit, fast_terms, fast_ranges, narrow, wide, single
  public :: h0, h1, h2, h3, h4, h5, h6, h7
  public :: w0, w1, w2, w3, w4, w5, w6, w7, w8, w9, w10, w11
  public :: k0, k1, k2, k3, k4, k5
  public :: g0, g1, g2, g3, g4, g5, g6, g7
  public :: v0, v1, v2, v3, v4, v5, v6, v7, v8, v9, v10, v11
  public :: s0, s1, s2, s3, s4, s5

  !> Ranges of e: the first is tried first; what is strained more gets more terms.
  integer, parameter :: narrow = 1, wide = 2, single = 3
  real(wp), parameter :: fast_ranges(3) = [0.02_wp, 0.1_wp, 0.1_wp]

  ! h: s r = e h(e)

  !> |e| <= 0.02, relative error 3e-16.
  real(wp), parameter :: h0 = 0.5_wp, h1 = -0.375_wp, h2 = 0.31250000000037114_wp, &
    & h3 = -0.27343750000352559_wp, h4 = 0.24609373329889834_wp, h5 = -0.22558592163388049_wp, &
    & h6 = 0.20958398402647260_wp, h7 = -0.19648637700069084_wp
  !> |e| <= 0.1, relative error 6e-16.
  real(wp), parameter :: w0 = 0.5_wp, w1 = -0.375_wp, w2 = 0.312500000000031_wp, &
    & w3 = -0.27343750000002986_wp, w4 = 0.24609374984509869_wp, w5 = -0.22558593735061483_wp, &
    & w6 = 0.20947278004973865_wp, w7 = -0.19638073462498234_wp, w8 = 0.18543599211183687_wp, &
    & w9 = -0.1761636952783165_wp, w10 = 0.17212206067600017_wp, w11 = -0.1649739926009514_wp
  !> |e| <= 0.1 in single precision, relative error 6e-8.
  real(sp), parameter :: k0 = 0.5_sp, k1 = -0.375_sp, k2 = 0.3124973582_sp, &
    & k3 = -0.273435023_sp, k4 = 0.2482048324_sp, k5 = -0.2275652827_sp

  ! g: s = e g(e)

  !> |e| <= 0.02, relative error 2e-17.
  real(wp), parameter :: g0 = 0.5_wp, g1 = -0.125_wp, g2 = 0.06250000000002183_wp, &
    & g3 = -0.039062500000018555_wp, g4 = 0.027343749017680316_wp, g5 = -0.02050781166501785_wp, &
    & g6 = 0.016119829433608308_wp, g7 = -0.013097607025781758_wp
  !> |e| <= 0.1, relative error 3e-17.
  real(wp), parameter :: v0 = 0.5_wp, v1 = -0.125_wp, v2 = 0.06250000000000124_wp, &
    & v3 = -0.0390625000000011_wp, v4 = 0.027343749993823777_wp, v5 = -0.02050781249448386_wp, &
    & v6 = 0.016113286186807907_wp, v7 = -0.013092045424756286_wp, v8 = 0.010908654452264042_wp, &
    & v9 = -0.009272296833520361_wp, v10 = 0.008165984417340112_wp, v11 = -0.007148068075048751_wp
  !> |e| <= 0.1 in single precision, relative error 4e-9 before rounding.
  real(sp), parameter :: s0 = 0.5_sp, s1 = -0.125_sp, s2 = 0.06249979721_sp, &
    & s3 = -0.03906233518_sp, s4 = 0.02750584349_sp, s5 = -0.02063954964_sp

contains

  !> Whether the fast formulas know every term that is asked for, so that they are valid for small
  !> strains: forces and energies both ask here.
  pure logical function fast_terms(options)
    type(force_options_type), intent(in) :: options  !! what a force or an energy takes in
    fast_terms = .not. options%thermal
  end function fast_terms

  !> Bonds with |e| below this are computed by the fast formulas of a `range`; 0: none. Where bonds
  !> can break it is no more than the |e| at which the first one might.
  pure real(wp) function fast_limit(model, options, range) result(limit)
    type(model_type), intent(in) :: model            !! with the smallest critical stretch
    type(force_options_type), intent(in) :: options  !! what a force takes in
    integer, intent(in) :: range  !! `narrow`, `wide` or `single`
    ! what single precision may miss of e: some roundings of eta/|xi| and of its square, both at
    ! most 2 or so where the length hardly changes
    real(wp), parameter :: roundings = 50*epsilon(1.0_sp)
    real(wp) :: s

    limit = 0.0_wp
    if (.not. fast_terms(options)) return
    limit = fast_ranges(range)
    if (.not. model%breaking) return
    ! with the limit s, |e| reaches (1 + s)^2 - 1 in tension and 1 - (1 - s)^2, which is less, in
    ! compression; from s = 1 on no bond breaks in compression
    s = min(model%least_critical, 1.0_wp)
    limit = min(limit, s*(2 - s)*early)
    if (range == single) limit = max(0.0_wp, limit - roundings)
  end function fast_limit

end module pd_force_polynomial
