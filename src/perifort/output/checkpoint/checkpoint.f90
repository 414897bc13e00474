!> Checkpoints of a run: their contents, their intervals, and how they are written, so that there is
!> a whole one at any moment.
!>
!> The newest is `STEM.checkpoint`, the one before it `STEM.checkpoint.old`. A new one is written
!> beside them, brought to the disk, and then takes its name in one step; what it counts on in the
!> results is brought to the disk before.
module pd_output_checkpoint_checkpoint
  use pd_base_archive, only: archive_type
  use pd_base_clock, only: wall_time
  use pd_base_warnings, only: warnings_type
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i8
  use pd_base_reduce, only: any_of_ranks
  use pd_base_text, only: to_text
  use pd_base_version, only: compiler_flags, compiler_name, program_version
  use pd_motion_keep, only: keep_system
  use pd_motion_system, only: system_type
  use pd_output_checkpoint_file, only: meter_type, reader_type, writer_type
  use pd_output_measures_measure, only: measure_list_type
  use pd_output_results_files, only: file_exists, in_directory, remove_file, rename_file, sync_path
  use pd_output_results_types, only: kept_type
  implicit none (type, external)
  private
  public :: about_type, checkpoint_type, new_about, keep_about, open_about, checkpoint_path, &
    & older_path, remove_checkpoints, checkpoint_bytes, stem_of_rank, stem_of_part

  !> Data of a checkpoint besides the system.
  type :: about_type
    character(:), allocatable :: version, compiler, flags  !! of the program that wrote it
    type(kept_type) :: kept             !! of the results, with the resolved scene
    integer(i8) :: start = 0_i8         !! checksum of the points and the initial state of the rank
    integer :: ranks = 1                !! that wrote the set of which it is one
    integer(i8) :: points = 0_i8        !! checksum of the points and the initial state of all ranks
    integer :: step = 0                 !! complete steps (iterations)
    integer :: steps = 0                !! of the whole run (load steps)
    real(wp) :: time = 0.0_wp           !! [s]
    real(wp) :: dt = 0.0_wp             !! time step [s]
    logical :: finished = .false.       !! the run has come to its end
    real(wp) :: supply = 0.0_wp         !! energy at the first row [J]
    real(wp) :: kinetic = 0.0_wp, strain = 0.0_wp  !! energies of the last row [J]
    type(warnings_type) :: warnings     !! so far
  end type about_type

  !> The checkpoints of a run in progress.
  type :: checkpoint_type
    character(:), allocatable :: path   !! of the newest
    integer :: every = 0                !! steps (iterations) between them; 0: not by steps
    real(wp) :: minutes = 0.0_wp        !! wall time between them; 0: not by time
    logical :: keep_newest = .true.     !! the newest is whole and becomes the older one
    integer :: written = 0
    integer :: last_step = 0            !! step of the last one
    real(wp) :: last = 0.0_wp           !! wall time of the last one, or of the start [s]
    logical :: in_files = .true.        !! there is a folder to write to
    character(:), allocatable :: directory, stem  !! folder and name of the results, of all ranks
    logical :: removes = .false.        !! this rank removes what other numbers of ranks have left
    integer :: sets = 0                 !! complete sets written by this run
  contains
    procedure :: start
    procedure :: is_due
    procedure :: keeps_end
    procedure :: write => write_checkpoint
  end type checkpoint_type

contains

  !> What a checkpoint says of this program and this run, before its first step.
  function new_about(scene_text, start, steps, dt, ranks, points) result(about)
    character(*), intent(in) :: scene_text  !! the resolved scene
    integer(i8), intent(in) :: start        !! checksum of the points and the initial state
    integer, intent(in) :: steps            !! of the whole run; in a relaxation load steps
    real(wp), intent(in) :: dt              !! time step [s]; 0 in a relaxation
    integer, intent(in), optional :: ranks  !! of the run; 1 if absent
    integer(i8), intent(in), optional :: points  !! checksum of all ranks' points; 0 if absent
    type(about_type) :: about

    about%version = program_version
    about%compiler = compiler_name()
    about%flags = compiler_flags()
    about%kept%scene_text = scene_text
    about%start = start
    about%steps = steps
    about%dt = dt
    if (present(ranks)) about%ranks = ranks
    if (present(points)) about%points = points
  end function new_about

  !> Open a checkpoint and read its description. An error if it cannot be read or is damaged.
  subroutine open_about(path, reader, about, error, verified)
    character(*), intent(in) :: path            !! of the checkpoint
    type(reader_type), intent(out) :: reader    !! open, behind the description; closed after an
                                                !! error
    type(about_type), intent(inout) :: about    !! the description on return
    type(error_type), allocatable, intent(out) :: error
    logical, intent(in), optional :: verified   !! its checksum has been found right already;
                                                !! absent: it has not

    call reader%open(path, error, verified)
    if (allocated(error)) return
    call keep_about(reader, about)
    if (.not. allocated(reader%error)) return
    call move_alloc(reader%error, error)
    call reader%close()
  end subroutine open_about

  !> Keep all of it, or put it back.
  subroutine keep_about(archive, about)
    class(archive_type), intent(inout) :: archive  !! to write to or to read from; its `error` is
                                                   !! set if that fails
    type(about_type), intent(inout) :: about       !! in reading that of the archive on return

    call archive%keep('version', about%version)
    call archive%keep('compiler', about%compiler)
    call archive%keep('flags', about%flags)
    call archive%keep('scene', about%kept%scene_text)
    call archive%keep('ranks', about%ranks)
    call archive%keep('checksum of the points', about%points)
    call archive%keep('checksum of the start', about%start)
    call archive%keep('steps done', about%step)
    call archive%keep('steps of the run', about%steps)
    call archive%keep('time', about%time)
    call archive%keep('step size', about%dt)
    call archive%keep('finished', about%finished)
    call archive%keep('supply', about%supply)
    call archive%keep('kinetic energy', about%kinetic)
    call archive%keep('strain energy', about%strain)
    call about%warnings%keep(archive)
    call archive%keep('history', about%kept%rows)
    call archive%keep('times of outputs', about%kept%times)
  end subroutine keep_about

  !> The newest checkpoint of a run.
  pure function checkpoint_path(directory, stem) result(path)
    character(*), intent(in) :: directory  !! folder of the results; '' for the current one
    character(*), intent(in) :: stem       !! name of the results' files without their endings
    character(:), allocatable :: path
    path = in_directory(directory, trim(stem)//'.checkpoint')
  end function checkpoint_path

  !> The one before it.
  pure function older_path(newest) result(path)
    character(*), intent(in) :: newest  !! path of the newest checkpoint
    character(:), allocatable :: path
    path = newest//'.old'
  end function older_path

  !> What the names of a rank's checkpoints begin with where there are several ranks.
  pure function stem_of_rank(stem, rank) result(of_rank)
    character(*), intent(in) :: stem  !! name of the results' files without their endings
    integer, intent(in) :: rank       !! from 0
    character(:), allocatable :: of_rank
    of_rank = trim(stem)//'.rank-'//to_text(rank)
  end function stem_of_rank

  !> What the names of one file of a set begin with.
  pure function stem_of_part(stem, rank, ranks) result(of_part)
    character(*), intent(in) :: stem  !! name of the results' files without their endings
    integer, intent(in) :: rank       !! that wrote it, from 0
    integer, intent(in) :: ranks      !! how many there were
    character(:), allocatable :: of_part
    of_part = trim(stem)
    if (ranks > 1) of_part = stem_of_rank(stem, rank)
  end function stem_of_part

  !> Remove the checkpoints of an earlier run, on whatever number of ranks, or those that a run on
  !> another number of ranks than `but_of` has left.
  subroutine remove_checkpoints(directory, stem, but_of)
    character(*), intent(in) :: directory  !! folder of the results; '' for the current one
    character(*), intent(in) :: stem       !! name of the results' files without their endings
    integer, intent(in), optional :: but_of  !! number of ranks whose files stay; absent: none stay
    character(:), allocatable :: newest
    integer, parameter :: longest_gap = 16  !! ranks without a file, behind which none is sought
    integer :: rank, but, gap

    but = 0
    if (present(but_of)) but = but_of
    if (but /= 1) call remove_all_of(checkpoint_path(directory, stem))
    rank = merge(but, 0, but > 1)
    gap = 0
    do while (gap < longest_gap)
      newest = checkpoint_path(directory, stem_of_rank(stem, rank))
      gap = gap + 1
      if (file_exists(newest) .or. file_exists(older_path(newest))) gap = 0
      if (gap == 0) call remove_all_of(newest)
      rank = rank + 1
    end do

  contains

    !> The newest one, that before it, and one that is just written.
    subroutine remove_all_of(path)
      character(*), intent(in) :: path
      call remove_file(path//'.part')
      call remove_file(older_path(path))
      call remove_file(path)
    end subroutine remove_all_of
  end subroutine remove_checkpoints

  !> Bytes of a checkpoint.
  integer(i8) function checkpoint_bytes(about, system, measures) result(bytes)
    type(about_type), intent(inout) :: about    !! as it is to be written; unchanged
    type(system_type), intent(inout) :: system  !! as it is to be written; unchanged
    type(measure_list_type), intent(inout) :: measures  !! of the history; unchanged
    type(meter_type) :: meter

    call keep_about(meter, about)
    call keep_system(meter, system)
    call measures%keep(meter)
    bytes = meter%bytes
  end function checkpoint_bytes

  !> Begin: the clock runs from here. With the path '' none is ever due.
  subroutine start(self, directory, stem, path, every, minutes, resumed, keep_newest, removes)
    class(checkpoint_type), intent(inout) :: self  !! nothing written yet, or as of a run that goes
                                                   !! on
    character(*), intent(in) :: directory          !! folder of the results
    character(*), intent(in) :: stem               !! their name, without the rank
    character(*), intent(in) :: path               !! of the newest checkpoint of this rank
    integer, intent(in) :: every  !! steps (in a relaxation iterations) between two; 0: not by steps
    real(wp), intent(in) :: minutes                !! wall time between two; 0: not by time [min]
    logical, intent(in) :: resumed      !! the run has checkpoints from before
    logical, intent(in) :: keep_newest  !! the newest of them is whole
    logical, intent(in) :: removes      !! whether this rank removes files of other numbers of ranks

    self%directory = directory
    self%stem = stem
    self%removes = removes
    self%path = path
    self%in_files = path /= ''
    self%every = merge(every, 0, self%in_files)
    self%minutes = merge(minutes, 0.0_wp, self%in_files)
    self%keep_newest = keep_newest
    self%written = merge(1, 0, resumed)
    self%last = wall_time()
  end subroutine start

  !> Whether the end of a run is to be kept, so that it can be prolonged: if it has had checkpoints,
  !> or was to have some by steps.
  pure logical function keeps_end(self)
    class(checkpoint_type), intent(in) :: self  !! the checkpoints of the run
    keeps_end = self%every > 0 .or. self%written > 0
  end function keeps_end

  !> Whether a checkpoint is due after so many steps.
  logical function is_due(self, step)
    class(checkpoint_type), intent(in) :: self  !! the checkpoints of the run
    integer, intent(in) :: step                 !! complete steps (in a relaxation iterations)

    is_due = .false.
    ! the instants after a load step has settled have the number of its last iteration
    if (self%every > 0) is_due = step/self%every > self%last_step/self%every
    if (.not. is_due .and. self%minutes > 0.0_wp) &
      & is_due = wall_time() - self%last >= 60*self%minutes
  end function is_due

  !> Write the next one. An error if it cannot be written or brought to the disk on some rank; those
  !> before it are then as they were on all. All ranks must call it together.
  !>
  !> When two sets of this run are complete, those of other numbers of ranks are removed: there are
  !> two to go on from at any moment.
  subroutine write_checkpoint(self, about, system, measures, error)
    class(checkpoint_type), intent(inout) :: self  !! the checkpoints of the run, with one more on
                                                   !! return
    type(about_type), intent(inout) :: about       !! what is kept beside the system; unchanged
    type(system_type), intent(inout) :: system     !! what is to be kept; unchanged
    type(measure_list_type), intent(inout) :: measures  !! of the history; unchanged
    type(error_type), allocatable, intent(inout) :: error
      !! one that is set before: this rank has nothing to write
    type(error_type), allocatable :: ignored
    type(writer_type) :: writer
    character(:), allocatable :: part

    part = self%path//'.part'
    self%last = wall_time()
    self%last_step = about%step
    if (.not. allocated(error)) then
      call writer%create(part, checkpoint_bytes(about, system, measures))
      call keep_about(writer, about)
      call keep_system(writer, system)
      call measures%keep(writer)
      call writer%finish(error)
    end if
    ! a set of which some rank has none is of no use
    call agree_on(error)
    if (allocated(error)) then
      call remove_file(part)
      return
    end if
    if (self%keep_newest .and. file_exists(self%path)) &
      & call rename_file(self%path, older_path(self%path), error)
    if (.not. allocated(error)) call rename_file(part, self%path, error)
    if (allocated(error)) then
      call remove_file(part)
    else
      ! some systems cannot bring a folder to the disk; the names are in place none the less
      call sync_path(folder_of(self%path), ignored)
      self%keep_newest = .true.
    end if
    call agree_on(error)
    self%last = wall_time()
    if (allocated(error)) return
    self%written = self%written + 1
    self%sets = self%sets + 1
    if (self%sets == 2 .and. self%removes) &
      & call remove_checkpoints(self%directory, self%stem, but_of=about%ranks)

  contains

    !> An error of one rank becomes one of all.
    subroutine agree_on(fault)
      type(error_type), allocatable, intent(inout) :: fault
      logical :: failed

      failed = any_of_ranks(system%body%order, allocated(fault))
      if (failed .and. .not. allocated(fault)) &
        & call fail(fault, 'another rank could not write its part')
    end subroutine agree_on
  end subroutine write_checkpoint

  pure function folder_of(path) result(folder)
    character(*), intent(in) :: path
    character(:), allocatable :: folder
    folder = './'
    if (index(path, '/') > 0) folder = path(:index(path, '/', back=.true.))
  end function folder_of

end module pd_output_checkpoint_checkpoint
