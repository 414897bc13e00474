!> Expressions of x, y, z, t and of names: from a text to operations.
!>
!> From the weakest to the strongest: comparisons (0 or 1, not chained), `+ -`, `* /`, the sign, `^`
!> (from the right). `-2^2` is -4, and `2^-1` is 1/2. Names are read in any case. `pd_base_field`
!> gives the values at points.
module pd_base_expression
  use pd_base_kinds, only: wp
  use pd_base_text, only: join, lower_case, nearest_name, to_text
  use pd_base_expression_nodes, only: node_list, add_constant, add_variable, add_node, value_of, &
    & reachable, derivative_node, functions, function_op, op_constant, op_x, op_y, op_z, op_t, &
    & op_negative, op_add, op_subtract, op_multiply, op_divide, op_power, op_less, op_at_most, &
    & op_greater, op_at_least, op_equal, op_not_equal, op_if, op_atan2, op_min, op_max, op_mod
  implicit none (type, external)
  private
  public :: expression_type, expression_fault, named_value, compile_expression, &
    & derivative_in_time, constant_value, reserved_meaning

  integer, parameter :: name_length = 64      !! longest name [characters]
  integer, parameter :: deepest = 100         !! parts within each other
  integer, parameter :: largest_power = 300   !! of ten, that a number is surely read with

  !> A name that stands for a number.
  type :: named_value
    character(name_length) :: name = ''  !! in lower case
    real(wp) :: value = 0.0_wp
  end type named_value

  !> A compiled expression.
  type :: expression_type
    type(node_list) :: list
    integer :: root = 0            !! the node that is its value
    logical :: in_space = .false.  !! it depends on x, y or z
    logical :: in_time = .false.   !! it depends on t
  end type expression_type

  !> What is wrong with a text, and where.
  type :: expression_fault
    character(:), allocatable :: message  !! what is wrong
    character(:), allocatable :: note     !! what was expected; '' for nothing
    integer :: column = 1                 !! first character at fault, from 1
    integer :: width = 1                  !! number of characters at fault
  end type expression_fault

  enum, bind(c)
    enumerator :: is_end, is_number, is_name, is_sign
  end enum

  !> Where the parser stands.
  type :: parser_type
    character(:), allocatable :: text
    character(:), allocatable :: variables   !! those that may stand in it, such as 'xyt'
    character(:), allocatable :: reason      !! why others may not
    type(named_value), allocatable :: names(:)
    type(node_list) :: list
    integer :: kind = is_end                 !! of the word that is next
    integer :: first = 1, last = 0           !! its characters
    real(wp) :: value = 0.0_wp               !! of a number
    integer :: depth = 0
    type(expression_fault), allocatable :: fault
  end type parser_type

contains

  !> Compile a text. `fault` is allocated if it is not an expression, or if it has x, y, z or t
  !> where these may not stand.
  subroutine compile_expression(text, names, expression, fault, variables, reason)
    character(*), intent(in) :: text                     !! of any length, blanks included
    type(named_value), intent(in) :: names(:)            !! (any number) further names
    type(expression_type), intent(out) :: expression     !! of use only without a fault
    type(expression_fault), allocatable, intent(out) :: fault
    character(*), intent(in), optional :: variables
      !! letters of x, y, z, t that may stand in it; all by default
    character(*), intent(in), optional :: reason         !! why the others may not
    type(parser_type) :: parser

    parser%text = text
    parser%variables = 'xyzt'
    if (present(variables)) parser%variables = variables
    parser%reason = ''
    if (present(reason)) parser%reason = reason
    parser%names = names
    call advance(parser)
    if (parser%kind == is_end .and. .not. allocated(parser%fault)) call complain(parser, &
      & 'the expression is empty', 'expected a number, a name or a function', 1, 1)
    call parse_comparison(parser, expression%root)
    if (parser%kind /= is_end .and. .not. allocated(parser%fault)) then
      if (word(parser) == ')') then
        call complain(parser, "a ')' without a '('", 'parentheses come in pairs')
      else if (word(parser) == ',') then
        call complain(parser, 'a comma outside of the arguments of a function', '')
      else
        call complain(parser, "'"//word(parser)//"' after the end of the expression", &
          & "expected an operator before it; a product is written with '*'")
      end if
    end if
    if (allocated(parser%fault)) then
      call move_alloc(parser%fault, fault)
      return
    end if
    expression%list = parser%list
    call settle(expression)
  end subroutine compile_expression

  !> The derivative in t, another expression of the same kind.
  subroutine derivative_in_time(expression, derivative)
    type(expression_type), intent(in) :: expression    !! compiled
    type(expression_type), intent(out) :: derivative   !! exact but for rounding

    derivative%list = expression%list
    derivative%root = derivative_node(derivative%list, expression%root)
    call settle(derivative)
  end subroutine derivative_in_time

  !> Drop the nodes that the root does not need, and note what it depends on.
  subroutine settle(expression)
    type(expression_type), intent(inout) :: expression
    logical, allocatable :: needed(:)
    integer, allocatable :: new(:)
    type(node_list) :: kept
    integer :: n, i

    needed = reachable(expression%list, expression%root)
    allocate (new(0:expression%list%count), source=0)
    allocate (kept%nodes(count(needed)))
    do n = 1, expression%list%count
      if (.not. needed(n)) cycle
      kept%count = kept%count + 1
      new(n) = kept%count
      kept%nodes(kept%count) = expression%list%nodes(n)
      do i = 1, 3
        kept%nodes(kept%count)%arg(i) = new(expression%list%nodes(n)%arg(i))
      end do
    end do
    expression%root = new(expression%root)
    expression%list = kept
    expression%in_space = kept%nodes(expression%root)%in_space
    expression%in_time = kept%nodes(expression%root)%in_time
  end subroutine settle

  !> The value of an expression without x, y and z; infinite or NaN where it has none.
  real(wp) function constant_value(expression, t) result(value)
    type(expression_type), intent(in) :: expression  !! without x, y and z
    real(wp), intent(in), optional :: t              !! time; 0 by default [s]
    real(wp), allocatable :: values(:)
    integer :: n

    allocate (values(0:expression%list%count), source=0.0_wp)
    do n = 1, expression%list%count
      associate (node => expression%list%nodes(n))
        select case (node%op)
        case (op_constant)
          values(n) = node%value
        case (op_x, op_y, op_z)
          values(n) = 0.0_wp
        case (op_t)
          if (present(t)) values(n) = t
        case default
          values(n) = value_of(node, values(node%arg(1)), values(node%arg(2)), values(node%arg(3)))
        end select
      end associate
    end do
    value = values(expression%root)
  end function constant_value

  !> What a name means that no `named_value` may have, '' if it is free.
  pure function reserved_meaning(name) result(meaning)
    character(*), intent(in) :: name  !! in lower case
    character(:), allocatable :: meaning

    meaning = ''
    select case (name)
    case ('x', 'y', 'z'); meaning = 'a position'
    case ('t'); meaning = 'the time'
    case ('pi'); meaning = 'the number 3.14159...'
    case ('e'); meaning = 'the number 2.71828...'
    case default  ! a function, or a name that is free
      if (any(functions == name)) meaning = 'a function'
    end select
  end function reserved_meaning

  ! ---------------------------------------------------------------- the parser

  !> Comparisons.
  recursive subroutine parse_comparison(parser, node)
    type(parser_type), intent(inout) :: parser
    integer, intent(out) :: node
    integer :: op, right

    call parse_sum(parser, node)
    op = comparison(parser)
    if (op == 0) return
    call advance(parser)
    call parse_sum(parser, right)
    if (allocated(parser%fault)) return
    node = add_node(parser%list, op, node, right)
    if (comparison(parser) > 0) call complain(parser, 'comparisons one after the other', &
      & 'multiply them, as in (0 < x)*(x < 1)')
  end subroutine parse_comparison

  !> The comparison that is next, 0 if none is.
  pure integer function comparison(parser) result(op)
    type(parser_type), intent(in) :: parser

    op = 0
    if (parser%kind /= is_sign) return
    select case (word(parser))
    case ('<'); op = op_less
    case ('<='); op = op_at_most
    case ('>'); op = op_greater
    case ('>='); op = op_at_least
    case ('=='); op = op_equal
    case ('/=', '!='); op = op_not_equal
    case default  ! no comparison
      op = 0
    end select
  end function comparison

  !> Sums and differences, from the left.
  recursive subroutine parse_sum(parser, node)
    type(parser_type), intent(inout) :: parser
    integer, intent(out) :: node
    integer :: op, right

    call parse_product(parser, node)
    do while (parser%kind == is_sign .and. .not. allocated(parser%fault))
      select case (word(parser))
      case ('+'); op = op_add
      case ('-'); op = op_subtract
      case default  ! the sum or product ends here
        return
      end select
      call advance(parser)
      call parse_product(parser, right)
      if (allocated(parser%fault)) return
      node = add_node(parser%list, op, node, right)
    end do
  end subroutine parse_sum

  !> Products and quotients, from the left.
  recursive subroutine parse_product(parser, node)
    type(parser_type), intent(inout) :: parser
    integer, intent(out) :: node
    integer :: op, right

    call parse_signed(parser, node)
    do while (parser%kind == is_sign .and. .not. allocated(parser%fault))
      select case (word(parser))
      case ('*'); op = op_multiply
      case ('/'); op = op_divide
      case default  ! the sum or product ends here
        return
      end select
      call advance(parser)
      call parse_signed(parser, right)
      if (allocated(parser%fault)) return
      node = add_node(parser%list, op, node, right)
    end do
  end subroutine parse_product

  !> A power, with or without signs before it.
  recursive subroutine parse_signed(parser, node)
    type(parser_type), intent(inout) :: parser
    integer, intent(out) :: node
    logical :: negative

    node = 0
    call go_deeper(parser)
    if (allocated(parser%fault)) return
    if (parser%kind == is_sign .and. scan(word(parser), '+-') == 1) then
      negative = word(parser) == '-'
      call advance(parser)
      call parse_signed(parser, node)
      if (allocated(parser%fault)) return
      if (negative) node = add_node(parser%list, op_negative, node)
    else
      call parse_power(parser, node)
    end if
    parser%depth = parser%depth - 1
  end subroutine parse_signed

  !> Powers, from the right; the exponent may have a sign.
  recursive subroutine parse_power(parser, node)
    type(parser_type), intent(inout) :: parser
    integer, intent(out) :: node
    integer :: exponent

    call parse_value(parser, node)
    if (allocated(parser%fault) .or. parser%kind /= is_sign) return
    if (word(parser) /= '^' .and. word(parser) /= '**') return
    call advance(parser)
    call parse_signed(parser, exponent)
    if (allocated(parser%fault)) return
    node = add_node(parser%list, op_power, node, exponent)
  end subroutine parse_power

  !> A number, a name, a function, or an expression in parentheses.
  recursive subroutine parse_value(parser, node)
    type(parser_type), intent(inout) :: parser
    integer, intent(out) :: node
    integer :: opening

    node = 0
    if (allocated(parser%fault)) return
    select case (parser%kind)
    case (is_number)
      node = add_constant(parser%list, parser%value)
      call advance(parser)
    case (is_name)
      call parse_name(parser, node)
    case default
      if (word(parser) == '(') then
        opening = parser%first
        call advance(parser)
        call parse_comparison(parser, node)
        call close_parenthesis(parser, opening)
      else if (parser%kind == is_end) then
        call complain(parser, 'the expression ends too early', &
          & 'expected a number, a name or a function', max(1, len_trim(parser%text)), 1)
      else
        call complain(parser, "'"//word(parser)//"' where a value belongs", &
          & 'expected a number, a name or a function')
      end if
    end select
  end subroutine parse_value

  !> A variable, a name, or a function with its arguments.
  recursive subroutine parse_name(parser, node)
    type(parser_type), intent(inout) :: parser
    integer, intent(out) :: node
    character(:), allocatable :: name, note, nearest
    integer :: first, last, number

    node = 0
    first = parser%first
    last = parser%last
    name = lower_case(word(parser))
    call advance(parser)
    if (allocated(parser%fault)) return
    number = findloc(functions == name, .true., dim=1)
    if (number > 0) then
      call parse_call(parser, number, first, last, node)
      return
    end if
    if (len(name) == 1 .and. index('xyzt', name) > 0) then
      if (index(parser%variables, name) == 0) then
        call complain(parser, "'"//name//"' cannot stand in this expression", parser%reason, &
          & first, 1)
        return
      end if
      node = add_variable(parser%list, op_x + index('xyzt', name) - 1)
    else if (name == 'pi') then
      node = add_constant(parser%list, acos(-1.0_wp))
    else if (name == 'e') then
      node = add_constant(parser%list, exp(1.0_wp))
    else
      number = findloc(parser%names%name == name, .true., dim=1)
      if (number == 0) then
        nearest = nearest_name(name, known_names(parser))
        note = 'known: '//join(known_names(parser), ', ')
        if (len(nearest) > 0) note = "did you mean '"//nearest//"'?"
        call complain(parser, "unknown name '"//parser%text(first:last)//"'", note, first, &
          & last - first + 1)
        return
      end if
      node = add_constant(parser%list, parser%names(number)%value)
    end if
    if (parser%kind == is_sign .and. word(parser) == '(') call complain(parser, "'"//name// &
      & "' is not a function", "a product is written with '*'", first, last - first + 1)
  end subroutine parse_name

  !> All names that may stand in the text.
  pure function known_names(parser) result(names)
    type(parser_type), intent(in) :: parser
    character(name_length), allocatable :: names(:)
    integer :: i

    names = [character(name_length) :: (parser%variables(i:i), i=1, len(parser%variables)), &
      & 'pi', 'e', parser%names%name, functions]
  end function known_names

  !> The arguments of function `number`, whose name has been read.
  recursive subroutine parse_call(parser, number, first, last, node)
    type(parser_type), intent(inout) :: parser
    integer, intent(in) :: number, first, last
    integer, intent(out) :: node
    integer :: arguments, opening, op, expected, args(3)
    logical :: many, more

    node = 0
    op = function_op(number)
    many = op == op_min .or. op == op_max
    expected = 1
    if (many .or. op == op_atan2 .or. op == op_mod) expected = 2
    if (op == op_if) expected = 3
    if (.not. (parser%kind == is_sign .and. word(parser) == '(')) then
      call complain(parser, "the function '"//trim(functions(number))//"' has no arguments", &
        & "expected '(' after it", first, last - first + 1)
      return
    end if
    opening = parser%first
    call advance(parser)
    arguments = 0
    args = 0
    more = .not. (parser%kind == is_sign .and. word(parser) == ')')
    do while (more)
      arguments = arguments + 1
      if (arguments <= 3) then
        call parse_comparison(parser, args(arguments))
      else
        call parse_comparison(parser, args(3))
      end if
      if (allocated(parser%fault)) return
      if (many .and. arguments > 1) args(1) = add_node(parser%list, op, args(1), &
        & args(min(arguments, 3)))
      more = parser%kind == is_sign .and. word(parser) == ','
      if (more) call advance(parser)
    end do
    call close_parenthesis(parser, opening)
    if (allocated(parser%fault)) return
    if (arguments /= expected .and. .not. (many .and. arguments > expected)) then
      call complain(parser, "'"//trim(functions(number))//"' has "//counted_arguments(arguments), &
        & 'expected '//to_text(expected)//trim(merge(' or more', '        ', many)), first, &
        & last - first + 1)
    else if (many) then
      node = args(1)
    else if (expected == 1) then
      node = add_node(parser%list, op, args(1))
    else if (expected == 2) then
      node = add_node(parser%list, op, args(1), args(2))
    else
      node = add_node(parser%list, op, args(1), args(2), args(3))
    end if
  end subroutine parse_call

  !> `1 argument`, `2 arguments`.
  pure function counted_arguments(number) result(text)
    integer, intent(in) :: number
    character(:), allocatable :: text

    text = to_text(number)//' argument'
    if (number /= 1) text = text//'s'
    if (number == 0) text = 'no argument'
  end function counted_arguments

  !> The `)` that belongs to the `(` at `opening`.
  subroutine close_parenthesis(parser, opening)
    type(parser_type), intent(inout) :: parser
    integer, intent(in) :: opening

    if (allocated(parser%fault)) return
    if (parser%kind == is_sign .and. word(parser) == ')') then
      call advance(parser)
    else if (parser%kind == is_end) then
      call complain(parser, "a '(' without a ')'", 'parentheses come in pairs', opening, 1)
    else
      call complain(parser, "'"//word(parser)//"' where an operator or ')' belongs", &
        & "a product is written with '*'")
    end if
  end subroutine close_parenthesis

  !> One part within another; there is an end to it.
  subroutine go_deeper(parser)
    type(parser_type), intent(inout) :: parser

    if (allocated(parser%fault)) return
    parser%depth = parser%depth + 1
    if (parser%depth > deepest) call complain(parser, 'the expression is nested too deeply', &
      & 'at most '//to_text(deepest)//' parts within each other')
  end subroutine go_deeper

  !> Keep the first fault; without a place, at the word that is next.
  pure subroutine complain(parser, message, note, column, width)
    type(parser_type), intent(inout) :: parser
    character(*), intent(in) :: message, note
    integer, intent(in), optional :: column, width

    if (allocated(parser%fault)) return
    allocate (parser%fault)
    parser%fault%message = message
    parser%fault%note = note
    parser%fault%column = min(parser%first, max(1, len(parser%text)))
    parser%fault%width = max(1, parser%last - parser%first + 1)
    if (present(column)) parser%fault%column = column
    if (present(width)) parser%fault%width = width
  end subroutine complain

  ! ---------------------------------------------------------------- words

  !> The word that is next.
  pure function word(parser) result(text)
    type(parser_type), intent(in) :: parser
    character(:), allocatable :: text
    text = parser%text(parser%first:parser%last)
  end function word

  !> Read the next word.
  subroutine advance(parser)
    type(parser_type), intent(inout) :: parser
    character(*), parameter :: letters = 'abcdefghijklmnopqrstuvwxyz_ABCDEFGHIJKLMNOPQRSTUVWXYZ'
    character(*), parameter :: digits = '0123456789'
    character(2), parameter :: pairs(*) = ['<=', '>=', '==', '/=', '!=', '**']
    integer :: n, first

    if (allocated(parser%fault)) return
    n = len(parser%text)
    first = parser%last + 1
    do while (first <= n)
      if (parser%text(first:first) /= ' ' .and. parser%text(first:first) /= achar(9)) exit
      first = first + 1
    end do
    parser%first = first
    parser%last = first
    if (first > n) then
      parser%kind = is_end
      parser%first = n + 1
      parser%last = n
    else if (scan(parser%text(first:first), letters) > 0) then
      parser%kind = is_name
      do while (parser%last < n)
        if (verify(parser%text(parser%last + 1:parser%last + 1), letters//digits) > 0) exit
        parser%last = parser%last + 1
      end do
    else if (scan(parser%text(first:first), digits//'.') > 0) then
      call read_number(parser)
    else if (any(pairs == parser%text(first:min(n, first + 1)))) then
      parser%kind = is_sign
      parser%last = first + 1
    else if (scan(parser%text(first:first), '+-*/^(),<>') > 0) then
      parser%kind = is_sign
    else
      parser%kind = is_sign
      if (parser%text(first:first) == '=') then
        call complain(parser, "'=' is not an operator", "equality is written with '=='")
      else if (iachar(parser%text(first:first)) < 128 .and. iachar(parser%text(first:first)) > 32) &
        & then
        call complain(parser, "unexpected character '"//parser%text(first:first)//"'", &
          & 'operators are + - * / ^ and < <= > >= == /=')
      else
        call complain(parser, 'a character that is not part of ASCII', '')
      end if
    end if
  end subroutine advance

  !> A number without a sign: digits with at most one point, and an exponent.
  subroutine read_number(parser)
    type(parser_type), intent(inout) :: parser
    character(*), parameter :: digits = '0123456789'
    integer :: i, n, status, power, point
    character(:), allocatable :: number

    n = len(parser%text)
    parser%kind = is_number
    i = after_digits(parser%first)
    point = 0
    if (i <= n) point = index('.', parser%text(i:i))
    if (point > 0) i = after_digits(i + 1)
    parser%last = i - 1
    if (i - parser%first - point == 0) then
      call complain(parser, "a '.' without digits", 'expected a number')
      return
    end if
    power = 0
    number = parser%text(parser%first:parser%last)
    if (i < n) then
      if (scan(parser%text(i:i), 'eEdD') > 0) then
        i = i + 1
        if (i < n .and. scan(parser%text(i:i), '+-') > 0) i = i + 1
        if (verify(parser%text(i:i), digits) == 0) then
          n = after_digits(i) - 1
          power = 2*largest_power
          if (n - i <= 6) then
            read (parser%text(i:n), *, iostat=status) power
            if (status /= 0) power = 2*largest_power
          end if
          if (parser%text(i - 1:i - 1) == '-') power = -power
          parser%last = n
          number = number//'e'//to_text(power)
        end if
      end if
    end if
    if (abs(power) + len(number) > largest_power) then
      call complain(parser, 'a number too large or too small to compute with', &
        & 'expected a size between 1e-'//to_text(largest_power/2)//' and 1e'// &
        & to_text(largest_power/2))
      return
    end if
    read (number, *, iostat=status) parser%value
    if (status /= 0) call complain(parser, 'this is not a number', '')

  contains

    !> The first character from `start` on that is no digit.
    pure integer function after_digits(start) result(next)
      integer, intent(in) :: start

      next = verify(parser%text(start:), digits)
      if (next == 0) then
        next = len(parser%text) + 1
      else
        next = start + next - 1
      end if
    end function after_digits

  end subroutine read_number

end module pd_base_expression
