!> Where a motion stands, beside its state: what integrators and relaxation carry from one instant
!> that an observer sees to the next. It lies in the system, so that whoever keeps the system can go
!> on from there as if nothing had been in between.
module pd_motion_memory
  use pd_base_archive, only: archive_type, of_slots, same
  use pd_base_kinds, only: wp
  use pd_motion_coarse, only: coarse_type
  use pd_motion_newton, only: newton_type, keep_newton
  implicit none (type, external)
  private
  public :: memory_type, keep_memory, not_begun

  integer, parameter :: not_begun = -1

  type :: memory_type
    integer :: step = not_begun            !! complete steps (iterations) at the last instant seen
    ! explicit integration by the Adams rules
    integer :: filled = 0                  !! how many earlier steps are kept
    real(wp), allocatable :: v(:, :, :)    !! velocities of t_{n-1}, t_{n-2} (n_slots, dim, 2) [m/s]
    real(wp), allocatable :: a(:, :, :)    !! accelerations then (n_slots, dim, 2) [m/s2]
    ! relaxation
    integer :: load_step = 0               !! the load step under way, or the last one settled
    integer :: began = 0                   !! step at which the load step began
    integer :: iteration = 0               !! of the dynamic relaxation under way; 0: none is
    type(newton_type), allocatable :: newton  !! there while conjugate gradients are under way
    type(coarse_type), allocatable :: coarse  !! of their preconditioner; made anew where missing
    real(wp), allocatable :: rate(:, :)    !! displacement per iteration (n_slots, dim) [m]
    real(wp), allocatable :: base(:, :)    !! displacements where dynamic relaxation began [m]
    real(wp), allocatable :: trend(:, :)   !! of the last load step, of 0 rows if of no use [m]
    real(wp), allocatable :: start(:, :)   !! displacements where the load step began [m]
    integer :: next_judgement = 0          !! iteration of dynamic relaxation that is judged next
    real(wp) :: softness = 0.0_wp          !! of the preconditioned stiffness, as far as known [-]
    real(wp) :: residual = 0.0_wp          !! relative [-]
    real(wp) :: stiffness = 0.0_wp         !! U.K.U of 7.36
    real(wp) :: moved = 0.0_wp             !! U.U, both from `base` [m2]
    real(wp) :: displacement = 0.0_wp      !! square of all displacements [m2]
    real(wp) :: change = 0.0_wp            !! dU.dU [m2]
    ! growth by events
    real(wp) :: factor = 0.0_wp            !! load factor of the equilibrium, or on the way there
    integer :: purpose = 0                 !! why that one is sought
    integer :: reached = 0                 !! load steps whose load factor has been reached
    integer :: events = 0                  !! batches of bonds broken so far
    integer :: tries = 0                   !! equilibria sought for the event to come
    real(wp) :: tried_factor = 0.0_wp      !! an earlier equilibrium with the same bonds: its load
    real(wp) :: tried_ratio = 0.0_wp       !! factor, and its largest stretch over the limit [-]
  end type memory_type

contains

  !> Keep all of it, or put it back.
  subroutine keep_memory(archive, memory)
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    type(memory_type), intent(inout) :: memory  !! set where the archive reads, else left as it is
    logical :: conjugate

    call archive%keep('step', memory%step)
    call archive%keep('earlier steps', memory%filled)
    call archive%over(of_slots)
    call archive%keep('earlier velocities', memory%v)
    call archive%keep('earlier accelerations', memory%a)
    call archive%over(same)
    call archive%keep('load step', memory%load_step)
    call archive%keep('begin of load step', memory%began)
    call archive%keep('iteration', memory%iteration)
    call archive%over(of_slots)
    call archive%keep('rate', memory%rate)
    call archive%keep('base', memory%base)
    call archive%keep('trend', memory%trend)
    call archive%keep('start of load step', memory%start)
    call archive%over(same)
    call archive%keep('next judgement', memory%next_judgement)
    call archive%keep('softness', memory%softness)
    call archive%keep('residual', memory%residual)
    call archive%keep('U.K.U', memory%stiffness)
    call archive%keep('U.U', memory%moved)
    call archive%keep('displacement', memory%displacement)
    call archive%keep('dU.dU', memory%change)
    call archive%keep('load factor', memory%factor)
    call archive%keep('purpose', memory%purpose)
    call archive%keep('load steps reached', memory%reached)
    call archive%keep('events', memory%events)
    call archive%keep('tries', memory%tries)
    call archive%keep('load factor tried', memory%tried_factor)
    call archive%keep('stretch ratio tried', memory%tried_ratio)
    conjugate = allocated(memory%newton)
    call archive%keep('conjugate gradients', conjugate)
    if (allocated(memory%newton) .and. .not. conjugate) deallocate (memory%newton)
    if (conjugate .and. .not. allocated(memory%newton)) allocate (memory%newton)
    if (conjugate) call keep_newton(archive, memory%newton)
  end subroutine keep_memory

end module pd_motion_memory
