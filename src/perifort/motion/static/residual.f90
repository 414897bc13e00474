!> What both ways to static equilibrium share: how to relax, and the norm of the force that is out
!> of balance.
module pd_motion_static_residual
  use pd_base_kinds, only: wp, i1
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: relaxation_type, squared_force

  !> How to relax.
  type :: relaxation_type
    logical :: conjugate_gradient = .false.   !! else adaptive dynamic relaxation alone
    integer :: load_steps = 1
    integer :: maximum_iterations = 100000    !! of each relaxation
    real(wp) :: tolerance = 1.0e-6_wp         !! of residual force and displacement change [-]
    real(wp), allocatable :: mass(:, :)       !! lambda for a step of 1 (n_slots, dim) [N/m4]
  end type relaxation_type

contains

  !> (V F).(V F) over the free components of a force density [N2].
  pure real(wp) function squared_force(system, density) result(squared)
    type(system_type), intent(in) :: system  !! its volumes and constrained components
    real(wp), intent(in) :: density(:, :)    !! (n_slots, dim) force density [N/m3]
    integer :: c
    squared = 0.0_wp
    do c = 1, size(density, 2)
      squared = squared + sum((density(:, c)*system%body%volume)**2, mask=system%held(:, c) == 0_i1)
    end do
  end function squared_force

end module pd_motion_static_residual
