!> From a scene to its results, in the steps of chapter 7: points, families, cracks, surface
!> correction, initial and boundary conditions, time step or mass, integration.
module pd_driver
  use, intrinsic :: iso_fortran_env, only: output_unit
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_kinds, only: wp, i2, i8
  use pd_base_clock, only: phase_timer_type
  use pd_base_error, only: error_type, internal_fault, status_input, status_interrupted
  use pd_base_interrupt, only: let_writes_fail, watch_for_interrupt
  use pd_base_threads, only: is_worth_threads, team_type
  use pd_base_warnings, only: warnings_type
  use pd_base_text, only: newline, printable, to_text
  use pd_scene_rules, only: place_fault, scene_fault
  use pd_scene_types, only: scene_type, is_set, material_group
  use pd_scene_write, only: scene_text
  use pd_body_body, only: body_type
  use pd_body_generate, only: generate_body, touch
  use pd_body_initial, only: initial_state
  use pd_body_layers, only: layer_count_type, layer_count_text
  use pd_body_memory, only: any_critical, check_memory
  use pd_body_material, only: material_type, new_material, critical_stretch_from_energy
  use pd_family_cracks, only: cut_bonds
  use pd_family_lattice, only: lattice_family_type, lattice_suits, new_lattice_family
  use pd_family_list, only: list_family_type, new_list_family
  use pd_family_neighbours, only: check_overlap
  use pd_family_surface, only: surface_factors
  use pd_family_volume, only: volume_rule_type, volume_rule_number
  use pd_force_breaking, only: damage_of
  use pd_force_model, only: new_model
  use pd_force_list, only: prepare_list
  use pd_force_weights, only: build_weights
  use pd_motion_bounds, only: check_bounds
  use pd_motion_explicit, only: run_explicit, begin_steps => begin_memory
  use pd_motion_from_scene, only: motions_of_scene, loads_of_scene, heating_of_scene, &
    & in_no_fail_zones
  use pd_motion_keep, only: checksum_of_start
  use pd_motion_plan, only: plan_type, make_plan, depth_of
  use pd_motion_relaxation, only: run_relaxation, fill_memory
  use pd_motion_system, only: system_type, start_system, account
  use pd_output_begin, only: run_options_type, open_recorder, keep_checkpoints, schedule_of, &
    & check_schedule, history_interval, output_directory, stem_of, command_of, text_of
  use pd_output_checkpoint, only: about_type, checkpoint_bytes, new_about
  use pd_output_earlier, only: mark_complete, refuse_existing
  use pd_output_estimate, only: estimate
  use pd_output_overview, only: overview
  use pd_output_recorder, only: recorder_type, probe_type, field_of, history_columns, &
    & planned_outputs, planned_rows, schedule_type
  use pd_output_restart, only: find_restart, put_back, restart_type
  use pd_output_summary, only: checkpoint_line, summary_before, summary_after
  use pd_output_warnings, only: note_before, warn_before
  implicit none (type, external)
  private
  public :: run_scene, check_scene, run_options_type, prepare, set_up_type, choose_threads, &
    & check_memory, output_directory, history_interval

  real(wp), parameter :: doubtful_balance = 0.1_wp      !! of the energy in play
  real(wp), parameter :: doubtful_dissipation = 0.05_wp !! of the dissipated energy

  !> Everything that stands before the first step.
  type :: set_up_type
    type(system_type) :: system
    type(plan_type) :: plan
    type(probe_type), allocatable :: probes(:)
    integer(i8) :: cut = 0_i8                      !! bonds cut by cracks
    type(warnings_type) :: warnings                !! found before the first step
    type(warnings_type) :: notes                   !! what is right and may surprise
    type(phase_timer_type) :: timer
    type(team_type) :: team                        !! threads; not begun: as the caller has them
  end type set_up_type

contains

  !> Compute a scene and write its results. The caller's number of threads is as it was thereafter.
  subroutine run_scene(scene, options, error)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options    !! how, where to, with how many threads
    type(error_type), allocatable, intent(out) :: error
    integer :: threads

    threads = omp_get_max_threads()
    call compute(scene, options, error)
    call omp_set_num_threads(threads)
  end subroutine run_scene

  !> Read, validate, build points and families, and say what a run would do, without running. The
  !> caller's number of threads is as it was thereafter.
  subroutine check_scene(scene, options, error)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options    !! with how many threads
    type(error_type), allocatable, intent(out) :: error
    integer :: threads

    threads = omp_get_max_threads()
    call examine(scene, options, error)
    call omp_set_num_threads(threads)
  end subroutine check_scene

  !> `run_scene` with threads of its own number.
  subroutine compute(scene, options, error)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(restart_type) :: restart
    type(recorder_type) :: recorder
    type(error_type), allocatable :: late
    character(:), allocatable :: directory, stem
    integer(i8) :: start
    logical :: stopped
    real(wp) :: balance, share

    call let_writes_fail()
    stem = stem_of(scene)
    directory = output_directory(scene, options)
    if (options%restart) then
      call find_restart(directory, stem, text_of(options%checkpoint), scene, &
        & command_of(options), restart, error)
      if (allocated(error)) return
      call say(options, restart%note)
      if (restart%complete) return
    else
      call refuse_existing(directory, stem, options%overwrite, error)
      if (allocated(error)) return
    end if
    call prepare(scene, set_up, error, options%threads)
    if (allocated(error)) return
    associate (system => set_up%system, plan => set_up%plan)
      start = checksum_of_start(system)
      if (restart%found) call put_back(restart, scene, system, plan, error)
      if (allocated(error)) return
      if (restart%complete) then
        call say(options, '  complete        the run has as many steps already')
        return
      end if
      call say(options, summary_before(scene, system, plan, set_up%probes, set_up%cut, &
        & set_up%warnings, set_up%notes, set_up%team%threads()))
      recorder%timer = set_up%timer
      recorder%team = set_up%team
      recorder%probes = set_up%probes
      recorder%warnings = set_up%warnings
      call open_recorder(scene, options, system, plan, directory, stem, restart, recorder, error)
      if (allocated(error)) return
      call keep_checkpoints(scene, options, plan, start, directory, stem, restart, recorder)
      call watch_for_interrupt()
      system%stable_step = plan%limit
      call recorder%timer%start('time stepping')
      if (plan%relaxes) then
        call run_relaxation(system, plan%relaxation, recorder, error)
      else
        call run_explicit(system, plan%integrator, plan%step, plan%steps, recorder, error)
      end if
      if (allocated(error)) then
        ! what the motion finds wrong with the input, it finds before the first iteration
        if (error%status == status_input .and. recorder%rows == 0) &
          & call place_fault(error, scene, 'time', 1, 'method')
        if (allocated(recorder%rescued)) error%message = error%message//newline//'  '// &
          & recorder%rescued
      end if
      call recorder%timer%stop('time stepping')
      call recorder%progress%finish()
      call recorder%energy_balance(system, balance, share)
      if (.not. allocated(error)) call warn_of_balance(system, recorder, balance, share)
      call recorder%results%put_warnings(recorder%warnings%text())
      stopped = .false.
      if (allocated(error)) stopped = error%status == status_interrupted
      call recorder%results%close(late, stopped, keep_mark=.true.)
      if (.not. allocated(error) .and. allocated(late)) call move_alloc(late, error)
      if (allocated(error)) return
      ! the end is kept when the results are complete, and then the mark of unfinished ones goes
      system%memory%step = recorder%steps_done
      if (recorder%checkpoint%keeps_end()) call recorder%keep_state(system, finished=.true.)
      call mark_complete(directory, stem)
      call say(options, summary_after(system, recorder, directory))
    end associate
  end subroutine compute

  !> Warn if energy was gained or lost that nothing explains: much of what is in play, or, where
  !> bonds have broken, much of what they dissipated.
  subroutine warn_of_balance(system, recorder, balance, share)
    type(system_type), intent(in) :: system
    type(recorder_type), intent(inout) :: recorder
    real(wp), intent(in) :: balance  !! energy that nothing explains [J]
    real(wp), intent(in) :: share    !! its size over the energy in play [-], < 0 without a balance

    if (share > doubtful_balance) then
      call recorder%warn('balance', 'the energy balance is off by '//to_text(100*share, 2)// &
        & ' % of the energy: the answer is not reliable; a smaller step may help')
    else if (share >= 0.0_wp .and. abs(system%dissipated) > 0.0_wp .and. &
      & abs(balance) > doubtful_dissipation*abs(system%dissipated)) then
      call recorder%warn('dissipation', 'the energy balance is off by '// &
        & to_text(100*abs(balance/system%dissipated), 2)// &
        & ' % of the dissipated energy, which is known no better; a smaller step helps')
    end if
  end subroutine warn_of_balance

  !> `check_scene` with threads of its own number.
  subroutine examine(scene, options, error)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    character(:), allocatable :: text

    call prepare(scene, set_up, error, options%threads)
    if (allocated(error)) return
    associate (system => set_up%system, plan => set_up%plan)
      call say(options, summary_before(scene, system, plan, set_up%probes, set_up%cut, &
        & set_up%warnings, set_up%notes, set_up%team%threads()))
      call say_lines(overview(scene, system, .not. plan%relaxes))
      call estimate(scene, system, plan, schedule_of(scene, plan, system%family%n_bonds), &
        & set_up%timer%total(), text)
      call say_lines(text)
      call say(options, checkpoint_line(scene, bytes_of_checkpoint(scene, set_up)))
    end associate

  contains

    !> Print lines that end with a newline.
    subroutine say_lines(lines)
      character(*), intent(in) :: lines
      if (len(lines) > 0) call say(options, lines(:len(lines) - 1))
    end subroutine say_lines
  end subroutine examine

  !> Bytes of the last checkpoint of a run, which has all that it carries, or of a relaxation's
  !> largest.
  integer(i8) function bytes_of_checkpoint(scene, set_up) result(bytes)
    type(scene_type), intent(in) :: scene
    type(set_up_type), intent(inout) :: set_up
    type(about_type) :: about
    type(schedule_type) :: schedule
    integer :: columns

    associate (system => set_up%system, plan => set_up%plan)
      schedule = schedule_of(scene, plan, system%family%n_bonds)
      about = new_about(scene_text(scene), 0_i8, plan%steps, plan%step)
      columns = size(history_columns(system, set_up%probes, plan%relaxes))
      allocate (about%kept%rows(columns, 0), about%kept%times(0))
      call account(system, 0.0_wp)
      if (plan%relaxes) then
        call fill_memory(system, plan%relaxation)
      else
        call begin_steps(system, plan%integrator)
      end if
      ! rows and times are counted and not made: a long run may have more than fit into the memory
      bytes = checkpoint_bytes(about, system) + 8*(int(columns, i8)*planned_rows(schedule) &
        & + planned_outputs(schedule, plan%step))
    end associate
  end function bytes_of_checkpoint

  !> Points, families, corrections, cracks, conditions and the plan of a scene. With `threads` a
  !> run's team begins, with so many threads or, if that is 0, with a number that suits the body;
  !> without, threads are the caller's.
  subroutine prepare(scene, set_up, error, threads)
    type(scene_type), intent(in) :: scene
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(out) :: error
    integer, intent(in), optional :: threads
    type(material_type), allocatable :: materials(:)
    real(wp), allocatable :: temperature_change(:)
    integer(i2), allocatable :: heated_by(:)
    type(layer_count_type), allocatable :: layers(:)
    real(wp) :: delta
    integer(i8) :: cut
    integer :: isolated, i

    call check_memory(scene, error)
    if (allocated(error)) return
    if (present(threads)) call set_up%team%begin(threads)
    associate (system => set_up%system, timer => set_up%timer)
      call timer%start('points')
      call generate_body(scene, system%body, delta, error, layers)
      if (allocated(error)) return
      do i = 1, size(layers)
        if (layer_count_text(scene, layers(i)) /= '') call set_up%warnings%add('layer '// &
          & to_text(i), layer_count_text(scene, layers(i)), tell=.false.)
      end do
      materials = materials_of_scene(scene, delta)
      call timer%stop('points')

      call timer%start('families')
      call make_family(scene, volume_rule_type(volume_rule_number( &
        & trim(scene%horizon%volume_correction)), delta), system, error)
      if (allocated(error)) return
      call check_overlap(system%body, system%family, isolated, error)
      call place_fault(error, scene, 'body', 1, 'points')
      if (allocated(error)) return
      call timer%stop('families')

      call timer%start('threads')
      if (present(threads)) call set_up%team%fit(system%family%n_bonds, threads)
      call timer%stop('threads')

      call timer%start('conditions')
      call initial_state(scene, system%body, system%state%u, system%state%v, temperature_change, &
        & heated_by, error)
      if (allocated(error)) return
      call new_model(system%body, materials, scene%horizon%dilatation == 'projected', &
        & in_no_fail_zones(scene, system%body), temperature_change, system%model)
      if (system%model%thermal) call heating_of_scene(scene, heated_by, system%model%expansion, &
        & system%heating)
      call motions_of_scene(scene, system%body, system%motions, error)
      if (allocated(error)) return
      call loads_of_scene(scene, system%body, system%loads, error)
      if (allocated(error)) return
      call timer%stop('conditions')

      call timer%start('surface correction')
      system%model%surface = scene%horizon%surface_correction == 'energy'
      if (system%model%surface) call surface_factors(system%body, system%family, materials, &
        & system%model%D, system%model%S)
      call finish_family(system)
      call timer%stop('surface correction')

      call timer%start('cracks')
      do i = 1, size(scene%cracks)
        call cut_bonds(scene%cracks(i:i), system%body, system%family, cut)
        if (cut == 0_i8) call set_up%warnings%add('idle crack '//to_text(i), '&crack number '// &
          & to_text(i)//' cuts no bond, or none that another has not cut', tell=.false.)
        set_up%cut = set_up%cut + cut
      end do
      if (set_up%cut > 0_i8) then
        allocate (system%state%damage(system%body%n_slots), source=0.0_wp)
        call damage_of(system%body, system%family, system%state%damage)
      end if
      call timer%stop('cracks')

      call timer%start('time step')
      system%break_late = scene%time%breaking == 'after_forces'
      call start_system(system)
      call make_plan(scene, system, set_up%plan, error)
      if (allocated(error)) return
      call check_bounds(scene, system, set_up%plan, error)
      if (allocated(error)) return
      call check_schedule(scene, set_up%plan, system%family%n_bonds, error)
      if (allocated(error)) return
      call timer%stop('time step')
      call find_probes(scene, system%body, set_up%probes)
      call warn_before(scene, system, set_up%plan, set_up%probes, isolated, set_up%warnings)
      call note_before(scene, system, set_up%notes)
    end associate
  end subroutine prepare

  !> Families of the kind that suits the points; the body is arranged in their slots.
  subroutine make_family(scene, rule, system, error)
    type(scene_type), intent(in) :: scene
    type(volume_rule_type), intent(in) :: rule
    type(system_type), intent(inout) :: system
    type(error_type), allocatable, intent(out) :: error
    type(lattice_family_type), allocatable :: lattice
    type(list_family_type), allocatable :: list
    character(:), allocatable :: reason
    logical :: suits, mixed

    if (scene%horizon%family == 'list') then
      suits = .false.
      reason = 'asked for'
    else
      call lattice_suits(system%body, rule, suits, reason)
    end if
    if (scene%horizon%family == 'lattice' .and. .not. suits) then
      call scene_fault(error, scene, 'horizon', 1, 'family', &
        & 'the scene cannot have lattice families, which &horizon family asks for', reason)
      return
    end if
    mixed = scene%header%precision == 'mixed'
    if (mixed .and. .not. suits) then
      call scene_fault(error, scene, 'scene', 1, 'precision', &
        & "precision = 'mixed' needs lattice families, but the scene gets lists", reason)
      return
    end if
    if (suits) then
      allocate (lattice)
      call new_lattice_family(system%body, rule, size(scene%cracks) > 0 .or. any_critical(scene), &
        & mixed, lattice, error)
      call place_fault(error, scene, 'body', 1, 'points')
      if (allocated(error)) return
      call move_alloc(lattice, system%family)
    else
      allocate (list)
      call new_list_family(system%body, rule, list)
      list%reason = reason
      call move_alloc(list, system%family)
    end if
  end subroutine make_family

  !> What a family keeps of the model: the weights of its bonds.
  subroutine finish_family(system)
    type(system_type), intent(inout) :: system
    select type (family => system%family)
    type is (lattice_family_type)
      call build_weights(family, system%model)
    type is (list_family_type)
      call prepare_list(family, system%model)
    class default
      call internal_fault('finish_family does not know a kind of family')
    end select
  end subroutine finish_family

  !> The materials with the horizon's parameters.
  pure function materials_of_scene(scene, delta) result(materials)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: delta
    type(material_type), allocatable :: materials(:)
    logical :: plane_strain
    integer :: i

    plane_strain = scene%header%dimension == 2 .and. scene%header%plane == 'strain'
    allocate (materials(size(scene%materials)))
    do i = 1, size(materials)
      associate (group => scene%materials(i), m => materials(i))
        m = new_material(group%youngs_modulus, group%poissons_ratio, group%density, &
          & scene%header%dimension, plane_strain, scene%header%thickness, scene%header%area, &
          & delta, group%model == 'bond_based')
        if (is_set(group%critical_stretch)) m%critical_stretch = group%critical_stretch
        if (is_set(group%critical_energy_release_rate)) m%critical_stretch = &
          & critical_stretch_from_energy(m, group%critical_energy_release_rate, &
          & scene%header%dimension, delta)
        m%break_in_compression = group%break_in_compression
        m%expansion = group%thermal_expansion
        if (plane_strain) m%expansion = (1 + m%poissons_ratio)*m%expansion
      end associate
    end do
  end function materials_of_scene

  !> The nearest point of each probe; ties go to the lowest point number.
  subroutine find_probes(scene, body, probes)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    type(probe_type), allocatable, intent(out) :: probes(:)
    real(wp) :: distance, least
    integer :: p, i, f

    allocate (probes(size(scene%probes)))
    do p = 1, size(probes)
      probes(p)%name = trim(scene%probes(p)%name)
      least = huge(least)
      do i = 1, body%n_points
        distance = norm2(body%x(body%slot(i), :) - scene%probes(p)%point(:body%dim))
        ! a hair's breadth nearer is no nearer: ties must not depend on rounding
        if (distance >= least - touch*body%spacing(body%slot(i))) cycle
        least = distance
        probes(p)%slot = body%slot(i)
      end do
      allocate (probes(p)%fields(size(scene%probes(p)%fields)))
      do f = 1, size(probes(p)%fields)
        probes(p)%fields(f) = field_of(trim(scene%probes(p)%fields(f)))
      end do
    end do
  end subroutine find_probes

  !> Use one thread for a body whose step is over before another thread has woken, unless the user
  !> has asked for a number.
  subroutine choose_threads(options, system)
    type(run_options_type), intent(in) :: options
    type(system_type), intent(in) :: system
    if (options%threads == 0 .and. .not. is_worth_threads(system%family%n_bonds)) &
      & call omp_set_num_threads(1)
  end subroutine choose_threads

  subroutine say(options, text)
    type(run_options_type), intent(in) :: options
    character(*), intent(in) :: text
    if (.not. options%quiet) write (output_unit, '(a)') printable(text)
  end subroutine say

end module pd_driver
