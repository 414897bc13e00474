!> What both ways to static equilibrium share: how to relax, and the norm of the force that is out
!> of balance.
module pd_motion_static_residual
  use pd_base_kinds, only: wp, i1
  use pd_base_order, only: block_points, slots_of_block
  use pd_base_reduce, only: add_block, new_sums, sums_type, total_of
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: relaxation_type, squared_force

  !> How to relax.
  type :: relaxation_type
    logical :: conjugate_gradient = .false.   !! else adaptive dynamic relaxation alone
    integer :: load_steps = 1
    logical :: events = .false.               !! bonds break by events, else after load steps
    logical :: load_controlled = .true.       !! by events: the load factor never decreases
    real(wp) :: batch = 1.0e-6_wp             !! bonds so near to their limit break together [-]
    integer :: most_events = huge(1)          !! after which the run ends
    integer :: maximum_iterations = 100000    !! of each relaxation
    real(wp) :: tolerance = 1.0e-6_wp         !! of residual force and displacement change [-]
    real(wp), allocatable :: mass(:, :)       !! lambda for a step of 1 (n_slots, dim) [N/m4]
  end type relaxation_type

contains

  !> (V F).(V F) over the free components of a force density, or over all with `held` [N2].
  real(wp) function squared_force(system, density, held) result(squared)
    type(system_type), intent(in) :: system  !! its volumes and constrained components
    real(wp), intent(in) :: density(:, :)   !! (n_slots, dim) force density [N/m3]
    logical, intent(in), optional :: held   !! constrained components, too
    type(sums_type) :: parts
    real(wp) :: terms(block_points, 1), totals(1)
    integer :: block, c, i, k, n, slots(block_points)
    logical :: everywhere

    everywhere = .false.
    if (present(held)) everywhere = held
    call new_sums(system%body%order, 1, parts)
    do block = 1, system%body%order%blocks
      call slots_of_block(system%body%order, block, n, slots)
      terms = 0.0_wp
      do c = 1, size(density, 2)
        do i = 1, n
          k = slots(i)
          if (system%held(k, c) == 1_i1 .and. .not. everywhere) cycle
          terms(i, 1) = terms(i, 1) + (density(k, c)*system%body%volume(k))**2
        end do
      end do
      call add_block(block, terms, parts)
    end do
    totals = total_of(system%body%order, parts)
    squared = totals(1)
  end function squared_force

end module pd_motion_static_residual
