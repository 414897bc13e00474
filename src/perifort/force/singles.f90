!> The state of a lattice as its loops in mixed precision need it. All procedures are called by all
!> threads of a parallel region, which wait for each other at the end.
module pd_force_singles
  use pd_base_kinds, only: wp, sp, i8
  use pd_force_workspace, only: singles_type
  implicit none (type, external)
  private
  public :: split_displacements, round_dilatation, clear_sums, add_sums, unit

  !> The leading digits of displacements are kept over this power of 2 (why: `pd_force_mixed`). Not
  !> 2, which a compiler may take for a sum.
  real(sp), parameter :: unit = 4096.0_sp

  !> Bits of a double real but those that a single one has no room for.
  integer(i8), parameter :: leading = not(2_i8**29 - 1_i8)

contains

  !> u = unit*high + low, each in single precision, to 47 bits. The leading digits are cut out as
  !> bits: a compiler that may simplify takes a difference from a rounded value for zero.
  subroutine split_displacements(singles, u)
    type(singles_type), intent(inout) :: singles        !! gets `high` and `low`
    real(wp), intent(in), contiguous :: u(:, :)         !! (n_slots, dim) displacements [m]
    real(wp) :: high
    integer :: k, c

    do c = 1, size(u, 2)
      !$omp do simd schedule(static) private(high)
      do k = 1, size(u, 1)
        high = transfer(iand(transfer(u(k, c), 0_i8), leading), 0.0_wp)
        singles%high(k, c) = real(high/unit, sp)
        singles%low(k, c) = real(u(k, c) - high, sp)
      end do
    end do
  end subroutine split_displacements

  !> The dilatation's coefficients `p` (n_slots) in single precision.
  subroutine round_dilatation(singles, p)
    type(singles_type), intent(inout) :: singles  !! gets `p`, times its unit of volume
    real(wp), intent(in), contiguous :: p(:)  !! (n_slots) 2 a d delta theta [N/m5]
    integer :: k

    !$omp do simd schedule(static)
    do k = 1, size(p)
      singles%p(k) = real(singles%volume*p(k), sp)
    end do
  end subroutine round_dilatation

  !> Set the first `n` sums to zero.
  subroutine clear_sums(singles, n)
    type(singles_type), intent(inout) :: singles  !! its sums are set
    integer, intent(in) :: n  !! number of sums: 1 for theta, dim for forces
    integer :: k, c

    do c = 1, n
      !$omp do simd schedule(static)
      do k = 1, size(singles%sums, 1)
        singles%sums(k, c) = 0.0_sp
      end do
    end do
  end subroutine clear_sums

  !> Add the `c`-th sum, times `unit`, to `values` (n_slots).
  subroutine add_sums(singles, c, unit, values)
    type(singles_type), intent(in) :: singles         !! with complete sums
    integer, intent(in) :: c                          !! number of the sum
    real(wp), intent(in) :: unit                      !! of the sum
    real(wp), intent(inout), contiguous :: values(:)  !! (n_slots) added to
    integer :: k

    !$omp do simd schedule(static)
    do k = 1, size(values)
      values(k) = values(k) + unit*real(singles%sums(k, c), wp)
    end do
  end subroutine add_sums

end module pd_force_singles
