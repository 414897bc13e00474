!> Handles of scenes and answers, and the message of the last call.
!>
!> A handle is looked up in a list before it is used, and never followed.
module pd_c_handles
  use, intrinsic :: iso_c_binding, only: c_associated, c_int, c_loc, c_ptr
  use pd_base_error, only: error_type, fail, status_usage
  use pd_c_keys, only: keyed_scene_type
  use pd_c_texts, only: c_text_type, put_text
  use pd_output_results_answer, only: answer_type
  implicit none (type, external)
  private
  public :: scene_holder, answer_holder, keep_scene, keep_answer, find_scene, find_answer, &
    & perifort_free_scene, perifort_free_answer, perifort_message, status_of

  !> What a handle of a scene stands for.
  type :: scene_holder
    type(keyed_scene_type) :: keyed
    type(c_text_type) :: preview
    type(scene_holder), pointer :: next => null()
  end type scene_holder

  !> What a handle of an answer stands for.
  type :: answer_holder
    type(answer_type) :: answer
    type(c_text_type), allocatable :: column_names(:), column_units(:)
    type(c_text_type), allocatable :: field_names(:), field_units(:)
    type(c_text_type) :: warnings
    type(answer_holder), pointer :: next => null()
  end type answer_holder

  type(scene_holder), pointer :: first_scene => null()
  type(answer_holder), pointer :: first_answer => null()
  type(c_text_type), target :: message_text

contains

  !> `const char *perifort_message(void)`: what was wrong in the last call, '' if nothing was.
  function perifort_message() bind(c) result(text)
    type(c_ptr) :: text
    if (.not. allocated(message_text%characters)) call put_text('', message_text)
    text = c_loc(message_text%characters)
  end function perifort_message

  !> The status of a call, whose message is kept for `perifort_message`.
  integer(c_int) function status_of(error) result(status)
    type(error_type), allocatable, intent(in) :: error

    status = 0_c_int
    if (allocated(error)) then
      status = int(error%status, c_int)
      call put_text(error%message, message_text)
    else
      call put_text('', message_text)
    end if
  end function status_of

  !> A handle for a scene.
  function keep_scene(holder) result(handle)
    type(scene_holder), pointer, intent(in) :: holder
    type(c_ptr) :: handle

    holder%next => first_scene
    first_scene => holder
    handle = c_loc(holder)
  end function keep_scene

  !> A handle for an answer, with names and units for C.
  function keep_answer(holder) result(handle)
    type(answer_holder), pointer, intent(in) :: holder
    type(c_ptr) :: handle

    call name_parts(holder)
    holder%next => first_answer
    first_answer => holder
    handle = c_loc(holder)
  end function keep_answer

  !> The scene of a handle.
  subroutine find_scene(handle, where, holder, error)
    type(c_ptr), intent(in) :: handle
    character(*), intent(in) :: where
    type(scene_holder), pointer, intent(out) :: holder
    type(error_type), allocatable, intent(out) :: error

    holder => first_scene
    do while (associated(holder))
      if (c_associated(handle, c_loc(holder))) return
      holder => holder%next
    end do
    call fail(error, where//': this is not a scene (NULL, freed, or a handle of another object)', &
      & status_usage)
  end subroutine find_scene

  !> The answer of a handle. Without `error` what is wrong is kept as the message of the call.
  subroutine find_answer(handle, where, holder, error)
    type(c_ptr), intent(in) :: handle
    character(*), intent(in) :: where
    type(answer_holder), pointer, intent(out) :: holder
    type(error_type), allocatable, intent(out), optional :: error
    type(error_type), allocatable :: fault
    integer(c_int) :: ignored

    holder => first_answer
    do while (associated(holder))
      if (c_associated(handle, c_loc(holder))) exit
      holder => holder%next
    end do
    if (.not. associated(holder)) call fail(fault, where// &
      & ': this is not an answer (NULL, freed, or a handle of another object)', status_usage)
    if (present(error)) then
      if (allocated(fault)) call move_alloc(fault, error)
    else
      ignored = status_of(fault)
    end if
  end subroutine find_answer

  !> `void perifort_free_scene(perifort_scene *scene)`
  subroutine perifort_free_scene(handle) bind(c)
    type(c_ptr), value :: handle
    type(scene_holder), pointer :: holder, before

    nullify (before)
    holder => first_scene
    do while (associated(holder))
      if (c_associated(handle, c_loc(holder))) then
        if (associated(before)) then
          before%next => holder%next
        else
          first_scene => holder%next
        end if
        deallocate (holder)
        return
      end if
      before => holder
      holder => holder%next
    end do
  end subroutine perifort_free_scene

  !> `void perifort_free_answer(perifort_answer *answer)`
  subroutine perifort_free_answer(handle) bind(c)
    type(c_ptr), value :: handle
    type(answer_holder), pointer :: holder, before

    nullify (before)
    holder => first_answer
    do while (associated(holder))
      if (c_associated(handle, c_loc(holder))) then
        if (associated(before)) then
          before%next => holder%next
        else
          first_answer => holder%next
        end if
        deallocate (holder)
        return
      end if
      before => holder
      holder => holder%next
    end do
  end subroutine perifort_free_answer

  !> Names and units of an answer for C.
  subroutine name_parts(holder)
    type(answer_holder), intent(inout) :: holder
    integer :: i

    associate (answer => holder%answer)
      allocate (holder%column_names(size(answer%columns)), &
        & holder%column_units(size(answer%columns)), holder%field_names(size(answer%fields)), &
        & holder%field_units(size(answer%fields)))
      do i = 1, size(answer%columns)
        call put_text(trim(answer%columns(i)%name), holder%column_names(i))
        call put_text(trim(answer%columns(i)%unit), holder%column_units(i))
      end do
      do i = 1, size(answer%fields)
        call put_text(trim(answer%fields(i)%name), holder%field_names(i))
        call put_text(trim(answer%fields(i)%unit), holder%field_units(i))
      end do
      call put_text(answer%warnings, holder%warnings)
    end associate
  end subroutine name_parts

end module pd_c_handles
