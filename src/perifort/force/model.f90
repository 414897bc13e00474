!> What the force loops need to know beside the family: parameters of each slot, and which terms the
!> scene has. Chosen once before the loop, so that a step costs only what the scene uses.
module pd_force_model
  use pd_base_error, only: internal_fault
  use pd_base_reduce, only: any_of_ranks, largest_of_ranks
  use pd_base_kinds, only: wp, i1, i2, i8
  use pd_body_body, only: body_type, number_at
  use pd_family_bond_weights, only: bond_weights_type
  use pd_family_volume, only: volume_rule_type
  use pd_law_laws, only: law_item_type
  use pd_law_material, only: material_type, never
  use pd_law_strength, only: strength_factor
  use pd_law_weighted, only: weighted_law_type
  implicit none (type, external)
  private
  public :: model_type, new_model, force_options_type, options_of, no_fail, bond_limit, early
  public :: follows, bond_factors_of, q_of, t_of, p_of, has_scales, give_horizons
  public :: dilatation_of, no_dilatation, projected, unprojected

  real(wp), parameter :: no_fail = -1.0_wp  !! critical stretch of a slot in a no-fail zone
  !> Loops mark slots with a bond at this part of its critical stretch: the margin covers their
  !> rounding, and `pd_force_breaking` evaluates the exact criterion for marked slots only.
  real(wp), parameter :: early = 1 - 1.0e-9_wp

  !> Kinds of dilatation that loops are compiled for: the force has none; it has the factor Lambda
  !> as printed; Lambda = 1.
  integer, parameter :: no_dilatation = 1, projected = 2, unprojected = 3

  !> What an evaluation of the forces takes in. It is given by value with each evaluation: whoever
  !> needs other forces than the model's asks for them so, and the model stays as it is.
  type :: force_options_type
    logical :: dilatation = .false.   !! the dilatation's part of the force
    logical :: projected = .true.     !! Lambda = yhat . xi/|xi| as printed, else Lambda = 1
    logical :: thermal = .false.      !! thermal strain
    logical :: double = .false.       !! bonds in double precision, whatever the family has
  end type force_options_type

  type :: model_type
    integer :: dim = 0
    logical :: dilatation = .false.   !! some a /= 0: the force needs the dilatation of both ends
    logical :: projected = .true.     !! Lambda = yhat . xi/|xi| as printed, else Lambda = 1
    logical :: surface = .false.      !! factors Gd and Gb differ from 1
    logical :: consistent = .false.   !! each bond has Gd and Gb of its own, in `weights`
    logical :: thermal = .false.      !! some temperature change
    logical :: breaking = .false.     !! some bond can fail
    logical :: compression = .false.  !! some bonds break in compression too
    logical :: weighted = .false.     !! bonds have factors of their length, from the laws
    logical :: generic = .false.      !! the generic pass computes the forces, by the laws
    type(material_type), allocatable :: materials(:)
    type(law_item_type), allocatable :: laws(:)  !! of the materials; not allocated: the chapter's
    integer(i2), allocatable :: material(:)  !! of each slot
    real(wp), allocatable :: scale(:)        !! of q, t and p of each slot, if some law has scales
    real(wp), allocatable :: horizon(:)      !! of each slot, if points have their own [m]
    real(wp), allocatable :: of_stretch(:)   !! factor of the stretches for that horizon,
    real(wp), allocatable :: of_dilatation(:) !! and of the dilatation
    logical :: influenced = .false.          !! and bonds have factors of their length, too
    real(wp), allocatable :: D(:, :)         !! surface factor of the dilatation (n_slots, dim)
    real(wp), allocatable :: axes(:, :)      !! axes of D and S in columns, none: x, y, z
    real(wp), allocatable :: S(:, :)         !! surface factor of the stretches (n_slots, dim)
    type(bond_weights_type) :: weights       !! of the bonds, if consistent
    logical :: followers = .false.           !! some Gb are negative, and bonds break
    real(wp), allocatable :: expansion(:)    !! alpha dT of each slot [-], allocated if thermal
    real(wp), allocatable :: critical(:)     !! s_c of each slot, `never` or `no_fail`
    real(wp) :: least_critical = never       !! smallest s_c of all
    integer(i1), allocatable :: compressed(:) !! 1 where bonds break in compression too
    integer(i8), allocatable :: number(:)    !! of each slot's point among all, if strength scatters
    real(wp), allocatable :: weakest(:)      !! smallest s_c of the bonds of each slot, then
  end type model_type

contains

  !> The model of a body. `zone` marks slots in no-fail zones, `temperature_change` [K] is per slot.
  !> Surface factors are set by whoever computes them.
  subroutine new_model(body, materials, with_lambda, zone, temperature_change, model, laws)
    type(body_type), intent(in) :: body              !! arranged in slots
    type(material_type), intent(in) :: materials(:)  !! (any number) by the numbers that points have
    logical, intent(in) :: with_lambda  !! the dilatation is `projected`, as printed
    logical, intent(in) :: zone(:)                   !! (n_slots) slots in no-fail zones
    real(wp), intent(in) :: temperature_change(:)    !! (n_slots) of each slot [K]
    type(model_type), intent(out) :: model           !! without surface factors and scales
    type(law_item_type), intent(in), optional :: laws(:)
      !! (materials) their bond laws, set up; without, those of the chapter
    logical :: used(size(materials))
    integer :: k

    model%dim = body%dim
    model%projected = with_lambda
    allocate (model%materials, source=materials)
    allocate (model%material, source=body%material)
    used = .false.
    do k = 1, body%n_slots
      if (body%point(k) > 0) used(body%material(k)) = .true.
    end do
    ! ranks that have no point of a material must take part in what it asks for
    do k = 1, size(used)
      used(k) = any_of_ranks(body%order, used(k))
    end do
    model%dilatation = any(used .and. abs(materials%a) > 0.0_wp)
    if (present(laws)) then
      allocate (model%laws, source=laws)
      call choose_pass(used, model)
    end if
    model%thermal = any_of_ranks(body%order, any(abs(temperature_change) > 0.0_wp)) .and. &
      & any(used .and. abs(materials%expansion) > 0.0_wp)
    if (model%thermal) model%expansion = materials(body%material)%expansion*temperature_change
    model%breaking = any(used .and. materials%critical_stretch < never) .and. &
      & any_of_ranks(body%order, any(.not. zone .and. body%point > 0))
    if (.not. model%breaking) return
    model%critical = materials(body%material)%critical_stretch
    model%least_critical = -largest_of_ranks(body%order, -minval(model%critical, &
      & mask=body%point > 0))
    where (zone) model%critical = no_fail
    if (any(used .and. materials%scatter > 0.0_wp)) &
      & model%number = number_at(body, [(k, k=1, body%n_slots)])
    model%compression = any(used .and. materials%break_in_compression)
    if (model%compression) then
      allocate (model%compressed(body%n_slots))
      model%compressed = merge(1_i1, 0_i1, materials(body%material)%break_in_compression)
    end if
  end subroutine new_model

  !> Which pass computes the forces of the laws in use. The fast loops have one weight of a bond for
  !> each of its two forces, so that both ends need the same factors.
  subroutine choose_pass(used, model)
    logical, intent(in) :: used(:)
    type(model_type), intent(inout) :: model
    integer :: i, first

    first = findloc(used, .true., dim=1)
    if (first == 0) return
    do i = 1, size(used)
      if (.not. used(i)) cycle
      model%generic = model%generic .or. .not. model%laws(i)%law%weighted
      select type (law => model%laws(i)%law)
      class is (weighted_law_type)
        model%weighted = model%weighted .or. law%has_factors()
      class default  ! a law with a force of its own
        model%generic = .true.
      end select
      associate (one => model%laws(first)%law, other => model%laws(i)%law)
        model%generic = model%generic .or. .not. (same_type_as(one, other) &
          & .and. one%influence == other%influence)
      end associate
    end do
    if (.not. model%generic) return
    model%weighted = .false.
    model%dilatation = .false.  ! the laws have it
  end subroutine choose_pass

  !> Give points horizons of their own. The constants of the laws stay those of the largest one;
  !> bonds of shorter ones have factors (doc/theory.md, 1).
  pure subroutine give_horizons(body, rule, model)
    type(body_type), intent(in) :: body         !! arranged in slots, with its spacings
    type(volume_rule_type), intent(in) :: rule  !! with its ratio; the laws have its horizon
    type(model_type), intent(inout) :: model
      !! of weighted laws without scales; gets horizons with their factors and is `weighted`
    integer :: k

    model%influenced = model%weighted
    model%weighted = .true.
    model%horizon = rule%ratio*body%spacing
    allocate (model%of_stretch(body%n_slots), model%of_dilatation(body%n_slots), source=1.0_wp)
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      model%of_stretch(k) = (rule%delta/model%horizon(k))**(body%dim + 1)
      model%of_dilatation(k) = (rule%delta/model%horizon(k))**body%dim
    end do
  end subroutine give_horizons

  !> Factors of the stretch and of the dilatation of the bond k-j, by its length and its horizon
  !> (doc/theory.md, 1 and 15).
  pure subroutine bond_factors_of(model, k, j, length, gb, gd)
    type(model_type), intent(in) :: model  !! with weighted laws
    integer, intent(in) :: k, j            !! slots of the bond's ends
    real(wp), intent(in) :: length         !! |xi| [m]
    real(wp), intent(out) :: gb            !! factor of the stretch's force [-]
    real(wp), intent(out) :: gd            !! factor of the dilatation [-]

    real(wp) :: shorter, delta

    gb = 1.0_wp
    gd = 1.0_wp
    if (allocated(model%horizon)) then
      ! the larger horizon has the smaller factors
      shorter = min(model%of_stretch(k), model%of_stretch(j))
      if (.not. model%influenced) then
        gb = shorter
        gd = min(model%of_dilatation(k), model%of_dilatation(j))
        return
      end if
    end if
    select type (law => model%laws(model%material(k))%law)
    class is (weighted_law_type)
      delta = law%delta
      if (allocated(model%horizon)) delta = max(model%horizon(k), model%horizon(j))
      call law%bond_factors(length/delta, gb, gd)
    class default
      call internal_fault('a law without weights on the fast loops')
    end select
    if (.not. allocated(model%horizon)) return
    gb = gb*shorter
    gd = gd*min(model%of_dilatation(k), model%of_dilatation(j))
  end subroutine bond_factors_of

  !> Whether some law in use has points of different scales.
  pure logical function has_scales(model)
    type(model_type), intent(in) :: model  !! with its laws
    integer :: i

    has_scales = .false.
    if (.not. model%weighted) return
    do i = 1, size(model%laws)
      select type (law => model%laws(i)%law)
      class is (weighted_law_type)
        has_scales = has_scales .or. law%scaled
      class default  ! the generic pass asks the law
        continue
      end select
    end do
  end function has_scales

  !> q of slot `k` (doc/theory.md, 2), with its scale [N/m6].
  pure real(wp) function q_of(model, k) result(q)
    type(model_type), intent(in) :: model  !! the model
    integer, intent(in) :: k               !! slot
    q = model%materials(model%material(k))%q
    if (allocated(model%scale)) q = model%scale(k)*q
  end function q_of

  !> t of slot `k`: theta_k = t sum(...), with its scale [1/m3].
  pure real(wp) function t_of(model, k) result(t)
    type(model_type), intent(in) :: model  !! the model
    integer, intent(in) :: k               !! slot
    t = model%materials(model%material(k))%t
    if (allocated(model%scale)) t = model%scale(k)*t
  end function t_of

  !> p of slot `k`: p_k = p theta_k, with its scale [N/m5].
  pure real(wp) function p_of(model, k) result(p)
    type(model_type), intent(in) :: model  !! the model
    integer, intent(in) :: k               !! slot
    p = model%materials(model%material(k))%p
    if (allocated(model%scale)) p = model%scale(k)*p
  end function p_of

  !> What the forces of the model itself take in.
  pure type(force_options_type) function options_of(model) result(options)
    type(model_type), intent(in) :: model  !! the model

    options%dilatation = model%dilatation
    options%projected = model%projected
    options%thermal = model%thermal
  end function options_of

  !> The kind of dilatation of a force.
  pure integer function dilatation_of(options) result(kind)
    type(force_options_type), intent(in) :: options  !! what a force takes in

    kind = no_dilatation
    if (options%dilatation) kind = merge(projected, unprojected, options%projected)
  end function dilatation_of

  !> Limits of the mechanical stretch of the bond k-j: it breaks above `upper` or below `lower`.
  pure subroutine bond_limit(model, k, j, lower, upper)
    type(model_type), intent(in) :: model  !! with bonds that can break
    integer, intent(in) :: k, j     !! slots of the bond's ends
    real(wp), intent(out) :: lower  !! < 0; -`never` if the bond does not break in compression [-]
    real(wp), intent(out) :: upper  !! > 0; `never` if one end is in a no-fail zone [-]

    upper = min(critical_of(model, k, j), critical_of(model, j, k))
    if (upper < 0.0_wp) upper = never
    if (allocated(model%number) .and. upper < never) upper = upper*scatter_of(model, k, j)
    lower = -never
    if (model%compression) then
      if (model%compressed(k) == 1_i1 .and. model%compressed(j) == 1_i1) lower = -upper
    end if
  end subroutine bond_limit

  !> Whether the `i`-th bond of slot `k` breaks with others only: one with a negative Gb does with
  !> the first other one that either of its ends loses (doc/theory.md, 4). By itself it would give
  !> energy to the body.
  pure logical function follows(model, k, i)
    type(model_type), intent(in) :: model  !! with consistent weights, or without
    integer, intent(in) :: k               !! slot
    integer, intent(in) :: i               !! its bond

    follows = .false.
    if (model%followers) follows = model%weights%Gb(model%weights%before(k) + i) < 0.0_wp
  end function follows

  !> Critical stretch of slot `k`'s material for the horizon of the bond k-j: that of Gc goes with
  !> one over the root of the horizon (doc/theory.md, 8).
  pure real(wp) function critical_of(model, k, j) result(s_c)
    type(model_type), intent(in) :: model
    integer, intent(in) :: k, j

    s_c = model%critical(k)
    if (.not. allocated(model%horizon)) return
    associate (m => model%material(k))
      if (s_c > 0.0_wp .and. s_c < never .and. model%materials(m)%from_toughness) &
        & s_c = s_c*sqrt(model%laws(m)%law%delta/max(model%horizon(k), model%horizon(j)))
    end associate
  end function critical_of

  !> The factor of the critical stretch of the bond k-j, by the material whose critical stretch it
  !> has; of two alike the first one.
  pure real(wp) function scatter_of(model, k, j) result(factor)
    type(model_type), intent(in) :: model
    integer, intent(in) :: k, j
    integer :: m

    m = model%material(k)
    if (critical_of(model, j, k) < critical_of(model, k, j)) then
      m = model%material(j)
    else if (.not. critical_of(model, k, j) < critical_of(model, j, k)) then
      m = min(m, int(model%material(j)))
    end if
    factor = 1.0_wp
    if (model%materials(m)%scatter > 0.0_wp) factor = strength_factor(model%materials(m)%scatter, &
      & model%materials(m)%seed, model%number(k), model%number(j))
  end function scatter_of

end module pd_force_model
