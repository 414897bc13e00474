!> Force and moment that bonds carry across a plane: what equilibrium of a part of the body needs.
module pd_output_measures_section
  use pd_base_error, only: error_type, internal_fault
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_reduce, only: add_point, count_of_ranks, new_running, running_type, &
    & total_of_running
  use pd_base_text, only: line => labelled_line, to_text
  use pd_body_body, only: body_type
  use pd_body_shapes, only: touch
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_motion_system, only: system_type
  use pd_output_fields_pair_force, only: pair_force
  use pd_output_measures_measure, only: measure_list_type, measure_type, row_source_type
  use pd_output_results_types, only: column_type
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: is_set, scene_type
  implicit none (type, external)
  private
  public :: add_sections

  character(*), parameter :: xyz(3) = ['x', 'y', 'z']

  !> A plane, and the points behind it whose bonds cross it.
  type, extends(measure_type) :: section_measure_type
    character(:), allocatable :: name
    integer :: number = 0                  !! of its group
    real(wp) :: point(3) = 0.0_wp          !! on it; moments are about this position [m]
    real(wp) :: normal(3) = 0.0_wp         !! a unit vector, towards what is ahead
    real(wp) :: lower(3) = -huge(1.0_wp)   !! where a bond must cross it to count: from here, ...
    real(wp) :: upper(3) = huge(1.0_wp)    !! ... to less than this [m]
    integer(i4), allocatable :: slots(:)   !! of points behind it with bonds that cross, in the
                                           !! order of the points
    integer(i8) :: bonds = 0_i8            !! that cross it
  contains
    procedure :: begin => begin_section
    procedure :: columns => columns_of_section
    procedure :: row => row_of_section
    procedure :: describe => describe_section
  end type section_measure_type

contains

  !> Add the sections of a scene.
  subroutine add_sections(scene, measures)
    type(scene_type), intent(in) :: scene                !! a checked scene
    type(measure_list_type), intent(inout) :: measures   !! added to
    type(section_measure_type) :: measure
    integer :: i, d

    if (.not. allocated(scene%sections)) return
    d = scene%header%dimension
    do i = 1, size(scene%sections)
      associate (group => scene%sections(i))
        measure%name = trim(group%name)
        measure%number = i
        measure%point(:d) = group%point(:d)
        measure%normal(:d) = group%normal(:d)/norm2(group%normal(:d))
        measure%lower = merge(group%lower, -huge(1.0_wp), is_set(group%lower))
        measure%upper = merge(group%upper, huge(1.0_wp), is_set(group%upper))
      end associate
      call measures%add(measure)
    end do
  end subroutine add_sections

  !> Distance of a slot from the plane [m], above 0 ahead of it. Points on the plane are behind it.
  pure real(wp) function ahead(measure, body, k)
    class(section_measure_type), intent(in) :: measure
    type(body_type), intent(in) :: body
    integer, intent(in) :: k
    ahead = dot_product(body%x(k, :) - measure%point(:body%dim), measure%normal(:body%dim)) &
      & - touch*body%spacing(k)
  end function ahead

  !> Whether the `i`-th bond of slot `k`, a point behind the plane, crosses it within the box.
  pure logical function crosses(measure, body, k, bonds, i)
    class(section_measure_type), intent(in) :: measure
    type(body_type), intent(in) :: body
    integer, intent(in) :: k
    type(bonds_type), intent(in) :: bonds
    integer, intent(in) :: i
    real(wp) :: here, there, at(body%dim)

    there = ahead(measure, body, int(bonds%j(i)))
    crosses = there > 0.0_wp
    if (.not. crosses) return
    here = ahead(measure, body, k)
    at = body%x(k, :) + here/(here - there)*bonds%xi(i, :)
    crosses = all(at >= measure%lower(:body%dim) .and. at < measure%upper(:body%dim))
  end function crosses

  !> Find the points behind the plane whose bonds cross it. Bonds that are broken count: what cracks
  !> cut is a section, too.
  subroutine begin_section(measure, scene, system, error)
    class(section_measure_type), intent(inout) :: measure
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(error_type), allocatable, intent(out) :: error
    type(bonds_type) :: bonds
    real(wp) :: distance
    integer :: i, n, p, k, found

    associate (body => system%body)
      allocate (measure%slots(0))
      measure%bonds = 0_i8
      call allocate_bonds(system%family, bonds)
      do n = 1, 2
        ! count, then note
        found = 0
        do p = 1, body%order%n_owned
          k = body%slot(p)
          distance = ahead(measure, body, k)
          if (distance > 0.0_wp .or. &
            & -distance > system%family%rule%delta + 2*body%spacing(k)) cycle
          call system%family%bonds_of(k, bonds)
          i = count([(crosses(measure, body, k, bonds, i), i=1, bonds%n)])
          if (i == 0) cycle
          found = found + 1
          if (n == 1) measure%bonds = measure%bonds + i
          if (n == 2) measure%slots(found) = int(k, i4)
        end do
        if (n == 1) then
          deallocate (measure%slots)
          allocate (measure%slots(found))
        end if
      end do
      measure%bonds = count_of_ranks(body%order, measure%bonds)
    end associate
    if (measure%bonds > 0_i8) return
    call scene_fault(error, scene, 'section', measure%number, 'point', "section '"// &
      & measure%name//"' is crossed by no bond", 'expected a plane through a body, and within '// &
      & "'lower' and 'upper' if they are given")
  end subroutine begin_section

  !> Force and moment; in the plane the moment about z, in 1D none.
  function columns_of_section(measure, dim) result(columns)
    class(section_measure_type), intent(in) :: measure
    integer, intent(in) :: dim
    type(column_type), allocatable :: columns(:)
    integer :: c

    allocate (columns(dim))
    do c = 1, dim
      columns(c) = column_type(measure%name//'_force_'//xyz(c), 'N', 'section')
    end do
    do c = 1, 3
      if (dim == 1 .or. (dim == 2 .and. c < 3)) cycle
      columns = [columns, column_type(measure%name//'_moment_'//xyz(c), 'N m', 'section')]
    end do
  end function columns_of_section

  !> Their values: the sum of the forces in the intact bonds that cross, on their ends behind the
  !> plane, and of their moments at the deformed positions (doc/theory.md, 16).
  subroutine row_of_section(measure, now, values)
    class(section_measure_type), intent(inout) :: measure
    type(row_source_type), intent(in) :: now
    real(wp), intent(out) :: values(:)
    type(bonds_type) :: bonds
    type(running_type) :: running
    type(system_type), pointer :: system
    real(wp), allocatable :: terms(:, :)
    real(wp) :: totals(6)
    integer :: s

    system => now%system
    allocate (terms(6, size(measure%slots)))
    !$omp parallel default(none) shared(measure, system, terms) private(bonds, s)
    call allocate_bonds(system%family, bonds)
    !$omp do schedule(dynamic, 64)
    do s = 1, size(measure%slots)
      terms(:, s) = carried_by(measure, system, int(measure%slots(s)), bonds)
    end do
    !$omp end parallel
    call new_running(running)
    do s = 1, size(measure%slots)
      call add_point(system%body%order, system%body%point(measure%slots(s)), terms(:, s), running)
    end do
    totals = total_of_running(system%body%order, running)
    select case (system%body%dim)
    case (1)
      values(:) = totals(:1)
    case (2)
      values(:) = totals([1, 2, 6])
    case (3)
      values(:) = totals
    case default
      call internal_fault('a section knows one to three dimensions')
    end select
  end subroutine row_of_section

  !> Force [N] and moment [N m] of the intact bonds of slot `k` that cross the plane.
  function carried_by(measure, system, k, bonds) result(terms)
    class(section_measure_type), intent(in) :: measure
    type(system_type), intent(in) :: system
    integer, intent(in) :: k
    type(bonds_type), intent(inout) :: bonds
    real(wp) :: terms(6)
    real(wp) :: force(3), direction(3), arm(3), magnitude
    integer :: i

    associate (body => system%body)
      call system%family%bonds_of(k, bonds)
      force = 0.0_wp
      do i = 1, bonds%n
        if (.not. bonds%intact(i)) cycle
        if (.not. crosses(measure, body, k, bonds, i)) cycle
        call pair_force(system, k, bonds, i, magnitude, direction)
        force = force + magnitude*bonds%weight(i)*direction
      end do
      force = force*body%volume(k)
      arm = 0.0_wp
      arm(:body%dim) = body%x(k, :) + system%state%u(k, :) - measure%point(:body%dim)
      terms = [force, arm(2)*force(3) - arm(3)*force(2), arm(3)*force(1) - arm(1)*force(3), &
        & arm(1)*force(2) - arm(2)*force(1)]
    end associate
  end function carried_by

  !> How many bonds cross it.
  function describe_section(measure, system) result(text)
    class(section_measure_type), intent(in) :: measure
    type(system_type), intent(in) :: system
    character(:), allocatable :: text

    associate (unused_system => system)
    end associate
    text = line('section', measure%name//' is crossed by '//to_text(measure%bonds)//' bonds')
  end function describe_section

end module pd_output_measures_section
