!> Runs the tests: all of them, one suite, or one test.
!>
!>     perifort-test [--short] [--except=SUITE,SUITE] [--share=FOLDER] [SUITE [TEST]]
!>
!> `--short` leaves out the tests whose name begins with `long`, `--except` whole suites. With
!> `--share` several of these programs divide the suites among them: each takes the next one of
!> which FOLDER has no file yet, and makes that file. The last line is always `N passed, N failed`;
!> the exit status is 1 if a test failed, 2 if there is no such test or suite.
program main
  use, intrinsic :: iso_fortran_env, only: output_unit, int64, real64
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use testdrive, only: collect_interface, new_testsuite, run_selected, select_suite, &
    & testsuite_type, unittest_type
  use test_base_clock, only: collect_base_clock
  use test_base_checksum, only: collect_base_checksum
  use test_base_expression, only: collect_base_expression
  use test_base_interrupt, only: collect_base_interrupt
  use test_base_long_work, only: collect_base_long_work
  use test_base_lookup, only: collect_base_lookup
  use test_base_shares, only: collect_base_shares
  use test_base_text, only: collect_base_text
  use test_base_threads, only: collect_base_threads
  use test_base_version, only: collect_base_version
  use test_body_shapes, only: collect_body_shapes
  use test_body_refine, only: collect_body_refine
  use test_body_turned, only: collect_body_turned
  use test_body_division, only: collect_body_division
  use test_body_generate, only: collect_body_generate
  use test_body_layers, only: collect_body_layers
  use test_law_contract, only: collect_law_contract
  use test_law_material, only: collect_law_material
  use test_law_softening, only: collect_law_softening
  use test_law_strength, only: collect_law_strength
  use test_law_plastic, only: collect_law_plastic
  use test_law_plastic_large, only: collect_law_plastic_large
  use test_body_mesh_elements, only: collect_body_mesh_elements
  use test_body_mesh_inside, only: collect_body_mesh_inside
  use test_body_mesh_part, only: collect_body_mesh_part
  use test_body_mesh_read, only: collect_body_mesh_read
  use test_body_meshes, only: collect_body_meshes
  use test_body_overlap, only: collect_body_overlap
  use test_body_surfaces, only: collect_body_surfaces
  use test_body_waves, only: collect_body_waves
  use test_body_windows, only: collect_body_windows
  use test_body_work, only: collect_body_work
  use test_command_line, only: collect_command_line
  use test_driver, only: collect_driver
  use test_extremes_contrast, only: collect_extremes_contrast
  use test_extremes_geometry, only: collect_extremes_geometry
  use test_extremes_materials, only: collect_extremes_materials
  use test_extremes_motion, only: collect_extremes_motion
  use test_extremes_steps, only: collect_extremes_steps
  use test_family_cells, only: collect_family_cells
  use test_family_composite, only: collect_family_composite
  use test_family_cracks, only: collect_family_cracks
  use test_family_joints, only: collect_family_joints
  use test_family_lattice, only: collect_family_lattice
  use test_family_slabs, only: collect_family_slabs
  use test_family_surface, only: collect_family_surface
  use test_family_volume, only: collect_family_volume
  use test_force_breaking, only: collect_force_breaking
  use test_force_contact, only: collect_force_contact
  use test_force_closed, only: collect_force_closed
  use test_force_normals, only: collect_force_normals
  use test_force_rigid, only: collect_force_rigid
  use test_force_search, only: collect_force_search
  use test_force_contract, only: collect_force_contract
  use test_force_frame, only: collect_force_frame
  use test_force_term, only: collect_force_term
  use test_force_term_static, only: collect_force_term_static
  use test_library, only: collect_library
  use test_own_law, only: collect_own_law
  use test_motion_conditions, only: collect_motion_conditions
  use test_motion_static_conjugate_gradient, only: collect_motion_static_conjugate_gradient
  use test_motion_dissipation, only: collect_motion_dissipation
  use test_motion_explicit_integrators, only: collect_motion_explicit_integrators
  use test_motion_equilibrium, only: collect_motion_equilibrium
  use test_motion_heating, only: collect_motion_heating
  use test_motion_newton, only: collect_motion_newton
  use test_motion_coarse, only: collect_motion_coarse
  use test_motion_pins, only: collect_motion_pins
  use test_motion_plastic, only: collect_motion_plastic
  use test_motion_substeps, only: collect_motion_substeps
  use test_motion_reactions, only: collect_motion_reactions
  use test_motion_static_events, only: collect_motion_static_events
  use test_motion_static_relaxation, only: collect_motion_static_relaxation
  use test_motion_explicit_spectrum, only: collect_motion_explicit_spectrum
  use test_motion_system, only: collect_motion_system
  use test_motion_tangent, only: collect_motion_tangent
  use test_motion_explicit_time_step, only: collect_motion_explicit_time_step
  use test_orders, only: collect_orders
  use test_output_fields_between, only: collect_output_fields_between
  use test_output_fields_interpolate, only: collect_output_fields_interpolate
  use test_output_fields_stress, only: collect_output_fields_stress
  use test_output_fields_table, only: collect_output_fields_table
  use test_output_measures_boundary, only: collect_output_measures_boundary
  use test_output_measures_fragments, only: collect_output_measures_fragments
  use test_output_measures_tip, only: collect_output_measures_tip
  use test_output_report_rigid_surfaces, only: collect_output_report_rigid_surfaces
  use test_output_report_schedule, only: collect_output_report_schedule
  use test_output_results_cells, only: collect_output_results_cells
  use test_output_results_base64, only: collect_output_results_base64
  use test_output_checkpoint_checkpoint, only: collect_output_checkpoint_checkpoint
  use test_output_measures_j_integral, only: collect_output_measures_j_integral
  use test_output_measures_section, only: collect_output_measures_section
  use test_output_report_contact, only: collect_output_report_contact
  use test_output_results_files, only: collect_output_results_files
  use test_output_results_layout, only: collect_output_results_layout
  use test_output_report_overview, only: collect_output_report_overview
  use test_output_checkpoint_merger, only: collect_output_checkpoint_merger
  use test_output_checkpoint_parts, only: collect_output_checkpoint_parts
  use test_output_checkpoint_restart, only: collect_output_checkpoint_restart
  use test_output_checkpoint_static, only: collect_output_checkpoint_static
  use test_output_results_results, only: collect_output_results_results
  use test_output_results_xdmf, only: collect_output_results_xdmf
  use test_ranks, only: collect_ranks
  use test_scene_content_change, only: collect_scene_content_change
  use test_scene_content_check, only: collect_scene_content_check
  use test_scene_hostile, only: collect_scene_hostile
  use test_motion_energy_watch, only: collect_motion_energy_watch
  use test_scene_content_compare, only: collect_scene_content_compare
  use test_scene_content_defaults, only: collect_scene_content_defaults
  use test_scene_content_expressions, only: collect_scene_content_expressions
  use test_motion_expressions, only: collect_motion_expressions
  use test_scene_content_groups, only: collect_scene_content_groups
  use test_scene_format_elements, only: collect_scene_format_elements
  use test_scene_format_file, only: collect_scene_format_file
  use test_scene_content_read, only: collect_scene_content_read
  use test_scene_content_reference, only: collect_scene_content_reference
  use test_scene_format_source, only: collect_scene_format_source
  use test_scene_format_pieces, only: collect_scene_format_pieces
  use test_scene_format_table, only: collect_scene_format_table
  use test_scene_content_template, only: collect_scene_content_template
  use test_scene_format_values, only: collect_scene_format_values
  use test_scene_content_write, only: collect_scene_content_write
  use test_softening_cracks, only: collect_softening_cracks
  use test_study_bench_bench, only: collect_study_bench_bench
  use test_set_up_consistent_envelope, only: collect_set_up_consistent_envelope
  use test_set_up_consistent_symmetries, only: collect_set_up_consistent_symmetries
  use test_set_up_consistent_weights, only: collect_set_up_consistent_weights
  use test_set_up_ranks, only: collect_set_up_ranks
  use test_set_up_horizons, only: collect_set_up_horizons
  use test_set_up_toughness, only: collect_set_up_toughness
  use test_set_up_terms, only: collect_set_up_terms
  use test_study_limits_limits, only: collect_study_limits_limits
  use test_study_trade_closed_form, only: collect_study_trade_closed_form
  use test_study_trade_plan, only: collect_study_trade_plan
  use test_study_trade_predict, only: collect_study_trade_predict
  use test_study_trade_study, only: collect_study_trade_study
  use test_warnings, only: collect_warnings
  implicit none (type, external)

  type(testsuite_type) :: suites(200)
  integer :: known = 0, passed = 0, failed = 0, skipped = 0
  integer :: i
  logical :: short, left_out(200) = .false.
  character(:), allocatable :: suite_name, test_name, except, share

  ! those that take the longest begin first, for programs that share the suites
  call register('output_checkpoint_static', collect_output_checkpoint_static)
  call register('base_clock', collect_base_clock)
  call register('base_checksum', collect_base_checksum)
  call register('base_expression', collect_base_expression)
  call register('base_interrupt', collect_base_interrupt)
  call register('base_long_work', collect_base_long_work)
  call register('base_lookup', collect_base_lookup)
  call register('base_shares', collect_base_shares)
  call register('base_text', collect_base_text)
  call register('base_threads', collect_base_threads)
  call register('base_version', collect_base_version)
  call register('body_shapes', collect_body_shapes)
  call register('body_refine', collect_body_refine)
  call register('body_turned', collect_body_turned)
  call register('body_division', collect_body_division)
  call register('body_windows', collect_body_windows)
  call register('body_work', collect_body_work)
  call register('body_generate', collect_body_generate)
  call register('body_layers', collect_body_layers)
  call register('law_contract', collect_law_contract)
  call register('law_material', collect_law_material)
  call register('law_softening', collect_law_softening)
  call register('law_strength', collect_law_strength)
  call register('law_plastic', collect_law_plastic)
  call register('law_plastic_large', collect_law_plastic_large)
  call register('body_mesh_elements', collect_body_mesh_elements)
  call register('body_mesh_inside', collect_body_mesh_inside)
  call register('body_mesh_part', collect_body_mesh_part)
  call register('body_mesh_read', collect_body_mesh_read)
  call register('body_meshes', collect_body_meshes)
  call register('body_surfaces', collect_body_surfaces)
  call register('body_overlap', collect_body_overlap)
  call register('body_waves', collect_body_waves)
  call register('command_line', collect_command_line)
  call register('driver', collect_driver)
  call register('extremes_contrast', collect_extremes_contrast)
  call register('extremes_geometry', collect_extremes_geometry)
  call register('extremes_materials', collect_extremes_materials)
  call register('extremes_motion', collect_extremes_motion)
  call register('extremes_steps', collect_extremes_steps)
  call register('family_cells', collect_family_cells)
  call register('family_composite', collect_family_composite)
  call register('family_cracks', collect_family_cracks)
  call register('family_joints', collect_family_joints)
  call register('family_lattice', collect_family_lattice)
  call register('family_slabs', collect_family_slabs)
  call register('family_surface', collect_family_surface)
  call register('family_volume', collect_family_volume)
  call register('force_breaking', collect_force_breaking)
  call register('force_contact', collect_force_contact)
  call register('force_closed', collect_force_closed)
  call register('force_normals', collect_force_normals)
  call register('force_rigid', collect_force_rigid)
  call register('force_search', collect_force_search)
  call register('force_contract', collect_force_contract)
  call register('force_frame', collect_force_frame)
  call register('force_term', collect_force_term)
  call register('force_term_static', collect_force_term_static)
  call register('library', collect_library)
  call register('own_law', collect_own_law)
  call register('motion_conditions', collect_motion_conditions)
  call register('motion_static_conjugate_gradient', collect_motion_static_conjugate_gradient)
  call register('motion_dissipation', collect_motion_dissipation)
  call register('motion_explicit_integrators', collect_motion_explicit_integrators)
  call register('motion_equilibrium', collect_motion_equilibrium)
  call register('motion_heating', collect_motion_heating)
  call register('motion_newton', collect_motion_newton)
  call register('motion_coarse', collect_motion_coarse)
  call register('motion_pins', collect_motion_pins)
  call register('motion_plastic', collect_motion_plastic)
  call register('motion_substeps', collect_motion_substeps)
  call register('motion_reactions', collect_motion_reactions)
  call register('motion_static_events', collect_motion_static_events)
  call register('motion_static_relaxation', collect_motion_static_relaxation)
  call register('motion_explicit_spectrum', collect_motion_explicit_spectrum)
  call register('motion_system', collect_motion_system)
  call register('motion_tangent', collect_motion_tangent)
  call register('motion_explicit_time_step', collect_motion_explicit_time_step)
  call register('orders', collect_orders)
  call register('output_fields_between', collect_output_fields_between)
  call register('output_fields_interpolate', collect_output_fields_interpolate)
  call register('output_fields_stress', collect_output_fields_stress)
  call register('output_fields_table', collect_output_fields_table)
  call register('output_results_cells', collect_output_results_cells)
  call register('output_results_base64', collect_output_results_base64)
  call register('output_checkpoint_checkpoint', collect_output_checkpoint_checkpoint)
  call register('output_measures_boundary', collect_output_measures_boundary)
  call register('output_measures_fragments', collect_output_measures_fragments)
  call register('output_measures_tip', collect_output_measures_tip)
  call register('output_measures_j_integral', collect_output_measures_j_integral)
  call register('output_measures_section', collect_output_measures_section)
  call register('output_report_contact', collect_output_report_contact)
  call register('output_report_rigid_surfaces', collect_output_report_rigid_surfaces)
  call register('output_report_schedule', collect_output_report_schedule)
  call register('output_results_files', collect_output_results_files)
  call register('output_results_layout', collect_output_results_layout)
  call register('output_report_overview', collect_output_report_overview)
  call register('output_checkpoint_restart', collect_output_checkpoint_restart)
  call register('output_checkpoint_merger', collect_output_checkpoint_merger)
  call register('output_checkpoint_parts', collect_output_checkpoint_parts)
  call register('output_results_results', collect_output_results_results)
  call register('output_results_xdmf', collect_output_results_xdmf)
  call register('ranks', collect_ranks)
  call register('scene_content_change', collect_scene_content_change)
  call register('scene_content_check', collect_scene_content_check)
  call register('scene_hostile', collect_scene_hostile)
  call register('motion_energy_watch', collect_motion_energy_watch)
  call register('scene_content_compare', collect_scene_content_compare)
  call register('scene_content_defaults', collect_scene_content_defaults)
  call register('scene_content_expressions', collect_scene_content_expressions)
  call register('motion_expressions', collect_motion_expressions)
  call register('scene_content_groups', collect_scene_content_groups)
  call register('scene_format_elements', collect_scene_format_elements)
  call register('scene_format_file', collect_scene_format_file)
  call register('scene_content_read', collect_scene_content_read)
  call register('scene_content_reference', collect_scene_content_reference)
  call register('scene_format_source', collect_scene_format_source)
  call register('scene_format_pieces', collect_scene_format_pieces)
  call register('scene_format_table', collect_scene_format_table)
  call register('scene_content_template', collect_scene_content_template)
  call register('scene_format_values', collect_scene_format_values)
  call register('scene_content_write', collect_scene_content_write)
  call register('softening_cracks', collect_softening_cracks)
  call register('study_bench_bench', collect_study_bench_bench)
  call register('set_up_consistent_envelope', collect_set_up_consistent_envelope)
  call register('set_up_consistent_symmetries', collect_set_up_consistent_symmetries)
  call register('set_up_consistent_weights', collect_set_up_consistent_weights)
  call register('set_up_terms', collect_set_up_terms)
  call register('set_up_horizons', collect_set_up_horizons)
  call register('set_up_ranks', collect_set_up_ranks)
  call register('set_up_toughness', collect_set_up_toughness)
  call register('study_limits_limits', collect_study_limits_limits)
  call register('study_trade_closed_form', collect_study_trade_closed_form)
  call register('study_trade_plan', collect_study_trade_plan)
  call register('study_trade_predict', collect_study_trade_predict)
  call register('study_trade_study', collect_study_trade_study)
  call register('warnings', collect_warnings)

  call read_arguments()
  call leave_out(except)
  if (len(suite_name) > 0) then
    call run_suite(suites(suite_number(suite_name)))
    if (passed + failed + skipped == 0) then
      write (output_unit, '(a)') 'no test of this suite was chosen'
      stop 2, quiet=.true.
    end if
  else
    do i = 1, known
      if (left_out(i)) cycle
      if (len(share) > 0) then
        if (.not. taken(suites(i)%name)) cycle
      end if
      call run_suite(suites(i))
    end do
  end if

  if (skipped > 0) write (output_unit, '(i0, a)') skipped, ' skipped'
  write (output_unit, '(i0, a, i0, a)') passed, ' passed, ', failed, ' failed'
  if (failed > 0) stop 1, quiet=.true.

contains

  subroutine register(name, collect)
    character(*), intent(in) :: name
    procedure(collect_interface) :: collect
    known = known + 1
    suites(known) = new_testsuite(name, collect)
  end subroutine register

  subroutine read_arguments()
    integer :: at, length
    character(:), allocatable :: word

    short = .false.
    suite_name = ''
    test_name = ''
    except = ''
    share = ''
    do at = 1, command_argument_count()
      call get_command_argument(at, length=length)
      if (allocated(word)) deallocate (word)
      allocate (character(length) :: word)
      call get_command_argument(at, word)
      if (word == '--short') then
        short = .true.
      else if (index(word, '--except=') == 1) then
        except = word(len('--except=') + 1:)
      else if (index(word, '--share=') == 1) then
        share = word(len('--share=') + 1:)
      else if (len(suite_name) == 0) then
        suite_name = word
      else
        test_name = word
      end if
    end do
  end subroutine read_arguments

  !> Whether no other program had taken this suite.
  logical function taken(name)
    character(*), intent(in) :: name
    integer :: unit, io

    ! of several programs that do this at once, one alone makes the file
    open (newunit=unit, file=share//'/'//name, status='new', action='write', iostat=io)
    taken = io == 0
    if (taken) close (unit)
  end function taken

  !> Of a name that there is; another one ends the program.
  integer function suite_number(name) result(number)
    character(*), intent(in) :: name

    number = select_suite(suites(:known), name)
    if (number > 0) return
    write (output_unit, '(3a)') 'no suite is called "', name, '"; there are:'
    write (output_unit, '(2x, a)') (suites(i)%name, i=1, known)
    stop 2, quiet=.true.
  end function suite_number

  !> Names with commas between them.
  subroutine leave_out(names)
    character(*), intent(in) :: names
    integer :: first, length

    first = 1
    do while (first <= len(names))
      length = index(names(first:)//',', ',') - 1
      left_out(suite_number(names(first:first + length - 1))) = .true.
      first = first + length + 1
    end do
  end subroutine leave_out

  !> One test at a time and never in parallel: tests set thread numbers, and HDF5 is not reentrant.
  subroutine run_suite(suite)
    type(testsuite_type), intent(in) :: suite
    type(unittest_type), allocatable :: tests(:)
    integer :: it

    write (output_unit, '(a)') suite%name
    call suite%collect(tests)
    do it = 1, size(tests)
      if (len(test_name) > 0 .and. tests(it)%name /= test_name) cycle
      if (short .and. index(tests(it)%name, 'long') == 1) cycle
      call run_test(suite, tests(it)%name)
    end do
  end subroutine run_suite

  !> The framework writes its verdict to a scratch file, so that skipped tests can be told from
  !> passed ones and every test takes one line, whichever version of the framework is used.
  subroutine run_test(suite, name)
    type(testsuite_type), intent(in) :: suite
    character(*), intent(in) :: name
    integer :: unit, stat, io, threads
    integer(int64) :: start, finish, rate
    character(2000) :: line
    character(12) :: seconds

    ! The name goes out first: if the test crashes, one sees where.
    write (output_unit, '(2x, a)', advance='no') name
    flush (output_unit)
    open (newunit=unit, status='scratch', action='readwrite')
    stat = 0
    call system_clock(start, rate)
    threads = omp_get_max_threads()
    call run_selected(suite%collect, name, unit, stat)
    ! what a test sets must not reach others
    call omp_set_num_threads(threads)
    call system_clock(finish)
    rewind (unit)
    read (unit, '(a)', iostat=io) line
    if (io /= 0) line = '[FAILED] no verdict'
    if (io /= 0 .and. stat == 0) stat = 1
    write (seconds, '(f8.2)') real(finish - start, real64)/real(rate, real64)
    write (output_unit, '(5a)') ' ', trim(line(max(1, index(line, '[', back=.true.)):)), &
      & ' ', trim(adjustl(seconds)), ' s'

    if (stat /= 0) then
      failed = failed + 1
    else if (index(line, '[SKIPPED]') > 0) then
      skipped = skipped + 1
    else
      passed = passed + 1
    end if
    do
      read (unit, '(a)', iostat=io) line
      if (io /= 0) exit
      write (output_unit, '(a)') trim(line)
    end do
    close (unit)
  end subroutine run_test

end program main
