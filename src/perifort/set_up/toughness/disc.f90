!> A disc of points around the tip of a straight crack, in units of the spacing: its bonds, its
!> forces and its equilibrium. In 3D every layer of points is like the next one, and nothing moves
!> along the front, so that one layer stands for all.
!>
!> The body is linear: stretches are (xi . eta)/|xi|^2. It is small, and its solve is serial: the
!> result is the same on any number of threads.
module pd_set_up_toughness_disc
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: pi
  use pd_family_volume, only: reach, volume_correction, volume_rule_type
  use pd_law_weighted, only: weighted_law_type
  implicit none (type, external)
  private
  public :: disc_type, kind_type, make_disc, cut, crosses, image_of, bonds_across, &
    & classical_field, forces, relax, most_stretched

  integer, parameter :: most_iterations = 5000  !! of one solve
  real(wp), parameter :: rounding = 1.0e-9_wp   !! of places [spacings]

  !> Bonds of one kind: steps in the plane of the field, and layers between the ends.
  type :: kind_type
    integer :: step(2) = 0             !! cells from one end to the other
    integer :: layers = 0              !! between the ends, in front of the cell or behind it (3D)
    integer :: number = 1              !! bonds of this kind that a cell has: 2 across layers
    real(wp) :: along(2) = 0.0_wp      !! xi/|xi|, within the plane [-]
    real(wp) :: length = 0.0_wp        !! |xi|
    real(wp) :: pull = 0.0_wp          !! 2 q gb vc V of these bonds, with the surface factor
    real(wp) :: spread = 0.0_wp        !! gd vc V of them
  end type kind_type

  !> The disc in a square of cells.
  type :: disc_type
    integer :: cells = 0                       !! along a side of the square
    integer :: margin = 0                      !! cells that a bond spans at most
    logical :: diagonal = .false.              !! the crack grows along diagonals of cells
    type(kind_type), allocatable :: kinds(:)   !! of two opposite directions one
    real(wp), allocatable :: intact(:, :, :)   !! 1 or 0 (cells, cells, kinds), at one end
    integer, allocatable :: first(:), last(:)  !! of the cells in a row whose bonds matter
    real(wp), allocatable :: free(:, :)        !! 1, or 0 where held (cells, cells)
    real(wp), allocatable :: ahead(:, :)       !! place along the crack (cells, cells)
    real(wp), allocatable :: above(:, :)       !! place across it (cells, cells)
    real(wp) :: dilatation = 0.0_wp            !! p_k = `dilatation` sum of `spread` s; 0: none
  end type disc_type

contains

  !> The disc of a law, uncut. With `corrected` bonds have the surface factors of a whole family, by
  !> which it carries the classical dilatation and energy (doc/theory.md, 4).
  subroutine make_disc(law, dim, rule, corrected, diagonal, radius, disc)
    class(weighted_law_type), intent(in) :: law  !! set up for `dim` and the rule's horizon
    integer, intent(in) :: dim                   !! 2 or 3
    type(volume_rule_type), intent(in) :: rule   !! volume correction, horizon in spacings
    logical, intent(in) :: corrected             !! with surface factors
    logical, intent(in) :: diagonal              !! the crack grows along diagonals of cells
    real(wp), intent(in) :: radius               !! of the points that move [spacings]
    type(disc_type), intent(out) :: disc         !! all bonds intact
    real(wp) :: x, y, outer
    integer :: i, j, half

    call make_kinds(law, dim, rule, corrected, disc)
    disc%diagonal = diagonal
    half = ceiling(radius) + 3*disc%margin + 1
    disc%cells = 2*half
    associate (n => disc%cells)
      allocate (disc%intact(n, n, size(disc%kinds)), source=1.0_wp)
      allocate (disc%free(n, n), disc%ahead(n, n), disc%above(n, n), source=0.0_wp)
      allocate (disc%first(n), source=1)
      allocate (disc%last(n), source=0)
      ! the dilatation of a held point within reach of a free one is that of its whole family
      outer = radius + merge(2, 1, abs(disc%dilatation) > 0.0_wp)*disc%margin
      do j = 1, n
        do i = 1, n
          x = i - half - 0.5_wp
          y = j - half - 0.5_wp
          if (x**2 + y**2 < radius**2) disc%free(i, j) = 1.0_wp
          if (x**2 + y**2 <= outer**2) then
            if (disc%last(j) == 0) disc%first(j) = i
            disc%last(j) = i
          end if
          disc%ahead(i, j) = x
          disc%above(i, j) = y
          ! between two diagonals, which are half a diagonal apart
          if (diagonal) disc%ahead(i, j) = (x + y)/sqrt(2.0_wp)
          if (diagonal) disc%above(i, j) = (y - x - 0.5_wp)/sqrt(2.0_wp)
        end do
      end do
    end associate
  end subroutine make_disc

  !> The kinds of bonds, with their constants.
  subroutine make_kinds(law, dim, rule, corrected, disc)
    class(weighted_law_type), intent(in) :: law
    integer, intent(in) :: dim
    type(volume_rule_type), intent(in) :: rule
    logical, intent(in) :: corrected
    type(disc_type), intent(inout) :: disc
    type(kind_type) :: kind
    real(wp) :: xi(3), r, part, gb, gd, energy, dilatation, of_stretch, of_dilatation
    integer :: i, j, k, m, layers

    m = floor(reach(rule, 1.0_wp, dim))
    layers = merge(m, 0, dim == 3)
    allocate (disc%kinds(0))
    energy = 0.0_wp
    dilatation = 0.0_wp
    do k = 0, layers
      do j = 0, m
        do i = -m, m
          xi = real([i, j, k], wp)
          r = norm2(xi)
          if (r > reach(rule, 1.0_wp, dim) .or. .not. r > 0.0_wp) cycle
          if (j == 0 .and. i < 0) cycle
          part = volume_correction(rule, xi(:dim), r, 1.0_wp)
          if (.not. part > 0.0_wp) cycle
          gb = 1.0_wp
          gd = 1.0_wp
          if (law%has_factors()) call law%bond_factors(r/rule%delta, gb, gd)
          kind%step = [i, j]
          kind%layers = k
          kind%number = merge(2, 1, k > 0)
          kind%along = xi(:2)/r
          kind%length = r
          kind%pull = 2*law%material%q*gb*part*kind%number
          kind%spread = gd*part*kind%number
          ! by symmetry of the family along x or y: its mean over both has all bonds, these twice
          energy = energy + gb*part*kind%number*r*sum(kind%along**4)
          dilatation = dilatation + gd*part*kind%number*sum(kind%along**2)
          if (i == 0 .and. j == 0) cycle  ! nothing moves along the front
          disc%kinds = [disc%kinds, kind]
        end do
      end do
    end do
    disc%margin = m
    of_stretch = 1.0_wp
    of_dilatation = 1.0_wp
    if (corrected) then
      associate (material => law%material)
        of_stretch = (material%uniaxial_energy - material%a)/(material%q/2*energy)
        of_dilatation = 1/(material%t*dilatation)
      end associate
    end if
    disc%kinds%pull = of_stretch*disc%kinds%pull
    disc%kinds%spread = of_dilatation*disc%kinds%spread
    disc%dilatation = 2*law%material%a*law%material%t**2
  end subroutine make_kinds

  !> Cut all bonds through the plane of the crack behind `ahead` = 0.
  subroutine cut(disc)
    type(disc_type), intent(inout) :: disc  !! gets the crack
    integer :: i, j, k, m

    m = disc%margin
    do k = 1, size(disc%kinds)
      do j = 1, disc%cells - m
        do i = m + 1, disc%cells - m
          if (crosses(disc, [i, j, k], behind=0.0_wp)) disc%intact(i, j, k) = 0.0_wp
        end do
      end do
    end do
  end subroutine cut

  !> Whether a bond passes through the plane of the crack.
  pure logical function crosses(disc, bond, behind)
    type(disc_type), intent(in) :: disc       !! the disc
    integer, intent(in) :: bond(3)            !! cell of one end, and kind
    real(wp), intent(in), optional :: behind  !! at a place less than this one [spacings]
    real(wp) :: y(2), x(2)

    associate (a => bond(:2), b => bond(:2) + disc%kinds(bond(3))%step)
      y = [disc%above(a(1), a(2)), disc%above(b(1), b(2))]
      x = [disc%ahead(a(1), a(2)), disc%ahead(b(1), b(2))]
    end associate
    crosses = y(1)*y(2) < 0.0_wp
    if (present(behind) .and. crosses) crosses = x(1) + (x(2) - x(1))*y(1)/(y(1) - y(2)) &
      & < behind - rounding
  end function crosses

  !> The mirror image of a bond in the plane of the crack; kind 0 if there is none. Diagonals on
  !> both sides of the plane are shifted against each other.
  pure function image_of(disc, bond) result(image)
    type(disc_type), intent(in) :: disc  !! the disc
    integer, intent(in) :: bond(3)       !! cell of one end, and kind
    integer :: image(3)
    integer :: step(2), a(2), k

    image = 0
    if (disc%diagonal) return
    associate (kind => disc%kinds(bond(3)))
      a = [bond(1), disc%cells + 1 - bond(2)]
      step = [kind%step(1), -kind%step(2)]
      if (step(2) < 0 .or. (step(2) == 0 .and. step(1) < 0)) then
        a = a + step
        step = -step
      end if
      do k = 1, size(disc%kinds)
        if (any(disc%kinds(k)%step /= step) .or. disc%kinds(k)%layers /= kind%layers) cycle
        image = [a, k]
        return
      end do
    end associate
  end function image_of

  !> Bonds through the plane of the crack by length of the front's way, in one layer [1/spacing].
  pure real(wp) function bonds_across(disc) result(number)
    type(disc_type), intent(in) :: disc  !! the disc
    integer :: k

    number = 0.0_wp
    do k = 1, size(disc%kinds)
      associate (kind => disc%kinds(k))
        if (disc%diagonal) then
          number = number + kind%number*abs(kind%step(2) - kind%step(1))/sqrt(2.0_wp)
        else
          number = number + kind%number*abs(kind%step(2))
        end if
      end associate
    end do
  end function bonds_across

  !> Displacements of the classical material at the stress intensity K = 1, in mode I, around a tip.
  subroutine classical_field(disc, shear_modulus, ratio, plane_strain, tip, u)
    type(disc_type), intent(in) :: disc        !! the disc
    real(wp), intent(in) :: shear_modulus      !! mu
    real(wp), intent(in) :: ratio              !! Poisson's ratio
    logical, intent(in) :: plane_strain        !! plane strain, else plane stress
    real(wp), intent(in) :: tip                !! place of the tip on the crack's line [spacings]
    real(wp), intent(out) :: u(:, :, :)        !! (cells, cells, 2) by the axes of the lattice
    real(wp) :: kappa, x, y, angle, size_of, ahead, above
    integer :: i, j

    kappa = (3 - ratio)/(1 + ratio)
    if (plane_strain) kappa = 3 - 4*ratio
    do j = 1, disc%cells
      do i = 1, disc%cells
        x = disc%ahead(i, j) - tip
        y = disc%above(i, j)
        angle = atan2(y, x)
        size_of = sqrt(norm2([x, y])/(2*pi))/(2*shear_modulus)*(kappa - cos(angle))
        ahead = size_of*cos(angle/2)
        above = size_of*sin(angle/2)
        u(i, j, :) = [ahead, above]
        if (disc%diagonal) u(i, j, :) = [ahead - above, ahead + above]/sqrt(2.0_wp)
      end do
    end do
  end subroutine classical_field

  !> Force density of each cell; where held and far from free cells without meaning.
  subroutine forces(disc, u, f)
    type(disc_type), intent(in) :: disc   !! the disc
    real(wp), intent(in) :: u(:, :, :)    !! displacements (cells, cells, 2)
    real(wp), intent(out) :: f(:, :, :)   !! (cells, cells, 2)
    real(wp) :: p(disc%cells, disc%cells), pull(disc%cells)
    integer :: k, j, i, a, b, di, dj

    p = 0.0_wp
    if (abs(disc%dilatation) > 0.0_wp) then
      do k = 1, size(disc%kinds)
        associate (kind => disc%kinds(k))
          di = kind%step(1)
          dj = kind%step(2)
          do j = 1, disc%cells - dj
            a = disc%first(j)
            b = disc%last(j)
            call stretches(disc, u, k, j, pull)
            do i = a, b
              p(i, j) = p(i, j) + kind%spread*pull(i)
            end do
            do i = a, b
              p(i + di, j + dj) = p(i + di, j + dj) + kind%spread*pull(i)
            end do
          end do
        end associate
      end do
      p = disc%dilatation*p
    end if
    f = 0.0_wp
    do k = 1, size(disc%kinds)
      associate (kind => disc%kinds(k))
        di = kind%step(1)
        dj = kind%step(2)
        do j = 1, disc%cells - dj
          a = disc%first(j)
          b = disc%last(j)
          call stretches(disc, u, k, j, pull)
          if (abs(disc%dilatation) > 0.0_wp) then
            do i = a, b
              pull(i) = kind%pull*pull(i) + (p(i, j) + p(i + di, j + dj))*kind%spread/kind%length &
                & *disc%intact(i, j, k)
            end do
          else
            pull(a:b) = kind%pull*pull(a:b)
          end if
          do i = a, b
            f(i, j, 1) = f(i, j, 1) + kind%along(1)*pull(i)
            f(i, j, 2) = f(i, j, 2) + kind%along(2)*pull(i)
          end do
          do i = a, b
            f(i + di, j + dj, 1) = f(i + di, j + dj, 1) - kind%along(1)*pull(i)
            f(i + di, j + dj, 2) = f(i + di, j + dj, 2) - kind%along(2)*pull(i)
          end do
        end do
      end associate
    end do
  end subroutine forces

  !> Stretches of the bonds of a kind at the cells of a row that matter; 0 where broken.
  pure subroutine stretches(disc, u, k, j, s)
    type(disc_type), intent(in) :: disc
    real(wp), intent(in) :: u(:, :, :)
    integer, intent(in) :: k, j         !! kind and row
    real(wp), intent(inout) :: s(:)     !! (cells)
    real(wp) :: cx, cy
    integer :: i, di, dj

    associate (kind => disc%kinds(k))
      di = kind%step(1)
      dj = kind%step(2)
      cx = kind%along(1)/kind%length
      cy = kind%along(2)/kind%length
      do i = disc%first(j), disc%last(j)
        s(i) = (cx*(u(i + di, j + dj, 1) - u(i, j, 1)) + cy*(u(i + di, j + dj, 2) - u(i, j, 2))) &
          & *disc%intact(i, j, k)
      end do
    end associate
  end subroutine stretches

  !> Equilibrium of the free cells, by conjugate gradients.
  subroutine relax(disc, tolerance, u, iterations)
    type(disc_type), intent(in) :: disc      !! the disc
    real(wp), intent(in) :: tolerance        !! of the forces, over those at held cells
    real(wp), intent(inout) :: u(:, :, :)    !! a start (cells, cells, 2), held cells in place
    integer, intent(inout) :: iterations     !! those of this solve are added
    real(wp), allocatable :: r(:, :, :), d(:, :, :), product(:, :, :)
    real(wp) :: now, before, goal, step
    integer :: n, c

    allocate (r, d, product, mold=u)
    call forces(disc, u, r)
    goal = 0.0_wp
    do c = 1, 2
      goal = goal + sum((r(:, :, c)*(1 - disc%free))**2)
      r(:, :, c) = r(:, :, c)*disc%free
    end do
    goal = tolerance**2*goal
    d = r
    now = sum(r**2)
    do n = 1, most_iterations
      if (now <= goal) return
      call forces(disc, d, product)
      do c = 1, 2
        product(:, :, c) = -product(:, :, c)*disc%free
      end do
      step = sum(d*product)
      if (.not. step > 0.0_wp) return  ! a point without bonds has no stiffness
      step = now/step
      u = u + step*d
      r = r - step*product
      before = now
      now = sum(r**2)
      d = r + now/before*d
      iterations = iterations + 1
    end do
  end subroutine relax

  !> The intact bond with the largest stretch, of those with a free end.
  subroutine most_stretched(disc, u, s, bond)
    type(disc_type), intent(in) :: disc    !! the disc
    real(wp), intent(in) :: u(:, :, :)     !! displacements (cells, cells, 2)
    real(wp), intent(out) :: s             !! its stretch; 0 if no bond is stretched
    integer, intent(out) :: bond(3)        !! cell of one end, and kind
    real(wp) :: row(disc%cells)
    integer :: i, j, k

    s = 0.0_wp
    bond = 0
    do k = 1, size(disc%kinds)
      associate (step => disc%kinds(k)%step)
        do j = 1, disc%cells - step(2)
          call stretches(disc, u, k, j, row)
          do i = disc%first(j), disc%last(j)
            if (row(i) <= s) cycle
            if (disc%free(i, j) + disc%free(i + step(1), j + step(2)) < 0.5_wp) cycle
            s = row(i)
            bond = [i, j, k]
          end do
        end do
      end associate
    end do
  end subroutine most_stretched

end module pd_set_up_toughness_disc
