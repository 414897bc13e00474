!> Files and folders.
module test_output_results_files
  use pd_base_error, only: failure_type => error_type
  use pd_base_kinds, only: i8
  use pd_output_results_files, only: cut_file, directory_exists, file_bytes, file_exists, &
    & in_directory, make_directory, remove_empty, remove_file, rename_file
  use pd_output_results_sink, only: sink_type
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_output_results_files

  character(*), parameter :: here = 'build/test_output_results_files'

contains

  subroutine collect_output_results_files(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)

    testsuite = [ &
      & new_unittest('folders', folders), &
      & new_unittest('empty_folders', empty_folders), &
      & new_unittest('a_file_in_the_way', a_file_in_the_way), &
      & new_unittest('rename_replaces', rename_replaces), &
      & new_unittest('cut', cut), &
      & new_unittest('paths', paths) &
      & ]
  end subroutine collect_output_results_files

  !> Make a file that holds `text`.
  subroutine write_file(path, text, failure)
    character(*), intent(in) :: path, text
    type(failure_type), allocatable, intent(out) :: failure
    type(sink_type) :: sink

    call make_directory(here, failure)
    if (.not. allocated(failure)) call sink%open(path, failure)
    if (.not. allocated(failure)) call sink%put(text, failure)
    if (.not. allocated(failure)) call sink%close(failure)
  end subroutine write_file

  subroutine folders(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure

    call make_directory(here//'/one/two/three', failure)
    call check(error,.not. allocated(failure), 'folders are not made')
    if (allocated(error)) return
    call check(error, directory_exists(here//'/one/two/three'))
    if (allocated(error)) return
    call make_directory(here//'/one/two/three/', failure)
    call check(error,.not. allocated(failure), 'a folder that is there is refused')
  end subroutine folders

  !> Only folders that are empty and were made are removed, from the lowest up.
  subroutine empty_folders(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    integer :: made

    call make_directory(here//'/there', failure)
    if (.not. allocated(failure)) call make_directory(here//'/there/x/y/', failure, made)
    call check(error,.not. allocated(failure), 'folders are not made')
    if (allocated(error)) return
    call check(error, made, len(here//'/there/x'))
    if (allocated(error)) return
    call remove_empty(here//'/there/x/y/', made)
    call check(error, directory_exists(here//'/there') .and. &
      & .not. directory_exists(here//'/there/x'), 'more or less than what was made is removed')
    if (allocated(error)) return
    call make_directory(here//'/there', failure, made)
    call check(error, made, 0)
    if (allocated(error)) return
    call remove_empty(here//'/there', made)
    call check(error, directory_exists(here//'/there'), 'a folder that was there is removed')
    if (allocated(error)) return
    call make_directory(here//'/there/x/y', failure, made)
    if (.not. allocated(failure)) call write_file(here//'/there/x/file', 'x', failure)
    call check(error,.not. allocated(failure))
    if (allocated(error)) return
    call remove_empty(here//'/there/x/y', made)
    call check(error, directory_exists(here//'/there/x') .and. &
      & .not. directory_exists(here//'/there/x/y'), 'a folder with a file in it')
    if (allocated(error)) return
    call remove_file(here//'/there/x/file')
    call remove_empty(here//'/there/x', made)
    call check(error,.not. directory_exists(here//'/there/x'))
    if (allocated(error)) return
    call remove_file(here//'/there')
  end subroutine empty_folders

  subroutine a_file_in_the_way(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure

    call write_file(here//'/wall', 'x', failure)
    call check(error,.not. allocated(failure))
    if (allocated(error)) return
    call make_directory(here//'/wall/below', failure)
    call check(error, allocated(failure), 'a folder within a file')
    if (allocated(error)) return
    call check(error, index(failure%message, here//'/wall/below') > 0, failure%message)
    if (allocated(error)) return
    call check(error, file_bytes(here//'/wall') == 1_i8, 'the file in the way is changed')
  end subroutine a_file_in_the_way

  subroutine rename_replaces(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure

    call write_file(here//'/old', 'old', failure)
    if (.not. allocated(failure)) call write_file(here//'/new', 'newer', failure)
    if (.not. allocated(failure)) call rename_file(here//'/new', here//'/old', failure)
    call check(error,.not. allocated(failure))
    if (allocated(error)) return
    call check(error, file_bytes(here//'/old') == 5_i8, 'the old file is still there')
    if (allocated(error)) return
    call check(error,.not. file_exists(here//'/new'))
    if (allocated(error)) return
    call remove_file(here//'/old')
    call check(error,.not. file_exists(here//'/old'))
    if (allocated(error)) return
    call rename_file(here//'/new', here//'/old', failure)
    call check(error, allocated(failure), 'what is not there is renamed')
  end subroutine rename_replaces

  subroutine cut(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure

    call write_file(here//'/long', repeat('abc', 100), failure)
    call check(error,.not. allocated(failure))
    if (allocated(error)) return
    call cut_file(here//'/long', 7_i8)
    call check(error, file_bytes(here//'/long') == 7_i8)
  end subroutine cut

  subroutine paths(error)
    type(error_type), allocatable, intent(out) :: error

    call check(error, in_directory('a/b', 'c'), 'a/b/c')
    if (allocated(error)) return
    call check(error, in_directory('a/b/', 'c'), 'a/b/c')
    if (allocated(error)) return
    call check(error, in_directory('', 'c'), 'c')
  end subroutine paths

end module test_output_results_files
