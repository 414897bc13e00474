!> Threads: limits on processor time, what the user asked for, small bodies.
module test_base_threads
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i8
  use pd_base_system, only: processor_quota
  use pd_base_threads, only: default_threads, is_worth_threads, team_type
  use pd_driver, only: run_scene
  use pd_output_report_begin, only: run_options_type
  use pd_set_up_prepare, only: set_up_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_observer, only: instant_type, observer_type
  use pd_motion_system, only: system_type
  use pd_output_results_files, only: make_directory, remove_file
  use pd_output_results_sink, only: sink_type
  use pd_scene_content_types, only: scene_type
  use comparisons, only: max_abs
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  use bodies, only: prepare_run, box_scene, expect_true
  implicit none (type, external)
  private
  public :: collect_base_threads

  character(*), parameter :: here = 'build/test_base_threads'

  !> Takes another number of threads after every step, as many as listed, in turn.
  type, extends(observer_type) :: restless_type
    integer, allocatable :: threads(:)
  contains
    procedure :: observe
  end type restless_type

contains

  subroutine collect_base_threads(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('limits on processor time are found', test_quota), &
      & new_unittest('the number asked for is kept', test_asked), &
      & new_unittest('a small body has one thread', test_small), &
      & new_unittest('a team that has not begun changes nothing', test_idle), &
      & new_unittest('a team gives back no more than it has', test_watching), &
      & new_unittest('the number may change at any step', test_bits), &
      & new_unittest('a run leaves the caller''s threads', test_caller)]
  end subroutine collect_base_threads

  subroutine observe(observer, system, instant, error)
    class(restless_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error
    if (system%body%n_points == 0) return
    call omp_set_num_threads(observer%threads(mod(instant%step, size(observer%threads)) + 1))
    if (allocated(error)) return
  end subroutine observe

  !> Control groups as Linux lays them out. Limits are "quota period" in us; cores are rounded up.
  subroutine test_quota(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: v2 = here//'/sys/fs/cgroup/a/b/cpu.max', &
      & parent = here//'/sys/fs/cgroup/a/cpu.max', v1 = here//'/sys/fs/cgroup/cpu/cpu.cfs_'

    call put('/proc/self/cgroup', '0::/a/b')
    call put('/sys/fs/cgroup/a/b/cpu.max', 'max 100000')
    call put('/sys/fs/cgroup/a/cpu.max', 'max 100000')
    call remove_file(v1//'quota_us')
    call expect_cores(huge(1), 'no limit')
    call put('/sys/fs/cgroup/a/b/cpu.max', '200000 100000')
    call expect_cores(2, 'two cores')
    call put('/sys/fs/cgroup/a/b/cpu.max', '250000 100000')
    call expect_cores(3, 'two and a half')
    call put('/sys/fs/cgroup/a/b/cpu.max', '1000 100000')
    call expect_cores(1, 'a hundredth')
    call put('/sys/fs/cgroup/a/b/cpu.max', '800000 100000')
    call put('/sys/fs/cgroup/a/cpu.max', '400000 100000')
    call expect_cores(4, 'the limit of the group above')
    call remove_file(v2)
    call remove_file(parent)
    call expect_cores(huge(1), 'no files')
    call put('/sys/fs/cgroup/cpu/cpu.cfs_quota_us', '-1')
    call put('/sys/fs/cgroup/cpu/cpu.cfs_period_us', '100000')
    call expect_cores(huge(1), 'version 1, no limit')
    call put('/sys/fs/cgroup/cpu/cpu.cfs_quota_us', '150000')
    call expect_cores(2, 'version 1, one and a half')
    call put('/sys/fs/cgroup/cpu/cpu.cfs_quota_us', 'nonsense')
    call expect_cores(huge(1), 'nonsense')

  contains

    subroutine put(path, text)
      character(*), intent(in) :: path, text
      type(sink_type) :: sink
      type(fault_type), allocatable :: fault
      if (allocated(error)) return
      call make_directory(here//path(:index(path, '/', back=.true.) - 1), fault)
      if (.not. allocated(fault)) call sink%open(here//path, fault)
      if (.not. allocated(fault)) call sink%put(text//new_line('a'), fault)
      if (.not. allocated(fault)) call sink%close(fault)
      if (allocated(fault)) call test_failed(error, fault%message)
    end subroutine put

    subroutine expect_cores(cores, what)
      integer, intent(in) :: cores
      character(*), intent(in) :: what
      if (allocated(error)) return
      call check(error, processor_quota(here), cores, what)
    end subroutine expect_cores
  end subroutine test_quota

  !> A number from the command line counts for any body, and stays during the run.
  subroutine test_asked(error)
    type(error_type), allocatable, intent(out) :: error
    type(team_type) :: team
    integer :: before, i

    before = omp_get_max_threads()
    call team%begin(3)
    call team%fit(10_i8, 3)
    do i = 1, 100000
      call team%look()
    end do
    i = omp_get_max_threads()
    call omp_set_num_threads(before)
    call check(error, i, 3, 'threads')
    if (allocated(error)) return
    call check(error, team%threads(), 3, 'threads that are told')
  end subroutine test_asked

  subroutine test_small(error)
    type(error_type), allocatable, intent(out) :: error
    type(team_type) :: team
    integer :: before, i

    call expect_true(error, is_worth_threads(40000_i8) .and. .not. is_worth_threads(39999_i8), &
      & 'the limit')
    before = omp_get_max_threads()
    call omp_set_num_threads(2)
    call team%begin(0)
    call team%fit(1000_i8, 0)
    i = omp_get_max_threads()
    call omp_set_num_threads(before)
    if (allocated(error)) return
    call check(error, i, 1, 'threads')
  end subroutine test_small

  subroutine test_idle(error)
    type(error_type), allocatable, intent(out) :: error
    type(team_type) :: team
    integer :: before, i

    before = omp_get_max_threads()
    call omp_set_num_threads(2)
    do i = 1, 1000
      call team%look()
    end do
    call team%pause()
    i = omp_get_max_threads()
    call omp_set_num_threads(before)
    call check(error, i, 2, 'threads')
    if (allocated(error)) return
    call expect_true(error, team%report() == '', team%report())
  end subroutine test_idle

  !> However busy the machine is: the team has between one and the default number of threads.
  subroutine test_watching(error)
    type(error_type), allocatable, intent(out) :: error
    type(team_type) :: team
    integer :: before, most, least, greatest, i

    before = omp_get_max_threads()
    call omp_set_num_threads(2)
    most = default_threads()
    call team%begin(0)
    call team%fit(1000000_i8, 0)
    least = most
    greatest = 0
    do i = 1, 2000000
      call team%look()
      least = min(least, omp_get_max_threads())
      greatest = max(greatest, omp_get_max_threads())
    end do
    call omp_set_num_threads(before)
    call expect_true(error, least >= 1 .and. greatest <= most .and. greatest >= 1, 'threads')
    if (allocated(error)) return
    call check(error, team%threads(), most, 'threads that are told')
  end subroutine test_watching

  !> A plate whose number of threads changes at every step has the bits of one on a single thread.
  subroutine test_bits(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(restless_type) :: observer
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: u(:, :)
    integer :: before, turn

    before = omp_get_max_threads()
    do turn = 1, 2
      call box_scene([40, 40], 1.0e-3_wp, 0.2_wp, scene)
      deallocate (scene%loads)
      allocate (scene%loads(1))
      scene%loads(1)%side = 'x_max'
      scene%loads(1)%pressure = -1.0e6_wp
      scene%time%steps = 12
      call prepare_run(scene, set_up, fault)
      if (allocated(fault)) exit
      observer%threads = [1]
      if (turn == 2) observer%threads = [2, 1, 3, 4, 2]
      call run_explicit(set_up%system, 'forward_backward', set_up%plan%step, 12, observer, fault)
      if (allocated(fault)) exit
      if (turn == 1) u = set_up%system%state%u
    end do
    call omp_set_num_threads(before)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
    else
      call expect_true(error, max_abs(u) > 0.0_wp .and. &
        & all(abs(u - set_up%system%state%u) <= 0.0_wp), 'other bits')
    end if
  end subroutine test_bits

  subroutine test_caller(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(fault_type), allocatable :: fault
    integer :: before, i, after(2)

    before = omp_get_max_threads()
    options%output_directory = here//'/run'
    options%quiet = .true.
    options%overwrite = .true.
    do i = 1, 2
      call box_scene([6, 5], 1.0e-3_wp, 0.2_wp, scene)
      ! the second one is refused
      if (i == 2) scene%horizon%ratio = 1.0e9_wp
      options%threads = i - 1
      call omp_set_num_threads(3)
      call run_scene(scene, options, fault)
      after(i) = omp_get_max_threads()
    end do
    call omp_set_num_threads(before)
    call expect_true(error, allocated(fault) .and. all(after == 3), 'threads of the caller')
  end subroutine test_caller

end module test_base_threads
