!> Which rows of what results hold of the points, one for each point in point order, a rank has to
!> write. Ranks have equally many, one behind the other: all together on one rank.
module pd_output_results_rows
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i8
  use pd_base_order, only: ranks_type
  implicit none (type, external)
  private
  public :: rows_type, all_rows, rows_of_rank

  integer(i8), parameter :: least_turn = 65536_i8  !! rows that the first rank gets at a time

  type :: rows_type
    integer(i8) :: all = 0_i8      !! rows of all ranks
    integer(i8) :: before = 0_i8   !! of the ranks before this one
    integer :: n = 0               !! of this rank; at least 1 with several ranks
    integer(i8) :: most = 0_i8     !! of the rank that has most
    logical :: on_first = .true.   !! this is the first rank
    class(ranks_type), pointer :: ranks => null()  !! null: there is one rank
  contains
    procedure :: divided
    procedure :: wait
    procedure :: turns
    procedure :: take_turn
  end type rows_type

contains

  !> The rows of one rank, which has all.
  pure type(rows_type) function all_rows(n) result(rows)
    integer, intent(in) :: n  !! points

    rows%all = n
    rows%n = n
    rows%most = n
  end function all_rows

  !> The rows that a rank writes; a call of all ranks.
  subroutine rows_of_rank(ranks, n_global, rows, bounds)
    class(ranks_type), intent(inout), target :: ranks  !! of the run
    integer(i8), intent(in) :: n_global                !! points of all ranks, at least one for each
    type(rows_type), intent(out) :: rows               !! those of this rank
    integer(i8), allocatable, intent(out) :: bounds(:)
      !! (0:ranks): rows before each rank, and of all
    real(wp) :: number(1)
    integer :: rank, p, r

    number = 1.0_wp
    call ranks%add_all(number)
    p = nint(number(1))
    rank = int(ranks%number_before(1_i8))
    allocate (bounds(0:p))
    ! the remainder is spread first, since the number of points times that of ranks may be too large
    bounds = [(r*(n_global/p) + r*mod(n_global, int(p, i8))/p, r=0, p)]
    rows%all = n_global
    rows%before = bounds(rank)
    rows%n = int(bounds(rank + 1) - bounds(rank))
    rows%most = maxval(bounds(1:) - bounds(:p - 1))
    rows%on_first = rank == 0
    rows%ranks => ranks
    if (any(bounds(1:) == bounds(:p - 1))) call internal_fault('a rank has no row to write')
  end subroutine rows_of_rank

  !> Whether several ranks share the rows.
  pure logical function divided(self)
    class(rows_type), intent(in) :: self  !! of this rank
    divided = associated(self%ranks)
  end function divided

  !> Wait until all ranks are here.
  subroutine wait(self)
    class(rows_type), intent(in) :: self  !! of this rank
    real(wp) :: nothing(1)

    nothing = 0.0_wp
    if (self%divided()) call self%ranks%add_all(nothing)
  end subroutine wait

  !> In how many turns the first rank gets the rows of all, so that it never has many more than
  !> its own.
  pure integer function turns(self)
    class(rows_type), intent(in) :: self  !! of this rank
    turns = int((self%all - 1)/turn_rows(self)) + 1
  end function turns

  !> Rows of a turn.
  pure integer(i8) function turn_rows(self)
    class(rows_type), intent(in) :: self
    turn_rows = max(self%most, least_turn)
  end function turn_rows

  !> The values of one turn on the first rank; a call of all ranks.
  subroutine take_turn(self, turn, values, first, taken)
    class(rows_type), intent(in) :: self             !! of this rank
    integer, intent(in) :: turn                      !! its number, from 1
    real(wp), intent(in) :: values(:, :)             !! (n, components) of this rank
    integer(i8), intent(out) :: first                !! row of the first value, from 0
    real(wp), allocatable, intent(out) :: taken(:, :)
      !! (rows of the turn, components) on the first rank; (0, components) elsewhere
    real(wp), allocatable :: one(:)
    integer(i8) :: from, to
    integer :: c

    first = (turn - 1)*turn_rows(self)
    from = max(first - self%before, 0_i8) + 1
    to = min(first + turn_rows(self) - self%before, int(self%n, i8))
    do c = 1, size(values, 2)
      call self%ranks%collect(values(from:to, c), one)
      if (c == 1) allocate (taken(size(one), size(values, 2)))
      taken(:, c) = one
    end do
  end subroutine take_turn

end module pd_output_results_rows
