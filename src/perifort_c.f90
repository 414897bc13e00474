!> The library for C and whatever calls C: the verbs of `perifort`, declared in src/perifort.h.
!>
!> Handles are looked up in a list before they are used, so that NULL, a handle that was freed and
!> one of another kind are refused. What goes wrong is a status, and a message until the next call.
module perifort_c
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_pointer, &
    & c_f_procpointer, c_funptr, c_int, c_int64_t, c_loc, c_null_char, c_null_ptr, c_ptr, c_size_t
  use, intrinsic :: iso_fortran_env, only: output_unit
  use pd_scene_content_change, only: change_key, find_target, full_name, target_type
  use pd_scene_content_read, only: read_scene_source
  use pd_scene_format_file, only: line_type, read_text_file
  use pd_scene_format_source, only: scan_source, source_type, token_type
  use perifort, only: answer_type, check_scene, error_type, fail, instant_type, observer_type, &
    & preview_scene, program_version, read_scene_text, run_options_type, run_scene, scene_type, &
    & status_interrupted, status_usage, system_type, wp
  implicit none (type, external)
  private
  public :: perifort_version, perifort_message, perifort_read_scene, perifort_scene_from_text, &
    & perifort_set, perifort_check, perifort_preview, perifort_free_scene, perifort_run, &
    & perifort_free_answer, perifort_rows, perifort_columns, perifort_points, perifort_fields, &
    & perifort_time, perifort_warnings, perifort_column_name, perifort_column_unit, &
    & perifort_field_name, perifort_field_unit, perifort_column, perifort_components, &
    & perifort_field, perifort_positions

  !> A text for C, ended by a null character.
  type :: c_text_type
    character(kind=c_char), allocatable :: characters(:)
  end type c_text_type

  !> A key that was set, and the value as it was given.
  type :: change_type
    character(:), allocatable :: key    !! its full name
    character(:), allocatable :: value
  end type change_type

  !> What a handle of a scene stands for.
  type :: scene_holder
    character(:), allocatable :: text            !! as it was read
    character(:), allocatable :: name            !! of the file
    type(change_type), allocatable :: changes(:) !! in the order in which they were made
    type(scene_type) :: scene                    !! with the changes, unless they wait
    logical :: waits = .false.                   !! keys have changed since the scene was read
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
    function observe_interface(instant, data) bind(c) result(stop_now)
      import :: c_instant, c_int, c_ptr
      implicit none (type, external)
      type(c_instant), intent(in) :: instant
      type(c_ptr), value :: data
      integer(c_int) :: stop_now
    end function observe_interface
  end interface

  interface
    !> C: length of a text up to its null character.
    function c_strlen(text) bind(c, name='strlen') result(length)
      import :: c_ptr, c_size_t
      implicit none (type, external)
      type(c_ptr), value :: text
      integer(c_size_t) :: length
    end function c_strlen
  end interface

  !> Hands instants on to the caller's function.
  type, extends(observer_type) :: caller_type
    procedure(observe_interface), pointer, nopass :: call_back => null()
    type(c_ptr) :: data = c_null_ptr
  contains
    procedure :: observe
  end type caller_type

  type(scene_holder), pointer :: first_scene => null()
  type(answer_holder), pointer :: first_answer => null()
  type(c_text_type), target :: version_text, message_text

contains

  ! ------------------------------------------------------------------ version and message

  !> `const char *perifort_version(void)`
  function perifort_version() bind(c) result(text)
    type(c_ptr) :: text
    if (.not. allocated(version_text%characters)) call put_text(program_version, version_text)
    text = c_loc(version_text%characters)
  end function perifort_version

  !> `const char *perifort_message(void)`: what was wrong in the last call, '' if nothing was.
  function perifort_message() bind(c) result(text)
    type(c_ptr) :: text
    if (.not. allocated(message_text%characters)) call put_text('', message_text)
    text = c_loc(message_text%characters)
  end function perifort_message

  ! ------------------------------------------------------------------ scenes

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
      call put_handle(handle, c_null_ptr)
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
      call put_handle(handle, c_null_ptr)
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
    type(source_type) :: source
    type(target_type) :: target
    type(change_type) :: change
    integer :: i

    call find_scene(handle, 'perifort_set', holder, error)
    if (.not. allocated(error) .and. .not. (c_associated(key) .and. c_associated(value))) &
      & call fail(error, 'perifort_set: the key or the value is NULL', status_usage)
    if (.not. allocated(error)) call changed_source(holder, source, error)
    if (.not. allocated(error)) call find_target(source, text_from(key), option(source), target, &
      & error)
    if (.not. allocated(error)) then
      change%key = full_name(source, target)
      change%value = text_from(value)
      do i = 1, size(holder%changes)
        if (holder%changes(i)%key == change%key) exit
      end do
      if (i > size(holder%changes)) holder%changes = [holder%changes, change]
      holder%changes(i) = change
      holder%waits = .true.
    end if
    status = status_of(error)
  end function perifort_set

  !> `int perifort_check(perifort_scene *scene)`: all rules, without building points.
  function perifort_check(handle) bind(c) result(status)
    type(c_ptr), value :: handle
    integer(c_int) :: status
    type(scene_holder), pointer :: holder
    type(error_type), allocatable :: error

    call find_scene(handle, 'perifort_check', holder, error)
    if (.not. allocated(error)) call renew(holder, error)
    if (.not. allocated(error)) call check_scene(holder%scene, error)
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

    call put_handle(text, c_null_ptr)
    call find_scene(handle, 'perifort_preview', holder, error)
    if (.not. allocated(error)) call check_threads(threads, 'perifort_preview', error)
    if (.not. allocated(error)) call renew(holder, error)
    if (.not. allocated(error)) then
      options%quiet = .true.
      options%threads = threads
      call preview_scene(holder%scene, options, error, lines)
    end if
    if (.not. allocated(error)) then
      call put_text(lines, holder%preview)
      call put_handle(text, c_loc(holder%preview%characters))
    end if
    status = status_of(error)
  end function perifort_preview

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

  ! ------------------------------------------------------------------ runs

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

    call put_handle(answer, c_null_ptr)
    call find_scene(handle, 'perifort_run', holder, error)
    if (.not. allocated(error)) call renew(holder, error)
    if (.not. allocated(error)) call take_options(options, how, caller, error)
    if (allocated(error)) then
      status = status_of(error)
      return
    end if
    allocate (found)
    if (associated(caller%call_back)) then
      call run_scene(holder%scene, how, error, observer=caller, answer=found%answer)
    else
      call run_scene(holder%scene, how, error, answer=found%answer)
    end if
    flush (output_unit)
    if (c_associated(answer) .and. allocated(found%answer%positions)) then
      call name_parts(found)
      found%next => first_answer
      first_answer => found
      call put_handle(answer, c_loc(found))
    else
      deallocate (found)
    end if
    status = status_of(error)
  end function perifort_run

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

  ! ------------------------------------------------------------------ answers

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

  ! ------------------------------------------------------------------ behind the functions

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

  !> A handle for a scene that is read from a text.
  subroutine new_scene(text, name, handle, error)
    character(*), intent(in) :: text, name
    type(c_ptr), intent(in) :: handle   !! where the handle is put
    type(error_type), allocatable, intent(out) :: error
    type(scene_holder), pointer :: holder

    call put_handle(handle, c_null_ptr)
    if (.not. c_associated(handle)) then
      call fail(error, 'the place for the handle of the scene is NULL', status_usage)
      return
    end if
    allocate (holder)
    call read_scene_text(text, name, holder%scene, error)
    if (allocated(error)) then
      deallocate (holder)
      return
    end if
    holder%text = text
    holder%name = name
    allocate (holder%changes(0))
    holder%next => first_scene
    first_scene => holder
    call put_handle(handle, c_loc(holder))
  end subroutine new_scene

  !> The text of a scene, scanned, with the keys that were set.
  subroutine changed_source(holder, source, error)
    type(scene_holder), intent(in) :: holder
    type(source_type), intent(out) :: source
    type(error_type), allocatable, intent(out) :: error
    type(target_type) :: target
    integer :: i

    call scan_source(holder%text, holder%name, source, error)
    do i = 1, size(holder%changes)
      if (allocated(error)) return
      associate (change => holder%changes(i))
        call find_target(source, change%key, option(source), target, error)
        if (.not. allocated(error)) call change_key(source, target, &
          & written(change%value, target%kind), option(source), error)
      end associate
    end do
  end subroutine changed_source

  !> Read a scene anew if keys have been set since. After an error they still wait.
  subroutine renew(holder, error)
    type(scene_holder), intent(inout) :: holder
    type(error_type), allocatable, intent(out) :: error
    type(source_type) :: source
    type(scene_type) :: scene

    if (.not. holder%waits) return
    call changed_source(holder, source, error)
    if (.not. allocated(error)) call read_scene_source(source, scene, error)
    if (allocated(error)) return
    holder%scene = scene
    holder%waits = .false.
  end subroutine renew

  !> A place in a source that no line of its text has: messages then name the file.
  pure type(token_type) function option(source) result(place)
    type(source_type), intent(in) :: source
    place%text = source%file
  end function option

  !> A value as it stands in a file: texts in quotes.
  pure function written(value, kind) result(word)
    character(*), intent(in) :: value
    character(*), intent(in) :: kind   !! of the key
    character(:), allocatable :: word

    word = value
    if (index(kind, 'text') /= 1 .or. len(value) == 0) return
    if (scan(value(1:1), "'""") == 0) word = "'"//value//"'"
  end function written

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
    call fail(error, where//': this is no scene (NULL, freed, or a handle of something else)', &
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
      & ': this is no answer (NULL, freed, or a handle of something else)', status_usage)
    if (present(error)) then
      if (allocated(fault)) call move_alloc(fault, error)
    else
      ignored = status_of(fault)
    end if
  end subroutine find_answer

  !> An error if a name is NULL.
  subroutine need_name(name, where, error)
    type(c_ptr), intent(in) :: name
    character(*), intent(in) :: where
    type(error_type), allocatable, intent(out) :: error
    if (.not. c_associated(name)) call fail(error, where//': the name is NULL', status_usage)
  end subroutine need_name

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

  !> Values into the caller's room.
  subroutine hand_over(found, place, room, where, error)
    real(wp), intent(in) :: found(:)
    type(c_ptr), intent(in) :: place
    integer(c_int64_t), intent(in) :: room
    character(*), intent(in) :: where
    type(error_type), allocatable, intent(out) :: error
    real(c_double), pointer :: values(:)
    character(24) :: needed

    write (needed, '(i0)') size(found)
    if (.not. c_associated(place)) then
      call fail(error, where//': the place for the values is NULL', status_usage)
    else if (room < size(found, kind=c_int64_t)) then
      call fail(error, where//': there are '//trim(needed)//' values, more than there is room for', &
        & status_usage)
    else
      call c_f_pointer(place, values, [size(found)])
      values = found
    end if
  end subroutine hand_over

  !> The components of each point side by side.
  pure function side_by_side(values) result(line)
    real(wp), intent(in) :: values(:, :)   !! (point, component)
    real(wp), allocatable :: line(:)
    line = [transpose(values)]
  end function side_by_side

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

  !> Put a pointer where the caller wants it; nowhere if that place is NULL.
  subroutine put_handle(place, handle)
    type(c_ptr), intent(in) :: place, handle
    type(c_ptr), pointer :: there

    if (.not. c_associated(place)) return
    call c_f_pointer(place, there)
    there = handle
  end subroutine put_handle

  !> A text for C.
  subroutine put_text(text, holder)
    character(*), intent(in) :: text
    type(c_text_type), intent(inout) :: holder
    integer :: i

    if (allocated(holder%characters)) deallocate (holder%characters)
    allocate (holder%characters(len(text) + 1))
    do i = 1, len(text)
      holder%characters(i) = text(i:i)
    end do
    holder%characters(len(text) + 1) = c_null_char
  end subroutine put_text

  !> A text of C's.
  function text_from(place) result(text)
    type(c_ptr), intent(in) :: place   !! not NULL
    character(:), allocatable :: text
    character(kind=c_char), pointer :: characters(:)
    integer :: i, n

    n = int(c_strlen(place))
    call c_f_pointer(place, characters, [n])
    allocate (character(n) :: text)
    do i = 1, n
      text(i:i) = characters(i)
    end do
  end function text_from

end module perifort_c
