!> The texts of `--help`.
module pd_command_help
  use pd_base_text, only: join, newline
  implicit none (type, external)
  private
  public :: help_text

contains

  !> The help of a command; of the program for '' or `help`.
  pure function help_text(command) result(text)
    character(*), intent(in) :: command
    character(:), allocatable :: text
    integer, parameter :: w = 90
    character(*), parameter :: threads = &
      & '  --threads N     number of threads (default: OMP_NUM_THREADS or all; small scenes one)'
    character(w), parameter :: tables(4) = [character(w) :: &
      & '  --output DIR    folder of the tables (default: out/ and the file''s name)', threads, &
      & '  --overwrite     replace a study that is there', '  --quiet         print errors only']

    select case (command)
    case ('run')
      text = join([character(w) :: &
        & 'perifort run FILE [--output DIR] [--threads N] [--overwrite] [--quiet]', &
        & '                  [--restart [CHECKPOINT]] [--max-minutes M]', &
        & '', &
        & 'Compute the scene in FILE and write the results.', &
        & '', &
        & '  --output DIR    folder of the results (default: out/ and the name of the file)', &
        & threads, &
        & '  --overwrite     replace results that are there', &
        & '  --restart [CHECKPOINT]', &
        & '                  go on from the last checkpoint of this run, or from another; where', &
        & '                  there is none yet, start from the beginning', &
        & '  --max-minutes M stop in order after so many minutes, with a checkpoint (status 4)', &
        & '  --quiet         print errors only'], newline)
    case ('check')
      text = join([character(w) :: &
        & 'perifort check FILE [--threads N]', &
        & '', &
        & 'Read and check the scene in FILE and build its points and bonds, without running it:', &
        & 'prints points, bonds, memory, time step, what was chosen and why, and the time that a', &
        & 'run would take.', &
        & '', &
        & threads], newline)
    case ('limits')
      text = join([character(w) :: &
        & 'perifort limits FILE [--seconds S] [--threads N]', &
        & '', &
        & 'Measure how far the scene in FILE can be pushed: its largest stable time step from', &
        & 'the largest frequency of its body, beside equation 7.25; what rounding does to a run,', &
        & 'for displacements of any size, far from the origin, in nanometres and kilometres; and', &
        & 'what each integrator does to the energy. No results are written.', &
        & '', &
        & '  --seconds S     time for all runs together (default: 60)', &
        & threads], newline)
    case ('study')
      text = join([character(w) :: &
        & 'perifort study FILE [--output DIR] [--threads N] [--overwrite] [--quiet]', '', &
        & 'Run the scene in FILE with all the values that its groups &study name: error, time,', &
        & 'size and energy drift of each run, the Pareto front, observed orders of convergence.', &
        & 'Writes study.csv, whole after every run, and study.txt; ./pf plot draws them.', '', &
        & tables], newline)
    case ('choose')
      text = join([character(w) :: &
        & 'perifort choose FILE --error E [--time T] [options of study]', '', &
        & 'Run the study in FILE, extrapolate error and time, and print the cheapest settings', &
        & 'that meet an error; then run them and tell how far off the prediction was. Exit', &
        & 'status 1 if the error is missed.', '', &
        & '  --error E       the error to be met, in the norm and unit of the study', &
        & '  --time T        the longest that the chosen run may take [s]', &
        & tables], newline)
    case ('template')
      text = join([character(w) :: &
        & 'perifort template [NAME]', &
        & '', &
        & 'Print a commented scene to start from; with a wrong NAME the known ones are listed.', &
        & '', &
        & '  perifort template > my.nml'], newline)
    case ('reference')
      text = join([character(w) :: &
        & 'perifort reference [GROUP]', &
        & '', &
        & 'Print every group and key of a scene file, or those of one group: meaning, unit,', &
        & 'default.'], newline)
    case ('bench')
      text = join([character(w) :: &
        & 'perifort bench [--points N ...] [--dimension D ...] [--threads N,...] [--model MODEL]', &
        & '               [--family FAMILY] [--breaking WORD] [--precision WORD] [--surface]', &
        & '               [--seconds S] [--csv FILE]', &
        & '', &
        & 'Measure the speed of the force loops on standard bodies (cube, plate, bar) and print', &
        & 'it beside the bandwidth and the peak of this machine, in a minute or two.', &
        & '', &
        & '  --points N ...    points along an edge (default: 80 in 3D, 500 in 2D, 1000 in 1D)', &
        & '  --dimension D ... 1, 2, 3 or some of them (default: all)', &
        & '  --threads N,...   numbers of threads (default: 1 and all; bars: 1); 1 is always in', &
        & '  --model MODEL     state_based, bond_based or both (default)', &
        & '  --family FAMILY   lattice, list or both (default)', &
        & '  --breaking WORD   on: bonds can break; off; or both (default, for lists off)', &
        & '  --precision WORD  of bonds: double (default), mixed or both', &
        & '  --surface         with surface correction (default: without)', &
        & '  --seconds S       a repeat, of five or more, takes so long at least (default: 0.25)', &
        & '  --csv FILE        write the numbers to a file, too; one of that name is replaced'], &
        & newline)
    case ('version')
      text = join([character(w) :: &
        & 'perifort version', &
        & '', &
        & 'Print the version, the compiler with its flags, and the version of HDF5.'], newline)
    case default
      text = join([character(w) :: &
        & 'perifort: peridynamics, from a scene file to a picture', &
        & '', &
        & '  perifort run FILE            compute a scene', &
        & '  perifort check FILE          check a scene and tell what it costs', &
        & '  perifort limits FILE         measure its largest stable step, and more', &
        & '  perifort study FILE          vary keys of a scene: error against time', &
        & '  perifort choose FILE --error E   the cheapest settings that meet an error', &
        & '  perifort template [NAME]     print a commented scene to start from', &
        & '  perifort reference [GROUP]   print the groups and keys of a scene', &
        & '  perifort bench               measure the speed on this machine', &
        & '  perifort version             print version, compiler and HDF5', &
        & '  perifort help COMMAND        more on a command, as does COMMAND --help', &
        & '', &
        & 'Exit status: 0 done; 1 the input or the environment is at fault; 2 wrong command', &
        & 'line; 3 no valid answer (unstable or not converged); 4 interrupted.'], newline)
    end select
    text = text//newline
  end function help_text

end module pd_command_help
