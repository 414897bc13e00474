!> Functions for C that read an answer; src/perifort.h declares them.
module pd_c_answers
  use, intrinsic :: iso_c_binding, only: c_associated, c_double, c_int, c_int64_t, c_loc, &
    & c_null_ptr, c_ptr
  use pd_base_error, only: error_type, fail, status_usage
  use pd_base_kinds, only: wp
  use pd_c_handles, only: answer_holder, find_answer, status_of
  use pd_c_texts, only: c_text_type, hand_over, side_by_side, text_from
  implicit none (type, external)
  private
  public :: perifort_rows, perifort_columns, perifort_points, perifort_fields, perifort_time, &
    & perifort_warnings, perifort_column_name, perifort_column_unit, perifort_field_name, &
    & perifort_field_unit, perifort_column, perifort_components, perifort_field, &
    & perifort_positions

contains

  !> `int64_t perifort_rows(const perifort_answer *answer)`: of the history, -1 without an answer.
  function perifort_rows(handle) bind(c) result(number)
    type(c_ptr), value :: handle
    integer(c_int64_t) :: number
    type(answer_holder), pointer :: holder

    number = -1_c_int64_t
    call find_answer(handle, 'perifort_rows', holder)
    if (associated(holder)) number = size(holder%answer%history, 1, kind=c_int64_t)
  end function perifort_rows

  !> `int64_t perifort_columns(const perifort_answer *answer)`
  function perifort_columns(handle) bind(c) result(number)
    type(c_ptr), value :: handle
    integer(c_int64_t) :: number
    type(answer_holder), pointer :: holder

    number = -1_c_int64_t
    call find_answer(handle, 'perifort_columns', holder)
    if (associated(holder)) number = size(holder%answer%columns, kind=c_int64_t)
  end function perifort_columns

  !> `int64_t perifort_points(const perifort_answer *answer)`
  function perifort_points(handle) bind(c) result(number)
    type(c_ptr), value :: handle
    integer(c_int64_t) :: number
    type(answer_holder), pointer :: holder

    number = -1_c_int64_t
    call find_answer(handle, 'perifort_points', holder)
    if (associated(holder)) number = size(holder%answer%positions, 1, kind=c_int64_t)
  end function perifort_points

  !> `int64_t perifort_fields(const perifort_answer *answer)`
  function perifort_fields(handle) bind(c) result(number)
    type(c_ptr), value :: handle
    integer(c_int64_t) :: number
    type(answer_holder), pointer :: holder

    number = -1_c_int64_t
    call find_answer(handle, 'perifort_fields', holder)
    if (associated(holder)) number = size(holder%answer%fields, kind=c_int64_t)
  end function perifort_fields

  !> `double perifort_time(const perifort_answer *answer)`: of the last output [s].
  function perifort_time(handle) bind(c) result(time)
    type(c_ptr), value :: handle
    real(c_double) :: time
    type(answer_holder), pointer :: holder

    time = -1.0_c_double
    call find_answer(handle, 'perifort_time', holder)
    if (associated(holder)) time = holder%answer%time
  end function perifort_time

  !> `const char *perifort_warnings(const perifort_answer *answer)`
  function perifort_warnings(handle) bind(c) result(text)
    type(c_ptr), value :: handle
    type(c_ptr) :: text
    type(answer_holder), pointer :: holder

    text = c_null_ptr
    call find_answer(handle, 'perifort_warnings', holder)
    if (associated(holder)) text = c_loc(holder%warnings%characters)
  end function perifort_warnings

  !> `const char *perifort_column_name(const perifort_answer *answer, int64_t number)`, from 0 on.
  function perifort_column_name(handle, number) bind(c) result(text)
    type(c_ptr), value :: handle
    integer(c_int64_t), value :: number
    type(c_ptr) :: text
    type(answer_holder), pointer :: holder

    text = c_null_ptr
    call find_answer(handle, 'perifort_column_name', holder)
    if (associated(holder)) text = text_at(holder%column_names, number, 'column')
  end function perifort_column_name

  !> `const char *perifort_column_unit(const perifort_answer *answer, int64_t number)`
  function perifort_column_unit(handle, number) bind(c) result(text)
    type(c_ptr), value :: handle
    integer(c_int64_t), value :: number
    type(c_ptr) :: text
    type(answer_holder), pointer :: holder

    text = c_null_ptr
    call find_answer(handle, 'perifort_column_unit', holder)
    if (associated(holder)) text = text_at(holder%column_units, number, 'column')
  end function perifort_column_unit

  !> `const char *perifort_field_name(const perifort_answer *answer, int64_t number)`
  function perifort_field_name(handle, number) bind(c) result(text)
    type(c_ptr), value :: handle
    integer(c_int64_t), value :: number
    type(c_ptr) :: text
    type(answer_holder), pointer :: holder

    text = c_null_ptr
    call find_answer(handle, 'perifort_field_name', holder)
    if (associated(holder)) text = text_at(holder%field_names, number, 'field')
  end function perifort_field_name

  !> `const char *perifort_field_unit(const perifort_answer *answer, int64_t number)`
  function perifort_field_unit(handle, number) bind(c) result(text)
    type(c_ptr), value :: handle
    integer(c_int64_t), value :: number
    type(c_ptr) :: text
    type(answer_holder), pointer :: holder

    text = c_null_ptr
    call find_answer(handle, 'perifort_field_unit', holder)
    if (associated(holder)) text = text_at(holder%field_units, number, 'field')
  end function perifort_field_unit

  !> `int perifort_column(const perifort_answer *answer, const char *name, double *values, int64_t
  !> size)`
  function perifort_column(handle, name, values, room) bind(c) result(status)
    type(c_ptr), value :: handle, name
    type(c_ptr), value :: values           !! room for a number for each row
    integer(c_int64_t), value :: room      !! numbers for which there is room
    integer(c_int) :: status
    type(answer_holder), pointer :: holder
    type(error_type), allocatable :: error
    real(wp), allocatable :: found(:)

    call find_answer(handle, 'perifort_column', holder, error)
    if (.not. allocated(error)) call need_name(name, 'perifort_column', error)
    if (.not. allocated(error)) then
      call holder%answer%get_column(text_from(name), found, error)
      if (allocated(error)) error%status = status_usage
    end if
    if (.not. allocated(error)) call hand_over(found, values, room, 'perifort_column', error)
    status = status_of(error)
  end function perifort_column

  !> `int perifort_components(const perifort_answer *answer, const char *name)`: of a field, -1 if
  !> there is none of this name.
  function perifort_components(handle, name) bind(c) result(number)
    type(c_ptr), value :: handle, name
    integer(c_int) :: number
    type(answer_holder), pointer :: holder
    type(error_type), allocatable :: error
    integer(c_int) :: ignored
    integer :: f

    number = -1_c_int
    call find_answer(handle, 'perifort_components', holder, error)
    if (.not. allocated(error)) call need_name(name, 'perifort_components', error)
    if (.not. allocated(error)) then
      f = holder%answer%field_number(text_from(name))
      if (f > 0) then
        number = holder%answer%fields(f)%components
      else
        call fail(error, "there is no field '"//text_from(name)//"'", status_usage)
      end if
    end if
    ignored = status_of(error)
  end function perifort_components

  !> `int perifort_field(const perifort_answer *answer, const char *name, double *values, int64_t
  !> size)`: of the last output, the components of a point side by side.
  function perifort_field(handle, name, values, room) bind(c) result(status)
    type(c_ptr), value :: handle, name
    type(c_ptr), value :: values           !! room for points times components
    integer(c_int64_t), value :: room      !! numbers for which there is room
    integer(c_int) :: status
    type(answer_holder), pointer :: holder
    type(error_type), allocatable :: error
    real(wp), allocatable :: found(:, :)

    call find_answer(handle, 'perifort_field', holder, error)
    if (.not. allocated(error)) call need_name(name, 'perifort_field', error)
    if (.not. allocated(error)) then
      call holder%answer%get_field(text_from(name), found, error)
      if (allocated(error)) error%status = status_usage
    end if
    if (.not. allocated(error)) call hand_over(side_by_side(found), values, room, &
      & 'perifort_field', error)
    status = status_of(error)
  end function perifort_field

  !> `int perifort_positions(const perifort_answer *answer, double *values, int64_t size)`: x, y, z
  !> of each point before the motion [m].
  function perifort_positions(handle, values, room) bind(c) result(status)
    type(c_ptr), value :: handle
    type(c_ptr), value :: values           !! room for points times 3
    integer(c_int64_t), value :: room      !! numbers for which there is room
    integer(c_int) :: status
    type(answer_holder), pointer :: holder
    type(error_type), allocatable :: error

    call find_answer(handle, 'perifort_positions', holder, error)
    if (.not. allocated(error)) call hand_over(side_by_side(holder%answer%positions), values, &
      & room, 'perifort_positions', error)
    status = status_of(error)
  end function perifort_positions

  !> An error if a name is NULL.
  subroutine need_name(name, where, error)
    type(c_ptr), intent(in) :: name
    character(*), intent(in) :: where
    type(error_type), allocatable, intent(out) :: error
    if (.not. c_associated(name)) call fail(error, where//': the name is NULL', status_usage)
  end subroutine need_name

  !> One of several texts, counted from 0; NULL and a message if there is none of this number.
  function text_at(texts, number, kind) result(text)
    type(c_text_type), target, intent(in) :: texts(:)
    integer(c_int64_t), intent(in) :: number
    character(*), intent(in) :: kind
    type(c_ptr) :: text
    type(error_type), allocatable :: error
    integer(c_int) :: ignored

    text = c_null_ptr
    if (number < 0_c_int64_t .or. number >= size(texts, kind=c_int64_t)) then
      call fail(error, 'there is no '//kind//' of this number', status_usage)
      ignored = status_of(error)
    else
      text = c_loc(texts(number + 1)%characters)
    end if
  end function text_at

end module pd_c_answers
