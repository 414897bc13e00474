!> The linear conditions on the weights of bonds (doc/theory.md, 4): for each class of points a few
!> rows, for each group of bonds an unknown. Where surface areas are unknowns, too, Gb, Gd and areas
!> have one set of conditions. The coefficients of a bond are powers of its direction, and are
!> computed whenever they are needed: reading them would take longer.
module pd_set_up_consistent_conditions
  use pd_base_kinds, only: wp, i4, i8
  use pd_body_body, only: body_type
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  use pd_force_model, only: bond_factors_of, model_type
  use pd_law_material, only: material_type
  use pd_set_up_consistent_groups, only: changeable_axes, groups_type
  implicit none (type, external)
  private
  public :: conditions_type, stretch_conditions, dilatation_conditions, join_conditions, kind_of, &
    & of_stretches, of_dilatation, of_area, coefficients, most_rows, few, triple_products, &
    & area_products

  !> What an unknown is.
  integer, parameter :: of_stretches = 1   !! a weight Gb
  integer, parameter :: of_dilatation = 2  !! a weight Gd
  integer, parameter :: of_area = 3        !! a component of an area

  integer, parameter :: most_rows = 19  !! of a class
  integer, parameter :: few = 1000
    !! classes, or splines, up to which one thread does an iteration's loops: others take longer to
    !! start

  !> sum over bonds of weight x coefficients = `right`. The unknowns are weights Gb, then weights
  !> Gd, then components of areas. The rows of the stretch, n n n of the bonds, come before those
  !> of the dilatation, n n, and n over |xi|. What is said of bonds holds for areas, too.
  type :: conditions_type
    integer :: dim = 0
    integer :: stretches = 0                !! unknowns that are Gb; there are such rows if any
    integer :: dilatations = 0              !! unknowns that are Gd; there are such rows if any
    integer :: before = 0                   !! rows of the stretch
    integer :: rows = 0                     !! of each class
    integer :: classes = 0
    integer :: unknowns = 0
    integer(i8), allocatable :: start(:)    !! (classes + 1) first bond of each class
    integer(i8), allocatable :: last(:, :)  !! (2, classes) last bond of each class whose unknown is
                                            !! a Gb, and last one where it is a Gd
    integer(i4), allocatable :: unknown(:)  !! of each bond
    real(wp), allocatable :: n(:, :)        !! (bonds, dim) unit vectors
    real(wp), allocatable :: factor(:, :)
      !! (bonds, 2) of the powers; the second of n alone; of areas: for either kind of rows
    real(wp), allocatable :: right(:, :)    !! (rows, classes)
    real(wp), allocatable :: of_area(:)
      !! (classes) what rows of one kind have for a unit of `area`, as it was given
    integer(i8), allocatable :: first(:)    !! (unknowns + 1) first entry of each unknown
    integer(i8), allocatable :: bond(:)     !! bonds of each unknown
    integer(i4), allocatable :: class(:)    !! of each bond
    logical :: alone = .false.              !! whether each unknown is of one bond, or an area's
    logical :: placed = .false.             !! whether multipliers are smooth fields, as in
                                            !! `groups_type`
    real(wp), allocatable :: counts(:)      !! (unknowns) how much a change counts, squared
    real(wp), allocatable :: base(:)        !! (unknowns) weight that a value of 1 stands for; not
                                            !! allocated: 1
    ! what multipliers of smooth fields depend on:
    real(wp) :: longest = 0.0_wp            !! component of a bond [m]
    real(wp) :: spacing = 0.0_wp            !! mean of the classes' first points [m]
    real(wp), allocatable :: x(:, :)        !! (dim, classes) positions of these points [m]
    real(wp), allocatable :: stiffness(:)   !! (classes) what makes a field multipliers of n n n
    real(wp), allocatable :: strain(:)      !! (classes) what makes a gradient multipliers of n n
    real(wp), allocatable :: shift(:)       !! (classes) what makes a vector multipliers of n/|xi|
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
    real(wp) :: values(most_rows), total, q, gb, gd
    integer :: c, k, i

    call begin(body, .true., groups, conditions)
    allocate (conditions%stiffness(conditions%classes))
    call allocate_bonds(family, bonds)
    do c = 1, conditions%classes
      k = int(groups%first(c))
      call family%bonds_of(k, bonds)
      associate (first => conditions%start(c) - 1)
        total = 0.0_wp
        call note_longest(bonds, conditions)
        do i = 1, bonds%n
          q = materials(body%material(k))%q + materials(body%material(bonds%j(i)))%q
          if (present(model)) then
            call bond_factors_of(model, k, int(bonds%j(i)), bonds%length(i), gb, gd)
            q = q*gb
          end if
          conditions%n(first + i, :) = bonds%xi(i, :)/bonds%length(i)
          conditions%factor(first + i, :) = [q*bonds%weight(i), 0.0_wp]
          total = total + q*bonds%weight(i)
        end do
        conditions%factor(first + 1:first + bonds%n, :) &
          & = conditions%factor(first + 1:first + bonds%n, :)/total
      end associate
      conditions%of_area(c) = 1/(body%volume(k)*total)
      conditions%stiffness(c) = body%volume(k)*total
      call area_products(area(k, :), values)
      conditions%right(:, c) = -values(:conditions%rows)/(body%volume(k)*total)
    end do
    ! their size is of no account
    conditions%stiffness = conditions%stiffness/maxval(conditions%stiffness)
    if (allocated(groups%known_b)) call take_known(groups%known_b, conditions)
    call turn(conditions)
  end subroutine stretch_conditions

  !> Conditions on Gd: theta is the strain's trace, and the force of equal p is that of the
  !> classical traction: t sum_j Gd vc V_j n_a n_b = d_ab, and t sum_j (a_k + a_j) Gd vc V_j
  !> n_a/|xi| = -A_a/V_k, with A the sum over regions of a x area. The second rows are multiplied
  !> with the spacing over the largest a.
  subroutine dilatation_conditions(body, family, materials, a, groups, area, conditions, model)
    type(body_type), intent(in) :: body              !! that the groups were found for
    class(family_type), intent(in) :: family         !! whole
    type(material_type), intent(in) :: materials(:)  !! (any number) by the points' numbers
    real(wp), intent(in) :: a(:)                     !! (materials) a of each, over the largest [-]
    type(groups_type), intent(in) :: groups          !! of its bonds
    real(wp), intent(in) :: area(:, :)  !! (n_slots, dim) a x area, summed over regions [m2]
    type(conditions_type), intent(out) :: conditions
    type(model_type), intent(in), optional :: model  !! where points have horizons of their own
    type(bonds_type) :: bonds
    real(wp) :: gb, gd
    integer :: c, k, i, row, x, y

    call begin(body, .false., groups, conditions)
    call allocate_bonds(family, bonds)
    do c = 1, conditions%classes
      k = int(groups%first(c))
      call family%bonds_of(k, bonds)
      associate (first => conditions%start(c) - 1, t => materials(body%material(k))%t)
        call note_longest(bonds, conditions)
        do i = 1, bonds%n
          conditions%n(first + i, :) = bonds%xi(i, :)/bonds%length(i)
          conditions%factor(first + i, :) = t*bonds%weight(i)*[1.0_wp, (a(body%material(k)) &
            & + a(body%material(bonds%j(i))))*body%spacing(k)/bonds%length(i)]
          if (.not. present(model)) cycle
          call bond_factors_of(model, k, int(bonds%j(i)), bonds%length(i), gb, gd)
          conditions%factor(first + i, :) = gd*conditions%factor(first + i, :)
        end do
      end associate
      row = 0
      do x = 1, body%dim
        do y = x, body%dim
          row = row + 1
          conditions%right(row, c) = merge(1.0_wp, 0.0_wp, x == y)
        end do
      end do
      conditions%of_area(c) = body%spacing(k)/body%volume(k)
      conditions%right(row + 1:, c) = -area(k, :)*body%spacing(k)/body%volume(k)
    end do
    if (allocated(groups%known_d)) call take_known(groups%known_d, conditions)
    call turn(conditions)
    call note_smooth(body, materials, a, groups, conditions)
  end subroutine dilatation_conditions

  pure subroutine note_longest(bonds, conditions)
    type(bonds_type), intent(in) :: bonds
    type(conditions_type), intent(inout) :: conditions
    integer :: d

    do d = 1, conditions%dim
      conditions%longest = max(conditions%longest, maxval(abs(bonds%xi(:bonds%n, d))))
    end do
  end subroutine note_longest

  !> Take bonds without a group out of the conditions: what their known weights give goes to the
  !> right side. Others are counted from theirs.
  subroutine take_known(known, conditions)
    real(wp), intent(in) :: known(:)                    ! (bonds) weights [-]
    type(conditions_type), intent(inout) :: conditions  ! unknowns not yet turned
    real(wp) :: values(most_rows)
    logical, allocatable :: kept(:)
    integer(i8), allocatable :: start(:)
    integer(i8) :: e
    integer :: c, low, high

    allocate (kept, source=conditions%unknown > 0)
    allocate (start, source=conditions%start)
    start(1) = 1_i8
    do c = 1, conditions%classes
      do e = conditions%start(c), conditions%start(c + 1) - 1
        ! all unknowns of these conditions are of one kind
        if (.not. kept(e)) conditions%unknown(e) = 1_i4
        call coefficients(conditions, e, values, low, high)
        conditions%right(low:high, c) = conditions%right(low:high, c) &
          & - (known(e) - merge(1.0_wp, 0.0_wp, kept(e)))*values(low:high)
      end do
      start(c + 1) = start(c) + count(kept(conditions%start(c):conditions%start(c + 1) - 1))
    end do
    conditions%start = start
    conditions%unknown = pack(conditions%unknown, kept)
    allocate (conditions%base(conditions%unknowns))
    conditions%base(conditions%unknown) = pack(known, kept)
    conditions%n = keep_rows(conditions%n)
    conditions%factor = keep_rows(conditions%factor)

  contains

    pure function keep_rows(values) result(rows)
      real(wp), intent(in) :: values(:, :)
      real(wp), allocatable :: rows(:, :)
      integer :: i

      allocate (rows(count(kept), size(values, 2)))
      do i = 1, size(values, 2)
        rows(:, i) = pack(values(:, i), kept)
      end do
    end function keep_rows

  end subroutine take_known

  !> Note what multipliers of smooth fields depend on: with w V/(t spacing) for the force and
  !> a V/t times the symmetric gradient of w for theta, a bond gets as good as nothing.
  subroutine note_smooth(body, materials, a, groups, conditions)
    type(body_type), intent(in) :: body
    type(material_type), intent(in) :: materials(:)
    real(wp), intent(in) :: a(:)
    type(groups_type), intent(in) :: groups
    type(conditions_type), intent(inout) :: conditions
    integer :: c, k

    allocate (conditions%strain(conditions%classes), conditions%shift(conditions%classes))
    do c = 1, conditions%classes
      k = int(groups%first(c))
      associate (part => body%volume(k)/materials(body%material(k))%t)
        conditions%strain(c) = part*a(body%material(k))
        conditions%shift(c) = part/body%spacing(k)
      end associate
    end do
    ! their size is of no account; so pivots and diagonals are of the order of 1
    conditions%strain = conditions%strain/maxval(conditions%shift)
    conditions%shift = conditions%shift/maxval(conditions%shift)
  end subroutine note_smooth

  !> Conditions on Gb, Gd and surface areas: an unknown of a class with a free area and of one of
  !> its `changeable_axes` changes that component by (its value - 1) x `unit`.
  subroutine join_conditions(groups, stretch, dilatation, mu, a, unit, conditions)
    type(groups_type), intent(in) :: groups
    type(conditions_type), intent(in) :: stretch      !! for the areas as they are
    type(conditions_type), intent(in) :: dilatation   !! of the same classes
    real(wp), intent(in) :: mu       !! what areas had been multiplied with in `stretch` [N/m2]
    real(wp), intent(in) :: a        !! and in `dilatation` [-]
    real(wp), intent(in) :: unit(:)  !! (classes) of the unknown areas, 0 where they are fixed [m2]
    type(conditions_type), intent(out) :: conditions
    real(wp) :: values(most_rows)
    integer, allocatable :: axes(:)
    integer(i8) :: n, at, e
    integer :: c, x, low, high

    conditions%dim = stretch%dim
    conditions%placed = stretch%placed
    conditions%longest = stretch%longest
    conditions%stretches = stretch%stretches
    conditions%dilatations = dilatation%dilatations
    conditions%before = stretch%rows
    conditions%rows = stretch%rows + dilatation%rows
    conditions%classes = stretch%classes
    conditions%unknowns = stretch%unknowns + dilatation%unknowns
    conditions%x = dilatation%x
    conditions%stiffness = stretch%stiffness
    conditions%strain = dilatation%strain
    conditions%shift = dilatation%shift
    conditions%spacing = dilatation%spacing
    n = size(stretch%unknown, kind=i8) + size(dilatation%unknown, kind=i8) &
      & + conditions%dim*count(unit > 0.0_wp)
    allocate (conditions%counts(conditions%unknowns + conditions%dim*count(unit > 0.0_wp)))
    conditions%counts(:conditions%unknowns) = [stretch%counts, dilatation%counts]
    allocate (conditions%start(conditions%classes + 1), source=1_i8)
    allocate (conditions%unknown(n), conditions%n(n, conditions%dim), conditions%factor(n, 2))
    allocate (conditions%right(conditions%rows, conditions%classes))
    conditions%right(:stretch%rows, :) = stretch%right
    conditions%right(stretch%rows + 1:, :) = dilatation%right
    at = 0_i8
    do c = 1, conditions%classes
      conditions%start(c) = at + 1
      call append(stretch, 0)
      call append(dilatation, stretch%unknowns)
      if (.not. unit(c) > 0.0_wp) cycle
      axes = changeable_axes(groups, c, conditions%dim)
      do x = 1, size(axes)
        at = at + 1
        conditions%unknowns = conditions%unknowns + 1
        conditions%unknown(at) = int(conditions%unknowns, i4)
        conditions%counts(conditions%unknowns) = real(groups%mirrored(c), wp)
        conditions%n(at, :) = 0.0_wp
        conditions%n(at, axes(x)) = 1.0_wp
        conditions%factor(at, :) = unit(c)*[mu*stretch%of_area(c), a*dilatation%of_area(c)]
        ! a value of 1 is no change
        call coefficients(conditions, at, values, low, high)
        conditions%right(low:high, c) = conditions%right(low:high, c) + values(low:high)
      end do
    end do
    conditions%start(conditions%classes + 1) = at + 1
    conditions%counts = conditions%counts(:conditions%unknowns)
    conditions%unknown = conditions%unknown(:at)
    conditions%n = conditions%n(:at, :)
    conditions%factor = conditions%factor(:at, :)
    if (allocated(stretch%base)) conditions%base = [stretch%base, dilatation%base, &
      & spread(1.0_wp, 1, conditions%unknowns - size(stretch%base) - size(dilatation%base))]
    call turn(conditions)

  contains

    subroutine append(part, unknowns)
      type(conditions_type), intent(in) :: part
      integer, intent(in) :: unknowns  ! before those of this part

      do e = part%start(c), part%start(c + 1) - 1
        at = at + 1
        conditions%unknown(at) = int(unknowns, i4) + part%unknown(e)
        conditions%n(at, :) = part%n(e, :)
        conditions%factor(at, :) = part%factor(e, :)
      end do
    end subroutine append

  end subroutine join_conditions

  !> Room for the conditions of all classes on Gb, or on Gd.
  subroutine begin(body, of_stretch, groups, conditions)
    type(body_type), intent(in) :: body
    logical, intent(in) :: of_stretch
    type(groups_type), intent(in) :: groups
    type(conditions_type), intent(inout) :: conditions
    integer(i8) :: n
    integer :: c, dim

    dim = body%dim
    conditions%dim = dim
    conditions%unknowns = groups%n_groups
    if (of_stretch) then
      conditions%stretches = groups%n_groups
      conditions%before = dim*(dim + 1)*(dim + 2)/6
      conditions%rows = conditions%before
    else
      conditions%dilatations = groups%n_groups
      conditions%rows = dim*(dim + 1)/2 + dim
    end if
    conditions%classes = groups%n_classes
    conditions%placed = groups%placed
    conditions%counts = real(groups%members, wp)
    conditions%start = groups%start
    conditions%unknown = groups%group
    n = size(conditions%unknown, kind=i8)
    allocate (conditions%n(n, dim), conditions%factor(n, 2))
    allocate (conditions%right(conditions%rows, groups%n_classes))
    allocate (conditions%of_area(groups%n_classes))
    allocate (conditions%x(dim, groups%n_classes))
    do c = 1, groups%n_classes
      conditions%x(:, c) = body%x(groups%first(c), :)
    end do
    conditions%spacing = sum(body%spacing(groups%first))/groups%n_classes
  end subroutine begin

  !> What an unknown is.
  pure integer function kind_of(conditions, u) result(kind)
    type(conditions_type), intent(in) :: conditions
    integer, intent(in) :: u  !! unknown

    if (u <= conditions%stretches) then
      kind = of_stretches
    else if (u <= conditions%stretches + conditions%dilatations) then
      kind = of_dilatation
    else
      kind = of_area
    end if
  end function kind_of

  !> Note the bonds of each unknown, and the kinds of unknowns of each class.
  subroutine turn(conditions)
    type(conditions_type), intent(inout) :: conditions
    integer(i8), allocatable :: next(:)
    integer(i8) :: e
    integer :: c, u, kind

    allocate (conditions%last(2, conditions%classes))
    do c = 1, conditions%classes
      conditions%last(:, c) = conditions%start(c) - 1
      ! the unknowns of one kind have numbers above those of the kind before
      do e = conditions%start(c), conditions%start(c + 1) - 1
        kind = kind_of(conditions, int(conditions%unknown(e)))
        if (kind /= of_area) conditions%last(kind:, c) = e
      end do
    end do

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
    associate (bonds => conditions%stretches + conditions%dilatations, first => conditions%first)
      conditions%alone = all(first(2:bonds + 1) - first(:bonds) == 2_i8)
    end associate
  end subroutine turn

  !> The coefficients of bond `e`: those from row `low` to row `high` are set, others are 0.
  pure subroutine coefficients(conditions, e, values, low, high)
    type(conditions_type), intent(in) :: conditions
    integer(i8), intent(in) :: e          !! bond, or a component of an area
    real(wp), intent(inout) :: values(:)  !! (`most_rows`) some are set [-]
    integer, intent(out) :: low           !! first row that is set
    integer, intent(out) :: high          !! last one
    integer :: row, x, y

    associate (n => conditions%n(e, :), f => conditions%factor(e, :), dim => conditions%dim, &
      & before => conditions%before)
      select case (kind_of(conditions, int(conditions%unknown(e))))
      case (of_stretches)
        low = 1
        high = before
        call triple_products(n, values)
        values(:high) = f(1)*values(:high)
      case (of_dilatation)
        low = before + 1
        high = conditions%rows
        row = before
        do x = 1, dim
          do y = x, dim
            row = row + 1
            values(row) = f(1)*n(x)*n(y)
          end do
        end do
        values(row + 1:high) = f(2)*n
      case default
        low = 1
        high = conditions%rows
        call area_products(n, values)
        values(:before) = f(1)*values(:before)
        values(before + 1:high - dim) = 0.0_wp
        values(high - dim + 1:high) = f(2)*n
      end select
    end associate
  end subroutine coefficients

  !> n_a n_b n_c, row by row.
  pure subroutine triple_products(n, values)
    real(wp), intent(in) :: n(:)            !! (dim) [-]
    real(wp), intent(inout) :: values(:)    !! the first 1, 4 or 10 are set
    integer :: row, x, y, z

    row = 0
    do x = 1, size(n)
      do y = x, size(n)
        do z = y, size(n)
          row = row + 1
          values(row) = n(x)*n(y)*n(z)
        end do
      end do
    end do
  end subroutine triple_products

  !> n_a d_bc + n_b d_ac + n_c d_ab, row by row.
  pure subroutine area_products(n, values)
    real(wp), intent(in) :: n(:)            !! (dim) [-]
    real(wp), intent(inout) :: values(:)    !! the first 1, 4 or 10 are set
    integer :: row, x, y, z

    row = 0
    do x = 1, size(n)
      do y = x, size(n)
        do z = y, size(n)
          row = row + 1
          values(row) = merge(n(x), 0.0_wp, y == z) + merge(n(y), 0.0_wp, x == z) &
            & + merge(n(z), 0.0_wp, x == y)
        end do
      end do
    end do
  end subroutine area_products

end module pd_set_up_consistent_conditions
