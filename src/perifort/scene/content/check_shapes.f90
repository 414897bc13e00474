!> Rules for places in space: shapes of regions, zones and cuts, sides of surfaces, cracks.
module pd_scene_content_check_shapes
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type
  use pd_base_text, only: to_text
  use pd_scene_content_rules, only: rule_fault, given, check_file, check_finite_box, check_vector
  use pd_scene_format_source, only: source_type
  use pd_scene_content_types, only: shape_group, crack_group, side_group, is_of_file, is_set
  implicit none (type, external)
  private
  public :: check_shape, check_side, check_crack

contains

  !> The shape keys of `&remove`, `&keep`, `&region` and `&no_fail`: those of its kind and no
  !> others. An
  !> error is set if a rule is broken.
  subroutine check_shape(shape, dimension, scene_file, group, number, error, source)
    class(shape_group), intent(in) :: shape            !! the group, or its part that is a shape
    integer, intent(in) :: dimension                   !! of the scene
    character(:), allocatable, intent(in) :: scene_file
      !! path of the scene file, whose folder is looked in first; may be unallocated
    character(*), intent(in) :: group                  !! name of the group
    integer, intent(in) :: number                      !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places

    if (is_of_file(shape)) then
      call check_shape_file()
      return
    else if (abs(shape%scale - 1.0_wp) > 0.0_wp) then
      call rule_fault(error, group, number, 'scale', "'scale' without a surface or mesh", &
        & "it belongs to the keys 'surface' and 'mesh'", source)
      return
    end if
    select case (shape%shape)
    case ('box')
      call refuse(['centre   ', 'radius   ', 'axis     ', 'direction', 'height   ', 'angle    '])
      if (allocated(error)) return
      if (.not. any(is_set(shape%lower(:dimension))) .and. &
        & .not. any(is_set(shape%upper(:dimension)))) then
        call rule_fault(error, group, number, 'shape', 'a box without bounds', &
          & "expected 'lower', 'upper' or both; a component not given is unbounded", source)
      end if
    case ('sphere')
      call refuse(['lower    ', 'upper    ', 'axis     ', 'direction', 'height   ', 'angle    '])
      call need(shape%radius, 'radius', 'its radius [m]')
    case ('cylinder')
      call refuse(['angle    '])
      if (any(is_set(shape%direction))) call refuse(['lower    ', 'upper    ', 'axis     '])
      call need(shape%radius, 'radius', 'its radius [m]')
      if (any(is_set(shape%direction))) call need_direction()
    case ('cone')
      call refuse(['lower    ', 'upper    ', 'radius   ', 'axis     '])
      call need(shape%angle, 'angle', 'its opening angle [degrees]')
      call need_direction()
    case ('half_space')
      call refuse(['lower    ', 'upper    ', 'radius   ', 'axis     ', 'height   ', 'angle    '])
      call need_direction()
    case default
      call rule_fault(error, group, number, 'shape', 'group &'//group//" lacks the key 'shape'", &
        & "expected 'box', 'sphere', 'cylinder', 'cone' or 'half_space', or the key 'surface' "// &
        & "or 'mesh'"//alternatives(group), source)
    end select
    if (allocated(error)) return
    call check_finite_box(shape%lower, shape%upper, group, number, error, source)

  contains

    !> A surface or a mesh instead of a shape.
    subroutine check_shape_file()
      character(:), allocatable :: key

      key = trim(merge('surface', 'mesh   ', shape%surface /= ''))
      if (shape%surface /= '' .and. shape%mesh /= '') then
        call rule_fault(error, group, number, 'mesh', "'mesh' beside a surface", &
          & 'give one of them', source)
      else if (shape%surface /= '' .and. dimension /= 3) then
        call rule_fault(error, group, number, 'surface', 'a surface in a scene of dimension '// &
          & to_text(dimension), "facets enclose a volume in 3D only; a 'mesh' may have any "// &
          & 'dimension', source)
      else if (shape%shape /= '' .or. any(is_set([shape%lower, shape%upper, shape%direction])) &
        & .or. any(is_set([shape%radius, shape%height, shape%angle]))) then
        call rule_fault(error, group, number, key, "'"//key//"' beside a shape", &
          & 'give one of them', source)
      else if (key == 'surface') then
        call check_file(shape%surface, scene_file, group, number, error, source, 'surface')
      else
        call check_file(shape%mesh, scene_file, group, number, error, source, 'mesh')
      end if
    end subroutine check_shape_file

    !> An error if a key of another kind of shape is given.
    subroutine refuse(keys)
      character(*), intent(in) :: keys(:)
      integer :: i

      do i = 1, size(keys)
        if (allocated(error) .or. .not. given(group, number, trim(keys(i)), source)) cycle
        call rule_fault(error, group, number, trim(keys(i)), "'"//trim(keys(i))// &
          & "' is no key of a "//trim(shape%shape)//trim(merge(' with a direction', &
          & '                 ', shape%shape == 'cylinder' .and. keys(i) /= 'angle')), &
          & "it belongs to another kind of 'shape'", source)
      end do
    end subroutine refuse

    !> An error if a measure of the shape is not given.
    subroutine need(value, key, what)
      real(wp), intent(in) :: value
      character(*), intent(in) :: key, what

      if (allocated(error) .or. is_set(value)) return
      call rule_fault(error, group, number, 'shape', 'a '//trim(shape%shape)// &
        & " without the key '"//key//"'", 'expected '//what, source)
    end subroutine need

    !> An error if a direction is missing or has no length.
    subroutine need_direction()
      if (allocated(error)) return
      call check_vector(shape%direction, dimension, 'direction', group, number, error, source)
      if (allocated(error)) return
      if (norm2(shape%direction(:dimension)) <= 0.0_wp) call rule_fault(error, group, number, &
        & 'direction', "'direction' is zero", 'expected a vector', source)
    end subroutine need_direction

  end subroutine check_shape

  !> What a group may have instead of a shape, for a message.
  pure function alternatives(group) result(text)
    character(*), intent(in) :: group
    character(:), allocatable :: text

    select case (group)
    case ('region')
      text = ", or 'where'"
    case ('remove', 'keep')
      text = ", or 'region' or 'where'"
    case default  ! groups that have a shape or nothing
      text = ''
    end select
  end function alternatives

  !> One `&side`: an expression or a normal. An error is set if it has neither.
  subroutine check_side(side, number, error, source)
    type(side_group), intent(in) :: side               !! the group
    integer, intent(in) :: number                      !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places

    if (side%where == '' .and. .not. any(is_set(side%normal))) then
      call rule_fault(error, 'side', number, '', "group &side lacks the key 'where' or 'normal'", &
        & 'expected one of them, or both', source)
    else if (any(is_set(side%normal))) then
      call check_vector(side%normal, 3, 'normal', 'side', number, error, source)
      if (allocated(error)) return
      if (norm2(side%normal) <= 0.0_wp) call rule_fault(error, 'side', number, 'normal', &
        & "'normal' is zero", 'expected a direction', source)
    else if (given('side', number, 'angle', source)) then
      call rule_fault(error, 'side', number, 'angle', "'angle' without 'normal'", &
        & 'it is measured from the normal', source)
    end if
  end subroutine check_side

  !> One `&crack`: one kind, the one of the dimension, complete and not degenerate. An error is set
  !> if a rule is broken.
  subroutine check_crack(crack, dimension, scene_file, number, error, source)
    type(crack_group), intent(in) :: crack             !! the group
    integer, intent(in) :: dimension                   !! of the scene
    character(:), allocatable, intent(in) :: scene_file
      !! path of the scene file, whose folder is looked in first; may be unallocated
    integer, intent(in) :: number                      !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    logical :: segment, parallelogram, disc, chain
    character(:), allocatable :: kinds
    real(wp) :: cross(3)

    segment = any(is_set(crack%from)) .or. any(is_set(crack%to))
    parallelogram = any(is_set(crack%corner)) .or. any(is_set(crack%edge_1)) .or. &
      & any(is_set(crack%edge_2))
    disc = any(is_set(crack%centre)) .or. any(is_set(crack%normal)) .or. is_set(crack%radius)
    chain = allocated(crack%points)
    if (chain) then
      call check_chain(crack, dimension, segment .or. parallelogram .or. disc, number, error, &
        & source)
    else if (crack%surface /= '') then
      if (dimension /= 3) then
        call rule_fault(error, 'crack', number, 'surface', 'a surface in a scene of dimension '// &
          & to_text(dimension), 'facets are cracks in 3D; in 2D a crack is a segment', source)
      else if (segment .or. parallelogram .or. disc) then
        call rule_fault(error, 'crack', number, 'surface', "'surface' beside another kind of "// &
          & 'crack', 'give a &crack for each', source)
      else
        call check_file(crack%surface, scene_file, 'crack', number, error, source, 'surface')
      end if
    else if (abs(crack%scale - 1.0_wp) > 0.0_wp) then
      call rule_fault(error, 'crack', number, 'scale', "'scale' without a surface", &
        & "it belongs to the key 'surface'", source)
    else if (dimension == 1) then
      call rule_fault(error, 'crack', number, '', 'a crack in a scene of dimension 1', &
        & 'cracks are segments (2D), parallelograms or discs (3D)', source)
    else if (count([segment, parallelogram, disc]) /= 1 .or. (segment .neqv. dimension == 2)) then
      if (dimension == 2) then
        kinds = "expected a segment: 'from' and 'to', or a chain of them: 'points'"
      else
        kinds = "expected a parallelogram: 'corner', 'edge_1', 'edge_2', a disc: "// &
          & "'centre', 'normal', 'radius', or a 'surface'"
      end if
      call rule_fault(error, 'crack', number, '', 'this is not a crack of dimension '// &
        & to_text(dimension), kinds, source)
    else if (segment) then
      call check_vector(crack%from, 2, 'from', 'crack', number, error, source)
      if (allocated(error)) return
      call check_vector(crack%to, 2, 'to', 'crack', number, error, source)
      if (allocated(error)) return
      if (all(abs(crack%from(:2) - crack%to(:2)) <= 0.0_wp)) call rule_fault(error, 'crack', &
        & number, 'to', 'a crack without length', "'from' and 'to' are the same point", source)
    else if (parallelogram) then
      call check_vector(crack%corner, 3, 'corner', 'crack', number, error, source)
      if (allocated(error)) return
      call check_vector(crack%edge_1, 3, 'edge_1', 'crack', number, error, source)
      if (allocated(error)) return
      call check_vector(crack%edge_2, 3, 'edge_2', 'crack', number, error, source)
      if (allocated(error)) return
      cross = [crack%edge_1(2)*crack%edge_2(3) - crack%edge_1(3)*crack%edge_2(2), &
        & crack%edge_1(3)*crack%edge_2(1) - crack%edge_1(1)*crack%edge_2(3), &
        & crack%edge_1(1)*crack%edge_2(2) - crack%edge_1(2)*crack%edge_2(1)]
      if (norm2(cross) <= 1.0e-12_wp*norm2(crack%edge_1)*norm2(crack%edge_2)) &
        & call rule_fault(error, 'crack', number, 'edge_2', 'a crack without area', &
        & "'edge_1' and 'edge_2' are parallel or zero", source)
    else
      call check_vector(crack%centre, 3, 'centre', 'crack', number, error, source)
      if (allocated(error)) return
      call check_vector(crack%normal, 3, 'normal', 'crack', number, error, source)
      if (allocated(error)) return
      if (norm2(crack%normal) <= 0.0_wp) then
        call rule_fault(error, 'crack', number, 'normal', "'normal' is zero", &
          & 'expected a direction', source)
      else if (.not. is_set(crack%radius)) then
        call rule_fault(error, 'crack', number, '', "group &crack lacks the key 'radius'", &
          & 'expected the radius of the disc [m]', source)
      end if
    end if
  end subroutine check_crack

  !> A crack that is a chain of segments: two points at least, none of them twice in a row.
  subroutine check_chain(crack, dimension, others, number, error, source)
    type(crack_group), intent(in) :: crack
    integer, intent(in) :: dimension
    logical, intent(in) :: others             !! it has keys of other kinds of cracks
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    integer :: i

    if (dimension /= 2) then
      call rule_fault(error, 'crack', number, 'points', 'a chain of segments in a scene of '// &
        & 'dimension '//to_text(dimension), 'it belongs to dimension 2', source)
    else if (others) then
      call rule_fault(error, 'crack', number, 'points', "'points' with keys of another kind of "// &
        & 'crack', 'give one kind in a &crack', source)
    else if (modulo(size(crack%points), 2) == 1 .or. size(crack%points) < 4) then
      call rule_fault(error, 'crack', number, 'points', "'points' has "// &
        & to_text(size(crack%points))//' values', 'expected x and y of two points or more', source)
    else
      do i = 1, size(crack%points) - 3, 2
        if (any(abs(crack%points(i:i + 1) - crack%points(i + 2:i + 3)) > 0.0_wp)) cycle
        call rule_fault(error, 'crack', number, 'points', 'a crack without length', 'points '// &
          & to_text((i + 1)/2)//' and '//to_text((i + 3)/2)//' are the same', source)
        return
      end do
    end if
  end subroutine check_chain

end module pd_scene_content_check_shapes
