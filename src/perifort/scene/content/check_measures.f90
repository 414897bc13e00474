!> Checks of the groups that measure something for the history or the outputs.
module pd_scene_content_check_measures
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp
  use pd_base_text, only: lower_case, to_text
  use pd_scene_content_groups, only: default_probe_fields
  use pd_scene_content_rules, only: check_finite_box, check_unique, check_vector, rule_fault
  use pd_scene_content_types, only: is_set, name_length, scene_type
  use pd_scene_format_source, only: source_type
  implicit none (type, external)
  private
  public :: check_measures

contains

  !> The groups are complete and fit the dimension; defaults are filled in. An error is set at the
  !> first broken rule.
  subroutine check_measures(scene, error, source)
    type(scene_type), intent(inout) :: scene           !! with all lists allocated
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    integer :: i

    call check_unique([character(name_length) :: (scene%sections(i)%name, &
      & i=1, size(scene%sections))], 'section', error, source)
    if (allocated(error)) return
    do i = 1, size(scene%sections)
      call check_section(scene, i, error, source)
      if (allocated(error)) return
    end do
    call check_unique([character(name_length) :: (scene%lines(i)%name, &
      & i=1, size(scene%lines))], 'line', error, source)
    if (allocated(error)) return
    do i = 1, size(scene%lines)
      call check_line(scene, i, error, source)
      if (allocated(error)) return
    end do
    call check_unique([character(name_length) :: (scene%j_integrals(i)%name, &
      & i=1, size(scene%j_integrals))], 'j_integral', error, source)
    if (allocated(error)) return
    do i = 1, size(scene%j_integrals)
      call check_j_integral(scene, i, error, source)
      if (allocated(error)) return
    end do
  end subroutine check_measures

  !> The names of files that runs write beside those of lines.
  pure logical function is_taken(name)
    character(*), intent(in) :: name
    is_taken = any(name == [character(name_length) :: 'history', 'iterations', 'fragments'])
  end function is_taken

  !> One `&line`.
  subroutine check_line(scene, number, error, source)
    type(scene_type), intent(inout) :: scene
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source

    associate (line => scene%lines(number), d => scene%header%dimension)
      call check_name(line%name, 'line', number, error, source)
      if (allocated(error)) return
      if (is_taken(lower_case(line%name))) then
        call rule_fault(error, 'line', number, 'name', "'"//trim(line%name)// &
          & "' is no name for a line", trim(line%name)//'.csv is another file of a run', source)
        return
      end if
      call check_vector(line%from, d, 'from', 'line', number, error, source)
      if (allocated(error)) return
      call check_vector(line%to, d, 'to', 'line', number, error, source)
      if (allocated(error)) return
      if (norm2(line%to(:d) - line%from(:d)) <= 0.0_wp) then
        call rule_fault(error, 'line', number, 'to', "'to' is at 'from'", &
          & 'a line has a length', source)
        return
      end if
      if (.not. allocated(line%fields)) then
        allocate (line%fields(size(default_probe_fields)))
        line%fields(:) = default_probe_fields
      end if
    end associate
  end subroutine check_line

  !> One `&j_integral`: the box is bounded, and the tip lies in its inner half.
  subroutine check_j_integral(scene, number, error, source)
    type(scene_type), intent(inout) :: scene
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source

    associate (group => scene%j_integrals(number), d => scene%header%dimension)
      call check_name(group%name, 'j_integral', number, error, source)
      if (allocated(error)) return
      if (d /= 2) then
        call rule_fault(error, 'j_integral', number, '', '&j_integral in a scene of dimension '// &
          & to_text(d), 'the integral is that of the plane: expected dimension = 2', source)
        return
      end if
      call check_vector(group%lower, d, 'lower', 'j_integral', number, error, source)
      if (allocated(error)) return
      call check_vector(group%upper, d, 'upper', 'j_integral', number, error, source)
      if (allocated(error)) return
      call check_finite_box(group%lower(:d), group%upper(:d), 'j_integral', number, error, source)
      if (allocated(error)) return
      call check_direction(group%direction, d, 'direction', 'j_integral', number, error, source)
      if (allocated(error)) return
      if (.not. any(is_set(group%tip))) group%tip(:d) = (group%lower(:d) + group%upper(:d))/2
      call check_vector(group%tip, d, 'tip', 'j_integral', number, error, source)
      if (allocated(error)) return
      if (any(abs(group%tip(:d) - (group%lower(:d) + group%upper(:d))/2) > &
        & (group%upper(:d) - group%lower(:d))/4)) call rule_fault(error, 'j_integral', number, &
        & 'tip', "'tip' lies outside of the inner half of the box", &
        & "the integral is taken in the outer half of 'lower' to 'upper', around the tip", source)
    end associate
  end subroutine check_j_integral

  !> A group needs its name.
  subroutine check_name(name, group, number, error, source)
    character(*), intent(in) :: name, group
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source

    if (name == '') call rule_fault(error, group, number, '', 'group &'//group// &
      & " lacks the key 'name'", 'what it measures is named by it', source)
  end subroutine check_name

  !> A direction is not 0.
  subroutine check_direction(value, dimension, key, group, number, error, source)
    real(wp), intent(in) :: value(3)
    integer, intent(in) :: dimension
    character(*), intent(in) :: key, group
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source

    call check_vector(value, dimension, key, group, number, error, source)
    if (allocated(error)) return
    if (norm2(value(:dimension)) > 0.0_wp) return
    call rule_fault(error, group, number, key, "'"//key//"' has no length", &
      & 'expected a direction', source)
  end subroutine check_direction

  !> A box: as many values as directions, the lower corner below the upper one.
  subroutine check_box(lower, upper, dimension, group, number, error, source)
    real(wp), intent(in) :: lower(3), upper(3)
    integer, intent(in) :: dimension
    character(*), intent(in) :: group
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source

    if (any(is_set(lower))) call check_vector(lower, dimension, 'lower', group, number, error, &
      & source)
    if (allocated(error)) return
    if (any(is_set(upper))) call check_vector(upper, dimension, 'upper', group, number, error, &
      & source)
    if (allocated(error)) return
    call check_finite_box(lower(:dimension), upper(:dimension), group, number, error, source)
  end subroutine check_box

  !> One `&section`.
  subroutine check_section(scene, number, error, source)
    type(scene_type), intent(inout) :: scene
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source

    associate (section => scene%sections(number), d => scene%header%dimension)
      call check_name(section%name, 'section', number, error, source)
      if (allocated(error)) return
      call check_vector(section%point, d, 'point', 'section', number, error, source)
      if (allocated(error)) return
      if (d == 1 .and. .not. any(is_set(section%normal))) section%normal(1) = 1.0_wp
      call check_direction(section%normal, d, 'normal', 'section', number, error, source)
      if (allocated(error)) return
      call check_box(section%lower, section%upper, d, 'section', number, error, source)
    end associate
  end subroutine check_section

end module pd_scene_content_check_measures
