!> Cracks in bodies whose bonds soften: what they cost at several spacings, the balance of energy,
!> damage, and runs that are repeated, stopped and refused.
module test_softening_cracks
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_error, only: fault_type => error_type, status_interrupted
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_text, only: to_text
  use pd_driver, only: run_scene
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_observer, only: instant_type, observer_type
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_motion_account, only: energies_of, energies_type
  use pd_motion_system, only: system_type
  use pd_output_report_begin, only: run_options_type
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: set_up_type
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: diary_type, expect_true, prepare_run, ready
  use comparisons, only: expect_close
  use restarts, only: read_bytes
  implicit none (type, external)
  private
  public :: collect_softening_cracks

  character(*), parameter :: here = 'build/test_softening_cracks'
  character(*), parameter :: nl = new_line('a')
  real(wp), parameter :: Gc = 60.0_wp       !! [J/m2]
  real(wp), parameter :: s_0 = 1.0e-4_wp    !! peak_stretch
  real(wp), parameter :: ligament = 0.025_wp*0.01_wp  !! area between the notches [m2]

  !> Keeps the settled states of a relaxation, a row each.
  type, extends(observer_type) :: curve_type
    real(wp), allocatable :: reaction(:)    !! of the pulled side [N]
    real(wp), allocatable :: energy(:)      !! stored and dissipated [J]
    real(wp), allocatable :: work(:)        !! external [J]
  contains
    procedure :: observe => observe_curve
  end type curve_type

  !> Follows the stretches of all bonds, from the displacements alone.
  type, extends(observer_type) :: stretches_type
    real(wp), allocatable :: greatest(:, :)  !! of each bond so far (bond, slot) [-]
  contains
    procedure :: observe => observe_stretches
  end type stretches_type

contains

  subroutine collect_softening_cracks(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('long: a crack costs the same at three spacings', test_spacings), &
      & new_unittest('the balance of energy closes at second order', test_balance), &
      & new_unittest('damage and broken bonds follow from the greatest stretches', test_damage), &
      & new_unittest('the same bits on any number of threads', test_threads), &
      & new_unittest('a run that is stopped after every step', test_restart), &
      & new_unittest('scenes that cannot have the law are refused', test_refused)]
  end subroutine collect_softening_cracks

  !> A strip of 0.1 m by 0.05 m with notches from both sides in its middle, pulled along.
  function strip(points, method, added) result(text)
    integer, intent(in) :: points           !! along the strip
    character(*), intent(in) :: method      !! `&time` and other groups
    character(*), intent(in), optional :: added  !! keys of `&material`
    character(:), allocatable :: text, keys

    keys = 'peak_stretch = 1.0e-4'//nl//'critical_energy_release_rate = 60.0'
    if (present(added)) keys = added
    text = '&scene'//nl//'dimension = 2'//nl//'thickness = 0.01'//nl//'/'//nl// &
      & '&body'//nl//"name = 'strip'"//nl//'lower = -0.05, -0.025'//nl//'upper = 0.05, 0.025'// &
      & nl//'points = '//to_text(points)//', '//to_text(points/2)//nl//'/'//nl// &
      & '&material'//nl//"model = 'softening'"//nl//'youngs_modulus = 30.0e9'//nl// &
      & 'density = 2400.0'//nl//keys//nl//'/'//nl//'&horizon'//nl//'ratio = 3.015'//nl//'/'//nl// &
      & '&crack'//nl//'from = 0.0, -0.025'//nl//'to = 0.0, -0.0125'//nl//'/'//nl// &
      & '&crack'//nl//'from = 0.0, 0.0125'//nl//'to = 0.0, 0.025'//nl//'/'//nl// &
      & '&boundary'//nl//"name = 'left'"//nl//"side = 'x_min'"//nl//'displacement_x = 0.0'//nl// &
      & 'displacement_y = 0.0'//nl//'/'//nl//method
  end function strip

  !> The same, pulled to 54 micrometres in 50 load steps: 20 of them from 0.19 to 0.30 of that,
  !> where a band of bonds softens and others unload. What these have reached is known at the ends
  !> of load steps alone: with 36 equal steps up to 6 % of the greatest load are missing there, of
  !> 64 points along the strip, against 144 steps.
  function strip_at_rest(points) result(text)
    integer, intent(in) :: points
    character(:), allocatable :: text
    text = strip(points, '&boundary'//nl//"name = 'right'"//nl//"side = 'x_max'"//nl// &
      & 'displacement_x = 54.0e-6'//nl//'times = 0.0, 0.2, 0.6, 1.0'//nl// &
      & 'values = 0.0, 0.19, 0.30, 1.0'//nl//'displacement_y = 0.0'//nl//'/'//nl//'&time'//nl// &
      & "method = 'relaxation'"//nl//'/'//nl//'&relaxation'//nl//'load_steps = 50'//nl//'/'//nl)
  end function strip_at_rest

  !> The same, of 16 by 8 points, pulled at a given speed [m/s].
  function strip_in_time(speed, steps, duration, added) result(text)
    character(*), intent(in) :: speed, steps, duration
    character(*), intent(in), optional :: added
    character(:), allocatable :: text
    text = strip(16, '&boundary'//nl//"name = 'right'"//nl//"side = 'x_max'"//nl// &
      & 'velocity_x = '//speed//nl//'displacement_y = 0.0'//nl//'/'//nl//'&time'//nl// &
      & 'steps = '//steps//nl//'step = '//duration//nl//'/'//nl//'&output'//nl// &
      & "fields = 'displacement', 'damage'"//nl//"format = 'vtu'"//nl//'/'//nl, added)
  end function strip_in_time

  subroutine read_text(text, scene, error)
    character(*), intent(in) :: text
    type(scene_type), intent(out) :: scene
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    call read_scene_text(text, 'strip.nml', scene, fault)
    if (allocated(fault)) call test_failed(error, 'the scene is refused: '//fault%message)
  end subroutine read_text

  subroutine observe_curve(observer, system, instant, error)
    class(curve_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error
    type(energies_type) :: energies

    if (allocated(error)) return
    if (.not. instant%settled) return
    if (.not. allocated(observer%work)) allocate (observer%work(0), observer%energy(0), &
      & observer%reaction(0))
    call energies_of(system, system%state%v, energies)
    observer%reaction = [observer%reaction, system%motions(2)%reaction(1)]
    observer%energy = [observer%energy, energies%strain + system%dissipated]
    observer%work = [observer%work, system%external_work]
  end subroutine observe_curve

  !> Stretches from lengths: with those of 1e-4 twelve digits are left.
  subroutine observe_stretches(observer, system, instant, error)
    class(stretches_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error
    type(bonds_type) :: bonds
    real(wp) :: y(2)
    integer :: k, i

    if (allocated(error)) return
    call allocate_bonds(system%family, bonds)
    if (instant%step == 0) allocate (observer%greatest(system%family%most_bonds, &
      & system%body%n_slots), source=0.0_wp)
    do k = 1, system%body%n_slots
      call system%family%bonds_of(k, bonds)
      do i = 1, bonds%n
        y = bonds%xi(i, :) + system%state%u(bonds%j(i), :) - system%state%u(k, :)
        observer%greatest(i, k) = max(observer%greatest(i, k), norm2(y)/bonds%length(i) - 1)
      end do
    end do
  end subroutine observe_stretches

  !> Load curves and dissipated energies with spacings and horizons from 1 to 5/8, within 5 % of
  !> each other. At this ratio a sum over the lattice counts 5.4 % less for a straight crack than
  !> the integral of Gc (doc/theory.md, 8): 0.946 Gc A is the least that a crack costs. Bonds beside
  !> it that soften and unload again come on top: up to 6 % are accepted, so that 0.976 is
  !> asked for, to 3 %.
  subroutine test_spacings(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: points(*) = [40, 48, 64]
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(curve_type) :: curve(size(points))
    type(fault_type), allocatable :: fault
    real(wp) :: lost(size(points)), peak
    integer :: i

    do i = 1, size(points)
      call read_text(strip_at_rest(points(i)), scene, error)
      call ready(scene, set_up, error)
      if (allocated(error)) return
      call run_relaxation(set_up%system, set_up%plan%relaxation, curve(i), fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      lost(i) = set_up%system%dissipated
      call expect_close(error, lost(i)/(Gc*ligament), 0.976_wp, 0.03_wp, 'dissipated over Gc A')
      call expect_close(error, curve(i)%energy, curve(i)%work, 0.005_wp*Gc*ligament, &
        & 'stored and dissipated energy')
      call expect_true(error, set_up%system%broken > 0_i8, 'no bond is lost')
    end do
    call expect_close(error, lost/lost(3), 1.0_wp, 0.05_wp, 'dissipated')
    peak = maxval(curve(3)%reaction)
    do i = 1, 2
      call expect_close(error, maxval(curve(i)%reaction)/peak, 1.0_wp, 0.05_wp, 'peak')
      call expect_close(error, curve(i)%reaction/peak, curve(3)%reaction/peak, 0.05_wp, &
        & 'load curve')
    end do
    call expect_close(error, curve(3)%reaction(size(curve(3)%reaction))/peak, 0.0_wp, 0.01_wp, &
      & 'force at the end')
  end subroutine test_spacings

  !> A strip that is torn in 0.4 ms.
  subroutine run_torn(steps, threads, set_up, observer, error)
    integer, intent(in) :: steps, threads
    type(set_up_type), intent(out) :: set_up
    class(observer_type), intent(inout) :: observer
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: before

    if (allocated(error)) return
    before = omp_get_max_threads()
    call omp_set_num_threads(threads)
    call read_text(strip_in_time('0.135', to_text(steps), to_text(4.0e-4_wp/steps)), scene, error)
    call ready(scene, set_up, error)
    if (.not. allocated(error)) then
      call run_explicit(set_up%system, set_up%plan%integrator, 4.0e-4_wp/steps, steps, observer, &
        & fault)
      if (allocated(fault)) call test_failed(error, fault%message)
    end if
    call omp_set_num_threads(before)
  end subroutine run_torn

  !> What is missing falls with the square of the step.
  subroutine test_balance(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(diary_type) :: diary
    real(wp) :: gap(3)
    integer :: i

    do i = 1, 3
      diary = diary_type(every=150*2**i)
      call run_torn(diary%every, 1, set_up, diary, error)
      if (allocated(error)) return
      associate (n => diary%n)
        gap(i) = (diary%strain(n) + diary%kinetic(n) + diary%dissipated(n) - diary%strain(1) &
          & - diary%kinetic(1) - diary%dissipated(1) - diary%work(n))/diary%work(n)
        call expect_true(error, diary%dissipated(n) > 0.5_wp*diary%work(n), 'nothing was torn')
      end associate
      call expect_close(error, gap(i), 0.0_wp, 5.0e-4_wp/4**(i - 1), 'balance')
    end do
  end subroutine test_balance

  !> Greatest stretches of the test's own, their damage by the bilinear curve, and the part of each
  !> family's volume that is lost; both ends of a bond keep the same bits.
  subroutine test_damage(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(stretches_type) :: observer
    type(bonds_type) :: bonds, other
    real(wp) :: s_u, damage, D, sums(2)
    integer(i8) :: lost
    integer :: k, i, o, softened

    call run_torn(300, 1, set_up, observer, error)
    if (allocated(error)) return
    lost = 0_i8
    softened = 0
    associate (system => set_up%system, delta => set_up%system%family%rule%delta)
      ! s_c^2 = 4 pi Gc/(9 E delta) of a bond-based plane
      s_u = 4*acos(-1.0_wp)*Gc/(9*30.0e9_wp*delta)/s_0
      call allocate_bonds(system%family, bonds)
      call allocate_bonds(system%family, other)
      do k = 1, system%body%n_slots
        call system%family%bonds_of(k, bonds)
        if (bonds%n == 0) cycle
        sums = 0.0_wp
        do i = 1, bonds%n
          associate (kappa => observer%greatest(i, k))
            D = 0.0_wp
            if (kappa > s_0) D = s_u/(s_u - s_0)*(1 - s_0/kappa)
            if (kappa > s_0 .and. kappa < s_u .and. bonds%intact(i)) softened = softened + 1
            if (kappa > s_u .and. bonds%j(i) > k .and. .not. cut(bonds, system, k, i)) &
              & lost = lost + 1_i8
            if (.not. bonds%intact(i)) D = 1.0_wp
          end associate
          sums = sums + bonds%weight(i)*[D, 1.0_wp]
          call system%family%bonds_of(int(bonds%j(i)), other)
          o = findloc(other%j(:other%n), k, dim=1)
          associate (history => system%workspace%generic%history, &
            & start => system%workspace%generic%start)
            call expect_close(error, history(1, start(k) + i - 1), &
              & history(1, start(bonds%j(i)) + o - 1), 0.0_wp, 'history of both ends')
          end associate
        end do
        damage = sums(1)/sums(2)
        call expect_close(error, system%state%damage(k), damage, 1.0e-8_wp, 'damage')
        if (allocated(error)) return
      end do
      call expect_true(error, system%broken == lost, 'broken bonds: '//to_text(system%broken)// &
        & ', expected '//to_text(lost))
      call expect_true(error, lost > 20_i8 .and. softened > 20, 'bonds lost and softened')
    end associate
  end subroutine test_damage

  !> Whether a notch has cut a bond: it passes x = 0 beyond 0.0125 m from the middle.
  logical function cut(bonds, system, k, i)
    type(bonds_type), intent(in) :: bonds
    type(system_type), intent(in) :: system
    integer, intent(in) :: k, i
    real(wp) :: x(2)

    x = system%body%x(k, :2)
    cut = .false.
    if (x(1)*(x(1) + bonds%xi(i, 1)) >= 0.0_wp) return
    cut = abs(x(2) - x(1)/bonds%xi(i, 1)*bonds%xi(i, 2)) > 0.0125_wp*(1 - 1.0e-9_wp)
  end function cut

  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: one, two
    type(diary_type) :: diary

    call run_torn(300, 1, one, diary, error)
    call run_torn(300, 2, two, diary, error)
    if (allocated(error)) return
    call expect_close(error, two%system%state%u, one%system%state%u, 0.0_wp, 'displacements')
    call expect_close(error, two%system%state%damage, one%system%state%damage, 0.0_wp, 'damage')
    call expect_close(error, two%system%workspace%generic%history, &
      & one%system%workspace%generic%history, 0.0_wp, 'history')
    call expect_close(error, two%system%dissipated, one%system%dissipated, 0.0_wp, 'dissipated')
    call expect_true(error, one%system%dissipated > 0.0_wp, 'nothing was dissipated')
  end subroutine test_threads

  !> Fast enough that bonds soften and break within 40 steps, in pieces of one step.
  subroutine test_restart(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(fault_type), allocatable :: fault
    integer :: pieces

    call read_text(strip_in_time('5.0', '40', '1.3e-6'), scene, error)
    if (allocated(error)) return
    options%quiet = .true.
    options%threads = 1
    options%overwrite = .true.
    options%output_directory = here//'/whole'
    call run_scene(scene, options, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    options%output_directory = here//'/pieces'
    options%max_minutes = 1.0e-12_wp
    options%restart_command = 'perifort run strip.nml --restart'
    do pieces = 1, 100
      options%restart = pieces > 1
      options%overwrite = .not. options%restart
      call run_scene(scene, options, fault)
      if (.not. allocated(fault)) exit
      if (fault%status == status_interrupted) cycle
      call test_failed(error, fault%message)
      return
    end do
    call expect_true(error, pieces > 30, 'the run was not cut')
    call expect_same_file(error, 'history.csv')
    call expect_same_file(error, 'strip_000000.vtu')
    call expect_same_file(error, 'strip_000010.vtu')
  end subroutine test_restart

  !> Fail unless a file of both runs has the same bytes.
  subroutine expect_same_file(error, name)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: name
    integer(i1), allocatable :: a(:), b(:)

    if (allocated(error)) return
    call read_bytes(here//'/whole/'//name, a)
    call read_bytes(here//'/pieces/'//name, b)
    call expect_true(error, size(a) > 0 .and. size(a) == size(b), 'sizes of '//name)
    if (.not. allocated(error)) call expect_true(error, all(a == b), name//' differs')
  end subroutine expect_same_file

  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: peak = 'peak_stretch = 1.0e-4'//nl
    character(*), parameter :: energy = 'critical_energy_release_rate = 60.0'//nl

    call expect_refused(error, energy, '', "lacks the key 'peak_stretch'")
    call expect_refused(error, peak, '', 'needs critical_energy_release_rate')
    call expect_refused(error, peak//'critical_energy_release_rate = 1.0e-3'//nl, '', &
      & 'peak_stretch must be below s_c')
    call expect_refused(error, peak//'critical_stretch = 0.9e-4'//nl, '', &
      & 'must be above peak_stretch')
    call expect_refused(error, peak//energy//'break_in_compression = .true.'//nl, '', &
      & 'soften in tension alone')
    call expect_refused(error, peak//energy//'scatter = 10.0'//nl, '', "has no 'scatter'")
    call expect_refused(error, peak//energy, '&no_fail'//nl//"shape = 'box'"//nl// &
      & 'lower(1) = 0.04'//nl//'/'//nl, 'they soften before they break')
  end subroutine test_refused

  !> Fail unless a strip with these keys of `&material` and these groups is refused with a reason.
  subroutine expect_refused(error, keys, groups, reason)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: keys, groups, reason
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    call read_scene_text(strip_in_time('1.0', '1', '1.0e-6', keys)//groups, 'strip.nml', scene, &
      & fault)
    if (.not. allocated(fault)) call prepare_run(scene, set_up, fault)
    call expect_true(error, allocated(fault), 'not refused: '//reason)
    if (.not. allocated(fault)) return
    call expect_true(error, index(fault%message, reason) > 0, 'expected "'//reason//'": '// &
      & fault%message)
  end subroutine expect_refused

end module test_softening_cracks
