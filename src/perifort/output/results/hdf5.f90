!> Files, groups, attributes and texts of HDF5, with this program's way of reporting errors.
!>
!> Nothing is cached between a write and the system: a `write_rows` into a series that exists is a
!> plain write into the file. HDF5's own records (metadata) reach the file only in `flush_file`
!> and `close_file`. Both matter for a file that must survive the end of its writer at any moment.
!>
!> An error is set if HDF5 fails: it names what was to be done, the file, and the system's reason or
!> HDF5's own.
module pd_output_results_hdf5
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_pointer, c_int, &
    & c_int64_t, c_loc, c_ptr, c_size_t
  use hdf5, only: H5F_ACC_RDONLY_F, H5F_ACC_RDWR_F, H5F_ACC_TRUNC_F, H5F_SCOPE_GLOBAL_F, &
    & H5P_FILE_ACCESS_F, H5S_SCALAR_F, H5T_CSET_UTF8_F, H5T_FORTRAN_S1, H5T_STD_I64LE, &
    & h5aclose_f, h5acreate_f, h5aopen_by_name_f, h5aopen_f, h5aread_f, h5awrite_f, h5dclose_f, &
    & h5dcreate_f, h5dget_type_f, h5dont_atexit_f, h5dopen_f, h5dread_f, h5dwrite_f, &
    & h5eset_auto_f, h5fclose_f, h5fcreate_f, &
    & h5fflush_f, h5fopen_f, h5gclose_f, h5gcreate_f, h5get_libversion_f, h5ldelete_f, &
    & h5lexists_f, &
    & h5oclose_f, h5ocopy_f, h5oopen_f, h5open_f, h5pclose_f, h5pcreate_f, h5pset_cache_f, &
    & h5pset_sieve_buf_size_f, h5sclose_f, h5screate_f, h5screate_simple_f, h5tclose_f, &
    & h5tcopy_f, h5tget_size_f, h5tset_cset_f, h5tset_size_f, hid_t, hsize_t, size_t
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: i8
  use pd_base_text, only: to_text
  use pd_comm_world, only: find_handles
  use pd_output_results_files, only: set_environment
  use pd_output_results_together, only: access_together, can_write_together, write_together
  implicit none (type, external)
  private
  public :: hdf5_file, start_hdf5, hdf5_version, create_file, open_file, flush_file, close_file
  public :: make_group, copy_object, object_exists, remove_object
  public :: put_attribute, change_attribute, get_attribute, put_text, get_text, explain

  !> An open file.
  type :: hdf5_file
    integer(hid_t) :: id = -1_hid_t
    integer(hid_t) :: writing = -1_hid_t  !! properties of writes by all ranks; -1: by this alone
    character(:), allocatable :: name  !! path, for messages
  end type hdf5_file

  !> One entry of HDF5's error stack (H5E_error2_t).
  type, bind(c) :: stack_entry
    integer(c_int64_t) :: class_id, major, minor  ! hid_t, of 64 bits since HDF5 1.10
    integer(c_int) :: line
    type(c_ptr) :: function_name, file_name, description
  end type stack_entry

  !> Write `values` as an attribute of an existing object: 64-bit integers or text of its length.
  interface put_attribute
    module procedure :: put_attribute_integer, put_attribute_integers, put_attribute_text
  end interface put_attribute

  interface
    integer(c_int) function h5_walk(stack, direction, visit, reason) bind(c, name='H5Ewalk2')
      import :: c_int, c_int64_t, c_ptr, stack_entry
      implicit none (type, external)
      integer(c_int64_t), value :: stack
      integer(c_int), value :: direction
      interface
        integer(c_int) function visit(n, entry, reason) bind(c)
          import :: c_int, c_ptr, stack_entry
          implicit none (type, external)
          integer(c_int), value :: n
          type(stack_entry), intent(in) :: entry
          type(c_ptr), value :: reason
        end function visit
      end interface
      type(c_ptr), value :: reason
    end function h5_walk

    integer(c_size_t) function c_strlen(text) bind(c, name='strlen')
      import :: c_ptr, c_size_t
      implicit none (type, external)
      type(c_ptr), value :: text
    end function c_strlen
  end interface

  !> The system's reason, from the error stack.
  type :: reason_type
    character(512) :: system = ''     !! errno's message, if a system call failed
    character(512) :: innermost = ''  !! HDF5's own words where the error arose
  end type reason_type

contains

  !> Start the library: silent (its errors become `error_type`), and without locks on files, so that
  !> a file can be read while it is written. Further calls do nothing: with each, h5open_f would
  !> make HDF5's Fortran types anew and keep the old ones, and closing a file searches all types.
  subroutine start_hdf5(error)
    type(error_type), allocatable, intent(out) :: error
    logical, save :: started = .false.
    integer :: status

    if (started) return
    call set_environment('HDF5_USE_FILE_LOCKING', 'FALSE')
    ! all files are closed here; what the library does at the program's end, after a full disk,
    ! is to try again what failed, and to crash
    call h5dont_atexit_f(status)
    call h5open_f(status)
    if (status == 0) call h5eset_auto_f(0, status)
    if (status /= 0) call fail(error, 'the HDF5 library does not start')
    started = status == 0
  end subroutine start_hdf5

  !> The version of the HDF5 library, such as 1.10.8; where there may be several ranks, also which
  !> of them write with it.
  function hdf5_version() result(version)
    character(:), allocatable :: version
    integer :: major, minor, release, status, ranks, hints

    call h5get_libversion_f(major, minor, release, status)
    version = to_text(major)//'.'//to_text(minor)//'.'//to_text(release)
    call find_handles(ranks, hints)
    if (can_write_together()) then
      version = version//', parallel: all ranks write results'
    else if (ranks >= 0) then
      version = version//', serial: the first rank writes results'
    end if
  end function hdf5_version

  !> Collect the reason from one entry of the error stack.
  integer(c_int) function collect_reason(n, entry, reason) bind(c) result(status)
    integer(c_int), value :: n
    type(stack_entry), intent(in) :: entry
    type(c_ptr), value :: reason
    type(reason_type), pointer :: to
    character(kind=c_char), pointer :: letters(:)
    character(512) :: text
    integer :: i, at

    status = 0
    call c_f_pointer(reason, to)
    if (.not. c_associated(entry%description)) return
    call c_f_pointer(entry%description, letters, [c_strlen(entry%description)])
    text = ''
    do i = 1, min(size(letters), len(text))
      text(i:i) = letters(i)
    end do
    if (n == 0) to%innermost = text
    at = index(text, 'error message = ''')
    if (at == 0) return
    text = text(at + 17:)
    at = index(text, '''')
    if (at > 1) to%system = text(:at - 1)
  end function collect_reason

  !> Make an error of the HDF5 call that failed just now: `action` and the reason.
  subroutine explain(error, action, file_name)
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in) :: action     !! what could not be done, to follow `cannot`
    character(*), intent(in) :: file_name  !! on which it was to be done
    type(reason_type), target :: reason
    character(:), allocatable :: message

    ! H5E_DEFAULT and H5E_WALK_UPWARD are both 0: from where the error arose to the call itself
    if (h5_walk(0_c_int64_t, 0_c_int, collect_reason, c_loc(reason)) < 0) reason%innermost = ''
    message = 'cannot '//action//' '//file_name
    if (reason%system /= '') then
      message = message//': '//trim(reason%system)
    else if (reason%innermost /= '') then
      message = message//': '//trim(reason%innermost)
    end if
    call fail(error, message)
  end subroutine explain

  !> How files are opened: no cache of raw data and no gathering of small writes.
  subroutine make_access(access, status)
    integer(hid_t), intent(out) :: access
    integer, intent(out) :: status

    call h5pcreate_f(H5P_FILE_ACCESS_F, access, status)
    if (status == 0) call h5pset_cache_f(access, 0, 521_size_t, 0_size_t, 0.75, status)
    if (status == 0) call h5pset_sieve_buf_size_f(access, 0_size_t, status)
  end subroutine make_access

  !> Make a new file; one of this name is replaced.
  subroutine create_file(name, file, error)
    character(*), intent(in) :: name      !! path of the file
    type(hdf5_file), intent(out) :: file  !! open for reading and writing; not open after an error
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: access
    integer :: status, ignored

    file%name = trim(name)
    call make_access(access, status)
    if (status == 0) call h5fcreate_f(file%name, H5F_ACC_TRUNC_F, file%id, status, &
      & access_prp=access)
    if (status /= 0) then
      call explain(error, 'make', file%name)
      file%id = -1
    end if
    call h5pclose_f(access, ignored)
  end subroutine create_file

  !> Open a file that is there, for reading only or for both. With `together` all ranks open it,
  !> and each write of rows is a call of all of them, each with rows of its own: no group, dataset
  !> or attribute may be made or changed by this way.
  subroutine open_file(name, writable, file, error, together)
    character(*), intent(in) :: name      !! path of a file that is there
    logical, intent(in) :: writable       !! for reading and writing; else for reading only
    type(hdf5_file), intent(out) :: file  !! open; not open after an error
    type(error_type), allocatable, intent(out) :: error
    logical, intent(in), optional :: together  !! a call of all ranks; absent: of this one
    integer(hid_t) :: access
    integer :: status, ignored
    logical :: of_all

    of_all = .false.
    if (present(together)) of_all = together
    file%name = trim(name)
    call make_access(access, status)
    if (status == 0 .and. of_all) call access_together(access, status)
    if (status == 0 .and. of_all) call write_together(file%writing, status)
    if (status == 0) call h5fopen_f(file%name, merge(H5F_ACC_RDWR_F, H5F_ACC_RDONLY_F, writable), &
      & file%id, status, access_prp=access)
    if (status /= 0) then
      call explain(error, 'open', file%name)
      file%id = -1
    end if
    call h5pclose_f(access, ignored)
  end subroutine open_file

  !> Hand all that is pending to the system.
  subroutine flush_file(file, error)
    type(hdf5_file), intent(in) :: file  !! open, with what is pending
    type(error_type), allocatable, intent(out) :: error
    integer :: status

    call h5fflush_f(file%id, H5F_SCOPE_GLOBAL_F, status)
    if (status /= 0) call explain(error, 'write', file%name)
  end subroutine flush_file

  !> Close a file; one that isn't open is left alone.
  subroutine close_file(file, error)
    type(hdf5_file), intent(inout) :: file  !! not open on return
    type(error_type), allocatable, intent(out) :: error
    integer :: status, ignored

    if (file%id < 0) return
    call h5fclose_f(file%id, status)
    if (status /= 0) call explain(error, 'complete', file%name)
    file%id = -1
    if (file%writing >= 0) call h5pclose_f(file%writing, ignored)
    file%writing = -1
  end subroutine close_file

  !> Make a group; the groups above it must be there.
  subroutine make_group(file, path, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is changed
    character(*), intent(in) :: path     !! of the new group
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: group
    integer :: status

    call h5gcreate_f(file%id, path, group, status)
    if (status == 0) call h5gclose_f(group, status)
    if (status /= 0) call explain(error, 'make '//path//' in', file%name)
  end subroutine make_group

  !> Copy a group or dataset, with all it holds, to the same path of another file.
  subroutine copy_object(from, path, to, error)
    type(hdf5_file), intent(in) :: from  !! the file with the object
    character(*), intent(in) :: path     !! of the object, in both files; none may be at it in `to`
    type(hdf5_file), intent(in) :: to    !! the file that gets the copy, writable
    type(error_type), allocatable, intent(out) :: error
    integer :: status

    call h5ocopy_f(from%id, path, to%id, path, status)
    if (status /= 0) call explain(error, 'copy '//path//' to', to%name)
  end subroutine copy_object

  !> Whether there is an object at `path`; the groups above it must be there.
  logical function object_exists(file, path)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is changed
    character(*), intent(in) :: path     !! of the object in the file, from its root
    integer :: status

    call h5lexists_f(file%id, path, object_exists, status)
    if (status /= 0) object_exists = .false.
  end function object_exists

  !> Remove the object at `path`.
  subroutine remove_object(file, path, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is changed
    character(*), intent(in) :: path     !! of the object in the file, from its root
    type(error_type), allocatable, intent(out) :: error
    integer :: status

    call h5ldelete_f(file%id, path, status)
    if (status /= 0) call explain(error, 'remove '//path//' from', file%name)
  end subroutine remove_object

  !> Add the attribute `name` of the given type and dataspace to the object at `path`.
  subroutine add_attribute(file, path, name, kind_id, space, values, status)
    type(hdf5_file), intent(in) :: file
    character(*), intent(in) :: path, name
    integer(hid_t), intent(in) :: kind_id, space
    type(c_ptr), intent(in) :: values
    integer, intent(out) :: status
    integer(hid_t) :: object, attribute
    integer :: ignored

    call h5oopen_f(file%id, path, object, status)
    if (status /= 0) return
    call h5acreate_f(object, name, kind_id, space, attribute, status)
    if (status == 0) then
      call h5awrite_f(attribute, kind_id, values, status)
      call h5aclose_f(attribute, ignored)
    end if
    call h5oclose_f(object, ignored)
  end subroutine add_attribute

  !> A 64-bit integer as a scalar attribute.
  subroutine put_attribute_integer(file, path, name, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is changed
    character(*), intent(in) :: path     !! of the object that gets it
    character(*), intent(in) :: name     !! of the new attribute
    integer(i8), intent(in) :: values    !! its value
    type(error_type), allocatable, intent(out) :: error
    integer(i8), target :: buffer
    integer(hid_t) :: space
    integer :: status, ignored

    buffer = values
    call h5screate_f(H5S_SCALAR_F, space, status)
    if (status == 0) then
      call add_attribute(file, path, name, H5T_STD_I64LE, space, c_loc(buffer), status)
      if (status /= 0) call explain(error, 'write '//name//' into', file%name)
      call h5sclose_f(space, ignored)
    end if
  end subroutine put_attribute_integer

  !> 64-bit integers as an attribute of rank 1.
  subroutine put_attribute_integers(file, path, name, values, error)
    type(hdf5_file), intent(in) :: file   !! open, writable if it is changed
    character(*), intent(in) :: path      !! of the object that gets it
    character(*), intent(in) :: name      !! of the new attribute
    integer(i8), intent(in) :: values(:)  !! (any length), its values
    type(error_type), allocatable, intent(out) :: error
    integer(i8), allocatable, target :: buffer(:)
    integer(hid_t) :: space
    integer :: status, ignored

    allocate (buffer, source=values)
    call h5screate_simple_f(1, [size(values, kind=hsize_t)], space, status)
    if (status == 0) then
      call add_attribute(file, path, name, H5T_STD_I64LE, space, c_loc(buffer), status)
      if (status /= 0) call explain(error, 'write '//name//' into', file%name)
      call h5sclose_f(space, ignored)
    end if
  end subroutine put_attribute_integers

  !> A text type of exactly this length (HDF5 has no empty text: one blank stands for it).
  subroutine make_text_type(length, kind_id, status)
    integer, intent(in) :: length
    integer(hid_t), intent(out) :: kind_id
    integer, intent(out) :: status

    call h5tcopy_f(H5T_FORTRAN_S1, kind_id, status)
    if (status == 0) call h5tset_size_f(kind_id, int(max(1, length), size_t), status)
  end subroutine make_text_type

  !> A text of fixed length as a scalar attribute.
  subroutine put_attribute_text(file, path, name, values, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is changed
    character(*), intent(in) :: path     !! of the object that gets it
    character(*), intent(in) :: name     !! of the new attribute
    character(*), intent(in) :: values   !! its text; '' is kept as one blank
    type(error_type), allocatable, intent(out) :: error
    character(len(values) + 1), target :: buffer
    integer(hid_t) :: space, kind_id
    integer :: status, ignored

    buffer = values
    call make_text_type(len(values), kind_id, status)
    if (status == 0) call h5screate_f(H5S_SCALAR_F, space, status)
    if (status == 0) then
      call add_attribute(file, path, name, kind_id, space, c_loc(buffer), status)
      if (status /= 0) call explain(error, 'write '//name//' into', file%name)
      call h5sclose_f(space, ignored)
    end if
    call h5tclose_f(kind_id, ignored)
  end subroutine put_attribute_text

  !> Change the value of a scalar 64-bit integer attribute: eight bytes of the file.
  subroutine change_attribute(file, path, name, value, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is changed
    character(*), intent(in) :: path     !! of the object that has it
    character(*), intent(in) :: name     !! of the attribute
    integer(i8), intent(in) :: value     !! its new value
    type(error_type), allocatable, intent(out) :: error
    integer(i8), target :: buffer
    integer(hid_t) :: object, attribute
    integer :: status, ignored

    buffer = value
    call h5oopen_f(file%id, path, object, status)
    if (status /= 0) then
      call explain(error, 'find '//path//' in', file%name)
      return
    end if
    call h5aopen_f(object, name, attribute, status)
    if (status == 0) then
      call h5awrite_f(attribute, H5T_STD_I64LE, c_loc(buffer), status)
      if (status /= 0) call explain(error, 'write '//name//' into', file%name)
      call h5aclose_f(attribute, ignored)
    else
      call explain(error, 'find '//path//' '//name//' in', file%name)
    end if
    call h5oclose_f(object, ignored)
  end subroutine change_attribute

  !> The value of a scalar 64-bit integer attribute.
  subroutine get_attribute(file, path, name, value, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is changed
    character(*), intent(in) :: path     !! of the object that has it
    character(*), intent(in) :: name     !! of the attribute
    integer(i8), intent(out) :: value    !! its value; 0 after an error
    type(error_type), allocatable, intent(out) :: error
    integer(i8), target :: buffer
    integer(hid_t) :: attribute
    type(c_ptr) :: place
    integer :: status, ignored

    buffer = 0
    call h5aopen_by_name_f(file%id, path, name, attribute, status)
    if (status == 0) then
      place = c_loc(buffer)
      call h5aread_f(attribute, H5T_STD_I64LE, place, status)
      if (status /= 0) call explain(error, 'read '//name//' of', file%name)
      call h5aclose_f(attribute, ignored)
    else
      call explain(error, 'find '//path//' '//name//' in', file%name)
    end if
    value = buffer
  end subroutine get_attribute

  !> Write a text as a dataset of one value; it may be UTF-8.
  subroutine put_text(file, path, text, error)
    type(hdf5_file), intent(in) :: file  !! open, writable if it is changed
    character(*), intent(in) :: path     !! of the new dataset
    character(*), intent(in) :: text     !! of any length; '' is kept as one blank
    type(error_type), allocatable, intent(out) :: error
    character(kind=c_char), allocatable, target :: buffer(:)
    integer(hid_t) :: space, kind_id, dataset
    integer :: status, ignored, i

    allocate (buffer(max(1, len(text))))
    buffer = ' '
    do i = 1, len(text)
      buffer(i) = text(i:i)
    end do
    call make_text_type(len(text), kind_id, status)
    if (status == 0) call h5tset_cset_f(kind_id, H5T_CSET_UTF8_F, status)
    if (status == 0) call h5screate_f(H5S_SCALAR_F, space, status)
    if (status == 0) then
      call h5dcreate_f(file%id, path, kind_id, space, dataset, status)
      if (status == 0) then
        call h5dwrite_f(dataset, kind_id, c_loc(buffer), status)
        if (status /= 0) call explain(error, 'write '//path//' into', file%name)
        call h5dclose_f(dataset, ignored)
      else
        call explain(error, 'make '//path//' in', file%name)
      end if
      call h5sclose_f(space, ignored)
    end if
    call h5tclose_f(kind_id, ignored)
  end subroutine put_text

  !> A text as `put_text` writes it.
  subroutine get_text(file, path, text, error)
    type(hdf5_file), intent(in) :: file             !! open, writable if it is changed
    character(*), intent(in) :: path                !! of the dataset
    character(:), allocatable, intent(out) :: text  !! of the length that the file has; '' after an
                                                    !! error
    type(error_type), allocatable, intent(out) :: error
    character(kind=c_char), allocatable, target :: buffer(:)
    integer(hid_t) :: kind_id, dataset
    integer(size_t) :: length
    type(c_ptr) :: place
    integer :: status, ignored, i

    text = ''
    call h5dopen_f(file%id, path, dataset, status)
    if (status /= 0) then
      call explain(error, 'find '//path//' in', file%name)
      return
    end if
    call h5dget_type_f(dataset, kind_id, status)
    if (status == 0) call h5tget_size_f(kind_id, length, status)
    if (status == 0) then
      allocate (buffer(length))
      place = c_loc(buffer)
      call h5dread_f(dataset, kind_id, place, status)
    end if
    if (status /= 0) then
      call explain(error, 'read '//path//' of', file%name)
    else
      text = repeat(' ', size(buffer))
      do i = 1, size(buffer)
        text(i:i) = buffer(i)
      end do
    end if
    call h5tclose_f(kind_id, ignored)
    call h5dclose_f(dataset, ignored)
  end subroutine get_text

end module pd_output_results_hdf5
