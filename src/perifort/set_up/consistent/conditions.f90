!> The linear conditions on the weights of bonds, and sums of them (doc/theory.md, 4): for each
!> class of points a few rows, for each group of bonds an unknown. The coefficients of a bond are
!> powers of its direction, so they are computed where they are needed.
module pd_set_up_consistent_conditions
  use pd_base_kinds, only: wp, i4, i8
  use pd_body_body, only: body_type
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  use pd_force_model, only: bond_factors_of, model_type
  use pd_law_material, only: material_type
  use pd_set_up_consistent_groups, only: groups_type
  implicit none (type, external)
  private
  public :: conditions_type, stretch_conditions, dilatation_conditions, sums_of, spread_over, &
    & block_of

  integer, parameter :: most_rows = 10  !! of a class

  !> sum over bonds of weight x coefficients = `right`.
  type :: conditions_type
    integer :: dim = 0
    logical :: cubic = .false.              !! n n n of the bonds; else n n, and n over |xi|
    integer :: rows = 0                     !! of each class
    integer :: classes = 0
    integer :: unknowns = 0
    integer(i8), allocatable :: start(:)    !! (classes + 1) first bond of each class
    integer(i4), allocatable :: unknown(:)  !! of each bond
    real(wp), allocatable :: n(:, :)        !! (dim, bonds) unit vectors
    real(wp), allocatable :: factor(:, :)   !! (2, bonds) of the powers; the second of n alone
    real(wp), allocatable :: right(:, :)    !! (rows, classes)
    integer(i8), allocatable :: first(:)    !! (unknowns + 1) first entry of each unknown
    integer(i8), allocatable :: bond(:)     !! bonds of each unknown
    integer(i4), allocatable :: class(:)    !! of each bond
    ! where each class is a point, each unknown a bond with two ends or a component of an area, and
    ! n n, and n over |xi|:
    real(wp), allocatable :: x(:, :)        !! (dim, points) positions [m]
    real(wp), allocatable :: strain(:)      !! (points) what makes a gradient multipliers of n n
    real(wp), allocatable :: shift(:)       !! (points) what makes a vector multipliers of n/|xi|
    real(wp) :: spacing = 0.0_wp            !! mean of the points [m]
  end type conditions_type

contains

  !> Conditions on Gb: under every uniform strain the stretches' force on a point is that of the
  !> classical traction on its surface area,
  !> sum_j (q_k + q_j) Gb vc V_j n_a n_b n_c = -(A_a d_bc + A_b d_ac + A_c d_ab)/V_k, with A the sum
  !> over regions of mu x area. The rows of a class are divided by its sum of (q_k + q_j) vc V_j.
  subroutine stretch_conditions(body, family, materials, groups, area, conditions, model)
    type(body_type), intent(in) :: body              !! that the groups were found for
    class(family_type), intent(in) :: family         !! whole
    type(material_type), intent(in) :: materials(:)  !! (any number) by the points' numbers
    type(groups_type), intent(in) :: groups          !! of its bonds
    real(wp), intent(in) :: area(:, :)
      !! (n_slots, dim) mu x area, summed over regions; in 1D E/3 x cross section [N]
    type(conditions_type), intent(out) :: conditions
    type(model_type), intent(in), optional :: model  !! where points have horizons of their own
    type(bonds_type) :: bonds
    real(wp) :: total, q, gb, gd
    integer :: c, k, i, row, x, y, z

    call begin(body%dim, .true., groups, conditions)
    call allocate_bonds(family, bonds)
    do c = 1, conditions%classes
      k = int(groups%first(c))
      call family%bonds_of(k, bonds)
      associate (first => conditions%start(c) - 1)
        total = 0.0_wp
        do i = 1, bonds%n
          q = materials(body%material(k))%q + materials(body%material(bonds%j(i)))%q
          if (present(model)) then
            call bond_factors_of(model, k, int(bonds%j(i)), bonds%length(i), gb, gd)
            q = q*gb
          end if
          conditions%n(:, first + i) = bonds%xi(i, :)/bonds%length(i)
          conditions%factor(:, first + i) = [q*bonds%weight(i), 0.0_wp]
          total = total + q*bonds%weight(i)
        end do
        conditions%factor(:, first + 1:first + bonds%n) &
          & = conditions%factor(:, first + 1:first + bonds%n)/total
      end associate
      row = 0
      do x = 1, body%dim
        do y = x, body%dim
          do z = y, body%dim
            row = row + 1
            conditions%right(row, c) = -(merge(area(k, x), 0.0_wp, y == z) &
              & + merge(area(k, y), 0.0_wp, x == z) + merge(area(k, z), 0.0_wp, x == y)) &
              & /(body%volume(k)*total)
          end do
        end do
      end do
    end do
    call turn(conditions)
  end subroutine stretch_conditions

  !> Conditions on Gd: theta is the strain's trace, and the force of equal p is that of the
  !> classical traction: t sum_j Gd vc V_j n_a n_b = d_ab, and t sum_j (a_k + a_j) Gd vc V_j
  !> n_a/|xi| = -A_a/V_k, with A the sum over regions of a x area. The second rows are multiplied
  !> with the spacing over the largest a. With `free_area` the areas of some points are unknowns,
  !> too: an unknown of such a point and axis changes the area by (its value - 1) x `free_area`.
  subroutine dilatation_conditions(body, family, materials, a, groups, area, conditions, model, &
    & free_area)
    type(body_type), intent(in) :: body              !! that the groups were found for
    class(family_type), intent(in) :: family         !! whole
    type(material_type), intent(in) :: materials(:)  !! (any number) by the points' numbers
    real(wp), intent(in) :: a(:)                     !! (materials) a of each, over the largest [-]
    type(groups_type), intent(in) :: groups          !! of its bonds
    real(wp), intent(in) :: area(:, :)  !! (n_slots, dim) a x area, summed over regions [m2]
    type(conditions_type), intent(out) :: conditions
    type(model_type), intent(in), optional :: model  !! where points have horizons of their own
    real(wp), intent(in), optional :: free_area(:)
      !! (n_slots) unit of the unknown areas, 0 where an area is fixed; each point is a class [m2]
    type(bonds_type) :: bonds
    real(wp) :: gb, gd
    integer :: c, k, i, row, x, y

    call begin(body%dim, .false., groups, conditions, free_area)
    call allocate_bonds(family, bonds)
    do c = 1, conditions%classes
      k = int(groups%first(c))
      call family%bonds_of(k, bonds)
      associate (first => conditions%start(c) - 1, t => materials(body%material(k))%t)
        do i = 1, bonds%n
          conditions%n(:, first + i) = bonds%xi(i, :)/bonds%length(i)
          conditions%factor(:, first + i) = t*bonds%weight(i)*[1.0_wp, (a(body%material(k)) &
            & + a(body%material(bonds%j(i))))*body%spacing(k)/bonds%length(i)]
          if (.not. present(model)) cycle
          call bond_factors_of(model, k, int(bonds%j(i)), bonds%length(i), gb, gd)
          conditions%factor(:, first + i) = gd*conditions%factor(:, first + i)
        end do
      end associate
      row = 0
      do x = 1, body%dim
        do y = x, body%dim
          row = row + 1
          conditions%right(row, c) = merge(1.0_wp, 0.0_wp, x == y)
        end do
      end do
      conditions%right(row + 1:, c) = -area(k, :)*body%spacing(k)/body%volume(k)
      if (.not. present(free_area)) cycle
      if (.not. free_area(k) > 0.0_wp) cycle
      associate (first => conditions%start(c) + bonds%n - 1, &
        & unit => free_area(k)*body%spacing(k)/body%volume(k))
        do x = 1, body%dim
          conditions%n(:, first + x) = 0.0_wp
          conditions%n(x, first + x) = 1.0_wp
          conditions%factor(:, first + x) = [0.0_wp, unit]
        end do
        ! a value of 1 is no change
        conditions%right(row + 1:, c) = conditions%right(row + 1:, c) + unit
      end associate
    end do
    call turn(conditions)
    associate (first => conditions%first, n => groups%n_groups)
      if (all(first(2:n + 1) - first(:n) == 2_i8)) &
        & call note_points(body, materials, a, groups, conditions)
    end associate
  end subroutine dilatation_conditions

  !> Note what multipliers of smooth fields depend on: with w V/(t spacing) for the force and
  !> a V/t times the symmetric gradient of w for theta, a bond gets as good as nothing.
  subroutine note_points(body, materials, a, groups, conditions)
    type(body_type), intent(in) :: body
    type(material_type), intent(in) :: materials(:)
    real(wp), intent(in) :: a(:)
    type(groups_type), intent(in) :: groups
    type(conditions_type), intent(inout) :: conditions
    integer :: c, k

    allocate (conditions%x(body%dim, conditions%classes))
    allocate (conditions%strain(conditions%classes), conditions%shift(conditions%classes))
    do c = 1, conditions%classes
      k = int(groups%first(c))
      conditions%x(:, c) = body%x(k, :)
      associate (part => body%volume(k)/materials(body%material(k))%t)
        conditions%strain(c) = part*a(body%material(k))
        conditions%shift(c) = part/body%spacing(k)
      end associate
      conditions%spacing = conditions%spacing + body%spacing(k)/conditions%classes
    end do
    ! their size is of no account; so pivots and diagonals are of the order of 1
    conditions%strain = conditions%strain/maxval(conditions%shift)
    conditions%shift = conditions%shift/maxval(conditions%shift)
  end subroutine note_points

  !> Room for the conditions of all classes. Unknown areas come after the groups, and after the
  !> bonds of their class.
  subroutine begin(dim, cubic, groups, conditions, free_area)
    integer, intent(in) :: dim
    logical, intent(in) :: cubic
    type(groups_type), intent(in) :: groups
    type(conditions_type), intent(inout) :: conditions
    real(wp), intent(in), optional :: free_area(:)
    integer(i8) :: n
    integer :: c, x

    conditions%dim = dim
    conditions%cubic = cubic
    conditions%rows = merge(dim*(dim + 1)*(dim + 2)/6, dim*(dim + 1)/2 + dim, cubic)
    conditions%classes = groups%n_classes
    conditions%unknowns = groups%n_groups
    conditions%start = groups%start
    if (present(free_area)) then
      do c = 1, groups%n_classes
        conditions%start(c + 1) = conditions%start(c) + groups%start(c + 1) - groups%start(c) &
          & + merge(dim, 0, free_area(groups%first(c)) > 0.0_wp)
      end do
      allocate (conditions%unknown(conditions%start(groups%n_classes + 1) - 1))
      do c = 1, groups%n_classes
        n = conditions%start(c) + groups%start(c + 1) - groups%start(c)
        conditions%unknown(conditions%start(c):n - 1) = &
          & groups%group(groups%start(c):groups%start(c + 1) - 1)
        do x = 1, merge(dim, 0, free_area(groups%first(c)) > 0.0_wp)
          conditions%unknowns = conditions%unknowns + 1
          conditions%unknown(n + x - 1) = int(conditions%unknowns, i4)
        end do
      end do
    else
      conditions%unknown = groups%group
    end if
    n = size(conditions%unknown, kind=i8)
    allocate (conditions%n(dim, n), conditions%factor(2, n))
    allocate (conditions%right(conditions%rows, groups%n_classes))
  end subroutine begin

  !> Note the bonds of each unknown.
  subroutine turn(conditions)
    type(conditions_type), intent(inout) :: conditions
    integer(i8), allocatable :: next(:)
    integer(i8) :: e
    integer :: c, u

    allocate (conditions%first(conditions%unknowns + 1), source=0_i8)
    allocate (conditions%bond(size(conditions%unknown)), conditions%class(size(conditions%unknown)))
    do e = 1, size(conditions%unknown)
      u = int(conditions%unknown(e))
      conditions%first(u + 1) = conditions%first(u + 1) + 1
    end do
    conditions%first(1) = 1_i8
    do u = 1, conditions%unknowns
      conditions%first(u + 1) = conditions%first(u) + conditions%first(u + 1)
    end do
    next = conditions%first
    do c = 1, conditions%classes
      do e = conditions%start(c), conditions%start(c + 1) - 1
        u = int(conditions%unknown(e))
        conditions%bond(next(u)) = e
        conditions%class(e) = int(c, i4)
        next(u) = next(u) + 1
      end do
    end do
  end subroutine turn

  !> The coefficients of bond `e`.
  pure subroutine coefficients(conditions, e, values)
    type(conditions_type), intent(in) :: conditions
    integer(i8), intent(in) :: e
    real(wp), intent(inout) :: values(:)  ! the first `rows` are set
    integer :: row, x, y, z

    associate (n => conditions%n(:, e), f => conditions%factor(:, e), dim => conditions%dim)
      row = 0
      do x = 1, dim
        do y = x, dim
          if (conditions%cubic) then
            do z = y, dim
              row = row + 1
              values(row) = f(1)*n(x)*n(y)*n(z)
            end do
          else
            row = row + 1
            values(row) = f(1)*n(x)*n(y)
          end if
        end do
      end do
      if (conditions%cubic) return
      do x = 1, dim
        values(row + x) = f(2)*n(x)
      end do
    end associate
  end subroutine coefficients

  !> The sums of the conditions (rows, classes) for values of the unknowns.
  subroutine sums_of(conditions, y, sums)
    type(conditions_type), intent(in) :: conditions
    real(wp), intent(in) :: y(:)           !! (unknowns) [-]
    real(wp), intent(inout) :: sums(:, :)  !! (rows, classes) set [-]
    real(wp) :: values(most_rows), sum(most_rows)
    integer(i8) :: e
    integer :: c

    !$omp parallel do schedule(dynamic, 64) default(none) shared(conditions, y, sums) &
    !$omp private(values, sum, e, c)
    do c = 1, conditions%classes
      sum = 0.0_wp
      values = 0.0_wp
      do e = conditions%start(c), conditions%start(c + 1) - 1
        call coefficients(conditions, e, values)
        sum = sum + y(conditions%unknown(e))*values
      end do
      sums(:, c) = sum(:conditions%rows)
    end do
  end subroutine sums_of

  !> The transposed product: what multipliers of the conditions give each unknown.
  subroutine spread_over(conditions, multipliers, y)
    type(conditions_type), intent(in) :: conditions
    real(wp), intent(in) :: multipliers(:, :)  !! (rows, classes) [-]
    real(wp), intent(inout) :: y(:)            !! (unknowns) set [-]
    real(wp) :: values(most_rows)
    integer(i8) :: i
    integer :: u

    !$omp parallel do schedule(dynamic, 512) default(none) shared(conditions, multipliers, y) &
    !$omp private(values, i, u)
    do u = 1, conditions%unknowns
      y(u) = 0.0_wp
      do i = conditions%first(u), conditions%first(u + 1) - 1
        associate (e => conditions%bond(i))
          call coefficients(conditions, e, values)
          y(u) = y(u) + dot_product(values(:conditions%rows), &
            & multipliers(:, conditions%class(e)))
        end associate
      end do
    end do
  end subroutine spread_over

  !> The block (rows, rows) of class `c` in the product of the conditions with their transpose, of
  !> the unknowns that are `free`.
  pure subroutine block_of(conditions, c, free, block)
    type(conditions_type), intent(in) :: conditions
    integer, intent(in) :: c              !! class
    logical, intent(in) :: free(:)        !! (unknowns)
    real(wp), intent(out) :: block(:, :)  !! (rows, rows) [-]
    real(wp) :: values(most_rows), of_unknown(most_rows)
    integer(i8) :: e, i
    integer :: row

    block = 0.0_wp
    do e = conditions%start(c), conditions%start(c + 1) - 1
      associate (u => conditions%unknown(e))
        if (.not. free(u)) cycle
        ! all bonds of the class with this unknown, at the first of them
        of_unknown = 0.0_wp
        values = 0.0_wp
        do i = conditions%first(u), conditions%first(u + 1) - 1
          if (conditions%class(conditions%bond(i)) /= c) cycle
          if (conditions%bond(i) < e) exit
          call coefficients(conditions, conditions%bond(i), values)
          of_unknown = of_unknown + values
        end do
        if (i < conditions%first(u + 1)) cycle
      end associate
      do row = 1, conditions%rows
        block(:, row) = block(:, row) + of_unknown(row)*of_unknown(:conditions%rows)
      end do
    end do
  end subroutine block_of

end module pd_set_up_consistent_conditions
