!> The texts of `--help`.
module pd_command_help
  use pd_base_text, only: join, newline
  use pd_base_error, only: internal_fault
  implicit none (type, external)
  private
  public :: help_text

contains

  !> The help of a command; of the program for '' or `help`. `./pf` prints these texts from
  !> doc/printed where nothing is built; a test keeps them equal.
  pure function help_text(command) result(text)
    character(*), intent(in) :: command             !! one of `command_names`, or ''
    character(:), allocatable :: text
    integer, parameter :: w = 90
    character(*), parameter :: threads = &
      & '  --threads N     number of threads (default: OMP_NUM_THREADS or all; small scenes: 1)'
    character(*), parameter :: set = &
      & '  --set KEY=VALUE change a key of the scene, as in horizon%ratio=4; may be repeated'
    character(w), parameter :: tables(5) = [character(w) :: &
      & '  --output DIR    folder of the tables (default: out/ and the file''s name)', set, &
      & threads, &
      & '  --overwrite     replace an existing study', '  --quiet         print errors only']

    select case (command)
    case ('run')
      text = join([character(w) :: &
        & 'perifort run FILE [--output DIR] [--threads N] [--overwrite] [--quiet]', &
        & '                  [--restart [CHECKPOINT]] [--max-minutes M] [--set KEY=VALUE] ...', &
        & '                  [--ranks N] [--reproducible]', &
        & '', &
        & 'Compute the scene in FILE and write the results.', &
        & '', &
        & '  --output DIR    folder of the results (default: out/ and the name of the file)', &
        & set, threads, &
        & '  --overwrite     replace existing results', &
        & '  --restart [CHECKPOINT]', &
        & '                  continue from the last checkpoint of this run, or from CHECKPOINT;', &
        & '                  without any checkpoint start from the beginning', &
        & '  --max-minutes M stop after M minutes with a checkpoint (status 4)', &
        & '  --ranks N       number of processes; ./pf starts them, elsewhere', &
        & '                  mpirun -n N perifort-mpi run FILE does', &
        & '  --reproducible  all results have the same bits on any number of ranks', &
        & '  --quiet         print errors only'], newline)
    case ('check')
      text = join([character(w) :: &
        & 'perifort check FILE [--threads N] [--ranks N] [--set KEY=VALUE] ...', &
        & '', &
        & 'Read and check the scene in FILE and build its points and bonds, without running it.', &
        & 'Prints points, bonds, memory, time step, the algorithms that were chosen and why, and', &
        & 'the predicted time of a run.', &
        & '', &
        & '  --ranks N       also print how N ranks would share the points', &
        & set, threads], newline)
    case ('limits')
      text = join([character(w) :: &
        & 'perifort limits FILE [--seconds S] [--threads N] [--set KEY=VALUE] ...', &
        & '', &
        & 'Measure the numerical limits of the scene in FILE: the largest stable time step from', &
        & 'the largest frequency of its body, beside equation 7.25; the rounding error of a run,', &
        & 'for displacements of any size, far from the origin, in nanometres and kilometres; and', &
        & 'the energy drift of each integrator. No results are written.', &
        & '', &
        & '  --seconds S     time for all runs together [s] (default: 60)', &
        & set, threads], newline)
    case ('study')
      text = join([character(w) :: &
        & 'perifort study FILE [--output DIR] [--threads N] [--overwrite] [--quiet]', &
        & '                    [--set KEY=VALUE] ...', '', &
        & 'Run the scene in FILE with all values in its groups &study. Prints for each run the', &
        & 'measured value, its error, time, size and energy drift (the largest error of the', &
        & 'energy balance over the largest energy); then the Pareto front and the observed', &
        & 'orders of convergence. All scenes are checked and set up before the first run. Writes', &
        & 'study.csv, complete after every run, and study.txt; ./pf plot draws them.', '', &
        & tables], newline)
    case ('choose')
      text = join([character(w) :: &
        & 'perifort choose FILE --error E [--time T] [options of study]', '', &
        & 'Run the study in FILE, fit error and time, and print the fastest settings whose', &
        & 'predicted error is at most E. Then run them and compare the measured error and time', &
        & 'with the prediction. Runs that the fit does not use are listed with the reason. Exit', &
        & 'status 1 if the measured error is above E.', '', &
        & '  --error E       largest error allowed, in the norm and unit of the study', &
        & '  --time T        longest time allowed for the chosen run [s]', &
        & tables], newline)
    case ('template')
      text = join([character(w) :: &
        & 'perifort template [NAME]', &
        & '', &
        & 'Print a scene with comments as a starting point. NAME: bar (default), plate, block,', &
        & 'crack, relaxation.', &
        & '', &
        & '  perifort template plate > my.nml'], newline)
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
        & '               [--generic] [--seconds S] [--csv FILE]', &
        & '', &
        & 'Measure the speed of the force loops on standard bodies (cube, plate, bar), and', &
        & 'compare it with the memory bandwidth and the peak performance of this machine.', &
        & 'Takes one or two minutes.', &
        & '', &
        & '  --points N ...    points along an edge (default: 80 in 3D, 500 in 2D, 1000 in 1D)', &
        & '  --dimension D ... 1, 2, 3 or some of them (default: all)', &
        & '  --threads N,...   numbers of threads (default: 1 and all; bars: 1); always with 1', &
        & '  --model MODEL     state_based, bond_based or both (default)', &
        & '  --family FAMILY   lattice, list or both (default)', &
        & '  --breaking WORD   on: bonds can break; off; or both (default, for lists off)', &
        & '  --precision WORD  of bonds: double (default), mixed or both', &
        & '  --surface         with surface correction (default: without)', &
        & '  --generic         the laws on the generic pass, which computes any law', &
        & '  --seconds S       least time of each of five or more repeats [s] (default: 0.25)', &
        & '  --csv FILE        also write the numbers to FILE; an existing file is replaced'], &
        & newline)
    case ('version')
      text = join([character(w) :: &
        & 'perifort version', &
        & '', &
        & 'Print the version, the compiler with its flags, and the version of HDF5.'], newline)
    case ('', 'help')
      text = join([character(w) :: &
        & 'perifort: peridynamics, from a scene file to a picture', &
        & '', &
        & '  perifort run FILE            compute a scene', &
        & '  perifort check FILE          check a scene and predict its cost', &
        & '  perifort limits FILE         measure its stable step, rounding, energy drift', &
        & '  perifort study FILE          vary keys of a scene: error against time', &
        & '  perifort choose FILE --error E   the fastest settings with an error of at most E', &
        & '  perifort template [NAME]     print a scene with comments as a starting point', &
        & '  perifort reference [GROUP]   print the groups and keys of a scene', &
        & '  perifort bench               measure the speed on this machine', &
        & '  perifort version             print version, compiler and HDF5', &
        & '  perifort help COMMAND        help on a command, as COMMAND --help', &
        & '', &
        & 'Exit status: 0 done; 1 invalid input, or an error of the environment (files,', &
        & 'memory), or a target missed; 2 wrong command line; 3 no valid answer (unstable or not', &
        & 'converged); 4 interrupted, with a checkpoint.'], newline)
    case default
      call internal_fault('help_text does not know a command of command_names')
    end select
    text = text//newline
  end function help_text

end module pd_command_help
