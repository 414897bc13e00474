!> Checkpoints that ranks of another number have written: what the reader puts together, and runs
!> that go on from files of two ranks, which are made here from those of one.
module test_output_checkpoint_merger
  use pd_base_archive, only: archive_type, joined, of_slots, same
  use pd_base_checksum, only: parts_of, value_of
  use pd_base_error, only: fault_type => error_type, status_interrupted
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_body_body, only: own_points, owned
  use pd_motion_keep, only: checksum_of_points, keep_system
  use pd_motion_system, only: system_type
  use pd_output_checkpoint_checkpoint, only: about_type, keep_about, open_about
  use pd_output_checkpoint_file, only: meter_type, reader_type, writer_type
  use pd_output_checkpoint_merger, only: merger_type, part_path_type
  use pd_output_results_files, only: file_exists, make_directory, remove_file, rename_file
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: set_up_type
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: expect_true, ready
  use restarts, only: accept, expect_broken, expect_same_results, here, plate, run, slow_plate
  implicit none (type, external)
  private
  public :: collect_output_checkpoint_merger

  character(*), parameter :: folder = 'build/test_output_checkpoint_merger'
  integer, parameter :: points = 7       !! of the files of two or three ranks
  real(wp), parameter :: garbage = 1.0e30_wp

  !> What a rank keeps.
  type :: values_type
    integer(i8), allocatable :: keys(:)     !! of its rows
    logical, allocatable :: own(:)
    integer(i8), allocatable :: few(:)      !! of a list
    logical, allocatable :: few_own(:)
    real(wp), allocatable :: table(:, :), none(:, :), list(:), absent(:)
    integer(i1), allocatable :: flags(:)
    integer(i8), allocatable :: links(:, :)
    real(wp) :: scalar = 0.0_wp
  end type values_type

contains

  subroutine collect_output_checkpoint_merger(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('rows come from the ranks that own them', test_rows), &
      & new_unittest('files that do not fit together', test_misfits), &
      & new_unittest('sums of checksums in parts', test_parts), &
      & new_unittest('an explicit run goes on from two ranks', test_explicit), &
      & new_unittest('static equilibrium goes on from two ranks', test_static), &
      & new_unittest('which files count', test_choice)]
  end subroutine collect_output_checkpoint_merger

  ! ---------------------------------------------------------------- files of a few values

  subroutine keep_values(archive, values)
    class(archive_type), intent(inout) :: archive
    type(values_type), intent(inout) :: values

    call archive%name_rows(of_slots, values%keys, values%own)
    call archive%over(of_slots)
    call archive%keep('a table', values%table)
    call archive%keep('none', values%none)
    call archive%keep('flags', values%flags)
    call archive%over(same)
    if (.not. archive%merges) call archive%keep('bits of this rank', values%scalar)
    call archive%over(joined)
    call archive%keep('links', values%links)
    call archive%over(same)
    call archive%keep('a scalar', values%scalar)
    call archive%name_rows('few', values%few, values%few_own)
    call archive%over('few')
    call archive%keep('a list', values%list)
    call archive%keep('absent', values%absent)
    call archive%over(same)
    call archive%keep('the last', values%scalar)
  end subroutine keep_values

  !> What a rank has: rows of `keys`, dead ones among them, of which it owns those of `mine`.
  function values_of(keys, mine) result(values)
    integer, intent(in) :: keys(:), mine(:)
    type(values_type) :: values
    integer :: i, n

    n = size(keys)
    values%keys = int(keys, i8)
    values%own = [(any(mine == keys(i)), i=1, n)]
    allocate (values%table(n, 2), values%flags(n), values%none(0, 2))
    do i = 1, n
      values%table(i, :) = merge([keys(i) + 0.25_wp, -real(keys(i), wp)], garbage, values%own(i))
      values%flags(i) = merge(int(keys(i), i1), 99_i1, values%own(i))
    end do
    values%few = pack(int(keys, i8), mod(keys, 2) == 1)
    values%few_own = pack(values%own, mod(keys, 2) == 1)
    values%list = merge(10.0_wp*values%few, garbage, values%few_own)
    values%links = reshape([-int(mine(1), i8), int(mine, i8)], [size(mine) + 1, 1])
    values%scalar = 3.5_wp
  end function values_of

  subroutine write_values(values, path, error)
    type(values_type), intent(inout) :: values
    character(*), intent(in) :: path
    type(error_type), allocatable, intent(inout) :: error
    type(meter_type) :: meter
    type(writer_type) :: writer
    type(fault_type), allocatable :: fault

    call make_directory(folder, fault)
    call keep_values(meter, values)
    call writer%create(path, meter%bytes)
    call keep_values(writer, values)
    call writer%finish(fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine write_values

  !> Files of two ranks: points 1 to 4 and 5 to 7, with copies and dead slots.
  subroutine write_two(paths, error)
    type(part_path_type), intent(out) :: paths(2)
    type(error_type), allocatable, intent(inout) :: error
    type(values_type) :: values

    paths(1)%path = folder//'/a.rank-0.checkpoint'
    paths(2)%path = folder//'/a.rank-1.checkpoint'
    values = values_of([0, 2, 1, 3, 4, 0, 5], [1, 2, 3, 4])
    call write_values(values, paths(1)%path, error)
    values = values_of([4, 5, 7, 6, 0], [5, 6, 7])
    call write_values(values, paths(2)%path, error)
  end subroutine write_two

  !> Read them on one rank that has all points, and on one that has some.
  subroutine test_rows(error)
    type(error_type), allocatable, intent(out) :: error
    type(part_path_type) :: paths(2)

    call write_two(paths, error)
    if (allocated(error)) return
    call read_by([7, 6, 5, 4, 3, 2, 1], 9)
    call read_by([0, 3, 0, 4, 5], 9)
    call read_by([6, 7], 9)            ! the first rank's file has none of them
    call read_by([2, 1], 5)            ! the second's file is not needed

  contains

    subroutine read_by(keys, links)
      integer, intent(in) :: keys(:), links
      type(merger_type) :: merger
      type(values_type) :: values
      integer :: i

      if (allocated(error)) return
      values%keys = int(keys, i8)
      allocate (values%own(size(keys)), source=.true.)
      values%few = [pack(int(keys, i8), mod(keys, 2) == 1), -2_i8]
      allocate (values%few_own(size(values%few)), source=.true.)
      allocate (values%table(size(keys), 2), source=garbage)
      call merger%open(paths)
      call keep_values(merger, values)
      call merger%close()
      if (allocated(merger%error)) call test_failed(error, merger%error%message)
      if (allocated(error)) return
      do i = 1, size(keys)
        call expect_true(error, abs(values%table(i, 1) - merge(keys(i) + 0.25_wp, 0.0_wp, &
          & keys(i) > 0)) <= 0.0_wp .and. abs(values%table(i, 2) + keys(i)) <= 0.0_wp, 'the table')
        call expect_true(error, int(values%flags(i)) == keys(i), 'the flags')
      end do
      call expect_true(error, all(abs(values%list - merge(10.0_wp*values%few, 0.0_wp, &
        & values%few > 0_i8)) <= 0.0_wp) .and. size(values%list) == size(values%few), 'the list')
      call expect_true(error, size(values%none, 1) == 0 .and. .not. allocated(values%absent) .and. &
        & abs(values%scalar - 3.5_wp) <= 0.0_wp, 'other values')
      call expect_true(error, size(values%links) == links .and. values%links(1, 1) < 0_i8, &
        & 'what is joined')
    end subroutine read_by
  end subroutine test_rows

  subroutine test_misfits(error)
    type(error_type), allocatable, intent(out) :: error
    type(part_path_type) :: paths(2)
    type(values_type) :: values

    call write_two(paths, error)
    if (allocated(error)) return
    call expect_error([1, 2, 8], 2, 'a point that no file has')
    values = values_of([4, 5, 7, 6, 0], [5, 6, 7])
    deallocate (values%table)
    allocate (values%table(5, 3), source=1.0_wp)
    call write_values(values, paths(2)%path, error)
    call expect_error([1, 7], 2, 'another number of columns')
    values = values_of([4, 5, 7, 6, 0], [5, 6, 7])
    deallocate (values%none)
    allocate (values%none(3, 2), source=1.0_wp)
    call write_values(values, paths(2)%path, error)
    call expect_error([1, 7], 2, 'another number of rows')
    call remove_file(paths(2)%path)
    call expect_error([1, 7], 2, 'a file that is missing')

  contains

    subroutine expect_error(keys, columns, what)
      integer, intent(in) :: keys(:), columns
      character(*), intent(in) :: what
      type(merger_type) :: merger
      type(values_type) :: here

      here = values_of(keys, keys)
      here%few = [1_i8]
      here%few_own = [.true.]
      deallocate (here%list, here%table, here%none)
      allocate (here%table(size(keys), columns))
      call merger%open(paths)
      call keep_values(merger, here)
      call merger%close()
      call expect_true(error, allocated(merger%error), 'accepted: '//what)
    end subroutine expect_error
  end subroutine test_misfits

  subroutine test_parts(error)
    type(error_type), allocatable, intent(out) :: error
    integer(i8), parameter :: some(4) = [-1_i8, 2_i8**62, not(huge(1_i8)), 4711_i8]
    real(wp) :: parts(4)
    integer :: i

    parts = 0.0_wp
    do i = 1, size(some)
      call expect_true(error, value_of(parts_of(some(i))) == some(i), 'one number')
      parts = parts + parts_of(some(i))
    end do
    ! -1 + 2^62 - 2^63 + 4711 has no carry beyond the range
    call expect_true(error, value_of(parts) == 4710_i8 - 2_i8**62, 'the sum')
    call expect_true(error, value_of(parts_of(-1_i8) + parts_of(-1_i8)) == -2_i8, 'modulo 2^64')
  end subroutine test_parts

  ! ---------------------------------------------------------------- files of runs

  !> Make files of two ranks from the checkpoint of a run on one: the first has the lower half of
  !> the points, the other one the rest. Values of copies are made useless.
  subroutine split(scene, name, error)
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: name
    type(error_type), allocatable, intent(inout) :: error
    character(:), allocatable :: stem
    type(set_up_type) :: set_up
    type(reader_type) :: reader
    type(about_type) :: about
    type(fault_type), allocatable :: fault
    integer :: r

    if (allocated(error)) return
    stem = here//'/'//name//'/plate'
    do r = 0, 1
      call ready(scene, set_up, error)
      if (allocated(error)) return
      about = about_type()
      call open_about(stem//'.checkpoint', reader, about, fault)
      call accept(error, fault)
      if (allocated(error)) return
      call expect_true(error, about%points == checksum_of_points(set_up%system), &
        & 'the checksum of the points')
      call keep_system(reader, set_up%system)
      call reader%close()
      if (allocated(reader%error)) call test_failed(error, reader%error%message)
      call take_half(set_up%system, r)
      about%ranks = 2
      call write_part(about, set_up%system, stem//merge('.rank-0', '.rank-1', r == 0)// &
        & '.checkpoint', error)
      if (allocated(error)) return
    end do
    call remove_file(stem//'.checkpoint')
    call remove_file(stem//'.checkpoint.old')
  end subroutine split

  !> Let a system own a half of its points.
  subroutine take_half(system, r)
    type(system_type), intent(inout) :: system
    integer, intent(in) :: r   !! 0: the lower half
    integer(i4), allocatable :: slot(:)
    integer :: n, half, i, k

    associate (body => system%body)
      n = body%n_points
      half = n/2
      slot = body%slot
      if (r == 1) slot = cshift(slot, half)
      body%slot = slot
      do i = 1, n
        body%point(body%slot(i)) = int(i, i4)
      end do
      call own_points(body, merge(half, n - half, r == 0), cshift([(int(i, i8), i=1, n)], &
        & r*half), int(n, i8))
      do k = 1, body%n_slots
        if (owned(body, k)) cycle
        system%state%u(k, :) = garbage
        system%state%v(k, :) = garbage
        system%state%force(k, :) = garbage
        if (size(system%state%damage) > 0) system%state%damage(k) = garbage
        if (allocated(system%memory%v)) system%memory%v(k, :, :) = garbage
        if (allocated(system%memory%a)) system%memory%a(k, :, :) = garbage
        if (allocated(system%memory%rate)) system%memory%rate(k, :) = garbage
      end do
    end associate
  end subroutine take_half

  subroutine write_part(about, system, path, error)
    type(about_type), intent(inout) :: about
    type(system_type), intent(inout) :: system
    character(*), intent(in) :: path
    type(error_type), allocatable, intent(inout) :: error
    type(meter_type) :: meter
    type(writer_type) :: writer
    type(fault_type), allocatable :: fault

    call keep_about(meter, about)
    call keep_system(meter, system)
    call writer%create(path, meter%bytes)
    call keep_about(writer, about)
    call keep_system(writer, system)
    call writer%finish(fault)
    call accept(error, fault)
  end subroutine write_part

  !> On lattices and lists, with bonds that have broken, loads on constrained points, and imposed
  !> velocities that are expressions of t.
  subroutine test_explicit(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: integrators(3) = [character(16) :: 'forward_backward', &
      & 'velocity_verlet', 'adams_bashforth']
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: way

    do way = 1, 3
      call plate(scene)
      scene%time%integrator = integrators(way)
      scene%boundaries(1)%velocity_text(2) = '-40*exp(1e4*t)*(1 + x)'
      if (way == 2) scene%horizon%family = 'list'
      call run(scene, 'merger/whole', fault)
      call accept(error, fault)
      call expect_broken(error, 'merger/whole')
      if (allocated(error)) return
      scene%time%steps = 18
      scene%output%checkpoint_every = 100
      call run(scene, 'merger/parts', fault)
      call accept(error, fault)
      call expect_broken(error, 'merger/parts')
      call split(scene, 'merger/parts', error)
      scene%time%steps = 30
      call run(scene, 'merger/parts', fault, restart=.true.)
      call accept(error, fault)
      if (allocated(error)) return
      call expect_same_results(error, 'merger/whole', 'merger/parts', 6)
    end do
  end subroutine test_explicit

  !> By both solvers, from within a load step.
  subroutine test_static(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    integer :: way, piece

    do way = 1, 2
      call slow_plate(scene)
      if (way == 2) scene%relaxation%solver = 'dynamic_relaxation'
      scene%relaxation%load_steps = 2
      call run(scene, 'merger/whole', fault)
      call accept(error, fault)
      do piece = 1, 7
        if (allocated(error)) return
        call run(scene, 'merger/parts', fault, restart=piece > 1, minutes=1.0e-12_wp)
        call expect_true(error, allocated(fault), 'it ends too soon')
        if (allocated(error)) return
        call expect_true(error, fault%status == status_interrupted, fault%message)
      end do
      call split(scene, 'merger/parts', error)
      call run(scene, 'merger/parts', fault, restart=.true.)
      call accept(error, fault)
      if (allocated(error)) return
      call expect_same_results(error, 'merger/whole', 'merger/parts', 3)
    end do
  end subroutine test_static

  !> Files of two ranks beside those of one: those of the higher step count, if both are there.
  subroutine test_choice(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: stem = here//'/merger/choice/plate'
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    logical :: gone

    call plate(scene)
    call run(scene, 'merger/whole', fault)
    scene%time%steps = 18
    scene%output%checkpoint_every = 9
    call run(scene, 'merger/choice', fault)
    call accept(error, fault)
    call split(scene, 'merger/choice', error)
    if (allocated(error)) return
    ! one is missing
    call rename_file(stem//'.rank-1.checkpoint', stem//'.away', fault)
    scene%time%steps = 30
    call run(scene, 'merger/choice', fault, restart=.true.)
    call expect_true(error, allocated(fault), 'a half is taken for the whole')
    if (allocated(error)) return
    call expect_true(error, index(fault%message, 'no set of checkpoints') > 0 .and. &
      & index(fault%message, 'rank 1 is missing') > 0, fault%message)
    ! one is named
    call run(scene, 'merger/choice', fault, restart=.true., checkpoint=stem//'.rank-0.checkpoint')
    call expect_true(error, allocated(fault), 'a part is taken for the whole')
    if (allocated(error)) return
    call expect_true(error, index(fault%message, 'a part of the points') > 0, fault%message)
    ! both are there
    call rename_file(stem//'.away', stem//'.rank-1.checkpoint', fault)
    scene%time%steps = 24
    scene%output%checkpoint_every = 100
    call run(scene, 'merger/choice', fault, restart=.true.)
    call accept(error, fault)
    call expect_true(error, file_exists(stem//'.checkpoint') .and. &
      & file_exists(stem//'.rank-0.checkpoint'), 'the older set has not stayed')
    ! the one of one rank is of a higher step; with the second one those of two ranks go
    scene%time%steps = 30
    scene%output%checkpoint_every = 3
    call run(scene, 'merger/choice', fault, restart=.true.)
    call accept(error, fault)
    if (allocated(error)) return
    gone = .not. (file_exists(stem//'.rank-0.checkpoint') .or. &
      & file_exists(stem//'.rank-1.checkpoint'))
    call expect_true(error, gone .and. file_exists(stem//'.checkpoint.old'), 'files of two ranks')
    call expect_same_results(error, 'merger/whole', 'merger/choice', 6)
  end subroutine test_choice

end module test_output_checkpoint_merger
