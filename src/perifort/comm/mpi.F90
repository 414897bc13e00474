!> Messages between processes by MPI.
#ifdef PERIFORT_MPI
submodule(pd_comm_world) messages
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_ptr
  use mpi_f08, only: MPI_Abort, MPI_ADDRESS_KIND, MPI_Allreduce, MPI_Alltoall, MPI_Alltoallv, &
    & MPI_Barrier, MPI_COMM_WORLD, MPI_Comm_rank, MPI_Comm_size, MPI_DOUBLE_PRECISION, &
    & MPI_Exscan, MPI_Finalize, MPI_Finalized, MPI_Gather, MPI_Gatherv, MPI_IN_PLACE, &
    & MPI_INFO_NULL, MPI_Init_thread, MPI_Initialized, MPI_INTEGER, MPI_INTEGER8, MPI_Irecv, &
    & MPI_Isend, MPI_LOCK_EXCLUSIVE, MPI_MAX, MPI_MIN, MPI_Op, MPI_Request, &
    & MPI_Rget_accumulate, MPI_STATUS_IGNORE, MPI_STATUSES_IGNORE, MPI_SUM, MPI_Test, &
    & MPI_THREAD_FUNNELED, MPI_Waitall, MPI_Win, MPI_Win_allocate, MPI_Win_free, MPI_Win_lock, &
    & MPI_Win_lock_all, MPI_Win_unlock, MPI_Win_unlock_all
  use pd_base_error, only: internal_fault
  use pd_base_order, only: place_in
  implicit none (type, external)

  integer, parameter :: tag = 7

  ! Numbers in the memory of the first rank, which any rank changes without the first one's help, so
  ! that ranks with an error need no other to agree on who reports it.
  integer, parameter :: have_come = 0  ! ranks that have an error
  integer, parameter :: lowest = 1     ! of them
  integer, parameter :: claims = 2     ! of those that want to report, the first of which does
  type(MPI_Win) :: board
  logical :: has_board = .false.
  integer, asynchronous :: put(1), got_back(1)  ! what is sent to the board, and comes back
  real(wp), parameter :: turn = 1.0_wp              ! [s] how long a rank lets lower ones come
  real(wp), parameter :: between_looks = 1.0e-3_wp  ! [s]
  real(wp), parameter :: patience = 10.0_wp         ! [s] for what takes microseconds

contains

  module procedure begin_world
    logical :: begun
    integer :: provided

    call MPI_Initialized(begun)
    if (.not. begun) call MPI_Init_thread(MPI_THREAD_FUNNELED, provided)
    call MPI_Comm_rank(MPI_COMM_WORLD, world%rank)
    call MPI_Comm_size(MPI_COMM_WORLD, world%ranks)
    ! where another program has begun MPI, it reports errors
    if (.not. begun .and. world%ranks > 1) call make_board(world)
  end procedure begin_world

  module procedure end_world
    logical :: begun, ended

    call MPI_Initialized(begun)
    call MPI_Finalized(ended)
    if (.not. begun .or. ended) return
    if (has_board) then
      call MPI_Win_unlock_all(board)
      call MPI_Win_free(board)
      has_board = .false.
    end if
    call MPI_Finalize()
  end procedure end_world

  !> Make the board, on which every rank may write from now on.
  subroutine make_board(world)
    type(world_type), intent(in) :: world
    integer(MPI_ADDRESS_KIND) :: bytes
    integer, pointer :: numbers(:)
    integer :: of_number
    type(c_ptr) :: memory

    of_number = storage_size(of_number)/8
    bytes = 0
    if (world%rank == 0) bytes = 3*of_number
    call MPI_Win_allocate(bytes, of_number, MPI_INFO_NULL, MPI_COMM_WORLD, memory, board)
    if (world%rank == 0) then
      call c_f_pointer(memory, numbers, [3])
      call MPI_Win_lock(MPI_LOCK_EXCLUSIVE, 0, 0, board)
      numbers(have_come + 1) = 0
      numbers(lowest + 1) = world%ranks
      numbers(claims + 1) = 0
      call MPI_Win_unlock(0, board)
    end if
    call MPI_Barrier(MPI_COMM_WORLD)
    call MPI_Win_lock_all(0, board)
    has_board = .true.
  end subroutine make_board

  !> Change a number of the board by an operation with `value`, and get what it was before.
  subroutine change_board(which, operation, value, before, done)
    integer, intent(in) :: which            !! `have_come`, `lowest` or `claims`
    type(MPI_Op), intent(in) :: operation
    integer, intent(in) :: value
    integer, intent(out) :: before
    logical, intent(out) :: done            !! false: the first rank cannot be reached
    type(MPI_Request) :: request
    real(wp) :: begin

    before = 0
    put = value
    begin = wall_time()
    call MPI_Rget_accumulate(put, 1, MPI_INTEGER, got_back, 1, MPI_INTEGER, 0, &
      & int(which, MPI_ADDRESS_KIND), 1, MPI_INTEGER, operation, board, request)
    do
      call MPI_Test(request, done, MPI_STATUS_IGNORE)
      if (done .or. wall_time() - begin > patience) exit
    end do
    if (done) before = got_back(1)
  end subroutine change_board

  module procedure reports_error
    real(wp) :: begin, waited
    integer :: before, first, come
    logical :: done

    reports = .true.
    if (.not. has_board) return
    begin = wall_time()
    call change_board(lowest, MPI_MIN, world%rank, first, done)
    if (done) call change_board(have_come, MPI_SUM, 1, before, done)
    if (.not. done) return  ! two messages are better than none
    do
      call change_board(have_come, MPI_SUM, 0, come, done)
      if (done) call change_board(lowest, MPI_MIN, world%rank, first, done)
      if (.not. done) return
      waited = wall_time() - begin
      if (first == world%rank .and. (come == world%ranks .or. waited > turn)) exit
      if (waited > patience) exit
      call pause_until(begin + waited + between_looks)
    end do
    call change_board(claims, MPI_SUM, 1, before, done)
    reports = before == 0  ! so it is, too, where the first rank cannot be reached
    ! who has claimed before writes, and then ends this rank
    if (.not. reports) call pause_until(wall_time() + patience)
  end procedure reports_error

  !> Let time pass until a reading of the clock [s].
  subroutine pause_until(time)
    real(wp), intent(in) :: time

    do while (wall_time() < time)
    end do
  end subroutine pause_until

  module procedure abort_world
    integer :: ranks

    call MPI_Comm_size(MPI_COMM_WORLD, ranks)
    if (ranks > 1) call MPI_Abort(MPI_COMM_WORLD, status)
  end procedure abort_world

  module procedure add_all
    real(wp) :: begin

    begin = wall_time()
    call MPI_Allreduce(MPI_IN_PLACE, values, size(values), MPI_DOUBLE_PRECISION, MPI_SUM, &
      & MPI_COMM_WORLD)
    call count_sum(self, begin)
  end procedure add_all

  !> Count a reduction that began at a time [s].
  subroutine count_sum(self, begin)
    class(world_type), intent(inout) :: self
    real(wp), intent(in) :: begin

    self%sums = self%sums + 1_i8
    self%summing = self%summing + wall_time() - begin
  end subroutine count_sum

  module procedure take_largest
    real(wp), parameter :: beyond = 2*(huge(1.0_wp)/2)
    real(wp) :: begin
    integer :: i

    begin = wall_time()

    ! ranks may reduce in different orders, in which comparisons with NaN would differ
    do i = 1, size(values)
      if (ieee_is_nan(values(i))) values(i) = beyond
    end do
    call MPI_Allreduce(MPI_IN_PLACE, values, size(values), MPI_DOUBLE_PRECISION, MPI_MAX, &
      & MPI_COMM_WORLD)
    call count_sum(self, begin)
  end procedure take_largest

  module procedure start_sharing
    type(MPI_Request) :: request
    real(wp) :: begin
    integer :: c, i, n, m, first, number, at

    begin = wall_time()
    m = size(values, 2)
    associate (messages => self%exchanges(which), neighbours => size(self%neighbour))
      if (allocated(messages%request)) call internal_fault('messages that nobody waits for')
      allocate (messages%request(2*neighbours))
      call make_room(m*size(self%send_slot), messages%sent)
      call make_room(m*size(self%take_slot), messages%taken)
      do n = 1, neighbours
        first = self%take_first(n)
        number = self%take_first(n + 1) - first
        at = m*(first - 1)
        call MPI_Irecv(messages%taken(at + 1:at + m*number), m*number, MPI_DOUBLE_PRECISION, &
          & self%neighbour(n), tag + which, MPI_COMM_WORLD, request)
        messages%request(n) = request%MPI_VAL
      end do
      do n = 1, neighbours
        first = self%send_first(n)
        number = self%send_first(n + 1) - first
        at = m*(first - 1)
        do c = 1, m
          do i = 1, number
            messages%sent(at + (c - 1)*number + i) = values(self%send_slot(first + i - 1), c)
          end do
        end do
        call MPI_Isend(messages%sent(at + 1:at + m*number), m*number, MPI_DOUBLE_PRECISION, &
          & self%neighbour(n), tag + which, MPI_COMM_WORLD, request)
        messages%request(neighbours + n) = request%MPI_VAL
      end do
    end associate
    self%bytes = self%bytes + 8_i8*m*size(self%send_slot)
    self%messages = self%messages + size(self%neighbour)
    self%sharing = self%sharing + wall_time() - begin
  end procedure start_sharing

  !> Room for so many values, which stays where it is while messages need it.
  subroutine make_room(number, values)
    integer, intent(in) :: number
    real(wp), allocatable, intent(inout) :: values(:)

    if (allocated(values)) then
      if (size(values) >= number) return
      deallocate (values)
    end if
    allocate (values(number))
  end subroutine make_room

  module procedure finish_sharing
    type(MPI_Request) :: request(2*size(self%neighbour))
    real(wp) :: begin
    integer :: c, i, n, m, first, number, at

    begin = wall_time()
    m = size(values, 2)
    associate (messages => self%exchanges(which))
      if (.not. allocated(messages%request)) call internal_fault('messages that nobody has sent')
      request%MPI_VAL = messages%request
      call MPI_Waitall(size(request), request, MPI_STATUSES_IGNORE)
      deallocate (messages%request)
      do n = 1, size(self%neighbour)
        first = self%take_first(n)
        number = self%take_first(n + 1) - first
        at = m*(first - 1)
        do c = 1, m
          do i = 1, number
            values(self%take_slot(first + i - 1), c) = messages%taken(at + (c - 1)*number + i)
          end do
        end do
      end do
    end associate
    self%sharing = self%sharing + wall_time() - begin
  end procedure finish_sharing

  module procedure join
    integer :: wanted(0:self%ranks - 1), asked(0:self%ranks - 1)
    integer :: wanted_at(0:self%ranks), asked_at(0:self%ranks), next(0:self%ranks - 1)
    integer(i8), allocatable :: want(:), ask(:)
    integer :: r, i, n

    wanted = 0
    do i = 1, size(owner)
      wanted(owner(i)) = wanted(owner(i)) + 1
    end do
    call MPI_Alltoall(wanted, 1, MPI_INTEGER, asked, 1, MPI_INTEGER, MPI_COMM_WORLD)
    wanted_at(0) = 0
    asked_at(0) = 0
    do r = 1, self%ranks
      wanted_at(r) = wanted_at(r - 1) + wanted(r - 1)
      asked_at(r) = asked_at(r - 1) + asked(r - 1)
    end do
    allocate (want(size(owner)), ask(asked_at(self%ranks)))
    self%take_slot = slot
    next = wanted_at(:self%ranks - 1)
    do i = 1, size(owner)
      r = owner(i)
      next(r) = next(r) + 1
      want(next(r)) = number(i)
      self%take_slot(next(r)) = slot(i)
    end do
    call MPI_Alltoallv(want, wanted, wanted_at(:self%ranks - 1), MPI_INTEGER8, ask, asked, &
      & asked_at(:self%ranks - 1), MPI_INTEGER8, MPI_COMM_WORLD)
    if (allocated(self%send_slot)) deallocate (self%send_slot)
    allocate (self%send_slot(size(ask)))
    do i = 1, size(ask)
      n = place_in(owned_number, ask(i))
      if (n == 0) call internal_fault('a rank is asked for a point that it does not own')
      self%send_slot(i) = owned_slot(n)
    end do
    self%neighbour = pack([(r, r=0, self%ranks - 1)], wanted + asked > 0)
    n = size(self%neighbour)
    self%take_first = [wanted_at(self%neighbour) + 1, size(want) + 1]
    self%send_first = [asked_at(self%neighbour) + 1, size(ask) + 1]
  end procedure join

  module procedure collect
    integer :: numbers(0:self%ranks - 1), at(0:self%ranks - 1), r

    call MPI_Gather([size(values)], 1, MPI_INTEGER, numbers, 1, MPI_INTEGER, 0, MPI_COMM_WORLD)
    if (self%rank > 0) numbers = 0
    at(0) = 0
    do r = 1, self%ranks - 1
      at(r) = at(r - 1) + numbers(r - 1)
    end do
    allocate (all_values(sum(numbers)))
    call MPI_Gatherv(values, size(values), MPI_DOUBLE_PRECISION, all_values, numbers, at, &
      & MPI_DOUBLE_PRECISION, 0, MPI_COMM_WORLD)
  end procedure collect

  module procedure find_handles
    ranks = MPI_COMM_WORLD%MPI_VAL
    no_hints = MPI_INFO_NULL%MPI_VAL
  end procedure find_handles

  module procedure deal
    integer :: from(self%ranks), given_at(self%ranks + 1), taken_at(self%ranks + 1)
    integer :: r

    if (present(taken)) then
      from = taken
    else
      call MPI_Alltoall(given, 1, MPI_INTEGER, from, 1, MPI_INTEGER, MPI_COMM_WORLD)
    end if
    given_at(1) = 0
    taken_at(1) = 0
    do r = 1, self%ranks
      given_at(r + 1) = given_at(r) + given(r)
      taken_at(r + 1) = taken_at(r) + from(r)
    end do
    allocate (got(taken_at(self%ranks + 1)))
    call MPI_Alltoallv(values, given, given_at(:self%ranks), MPI_DOUBLE_PRECISION, got, from, &
      & taken_at(:self%ranks), MPI_DOUBLE_PRECISION, MPI_COMM_WORLD)
  end procedure deal

  module procedure number_before
    before = 0_i8
    call MPI_Exscan(number, before, 1, MPI_INTEGER8, MPI_SUM, MPI_COMM_WORLD)
    if (self%rank == 0) before = 0_i8
  end procedure number_before

  module procedure wait_for_all
    call MPI_Barrier(MPI_COMM_WORLD)
    if (self%ranks < 1) call internal_fault('no ranks')
  end procedure wait_for_all

end submodule messages
#endif
