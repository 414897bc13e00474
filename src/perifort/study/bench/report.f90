!> The benchmark's numbers as a table to read and as lines of a CSV file.
module pd_study_bench_report
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text, with_unit
  use pd_base_version, only: compiler_flags, compiler_name, program_version
  use pd_study_bench_kernels, only: kernel_type, timing_type
  use pd_base_system, only: processor_name
  use pd_study_bench_machine, only: machine_type
  implicit none (type, external)
  private
  public :: csv_columns, csv_head, csv_row, table_head, table_row, machine_row, kernel_label

  !> The first line of the CSV file after its `#` lines.
  character(*), parameter :: csv_columns = 'dimension,model,family,breaking,precision,points,'// &
    & 'bonds,threads,steps,seconds,ns_per_bond,bytes_per_point,build_seconds,gbytes_per_second,'// &
    & 'gflops,efficiency'

  character(*), parameter :: left = 'body     model       family  breaks prec   thr'
  character(*), parameter :: middle = ' ns/bond (  least ..   most)     cpu  forces |  steps/s'
  character(*), parameter :: right = '  B/pt build/pt |  GB/s   % | GFLOP/s   % |  eff'

contains

  !> The `#` lines of the CSV file and its columns, to `unit`.
  subroutine csv_head(unit)
    integer, intent(in) :: unit  !! of an open file or the terminal
    write (unit, '(a)') '# perifort '//program_version, '# compiler: '//compiler_name(), &
      & '# flags: '//compiler_flags(), '# cpu: '//processor_name(), '# commit: '//commit(), &
      & csv_columns
  end subroutine csv_head

  !> One line of the CSV file. Numbers have as many digits as the clock is good for.
  function csv_row(kernel, timing, efficiency) result(text)
    type(kernel_type), intent(in) :: kernel  !! what was measured
    type(timing_type), intent(in) :: timing  !! what came out
    real(wp), intent(in) :: efficiency  !! parallel: time on one thread over (threads x time) [-]
    character(:), allocatable :: text
    real(wp) :: step

    step = timing%seconds/timing%steps
    text = to_text(kernel%dimension)//','//trim(kernel%model)//','//trim(kernel%family)//','// &
      & switch(kernel%breaking)//','//trim(kernel%precision)//','//to_text(timing%points)// &
      & ','//to_text(timing%bonds)// &
      & ','//to_text(kernel%threads)//','//to_text(timing%steps)//','// &
      & to_text(timing%seconds, 9)//','//to_text(1.0e9_wp*step/real(timing%bonds, wp), 9)//','// &
      & to_text(real(timing%bytes, wp)/real(timing%points, wp))//','//to_text(timing%build)//','// &
      & to_text(1.0e-9_wp*timing%traffic/step)//','//to_text(1.0e-9_wp*timing%flops/step)//','// &
      & to_text(efficiency)
  end function csv_row

  !> The head of the table: program, peak performance of the machine, and meaning of the columns.
  !> `surface`: with surface correction; `generic`: on the generic pass.
  subroutine table_head(unit, machines, surface, generic)
    integer, intent(in) :: unit                    !! of an open file or the terminal
    type(machine_type), intent(in) :: machines(:)  !! (thread counts) in the order of the rows
    logical, intent(in) :: surface                 !! the bodies have a surface correction
    logical, intent(in) :: generic                 !! the generic pass computes the laws
    integer :: t

    write (unit, '(a)') 'perifort '//program_version//', commit '//commit(), &
      & compiler_name()//' '//compiler_flags(), processor_name()
    do t = 1, size(machines)
      write (unit, '(a)') machine_row(machines(t))
    end do
    write (unit, '(a)') '', &
      & 'Horizon 3.015 spacings, '//trim(merge('with   ', 'without', surface))// &
      & ' surface correction; bonds are directed.'//trim(merge(' Generic pass.', repeat(' ', 14), &
      & generic)), &
      & '  ns/bond   a complete step (forces, detection of breaking bonds, external work, new', &
      & '            velocities and displacements; no output), wall time, median', &
      & '  cpu       the same in processor time per thread', &
      & '  forces    the forces alone', &
      & '  B/pt      memory of points and families; build/pt: time to build the families [ns]', &
      & '  GB/s      memory traffic that a step needs, % of the bandwidth (triad)', &
      & '  GFLOP/s   arithmetic of the force loops, % of the peak (multiply-adds)', &
      & '  eff       parallel efficiency: time on one thread over (threads x time)', &
      & '', left//' |'//middle//' |'//right, &
      & repeat('-', len(left) + len(middle) + len(right) + 4)
  end subroutine table_head

  !> What the machine can do, in a line.
  function machine_row(machine) result(text)
    type(machine_type), intent(in) :: machine  !! bandwidth and peak of some threads
    character(:), allocatable :: text
    text = to_text(machine%threads)//trim(merge(' thread: ', ' threads:', machine%threads == 1))// &
      & ' triad '//with_unit(machine%bandwidth, 'B/s', 3)//', multiply-adds in registers '// &
      & with_unit(machine%peak, 'FLOP/s', 3)//' (compiled code)'
  end function machine_row

  !> One row of the table.
  function table_row(kernel, timing, machine, efficiency) result(text)
    type(kernel_type), intent(in) :: kernel    !! what was measured
    type(timing_type), intent(in) :: timing    !! what came out
    type(machine_type), intent(in) :: machine  !! bandwidth and peak of as many threads
    real(wp), intent(in) :: efficiency  !! parallel: time on one thread over (threads x time) [-]
    character(:), allocatable :: text
    real(wp) :: step, scale, points

    step = timing%seconds/timing%steps
    scale = 1.0e9_wp/(real(timing%bonds, wp)*timing%steps)
    points = real(timing%points, wp)
    text = kernel_label(kernel)//cell(to_text(kernel%threads), 4)//' |'// &
      & cell(numeral(scale*timing%seconds), 8)//' ('//cell(numeral(scale*timing%least), 7)// &
      & ' ..'//cell(numeral(scale*timing%most), 7)//')'// &
      & cell(numeral(scale*timing%processor), 8)// &
      & cell(numeral(scale*timing%forces*timing%steps), 8)//' |'// &
      & cell(numeral(1/step), 9)//' |'//cell(to_text(nint(real(timing%bytes, wp)/points)), 6)// &
      & cell(numeral(1.0e9_wp*timing%build/points), 8)//' |'// &
      & cell(numeral(1.0e-9_wp*timing%traffic/step), 6)// &
      & cell(percent(timing%traffic/step, machine%bandwidth), 4)//' |'// &
      & cell(numeral(1.0e-9_wp*timing%flops/step), 8)// &
      & cell(percent(timing%flops/step, machine%peak), 4)//' |'//cell(fixed(efficiency), 5)
  end function table_row

  !> A kernel's columns on the left: as wide as `left` less the threads.
  pure function kernel_label(kernel) result(text)
    type(kernel_type), intent(in) :: kernel  !! what was measured
    character(len(left) - 4) :: text
    character(9) :: body

    body = to_text(kernel%points)
    if (kernel%dimension > 1) body = trim(body)//'^'//to_text(kernel%dimension)
    write (text, '(a9, a12, a8, a6, 1x, a6)') body, kernel%model, kernel%family, &
      & switch(kernel%breaking), kernel%precision
  end function kernel_label

  pure function switch(on) result(word)
    logical, intent(in) :: on
    character(:), allocatable :: word
    word = trim(merge('on ', 'off', on))
  end function switch

  pure function percent(part, whole) result(text)
    real(wp), intent(in) :: part, whole
    character(:), allocatable :: text
    text = to_text(nint(min(999.0_wp, 100*part/max(whole, tiny(whole)))))
  end function percent

  !> Four digits, but all those before the point up to a million.
  pure function numeral(value) result(text)
    real(wp), intent(in) :: value
    character(:), allocatable :: text
    character(12) :: buffer

    if (value < 10.0_wp) then
      write (buffer, '(f6.3)') value
    else if (value < 100.0_wp) then
      write (buffer, '(f6.2)') value
    else if (value < 1000.0_wp) then
      write (buffer, '(f6.1)') value
    else if (value < 1.0e6_wp) then
      write (buffer, '(i6)') nint(value)
    else
      buffer = to_text(value, 2)
    end if
    text = trim(adjustl(buffer))
  end function numeral

  pure function fixed(value) result(text)
    real(wp), intent(in) :: value
    character(:), allocatable :: text
    character(12) :: buffer
    write (buffer, '(f6.2)') value
    text = trim(adjustl(buffer))
  end function fixed

  !> `text` at the right of a cell.
  pure function cell(text, width) result(padded)
    character(*), intent(in) :: text
    integer, intent(in) :: width
    character(:), allocatable :: padded
    padded = repeat(' ', max(1, width - len(text)))//text
  end function cell

  !> The commit this program was built from, from the environment, where `./pf` puts it.
  function commit() result(text)
    character(:), allocatable :: text
    integer :: length, status

    call get_environment_variable('PERIFORT_COMMIT', length=length, status=status)
    text = 'unknown'
    if (status /= 0 .or. length < 1) return
    deallocate (text)
    allocate (character(length) :: text)
    call get_environment_variable('PERIFORT_COMMIT', value=text)
  end function commit

end module pd_study_bench_report
