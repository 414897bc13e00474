!> Values of an expression at many points.
!>
!> A field is made once for its points: what lacks t is computed then and kept, what has t alone is
!> computed once for each instant. The rest is a short list of instructions, each of which works on
!> the registers of `lanes` points at a time. All blocks have that length, so that a value has the
!> same bits on any number of threads.
module pd_base_field
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_status_type
  use pd_base_error, only: internal_fault
  use pd_base_expression, only: expression_type
  use pd_base_expression_nodes, only: node_type, value_of, begin_quiet, end_quiet, op_x, op_z, &
    & op_t, op_constant, op_negative, op_add, op_subtract, op_multiply, op_divide, op_power, &
    & op_whole_power, op_less, op_at_most, op_greater, op_at_least, op_equal, op_not_equal, &
    & op_if, op_sqrt, op_exp, op_log, op_log10, op_sin, op_cos, op_tan, op_asin, op_acos, &
    & op_atan, op_atan2, op_sinh, op_cosh, op_tanh, op_abs, op_min, op_max, op_mod, op_floor, &
    & op_step, op_sign, op_erf
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: field_type, new_field, field_values, lanes

  integer, parameter :: lanes = 256           !! points that an instruction works on
  integer, parameter :: worth_threads = 8192  !! points

  !> One instruction: registers of operands and of the result.
  type :: instruction_type
    type(node_type) :: node
    integer :: from(3) = 0
    integer :: to = 0
  end type instruction_type

  !> What is done for each block of points.
  type :: program_type
    type(instruction_type), allocatable :: code(:)
    integer :: registers = 0
    integer, allocatable :: columns(:)   !! data of points that are loaded into the first registers
    integer, allocatable :: scalars(:)   !! nodes whose values fill the next registers
    integer, allocatable :: results(:)   !! registers of the results
  end type program_type

  !> An expression at its points.
  type :: field_type
    integer :: points = 0
    logical :: in_space = .false.        !! it has x, y or z
    logical :: in_time = .false.         !! it has t
    type(expression_type) :: expression
    type(program_type) :: program
    real(wp), allocatable :: data(:, :)  !! (points, columns): positions, and what is kept
  end type field_type

contains

  !> Bind an expression to points.
  subroutine new_field(expression, x, field)
    type(expression_type), intent(in) :: expression  !! compiled
    real(wp), intent(in) :: x(:, :)
      !! positions (points, dim) [m]; those of directions that are not there are 0
    type(field_type), intent(out) :: field           !! ready for `field_values`
    integer, allocatable :: column(:), kept(:)
    type(program_type) :: once
    real(wp), allocatable :: scalars(:)
    integer :: n, c

    field%expression = expression
    field%points = size(x, 1)
    field%in_space = expression%in_space
    field%in_time = expression%in_time
    if (.not. expression%in_space) return
    associate (list => expression%list)
      allocate (column(list%count), source=0)
      do n = 1, list%count
        if (list%nodes(n)%op >= op_x .and. list%nodes(n)%op <= op_z) &
          & column(n) = list%nodes(n)%op - op_x + 1
      end do
      call find_kept(expression, kept)
      allocate (field%data(field%points, 3 + size(kept)), source=0.0_wp)
      do c = 1, size(x, 2)
        field%data(:, c) = x(:, c)
      end do
      if (size(kept) > 0) then
        call make_program(expression, column, kept, once)
        call scalar_values(expression, 0.0_wp, scalars)
        call run(once, scalars, field%points, field%data(:, :3), size(kept), field%data(:, 4:))
        do c = 1, size(kept)
          column(kept(c)) = 3 + c
        end do
      end if
      call make_program(expression, column, [expression%root], field%program)
    end associate
  end subroutine new_field

  !> The nodes that are computed once: those without t that are operands of nodes with t, or the
  !> whole expression; positions themselves need not be computed.
  subroutine find_kept(expression, kept)
    type(expression_type), intent(in) :: expression
    integer, allocatable, intent(out) :: kept(:)
    logical, allocatable :: keep(:)
    integer :: n, i

    associate (nodes => expression%list%nodes)
      allocate (keep(expression%list%count), source=.false.)
      keep(expression%root) = is_fixed(nodes(expression%root))
      do n = 1, expression%list%count
        if (.not. nodes(n)%in_time) cycle
        do i = 1, 3
          if (nodes(n)%arg(i) == 0) cycle
          if (is_fixed(nodes(nodes(n)%arg(i)))) keep(nodes(n)%arg(i)) = .true.
        end do
      end do
    end associate
    kept = pack([(n, n=1, size(keep))], keep)

  contains

    logical function is_fixed(node)
      type(node_type), intent(in) :: node
      is_fixed = node%in_space .and. .not. node%in_time .and. node%op > op_t
    end function is_fixed
  end subroutine find_kept

  !> The program for some nodes, from those that stand in columns and from those without x, y, z.
  subroutine make_program(expression, column, targets, program)
    type(expression_type), intent(in) :: expression
    integer, intent(in) :: column(:)   !! of each node, 0: not there
    integer, intent(in) :: targets(:)  !! nodes that are wanted
    type(program_type), intent(out) :: program
    integer, allocatable :: register(:), uses(:), free(:)
    logical, allocatable :: needed(:)
    integer :: n, i, a, length, to

    associate (list => expression%list)
      allocate (register(0:list%count), uses(list%count), source=0)
      allocate (needed(list%count), source=.false.)
      needed(targets) = .true.
      uses(targets) = 1
      do n = list%count, 1, -1
        if (.not. needed(n) .or. is_given(n)) cycle
        do i = 1, 3
          a = list%nodes(n)%arg(i)
          if (a == 0) cycle
          needed(a) = .true.
          uses(a) = uses(a) + 1
        end do
      end do
      program%columns = pack(column, needed .and. column > 0)
      program%scalars = pack([(n, n=1, list%count)], needed .and. column == 0 .and. &
        & .not. list%nodes(:list%count)%in_space)
      program%registers = size(program%columns) + size(program%scalars)
      register(pack([(n, n=1, list%count)], needed .and. column > 0)) = &
        & [(i, i=1, size(program%columns))]
      register(program%scalars) = [(size(program%columns) + i, i=1, size(program%scalars))]
      allocate (program%code(count(needed)), free(0))
      length = 0
      do n = 1, list%count
        if (.not. needed(n) .or. is_given(n)) cycle
        if (size(free) > 0) then
          to = free(size(free))
          free = free(:size(free) - 1)
        else
          program%registers = program%registers + 1
          to = program%registers
        end if
        length = length + 1
        program%code(length)%node = list%nodes(n)
        program%code(length)%to = to
        register(n) = to
        do i = 1, 3
          a = list%nodes(n)%arg(i)
          program%code(length)%from(i) = to
          if (a == 0) cycle
          program%code(length)%from(i) = register(a)
          uses(a) = uses(a) - 1
          if (uses(a) == 0 .and. .not. is_given(a)) free = [free, register(a)]
        end do
      end do
      program%code = program%code(:length)
      program%results = register(targets)
    end associate

  contains

    !> Whether a node is loaded and not computed.
    logical function is_given(n)
      integer, intent(in) :: n
      is_given = column(n) > 0 .or. .not. expression%list%nodes(n)%in_space
    end function is_given
  end subroutine make_program

  !> The values of all nodes without x, y and z at time `t`.
  subroutine scalar_values(expression, t, values)
    type(expression_type), intent(in) :: expression
    real(wp), intent(in) :: t
    real(wp), allocatable, intent(out) :: values(:)
    integer :: n

    allocate (values(0:expression%list%count), source=0.0_wp)
    do n = 1, expression%list%count
      associate (node => expression%list%nodes(n))
        if (node%in_space) cycle
        if (node%op == op_constant) then
          values(n) = node%value
        else if (node%op == op_t) then
          values(n) = t
        else
          values(n) = value_of(node, values(node%arg(1)), values(node%arg(2)), values(node%arg(3)))
        end if
      end associate
    end do
  end subroutine scalar_values

  !> The values at time `t` of all points. `at_fault` is the first point whose value is not finite,
  !> 0 if all are.
  subroutine field_values(field, t, values, at_fault)
    type(field_type), intent(in) :: field      !! bound to its points
    real(wp), intent(in) :: t                  !! time [s]
    real(wp), intent(out), contiguous :: values(:)  !! (points)
    integer, intent(out) :: at_fault           !! number of a point, or 0
    real(wp), allocatable :: scalars(:)

    call scalar_values(field%expression, t, scalars)
    at_fault = 0
    if (.not. field%in_space) then
      values = scalars(field%expression%root)
      if (.not. ieee_is_finite(scalars(field%expression%root))) at_fault = min(1, size(values))
    else
      call run(field%program, scalars, field%points, field%data, 1, values, at_fault)
    end if
  end subroutine field_values

  !> Run a program for all points, block by block.
  subroutine run(program, scalars, points, data, number, results, at_fault)
    type(program_type), intent(in) :: program
    real(wp), intent(in) :: scalars(0:)
    integer, intent(in) :: points
    real(wp), intent(in) :: data(:, :)             !! (points, columns)
    integer, intent(in) :: number                  !! of results
    real(wp), intent(inout) :: results(points, number)
    integer, intent(out), optional :: at_fault     !! first point of the first result not finite
    real(wp), allocatable :: registers(:, :)
    type(ieee_status_type) :: status
    integer :: block, first, n, i, worst

    worst = points + 1
    !$omp parallel if (points >= worth_threads) default(none) &
    !$omp shared(program, scalars, points, data, results) &
    !$omp private(registers, status, block, first, n, i) reduction(min:worst)
    allocate (registers(lanes, program%registers))
    call begin_quiet(status)
    do i = 1, size(program%scalars)
      registers(:, size(program%columns) + i) = scalars(program%scalars(i))
    end do
    !$omp do schedule(static)
    do block = 1, (points + lanes - 1)/lanes
      first = (block - 1)*lanes
      n = min(lanes, points - first)
      do i = 1, size(program%columns)
        registers(:n, i) = data(first + 1:first + n, program%columns(i))
        ! a whole block is computed: the end of the last one repeats the last point
        if (n < lanes) registers(n + 1:, i) = registers(n, i)
      end do
      do i = 1, size(program%code)
        associate (step => program%code(i))
          call work(step%node%op, step%node%power, registers(:, step%from(1)), &
            & registers(:, step%from(2)), registers(:, step%from(3)), registers(:, step%to))
        end associate
      end do
      do i = 1, size(program%results)
        results(first + 1:first + n, i) = registers(:n, program%results(i))
      end do
      worst = min(worst, first + first_not_finite(n, registers(:, program%results(1)), &
        & points + 1 - first))
    end do
    !$omp end do
    call end_quiet(status)
    !$omp end parallel
    if (present(at_fault)) then
      at_fault = worst
      if (worst > points) at_fault = 0
    end if
  end subroutine run

  !> The first of `n` values that is not finite, or `none`.
  integer function first_not_finite(n, values, none) result(first)
    integer, intent(in) :: n
    real(wp), intent(in) :: values(lanes)
    integer, intent(in) :: none
    integer :: i

    first = none
    if (all(abs(values) <= huge(values))) return
    do i = 1, n
      if (abs(values(i)) <= huge(values)) cycle
      first = i
      return
    end do
  end function first_not_finite

  !> One instruction. Operands that an operation does not have are not read.
  subroutine work(op, power, a, b, c, r)
    integer, intent(in) :: op, power
    real(wp), intent(in) :: a(lanes), b(lanes), c(lanes)
    real(wp), intent(inout) :: r(lanes)
    real(wp) :: square(lanes)
    integer :: i, left

    select case (op)
    case (op_negative); r = -a
    case (op_add); r = a + b
    case (op_subtract); r = a - b
    case (op_multiply); r = a*b
    case (op_divide); r = a/b
    case (op_power); r = a**b
    case (op_whole_power)
      select case (power)
      case (2); r = a*a
      case (3); r = a*a*a
      case default
        r = 1.0_wp
        square = a
        left = abs(power)
        do while (left > 0)
          if (iand(left, 1) == 1) r = r*square
          left = left/2
          if (left > 0) square = square*square
        end do
        if (power < 0) r = 1/r
      end select
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
      do i = 1, lanes
        r(i) = 0.0_wp
        ! the standard leaves atan2(0, 0) open
        if (abs(a(i)) > 0.0_wp .or. abs(b(i)) > 0.0_wp) r(i) = atan2(a(i), b(i))
      end do
    case (op_sinh); r = sinh(a)
    case (op_cosh); r = cosh(a)
    case (op_tanh); r = tanh(a)
    case (op_abs); r = abs(a)
    case (op_min); r = min(a, b)
    case (op_max); r = max(a, b)
    case (op_mod)
      square = a/b
      call round_down(square, r)
      r = a - b*r
    case (op_floor); call round_down(a, r)
    case (op_step); r = merge(1.0_wp, 0.0_wp, a >= 0.0_wp)
    case (op_sign); r = merge(1.0_wp, 0.0_wp, a > 0.0_wp) - merge(1.0_wp, 0.0_wp, a < 0.0_wp)
    case (op_erf); r = erf(a)
    case default
      call internal_fault('a field has an operation that is not known')
    end select
  end subroutine work

  !> The largest whole numbers that are not above `a`.
  pure subroutine round_down(a, r)
    real(wp), intent(in) :: a(lanes)
    real(wp), intent(out) :: r(lanes)

    r = aint(a)
    r = merge(r - 1, r, r > a)
  end subroutine round_down

end module pd_base_field
