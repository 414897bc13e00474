!> Version of perifort, its compiler and its libraries.
module pd_base_version
  use, intrinsic :: iso_fortran_env, only: compiler_options, compiler_version
  implicit none (type, external)
  private
  public :: program_version, compiler_name, compiler_flags

  character(*), parameter :: program_version = '0.2.0'  !! the same as in fpm.toml

contains

  !> The compiler and its version.
  function compiler_name() result(text)
    character(:), allocatable :: text
    text = trim(compiler_version())
  end function compiler_name

  !> The compiler's flags that change the results or the speed. Folders, warnings and repetitions
  !> are left out, and so is the long list that `-march=native` stands for.
  function compiler_flags() result(text)
    character(:), allocatable :: text
    character(:), allocatable :: all, word
    integer :: at, next
    logical :: skip

    all = trim(compiler_options())//' '
    text = ''
    skip = .false.
    at = 1
    do while (at <= len(all))
      next = index(all(at:), ' ')
      word = all(at:at + next - 2)
      at = at + next
      if (skip) then
        skip = .false.
      else if (word == '-I' .or. word == '-J' .or. word == '-o') then
        skip = .true.
      else if (tells(word)) then
        if (index(' '//text//' ', ' '//word//' ') == 0) text = text//' '//word
      end if
    end do
    text = trim(adjustl(text))
  end function compiler_flags

  pure logical function tells(word)
    character(*), intent(in) :: word
    tells = .false.
    if (len(word) < 2) return
    select case (word(1:2))
    case ('-I', '-J', '-W', '--')
      continue
    case ('-m')
      tells = index(word, '-march=') == 1 .or. index(word, '-mcpu=') == 1
    case ('-O', '-f', '-s', '-g')
      tells = index(word, '-fpre-include') /= 1 .and. index(word, '-fmax-errors') /= 1
    case default
      continue  ! any other word says nothing of the code that is made
    end select
  end function tells

end module pd_base_version
