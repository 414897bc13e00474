!> Where a relaxation by conjugate gradients stands between two of its iterations: all that passes
!> from one to the next (doc/theory.md, 7). Everything else follows from the system and its loads.
module pd_motion_newton
  use pd_base_archive, only: archive_type, of_slots, same
  use pd_base_kinds, only: wp
  use pd_force_tangent, only: tangent_type
  implicit none (type, external)
  private
  public :: newton_type, krylov_type, frame_type, ritz_type, sums_type, keep_newton

  !> What the loop along a direction sums up, squares over the free components.
  type :: sums_type
    real(wp) :: residual = 0.0_wp      !! (V F).(V F)
    real(wp) :: support = 0.0_wp       !! the same over the constrained components
    real(wp) :: change = 0.0_wp        !! of displacement by this step
    real(wp) :: displacement = 0.0_wp
    real(wp) :: rho = 0.0_wp           !! residual . preconditioned residual, weighted with volume
  end type sums_type

  !> The softest answer of the preconditioned stiffness that a solve has met: an estimate of the
  !> largest eigenvalue of its inverse, from the lengths of the iterations alone.
  type :: ritz_type
    real(wp) :: softness = 0.0_wp             !! the estimate [-]; 0 before the first iteration
    real(wp) :: inner = 0.0_wp                !! what the next update needs
    real(wp) :: last = 0.0_wp
    real(wp) :: length = 0.0_wp               !! of the last iteration
    real(wp) :: beta = 0.0_wp                 !! share of the last direction in this one
  end type ritz_type

  !> The free rigid motions of a pin at a configuration.
  type :: frame_type
    integer :: number = 0                   !! of them
    real(wp) :: centre(3) = 0.0_wp          !! about which its points turn [m]
    real(wp) :: size = 1.0_wp               !! makes rotations comparable [m]
    real(wp) :: combination(6, 6) = 0.0_wp  !! of three translations and three rotations
  end type frame_type

  !> A solve of the linear equations.
  type :: krylov_type
    real(wp), allocatable :: residual(:, :)   !! f + b on free components, else 0 [N/m3]
    real(wp), allocatable :: direction(:, :)  !! of the next iteration, small [m]
    real(wp), allocatable :: origin(:, :)     !! the displacements where the solve began [m]
    type(tangent_type) :: tangent             !! of the products; if `deformed` with the unprojected
                                              !! forces there
    real(wp) :: scale = 1.0_wp                !! of the directions
    real(wp) :: largest = 0.0_wp              !! component of the direction [m]
    real(wp) :: rho = 0.0_wp                  !! residual . preconditioned residual
    real(wp) :: norm = 0.0_wp                 !! curvature if the preconditioner were the stiffness
    real(wp), allocatable :: of_pins(:, :)    !! residual along the free motions (6, motions); of
                                              !! size 0 without pins
    logical :: deformed = .false.             !! the tangent at `origin`, else at no displacement
    type(ritz_type) :: ritz
    ! made anew wherever the solve continues
    real(wp), allocatable :: inverse(:, :)    !! the preconditioner: 1/mass, 0 where held [m4/N]
    real(wp), allocatable :: product(:, :)    !! stiffness times direction [N/m3]
    real(wp), allocatable :: mass(:, :)       !! what `inverse` is of, where there are pins [N/m4]
    type(frame_type), allocatable :: frames(:)  !! (motions) of pins at the origin
    real(wp), allocatable :: on_slow(:)       !! the residual on the functions of the coarse part,
    real(wp), allocatable :: slow(:)          !! and how they answer; not allocated without [N, m]
  end type krylov_type

  !> Newton's iterations and the solve under way.
  type :: newton_type
    type(krylov_type) :: krylov
    integer :: iterations = 0         !! of all solves
    real(wp) :: softness = 0.0_wp     !! the largest that solves with this kind of stiffness met
    real(wp) :: change = 0.0_wp       !! of displacement in the last iteration, over displacement
    type(sums_type) :: sums           !! of the true forces when last evaluated
    ! the solve
    type(sums_type) :: linear         !! as its equations have it
    real(wp) :: next_check = 0.0_wp    !! squared residual at which the true forces are evaluated
    real(wp) :: hopeless = 0.0_wp     !! squared residual that no solvable equations reach
    ! between solves
    real(wp) :: before = 0.0_wp       !! squared residual where the solve began
    real(wp) :: least = 0.0_wp        !! the smallest so far
    integer :: ahead = 0              !! solves that went uphill since then
    integer :: slow = 0               !! shortened steps that left much
    logical :: asked = .false.        !! the solve's residual has been below the tolerance
    logical :: fresh = .true.         !! nothing has been gained yet
    logical :: strict = .false.       !! no solve may go uphill
    logical :: coarse = .false.       !! the solve's preconditioner has a coarse part
    real(wp), allocatable :: best(:, :)  !! displacements of `least`, if `ahead` of them [m]
  end type newton_type

contains

  !> Keep all that an iteration leaves to the next one, or put it back.
  subroutine keep_newton(archive, newton)
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    type(newton_type), intent(inout) :: newton  !! set where the archive reads, else left as it is

    associate (krylov => newton%krylov)
      call archive%over(of_slots)
      call archive%keep('residual force', krylov%residual)
      call archive%keep('direction', krylov%direction)
      call archive%keep('origin', krylov%origin)
      call archive%keep('forces at the origin', krylov%tangent%forces)
      call archive%over(same)
      call archive%keep('residual of pins', krylov%of_pins)
      call archive%keep('scale', krylov%scale)
      call archive%keep('largest', krylov%largest)
      call archive%keep('rho', krylov%rho)
      call archive%keep('norm', krylov%norm)
      call archive%keep('deformed', krylov%deformed)
      call archive%keep('softness of the solve', krylov%ritz%softness)
      call archive%keep('inner product', krylov%ritz%inner)
      call archive%keep('last column', krylov%ritz%last)
      call archive%keep('last length', krylov%ritz%length)
      call archive%keep('beta', krylov%ritz%beta)
    end associate
    call archive%keep('iterations', newton%iterations)
    call archive%keep('softness', newton%softness)
    call archive%keep('change', newton%change)
    call keep_sums(archive, newton%sums)
    call keep_sums(archive, newton%linear)
    call archive%keep('next look', newton%next_check)
    call archive%keep('hopeless', newton%hopeless)
    call archive%keep('before', newton%before)
    call archive%keep('least', newton%least)
    call archive%keep('ahead', newton%ahead)
    call archive%keep('slow', newton%slow)
    call archive%keep('asked', newton%asked)
    call archive%keep('fresh', newton%fresh)
    call archive%keep('strict', newton%strict)
    call archive%keep('coarse part', newton%coarse)
    call archive%over(of_slots)
    call archive%keep('best', newton%best)
    call archive%over(same)
  end subroutine keep_newton

  subroutine keep_sums(archive, sums)
    class(archive_type), intent(inout) :: archive
    type(sums_type), intent(inout) :: sums

    call archive%keep('sum of residual', sums%residual)
    call archive%keep('sum of support', sums%support)
    call archive%keep('sum of change', sums%change)
    call archive%keep('sum of displacement', sums%displacement)
    call archive%keep('sum of rho', sums%rho)
  end subroutine keep_sums

end module pd_motion_newton
