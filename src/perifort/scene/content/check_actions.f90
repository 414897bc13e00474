!> Rules for actions on the bodies: initial state, boundaries, loads, and their course in time.
module pd_scene_content_check_actions
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type
  use pd_base_text, only: join, nearest_name, to_text
  use pd_scene_content_expressions, only: at_the_start, check_expression, &
    & check_vector_expressions, in_no_force
  use pd_scene_content_rules, only: rule_fault, check_file, check_known, check_region, &
    & check_mesh_name, check_components, check_vector
  use pd_scene_format_source, only: source_type
  use pd_scene_groups_course, only: ramp_of, sides
  use pd_scene_content_types, only: adds_layer, has_cut_cells, load_group, scene_type, is_given, &
    & is_set, name_length
  implicit none (type, external)
  private
  public :: check_initial, check_boundary, check_load

  character(*), parameter :: in_no_pin = 'a pin moves as a whole: an expression of t alone '// &
    & 'guides its centre'

contains

  !> One `&initial`; in relaxation its temperature change grows over the load steps by default. An
  !> error is set if a rule is broken.
  subroutine check_initial(scene, number, error, source)
    type(scene_type), intent(inout) :: scene           !! gets the default of `ramp_time`
    integer, intent(in) :: number                      !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    integer :: d
    logical :: timed

    d = scene%header%dimension
    timed = .false.
    associate (initial => scene%initial(number))
      call check_components(initial%displacement, d, 'displacement', 'initial', number, error, &
        & source)
      if (allocated(error)) return
      call check_components(initial%velocity, d, 'velocity', 'initial', number, error, source)
      if (allocated(error)) return
      call check_vector_expressions(scene, initial%displacement_text, 'initial', number, &
        & 'displacement', 'xyz', at_the_start, error, source)
      call check_vector_expressions(scene, initial%velocity_text, 'initial', number, 'velocity', &
        & 'xyz', at_the_start, error, source)
      call check_expression(scene, initial%temperature_text, 'initial', number, &
        & 'temperature_change', 'xyzt', '', error, source, timed)
      if (allocated(error)) return
      call check_gradient(initial%displacement_gradient, 'displacement_gradient')
      call check_gradient(initial%velocity_gradient, 'velocity_gradient')
      if (allocated(error)) return
      call check_region(scene, initial%region, 'initial', number, 'region', error, source)
      if (allocated(error)) return
      if (initial%file /= '' .and. initial%region /= '') then
        call rule_fault(error, 'initial', number, 'region', "'file' and 'region' are both given", &
          & 'the file has a row for every point', source)
      else if (initial%file /= '' .and. (any(initial%displacement_text /= '') .or. &
        & any(initial%velocity_text /= '') .or. initial%temperature_text /= '')) then
        call rule_fault(error, 'initial', number, 'file', "'file' beside an expression", &
          & 'give the expression in another group', source)
      else if (initial%file /= '') then
        call check_file(initial%file, scene%file, 'initial', number, error, source)
      else if (.not. (any(is_given(initial%displacement, initial%displacement_text)) .or. &
        & any(is_given(initial%velocity, initial%velocity_text)) .or. &
        & is_given(initial%temperature_change, initial%temperature_text) .or. &
        & any(abs(initial%displacement_gradient) > 0.0_wp) .or. &
        & any(abs(initial%velocity_gradient) > 0.0_wp))) then
        call rule_fault(error, 'initial', number, '', 'group &initial is empty', &
          & 'expected displacement_x.., velocity_x.., a gradient, temperature_change or file', &
          & source)
      end if
      if (allocated(error)) return
      if (.not. is_given(initial%temperature_change, initial%temperature_text) .and. &
        & initial%file == '') then
        if (allocated(initial%times) .or. is_set(initial%ramp_time)) call rule_fault(error, &
          & 'initial', number, merge('times    ', 'ramp_time', allocated(initial%times)), &
          & 'a course in time without a temperature_change', &
          & 'displacements and velocities of &initial hold at t = 0', source)
        return
      end if
      call check_course(scene, initial%ramp_time, initial%times, initial%values, 'initial', &
        & number, timed, error, source)
    end associate

  contains

    !> An error for elements of directions that the dimension does not have.
    subroutine check_gradient(gradient, key)
      real(wp), intent(in) :: gradient(3, 3)
      character(*), intent(in) :: key

      if (allocated(error)) return
      if (all(abs(gradient(d + 1:, :)) <= 0.0_wp) .and. all(abs(gradient(:, d + 1:)) <= 0.0_wp)) &
        & return
      call rule_fault(error, 'initial', number, key, "'"//key//"' has elements outside of "// &
        & 'dimension '//to_text(d), 'without subscripts the values run down the columns of a '// &
        & '3 x 3 matrix; name elements as in '//key//'(1,1) = ...', source)
    end subroutine check_gradient

  end subroutine check_initial

  !> One `&boundary`; in relaxation its default ramp covers all load steps. An error is set if a
  !> rule is broken.
  subroutine check_boundary(scene, number, error, source)
    type(scene_type), intent(inout) :: scene           !! gets the default of `ramp_time`
    integer, intent(in) :: number                      !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    character(*), parameter :: directions = 'xyz'
    character(:), allocatable :: variables, why
    integer :: i, d
    logical :: timed

    d = scene%header%dimension
    timed = .false.
    associate (boundary => scene%boundaries(number))
      call check_place(scene, boundary%body, boundary%side, boundary%region, 'boundary', number, &
        & error, source)
      if (allocated(error)) return
      call check_components(boundary%displacement, d, 'displacement', 'boundary', number, error, &
        & source)
      if (allocated(error)) return
      call check_components(boundary%velocity, d, 'velocity', 'boundary', number, error, source)
      if (allocated(error)) return
      variables = 'xyzt'
      why = ''
      if (boundary%motion == 'pin') then
        variables = 't'
        why = in_no_pin
      end if
      call check_vector_expressions(scene, boundary%displacement_text, 'boundary', number, &
        & 'displacement', variables, why, error, source, timed)
      call check_vector_expressions(scene, boundary%velocity_text, 'boundary', number, &
        & 'velocity', variables, why, error, source, timed)
      if (allocated(error)) return
      if (boundary%absorbing) then
        call check_absorbing(scene, number, error, source)
        if (allocated(error)) return
      else if (boundary%motion == 'pin') then
        call check_pin(scene, number, error, source)
        if (allocated(error)) return
      else if (.not. any(is_given(boundary%displacement, boundary%displacement_text)) .and. &
        & .not. any(is_given(boundary%velocity, boundary%velocity_text))) then
        call rule_fault(error, 'boundary', number, '', 'group &boundary imposes nothing', &
          & "expected displacement_x.. or velocity_x.., absorbing, or motion = 'pin'", source)
        return
      end if
      do i = 1, d
        if (.not. is_given(boundary%displacement(i), boundary%displacement_text(i)) .or. &
          & .not. is_given(boundary%velocity(i), boundary%velocity_text(i))) cycle
        call rule_fault(error, 'boundary', number, 'velocity_'//directions(i:i), &
          & "'displacement_"//directions(i:i)//"' and 'velocity_"//directions(i:i)// &
          & "' are both imposed", 'give one of them; each follows from the other', source)
        return
      end do
      do i = 1, number - 1
        if (.not. adds_layer(boundary) .or. scene%boundaries(i)%side /= boundary%side .or. &
          & scene%boundaries(i)%body /= boundary%body) cycle
        call rule_fault(error, 'boundary', number, 'side', "side '"//trim(boundary%side)// &
          & "' has a layer already", 'from &boundary number '//to_text(i), source)
        return
      end do
      call check_course(scene, boundary%ramp_time, boundary%times, boundary%values, 'boundary', &
        & number, timed, error, source)
    end associate
  end subroutine check_boundary

  !> An absorbing `&boundary`: a free layer at a side, in time.
  subroutine check_absorbing(scene, number, error, source)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    character(*), parameter :: what = "an absorbing boundary"
    character(:), allocatable :: key, note

    associate (boundary => scene%boundaries(number))
      key = ''
      if (boundary%side == '') then
        key = 'region'
        note = 'its layer takes in waves that meet a side: give a side instead'
      else if (.not. adds_layer(boundary)) then
        key = 'side'
        note = 'facets of a mesh get no layer'
      else if (any(is_given(boundary%displacement, boundary%displacement_text))) then
        key = 'displacement_'//first_of(is_given(boundary%displacement, &
          & boundary%displacement_text))
        note = 'its layer is free: leave out displacement and velocity'
      else if (any(is_given(boundary%velocity, boundary%velocity_text))) then
        key = 'velocity_'//first_of(is_given(boundary%velocity, boundary%velocity_text))
        note = 'its layer is free: leave out displacement and velocity'
      else if (is_set(boundary%ramp_time) .or. allocated(boundary%times)) then
        key = merge('times    ', 'ramp_time', allocated(boundary%times))
        note = 'its dashpots act from the start'
      else if (boundary%motion == 'pin') then
        key = 'motion'
        note = 'its layer is free: leave out motion'
      else if (boundary%name /= '') then
        key = 'name'
        note = 'its forces are those of dashpots; the history has no reaction of them'
      else if (scene%time%method == 'relaxation') then
        key = 'absorbing'
        note = "dashpots have no force in static equilibrium: it needs &time method = 'explicit'"
      end if
      if (key /= '') call rule_fault(error, 'boundary', number, trim(key), what//" with '"// &
        & trim(key)//"'", note, source)
    end associate

  contains

    !> The first direction that is given.
    pure character(1) function first_of(given) result(direction)
      logical, intent(in) :: given(3)
      character(*), parameter :: directions = 'xyz'
      integer :: c

      c = findloc(given, .true., dim=1)
      direction = directions(c:c)
    end function first_of
  end subroutine check_absorbing

  !> A `&boundary` whose points move as one rigid body: not every integrator knows it.
  subroutine check_pin(scene, number, error, source)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source

    associate (time => scene%time)
      if (time%method /= 'explicit') return
      if (time%integrator == 'forward_backward' .or. time%integrator == 'velocity_verlet') return
      call rule_fault(error, 'boundary', number, 'motion', "motion = 'pin' with &time "// &
        & "integrator = '"//trim(time%integrator)//"'", "the motion of a pin is integrated by "// &
        & "'forward_backward' and 'velocity_verlet' alone", source)
    end associate
  end subroutine check_pin

  !> The springs of a `&load`: a stiffness for each direction, none negative.
  subroutine check_springs(scene, number, error, source)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source

    associate (load => scene%loads(number), d => scene%header%dimension)
      call check_vector(load%stiffness, d, 'stiffness', 'load', number, error, source)
      if (allocated(error)) return
      if (any(load%stiffness(:d) < 0.0_wp) .or. .not. any(load%stiffness(:d) > 0.0_wp)) then
        call rule_fault(error, 'load', number, 'stiffness', "'stiffness' is negative, or 0 "// &
          & 'along all directions', 'expected values of at least 0 N/m, one of them positive', &
          & source)
      else if (.not. loads_anything(load) .and. (is_set(load%ramp_time) .or. &
        & allocated(load%times))) then
        call rule_fault(error, 'load', number, trim(merge('times    ', 'ramp_time', &
          & allocated(load%times))), 'springs with a course in time', &
          & 'springs act from the start; a course is for forces', source)
      end if
    end associate
  end subroutine check_springs

  !> Whether a `&load` has a force.
  pure logical function loads_anything(load)
    type(load_group), intent(in) :: load

    loads_anything = is_given(load%pressure, load%pressure_text) .or. &
      & any(is_given(load%force, load%force_text)) .or. &
      & any(is_given(load%body_force, load%body_force_text))
  end function loads_anything

  !> One `&load`; the only body and, in relaxation, the ramp over the load steps are defaults. An
  !> error is set if a rule is broken.
  subroutine check_load(scene, number, error, source)
    type(scene_type), intent(inout) :: scene  !! gets the defaults of `body` and `ramp_time`
    integer, intent(in) :: number                      !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    integer :: d
    logical :: timed

    d = scene%header%dimension
    timed = .false.
    associate (load => scene%loads(number))
      if (load%side /= '' .and. load%body == '' .and. index(load%side, ':') == 0) then
        if (size(scene%bodies) > 1) then
          call rule_fault(error, 'load', number, '', "group &load lacks the key 'body'", &
            & 'there are '//to_text(size(scene%bodies))//' bodies to choose from', source)
          return
        end if
        load%body = scene%bodies(1)%name
      end if
      call check_place(scene, load%body, load%side, load%region, 'load', number, error, source)
      if (allocated(error)) return
      call check_components(load%force, d, 'force', 'load', number, error, source)
      if (allocated(error)) return
      call check_components(load%body_force, d, 'body_force', 'load', number, error, source)
      if (allocated(error)) return
      call check_expression(scene, load%pressure_text, 'load', number, 'pressure', 'xyzt', '', &
        & error, source, timed)
      call check_vector_expressions(scene, load%force_text, 'load', number, 'force', 't', &
        & in_no_force, error, source, timed)
      call check_vector_expressions(scene, load%body_force_text, 'load', number, 'body_force', &
        & 'xyzt', '', error, source, timed)
      if (allocated(error)) return
      if (any(is_set(load%stiffness))) then
        call check_springs(scene, number, error, source)
        if (allocated(error)) return
      else if (.not. loads_anything(load)) then
        call rule_fault(error, 'load', number, '', 'group &load loads nothing', &
          & 'expected pressure, force_x.., body_force_x.. or stiffness', source)
        return
      end if
      if (index(load%side, ':') > 0 .and. (any(is_set(load%stiffness)) .or. &
        & any(is_given(load%body_force, load%body_force_text)))) then
        call rule_fault(error, 'load', number, trim(merge('stiffness   ', 'body_force_x', &
          & any(is_set(load%stiffness)))), 'springs or a body force on facets of a mesh', &
          & "facets take pressure and force_x..; a region, as 'BODY:NAME', takes these", source)
        return
      end if
      if (is_given(load%pressure, load%pressure_text) .and. load%region /= '') then
        call rule_fault(error, 'load', number, 'pressure', "'pressure' with a region", &
          & "a pressure needs a 'side'; a region takes force_x.. or body_force_x..", source)
        return
      end if
      if (loads_anything(load)) call check_course(scene, load%ramp_time, load%times, load%values, &
        & 'load', number, timed, error, source)
    end associate
  end subroutine check_load

  !> Where a boundary or load acts: a side of a lattice, or a region.
  subroutine check_place(scene, body, side, region, group, number, error, source)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: body, side, region, group
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    integer :: i
    logical :: cloud, mesh, cut

    if (side == '' .and. region == '') then
      call rule_fault(error, group, number, '', 'group &'//group//" lacks the key 'side' or "// &
        & "'region'", "expected one of 'x_min' .. 'z_max', or the name of a region", source)
      return
    else if (side /= '' .and. region /= '') then
      call rule_fault(error, group, number, 'region', "'side' and 'region' are both given", &
        & 'give one of them', source)
      return
    else if (region /= '' .and. body /= '') then
      call rule_fault(error, group, number, 'body', "'body' and 'region' are both given", &
        & "'body' goes with 'side'", source)
      return
    else if (region /= '') then
      call check_region(scene, region, group, number, 'region', error, source)
      return
    else if (index(side, ':') > 0) then
      call check_mesh_name(scene, side, group, number, 'side', error, source, facets=.true.)
      if (.not. allocated(error) .and. body /= '') call rule_fault(error, group, number, 'body', &
        & "'body' beside a side that names its body", "leave 'body' out", source)
      return
    else if (all(sides /= side)) then
      call unknown_side(side, group, number, error, source)
      return
    end if
    if (index('xyz', side(1:1)) > scene%header%dimension) then
      call rule_fault(error, group, number, 'side', "side '"//trim(side)// &
        & "' in a scene of dimension "//to_text(scene%header%dimension), &
        & 'there is no direction '//side(1:1), source)
      return
    end if
    call check_known(body, [character(name_length) :: (scene%bodies(i)%name, &
      & i=1, size(scene%bodies))], 'body', group, number, 'body', error, source)
    if (allocated(error)) return
    cloud = .false.
    mesh = .false.
    cut = .false.
    do i = 1, size(scene%bodies)
      if (body /= '' .and. scene%bodies(i)%name /= body) cycle
      cloud = cloud .or. scene%bodies(i)%file /= ''
      mesh = mesh .or. scene%bodies(i)%mesh /= ''
      cut = cut .or. has_cut_cells(scene%bodies(i))
    end do
    if (cloud) then
      call rule_fault(error, group, number, 'side', &
        & "a 'side' of a body that is a cloud", "a cloud has no sides; use a 'region'", source)
    else if (mesh) then
      call rule_fault(error, group, number, 'side', "side '"//trim(side)//"' of a body that is "// &
        & 'a mesh, which has no rows and gets no layers', "name its facets: 'BODY:NAME'", source)
    else if (cut) then
      call rule_fault(error, group, number, 'side', "side '"//trim(side)//"' of a body with "// &
        & "fill = 'volume', which has no rows and gets no layers", &
        & "name its facets: 'BODY:NAME', or use fill = 'centre'", source)
    end if
  end subroutine check_place

  !> A side that is none.
  subroutine unknown_side(side, group, number, error, source)
    character(*), intent(in) :: side, group
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    character(:), allocatable :: note, nearest

    note = 'allowed: '//join(sides, ', ')//', or BODY:NAME for facets of a mesh or surface'
    nearest = nearest_name(trim(side), sides)
    if (len(nearest) > 0) note = "did you mean '"//nearest//"'?  "//note
    call rule_fault(error, group, number, 'side', "unknown value '"//trim(side)// &
      & "' of key 'side' in group &"//group, note, source)
  end subroutine unknown_side

  !> At once, by a ramp, or by times and values. In relaxation, where time runs from 0 to 1 over the
  !> load steps, the default course is a ramp over all of them, and times must not exceed 1, since
  !> later values would never act. Expressions of t are courses of their own: none is given beside
  !> them, and none is the default.
  subroutine check_course(scene, ramp_time, times, values, group, number, timed, error, source)
    type(scene_type), intent(in) :: scene                 !! for its method
    real(wp), intent(inout) :: ramp_time                  !! length of the ramp [s]
    real(wp), allocatable, intent(in) :: times(:)         !! of the table [s]
    real(wp), allocatable, intent(in) :: values(:)        !! factors at `times` [-]
    character(*), intent(in) :: group                     !! name of the group, for messages
    integer, intent(in) :: number                         !! which group of this name
    logical, intent(in) :: timed                          !! an expression of the group has t
    type(error_type), allocatable, intent(out) :: error   !! the broken rule
    type(source_type), intent(in), optional :: source     !! the scanned file, for places
    character(*), parameter :: load_time = 'in relaxation time runs from 0 to 1 over the load steps'
    logical :: relaxes
    integer :: i

    relaxes = scene%time%method == 'relaxation'
    if (timed) then
      if (allocated(times)) then
        call refuse('times')
      else if (allocated(values)) then
        call refuse('values')
      else if (is_set(ramp_time)) then
        call refuse('ramp_time')
      end if
      return
    end if
    if (allocated(times) .neqv. allocated(values)) then
      if (allocated(times)) then
        call rule_fault(error, group, number, 'times', "'times' without 'values'", &
          & 'expected a factor for each time', source)
      else
        call rule_fault(error, group, number, 'values', "'values' without 'times'", &
          & 'expected a time for each factor', source)
      end if
      return
    end if
    if (.not. allocated(times)) then
      ramp_time = ramp_of(scene%time%method, ramp_time)
      if (relaxes .and. ramp_time > 1.0_wp) call rule_fault(error, group, number, 'ramp_time', &
        & "the ramp does not end: 'ramp_time' is "//to_text(ramp_time), load_time// &
        & '; expected at most 1', source)
      return
    end if
    if (is_set(ramp_time)) then
      call rule_fault(error, group, number, 'ramp_time', "'ramp_time' and 'times' are both given", &
        & 'give one of them', source)
    else if (size(times) /= size(values)) then
      call rule_fault(error, group, number, 'values', "'times' and 'values' differ in length", &
        & to_text(size(times))//' times, '//to_text(size(values))//' values', source)
    else
      do i = 2, size(times)
        if (times(i) > times(i - 1)) cycle
        call rule_fault(error, group, number, 'times', "'times' do not increase", &
          & to_text(times(i))//' after '//to_text(times(i - 1)), source)
        return
      end do
      if (relaxes .and. any(times > 1.0_wp)) call rule_fault(error, group, number, 'times', &
        & "the time "//to_text(maxval(times))//" of 'times' is never reached", load_time// &
        & '; expected at most 1', source)
    end if

  contains

    !> A course beside an expression of t.
    subroutine refuse(key)
      character(*), intent(in) :: key
      call rule_fault(error, group, number, key, "'"//key//"' beside an expression of t", &
        & 'an expression of t is a course in time of its own; use another group for the rest', &
        & source)
    end subroutine refuse

  end subroutine check_course

end module pd_scene_content_check_actions
