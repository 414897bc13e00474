!> How far the displacements of a state are from equilibrium, which its residual alone does not
!> show: a slender beam, or a stiff block on a soft pad, has a small residual long before.
module pd_motion_static_estimate
  use pd_base_kinds, only: wp, i1
  use pd_base_reduce, only: add_point, new_running, running_type, total_of_running
  use pd_motion_static_krylov, only: make_room, linearise, take_residual, first_direction, &
    & next_direction, apply_stiffness, go_along, volume_inner, note_length, smallest_curvature
  use pd_motion_pins, only: held_but_for_pins
  use pd_motion_static_pins, only: add_drive
  use pd_motion_newton, only: krylov_type, sums_type
  use pd_motion_static_residual, only: relaxation_type
  use pd_motion_static_rigid, only: rigid_type, remove_free_motions
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: estimate_error

  !> The estimate ends when what is still missing is surely less than this part of it.
  real(wp), parameter :: sure = 0.3_wp
  !> ... or when so little is left of the residual (squared) that rounding and the differences that
  !> make the tangent decide about it.
  real(wp), parameter :: used_up = 1.0e-10_wp
  integer, parameter :: fewest = 10

contains

  !> Whether the error energy of every piece is within `allowed`. The correction that the present
  !> tangent and residual ask for is computed by conjugate gradients; the energy of the error is
  !> the sum of what the iterations gain, as far as they have come, and the softest answer they have
  !> met bounds the rest. A tangent that is not positive says nothing: then `within` is true, and
  !> there is nothing but the residual to go by. The system is left as it was.
  subroutine estimate_error(system, relaxation, rigid, t, allowed, most, within, iterations)
    type(system_type), intent(inout) :: system       !! a state whose forces are known
    type(relaxation_type), intent(in) :: relaxation  !! has the preconditioner
    type(rigid_type), intent(in) :: rigid            !! pieces and their free motions
    real(wp), intent(in) :: t                        !! time of the loads [s]
    real(wp), intent(in) :: allowed(:)               !! error energy of each piece [J]
    integer, intent(in) :: most                      !! iterations; if they are used up, it is not
                                                     !! within
    logical, intent(out) :: within                   !! so far as is known
    integer, intent(out) :: iterations               !! that it has taken
    type(krylov_type) :: krylov
    type(sums_type) :: sums
    real(wp), allocatable :: u(:, :), force(:, :), first(:, :), energy(:)
    type(running_type) :: running
    integer(i1), allocatable :: held(:, :)
    real(wp) :: curvature, gained, rho, totals(6)
    integer :: p, i, k

    allocate (u, source=system%state%u)
    allocate (force, source=system%state%force)
    call make_room(system, relaxation%mass, krylov)
    call linearise(system, .true., krylov)
    call take_residual(system, t, krylov, sums)
    call remove_free_motions(system, rigid, krylov%residual)
    where (.not. krylov%inverse > 0.0_wp) krylov%residual = 0.0_wp
    allocate (first, source=krylov%residual)
    if (size(krylov%of_pins) > 0) call add_drive(system, krylov%frames, krylov%origin, &
      & krylov%of_pins, 1.0_wp, first, krylov%mass)
    held = held_but_for_pins(system)
    call first_direction(system, krylov)
    rho = sums%rho
    gained = 0.0_wp
    within = .true.
    do iterations = 0, most
      if (.not. krylov%largest > 0.0_wp) exit
      within = iterations < most
      if (.not. within) exit
      call apply_stiffness(system, krylov)
      curvature = volume_inner(system, krylov%direction, krylov%product)
      if (.not. curvature > smallest_curvature*krylov%norm) exit
      call note_length(curvature, krylov)
      gained = gained + krylov%rho**2/curvature
      within = gained <= sum(allowed)
      if (.not. within) exit
      call go_along(system, krylov%rho/curvature, krylov, sums)
      if (sums%rho <= used_up*rho) exit
      if (iterations >= fewest .and. sums%rho*krylov%ritz%softness <= sure*gained) exit
      call next_direction(system, sums%rho, krylov)
    end do
    if (within) then
      allocate (energy(size(allowed)), source=0.0_wp)
      do p = 1, rigid%pieces%number
        call new_running(running)
        do i = rigid%pieces%start(p), rigid%pieces%start(p + 1) - 1
          k = rigid%pieces%slots(i)
          call add_point(system%body%order, system%body%point(k), [system%body%volume(k) &
            & *sum((system%state%u(k, :) - u(k, :))*first(k, :), mask=held(k, :) == 0_i1)], &
            & running)
        end do
        totals = total_of_running(system%body%order, running)
        energy(p) = totals(1)
      end do
      within = all(energy <= allowed)
    end if
    system%state%u = u
    system%state%force = force
  end subroutine estimate_error

end module pd_motion_static_estimate
