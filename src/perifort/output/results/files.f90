!> Files and folders: what standard Fortran leaves out, through the C library and without a shell.
module pd_output_results_files
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_int, c_int64_t, &
    & c_null_char, c_ptr
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: i8
  implicit none (type, external)
  private
  public :: make_directory, remove_empty, rename_file, remove_file, cut_file, file_exists, &
    & directory_exists, file_bytes, set_environment, in_directory, sync_path

  ! allow(C071)
  interface  ! C's texts have no other form
    integer(c_int) function c_mkdir(path, mode) bind(c, name='mkdir')
      import :: c_char, c_int
      implicit none (type, external)
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), value :: mode
    end function c_mkdir

    integer(c_int) function c_rmdir(path) bind(c, name='rmdir')
      import :: c_char, c_int
      implicit none (type, external)
      character(kind=c_char), intent(in) :: path(*)
    end function c_rmdir

    integer(c_int) function c_rename(from, to) bind(c, name='rename')
      import :: c_char, c_int
      implicit none (type, external)
      character(kind=c_char), intent(in) :: from(*), to(*)
    end function c_rename

    integer(c_int) function c_remove(path) bind(c, name='remove')
      import :: c_char, c_int
      implicit none (type, external)
      character(kind=c_char), intent(in) :: path(*)
    end function c_remove

    integer(c_int) function c_truncate(path, length) bind(c, name='truncate')
      import :: c_char, c_int, c_int64_t
      implicit none (type, external)
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int64_t), value :: length
    end function c_truncate

    integer(c_int) function c_setenv(name, value, overwrite) bind(c, name='setenv')
      import :: c_char, c_int
      implicit none (type, external)
      character(kind=c_char), intent(in) :: name(*), value(*)
      integer(c_int), value :: overwrite
    end function c_setenv

    type(c_ptr) function c_fopen(path, mode) bind(c, name='fopen')
      import :: c_char, c_ptr
      implicit none (type, external)
      character(kind=c_char), intent(in) :: path(*), mode(*)
    end function c_fopen

    integer(c_int) function c_fclose(stream) bind(c, name='fclose')
      import :: c_int, c_ptr
      implicit none (type, external)
      type(c_ptr), value :: stream
    end function c_fclose

    integer(c_int) function c_fileno(stream) bind(c, name='fileno')
      import :: c_int, c_ptr
      implicit none (type, external)
      type(c_ptr), value :: stream
    end function c_fileno

    integer(c_int) function c_fsync(descriptor) bind(c, name='fsync')
      import :: c_int
      implicit none (type, external)
      integer(c_int), value :: descriptor
    end function c_fsync
  end interface

contains

  !> Make a folder and the folders above it; those that are there are left alone.
  !> Fails with the path and the system's reason.
  subroutine make_directory(path, error, made)
    character(*), intent(in) :: path  !! of the folder; '' for the current one
    type(error_type), allocatable, intent(out) :: error
    !> length of the part of `path` that is the first folder made; 0 if none was made, or after an
    !> error
    integer, intent(out), optional :: made
    integer(c_int), parameter :: everyone = int(o'777', c_int)
    integer :: i, first

    first = 0
    if (present(made)) made = 0
    if (len_trim(path) == 0) return
    do i = 2, len_trim(path) + 1
      if (i <= len_trim(path)) then
        if (path(i:i) /= '/') cycle
      end if
      if (c_mkdir(path(:i - 1)//c_null_char, everyone) == 0_c_int .and. first == 0) first = i - 1
    end do
    if (directory_exists(path)) then
      if (present(made)) made = first
      return
    end if
    call fail(error, 'cannot make the folder '//trim(path)//': '//reason_for(trim(path)))
    if (first > 0) call remove_empty(path, first)
  end subroutine make_directory

  !> Remove a folder that is empty, and thereafter those above it that are empty then. The first
  !> one that is not stays, and all above it. A failure is not reported.
  subroutine remove_empty(path, made)
    character(*), intent(in) :: path  !! of the folder
    integer, intent(in) :: made       !! as from `make_directory`: length of the path of the topmost
                                      !! folder that may be removed; 0: none
    integer(c_int) :: status
    integer :: i

    if (made == 0) return
    do i = len_trim(path) + 1, made + 1, -1
      if (i <= len_trim(path)) then
        if (path(i:i) /= '/') cycle
      end if
      status = c_rmdir(path(:i - 1)//c_null_char)
    end do
  end subroutine remove_empty

  !> Why nothing can be made at `path`: mkdir keeps its reason in C's errno, which has no
  !> portable name, but opening a file at the same place fails for the same reason.
  function reason_for(path) result(reason)
    character(*), intent(in) :: path
    character(:), allocatable :: reason
    character(512) :: message
    integer :: unit, status

    message = ''
    open (newunit=unit, file=path, status='new', action='write', iostat=status, iomsg=message)
    if (status == 0) close (unit, status='delete', iostat=status)
    if (status == 0) message = ''
    reason = trim(message)
    if (reason == '') reason = 'the system gives no reason'
    if (index(reason, ': ', back=.true.) > 0) reason = reason(index(reason, ': ', back=.true.) + 2:)
  end function reason_for

  !> Put the file `from` in the place of `to` in one step: whoever opens `to` sees either the old or
  !> the new file, whole. An error if the system refuses.
  subroutine rename_file(from, to, error)
    character(*), intent(in) :: from  !! path of the file
    character(*), intent(in) :: to    !! path in the same file system; a file there is replaced
    type(error_type), allocatable, intent(out) :: error

    if (c_rename(trim(from)//c_null_char, trim(to)//c_null_char) == 0) return
    call fail(error, 'cannot rename '//trim(from)//' to '//trim(to))
  end subroutine rename_file

  !> Wait until all that was written to a file is on the disk; of a folder, the names in it. An
  !> error if it cannot be opened or the system reports a failure.
  subroutine sync_path(path, error)
    character(*), intent(in) :: path  !! of a file or folder that is there
    type(error_type), allocatable, intent(out) :: error
    type(c_ptr) :: stream
    integer(c_int) :: status, ignored

    stream = c_fopen(trim(path)//c_null_char, 'rb'//c_null_char)
    status = -1_c_int
    if (c_associated(stream)) then
      status = c_fsync(c_fileno(stream))
      ignored = c_fclose(stream)
    end if
    if (status /= 0) call fail(error, 'the system does not bring '//trim(path)//' to the disk')
  end subroutine sync_path

  !> Remove a file if it is there. A failure is not reported.
  subroutine remove_file(path)
    character(*), intent(in) :: path  !! of a file or an empty folder
    integer(c_int) :: status

    if (.not. file_exists(path)) return
    status = c_remove(trim(path)//c_null_char)
  end subroutine remove_file

  !> Cut a file to its first `bytes` bytes. A failure is not reported.
  subroutine cut_file(path, bytes)
    character(*), intent(in) :: path  !! of a file that is there
    integer(i8), intent(in) :: bytes  !! length that is left [bytes]
    integer(c_int) :: status

    status = c_truncate(trim(path)//c_null_char, int(bytes, c_int64_t))
  end subroutine cut_file

  !> Whether there is a file (or folder) of this name.
  logical function file_exists(path)
    character(*), intent(in) :: path  !! blanks at its end do not count
    inquire (file=trim(path), exist=file_exists)
  end function file_exists

  !> Whether there is a folder of this name.
  logical function directory_exists(path)
    character(*), intent(in) :: path  !! blanks at its end do not count
    inquire (file=trim(path)//'/.', exist=directory_exists)
  end function directory_exists

  !> The size of a file [bytes]; -1 if it isn't there.
  integer(i8) function file_bytes(path)
    character(*), intent(in) :: path  !! blanks at its end do not count
    inquire (file=trim(path), size=file_bytes)
  end function file_bytes

  !> Set a variable of the process's environment unless the user has set it already.
  subroutine set_environment(name, value)
    character(*), intent(in) :: name   !! of the variable, without blanks at its end
    character(*), intent(in) :: value  !! that it gets if it is not set
    integer(c_int) :: status

    status = c_setenv(name//c_null_char, value//c_null_char, 0_c_int)
  end subroutine set_environment

  !> `name` inside `directory` ('' = the current one).
  pure function in_directory(directory, name) result(path)
    character(*), intent(in) :: directory  !! '' for the current one; a slash may end it
    character(*), intent(in) :: name       !! of the file; blanks at its end do not count
    character(:), allocatable :: path

    if (len_trim(directory) == 0) then
      path = trim(name)
    else if (directory(len_trim(directory):len_trim(directory)) == '/') then
      path = trim(directory)//trim(name)
    else
      path = trim(directory)//'/'//trim(name)
    end if
  end function in_directory

end module pd_output_results_files
