!> Probes: points whose values are in every row of the history.
module pd_output_measures_probe
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_reduce, only: largest_of_ranks
  use pd_base_text, only: line => labelled_line, to_text, with_unit
  use pd_base_warnings, only: warnings_type
  use pd_body_body, only: body_type, number_at
  use pd_body_shapes, only: touch
  use pd_family_cells, only: cells_around, cells_type, sort_into_cells
  use pd_motion_system, only: system_type
  use pd_output_fields_between, only: find_spots, spots_type, values_at_spots
  use pd_output_fields_field, only: output_field_type
  use pd_output_fields_table, only: field_table_type
  use pd_output_measures_measure, only: measure_list_type, measure_type, row_source_type
  use pd_output_results_types, only: column_type
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: add_probes, nearest_slot, nearest_slots

  !> A probe: the point that is nearest to the place that the scene names, or the place itself.
  type, extends(measure_type) :: probe_measure_type
    character(:), allocatable :: name
    integer :: number = 0                !! of its group
    real(wp) :: place(3) = 0.0_wp        !! where it is asked for [m]
    integer(i4) :: slot = 0_i4           !! of its point; of several ranks on that which owns it
    logical :: here = .true.             !! this rank owns it
    integer(i8) :: point = 0_i8          !! number of its point among those of all ranks
    real(wp) :: x(3) = 0.0_wp            !! where that is [m]
    logical :: interpolate = .false.     !! values at the place itself
    type(output_field_type), allocatable :: fields(:)
  contains
    procedure :: begin => begin_probe
    procedure :: columns => columns_of_probe
    procedure :: row => row_of_probe
    procedure :: describe => describe_probe
    procedure :: warn => warn_of_probe
  end type probe_measure_type

contains

  !> Add the probes of a scene.
  subroutine add_probes(scene, table, measures)
    type(scene_type), intent(in) :: scene                !! a checked scene, whose fields are known
    type(field_table_type), intent(in) :: table          !! of fields
    type(measure_list_type), intent(inout) :: measures   !! added to
    type(probe_measure_type) :: measure
    integer :: p, f

    do p = 1, size(scene%probes)
      associate (group => scene%probes(p))
        measure%name = trim(group%name)
        measure%number = p
        measure%place = group%point
        measure%interpolate = group%interpolate
        if (allocated(measure%fields)) deallocate (measure%fields)
        allocate (measure%fields(size(group%fields)))
        do f = 1, size(group%fields)
          measure%fields(f) = table%field(trim(group%fields(f)))
        end do
      end associate
      call measures%add(measure)
    end do
  end subroutine add_probes

  !> The slot of the owned point that is nearest to a place; ties go to the lowest point number.
  pure integer(i4) function nearest_slot(body, place) result(slot)
    type(body_type), intent(in) :: body  !! points
    real(wp), intent(in) :: place(3)     !! where; components beyond the dimension do not count [m]
    real(wp) :: distance, least
    integer :: i

    slot = 0_i4
    least = huge(least)
    do i = 1, body%order%n_owned
      distance = norm2(body%x(body%slot(i), :) - place(:body%dim))
      ! differences within the tolerance are ties, so that ties do not depend on rounding
      if (distance >= least - touch*body%spacing(body%slot(i))) cycle
      least = distance
      slot = body%slot(i)
    end do
  end function nearest_slot

  !> The slots of the owned points that are nearest to many places, as of `nearest_slot`.
  function nearest_slots(body, places) result(slots)
    type(body_type), intent(in) :: body   !! points
    real(wp), intent(in) :: places(:, :)  !! (place, dim) where [m]
    integer, allocatable :: slots(:)
    type(cells_type) :: cells
    integer(i4), allocatable :: around(:)
    real(wp) :: distance, least, width, place(3)
    integer :: i, p, point

    allocate (slots(size(places, 1)))
    associate (owned => body%slot(:body%order%n_owned))
      width = 2*maxval(body%spacing(owned))
      call sort_into_cells(body%x(owned, :), width, cells)
    end associate
    do p = 1, size(slots)
      call cells_around(cells, places(p, :), around)
      least = huge(least)
      point = 0
      do i = 1, size(around)
        associate (k => body%slot(around(i)))
          distance = norm2(body%x(k, :) - places(p, :))
          if (distance > least + touch*body%spacing(k)) cycle
          if (distance >= least - touch*body%spacing(k) .and. around(i) > point) cycle
          least = distance
          point = around(i)
          slots(p) = k
        end associate
      end do
      if (least <= width) cycle
      ! all points within a width of the place were there
      place = 0.0_wp
      place(:body%dim) = places(p, :)
      slots(p) = nearest_slot(body, place)
    end do
  end function nearest_slots

  !> Find its point.
  subroutine begin_probe(measure, scene, system, error)
    class(probe_measure_type), intent(inout) :: measure
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(error_type), allocatable, intent(out) :: error

    associate (unused_scene => scene)
    end associate
    measure%slot = nearest_slot(system%body, measure%place)
    measure%point = number_at(system%body, int(measure%slot))
    if (associated(system%body%order%ranks)) call choose_rank(measure, system%body)
    measure%x = 0.0_wp
    if (measure%here) measure%x(:system%body%dim) = system%body%x(measure%slot, :)
    if (associated(system%body%order%ranks)) call system%body%order%ranks%add_all(measure%x)
  end subroutine begin_probe

  !> Find out which rank owns the point that is nearest of all; ties go to the lowest number.
  subroutine choose_rank(measure, body)
    type(probe_measure_type), intent(inout) :: measure  !! with the nearest point of this rank
    type(body_type), intent(in) :: body
    real(wp) :: distance, least, lowest

    distance = norm2(body%x(measure%slot, :) - measure%place(:body%dim))
    least = -largest_of_ranks(body%order, -distance)
    lowest = real(body%order%n_global + 1_i8, wp)
    if (distance <= least + touch*body%spacing(measure%slot)) lowest = real(measure%point, wp)
    lowest = -largest_of_ranks(body%order, -lowest)
    measure%here = measure%point == nint(lowest, i8)
    measure%point = nint(lowest, i8)
  end subroutine choose_rank

  !> The components of its fields.
  function columns_of_probe(measure, dim) result(columns)
    class(probe_measure_type), intent(in) :: measure
    integer, intent(in) :: dim
    type(column_type), allocatable :: columns(:)
    character(:), allocatable :: suffix
    integer :: f, c

    allocate (columns(0))
    do f = 1, size(measure%fields)
      associate (field => measure%fields(f))
        do c = 1, field%components(dim)
          suffix = field%component_name(c, dim)
          if (suffix /= '') suffix = '_'//suffix
          columns = [columns, column_type(measure%name//'_'//trim(field%name)//suffix, &
            & field%unit, 'probe')]
        end do
      end associate
    end do
  end function columns_of_probe

  !> Their values.
  subroutine row_of_probe(measure, now, values)
    class(probe_measure_type), intent(inout) :: measure
    type(row_source_type), intent(in) :: now
    real(wp), intent(out) :: values(:)
    type(spots_type) :: spots
    real(wp), allocatable :: of_field(:, :)
    integer :: f, first

    associate (dim => now%system%body%dim)
      if (measure%interpolate) call find_spots(now%system, [int(measure%slot)], [measure%here], &
        & reshape(measure%place(:dim), [1, dim]), spots)
    end associate
    first = 1
    values = 0.0_wp
    do f = 1, size(measure%fields)
      if (.not. (measure%here .or. measure%interpolate)) exit
      associate (field => measure%fields(f))
        allocate (of_field(field%components(now%system%body%dim), 1))
        if (measure%interpolate) then
          call values_at_spots(field, now%moment_type, spots, of_field)
        else
          call field%values_at(now%moment_type, [int(measure%slot)], of_field)
        end if
        values(first:first + size(of_field) - 1) = of_field(:, 1)
        first = first + size(of_field)
        deallocate (of_field)
      end associate
    end do
    if (measure%interpolate) return
    ! the other ranks add zeros
    if (associated(now%system%body%order%ranks)) &
      & call now%system%body%order%ranks%add_all(values)
  end subroutine row_of_probe

  !> Its point.
  function describe_probe(measure, system) result(text)
    class(probe_measure_type), intent(in) :: measure
    type(system_type), intent(in) :: system
    character(:), allocatable :: text
    integer :: c

    text = ''
    if (measure%interpolate) then
      do c = 1, system%body%dim
        if (c > 1) text = text//', '
        text = text//to_text(measure%place(c))
      end do
      text = line('probe', measure%name//' is interpolated at ('//text//') m')
      return
    end if
    do c = 1, system%body%dim
      if (c > 1) text = text//', '
      text = text//to_text(measure%x(c))
    end do
    text = line('probe', measure%name//' is point '//to_text(measure%point)//' at ('//text//') m')
  end function describe_probe

  !> A probe should lie in a body.
  subroutine warn_of_probe(measure, system, warnings)
    class(probe_measure_type), intent(in) :: measure
    type(system_type), intent(in) :: system
    type(warnings_type), intent(inout) :: warnings
    real(wp) :: distance

    associate (body => system%body)
      distance = norm2(measure%x(:body%dim) - measure%place(:body%dim))
      if (distance > body%spacing(measure%slot)) call warnings%add('probe '// &
        & to_text(measure%number), 'probe '//measure%name// &
        & ' lies outside the bodies: the nearest point is '//with_unit(distance, 'm', 3)// &
        & ' away', tell=.false.)
    end associate
  end subroutine warn_of_probe

end module pd_output_measures_probe
