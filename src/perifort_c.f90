!> The library for C and whatever calls C: the verbs of `perifort`, declared in src/perifort.h. What
!> reads answers is in `pd_c_answers`, what frees them in `pd_c_handles`.
!>
!> What goes wrong is a status, and a message until the next call.
module perifort_c
  use, intrinsic :: iso_c_binding, only: c_associated, c_double, c_f_pointer, c_f_procpointer, &
    & c_funptr, c_int, c_int64_t, c_loc, c_null_ptr, c_ptr
  use, intrinsic :: iso_fortran_env, only: output_unit
  use pd_c_answers, only: perifort_column, perifort_column_name, perifort_column_unit, &
    & perifort_columns, perifort_components, perifort_field, perifort_field_name, &
    & perifort_field_unit, perifort_fields, perifort_points, perifort_positions, perifort_rows, &
    & perifort_time, perifort_warnings
  use pd_c_handles, only: answer_holder, find_scene, keep_answer, keep_scene, &
    & perifort_free_answer, perifort_free_scene, perifort_message, scene_holder, status_of
  use pd_c_texts, only: c_text_type, put_pointer, put_text, text_from
  use pd_scene_format_file, only: read_text_file
  use perifort, only: check_scene, error_type, fail, instant_type, observer_type, preview_scene, &
    & program_version, run_options_type, run_scene, status_interrupted, status_usage, system_type
  implicit none (type, external)
  private
  public :: perifort_version, perifort_message
  public :: perifort_read_scene, perifort_scene_from_text, perifort_set, perifort_check, &
    & perifort_preview, perifort_run, perifort_free_scene, perifort_free_answer
  public :: perifort_rows, perifort_columns, perifort_points, perifort_fields, perifort_time, &
    & perifort_warnings, perifort_column_name, perifort_column_unit, perifort_field_name, &
    & perifort_field_unit, perifort_column, perifort_components, perifort_field, perifort_positions

  !> `perifort_options` of the header.
  type, bind(c) :: c_options
    type(c_ptr) :: directory
    integer(c_int) :: threads
    integer(c_int) :: overwrite
    integer(c_int) :: restart
    integer(c_int) :: verbose
    real(c_double) :: max_minutes
    type(c_funptr) :: observe
    type(c_ptr) :: data
  end type c_options

  !> `perifort_instant` of the header.
  type, bind(c) :: c_instant
    integer(c_int64_t) :: step
    integer(c_int64_t) :: load_step
    real(c_double) :: time
    integer(c_int64_t) :: broken_bonds
    real(c_double) :: dissipated_energy
    real(c_double) :: external_work
    integer(c_int) :: last
  end type c_instant

  abstract interface
    !> A function of the caller's that sees every instant; not 0 stops the run in order.
    function c_observer(instant, data) bind(c) result(stop_now)
      import :: c_instant, c_int, c_ptr
      implicit none (type, external)
      type(c_instant), intent(in) :: instant
      type(c_ptr), value :: data
      integer(c_int) :: stop_now
    end function c_observer
  end interface

  !> Hands instants on to the caller's function.
  type, extends(observer_type) :: caller_type
    procedure(c_observer), pointer, nopass :: call_back => null()
    type(c_ptr) :: data = c_null_ptr
  contains
    procedure :: observe
  end type caller_type

  type(c_text_type), target :: version_text

contains

  !> `const char *perifort_version(void)`
  function perifort_version() bind(c) result(text)
    type(c_ptr) :: text
    if (.not. allocated(version_text%characters)) call put_text(program_version, version_text)
    text = c_loc(version_text%characters)
  end function perifort_version

  !> `int perifort_read_scene(const char *path, perifort_scene **scene)`
  function perifort_read_scene(path, handle) bind(c) result(status)
    type(c_ptr), value :: path      !! of the scene file
    type(c_ptr), value :: handle    !! where the handle is put; NULL is put there after an error
    integer(c_int) :: status
    type(error_type), allocatable :: error
    character(:), allocatable :: text

    if (.not. c_associated(path)) then
      call fail(error, 'perifort_read_scene: the path is NULL', status_usage)
    else
      call read_text_file(text_from(path), text, error)
    end if
    if (.not. allocated(error)) then
      call new_scene(text, text_from(path), handle, error)
    else
      call put_pointer(handle, c_null_ptr)
    end if
    status = status_of(error)
  end function perifort_read_scene

  !> `int perifort_scene_from_text(const char *text, const char *name, perifort_scene **scene)`
  function perifort_scene_from_text(text, name, handle) bind(c) result(status)
    type(c_ptr), value :: text      !! as in a scene file
    type(c_ptr), value :: name      !! stands for the file in messages; NULL: 'scene'
    type(c_ptr), value :: handle    !! where the handle is put; NULL is put there after an error
    integer(c_int) :: status
    type(error_type), allocatable :: error

    if (.not. c_associated(text)) then
      call put_pointer(handle, c_null_ptr)
      call fail(error, 'perifort_scene_from_text: the text is NULL', status_usage)
    else if (c_associated(name)) then
      call new_scene(text_from(text), text_from(name), handle, error)
    else
      call new_scene(text_from(text), 'scene', handle, error)
    end if
    status = status_of(error)
  end function perifort_scene_from_text

  !> `int perifort_set(perifort_scene *scene, const char *key, const char *value)`: the key must be
  !> there; values and rules are checked by the next check, preview or run, so that keys that depend
  !> on each other can be changed together. A key that is set again gets the new value.
  function perifort_set(handle, key, value) bind(c) result(status)
    type(c_ptr), value :: handle
    type(c_ptr), value :: key       !! `group%key`, `group(2)%key(1)`, as in &study vary
    type(c_ptr), value :: value     !! as in the file; texts need no quotes
    integer(c_int) :: status
    type(scene_holder), pointer :: holder
    type(error_type), allocatable :: error

    call find_scene(handle, 'perifort_set', holder, error)
    if (.not. allocated(error) .and. .not. (c_associated(key) .and. c_associated(value))) &
      & call fail(error, 'perifort_set: the key or the value is NULL', status_usage)
    if (.not. allocated(error)) call holder%keyed%set_key(text_from(key), text_from(value), error)
    status = status_of(error)
  end function perifort_set

  !> `int perifort_check(perifort_scene *scene)`: all rules, without building points.
  function perifort_check(handle) bind(c) result(status)
    type(c_ptr), value :: handle
    integer(c_int) :: status
    type(scene_holder), pointer :: holder
    type(error_type), allocatable :: error

    call find_scene(handle, 'perifort_check', holder, error)
    if (.not. allocated(error)) call holder%keyed%renew(error)
    if (.not. allocated(error)) call check_scene(holder%keyed%scene, error)
    status = status_of(error)
  end function perifort_check

  !> `int perifort_preview(perifort_scene *scene, int threads, const char **text)`
  function perifort_preview(handle, threads, text) bind(c) result(status)
    type(c_ptr), value :: handle
    integer(c_int), value :: threads  !! 0 = as many as suit the scene
    type(c_ptr), value :: text        !! where the text is put, which the scene owns; may be NULL
    integer(c_int) :: status
    type(scene_holder), pointer :: holder
    type(error_type), allocatable :: error
    type(run_options_type) :: options
    character(:), allocatable :: lines

    call put_pointer(text, c_null_ptr)
    call find_scene(handle, 'perifort_preview', holder, error)
    if (.not. allocated(error)) call check_threads(threads, 'perifort_preview', error)
    if (.not. allocated(error)) call holder%keyed%renew(error)
    if (.not. allocated(error)) then
      options%quiet = .true.
      options%threads = threads
      call preview_scene(holder%keyed%scene, options, error, lines)
    end if
    if (.not. allocated(error)) then
      call put_text(lines, holder%preview)
      call put_pointer(text, c_loc(holder%preview%characters))
    end if
    status = status_of(error)
  end function perifort_preview

  !> `int perifort_run(perifort_scene *scene, const perifort_options *options, perifort_answer
  !> **answer)`
  function perifort_run(handle, options, answer) bind(c) result(status)
    type(c_ptr), value :: handle
    type(c_ptr), value :: options   !! NULL: in memory, without a word
    type(c_ptr), value :: answer    !! where the answer's handle is put; NULL: not wanted
    integer(c_int) :: status
    type(scene_holder), pointer :: holder
    type(answer_holder), pointer :: found
    type(error_type), allocatable :: error
    type(run_options_type) :: how
    type(caller_type) :: caller

    call put_pointer(answer, c_null_ptr)
    call find_scene(handle, 'perifort_run', holder, error)
    if (.not. allocated(error)) call holder%keyed%renew(error)
    if (.not. allocated(error)) call take_options(options, how, caller, error)
    if (allocated(error)) then
      status = status_of(error)
      return
    end if
    allocate (found)
    if (associated(caller%call_back)) then
      call run_scene(holder%keyed%scene, how, error, observer=caller, answer=found%answer)
    else
      call run_scene(holder%keyed%scene, how, error, answer=found%answer)
    end if
    flush (output_unit)
    if (c_associated(answer) .and. allocated(found%answer%positions)) then
      call put_pointer(answer, keep_answer(found))
    else
      deallocate (found)
    end if
    status = status_of(error)
  end function perifort_run

  !> A handle for a scene that is read from a text.
  subroutine new_scene(text, name, handle, error)
    character(*), intent(in) :: text, name
    type(c_ptr), intent(in) :: handle   !! where the handle is put
    type(error_type), allocatable, intent(out) :: error
    type(scene_holder), pointer :: holder

    call put_pointer(handle, c_null_ptr)
    if (.not. c_associated(handle)) then
      call fail(error, 'the pointer for the handle of the scene is NULL', status_usage)
      return
    end if
    allocate (holder)
    call holder%keyed%read(text, name, error)
    if (allocated(error)) then
      deallocate (holder)
    else
      call put_pointer(handle, keep_scene(holder))
    end if
  end subroutine new_scene

  !> Let the caller's function see an instant.
  subroutine observe(observer, system, instant, error)
    class(caller_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(error_type), allocatable, intent(out) :: error
    type(c_instant) :: now

    now%step = instant%step
    now%load_step = instant%load_step
    now%time = instant%time
    now%broken_bonds = system%broken
    now%dissipated_energy = system%dissipated
    now%external_work = system%external_work
    now%last = merge(1_c_int, 0_c_int, instant%last)
    if (observer%call_back(now, observer%data) /= 0_c_int) &
      & call fail(error, 'stopped by the observer', status_interrupted)
  end subroutine observe

  !> The options of the caller.
  subroutine take_options(place, options, caller, error)
    type(c_ptr), intent(in) :: place              !! of `perifort_options`, or NULL
    type(run_options_type), intent(inout) :: options
    type(caller_type), intent(inout) :: caller
    type(error_type), allocatable, intent(out) :: error
    type(c_options), pointer :: given

    options%files = .false.
    options%quiet = .true.
    if (.not. c_associated(place)) return
    call c_f_pointer(place, given)
    call check_threads(given%threads, 'perifort_run', error)
    if (.not. allocated(error) .and. .not. given%max_minutes >= 0.0_c_double) &
      & call fail(error, 'perifort_run: max_minutes must be 0 or more', status_usage)
    if (allocated(error)) return
    if (c_associated(given%directory)) options%output_directory = text_from(given%directory)
    if (allocated(options%output_directory)) options%files = options%output_directory /= ''
    options%threads = given%threads
    options%overwrite = given%overwrite /= 0_c_int
    options%restart = given%restart /= 0_c_int
    options%quiet = given%verbose == 0_c_int
    options%max_minutes = given%max_minutes
    options%command = 'perifort_run'
    options%restart_command = 'perifort_run with restart = 1'
    if (c_associated(given%observe)) call c_f_procpointer(given%observe, caller%call_back)
    caller%data = given%data
  end subroutine take_options

  !> An error unless a number of threads can be asked for.
  subroutine check_threads(threads, where, error)
    integer(c_int), intent(in) :: threads
    character(*), intent(in) :: where
    type(error_type), allocatable, intent(out) :: error
    if (threads < 0_c_int .or. threads > 999999_c_int) call fail(error, where// &
      & ': threads must be between 0, as many as suit the scene, and 999999', status_usage)
  end subroutine check_threads

end module perifort_c
