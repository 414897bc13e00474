!> `perifort bench`: standard bodies measured on this machine, compared with its peak performance.
module pd_study_bench_bench
  use, intrinsic :: iso_fortran_env, only: output_unit
  use omp_lib, only: omp_get_max_threads
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text, with_unit
  use pd_output_results_files, only: rename_file
  use pd_study_bench_expressions, only: expression_row
  use pd_study_bench_kernels, only: bytes_needed, kernel_type, measure_kernel, timing_type
  use pd_base_system, only: available_memory
  use pd_study_bench_machine, only: machine_type, measure_machine
  use pd_study_bench_options, only: bench_options_type, check_options, chosen, families, given, &
    & models, precisions, switches
  use pd_study_bench_report, only: csv_head, csv_row, kernel_label, table_head, table_row
  implicit none (type, external)
  private
  public :: run_bench, plan_kernels, thread_counts

  character(*), parameter :: part = '.part'    !! added to a file's name until it is complete
  integer, parameter :: default_points(3) = [1000, 500, 80]

contains

  !> Measure and print a table to `unit`, a row as soon as it is known; the CSV file takes its place
  !> when all is done. Bodies that do not fit into the free memory are left out with a line that
  !> says so. An error if an option has a value that cannot be measured, if a body cannot be built,
  !> if the CSV file cannot be written, or if no body fits into the memory.
  subroutine run_bench(options, error, unit)
    type(bench_options_type), intent(in) :: options  !! what to measure
    type(error_type), allocatable, intent(out) :: error
    integer, intent(in), optional :: unit            !! of the table; absent: standard output
    type(kernel_type), allocatable :: kernels(:)
    type(machine_type), allocatable :: machines(:)
    type(timing_type) :: timing
    real(wp) :: alone, busy
    integer, allocatable :: threads(:)
    integer :: out, csv, i, t, done

    out = output_unit
    if (present(unit)) out = unit
    call check_options(options, error)
    if (allocated(error)) return
    threads = thread_counts(options)
    call plan_kernels(options, kernels)
    call open_csv(options, csv, error)
    if (allocated(error)) return

    allocate (machines(size(threads)))
    do t = 1, size(threads)
      call measure_machine(threads(t), options%triad, 5, machines(t))
    end do
    call table_head(out, machines, options%surface, options%generic)
    if (csv /= 0) call csv_head(csv)
    flush (out)

    done = 0
    busy = 1.0_wp
    alone = 0.0_wp
    do i = 1, size(kernels)
      if (bytes_needed(kernels(i)) > 0.9_wp*available_memory()) then
        write (out, '(a)') kernel_label(kernels(i))//' left out: needs about '// &
          & with_unit(bytes_needed(kernels(i)), 'B', 3)//', available '// &
          & with_unit(real(available_memory(), wp), 'B', 3)
        cycle
      end if
      do t = 1, size(threads)
        ! a bar of some thousand bonds is no work for several
        if (t > 1 .and. kernels(i)%dimension == 1 .and. .not. allocated(options%threads)) exit
        kernels(i)%threads = threads(t)
        call measure_kernel(kernels(i), options%seconds, timing, error)
        if (allocated(error)) exit
        if (threads(t) == 1) then
          alone = timing%seconds/timing%steps
          busy = min(busy, timing%processor/timing%seconds)
        end if
        associate (efficiency => alone*timing%steps/(threads(t)*timing%seconds))
          write (out, '(a)') table_row(kernels(i), timing, machines(t), efficiency)
          flush (out)
          if (csv /= 0) write (csv, '(a)') csv_row(kernels(i), timing, efficiency)
          if (csv /= 0) flush (csv)
        end associate
        done = done + 1
      end do
      if (allocated(error)) exit
    end do
    if (.not. allocated(error) .and. done == 0) &
      & call fail(error, 'no body fits into the free memory of '// &
      & with_unit(real(available_memory(), wp), 'B', 3)//'; ask for fewer --points')
    if (.not. allocated(error)) write (out, '(a)') '', expression_row()
    if (busy < 0.9_wp) write (out, '(a)') '', 'Warning: other programs used the '// &
      & 'machine: a thread had only '//to_text(100*busy, 2)//' % of a core at times. '// &
      & 'The column cpu is not affected.'
    call close_csv(options, csv, error)
  end subroutine run_bench

  !> All bodies and kernels of the options, large dimensions first.
  pure subroutine plan_kernels(options, kernels)
    type(bench_options_type), intent(in) :: options  !! what to measure, checked
    type(kernel_type), allocatable, intent(out) :: kernels(:)
      !! (measurements), in the order of the table; one thread each
    integer, allocatable :: dimensions(:), points(:)
    type(kernel_type) :: one
    integer :: d, p, m, f, b, r

    dimensions = [3, 2, 1]
    if (allocated(options%dimensions)) dimensions = options%dimensions
    allocate (kernels(0))
    one%surface = options%surface
    one%generic = options%generic
    do d = 1, size(dimensions)
      one%dimension = dimensions(d)
      points = [default_points(one%dimension)]
      if (allocated(options%points)) points = options%points
      do p = 1, size(points)
        one%points = points(p)
        do m = 1, 2
          one%model = models(m)
          if (.not. chosen(options%model, trim(models(m)))) cycle
          do f = 1, 2
            one%family = families(f)
            if (.not. chosen(options%family, trim(families(f)))) cycle
            do b = 1, 2
              one%breaking = b == 2
              if (.not. chosen(options%breaking, trim(switches(b)))) cycle
              ! lists are slow, and looking for breaking bonds costs them little: only if asked for
              if (one%breaking .and. one%family == 'list' .and. .not. given(options%breaking)) cycle
              do r = 1, 2
                one%precision = precisions(r)
                if (.not. measured(options, one)) cycle
                kernels = [kernels, one]
              end do
            end do
          end do
        end do
      end do
    end do
  end subroutine plan_kernels

  !> Whether a kernel's precision is wanted, and there for its family and dimension.
  pure logical function measured(options, kernel)
    type(bench_options_type), intent(in) :: options
    type(kernel_type), intent(in) :: kernel

    measured = kernel%precision == 'double'
    if (given(options%precision)) measured = chosen(options%precision, trim(kernel%precision))
    if (kernel%precision == 'mixed') &
      & measured = measured .and. kernel%family == 'lattice' .and. kernel%dimension > 1 &
      & .and. .not. kernel%generic
  end function measured

  !> Threads to measure with, ascending and each once; 1 is always there, since the others are
  !> compared with it.
  function thread_counts(options) result(threads)
    type(bench_options_type), intent(in) :: options  !! what to measure, checked
    integer, allocatable :: threads(:), wanted(:)

    if (allocated(options%threads)) then
      allocate (wanted, source=options%threads)
    else
      allocate (wanted(1), source=omp_get_max_threads())
    end if
    threads = [1]
    do while (any(wanted > threads(size(threads))))
      threads = [threads, minval(wanted, mask=wanted > threads(size(threads)))]
    end do
  end function thread_counts

  !> The CSV file while it is written: beside its place, so that an older one stays till the end.
  subroutine open_csv(options, csv, error)
    type(bench_options_type), intent(in) :: options
    integer, intent(out) :: csv              !! unit; 0: no file is wanted
    type(error_type), allocatable, intent(out) :: error
    character(512) :: message
    integer :: status

    csv = 0
    if (.not. wants_csv(options)) return
    message = ''
    open (newunit=csv, file=options%csv//part, status='replace', action='write', iostat=status, &
      & iomsg=message)
    if (status == 0) return
    call fail(error, "cannot write the file '"//options%csv//"': "//trim(message))
  end subroutine open_csv

  !> Put the file in its place; after an error the measured numbers stay in a file beside it.
  subroutine close_csv(options, csv, error)
    type(bench_options_type), intent(in) :: options
    integer, intent(in) :: csv
    type(error_type), allocatable, intent(inout) :: error
    integer :: status

    if (csv == 0) return
    close (csv, iostat=status)
    if (allocated(error)) return
    if (status /= 0) then
      call fail(error, "the file '"//options%csv//"' could not be completed; is the disk full?")
    else
      call rename_file(options%csv//part, options%csv, error)
    end if
  end subroutine close_csv

  pure logical function wants_csv(options)
    type(bench_options_type), intent(in) :: options
    wants_csv = .false.
    if (allocated(options%csv)) wants_csv = len_trim(options%csv) > 0
  end function wants_csv

end module pd_study_bench_bench
