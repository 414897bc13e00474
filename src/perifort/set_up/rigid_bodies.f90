!> Rigid bodies of a scene: their shape, mass, what moves them, and the contacts that name them.
module pd_set_up_rigid_bodies
  use pd_base_error, only: error_type, internal_fault
  use pd_base_expression, only: derivative_in_time, expression_type
  use pd_base_field, only: new_field
  use pd_base_kinds, only: wp, i8
  use pd_base_numbers, only: pi
  use pd_base_text, only: counted, to_text
  use pd_base_vectors, only: cross
  use pd_body_body, only: body_type
  use pd_family_volume, only: volume_rule_type
  use pd_force_contact_law, only: contact_rule_type, of_friction, of_normal_force
  use pd_force_obstacle, only: a_box, a_cylinder, a_half_space, a_sphere, obstacle_type
  use pd_force_term, only: term_view_type
  use pd_force_terms, only: term_list_type
  use pd_force_touch, only: new_touch, points_within, touch_type
  use pd_motion_pose, only: momentum_of, new_shape_pose
  use pd_motion_rigid_body, only: course_type, guide_body, place_obstacle, rigid_body_type, &
    & spin_now, turns_as_given, turns_freely, turns_not
  use pd_motion_system, only: system_type, view_of
  use pd_scene_content_expressions, only: expression_of
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: is_given, is_set, rigid_group, scene_type
  use pd_set_up_rigid_surface, only: facets_of
  implicit none (type, external)
  private
  public :: rigid_bodies_of_scene, add_touches, check_within

contains

  !> All rigid bodies of a scene at the start, in a system whose points have their initial state. An
  !> error, with its place, if the surface of one cannot be read, or is not closed.
  subroutine rigid_bodies_of_scene(scene, system, error)
    type(scene_type), intent(in) :: scene        !! a checked scene
    type(system_type), intent(inout) :: system   !! gets its rigid bodies and their surfaces
    type(error_type), allocatable, intent(out) :: error
    integer :: r

    allocate (system%rigid_bodies(size(scene%rigids)), system%obstacles(size(scene%rigids)))
    do r = 1, size(scene%rigids)
      call make_body(scene, r, system%rigid_bodies(r), system%obstacles(r), error)
      if (allocated(error)) return
      call guide_body(0.0_wp, r, system%rigid_bodies(r), system%fault)
      call place_obstacle(system%rigid_bodies(r), system%rigid_bodies(r)%pose%velocity, &
        & spin_now(system%rigid_bodies(r), 0.0_wp), system%obstacles(r))
    end do
  end subroutine rigid_bodies_of_scene

  !> One rigid body, as if nothing imposed moved it yet.
  subroutine make_body(scene, number, rigid, obstacle, error)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: number
    type(rigid_body_type), intent(out) :: rigid
    type(obstacle_type), intent(out) :: obstacle
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: volume, mass, inertia(3), centre(3), spin(3), axes(3, 3)
    integer :: c

    associate (group => scene%rigids(number), d => scene%header%dimension)
      if (group%shape == 'surface') then
        call facets_of(scene, number, obstacle, volume, centre, inertia, axes, error)
        if (allocated(error)) return
      else
        call shape_of(scene, group, obstacle, volume, inertia)
        centre = 0.0_wp
        centre(:d) = group%centre(:d)
        axes = obstacle%frame
      end if
      obstacle%dim = d
      mass = 0.0_wp
      if (is_set(group%mass)) mass = group%mass
      if (is_set(group%density)) mass = group%density*volume
      inertia = mass*inertia
      if (all(is_set(group%inertia))) then
        inertia = group%inertia
        axes = obstacle%frame
      end if
      call new_shape_pose(d, centre, mass, inertia, axes, rigid%pose)
      rigid%axes = obstacle%frame
      rigid%free = .false.
      do c = 1, d
        rigid%free(c) = .not. is_given(group%displacement(c), group%displacement_text(c))
        call make_course(scene, group%displacement(c), group%displacement_text(c), rigid%place(c))
        if (is_set(group%velocity(c))) rigid%pose%velocity(c) = group%velocity(c)
        if (is_set(scene%header%gravity(c)) .and. rigid%free(c)) &
          & rigid%gravity(c) = scene%header%gravity(c)
      end do
      do c = 1, 3
        call make_course(scene, group%spin(c), group%spin_text(c), rigid%spin(c))
      end do
      select case (group%rotation)
      case ('free')
        rigid%turns = turns_freely
        spin = 0.0_wp
        where (is_set(group%spin)) spin = group%spin
        rigid%pose%momentum = momentum_of(rigid%pose, spin)
      case ('held')
        rigid%turns = turns_not
      case ('imposed')
        rigid%turns = turns_as_given
      case default
        call internal_fault('a rigid body rotates in no known way')
      end select
      if (any(rigid%free)) obstacle%per_mass = 1/mass
      if (rigid%turns == turns_freely .and. d == 2) obstacle%per_inertia = 1/inertia(3)
      if (rigid%turns == turns_freely .and. d == 3) obstacle%per_inertia = 1/minval(inertia)
    end associate
  end subroutine make_body

  !> Sizes and axes of a shape, its volume, and its moments of inertia for a mass of 1.
  subroutine shape_of(scene, group, obstacle, volume, inertia)
    type(scene_type), intent(in) :: scene
    type(rigid_group), intent(in) :: group
    type(obstacle_type), intent(inout) :: obstacle
    real(wp), intent(out) :: volume        !! [m3]
    real(wp), intent(out) :: inertia(3)    !! per mass [m2]
    real(wp) :: depth

    associate (h => obstacle%half, d => scene%header%dimension)
      depth = 1.0_wp
      if (d == 2) depth = scene%header%thickness
      if (d == 1) depth = scene%header%area
      select case (group%shape)
      case ('sphere')
        obstacle%shape = a_sphere
        h = group%radius
        volume = 4*pi/3*h(1)**3
        if (d == 2) volume = pi*h(1)**2*depth
        if (d == 1) volume = 2*h(1)*depth
        inertia = 0.4_wp*h(1)**2
        if (d == 2) inertia = h(1)**2/2
      case ('cylinder')
        obstacle%shape = a_cylinder
        h = [group%radius, group%radius, group%length/2]
        volume = 2*pi*h(1)**2*h(3)
        inertia = h(1)**2/4 + h(3)**2/3
        inertia(3) = h(1)**2/2
        obstacle%frame = axes_along(group%axis)
      case ('box')
        obstacle%shape = a_box
        h = 0.0_wp
        h(:d) = group%edges(:d)/2
        volume = product(2*h(:d))*depth
        inertia = [h(2)**2 + h(3)**2, h(1)**2 + h(3)**2, h(1)**2 + h(2)**2]/3
        obstacle%frame = turned_axes(group%angle*pi/180, group%axis)
      case ('half_space')
        obstacle%shape = a_half_space
        h = 0.0_wp
        volume = 0.0_wp
        inertia = 0.0_wp
        obstacle%frame = axes_along([group%normal(:d), spread(0.0_wp, 1, 3 - d)])
      case default
        call internal_fault('a rigid body of no known shape')
      end select
    end associate
  end subroutine shape_of

  !> Three axes at right angles as columns, of which the third has a direction.
  pure function axes_along(direction) result(axes)
    real(wp), intent(in) :: direction(3)
    real(wp) :: axes(3, 3), other(3)

    axes(:, 3) = direction/norm2(direction)
    other = 0.0_wp
    other(minloc(abs(direction), dim=1)) = 1.0_wp
    axes(:, 1) = cross(other, axes(:, 3))
    axes(:, 1) = axes(:, 1)/norm2(axes(:, 1))
    axes(:, 2) = cross(axes(:, 3), axes(:, 1))
  end function axes_along

  !> The axes x, y, z turned about a direction, z if that is not given, as columns.
  pure function turned_axes(angle, about) result(axes)
    real(wp), intent(in) :: angle       !! [rad]
    real(wp), intent(in) :: about(3)    !! `unset` for z
    real(wp) :: axes(3, 3), n(3)
    integer :: c

    n = [0.0_wp, 0.0_wp, 1.0_wp]
    if (all(is_set(about))) n = about/norm2(about)
    axes = 0.0_wp
    do c = 1, 3
      axes(c, c) = 1.0_wp
      axes(:, c) = cos(angle)*axes(:, c) + sin(angle)*cross(n, axes(:, c)) + (1 - cos(angle))*n(c)*n
    end do
  end function turned_axes

  !> A number or an expression of t.
  subroutine make_course(scene, value, text, course)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: value       !! `unset` for 0
    character(*), intent(in) :: text    !! '' for a number
    type(course_type), intent(inout) :: course
    type(expression_type) :: expression, rate
    real(wp) :: nowhere(1, scene%header%dimension)

    if (is_set(value)) course%value = value
    if (text == '') return
    nowhere = 0.0_wp
    call expression_of(scene, text, expression)
    call derivative_in_time(expression, rate)
    allocate (course%values, course%rates)
    call new_field(expression, nowhere, course%values)
    call new_field(rate, nowhere, course%rates)
  end subroutine make_course

  !> Contact of the bodies that a `&contact` names with the rigid body that it names, if there is
  !> one: a term for the normal force and, with friction, one for that.
  subroutine add_touches(scene, number, body, rule_of_bonds, rule, terms)
    type(scene_type), intent(in) :: scene           !! a checked scene
    integer, intent(in) :: number                   !! of the `&contact`
    type(body_type), intent(in) :: body             !! its points, arranged in slots
    type(volume_rule_type), intent(in) :: rule_of_bonds  !! with the horizons of the points
    type(contact_rule_type), intent(in) :: rule     !! of the `&contact`
    type(term_list_type), intent(inout) :: terms    !! with the contacts on return
    type(touch_type) :: touch
    logical :: touches(size(scene%bodies))
    integer :: r, b

    associate (names => scene%contacts(number)%between)
      do b = 1, size(touches)
        touches(b) = any(names == scene%bodies(b)%name)
      end do
      do r = 1, size(scene%rigids)
        if (all(names /= scene%rigids(r)%name)) cycle
        call new_touch(body, rule_of_bonds%delta, rule_of_bonds%ratio, rule, touches, r, &
          & of_normal_force, touch)
        call terms%add(touch)
        if (.not. rule%friction > 0.0_wp) cycle
        call new_touch(body, rule_of_bonds%delta, rule_of_bonds%ratio, rule, touches, r, &
          & of_friction, touch)
        touch%follows = .true.
        call terms%add(touch)
      end do
    end associate
  end subroutine add_touches

  !> An error is set if points that may touch a rigid body are within it at the start.
  subroutine check_within(scene, system, error)
    type(scene_type), intent(in) :: scene                 !! a checked scene
    type(system_type), intent(in), target :: system       !! begun
    type(error_type), allocatable, intent(out) :: error
    type(term_view_type) :: view
    integer(i8) :: within, first
    integer :: r

    if (size(scene%rigids) == 0) return
    call view_of(system, 0.0_wp, view)
    do r = 1, size(scene%rigids)
      call points_within(system%terms, view, r, within, first)
      if (within == 0_i8) cycle
      call scene_fault(error, scene, 'rigid', r, 'centre', counted(int(within), 'point')// &
        & " that may touch the rigid body '"//trim(scene%rigids(r)%name)// &
        & "' are within it at the start", 'point '//to_text(first)// &
        & ' is the first: points must be outside of its surface')
      return
    end do
  end subroutine check_within

end module pd_set_up_rigid_bodies
