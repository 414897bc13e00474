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
  use pd_set_up_consistent_boxes, only: box_type, fill_box, find_alike, join_weights, &
    & symmetries_within, take_from_box
  use pd_set_up_consistent_conditions, only: conditions_type, dilatation_conditions, &
    & join_conditions, stretch_conditions
  use pd_set_up_consistent_groups, only: changeable_axes, find_groups, groups_type, &
    & spread_weights
  use pd_set_up_consistent_least_change, only: least_change, most_iterations, unbounded
  use pd_set_up_consistent_symmetries, only: symmetries_type
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
  !> Iterations after which shared weights are given up where only bonds near missing cells may have
  !> their own instead.
  integer, parameter :: few_iterations = 2000
  !> Points near missing cells, over classes of points, from which on shared weights are tried.
  integer, parameter :: points_of_class = 8
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
    real(wp), allocatable :: area(:, :), of_stretch(:, :), of_dilatation(:, :), bounds(:)
    real(wp) :: a(size(materials)), mu(size(materials)), face(body%n_slots)
    integer :: alone, least
    logical :: uneven, changed

    least = merge(2, 1, body%dim == 3)
    bounds = bounds_of_stretch
    if (breaking .and. body%dim == 2) bounds = [bounds_of_breaking, bounds_of_stretch]
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
    where (any(abs(area) > 0.0_wp, dim=2) .and. .not. fixed) face = body%volume/body%spacing
    call weights_by_turns(body, family, materials, face, uneven, bounds, least, area, changed, &
      & weights, stretch, dilatation, error, work, model)
    if (changed .and. .not. allocated(error)) body%surface_area = area
  end subroutine consistent_weights

  !> Weights of lattices or of one mesh, whatever is found first: shared ones, own ones with the
  !> areas of faces, both with a bound of 0 at least; own ones with areas that change; then those
  !> with lower bounds. An error is set if none fulfil the conditions.
  subroutine weights_by_turns(body, family, materials, face, uneven, bounds, least, area, &
    & changed, weights, stretch, dilatation, error, work, model)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(material_type), intent(in) :: materials(:)   ! all of one stiffness
    real(wp), intent(in) :: face(:)                   ! (n_slots) as in `weights_and_areas` [m2]
    logical, intent(in) :: uneven                     ! no points are alike
    real(wp), intent(in) :: bounds(:)                 ! on Gb
    integer, intent(in) :: least                      ! first of them with areas of faces
    real(wp), intent(inout) :: area(:, :)             ! (n_slots, dim) outward ones; may change [m2]
    logical, intent(out) :: changed                   ! whether they did
    type(bond_weights_type), intent(out) :: weights
    type(solution_type), intent(out) :: stretch, dilatation
    type(error_type), allocatable, intent(out) :: error
    type(long_work_type), intent(inout) :: work
    type(model_type), intent(in), optional :: model
    type(box_type), allocatable :: box
    type(solution_type) :: box_stretch, box_dilatation
    real(wp), allocatable :: of_stretch(:, :), of_dilatation(:, :), new_area(:, :)
    real(wp) :: a(size(materials)), mu(size(materials))
    integer :: positive, most
    logical :: shared

    a = a_of(materials)
    mu = mu_of(materials, body%dim)
    of_stretch = mu(1)*area
    of_dilatation = a(1)*area
    positive = count(bounds >= 0.0_wp)
    changed = .false.
    shared = .not. uneven
    if (shared) then
      most = huge(0)
      call fill_box(body, family, area, box)
      if (allocated(box)) then
        if (.not. any(box%near)) then
          call weigh_box(materials, bounds(least:positive), box, stretch, dilatation, work)
          if (allocated(box)) then
            weights = box%weights
            return
          end if
        else
          most = count(box%near)/points_of_class
        end if
      end if
      call shared_weights(body, family, materials, of_stretch, of_dilatation, &
        & bounds(least:positive), most, weights, stretch, dilatation, error, work, model)
      if (.not. allocated(error)) return
      shared = .not. (stretch%hopeless .or. dilatation%hopeless)
      if (allocated(box)) call weigh_box(materials, bounds(least:positive), box, &
        & box_stretch, box_dilatation, work)
      if (allocated(box)) call find_alike(body, family, area, face, box)
    end if
    do
      ! where there are none above 0.05, there hardly are above 0
      call own_weights(body, family, materials, of_stretch, of_dilatation, uneven, &
        & bounds(least:max(least, positive - 1)), weights, stretch, dilatation, error, work, &
        & model, box)
      if (.not. allocated(error)) return
      if (any(face > 0.0_wp)) then
        new_area = area
        call weights_and_areas(body, family, materials, face, bounds(:positive), new_area, &
          & weights, stretch, dilatation, error, work, model, box)
        changed = .not. allocated(error)
        if (changed) then
          area = new_area
          return
        end if
      end if
      if (shared) then
        call shared_weights(body, family, materials, of_stretch, of_dilatation, &
          & bounds(positive + 1:), huge(0), weights, stretch, dilatation, error, work, model)
        if (.not. allocated(error)) return
      end if
      call own_weights(body, family, materials, of_stretch, of_dilatation, uneven, &
        & bounds(positive + 1:), weights, stretch, dilatation, error, work, model, box)
      if (.not. (allocated(error) .and. allocated(box))) return
      ! once more, first without symmetries, then with all bonds unknown
      if (allocated(box%alike)) then
        deallocate (box%alike)
      else
        deallocate (box)
      end if
    end do
  end subroutine weights_by_turns

  !> Weights together with surface areas: Gb, Gd and areas are unknowns of one set of conditions. An
  !> outline knows the areas of a cloud roughly only, and with its areas there may be no Gb above 0,
  !> and Gd that grow with the body; neither need there be with those of triangles, tetrahedra or
  !> round parts of lattices. An error is set if no weights fulfil the conditions.
  subroutine weights_and_areas(body, family, materials, face, bounds, area, weights, stretch, &
    & dilatation, error, work, model, box)
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
    type(box_type), intent(in), optional :: box       ! around a lattice with missing cells
    type(groups_type) :: groups
    type(conditions_type) :: of_stretch, of_dilatation, conditions
    real(wp), allocatable :: G(:)
    real(wp) :: a(size(materials)), mu(size(materials))
    real(wp) :: change(body%dim)
    integer, allocatable :: axes(:)
    integer :: k, c, u, n

    a = a_of(materials)
    mu = mu_of(materials, body%dim)
    call own_groups(body, family, area, groups, error, box)
    if (allocated(error)) return
    call stretch_conditions(body, family, materials, groups, mu(1)*area, of_stretch, model)
    call dilatation_conditions(body, family, materials, a, groups, a(1)*area, of_dilatation, model)
    call join_conditions(groups, of_stretch, of_dilatation, mu(1), a(1), &
      & part_of_face*face(groups%first), conditions)
    call solve(conditions, bounds, most_iterations, 'stretch and the dilatation', G, stretch, &
      & error, work)
    if (allocated(error)) return
    do k = 1, body%n_slots
      c = int(groups%class(k))
      if (c == 0 .or. .not. face(k) > 0.0_wp) cycle
      axes = changeable_axes(groups, c, body%dim)
      n = size(axes)
      u = int(conditions%unknown(conditions%start(c + 1) - n))
      change = 0.0_wp
      change(axes) = part_of_face*face(k)*(G(u:u + n - 1) - 1)
      if (allocated(groups%symmetries)) change = change*groups%symmetries%sign(:, &
        & groups%symmetries%way(k))
      area(k, :) = area(k, :) + change
    end do
    n = groups%n_groups
    dilatation%residual = stretch%residual
    stretch%unknowns = n
    dilatation%unknowns = n
    call give_weights(groups, G(:n), G(n + 1:2*n), weights, stretch, dilatation, box)
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

  !> Weights for given surface areas, shared ones or, if there are none, a weight for each bond. An
  !> error is set if no weights fulfil the conditions.
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

    if (.not. uneven) then
      call shared_weights(body, family, materials, of_stretch, of_dilatation, bounds, huge(0), &
        & weights, stretch, dilatation, error, work, model)
      if (.not. allocated(error)) return
    end if
    call own_weights(body, family, materials, of_stretch, of_dilatation, uneven, bounds, weights, &
      & stretch, dilatation, error, work, model)
  end subroutine weights_of_areas

  !> Weights of which bonds in like surroundings have one; where that leaves no solution,
  !> surroundings are looked at farther. An error is set if none fulfil the conditions.
  subroutine shared_weights(body, family, materials, of_stretch, of_dilatation, bounds, &
    & most_classes, weights, stretch, dilatation, error, work, model, box)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(material_type), intent(in) :: materials(:)
    real(wp), intent(in) :: of_stretch(:, :), of_dilatation(:, :)
    real(wp), intent(in) :: bounds(:)
    integer, intent(in) :: most_classes   ! with more, none are looked for; huge: there is no other
                                          ! way, so that iterations go on longer
    type(bond_weights_type), intent(out) :: weights
    type(solution_type), intent(out) :: stretch, dilatation
    type(error_type), allocatable, intent(out) :: error
    type(long_work_type), intent(inout) :: work
    type(model_type), intent(in), optional :: model
    type(box_type), intent(in), optional :: box   ! that the body is, which has symmetries
    integer, parameter :: farthest = 3
    type(groups_type) :: groups
    type(symmetries_type), allocatable :: symmetries
    real(wp), allocatable :: Gb(:), Gd(:)
    real(wp) :: scale
    integer :: reach

    scale = maxval(abs(of_dilatation))
    if (.not. scale > 0.0_wp) scale = 1.0_wp
    ! in space a second horizon would give ten times the unknowns for weights hardly nearer to 1
    do reach = merge(1, 2, body%dim == 3), farthest
      if (present(box)) call symmetries_within(box, reach, symmetries)
      call find_groups(body, family, reshape([of_stretch/maxval(abs(of_stretch)), &
        & of_dilatation/scale], [body%n_slots, 2*body%dim]), reach, groups, error, &
        & symmetries=symmetries)
      if (allocated(error)) return
      if (groups%n_classes > most_classes) then
        stretch%hopeless = .true.
        call fail(error, 'too many kinds of surroundings for shared weights')
        return
      end if
      call weights_of_groups(body, family, materials, of_stretch, of_dilatation, groups, bounds, &
        & bounds_of_dilatation, merge(few_iterations, most_iterations, most_classes < huge(0)), &
        & Gb, Gd, stretch, dilatation, error, work, model)
      if (.not. allocated(error)) then
        call give_weights(groups, Gb, Gd, weights, stretch, dilatation)
        return
      end if
      if (stretch%hopeless .or. dilatation%hopeless) return
    end do
  end subroutine shared_weights

  !> Weights of which each bond has its own; with a `box`, of bonds near missing cells, others have
  !> those of the box. An error is set if none fulfil the conditions.
  subroutine own_weights(body, family, materials, of_stretch, of_dilatation, uneven, bounds, &
    & weights, stretch, dilatation, error, work, model, box)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(material_type), intent(in) :: materials(:)
    real(wp), intent(in) :: of_stretch(:, :), of_dilatation(:, :)
    logical, intent(in) :: uneven
    real(wp), intent(in) :: bounds(:)
    type(bond_weights_type), intent(out) :: weights
    type(solution_type), intent(out) :: stretch, dilatation
    type(error_type), allocatable, intent(out) :: error
    type(long_work_type), intent(inout) :: work
    type(model_type), intent(in), optional :: model
    type(box_type), intent(in), optional :: box
    type(groups_type) :: groups
    real(wp), allocatable :: Gb(:), Gd(:)
    integer :: first

    call own_groups(body, family, of_stretch, groups, error, box)
    if (allocated(error)) return
    first = 1
    if (present(box)) then
      first = 2  ! near missing cells there are none above -0.1
    else if (uneven .or. (body%dim == 3 .and. groups%n_classes > most_bounded)) then
      ! the bounds on Gd would take ten times as long, or the iterations would not end
      first = size(bounds_of_dilatation)
    end if
    call weights_of_groups(body, family, materials, of_stretch, of_dilatation, groups, bounds, &
      & bounds_of_dilatation(first:), most_iterations, Gb, Gd, stretch, dilatation, error, work, &
      & model)
    if (allocated(error)) return
    call give_weights(groups, Gb, Gd, weights, stretch, dilatation, box)
  end subroutine own_weights

  !> A group for each bond; with a `box`, for each bond near missing cells.
  subroutine own_groups(body, family, area, groups, error, box)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    real(wp), intent(in) :: area(:, :)
    type(groups_type), intent(out) :: groups
    type(error_type), allocatable, intent(out) :: error
    type(box_type), intent(in), optional :: box

    if (present(box)) then
      call find_groups(body, family, area, 0, groups, error, box%near, box%alike)
      if (.not. allocated(error)) call take_from_box(box, groups)
    else
      call find_groups(body, family, area, 0, groups, error)
    end if
  end subroutine own_groups

  !> Give the slots the weights of groups, and those of the box, if there is one.
  subroutine give_weights(groups, Gb, Gd, weights, stretch, dilatation, box)
    type(groups_type), intent(in) :: groups
    real(wp), intent(in) :: Gb(:), Gd(:)                       ! (groups)
    type(bond_weights_type), intent(out) :: weights
    type(solution_type), intent(inout) :: stretch, dilatation  ! get the least and greatest weights
    type(box_type), intent(in), optional :: box

    if (present(box)) then
      call join_weights(box, groups, Gb, Gd, weights)
    else
      call spread_weights(groups, Gb, Gd, weights)
    end if
    stretch%least = minval(weights%Gb)
    stretch%greatest = maxval(weights%Gb)
    dilatation%least = minval(weights%Gd)
    dilatation%greatest = maxval(weights%Gd)
  end subroutine give_weights

  !> Give the box around a lattice its weights, which are shared; without such it is taken away.
  subroutine weigh_box(materials, bounds, box, stretch, dilatation, work)
    type(material_type), intent(in) :: materials(:)     ! all of one stiffness
    real(wp), intent(in) :: bounds(:)                   ! on Gb
    type(box_type), allocatable, intent(inout) :: box
    type(solution_type), intent(out) :: stretch, dilatation
    type(long_work_type), intent(inout) :: work
    type(bond_weights_type) :: weights
    type(error_type), allocatable :: error
    real(wp) :: a(size(materials)), mu(size(materials))

    a = a_of(materials)
    mu = mu_of(materials, box%body%dim)
    call shared_weights(box%body, box%family, materials, mu(1)*box%area, a(1)*box%area, bounds, &
      & huge(0), weights, stretch, dilatation, error, work, box=box)
    if (allocated(error)) then
      deallocate (box)
    else
      box%weights = weights
    end if
  end subroutine weigh_box

  !> Gb and Gd of groups. An error is set if none fulfil the conditions.
  subroutine weights_of_groups(body, family, materials, of_stretch, of_dilatation, groups, &
    & bounds, bounds_of_Gd, most_shared, Gb, Gd, stretch, dilatation, error, work, model)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(material_type), intent(in) :: materials(:)
    real(wp), intent(in) :: of_stretch(:, :), of_dilatation(:, :)
    type(groups_type), intent(in) :: groups
    real(wp), intent(in) :: bounds(:), bounds_of_Gd(:)
    integer, intent(in) :: most_shared    ! iterations, as in `least_change`
    real(wp), allocatable, intent(out) :: Gb(:), Gd(:)
    type(solution_type), intent(out) :: stretch, dilatation
    type(error_type), allocatable, intent(out) :: error
    type(long_work_type), intent(inout) :: work
    type(model_type), intent(in), optional :: model
    type(conditions_type) :: conditions

    call stretch_conditions(body, family, materials, groups, of_stretch, conditions, model)
    call solve(conditions, bounds, most_shared, 'stretch', Gb, stretch, error, work)
    if (allocated(error)) return
    call dilatation_conditions(body, family, materials, a_of(materials), groups, of_dilatation, &
      & conditions, model)
    call solve(conditions, bounds_of_Gd, most_shared, 'dilatation', Gd, dilatation, error, work)
  end subroutine weights_of_groups

  !> The least change within the first of some bounds that allow one.
  subroutine solve(conditions, bounds, most_shared, what, G, solution, error, work)
    type(conditions_type), intent(in) :: conditions
    real(wp), intent(in) :: bounds(:)
    integer, intent(in) :: most_shared
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
      call least_change(conditions, bounds(b), most_shared, G, solution%residual, iterations, &
        & found, solution%hopeless, work)
      solution%iterations = solution%iterations + iterations
      if (found .or. solution%hopeless) exit
    end do
    if (allocated(conditions%base)) G = G + conditions%base - 1
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
