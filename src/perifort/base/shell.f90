!> Commands as a user has to type them into a shell, for messages.
module pd_base_shell
  implicit none (type, external)
  private
  public :: program_command, quoted

  !> Characters that no shell treats specially inside a word.
  character(*), parameter :: plain = 'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ'// &
    & '0123456789_-./+:,=@%'

contains

  !> The command that started this program: that of `./pf`, which it passes in the environment
  !> variable PERIFORT_COMMAND, else the program's own path as it was typed. Quoted where needed.
  function program_command() result(text)
    character(:), allocatable :: text   !! not empty
    integer :: length, status

    call get_environment_variable('PERIFORT_COMMAND', length=length, status=status)
    if (status == 0 .and. length > 0) then
      allocate (character(length) :: text)
      call get_environment_variable('PERIFORT_COMMAND', value=text)
    else
      call get_command_argument(0, length=length)
      allocate (character(length) :: text)
      call get_command_argument(0, value=text)
    end if
    if (len(text) == 0) text = 'perifort'
    text = quoted(text)
  end function program_command

  !> A word as a shell needs it to pass it on unchanged: in single quotes if it has a character that
  !> a shell treats specially, and a quote inside as '\''.
  pure function quoted(word) result(text)
    character(*), intent(in) :: word    !! any characters
    character(:), allocatable :: text
    integer :: i

    text = word
    if (len(word) > 0 .and. verify(word, plain) == 0) return
    text = "'"
    do i = 1, len(word)
      if (word(i:i) == "'") then
        text = text//"'\''"
      else
        text = text//word(i:i)
      end if
    end do
    text = text//"'"
  end function quoted

end module pd_base_shell
