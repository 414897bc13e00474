!> Commands, options, and what is said about wrong ones.
module test_command_line
  use pd_base_error, only: pd_error => error_type, status_usage
  use pd_base_shell, only: quoted
  use pd_base_text, only: newline
  use pd_command_help, only: help_text
  use pd_command_line, only: command_line_type, command_names, parse_command_line, &
    & restart_command
  use pd_scene_format_file, only: read_text_file
  use pd_output_fields_table, only: all_fields, field_table_type
  use pd_scene_content_template, only: template_names, template_text
  use testdrive, only: check, error_type, new_unittest, skip_test, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_command_line

  integer, parameter :: w = 20   !! longest word in these tests

contains

  subroutine collect_command_line(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('run with all its options', test_run), &
      & new_unittest('options may stand before the file and take =', test_order), &
      & new_unittest('defaults', test_defaults), &
      & new_unittest('continuing a run', test_restart), &
      & new_unittest('keys that are set', test_set), &
      & new_unittest('commands are quoted for a shell', test_quoted), &
      & new_unittest('the texts in doc/printed are up to date', test_printed), &
      & new_unittest('bench with all its options', test_bench), &
      & new_unittest('limits with its options', test_limits), &
      & new_unittest('names after -- may begin with a dash', test_dashes), &
      & new_unittest('every command has help', test_help), &
      & new_unittest('--help needs no other arguments', test_help_excuses), &
      & new_unittest('--version is version', test_version), &
      & new_unittest('wrong command lines are errors', test_wrong), &
      & new_unittest('the nearest name is suggested', test_suggestions)]
  end subroutine collect_command_line

  subroutine test_run(error)
    type(error_type), allocatable, intent(out) :: error
    type(command_line_type) :: line
    type(pd_error), allocatable :: fault

    call parse_command_line([character(w) :: 'run', 'a.nml', '--output', 'some/where', &
      & '--threads', '4', '--overwrite', '--quiet'], line, fault)
    call check(error, .not. allocated(fault), 'a good command line was refused')
    if (allocated(error)) return
    call check(error, line%command//' '//line%argument//' '//line%output_directory, &
      & 'run a.nml some/where')
    if (allocated(error)) return
    call check(error, line%threads, 4)
    if (allocated(error)) return
    call check(error, line%overwrite .and. line%quiet .and. .not. line%help)
  end subroutine test_run

  subroutine test_order(error)
    type(error_type), allocatable, intent(out) :: error
    type(command_line_type) :: line
    type(pd_error), allocatable :: fault

    call parse_command_line([character(w) :: '--quiet', '--threads=2', 'run', '--output=a=b', &
      & 'a.nml'], line, fault)
    call check(error, .not. allocated(fault), 'a good command line was refused')
    if (allocated(error)) return
    call check(error, line%command//' '//line%argument//' '//line%output_directory, 'run a.nml a=b')
    if (allocated(error)) return
    call check(error, line%threads, 2)
  end subroutine test_order

  subroutine test_defaults(error)
    type(error_type), allocatable, intent(out) :: error
    type(command_line_type) :: line
    type(pd_error), allocatable :: fault

    call parse_command_line([character(w) :: 'check', 'a.nml'], line, fault)
    call check(error, .not. allocated(fault), 'a good command line was refused')
    if (allocated(error)) return
    call check(error, line%threads == 0 .and. .not. (line%overwrite .or. line%quiet .or. line%help))
    if (allocated(error)) return
    call check(error, len(line%output_directory), 0)
    if (allocated(error)) return
    call parse_command_line([character(w) :: 'template'], line, fault)
    call check(error, .not. allocated(fault), 'template needs no name')
    if (allocated(error)) return
    call check(error, len(line%argument), 0)
  end subroutine test_defaults

  !> The checkpoint may be left out, wherever the option stands; the command that goes on with a run
  !> has all its other options.
  subroutine test_restart(error)
    type(error_type), allocatable, intent(out) :: error
    type(command_line_type) :: line
    type(pd_error), allocatable :: fault

    call parse_command_line([character(w) :: 'run', 'a b.nml', '--restart', '--output', 'dir', &
      & '--threads', '2', '--quiet', '--max-minutes', '2.5'], line, fault)
    call check(error, .not. allocated(fault), 'a good command line was refused')
    if (allocated(error)) return
    call check(error, line%restart .and. len(line%checkpoint) == 0)
    if (allocated(error)) return
    call check(error, abs(line%max_minutes - 2.5d0) <= 0.0d0)
    if (allocated(error)) return
    call check(error, restart_command(line), "perifort run 'a b.nml' --output dir --threads 2 "// &
      & '--max-minutes 2.5 --quiet --restart')
    if (allocated(error)) return
    call parse_command_line([character(w) :: 'run', 'a.nml', '--restart', 'b.old'], line, fault)
    call check(error, line%argument//' '//line%checkpoint, 'a.nml b.old')
    if (allocated(error)) return
    call parse_command_line([character(w) :: 'run', '--restart=b.old', 'a.nml'], line, fault)
    call check(error, line%argument//' '//line%checkpoint, 'a.nml b.old')
    if (allocated(error)) return
    call parse_command_line([character(w) :: 'run', '--restart', 'a.nml'], line, fault)
    call check(error, line%argument//' '//line%checkpoint, 'a.nml ')
    if (allocated(error)) return
    call parse_command_line([character(w) :: 'run', '--', '-it''s.nml'], line, fault, &
      & "'../my pf'")
    call check(error, restart_command(line), "'../my pf' run ./'-it'\''s.nml' --restart")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--restart', 'b', 'c'], 'takes one argument')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'study', 'a', '--restart'], 'is no option of')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'choose', 'a', '--max-minutes', '1'], 'is no option of')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--restart', '--overwrite'], &
      & 'give one of them')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'check', 'a', '--restart'], "no option of 'check'")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--max-minutes', '0'], "found '0'")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--max-minutes', 'ten'], "found 'ten'")
  end subroutine test_restart

  !> `--set` may be repeated; the command that goes on with a run has them all.
  subroutine test_set(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: commands(5) = [character(6) :: 'run', 'check', 'limits', 'study', &
      & 'choose']
    type(command_line_type) :: line
    type(pd_error), allocatable :: fault
    character(2*w) :: words(8)
    integer :: i

    words(:) = [character(2*w) :: '', '--set', 'horizon%ratio=4', 'a.nml', &
      & '--set=body(1)%points=20, 10', '--set', "title=it's = me", '--error=1']
    do i = 1, size(commands)
      words(1) = commands(i)
      call parse_command_line(words(:merge(8, 7, commands(i) == 'choose')), line, fault)
      call check(error, .not. allocated(fault), 'a good command line was refused')
      if (allocated(error)) return
      call check(error, size(line%changes), 3)
      if (allocated(error)) return
      call check(error, line%changes(1)%text//'|'//line%changes(2)%text//'|'// &
        & line%changes(3)%text, "horizon%ratio=4|body(1)%points=20, 10|title=it's = me")
      if (allocated(error)) return
    end do
    words(1) = 'run'
    words(8) = '--quiet'
    call parse_command_line(words, line, fault)
    call check(error, restart_command(line), "perifort run a.nml --set horizon%ratio=4 --set "// &
      & "'body(1)%points=20, 10' --set 'title=it'\''s = me' --quiet --restart")
    if (allocated(error)) return
    call parse_command_line([character(w) :: 'run', 'a.nml'], line, fault)
    call check(error, size(line%changes), 0)
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--set'], 'as in --set horizon%ratio=4')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--set', 'ratio'], "found 'ratio'")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--set', '=4'], "found '=4'")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--set', 'ratio='], "found 'ratio='")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--set', '--quiet'], "found ''")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'bench', '--set', 'ratio=4'], "no option of 'bench'")
  end subroutine test_set

  !> Several numbers may be parted by blanks or commas.
  subroutine test_bench(error)
    type(error_type), allocatable, intent(out) :: error
    type(command_line_type) :: line
    type(pd_error), allocatable :: fault

    call parse_command_line([character(w) :: 'bench', '--points', '40', '80', '--threads', '1,2', &
      & '--dimension=3,2', '--model', 'both', '--family', 'list', '--breaking', 'off', &
      & '--surface', '--seconds', '0.5', '--csv', 'a.csv'], line, fault)
    call check(error, .not. allocated(fault), 'a good command line was refused')
    if (allocated(error)) return
    call check(error, size(line%bench%points) == 2 .and. size(line%bench%threads) == 2 .and. &
      & size(line%bench%dimensions) == 2, 'how many numbers')
    if (allocated(error)) return
    call check(error, all(line%bench%points == [40, 80]) .and. all(line%bench%threads == [1, 2]) &
      & .and. all(line%bench%dimensions == [3, 2]), 'the numbers')
    if (allocated(error)) return
    call check(error, line%bench%model//' '//line%bench%family//' '//line%bench%breaking//' '// &
      & line%bench%csv, 'both list off a.csv')
    if (allocated(error)) return
    call check(error, line%bench%surface .and. abs(line%bench%seconds - 0.5d0) <= 0.0d0)
    if (allocated(error)) return
    call refused(error, [character(w) :: 'bench', 'a.nml'], 'takes no argument')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'bench', '--points', '40,,80'], "found '40,,80'")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'bench', '--points', '3'], "'--points' must be between")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'bench', '--threads', '1', '0'], "found '1,0'")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'bench', '--seconds', 'long'], "found 'long'")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'bench', '--model', 'bond'], 'must be state_based')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--threads', '1,2'], 'takes one number')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--csv', 'b'], "no option of 'run'")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'choose', 'a'], "needs the error to be met")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'choose', 'a', '--error', '0'], "'--error' needs a number")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'study', 'a', '--error', '1'], "no option of 'study'")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'study'], 'needs the scene file')
  end subroutine test_bench

  !> `limits` takes a scene and a time for its runs, a minute if none is given.
  subroutine test_limits(error)
    type(error_type), allocatable, intent(out) :: error
    type(command_line_type) :: line
    type(pd_error), allocatable :: fault

    call parse_command_line([character(w) :: 'limits', 'a.nml'], line, fault)
    call check(error, .not. allocated(fault) .and. abs(line%seconds - 60.0d0) <= 0.0d0, 'default')
    if (allocated(error)) return
    call parse_command_line([character(w) :: 'limits', 'a.nml', '--seconds', '2.5', &
      & '--threads=2'], line, fault)
    call check(error, .not. allocated(fault) .and. abs(line%seconds - 2.5d0) <= 0.0d0 .and. &
      & line%threads == 2, 'options')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'limits'], 'needs the scene file')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'limits', 'a', '--seconds', '0'], 'between 1 and 86400')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--seconds', '9'], "no option of 'run'")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'limits', 'a', '--overwrite'], "no option of 'limits'")
  end subroutine test_limits

  subroutine test_dashes(error)
    type(error_type), allocatable, intent(out) :: error
    type(command_line_type) :: line
    type(pd_error), allocatable :: fault

    call parse_command_line([character(w) :: 'run', '--', '--odd.nml'], line, fault)
    call check(error, .not. allocated(fault), 'a good command line was refused')
    if (allocated(error)) return
    call check(error, line%argument, '--odd.nml')
  end subroutine test_dashes

  subroutine test_help(error)
    type(error_type), allocatable, intent(out) :: error
    type(command_line_type) :: line
    type(pd_error), allocatable :: fault
    character(:), allocatable :: name
    integer :: i

    do i = 1, size(command_names) - 1
      name = trim(command_names(i))
      call parse_command_line([character(w) :: 'help', name], line, fault)
      call check(error, .not. allocated(fault), 'help '//name//' was refused')
      if (allocated(error)) return
      call check(error, line%help .and. line%command == name, name//' is not what help is given on')
      if (allocated(error)) return
      call check(error, index(help_text(name), 'perifort '//name), 1, 'no help on '//name)
      if (allocated(error)) return
      call check(error, index(help_text(''), 'perifort '//name//' ') > 0, &
        & name//' is not in the help of the program')
      if (allocated(error)) return
    end do
  end subroutine test_help

  !> By the rules of the POSIX shell: nothing is special in single quotes but the quote itself.
  subroutine test_quoted(error)
    type(error_type), allocatable, intent(out) :: error

    call check(error, quoted('out/a-b_1.nml'), 'out/a-b_1.nml')
    if (allocated(error)) return
    call check(error, quoted('a b'), "'a b'")
    if (allocated(error)) return
    call check(error, quoted("it's"), "'it'\''s'")
    if (allocated(error)) return
    call check(error, quoted('$(x);`y`\*~#'), "'$(x);`y`\*~#'")
    if (allocated(error)) return
    call check(error, quoted(''), "''")
  end subroutine test_quoted

  !> `./pf` prints these files where nothing is built.
  subroutine test_printed(error)
    type(error_type), allocatable, intent(out) :: error
    type(pd_error), allocatable :: fault
    type(field_table_type) :: fields
    character(:), allocatable :: text
    integer :: i

    fields = all_fields()
    call read_text_file('doc/printed/help.txt', text, fault)
    if (allocated(fault)) then
      call skip_test(error, 'not run in the project''s folder')
      return
    end if
    call compare('help.txt', help_text(''))
    do i = 1, size(command_names) - 1
      call compare('help-'//trim(command_names(i))//'.txt', help_text(trim(command_names(i))))
    end do
    do i = 1, size(template_names)
      call template_text(trim(template_names(i)), text, fault, fields%names())
      call compare('template-'//trim(template_names(i))//'.nml', text)
      if (allocated(error)) return
      call check(error, index(help_text('template'), trim(template_names(i))) > 0, &
        & 'the help of template does not name '//trim(template_names(i)))
    end do

  contains

    subroutine compare(name, expected)
      character(*), intent(in) :: name, expected
      character(:), allocatable :: found
      type(pd_error), allocatable :: missing
      if (allocated(error)) return
      call read_text_file('doc/printed/'//name, found, missing)
      if (allocated(missing)) then
        call test_failed(error, missing%message)
      else
        call check(error, found == expected .and. len(found) == len(expected), 'doc/printed/'// &
          & name//' differs from what the program prints; write it anew with .ci/renew_texts')
      end if
    end subroutine compare
  end subroutine test_printed

  subroutine test_help_excuses(error)
    type(error_type), allocatable, intent(out) :: error
    type(command_line_type) :: line
    type(pd_error), allocatable :: fault

    call parse_command_line([character(w) :: 'run', '-h'], line, fault)
    call check(error, .not. allocated(fault) .and. line%help, 'run -h was refused')
    if (allocated(error)) return
    call parse_command_line([character(w) :: '--help'], line, fault)
    call check(error, .not. allocated(fault) .and. line%help, '--help was refused')
    if (allocated(error)) return
    call check(error, len(line%command), 0)
    if (allocated(error)) return
    call parse_command_line([character(w) :: 'help'], line, fault)
    call check(error, .not. allocated(fault) .and. line%help, 'help was refused')
  end subroutine test_help_excuses

  subroutine test_version(error)
    type(error_type), allocatable, intent(out) :: error
    type(command_line_type) :: line
    type(pd_error), allocatable :: fault

    call parse_command_line([character(w) :: '--version'], line, fault)
    call check(error, .not. allocated(fault), '--version was refused')
    if (allocated(error)) return
    call check(error, line%command, 'version')
  end subroutine test_version

  !> Each wrong line gives the status of a wrong command line and says the words that matter.
  subroutine test_wrong(error)
    type(error_type), allocatable, intent(out) :: error
    character(w), parameter :: none(0) = [character(w) ::]

    call refused(error, none, 'no command')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run'], 'needs the scene file')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', 'b'], "found 'a' and 'b'")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--output'], "'--output' needs a folder")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--output', '--quiet'], "'--output' needs")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--threads'], "'--threads' needs a number")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--threads', '0'], "found '0'")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--threads', '-2'], "found '-2'")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--threads', '2.5'], "found '2.5'")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--threads', '99999999999'], "found '9999")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--quiet=yes'], 'takes no value')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--quiet', '--quiet'], 'given twice')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'check', 'a', '--overwrite'], "no option of 'check'")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'version', 'a'], 'takes no argument')
  end subroutine test_wrong

  subroutine test_suggestions(error)
    type(error_type), allocatable, intent(out) :: error

    call refused(error, [character(w) :: 'rnu', 'a.nml'], "did you mean 'run'?")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'templat'], "did you mean 'template'?")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'a.nml'], "did you mean 'run a.nml'?")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--ouput', 'b'], "did you mean '--output'?")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--frob'], 'known: --output, --threads, '// &
      & '--overwrite, --restart, --max-minutes, --quiet, --set, --ranks, --reproducible, '// &
      & '--help'//newline)
    if (allocated(error)) return
    call refused(error, [character(w) :: 'version', '--frob'], 'known: --help'//newline)
    if (allocated(error)) return
    call refused(error, [character(w) :: 'check', 'a', '--point=3'], "'--point'"//newline)
    if (allocated(error)) return
    call refused(error, [character(w) :: '--frob', 'run', 'a'], '--csv, --error, --time')
    if (allocated(error)) return
    call refused(error, [character(w) :: 'help', 'chek'], "did you mean 'check'?")
    if (allocated(error)) return
    call refused(error, [character(w) :: 'run', 'a', '--ouput', 'b'], 'see: perifort run --help')
  end subroutine test_suggestions

  !> Fail unless these arguments are refused with the right status and with these words.
  subroutine refused(error, arguments, words)
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in) :: arguments(:)
    character(*), intent(in) :: words
    type(command_line_type) :: line
    type(pd_error), allocatable :: fault

    call parse_command_line(arguments, line, fault)
    if (.not. allocated(fault)) then
      call test_failed(error, 'accepted, but should be told: '//words)
      return
    end if
    call check(error, fault%status, status_usage)
    if (allocated(error)) return
    call check(error, index(fault%message, words) > 0, words, 'said was: '//fault%message)
  end subroutine refused

end module test_command_line
