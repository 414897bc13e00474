!> Rules for rigid bodies.
module pd_scene_content_check_rigid
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text
  use pd_scene_content_expressions, only: check_vector_expressions
  use pd_scene_content_rules, only: check_components, check_file, check_unique, &
    & check_vector, rule_fault
  use pd_scene_content_types, only: is_given, is_set, name_length, rigid_group, scene_type
  use pd_scene_format_source, only: source_type
  implicit none (type, external)
  private
  public :: check_rigid

  character(*), parameter :: xyz = 'xyz'

contains

  !> One `&rigid`: its shape is complete, it has a mass where forces move it, and is in explicit
  !> steps of an integrator that moves it. Sets what the shape leaves open.
  subroutine check_rigid(scene, number, error, source)
    type(scene_type), intent(inout) :: scene           !! its lists are allocated
    integer, intent(in) :: number                      !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    integer :: i

    if (number == 1) then
      call check_unique([character(name_length) :: (scene%rigids(i)%name, &
        & i=1, size(scene%rigids))], 'rigid', error, source)
      if (allocated(error)) return
    end if
    associate (rigid => scene%rigids(number), d => scene%header%dimension)
      if (scene%time%method == 'relaxation') then
        call fault('', '&rigid is not for relaxation', &
          & "its contact has no tangent: use &time method = 'explicit'")
      else if (scene%time%integrator /= 'forward_backward' .and. &
        & scene%time%integrator /= 'velocity_verlet') then
        call fault('', "&rigid is not for integrator = '"//trim(scene%time%integrator)//"'", &
          & "rigid bodies move by steps of 'forward_backward' and 'velocity_verlet'")
      else if (rigid%name == 'all') then
        call fault('name', "a rigid body is named 'all'", "'all' are the bodies of a &contact")
      else if (any(scene%bodies%name == rigid%name)) then
        call fault('name', "the name '"//trim(rigid%name)//"' is used by a &body", &
          & 'a &contact knows bodies and rigid bodies by their names')
      end if
      if (.not. allocated(error) .and. (any(scene%boundaries%name == rigid%name) .or. &
        & any(scene%probes%name == rigid%name))) call fault('name', "the name '"// &
        & trim(rigid%name)//"' is used by a &boundary or &probe", &
        & 'columns of the history begin with it')
      if (allocated(error)) return
      ! a surface is where its file has it
      if (rigid%shape /= 'surface' .or. any(is_set(rigid%centre))) call check_vector(rigid%centre, &
        & d, 'centre', 'rigid', number, error, source)
      if (allocated(error)) return
      call check_shape()
      if (allocated(error)) return
      if (rigid%shape == 'half_space') then
        do i = 1, d
          if (.not. is_given(rigid%displacement(i), rigid%displacement_text(i))) &
            & rigid%displacement(i) = 0.0_wp
        end do
      end if
      if (rigid%rotation == '') rigid%rotation = &
        & merge('held', 'free', rigid%shape == 'half_space' .or. d == 1)
      call check_motion()
      if (allocated(error)) return
      call check_mass()
    end associate

  contains

    subroutine fault(key, message, note)
      character(*), intent(in) :: key, message, note
      call rule_fault(error, 'rigid', number, key, message, note, source)
    end subroutine fault

    !> The keys of each shape, and none of others.
    subroutine check_shape()
      associate (rigid => scene%rigids(number), d => scene%header%dimension)
        select case (rigid%shape)
        case ('sphere', 'cylinder')
          if (.not. is_set(rigid%radius)) then
            call fault('', "group &rigid lacks the key 'radius'", 'a '//trim(rigid%shape)// &
              & ' has one')
          else if (rigid%shape == 'cylinder' .and. d < 3) then
            call fault('shape', 'a cylinder in '//to_text(d)//'D', &
              & "in 2D a circle is shape = 'sphere'")
          else if (rigid%shape == 'cylinder' .and. .not. is_set(rigid%length)) then
            call fault('', "group &rigid lacks the key 'length'", 'a cylinder has one')
          end if
        case ('box')
          call check_vector(rigid%edges, d, 'edges', 'rigid', number, error, source)
          if (allocated(error)) return
          if (any(rigid%edges(:d) <= 0.0_wp)) call fault('edges', "'edges' must be above 0", &
            & 'expected lengths')
        case ('half_space')
          call check_vector(rigid%normal, d, 'normal', 'rigid', number, error, source)
          if (allocated(error)) return
          if (.not. norm2(rigid%normal(:d)) > 0.0_wp) call fault('normal', &
            & "'normal' has no length", 'expected a direction')
        case ('surface')
          if (d < 3) then
            call fault('shape', 'a surface in '//to_text(d)//'D', 'facets enclose a volume in 3D')
          else if (rigid%surface == '') then
            call fault('', "group &rigid lacks the key 'surface'", 'expected a STL file')
          else
            call check_file(rigid%surface, scene%file, 'rigid', number, error, source, 'surface')
          end if
        case default  ! a scene built in memory
          call fault('shape', "no shape is called '"//trim(rigid%shape)//"'", &
            & "expected 'sphere', 'cylinder', 'box', 'half_space' or 'surface'")
        end select
        if (allocated(error)) return
        call leave('radius', is_set(rigid%radius), ['sphere  ', 'cylinder'])
        call leave('length', is_set(rigid%length), ['cylinder'])
        call leave('edges', any(is_set(rigid%edges)), ['box'])
        call leave('axis', any(is_set(rigid%axis)), ['cylinder', 'box     ', 'surface '])
        call leave('angle', abs(rigid%angle) > 0.0_wp, ['box    ', 'surface'])
        call leave('surface', rigid%surface /= '', ['surface'])
        call leave('scale', abs(rigid%scale - 1) > 0.0_wp, ['surface'])
        call leave('normal', any(is_set(rigid%normal)), ['half_space'])
        if (allocated(error)) return
        if (.not. any(is_set(rigid%axis))) then
          if (rigid%shape == 'cylinder' .or. rigid%shape == 'surface' .or. &
            & (rigid%shape == 'box' .and. d == 3)) rigid%axis = [0.0_wp, 0.0_wp, 1.0_wp]
        else if (d < 3) then
          call fault('axis', "'axis' in a scene of dimension "//to_text(d), &
            & 'in 2D a box turns about z')
        else if (.not. all(is_set(rigid%axis))) then
          call fault('axis', "'axis' has too few values", 'expected three')
        else if (.not. norm2(rigid%axis) > 0.0_wp) then
          call fault('axis', "'axis' has no length", 'expected a direction')
        end if
        if (.not. allocated(error) .and. d == 1 .and. abs(rigid%angle) > 0.0_wp) &
          & call fault('angle', "'angle' in 1D", 'nothing turns there')
      end associate
    end subroutine check_shape

    !> A key that other shapes have must not be given.
    subroutine leave(key, is_there, shapes)
      character(*), intent(in) :: key
      logical, intent(in) :: is_there
      character(*), intent(in) :: shapes(:)   !! that have it

      if (allocated(error) .or. .not. is_there) return
      if (any(shapes == scene%rigids(number)%shape)) return
      call fault(key, "'"//key//"' of a "//trim(scene%rigids(number)%shape), &
        & 'it has no such key')
    end subroutine leave

    !> What is given, imposed and at the start, along directions that there are.
    subroutine check_motion()
      type(scene_type) :: in_space
      logical :: imposed
      integer :: c

      associate (rigid => scene%rigids(number), d => scene%header%dimension)
        call check_components(rigid%velocity, d, 'velocity', 'rigid', number, error, source)
        if (allocated(error)) return
        call check_components(rigid%displacement, d, 'displacement', 'rigid', number, error, source)
        if (allocated(error)) return
        call check_vector_expressions(scene, rigid%displacement_text, 'rigid', number, &
          & 'displacement', 't', 'a rigid body has no points', error, source)
        if (allocated(error)) return
        do c = 1, d
          if (.not. is_set(rigid%velocity(c)) .or. .not. &
            & is_given(rigid%displacement(c), rigid%displacement_text(c))) cycle
          call fault('velocity_'//xyz(c:c), "'displacement_"//xyz(c:c)//"' and 'velocity_"// &
            & xyz(c:c)//"' are both given", 'what is imposed has the velocity of its displacement')
          return
        end do
        imposed = rigid%rotation == 'imposed'
        do c = 1, 3
          if (.not. is_given(rigid%spin(c), rigid%spin_text(c))) cycle
          if (d == 1 .or. (d == 2 .and. c < 3)) then
            call fault('spin_'//xyz(c:c), "'spin_"//xyz(c:c)//"' in a scene of dimension "// &
              & to_text(d), 'in 2D a body turns about z, in 1D not at all')
          else if (rigid%rotation == 'held') then
            call fault('spin_'//xyz(c:c), "'spin_"//xyz(c:c)//"' of a body that is held", &
              & "expected rotation = 'free' or 'imposed'")
          else if (rigid%spin_text(c) /= '' .and. .not. imposed) then
            call fault('spin_'//xyz(c:c), "'spin_"//xyz(c:c)//"' is an expression", &
              & "it is a number at the start, unless rotation = 'imposed'")
          end if
          if (allocated(error)) return
        end do
        ! the spin of a scene in 2D is about z
        in_space%header%dimension = 3
        in_space%definitions = scene%definitions
        call check_vector_expressions(in_space, rigid%spin_text, 'rigid', number, 'spin', 't', &
          & 'a rigid body has no points', error, source)
      end associate
    end subroutine check_motion

    !> What forces move or turn has a mass.
    subroutine check_mass()
      logical :: moves
      integer :: c

      associate (rigid => scene%rigids(number), d => scene%header%dimension)
        moves = rigid%rotation == 'free'
        do c = 1, d
          moves = moves .or. .not. is_given(rigid%displacement(c), rigid%displacement_text(c))
        end do
        if (rigid%shape == 'half_space' .and. (moves .or. is_set(rigid%mass) .or. &
          & is_set(rigid%density) .or. any(is_set(rigid%inertia)))) then
          call fault('', 'a half_space has no mass that forces could move', &
            & "hold it or impose its displacement, with rotation = 'held' or 'imposed'")
        else if (is_set(rigid%mass) .and. is_set(rigid%density)) then
          call fault('density', "'mass' and 'density' are both given", 'give one of them')
        else if (moves .and. .not. is_set(rigid%mass) .and. .not. is_set(rigid%density)) then
          call fault('', "group &rigid lacks the key 'mass' or 'density'", &
            & 'forces move it, unless all components of displacement and the rotation are given')
        else if (any(is_set(rigid%inertia)) .and. .not. all(is_set(rigid%inertia))) then
          call fault('inertia', "'inertia' has too few values", 'expected three')
        else if (any(is_set(rigid%inertia)) .and. d == 1) then
          call fault('inertia', "'inertia' in 1D", 'nothing turns there')
        else if (any(is_set(rigid%inertia)) .and. .not. (is_set(rigid%mass) .or. &
          & is_set(rigid%density))) then
          call fault('inertia', "'inertia' without 'mass' or 'density'", 'expected one of them')
        else if (all(is_set(rigid%inertia))) then
          if (any(rigid%inertia <= 0.0_wp)) then
            call fault('inertia', "'inertia' must be above 0", 'expected moments of inertia')
          else if (d == 3 .and. 2*maxval(rigid%inertia) > sum(rigid%inertia)*(1 + 1.0e-9_wp)) then
            call fault('inertia', 'one moment of inertia is more than the sum of the others', &
              & 'no body has such moments')
          end if
        end if
      end associate
    end subroutine check_mass
  end subroutine check_rigid

end module pd_scene_content_check_rigid
