!> Comparisons of numbers that fail on NaN, which MAXVAL and MINVAL of gfortran skip, and that name
!> the worst place of an array.
module comparisons
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use pd_base_kinds, only: wp
  use testdrive, only: error_type, test_failed
  implicit none (type, external)
  private
  public :: expect_close, close_number, max_abs, text_of

  !> Fail unless |actual - expected| <= tolerance everywhere; NaN fails, and so do other extents. A
  !> failure that stands is kept.
  interface expect_close
    module procedure :: close_number
    module procedure :: close_vector, close_vector_to_number
    module procedure :: close_matrix, close_matrix_to_number
  end interface expect_close

  !> Largest absolute value of an array, NaN if it holds one.
  interface max_abs
    module procedure :: max_abs_of_vector, max_abs_of_matrix
  end interface max_abs

contains

  !> One number against another.
  subroutine close_number(error, actual, expected, tolerance, what)
    type(error_type), allocatable, intent(inout) :: error  !! failure of the test
    real(wp), intent(in) :: actual       !! what was found
    real(wp), intent(in) :: expected     !! what it should be
    real(wp), intent(in) :: tolerance    !! largest difference that passes
    character(*), intent(in) :: what     !! name of the quantity, for the message

    if (allocated(error)) return
    if (abs(actual - expected) <= tolerance) return
    call test_failed(error, what//': '//text_of(actual)//', expected '//text_of(expected)// &
      & ' within '//text_of(tolerance))
  end subroutine close_number

  !> An array against another of the same size, element by element.
  subroutine close_vector(error, actual, expected, tolerance, what)
    type(error_type), allocatable, intent(inout) :: error  !! failure of the test
    real(wp), intent(in) :: actual(:)    !! what was found
    real(wp), intent(in) :: expected(:)  !! what it should be, of the same size
    real(wp), intent(in) :: tolerance    !! largest difference that passes
    character(*), intent(in) :: what     !! name of the quantity, for the message
    integer :: worst

    if (allocated(error)) return
    if (size(actual) /= size(expected)) then
      call test_failed(error, what//': arrays of different sizes')
      return
    end if
    if (all(abs(actual - expected) <= tolerance)) return
    worst = worst_of(actual - expected)
    call close_number(error, actual(worst), expected(worst), tolerance, what//' at '// &
      & place_of([worst]))
  end subroutine close_vector

  !> An array whose elements should all be one number.
  subroutine close_vector_to_number(error, actual, expected, tolerance, what)
    type(error_type), allocatable, intent(inout) :: error  !! failure of the test
    real(wp), intent(in) :: actual(:)    !! what was found
    real(wp), intent(in) :: expected     !! what each element should be
    real(wp), intent(in) :: tolerance    !! largest difference that passes
    character(*), intent(in) :: what     !! name of the quantity, for the message

    call close_vector(error, actual, spread(expected, 1, size(actual)), tolerance, what)
  end subroutine close_vector_to_number

  !> A matrix against another of the same shape, element by element.
  subroutine close_matrix(error, actual, expected, tolerance, what)
    type(error_type), allocatable, intent(inout) :: error  !! failure of the test
    real(wp), intent(in) :: actual(:, :)    !! what was found
    real(wp), intent(in) :: expected(:, :)  !! what it should be, of the same shape
    real(wp), intent(in) :: tolerance       !! largest difference that passes
    character(*), intent(in) :: what        !! name of the quantity, for the message
    integer :: worst, row, column

    if (allocated(error)) return
    if (any(shape(actual) /= shape(expected))) then
      call test_failed(error, what//': matrices of different shapes')
      return
    end if
    if (all(abs(actual - expected) <= tolerance)) return
    worst = worst_of([actual - expected])
    row = mod(worst - 1, size(actual, 1)) + 1
    column = (worst - 1)/size(actual, 1) + 1
    call close_number(error, actual(row, column), expected(row, column), tolerance, what//' at '// &
      & place_of([row, column]))
  end subroutine close_matrix

  !> A matrix whose elements should all be one number.
  subroutine close_matrix_to_number(error, actual, expected, tolerance, what)
    type(error_type), allocatable, intent(inout) :: error  !! failure of the test
    real(wp), intent(in) :: actual(:, :)  !! what was found
    real(wp), intent(in) :: expected      !! what each element should be
    real(wp), intent(in) :: tolerance     !! largest difference that passes
    character(*), intent(in) :: what      !! name of the quantity, for the message

    call close_matrix(error, actual, spread(spread(expected, 1, size(actual, 1)), 2, &
      & size(actual, 2)), tolerance, what)
  end subroutine close_matrix_to_number

  !> Index of the first NaN, else of the largest absolute value.
  pure integer function worst_of(values)
    real(wp), intent(in) :: values(:)  !! differences
    integer :: i

    do i = 1, size(values)
      if (.not. ieee_is_nan(values(i))) cycle
      worst_of = i
      return
    end do
    worst_of = maxloc(abs(values), 1)
  end function worst_of

  !> Indices as text, as (3, 1).
  pure function place_of(indices) result(text)
    integer, intent(in) :: indices(:)  !! of an element
    character(:), allocatable :: text
    character(12) :: buffer
    integer :: i

    text = '('
    do i = 1, size(indices)
      write (buffer, '(i0)') indices(i)
      if (i > 1) text = text//', '
      text = text//trim(buffer)
    end do
    text = text//')'
  end function place_of

  !> `max_abs` of a vector.
  pure real(wp) function max_abs_of_vector(values) result(largest)
    real(wp), intent(in) :: values(:)  !! any numbers

    largest = maxval(abs(values))
    if (any(ieee_is_nan(values))) largest = ieee_value(largest, ieee_quiet_nan)
  end function max_abs_of_vector

  !> `max_abs` of a matrix.
  pure real(wp) function max_abs_of_matrix(values) result(largest)
    real(wp), intent(in) :: values(:, :)  !! any numbers

    largest = maxval(abs(values))
    if (any(ieee_is_nan(values))) largest = ieee_value(largest, ieee_quiet_nan)
  end function max_abs_of_matrix

  !> A number as text.
  pure function text_of(value) result(text)
    real(wp), intent(in) :: value  !! any number
    character(:), allocatable :: text
    character(24) :: buffer

    write (buffer, '(es24.15e3)') value
    text = trim(adjustl(buffer))
  end function text_of

end module comparisons
