!> From a scene to a system that can move: the steps of chapter 7 before the first time step.
module pd_set_up_prepare
  use pd_base_kinds, only: wp, i2, i8
  use pd_base_clock, only: phase_timer_type
  use pd_base_error, only: error_type, fail, status_input
  use pd_base_long_work, only: long_work_type
  use pd_base_text, only: to_text
  use pd_base_threads, only: team_type
  use pd_base_warnings, only: warnings_type
  use pd_comm_world, only: world_type
  use pd_body_generate, only: generate_body
  use pd_body_initial, only: initial_state
  use pd_body_regions, only: check_regions
  use pd_body_layers, only: layer_count_type, layer_count_text
  use pd_body_overlap, only: check_lattices
  use pd_body_surface_stl, only: read_stl
  use pd_body_surface_surface, only: surface_type
  use pd_body_survey, only: agree_on_error, survey_points, survey_type
  use pd_law_laws, only: law_item_type
  use pd_law_material, only: material_type
  use pd_family_crack_surface, only: cut_by_facets, points_on_facets
  use pd_family_cracks, only: cut_bonds, part_bodies
  use pd_family_warnings, only: warn_of_crack
  use pd_family_neighbours, only: check_overlap
  use pd_family_surface, only: surface_factors
  use pd_family_volume, only: volume_rule_type
  use pd_force_breaking, only: cut_followers, damage_of, find_weakest
  use pd_force_generic_bonds, only: begin_laws, refresh_bonds
  use pd_force_model, only: give_horizons, new_model
  use pd_force_terms, only: term_list_type
  use pd_motion_loads, only: add_loads_to, load_type
  use pd_motion_system, only: explain_condition, start_system, system_type
  use pd_scene_content_rules, only: place_fault, scene_fault
  use pd_scene_content_types, only: has_refinement, scene_type
  use pd_scene_format_file, only: resolve_path
  use pd_set_up_bounds, only: check_bounds
  use pd_set_up_course_warnings, only: warn_of_idle_heat
  use pd_set_up_consistent_rules, only: check_consistent, loaded_sides, &
    & prepare_surface, weigh_bonds
  use pd_set_up_conditions, only: motions_of_scene, heating_of_scene, in_no_fail_zones
  use pd_set_up_loads, only: loads_of_scene
  use pd_set_up_terms, only: add_contacts_of_scene, add_dashpots_of_scene, add_springs_of_scene, &
    & gravity_of_scene, leave_uncorrected, sides_of_contact
  use pd_set_up_families, only: axes_of_factors, choose_family, family_choice_type, make_family, &
    & finish_family
  use pd_set_up_horizons, only: check_horizons, rule_of_scene
  use pd_set_up_materials, only: materials_of_scene
  use pd_set_up_memory, only: check_memory
  use pd_set_up_ranks, only: bonds_of_ranks, broken_bonds, check_ranks, &
    & divide_survey, find_lowest, join_ranks, reproducible_layer
  use pd_set_up_plan, only: plan_type, make_plan
  use pd_set_up_substeps, only: arrange_substeps, check_step
  use pd_set_up_rigid_bodies, only: check_within, rigid_bodies_of_scene
  use pd_set_up_toughness_toughness, only: set_critical_by_lattice
  implicit none (type, external)
  private
  public :: prepare, set_up_type

  !> All work before the first step.
  type :: set_up_type
    type(system_type) :: system
    type(plan_type) :: plan
    integer(i8) :: cut = 0_i8                      !! bonds cut by cracks
    integer(i8) :: parted = 0_i8                   !! bonds left out between bodies that touch
    integer :: isolated = 0                        !! points without a bond
    type(warnings_type) :: warnings                !! found before the first step
    type(warnings_type) :: notes                   !! what is right and may surprise
    type(phase_timer_type) :: timer
    type(team_type) :: team                        !! threads; not begun: as the caller has them
  end type set_up_type

contains

  !> Points, families, corrections, cracks, conditions and the plan of a scene. With `threads` a
  !> run's team begins, with so many threads or, if that is 0, with a number that suits the body;
  !> without, threads are the caller's. `terms` of the force act in addition to those of the scene.
  !> An error is set if the scene does not fit into the memory, or if its points, families,
  !> conditions or plan are impossible.
  subroutine prepare(scene, set_up, error, threads, terms, world, quiet)
    type(scene_type), intent(in) :: scene                !! a checked scene
    type(set_up_type), intent(out) :: set_up             !! ready for the first step
    type(error_type), allocatable, intent(out) :: error
    integer, intent(in), optional :: threads
      !! number of threads, 0 for one that suits; without, the caller's are used
    type(term_list_type), intent(in), optional :: terms  !! copied; none if absent
    type(world_type), intent(inout), target, optional :: world
      !! the ranks of the run; must stay where it is in memory as long as the system; absent: one
    logical, intent(in), optional :: quiet
      !! whether nothing says what takes long; absent: nothing does
    type(load_type), allocatable :: loads(:)
    type(material_type), allocatable :: materials(:)
    type(law_item_type), allocatable :: laws(:)
    real(wp), allocatable :: temperature_change(:)
    integer(i2), allocatable :: heated_by(:)
    type(layer_count_type), allocatable :: layers(:)
    real(wp) :: delta
    type(surface_type) :: surface
    type(volume_rule_type) :: rule
    integer(i8) :: cut
    integer, allocatable :: owner(:)
    type(family_choice_type) :: choice
    type(survey_type) :: survey
    type(long_work_type) :: work
    logical :: divided, reproducible
    logical, allocatable :: loaded(:)
    integer :: i, ranks, blocks

    if (present(quiet)) call work%begin(quiet)
    ranks = 1
    if (present(world)) ranks = world%ranks
    divided = ranks > 1
    call check_memory(scene, error, ranks=ranks)
    if (.not. allocated(error) .and. divided) call check_ranks(scene, error)
    if (.not. allocated(error) .and. divided .and. present(terms)) call fail(error, &
      & 'a run on several ranks cannot have terms of the force that a program gives')
    if (allocated(error)) return
    if (present(threads)) call set_up%team%begin(threads)
    associate (system => set_up%system, timer => set_up%timer)
      call timer%start('points')
      if (divided) then
        call survey_points(scene, survey, error, world, world%rank, world%ranks)
        if (.not. allocated(error)) call check_number(scene, survey%none%order%n_global, error)
        if (allocated(error)) return
        system%body = survey%none
        delta = survey%none%delta
        layers = survey%counts
      else
        call generate_body(scene, system%body, delta, error, layers, set_up%warnings)
        if (allocated(error)) return
      end if
      if (has_refinement(scene)) call check_memory(scene, error, system%body%n_points)
      if (allocated(error)) return
      do i = 1, size(layers)
        if (layer_count_text(scene, layers(i)) /= '') call set_up%warnings%add('layer '// &
          & to_text(i), layer_count_text(scene, layers(i)), tell=.false.)
      end do
      call materials_of_scene(scene, delta, materials, laws, error)
      if (allocated(error)) return
      call timer%stop('points')
      call timer%start('lattice toughness')
      call set_critical_by_lattice(scene, system%body, delta, materials, laws, set_up%notes, work)
      call work%finish()
      call timer%stop('lattice toughness')

      call timer%start('families')
      rule = rule_of_scene(scene, system%body, delta)
      reproducible = .false.
      if (present(world)) reproducible = world%reproducible
      blocks = 1
      if (reproducible) blocks = reproducible_layer(scene%header%precision == 'mixed')
      if (divided) then
        call divide_survey(scene, rule, blocks, world, survey, system%body, owner, error)
        if (allocated(error)) return
        call check_lattices(scene, system%body, error)
        call agree_on_error(world, world%rank, error)
        if (allocated(error)) return
        call choose_family(scene, rule, system%body, laws, .true., choice, error, survey)
      else
        call choose_family(scene, rule, system%body, laws, reproducible, choice, error)
      end if
      if (allocated(error)) return
      if (reproducible .and. .not. divided) call find_lowest(system%body)
      system%body%order%reproducible = reproducible
      call make_family(scene, rule, choice, system, error)
      if (allocated(error)) return
      if (divided) call join_ranks(world, system%body, owner)
      call check_overlap(system%body, system%family, set_up%isolated, error)
      call place_fault(error, scene, 'body', 1, 'points')
      if (allocated(error)) return
      call timer%stop('families')

      call timer%start('threads')
      if (present(threads)) call set_up%team%fit(system%family%n_bonds, threads)
      if (divided) system%family%n_bonds = bonds_of_ranks(system%body, system%family)
      call timer%stop('threads')

      call timer%start('conditions')
      call check_regions(scene, system%body, error)
      if (allocated(error)) return
      call initial_state(scene, system%body, system%state%u, system%state%v, temperature_change, &
        & heated_by, error)
      if (allocated(error)) return
      call warn_of_idle_heat(scene, system%body, temperature_change, set_up%warnings)
      call new_model(system%body, materials, scene%horizon%dilatation == 'projected', &
        & in_no_fail_zones(scene, system%body), temperature_change, system%model, laws)
      if (system%model%thermal) call heating_of_scene(scene, system%body, heated_by, &
        & system%model%expansion, system%heating)
      if (system%family%rule%ratio > 0.0_wp) then
        call check_horizons(scene, system, error)
        if (allocated(error)) return
        call give_horizons(system%body, system%family%rule, system%model)
      end if
      call check_laws(scene, system, error)
      if (.not. allocated(error) .and. divided .and. system%model%generic) &
        & call scene_fault(error, scene, 'material', 1, 'model', 'a run on several ranks '// &
        & 'cannot have the bond laws of this scene, which the generic pass computes', &
        & 'on one rank it can')
      if (allocated(error)) return
      call check_consistent(scene, system, error)
      if (allocated(error)) return
      call prepare_surface(scene, materials, system%family, system%body, error)
      if (allocated(error)) return
      call motions_of_scene(scene, system%body, system%motions, error)
      if (allocated(error)) return
      call loads_of_scene(scene, system%body, system%family, loads, error)
      if (allocated(error)) return
      loaded = loaded_sides(scene, system%body, loads)
      call add_loads_to(system%terms, loads)
      call gravity_of_scene(scene, system%body, materials, loads)
      call add_loads_to(system%terms, loads)
      call add_springs_of_scene(scene, system%body, system%terms)
      call add_dashpots_of_scene(scene, system%body, materials, system%motions, system%terms)
      call add_contacts_of_scene(scene, system%body, rule, system%model%breaking, system%terms)
      if (present(terms)) call system%terms%add(terms)
      call timer%stop('conditions')

      call timer%start('surface correction')
      system%model%surface = scene%horizon%surface_correction == 'energy' .and. &
        & any([(laws(i)%law%corrected, i=1, size(laws))])
      if (system%model%surface) call axes_of_factors(scene, system, error)
      if (allocated(error)) return
      if (system%model%surface) call surface_factors(system%body, system%family, materials, &
        & system%model%D, system%model%S, laws, system%model%axes)
      if (system%model%surface) call leave_uncorrected(scene, system%motions, system%model%D, &
        & system%model%S)
      if (scene%horizon%surface_correction == 'consistent') then
        call weigh_bonds(scene, system, materials, loaded, work, error)
        call work%finish()
        if (allocated(error)) return
      end if
      call find_weakest(system%body, system%family, system%model)
      call begin_laws(system%body, system%family, system%model, system%workspace%generic)
      call finish_family(system)
      call timer%stop('surface correction')

      call timer%start('cracks')
      do i = 1, size(scene%cracks)
        if (scene%cracks(i)%surface /= '') then
          call read_stl(resolve_path(trim(scene%cracks(i)%surface), scene%file), &
            & scene%cracks(i)%scale, surface, error)
          call place_fault(error, scene, 'crack', i, 'surface')
          if (allocated(error)) return
          call cut_by_facets(surface, system%body, system%family, cut)
          ! no rank sees all points
          if (.not. divided) call warn_of_crack(i, points_on_facets(surface, system%body), &
            & system%body, set_up%warnings)
        else
          call cut_bonds(scene%cracks(i:i), system%body, system%family, cut)
        end if
        if (divided) cut = broken_bonds(system%body, system%family) - set_up%cut
        if (cut == 0_i8) call set_up%warnings%add('idle crack '//to_text(i), '&crack number '// &
          & to_text(i)//' cuts no bond, or only bonds that another crack has cut', tell=.false.)
        set_up%cut = set_up%cut + cut
      end do
      do i = 1, size(scene%contacts)
        call part_bodies(sides_of_contact(scene, i), system%body, system%family, cut)
        if (divided) cut = broken_bonds(system%body, system%family) - set_up%cut - set_up%parted
        set_up%parted = set_up%parted + cut
        if (cut > 0_i8) call set_up%notes%add('parted '//to_text(i), '&contact number '// &
          & to_text(i)//' leaves out '//to_text(cut)//' bonds between bodies that touch', &
          & tell=.false.)
      end do
      call cut_followers(system%body, system%family, system%model, cut)
      set_up%cut = set_up%cut + cut
      if (set_up%cut + set_up%parted > 0_i8) then
        call refresh_bonds(system%family, system%workspace%generic)
        allocate (system%state%damage(system%body%n_slots), source=0.0_wp)
        call damage_of(system%body, system%family, system%state%damage)
      end if
      call timer%stop('cracks')

      call timer%start('time step')
      system%break_late = scene%time%breaking == 'after_forces'
      call rigid_bodies_of_scene(scene, system, error)
      if (allocated(error)) return
      call arrange_substeps(scene, system, error)
      if (allocated(error)) return
      call start_system(system)
      if (allocated(system%fault)) then
        call explain_condition(system, status_input, error)
        call place_fault(error, scene, 'scene', 1, '')
        return
      end if
      call check_within(scene, system, error)
      if (allocated(error)) return
      call make_plan(scene, system, set_up%plan, error)
      if (.not. allocated(error)) call check_step(scene, set_up%plan%step, set_up%plan%limit, error)
      if (allocated(error)) return
      call check_bounds(scene, system, set_up%plan, error)
      if (allocated(error)) return
      call timer%stop('time step')
    end associate
  end subroutine prepare

  !> An error is set if ranks have more points together than the first one can write.
  subroutine check_number(scene, points, error)
    type(scene_type), intent(in) :: scene
    integer(i8), intent(in) :: points  !! of all ranks
    type(error_type), allocatable, intent(out) :: error

    if (points <= huge(0)) return
    call scene_fault(error, scene, 'body', 1, 'points', 'the scene has '//to_text(points)// &
      & ' points; results can have at most '//to_text(huge(0)), &
      & 'the first rank, which writes them, numbers them with 32 bits')
  end subroutine check_number

  !> An error is set if the generic pass cannot serve what a scene asks for.
  subroutine check_laws(scene, system, error)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system  !! with its model
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: why
    integer :: i

    if (.not. (system%model%generic .or. system%model%weighted)) return
    if (scene%time%method == 'relaxation' .and. &
      & scene%relaxation%density_matrix /= 'frame_invariant') then
      call scene_fault(error, scene, 'relaxation', 1, 'density_matrix', "density_matrix = '"// &
        & trim(scene%relaxation%density_matrix)//"' holds for the chapter's laws with "// &
        & "influence = 'inverse'", "this scene has another law: use 'frame_invariant'")
      return
    end if
    if (.not. system%model%generic) return
    why = 'its bond laws are computed on the generic pass, in double precision'
    if (scene%header%precision == 'mixed') then
      call scene_fault(error, scene, 'scene', 1, 'precision', &
        & "the scene cannot have precision = 'mixed'", why)
    else if (scene%time%method == 'explicit' .and. scene%time%limit == 'spectral') then
      call scene_fault(error, scene, 'time', 1, 'limit', &
        & "the scene cannot have limit = 'spectral'", 'its bond laws may change their '// &
        & "stiffness: use limit = 'equation'")
    end if
    if (allocated(error)) return
    do i = 1, size(system%model%laws)
      associate (law => system%model%laws(i)%law)
        if (law%bond_history + law%point_history == 0) cycle
        if (allocated(system%heating%curves)) call scene_fault(error, scene, 'material', i, &
          & 'model', "model = '"//trim(scene%materials(i)%model)//"' cannot have a temperature "// &
          & 'that varies in time, or grows over load steps', &
          & 'the work of heat is known for laws without a history only')
        if (allocated(error)) return
        if (size(scene%no_fail) == 0 .or. .not. law%softens) cycle
      end associate
      call scene_fault(error, scene, 'no_fail', 1, '', "bonds with model = '"// &
        & trim(scene%materials(i)%model)//"' cannot have zones in which they do not fail", &
        & 'they soften before they break: give what must hold a material with another law')
      return
    end do
  end subroutine check_laws

end module pd_set_up_prepare
