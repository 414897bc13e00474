!> Factors of sparse semidefinite matrices, against elimination of whole matrices.
module test_set_up_consistent_envelope
  use bodies, only: expect_true
  use comparisons, only: expect_close
  use elimination, only: eliminate
  use pd_base_kinds, only: wp
  use pd_set_up_consistent_envelope, only: add_product, envelope_type, factorize_envelope, &
    & new_envelope, solve_envelope, work_of_envelope
  use testdrive, only: error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_set_up_consistent_envelope

  integer, parameter :: nodes = 40, components = 2, within = 3, last = 4

contains

  subroutine collect_set_up_consistent_envelope(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)

    testsuite = [ &
      & new_unittest('the solution of a definite matrix', test_definite), &
      & new_unittest('a semidefinite matrix is solved where it can be', test_semidefinite)]
  end subroutine collect_set_up_consistent_envelope

  !> Numbers between -0.5 and 0.5 without an order.
  elemental real(wp) function uneven(i)
    integer, intent(in) :: i
    uneven = modulo(0.6180339887498949_wp*i**2, 1.0_wp) - 0.5_wp
  end function uneven

  !> A row of nodes, each in products with the next ones, in an order of its own.
  subroutine make(definite, envelope, matrix)
    logical, intent(in) :: definite
    type(envelope_type), intent(out) :: envelope
    real(wp), intent(out) :: matrix(nodes*components, nodes*components)
    integer :: place(nodes), lowest(nodes), met(2), s, ahead, pass, c, d, n
    real(wp) :: vector(components, 2)

    ! the last places are of nodes spread over the row
    place = [(s, s=1, nodes)]
    do s = 1, last
      place(s*nodes/last) = nodes - last + s
    end do
    c = 0
    do s = 1, nodes
      if (mod(s, nodes/last) == 0) cycle
      c = c + 1
      place(s) = c
    end do
    lowest = [(max(1, s - within), s=1, nodes)]
    lowest(nodes - last + 1:) = 1
    call new_envelope(place, lowest, last, components, envelope)
    matrix = 0.0_wp
    n = 0
    do pass = 1, 3
      do s = 1, nodes
        do ahead = merge(0, 1, definite), 2
          if (s + ahead > nodes) cycle
          n = n + 1
          vector = reshape(uneven([(4*n + d, d=1, 4)]), shape(vector))
          ! without effect on values that are the same at all nodes
          if (.not. definite) vector(:, 2) = -vector(:, 1)
          met = [s, s + ahead]
          if (ahead == 0) then
            call add_product(met(:1), vector(:, :1), 1, size(vector, 1), envelope)
            vector(:, 2) = 0.0_wp
          else
            call add_product(met, vector, 1, size(vector, 1), envelope)
          end if
          do c = 1, 2
            do d = 1, 2
              associate (at => components*(met(c) - 1), to => components*(met(d) - 1))
                matrix(at + 1:at + components, to + 1:to + components) = &
                  & matrix(at + 1:at + components, to + 1:to + components) &
                  & + spread(vector(:, c), 2, components)*spread(vector(:, d), 1, components)
              end associate
            end do
          end do
        end do
      end do
    end do
    call factorize_envelope(envelope)
  end subroutine make

  subroutine test_definite(error)
    type(error_type), allocatable, intent(out) :: error
    type(envelope_type) :: envelope
    real(wp) :: matrix(nodes*components, nodes*components), c(components, nodes)
    real(wp) :: x(nodes*components)
    logical :: singular
    integer :: i

    call make(.true., envelope, matrix)
    c = reshape(uneven([(i, i=1, size(c))]), shape(c))
    x = reshape(c, shape(x))
    call solve_envelope(envelope, c)
    call eliminate(matrix, x, singular)
    call expect_true(error, .not. singular, 'elimination finds a solution')
    if (allocated(error)) return
    ! condition numbers are below 1e5
    call expect_close(error, reshape(c, shape(x)), x, 1.0e-9_wp*norm2(x), 'solution')
    call expect_true(error, work_of_envelope([1, 1, 1], 2) > work_of_envelope([1, 1, 2], 2), &
      & 'a wider envelope takes more work')
  end subroutine test_definite

  !> Values that are the same at all nodes are without effect, and only right sides that sum up to
  !> nothing have solutions.
  subroutine test_semidefinite(error)
    type(error_type), allocatable, intent(out) :: error
    type(envelope_type) :: envelope
    real(wp) :: matrix(nodes*components, nodes*components), c(components, nodes), &
      & right(components, nodes)
    integer :: i

    call make(.false., envelope, matrix)
    right = reshape(uneven([(i, i=1, size(right))]), shape(right))
    do i = 1, components
      right(i, :) = right(i, :) - sum(right(i, :))/nodes
    end do
    c = right
    call solve_envelope(envelope, c)
    call expect_close(error, matmul(matrix, reshape(c, [size(c)])), reshape(right, [size(c)]), &
      & 1.0e-9_wp, 'the matrix times the solution')
    call expect_true(error, size(envelope%chosen) == components*last - components, &
      & 'two rows follow from others')
  end subroutine test_semidefinite

end module test_set_up_consistent_envelope
