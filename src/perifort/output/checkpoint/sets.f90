!> Sets of checkpoints: each rank of a run writes one of its own, and those of one step belong
!> together. A later run, on any number of ranks, goes on from the set of the highest step of which
!> all files are there and sound.
!>
!> Every set has a file of the first rank, which says how many there are. So no folder is searched.
module pd_output_checkpoint_sets
  use pd_base_checksum, only: parts_of, value_of
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: newline, to_text
  use pd_comm_world, only: world_type
  use pd_output_checkpoint_checkpoint, only: about_type, checkpoint_path, older_path, open_about, &
    & stem_of_part, stem_of_rank
  use pd_output_checkpoint_file, only: reader_type
  use pd_output_results_files, only: file_exists
  implicit none (type, external)
  private
  public :: set_type, find_set

  integer, parameter :: missing = 0, newest = 1, older = 2  !! which of a rank's files belongs to it
  integer, parameter :: most_ranks = 100000000
  integer, parameter :: most_sets = 4       !! with a file of the first rank
  integer, parameter :: values_of_set = 6   !! that ranks tell each other

  !> A set of checkpoints of one step.
  type :: set_type
    integer :: ranks = 0                  !! that wrote it; 0: there is none
    integer :: step = -1                  !! complete steps (iterations)
    integer(i8) :: points = 0_i8          !! checksum of the points of all ranks
    logical :: verified = .false.         !! its files have been read to their ends
    integer, allocatable :: which(:)      !! (0:ranks - 1) whether the newest or the older file
    character(:), allocatable :: note     !! why it is not the newest; '' if it is
  contains
    procedure :: path_of
  end type set_type

contains

  !> The path of a rank's file.
  pure function path_of(self, directory, stem, rank) result(path)
    class(set_type), intent(in) :: self    !! a set that is there
    character(*), intent(in) :: directory  !! of the checkpoints
    character(*), intent(in) :: stem       !! name of the results' files without their endings
    integer, intent(in) :: rank            !! that wrote it, from 0
    character(:), allocatable :: path

    path = checkpoint_path(directory, stem_of_part(stem, rank, self%ranks))
    if (self%which(rank) == older) path = older_path(path)
  end function path_of

  !> The set from which a run goes on: the complete one with the highest step; `ranks` is 0 if there
  !> are no checkpoints at all. An error if there are some, and no set is complete. All ranks must
  !> call it together.
  !>
  !> On one rank, where no others have left files, the newest file is not looked into.
  subroutine find_set(directory, stem, world, set, error)
    character(*), intent(in) :: directory     !! of the checkpoints
    character(*), intent(in) :: stem          !! name of the results' files without their endings
    type(world_type), intent(inout) :: world  !! the ranks of the run
    type(set_type), intent(out) :: set
    type(error_type), allocatable, intent(out) :: error
    type(set_type) :: candidates(most_sets)
    character(:), allocatable :: faults, gaps
    real(wp) :: there(1)
    integer :: order(most_sets), i, n

    set%note = ''
    if (world%ranks == 1) then
      if (find_alone(directory, stem, set)) return
    end if
    faults = ''
    if (world%rank == 0) call list_candidates(directory, stem, candidates, faults)
    call tell_all(world, candidates)
    call order_candidates(world%ranks, candidates, order, n)
    gaps = ''
    do i = 1, n
      set = candidates(order(i))
      call verify(directory, stem, world, set)
      if (all(set%which /= missing)) then
        set%note = faults//gaps
        return
      end if
      gaps = gaps//newline//'  note            those of step '//to_text(set%step)//' on '// &
        & to_text(set%ranks)//' ranks are not complete: that of rank '// &
        & to_text(findloc(set%which, missing, dim=1) - 1)//' is missing or damaged'
    end do
    set = set_type(note='')
    there = merge(1.0_wp, 0.0_wp, n > 0 .or. faults /= '' .or. file_exists( &
      & checkpoint_path(directory, stem_of_rank(stem, world%rank))) .or. file_exists( &
      & checkpoint_path(directory, stem_of_rank(stem, 1))))
    call world%take_largest(there)
    if (.not. there(1) > 0.5_wp) return
    call fail(error, 'no set of checkpoints in '//directory//' is complete, with one of each '// &
      & 'rank that wrote it'//faults//gaps//newline//'  --overwrite without --restart starts again')
    error%everywhere = .true.
    error%elsewhere = world%rank > 0
  end subroutine find_set

  !> One rank, and no file of several: true, with the newest file, or the older one if that alone is
  !> there. So too where the newest one cannot be read, which the reader of it will say.
  logical function find_alone(directory, stem, set) result(alone)
    character(*), intent(in) :: directory, stem
    type(set_type), intent(inout) :: set
    type(reader_type) :: reader
    type(about_type) :: about
    type(error_type), allocatable :: fault
    character(:), allocatable :: path, of_first
    integer :: which

    path = checkpoint_path(directory, stem)
    which = missing
    if (file_exists(path)) then
      which = newest
    else if (file_exists(older_path(path))) then
      which = older
    end if
    of_first = checkpoint_path(directory, stem_of_rank(stem, 0))
    alone = .not. (file_exists(of_first) .or. file_exists(older_path(of_first)))
    if (.not. alone .and. which == newest) then
      call open_about(path, reader, about, fault)
      call reader%close()
      alone = allocated(fault)
    end if
    if (.not. alone .or. which == missing) then
      ! files of others than the first are told apart from none at all
      alone = alone .and. .not. file_exists(checkpoint_path(directory, stem_of_rank(stem, 1)))
      return
    end if
    set%ranks = 1
    allocate (set%which(0:0), source=which)
  end function find_alone

  !> The sets of which the first rank has a file that is sound; `faults` says what is wrong with
  !> others.
  subroutine list_candidates(directory, stem, candidates, faults)
    character(*), intent(in) :: directory, stem
    type(set_type), intent(inout) :: candidates(:)
    character(:), allocatable, intent(inout) :: faults
    type(reader_type) :: reader
    type(about_type) :: about
    type(error_type), allocatable :: fault
    character(:), allocatable :: path
    integer :: i

    do i = 1, most_sets
      path = checkpoint_path(directory, stem)
      if (i > 2) path = checkpoint_path(directory, stem_of_rank(stem, 0))
      if (mod(i, 2) == 0) path = older_path(path)
      if (.not. file_exists(path)) cycle
      about = about_type()
      call open_about(path, reader, about, fault)
      call reader%close()
      if (allocated(fault)) then
        faults = faults//newline//'  note            '//fault%message
        cycle
      end if
      if (about%ranks > most_ranks .or. (i <= 2 .neqv. about%ranks == 1)) cycle
      candidates(i)%ranks = about%ranks
      candidates(i)%step = about%step
      candidates(i)%points = about%points
    end do
  end subroutine list_candidates

  !> What the first rank has found becomes known to all.
  subroutine tell_all(world, candidates)
    type(world_type), intent(inout) :: world
    type(set_type), intent(inout) :: candidates(:)
    real(wp) :: values(values_of_set, most_sets), line(values_of_set*most_sets)
    integer :: i

    values = 0.0_wp
    if (world%rank == 0) then
      do i = 1, most_sets
        values(:, i) = [real(candidates(i)%ranks, wp), real(candidates(i)%step, wp), &
          & parts_of(candidates(i)%points)]
      end do
    end if
    line = reshape(values, shape(line))
    call world%add_all(line)
    values = reshape(line, shape(values))
    do i = 1, most_sets
      candidates(i)%ranks = nint(values(1, i))
      candidates(i)%step = nint(values(2, i))
      candidates(i)%points = value_of(values(3:, i))
    end do
  end subroutine tell_all

  !> The places of the candidates that there are, from the highest step down; of one step those on
  !> as many ranks as now come first.
  pure subroutine order_candidates(ranks, candidates, order, n)
    integer, intent(in) :: ranks
    type(set_type), intent(in) :: candidates(:)
    integer, intent(out) :: order(:)
    integer, intent(out) :: n         !! candidates that there are
    integer :: i, j

    n = 0
    order = 0
    do i = 1, size(candidates)
      if (candidates(i)%ranks == 0) cycle
      n = n + 1
      do j = n - 1, 1, -1
        if (.not. before(candidates(i), candidates(order(j)))) exit
        order(j + 1) = order(j)
      end do
      order(j + 1) = i
    end do

  contains

    pure logical function before(one, other)
      type(set_type), intent(in) :: one, other
      before = one%step > other%step
      if (one%step == other%step) before = one%ranks == ranks .and. other%ranks /= ranks
    end function before
  end subroutine order_candidates

  !> Find the files of a set; the ranks share the work of reading them.
  subroutine verify(directory, stem, world, set)
    character(*), intent(in) :: directory, stem
    type(world_type), intent(inout) :: world
    type(set_type), intent(inout) :: set   !! gets `which`, `missing` where there is no sound file
    type(reader_type) :: reader
    type(about_type) :: about
    type(error_type), allocatable :: fault
    character(:), allocatable :: path
    real(wp), allocatable :: found(:)
    integer :: r, i

    allocate (found(0:set%ranks - 1), source=0.0_wp)
    do r = world%rank, set%ranks - 1, world%ranks
      do i = newest, older
        path = checkpoint_path(directory, stem_of_part(stem, r, set%ranks))
        if (i == older) path = older_path(path)
        if (.not. file_exists(path)) cycle
        about = about_type()
        call open_about(path, reader, about, fault)
        call reader%close()
        if (allocated(fault)) cycle
        if (about%ranks /= set%ranks .or. about%step /= set%step .or. &
          & about%points /= set%points) cycle
        found(r) = real(i, wp)
        exit
      end do
    end do
    call world%take_largest(found)
    if (allocated(set%which)) deallocate (set%which)
    allocate (set%which(0:set%ranks - 1))
    set%which = nint(found)
    set%verified = .true.
  end subroutine verify

end module pd_output_checkpoint_sets
