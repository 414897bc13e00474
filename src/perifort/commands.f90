!> The commands of the program: each a few lines that call what does the work.
module pd_commands
  use, intrinsic :: iso_fortran_env, only: output_unit
  use omp_lib, only: omp_set_num_threads
  use pd_base_error, only: error_type, fail, internal_fault, status_usage
  use pd_base_text, only: newline, to_text
  use pd_base_threads, only: default_threads
  use pd_base_version, only: compiler_flags, compiler_name, program_version
  use pd_command_help, only: help_text
  use pd_command_line, only: command_line_type, restart_command
  use pd_comm_world, only: begin_world, world_type
  use pd_driver, only: run_scene
  use pd_output_fields_table, only: all_fields, field_table_type
  use pd_output_report_begin, only: run_options_type
  use pd_output_results_hdf5, only: hdf5_version
  use pd_preview, only: preview_scene
  use pd_scene_content_read, only: read_scene
  use pd_scene_content_reference, only: write_reference
  use pd_scene_content_template, only: write_template
  use pd_scene_content_types, only: name_length, scene_type
  use pd_study_bench_bench, only: run_bench
  use pd_study_trade_choose, only: run_choose
  use pd_study_limits_limits, only: run_limits
  use pd_study_trade_study, only: run_study
  implicit none (type, external)
  private
  public :: execute

contains

  !> Do what the command line says. Answers go to standard output; `error` tells what went wrong and
  !> with which exit status.
  subroutine execute(line, error)
    type(command_line_type), intent(in) :: line
    type(error_type), allocatable, intent(out) :: error
    type(run_options_type) :: options
    type(scene_type) :: scene
    type(field_table_type) :: fields
    character(name_length), allocatable :: names(:)

    if (line%help) then
      write (output_unit, '(a)', advance='no') help_text(line%command)
      return
    end if

    call omp_set_num_threads(default_threads())
    fields = all_fields()
    names = fields%names()
    select case (line%command)
    case ('run', 'check', 'limits', 'study', 'choose')
      call check_ranks(line, error)
      if (allocated(error)) return
      options%ranks = line%ranks
      options%reproducible = line%reproducible
      options%output_directory = line%output_directory
      options%command = line%text
      options%threads = line%threads
      options%overwrite = line%overwrite
      options%quiet = line%quiet
      options%restart = line%restart
      options%checkpoint = line%checkpoint
      options%max_minutes = line%max_minutes
      options%restart_command = restart_command(line)
      if (line%command == 'study') then
        call run_study(line%argument, options, error, line%changes)
        return
      else if (line%command == 'choose') then
        call run_choose(line%argument, options, line%error, line%time, error, line%changes)
        return
      end if
      call read_scene(line%argument, scene, error, line%changes)
      if (allocated(error)) return
      select case (line%command)
      case ('run')
        call run_scene(scene, options, error)
      case ('check')
        call preview_scene(scene, options, error)
      case ('limits')
        call run_limits(scene, options, line%seconds, error)
      case default
        call internal_fault('execute does not know a command that reads a scene')
      end select
    case ('template')
      call write_template(output_unit, line%argument, error, names)
    case ('reference')
      call write_reference(output_unit, line%argument, error, names)
    case ('bench')
      call run_bench(line%bench, error)
    case ('version')
      call write_version()
    case default
      call internal_fault('execute does not know a command of command_names')
    end select
  end subroutine execute

  !> An error if there are not as many ranks as asked for, or if the command is for one rank.
  subroutine check_ranks(line, error)
    type(command_line_type), intent(in) :: line
    type(error_type), allocatable, intent(out) :: error
    type(world_type) :: world

    call begin_world(world)
    if (line%command /= 'run') then
      if (world%ranks > 1) call fail(error, "'"//line%command//"' runs on one rank, found "// &
        & to_text(world%ranks), status_usage)
    else if (line%ranks > 0 .and. line%ranks /= world%ranks) then
      call fail(error, "'--ranks "//to_text(line%ranks)//"' needs so many processes, found "// &
        & to_text(world%ranks)//newline//'  start them by ./pf run FILE --ranks '// &
        & to_text(line%ranks)//', or by mpirun -n '//to_text(line%ranks)// &
        & ' perifort-mpi run FILE', &
        & status_usage)
    end if
  end subroutine check_ranks

  !> Version, compiler with flags, HDF5.
  subroutine write_version()
    write (output_unit, '(2a)') 'perifort ', program_version
    write (output_unit, '(2a)') 'compiler  ', compiler_name()
    write (output_unit, '(2a)') 'flags     ', compiler_flags()
    write (output_unit, '(2a)') 'HDF5      ', hdf5_version()
  end subroutine write_version

end module pd_commands
