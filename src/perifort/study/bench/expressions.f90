!> The time that an expression takes at a million points, for the benchmark.
module pd_study_bench_expressions
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_clock, only: wall_time
  use pd_base_error, only: internal_fault
  use pd_base_expression, only: compile_expression, expression_fault, expression_type, named_value
  use pd_base_field, only: field_type, field_values, new_field
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text, with_unit
  implicit none (type, external)
  private
  public :: expression_row

  integer, parameter :: points = 1000000
  integer, parameter :: half = 3, repeats = 2*half + 1
  !> Ten operations, none of which can be done once for all instants.
  character(*), parameter :: text = '(x - t)*(y + t)/sqrt((z - t)^2 + t) - (x + t)'
  integer, parameter :: operations = 10

contains

  !> A line of the table: the median of some evaluations on one thread.
  function expression_row() result(row)
    character(:), allocatable :: row
    type(expression_type) :: expression
    type(expression_fault), allocatable :: fault
    type(field_type) :: field
    real(wp), allocatable :: x(:, :), values(:)
    real(wp) :: times(repeats), begin
    integer :: i, at, threads

    call compile_expression(text, [named_value ::], expression, fault)
    if (allocated(fault)) call internal_fault('the expression of the benchmark is none')
    allocate (x(points, 3), values(points))
    do i = 1, points
      x(i, :) = [real(i, wp)/points, 1 + sin(real(i, wp)), cos(0.5_wp*i)]
    end do
    threads = omp_get_max_threads()
    call omp_set_num_threads(1)
    call new_field(expression, x, field)
    if (size(field%program%code) /= operations) call internal_fault('operations are missing')
    do i = 1, repeats
      begin = wall_time()
      call field_values(field, 1.0_wp + 0.1_wp*i, values, at)
      times(i) = wall_time() - begin
    end do
    call omp_set_num_threads(threads)
    ! the median: half of the others are not slower
    do i = 1, repeats
      if (count(times < times(i)) <= half .and. count(times <= times(i)) > half) exit
    end do
    row = 'Expressions: '//to_text(operations)//' operations at '//to_text(points)//' points '// &
      & 'in '//with_unit(times(min(i, repeats)), 's', 3)//' on one thread'
  end function expression_row

end module pd_study_bench_expressions
