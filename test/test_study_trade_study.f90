!> Whole studies on small bodies: errors against independent answers, the tables, and choices.
module test_study_trade_study
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text
  use pd_driver, only: run_scene
  use pd_output_report_begin, only: run_options_type
  use pd_output_results_files, only: file_exists, make_directory
  use pd_scene_format_file, only: line_type, read_text_file, split_lines
  use pd_scene_content_read, only: read_scene
  use pd_scene_format_table, only: column_of, read_table, table_type
  use pd_scene_content_types, only: scene_type
  use pd_study_trade_choose, only: run_choose
  use pd_study_trade_lines, only: line_notes
  use pd_study_trade_study, only: begin_study, run_all, run_study, session_type
  use pd_study_trade_table, only: put_file
  use comparisons, only: expect_close, max_abs
  use bodies, only: expect, expect_true
  use test_scene_expect, only: line
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_study_trade_study

  character(*), parameter :: here = 'build/test_study'

  !> Steel, 1 m, let go from a strain of 1e-3 with one end held.
  character(*), parameter :: bar = '&scene dimension = 1 /'//line// &
    & "&body lower = 0.0 upper = 1.0 points = 20 /"//line// &
    & "&material model = 'bond_based' youngs_modulus = 200.0e9 density = 7850.0 /"//line// &
    & '&initial displacement_gradient(1,1) = 0.001 /'//line// &
    & "&boundary side = 'x_min' displacement_x = 0.0 /"//line// &
    & '&time duration = 4.0e-4 /'//line//'&output history_every = 1 /'//line// &
    & "&probe name = 'centre' point = 0.5 /"//line
  character(*), parameter :: points = "&study vary = 'body%points' values = 20, 40, 80 "// &
    & "measure = 'centre' against = 'analytic' "

contains

  subroutine collect_study_trade_study(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('the error is that of the run''s own history', test_error), &
      & new_unittest('the table is complete', test_table), &
      & new_unittest('errors do not depend on threads', test_threads), &
      & new_unittest('a linear field stays', test_patch), &
      & new_unittest('a chain''s wave: the order in time', test_chain), &
      & new_unittest('a bar in tension', test_tension), &
      & new_unittest('against the finest run', test_finest), &
      & new_unittest('the finest in every variable', test_finest_of_all), &
      & new_unittest('true errors against the closed form', test_true_errors), &
      & new_unittest('every scene is set up before the first run', test_checked_first), &
      & new_unittest('why runs are not used', test_notes), &
      & new_unittest('against files of a run', test_files), &
      & new_unittest('a run without a result is reported', test_unstable), &
      & new_unittest('closed forms that do not fit', test_misfits), &
      & new_unittest('a choice meets its error', test_choice), &
      & new_unittest('targets that cannot be met', test_missed)]
  end subroutine collect_study_trade_study

  subroutine options_for(name, options)
    character(*), intent(in) :: name
    type(run_options_type), intent(out) :: options
    options%output_directory = here//'/'//name
    options%quiet = .true.
    options%overwrite = .true.
    options%threads = 1
  end subroutine options_for

  !> Write a scene and make its study without a word; threads are as before afterwards.
  subroutine studied(name, text, session, fault, threads)
    character(*), intent(in) :: name, text
    type(session_type), intent(out) :: session
    type(fault_type), allocatable, intent(out) :: fault
    integer, intent(in), optional :: threads
    type(run_options_type) :: options
    integer :: before

    before = omp_get_max_threads()
    call options_for(name, options)
    if (present(threads)) options%threads = threads
    call make_directory(here, fault)
    if (.not. allocated(fault)) call put_file(here, name//'.nml', text, fault)
    if (.not. allocated(fault)) call begin_study(here//'/'//name//'.nml', options, session, fault, &
      & [line_type ::])
    if (.not. allocated(fault)) call run_all(session, fault)
    call omp_set_num_threads(before)
  end subroutine studied

  subroutine accept(error, fault)
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable, intent(in) :: fault
    if (allocated(fault) .and. .not. allocated(error)) call test_failed(error, fault%message)
  end subroutine accept

  !> The same scene by `run`, and its history against d'Alembert's waves in the form of a series;
  !> its remainder behind 4000 terms is 5e-8 m, of displacements of 5e-4 m.
  subroutine test_error(error)
    type(error_type), allocatable, intent(out) :: error
    type(session_type) :: session
    type(fault_type), allocatable :: fault
    type(run_options_type) :: options
    type(scene_type) :: scene
    type(table_type) :: table
    real(wp), allocatable :: exact(:), found(:)
    real(wp), parameter :: pi = acos(-1.0_wp), speed = sqrt(200.0e9_wp/7850.0_wp)
    real(wp) :: k, x
    integer :: n, threads

    call studied('error', bar//points//"norm = 'rms' /", session, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call read_scene(here//'/error.nml', scene, fault)
    scene%bodies(1)%points(1) = 80
    call options_for('error_run', options)
    threads = omp_get_max_threads()
    if (.not. allocated(fault)) call run_scene(scene, options, fault)
    call omp_set_num_threads(threads)
    if (.not. allocated(fault)) call read_table(here//'/error_run/history.csv', table, fault, &
      & allowed=['*'])
    call accept(error, fault)
    if (allocated(error)) return
    found = table%values(column_of(table, 'centre_displacement_x'), :)
    x = 0.5_wp - 0.5_wp/80        ! of two points as near, that with the lower number
    exact = 0*found
    do n = 0, 4000
      k = (2*n + 1)*pi/2
      exact = exact + 8*0.001_wp/pi**2*(-1)**n/real(2*n + 1, wp)**2*sin(k*x) &
        & *cos(k*speed*table%values(column_of(table, 'time'), :))
    end do
    associate (outcome => session%outcomes(3))
      call expect(error, outcome%error, sqrt(sum((found - exact)**2)/size(exact)), 1.0e-7_wp, &
        & 'rms')
      call expect(error, outcome%value, found(size(found)), 1.0e-9_wp*abs(found(size(found))), &
        & 'the value is the last of the history')
      call expect_true(error, outcome%error > 1.0e-6_wp, 'an error to speak of')
      call expect_true(error, outcome%steps == size(exact) - 1, 'steps')
      call expect(error, outcome%energy_drift, balance(table), 1.0e-9_wp, 'drift')
    end associate
    call studied('error', bar//points//"norm = 'maximum' /", session, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call expect(error, session%outcomes(3)%error, max_abs(found - exact), 1.0e-7_wp, 'maximum')
    call studied('error', bar//points//"norm = 'relative' /", session, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call expect(error, session%outcomes(3)%error, norm2(found - exact)/norm2(exact), 3.0e-4_wp, &
      & 'relative')
    call expect(error, log(session%outcomes(1)%error/session%outcomes(3)%error)/log(4.0_wp), &
      & 1.0_wp, 0.1_wp, 'first order with a front in it')
  end subroutine test_error

  !> Largest gap of the energy balance in a history, over the largest energy.
  real(wp) function balance(table)
    type(table_type), intent(in) :: table
    real(wp), allocatable :: stored(:), work(:)
    stored = table%values(column_of(table, 'kinetic_energy'), :) &
      & + table%values(column_of(table, 'strain_energy'), :)
    work = table%values(column_of(table, 'external_work'), :)
    balance = max_abs(stored - stored(1) - work)/max(max_abs(stored), max_abs(work))
  end function balance

  !> Column by column, in the words of the user guide.
  subroutine test_table(error)
    type(error_type), allocatable, intent(out) :: error
    type(session_type) :: session
    type(fault_type), allocatable :: fault
    type(run_options_type) :: options
    type(line_type), allocatable :: lines(:)
    character(:), allocatable :: text

    call studied('table', bar//points//'/'//line//"&study vary = 'horizon.family' "// &
      & "values = 'lattice', 'list' /", session, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call read_text_file(here//'/table/study.csv', text, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call split_lines(text, lines)
    call expect_true(error, size(lines) == 7, 'a header and six runs')
    if (allocated(error)) return
    call expect_true(error, lines(1)%text == 'body%points,horizon.family,error,seconds,points,'// &
      & 'bonds,steps,bytes,energy_drift,pareto,value,true_error', lines(1)%text)
    call expect_true(error, index(lines(5)%text, '40,list,') == 1, lines(5)%text)
    associate (o => session%outcomes(4))
      ! 40 points and a layer of 3; chains of n points and 3 neighbours have 2 (3n - 6) bonds
      call expect_true(error, o%points == 43 .and. o%bonds == 246, 'points and bonds')
      call expect_true(error, index(lines(5)%text, ',43,246,'//to_text(o%steps)//','// &
        & to_text(o%bytes)//',') > 0, lines(5)%text)
      call expect_true(error, o%seconds > 0.0_wp .and. o%repeats == 5, 'repeated and timed')
    end associate
    call expect(error, session%outcomes(3)%error, session%outcomes(4)%error, &
      & 1.0e-9_wp*session%outcomes(4)%error, 'lattice and list agree')
    call expect_true(error, any(session%outcomes%pareto) .and. &
      & minval(session%outcomes%error, mask=session%outcomes%pareto) <= &
      & minval(session%outcomes%error), 'the best is on the front')
    call expect_true(error, file_exists(here//'/table/study.txt'), 'a text')
    call options_for('table', options)
    options%overwrite = .false.
    call run_study(here//'/table.nml', options, fault, [line_type ::])
    call expect_true(error, allocated(fault), 'a study that is there is not overwritten unasked')
  end subroutine test_table

  !> The same bits with one thread and two.
  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(session_type) :: one, two
    type(fault_type), allocatable :: fault

    call studied('threads', bar//points//'/', one, fault)
    call accept(error, fault)
    call studied('threads', bar//points//'/', two, fault, threads=2)
    call accept(error, fault)
    if (allocated(error)) return
    call expect_close(error, one%outcomes%error, two%outcomes%error, 0.0_wp, &
      & 'errors')
  end subroutine test_threads

  !> A patch whose outer points are held in a linear field: inside nothing moves, without surface
  !> correction exactly, since every inner family is whole. Only strains of 1e-6 keep rotation
  !> from adding to the stretch. The energy density is that of the moduli but for the sum over the
  !> family.
  subroutine test_patch(error)
    type(error_type), allocatable, intent(out) :: error
    type(session_type) :: session
    type(fault_type), allocatable :: fault
    character(*), parameter :: patch = '&scene dimension = 2 /'//line// &
      & '&body lower = 0, 0 upper = 1.6, 1.6 points = 16, 16 /'//line// &
      & '&material youngs_modulus = 2.0e9 poissons_ratio = 0.2 /'//line// &
      & "&horizon surface_correction = 'none' /"//line// &
      & '&initial displacement_gradient = 1e-6, 2e-6, 0, -1e-6, 3e-6 /'//line// &
      & "&region name = 'left' shape = 'box' upper(1) = 0.6 /"//line// &
      & "&region name = 'right' shape = 'box' lower(1) = 1.0 /"//line// &
      & "&region name = 'low' shape = 'box' upper(2) = 0.6 /"//line// &
      & "&region name = 'high' shape = 'box' lower(2) = 1.0 /"//line// &
      & "&region name = 'inner' shape = 'box' lower = 0.6, 0.6 upper = 1.0, 1.0 /"//line// &
      & "&boundary region = 'left' velocity_x = 0 velocity_y = 0 /"//line// &
      & "&boundary region = 'right' velocity_x = 0 velocity_y = 0 /"//line// &
      & "&boundary region = 'low' velocity_x = 0 velocity_y = 0 /"//line// &
      & "&boundary region = 'high' velocity_x = 0 velocity_y = 0 /"//line// &
      & "&time method = 'relaxation' /"//line//'&relaxation tolerance = 1e-9 /'//line

    call studied('patch', patch//"&study vary = 'horizon%ratio' values = 2.015, 3.015 "// &
      & "measure = 'displacement' against = 'analytic' region = 'inner' norm = 'relative' /", &
      & session, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call expect(error, maxval(session%outcomes%error), 0.0_wp, 1.0e-6_wp, 'displacement')
    call studied('patch', patch//"&study vary = 'horizon%ratio' values = 2.015, 3.015 "// &
      & "measure = 'energy_density' against = 'analytic' analytic = 'linear_field' "// &
      & "region = 'inner' /", &
      & session, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call expect_true(error, maxval(session%outcomes%error) < 0.2_wp .and. &
      & minval(session%outcomes%error) > 1.0e-4_wp, 'energy within the error of the sums')
  end subroutine test_patch

  !> On a chain started as a wave the error is that of the time integration alone: order 2 for
  !> Verlet, 4 for Runge-Kutta, to a twentieth; a slip in the frequency would stop both at once.
  subroutine test_chain(error)
    type(error_type), allocatable, intent(out) :: error
    type(session_type) :: session
    type(fault_type), allocatable :: fault
    character(:), allocatable :: table
    character(30) :: row
    real(wp), parameter :: pi = acos(-1.0_wp)
    integer :: i

    table = 'displacement_x velocity_x'//line
    do i = 1, 400
      write (row, '(2es15.7e2)') 1.0e-6_wp*cos(2*pi*(i - 0.5_wp)/12), &
        & 3.0e-2_wp*sin(2*pi*(i - 0.5_wp)/12)
      table = table//row//line
    end do
    call make_directory(here, fault)
    if (.not. allocated(fault)) call put_file(here, 'wave.txt', table, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call studied('chain', '&scene dimension = 1 /'//line// &
      & '&body lower = 0.0 upper = 0.4 points = 400 /'//line// &
      & "&material model = 'bond_based' youngs_modulus = 200e9 density = 7850.0 /"//line// &
      & "&initial file = 'wave.txt' /"//line//'&time duration = 1.0e-5 /'//line// &
      & "&probe name = 'centre' point = 0.2 /"//line// &
      & "&study vary = 'time%safety' values = 0.8, 0.4, 0.2 measure = 'centre' against = "// &
      & "'analytic' /"//line//"&study vary = 'time%integrator' values = 'velocity_verlet', "// &
      & "'runge_kutta' /", session, fault)
    call accept(error, fault)
    if (allocated(error)) return
    associate (e => session%outcomes%error)
      call expect(error, log(e(3)/e(5))/log(2.0_wp), 2.0_wp, 0.05_wp, 'Verlet')
      call expect(error, log(e(2)/e(4))/log(2.0_wp), 4.0_wp, 0.2_wp, 'Runge-Kutta')
      call expect_true(error, e(6) < 3.0e-4_wp, 'and no other error')
    end associate
  end subroutine test_chain

  !> A bar pulled at its end; away from its ends the discrete strain is exact, so that the error
  !> falls with the ends' part, as h; and a block at nu = 0.3 by both ways of pulling.
  subroutine test_tension(error)
    type(error_type), allocatable, intent(out) :: error
    type(session_type) :: session
    type(fault_type), allocatable :: fault
    character(*), parameter :: pulled(3) = [character(110) :: &
      & "&load side = 'y_min' pressure = -1e5 / &load side = 'y_max' pressure = -1e5 /", &
      & "&boundary side = 'y_min' displacement_y = 0 / &load side = 'y_max' force_y = 1e4 /", &
      & "&boundary side = 'y_min' displacement_y = -1e-7 / &boundary side = 'y_max' "// &
      & "displacement_y = 2e-7 /"]
    integer :: i

    call studied('tension', "&scene dimension = 1 area = 2e-4 / &time method = 'relaxation' / "// &
      & "&relaxation tolerance = 1e-9 / &body lower = 0.5 upper = 1.5 points = 20 / "// &
      & '&material youngs_modulus = 200e9 / '//line// &
      & "&boundary side = 'x_min' displacement_x = 1e-6 / &load side = 'x_max' force_x = 100 / "// &
      & line//"&study vary = 'points' values = 20, 40, 80 measure = 'displacement_x' "// &
      & "against = 'analytic' analytic = 'bar_tension' /", session, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call expect(error, log(session%outcomes(2)%error/session%outcomes(3)%error)/log(2.0_wp), &
      & 1.0_wp, 0.15_wp, 'order')
    call expect_true(error, session%outcomes(3)%error < 0.02_wp, 'small')
    do i = 1, 3
      call studied('tension', "&scene dimension = 2 / &time method = 'relaxation' / "// &
        & '&body lower = 0, 0 upper = 0.1, 0.2 points = 10, 20 / &material '// &
        & 'youngs_modulus = 200e9 poissons_ratio = 0.3 /'//line//trim(pulled(i))//line// &
        & "&relaxation tolerance = 1e-6 / &study vary = 'points' values = 10, 20 measure = "// &
        & "'displacement' against = 'analytic' /", session, fault)
      call accept(error, fault)
      if (allocated(error)) return
      call expect_true(error, session%outcomes(2)%error < 0.06_wp .and. &
        & session%outcomes(2)%error < 0.8_wp*session%outcomes(1)%error, 'a plate, pulled by '// &
        & trim(pulled(i))//' '//to_text(session%outcomes(2)%error))
    end do
  end subroutine test_tension

  !> The distances from the finest run and from the exact answer differ by no more than that run's
  !> own error, and a hundredth of it for the interpolation; 20 points' probe lies between points of
  !> the others.
  subroutine test_finest(error)
    type(error_type), allocatable, intent(out) :: error
    type(session_type) :: session, exact
    type(fault_type), allocatable :: fault
    character(*), parameter :: study = "&study vary = 'body%points' values = 20, 40, 320 "// &
      & "measure = 'centre' norm = 'rms' against = "
    integer :: i

    call studied('finest', bar//study//"'finest' /", session, fault)
    call accept(error, fault)
    call studied('finest', bar//study//"'analytic' /", exact, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call expect_true(error, session%finest == 3 .and. session%outcomes(3)%truth .and. &
      & .not. session%outcomes(3)%pareto, 'the finest run')
    do i = 1, 2
      call expect(error, session%outcomes(i)%error, exact%outcomes(i)%error, &
        & 1.01_wp*exact%outcomes(3)%error, 'error')
    end do
    call expect_true(error, exact%outcomes(3)%error < 0.2_wp*exact%outcomes(2)%error, 'finest')
  end subroutine test_finest

  !> The run that is compared with has the finest value of every key that refines, wherever its
  !> values stand; without such a run the study is refused.
  subroutine test_finest_of_all(error)
    type(error_type), allocatable, intent(out) :: error
    type(session_type) :: session
    type(fault_type), allocatable :: fault
    character(*), parameter :: study = "&study vary = 'body%points' values = 40, 20 measure = "// &
      & "'centre' against = 'finest' /"//line//"&study vary = 'time%safety' "

    call studied('finest_of_all', bar//study//'values = 0.8, 0.1, 0.4 /', session, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call expect_true(error, session%finest == 2, '40 points and 0.1')
    call studied('finest_of_all', bar//study//'values = 0.8, 0.4 together = .true. /', session, &
      & fault)
    call expect_refused(error, fault, 'none has body%points = 40, time%safety = 0.4')
    call studied('finest_of_all', bar//"&study vary = 'time%integrator' values = "// &
      & "'runge_kutta', 'velocity_verlet' measure = 'centre' against = 'finest' /", session, fault)
    call expect_refused(error, fault, 'no run is finer than the others')
  end subroutine test_finest_of_all

  subroutine expect_refused(error, fault, part)
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable, intent(in) :: fault
    character(*), intent(in) :: part
    if (allocated(error)) return
    call expect_true(error, allocated(fault), 'accepted, though '//part)
    if (allocated(fault)) call expect_true(error, index(fault%message, part) > 0, fault%message)
  end subroutine expect_refused

  !> Errors against the finest run, extrapolated to true errors, against those from the closed form:
  !> a bar in tension, wrong by its ends' part alone, which is of first order. The fit assumes that
  !> the errors of all runs have one shape; the interpolation between points and the search of the
  !> order by steps of 0.02 leave a few per cent.
  subroutine test_true_errors(error)
    type(error_type), allocatable, intent(out) :: error
    type(session_type) :: session, exact
    type(fault_type), allocatable :: fault
    type(table_type) :: table
    character(*), parameter :: pulled = '&scene dimension = 1 area = 2e-4 / &time method = '// &
      & "'relaxation' / &relaxation tolerance = 1e-9 / &body lower = 0.5 upper = 1.5 "// &
      & 'points = 20 / '// &
      & "&material youngs_modulus = 200e9 / &boundary side = 'x_min' displacement_x = 1e-6 / "// &
      & "&load side = 'x_max' force_x = 100 /"//line
    character(*), parameter :: study = "&study vary = 'body%points' values = 20, 40, 80, 160 "// &
      & "measure = 'displacement_x' against = "
    real(wp) :: root_mean_square
    integer :: t, n, i

    call studied('true', pulled//study//"'analytic' /", exact, fault)
    if (.not. allocated(fault)) call studied('true', pulled//study//"'finest' /", session, fault)
    if (.not. allocated(fault)) call read_table(here//'/true/study.csv', table, fault, &
      & allowed=['*'])
    call accept(error, fault)
    if (allocated(error)) return
    n = size(session%outcomes)
    do t = 1, n
      associate (outcome => session%outcomes(t))
        call expect_true(error, outcome%extrapolated, 'extrapolated')
        call expect(error, outcome%true_error/exact%outcomes(t)%error, 1.0_wp, 0.1_wp, &
          & 'true error of run '//to_text(t))
        call expect(error, table%values(column_of(table, 'true_error'), t), outcome%true_error, &
          & 1.0e-5_wp*outcome%true_error, 'in the table')
        call expect(error, table%values(column_of(table, 'value'), t), exact%outcomes(t)%value, &
          & 1.0e-10_wp, 'value in the table')
      end associate
      call expect_true(error, .not. exact%outcomes(t)%extrapolated, 'a closed form needs none')
      ! u = 1e-6 m + F/(E A) (x - 0.5 m) at the centres of the cells; by the triangle inequality the
      ! norm of the answer differs from that of the closed form by no more than their difference's
      associate (cells => 20*2**(t - 1))
        root_mean_square = sqrt(sum([((1.0e-6_wp + 2.5e-6_wp*(i - 0.5_wp)/cells)**2, i=1, cells)]) &
          & /cells)
      end associate
      call expect(error, exact%outcomes(t)%value/root_mean_square, 1.0_wp, &
        & exact%outcomes(t)%error*(1 + 1.0e-6_wp), 'value of a field')
    end do
    ! the errors against the finest run alone are too small by more than that where they are least
    call expect_true(error, session%outcomes(n - 1)%error < 0.7_wp*exact%outcomes(n - 1)%error, &
      & 'and it matters')
  end subroutine test_true_errors

  !> The last scene cannot be measured, since no point of its coarse lattice lies in the region:
  !> nothing is run and nothing written.
  subroutine test_checked_first(error)
    type(error_type), allocatable, intent(out) :: error
    type(session_type) :: session
    type(fault_type), allocatable :: fault

    call studied('checked_first', bar//"&region name = 'narrow' shape = 'box' lower = 0.487 "// &
      & "upper = 0.489 /"//line//"&study vary = 'body%points' values = 40, 20 measure = "// &
      & "'displacement_x' region = 'narrow' against = 'analytic' /", session, fault)
    call expect_refused(error, fault, 'body%points = 20: ')
    if (allocated(error)) return
    call expect_true(error, .not. any(session%outcomes%done), 'no run')
    call expect_true(error, .not. file_exists(here//'/checked_first/study.csv'), 'no table')
  end subroutine test_checked_first

  !> Of a coarse run that is by chance better than a finer one, of one without an answer and of the
  !> fit the reason stands in one line each.
  subroutine test_notes(error)
    type(error_type), allocatable, intent(out) :: error
    type(session_type) :: session
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text

    call studied('notes', bar//"&study vary = 'time%safety' values = 2.0, 0.8, 0.4, 0.2 "// &
      & "measure = 'centre' against = 'analytic' /", session, fault)
    call accept(error, fault)
    if (allocated(error)) return
    session%outcomes(2:4)%error = [1.0e-3_wp, 5.0e-3_wp, 2.0e-3_wp]
    text = line_notes(session%plan, session%outcomes)
    call expect_true(error, index(text, 'Fit over time%safety: order ') > 0, text)
    call expect_true(error, index(text, line//'  time%safety = 2.0: not used: no answer'//line) &
      & > 0, text)
    call expect_true(error, index(text, line//'  time%safety = 0.8: error taken as 0.005 '// &
      & 'instead of 0.001: a finer run has that error (time%safety = 0.4)'//line) > 0, text)
    call expect_true(error, index(text, '  time%safety = 0.2') == 0, text)
  end subroutine test_notes

  !> A run compared with its own results has no error, whether from the table or the results file,
  !> as history or as field.
  subroutine test_files(error)
    type(error_type), allocatable, intent(out) :: error
    type(session_type) :: session
    type(fault_type), allocatable :: fault
    type(run_options_type) :: options
    type(scene_type) :: scene
    character(24), parameter :: against(3) = [character(24) :: 'truth/history.csv', &
      & 'truth/truth.vtkhdf', 'truth/truth.vtkhdf']
    character(24), parameter :: measure(3) = [character(24) :: 'centre', 'centre_displacement_x', &
      & 'displacement']
    integer :: i, threads

    threads = omp_get_max_threads()
    call make_directory(here, fault)
    if (.not. allocated(fault)) call put_file(here, 'truth.nml', bar, fault)
    if (.not. allocated(fault)) call read_scene(here//'/truth.nml', scene, fault)
    call options_for('truth', options)
    if (.not. allocated(fault)) call run_scene(scene, options, fault)
    call omp_set_num_threads(threads)
    call accept(error, fault)
    do i = 1, 3
      if (allocated(error)) return
      call studied('files', bar//"&study vary = 'body%points' values = 20, 40 measure = '"// &
        & trim(measure(i))//"' against = '"//trim(against(i))//"' /", session, fault)
      call accept(error, fault)
      if (allocated(error)) return
      call expect(error, session%outcomes(1)%error, 0.0_wp, 1.0e-12_wp, trim(against(i)))
      call expect_true(error, session%outcomes(2)%error > 1.0e-3_wp, 'another run differs')
    end do
    call studied('files', bar//"&study vary = 'body%points' values = 20 measure = 'centre' "// &
      & "against = 'truth/nothing.csv' /", session, fault)
    call expect_true(error, allocated(fault), 'a file that is not there')
  end subroutine test_files

  !> A step twice the stable one: that row has no error, the others do.
  subroutine test_unstable(error)
    type(error_type), allocatable, intent(out) :: error
    type(session_type) :: session
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text

    call studied('unstable', bar//"&study vary = 'time%safety' values = 0.8, 2.0 "// &
      & "measure = 'centre' against = 'analytic' /", session, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call expect_true(error, session%outcomes(1)%judged .and. session%outcomes(1)%pareto .and. &
      & .not. session%outcomes(2)%judged .and. .not. session%outcomes(2)%pareto, 'one answer')
    call read_text_file(here//'/unstable/study.csv', text, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call expect_true(error, index(text, line//'2.0,nan,') > 0, text)
  end subroutine test_unstable

  subroutine test_misfits(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: study = "&study vary = 'ratio' values = 3 measure = "// &
      & "'displacement' against = 'analytic' analytic = "
    character(*), parameter :: block = "&scene dimension = 2 / &time method = 'relaxation' / "// &
      & '&body lower = 0, 0 upper = 0.1, 0.2 points = 10, 20 / &material '// &
      & 'youngs_modulus = 200e9 poissons_ratio = 0.3 /'//line

    call refused(bar//study//"'bar_tension' /", 'method')
    call refused(bar//study//"'plate_hole' /", 'dimension 2')
    call refused(bar//study//"'chain_wave' /", 'without loads and boundaries')
    call refused(bar//"&load side = 'x_max' pressure = 1 /"//study//"'bar_vibration' /", 'free of')
    call refused(block//study//"'uniaxial_stress' /", 'no pair of opposite sides')
    call refused(block//"&load side = 'x_min' pressure = 1 / &boundary side = 'x_max' "// &
      & "displacement_x = 0 displacement_y = 0 /"//study//"'uniaxial_stress' /", 'contraction')
    call refused(block//"&load side = 'x_min' pressure = 1 / &load side = 'x_max' "// &
      & 'pressure = 2 /'//study//"'uniaxial_stress' /", 'differently')
    call refused(block//"&remove shape = 'sphere' radius = 0.02 / &load side = 'x_min' "// &
      & "pressure = 1 / &load side = 'x_max' pressure = 1 /"//study//"'plate_hole' /", &
      & 'in the middle')
    call refused(bar//"&study vary = 'ratio' values = 3 measure = 'strain_energy' against = "// &
      & "'analytic' /", 'no closed form knows the column')

  contains

    subroutine refused(text, part)
      character(*), intent(in) :: text, part
      type(session_type) :: session
      type(fault_type), allocatable :: fault
      if (allocated(error)) return
      call studied('misfit', text, session, fault)
      if (.not. allocated(fault)) then
        call test_failed(error, 'accepted: '//text)
      else
        call expect_true(error, index(fault%message, part) > 0, fault%message)
      end if
    end subroutine refused
  end subroutine test_misfits

  !> An error that no listed run has, met beyond the finest of them, with the horizon as a choice.
  !> Which one is cheaper is a matter of measured times, and of no test.
  subroutine test_choice(error)
    type(error_type), allocatable, intent(out) :: error
    type(run_options_type) :: options
    type(fault_type), allocatable :: fault
    type(table_type) :: table
    real(wp), parameter :: target = 0.002_wp

    call options_for('choice', options)
    call make_directory(here, fault)
    if (.not. allocated(fault)) call put_file(here, 'choice.nml', bar//points//'/'//line// &
      & "&study vary = 'ratio' values = 1.015, 3.015 /", fault)
    if (.not. allocated(fault)) call run_choose(here//'/choice.nml', options, target, 0.0_wp, &
      & fault, [line_type ::])
    if (.not. allocated(fault)) call read_table(here//'/choice/study.csv', table, fault, &
      & allowed=['*'])
    call accept(error, fault)
    if (allocated(error)) return
    associate (n => size(table%values, 2))
      call expect_true(error, n >= 7, 'the chosen run is in the table')
      call expect_true(error, table%values(3, n) <= target .and. table%values(3, n) > target/2, &
        & 'it meets the error, not by far')
      call expect_true(error, any(abs(table%values(2, n) - [1.015_wp, 3.015_wp]) <= 0.0_wp), &
        & 'with one of the horizons')
      call expect_true(error, table%values(1, n) > 80, 'and more points than listed')
    end associate
  end subroutine test_choice

  !> With nothing but a wrong horizon to choose there is no way to a millionth: the status is 1.
  subroutine test_missed(error)
    type(error_type), allocatable, intent(out) :: error
    type(run_options_type) :: options
    type(fault_type), allocatable :: fault

    call options_for('missed', options)
    call make_directory(here, fault)
    if (.not. allocated(fault)) call put_file(here, 'missed.nml', bar//"&study vary = 'ratio' "// &
      & "values = 1.015, 3.015 measure = 'centre' against = 'analytic' /", fault)
    call accept(error, fault)
    if (allocated(error)) return
    call run_choose(here//'/missed.nml', options, 1.0e-6_wp, 0.0_wp, fault, [line_type ::])
    call expect_true(error, allocated(fault), 'missed')
    if (.not. allocated(fault)) return
    call expect_true(error, fault%status == 1 .and. index(fault%message, 'cannot be met') > 0, &
      & fault%message)
    ! within a time that no run can keep
    call run_choose(here//'/missed.nml', options, 1.0_wp, 1.0e-9_wp, fault, [line_type ::])
    call expect_true(error, allocated(fault), 'no run is that fast')
  end subroutine test_missed

end module test_study_trade_study
