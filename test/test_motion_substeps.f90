!> `&time substeps`: laws of conservation, order, breaking by levels, restarts and refusals.
module test_motion_substeps
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: to_text
  use pd_family_composite, only: composite_family_type
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_force_forces, only: internal_force
  use pd_force_model, only: options_of
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_explicit_substeps, only: evaluate_level, level_due
  use pd_motion_system, only: inverse_density, pairing_type, system_type
  use pd_output_results_files, only: make_directory
  use pd_output_results_sink, only: sink_type
  use pd_scene_content_types, only: scene_type, unset
  use pd_set_up_prepare, only: set_up_type
  use bodies, only: box_scene, diary_type, expect_true, noise, ready, ready_alone, shake
  use comparisons, only: expect_close, max_abs
  use force_subjects, only: some_gradient
  use restarts, only: accept, expect_broken, expect_same_results, plate, &
    & run_pieces => run_in_pieces, run_whole => run, spacing
  use test_scene_expect, only: expect_fault, line
  use runs, only: ready_text, refuse
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_motion_substeps

  character(*), parameter :: fast = 'substeps = .true. '

contains

  subroutine collect_motion_substeps(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('which levels are due', test_due), &
      & new_unittest('forces of a whole step are those of the body', test_forces), &
      & new_unittest('points on no grid take the shortest step', test_cloud), &
      & new_unittest('impulses keep both momenta', test_momentum), &
      & new_unittest('the motion is of second order in the step', test_order), &
      & new_unittest('bonds break at the steps of their level', test_levels_of_breaking), &
      & new_unittest('a crack grows as without them', test_crack), &
      & new_unittest('a run in pieces has the same bits', test_pieces), &
      & new_unittest('the step and its limit', test_limit), &
      & new_unittest('what is refused', test_refusals), &
      & new_unittest('long: the energy stays bounded over 100000 steps', test_energy)]
  end subroutine collect_motion_substeps

  !> A bar, a plate or a block of coarse cells of 1 m, refined at its end along x; with nu = 1/3 in
  !> the plane it has no dilatation. Some blocks of eight coarse cells are so far from finer ones
  !> that they have the coarsest step.
  function refined(dim, levels, ratio, time) result(text)
    integer, intent(in) :: dim, levels
    real(wp), intent(in) :: ratio       !! Poisson's
    character(*), intent(in) :: time    !! keys of &time
    character(:), allocatable :: text
    character(*), parameter :: boxes(3) = [character(40) :: 'upper = 30.0 points = 30', &
      & 'upper = 34.0, 6.0 points = 34, 6', 'upper = 24.0, 4.0, 4.0 points = 24, 4, 4']
    character(*), parameter :: from(3) = [character(4) :: '19.9', '22.9', '13.9']

    text = '&scene dimension = '//to_text(dim)//' thickness = 1.0 area = 1.0 /'//line// &
      & '&body lower = '//to_text(dim)//'*0.0 '//trim(boxes(dim))//' /'//line// &
      & '&material youngs_modulus = 1.0 density = 1.0 poissons_ratio = '//to_text(ratio, 16)// &
      & ' /'//line//"&refine shape = 'box' lower(1) = "//trim(from(dim))//' levels = '// &
      & to_text(levels)//' /'//line//'&time '//time//' /'//line
  end function refined

  !> Of 8 substeps the finest level has all, the next one every other, and so on.
  subroutine test_due(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: coarsest(0:7) = [0, 3, 2, 3, 1, 3, 2, 3]
    integer :: n

    do n = 0, 7
      call check(error, level_due(3, n), coarsest(n), 'substep '//to_text(n))
      if (allocated(error)) return
    end do
  end subroutine test_due

  !> Forces of lattices in one to three dimensions, with and without a dilatation.
  subroutine test_forces(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: dims(*) = [1, 2, 2, 2, 3], levels(*) = [2, 1, 2, 1, 1]
    real(wp), parameter :: ratios(*) = [0.3_wp, 1.0_wp/3, 0.2_wp, 0.4_wp, 0.3_wp]
    type(set_up_type) :: set_up
    integer :: trial

    do trial = 1, size(dims)
      call ready_text(refined(dims(trial), levels(trial), ratios(trial), fast//'steps = 1'), &
        & set_up, error, alone=.true.)
      if (allocated(error)) return
      call expect_split(error, set_up%system)
    end do
  end subroutine test_forces

  !> Forces of two lattices and a cloud beside the finer one, with one horizon for all.
  subroutine test_cloud(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: here = 'build/test_motion_substeps'
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    type(sink_type) :: sink
    character(120) :: row
    integer :: i, j, state, trial

    state = 5
    call make_directory(here, fault)
    if (.not. allocated(fault)) call sink%open(here//'/cloud.txt', fault)
    do j = 1, 10
      do i = 1, 5
        write (row, '(4(es24.16, 1x))') spacing*(31.5_wp + i + 0.1_wp*noise(state)), &
          & spacing*(j - 0.5_wp + 0.1_wp*noise(state)), 0.0_wp, 2.0e-3_wp*spacing**2
        if (.not. allocated(fault)) call sink%put(trim(row)//line, fault)
      end do
    end do
    if (.not. allocated(fault)) call sink%close(fault)
    call accept(error, fault)
    if (allocated(error)) return
    do trial = 1, 2
      call box_scene([20, 10], spacing, merge(1.0_wp/3, 0.3_wp, trial == 1), scene)
      scene%horizon%length = 3.015_wp*spacing
      scene%bodies = [scene%bodies(1), scene%bodies(1), scene%bodies(1)]
      scene%bodies(2)%name = 'fine'
      scene%bodies(2)%lower(1) = 20*spacing
      scene%bodies(2)%upper(1) = 32*spacing
      scene%bodies(2)%points(:2) = [24, 20]
      scene%bodies(3)%name = 'cloud'
      scene%bodies(3)%file = here//'/cloud.txt'
      scene%bodies(3)%points = 0
      scene%bodies(3)%lower = unset
      scene%bodies(3)%upper = unset
      scene%time%substeps = .true.
      call ready_alone(scene, set_up, error)
      if (allocated(error)) return
      call expect_split(error, set_up%system)
    end do
  end subroutine test_cloud

  !> Forces at the beginning of a step are those of one pass over all bonds; what kicks have beside
  !> them balances. Between, only what belongs to finer levels is there, which balances, too.
  subroutine expect_split(error, system)
    type(error_type), allocatable, intent(inout) :: error
    type(system_type), intent(inout) :: system
    type(pairing_type) :: pairings(0:system%levels)
    real(wp) :: force(system%body%n_slots, system%body%dim), largest, size_of_sum
    integer :: c, l

    if (allocated(error)) return
    call shake(system%body, some_gradient(0.01_wp), 0.01_wp*minval(system%body%spacing), 7, &
      & system%state%u)
    call internal_force(system%body, system%family, system%model, options_of(system%model), &
      & system%workspace, system%state%u, system%state%p, force, system%strained)
    largest = max_abs(force)
    do l = 0, system%levels
      call evaluate_level(system, 0.0_wp, l, pairings)
      if (l == 0) then
        call expect_close(error, system%state%force, force, 1.0e-13_wp*largest, 'forces')
        call expect_true(error, max_abs(system%beyond) > 1.0e-3_wp*largest, 'no longer impulses')
      end if
      do c = 1, system%body%dim
        size_of_sum = sum(abs(force(:, c))*system%body%volume)
        call expect_close(error, sum(system%state%force(:, c)*system%body%volume), 0.0_wp, &
          & 1.0e-13_wp*size_of_sum, 'sum of forces')
        if (l < system%levels) call expect_close(error, sum(system%beyond(:, c) &
          & *system%body%volume), 0.0_wp, 1.0e-13_wp*size_of_sum, 'sum of what is beyond')
      end do
    end do
    call expect_true(error, max_abs(system%state%force - force) > 1.0e-3_wp*largest, &
      & 'the finest level has all forces')
  end subroutine expect_split

  !> Momentum and angular momentum of velocities as the integrator keeps them, and the sizes of
  !> their terms. Points come to their places with these velocities: where on that way they are
  !> does not matter.
  subroutine momenta(system, sums, sizes)
    type(system_type), intent(in) :: system
    real(wp), intent(out) :: sums(6), sizes(6)
    real(wp) :: x(3), v(3), terms(6), mass
    integer :: k

    sums = 0.0_wp
    sizes = 0.0_wp
    do k = 1, system%body%n_slots
      if (system%body%point(k) == 0) cycle
      mass = system%body%volume(k)/inverse_density(system%model, k)
      x = 0.0_wp
      v = 0.0_wp
      v(:system%body%dim) = system%state%v(k, :)
      x(:system%body%dim) = system%body%x(k, :) + system%state%u(k, :)
      terms(:3) = mass*v
      terms(4:) = mass*[x(2)*v(3) - x(3)*v(2), x(3)*v(1) - x(1)*v(3), x(1)*v(2) - x(2)*v(1)]
      sums = sums + terms
      sizes = sizes + abs(terms)
    end do
  end subroutine momenta

  !> Bodies in wild motion, whose bonds break: impulses of bonds are opposite, equal and along them.
  !> Rounding adds up over some hundred substeps.
  subroutine test_momentum(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: dims(*) = [1, 2, 2, 2, 3], levels(*) = [2, 1, 2, 1, 1]
    real(wp), parameter :: ratios(*) = [0.3_wp, 1.0_wp/3, 1.0_wp/3, 0.4_wp, 0.3_wp]
    type(set_up_type) :: set_up
    real(wp) :: before(6), after(6), sizes(6), largest(6)
    integer :: trial, late

    do trial = 1, size(dims)
      do late = 0, 1
        call ready_text(breaking_text(trial, late == 1), set_up, error, alone=.true.)
        if (allocated(error)) return
        associate (system => set_up%system)
          call stir(system, 0.1_wp)
          call momenta(system, before, largest)
          call go(set_up, error)
          call momenta(system, after, sizes)
          call expect_true(error, system%broken > 10_i8, 'only '//to_text(int(system%broken))// &
            & ' bonds broke')
          call expect_close(error, after, before, 3.0e-13_wp*maxval(largest + sizes), &
            & 'momenta, trial '//to_text(trial))
        end associate
      end do
    end do

  contains

    function breaking_text(trial, late) result(text)
      integer, intent(in) :: trial
      logical, intent(in) :: late
      character(:), allocatable :: text
      integer :: i

      text = refined(dims(trial), levels(trial), ratios(trial), fast//'steps = 60'// &
        & merge(" breaking = 'after_forces'", repeat(' ', 26), late))
      i = index(text, 'poissons_ratio')
      text = text(:i - 1)//'critical_stretch = 0.12 '//text(i:)
    end function breaking_text
  end subroutine test_momentum

  !> Random velocities, their components up to `size` [m/s].
  subroutine stir(system, size)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: size
    integer :: state, i, c

    state = 11
    do i = 1, system%body%n_points
      do c = 1, system%body%dim
        system%state%v(system%body%slot(i), c) = size*noise(state)
      end do
    end do
  end subroutine stir

  !> Move it as planned.
  subroutine go(set_up, error, diary)
    type(set_up_type), intent(inout) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    type(diary_type), intent(inout), optional :: diary
    type(diary_type) :: own
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    own%every = set_up%plan%steps
    if (present(diary)) own = diary
    call run_explicit(set_up%system, set_up%plan%integrator, set_up%plan%step, set_up%plan%steps, &
      & own, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (present(diary)) diary = own
  end subroutine go

  !> log2 of the quotient of the errors of a step and of half of it, against Runge-Kutta with a
  !> quarter of the shortest substep: it is 2, as without substeps. One side moves, the refined one
  !> bears a load.
  subroutine test_order(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: levels(*) = [2, 1, 1], steps = 40
    real(wp), parameter :: ratios(*) = [1.0_wp/3, 0.2_wp, 0.4_wp]
    character(*), parameter :: conditions = &
      & "&boundary side = 'x_min' velocity_x = 1e-3 ramp_time = 20 /"//line// &
      & "&load side = 'x_max' pressure = 2e-3 ramp_time = 20 /"//line// &
      & '&initial velocity_gradient(1, 1) = 1e-3 velocity_gradient(2, 1) = -2e-3 /'//line
    real(wp), allocatable :: truth(:, :), coarse(:, :), fine(:, :)
    integer :: trial

    do trial = 1, size(levels)
      call motion("integrator = 'runge_kutta' ", 16*steps, truth)
      call motion(fast, steps, coarse)
      call motion(fast, 2*steps, fine)
      if (allocated(error)) return
      call expect_close(error, log(norm2(coarse - truth)/norm2(fine - truth))/log(2.0_wp), &
        & 2.0_wp, 0.2_wp, 'order')
      call expect_close(error, norm2(fine - truth)/norm2(truth), 0.0_wp, 1.0e-3_wp, 'error')
    end do

  contains

    subroutine motion(keys, number, u)
      character(*), intent(in) :: keys
      integer, intent(in) :: number
      real(wp), allocatable, intent(out) :: u(:, :)
      type(set_up_type) :: set_up

      call ready_text(refined(2, levels(trial), ratios(trial), keys//'step = '// &
        & to_text(12.0_wp/number, 16)//' steps = '//to_text(number))//conditions, set_up, &
        & error, alone=.true.)
      call go(set_up, error)
      if (.not. allocated(error)) u = set_up%system%state%u(set_up%system%body%slot, :)
    end subroutine motion
  end subroutine test_order

  !> A body strained beyond the limit of all its bonds: at an instant of the finest level the bonds
  !> of that level break, at both ends, and no others; at the beginning of a step the rest does.
  subroutine test_levels_of_breaking(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(pairing_type) :: pairings(0:2)
    type(bonds_type) :: bonds
    character(:), allocatable :: text
    integer :: trial, k, i, l, wrong, number(0:2)

    do trial = 1, 2
      text = refined(2, 2, merge(1.0_wp/3, 0.2_wp, trial == 1), fast//'steps = 1')
      i = index(text, 'poissons_ratio')
      call ready_text(text(:i - 1)//'critical_stretch = 0.05 '//text(i:), set_up, error, &
        & alone=.true.)
      if (allocated(error)) return
      associate (system => set_up%system)
        system%state%u = 0.1_wp*system%body%x
        call allocate_bonds(system%family, bonds)
        do l = 2, 0, -1
          call evaluate_level(system, 0.0_wp, l, pairings)
          wrong = 0
          number = 0
          do k = 1, system%body%n_slots
            call system%family%bonds_of(k, bonds)
            do i = 1, bonds%n
              associate (of_bond => system%family%level_of_bond(k, int(bonds%j(i))))
                number(of_bond) = number(of_bond) + 1
                if (bonds%intact(i) .neqv. of_bond < l) wrong = wrong + 1
              end associate
            end do
          end do
          call check(error, wrong, 0, 'bonds that should not have broken, or should')
          if (allocated(error)) return
        end do
        call expect_true(error, number(0) > 100 .and. number(2) > 1000, 'few bonds of a level')
        call check(error, 2_i8*system%broken, int(sum(number), i8), 'bonds broken')
        if (allocated(error)) return
      end associate
    end do
  end subroutine test_levels_of_breaking

  !> A plate that flies apart at its notch, beside one of half the spacing: as many bonds break as
  !> without substeps, to some per cent, and the balance of energies is closed as well as there.
  subroutine test_crack(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: broken(2), off(2)
    type(scene_type) :: scene
    integer :: late, nu, substeps

    do late = 0, 1
      do nu = 1, 2
        do substeps = 1, 2
          call notched(scene)
          if (late == 1) scene%time%breaking = 'after_forces'
          scene%materials(1)%poissons_ratio = merge(1.0_wp/3, 0.2_wp, nu == 1)
          scene%time%substeps = substeps == 2
          scene%time%safety = merge(0.35_wp, 0.7_wp, substeps == 1)
          scene%time%steps = 0
          scene%time%duration = 6.0e-6_wp
          call ready_alone(scene, set_up, error)
          if (allocated(error)) return
          diary = diary_type(every=1)
          call go(set_up, error, diary)
          if (allocated(error)) return
          broken(substeps) = real(set_up%system%broken, wp)
          associate (n => diary%n)
            off(substeps) = (diary%kinetic(n) + diary%strain(n) + diary%dissipated(n) &
              & - diary%work(n) - diary%kinetic(1) - diary%strain(1))/diary%dissipated(n)
          end associate
        end do
        call expect_true(error, broken(1) > 100.0_wp, 'few bonds break')
        call expect_close(error, broken(2)/broken(1), 1.0_wp, 0.05_wp, 'bonds broken')
        call expect_close(error, off(1), 0.0_wp, 0.02_wp, 'balance without')
        call expect_close(error, off(2), 0.0_wp, 0.02_wp, 'balance with substeps')
      end do
    end do
  end subroutine test_crack

  !> The notched plate of the restarts beside one of half its spacing.
  subroutine notched(scene)
    type(scene_type), intent(out) :: scene

    call plate(scene)
    scene%bodies(1)%upper(1) = 20*spacing
    scene%bodies(1)%points(1) = 20
    scene%bodies = [scene%bodies(1), scene%bodies(1)]
    scene%bodies(2)%name = 'fine'
    scene%bodies(2)%lower(1) = scene%bodies(1)%upper(1)
    scene%bodies(2)%upper(1) = 26*spacing
    scene%bodies(2)%points(:2) = [12, 24]
    scene%boundaries(:2)%body = 'box'
    ! moved points keep their bonds
    deallocate (scene%no_fail)
    allocate (scene%no_fail(2))
    scene%no_fail%shape = 'box'
    scene%no_fail(1)%upper(2) = 0.0_wp
    scene%no_fail(2)%lower(2) = scene%bodies(1)%upper(2)
  end subroutine notched

  !> Interrupted after every step, on one thread, and in one piece, on two.
  subroutine test_pieces(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces, trial

    do trial = 1, 2
      call notched(scene)
      scene%time%substeps = .true.
      scene%time%steps = 24
      scene%materials(1)%poissons_ratio = merge(1.0_wp/3, 0.3_wp, trial == 1)
      if (trial == 1) scene%time%breaking = 'after_forces'
      call run_whole(scene, 'substeps/whole'//to_text(trial), fault, threads=2)
      call accept(error, fault)
      call expect_broken(error, 'substeps/whole'//to_text(trial))
      if (allocated(error)) return
      call run_pieces(scene, 'substeps/pieces'//to_text(trial), 1, pieces, error)
      if (allocated(error)) return
      call expect_same_results(error, 'substeps/whole'//to_text(trial), &
        & 'substeps/pieces'//to_text(trial), 5)
    end do
  end subroutine test_pieces

  !> The stable step is that of the coarsest points where the rest of the body allows it: with one
  !> material between 1.6 and twice that of the finest ones, whose rows beside the coarser ones have
  !> longer bonds. Steps beyond 0.8 of it are refused.
  subroutine test_limit(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: with, without
    integer :: l

    do l = 1, 2
      call ready_text(refined(2, l, 0.2_wp, fast//'steps = 5'), with, error, alone=.true.)
      call ready_text(refined(2, l, 0.2_wp, 'steps = 5'), without, error, alone=.true.)
      if (allocated(error)) return
      call expect_true(error, with%plan%limit <= 2**l*without%plan%limit*(1 + 1.0e-12_wp), &
        & 'the limit is too long')
      call expect_true(error, with%plan%limit > 0.8_wp*2**l*without%plan%limit, &
        & 'the limit is too short: '//to_text(with%plan%limit/without%plan%limit))
      call expect_close(error, with%plan%step, 0.8_wp*with%plan%limit, &
        & 1.0e-12_wp*with%plan%limit, 'step')
    end do
    call refuse(error, refined(2, 1, 0.2_wp, fast//'steps = 5 safety = 0.9'), &
      & 'with substeps the step may be 0.8 of the stable one|may resonate')
    call refuse(error, refined(2, 1, 0.2_wp, fast//'steps = 5 step = 5.0'), &
      & 'with substeps the step may be 0.8 of the stable one|may resonate')
  end subroutine test_limit

  subroutine test_refusals(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: no = '&time substeps do not serve '
    character(:), allocatable :: text, other
    type(set_up_type) :: set_up
    integer :: i

    text = refined(2, 1, 0.2_wp, fast//'steps = 5')
    call expect_fault(error, refined(2, 1, 0.2_wp, fast//"method = 'relaxation'"), &
      & "'substeps' is not for relaxation")
    call expect_fault(error, refined(2, 1, 0.2_wp, fast//"integrator = 'runge_kutta' steps = 1"), &
      & "'substeps' is not for integrator = 'runge_kutta'|expected 'forward_backward'")
    call expect_fault(error, refined(2, 1, 0.2_wp, fast//"limit = 'spectral' steps = 1"), &
      & "'substeps' is not for limit = 'spectral'")
    call refuse(error, text//"&boundary side = 'x_min' motion = 'pin' /"//line, &
      & no//"motion = 'pin'")
    call refuse(error, text//"&boundary side = 'x_min' absorbing = .true. /"//line, &
      & no//'absorbing boundaries')
    call refuse(error, text//"&load side = 'x_min' stiffness = 2*1.0 /"//line, no//'springs')
    i = index(text, 'poissons_ratio')
    call refuse(error, text(:i - 1)//'thermal_expansion = 1e-5 '//text(i:)// &
      & '&initial temperature_change = 1.0 ramp_time = 3.0 /'//line, &
      & no//'a temperature that varies in time')
    other = text(:i - 1)//'critical_stretch = 1e-3 '//text(i:)// &
      & "&region name = 'all' shape = 'box' lower = -1, -1 /"//line
    call refuse(error, other//"&boundary region = 'all' velocity_x = 1.0 /"//line, &
      & no//'moved points whose bonds take substeps and can break')
    call ready_text(other//"&boundary region = 'all' velocity_x = 0.0 /"//line, set_up, error)
    call ready_text(other//"&boundary region = 'all' velocity_x = 1.0 /"//line// &
      & "&no_fail region = 'all' /"//line, set_up, error)
    call refuse(error, text//"&horizon family = 'list' /"//line, &
      & no//'a scene without lattices that a list joins|asked for')
    i = index(text, '&refine')
    other = text(:i - 1)//text(index(text, '&time'):)
    call refuse(error, named(text)//"&body name = 'tool' lower = 40, 0 upper = 44, 6 "// &
      & "points = 4, 6 /"//line//"&contact between = 'plate', 'tool' /"//line, no//'&contact')
    call refuse(error, named(refined(3, 1, 0.25_wp, fast//'steps = 5'))//"&rigid name = 'tool' "// &
      & "shape = 'box' edges = 1, 2, 3 centre = 30, 2, 2 density = 1 /"//line// &
      & "&contact between = 'plate', 'tool' /"//line, no//'&rigid')
    call refuse(error, other, no//'a scene without lattices that a list joins')
    call refuse(error, other//'&body lower = 34, 0 upper = 40, 6 points = 9, 9 /'//line// &
      & '&horizon local = .true. /'//line, no//'lattices with spacings of')
    call refuse(error, other//'&body lower = 34.5, 0 upper = 40.5, 6 points = 6, 6 /'//line, &
      & no//'lattices of one spacing')

  contains

    !> The text with a name of its body.
    pure function named(text) result(new)
      character(*), intent(in) :: text
      character(:), allocatable :: new
      integer :: at

      at = index(text, '&body ') + 6
      new = text(:at - 1)//"name = 'plate' "//text(at:)
    end function named
  end subroutine test_refusals

  !> 10^5 steps of a small body at 0.8 of the stable step, 2*10^4 with two levels. The energy that
  !> leapfrog keeps is another one, which differs from that of an instant by (omega dt)^2/4 of its
  !> part: the most in the last tenth of the steps is that of the first, to the scatter of the
  !> highest values.
  subroutine test_energy(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: levels(*) = [1, 2], steps(*) = [100000, 20000]
    real(wp), parameter :: ratios(*) = [0.4_wp, 1.0_wp/3]
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp), allocatable :: energy(:)
    integer :: trial, n

    do trial = 1, size(levels)
      call ready_text(refined(2, levels(trial), ratios(trial), fast//'steps = '// &
        & to_text(steps(trial))), set_up, error, alone=.true.)
      if (allocated(error)) return
      call stir(set_up%system, 1.0e-5_wp)
      diary = diary_type(every=7)
      call go(set_up, error, diary)
      if (allocated(error)) return
      n = diary%n
      energy = diary%kinetic(:n) + diary%strain(:n)
      call expect_close(error, maxval(energy(n - n/10:))/maxval(energy(:n/10)), 1.0_wp, 0.05_wp, &
        & 'largest energy')
      call expect_close(error, sum(energy(n - n/10:))/sum(energy(:n/10 + 1)), 1.0_wp, 0.01_wp, &
        & 'mean energy')
    end do
  end subroutine test_energy

end module test_motion_substeps
