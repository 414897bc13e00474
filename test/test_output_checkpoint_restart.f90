!> Runs that are stopped and go on: their results are those of a run in one piece, bit for bit.
!>
!> With a limit of time that is over at once, a run stops after every step. So these runs are cut
!> wherever they can be.
module test_output_checkpoint_restart
  use pd_base_error, only: fault_type => error_type, status_input, status_interrupted
  use pd_base_kinds, only: wp, i1
  use pd_output_results_files, only: file_exists, make_directory, remove_file
  use pd_output_results_hdf5, only: close_file, hdf5_file, object_exists, open_file
  use pd_scene_content_types, only: scene_type, tip_group, unset
  use testdrive, only: check, error_type, new_unittest, unittest_type
  use bodies, only: expect_true
  use restarts, only: accept, expect_broken, expect_same_file, expect_same_results, here, plate, &
    & read_bytes, run, run_in_pieces, spacing
  implicit none (type, external)
  private
  public :: collect_output_checkpoint_restart

contains

  subroutine collect_output_checkpoint_restart(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a tip and fragments, cut after every step', test_measures), &
      & new_unittest('a running crack, cut after every step', test_crack), &
      & new_unittest('every integrator, cut after every step', test_integrators), &
      & new_unittest('on two threads', test_two_threads), &
      & new_unittest('a block in 3D', test_block), &
      & new_unittest('a list, bonds that break late', test_list), &
      & new_unittest('results beyond the checkpoint are removed', test_beyond), &
      & new_unittest('a finished run is prolonged', test_longer), &
      & new_unittest('a changed scene is refused', test_changed), &
      & new_unittest('from a damaged checkpoint to the older one', test_damaged), &
      & new_unittest('without a checkpoint from the beginning', test_none), &
      & new_unittest('into another folder with other fields', test_elsewhere), &
      & new_unittest('checkpoints by time, and never', test_minutes), &
      & new_unittest('a run continues after a failed checkpoint', test_failing)]
  end subroutine collect_output_checkpoint_restart

  !> What goes from row to row, and the table beside the results.
  subroutine test_measures(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces

    call plate(scene)
    scene%output%fragments = .true.
    scene%output%history_every = 1
    scene%time%steps = 60
    scene%tips = [tip_group(name='a', from=[0.0_wp, 6*spacing, unset], direction=[1.0_wp, 0.1_wp, &
      & unset])]
    call run(scene, 'whole', fault, threads=2)
    call accept(error, fault)
    call expect_broken(error, 'whole')
    if (allocated(error)) return
    call run_in_pieces(scene, 'pieces', 1, pieces, error)
    call expect_same_results(error, 'whole', 'pieces', 10)
    call expect_same_file(error, here//'/whole/fragments.csv', here//'/pieces/fragments.csv')
    ! rows that are written only because the run stops leave no trace
    scene%output%history_every = 4
    call run(scene, 'whole', fault)
    call accept(error, fault)
    if (allocated(error)) return
    call run_in_pieces(scene, 'pieces', 1, pieces, error)
    call expect_same_results(error, 'whole', 'pieces', 10)
    ! a tip cannot join later
    call run(scene, 'pieces', fault, minutes=1.0e-12_wp)
    scene%tips(1)%threshold = 0.4_wp
    call run(scene, 'pieces', fault, restart=.true.)
    call expect_true(error, allocated(fault), 'another tip goes on')
    if (allocated(error)) return
    call expect_true(error, index(fault%message, '&tip threshold') > 0, fault%message)
  end subroutine test_measures

  subroutine test_crack(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces

    call plate(scene)
    call run(scene, 'whole', fault, threads=2)
    call accept(error, fault)
    call expect_broken(error, 'whole')
    if (allocated(error)) return
    call run_in_pieces(scene, 'pieces', 1, pieces, error)
    if (allocated(error)) return
    call check(error, pieces, scene%time%steps + 1, 'pieces')
    call expect_same_results(error, 'whole', 'pieces', 6)
  end subroutine test_crack

  !> The whole on two threads, pieces on one: the steps of all rules have loops of their own.
  subroutine test_integrators(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: names(4) = [character(16) :: 'velocity_verlet', 'adams_bashforth', &
      & 'adams_moulton', 'runge_kutta']
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: i, pieces

    call plate(scene)
    scene%time%steps = 12
    scene%materials(1)%critical_stretch = 0.003_wp
    do i = 1, size(names)
      if (allocated(error)) return
      scene%time%integrator = names(i)
      call run(scene, 'whole', fault, threads=2)
      call accept(error, fault)
      call expect_broken(error, 'whole')
      if (allocated(error)) return
      call run_in_pieces(scene, 'pieces', 1, pieces, error)
      call expect_same_results(error, 'whole', 'pieces', 3)
    end do
  end subroutine test_integrators

  !> Pieces on two threads, the whole on one; a few steps, since threads that wait for a core make
  !> the start of every piece slow.
  subroutine test_two_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces

    call plate(scene)
    scene%time%steps = 8
    scene%materials(1)%critical_stretch = 0.002_wp
    call run(scene, 'whole', fault)
    call accept(error, fault)
    if (allocated(error)) return
    call run_in_pieces(scene, 'pieces', 2, pieces, error)
    call expect_same_results(error, 'whole', 'pieces', 3)
  end subroutine test_two_threads

  !> A block torn apart, on two threads in one piece and on one in pieces.
  subroutine test_block(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene, block
    type(fault_type), allocatable :: fault
    integer :: pieces

    call plate(scene)
    block = scene
    block%header%dimension = 3
    block%bodies(1)%lower = 0.0_wp
    block%bodies(1)%upper = [6.0_wp, 7.0_wp, 5.0_wp]*spacing
    block%bodies(1)%points = [6, 7, 5]
    deallocate (block%cracks)
    allocate (block%cracks(0))
    block%probes(1)%point = 0.0_wp
    block%materials(1)%critical_stretch = 0.002_wp
    block%time%steps = 9
    call run(block, 'whole', fault, threads=2)
    call accept(error, fault)
    call expect_broken(error, 'whole')
    if (allocated(error)) return
    call run_in_pieces(block, 'pieces', 1, pieces, error)
    call expect_same_results(error, 'whole', 'pieces', 3)
  end subroutine test_block

  subroutine test_list(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: pieces

    call plate(scene)
    scene%horizon%family = 'list'
    scene%materials(1)%model = 'bond_based'
    scene%materials(1)%poissons_ratio = 1.0_wp/3.0_wp
    scene%time%breaking = 'after_forces'
    scene%time%steps = 12
    scene%materials(1)%critical_stretch = 0.003_wp
    call run(scene, 'whole', fault)
    call accept(error, fault)
    call expect_broken(error, 'whole')
    if (allocated(error)) return
    call run_in_pieces(scene, 'pieces', 1, pieces, error)
    call expect_same_results(error, 'whole', 'pieces', 3)
  end subroutine test_list

  !> The older checkpoint of a run that came to its end: everything after it is computed again, in
  !> files that are longer, and trimmed.
  subroutine test_beyond(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call plate(scene)
    call run(scene, 'whole', fault)
    call accept(error, fault)
    scene%output%checkpoint_every = 11
    call run(scene, 'beyond', fault)
    call accept(error, fault)
    if (allocated(error)) return
    call run(scene, 'beyond', fault, restart=.true., &
      & checkpoint=here//'/beyond/plate.checkpoint.old')
    call accept(error, fault)
    call expect_same_results(error, 'whole', 'beyond', 6)
  end subroutine test_beyond

  !> 20 steps, then 30: the state after 20, which was an output as the last one, is none any more.
  subroutine test_longer(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call plate(scene)
    call run(scene, 'whole', fault)
    call accept(error, fault)
    scene%time%steps = 20
    scene%output%checkpoint_every = 100
    call run(scene, 'longer', fault)
    call accept(error, fault)
    call run(scene, 'longer', fault, restart=.true.)
    call accept(error, fault)
    call expect_true(error, file_exists(here//'/longer/plate_000003.vtu') .and. &
      & .not. file_exists(here//'/longer/plate_000004.vtu'), 'a complete run is left alone')
    scene%time%steps = 30
    call run(scene, 'longer', fault, restart=.true.)
    call accept(error, fault)
    call expect_same_results(error, 'whole', 'longer', 6)
    scene%time%steps = 25
    call run(scene, 'longer', fault, restart=.true.)
    call expect_true(error, allocated(fault), 'a run was made shorter')
  end subroutine test_longer

  subroutine test_changed(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene, other
    type(fault_type), allocatable :: fault

    call plate(scene)
    call run(scene, 'changed', fault, minutes=1.0e-12_wp)
    other = scene
    other%materials(1)%density = 7000.0_wp
    other%boundaries = scene%boundaries(:2)
    other%output%every = 3
    call run(other, 'changed', fault, restart=.true.)
    call expect_true(error, allocated(fault), 'a changed scene goes on')
    if (allocated(error)) return
    call check(error, fault%status, status_input)
    call expect_true(error, index(fault%message, '&material density: 7850.0 -> 7000.0') > 0 .and. &
      & index(fault%message, '&boundary number 3: gone') > 0 .and. &
      & index(fault%message, 'every: ') == 0, fault%message)
    other = scene
    other%output%every = 3
    other%header%title = 'another title'
    call run(other, 'changed', fault, restart=.true.)
    call accept(error, fault)
    if (allocated(error)) return
    call run(other, 'whole', fault)
    call expect_same_results(error, 'whole', 'changed', 11)
  end subroutine test_changed

  !> A byte is changed in the newest: it is refused and the older one is offered, which leads to the
  !> same end, and is whole as long as the next one isn't.
  subroutine test_damaged(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: newest = here//'/damaged/plate.checkpoint'
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer(i1), allocatable :: bytes(:)
    integer :: unit

    call plate(scene)
    call run(scene, 'whole', fault)
    call run(scene, 'damaged', fault, minutes=1.0e-12_wp)
    call run(scene, 'damaged', fault, restart=.true., minutes=1.0e-12_wp)
    call read_bytes(newest, bytes)
    call check(error, size(bytes) > 1000, 'no checkpoint')
    if (allocated(error)) return
    bytes(size(bytes)/2) = not(bytes(size(bytes)/2))
    open (newunit=unit, file=newest, access='stream', form='unformatted', action='write')
    write (unit) bytes
    close (unit)
    call run(scene, 'damaged', fault, restart=.true.)
    call expect_true(error, allocated(fault), 'a damaged checkpoint is taken')
    if (allocated(error)) return
    call expect_true(error, index(fault%message, 'checksum') > 0 .and. &
      & index(fault%message, '--restart '//newest//'.old') > 0, fault%message)
    call run(scene, 'damaged', fault, restart=.true., minutes=1.0e-12_wp, checkpoint=newest//'.old')
    call expect_true(error, allocated(fault), 'the older one is refused')
    if (allocated(error)) return
    call check(error, fault%status, status_interrupted)
    call read_bytes(newest//'.old', bytes)
    call run(scene, 'damaged', fault, restart=.true., checkpoint=newest//'.old', &
      & minutes=1.0e-12_wp)
    call expect_true(error, fault%status == status_interrupted, 'the older one was overwritten')
    call run(scene, 'damaged', fault, restart=.true.)
    call accept(error, fault)
    call expect_same_results(error, 'whole', 'damaged', 6)
  end subroutine test_damaged

  !> An empty folder; results of a run that was stopped without a checkpoint; complete ones; those
  !> of another scene.
  subroutine test_none(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: newest = here//'/none/plate.checkpoint'
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call plate(scene)
    call run(scene, 'whole', fault)
    call remove_file(here//'/none/plate.vtkhdf')
    call remove_file(here//'/none/plate.pvd')
    call remove_file(here//'/none/history.csv')
    call run(scene, 'none', fault, restart=.true., minutes=1.0e-12_wp)
    call expect_true(error, file_exists(newest), 'no checkpoint')
    call remove_file(newest)
    call run(scene, 'none', fault, restart=.true.)
    call accept(error, fault)
    call expect_same_results(error, 'whole', 'none', 6)
    call expect_true(error, .not. file_exists(newest), 'a short run leaves a checkpoint')
    call run(scene, 'none', fault, restart=.true.)
    call accept(error, fault)
    scene%materials(1)%density = 7000.0_wp
    call run(scene, 'none', fault, restart=.true.)
    call expect_true(error, allocated(fault), 'results of another scene are taken for its own')
    call expect_same_results(error, 'whole', 'none', 6)
    call run(scene, 'none', fault, restart=.true., checkpoint=here//'/none/such')
    call expect_true(error, allocated(fault), 'a checkpoint that is not there')
  end subroutine test_none

  !> Other fields do not fit into the files that are there, but another folder takes them, with the
  !> whole history.
  subroutine test_elsewhere(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: path = here//'/elsewhere/plate.vtkhdf'
    character(1000) :: line
    real(wp) :: step
    integer :: unit
    type(scene_type) :: scene, other
    type(fault_type), allocatable :: fault
    type(hdf5_file) :: file

    call plate(scene)
    call run(scene, 'whole', fault)
    scene%output%checkpoint_every = 10
    call run(scene, 'from', fault)
    other = scene
    other%output%fields = [character(64) :: 'dilatation']
    call run(other, 'from', fault, restart=.true., checkpoint=here//'/from/plate.checkpoint.old')
    call expect_true(error, allocated(fault), 'other fields in the same file')
    ! the rows before have other columns: the history begins at the checkpoint
    scene%probes(1)%fields = [character(64) :: 'velocity']
    call remove_file(here//'/less/plate.vtkhdf')
    call remove_file(here//'/less/plate.pvd')
    call remove_file(here//'/less/history.csv')
    call run(scene, 'less', fault, restart=.true., checkpoint=here//'/from/plate.checkpoint.old')
    call accept(error, fault)
    if (allocated(error)) return
    open (newunit=unit, file=here//'/less/history.csv', action='read')
    read (unit, '(a)') line
    read (unit, *) step
    close (unit)
    call expect_true(error, index(line, 'velocity') > 0 .and. step > 10.0_wp, &
      & 'other columns: '//line)
    call remove_file(path)
    call remove_file(here//'/elsewhere/plate.pvd')
    call remove_file(here//'/elsewhere/history.csv')
    call run(other, 'elsewhere', fault, restart=.true., &
      & checkpoint=here//'/from/plate.checkpoint.old')
    call accept(error, fault)
    call expect_same_file(error, here//'/whole/history.csv', here//'/elsewhere/history.csv')
    call open_file(path, .false., file, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call expect_true(error, object_exists(file, '/VTKHDF/PointData/dilatation') .and. &
      & object_exists(file, '/points/volume'), 'what is in the file')
    call close_file(file, fault)
  end subroutine test_elsewhere

  !> Minutes that are over at once give checkpoints, the last of which is that of the end; without
  !> minutes there are none, but for an interruption.
  subroutine test_minutes(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: newest = here//'/minutes/plate.checkpoint'
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call plate(scene)
    scene%time%steps = 5
    scene%output%checkpoint_minutes = 1.0e-12_wp
    call run(scene, 'minutes', fault)
    call accept(error, fault)
    call expect_true(error, file_exists(newest) .and. file_exists(newest//'.old'), 'by time')
    scene%output%checkpoint_minutes = 0.0_wp
    call run(scene, 'minutes', fault)
    call accept(error, fault)
    call expect_true(error, .not. file_exists(newest) .and. .not. file_exists(newest//'.old'), &
      & 'never, and those of the run before are gone')
    call run(scene, 'minutes', fault, minutes=1.0e-12_wp)
    call expect_true(error, file_exists(newest), 'when the run is stopped')
  end subroutine test_minutes

  !> A folder stands where the checkpoint is to be written.
  subroutine test_failing(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call plate(scene)
    call run(scene, 'whole', fault)
    call make_directory(here//'/failing/plate.checkpoint.part/x', fault)
    scene%output%checkpoint_every = 20
    call run(scene, 'failing', fault)
    call accept(error, fault)
    call expect_same_results(error, 'whole', 'failing', 6)
  end subroutine test_failing

end module test_output_checkpoint_restart
