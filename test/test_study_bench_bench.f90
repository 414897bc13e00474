!> The benchmark: what it counts, its table and its CSV file. Times are only asked to be positive.
module test_study_bench_bench
  use bodies, only: prepare_run, expect, expect_true, text_of
  use omp_lib, only: omp_get_max_threads
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i8
  use pd_set_up_prepare, only: set_up_type
  use pd_force_model, only: no_dilatation, projected, unprojected
  use pd_output_results_files, only: file_exists, remove_file
  use pd_scene_content_types, only: scene_type
  use pd_study_bench_bench, only: plan_kernels, run_bench, thread_counts
  use pd_study_bench_kernels, only: bytes_needed, bytes_of_step, flops_of_bond, kernel_type, &
    & measure_kernel, standard_scene, timing_type
  use pd_base_system, only: available_memory, processor_name
  use pd_study_bench_machine, only: machine_type, measure_machine
  use pd_study_bench_options, only: bench_options_type, check_options
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_study_bench_bench

  integer, parameter :: line_length = 600
  character(*), parameter :: file = 'test_study_bench_bench.csv'

contains

  subroutine collect_study_bench_bench(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a measurement counts points and bonds', test_counts), &
      & new_unittest('bodies move only slightly', test_motion), &
      & new_unittest('operations and bytes by the formulas', test_formulas), &
      & new_unittest('memory is predicted as an upper bound', test_memory), &
      & new_unittest('the machine is measured', test_machine), &
      & new_unittest('default and chosen measurements', test_plan), &
      & new_unittest('threads: ascending, once, with 1', test_threads), &
      & new_unittest('wrong options are errors', test_options), &
      & new_unittest('table and CSV file of a whole run', test_files), &
      & new_unittest('a file that cannot be written', test_no_file), &
      & new_unittest('a body that does not fit', test_too_large)]
  end subroutine collect_study_bench_bench

  !> Bonds against a count by the family's own `bonds_of`, in every kind of kernel.
  subroutine test_counts(error)
    type(error_type), allocatable, intent(out) :: error
    type(kernel_type) :: kernel
    type(timing_type) :: timing
    type(fault_type), allocatable :: fault
    integer :: d, f, b, before

    before = omp_get_max_threads()
    do d = 1, 3
      do f = 1, 2
        do b = 1, 2
          kernel%dimension = d
          kernel%points = 12 - 2*d
          kernel%model = merge('state_based     ', 'bond_based      ', b == 1)
          kernel%family = merge('lattice         ', 'list            ', f == 1)
          kernel%breaking = b == 2
          call measure_kernel(kernel, 0.002_wp, timing, fault)
          if (allocated(fault)) then
            call test_failed(error, fault%message)
            return
          end if
          call expect(error, real(timing%points, wp), real(kernel%points**d, wp), 0.0_wp, 'points')
          call expect(error, real(timing%bonds, wp), real(bonds_by_hand(d, kernel%points), wp), &
            & 0.0_wp, 'bonds')
          call expect_true(error, timing%steps >= 1 .and. timing%repeats >= 5, 'steps and repeats')
          call expect_true(error, timing%seconds > 0.0_wp .and. timing%build > 0.0_wp &
            & .and. timing%forces > 0.0_wp .and. timing%processor > 0.0_wp, 'times are positive')
          call expect_true(error, timing%least <= timing%seconds .and. &
            & timing%seconds <= timing%most, 'the median lies between least and most')
          call expect_true(error, timing%bytes > 100*timing%points, 'bytes of a point')
          if (allocated(error)) return
        end do
      end do
    end do
    call expect(error, real(omp_get_max_threads(), wp), real(before, wp), 0.0_wp, &
      & 'threads afterwards as before')
  end subroutine test_counts

  !> Ordered pairs of points no more than 3.015 spacings apart.
  pure integer(i8) function bonds_by_hand(dim, n) result(bonds)
    integer, intent(in) :: dim, n
    integer :: i, j, k, ny, nz

    ny = merge(3, 0, dim > 1)
    nz = merge(3, 0, dim > 2)
    bonds = 0_i8
    do k = -nz, nz
      do j = -ny, ny
        do i = -3, 3
          if (i**2 + j**2 + k**2 > 9 .or. (i == 0 .and. j == 0 .and. k == 0)) cycle
          bonds = bonds + int(n - abs(i), i8)*merge(n - abs(j), 1, dim > 1) &
            & *merge(n - abs(k), 1, dim > 2)
        end do
      end do
    end do
  end function bonds_by_hand

  !> The loops must be measured on what scenes are: moving, everywhere, at small strain.
  subroutine test_motion(error)
    type(error_type), allocatable, intent(out) :: error
    type(kernel_type) :: kernel
    type(timing_type) :: timing
    type(fault_type), allocatable :: fault

    kernel%points = 9
    kernel%breaking = .true.
    call measure_kernel(kernel, 0.02_wp, timing, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    call expect_true(error, timing%strain > 1.0e-9_wp, 'nothing moves')
    call expect_true(error, timing%strain < 1.0e-3_wp, 'moves too much: '//text_of(timing%strain))
  end subroutine test_motion

  !> Counted by hand for the 3D and 2D lattice, and what must hold for all.
  subroutine test_formulas(error)
    type(error_type), allocatable, intent(out) :: error
    type(kernel_type) :: kernel
    type(set_up_type) :: set_up

    kernel%points = 8
    call build(error, kernel, set_up)
    if (allocated(error)) return
    associate (system => set_up%system)
      call expect(error, flops_of_bond(system%family, system%workspace, unprojected), 43.0_wp, &
        & 0.0_wp, '3D state-based')
      call expect(error, flops_of_bond(system%family, system%workspace, projected), 45.5_wp, &
        & 0.0_wp, '3D state-based, projected')
      call expect(error, flops_of_bond(system%family, system%workspace, no_dilatation), 23.5_wp, &
        & 0.0_wp, '3D bond-based')
      ! u 3, p 1; u 3, p 1, force 3; force 3, u 3, v 3 read, u 3, v 3 written; sums for both ends of
      ! a bond: force 3 and p 1 set to zero, force 3 read, p read and written to scale it
      call expect(error, bytes_of_step(system), 512*8*35.0_wp, 0.0_wp, 'bytes, 3D state-based')
    end associate
    kernel%model = 'bond_based'
    kernel%dimension = 2
    call build(error, kernel, set_up)
    if (allocated(error)) return
    associate (system => set_up%system)
      call expect(error, flops_of_bond(system%family, system%workspace, no_dilatation), 18.5_wp, &
        & 0.0_wp, '2D bond-based')
      ! u 2, force 2; force 2, u 2, v 2 read, u 2, v 2 written; force 2 set to zero and read for
      ! both ends of a bond
      call expect(error, bytes_of_step(system), 64*8*18.0_wp, 0.0_wp, 'bytes, 2D bond-based')
    end associate
    kernel%family = 'list'
    call build(error, kernel, set_up)
    if (allocated(error)) return
    associate (system => set_up%system)
      ! no eight clusters share tables
      call expect(error, flops_of_bond(system%family, system%workspace, no_dilatation), 43.0_wp, &
        & 0.0_wp, '2D bond-based list')
      ! a member of a cluster, six bytes, has at most eight bonds
      call expect_true(error, bytes_of_step(system) > 64*8*14.0_wp &
        & + 6*system%family%n_bonds/8.0_wp, 'a list moves its members, too')
    end associate
  end subroutine test_formulas

  subroutine build(error, kernel, set_up)
    type(error_type), allocatable, intent(inout) :: error
    type(kernel_type), intent(in) :: kernel
    type(set_up_type), intent(out) :: set_up
    type(fault_type), allocatable :: fault
    type(scene_type) :: scene

    if (allocated(error)) return
    call standard_scene(kernel, scene)
    call prepare_run(scene, set_up, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine build

  !> More than what the arrays take in the end, but not ten times as much.
  subroutine test_memory(error)
    type(error_type), allocatable, intent(out) :: error
    type(kernel_type) :: kernel
    type(timing_type) :: timing
    type(fault_type), allocatable :: fault
    integer :: f

    kernel%dimension = 2
    kernel%points = 150
    do f = 1, 2
      kernel%family = merge('lattice         ', 'list            ', f == 1)
      call measure_kernel(kernel, 0.001_wp, timing, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      call expect_true(error, bytes_needed(kernel) >= timing%bytes, kernel%family//': too little')
      call expect_true(error, bytes_needed(kernel) < 10*real(timing%bytes, wp), &
        & kernel%family//': too much')
    end do
  end subroutine test_memory

  subroutine test_machine(error)
    type(error_type), allocatable, intent(out) :: error
    type(machine_type) :: machine

    call measure_machine(1, 100000_i8, 2, machine)
    ! the slowest machine that could run this, and one that does not exist
    call expect_true(error, machine%bandwidth > 1.0e7_wp .and. machine%bandwidth < 1.0e14_wp, &
      & 'bandwidth '//text_of(machine%bandwidth))
    call expect_true(error, machine%peak > 1.0e6_wp .and. machine%peak < 1.0e13_wp, &
      & 'peak '//text_of(machine%peak))
    call expect_true(error, available_memory() > 1000000_i8, 'free memory')
    call expect_true(error, len_trim(processor_name()) > 0, 'the name of the processor')
  end subroutine test_machine

  subroutine test_plan(error)
    type(error_type), allocatable, intent(out) :: error
    type(bench_options_type) :: options
    type(kernel_type), allocatable :: kernels(:)

    call plan_kernels(options, kernels)
    ! three bodies, two models: lattice with and without breaking, list without
    call expect(error, real(size(kernels), wp), 18.0_wp, 0.0_wp, 'kernels by default')
    if (allocated(error)) return
    call expect_true(error, kernels(1)%dimension == 3 .and. kernels(1)%points == 80, &
      & 'the cube is first')
    call expect_true(error, count(kernels%breaking) == 6, 'breaking on lattices')

    options%points = [9, 10]
    options%dimensions = [2]
    options%model = 'bond_based'
    options%family = 'list'
    options%breaking = 'on'
    call plan_kernels(options, kernels)
    call expect(error, real(size(kernels), wp), 2.0_wp, 0.0_wp, 'kernels by choice')
    if (allocated(error)) return
    call expect_true(error, all(kernels%dimension == 2 .and. kernels%breaking &
      & .and. kernels%family == 'list' .and. kernels%model == 'bond_based'), 'the chosen kernel')
    call expect_true(error, all(kernels%points == [9, 10]), 'the chosen sizes')
    options%breaking = 'both'
    call plan_kernels(options, kernels)
    call expect(error, real(size(kernels), wp), 4.0_wp, 0.0_wp, 'lists with both, if asked for')
  end subroutine test_plan

  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(bench_options_type) :: options
    integer, allocatable :: threads(:)

    options%threads = [4, 2, 4]
    threads = thread_counts(options)
    call expect(error, real(size(threads), wp), 3.0_wp, 0.0_wp, 'numbers of threads')
    if (allocated(error)) return
    call expect_true(error, all(threads == [1, 2, 4]), 'the numbers themselves')
  end subroutine test_threads

  subroutine test_options(error)
    type(error_type), allocatable, intent(out) :: error
    type(bench_options_type) :: options

    options%points = [80, 3]
    call refused(error, options, 'found 3')
    options%points = [80]
    options%dimensions = [4]
    call refused(error, options, "'--dimension' must be between 1 and 3")
    options%dimensions = [3]
    options%threads = [0]
    call refused(error, options, "'--threads'")
    options%threads = [1]
    options%model = 'lattice'
    call refused(error, options, "must be state_based, bond_based or both, found 'lattice'")
    options%model = 'state_base'
    call refused(error, options, "did you mean 'state_based'?")
    options%model = ''
    options%family = 'tree'
    call refused(error, options, 'must be lattice, list or both')
    options%family = 'both'
    options%breaking = 'yes'
    call refused(error, options, 'must be off, on or both')
    options%breaking = 'on'
    options%seconds = 0.0_wp
    call refused(error, options, "'--seconds'")
  end subroutine test_options

  subroutine refused(error, options, words)
    type(error_type), allocatable, intent(inout) :: error
    type(bench_options_type), intent(in) :: options
    character(*), intent(in) :: words
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    call check_options(options, fault)
    if (.not. allocated(fault)) then
      call test_failed(error, 'accepted, but should be told: '//words)
    else
      call expect_true(error, index(fault%message, words) > 0, 'said was: '//fault%message)
    end if
  end subroutine refused

  !> Every row has its columns, and the columns agree with each other.
  subroutine test_files(error)
    type(error_type), allocatable, intent(out) :: error
    type(bench_options_type) :: options
    type(fault_type), allocatable :: fault
    character(line_length) :: line, head(5)
    character(12) :: words(2:5)
    character(*), parameter :: names(4) = ['compiler', 'flags   ', 'cpu     ', 'commit  ']
    real(wp) :: value(16)
    integer :: unit, table, status, rows, i

    options%points = [8, 10]
    options%dimensions = [2]
    options%threads = [1, 2]
    options%seconds = 0.001_wp
    options%triad = 10000_i8
    options%csv = file
    open (newunit=table, status='scratch', action='readwrite')
    call run_bench(options, fault, table)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    call expect_true(error, .not. file_exists(file//'.part'), 'the part became the whole')
    open (newunit=unit, file=file, status='old', action='read')
    read (unit, '(a)') head
    do i = 1, size(names)
      call expect_true(error, index(head(i + 1), '# '//trim(names(i))//': ') == 1, head(i + 1))
    end do
    read (unit, '(a)') line
    call expect_true(error, line == 'dimension,model,family,breaking,precision,points,bonds,'// &
      & 'threads,steps,seconds,ns_per_bond,bytes_per_point,build_seconds,gbytes_per_second,'// &
      & 'gflops,efficiency', &
      & 'columns: '//trim(line))
    rows = 0
    do
      read (unit, '(a)', iostat=status) line
      if (status /= 0 .or. allocated(error)) exit
      rows = rows + 1
      value = 1.0_wp
      read (line, *, iostat=status) value(1), words, value(6:16)
      call expect_true(error, status == 0, 'no row of numbers: '//trim(line))
      if (allocated(error)) exit
      call expect_true(error, any(words(2) == ['state_based', 'bond_based ']) .and. &
        & any(words(3) == ['lattice', 'list   ']) .and. any(words(4) == ['on ', 'off']) .and. &
        & words(5) == 'double', 'words: '//trim(line))
      call expect_true(error, any(abs(value(6) - [64.0_wp, 100.0_wp]) <= 0.0_wp), &
        & 'points: '//trim(line))
      call expect(error, value(7), real(bonds_by_hand(2, nint(sqrt(value(6)))), wp), 0.0_wp, &
        & 'bonds')
      call expect_true(error, all(value(6:16) > 0.0_wp), 'all are positive: '//trim(line))
      ! six digits and nine are printed
      call expect(error, value(11)*value(9)*value(7), 1.0e9_wp*value(10), 1.0e4_wp*value(10), &
        & 'seconds and ns_per_bond')
      if (abs(value(8) - 1) <= 0.0_wp) call expect(error, value(16), 1.0_wp, 1.0e-6_wp, &
        & 'efficiency of 1')
    end do
    close (unit)
    call remove_file(file)
    ! two sizes, two models, lattice twice and list once, two numbers of threads
    call expect(error, real(rows, wp), 24.0_wp, 0.0_wp, 'rows of the file')

    rewind (table)
    rows = 0
    do
      read (table, '(a)', iostat=status) line
      if (status /= 0) exit
      if (index(line, '8^2 ') == 1 .or. index(line, '10^2 ') == 1) rows = rows + 1
    end do
    close (table)
    call expect(error, real(rows, wp), 24.0_wp, 0.0_wp, 'rows of the table')
  end subroutine test_files

  subroutine test_no_file(error)
    type(error_type), allocatable, intent(out) :: error
    type(bench_options_type) :: options
    type(fault_type), allocatable :: fault
    integer :: table

    options%csv = 'no/such/folder/bench.csv'
    open (newunit=table, status='scratch', action='readwrite')
    call run_bench(options, fault, table)
    close (table)
    call expect_true(error, allocated(fault), 'wrote where nothing can be written')
    if (allocated(error)) return
    call expect_true(error, index(fault%message, "'no/such/folder/bench.csv'") > 0, fault%message)
  end subroutine test_no_file

  subroutine test_too_large(error)
    type(error_type), allocatable, intent(out) :: error
    type(bench_options_type) :: options
    type(fault_type), allocatable :: fault
    character(line_length) :: line
    integer :: table, status
    logical :: said

    options%points = [1000000]
    options%dimensions = [3]
    options%triad = 10000_i8
    open (newunit=table, status='scratch', action='readwrite')
    call run_bench(options, fault, table)
    call expect_true(error, allocated(fault), 'took a body that fits nowhere')
    if (allocated(fault)) call expect_true(error, index(fault%message, 'fewer --points') > 0, &
      & fault%message)
    rewind (table)
    said = .false.
    do
      read (table, '(a)', iostat=status) line
      if (status /= 0) exit
      said = said .or. index(line, 'left out: needs about') > 0
    end do
    close (table)
    call expect_true(error, said, 'left out without a word')
  end subroutine test_too_large

end module test_study_bench_bench
