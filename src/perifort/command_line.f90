!> What the user typed: one command, its file or name, and options.
module pd_command_line
  use pd_base_error, only: error_type, fail, internal_fault, status_usage
  use pd_base_kinds, only: wp
  use pd_base_shell, only: program_command, quoted
  use pd_base_text, only: join, nearest_name, newline, to_text
  use pd_scene_format_file, only: line_type
  use pd_scene_format_values, only: parse_real
  use pd_study_bench_options, only: bench_options_type, check_options
  implicit none (type, external)
  private
  public :: command_line_type, parse_command_line, read_command_line, command_names, &
    & restart_command

  integer, parameter :: word_length = 16
  character(word_length), parameter :: command_names(10) = [character(word_length) :: &
    & 'run', 'check', 'limits', 'study', 'choose', 'template', 'reference', 'bench', 'version', &
    & 'help']
  integer, parameter :: restart_option = 4  !! its place in `option_names`
  character(word_length), parameter :: option_names(22) = [character(word_length) :: &
    & '--output', '--threads', '--overwrite', '--restart', '--max-minutes', '--quiet', '--points', &
    & '--dimension', '--model', '--family', '--breaking', '--precision', '--surface', '--generic', &
    & '--seconds', &
    & '--csv', '--error', '--time', '--set', '--ranks', '--reproducible', '--help']

  !> A command line, understood and checked.
  type :: command_line_type
    character(:), allocatable :: program           !! how the user starts the program, quoted
    character(:), allocatable :: command           !! one of `command_names`, '' with bare `--help`
    character(:), allocatable :: argument          !! scene file, template or group; '' if not given
    character(:), allocatable :: output_directory  !! `--output`; '' = the default
    integer :: threads = 0                         !! `--threads`; 0 = not given
    logical :: overwrite = .false.                 !! `--overwrite`
    logical :: restart = .false.                   !! `--restart`
    character(:), allocatable :: checkpoint        !! its value; '' = the newest of the run
    real(wp) :: max_minutes = 0.0_wp               !! `--max-minutes`; 0 = no limit
    logical :: quiet = .false.                     !! `--quiet`
    integer :: ranks = 0                           !! `--ranks`; 0 = not given
    logical :: reproducible = .false.              !! `--reproducible`
    type(bench_options_type) :: bench              !! the options of `bench`
    real(wp) :: seconds = 60.0_wp                  !! `--seconds` of `limits`
    real(wp) :: error = 0.0_wp                     !! `--error` of `choose`; 0 = not given
    real(wp) :: time = 0.0_wp                      !! `--time` of `choose` [s]; 0 = not given
    logical :: help = .false.                      !! `--help`: only the text is wanted
    type(line_type), allocatable :: changes(:)     !! `--set`: `group%key=value`, in their order
    character(:), allocatable :: text              !! the command line as it was typed
  end type command_line_type

contains

  !> Understand the arguments of this program. Errors have the status of a wrong command line.
  subroutine read_command_line(line, error)
    type(command_line_type), intent(out) :: line
    type(error_type), allocatable, intent(out) :: error
    integer :: i, length, longest

    longest = 1
    do i = 1, command_argument_count()
      call get_command_argument(i, length=length)
      longest = max(longest, length)
    end do
    call read_words(longest, command_argument_count(), line, error)
  end subroutine read_command_line

  subroutine read_words(longest, count, line, error)
    integer, intent(in) :: longest, count
    type(command_line_type), intent(out) :: line
    type(error_type), allocatable, intent(out) :: error
    character(longest) :: arguments(count)
    character(:), allocatable :: typed
    integer :: i

    typed = 'perifort'
    do i = 1, count
      call get_command_argument(i, arguments(i))
      typed = typed//' '//quoted(trim(arguments(i)))
    end do
    call parse_command_line(arguments, line, error, program_command())
    line%text = typed
  end subroutine read_words

  !> Understand `arguments` (trailing blanks do not count). Commands and options are checked here,
  !> files and names are not. Errors have the status of a wrong command line.
  subroutine parse_command_line(arguments, line, error, program)
    character(*), intent(in) :: arguments(:)            !! without the program's name
    type(command_line_type), intent(out) :: line        !! what they mean
    type(error_type), allocatable, intent(out) :: error !! what is wrong, and how to get help
    character(*), intent(in), optional :: program       !! how the user starts the program
    character(:), allocatable :: word, name, value
    logical :: only_names, has_value, seen(size(option_names))
    integer :: i, at, equals, option

    line%program = 'perifort'
    if (present(program)) line%program = program
    line%command = ''
    line%argument = ''
    line%output_directory = ''
    line%checkpoint = ''
    line%text = ''
    allocate (line%changes(0))
    seen = .false.
    only_names = .false.
    i = 0
    do while (i < size(arguments))
      i = i + 1
      word = trim(arguments(i))
      if (word == '--' .and. .not. only_names) then
        only_names = .true.
      else if (index(word, '-') == 1 .and. len(word) > 1 .and. .not. only_names) then
        name = word
        value = ''
        equals = index(word, '=')
        has_value = equals > 0
        if (has_value) then
          name = word(:equals - 1)
          value = word(equals + 1:)
        end if
        if (name == '-h') name = '--help'
        if (name == '--version' .and. len(line%command) == 0) then
          line%command = 'version'
          cycle
        end if
        option = 0
        do at = 1, size(option_names)
          if (option_names(at) == name) option = at
        end do
        if (option == 0) then
          call unknown_option(line, name, error)
          return
        end if
        if (seen(option) .and. name /= '--set') then
          call usage(error, line, "'"//name//"' is given twice")
          return
        end if
        seen(option) = .true.

        if (takes_value(name) .and. .not. has_value) then
          i = i + 1
          if (i <= size(arguments)) value = trim(arguments(i))
          ! An option in the value's place means that the value was forgotten.
          if (i > size(arguments) .or. index(value, '--') == 1) value = ''
          do while (i < size(arguments) .and. takes_many(name, line%command))
            if (verify(trim(arguments(i + 1)), '0123456789,') > 0) exit
            i = i + 1
            value = value//','//trim(arguments(i))
          end do
        else if (has_value .and. .not. takes_value(name) .and. name /= '--restart') then
          call usage(error, line, "'"//name//"' takes no value, found '"//value//"'")
          return
        end if
        call set_option(line, name, value, error)
        if (allocated(error)) return
      else if (len(line%command) == 0) then
        call set_command(line, word, error)
        if (allocated(error)) return
      else if (len(line%argument) == 0) then
        line%argument = word
      else if (seen(restart_option) .and. len(line%checkpoint) == 0) then
        line%checkpoint = word
      else
        call usage(error, line, "'"//trim(line%command)//"' takes one argument, found '"// &
          & line%argument//"' and '"//word//"'")
        return
      end if
    end do

    call check_whole(line, seen, error)
  end subroutine parse_command_line

  !> The error of an unknown option. The known ones are those of the command, or all of them while
  !> no command has been given.
  subroutine unknown_option(line, name, error)
    type(command_line_type), intent(in) :: line
    character(*), intent(in) :: name
    type(error_type), allocatable, intent(out) :: error
    character(word_length), allocatable :: known(:)
    integer :: i

    known = option_names
    if (len(line%command) > 0) known = pack(option_names, &
      & [(belongs(trim(option_names(i)), line%command), i=1, size(option_names))])
    call usage(error, line, "unknown option '"//name//"'"//suggestion(name, known)//newline// &
      & '  known: '//join(known, ', '))
  end subroutine unknown_option

  !> Whatever can only be judged when all words are known.
  subroutine check_whole(line, seen, error)
    type(command_line_type), intent(inout) :: line
    logical, intent(in) :: seen(:)
    type(error_type), allocatable, intent(out) :: error
    type(error_type), allocatable :: fault
    integer :: i

    if (line%help) return
    if (len(line%command) == 0) then
      call usage(error, line, 'no command is given; known: '//join(command_names, ', '))
      return
    end if
    do i = 1, size(option_names)
      if (seen(i) .and. .not. belongs(trim(option_names(i)), line%command)) then
        call usage(error, line, "'"//trim(option_names(i))//"' is no option of '"// &
          & line%command//"'")
        return
      end if
    end do
    select case (line%command)
    case ('run', 'check', 'limits', 'study', 'choose')
      if (line%restart .and. line%overwrite) then
        call usage(error, line, "'--restart' continues a run and '--overwrite' starts it "// &
          & 'anew: give one of them')
      else if (len(line%argument) == 0) then
        call usage(error, line, "'"//line%command//"' needs the scene file")
      else if (allocated(line%bench%threads)) then
        if (size(line%bench%threads) > 1) call usage(error, line, "'"//line%command// &
          & "' takes one number of '--threads', found "//to_text(size(line%bench%threads)))
      end if
      if (allocated(error)) return
      if (.not. (line%seconds >= 1.0_wp .and. line%seconds <= 86400.0_wp)) call usage(error, line, &
        & "'--seconds' must be between 1 and 86400, found "//to_text(line%seconds))
      if (allocated(error)) return
      if (line%command == 'choose' .and. line%error <= 0.0_wp) &
        & call usage(error, line, "'choose' needs the error to be met, as in --error 1e-3")
    case ('bench', 'version')
      if (len(line%argument) > 0) call usage(error, line, "'"//line%command// &
        & "' takes no argument, found '"//line%argument//"'")
      if (allocated(error)) return
      call check_options(line%bench, fault)
      if (allocated(fault)) call usage(error, line, fault%message)
    case ('help')
      line%help = .true.
      line%command = ''
      if (len(line%argument) > 0) call set_command(line, line%argument, error)
    case ('template', 'reference')
      continue  ! an argument or none; their names are checked where they are looked up
    case default
      call internal_fault('check_whole does not know a command of command_names')
    end select
  end subroutine check_whole

  subroutine set_command(line, word, error)
    type(command_line_type), intent(inout) :: line
    character(*), intent(in) :: word
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: hint

    if (any(command_names == word)) then
      line%command = word
      return
    end if
    hint = suggestion(word, command_names)
    if (index(word, '.nml') > 0) hint = "; did you mean 'run "//word//"'?"
    call usage(error, line, "unknown command '"//word//"'"//hint//newline//'  known: '// &
      & join(command_names, ', '))
  end subroutine set_command

  subroutine set_option(line, name, value, error)
    type(command_line_type), intent(inout) :: line
    character(*), intent(in) :: name, value
    type(error_type), allocatable, intent(out) :: error
    integer, allocatable :: numbers(:)
    integer :: status

    select case (name)
    case ('--output')
      line%output_directory = value
      if (len(value) > 0) return
      call usage(error, line, "'--output' needs a folder, as in --output results")
    case ('--threads')
      call read_numbers(value, line%bench%threads)
      if (len(value) == 0) then
        call usage(error, line, "'--threads' needs a number, as in --threads 4")
      else if (size(line%bench%threads) == 0 .or. any(line%bench%threads > 999999)) then
        call usage(error, line, "'--threads' needs a whole number from 1 to 999999, found '"// &
          & value//"'")
      else
        line%threads = line%bench%threads(1)
      end if
    case ('--points')
      call read_numbers(value, line%bench%points)
      if (size(line%bench%points) == 0) call usage(error, line, "'--points' needs numbers of "// &
        & "points along an edge, as in --points 40 80, found '"//value//"'")
    case ('--dimension')
      call read_numbers(value, line%bench%dimensions)
      if (size(line%bench%dimensions) == 0) call usage(error, line, &
        & "'--dimension' needs 1, 2 or 3, or some of them, found '"//value//"'")
    case ('--model', '--family', '--breaking', '--precision')
      if (name == '--model') line%bench%model = value
      if (name == '--family') line%bench%family = value
      if (name == '--breaking') line%bench%breaking = value
      if (name == '--precision') line%bench%precision = value
      if (len(value) == 0) call usage(error, line, "'"//name//"' needs a word")
    case ('--surface')
      line%bench%surface = .true.
    case ('--generic')
      line%bench%generic = .true.
    case ('--seconds')
      status = 1
      if (len(value) > 0 .and. verify(value, '0123456789.') == 0) &
        & read (value, *, iostat=status) line%bench%seconds
      line%seconds = line%bench%seconds
      if (status /= 0) call usage(error, line, "'--seconds' needs a number, as in "// &
        & "--seconds 0.5, found '"//value//"'")
    case ('--csv')
      line%bench%csv = value
      if (len(value) == 0) call usage(error, line, "'--csv' needs a file, as in --csv bench.csv")
    case ('--error', '--time')
      if (name == '--error') call read_positive(value, line%error, status)
      if (name == '--time') call read_positive(value, line%time, status)
      if (status /= 0) call usage(error, line, "'"//name//"' needs a number above 0, as in "// &
        & trim(merge('--error 1e-3', '--time 60   ', name == '--error'))//", found '"//value//"'")
    case ('--set')
      call add_change(line, value)
      if (index(value, '=') > 1 .and. index(value, '=') < len(value)) return
      call usage(error, line, "'--set' needs a key and its value, as in --set horizon%ratio=4, "// &
        & "found '"//value//"'")
    case ('--overwrite')
      line%overwrite = .true.
    case ('--restart')
      line%restart = .true.
      line%checkpoint = value
    case ('--max-minutes')
      call read_positive(value, line%max_minutes, status)
      if (status /= 0) call usage(error, line, &
        & "'--max-minutes' needs a number above 0, as in --max-minutes 50, found '"//value//"'")
    case ('--ranks')
      call read_numbers(value, numbers)
      if (size(numbers) == 1) line%ranks = numbers(1)
      if (line%ranks == 0) call usage(error, line, &
        & "'--ranks' needs a whole number, as in --ranks 4, found '"//value//"'")
    case ('--reproducible')
      line%reproducible = .true.
    case ('--quiet')
      line%quiet = .true.
    case ('--help')
      line%help = .true.
    case default
      call internal_fault('set_option does not know an option of option_names')
    end select
  end subroutine set_option

  !> One more change of a key.
  subroutine add_change(line, text)
    type(command_line_type), intent(inout) :: line
    character(*), intent(in) :: text     !! `group%key=value`
    type(line_type), allocatable :: longer(:)
    integer :: i

    allocate (longer(size(line%changes) + 1))
    do i = 1, size(line%changes)
      call move_alloc(line%changes(i)%text, longer(i)%text)
    end do
    longer(size(longer))%text = text
    call move_alloc(longer, line%changes)
  end subroutine add_change

  !> A number above 0; `status` is not 0 if there is none.
  subroutine read_positive(text, value, status)
    character(*), intent(in) :: text
    real(wp), intent(out) :: value
    integer, intent(out) :: status
    character(:), allocatable :: note

    call parse_real(text, value, note)
    status = merge(0, 1, len(note) == 0 .and. value > 0.0_wp)
  end subroutine read_positive

  !> Whole numbers above 0, parted by commas; none if there is anything else.
  subroutine read_numbers(text, numbers)
    character(*), intent(in) :: text
    integer, allocatable, intent(out) :: numbers(:)
    integer, parameter :: longest = 9
    integer :: at, next, number, status

    allocate (numbers(0))
    at = 1
    do while (at <= len(text) + 1)
      next = index(text(at:)//',', ',')
      status = 1
      if (next > 1 .and. next <= longest + 1) then
        if (verify(text(at:at + next - 2), '0123456789') == 0) &
          & read (text(at:at + next - 2), *, iostat=status) number
      end if
      if (status == 0) then
        if (number < 1) status = 1
      end if
      if (status /= 0) then
        numbers = numbers(:0)
        return
      end if
      numbers = [numbers, number]
      at = at + next
    end do
  end subroutine read_numbers

  pure logical function takes_value(name)
    character(*), intent(in) :: name
    takes_value = all(name /= [character(word_length) :: '--overwrite', '--restart', '--quiet', &
      & '--surface', '--generic', '--reproducible', '--help'])
  end function takes_value

  !> Whether several words may follow. Where a file comes next, one must do.
  pure logical function takes_many(name, command)
    character(*), intent(in) :: name, command
    takes_many = name == '--points' .or. name == '--dimension' .or. &
      & (name == '--threads' .and. command == 'bench')
  end function takes_many

  pure logical function belongs(option, command)
    character(*), intent(in) :: option, command
    select case (option)
    case ('--help')
      belongs = .true.
    case ('--threads')
      belongs = any(command == [character(6) :: 'run', 'check', 'limits', 'bench', 'study', &
        & 'choose'])
    case ('--set')
      belongs = any(command == [character(6) :: 'run', 'check', 'limits', 'study', 'choose'])
    case ('--seconds')
      belongs = command == 'limits' .or. command == 'bench'
    case ('--error', '--time')
      belongs = command == 'choose'
    case ('--points', '--dimension', '--model', '--family', '--breaking', '--precision', &
      & '--surface', '--generic', '--csv')
      belongs = command == 'bench'
    case ('--restart', '--max-minutes', '--reproducible')
      belongs = command == 'run'
    case ('--ranks')
      belongs = command == 'run' .or. command == 'check'
    case ('--output', '--overwrite', '--quiet')
      belongs = any(command == [character(6) :: 'run', 'study', 'choose'])
    case default
      call internal_fault('belongs does not know an option of option_names')
    end select
  end function belongs

  !> An error of the command line, with the way to the right help.
  subroutine usage(error, line, message)
    type(error_type), allocatable, intent(out) :: error
    type(command_line_type), intent(in) :: line
    character(*), intent(in) :: message
    character(:), allocatable :: hint
    hint = line%program//' --help'
    if (len(line%command) > 0 .and. line%command /= 'help') &
      & hint = line%program//' '//line%command//' --help'
    call fail(error, message//newline//'  see: '//hint, status_usage)
  end subroutine usage

  pure function suggestion(word, known) result(text)
    character(*), intent(in) :: word, known(:)
    character(:), allocatable :: text
    text = nearest_name(word, known)
    if (len(text) > 0) text = "; did you mean '"//text//"'?"
  end function suggestion

  !> The command that continues a run, as it has to be typed: the same as before but for
  !> `--overwrite` and `--restart`.
  pure function restart_command(line) result(text)
    type(command_line_type), intent(in) :: line   !! of the command `run`
    character(:), allocatable :: text
    integer :: i

    text = line%program//' run '
    if (index(line%argument, '-') == 1) text = text//'./'  ! a file's name, not an option
    text = text//quoted(line%argument)
    if (allocated(line%changes)) then
      do i = 1, size(line%changes)
        text = text//' --set '//quoted(line%changes(i)%text)
      end do
    end if
    if (len(line%output_directory) > 0) text = text//' --output '//quoted(line%output_directory)
    if (line%threads > 0) text = text//' --threads '//to_text(line%threads)
    if (line%max_minutes > 0.0_wp) text = text//' --max-minutes '//to_text(line%max_minutes)
    if (line%ranks > 0) text = text//' --ranks '//to_text(line%ranks)
    if (line%reproducible) text = text//' --reproducible'
    if (line%quiet) text = text//' --quiet'
    text = text//' --restart'
  end function restart_command

end module pd_command_line
