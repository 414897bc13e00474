!> What both ways to rest share: how to relax, the force that is out of balance, and what to say
!> when it doesn't vanish.
module pd_motion_residual
  use pd_base_kinds, only: wp, i1
  use pd_base_error, only: error_type, fail, status_no_answer
  use pd_base_text, only: to_text
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: relaxation_type, squared_force, fail_unconverged

  !> How to relax.
  type :: relaxation_type
    logical :: conjugate_gradient = .false.   !! else adaptive dynamic relaxation alone
    integer :: load_steps = 1
    integer :: maximum_iterations = 100000    !! of each relaxation
    real(wp) :: tolerance = 1.0e-6_wp         !! of residual force and displacement change [-]
    real(wp), allocatable :: mass(:, :)       !! lambda for a step of 1 (n_slots, dim) [N/m4]
  end type relaxation_type

contains

  !> (V F).(V F) over the free components of a force density.
  pure real(wp) function squared_force(system, density) result(squared)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: density(:, :)
    integer :: c
    squared = 0.0_wp
    do c = 1, size(density, 2)
      squared = squared + sum((density(:, c)*system%body%volume)**2, mask=system%held(:, c) == 0_i1)
    end do
  end function squared_force

  !> The error of a relaxation whose iterations are used up; `residual` and `change` are where it
  !> stands.
  subroutine fail_unconverged(relaxation, load_step, residual, change, error)
    type(relaxation_type), intent(in) :: relaxation
    integer, intent(in) :: load_step
    real(wp), intent(in) :: residual, change
    type(error_type), allocatable, intent(out) :: error

    call fail(error, 'not converged: after '//to_text(relaxation%maximum_iterations)// &
      & ' iterations of load step '//to_text(load_step)//' the residual force is '// &
      & to_text(residual)//' and the change of displacement '//to_text(change)//' (tolerance '// &
      & to_text(relaxation%tolerance)// &
      & '). Raise maximum_iterations or tolerance, or use more load steps', status_no_answer)
  end subroutine fail_unconverged

end module pd_motion_residual
