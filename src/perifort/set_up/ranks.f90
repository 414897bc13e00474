!> A scene on several ranks: what they can have, which points each of them takes, and what they
!> count together.
module pd_set_up_ranks
  use pd_base_error, only: error_type
  use pd_base_lanes, only: lanes
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_reduce, only: count_of_ranks
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type
  use pd_body_division, only: divide_space, division_type, work_of_points
  use pd_body_lattices, only: coordinate
  use pd_body_survey, only: survey_type
  use pd_body_windows, only: begin_work, make_part, work_of_windows
  use pd_body_work, only: work_of, work_rule_type, zone_type
  use pd_comm_world, only: world_type
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  use pd_family_volume, only: reach, volume_rule_type
  use pd_force_contact, only: skin_between
  use pd_force_contact_law, only: usual_distance
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: contact_group, has_grid, has_refinement, scene_type, is_set
  use pd_set_up_terms, only: sides_of_contact
  implicit none (type, external)
  private
  public :: check_ranks, divide_survey, find_lowest, rule_of_work, bounds_of_bodies, &
    & work_of_body, join_ranks, bonds_of_ranks, broken_bonds, reproducible_layer

  character(*), parameter :: one_rank = 'on one rank it can'

contains

  !> An error if the scene has something that is not computed on several ranks.
  subroutine check_ranks(scene, error)
    type(scene_type), intent(in) :: scene   !! a checked scene
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    do i = 1, size(scene%bodies)
      if (scene%bodies(i)%mesh /= '') call refuse('body', i, 'mesh', 'a mesh')
      if (scene%bodies(i)%surface /= '') call refuse('body', i, 'surface', 'a surface')
    end do
    if (scene%time%method == 'relaxation') then
      if (size(scene%cracks) + count(is_set(scene%materials%critical_stretch) .or. &
        & is_set(scene%materials%critical_energy_release_rate)) > 0 .and. &
        & scene%relaxation%growth /= 'load_steps') call refuse('relaxation', 1, 'growth', &
        & 'growth by events', "growth = 'load_steps' it can have")
    else if (scene%time%method /= 'explicit') then
      call refuse('time', 1, 'method', "method = '"//trim(scene%time%method)//"'")
    end if
    if (has_refinement(scene)) call refuse('refine', 1, '', '&refine')
    if (scene%horizon%local) call refuse('horizon', 1, 'local', 'horizons of points')
    if (scene%horizon%surface_correction == 'consistent') &
      & call refuse('horizon', 1, 'surface_correction', "surface_correction = 'consistent'")
    if (size(scene%j_integrals) > 0) call refuse('j_integral', 1, '', '&j_integral')
    if (scene%output%cells) call refuse('output', 1, 'cells', 'cells')
    ! fragments are found by all ranks together, values at places by those that are near
    do i = 1, size(scene%probes)
      if (has_fragment(scene%probes(i)%fields)) call refuse('probe', i, 'fields', &
        & "a probe of the field 'fragment'", 'an output can have it')
    end do
    do i = 1, size(scene%lines)
      if (has_fragment(scene%lines(i)%fields)) call refuse('line', i, 'fields', &
        & "a line of the field 'fragment'", 'an output can have it')
    end do

  contains

    !> Whether the field `fragment` is among some; without any it is not.
    pure logical function has_fragment(fields)
      character(*), intent(in), optional :: fields(:)
      has_fragment = .false.
      if (present(fields)) has_fragment = any(fields == 'fragment')
    end function has_fragment

    !> Refuse one thing.
    subroutine refuse(group, number, key, what, instead)
      character(*), intent(in) :: group, key, what
      integer, intent(in) :: number
      character(*), intent(in), optional :: instead  !! what can be done
      character(:), allocatable :: note

      if (allocated(error)) return
      note = one_rank
      if (present(instead)) note = instead
      call scene_fault(error, scene, group, number, key, 'a run on several ranks cannot have '// &
        & what, note)
    end subroutine refuse
  end subroutine check_ranks

  !> The thickness of the layers between which cuts may lie, where forces must not depend on the
  !> ranks: loops work on blocks of so many points of a row.
  pure integer function reproducible_layer(mixed) result(points)
    logical, intent(in) :: mixed  !! bonds in single precision
    points = merge(2*lanes, lanes, mixed)
  end function reproducible_layer

  !> Make the points of this rank and copies of others, without all points. An error if some rank
  !> would have no point.
  subroutine divide_survey(scene, rule, blocks, world, survey, body, owner, error)
    type(scene_type), intent(in), target :: scene
    type(volume_rule_type), intent(in) :: rule     !! how far bonds reach
    integer, intent(in) :: blocks                  !! cuts across x lie between so many points of
                                                   !! a lattice's rows; 1: between any
    type(world_type), intent(inout), target :: world
    type(survey_type), intent(in), target :: survey  !! of the points of all ranks
    type(body_type), intent(out) :: body           !! in point order
    integer, allocatable, intent(out) :: owner(:)  !! rank that owns each copy, from 0
    type(error_type), allocatable, intent(out) :: error
    type(work_of_windows) :: work
    type(work_rule_type) :: costs
    type(division_type) :: division
    integer :: g

    call rule_of_work(scene, survey%none%delta, survey%none%largest_spacing, survey%lower, &
      & survey%upper, costs)
    call begin_work(scene, survey, costs, blocks, work)
    call divide_space(work, world%ranks, division)
    call check_division(scene, division, error)
    if (allocated(error)) return
    call make_part(scene, survey, division, world%rank, reach(rule, survey%none%largest_spacing, &
      & survey%none%dim), body, owner)
    body%order%ranks => world
    body%order%reproducible = world%reproducible
    if (.not. world%reproducible) return
    do g = 1, size(body%grids)
      if (survey%highest(1, g) >= survey%lowest(1, g)) &
        & body%grids(g)%lowest = survey%lowest(:body%dim, g)
    end do
  end subroutine divide_survey

  !> An error if some rank would have no point.
  subroutine check_division(scene, division, error)
    type(scene_type), intent(in) :: scene
    type(division_type), intent(in) :: division
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    i = minloc(division%work, dim=1) - 1
    if (division%work(i) > 0.0_wp) return
    call scene_fault(error, scene, 'body', 1, 'points', 'the scene has too few points for '// &
      & to_text(division%ranks)//' ranks: rank '//to_text(i)//' would have none', &
      & 'use fewer ranks; with --reproducible cuts lie between blocks of points of a row')
  end subroutine check_division

  !> Note where each grid begins, so that blocks and slabs of lattices are the same on all ranks.
  subroutine find_lowest(body)
    type(body_type), intent(inout) :: body  !! in point order, with all points
    integer :: g, c

    do g = 1, size(body%grids)
      if (.not. any(body%grid == g)) cycle
      allocate (body%grids(g)%lowest(body%dim))
      do c = 1, body%dim
        body%grids(g)%lowest(c) = minval(coordinate(body%grids(g), body%x, c), mask=body%grid == g)
      end do
    end do
  end subroutine find_lowest

  !> What the points of a scene cost: their bonds, the slots of blocks of lattices, and the contact
  !> of bodies where the boxes around them, a contact's distance wider, meet at the start. Contact
  !> of pieces of one body and with rigid bodies is not foreseen.
  subroutine rule_of_work(scene, delta, spacing, lower, upper, rule)
    type(scene_type), intent(in) :: scene      !! a checked scene
    real(wp), intent(in) :: delta              !! horizon [m]
    real(wp), intent(in) :: spacing            !! the largest of the points [m]
    real(wp), intent(in) :: lower(:, :)        !! (3, bodies) the least positions of each body [m]
    real(wp), intent(in) :: upper(:, :)        !! (3, bodies) the largest
    type(work_rule_type), intent(out) :: rule
    type(zone_type), allocatable :: zones(:)
    type(zone_type) :: zone
    integer, allocatable :: side(:)
    real(wp) :: distance
    integer :: i, a, b

    rule%delta = delta
    rule%in_blocks = scene%horizon%family /= 'list' .and. all(has_grid(scene%bodies))
    allocate (zones(0))
    do i = 1, size(scene%contacts)
      side = sides_of_contact(scene, i)
      distance = usual_distance*spacing
      if (is_set(scene%contacts(i)%distance)) distance = scene%contacts(i)%distance
      distance = distance + skin_between*spacing/2
      do a = 1, size(side)
        do b = 1, size(side)
          if (a == b .or. side(a) == 0 .or. side(b) == 0) cycle
          if (side(a) == side(b) .and. maxval(side) > 1) cycle
          zone%body = a
          zone%lower = lower(:, b) - distance
          zone%upper = upper(:, b) + distance
          call work_of_contact(scene%contacts(i), zone)
          zones = [zones, zone]
        end do
      end do
    end do
    call move_alloc(zones, rule%zones)
  end subroutine rule_of_work

  !> The least and the largest positions of the points of each body.
  pure subroutine bounds_of_bodies(body, lower, upper)
    type(body_type), intent(in) :: body                  !! arranged in slots
    real(wp), intent(out) :: lower(:, :), upper(:, :)    !! (3, bodies) [m]
    integer :: i, b

    lower = huge(1.0_wp)
    upper = -huge(1.0_wp)
    do i = 1, body%n_points
      associate (k => body%slot(i), dim => body%dim)
        b = body%body(k)
        lower(:dim, b) = min(lower(:dim, b), body%x(k, :))
        upper(:dim, b) = max(upper(:dim, b), body%x(k, :))
      end associate
    end do
  end subroutine bounds_of_bodies

  !> What a contact costs a point that has it, as measured on blocks that slide on plates in 2D and
  !> 3D, with families of 28 to 115 members.
  pure subroutine work_of_contact(contact, zone)
    type(contact_group), intent(in) :: contact
    type(zone_type), intent(inout) :: zone
    integer, parameter :: of_centres = 1000, of_family = 20

    zone%of_contact = of_centres
    zone%of_member = 0
    if (contact%normals == 'centres') return
    zone%of_member = 40
    if (contact%friction > 0.0_wp) zone%of_member = 88
    if (is_set(contact%restitution) .or. is_set(contact%damping)) zone%of_member = 140
    zone%of_contact = of_family*zone%of_member
  end subroutine work_of_contact

  !> The work of a body's points.
  subroutine work_of_body(body, blocks, work, rule)
    type(body_type), intent(in) :: body              !! with all points, in any slots
    integer, intent(in) :: blocks                    !! as in `divide_survey`
    type(work_of_points), intent(out) :: work
    type(work_rule_type), intent(in), optional :: rule  !! what points cost; absent: all the same
    real(wp) :: spacing
    integer :: c

    work%dim = body%dim
    work%x = body%x(body%slot, :)
    if (present(rule)) then
      work%weight = work_of(rule, body, body%slot)
    else
      allocate (work%weight(body%n_points), source=1.0_wp)
    end if
    spacing = minval(body%spacing(body%slot))
    do c = 1, body%dim
      work%lower(c) = minval(work%x(:, c)) - spacing/2
      work%upper(c) = maxval(work%x(:, c)) + spacing/2
      work%layer(c) = spacing
    end do
    work%layer(1) = blocks*spacing
  end subroutine work_of_body

  !> Tell all ranks who owns the copies, when the body is arranged in slots.
  subroutine join_ranks(world, body, owner)
    type(world_type), intent(inout) :: world
    type(body_type), intent(in) :: body
    integer, intent(in) :: owner(:)        !! of the points behind the owned ones

    associate (n => body%order%n_owned)
      call world%join(owner, body%number(n + 1:), body%slot(n + 1:), body%number(:n), &
        & body%slot(:n))
    end associate
  end subroutine join_ranks

  !> Broken bonds of the owned points of all ranks, each counted once.
  integer(i8) function broken_bonds(body, family) result(number)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(bonds_type) :: bonds
    integer :: i

    number = 0_i8
    call allocate_bonds(family, bonds)
    do i = 1, body%order%n_owned
      call family%bonds_of(int(body%slot(i)), bonds)
      number = number + count(.not. bonds%intact(:bonds%n))
    end do
    number = count_of_ranks(body%order, number)/2_i8
  end function broken_bonds

  !> Bonds of the owned points of all ranks: ordered pairs.
  integer(i8) function bonds_of_ranks(body, family) result(number)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(bonds_type) :: bonds
    integer(i4), allocatable :: known(:)
    integer :: i, k, a

    number = 0_i8
    allocate (known(body%n_slots), source=-1_i4)
    call allocate_bonds(family, bonds)
    do i = 1, body%order%n_owned
      k = body%slot(i)
      a = family%alike(k)
      if (known(a) < 0_i4) then
        call family%bonds_of(a, bonds)
        known(a) = int(bonds%n, i4)
      end if
      number = number + known(a)
    end do
    number = count_of_ranks(body%order, number)
  end function bonds_of_ranks

end module pd_set_up_ranks
