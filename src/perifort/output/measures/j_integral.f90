!> The J integral of a crack tip in the plane, in domain form, and the stress intensity factors of
!> its parts that are symmetric and antisymmetric about the line of the crack (doc/theory.md, 16).
!>
!> Strains come from the gradient of the displacements, stresses from the moduli. It is that of
!> static equilibrium: the inertia inside the box and forces on it are not in the sum.
module pd_output_measures_j_integral
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i4
  use pd_base_reduce, only: add_point, new_running, running_type, total_of_running
  use pd_base_text, only: line => labelled_line, to_text, with_unit
  use pd_base_warnings, only: warnings_type
  use pd_body_body, only: body_type
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_law_material, only: material_type
  use pd_motion_system, only: system_type
  use pd_output_fields_between, only: is_inside, stencil_at, stencil_type
  use pd_output_fields_gradient, only: displacement_gradient, lack_of_stress, strain_of
  use pd_output_measures_measure, only: measure_list_type, measure_type, row_source_type
  use pd_output_measures_probe, only: nearest_slots
  use pd_output_results_types, only: column_type
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: add_j_integrals

  !> A box around a tip, and the points of its outer half.
  type, extends(measure_type) :: j_measure_type
    character(:), allocatable :: name
    integer :: number = 0                    !! of its group
    real(wp) :: lower(2) = 0.0_wp            !! corners of the box [m]
    real(wp) :: upper(2) = 0.0_wp
    real(wp) :: tip(2) = 0.0_wp              !! a position on the line of the crack [m]
    real(wp) :: axes(2, 2) = 0.0_wp          !! rows: unit vectors along the crack and across it
    real(wp) :: thickness = 1.0_wp           !! [m]
    integer :: material = 0                  !! of the points
    logical :: moving = .false.              !! a run in time
    integer(i4), allocatable :: slots(:)     !! of the points, in the order of the points
    integer, allocatable :: mirror(:)        !! nearest slots to their mirror images
    real(wp), allocatable :: slope(:, :)     !! gradient of the weight q along and across (2, point)
                                             !! [1/m]
  contains
    procedure :: begin => begin_j
    procedure :: columns => columns_of_j
    procedure :: row => row_of_j
    procedure :: describe => describe_j
    procedure :: warn => warn_of_j
  end type j_measure_type

contains

  !> Add the integrals of a scene.
  subroutine add_j_integrals(scene, measures)
    type(scene_type), intent(in) :: scene                !! a checked scene
    type(measure_list_type), intent(inout) :: measures   !! added to
    type(j_measure_type) :: measure
    integer :: i

    if (.not. allocated(scene%j_integrals)) return
    do i = 1, size(scene%j_integrals)
      associate (group => scene%j_integrals(i))
        measure%name = trim(group%name)
        measure%number = i
        measure%lower = group%lower(:2)
        measure%upper = group%upper(:2)
        measure%tip = group%tip(:2)
        measure%axes(1, :) = group%direction(:2)/norm2(group%direction(:2))
        measure%axes(2, :) = [-measure%axes(1, 2), measure%axes(1, 1)]
        measure%thickness = scene%header%thickness
        measure%moving = scene%time%method /= 'relaxation'
      end associate
      call measures%add(measure)
    end do
  end subroutine add_j_integrals

  !> The gradient [1/m] of the weight q: 1 in the inner half of the box, 0 at its faces, cubic
  !> between them in each direction.
  pure function slope_of(measure, x) result(slope)
    class(j_measure_type), intent(in) :: measure
    real(wp), intent(in) :: x(2)   !! [m]
    real(wp) :: slope(2)
    real(wp) :: q(2), s(2), half(2), way(2)

    half = (measure%upper - measure%lower)/2
    way = (x - (measure%lower + measure%upper)/2)/half
    s = min(1.0_wp, max(0.0_wp, 2*abs(way) - 1))
    q = 1 - s**2*(3 - 2*s)
    slope = -6*s*(1 - s)*2*sign(1.0_wp, way)/half*q([2, 1])
  end function slope_of

  !> The mirror image of a position about the line of the crack.
  pure function mirrored(measure, x) result(image)
    class(j_measure_type), intent(in) :: measure
    real(wp), intent(in) :: x(2)   !! [m]
    real(wp) :: image(2)
    image = x - 2*dot_product(x - measure%tip, measure%axes(2, :))*measure%axes(2, :)
  end function mirrored

  !> Find the points of the outer half of the box. They must be of one elastic material, without
  !> thermal strain, and have their mirror images in the body.
  subroutine begin_j(measure, scene, system, error)
    class(j_measure_type), intent(inout) :: measure
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: reason
    real(wp) :: slope(2)
    real(wp), allocatable :: image(:, :)
    integer :: p, k, n

    associate (body => system%body)
      reason = lack_of_stress(system)
      if (reason == '' .and. system%model%thermal) reason = 'with temperature changes it '// &
        & 'depends on the box'
      if (reason == '') reason = lack_of_room(measure, body)
      allocate (measure%slots(count(in_box(measure, body))))
      allocate (image(size(measure%slots), 2), measure%slope(2, size(measure%slots)))
      if (reason == '' .and. size(measure%slots) == 0) reason = 'there is no point in the '// &
        & 'outer half of the box'
      n = 0
      do p = 1, body%order%n_owned
        if (reason /= '') exit
        k = body%slot(p)
        slope = slope_of(measure, body%x(k, :))
        if (all(abs(slope) <= 0.0_wp)) cycle
        n = n + 1
        image(n, :) = mirrored(measure, body%x(k, :))
        measure%slots(n) = int(k, i4)
        measure%slope(:, n) = matmul(measure%axes, slope)
        if (n == 1) measure%material = body%material(k)
        if (body%material(k) /= measure%material) &
          & reason = 'there is more than one material in the box'
      end do
      if (reason == '') measure%mirror = nearest_slots(body, image)
      do n = 1, size(image, 1)
        if (reason /= '') exit
        if (is_inside(system, measure%mirror(n), image(n, :))) cycle
        reason = 'the mirror image of the box about the line of the crack reaches beyond the '// &
          & 'body: at ('//to_text(image(n, 1), 4)//', '//to_text(image(n, 2), 4)//') m'
      end do
    end associate
    if (reason /= '') call scene_fault(error, scene, 'j_integral', measure%number, 'lower', &
      & "there is no J integral '"//measure%name//"'", reason)
  end subroutine begin_j

  !> Why a box is not in the body, '' if it is: the integral needs the whole of its outer half.
  function lack_of_room(measure, body) result(reason)
    class(j_measure_type), intent(in) :: measure
    type(body_type), intent(in) :: body
    character(:), allocatable :: reason
    real(wp) :: least(2), most(2)
    integer :: p, k

    least = huge(1.0_wp)
    most = -huge(1.0_wp)
    do p = 1, body%n_points
      k = body%slot(p)
      least = min(least, body%x(k, :) - 0.51_wp*body%spacing(k))
      most = max(most, body%x(k, :) + 0.51_wp*body%spacing(k))
    end do
    reason = ''
    if (any(measure%lower < least .or. measure%upper > most)) reason = 'the box reaches beyond '// &
      & 'the bodies'
  end function lack_of_room

  !> Which points of a process lie in the outer half of the box.
  pure function in_box(measure, body) result(inside)
    class(j_measure_type), intent(in) :: measure
    type(body_type), intent(in) :: body
    logical :: inside(body%order%n_owned)
    integer :: p

    do p = 1, body%order%n_owned
      inside(p) = any(abs(slope_of(measure, body%x(body%slot(p), :))) > 0.0_wp)
    end do
  end function in_box

  !> J and the stress intensity factors.
  function columns_of_j(measure, dim) result(columns)
    class(j_measure_type), intent(in) :: measure
    integer, intent(in) :: dim
    type(column_type), allocatable :: columns(:)

    associate (unused_dim => dim)
    end associate
    columns = [column_type(measure%name//'_J', 'J/m2', 'j_integral'), &
      & column_type(measure%name//'_K_I', 'Pa m^0.5', 'j_integral'), &
      & column_type(measure%name//'_K_II', 'Pa m^0.5', 'j_integral')]
  end function columns_of_j

  !> Their values.
  subroutine row_of_j(measure, now, values)
    class(j_measure_type), intent(inout) :: measure
    type(row_source_type), intent(in) :: now
    real(wp), intent(out) :: values(:)
    type(system_type), pointer :: system
    type(running_type) :: running
    type(bonds_type) :: bonds
    real(wp), allocatable :: terms(:, :)
    real(wp) :: totals(6), stiffness
    integer :: s

    system => now%system
    allocate (terms(5, size(measure%slots)))
    !$omp parallel default(none) shared(measure, system, terms) private(bonds, s)
    call allocate_bonds(system%family, bonds)
    !$omp do schedule(dynamic, 16)
    do s = 1, size(measure%slots)
      terms(:, s) = terms_of(measure, system, s, bonds)
    end do
    !$omp end parallel
    call new_running(running)
    do s = 1, size(measure%slots)
      call add_point(system%body%order, system%body%point(measure%slots(s)), terms(:, s), running)
    end do
    totals = total_of_running(system%body%order, running)/measure%thickness
    associate (m => system%model%materials(measure%material))
      ! Young's modulus of the plane: E in plane stress, E/(1 - nu^2) in plane strain
      stiffness = 4*m%shear_modulus*m%bulk_modulus/(m%shear_modulus + m%bulk_modulus)
    end associate
    values(:) = [totals(1), sign(sqrt(stiffness*abs(totals(2))), totals(4)), &
      & sign(sqrt(stiffness*abs(totals(3))), totals(5))]
  end subroutine row_of_j

  !> What the `s`-th point adds, times the thickness: J; J of the symmetric and of the antisymmetric
  !> part [J m/m2]; and, ahead of the tip, the stresses that give the sense of the two.
  function terms_of(measure, system, s, bonds) result(terms)
    class(j_measure_type), intent(in) :: measure
    type(system_type), intent(in) :: system
    integer, intent(in) :: s
    type(bonds_type), intent(inout) :: bonds
    real(wp) :: terms(5)
    type(stencil_type) :: stencil
    real(wp), dimension(3, 3) :: here, there, one
    real(wp) :: stress(2, 2), place(2)
    integer :: i, k

    k = measure%slots(s)
    associate (body => system%body, m => system%model%materials(measure%material))
      call gradient_at(k, here)
      call stencil_at(system, measure%mirror(s), mirrored(measure, body%x(k, :)), stencil)
      there = 0.0_wp
      do i = 1, size(stencil%place)
        call gradient_at(stencil%place(i), one)
        there = there + stencil%weight(i)*one
      end do
      ! the image of a gradient
      there(1, 2) = -there(1, 2)
      there(2, 1) = -there(2, 1)
      terms(1) = flux(m, here, strain_of(here), .true., measure%slope(:, s))
      one = (here + there)/2
      terms(2) = flux(m, one, small_strain(one), .false., measure%slope(:, s))
      stress = stress_of_strain(m, small_strain(one))
      terms(4) = stress(2, 2)
      one = (here - there)/2
      terms(3) = flux(m, one, small_strain(one), .false., measure%slope(:, s))
      stress = stress_of_strain(m, small_strain(one))
      terms(5) = stress(1, 2)
      place = matmul(measure%axes, body%x(k, :) - measure%tip)
      if (abs(place(2)) > place(1)) terms(4:) = 0.0_wp
      terms = terms*body%volume(k)
    end associate

  contains

    !> The gradient of the displacements at a slot, along and across the crack.
    subroutine gradient_at(slot, gradient)
      integer, intent(in) :: slot
      real(wp), intent(out) :: gradient(3, 3)
      real(wp) :: global(3, 3)
      logical :: defined

      call system%family%bonds_of(slot, bonds)
      call displacement_gradient(system%state%u, slot, bonds, global, defined)
      gradient = 0.0_wp
      gradient(:2, :2) = matmul(measure%axes, matmul(global(:2, :2), transpose(measure%axes)))
    end subroutine gradient_at
  end function terms_of

  !> (P_ij du_i/dx_1 - W delta_1j) dq/dx_j: with `large` strains P = F S, else P = S.
  pure real(wp) function flux(m, gradient, strain, large, slope)
    type(material_type), intent(in) :: m
    real(wp), intent(in) :: gradient(3, 3), strain(3, 3)
    logical, intent(in) :: large
    real(wp), intent(in) :: slope(2)
    real(wp) :: P(2, 2), energy

    P = stress_of_strain(m, strain)
    energy = sum(P*strain(:2, :2))/2
    if (large) P = P + matmul(gradient(:2, :2), P)
    flux = dot_product(matmul(gradient(:2, 1), P), slope) - energy*slope(1)
  end function flux

  pure function small_strain(gradient) result(strain)
    real(wp), intent(in) :: gradient(3, 3)
    real(wp) :: strain(3, 3)
    strain = (gradient + transpose(gradient))/2
  end function small_strain

  !> The stress in the plane [Pa].
  pure function stress_of_strain(m, strain) result(stress)
    type(material_type), intent(in) :: m
    real(wp), intent(in) :: strain(3, 3)
    real(wp) :: stress(2, 2)
    integer :: c

    stress = 2*m%shear_modulus*strain(:2, :2)
    do c = 1, 2
      stress(c, c) = stress(c, c) + (m%bulk_modulus - m%shear_modulus)*(strain(1, 1) + strain(2, 2))
    end do
  end function stress_of_strain

  !> Where it is taken.
  function describe_j(measure, system) result(text)
    class(j_measure_type), intent(in) :: measure
    type(system_type), intent(in) :: system
    character(:), allocatable :: text

    associate (unused_system => system)
    end associate
    text = line('J integral', measure%name//' is the sum over '//to_text(size(measure%slots))// &
      & ' points')
  end function describe_j

  !> The inner half of the box should hold the tip with its surroundings, and the state be at rest.
  subroutine warn_of_j(measure, system, warnings)
    class(j_measure_type), intent(in) :: measure
    type(system_type), intent(in) :: system
    type(warnings_type), intent(inout) :: warnings
    real(wp) :: around

    around = minval((measure%upper - measure%lower)/4 - abs(measure%tip &
      & - (measure%upper + measure%lower)/2))
    if (around < system%family%rule%delta) call warnings%add('J integral '// &
      & to_text(measure%number), 'J integral '//measure%name//': the inner half of its box '// &
      & 'extends '//with_unit(around, 'm', 3)//' from the tip, less than the horizon of '// &
      & with_unit(system%family%rule%delta, 'm', 3), tell=.false.)
    if (measure%moving) call warnings%add('J integral', 'J integrals are those of static '// &
      & 'equilibrium: in a run in time they lack the inertia within their boxes', tell=.false.)
  end subroutine warn_of_j

end module pd_output_measures_j_integral
