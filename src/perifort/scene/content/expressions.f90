!> Expressions in a scene: the names of `&define`, rules for what may stand in them, and faults with
!> carets under the wrong characters.
module pd_scene_content_expressions
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use pd_base_error, only: error_type, internal_fault
  use pd_base_expression, only: compile_expression, constant_value, expression_fault, &
    & expression_type, named_value, reserved_meaning
  use pd_base_text, only: lower_case, to_text
  use pd_scene_content_rules, only: find_entry, find_section, rule_fault
  use pd_scene_content_types, only: is_set, scene_type
  use pd_scene_format_source, only: source_fault, source_type
  implicit none (type, external)
  private
  public :: check_definitions, check_expression, check_vector_expressions, expression_of, &
    & varies_in_time, has_expressions, at_the_start, in_no_force

  character(*), parameter :: letters = 'abcdefghijklmnopqrstuvwxyz_'
  character(*), parameter :: digits = '0123456789'
  !> Why some variables may not stand in some expressions.
  character(*), parameter :: at_the_start = 'it is a value at the start, where t = 0'
  character(*), parameter :: in_no_force = 'a force is a total over the points; a force that '// &
    & 'varies from point to point is a body_force or a pressure'

contains

  !> Every `&define`: names that are free and differ, values that are numbers. An error is set if a
  !> rule is broken.
  subroutine check_definitions(scene, error, source)
    type(scene_type), intent(in) :: scene              !! with its groups read
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    type(named_value), allocatable :: names(:)
    type(expression_type) :: expression
    character(:), allocatable :: name
    integer :: i

    do i = 1, size(scene%definitions)
      associate (definition => scene%definitions(i))
        name = lower_case(trim(definition%name))
        call names_of(scene, i - 1, names)
        if (verify(name, letters//digits) > 0 .or. scan(name(:min(1, len(name))), letters) == 0) &
          & then
          call rule_fault(error, 'define', i, 'name', "bad name '"//trim(definition%name)//"'", &
            & 'names in expressions are made of letters, digits and _, and begin with a letter', &
            & source)
        else if (reserved_meaning(name) /= '') then
          call rule_fault(error, 'define', i, 'name', "'"//name//"' is "//reserved_meaning(name) &
            & //' in expressions', 'choose another name', source)
        else if (any(names%name == name)) then
          call rule_fault(error, 'define', i, 'name', "the name '"//name// &
            & "' is used by another &define", 'names must differ', source)
        else if (definition%text == '' .and. .not. is_set(definition%value)) then
          call rule_fault(error, 'define', i, 'value', "group &define lacks the key 'value'", &
            & 'expected a number or an expression', source)
        else if (definition%text /= '') then
          call check_text(definition%text, names, 'define', i, 'value', '', &
            & 'a name stands for one number', expression, error, source)
          if (allocated(error)) return
          if (.not. ieee_is_finite(constant_value(expression))) call rule_fault(error, 'define', &
            & i, 'value', "the value of '"//name//"' is not finite", trim(definition%text), source)
        end if
        if (allocated(error)) return
      end associate
    end do
  end subroutine check_definitions

  !> One expression, in a key that may also be a number. An error is set if it is none, or has
  !> variables that it may not have.
  subroutine check_expression(scene, text, group, number, key, allowed, reason, error, source, &
      & timed)
    type(scene_type), intent(in) :: scene              !! with sound definitions
    character(*), intent(in) :: text                   !! the expression; '' is right
    character(*), intent(in) :: group                  !! name of the group, without `&`
    integer, intent(in) :: number                      !! which group of this name, from 1
    character(*), intent(in) :: key                    !! name of the key
    character(*), intent(in) :: allowed                !! letters of x, y, z, t that may stand in it
    character(*), intent(in) :: reason                 !! why others may not
    type(error_type), allocatable, intent(inout) :: error  !! kept if there is one
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    logical, intent(inout), optional :: timed          !! becomes true if it depends on t
    type(named_value), allocatable :: names(:)
    type(expression_type) :: expression
    character(:), allocatable :: variables
    integer :: d

    if (allocated(error) .or. text == '') return
    d = scene%header%dimension
    variables = ''
    if (scan(allowed, 'xyz') > 0) variables = 'xyz'
    variables = variables(:min(d, len(variables)))
    if (index(allowed, 't') > 0) variables = variables//'t'
    call names_of(scene, huge(1), names)
    call check_text(text, names, group, number, key, variables, reason, expression, error, source)
    if (allocated(error)) return
    if (present(timed)) timed = timed .or. expression%in_time
  end subroutine check_expression

  !> Three expressions `<key>_x`.., none in a direction that the dimension does not have.
  subroutine check_vector_expressions(scene, texts, group, number, key, allowed, reason, error, &
      & source, timed)
    type(scene_type), intent(in) :: scene              !! with sound definitions
    character(*), intent(in) :: texts(3)               !! of x, y and z; '' is right
    character(*), intent(in) :: group                  !! name of the group, without `&`
    integer, intent(in) :: number                      !! which group of this name, from 1
    character(*), intent(in) :: key                    !! name of the three keys, without _x
    character(*), intent(in) :: allowed                !! letters of x, y, z, t that may stand there
    character(*), intent(in) :: reason                 !! why others may not
    type(error_type), allocatable, intent(inout) :: error  !! kept if there is one
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    logical, intent(inout), optional :: timed          !! becomes true if one depends on t
    character(*), parameter :: directions = 'xyz'
    integer :: i

    do i = 1, 3
      if (allocated(error) .or. texts(i) == '') cycle
      if (i > scene%header%dimension) then
        call rule_fault(error, group, number, key//'_'//directions(i:i), "'"//key//'_'// &
          & directions(i:i)//"' in a scene of dimension "//to_text(scene%header%dimension), &
          & 'there is no direction '//directions(i:i), source)
      else
        call check_expression(scene, texts(i), group, number, key//'_'//directions(i:i), allowed, &
          & reason, error, source, timed)
      end if
    end do
  end subroutine check_vector_expressions

  !> Compile a text, or set an error with its place.
  subroutine check_text(text, names, group, number, key, variables, reason, expression, error, &
      & source)
    character(*), intent(in) :: text
    type(named_value), intent(in) :: names(:)
    character(*), intent(in) :: group, key
    integer, intent(in) :: number
    character(*), intent(in) :: variables, reason
    type(expression_type), intent(out) :: expression
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    type(expression_fault), allocatable :: fault
    character(:), allocatable :: message, note
    integer :: section, entry, column, i
    logical :: placed

    call compile_expression(trim(text), names, expression, fault, variables, reason)
    if (.not. allocated(fault)) return
    message = "'"//key//"': "//fault%message
    note = fault%note
    ! the other variables are refused for a reason of their own
    if (scan(variables, 'x') > 0 .and. scan(fault%message, 'yz') == 2 .and. &
      & index(fault%message, 'cannot stand') > 0) note = 'the scene has dimension '// &
      & trim(merge('2', '1', index(variables, 'y') > 0))
    entry = 0
    placed = present(source)
    if (placed) placed = .not. source%in_memory
    if (placed) then
      section = find_section(source, group, number)
      if (section > 0) entry = find_entry(source, section, key)
    end if
    if (entry == 0) then
      ! there is no line to show
      if (len(note) > 0) note = note//'; '
      note = note//'character '//to_text(fault%column)//' of '//trim(text)
      call rule_fault(error, group, number, key, message, note, source)
      return
    end if
    associate (token => source%tokens(source%entries(entry)%first))
      associate (line => source%lines(token%line)%text)
        column = token%column + fault%column - 1
        if (scan(line(token%column:token%column), '''"') == 1) then
          ! behind the quote; quotes inside are doubled
          column = column + 1
          do i = 1, fault%column - 1
            if (text(i:i) == line(token%column:token%column)) column = column + 1
          end do
        end if
      end associate
      call source_fault(source, token%line, column, fault%width, message, note, error)
    end associate
  end subroutine check_text

  !> The first names of a scene with their values, at most `number`.
  subroutine names_of(scene, number, names)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: number
    type(named_value), allocatable, intent(out) :: names(:)
    type(expression_type) :: expression
    type(expression_fault), allocatable :: fault
    integer :: i, there

    there = 0
    if (allocated(scene%definitions)) there = min(number, size(scene%definitions))
    allocate (names(there))
    do i = 1, there
      names(i)%name = lower_case(scene%definitions(i)%name)
      names(i)%value = scene%definitions(i)%value
      if (scene%definitions(i)%text == '') cycle
      call compile_expression(trim(scene%definitions(i)%text), names(:i - 1), expression, fault, '')
      if (allocated(fault)) cycle  ! check_definitions reports it
      names(i)%value = constant_value(expression)
    end do
  end subroutine names_of

  !> The expression that a text of a checked scene is.
  subroutine expression_of(scene, text, expression)
    type(scene_type), intent(in) :: scene             !! a checked scene
    character(*), intent(in) :: text                  !! of one of its keys, not ''
    type(expression_type), intent(out) :: expression  !! compiled
    type(named_value), allocatable :: names(:)
    type(expression_fault), allocatable :: fault

    call names_of(scene, huge(1), names)
    call compile_expression(trim(text), names, expression, fault)
    if (allocated(fault)) call internal_fault('an expression that was not checked: '//text)
  end subroutine expression_of

  !> Whether an initial value, a boundary or a load of a scene is an expression.
  pure logical function has_expressions(scene) result(has)
    type(scene_type), intent(in) :: scene  !! a checked scene
    integer :: i

    has = .false.
    do i = 1, size(scene%initial)
      has = has .or. any(scene%initial(i)%displacement_text /= '') .or. &
        & any(scene%initial(i)%velocity_text /= '') .or. scene%initial(i)%temperature_text /= ''
    end do
    do i = 1, size(scene%boundaries)
      has = has .or. any(scene%boundaries(i)%displacement_text /= '') .or. &
        & any(scene%boundaries(i)%velocity_text /= '')
    end do
    do i = 1, size(scene%loads)
      has = has .or. any(scene%loads(i)%force_text /= '') .or. scene%loads(i)%pressure_text /= '' &
        & .or. any(scene%loads(i)%body_force_text /= '')
    end do
  end function has_expressions

  !> Whether a text is an expression that depends on t.
  logical function varies_in_time(scene, text) result(varies)
    type(scene_type), intent(in) :: scene  !! with or without sound definitions
    character(*), intent(in) :: text       !! of a key; '' does not vary
    type(named_value), allocatable :: names(:)
    type(expression_type) :: expression
    type(expression_fault), allocatable :: fault

    varies = .false.
    if (text == '') return
    call names_of(scene, huge(1), names)
    call compile_expression(trim(text), names, expression, fault)
    if (.not. allocated(fault)) varies = expression%in_time
  end function varies_in_time

end module pd_scene_content_expressions
