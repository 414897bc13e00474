!> Checks of a scene before its points are built: required keys are given, alternatives exclude each
!> other, names exist. Fills in defaults.
module pd_scene_content_check
  use pd_base_kinds, only: wp, i2
  use pd_base_error, only: error_type
  use pd_base_text, only: to_text
  use pd_scene_content_check_actions, only: check_initial, check_boundary, check_load
  use pd_scene_content_check_contact, only: check_contact
  use pd_scene_content_check_bodies, only: check_body
  use pd_scene_content_check_materials, only: check_material
  use pd_scene_content_check_rigid, only: check_rigid
  use pd_scene_content_check_shapes, only: check_crack, check_shape, check_side
  use pd_scene_content_check_measures, only: check_measures
  use pd_scene_content_defaults, only: fill_defaults
  use pd_scene_content_expressions, only: at_the_start, check_definitions, check_expression
  use pd_scene_content_groups, only: default_fields, default_probe_fields, table_of
  use pd_scene_content_rules, only: check_region, rule_fault, given, check_known, &
    & check_unique, check_vector
  use pd_scene_format_source, only: source_type
  use pd_scene_groups_relaxation, only: safety_of
  use pd_scene_content_types, only: group_table, is_box, is_of_file, scene_type, shape_group, &
    & is_set, name_length
  implicit none (type, external)
  private
  public :: check_scene, allocate_groups

contains

  !> Check a scene and complete it: afterwards every list is allocated, every body has its material,
  !> Poisson's ratios, ramps, the factor of relaxation and the lists of fields are the ones to
  !> compute with. `source` gives the messages their places. A complete scene is not changed. An
  !> error is set at the first broken rule.
  subroutine check_scene(scene, error, source)
    type(scene_type), intent(inout) :: scene           !! as read or built; complete on return
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
      !! the scanned file; without, messages name group and key only
    integer :: i

    call allocate_groups(scene)
    call check_definitions(scene, error, source)
    if (allocated(error)) return
    call fill_defaults(scene, error, source)
    if (allocated(error)) return
    call check_numbers(scene, error, source)
    if (allocated(error)) return
    call check_settings(scene, error, source)
    if (allocated(error)) return
    call check_names(scene, error, source)
    if (allocated(error)) return
    associate (d => scene%header%dimension)
      do i = 1, size(scene%materials)
        call check_material(scene, i, error, source)
        if (allocated(error)) return
      end do
      do i = 1, size(scene%bodies)
        call check_body(scene, i, error, source)
        if (allocated(error)) return
      end do
      do i = 1, size(scene%kept)
        call check_cut(scene, scene%kept(i), 'keep', i, error, source)
        if (allocated(error)) return
      end do
      do i = 1, size(scene%removed)
        call check_cut(scene, scene%removed(i), 'remove', i, error, source)
        if (allocated(error)) return
      end do
      do i = 1, size(scene%refines)
        call check_refine(scene, i, error, source)
        if (allocated(error)) return
      end do
      do i = 1, size(scene%regions)
        if (scene%regions(i)%where == '' .or. scene%regions(i)%shape /= '' .or. &
          & is_of_file(scene%regions(i))) &
          & call check_shape(scene%regions(i), d, scene%file, 'region', i, error, source)
        call check_expression(scene, scene%regions(i)%where, 'region', i, 'where', 'xyz', &
          & at_the_start, error, source)
        if (allocated(error)) return
      end do
      do i = 1, size(scene%sides)
        call check_side(scene%sides(i), i, error, source)
        call check_expression(scene, scene%sides(i)%where, 'side', i, 'where', 'xyz', &
          & at_the_start, error, source)
        if (allocated(error)) return
      end do
      do i = 1, size(scene%cracks)
        call check_crack(scene%cracks(i), d, scene%file, i, error, source)
        if (allocated(error)) return
      end do
    end associate
    if (any(is_set(scene%header%gravity))) then
      call check_vector(scene%header%gravity, scene%header%dimension, 'gravity', 'scene', 1, &
        & error, source)
      if (allocated(error)) return
    end if
    do i = 1, size(scene%no_fail)
      call check_no_fail(scene, i, error, source)
      if (allocated(error)) return
    end do
    do i = 1, size(scene%initial)
      call check_initial(scene, i, error, source)
      if (allocated(error)) return
    end do
    do i = 1, size(scene%boundaries)
      call check_boundary(scene, i, error, source)
      if (allocated(error)) return
    end do
    do i = 1, size(scene%loads)
      call check_load(scene, i, error, source)
      if (allocated(error)) return
    end do
    do i = 1, size(scene%rigids)
      call check_rigid(scene, i, error, source)
      if (allocated(error)) return
    end do
    do i = 1, size(scene%contacts)
      call check_contact(scene, i, error, source)
      if (allocated(error)) return
    end do
    call check_output(scene, error, source)
    if (allocated(error)) return
    do i = 1, size(scene%tips)
      call check_tip(scene, i, error, source)
      if (allocated(error)) return
    end do
    call check_measures(scene, error, source)
    if (allocated(error)) return
    call check_studies(scene, error, source)
  end subroutine check_scene

  !> Lists that are not allocated get size 0, so that loops need no test.
  subroutine allocate_groups(scene)
    type(scene_type), intent(inout) :: scene
      !! every list of groups, the text and the name of the file are allocated on return
    type(group_table) :: table

    if (.not. allocated(scene%file)) scene%file = ''
    if (.not. allocated(scene%text)) scene%text = ''
    if (.not. allocated(scene%changes)) allocate (scene%changes(0))
    call table_of(scene, table)
    call table%complete(scene)
  end subroutine allocate_groups

  !> Bodies, materials and layers have numbers of 16 bits.
  subroutine check_numbers(scene, error, source)
    type(scene_type), intent(in) :: scene
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    integer, parameter :: most = huge(1_i2)
    character(8), parameter :: groups(3) = [character(8) :: 'body', 'material', 'boundary']
    integer :: numbers(3), i

    numbers = [size(scene%bodies), size(scene%materials), size(scene%boundaries)]
    do i = 1, size(groups)
      if (numbers(i) <= most) cycle
      call rule_fault(error, trim(groups(i)), most + 1, '', 'too many groups &'//trim(groups(i))// &
        & ': '//to_text(numbers(i)), 'there may be '//to_text(most), source)
      return
    end do
  end subroutine check_numbers

  !> The groups that are given once, and the two that every scene needs.
  subroutine check_settings(scene, error, source)
    type(scene_type), intent(inout) :: scene
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source

    if (scene%header%dimension < 1 .or. scene%header%dimension > 3) then
      call rule_fault(error, 'scene', 1, 'dimension', "group &scene lacks the key 'dimension'", &
        & 'expected 1, 2 or 3', source)
    else if (size(scene%materials) == 0) then
      call rule_fault(error, 'material', 1, '', 'the scene has no group &material', &
        & 'expected at least one', source)
    else if (size(scene%bodies) == 0) then
      call rule_fault(error, 'body', 1, '', 'the scene has no group &body', &
        & 'expected at least one', source)
    else if (scene%header%precision == 'mixed' .and. scene%time%method == 'relaxation') then
      ! residual forces would be those of rounding at a tolerance of some 1e-5
      call rule_fault(error, 'scene', 1, 'precision', "'mixed' is not for relaxation", &
        & "expected 'double', or another &time method", source)
    else if (scene%header%precision == 'mixed' .and. scene%horizon%family == 'list') then
      call rule_fault(error, 'scene', 1, 'precision', "'mixed' needs lattice families", &
        & "expected 'double', or another &horizon family", source)
    else if (given('horizon', 1, 'ratio', source) .and. is_set(scene%horizon%length)) then
      call rule_fault(error, 'horizon', 1, 'length', "'ratio' and 'length' are both given", &
        & 'give one of them', source)
    else if (scene%horizon%local .and. is_set(scene%horizon%length)) then
      call rule_fault(error, 'horizon', 1, 'length', "'local' and 'length' are both given", &
        & "'length' is one horizon for all points; give 'ratio' with 'local'", source)
    else if (given('time', 1, 'safety', source) .and. is_set(scene%time%step)) then
      call rule_fault(error, 'time', 1, 'step', "'step' and 'safety' are both given", &
        & 'give one of them', source)
    else if (scene%time%steps > 0 .and. is_set(scene%time%duration)) then
      call rule_fault(error, 'time', 1, 'duration', "'steps' and 'duration' are both given", &
        & 'give one of them', source)
    else if (scene%time%method == 'explicit' .and. scene%time%steps == 0 .and. &
      & .not. is_set(scene%time%duration)) then
      call rule_fault(error, 'time', 1, '', "group &time lacks the key 'steps' or 'duration'", &
        & 'explicit steps in time need one of them', source)
    else if (scene%time%substeps .and. scene%time%method == 'relaxation') then
      call rule_fault(error, 'time', 1, 'substeps', "'substeps' is not for relaxation", &
        & 'it has no steps in time', source)
    else if (scene%time%substeps .and. scene%time%integrator /= 'forward_backward') then
      call rule_fault(error, 'time', 1, 'substeps', "'substeps' is not for integrator = '"// &
        & trim(scene%time%integrator)//"'", "expected 'forward_backward'", source)
    else if (scene%time%substeps .and. scene%time%limit == 'spectral') then
      call rule_fault(error, 'time', 1, 'limit', "'substeps' is not for limit = 'spectral'", &
        & "the largest frequency is that of the finest points: expected 'equation'", source)
    else if (scene%output%every > 0 .and. is_set(scene%output%interval)) then
      call rule_fault(error, 'output', 1, 'interval', "'every' and 'interval' are both given", &
        & 'give one of them', source)
    end if
    scene%relaxation%safety = safety_of(scene%relaxation)
  end subroutine check_settings

  !> Names of one kind of group differ.
  subroutine check_names(scene, error, source)
    type(scene_type), intent(in) :: scene
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    integer :: i

    call check_unique([character(name_length) :: (scene%bodies(i)%name, &
      & i=1, size(scene%bodies))], 'body', error, source)
    if (allocated(error)) return
    call check_unique([character(name_length) :: (scene%materials(i)%name, &
      & i=1, size(scene%materials))], 'material', error, source)
    if (allocated(error)) return
    call check_unique([character(name_length) :: (scene%regions(i)%name, &
      & i=1, size(scene%regions))], 'region', error, source)
    if (allocated(error)) return
    call check_unique([character(name_length) :: (scene%sides(i)%name, &
      & i=1, size(scene%sides))], 'side', error, source)
    if (allocated(error)) return
    call check_unique([character(name_length) :: (scene%boundaries(i)%name, &
      & i=1, size(scene%boundaries))], 'boundary', error, source)
    if (allocated(error)) return
    call check_unique([character(name_length) :: (scene%probes(i)%name, &
      & i=1, size(scene%probes))], 'probe', error, source)
    if (allocated(error)) return
    call check_unique([character(name_length) :: (scene%tips(i)%name, &
      & i=1, size(scene%tips))], 'tip', error, source)
  end subroutine check_names

  !> One `&keep` or `&remove`: a region of space, an expression or a shape, or several of them.
  subroutine check_cut(scene, cut, group, number, error, source)
    type(scene_type), intent(in) :: scene
    class(shape_group), intent(in) :: cut
    character(*), intent(in) :: group
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source

    if (index(cut%region, ':') > 0) then
      call rule_fault(error, group, number, 'region', "'"//trim(cut%region)//"' names a set of "// &
        & 'a mesh, whose points cannot be left out', 'cut the shape out of the geometry before '// &
        & 'it is meshed', source)
      return
    end if
    call check_region(scene, cut%region, group, number, 'region', error, source)
    call check_expression(scene, cut%where, group, number, 'where', 'xyz', at_the_start, error, &
      & source)
    if (allocated(error)) return
    if (cut%shape /= '' .or. is_of_file(cut) .or. (cut%region == '' .and. cut%where == '')) &
      & call check_shape(cut, scene%header%dimension, scene%file, group, number, error, source)
  end subroutine check_cut

  !> One `&refine`: where, and how far; bodies that it may not divide are refused.
  subroutine check_refine(scene, number, error, source)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    integer, parameter :: most_levels = 8
    integer :: b

    call check_cut(scene, scene%refines(number), 'refine', number, error, source)
    if (allocated(error)) return
    if (scene%refines(number)%levels > most_levels) then
      call rule_fault(error, 'refine', number, 'levels', to_text(scene%refines(number)%levels)// &
        & ' levels', 'there may be '//to_text(most_levels)//': spacings of 1/256', source)
      return
    end if
    do b = 1, size(scene%bodies)
      associate (body => scene%bodies(b))
        if (is_box(body) .or. body%file /= '' .or. body%mesh /= '') cycle
      end associate
      call rule_fault(error, 'refine', number, '', '&refine in a scene whose body number '// &
        & to_text(b)//' is no lattice that fills a box along x, y and z', "bodies with "// &
        & "'surface', 'axis_1', or a sphere or cylinder for 'shape' cannot be refined; cut "// &
        & 'them out of a box by &keep', source)
      return
    end do
    if (all(scene%bodies%file /= '' .or. scene%bodies%mesh /= '')) then
      call rule_fault(error, 'refine', number, '', '&refine without a lattice', 'clouds and '// &
        & "meshes have the spacings that they are made with; '&horizon local' gives them "// &
        & 'horizons by these', source)
    else if (is_set(scene%horizon%length)) then
      call rule_fault(error, 'horizon', 1, 'length', "'length' is given with &refine", &
        & "the horizon is halved with the spacing: give 'ratio'", source)
    end if
  end subroutine check_refine

  !> One `&no_fail`: a region or a shape.
  subroutine check_no_fail(scene, number, error, source)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source

    associate (zone => scene%no_fail(number))
      if (zone%region == '' .and. zone%shape == '' .and. .not. is_of_file(zone)) then
        call rule_fault(error, 'no_fail', number, '', &
          & "group &no_fail lacks the key 'region' or 'shape'", 'expected one of them', source)
      else if (zone%region /= '' .and. zone%shape /= '') then
        call rule_fault(error, 'no_fail', number, 'shape', "'region' and 'shape' are both given", &
          & 'give one of them', source)
      else if (zone%region /= '' .and. zone%surface /= '') then
        call rule_fault(error, 'no_fail', number, 'surface', "'region' and 'surface' are both "// &
          & 'given', 'give one of them', source)
      else if (zone%region /= '' .and. zone%mesh /= '') then
        call rule_fault(error, 'no_fail', number, 'mesh', "'region' and 'mesh' are both given", &
          & 'give one of them', source)
      else if (zone%region /= '') then
        call check_region(scene, zone%region, 'no_fail', number, 'region', error, source)
      else
        call check_shape(zone, scene%header%dimension, scene%file, 'no_fail', number, error, &
          & source)
      end if
    end associate
  end subroutine check_no_fail

  !> Probes lie somewhere, and fields that are not named are the default ones.
  subroutine check_output(scene, error, source)
    type(scene_type), intent(inout) :: scene
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    integer :: i

    if (.not. allocated(scene%output%fields)) then
      allocate (scene%output%fields(size(default_fields)))
      scene%output%fields(:) = default_fields
    end if
    if (scene%output%cells .and. all(scene%bodies%mesh == '')) then
      call rule_fault(error, 'output', 1, 'cells', "'cells' without a mesh", &
        & "cells are the elements of bodies with the key 'mesh'; ./pf plot draws the cells of "// &
        & 'lattices without it', source)
    else if (scene%output%cells .and. scene%output%format /= 'vtkhdf') then
      call rule_fault(error, 'output', 1, 'format', "format = '"//trim(scene%output%format)// &
        & "' has no cells of meshes", "only format = 'vtkhdf' has them", source)
    end if
    if (allocated(error)) return
    do i = 1, size(scene%probes)
      associate (probe => scene%probes(i))
        if (probe%name == '') then
          call rule_fault(error, 'probe', i, '', "group &probe lacks the key 'name'", &
            & 'its columns begin with it', source)
          return
        end if
        call check_vector(probe%point, scene%header%dimension, 'point', 'probe', i, error, source)
        if (allocated(error)) return
        if (.not. allocated(probe%fields)) then
          allocate (probe%fields(size(default_probe_fields)))
          probe%fields(:) = default_probe_fields
        end if
      end associate
    end do
  end subroutine check_output

  !> One `&tip`: it has a name, begins somewhere and goes somewhere.
  subroutine check_tip(scene, number, error, source)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source

    associate (tip => scene%tips(number), dim => scene%header%dimension)
      if (tip%name == '') then
        call rule_fault(error, 'tip', number, '', "group &tip lacks the key 'name'", &
          & 'its columns begin with it', source)
        return
      end if
      call check_vector(tip%from, dim, 'from', 'tip', number, error, source)
      if (allocated(error)) return
      call check_vector(tip%direction, dim, 'direction', 'tip', number, error, source)
      if (allocated(error)) return
      if (.not. norm2(tip%direction(:dim)) > 0.0_wp) then
        call rule_fault(error, 'tip', number, 'direction', "'direction' has no length", &
          & 'expected a vector of growth', source)
      else if (tip%across /= '' .and. dim < 3) then
        call rule_fault(error, 'tip', number, 'across', "'across' is given in "//to_text(dim)// &
          & 'D', 'only in 3D a crack has a front', source)
      else if (tip%across /= '') then
        associate (c => index('xyz', trim(tip%across)))
          ! a front along the direction of growth has no projections to compare
          if (abs(tip%direction(c)) > 0.9_wp*norm2(tip%direction)) call rule_fault(error, 'tip', &
            & number, 'across', "'across' is the direction of growth", &
            & 'expected an axis along which the front extends', source)
        end associate
      end if
    end associate
  end subroutine check_tip

  !> Every `&study` varies something, and where it measures a field in a region there is one.
  subroutine check_studies(scene, error, source)
    type(scene_type), intent(in) :: scene
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source
    integer :: i

    do i = 1, size(scene%studies)
      associate (study => scene%studies(i))
        if (study%vary == '' .or. .not. allocated(study%values)) then
          call rule_fault(error, 'study', i, '', "group &study lacks the key 'vary' or 'values'", &
            & 'expected a key and its values', source)
        else
          call check_region(scene, study%region, 'study', i, 'region', error, source)
        end if
        if (allocated(error)) return
      end associate
    end do
  end subroutine check_studies

end module pd_scene_content_check
