!> Expressions as lists of nodes: operations with their operands, folded where these are constants,
!> and the derivative in time.
!>
!> A node comes after its operands, so a list is worked through from its first node to its last.
module pd_base_expression_nodes
  use, intrinsic :: ieee_arithmetic, only: ieee_all, ieee_get_status, ieee_is_finite, &
    & ieee_set_halting_mode, ieee_set_status, ieee_status_type
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: node_type, node_list, add_constant, add_variable, add_node, value_of, reachable, &
    & derivative_node, functions, function_op, begin_quiet, end_quiet
  public :: op_constant, op_x, op_y, op_z, op_t, op_negative, op_add, op_subtract, op_multiply, &
    & op_divide, op_power, op_whole_power, op_less, op_at_most, op_greater, op_at_least, op_equal, &
    & op_not_equal, op_if, op_sqrt, op_exp, op_log, op_log10, op_sin, op_cos, op_tan, op_asin, &
    & op_acos, op_atan, op_atan2, op_sinh, op_cosh, op_tanh, op_abs, op_min, op_max, op_mod, &
    & op_floor, op_step, op_sign, op_erf

  enum, bind(c)
    enumerator :: op_constant = 1, op_x, op_y, op_z, op_t, op_negative, op_add, op_subtract, &
      & op_multiply, op_divide, op_power, op_whole_power, op_less, op_at_most, op_greater, &
      & op_at_least, op_equal, op_not_equal, op_if, op_sqrt, op_exp, op_log, op_log10, op_sin, &
      & op_cos, op_tan, op_asin, op_acos, op_atan, op_atan2, op_sinh, op_cosh, op_tanh, op_abs, &
      & op_min, op_max, op_mod, op_floor, op_step, op_sign, op_erf
  end enum

  !> Functions by their names; `op_if` and the operations after it, in this order.
  character(5), parameter :: functions(*) = [character(5) :: 'if', 'sqrt', 'exp', 'log', &
    & 'log10', 'sin', 'cos', 'tan', 'asin', 'acos', 'atan', 'atan2', 'sinh', 'cosh', 'tanh', &
    & 'abs', 'min', 'max', 'mod', 'floor', 'step', 'sign', 'erf']

  integer, parameter :: largest_whole = 64       !! power that is computed by multiplications

  !> One operation.
  type :: node_type
    integer :: op = op_constant
    integer :: arg(3) = 0             !! nodes that are its operands, 0: none
    integer :: power = 0              !! of `op_whole_power`
    real(wp) :: value = 0.0_wp        !! of a constant
    logical :: in_space = .false.     !! depends on x, y or z
    logical :: in_time = .false.      !! depends on t
  end type node_type

  !> Nodes, each after its operands.
  type :: node_list
    type(node_type), allocatable :: nodes(:)  !! with room at the end
    integer :: count = 0
  end type node_list

contains

  !> Number of the operation that a function's name means.
  pure integer function function_op(number) result(op)
    integer, intent(in) :: number  !! its place in `functions`
    op = op_if + number - 1
  end function function_op

  !> Let operations give infinities and NaN where the program was built to stop at them: whether a
  !> result is finite is looked at afterwards. For the calling thread, until `end_quiet`.
  subroutine begin_quiet(status)
    type(ieee_status_type), intent(out) :: status  !! what `end_quiet` restores
    call ieee_get_status(status)
    call ieee_set_halting_mode(ieee_all, .false.)
  end subroutine begin_quiet

  !> As it was before `begin_quiet`, flags included.
  subroutine end_quiet(status)
    type(ieee_status_type), intent(in) :: status  !! from `begin_quiet`
    call ieee_set_status(status)
  end subroutine end_quiet

  !> Add a constant; `add_constant` is its number.
  integer function add_constant(list, value) result(number)
    type(node_list), intent(inout) :: list  !! with the node at its end on return
    real(wp), intent(in) :: value           !! finite
    type(node_type) :: node

    node%value = value
    number = append(list, node)
  end function add_constant

  !> Add x, y, z or t.
  integer function add_variable(list, op) result(number)
    type(node_list), intent(inout) :: list  !! with the node at its end on return
    integer, intent(in) :: op               !! `op_x`, `op_y`, `op_z` or `op_t`
    type(node_type) :: node

    node%op = op
    node%in_time = op == op_t
    node%in_space = op /= op_t
    number = append(list, node)
  end function add_variable

  !> Add an operation, or the constant that it gives. A power with a whole exponent becomes
  !> multiplications, one of 1/2 a root.
  integer function add_node(list, op, a, b, c) result(number)
    type(node_list), intent(inout) :: list  !! with the node at its end on return
    integer, intent(in) :: op               !! what is done
    integer, intent(in) :: a                !! number of the first operand
    integer, intent(in), optional :: b, c   !! of the others
    type(node_type) :: node
    real(wp) :: value, exponent
    integer :: i
    logical :: constant

    node%op = op
    node%arg(1) = a
    if (present(b)) node%arg(2) = b
    if (present(c)) node%arg(3) = c
    constant = .true.
    do i = 1, 3
      if (node%arg(i) == 0) cycle
      associate (operand => list%nodes(node%arg(i)))
        constant = constant .and. operand%op == op_constant
        node%in_space = node%in_space .or. operand%in_space
        node%in_time = node%in_time .or. operand%in_time
      end associate
    end do
    if (op == op_power) then
      if (list%nodes(node%arg(2))%op == op_constant) then
        exponent = list%nodes(node%arg(2))%value
        if (abs(exponent) <= largest_whole .and. abs(exponent - anint(exponent)) <= 0.0_wp) then
          node%op = op_whole_power
          node%power = nint(exponent)
          node%arg(2) = 0
        else if (abs(exponent - 0.5_wp) <= 0.0_wp) then
          node%op = op_sqrt
          node%arg(2) = 0
        end if
      end if
    else if (op == op_if .and. list%nodes(a)%op == op_constant) then
      number = node%arg(3)
      if (abs(list%nodes(a)%value) > 0.0_wp) number = node%arg(2)
      return
    end if
    if (constant) then
      value = value_of(node, operand_value(1), operand_value(2), operand_value(3))
      if (ieee_is_finite(value)) then
        number = add_constant(list, value)
        return
      end if
    end if
    number = append(list, node)

  contains

    !> Value of a constant operand, 0 if there is none.
    real(wp) function operand_value(i) result(value)
      integer, intent(in) :: i
      value = 0.0_wp
      if (node%arg(i) > 0) value = list%nodes(node%arg(i))%value
    end function operand_value

  end function add_node

  !> Put a node at the end.
  integer function append(list, node) result(number)
    type(node_list), intent(inout) :: list
    type(node_type), intent(in) :: node
    type(node_type), allocatable :: longer(:)

    if (.not. allocated(list%nodes)) allocate (list%nodes(16))
    if (list%count == size(list%nodes)) then
      allocate (longer(2*list%count))
      longer(:list%count) = list%nodes
      call move_alloc(longer, list%nodes)
    end if
    list%count = list%count + 1
    list%nodes(list%count) = node
    number = list%count
  end function append

  !> What an operation gives for single values; it may be infinite or NaN, and stops nothing.
  real(wp) function value_of(node, a, b, c) result(value)
    type(node_type), intent(in) :: node  !! no constant and no variable
    real(wp), intent(in) :: a, b, c      !! its operands, 0 where it has none
    type(ieee_status_type) :: status
    real(wp), volatile :: operand(3), kept

    ! volatile: the operation must not be moved out from between the two calls
    call begin_quiet(status)
    operand = [a, b, c]
    kept = operate(node, operand(1), operand(2), operand(3))
    call end_quiet(status)
    value = kept
  end function value_of

  !> The operation itself.
  real(wp) function operate(node, a, b, c) result(r)
    type(node_type), intent(in) :: node
    real(wp), intent(in) :: a, b, c

    r = 0.0_wp
    select case (node%op)
    case (op_negative); r = -a
    case (op_add); r = a + b
    case (op_subtract); r = a - b
    case (op_multiply); r = a*b
    case (op_divide); r = a/b
    case (op_power); r = a**b
    case (op_whole_power); r = whole_power(a, node%power)
    case (op_less); r = merge(1.0_wp, 0.0_wp, a < b)
    case (op_at_most); r = merge(1.0_wp, 0.0_wp, a <= b)
    case (op_greater); r = merge(1.0_wp, 0.0_wp, a > b)
    case (op_at_least); r = merge(1.0_wp, 0.0_wp, a >= b)
    case (op_equal); r = merge(1.0_wp, 0.0_wp, a >= b .and. a <= b)
    case (op_not_equal); r = merge(0.0_wp, 1.0_wp, a >= b .and. a <= b)
    case (op_if); r = merge(c, b, a >= 0.0_wp .and. a <= 0.0_wp)
    case (op_sqrt); r = sqrt(a)
    case (op_exp); r = exp(a)
    case (op_log); r = log(a)
    case (op_log10); r = log10(a)
    case (op_sin); r = sin(a)
    case (op_cos); r = cos(a)
    case (op_tan); r = tan(a)
    case (op_asin); r = asin(a)
    case (op_acos); r = acos(a)
    case (op_atan); r = atan(a)
    case (op_atan2)
      ! the standard leaves atan2(0, 0) open
      if (abs(a) > 0.0_wp .or. abs(b) > 0.0_wp) r = atan2(a, b)
    case (op_sinh); r = sinh(a)
    case (op_cosh); r = cosh(a)
    case (op_tanh); r = tanh(a)
    case (op_abs); r = abs(a)
    case (op_min); r = min(a, b)
    case (op_max); r = max(a, b)
    case (op_mod); r = a - b*whole_below(a/b)
    case (op_floor); r = whole_below(a)
    case (op_step); r = merge(1.0_wp, 0.0_wp, a >= 0.0_wp)
    case (op_sign)
      if (a > 0.0_wp) r = 1.0_wp
      if (a < 0.0_wp) r = -1.0_wp
    case (op_erf); r = erf(a)
    case default
      call internal_fault('an expression has an operation that is not known')
    end select
  end function operate

  !> The largest whole number that is not above `a`.
  elemental real(wp) function whole_below(a) result(r)
    real(wp), intent(in) :: a

    r = aint(a)
    if (r > a) r = r - 1
  end function whole_below

  !> A whole power by multiplications.
  elemental real(wp) function whole_power(a, power) result(r)
    real(wp), intent(in) :: a     !! base
    integer, intent(in) :: power  !! exponent of either sign
    real(wp) :: square
    integer :: left

    r = 1.0_wp
    square = a
    left = abs(power)
    do while (left > 0)
      if (iand(left, 1) == 1) r = r*square
      left = left/2
      if (left > 0) square = square*square
    end do
    if (power < 0) r = 1/r
  end function whole_power

  !> Which nodes a node needs, itself included.
  pure function reachable(list, root) result(needed)
    type(node_list), intent(in) :: list  !! the nodes
    integer, intent(in) :: root          !! number of the node
    logical, allocatable :: needed(:)
    integer :: n, i

    allocate (needed(list%count), source=.false.)
    needed(root) = .true.
    do n = root, 1, -1
      if (.not. needed(n)) cycle
      do i = 1, 3
        if (list%nodes(n)%arg(i) > 0) needed(list%nodes(n)%arg(i)) = .true.
      end do
    end do
  end function reachable

  !> The derivative of node `root` in t, as a further node: the rules of the calculus, exact but for
  !> rounding. Where a function jumps (step, sign, floor, mod, comparisons) its derivative is that
  !> beside the jump.
  integer function derivative_node(list, root) result(number)
    type(node_list), intent(inout) :: list  !! with more nodes on return
    integer, intent(in) :: root             !! number of the node
    integer, allocatable :: rate(:)         !! derivative of each node, 0: zero
    logical, allocatable :: needed(:)
    integer :: n

    needed = reachable(list, root)
    allocate (rate(root), source=0)
    do n = 1, root
      if (needed(n) .and. list%nodes(n)%in_time) rate(n) = rate_of(list, n, rate)
    end do
    number = rate(root)
    if (number == 0) number = add_constant(list, 0.0_wp)
  end function derivative_node

  !> The derivative of one node in t from those of its operands; 0 stands for zero.
  integer function rate_of(list, n, rate) result(number)
    type(node_list), intent(inout) :: list
    integer, intent(in) :: n
    integer, intent(in) :: rate(:)
    real(wp), parameter :: pi = acos(-1.0_wp)
    integer :: a, b, c, da, db, dc
    type(node_type) :: node

    node = list%nodes(n)
    a = node%arg(1)
    b = node%arg(2)
    c = node%arg(3)
    da = 0
    db = 0
    dc = 0
    if (a > 0) da = rate(a)
    if (b > 0) db = rate(b)
    if (c > 0) dc = rate(c)
    number = 0
    select case (node%op)
    case (op_t)
      number = add_constant(list, 1.0_wp)
    case (op_negative)
      number = negative(da)
    case (op_add)
      number = plus(da, db)
    case (op_subtract)
      number = plus(da, negative(db))
    case (op_multiply)
      number = plus(times(da, b), times(a, db))
    case (op_divide)
      ! (da - (a/b) db)/b
      number = over(plus(da, negative(times(n, db))), b)
    case (op_power)
      ! a^b (db log a + b da/a); a constant exponent gives b a^(b-1) da
      if (db == 0) then
        if (da > 0) number = times(times(b, add_node(list, op_power, a, add_node(list, &
          & op_subtract, b, constant(1.0_wp)))), da)
      else
        number = times(n, plus(times(db, add_node(list, op_log, a)), over(times(b, da), a)))
      end if
    case (op_whole_power)
      if (node%power /= 0 .and. da > 0) number = times(times(constant(real(node%power, wp)), &
        & add_node(list, op_power, a, constant(real(node%power - 1, wp)))), da)
    case (op_less, op_at_most, op_greater, op_at_least, op_equal, op_not_equal, op_floor, op_step, &
      & op_sign)
      number = 0
    case (op_if)
      number = choice(a, db, dc)
    case (op_sqrt)
      number = over(da, times(constant(2.0_wp), n))
    case (op_exp)
      number = times(da, n)
    case (op_log)
      number = over(da, a)
    case (op_log10)
      number = over(da, times(constant(log(10.0_wp)), a))
    case (op_sin)
      number = times(da, function_of(op_cos))
    case (op_cos)
      number = negative(times(da, function_of(op_sin)))
    case (op_tan)
      number = times(da, plus(constant(1.0_wp), square(n)))
    case (op_asin)
      number = over(da, add_node(list, op_sqrt, less_square()))
    case (op_acos)
      number = negative(over(da, add_node(list, op_sqrt, less_square())))
    case (op_atan)
      number = over(da, plus(constant(1.0_wp), square(a)))
    case (op_atan2)
      number = over(plus(times(da, b), negative(times(a, db))), plus(square(a), square(b)))
    case (op_sinh)
      number = times(da, function_of(op_cosh))
    case (op_cosh)
      number = times(da, function_of(op_sinh))
    case (op_tanh)
      number = times(da, add_node(list, op_subtract, constant(1.0_wp), square(n)))
    case (op_abs)
      number = times(da, function_of(op_sign))
    case (op_min)
      number = choice(add_node(list, op_less, a, b), da, db)
    case (op_max)
      number = choice(add_node(list, op_greater, a, b), da, db)
    case (op_mod)
      ! a - b floor(a/b)
      number = da
      if (db > 0) number = plus(da, negative(times(db, add_node(list, op_floor, add_node(list, &
        & op_divide, a, b)))))
    case (op_erf)
      number = times(da, times(constant(2/sqrt(pi)), add_node(list, op_exp, add_node(list, &
        & op_negative, square(a)))))
    case default
      call internal_fault('an operation without a derivative')
    end select

  contains

    integer function constant(value) result(number)
      real(wp), intent(in) :: value
      number = add_constant(list, value)
    end function constant

    logical function is_one(i)
      integer, intent(in) :: i
      is_one = list%nodes(i)%op == op_constant .and. abs(list%nodes(i)%value - 1) <= 0.0_wp
    end function is_one

    integer function negative(i) result(number)
      integer, intent(in) :: i
      number = 0
      if (i > 0) number = add_node(list, op_negative, i)
    end function negative

    integer function plus(i, j) result(number)
      integer, intent(in) :: i, j
      number = max(i, j)
      if (i > 0 .and. j > 0) number = add_node(list, op_add, i, j)
    end function plus

    integer function times(i, j) result(number)
      integer, intent(in) :: i, j
      number = 0
      if (i == 0 .or. j == 0) return
      if (is_one(i)) then
        number = j
      else if (is_one(j)) then
        number = i
      else
        number = add_node(list, op_multiply, i, j)
      end if
    end function times

    integer function over(i, j) result(number)
      integer, intent(in) :: i, j
      number = 0
      if (i > 0) number = add_node(list, op_divide, i, j)
    end function over

    integer function square(i) result(number)
      integer, intent(in) :: i
      number = add_node(list, op_power, i, constant(2.0_wp))
    end function square

    !> 1 - a^2
    integer function less_square() result(number)
      number = add_node(list, op_subtract, constant(1.0_wp), square(a))
    end function less_square

    integer function function_of(op) result(number)
      integer, intent(in) :: op
      number = add_node(list, op, a)
    end function function_of

    !> i or j by a condition
    integer function choice(condition, i, j) result(number)
      integer, intent(in) :: condition, i, j
      integer :: first, second

      number = 0
      if (i == 0 .and. j == 0) return
      first = i
      second = j
      if (first == 0) first = constant(0.0_wp)
      if (second == 0) second = constant(0.0_wp)
      number = add_node(list, op_if, condition, first, second)
    end function choice

  end function rate_of

end module pd_base_expression_nodes
