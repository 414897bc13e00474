!> Expressions: their values against Fortran's own, derivatives against closed forms, faults with
!> their places, texts without sense.
module test_base_expression
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_expression, only: compile_expression, constant_value, derivative_in_time, &
    & expression_fault, expression_type, named_value
  use pd_base_field, only: field_type, field_values, lanes, new_field
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: to_text
  use comparisons, only: expect_close, max_abs
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_base_expression

  real(wp), parameter :: rounding = 1.0e-14_wp  !! some ulp of intermediate values of size 1 to 10
  real(wp), parameter :: pi = acos(-1.0_wp)
  type(named_value), parameter :: names(2) = [named_value('speed', 200.0_wp), &
    & named_value('r_0', 0.25_wp)]

contains

  subroutine collect_base_expression(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('precedence', test_precedence), &
      & new_unittest('functions are those of Fortran', test_functions), &
      & new_unittest('functions at points', test_at_points), &
      & new_unittest('derivatives in time', test_derivatives), &
      & new_unittest('constants are folded, what lacks t is kept', test_folding), &
      & new_unittest('a branch that is not taken does no harm', test_branches), &
      & new_unittest('the first point without a finite value', test_not_finite), &
      & new_unittest('the same bits on any number of threads', test_threads), &
      & new_unittest('faults and their places', test_faults), &
      & new_unittest('variables that cannot stand there', test_variables), &
      & new_unittest('deep nesting ends in a fault', test_depth), &
      & new_unittest('20000 texts without sense', test_fuzz)]
  end subroutine collect_base_expression

  !> Compile, or fail.
  subroutine compiled(error, text, expression)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text
    type(expression_type), intent(out) :: expression
    type(expression_fault), allocatable :: fault

    if (allocated(error)) return
    call compile_expression(text, names, expression, fault)
    if (allocated(fault)) call test_failed(error, text//': '//fault%message)
  end subroutine compiled

  !> A text without x, y, z must have this value at t = 0.5.
  subroutine expect_value(error, text, expected)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text
    real(wp), intent(in) :: expected
    type(expression_type) :: expression

    call compiled(error, text, expression)
    if (allocated(error)) return
    call expect_close(error, constant_value(expression, 0.5_wp), expected, &
      & rounding*max(1.0_wp, abs(expected)), text)
  end subroutine expect_value

  subroutine test_precedence(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_value(error, '-2^2', -4.0_wp)
    call expect_value(error, '2^3^2', 512.0_wp)
    call expect_value(error, '(2^3)^2', 64.0_wp)
    call expect_value(error, '2^-1', 0.5_wp)
    call expect_value(error, '2**3', 8.0_wp)
    call expect_value(error, '-2^-2', -0.25_wp)
    call expect_value(error, '2*-3', -6.0_wp)
    call expect_value(error, '1 - 2 - 3', -4.0_wp)
    call expect_value(error, '8/4/2', 1.0_wp)
    call expect_value(error, '8/4*2', 4.0_wp)
    call expect_value(error, '2 + 3*4', 14.0_wp)
    call expect_value(error, '(2 + 3)*4', 20.0_wp)
    call expect_value(error, '- -3', 3.0_wp)
    call expect_value(error, '+3', 3.0_wp)
    call expect_value(error, '-3 + 4', 1.0_wp)
    call expect_value(error, '1 + 1 < 3', 1.0_wp)
    call expect_value(error, '1 < 0 + 1', 0.0_wp)
    call expect_value(error, '(1 < 2)*5', 5.0_wp)
    call expect_value(error, '1 <= 1', 1.0_wp)
    call expect_value(error, '1 >= 2', 0.0_wp)
    call expect_value(error, '2 > 1', 1.0_wp)
    call expect_value(error, '2 == 2', 1.0_wp)
    call expect_value(error, '2 /= 2', 0.0_wp)
    call expect_value(error, '2 != 1', 1.0_wp)
    call expect_value(error, '.5e1 + 1.E-1 + 2d0', 7.1_wp)
    call expect_value(error, '2*e', 2*exp(1.0_wp))
    call expect_value(error, 'PI', pi)
    call expect_value(error, 'Speed*r_0', 50.0_wp)
    call expect_value(error, '4*t^2', 1.0_wp)
    call expect_value(error, '0^0', 1.0_wp)
    call expect_value(error, '(-2)^3', -8.0_wp)
    call expect_value(error, '(-2)^3.0', -8.0_wp)
  end subroutine test_precedence

  subroutine test_functions(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_value(error, 'sqrt(2)', sqrt(2.0_wp))
    call expect_value(error, 'exp(1.5)', exp(1.5_wp))
    call expect_value(error, 'log(3)', log(3.0_wp))
    call expect_value(error, 'log10(1000)', 3.0_wp)
    call expect_value(error, 'sin(1)', sin(1.0_wp))
    call expect_value(error, 'cos(1)', cos(1.0_wp))
    call expect_value(error, 'tan(1)', tan(1.0_wp))
    call expect_value(error, 'asin(0.3)', asin(0.3_wp))
    call expect_value(error, 'acos(0.3)', acos(0.3_wp))
    call expect_value(error, 'atan(3)', atan(3.0_wp))
    call expect_value(error, 'atan2(1, -1)', 0.75_wp*pi)
    call expect_value(error, 'atan2(0, 0)', 0.0_wp)
    call expect_value(error, 'sinh(1)', sinh(1.0_wp))
    call expect_value(error, 'cosh(1)', cosh(1.0_wp))
    call expect_value(error, 'tanh(1)', tanh(1.0_wp))
    call expect_value(error, 'abs(-2.5)', 2.5_wp)
    call expect_value(error, 'min(3, 1, 2)', 1.0_wp)
    call expect_value(error, 'max(3, 1, 4, 2, 6, 5)', 6.0_wp)
    call expect_value(error, 'mod(-1, 3)', 2.0_wp)
    call expect_value(error, 'mod(7.5, 2)', 1.5_wp)
    call expect_value(error, 'floor(-1.5)', -2.0_wp)
    call expect_value(error, 'floor(1.5)', 1.0_wp)
    call expect_value(error, 'step(0) + step(-1e-9)', 1.0_wp)
    call expect_value(error, 'sign(-3) + sign(0)', -1.0_wp)
    call expect_value(error, 'erf(0.5)', erf(0.5_wp))
    call expect_value(error, 'if(1 < 2, 3, 4)', 3.0_wp)
    call expect_value(error, 'IF(t > 1, 3, 4)', 4.0_wp)
  end subroutine test_functions

  !> Points on a spiral away from the axes; more than one block, and a part of one.
  subroutine points_of(n, x)
    integer, intent(in) :: n
    real(wp), allocatable, intent(out) :: x(:, :)
    integer :: i

    allocate (x(n, 3))
    do i = 1, n
      x(i, :) = [0.3_wp + 0.4_wp*sin(0.37_wp*i), 0.5_wp*cos(0.11_wp*i), -0.6_wp + 1.0e-3_wp*i]
    end do
  end subroutine points_of

  !> Vectors have the values of scalars: those of Fortran's functions at each point.
  subroutine test_at_points(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: x(:, :), expected(:)
    integer, parameter :: n = 2*lanes + 77
    real(wp), parameter :: t = 0.7_wp

    call points_of(n, x)
    allocate (expected(n))
    associate (px => x(:, 1), py => x(:, 2), pz => x(:, 3))
      call expect_field(error, 'speed*x/sqrt(x^2 + y^2)', 200*px/sqrt(px**2 + py**2))
      call expect_field(error, 'x + 2*y - 3*z/4', px + 2*py - 3*pz/4)
      call expect_field(error, 'x^5 - y^-3 + z^7', px**5 - 1/py**3 + pz**7)
      call expect_field(error, 'abs(x)^1.7', abs(px)**1.7_wp)
      call expect_field(error, 'abs(x)^y', abs(px)**py)
      call expect_field(error, 'exp(x) + log(2 + y) + log10(3 + z)', exp(px) + log(2 + py) &
        & + log10(3 + pz))
      call expect_field(error, 'sin(x)*cos(y) + tan(z)', sin(px)*cos(py) + tan(pz))
      call expect_field(error, 'asin(x) + acos(y) + atan(z)', asin(px) + acos(py) + atan(pz))
      call expect_field(error, 'atan2(x, y)', atan2(px, py))
      call expect_field(error, 'sinh(x) - cosh(y) + tanh(z)', sinh(px) - cosh(py) + tanh(pz))
      call expect_field(error, 'erf(x) + abs(y) + sign(z)', erf(px) + abs(py) &
        & + sign(1.0_wp, pz))
      call expect_field(error, 'min(x, y, z) + max(x, y)', min(px, py, pz) + max(px, py))
      expected = modulo(px, 0.25_wp) + floor(10*py)
      call expect_field(error, 'mod(x, 0.25) + floor(10*y)', expected)
      expected = merge(px, -py, px < py)
      call expect_field(error, 'if(x < y, x, -y)', expected)
      expected = merge(1.0_wp, 0.0_wp, px >= 0.2_wp) + merge(1.0_wp, 0.0_wp, py > pz)
      call expect_field(error, 'step(x - 0.2) + (y > z)', expected)
      expected = merge(1.0_wp, 0.0_wp, px <= py) + merge(1.0_wp, 0.0_wp, px >= py) + 1
      call expect_field(error, '(x <= y) + (x >= y) + (x == x) + (x /= x)', expected)
      call expect_field(error, '-x', -px)
      call expect_field(error, '7', 7 + 0*px)
      call expect_field(error, 'z', pz)
      call expect_field(error, 't^2*sin(x) + t*exp(y) - cos(t)*z', t**2*sin(px) + t*exp(py) &
        & - cos(t)*pz)
      call expect_field(error, 'sin(pi*(x - t))*exp(-((y - t)/0.2)^2)', &
        & sin(pi*(px - t))*exp(-((py - t)/0.2_wp)**2))
    end associate

  contains

    subroutine expect_field(error, text, wanted)
      type(error_type), allocatable, intent(inout) :: error
      character(*), intent(in) :: text
      real(wp), intent(in) :: wanted(:)
      type(expression_type) :: expression
      type(field_type) :: field
      real(wp) :: values(n)
      integer :: at

      call compiled(error, text, expression)
      if (allocated(error)) return
      call new_field(expression, x, field)
      call field_values(field, t, values, at)
      if (at /= 0) call test_failed(error, text//': point '//to_text(at)//' is not finite')
      ! vector functions of the C library are right within 4 ulp
      call expect_close(error, values, wanted, 10*rounding*max(1.0_wp, max_abs(wanted)), text)
    end subroutine expect_field

  end subroutine test_at_points

  subroutine test_derivatives(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: t = 0.7_wp, h = 1.0e-4_wp
    character(40), parameter :: texts(*) = [character(40) :: 'sin(3*t)', 't^3 - 2*t', 'exp(-t)/t', &
      & 't^t', 't^1.5', 'sqrt(1 + t^2)', 'log(t)*log10(t)', 'tan(t)', 'asin(t/2)', 'acos(t/2)', &
      & 'atan(2*t)', 'atan2(t, 1 - t)', 'sinh(t)', 'cosh(t)', 'tanh(t)', 'abs(t - 1)', &
      & 'min(t, t^2)', 'max(t, t^2, 0.1)', 'mod(5*t, 2)', 'floor(t) + t', 'step(t - 0.5)*t', &
      & 'sign(t - 1)*t^2', 'erf(t)', 'if(t < 0.5, t, 1 - t^2)', '(t > 0.5)*t^4', '-cos(t)', &
      & '1/(1 + t)^2', 'speed*t', 'mod(t, 0.3 + t/10)', '2^t', '5']
    type(expression_type) :: expression, rate, second
    real(wp) :: difference
    integer :: i

    ! closed forms of first and second derivatives
    call compiled(error, 'sin(3*t)*exp(-t)', expression)
    if (allocated(error)) return
    call derivative_in_time(expression, rate)
    call expect_close(error, constant_value(rate, t), (3*cos(3*t) - sin(3*t))*exp(-t), rounding, &
      & 'first derivative')
    call derivative_in_time(rate, second)
    call expect_close(error, constant_value(second, t), (-8*sin(3*t) - 6*cos(3*t))*exp(-t), &
      & 10*rounding, 'second derivative')
    call compiled(error, 't^4/(1 + t)', expression)
    call derivative_in_time(expression, rate)
    call expect_close(error, constant_value(rate, t), (4*t**3*(1 + t) - t**4)/(1 + t)**2, &
      & rounding, 'a quotient')
    ! all rules against central differences of fourth order: truncation 1e-14, rounding 1e-11
    do i = 1, size(texts)
      call compiled(error, trim(texts(i)), expression)
      if (allocated(error)) return
      call derivative_in_time(expression, rate)
      difference = (8*(value(t + h) - value(t - h)) - value(t + 2*h) + value(t - 2*h))/(12*h)
      call expect_close(error, constant_value(rate, t), difference, &
        & 1.0e-10_wp*max(1.0_wp, abs(difference)), trim(texts(i)))
    end do
    ! in space and time
    call compiled(error, 'x*t^2 + sin(y*t)', expression)
    if (allocated(error)) return
    call derivative_in_time(expression, rate)
    call expect_close(error, value_at(rate, [2.0_wp, 3.0_wp]), 4*t + 3*cos(3*t), 10*rounding, &
      & 'at a point')

  contains

    real(wp) function value(t)
      real(wp), intent(in) :: t
      value = constant_value(expression, t)
    end function value

    real(wp) function value_at(expression, x) result(value)
      type(expression_type), intent(in) :: expression
      real(wp), intent(in) :: x(:)
      type(field_type) :: field
      real(wp) :: values(1)
      integer :: at

      call new_field(expression, reshape(x, [1, size(x)]), field)
      call field_values(field, t, values, at)
      value = values(1)
    end function value_at

  end subroutine test_derivatives

  subroutine test_folding(error)
    type(error_type), allocatable, intent(out) :: error
    type(expression_type) :: expression, rate
    type(field_type) :: field
    real(wp), allocatable :: x(:, :)

    call compiled(error, '2*3 + sqrt(16)/speed', expression)
    if (allocated(error)) return
    call check(error, expression%list%count, 1, 'nodes of a constant')
    if (allocated(error)) return
    call compiled(error, 'x*(2*pi/3)', expression)
    if (allocated(error)) return
    call check(error, expression%list%count, 3, 'nodes of x times a constant')
    if (allocated(error)) return
    call compiled(error, '3*t', expression)
    if (allocated(error)) return
    call derivative_in_time(expression, rate)
    call check(error, rate%list%count, 1, 'nodes of a constant derivative')
    if (allocated(error)) return
    call check(error, .not. rate%in_time .and. expression%in_time, 'what depends on t')
    if (allocated(error)) return
    call points_of(5, x)
    call compiled(error, 'sin(x*y)*cos(t) + exp(z)', expression)
    if (allocated(error)) return
    call new_field(expression, x, field)
    ! the product of one kept value and one scalar, plus another kept value
    call check(error, size(field%program%code), 2, 'instructions of each instant')
  end subroutine test_folding

  subroutine test_branches(error)
    type(error_type), allocatable, intent(out) :: error
    type(expression_type) :: expression
    type(field_type) :: field
    real(wp) :: x(3, 1), values(3)
    integer :: at

    x(:, 1) = [0.0_wp, -1.0_wp, 4.0_wp]
    call compiled(error, 'if(x > 0, 1/x + sqrt(x) + log(x), if(x < 0, exp(1000*abs(x)) < 0, 0)' &
      & //' + 1e200*(1 - x)*0)', expression)
    if (allocated(error)) return
    call new_field(expression, x, field)
    call field_values(field, 0.0_wp, values, at)
    call check(error, at, 0)
    call expect_close(error, values, [0.0_wp, 0.0_wp, 2.25_wp + log(4.0_wp)], rounding, 'branches')
    call expect_value(error, 'if(t < 1, 2, 1/0)', 2.0_wp)
    call expect_value(error, 'if(0, log(-1), 3)', 3.0_wp)
  end subroutine test_branches

  subroutine test_not_finite(error)
    type(error_type), allocatable, intent(out) :: error
    character(18), parameter :: texts(4) = [character(18) :: '1/(x - 0.5)', 'sqrt(0.501 - x)', &
      & 'exp(1e5*(x>0.492))', 'log(9 - x)']
    ! x of point i is (i - 1)/1024
    integer, parameter :: first(4) = [513, 515, 505, 9217]
    type(expression_type) :: expression
    type(field_type) :: field
    real(wp) :: x(20000, 1), values(20000)
    integer :: at, i

    x(:, 1) = [(real(i - 1, wp)/1024, i=1, size(x, 1))]
    do i = 1, size(texts)
      call compiled(error, trim(texts(i)), expression)
      if (allocated(error)) return
      call new_field(expression, x, field)
      call field_values(field, 0.0_wp, values, at)
      call check(error, at, first(i), texts(i))
      if (allocated(error)) return
    end do
    call compiled(error, '1/t', expression)
    if (allocated(error)) return
    call new_field(expression, x, field)
    call field_values(field, 0.0_wp, values, at)
    call check(error, at, 1, 'a scalar')
    if (allocated(error)) return
    call field_values(field, 0.5_wp, values, at)
    call check(error, at, 0, 'a scalar later')
    call compiled(error, '1/0 + 0*x', expression)
    if (allocated(error)) return
    call check(error, .not. ieee_is_finite(constant_value(expression)), 'a constant')
  end subroutine test_not_finite

  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 40000 + 13
    type(expression_type) :: expression
    type(field_type) :: field
    real(wp), allocatable :: x(:, :)
    real(wp) :: one(n), more(n)
    integer :: at, threads, before

    before = omp_get_max_threads()
    call points_of(n, x)
    call compiled(error, 'sin(3*x)*t + exp(y*t)/(2 + z) + erf(x - t)', expression)
    if (allocated(error)) return
    call omp_set_num_threads(1)
    call new_field(expression, x, field)
    call field_values(field, 0.3_wp, one, at)
    do threads = 2, 5
      call omp_set_num_threads(threads)
      call new_field(expression, x, field)
      call field_values(field, 0.3_wp, more, at)
      call expect_close(error, more, one, 0.0_wp, to_text(threads)//' threads')
    end do
    call omp_set_num_threads(before)
  end subroutine test_threads

  subroutine test_faults(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault_at(error, '', 1, 'empty')
    call expect_fault_at(error, '   ', 1, 'empty')
    call expect_fault_at(error, '2*', 2, 'ends too early')
    call expect_fault_at(error, '2 + * 3', 5, "'*' where a value belongs")
    call expect_fault_at(error, '(1 + 2', 1, "a '(' without a ')'")
    call expect_fault_at(error, '1 + 2)', 6, "a ')' without a '('")
    call expect_fault_at(error, '2 x', 3, 'after the end')
    call expect_fault_at(error, '2x', 2, 'after the end')
    call expect_fault_at(error, '1 + sqr(2)', 5, "unknown name 'sqr'")
    call expect_fault_at(error, '1 + sped', 5, "unknown name 'sped'")
    call expect_fault_at(error, 'sqrt(1, 2)', 1, "'sqrt' has 2 arguments")
    call expect_fault_at(error, '3 + atan2(1)', 5, "'atan2' has 1 argument")
    call expect_fault_at(error, 'if(1, 2)', 1, "'if' has 2 arguments")
    call expect_fault_at(error, 'if(1, 2, 3, 4)', 1, "'if' has 4 arguments")
    call expect_fault_at(error, 'sin()', 1, "'sin' has no argument")
    call expect_fault_at(error, 'min(1)', 1, "'min' has 1 argument")
    call expect_fault_at(error, 'sin + 1', 1, "'sin' has no arguments")
    call expect_fault_at(error, 'x(2)', 1, "'x' is not a function")
    call expect_fault_at(error, 'speed (2)', 1, "'speed' is not a function")
    call expect_fault_at(error, '0 < x < 1', 7, 'comparisons one after the other')
    call expect_fault_at(error, '1, 2', 2, 'a comma')
    call expect_fault_at(error, 'x = 2', 3, "'=' is not an operator")
    call expect_fault_at(error, 'x $ 2', 3, "unexpected character '$'")
    call expect_fault_at(error, '1 . 2', 3, "a '.' without digits")
    call expect_fault_at(error, '1e999', 1, 'too large')
    call expect_fault_at(error, '1 + 1e-9999999999', 5, 'too large')
    call expect_fault_at(error, '2e*3 +', 2, 'after the end')
    call expect_fault_at(error, 'sin(x', 4, "a '(' without a ')'")
    call expect_fault_at(error, 'sin(x y)', 7, "'y' where an operator")

  end subroutine test_faults

  !> A text must be refused at this character, with these words in the message.
  subroutine expect_fault_at(error, text, column, words, variables)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text
    integer, intent(in) :: column
    character(*), intent(in) :: words
    character(*), intent(in), optional :: variables
    type(expression_type) :: expression
    type(expression_fault), allocatable :: fault

    if (allocated(error)) return
    call compile_expression(text, names, expression, fault, variables, 'a reason')
    if (.not. allocated(fault)) then
      call test_failed(error, "accepted: '"//text//"'")
    else if (fault%column /= column .or. index(fault%message, words) == 0) then
      call test_failed(error, "'"//text//"': "//fault%message//' at '//to_text(fault%column))
    else if (words == "unknown name 'sqr'" .and. index(fault%note, "'sqrt'") == 0) then
      call test_failed(error, 'no nearest function: '//fault%note)
    else if (words == "unknown name 'sped'" .and. index(fault%note, "'speed'") == 0) then
      call test_failed(error, 'no nearest name: '//fault%note)
    end if
  end subroutine expect_fault_at

  subroutine test_variables(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault_at(error, '2*t', 3, "'t' cannot stand", 'xyz')
    call expect_fault_at(error, 'x + Y', 5, "'y' cannot stand", 'xt')
    call expect_fault_at(error, 'sin(x)', 5, "'x' cannot stand", '')
  end subroutine test_variables

  subroutine test_depth(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fault_at(error, repeat('(', 5000)//'1'//repeat(')', 5000), 101, 'too deeply')
    call expect_fault_at(error, repeat('-', 5000)//'1', 101, 'too deeply')
    call expect_fault_at(error, '2'//repeat('^2', 5000), 201, 'too deeply')
    call expect_value(error, '0'//repeat(' + 1', 5000), 5000.0_wp)
  end subroutine test_depth

  !> Random texts, and sound ones with changes, are compiled, differentiated and evaluated, or
  !> refused at one of their characters.
  subroutine test_fuzz(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: letters = 'xyzte01259.+-*/^(),<>=!  sincoqrpal_'
    character(*), parameter :: sound(6) = [character(48) :: '200*x/sqrt(x^2+y^2)', &
      & 'if(t < 0.5, sin(2*pi*t), exp(-x)*(y >= 0.1))', 'min(x, y, z) + max(1e3, mod(t, 2))', &
      & '-2.5e-3*atan2(y, x)^2 + erf(z/speed)', 'abs(floor(x*10)) - step(t)*sign(y)*r_0', &
      & 'log10(1 + x^2)/tanh(t + 1) != 3']
    character(*), parameter :: parts(12) = [character(8) :: 'sqrt(', 'if(', ')', ',', '^', 'x', &
      & '1e9', 't', 'atan2(', '-', '/', 'exp(']
    type(expression_type) :: expression, rate
    type(expression_fault), allocatable :: fault
    type(field_type) :: field
    character(:), allocatable :: text
    real(wp) :: x(2, 3), values(2)
    integer(i8) :: seed
    integer :: number, i, at, sound_ones

    seed = 20240229_i8
    sound_ones = 0
    x = reshape([0.0_wp, 1.0_wp, -1.0_wp, 0.5_wp, 2.0_wp, 0.0_wp], [2, 3])
    do number = 1, 20000
      if (mod(number, 3) == 0) then
        text = ''
        do i = 1, 1 + random(30)
          at = 1 + random(len(letters))
          text = text//letters(at:at)
        end do
      else if (mod(number, 3) == 1) then
        text = ''
        do i = 1, 1 + random(12)
          text = text//trim(parts(1 + random(size(parts))))
        end do
      else
        text = trim(sound(1 + random(size(sound))))
        do i = 1, 1 + random(3)
          at = 1 + random(len(text))
          select case (random(4))
          case (0); text = text(:at - 1)//text(at + 1:)
          case (1); text(at:at) = achar(random(256))
          case (2); text = text(:at)//trim(parts(1 + random(size(parts))))//text(at + 1:)
          case default; text = text(:at)//text(1 + random(at):)
          end select
          if (len(text) == 0) text = 'x'
        end do
      end if
      call compile_expression(text, names, expression, fault)
      if (allocated(fault)) then
        if (fault%column < 1 .or. fault%column > max(1, len(text)) .or. fault%width < 1 .or. &
          & fault%column + fault%width - 1 > max(1, len(text)) .or. len(fault%message) == 0) then
          call test_failed(error, "no place in '"//text//"': "//fault%message)
          return
        end if
        cycle
      end if
      sound_ones = sound_ones + 1
      call derivative_in_time(expression, rate)
      call new_field(rate, x, field)
      call field_values(field, 0.25_wp, values, at)
      call new_field(expression, x, field)
      call field_values(field, 0.25_wp, values, at)
      if (at == 0 .neqv. all(ieee_is_finite(values))) then
        call test_failed(error, "a value that is not finite is not noticed: '"//text//"'")
        return
      end if
    end do
    ! both ends of the test are there
    call check(error, sound_ones > 300 .and. sound_ones < 15000, to_text(sound_ones)//' are sound')

  contains

    !> A number from 0 to `n` - 1.
    integer function random(n) result(value)
      integer, intent(in) :: n
      seed = mod(seed*1103515245_i8 + 12345_i8, 2147483648_i8)
      value = int(mod(seed/1024_i8, int(n, i8)))
    end function random

  end subroutine test_fuzz

end module test_base_expression
