!> Version and compiler.
module test_base_version
  use pd_base_version, only: compiler_flags, compiler_name, program_version
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_base_version

contains

  subroutine collect_base_version(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('the version is that of fpm.toml', test_version), &
      & new_unittest('the citation is of this version', test_citation), &
      & new_unittest('compiler and flags are known', test_compiler)]
  end subroutine collect_base_version

  subroutine test_version(error)
    type(error_type), allocatable, intent(out) :: error
    character(200) :: line
    integer :: unit, io

    open (newunit=unit, file='fpm.toml', status='old', action='read', iostat=io)
    call check(error, io, 0, 'fpm.toml cannot be read; tests run in the project''s folder')
    if (allocated(error)) return
    do
      read (unit, '(a)', iostat=io) line
      if (io /= 0) exit
      if (index(line, 'version = ') == 1) exit
    end do
    close (unit)
    call check(error, trim(line), 'version = "'//program_version//'"')
  end subroutine test_version

  subroutine test_citation(error)
    type(error_type), allocatable, intent(out) :: error
    character(200) :: line
    integer :: unit, io

    open (newunit=unit, file='CITATION.cff', status='old', action='read', iostat=io)
    call check(error, io, 0, 'CITATION.cff cannot be read')
    if (allocated(error)) return
    do
      read (unit, '(a)', iostat=io) line
      if (io /= 0) exit
      if (index(line, 'version: ') == 1) exit
    end do
    close (unit)
    call check(error, trim(line), 'version: '//program_version)
  end subroutine test_citation

  subroutine test_compiler(error)
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: flags

    call check(error, len(compiler_name()) > 0, 'the compiler has no name')
    if (allocated(error)) return
    flags = compiler_flags()
    call check(error, index(flags, '-O') > 0, 'no level of optimisation in: '//flags)
    if (allocated(error)) return
    if (index(flags, '-I') > 0 .or. index(flags, '.mod') > 0 .or. index(flags, '/') > 0) then
      call test_failed(error, 'folders are no flags: '//flags)
    end if
  end subroutine test_compiler

end module test_base_version
