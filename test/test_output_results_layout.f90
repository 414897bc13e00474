!> The sizes of the blocks in which fields are stored.
module test_output_results_layout
  use pd_base_kinds, only: sp, wp, i8
  use pd_output_results_layout, only: chunk_rows, to_single
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_output_results_layout

contains

  subroutine collect_output_results_layout(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)

    testsuite = [ &
      & new_unittest('small_outputs_share_a_chunk', small_outputs), &
      & new_unittest('large_outputs_are_divided', large_outputs), &
      & new_unittest('limits', limits), &
      & new_unittest('single_precision', single_precision) &
      & ]
  end subroutine collect_output_results_layout

  subroutine small_outputs(error)
    type(error_type), allocatable, intent(out) :: error

    ! 100 points x 24 bytes: 27 outputs in 64 kB
    call check(error, chunk_rows(100_i8, 24_i8, 1000_i8) == 2700_i8)
    if (allocated(error)) return
    call check(error, chunk_rows(100_i8, 24_i8, 5_i8) == 500_i8, 'more room than planned outputs')
    if (allocated(error)) return
    call check(error, chunk_rows(10000_i8, 24_i8, 50_i8) == 10000_i8, 'one output a chunk')
  end subroutine small_outputs

  subroutine large_outputs(error)
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: rows

    rows = chunk_rows(1000000_i8, 24_i8, 100_i8)
    call check(error, mod(1000000_i8, rows) == 0_i8, 'outputs begin within a chunk')
    if (allocated(error)) return
    call check(error, rows*24_i8 >= 1048576_i8 .and. rows*24_i8 <= 8388608_i8, '1 to 8 MB')
    if (allocated(error)) return
    ! a prime number of points can't be divided evenly
    rows = chunk_rows(1000003_i8, 24_i8, 100_i8)
    call check(error, rows*24_i8 >= 1048576_i8 .and. rows*24_i8 <= 8388608_i8, '1 to 8 MB')
  end subroutine large_outputs

  subroutine limits(error)
    type(error_type), allocatable, intent(out) :: error
    integer(i8) :: rows

    rows = chunk_rows(10000000_i8, 24_i8, 100000_i8)
    call check(error, rows*24_i8 < 4294967296_i8, 'HDF5 takes no chunk of 4 GB')
    if (allocated(error)) return
    call check(error, chunk_rows(1_i8, 8_i8, 1_i8) == 1_i8)
  end subroutine limits

  subroutine single_precision(error)
    type(error_type), allocatable, intent(out) :: error

    call check(error, to_single(0.1_wp) - 0.1_sp, 0.0_sp, thr=1.0e-12_sp)
    if (allocated(error)) return
    call check(error, to_single(1.0e300_wp) >= huge(1.0_sp), 'a large number is lost')
    if (allocated(error)) return
    call check(error, to_single(-1.0e300_wp) <= -huge(1.0_sp), 'its sign is lost')
  end subroutine single_precision

end module test_output_results_layout
