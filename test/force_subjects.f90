!> Bodies on which force loops are tried: every dimension with every term of the force alone and
!> with all of them, on every kind of family. A new kind joins by one line in `kinds` and one in
!> `build_family`.
module force_subjects
  use pd_base_kinds, only: wp, i1, i2, i8
  use pd_base_error, only: fault_type => error_type
  use pd_body_body, only: body_type, grid_type, allocate_points, keep_points
  use pd_law_law, only: law_name_length
  use pd_law_laws, only: all_laws, law_item_type, law_table_type
  use pd_law_material, only: material_type, new_material
  use pd_family_cracks, only: cut_bonds
  use pd_family_composite, only: composite_family_type, new_composite_family
  use pd_family_family, only: family_type
  use pd_family_lattice, only: find_listed, lattice_family_type, new_lattice_family
  use pd_family_list, only: list_family_type, new_list_family
  use pd_family_surface, only: surface_factors
  use pd_family_volume, only: volume_rule_type, volume_none, volume_linear, &
    & volume_linear_extended, &
    & volume_exact
  use pd_force_composite, only: prepare_composite
  use pd_force_forces, only: internal_force
  use pd_force_generic_bonds, only: begin_laws, refresh_bonds
  use pd_force_generic_points, only: generic_point_dilatation
  use pd_force_model, only: model_type, new_model, options_of, p_of
  use pd_force_weights, only: build_weights
  use pd_force_workspace, only: workspace_type
  use pd_scene_content_types, only: crack_group
  use bodies, only: noise, youngs_modulus
  implicit none (type, external)
  private
  public :: subject_type, kinds, tolerance, spacing, build, build_pair, subject_number, &
    & name_of, fast_force, some_gradient

  !> The kinds of families that must keep the contract. `tables`: lists where every cluster has
  !> tables, also those that no other shares.
  !> `generic`: a lattice whose laws are computed on the generic pass.
  !> `composite`: points on two grids and on none.
  character(9), parameter :: kinds(*) = [character(9) :: 'list', 'tables', 'lattice', 'mixed', &
    & 'generic', 'composite']

  !> Of every body here [m]; a power of 2, so that positions are exact.
  real(wp), parameter :: spacing = 2.0_wp**(-10)

  !> One body under test, and which terms its force has.
  type :: subject_type
    character(9) :: kind = 'list'
    integer :: dim = 1
    real(wp) :: poissons_ratio = 0.2_wp
    logical :: bond_based = .false.
    character(law_name_length) :: law = ''   !! '': by `bond_based`
    character(law_name_length) :: influence = 'inverse'
    logical :: dilatant = .false.            !! 1D: energy of dilatation beside that of stretches
    logical :: plane_strain = .false.
    logical :: projected = .true.
    logical :: surface = .false.
    logical :: thermal = .false.
    logical :: two_materials = .false.
    logical :: hole = .false.
    logical :: crack = .false.
    logical :: breaking = .false.
    logical :: cloud = .false.               !! lists: points off the lattice, spacings that differ
    integer :: rule = volume_linear
    integer(i8) :: key_bits = not(0_i8)      !! bits of keys that count
    integer :: least_shared = 8              !! lists: clusters that share tables, at least
    integer :: points(3) = 0                 !! along each direction, 0: few
    type(body_type) :: body
    class(family_type), allocatable :: family
    type(model_type) :: model
    type(workspace_type) :: workspace
  end type subject_type

contains

  !> The one place that knows the kinds of families.
  subroutine build_family(kind, body, rule, breakable, key_bits, least_shared, family, workspace)
    character(*), intent(in) :: kind
    type(body_type), intent(inout) :: body
    type(volume_rule_type), intent(in) :: rule
    logical, intent(in) :: breakable
    integer(i8), intent(in) :: key_bits
    integer, intent(in) :: least_shared
    class(family_type), allocatable, intent(out) :: family
    type(workspace_type), intent(inout) :: workspace
    type(list_family_type), allocatable :: list
    type(lattice_family_type), allocatable :: lattice
    type(composite_family_type), allocatable :: composite
    type(fault_type), allocatable :: fault
    logical, allocatable :: listed(:)

    select case (kind)
    case ('list', 'tables')
      allocate (list)
      call new_list_family(body, rule, list)
      workspace%list%key_bits = key_bits
      workspace%list%least_shared = merge(1, least_shared, kind == 'tables')
      call move_alloc(list, family)
    case ('composite')
      call part_grids(body)
      allocate (composite)
      call find_listed(body, rule, listed)
      call new_composite_family(body, rule, listed, breakable, composite, fault)
      call move_alloc(composite, family)
    case default
      allocate (lattice)
      call new_lattice_family(body, rule, breakable, kind == 'mixed', lattice, fault, key_bits)
      call move_alloc(lattice, family)
    end select
  end subroutine build_family

  !> Points of one grid on two grids and, where there are many, some on none: what is computed must
  !> not change.
  subroutine part_grids(body)
    type(body_type), intent(inout) :: body
    real(wp) :: middle

    middle = sum(body%x(:, 1))/body%n_points
    body%grids = [body%grids(1), body%grids(1)]
    where (body%x(:, 1) > middle) body%grid = 2_i2
    if (body%n_points > 4) where (body%x(:, body%dim) > 0.8_wp*maxval(body%x(:, body%dim))) &
      & body%grid = 0_i2
  end subroutine part_grids

  !> What is kept of the model once that is complete.
  subroutine finish_family(subject)
    type(subject_type), intent(inout) :: subject
    select type (family => subject%family)
    type is (lattice_family_type)
      call build_weights(family, subject%model, subject%workspace%lattice)
    type is (composite_family_type)
      call prepare_composite(family, subject%model, subject%workspace)
    end select
  end subroutine finish_family

  !> What a kind may be off: `double`, or `mixed` if its bonds are computed in single precision.
  pure real(wp) function tolerance(kind, double, mixed)
    character(*), intent(in) :: kind
    real(wp), intent(in) :: double, mixed
    tolerance = merge(mixed, double, kind == 'mixed')
  end function tolerance

  !> Lay out body, family and model of a subject.
  subroutine build(subject)
    type(subject_type), intent(inout) :: subject
    type(material_type), allocatable :: materials(:)
    type(law_item_type), allocatable :: laws(:)
    type(crack_group) :: crack
    real(wp), allocatable :: temperature_change(:)
    logical, allocatable :: keep(:)
    integer :: count(3), i, j, k, n
    integer(i8) :: cut
    real(wp) :: delta

    delta = 3.015_wp*spacing
    count = 1
    select case (subject%dim)
    case (1); count(1) = 17
    case (2); count(:2) = [11, 9]
    case default; count = [8, 7, 6]
    end select
    if (subject%points(1) > 0) count = subject%points
    call allocate_points(subject%body, subject%dim, product(count))
    associate (body => subject%body)
      n = 0
      do k = 1, count(3)
        do j = 1, count(2)
          do i = 1, count(1)
            n = n + 1
            body%x(n, 1) = (i - 0.5_wp)*spacing
            if (subject%dim > 1) body%x(n, 2) = (j - 0.5_wp)*spacing
            if (subject%dim > 2) body%x(n, 3) = (k - 0.5_wp)*spacing
          end do
        end do
      end do
      body%spacing = spacing
      if (subject%cloud) call scatter(body)
      body%volume = body%spacing**subject%dim*depth(subject%dim)
      body%body = 1_i2
      body%grid = 1_i2
      body%grids = [grid_type([0.0_wp, 0.0_wp, 0.0_wp], spacing)]
      allocate (materials(merge(2, 1, subject%two_materials)))
      body%material = 1_i2
      if (subject%two_materials) where (body%x(:, 1) > 5.2_wp*spacing) body%material = 2_i2
      do i = 1, size(materials)
        materials(i) = new_material(i*youngs_modulus, subject%poissons_ratio/i, 7850.0_wp, &
          & subject%dim, &
          & subject%plane_strain, depth(2), depth(1), delta, subject%bond_based)
        if (subject%dilatant) call give_dilatation(delta, materials(i))
        materials(i)%expansion = 1.2e-5_wp*i
        if (subject%breaking) materials(i)%critical_stretch = 0.01_wp*i
        if (subject%breaking) materials(i)%break_in_compression = .true.
      end do
      call make_laws(subject, materials, delta, laws)
      if (subject%hole) then
        allocate (keep(body%n_points), source=.true.)
        if (subject%dim > 1) then
          do i = 1, body%n_points
            keep(i) = norm2(body%x(i, &
              & :) - (count(:subject%dim)/2 + 0.5_wp)*spacing) > 1.2_wp*spacing
          end do
        else
          keep(6) = .false.
        end if
        call keep_points(body, keep)
      end if
      call build_family(subject%kind, body, volume_rule_type(subject%rule, delta), &
        & subject%crack .or. subject%breaking, subject%key_bits, subject%least_shared, &
        & subject%family, subject%workspace)
      allocate (temperature_change(body%n_slots), source=0.0_wp)
      if (subject%thermal) then
        do i = 1, body%n_slots
          temperature_change(i) = 100*sin(real(7*body%point(i), wp))
        end do
      end if
      call new_model(body, materials, subject%projected, spread(.false., 1, body%n_slots), &
        & temperature_change, subject%model, laws)
      subject%model%surface = subject%surface
      if (subject%surface) call surface_factors(body, subject%family, materials, subject%model%D, &
        & subject%model%S, laws)
      call begin_subject(subject)
      call finish_family(subject)
      if (subject%crack .and. subject%dim == 2) then
        crack%from(:2) = [-1.0_wp, 4.0_wp]*spacing
        crack%to(:2) = [4.0_wp, 4.1_wp]*spacing
        call cut_bonds([crack], body, subject%family, cut)
      else if (subject%crack .and. subject%dim == 3) then
        crack%centre = [0.0_wp, 3.1_wp, 3.0_wp]*spacing
        crack%normal = [0.0_wp, 0.3_wp, 1.0_wp]
        crack%radius = 3.0_wp*spacing
        call cut_bonds([crack], body, subject%family, cut)
      end if
      call refresh_bonds(subject%family, subject%workspace%generic)
    end associate
  end subroutine build

  !> The bond laws of a subject; the materials get their constants.
  subroutine make_laws(subject, materials, delta, laws)
    type(subject_type), intent(in) :: subject
    type(material_type), intent(inout) :: materials(:)
    real(wp), intent(in) :: delta
    type(law_item_type), allocatable, intent(out) :: laws(:)
    type(law_table_type) :: table
    integer :: i, n

    table = all_laws()
    n = table%number_of(merge('bond_based ', 'state_based', subject%bond_based))
    if (subject%law /= '') n = table%number_of(subject%law)
    allocate (laws(size(materials)))
    do i = 1, size(materials)
      allocate (laws(i)%law, source=table%items(n)%law)
      associate (law => laws(i)%law)
        law%influence = subject%influence
        ! values with which laws yield or soften at strains of 1e-3
        if (allocated(law%parameters)) law%parameters%value = &
          & merge(1.0e-3_wp*youngs_modulus, 1.0e-3_wp, law%parameters%unit == 'Pa')
        if (law%softens) materials(i)%critical_stretch = min(4.0e-3_wp, &
          & materials(i)%critical_stretch)
        call law%set_up(materials(i), subject%dim, subject%plane_strain, delta, depth(subject%dim))
        materials(i) = law%material
      end associate
    end do
  end subroutine make_laws

  !> What the laws make of the family. The model stays the one that is written point by point, also
  !> where the generic pass computes it.
  subroutine begin_subject(subject)
    type(subject_type), intent(inout) :: subject

    call begin_laws(subject%body, subject%family, subject%model, subject%workspace%generic)
    if (subject%kind /= 'generic') return
    subject%model%generic = .true.
    call begin_laws(subject%body, subject%family, subject%model, subject%workspace%generic)
  end subroutine begin_subject

  !> Move points off the lattice by up to a fifth of a spacing, and give them spacings of their own.
  subroutine scatter(body)
    type(body_type), intent(inout) :: body
    integer :: i, c, state

    state = 17
    do i = 1, body%n_points
      do c = 1, body%dim
        body%x(i, c) = body%x(i, c) + 0.2_wp*spacing*noise(state)
      end do
      body%spacing(i) = spacing*(1 + 0.2_wp*noise(state))
    end do
  end subroutine scatter

  !> Classical constants leave no energy of dilatation in 1D; the force knows it (doc/theory.md, 2).
  pure subroutine give_dilatation(delta, material)
    real(wp), intent(in) :: delta
    type(material_type), intent(inout) :: material
    material%a = 0.3_wp*material%youngs_modulus
    material%p = 2*material%a*material%d*delta
  end subroutine give_dilatation

  !> Thickness in 2D, area in 1D.
  pure real(wp) function depth(dim)
    integer, intent(in) :: dim
    depth = 1.0_wp
    if (dim == 2) depth = 2.0e-3_wp
    if (dim == 1) depth = 3.0e-4_wp
  end function depth

  !> The subjects: every dimension with every term alone and with all of them, bars with energy
  !> of dilatation, of both kinds, and clouds where the family takes them. `number` counts on until
  !> `there` is false.
  subroutine subject_number(kind, number, subject, there)
    character(*), intent(in) :: kind
    integer, intent(in) :: number
    type(subject_type), intent(out) :: subject
    logical, intent(out) :: there
    integer, parameter :: variants = 20
    integer :: extra

    there = number <= 3*variants + merge(12, 2, kind == 'list' .or. kind == 'tables')
    if (.not. there) return
    subject%kind = kind
    if (number > 3*variants + 2) then
      extra = number - 3*variants - 2
      subject%surface = .true.
      subject%dim = 2 + mod(extra, 2)
      ! clouds, where every point has weights of its own: Lambda = 1, as printed, no dilatation
      subject%cloud = extra <= 6
      subject%projected = extra >= 3 .and. extra <= 6
      subject%bond_based = extra == 5 .or. extra == 6
      ! the other rules with Lambda = 1
      if (extra > 6) subject%rule = merge(volume_none, volume_exact, extra <= 8)
      subject%two_materials = .true.
      call build(subject)
      return
    end if
    if (number > 3*variants) then
      subject%dim = 1
      subject%dilatant = .true.
      subject%projected = number == 3*variants + 1
      call build(subject)
      return
    end if
    subject%dim = 1 + (number - 1)/variants
    select case (mod(number - 1, variants) + 1)
    case (1); subject%bond_based = .true.
    case (2); subject%projected = .false.
    case (3); subject%surface = .true.
    case (4); subject%thermal = .true.
    case (5); subject%two_materials = .true.
    case (6); subject%crack = .true.
    case (7); subject%hole = .true.
    case (8); subject%rule = volume_none
    case (9); subject%rule = volume_linear_extended
    case (10); subject%rule = volume_exact
    case (11)
      subject%bond_based = .true.
      subject%surface = .true.
      subject%thermal = .true.
      subject%two_materials = .true.
    case (12)
      subject%poissons_ratio = 0.4_wp
      subject%plane_strain = .true.
      subject%crack = .true.
      subject%hole = .true.
    case (13)
      subject%projected = .false.
      subject%poissons_ratio = 0.4_wp
      subject%surface = .true.
      subject%thermal = .true.
      subject%two_materials = .true.
      subject%crack = .true.
      subject%hole = .true.
      subject%breaking = .true.
    case (14)
      subject%projected = .false.
      subject%poissons_ratio = 0.4_wp
      subject%surface = .true.
      subject%two_materials = .true.
      subject%crack = .true.
      subject%hole = .true.
    case (15)
      subject%projected = .false.
      subject%surface = .true.
      subject%breaking = .true.
    case (16)
      subject%law = 'lps'
      subject%influence = 'constant'
      subject%projected = .false.
      subject%two_materials = .true.
      subject%crack = .true.
      subject%hole = .true.
    case (17)
      subject%influence = 'gaussian'
      subject%surface = .true.
      subject%thermal = .true.
      subject%two_materials = .true.
    case (18)
      subject%influence = 'linear'
      subject%bond_based = .true.
      subject%breaking = .true.
    case (19)
      subject%law = 'lps'
      subject%influence = 'inverse'
      subject%projected = .false.
      subject%poissons_ratio = 0.4_wp
      subject%rule = volume_linear_extended
    case default
      subject%surface = .true.
      subject%thermal = .true.
      subject%two_materials = .true.
      subject%crack = .true.
      subject%hole = .true.
      subject%rule = volume_exact
    end select
    call build(subject)
  end subroutine subject_number

  !> What a subject is, for messages.
  function name_of(subject, number) result(name)
    type(subject_type), intent(in) :: subject
    integer, intent(in) :: number
    character(:), allocatable :: name
    character(40) :: buffer
    write (buffer, '(2a, i0, a, i0)') trim(subject%kind), ', ', subject%dim, 'D, subject ', number
    name = trim(buffer)
  end function name_of

  !> Forces and dilatation coefficients by the fast loops.
  subroutine fast_force(subject, u, force, p)
    type(subject_type), intent(inout) :: subject
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), allocatable, intent(out) :: force(:, :), p(:)
    integer(i1), allocatable :: strained(:)
    integer :: k

    allocate (force(size(u, 1), size(u, 2)), p(size(u, 1)), source=0.0_wp)
    allocate (strained(size(u, 1)), source=0_i1)
    call internal_force(subject%body, subject%family, subject%model, options_of(subject%model), &
      & subject%workspace, u, p, force, strained)
    if (.not. subject%model%generic) return
    do k = 1, size(u, 1)
      p(k) = p_of(subject%model, k)*generic_point_dilatation(subject%family, subject%model, &
        & subject%workspace%generic, u, k)
    end do
  end subroutine fast_force

  !> A gradient with all components, also where the dimension has no use for them.
  pure function some_gradient(size_of_it) result(H)
    real(wp), intent(in) :: size_of_it
    real(wp) :: H(3, 3)
    H = size_of_it*reshape([1.0_wp, 0.3_wp, -0.2_wp, 0.7_wp, -0.5_wp, 0.4_wp, 0.1_wp, 0.6_wp, &
      & 0.8_wp], [3, 3])
  end function some_gradient

  !> Two points of a plane one spacing apart along x, the horizon two spacings.
  subroutine build_pair(subject)
    type(subject_type), intent(inout) :: subject
    type(material_type) :: materials(1)
    type(law_item_type), allocatable :: laws(:)

    call allocate_points(subject%body, 2, 2)
    subject%body%x(1, :) = [0.5_wp, 0.5_wp]*spacing
    subject%body%x(2, :) = [1.5_wp, 0.5_wp]*spacing
    subject%body%volume = spacing**2*depth(2)
    subject%body%spacing = spacing
    subject%body%body = 1_i2
    subject%body%material = 1_i2
    subject%body%grid = 1_i2
    subject%body%grids = [grid_type([0.0_wp, 0.0_wp, 0.0_wp], spacing)]
    call build_family(subject%kind, subject%body, volume_rule_type(subject%rule, 2.0_wp*spacing), &
      & .false., subject%key_bits, subject%least_shared, subject%family, subject%workspace)
    materials = new_material(youngs_modulus, 0.2_wp, 7850.0_wp, 2, .false., depth(2), depth(1), &
      & 2*spacing, subject%bond_based)
    subject%dim = 2
    call make_laws(subject, materials, 2*spacing, laws)
    call new_model(subject%body, materials, subject%projected, &
      & spread(.false., 1, subject%body%n_slots), spread(0.0_wp, 1, subject%body%n_slots), &
      & subject%model, laws)
    call begin_subject(subject)
    call finish_family(subject)
  end subroutine build_pair

end module force_subjects
