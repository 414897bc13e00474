!> The table of groups: one line for each group of a scene file, in the order of the reference.
!>
!> Another group needs a file with its type, which extends `group_type`, and a line here. Its place
!> in the scene is `scene%added`; a component of `scene_type` also needs a procedure below that
!> returns it.
module pd_scene_content_groups
  use pd_scene_content_types, only: scene_type, header_type, define_group, body_group, &
    & shape_group, region_group, no_fail_group, material_group, horizon_group, crack_group, &
    & initial_group, boundary_group, load_group, time_group, relaxation_group, output_group, &
    & probe_group, tip_group, section_group, line_group, j_integral_group, study_group, &
    & side_group, contact_group, rigid_group, refine_group, group_table
  use pd_scene_groups_course, only: sides
  use pd_scene_groups_group, only: group_type
  use pd_scene_groups_output, only: default_fields
  use pd_scene_groups_probe, only: default_probe_fields
  use pd_scene_groups_shape, only: shape_names
  use pd_scene_groups_study, only: closed_forms
  implicit none (type, external)
  private
  public :: list_groups, table_of
  public :: shape_names, sides, default_fields, default_probe_fields, closed_forms

contains

  !> The table of the program's own groups.
  subroutine list_groups(table)
    type(group_table), intent(out) :: table  !! all groups, in the order of the reference
    logical, parameter :: once = .false., repeated = .true.

    call table%add('scene', 'The problem as a whole: its title, its dimension and the '// &
      & 'assumptions that come with it.', once, header_type(), one=header)
    call table%add('define', 'A name for a number, to be used in expressions.', repeated, &
      & define_group(), all=definitions)
    call table%add('body', 'Material points: a lattice that fills a box, a sphere, a cylinder '// &
      & 'or a surface, a mesh, or a cloud read from a file.', repeated, body_group(), all=bodies)
    call table%add('keep', 'What stays of the bodies: points that lie inside of none of these '// &
      & 'groups are left out. `&remove` comes after it.', repeated, shape_group(), all=kept)
    call table%add('remove', 'A shape cut out of the bodies: points whose centres lie inside '// &
      & 'it are left out.', repeated, shape_group(), all=removed)
    call table%add('refine', 'Where lattices are finer: cells whose centres lie inside are '// &
      & 'divided in half along every direction, `levels` times.', repeated, refine_group(), &
      & all=refines)
    call table%add('region', 'A named part of space, by a shape or an expression; other '// &
      & 'groups use the points inside it by its name.', repeated, region_group(), all=regions)
    call table%add('side', 'Facets of a surface by a name: by their centres, their normals, or '// &
      & 'both; loads and boundaries use them as BODY:NAME.', repeated, side_group(), &
      & all=named_sides)
    call table%add('material', 'A material: how its bonds carry force and when they break.', &
      & repeated, material_group(), all=materials)
    call table%add('horizon', 'How far points interact, and how the sums over families are '// &
      & 'corrected.', once, horizon_group(), one=horizon)
    call table%add('crack', 'A crack that is there from the start: a segment in 2D (from, to), '// &
      & 'or a chain of them (points); in 3D a parallelogram (corner, edge_1, edge_2), a disc '// &
      & '(centre, normal, radius), or the facets of a file (surface).', repeated, crack_group(), &
      & all=cracks)
    call table%add('no_fail', 'A zone where no bond breaks: a region by its name, or a shape.', &
      & repeated, no_fail_group(), all=no_fail)
    call table%add('initial', 'The state at the start, of all points or of a region. The '// &
      & 'groups are applied in order, each sets the values it gives.', repeated, initial_group(), &
      & all=initial)
    call table%add('boundary', 'Imposed motion of a layer added outside a side, or of a '// &
      & 'region. Components not named stay free.', repeated, boundary_group(), all=boundaries)
    call table%add('load', 'A force on the outermost points of a side of a body, or on a '// &
      & 'region.', repeated, load_group(), all=loads)
    call table%add('rigid', 'A rigid body of a given shape, without points, that bodies touch '// &
      & 'by a &contact which names it.', repeated, rigid_group(), all=rigids)
    call table%add('contact', 'Bodies that touch and pieces that come together again: points '// &
      & 'that share no intact bond push apart.', repeated, contact_group(), all=contacts)
    call table%add('time', 'How the state moves: explicit steps in time, or relaxation to '// &
      & 'static equilibrium.', once, time_group(), one=time)
    call table%add('relaxation', "How static equilibrium is found (time method = "// &
      & "'relaxation').", once, relaxation_group(), one=relaxation)
    call table%add('output', 'What is written, and how often.', once, output_group(), one=output)
    call table%add('probe', 'The values of the nearest point in every row of the history.', &
      & repeated, probe_group(), all=probes)
    call table%add('tip', 'The tip of a crack in every row of the history: where it is, how '// &
      & 'far and how fast it has come, and whether it branches.', repeated, tip_group(), all=tips)
    call table%add('section', 'Force and moment carried across a plane (3D), a line (2D) or a '// &
      & 'point (1D), in every row of the history.', repeated, section_group(), all=sections)
    call table%add('line', 'Profiles of fields along a line, at each output.', repeated, &
      & line_group(), all=lines)
    call table%add('j_integral', 'Energy release rate and stress intensity factors of a crack '// &
      & 'tip (2D), in every row of the history.', repeated, j_integral_group(), all=j_integrals)
    call table%add('study', 'A key that `perifort study` and `choose` vary. Several groups '// &
      & 'make the product of their values; measure and against are given in one of them '// &
      & 'only. `run` ignores it.', repeated, study_group(), all=studies)
  end subroutine list_groups

  !> The table of a scene's groups: its own, or the program's.
  subroutine table_of(scene, table)
    type(scene_type), intent(in) :: scene    !! with or without a table of its own
    type(group_table), intent(out) :: table  !! a copy

    if (allocated(scene%table)) then
      table = scene%table
    else
      call list_groups(table)
    end if
  end subroutine table_of

  subroutine header(scene, group)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: group
    group => scene%header
  end subroutine header

  subroutine horizon(scene, group)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: group
    group => scene%horizon
  end subroutine horizon

  subroutine time(scene, group)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: group
    group => scene%time
  end subroutine time

  subroutine relaxation(scene, group)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: group
    group => scene%relaxation
  end subroutine relaxation

  subroutine output(scene, group)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: group
    group => scene%output
  end subroutine output

  subroutine definitions(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%definitions)) deallocate (scene%definitions)
    if (present(room)) allocate (scene%definitions(room))
    if (.not. allocated(scene%definitions)) allocate (scene%definitions(0))
    groups => scene%definitions
  end subroutine definitions

  subroutine bodies(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%bodies)) deallocate (scene%bodies)
    if (present(room)) allocate (scene%bodies(room))
    if (.not. allocated(scene%bodies)) allocate (scene%bodies(0))
    groups => scene%bodies
  end subroutine bodies

  subroutine kept(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%kept)) deallocate (scene%kept)
    if (present(room)) allocate (scene%kept(room))
    if (.not. allocated(scene%kept)) allocate (scene%kept(0))
    groups => scene%kept
  end subroutine kept

  subroutine removed(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%removed)) deallocate (scene%removed)
    if (present(room)) allocate (scene%removed(room))
    if (.not. allocated(scene%removed)) allocate (scene%removed(0))
    groups => scene%removed
  end subroutine removed

  subroutine refines(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%refines)) deallocate (scene%refines)
    if (present(room)) allocate (scene%refines(room))
    if (.not. allocated(scene%refines)) allocate (scene%refines(0))
    groups => scene%refines
  end subroutine refines

  subroutine regions(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%regions)) deallocate (scene%regions)
    if (present(room)) allocate (scene%regions(room))
    if (.not. allocated(scene%regions)) allocate (scene%regions(0))
    groups => scene%regions
  end subroutine regions

  subroutine named_sides(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%sides)) deallocate (scene%sides)
    if (present(room)) allocate (scene%sides(room))
    if (.not. allocated(scene%sides)) allocate (scene%sides(0))
    groups => scene%sides
  end subroutine named_sides

  subroutine materials(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%materials)) deallocate (scene%materials)
    if (present(room)) allocate (scene%materials(room))
    if (.not. allocated(scene%materials)) allocate (scene%materials(0))
    groups => scene%materials
  end subroutine materials

  subroutine cracks(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%cracks)) deallocate (scene%cracks)
    if (present(room)) allocate (scene%cracks(room))
    if (.not. allocated(scene%cracks)) allocate (scene%cracks(0))
    groups => scene%cracks
  end subroutine cracks

  subroutine no_fail(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%no_fail)) deallocate (scene%no_fail)
    if (present(room)) allocate (scene%no_fail(room))
    if (.not. allocated(scene%no_fail)) allocate (scene%no_fail(0))
    groups => scene%no_fail
  end subroutine no_fail

  subroutine initial(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%initial)) deallocate (scene%initial)
    if (present(room)) allocate (scene%initial(room))
    if (.not. allocated(scene%initial)) allocate (scene%initial(0))
    groups => scene%initial
  end subroutine initial

  subroutine boundaries(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%boundaries)) deallocate (scene%boundaries)
    if (present(room)) allocate (scene%boundaries(room))
    if (.not. allocated(scene%boundaries)) allocate (scene%boundaries(0))
    groups => scene%boundaries
  end subroutine boundaries

  subroutine loads(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%loads)) deallocate (scene%loads)
    if (present(room)) allocate (scene%loads(room))
    if (.not. allocated(scene%loads)) allocate (scene%loads(0))
    groups => scene%loads
  end subroutine loads

  subroutine rigids(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%rigids)) deallocate (scene%rigids)
    if (present(room)) allocate (scene%rigids(room))
    if (.not. allocated(scene%rigids)) allocate (scene%rigids(0))
    groups => scene%rigids
  end subroutine rigids

  subroutine contacts(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%contacts)) deallocate (scene%contacts)
    if (present(room)) allocate (scene%contacts(room))
    if (.not. allocated(scene%contacts)) allocate (scene%contacts(0))
    groups => scene%contacts
  end subroutine contacts

  subroutine probes(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%probes)) deallocate (scene%probes)
    if (present(room)) allocate (scene%probes(room))
    if (.not. allocated(scene%probes)) allocate (scene%probes(0))
    groups => scene%probes
  end subroutine probes

  subroutine tips(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%tips)) deallocate (scene%tips)
    if (present(room)) allocate (scene%tips(room))
    if (.not. allocated(scene%tips)) allocate (scene%tips(0))
    groups => scene%tips
  end subroutine tips

  subroutine sections(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%sections)) deallocate (scene%sections)
    if (present(room)) allocate (scene%sections(room))
    if (.not. allocated(scene%sections)) allocate (scene%sections(0))
    groups => scene%sections
  end subroutine sections

  subroutine lines(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%lines)) deallocate (scene%lines)
    if (present(room)) allocate (scene%lines(room))
    if (.not. allocated(scene%lines)) allocate (scene%lines(0))
    groups => scene%lines
  end subroutine lines

  subroutine j_integrals(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%j_integrals)) deallocate (scene%j_integrals)
    if (present(room)) allocate (scene%j_integrals(room))
    if (.not. allocated(scene%j_integrals)) allocate (scene%j_integrals(0))
    groups => scene%j_integrals
  end subroutine j_integrals

  subroutine studies(scene, groups, room)
    type(scene_type), intent(inout), target :: scene
    class(group_type), pointer, intent(out) :: groups(:)
    integer, intent(in), optional :: room
    if (present(room) .and. allocated(scene%studies)) deallocate (scene%studies)
    if (present(room)) allocate (scene%studies(room))
    if (.not. allocated(scene%studies)) allocate (scene%studies(0))
    groups => scene%studies
  end subroutine studies

end module pd_scene_content_groups
