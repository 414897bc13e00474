!> Whether a scene fits into the memory, before any of its points is made.
module pd_set_up_memory
  use pd_base_kinds, only: wp, i8
  use pd_base_error, only: error_type
  use pd_base_system, only: available_memory
  use pd_base_text, only: to_text, with_unit
  use pd_law_laws, only: law_table_type
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: has_grid, has_own_horizons, is_lattice, is_set, laws_of, &
    & scene_type
  use pd_body_generate, only: horizon_of
  implicit none (type, external)
  private
  public :: check_memory, predicted_memory, any_critical

contains

  !> An error if the lattice bodies of a scene need more memory than there is, at the body with the
  !> most points. Refined cells are known when `points` are. Of several ranks each needs its part;
  !> how many ranks share a machine is not known.
  subroutine check_memory(scene, error, points, ranks)
    type(scene_type), intent(in) :: scene                !! a checked scene
    type(error_type), allocatable, intent(out) :: error  !! too many points
    integer, intent(in), optional :: points  !! number of them; absent: those of the lattices
    integer, intent(in), optional :: ranks   !! how many there are; 1 if absent
    real(wp) :: need, there, number

    number = sum(numbers_of_points(scene))
    if (present(points)) number = points
    need = predicted_memory(scene, points)
    if (present(ranks)) need = need/ranks
    there = real(available_memory(), wp)
    if (need <= there) return
    call scene_fault(error, scene, 'body', largest_body(scene), 'points', 'the scene has '// &
      & to_text(int(number, i8))//' points and needs about '// &
      & with_unit(need, 'B', 3)//' of memory', 'only '//with_unit(there, 'B', 3)//' are available')
  end subroutine check_memory

  !> Largest memory that a run of a scene takes [bytes], without its clouds and surfaces, whose
  !> points are not known before they are read; 0 without lattice bodies. The constants are fitted
  !> to the largest resident sets of runs of 1e5 to 2e5 points in each dimension on two threads,
  !> with horizons of 3 to 5 spacings: both kinds of families, bonds that break, and the generic
  !> pass with two laws and with laws that have a history. The prediction is 0.9 to 1.2 times what
  !> they took.
  real(wp) function predicted_memory(scene, number) result(bytes)
    type(scene_type), intent(in) :: scene  !! a checked scene
    integer, intent(in), optional :: number  !! of points; absent: those of the lattices
    real(wp), parameter :: program = 18.5e6_wp                          !! without points
    real(wp), parameter :: per_point(3) = [165.0_wp, 280.0_wp, 500.0_wp]  !! in 1D, 2D, 3D
    real(wp), parameter :: per_list_point = 175.0_wp, per_list_bond = 1.6_wp  !! members, tables
    real(wp), parameter :: per_generic_point = 60.0_wp                  !! the same without tables
    real(wp), parameter :: per_exact_bond = 17.5_wp                     !! partial volumes of lists
    real(wp), parameter :: per_weighted_bond = 35.0_wp                  !! weights of lists, tables
    real(wp), parameter :: per_weight = 16.0_wp                         !! tables of lattices
    real(wp), parameter :: per_bit = 0.16_wp                            !! of a lattice, padded
    real(wp), parameter :: per_breaking = 30.0_wp                       !! limits and damage
    real(wp), parameter :: per_beyond = 10.0_wp                         !! substeps, a component
    real(wp), parameter :: per_solver = 95.0_wp, per_rule = 24.0_wp     !! a component
    real(wp), parameter :: block = 8.0_wp                               !! slots with one table
    real(wp), parameter :: per_generic_bond = 33.0_wp                   !! of both directions each
    real(wp), parameter :: per_history = 13.0_wp                        !! a real, two states
    real(wp), parameter :: in_joints = 0.3_wp                           !! points between grids
    real(wp), parameter :: pi = acos(-1.0_wp)
    real(wp) :: points, ratio, members, kinds, listed
    integer :: dim, history
    logical :: breaking, generic

    bytes = 0.0_wp
    dim = scene%header%dimension
    points = sum(numbers_of_points(scene))
    if (present(number)) points = number
    if (points <= 0.0_wp) return
    ratio = max(1.0_wp, horizon_ratio(scene))
    select case (dim)
    case (1); members = 2*ratio
    case (2); members = pi*min(ratio, 1.0e6_wp)**2
    case default; members = 4*pi/3*min(ratio, 1.0e6_wp)**3
    end select
    members = min(points, members)
    breaking = size(scene%cracks) + size(scene%contacts) > 0 .or. any_critical(scene)
    call find_laws(scene, generic, history)
    bytes = program + points*per_point(dim)
    if (breaking) bytes = bytes + points*per_breaking
    if (scene%time%substeps) bytes = bytes + points*dim*per_beyond
    ! the part of the points that stands in lists
    listed = 0.0_wp
    if (scene%horizon%family == 'list' .or. any(.not. has_grid(scene%bodies))) then
      listed = 1.0_wp
    else if (has_own_horizons(scene)) then
      listed = merge(1.0_wp, in_joints, generic)
    end if
    if (listed > 0.0_wp) then
      bytes = bytes + listed*points*(merge(per_generic_point, per_list_point, generic) &
        & + per_list_bond*members)
      if (scene%horizon%volume_correction == 'exact') &
        & bytes = bytes + listed*points*per_exact_bond*members
      if (scene%horizon%surface_correction == 'consistent') &
        & bytes = bytes + listed*points*per_weighted_bond*members
    end if
    if (listed < 1.0_wp) then
      ! blocks near the surfaces have weights of their own
      kinds = min(points/block, (2*min(ratio, 1.0e4_wp) + 1)**dim)
      bytes = bytes + kinds*members*block*per_weight
      if (breaking) bytes = bytes + points*per_bit*members
    end if
    if (generic) bytes = bytes + points*members*(per_generic_bond + per_history*history)
    if (scene%time%method == 'relaxation') then
      bytes = bytes + points*dim*per_solver
    else if (index(scene%time%integrator, 'adams') == 1 .or. &
      & scene%time%integrator == 'runge_kutta') then
      bytes = bytes + points*dim*per_rule
    end if
  end function predicted_memory

  !> Whether the generic pass computes the laws of a scene, and the most reals of history of a bond.
  subroutine find_laws(scene, generic, history)
    type(scene_type), intent(in) :: scene
    logical, intent(out) :: generic
    integer, intent(out) :: history
    type(law_table_type) :: laws
    character(:), allocatable :: influence, others
    integer :: i, n, first

    laws = laws_of(scene)
    generic = .false.
    history = 0
    first = 0
    do i = 1, size(scene%materials)
      n = laws%number_of(scene%materials(i)%model)
      if (n == 0) cycle
      influence = trim(laws%items(n)%law%influence)
      if (scene%materials(i)%influence /= '') influence = trim(scene%materials(i)%influence)
      if (first == 0) then
        first = n
        others = influence
      end if
      associate (law => laws%items(n)%law)
        generic = generic .or. .not. law%weighted .or. influence /= others &
          & .or. .not. same_type_as(law, laws%items(first)%law)
        history = max(history, law%bond_history)
      end associate
    end do
  end subroutine find_laws

  !> Number of points of each body's lattice, 0 for clouds.
  pure function numbers_of_points(scene) result(numbers)
    type(scene_type), intent(in) :: scene  !! a checked scene
    real(wp) :: numbers(size(scene%bodies))
    integer :: i

    numbers = 0.0_wp
    do i = 1, size(numbers)
      if (is_lattice(scene%bodies(i))) &
        & numbers(i) = product(real(scene%bodies(i)%points(:scene%header%dimension), wp))
    end do
  end function numbers_of_points

  !> Number of the body with the most lattice points.
  pure integer function largest_body(scene) result(number)
    type(scene_type), intent(in) :: scene  !! a checked scene
    number = maxloc(numbers_of_points(scene), dim=1)
  end function largest_body

  !> Horizon over the largest spacing of the lattice bodies [-].
  pure real(wp) function horizon_ratio(scene) result(ratio)
    type(scene_type), intent(in) :: scene  !! a checked scene with a lattice body
    real(wp) :: spacing
    integer :: i

    spacing = 0.0_wp
    do i = 1, size(scene%bodies)
      associate (body => scene%bodies(i))
        if (body%surface /= '') spacing = max(spacing, body%spacing)
        if (is_lattice(body)) spacing = max(spacing, (body%upper(1) - body%lower(1))/body%points(1))
      end associate
    end do
    ratio = horizon_of(scene, spacing)/spacing
  end function horizon_ratio

  !> Whether some material of the scene can fail.
  pure logical function any_critical(scene)
    type(scene_type), intent(in) :: scene  !! a checked scene
    any_critical = any(is_set(scene%materials%critical_stretch)) .or. &
      & any(is_set(scene%materials%critical_energy_release_rate))
  end function any_critical

end module pd_set_up_memory
