!> Consistent weights of bonds (doc/theory.md, 4): under every uniform strain each point is in
!> equilibrium with classical tractions on its surface area, and its dilatation is exact.
module pd_set_up_consistent_weights
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp
  use pd_base_long_work, only: long_work_type
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type
  use pd_body_meshes, only: surface_areas
  use pd_body_side_areas, only: total_areas
  use pd_family_areas, only: area_vectors
  use pd_family_bond_weights, only: bond_weights_type
  use pd_family_family, only: family_type
  use pd_force_model, only: model_type
  use pd_law_material, only: material_type, several_stiffnesses
  use pd_set_up_consistent_conditions, only: conditions_type, dilatation_conditions, &
    & join_conditions, stretch_conditions
  use pd_set_up_consistent_groups, only: find_groups, groups_type, spread_weights
  use pd_set_up_consistent_least_change, only: least_change, unbounded
  implicit none (type, external)
  private
  public :: consistent_weights, weights_of_areas, solution_type, alone_text

  !> How one kind of weights was found.
  type :: solution_type
    real(wp) :: bound = unbounded     !! smallest weight that was allowed [-]
    real(wp) :: least = 1.0_wp        !! smallest weight [-]
    real(wp) :: greatest = 1.0_wp     !! [-]
    real(wp) :: residual = 0.0_wp     !! largest error of a condition [-]
    integer :: unknowns = 0           !! different weights
    integer :: iterations = 0         !! of conjugate gradients, in all
    logical :: hopeless = .false.     !! whether shared weights were given up, whatever the bound
  end type solution_type

  !> Bounds on Gb that are tried, one after another; the last is none. With the first two most
  !> bodies are stable. Bars and plates have weights Gb of 0.05 at least, blocks none above 0.
  real(wp), parameter :: bounds_of_stretch(*) = [0.05_wp, 0.0_wp, -0.3_wp, unbounded]
  !> Before them where bonds break and the force has a dilatation: the larger Gb, the less a broken
  !> bond changes the dilatation for the energy that it had.
  real(wp), parameter :: bounds_of_breaking(*) = [0.6_wp, 0.3_wp]
  !> Of Gd there are none above 0 in the plane either, and those that are not negative are far from
  !> 1.
  real(wp), parameter :: bounds_of_dilatation(*) = [-0.1_wp, -0.5_wp, -2.0_wp, unbounded]
  !> Points in space, each with weights of its own, up to which Gd has bounds: most weights are at
  !> them.
  integer, parameter :: most_bounded = 8000
  !> Change of a surface area that counts as much as one of a weight by 1 [faces].
  real(wp), parameter :: part_of_face = 0.03_wp

contains

  !> Weights of the bonds of lattices or of one mesh or cloud, whose surface has been prepared.
  !> Where no positive weights go with the surface areas, and in clouds, the areas of points that no
  !> load acts on change; the body gets them. An error is set if a point of a lattice has no second
  !> one behind it, or if no weights fulfil the conditions.
  subroutine consistent_weights(body, family, materials, fixed, breaking, weights, stretch, &
    & dilatation, error, work, model)
    type(body_type), intent(inout) :: body
      !! all on lattices, or one mesh or cloud, in the family's slots
    class(family_type), intent(in) :: family         !! whole: no bond cut
    type(material_type), intent(in) :: materials(:)  !! (any number) by the points' numbers
    logical, intent(in) :: fixed(:)                  !! (n_slots) areas that loads act through
    logical, intent(in) :: breaking  !! whether bonds break and the force has a dilatation
    type(bond_weights_type), intent(out) :: weights
    type(solution_type), intent(out) :: stretch      !! how Gb was found
    type(solution_type), intent(out) :: dilatation   !! how Gd was found
    type(error_type), allocatable, intent(out) :: error
    type(long_work_type), intent(inout) :: work      !! says how far the iterations are
    type(model_type), intent(in), optional :: model  !! where points have horizons of their own
    real(wp), allocatable :: area(:, :), changed(:, :), of_stretch(:, :), of_dilatation(:, :)
    real(wp), allocatable :: bounds(:)
    real(wp) :: a(size(materials)), mu(size(materials)), face(body%n_slots)
    integer :: alone, least, positive
    logical :: uneven

    least = merge(2, 1, body%dim == 3)
    bounds = bounds_of_stretch
    if (breaking .and. body%dim == 2) bounds = [bounds_of_breaking, bounds_of_stretch]
    positive = count(bounds >= 0.0_wp)
    a = a_of(materials)
    mu = mu_of(materials, body%dim)
    alone = 0
    uneven = allocated(body%sides) .or. size(body%parts) > 0
    face = 0.0_wp
    if (allocated(body%sides)) then
      area = total_areas(body%sides, body%n_slots, body%dim)
      if (all(body%sides%axis == 0)) then
        face(body%sides%slot) = body%sides%face
        call weights_and_areas(body, family, materials, face, bounds, area, weights, stretch, &
          & dilatation, error, work, model)
        if (.not. allocated(error)) body%surface_area = area
        return
      end if
    else if (size(body%parts) > 0) then
      call surface_areas(body, area, error)
      if (allocated(error)) return
    else if (several_stiffnesses(materials)) then
      call area_vectors(body, family, mu, of_stretch, alone)
      if (alone == 0) call area_vectors(body, family, a, of_dilatation, alone)
    else
      call area_vectors(body, family, 0*a + 1, area, alone)
    end if
    if (alone > 0) then
      call fail(error, alone_text(body, alone), group='horizon', number=1)
      return
    end if
    if (.not. allocated(area)) then
      call weights_of_areas(body, family, materials, of_stretch, of_dilatation, .false., &
        & bounds(least:), weights, stretch, dilatation, error, work)
      return
    end if
    call weights_of_areas(body, family, materials, mu(1)*area, a(1)*area, uneven, &
      & bounds(least:positive), weights, stretch, dilatation, error, work, model)
    if (.not. allocated(error)) return
    where (any(abs(area) > 0.0_wp, dim=2) .and. .not. fixed) face = body%volume/body%spacing
    if (any(face > 0.0_wp)) then
      changed = area
      call weights_and_areas(body, family, materials, face, bounds(:positive), changed, &
        & weights, stretch, dilatation, error, work, model)
      if (.not. allocated(error)) then
        body%surface_area = changed
        return
      end if
    end if
    call weights_of_areas(body, family, materials, mu(1)*area, a(1)*area, uneven, &
      & bounds(positive + 1:), weights, stretch, dilatation, error, work, model)
  end subroutine consistent_weights

  !> Weights together with surface areas: Gb, Gd and areas are unknowns of one set of conditions. An
  !> outline knows the areas of a cloud roughly only, and with its areas there may be no Gb above 0,
  !> and Gd that grow with the body; neither need there be with those of triangles, tetrahedra or
  !> round parts of lattices. An error is set if no weights fulfil the conditions.
  subroutine weights_and_areas(body, family, materials, face, bounds, area, weights, stretch, &
    & dilatation, error, work, model)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(material_type), intent(in) :: materials(:)   ! all of one stiffness
    real(wp), intent(in) :: face(:)                   ! (n_slots) of points whose areas may change;
                                                      ! 0: fixed [m2]
    real(wp), intent(in) :: bounds(:)                 ! on Gb
    real(wp), intent(inout) :: area(:, :)             ! (n_slots, dim) outward ones; may change [m2]
    type(bond_weights_type), intent(out) :: weights
    type(solution_type), intent(out) :: stretch, dilatation
    type(error_type), allocatable, intent(out) :: error
    type(long_work_type), intent(inout) :: work
    type(model_type), intent(in), optional :: model
    type(groups_type) :: groups
    type(conditions_type) :: of_stretch, of_dilatation, conditions
    real(wp), allocatable :: G(:)
    real(wp) :: a(size(materials)), mu(size(materials))
    integer :: c, u

    a = a_of(materials)
    mu = mu_of(materials, body%dim)
    call find_groups(body, family, area, 0, groups, error)
    if (allocated(error)) return
    call stretch_conditions(body, family, materials, groups, mu(1)*area, of_stretch, model)
    call dilatation_conditions(body, family, materials, a, groups, a(1)*area, of_dilatation, model)
    call join_conditions(of_stretch, of_dilatation, mu(1), a(1), part_of_face*face(groups%first), &
      & conditions)
    call solve(conditions, bounds, 'stretch and the dilatation', G, stretch, error, work)
    if (allocated(error)) return
    do c = 1, groups%n_classes
      associate (k => groups%first(c))
        if (.not. face(k) > 0.0_wp) cycle
        u = int(conditions%unknown(conditions%start(c + 1) - body%dim))
        area(k, :) = area(k, :) + (G(u:u + body%dim - 1) - 1)*part_of_face*face(k)
      end associate
    end do
    associate (n => groups%n_groups)
      dilatation%residual = stretch%residual
      stretch%unknowns = n
      dilatation%unknowns = n
      stretch%least = minval(G(:n))
      stretch%greatest = maxval(G(:n))
      dilatation%least = minval(G(n + 1:2*n))
      dilatation%greatest = maxval(G(n + 1:2*n))
      call spread_weights(body, groups, G(:n), G(n + 1:2*n), weights)
    end associate
  end subroutine weights_and_areas

  !> Why a point without a second one behind its face is refused.
  function alone_text(body, slot) result(text)
    type(body_type), intent(in) :: body  !! with the point
    integer, intent(in) :: slot          !! of the point
    character(:), allocatable :: text
    text = "surface_correction = 'consistent' needs a second point behind each surface: point "// &
      & to_text(int(body%point(slot)))//' has no neighbour on either side along an axis; lower '// &
      & 'the dimension, use more points across, or another correction'
  end function alone_text

  !> Weights for given surface areas. An error is set if no weights fulfil the conditions. Bonds in
  !> like surroundings have one weight; where that leaves no solution, surroundings are looked at
  !> farther, and in the end each bond has a weight of its own.
  subroutine weights_of_areas(body, family, materials, of_stretch, of_dilatation, uneven, bounds, &
    & weights, stretch, dilatation, error, work, model)
    type(body_type), intent(in) :: body              !! arranged in the slots of the family
    class(family_type), intent(in) :: family         !! whole: no bond cut
    type(material_type), intent(in) :: materials(:)  !! (any number) by the points' numbers
    real(wp), intent(in) :: of_stretch(:, :)
      !! (n_slots, dim) mu x outward area, summed over regions; in 1D E/3 x cross section [N]
    real(wp), intent(in) :: of_dilatation(:, :)
      !! (n_slots, dim) a over the largest a x area, summed over regions [m2]
    logical, intent(in) :: uneven
      !! no points are alike, and of Gd no bound is asked for
    real(wp), intent(in) :: bounds(:)                !! on Gb, tried one after another [-]
    type(bond_weights_type), intent(out) :: weights
    type(solution_type), intent(out) :: stretch      !! how Gb was found
    type(solution_type), intent(out) :: dilatation   !! how Gd was found
    type(error_type), allocatable, intent(out) :: error
    type(long_work_type), intent(inout) :: work      !! says how far the iterations are
    type(model_type), intent(in), optional :: model  !! where points have horizons of their own
    integer, parameter :: farthest = 3
    integer :: reach

    ! in space a second horizon would give ten times the unknowns for weights hardly nearer to 1
    reach = merge(1, 2, body%dim == 3)
    if (uneven) reach = 0
    do
      call weights_at_reach(body, family, materials, of_stretch, of_dilatation, reach, bounds, &
        & uneven, weights, stretch, dilatation, error, work, model)
      if (reach == 0 .or. .not. allocated(error)) return
      reach = merge(0, reach + 1, reach == farthest .or. stretch%hopeless .or. dilatation%hopeless)
    end do
  end subroutine weights_of_areas

  !> Weights where bonds have one weight if all looks alike within `reach` horizons. An error is set
  !> if none fulfil the conditions.
  subroutine weights_at_reach(body, family, materials, of_stretch, of_dilatation, reach, bounds, &
    & uneven, weights, stretch, dilatation, error, work, model)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(material_type), intent(in) :: materials(:)
    real(wp), intent(in) :: of_stretch(:, :), of_dilatation(:, :)
    integer, intent(in) :: reach
    real(wp), intent(in) :: bounds(:)
    logical, intent(in) :: uneven
    type(bond_weights_type), intent(out) :: weights
    type(solution_type), intent(out) :: stretch, dilatation
    type(error_type), allocatable, intent(out) :: error
    type(long_work_type), intent(inout) :: work
    type(model_type), intent(in), optional :: model
    type(groups_type) :: groups
    type(conditions_type) :: conditions
    real(wp), allocatable :: Gb(:), Gd(:)
    real(wp) :: scale
    integer :: first

    scale = maxval(abs(of_dilatation))
    if (.not. scale > 0.0_wp) scale = 1.0_wp
    call find_groups(body, family, reshape([of_stretch/maxval(abs(of_stretch)), &
      & of_dilatation/scale], [body%n_slots, 2*body%dim]), reach, groups, error)
    if (allocated(error)) return
    call stretch_conditions(body, family, materials, groups, of_stretch, conditions, model)
    call solve(conditions, bounds, 'stretch', Gb, stretch, error, work)
    if (allocated(error)) return
    call dilatation_conditions(body, family, materials, a_of(materials), groups, of_dilatation, &
      & conditions, model)
    ! the bounds on Gd would take ten times as long, or the iterations would not end
    first = 1
    if (uneven .or. (reach == 0 .and. body%dim == 3 .and. groups%n_classes > most_bounded)) &
      & first = size(bounds_of_dilatation)
    call solve(conditions, bounds_of_dilatation(first:), 'dilatation', Gd, dilatation, error, &
      & work)
    if (allocated(error)) return
    call spread_weights(body, groups, Gb, Gd, weights)
  end subroutine weights_at_reach

  !> The least change within the first of some bounds that allow one.
  subroutine solve(conditions, bounds, what, G, solution, error, work)
    type(conditions_type), intent(in) :: conditions
    real(wp), intent(in) :: bounds(:)
    character(*), intent(in) :: what
    real(wp), allocatable, intent(out) :: G(:)
    type(solution_type), intent(out) :: solution
    type(error_type), allocatable, intent(out) :: error
    type(long_work_type), intent(inout) :: work
    character(:), allocatable :: why
    integer :: b, iterations
    logical :: found

    call work%turn_to('weights of the '//what)
    found = .false.
    solution%unknowns = conditions%unknowns
    do b = 1, size(bounds)
      solution%bound = bounds(b)
      call least_change(conditions, bounds(b), G, solution%residual, iterations, found, &
        & solution%hopeless, work)
      solution%iterations = solution%iterations + iterations
      if (found .or. solution%hopeless) exit
    end do
    solution%least = minval(G)
    solution%greatest = maxval(G)
    if (found) return
    if (solution%residual < 1.0_wp) then
      why = 'uniform strains would leave forces of '//to_text(solution%residual, 2)// &
        & ' of those of the bonds'
    else
      why = 'the iterations do not converge. Families may have too few bonds: horizons of 2.5 '// &
        & 'spacings and more are served'
    end if
    call fail(error, "surface_correction = 'consistent' finds no weights of the "//what// &
      & ' for these points: '//why//'; use another correction', group='horizon', number=1)
  end subroutine solve

  !> The shear modulus that the stretches alone give; in 1D a third of Young's modulus.
  pure function mu_of(materials, dim) result(mu)
    type(material_type), intent(in) :: materials(:)
    integer, intent(in) :: dim
    real(wp) :: mu(size(materials))
    mu = materials%shear_modulus
    if (dim == 1) mu = 2*(materials%uniaxial_energy - materials%a)/3
  end function mu_of

  !> a of each material over the largest; 1 where all are 0: only the weights' form counts then.
  pure function a_of(materials) result(a)
    type(material_type), intent(in) :: materials(:)
    real(wp) :: a(size(materials))
    a = materials%a
    if (all(abs(a) <= 0.0_wp)) a = 1.0_wp
    a = a/maxval(abs(a))
  end function a_of

end module pd_set_up_consistent_weights
