!> The processes of a run, its ranks, and what they say to each other. This folder alone knows the
!> library that carries messages: `mpi.F90` sends them by MPI, `alone.F90` is the program without
!> it, which is one rank.
module pd_comm_world
  use pd_base_clock, only: wall_time
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_order, only: ranks_type
  implicit none (type, external)
  private
  public :: world_type, begin_world, end_world, abort_world, reports_error, find_handles

  !> Values on their way.
  type :: exchange_type
    real(wp), allocatable :: sent(:)               !! by neighbour, then component
    real(wp), allocatable :: taken(:)
    integer, allocatable :: request(:)             !! handles of the messages
  end type exchange_type

  !> All ranks, and of one body's halo: which values go where.
  type, extends(ranks_type) :: world_type
    integer :: rank = 0                            !! of this process, from 0
    integer :: ranks = 1                           !! how many there are
    logical :: reproducible = .false.              !! forces must not depend on the ranks
    integer, allocatable :: neighbour(:)           !! ranks that share points with this one
    integer, allocatable :: send_first(:)          !! first one of each neighbour in `send_slot`,
                                                   !! and one past the last
    integer(i4), allocatable :: send_slot(:)       !! slots of points that others have copies of
    integer, allocatable :: take_first(:)          !! the same of `take_slot`
    integer(i4), allocatable :: take_slot(:)       !! slots of copies, neighbour by neighbour
    type(exchange_type) :: exchanges(2)            !! what is on its way
  contains
    procedure :: add_all
    procedure :: take_largest
    procedure :: start_sharing
    procedure :: finish_sharing
    procedure :: join
    procedure :: collect
    procedure :: deal
    procedure :: number_before
    procedure :: wait_for_all
    procedure :: count_anew
  end type world_type

  interface
    !> Begin: the rank of this process and how many there are.
    module subroutine begin_world(world)
      implicit none (type, external)
      type(world_type), intent(inout) :: world  !! knows its ranks on return
    end subroutine begin_world

    !> End the messages of this process, after its last one.
    module subroutine end_world()
      implicit none (type, external)
    end subroutine end_world

    !> End all processes at once, where one cannot go on and others wait for it. On one rank this
    !> does nothing.
    module subroutine abort_world(status)
      implicit none (type, external)
      integer, intent(in) :: status  !! exit status of all
    end subroutine abort_world

    !> Before the message of an error that other ranks may have, too, or not: whether this rank
    !> reports it. Of those that ask within a second it is the lowest one, and no other of the run
    !> does. A rank that does not report returns only if it has not been ended for long.
    module function reports_error(world) result(reports)
      implicit none (type, external)
      type(world_type), intent(in) :: world  !! the ranks of the program
      logical :: reports
    end function reports_error

    !> What a library that uses MPI itself must be given, as integers of MPI's older interface;
    !> -1 without MPI.
    module subroutine find_handles(ranks, no_hints)
      implicit none (type, external)
      integer, intent(out) :: ranks     !! the group of all ranks
      integer, intent(out) :: no_hints  !! says that there is nothing to be known of files
    end subroutine find_handles

    !> Replace `values` by their sums over all ranks.
    module subroutine add_all(self, values)
      implicit none (type, external)
      class(world_type), intent(inout) :: self
      real(wp), intent(inout) :: values(:)  !! as many on every rank
    end subroutine add_all

    !> Replace each value by the largest of all ranks; a value that is not a number is larger than
    !> any, so that all ranks decide alike.
    module subroutine take_largest(self, values)
      implicit none (type, external)
      class(world_type), intent(inout) :: self
      real(wp), intent(inout) :: values(:)  !! as many on every rank
    end subroutine take_largest

    !> Send the values of owned points to those that have copies: one message for each neighbour.
    module subroutine start_sharing(self, values, which)
      implicit none (type, external)
      class(world_type), intent(inout) :: self
      real(wp), intent(in), contiguous :: values(:, :)  !! (n_slots, components)
      integer, intent(in) :: which                      !! `exchange` or `side_exchange`
    end subroutine start_sharing

    !> Wait for the values of copies, and for what is sent.
    module subroutine finish_sharing(self, values, which)
      implicit none (type, external)
      class(world_type), intent(inout) :: self
      real(wp), intent(inout), contiguous :: values(:, :)  !! (n_slots, components)
      integer, intent(in) :: which                         !! that has been started
    end subroutine finish_sharing

    !> Find out what each rank sends: every rank tells the owners of its copies which they are.
    module subroutine join(self, owner, number, slot, owned_number, owned_slot)
      implicit none (type, external)
      class(world_type), intent(inout) :: self
      integer, intent(in) :: owner(:)            !! rank that owns each copy, from 0
      integer(i8), intent(in) :: number(:)       !! of each copy's point among all
      integer(i4), intent(in) :: slot(:)         !! of each copy here
      integer(i8), intent(in) :: owned_number(:) !! of the points that this rank owns, ascending
      integer(i4), intent(in) :: owned_slot(:)   !! their slots
    end subroutine join

    !> The sum of what the ranks before this one have; 0 on the first.
    module function number_before(self, number) result(before)
      implicit none (type, external)
      class(world_type), intent(inout) :: self
      integer(i8), intent(in) :: number  !! of this rank
      integer(i8) :: before
    end function number_before

    !> Values of all ranks one after another, in the order of ranks, on rank 0; nothing on others.
    module subroutine collect(self, values, all_values)
      implicit none (type, external)
      class(world_type), intent(inout) :: self
      real(wp), intent(in) :: values(:)                    !! of this rank; any number
      real(wp), allocatable, intent(out) :: all_values(:)  !! on rank 0; of size 0 elsewhere
    end subroutine collect

    !> Every rank gives every rank some of its values.
    module subroutine deal(self, values, given, got, taken)
      implicit none (type, external)
      class(world_type), intent(inout) :: self
      real(wp), intent(in) :: values(:)   !! those for the first rank, those for the second, ..
      integer, intent(in) :: given(:)     !! (ranks) how many each rank gets
      real(wp), allocatable, intent(out) :: got(:)  !! from the first rank, from the second, ..
      integer, intent(in), optional :: taken(:)
        !! (ranks) how many come from each, if all ranks know it; else they tell each other
    end subroutine deal

    !> Wait until all ranks are here.
    module subroutine wait_for_all(self)
      implicit none (type, external)
      class(world_type), intent(inout) :: self
    end subroutine wait_for_all
  end interface

contains

  !> Forget what has been counted of messages, so that what follows is counted alone.
  pure subroutine count_anew(self)
    class(world_type), intent(inout) :: self

    self%bytes = 0_i8
    self%messages = 0_i8
    self%sums = 0_i8
    self%sharing = 0.0_wp
    self%summing = 0.0_wp
  end subroutine count_anew

end module pd_comm_world
